"""Writing the elements of families out: what a member, a sum, an event or a contact is in every element.

Chain: family.py -> expansion (here) -> reading.py; one_element.py writes one element out for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatchmethod

import sympy as sp

from ...door import checks
from ..model import of_event
from ..primitives import Algebraic, Component, Disc, Event, Reaction, Switch, Unilateral
from .family import Family, Member, MemberMemory, MemberSum, OfNeighbour, family_of, involved, members
from .many import MANY, Names


class Expansion:
    """Writes the elements of families out.

    `groups` maps the name of a member, or of a switch or contact with members, to the names in all elements, `members`
    a plain symbol to the name of the member and the number of the element.
    """

    def __init__(self):
        self.groups: dict[str, Sequence[str]] = {}
        self.sums: dict[sp.Symbol, tuple[Family, sp.Expr]] = {}  # of what is not written out (one_element.py)
        self.members: dict[sp.Symbol, tuple[str, int]] = {}
        self._memo: dict[tuple[sp.Basic, int | None], sp.Basic] = {}

    def element(self, e, k):
        """The expression (or condition) of element k; k is None outside of all families."""
        if isinstance(e, MemberSum):
            return self.total(e.args[0], family_of(e.args[0]))
        if isinstance(e, (Member, MemberMemory)):
            return self._member(e, k)
        if isinstance(e, OfNeighbour):
            return self._of_neighbour(e, k)
        if isinstance(e, (Switch, Reaction, Component)):
            return self._primitive(e, k)
        if not e.args:
            return e
        if (e, k) not in self._memo:
            of_family = involved(e)
            self._memo[e, k] = e.func(*(self.element(a, k) for a in e.args)) if of_family else e
        return self._memo[e, k]

    def total(self, e, family):
        """The sum of an expression over a family."""
        return sp.Add(*(self.element(e, j) for j in self.elements(family)))

    def elements(self, family):
        """The numbers k of the elements to be written out."""
        return range(family.n)

    def lacks(self, member, k):
        """Whether element k does not have that neighbour."""
        if k is None or not member.offset:
            return False
        if member.links is not None:
            return int(member.links.table[k, member.offset - 1]) == k
        return member.of_element(k) is None

    def has_no(self, surface, k):
        """Whether a surface between neighbours is none of element k: it lacks one of whom the surface would tell."""
        beside = {m for m in members(surface) if isinstance(m, Member) and self.lacks(m, k)}
        beside = {m: m.outside for m in beside if _itself(m.outside, m.name)}
        names = {m.name for m in beside}
        return bool(beside) and not any(m.name in names for m in members(surface.xreplace(beside)))

    def label(self, name, k, space="_"):
        """Name of something in element k."""
        return f"{name}{space}{k + 1}"

    def parameters(self, values):
        """Values of parameters by name, one entry an element.

        Not those of elements in which a parameter has no place: a contact's, where there is no neighbour.
        """
        made = {s.name for s in self.members}
        elements = {name for group in self.groups for name in self.groups[group]}
        given = spread(values, self.groups, "`parameters`")
        return {key: value for key, value in given.items() if _name(key) not in elements or _name(key) in made}

    def further(self):
        """(symbols with a meaning of their own, those of them that move, expressions behind them)."""
        return {}, set(), ()

    def beside(self, symbol):
        """(symbol of the element itself, offset) of a neighbour's; None for any other."""
        return None

    def _member(self, m, k):
        if k is None:
            raise ValueError(f"{m} is a member of a family of {m.family.n}; outside of its rates take a sum.")
        symbol = m.of_element(k)
        if symbol is None:
            return self.element(m.outside, k)
        if symbol.is_Symbol:
            self.members[symbol] = (m.name, k)
            self._group(m.name, m.family.n)
        return symbol

    def _of_neighbour(self, s, k):
        if k is None:
            raise ValueError(f"{s} is a member of a family of {s.family.n}; outside of its rates take a sum.")
        at = k + s.offset
        if s.family.periodic:
            at %= s.family.n
        return self.element(s.of, at) if 0 <= at < s.family.n else self.element(s.outside, k)

    def _primitive(self, s, k):
        if not involved(s):
            return s
        disc = s.disc if isinstance(s, Component) else None
        surfaces = disc.surfaces if disc else (s.gap if isinstance(s, Reaction) else s.surface,)
        if k is not None and all(self.has_no(h, k) for h in surfaces):
            return sp.S.Zero
        name = disc.name if disc else s.name
        if not members(s):  # only inside of sums
            return self._rebuilt(s, name, None)
        if k is None:
            raise ValueError(f"{s} belongs to every element of a family; outside of its own rates take a sum.")
        self._group(name, family_of(s).n)
        return self._rebuilt(s, self.label(name, k), k)

    def _rebuilt(self, s, name, k):
        if isinstance(s, Component):
            return Disc(name, [self.element(h, k) for h in s.disc.surfaces])[s.index]
        if isinstance(s, Switch):
            return Switch(name, self.element(s.surface, k))
        return Reaction(name, self.element(s.gap, k), self.element(s.restitution, k))

    def _group(self, name, n):
        if name not in self.groups:
            self.groups[name] = Names(name, n) if n > MANY else tuple(f"{name}_{i + 1}" for i in range(n))

    # ---- parts of a system

    def rates(self, pairs):
        result = []
        for x, e in pairs:
            elements = self.elements(family_of(x, e)) if isinstance(x, Member) else [None]
            result += [(x if k is None else self._member(x, k), self.element(e, k)) for k in elements]
        return result

    def outputs(self, outputs):
        result = {}
        for name, e in outputs.items():
            family = family_of(e)
            if family is None:
                result[name] = self.element(e, None)
            else:
                result |= {self.label(name, k): self.element(e, k) for k in self.elements(family)}
        return result

    @singledispatchmethod
    def items(self, item):
        """What an event, a contact or an algebraic unknown is in every element."""
        return [item]

    @items.register
    def _(self, item: Event):
        parts = [*of_event(item), *(key for key, _ in item.update if isinstance(key, sp.Basic))]
        family = family_of(*parts)
        if not any(map(involved, parts)):
            return [item]
        numbers = self.elements(family) if family else [None]
        timed = item.surface is None
        return [self._event(item, k) for k in numbers if timed or k is None or not self.has_no(item.surface, k)]

    def _event(self, item, k):
        def part(e):
            return self.element(e, k) if isinstance(e, sp.Basic) else e

        name = item.name if k is None or item.name is None else self.label(item.name, k, " ")
        written = {key: e for key, e in item.update if not (isinstance(key, Member) and self.lacks(key, k))}
        return Event(
            part(item.surface),
            every=part(item.every),
            at=tuple(map(part, item.at)) or None,
            direction=item.direction,
            update={part(key): part(value) for key, value in written.items()},
            when=part(item.when),
            terminal=item.terminal,
            name=name,
            together=item.together,
        )

    @items.register
    def _(self, item: Unilateral):
        family = family_of(item.reaction)
        if family is None:
            return [item]
        return [
            Unilateral(self.element(item.gap, k), self.element(item.restitution, k), self.label(item.name, k))
            for k in self.elements(family)
            if not self.has_no(item.gap, k)
        ]

    @items.register
    def _(self, item: Algebraic):
        if not isinstance(item.unknown, Member):
            return [Algebraic(item.unknown, self.element(item.residual, None))]
        elements = self.elements(item.unknown.family)
        return [Algebraic(self._member(item.unknown, k), self.element(item.residual, k)) for k in elements]


def _name(key):
    return key if isinstance(key, str) else getattr(key, "name", None)


def _itself(outside, name):
    return isinstance(outside, Member) and not outside.offset and outside.name == name


def spread(values, groups, what):
    """A mapping by name with the entries of members written out: a scalar for all, or one value each."""
    result = {}
    for key, value in values.items():
        key = checks.named(key)
        names = groups.get(key if isinstance(key, str) else getattr(key, "name", None))
        if names is None:
            result[key] = value
            continue
        single = checks.is_one(value)
        if not single and len(value) != len(names):
            raise ValueError(
                f"{what} gives {len(value)} values to {key}, which has {len(names)} elements; give one for each, or "
                "one number for all."
            )
        result |= dict(zip(names, [value] * len(names) if single else value, strict=True))
    return result
