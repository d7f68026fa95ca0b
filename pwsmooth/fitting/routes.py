"""The least misfit by several routes, and when it may be called one.

    1  intervals with gaps, or one run, from the first guess            (gauss_newton.py)
    2  one run from the first guess
    3  the beginning of the records first, then more and more of them, each part from the values of the part before

Events move with the parameters. Far from the beginning a small error of the parameters has shifted them by more than
one period, so that the misfit of a whole record has many minima; that of its beginning has one. A sample that lies
between an event and its image jumps, and no slope knows of that: route 3 lets such samples count less (Cauchy's
weights), and then, as another route, not.

They run until two lead to the least misfit and leave noise alone. It is a success if it leaves noise, or if two lead to
it and the records see all fitted quantities there; and if no point one standard error beside it is better.

Source: Box and Pierce, J. Am. Stat. Assoc. 65 (1970) 1509, for the residuals; Huber and Ronchetti, Robust Statistics,
2009, for the weights.
Chain: shooting.py, gauss_newton.py -> **routes** -> fitting.py.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import numpy as np

from .gauss_newton import ALL, CLOSED, INTERRUPTED, LEAST, STUCK, Iteration, Minimum, minimise
from .identifiability import covariance
from .shooting import Evaluation, RunFailed, Shooting

_FEW = 60  # runs: a bound so low is the first route's alone; of a higher one it gets half
_GROWTH = 1.3  # of the part of the records, from step to step
_SAMPLES_A_QUANTITY = 2  # in the first part
_RUNS_OF_A_PART = 8, 20  # the first ones only where weights bear jumps, which are then taken anew
_OUTLIER = 3.0  # medians of |residual|: where a sample's weight is halved
_ROUNDING = 1e-9  # of a column's size: smaller residuals count alike
_EXACT = 1e-6  # of a column's size: what is left of data without noise
_DEVIATIONS = 5.0  # of a test quantity, beyond which residuals are no noise
_LARGEST = 6.0  # rms: one noise in 5e8 is larger
_AGREE = 1e-3  # of the misfit: less lies between two routes that lead to one minimum
_BETTER = 1e-6  # of the misfit: a smaller gain beside the minimum is none
_POLISHES = 3  # at most so many searches from points beside a minimum
_APART = " What is left is no noise, and other routes end elsewhere, or quantities have no trace: give a better guess."
_CORNER = "No step lessens the misfit, which is no smooth function here; what is left is noise."
_BESIDE = " Beside it the misfit is smaller still: it is no smooth function here."
_GUESS = "No route leads below the misfit of the first guess, which is returned."


def search(
    problem: Shooting, first: np.ndarray, fixed: np.ndarray, most: int, told: Callable[[Iteration], None]
) -> Minimum:
    """The least misfit of the routes, never above that of the first guess; RunFailed if that has no run."""
    nodes = problem.nodes
    routes = [minimise(problem, first, nodes, fixed, max(most // 2, min(most, _FEW)), told)]

    def left() -> int:
        return most - sum(route.runs for route in routes)

    ways = [lambda: _grown(problem, first, fixed, left(), told, bears_jumps=False),
            lambda: _grown(problem, first, fixed, left(), told, bears_jumps=True)]  # fmt: skip
    if any(map(len, nodes)):
        ways.insert(1, lambda: minimise(problem, first, nodes, fixed, left(), told, ALL))
    guess = _joined(problem, first)

    def confirmed() -> bool:
        """Whether two routes lead to the best minimum, no worse than the first guess."""
        best = min(routes, key=_rank)
        alike = [route for route in routes if _ended(route) and _same(problem, route, best)]
        return len(alike) > 1 and _rank(best) <= guess

    def left_is_noise() -> bool:
        return only_noise(problem, min(routes, key=_rank).at)

    for way in ways:
        exact = min(map(_rank, routes)) <= _exact(problem)
        if left() <= 0 or routes[-1].message == INTERRUPTED or exact or (confirmed() and left_is_noise()):
            break
        with contextlib.suppress(RunFailed):
            routes.append(way())
    best = min(routes, key=_rank)
    if not _ended(best) and left() > 0 and routes[-1].message != INTERRUPTED:
        routes.append(minimise(problem, best.z, best.at.nodes, fixed, left(), told, best.every))
        best = min(routes, key=_rank)
    runs, failures = (sum(getattr(route, name) for route in routes) for name in ("runs", "failures"))
    if _rank(best) > guess:
        at, exact = problem.evaluate(first, nodes, ALL), guess <= _exact(problem)
        slopes, message = problem.linearise(first, at), LEAST if exact else _GUESS
        best = Minimum(first, at, slopes, ALL, exact, message, runs, failures)
    elif _ended(best) and left_is_noise():
        best = best._replace(success=True, message=best.message if best.success else _CORNER)
    elif best.success and not (confirmed() and _determined(best, fixed)):
        best = best._replace(success=False, message=best.message + _APART)
    return _checked(problem, best._replace(runs=runs, failures=failures), fixed, most, told)


def _ended(found: Minimum) -> bool:
    return found.success or found.message == STUCK


def _determined(found: Minimum, fixed: np.ndarray) -> bool:
    """Whether the record sees every fitted quantity; where an event is lost, those that it depends on have no trace."""
    return bool(np.isfinite(covariance(found.slopes.jacobian[:, ~fixed])).all())


def _rank(found: Minimum) -> float:
    return found.at.misfit if found.at.gap <= CLOSED else math.inf


def _same(problem: Shooting, one: Minimum, other: Minimum) -> bool:
    apart = abs(one.at.misfit - other.at.misfit)
    return apart <= _AGREE * other.at.misfit or max(one.at.misfit, other.at.misfit) <= _exact(problem)


def _joined(problem: Shooting, z: np.ndarray) -> float:
    """The misfit of one run from end to end; inf where it stops."""
    try:
        return problem.misfit(z)
    except (RunFailed, ValueError):
        return math.inf


def _exact(problem: Shooting) -> float:
    """The misfit of data without noise, up to the errors of the runs."""
    squares = [
        np.sum((_EXACT * weights * e.sizes[:, None]) ** 2)
        for e, weights in zip(problem.experiments, problem.weights)
    ]
    return 0.5 * float(sum(squares))


# ---- the beginning of the records first


def _grown(
    problem: Shooting, first: np.ndarray, fixed: np.ndarray, most: int, told: Callable[[Iteration], None],
    bears_jumps: bool,
) -> Minimum:  # fmt: skip
    """The least misfit of growing parts of the records, from the first guess."""
    nodes = problem.nodes
    z, part = first, min(1.0, _SAMPLES_A_QUANTITY * len(first) / sum(len(e.t) for e in problem.experiments))
    runs, failures = 0.0, 0
    # A short record does not determine all: what it leaves free stays near the first guess.
    known = _loosely(problem, first)
    while runs < most:
        beginning = problem.until(part, known if part < 1 else ())
        for count in _RUNS_OF_A_PART if bears_jumps else _RUNS_OF_A_PART[1:]:
            if part == 1.0 and count == _RUNS_OF_A_PART[1]:
                continue
            weighted = beginning.bearing_jumps(z, _OUTLIER, _ROUNDING) if bears_jumps else beginning
            at = minimise(weighted, z, beginning.nodes, fixed, count, _silent)
            z, runs, failures = at.z, runs + part * (at.runs + bears_jumps), failures + at.failures
            if at.message == INTERRUPTED:
                there = problem.evaluate(z, nodes, ALL)
                slopes = problem.linearise(z, there)
                return Minimum(z, there, slopes, ALL, False, INTERRUPTED, math.ceil(runs), failures)
        if part == 1.0:
            break
        part = min(1.0, _GROWTH * part)
    found = minimise(problem, z, nodes, fixed, max(most - math.ceil(runs), 1), told, ALL)
    return found._replace(runs=found.runs + math.ceil(runs), failures=found.failures + failures)


def _silent(_: Iteration) -> None:
    """Misfits of parts of the records are not told: they are none of the whole."""


def _loosely(problem: Shooting, first: np.ndarray) -> list[tuple[int, float, float]]:
    """The first guess as knowledge of the weight of one sample whose residual is the size of its column."""
    weight = max(
        float((weights * e.sizes[:, None]).max()) for e, weights in zip(problem.experiments, problem.weights)
    )
    values, slopes = problem.coordinates.values(first), problem.coordinates.slopes(first)
    return [(i, float(values[i]), float(abs(slopes[i])) / weight) for i in range(len(first))]


# ---- whether it may be called a least misfit


def only_noise(problem: Shooting, at: Evaluation) -> bool:
    """Whether what is left of every column could be independent noise, of the level that the record gives."""
    return all(
        _is_noise(row[there], e.record.noise.get(name), size)
        for e, arcs in zip(problem.experiments, at.arcs)
        for name, row, there, size in zip(e.names, e.difference(arcs), e.there, e.sizes)
        if there.any()
    )


def _is_noise(r: np.ndarray, level: float | None, size: float) -> bool:
    n, rms = len(r), float(np.sqrt(np.mean(r**2)))
    if rms <= _EXACT * size:
        return True
    if level is not None and rms**2 > level**2 * (1 + _DEVIATIONS * math.sqrt(2 / n)):
        return False
    if np.abs(r).max() > _LARGEST * rms:
        return False
    lags = n // 5
    if not lags:
        return True
    found = np.correlate(r, r, "full")[n : n + lags] / float(r @ r)
    return float(n * found @ found) <= lags + _DEVIATIONS * math.sqrt(2 * lags)


def _checked(
    problem: Shooting, found: Minimum, fixed: np.ndarray, most: int, told: Callable[[Iteration], None]
) -> Minimum:
    """The minimum, or a better one to which a point beside it leads, by runs that know of no slopes."""
    for polish in range(_POLISHES + 1):
        if not found.success or (better := _beside(problem, found, fixed)) is None:
            return found
        if polish == _POLISHES or found.runs >= most:
            return found._replace(success=False, message=found.message + _BESIDE)
        again = minimise(problem, better, found.at.nodes, fixed, most - found.runs, told, ALL)
        runs, failures = found.runs + again.runs, found.failures + again.failures
        best = min(found, again, key=_rank)
        found = best._replace(runs=runs, failures=failures)
    return found


def _beside(problem: Shooting, found: Minimum, fixed: np.ndarray) -> np.ndarray | None:
    """The best of the points one standard error beside a minimum, along each combination; None if none is better."""
    free = np.flatnonzero(~fixed)
    residual, jacobian = found.at.residual, found.slopes.jacobian[:, free]
    misfit = found.at.misfit
    if misfit <= _exact(problem) or not len(free):
        return None
    _, sizes, directions = np.linalg.svd(jacobian, full_matrices=False)
    left = max(int(np.count_nonzero(residual)) - len(free), 1)
    error = math.sqrt(2 * misfit / left)
    best, least = None, misfit * (1 - _BETTER)
    for k, direction in enumerate(directions):
        length = min(float(error / sizes[k]) if sizes[k] > 0 else math.inf, _WIDE)
        for side in (length, -length):
            z = found.z.copy()
            z[free] += side * direction
            z = np.clip(z, problem.coordinates.low, problem.coordinates.high)
            if (there := _joined(problem, z)) < least:
                best, least = z, there
    return best


_WIDE = 0.1  # in coordinates of size 1: at most so far beside a minimum
