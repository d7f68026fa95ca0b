"""Capture in a layer with a state of its own: does the arriving orbit pass above the saddle's stable manifold?

    w' = g(L(w), z) ,   z' = r Q(L(w), z),    from w = -inf;    lambda = -s L(w), s the side of arrival, g > 0 at L = -1

at an instant of arrival, the slow states frozen. Where g(L, z*(L)) = 0, z* the zero of Q, has a node and behind it a
saddle, both the arriving orbit and the saddle's stable manifold are graphs z(w) up to the node, compared at w = 0: what
comes above it, where the hidden term opposes the motion, is captured. capture.py has the same of the friction law.

With the saddle's place w_s as an unknown (g shifted such that the saddle is there) the comparison is regular up to the
point at which it meets the node, and beyond.

Chain: results/outputs.py -> **separatrix** -> captures.py.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import Model
from ...definition.sigmoids import sigmoid
from ...results.outputs import vectorised

_LOOKED = 2001  # places in (-1, 1) at which node and saddle are looked for
_OFF = 1e-5  # along the tangent: the curvature's share, 1e-10, shrinks further on the way back from the saddle
_LENGTHS = 60  # after so many decay lengths any start has been forgotten


@dataclass(frozen=True)
class FrozenLayer:
    """The layer of one switch with one state, at an instant."""

    functions: Any
    shape: tuple[Any, Any]  # L(w), L'(w)
    before: tuple[float, ...]  # t, x, the multipliers before the switch's own
    behind: tuple[float, ...]  # multipliers behind it, parameters
    side: int
    stretch: float  # of time, for the switch's own width
    ratio: float

    def at(self, level: float, z: float) -> list[float]:
        """g, Q and z* at L(w) = level, and their slopes g_L, g_z, Q_L, Q_z."""
        lam = -self.side * level
        g, Q, rest, g_l, g_z, Q_l, Q_z = self.functions(*self.before, lam, *self.behind, z)
        s, k = self.side, self.stretch
        return [-s * g / k, Q, rest, g_l / k, -s * g_z / k, -s * Q_l, Q_z]

    def still(self, level: float) -> float:
        """g where Q is 0."""
        return float(self.at(level, self.at(level, 0.0)[2])[0])

    def saddle(self) -> float | None:
        """asinh of w at the saddle behind the node; None where there is none."""
        from scipy.optimize import brentq

        levels = np.sin(0.5 * math.pi * np.linspace(-1, 1, _LOOKED))[1:-1]
        values = np.array([self.still(level) for level in levels])
        down = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
        if not down.size:
            return None
        up = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
        up = up[up > down[0]]
        if not up.size:
            return None
        level = float(brentq(self.still, levels[up[0]], levels[up[0] + 1], xtol=1e-15))
        place = brentq(lambda s: self.shape[0](math.sinh(s)) - level, -40, 40, xtol=1e-14)
        return float(place)

    def clearance(self, place: float) -> float:
        """Height at w = 0 of the arriving orbit above the manifold of a saddle at w = sinh(place)."""
        found = (self._clearance(place, rtol) for rtol in (1e-11, 3e-11, 1e-10))
        return next((height for height in found if math.isfinite(height)), math.nan)

    def _clearance(self, place: float, rtol: float) -> float:
        from scipy.integrate import odeint

        shape, slope = self.shape
        w = math.sinh(place)
        level = shape(w)
        z = float(self.at(level, 0.0)[2])
        g, _, _, g_l, g_z, Q_l, Q_z = self.at(level, z)
        shift = float(g)

        def rate(height: np.ndarray, s: float) -> float:
            there = self.at(shape(math.sinh(s)), height[0])
            return math.cosh(s) * self.ratio * there[1] / (there[0] - shift)

        tolerances = dict(rtol=rtol, atol=1e-14, mxstep=100000, hmax=0.1)
        first = self.at(-1.0, 0.0)
        decay = self.ratio * abs(self.at(-1.0, first[2])[6]) / max(first[0] - shift, 1e-300)
        start = -math.asinh(10 + _LENGTHS / max(decay, 1e-12))
        begin = float(self.at(shape(math.sinh(start)), 0.0)[2])
        arriving = odeint(rate, begin, [start, 0.0], **tolerances)[-1, 0]
        # The stable eigenvalue m of ((g_L L', g_z), (r Q_L L', r Q_z)), its direction dz/dw = (m - g_L L')/g_z.
        a, d, c = g_l * slope(w), self.ratio * Q_z, self.ratio * Q_l * slope(w)
        root = ((a - d) / 2) ** 2 + g_z * c
        if root < 0 or g_z == 0:
            return math.nan
        m = (a + d) / 2 - math.sqrt(root)
        direction = (m - a) / g_z
        near = place - _OFF
        manifold = odeint(rate, z + direction * (math.sinh(near) - w), [near, 0.0], **tolerances)[-1, 0]
        return float(arriving - manifold)

    def turn(self, place: float) -> float:
        """d g(L, z*(L))/dL at a place: 0 where saddle and node meet."""
        level = self.shape[0](math.sinh(place))
        z = self.at(level, 0.0)[2]
        _, _, _, g_l, g_z, Q_l, Q_z = self.at(level, z)
        return float(g_l - g_z * Q_l / Q_z)


def frozen(
    model: Model, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
) -> FrozenLayer:
    """The layer of switch j at an arrival from a side."""
    state = next(z for z in model.layer_states if z.ratio not in (sp.oo, 0))
    ratio = float(p[model.parameters.index(state.ratio)])
    return FrozenLayer(
        _functions(model, j), _shape(model.sigmoid), (t, *x, *mult[:j]), (*mult[j + 1 :], *p), side,
        float(model.eps_ratio[j]) if model.eps_ratio else 1.0, ratio,
    )  # fmt: skip


def one_state(model: Model) -> bool:
    """Whether the layer has one state of a finite ratio, as a capture needs."""
    finite = [z for z in model.layer_states if z.ratio not in (sp.oo, 0)]
    return len(finite) == 1 == len(model.layer_states)


@functools.lru_cache(maxsize=16)
def _functions(model: Model, j: int) -> Any:
    (state,) = [z for z in model.layer_states if z.ratio not in (sp.oo, 0)]
    lam, z = model.multipliers[j].symbol, state.symbol
    g, Q = model.layer_residuals[j], state.rate
    parts = [g, Q, state.equilibrium, g.diff(lam), g.diff(z), Q.diff(lam), Q.diff(z)]
    return vectorised(model, sp.Tuple(*parts), (z,))


@functools.lru_cache(maxsize=8)
def _shape(name: str) -> tuple[Any, Any]:
    u = sp.Symbol("u", real=True)
    e = sigmoid(name).function(u)
    return sp.lambdify(u, e, modules=["math"]), sp.lambdify(u, e.diff(u), modules=["math"])
