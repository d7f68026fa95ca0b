"""Classes of switches: what the field does across a surface h = 0.

    kink      f(lambda) is the same for all lambda on h = 0: never slides, has no layer
    sliding   relative degree 1: lambda stands in  dh/dt = grad h . f + h_t
    crossing  relative degree 2 and more (position surfaces), or h depends on time alone; of degree 2 it can still
              hold the motion at h = dh/dt = 0 where both sides push back (second-order sliding)

Whether two expressions agree *on a surface* is asked at random points of it (pointwise.py). Parameters are
drawn beside their values: what agrees for one special value only (a friction force of 0) is not generic, and
one lowered model serves a whole sweep, while the order of thresholds (z_ba < z_max) is kept.
Chain: lifting.py -> regularity (here) -> lowering.py.
"""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import sympy as sp

from .model import Entry, Held, Select
from .pointwise import draw, value

POINTS = 8  # on the surface; two would do for polynomials, more reach the branches of a Piecewise
# Sizes of the states, tried until one meets the surface: coordinates of size 1 miss a clearance of 1e-4.
SIZES = (1.0, *(10.0**-k for k in range(1, 9)), *(10.0**k for k in range(1, 5)))
TRIES = 8  # in vain, before the next size
TOLERANCE = 1e-9  # rounding of f, relative to its size beside the surface
ROUNDING = 1e-13  # of a difference of two values of one expression
_BETWEEN = (1.0, -1.0, 0.3, -0.6)  # values of lambda: even, odd and higher terms all show


def total_derivative(h, time, states, rates):
    """dh/dt along the field, switches and unknowns held."""
    free = h.free_symbols
    terms = [h.diff(x) * f for x, f in zip(states, rates, strict=True) if x in free]
    return sp.Add(h.diff(time) if time in free else 0, *terms)


def affine_in(e, lam, surface=None):
    """`e` with the selections by one multiplier in their affine form; on its `surface`, if given."""
    selections = {s: s.affine(surface) for s in e.atoms(Select) if s.args[0] == lam}
    return e.xreplace(selections) if selections else e


def _on_surface(e, lam, surface):
    """`e` where a surface is 0: there powers of it are 0, and not those of its rounding."""
    selections = {s: Select(lam, *s.on(surface)) for s in e.atoms(Select) if s.args[0] == lam}
    return e.xreplace(selections) if selections else e


def may_skip_orders(e, time, moving):
    """Whether the Taylor series of a motion may lack orders that come again later, as that of 1/(1 + t**4) does.

    Not where the rates are affine in what moves, forced by sin, cos and exp of a line in time: an order that none of
    the states has is then followed by none.
    """
    changing = moving | {time}

    def stands(a):
        # A choice between constants stands for the whole of a step, as the multiplier that makes it does.
        branches = a.args[1:] if isinstance(a, Held) else (a,)
        return all(b.free_symbols.isdisjoint(changing) for b in branches)

    if e in changing or stands(e):
        return False
    if e.is_Add:
        return any(may_skip_orders(a, time, moving) for a in e.args)
    if e.is_Mul:
        factors = [a for a in e.args if not stands(a)]
        return len(factors) > 1 or may_skip_orders(factors[0], time, moving)
    if isinstance(e, (sp.sin, sp.cos, sp.exp)) and e.free_symbols.isdisjoint(moving):
        return e.args[0].diff(time).has(time)
    if isinstance(e, Select) and e.args[0] not in moving:
        return any(may_skip_orders(branch, time, moving) for branch in e.args[1:])
    return True


class Surface:
    """Random points on the surface of one switch of a lifted field.

    A point is a dict with the values of all symbols of the given expressions.
    """

    def __init__(self, field, index, expressions):
        self.field = field
        self.lam, self.h = field.switches[index]
        self.switches = field.switches_of([self.h, *expressions])
        self.inner = field.switches_of([self.h])
        symbols = set().union(self.h.free_symbols, *(e.free_symbols for e in expressions))
        symbols = symbols.union(*(h.free_symbols for _, h in self.switches))
        self.symbols = sorted(symbols, key=lambda s: s.name)
        unknowns = [u for u, *_ in (*field.algebraic, *field.contacts)]
        free = self.h.free_symbols
        self.coordinates = [x for x in (*field.states, field.time, *unknowns) if x in free]
        typical = zip(field.parameters, field.typical, strict=False)
        self.typical = {p: size for p, size in typical if size != 0}
        shown = [self.h, *expressions, *(h for _, h in self.switches)]
        self.entries = set().union(*(e.atoms(Entry) for e in shown))
        self.points: list[tuple[dict, dict]] = []
        for size in SIZES if self.coordinates else ():
            for k in range(4 * POINTS):
                pair = self._pair(k, size)
                # Shrink the sample: a mechanism may be undefined at coordinates of order 1.
                if pair and self._defined(expressions, pair[1]):
                    self.points.append(pair)
                if len(self.points) == POINTS:
                    return
                if k >= TRIES and not self.points:
                    break

    def _defined(self, expressions, point):
        """Whether some expression with this multiplier has a value on one of its sides."""
        among = [e for e in expressions if self.lam in e.free_symbols]
        sides = [point | {self.lam: s} for s in (1.0, -1.0)]
        return not among or any(not math.isnan(value(e, at)) for e in among for at in sides)

    def _pair(self, k, size):
        """A point beside the surface and one on it, which differ in one coordinate."""
        point = {s: draw(s, k) for s in self.symbols}
        for x in self.field.states:
            if x in point:
                point[x] *= size
        for memory in (m for m in self.field.memories if m in point):
            # Flags are sampled at the values that they can take, not at random reals.
            choices = self.field.memory_values[memory]
            point[memory] = random.Random(f"{memory.name} {k}").choice((*choices, draw(memory, k)))
        for p in self.typical.keys() & point.keys():
            point[p] = self.typical[p] * (1.0 if p.is_integer else 1 + 0.03 * draw(p, k))
        self._put_in_cells(point, k)
        coordinate = self.coordinates[k % len(self.coordinates)]
        beside = self._with_signs(dict(point))
        on = dict(point)
        if self.h == coordinate:
            on[coordinate] = 0.0
        elif not self._solve(on, coordinate, size):
            return None
        wrong = -1.0 if coordinate.is_nonnegative else 1.0 if coordinate.is_nonpositive else 0.0
        if wrong * on[coordinate] > 0.0:
            return None  # the surface is met, but where this coordinate never is
        return beside, self._with_signs(on)

    def _put_in_cells(self, point, k):
        """Drives have values that they have in some cell of their records: the least, the largest, the middle, ..."""
        rank = float(k) if k < 2 else _halved(k - 1)
        for entry in sorted(self.entries, key=str):
            table, cell, column = entry.args
            rows, steps = table.rows, random.Random(f"{cell} {k}")
            row = int(rows[:, -1].argsort()[round(rank * (len(rows) - 1))])
            if column == 0:
                length = (rows[row + 1, 0] if row + 1 < len(rows) else table.end) - rows[row, 0]
                point[entry] = point.get(self.field.time, 0.0) - steps.random() * length
            else:
                point[entry] = float(rows[row, int(column)])

    def reach_beyond(self):
        """Moves the points, along what does not stand in h, to both sides of the thresholds of other switches; whether
        there are any: of `t > 5` points of size 1 know one side alone.
        """
        fixed = self.h.free_symbols.union(*(h.free_symbols for _, h in self.inner))
        others = [(h, h.free_symbols) for s, h in self.switches if (s, h) not in self.inner and s != self.lam]
        free = {c for _, among in others for c in (*self.field.states, self.field.time) if c in among - fixed}
        moved = []
        for k, (beside, on) in enumerate(self.points * 4):
            shift = {}
            for c in sorted(free, key=str):
                steps = random.Random(f"{c} {k}")
                roots = sorted(r for h, among in others if c in among and math.isfinite(r := _root(h, on, c)))
                if roots:
                    ends = roots[0] - 1 - abs(roots[0]), roots[-1] + 1 + abs(roots[-1])
                    shift[c] = steps.choice(
                        [(a + b) / 2 for a, b in itertools.pairwise((ends[0], *roots, ends[1]))]
                    )
            if shift:
                moved.append((self._with_signs(beside | shift), self._with_signs(on | shift)))
        self.points = moved
        return bool(moved)

    def _at(self, point, coordinate, c):
        point[coordinate] = c
        for lam, h in self.inner:
            self._set_sign(point, lam, h)
        return value(self.h, point)

    def _solve(self, point, coordinate, size):
        """Put h = 0 by one coordinate: a secant for what is affine in it, else bisection."""
        near = a = point[coordinate]
        b = a + size
        ha, hb = (self._at(point, coordinate, c) for c in (a, b))
        if ha != hb:
            root = a - ha * (b - a) / (hb - ha)
            if abs(self._at(point, coordinate, root)) <= 1e-13 * (abs(ha) + abs(hb)):
                return True
        grid = [size * (-6.02 + 0.5 * i) for i in range(25)]
        values = [self._at(point, coordinate, c) for c in grid]
        # The nearest one first: the far steps of stairs may all be beyond where a quantiser saturates.
        for a, b, ha, hb in sorted(
            zip(grid, grid[1:], values, values[1:], strict=False),
            key=lambda part: abs(part[0] + part[1] - 2 * near),
        ):
            if ha * hb < 0:
                for _ in range(60):
                    middle = (a + b) / 2
                    a, b = (middle, b) if self._at(point, coordinate, middle) * ha > 0 else (a, middle)
                # h changes sign at a pole too, which is no zero of it.
                return abs(self._at(point, coordinate, a)) <= 1e-9 * (abs(ha) + abs(hb))
        return False

    def _with_signs(self, point):
        for lam, h in self.switches:
            self._set_sign(point, lam, h)
        return point

    @staticmethod
    def _set_sign(point, lam, h):
        size = value(h, point)
        # Where two surfaces meet by construction any side of the other one will do.
        point[lam] = math.copysign(1.0, size) if size else 1.0

    def differ(self, expr, values=_BETWEEN):
        """Does `expr` depend on lambda on the surface? None if no point could tell."""
        spread, scale = [], 0.0
        expr = _part_with(self.lam, expr)  # a weak friction beside a strong spring is a friction all the same
        for beside, on in self.points:
            at = [value(expr, on | {self.lam: s}) for s in values]
            sides = [value(expr, beside | {self.lam: s}) for s in (1.0, -1.0)]
            if not any(map(math.isnan, at)):
                spread.append(max(at) - min(at))
                scale = max(scale, abs(at[0]), *(abs(a) for a in sides if not math.isnan(a)))
        return max(spread) > TOLERANCE * scale if spread else None

    def nonlinear(self, expr, symbol=None):
        """Is `expr` nonlinear in lambda (or in another symbol) on the surface?"""
        symbol = symbol or self.lam
        return any(_bends(expr, lambda s, on=on: on | {symbol: s}) for _, on in self.points)


def _halved(k):
    """1/2, 1/4, 3/4, 1/8, ...: the k-th number of van der Corput."""
    return sum(int(digit) / 2 ** (i + 1) for i, digit in enumerate(reversed(f"{k:b}")))


def _root(h, point, c):
    """Where an expression that is affine in one coordinate vanishes; inf or nan where there is none."""
    a, b = value(h, point | {c: 0.0}), value(h, point | {c: 1.0})
    root = -a / (b - a) if a != b else math.inf
    return root if abs(value(h, point | {c: root})) <= TOLERANCE * (abs(a) + abs(root * (b - a))) else math.nan


def _bends(e, at):
    """Whether an expression is no affine function of s at the points at(s)."""
    low, middle, off, high = (value(e, at(s)) for s in (-1.0, 0.0, 0.5, 1.0))
    defects = abs(middle - (low + high) / 2), abs(off - (low + 3 * high) / 4)
    return max(defects) > TOLERANCE * (abs(low) + abs(high) + abs(middle))


def _part_with(symbol, e):
    """`e` without the terms in which a symbol does not stand, also within its one factor that contains it."""
    if e.is_Add:
        return sp.Add(*(_part_with(symbol, term) for term in e.args if symbol in term.free_symbols))
    if e.is_Mul:
        among = [factor for factor in e.args if symbol in factor.free_symbols]
        if len(among) == 1:
            return sp.Mul(*(_part_with(symbol, f) if f is among[0] else f for f in e.args))
    return e


def residual_of(field, index):
    """g of a switch: dh/dt, or h where h contains an unknown of the same instant.

    Friction that depends on the acceleration has such a surface: h itself is kept, nothing is differentiated.
    """
    h = field.switches[index][1]
    unknowns = {u for u, *_ in (*field.algebraic, *field.contacts)}
    if not unknowns.isdisjoint(h.free_symbols):
        return h
    return total_derivative(h, field.time, field.states, field.rates)


def without_unknowns(field, h):
    """A surface of time and states alone with the sign of h, in which unknowns stand; None where none is found.

    The unknown of  r(a) = 0  is  a - r/r'  where r is affine. Else, with  h = c (a - b)  affine, the sign is that of
    -c r' r(b),  for r is monotone.
    """
    equations = dict(field.algebraic)
    for _ in equations:
        among = sorted(equations.keys() & h.free_symbols, key=lambda a: a.name)
        if not among:
            break
        a, r = among[0], equations[among[0]]
        slope, c = r.diff(a), h.diff(a)
        if slope.is_number and slope != 0:
            h = h.xreplace({a: sp.expand(a - r / slope)})
        elif c.is_number and c != 0:
            points = [{s: draw(s, k) for s in slope.free_symbols} for k in range(POINTS)]
            signs = {math.copysign(1.0, size) for p in points if not math.isnan(size := value(slope, p))}
            if len(signs) != 1:
                return None
            h = -sp.sign(c) * int(signs.pop()) * r.xreplace({a: sp.expand(a - h / c)})
        else:
            return None
    unknowns = {*equations, *(R for R, *_ in field.contacts)}
    return None if unknowns & h.free_symbols else h


def second_derivative(field, index, speed):
    """d2h/dt2 of a crossing where its multiplier can hold it at 0; None where that is not so or not told.

    While the motion chatters about such a surface the multiplier is 1 or -1, and what holds is the mean. So the field
    has to be affine in it, and `speed` = dh/dt must not jump with any multiplier. All that on the surface, where its
    powers are 0: in super-twisting control, s' = -|s|**0.5 sign s + w and w' = -sign s, the speed is w there.
    """
    lam, h = field.switches[index]
    speed = affine_in(speed, lam, h)
    free = speed.free_symbols
    moving = {*(s for s, _ in field.switches), *(u for u, *_ in (*field.algebraic, *field.contacts))}
    moving |= {lam for disc in field.discs for lam in disc.components}
    if not free.isdisjoint(moving):
        return None
    acceleration = total_derivative(speed, field.time, field.states, field.rates)
    if lam not in acceleration.free_symbols:
        return None
    acceleration = affine_in(acceleration, lam, h)
    dependent = [affine_in(e, lam, h) for e in field.by_multiplier[lam]]
    surface = Surface(field, index, [acceleration, *dependent])
    if not surface.differ(acceleration) or any(surface.nonlinear(e) for e in (acceleration, *dependent)):
        return None
    return acceleration


def beside_kinks(field, index, speed, kinks):
    """g of a switch that slides with `speed` = dh/dt, also while one of the `kinks` is held; None if that is dh/dt.

    Of x' = v, v' = -lambda the surface x + v |v| has dh/dt = v - 2 |v| lambda. At v = 0 nothing is left of that lambda,
    and what keeps the motion on the surface is d2h/dt2 = v'.
    """
    lam = field.switches[index][0]
    for kink, h in kinks:
        at_zero = affine_in(speed, kink, h).xreplace({kink: sp.S.Zero})
        if kink not in speed.free_symbols or lam in at_zero.free_symbols:
            continue
        acceleration = total_derivative(at_zero, field.time, field.states, field.rates)
        if lam in acceleration.free_symbols:
            others = [k for k in kinks if k[0] != kink]
            apart = beside_kinks(field, index, speed, others) or speed
            return Held(kink, apart, acceleration)
    return None


def classify(field, index, residual):
    """(class, hidden) of one switch of a lifted field."""
    lam, h = field.switches[index]
    dependent = [_on_surface(e, lam, h) for e in field.by_multiplier[lam]]
    if not dependent:
        return "kink", False
    residual = _on_surface(residual, lam, h)
    response = Response(field, lam, residual)
    surface = Surface(field, index, [residual, *dependent, *response.equations])
    found = _class_on(surface, lam, residual, dependent, response)
    if found[0] != "sliding" and surface.reach_beyond():
        beyond = _class_on(surface, lam, residual, dependent, response)
        found = found if beyond[0] == "kink" else beyond
    return found


def _class_on(surface, lam, residual, dependent, response):
    """(class, hidden) as the points of a surface tell it."""
    if all(surface.differ(e) is False for e in dependent):
        return "kink", False
    if response.unknowns:
        acts, bends = response.at(surface)
        return ("sliding", bends) if acts else ("crossing", False)
    if lam not in residual.free_symbols or surface.differ(residual) is False:
        return "crossing", False
    return "sliding", surface.nonlinear(residual)


class Response:
    """How a residual follows a multiplier through the unknowns of the same instant that this moves."""

    def __init__(self, field, lam, residual):
        self.lam, self.residual = lam, residual
        every = {a for a, _ in field.algebraic}
        moved: set[sp.Symbol] = set()
        while True:
            # In one equation with it, or with what it moves.
            found = [e for _, e in field.algebraic if not e.free_symbols.isdisjoint({lam, *moved})]
            if moved == (reached := every & set().union(*(e.free_symbols for e in found))):
                break
            moved = reached
        if moved.isdisjoint(residual.free_symbols):
            moved, found = set(), []
        self.unknowns, self.equations = sorted(moved, key=lambda a: a.name), found

    def at(self, surface):
        """(whether the residual changes with the multiplier, whether an equation with that bends on the way)."""
        acts = bends = told = False
        # An equation without it is monotone in its unknown (Algebraic): it bends g and leaves it the one root.
        direct = [self.residual, *(e for e in self.equations if self.lam in e.free_symbols)]
        for _, on in surface.points:
            way = self._way(on)
            if way is None:
                continue
            told = True
            low, high = (value(self.residual, self._along(on, way, s)) for s in (-1.0, 1.0))
            alone = [self._along(on, part, s) for part in np.diag(way) for s in (-1.0, 1.0)]
            parts = [value(self.residual, point | {self.lam: 0.0}) for point in alone]
            parts += [value(self.residual, on | {self.lam: s}) for s in (-1.0, 1.0)]
            most = max(abs(b - a) for a, b in zip(parts[::2], parts[1::2], strict=True))
            acts = acts or abs(high - low) > max(TOLERANCE * most, ROUNDING * (abs(high) + abs(low)))
            bends = bends or any(_bends(e, lambda s, on=on, way=way: self._along(on, way, s)) for e in direct)
        if told:
            return acts, bends
        return True, any(surface.nonlinear(e) for e in direct)

    def _along(self, on, way, s):
        return on | {self.lam: s} | {a: on[a] + s * w for a, w in zip(self.unknowns, way, strict=True)}

    def _way(self, on):
        """The change of the unknowns a multiplier: differences are exact where the equations are affine."""
        symbols = (*self.unknowns, self.lam)
        J = np.zeros((len(self.equations), len(symbols)))
        for i, e in enumerate(self.equations):
            for k, symbol in enumerate(symbols):
                if symbol in e.free_symbols:
                    centre = 0.0 if symbol == self.lam else on[symbol]
                    high, low = (value(e, on | {symbol: centre + s}) for s in (1.0, -1.0))
                    J[i, k] = (high - low) / 2
        J, b = J[:, :-1], J[:, -1]
        if len(self.equations) != len(self.unknowns) or not np.isfinite(J).all() or not np.isfinite(b).all():
            return None
        way, _, rank, _ = np.linalg.lstsq(J, -b)
        # What is nothing but rounding beside the others does not move.
        return np.where(np.abs(way) > ROUNDING * np.abs(way).max(), way, 0.0) if rank == len(way) else None
