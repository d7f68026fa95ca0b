"""A model with families, lowered for one element: what stands for all of them, and how many there are.

    dx/dt = f(t, x, lambda, S; p),   dz_i/dt = q(t, z_i, z_(i+1), lambda_i, x, S; p, kappa_i),   S = sum e(z_i, ...)

A `Template` is that text, without n: symbols with "[]" in their name belong to every element. `Families` adds the
sizes; in a `FamilyModel` the elements look as if they were written out, but are made only when somebody asks for one.
Arrays are blocks in the order of the template's symbols: a number each, or n numbers for what belongs to elements.
Chain: family.py -> one_element.py -> **template** -> codegen/families/*.py.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import Any

import numpy as np
import sympy as sp

from ..lambdified import numpy_function
from ..model import Beside, Model, Table
from .many import MANY, Symbols

MARK = "[]"  # in the name of what every element has
LINKED = 10**8  # from here on an offset counts the columns of a table of neighbours


@dataclass(frozen=True)
class Place:
    """Where a symbol of the elements points to.

    `base` is the symbol of the element itself and `outside` what stands beyond an end of the chain; of the number
    i = 1, ..., n of the element `base` is None, and with an offset it is 1 where there is no such neighbour, else 0.
    """

    family: int
    base: sp.Symbol | None
    offset: int = 0
    outside: sp.Expr | None = None


@dataclass(frozen=True)
class Level:
    """Hidden static friction of elements as two levels: a force c (lambda + q lambda^3) of which the rates are affine.

    While it sticks the force is c peak sigma, with |sigma| <= 1 solved for in place of lambda: it is largest where
    lambda comes to the fold, and there the element is let go, to slip with c (1 + q).
    """

    multiplier: int  # block
    q: sp.Expr
    peak: sp.Expr

    @property
    def slip(self) -> sp.Expr:
        """The force of slip, in units of c."""
        return 1 + self.q


@dataclass(frozen=True)
class Template:
    """One element of each family and what is of the whole system; independent of the numbers of elements."""

    model: Model  # its symbols are the blocks
    periodic: tuple[bool, ...]  # of every family
    places: tuple[tuple[sp.Symbol, Place], ...]  # of every symbol of elements
    sums: tuple[tuple[sp.Symbol, int, sp.Expr], ...]  # symbol, family, summand
    event_families: tuple[int | None, ...]
    output_families: tuple[int | None, ...]
    levels: tuple[Level, ...] = ()
    # Switches whose surfaces may be those of a neighbour as well: block, its place, and (block, place) of those there.
    mirrors: tuple[tuple[int, int, tuple[tuple[int, int], ...]], ...] = ()
    layer_families: tuple[int | None, ...] = ()  # of a smoothed view, those of its `smoothing`

    @cached_property
    def linked(self) -> tuple[int, ...]:
        """Blocks of multipliers that are solved for together: those of neighbours act on each other; () for none."""
        solved = [(b, m) for b, m in enumerate(self.model.multipliers) if m.may_be_solved]
        symbols = {m.symbol for _, m in solved}
        beside = {s for s in self.beside if self.place[s].base in symbols}
        return tuple(b for b, _ in solved) if any(m.residual.free_symbols & beside for _, m in solved) else ()

    @cached_property
    def felt(self) -> tuple[int, ...]:
        """Blocks of switches whose multipliers stand in the rates of neighbours: friction between two elements."""
        rates = set().union(*(e.free_symbols for e in self.model.rhs))
        bases = {self.place[s].base for s in self.beside & rates}
        return tuple(
            b for b, m in enumerate(self.model.multipliers) if m.kind == "switch" and m.symbol in bases
        )

    @cached_property
    def place(self) -> dict[sp.Symbol, Place]:
        return dict(self.places)

    @cached_property
    def beside(self) -> frozenset[sp.Symbol]:
        """Symbols of neighbours."""
        return frozenset(s for s, place in self.places if place.base is not None and place.offset)

    @property
    def constants(self) -> set[sp.Symbol]:
        """Symbols of elements that do not change along a step: their parameters', also a neighbour's."""
        parameters = set(self.model.parameters)
        return {s for s, place in self.places if place.base is None or place.base in parameters}

    def families(self, kind: str) -> tuple[int | None, ...]:
        """The family of every block of "states", "parameters", "multipliers", "events", "outputs" or "smoothing"."""
        return self._families[kind]

    @cached_property
    def _families(self) -> dict[str, tuple[int | None, ...]]:
        families = {
            "events": self.event_families, "outputs": self.output_families, "smoothing": self.layer_families
        }  # fmt: skip
        for kind in ("states", "parameters", "multipliers"):
            blocks = getattr(self.model, kind)
            symbols = [b.symbol for b in blocks] if kind == "multipliers" else blocks
            families[kind] = tuple(self.place[s].family if s in self.place else None for s in symbols)
        return families


def named(text: str, k: int | None) -> str:
    """A name of the template as that of element k."""
    return text if k is None else text.replace(f" {MARK}", f" {k + 1}").replace(MARK, f"_{k + 1}")


@dataclass(frozen=True)
class Families:
    """A template with the number of elements of every family."""

    template: Template
    sizes: tuple[int, ...]
    links: tuple[Table | None, ...] = ()  # neighbours of the elements of a family, in columns

    def starts(self, kind: str) -> list[int]:
        """First number of every block, and the count of all."""
        return self._starts[kind]

    @cached_property
    def _starts(self) -> dict[str, list[int]]:
        return {
            kind: list(accumulate((1 if f is None else self.sizes[f] for f in families), initial=0))
            for kind, families in self.template._families.items()
        }

    def spread(self, kind: str, values: Sequence[Any]) -> list[Any]:
        """One value a block -> one value a number."""
        families = self.template.families(kind)
        return [v for v, f in zip(values, families) for _ in range(1 if f is None else self.sizes[f])]

    def of_events(self) -> list[Any]:
        """The template's event of every event: of what kind it is, without its expressions."""
        return self.spread("events", self.template.model.events)

    def locate(self, kind: str, i: int) -> tuple[int, int | None]:
        """(block, element or None) of number i."""
        starts = self.starts(kind)
        block = bisect_right(starts, i) - 1
        return block, None if self.template.families(kind)[block] is None else i - starts[block]

    def numbered(self, kind: str, other: str, blocks: np.ndarray) -> np.ndarray:
        """Blocks of `other`, one for each number of `kind` (-1: none), as numbers: those of the same element."""
        first, starts = self.starts(other), self.starts(kind)
        families = self.template.families(kind)
        elements = np.concatenate([np.arange(b - a) for a, b in zip(starts, starts[1:])] or [np.zeros(0, int)])
        own = np.array(self.spread(kind, [f is not None for f in families]), bool)
        shared = np.array([f is None for f in self.template.families(other)], bool)
        result = [
            b if b < 0 else first[b] + (k if o and not shared[b] else 0)
            for b, k, o in zip(blocks, elements, own)
        ]
        return np.array(result, np.int64)

    def symbol(self, symbol: sp.Symbol, k: int | None) -> sp.Basic:
        """What a symbol of the template is in element k."""
        place = self.template.place.get(symbol)
        if place is None:
            return symbol
        assert k is not None
        if place.base is None and place.offset:
            return sp.Integer(self.beside(place.family, k, place.offset) is None)
        if place.base is None:
            return sp.Integer(k + 1)
        at, n = k + place.offset, self.sizes[place.family]
        if place.offset >= LINKED:
            table = self.links[place.family]
            assert table is not None
            at = int(table.rows[k, place.offset - LINKED])
        elif self.template.periodic[place.family]:
            at %= n
        elif not 0 <= at < n:
            assert place.outside is not None
            return self.expression(place.outside, k)
        return sp.Symbol(named(place.base.name, at), **place.base._assumptions_orig)

    def beside(self, family: int, k: int, offset: int) -> int | None:
        """Number of the neighbour of element k; None where there is none."""
        n, at = self.sizes[family], k + offset
        if offset >= LINKED:
            table = self.links[family]
            assert table is not None
            at = int(table.rows[k, offset - LINKED])
            return None if at == k else at
        if self.template.periodic[family]:
            return at % n
        return at if 0 <= at < n else None

    def neighbours(self, family: int, elements: np.ndarray, offset: int) -> np.ndarray:
        """Numbers of the neighbours of elements, their own where there is none."""
        n, at = self.sizes[family], elements + offset
        if offset >= LINKED:
            table = self.links[family] if self.links else None
            return elements if table is None else table.rows[elements, offset - LINKED].astype(np.int64)
        if self.template.periodic[family]:
            return at % n
        return np.where((at >= 0) & (at < n), at, elements)

    @cached_property
    def told_beside(self) -> np.ndarray | None:
        """Of all multipliers, whether their surface is that of a neighbour before, who tells what happens there."""
        if not self.template.mirrors:
            return None
        starts, families = self.starts("multipliers"), self.template.families("multipliers")
        told = np.zeros(starts[-1], bool)
        for b, offset, same in self.template.mirrors:
            family = families[b]
            assert family is not None
            own = np.arange(self.sizes[family])
            beside = self.neighbours(family, own, offset)
            there = [self.neighbours(family, beside, other) == own for _, other in same]
            told[starts[b] + own] |= (beside < own) & np.logical_or.reduce(there)
        return told

    def told_once(self, numbers: np.ndarray) -> np.ndarray:
        """Whether records of these multipliers and events are kept: what happens between two elements is one event."""
        if self.told_beside is None:
            return np.ones(len(numbers), bool)
        among = numbers < len(self.told_beside)
        return ~(among & self.told_beside[np.where(among, numbers, 0)])

    def expression(self, e: sp.Basic, k: int | None) -> sp.Basic:
        """An expression of the template for element k, sums written out."""
        sums = {s: (family, inner) for s, family, inner in self.template.sums}
        values = {}
        for s in e.free_symbols:
            if s in sums:
                family, inner = sums[s]
                values[s] = sp.Add(*(self.expression(inner, j) for j in range(self.sizes[family])))
            elif s in self.template.place:
                values[s] = self.symbol(s, k)
        return e.xreplace(values) if values else e

    def of_parameters(self, e: sp.Expr, p: np.ndarray, family: int | None = None) -> np.ndarray:
        """An expression in parameters, whose values are p: of every element that it reads, or for all of a family."""
        first = self.starts("parameters")
        values = [p[a:b] for a, b in zip(first, first[1:], strict=False)]
        found = np.atleast_1d(_numeric(self.template.model.parameters, e)(*values))
        return found if family is None else np.broadcast_to(found, self.sizes[family])

    def symbols(self, kind: str) -> Any:
        """All states or parameters, as a tuple or, of many, made when they are asked for."""
        if self.starts(kind)[-1] > MANY:
            return Symbols(self, kind)
        blocks = zip(getattr(self.template.model, kind), self.template.families(kind))
        return tuple(
            self.symbol(s, k) for s, f in blocks for k in ([None] if f is None else range(self.sizes[f]))
        )


@lru_cache(maxsize=256)
def _numeric(symbols: tuple[sp.Symbol, ...], e: sp.Expr) -> Any:
    return numpy_function(symbols, e)


class Item:
    """One multiplier or event of a model with families: its attributes are made when they are asked for."""

    def __init__(self, families: Families, item: Any, k: int | None):
        self._families, self._item, self._k = families, item, k

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._item, name)
        if name == "name":
            return named(value, self._k)
        if name == "update":
            return self._written(value)
        if name == "impact" and value is not None:
            after = list(self._families.symbols("states"))
            for i, e in self._written(value):
                after[i] = e
            return tuple(after)
        return self._made(value)

    def _written(self, value: Any) -> tuple[tuple[int, sp.Expr], ...]:
        """(index of state, new value) in place of (block, or Beside, new value)."""
        starts = self._families.starts("states")
        families = self._families.template.families("states")
        written = []
        for b, e in value:
            at: int | None = (self._k or 0) * (families[b] is not None)
            if isinstance(b, Beside):
                at = self._families.beside(families[b] or 0, self._k or 0, b.offset)
            if at is not None:
                written.append((starts[b] + at, self._families.expression(e, self._k)))
        return tuple(written)

    def writes(self, states: Sequence[sp.Symbol]) -> list[tuple[int, sp.Expr, bool]]:
        """As EventSpec.writes, of all states."""
        return type(self._item).writes(self, states)

    def plain(self) -> Any:
        """The multiplier or event itself."""
        return type(self._item)(**{f.name: getattr(self, f.name) for f in fields(self._item)})

    def _made(self, value: Any) -> Any:
        if isinstance(value, sp.Basic):
            return self._families.expression(value, self._k)
        return tuple(map(self._made, value)) if isinstance(value, tuple) else value


class Items(Sequence):
    """The rates, multipliers, events, outputs or layers of a model with families, in the order of its arrays."""

    def __init__(self, families: Families, kind: str):
        self.families, self.kind = families, kind
        self._numbers = {"rhs": "states"}.get(kind, kind)
        self._length = families.starts(self._numbers)[-1]

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return tuple(self[k] for k in range(*i.indices(len(self))))
        if not -len(self) <= i < len(self):
            raise IndexError(i)
        block, k = self.families.locate(self._numbers, i % len(self))
        item = getattr(self.families.template.model, self.kind)[block]
        if self.kind == "rhs":
            return self.families.expression(item, k)
        if self.kind == "outputs":
            return named(item[0], k), self.families.expression(item[1], k)
        if self.kind == "smoothing":
            return self.families.expression(item[0], k), item[1]
        return Item(self.families, item, k)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Items):
            return (self.kind, self.families) == (other.kind, other.families)
        return NotImplemented

    def __hash__(self) -> int:
        return hash((self.kind, self.families))


@dataclass(frozen=True)
class FamilyModel(Model):
    """The model that `families` stand for: its rates, multipliers, events and outputs are Items."""

    families: Families = field(kw_only=True)

    __hash__ = Model.__hash__  # the one that is kept: `dataclass` would write another one

    def __post_init__(self) -> None:
        kinds = ("rhs", "multipliers", "events", "outputs", "smoothing")
        if (
            all(isinstance(getattr(self, kind), Items) for kind in kinds)
            and len(self.parameters) == self.families.starts("parameters")[-1]
        ):
            return
        # One that was changed (`dataclasses.replace`) is no longer what its template says: it becomes a plain Model
        # with these elements written out.
        for kind in kinds:
            items = [item.plain() if isinstance(item, Item) else item for item in getattr(self, kind)]
            object.__setattr__(self, kind, tuple(items))
        object.__delattr__(self, "families")
        object.__setattr__(self, "__class__", Model)


def family_model(families: Families) -> FamilyModel:
    """The model that a template and sizes stand for."""
    model, starts = families.template.model, families.starts("states")
    return FamilyModel(
        time=model.time,
        states=families.symbols("states"),
        parameters=families.symbols("parameters"),
        rhs=Items(families, "rhs"),  # type: ignore[arg-type]
        multipliers=Items(families, "multipliers"),  # type: ignore[arg-type]
        events=Items(families, "events"),  # type: ignore[arg-type]
        outputs=Items(families, "outputs"),  # type: ignore[arg-type]
        smoothing=Items(families, "smoothing"),  # type: ignore[arg-type]
        sigmoid=model.sigmoid,
        n_memory=starts[-1] - starts[-1 - model.n_memory],
        families=families,
    )
