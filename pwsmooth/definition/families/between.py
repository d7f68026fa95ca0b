"""What stands between an element and its neighbours: surfaces that read both, contacts and friction that push both.

    h = h(z_i, z_j):   dh/dt = h_t + (grad_i h) . f_i + (grad_j h) . f_j,     f_j: the rates of the element, in j
    contact            z_i+ = z_i + J df_i/dR_i,   z_j+ = z_j + J df_j/dR_i   with the J that makes  h'+ = -e h'-

A surface belongs to the element in which it is written. One that switches without being held (a kink, a crossing) may
be written at either end of a link; each end then has its own. Friction that may hold is one: what the other end says of
it is the neighbour's multiplier.
Chain: expansion.py -> **this file** -> one_element.py.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, combinations

import sympy as sp

from ..model import Beside, Multiplier, Select
from ..regularity import total_derivative
from .template import LINKED, Place


class NoTemplate(ValueError):
    """This system has no template; its elements are written out."""


class Neighbours:
    """Expressions of an element as those of its neighbours; adds the symbols that these need to `places`.

    `field` is that of one element; `reactions` and multipliers that `hold` are 0 beyond an end of the chain.
    """

    def __init__(self, field, places, periodic):
        self.places, self.periodic = places, periodic
        self.reactions, self.hold = {R for R, *_ in field.contacts}, set()
        self.take(field)

    def take(self, field):
        """Another form of the field."""
        self.field, self.rate = field, dict(zip(field.states, field.rates, strict=True))

    def of(self, e):
        """Symbols of neighbours in an expression."""
        return {s for s in e.free_symbols if s in self.places and self.places[s].offset}

    def at(self, e, offset, known=True):
        """An expression of the element in the neighbour `offset` places along, or in that column of a table.

        What a neighbour reads by a table, or beside it, has no place here: NoTemplate, or a new symbol if need not be
        `known`.
        """
        return e.xreplace({s: self._moved(s, offset, known) for s in e.free_symbols if s in self.places})

    def _moved(self, s, offset, known):
        place = self.places[s]
        tables = max(offset, place.offset) >= LINKED
        if place.base is None and not place.offset and not tables and not self.periodic[place.family]:
            return s + offset  # the number of the element
        if place.base is None and place.offset and not tables:
            # A neighbour on this side has all between it and the element; on the other, what lies beyond it.
            return self.absent(place.family, place.offset + offset) if place.offset * offset > 0 else sp.S.Zero
        if place.base is None or (tables and place.offset):
            if known:
                raise NoTemplate("neighbours of neighbours by a table")
            return sp.Symbol(f"{s.name} of {offset}", **s._assumptions_orig)
        total = offset + place.offset
        if total == 0:
            return place.base
        # Beyond an end it is what the neighbour, which is there, has in its place.
        outside = (
            self.at(place.outside, offset, known) if place.offset and place.outside is not None else place.base
        )
        return self.symbol(place.base, place.family, total, outside)

    def symbol(self, base, family, offset, outside):
        """The symbol of a neighbour."""
        if base in self.reactions | self.hold:
            outside = sp.S.Zero
        if self.periodic[family] and offset < LINKED:
            outside = None
        wanted = Place(family, base, offset, outside)
        for s, place in self.places.items():
            if place == wanted:
                return s
        mark = "" if outside in (None, 0) else f"|{outside}"
        s = sp.Symbol(f"{base.name}[{offset:+d}{mark}]", **base._assumptions_orig)
        self.places[s] = wanted
        return s

    def absent(self, family, offset):
        """1 in an element that has no such neighbour, else 0."""
        if self.periodic[family] and offset < LINKED:
            return sp.S.Zero
        s = sp.Symbol(f"no[{offset:+d}]", nonnegative=True)
        self.places.setdefault(s, Place(family, None, offset))
        return s

    def rate_of(self, s, known=True):
        """d/dt of a neighbour's state, beyond an end of the chain of what stands for it."""
        place = self.places[s]
        rate = self.at(self.rate.get(place.base, sp.S.Zero), place.offset, known)
        if not known or place.outside in (None, place.base):
            return rate
        gone = self.absent(place.family, place.offset)
        outside = total_derivative(place.outside, self.field.time, self.field.states, self.field.rates)
        return (1 - gone) * rate + gone * outside

    def along(self, h, known=True):
        """dh/dt, what neighbours do included."""
        own = total_derivative(h, self.field.time, self.field.states, self.field.rates)
        beside = sorted(self.of(h), key=str)
        return own + sp.Add(
            *(h.diff(s) * self.rate_of(s, known) for s in beside if self.places[s].base in self.rate)
        )

    # ---- elements that lack a neighbour

    def _alone(self, h, missing):
        """A surface in an element that lacks the neighbours at some places; None if it tells nothing there."""
        beside = {s: self.places[s].outside for s in self.of(h) if self.places[s].offset in missing}
        bases = {self.places[s].base for s in beside if self.places[s].outside == self.places[s].base}
        left = h.xreplace(beside)
        bare = bases and not any(self.places[s].base in bases for s in left.free_symbols if s in self.places)
        return None if bare else left

    def where_there_is_one(self, h):
        """The surface of an event or a contact, 1 in elements that have none: those without the neighbour it reads."""
        for missing in self._missing(h):
            if self._alone(h, missing) is None:
                if len(missing) > 1:
                    raise NoTemplate("a surface between several neighbours")
                (offset,) = missing
                family = next(self.places[s].family for s in self.of(h))
                gone = self.absent(family, offset)
                h = (1 - gone) * h + gone
        return h

    def none_at_an_end(self, h):
        """1 in elements in which the surface of a switch is 0 at all times, as there is no neighbour, else 0."""
        for missing in self._missing(h):
            beside = {s: self.places[s].outside for s in self.of(h) if self.places[s].offset in missing}
            if sp.expand(h.xreplace(beside)) == 0:
                if len(missing) > 1:
                    raise NoTemplate("a surface between several neighbours")
                (offset,) = missing
                return self.absent(next(self.places[s].family for s in beside), offset)
        return sp.S.Zero

    # ---- friction between neighbours

    def may_hold(self, lam, h):
        """Whether a switch between neighbours moves them apart or together where its surface stands at 0."""
        if not self.of(h):
            return False
        force = self.along(h, known=False).diff(lam)
        x = next((s for s in sorted(h.free_symbols, key=str) if h.diff(s).is_number and h.diff(s) != 0), None)
        return sp.expand(force if x is None else force.subs(x, sp.solve(h, x)[0])) != 0

    def take_friction(self):
        """The field in which friction between neighbours is one multiplier, and none beyond an end of the chain."""
        switches = list(self.field.switches)
        self.hold = {lam for lam, h in switches if self.may_hold(lam, h)}
        for lam, h in switches:
            other = self._as_of_neighbour(lam, h) if lam in self.hold else None
            if other is not None:
                self._rewrite({lam: other}, without=lam)
        for lam, h in self.field.switches:
            if lam in self.hold and (gone := self.none_at_an_end(h)) != 0:
                self._rewrite({lam: (1 - gone) * lam})
        return self.field

    def _rewrite(self, changed, without=None):
        """Puts other expressions for a multiplier in the rates, where it may stand as a factor alone."""
        field = self.field
        (lam,) = changed
        elsewhere = [
            *(h for _, h in field.switches),
            *(r for _, r in field.algebraic),
            *(e for _, e in field.outputs),
        ]
        elsewhere += [e for _, gap, e0 in field.contacts for e in (gap, e0)]
        elsewhere += [
            e for event in field.events for e in (event.surface, event.when, *(e for _, e in event.update)) if e
        ]
        chosen = [c for e in field.rates for c in e.atoms(Select, sp.Piecewise) if lam in c.free_symbols]
        if chosen or any(lam in e.free_symbols for e in elsewhere):
            raise NoTemplate("friction between neighbours that is more than a force")
        self.hold.discard(without)
        self.take(
            replace(
                field,
                rates=tuple(e.xreplace(changed) for e in field.rates),
                switches=tuple((s, h) for s, h in field.switches if s != without),
            )
        )

    def _as_of_neighbour(self, lam, h):
        """+-lambda of the neighbour to which the same surface belongs as well; None where there is none."""
        offsets = {self.places[s].offset for s in self.of(h)}
        if len(offsets) != 1 or min(offsets) >= LINKED or max(offsets) > 0:
            return None  # the surface is that of the element before
        (offset,) = offsets
        for own, other in self.field.switches:
            if (
                own == lam
                or own not in self.hold
                or {self.places[s].offset for s in self.of(other)} != {-offset}
            ):
                continue
            there = self.at(other, offset)
            for sign in (1, -1):
                if sp.expand(h - sign * there) == 0:
                    return sign * self.symbol(own, self.places[own].family, offset, sp.S.Zero)
        return None

    def _missing(self, h):
        """Sets of neighbours that an element may lack."""
        places = {self.places[s] for s in self.of(h) if self.places[s].outside is not None}
        offsets = sorted({p.offset for p in places})
        return [set(part) for part in chain(*(combinations(offsets, k + 1) for k in range(len(offsets))))]

    def mirrors(self, surfaces):
        """(number, place, ((number, place), ...)) of surfaces that neighbours may have too, and which of theirs.

        With the element and its neighbour in each other's place it is one of these surfaces, up to its sign.
        """
        generic, swapped = {}, {}
        for b, h in enumerate(surfaces):
            beside = self.of(h)
            places = {self.places[s].offset for s in beside}
            if len(places) != 1:
                continue
            own = {self.places[s].base: sp.Symbol(f"own {self.places[s].base}", real=True) for s in beside}
            other = {s: sp.Symbol(f"other {self.places[s].base}", real=True) for s in beside}
            if h.free_symbols & self.places.keys() - own.keys() - other.keys():
                continue  # something that the neighbour has of its own
            key = b, places.pop()
            generic[key] = sp.expand(h.xreplace(own | other))
            over = {new: sp.Symbol(new.name.replace("other", "own"), real=True) for new in other.values()}
            back = {new: sp.Symbol(new.name.replace("own", "other"), real=True) for new in own.values()}
            swapped[key] = sp.expand(generic[key].xreplace(over | back))
        found = []
        for (b, offset), h in swapped.items():
            same = tuple(key for key, other in generic.items() if h in (other, sp.expand(-other)))
            if same:
                found.append((b, offset, same))
        return tuple(found)

    # ---- contacts

    def contact(self, R, gap, restitution, order):
        """The Multiplier of a contact between neighbours; `order`: states, memories."""
        speed = self.along(gap)
        if self.reactions & {self.places[s].base for s in speed.free_symbols if s in self.places}:
            raise NoTemplate("a reaction in the rate of its gap")
        along, pushes = sp.S.Zero, []
        for s in sorted(speed.free_symbols & self.places.keys(), key=str):
            place = self.places[s]
            if place.base not in self.rate:
                continue
            rate, slope = self.rate[place.base], speed.diff(s)
            for q in sorted(rate.free_symbols & self.places.keys(), key=str):
                if self.places[q].base not in self.reactions:
                    continue
                push = rate.diff(q)
                if self.reactions & {self.places[a].base for a in push.free_symbols if a in self.places}:
                    raise NoTemplate("rates that are not linear in a reaction")
                push, acts = (self.at(e, place.offset) if place.offset else e for e in (push, q))
                if acts == R:
                    along += slope * push
                    index = order.index(place.base)
                    pushes.append((Beside(index, place.offset, s) if place.offset else index, s, push))
        if along == 0:
            raise NoTemplate("a contact whose reaction does not act on its gap")
        written = []
        for index, s, push in pushes:
            stop = push * speed / along
            written.append((index, _short(s - stop) - restitution * _short(stop)))
        return Multiplier(R, "contact", self.along(speed), gap, impact=tuple(written))


def _short(e):
    """`e` expanded, so that equal terms cancel exactly."""
    return sp.expand(sp.cancel(e)) if sp.count_ops(e) <= 60 else e
