"""Taylor jets of a model with families: the programs of jets.py, order by order over all elements.

    for every order k:   shared part -> loop over elements -> sums -> shared part -> ...

Sums of order k are there before anything of order k reads them, and order k + 1 of a state comes from order k of its
rate. What an element keeps from order to order stands in memory: coefficients in its rows, other numbers in *slots*
(n numbers each). A loop's body is written as if all of them were locals (memory.py loads what it reads).
Last orders (l, d) have two slots in turn, so that a second loop of the same order still finds the old ones.

Chain: Graph (dag.py) -> recurrences.py, sections.py -> text (this file) -> native.py.
"""

from __future__ import annotations

import re

from ...definition.model import Model
from ..fields import Source, surfaces
from ..graph.dag import Graph
from ..graph.scalar import Writer
from ..layout import Count, Layout, one, starts
from ..machine.sums import LANES
from ..taylor.recurrences import AFFINE, CONSTANT, label, plain, rewrite
from .memory import CONDITIONS, ElementMemory
from .orders import FamilyDegrees, FamilyOrderK, FamilyOrderZero
from .sections import Root, Sections


class FamilyJet(ElementMemory):
    """Writes `jet_slip` of one template; constants of its text say where the rows are.

    `_solve`, `_frozen` and the like are for the general program (sliding.py), `_surfaces` for layers (elements.py).
    """

    name, arguments = "jet_slip", "t, x, mult, p, K, stride, rows, scratch"
    graph_of: type[Graph] = Graph
    zeroth: type[FamilyOrderZero] = FamilyOrderZero

    def __init__(self, model: Model, patch: bool = False):
        self.graph = graph = self.graph_of(model)
        self.model, self.layout = graph.model, Layout(graph.template, patch)
        self.states = [graph.var("x", i) for i in range(len(self.model.states))]
        rates = graph.expressions(self.model.rhs)
        h, self.has_surface = self._surfaces()
        nodes = rewrite(graph, rates + h + self._residuals())
        self.rates, self.h = nodes[: len(rates)], nodes[len(rates) : len(rates) + len(h)]
        self.residuals = nodes[len(rates) + len(h) :]
        # A neighbour's slope would be a slope of the neighbour's rate: its series is general.
        read = {
            graph.nodes[a].data
            for a in graph.reach(nodes, through=True)
            if graph.nodes[a].op == "var" and len(graph.nodes[a].data) == 3
        }
        seen = frozenset(data[1] for data in read)
        self.degrees = FamilyDegrees(graph, self.rates, self._solved(), seen)
        self.read_states = sorted({data[1] for data in read if data[0] == "x"})
        self.source = Source()
        self.slots: dict[tuple[int, str], int] = {}
        self.closed: set[int] = set()

    # ---- what other programs do otherwise

    def _surfaces(self) -> tuple[list[int], list[bool]]:
        """Nodes of the surfaces whose rows are wanted, and which of them there are."""
        holders = (*self.model.multipliers, *self.model.events)
        return surfaces(self.graph), [s.surface is not None for s in holders]

    def _open_body(self, body: Writer) -> None:
        """Lines before all others."""

    def _residuals(self) -> list[int]:
        return []

    def _solved(self) -> list[int]:
        """Multipliers that may be solved for."""
        return []

    def _multiplier_rows(self) -> list[int]:
        return []

    def _open_general(self, start: Writer) -> None:
        self._check_selections(start)

    def _factors(self) -> list[Root]:
        return []

    def _factorise(self, start: Writer) -> None:
        pass

    def _solve(self, code: FamilyOrderK, loop: Writer, final: bool) -> None:
        pass

    def _frozen(self, i: int, rate: str) -> str:
        return rate

    def _more_scratch(self, f: int | None) -> tuple[str, int]:
        """Name and length of further scratch numbers, of the whole or of every element."""
        return f"A{f}", 0

    # ---- the program

    def write(self) -> str:
        graph, lay = self.graph, self.layout
        self.zero_code = self.zeroth(graph, Writer(1), self.degrees, set(), lay)
        first = self._orders(Writer(2), None)
        families = [self.code.family(u) for u in first.rows]
        self.row_families, self.row_starts = families, starts(families)
        self.slots.clear()
        loop = Writer(2)
        order_k = self._orders(loop, first)
        sums = Writer(2)
        self._block_sums(sums, order_k)
        start = self._start(order_k)
        body = Writer(1)
        body.lines += ["    " + line for line in lay.sizes()]
        self._open_body(body)
        self._bounds(body, order_k)
        body.lines += self._declared(start.lines, loop.lines)
        body.lines += start.lines
        body.line(f"for q in range((K + {LANES - 1}) // {LANES}):")
        body.line(f"    k = {LANES} * q + 1")
        body.line("    inv = 1.0 / k")
        body.line("    later = choose(q > 0, 1.0, 0.0)")
        body.lines += sums.lines + loop.lines
        body.line("return 0")
        self.source.helpers |= self.zero_code.helpers | order_k.helpers
        self.source.function(self.name, self.arguments, body, returns="I")
        self.source.constants = {
            "SIZES": len(lay.sizes()),
            "ROW_FAMILIES": tuple(families),
            "SCRATCH": (
                self.scratch.fixed,
                *(dict(self.scratch.each).get(f, 0) for f in range(len(lay.periodic))),
            ),
            "SURFACE_ROWS": tuple(self.surface_rows),
            "FLAT_ROWS": order_k.flat_rows(),
            "FUSES": True,
        }
        return self.source.text()

    def _bounds(self, body: Writer, order_k: FamilyOrderK) -> None:
        """Places of the rows of the whole and of the scratch numbers."""
        for row, family in enumerate(self.row_families):
            if family is None:
                text = self.layout.row_text(self.row_starts[row])
                body.line(f"o{row} = ({text}) * stride")
        name, length = self._more_scratch(None)
        at = Count(4 * len(order_k.of_family(None)))
        if length:
            body.line(f"{name} = scratch + {at.text(self.layout.slots)}")
            at += Count(length)
        for f in range(len(self.layout.periodic)):
            products, slots = 4 * len(order_k.of_family(f)), len([key for key in self.slots if key[0] == f])
            body.line(f"W{f} = scratch + {at.text(self.layout.slots)}")
            at += one(f).times(products)
            body.line(f"E{f} = scratch + {at.text(self.layout.slots)}")
            at += one(f).times(slots)
            name, length = self._more_scratch(f)
            if length:
                body.line(f"{name} = scratch + {at.text(self.layout.slots)}")
                at += one(f).times(length)
        self.scratch = at

    # ---- orders

    def _orders(self, loop: Writer, known: FamilyOrderK | None) -> FamilyOrderK:
        """Write a block of four orders; without `known` to see what they need."""
        code = self.code = FamilyOrderK(self.graph, loop, self.degrees, self.layout)
        if known is not None:
            code.known_from(known)
        for node in (*self.states, *self._multiplier_rows()):
            code.row(node)
        self.surface_rows = []
        for node, has in zip(self.h, self.has_surface, strict=True):
            if has:
                code.row(node)
            self.surface_rows.append(code.rows[node] if has else -1)
        for place in range(LANES):
            if place:
                loop.line("if k == K:")
                loop.line("    return 0")
                loop.line("k += 1")
                loop.line("inv = 1.0 / k")
                code.next_place()
            self._order(code, loop, known is not None)
        return code

    def _order(self, code: FamilyOrderK, loop: Writer, final: bool) -> None:
        lay = self.layout
        if final and lay.patch:
            self._read_rim(code, loop)
        for i, node in enumerate(self.states):
            if lay.states[i] is None:
                if self.degrees.of(node) in (CONSTANT, AFFINE):
                    code.coefficient(node)
                else:
                    loop.line(f"k{node} = d{i} * inv")
                    code.scopes[0].add(node)
        self._solve(code, loop, final)
        roots = []
        for i, family in enumerate(lay.states):
            if family is not None:
                roots.append(Root(self.states[i], family, lambda i=i: self._keep_state(i)))
            if family is None or self._moves(i):
                roots.append(Root(self.rates[i], family, lambda i=i: self._keep_rate(i)))
        for node, has in zip(self.h, self.has_surface, strict=True):
            if has:
                roots.append(Root(node, self.graph.level[node], list))
        # What stands in residuals alone keeps its rows too, now with the multipliers.
        roots += [Root(node, self.graph.level[node], list) for node in self.residuals]
        self.closed = set()
        preamble = (lambda lines, f: self._preamble(lines, f, False)) if final else None
        Sections(code, preamble, self._close if final else None).write(roots)
        if final:
            self._close_shared(code, loop)

    def _read_rim(self, code: FamilyOrderK, loop: Writer) -> None:
        """What the elements of a patch read of others: given rows, where their own rates would stand."""
        for i in self.read_states:
            f = self.layout.states[i]
            if self._moves(i):
                loop.line(f"for r{f} in range(m{f}, s{f}):")
                kept = self.slot(f, self.old(f"d{i}"), f"r{f}")
                loop.line(f"    {kept} = k * rows[{self.row_place(code.rows[self.states[i]], f, f'r{f}')} + k]")

    def _moves(self, i: int) -> bool:
        return self.degrees.of(self.states[i]) not in (CONSTANT, AFFINE)

    def _keep_state(self, i: int) -> list[str]:
        if self.degrees.of(self.states[i]) == CONSTANT:
            return []
        return [f"rows[{self.code.row(self.states[i])} + k] = {self.code.coefficient(self.states[i])}"]

    def _keep_rate(self, i: int) -> list[str]:
        family = self.layout.states[i]
        if family is None or not self._moves(i):
            return []
        rate = self._frozen(i, self.code.coefficient(self.rates[i]) or "0.0")
        return [f"{self.slot(family, self.new(f'd{i}'))} = {rate}"]

    def covered(self, nodes) -> set[int]:
        """Everything below the nodes, branches and companions included."""
        found: set[int] = set()
        fresh = list(nodes)
        while fresh:
            added = set(self.graph.reach(fresh)) - found
            found |= added
            fresh = [q for a in added if (q := self.code.companion(a)) is not None and q not in found]
        return found

    def _close(self, family: int, wanted) -> list[str]:
        """Lines that keep what a loop has made of an element: rows and last values."""
        code, lines = self.code, []
        fresh = {a for a in self.covered(wanted) if self.graph.level[a] == family} - self.closed
        for operand, row in code.rows.items():
            node = plain(operand)
            kept = node in fresh and self.degrees.of(node) != CONSTANT
            if kept and operand not in self.states:  # those are kept as roots
                lines.append(f"rows[o{row} + k] = {code.last_value(operand)}")
        for node in sorted(code.carried & fresh):
            lines.append(f"{self.slot(family, self.new(f'l{node}'))} = {code.coefficient(node) or '0.0'}")
        self.closed |= fresh
        return lines

    def _close_shared(self, code: FamilyOrderK, loop: Writer) -> None:
        for operand, row in code.rows.items():
            if code.family(operand) is None and self.degrees.of(plain(operand)) != CONSTANT:
                loop.line(f"rows[o{row} + k] = {code.last_value(operand)}")
        for node in sorted(code.carried):
            if self.graph.level[node] is None:
                loop.line(f"l{node} = {code.coefficient(node) or '0.0'}")
        for i, family in enumerate(self.layout.states):
            if family is None and self._moves(i):
                loop.line(f"d{i} = {self._frozen(i, code.coefficient(self.rates[i]) or '0.0')}")
        if code.order < LANES - 1:
            for operand in sorted({u for pair in code.products for u in pair if code.family(u) is None}):
                loop.line(f"c{code.order + 1}{label(operand)} = {code.last_value(operand)}")
        if code.order == 0:
            for node in sorted(code.transient):
                if self.graph.level[node] is None:
                    loop.line(f"z{node} = 0.0")

    def _block_sums(self, sums: Writer, code: FamilyOrderK) -> None:
        """The parts of all products that are known at the start of a block of orders."""
        for f in (None, *range(len(self.layout.periodic))):
            calls = []
            for a, b in code.of_family(f):
                call = f"presum(rows, {code.row(a)}, {code.row(b)}, q, {code.scratch(a, b)})"
                guard = code.guard(a, b)
                calls += [f"if {guard}:", f"    {call}"] if guard else [call]
            if f is None:
                for call in calls:
                    sums.line(call)
            elif calls:
                sums.line(f"for i{f} in range(m{f}):")
                top = self._preamble(calls, f, False)
                indices = Sections(code).indices([*top, *calls])
                for line in (*indices, *top, *calls):
                    sums.line("    " + line)

    # ---- before the orders

    def _start(self, order_k: FamilyOrderK) -> Writer:
        """Values at the start of the step, into rows and slots."""
        graph, lay = self.graph, self.layout
        start = Writer(1)
        code = self.zero_code = self.zeroth(graph, start, self.degrees, order_k.reciprocals, lay)
        true = [*self.rates, *(h for h, has in zip(self.h, self.has_surface, strict=True) if has)]
        true += [*self.residuals, *self._multiplier_rows()]
        everything = self.covered([*self.states, *true])
        self._open_general(start)
        outside = set()
        for node in graph.reach([*self.states, *true], through=True):
            if graph.nodes[node].op == "total":
                everything |= self.covered(graph.nodes[node].args)
                outside |= code.needed(graph.nodes[node].args)
        outside |= code.needed([*self.states, *true])
        roots = [Root(x, f, list) for x, f in zip(self.states, lay.states, strict=True)]
        roots += [
            Root(r, f, lambda i=i: self._first_rate(i)) for i, (r, f) in enumerate(zip(self.rates, lay.states))
        ]
        roots += [Root(h, graph.level[h], list) for h, has in zip(self.h, self.has_surface, strict=True) if has]
        roots += [Root(r, graph.level[r], list) for r in (*self.residuals, *self._multiplier_rows())]
        roots += self._factors()
        kept = {plain(u) for u in order_k.rows} | {
            int(re.sub(r"\D", "", name)) for _, name in self.slots if name[0] in "vrsl"
        }
        # What a branch alone needs is made there; all else that is kept is made anyway.
        roots += [Root(a, graph.level[a], list) for a in sorted(kept) if a in outside or a not in everything]
        self.closed = set()
        Sections(code, lambda lines, f: self._preamble(lines, f, True), self._open).write(roots)
        self._factorise(start)
        for operand, row in order_k.rows.items():
            if order_k.family(operand) is None:
                start.line(f"rows[o{row}] = {'0.0' if operand < 0 else order_k.value(operand)}")
                if self.degrees.of(plain(operand)) == CONSTANT:
                    start.line("for k in range(1, K + 1):")
                    start.line(f"    rows[o{row} + k] = 0.0")
        for node in sorted(order_k.transient):
            if graph.level[node] is None:
                start.line(f"z{node} = s{node}")
        for node in sorted(order_k.carried):
            if graph.level[node] is None:
                start.line(f"l{node} = {order_k.value(node)}")
        for i, family in enumerate(lay.states):
            if family is None and self._moves(i):
                start.line(f"d{i} = {self._frozen(i, order_k.value(self.rates[i]))}")
        return start

    def _first_rate(self, i: int) -> list[str]:
        family = self.layout.states[i]
        if family is None or not self._moves(i):
            return []
        return [f"{self.slot(family, f'd{i}a')} = {self._frozen(i, self.code.value(self.rates[i]))}"]

    def _open(self, family: int, wanted) -> list[str]:
        """Lines that keep an element's numbers of order 0."""
        graph, code, lines = self.graph, self.code, []
        fresh = {a for a in self.covered(wanted) if graph.level[a] == family} - self.closed
        for operand, row in code.rows.items():
            node = plain(operand)
            if node in fresh:
                lines.append(f"rows[o{row}] = {'0.0' if operand < 0 else code.value(node)}")
                if self.degrees.of(node) == CONSTANT:
                    lines += ["for k in range(1, K + 1):", f"    rows[o{row} + k] = 0.0"]
        for f, name in list(self.slots):
            if f != family or name[0] not in "vrsl":
                continue
            node = int(re.sub(r"\D", "", name))
            if node not in fresh or name.endswith("b"):
                continue
            text = code.value(node) if name[0] == "l" else name
            if graph.nodes[node].op in CONDITIONS:
                text = f"choose({text}, 1.0, 0.0)"
            lines.append(f"{self.slot(family, name)} = {text}")
        self.closed |= fresh
        return lines

    def _check_selections(self, start: Writer) -> None:
        """Without solved multipliers a selection has a side."""
        graph, lay = self.graph, self.layout
        nodes = graph.reach([*self.rates, *self.h], through=True)
        for j in sorted({graph.nodes[a].data for a in nodes if graph.nodes[a].op == "sel"}):
            family = lay.multipliers[j]
            mult = lay.place("mult", j, family)
            indent = ""
            if family is not None:
                start.line(f"for i{family} in range(m{family}):")
                indent = "    "
            start.line(f"{indent}if {mult} != 1.0 and {mult} != -1.0:")
            start.line(f"{indent}    return 2")
