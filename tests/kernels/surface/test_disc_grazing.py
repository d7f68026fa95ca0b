"""A slip in a disc that comes to rest, or nearly, just where the force leaves the friction circle."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Disc, Switch, System, solve

x, y, u, v = sp.symbols("x y u v", real=True)
k, V, F, along, across = sp.symbols("k V F along across", real=True)
EXACT = dict(rtol=1e-12, atol=1e-14)


def belt_in_the_plane():
    """A block on a spring along a belt that runs in the direction (along, across)."""
    lam = Disc("lam", (u - V * along, v - V * across))
    pull = -k * (along * x + across * y)
    return System(
        {x: u, y: v, u: pull * along - F * lam[0], v: pull * across - F * lam[1]},
        parameters={k: 1, V: 1, F: 1, along: 1, across: 0},
    )


def slip_up_to(share, draw, angle=0.0):
    """(parameters, start, end, its exact x and u along the belt) of a slip whose largest speed is V (1 + share)."""
    stiffness, speed, friction = np.exp(draw.uniform(-1.5, 1.5, 3))
    omega, centre = stiffness**0.5, friction / stiffness
    size, begin = speed / omega * (1 + share), draw.uniform(0.3, 2.5)
    end = (begin + draw.uniform(0.5, 2)) / omega
    way = np.array([np.cos(angle), np.sin(angle)])
    parameters = {k: stiffness, V: speed, F: friction, along: way[0], across: way[1]}
    place, pace = centre - size * np.sin(begin), omega * size * np.cos(begin)
    at = omega * end - begin
    exact = np.concatenate([way * (centre + size * np.sin(at)), way * omega * size * np.cos(at)])
    return parameters, np.concatenate([way * place, way * pace]), end, exact


@pytest.mark.parametrize("seed", range(4))
def test_a_disc_touches_the_speed_of_a_belt_as_a_switch_does(seed):
    """After its first stick a block comes to the speed of the belt again and again, and has no friction to spare."""
    draw = np.random.default_rng(seed)
    stiffness, speed, friction = np.exp(draw.uniform(-1.5, 1.5, 3))
    values = {k: stiffness, V: speed, F: friction}
    lam, disc = Switch("lam", u - V), Disc("lam", (u - V, v))
    line = System({x: u, u: -k * x - F * lam}, parameters=values)
    plane = System({x: u, u: -k * x - F * disc[0], v: -F * disc[1]}, parameters=values)
    span = (0, 2 * friction / stiffness / speed + 30 / stiffness**0.5)
    start = {x: -0.5 * friction / stiffness, u: speed}
    one, other = solve(line, span, start, **EXACT), solve(plane, span, start | {v: 0}, **EXACT)
    assert [e.kind for e in one.events] == [e.kind for e in other.events] == ["slip by tangency"]
    assert {a.kind for a in one.ambiguities} == {a.kind for a in other.ambiguities} == {"grazing"}
    assert other.x[:2, -1] == pytest.approx(one.x[:, -1], abs=1e-11 * (1 + speed))


@pytest.mark.parametrize("angle", (0.0, 0.4, 2.3))
@pytest.mark.parametrize("share", (-1e-9, -1e-11, -1e-12, -1e-14, -1e-16, 0, 1e-16, 1e-14))
def test_a_touch_within_rounding_is_no_event_in_any_frame(share, angle):
    """It is passed in few steps, and where it is within rounding it is recorded or too far off by rounding itself."""
    draw = np.random.default_rng(5)
    system = belt_in_the_plane()
    for _ in range(6):
        parameters, start, end, exact = slip_up_to(share, draw, angle)
        run = solve(system, (0, end), start, parameters=parameters, max_steps=400, **EXACT)
        assert run.success
        if share < -1e-13 or run.ambiguities:
            assert run.itinerary == ("slip (lam)",)
        assert {a.kind for a in run.ambiguities} <= {"grazing"}
        assert run.x[:, -1] == pytest.approx(exact, abs=1e-11 * (1 + parameters[V]))


@pytest.mark.parametrize("angle", (0.0, 0.4, 2.3))
@pytest.mark.parametrize("share", (1e-10, 1e-8, 1e-5))
def test_a_dip_above_rounding_is_a_stick_in_any_frame(share, angle):
    draw = np.random.default_rng(7)
    for _ in range(6):
        parameters, start, end, _ = slip_up_to(share, draw, angle)
        run = solve(belt_in_the_plane(), (0, end), start, parameters=parameters, **EXACT)
        assert [e.kind for e in run.events] == ["stick", "slip by tangency"] and not run.ambiguities
        # It rides on the belt until k x = F, where the slip would have had its largest speed.
        sticks, slips = run.event_times()
        assert slips - sticks == pytest.approx((2 * share / parameters[k]) ** 0.5, rel=0.02)


def test_a_strict_run_stops_at_a_touch():
    parameters, start, end, _ = slip_up_to(0, np.random.default_rng(3))
    run = solve(belt_in_the_plane(), (0, end), start, parameters=parameters, strict=True, **EXACT)
    assert run.outcome.name == "AMBIGUITY" and run.ambiguities[0].kind == "grazing" and run.t[-1] < end
    assert run.ambiguities[0].taken == "touch and slip on"


def test_a_force_that_leaves_the_circle_by_a_hair_is_a_touch():
    """The largest force of a stick exceeds the friction by 1e-10: a slip of some 1e-13, as stiff as it is slow.

    Beside it, where the force stays inside of the circle, the orbit is periodic: both go the same way.
    """
    t, Q = sp.symbols("t Q", real=True)
    lam, w, size = Disc("lam", (u, v)), sp.Rational(1, 4), sp.Rational(8, 5)
    plane = System(
        {
            x: u,
            y: v,
            u: size * sp.cos(w * t) - x - lam[0],
            v: Q * size * sp.sin(w * t) - y - lam[1],
        },
        time=t, parameters={Q: 0.3},
    )  # fmt: skip
    period = 8 * np.pi
    start = [-0.5154931369457177, 0.3734178547260542, -0.28888748182005713, 0.033737515058355316]
    run = solve(
        plane,
        (0.4 * period, 1.4 * period),
        start,
        parameters={Q: 0.4076342528745663},
        max_steps=20_000,
        **EXACT,
    )
    assert run.success and run.cost["steps"] < 2000
    assert np.abs(run.x[:, -1] - start).max() < 1e-7  # an orbit at its touch, known to nine digits
    assert any(found.kind == "grazing" for found in run.ambiguities)
