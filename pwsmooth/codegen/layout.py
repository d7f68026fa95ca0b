"""Places in the arrays of a model with families: counts that depend on the numbers of elements, as text and as numbers.

A block of an array is one number, or one for each element of a family: it starts at c + a_0 n_0 + a_1 n_1 + ...
Chain: template.py -> layout (here) -> families/fields.py, families/jets.py; codegen/__init__.py reads the same counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from ..definition.families.template import LINKED, Template
from ..definition.model import Model, Table, tables_of

NO_TABLE = Table("none", np.zeros((1, 1)), 0.0)

# A row of Taylor coefficients holds at least K + 4 >= 5 numbers.
SHORTEST_ROW = 5


@dataclass(frozen=True)
class Count:
    """c + a_0 n_0 + a_1 n_1 + ..."""

    fixed: int = 0
    each: tuple[tuple[int, int], ...] = ()  # (family, a), ascending

    def __add__(self, other: Count) -> Count:
        each = dict(self.each)
        for family, a in other.each:
            each[family] = each.get(family, 0) + a
        return Count(self.fixed + other.fixed, tuple(sorted(each.items())))

    def times(self, factor: int) -> Count:
        return Count(self.fixed * factor, tuple((f, a * factor) for f, a in self.each))

    def text(self, number: str = "m") -> str:
        """In generated code, where m0, m1, ... are the numbers of elements (or s0, s1, ... those of places)."""
        parts = [f"{a} * {number}{f}" if a != 1 else f"{number}{f}" for f, a in self.each if a]
        return " + ".join([*([str(self.fixed)] if self.fixed or not parts else []), *parts])

    def at(self, sizes) -> int:
        return self.fixed + sum(a * sizes[f] for f, a in self.each)


def one(family: int | None) -> Count:
    """Length of a block."""
    return Count(1) if family is None else Count(0, ((family, 1),))


def starts(families) -> list[Count]:
    """First place of every block, and the end of the last."""
    return list(accumulate(map(one, families), initial=Count()))


# Arrays that have places for elements beside those of a patch as well.
WITH_RIM = frozenset({"x", "dx", "xnew", "p"})


class Layout:
    """Where the blocks of a template stand in x, mult, p, and in the outputs of the generated functions.

    Of a `patch` (kernels/local) not all elements are computed: m0 are, and what they read of others, whose motion is
    given, stands behind them in blocks of s0 places. Which elements are neighbours, and their numbers, tables say.
    """

    def __init__(self, template: Template, patch: bool = False):
        self.patch = patch
        self.tables = len(tables_of(template.model))  # those of drives, before those of neighbours
        self.offsets = [
            sorted({p.offset for _, p in template.places if p.family == f and p.offset})
            for f in range(len(template.periodic))
        ]
        self.states, self.parameters = template.families("states"), template.families("parameters")
        self.multipliers, self.events = template.families("multipliers"), template.families("events")
        # Multipliers that elements beside a patch give it stand behind the parameters.
        self.felt = template.felt if patch else ()
        given = (*self.parameters, *(self.multipliers[b] for b in self.felt))
        self.surfaces = (*self.multipliers, *self.events)
        self.starts = {
            "x": starts(self.states), "dx": starts(self.states), "xnew": starts(self.states),
            "p": starts(given), "mult": starts(self.multipliers), "mask": starts(self.multipliers),
            "g": starts(self.multipliers), "h": starts(self.surfaces),
        }  # fmt: skip
        self.periodic = template.periodic

    def place(self, array: str, block: int, family: int | None, offset: int = 0) -> str:
        """Text of a block's entry, for elements that of the present one or of a neighbour."""
        start = self.text(array, self.starts[array][block])
        if family is None:
            return f"{array}[{start}]"
        index = neighbour(family, offset) if offset else f"i{family}"
        found = f"{array}[{start + ' + ' if start != '0' else ''}{index}]"
        if not (offset and self.patch and array == "mult"):
            return found
        # Of what a patch reads of others the contacts are open, and friction is that of slip.
        given = len(self.parameters) + self.felt.index(block) if block in self.felt else None
        other = "0.0" if given is None else self.place("p", given, family, offset)
        return f"choose({index} < m{family}, {found}, {other})"

    def text(self, array: str, count: Count) -> str:
        """A place in an array, in generated code."""
        return count.text("s" if self.patch and array in WITH_RIM else "m")

    def row_text(self, count: Count) -> str:
        """The first of a block of rows. Of elements whose motion is given there are the rows of states alone."""
        if not self.patch:
            return count.text()
        (before,) = (a for _, a in count.each) if count.each else (0,)
        states = len(self.states)
        return f"{count.fixed} + {min(before, states)} * s0 + {max(before - states, 0)} * m0"

    @property
    def slots(self) -> str:
        """Letter of the number of places that rows and other numbers of elements have."""
        return "s" if self.patch else "m"

    def sizes(self) -> list[str]:
        """Lines that read the numbers of elements."""
        count = len(self.periodic)
        lines = [f"m{f} = n{f}" for f in range(count)]
        return lines + [f"s{f} = n{count + f}" for f in range(count) if self.patch]

    def index_of_neighbour(self, family: int, offset: int) -> list[str]:
        """Lines that find the place of a neighbour; beyond an open end the element's own."""
        name, own = neighbour(family, offset), f"i{family}"
        if self.patch:
            offsets = self.offsets[family]
            return [f"{name} = int(near{family}[{len(offsets)} * {own} + {offsets.index(offset)}])"]
        if offset >= LINKED:
            columns = len([o for o in self.offsets[family] if o >= LINKED])
            return [f"{name} = int(table{self.tables + family}[{columns} * {own} + {offset - LINKED}])"]
        inside = f"{name} < m{family}" if offset > 0 else f"{name} >= 0"
        wrapped = f"{name} - m{family}" if offset > 0 else f"{name} + m{family}"
        return [
            f"{name} = {own} + {offset}" if offset > 0 else f"{name} = {own} - {-offset}",
            f"if not {inside}:",
            f"    {name} = {wrapped if self.periodic[family] else own}",
        ]

    def is_inside(self, family: int, offset: int, computed: bool = False) -> str:
        """Whether the element has that neighbour, and it is `computed` in this patch."""
        if self.patch and computed:
            return f"{self.is_inside(family, offset)} and {neighbour(family, offset)} < m{family}"
        if self.patch:
            offsets = self.offsets[family]
            near = f"near{family}[{len(offsets)} * i{family} + {offsets.index(offset)}]"
            return f"int({near}) != i{family}"
        if offset >= LINKED:
            return f"{neighbour(family, offset)} != i{family}"
        if self.periodic[family]:
            return f"m{family} > 0"
        return f"i{family} + {offset} < m{family}" if offset > 0 else f"i{family} >= {-offset}"

    def number(self, family: int) -> str:
        """The number i = 1, 2, ... of the element."""
        return f"number{family}[i{family}]" if self.patch else f"i{family} + 1.0"


def neighbour(family: int, offset: int) -> str:
    """Name of a neighbour's index."""
    return f"j{family}{'p' if offset > 0 else 'm'}{abs(offset)}"


def all_tables(model: Model) -> tuple[Table, ...]:
    """Tables that code of a model reads: those of drives, then the neighbours of the elements of each family."""
    links = model.families.links if model.families is not None else ()
    return (*tables_of(model), *(table or NO_TABLE for table in links))


def sparse_pattern(rows, families, columns, sizes, of) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of a sparse matrix: `rows` lists the (column block, offset) of every row block.

    A row of an element holds that element's entry of every column block of its family, or that of its neighbour: the
    one `of` (family, elements, offset), its own where it has none.
    """
    first = [c.at(sizes) for c in starts(columns)]
    lengths, entries = [], []
    for blocks, family in zip(rows, families, strict=True):
        if family is None:
            row = [np.arange(first[b], first[b + 1]) for b, _ in blocks]
            entries.append(np.concatenate(row) if row else np.zeros(0, np.int64))
            lengths.append([len(entries[-1])])
            continue
        i = np.arange(sizes[family])
        row = [
            first[b] + (0 if columns[b] is None else of(family, i, o) if o else i) + 0 * i for b, o in blocks
        ]
        entries.append(np.stack(row, axis=1).ravel() if row else np.zeros(0, np.int64))
        lengths.append([len(blocks)] * len(i))
    ends = np.cumsum([0, *(n for part in lengths for n in part)])
    return ends.astype(np.int64), np.concatenate([np.zeros(0, np.int64), *entries]).astype(np.int64)


def numeric_rows(constants, surfaces, sizes):
    """(number of rows, of further rows of its own, rows of the surfaces, of flat functions' arguments) of a program.

    For these numbers of elements; `surfaces` holds the family of every surface block.
    """
    first = [c.at(sizes) for c in starts(constants["ROW_FAMILIES"])]
    fixed, *each = constants["SCRATCH"]
    scratch = fixed + sum(a * n for a, n in zip(each, sizes, strict=True))
    rows: list[int] = []
    for row, family in zip(constants["SURFACE_ROWS"], surfaces, strict=True):
        count = 1 if family is None else sizes[family]
        own = row >= 0 and constants["ROW_FAMILIES"][row] is not None
        rows += [-1 if row < 0 else first[row] + (i if own else 0) for i in range(count)]
    flat = [r for row in constants["FLAT_ROWS"] for r in range(first[row], first[row + 1])]
    return first[-1], -(-scratch // SHORTEST_ROW), rows, flat
