"""What holds at rest: friction whose load comes, grows or vanishes, grips, static friction at a stop; bodies
on several dry feet with unknown reactions; several laws on one velocity.

Guards: kernels/instant/settling.py, kernels/instant/holding.py, kernels/instant/discs.py, kernels/instant/instants.py,
kernels/instant/together.py, kernels/surface/fast.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Disc, Event, Switch, System, Unilateral, solve
from pwsmooth.laws.friction import StaticKinetic
from pwsmooth.scenes import assemble

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


@pytest.mark.parametrize("ends", ["by a kick", "by a clock", "by a clock, pushed back"])
@pytest.mark.parametrize("slips", [False, True])
def test_a_load_that_ends_beside_a_disc_lets_go(slips, ends):
    # At t = 1 the friction of w loses its load, and w goes as the push sin(t)/4; the disc does not act on it.
    disc, table = Disc("disc", (a, b)), Unilateral(z, restitution=0, name="table")
    way = -1 if ends == "by a clock, pushed back" else 1
    load = table.reaction / 2 if ends == "by a kick" else step(sp.Rational(1, 2), t < 1)
    rates = {z: v, v: -1 + table.reaction, w: way * sp.sin(t) / 4 - load * sp.sign(w - sp.Rational(1, 4))}
    rates |= {a: sp.sin(2 * t) / 2 - disc[0], b: sp.sin(2 * t + 1) / 2 - disc[1]}
    kick = [Event(at=1, update={v: v / 2 + sp.Rational(1, 2)})] if ends == "by a kick" else []
    start = {z: 0, v: 0, w: 0.25, a: 0.0, b: 5.0 if slips else 0.0}
    run = solve(System(rates, time=t, events=kick), (0, 1.9), start)
    assert run.success and not run.ambiguities
    assert run["w"][-1] == pytest.approx(0.25 + way * (np.cos(1) - np.cos(1.9)) / 4, abs=1e-9)
    assert sum(event.kind != "crossing" and "w" in str(event) for event in run.events) == 1


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


MU, G = 0.4, 9.81
th, om, f = sp.symbols("theta omega f", real=True)
h, c = sp.symbols("h c", real=True)


def box_on_two_feet():
    """A box, its centre at height h, on two dry feet with unknown reactions, pushed at its centre by f + c sin t."""
    left, right = Unilateral(y - th, name="left").reaction, Unilateral(y + th, name="right").reaction
    rubs = MU * left * sp.sign(u + h * om - th * om), MU * right * sp.sign(u + h * om + th * om)
    rates = {x: u, y: w, th: om, u: f * t + c * sp.sin(t) - sum(rubs), w: -G + left + right}
    return System(rates | {om: right - left - h * sum(rubs)}, time=t, parameters={h: 0.3, f: 0, c: 0})


BOX = box_on_two_feet()
AT_REST = {x: 0, y: 0, th: 0, u: 0, w: 0, om: 0}


@pytest.mark.parametrize("height", [0, 0.3, 1])
@pytest.mark.parametrize("speed", [2, -2, 1e-6])
def test_a_body_on_two_feet_stops_and_rests(height, speed):
    # The feet share the weight in some way, and rub with mu m g in all: it stops at u^2/(2 mu g).
    run = solve(BOX, (0, 2), AT_REST | {u: speed}, parameters={h: height})
    assert run.success and abs(run["u"][-1]) <= 1e-15 * abs(speed)
    assert run["x"][-1] == pytest.approx(speed * abs(speed) / (2 * MU * G), abs=1e-9 * abs(speed))


def test_a_body_on_two_feet_slips_when_both_give_way():
    # A push that grows with t: it slips at t = mu g, whatever each foot held until then.
    run = solve(BOX, (0, 6), AT_REST, parameters={f: 1})
    slips = MU * G
    assert run.success and run["u"][-1] == pytest.approx((6 - slips) ** 2 / 2, abs=1e-8)


def test_a_body_on_two_feet_moves_as_one_on_one():
    # Pushed to and fro beyond its friction: beside a block with the friction mu m g.
    run = solve(BOX, (0, 20), AT_REST, parameters={c: 6})
    block = System({x: u, u: 6 * sp.sin(t) - MU * G * sp.sign(u)}, time=t)
    assert run.success and run["x"][-1] == pytest.approx(solve(block, (0, 20), {x: 0, u: 0})["x"][-1], abs=1e-7)


@pytest.mark.parametrize(
    ("kinetic", "static"), [((1, 1), (1.01, 3)), ((1, 0.5), (1.3, 0.8)), ((2, 1), (3, 1.01))]
)
@pytest.mark.parametrize("way", [1, -1])
def test_two_laws_of_static_friction_hold_their_sum(kinetic, static, way):
    brakes = [
        StaticKinetic(F_c=F_c, F_s=F_s).attach(velocity=v, name=name)
        for F_c, F_s, name in zip(kinetic, static, "ab", strict=True)
    ]
    rates = {x: v, v: way * t / 10 - sum(brake.force for brake in brakes)}
    system, start, _ = assemble(rates, brakes, time=t, x0={x: 0.0, v: 0.0})
    run = solve(system, (0, 60), start)
    slips = 10 * sum(static)
    assert run.success and run.events[0].time == pytest.approx(slips, abs=1e-6)
    assert {a.kind for a in run.ambiguities} == {"multipliers not unique"}
    assert way * run["v"][-1] == pytest.approx((3600 - slips**2) / 20 - sum(kinetic) * (60 - slips), abs=1e-5)


LEGS = np.array([(1, 0), (-0.5, 0.75**0.5), (-0.5, -(0.75**0.5))])
X, Y, al, be, ga, b_x, b_y, p, q, s = sp.symbols("X Y al be ga b_x b_y p q s", real=True)
TABLE_STATES = (X, Y, z, al, be, ga, b_x, b_y, w, p, q, s)


def table_on_three_legs():
    """A table, its centre at height h, on three dry legs with unknown reactions."""
    force, moment = [0, 0, -G], [0, 0, 0]
    for i, (lx, ly) in enumerate(LEGS.tolist()):
        N = Unilateral(z + al * ly - be * lx, name=f"leg{i}").reaction
        rub = Disc(f"d{i}", (b_x - s * ly - q * h, b_y + s * lx + p * h))
        fx, fy = -MU * N * rub[0], -MU * N * rub[1]
        force = [force[0] + fx, force[1] + fy, force[2] + N]
        moment = [moment[0] + ly * N + h * fy, moment[1] - lx * N - h * fx, moment[2] + lx * fy - ly * fx]
    rates = dict(zip(TABLE_STATES, (b_x, b_y, w, p, q, s, *force, *moment), strict=True))
    return System(rates, parameters={h: 0.3})


def smoothed_table(height, motion, end, eps=1e-4):
    """X, Y and the angle at the end by slips v/sqrt(v^2 + eps^2); reactions from the balance of force and tilt."""

    def rates(_, at):
        a, b, turn = at[3:]
        slip = np.array([a - turn * LEGS[:, 1], b + turn * LEGS[:, 0]])
        dx, dy = -MU * slip / np.sqrt((slip**2).sum(axis=0) + eps**2)
        balance = np.array([np.ones(3), LEGS[:, 1] + height * dy, -LEGS[:, 0] - height * dx])
        N = np.linalg.solve(balance, [G, 0, 0])
        return [a, b, turn, N @ dx, N @ dy, N @ (LEGS[:, 0] * dy - LEGS[:, 1] * dx)]

    return solve_ivp(rates, (0, end), [0, 0, 0, *motion], method="Radau", rtol=1e-9, atol=1e-11).y[:3, -1]


@pytest.mark.parametrize("height", [0, 0.1, 0.3])
@pytest.mark.parametrize("motion", [(1.2, 1.6, 0.999), (1.2, 1.6, 0.5), (1, 0, 3)])
def test_legs_that_stop_do_not_move_the_gaps(height, motion):
    start = dict.fromkeys(TABLE_STATES, 0) | dict(zip((b_x, b_y, s), motion, strict=True))
    run = solve(table_on_three_legs(), (0, 1.5), start, parameters={h: height})
    assert run.success and [event.kind for event in run.events] == ["stick"] * 3
    np.testing.assert_allclose(run.x[[0, 1, 5], -1], smoothed_table(height, motion, 1.5), atol=1e-4)
