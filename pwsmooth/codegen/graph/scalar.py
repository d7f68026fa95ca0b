"""Scalar code of graph nodes, one assignment a node, with selections as lazy `if`s.

A node is emitted in the outermost scope that needs it unconditionally; a node that only one branch needs stands
inside that branch, so that an undefined branch (0*inf, (-1e-9)**1.5) is never evaluated.

Chain: Graph (dag.py) -> text of a function's body (this file) -> fields.py, jets.py.
"""

from __future__ import annotations

from .dag import Graph

# What math lacks; only the helpers that a module uses are written into it. nan stays nan.
HELPERS = {
    "sign": """
def sign(u: D) -> D:
    return choose(u > 0.0, 1.0, choose(u < 0.0, -1.0, 0.0 * u))
""",
    "heaviside": """
def heaviside(u: D) -> D:
    return choose(u > 0.0, 1.0, choose(u < 0.0, 0.0, 0.5 + 0.0 * u))
""",
    "mod": """
def mod(u: D, v: D) -> D:
    return u - v * math.floor(u / v)
""",
    "lu_factor": """
def lu_factor(rows: P, a: I, n: I) -> I:
    # in place, numbers of the pivot rows after the matrix; 1 where singular
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(rows[a + r * n + c]) > abs(rows[a + best * n + c]):
                best = r
        rows[a + n * n + c] = best
        for i in range(n):
            other = rows[a + c * n + i]
            rows[a + c * n + i] = rows[a + best * n + i]
            rows[a + best * n + i] = other
        pivot = rows[a + c * n + c]
        if not abs(pivot) > 0.0:
            return 1
        for r in range(c + 1, n):
            f = rows[a + r * n + c] / pivot
            rows[a + r * n + c] = f
            for i in range(c + 1, n):
                before = abs(rows[a + r * n + i])
                rows[a + r * n + i] -= f * rows[a + c * n + i]
                if abs(rows[a + r * n + i]) <= 4e-15 * before:
                    rows[a + r * n + i] = 0.0  # as solve_dense in kernels/surface/sparse.py
    return 0
""",
    "lu_solve": """
def lu_solve(rows: P, a: I, n: I):
    # right-hand side and solution stand after the pivot numbers
    b = a + n * n + n
    for c in range(n):
        best = b + int(rows[a + n * n + c])
        other = rows[b + c]
        rows[b + c] = rows[best]
        rows[best] = other
    for r in range(n):
        for i in range(r):
            rows[b + r] -= rows[a + r * n + i] * rows[b + i]
    for r in range(n - 1, -1, -1):
        for i in range(r + 1, n):
            rows[b + r] -= rows[a + r * n + i] * rows[b + i]
        rows[b + r] /= rows[a + r * n + r]
""",
}


def literal(value: float) -> str:
    """Text of a number that reads back as the same double."""
    if value != value:
        return "math.nan"
    if value in (float("inf"), -float("inf")):
        return "math.inf" if value > 0 else "(-math.inf)"
    return repr(value) if value >= 0 else f"({value!r})"


class Writer:
    """Lines of a function body with their indentation."""

    def __init__(self, indent: int = 1):
        self.lines: list[str] = []
        self.indent = indent

    def line(self, text: str) -> None:
        self.lines.append("    " * self.indent + text)

    def text(self) -> str:
        return "\n".join(self.lines) + "\n"


class ScalarCode:
    """Emits nodes of a graph into a writer; `prefix` distinguishes families of local names.

    `solved`, where given, is the text of a condition on multiplier j under which its selections take the
    affine form; without it they do so whenever the multiplier is neither 1 nor -1.
    """

    clamps = True  # a power "above" its surface is 0 a rounding below it

    def __init__(self, graph: Graph, writer: Writer, prefix: str = "v", solved=None):
        self.graph, self.writer, self.prefix, self.solved = graph, writer, prefix, solved
        self.scopes: list[set[int]] = [set()]
        self.helpers: set[str] = set()
        self._closure: dict[int, int] = {}
        self._open: set[int] = set()  # selections whose arguments are being written

    def name(self, node: int) -> str:
        """Text that stands for an emitted node: its local name, or the number itself."""
        op, _, data = self.graph.nodes[node]
        if op == "num":
            return literal(data)
        return {"true": "True", "false": "False"}.get(op, f"{self.prefix}{node}")

    def emit(self, roots) -> None:
        """Emit everything that `roots` need into the current scope."""
        there = set().union(*self.scopes)
        needed = set(self.graph.reach(roots, lazy=True, without=there))
        for node in sorted(needed):
            self._ensure(node, needed)

    def available(self, node: int) -> bool:
        return any(node in scope for scope in self.scopes)

    def statement(self, node: int) -> None:
        """Write the assignment of one node whose arguments are available."""
        self.writer.line(f"{self.name(node)} = {self.formula(node)}")

    # ---- scopes ----

    def _ensure(self, node: int, needed: set[int]) -> None:
        op, args, _ = self.graph.nodes[node]
        if op in ("num", "true", "false") or self.available(node):
            return
        if op == "total":
            raise AssertionError("a sum over a family is made by its own loop")
        if op == "sel":
            self._group(node, needed)
            return
        if op == "ite":
            self._ensure(args[0], needed)
            self._group(node, needed)
            return
        for a in args:
            self._ensure(a, needed)
        self.statement(node)
        self.scopes[-1].add(node)

    def closure(self, node: int) -> int:
        """Bit set of everything below a node, itself included."""
        found = self._closure.get(node)
        if found is None:
            found = 1 << node
            for a in self.graph.nodes[node].args:
                found |= self.closure(a)
            self._closure[node] = found
        return found

    def _key(self, node: int):
        op, args, data = self.graph.nodes[node]
        return (op, data if op == "sel" else args[0])

    def _group(self, first: int, needed: set[int]) -> None:
        """Write one `if` for all selections of one multiplier (or condition) that do not need each other."""
        key, group = self._key(first), [first]
        below = self.closure(first)
        # Two groups may need each other where no two nodes do: what is asked for again is written alone.
        for node in sorted(needed - self._open) if first not in self._open else ():
            if node == first or self.graph.nodes[node].op != key[0] or self._key(node) != key:
                continue
            free = not below >> node & 1 and not any(self.closure(node) >> g & 1 for g in group)
            if free and not self.available(node):
                group.append(node)
                below |= self.closure(node)
        opened = set(group) - self._open
        self._open |= opened
        for node in group:
            # What the scope needs anyway is computed before the branch, not inside it.
            inside = self.closure(node) & ~(1 << node)
            for a in sorted(needed):
                if inside >> a & 1:
                    self._ensure(a, needed)
        for a in self._shared(key, group):
            self._ensure(a, needed)
        self._open -= opened
        group = [node for node in group if not self.available(node)]
        if not group:
            return
        branches = self._unlike_branches(key, group)
        for head, results in branches:
            if len(branches) > 1:
                self.writer.line(head)
                self.writer.indent += 1
                self.scopes.append(set())
            self.emit(results)
            for node, result in zip(group, results, strict=True):
                self.writer.line(f"{self.name(node)} = {self.chosen(node, result)}")
            if len(branches) > 1:
                self.scopes.pop()
                self.writer.indent -= 1
        self.scopes[-1].update(group)

    def _shared(self, key, group: list[int]) -> list[int]:
        """Selections with others inside that two branches of a group need: in each they would grow with nesting."""
        once = shared = 0
        for _, results in self._unlike_branches(key, group):
            below = 0
            for result in results:
                below |= self.closure(result)
            once, shared = once | below, shared | (once & below)
        choices = [a for a in range(min(group)) if shared >> a & 1 and self.graph.nodes[a].op in ("sel", "ite")]
        inner = sum(1 << a for a in choices)
        return [a for a in choices if self.closure(a) & inner & ~(1 << a)]

    def chosen(self, node: int, result: int) -> str:
        """Text of what a branch makes of a selection."""
        return self.name(result)

    def _unlike_branches(self, key, group: list[int]) -> list[tuple[str, list[int]]]:
        """The branches with their results for a group, neighbours with the same results as one."""
        found: list[tuple[str, list[int]]] = []
        for head, branch in self._branches(key):
            results = [self.graph.nodes[node].args[branch] for node in group]
            if found and found[-1][1] == results:
                before, _ = found.pop()
                head = head if head == "else:" else f"{before[:-1]} or {head.removeprefix('elif ')}"
            found.append((head, results))
        return found

    def _branches(self, key) -> list[tuple[str, int]]:
        op, which = key
        if op == "ite":
            return [(f"if {self.name(which)}:", 1), ("else:", 2)]
        mult = self.place("mult", which)
        if self.solved is None:
            return [(f"if {mult} == 1.0:", 0), (f"elif {mult} == -1.0:", 1), ("else:", 2)]
        return [(f"if {self.solved(which)}:", 2), (f"elif {mult} > 0.0:", 0), ("else:", 1)]

    def place(self, kind: str, index: int, offset: int = 0) -> str:
        """Text of a variable's place in memory."""
        return f"{kind}[{index}]"

    # ---- formulas ----

    def formula(self, node: int) -> str:
        """Right-hand side of a node's assignment."""
        op, args, data = self.graph.nodes[node]
        names = [self.name(a) for a in args]
        if op == "var":
            return "t" if data[0] == "t" else self.place(*data)
        if op == "sum":
            return linear(zip(data, names, strict=True))
        if op in ("mul", "div"):
            return f"{names[0]} {'*' if op == 'mul' else '/'} {names[1]}"
        if op == "pow":
            exponent = self.graph.value(args[1])
            if data == "above" and self.clamps:
                names[0] = f"max({names[0]}, 0.0)"
            if exponent in (0.5, -0.5):
                return f"{'' if exponent > 0 else '1.0 / '}math.sqrt({names[0]})"
            if exponent in (1.5, 2.5):
                # Half the cost of pow, and as exact.
                return f"{names[0]} * " * int(exponent) + f"math.sqrt({names[0]})"
            return f"{names[0]} ** {names[1]}"
        if op == "entry":
            return f"table{data}[int({names[0]})]"
        if op in ("fun", "fun2"):
            if data in HELPERS:
                self.helpers.add(data)
                return f"{data}({', '.join(names)})"
            if data in ("max", "min"):
                return f"{data}({', '.join(names)})"
            return f"math.{data}({', '.join(names)})"
        if op == "rel":
            return f"{names[0]} {data} {names[1]}"
        if op == "not":
            return f"not {names[0]}"
        return f" {op} ".join(names)  # and, or


def linear(terms, keep_order: bool = False) -> str:
    """Text of sum c*name; positive terms first unless the order matters."""
    text = ""
    for c, name in terms if keep_order else sorted(terms, key=lambda term: term[0] < 0):
        factor = name if abs(c) == 1.0 else f"{literal(abs(c))} * {name}"
        text = f"{text} {'-' if c < 0 else '+'} {factor}" if text else f"{'-' if c < 0 else ''}{factor}"
    return text or "0.0"


def write_update(place: str, value: str, adds: bool) -> str:
    """A line that writes one state of an update, or adds to what other events of the instant have made of it."""
    return f"{place} = {place} + {value}" if adds else f"{place} = {value}"
