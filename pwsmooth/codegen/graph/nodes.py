"""Expression graphs: every subexpression of a model once, as a node with integer arguments.

Nodes are hash-consed, so that sharing, derivatives, degrees in time and scopes are found by walking integers, and
numbered so that arguments come first: ascending order is an order of evaluation.

Chain: **Nodes** (this file) -> Graph (dag.py), which reads a model -> slopes.py, simplify.py -> scalar.py, jets.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

# A longer sum stays one node inside another sum: it may be shared by many.
SHARED_SUM = 3

# What a node depends on: memories and parameters are constants of a smooth phase and set no bit.
TIME, STATE, MULT = 1, 2, 4


class Node(NamedTuple):
    """`op` with arguments `args` (nodes) and `data` (coefficients, an index, a name)."""

    op: str
    args: tuple[int, ...]
    data: object


class Nodes:
    """Hash-consed arithmetic.

    Operations: num (value), var (kind, index), sum (coefficients; the constant is a num node), mul, div,
    pow (None, or "above" where a negative base counts as 0),
    fun (name), fun2 (name), entry (number of a table; its argument is the place in it),
    sel (multiplier; arguments: branch at +1, branch at -1, affine form),
    ite (condition, then, else), and the conditions rel (relation), and, or, not, true, false.

    Of a model with families the graph is that of its template, and `level` holds the family that a node belongs to, or
    None. There a var of a neighbour is (kind, index, offset), the number of an element is the var ("i", family),
    total (family) sums its argument over the elements, and inside (family, offset) asks whether there is a neighbour.
    """

    sums_apart = False  # a sum over elements is a variable of its own to derivatives

    def __init__(self, first_memory: int, families: dict[str, tuple[int | None, ...]]):
        self.first_memory, self.families = first_memory, families
        self.nodes: list[Node] = []
        self.depends: list[int] = []
        self.level: list[int | None] = []
        self._number: dict[Node, int] = {}
        self._derivative: dict[tuple[int, int], int] = {}  # of slopes.py
        self.zero, self.one = self.num(0.0), self.num(1.0)

    # ---- nodes ----

    def make(self, op: str, args: tuple[int, ...] = (), data=None) -> int:
        node = Node(op, args, data)
        found = self._number.get(node)
        if found is not None:
            return found
        depends = 0
        for a in args:
            depends |= self.depends[a]
        if op == "var":
            kind, index = data[:2]
            if kind == "t":
                depends = TIME
            elif kind == "mult":
                depends = MULT
            elif kind == "z" or (kind == "x" and index < self.first_memory):
                depends = STATE
        elif op == "sel":
            depends |= MULT
        self._number[node] = len(self.nodes)
        self.nodes.append(node)
        self.depends.append(depends)
        self.level.append(self._level(node) if self.families else None)
        return len(self.nodes) - 1

    def _level(self, node: Node) -> int | None:
        """The family of whose elements a node has one value each, or None."""
        if node.op == "var":
            kind, index = node.data[:2]
            return index if kind == "i" else self.families[kind][index] if kind in self.families else None
        if node.op == "inside":
            return node.data[0]
        if node.op == "total":
            return None
        levels = {self.level[a] for a in node.args}
        if node.op == "sel":
            levels.add(self.families["mult"][node.data])
        levels.discard(None)
        if len(levels) > 1:
            raise ValueError("symbols of several families stand in one expression")
        return levels.pop() if levels else None

    def num(self, value: float) -> int:
        return self.make("num", (), float(value))

    def var(self, kind: str, index: int) -> int:
        return self.make("var", (), (kind, index))

    def value(self, node: int) -> float | None:
        """The number that a node is, or None."""
        return self.nodes[node].data if self.nodes[node].op == "num" else None

    def sum(self, terms) -> int:
        """sum of coefficient*node over (coefficient, node) pairs, flattened and merged."""
        constant, merged = 0.0, {}
        for c, a in terms:
            node = self.nodes[a]
            if node.op == "num":
                constant += c * node.data
            elif node.op == "sum" and self.opens(a):
                for inner, b in zip(node.data, node.args, strict=True):
                    if self.nodes[b].op == "num":
                        constant += c * inner * self.nodes[b].data
                    else:
                        merged[b] = merged.get(b, 0.0) + c * inner
            else:
                merged[a] = merged.get(a, 0.0) + c
        merged = {a: c for a, c in merged.items() if c != 0.0}
        if not merged:
            return self.num(constant)
        if constant != 0.0:
            merged[self.num(constant)] = 1.0
        elif len(merged) == 1 and next(iter(merged.values())) == 1.0:
            return next(iter(merged))
        args = tuple(sorted(merged))
        return self.make("sum", args, tuple(merged[a] for a in args))

    def opens(self, a: int) -> bool:
        """Whether a sum gives its terms to a sum that it stands in."""
        return len(self.nodes[a].args) <= SHARED_SUM

    def add(self, a: int, b: int) -> int:
        return self.sum(((1.0, a), (1.0, b)))

    def scale(self, c: float, a: int) -> int:
        return self.sum(((c, a),))

    def split(self, a: int) -> tuple[float, int]:
        node = self.nodes[a]
        if node.op == "num":
            return node.data, self.one
        if node.op == "sum" and len(node.args) == 1:
            return node.data[0], node.args[0]
        return 1.0, a

    def mul(self, a: int, b: int) -> int:
        (ca, a), (cb, b) = self.split(a), self.split(b)
        c = ca * cb
        if c == 0.0:
            return self.zero
        if self.one in (a, b):
            return self.scale(c, b if a == self.one else a)
        product = self.make("mul", (min(a, b), max(a, b)))
        return product if c == 1.0 else self.scale(c, product)

    def div(self, a: int, b: int) -> int:
        (ca, a), (cb, b) = self.split(a), self.split(b)
        if ca == 0.0:
            return self.zero
        if b == self.one:
            return self.scale(ca / cb, a)
        if a == b:
            return self.num(ca / cb)
        quotient = self.make("div", (a, b))
        return quotient if ca == cb else self.scale(ca / cb, quotient)

    def power(self, a: int, b: int) -> int:
        """a**b; integer exponents by multiplication."""
        exponent = self.value(b)
        if exponent is not None:
            if exponent == int(exponent) and abs(exponent) <= 64:
                return self._integer_power(a, int(exponent))
            if exponent == 0.5:
                return self.fun("sqrt", a)
            if exponent == -0.5:
                return self.div(self.one, self.fun("sqrt", a))
            if exponent < 0:
                return self.div(self.one, self.power(a, self.num(-exponent)))
            base = self.value(a)
            if base is not None and base > 0:
                return self.num(base**exponent)
        return self.make("pow", (a, b))

    def _integer_power(self, a: int, n: int) -> int:
        if n < 0:
            return self.div(self.one, self._integer_power(a, -n))
        if n == 0:
            return self.one
        if n == 1:
            return a
        half = self._integer_power(a, n // 2)
        square = self.mul(half, half)
        return self.mul(a, square) if n % 2 else square

    def fun(self, name: str, a: int) -> int:
        value = self.value(a)
        if value is not None and name not in ("sign", "heaviside"):
            try:
                return self.num(getattr(math, name)(value))
            except (ValueError, OverflowError):
                pass  # left to the compiled code, which makes it nan or inf
        return self.make("fun", (a,), name)

    def select(self, j: int, a: int, b: int, affine: int | None = None) -> int:
        """Branch a or b by multiplier j; `affine` is their affine form on the surface, where it is not just that."""
        if a == b:
            return a
        lam = self.var("mult", j)
        if affine is None:
            affine = self.add(self.sum(((0.5, a), (0.5, b))), self.mul(lam, self.sum(((0.5, a), (-0.5, b)))))
        return self.make("sel", (a, b, affine), j)

    def ite(self, condition: int, a: int, b: int) -> int:
        op = self.nodes[condition].op
        if a == b or op == "true":
            return a
        return b if op == "false" else self.make("ite", (condition, a, b))

    # ---- reach ----

    def variables(self, node: int, kind: str) -> list[int]:
        """Indices of the variables of one kind that stand below a node, ascending; selections count."""
        found = set()
        for a in self.reach([node], through=True):
            op, _, data = self.nodes[a]
            if op == "var" and data[0] == kind:
                found.add(data[1])
            elif op == "sel" and kind == "mult":
                found.add(data)
        return sorted(found)

    def places(self, node: int, kind: str) -> list[tuple[int, int]]:
        """(index, offset) of the variables of one kind that stand below a node: those of an element come first."""
        found = {(a, 0) for a in self.variables(node, kind)}
        for a in self.reach([node], through=True):
            op, _, data = self.nodes[a]
            if op == "var" and data[0] == kind and len(data) == 3:
                found.add((data[1], data[2]))
        return sorted(found, key=lambda place: (place[0], place[1] != 0, place[1]))

    def reach(self, roots, lazy: bool = False, through: bool = False, without=()) -> list[int]:
        """Nodes needed for `roots`, in order of evaluation; with `lazy`, without entering branches.

        Sums over families are entered only with `through`; what is already there is `without`.
        """
        seen, stack = set(), list(roots)
        while stack:
            a = stack.pop()
            if a in seen or a in without:
                continue
            seen.add(a)
            op, args, _ = self.nodes[a]
            if lazy and op == "sel" or op == "total" and not through:
                continue
            stack.extend(args[:1] if lazy and op == "ite" else args)
        return sorted(seen)
