"""Slopes of nodes, as nodes: derivatives by a variable, and q of w' = q u' for a function w of u.

Chain: Graph (dag.py) -> **slopes** -> gradients and Jacobians (fields.py), sliding (jets.py), recurrences.py.
"""

from __future__ import annotations

import math

from .nodes import Nodes


def derivative(graph: Nodes, node: int, variable: int) -> int:
    """d node / d variable; branches are differentiated inside their selection."""
    if node == variable:
        return graph.one
    if not graph.nodes[node].args:
        return graph.zero
    if graph.nodes[node].op == "total" and graph.sums_apart:
        return graph.zero
    if graph.nodes[node].op == "total":
        # By a number of element i: of the summand of that element alone.
        slope = derivative(graph, graph.nodes[node].args[0], variable)
        own = graph.level[variable] is not None or slope == graph.zero
        return slope if own else graph.make("total", (slope,), graph.nodes[node].data)
    key = (node, variable)
    found = graph._derivative.get(key)
    if found is None:
        found = graph._derivative[key] = _differentiate(graph, node, variable)
    return found


def _differentiate(graph: Nodes, node: int, variable: int) -> int:
    op, args, data = graph.nodes[node]
    if op == "sum":
        return graph.sum([(c, derivative(graph, a, variable)) for c, a in zip(data, args, strict=True)])
    if op == "ite":
        condition, a, b = args
        return graph.ite(condition, derivative(graph, a, variable), derivative(graph, b, variable))
    if op == "sel":
        a, b, affine = args
        da, db = derivative(graph, a, variable), derivative(graph, b, variable)
        daffine = derivative(graph, affine, variable)
        # By its own multiplier the selection has the slope of the affine form, also at its ends.
        if graph.nodes[variable].data == ("mult", data):
            return daffine
        return da if da == db == daffine else graph.make("sel", (da, db, daffine), data)
    if op == "entry":
        return graph.zero
    slopes = [derivative(graph, a, variable) for a in args]
    if all(s == graph.zero for s in slopes):
        return graph.zero
    if op == "mul":
        return graph.add(graph.mul(slopes[0], args[1]), graph.mul(args[0], slopes[1]))
    if op == "div":
        if slopes[1] == graph.zero:
            return graph.div(slopes[0], args[1])
        return graph.div(graph.sum(((1.0, slopes[0]), (-1.0, graph.mul(node, slopes[1])))), args[1])
    if op == "pow":
        return _power_slope(graph, node, slopes)
    if op == "fun":
        return graph.mul(function_slope(graph, node), slopes[0])
    if op == "fun2" and data in ("max", "min"):
        condition = graph.make("rel", args, ">" if data == "max" else "<")
        return graph.ite(condition, slopes[0], slopes[1])
    if op == "fun2" and data == "mod":
        return slopes[0]
    if op == "fun2" and data == "atan2":
        y, x = args
        norm = graph.add(graph.mul(x, x), graph.mul(y, y))
        return graph.div(graph.sum(((1.0, graph.mul(x, slopes[0])), (-1.0, graph.mul(y, slopes[1])))), norm)
    raise TypeError(f"no derivative is known for `{op} {data}`")


def _power_slope(graph: Nodes, node: int, slopes) -> int:
    a, b = graph.nodes[node].args
    lowered = graph.sum(((1.0, b), (-1.0, graph.one)))
    above = graph.nodes[node].data and (graph.value(lowered) or 0.0) > 0.0
    lower = graph.make("pow", (a, lowered), "above") if above else graph.power(a, lowered)
    slope = graph.mul(graph.mul(b, lower), slopes[0])
    if slopes[1] != graph.zero:
        slope = graph.add(slope, graph.mul(graph.mul(node, graph.fun("log", a)), slopes[1]))
    return slope


def function_slope(graph: Nodes, node: int) -> int:
    """q in w' = q u' for w = f(u); written in w where that is cheaper."""
    u = graph.nodes[node].args[0]
    name = graph.nodes[node].data
    one = graph.one

    def polynomial(c0, c2, v):  # c0 + c2*v**2
        return graph.sum(((c0, one), (c2, graph.mul(v, v))))

    if name == "exp":
        return node
    if name == "sqrt":
        return graph.div(graph.num(0.5), node)
    if name in ("sin", "sinh", "cosh"):
        return graph.fun({"sin": "cos", "sinh": "cosh", "cosh": "sinh"}[name], u)
    if name == "cos":
        return graph.scale(-1.0, graph.fun("sin", u))
    if name in ("tan", "tanh"):
        return polynomial(1.0, 1.0 if name == "tan" else -1.0, node)
    if name in ("erf", "erfc"):
        factor = (2 if name == "erf" else -2) / math.sqrt(math.pi)
        return graph.scale(factor, graph.fun("exp", polynomial(0.0, -1.0, u)))
    if name == "fabs":
        return graph.fun("sign", u)
    if name in ("sign", "heaviside", "floor", "ceil"):
        return graph.zero
    below = {"log": u, "atan": polynomial(1.0, 1.0, u), "atanh": polynomial(1.0, -1.0, u)}.get(name)
    if below is None:
        signs = {"asin": (1.0, -1.0), "acos": (1.0, -1.0), "asinh": (1.0, 1.0), "acosh": (-1.0, 1.0)}[name]
        below = graph.fun("sqrt", polynomial(*signs, u))
    return graph.div(graph.num(-1.0 if name == "acos" else 1.0), below)
