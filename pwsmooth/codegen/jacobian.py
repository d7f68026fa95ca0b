"""Jacobians of a model by states, multipliers and parameters: entry by entry, pointwise and as Taylor series.

    jacobian(t, x, mult, p, out)         of rates f, residuals g and surfaces h at a point
    act_slopes(i, t, x, mult, p, out)    of what event or impact i writes: a row of length n + m + np + 1 each,
                                         by states, multipliers, parameters and time

An entry is (kind, row, column), with the kinds below; only those that are not 0 everywhere are there.
Chain: Graph (dag.py) -> **entries** (this file) -> taylor/jets.py for their series, machine code -> kernels/tangent.
"""

from __future__ import annotations

from ..definition.model import Model
from ..definition.regularity import total_derivative
from .fields import Source, store, surfaces, updates
from .graph.dag import Graph
from .graph.scalar import ScalarCode, Writer
from .graph.slopes import derivative

# What is differentiated (rates, residuals, surfaces, speeds of gaps) by what (states, multipliers, parameters, time).
F_X, F_MULT, F_P, G_X, G_MULT, G_P, G_T, H_X, H_MULT, H_P, H_T, S_X, S_P, S_T = range(14)


def _entries(graph: Graph, kinds, nodes, m: int, parameters: int) -> list[tuple[int, int, int, int]]:
    """(kind, row, column, node) of the nodes by states, m multipliers, parameters; by time where `kinds` has that."""
    found = []
    for kind, name, count in zip(kinds, ("x", "mult", "p", "t"), (None, m, parameters, 1), strict=False):
        for i, node in enumerate(nodes):
            for j in graph.variables(node, name):
                if count is None or j < count:
                    slope = derivative(graph, node, graph.var(name, j))
                    if slope != graph.zero:
                        found.append((kind, i, j, slope))
    return found


def flow_entries(graph: Graph, rates, residuals, m: int, parameters: int) -> list[tuple[int, int, int, int]]:
    """Entries of the linearised flow: those of the rates, then those of the residuals."""
    found = _entries(graph, (F_X, F_MULT, F_P), rates, m, parameters)
    return found + _entries(graph, (G_X, G_MULT, G_P), residuals, m, parameters)


def linearised(graph: Graph, entries, w: list[int], l: list[int]) -> tuple[list[int], list[int]]:
    """Rates f_x w + f_lambda l and residuals g_x w + g_lambda l from the entries, those by parameters apart."""
    sums: dict[tuple[bool, int], list[tuple[float, int]]] = {}
    for kind, i, j, slope in entries:
        if kind % 3 != F_P:
            by = w if kind % 3 == F_X else l
            sums.setdefault((kind >= G_X, i), []).append((1.0, graph.mul(slope, by[j])))
    rows = [(residual, i) for residual, count in ((False, len(w)), (True, len(l))) for i in range(count)]
    made = [graph.sum(sums.get(row, [])) for row in rows]
    return made[: len(w)], made[len(w) :]


def _speeds(graph: Graph) -> list[int]:
    """Nodes of dh/dt of what is held with it; 0 for the others. No multiplier stands in it."""
    model = graph.model
    return [
        graph.expression(total_derivative(mu.surface, model.time, model.states, model.rhs))
        if mu.kind == "contact" or mu.second is not None
        else graph.zero
        for mu in model.multipliers
    ]


def write_jacobian(model: Model) -> dict[str, str]:
    """Sources {"jacobian": text, "act_slopes": text}."""
    graph = Graph(model, by_element=False)
    m, parameters = len(model.multipliers), len(model.parameters)
    rates = [graph.expression(e) for e in model.rhs]
    residuals = [graph.expression(mu.condition) for mu in model.multipliers]
    found = _entries(graph, (F_X, F_MULT, F_P), rates, m, parameters)
    found += _entries(graph, (G_X, G_MULT, G_P, G_T), residuals, m, parameters)
    found += _entries(graph, (H_X, H_MULT, H_P, H_T), surfaces(graph), m, parameters)
    found += [
        entry for entry in _entries(graph, (S_X, -1, S_P, S_T), _speeds(graph), m, parameters) if entry[0] > 0
    ]
    sources = {name: Source() for name in ("jacobian", "act_slopes")}
    nodes = [node for *_, node in found]
    store(sources["jacobian"], graph, "jacobian", "t, x, mult, p, out", {"out": nodes})
    sources["jacobian"].constants["ENTRIES"] = tuple((*place, k, 1) for k, (*place, _) in enumerate(found))
    _write_act_slopes(sources["act_slopes"], graph)
    return {name: source.text() for name, source in sources.items()}


def _write_act_slopes(source: Source, graph: Graph) -> None:
    model = graph.model
    symbols = [
        ("x", len(model.states)),
        ("mult", len(model.multipliers)),
        ("p", len(model.parameters)),
        ("t", 1),
    ]
    variables = [graph.var(name, i) for name, count in symbols for i in range(count)]
    body, writes = Writer(), []
    for i, (_, update) in enumerate(updates(model)):
        writes.append(tuple((index, int(adds)) for index, _, adds in update))
        if not update:
            continue
        body.line(f"if i == {i}:")
        body.indent = 2
        code = ScalarCode(graph, body)
        rows = [[derivative(graph, graph.expression(e), v) for v in variables] for _, e, _ in update]
        nodes = [node for row in rows for node in row]
        code.emit([node for node in nodes if node != graph.zero])
        body.line(f"for k in range({len(nodes)}):")
        body.line("    out[k] = 0.0")
        for k, node in enumerate(nodes):
            if node != graph.zero:
                body.line(f"out[{k}] = {code.name(node)}")
        body.indent = 1
        source.helpers |= code.helpers
    body.line("return 0")
    source.function("act_slopes", "i, t, x, mult, p, out", body, returns="I")
    source.constants["WRITES"] = tuple(writes)
