"""The linearised flow of a model between events: Jacobians in states and chosen parameters, w = (x, q).

    x' = f(t, x, lam; q),   g(t, x, lam; q) = 0 for the solved multipliers J
    A  = f_w + f_J lam_w,   lam_w = -(g_JJ)**-1 g_Jw                        (lambda eliminated while sliding)

Chain: Model -> **Linearised** (numpy functions of it) -> saltation.py, collocation.py.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import Model
from ...definition.regularity import total_derivative
from ...results.outputs import vectorised

_NEWTON = 8  # steps for unknowns, which are those of linear equations as a rule


@dataclass(frozen=True)
class Blocks:
    """Jacobian blocks of a model at nt points, by N states and chosen parameters, m multipliers and the time."""

    f: np.ndarray  # (nt, n)
    f_w: np.ndarray  # (nt, n, N)
    f_lam: np.ndarray  # (nt, n, m)
    g_w: np.ndarray  # (nt, m, N)
    g_t: np.ndarray  # (nt, m)
    g_lam: np.ndarray  # (nt, m, m)

    def solved(self, J: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """lam_w (nt, nJ, N) and lam_t (nt, nJ) of the multipliers J."""
        square = self.g_lam[:, J][:, :, J]
        right = np.concatenate([self.g_w[:, J], self.g_t[:, J, None]], axis=2)
        slopes = -np.linalg.solve(square, right)
        return slopes[:, :, :-1], slopes[:, :, -1]

    def flow(self, J: Sequence[int]) -> np.ndarray:
        """The Jacobian A (nt, n, N) of the flow, the multipliers J eliminated."""
        if len(J) == 0:
            return self.f_w
        return self.f_w + self.f_lam[:, :, J] @ self.solved(J)[0]


class Linearised:
    """Numpy functions of a model's Jacobians by its states and these parameters."""

    def __init__(self, model: Model, parameters: tuple[sp.Symbol, ...] = ()) -> None:
        self.model, self.chosen = model, parameters
        self.w = (*model.states, *parameters)
        self.n, self.m, self.N = len(model.states), len(model.multipliers), len(self.w)
        self.symbols = [mu.symbol for mu in model.multipliers]
        # Another switch stands at 0 only after an accumulation, where it is held, not solved.
        self.solvable = [
            mu.kind != "switch" or mu.regularity == "sliding" or mu.second is not None
            for mu in model.multipliers
        ]

    # ---- along the flow

    @functools.cached_property
    def _blocks(self) -> Any:
        model = self.model
        f, g = list(model.rhs), [mu.condition for mu in model.multipliers]
        parts = [
            f,
            [e.diff(s) for e in f for s in self.w],
            [e.diff(s) for e in f for s in self.symbols],
            [e.diff(s) for e in g for s in self.w],
            [e.diff(model.time) for e in g],
            [e.diff(s) for e in g for s in self.symbols],
        ]
        return _stacked(model, [e for part in parts for e in part])

    def blocks(self, t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> Blocks:
        """At t (nt,), x (n, nt), mult (m, nt) and the values p of `model.parameters`."""
        n, m, N, nt = self.n, self.m, self.N, len(t)
        values = self._blocks(t, x, mult, p)
        shapes = [(n,), (n, N), (n, m), (m, N), (m,), (m, m)]
        sizes = np.cumsum([0, *(int(np.prod(s)) for s in shapes)])
        return Blocks(
            *(values[a:b].T.reshape(nt, *shape) for a, b, shape in zip(sizes[:-1], sizes[1:], shapes))
        )

    @functools.cached_property
    def _constraints(self) -> Any:
        c = [mu.residual if mu.surface is None else mu.surface for mu in self.model.multipliers]
        parts = [c, [e.diff(s) for e in c for s in self.w], [e.diff(s) for e in c for s in self.symbols]]
        return _stacked(self.model, [e for part in parts for e in part])

    def constraints(
        self, t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """What each multiplier keeps at 0, its surface or an unknown's equation: c (nt, m), c_w, c_lam."""
        m, N, nt = self.m, self.N, len(t)
        values = self._constraints(t, x, mult, p)
        parts = values[:m], values[m : m + m * N], values[m + m * N :]
        return tuple(part.T.reshape(nt, *shape) for part, shape in zip(parts, [(m,), (m, N), (m, m)]))

    def solved(self, status: np.ndarray) -> list[int]:
        """Which multipliers are solved at a status (m,)."""
        return [j for j in range(self.m) if status[j] == 0 and self.solvable[j]]

    def unknowns(self, t: float, x: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """The multipliers (m,) at one point, those that are always solved for by Newton's method and all others 0; the
        numbers of the former."""
        mult, J = np.zeros(self.m), [j for j, mu in enumerate(self.model.multipliers) if mu.kind == "algebraic"]
        for _ in range(_NEWTON if J else 0):
            c, _, c_lam = self.constraints(np.array([t]), x[:, None], mult[:, None], p)
            mult[J] -= np.linalg.solve(c_lam[0][np.ix_(J, J)], c[0, J])
        return mult, J

    # ---- at instants

    def gradient(self, surface: sp.Expr, t: float, x: Any, mult: Any, p: Any) -> tuple[np.ndarray, ...]:
        """Derivatives of a surface at one point: h_w (N,), h_t and h_lam (m,)."""
        values = _gradient(self.model, self.chosen, surface)(np.array([t]), x[:, None], mult[:, None], p)[:, 0]
        return values[: self.N], values[self.N], values[self.N + 1 :]

    def values(
        self, expressions: tuple[sp.Expr, ...], t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Expressions at points as those of `blocks`, (nt, k), and their derivatives by w, (nt, k, N)."""
        k, nt = len(expressions), len(t)
        found = _values(self.model, self.chosen, expressions)(t, x, mult, p)
        return found[:k].T, found[k:].T.reshape(nt, k, self.N)

    def speed(self, index: int) -> sp.Expr:
        """dh/dt of the surface of a multiplier."""
        model = self.model
        return total_derivative(model.multipliers[index].surface, model.time, model.states, model.rhs)

    def jump(
        self, new: tuple[sp.Expr, ...], t: float, x: Any, mult: Any, p: Any, J: Sequence[int]
    ) -> tuple[np.ndarray, ...]:
        """A reset R(t, x), an expression a state, at one point: R (n,), R_w (n, N) and R_t (n,), the multipliers J
        eliminated."""
        at = np.array([t]), x[:, None], mult[:, None], p
        values = _jump(self.model, self.chosen, new)(*at)[:, 0]
        n, N = self.n, self.N
        slopes = values[n:].reshape(n, N + 1 + self.m)
        R_w, R_t, R_lam = slopes[:, :N], slopes[:, N], slopes[:, N + 1 :][:, J]
        if R_lam.any():
            lam_w, lam_t = self.blocks(*at).solved(J)
            R_w, R_t = R_w + R_lam @ lam_w[0], R_t + R_lam @ lam_t[0]
        return values[:n], R_w, R_t


def _stacked(model: Model, expressions: Sequence[sp.Expr]) -> Any:
    """A function of (t (nt,), x (n, nt), mult (m, nt), p) -> (number of expressions, nt); zeros cost nothing."""
    alive = [i for i, e in enumerate(expressions) if e != 0]
    function = vectorised(model, sp.Tuple(*(expressions[i] for i in alive))) if alive else None

    def evaluate(t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> np.ndarray:
        out = np.zeros((len(expressions), len(t)))
        if function is not None:
            with np.errstate(all="ignore"):  # branches that are not selected may be undefined there
                for i, value in zip(alive, function(t, *x, *mult, *p)):
                    out[i] = value
        return out

    return evaluate


def rates(model: Model, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> np.ndarray:
    """f (n,) at a point."""
    return _rates(model)(np.array([t]), x[:, None], mult[:, None], p)[:, 0]


@functools.lru_cache(maxsize=64)
def _rates(model: Model) -> Any:
    return _stacked(model, model.rhs)


@functools.lru_cache(maxsize=256)
def _gradient(model: Model, chosen: tuple[sp.Symbol, ...], surface: sp.Expr) -> Any:
    symbols = [*model.states, *chosen, model.time, *(mu.symbol for mu in model.multipliers)]
    return _stacked(model, [surface.diff(s) for s in symbols])


@functools.lru_cache(maxsize=256)
def _values(model: Model, chosen: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Any:
    symbols = *model.states, *chosen
    return _stacked(model, [*expressions, *(e.diff(s) for e in expressions for s in symbols)])


@functools.lru_cache(maxsize=256)
def _jump(model: Model, chosen: tuple[sp.Symbol, ...], new: tuple[sp.Expr, ...]) -> Any:
    symbols = [*model.states, *chosen, model.time, *(mu.symbol for mu in model.multipliers)]
    return _stacked(model, [*new, *(e.diff(s) for e in new for s in symbols)])


@functools.lru_cache(maxsize=64)
def linearise(model: Model, parameters: tuple[sp.Symbol, ...] = ()) -> Linearised:
    """The `Linearised` of a model, kept: its functions take longer to make than to use."""
    return Linearised(model, parameters)
