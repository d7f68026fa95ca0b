"""What holds at rest: friction whose load comes, grows or vanishes, a grip on a table, static friction at a stop.

Guards: kernels/instant/settling.py, kernels/instant/holding.py, kernels/instant/discs.py, kernels/instant/instants.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Disc, Switch, System, Unilateral, solve

t, x, y, v, w, u, z = sp.symbols("t x y v w u z", real=True)
a, b, r, rho, at = sp.symbols("a b r rho at", real=True)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


def step(size, when):
    return sp.Piecewise((size, when), (0, True))


@METHODS
@pytest.mark.parametrize(
    ("push", "brake", "end"), [(1, 0.3, 1.3), (-1, 0.3, -1.3), (1, 2, 0.0), (1e-9, 3e-10, 1.3e-9)]
)
def test_a_brake_without_strength_holds_nothing(push, brake, end, method):
    # Pushed from t = 0.4 on, with a friction that begins to act at t = 1: v(1) = 0.6 push.
    system = System({v: step(a, t > 0.4) - step(b, t > 1) * sp.sign(v)}, time=t, parameters={a: push, b: brake})
    run = solve(system, (0, 2), {v: 0}, method=method, strict=True)
    assert run.success and run["v"][-1] == pytest.approx(end, abs=1e-9 * abs(push))


def test_clutches_without_strength_hold_nothing_until_they_close():
    first, second = (
        step(sp.Rational(3, 10), t > 1) * sp.sign(v - w),
        step(sp.Rational(1, 10), t > 1.5) * sp.sign(w - u),
    )
    run = solve(
        System({v: step(1, t > 0.4) - first, w: first - second, u: second}, time=t), (0, 2), {v: 0, w: 0, u: 0}
    )
    assert run.success
    np.testing.assert_allclose(run.x[:, -1], [1.3, 0.25, 0.05], atol=1e-12)


@METHODS
@pytest.mark.parametrize(("start", "ratio"), [(1, 0), (1, 0.5), (0, 0.5), (0, -0.9), (0, 1.5), (1, -2)])
def test_force_and_load_that_grow_together_hold_if_the_load_suffices(start, ratio, method):
    # v' = (t - start) (ratio - sgn v): it slips with (t - start)^2/2 times the excess.
    load = sp.Max(0, t - a)
    system = System({v: load * (r - sp.sign(v))}, time=t, parameters={a: start, r: ratio})
    run = solve(system, (0, 3), {v: 0}, method=method, strict=True)
    excess = np.sign(ratio) * max(abs(ratio) - 1, 0)
    assert run.success and run["v"][-1] == pytest.approx(excess * (3 - start) ** 2 / 2, abs=1e-9)


@METHODS
def test_a_load_that_vanishes_at_rest_lets_go(method):
    # The load max(0, 1/2 - t) is gone at t = 1/2, and a push of 1 comes at t = 2.
    system = System({v: step(1, t > 2) - sp.Max(0, y) * sp.sign(v), y: step(-1, t < 1)}, time=t)
    run = solve(system, (0, 3), {v: 0, y: 0.5}, method=method, strict=True)
    assert run.success and run["v"][-1] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(("push", "brake", "load", "end"), [(1, 0.3, 0, 1.3), (0, 0, 1, 0.0), (0.5, 0, 1, 0.0)])
def test_a_disc_without_strength_holds_nothing(push, brake, load, end):
    # As the brake above; with a load that grows from t = 1 on, as the push does then.
    disc = Disc("d", (v, w))
    strength = step(b, t > 1) + r * sp.Max(0, t - 1)
    pushed = (1 - r) * step(a, t > 0.4) + r * a * sp.Max(0, t - 1)
    rates = {v: pushed - strength * disc[0], w: -strength * disc[1]}
    system = System(rates, time=t, parameters={a: push, b: brake, r: load})
    run = solve(system, (0, 2), {v: 0, w: 0}, strict=True)
    assert run.success
    np.testing.assert_allclose(run.x[:, -1], [end, 0], atol=1e-9)


@METHODS
@pytest.mark.parametrize(("lift", "end"), [(1, 0.5), (-1, 0.0), (30, 5.0)])
def test_a_gripped_body_leaves_its_table_when_the_hand_steps(lift, end, method):
    # From t = 1 on it takes a friction of 10 + lift: up to 20 it goes along with the hand, then with 10 upwards.
    table = Unilateral(z, restitution=0, name="table")
    rates = {z: v, v: -10 + table.reaction - 20 * sp.sign(v - w), w: step(a, t > 1)}
    run = solve(System(rates, time=t, parameters={a: lift}), (0, 2), {z: 0, v: 0, w: 0}, method=method)
    assert run.success and run["z"][-1] == pytest.approx(end, abs=1e-9)


@METHODS
@pytest.mark.parametrize(("hidden", "place"), [(3, 0.5), (3, 1), (1, 0.5), (1.5, 0)])
def test_static_friction_gives_way_at_a_stop(hidden, place, method):
    # The push 2 - t presses against the stop, turns at t = 2 and grows to the static friction F_s of the fold.
    lam, stop = Switch("lam", v), Unilateral(at - x, name="stop")
    rates = {x: v, v: 2 - t - lam * (1 + rho * (1 - lam**2)) - stop.reaction}
    run = solve(
        System(rates, time=t, parameters={rho: hidden, at: place}), (0, 8), {x: place, v: 0}, method=method
    )
    slips = 2 + 2 * hidden * ((1 + hidden) / (3 * hidden)) ** 1.5
    assert run.success and [event.kind for event in run.events] == ["opening", "slip by fold"]
    assert run.events[-1].time == pytest.approx(slips, abs=1e-9)
    assert run["v"][-1] == pytest.approx(((slips - 3) ** 2 - 25) / 2, abs=1e-8)
