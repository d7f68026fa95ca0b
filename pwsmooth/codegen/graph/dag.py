"""A model's expressions as a graph: sympy's trees become nodes.

Chain: Model -> **Graph** (this file), on the nodes of nodes.py -> scalar code (scalar.py, fields.py), jets (jets.py).
"""

from __future__ import annotations

import math

import sympy as sp
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import BooleanFalse, BooleanFunction, BooleanTrue

from ...definition.model import Above, Entry, Held, Model, Select, Whole, tables_of
from .nodes import STATE, TIME, Nodes

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


class Graph(Nodes):
    """The nodes of one model; `expression` gives that of any sympy expression in its symbols."""

    def __init__(self, model: Model, by_element: bool = True):
        self.template = template = model.families.template if model.families and by_element else None
        self.model = model = template.model if template else model
        families: dict[str, tuple[int | None, ...]] = {}
        if template:
            kinds = {"x": "states", "p": "parameters", "mult": "multipliers"}
            families = {kind: template.families(name) for kind, name in kinds.items()}
        super().__init__(len(model.states) - model.n_memory, families)
        self._sums = {s: (family, e) for s, family, e in template.sums} if template else {}
        self._place = template.place if template else {}
        self._memo: dict[sp.Basic, int] = {}
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

    def expression(self, expr) -> int:
        """The node of a sympy expression or condition."""
        expr = sp.sympify(expr, strict=True)
        found = self._memo.get(expr)
        if found is None:
            found = self._memo[expr] = self._convert(expr)
        return found

    def expressions(self, expressions) -> list[int]:
        """Nodes of expressions."""
        return [self.expression(e) for e in expressions]

    def _member(self, e: sp.Symbol) -> int:
        """The node of a sum, of the number of an element or of a neighbour."""
        if e in self._sums:
            family, inner = self._sums[e]
            return self.make("total", tuple(self.expressions([inner])), family)
        place = self._place[e]
        if place.base is None and place.offset:
            return self.ite(self.make("inside", (), (place.family, place.offset)), self.zero, self.one)
        if place.base is None:
            return self.var("i", place.family)
        node = self.make("var", (), (*self._variable[place.base], place.offset))
        if self.template.periodic[place.family] or place.outside == place.base:
            return node  # beyond an end of the chain its index is that of the element itself
        inside = self.make("inside", (), (place.family, place.offset))
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
        if isinstance(e, Held):
            _, apart, held = map(self.expression, e.args)
            return self.make("sel", (apart, apart, held), self._variable[e.args[0]][1])
        if isinstance(e, sp.Piecewise):
            return self._piecewise(e)
        if isinstance(e, Above):
            return self.make("pow", tuple(map(self.expression, e.args)), "above")
        if isinstance(e, Entry):
            table, row, column = e.args
            place = self.sum(((table.rows.shape[1], self.expression(row)), (float(column), self.one)))
            return self.make("entry", (place,), tables_of(self.model).index(table))
        if isinstance(e, Whole):
            return self.fun("floor", self.sum(((1.0, self.expression(e.args[0])), (0.5, self.one))))
        kind = type(e)
        if kind in UNARY:
            return self.fun(UNARY[kind], self.expression(e.args[0]))
        if kind in BINARY:
            node = self.expression(e.args[0])
            for a in e.args[1:]:
                node = self.make("fun2", (node, self.expression(a)), BINARY[kind])
            return node
        if kind in RECIPROCAL:
            return self.div(self.one, self.expression(RECIPROCAL[kind](e.args[0])))
        if isinstance(e, (BooleanTrue, BooleanFalse)):
            return self.make("true" if e else "false")
        if isinstance(e, Relational):
            return self.make("rel", (self.expression(e.lhs), self.expression(e.rhs)), RELATIONS[kind])
        if isinstance(e, (sp.And, sp.Or)):
            parts = tuple(self.expression(a) for a in e.args)
            return self.make("and" if isinstance(e, sp.And) else "or", parts)
        if isinstance(e, sp.Not):
            return self.make("not", (self.expression(e.args[0]),))
        if isinstance(e, BooleanFunction):  # ITE, Xor, Implies, ...
            return self.expression(sp.to_nnf(e, simplify=False))
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

        fixed = [f for f in above if not self.depends[f] and self.value(f) is None]
        if fixed and below:
            fixed_below = [f for f in below if not self.depends[f]]
            fixed_part = self.div(self._chain(fixed), self._chain(fixed_below))
            moving = self.div(
                self._chain([f for f in above if f not in fixed]),
                self._chain([f for f in below if f not in fixed_below]),
            )
            return self.mul(fixed_part, moving)
        return self.div(self._chain(above), self._chain(below)) if below else self._chain(above)

    def _chain(self, factors) -> int:
        node = self.one
        for f in sorted(factors, key=lambda f: (self._rank(f), f)):
            node = self.mul(node, f)
        return node

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
        # Where an element has no neighbour nothing is selected: there a surface of a family is 1 more than its powers'.
        beyond = {s: 0 for s, place in self._place.items() if place.base is None and place.offset}
        e, surface = Select(lam, a, b), self.model.multipliers[j].surface
        if surface is None:  # as on curves of bifurcations, which solve for it
            return self.select(j, self.expression(a), self.expression(b), None)
        surface = surface.xreplace(beyond)
        a, b = (self.expression(branch) for branch in e.clamped(surface))
        return self.select(j, a, b, self.expression(e.affine(surface)) if e.on(surface) != e.args[1:] else None)

    def _piecewise(self, e) -> int:
        node = self.num(math.nan)  # outside every condition, as in sympy
        for pair in reversed(e.args):
            value, condition = pair.args if isinstance(pair, ExprCondPair) else pair
            node = self.ite(self.expression(condition), self.expression(value), node)
        return node
