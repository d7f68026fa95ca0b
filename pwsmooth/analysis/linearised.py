"""The linearised flow of a model between events: Jacobians in states and chosen parameters, w = (x, q).

    x' = f(t, x, lam; q),   g(t, x, lam; q) = 0 for the solved multipliers J
    A  = f_w + f_J lam_w,   lam_w = -(g_JJ)**-1 g_Jw                        (lambda eliminated while sliding)

Chain: Model -> **Linearised** (numpy functions of it) -> variations.py, saltation.py.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.model import Model
from ..definition.regularity import total_derivative
from ..results.outputs import vectorised

__all__ = ["Blocks", "Linearised", "linearise"]


@dataclass(frozen=True)
class Blocks:
    """Jacobian blocks of a model at nt points; N states and chosen parameters, m multipliers.

    Attributes
    ----------
    f : ndarray, shape (nt, n)
        Rates, in the units of the model, as all of these.
    f_w : ndarray, shape (nt, n, N)
        By states and parameters, units of f over theirs.
    f_lam : ndarray, shape (nt, n, m)
        By multipliers, units of f over theirs.
    g_w : ndarray, shape (nt, m, N)
        Of the multipliers' residuals, by states and parameters, in the units of the model.
    g_t : ndarray, shape (nt, m)
        By time, in the units of the model.
    g_lam : ndarray, shape (nt, m, m)
        By multipliers, in the units of the model.

    Examples
    --------
    >>> import numpy as np
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.analysis.linearised import linearise
    >>> x, v = sp.symbols("x v", real=True)
    >>> line = linearise(System({x: v, v: -4 * x}).model)
    >>> line.blocks(np.zeros(1), np.ones((2, 1)), np.empty((0, 1)), np.empty(0)).f_w.tolist()
    [[[0.0, 1.0], [-4.0, 0.0]]]
    """

    f: np.ndarray  # (nt, n)
    f_w: np.ndarray  # (nt, n, N)
    f_lam: np.ndarray  # (nt, n, m)
    g_w: np.ndarray  # (nt, m, N)
    g_t: np.ndarray  # (nt, m)
    g_lam: np.ndarray  # (nt, m, m)

    def solved(self, J: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the solved multipliers.

        Parameters
        ----------
        J : sequence of int
            Which are solved.

        Returns
        -------
        lam_w : ndarray, shape (nt, nJ, N)
            By states and parameters, in the units of the model.
        lam_t : ndarray, shape (nt, nJ)
            By time, in the units of the model.
        """
        square = self.g_lam[:, J][:, :, J]
        right = np.concatenate([self.g_w[:, J], self.g_t[:, J, None]], axis=2)
        slopes = -np.linalg.solve(square, right)
        return slopes[:, :, :-1], slopes[:, :, -1]

    def flow(self, J: Sequence[int]) -> np.ndarray:
        """The Jacobian A of the flow, the solved multipliers eliminated.

        Parameters
        ----------
        J : sequence of int
            Which are solved.

        Returns
        -------
        ndarray, shape (nt, n, N)
            f_w + f_J lam_w, in the units of the model.
        """
        if len(J) == 0:
            return self.f_w
        return self.f_w + self.f_lam[:, :, J] @ self.solved(J)[0]


def _symbols(value: Any, what: str) -> tuple[sp.Symbol, ...]:
    test = checks.instance(sp.Symbol, "Symbols of parameters")
    return tuple(test(symbol, what) for symbol in checks.several(value, what))


class Linearised:
    """Numpy functions of a model's Jacobians.

    Parameters
    ----------
    model : Model
        Of a System, `system.model`.
    parameters : tuple of Symbol
        The parameters q with respect to which is differentiated, after the states.

    Notes
    -----
    With x' = f and g = 0 for the solved multipliers J: A = f_w - f_J (g_JJ)^-1 g_Jw.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.analysis.linearised import Linearised
    >>> x, k = sp.symbols("x k", positive=True)
    >>> line = Linearised(System({x: -k * x}, parameters={k: 2}).model, (k,))
    >>> line.n, line.m, line.N
    (1, 0, 2)
    """

    @checks.door(model=checks.instance(Model, "the `model` of a System"), parameters=_symbols)
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
        """The Jacobians at nt points.

        Parameters
        ----------
        t : ndarray, shape (nt,)
            Times, in the units of the model, as all of these.
        x : ndarray, shape (n, nt)
            States, in the units of the model.
        mult : ndarray, shape (m, nt)
            Multipliers, in the units of the model.
        p : ndarray, shape (np,)
            One value for each of `model.parameters`, in its unit.

        Returns
        -------
        Blocks
            With nt as leading axis.
        """
        n, m, N, nt = self.n, self.m, self.N, len(t)
        values = self._blocks(t, x, mult, p)
        shapes = [(n,), (n, N), (n, m), (m, N), (m,), (m, m)]
        sizes = np.cumsum([0, *(int(np.prod(s)) for s in shapes)])
        return Blocks(
            *(values[a:b].T.reshape(nt, *shape) for a, b, shape in zip(sizes[:-1], sizes[1:], shapes))
        )

    def solved(self, status: np.ndarray) -> list[int]:
        """Which multipliers are solved at a status.

        Parameters
        ----------
        status : ndarray of int8, shape (m,)
            A column of `Solution.status`; dimensionless.

        Returns
        -------
        list of int
            Their indices.
        """
        return [j for j in range(self.m) if status[j] == 0 and self.solvable[j]]

    # ---- at instants

    def gradient(self, surface: sp.Expr, t: float, x: Any, mult: Any, p: Any) -> tuple[np.ndarray, ...]:
        """Derivatives of a surface at one point.

        Parameters
        ----------
        surface : Expr
            h(t, x, lam; p).
        t : float, in the unit of the model's time
            Time.
        x : ndarray, shape (n,)
            States, in the units of the model.
        mult : ndarray, shape (m,)
            Multipliers, in the units of the model.
        p : ndarray, shape (np,)
            One value for each of `model.parameters`, in its unit.

        Returns
        -------
        h_w : ndarray, shape (N,)
            By states and parameters, in units of h over theirs.
        h_t : float
            By time, in units of h over time.
        h_lam : ndarray, shape (m,)
            By multipliers, in units of h over theirs.
        """
        values = _gradient(self.model, self.chosen, surface)(np.array([t]), x[:, None], mult[:, None], p)[:, 0]
        return values[: self.N], values[self.N], values[self.N + 1 :]

    def speed(self, index: int) -> sp.Expr:
        """Rate dh/dt of a contact's gap.

        Parameters
        ----------
        index : int
            Of the multiplier.

        Returns
        -------
        Expr
            In the unit of the gap over time.
        """
        model = self.model
        return total_derivative(model.multipliers[index].surface, model.time, model.states, model.rhs)

    def jump(self, new: tuple[sp.Expr, ...], t: float, x: Any, mult: Any, p: Any) -> tuple[np.ndarray, ...]:
        """A reset R(t, x) and its derivatives at one point.

        Parameters
        ----------
        new : tuple of Expr
            The state after, one expression a state.
        t : float, in the unit of the model's time
            Time.
        x : ndarray, shape (n,)
            States before, in the units of the model.
        mult : ndarray, shape (m,)
            Multipliers, in the units of the model.
        p : ndarray, shape (np,)
            One value for each of `model.parameters`, in its unit.

        Returns
        -------
        R : ndarray, shape (n,)
            States after, in the units of the model.
        R_w : ndarray, shape (n, N)
            By states and parameters, in the units of the model.
        R_t : ndarray, shape (n,)
            By time, in the units of the model.
        """
        values = _jump(self.model, self.chosen, new)(np.array([t]), x[:, None], mult[:, None], p)[:, 0]
        n, N = self.n, self.N
        return values[:n], values[n : n + n * N].reshape(n, N), values[n + n * N :]


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
def _jump(model: Model, chosen: tuple[sp.Symbol, ...], new: tuple[sp.Expr, ...]) -> Any:
    w = (*model.states, *chosen)
    return _stacked(model, [*new, *(e.diff(s) for e in new for s in w), *(e.diff(model.time) for e in new)])


@checks.door(model=checks.instance(Model, "the `model` of a System"), parameters=_symbols)
@functools.lru_cache(maxsize=64)
def linearise(model: Model, parameters: tuple[sp.Symbol, ...] = ()) -> Linearised:
    """The `Linearised` of a model, kept: its functions take longer to make than to use.

    Parameters
    ----------
    model : Model
        Of a System, `system.model`.
    parameters : tuple of Symbol
        The parameters with respect to which is differentiated, after the states.

    Returns
    -------
    Linearised
        The same object for the same model and parameters.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.analysis.linearised import linearise
    >>> x = sp.Symbol("x", real=True)
    >>> model = System({x: -x}).model
    >>> linearise(model) is linearise(model)
    True
    """
    return Linearised(model, parameters)
