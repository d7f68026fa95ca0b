"""Text of straight-line code from the graph of a smoothed model: one point, or 8 lanes at once."""

from __future__ import annotations

from pwsmooth.codegen.stiff.graph import Graph, operands

_VECTOR = {"time", "state", "add", "mul", "div", "sqrt", "rsqrt", "pow"}
# Those that machine/vectors.py knows lane by lane.
FUNCTIONS = frozenset("exp log sin cos tan sinh cosh tanh atan asin acos erf erfc abs".split())


def expression(op, name, v="") -> str:
    """Right-hand side of one operation; `name` gives the text of an operand, v="v" calls the functions of
    lanes."""
    kind = op[0]
    if kind == "num":
        return repr(op[1]).replace("inf", "(1e308 * 10.0)").replace("nan", "(1e308 * 10.0 - 1e308 * 10.0)")
    if kind == "add":
        text = ""
        for c, a in op[1]:
            sign = "-" if c < 0 else "+"
            body = name(a) if abs(c) == 1.0 else f"{abs(c)!r} * {name(a)}"
            text += f" {sign} {body}" if text else (body if c > 0 else f"-{body}")
        return text
    if kind == "mul":
        return f"{name(op[1])} * {name(op[2])}"
    if kind == "div":
        return f"{name(op[1])} / {name(op[2])}"
    if kind == "sqrt":
        return f"{v}sqrt({name(op[1])})"
    if kind == "rsqrt":
        return f"1.0 / {v}sqrt({name(op[1])})"
    if kind == "pow":
        return f"vpow({name(op[1])}, {op[2]!r})" if v else f"{name(op[1])} ** {op[2]!r}"
    if kind == "fun":
        return f"{v}{op[1]}({name(op[2])})"
    if kind == "atan2":
        return f"atan2({name(op[1])}, {name(op[2])})"
    if kind == "cmp":
        return f"{name(op[2])} {op[1]} {name(op[3])}"
    if kind == "not":
        return f"not {name(op[1])}"
    if kind in ("and", "or"):
        return f"{name(op[1])} {kind} {name(op[2])}"
    if kind == "ite":
        return f"{name(op[2])} if {name(op[1])} else {name(op[3])}"
    raise AssertionError(kind)


class Writer:
    """Lines of one function; every node of the graph is computed once, in order."""

    def __init__(self, graph: Graph):
        self.graph = graph
        self.lines: list[str] = []
        self.prefix = "n"  # of the nodes that change: one function may look at several points

    def name(self, a: int) -> str:
        op = self.graph.ops[a]
        if op[0] == "num" and op[1] >= 0:
            return expression(op, self.name)
        return f"{'n' if self.graph.level[a] == 0 else self.prefix}{a}"

    def function(self, name: str, arguments: str, result: str = "") -> None:
        """Head of a function of the typed subset that machine/vectors.py translates."""
        self.lines += ["", "", f"def {name}({arguments}){' -> ' + result if result else ''}:"]

    def point(self, roots, targets, *, time="t", states="x[%d]", indent="    ", known=()) -> None:
        """Straight-line code at one point; `targets` are the places of the roots, `known` nodes stand already."""
        for a in self.graph.reachable(roots):
            if a not in known:
                self.assign(a, indent, {"time": time, "state": states, "par": "p[%d]"})
        self.lines += [f"{indent}{place} = {self.name(a)}" for place, a in zip(targets, roots, strict=True)]
        if not roots:
            self.lines.append(f"{indent}pass")

    def vectors(self, roots, hoisted) -> bool:
        """Whether all of it can be computed on vectors: no branches, which differ from lane to lane."""
        ops = (self.graph.ops[a] for a in self._reachable_without(roots, hoisted) if self.graph.level[a] > 0)
        return all(op[0] in _VECTOR or (op[0] == "fun" and op[1] in FUNCTIONS) for op in ops)

    def parameter_operations(self, roots) -> None:
        """Everything of the parameters alone."""
        for a in self.graph.reachable(roots):
            if self.graph.level[a] == 0:
                self.assign(a, "    ", {"par": "p[%d]"})

    def vector_operations(self, roots, known, time, states, indent="    ") -> None:
        """Operations on 8 points at once, without what depends on parameters alone and what is `known`."""
        for a in self._reachable_without(roots, known):
            if self.graph.level[a] > 0:
                places = {"time": time, "state": states}
                self.assign(a, indent, places, stride=8 if "(" in states else 1, v="v")

    def vector(self, a: int) -> str:
        """Text of a result as a vector."""
        return self.name(a) if self.graph.level[a] > 0 else f"splat8({self.name(a)})"

    def lanes(self, roots, rows, out, *, hoisted=None) -> None:
        """The same at 8 points at once: t[k], x[8 i + k] and `hoisted` nodes from rows of c; out[8 row + k]."""
        hoisted = hoisted or {}
        if self.vectors(roots, hoisted):
            self.parameter_operations(roots)
            self.lines += [f"    n{a} = load8(c, {8 * row})" for a, row in hoisted.items()]
            self.vector_operations(roots, hoisted, "load8(t, 0)", "load8(x, %d)")
            for row, a in zip(rows, roots, strict=True):
                self.lines.append(f"    store8({out}, {8 * row}, {self.vector(a)})")
            return
        needed, level = self._reachable_without(roots, hoisted), self.graph.level
        for a in needed:
            if level[a] == 0:
                self.assign(a, "    ", {"par": "p[%d]"})
        self.lines.append("    for _l in range(8):")
        self.lines += [f"        n{a} = c[{8 * row} + _l]" for a, row in hoisted.items()]
        for a in needed:
            if level[a] > 0:
                self.assign(a, "        ", {"time": "t[_l]", "state": "x[%d + _l]"}, stride=8)
        self.lines += [
            f"        {out}[{8 * row} + _l] = {self.name(a)}" for row, a in zip(rows, roots, strict=True)
        ]

    def _reachable_without(self, roots, hoisted) -> list[int]:
        needed, stack = set(), [r for r in roots if r not in hoisted]
        while stack:
            a = stack.pop()
            if a not in needed:
                needed.add(a)
                stack += [b for b in operands(self.graph.ops[a]) if b not in hoisted]
        return sorted(needed)

    def assign(self, a, indent, places, stride=1, v="") -> None:
        op = self.graph.ops[a]
        if op[0] == "num" and op[1] >= 0:
            return
        if op[0] in places:
            text = places[op[0]]
            if "%d" in text:
                text = text % (op[1] * (stride if op[0] == "state" else 1))
        else:
            text = expression(op, self.name, v)
        self.lines.append(f"{indent}{self.name(a)} = {text}")
