"""Capture of a slipping contact into sticking: a separatrix of the two-dimensional layer system.

    u' = F - L(u)(1 + rho z),    z' = ratio (G(u) - z),    G = 1 - L**2,    from u = -inf, z = 0

with forces in units of the load N and the sign for which F > 0 opposes the arrival from u = -inf. For
1 < F < mu_s there are a node at lam < lam_s and a saddle at lam > lam_s; the contact is captured if the orbit
passes above the saddle's stable manifold. Both are graphs z(u) where u' > 0, so they are compared at u = 0.
At F = mu_s the two equilibria merge and the strong stable manifold takes the saddle's place: from
`critical_ratio` upwards the orbit passes above that one too, and the threshold *is* mu_s.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import sympy as sp

from ...definition.sigmoids import sigmoid as sigmoid_of
from ...door import checks

__all__ = ["capture_threshold", "critical_ratio"]

# L(u), L'(u), G(u) = 1 - L(u)**2 without cancellation in the tails.
Sigmoid = tuple[Callable[[float], float], Callable[[float], float], Callable[[float], float]]
_SIGMOIDS: dict[str, Sigmoid] = {
    "algebraic": (
        lambda u: u / math.sqrt(1 + u * u),
        lambda u: (1 + u * u) ** -1.5,
        lambda u: 1 / (1 + u * u),
    ),
    "tanh": (math.tanh, lambda u: _sech(u) ** 2, lambda u: _sech(u) ** 2),
    "erf": (
        math.erf,
        lambda u: 2 / math.sqrt(math.pi) * math.exp(-u * u),
        lambda u: math.erfc(abs(u)) * (1 + math.erf(abs(u))),
    ),
}


def _sech(u: float) -> float:
    e = math.exp(-abs(u))
    return 2 * e / (1 + e * e)


def _family(value: Any, what: str) -> str | sp.Expr:
    key: str | sp.Expr = sigmoid_of(value).key
    return key


@functools.lru_cache(maxsize=32)
def _shape(key: str | sp.Expr) -> Sigmoid:
    """Of an expression the tail's digits are those of 1 - L: F - 1 is good to 1e-16, and not relative to itself."""
    if isinstance(key, str):
        return _SIGMOIDS[key]
    (u,) = key.free_symbols
    level, slope = (sp.lambdify(u, e, modules=["math"]) for e in (key, key.diff(u)))
    return level, slope, lambda at: (1 - level(at)) * (1 + level(at))


_LARGEST = 1e6  # of rho: far beyond it the separatrix is no longer integrated to its tolerance


def _rho(value: Any, what: str) -> float:
    if (rho := checks.nonnegative(value, what)) > _LARGEST:
        raise ValueError(f"{what} is {rho:g}; give a strength of the hidden term up to {_LARGEST:g}.")
    return rho


@checks.door(rho=_rho, ratio=checks.extended, sigmoid=_family)
@checks.closed_form
def capture_threshold(rho: float, ratio: float, *, sigmoid: str | sp.Expr = "algebraic") -> float:
    """Largest opposing force, in units of N, at which a slipping contact is captured into sticking.

    Parameters
    ----------
    rho : float, dimensionless
        Strength of the hidden (static-friction) term, >= 0.
    ratio : float, dimensionless
        eps/beta, the layer's speed relative to the relaxation of z; 0 and inf are allowed.

    Returns
    -------
    float
        Between 1 (ratio 0, linear sticking) and mu_s(rho) (nonlinear sticking; reached at a finite ratio); in units
        of the load.

    Raises
    ------
    ValueError
        `rho` or `ratio` negative or nan, `rho` infinite, or an unknown `sigmoid`.

    Notes
    -----
    Separatrix of the two-dimensional layer system u' = F - L(u)(1 + rho z), z' = ratio (G(u) - z).

    Source: the layer system is that of Jeffrey, On the mathematical basis of solid friction; the threshold is
    computed here.

    >>> round(capture_threshold(3, 0.1), 6)
    1.456936
    """
    shape = _shape(sigmoid)
    if rho <= 0.5 or ratio == 0:
        return 1.0
    u_s = _fold_position(rho, shape)
    if ratio == math.inf or _clearance(rho, ratio, u_s, shape) >= 0:
        return 2 * rho * ((1 + rho) / (3 * rho)) ** 1.5  # mu_s

    # The unknown is the saddle's position u (in s = asinh u): F follows from it without solving for a root,
    # and F - 1 keeps its digits as the saddle moves to infinity (ratio -> 0).
    from scipy.optimize import brentq

    def clearance(s: float) -> float:
        return _clearance(rho, ratio, math.sinh(s), shape)

    # Short strides: erf comes within 1e-14 of 1 at u = 5.5 already.
    low, high = math.asinh(u_s), math.asinh(u_s) + 0.1
    while clearance(high) < 0:
        low, high = high, high + 0.1
        if _force(rho, math.sinh(high), shape) - 1 < 1e-14:
            return 1.0
    return _force(rho, math.sinh(brentq(clearance, low, high, xtol=1e-11, rtol=1e-12)), shape)


@checks.door(rho=_rho, sigmoid=_family)
@checks.closed_form
def critical_ratio(rho: float, *, sigmoid: str | sp.Expr = "algebraic") -> float:
    """Smallest eps/beta from which the capture threshold equals mu_s(rho): the nonlinear region captures.

    Parameters
    ----------
    rho : float, dimensionless
        Strength of the hidden term, > 1/2.

    Returns
    -------
    float
        The ratio eps/beta, dimensionless.

    Raises
    ------
    ValueError
        `rho` <= 1/2 (no fold, the threshold is 1 at every ratio), nan or infinite, or an unknown `sigmoid`.

    Source: computed here, from the strong stable manifold of the merged equilibria at F = mu_s.

    >>> round(critical_ratio(3), 4)
    0.6453
    """
    shape = _shape(sigmoid)
    if rho <= 0.5:
        raise ValueError(f"`rho` is {rho}; a fold, and with it a critical ratio, needs rho > 1/2.")
    from scipy.optimize import brentq

    u_s = _fold_position(rho, shape)

    def clearance(log_ratio: float) -> float:
        return _clearance(rho, math.exp(log_ratio), u_s, shape)

    low, high = -1.0, 0.0
    while clearance(low) > 0:
        low -= 1
    while clearance(high) < 0:
        high += 1
    return math.exp(brentq(clearance, low, high, xtol=1e-11))


def _force(rho: float, u: float, shape: Sigmoid) -> float:
    """The F that has an equilibrium at u, z = G(u)."""
    return shape[0](u) * (1 + rho * shape[2](u))


def _fold_position(rho: float, shape: Sigmoid) -> float:
    """u at which L(u) = lam_s."""
    from scipy.optimize import brentq

    # G(u) = 1 - lam_s**2, which stays accurate as lam_s -> 1 (rho -> 1/2).
    gamma_s = (2 * rho - 1) / (3 * rho)
    high = 1.0
    while shape[2](high) > gamma_s:
        high *= 2
    return brentq(lambda u: shape[2](u) - gamma_s, 0.0, high, xtol=1e-15)


def _clearance(rho: float, ratio: float, u_saddle: float, shape: Sigmoid) -> float:
    """Height at u = 0 of the arriving orbit above the stable manifold of the saddle at `u_saddle`."""
    # LSODA gives up at isolated saddles of erf, whose tails vanish; with another step sequence it does not.
    heights = (_height(rho, ratio, u_saddle, shape, rtol) for rtol in (1e-11, 3e-11, 1e-10))
    return next((height for height in heights if math.isfinite(height)), math.nan)


def _height(rho: float, ratio: float, u_saddle: float, shape: Sigmoid, rtol: float) -> float:
    import numpy as np
    from scipy.integrate import odeint

    level, slope, hidden = shape
    force = _force(rho, u_saddle, shape)
    sinh, cosh = math.sinh, math.cosh

    # z as a graph over s = asinh u: the tails of the algebraic sigmoid fill many decades of u.
    def rate(z: np.ndarray, s: float) -> float:
        u = sinh(s)
        return cosh(s) * ratio * (hidden(u) - z[0]) / (force - level(u) * (1 + rho * z[0]))

    # The orbit forgets its start as exp(-ratio u/(F + 1)): 60 of those lengths away any start does.
    start = -math.asinh(10 + 60 * (force + 1) / ratio)
    # Bounded steps: where tanh and erf vanish the error control sees nothing, and would step over the layer.
    tolerances = dict(rtol=rtol, atol=1e-14, mxstep=100000, hmax=0.1)
    arriving = odeint(rate, hidden(sinh(start)), [start, 0.0], **tolerances)[-1, 0]

    z = hidden(u_saddle)
    a, b = slope(u_saddle) * (1 + rho * z), rho * level(u_saddle)
    # G' = -2 L L'; the stable eigenvalue m of [[-a, -b], [-c, -ratio]] and its direction dz/du = -(a + m)/b.
    c = 2 * ratio * level(u_saddle) * slope(u_saddle)
    m = -(a + ratio) / 2 - math.sqrt(((a - ratio) / 2) ** 2 + b * c)
    direction = -(a + m) / b
    # 1e-5 off along the tangent: the curvature's share, 1e-10, shrinks further on the way back from the saddle.
    s_off = math.asinh(u_saddle) - 1e-5
    z_off = z + direction * (sinh(s_off) - u_saddle)
    manifold = odeint(rate, z_off, [s_off, 0.0], **tolerances)[-1, 0]
    return arriving - manifold
