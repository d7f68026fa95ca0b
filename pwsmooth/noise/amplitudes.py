"""The noise of every state, and what it and the drift do to functions of the states.

    dx = f dt + sum_k g_xk dW_k:    L_k e = sum_x g_xk de/dx,    |de . g|^2 = sum_k (L_k e)^2

Of a model with families these are expressions of one element. A source is one of all elements, or each element has its
own: the key (name, offset) of the element whose own it is, (name, None) of one of all. A function that reads neighbours
feels their sources; one that reads a sum feels those of all, whose squares are one more sum.
Chain: **this file** -> lowering.py.
"""

from __future__ import annotations

import copy
import itertools
from types import SimpleNamespace

import sympy as sp

from ..definition.families.between import Neighbours, NoTemplate
from ..definition.families.template import LINKED, Template
from ..definition.model import Model
from ..definition.pointwise import draw, value

Source = tuple[str, int | None]


def vanishes(e: sp.Expr) -> bool:
    """Whether an expression is 0 everywhere: a number that is not 0 answers at once."""
    point = {s: draw(s, 0) for s in e.free_symbols}
    return not abs(value(e, point)) > 1e-6 and sp.simplify(e) == 0


def _field(model):
    return SimpleNamespace(contacts=(), time=model.time, states=model.states, rates=model.rhs)


class Amplitudes:
    """The amplitudes `rows` (state -> source -> expression) in a model, or in the `template` of its families."""

    def __init__(self, model: Model, rows: dict, template: Template | None = None):
        self.model, self.rows, self.template = model, rows, template
        self.states, self.rates = set(model.states), dict(zip(model.states, model.rhs))
        self.places = dict(template.places) if template else {}
        self.sums = {s: (family, e) for s, family, e in template.sums} if template else {}
        self.more: dict[sp.Symbol, tuple[int, sp.Expr]] = {}  # sums that are needed besides
        self.beside = Neighbours(_field(model), self.places, template.periodic if template else ())

    def of_model(self, model: Model) -> Amplitudes:
        """The same noise beside other rates; what is found of neighbours and sums is known to both."""
        other = copy.copy(self)
        other.model, other.rates = model, dict(zip(model.states, model.rhs))
        other.beside = copy.copy(self.beside)
        other.beside.take(_field(model))
        return other

    def moving(self, e: sp.Expr) -> list[sp.Symbol]:
        """The states in an expression, those of neighbours too."""
        found = {
            s for s in e.free_symbols
            if s in self.states or (s in self.places and self.places[s].offset and self.places[s].base in self.states)
        }  # fmt: skip
        return sorted(found, key=str)

    def of(self, x: sp.Symbol) -> dict[Source, sp.Expr]:
        """The amplitude of a state by each source."""
        if x in self.states:
            return self.rows.get(x, {})
        place, gone = self.places[x], self._gone(x)
        found: dict[Source, sp.Expr] = {}
        for (name, own), e in self.rows.get(place.base, {}).items():
            found[name, None if own is None else place.offset] = (1 - gone) * self.beside.at(e, place.offset)
        if gone != 0 and place.outside is not None:
            for source, e in self.along(place.outside).items():
                found[source] = found.get(source, sp.S.Zero) + gone * e
        return found

    def _gone(self, x):
        """1 in elements that lack this neighbour, where something else stands for its state; else 0."""
        return self.beside.absent(self.places[x].family, self.places[x].offset)

    # ---- sums over elements

    def summed(self, e: sp.Expr) -> list[sp.Symbol]:
        """The sums in an expression."""
        return sorted((s for s in e.free_symbols if s in self.sums), key=str)

    def _sum(self, name: str, family: int, e: sp.Expr) -> sp.Expr:
        """The sum of an expression over the elements of a family, a symbol."""
        if e == 0:
            return sp.S.Zero
        for s, found in self.sums.items():
            if found == (family, e):
                return s
        symbol = sp.Symbol(
            f"{name} under noise {len(self.more) + 1}", real=True
        )  # the template has sums like it
        self.more[symbol] = self.sums[symbol] = family, e
        return symbol

    # ---- along the noise and the drift

    def along(self, e: sp.Expr) -> dict[Source, sp.Expr]:
        """L_k e by source: of the sources of all, and of those that elements have of their own near this one."""
        found: dict[Source, sp.Expr] = {}
        for x in self.moving(e):
            slope = e.diff(x)
            for source, g in self.of(x).items():
                found[source] = found.get(source, sp.S.Zero) + slope * g
        for s in self.summed(e):
            family, inner = self.sums[s]
            for (name, own), g in self.along(inner).items():
                if own is None:
                    total = self._sum(f"{name} in {s.name}", family, g)
                    found[name, None] = found.get((name, None), sp.S.Zero) + e.diff(s) * total
        return found

    def spread(self, e: sp.Expr | None, proves: bool = True) -> sp.Expr:
        """Variance of a function a unit of time; 0 for none, and where it `proves` that it vanishes."""
        if e is None:
            return sp.S.Zero
        total = sp.Add(*((sp.expand(part) if proves else part) ** 2 for part in self.along(e).values()))
        for s in self.summed(e):
            family, inner = self.sums[s]
            own = {source: g for source, g in self.along(inner).items() if source[1] is not None}
            if any(offset for _, offset in own):
                raise NoTemplate("a sum of what neighbours do under noise")
            squares = self._sum(f"noise in {s.name}", family, sp.Add(*(g**2 for g in own.values())))
            total += e.diff(s) ** 2 * squares
        return sp.S.Zero if proves and vanishes(total) else total

    def bend(self, h: sp.Expr) -> list[sp.Expr]:
        """g_k . (second derivatives of h) . g_k of every source: what Ito's formula adds to dh/dt, twice."""
        found: dict[Source, sp.Expr] = {}
        moving = self.moving(h)
        for x, y in itertools.product(moving, moving):
            second = h.diff(x, y)
            if second != 0:
                beside = self.of(y)
                for source, g in self.of(x).items():
                    if source in beside:
                        found[source] = found.get(source, sp.S.Zero) + second * g * beside[source]
        return list(found.values())

    def drift(self, e: sp.Expr, far: bool = True) -> sp.Expr:
        """de/dt along the drift, without that of time itself; what neighbours by a table do only if `far`."""
        parts = [
            e.diff(x) * (self.rates[x] if x in self.states else self.beside.rate_of(x))
            for x in self.moving(e) if far or x in self.states or self.places[x].offset < LINKED
        ]  # fmt: skip
        for s in self.summed(e):
            family, inner = self.sums[s]
            parts.append(e.diff(s) * self._sum(f"d{s.name}", family, self.drift(inner, far)))
        return sp.Add(*parts)

    def slope(self, e: sp.Expr, x: sp.Symbol) -> sp.Expr:
        """de/dx of what is said of one element, through sums too: of those one summand reads a state of an element."""
        found = e.diff(x)
        for s in self.summed(e):
            family, inner = self.sums[s]
            slope = self.slope(inner, x)
            found += e.diff(s) * (
                slope if x in self.places else self._sum(f"d{s.name}/d{x.name}", family, slope)
            )
        return found

    def own_slope(self, x: sp.Symbol) -> sp.Expr:
        """d rate_x/dx."""
        rate = self.rates[x]
        beside = [y for y in self.moving(rate) if y not in self.states and self.places[y].outside is not None]
        ends = [self._gone(y) * rate.diff(y) * self.places[y].outside.diff(x) for y in beside]
        return sp.Add(self.slope(rate, x), *ends)

    def pairs(self, x: sp.Symbol) -> list[sp.Expr]:
        """J_xy J_yx of a state and those that come after it, in its element and in others.

        Between two elements that act through a sum it is the geometric mean of what each of them feels of itself. What
        a neighbour by a table feels is taken for what is felt of it.
        """
        rate, states = self.rates[x], self.model.states
        found = [(self.slope(rate, x) - rate.diff(x)) ** 2]
        for y in states:
            # What is of the whole feels elements through sums alone, and comes after them.
            alone = x in self.places and y not in self.places
            if y != x and (
                alone or (states.index(y) > states.index(x) and (x in self.places) == (y in self.places))
            ):
                found.append(self.slope(rate, y) * self.slope(self.rates[y], x))
        for y in self.moving(rate):
            if y in self.states:
                continue
            slope, back = (1 - self._gone(y)) * rate.diff(y), sp.S.Zero
            if self.places[y].offset < LINKED:
                back = self.beside.rate_of(y).diff(x)
            elif self.places[y].base == x:
                back = slope
            elif any(self.places[s].base == x for s in self.beside.of(self.rates[self.places[y].base])):
                raise NoTemplate("states of two kinds that act on each other by a table")
            found.append(slope * back)
        return [e for e in found if e != 0]
