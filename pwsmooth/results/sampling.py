"""A solution as points to draw: even places of each step's own variable, a matrix product for all steps.

    x(s_ik) = sum_j c_ij l_i^j u_k^j,    u_k = k/(q-1),   k = 0, ..., q-1,   step i of length l_i

Nothing is searched, and beside a fold, where s is the arc of a multiplier, time is such a sum too, so that no root is
looked for either. A curve is drawn through these points; `Solution.__call__` gives values at times that are given.

Chain: records.py (polynomials of steps) -> **sampling** -> Solution.sample -> plotting, films, pages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..door import checks
from ..door.describe import Described, Rows
from .records import EventLog

_PASSES = 8  # of thinning, each of which leaves half of the points at best
_WORTH = 0.05  # part of the points that a pass has to take away for another one


@dataclass(frozen=True, repr=False)
class Sampled(Described):
    """Points of a solution for drawing, in the order of time, with both sides of every event.

    Indexing gives the values of one name, "t" the times.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times, in the unit of the model's, not decreasing.
    values : ndarray, shape (m, k)
        In the units of the names.
    names : tuple of str, length k
        Of states, multipliers and outputs.
    status : ndarray of int8, shape (m,)
        Of the first switch or contact that changes (of the first one, where none does): 1 and -1 on its sides, 0 where
        it is solved; 1 where there is none. Dimensionless; `plotting.by_phase` takes it.
    step : ndarray of int, shape (m,)
        Number of the step on which a point lies, dimensionless.
    statuses : ndarray of int8, shape (m, multipliers)
        Of all of them, as in `Solution.status`; dimensionless.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)})
    >>> drawn = solve(block, (0, 10), {x: 3.5, v: 0}, dense_output=True).sample(500)
    >>> drawn.names, f"{drawn['x'].min():.6f}"
    (('x', 'v', 'sgn(v)'), '-1.500000')
    """

    t: np.ndarray
    values: np.ndarray
    names: tuple[str, ...]
    status: np.ndarray
    step: np.ndarray
    statuses: np.ndarray

    def __contains__(self, name: Any) -> bool:
        """Whether indexing takes a name (or Symbol)."""
        return str(checks.named(name)) in ("t", *self.names)

    def __getitem__(self, name: Any) -> np.ndarray:
        """Values of one name, shape (m,)."""
        if str(name) in self.names:
            return self.values[:, self.names.index(str(name))]
        if str(name) == "t":
            return self.t
        raise KeyError(f"{str(name)!r} was not sampled; there are t, {', '.join(self.names)}.")

    def __len__(self) -> int:
        return len(self.t)

    def _described(self) -> tuple[str, Rows]:
        steps = len(np.unique(self.step))
        return f"{len(self)} points of {', '.join(self.names)}", {
            "time": [f"{self.t[0]:.9g} to {self.t[-1]:.9g}, {steps} steps"]
        }.items()


def sampled(
    solution: Any, points: int, names: Sequence[str], chord: float | None, scale: Mapping[str, float]
) -> Sampled:
    """Of a solution with dense output, with checked arguments."""
    plain = (*solution.states, *solution.multipliers)
    computed = [name in solution.outputs and name not in solution.states for name in names]
    # Of a large system few rows are drawn; an output may need them all.
    wanted = range(len(plain)) if any(computed) else [plain.index(name) for name in names]
    times, course = solution.course or (solution.t, solution.status)
    step, t, rows = solution.dense._placed(points, times[-1], wanted)
    status = course[:, np.searchsorted(times, t[:, 0], side="right") - 1]
    starts = np.append(t[1:, 0], times[-1])[: len(t)]  # of the next steps, which t(s) may miss by a rounding
    t = np.minimum(t, starts[:, None])

    # A step ends where the next one begins, but for events.
    fixed, kept = np.zeros(t.shape, bool), np.ones(t.shape, bool)
    fixed[:1, 0] = True
    fixed[:, -1] = kept[:, -1] = held = _events_at_ends(solution, t, status)
    fixed[1:, 0] = held[:-1]
    both = np.concatenate([solution.x, solution.mult])
    added: list[tuple[int, int]] = []  # places between the points, and columns there
    if not solution.course:
        # The run has kept the limits there: the direction of a disc that comes to rest is 0/0 of the polynomials.
        column = np.minimum(np.searchsorted(solution.t, starts), len(solution.t) - 1)
        found, gap = held & (solution.t[column] == starts), starts - t[:, -1] > _near(starts)
        at = np.flatnonzero(found & ~gap)
        t[at, -1], rows[:, at, -1] = starts[at], both[np.ix_(wanted, column[at])]
        # What is passed, as the end of an accumulation is, has no step.
        passed = np.flatnonzero(found & gap & (column < len(solution.t) - 1))
        added = list(zip(np.cumsum(kept.sum(axis=1))[passed].tolist(), column[passed].tolist()))
    which = np.repeat(np.arange(len(t)), t.shape[1]).reshape(t.shape)[kept]
    t, fixed, rows = np.maximum.accumulate(t[kept]), fixed[kept], rows[:, kept]
    step, statuses = step[which], status[:, which]

    last = solution.t[-1]
    if solution.course:  # of a run that was asked for times, from the first to the last of them
        some = (solution.t[0] < t) & (t < last)
        t, fixed, rows, step, statuses = t[some], fixed[some], rows[:, some], step[some], statuses[:, some]
        added = [(0, 0), (len(t), -1)]
    elif not len(t) or t[-1] < last or solution.t[-2] == last:  # the last event acts where no step begins
        added.append((len(t), -1))
    if added:
        places, columns = np.array(added).T
        step = np.insert(step, places, step[np.maximum(places - 1, 0)] if len(step) else 0)
        t, fixed = np.insert(t, places, solution.t[columns]), np.insert(fixed, places, True)
        rows = np.insert(rows, places, both[np.ix_(wanted, columns)], axis=1)
        statuses = np.insert(statuses, places, solution.status[:, columns], axis=1)
    if any(computed):
        x, mult = np.split(rows, [len(solution.states)])
        rows = np.array([solution._lookup(name, t, x, mult) for name in names])
    if chord is not None and len(t) > 2:
        curve = np.vstack([t, rows])
        size = [scale.get(name) or np.ptp(row) or 1.0 for name, row in zip(("t", *names), curve)]
        some = _thinned(curve / np.array(size)[:, None], fixed, chord)
        t, rows, step, statuses = t[some], rows[:, some], step[some], statuses[:, some]
    return Sampled(t, rows.T, tuple(names), _telling(solution, statuses), step, statuses.T)


def _events_at_ends(solution: Any, t: np.ndarray, status: np.ndarray) -> np.ndarray:
    """Of each step whether an event happens where it ends, or the run; times (steps, places), statuses (m, steps)."""
    log = solution.events
    when = log.times if isinstance(log, EventLog) else np.array([event.time for event in log])
    ends, starts = t[:-1, -1], t[1:, 0]
    gap = starts - ends > _near(starts)
    held = gap | (status[:, 1:] != status[:, :-1]).any(axis=0) | np.isin(starts, when) | np.isin(ends, when)
    return np.append(held, True)[: len(t)]


def _near(t: np.ndarray) -> np.ndarray:
    """What a sum of polynomials in time may miss of it."""
    return 8 * np.spacing(np.abs(t))


def _telling(solution: Any, statuses: np.ndarray) -> np.ndarray:
    """Status of the first multiplier that changes, of those that have sides."""
    sided = statuses[
        [j for j, mu in enumerate(solution.model.multipliers) if mu.kind not in ("algebraic", "component")]
    ]
    changing = sided[(sided != sided[:, :1]).any(axis=1)] if sided.shape[1] else sided
    first = changing if len(changing) else sided
    return np.sign(first[0]) if len(first) else np.ones(statuses.shape[1], np.int8)


def _thinned(curve: np.ndarray, fixed: np.ndarray, chord: float) -> np.ndarray:
    """Indices of points of a curve (dimensions, m) that stays within `chord` of the chords between them.

    Every other point goes if all that it leaves between its neighbours are near their chord, and so on with the rest.
    """
    kept, fixed, points = np.arange(curve.shape[1]), fixed.copy(), np.ascontiguousarray(curve.T)
    for _ in range(_PASSES):
        middle = 1 + 2 * np.arange((len(kept) - 1) // 2)
        middle = middle[~fixed[kept[middle]]]
        if not len(middle):
            break
        first, last = kept[middle - 1], kept[middle + 1]
        between = last - first - 1
        of = np.repeat(np.arange(len(middle)), between)
        begins = np.cumsum(between) - between
        at, along = points[first], points[last] - points[first]
        off = points[(first + 1 - begins)[of] + np.arange(len(of))] - at[of]
        square = np.maximum(np.einsum("ij,ij->i", along, along), np.finfo(float).tiny)[of]
        across = np.einsum("ij,ij->i", off, along[of])
        place = np.clip(across / square, 0, 1)
        apart = np.einsum("ij,ij->i", off, off) + place * (place * square - 2 * across)
        near = np.maximum.reduceat(apart, begins) <= chord**2
        fixed[kept[middle[~near]]] = True  # a longer chord would hardly do
        before, kept = len(kept), np.delete(kept, middle[near])
        if before - len(kept) < _WORTH * before:
            break
    return kept
