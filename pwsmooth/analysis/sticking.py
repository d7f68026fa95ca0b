"""Where a contact sticks: folds of the friction coefficient, sticking regions, capture from slip.

    mu(lam) = lam (1 + rho gamma(lam)),     sticking where |k y - q''| <= N mu at v = 0

The linear region has mu = 1, the nonlinear one mu = mu_s, the height of the fold of mu(lam) at lam_s
(M. R. Jeffrey, On the mathematical basis of solid friction, eqs 16-19; the printed
mu_s = -rho dgamma/dv lam_s**2 means dgamma/dlam). Which of them captures a slipping contact is decided in the
layer: see `capture`.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from .capture import capture_threshold, critical_ratio

__all__ = [
    "Fold",
    "StickingRegion",
    "capture_threshold",
    "critical_ratio",
    "fold",
    "linear_sticking",
    "nonlinear_sticking",
]


@dataclass(frozen=True)
class Fold:
    """The fold at which the attracting branch of sticking through lam = 0 ends.

    `lam_s` is the root of d mu/d lam = 0, wherever it lies; `mu_s` the largest static coefficient, mu(lam_s) if
    `inside` (the fold lies in 0 < lam < 1) and mu(1) otherwise.
    """

    lam_s: sp.Expr
    mu_s: sp.Expr
    inside: sp.Basic


@dataclass(frozen=True)
class StickingRegion:
    """v = 0 and |k y - drive| <= N mu: where a contact can stick.

    Parameters
    ----------
    drive, stiffness, load, coefficient : Expr
        Base acceleration q''(t), k, N and mu (1 for the linear region, mu_s for the nonlinear one).
    """

    drive: sp.Expr
    stiffness: sp.Expr
    load: sp.Expr
    coefficient: sp.Expr

    @property
    def bounds(self) -> tuple[sp.Expr, sp.Expr]:
        """Smallest and largest displacement y at which the contact can stick."""
        half = self.load * self.coefficient
        return (self.drive - half) / self.stiffness, (self.drive + half) / self.stiffness

    def condition(self, y: sp.Expr) -> sp.Basic:
        """The region as a relation on the displacement `y`."""
        return sp.Le(sp.Abs(self.stiffness * y - self.drive), self.load * self.coefficient)


def linear_sticking(drive: sp.Expr, stiffness: sp.Expr, load: sp.Expr) -> StickingRegion:
    """Filippov's sliding region, all there is for rho = 0 (eq. 18)."""
    return StickingRegion(sp.sympify(drive), sp.sympify(stiffness), sp.sympify(load), sp.Integer(1))


def nonlinear_sticking(
    drive: sp.Expr, stiffness: sp.Expr, load: sp.Expr, gamma: sp.Expr, lam: sp.Symbol, rho: sp.Expr
) -> StickingRegion:
    """The sticking region with the hidden term at its equilibrium (eq. 19)."""
    mu_s = fold(gamma, lam, rho).mu_s
    return StickingRegion(sp.sympify(drive), sp.sympify(stiffness), sp.sympify(load), mu_s)


def fold(gamma: sp.Expr, lam: sp.Symbol, rho: sp.Expr) -> Fold:
    """Fold of mu(lam) = lam (1 + rho gamma(lam)) on the branch through lam = 0 (eqs 16 and 17).

    Parameters
    ----------
    gamma : Expr
        Even in `lam`, with gamma(1) = 0.
    lam : Symbol
    rho : Expr
        Strength of the hidden term; a symbol is taken as positive.

    Returns
    -------
    Fold
        In closed form where sympy finds one; otherwise in numbers, for which `gamma` and `rho` must be free of
        other symbols.

    Raises
    ------
    ValueError
        `gamma` does not vanish at lam = 1 or is not even; or symbols are left where there is no closed form or
        where several folds compete.

    Examples
    --------
    >>> import sympy as sp
    >>> lam, rho = sp.Symbol("lam"), sp.Symbol("rho", positive=True)
    >>> fold(1 - lam**2, lam, 3).mu_s
    16/9
    >>> fold(1 - lam**2, lam, rho).lam_s.subs(rho, 3)
    2/3
    """
    gamma, rho = sp.sympify(gamma), sp.sympify(rho)
    x = sp.Dummy("lam", positive=True)
    shape = gamma.subs(lam, x)
    if sp.simplify(shape.subs(x, 1)) != 0:
        raise ValueError(f"`gamma` is {gamma}, which does not vanish at {lam} = 1, so it is no hidden term.")
    if sp.simplify(gamma - gamma.subs(lam, -lam)) != 0:
        raise ValueError(f"`gamma` is {gamma}, which is not even in {lam}.")
    # A plain symbol for rho would hide that (1 + rho)/(3 rho) has a real root.
    positive = {s: sp.Symbol(s.name, positive=True) for s in rho.free_symbols if not s.is_positive}
    coefficient = x * (1 + rho.subs(positive) * shape)
    slope = sp.diff(coefficient, x)
    root = _first_positive_root(slope, x)
    if root is None:
        return Fold(sp.oo, sp.Integer(1), sp.false)
    inside = sp.Lt(slope.subs(x, 1), 0)
    if not slope.free_symbols - {x}:
        inside = sp.true if root < 1 else sp.false
    value = sp.simplify(coefficient.subs(x, root))
    if root.has(sp.Float):
        value = value.evalf()
    mu_s = sp.Piecewise((value, inside), (1, True))
    back = {new: old for old, new in positive.items()}
    return Fold(root.subs(back), mu_s.subs(back), inside.subs(back))


def _first_positive_root(slope: sp.Expr, x: sp.Symbol) -> sp.Expr | None:
    """The first root at which the branch through 0 folds: a root of odd multiplicity, smallest first."""
    symbols = sorted(slope.free_symbols - {x}, key=str)
    numerator = sp.numer(sp.together(slope))
    if not numerator.has(x):
        return None
    closed = sp.roots(sp.Poly(numerator, x)) if numerator.is_polynomial(x) else {}
    if not closed or sum(closed.values()) < sp.degree(numerator, x):
        if symbols:
            names = ", ".join(map(str, symbols))
            raise ValueError(
                f"d mu/d lam = 0 has no closed form in {names}; give numbers for these parameters."
            )
        return _numerical_root(slope, x)
    # A large rho is where folds exist; which root comes first there holds for every rho if there is only one.
    sample = {s: sp.Rational(7, 2) for s in symbols}
    values = [(complex(root.subs(sample).evalf()), root) for root, count in closed.items() if count % 2]
    real = [(value.real, root) for value, root in values if abs(value.imag) < 1e-12 and value.real > 0]
    positive = sorted(real, key=lambda pair: pair[0])
    if symbols and len(positive) > 1:
        names = ", ".join(map(str, symbols))
        raise ValueError(f"d mu/d lam = 0 has several roots, whose order depends on {names}; give numbers.")
    return sp.simplify(positive[0][1]) if positive else None


def _numerical_root(slope: sp.Expr, x: sp.Symbol) -> sp.Expr | None:
    import numpy as np
    from scipy.optimize import brentq

    function = sp.lambdify(x, slope, modules=["scipy", "numpy"])
    grid = np.linspace(0, 1, 2001)
    with np.errstate(all="ignore"):
        values = np.array([float(function(g)) for g in grid])
    below = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    if not below.size:
        return None
    return sp.Float(brentq(function, grid[below[0]], grid[below[0] + 1], xtol=1e-15))
