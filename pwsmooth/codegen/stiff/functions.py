"""Generated functions of a smoothed model, for the stiff path (kernels/stiff_*.py call them by address).

    rates1(t, x, p, f)       the right-hand side at one point
    hoist(t8, p, c)          everything that depends on time alone, at the 8 stage times
    rates8(t8, c, x, p, f)   the right-hand side at 8 stages, x[8 i + k]
    jacobian(t, x, p, J)     the entries of df/dx that are not identically zero, by rows
    factor(J, m, lu), solve(lu, r)    sparse elimination of (mu/h) I - J in four lanes
    surfaces(t, x, p, s)     of every layer h, dh/dt at fixed x, eps; then the gradients of h, what is not zero of them
    surfaces8(t8, x, p, s)   h at 8 points
    taylor(t, x, p, K, stride, rows)  Taylor coefficients of the states and of the surfaces that are no states
    watch8(t8, x, p, e)      surfaces of the events at 8 points
    act(i, t, x, p, xnew)    event i: 0 if its `when` fails, else writes its updates into xnew
    radau(...)               a whole attempt at a Radau step of one order, where n is small (attempt.py)

Of a family all but `hoist`, `factor`, `solve` and `radau` are loops over its elements (elements.py).
Chain: Model (with `smoothing`, without multipliers) -> text -> machine/vectors.py -> addresses.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace

import numpy as np
import sympy as sp

from ...definition.model import Model, tables_of
from ...kernels.stiff.state import STRIDE
from ..graph.scalar import write_update
from ..machine import cache
from ..machine.clock import preparing
from .attempt import Attempt, possible
from .graph import GradedGraph
from .linear import Elimination, factor_lines, length, plan, solve_lines
from .taylor import taylor_lines
from .text import StiffCode

NAMES = (
    "rates1", "hoist", "rates8", "jacobian", "factor", "solve", "surfaces", "surfaces8", "taylor",
    "watch8", "act", "radau",
)  # fmt: skip


@dataclass(frozen=True)
class CompiledStiff:
    """Addresses of the generated functions (0 where absent) and the sizes that the kernels need."""

    model: Model
    address: np.ndarray  # int64, in the order of NAMES; that of `radau` is 0, see `radau`
    n: int
    n_surfaces: int
    n_events: int
    n_hoisted: int
    rows_length: int  # numbers that `taylor` writes
    unknowns: int  # of implicit steps: the states, then sums over elements
    pattern: tuple[np.ndarray, np.ndarray]  # row and column of every entry of `jacobian`, those of sums first
    slopes: tuple[np.ndarray, np.ndarray]  # where each surface's gradient begins, and the states of its entries
    surface_state: np.ndarray  # state index of each surface that is one, else -1
    surface_row: np.ndarray  # its row in `taylor`
    read: np.ndarray  # states that surfaces of events read
    group: np.ndarray  # of every state: no two of one group stand in the surface of one event
    elimination: np.ndarray  # the plan of it; empty where `factor` and `solve` are written out
    eliminated: int  # numbers that an elimination keeps
    written_out: bool  # whether attempts are written out
    smooth: bool  # whether the right-hand side has no kinks and jumps
    codes: dict = field(repr=False, default_factory=dict)  # machine code; it must outlive the addresses

    def matrix(self, entries: np.ndarray) -> np.ndarray:
        """df/dx, shape (n, n), of the entries that `jacobian` gives."""
        n, size = self.n, self.unknowns
        whole = np.zeros((size, size))
        np.add.at(whole, self.pattern, entries)
        own, through, along, sums = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
        return own + through @ np.linalg.solve(np.eye(size - n) - sums, along) if size > n else own

    def with_taylor(self) -> CompiledStiff:
        """The same with `taylor`, which of a family is made when it is asked for."""
        if self.model.families is None:
            return self
        if "taylor" not in self.codes:
            from .elements import load_taylor

            self.codes["taylor"] = load_taylor(self.model)
        found = self.codes["taylor"]
        if found is None:
            return self
        code, length, row = found
        address = self.address.copy()
        address[NAMES.index("taylor")] = code.address("taylor")
        return replace(self, address=address, rows_length=length, surface_row=row)

    def radau(self, order: int) -> int:
        """Address of the attempt at a step of order 5, 9 or 13 (`order` 0, 1, 2), compiled when first asked for."""
        if not self.written_out:
            return 0
        if order not in self.codes:
            key = f"stiff{cache.fingerprint(self.model)}-radau{order}"
            texts = cache.cached_texts(key, lambda: {"radau": attempt_text(self.model, order)})
            code = _machine_code(texts["radau"], self.model)
            self.codes[order] = code, code.address("radau")
        return self.codes[order][1]


@functools.lru_cache(maxsize=64)
@preparing()
def compile_stiff(model: Model) -> CompiledStiff:
    """Compile the stiff functions of a model without multipliers; the last ones are kept.

    Parameters
    ----------
    model : Model
        The lowered smoothed view.

    Returns
    -------
    CompiledStiff

    Raises
    ------
    ValueError, TypeError
        The model still has multipliers, or an expression has no compiled form.
    """
    if model.multipliers:
        names = ", ".join(str(m.symbol) for m in model.multipliers)
        raise ValueError(
            f"The smoothed path integrates models without multipliers; this one still has {names}. "
            "Contacts and algebraic unknowns run on the event-driven path."
        )
    if model.families is not None:
        from .elements import load

        code, numbers = load(model)
    else:
        texts = cache.cached_texts(f"stiff{cache.fingerprint(model)}", lambda: {"stiff": stiff_text(model)})
        code = _machine_code(texts["stiff"], model)
        numbers = _numbers(model, code.constants)
    n, size, slots = len(model.states), numbers["unknowns"], numbers.pop("slots")
    eliminates = np.zeros(0, np.int64) if slots or not n else plan(n, size, *numbers["pattern"])
    return CompiledStiff(
        model, np.array([code.address(name) for name in NAMES], dtype=np.int64), n, len(model.smoothing),
        len(model.events), **numbers, elimination=eliminates,
        eliminated=8 * slots if slots or not n else length(eliminates), codes={"functions": code},
    )  # fmt: skip


def _machine_code(text, model):
    from pwsmooth.codegen.machine import vectors

    return vectors.load(text, tables=tuple(tables_of(model)))


def _numbers(model: Model, constants) -> dict:
    """What CompiledStiff holds of a model, from the constants of its text."""
    n, states = len(model.states), constants["SLOPES"]
    pattern = np.array(constants["PATTERN"], np.int64).reshape(-1, 2).T
    return {
        "n_hoisted": constants["N_HOISTED"],
        "rows_length": STRIDE * (n + len(model.smoothing)),
        "unknowns": n,
        "pattern": tuple(np.ascontiguousarray(pattern)),
        "slopes": (np.cumsum([0, *map(len, states)]), np.array([i for row in states for i in row], np.int64)),
        "surface_state": np.array(constants["SURFACE_STATE"], np.int64),
        "surface_row": np.array(constants["SURFACE_ROW"], np.int64),
        "read": np.arange(n),
        "group": np.arange(n),
        "slots": constants["N_SLOTS"],
        "written_out": bool(constants["WRITTEN_OUT"]),
        "smooth": bool(constants["SMOOTH"]),
    }


class _Parts:
    """The graph of a model, and what every text of it begins with."""

    def __init__(self, model: Model):
        n, states = len(model.states), list(model.states)
        self.graph = graph = GradedGraph(model)
        self.rates = graph.expressions(model.rhs)
        surfaces = [h for h, _ in model.smoothing]
        self.surface_state = [states.index(h) if h in states else -1 for h in surfaces]
        derivative = [[sp.diff(f, s) for s in states] for f in model.rhs]
        self.pattern = {(i, j) for i in range(n) for j in range(n) if derivative[i][j] != 0}
        self.jacobian = graph.expressions([derivative[i][j] for i, j in sorted(self.pattern)])
        self.surfaces = graph.expressions(surfaces)
        gradients = [{i: g for i, s in enumerate(states) if (g := sp.diff(h, s)) != 0} for h in surfaces]
        self.slopes = [tuple(gradient) for gradient in gradients]  # states that each surface has a slope along
        self.gradients = [g for gradient in gradients for g in gradient.values()]
        self.elimination = Elimination(n, self.pattern)
        self.code = StiffCode(graph)
        self.written_out = possible(self.code, self.rates, self.surfaces, self.elimination, n)

    def text(self, **constants) -> str:
        """What was written, with its helpers and constants."""
        heads = [f"{name} = {value!r}" for name, value in constants.items()]
        return "\n".join([*heads, self.code.helper_text(), *self.code.writer.lines]) + "\n"


def attempt_text(model: Model, order: int) -> str:
    """Source text of the attempt at a Radau step."""
    parts = _Parts(model)
    Attempt(parts, order, len(model.states)).write()
    return parts.text()


def stiff_text(model: Model) -> str:
    """Source text of every other generated function of the stiff path."""
    n, parts = len(model.states), _Parts(model)
    code, rates, elimination = parts.code, parts.rates, parts.elimination

    code.function("rates1", "t: D, x: P, p: P, f: P")
    code.point(rates, [f"f[{i}]" for i in range(n)])

    hoisted = _hoist(code, rates)
    code.function("rates8", "t: P, c: P, x: P, p: P, f: P")
    code.lanes(rates, range(n), "f", hoisted=hoisted)

    code.function("jacobian", "t: D, x: P, p: P, J: P")
    code.point(parts.jacobian, [f"J[{k}]" for k in range(len(parts.pattern))])

    if elimination.worthwhile:
        code.function("factor", "J: P, m: P, lu: P")
        code.writer.lines += factor_lines(n, parts.pattern, elimination)
        code.function("solve", "lu: P, r: P")
        code.writer.lines += solve_lines(n, elimination)

    surface_row = _surfaces(code, model, parts)
    extra = [a for a, row in zip(parts.surfaces, surface_row, strict=True) if row >= n]
    if lines := taylor_lines(code, rates, extra):
        code.function("taylor", "t: D, x: P, p: P, K: I, stride: I, rows: P")
        code.writer.lines += lines
    _events(code, model)
    return parts.text(
        N_HOISTED=len(hoisted),
        N_SLOTS=len(elimination.slots) if elimination.worthwhile else 0,
        PATTERN=sorted(parts.pattern),
        SLOPES=parts.slopes,
        SURFACE_STATE=parts.surface_state,
        SURFACE_ROW=surface_row,
        WRITTEN_OUT=int(parts.written_out),
        SMOOTH=int(parts.graph.smooth(rates)),
    )


def _hoist(code: StiffCode, rates) -> dict[int, int]:
    """Write `hoist`; returns the row of every node of time alone that a node of the states uses."""
    graph = code.graph
    wanted = {a for a in rates if graph.grade(a) == 1}
    for a in graph.reach(rates):
        if graph.grade(a) == 2:
            wanted |= {b for b in graph.nodes[a].args if graph.grade(b) == 1}
    hoisted = {a: row for row, a in enumerate(sorted(wanted))}
    if hoisted:
        code.function("hoist", "t: P, p: P, c: P")
        code.lanes(list(hoisted), hoisted.values(), "c")
    return hoisted


def _surfaces(code: StiffCode, model: Model, parts: _Parts) -> list[int]:
    """Write `surfaces` and `surfaces8`; returns the Taylor row of every surface."""
    values = [e for h, eps in model.smoothing for e in (h, sp.diff(h, model.time), eps)]
    row, surface_row = len(model.states), []
    for state in parts.surface_state:
        surface_row.append(state if state >= 0 else row)
        row += state < 0
    if values:
        roots = code.graph.expressions([*values, *parts.gradients])
        code.function("surfaces", "t: D, x: P, p: P, s: P")
        code.point(roots, [f"s[{k}]" for k in range(len(roots))])
        code.function("surfaces8", "t: P, x: P, p: P, s: P")
        code.lanes(parts.surfaces, range(len(parts.surfaces)), "s")
    return surface_row


def _events(code: StiffCode, model: Model) -> None:
    """Write `watch8` (surfaces of the events; time events have none and stay 1) and `act`."""
    if not model.events:
        return
    watch = code.graph.expressions([1 if e.surface is None else e.surface for e in model.events])
    code.function("watch8", "t: P, x: P, p: P, e: P")
    code.lanes(watch, range(len(watch)), "e")
    code.function("act", "i: I, t: D, x: P, p: P, xnew: P", "I")
    for i, event in enumerate(model.events):
        writes = event.writes(model.states)
        values = code.graph.expressions([event.when, *(e for _, e, _ in writes)])
        code.write(f"if i == {i}:")
        code.point(values, ["_when"] + [f"_v{j}" for j, _, _ in writes], indent=2)
        code.write("if not _when:", "    return 0", indent=2)
        code.write(*(write_update(f"xnew[{j}]", f"_v{j}", adds) for j, _, adds in writes), indent=2)
        code.write("return 1", indent=2)
    code.write("return 0")
