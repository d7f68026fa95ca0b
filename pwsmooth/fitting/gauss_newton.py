"""Least squares with gaps to close: Gauss and Newton's step in a box.

    min over d in the box of  | r + a B + J d |^2,     d nodes = a b + A d

B and b close the gaps (shooting.py), by the fraction a; without nodes this is a bounded trust-region method. A step is
accepted where misfit + nu * gap becomes smaller, with nu so large that the step promises as much.

Source: Bock 1983 for the step; Nocedal and Wright, Numerical Optimization, 2006, sec. 18.3, for nu. SciPy's
least_squares has no constraints, and its step would see the gaps as residuals of some weight.
Chain: shooting.py -> **gauss_newton** -> routes.py.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..door.documenting import complete
from .shooting import Evaluation, Linearised, RunFailed, Shooting

_NEAR, ALL = 1e-2, 2**60  # sum of gaps from which on one run without nodes is tried
CLOSED = 1e-7  # sum of gaps, in units of the states, that counts as closed
_FLAT = 1e-8  # of the misfit: a change that tells nothing
_STILL = 1e-9  # a step, in coordinates of size 1
_FIRST, _WIDEST, _NARROWEST = 0.5, 0.5, 1e-6  # half widths of the box; coordinates are logarithms or of size 1
LEAST = "The misfit does not become smaller any more."
STUCK = "No step lessens the misfit, no smooth function here: try other guesses or `intervals`."
INTERRUPTED = "Interrupted: this is the best point until then."


@complete
class Iteration(NamedTuple):
    """Where a fit stands.

    Attributes
    ----------
    number : int
        Accepted steps.
    misfit : float
        Half the sum of squared residuals, each in units of its noise.
    gap : float
        Sum of the gaps between intervals, in units of the size of the states; 0 with one interval.
    values : dict of str to float
        Fitted quantities, in their units.

    >>> t = np.linspace(0, 3, 61)
    >>> v = 1 + 0.5 * np.sin(t)
    >>> seen = []
    >>> found = fit_law(Coulomb(sigma2=0.1), t, v, 1.2 + 0.4 * v, kind="velocity",
    ...                 callback=seen.append)
    >>> seen[0].number, sorted(seen[0].values)
    (0, ['F_c', 'sigma2'])
    """

    number: int
    misfit: float
    gap: float
    values: dict[str, float]


class Minimum(NamedTuple):
    """The best point that was found, with its slopes."""

    z: np.ndarray
    at: Evaluation
    slopes: Linearised
    every: int  # how many intervals are one: between them states are handed on
    success: bool
    message: str
    runs: int
    failures: int


def minimise(
    problem: Shooting, z: np.ndarray, nodes: Sequence[np.ndarray], fixed: np.ndarray, most: int,
    told: Callable[[Iteration], None], every: int = 1,
) -> Minimum:  # fmt: skip
    """The least misfit with closed gaps, from a first guess; coordinates in `fixed` stay.

    `every` intervals are one to begin with.
    """
    from scipy.optimize import lsq_linear

    free = np.flatnonzero(~fixed)
    low, high = problem.coordinates.low, problem.coordinates.high
    at = problem.evaluate(z, nodes, every)
    slopes = problem.linearise(z, at)
    box, part, nu, stalled, runs, failures, accepted = _FIRST, 1.0, 0.0, np.inf, 1, 0, 0
    success, message = False, f"{most} runs were not enough: give a better first guess, or a larger `max_runs`."
    try:
        told(Iteration(0, at.misfit, at.gap, at.values))
        while runs < most:
            target = -(at.residual + part * slopes.closing)
            step = np.zeros(len(z))
            norm = np.linalg.norm(slopes.jacobian, axis=0)
            if len(free):
                # What the data feel most moves least: the others go far along a narrow valley.
                reach = np.fmin(box * norm.max() / np.where(norm > 0, norm, np.inf), _WIDEST)
                below, above = np.fmax(low - z, -reach)[free], np.fmin(high - z, reach)[free]
                slack = np.fmax(1e-12 - (above - below), 0.0)  # its bounds must differ
                step[free] = lsq_linear(
                    slopes.jacobian[:, free], target, (below - slack, above + slack), method="bvls"
                ).x
            predicted = at.misfit - 0.5 * float(np.sum((slopes.jacobian @ step - target) ** 2))
            closed = at.gap <= CLOSED
            felt = float(np.max(np.abs(step) * norm, initial=0.0) / (norm.max(initial=0.0) or 1.0))
            if closed and np.abs(step).max(initial=0.0) <= _STILL:
                success, message = True, LEAST
                break
            if box < _NARROWEST:
                if closed and at.misfit > 0.999 * stalled:
                    message = STUCK
                    break
                # It is no smooth function of the nodes: go on with fewer of them.
                stalled, every = at.misfit if closed else stalled, every if closed else 2 * every
                at = problem.evaluate(z, at.nodes, every)
                slopes = problem.linearise(z, at)
                box, part, nu, runs = _FIRST, 1.0, 0.0, runs + 1
                continue
            if at.gap:
                nu = max(nu, -2 * predicted / (part * at.gap))
            promised = predicted + nu * part * at.gap
            there = np.clip(z + step, low, high)
            moved = [
                own + A @ step + part * b
                for own, A, b in zip(at.nodes, slopes.node_slopes, slopes.node_closing)
            ]
            runs += 1
            try:
                trial = problem.evaluate(there, moved, every)
                gained = at.misfit - trial.misfit + nu * (at.gap - trial.gap)
            except (RunFailed, ValueError):
                failures += 1
                gained = -np.inf
            flat = closed and predicted <= _FLAT * at.misfit
            if not gained >= (0.0 if flat else 1e-4 * promised):
                if flat:
                    success, message = True, LEAST
                    break
                box, part = 0.25 * min(box, felt or box), 0.5 * part
                continue
            if gained > 0.5 * promised:
                box = min(2.0 * box, _WIDEST)
            z, at, part, accepted = there, trial, min(1.0, 2.0 * part), accepted + 1
            if 0 < at.gap <= _NEAR:
                # Near the solution one run from end to end is as good, and has no gaps that hold up its steps.
                runs += 1
                with contextlib.suppress(RunFailed):
                    joined = problem.evaluate(z, at.nodes, ALL)
                    if joined.misfit <= 1.1 * at.misfit:
                        at, every = joined, ALL
            slopes = problem.linearise(z, at)
            told(Iteration(accepted, at.misfit, at.gap, at.values))
            if flat:
                success, message = at.gap <= CLOSED, LEAST
                break
    except KeyboardInterrupt:
        success, message = False, INTERRUPTED
        slopes = problem.linearise(z, at)
    return Minimum(z, at, slopes, every, success, message, runs, failures)
