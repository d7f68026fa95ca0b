"""The contract of Event: when it fires, in which order, from which values; and what dense output says between.

Guards: kernels/instant/, kernels/firing.py, kernels/trajectory.py, paths/clock.py.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Drive, Event, Family, Memory, Switch, System, Unilateral, solve

t, x, y, v, z = sp.symbols("t x y v z", real=True)
HALF = sp.Rational(1, 2)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])
PATHS = pytest.mark.parametrize("method", ["taylor", "rk", "stiff"])


def names(solution):
    return [e.switch for e in solution.events]


# ---- surfaces, direction, when


@PATHS
@pytest.mark.parametrize("direction", [0, 1])
def test_a_reset_that_puts_the_state_back_fires_every_time(direction, method):
    system = System({x: 1}, events=[Event(x - 1, update={x: 0}, direction=direction)])
    solution = solve(system, (0, 4.5), {x: 0}, method=method)
    assert solution.event_times() == pytest.approx([1, 2, 3, 4], abs=1e-12)
    assert solution.x[0, -1] == pytest.approx(0.5, abs=1e-12)


def test_direction_chooses_rising_and_falling_zeros():
    events = [Event(x, direction=d, name=n) for d, n in ((1, "up"), (-1, "down"), (0, "both"))]
    solution = solve(System({x: v, v: -x}, events=events), (0, 9), {x: 1, v: 0})
    assert names(solution) == ["down", "both", "up", "both", "down", "both"]
    assert solution.event_times(switch="both") == pytest.approx(math.pi * np.array([0.5, 1.5, 2.5]), abs=1e-8)


def test_a_start_on_the_surface_of_an_event_is_no_event():
    solution = solve(System({x: v, v: -x}, events=[Event(x)]), (0, 4), {x: 0, v: 1})
    assert solution.event_times() == pytest.approx([math.pi], abs=1e-8)


def test_when_decides_at_the_instant_with_the_values_there():
    armed = Memory("armed", 0)
    events = [Event(at=2, update={armed: 1}), Event(x, when=sp.Eq(armed, 1), terminal=True)]
    solution = solve(System({x: v, v: -x}, events=events), (0, 9), {x: 1, v: 0})
    # the zero at pi/2 finds it unarmed
    assert solution.t[-1] == pytest.approx(1.5 * math.pi, abs=1e-8)
    assert len(solution.events) == 2


def test_an_event_without_update_only_records():
    plain, watched = (
        solve(System({x: v, v: -x}, events=events), (0, 9), {x: 1, v: 0}) for events in ([], [Event(x - HALF)])
    )
    assert len(watched.events) == 3
    assert watched.x[:, -1] == pytest.approx(plain.x[:, -1], abs=1e-9)


# ---- the clock


def test_every_ticks_at_multiples_after_the_start_up_to_the_end():
    count = Memory("count", 0)
    system = System({x: 1}, events=[Event(every=HALF, update={count: count + 1})])
    solution = solve(system, (0.7, 2.5), {x: 0})
    assert solution.event_times().tolist() == [1.0, 1.5, 2.0, 2.5]
    assert solution["count"][-1] == 4
    # the start itself is no tick
    assert solve(system, (1.0, 1.9), {x: 0}).event_times().tolist() == [1.5]


def test_at_gives_its_instants_once_each_in_any_order():
    solution = solve(System({x: 1}, events=[Event(at=[3, 1, 1, 9])]), (0, 5), {x: 0})
    assert solution.event_times().tolist() == [1.0, 3.0]


@PATHS
def test_clocks_that_agree_up_to_rounding_strike_together(method):
    # 3*0.1 is one rounding above 0.3; both read the values before
    a, b = Memory("a", 0), Memory("b", -1)
    events = [Event(every=0.1, update={a: a + 1}, name="a"), Event(every=0.3, update={b: a + 0}, name="b")]
    solution = solve(System({x: 1}, events=events), (0, 1), {x: 0}, method=method)
    assert solution.success
    assert names(solution) == ["a", "a", "a", "b", "a", "a", "a", "b", "a", "a", "a", "b", "a"]
    assert solution["b"][-1] == 8


@PATHS
def test_an_instant_of_its_own_may_be_one_of_a_period(method):
    a, b = Memory("a", 0), Memory("b", 0)
    events = [Event(every=0.1, update={a: a + 1}, name="a"), Event(at=0.3, update={b: a + 0}, name="b")]
    solution = solve(System({x: 1}, events=events), (0, 0.45), {x: 0}, method=method)
    assert names(solution) == ["a", "a", "a", "b", "a"]
    assert solution.event_times(switch="a")[2] == solution.event_times(switch="b")[0]
    assert solution["b"][-1] == 2


def test_a_parameter_may_set_the_clock():
    T = sp.Symbol("T", positive=True)
    system = System({x: 1}, parameters={T: 1}, events=[Event(every=T)])
    assert solve(system, (0, 1.6), {x: 0}, parameters={T: 0.5}).event_times().tolist() == [0.5, 1.0, 1.5]


# ---- one instant


@PATHS
def test_a_sample_of_a_drive_acts_with_the_events_of_its_instant(method):
    # The tick takes d + x - 1/2 down to -1/2 by itself, the sample up to 5/2, both together to 3/2.
    d = sp.Symbol("d")
    tick = Event(every=1, update={x: 0})
    bell = Event(d + x - HALF, update={x: 7}, name="bell")
    step = Drive([0, 1, 4], [0, 2, 2], kind="hold")
    run = solve(
        System({x: 0 * y, y: -y}, events=[tick, bell], drives={d: step}), (0, 2.5), {x: 1, y: 1}, method=method
    )
    assert run.event_times(switch="bell").size == 0 and run["x"][-1] == 0


def test_events_of_one_instant_read_the_values_before():
    a, b = Memory("a", 3), Memory("b", 7)
    swap = [Event(x - 1, update={a: b}), Event(x - 1, update={b: a})]
    solution = solve(System({x: 1}, events=swap), (0, 2), {x: 0})
    assert (solution["a"][-1], solution["b"][-1]) == (7, 3)


def test_what_an_update_jumps_through_fires_next_with_the_values_after():
    flag, seen = Memory("flag", 0), Memory("seen", 0)
    chain = [
        Event(flag - HALF, update={seen: x + 0}, name="second"),
        Event(x - 1, update={flag: 1, x: 5}, name="first"),
    ]
    solution = solve(System({x: 1}, events=chain), (0, 2), {x: 0})
    assert names(solution) == ["first", "second"]
    assert solution.event_times() == pytest.approx([1, 1], abs=1e-12)
    assert (solution["seen"][-1], solution["x"][-1]) == pytest.approx((5, 6), abs=1e-12)


def test_switches_are_classified_with_the_field_after_the_events():
    # Without the event x sticks at 0; the event at the same instant lets the field push up on both sides.
    lam, push = Switch("lam", x), Memory("push", 0)
    events = [Event(x, direction=-1, update={push: 3})]
    solution = solve(System({x: -lam + push}, events=events), (0, 2), {x: 1})
    assert solution.event_times("stick").size == 0
    assert solution.x[0, -1] == pytest.approx(2.0, abs=1e-12)
    assert solve(System({x: -lam}), (0, 2), {x: 1}).event_times("stick") == pytest.approx([1.0])


def test_a_reset_takes_a_sliding_switch_off_its_surface():
    lam = Switch("lam", x)
    solution = solve(System({x: -lam}, events=[Event(at=2, update={x: HALF})]), (0, 4), {x: 1})
    assert solution.event_times("stick") == pytest.approx([1, 2.5], abs=1e-12)
    assert solution.x[0, -1] == 0.0


def test_memories_are_columns_before_and_after_their_event():
    speed = Memory("speed", 0)
    solution = solve(System({x: v, v: -x}, events=[Event(x, update={speed: v + 0})]), (0, 2), {x: 1, v: 0})
    before, after = np.flatnonzero(np.isclose(solution.t, math.pi / 2, atol=1e-7))
    assert solution["speed"][before] == 0 and solution["speed"][after] == pytest.approx(-1, abs=1e-8)


# ---- dense output


def inner_relaxation():
    """Slides on x = 0 with y = 10 (2 lam^3 - lam): folds at |lam| = 1/sqrt 6 land on -+2/sqrt 6."""
    lam = Switch("lam", x)
    return System({x: y / 10 + lam - 2 * lam**3, y: -lam})


def test_wanted_times_have_the_values_of_the_dense_output():
    wanted = np.linspace(0, 40, 401)
    asked = solve(inner_relaxation(), (0, 40), {x: -0.1, y: 0}, t_eval=wanted)
    dense = solve(inner_relaxation(), (0, 40), {x: -0.1, y: 0}, dense_output=True)
    assert np.array_equal(asked.t, wanted)
    assert asked.x == pytest.approx(dense(wanted), abs=1e-13)
    assert asked["lam"] == pytest.approx(dense(wanted, "lam"), abs=1e-9)


def test_dense_output_across_folds_follows_the_closed_form():
    # Along a branch dt = -10 (6 lam - 1/lam) dlam, from 2/sqrt 6 after a fold to 1/sqrt 6 at the next.
    solution = solve(inner_relaxation(), (0, 60), {x: -0.1, y: 0}, rtol=1e-12, atol=1e-14, dense_output=True)
    folds = solution.event_times("sliding to sliding")[:3]
    assert len(folds) == 3
    for begin, end in zip(folds, folds[1:]):
        # graded towards the fold, where lambda has a square root: down to 1e-9 before it
        fine = np.concatenate([np.linspace(begin, end, 1000)[1:-1], end - np.geomspace(1e-9, 1, 200)[::-1]])
        lam, height = np.abs(solution(fine, "lam")), np.abs(solution(fine, "y"))
        elapsed = 10 * (3 * (2 / 3 - lam**2) + np.log(lam * math.sqrt(6) / 2))
        assert elapsed == pytest.approx(fine - begin, abs=1e-8)
        assert height == pytest.approx(np.abs(10 * (2 * lam**3 - lam)), abs=1e-9)
        assert np.max(np.abs(solution(fine, "x"))) < 1e-16


# ---- several switches, two methods


def two_relays():
    """Sticks one by one: lam2 = 1/5 and lam1 = 1/10 in the end; z' is their product."""
    l1, l2 = Switch("l1", x), Switch("l2", y)
    return System({x: -l1 + l2 / 2, y: -l2 + sp.Rational(1, 5), z: l1 * l2})


@METHODS
def test_two_switches_slide_together_with_their_joint_multipliers(method):
    # x reaches 0 at 0.3/0.5, then l1 = 1/2; y at 0.9/0.8, then l2 = 1/5 and l1 = 1/10
    solution = solve(two_relays(), (0, 2), {x: 0.3, y: 0.9, z: 0}, method=method)
    assert solution.event_times("stick") == pytest.approx([0.6, 1.125], abs=1e-10)
    assert [solution[s][-1] for s in ("l1", "l2")] == pytest.approx([0.1, 0.2], abs=1e-12)
    assert solution["z"][-1] == pytest.approx(0.6 + 0.5 * 0.525 + 0.02 * 0.875, abs=1e-10)
    assert solution.x[:2, -1].tolist() == [0.0, 0.0]


@METHODS
def test_two_switches_met_at_one_instant_slide_from_there(method):
    solution = solve(two_relays(), (0, 2), {x: 0.5, y: 0.8, z: 0}, method=method)
    assert solution.event_times("stick") == pytest.approx([1, 1], abs=1e-10)
    assert solution["z"][-1] == pytest.approx(1 + 0.02, abs=1e-10)


def driven():
    """The friction oscillator with a hidden term that stays away from its folds."""
    lam = Switch("lam", v)
    return System({x: v, v: 2 * sp.sin(t) - 3 * x - v / 10 - lam * (1 + (1 - lam**2) / 5)}, time=t)


def ball():
    floor = Unilateral(x, restitution=0.8, name="R")
    return System({x: v, v: -10 + floor.reaction})


def pendulum():
    return System({x: v, v: -sp.sin(x) - sp.sign(v) / 10 - v * sp.Abs(v) / 5})


@pytest.mark.parametrize(
    ("make", "span", "start"),
    [(driven, 20, [0.5, 0.3]), (ball, 2.5, [1, 0]), (pendulum, 20, [2, 0]), (two_relays, 2, [0.3, -0.9, 0])],
    ids=["hidden", "impacts", "pendulum", "relays"],
)
def test_both_methods_give_the_same_events_and_states(make, span, start):
    taylor, pair = (
        solve(make(), (0, span), start, method=method, rtol=1e-11, atol=1e-13) for method in ("taylor", "rk")
    )
    assert len(taylor.events) >= 1
    assert [(e.kind, e.switch) for e in taylor.events] == [(e.kind, e.switch) for e in pair.events]
    assert pair.event_times() == pytest.approx(taylor.event_times(), abs=1e-8)
    assert pair.x[:, -1] == pytest.approx(taylor.x[:, -1], abs=1e-8)
    assert taylor.cost["steps"] < pair.cost["steps"]


@pytest.mark.parametrize("roundings", range(-3, 9))
@pytest.mark.parametrize("kinked", [True, False], ids=["kink", "switch"])
def test_a_reset_at_the_instant_of_a_crossing_leaves_the_surface_behind(kinked, roundings):
    """u = x - 1 falls through 0 at t = 1 with u' = -1 - a u, and is put to -1 there: u' = -1 - b u from then on."""
    u, gap = x - 1, sp.Rational(1, 10)
    term = gap * sp.Abs(u) if kinked else gap * sp.sign(u)
    put = Event(at=1 + roundings * np.spacing(1.0), update={x: 0}, name="put")
    system = System({x: -1 - 2 * u + term}, time=t, events=[put])
    above, below, push = (1.9, 2.1, -1.0) if kinked else (2.0, 2.0, -1.1)
    first = 1 if kinked else 0.9
    solution = solve(system, (0, 3), {x: 1 + first * math.expm1(above) / above}, rtol=1e-10)
    rest = push / below
    assert solution.x[0, -1] == pytest.approx(1 + rest + (-1 - rest) * math.exp(-2 * below), abs=1e-9)
    assert solution.status[0, -1] == -1
    assert len(solution.event_times("reset")) == 1 and len(solution.events) == 2


@pytest.mark.parametrize("view", ["exact", "smoothed"])
@pytest.mark.parametrize("roundings", [1, 2, 3, 5])
@pytest.mark.parametrize("T", [1.3, 2.0])
def test_an_instant_may_come_one_rounding_after_another(T, roundings, view):
    later = T + roundings * np.spacing(T)
    events = [Event(at=when, update={x: x + 1}, name=name) for name, when in (("first", T), ("second", later))]
    system = System({x: v, v: -x - sp.sign(v) / 4}, time=t, events=events)
    system = system if view == "exact" else system.smoothed(eps=1e-3)
    whole, short = (solve(system, (0, end), {x: 2, v: 0}) for end in (4, later))
    assert whole.success and short.success
    assert len(whole.event_times("reset")) == len(short.event_times("reset")) == 2
    assert short.t[-1] == later


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("roundings", range(-4, 8))
def test_a_span_may_end_roundings_from_a_crossing(roundings, method):
    system, start = System({x: -1 - 2 * x + sp.Abs(x) / 10}), {x: math.expm1(3.8) / 1.9}
    (crossing,) = solve(system, (0, 3), start, rtol=1e-10, method=method).event_times("crossing")
    end = crossing + roundings * np.spacing(crossing)
    solution = solve(system, (0, end), start, rtol=1e-10, method=method)
    assert solution.success and solution.t[-1] == end


# ---- resets beyond the event's own surface, and several events that write one state


@PATHS
@pytest.mark.parametrize("speed", [1, -1])
def test_a_reset_beyond_its_own_surface_is_met_again_from_there(speed, method):
    # A flight under gravity 1, put to x = 5/4 with this speed whenever x = 1 is met.
    system = System({x: y, y: -1}, events=[Event(x - 1, update={x: sp.Rational(5, 4), y: speed})])
    first, between = 2 - math.sqrt(2), speed + math.sqrt(1.5)
    times = first + between * np.arange(1 + int((6 - first) / between))
    solution = solve(system, (0, 6), [0, 2], method=method)
    assert solution.event_times() == pytest.approx(times, abs=1e-9)


@PATHS
def test_a_thermostat_with_overshoot_switches_at_its_times(method):
    m = Memory("m", 1)
    system = System({x: m}, events=[Event(x - 1, update={x: x + m / 10, m: -m})])
    solution = solve(system, (0, 1.95), {x: 0}, method=method)
    assert solution.event_times() == pytest.approx(1 + np.arange(10) / 10, abs=1e-9)


@PATHS
def test_increments_of_one_instant_add_up(method):
    c, d = Memory("c", 0), Memory("d", 2)
    updates = ({v: 0, c: c + 1}, {z: 0, c: c + sp.Rational(1, 2), d: 7})
    events = [Event(s - 1, update=update) for s, update in zip((v, z), updates)]
    system = System({x: 0, v: 1, z: 1}, events=events)
    solution = solve(system, (0, 1.5), [0, 0, 0], method=method)
    assert (solution["c"][-1], solution["d"][-1]) == (1.5, 7) and not solution.ambiguities


@PATHS
@pytest.mark.parametrize("kick", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("reset", [0, -x * 9 / 10])
def test_an_event_that_a_kick_carries_the_state_through_fires_once(kick, reset, method):
    # x = 0.95 before the kick, threshold 1: a kick through it is one spike, as the flow's is.
    n = Memory("n", 0)
    spike, kicked = Event(x - 1, update={x: reset, n: n + 1}), Event(at=1.9, update={x: x + kick})
    solution = solve(System({x: HALF}, events=[spike, kicked]), (0, 3), {x: 0}, method=method)
    assert solution["n"][-1] == 1
    rest = (0.95 + kick) * (0 if reset == 0 else -0.9) + 0.55
    assert solution["x"][-1] == pytest.approx(rest, abs=1e-9)


def bouncing_at_its_switch(x, v, w):
    surface = sp.sin(x) - sp.Rational(1, 3)
    bounce = Event(sp.expand(7 * w * surface), update={v: -9 * v / 10}, name="bounce")
    return System({x: v, v: -w * x - sp.sign(surface) / 3}, events=[bounce], parameters={w: 1})


def test_an_event_on_a_switchs_own_surface_keeps_the_motion_on_its_side_in_a_family_too():
    family, w = Family(12), sp.Symbol("w", positive=True)
    (w_,), (x_, v_) = family.symbols("w", positive=True), family.symbols("x v")
    together, alone = bouncing_at_its_switch(x_, v_, w_), bouncing_at_its_switch(x, v, w)
    random = np.random.default_rng(1)
    values = np.stack([random.uniform(low, high, 60) for low, high in ((0.5, 2), (-1, 1), (-2, 2))])
    for some in np.split(values, 5, axis=1):
        run = solve(together, (0, 7), {x_: some[1], v_: some[2]}, parameters={w_: some[0]})
        for k, (w_k, x_k, v_k) in enumerate(some.T, 1):
            one = solve(alone, (0, 7), {x: x_k, v: v_k}, parameters={w: w_k})
            mine = [e for e in run.events if e.switch in (f"bounce {k}", f"sgn(sin(x_{k}) - 1/3)")]
            assert [e.kind for e in mine] == [e.kind for e in one.events]
            assert {e.kind for e in mine} == {"reset"}


@METHODS
def test_ten_neurons_that_fire_together_add_ten_increments(method):
    potentials = sp.symbols("u1:11", real=True)
    events = [Event(u - 1, update={u: 0, x: x + sp.Rational(1, 10)}) for u in potentials]
    solution = solve(
        System({x: 0} | {u: 1 for u in potentials}, events=events), (0, 1.5), [0] * 11, method=method
    )
    assert solution["x"][-1] == pytest.approx(1, abs=1e-15)
    neurons = Family(10)
    (u,) = neurons.symbols("u")
    family = System({x: 0, u: 1}, events=[Event(u - 1, update={u: 0, x: x + sp.Rational(1, 10)})])
    assert solve(family, (0, 1.5), {x: 0, u: 0}, method=method)["x"][-1] == pytest.approx(1, abs=1e-15)


@PATHS
@pytest.mark.parametrize(
    ("first", "second", "conflict"),
    [
        (5, 5, False),
        (5, 6, True),
        (x + 1, 5, True),
        (5, x + 1, True),
        (2 * x, x + 1, True),
        (x + 1, x + v, False),
    ],
)
def test_updates_that_contradict_each_other_are_recorded(first, second, conflict, method):
    events = [Event(v - 1, update={v: 0, x: first}, name="one"), Event(z - 1, update={z: 0, x: second})]
    system = System({x: 0, v: 1, z: 1}, events=events)
    solution = solve(system, (0, 1.5), [3, 0, 0], method=method)
    kinds = [(a.kind, a.time) for a in solution.ambiguities]
    assert kinds == ([("conflicting updates", pytest.approx(1))] if conflict else [])
    if method != "stiff":
        strict = solve(system, (0, 1.5), [3, 0, 0], method=method, strict=True)
        assert strict.outcome.name == ("AMBIGUITY" if conflict else "FINISHED")


@PATHS
@pytest.mark.parametrize("symmetric", [True, False])
def test_an_event_at_whose_surface_the_states_change_places_fires_once_a_crossing(symmetric, method):
    # The swap moves x + y by a rounding at most, and x + 2 y - 1.5 to where it is met again.
    n = Memory("n", 0)
    surface = x + y - 1 if symmetric else x + 2 * y - sp.Rational(3, 2)
    system = System({x: HALF, y: HALF}, events=[Event(surface, update={x: y, y: x, n: n + 1})])
    solution = solve(system, (0, 3), {x: 0.13, y: 0.24}, method=method)
    first, again = (0.63, None) if symmetric else ((1.5 - 0.13 - 0.48) / 1.5, 0.11 / 1.5)
    times = [first] if again is None else first + again * np.arange(2)
    assert solution.event_times()[: len(times)] == pytest.approx(times, abs=1e-9)
    assert solution["n"][-1] == len(solution.event_times())


@PATHS
@pytest.mark.parametrize("direction", [0, -1])
@pytest.mark.parametrize("floor", [0, 3])
def test_a_reset_that_reverses_the_speed_at_its_surface_fires_once_a_bounce(floor, direction, method):
    n, e = Memory("n", 0), 0.5
    bounce = Event(x - floor, direction=direction, update={v: -e * v, n: n + 1})
    solution = solve(System({x: v, v: -1}, events=[bounce]), (0, 4), {x: floor + 1, v: 0}, method=method)
    times = math.sqrt(2) * (1 + 2 * (1 - e ** np.arange(6)))  # flights of 2 sqrt(2) e^k
    assert solution.event_times() == pytest.approx([s for s in times if s < 4], abs=1e-9)
    assert solution["n"][-1] == len(solution.events)


@PATHS
def test_an_event_whose_condition_another_one_of_its_instant_makes_true_acts_after_it(method):
    armed, n = Memory("armed", 0), Memory("n", 0)
    events = [Event(at=1, when=armed > 0, update={n: n + 1}), Event(at=1, update={armed: 1})]
    assert solve(System({x: 1}, events=events), (0, 2), {x: 0}, method=method)["n"][-1] == 1


@PATHS
def test_a_chain_of_eighty_events_at_one_instant_is_no_loop(method):
    f, n = Memory("f", 0), 80
    steps = [Event(f - i + HALF, update={f: i + 1}) for i in range(1, n)]
    solution = solve(
        System({x: 1}, events=[Event(x - 1, update={f: 1}), *steps]), (0, 2), {x: 0}, method=method
    )
    assert solution.success and solution["f"][-1] == n


@PATHS
def test_an_event_that_records_at_the_surface_of_a_reset_does_not_double_it(method):
    # A kick carries x through 1 to 1.15; put back by 0.2 once, beside an event of the same surface.
    n, seen = Memory("n", 0), Memory("seen", 0)
    events = [
        Event(x - 1, update={x: x - sp.Rational(1, 5), n: n + 1}),
        Event(x - 1, update={seen: seen + 1}),
        Event(at=1, update={x: x + sp.Rational(1, 4)}),
    ]
    solution = solve(System({x: sp.Rational(1, 10)}, events=events), (0, 1.5), {x: 0.8}, method=method)
    assert (solution["n"][-1], solution["seen"][-1]) == (1, 1)
    assert solution["x"][-1] == pytest.approx(0.8 + 0.15 + 0.25 - 0.2, abs=1e-9)


# ---- switches after the events


@pytest.mark.parametrize(("own", "pull"), [(0.1, 1), (1, 0.25)])
def test_a_corner_whose_outcome_changes_with_the_ratio_of_the_layers_is_recorded(own, pull):
    # x and y fall to 0 together at t = 1. Where its own multiplier does not hold each of them, the one that is through
    # its layer first pushes the other one back, and the ratio of the layers decides.
    l1, l2 = Switch("l1", x), Switch("l2", y)
    system = System({x: 0.1 - own * l1 - pull * l2, y: 0.2 - own * l2 - pull * l1})
    solution = solve(system, (0, 2), {x: own + pull - 0.1, y: own + pull - 0.2})
    assert [a.kind for a in solution.ambiguities] == (["corner"] if pull > own else [])
    assert solution.event_times() == pytest.approx([1] * len(solution.events))


def test_a_surface_that_jumps_with_the_switch_inside_it_lets_go_of_its_slide():
    # y slides on sign(x)/2 = 1/2 until x crosses at t = 1; then its surface is y = -1/2, to which it falls at 1/4.
    system = System({x: -1, y: -sp.sign(y - sp.sign(x) / 2) / 4})
    solution = solve(system, (0, 6), {x: 1, y: 0.4})
    assert [(e.kind, e.time) for e in solution.events] == [
        ("stick", pytest.approx(0.4)), ("crossing", pytest.approx(1)),
        ("slip by reset", pytest.approx(1)), ("stick", pytest.approx(5)),
    ]  # fmt: skip
    assert solution["y"][-1] == pytest.approx(-0.5, abs=1e-12)


@pytest.mark.parametrize("late", [1e4, 1e6])
def test_a_fast_motion_does_not_leap_to_a_surface_that_it_never_meets(late):
    """It falls to 1/2, at a rate at which its tangent meets 2/5 within 1e-11 of the time."""
    fall = 1e13 / late  # the time has a thousand numbers in one of its own
    system = System({y: fall * (HALF - y)}, events=[Event(y - sp.Rational(2, 5), terminal=True)])
    solution = solve(system, (late, late + 5 / fall), [1.0])
    assert solution.success and not solution.events
    assert solution["y"][-1] == pytest.approx(0.5 + 0.5 * math.exp(-5), rel=1e-2)
