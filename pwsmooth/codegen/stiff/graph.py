"""Expressions of a smoothed model as a graph of shared operations, graded by what they depend on.

    level 0: parameters only    level 1: time as well    level 2: states

The grading is what makes the Newton iteration cheap: products and sums are split by level, so that everything
of time alone leaves the iteration, and everything of the parameters alone leaves the loop over stages.
Chain: Model -> this graph -> text (functions.py, taylor.py).
"""

from __future__ import annotations

import math

import sympy as sp

from pwsmooth.definition.model import Select

UNARY = {sp.exp: "exp", sp.log: "log", sp.sin: "sin", sp.cos: "cos", sp.tan: "tan", sp.sinh: "sinh",
         sp.cosh: "cosh", sp.tanh: "tanh", sp.atan: "atan", sp.asin: "asin", sp.acos: "acos", sp.erf: "erf",
         sp.erfc: "erfc", sp.asinh: "asinh", sp.acosh: "acosh", sp.atanh: "atanh", sp.Abs: "abs",
         sp.floor: "floor", sp.ceiling: "ceil"}  # fmt: skip
_RELATION = {sp.StrictLessThan: "<", sp.LessThan: "<=", sp.StrictGreaterThan: ">", sp.GreaterThan: ">=",
             sp.Equality: "==", sp.Unequality: "!="}  # fmt: skip


class UnsupportedExpression(ValueError):
    """An expression that has no compiled form on the smoothed path."""


class Graph:
    """Hash-consed operations; a node is an index, its operands have smaller indices.

    ops: num v | par i | time | state i | add ((c, node), ...) | mul a b | div a b | sqrt a | rsqrt a | pow a
    r | fun name a | atan2 a b | cmp op a b | not a | and a b | or a b | ite c a b
    """

    def __init__(self, time, states, parameters):
        self.ops: list[tuple] = []
        self.level: list[int] = []
        self._known: dict[tuple, int] = {}
        self._memo: dict[sp.Basic, int] = {}
        self._leaf = {time: ("time",)}
        self._leaf |= {s: ("state", i) for i, s in enumerate(states)}
        self._leaf |= {s: ("par", i) for i, s in enumerate(parameters)}
        self._root_bases: set = set()
        self._states = frozenset(states)

    def node(self, *op) -> int:
        if op in self._known:
            return self._known[op]
        kind = op[0]
        if kind in ("num", "par"):
            level = 0
        elif kind in ("time", "state"):
            level = 1 if kind == "time" else 2
        else:
            level = max(self.level[a] for a in operands(op))
        self.ops.append(op)
        self.level.append(level)
        self._known[op] = len(self.ops) - 1
        return len(self.ops) - 1

    def num(self, value) -> int:
        return self.node("num", float(value))

    # -- products and sums, split by level -------------------------------------------------------

    def mul(self, factors: list[int]) -> int:
        result = None
        for level in range(3):
            for a in sorted(f for f in factors if self.level[f] == level):
                result = a if result is None else self.node("mul", result, a)
        return self.num(1.0) if result is None else result

    def add(self, terms: list[tuple[float, int]]) -> int:
        gathered: dict[int, float] = {}
        for c, a in terms:
            inner = self.ops[a][1] if self.ops[a][0] == "add" and self.level[a] == 2 else ((1.0, a),)
            for d, b in inner:
                gathered[b] = gathered.get(b, 0.0) + c * d
        low: tuple = ()
        for level in range(3):
            here = tuple((c, a) for a, c in sorted(gathered.items()) if c != 0.0 and self.level[a] == level)
            if here:
                low = ((1.0, self._sum(low + here)),) if level < 2 else low + here
        return self._sum(low)

    def _sum(self, terms) -> int:
        if not terms:
            return self.num(0.0)
        if all(self.ops[a][0] == "num" for _, a in terms):
            return self.num(math.fsum(c * self.ops[a][1] for c, a in terms))
        if len(terms) == 1 and terms[0][0] == 1.0:
            return terms[0][1]
        return self.node("add", tuple(terms))

    def div(self, a: int, b: int) -> int:
        if self.level[b] < 2:  # the reciprocal leaves the loop
            return self.mul([a, self.node("div", self.num(1.0), b)])
        return self.node("div", a, b)

    def _integer_power(self, a: int, n: int) -> int:
        if n == 1:
            return a
        half = self._integer_power(a, n // 2)
        square = self.node("mul", half, half)
        return square if n % 2 == 0 else self.node("mul", square, a)

    # -- from sympy ------------------------------------------------------------------------------

    def add_expressions(self, expressions) -> list[int]:
        """Nodes of sympy expressions; powers -1/2, -3/2, ... of one base share one reciprocal root."""
        expressions = [tidy(sp.sympify(e, strict=True), self._states) for e in expressions]
        for e in expressions:
            for p in e.atoms(sp.Pow):
                if p.exp.is_Rational and p.exp.q == 2 and p.exp < 0:
                    self._root_bases.add(p.base)
        return [self._visit(e) for e in expressions]

    def _visit(self, e) -> int:
        found = self._memo.get(e)
        if found is None:
            found = self._memo[e] = self._build(e)
        return found

    def _term(self, e) -> tuple[float, int]:
        coefficient, rest = e.as_coeff_Mul()
        return float(coefficient), self._visit(rest)

    def _build(self, e) -> int:
        if e in self._leaf:
            return self.node(*self._leaf[e])
        if e.is_Number or e.is_NumberSymbol:
            return self.num(e)
        if e.is_Add:
            return self.add([self._term(a) for a in e.args])
        if e.is_Mul:
            c, rest = e.as_coeff_Mul()
            if c != 1:
                return self.add([(float(c), self._visit(rest))])
            top = [a for a in e.args if not self._is_reciprocal(a)]
            bottom = [1 / a for a in e.args if self._is_reciprocal(a)]
            below = [self._visit(a) for a in bottom]
            # Reciprocals of what is known outside the loop leave it.
            low = [self.node("div", self.num(1.0), b) for b in below if self.level[b] < 2]
            above = self.mul([self._visit(a) for a in top] + low)
            below = [b for b in below if self.level[b] == 2]
            return self.node("div", above, self.mul(below)) if below else above
        if e.is_Pow:
            return self._power(e.base, e.exp)
        if isinstance(e, Select):
            return self._select(*e.args)
        if isinstance(e, sp.Piecewise):
            return self._piecewise(e.args)
        if isinstance(e, (sp.Max, sp.Min)):
            result = self._visit(e.args[0])
            for other in e.args[1:]:
                b = self._visit(other)
                result = self.node(
                    "ite", self.node("cmp", ">" if isinstance(e, sp.Max) else "<", result, b), result, b
                )
            return result
        if isinstance(e, (sp.sign, sp.Heaviside)):
            a, zero = self._visit(e.args[0]), self.num(0.0)
            low = self.num(-1.0 if isinstance(e, sp.sign) else 0.0)
            at_zero = self.num(0.0 if isinstance(e, sp.sign) else 0.5)
            below = self.node("ite", self.node("cmp", "<", a, zero), low, at_zero)
            return self.node("ite", self.node("cmp", ">", a, zero), self.num(1.0), below)
        if isinstance(e, sp.atan2):
            return self.node("atan2", self._visit(e.args[0]), self._visit(e.args[1]))
        if e.func in UNARY:
            return self.node("fun", UNARY[e.func], self._visit(e.args[0]))
        if e.is_Symbol:
            raise UnsupportedExpression(f"`{e}` is neither a state, a parameter nor the time of this model.")
        raise UnsupportedExpression(f"`{e.func.__name__}` has no compiled form on the smoothed path: {e}.")

    def _is_reciprocal(self, a) -> bool:
        # x**(-1/2) multiplies instead: its reciprocal root is shared.
        return a.is_Pow and a.exp.is_Integer and a.exp < 0 and a.base not in self._root_bases

    def _power(self, base, exponent) -> int:
        a = self._visit(base)
        if exponent.is_Integer:
            n = int(exponent)
            if n < 0 and base in self._root_bases:
                return self._integer_power(self.node("rsqrt", a), -2 * n)
            p = self._integer_power(a, abs(n)) if n else self.num(1.0)
            return p if n >= 0 else self.div(self.num(1.0), p)
        if exponent.is_Rational and exponent.q == 2:
            n = int(exponent.p)
            if n < 0:
                return self._integer_power(self.node("rsqrt", a), -n)
            root = self.node("sqrt", a)
            return root if n == 1 else self.mul([root, self._integer_power(a, n // 2)])
        if exponent.is_number:
            return self.node("pow", a, float(exponent))
        product = self.mul([self._visit(exponent), self.node("fun", "log", a)])
        return self.node("fun", "exp", product)

    def _select(self, lam, a, b) -> int:
        # Exactly +-1 far outside the layer: there the inactive branch may not exist.
        s, x, y = self._visit(lam), self._visit(a), self._visit(b)
        mean = self.add([(0.5, x), (0.5, y)])
        affine = self.add([(1.0, mean), (0.5, self.mul([s, self.add([(1.0, x), (-1.0, y)])]))])
        inner = self.node("ite", self.node("cmp", "<=", s, self.num(-1.0)), y, affine)
        return self.node("ite", self.node("cmp", ">=", s, self.num(1.0)), x, inner)

    def _piecewise(self, branches) -> int:
        expression, condition = branches[0]
        value = self._visit(expression)
        if condition == sp.true:
            return value
        rest = self._piecewise(branches[1:]) if len(branches) > 1 else self.num(math.nan)
        return self.node("ite", self.condition(condition), value, rest)

    def condition(self, c) -> int:
        """Node of a boolean expression."""
        if c in (sp.true, sp.false):
            return self.node("cmp", "==", self.num(0.0), self.num(0.0 if c == sp.true else 1.0))
        if isinstance(c, (sp.And, sp.Or)):
            name = "and" if isinstance(c, sp.And) else "or"
            result = self.condition(c.args[0])
            for other in c.args[1:]:
                result = self.node(name, result, self.condition(other))
            return result
        if isinstance(c, sp.Not):
            return self.node("not", self.condition(c.args[0]))
        if c.func in _RELATION:
            return self.node("cmp", _RELATION[c.func], self._visit(c.lhs), self._visit(c.rhs))
        raise UnsupportedExpression(f"The condition `{c}` has no compiled form.")

    def smooth(self, roots) -> bool:
        """Whether no branch, modulus or floor of a state or of time stands in the roots."""
        for a in self.reachable(roots):
            op = self.ops[a]
            if self.level[a] > 0 and (op[0] == "ite" or (op[0] == "fun" and op[1] in ("abs", "floor", "ceil"))):
                return False
        return True

    # -- what a text needs -----------------------------------------------------------------------

    def reachable(self, roots) -> list[int]:
        """Every node that the roots need, operands first."""
        needed, stack = set(), list(roots)
        while stack:
            a = stack.pop()
            if a not in needed:
                needed.add(a)
                stack += operands(self.ops[a])
        return sorted(needed)


def operands(op) -> tuple[int, ...]:
    """Indices of the operands of one operation."""
    kind = op[0]
    if kind in ("num", "par", "time", "state"):
        return ()
    if kind == "add":
        return tuple(a for _, a in op[1])
    if kind in ("fun", "cmp"):
        return op[2:]
    return op[1:2] if kind == "pow" else op[1:]


def tidy(e, states):
    """q/(q + r) -> 1 - r/(q + r) throughout, where r has no state: 1 - lam**2 of the algebraic sigmoid then
    cancels.

    In numbers 1 - v**2/(eps**2 + v**2) loses every digit of the hidden term outside the layer.
    """

    def rewrite(m):
        for factor in m.args:
            if factor.is_Pow and factor.exp == -1 and factor.base.is_Add:
                for q in factor.base.args:
                    rest = factor.base - q
                    if states.isdisjoint(rest.free_symbols) and not states.isdisjoint(q.free_symbols):
                        ratio = m / factor / q
                        if ratio.is_Number:
                            return ratio * (1 - rest * factor)
        return m

    return e.replace(lambda m: m.is_Mul, rewrite) if e.has(sp.Pow) else e
