"""Sigmoids: smooth stand-ins Lambda(u), u = h/eps, for the switch lambda = sign h.

    algebraic   u / sqrt(1 + u^2)     Lambda' = (1 - lambda^2)^(3/2)
    tanh        tanh u                Lambda' = 1 - lambda^2
    erf         erf u                 Lambda' = 2/sqrt(pi) exp(-erfinv(lambda)^2)
    your own    an expression         Lambda' at the u with Lambda(u) = lambda, found numerically

A sigmoid supplies Lambda and its slope as a function of lambda, which is the speed of the layer system; the
hidden term gamma(lambda) belongs to the model. The first two slopes are powers gamma^p of gamma = 1 - lambda^2.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
import sympy as sp

from ..door import calls, checks
from .lambdified import numpy_function
from .model import Model

__all__ = ["SIGMOIDS", "Sigmoid", "sigmoid"]

_U = sp.Symbol("u", real=True)

# Lambda(u) and its inverse.
_FUNCTIONS = {
    "algebraic": (lambda u: u / sp.sqrt(1 + u**2), lambda lam: lam / sp.sqrt((1 - lam) * (1 + lam))),
    "tanh": (sp.tanh, sp.atanh),
    "erf": (sp.erf, sp.erfinv),
}


@checks.door()
@dataclass(frozen=True)
class Sigmoid:
    """One family of smooth switches.

    Attributes
    ----------
    name : str
        As `smoothed` and `layered` take it; of an expression its text.
    exponent : sympy.Rational or None
        p with  Lambda' = (1 - lambda^2)^p, or None where no such p exists or is known.
    expression : Expr or None
        Lambda(u) of a sigmoid that is none of the three by name.

    Source: Jeffrey, On the mathematical basis of solid friction, for the algebraic one.

    >>> u, lam = sp.symbols("u lam", real=True)
    >>> sigmoid("algebraic").function(u)
    u/sqrt(u**2 + 1)
    >>> sigmoid("algebraic").slope(lam)
    (1 - lam**2)**(3/2)
    """

    name: str
    exponent: sp.Rational | None
    expression: sp.Expr | None = None

    @property
    def key(self):
        """What `sigmoid` takes to give this one again: a name, or an expression."""
        return self.name if self.expression is None else self.expression

    def function(self, u):
        """The switch as a function of u = h/eps, Lambda(u).

        Parameters
        ----------
        u : Expr or float, dimensionless
            Distance from the surface over the layer's width.

        Returns
        -------
        Expr
            Dimensionless, between -1 and 1.
        """
        u = _argument(u, "`u`")
        if self.expression is not None:
            return self.expression.xreplace({_U: u})
        return _FUNCTIONS[self.name][0](u)

    def slope(self, lam):
        """Its slope dLambda/du in terms of lambda.

        Returns
        -------
        Expr
            Dimensionless, >= 0.
        """
        lam = _argument(lam, "`lam`")
        if self.expression is not None:
            return self.expression.diff(_U).xreplace({_U: self.inverse(lam)})
        if self.exponent is None:
            x = sp.Dummy()
            return (1 / self.inverse(x).diff(x)).subs(x, lam)
        return (1 - lam**2) ** self.exponent

    def inverse(self, lam):
        """The inverse u(lambda).

        Returns
        -------
        Expr
            Dimensionless; of an expression a function that has numbers only.
        """
        lam = _argument(lam, "`lam`")
        if self.expression is not None:
            return _numerical_inverse(self.expression)(lam)
        return _FUNCTIONS[self.name][1](lam)

    def model(self) -> Model:
        """The sigmoid as the kernels take it, in generated code: rates (Lambda(u), inverse(lambda)) at the states.

        The second is nan where the inverse is no elementary function: the kernels then invert the first.

        Returns
        -------
        Model
            Of two states and no parameters.
        """
        t, u, lam = sp.symbols("t u lam", real=True)
        inverse = sp.nan if self.exponent is None else self.inverse(lam)
        return Model(t, (u, lam), (), (self.function(u), inverse))

    def smooth(self, h, eps):
        """The switch Lambda(h/eps), in the form that neither overflows nor divides by a small eps twice.

        For the algebraic sigmoid h/sqrt(eps^2 + h^2): its square, which hidden terms contain, then is
        h^2/(eps^2 + h^2) without a quotient h/eps that grows like 1/eps.

        Parameters
        ----------
        h : Expr
            The surface.

        Returns
        -------
        Expr
            Dimensionless, between -1 and 1.
        """
        if self.name == "algebraic":
            return h / sp.sqrt(eps**2 + h**2)
        return self.function(h / eps)

    def smooth_component(self, h, surfaces, eps):
        """A component of the vector switch of a `Disc`, Lambda(|h|/eps) h_i/|h|.

        Parameters
        ----------
        h : Expr
            Its surface h_i.
        surfaces : sequence of Expr, length d
            All surfaces of the disc.

        Returns
        -------
        Expr
            Dimensionless, between -1 and 1.

        Raises
        ------
        ValueError
            Lambda(s)/s, even in s, is no function of s^2 that has a value at 0: nothing that a series could be made of.
        """
        square = sp.Add(*(other**2 for other in surfaces))
        if self.name == "algebraic":
            return h / sp.sqrt(eps**2 + square)
        w = sp.Dummy(positive=True)
        factor = sp.simplify(self.function(sp.sqrt(w)) / sp.sqrt(w))
        if not factor.subs(w, 0).is_finite:
            raise ValueError(
                f"`sigmoid` is {self.name!r}, of which a Disc needs Lambda(s)/s, s = |h|/eps: here it has no form "
                "without the quotient 0/0 at s = 0. Take 'algebraic', or an expression such as u/(1 + u**4)**(1/4)."
            )
        return h / eps * factor.xreplace({w: square / eps**2})


def _argument(value, what):
    """An expression of any symbols, a Dummy as well; text is refused, which sympy's functions would evaluate."""
    return value if isinstance(value, sp.Expr) else checks.expression(value, what)


#: The families by name.
SIGMOIDS = {
    "algebraic": Sigmoid("algebraic", sp.Rational(3, 2)),
    "tanh": Sigmoid("tanh", sp.Integer(1)),
    "erf": Sigmoid("erf", None),
}


@checks.door()
def sigmoid(name):
    """The `Sigmoid` of a name, or of an expression of your own.

    Parameters
    ----------
    name : {"algebraic", "tanh", "erf"} or Expr or Sigmoid
        An expression in one symbol, u = h/eps: odd, increasing, with the limit 1, of functions without kinks. A Sigmoid
        is returned as it is.

    Returns
    -------
    Sigmoid
        Lambda, its slope and its inverse.

    Raises
    ------
    ValueError
        There is no sigmoid of that name, or the expression is no smooth switch.

    Source: Jeffrey, On the mathematical basis of solid friction, for the algebraic one.

    >>> sigmoid("tanh").exponent
    1
    >>> u = sp.Symbol("u", real=True)
    >>> sigmoid(2 / sp.pi * sp.atan(u)).name
    '2*atan(u)/pi'
    """
    if isinstance(name, Sigmoid):
        return name
    if isinstance(name, sp.Expr):
        return _of_expression(name)
    try:
        return SIGMOIDS[name]
    except (KeyError, TypeError):
        raise ValueError(
            f"`sigmoid` is {checks.shown(name)}, the name of none; choose one of {', '.join(SIGMOIDS)}, or give "
            "an expression in u." + calls.hint(name, SIGMOIDS)
        ) from None


# What has a kink or a jump: Taylor steps and implicit ones take a smoothed field as analytic.
_KINKS = (sp.Abs, sp.sign, sp.Heaviside, sp.Max, sp.Min, sp.Piecewise, sp.floor, sp.ceiling, sp.frac, sp.Mod)


@functools.lru_cache(maxsize=32)
def _of_expression(given):
    """The sigmoid of an expression; ValueError where it is no smooth switch."""
    e = checks.expression(given, "`sigmoid`")

    def refused(why):
        return ValueError(
            f"`sigmoid` is {checks.shown(e)}: {why}; give an expression in one symbol u that is odd, increases and "
            "tends to 1, such as u/sqrt(1 + u**2)."
        )

    if len(e.free_symbols) != 1:
        raise refused(f"it has {len(e.free_symbols)} symbols" if e.free_symbols else "it is a number")
    e = e.xreplace({next(iter(e.free_symbols)): _U})
    if kinks := e.atoms(*_KINKS):
        raise refused(f"{sorted(map(str, kinks))[0]} has a kink")
    places = np.concatenate([np.linspace(0, 6, 121)[1:], np.geomspace(6, 1e9, 40)])
    with np.errstate(all="ignore"):
        right, left = (np.broadcast_to(numpy_function(_U, e)(s * places), places.shape) for s in (1, -1))
    # To rounding: beyond some place a number nearer to 1 than the next one does not exist.
    if not (np.isrealobj(right) and np.isfinite(right).all() and np.isfinite(left).all()):
        raise refused("between -1e9 and 1e9 it has values that are no real numbers")
    if not np.abs(right + left).max() < 1e-12:
        raise refused("it is not odd")
    if not (np.diff(right, prepend=0.0) > -1e-14).all() or not right[0] > 0:
        raise refused("it does not increase")
    if not abs(right[-1] - 1) < 1e-3:
        raise refused(f"at u = 1e9 it is {right[-1]:.6g}")
    return Sigmoid(str(e), None, e)


@functools.lru_cache(maxsize=32)
def _numerical_inverse(e):
    """u(lambda) of an expression, as a function that sympy carries along and numpy computes."""
    from scipy.optimize import brentq
    from sympy.utilities.lambdify import implemented_function

    level, top = numpy_function(_U, e), math.sinh(40.0)

    def place(lam):
        if abs(lam) >= level(top):
            return math.copysign(top, lam) if abs(lam) <= 1 else math.nan
        # In asinh u: tails fill many decades.
        return math.sinh(brentq(lambda s: level(math.sinh(s)) - lam, -40.0, 40.0, xtol=1e-15, rtol=1e-15))

    return implemented_function("inverse", np.vectorize(place, otypes=[float]))
