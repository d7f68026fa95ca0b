"""Expressions at random points: the quick first answer of symbolic questions.

Are two surfaces equal up to a factor? Is the field continuous across a surface? A handful of random points
decides in microseconds what `sympy.simplify` may not decide in minutes. Points depend on names only, so that
every process comes to the same lowered model.
"""

from __future__ import annotations

import math
import random
from functools import lru_cache

import sympy as sp

from .model import Entry, Select, Whole

NAN = math.nan
# A base that is negative by less than this lies on its surface up to rounding: delta**1.5 at delta = -1e-17.
ROUNDING = 1e-12

_NAMES = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log erf erfc gamma atan2"
_MATH = {name: getattr(math, name) for name in _NAMES.split()}


def value(expr, point):
    """`expr` as a float where the symbols have the values of the dict `point`; nan where it is undefined.

    Of a `Select` or `Piecewise` only the active branch is evaluated.
    """
    try:
        result = _value(expr, point)
    except (ValueError, OverflowError, ZeroDivisionError, TypeError, KeyError):
        return NAN
    return result if math.isfinite(result) else NAN


def _value(e, point):
    if e.is_Symbol:
        return point[e]
    if e.is_Number or e.is_NumberSymbol:
        return float(e)
    if e.is_Add:
        return math.fsum(_value(a, point) for a in e.args)
    if e.is_Mul:
        return math.prod(_value(a, point) for a in e.args)
    if e.is_Pow:
        base, exponent = (_value(a, point) for a in e.args)
        if base < 0 and exponent != int(exponent):
            if base < -ROUNDING:
                raise ValueError("a power of a negative number")
            base = 0.0
        return base**exponent
    if isinstance(e, Select):
        lam = _value(e.args[0], point)
        if lam == 1:
            return _value(e.args[1], point)
        if lam == -1:
            return _value(e.args[2], point)
        return ((1 + lam) * _value(e.args[1], point) + (1 - lam) * _value(e.args[2], point)) / 2
    if isinstance(e, Entry):
        return draw(sp.Symbol(str(e)), 0)
    if isinstance(e, Whole):
        return math.floor(_value(e.args[0], point) + 0.5)
    if isinstance(e, sp.Piecewise):
        return _value(next(branch for branch, condition in e.args if holds(condition, point)), point)
    if e.func.__name__ in _MATH:
        return _MATH[e.func.__name__](*(_value(a, point) for a in e.args))
    return float(e.xreplace({s: sp.Float(point[s]) for s in e.free_symbols}).evalf())


def holds(condition, point):
    """The truth of a condition at a point."""
    if condition in (sp.true, sp.false):
        return bool(condition)
    if isinstance(condition, sp.And):
        return all(holds(c, point) for c in condition.args)
    if isinstance(condition, sp.Or):
        return any(holds(c, point) for c in condition.args)
    if isinstance(condition, sp.Not):
        return not holds(condition.args[0], point)
    left, right = (_value(a, point) for a in condition.args)
    return bool(condition.func(left, right))


@lru_cache(maxsize=65536)
def draw(symbol, k):
    """The k-th random value of a symbol, of the sign that its assumptions ask for."""
    rng = random.Random(f"{symbol.name} {k}")
    if symbol.is_integer:
        return float(rng.randint(1, 7)) * (-1.0 if symbol.is_nonpositive else 1.0)
    size = rng.uniform(0.4, 1.9)
    if symbol.is_nonnegative or symbol.is_nonpositive:
        return -size if symbol.is_nonpositive else size
    return size if rng.random() < 0.5 else -size


def fingerprint(expr, fixed=()):
    """A key shared by all expressions that equal this one up to a constant factor, and its value at a point.

    Symbols in `fixed` (parameters) have the same value at every point, so that they count as constants.
    Returns (None, nan) where the expression is undefined or vanishes.
    """
    symbols = sorted(expr.free_symbols, key=lambda s: s.name)
    values = [value(expr, {s: draw(s, 0 if s in fixed else k) for s in symbols}) for k in range(4)]
    if any(math.isnan(v) or v == 0 for v in values):
        return None, NAN
    return tuple(float(f"{v / values[0]:.9e}") for v in values[1:]), values[0]
