"""Sigmoids: smooth stand-ins Lambda(u), u = h/eps, for the switch lambda = sign h.

    algebraic   u / sqrt(1 + u^2)     Lambda' = (1 - lambda^2)^(3/2)
    tanh        tanh u                Lambda' = 1 - lambda^2
    erf         erf u                 Lambda' = 2/sqrt(pi) exp(-erfinv(lambda)^2)

A sigmoid supplies Lambda and its slope as a function of lambda, which is the speed of the layer system; the
hidden term gamma(lambda) belongs to the model. The first two slopes are powers gamma^p of gamma = 1 - lambda^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from . import checks
from .model import Model

__all__ = ["SIGMOIDS", "Sigmoid", "sigmoid"]

# Lambda(u) and its inverse.
_FUNCTIONS = {
    "algebraic": (lambda u: u / sp.sqrt(1 + u**2), lambda lam: lam / sp.sqrt((1 - lam) * (1 + lam))),
    "tanh": (sp.tanh, sp.atanh),
    "erf": (sp.erf, sp.erfinv),
}


@dataclass(frozen=True)
class Sigmoid:
    """One family of smooth switches.

    Attributes
    ----------
    name : str
        As `smoothed` and `layered` take it.
    exponent : sympy.Rational or None
        p with  Lambda' = (1 - lambda^2)^p, or None where no such p exists.

    Notes
    -----
    Source: Jeffrey, On the mathematical basis of solid friction, for the algebraic one.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth.definition.sigmoids import sigmoid
    >>> u, lam = sp.symbols("u lam", real=True)
    >>> sigmoid("algebraic").function(u)
    u/sqrt(u**2 + 1)
    >>> sigmoid("algebraic").slope(lam)
    (1 - lam**2)**(3/2)
    """

    name: str
    exponent: sp.Rational | None

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
        return _FUNCTIONS[self.name][0](u)

    def slope(self, lam):
        """Its slope dLambda/du in terms of lambda.

        Parameters
        ----------
        lam : Expr or float, dimensionless
            Lambda, between -1 and 1.

        Returns
        -------
        Expr
            Dimensionless, >= 0.
        """
        if self.exponent is None:
            x = sp.Dummy()
            return (1 / self.inverse(x).diff(x)).subs(x, lam)
        return (1 - lam**2) ** self.exponent

    def inverse(self, lam):
        """The inverse u(lambda).

        Parameters
        ----------
        lam : Expr or float, dimensionless
            Lambda, between -1 and 1.

        Returns
        -------
        Expr
            Dimensionless.
        """
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
        inverse = self.inverse(lam)
        return Model(t, (u, lam), (), (self.function(u), sp.nan if inverse.has(sp.erfinv) else inverse))

    def smooth(self, h, eps):
        """The switch Lambda(h/eps), in the form that neither overflows nor divides by a small eps twice.

        For the algebraic sigmoid h/sqrt(eps^2 + h^2): its square, which hidden terms contain, then is
        h^2/(eps^2 + h^2) without a quotient h/eps that grows like 1/eps.

        Parameters
        ----------
        h : Expr
            The surface.
        eps : Expr or float, in the unit of h
            Width of the layer, > 0.

        Returns
        -------
        Expr
            Dimensionless, between -1 and 1.
        """
        if self.name == "algebraic":
            return h / sp.sqrt(eps**2 + h**2)
        return self.function(h / eps)


#: The families by name.
SIGMOIDS = {
    "algebraic": Sigmoid("algebraic", sp.Rational(3, 2)),
    "tanh": Sigmoid("tanh", sp.Integer(1)),
    "erf": Sigmoid("erf", None),
}


def sigmoid(name):
    """The `Sigmoid` of a name.

    Parameters
    ----------
    name : {"algebraic", "tanh", "erf"} or Sigmoid
        A Sigmoid is returned as it is.

    Returns
    -------
    Sigmoid
        Lambda, its slope and its inverse.

    Raises
    ------
    ValueError
        There is no sigmoid of that name.

    Notes
    -----
    Source: Jeffrey, On the mathematical basis of solid friction, for the algebraic one.

    Examples
    --------
    >>> from pwsmooth.definition.sigmoids import sigmoid
    >>> sigmoid("tanh").exponent
    1
    """
    if isinstance(name, Sigmoid):
        return name
    try:
        return SIGMOIDS[name]
    except (KeyError, TypeError):
        raise ValueError(
            f"`sigmoid` is {checks.shown(name)}, the name of none; choose one of {', '.join(SIGMOIDS)}."
        ) from None
