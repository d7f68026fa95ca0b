"""Drives: a motion, force or load as an expression of time, checked where a law would divide by a jump of it.

Chain: **drive** -> the scenes that are driven.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from ..definition.drives import Drive
from ..definition.lambdified import numpy_function
from ..door import checks
from ..laws.catalogue import Takes

#: Time in every scene, s: drives are expressions of it.
t = sp.Symbol("t", real=True)


#: Which laws scenes take; as tests of `law` they say why another one has no place.
OF_FRICTION, OF_CONTACT = Takes("friction"), Takes("contact")
IN_PLANE, SPINNING = Takes("friction", in_plane=True), Takes("friction", spins=True)

#: Checks of the arguments that scenes share.
DOOR: dict[str, checks.Check] = {
    "m": checks.positive,
    "t_span": lambda value, what: value if value is None else checks.span(value, what),
    "period": checks.optional(checks.positive), "parameters": checks.optional(checks.values), "x0": checks.pair,
}  # fmt: skip


def door(*shared: str, **tests: checks.Check) -> Any:
    """checks.door of `t_span`, the `shared` ones, and of laws, numbers or what else is given."""
    return checks.door(**{name: DOOR[name] for name in ("t_span", *shared)}, **tests)


def expression(value: Any, what: str) -> sp.Expr:
    """A drive as an expression of `scenes.t`; any symbol of that name means time."""
    e = checks.expression(value, f"`{what}`")
    return e.xreplace({s: t for s in e.free_symbols if s.name == "t"})


def within(t_span: Any, *drives: Any) -> tuple[float, float]:
    """The span of a run: as wanted, else that of the first record among its drives, else (0, 1)."""
    records = [drive for drive in drives if isinstance(drive, Drive)]
    if t_span is None:
        return records[0].t_span if records else (0.0, 1.0)
    start, end = checks.span(t_span)
    for record in records:
        if start < record.t_span[0] or end > record.t_span[1]:
            raise ValueError(
                f"`t_span` is {tuple(t_span)}, but a record of the drive covers {record.t_span}; stay inside of it."
            )
    return start, end


def check_continuous(e: sp.Expr, what: str, t_span: Any, parameters: Mapping[Any, Any]) -> None:
    """A ValueError for a jump of the drive inside the span: its derivative would be infinite there."""
    remedy = f"`{what}` jumps{{where}}, so that its velocity is infinite; let it rise within a finite time."
    if e.diff(t).has(sp.DiracDelta) or e.has(sp.floor, sp.ceiling, sp.Mod):
        raise ValueError(remedy.format(where=f" ({e})"))
    values = checks.values(parameters, "`parameters`")
    e = e.xreplace({s: sp.Float(values[s.name]) for s in e.free_symbols if s.name in values})
    f = numpy_function(t, e)
    grid = np.linspace(t_span[0], t_span[1], 513)
    scale = float(np.max(np.abs(np.broadcast_to(f(grid), grid.shape)))) or 1.0
    for piece in e.atoms(sp.Piecewise):
        for edge in _edges(piece, t_span):
            beside = 1e-12 * max(1.0, abs(edge), t_span[1] - t_span[0])
            # Ten times the slope's own change, and far above rounding.
            if abs(float(f(edge + beside)) - float(f(edge - beside))) > 1e-7 * scale:
                raise ValueError(remedy.format(where=f" at t = {edge:.6g}"))


def _edges(piece: sp.Piecewise, t_span: Any) -> list[float]:
    """Instants in the span at which a condition of a Piecewise changes."""
    edges = []
    for _, condition in piece.args:
        for relation in condition.atoms(sp.core.relational.Relational):
            for root in sp.solve(relation.lhs - relation.rhs, t):
                if root.is_number and root.is_real and t_span[0] < root < t_span[1]:
                    edges.append(float(root))
    return edges


def value(e: Any, known: Mapping[str, float], what: str) -> float:
    """The value of an expression in which the symbols of these names have values."""
    e = checks.expression(e, what)
    return checks.number(
        e.xreplace({s: sp.Float(known[s.name]) for s in e.free_symbols if s.name in known}), what
    )
