"""Deviations of runs that stop and slip in a plane: against closed forms, and differences of runs beside them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Disc, Event, Strobe, Switch, System, find_orbit, follow, solve
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.costs import at, event_time, final, value_and_gradient

t, x, y, u, v, w, z = sp.symbols("t x y u v w z", real=True)
mu, a = sp.symbols("mu a", positive=True)
lam, spin = Disc("lam", (u, v)), Disc("spin", (u, v, w))
TIGHT = {"rtol": 1e-12, "atol": 1e-13}
SQUARE = lam[0] ** 2 + lam[1] ** 2
HALF, TENTH = sp.Rational(1, 2), sp.Rational(1, 10)


def _oscillator():
    rates = {x: u, y: v, u: a * sp.cos(t / 4) * 8 / 5 - x - mu * lam[0], v: sp.sin(t / 4) - y - mu * lam[1]}
    return System(rates, time=t, parameters={mu: 1, a: 1}), {x: 0.3, y: 0.1, u: 0.5, v: -0.4}, 30


def _hidden():
    pull = mu * (1 + 3 * (1 - SQUARE))
    rates = {
        x: u, y: v,
        u: a * t * TENTH - x / 10 - pull * lam[0], v: a * t * TENTH * sp.sin(t / 20) - y / 10 - pull * lam[1],
    }  # fmt: skip
    return System(rates, time=t, parameters={mu: 1, a: 1}), {x: 0.1, y: -0.2, u: 0.3, v: 0.2}, 25


def _elliptic():
    own = Disc("lam", (3 * u / 10, v / 2))
    rates = {x: u, y: v, u: a * sp.sin(t) - 3 * own[0] / 10, v: a * sp.cos(2 * t) / 2 - mu * own[1] / 2}
    return System(rates, time=t, parameters={mu: 1, a: HALF}), {x: 0, y: 0, u: 1, v: 1}, 14


def _stack():
    x2, y2, u2, v2 = sp.symbols("x2 y2 u2 v2", real=True)
    one, two = Disc("one", (u, v)), Disc("two", (u2 - u, v2 - v))
    rates = {
        x: u, y: v, x2: u2, y2: v2,
        u: (2 * a * sp.cos(t) - x - one[0] + two[0] * mu) / 2, v: (sp.sin(t) - y - one[1] + two[1] * mu) / 2,
        u2: sp.sin(1.3 * t) / 5 - mu * two[0], v2: -mu * two[1] - y2 / 2,
    }  # fmt: skip
    start = {x: 0, y: 0.3, u: 0.1, v: 0.5, x2: 0, y2: 0.7, u2: 0.6, v2: -0.4}
    return System(rates, time=t, parameters={mu: sp.Rational(4, 5), a: HALF}), start, 6


def _spinning():
    rates = {
        x: u, y: v, u: a * sp.cos(t) - spin[0] * mu - x, v: sp.sin(2 * t) / 2 - spin[1] * mu - y,
        w: sp.cos(3 * t) / 2 - 2 * mu * spin[2],
    }  # fmt: skip
    return System(rates, time=t, parameters={mu: 1, a: HALF}), {x: 0, y: 0.3, u: 0.5, v: 0.5, w: 0.3}, 12


def _with_a_switch():
    s = Switch("s", z)
    rates = {
        x: u, y: v, u: a * sp.cos(t) / 2 - lam[0] * mu - x, v: sp.sin(2 * t) / 2 - lam[1] * mu - y + 3 * s / 10,
        z: sp.sin(t) / 2 - s + lam[1] / 2,
    }  # fmt: skip
    return System(rates, time=t, parameters={mu: 1, a: 1}), {x: 0, y: 0.3, u: 0.5, v: 0.5, z: 0.3}, 9


def _kicked():
    kick = Event(every=2, update={u: u + HALF, v: v - a / 3}, name="kick")
    rates = {x: u, y: v, u: a * sp.cos(t) / 2 - lam[0] * mu - x, v: sp.sin(2 * t) / 2 - lam[1] * mu - y}
    system = System(rates, time=t, events=[kick], parameters={mu: sp.Rational(4, 5), a: 1})
    return system, {x: 0, y: 0.3, u: 0.5, v: 0.5}, 9


CASES = {
    f.__name__[1:]: f for f in (_oscillator, _hidden, _elliptic, _stack, _spinning, _with_a_switch, _kicked)
}


@pytest.mark.parametrize("case", CASES)
def test_ends_and_instants_move_as_those_of_runs_beside(case):
    system, start, end = CASES[case]()
    names = [mu, a, x, v]
    run = solve(system, (0, end), start, by=names, **TIGHT)
    assert run.success and len(run.event_times("stick")) > 0 and not run.derivatives.problems

    def beside(name, change):
        given, values = dict(start), dict(system.parameters)
        target = values if name in values else given
        target[name] = float(target[name]) + change
        other = solve(system, (0, end), given, parameters=values, **TIGHT)
        return np.concatenate([other.x[:, -1], other.event_times()])

    step = 1e-5
    exact = np.concatenate([run.derivatives.end, run.derivatives.event_times()])
    for k, name in enumerate(names):
        one, two = (beside(name, s * step) - beside(name, -s * step) for s in (1, 2))
        assert exact[:, k] == pytest.approx((8 * one - two) / (12 * step), rel=2e-6, abs=2e-6)


def test_the_time_to_rest_of_a_thrown_block_moves_as_the_closed_form():
    block = System({x: u, y: v, u: 1 - mu * lam[0], v: -mu * lam[1]}, parameters={mu: 1.05})
    start = {x: 0, y: 0, u: 2 * math.cos(2.5), v: 2 * math.sin(2.5)}
    runs = [solve(block, (0, 6), start, by=[u, v], dense_output=d, **TIGHT) for d in (False, True)]
    stop, again = (run.derivatives.at_event(0) for run in runs)
    assert again.time == pytest.approx(stop.time, rel=1e-12)
    slope = (1.05 * np.array([math.cos(2.5), math.sin(2.5)]) + [1, 0]) / (1.05**2 - 1)
    assert stop.time == pytest.approx(slope, rel=1e-9)
    assert np.abs(stop.after[2:]).max() == 0 and np.abs(stop.before[2:]).max() < 1e-9


def test_at_the_first_moments_of_a_slip():
    # v(0) = 0 and F = (1 + 0.7 q t, 0.4 t): deviations by q at times within the first step and behind it.
    q = sp.Symbol("q", positive=True)
    block = System({u: 1 + 7 * q * t / 10 - lam[0], v: 2 * t / 5 - lam[1]}, time=t, parameters={q: 1})
    run = solve(block, (0, 1), {u: 0, v: 0}, by=[q], **TIGHT)
    for end in (1e-3, 0.01, 0.05, 0.2, 1.0):
        ends = [
            solve(block, (0, end), {u: 0, v: 0}, parameters={q: 1 + s}, **TIGHT).x[:, -1] for s in (1e-4, -1e-4)
        ]
        assert run.derivatives(end)[:, 0] == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-6, abs=1e-12)


def test_slopes_of_a_cost_backward_are_those_forward():
    system, start, end = _oscillator()
    names = [mu, a, "x", "v"]
    # 4.5 is within the first step of a slip.
    cost = final(x) + at(u, 4.5) + event_time("lam", "stick", 1)
    backward = value_and_gradient(system, cost, (0, end), start, by=names, **TIGHT)
    d = solve(system, (0, end), start, by=names, **TIGHT).derivatives
    forward = d.end[0] + d(4.5, "u") + d.event_times("stick")[1]
    assert backward.gradient == pytest.approx(forward, rel=1e-8, abs=1e-9)


def test_a_pass_through_rest_has_no_derivative():
    block = System({u: 3 - lam[0], v: -lam[1]})
    run = solve(block, (0, 1), {u: -1, v: 0}, by=["u"], **TIGHT)
    (problem,) = run.derivatives.problems
    assert problem.t == pytest.approx(0.25, abs=1e-9)


@pytest.mark.thorough
def test_the_planar_oscillator_has_its_orbit_and_sticks_are_born_on_its_branch():
    system, start, _ = _oscillator()
    orbit = find_orbit(system, start, seen=Strobe(8 * sp.pi), transient=20)
    assert orbit.stable and not len(orbit.solution().event_times("stick"))
    branch = follow(orbit, {mu: 1.2})
    born = branch.of_kind("grazing-sliding")
    assert len(born) == 2 and born[0].parameter == pytest.approx(born[1].parameter, abs=1e-9)
    # Beyond it the block stops twice in a period.
    assert len(branch.points[-1].solution().event_times("stick")) == 2


def test_lyapunov_exponents_of_a_block_that_sticks_again_and_again():
    system, start, _ = _oscillator()
    found = lyapunov_exponents(system, start, 400)
    orbit = find_orbit(system, start, seen=Strobe(8 * sp.pi), transient=20)
    largest = np.log(np.abs(orbit.multipliers).max()) / (8 * math.pi)
    assert found.exponents[0] == pytest.approx(largest, abs=3 * found.errors[0] + 1e-3)
