"""The pointwise functions at the eight nodes of a collocation step at once, one vector operation for all of them.

    fields8(t, x, mult, p, dx, h, g)      t[q], x[8 i + q], mult[8 j + q]; dx, h and g likewise

Only of models without conditions on what moves, as these differ from node to node. A multiplier says the same branch at
all nodes: what holds does so for the whole of a step.
Chain: fields.py -> text (this file) -> machine/vectors.py -> kernels/step/collocation.py.
"""

from __future__ import annotations

from .graph.dag import Graph
from .graph.scalar import ScalarCode, Writer
from .machine.vectors import LANE_BY_LANE

_VECTOR = {"var", "sum", "mul", "div", "pow", "fun", "sel"}
_ROOTS = {0.5: "vsqrt({0})", -0.5: "1.0 / vsqrt({0})"}


class LaneCode(ScalarCode):
    """Emits nodes as vectors, but what depends on parameters alone."""

    def __init__(self, graph: Graph, writer: Writer):
        super().__init__(graph, writer)
        self._moves: dict[int, bool] = {}

    def moves(self, node: int) -> bool:
        """Whether a node may have another value at every node of the step."""
        found = self._moves.get(node)
        if found is None:
            op, args, data = self.graph.nodes[node]
            found = op == "sel" or (op == "var" and data[0] != "p") or any(map(self.moves, args))
            self._moves[node] = found
        return found

    def possible(self, roots) -> bool:
        """Whether all that moves has a form as a vector."""
        for node in filter(self.moves, self.graph.reach(roots)):
            op, args, data = self.graph.nodes[node]
            if op not in _VECTOR or (op == "fun" and data not in LANE_BY_LANE):
                return False
            if op == "pow" and (data == "above" or self.moves(args[1])):
                return False
        return True

    def place(self, kind, index, offset=0):
        return f"{kind}[{8 * index}]" if kind == "mult" else super().place(kind, index, offset)

    def chosen(self, node, result):
        return self.vector(result)

    def vector(self, node: int) -> str:
        """Text of a node as a vector."""
        return self.name(node) if self.moves(node) else f"splat8({self.name(node)})"

    def formula(self, node):
        if not self.moves(node):
            return super().formula(node)
        op, args, data = self.graph.nodes[node]
        names = [self.name(a) for a in args]
        if op == "var":
            return f"load8({data[0]}, {8 * data[1]})"
        if op == "pow":
            root = _ROOTS.get(self.graph.value(args[1]), "vpow({0}, {1})")
            return root.format(*names)
        if op == "fun":
            return f"v{'abs' if data == 'fabs' else data}({names[0]})"
        return super().formula(node)


def lanes_text(graph: Graph, arrays: dict[str, list[int]]) -> str | None:
    """Source of `fields8`, which fills the arrays with these graph nodes; None where vectors do not tell them."""
    body = Writer()
    code = LaneCode(graph, body)
    roots = [node for nodes in arrays.values() for node in nodes]
    if not code.possible(roots):
        return None
    code.emit(roots)
    for array, nodes in arrays.items():
        for i, node in enumerate(nodes):
            body.line(f"store8({array}, {8 * i}, {code.vector(node)})")
    return f"def fields8(t: P, x: P, mult: P, p: P, dx: P, h: P, g: P):\n{body.text()}"
