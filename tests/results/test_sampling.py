"""Points to draw: they lie on the solution, with both sides of every event, through arcs, accumulations and discs.

Guards: results/sampling.py.
"""

import functools

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import hidden, t, v, y, z

from pwsmooth import Event, Solution, System, Unilateral, solve
from pwsmooth.results.records import Dense, EventRecord, Outcome

START = {y: 0.5, v: 0.3, z: 0}
AGREES = 1e-12  # sums of some twenty terms of size one, in another order
x, u, w = sp.symbols("x u w", real=True)


def ball():
    return System({y: v, v: -1 + Unilateral(y, restitution=0.5, name="R").reaction})


def plate():
    """A body on a plate that rubs in all directions: its disc slips, and comes to rest at an angle."""
    size = sp.sqrt(u**2 + w**2)
    return System({x: u, u: sp.cos(t) / 2 - u / size, y: w, w: -w / size}, time=t)


@functools.cache
def run(name):
    slaved = {y: 0.5, v: 0.3}
    return {
        "series": lambda: solve(hidden(), (0, 30), START, dense_output=True),
        "pair": lambda: solve(hidden(), (0, 30), START, dense_output=True, method="rk"),
        "folds": lambda: solve(hidden().layered({z: sp.oo}), (0, 30), slaved, dense_output=True),
        "wanted times": lambda: solve(hidden(), (0, 30), START, dense_output=True, t_eval=[1.0, 2.0, 20.0]),
        "smoothed": lambda: solve(hidden().smoothed(1e-2), (0, 10), START, dense_output=True),
        "SciPy": lambda: solve(
            hidden().smoothed(0.1), (0, 5), START, dense_output=True, method="Radau", rtol=1e-6
        ),
        "accumulation": lambda: solve(ball(), (0, 5), {y: 0.5, v: 0}, dense_output=True),
        "disc": lambda: solve(plate(), (0, 8), {x: 0, u: 1.0, y: 0, w: 0.5}, dense_output=True),
    }[name]()


RUNS = ["series", "pair", "folds", "wanted times", "smoothed", "SciPy", "accumulation", "disc"]


def before_events(solution):
    """Times and columns (states, then multipliers) just before the events of a run."""
    column = np.flatnonzero(solution.t[1:] == solution.t[:-1])
    column = column[~np.isin(column - 1, column)]
    return solution.t[column], np.concatenate([solution.x, solution.mult])[:, column]


@pytest.mark.parametrize("name", RUNS)
def test_points_lie_on_the_solution(name):
    solution = run(name)
    names = [*solution.states, *(m for m in solution.multipliers if m not in solution.outputs)]
    drawn = solution.sample(2000, names)
    assert np.all(np.diff(drawn.t) >= 0) and drawn.t[0] >= solution.t[0] and drawn.t[-1] == solution.t[-1]
    exact = np.array([solution(drawn.t, n) for n in names]).T
    off = np.abs(drawn.values - exact) / (1 + np.abs(exact))
    # At an event solution(t) has the side after it. On an arc lambda(t) has a slope that a rounding of t multiplies.
    side = np.append(drawn.t[1:] == drawn.t[:-1], False)
    time = getattr(solution.dense, "time_coefficients", None)
    arc = np.zeros(len(drawn), bool) if time is None else (time[:, 2:] != 0).any(axis=1)[drawn.step]
    slope = np.abs(
        np.gradient(drawn.values, np.maximum.accumulate(drawn.t + 1e-13 * np.arange(len(drawn))), axis=0)
    )
    allowed = AGREES + arc[:, None] * 16 * np.spacing(drawn.t[-1]) * slope
    near_end = arc & np.append(np.diff(drawn.step) != 0, True)  # of an arc the slope at its end is infinite
    assert (off <= allowed)[~side & ~near_end].all() and (~side & ~near_end).sum() > 0.8 * len(drawn)
    assert (name == "folds") == arc.any() or name == "disc"


@pytest.mark.parametrize("name", ["series", "pair", "folds", "accumulation", "disc"])
def test_both_sides_of_every_event_are_kept_in_the_last_bit_before_it(name):
    solution = run(name)
    names = [n for n in (*solution.states, *solution.multipliers) if n not in solution.outputs]
    rows = [[*solution.states, *solution.multipliers].index(n) for n in names]
    drawn, thin = solution.sample(300, names), solution.sample(300, names, chord=1e-2)
    when, before = before_events(solution)
    moved = np.append(np.diff(when) > 0, True) & (when > solution.t[0])
    assert moved.sum() >= 1
    for points in (drawn, thin):
        last = np.searchsorted(points.t, when[moved], side="right") - 1
        assert np.array_equal(points.t[last - 1], when[moved]) and np.array_equal(points.t[last], when[moved])
        assert np.array_equal(points.values[last - 1].T, before[rows][:, moved])
        after = np.array([solution(when[moved], n) for n in names])
        np.testing.assert_allclose(points.values[last].T, after, rtol=AGREES, atol=AGREES)


def test_a_point_has_the_status_of_its_segment():
    solution = run("series")
    drawn = solution.sample(2000)
    for segment in solution.segments:
        inside = (drawn.t > segment.start) & (drawn.t < segment.end)
        assert inside.sum() > 1 and np.all(drawn.status[inside] == segment.status[0])
    assert np.array_equal(drawn.statuses[:, 0], drawn.status)


@pytest.mark.parametrize("chord", [1e-2, 1e-4])
def test_a_thinned_curve_stays_within_the_chord_of_all_that_was_dropped(chord):
    solution, scale = run("folds"), {"t": 3.0, "lam": 0.5}
    names = ["y", "v", "lam"]
    drawn, thin = solution.sample(names=names), solution.sample(names=names, chord=chord, scale=scale)
    full = np.vstack([drawn.t, drawn.values.T])
    size = np.array([3.0, np.ptp(full[1]), np.ptp(full[2]), 0.5])
    full = full / size[:, None]
    left = {p.tobytes() for p in thin.values}
    kept = np.flatnonzero([p.tobytes() in left for p in drawn.values])
    worst = 0.0
    for i, j in zip(kept, kept[1:]):
        along = full[:, j] - full[:, i]
        off = full[:, i : j + 1] - full[:, i, None]
        place = np.clip(along @ off / max(along @ along, 1e-300), 0, 1)
        worst = max(worst, np.linalg.norm(off - place * along[:, None], axis=0).max())
    assert worst <= chord * (1 + 1e-6) and worst > chord / 10
    assert len(thin) < len(drawn) / 2


def test_outputs_are_sampled_too_and_other_names_are_refused():
    solution = run("series")
    drawn, plain = solution.sample(500, ["mu", y]), solution.sample(500)
    np.testing.assert_allclose(drawn["mu"], plain["lam"] * (1 + 3 * plain["z"]), rtol=1e-12)
    assert drawn.names == ("mu", "y") and drawn.values.shape == (len(drawn), 2)
    with pytest.raises(KeyError, match="'v' was not sampled"):
        drawn["v"]
    with pytest.raises(ValueError, match="`names` has 'q', which is no state"):
        solution.sample(names=["q"])
    with pytest.raises(ValueError, match="`points` is 1; give an integer >= 2"):
        solution.sample(1)
    with pytest.raises(ValueError, match="`scale` of y is 0"):
        solution.sample(chord=1, scale={"y": 0})
    with pytest.raises(ValueError, match="dense_output=True"):
        solve(hidden(), (0, 1), START).sample()


def test_a_run_that_stops_where_it_began_is_one_point():
    stopped = solve(System({x: 1 / x}), (0, 1), {x: 0}, dense_output=True)
    assert not stopped.success and len(stopped.sample()) == 1


def test_the_limit_of_events_that_accumulate_is_the_last_point():
    # x -> x/2 each time that x' = -1 has brought it to half of what it was: at t = 2 x is 0.
    halves = System({x: -1, u: 0}, events=[Event(x - u / 2, direction=-1, update={u: u / 2})])
    run_out = solve(halves, (0, 3), {x: 2.0, u: 2.0}, dense_output=True)
    drawn = run_out.sample(200)
    assert drawn.t[-1] == run_out.t[-1] and np.array_equal(drawn.values[-1], run_out.x[:, -1])


def test_what_no_step_covers_is_joined_to_its_limit():
    # The last moments of a slip in a disc, or of an accumulation, may have no polynomial: here those from 0.9 to 1.
    pieces = Dense(
        np.array([0.0, 1.0]),
        np.array([0.9, 2.0]),
        np.array([[[2.0, -1.0]], [[5.0, -1.0]]]),
        np.zeros((2, 0, 2)),
    )
    t, values = [0, 1, 1, 2], np.array([[2.0, 1.0, 5.0, 4.0]])
    jump = Solution(
        System({x: -1}), t, values, np.zeros((0, 4)), np.zeros((0, 4)), [EventRecord(1.0, "event 1", "reset")],
        pieces, Outcome.FINISHED, {}, {}, [], {},
    )  # fmt: skip
    drawn = jump.sample(6)
    assert drawn.t.tolist() == [0, 0.45, 0.9, 1, 1, 1.5, 2]
    np.testing.assert_allclose(drawn["x"], [2, 1.55, 1.1, 1, 5, 4.5, 4], rtol=1e-15)
