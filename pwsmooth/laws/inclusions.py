"""Two statements that turn inclusions into ordinary differential equations (Kikuuwe, Xiong).

    Sgn -> sat    y in L Sgn(x - y/sigma)            <=>  y = clip(sigma x, L), on a line, in the plane and in space
    dio -> max    c (A' - A) in dio(A' - B), c > 0   <=>  A' = max(A, B),  c (A' - A) = c max(0, B - A)

with Sgn(0) = [-1, 1] and the diode map dio(w) = {0} for w > 0, [0, inf) for w = 0, empty for w < 0, that is
0 <= w orthogonal to y >= 0. Laws of friction use the first, laws of contact the second.
"""

import sympy as sp

from ..door import checks

__all__ = ["dio_defect", "max_of_dio", "sat_of_sgn", "sgn_defect"]


@checks.door(x=checks.velocity, limit=checks.expression)
def clip(x, limit):
    """The value x, cut off at -limit and limit; a vector, shortened to the length `limit`.

    The two surfaces of a number are x - limit and x + limit, neither inside the other; the one of a vector is
    x.x/limit^2 - 1.

    Parameters
    ----------
    x : Expr or sequence of Expr, length 2 or 3
        Of any unit.
    limit : Expr or float, in the unit of x
        Positive.

    Returns
    -------
    Expr or tuple of Expr
        In the unit of x; of a number a Piecewise.

    Source: the projection onto [-limit, limit], or onto the ball of this radius.

    >>> clip(3, 2), clip(-1, 2), clip((3, 4), 1)
    (2, -1, (3/5, 4/5))
    """
    if isinstance(x, tuple):
        # The size where it matters: never a root of zero, of which a bristle at rest would have no derivative.
        size = sp.sqrt(sp.Max(1, sp.Add(*(e**2 for e in x)) / limit**2))
        return tuple(e / size for e in x)
    return sp.Piecewise((limit, x > limit), (-limit, x < -limit), (x, True))


@checks.door(x=checks.velocity, limit=checks.expression, sigma=checks.expression)
def sat_of_sgn(x, limit, sigma):
    """The y with  y in limit Sgn(x - y/sigma).

    Parameters
    ----------
    x : Expr or sequence of Expr, length 2 or 3
        A velocity, say; of any unit.
    limit, sigma : Expr or float, in units of y and of y/x
        Positive.

    Returns
    -------
    Expr or tuple of Expr
        y = clip(sigma x, limit), in the unit of `limit`.

    Source: Kikuuwe and Xiong; proof on the page "Friction and contact as inclusions" of the documentation.

    >>> sat_of_sgn(3, limit=2, sigma=1), sat_of_sgn(sp.Rational(1, 2), limit=2, sigma=1)
    (2, 1/2)
    """
    return clip(tuple(sigma * e for e in x) if isinstance(x, tuple) else sigma * x, limit)


@checks.door(A=checks.expression, B=checks.expression, c=checks.expression)
def max_of_dio(A, B, c):
    """The (a', y) with  y = c (a' - A) in dio(a' - B).

    Parameters
    ----------
    A, B : Expr
        Two rates of one unit.
    c : Expr or float, in units of y/a'
        Positive.

    Returns
    -------
    (Expr, Expr)
        a' = max(A, B) and y = c max(0, B - A).

    Source: Kikuuwe and Xiong; proof on the page "Friction and contact as inclusions" of the documentation.

    >>> max_of_dio(1, 3, c=2), max_of_dio(3, 1, c=2)
    ((3, 4), (3, 0))
    """
    return sp.Max(A, B), c * sp.Max(0, B - A)


@checks.door(y=checks.number, w=checks.number, limit=checks.nonnegative)
def sgn_defect(y, w, limit):
    """How far y is from y in limit Sgn(w): 0 if and only if it holds.

    Parameters
    ----------
    y, w : float, of any unit
        The force and the velocity, say.
    limit : float, in the unit of y
        Positive.

    Returns
    -------
    float
        Distance of y from its projection of y + w, in the unit of y.

    Source: the projection theorem.

    >>> sgn_defect(2.0, 5.0, limit=2.0), sgn_defect(1.0, 5.0, limit=2.0)
    (0.0, 1.0)
    """
    return abs(y - max(-limit, min(limit, y + w)))


@checks.door(y=checks.number, w=checks.number)
def dio_defect(y, w):
    """How far y is from y in dio(w): 0 if and only if it holds.

    Parameters
    ----------
    y, w : float, of any unit
        The force and the gap, say.

    Returns
    -------
    float
        abs(min(w, y)), in the unit of both.

    Source: 0 <= w, y and w y = 0 if and only if min(w, y) = 0.

    >>> dio_defect(0.0, 3.0), dio_defect(1.0, 3.0)
    (0.0, 1.0)
    """
    return abs(min(w, y))
