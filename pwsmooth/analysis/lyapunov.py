"""Lyapunov exponents: mean growth of deviations along a trajectory, sticks and jumps included.

    q_k+1 r_k = F_k q_k     (QR decompositions),     exponent_i = lim sum_k log|r_k,ii| / time

with the factors F of the fundamental matrix, steps and what the instants do (P. C. Mueller, Chaos, Solitons &
Fractals, 1995): along the tape of an event-driven run (tangents.py), else those of first_order.py. A stick
annihilates a direction: its exponent is -inf, and that is the truth. On a periodic orbit the exponents are
log|multiplier|/period.

Chain: first_order.py -> **lyapunov**.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..door import calls, checks
from ..door.describe import Described, Rows, listed
from ..paths.budget import opened, whole
from ..paths.derivatives.growth import growth
from ..paths.derivatives.tangents import Tape
from ..paths.words import meets_several
from ..results.records import Outcome
from ..results.solution import Solution
from ..solving import behind_the_door, taped_run
from .maps.first_order import factors, has_series, without_derivative
from .maps.scales import scale_at

__all__ = ["LyapunovExponents", "largest_exponent", "lyapunov_exponents"]

_PIECES = 20  # means over as many parts of the run give the error
_CUTS = 201  # of a run whose deviations are differences, which begin anew at each
_STEP = 1e-6  # of the units of the states: such differences
_SETTLES = 0.2  # of the run, in which the differences find their directions
_APART = 1.0  # in all of a run: growth by which both sides may differ
_CHUNK = 500.0  # time whose polynomials are kept at once


@checks.door()
@dataclass(frozen=True, repr=False)
class LyapunovExponents(Described):
    """Exponents, largest first, and how well the run determines them.

    Attributes
    ----------
    exponents : ndarray, shape (count,)
        In units of 1/time; -inf for directions that a stick, an impact without rebound or a reset takes away.
    errors : ndarray, shape (count,)
        Standard error of the mean over the parts of the run, in units of 1/time; it knows nothing of slower
        changes.
    outcome : Outcome
        How the trajectory ended; after a failure the exponents are those of the part before it.
    degenerate : tuple of str
        Where the trajectory has no derivative (grazing, corners, ambiguities), in words: there deviations were carried
        on as if the instant did not move with them.

    Source: Mueller, Chaos, Solitons & Fractals, 1995.

    >>> x = sp.Symbol("x", real=True)
    >>> found = lyapunov_exponents(System({x: -2 * x}), {x: 1}, 10)
    >>> print(f"{found.exponents[0]:.6f} over {found.time:g}, {found.outcome.name}")
    -2.000000 over 10, FINISHED
    """

    exponents: np.ndarray
    errors: np.ndarray
    time: float
    outcome: Outcome
    degenerate: tuple[str, ...] = ()

    def plot(self, ax: Any = None) -> Any:
        """The exponents in order, with their errors; those that are -inf as triangles at the lower edge.

        Returns
        -------
        Axes
            Where it was drawn.
        """
        from ..plotting import COLOUR, axes_for

        (ax,) = axes_for(ax, 1, (4.5, 3.0), "one picture; give one")
        number = np.arange(1, len(self.exponents) + 1)
        finite, gone = np.isfinite(self.exponents), np.isneginf(self.exponents)
        ax.axhline(0, color=COLOUR["mark"], linewidth=0.8)
        ax.errorbar(number[finite], self.exponents[finite], self.errors[finite], fmt="o", color=COLOUR["exact"])
        if gone.any():
            low = dict(color=COLOUR["exact"], clip_on=False, transform=ax.get_xaxis_transform())
            ax.plot(number[gone], 0.0 * number[gone], "v", **low, label="-inf")
            ax.legend()
        ax.set(xlabel="number", ylabel="Lyapunov exponent", xticks=number)
        return ax

    def _described(self) -> tuple[str, Rows]:
        return f"LyapunovExponents over {self.time:.9g}: {self.outcome}", {
            "exponents": listed(
                [
                    f"{e:.6g} +- {d:.1g}" if np.isfinite(e) else f"{e:g}"
                    for e, d in zip(self.exponents, self.errors)
                ]
            ),
            "degenerate": list(self.degenerate),
        }.items()


@functools.cache
def _directions(n: int, count: int) -> np.ndarray:
    """Orthonormal and generic, the same ones in every run: results do not depend on a seed."""
    return np.linalg.qr(np.random.default_rng(20).normal(size=(n, count)))[0]


class _Frame:
    """Orthonormal deviations carried along, and the logarithms of their growth."""

    def __init__(self, n: int, count: int, start: float) -> None:
        self.start = start
        self.q = _directions(n, count)
        self.times: list[np.ndarray] = []
        self.logs: list[np.ndarray] = []
        self.degenerate: list[str] = []

    def carry_along(self, tape: Tape, ambiguities: int, solution: Callable[[], Solution]) -> bool:
        """Along the tape of a run; False where a step has no series. Words are asked of its solution."""
        found = growth(tape, self.q)
        if not math.isnan(found.stopped):
            return False
        self.q = found.frame
        self.times.append(found.t)
        self.logs.append(found.log)
        if ambiguities or found.instant_why[:, 0].any():
            run = solution()
            self.degenerate += without_derivative(run, found.instant_t, found.instant_why)
            self.degenerate += [str(a) for a in run.ambiguities]
        return True

    def carry_by_factors(self, run: Solution, until: float = math.inf) -> None:
        """Along the dense output of a run, up to a time."""
        n, count = self.q.shape
        moves, salts = factors(run)
        self.degenerate += [s.degenerate for s in salts if s.degenerate and s.time <= until]
        self.degenerate += [str(a) for a in run.ambiguities]
        times, logs = [], []
        for time, factor in moves:
            if time > until:
                break
            grown = factor @ self.q
            if count == 1:
                size = np.sqrt((grown * grown).sum(axis=0))
                self.q = grown / size if size > 0 else self.q
            else:
                self.q, r = np.linalg.qr(grown)
                size = np.abs(np.diag(r))
                # What is left of an annihilated direction is rounding.
                size[size < 1e-14 * np.abs(grown).max()] = 0.0
            with np.errstate(divide="ignore"):
                logs.append(np.log(size))
            times.append(time)
        self.times.append(np.array(times))
        self.logs.append(np.array(logs).reshape(-1, count))

    def means(self, start: float, end: float, outcome: Outcome) -> LyapunovExponents:
        """Growth rates over (start, end]."""
        count = self.q.shape[1]
        # Behind the last factor one that nothing grows by, where parts without a factor may begin.
        times, logs = np.concatenate(self.times), np.concatenate([*self.logs, np.zeros((1, count))])
        before = int(np.searchsorted(times, start, side="right"))
        if not end > start or before == len(times):
            empty = np.full(count, np.nan)
            return LyapunovExponents(empty, empty.copy(), 0.0, outcome)
        # Count whole factors only: the average begins at the end of a step.
        start = float(times[before - 1]) if before else self.start
        begins = np.searchsorted(times, start + (end - start) / _PIECES * np.arange(_PIECES), side="right")
        parts = np.add.reduceat(logs, begins)
        parts[np.diff(begins, append=len(times)) == 0] = 0.0
        exponents = parts.sum(axis=0) / (end - start)
        with np.errstate(invalid="ignore"):
            off = parts / (end - start) - exponents / _PIECES
            errors = np.sqrt((off * off).sum(axis=0) * _PIECES / (_PIECES - 1))
        order = np.argsort(-exponents, kind="stable")
        said = tuple(dict.fromkeys(self.degenerate))
        return LyapunovExponents(exponents[order], errors[order], end - start, outcome, said)


@checks.door(
    solution=checks.instance(Solution, "a Solution, as solve() gives it"), after=checks.optional(checks.number)
)
def largest_exponent(solution: Solution, after: float | None = None) -> float:
    """Largest Lyapunov exponent of a solution.

    Parameters
    ----------
    solution : Solution
        Solved with `dense_output=True`.
    after : float, in the unit of the model's time, optional
        The average begins with the first step after it; before, the deviation finds its direction. Default: a
        fifth of the run.

    Returns
    -------
    float
        In units of 1/time; -inf where sticks annihilate every direction, nan where nothing was left to average.

    Raises
    ------
    ValueError
        No dense output.

    Source: Mueller, Chaos, Solitons & Fractals, 1995.

    >>> x, y = sp.symbols("x y", real=True)
    >>> run = solve(System({x: -x / 2, y: -3 * y}), (0, 20), {x: 1, y: 1}, dense_output=True)
    >>> round(largest_exponent(run), 6)
    -0.5
    """
    times = solution.t if solution.course is None else solution.course[0]
    start, end = float(times[0]), float(times[-1])
    if not end > start:
        return math.nan
    frame = _Frame(len(solution.x), 1, start)
    ambiguities = len(solution.ambiguities)
    if not (has_series(solution) and frame.carry_along(solution.tape, ambiguities, lambda: solution)):
        frame.carry_by_factors(solution)
    begin = start + 0.2 * (end - start) if after is None else float(after)
    return float(frame.means(begin, end, solution.outcome).exponents[0])


@checks.door(
    (*calls.RUNS, "parameters"),
    system=checks.system,
    time=checks.positive,
    transient=checks.nonnegative,
    start_time=checks.number,
)
@whole
def lyapunov_exponents(
    system: Any,
    x0: Any,
    time: float,
    *,
    transient: float = 0.0,
    start_time: float = 0.0,
    count: int = 1,
    **options: Any,
) -> LyapunovExponents:
    """The largest `count` Lyapunov exponents of a system from a start.

    Parameters
    ----------
    system : System
        Event-driven or smoothed.
    x0 : mapping or sequence of float, length n
        Start, in the units of the states.
    transient : float, in the unit of the model's time
        Time before it, in which the trajectory settles and the deviations find their directions.
    start_time : float, in the unit of the model's time
        t of `x0`.
    count : int
        1 to the number of states.
    **options
        For `solve`; `max_steps` and `max_seconds` bound the whole run.

    Returns
    -------
    LyapunovExponents
        With their errors and the outcome of the run.

    Raises
    ------
    ValueError, TypeError
        Bad input.

    Notes
    -----
    Of a long run no more is kept than the growth on each step: deviations follow it part by part.

    Source: Mueller, Chaos, Solitons & Fractals, 1995.

    >>> t, x, v = sp.symbols("t x v", real=True)
    >>> damped = System({x: v, v: sp.cos(t) - x - v / 5}, time=t)
    >>> found = lyapunov_exponents(damped, {x: 0, v: 0}, 200, transient=20, count=2)
    >>> [round(float(e), 2) for e in found.exponents]
    [-0.1, -0.1]
    """
    last = start_time + transient + time
    if math.ulp(last) > 1e-6 * min(time, _CHUNK):
        raise ValueError(
            f"`time` is {time:g}: with `start_time` {start_time:g} and `transient` {transient:g} the run ends at t = "
            f"{last:g}, where floats are {math.ulp(last):g} apart; give less."
        )
    x = system.initial_state(x0, start_time)
    count = checks.whole(count, "`count`", 1, len(x))
    first = start_time + transient
    run = taped_run(system, options, rows=True)
    along = run and _along_a_tape(run, system, x, count, start_time, first, last)
    frame, end, outcome = along or _by_chunks(system, options, x, count, start_time, first, last)
    found = frame.means(first, end, outcome)
    if outcome is Outcome.FINISHED and meets_several(found.degenerate):
        return _by_differences(found, system, options, x, start_time, first, last)
    return found


def _by_differences(found, system, options, x, t, first, last) -> LyapunovExponents:
    """Exponents of a run that meets several surfaces at one instant, by motions beside it; nan where sides differ."""
    n, count, solve = len(x), len(found.exponents), behind_the_door(system, **options)
    scale = scale_at(x)
    unit, cuts = np.ones(n) if scale is None else np.array(scale.unit), np.linspace(t, last, _CUTS)
    frames = [side * _STEP * _directions(n, count) for side in (1, -1)]
    logs, nothing = np.zeros((2, _CUTS - 1, count)), np.full(count, np.nan)
    for k, span in enumerate(zip(cuts[:-1].tolist(), cuts[1:].tolist())):
        end = solve(system, span, list(map(float, x))).x[:, -1]
        for side, frame in enumerate(frames):
            ends = [solve(system, span, (x + unit * d).tolist()) for d in frame.T]
            if not all(one.outcome is Outcome.FINISHED for one in ends):
                return replace(found, exponents=nothing, errors=nothing)
            q, r = np.linalg.qr(np.array([(one.x[:, -1] - end) / unit for one in ends]).T / _STEP)
            with np.errstate(divide="ignore"):
                logs[side, k] = np.log(np.abs(np.diag(r)))
            frames[side] = _STEP * q * np.where(np.diag(r) < 0, -1.0, 1.0)
        x = end
    kept = logs[:, cuts[1:] > first + _SETTLES * (last - first)] / (cuts[1] - cuts[0])
    means, errors = kept.mean(axis=1), kept.std(axis=1).max(axis=0) / math.sqrt(kept.shape[1])
    with np.errstate(invalid="ignore"):
        alike = (means[0] == means[1]) | (np.abs(means[0] - means[1]) <= 2 * errors + _APART / (last - first))
    exponents, order = np.where(alike, means.mean(axis=0), np.nan), np.argsort(-means[0], kind="stable")
    return replace(found, exponents=exponents[order], errors=errors[order])


def _along_a_tape(run, system, x, count, t, first, last) -> tuple[_Frame, float, Outcome] | None:
    """None where a step has no series."""
    frame, p = _Frame(len(x), count, t), np.array(system.parameter_values, float)
    ends = [first, last] if first > t else [last]
    for part in run.tapes_of(system, p, t, ends, x, opened()):
        if not frame.carry_along(part.tape, part.ambiguities, part.solution):
            return None
    done = part.code == Outcome.FINISHED
    return frame, float(part.tape.values[-1, 0]), Outcome.FINISHED if done else part.solution().outcome


def _by_chunks(system, options, x, count, t, first, last) -> tuple[_Frame, float, Outcome]:
    frame, outcome = _Frame(len(x), count, t), Outcome.FINISHED
    solve = behind_the_door(system, **{**options, "dense_output": True})
    while t < last:
        # The average begins where a piece does, so that it holds whole periods if `time` does.
        end = min(t + _CHUNK, last, first if t < first else last)
        run = solve(system, (t, end), list(map(float, x)))
        outcome = run.outcome
        column = len(run.t) - 1
        if run.success and run.t[-1] < last:
            column = _free_column(run)
        frame.carry_by_factors(run, float(run.t[column]))
        t, x = float(run.t[column]), run.x[:, column]
        if outcome is not Outcome.FINISHED:
            break
    return frame, t, outcome


def _free_column(run: Solution) -> int:
    """The last column between events at which nothing is held; the last one of all if there is none."""
    free = ~run._holds(run.status)
    free[0] = False
    alone = np.diff(run.t, prepend=-np.inf, append=np.inf)
    free &= (alone[:-1] > 0) & (alone[1:] > 0)
    columns = np.flatnonzero(free)
    return int(columns[-1]) if columns.size and columns[-1] > 0.5 * len(run.t) else len(run.t) - 1
