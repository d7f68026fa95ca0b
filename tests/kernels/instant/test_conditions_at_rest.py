"""Conditions on what rests at 0: strict and non-strict ones mean what they say.

Guards: kernels/instant/surface_rates.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, System, solve

t, y, z, e, h = sp.symbols("t y z e h", real=True)


def when(condition):
    return sp.Piecewise((1, condition), (0, True))


def ambiguous(run):
    return any(a.kind == "rest on the border of a condition" for a in run.ambiguities)


@pytest.mark.parametrize(
    ("condition", "time"),
    [(y > 0, 1), (y <= 0, 4), (y >= 0, 5), (y < 0, 0), (0 < -y, 0), (sp.Not(y > 0), 4)],
)
def test_a_condition_on_a_state_that_an_event_has_put_to_zero(condition, time):
    # y > 0 up to t = 1, and 0 from there on to 5.
    rest = Event(at=1, update={y: 0})
    for start, span in ((1, (0, 5)), (0, (1, 5))):
        system = System({z: when(condition), y: -y / 4}, events=[rest] if start else [])
        run = solve(system, span, {z: 0, y: start})
        of_motion = 0 if start else int(bool(condition.subs(y, 1)))
        assert run["z"][-1] == pytest.approx(time - of_motion, abs=1e-9) and not ambiguous(run)


def test_it_holds_again_when_the_state_leaves():
    # y' = 1 from t = 3 on.
    system = System({z: when(y > 0), y: when(t > 3) - y / 4}, time=t, events=[Event(at=1, update={y: 0})])
    assert solve(system, (0, 5), {z: 0, y: 1})["z"][-1] == pytest.approx(3, abs=1e-9)


def test_a_condition_on_a_tank_that_has_run_empty():
    # h = (1 - t/2)^2 up to t = 2.
    tank = System({h: -sp.sqrt(sp.Max(h, 0)), z: when(h > 0), e: when(h <= 0)})
    run = solve(tank, (0, 4), {h: 1, z: 0, e: 0})
    np.testing.assert_allclose([run["z"][-1], run["e"][-1]], [2, 2], atol=1e-4)


@pytest.mark.parametrize(
    ("condition", "time"),
    [
        (sp.Max(1 - t, 0) > 0, 1),
        (sp.Max(1 - t, 0) <= 0, 3),
        (sp.Max(1 - t, 0) >= 0, 4),
        (sp.Max(t - 1, 0) > 0, 3),
        (sp.Max(t - 1, 0) <= 0, 1),
        (sp.Min(1 - t, 0) >= 0, 1),
    ],
)
def test_a_condition_on_a_flat_maximum(condition, time):
    assert solve(System({z: when(condition)}, time=t), (0, 4), {z: 0})["z"][-1] == pytest.approx(time, abs=1e-9)


def test_conditions_that_disagree_at_zero_are_recorded():
    rest = Event(at=1, update={y: 0})
    both = System({z: when(y > 0), e: when(y >= 0), y: -y / 4}, events=[rest])
    signs = System({z: sp.sign(y), y: -y / 4}, events=[rest])
    for system, start in ((both, {z: 0, e: 0, y: 1}), (signs, {z: 0, y: 1})):
        run = solve(system, (0, 5), start)
        assert ambiguous(run) or run["z"][-1] == pytest.approx(1, abs=1e-9)


def test_the_sign_of_what_stays_at_zero_is_zero_where_something_slides():
    v = sp.Symbol("v", real=True)
    system = System({z: sp.sign(y), y: -y / 4, v: -sp.sign(v)}, events=[Event(at=1, update={y: 0})])
    run = solve(system, (0, 5), {z: 0, y: 1, v: 0.5})
    assert run["z"][-1] == pytest.approx(1, abs=1e-9) and not ambiguous(run)
