"""Pointwise functions of a model with families: the same C functions as fields.py, their length independent of n.

Chain: template.py -> Graph (dag.py) -> sections.py -> text (this file) -> native.py.
"""

from __future__ import annotations

import sympy as sp

from ...definition.model import Beside, Model
from ..fields import Source, above_at_zero, surfaces
from ..graph.dag import Graph
from ..graph.scalar import Writer, write_update
from ..graph.slopes import derivative
from ..layout import Count, Layout, one, starts
from .sections import ElementCode, Root, Sections


class FamilyFields:
    """Writes `fields`, `linear`, `act` and `outputs` of one template."""

    graph_of: type[Graph] = Graph
    acting = "i, t, x, mult, p, xnew"  # arguments of `act`

    def __init__(self, model: Model, patch: bool = False):
        self.graph = graph = self.graph_of(model)
        self.template = graph.template
        self.model, self.layout = graph.model, Layout(graph.template, patch)
        self.h = surfaces(graph)
        self.rates = graph.expressions(self.model.rhs)
        # What is never solved for needs no residual.
        self.residuals = [
            graph.expression(m.residual) if m.may_be_solved else graph.zero for m in self.model.multipliers
        ]

    def write(self) -> dict[str, str]:
        sources = {name: Source() for name in ("fields", "linear", "act")}
        for source in sources.values():
            source.constants["SIZES"] = len(self.layout.sizes())
        lay = self.layout
        self._store(sources["fields"], "fields", "t, x, mult, p, dx, h, g", [
            (array, lay.starts[array][b], families[b], node)
            for array, families, nodes in (
                ("dx", lay.states, self.rates), ("h", lay.surfaces, self.h), ("g", lay.multipliers, self.residuals)
            )
            for b, node in enumerate(nodes)
        ])  # fmt: skip
        self._linear(sources["linear"])
        self._act(sources["act"])
        if self.model.outputs and not lay.patch:
            sources["outputs"] = Source()
            sources["outputs"].constants["SIZES"] = len(lay.sizes())
            families = self.template.output_families
            nodes = self.graph.expressions(e for _, e in self.model.outputs)
            entries = [("out", *entry) for entry in zip(starts(families), families, nodes)]
            self._store(sources["outputs"], "outputs", "t, x, mult, p, out", entries)
        return {name: source.text() for name, source in sources.items()}

    def _body(self):
        body = Writer()
        body.lines += ["    " + line for line in self.layout.sizes()]
        return body, ElementCode(self.graph, body, self.layout)

    def _store(self, source: Source, name: str, arguments: str, entries) -> None:
        """A function that fills entries (array, first place, family or None, node, places an element)."""
        body, code = self._body()
        roots = []
        for array, first, family, node, *step in entries:
            at = self.layout.text(array, first)
            if family is not None:
                index = f"i{family}" if not step else f"{step[0]} * i{family}"
                at = index if at == "0" else f"{at} + {index}"
            roots.append(Root(node, family, lambda a=array, at=at, v=node: [f"{a}[{at}] = {code.name(v)}"]))
        Sections(code).write(roots)
        source.helpers |= code.helpers
        source.function(name, arguments, body)

    # ---- gradients

    def _linear(self, source: Source) -> None:
        graph, lay = self.graph, self.layout
        G, solved = [], [m.may_be_solved for m in self.model.multipliers]
        for i, r in enumerate(self.residuals):
            found = {(i, 0), *((j, o) for j, o in graph.places(r, "mult") if solved[j])}
            G.append(sorted(found, key=lambda place: (place[0], place[1] != 0, place[1])))
        dh = [self._moving_states(s) for s in self.h]
        entries, length = self._rows("G", G, lay.multipliers, "mult", lay.multipliers, self.residuals, Count())
        more, length = self._rows("dh", dh, lay.surfaces, "x", lay.states, self.h, Count())
        for b, (first, node) in enumerate(zip(lay.starts["h"], self.h)):
            more.append(("dh", length + first, lay.surfaces[b], derivative(graph, node, graph.var("t", 0))))
        self._store(source, "linear", "t, x, mult, p, G, dh", entries + more)
        source.constants |= {"G_ROWS": tuple(map(tuple, G)), "DH_ROWS": tuple(map(tuple, dh))}

    def _moving_states(self, surface: int) -> list[tuple[int, int]]:
        graph = self.graph
        blocks = graph.places(surface, "x")
        return [
            place for place in blocks if derivative(graph, surface, self._variable("x", *place)) != graph.zero
        ]

    def _variable(self, kind: str, block: int, offset: int) -> int:
        return self.graph.make("var", (), (kind, block, offset)) if offset else self.graph.var(kind, block)

    def _rows(self, array, rows, families, kind, columns, nodes, start: Count):
        """Entries of a sparse matrix by rows, and where they end."""
        graph, entries = self.graph, []
        for blocks, family, node in zip(rows, families, nodes, strict=True):
            place = start
            for b, offset in blocks:
                slope = derivative(graph, node, self._variable(kind, b, offset))
                if offset and kind == "mult" and self.layout.patch:
                    slope = graph.ite(graph.make("inside", (), (family, offset, True)), slope, graph.zero)
                if family is None:
                    entries.append((array, place, columns[b], slope))
                    place += one(columns[b])
                else:
                    entries.append((array, place, family, slope, len(blocks)))
                    place += Count(1)
            start = place if family is None else start + one(family).times(len(blocks))
        return entries, start

    # ---- resets

    def _act(self, source: Source) -> None:
        """Resets of the events by number; an event of elements acts on one of them."""
        graph, lay = self.graph, self.layout
        body, _ = self._body()
        firsts = starts(lay.events)
        events = [
            (first, family, event.when, event.writes(self.model.states))
            for first, family, event in zip(firsts, lay.events, self.model.events)
        ]
        # Impacts of contacts and sides of switches at rest, in the order of the multipliers.
        for first, family, m in zip(starts(lay.multipliers), lay.multipliers, self.model.multipliers):
            writes, above = [(b, e, False) for b, e in m.impact or ()], above_at_zero(m)
            if writes or above != sp.true:
                events.append((firsts[-1] + first, family, above, writes))
        for first, family, when, writes in events:
            at = first.text()
            body.line(f"if i == {at}:" if family is None else f"if i >= {at} and i < {at} + m{family}:")
            body.indent = 2
            code = ElementCode(graph, body, lay)
            sections = Sections(code)
            condition = graph.expression(when)
            values = [graph.expression(value) for _, value, _ in writes]
            sections.sums([condition, *values])
            if family is not None:
                body.line(f"i{family} = i - ({at})")
            mark = len(body.lines)
            code.emit([condition])
            if when != sp.true:
                body.line(f"if not {code.name(condition)}:")
                body.line("    return 0")
            # All new values come from the values before, so none is written until all are known.
            code.emit(values)
            for (block, _, adds), node in zip(writes, values, strict=True):
                offset = block.offset if isinstance(block, Beside) else 0
                place = lay.place("xnew", int(block), lay.states[block], offset)
                line = write_update(place, code.name(node), adds)
                if not offset:
                    body.line(line)
                    continue
                body.line(f"if {lay.is_inside(lay.states[block], offset)}:")
                body.line(f"    {line}")
            body.lines[mark:mark] = ["        " + line for line in sections.indices(body.lines[mark:])]
            body.line("return 1")
            body.indent = 1
            source.helpers |= code.helpers
        body.line("return 1")
        source.function("act", self.acting, body, returns="I")
