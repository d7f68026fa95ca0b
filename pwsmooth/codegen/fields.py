"""Pointwise functions of a model: rates, surfaces, residuals, their gradients, resets, outputs, layer rates.

Every one is a C function of pointers to doubles, reached by address:

    fields(t, x, mult, p, dx, h, g)      linear(t, x, mult, p, G, dh)      outputs(t, x, mult, p, out)
    act(i, t, x, mult, p, xnew) -> 1 if event i fired                     layer(t, x, mult, z, p, g, q)

Behind the events `act` knows the multipliers: a contact's impact; whether a switch that rests on its surface is 1.

`linear` fills the entries of two sparse matrices by rows: G = dg/dmult (its diagonal always among them) and
dh = dh/dx, behind which stand the derivatives dh/dt. Their rows and columns are constants of its module.

Chain: Model -> Graph (dag.py) -> text (this file) -> write_module (cache.py), native.load -> addresses.
"""

from __future__ import annotations

import itertools

import sympy as sp

from ..definition.model import Model, Multiplier
from .graph.dag import Graph
from .graph.scalar import HELPERS, ScalarCode, Writer, write_update
from .graph.slopes import derivative
from .lanes import lanes_text


class Source:
    """Text of one generated module: functions, the helpers that they use, and constants."""

    def __init__(self):
        self.functions: list[str] = []
        self.helpers: set[str] = set()
        self.constants: dict[str, object] = {}

    def function(self, name: str, arguments: str, body: Writer, returns: str = "") -> None:
        kinds = {"t": "D", "i": "I", "K": "I", "stride": "I", "scratch": "I", "mask": "Q"}
        typed = ", ".join(f"{a}: {kinds.get(a, 'P')}" for a in arguments.split(", "))
        self.functions.append(f"def {name}({typed}){returns and f' -> {returns}'}:\n{body.text()}")

    def text(self) -> str:
        head = (
            '"""Generated from a pwsmooth model in the subset of codegen/machine/native.py; never edited."""\n'
        )
        helpers = [HELPERS[name].lstrip() for name in sorted(self.helpers)]
        constants = "".join(f"{name} = {value!r}\n" for name, value in self.constants.items())
        return "\n\n".join((head + constants, *helpers, *self.functions))


def store(source: Source, graph: Graph, name: str, arguments: str, arrays: dict[str, list[int]]) -> None:
    """A function that fills the given arrays with the given nodes."""
    body = Writer()
    code = ScalarCode(graph, body)
    code.emit([node for nodes in arrays.values() for node in nodes])
    for array, nodes in arrays.items():
        zeros = [i for i, node in enumerate(nodes) if node == graph.zero]
        if len(zeros) > 8:
            # A line each would take seconds to compile in the gradients of long chains.
            body.line(f"for i in range({len(nodes)}):")
            body.line(f"    {array}[i] = 0.0")
        for i, node in enumerate(nodes):
            if node != graph.zero or len(zeros) <= 8:
                body.line(f"{array}[{i}] = {code.name(node)}")
    if not body.lines:
        body.line("return")
    source.helpers |= code.helpers
    source.function(name, arguments, body)


def surfaces(graph: Graph) -> list[int]:
    """Nodes of the surfaces, the multipliers' first, then the events'; 0 where there is none."""
    holders = (*graph.model.multipliers, *graph.model.events)
    return [graph.zero if s.surface is None else graph.expression(s.surface) for s in holders]


def _size_of_unknowns(graph: Graph, surface: int) -> int:
    """How large the parts of a surface are in which unknowns stand: of each |dh/da| by what the terms of its equation
    g = 0 add up to, over |dg/da|. An unknown that is 0 is known to the rounding of what cancels in it."""
    parts = []
    for j in graph.variables(surface, "mult"):
        if graph.model.multipliers[j].kind != "algebraic":
            continue
        a, equation = graph.var("mult", j), graph.expression(graph.model.multipliers[j].condition)
        op, args, factors = graph.nodes[equation]
        terms = zip(factors, args, strict=True) if op == "sum" else [(1.0, equation)]
        size, own = (
            graph.sum([(abs(c), graph.fun("fabs", term)) for c, term in terms]),
            derivative(graph, equation, a),
        )
        if own == graph.zero:  # other equations tell of it
            size, own = graph.fun("fabs", a), graph.one
        ratio = graph.div(derivative(graph, surface, a), own)
        parts.append((1.0, graph.mul(size, graph.fun("fabs", ratio))))
    return graph.sum(parts)


def write_fields(model: Model) -> dict[str, str]:
    """Sources of the pointwise functions: {"fields": text, ...}.

    `fields`, `linear` and `act` are always there, so that kernels may call them unasked; `outputs` and `layer`
    only where the model has any, and `fields8` (lanes.py) where it has discs and can be computed on vectors. Each is a
    module of its own, loaded when it is asked for.
    """
    graph = Graph(model)
    rates = [graph.expression(e) for e in model.rhs]
    residuals = [graph.expression(m.condition) for m in model.multipliers]
    h = surfaces(graph)
    sources = {name: Source() for name in ("fields", "linear", "act", "outputs", "layer")}
    arrays = {"dx": rates, "h": h, "g": residuals}
    store(sources["fields"], graph, "fields", "t, x, mult, p, dx, h, g", arrays)
    unknowns = [graph.var("mult", j) for j in range(len(model.multipliers))]
    states = [graph.var("x", i) for i in range(len(model.states))]
    gradients = [{i: derivative(graph, s, states[i]) for i in graph.variables(s, "x")} for s in h]
    gradients = [{i: d for i, d in row.items() if d != graph.zero} for row in gradients]
    matrix = [
        {j: derivative(graph, r, unknowns[j]) for j in sorted({i, *graph.variables(r, "mult")})}
        for i, r in enumerate(residuals)
    ]
    slopes = [d for row in gradients for d in row.values()]
    slopes += [derivative(graph, s, graph.var("t", 0)) for s in h]
    sizes = {i: size for i, s in enumerate(h) if (size := _size_of_unknowns(graph, s)) != graph.zero}
    slopes += sizes.values()
    sources["linear"].constants["DH_UNKNOWNS"] = tuple(sizes)
    entries = [d for row in matrix for d in row.values()]
    store(sources["linear"], graph, "linear", "t, x, mult, p, G, dh", {"G": entries, "dh": slopes})
    for name, rows in (("G", matrix), ("DH", gradients)):
        ends = itertools.accumulate(map(len, rows), initial=0)
        sources["linear"].constants |= {
            f"{name}_ROW": tuple(ends),
            f"{name}_COL": tuple(k for row in rows for k in row),
        }
    if model.outputs:
        store(
            sources["outputs"],
            graph,
            "outputs",
            "t, x, mult, p, out",
            {"out": [graph.expression(e) for _, e in model.outputs]},
        )
    if model.layer_states:
        store(
            sources["layer"],
            graph,
            "layer",
            "t, x, mult, z, p, g, q",
            {
                "g": [graph.expression(e) for e in model.layer_residuals],
                "q": [graph.expression(z.rate) for z in model.layer_states],
            },
        )
    _write_act(sources["act"], graph)
    texts = {name: source.text() for name, source in sources.items() if source.functions}
    if any(m.kind == "disc" for m in model.multipliers) and (lanes := lanes_text(graph, arrays)):
        texts["fields8"] = lanes
    return texts


def updates(model: Model) -> list[tuple[sp.Basic, list[tuple[int, sp.Expr, bool]]]]:
    """(condition, what is written) of the events, then of the multipliers: the impacts of contacts, and whether a
    switch that stays on its surface is 1, which writes nothing."""
    acts = [(e.when, e.writes(model.states)) for e in model.events]
    return acts + [
        (above_at_zero(m), [(i, e, False) for i, e in enumerate(m.impact or ())]) for m in model.multipliers
    ]


def above_at_zero(m: Multiplier) -> sp.Basic:
    """The condition on which a multiplier is 1, not -1, where its surface stays at 0, else true."""
    return sp.Gt(m.at_zero, 0) if isinstance(m.at_zero, sp.Expr) else sp.true


def _write_act(source: Source, graph: Graph) -> None:
    """Updates by number."""
    body = Writer()
    for i, (when, update) in enumerate(updates(graph.model)):
        if when == sp.true and not update:
            continue
        body.line(f"if i == {i}:")
        body.indent = 2
        code = ScalarCode(graph, body)
        condition = graph.expression(when)
        code.emit([condition])
        if when != sp.true:
            body.line(f"if not {code.name(condition)}:")
            body.line("    return 0")
        # All new values come from the values before, so none is written until all are known.
        nodes = [graph.expression(value) for _, value, _ in update]
        code.emit(nodes)
        for (index, _, adds), node in zip(update, nodes, strict=True):
            body.line(write_update(f"xnew[{index}]", code.name(node), adds))
        body.line("return 1")
        body.indent = 1
        source.helpers |= code.helpers
    body.line("return 1")
    source.function("act", "i, t, x, mult, p, xnew", body, returns="I")
