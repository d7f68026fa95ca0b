"""Taylor coefficients of a smoothed model, written out order by order: the explicit half of the stiff path.

x_(k+1) = f_k / (k+1), and f_k by the recurrences of codegen/taylor. Written out in scalars, so that nothing is loaded
or looped over: this, and not the method, is what beats a general Taylor code.
"""

from __future__ import annotations

import functools

from ..graph.scalar import Writer
from ..graph.slopes import function_slope
from ..taylor.recurrences import AFFINE, CONSTANT, Degrees, NoRecurrence, OrderK, OrderZero, plain, rewrite

LOW, HIGH = 12, 16  # the orders that the step loop asks for
# Beyond this many products of the HIGH order the text takes longer to compile than it will ever save.
MOST_PRODUCTS = 4000


class FullSlopes:
    """Mix-in of order 0: the slopes of tanh in full."""

    def formula(self, node):
        for a in self.arguments_of_tanh.get(node, ()):
            # 1 - tanh**2 has lost every digit where the layer is left behind.
            return f"1.0 / math.cosh({self.name(a)}) ** 2"
        return super().formula(node)

    @functools.cached_property
    def arguments_of_tanh(self):
        """Node of a slope -> the argument of its tanh, in a list."""
        tanhs = [(a, node.args[0]) for a, node in enumerate(self.graph.nodes) if node.data == "tanh"]
        return {self.graph.split(function_slope(self.graph, a))[1]: [u] for a, u in tanhs}


class _Values(FullSlopes, OrderZero):
    """Order 0 of a smoothed model."""


class _Unrolled(OrderK):
    """Orders k >= 1, each with names of its own: u_k is k<node>_<k>, j u_j is d<node>_<j>."""

    def __init__(self, graph, degrees):
        super().__init__(graph, Writer(), degrees, None)
        self.k, self.count, self.scaled = 0, 0, set()

    def at(self, node: int, j: int) -> str | None:
        """Text of coefficient j >= 0 of a node; None where it is 0."""
        degree = self.degrees.of(node)
        if j == 0:
            return self.value(node)
        if degree in (CONSTANT, AFFINE):
            return f"s{node}" if degree == AFFINE and j == 1 else None
        return f"k{node}_{j}"

    def coefficient(self, node):
        return None if self.degrees.of(node) == CONSTANT else self.at(node, self.k) or "0.0"

    def name(self, node):
        return self.coefficient(node) or "0.0"

    def last(self, node):
        return self.at(node, self.k - 1) or "0.0"

    def _product(self, a, b):
        late, early = sorted((a, b), key=self.lateness, reverse=True)
        return super()._product(late, early)  # its newest coefficient is added last

    def _factor(self, operand: int, j: int) -> str | None:
        node = plain(operand)
        text = self.at(node, j)
        if operand >= 0 or text is None or j == 1:
            return text
        if (node, j) not in self.scaled:
            self.scaled.add((node, j))
            self.writer.line(f"d{node}_{j} = {j}.0 * {text}")
        return f"d{node}_{j}"

    def _sum(self, a, b):
        """Text of sum over 0 < j < k of a_j b_(k-j): two running sums, and last the terms that wait for new values."""
        k = self.k
        if a == b:
            pairs = [(j, k - j) for j in [*range(2, (k + 1) // 2), 1] if 2 * j < k]
            text = f"2.0 * ({self._terms(a, b, pairs)})" if pairs else "0.0"
            return f"({text} + {self._terms(a, b, [(k // 2, k // 2)])})" if k % 2 == 0 else text
        pairs = [*((j, k - j) for j in range(2, k - 1)), (1, k - 1), (k - 1, 1)]
        return f"({self._terms(a, b, pairs[: k - 1])})"

    def _terms(self, a, b, pairs):
        factors = [(self._factor(a, i), self._factor(b, j)) for i, j in pairs]
        terms = [f"{x} * {y}" for x, y in factors if x and y]
        self.count += len(terms)
        early, late = terms[:-2], terms[-2:]
        if len(early) < 4:
            return " + ".join(terms) or "0.0"
        half = len(early) // 2
        return " + ".join([f"(({' + '.join(early[:half])}) + ({' + '.join(early[half:])}))", *late])


def taylor_lines(code, rates: list[int], extra: list[int]) -> list[str]:
    """Body of taylor(t, x, p, K, stride, rows); empty with branches and long texts, and where a recurrence is missing.

    Orders 0..K of the states, K = LOW or HIGH, and of each further root (surfaces that are no states) in the rows after
    them.
    """
    graph, n = code.graph, len(rates)
    if any(graph.nodes[a].op == "ite" for a in graph.reach([*rates, *extra])):
        return []
    try:
        nodes = rewrite(graph, [*rates, *extra])
        rates, extra = nodes[:n], nodes[n:]
        degrees = Degrees(graph, rates, general=False)
        orders = _Unrolled(graph, degrees)
        _write_orders(orders, rates, extra)
    except NoRecurrence:
        return []
    if orders.count > MOST_PRODUCTS:
        return []
    values = _Values(graph, Writer(), degrees, None, orders.reciprocals)
    states = [graph.var("x", i) for i in range(n)]
    # The constant rates are the slopes of affine states.
    values.emit([rate for x, rate in zip(states, rates, strict=True) if degrees.of(x) == AFFINE])
    values.emit([*states, *nodes])
    code.helpers |= values.helpers
    return values.writer.lines + orders.writer.lines


def _write_orders(orders: _Unrolled, rates, extra) -> None:
    states = [orders.graph.var("x", i) for i in range(len(rates))]
    line = orders.writer.line
    for k in range(HIGH + 1):
        orders.k, orders.scopes = k, [set(states)]
        if k > 0:
            line(f"inv = {1.0 / k!r}")
            for x, rate in zip(states, rates, strict=True):
                if orders.degrees.of(x) not in (CONSTANT, AFFINE):
                    line(f"k{x}_{k} = {orders.at(rate, k - 1) or '0.0'} * inv")
            if k < HIGH or extra:
                orders.emit([*rates, *extra] if k < HIGH else extra)
        if k in (LOW, HIGH):
            for j in range(0 if k == LOW else LOW + 1, k + 1):
                for row, a in enumerate([*states, *extra]):
                    line(f"rows[{row} * stride + {j}] = {orders.at(a, j) or '0.0'}")
        if k == LOW:
            line(f"if K <= {LOW}:")
            line("    return")
