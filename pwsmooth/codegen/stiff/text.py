"""Straight-line code from the graph of a smoothed model: at one point, or in 8 lanes at once."""

from __future__ import annotations

from ..graph.scalar import HELPERS, ScalarCode, Writer, linear
from ..machine.vectors import LANE_BY_LANE

_VECTOR = {"var", "sum", "mul", "div", "pow", "fun", "num"}


class StiffCode(ScalarCode):
    """Functions of one graph, one after the other."""

    def __init__(self, graph):
        super().__init__(graph, Writer(), "n")  # the prefix changes where a function looks at several points
        self.lanewise = False
        self.open_at("t", "x[%d]")

    def open_at(self, time: str, states: str, stride: int = 1) -> None:
        """Where the values of time and of the states stand from now on."""
        self.places = {"t": (time, 1), "x": (states, stride), "p": ("p[%d]", 1)}

    def place(self, kind, index, offset=0):
        text, stride = self.places[kind]
        return text % (index * stride) if "%d" in text else text

    def name(self, node):
        text = super().name(node)
        own = text == f"{self.prefix}{node}" and self.graph.grade(node) == 0
        return f"n{node}" if own else text

    def formula(self, node):
        op, args, data = self.graph.nodes[node]
        names = [self.name(a) for a in args]
        if op == "var":
            return self.place(*data)
        if op == "sum":
            # What is known before the loop first.
            terms = sorted(zip(data, args, names, strict=True), key=lambda term: self.graph.grade(term[1]))
            return linear([(c, name) for c, _, name in terms], keep_order=True)
        v = "v" if self.lanewise else ""
        if v and op == "pow":
            root = self.graph.value(args[1]) == -0.5
            return f"1.0 / vsqrt({names[0]})" if root else f"vpow({names[0]}, {names[1]})"
        if v and op == "fun":
            return f"v{'abs' if data == 'fabs' else data}({names[0]})"
        return super().formula(node)

    # ---- functions ----

    def function(self, name: str, arguments: str, result: str = "") -> None:
        """Head of a function of the typed subset that machine/vectors.py translates."""
        self.writer.lines += ["", "", f"def {name}({arguments}){' -> ' + result if result else ''}:"]
        self.writer.indent, self.scopes = 1, [set()]

    def write(self, *lines: str, indent: int = 1) -> None:
        """Lines as they are."""
        self.writer.lines += ["    " * indent + line for line in lines]

    def point(self, roots, targets, *, time="t", states="x[%d]", indent=1, known=()) -> None:
        """Code at one point; `targets` are the places of the roots, `known` nodes stand already."""
        self.open_at(time, states)
        self._emit(roots, indent, known)
        self.write(
            *(f"{place} = {self.name(a)}" for place, a in zip(targets, roots, strict=True)), indent=indent
        )
        if not roots:
            self.write("pass", indent=indent)

    def vectors(self, roots, hoisted=()) -> bool:
        """Whether all of it can be computed on vectors: no branches, which differ from lane to lane."""
        return all(map(self.vectorised, self._moving(roots, hoisted)))

    def vectorised(self, node: int) -> bool:
        op, _, data = self.graph.nodes[node]
        return op in _VECTOR and (op != "fun" or data in LANE_BY_LANE)

    def parameter_operations(self, roots, known=()) -> None:
        """Everything of the parameters alone."""
        self._emit([a for a in self.graph.reach(roots, without=known) if self.graph.grade(a) == 0], 1)

    def vector_operations(self, roots, known, time, states, indent=1) -> None:
        """Operations on 8 points at once, without what depends on parameters alone and what is `known`."""
        self.open_at(time, states, 8 if "(" in states else 1)
        self.lanewise = True
        self._emit(self._moving(roots, known), indent, {*known, *self._fixed(roots)})
        self.lanewise = False

    def vector(self, a: int) -> str:
        """Text of a result as a vector."""
        return self.name(a) if self.graph.grade(a) > 0 else f"splat8({self.name(a)})"

    def lanes(self, roots, rows, out, *, hoisted=None) -> None:
        """The same at 8 points at once: t[k], x[8 i + k] and `hoisted` nodes from rows of c; out[8 row + k]."""
        hoisted = hoisted or {}
        self.parameter_operations(roots, hoisted)
        if self.vectors(roots, hoisted):
            self.write(*(f"n{a} = load8(c, {8 * row})" for a, row in hoisted.items()))
            self.vector_operations(roots, hoisted, "load8(t, 0)", "load8(x, %d)")
            self.write(
                *(f"store8({out}, {8 * row}, {self.vector(a)})" for row, a in zip(rows, roots, strict=True))
            )
            return
        self.write("for _l in range(8):")
        self.write(*(f"n{a} = c[{8 * row} + _l]" for a, row in hoisted.items()), indent=2)
        self.open_at("t[_l]", "x[%d + _l]", 8)
        self._emit(roots, 2, {*hoisted, *self._fixed(roots)})
        self.write(
            *(f"{out}[{8 * row} + _l] = {self.name(a)}" for row, a in zip(rows, roots, strict=True)), indent=2
        )

    def _emit(self, roots, indent, known=()) -> None:
        self.writer.indent, self.scopes = indent, [set(known)]
        self.emit(roots)
        self.writer.indent = 1

    def _fixed(self, roots) -> list[int]:
        return [a for a in self.graph.reach(roots) if self.graph.grade(a) == 0]

    def _moving(self, roots, known) -> list[int]:
        return [a for a in self.graph.reach(roots, without=known) if self.graph.grade(a) > 0]

    def helper_text(self) -> str:
        """The functions that the text calls and no library has."""
        return "".join(HELPERS[name] for name in sorted(self.helpers))
