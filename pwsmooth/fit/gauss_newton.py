"""Least squares with gaps to close: Gauss and Newton's step in a box, which a filter accepts.

    min over d in the box of  | r + a B + J d |^2,     d nodes = a b + A d

B and b close the gaps (shooting.py), by the fraction a; without nodes this is a bounded trust-region method. A step is
accepted where it lessens the misfit as much as the model says, or, while gaps are open, where no earlier point was better
in both misfit and gap.

Source: Fletcher and Leyffer, Nonlinear programming without a penalty function, 2002, for the filter; Bock 1983 for the
step. SciPy's least_squares has no constraints, and its step would see the gaps as residuals of some weight.
Chain: shooting.py -> **gauss_newton** -> fitting.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .shooting import Evaluation, Linearised, RunFailed, Shooting

_CLOSED = 1e-7  # sum of gaps, in units of the states, that counts as closed
_FLAT = 1e-9  # of the misfit: a change that tells nothing
_STILL = 1e-9  # a step, in coordinates of size 1
_FIRST, _WIDEST, _NARROWEST = 0.5, 3.0, 1e-10  # half widths of the box; coordinates are logarithms or of size 1


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
    success: bool
    message: str
    runs: int
    failures: int


def minimise(
    problem: Shooting, z: np.ndarray, nodes: Sequence[np.ndarray], fixed: np.ndarray, most: int,
    told: Callable[[Iteration], None],
) -> Minimum:  # fmt: skip
    """The least misfit with closed gaps, from a first guess; coordinates in `fixed` stay."""
    from scipy.optimize import lsq_linear

    free = np.flatnonzero(~fixed)
    low, high = problem.coordinates.low, problem.coordinates.high
    at = problem.evaluate(z, nodes)
    slopes = problem.linearise(z, at)
    box, part, seen, runs, failures, accepted = _FIRST, 1.0, [(at.misfit, at.gap)], 1, 0, 0
    success, message = False, f"{most} runs were not enough: give a better first guess, or a larger `max_runs`."
    try:
        told(Iteration(0, at.misfit, at.gap, at.values))
        while runs < most:
            target = -(at.residual + part * slopes.closing)
            step = np.zeros(len(z))
            if len(free):
                below, above = np.fmax(low - z, -box)[free], np.fmin(high - z, box)[free]
                slack = np.fmax(1e-12 * box - (above - below), 0.0)  # its bounds must differ
                step[free] = lsq_linear(
                    slopes.jacobian[:, free], target, (below - slack, above + slack), method="bvls"
                ).x
            predicted = at.misfit - 0.5 * float(np.sum((slopes.jacobian @ step - target) ** 2))
            closed = at.gap <= _CLOSED
            if closed and (predicted <= _FLAT * at.misfit or np.abs(step).max(initial=0.0) <= _STILL):
                success, message = True, "The misfit does not become smaller any more."
                break
            if box < _NARROWEST:
                success, message = closed, "No step lessens the misfit: it is no smooth function here, or the least one."
                break
            there = np.clip(z + step, low, high)
            moved = [own + A @ step + part * b for own, A, b in zip(at.nodes, slopes.node_slopes, slopes.node_closing)]
            runs += 1
            try:
                trial = problem.evaluate(there, moved)
            except (RunFailed, ValueError):
                failures += 1
                box, part = 0.25 * min(box, np.abs(step).max(initial=0.0) or box), 0.5 * part
                continue
            gained = at.misfit - trial.misfit
            if closed and trial.gap <= max(_CLOSED, 2 * at.gap) or not len(at.gaps):
                good = gained >= 1e-4 * predicted
            else:
                good = all(trial.gap <= 0.9 * gap or trial.misfit <= misfit - 1e-3 * gap for misfit, gap in seen)
            if not good:
                box, part = 0.25 * min(box, np.abs(step).max(initial=0.0) or box), 0.5 * part
                continue
            if gained > 0.5 * predicted or trial.gap < 0.5 * at.gap:
                box = min(2.0 * box, _WIDEST)
            z, at, part, accepted = there, trial, min(1.0, 2.0 * part), accepted + 1
            seen.append((at.misfit, at.gap))
            slopes = problem.linearise(z, at)
            told(Iteration(accepted, at.misfit, at.gap, at.values))
    except KeyboardInterrupt:
        success, message = False, "Interrupted: this is the best point until then."
        slopes = problem.linearise(z, at)
    return Minimum(z, at, slopes, success, message, runs, failures)
