"""The graph of a smoothed model, graded by what its nodes depend on.

    grade 0: parameters only    1: time as well    2: states

The grading is what makes the Newton iteration cheap: products and sums are split by grade, so that everything
of time alone leaves the iteration, and everything of the parameters alone leaves the loop over stages.
Chain: Model -> this graph, on that of graph/dag.py -> text (text.py, functions.py, taylor.py).
"""

from __future__ import annotations

import sympy as sp

from ...definition.model import Model, Select
from ..graph.dag import Graph
from ..graph.nodes import STATE

# Functions with a kink or a jump.
_KINKED = {"fabs", "sign", "heaviside", "floor", "ceil", "max", "min", "mod"}


class GradedGraph(Graph):
    """The nodes of a model without multipliers; pow nodes with exponent -1/2 are reciprocal roots."""

    sums_apart = True  # unknowns of implicit steps, so that their Jacobian stays sparse

    def __init__(self, model: Model):
        super().__init__(model)
        self.first_memory = len(self.model.states)  # memories stand in the lanes as states do
        self._under_roots: set[sp.Expr] = set()

    def grade(self, node: int) -> int:
        depends = self.depends[node]
        return 2 if depends & STATE else 1 if depends else 0

    def expressions(self, expressions) -> list[int]:
        """Nodes of sympy expressions; powers -1/2, -3/2, ... of one base share one reciprocal root."""
        states = frozenset(self.model.states) | self._sums.keys()
        states |= self.template.beside if self.template else frozenset()
        expressions = [_without_cancellation(sp.sympify(e, strict=True), states) for e in expressions]
        for e in expressions:
            for p in e.atoms(sp.Pow):
                if p.exp.is_Rational and p.exp.q == 2 and p.exp < 0:
                    self._under_roots.add(p.base)
        return super().expressions(expressions)

    def smooth(self, roots) -> bool:
        """Whether nothing of the state or of time has a kink or a jump."""
        moving = (self.nodes[a] for a in self.reach(roots, through=True) if self.grade(a) > 0)
        return not any(op == "ite" or data in _KINKED for op, _, data in moving)

    # ---- sums and products, split by grade ----

    def opens(self, a):
        return self.grade(a) == 2 or len(self.nodes[a].args) == 1

    def sum(self, terms):
        terms, low = list(terms), []
        for grade in (0, 1):
            low += [term for term in terms if self.grade(term[1]) == grade]
            low = [(1.0, super().sum(low))] if low else []
        return super().sum([*low, *(term for term in terms if self.grade(term[1]) == 2)])

    def div(self, a, b):
        if self.grade(b) < 2 and a != self.one and self.value(b) is None:  # the reciprocal leaves the loop
            return self.mul(a, super().div(self.one, b))
        return super().div(a, b)

    def _product(self, e):
        above, below = [], []
        for factor in e.args:
            reciprocal = factor.is_Pow and factor.exp.is_Integer and factor.exp < 0
            if reciprocal and factor.base not in self._under_roots:
                below.append(self.expression(1 / factor))
            else:
                above.append(self.expression(factor))
        above += [self.div(self.one, b) for b in below if self.grade(b) < 2]
        below = [b for b in below if self.grade(b) == 2]
        return self.div(self._chain(above), self._chain(below)) if below else self._chain(above)

    def _convert(self, e):
        return self._power(e.base, e.exp) if e.is_Pow else super()._convert(e)

    def _power(self, base, exponent):
        a = self.expression(base)
        if not exponent.is_number:
            return self.fun("exp", self.mul(self.expression(exponent), self.fun("log", a)))
        halves = 2 * exponent
        if halves.is_Integer and halves < 0 and (exponent.q == 2 or base in self._under_roots):
            return self._integer_power(self.make("pow", (a, self.num(-0.5))), -int(halves))
        if halves.is_Integer and exponent.q == 2:
            return self.mul(self.fun("sqrt", a), self._integer_power(a, int(halves) // 2))
        return self.power(a, self.num(float(exponent)))

    def _selection(self, e: Select):
        # Exactly +-1 far outside the layer: there the inactive branch may not exist.
        lam, a, b = (self.expression(part) for part in e.args)
        minus = self.num(-1.0)
        inside = self.ite(self.make("rel", (lam, minus), "<="), b, self.expression(e.affine()))
        return self.ite(self.make("rel", (lam, self.one), ">="), a, inside)


def _without_cancellation(e, states):
    """q/(q + r) -> 1 - r/(q + r) throughout, where r has no state: 1 - lam**2 of the algebraic sigmoid then cancels.

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
