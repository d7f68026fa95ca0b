"""The fundamental matrix of a solution: how its end moves with its start and with parameters.

    Phi = Phi_K S_K ... S_1 Phi_0,     X' = A(t) X  between events,     S the saltation matrices at them

An event-driven run has kept a tape, which is played again with the linearised flow (tangents.py). Of runs by
implicit steps, and of families, A is evaluated on the steps' own polynomials (collocation.py).
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ...door import checks
from ...door.documenting import complete
from ...paths.derivatives.collocation import Collocation
from ...paths.derivatives.linearised import linearise, rates
from ...paths.derivatives.saltation import CHATTER, Saltation, saltations
from ...paths.words import instants_without
from ...results.solution import Solution

__all__ = ["Variations", "variations"]


@complete
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

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008;
    collocation as in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7.

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
        return _rates(self.solution, _begin(self.solution)[:3])

    @property
    def rates(self) -> np.ndarray:
        """Rates f at the end, shape (n,), in the units of the model."""
        solution, tape = self.solution, self.solution.tape
        end = (solution.t[-1], solution.x[:, -1], solution.mult[:, -1]) if tape is None else tape.standing(-1)
        return _rates(solution, end)


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
    matrix, degenerate = _matrices(solution, chosen)
    n, ambiguous = len(solution.x), [str(a) for a in solution.ambiguities]
    return Variations(matrix[:, :n], matrix[:, n:], degenerate + ambiguous, solution, chosen)


def _rates(solution: Solution, point: Any) -> np.ndarray:
    t, x, mult = point
    return rates(solution.model, t, x, mult, _values(solution))


def _values(solution: Solution) -> np.ndarray:
    return np.array([solution.parameters[p.name] for p in solution.model.parameters])


def has_series(solution: Solution) -> bool:
    """Whether the solution has a tape that is played again: steps by series, of a system without loops."""
    return solution.tape is not None and solution.tape.by_series and solution.model.families is None


def _matrices(solution: Solution, chosen: tuple[sp.Symbol, ...]) -> tuple[np.ndarray, list[str]]:
    """The first n rows of the fundamental matrix of (x, q), and where it has none.

    What the tape does not tell the dense output does, where it was kept.
    """
    if not has_series(solution):
        return _collocated(solution, chosen)
    model, tape, n = solution.model, solution.tape, len(solution.x)
    start, seeds = np.eye(n, n + len(chosen)), np.zeros((len(tape.p), n + len(chosen)))
    for column, symbol in enumerate(chosen, n):
        if symbol in model.parameters:
            seeds[model.parameters.index(symbol), column] = 1.0
    run = tape.deviations(start, seeds, points=False)
    if not run.known and solution.dense is not None:
        with contextlib.suppress(
            np.linalg.LinAlgError, ValueError
        ):  # of an instant that neither tells, or a disc's
            return _collocated(solution, chosen)
    degenerate = without_derivative(solution, run.instant_t, run.instant_why)
    if not np.isnan(run.stopped):
        nothing = np.full((n, n + len(chosen)), np.nan)
        return nothing, [*degenerate, f"t = {run.stopped:.9g}: a step has no Taylor series"]
    return run.end, degenerate


def _begin(solution: Solution) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Time, states, multipliers and their status where the first step begins."""
    tape = solution.tape
    if tape is not None:
        k = tape.first_step
        return *tape.standing(k), np.where(np.abs(tape.entries[k, 4:]) == 1, tape.entries[k, 4:], 0)
    k = int(np.searchsorted(solution.t, solution.t[0], side="right")) - 1
    return float(solution.t[k]), solution.x[:, k], solution.mult[:, k], solution.status[:, k]


def sticks_at_start(solution: Solution) -> bool:
    return bool(solution._holds(_begin(solution)[3]))


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
    moves, salts = factors(solution, chosen)
    n = len(solution.x)
    total = np.eye(n + len(chosen))
    for _, factor in moves:
        total = factor @ total
    return total[:n], [s.degenerate for s in salts if s.degenerate]


def factors(
    solution: Solution, chosen: tuple[sp.Symbol, ...] = ()
) -> tuple[list[tuple[float, np.ndarray]], list[Saltation]]:
    """Factors (N, N) of a fundamental matrix with the end time of each, steps and saltations, in order of time."""
    run = Collocation(solution, chosen)
    return run.factors(), run.saltations
