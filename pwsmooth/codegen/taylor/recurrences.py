"""Taylor recurrences: the coefficient of order k of a node from the coefficients of its arguments.

With u = sum u_k s^k, every rule below follows from the differential equation that the function satisfies
(Griewank & Walther, Evaluating Derivatives, 2nd ed., tables 13.1 and 13.2); the last term of each convolution
is kept apart, so that the sum over 1..k-1 needs no value of the order that is being computed.

Each node has a degree in time: constant in this step, affine, or general. Constants cost nothing, functions
of an affine argument O(1) an order. In the general program a node may be *switchable*: constant unless a
multiplier that it depends on is solved.

Chain: Graph (dag.py) -> order-k statements (this file) -> jets.py.
"""

from __future__ import annotations

from ..graph.dag import Graph
from ..graph.scalar import ScalarCode, linear, literal
from ..graph.slopes import function_slope

CONSTANT, AFFINE, GENERAL, SWITCHABLE = range(4)

# Functions whose slope q in w' = q u' is itself a node with a series.
BY_SLOPE = (
    "sin",
    "cos",
    "sinh",
    "cosh",
    "tan",
    "tanh",
    "atan",
    "asin",
    "acos",
    "asinh",
    "acosh",
    "atanh",
    "erf",
    "erfc",
)


# Functions that come so close to a constant, far from 0, that no coefficient shows what they do at 0.
FLAT = ("exp", "sinh", "cosh", "tanh", "erf", "erfc")


class NoRecurrence(TypeError):
    """The model contains a function that has no Taylor recurrence."""


def rewrite(graph: Graph, roots: list[int]) -> list[int]:
    """Roots with every power of a moving exponent written as exp(b log a)."""
    memo: dict[int, int] = {}

    def visit(node: int) -> int:
        found = memo.get(node)
        if found is None:
            op, args, data = graph.nodes[node]
            new = tuple(visit(a) for a in args)
            if op == "pow" and graph.depends[new[1]]:
                found = graph.fun("exp", graph.mul(new[1], graph.fun("log", new[0])))
            elif new == args:
                found = node
            elif op == "sum":
                found = graph.sum(zip(data, new, strict=True))
            elif op in ("mul", "div"):
                found = getattr(graph, op)(*new)
            else:
                found = graph.make(op, new, data)
            memo[node] = found
        return found

    return [visit(r) for r in roots]


class Degrees:
    """Degree in time of every node, for a program with fixed (`general=False`) or solvable multipliers.

    The first `known` states and multipliers, if it is told, are series like any other.
    """

    def __init__(
        self,
        graph: Graph,
        rates: list[int],
        general: bool,
        never_affine=frozenset(),
        known: tuple[int, int] = (0, 0),
    ):
        self.graph, self.rates, self.general, self.known = graph, rates, general, known[1]
        never_affine = never_affine | set(range(known[0]))
        # The slope of such a state cannot be written before its value: it contains a floor of it.
        stairs = {
            i for i, r in enumerate(rates) if any(graph.nodes[a].data == "floor" for a in graph.reach([r]))
        }
        never_affine = never_affine | stairs
        # (degree with fixed multipliers, multipliers it moves with): optimistic, raised until consistent.
        self.states = [(CONSTANT, 0)] * len(rates)
        while True:
            self._memo: dict[int, tuple[int, int]] = {}
            found = [(CONSTANT, 0) if r == graph.zero else self._raised(r) for r in rates]
            found = [(GENERAL if i in never_affine and b else b, m) for i, (b, m) in enumerate(found)]
            if found == self.states:
                break
            self.states = found

    def _raised(self, rate: int) -> tuple[int, int]:
        base, moving = self.pair(rate)
        return min(base + 1, GENERAL), moving

    def pair(self, node: int) -> tuple[int, int]:
        found = self._memo.get(node)
        if found is None:
            found = self._memo[node] = self._find(node)
        return found

    def of(self, node: int) -> int:
        base, moving = self.pair(node)
        if moving and self.general and base != GENERAL:
            return SWITCHABLE if base == CONSTANT else GENERAL
        return base

    def _find(self, node: int) -> tuple[int, int]:
        op, args, data = self.graph.nodes[node]
        if op == "var":
            kind, index = data[:2]
            if kind == "x":
                return self.states[index]
            if kind == "mult" and index < self.known:
                return GENERAL if self.general else CONSTANT, 0
            if kind == "mult":
                return CONSTANT, 1 << index - self.known if self.general else 0
            return (AFFINE if kind == "t" else CONSTANT), 0
        if op == "fun" and data == "floor":
            return CONSTANT, 0  # of what moves only `Whole` has come so far
        if op == "sel":
            used = args if self.general else args[:2]
            pairs = [self.pair(a) for a in used]
            base = GENERAL if any(p[0] for p in pairs) else CONSTANT
        else:
            pairs = [self.pair(a) for a in args]
            base = max((p[0] for p in pairs), default=CONSTANT)
            if op == "mul":
                base = min(sum(p[0] for p in pairs), GENERAL)
            elif op == "div" and pairs[1][0] == CONSTANT:
                base = pairs[0][0]
            elif op != "sum" and base:
                base = GENERAL
            if op == "ite" and pairs[0] != (CONSTANT, 0):
                raise NoRecurrence("a condition that moves with the state")
        moving = 0
        for p in pairs:
            moving |= p[1]
        return base, moving


class JetCode(ScalarCode):
    """ScalarCode that also emits the companions (cos of a sin, slope of a tanh) that recurrences need."""

    clamps = False  # there is no series from there

    def __init__(self, graph, writer, degrees: Degrees, prefix: str, solved):
        super().__init__(graph, writer, prefix, solved)
        self.degrees = degrees

    def companion(self, node: int) -> int | None:
        """The node q of w' = q u', up to a factor, where w is a moving function of u."""
        op, _, data = self.graph.nodes[node]
        if op == "fun" and data in BY_SLOPE and self.degrees.of(node) != CONSTANT:
            return self.graph.split(function_slope(self.graph, node))[1]
        return None

    def needed(self, roots) -> set[int]:
        """Nodes that the current scope needs, companions included."""
        found: set[int] = set()
        fresh = list(roots)
        while fresh:
            added = set(self.graph.reach(fresh, lazy=True)) - found
            found |= added
            fresh = [q for a in added if (q := self.companion(a)) is not None and q not in found]
        return found

    def emit(self, roots) -> None:
        needed = self.needed(roots)
        for node in sorted(needed):
            self._ensure(node, needed)

    def _ensure(self, node: int, needed: set[int]) -> None:
        if self.available(node):
            return
        super()._ensure(node, needed)
        q = self.companion(node)
        if q is not None:
            self._ensure(q, needed)

    def _branches(self, key):
        if key[0] == "sel" and not self.degrees.general:
            return [(f"if {self.place('mult', key[1])} > 0.0:", 0), ("else:", 1)]
        return super()._branches(key)


class OrderZero(JetCode):
    """Values v, slopes s of affine nodes and reciprocals r, at the start of the step."""

    def __init__(self, graph, writer, degrees, solved, reciprocals: set[int]):
        super().__init__(graph, writer, degrees, "v", solved)
        self.reciprocals = reciprocals

    def statement(self, node: int) -> None:
        super().statement(node)
        if self.degrees.of(node) == AFFINE:
            self.writer.line(f"s{node} = {self._slope(node)}")
        if node in self.reciprocals:
            self.writer.line(f"r{node} = 1.0 / {self.name(node)}")

    def _slope(self, node: int) -> str:
        op, args, data = self.graph.nodes[node]
        if op == "var":
            return "1.0" if data[0] == "t" else self.name(self.degrees.rates[data[1]])
        moving = [a for a in args if self.degrees.of(a) == AFFINE]
        if op == "sum":
            return linear((c, f"s{a}") for c, a in zip(data, args, strict=True) if a in moving)
        if op == "mul":
            fixed = args[0] if args[1] in moving else args[1]
            return f"{self.name(fixed)} * s{moving[0]}"
        return f"s{args[0]} / {self.name(args[1])}"  # div


class OrderK(JetCode):
    """Coefficients k of order k >= 1, and what they need: rows, block sums, carried values, reciprocals.

    An operand of a product is a node u, or ~u for the series j u_j of its derivative.
    """

    def __init__(self, graph, writer, degrees, solved):
        super().__init__(graph, writer, degrees, "k", solved)
        self.rows: dict[int, int] = {}
        self.products: dict[tuple[int, int], int] = {}
        self.order = 0  # place of this order in its block
        self.reciprocals: set[int] = set()
        self.carried: set[int] = set()  # the last order's value is needed, in l
        self.states = {graph.var("x", i) for i in range(len(degrees.rates))}
        self._lateness: dict[int, int] = {}
        self.transient: set[int] = set()  # affine nodes: slope at order 1, then 0, in z
        self.flat: dict[int, None] = {}  # arguments of functions that are flat far from 0

    def row(self, node: int) -> str:
        """Text of the offset of a node's row; a number is given to it at its first use."""
        return f"o{self.rows.setdefault(node, len(self.rows))}"

    def holder(self, node: int) -> int:
        """The node in whose row a node's coefficients stand."""
        return node

    def flat_rows(self) -> tuple[int, ...]:
        """Rows of the arguments of functions that are flat far from 0."""
        return tuple({self.rows[self.holder(u)]: None for u in self.flat})

    def coefficient(self, node: int) -> str | None:
        """Text of a node's coefficient of order k; None where it is 0."""
        degree = self.degrees.of(node)
        if degree == CONSTANT:
            return None
        if degree == AFFINE:
            self.transient.add(node)
            return f"z{node}"
        return f"k{node}"

    def value(self, node: int) -> str:
        """Text of a node's value at the start of the step."""
        op, _, data = self.graph.nodes[node]
        return literal(data) if op == "num" else f"v{node}"

    def reciprocal(self, node: int) -> str:
        self.reciprocals.add(node)
        return f"r{node}"

    def last(self, node: int) -> str:
        self.carried.add(node)
        return f"l{node}"

    def lateness(self, node: int) -> int:
        """Operations from the last order's rates to this coefficient; 0 for a state whose rate is a state."""
        found = self._lateness.get(node)
        if found is None:
            op, args, data = self.graph.nodes[node]
            if op == "var" or self.degrees.of(node) in (CONSTANT, AFFINE):
                late = op == "var" and data[0] == "x" and self.degrees.rates[data[1]] not in self.states
                found = 1 if late else 0
            else:
                found = max(self.lateness(a) for a in args)
                found += found > 0
            self._lateness[node] = found
        return found

    def available(self, node: int) -> bool:
        return self.degrees.of(node) in (CONSTANT, AFFINE) or super().available(node)

    def name(self, node: int) -> str:
        degree = self.degrees.of(node)
        if self.graph.nodes[node].op in ("rel", "and", "or", "not", "inside"):
            return f"v{node}"  # conditions are constants of the step
        return f"k{node}" if degree in (GENERAL, SWITCHABLE) else self.coefficient(node) or "0.0"

    # ---- recurrences ----

    def _sum(self, a: int, b: int) -> str:
        """Text of sum over 0 < j < k of a_j b_(k-j), by blocks (`presum` in native.py).

        c1, c2, c3 are an operand's first three orders of this block. In the first block both factors are of the
        block and each pair is met twice, so `later` is 0 there, else 1. What is only just known is added last.
        While a switchable operand is constant the sum is skipped at run time.
        """
        a, b = min(a, b), max(a, b)
        (x, row_a), (y, row_b) = ((label(u), self.row(u)) for u in (a, b))
        terms = [f"rows[{self.scratch(a, b)} + {self.order}]"]
        for r in range(1, self.order + 1):
            low = self.order + 1 - r
            if a == b:
                terms += [f"(later + 1.0) * rows[{row_a} + {low}] * c{r}{x}"]
            else:
                terms += [f"later * rows[{row_a} + {low}] * c{r}{y}", f"rows[{row_b} + {low}] * c{r}{x}"]
        text = " + ".join(terms)
        guard = self.guard(a, b)
        return f"choose({guard}, {text}, 0.0)" if guard else f"({text})"

    def scratch(self, a: int, b: int) -> str:
        """Text of the place of a product's four block sums."""
        block = self.products.setdefault((a, b), len(self.products))
        return f"scratch + {4 * block}"

    def guard(self, a: int, b: int) -> str:
        """Text of the condition under which neither operand is constant; empty where that is certain."""
        masks = {self.degrees.pair(plain(u))[1] for u in (a, b) if self.degrees.of(plain(u)) == SWITCHABLE}
        return " and ".join(f"({' or '.join(f'on{j}' for j in bits(m))})" for m in sorted(masks))

    def block_sums(self) -> list[str]:
        """Lines at the start of a block."""
        lines = ["later = choose(q > 0, 1.0, 0.0)"]
        for a, b in self.products:
            call = f"presum(rows, {self.row(a)}, {self.row(b)}, q, {self.scratch(a, b)})"
            guard = self.guard(a, b)
            lines += [f"if {guard}:", f"    {call}"] if guard else [call]
        return lines

    def next_place(self) -> None:
        """Start the next order of an unrolled block: nothing of it is emitted yet."""
        self.order += 1
        self.scopes = [set()]

    def last_value(self, operand: int) -> str:
        """Text of an operand's final coefficient of this order."""
        text = self.coefficient(plain(operand)) or "0.0"
        return f"k * {text}" if operand < 0 else text

    def formula(self, node: int) -> str:
        op, args, data = self.graph.nodes[node]
        if op == "sum":
            # Early values first: the chain from order to order then waits for one addition, not for all.
            terms = [(c, a) for c, a in zip(data, args, strict=True) if self.degrees.of(a) != CONSTANT]
            terms.sort(key=lambda term: (self.lateness(term[1]), term[1]))
            return linear([(c, self.coefficient(a)) for c, a in terms], keep_order=True)
        if op == "mul":
            return self._product(*args)
        if op == "div":
            return self._quotient(node, *args)
        if op == "pow":
            return self._power(node, *args)
        if op == "fun":
            return self._function(node, args[0], data)
        if op == "var":
            return "0.0"  # a multiplier, before it is solved at this order
        raise NoRecurrence(f"no Taylor recurrence of `{data or op}`")

    def _product(self, a: int, b: int) -> str:
        da, db = self.degrees.of(a), self.degrees.of(b)
        if da == CONSTANT or db == CONSTANT:
            fixed, moving = (a, b) if da == CONSTANT else (b, a)
            return f"{self.value(fixed)} * {self.coefficient(moving)}"
        if AFFINE in (da, db):
            line, other = (a, b) if da == AFFINE else (b, a)
            return f"{self.value(line)} * {self.coefficient(other)} + s{line} * {self.last(other)}"
        if a == b:
            return f"2.0 * {self.value(a)} * {self.coefficient(a)} + {self._sum(a, a)}"
        ends = f"{self.value(a)} * {self.coefficient(b)} + {self.value(b)} * {self.coefficient(a)}"
        return f"{self._sum(a, b)} + {ends}"

    def _quotient(self, w: int, a: int, b: int) -> str:
        above = self.coefficient(a)
        degree = self.degrees.of(b)
        if degree == CONSTANT:
            return f"{above} * {self.reciprocal(b)}"
        inverse = self.reciprocal(b)
        if degree == AFFINE:
            return f"({above or ''} - s{b} * {self.last(w)}) * {inverse}"
        # What comes last waits for one operation.
        known = f"({above or ''} - {self._sum(w, b)}) * {inverse}"
        return f"{known} - ({self.value(w)} * {inverse}) * {self.coefficient(b)}"

    def _power(self, w: int, u: int, exponent: int) -> str:
        # u w' = alpha u' w
        alpha, uk = self.value(exponent), self.coefficient(u)
        inner = f"({alpha} + 1.0) * inv * {self._sum(~u, w)} - {self._sum(u, w)}"
        inverse = self.reciprocal(u)
        return f"({inner}) * {inverse} + ({alpha} * {self.value(w)} * {inverse}) * {uk}"

    def _function(self, w: int, u: int, name: str) -> str:
        uk, affine = self.coefficient(u), self.degrees.of(u) == AFFINE
        if name in FLAT:
            self.row(u)
            self.flat[u] = None
        if name == "sqrt":  # w^2 = u
            half = f"(0.5 * {self.reciprocal(w)})"
            return f"{uk} * {half} - {self._sum(w, w)} * {half}"
        if name == "log":  # u w' = u'
            return f"({uk} - inv * {self._sum(~w, u)}) * {self.reciprocal(u)}"
        if name == "exp":
            factor, q = 1.0, w
        elif name in BY_SLOPE:
            factor, q = self.graph.split(function_slope(self.graph, w))
        else:
            raise NoRecurrence(f"no Taylor recurrence of `{name}`")
        scale = "" if factor == 1.0 else f"{literal(factor)} * "
        if affine:
            return f"{scale}s{u} * inv * {self.last(q)}"
        return f"{scale}(inv * {self._sum(~u, q)} + {self.value(q)} * {uk})"


def plain(operand: int) -> int:
    """The node u of an operand: u itself, or ~u for the series j u_j."""
    return operand if operand >= 0 else ~operand


def label(operand: int) -> str:
    return f"x{operand}" if operand >= 0 else f"w{~operand}"


def bits(mask: int) -> list[int]:
    """Numbers of the bits that are set."""
    return [j for j in range(mask.bit_length()) if mask >> j & 1]
