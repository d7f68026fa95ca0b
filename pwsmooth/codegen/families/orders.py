"""Order 0 and order k of the Taylor programs of a model with families: degrees, selections, rows of neighbours.

Chain: recurrences.py, sections.py -> orders (here) -> jets.py, sliding.py.
"""

from __future__ import annotations

from ..layout import neighbour
from ..taylor.recurrences import AFFINE, CONSTANT, SWITCHABLE, Degrees, OrderK, OrderZero, bits, plain
from .sections import Placed


def solved_name(j: int) -> str:
    """Text of the condition under which multiplier j is solved."""
    return f"on{j}"


class FamilyDegrees(Degrees):
    """Degrees where only the multipliers `solved` ever move: kinks and crossings keep their sides in a step."""

    def __init__(self, graph, rates, solved, never_affine):
        self.solved = frozenset(solved)
        super().__init__(graph, rates, bool(solved), never_affine)

    def _find(self, node: int) -> tuple[int, int]:
        op, _, data = self.graph.nodes[node]
        if op == "var" and data[0] == "mult" and data[1] not in self.solved:
            return CONSTANT, 0
        return super()._find(node)


class Sided(Placed):
    """Mix-in: selections by multipliers that are never solved have two branches."""

    def _branches(self, key):
        if key[0] == "sel" and key[1] not in self.degrees.solved:
            return [(f"if {self.place('mult', key[1])} > 0.0:", 0), ("else:", 1)]
        return super()._branches(key)


class FamilyOrderZero(Sided, OrderZero):
    """Values at the start of the step, of the whole or of one element."""

    def __init__(self, graph, writer, degrees, reciprocals, layout):
        super().__init__(graph, writer, degrees, solved_name, reciprocals)
        self.layout = layout

    def _ensure(self, node: int, needed: set[int]) -> None:
        op, _, data = self.graph.nodes[node]
        if op == "var" and data[0] == "x" and self.degrees.of(node) == AFFINE and not self.available(node):
            self.emit([self.degrees.rates[data[1]]])  # its slope
        super()._ensure(node, needed)


class FamilyOrderK(Sided, OrderK):
    """Coefficients of order k, of the whole or of one element."""

    def __init__(self, graph, writer, degrees, layout):
        super().__init__(graph, writer, degrees, solved_name)
        self.solving = False  # the multipliers of this order are not known yet
        self.layout = layout

    def known_from(self, other: FamilyOrderK) -> None:
        """Take over what a first writing of the orders has found to be needed."""
        for name in ("rows", "products", "reciprocals", "carried", "transient"):
            setattr(self, name, getattr(other, name))

    def available(self, node: int) -> bool:
        op, _, data = self.graph.nodes[node]
        if op == "var" and self.graph.level[node] is not None:
            if data[0] == "x" or data[0] == "mult" and not self.solving:
                return True  # loaded
        return super().available(node)

    def holder(self, node: int) -> int:
        op, _, data = self.graph.nodes[node]
        return self.graph.var(*data[:2]) if op == "var" and len(data) == 3 else node

    def row(self, node: int) -> str:
        base = self.holder(plain(node))
        at = super().row(base if node >= 0 else ~base)
        if base == plain(node):
            return at
        return f"{at}{neighbour(0, self.graph.nodes[plain(node)].data[2])[2:]}"

    def family(self, operand: int) -> int | None:
        return self.graph.level[plain(operand)]

    def product_family(self, pair) -> int | None:
        levels = {self.family(u) for u in pair} - {None}
        return levels.pop() if levels else None

    def of_family(self, family: int | None) -> list[tuple[int, int]]:
        return [pair for pair in self.products if self.product_family(pair) == family]

    def scratch(self, a: int, b: int) -> str:
        self.products.setdefault((a, b), len(self.products))
        family = self.product_family((a, b))
        block = self.of_family(family).index((a, b))
        return f"{'scratch' if family is None else f'w{family}'} + {4 * block}"

    def guard(self, a: int, b: int) -> str:
        """As in OrderK; whether any element's multiplier is solved is known for the whole."""
        levels = self.graph.families["mult"]
        masks = {self.degrees.pair(plain(u))[1] for u in (a, b) if self.degrees.of(plain(u)) == SWITCHABLE}
        each = [[f"{'on' if levels[j] is None else 'any'}{j}" for j in bits(m)] for m in sorted(masks)]
        return " and ".join(f"({' or '.join(names)})" for names in each)
