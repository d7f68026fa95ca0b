"""Conditions on what rests at 0: strict and non-strict ones mean what they say.

Guards: kernels/instant/surface_rates.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Algebraic, Disc, Event, Memory, Switch, System, Unilateral, solve

t, x, y, z, e, h, a = sp.symbols("t x y z e h a", real=True)
n = Memory("n", 0)


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
    # The side from which it came remains.
    for method in ("auto", "rk", "stiff"):
        below = solve(both, (0, 5), {z: 0, e: 0, y: -1}, method=method)
        assert np.all(below.x[:2, -1] == 0) and (ambiguous(below) or method == "stiff")


def test_the_sign_of_what_stays_at_zero_is_zero_where_something_slides():
    v = sp.Symbol("v", real=True)
    system = System({z: sp.sign(y), y: -y / 4, v: -sp.sign(v)}, events=[Event(at=1, update={y: 0})])
    run = solve(system, (0, 5), {z: 0, y: 1, v: 0.5})
    assert run["z"][-1] == pytest.approx(1, abs=1e-9) and not ambiguous(run)


k, q, u = sp.symbols("k q u", real=True)
BESIDE = q + k
STAIRS = [
    sp.floor(2 * BESIDE),
    sp.floor(2 * BESIDE + 1) ** 2,
    sp.frac(2 * BESIDE),
    sp.Mod(BESIDE, sp.S.Half),
    -sp.ceiling(-2 * BESIDE),
]
RESTS = {  # (rates, events, start) of motions of q that come to 0 at or before t = 1 and stay there
    "contact": ({q: u, u: -1 + Unilateral(q, restitution=0, name="R").reaction}, [], {q: 0.1, u: -1}),
    "event": ({q: -q}, [Event(at=1, update={q: 0})], {q: 0.3}),
    "event as the rate turns": ({q: -sp.Heaviside(1 - t)}, [Event(at=1, update={q: 0})], {q: 0.3}),
    "tank": ({q: -sp.sqrt(sp.Max(q, 0))}, [], {q: 0.2}),
    "bound": ({q: -sp.Heaviside(q)}, [], {q: 0.2}),
    "maximum": ({}, [], {}),
    "start": ({q: -q}, [], {q: 0}),
}


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("rest", RESTS)
def test_stairs_of_what_rests_on_a_step_are_those_of_that_step(rest, method):
    rates, events, start = RESTS[rest]
    counts = sp.symbols(f"c:{len(STAIRS)}", real=True)
    stairs = [e.subs(q, sp.Max(1 - t, 0)) for e in STAIRS] if rest == "maximum" else STAIRS
    system = System(rates | dict(zip(counts, stairs, strict=True)), time=t, events=events, parameters={k: 0.5})
    for at in (0.5, 1, -1.5):
        start = start | dict.fromkeys(counts, 0)
        run = solve(system, (0, 3), start, parameters={k: at}, method=method, t_eval=[2, 3])
        for c, e in zip(counts, STAIRS, strict=True):
            assert np.diff(run[c.name]) == pytest.approx(float(e.subs({q: 0, k: at})), abs=1e-9)
        assert not ambiguous(run)


def test_stairs_that_fall_and_stairs_that_rise_disagree_on_a_step_and_say_so():
    run = solve(System({z: sp.floor(y) + sp.ceiling(y), y: -y}), (0, 1), {z: 0, y: 0})
    assert ambiguous(run)


@pytest.mark.parametrize("condition", [sp.exp(y) - 1 > 0, sp.exp(y) - 1 >= 0, 1 - sp.exp(y) >= 0])
@pytest.mark.parametrize("method", ["auto", "rk"])
def test_a_condition_on_a_state_at_its_bound(condition, method):
    # y comes to 0 at t = 1 and stays there.
    for rate in (-sp.Heaviside(y), -sp.sqrt(sp.Max(y, 0)) * 2):
        run = solve(System({z: when(condition), y: rate}), (0, 3), {z: 0, y: 1}, method=method)
        held = 2 * bool(condition.subs(y, 0)) + bool(condition.subs(y, 0.5))
        assert run["z"][-1] == pytest.approx(held, abs=1e-4) and not ambiguous(run)


@pytest.mark.parametrize("size", [1e-3, 1, 1e6])
@pytest.mark.parametrize("method", ["auto", "rk"])
def test_the_sign_of_a_gap_is_zero_once_its_contact_has_closed_in_any_unit(size, method):
    # Bounces end at t = 3 at the latest; e = sign(q) - e is 0 from there, but for what is left of it.
    unit = sp.Symbol("unit", positive=True)
    push = Unilateral(q / 1000, restitution=0.5, name="R").reaction / 1000
    rates = {q: u, u: unit * (-1 + 0.75 * sp.sin(t + 0.25)) + push, e: unit * sp.sign(q) - e}
    system = System(rates, time=t, parameters={unit: 1.0})
    start = {q: 0.06 * size, u: 0, e: 0}
    run = solve(system, (0, 9), start, parameters={unit: size}, method=method, t_eval=[5, 9], atol=1e-12 * size)
    assert run["e"][-1] == pytest.approx(run["e"][-2] * np.exp(-4), abs=1e-9 * size) and not ambiguous(run)


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_stairs_that_hold_the_motion_where_it_starts_fire_no_event(method):
    # x = 0 is held by the stairs of 4 x; an event waits for x to rise through 0.
    held = System(
        {y: sp.frac(4 * y + 2 * k) - sp.S.Half, z: 0},
        parameters={k: 1},
        events=[Event(y / 2, update={z: z + 1})],
    )
    for at in (0.5, 1, -1.5, -3):
        run = solve(held, (0, 2), {y: 0, z: 0}, parameters={k: at}, method=method)
        assert run["z"][-1] == 0 and run["y"][-1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("method", ["auto", "rk"])
def test_what_leaves_zero_and_steps_a_force_lets_static_friction_go(way, method):
    # sign y steps from 0 to 1 at t = 1, and the force from 3/4 to 5/4; the break-away force is 1.089.
    lam = Switch("lam", z)
    system = System(
        {z: way * (h + sp.sign(y) / 2) - lam * (1 + (1 - lam**2)), y: sp.Max(t - 1, 0)},
        time=t,
        parameters={h: 1},
    )
    for force, speed in ((0.5, 0.0), (0.75, 0.25), (0.9, 0.4)):
        run = solve(system, (0, 2), {z: 0, y: 0}, parameters={h: force}, method=method)
        assert run.success and run["z"][-1] == pytest.approx(way * speed, abs=1e-9)


# ---- what a disc holds at rest on a step


DISC = Disc("D", (y, z))


@pytest.mark.parametrize("wave", [sp.frac(z), sp.Mod(2 * z, 2) / 2, when(z < 0)])
def test_a_disc_at_rest_on_a_step_slips_with_the_force_of_the_side_to_which_it_slips(wave):
    # |force| is 1 at e + t/5 - 3/4 wave = sqrt(1 - 0.09). The slip that begins with wave = 0 leads to z < 0, where wave
    # is 1: there it is held on. One that leads to z > 0 goes on.
    system = System({y: e + t / 5 - 0.75 * wave - DISC[0], z: h - DISC[1]}, time=t, parameters={e: 0.3, h: 1})
    for force in (0.3, 0.4):
        begins = (np.sqrt(0.91) - force) * 5
        held = solve(system, (0, begins + 3.8), {y: 0, z: 0}, parameters={e: force, h: -0.3})
        assert held.success and not len(held.ambiguities)
        times = [
            event.time for event in held.events if event.switch == "D" and event.kind == "slip by tangency"
        ]
        np.testing.assert_allclose(times, [begins, begins + 3.75], atol=1e-8)
        run = solve(system, (0, begins + 0.1), {y: 0, z: 0}, parameters={e: force, h: 0.3})
        assert run.success and run["z"][-1] > 0
        np.testing.assert_allclose(run.event_times(switch="D"), [begins], atol=1e-8)


def test_a_value_at_zero_that_would_let_go_what_has_come_to_rest_is_none():
    # From y < 0 the tooth is 1 and the force on z is -0.1; on its step it is 0, and the force would be 1.2.
    system = System({y: -DISC[0], z: 1.2 - 1.3 * sp.frac(2 * y) - DISC[1]})
    run = solve(system, (0, 3), {y: -0.3, z: 0.02})
    assert run.success and not len(run.ambiguities) and np.all(run.x[:2, -1] == 0)


@pytest.mark.parametrize(
    ("step", "start", "way"),
    [
        (when(y < 0), 0.1, 1),
        (when(y < 0), -0.1, 1),
        (-sp.sign(y) / 2, 0.1, 1),
        (-sp.sign(y) / 2, -0.1, -1),
        (-sp.sign(y) / 2, -0.1, 1),
        (-sp.Heaviside(y), -0.1, -1),
        (sp.frac(y), -0.1, 1),
    ],
)
def test_a_slip_that_begins_from_rest_takes_the_side_to_which_it_leads(step, start, way):
    # The step drives apart: the body comes to rest under the push of the side from which it comes, and slips when the
    # force has grown to 1, to the other side or back to this one.
    system = System({y: e * (1 - t / 2) - step - DISC[0], z: -DISC[1]}, time=t, parameters={e: 0.4})
    push = 1.0 if step == sp.frac(y) else float(step.subs(y, start))
    leaves = 2 * (1 - (push / way - 1) / 0.4)
    run = solve(system, (0, leaves + 1), {y: start, z: 0.03}, parameters={e: way * 0.4})
    assert run.success and not len(run.ambiguities)
    times = [event.time for event in run.events if event.switch == "D" and event.kind == "slip by tangency"]
    np.testing.assert_allclose(times, [leaves], atol=1e-8)
    assert run["y"][-1] * way < 0


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("start", [1, 0.8])
@pytest.mark.parametrize(
    "back", [sp.floor(x), (sp.sign(x - 1) + 1) / 2, x - sp.frac(x), sp.Piecewise((1, x > 1), (0, True)), a]
)
def test_stairs_on_a_step_of_which_the_motion_slides_are_left_without_a_jump(back, start, method):
    # Held at 1 until the force 1/2 + t/4 is 1, at t = 2: x = 1 + (t - 2)**2/8 is 5/4 at 2 + sqrt(2).
    bell = Event(sp.frac(2 * x) - sp.Rational(1, 2), update={n: n + 1}, name="bell")
    unknown = [Algebraic(a, a - sp.floor(x))] if back == a else []
    system = System({x: sp.Rational(1, 2) + t / 4 - back}, time=t, events=[bell], algebraic=unknown)
    run = solve(system, (0, 3.8), {x: start}, method=method)
    # From below x comes to 1 where t/2 + t**2/8 = 1/5, and frac(2x) steps from 1 to 0.
    expected = [2 + np.sqrt(2)] if start == 1 else [-2 + np.sqrt(5.6), 2 + np.sqrt(2)]
    np.testing.assert_allclose(run.event_times(switch="bell"), expected, atol=1e-9)
    assert run["x"][-1] == pytest.approx(1 + 1.8**2 / 8, abs=1e-9) and not run.ambiguities


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("start", [1, 0.8])
@pytest.mark.parametrize("way", [1, -1])
def test_stairs_that_rested_with_a_stick_are_on_the_side_to_which_it_lets_go(way, start, method):
    # The force way*t/4 lets go at t = 2. From 1 downwards frac(2x) steps from 0 to 1, and carries the event, once.
    bell = Event(sp.frac(2 * x) - sp.Rational(1, 2), update={n: n + 1}, name="bell")
    rates = {x: way * t / 4 - sp.sign(x - 1) / 2, y: sp.frac(2 * x)}
    run = solve(System(rates, time=t, events=[bell]), (0, 3), {x: start, y: 0}, method=method)
    assert run.success and run["x"][-1] == pytest.approx(1 + way / 8, abs=1e-9)
    # From below it comes to 1 at an instant of its own, where 0.8 + t/2 + way*t**2/8 is 1.
    came = brentq(lambda s: s / 2 + way * s**2 / 8 - 0.2, 0, 1) if start == 0.8 else 0.0
    met = ([came] if start == 0.8 else []) + ([2] if way == -1 else [])
    np.testing.assert_allclose(run.event_times(switch="bell"), met, atol=1e-7)
    rise = 2 * (0.8 * came + came**2 / 4 + way * came**3 / 24) - came
    left = 1 / 12 if way == 1 else 11 / 12
    assert run["y"][-1] == pytest.approx((rise if start == 0.8 else 0) + left, abs=1e-9)


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("lift", [-0.2, 0.2])
@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("surface", [2 * y + z / 2, -y - z, y])
def test_a_condition_on_what_a_closed_contact_holds_means_what_it_says(surface, unknown, lift, method):
    # The condition moves the body as well: while it bounces its surface could slide, on the table it cannot.
    table = Unilateral(y, restitution=0.0152)
    for condition in (surface < 0, surface <= 0, surface > 0, surface >= 0):
        said = a if unknown else when(condition)
        rates = {x: said, y: z, z: table.reaction - 1 + lift * said}
        system = System(rates, time=t, algebraic=[Algebraic(a, a - when(condition))] if unknown else [])
        for height in (1, 0):
            run = solve(system, (0, 4), {x: 0, y: height, z: 0}, method=method, t_eval=[3, 4])
            at_zero = int(bool(condition.subs({y: 0, z: 0})))
            assert run["x"][1] - run["x"][0] == pytest.approx(at_zero, abs=1e-9)


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_a_switch_that_an_update_turns_moves_no_state_through_surfaces_it_stands_in(method):
    # The update to -1/4 puts x + lambda - 3/4 to 0 but for a rounding, for the lambda from before.
    side = Switch("side", 3 * x / 2)
    surface = 3 * x / 2 + Switch("bell", 3 * x / 2 - 0.75) / 2 - 0.5
    inner = sp.Piecewise((n / 2, x + side - 0.75 < 0), (0, True))
    system = System({x: 2.55 - x / 2}, time=t, events=[Event(surface + inner, update={x: -x / 2}, name="bell")])
    run = solve(system, (0, 3.3), {x: 0}, method=method)
    rise = 2 * np.log((5.1 + 0.25) / (5.1 - 0.5))  # from -1/4 to 1/2
    first = 2 * np.log(5.1 / 4.6)
    times = first + rise * np.arange(1 + int((3.3 - first) / rise))
    np.testing.assert_allclose(run.event_times(switch="bell", kind="reset"), times, atol=1e-9)


def test_a_condition_beside_a_stick_near_its_fold_does_not_leave_by_roundings():
    # Near the fold the series of lambda grows fast, and the terms of its surface that cancel leave roundings.
    stick = Switch("stick", z - 0.25)
    said = sp.Piecewise((sp.Rational(1, 2), sp.Not(z - e >= 0)), (0, True))
    rates = {z: 1.5 * sp.sin(2 * t) - h - stick * (2 - stick**2) / 2, y: said}
    system = System(rates, time=t, parameters={e: 0.25, h: 0.0}, events=[Event(at=-1.75, update={z: 0.25})])
    for force in np.linspace(0.03, 0.06, 13):
        for start in (-2.5, -2.3, -2.1, -1.9):
            run = solve(system, (start, -1.7), {z: 0.75, y: 0}, parameters={h: force})
            assert run.success and run["y"][-1] == 0
