"""Two statements that turn inclusions into ordinary differential equations (Kikuuwe, Xiong).

    Sgn -> sat    y in L Sgn(x - y/sigma)            <=>  y = clip(sigma x, L)
    dio -> max    c (A' - A) in dio(A' - B), c > 0   <=>  A' = max(A, B),  c (A' - A) = c max(0, B - A)

with Sgn(0) = [-1, 1] and the diode map dio(w) = {0} for w > 0, [0, inf) for w = 0, empty for w < 0, that is
0 <= w orthogonal to y >= 0. Laws of friction use the first, laws of contact the second.
"""

import sympy as sp


def clip(x, limit):
    """x cut off at -limit and limit, with the two surfaces x - limit and x + limit, neither inside the other"""
    return sp.Piecewise((limit, x > limit), (-limit, x < -limit), (x, True))


def sat_of_sgn(x, limit, sigma):
    """The y with  y in limit Sgn(x - y/sigma).

    Parameters
    ----------
    x : Expr
    limit, sigma : Expr or float
        Positive.

    Examples
    --------
    >>> sat_of_sgn(3, limit=2, sigma=1), sat_of_sgn(sp.Rational(1, 2), limit=2, sigma=1)
    (2, 1/2)
    """
    return clip(sigma * x, limit)


def max_of_dio(A, B, c):
    """(a', y) with  y = c (a' - A) in dio(a' - B).

    Parameters
    ----------
    A, B : Expr
    c : Expr or float
        Positive.

    Examples
    --------
    >>> max_of_dio(1, 3, c=2), max_of_dio(3, 1, c=2)
    ((3, 4), (3, 0))
    """
    return sp.Max(A, B), c * sp.Max(0, B - A)


def sgn_defect(y, w, limit):
    """0 if and only if  y in limit Sgn(w): how far y is from its projection of y + w (numbers)."""
    return abs(y - max(-limit, min(limit, y + w)))


def dio_defect(y, w):
    """0 if and only if  y in dio(w): |min(w, y)| (numbers)."""
    return abs(min(w, y))
