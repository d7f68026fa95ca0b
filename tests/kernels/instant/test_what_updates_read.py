"""Updates and guards read signs and conditions at the instant itself: what is 0 within rounding is 0.

Guards: definition/lifting.py, kernels/instant/firing.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Disc, Drive, Event, Memory, Switch, System, Unilateral, solve

t, x, v, T, k = sp.symbols("t x v T k", real=True)
n, last = Memory("n", 0), Memory("last", -1)


def one(condition):
    return sp.Piecewise((1, condition), (0, True))


CONDITIONS = [
    (t > k, 0), (t >= k, 1), (t < k, 0), (t <= k, 1), (t - k > 0, 0), (k - t <= 0, 1),
    (sp.Mod(t, k) > 0, 0), (sp.Mod(t, k) <= 0, 1), (sp.frac(t / k) < 0.5, 1), (sp.sign(t - k) > -1, 1),
]  # fmt: skip


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize(("condition", "expected"), CONDITIONS)
def test_a_condition_on_time_at_a_tick_means_what_it_says(condition, expected, beside):
    # At the tick t = k, in an update and as a guard, whether or not a rate switches there too.
    rate = 1 + one(condition) if beside else 1
    for event in (
        Event(every=k, update={n: n + one(condition)}),
        Event(every=k, update={n: n + 1}, when=condition),
    ):
        run = solve(System({x: rate}, time=t, events=[event], parameters={k: 0.7}), (0, 1), {x: 0})
        assert run["n"][-1] == expected


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("period", [0.1, 0.3, 0.7])
def test_stairs_of_time_at_a_tick_are_those_of_the_tick(period, beside):
    # floor(t/T) = i at t = i T, also where 3 x 0.1 is a rounding above 0.3.
    stairs = sp.floor(t / T)
    tick = Event(every=T, update={n: stairs})
    system = System({x: 1 + stairs if beside else 1}, time=t, events=[tick], parameters={T: period})
    ticks = np.arange(1, 31)
    run = solve(system, (0, 30.5 * period), {x: 0}, t_eval=(ticks + 0.25) * period)
    assert run["n"].tolist() == ticks.tolist()


@pytest.mark.parametrize("unit", [1e-3, 0.1, 1.0])
def test_a_pause_of_three_strokes_ends_at_the_third(unit):
    # A neuron that is driven over its threshold at every stroke, and pauses for three: it fires at each third one.
    fire = Event(every=T, update={n: n + 1, last: t}, when=t - last >= 3 * T)
    run = solve(System({x: 0}, time=t, events=[fire], parameters={T: unit}), (0, 300.5 * unit), {x: 0})
    first = 2 if unit == 1 else 1  # three strokes after t = -1
    assert run["n"][-1] == len(range(first, 301, 3))


def test_a_velocity_that_sticks_is_0_in_updates():
    # lambda = 0.8 holds v = 0: it is what the Switch reads, while the sign of v and conditions on it are those of 0.
    lam = Switch("lam", v)
    read = {
        "sign": sp.sign(v), "above": one(v > 0), "not below": one(v >= 0), "multiplier": lam,
        "other surface": one(v - 2 * v > 0),
    }  # fmt: skip
    memories = {name: Memory(name.replace(" ", "_"), 5) for name in read}
    look = Event(at=1, update={memories[name]: e for name, e in read.items()})
    run = solve(System({v: 0.8 - lam}, time=t, events=[look]), (0, 2), {v: 0})
    found = {name: run[str(m)][-1] for name, m in memories.items()}
    assert found == {
        "sign": 0,
        "above": 0,
        "not below": 1,
        "multiplier": pytest.approx(0.8),
        "other surface": 0,
    }


def test_a_body_on_a_stop_is_at_rest_in_updates_and_in_rates():
    floor = Unilateral(x, restitution=0, name="floor")
    below, level, side = Memory("below", 5), Memory("level", 5), Memory("side", 5)
    look = Event(at=1, update={below: one(v < 0), level: one(v >= 0), side: sp.sign(v)})
    y = sp.Symbol("y", real=True)
    for start in (0, 0.2):  # begins on the stop, falls onto it
        system = System({x: v, v: -1 + floor.reaction, y: one(x > 0)}, time=t, events=[look], contacts=[floor])
        run = solve(system, (0, 2), {x: start, v: 0, y: 0})
        assert [run[m][-1] for m in ("below", "level", "side")] == [0, 1, 0]
        assert run["y"][-1] == pytest.approx(np.sqrt(2 * start), abs=1e-12)


def test_a_switch_that_a_round_carries_to_and_fro_has_the_side_of_its_end():
    # At t = 1 the table lifts 1/2 d + x by 1/4, an event takes it back by as much: sign is -1 again, to the last digit.
    d = sp.Symbol("d", real=True)
    table = {d: Drive([0, 1, 2], [-0.5, 0, 0], kind="hold")}
    back = Event(d + 0.25, update={x: x - 0.25})
    system = System({x: -sp.sign(d / 2 + x - 0.125)}, time=t, events=[back], drives=table)
    run = solve(system, (0.9, 1.125), {x: 0.125 - 0.0625 - 0.1}, t_eval=[1.125])
    assert run["x"][-1] == pytest.approx(0.125 - 0.0625 - 0.25 + 0.125, abs=1e-12)


def test_what_an_update_makes_too_strong_to_hold_is_at_its_bound_for_what_acts_next():
    # At t = 1 the force F goes from 1/2 to 3, or with a sign to -3: 3 = lam (2 - lam^2) has a root beyond -1 alone.
    F, w = sp.symbols("F w", real=True)
    first, second = Memory("first", 0), Memory("second", 0)
    lam, slip, floor = Switch("lam", v), Disc("slip", (v, w)), Unilateral(x, restitution=0)
    for way in (1, -1):
        grows = Event(at=[1], update={F: 3 * way})
        noted = Event(F - 2 * way, update={first: lam, second: lam})
        for friction in (lam, lam * (2 - lam**2)):
            run = solve(System({v: F - friction, F: 0}, events=[grows, noted]), (0, 2), {v: 0, F: 0.5 * way})
            assert run["first"][-1] == way
        noted = Event(F - 2 * way, update={first: slip[0], second: slip[1]})
        rates = {v: F - slip[0], w: F / 2 - slip[1], F: 0}
        run = solve(System(rates, events=[grows, noted]), (0, 2), {v: 0, w: 0, F: 0.5 * way})
        assert [run["first"][-1], run["second"][-1]] == pytest.approx(np.array([2, 1]) * way / np.sqrt(5))
    lifts = Event(at=[1], update={F: 2})
    noted = Event(F - 1, update={first: 1 + floor.reaction})
    system = System({x: v, v: F - 1 + floor.reaction, F: 0}, events=[lifts, noted])
    run = solve(system, (0, 2), {x: 0, v: 0, F: 0.5})
    assert run["first"][-1] == 1 and run["x"][-1] == pytest.approx(0.5)
