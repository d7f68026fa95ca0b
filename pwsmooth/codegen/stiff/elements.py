"""The functions of functions.py for a model with families: loops over its elements.

At eight points at once a loop's body is the vector code of small models, on the states of its element. Sums over
elements are unknowns of the implicit steps, so that the Jacobian stays sparse: their entries stand before those of the
rates, a row for every sum and a column behind those of the states.
Chain: template.py -> GradedGraph (graph.py) -> text (this file) -> machine/vectors.py, native.py.
"""

from __future__ import annotations

import numpy as np

from ...definition.model import Model
from ...kernels.stiff.state import STRIDE
from ..families.fields import FamilyFields
from ..families.jets import FamilyJet
from ..families.orders import FamilyOrderZero
from ..families.sections import Placed, Root, Sections
from ..fields import Source
from ..graph.scalar import Writer
from ..graph.slopes import derivative
from ..layout import Count, Layout, all_tables, numeric_rows, one, sparse_pattern, starts
from ..machine import cache
from ..taylor.recurrences import NoRecurrence
from .graph import GradedGraph
from .taylor import FullSlopes
from .text import StiffCode


class LanesOfElements(Placed, StiffCode):
    """Code of an element at eight points at once: x[8 i + k] of all states, t8[k]; `by_lane` with branches that differ
    from point to point."""

    def __init__(self, graph: GradedGraph, writer: Writer, layout: Layout, roots):
        super().__init__(graph)
        self.writer, self.layout = writer, layout
        apart = ("total", "ite")
        moving = [a for a in graph.reach(roots, through=True) if graph.grade(a) > 0]
        branches = [graph.nodes[a].args[0] for a in moving if graph.nodes[a].op == "ite"]
        self.by_lane = any(graph.grade(condition) > 0 for condition in branches)
        self.by_lane |= not all(self.vectorised(a) for a in moving if graph.nodes[a].op not in apart)
        if self.by_lane:
            writer.line("for _l in range(8):")
            writer.indent += 1

    def place(self, kind, index, offset=0):
        if kind == "t":
            return "t8[_l]" if self.by_lane else "load8(t8, 0)"
        text = super().place(kind, index, offset)
        if kind != "x":
            return text
        inside = text[len("x[") : -1]
        return f"x[8 * ({inside}) + _l]" if self.by_lane else f"load8(x, 8 * ({inside}))"

    def formula(self, node):
        self.lanewise = not self.by_lane and self.graph.grade(node) > 0
        return super().formula(node)

    def chosen(self, node, result):
        vector = not self.by_lane and self.graph.grade(node) > 0
        return self.vector(result) if vector else self.name(result)

    def nothing(self, node):
        return "0.0" if self.by_lane or self.graph.grade(node) == 0 else "splat8(0.0)"

    def stored(self, array: str, place: str, node: int) -> str:
        """Line that keeps a node."""
        if self.by_lane:
            return f"{array}[8 * ({place}) + _l] = {self.name(node)}"
        return f"store8({array}, 8 * ({place}), {self.vector(node)})"


class FamilyStiff(FamilyFields):
    """Writes all functions but `taylor` of the smoothed view of one template."""

    graph_of, acting = GradedGraph, "i, t, x, p, xnew"

    def __init__(self, model: Model):
        super().__init__(model)
        graph, template = self.graph, self.template
        self.layers = graph.expressions([h for h, _ in self.model.smoothing])
        self.widths = graph.expressions([eps for _, eps in self.model.smoothing])
        self.layer_families = template.families("smoothing")
        reached = graph.reach(self.rates, through=True)
        self.sums = [a for a in reached if graph.nodes[a].op == "total"]  # those that others need first

    def _variable(self, kind, block, offset):
        states = len(self.model.states)
        return self.sums[block - states] if block >= states else super()._variable(kind, block, offset)

    def _columns(self, nodes) -> list[list[tuple[int, int]]]:
        """Blocks of states, then of sums, along which each node has a slope."""
        graph, sums = self.graph, [(len(self.model.states) + k, 0) for k in range(len(self.sums))]
        return [
            [
                b
                for b in graph.places(a, "x") + sums
                if derivative(graph, a, self._variable("x", *b)) != graph.zero
            ]
            for a in nodes
        ]

    def texts(self) -> dict[str, str]:
        """The text of these functions."""
        source, lay, graph = Source(), self.layout, self.graph
        first = lay.starts["x"]
        self._store(source, "rates1", "t, x, p, f", [
            ("f", first[b], family, node) for b, (family, node) in enumerate(zip(lay.states, self.rates, strict=True))
        ])  # fmt: skip
        self._jacobian(source)
        self._lanes(source, "rates8", "t, c, x, p, f", "f", first, lay.states, self.rates)
        states = [graph.var("x", b) for b in range(len(lay.states))]
        if self.layers:
            self._layers(source)
        watched = graph.expressions([1 if e.surface is None else e.surface for e in self.model.events])
        if watched:
            self._lanes(source, "watch8", "t, x, p, e", "e", starts(lay.events), lay.events, watched)
            self._act(source)
            sums = any(graph.nodes[a].op == "total" for a in graph.reach(watched, through=True))
            source.constants["WATCHED"] = None if sums else tuple(tuple(graph.places(a, "x")) for a in watched)
        source.constants |= {
            "SIZES": len(lay.sizes()),
            "LAYER_STATES": tuple(states.index(h) if h in states else -1 for h in self.layers),
            "SMOOTH": int(graph.smooth(self.rates)),
        }
        return {"stiff": source.text()}

    def _jacobian(self, source: Source) -> None:
        lay = self.layout
        columns = (*lay.states, *(None for _ in self.sums))
        families = [self.graph.nodes[a].data for a in self.sums]
        summands = [self.graph.nodes[a].args[0] for a in self.sums]
        sums, rows = self._columns(summands), self._columns(self.rates)
        entries, end = self._rows("J", sums, families, "x", columns, summands, Count())
        more, _ = self._rows("J", rows, lay.states, "x", columns, self.rates, end)
        self._store(source, "jacobian", "t, x, p, J", entries + more)
        source.constants |= {"SUM_FAMILIES": tuple(families), "SUM_ROWS": tuple(map(tuple, sums)),
                             "J_ROWS": tuple(map(tuple, rows))}  # fmt: skip

    def _layers(self, source: Source) -> None:
        """`surfaces` and `surfaces8`."""
        graph, families, begin = self.graph, self.layer_families, starts(self.layer_families)
        entries = []
        for b, (h, eps) in enumerate(zip(self.layers, self.widths, strict=True)):
            slope = derivative(graph, h, graph.var("t", 0))
            for k, node in enumerate((h, slope, eps)):
                entries.append(("s", begin[b].times(3) + Count(k), families[b], node, 3))
        rows = self._columns(self.layers)
        gradients, _ = self._rows("s", rows, families, "x", self.layout.states, self.layers, begin[-1].times(3))
        self._store(source, "surfaces", "t, x, p, s", entries + gradients)
        self._lanes(source, "surfaces8", "t, x, p, s", "s", begin, families, self.layers)
        source.constants["SLOPE_ROWS"] = tuple(map(tuple, rows))

    def _lanes(self, source: Source, name: str, arguments: str, array: str, begin, families, nodes) -> None:
        """A function that makes a node of every element at eight points at once."""
        body, _ = self._body()
        code, roots = LanesOfElements(self.graph, body, self.layout, nodes), []
        for start, family, node in zip(begin, families, nodes, strict=False):
            at = self.layout.text("", start)
            if family is not None:
                at = f"i{family}" if at == "0" else f"{at} + i{family}"
            roots.append(Root(node, family, lambda at=at, v=node: [code.stored(array, at, v)]))
        Sections(code).write(roots)
        source.helpers |= code.helpers
        source.function(name, arguments.replace("t, ", "t8, ", 1), body)


class SmoothedZero(FullSlopes, FamilyOrderZero):
    """Order 0 of a smoothed view of families."""


class FamilyTaylor(FamilyJet):
    """Writes `taylor`: orders of the states and of the surfaces of the layers."""

    name, arguments = "taylor", "t, x, p, K, stride, rows"
    graph_of, zeroth = GradedGraph, SmoothedZero

    def _surfaces(self):
        layers = self.graph.expressions([h for h, _ in self.model.smoothing])
        return layers, [True] * len(layers)

    def _open_body(self, body):
        rows = starts(self.row_families)[-1]
        body.line(f"scratch = ({self.layout.row_text(rows)}) * stride")


def taylor_text(model: Model) -> dict[str, str]:
    """The text of `taylor`; none where a recurrence is missing, or with branches that depend on the motion."""
    try:
        jet = FamilyTaylor(model)
        nodes = [jet.graph.nodes[a] for a in jet.graph.reach([*jet.rates, *jet.h], through=True)]
        bends = any(node.op == "ite" and jet.graph.depends[node.args[0]] for node in nodes)
        return {} if bends else {"taylor": jet.write()}
    except NoRecurrence:
        return {}


def load(model: Model):
    """(loaded code, what CompiledStiff holds) of a model with families."""
    from ..machine import vectors

    families = model.families
    key = f"stiff{cache.fingerprint(families.template)}"
    texts = cache.cached_texts(key, lambda: FamilyStiff(model).texts())
    code = vectors.load(texts["stiff"], families.sizes, all_tables(model))
    return code, _numbers(model, code.constants)


def load_taylor(model: Model):
    """(loaded code, numbers that it writes, the row of each surface) of `taylor`; None where there is none."""
    from ..machine import native

    families = model.families
    texts = cache.cached_texts(
        f"stiff{cache.fingerprint(families.template)}-taylor", lambda: taylor_text(model)
    )
    if not texts:
        return None
    code = native.load(texts["taylor"], families.sizes, all_tables(model))
    count, _, row, _ = numeric_rows(code.constants, families.template.families("smoothing"), families.sizes)
    fixed, *each = code.constants["SCRATCH"]
    scratch = fixed + sum(a * size for a, size in zip(each, families.sizes, strict=True))
    return code, STRIDE * count + scratch, np.array(row, np.int64)


def _numbers(model: Model, constants) -> dict:
    families = model.families
    lay, sizes, of = Layout(families.template), families.sizes, families.neighbours
    n = len(model.states)
    columns = (*lay.states, *(None for _ in constants["SUM_FAMILIES"]))
    rows, entries = [], []
    for s, (blocks, family) in enumerate(zip(constants["SUM_ROWS"], constants["SUM_FAMILIES"], strict=True)):
        _, found = sparse_pattern([blocks], [family], columns, sizes, of)
        rows.append(np.full(len(found), n + s))
        entries.append(found)
    ends, found = sparse_pattern(constants["J_ROWS"], lay.states, columns, sizes, of)
    rows.append(np.repeat(np.arange(n), np.diff(ends)))
    entries.append(found)
    layers = families.template.families("smoothing")
    first = [start.at(sizes) for start in lay.starts["x"]]
    state = [
        first[b] + np.arange(one(f).at(sizes)) if b >= 0 else np.full(one(f).at(sizes), -1)
        for b, f in zip(constants["LAYER_STATES"], layers, strict=True)
    ]
    read = group = np.arange(n)
    if (watched := constants.get("WATCHED", ())) is not None:
        ends, states = sparse_pattern(watched, lay.events, lay.states, sizes, of)
        read, group = np.unique(states), _groups(n, ends, states)
    return {
        "n_hoisted": 0,
        "rows_length": 0,
        "unknowns": n + len(constants["SUM_FAMILIES"]),
        "pattern": (np.concatenate(rows).astype(np.int64), np.concatenate(entries).astype(np.int64)),
        "slopes": sparse_pattern(constants.get("SLOPE_ROWS", ()), layers, lay.states, sizes, of),
        "surface_state": np.concatenate([np.zeros(0, np.int64), *state]).astype(np.int64),
        "surface_row": np.full(len(model.smoothing), -1),
        "read": read,
        "group": group,
        "slots": 0,
        "written_out": False,
        "smooth": bool(constants["SMOOTH"]),
    }


def _groups(n: int, ends: np.ndarray, states: np.ndarray) -> np.ndarray:
    """A number for each of n states, such that no two states of one surface have the same: the surfaces of the events
    are `states[ends[j] : ends[j + 1]]`."""
    surfaces: list[list[int]] = [[] for _ in range(n)]
    for j, (first, last) in enumerate(zip(ends, ends[1:])):
        for i in states[first:last]:
            surfaces[i].append(j)
    taken: list[set[int]] = [set() for _ in range(len(ends) - 1)]
    group = np.zeros(n, np.int64)
    for i, where in enumerate(surfaces):
        group[i] = next(k for k in range(n) if not any(k in taken[j] for j in where))
        for j in where:
            taken[j].add(int(group[i]))
    return group
