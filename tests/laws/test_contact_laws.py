"""Contact laws in a free impact and as a falling ball: tables, order, energy, sign of the force.

Guards: laws/contact/.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth.laws.contact import (
    ETA,
    Anagnostopoulos,
    BaiImpact,
    Hertz,
    HertzImpact,
    HuntCrossley,
    KelvinVoigt,
    LinearResidual,
    LiuImpact,
    ResidualHuntCrossley,
    ResidualIndentation,
    RigidImpact,
    composite_modulus,
    contact_duration,
    effective_restitution,
    journal_stiffness,
    maximal_indentation,
)
from pwsmooth.scenes import (
    falling_ball,
    free_impact,
    grazing_amplitude,
    impact_oscillator,
    prescribed_motion,
    pressed_block,
    t,
)

TIGHT = dict(rtol=1e-12, atol=1e-16)


def released(scene, **options):
    """(solution, column of the first loss of contact)."""
    solution = scene.solve(**(dict(rtol=1e-10, atol=1e-14, dense_output=True) | options))
    assert solution.success
    return solution, int(np.searchsorted(solution.t, solution.event_times("reset", "lift-off")[0]))


# ---- laws with residual indentation ---------------------------------------------------------------

# Unit mass, v0 = 1, no gravity, K = 1000: time and place of the loss of force, speed there, largest indentation and
# force. From the specification, computed there independently; the reconstructions R1 and R2 are no published values.
FEATURES = [
    (LinearResidual(K=1000, beta=0.02, gamma=500), 0.081396, 0.0089263, 0.44826, 0.021170, 27.588),
    (LinearResidual(K=1000, beta=0.1, gamma=500), 0.043661, 0.0074451, 0.07501, 0.0086458, 79.73),
    (ResidualIndentation(K=1000, beta=0.02, gamma=500), 0.194869, 0.0120794, 0.60408, 0.055239, 14.189),
    (ResidualIndentation(K=1000, beta=0.1, gamma=500), 0.180864, 0.0145311, 0.14533, 0.026355, 28.972),
    (ResidualIndentation(K=1000, beta=0.02, gamma=500, n=2), 0.322836, 0.0138829, 0.69416, 0.100016, 10.511),
    (ResidualHuntCrossley(K=1000, beta=0.02, gamma=500), 0.190892, 0.0142044, 0.71059, 0.060278, 15.443),
]


@pytest.mark.parametrize("law, end, place, speed, deepest, strongest", FEATURES)
def test_residual_laws_lose_their_force_where_the_table_says(law, end, place, speed, deepest, strongest):
    solution, off = released(free_impact(law))
    # 1e-4 relative, and half a unit of the last printed digit where that is more (.07501, 79.73)
    assert solution.t[off] == pytest.approx(end, rel=1e-4)
    assert solution["p"][off] == pytest.approx(place, rel=1e-4)
    assert -solution["v"][off] == pytest.approx(speed, rel=1e-4, abs=5e-6)
    fine = np.linspace(0, solution.t[off], 4001)
    assert solution(fine, "p").max() == pytest.approx(deepest, rel=5e-3)
    assert solution(fine, "force").max() == pytest.approx(strongest, rel=5e-3)
    # Continuous at touch-down; never negative but for rounding of K p; lost at p* = beta gamma a/(1 + beta gamma).
    assert solution["force"][0] == 0
    assert solution["force"].min() > -1e-15 * law.K
    level = law.beta * law.gamma / (1 + law.beta * law.gamma)
    assert solution["p"][off] == pytest.approx(level * solution["a"][off], rel=1e-9)


def test_the_inclusion_holds_along_a_ball_that_bounces_on_it():
    # (5.3): 0 <= w = gamma (a - p) + a', 0 <= y = a + (1/gamma + beta) a', w y = 0, and F = K y
    law = LinearResidual(K=1e4, beta=0.005, gamma=1000)
    solution = falling_ball(law).solve(dense_output=True)
    times = np.linspace(0, 3, 4001)
    p, a, force = (solution(times, name) for name in ("p", "a", "force"))
    contact = solution(times, "force") > 0
    rate = np.where(contact, law.gamma * (p - a), -law.gamma * a / (1 + law.gamma * law.beta))
    w, y = law.gamma * (a - p) + rate, a + (1 / law.gamma + law.beta) * rate
    size = 1e-12 * law.gamma * 0.1
    assert w.min() >= -size and y.min() >= -size and np.abs(w * y).max() <= size
    assert force == pytest.approx(law.K * np.maximum(y, 0), abs=law.K * size)


# m = 1, g = 9.81, height 0.1: first lift-off (t, p, v), apexes, peak force, number of lift-offs. Specification, half a
# unit of its last digit.
BALLS = [
    (ResidualIndentation(beta=0.002), (0.172831, 1.9474e-3, -0.96794), (0.045806,), 158.4, None),
    (ResidualIndentation(beta=0.005), (0.172406, 2.9429e-3, -0.58057), (0.014237, 0.000544), 143.7, 2),
    (ResidualIndentation(beta=0.01), (0.175731, 2.4325e-3, -0.23370), (0.000351,), 188.3, 1),
    (ResidualIndentation(beta=0.02), None, (), 346.9, 0),
    (LinearResidual(K=1e4, beta=0.005, gamma=1000), (0.171317, 3.5627e-3, -0.71013), (0.022140, 0.003331), 128.8, 2),
    (HuntCrossley(b=0.3), (0.174956, 0.0, -1.03877), (0.054997, 0.033627, 0.021940), 168.8, None),
]  # fmt: skip


@pytest.mark.parametrize("law, lift, tops, peak, count", BALLS)
def test_a_falling_ball_bounces_as_the_table_says(law, lift, tops, peak, count):
    scene = falling_ball(law)
    solution = scene.solve(rtol=1e-10, atol=1e-14, dense_output=True)
    assert solution.event_times("reset", "touch-down")[0] == pytest.approx(math.sqrt(0.2 / 9.81), abs=1e-14)
    offs = solution.event_times("reset", "lift-off")
    assert count is None or len(offs) == count
    if lift:
        got = offs[0], solution(offs[0], "p"), solution(offs[0], "v")
        assert got == pytest.approx(lift, rel=5e-5, abs=5e-7)
    assert scene.observables["apexes"](solution)[: len(tops)] == pytest.approx(tops, abs=6e-7)
    assert solution(np.linspace(0.14, 0.18, 8001), "force").max() == pytest.approx(peak, abs=0.06)


def test_residual_laws_come_to_rest_at_the_static_indentation_and_hunt_crossley_does_not():
    for law in (ResidualIndentation(beta=0.005), ResidualHuntCrossley(beta=0.005)):
        solution = falling_ball(law).solve()
        # (m g/K)^(2/3) = 2.127058e-3 m
        assert solution["p"][-1] == pytest.approx((9.81 / 1e5) ** (2 / 3), rel=1e-9)
        assert abs(solution["v"][-1]) < 1e-9
    bouncing = falling_ball(HuntCrossley(b=0.3)).solve()
    assert abs(bouncing["v"][-1]) > 0.01


def test_a_rigid_ball_accumulates_and_rests():
    solution = falling_ball(RigidImpact(e=0.7)).solve(**TIGHT)
    fall = math.sqrt(0.2 / 9.81)
    assert solution.event_times("accumulation") == pytest.approx([fall * (1 + 2 * 0.7 / 0.3)], abs=1e-9)
    assert solution["force"][-1] == pytest.approx(9.81, abs=1e-11)


# ---- Kelvin-Voigt and Hunt-Crossley ---------------------------------------------------------------


def test_kelvin_voigt_as_printed_jumps_and_pulls():
    solution, off = released(free_impact(KelvinVoigt(K=1000, b=0.02)))
    zeta = 0.02 * math.sqrt(1000) / 2
    e = math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2))
    assert -solution["v"][off] == pytest.approx(e, rel=1e-9)
    assert e == pytest.approx(0.350920, abs=5e-7)
    assert solution["force"][0] == pytest.approx(20, rel=1e-12)
    assert solution["force"].min() == pytest.approx(-7.018, abs=5e-4)


def test_kelvin_voigt_released_at_zero_force_never_pulls_and_is_the_limit_of_the_linear_residual_law():
    solution = free_impact(KelvinVoigt(K=1000, b=0.02, release="zero force")).solve(**TIGHT)
    zeta = 0.02 * math.sqrt(1000) / 2
    root = math.sqrt(1 - zeta**2)
    e = math.exp(-zeta / root * (math.pi - math.atan2(2 * zeta * root, 1 - 2 * zeta**2)))
    assert e == pytest.approx(0.434875, abs=5e-7)
    assert -solution["v"][-1] == pytest.approx(e, rel=1e-10)
    assert solution["force"].min() >= -4e-16 * 1000 * solution["p"].max()  # rounding of K (p + b v)
    scene = free_impact(LinearResidual(K=1000, beta=0.02))
    errors = [abs(-scene.solve(parameters={"gamma": gamma})["v"][-1] - e) for gamma in (1e4, 2e4, 4e4)]
    # first order in 1/gamma
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.05)


def test_hunt_crossley_returns_the_closed_form_of_its_eta():
    scene = free_impact(HuntCrossley(b=1.0))
    for eta, e in ((0.1, 0.937476), (0.5, 0.748435), (1.0, 0.593624), (5.0, 0.196980)):
        solution = scene.solve(parameters={"b": eta / 2.0, "K": 3e4}, x0={"p": 0, "v": 2.0})
        assert -solution["v"][-1] / 2.0 == pytest.approx(e, abs=6e-7)


def test_a_contact_that_is_pulled_apart_sticks_only_where_the_law_as_printed_does():
    pull = 2 - 60 * t  # pressed, then pulled off faster and faster
    for law, sticky in (
        (HuntCrossley(K=1e3, b=20.0), True),
        (KelvinVoigt(), True),
        (HuntCrossley(K=1e3, b=20.0, release="zero force"), False),
        (KelvinVoigt(release="zero force"), False),
        (HertzImpact(c_r=0.3), False),
        (LinearResidual(), False),
        (ResidualIndentation(), False),
        (ResidualHuntCrossley(), False),
    ):
        solution = pressed_block(law, pull, p0=0.01, t_span=(0, 0.6)).solve()
        assert solution.success and solution["p"][-1] < 0
        low, high = solution["force"].min(), solution["force"].max()
        assert low < -1e-3 * high if sticky else low >= -1e-12 * high, type(law).__name__


# ---- the family with a restitution ----------------------------------------------------------------


def test_effective_restitution_depends_on_eta_alone():
    # Stiffness, mass, speed, clearance, elastic part: each changed, for weak and strong damping.
    E = composite_modulus(207e9, 0.3)
    cases = [
        (HertzImpact(K=1e5), {}, 1.0),
        (HertzImpact(K=1e5), {"K": 3e9, "mass": 0.2}, 0.3),
        (LiuImpact(E_star=E), {"clearance": 1e-5}, 0.3),
        (LiuImpact(E_star=E), {"clearance": 1e-3, "mass": 5.0, "length": 0.1}, 1e-4),  # 100 x the latch's floor
        (BaiImpact(E_star=E), {}, 3.0),
    ]
    for law, other, speed in cases:
        scene = free_impact(law, speed=1.0)
        for c_r in (0.3, 0.9):
            start = dict(scene.x0) | {"v": speed, "speed": speed}
            scale = maximal_indentation(1e5, 1.5, 1, speed) if isinstance(law, HertzImpact) else 1e-7 * speed
            atol = [1e-13 * scale, 1e-15 * speed, 1e-15]
            solution = scene.solve((0, 1), start, parameters={"c_r": c_r, **other}, rtol=1e-12, atol=atol)
            e = effective_restitution(law.eta, c_r)
            assert -solution["v"][-1] / speed == pytest.approx(e, abs=1e-9), (type(law), other, c_r)


def test_the_speed_is_latched_anew_at_every_touch_down():
    # A ball: every bounce returns the same share, although each has another speed.
    solution = falling_ball(HertzImpact(K=1e7, c_r=0.5), g=1e-3, height=0.1).solve((0, 120), rtol=1e-11)
    e = effective_restitution("lankarani-nikravesh", 0.5)
    speed = solution["speed"][np.flatnonzero(np.diff(solution["speed"])) + 1]
    # Weight during contact: g T/v0, T the contact's duration, of the restitution.
    slack = 1e-3 * contact_duration(1e7, 1.5, 1, speed[3]) / speed[3]
    assert speed[1:4] / speed[:3] == pytest.approx(e, abs=3 * slack)


def test_the_force_curve_of_an_impact_has_the_checked_depth_and_duration():
    # m = 1, v0 = 0.3, c_r = 0.5: specification, half a unit of the last digit.
    liu = LiuImpact(E_star=composite_modulus(207e9, 0.3), length=0.02, clearance=1e-4, c_r=0.5)
    for law, depth, duration in (
        (liu, 8.8974e-6, 1.2893e-4),
        (HertzImpact(K=5e9, c_r=0.5), 48.673e-6, 5.63168e-4),
    ):
        solution, off = released(free_impact(law, speed=0.3), atol=[1e-18, 1e-15, 1e-15])
        assert solution.t[off] == pytest.approx(duration, rel=5e-6 if duration > 2e-4 else 4e-5)
        assert solution(np.linspace(0, duration, 20001), "p").max() == pytest.approx(depth, rel=1.1e-5)


def test_anagnostopoulos_dashpot_gives_exactly_its_restitution():
    solution, off = released(free_impact(Anagnostopoulos(c_r=0.37)))
    assert -solution["v"][off] == pytest.approx(0.37, rel=1e-10)


def test_stiffness_of_a_journal_in_its_bearing():
    E = composite_modulus(207e9, 0.3)
    got = [journal_stiffness(E, 0.01, 0.01 - c) for c in (0.25e-3, 0.5e-3, 1e-3)]
    assert got == pytest.approx([9.4704e10, 6.6102e10, 4.5495e10], abs=5e5)
    # Liu's K_i(0) = (pi E* L/2)/sqrt(2 c)
    liu = [math.pi * E * 0.015 / 2 / math.sqrt(2 * c) for c in (0.25e-3, 0.5e-3, 1e-3)]
    assert liu == pytest.approx([1.1985e11, 8.4744e10, 5.9923e10], rel=5e-5)


def test_the_stored_energy_of_the_journal_laws_is_the_work_of_their_elastic_force():
    for law in (LiuImpact(), BaiImpact()):
        d = sp.Symbol("d", real=True)
        pieces = law.attach(position=d, velocity=sp.Float(0))
        stored, force = (e.args[0][0].subs(pieces.parameters) for e in (pieces.outputs["stored"], pieces.force))
        slope, pull = sp.lambdify(d, stored.diff(d)), sp.lambdify(d, force)
        for depth in (1e-9, 1e-6, 5e-4):
            assert slope(depth) == pytest.approx(float(pull(depth)), rel=1e-11)


# ---- order and energy -----------------------------------------------------------------------------


def test_a_fixed_step_has_order_five_halves_through_touch_down():
    # delta^1.5 ~ t^1.5 at touch-down and release: a step over it errs by h^2.5, whatever the method's order is.
    # The last step ends at release: of each run it is the same share of a whole one.
    scene = free_impact(HertzImpact(c_r=0.5))
    e = effective_restitution("lankarani-nikravesh", 0.5)
    (release,) = [event.time for event in scene.solve((0, 0.06)).events if event.switch == "lift-off"]
    steps, errors = release / (np.array([70, 140, 280, 560]) + 0.4), []
    for step in steps:
        # Every step is accepted.
        solution = scene.solve((0, 0.06), method="rk", rtol=1e-6, atol=1e6, max_step=step)
        errors.append(abs(-solution["v"][-1] - e))
    assert np.diff(np.log(errors)) / np.diff(np.log(steps)) == pytest.approx(2.5, abs=2e-3)


def test_the_error_of_an_impact_follows_the_tolerance():
    scene = free_impact(HertzImpact(c_r=0.5))
    e = effective_restitution("lankarani-nikravesh", 0.5)
    for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
        solution = scene.solve((0, 0.06), rtol=rtol, atol=1e-4 * rtol)
        assert abs(-solution["v"][-1] - e) < 10 * rtol
        assert solution.cost["steps"] < 40


LAWS = {
    "hertz": lambda r: Hertz(K=10 ** r.uniform(3, 8)),
    "kelvin-voigt": lambda r: KelvinVoigt(K=10 ** r.uniform(2, 5), b=r.uniform(0, 5e-3)),
    "kelvin-voigt, released": lambda r: KelvinVoigt(K=1e4, b=r.uniform(0, 5e-3), release="zero force"),
    "hunt-crossley": lambda r: HuntCrossley(K=10 ** r.uniform(3, 8), b=r.uniform(0, 2)),
    "family": lambda r: HertzImpact(K=10 ** r.uniform(3, 8), c_r=r.uniform(0.05, 1)),
    "journal": lambda r: LiuImpact(clearance=10 ** r.uniform(-5, -3), c_r=r.uniform(0.05, 1)),
    "linear residual": lambda r: LinearResidual(
        K=10 ** r.uniform(3, 5), beta=r.uniform(0, 0.03), gamma=10 ** r.uniform(2, 3.5)
    ),
    "R1": lambda r: ResidualIndentation(
        K=10 ** r.uniform(3, 6), beta=r.uniform(1e-4, 0.03), gamma=10 ** r.uniform(2, 3.5)
    ),
    "R2": lambda r: ResidualHuntCrossley(
        K=10 ** r.uniform(3, 6), beta=r.uniform(1e-4, 0.03), gamma=10 ** r.uniform(2, 3.5)
    ),
    "rigid": lambda r: RigidImpact(e=r.uniform(0, 1)),
}


@pytest.mark.parametrize("name", LAWS)
def test_no_law_creates_energy_over_random_drops(name):
    random = np.random.default_rng(7)
    for _ in range(6):
        law, speed, height = LAWS[name](random), random.uniform(0, 2), 10 ** random.uniform(-2, 0)
        scene = falling_ball(law, height=height, m=random.uniform(0.2, 3), g=random.uniform(0.5, 10))
        solution = scene.solve((0, 1.5), dict(scene.x0) | {"v": speed}, rtol=1e-10, atol=1e-14)
        assert solution.success
        energy = solution["energy"]
        whole = energy.max() - energy.min() + abs(energy[0]) + solution.parameters["mass"] * speed**2
        # Every step errs by rtol of the states, so the energy by a few rtol of the largest share of it.
        assert np.diff(energy).max() <= 20 * 1e-10 * whole
        sticky = name in ("kelvin-voigt", "hunt-crossley")
        assert sticky or solution["force"].min() >= -1e-12 * solution["force"].max()


def test_detecting_touch_down_late_creates_energy_and_locating_it_does_not():
    # RK4 with fixed step on the elastic ball, contact looked at only at the steps: the work of the missed part is free.
    K, v0, h = 1e6, 1.0, contact_duration(1e6, 1.5, 1, 1.0) / 10

    def rate(x, pushing):
        return np.array([x[1], -K * max(x[0], 0) ** 1.5 if pushing else 0.0])

    gains = []
    for shift in np.linspace(0.05, 0.95, 10):
        x = np.array([-shift * h * v0, v0])
        for _ in range(60):
            pushing = x[0] > 0  # late: found at the end of the step that passed the wall
            k1 = rate(x, pushing)
            k2 = rate(x + h / 2 * k1, pushing)
            k3 = rate(x + h / 2 * k2, pushing)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3, pushing))
        gains.append(x[1] ** 2 / v0**2 - 1)
    assert max(gains) > 0.01
    for shift in (0.05, 0.5, 0.95):
        located = free_impact(Hertz(K=K), approach=shift * h * v0).solve(rtol=1e-10, atol=1e-14)
        assert abs(located["v"][-1] ** 2 - 1) < 1e-8


# ---- the oscillator with a stop -------------------------------------------------------------------


def test_the_impact_oscillator_grazes_at_its_closed_form_amplitude():
    d, k, c, omega = 1.0, 1.0, 0.3, 0.8
    critical = grazing_amplitude(d, k, c, 1.0, omega)
    assert critical == pytest.approx(d * math.sqrt((k - omega**2) ** 2 + (c * omega) ** 2), rel=1e-15)
    lag = math.atan2(c * omega, k - omega**2)
    for factor, touches in ((1 - 1e-6, False), (1 + 1e-6, True)):
        # On the steady motion from the start: x = factor d cos(omega t - lag).
        start = factor * d * math.cos(lag), factor * d * omega * math.sin(lag)
        scene = impact_oscillator(
            Hertz(K=100.0), d=d, k=k, c=c, amplitude=factor * critical, omega=omega, x0=start
        )
        solution = scene.solve((0, 30))
        assert bool(len(solution.event_times("reset", "touch-down"))) is touches


# ---- slow re-contact and bad input ----------------------------------------------------------------


def test_a_touch_down_below_the_floor_is_reported_and_latches_the_floor():
    solution = free_impact(HertzImpact(c_r=0.5), speed=1e-7, approach=1e-8).solve((0, 5))
    assert solution.success
    assert len(solution.event_times("reset", "slow touch-down")) == 1
    assert not len(solution.event_times("reset", "touch-down"))
    assert solution["speed"][-1] == 1e-6
    assert solution["force"].min() >= 0


@pytest.mark.parametrize(
    "make, text",
    [
        (lambda: HertzImpact(c_r=0), "`c_r` of HertzImpact is 0"),
        (lambda: LiuImpact(c_r=1.2), "`c_r` of LiuImpact is 1.2"),
        (lambda: Anagnostopoulos(c_r=-0.1), "`c_r` of Anagnostopoulos is -0.1"),
        (lambda: LiuImpact(clearance=-1e-4), "`clearance` of LiuImpact is -0.0001"),
        (lambda: RigidImpact(e=1.1), "at most its speed"),
        (lambda: HertzImpact(eta="newton"), "choose one of hunt-crossley"),
        (lambda: KelvinVoigt(release="never"), "choose one of zero force"),
        (lambda: journal_stiffness(1e11, 0.01, 0.01), "smaller than its bearing"),
        (lambda: composite_modulus(-1, 0.3), "`E_1` is -1"),
        (lambda: free_impact(Hertz(), m=0), "`m` is 0; give a number > 0"),
        (lambda: free_impact(Hertz(), speed=0), "`speed` is 0; give a number > 0"),
        (lambda: free_impact(Hertz(), approach=-1), "`approach` is -1; give a number >= 0"),
        (lambda: falling_ball(Hertz(), height=-0.1), "`height` is -0.1"),
        (lambda: impact_oscillator(Hertz(), x0=(2, 0)), "inside the stop"),
        (lambda: Hertz().attach(velocity=sp.Symbol("v")), "needs the position"),
    ],
)
def test_bad_input_is_refused_at_the_door(make, text):
    with pytest.raises(ValueError, match=text):
        make()


def test_every_name_of_the_table_makes_a_law():
    for name in ETA:
        law = HertzImpact(eta=name)
        assert law.attach(position=sp.Symbol("p"), velocity=sp.Symbol("v")).force.has(sp.Piecewise)


def test_the_loading_curve_of_the_nonlinear_residual_law_has_its_exponent_early_and_less_in_between():
    # Prescribed indentation at constant rate: F/(K p^n) and the log-log slope. Specification, half a unit of the last
    # digit; the limit of early loading is (1 + beta gamma)^n = 36.483.
    law = ResidualIndentation(K=1000, beta=0.02, gamma=500)
    for rate, place, ratio, slope in ((1.0, 1e-6, 36.470, 1.49966), (1e-4, 5e-5, 1.0606, 1.4423)):
        times = place / rate * np.array([1 - 1e-3, 1.0, 1 + 1e-3])
        rig = prescribed_motion(law, position=rate * t, t_span=(0, 1.1 * times[-1]))
        solution = rig.solve(t_eval=times, rtol=1e-12, atol=1e-18)
        force = solution["force"]
        assert force[1] / (1000 * place**1.5) == pytest.approx(ratio, abs=0.5 * 10 ** -(3 if ratio > 10 else 4))
        got = np.log(force[2] / force[0]) / np.log(times[2] / times[0])
        # The difference over 2e-3 of p errs by 1e-6/6 of the slope's own change, less than half a unit.
        assert got == pytest.approx(slope, abs=5.5e-6 if ratio > 10 else 5.5e-5)
