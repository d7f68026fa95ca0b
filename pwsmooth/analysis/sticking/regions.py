"""Where a contact sticks: folds of the friction coefficient, sticking regions, capture from slip.

    mu(lam) = lam (1 + rho gamma(lam)),     sticking where |k y - q''| <= N mu at v = 0

The linear region has mu = 1, the nonlinear one mu = mu_s, the height of the fold of mu(lam) at lam_s (M. R. Jeffrey, On
the mathematical basis of solid friction, eqs 16-19). Which of them captures a slipping contact is decided in the layer:
see `capture`.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp
from mpmath.libmp import NoConvergence

from ...definition.lambdified import numpy_function
from ...door import checks
from ...door.documenting import complete
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


@complete
@dataclass(frozen=True)
class Fold:
    """The fold at which the attracting branch of sticking through lam = 0 ends.

    Attributes
    ----------
    lam_s : Expr
        The root of d mu/d lam = 0, wherever it lies; dimensionless.
    mu_s : Expr
        The largest static coefficient, mu(lam_s) if `inside` and mu(1) otherwise; dimensionless.
    inside : sympy Boolean
        Whether the fold lies in 0 < lam < 1.

    Source: Jeffrey, On the mathematical basis of solid friction, eqs 16 and 17.

    >>> lam = sp.Symbol("lam")
    >>> weak = fold(1 - lam**2, lam, sp.Rational(1, 4))  # too weak a hidden term for a fold inside
    >>> weak.mu_s, weak.inside
    (1, False)
    """

    lam_s: sp.Expr
    mu_s: sp.Expr
    inside: sp.Basic


@checks.door()
@dataclass(frozen=True)
class StickingRegion:
    """The region v = 0 and |k y - drive| <= N mu, where a contact can stick.

    Parameters
    ----------
    coefficient : Expr
        mu, dimensionless: 1 for the linear region, mu_s for the nonlinear one.

    Source: Jeffrey, On the mathematical basis of solid friction, eqs 18 and 19.

    >>> StickingRegion(sp.Integer(0), sp.Integer(2), sp.Integer(1), sp.Integer(1)).bounds
    (-1/2, 1/2)
    """

    drive: sp.Expr
    stiffness: sp.Expr
    load: sp.Expr
    coefficient: sp.Expr

    def __post_init__(self) -> None:
        checks.fields(self, **dict.fromkeys(("drive", "stiffness", "load"), checks.expression))

    @property
    def bounds(self) -> tuple[sp.Expr, sp.Expr]:
        """Smallest and largest displacement y at which the contact can stick, m."""
        half = self.load * self.coefficient
        return (self.drive - half) / self.stiffness, (self.drive + half) / self.stiffness

    @checks.door(y=checks.expression)
    def condition(self, y: sp.Expr) -> sp.Basic:
        """The region as a relation on the displacement.

        Parameters
        ----------
        y : Expr
            Displacement, m.

        Returns
        -------
        sympy Boolean
            abs(k y - drive) <= N mu.
        """
        return sp.Le(sp.Abs(self.stiffness * y - self.drive), self.load * self.coefficient)


@checks.door()
def linear_sticking(drive: sp.Expr, stiffness: sp.Expr, load: sp.Expr) -> StickingRegion:
    """Filippov's sliding region, all there is without a hidden term.

    Returns
    -------
    StickingRegion
        With mu = 1.

    Source: Jeffrey, On the mathematical basis of solid friction, eq. 18.

    >>> t = sp.Symbol("t", real=True)
    >>> linear_sticking(-2 * sp.sin(t), 4, 1).bounds
    (-sin(t)/2 - 1/4, 1/4 - sin(t)/2)
    """
    return StickingRegion(drive, stiffness, load, sp.Integer(1))


@checks.door()
def nonlinear_sticking(
    drive: sp.Expr, stiffness: sp.Expr, load: sp.Expr, gamma: sp.Expr, lam: sp.Symbol, rho: sp.Expr
) -> StickingRegion:
    """The sticking region with the hidden term at its equilibrium.

    Parameters
    ----------
    gamma : Expr
        Hidden term, even in `lam`, 0 at lam = 1; dimensionless.
    rho : Expr
        Strength of the hidden term, dimensionless.

    Returns
    -------
    StickingRegion
        With mu = mu_s.

    Raises
    ------
    ValueError
        As `fold`.

    Source: Jeffrey, On the mathematical basis of solid friction, eq. 19.

    >>> lam = sp.Symbol("lam")
    >>> nonlinear_sticking(0, 1, 1, 1 - lam**2, lam, 3).bounds
    (-16/9, 16/9)
    """
    return StickingRegion(drive, stiffness, load, fold(gamma, lam, rho).mu_s)


@checks.door()
def fold(gamma: sp.Expr, lam: sp.Symbol, rho: sp.Expr) -> Fold:
    """The fold of mu(lam) = lam (1 + rho gamma(lam)) on the branch through lam = 0.

    Parameters
    ----------
    gamma : Expr
        Even in `lam`, with gamma(1) = 0; dimensionless.
    rho : Expr
        Strength of the hidden term, dimensionless; a symbol is taken as positive.

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

    Source: Jeffrey, On the mathematical basis of solid friction, eqs 16 and 17; the printed mu_s = -rho dgamma/dv
    lam_s**2 means dgamma/dlam.

    >>> lam, rho = sp.Symbol("lam"), sp.Symbol("rho", positive=True)
    >>> fold(1 - lam**2, lam, 3).mu_s
    16/9
    >>> fold(1 - lam**2, lam, rho).lam_s.subs(rho, 3)
    2/3
    """
    gamma, rho = checks.expression(gamma, "`gamma`"), checks.expression(rho, "`rho`")
    lam = checks.instance(sp.Symbol, "the Symbol in which `gamma` is written")(lam, "`lam`")
    x = sp.Dummy("lam", positive=True)
    shape = gamma.subs(lam, x)
    if sp.simplify(shape.subs(x, 1)) != 0:
        raise ValueError(
            f"`gamma` is {gamma}, which does not vanish at {lam} = 1, so it is no hidden term; give one such as "
            f"1 - {lam}**2."
        )
    if sp.simplify(gamma - gamma.subs(lam, -lam)) != 0:
        raise ValueError(f"`gamma` is {gamma}, which is not even in {lam}; give one such as 1 - {lam}**2.")
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
    names = ", ".join(map(str, symbols))
    numerator = sp.numer(sp.together(slope))
    if not numerator.has(x):
        return None
    try:
        closed = sp.roots(sp.Poly(numerator, x)) if numerator.is_polynomial(x) else {}
    except NoConvergence:  # of sympy's own numbers
        closed = {}
    if not closed or sum(closed.values()) < sp.degree(numerator, x):
        if symbols:
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
        raise ValueError(f"d mu/d lam = 0 has several roots, whose order depends on {names}; give numbers.")
    return sp.simplify(positive[0][1]) if positive else None


def _numerical_root(slope: sp.Expr, x: sp.Symbol) -> sp.Expr | None:
    import numpy as np
    from scipy.optimize import brentq

    function = numpy_function(x, slope)
    grid = np.linspace(0, 1, 2001)
    with np.errstate(all="ignore"):
        values = np.array([float(function(g)) for g in grid])
    below = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    if not below.size:
        return None
    return sp.Float(brentq(function, grid[below[0]], grid[below[0] + 1], xtol=1e-15))
