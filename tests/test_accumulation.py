"""Accumulation of switchings: passed at its limit, also where the intervals shrink slowly.

    x' = -a sgn y - sgn x,   y' = a sgn x - sgn y

turns around the corner x = y = 0. On an axis at height r it needs r/(a + 1) to the next one, which it meets at
r (a - 1)/(a + 1): intervals and heights shrink by q = (a - 1)/(a + 1), and the corner is reached after r/2.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, Outcome, System, solve

x, y, z, a = sp.symbols("x y z a", real=True)
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
def test_resets_that_accumulate_without_one_ratio_end_at_their_limit(method):
    # x is put to -1/2 and meets -y/2 again after (1 - y)/(1 + 2 rate): infinitely many resets before y = 1.
    flip, half = Memory("flip", 1), sp.Rational(1, 2)
    system = System({x: 1 + flip / 4, y: 1}, events=[Event(x + y / 2, update={x: -half, flip: -flip})])
    solution = solve(system, (0, 3), {x: -1, y: 0}, method=method)
    assert solution.outcome is Outcome.EVENTS_ACCUMULATE and solution.t[-1] == pytest.approx(1, abs=1e-8)
