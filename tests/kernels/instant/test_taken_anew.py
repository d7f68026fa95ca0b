"""After any change at an instant everything that depends on it is taken anew.

What changes: an update, an impact, a switch that crosses, the clock. What depends on it: sides of events, switches in
surfaces, unknowns. Models and their right answers are closed forms, given beside each.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Algebraic, Disc, Drive, Event, Memory, Switch, System, Unilateral, solve

t, x, y, v, a, c, w, q = sp.symbols("t x y v a c w q", real=True)
n, m, s, pause = (Memory(name, 0) for name in ("n", "m", "s", "pause"))
THIRD = sp.Rational(1, 3)
TOOTH = System(
    {x: sp.Piecewise((0, sp.Mod(y, c) < c), (1, True)), y: s}, time=t, parameters={q: 1, c: 1},
    events=[Event(at=1, update={s: q})],
)  # fmt: skip
METHODS = pytest.mark.parametrize("method", ["auto", "rk"])


# ---- surfaces of events that jump


@METHODS
def test_an_event_on_an_unknown_in_which_all_cancels_fires_once(method):
    # a = 0 where x = 0: an equation whose other terms, q and q, are solved anew once the update has turned the tooth.
    tooth = sp.Piecewise((1, sp.Mod(2 * m - y / 4 - c, v) < v), (0, True))
    system = System(
        {x: sp.cos(t) + a / 2, y: -y / 2}, time=t, parameters={q: 1, c: 1, v: 0.75},
        algebraic=[Algebraic(a, a + a**3 / 4 - (x - q + q * tooth))],
        events=[Event(-a, direction=-1, update={m: 1 - m}, name="bell")],
    )  # fmt: skip
    rng = np.random.default_rng(1)
    for _ in range(20):
        values = {q: rng.uniform(0.1, 3), c: rng.uniform(-1, 1)}
        run = solve(system, (0, 1.2), {x: -rng.uniform(0.1, 0.5), y: 0.25}, parameters=values, method=method)
        assert run.success and len(run.event_times(switch="bell")) == 1


@METHODS
def test_an_event_on_an_unknown_fires_once_at_each_crossing(method):
    # h = 2a + 1/2 - sign(y + 3/4)/2 is 2a throughout, of which a tenth of a rounding of what a is made of may be left.
    system = System(
        {
            x: m / 2 + a / 2 - x / 2,
            y: sp.sin(3 * t) / 2 - y / 2 + x / 2,
            q: y / 2 - q + x / 2 + 2 * sp.sin(3 * t - 1 / 4),
        },
        time=t, algebraic=[Algebraic(a, a + c * a**3 - 2 * q)], parameters={c: 1},
        events=[Event(2 * a + 1 / 2 - sp.sign(y + 3 / 4) / 2, update={m: 1 - m}, name="bell")],
    )  # fmt: skip
    for cubic in (0, 1):
        run = solve(
            system, (0, 10), {x: 0, y: 0.25, q: 0.3}, parameters={c: cubic}, method=method, dense_output=True
        )
        times, sides = run.event_times(switch="bell"), []
        for before, after in zip([0, *times], [*times, 10], strict=True):
            sides.append(np.sign(run(np.linspace(before, after, 9)[1:-1])[2]))
        # Each fires where the unknown changes its sign, and nowhere else.
        assert len(times) > 1 and all(abs(s.sum()) == 7 for s in sides)
        assert all(s[0] == -s_next[0] for s, s_next in zip(sides, sides[1:], strict=False))


@METHODS
def test_no_rounding_moves_a_memory(method):
    # A body that sticks to a belt whose speed is a memory, and a crossing in which one stands: both put on surfaces.
    belt, steps = Memory("belt", 0.3), Memory("steps", 1)
    slip = sp.sign(v - 1.1 * belt - sp.sin(t) / 5)
    system = System(
        {y: v, v: 0.9 * sp.cos(1.3 * t) - y - slip, x: sp.floor(steps - c) + sp.sign(y + steps - 1)},
        time=t, parameters={c: 0}, events=[Event(every=0.7, update={n: n + 1})],
    )  # fmt: skip
    run = solve(system, (0, 60), {y: 0, v: 0, x: 0}, method=method)
    assert run.success and len(run.event_times(kind="stick")) > 10
    assert set(run["belt"]) == {0.3} and set(run["steps"]) == {1.0}


@METHODS
def test_a_body_that_sticks_on_a_table_does_not_slip_for_a_rounding(method):
    # What is left of the gap's rate is taken from the state by an impulse, which has its friction.
    table = Unilateral(q, restitution=0.3)
    system = System(
        {q: v, v: sp.sin(2 * t) / 2 - 1 + table.reaction, w: 0.2 * sp.sin(3 * t) - table.reaction * sp.sign(w) / 2},
        time=t, events=[Event(every=0.3, update={m: 1 - m}), Event(2 * w - sp.sin(5 * t) / 2, update={n: n + 1})],
    )  # fmt: skip
    run = solve(system, (0, 20), {q: 0.1, v: 0, w: 0.3}, method=method)
    assert run.success and not run["w"][run.t > 5].any()
    assert len([e for e in run.events if "slip" in e.kind]) == 0
    assert run["n"][-1] == 32  # sin(5t) is 0 31 times, and w falls through its half once


def test_a_condition_on_stairs_holds_where_a_disc_comes_to_rest_on_their_step():
    # Mod is below its divisor also where 2 - y/4 has come to rest on 2, a multiple of it.
    disc, level = Disc("D", (y, v)), Memory("level", 1)
    below = sp.Piecewise((1, sp.Mod(2 * level - y / 4, c) < c), (0, True))
    push = sp.sin(2 * t)
    system = System({y: 0.3 * push - disc[0], v: 0.2 * push - disc[1], x: below}, time=t, parameters={c: 0.5})
    run = solve(system, (0, 2), {y: 0.28, v: -0.2, x: 0})
    assert len(run.event_times(kind="stick")) == 1 and run["x"][-1] == pytest.approx(2, abs=1e-9)


def test_a_switch_that_an_event_jumps_with_is_crossed_once():
    # b of a disc passes 0, as sign(b - 1/2 + 1/2) does; the event that jumps with it pushes another state.
    disc, stop = Disc("D", (y, v)), Unilateral(q, restitution=0.5)
    inner = sp.sign(q + sp.Rational(1, 2)) / 2
    system = System(
        {
            y: sp.sin(t + 0.5) / 2 - disc[0], v: sp.sin(2 * t) / 2 - disc[1], q: w, w: stop.reaction - 1,
            x: 3 * sp.sin(3 * t - 0.5) / 4 - x / 2,
        },
        time=t, parameters={c: -0.5},
        events=[Event(x / 2 - q - 1 / 2 + sp.sign(v - inner - c), update={n: n + 1})],
    )  # fmt: skip
    rng = np.random.default_rng(3)
    for _ in range(20):
        start = {
            y: rng.uniform(-0.4, 0.4),
            v: -rng.uniform(0.3, 0.6),
            q: 0.75,
            w: -0.5,
            x: rng.uniform(0.2, 0.6),
        }
        run = solve(system, (0, 0.55), start)
        turns = [e.time for e in run.events if e.kind == "crossing"]
        assert run.success and len(set(turns)) == len(turns) and run["n"][-1] <= 3


@METHODS
def test_a_pulse_ends_before_what_is_given_at_its_end(method):
    # h = (8 - 5 x)/10 - pulse/2 falls at 1, as the pulse begins; at 3/2 it rises as that ends, and falls by the kick.
    pulse = sp.Piecewise((1, sp.Mod(t, c) < q * c), (0, True))
    bell = Event((8 - 5 * x) / 10 - pulse / 2, direction=-1, update={n: n + 1}, name="bell")
    system = System({x: sp.DiracDelta(t - 3 / 2)}, time=t, parameters={c: 1, q: 0.5}, events=[bell])
    run = solve(system, (0, 1.7), {x: 0.9}, method=method)
    assert run.success and run.event_times(switch="bell") == pytest.approx([1, 1.5])


@METHODS
def test_an_event_on_an_unknown_is_left_as_the_unknown_goes(method):
    # 2a + x/2 falls, as a does with a + a**3/4 = 1 - x, though x = t alone would raise it. It is 1 at x = 2 - 4a.
    bell = Event(2 * a + x / 2 - 1, direction=-1, update={n: n + 1}, name="bell")
    unknown = Algebraic(a, a + a**3 / 4 - 1 + x)
    run = solve(System({x: 1}, events=[bell], algebraic=[unknown]), (0, 2), {x: 0}, method=method)
    root = np.roots([1 / 4, 0, -3, 1])[-1]
    assert run.success and run["n"][-1] == 1
    np.testing.assert_allclose(run.event_times(switch="bell"), [2 - 4 * root], atol=1e-9)


@METHODS
def test_an_event_on_an_unknown_fires_once(method):
    # a = 2y - 1/10 rises as y = t does, and is c at t = (c + 0.1)/2: known by its series to the tolerance, before.
    bell = Event(c - a, direction=-1, update={x: x - 1}, name="bell")
    system = System({x: -x, y: 1}, parameters={c: 1}, events=[bell], algebraic=[Algebraic(a, a - 2 * y + 0.1)])
    for level in np.linspace(0.1, 1.9, 15):
        run = solve(system, (0, 1.1), {x: 1, y: 0}, parameters={c: level}, method=method)
        np.testing.assert_allclose(run.event_times(switch="bell"), [(level + 0.1) / 2], atol=1e-9)


@METHODS
def test_a_jump_of_a_surface_against_the_direction_fires_nothing_and_the_next_zero_does(method):
    # Mod(t, 10) - 3 rises through 0 at 3, 13, ... and falls by its jumps at 10, 20, ...
    bell = Event(sp.Mod(t, 10) - 3, direction=1, update={x: x + 1}, name="bell")
    run = solve(System({x: -x / 5}, time=t, events=[bell]), (0, 40), {x: 0}, method=method)
    np.testing.assert_allclose(run.event_times(switch="bell"), [3, 13, 23, 33], atol=1e-9)


def test_a_jump_of_a_surface_in_the_direction_fires_once():
    # Both ways: 3, 10, 13, 20, 23, 30, 33; falling alone: the jumps.
    for direction, times in ((0, [3, 10, 13, 20, 23, 30, 33]), (-1, [10, 20, 30])):
        count = Event(sp.Mod(t, 10) - 3, direction=direction, update={n: n + 1}, name="count")
        run = solve(System({x: -x / 5}, time=t, events=[count]), (0, 39), {x: 0})
        np.testing.assert_allclose(run.event_times(switch="count"), times, atol=1e-9)


def test_a_set_point_that_steps_over_the_state_is_reached_later():
    # x = t reaches 1 at t = 1; at 3 the set point becomes 4.
    r = sp.Piecewise((1, t < 3), (4, True))
    for terminal in (False, True):
        reached = Event(x - r, direction=1, terminal=terminal, name="reached")
        run = solve(
            System({x: 1}, time=t, events=[reached]), (2 if terminal else 0, 6), {x: 2 if terminal else 0}
        )
        np.testing.assert_allclose(run.event_times(switch="reached"), [4] if terminal else [1, 4], atol=1e-9)


def test_a_mark_on_a_wheel_is_passed_once_a_turn():
    # Mod(x, 2 pi) - pi rises at pi + 2 pi k and jumps down at 2 pi k.
    mark = Event(sp.Mod(x, 2 * sp.pi) - sp.pi, direction=1, name="mark")
    run = solve(System({x: 1}, events=[mark]), (0, 20), {x: 0})
    np.testing.assert_allclose(run.event_times(switch="mark"), np.pi * np.array([1, 3, 5]), atol=1e-8)


def test_an_impact_carries_a_velocity_through_zero_upward_alone():
    # Dropped from 0.2 with g = 10, e = 1/2: it lands at 0.2, 0.6, 0.8, ...; its tops are at 0.4, 0.7 less landing.
    floor = Unilateral(x, restitution=sp.Rational(1, 2), name="floor")
    for direction, times in (
        (-1, [0.3, 0.45, 0.525]),
        (1, [0.2, 0.4, 0.5]),
        (0, [0.2, 0.3, 0.4, 0.45, 0.5, 0.525]),
    ):
        events = [Event(v, direction=direction, update={n: n + 1}, name="top")]
        ball = System({x: v, v: -10 + floor.reaction}, events=events)
        run = solve(ball, (0, 0.54), {x: 0.2, v: 0})
        np.testing.assert_allclose(run.event_times(switch="top"), times, atol=1e-9)
        assert run["n"][-1] == len(times)


# ---- after an update


def test_a_state_that_an_update_puts_on_a_switch_to_rounding_stands_on_it():
    # x falls to 1, where it is put to 1 - 1, of either sign; from there it rises, or is held.
    lam = Switch("lam", x)
    to_zero = Event(x - sp.Rational(1, 2) - lam / 2, direction=-1, update={x: x - 1, n: n + 1}, name="to zero")
    rises = System({x: 2 * n - 1}, events=[to_zero])
    held = System({x: n / 2 - 1 - lam}, events=[Event(x - 1, update={x: x - 1, n: n + 1}, name="to zero")])
    for start in np.random.default_rng(0).uniform(1.1, 1.9, 40):
        run = solve(rises, (0, 1.5), {x: start, n: 0})
        assert [event.switch for event in run.events] == ["to zero"]
        assert run["x"][-1] == pytest.approx(2.5 - start, abs=1e-12)
        assert [event.kind for event in solve(held, (0, 1.5), {x: start, n: 0}).events] == ["reset", "stick"]


def test_the_unknown_of_a_surface_is_solved_after_its_update():
    # a = 2 x and x' = 1; x is put back to 0 whenever a comes to 1.
    system = System(
        {x: 1}, algebraic=[Algebraic(a, a - 2 * x)], events=[Event(a - 1, direction=1, update={x: 0})]
    )
    run = solve(system, (0, 2.2), {x: 0})
    np.testing.assert_allclose(run.event_times("reset"), [0.5, 1, 1.5, 2], atol=1e-9)


@METHODS
def test_a_kink_in_a_surface_is_on_its_side_after_the_update(method):
    # After the first firing the second entry is x - 0.23 > 0 up to the end, so that the surface stays positive.
    surface = sp.Max(sp.Rational(3, 5) + sp.cos(3.2 * t), x - 0.5 + 0.27 * m)
    once = System({x: -x / 5}, time=t, events=[Event(surface, update={m: m + 1}, name="once")])
    times = solve(once, (0, 3), {x: 0.51}, method=method).event_times(switch="once")
    np.testing.assert_allclose(times, [np.arccos(-0.6) / 3.2], atol=1e-8)


@pytest.mark.parametrize("method", ["auto", "rk", "stiff"])
@pytest.mark.parametrize("factor", [-1, 3, sp.Rational(1, 2)])
def test_an_update_that_maps_its_surface_onto_itself_fires_once(factor, method):
    # x' <= -1 - x/3 + 1/5 < 0 near 0, so that x falls through 0 once: 0 times a factor is 0.
    rates = {x: -1 - x / 3 + y / 5, y: -y + sp.cos(t) / 2}
    system = System(rates, time=t, events=[Event(x, direction=-1, update={x: factor * x, n: n + 1})])
    for x0 in np.linspace(0.6, 1.5, 10):
        assert solve(system, (0, 3), {x: x0, y: 0.25}, method=method)["n"][-1] == 1


def test_a_later_round_reads_switches_of_the_values_after():
    # x is 0.6 at t = 1; the clock makes it -0.6, and m = 1 fires the second event, which reads sign, Max, floor there.
    into = {s: sp.sign(x) + 10 * sp.Max(x, 0) + 100 * sp.floor(x)}
    events = [Event(at=1, update={x: -x, m: 1}), Event(m - sp.Rational(1, 2), update=into)]
    for read in (0, sp.sign(x) + sp.Max(x, 0) + sp.floor(x), sp.Max(x, 0)):
        run = solve(System({x: sp.Rational(1, 10), y: read}, events=events), (0, 1.5), {x: 0.5, y: 0})
        assert run["s"][-1] == -101


def test_a_surface_on_which_the_motion_has_rested_is_left_without_firing():
    # x rises with 1 from 0.25, and pauses for 14 at each 2 pi k; ten pauses end before t = 202.6.
    stops = Event(sp.sin(x), direction=1, update={pause: 1, c: 0}, name="stop")
    goes = Event(c - 14, direction=1, update={pause: 0}, name="go")
    for other in ({}, {y: sp.cos(3 * t) * y}):
        system = System({x: 1 - pause, c: pause, **other}, time=t, events=[stops, goes])
        for method in ("taylor", "rk"):
            run = solve(system, (0, 205), {x: 0.25, c: 0, **dict.fromkeys(other, 1)}, method=method)
            assert run["x"][-1] == pytest.approx(65.25, abs=1e-8)


@pytest.mark.parametrize("method", ["taylor", "rk", "stiff"])
def test_a_surface_that_jumps_off_the_zero_on_which_the_motion_rests_fires_nothing(method):
    # It falls to 0 at w = c, rests there, and jumps up or down at w = 3; and one that comes up to 0 as it jumps down.
    for jump in (sp.Heaviside(w - 3), -sp.Heaviside(w - 3)):
        for direction in (0, 1, -1):
            bell = Event(sp.Max(c - w, 0) + jump, direction=direction, update={n: n + 1}, name="bell")
            system = System({w: 1}, events=[bell], parameters={c: 2})
            for level in (2, 1.7, 2.3):
                run = solve(system, (0, 4), {w: 0}, parameters={c: level}, method=method)
                assert run.event_times(switch="bell") == pytest.approx([level] * (direction != 1), abs=1e-8)
    for direction in (0, 1, -1):
        bell = Event(w - 1 - sp.Heaviside(w - 1), direction=direction, update={n: n + 1}, name="bell")
        run = solve(System({w: 1}, events=[bell]), (0, 1.4), {w: 0.5}, method=method)
        assert run.event_times(switch="bell") == pytest.approx([0.5] * (direction != -1), abs=1e-8)


@pytest.mark.parametrize("unit", [1, 1e6, 1e-6])
@METHODS
def test_what_several_frictions_hold_on_the_surface_of_an_event_fires_nothing(method, unit):
    # Three signs hold x = y = w at 1/2, where the events stand; from t1 on all rise alike.
    def rate(one, other):
        drive = (
            sp.sin(2 * t + 0.25) / 2 + sp.Rational(3, 10) - sp.sign(one / unit - other / unit / 2 - 0.25) * 0.75
        )
        return unit * drive + (x + y + w) / 6 - one / 2

    bells = [Event(z - unit / 2, direction=-1, update={z: -z / 2}, name=f"bell {z}") for z in (x, y, w)]
    system = System({x: rate(x, y), y: rate(y, w), w: rate(w, x)}, time=t, events=bells)
    for start in ([-0.25, -0.25, 0], [0.1, 0.2, 0.3], [0.45, 0.45, 0.45], [-0.3, 0.1, 0.5]):
        run = solve(system, (2, 4), dict(zip((x, y, w), np.multiply(unit, start))), method=method)
        assert run.success and not [e for e in run.events if e.kind == "reset"]
        t1 = np.pi + (np.arcsin(0.9) - 0.25) / 2
        z = 0.5 + (np.cos(2 * t1 + 0.25) - np.cos(8.25)) / 4 - 0.45 * (4 - t1)
        assert run.x[:, -1] / unit == pytest.approx([z] * 3, abs=1e-8)


@pytest.mark.parametrize("method", ["taylor", "rk", "stiff"])
def test_an_update_takes_the_motion_off_a_surface_on_which_it_rests_without_firing(method):
    # From the start on, or from w = c on, where it falls to 0; a state and a record that is held move it up or down.
    held = sp.Symbol("held", real=True)
    for by in (0.5, -0.5):
        kick = Event(at=[3], update={x: x + by})
        record = Drive([-1, 0, 2.5, 3, 5], [0, 0, 0, by, by], kind="hold")
        for direction in (0, 1, -1):
            for moved, drives in ((x, None), (held, {held: record})):
                bell = Event(sp.Max(c - w, 0) + moved, direction=direction, update={n: n + 1}, name="bell")
                rates = {w: 1, x: 0}
                system = System(rates, time=t, events=[bell, kick], drives=drives, parameters={c: 2})
                for level in (2, 1.7, -1):
                    run = solve(system, (0, 4), {w: 0, x: 0}, parameters={c: level}, method=method)
                    times = [level] * (direction != 1 and level > 0)
                    assert run.event_times(switch="bell") == pytest.approx(times, abs=1e-8)


def test_a_velocity_that_a_contact_has_held_leaves_0_without_firing():
    # It falls through 0 with the impact and rests; the table lets go at t = 1, as the load 1 - t changes its sign.
    bell = Event(v, update={n: n + 1, y: y + 3 / 10}, name="bell")
    for start, e in (({q: 0, v: 0, y: 0}, 0), ({q: 0.1, v: 0, y: 0}, 0)):
        table = Unilateral(q, restitution=e)
        system = System({q: v, v: t - 1 - y + table.reaction, y: 0}, time=t, events=[bell])
        run = solve(system, (0, 3), start)
        assert run.success and run["n"][-1] == 0 and run["q"][-1] == pytest.approx(4 / 3, abs=1e-9)


@pytest.mark.parametrize(("level", "start"), [(0.3, 0.9), (0.7, 1.1)])
def test_a_surface_on_which_friction_has_held_the_motion_is_left_without_firing(level, start):
    # v falls to its level, where the bell rings, sticks, and goes on falling as the pull sinks; a slip is beside.
    bell = Event(v / 2 - q, direction=-1, update={n: n + 1}, name="bell")
    slip = Disc("slip", (y - 1 / 4, v))
    pull = 3 / 2 - 20 * t / 13 + sp.sin(t) / 5
    rates = {v: pull - sp.sign(v - c) - slip[1] / 5, y: sp.sin(3 * t) / 2 - slip[0] / 5}
    slider = System(rates, time=t, events=[bell], parameters={c: 1, q: 1})
    run = solve(slider, (0, 3), {v: start, y: 0.5}, parameters={c: level, q: level / 2})
    assert run.success and run["n"][-1] == 1 and run["v"][-1] < level
    assert [e.kind for e in run.events if e.switch == "sgn(c - v)"] == ["stick", "slip by tangency"]


def test_an_update_that_presses_a_body_down_as_its_table_lets_it_go_keeps_it_there():
    # At t = 1 the load has gone, and the stroke there puts it back; it goes at t = 1.3.
    stroke = Event(at=[1], update={y: y + 3 / 10})
    for held in (q, 2 * q):
        system = System(
            {q: v, v: t - 1 - y + Unilateral(held, restitution=0).reaction, y: 0}, time=t, events=[stroke]
        )
        run = solve(system, (0, 3), {q: 0, v: 0, y: 0})
        assert run.success and run["q"].min() >= 0 and run["q"][-1] == pytest.approx(1.7**3 / 6, abs=1e-9)


# ---- after a switch


def test_a_switch_of_an_unknown_that_jumps_takes_its_new_side():
    # a = x - 2 sgn(t - 1) with x = t is positive before 1 and from 2 on.
    system = System({x: 1, y: sp.Heaviside(a)}, time=t, algebraic=[Algebraic(a, a - x + 2 * sp.sign(t - 1))])
    assert solve(system, (0, 4), {x: 0, y: 0})["y"][-1] == pytest.approx(3, abs=1e-9)


# ---- at a start


@METHODS
def test_a_start_on_a_jump_of_mod_is_on_the_tooth_that_follows(method):
    # x = -t: Mod(x, 1) is 1 - t, below 1/4 from 0.75 to 1.
    low = sp.Piecewise((1, sp.Mod(x, 1) < sp.Rational(1, 4)), (0, True))
    run = solve(System({x: -1, y: low}), (0, 1.5), {x: 0, y: 0}, method=method)
    assert run["y"][-1] == pytest.approx(0.25, abs=1e-9)


@pytest.mark.parametrize("beside", ["stick", "unknown", "contact"])
def test_a_start_on_the_surface_of_an_event_is_no_event_whatever_is_solved_for_beside(beside):
    rest = Unilateral(x, name="floor")
    rates, algebraic = {"stick": ({v: -sp.sign(v)}, []), "unknown": ({v: a}, [Algebraic(a, a + v)]),
                        "contact": ({x: v, v: -1 + rest.reaction}, [])}[beside]  # fmt: skip
    system = System({**rates, y: -1}, algebraic=algebraic, events=[Event(y - 1, update={n: n + 1})])
    assert solve(system, (0, 0.5), {**dict.fromkeys(rates, 0), y: 1})["n"][-1] == 0


def test_the_side_of_a_switch_three_levels_deep_is_found_at_a_start():
    # e = 1 - t > 0.9: the dead zone gives 27 to 30, the saturation 8.
    e = 1 - q
    dead = sp.Piecewise((0, sp.Abs(e) < 0.02), (30 * e, True))
    run = solve(System({q: 1, w: sp.Min(8, dead)}), (0, 0.1), {q: 0, w: 0})
    assert run["w"][-1] == pytest.approx(0.8, abs=1e-9) and len(run.events) == 0
    relay = solve(System({q: w, w: sp.sign(dead - 2 * w - 8)}), (0, 0.01), {q: 0, w: 0})
    assert relay["q"][-1] == pytest.approx(5e-5, abs=1e-9)


# ---- with derivatives, and of multipliers


def test_derivatives_go_through_an_event_to_which_an_impact_carries():
    # At the landing, t = sqrt(2 h/10), v jumps through 0 upward and w becomes h t: w' by h is 3 t/2.
    w, h = sp.symbols("w h", real=True)
    floor = Unilateral(x, restitution=sp.Rational(1, 2), name="floor")
    lands = Event(v, direction=1, update={w: h * t}, name="lands")
    ball = System({x: v, v: -10 + floor.reaction, w: 0}, time=t, parameters={h: 0.2}, events=[lands])
    run = solve(ball, (0, 0.3), {x: 0.2, v: 0, w: 0}, by=["x", "h"])
    assert run["w"][-1] == pytest.approx(0.04, abs=1e-12)
    by_height = 0.2 * 0.5 / np.sqrt(2 * 0.2 * 10) * 2
    np.testing.assert_allclose(run.derivatives.end[2], [by_height, 0.2], rtol=1e-9)


def test_an_event_on_the_multiplier_of_a_stick_fires_where_that_is():
    # v = 0 is held up to t = 1 by lam = t.
    lam = Switch("lam", v)
    system = System(
        {v: t - lam}, time=t, events=[Event(lam - sp.Rational(1, 2), update={n: n + 1}, name="half")]
    )
    run = solve(system, (0, 0.9), {v: 0})
    np.testing.assert_allclose(run.event_times(switch="half"), [0.5], atol=1e-9)


@METHODS
def test_what_another_switch_is_on_average_beside_a_slide_is_recorded(method):
    # sgn(sin x) has the mean that sgn(x) has, by Filippov; from the surfaces that does not follow.
    z = sp.Symbol("z", real=True)
    system = System({x: -sp.sign(x) / 2 - sp.Rational(1, 4), z: sp.sign(sp.sin(x))})
    run = solve(system, (0, 3), {x: 0.75, z: 0}, method=method)
    assert [a.kind for a in run.ambiguities] == ["multipliers not unique"]


@METHODS
def test_an_update_leaves_the_switch_that_has_just_crossed_on_its_new_side(method):
    # sign x carries the surface of the event through 0 at t = 3/8, and is a rounding beyond its own; then at x = 5/4.
    carried = Event(-x / 2 - 3 / 8 + Switch("lam", 2 * x), update={y: y - 1 / 4}, name="carried")
    system = System({x: 2, y: x - 1}, events=[carried], algebraic=[Algebraic(a, a + a**3 / 4 + y / 2 + 3 / 4)])
    run = solve(system, (0, 2), {x: -0.75, y: 0.75}, method=method)
    np.testing.assert_allclose(run.event_times(switch="carried"), [3 / 8, 1], atol=1e-9)
    assert run.success and run["y"][-1] == pytest.approx(0.75, abs=1e-9)


@METHODS
@pytest.mark.parametrize(("direction", "each"), [(-1, 1), (0, 1), (1, 0)])
def test_an_event_on_the_gap_of_a_contact_fires_as_it_closes_and_not_as_it_rebounds(direction, each, method):
    # The pair fits both zeros of one instant apart, and which of them comes first.
    bell = Event(5 * x / 2 - c, direction=direction, update={n: n + 1})
    stop = Unilateral(x, restitution=0.5)
    force = 3 * sp.sin(2 * t + 0.3) / 4 - 1
    system = System({x: v, v: force + stop.reaction}, time=t, parameters={c: 0}, events=[bell])
    rng = np.random.default_rng(1)
    for _ in range(40):
        run = solve(system, (0, 1.6), {x: rng.uniform(0.1, 0.4), v: rng.uniform(-0.5, 0.2)}, method=method)
        assert run["n"][-1] == each * sum(event.kind == "impact" for event in run.events)


@METHODS
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_an_event_on_a_moving_surface_that_holds_the_motion_fires_as_it_comes_there_alone(direction, method):
    # Between the nodes of its steps the pair is on the belt and on the table to its tolerance, not to rounding.
    belt, table = c * sp.sin(3 * t), Unilateral(x - c * sp.sin(3 * t), restitution=0)
    bells = [Event(q * (v - belt), direction=direction, update={n: n + 1})]
    bells += [Event(q * table.gap, direction=direction, update={m: m + 1})]
    rates = {v: sp.cos(t) / 5 - 3 * sp.sign(v - belt) / 2, x: y, y: sp.sin(2 * t) / 3 - 1 + table.reaction}
    system = System(rates, time=t, parameters={c: 0.1, q: 1}, events=bells)
    for factor in (-2.5, 0.3, 1):
        for height in (0.02, -0.03):
            given, comes = {c: height, q: factor}, int(direction * factor <= 0)
            for tol in (1e-7, 1e-10):
                start = {x: 0, y: 3 * height, v: 0.3}
                run = solve(system, (0, 3), start, parameters=given, method=method, rtol=tol, atol=tol)
                assert run.success and (run["n"][-1], run["m"][-1]) == (comes, 0)


@METHODS
@pytest.mark.parametrize("direction", [0, 1])
def test_an_event_on_the_gap_of_a_table_that_falls_away_fires_once_as_it_is_hit(direction, method):
    # The body hits without rebound while the table falls faster: only the acceleration of the gap is left.
    table = Unilateral(x - c * sp.sin(q * t), restitution=0)
    bell = Event(table.gap, direction=direction, update={n: n + 1})
    system = System({x: v, v: table.reaction - 1}, time=t, parameters={c: 0.25, q: 3}, events=[bell])
    for height, rate in ((0.25, 3.2), (0.14, 3.1), (0.22, 2.8), (0.24, 2.4), (0.19, 2.9)):
        run = solve(system, (0, 1), {x: 0.3, v: 0}, parameters={c: height, q: rate}, method=method)
        assert run["n"][-1] == (0 if direction else sum(event.kind == "impact" for event in run.events))


@METHODS
def test_a_surface_that_has_been_passed_is_met_again_whatever_a_memory_counts(method):
    # From the tick on x = t - t^2/2 - 7/32: up through 1/10, and down again. A memory of 1 is not a rounding less.
    tick = Event(at=sp.Rational(1, 4), update={m: 1})
    bell = Event(x - sp.Rational(1, 10), direction=-1, update={n: n + 1}, name="bell")
    system = System({x: sp.Piecewise((1 - t, m >= 1), (1000, True))}, time=t, events=[bell, tick])
    run = solve(system, (0, 2.5), {x: -250}, method=method)
    np.testing.assert_allclose(
        run.event_times(switch="bell"), [1 + np.sqrt(1 - 2 * (1 / 10 + 7 / 32))], atol=1e-9
    )


# ---- signs that jump with a sign inside


@METHODS
@pytest.mark.parametrize("start", [-0.6, 0.6])
@pytest.mark.parametrize(
    ("inside", "unknown"),
    [
        (x + sp.sign(x), x),
        (y / 4 + sp.Heaviside(x) - 0.5, x),
        (a / 4 + sp.sign(a), x),
        (a, y / 4 + sp.sign(x)),
        (y + 2 * a, -y / 8 + 3 * sp.Heaviside(x) - 1),
    ],
)
def test_a_sign_holds_the_motion_by_the_signs_that_jump_with_it(inside, unknown, start, method):
    # Above x = 0 the outer sign is 1, below it is -1: as x' = -(sign x)/2 + 1/8, which stays at 0 after 1.6 and 0.96.
    equation = Algebraic(a, 2 * (a - unknown))
    system = System({x: sp.Rational(1, 8) - sp.sign(inside) / 2, y: -y}, algebraic=[equation])
    run = solve(system, (0, 3), {x: start, y: 0.2}, method=method)
    assert run.success and not len(run.ambiguities)
    arrival = run.t[np.flatnonzero(np.abs(run["x"]) < 1e-12)[0]]
    assert run["x"][-1] == 0 and arrival == pytest.approx(0.6 / (0.625 if start < 0 else 0.375), abs=1e-9)


@METHODS
@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize(("jump", "above"), [(2, 0.45), (2.75, 0.7), (-2, 0.45), (2.5, 0)])
def test_stairs_jump_with_a_sign_inside_from_side_to_side(jump, above, unknown, method):
    # x' = 0.45 - x below 0, and above 0.45 - x, 0.7 - x or -0.05 - x: where what is inside jumps by 2 nothing happens.
    inside = x + jump * sp.Heaviside(x) + sp.Rational(3, 10)
    unknowns = [Algebraic(a, 2 * (a - inside))] if unknown else []
    system = System({x: sp.Rational(3, 4) - sp.frac(a if unknown else inside)}, algebraic=unknowns)
    run = solve(system, (0, 1), {x: -0.25}, method=method)
    assert run["x"][-1] == pytest.approx(-above * np.expm1(np.log(0.7 / 0.45) - 1), abs=1e-8)
    assert run.success and not run.ambiguities


INNER = Switch("inner", c / 4 - x)
OUTER = Switch("outer", 3 * x + c * INNER / 2 - 3 * c / 4)
STAIRS = sp.floor(sp.Rational(5, 2) * x / c - sp.floor(4 * x / c - 1) / 8 - sp.Rational(11, 16))


@METHODS
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("slope", [0, 0.2, -0.2])
@pytest.mark.parametrize("push", [OUTER / 2, sp.sign(OUTER.surface) / 2, STAIRS + 0.5])
def test_what_jumps_with_stairs_or_a_switch_inside_holds_the_motion_with_them(push, slope, unit, method):
    # Below x = 1/4 the push is 1/2, above it is -1/2: x stays there from the first meeting on until the force is 1/2.
    force = q + a * t + push
    system = System({x: c * force, y: x / c}, time=t, parameters={q: 0.1, a: slope, c: 1})
    given = {c: unit, q: 0.1, a: slope}
    end = (np.sign(slope) * 0.5 - 0.1) / slope + 0.4 if slope else 4
    for start in (0.24, 0.25):
        run = solve(system, (0, end), {x: start * unit, y: 0}, parameters=given, method=method)
        assert run.success and not len(run.ambiguities)
        assert run["x"][-1] / unit == pytest.approx(0.25 + slope * 0.4**2 / 2, abs=1e-9)


def test_a_tooth_that_steps_as_an_event_strikes_lets_static_friction_go():
    # At t = 1 the force steps from q + 1/2 to q, beyond the break-away force; the slip that begins is backwards.
    lam = Switch("lam", v)
    friction = 0.544 * lam * (1 + 1.141 * (1 - lam**2))
    strike = Event(at=1, update={n: n + 1})
    system = System({v: q + sp.Mod(t, 1) / 2 - friction}, time=t, parameters={q: -1}, events=[strike])
    for force in (-0.8, -0.76, -0.72, -0.7):
        run = solve(system, (0.75, 1.5), {v: 0}, parameters={q: force})
        assert run.success, run.message
        assert run["v"][-1] == pytest.approx((force + 0.544) / 2 + 1 / 16, abs=1e-9)


@METHODS
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    "step", [sp.Heaviside(a - w), sp.Piecewise((1, a > w), (0, True)), (1 + sp.sign(a - w)) / 2]
)
def test_a_force_that_steps_with_a_condition_on_an_unknown_lets_static_friction_go(step, way, method):
    # The break-away force is 1.089, and the force q = 3/4 until the step to 5/4: then v' = 1/4. Half of it would hold.
    lam = Switch("lam", v)
    friction = lam * (1 + (1 - lam**2))
    unknown = Algebraic(a, a + a**3 / 4 - x)
    system = System(
        {v: way * (q + step / 2) - friction, x: 1, w: -0.1}, parameters={q: 0.75}, algebraic=[unknown]
    )
    meeting = brentq(lambda at: (1 - at / 10) + (1 - at / 10) ** 3 / 4 - at, 0, 2, xtol=1e-15)
    for force in (0.7, 0.75, 0.9):
        run = solve(system, (0, 3), {v: 0, x: 0, w: 1}, parameters={q: force}, method=method)
        assert run.success and not len(run.ambiguities)
        assert run["v"][-1] == pytest.approx(way * (force - 0.5) * (3 - meeting), abs=1e-9)


@METHODS
@pytest.mark.parametrize(("kind", "early"), [("hold", 0), ("line", 0.5)])
@pytest.mark.parametrize("way", [1, -1])
def test_a_friction_that_a_drive_turns_on_holds_the_motion_whatever_its_other_samples_are(
    way, kind, early, method
):
    # The brake is on from the sample at 2, or half-way to it, on for 10: x comes to 0 after 1/2, and goes on then.
    samples = way * np.array([-1.0, -1, *[1] * 10, -1, -1, -1])
    on = sp.Piecewise((sp.sign(x), way * v > 0), (0, True))
    system = System({x: 1 / 2 - on}, drives={v: Drive(np.arange(15.0), samples, kind=kind)})
    run = solve(system, (0, 12.5 - early), {x: -1.75 + early / 2}, method=method)
    assert run.success and run["x"][-1] == pytest.approx(0.25, abs=1e-9)


@pytest.mark.parametrize("level", [2.0, 0.25])
def test_a_condition_holds_the_motion_at_the_values_of_the_run_whatever_the_declared_ones_are(level):
    # Of x < 1 and x < c the smaller level holds; declared is c = 2, where x < c changes nothing.
    filling = sp.Piecewise((1, sp.And(x < 1, x < c)), (0, True))
    tank = System({x: filling - sp.Rational(1, 2)}, parameters={c: 2})
    run = solve(tank, (0, 4), {x: 0}, parameters={c: level})
    assert run.success and run["x"][-1] == pytest.approx(min(level, 1), abs=1e-12)
    assert solve(tank, (0, 4), {x: 0})["x"][-1] == 1


@METHODS
@pytest.mark.parametrize("middle", [0.5, 0.75])
@pytest.mark.parametrize(("before", "after"), [(0.75, 0.25), (0.75, -0.25), (-0.75, 0.25), (-0.75, -0.25)])
def test_a_condition_on_a_tooth_goes_with_the_tooth_also_where_a_ramp_bends(before, middle, after, method):
    """Mod(y, c) < c always holds: its surface is 0 where the tooth steps, here as the ramp bends, and then -c."""
    given = {c: 0.25, q: after}
    run = solve(TOOTH, (0, 1.8), {x: 0, y: middle - before, s: before}, parameters=given, method=method)
    assert run.success and abs(run["x"][-1]) < 1e-9


@METHODS
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("level", [0.3, 0.5, 0.8])
def test_a_switch_of_an_unknown_that_has_crossed_does_not_turn_back_by_a_rounding(level, unit, method):
    """Its surface 2a - c holds no state: how large it is, and its roundings, is said by the unknown alone."""
    unknown = Algebraic(a, a / q + (a / q) ** 3 / 5 - x / 3 - sp.sign(y - 5) / 2)
    counted = Event(y / 10 + sp.sign(2 * a - c), update={y: y + sp.Rational(1, 2), n: n + 1}, name="E")
    system = System(
        {x: 1 + sp.sin(3 * t) / 2, y: -y / 3},
        time=t,
        parameters={c: 1, q: 1},
        algebraic=[unknown],
        events=[counted],
    )
    run = solve(system, (0, 6), {x: 0.1, y: 0.3}, parameters={c: -level * unit, q: unit}, method=method)
    assert run.success and run["n"][-1] == 1 and [e.kind for e in run.events] == ["crossing", "reset"]


@METHODS
def test_a_condition_on_a_tooth_stays_on_its_side_where_the_tooth_steps(method):
    """Mod(2 y - x, c) < c always holds, so that y' = -1 - y/2; where y falls through a tooth its surface is 0."""
    system = System(
        {y: -sp.Piecewise((1, sp.Mod(2 * y - q, c) < c), (0, True)) - y / 2}, parameters={c: 1, q: 0}
    )
    random = np.random.default_rng(1)
    for _ in range(40):
        width, level, begin = random.uniform(0.5, 1.2), random.uniform(-1, 1), random.uniform(0, 1)
        run = solve(system, (0, 2), {y: begin}, parameters={c: width, q: level}, method=method)
        assert run["y"][-1] == pytest.approx((begin + 2) * np.exp(-1) - 2, abs=1e-7)


@METHODS
def test_stairs_whose_surface_jumps_as_it_comes_to_zero_stay_on_their_step(method):
    """u = floor(x)/2 - x + 1 comes down to 0 at x = 1, and jumps up to 1/2 there: floor(u) is 0 up to x = 3/2."""
    inner = sp.floor(x)
    system = System({x: 1 + inner / 10 + sp.floor(inner / 2 - x + 1) / 10})
    run = solve(system, (0, 0.75 + 0.5 / 1.1 + 0.5), {x: 0.25}, method=method)
    assert run["x"][-1] == pytest.approx(2, abs=1e-9) and not run.ambiguities


@METHODS
@pytest.mark.parametrize("unknown", [False, True])
def test_stairs_that_stand_in_stairs_on_both_of_whose_sides_these_are_met_let_them_hold(unknown, method):
    # z is x - 1/4 below x = 1/2 and x - 3/4 above: 2 z - 1/2 comes to 0 and to -1 there, and is between as x is held.
    tread = x / 2 - sp.Rational(1, 2) + sp.frac(x + sp.Rational(3, 2)) / 2
    z = a if unknown else tread
    rate = {x: z / 2 - c - sp.floor(2 * z - sp.Rational(1, 2)) / 4}
    beside = Event(sp.frac(4 * x - 1) - sp.Rational(1, 2), update={n: n + 1})
    for events in ([], [beside]):
        unknowns = [Algebraic(a, a - tread)] if unknown else []
        system = System(rate, algebraic=unknowns, parameters={c: 0.14}, events=events)
        # With steps of rk surfaces that meet from above or beside an event are apart by more than rounding.
        for start in (
            (0.5,) if method == "rk" and events else (0.5, 0.3) if method == "rk" else (0.5, 0.3, 0.51)
        ):
            run = solve(system, (0, 2), {x: start})
            assert run.success and run["x"][-1] == pytest.approx(0.5, abs=1e-12) and not run.ambiguities


@METHODS
@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("first", [False, True])
def test_what_jumps_with_stairs_that_are_met_with_it_waits_for_them_wherever_it_stands(first, unknown, method):
    if first:
        # At x = 0 the first of both comes down to the second, and jumps up with its tooth: the second stays the least.
        bent = sp.Max(x, 0) / 2 + 2 * x + 0.5
        o = sp.Min(5 * x / 2 + sp.frac(1 - 2 * x) / 2 + 0.5, bent)
        (below, down), (above, up) = (1.0625, 0.25), (1.0625, 0.3125)
    else:
        # The tooth steps, with it the floor that comes to 0, and with this the tooth on it: from -x to 1/2 - x.
        o = sp.frac(sp.floor(3 * x / 2 + sp.frac(-x / 2) / 2) / 2 - x + 0.5) * 2
        (below, down), (above, up) = (1.0, -0.25), (1.125, -0.25)
    unknowns = [Algebraic(a, a - o)] if unknown else []
    system = System({x: 1 + (a if unknown else o) / 8}, algebraic=unknowns)
    arrival = np.log(below / (below - 0.3 * down)) / down
    run = solve(system, (0, arrival + 0.3), {x: -0.3}, method=method)
    assert run["x"][-1] == pytest.approx(above / up * np.expm1(up * 0.3), abs=1e-9)


@METHODS
@pytest.mark.parametrize("begin", ["at once", "by a tick"])
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_states_that_move_alike_fire_nothing_on_their_difference(direction, begin, method):
    # x and y are the same function of time up to rounding, from the start or from when both are set to one value.
    apart = Event((x - y) / 2, direction=direction, update={n: n + 1})
    level = 1 / 3 if begin == "at once" else 1 / 7
    alike = Event(at=1 / 2, update={x: level, y: level})
    pushed = sp.sin(2 * t + 0.75)
    for push in (pushed, pushed / 2 + sp.sign(v + 3) / 2):
        rates = {x: (y + v) / 2 - x + push, y: (v + x) / 2 - y + push, v: -v}
        events = [apart] if begin == "at once" else [apart, alike]
        for start in (0.75, 0.7, 0.3, 1 / 3):
            ahead = 0.0 if begin == "at once" else 0.5
            values = {x: start + ahead, y: start, v: -0.75}
            run = solve(System(rates, time=t, events=events), (0, 10), values, method=method)
            assert run.success and run["n"][-1] == 0


def arrivals(level, start, g, f, omega, phase, end):
    """When y comes to `level`, for y' = f sin(omega t + phase) + (1 - f)/2 exp(-t) - g sign(y - level)."""
    met, at, off, side = [], 0.0, start - level, 1.0 if start > level else -1.0

    def force(s):
        return f * np.sin(omega * s + phase) + (1 - f) / 2 * np.exp(-s)

    def impulse(s):
        return -f / omega * np.cos(omega * s + phase) - (1 - f) / 2 * np.exp(-s)

    def first(function):
        times = np.arange(at + 1e-3, end, 1e-3)
        found = np.flatnonzero(function(times) < 0)
        return brentq(function, times[found[0]] - 1e-3, times[found[0]]) if len(found) else None

    def above(s):
        return side * (off + impulse(s) - impulse(at)) - g * (s - at)

    def hold(s):
        return g - abs(force(s))

    while True:
        came = first(above)
        if came is None:
            return met
        met.append(came)
        at, off = came, 0.0
        if hold(at) > 0:
            at = first(hold)
        if at is None:
            return met
        side = 1.0 if force(at) > 0 else -1.0


@METHODS
def test_an_event_on_what_several_frictions_hold_fires_as_they_come_there_and_never_as_they_let_go(method):
    # All three are alike. Some steps end far within what was tried, and the pair fits zeros of one instant apart.
    bell = Event(y - c, update={n: n + 1}, name="bell")
    f, omega, phase, g = sp.symbols("f omega phase g")
    rates = {
        u: (w + z) / 2 - u - g * sp.sign(u - w / 2 - c / 2) + f * sp.sin(omega * t + phase) + (1 - f) * q / 2
        for u, w, z in ((x, y, v), (y, v, x), (v, x, y))
    }
    system = System(rates | {q: -q}, time=t, parameters={c: 0, f: 1, omega: 1, phase: 0, g: 1}, events=[bell])
    rng = np.random.default_rng(1)
    for k in range(60):
        values = {c: rng.uniform(-1, 1) if k % 2 else -0.5, f: rng.uniform(0.3, 1), omega: rng.uniform(0.5, 4)}
        values |= {phase: rng.uniform(-1, 1), g: rng.uniform(0.5, 0.9)}
        run = solve(system, (0, 8), {x: 0.2, y: 0.2, v: 0.2, q: 1}, parameters=values, method=method)
        met = arrivals(values[c], 0.2, values[g], values[f], values[omega], values[phase], 8)
        np.testing.assert_allclose(run.event_times(switch="bell"), met, atol=1e-7)


@METHODS
@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("start", [1.3, 1.25, 1.2])
def test_stairs_that_move_the_rates_by_themselves_too_hold_with_what_jumps_with_them(start, unknown, method):
    # Above 5/4 the rate is -0.0225, below 0.3525. The tooth steps where floor(4x + 1) is 5.5: there z is 1/8.
    tread = -x + sp.floor(4 * x + 1) / 4
    z = a if unknown else tread
    rates = {x: (1 - x) / 2 + c + sp.frac(z - x / 2 + sp.Rational(1, 2)) / 2, y: z / 2 - y}
    system = System(rates, algebraic=[Algebraic(a, a - tread)] if unknown else [], parameters={c: 0.04})
    begin = (0, 4) if start == 1.25 else (0, 9)
    run = solve(system, begin, {x: start, y: 0}, method=method)
    assert run.success and run["x"][-1] == pytest.approx(1.25, abs=1e-12)
    if start == 1.25:
        assert not run.ambiguities
        assert run["y"][-1] == pytest.approx((1 - np.exp(-4)) / 16, abs=1e-9)


@METHODS
@pytest.mark.parametrize("step", [sp.floor(t), sp.Piecewise((0, t < 1), (1, True)), s])
def test_what_stays_on_a_jump_of_its_stairs_follows_where_the_rates_jump(step, method):
    # x' = push - 1 above the step of Mod(x, 1) and push below: it stays for a push between 0 and 1.
    when = sp.Piecewise((1, sp.Mod(x, 1) < c), (0, True))
    events = [Event(at=1, update={s: 1})] if step == s else []
    system = System({x: v + q * step - when}, time=t, parameters={v: 0.1, q: 0.1, c: 0.925}, events=events)
    for push, more in ((2e-4, 0.75), (0.1, 0.75), (0.9, -0.8), (0.5, 0.2), (0.1, 0.95), (0.9, -0.95)):
        run = solve(system, (0, 1.1), {x: 0.01}, parameters={v: push, q: more}, method=method)
        beyond = max(push + more - 1, 0) + min(push + more, 0)
        assert run.success and run["x"][-1] == pytest.approx(0.1 * beyond, abs=1e-12)
        assert beyond or not any(event.kind.startswith("stick") for event in run.events if event.time > 0.9)


@METHODS
def test_stairs_let_go_beside_an_event_keep_no_zero_that_they_have_jumped_off(method):
    # It stays on the step of Mod(x, 1) while the push 0.3 - 0.3 t is above 0; the event that never fires looks on.
    when = sp.Piecewise((1, sp.Mod(x, 1) < c), (0, True))
    events = [Event(y - 2 - sp.frac(x), update={m: 1})]
    system = System({x: 0.3 - 0.3 * t - when, y: 0}, time=t, parameters={c: 0.32}, events=events)
    run = solve(system, (0, 2), {x: 0.01, y: 0}, method=method)
    assert (
        run.success
        and run["x"][-1] == pytest.approx(-0.15, abs=1e-12)
        and not run.event_times(kind="reset").size
    )
