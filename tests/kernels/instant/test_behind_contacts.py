"""No motion begins behind a rigid contact: at a start, and where an update puts the state."""

import pytest
import sympy as sp

from pwsmooth import Event, Family, Outcome, System, Unilateral, solve, sweep

t, y, v, unit = sp.symbols("t y v unit", real=True)
FLOOR = Unilateral(y, restitution=0.8, name="floor")
BALL = System({y: v, v: -10 * unit + FLOOR.reaction}, parameters={unit: 1})


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("speed", [3.0, 0.0, -3.0])
def test_a_start_behind_a_stop_is_refused_with_the_gap(method, speed):
    run = solve(BALL, (0, 0.3), {y: -1, v: speed}, method=method)
    assert run.outcome is Outcome.BEHIND_CONTACT and not run.success and run.t.size == 1
    assert "the gap y of floor is -1" in run.message


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_it_is_in_no_unit(scale):
    one = solve(BALL, (0, 0.3), {y: -scale, v: 3 * scale}, parameters={unit: scale})
    other = solve(BALL, (0, 0.3), {y: scale, v: 3 * scale}, parameters={unit: scale})
    assert one.outcome is Outcome.BEHIND_CONTACT and other.success


def test_a_rounding_behind_the_stop_is_on_it():
    run = solve(BALL, (0, 0.1), {y: -1e-15, v: 0})
    assert run.success and run["y"][-1] == 0 and not len(run.events)


def test_an_end_of_a_run_on_a_stop_is_a_start():
    first = solve(BALL, (0, 20), {y: 1, v: 0})  # at rest after all bounces
    assert first["y"][-1] == 0 and solve(BALL, (0, 1), first.x[:, -1]).success


def test_an_update_that_puts_a_body_behind_a_stop_ends_the_run_there():
    ball = System(
        {y: v, v: -10 + FLOOR.reaction}, time=t, events=[Event(at=[0.1], update={y: -1}, name="push")]
    )
    run = solve(ball, (0, 0.3), {y: 1, v: 0})
    assert run.outcome is Outcome.BEHIND_CONTACT and run.t[-1] == pytest.approx(0.1) and run["y"][-1] == -1
    assert "At t = 0.1 the gap y of floor is -1" in run.message


def test_of_a_family_one_element_is_enough():
    family = Family(12)
    x, u = family.symbols("x u")
    gap = Unilateral(x, restitution=0.5, name="gap")
    row = System({x: u, u: -1 + gap.reaction}, contacts=[gap])
    start = [1.0] * 12
    assert solve(row, (0, 0.1), {x: start, u: 0}).success
    start[7] = -1.0
    assert solve(row, (0, 0.1), {x: start, u: 0}).outcome is Outcome.BEHIND_CONTACT


def test_a_sweep_goes_on_with_the_others():
    found = sweep(BALL, {"y": [-1.0, 1.0]}, x0={y: 1, v: 0}, t_span=(0, 0.1))
    assert [Outcome(int(code)).name for code in found["outcome"].values] == ["BEHIND_CONTACT", "FINISHED"]
