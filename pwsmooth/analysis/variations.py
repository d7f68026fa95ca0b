"""The fundamental matrix of a solution: how its end moves with its start and with parameters.

    Phi = Phi_K S_K ... S_1 Phi_0,     X' = A(t) X  between events,     S the saltation matrices at them

An event-driven run by series has kept a tape, which is played again with the linearised flow (paths/tangents.py). For
all other runs A is evaluated on the steps' own polynomials and the linear equation solved on each step by collocation
(Hairer, Norsett & Wanner, Solving ODEs I, II.7; II, IV.5): Gauss, order 16, for the pair; Radau IIA, order 9 and
L-stable, for smoothed ones, whose layers are stiff; S from saltation.py.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..paths.clock import slopes_of_instants
from ..paths.tangents import replay
from ..paths.words import instants_without
from ..results.records import StepPolynomials
from ..results.solution import Dense, Solution
from .linearised import Linearised, linearise, rates
from .saltation import CHATTER, Saltation, saltations, tangent_projector

__all__ = ["Variations", "variations"]

_TOLERANCE = 1e-12  # of a step's transition matrix: whole step against two halves
_DEEPEST = 10  # halvings; the steps resolve the solution already, so few are ever needed


@dataclass(frozen=True)
class Variations:
    """How a solution moves with its start and with parameters.

    Attributes
    ----------
    matrix : ndarray, shape (n, n)
        d x(end) / d x(start), in the units of the states.
    by_parameter : ndarray, shape (n, k)
        d x(end) / d q, one column a parameter, in units of the state over the parameter's.
    degenerate : list of str
        Instants at which the solution has no derivative (grazing, corners, ambiguities), in words.
    solution : Solution
        Whose they are.
    chosen : tuple of Symbol
        The parameters.

    Notes
    -----
    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008;
    collocation as in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> from pwsmooth.analysis.variations import variations
    >>> x, k = sp.symbols("x k", positive=True)
    >>> run = solve(System({x: -k * x}, parameters={k: 1}), (0, 1), {x: 2}, dense_output=True)
    >>> moved = variations(run, [k])
    >>> print(f"{moved.matrix[0, 0]:.6f} {moved.by_parameter[0, 0]:.6f}")  # exp(-1) and -2 exp(-1)
    0.367879 -0.735759
    """

    matrix: np.ndarray
    by_parameter: np.ndarray
    degenerate: list[str]
    solution: Solution
    chosen: tuple[sp.Symbol, ...]

    @functools.cached_property
    def saltations(self) -> list[Saltation]:
        """What the events of each instant do to a deviation."""
        return saltations(linearise(self.solution.model, self.chosen), self.solution, _values(self.solution))

    @property
    def first_rates(self) -> np.ndarray:
        """Rates f at the start, shape (n,), in the units of the model."""
        return rates(self.solution.model, *_begin(self.solution)[:3], _values(self.solution))

    @property
    def rates(self) -> np.ndarray:
        """Rates f at the end, shape (n,), in the units of the model."""
        return rates(self.solution.model, *_standing(self.solution, -1), _values(self.solution))


@checks.door(solution=checks.instance(Solution, "a Solution, as solve() gives it"), parameters=checks.several)
def variations(solution: Solution, parameters: Sequence[Any] = ()) -> Variations:
    """Fundamental matrix of a solution from its start to its end.

    Parameters
    ----------
    solution : Solution
        Solved with `dense_output=True`; event-driven, or a smoothed view by the package's own methods.
    parameters : sequence of str or Symbol
        Parameters with respect to which is differentiated too.

    Returns
    -------
    Variations
        The matrix, its factors, and where there is no derivative.

    Raises
    ------
    ValueError
        No dense output, an unknown parameter, or a smoothed run whose events change the state.

    Notes
    -----
    Where the start slides, it is moved along the surface only: the columns of the fundamental matrix across it
    are zero, as a stick makes them.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008;
    collocation as in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> from pwsmooth.analysis.variations import variations
    >>> x = sp.Symbol("x", real=True)
    >>> run = solve(System({x: -x}), (0, 1), {x: 1}, dense_output=True)
    >>> round(float(variations(run).matrix[0, 0]), 12) == round(float(sp.exp(-1)), 12)
    True
    """
    return moved(solution, chosen_parameters(solution.system, parameters))


def chosen_parameters(system: Any, names: Sequence[Any]) -> tuple[sp.Symbol, ...]:
    return tuple(checks.lookup(name, system.parameters, "`parameters`", "parameter") for name in names)


def moved(solution: Solution, chosen: tuple[sp.Symbol, ...]) -> Variations:
    """What `variations` gives, for what has been looked at."""
    if solution.dense is None and solution.tape is None:
        raise ValueError("`solution` has no dense output. Solve with dense_output=True.")
    matrix, degenerate = _replayed(solution, chosen) or _collocated(solution, chosen)
    n, ambiguous = len(solution.x), [str(a) for a in solution.ambiguities]
    return Variations(matrix[:, :n], matrix[:, n:], degenerate + ambiguous, solution, chosen)


def _values(solution: Solution) -> np.ndarray:
    return np.array([solution.parameters[p.name] for p in solution.model.parameters])


def has_series(solution: Solution) -> bool:
    """Whether the solution has a tape that is played again: steps by series, of a system without loops."""
    return solution.tape is not None and not solution.tape.method and solution.model.families is None


def _replayed(solution: Solution, chosen: tuple[sp.Symbol, ...]) -> tuple[np.ndarray, list[str]] | None:
    """The first n rows of the fundamental matrix of (x, q), and where it has none; None without series.

    What the tape does not tell the dense output does, where it was kept.
    """
    model, tape = solution.model, solution.tape
    if not has_series(solution):
        return None
    n, N, p = len(solution.x), len(solution.x) + len(chosen), tape.p
    start, seeds, clock = np.eye(n, N), np.zeros((len(p), N)), np.zeros((len(tape.clock), N))
    for column, symbol in enumerate(chosen, n):
        if symbol in model.parameters:
            seeds[model.parameters.index(symbol), column] = 1.0
        if len(clock):
            given = dict(zip(model.parameters, p))
            clock[:, column] = slopes_of_instants(model, given, tape.clock, tape.clock_event, symbol)
    run = replay(model, tape, start, seeds, clock=clock, points=False)
    if not run.known and solution.dense is not None:
        with contextlib.suppress(np.linalg.LinAlgError):  # of an instant that neither tells
            return _collocated(solution, chosen)
    degenerate = without_derivative(solution, run.instant_t, run.instant_why)
    if not np.isnan(run.stopped):
        return np.full((n, N), np.nan), [*degenerate, f"t = {run.stopped:.9g}: a step has no Taylor series"]
    return run.end, degenerate


def _begin(solution: Solution) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Time, states, multipliers and their status where the first step begins."""
    tape = solution.tape
    if tape is not None:
        k = tape.first_step
        return *_standing(solution, k), np.where(np.abs(tape.entries[k, 4:]) == 1, tape.entries[k, 4:], 0)
    k = int(np.searchsorted(solution.t, solution.t[0], side="right")) - 1
    return *_standing(solution, k), solution.status[:, k]


def _standing(solution: Solution, k: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Time, states and multipliers at an entry of the tape, or in a column of a run without."""
    tape, n, m = solution.tape, len(solution.x), len(solution.mult)
    if tape is None:
        return float(solution.t[k]), solution.x[:, k], solution.mult[:, k]
    return float(tape.values[k, 0]), tape.values[k, 2 : 2 + n], tape.values[k, 2 + n : 2 + n + m]


def sticks_at_start(solution: Solution) -> bool:
    return 0 in _begin(solution)[3]


def without_derivative(solution: Solution, times: np.ndarray, why: np.ndarray) -> list[str]:
    """Instants of a replay that have no derivative, in words."""
    if not why[:, 0].any():
        return []
    # The last impacts before an accumulation are always slow; what follows from it contains their effect.
    ends = solution.event_times("accumulation")
    return [
        f"t = {t:.9g}: {said}" for t, said in instants_without(solution.model, times, why)
        if not np.any((ends >= t) & (ends - t < CHATTER * (1 + abs(t))))
    ]  # fmt: skip


def _collocated(solution: Solution, chosen: tuple[sp.Symbol, ...]) -> tuple[np.ndarray, list[str]]:
    """The same from dense output."""
    line = linearise(solution.model, chosen)
    moves, salts = factors(solution, line)
    total = np.eye(line.N)
    for _, factor in moves:
        total = factor @ total
    return total[: line.n], [s.degenerate for s in salts if s.degenerate]


def factors(solution: Solution, line: Linearised) -> tuple[list[tuple[float, np.ndarray]], list[Saltation]]:
    """Factors (N, N) of a fundamental matrix with the end time of each, steps and saltations, in order of time."""
    steps, values = _steps(solution), _values(solution)
    transitions = _transitions(line, steps, steps.statuses(solution), values)
    salts = saltations(line, solution, values)
    first = tangent_projector(line, *_begin(solution), values)
    moves = [] if first is None else [(float(solution.t[0]), first)]
    jumps = [(s.time, s.matrix) for s in salts]
    done = 0
    before = np.searchsorted([time for time, _ in jumps], steps.start, side="right")  # how many, of every step
    for count, end, transition in zip(before, steps.ends, transitions):
        moves += [*jumps[done:count], (float(end), transition)]
        done = count
    return moves + jumps[done:], salts


@dataclass(frozen=True)
class _Steps:
    """Dense output of either path: powers of s in [0, length]; t(s) has the coefficients `time`."""

    start: np.ndarray
    ends: np.ndarray
    length: np.ndarray
    x: np.ndarray
    mult: np.ndarray
    time: np.ndarray
    stiff: bool

    def statuses(self, solution: Solution) -> np.ndarray:
        """Status (ns, m) on each step: that of the last column that its start has."""
        column = np.searchsorted(solution.t, self.start, side="right") - 1
        return solution.status[:, np.clip(column, 0, None)].T


def _steps(solution: Solution) -> _Steps:
    dense = solution.dense
    if solution.course is not None:
        raise ValueError("`solution` has its columns at `t_eval`, not at its events; solve without `t_eval`.")
    if isinstance(dense, Dense) and dense.time_coefficients is not None and dense.length is not None:
        time = dense.time_coefficients
        return _Steps(
            dense.t0, dense.t1, dense.length, dense.coefficients, dense.mult_coefficients, time, False
        )
    if isinstance(dense, StepPolynomials) and dense.n is None:
        if any(event.update for event in solution.model.events):
            raise ValueError(
                "`solution` is a smoothed run whose events change the state: its variations are not available. "
                "Use the event-driven system."
            )
        ns = len(dense.t0)
        time = np.stack([dense.t0, dense.length], axis=1)
        return _Steps(
            dense.t0, dense.t0 + dense.length, np.ones(ns), dense.coefficients, np.zeros((ns, 0, 1)), time, True
        )
    kind = "none" if dense is None else type(dense).__name__
    raise ValueError(
        f"`solution` has no step polynomials (dense output: {kind}). Solve with dense_output=True and one of the "
        "package's own methods."
    )


def _transitions(line: Linearised, steps: _Steps, status: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Transition matrices (ns, N, N) of all steps, those of equal status together."""
    ns, N = len(steps.length), line.N
    result = np.empty((ns, N, N))
    kinds, which = np.unique(status, axis=0, return_inverse=True)
    for k, kind in enumerate(kinds):
        here = np.flatnonzero(which.ravel() == k)
        ends = np.zeros(len(here)), steps.length[here]
        whole = _collocate(line, steps, line.solved(kind), p, here, *ends)
        result[here] = _refined(line, steps, line.solved(kind), p, here, *ends, whole, 0)
    return result


def _refined(line, steps, J, p, piece, a, b, whole, depth) -> np.ndarray:
    """Transitions over [a, b] of the given pieces: by two halves where the whole one differs from them."""
    half, count = 0.5 * (a + b), len(piece)
    twice, begin, end = np.concatenate([piece, piece]), np.concatenate([a, half]), np.concatenate([half, b])
    halves = _collocate(line, steps, J, p, twice, begin, end)
    two = halves[count:] @ halves[:count]
    off = np.abs(whole - two).max(axis=(1, 2))
    rough = np.flatnonzero(~(off <= _TOLERANCE * (1 + np.abs(two).max(axis=(1, 2)))))
    if rough.size and depth < _DEEPEST:
        again = np.concatenate([rough, rough + count])
        finer = _refined(line, steps, J, p, twice[again], begin[again], end[again], halves[again], depth + 1)
        two[rough] = finer[rough.size :] @ finer[: rough.size]
    return two


def _collocate(line, steps, J, p, piece, a, b) -> np.ndarray:
    """One collocation step for X' = A X over [a, b] in s, for many pieces at once: (len(piece), N, N)."""
    c, table, weights = _radau(5) if steps.stiff else _gauss(8)
    n, N, stages, count = line.n, line.N, len(c), len(piece)
    h = b - a
    s = a[:, None] + h[:, None] * c
    powers = s[:, :, None] ** np.arange(steps.x.shape[2])

    def along(coefficients):
        degree = coefficients.shape[2]
        rows = powers[:, :, :degree] @ coefficients[piece].transpose(0, 2, 1)
        return rows.reshape(count * stages, coefficients.shape[1]).T

    time = steps.time[piece]
    t = (powers[:, :, : time.shape[1]] @ time[:, :, None]).ravel()
    slopes = time[:, 1:] * np.arange(1, time.shape[1])
    speed = (powers[:, :, : slopes.shape[1]] @ slopes[:, :, None])[:, :, 0]
    A = line.blocks(t, along(steps.x), along(steps.mult), p).flow(J).reshape(count, stages, n, N)
    A = A * (h[:, None] * speed)[:, :, None, None]
    # K_i = A_i (1 + sum_j a_ij K_j): one linear system of stages*n unknowns a piece; parameters do not move.
    system = -(A[:, :, :, None, :n] * table[:, None, :, None])
    system = system.reshape(count, stages * n, stages * n)
    system[:, np.arange(stages * n), np.arange(stages * n)] += 1.0
    K = np.linalg.solve(system, A.reshape(count, stages * n, N)).reshape(count, stages, n, N)
    result = np.zeros((count, N, N))
    result[:] = np.eye(N)
    result[:, :n] += np.einsum("s,psij->pij", weights, K)
    return result


@functools.cache
def _gauss(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(stages)
    return _tableau((x + 1) / 2)


@functools.cache
def _radau(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    from scipy.special import roots_jacobi

    x, _ = roots_jacobi(stages - 1, 1, 0)
    return _tableau(np.append((x + 1) / 2, 1.0))


def _tableau(c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, matrix and weights of the collocation method on the nodes c in [0, 1]."""
    stages = len(c)
    polynomials = np.polynomial.legendre.Legendre.basis
    inverse = np.linalg.inv(np.stack([polynomials(k, domain=[0, 1])(c) for k in range(stages)], axis=1))
    integrals = [polynomials(k, domain=[0, 1]).integ(lbnd=0) for k in range(stages)]
    table = np.stack([f(c) for f in integrals], axis=1) @ inverse
    weights = np.array([f(1.0) for f in integrals]) @ inverse
    return c, table, weights
