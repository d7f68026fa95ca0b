"""Code of a model with families: shared parts and loops over elements, in an order that has each sum when it is needed.

    shared -> loop over elements, adding sums up -> shared -> ... -> last loop

What belongs to elements is written inside `for i0 in range(m0):`, once. A sum is made in a loop of its own stage (sums
in sums come later), before anything that reads it; roots of elements are written in the first loop that can.
Chain: dag.py, scalar.py, recurrences.py -> sections (here) -> fields.py, jets.py.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from ..graph.dag import Graph
from ..graph.scalar import ScalarCode, Writer
from ..layout import Layout

NEIGHBOUR = re.compile(r"\bj(\d+)([pm])(\d+)\b")


class Root(NamedTuple):
    """A node to be computed, the family in whose loop it is wanted, and the lines that then follow.

    The lines may read the nodes `also`, which are made in the same loop.
    """

    node: int
    family: int | None
    lines: Callable[[], list[str]]
    also: tuple[int, ...] = ()

    @property
    def nodes(self) -> tuple[int, ...]:
        return (self.node, *self.also)


class Placed:
    """Mix-in of ScalarCode and its kin: variables where the layout of a template has them."""

    layout: Layout
    graph: Graph

    def place(self, kind: str, index: int, offset: int = 0) -> str:
        if kind == "i":
            return self.layout.number(index)
        return self.layout.place(kind, index, self.graph.families[kind][index], offset)

    def formula(self, node: int) -> str:
        op, _, data = self.graph.nodes[node]
        if op == "inside":
            return self.layout.is_inside(*data)
        return super().formula(node)  # type: ignore[misc]

    def total(self, node: int) -> str:
        """Local name of a sum over a family."""
        return self.name(node)  # type: ignore[attr-defined]

    def term(self, node: int) -> str:
        """Text of a summand."""
        return self.name(node)  # type: ignore[attr-defined]

    def nothing(self, node: int) -> str:
        """Text of a sum before anything is added to it."""
        return "0.0"


class ElementCode(Placed, ScalarCode):
    """ScalarCode of a model with families."""

    def __init__(self, graph: Graph, writer: Writer, layout: Layout):
        super().__init__(graph, writer)
        self.layout = layout


class Sections:
    """Writes roots with `code`, in sections.

    `preamble(lines, family)` gives lines for the top of a loop's body, `close(family, nodes)` for its end.
    """

    def __init__(self, code, preamble=None, close=None):
        self.code, self.graph, self.writer = code, code.graph, code.writer
        self.preamble = preamble or (lambda lines, family: [])
        self.close = close or (lambda family, nodes: [])
        self._stage: dict[int, int] = {}

    def stage(self, node: int) -> int:
        """Sums that have to be made one after the other before a node is known."""
        found = self._stage.get(node)
        if found is None:
            op, args, _ = self.graph.nodes[node]
            found = self._stage[node] = max((self.stage(a) for a in args), default=0) + (op == "total")
        return found

    def totals(self, nodes) -> list[int]:
        """Sums below the nodes that the code does not have yet."""
        reached = self.graph.reach(nodes, through=True)
        return [a for a in reached if self.graph.nodes[a].op == "total" and not self.code.available(a)]

    def _shared(self, nodes) -> list[int]:
        """What nodes of elements take from outside of their loop, branches included."""
        level = self.graph.level
        found = set()
        for a in self.graph.reach(nodes):
            if level[a] is None and a in nodes:
                found.add(a)
            if level[a] is not None:
                found |= {b for b in self._needs(a) if level[b] is None}
        return sorted(found)

    def _needs(self, node: int):
        yield from self.graph.nodes[node].args
        companion = getattr(self.code, "companion", None)
        q = companion(node) if companion else None
        if q is not None:
            yield q

    def sums(self, nodes, waiting: list[Root] = ()) -> list[Root]:
        """Write the loops that make the sums below `nodes`, and what of `waiting` they can; returns the rest."""
        waiting = list(waiting)
        graph = self.graph
        groups: dict[tuple[int, int], list[int]] = {}
        for node in self.totals(nodes):
            groups.setdefault((self.stage(node), graph.nodes[node].data), []).append(node)
        for (stage, family), totals in sorted(groups.items()):
            ready = [r for r in waiting if r.family == family and max(map(self.stage, r.nodes)) < stage]
            waiting = [r for r in waiting if r not in ready]
            for node in totals:
                self.writer.line(f"{self.code.total(node)} = {self.code.nothing(node)}")
            self._loop(family, [graph.nodes[node].args[0] for node in totals], ready, totals)
            self.code.scopes[-1].update(totals)
        return waiting

    def write(self, roots: list[Root]) -> None:
        """Write all roots and their lines."""
        nodes = [a for r in roots for a in r.nodes]
        waiting = self.sums(nodes, [r for r in roots if r.family is not None])
        shared = [r for r in roots if r.family is None]
        self.code.emit([a for r in shared for a in r.nodes])
        for family in sorted({r.family for r in waiting}):
            self._loop(family, [], [r for r in waiting if r.family == family], [])
        for root in shared:
            for line in root.lines():
                self.writer.line(line)

    def _loop(self, family: int, nodes, roots: list[Root], totals) -> None:
        writer, code = self.writer, self.code
        wanted = [*nodes, *(a for r in roots for a in r.nodes)]
        code.emit(self._shared(wanted))
        writer.line(f"for i{family} in range(m{family}):")
        writer.indent += 1
        code.scopes.append(set())
        mark = len(writer.lines)
        code.emit(wanted)
        for node, inner in zip(totals, nodes, strict=True):
            writer.line(f"{code.total(node)} += {code.term(inner)}")
        for root in roots:
            for line in root.lines():
                writer.line(line)
        for line in self.close(family, wanted):
            writer.line(line)
        code.scopes.pop()
        body = writer.lines[mark:]
        pad = "    " * writer.indent
        top = self.preamble(body, family)
        top = [*self.indices([*top, *body]), *top]
        writer.lines[mark:mark] = [pad + line for line in top]
        if not body and not top:
            writer.line(f"u{family} = i{family}")
        writer.indent -= 1

    def indices(self, lines) -> list[str]:
        """Indices of neighbours; beyond an open end the element's own."""
        result = []
        for family, sign, offset in sorted(set(NEIGHBOUR.findall("\n".join(lines)))):
            result += self.code.layout.index_of_neighbour(
                int(family), int(offset) if sign == "p" else -int(offset)
            )
        return result
