"""Accumulation of switchings: passed at its limit, also where the intervals shrink slowly.

    x' = -a sgn y - sgn x,   y' = a sgn x - sgn y

turns around the corner x = y = 0. On an axis at height r it needs r/(a + 1) to the next one, which it meets at
r (a - 1)/(a + 1): intervals and heights shrink by q = (a - 1)/(a + 1), and the corner is reached after r/2.

Guards: kernels/instant/accumulation.py, paths/limits.py.
"""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, Outcome, System, Unilateral, solve
from pwsmooth.kernels.intervals import note_interval, time_to_last_event

x, y, z, v, a = sp.symbols("x y z v a", real=True)
n, flip = Memory("n", 0), Memory("flip", 1)
TURNS = {x: -a * sp.sign(y) - sp.sign(x), y: a * sp.sign(x) - sp.sign(y)}
SPIRAL = System(TURNS | {z: sp.Integer(1)}, parameters={a: 3.0})


def spiral(q, **options):
    return solve(SPIRAL, (0.0, 1.0), [0.0, 1.0, 0.0], parameters={a: (1 + q) / (1 - q)}, **options)


@pytest.mark.parametrize("q", [0.5, 0.9, 0.95, 0.97, 0.99, 0.995])
def test_a_spiral_comes_to_rest_in_its_corner(q):
    solution = spiral(q)
    assert solution.outcome is Outcome.FINISHED and np.all(solution.x[:2, -1] == 0.0)
    limits = [event.time for event in solution.events if event.kind == "accumulation"]
    # Estimated from intervals d of 1e-13 and more, rounded to 1e-16: left = d q/(1 - q) to left 1e-16/d/(1 - q).
    assert len(limits) == 2 and limits[0] == pytest.approx(0.5, abs=4e-16 / (1 - q) ** 2 + 1e-14)
    assert solution["z"][-1] == pytest.approx(1.0, abs=1e-13)  # z = t, also across the limit
    # Every quarter turn is an event, down to intervals of rounding.
    times = solution.event_times("crossing")
    count = int(np.log(1e-9) / np.log(q))
    assert np.max(np.abs(times[:count] - 0.5 * (1 - q ** np.arange(1, count + 1)))) < 1e-14


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize(
    ("c", "d"), [(0, 0), (Fraction(1, 10), Fraction(1, 5)), (Fraction(3, 10), Fraction(-1, 10))]
)
def test_a_spiral_of_unequal_quarters_comes_to_rest(c, d, method):
    half = Fraction(1, 2)

    def quarter(t, p, q):
        """From time t at (p, q) to the axis that is met next: the velocity is constant between the axes."""
        a, b = np.sign(p or q), np.sign(q or -p)  # each axis is left clockwise
        velocity = -half * a + b + c, -a - half * b + d
        wait = min(-z / z1 for z, z1 in zip((p, q), velocity) if z * z1 < 0)
        return t + wait, *(z + z1 * wait for z, z1 in zip((p, q), velocity))

    at = [quarter(Fraction(0), Fraction(1, 5), Fraction(1))]
    for _ in range(4):
        at.append(quarter(*at[-1]))
    shrinks = sum(map(abs, at[4][1:])) / sum(map(abs, at[0][1:]))
    limit = at[0][0] + (at[4][0] - at[0][0]) / (1 - shrinks)
    u, w = (-sp.sign(x) / 2 + sp.sign(y) + sp.Rational(c)), (-sp.sign(x) - sp.sign(y) / 2 + sp.Rational(d))
    solution = solve(System({x: u, y: w}), (0, 8), [0.2, 1], method=method)
    assert solution.outcome is Outcome.FINISHED and np.all(solution.x[:, -1] == 0.0)
    assert solution.event_times("accumulation") == pytest.approx([float(limit)] * 2, abs=1e-13)


@pytest.mark.parametrize(
    ("rates", "update", "settled"),
    [
        ({z: flip}, {flip: -flip}, False),
        ({z: 1}, {n: n + 1}, False),
        ({z: 1}, {z: z + y / 2}, True),
        ({z: 1}, {}, True),
    ],
    ids=["a latch", "a counter", "fades", "records"],
)
def test_what_events_leave_behind_at_an_accumulation_is_an_ambiguity_unless_it_fades(rates, update, settled):
    system = System(TURNS | rates, parameters={a: 3.0}, events=[Event(x, update=update)])
    solution = solve(system, (0, 1), {x: 0, y: 1, z: 0})
    assert solution.outcome is Outcome.FINISHED and len(solution.event_times("accumulation")) == 2
    found = [(e.kind, e.time) for e in solution.ambiguities]
    assert found == [] if settled else found == [("events that accumulate", pytest.approx(0.5, abs=1e-13))]


def rounding_of_limit(solution):
    """Bound of the error of a limit that geometric intervals come to, a thousandth of the time left to it.

    The last intervals, of 1e-9 and more, are known to 1e-13; at a ratio of 0.8 their limit is known ten times worse.
    """
    return 1e-3 * (solution.events[-1].time - solution.events[-2].time)


HALF = sp.Rational(1, 2)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk", "stiff"])


@METHODS
@pytest.mark.parametrize(
    ("rate", "update"),
    [
        (1 + flip / 4, {flip: -flip}),
        (1 + n / 4, {}),
        (1 + sp.Abs(x + HALF) / 10, {}),
        (1 + sp.sign(x + HALF) / 10, {}),
        (1 + sp.sign(x + HALF - (1 - y) / 8) / 10, {}),
    ],
    ids=["rates alternate", "rates grow", "put on a kink", "put on a switch", "through a switch"],
)
def test_resets_that_accumulate_end_at_their_limit(rate, update, method):
    # x is put to -1/2 and meets -y/2 again after (1 - y)/(1 + 2 rate): infinitely many resets before y = 1. A switch
    # that they only put back does not accumulate by itself.
    if method == "stiff" and rate.has(sp.sign):
        pytest.skip("may slide")
    system = System({x: rate, y: 1}, events=[Event(x + y / 2, update={x: -HALF, n: n + 1} | update)])
    solution = solve(system, (0, 3), {x: -1, y: 0}, method=method)
    # A ratio that drifts towards 1 has no geometric limit.
    bound = 1e-8 if rate.has(n) else rounding_of_limit(solution)
    assert solution.outcome is Outcome.EVENTS_ACCUMULATE and solution.t[-1] == pytest.approx(1, abs=bound)
    assert solution.events[-1].kind == "accumulation" and solution.events[-1].time == solution.t[-1]


@METHODS
@pytest.mark.parametrize("floor", [0, 3, -3000])
@pytest.mark.parametrize("drag", [0, sp.Rational(1, 4)])
@pytest.mark.parametrize("alternate", [False, True])
def test_a_ball_that_an_event_bounces_ends_at_the_limit_of_its_bounces(floor, drag, alternate, method):
    # Flights of 2 sqrt(2) e, 2 sqrt(2) e^2, ... without drag; e is 4/5, or 5/6 and 3/6 in turn.
    e = (4 + flip) / 6 if alternate else sp.Rational(4, 5)
    system = System(
        {x: y, y: -1 - drag * y * sp.Abs(y)}, events=[Event(x - floor, update={y: -e * y, flip: -flip})]
    )
    solution = solve(system, (0, 40), {x: floor + 1, y: 0}, method=method)
    assert solution.outcome is Outcome.EVENTS_ACCUMULATE
    if drag == 0:
        flights = 5 / 6 * (1 + 1 / 2) / (1 - 5 / 12) if alternate else 4
        # Where a bounce disappears in the roundings of its surface, the stiff loop knows its length to their root.
        bound = 1e-6 if floor != 0 and method == "stiff" else rounding_of_limit(solution)
        assert solution.t[-1] == pytest.approx(np.sqrt(2) * (1 + 2 * flights), abs=bound)


@METHODS
def test_each_of_two_balls_has_its_own_rhythm(method):
    # The second one's bounces end at t = 14/3, the first one's at 4 sqrt(2).
    balls = System(
        {x: y, y: -1, z: v, v: -1},
        events=[Event(x, update={y: -3 * y / 5}), Event(z, update={v: -2 * v / 5})],
    )
    solution = solve(balls, (0, 40), {x: 1, y: 0, z: 2, v: 0}, method=method)
    assert solution.outcome is Outcome.EVENTS_ACCUMULATE and solution.events[-1].switch == "event 2"
    assert solution.t[-1] == pytest.approx(14 / 3, abs=1e-7)


def test_events_accumulate_after_a_switch_has():
    ball = System(TURNS | {z: v, v: -1}, parameters={a: 3.0}, events=[Event(z - 1, update={v: -v / 2})])
    solution = solve(ball, (0, 9), {x: 0, y: 1, z: 2, v: 0})
    assert len(solution.event_times("accumulation")) == 3
    assert solution.outcome is Outcome.EVENTS_ACCUMULATE
    assert solution.t[-1] == pytest.approx(3 * np.sqrt(2), abs=1e-8)


@pytest.mark.parametrize(
    ("intervals", "left"),
    [
        ([8e-6, 4e-6, 2e-6], 2e-6),
        ([8e-6, 6e-6, 2e-6, 1.5e-6, 5e-7], 2e-6 / 3),
        # Two looks at one instant after two that are seconds apart, as of an element that slips, sticks and slips.
        ([10.0, 5.0, 5.7e-8, 2.8e-8], np.inf),
        ([2.5, 10.0, 5.0, 5.7e-8, 2.8e-8], np.inf),
        ([1e-6, 1e-8, 5e-9, 4.9e-9, 1e-9], np.inf),
    ],
    ids=["one ratio", "ratios in turn", "none, the last ones short", "none, the last two short", "none"],
)
def test_only_intervals_that_shrink_in_one_rhythm_have_a_limit(intervals, left):
    last = np.zeros(7)
    for at in np.cumsum(intervals):
        note_interval(last, at)
    assert time_to_last_event(last, True, 1.0) == pytest.approx(left, rel=1e-6)


def test_resets_whose_ratio_is_small_and_drifts_have_a_limit():
    # As of rates that each reset raises a bit: the fourth interval is the last that can be told from none.
    last = np.zeros(7)
    *earlier, latest = np.cumsum([1.2, 1.8e-1, 4.8e-5, 1.15e-8, 2.53e-12])
    for at in earlier:
        note_interval(last, at)
    assert time_to_last_event(last, True, 1.0) == np.inf
    note_interval(last, latest)
    assert 0 < time_to_last_event(last, False, 1.0) < 1e-14


@pytest.mark.parametrize("settled", [True, False])
def test_events_that_impacts_carry_the_motion_through_accumulate_with_them(settled):
    # u jumps up through 0 at each of the impacts, which end at t = 3: what z is beyond, its events do not say.
    q, u = sp.symbols("q u", real=True)
    count = Event(u, direction=1, update={z: z / 2 if settled else 1 - z})
    ball = System({q: u, u: -2 + Unilateral(q, restitution=0.5, name="R").reaction, z: 0}, events=[count])
    found = [a.kind for a in solve(ball, (0, 4), {q: 1, u: 0, z: 1}).ambiguities]
    assert found == ([] if settled else ["events that accumulate"])


@pytest.mark.parametrize("method", ["taylor", "rk"])
def test_a_condition_that_jumps_with_what_accumulates_moves_nothing(method):
    # Mod < c holds always; as it steps at each bounce, its surface jumps between 3/4 and nearly 0, with no limit at 0.
    q, u, w, x, c = sp.symbols("q u w x c", real=True)
    floor = Unilateral(q, restitution=0.5)
    tooth = sp.Mod(u + q / 2 + sp.Piecewise((1, w < -6), (0, True)) + sp.Rational(3, 4), c)
    rates = {
        q: u,
        u: floor.reaction - 1,
        w: -floor.reaction * sp.sign(w) / 4,
        x: sp.Piecewise((1, tooth < c), (0, True)),
    }
    system = System(rates, parameters={c: 0.75})
    for height in (0.1, 0.2, 0.31, 0.4):
        run = solve(system, (0, 3), {q: height, u: 0, w: -5, x: 0}, method=method)
        # The floor's impulse is the weight's, 3, and a quarter of it acts on w.
        assert run.success and [run["w"][-1], run["x"][-1]] == pytest.approx([3 / 4 - 5, 3], abs=1e-8)
