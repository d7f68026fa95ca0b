"""Grazing: a trajectory that touches a surface is decided down to 1e-12 of its scale, and recorded below."""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, Switch, System, solve
from pwsmooth.laws.friction import GMS
from pwsmooth.scenes import prescribed_motion

t, x = sp.symbols("t x", real=True)
lam = Switch("lam", x)
# x = (t - 1)^2 + a above the surface; below it x falls at once.
system = System({x: 2 * (t - 1) + lam - 1}, time=t)


@pytest.mark.parametrize("dip", [1e-3, 1e-9, 2e-12])
def test_a_dip_that_stays_clear_of_the_surface_is_no_event(dip):
    solution = solve(system, (0, 2), {x: 1 + dip})
    assert len(solution.events) == 0 and solution.ambiguities == []
    assert solution.x[0, -1] == pytest.approx(1 + dip, abs=1e-13)


@pytest.mark.parametrize("dip", [1e-3, 1e-9, 1e-11])
def test_a_dip_through_the_surface_is_a_crossing_at_its_first_root(dip):
    solution = solve(system, (0, 2), {x: 1 - dip})
    assert [event.kind for event in solution.events] == ["crossing"]
    assert solution.events[0].time == pytest.approx(1 - dip**0.5, abs=1e-16 / dip**0.5 + 1e-14)
    assert solution.ambiguities == []


@pytest.mark.parametrize("dip", [1e-14, 0, -1e-14])
def test_exact_grazing_is_recorded_and_stops_a_strict_run(dip):
    solution = solve(system, (0, 2), {x: 1 + dip})
    assert [a.kind for a in solution.ambiguities] == ["grazing"]
    assert solution.ambiguities[0].time == pytest.approx(1, abs=0.1)
    assert solution.ambiguities[0].taken == ("cross" if len(solution.events) else "touch and stay on this side")
    stopped = solve(system, (0, 2), {x: 1 + dip}, strict=True)
    assert stopped.outcome.name == "AMBIGUITY" and stopped.t[-1] == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_dip_within_rounding_is_recorded_by_both_methods(method, side):
    # h = cos t + 1 +- d, whose least value is +- d at t = pi; size 2
    y, w, s, d = sp.symbols("y w s d", real=True)
    system = System({y: w, w: -(y - 1), s: sp.sign(y + d)}, parameters={d: 0.0})
    for k in (14, 15, 16):
        got = solve(system, (0, 5), [2.0, 0.0, 0.0], parameters={d: side * 10.0**-k}, method=method,
                    rtol=1e-12, atol=1e-14)  # fmt: skip
        assert [a.kind for a in got.ambiguities] == ["grazing"]
        assert got.ambiguities[0].time == pytest.approx(math.pi, abs=1e-5)
    for k in (5, 7):
        got = solve(system, (0, 5), [2.0, 0.0, 0.0], parameters={d: side * 10.0**-k}, method=method,
                    rtol=1e-12, atol=1e-14)  # fmt: skip
        assert not got.ambiguities and len(got.event_times("crossing")) == (0 if side > 0 else 2)


def test_each_of_two_surfaces_grazed_in_one_step_is_recorded():
    # x = (t - 1)^2 and y = (t - 1.2)^2: one polynomial step from 0 to 2
    y = sp.Symbol("y", real=True)
    two = System({x: 2 * (t - 1) + lam - 1, y: 2 * (t - 1.2) + Switch("mu", y) - 1}, time=t)
    solution = solve(two, (0, 2), {x: 1, y: 1.44})
    assert sorted(a.kind for a in solution.ambiguities) == ["grazing", "grazing"]
    assert sorted(a.switch for a in solution.ambiguities) == ["lam", "mu"]
    assert sorted(a.time for a in solution.ambiguities) == pytest.approx([1, 1.2], abs=0.15)
    stopped = solve(two, (0, 2), {x: 1, y: 1.44}, strict=True)
    assert stopped.t[-1] == pytest.approx(1, abs=0.15) and len(stopped.ambiguities) == 1


def test_an_event_that_is_grazed_later_hides_no_grazed_surface():
    late = Event(surface=(t - sp.Rational(3, 2)) ** 2, name="late")
    solution = solve(System({x: 2 * (t - 1) + lam - 1}, time=t, events=[late]), (0, 2), {x: 1})
    assert [(a.kind, a.switch) for a in solution.ambiguities] == [("grazing", "lam"), ("grazing", "late")]


# ---- whatever is touched, and wherever on a step

y, count = sp.symbols("y count", real=True)
mu = Switch("mu", y)
# h = (t - 1)^2 + dip of a switch, of an event, and 1 - |lambda| of a sliding multiplier.
TOUCHED = {
    "lam": lambda dip, events: (System({x: 2 * (t - 1) + lam - 1, count: 0 * x}, time=t, events=events), [1 + dip, 0]),
    "acting": lambda dip, events: (
        System({x: 2 * (t - 1), count: 0 * x}, time=t,
               events=[Event(x, update={count: count + 1}, name="acting"), *events]),
        [1 + dip, 0],
    ),
    "mu": lambda dip, events: (System({y: 1 - dip - (t - 1) ** 2 - mu, count: 0 * y}, time=t, events=events), [0, 0]),
}  # fmt: skip
CUT = {
    "inside a step": [],
    "at a stroke of a clock": [Event(at=[1], update={Memory("ticks", 0): 1})],
    "at a surface": [Event(t - 1, update={Memory("passed", 0): 1})],
}


@pytest.mark.parametrize("dip", [1e-15, 0, -1e-15])
@pytest.mark.parametrize("where", CUT)
@pytest.mark.parametrize("name", TOUCHED)
@pytest.mark.parametrize("method", ["taylor", "rk"])
def test_a_touch_is_recorded_whatever_is_touched_and_wherever_the_step_ends(method, name, where, dip):
    system, start = TOUCHED[name](dip, CUT[where])
    run = solve(system, (0, 2), start, method=method, rtol=1e-12, atol=1e-14)
    assert [(a.kind, a.switch) for a in run.ambiguities] == [("grazing", name)]
    assert run.ambiguities[0].time == pytest.approx(1, abs=0.1 if where == "inside a step" else 1e-6)


@pytest.mark.parametrize("where", CUT)
@pytest.mark.parametrize("name", TOUCHED)
@pytest.mark.parametrize("clear", [1e-3, 1e-9, -1e-9, -1e-3])
def test_what_stays_clear_or_passes_clearly_is_no_touch(name, where, clear):
    system, start = TOUCHED[name](clear, CUT[where])
    assert not solve(system, (0, 2), start).ambiguities


def test_an_event_that_would_not_act_is_not_touched():
    idle = Event(x, update={count: count + 1}, when=count > 0)
    assert not solve(System({x: 2 * (t - 1), count: 0 * x}, time=t, events=[idle]), (0, 2), [1, 0]).ambiguities


@pytest.mark.parametrize("size", [0.79, 0.8, 0.81])
def test_an_amplitude_equal_to_a_break_away_distance_is_recorded(size):
    # One element: it breaks away at F_s/kappa = 0.8.
    law = GMS(kappa=(2.5,), share=(1.0,), sigma=0.0, F_c=1.0, F_s=2.0, v_s=8.0, C=50.0)
    scene = prescribed_motion(law, position=size * sp.sin(2 * sp.pi * t), t_span=(0, 2))
    times = [a.time for a in scene.solve().ambiguities]
    assert times == (pytest.approx([0.25, 0.75, 1.25, 1.75], abs=1e-6) if size == 0.8 else [])


def test_of_random_curves_that_a_clock_cuts_those_with_a_double_zero_there_are_touches():
    """h = a_0 + a_1 s + a_2 s^2 + a_3 s^3, s = t - 1, positive before: touched at t = 1 where a_0 = a_1 = 0 < a_2."""
    a = sp.symbols("a0:4", real=True)
    s = t - 1
    h = sum(c * s**k for k, c in enumerate(a))
    curve = System({x: sp.diff(h, t), count: 0 * x}, time=t, parameters=dict.fromkeys(a[1:], 1),
                   events=[Event(x, update={count: count + 1}), Event(at=[1], update={count: count + 1})])  # fmt: skip
    random, touches = np.random.default_rng(11), 0
    for _ in range(300):
        values = random.uniform(-1, 1, 4) * 10.0 ** random.integers(-3, 4)
        order = random.integers(0, 4)
        values[:order] = 0.0
        if order == 2:
            values[2] = abs(values[2])
        at = np.linspace(-0.1, -1e-4, 50)
        before = np.polynomial.polynomial.polyval(at, values)
        if not (before > 0).all():
            values *= -1
            if order == 2 or not (-before > 0).all():
                continue
        start = float(np.polynomial.polynomial.polyval(-0.1, values))
        run = solve(
            curve, (0.9, 1.05), [start, 0], parameters=dict(zip(a[1:], values[1:])), rtol=1e-12, atol=1e-300
        )
        touches += order == 2
        assert bool(run.ambiguities) == (order == 2), (values, run.ambiguities)
    assert touches > 30
