"""Expressions at random points: the quick first answer of symbolic questions.

Are two surfaces equal up to a factor? Is the field continuous across a surface? A handful of random points
decides in microseconds what `sympy.simplify` may not decide in minutes. Points depend on names only, so that
every process comes to the same lowered model.
"""

from __future__ import annotations

import math
import operator
import random
from functools import lru_cache, partial
from types import SimpleNamespace

import mpmath
import sympy as sp
from sympy.core.relational import Relational

from .model import Entry, Select, Whole

NAN = math.nan
# A base that is negative by less than this lies on its surface up to rounding: delta**1.5 at delta = -1e-17.
ROUNDING = 1e-12

_NAMES = frozenset(
    "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log erf erfc gamma atan2".split()
)
_FLOATS = SimpleNamespace(
    of=float,
    digits=15,
    fsum=math.fsum,
    prod=math.prod,
    floor=math.floor,
    **{f: getattr(math, f) for f in _NAMES},
)
_DIGITS = 60  # of numbers that decide whether two expressions are one
_NUDGES = 4  # of the Floats in them, by a rounding each


def value(expr, point):
    """`expr` as a float where the symbols have the values of the dict `point`; nan where it is undefined.

    The entries of a drive's table are those of the point too, or one number each.

    Of a `Select` or `Piecewise` only the active branch is evaluated.
    """
    try:
        result = _value(expr, point)
    except (ValueError, OverflowError, ZeroDivisionError, TypeError, KeyError):
        return NAN
    return result if math.isfinite(result) else NAN


def _value(e, point, numbers=_FLOATS):
    return numbers.function(e)(point)


def _function(e, numbers):
    """The function point -> value of an expression; branches that no point takes are never looked into."""
    if e.is_Symbol:
        return operator.itemgetter(e)
    if isinstance(e, Entry):
        drawn = draw(sp.Symbol(str(e)), 0)
        return lambda point: point.get(e, drawn)
    if e.is_Number or e.is_NumberSymbol:
        constant = numbers.of(e)
        return lambda point: constant
    if isinstance(e, Select):
        return lambda point: _selected(*e.args, point, numbers)
    if isinstance(e, sp.Piecewise):
        return lambda point: _value(
            next(branch for branch, condition in e.args if holds(condition, point, numbers)), point, numbers
        )
    if not (e.is_Add or e.is_Mul or e.is_Pow or isinstance(e, Whole) or e.func.__name__ in _NAMES):
        return lambda point: numbers.of(
            e.xreplace({s: sp.Float(point[s], numbers.digits) for s in e.free_symbols}).evalf(numbers.digits)
        )
    parts = [numbers.function(a) for a in e.args]
    if e.is_Add or e.is_Mul:
        of_all = numbers.fsum if e.is_Add else numbers.prod
        return lambda point: of_all([part(point) for part in parts])
    if e.is_Pow:
        base, exponent = parts
        return lambda point: _power(base(point), exponent(point))
    if isinstance(e, Whole):
        (inner,) = parts
        return lambda point: numbers.floor(inner(point) + 0.5)
    named = getattr(numbers, e.func.__name__)
    return lambda point: named(*[part(point) for part in parts])


_FLOATS.function = lru_cache(maxsize=16384)(partial(_function, numbers=_FLOATS))


def _power(base, exponent):
    if base < 0 and exponent != int(exponent):
        if base < -ROUNDING:
            raise ValueError("a power of a negative number")
        base = 0.0 * base
    return base**exponent


def _selected(lam, above, below, point, numbers):
    lam = _value(lam, point, numbers)
    if lam in (1, -1):
        return _value(above if lam == 1 else below, point, numbers)
    return ((1 + lam) * _value(above, point, numbers) + (1 - lam) * _value(below, point, numbers)) / 2


def holds(condition, point, numbers=_FLOATS):
    """The truth of a condition at a point."""
    if condition in (sp.true, sp.false):
        return bool(condition)
    if isinstance(condition, sp.And):
        return all(holds(c, point, numbers) for c in condition.args)
    if isinstance(condition, sp.Or):
        return any(holds(c, point, numbers) for c in condition.args)
    if isinstance(condition, sp.Not):
        return not holds(condition.args[0], point, numbers)
    if not isinstance(condition, Relational):  # ITE, Xor, Implies, ...
        return holds(_normal(condition), point, numbers)
    left, right = (_value(a, point, numbers) for a in condition.args)
    if condition.func not in (sp.Eq, sp.Ne) and (left != left or right != right):
        raise TypeError("nan has no order")
    return bool(_COMPARE[condition.func](left, right))


_COMPARE = {sp.Lt: operator.lt, sp.Le: operator.le, sp.Gt: operator.gt, sp.Ge: operator.ge, sp.Eq: operator.eq,
            sp.Ne: operator.ne}  # fmt: skip
_normal = lru_cache(maxsize=1024)(partial(sp.to_nnf, simplify=False))


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
    """A key shared by all expressions that equal this one up to a constant factor, and by others that are near them.

    Symbols in `fixed` (parameters) have the same value at every point, so that they count as constants.
    Returns None where the expression is undefined or vanishes.
    """
    symbols = sorted(expr.free_symbols, key=lambda s: s.name)
    values = [value(expr, {s: draw(s, 0 if s in fixed else k) for s in symbols}) for k in range(4)]
    if any(math.isnan(v) or v == 0 for v in values):
        return None
    return tuple(float(f"{v / values[0]:.9e}") for v in values[1:])


@lru_cache(maxsize=_NUDGES + 1)
def _exact(nudge):
    """Numbers of many digits, in which a Float is the decimal that it is written as; with a `nudge` one beside it."""
    context = mpmath.MPContext()
    context.dps = _DIGITS

    def number(e):
        if not e.is_Float:
            return context.mpf(str(sp.N(e, _DIGITS)))
        by = random.Random(f"{float(e)!r} {nudge}").choice((-1, 1)) if nudge else 0
        return context.mpf(repr(float(e))) * (1 + by * context.mpf(2) ** -52)

    functions = {f: getattr(context, f) for f in _NAMES}
    numbers = SimpleNamespace(
        of=number, digits=_DIGITS, fsum=context.fsum, prod=context.fprod, floor=context.floor, mpf=context.mpf,
        **functions,
    )  # fmt: skip
    numbers.function = lru_cache(maxsize=1024)(partial(_function, numbers=numbers))
    return numbers


def factor_between(h, other):
    """The sign of c if h = c other for all values of the symbols, else 0.

    At random points to 60 digits, which tell a pulse of a second in Unix time. Floats may be off by their rounding.
    """
    symbols = h.free_symbols | other.free_symbols

    def ratios(numbers):
        at = []
        for k in range(3, 8):
            point = {s: numbers.mpf(draw(s, k)) for s in symbols}
            at.append(_value(h, point, numbers) / _value(other, point, numbers))
        return at[0], [ratio / at[0] for ratio in at[1:]]

    nudges = range(1, _NUDGES + 1) if h.has(sp.Float) or other.has(sp.Float) else ()
    try:
        first, more = ratios(_exact(0))
        beside = [ratios(_exact(nudge))[1] for nudge in nudges]
    except (ValueError, OverflowError, ZeroDivisionError, TypeError, KeyError):
        return 0
    for k, ratio in enumerate(more):
        within = mpmath.mpf(10) ** (-_DIGITS // 2) + 2 * max(
            (abs(ratio - near[k]) for near in beside), default=0
        )
        if not abs(ratio - 1) <= within:
            return 0
    return 1 if first > 0 else -1
