"""Generated functions of a smoothed model, for the stiff path (kernels/stiff_*.py call them by address).

    rates1(t, x, p, f)       the right-hand side at one point
    hoist(t8, p, c)          everything that depends on time alone, at the 8 stage times
    rates8(t8, c, x, p, f)   the right-hand side at 8 stages, x[8 i + k]
    jacobian(t, x, p, J)     the entries of df/dx that are not identically zero
    factor(J, m, lu), solve(lu, r)    sparse elimination of (mu/h) I - J in four lanes
    surfaces(t, x, p, s)     of every layer h, dh/dt, eps, then the gradient of h
    surfaces8(t8, x, p, s)   h at 8 points
    taylor(t, x, p, K, stride, rows)  Taylor coefficients of the states and of the surfaces that are no states
    watch8(t8, x, p, e)      surfaces of the events at 8 points
    newton8(m, t8, c, x, p, mu, lu, Z, W, F, R, weight)   a whole Newton iteration, where n is small
    act(i, t, x, p, xnew)    event i: 0 if its `when` fails, else writes its updates into xnew

Chain: Model (with `smoothing`, without multipliers) -> text -> cached cfuncs -> addresses.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import sympy as sp

from pwsmooth.codegen import cache
from pwsmooth.codegen.stiff_dag import Graph
from pwsmooth.codegen.stiff_linear import Elimination, factor_lines, solve_lines
from pwsmooth.codegen.stiff_newton import write_newton
from pwsmooth.codegen.stiff_taylor import MOST_PRODUCTS, Series
from pwsmooth.codegen.stiff_text import PREAMBLE, Writer
from pwsmooth.model import Model

NAMES = (
    "rates1", "hoist", "rates8", "jacobian", "factor", "solve", "surfaces", "surfaces8", "taylor",
    "watch8", "act", "newton8",
)  # fmt: skip


@dataclass(frozen=True)
class CompiledStiff:
    """Addresses of the generated functions (0 where absent) and the sizes that the kernels need."""

    model: Model
    address: np.ndarray  # int64, in the order of NAMES
    n: int
    n_surfaces: int
    n_events: int
    n_hoisted: int
    n_slots: int
    surface_state: np.ndarray  # state index of each surface that is one, else -1
    surface_row: np.ndarray  # its row in `taylor`
    module: object = field(repr=False)


_compiled: dict[Model, CompiledStiff] = {}


def compile_stiff(model: Model) -> CompiledStiff:
    """Compile the stiff functions of a model without multipliers.

    Parameters
    ----------
    model : Model
        The lowered smoothed view.

    Returns
    -------
    CompiledStiff

    Raises
    ------
    ValueError
        The model still has multipliers, or an expression has no compiled form.
    """
    found = _compiled.get(model)
    if found is None:
        if model.multipliers:
            names = ", ".join(str(m.symbol) for m in model.multipliers)
            raise ValueError(
                f"The smoothed path integrates models without multipliers; this one still has {names}. "
                "Contacts and algebraic unknowns run on the event-driven path."
            )
        paths = cache.cached_modules(f"stiff{cache.fingerprint(model)}", lambda: {"stiff": stiff_text(model)})
        found = _compiled[model] = _load(model, cache.load_module(paths["stiff"]))
    return found


def _load(model: Model, module) -> CompiledStiff:
    addresses = [getattr(module, name).address if hasattr(module, name) else 0 for name in NAMES]
    return CompiledStiff(
        model, np.array(addresses, dtype=np.int64), len(model.states), len(model.smoothing), len(model.events),
        module.N_HOISTED, module.N_SLOTS, np.array(module.SURFACE_STATE, dtype=np.int64),
        np.array(module.SURFACE_ROW, dtype=np.int64), module,
    )  # fmt: skip


def stiff_text(model: Model) -> str:
    """Source text of every generated function of the stiff path."""
    n, states = len(model.states), list(model.states)
    graph = Graph(model.time, states, model.parameters)
    rates = graph.add_expressions(model.rhs)
    surfaces = [h for h, _ in model.smoothing]
    surface_state = [states.index(h) if h in states else -1 for h in surfaces]
    # A gradient is wanted of the tidied expressions: the ones that are evaluated.
    derivative = [[sp.diff(f, s) for s in states] for f in model.rhs]
    pattern = {(i, j) for i in range(n) for j in range(n) if derivative[i][j] != 0}
    entries = sorted(pattern)
    jacobian = graph.add_expressions([derivative[i][j] for i, j in entries])
    h = graph.add_expressions(surfaces)
    writer = Writer(graph)

    writer.function("rates1", "t, x, p, f", "_f, _d, _d, _d")
    writer.point(rates, [f"f[{i}]" for i in range(n)])

    hoisted = _hoist(writer, graph, rates)
    writer.function("rates8", "t, c, x, p, f", "_d, _d, _d, _d, _d")
    writer.lanes(rates, range(n), "f", hoisted=hoisted)

    writer.function("jacobian", "t, x, p, J", "_f, _d, _d, _d")
    writer.point(jacobian, [f"J[{i * n + j}]" for i, j in entries])

    elimination = Elimination(n, pattern)
    if elimination.worthwhile:
        writer.function("factor", "J, m, lu", "_d, _d, _d")
        writer.lines += factor_lines(n, pattern, elimination)
        writer.function("solve", "lu, r", "_d, _d")
        writer.lines += solve_lines(n, elimination)
    write_newton(writer, rates, hoisted, elimination, n)

    surface_row = _surfaces(writer, graph, model, h, surface_state)
    _taylor(writer, graph, rates, h, surface_row, n)
    _events(writer, graph, model)
    constants = [
        f"N_HOISTED = {len(hoisted)}",
        f"N_SLOTS = {len(elimination.slots) if elimination.worthwhile else 0}",
        f"SURFACE_STATE = {surface_state!r}",
        f"SURFACE_ROW = {surface_row!r}",
    ]
    return PREAMBLE + "\n".join(constants + writer.lines) + "\n"


def _hoist(writer: Writer, graph: Graph, rates) -> dict[int, int]:
    """Write `hoist`; returns the row of every node of time alone that a node of the states uses."""
    from pwsmooth.codegen.stiff_dag import operands

    wanted = {a for a in rates if graph.level[a] == 1}
    for a in graph.reachable(rates):
        if graph.level[a] == 2:
            wanted |= {b for b in operands(graph.ops[a]) if graph.level[b] == 1}
    hoisted = {a: row for row, a in enumerate(sorted(wanted))}
    if hoisted:
        writer.function("hoist", "t, p, c", "_d, _d, _d")
        writer.lanes(list(hoisted), hoisted.values(), "c")
    return hoisted


def _surfaces(writer: Writer, graph: Graph, model: Model, h, surface_state) -> list[int]:
    """Write `surfaces` and `surfaces8`; returns the Taylor row of every surface."""
    n, width = len(model.states), len(model.states) + 3
    roots, targets = [], []
    for j, (expression, eps) in enumerate(model.smoothing):
        gradient = [sp.diff(expression, s) for s in (model.time, *model.states)]
        roots += graph.add_expressions([expression, gradient[0], eps, *gradient[1:]])
        targets += [f"s[{j * width + i}]" for i in range(width)]
    row, surface_row = n, []
    for state in surface_state:
        surface_row.append(state if state >= 0 else row)
        row += state < 0
    if roots:
        writer.function("surfaces", "t, x, p, s", "_f, _d, _d, _d")
        writer.point(roots, targets)
        writer.function("surfaces8", "t, x, p, s", "_d, _d, _d, _d")
        writer.lanes(h, range(len(h)), "s")
    return surface_row


def _taylor(writer: Writer, graph: Graph, rates, h, surface_row, n) -> None:
    """Write `taylor`, where every operation has a recurrence and the text stays short enough."""
    extra = [a for a, row in zip(h, surface_row, strict=True) if row >= n]
    series = Series(graph, rates + extra, n)
    if not series.supported():
        return
    places = {"time": "t", "state": "x[%d]", "par": "p[%d]"}

    def constant(a):
        lines = Writer(graph)
        lines.assign(a, "    ", places)
        return lines.lines

    body = series.write(constant)
    if series.products <= MOST_PRODUCTS:
        writer.function("taylor", "t, x, p, K, stride, rows", "_f, _d, _d, _i, _i, _d")
        writer.lines += body


def _events(writer: Writer, graph: Graph, model: Model) -> None:
    """Write `watch8` (surfaces of the events; time events have none and stay 1) and `act`."""
    if not model.events:
        return
    n = len(model.states)
    watch = graph.add_expressions([1 if e.surface is None else e.surface for e in model.events])
    writer.function("watch8", "t, x, p, e", "_d, _d, _d, _d")
    writer.lanes(watch, range(len(watch)), "e")
    flags = 'error_model="numpy", fastmath={"contract", "nsz"}'
    writer.lines += [
        "",
        "",
        f"@cfunc(_i(_i, _f, _d, _d, _d), cache=True, {flags})",
        "def act(i, t, x, p, xnew):",
    ]
    for i, event in enumerate(model.events):
        condition = [graph.condition(event.when)]
        values = graph.add_expressions([e for _, e in event.update])
        body = Writer(graph)
        body.point(condition + values, ["_when"] + [f"_v{j}" for j, _ in event.update])
        writer.lines.append(f"    if i == {i}:")
        writer.lines += ["    " + line for line in body.lines]
        writer.lines += ["        if not _when:", "            return 0"]
        writer.lines += [f"        xnew[{j}] = _v{j}" for j, _ in event.update]
        writer.lines.append("        return 1")
    writer.lines.append("    return 0")
    assert n  # a model without states has no event to act on
