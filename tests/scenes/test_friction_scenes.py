"""Bodies with friction: stick-slip, drift, lag, break-away, hunting, passivity, and the limit of stiff bristles.

Listed numbers of LuGre's scenes are the specification's (independent fixed-tolerance runs of the plain equations).
"""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pwsmooth import Drive
from pwsmooth.laws import friction
from pwsmooth.scenes import (
    block_on_belt,
    force_driven,
    friction_oscillator,
    position_control,
    prescribed_motion,
    t,
)


def crossings(run, level, span, direction=1, name="v", points=40001):
    """Times at which `name` passes a level upwards (1) or downwards (-1)."""
    times = np.linspace(*span, points)
    above = run(times, name) > level
    change = np.flatnonzero(np.diff(above.astype(int)) == direction)
    return np.array([brentq(lambda s: float(run(s, name)) - level, times[k], times[k + 1]) for k in change])


# ---- stick-slip of a block on a belt: k = 2 N/m, 0.1 m/s, 1 kg


def test_two_level_stick_slip_has_its_closed_form_period_speed_and_step():
    # Slip: m e'' = -k e + F_c from e = F_s/k; it ends where tan(w T/2) = -A w/V, A = (F_s - F_c)/k; stick: 2 A/V.
    V, A, w = 0.1, 0.25, math.sqrt(2)
    slip, stick = 2 * (math.pi - math.atan(A * w / V)) / w, 2 * A / V
    run = block_on_belt(friction.StaticKinetic()).solve(dense_output=True)
    starts, ends = run.event_times("slip"), run.event_times("stick")
    assert starts[0] == pytest.approx(0.75 / 0.1, rel=1e-12)
    assert np.diff(starts) == pytest.approx([slip + stick] * 3, rel=1e-9)
    assert ends - starts[: len(ends)] == pytest.approx([slip] * len(ends), rel=1e-9)
    times = np.linspace(starts[1], ends[1], 20001)
    assert run(times, "v").max() == pytest.approx(V + math.hypot(V, A * w), rel=1e-7)
    x = run(np.array([starts[1] - 1, ends[1] + 1]), "x")
    assert x[1] - x[0] == pytest.approx(V * (slip + stick), rel=1e-9)
    digits = [round(a, 4) for a in (slip, slip + stick, V + math.hypot(V, A * w))]
    assert digits == [2.6113, 7.6113, 0.4674]  # the specification's


def test_lugres_stick_slip_has_the_listed_times():
    run = block_on_belt(friction.LuGre()).solve(dense_output=True)
    starts, ends = crossings(run, 0.05, (0, 35)), crossings(run, 0.05, (0, 35), -1)
    assert starts == pytest.approx([7.539, 13.901, 20.263, 26.627, 32.989], rel=3e-3)
    assert ends == pytest.approx([10.0645, 16.4272, 22.7899, 29.1526], rel=3e-3)
    assert np.diff(starts) == pytest.approx([6.362] * 4, rel=3e-3)
    times = np.linspace(13.5, 17, 35001)
    assert run(times, "v").max() == pytest.approx(0.3698, rel=3e-3)
    assert run(times, "friction").max() == pytest.approx(1.4766, rel=3e-3)
    assert float(run(18.0, "x") - run(12.0, "x")) == pytest.approx(0.6363, rel=3e-3)


def test_xky_tends_to_the_period_of_the_switching_block_with_its_stribeck_curve():
    run = block_on_belt(friction.XKY()).solve(dense_output=True)
    assert np.diff(crossings(run, 0.05, (0, 35))) == pytest.approx([6.512] * 4, rel=1e-3)


def test_the_switching_block_tends_to_two_levels_only_as_its_stribeck_velocity_vanishes():
    def period(**values):
        run = block_on_belt(friction.StribeckFriction(**values), t_span=(0, 30)).solve()
        assert run.success
        return float(np.diff(run.event_times("slip"))[-1])

    # With LuGre's standard parameters (v_s = 1 mm/s, viscous 0.4 N s/m) the listed 6.512 s.
    assert period() == pytest.approx(6.512, abs=5e-4)
    two_levels = 2 * (math.pi - math.atan(0.25 * math.sqrt(2) / 0.1)) / math.sqrt(2) + 2 * 0.25 / 0.1
    speeds = np.array([1e-3, 1e-4, 1e-5])
    distance = np.array([period(v_s=v, sigma2=0.0) for v in speeds]) - two_levels
    # While v < v_s the force still holds: the start is late by a time that falls with v_s.
    assert np.all(np.diff(distance) < 0) and 0 < distance[-1] < 0.02 and distance[0] > 0.05


# ---- drift under small cyclic forces


@pytest.mark.parametrize("period", [20.0, 1.0])
def test_bristles_drift_by_their_formula_and_elastic_ranges_do_not(period):
    def drift(law, mean, size, cycles=16):
        drive = mean + size * sp.sin(2 * sp.pi * t / period)
        scene = force_driven(law, drive, t_span=(0, cycles * period))
        return np.diff(scene.solve(t_eval=period * np.arange(cycles - 4, cycles + 1))["x"])

    F_s, F_c, sigma0 = 1.5, 1.0, 1e5
    slow = F_s / sigma0 * math.log((F_s**2 - 0.25**2) / (F_s**2 - 1.25**2))
    # Quasi-static formula: the inertia of 1 kg adds 0.8 % at a period of 1 s.
    assert drift(friction.LuGre(), 0.75, 0.5) == pytest.approx([slow] * 4, rel=1e-4 if period > 1 else 1e-2)
    slow = F_c / sigma0 * math.log((F_c**2 - 0.2**2) / (F_c**2 - 0.8**2))
    assert drift(friction.Dahl(), 0.5, 0.3) == pytest.approx([slow] * 4, rel=1e-4 if period > 1 else 1e-2)
    for law in (friction.ElastoplasticFixed(), friction.XKY()):
        assert np.abs(drift(law, 0.75, 0.5)).max() < 1e-12


def test_all_non_drifting_laws_give_one_elastic_deflection():
    # 20 cycles of 1 s: listed 7.4005 um for both laws, 367.3 um for LuGre, which drifts.
    drive = 0.75 + 0.5 * sp.sin(2 * sp.pi * t)
    end = {
        kind: force_driven(kind(), drive, t_span=(0, 20)).solve(t_eval=[20.0])["x"][0] * 1e6
        for kind in (friction.ElastoplasticFixed, friction.XKY, friction.LuGre)
    }
    assert end[friction.ElastoplasticFixed] == pytest.approx(7.4005, abs=5e-5)
    assert end[friction.XKY] == pytest.approx(7.4005, abs=5e-5)
    assert end[friction.LuGre] == pytest.approx(367.3, abs=0.05)


# ---- lag, break-away, hunting


def test_lugres_lag_loop_grows_with_the_frequency_and_turns_the_right_way():
    Omega = sp.Symbol("Omega", positive=True)
    velocity = sp.Rational(1, 1000) * (sp.Rational(3, 2) + sp.cos(Omega * t))
    areas = []
    for frequency in (1.0, 10.0, 25.0):
        period = 2 * math.pi / frequency
        scene = prescribed_motion(
            friction.LuGre(), velocity=velocity, t_span=(0, 3 * period), parameters={Omega: frequency}
        )
        run = scene.solve(dense_output=True)
        slowing, rising = (
            2 * period + np.linspace(0, 0.5, 2001) * period,
            3 * period - np.linspace(0, 0.5, 2001) * period,
        )
        difference = run(rising, "force") - run(slowing, "force")  # at equal speeds
        assert difference[10:-10].min() > 0
        areas.append(float(np.trapezoid(difference, -run(slowing, "velocity"))))
    assert areas[0] < areas[1] < areas[2]


def test_lugres_break_away_force_falls_with_the_rate_of_the_force():
    rate = sp.Symbol("rate", positive=True)
    peaks = []
    for value in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0):
        scene = force_driven(
            friction.LuGre(), rate * t, t_span=(0, 2.0 / value + 0.1), parameters={rate: value}
        )
        run = scene.solve(dense_output=True)
        moved = crossings(run, 0.02, scene.t_span)[0]
        peaks.append(float(run(np.linspace(0, moved, 20001), "friction").max()))
    assert np.all(np.diff(peaks) < 0)
    assert 1.4 < peaks[0] < 1.5 and 1.0 < peaks[-1] < 1.2


def test_a_pid_controller_hunts_with_the_listed_cycle():
    run = position_control(friction.LuGre()).solve(dense_output=True)
    times = np.linspace(0, 100, 100001)
    x = run(times, "x")
    assert x[:30000].max() == pytest.approx(1.5005, rel=1e-3)
    assert (x[50000:].min(), x[50000:].max()) == pytest.approx((0.936, 1.065), rel=1e-2)
    assert crossings(run, 1e-3, (20, 100), points=200001) == pytest.approx([31.2, 55.6, 80.0], rel=1e-2)


def test_acceleration_dependent_friction_keeps_the_speed_in_a_band_of_forces_and_not_outside():
    law = friction.Wojewoda(f_c=1.0, f_s=1.5, a_1=1.0, a_2=0.5)
    speed = 0.2
    band = 0.5 * math.exp(-speed / 0.5)  # (f_s - f_c) exp(-a_1 v/a_2)

    def run(size):
        scene = force_driven(law, 1 + size * sp.sin(t), t_span=(0, 1.4))
        return scene.solve(x0={**scene.x0, "v": speed}, dense_output=True)

    inside = run(0.99 * band)
    assert inside.success and np.abs(inside["v"] - speed).max() < 1e-12

    size = 3 * band
    outside = run(size)
    assert outside.success
    start = math.asin(1 / 3)
    assert float(outside(0.99 * start, "v")) == pytest.approx(speed, abs=1e-12)

    def acceleration(time, v):
        """The root of a + (f_s - f_c) exp(-a_1 v/(a + a_2)) = u - f_c: increasing in a >= 0."""
        excess = size * math.sin(time)
        rest = lambda a: a + 0.5 * math.exp(-v[0] / (a + 0.5)) - excess  # noqa: E731
        return [brentq(rest, 0, excess, xtol=1e-14) if rest(0) < 0 else 0.0]

    plain = solve_ivp(acceleration, (start, 1.4), [speed], "DOP853", rtol=1e-10, atol=1e-12)
    assert plain.y[0, -1] > speed + 0.1
    assert outside["v"][-1] == pytest.approx(plain.y[0, -1], rel=1e-7)


# ---- passivity


def supplied_beyond_stored(law, stiffness, state, seed):
    """Work supplied minus energy stored in the bristle, over time, under a random motion from rest."""
    random = np.random.default_rng(seed)
    speed = sum(
        float(a) * sp.sin(float(b) * t + float(c))
        for a, b, c in zip(random.normal(0, 3e-3, 4), random.uniform(1, 60, 4), random.uniform(0, 6, 4))
    )
    scene = prescribed_motion(law, velocity=speed, t_span=(0, 2), work=True)
    run = scene.solve(dense_output=True)
    assert run.success
    times = np.linspace(0, 2, 4001)
    energy = stiffness * run(times, state) ** 2 / 2
    return run(times, "work") - energy


@pytest.mark.parametrize("seed", range(4))
def test_xky_is_passive_for_random_motions(seed):
    excess = supplied_beyond_stored(friction.XKY(sigma=3.0, F_s=5.0, sigma2=0.0), 1e5, "a", seed)
    assert excess[0] == 0 and np.diff(excess).min() > -1e-11  # never decreases: 1e-9 of a work of 1e-2 J


def test_lugre_gives_back_more_than_it_stored_and_fading_damping_does_not():
    # Both started with z = 0.95 F_s/sigma0 and a jump to 1 m/s: F = -132.57 N.
    outcome = {}
    for kind in (friction.LuGre, friction.LuGreFadingDamping):
        scene = prescribed_motion(kind(), velocity=1.0, t_span=(0, 1e-5), work=True)
        start = {**scene.x0, "z": 0.95 * 1.5e-5}
        run = scene.solve(x0=start)
        stored = 1e5 / 2 * (run["z"] ** 2 - start["z"] ** 2)
        outcome[kind] = run["force"][0], run["work"][-1] - stored[-1]
    force, excess = outcome[friction.LuGre]
    assert force == pytest.approx(-132.57, abs=5e-3) and excess < -1e-4
    assert outcome[friction.LuGreFadingDamping][1] > 0
    # The theorem's bound for constant damping: sigma2 >= sigma1 (F_s - F_c)/F_c; here 158 against 0.4.
    law = friction.LuGre()
    assert law.sigma1 * (law.F_s - law.F_c) / law.F_c == pytest.approx(158.1, abs=0.05)


# ---- stiff bristles tend to the switching block


@pytest.mark.parametrize("kind", ["LuGre", "XKY"])
def test_stiff_bristles_tend_to_the_switching_block_with_order_one_half(kind):
    # At a direct reversal the bristle is wound through 2 g/sigma0 at the acceleration a: in the time that this takes,
    # sqrt(4 g/(sigma0 a)), the force differs by O(1).
    common = dict(F_c=1.0, F_s=1.5, v_s=0.1)
    motion = dict(amplitude=4.0, x0=(0.5, 0.3), t_span=(0, 8))
    options = dict(rtol=1e-10, t_eval=[8.0])
    block = friction_oscillator(friction.StribeckFriction(**common), **motion).solve(**options)
    assert set(block.itinerary) <= {"slip right (lam=+1)", "slip left (lam=-1)"}
    stiffness = np.array([1.6e4, 6.4e4, 2.56e5])
    distances = []
    for k in stiffness:
        damping = math.sqrt(k)
        law = (
            friction.LuGre(sigma0=k, sigma1=damping, **common)
            if kind == "LuGre"
            else friction.XKY(kappa=k, sigma=damping, **common)
        )
        run = friction_oscillator(law, **motion).solve(**options)
        distances.append(np.hypot(run["y"][0] - block["y"][0], run["v"][0] - block["v"][0]))
    slope = -np.polyfit(np.log(stiffness), np.log(distances), 1)[0]
    assert slope == pytest.approx(0.5, abs=0.03)


def test_a_law_that_begins_relaxed_under_a_record_begins_at_its_rate():
    times = np.linspace(0, 3, 241)
    law = friction.MultistateXKY()
    record = prescribed_motion(law, position=Drive(times, np.sin(4 * times) / 2))
    formula = prescribed_motion(law, position=sp.sin(4 * t) / 2, t_span=(0, 3))
    assert record.x0["s"] == pytest.approx(formula.x0["s"], rel=1e-6)
    assert record.solve()["force"][-1] == pytest.approx(formula.solve()["force"][-1], rel=1e-3)
