"""Units of the states along a return: what is small there is small against these, in metres and in micrometres.

A state's unit is about how far a return moves it, as a power of 1024: near to 1 it is 1, and a product with it is
exact. The absolute tolerance of a state whose rate vanishes with it (a population) is small against its smallest
value.

Source: none; scaling of unknowns is common practice (J. Dennis, R. Schnabel, Numerical Methods for Unconstrained
Optimization and Nonlinear Equations, 1983, section 7.1).

Chain: **scales** -> poincare.py, orbits/fixed_points.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ...definition.model import Model
from ...results.solution import Solution

_COUPLED = 1e-3  # of what other states do to it: a state that moves less still has a unit of that size
_NOISE = 1e-14  # of the largest state of a guess: what is smaller says nothing of its unit
_STILL = 1e-9  # of the state itself: what moves less may move by roundings alone
_FEW = 8  # columns: with fewer, a run is looked at between them too
_BELOW = 2.0**-10  # of its smallest value: the unit of a population's tolerance, for the orbits of a branch too

_looked_at: WeakKeyDictionary[Solution, tuple[np.ndarray, np.ndarray]] = WeakKeyDictionary()


class Scale(NamedTuple):
    """Units of the states, and those of their absolute tolerances, each (n,)."""

    unit: tuple[float, ...]
    tolerance: tuple[float, ...]


def extents(runs: Sequence[Solution]) -> np.ndarray:
    """How far apart the largest and the smallest value of each state are along runs, shape (n,)."""
    low, high = _bounds(runs)
    return high - low


def fastest(runs: Sequence[Solution]) -> np.ndarray:
    """How far each state would go at its fastest in the time of all runs, shape (n,)."""
    rates, time = np.zeros(len(runs[0].x)), 0.0
    for run in runs:
        steps = np.diff(run.t)
        moving = steps > 0
        rates = np.maximum(rates, np.abs(np.diff(run.x)[:, moving] / steps[moving]).max(axis=1, initial=0.0))
        time += float(run.t[-1] - run.t[0])
    return rates * time


def _bounds(runs: Sequence[Solution]) -> tuple[np.ndarray, np.ndarray]:
    low, high = zip(*map(_bounds_of, runs))
    return np.min(low, axis=0), np.max(high, axis=0)


def _bounds_of(run: Solution) -> tuple[np.ndarray, np.ndarray]:
    """The smallest and the largest value of each state along a run, looked at once."""
    if run not in _looked_at:
        values = run.x
        if run.dense is not None and len(run.t) < _FEW and run.t[-1] > run.t[0]:
            between = run.dense(np.linspace(run.t[0], run.t[-1], 2 * _FEW + 1)[1:-1])[0]
            values = np.hstack([values, between])
        _looked_at[run] = values.min(axis=1), values.max(axis=1)
    return _looked_at[run]


def scale_at(x: np.ndarray) -> Scale | None:
    """Units of the states at a first guess; None where all of them are 1."""
    size = np.abs(x)
    if not size.any() or not np.isfinite(size).all():
        return None
    known = size > _NOISE * size.max()
    size = np.where(known, size, size[known].min())
    unit = tuple(map(unit_of, size.tolist()))
    return Scale(unit, unit) if set(unit) != {1.0} else None


def scale_along(
    runs: Sequence[Solution], jacobian: np.ndarray, known: Scale | None = None, before: np.ndarray | None = None
) -> Scale | None:
    """Units of the states along a return with this derivative; None where all of them are 1.

    `known` are those so far, which a rest keeps; `before` is how far each state moved on the way here: what has
    died down does not lose its unit.
    """
    low, high = _bounds(runs)
    size, largest = high - low, np.maximum(np.abs(low), np.abs(high))
    moves = size > _STILL * largest
    size = np.where(moves, size, largest)
    if before is not None and np.isfinite(before).all() and (before > 0).all():
        left = float((size / before).max())
        if left < _STILL:
            return known
        size = np.where(size < _STILL * left * before, left * before, size)  # as large as the others still are
    if np.isfinite(jacobian).all() and jacobian.shape == (len(size),) * 2:
        acts = np.abs(jacobian - np.diag(np.diag(jacobian)))
        size = np.maximum(size, _COUPLED * (acts * size).max(axis=1, initial=0.0))
        with np.errstate(divide="ignore", invalid="ignore"):  # as large as what others feel of it by roundings
            felt = np.where((acts > 0) & (size > 0)[:, None], size[:, None] / acts, np.inf).min(axis=0)
        # A state that moves has its size; what others feel of it may be a rounding of 0.
        size = np.where(np.isfinite(felt) & (size > 0) & ~moves, np.maximum(size, _STILL * felt), size)
    if not np.isfinite(size).all() or not size.any():
        return known
    size[size == 0] = size[size > 0].min()
    return _of_populations(runs, tuple(unit_of(one) for one in size.tolist()))


def scale_of_populations(runs: Sequence[Solution], known: Scale | None) -> Scale | None:
    """The same units, and tolerances that suit how small populations become along runs."""
    return _of_populations(runs, (1.0,) * len(runs[0].x) if known is None else known.unit)


def _of_populations(runs: Sequence[Solution], unit: tuple[float, ...]) -> Scale | None:
    tolerance = list(unit)
    for i, least in lowest(runs).items():
        if least < unit[i] / 32:
            tolerance[i] = unit_of(least) * _BELOW
    scale = Scale(unit, tuple(tolerance))
    return None if set(scale.unit + scale.tolerance) == {1.0} else scale


def lowest(runs: Sequence[Solution]) -> dict[int, float]:
    """The least size along runs of each state whose rate vanishes with it, by its place."""
    if not (kept := _relative(runs[0].model)):
        return {}
    low, high = _bounds(runs)
    kept = tuple(i for i in kept if low[i] * high[i] > 0)
    return {i: float(min(abs(low[i]), abs(high[i]))) for i in kept}


def units_at(x: np.ndarray) -> np.ndarray:
    """Units of the states at a point, shape (n,)."""
    scale = scale_at(x)
    return np.ones(len(x)) if scale is None else np.array(scale.unit)


def units_of_motion(moves: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Units of states at x that move so far along a return: of the larger of both, shape (n,)."""
    size = np.maximum(moves, np.abs(x))
    size[size <= _NOISE * np.max(size, initial=0.0)] = 0.0
    size[size == 0] = size[size > 0].min() if size.any() else 1.0
    return np.array([unit_of(one) for one in size.tolist()])


def unit_of(size: float) -> float:
    """The power of 1024 next to a size, 1 for 0."""
    return 1024.0 ** round(math.log2(size) / 10) if size > 0 else 1.0


@functools.lru_cache(maxsize=64)
def _relative(model: Model) -> tuple[int, ...]:
    """States whose rate vanishes with them, so that they keep their sign: populations, infections, concentrations."""
    if model.families is not None:
        return ()
    pairs = zip(model.states, model.rhs)
    return tuple(i for i, (x, rate) in enumerate(pairs) if rate != 0 and rate.has(x) and rate.subs(x, 0) == 0)
