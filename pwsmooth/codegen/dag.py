"""Expression graphs: every subexpression of a model once, as a node with integer arguments.

sympy's trees become one hash-consed graph, so that sharing, derivatives, degrees in time and scopes are found
by walking integers. Nodes are numbered so that arguments come first: ascending order is an order of evaluation.

Chain: Model -> Graph (this file) -> scalar code (scalar.py, fields.py) and Taylor recurrences (jets.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import sympy as sp
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import ITE, BooleanFalse, BooleanTrue

from ..model import Model, Select

# Unary functions, by the name under which `math` has them.
UNARY = {
    sp.exp: "exp",
    sp.log: "log",
    sp.sin: "sin",
    sp.cos: "cos",
    sp.tan: "tan",
    sp.sinh: "sinh",
    sp.cosh: "cosh",
    sp.tanh: "tanh",
    sp.asin: "asin",
    sp.acos: "acos",
    sp.atan: "atan",
    sp.asinh: "asinh",
    sp.acosh: "acosh",
    sp.atanh: "atanh",
    sp.erf: "erf",
    sp.erfc: "erfc",
    sp.Abs: "fabs",
    sp.sign: "sign",
    sp.Heaviside: "heaviside",
    sp.floor: "floor",
    sp.ceiling: "ceil",
}
BINARY = {sp.Max: "max", sp.Min: "min", sp.Mod: "mod", sp.atan2: "atan2"}
RELATIONS = {sp.Lt: "<", sp.Le: "<=", sp.Gt: ">", sp.Ge: ">=", sp.Eq: "==", sp.Ne: "!="}
RECIPROCAL = {
    sp.cot: sp.tan,
    sp.sec: sp.cos,
    sp.csc: sp.sin,
    sp.coth: sp.tanh,
    sp.sech: sp.cosh,
    sp.csch: sp.sinh,
}

# A longer sum stays one node inside another sum: it may be shared by many.
SHARED_SUM = 3

# What a node depends on: memories and parameters are constants of a smooth phase and set no bit.
TIME, STATE, MULT = 1, 2, 4


class Node(NamedTuple):
    """`op` with arguments `args` (nodes) and `data` (coefficients, an index, a name)."""

    op: str
    args: tuple[int, ...]
    data: object


class Graph:
    """Hash-consed graph of a model's expressions.

    Operations: num (value), var (kind, index), sum (coefficients; the constant is a num node), mul, div, pow,
    fun (name), fun2 (name), sel (multiplier; arguments: branch at +1, branch at -1, affine form),
    ite (condition, then, else), and the conditions rel (relation), and, or, not, true, false.

    Of a model with loops the graph is that of its template, and `level` holds the family that a node belongs to, or
    None. There a var of a neighbour is (kind, index, offset), the number of an element is the var ("i", family),
    total (family) sums its argument over the elements, and inside (family, offset) asks whether there is a neighbour.
    """

    def __init__(self, model: Model):
        self.template = template = model.loops.template if model.loops else None
        self.model = model = template.model if template else model
        self.nodes: list[Node] = []
        self.depends: list[int] = []
        self.level: list[int | None] = []
        self.families: dict[str, tuple[int | None, ...]] = {}
        if template:
            kinds = {"x": "states", "p": "parameters", "mult": "multipliers"}
            self.families = {kind: template.families(name) for kind, name in kinds.items()}
        self._sums = {s: (family, e) for s, family, e in template.sums} if template else {}
        self._place = template.place if template else {}
        self._number: dict[Node, int] = {}
        self._memo: dict[sp.Basic, int] = {}
        self._derivative: dict[tuple[int, int], int] = {}
        self._variable: dict[sp.Symbol, tuple[str, int]] = {}
        multipliers = [m.symbol for m in model.multipliers]
        for kind, symbols in (
            ("p", model.parameters),
            ("x", model.states),
            ("mult", multipliers),
            ("z", [z.symbol for z in model.layer_states]),
        ):
            self._variable |= {s: (kind, i) for i, s in enumerate(symbols)}
        self._variable[model.time] = ("t", 0)
        self.first_memory = len(model.states) - model.n_memory
        self.zero, self.one = self.num(0.0), self.num(1.0)

    # ---- nodes ----

    def _make(self, op: str, args: tuple[int, ...] = (), data=None) -> int:
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
        return self._make("num", (), float(value))

    def var(self, kind: str, index: int) -> int:
        return self._make("var", (), (kind, index))

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
            elif node.op == "sum" and len(node.args) <= SHARED_SUM:
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
        return self._make("sum", args, tuple(merged[a] for a in args))

    def add(self, a: int, b: int) -> int:
        return self.sum(((1.0, a), (1.0, b)))

    def scale(self, c: float, a: int) -> int:
        return self.sum(((c, a),))

    def _split(self, a: int) -> tuple[float, int]:
        node = self.nodes[a]
        if node.op == "num":
            return node.data, self.one
        if node.op == "sum" and len(node.args) == 1:
            return node.data[0], node.args[0]
        return 1.0, a

    def mul(self, a: int, b: int) -> int:
        (ca, a), (cb, b) = self._split(a), self._split(b)
        c = ca * cb
        if c == 0.0:
            return self.zero
        if self.one in (a, b):
            return self.scale(c, b if a == self.one else a)
        product = self._make("mul", (min(a, b), max(a, b)))
        return product if c == 1.0 else self.scale(c, product)

    def div(self, a: int, b: int) -> int:
        (ca, a), (cb, b) = self._split(a), self._split(b)
        if ca == 0.0:
            return self.zero
        if b == self.one:
            return self.scale(ca / cb, a)
        if a == b:
            return self.num(ca / cb)
        quotient = self._make("div", (a, b))
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
        return self._make("pow", (a, b))

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
        return self._make("fun", (a,), name)

    def select(self, j: int, a: int, b: int) -> int:
        if a == b:
            return a
        lam = self.var("mult", j)
        affine = self.add(self.sum(((0.5, a), (0.5, b))), self.mul(lam, self.sum(((0.5, a), (-0.5, b)))))
        return self._make("sel", (a, b, affine), j)

    def ite(self, condition: int, a: int, b: int) -> int:
        op = self.nodes[condition].op
        if a == b or op == "true":
            return a
        return b if op == "false" else self._make("ite", (condition, a, b))

    # ---- from sympy ----

    def expression(self, expr) -> int:
        """The node of a sympy expression or condition."""
        expr = sp.sympify(expr)
        found = self._memo.get(expr)
        if found is None:
            found = self._memo[expr] = self._convert(expr)
        return found

    def _member(self, e: sp.Symbol) -> int:
        """The node of a sum, of the number of an element or of a neighbour."""
        if e in self._sums:
            family, inner = self._sums[e]
            return self._make("total", (self.expression(inner),), family)
        place = self._place[e]
        if place.base is None:
            return self.var("i", place.family)
        node = self._make("var", (), (*self._variable[place.base], place.offset))
        if self.template.periodic[place.family] or place.outside == place.base:
            return node  # beyond an end of the chain its index is that of the element itself
        inside = self._make("inside", (), (place.family, place.offset))
        return self.ite(inside, node, self.expression(place.outside))

    def _convert(self, e: sp.Basic) -> int:
        if e.is_Symbol and e not in self._variable and (e in self._sums or e in self._place):
            return self._member(e)
        if e.is_Symbol:
            if e not in self._variable:
                raise ValueError(f"the model uses {e}, which is no state, parameter or multiplier of it")
            return self.var(*self._variable[e])
        if e.is_Number or e.is_NumberSymbol:
            return self.num(float(e))
        if e.is_Add:
            return self.sum([(1.0, self.expression(a)) for a in e.args])
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            if e.exp.is_number and e.exp.is_negative:
                return self.div(self.one, self.expression(e.base ** (-e.exp)))
            return self.power(self.expression(e.base), self.expression(e.exp))
        if isinstance(e, Select):
            return self._selection(e)
        if isinstance(e, (sp.Piecewise, ITE)):
            return self._piecewise(e)
        kind = type(e)
        if kind in UNARY:
            return self.fun(UNARY[kind], self.expression(e.args[0]))
        if kind in BINARY:
            node = self.expression(e.args[0])
            for a in e.args[1:]:
                node = self._make("fun2", (node, self.expression(a)), BINARY[kind])
            return node
        if kind in RECIPROCAL:
            return self.div(self.one, self.expression(RECIPROCAL[kind](e.args[0])))
        if isinstance(e, (BooleanTrue, BooleanFalse)):
            return self._make("true" if e else "false")
        if isinstance(e, Relational):
            return self._make("rel", (self.expression(e.lhs), self.expression(e.rhs)), RELATIONS[kind])
        if isinstance(e, (sp.And, sp.Or)):
            parts = tuple(self.expression(a) for a in e.args)
            return self._make("and" if isinstance(e, sp.And) else "or", parts)
        if isinstance(e, sp.Not):
            return self._make("not", (self.expression(e.args[0]),))
        if e.is_number:
            return self.num(float(e))
        raise TypeError(f"no code is known for `{kind.__name__}` in {e}; write it with elementary functions")

    def _product(self, e: sp.Mul) -> int:
        """Constants first, then multipliers, time, states: what is constant in a step is one node."""
        above, below = [], []
        for factor in e.args:
            if factor.is_Pow and factor.exp.is_number and factor.exp.is_negative:
                below.append(self.expression(factor.base ** (-factor.exp)))
            else:
                above.append(self.expression(factor))

        def chain(factors):
            node = self.one
            for f in sorted(factors, key=lambda f: (self._rank(f), f)):
                node = self.mul(node, f)
            return node

        fixed = [f for f in above if not self.depends[f] and self.value(f) is None]
        if fixed and below:
            fixed_below = [f for f in below if not self.depends[f]]
            fixed_part = self.div(chain(fixed), chain(fixed_below))
            moving = self.div(
                chain([f for f in above if f not in fixed]), chain([f for f in below if f not in fixed_below])
            )
            return self.mul(fixed_part, moving)
        return self.div(chain(above), chain(below)) if below else chain(above)

    def _rank(self, node: int) -> int:
        depends = self.depends[node]
        return 3 if depends & STATE else 2 if depends & TIME else 1 if depends else 0

    def _selection(self, e: Select) -> int:
        lam, a, b = e.args
        if -lam in self._variable:
            lam, a, b = -lam, b, a
        kind, j = self._variable.get(lam, ("", 0))
        if kind != "mult":
            return self.expression(e.affine())
        return self.select(j, self.expression(a), self.expression(b))

    def _piecewise(self, e) -> int:
        if isinstance(e, ITE):
            return self.ite(*(self.expression(a) for a in e.args))
        node = self.num(math.nan)  # outside every condition, as in sympy
        for pair in reversed(e.args):
            value, condition = pair.args if isinstance(pair, ExprCondPair) else pair
            node = self.ite(self.expression(condition), self.expression(value), node)
        return node

    # ---- derivatives ----

    def derivative(self, node: int, variable: int) -> int:
        """d node / d variable; branches are differentiated inside their selection."""
        if node == variable:
            return self.one
        if not self.nodes[node].args:
            return self.zero
        if self.nodes[node].op == "total":
            # By a number of element i: of the summand of that element alone.
            slope = self.derivative(self.nodes[node].args[0], variable)
            own = self.level[variable] is not None or slope == self.zero
            return slope if own else self._make("total", (slope,), self.nodes[node].data)
        key = (node, variable)
        found = self._derivative.get(key)
        if found is None:
            found = self._derivative[key] = self._differentiate(node, variable)
        return found

    def _differentiate(self, node: int, variable: int) -> int:
        op, args, data = self.nodes[node]
        if op == "sum":
            return self.sum([(c, self.derivative(a, variable)) for c, a in zip(data, args, strict=True)])
        if op == "ite":
            condition, a, b = args
            return self.ite(condition, self.derivative(a, variable), self.derivative(b, variable))
        if op == "sel":
            a, b, affine = args
            da, db = self.derivative(a, variable), self.derivative(b, variable)
            daffine = self.derivative(affine, variable)
            # By its own multiplier the selection has the slope of the affine form, also at its ends.
            if self.nodes[variable].data == ("mult", data):
                return daffine
            return da if da == db == daffine else self._make("sel", (da, db, daffine), data)
        slopes = [self.derivative(a, variable) for a in args]
        if all(s == self.zero for s in slopes):
            return self.zero
        if op == "mul":
            return self.add(self.mul(slopes[0], args[1]), self.mul(args[0], slopes[1]))
        if op == "div":
            if slopes[1] == self.zero:
                return self.div(slopes[0], args[1])
            return self.div(self.sum(((1.0, slopes[0]), (-1.0, self.mul(node, slopes[1])))), args[1])
        if op == "pow":
            return self._power_slope(node, slopes)
        if op == "fun":
            return self.mul(self.function_slope(node), slopes[0])
        if op == "fun2" and data in ("max", "min"):
            condition = self._make("rel", args, ">" if data == "max" else "<")
            return self.ite(condition, slopes[0], slopes[1])
        if op == "fun2" and data == "mod":
            return slopes[0]
        if op == "fun2" and data == "atan2":
            y, x = args
            norm = self.add(self.mul(x, x), self.mul(y, y))
            return self.div(self.sum(((1.0, self.mul(x, slopes[0])), (-1.0, self.mul(y, slopes[1])))), norm)
        raise TypeError(f"no derivative is known for `{op} {data}`")

    def _power_slope(self, node: int, slopes) -> int:
        a, b = self.nodes[node].args
        lower = self.power(a, self.sum(((1.0, b), (-1.0, self.one))))
        slope = self.mul(self.mul(b, lower), slopes[0])
        if slopes[1] != self.zero:
            slope = self.add(slope, self.mul(self.mul(node, self.fun("log", a)), slopes[1]))
        return slope

    def function_slope(self, node: int) -> int:
        """q in w' = q u' for w = f(u); written in w where that is cheaper."""
        u = self.nodes[node].args[0]
        name = self.nodes[node].data
        one = self.one

        def polynomial(c0, c2, v):  # c0 + c2*v**2
            return self.sum(((c0, one), (c2, self.mul(v, v))))

        if name == "exp":
            return node
        if name == "sqrt":
            return self.div(self.num(0.5), node)
        if name in ("sin", "sinh", "cosh"):
            return self.fun({"sin": "cos", "sinh": "cosh", "cosh": "sinh"}[name], u)
        if name == "cos":
            return self.scale(-1.0, self.fun("sin", u))
        if name in ("tan", "tanh"):
            return polynomial(1.0, 1.0 if name == "tan" else -1.0, node)
        if name in ("erf", "erfc"):
            factor = (2 if name == "erf" else -2) / math.sqrt(math.pi)
            return self.scale(factor, self.fun("exp", polynomial(0.0, -1.0, u)))
        if name == "fabs":
            return self.fun("sign", u)
        if name in ("sign", "heaviside", "floor", "ceil"):
            return self.zero
        below = {"log": u, "atan": polynomial(1.0, 1.0, u), "atanh": polynomial(1.0, -1.0, u)}.get(name)
        if below is None:
            signs = {"asin": (1.0, -1.0), "acos": (1.0, -1.0), "asinh": (1.0, 1.0), "acosh": (-1.0, 1.0)}[name]
            below = self.fun("sqrt", polynomial(*signs, u))
        return self.div(self.num(-1.0 if name == "acos" else 1.0), below)

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

    def reach(self, roots, lazy: bool = False, through: bool = False) -> list[int]:
        """Nodes needed for `roots`, in order of evaluation; with `lazy`, without entering branches.

        Sums over families are entered only with `through`.
        """
        seen, stack = set(), list(roots)
        while stack:
            a = stack.pop()
            if a in seen:
                continue
            seen.add(a)
            op, args, _ = self.nodes[a]
            if lazy and op == "sel" or op == "total" and not through:
                continue
            stack.extend(args[:1] if lazy and op == "ite" else args)
        return sorted(seen)
