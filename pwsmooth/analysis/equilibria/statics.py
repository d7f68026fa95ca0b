"""The equations of equilibria in one mode, and Newton's method from many starts at once.

    F = (f(x, lam), h_J(x, lam), c(x)) = 0,   u = (x, lam_J),   lam_j = 1 or -1, R_j = 0 for what is not held

c are the constraints of a mechanism. Its equations keep their rates alone: at rest they hold for any length of a rod.

A mode says of every multiplier on which side of its surface it is: 1 or -1, or 0 where it is held there (a closed
contact, an algebraic unknown). A disc slips, 1, or is held; its components are unknowns, 0. In a mode the equations are
smooth.

Chain: linearised.py, disc_modes.py, stability.py -> **statics** -> equilibrium.py, continuation/equilibria/problem.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from ...paths.derivatives.linearised import linearise
from .disc_modes import Sides, along_slip, completed, idle, in_mode, places, unknowns
from .stability import beside, margins

MOST_NEWTON = 60
_CONVERGED = 1e-10  # of a full step, relative: the error after it is its square
_UNDERFLOW = 1e-24  # what Newton's method leaves of a 0
ROUNDING = 1e-12  # of an equation, relative to the sum of its terms
_BALANCES = 6  # of rows and columns in turn
RANK = 1e-10  # of the smallest singular value to the largest: below it a direction is free


class Statics:
    """The equations of a mode, F = (f, h_J), and their derivatives by u = (x, lam_J) and, if given, parameters q."""

    def __init__(
        self, system: Any, sides: Sides, memories: np.ndarray, q: tuple[sp.Symbol, ...] = (), unit: Any = 1.0
    ) -> None:
        model = system.model
        self.system, self.sides, self.q, self.memories = system, sides, q, memories
        self.line = linearise(in_mode(model, sides), q)
        self.n, self.m = len(model.states) - model.n_memory, len(model.multipliers)
        self.J = unknowns(model, sides)
        # An open contact has side 1 and the reaction 0.
        self.fixed = np.array(
            [side if mu.kind == "switch" else 0 for mu, side in zip(model.multipliers, sides)], float
        )
        self.p = np.array(system.parameter_values, float)
        held = list(model.parameters)
        self.places = [(held.index(p), k) for k, p in enumerate(q) if p in held]
        self.size = self.n + len(self.J)  # of (x, lam_J)
        self.tied = bool(system._constraints)
        self.unit = np.ones(self.size)  # in which unknowns are counted
        self.unit[: self.n] = unit

    def parts(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x (states, K), multipliers (m, K) and parameters at the rows of u."""
        x = np.empty((self.n + len(self.memories), len(u)))
        x[: self.n], x[self.n :] = u[:, : self.n].T, self.memories[:, None]
        mult = np.repeat(self.fixed[:, None], len(u), axis=1)
        mult[self.J] = u[:, self.n : self.size].T
        p = self.p
        if self.places and u.shape[1] > self.size:
            p = p.copy()
            for place, k in self.places:
                p[place] = u[0, self.size + k]  # of one row only
        return x, mult, p

    def at(self, u: np.ndarray) -> Any:
        """The system at the parameters of u (N,); ValueError outside of their assumptions."""
        return (
            self.system.with_parameters(dict(zip(self.q, map(float, u[self.size :]))))
            if self.q
            else self.system
        )

    def unknowns(self, x: np.ndarray, mult: np.ndarray, p: np.ndarray | None = None) -> np.ndarray:
        """u (size,) at the states (n,) and the multipliers (m,) of an equilibrium, and at other parameters."""
        mult = completed(self.line, self.sides, x[:, None], mult[:, None], self.p if p is None else p)[:, 0]
        return np.concatenate([x[: self.n], mult[self.J]])

    def along_slip(self, u: np.ndarray, against: Any = False) -> np.ndarray:
        """The rows of u with lambda = h/|h| for discs that slip, or its opposite."""
        x, mult, p = self.parts(u)
        u = u.copy()
        u[:, self.n : self.size] = along_slip(self.line, self.sides, x, mult, p, against)[self.J].T
        return u

    def bounded(self, u: np.ndarray) -> np.ndarray:
        """The rows of u with what is held within its bounds: lambda in [-1, 1] or the unit disc, reactions >= 0."""
        u, multipliers = u.copy(), self.system.model.multipliers
        held = {j: k for k, j in enumerate(self.J, self.n) if self.sides[j] == 0}
        for j, k in held.items():
            if multipliers[j].kind in ("switch", "contact"):
                u[:, k] = u[:, k].clip(*((0.0, None) if multipliers[j].kind == "contact" else (-1.0, 1.0)))
        for own, parts in places(self.system.model):
            if own in held:
                columns = [held[j] for j in parts]
                u[:, columns] /= np.maximum(np.linalg.norm(u[:, columns], axis=1, keepdims=True), 1.0)
                u[:, held[own]] = (u[:, columns] ** 2).sum(axis=1)
        return u

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (K, M) and DF (K, M, N) at the rows of u (K, N).

        Where F has no derivative, as at the tip of a cone |v|, it is one of those beside the point.
        """
        F, DF = self._at(u)
        tip = np.isfinite(F).all(axis=1) & ~np.isfinite(DF).all(axis=(1, 2))
        if tip.any():
            aside = u[tip]
            aside[:, : self.n] += beside(aside.shape[0], self.n) * self.unit[: self.n]
            DF[tip] = self._at(aside)[1]
        return F, DF

    def _at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, mult, p = self.parts(u)
        blocks = self.line.blocks(np.zeros(len(u)), x, mult, p)
        c, c_w, c_lam = self.line.constraints(np.zeros(len(u)), x, mult, p)
        n, J, own = self.n, self.J, len(x)
        kept, kept_w = self.line.values(self.system._constraints, np.zeros(len(u)), x, mult, p)
        F = np.concatenate([blocks.f[:, :n], c[:, J], kept], axis=1)
        w = np.concatenate([blocks.f_w[:, :n], c_w[:, J], kept_w], axis=1)
        lam = np.concatenate([blocks.f_lam[:, :n], c_lam[:, J], np.zeros((*kept.shape, len(mult)))], axis=1)
        return F, np.concatenate([w[:, :, :n], lam[:, :, J], w[:, :, own:]], axis=2)

    def margins(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far u (N,) is inside its mode, for each multiplier, what counts as nothing, and the gradient by u."""
        x, mult, p = self.parts(u[None])
        inside, on = margins(self.line, x[:, 0], mult[:, 0], p, self.sides)
        _, c_w, c_lam = (part[0] for part in self.line.constraints(np.zeros(1), x, mult, p))
        slopes = np.zeros((self.m, len(u)))
        for j, mu in enumerate(self.system.model.multipliers):
            if mu.kind == "disc":
                # Of the speed of slip, or of |lambda|, whose square is the unknown.
                own = 1.0 if self.sides[j] else -0.5 / math.sqrt(max(mult[j, 0], _UNDERFLOW))
                slopes[j, self.n + self.J.index(j)] = own
            elif mu.kind == "component":
                continue
            elif self.sides[j]:
                by_u = np.concatenate([c_w[j, : self.n], c_lam[j, self.J], c_w[j, x.shape[0] :]])
                slopes[j] = self.sides[j] * by_u
            elif mu.kind != "algebraic":
                slopes[j, self.n + self.J.index(j)] = 1.0 if mu.kind == "contact" else -np.sign(mult[j, 0])
        return inside, on, slopes

    def free(self, DF: np.ndarray) -> np.ndarray:
        """Unit directions, as rows, in which the equations with these derivatives leave the unknowns free."""
        rows = free_directions(DF[:, : self.size] * self.unit, self.tied)
        alike = [self.n + self.J.index(c) for c in idle(self.system.model)]
        if alike and len(rows):  # at rest any direction of lambda does
            others = np.delete(rows, alike, axis=1)
            left, sizes, _ = np.linalg.svd(others)
            rows = left[:, : len(sizes)][:, sizes > RANK].T @ rows
        rows = rows * self.unit
        return rows / np.linalg.norm(rows, axis=1, keepdims=True)

    def error(self, F: np.ndarray, DF: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Largest |F| relative to the terms of its derivative, (K,): a few roundings at a solution."""
        unit = np.ones(u.shape[1])
        unit[: self.size] = self.unit
        terms = (np.abs(DF) * (unit + np.abs(u))[:, None, :]).sum(axis=2)
        return (np.abs(F) / np.where(terms > 0, terms, 1.0)).max(axis=1, initial=0.0)


def beyond(mu: Any, side: int, value: float) -> int:
    """The side of a multiplier beyond the border of a mode in which it has this side and, if held, this value."""
    if mu.kind in ("contact", "disc"):
        return 1 - side
    if side == 0:
        return int(np.sign(value))
    return -side if mu.regularity == "kink" else 0


@np.errstate(all="ignore")
def newton(statics: Statics, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method from the rows of u (K, N): solutions, their errors (inf where none) and steps.

    Pseudo-inverses, so that it also meets solutions that are not isolated. A step is halved while the next one, with
    the same matrix, would be longer (Deuflhard's natural monotonicity test).
    """
    u, K = u.copy(), len(u)
    errors, counts, going = np.full(K, math.inf), np.zeros(K, int), np.arange(K)
    for count in range(MOST_NEWTON + 1):
        F, DF = statics(u[going])
        finite = np.isfinite(F).all(axis=1) & np.isfinite(DF).all(axis=(1, 2))
        going, F, DF = going[finite], F[finite], DF[finite]
        if not going.size:
            break
        scaled = DF * statics.unit
        rows, columns = balance(scaled, statics.tied)
        even = scaled / rows[:, :, None] / columns[:, None, :]
        inverse = np.linalg.pinv(even, rcond=RANK) / rows[:, None, :] / columns[:, :, None]
        step = -(inverse @ F[:, :, None])[:, :, 0]  # in units
        at = u[going] / statics.unit
        size = np.abs(step / (1 + np.abs(at))).max(axis=1, initial=0.0)
        errors[going], counts[going] = statics.error(F, DF, u[going]), count
        # Near a double solution steps shrink slowly, and what is left is rounding.
        done = (size <= _CONVERGED) & (errors[going] <= ROUNDING)
        u[going[done]] += step[done] * statics.unit
        if count == MOST_NEWTON or done.all():
            break
        going, inverse, step, at = going[~done], inverse[~done], step[~done], at[~done]
        length = np.linalg.norm(step, axis=1)
        part, waiting = np.ones(len(going)), np.ones(len(going), bool)
        for _ in range(4):
            trial = statics((at[waiting] + part[waiting, None] * step[waiting]) * statics.unit)[0]
            ahead = np.linalg.norm((inverse[waiting] @ trial[:, :, None])[:, :, 0], axis=1)
            worse = ~(ahead < length[waiting])
            waiting[np.flatnonzero(waiting)[~worse]] = False
            if not waiting.any():
                break
            part[waiting] *= 0.5
        u[going] = (at + part[:, None] * step) * statics.unit
    errors[(errors > ROUNDING) | ~np.isfinite(u).all(axis=1)] = math.inf
    u[np.abs(u) < _UNDERFLOW] = 0.0
    return u, errors, counts


def balance(DF: np.ndarray, tied: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Sizes of the rows, and of the columns if `tied`, of matrices (K, M, N): (K, M) and (K, N).

    Under constraints there are unknown forces, whose size no start tells: 1/length of a rod and more.
    """
    rows, columns = np.ones(DF.shape[:2]), np.ones((DF.shape[0], DF.shape[2]))
    for _ in range(_BALANCES if tied else 1):
        largest = np.abs(DF / columns[:, None, :]).max(axis=2, initial=0.0)
        rows = np.where(largest > 0, largest, 1.0)
        if tied:
            largest = np.abs(DF / rows[:, :, None]).max(axis=1, initial=0.0)
            columns = np.where(largest > 0, largest, 1.0)
    return rows, columns


def free_directions(DF: np.ndarray, tied: bool = False) -> np.ndarray:
    """Directions, as rows, in which the equations with these derivatives (M, N) leave the unknowns free."""
    (rows,), (columns,) = balance(DF[None], tied)
    sizes, right = np.linalg.svd(DF / rows[:, None] / columns)[1:]
    return right[np.sum(sizes > RANK * sizes.max(initial=1.0)) :] / columns
