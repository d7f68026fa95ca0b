"""What elements keep between loops: numbers in slots, coefficients in rows, and how a loop's body gets at them.

A body is written with the local names of recurrences.py: v12 the value of node 12, k12 its coefficient of this order,
l12 that of the last, s12 its slope, r12 its reciprocal, o3 the place of row 3, c1x12 the first order of this block.
`_preamble` finds the names that a body reads and does not make, and loads them for the present element.

Chain: sections.py -> memory (here) -> jets.py.
"""

from __future__ import annotations

import re

from ..graph.dag import Graph
from ..layout import Count, Layout, neighbour
from .orders import FamilyOrderK, FamilyOrderZero

CONDITIONS = ("rel", "and", "or", "not", "true", "false", "inside")
NAMES = re.compile(r"\b(?:[vrslkzw]\d+|on\d+|c[123][xw]\d+|o\d+(?:[pm]\d+)?)\b")
ASSIGNED = re.compile(r"^( *)([a-z]\w*) = ")


class ElementMemory:
    """Slots and rows of elements, for the writer of a program.

    Attributes
    ----------
    slots : dict
        (family, name) -> number of the slot.
    row_families, row_starts : list
        Family and first place of every block of rows.
    code, zero_code : FamilyOrderK, FamilyOrderZero
        What writes the orders and the start.
    """

    graph: Graph
    layout: Layout
    slots: dict[tuple[int, str], int]
    row_families: list[int | None]
    row_starts: list[Count]
    code: FamilyOrderK
    zero_code: FamilyOrderZero

    def slot(self, family: int, name: str, index: str = "") -> str:
        """Text of a number that an element keeps."""
        count = len([key for key in self.slots if key[0] == family])
        number = self.slots.setdefault((family, name), count)
        return f"rows[E{family} + {number} * {self.layout.slots}{family} + {index or f'i{family}'}]"

    def old(self, name: str) -> str:
        return f"{name}{'ab'[self.code.order % 2]}"

    def new(self, name: str) -> str:
        return f"{name}{'ba'[self.code.order % 2]}"

    def row_place(self, row: int, family: int, index: str = "") -> str:
        return f"({self.layout.row_text(self.row_starts[row])} + {index or f'i{family}'}) * stride"

    # ---- the top of a loop's body

    def _preamble(self, lines, family: int, order_zero: bool) -> list[str]:
        """Loads of what the body reads of its element and does not make; zeros for what only a branch makes."""
        depth = min((len(line) - len(line.lstrip()) for line in lines), default=0)
        made, deep = set(), {}
        for line in lines:
            found = ASSIGNED.match(line)
            if found:
                made.add(found[2])
                deep[found[2]] = deep.get(found[2], True) and len(found[1]) > depth
        loads: dict[str, str] = {}
        waiting = sorted(set(NAMES.findall("\n".join(lines))) - made)
        while waiting:
            name = waiting.pop()
            text = None if name in loads else self._load(name, order_zero)
            if text is not None:
                loads[name] = text
                waiting += [n for n in NAMES.findall(text) if n not in loads]
        # Places of rows first: other loads go through them.
        order = sorted(loads, key=lambda n: (n[0] not in "ow" or n.startswith("on"), n))
        zeros = [n for n, is_deep in deep.items() if is_deep and self._number(n)]
        return [*(f"{n} = {loads[n]}" for n in order), *(f"{n} = 0.0" for n in zeros)]

    def _number(self, name: str) -> bool:
        found = re.fullmatch(r"[vrsk](\d+)", name)
        return bool(found) and self.graph.nodes[int(found[1])].op not in CONDITIONS

    def _load(self, name: str, order_zero: bool) -> str | None:
        """Text of what a name of an element stands for; None for locals of the whole function."""
        graph, code = self.graph, self.code
        if name.startswith("on"):
            family = self.layout.multipliers[int(name[2:])]
            return None if family is None else f"{self.layout.place('mask', int(name[2:]), family)} != 0"
        if name[0] == "w":
            family = int(name[1:])
            return f"W{family} + {4 * len(code.of_family(family))} * i{family}"
        if name[0] == "o":
            row, sign, offset = re.fullmatch(r"o(\d+)([pm]?)(\d*)", name).groups()
            family = self.row_families[int(row)]
            index = neighbour(family, int(sign.replace("p", "+").replace("m", "-") + offset)) if sign else ""
            return None if family is None else self.row_place(int(row), family, index)
        if name[0] == "c":
            r, kind, node = re.fullmatch(r"c(\d)([xw])(\d+)", name).groups()
            if graph.level[int(node)] is None:
                return None
            return f"rows[{code.row(int(node) if kind == 'x' else ~int(node))} + 4 * q + {r}]"
        node = int(name[1:])
        family = graph.level[node]
        if family is None:
            return None
        op, _, data = graph.nodes[node]
        if name[0] == "v":
            if op in ("var", "inside"):
                return self.zero_code.formula(node)
            if op in CONDITIONS:
                return f"{self.slot(family, name)} != 0.0"
            return (
                f"rows[{code.row(node)}]" if node in code.rows and not order_zero else self.slot(family, name)
            )
        if name[0] == "k" and op == "var" and data[0] == "mult":
            found = f"rows[{code.row(node)} + k]"
            beside = len(data) == 3 and self.layout.patch  # of a patch, what stands beside it is open
            return f"choose({neighbour(family, data[2])} < m{family}, {found}, 0.0)" if beside else found
        if name[0] == "k" and op == "var":
            index = neighbour(family, data[2]) if len(data) == 3 else ""
            return f"{self.slot(family, self.old(f'd{data[1]}'), index)} * inv"
        if name[0] == "z":
            # An affine node has no order above 1.
            return f"choose(later > 0.0, 0.0, {self.slot(family, f's{node}')})" if code.order == 0 else "0.0"
        return self.slot(family, self.old(name) if name[0] == "l" else name)

    def _declared(self, *parts) -> list[str]:
        """First values of locals of the whole that only a branch sets."""
        names = set()
        for lines, depth in zip(parts, (4, 8), strict=True):
            inside = None  # indentation of the loop over elements that a line stands in
            for line in lines:
                indent = len(line) - len(line.lstrip())
                if inside is not None and indent > inside:
                    continue
                inside = indent if re.match(r" *for i\d", line) else None
                found = ASSIGNED.match(line)
                if found and indent > depth and self._number(found[2]):
                    names.add(found[2])
        return [f"    {name} = 0.0" for name in sorted(names)]
