"""Text of straight-line code from the graph of a smoothed model: one point, or 8 lanes at once."""

from __future__ import annotations

from pwsmooth.codegen.stiff_dag import Graph, operands

_VECTOR = {"time", "state", "add", "mul", "div", "sqrt", "rsqrt", "pow"}
# Those of kernels.lanes, which is not imported here: symbolic work needs no compiler.
FUNCTIONS = frozenset("exp log sin cos tan sinh cosh tanh atan asin acos erf erfc abs".split())

PREAMBLE = """\
from math import (acos, acosh, asin, asinh, atan, atan2, atanh, ceil, cos, cosh, erf, erfc, exp, floor, log,
                  sin, sinh, sqrt, tan, tanh)

from numba import cfunc, types

from pwsmooth.kernels.lanes import (high4, join8, largest8, load4, load8, low4, splat4, splat8, store4,
                                          store8, vabs, vacos, vasin, vatan, vcos, vcosh, verf, verfc, vexp,
                                          vlog, vmax, vpow, vsin, vsinh, vsqrt, vtan, vtanh)
from pwsmooth.kernels.stiff_tables import TO_W, TO_Z, WLANE

_d = types.CPointer(types.double)
_f, _i = types.double, types.int64
_void = types.void
"""


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

    def name(self, a: int) -> str:
        op = self.graph.ops[a]
        return expression(op, self.name) if op[0] == "num" and op[1] >= 0 else f"n{a}"

    def function(self, name: str, arguments: str, types: str, result: str = "_void") -> None:
        flags = 'error_model="numpy", fastmath={"contract", "nsz"}'
        self.lines += ["", "", f"@cfunc({result}({types}), cache=True, {flags})", f"def {name}({arguments}):"]

    def point(self, roots, targets, *, time="t", states="x", parameters="p") -> None:
        """Straight-line code at one point; `targets` are the places of the roots."""
        for a in self.graph.reachable(roots):
            self.assign(a, "    ", {"time": time, "state": f"{states}[%d]", "par": f"{parameters}[%d]"})
        self.lines += [f"    {place} = {self.name(a)}" for place, a in zip(targets, roots, strict=True)]
        if not roots:
            self.lines.append("    pass")

    def vectors(self, roots, hoisted) -> bool:
        """Whether all of it can be computed on vectors: no branches, which differ from lane to lane."""
        ops = (self.graph.ops[a] for a in self._reachable_without(roots, hoisted) if self.graph.level[a] > 0)
        return all(op[0] in _VECTOR or (op[0] == "fun" and op[1] in FUNCTIONS) for op in ops)

    def vector_operations(self, roots, hoisted, states) -> None:
        """Operations on 8 points at once: parameters as floats, `hoisted` nodes from rows of c, all else as
        vectors."""
        needed, level = self._reachable_without(roots, hoisted), self.graph.level
        for a in needed:
            if level[a] == 0:
                self.assign(a, "    ", {"par": "p[%d]"})
        self.lines += [f"    n{a} = load8(c, {8 * row})" for a, row in hoisted.items()]
        places = {"time": "load8(t, 0)", "state": states}
        for a in needed:
            if level[a] > 0:
                self.assign(a, "    ", places, stride=8 if "(" in states else 1, v="v")

    def vector(self, a: int) -> str:
        """Text of a result as a vector."""
        return self.name(a) if self.graph.level[a] > 0 else f"splat8({self.name(a)})"

    def lanes(self, roots, rows, out, *, hoisted=None) -> None:
        """The same at 8 points at once: t[k], x[8 i + k] and `hoisted` nodes from rows of c; out[8 row + k]."""
        hoisted = hoisted or {}
        if self.vectors(roots, hoisted):
            self.vector_operations(roots, hoisted, "load8(x, %d)")
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
        self.lines.append(f"{indent}n{a} = {text}")
