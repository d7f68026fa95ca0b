"""A start on a surface: what rests there leaves when something moves it, whatever is solved for beside.

Guards: kernels/instant/starting.py, kernels/step/meeting.py.
"""

import pytest
import sympy as sp

from pwsmooth import Algebraic, Event, Switch, System, solve

t, v, h, out, x, z, a, w = sp.symbols("t v h out x z a w", real=True)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


def steps(*levels):
    """Piecewise constant in time: (value, end) of each, the last for ever."""
    return sp.Piecewise(*((value, t < end) for value, end in levels[:-1]), (levels[-1], True))


@METHODS
@pytest.mark.parametrize("start", [0.0, 0.3])
def test_a_tank_that_starts_empty_fills_when_the_inflow_rises(start, method):
    # A pump of 1 takes what comes: 0.4 to t = 2, then 1.5 to t = 4.
    inflow = steps((0.4, 2), (1.5, 4), 0.4)
    for rate in (
        sp.Piecewise((inflow - 1, h > 0), (sp.Max(inflow - 1, 0), True)),
        sp.Piecewise((0, sp.And(h <= 0, inflow < 1)), (inflow - 1, True)),
    ):
        run = solve(System({h: rate, out: inflow - rate}, time=t), (0, 5), {h: start, out: 0}, method=method)
        assert run.x[:, -1] == pytest.approx([0.4, 3.8 + start], abs=1e-9)


@METHODS
@pytest.mark.parametrize(
    "force", [steps((1, 1), 0.5), sp.Min(1, 2 - t), 1 - t**2 / 9, sp.cos(t), steps((-1, 1), 0)]
)
def test_a_block_that_starts_under_exactly_the_largest_friction_stays(force, method):
    run = solve(System({v: force - sp.sign(v)}, time=t), (0, 2), {v: 0}, method=method)
    assert run.x[0, -1] == pytest.approx(0, abs=1e-12)


@METHODS
@pytest.mark.parametrize("start", [0.3, 0.7, 1.0])
def test_a_bound_that_is_reached_as_the_input_turns_is_left_at_once(start, method):
    # z falls to 0 at t = `start`, when the input becomes 2.
    e = sp.Piecewise((-1, t < start), (2, True))
    for rate in (
        sp.Piecewise((0, sp.And(z <= 0, e < 0)), (e, True)),
        sp.Piecewise((e, z > 0), (sp.Max(e, 0), True)),
    ):
        run = solve(System({z: rate}, time=t), (0, start + 0.4), {z: start}, method=method)
        assert run.x[0, -1] == pytest.approx(0.8, abs=1e-9)


@METHODS
def test_an_unknown_that_the_side_of_the_start_moves_moves_the_kinks_on_it(method):
    # x rises from its threshold: a is the root of a + a^3/4 = 0.76 there, and a/2 - 0.26 > 0.
    unknown = Algebraic(a, a + a**3 / 4 - (sp.Rational(26, 100) + sp.Heaviside(x) / 2))
    system = System({x: a, w: sp.Abs(a / 2 - sp.Rational(26, 100))}, time=t, algebraic=[unknown])
    root = float(sp.nsolve(a + a**3 / 4 - 0.76, 0.7))
    run = solve(system, (0, 0.1), {x: 0, w: 0}, method=method)
    assert run.x[:, -1] == pytest.approx([0.1 * root, 0.1 * (root / 2 - 0.26)], abs=1e-10)
    assert not run.events


@METHODS
def test_a_start_on_a_jump_of_mod_is_no_event_beside_an_unknown(method):
    saw = sp.Mod(x, 1) - sp.Rational(1, 4)
    unknown = Algebraic(a, a - 2 * x)
    system = System({x: 1}, time=t, algebraic=[unknown], events=[Event(saw, direction=-1)])
    run = solve(system, (0, 0.5), {x: 0}, method=method)
    assert not any(event.kind == "event" for event in run.events)


@METHODS
def test_an_event_on_a_jump_fires_once_beside_an_unknown(method):
    side = sp.sign(sp.Rational(3, 4) - t / 2)
    unknown = Algebraic(a, a + a**3 - x)
    event = Event(x + side, update={x: x + sp.Rational(1, 2)}, name="E")
    run = solve(
        System({x: 0}, time=t, algebraic=[unknown], events=[event]), (0, 2.5), {x: -0.75}, method=method
    )
    assert run.x[0, -1] == -0.25


def test_a_switch_of_ones_own_on_what_stays_at_0_is_0_and_says_so():
    own = Switch("own", h)
    run = solve(System({x: own, h: 0, v: 0.5 - sp.sign(v)}, time=t), (0, 1), {x: 0, h: 0, v: 0})
    assert [entry.kind for entry in run.ambiguities] == ["multipliers not unique"]
    assert run["x"][-1] == 0
