"""Functions on the surface of a switch, of two coordinates and lambda; their roots and their lines.

    a -> x with h(x) = 0:   a state follows from the others, in which h is linear
    g(lam; a) = dh/dt,  the rates of the coordinates,  d2h/dt2 of the fields on both sides

Chain: paths/derivatives/linearised.py -> **switching_surface** -> portraits.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ...definition.regularity import total_derivative
from ...results.outputs import vectorised

_SAMPLES = 129  # of lambda: two roots nearer together than their distance are none
_BISECTIONS = 55
POLISHED = 8  # Newton steps of points of a line

Values = Callable[[np.ndarray, Any], np.ndarray]


class Surface:
    """Functions on the surface of one switch, of coordinates a (2, N) and lambda."""

    def __init__(self, system: Any, j: int, chosen: Sequence[sp.Symbol], at: Mapping[sp.Symbol, float]) -> None:
        model = system.model
        self.system, self.model, self.j, self.chosen = system, model, j, chosen
        self.mu = model.multipliers[j]
        self.lam = self.mu.symbol
        fixed = dict(at)
        self.time = fixed.pop(model.time, 0.0)
        (self.gone,) = [s for s in model.states if s not in chosen and s not in fixed]
        self.fixed = fixed
        slope = sp.simplify(self.mu.surface.diff(self.gone))
        if slope == 0 or self.gone in slope.free_symbols:
            raise ValueError(
                f"`box` leaves {self.gone} to follow from {self.mu.surface} = 0, which is not linear in it; choose "
                "other coordinates."
            )
        rest = self.mu.surface.subs(self.gone, 0)
        self.given = {self.gone: -rest / slope}

    def function(self, expressions: Sequence[sp.Expr]) -> Callable[[np.ndarray, Any], np.ndarray]:
        """(a (2, N), lambda (N,)) -> (number of expressions, N); nan where another contact would be closed."""
        f = vectorised(self.model, sp.Tuple(*(sp.sympify(e).xreplace(self.given) for e in expressions)))
        others = [m.surface.xreplace(self.given) for m in self._others]
        sides = vectorised(self.model, sp.Tuple(*others)) if others else None
        p = self.system.parameter_values

        def evaluate(a: np.ndarray, lam: Any) -> np.ndarray:
            count = a.shape[1]
            values = {**self.fixed, **dict(zip(self.chosen, a))}
            t = values.get(self.model.time, self.time)
            x = [values.get(s, np.zeros(count)) for s in self.model.states]
            mult = np.zeros((len(self.model.multipliers), count))
            mult[self.j] = lam
            closed = np.zeros(count, bool)
            if sides is not None:
                for m, h in zip(self._others, sides(t, *x, *mult, *p)):
                    if m.kind == "contact":
                        closed |= np.broadcast_to(h < 0, count)
                    else:
                        mult[self.model.multipliers.index(m)] = np.where(np.asarray(h) >= 0, 1.0, -1.0)
            out = np.empty((len(expressions), count))
            with np.errstate(all="ignore"):
                for row, value in zip(out, f(t, *x, *mult, *p)):
                    row[:] = value
            out[:, closed] = np.nan
            return out

        return evaluate

    @functools.cached_property
    def _others(self) -> list[Any]:
        return [m for k, m in enumerate(self.model.multipliers) if k != self.j]

    @functools.cached_property
    def g(self) -> sp.Expr:
        return self.mu.residual.xreplace(self.given)

    @functools.cached_property
    def rates(self) -> list[sp.Expr]:
        model = self.model
        own = dict(zip(model.states, model.rhs))
        return [sp.Integer(1) if s == model.time else own[s] for s in self.chosen]

    def turn(self, side: int) -> sp.Expr:
        """d2h/dt2 of the field on a side."""
        model = self.model
        f = [rate.xreplace({self.lam: sp.Integer(side)}) for rate in model.rhs]
        speed = total_derivative(self.mu.surface, model.time, model.states, f)
        return total_derivative(speed, model.time, model.states, f)


def roots_of(g: Values, grid: np.ndarray) -> np.ndarray:
    """Roots of g(lambda) in [-1, 1] at every point, (most, N), in order; nan where there are fewer."""
    lams = np.linspace(-1, 1, _SAMPLES)
    values = np.array([g(grid, lam) for lam in lams])
    turns = values[:-1] * values[1:] < 0
    turns |= values[1:] == 0
    turns[0] |= values[0] == 0
    turns[:, (values == 0).all(axis=0)] = False  # a two-fold: any lambda will do
    most = int(turns.sum(axis=0).max(initial=0))
    found = np.full((most, grid.shape[1]), np.nan)
    place = np.cumsum(turns, axis=0) - 1
    k, n = np.nonzero(turns)
    low, high, a = lams[k].copy(), lams[k + 1].copy(), grid[:, n]
    rising = values[k, n] < 0
    rising |= (values[k, n] == 0) & (values[k + 1, n] > 0)
    for _ in range(_BISECTIONS if len(n) else 0):
        middle = (low + high) / 2
        past = (g(a, middle) >= 0) == rising
        high, low = np.where(past, middle, high), np.where(past, low, middle)
    found[place[k, n], n] = (low + high) / 2
    return found


def contours(axes: list[np.ndarray], values: np.ndarray) -> list[np.ndarray]:
    """Lines (2, N) on which values on the grid are 0."""
    from contourpy import contour_generator

    masked = np.ma.masked_invalid(values)
    lines: Any = contour_generator(axes[0], axes[1], masked).lines(0.0)
    return [line.T for line in lines if len(line) > 1]


def onto(test: Values, line: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """Points put onto F = 0 along its gradient: `test` gives F and its two slopes."""
    for _ in range(POLISHED):
        F, *slopes = test(line, None)
        size = sum((slope * span) ** 2 for slope, span in zip(slopes, spans))
        step = (
            np.array([slope * span**2 for slope, span in zip(slopes, spans)])
            * F
            / np.where(size > 0, size, np.inf)
        )
        line = line - np.where(np.isfinite(step), step, 0.0)
    return line
