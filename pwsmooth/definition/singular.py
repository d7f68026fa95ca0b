"""Singular arguments: where a function of the field has a pole, a branch point or the end of its domain.

    a**p (p < 0), log a, atanh a, tan a      infinite at the singular point                       "pole"
    a**p (p > 0, no integer), asin a, acos a defined on one side of it                            "end"
    sqrt(a), a = u**2 + v**2 >= 0            not smooth where u and v pass 0 together             "cone"
    abs(a)**p, 0 < p < 1                     |da/dt| ~ |a|**p brings a to rest in finite time     "branch"

Beyond such a point a Taylor step follows the analytic continuation, which the field has left. So every argument
that assumptions on parameters or bounds of the expression do not keep away from 0 is watched along the motion
(kernels/step/singular.py). States are taken as real whatever their symbols say: the motion decides what they become.
A `Select` is looked at branch by branch: in each its surface has a sign.

Chain: lifting.py -> singular (here) -> lowering.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import sympy as sp

from .model import EventSpec, Select, core, on_side

KINDS = ("", "pole", "end", "cone", "branch")  # with their numbers in kernels/step/singular.py

_EVERYTHING = (-math.inf, math.inf)
_RANGES = {
    sp.sin: (-1.0, 1.0), sp.cos: (-1.0, 1.0), sp.tanh: (-1.0, 1.0), sp.erf: (-1.0, 1.0), sp.erfc: (0.0, 2.0),
    sp.atan: (-math.pi / 2, math.pi / 2), sp.asin: (-math.pi / 2, math.pi / 2), sp.acos: (0.0, math.pi),
    sp.atan2: (-math.pi, math.pi), sp.acosh: (0.0, math.inf), sp.cosh: (1.0, math.inf), sp.sign: (-1.0, 1.0),
    sp.Heaviside: (0.0, 1.0), sp.Abs: (0.0, math.inf), sp.exp: (0.0, math.inf),
}  # fmt: skip
# Function -> (power of its zeros, None at a pole; what vanishes where it is singular).
_ZEROS = {
    **dict.fromkeys((sp.asin, sp.acos), (sp.S.Half, lambda a: (1 - a, 1 + a))),
    sp.acosh: (sp.S.Half, lambda a: (a - 1,)),
    sp.atanh: (None, lambda a: (1 - a, 1 + a)),
    sp.log: (None, lambda a: (a,)),
    sp.tan: (None, lambda a: (sp.cos(a),)),
    sp.atan2: (None, lambda y, x: (y**2 + x**2,)),
}
_BOUNDED = (sp.sin, sp.cos, sp.tanh, sp.erf)
_INCREASING = (sp.exp, sp.tanh, sp.erf, sp.atan, sp.sinh, sp.asinh)


class Argument(NamedTuple):
    """An argument `zero` of a function, singular where it vanishes; `power` is p of zero**p there, None at a pole."""

    zero: sp.Expr
    function: sp.Expr
    power: sp.Expr | None


def arguments(e):
    """The singular arguments of one function (not of what stands inside it)."""
    if e.is_Pow:
        base, power = e.args
        if power.is_integer and power.is_nonnegative:
            return []
        return [Argument(base, e, power if power.is_positive and power.is_constant() else None)]
    power, zeros = _ZEROS.get(e.func, (None, lambda *args: ()))
    return [Argument(zero, e, power) for zero in zeros(*e.args)]


class Bounds:
    """Bounds of expressions from the ranges of functions, the signs of parameters and those of known surfaces."""

    def __init__(self, field, others):
        self.surface, self.sums = dict(field.switches), dict(field.sums)
        self.dynamic = {field.time, *field.states, *(a for a, _ in field.algebraic), *others}
        self.ranges = {lam: (-1.0, 1.0) for lam in self.surface}
        self.ranges |= {lam: (-1.0, 1.0) for disc in field.discs for lam in disc.components}
        self.ranges |= {R: (0.0, math.inf) for R, _, _ in field.contacts}
        self._memo: dict = {}

    def of(self, e, signs):
        """(lowest, highest) value of `e`; `signs` are those of surfaces, by core."""
        key = (e, frozenset(signs.items()))
        if key not in self._memo:
            low, high = self._find(e, signs)
            if signs and e.args:
                c, inner = core(e)
                sign = signs.get(inner, 0) * (1 if c > 0 else -1)
                low, high = (
                    (max(low, 0.0), high) if sign > 0 else (low, min(high, 0.0)) if sign < 0 else (low, high)
                )
                for q, r in self._beside(e, signs):
                    least, most = (self.of(part, signs) for part in (q, r))
                    if least[0] >= 0 and most[0] >= 0:
                        low = max(low, most[0])
                    if least[1] <= 0 and most[1] <= 0:
                        high = min(high, most[1])
            self._memo[key] = low, high
        return self._memo[key]

    def _beside(self, e, signs):
        """(q, r) with e = q |h| + r and a surface h of known side: x**2 = h + c**2 where h = x**2 - c**2."""
        for surface, side in signs.items():
            ours, theirs = self._by_motion(e), self._by_motion(surface.expand())
            leading = min(theirs.keys() - {sp.S.One}, key=str, default=None)
            if leading in ours:
                q = ours[leading] / theirs[leading]
                parts = {*ours, *theirs} - {leading}
                # The recursion ends: what moves in r comes after the leading part, in the order of names.
                r = sp.Add(*(motion * (ours.get(motion, 0) - q * theirs.get(motion, 0)) for motion in parts))
                yield q * side, r

    def _by_motion(self, e):
        """{part that moves: its coefficient} of a sum."""
        parts: dict = {}
        for term in sp.Add.make_args(e):
            coefficient, motion = term.as_independent(*self.dynamic, *self.surface, as_Add=False)
            parts[motion] = parts.get(motion, 0) + coefficient
        return parts

    def _symbol(self, s, signs):
        if s in self.ranges:
            return self.ranges[s]
        sign = signs.get(s, 0)
        if s in self.sums:
            low, high = self.of(self.sums[s], signs)
            sign = 1 if low >= 0 else -1 if high <= 0 else 0
        elif s not in self.dynamic:
            sign = 1 if s.is_nonnegative else -1 if s.is_nonpositive else sign
        return (0.0, math.inf) if sign > 0 else (-math.inf, 0.0) if sign < 0 else _EVERYTHING

    def _find(self, e, signs):
        if e.is_Symbol:
            return self._symbol(e, signs)
        if e.is_number:
            value = float(e) if e.is_extended_real else math.nan
            return (value, value) if value == value else _EVERYTHING
        if isinstance(e, (Select, sp.Piecewise)):
            parts = [self.of(branch, inside) for branch, inside in self.branches(e, signs)]
            return min(low for low, _ in parts), max(high for _, high in parts)
        inner = [self.of(a, signs) for a in e.args]
        if e.is_Add:
            return sum(low for low, _ in inner), sum(high for _, high in inner)
        if e.is_Mul:
            low, high = inner[0]
            for a, b in inner[1:]:
                ends = [p * q if p and q else 0.0 for p in (low, high) for q in (a, b)]  # 0 times inf is 0
                low, high = min(ends), max(ends)
            return low, high
        if isinstance(e, sp.Max):
            return max(low for low, _ in inner), max(high for _, high in inner)
        if isinstance(e, sp.Min):
            return min(low for low, _ in inner), min(high for _, high in inner)
        if e.is_Pow:
            return self._power(e, *inner[0])
        if isinstance(e, _INCREASING):
            low, high = inner[0]
            return _value(e.func, low), _value(e.func, high)
        return _RANGES.get(e.func, _EVERYTHING)

    def _power(self, e, low, high):
        p = e.exp
        if p.is_even:
            size = max(abs(low), abs(high))
            least = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
            low, high = least, size
        elif not p.is_integer:
            low, high = max(low, 0.0), max(high, 0.0)  # elsewhere it does not exist
        if not p.is_number:
            return (0.0, math.inf) if low >= 0 else _EVERYTHING
        if p > 0:
            return _raised(low, p), _raised(high, p)
        if low > 0 or high < 0:
            return _raised(high, p), _raised(low, p)
        return (0.0, math.inf) if low >= 0 else _EVERYTHING

    def branches(self, e, signs):
        """(branch, signs known in it) of a selection."""
        if isinstance(e, Select):
            lam, above, below = e.args
            return [
                (b, self._knowing(self.surface.get(lam, lam), s, signs)) for b, s in ((above, 1), (below, -1))
            ]
        result = []
        for branch, condition in e.args:
            inside = signs
            if isinstance(condition, (sp.Gt, sp.Ge, sp.Lt, sp.Le)):
                inside = self._knowing(condition.gts - condition.lts, 1, signs)
            result.append((branch, inside))
        return result

    def _knowing(self, h, sign, signs):
        """`signs` with that of h, and with those of surfaces on the sides that they tell of switches inside them."""
        c, inner = core(h)
        if inner in signs or not inner.free_symbols:
            return signs
        signs = signs | {inner: sign if c > 0 else -sign}
        for known, side in tuple(signs.items()):
            for lam in {s.args[0] for s in known.atoms(Select)} & self.surface.keys():
                c, within = core(self.surface[lam])
                if within in signs:
                    signs = self._knowing(on_side(known, lam, c * signs[within]), side, signs)
        return signs

    def never_zero(self, e, signs):
        """Whether no motion brings `e` to 0."""
        if e.is_Mul:
            return all(self.never_zero(factor, signs) for factor in e.args)
        if e.is_Pow:
            return self.never_zero(e.base, signs) if e.exp.is_positive else True
        if isinstance(e, sp.exp):
            return True
        low, high = self.of(e, signs)
        return low > 0 or high < 0 or self._sign(e, signs) != 0

    def _sign(self, e, signs):
        """1 or -1 where `e` is proved positive or negative, else 0."""
        plain = self._plain(e, signs)
        if plain.is_positive or plain.is_negative:
            return 1 if plain.is_positive else -1
        pieces = [(r, self.of(q, signs)) for q, r in self._beside(e, signs)]
        if e.is_Add:
            # One term decides the sign if no other term opposes it.
            lows, highs = zip(*(self.of(a, signs) for a in e.args))
            pieces += [(a, (min(lows), max(highs))) for a in e.args]
        for r, (low, high) in pieces:
            sign = self._sign(r, signs)
            if sign and (low >= 0 if sign > 0 else high <= 0):
                return sign
        # F_c + (F_s - F_c) exp(-u**2): affine in a bounded part, so that its ends decide.
        for part in sorted(e.atoms(sp.exp, *_BOUNDED), key=str) if e.is_Add else ():
            ends, stand_in = self.of(part, signs), sp.Dummy(real=True)
            if part.free_symbols and all(map(math.isfinite, ends)):
                line = e.xreplace({part: stand_in})
                slope = line.diff(stand_in)
                if slope != 0 and stand_in not in slope.free_symbols:
                    at_ends = {self._sign(line.xreplace({stand_in: sp.Rational(end)}), signs) for end in ends}
                    if len(at_ends) == 1:
                        return at_ends.pop()
        return 0

    def _plain(self, e, signs):
        """`e` for sympy's own rules of signs: states real, selections by their bounds."""
        stand_ins = {}
        for part in {*e.atoms(sp.Symbol), *e.atoms(Select)}:
            if part in self.dynamic or part in self.surface or isinstance(part, Select):
                low, high = self.of(part, signs)
                sign = {"nonnegative": True} if low >= 0 else {"nonpositive": True} if high <= 0 else {}
                stand_ins[part] = sp.Dummy(real=True, **sign)
        return e.xreplace(stand_ins)


def _value(function, at):
    """An increasing function at a number or at the end of all numbers."""
    return float(function(sp.Float(at) if math.isfinite(at) else sp.oo if at > 0 else -sp.oo))


def _raised(value, p):
    try:
        return value ** float(p) if value else (0.0 if p > 0 else math.inf)
    except OverflowError:
        return math.inf


class _Search:
    def __init__(self, field, others):
        others = {*others, *(s for s, _ in field.sums)}
        self.bounds = Bounds(field, others)
        self.moving = self.bounds.dynamic | self.bounds.ranges.keys()
        self.found: dict[sp.Expr, tuple[str, Argument]] = {}
        self.active: dict[
            sp.Expr, set
        ] = {}  # where each stands: conditions under which its branch is evaluated
        self.seen: set = set()
        self.inside: dict[sp.Basic, bool] = {}  # whether there are arguments in an expression
        self.highest = 1  # power whose branch point matters: dh/dt has one less than h

    def walk(self, e, signs, path=()):
        key = (e, frozenset(signs.items()), path, self.highest)
        if not self.has_arguments(e) or key in self.seen or e.free_symbols.isdisjoint(self.moving):
            return
        self.seen.add(key)
        for argument in arguments(e):
            for factor in sp.Mul.make_args(argument.zero):
                self.note(argument, factor, signs, path)
        if isinstance(e, Select):
            lam = e.args[0]
            for (branch, inside), condition in zip(self.bounds.branches(e, signs), (lam > -1, lam < 1)):
                self.walk(branch, inside, path if condition in path else (*path, condition))
            return
        if isinstance(e, sp.Piecewise):
            for branch, inside in self.bounds.branches(e, signs):
                self.walk(branch, inside, path)
            return
        for a in e.args:
            self.walk(a, signs, path)

    def has_arguments(self, e):
        if e not in self.inside:
            self.inside[e] = bool(arguments(e)) or any(map(self.has_arguments, e.args))
        return self.inside[e]

    def note(self, argument, factor, signs, path):
        while factor.is_Pow and factor.exp.is_positive:
            factor = factor.base
        if factor.free_symbols.isdisjoint(self.moving) or self.bounds.never_zero(factor, signs):
            return
        zero = core(factor)[1]
        kind = "end"
        if argument.power is None:
            kind = "pole"
        elif zero in signs:
            # The branch holds up to its own surface: with a power above 1 the motion takes infinite time to get there,
            # but not along a surface in which that power stands.
            if argument.power.is_number and argument.power > self.highest:
                return
            kind = "branch"
        elif self.bounds.of(factor, signs)[0] >= 0:
            kind = "cone"
        self.active.setdefault(zero, set()).add(path)
        if zero not in self.found or KINDS.index(kind) < KINDS.index(self.found[zero][0]):
            self.found[zero] = kind, argument._replace(zero=factor)


def watched(field, others=()):
    """Events at the singular arguments of a lifted field; `others` are symbols that move besides its own."""
    search = _Search(field, others)
    surfaces = {h for _, h in field.switches}
    for e in (*field.rates, *(h for _, h in field.switches), *(r for _, r in field.algebraic),
              *(gap for _, gap, _ in field.contacts), *(e for _, e in field.sums),
              *(event.surface for event in field.events if event.surface is not None)):  # fmt: skip
        search.highest = 2 if e in surfaces else 1
        search.walk(e, {})
    return tuple(
        EventSpec(
            str(argument.function),
            argument.zero,
            # Of a selection only the active branch is evaluated; where a switch slides, both are.
            when=sp.Or(*(sp.And(*path) for path in sorted(search.active[zero], key=str))),
            singular=kind,
        )
        for zero, (kind, argument) in search.found.items()
    )


def remedy(model, event, stands=False):
    """What to do about a motion that has come to this singular argument; `stands`: in finite time, to rest there."""
    zero = event.surface
    if event.singular == "end" and stands:
        return f"the motion comes to rest there in finite time; make {zero} a state of its own, so that it can stay"
    if event.singular == "end":
        return (
            f"the motion goes on to where {event.name} is not defined; write it with Max(0, {zero}), or let an Event "
            "at the same place say what happens"
        )
    together = [str(x) for x in model.states if x in zero.free_symbols]
    if len(together) > 1:
        return (
            f"{' and '.join(together)} stand under one root and vanish together, and what is divided by it has no "
            f"limit there (the direction of a velocity in the plane); write {zero} + w**2 with a small w for it"
        )
    return "the field has no limit there; add a small number to it, or let a terminal Event stop the run before"
