"""Numbers of a Solution's window, from its columns and its dense output: what `Measure.of` is made of."""

from __future__ import annotations

import numpy as np

from ..results.maximum import refined_maximum
from ..results.solution import Solution


def segments_in(solution: Solution, *columns: int) -> list[tuple]:
    """(start, end, status of each of `columns`) of the maximal intervals of constant status of these switches."""
    pieces: list[tuple] = []
    for segment in solution.segments:
        status = tuple(segment.status[j] for j in columns)
        if pieces and pieces[-1][2:] == status:
            pieces[-1] = (pieces[-1][0], segment.end, *status)
        else:
            pieces.append((segment.start, segment.end, *status))
    return pieces


def strobes(solution: Solution, window, after: bool = False) -> np.ndarray:
    """States at the window's strobes, shape (periods + 1, n); nan where the run had ended.

    At an event the state before it, and at the end the run's last one, as the ensemble has them; after a return all
    that happens with it.
    """
    times = window.times
    reached = times <= solution.t[-1]
    x = np.full((len(times), len(solution.states)), np.nan)
    if solution.dense is not None and reached.any():
        x[reached] = solution(times[reached]).T
    for k in np.flatnonzero(reached):
        # Prefer the column at exactly that time: the polynomial is off by a rounding, or was not kept.
        last = after or k == window.periods
        column = np.searchsorted(solution.t, times[k], side="right" if last else "left") - last
        if solution.t[column] == times[k]:
            x[k] = solution.x[:, column]
        elif solution.dense is None:  # the steps of a diffusion, at multiples of its step within rounding
            column = int(np.argmin(np.abs(solution.t - times[k])))
            if abs(solution.t[column] - times[k]) <= 1e-9 * abs(solution.t[-1] - solution.t[0]):
                x[k] = solution.x[:, column]
    return x


def _steps(solution: Solution, window, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times at `nodes` (on [0, 1]) of every step inside the window, shape (steps, nodes), and the steps' lengths."""
    t = np.unique(np.clip(solution.t, window.start, window.end))
    lengths = np.diff(t)
    return t[:-1, None] + lengths[:, None] * nodes, lengths


def range_of(solution: Solution, name: str, window) -> tuple[float, float]:
    """Minimum and maximum of a state, multiplier or output over the window."""
    inside = (solution.t >= window.start) & (solution.t <= window.end)
    values = solution[name][inside]
    if solution.dense is None:
        return (float(values.min()), float(values.max())) if values.size else (np.nan, np.nan)
    times, _ = _steps(solution, window, np.linspace(0, 1, 17))
    if not times.size:
        return np.nan, np.nan
    sampled = solution(times.ravel(), name).reshape(times.shape)
    low, high = (sign * _peak(solution, name, times, sampled, sign) for sign in (-1.0, 1.0))
    # The columns hold both sides of every event, between which a multiplier jumps.
    return min(low, float(values.min(initial=np.inf))), max(high, float(values.max(initial=-np.inf)))


def _peak(solution, name, times, sampled, sign):
    """Largest value of sign * quantity: every step that could hold it, by ever closer samples."""
    samples = sign * sampled
    best = float(samples.max())
    rise = np.abs(np.diff(samples, axis=1)).max(axis=1)
    return max(
        (
            refined_maximum(lambda t: sign * solution(t, name), times[row], samples[row], 17, 8)
            for row in np.flatnonzero(samples.max(axis=1) + rise >= best)
        ),
        default=best,
    )


def moments(solution: Solution, name: str, window) -> tuple[float, float]:
    """Time average and root mean square over the window, by Gauss's rule on every step."""
    if solution.dense is None:
        inside = (solution.t >= window.start) & (solution.t <= window.end)
        t, f = solution.t[inside], solution[name][inside]
        span = t[-1] - t[0]
        return float(np.trapezoid(f, t) / span), float(np.sqrt(np.trapezoid(f * f, t) / span))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    times, lengths = _steps(solution, window, 0.5 * (nodes + 1))
    f = solution(times.ravel(), name).reshape(times.shape)
    weights = 0.5 * weights * lengths[:, None]
    span = lengths.sum()
    return float((weights * f).sum() / span), float(np.sqrt((weights * f * f).sum() / span))
