"""Fewer products of series: the same values, from what is multiplied once."""

import random

import pytest
import sympy as sp
from test_codegen import evaluate

from pwsmooth.codegen.graph.dag import Graph
from pwsmooth.codegen.taylor.recurrences import CONSTANT, Degrees
from pwsmooth.codegen.taylor.simplify import Simplifier, simplify
from pwsmooth.definition.model import Model, Multiplier, Select

t, x, y, z, w, a, b = sp.symbols("t x y z w a b", real=True)
lam = sp.Symbol("lam", real=True)
STATES = (x, y, z, w)


def simplified(expressions, general=False):
    """Graph, roots, simplified roots and degrees of expressions in states whose rates are of no low degree."""
    switch = Multiplier(lam, "switch", -lam, x)
    graph = Graph(Model(t, STATES, (a, b), tuple(s**2 + sp.sin(s) for s in STATES), (switch,)))
    rates = [graph.expression(e) for e in graph.model.rhs]
    roots = [graph.expression(e) for e in expressions]
    degrees = Degrees(graph, rates, general)
    return graph, roots, simplify(graph, roots, degrees), degrees


def products(graph, roots, degrees):
    """How many products and quotients of two series the roots need."""

    def convolves(node):
        op, args, _ = graph.nodes[node]
        if op == "div":
            return degrees.of(args[1]) != CONSTANT
        return op == "mul" and all(degrees.of(q) != CONSTANT for q in args)

    return sum(convolves(node) for node in graph.reach(roots))


def values(point):
    return {"x": [point[s] for s in STATES], "t": 0.3, "p": [point[a], point[b]], "mult": [point[lam]]}


@pytest.mark.parametrize(
    ("expressions", "before", "after"),
    [
        # One division for sums over one denominator, one product for a common factor.
        ([x / w + y / w + z], 2, 1),
        ([x * y + x * z + a * x], 2, 1),
        # What products share is multiplied once, also below the line; -x - y and x + y are one.
        ([x * y * z / w, a * x * y / w, y * x * w], 5, 4),
        ([z / (-x - y), w / (x + y), z * (x + y)], 3, 3),
        ([sp.sin(x + y) / (x + y), z + sp.cos(-x - y) / (-x - y)], 2, 2),
        # u is sqrt(u)^2 where that has something in common: y/sqrt(u) serves all three.
        ([y**2 / sp.sqrt(1 + x**2), y**2 * z / (1 + x**2), y / sp.sqrt(1 + x**2)], 6, 5),
    ],
)
def test_products_of_series_are_shared(expressions, before, after):
    graph, roots, new, degrees = simplified(expressions)
    assert products(graph, roots, degrees) == before
    assert products(graph, new, degrees) == after


def test_powers_of_a_quotient_that_is_there_are_one_power():
    u, v = 1 + x**2, 2 + y**2
    graph, roots, new, _ = simplified([sp.sin(u / v), u ** sp.Rational(3, 2) * z / v ** sp.Rational(3, 2)])
    powers = [sum(graph.nodes[node].op == "pow" for node in graph.reach(r)) for r in (roots, new)]
    assert powers == [2, 1]


def random_sum(rng, letters):
    """A sum of products and quotients of few letters: much is shared."""
    terms = []
    for _ in range(rng.randrange(1, 5)):
        term = sp.Integer(rng.choice((-2, -1, 1, 3)))
        for _ in range(rng.randrange(1, 5)):
            term *= rng.choice(letters) ** rng.choice((1, 1, 2, -1, sp.Rational(1, 2), sp.Rational(-3, 2)))
        terms.append(term)
    return sp.Add(*terms)


@pytest.mark.parametrize("general", [False, True])
def test_values_stay_and_products_never_grow(general):
    rng = random.Random(3)
    saved = 0
    for _ in range(80):
        letters = [x, y, a, 1 + x**2, z - y, 2 + sp.sin(w), 1 - x**2, lam + 3]
        letters += [random_sum(rng, letters), Select(lam, x * y + x * z, random_sum(rng, letters))]
        expressions = [random_sum(rng, letters) for _ in range(4)]
        graph, roots, new, degrees = simplified(expressions, general)
        point = {s: rng.uniform(0.3, 0.7) for s in (*STATES, a, b)} | {lam: rng.choice((1.0, -1.0))}
        point[z] += 1.0  # z - y > 0
        try:
            old = evaluate(graph, roots, values(point))
        except (ValueError, ZeroDivisionError):
            continue
        if any(isinstance(v, complex) for v in old):
            continue
        # Sums cancel: to the size of the terms, of which there are few.
        assert evaluate(graph, new, values(point)) == pytest.approx(old, rel=1e-9, abs=1e-11)
        before, after = (Simplifier(graph, degrees).cost(r) for r in (roots, new))
        assert after <= before
        saved += before - after
    assert saved > 30


def test_a_branch_that_is_not_taken_is_not_evaluated_through_what_it_shares():
    """x^1.5 does not exist in free flight, x < 0, nor does y/x on the wall."""
    force = Select(lam, x ** sp.Rational(3, 2) * y / x, 0)
    graph, _, new, _ = simplified([force * z + y, force * w, Select(lam, sp.sqrt(x) * y * z, y * z)])
    point = {x: -1.0, y: 2.0, z: 3.0, w: 4.0, a: 1.0, b: 1.0, lam: -1.0}
    assert evaluate(graph, new, values(point)) == [2.0, 0.0, 6.0]
