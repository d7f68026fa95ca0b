"""The same functions by fewer products: of two series each costs a convolution, everything else next to nothing.

    a/d + b/d -> (a + b)/d        one division a denominator; likewise one product a common factor
    a b c, a b d -> (a b) c, (a b) d      what products have in common is multiplied once (greedy, as common
                                          subexpressions of products are: Breuer's method)
    u^1.5/v^1.5 -> (u/v)^1.5      where u/v is there anyway: sympy has split it
    -a - b -> -(a + b)            one node for both signs

Products are seen as monomials: a number, constants of the step, and powers of what moves (letters). Quotients that
the source defines stay defined, and none is formed that divides by anything else than the source does.
Chain: Graph (dag.py) -> **simplify** -> recurrences.py.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ..graph.nodes import Node, Nodes
from .recurrences import AFFINE, GENERAL, Degrees

_MOST = 400  # monomials; beyond, looking for pairs would take longer than compiling what it saves


@dataclass
class Monomial:
    """number * prod fixed^e * prod moving^e, with integer exponents."""

    number: float = 1.0
    fixed: Counter = field(default_factory=Counter)
    moving: Counter = field(default_factory=Counter)

    def put(self, letter: int, exponent: int, moves: bool) -> None:
        part = self.moving if moves else self.fixed
        part[letter] += exponent
        if part[letter] == 0:
            del part[letter]

    def costs(self) -> bool:
        """Whether series are multiplied or divided in it."""
        return sum(map(abs, self.moving.values())) > 1 or any(e < 0 for e in self.moving.values())


class Simplifier:
    """Rewrites roots of a graph; `degrees` tells what moves."""

    def __init__(self, graph: Nodes, degrees: Degrees):
        self.graph, self.degrees = graph, degrees

    def moves(self, node: int) -> bool:
        return self.degrees.of(node) in (AFFINE, GENERAL)

    def children(self, node: int) -> tuple[int, ...]:
        """Arguments that the program evaluates: with fixed multipliers no affine form."""
        op, args, _ = self.graph.nodes[node]
        return args[:2] if op == "sel" and not self.degrees.general else args

    def reach(self, roots) -> list[int]:
        seen, stack = set(), list(roots)
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(self.children(node))
        return sorted(seen)

    def cost(self, roots) -> int:
        """Convolutions that the roots need."""
        total = 0
        for node in self.reach(roots):
            op, args, data = self.graph.nodes[node]
            moving = sum(self.moves(a) for a in args)
            if moving and (op == "pow" or data == "sqrt" or (op == "div" and self.moves(args[1]))):
                total += 2 if op == "pow" else 1
            elif op == "mul" and moving == 2:
                total += 1
        return total

    def rebuild(self, node: int, new: tuple[int, ...]) -> int:
        """The node with other arguments."""
        graph, (op, args, data) = self.graph, self.graph.nodes[node]
        new += args[len(new) :]
        if new == args:
            return node
        if op == "sum":
            return self.sum(zip(data, new, strict=True))
        if op in ("mul", "div"):
            return getattr(graph, op)(*new)
        return graph.make(op, new, data)

    def is_product(self, node: int) -> bool:
        op, args, _ = self.graph.nodes[node]
        return op in ("mul", "div") or (op == "sum" and len(args) == 1 and self.is_product(args[0]))

    def monomial(self, node: int, exponent: int = 1, into: Monomial | None = None) -> Monomial:
        into = into or Monomial()
        op, args, data = self.graph.nodes[node]
        if op == "num":
            into.number *= data**exponent
        elif op == "sum" and len(args) == 1:
            into.number *= data[0] ** exponent
            self.monomial(args[0], exponent, into)
        elif op in ("mul", "div"):
            self.monomial(args[0], exponent, into)
            self.monomial(args[1], exponent if op == "mul" else -exponent, into)
        else:
            into.put(node, exponent, self.moves(node))
        return into

    def product(self, letters, build=lambda letter: letter) -> int:
        """Node of a product of powers."""
        graph, above, below = self.graph, self.graph.one, self.graph.one
        for letter, e in sorted(letters.items()):
            factor = graph.power(build(letter), graph.num(abs(e)))
            if e > 0:
                above = graph.mul(above, factor)
            else:
                below = graph.mul(below, factor)
        return graph.div(above, below)

    def node(self, m: Monomial, build=lambda letter: letter) -> int:
        graph = self.graph
        fixed, moving = self.product(m.fixed, build), self.product(m.moving, build)
        return graph.scale(m.number, graph.mul(fixed, moving))

    # ---- sums: one sign, common factors ----

    def sum(self, terms) -> int:
        """A sum whose sums stay nodes."""
        graph, constant, merged = self.graph, 0.0, Counter()
        for c, a in terms:
            factor, a = graph.split(a)
            if a == graph.one:
                constant += c * factor
            else:
                merged[a] += c * factor
        if constant:
            merged[graph.num(constant)] = 1.0
        return self._sum({a: c for a, c in merged.items() if c})

    def _sum(self, merged: dict[int, float]) -> int:
        graph, args = self.graph, tuple(sorted(merged))
        if len(args) < 2:
            return graph.sum((c, a) for a, c in merged.items())
        return graph.make("sum", args, tuple(merged[a] for a in args))

    def gather_signs(self, roots: list[int]) -> list[int]:
        """Every sum begins with a positive term, its negative is -1 times it; what moves in it is a sum of its own."""
        memo: dict[int, int] = {}
        for node in self.reach(roots):
            new = self.rebuild(node, tuple(memo[a] for a in self.children(node)))
            op, args, data = self.graph.nodes[new]
            memo[node] = self._signed(dict(zip(args, data, strict=True))) if op == "sum" else new
        return [memo[r] for r in roots]

    def _signed(self, merged: dict[int, float]) -> int:
        graph = self.graph
        core = {a: c for a, c in merged.items() if self.moves(a)}
        if 1 < len(core) < len(merged):
            factor, a = graph.split(self._signed(core))
            merged = {b: c for b, c in merged.items() if b not in core} | {a: factor}
        if len(merged) < 2 or merged[min(merged)] > 0:
            return self._sum(merged)
        return graph.make("sum", (self._sum({a: -c for a, c in merged.items()}),), (-1.0,))

    def factor_sums(self, roots: list[int]) -> list[int]:
        graph, reached = self.graph, self.reach(roots)
        uses = Counter(a for node in reached for a in self.children(node))
        uses.update(roots)
        memo: dict[int, int] = {}
        for node in reached:
            op, args, data = graph.nodes[node]
            if op == "sum" and len(args) > 1:
                terms = [(c, memo[a]) for c, a in zip(data, args, strict=True)]
                own = [uses[a] == 1 and self.is_product(memo[a]) for a in args]
                memo[node] = self._factored(terms, own) if sum(own) > 1 else self.sum(terms)
            else:
                memo[node] = self.rebuild(node, tuple(memo[a] for a in self.children(node)))
        return [memo[r] for r in roots]

    def _factored(self, terms, own) -> int:
        """Sum of the terms with common letters of those that nobody else uses taken out, the most common first."""
        rest = [term for term, mine in zip(terms, own, strict=True) if not mine]
        monomials = []
        for (c, a), mine in zip(terms, own, strict=True):
            if mine:
                m = self.monomial(a)
                m.number *= c
                if m.costs():
                    monomials.append(m)
                else:
                    rest.append((c, a))
        while True:
            common = Counter((letter, 1 if e > 0 else -1) for m in monomials for letter, e in m.moving.items())
            best = min(common, key=lambda k: (-common[k], k[1], k[0]), default=None)
            if best is None or common[best] < 2:
                break
            letter, sign = best
            inside = [m for m in monomials if m.moving[letter] * sign > 0]
            monomials = [m for m in monomials if m.moving[letter] * sign <= 0]
            for m in inside:
                m.put(letter, -sign, True)
            inner = self.sum([(1.0, self.node(m)) for m in inside])
            # What is left of it may have more in common with others, and is a product now.
            whole = Monomial()
            whole.put(letter, sign, True)
            self.monomial(inner, 1, whole)
            monomials.append(whole)
        return self.sum(rest + [(1.0, self.node(m)) for m in monomials])

    # ---- products ----

    def share_products(self, roots: list[int]) -> list[int]:
        graph, reached = self.graph, self.reach(roots)
        inner = {a for node in reached if self.is_product(node) for a in self.children(node)}
        outer = {a for node in reached if not self.is_product(node) for a in self.children(node)} | set(roots)
        whole = [node for node in reached if self.is_product(node) and (node in outer or node not in inner)]
        monomials = {node: self.monomial(node) for node in whole}
        self._join_powers(monomials.values(), set(reached))
        self._split_roots(monomials.values())
        pairs = self._pairs([m.moving for m in monomials.values()]) if len(monomials) <= _MOST else {}
        memo: dict[int, int] = {}

        def build(letter: int) -> int:
            if letter not in memo:
                if letter in pairs:
                    a, b, sign = pairs[letter]
                    memo[letter] = (graph.mul if sign > 0 else graph.div)(build(a), build(b))
                elif letter in monomials:
                    memo[letter] = self.node(monomials[letter], build)
                else:
                    memo[letter] = self.rebuild(letter, tuple(build(a) for a in self.children(letter)))
            return memo[letter]

        for node in reached:
            if not self.is_product(node) or node in monomials:
                build(node)
        return [build(r) for r in roots]

    def _join_powers(self, monomials, reached) -> None:
        """u^a v^-a as (u/v)^a where the quotient is there."""
        graph = self.graph

        def base(letter):
            op, args, data = graph.nodes[letter]
            if data == "above":
                return None
            return (args[0], args[1]) if op == "pow" else (args[0], "sqrt") if data == "sqrt" else None

        for m in monomials:
            roots = [letter for letter in m.moving if base(letter)]
            for up in [letter for letter in roots if m.moving[letter] > 0]:
                for down in [letter for letter in roots if m.moving[letter] < 0]:
                    (u, a), (v, b) = base(up), base(down)
                    quotient = graph._number.get(Node("div", (u, v), None))
                    if a == b and quotient in reached and m.moving[up] == -m.moving[down]:
                        joined = graph.fun("sqrt", quotient) if a == "sqrt" else graph.power(quotient, a)
                        e = m.moving.pop(up)
                        del m.moving[down]
                        m.put(joined, e, True)
                        break

    def _split_roots(self, monomials) -> None:
        """u as sqrt(u)^2 in a monomial that so has something in common with another one."""
        graph = self.graph
        letters = {letter for m in monomials for letter in m.moving}
        half = {graph.nodes[s].args[0]: s for s in sorted(letters) if graph.nodes[s].data == "sqrt"}
        sides = Counter()
        for m in monomials:
            sides.update(_sides(m.moving))
        for m in monomials:
            for u in [letter for letter in m.moving if letter in half]:
                s, e = half[u], m.moving[u]
                others = [other for other in m.moving if other not in (u, s)]
                if any(sides[_side(o, m.moving[o], s, e)] for o in others):
                    del m.moving[u]
                    m.put(s, 2 * e, True)

    def _pairs(self, monomials) -> dict[int, tuple[int, int, int]]:
        """Replaces the most frequent pair by a letter of its own until none is met twice: letter -> (a, b, sign)."""
        pairs: dict[int, tuple[int, int, int]] = {}
        fresh = -1
        where: dict[tuple, Counter] = {}  # pair -> how often in which monomial

        def note(i, times):
            for pair, count in _sides(monomials[i]).items():
                where.setdefault(pair, Counter())[i] += times * count

        for i in range(len(monomials)):
            note(i, 1)
        while True:
            total = {pair: sum(count.values()) for pair, count in where.items()}
            pair = min(total, key=lambda p: (-total[p], max(map(abs, p[:2])), p), default=None)
            if pair is None or total[pair] < 2:
                return pairs
            a, b, sign = pair
            pairs[fresh] = pair
            for i in [i for i, count in where[pair].items() if count]:
                note(i, -1)
                m = monomials[i]
                while (count := _sides(m).get(pair, 0)) > 0:
                    e = 1 if m[a] > 0 else -1
                    for letter, change in ((a, -e), (b, -e * sign), (fresh, e)):
                        m[letter] += change * count
                        if m[letter] == 0:
                            del m[letter]
                note(i, 1)
            fresh -= 1


def _side(a: int, ea: int, b: int, eb: int) -> tuple[int, int, int]:
    """A pair of letters: their product (sign 1) or the quotient of the first by the second (sign -1)."""
    sign = 1 if (ea > 0) == (eb > 0) else -1
    if sign > 0:
        return (min(a, b), max(a, b), 1)
    # A quotient and its inverse are told apart: a series is never inverted to save a product.
    return (a, b, -1) if ea > 0 else (b, a, -1)


def _sides(letters) -> Counter:
    """Every pair of a monomial and how often it can be taken out."""
    found: Counter = Counter()
    items = sorted(letters.items())
    for i, (a, ea) in enumerate(items):
        if abs(ea) > 1:
            found[a, a, 1] += abs(ea) // 2
        for b, eb in items[i + 1 :]:
            found[_side(a, ea, b, eb)] += min(abs(ea), abs(eb))
    return found


def simplify(graph: Nodes, roots: list[int], degrees: Degrees) -> list[int]:
    """Roots of the same values with fewer products of series; `degrees` is that of the rates among them."""
    simplifier = Simplifier(graph, degrees)
    new = roots
    for step in (
        simplifier.gather_signs,
        simplifier.factor_sums,
        simplifier.gather_signs,
        simplifier.share_products,
    ):
        new = step(new)
    # Greedy is no proof: where the source shares better, it stays.
    return new if simplifier.cost(new) < simplifier.cost(roots) else roots
