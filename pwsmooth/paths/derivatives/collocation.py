"""Deviations of a run by implicit steps: smoothed views and method="stiff", whose layers and bristles are stiff.

    Phi = Phi_K S_K ... S_1 Phi_0,     X' = A(t) X  between events,     S the saltation matrices at them

A is evaluated on the steps' own polynomials, and the linear equation solved on each step by collocation (Hairer,
Norsett & Wanner, Solving ODEs I, II.7; II, IV.5): Radau IIA, order 9 and L-stable. Gauss's, order 16, serves
event-driven runs of families, of powers that have no series, and those with an instant that a tape does not tell.
Backward the same matrices are transposed.
Chain: linearised.py, saltation.py -> **Collocation** -> of_solution.py, costs/, analysis/maps/first_order.py.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import sympy as sp

from ...door import checks
from ...results.records import StepPolynomials
from ...results.solution import Dense, Solution
from .linearised import linearise, rates
from .saltation import Saltation, at, saltations, tangent_projector
from .tangents import Deviations, Readings, Slopes

_TOLERANCE = 1e-12  # of a step's transition matrix: whole step against two halves
_AT_ONCE = 2**13  # parts of steps, whose equations take a hundred megabytes
_DEEPEST = 10  # halvings; the steps resolve the solution already, so few are ever needed


class Collocation:
    """How a run with dense output moves: a matrix for each step and each instant, of deviations of (x, chosen).

    What a `Tape` is for a run by series: deviations forward, slopes of a cost backward.
    """

    def __init__(self, solution: Solution, chosen: tuple[sp.Symbol, ...]) -> None:
        self.solution, self.chosen = solution, chosen
        checks.without_discs(solution.model, "derivatives along implicit steps")
        self.line = linearise(solution.model, chosen)
        self.p = np.array([solution.parameters[p.name] for p in solution.model.parameters])
        self.steps = _steps(solution)
        self._status = self.steps.statuses(solution)

    @functools.cached_property
    def transitions(self) -> np.ndarray:
        """Of all steps, shape (ns, N, N)."""
        count = len(self.steps.length)
        return self._transitions(np.arange(count), self.steps.length)

    @functools.cached_property
    def saltations(self) -> list[Saltation]:
        return saltations(self.line, self.solution, self.p)

    def order(self) -> list[tuple[int, int]]:
        """Steps (0, k) and instants (1, k), as they follow each other."""
        times = [s.time for s in self.saltations]
        found, done = [], 0
        for k, before in enumerate(np.searchsorted(times, self.steps.start, side="right")):
            found += [*((1, i) for i in range(done, before)), (0, k)]
            done = int(before)
        return found + [(1, i) for i in range(done, len(times))]

    def factors(self) -> list[tuple[float, np.ndarray]]:
        """Factors (N, N) of the fundamental matrix with the end time of each, in order of time."""
        found = [
            (self.saltations[k].time, self.saltations[k].matrix)
            if instant
            else (float(self.steps.ends[k]), self.transitions[k])
            for instant, k in self.order()
        ]
        return found if self.along is None else [(float(self.solution.t[0]), self.along), *found]

    @property
    def start(self) -> int:
        """The column of the solution behind its start."""
        return int(np.searchsorted(self.solution.t, self.solution.t[0], side="right")) - 1

    @functools.cached_property
    def along(self) -> np.ndarray | None:
        """Projector (N, N) on deviations along the surfaces that hold the start; None without any."""
        s, k = self.solution, self.start
        return tangent_projector(self.line, float(s.t[k]), s.x[:, k], s.mult[:, k], s.status[:, k], self.p)

    def _begun(self, W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Deviations along the surfaces that hold the start, and what share of each column leads out of them."""
        if self.along is None:
            return W, np.zeros(W.shape[1])
        kept, n = self.along @ W, self.line.n
        size = np.abs(W[:n]).max(axis=0, initial=0.0)
        return kept, np.abs(W - kept)[:n].max(axis=0, initial=0.0) / np.where(size > 0, size, 1.0)

    # ---- as a tape does it

    def first_rates(self) -> np.ndarray:
        """f behind the start."""
        s, k = self.solution, self.start
        return rates(s.model, float(s.t[k]), s.x[:, k], s.mult[:, k], self.p)

    @property
    def instants(self) -> np.ndarray:
        """What `Readings.entries` names them by."""
        return np.arange(len(self.saltations))

    def met(self) -> tuple[np.ndarray, np.ndarray]:
        """Times of the instants, and their causes: places among multipliers and events, or -1."""
        model = self.solution.model
        names = [str(symbol) for symbol in self.line.symbols] + [event.name for event in model.events]
        causes = [names.index(s.cause) if s.cause in names else -1 for s in self.saltations]
        return np.array([s.time for s in self.saltations]), np.array(causes, np.int64)

    def deviations(
        self, start: np.ndarray, seeds: np.ndarray, times: np.ndarray | None = None, points: bool = True
    ) -> Deviations:
        """From `start` (n, columns) of the states and `seeds` (np, columns) of the parameters."""
        n, salts, own = self.line.n, self.saltations, self.solution.t
        number = len(salts)
        chosen = [self.solution.model.parameters.index(q) for q in self.chosen]
        W, off = self._begun(np.vstack([start, seeds[chosen]]))
        times = np.empty(0) if times is None else times
        # Of two columns at an event the first is the side before it.
        before = np.append(own[1:] == own[:-1], False) if points else np.zeros(0, bool)
        before[1:] &= own[1:] > own[:-1] if points else False
        wanted = np.concatenate([times, own if points else []])
        left = np.concatenate([np.zeros(len(times), bool), before])
        piece, partial = self._within(wanted, left)
        found = np.zeros((len(wanted), self.line.N, W.shape[1]))
        delay, around = np.zeros((number, W.shape[1])), np.zeros((number, 2 * n, W.shape[1]))
        for instant, k in self.order():
            if instant:
                salt = salts[k]
                delay[k] = salt.delay @ W
                around[k, :n] = W[:n] + np.outer(salt.rates[0], delay[k])
                W = salt.matrix @ W
                around[k, n:] = W[:n] + np.outer(salt.rates[1], delay[k])
            else:
                here = piece == k
                found[here] = partial[here] @ W
                W = self.transitions[k] @ W
        found[piece == len(self.steps.start)] = W
        found = np.concatenate([found[:, :n], self._multipliers(wanted, left, found)], axis=1)
        times_met, causes = self.met()
        why = np.stack([[s.why for s in salts], causes], axis=1).astype(np.int64).reshape(-1, 2)
        return Deviations(
            W[:n], found[len(times) :], found[: len(times)], times_met, why, delay, around, np.nan, off
        )  # fmt: skip

    def pull_back(self, cost: Readings) -> Slopes:
        """Slopes of a cost by the start and by the parameters (of others than the chosen ones 0)."""
        n, salts, model = self.line.n, self.saltations, self.solution.model
        piece, partial = self._within(cost.times, np.zeros(len(cost.times), bool))
        # Of the slopes by multipliers those by what they follow from.
        unit = np.broadcast_to(np.eye(self.line.N), (len(piece), self.line.N, self.line.N))
        slopes = np.einsum(
            "tj,tjk->tk", cost.at[:, n:], self._multipliers(cost.times, np.zeros_like(piece, bool), unit)
        )
        slopes[:, :n] += cost.at[:, :n]
        c = slopes[piece == len(self.steps.start)].sum(axis=0)
        c[:n] += cost.end
        at_instant = dict(zip(cost.entries.tolist(), cost.instants))
        for instant, k in reversed(self.order()):
            if not instant:
                c = self.transitions[k].T @ c
                for q in np.flatnonzero(piece == k):
                    c += partial[q].T @ slopes[q]
                continue
            salt, row = salts[k], at_instant.get(k, np.zeros(2 * n + 1))
            c[:n] += row[n:-1]
            c = salt.matrix.T @ c
            c[:n] += row[:n]
            c += salt.delay * (row[:n] @ salt.rates[0] + row[n:-1] @ salt.rates[1] + row[-1])
        why = next(((s.why, -1, s.time) for s in salts if s.why), None)
        if self.along is not None:
            c = self.along.T @ c
        by, off = np.zeros(len(self.p)), np.zeros(n + len(self.p))
        chosen = [model.parameters.index(q) for q in self.chosen]
        by[chosen] = c[n:]
        off[[*range(n), *(n + j for j in chosen)]] = self._begun(np.eye(self.line.N))[1]
        return Slopes(c[:n], by, why, off)

    def _multipliers(self, times: np.ndarray, left: np.ndarray, W: np.ndarray) -> np.ndarray:
        """Deviations (nt, m, columns) of the multipliers from those of states and parameters, W (nt, N, columns)."""
        solution, line = self.solution, self.line
        found = np.zeros((len(times), line.m, W.shape[2]))
        column = np.searchsorted(solution.t, times, side="right") - 1
        column[left] = np.searchsorted(solution.t, times[left])
        status = solution.status[:, column].T
        if not len(times) or not any(line.solved(kind) for kind in np.unique(status, axis=0)):
            return found
        x, mult = solution.dense(times)
        own = solution.t[column] == times
        x[:, own], mult[:, own] = solution.x[:, column[own]], solution.mult[:, column[own]]
        blocks = line.blocks(times, x, mult, self.p)
        for q, kind in enumerate(status):
            if solved := line.solved(kind):
                found[q, solved] = at(blocks, q).solved(solved)[0][0] @ W[q]
        return found

    def _within(self, times: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The step that holds each time, and the matrix from its start to there; the number of steps stands for the
        end of the run. `left` are on the side before an event."""
        steps = self.steps
        if not len(steps.start):
            return np.zeros(len(times), int), np.empty((0, self.line.N, self.line.N))
        side = np.where(
            left,
            np.searchsorted(steps.start, times, side="left"),
            np.searchsorted(steps.start, times, side="right"),
        )
        piece = np.clip(side - 1, 0, len(steps.start) - 1)
        over = (times - steps.start[piece]) / steps.time[piece, 1]
        partial = self._transitions(piece, np.minimum(over, steps.length[piece]))
        return np.where(~left & (times >= self.solution.t[-1]), len(steps.start), piece), partial

    # ---- matrices

    def _transitions(self, pieces: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Transition matrices (len(pieces), N, N) from the starts of steps to these places on them.

        Those of equal status are made together.
        """
        result = np.empty((len(pieces), self.line.N, self.line.N))
        kinds, which = np.unique(self._status[pieces], axis=0, return_inverse=True)
        for k, kind in enumerate(kinds):
            here = np.flatnonzero(which.ravel() == k)
            solved = self.line.solved(kind)
            result[here] = _refined(self.line, self.steps, solved, self.p, pieces[here], ends[here])
        return result


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
    n, m = len(solution.x), len(solution.mult)
    if dense is None and len(solution.t) == 1:  # it stopped where it began
        dense = StepPolynomials(np.empty(0), np.empty(0), np.empty((0, n + m, 1)))
    if isinstance(dense, StepPolynomials):
        x, sides = np.split(dense.coefficients, [n], axis=1)
        time = np.stack([dense.t0, dense.length], axis=1)
        ends = np.append(dense.t0[1:], solution.t[-1])[: len(x)]  # an event cuts the step that it is found on
        return _Steps(dense.t0, ends, (ends - dense.t0) / dense.length, x, sides, time, True)
    kind = "none" if dense is None else type(dense).__name__
    raise ValueError(
        f"`solution` has no step polynomials (dense output: {kind}). Solve with dense_output=True and one of the "
        "package's own methods."
    )


def _refined(line, steps, J, p, piece, ends) -> np.ndarray:
    """Transitions from the starts of pieces to these places on them: in ever more parts, until twice as many agree.

    Looked at is the product alone: what a part of a decay is off by, those behind it take away.
    """

    def product_of(which, parts):
        marks = ends[which, None] * np.arange(parts + 1) / parts
        low, high = marks[:, :-1].ravel(), marks[:, 1:].ravel()
        factors = _collocate(line, steps, J, p, np.repeat(piece[which], parts), low, high)
        factors = factors.reshape(len(which), parts, line.N, line.N)
        while factors.shape[1] > 1:
            factors = factors[:, 1::2] @ factors[:, ::2]
        return factors[:, 0]

    def product_in(parts):
        groups = np.array_split(rough, max(1, -(-len(rough) * parts // _AT_ONCE)))
        return np.concatenate([product_of(which, parts) for which in groups])

    rough = np.arange(len(ends))
    result = product_in(1)
    for depth in range(1, _DEEPEST + 1):
        product = product_in(2**depth)
        off = np.abs(product - result[rough]).max(axis=(1, 2), initial=0.0)
        result[rough] = product
        rough = rough[~(off <= _TOLERANCE * (1 + np.abs(product).max(axis=(1, 2), initial=0.0)))]
        if not rough.size:
            break
    return result


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
