"""Dry friction in loops: what sticks together holds more than there is to move; only the motion is unique.

Beside one brake with the strength of all, linear programs for what can still be held, differences of runs, and elements
that are written out. Random ones: tests/fuzz/loops.py.

Guards: kernels/instant/dry_friction.py, kernels/instant/holding.py, kernels/instant/resting.py,
kernels/surface/sharing.py, kernels/surface/dependent.py.
"""

import numpy as np
import pytest
import sympy as sp
from family_models import template_from
from scipy.optimize import linprog

from pwsmooth import Event, Family, Switch, System, solve

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
t, x, y, v, w, F = sp.symbols("t x y v w F", real=True)


def shaft(*levers, load):
    """One motion with a brake of strength 0.5 at each of several gears, which depend on the angle."""
    brakes = [Switch(f"b{k}", v * lever) for k, lever in enumerate(levers)]
    return System({x: v, v: load - sum(b * lever for b, lever in zip(brakes, levers, strict=True)) / 2}, time=t)


def one_brake(*levers, load):
    """The same with one brake."""
    return System({x: v, v: load - sum(levers) * Switch("b", v) / 2}, time=t)


LEVERS = [
    (1.4 * sp.Integer(1), 1 + sp.cos(x) / 2),
    (1 + sp.sin(x) / 2, sp.Rational(2, 3), 2 + sp.cos(2 * x)),
    tuple(1 + sp.cos(x - k) / 3 for k in range(6)),
]


@pytest.mark.parametrize("levers", LEVERS)
def test_brakes_on_one_shaft_are_one_brake(levers):
    load = 0.62 * sum(levers).subs(x, 0) * sp.cos(t) - x / 4
    many = solve(shaft(*levers, load=load), (0, 20), {x: 0, v: 1}, **TIGHT)
    one = solve(one_brake(*levers, load=load), (0, 20), {x: 0, v: 1}, **TIGHT)
    assert many.success and len(one.events) > 8
    assert len(many.events) == len(levers) * len(one.events)
    assert many.x[:, -1] == pytest.approx(one.x[:, -1], abs=1e-11)
    for k in range(len(levers)):
        mine = [e for e in many.events if e.switch == f"b{k}"]
        assert [(e.kind, e.note) for e in mine] == [(e.kind, e.note) for e in one.events]
        assert [e.time for e in mine] == pytest.approx([e.time for e in one.events], abs=1e-11)


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("way", [1, -1])
def test_a_start_at_rest_is_held_and_let_go(way, method):
    """0.7 + 1.1 hold the load until t = 1.8."""
    system = System({x: v, v: way * t - 0.7 * Switch("a", v) - 1.1 * Switch("b", (2 + sp.sin(x)) * v)}, time=t)
    run = solve(system, (0, 3), [0, 0], method=method, **TIGHT)
    assert [(e.kind, e.note) for e in run.events] == [("slip by tangency", f"0 to {way:+d}")] * 2
    assert run.event_times() == pytest.approx(1.8, abs=1e-11)
    assert run.x[1, -1] == pytest.approx(way * 1.2**2 / 2, abs=1e-10)
    assert [a.kind for a in run.ambiguities] == ["multipliers not unique"]


def rubbing(joints, strengths, load):
    """Bodies of mass 1; joint (i, j) rubs bodies i and j, or i and the ground."""
    n = len(load)
    places, speeds = sp.symbols(f"x0:{n}", real=True), sp.symbols(f"v0:{n}", real=True)
    rates = list(load)
    for k, (i, j) in enumerate(joints):
        lam = Switch(f"s{k}", speeds[i] - (speeds[j] if j is not None else 0))
        rates[i] -= strengths[k] * lam
        if j is not None:
            rates[j] += strengths[k] * lam
    return System(dict(zip(places, speeds, strict=True)) | dict(zip(speeds, rates, strict=True)), time=t)


JOINTS = [
    [(0, 1), (1, None), (0, None)],
    [(0, 1), (1, 2), (2, 0), (0, None)],
    [(0, 1), (1, 2), (2, 3), (3, None), (0, None), (1, 3)],
    [(k, k + 1) for k in range(7)] + [(0, None), (7, None), (0, 7)],
]


@pytest.mark.parametrize("joints", JOINTS)
@pytest.mark.parametrize("seed", range(3))
def test_bodies_hold_each_other_until_no_forces_do(joints, seed):
    """A load that turns while it grows: bodies part where the largest s with s F >= the load's flow is 1."""
    r = np.random.default_rng([seed, len(joints)])
    n = 1 + max(i for pair in joints for i in pair if i is not None)
    strengths, first, second = r.uniform(0.3, 1.5, len(joints)), r.normal(0, 0.1, n), r.normal(0, 0.4, n)
    third = r.normal(0, 0.1, n)
    J = np.zeros((len(joints), n))
    for k, (i, j) in enumerate(joints):
        J[k, i] = 1
        if j is not None:
            J[k, j] = -1

    def share(at):
        """The least largest |lambda| at a time."""
        load = first + second * at + third * np.sin(3 * at)
        A = np.hstack([J.T * strengths, np.zeros((n, 1))])
        ones = np.ones((len(joints), 1))
        bounds = np.vstack([np.hstack([s * np.eye(len(joints)), -ones]) for s in (1, -1)])
        aim = np.append(np.zeros(len(joints)), 1)
        return linprog(aim, bounds, np.zeros(len(bounds)), A, load, (None, None)).fun

    loads = [a + b * t + c * sp.sin(3 * t) for a, b, c in zip(first, second, third, strict=True)]
    run = solve(rubbing(joints, strengths, loads), (0, 12), np.zeros(2 * n), **TIGHT)
    parted = run.events[0].time
    times = np.linspace(0, parted, 200)[:-1]
    assert max(share(at) for at in times) < 1
    assert share(parted) == pytest.approx(1, abs=1e-9)


def test_a_force_that_jumps_is_shared_anew():
    """Two brakes of 1 hold 1.5, and not 2.5."""
    system = System(
        {x: v, v: y - Switch("a", v) - Switch("b", v * (1 + x**2)), y: 0},
        time=t,
        events=[Event(at=[1, 2], update={y: y + 1})],
    )
    run = solve(system, (0, 3), [0, 0, 0.5], **TIGHT)
    assert [(e.time, e.kind) for e in run.events if e.kind != "reset"] == [(2.0, "slip by reset")] * 2
    assert run.x[1, -1] == pytest.approx(0.5, abs=1e-9)


def test_a_motion_through_loops_has_its_derivatives():
    a, b, c = Switch("a", v), Switch("b", w), Switch("c", v - w)
    pushes = {v: 2.5 * sp.cos(t) - x - F * a - c / 2, w: 1.3 * sp.sin(1.3 * t) - y - 1.6 * b + c / 2}
    system = System({x: v, v: pushes[v], y: w, w: pushes[w]}, time=t, parameters={F: 1.2})
    span, start, step = (0, 12), {x: 0, v: 1, y: 0, w: 0.3}, 1e-6
    run = solve(system, span, start, by=["F", "v"], **TIGHT)
    assert [a.kind for a in run.ambiguities] == ["multipliers not unique"]

    def end(**more):
        return solve(system, span, **({"x0": start} | more), **TIGHT).x[:, -1]

    by_F = (end(parameters={F: 1.2 + step}) - end(parameters={F: 1.2 - step})) / (2 * step)
    by_v = (end(x0=start | {v: 1 + step}) - end(x0=start | {v: 1 - step})) / (2 * step)
    assert run.derivatives.end == pytest.approx(np.stack([by_F, by_v], axis=1), abs=1e-6)


def ring(n, least, push=0.4, belts=(0,), power=1):
    """Sliders in a ring that rub each other, and belts whose speeds grow with a power of time; only some are pushed."""
    family = Family(n, periodic=True)
    u, s = family.symbols("u s")
    p, d = family.symbols("p d")
    joint, ground = Switch("j", family.neighbour(s, 1) - s), Switch("g", s - d * t**power)
    force = p * sp.sin(t) - u / 4 + (joint - family.neighbour(joint, -1)) / 2 - ground * 3 / 10
    values = {
        p: [push + 0.9 * ((3 * i) % 5) / 4 for i in range(n)],
        d: [belts[i % len(belts)] for i in range(n)],
    }
    with template_from(least):
        return System({u: s, s: force}, time=t, parameters=values)


def test_a_ring_looped_and_by_elements_is_the_ring_written_out():
    n = 8
    start = {"u": 0.0, "s": [0.1 * np.sin(2 * i) for i in range(n)]}
    written = solve(ring(n, 10**6), (0, 12), start, **TIGHT)
    looped = solve(ring(n, 1), (0, 12), start, local=False, **TIGHT)
    local = solve(ring(n, 1), (0, 12), start, local=True, **TIGHT)
    assert written.success and looped.success and local.success
    assert {a.kind for a in written.ambiguities} == {"multipliers not unique"}
    assert looped.x[:, -1] == pytest.approx(written.x[:, -1], abs=1e-11)
    assert len(written.events) == len(looped.events) == len(local.events) > 50
    assert local.x[:, -1] == pytest.approx(looped.x[:, -1], abs=1e-11)


@pytest.mark.parametrize(("power", "events"), [(1, 12), (2, 18), (3, 18)])
def test_belts_that_move_apart_let_a_ring_go(power, events):
    """With the cubes two joints are at their bounds together, at t = pi, where neither has to slip."""
    runs = [
        solve(ring(6, least, 0.2, (0.0, 0.1, 0.05), power), (0, 6), {"u": 0.0, "s": 0.0}, local=local, **TIGHT)
        for least, local in ((10**6, None), (1, False), (1, True))
    ]
    assert all(run.success and len(run.events) == events for run in runs)
    for run in runs[1:]:
        assert run.x[:, -1] == pytest.approx(runs[0].x[:, -1], abs=1e-11)


# What two brakes on one shaft rub, which of them is the stronger, and where the shaft is at t = 1/2: with the stronger
# one, or, where that is too weak for it, as far as both push it.
TURNING = [
    (sp.sin(t), 2 * sp.sin(t), 2, 1, sp.sin(0.5)),
    (sp.sin(t), 2 * sp.sin(t), 1, 2, 0.5),
    (t**2 / 2, 2 * t**2, 2, 1, 0.125),
    (t**2 / 2, 2 * t**2, 1, 2, 0.125 + 0.25),
    (t**3 / 6, -(t**4), 2, 1, 0.5**3 / 6),
    (t**3 / 6, -(t**4), 1, 2, -(0.5**4)),
    (t + t**2 / 2, t - t**2, 2, 1, 0.5),
    (t + t**2 / 2, t - t**2, 1, 2, 0.25),
]


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize(("one", "other", "strength", "rest", "end"), TURNING)
def test_brakes_on_discs_that_turn_apart_do_not_both_hold(one, other, strength, rest, end, method):
    """They rest on one shaft at t = 0, and agree there in some derivatives."""
    system = System({v: -strength * Switch("a", v - one) - rest * Switch("b", v - other)}, time=t)
    run = solve(system, (0, 0.5), [0.0], method=method, **TIGHT)
    assert run.success and run.x[0, -1] == pytest.approx(float(end), abs=1e-11)
    ends = [float(e.subs(t, 0.5)) for e in (one, other)]
    for lam, to in zip((run["a"][-1], run["b"][-1]), ends, strict=True):
        side = np.sign(np.round(run.x[0, -1] - to, 9))
        assert lam == side if side else abs(lam) < 1


def test_a_surface_that_moves_across_what_is_at_rest_is_crossed():
    """A brake keeps the shaft at rest; another one's disc turns to and fro."""
    system = System({v: sp.Rational(1, 5) - Switch("a", v) - Switch("b", v - sp.cos(t)) / 4}, time=t)
    run = solve(system, (0, 10), [0.0], **TIGHT)
    assert [(e.switch, e.kind) for e in run.events] == [("b", "crossing")] * 3
    assert run.event_times() == pytest.approx(np.pi * np.array([0.5, 1.5, 2.5]), abs=1e-12)
    assert not run.ambiguities and np.abs(run.x).max() < 1e-14
