"""Curves of bifurcations of equilibria in two parameters.

    F(u) = (f, h_J) = 0,   c(u) = 0,   tau . (u - u0) = ds,   u = (x, lam_J, p, q),   each in a unit of its own

c is that of conditions.py. Where the equilibrium comes to the border of its mode, the curve ends: beyond it
is virtual.

Chain: problem.py, ways.py -> **curves** -> two_parameters.py.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np

from ...equilibria.equilibrium import Equilibrium
from ..branch import Branch, branch_of
from ..special import Special
from ..way import How, followed
from .conditions import BOUNDARY, HOPF, LAYER, Boundary, EquilibriumCondition, Fold, Hopf, Layer
from .problem import EquilibriumPoint, EquilibriumProblem
from .ways import EquilibriumCurveWay, beyond_border

FOLLOWED = ("fold", *HOPF, *LAYER, BOUNDARY)


def _condition(start: Any, kind: str | None) -> tuple[Equilibrium, EquilibriumCondition, bool]:
    """The equilibrium, the condition, and whether the curve begins at a point of codimension 2."""
    if isinstance(start, Special) and len(start.values) > 1:
        lead = start.lead(kind)
        return lead.cut[0], _of_kind(lead.kind, lead.cut[0], lead.event), True
    if isinstance(start, Special):
        own = BOUNDARY if start.kind.startswith(BOUNDARY) else start.kind
        if kind not in (None, own):
            raise ValueError(f"`kind` is {kind!r}, but `start` is a {start.kind}; leave `kind` out.")
        if own not in FOLLOWED:
            raise ValueError(f"`start` is a {start.kind}; followed are {', '.join(FOLLOWED)}.")
        e, event = start.point, None
        if own == BOUNDARY and start.beyond is not None:
            changed = zip(e.sides, start.beyond.sides)
            event = next((j, new) for j, (old, new) in enumerate(changed) if old != new)
        return e, _of_kind(own, e, event), False
    if not start.success:
        raise ValueError(f"`start` did not converge: {start.message}")
    if kind not in FOLLOWED:
        said = "missing" if kind is None else repr(kind)
        raise ValueError(f"`kind` is {said}: `start` is an equilibrium; give one of {', '.join(FOLLOWED)}.")
    return start, _of_kind(kind, start, None), False


def _of_kind(kind: str, e: Equilibrium, event: Any) -> EquilibriumCondition:
    if kind == BOUNDARY:
        return Boundary(*(event or beyond_border(e, None)))
    return (Fold if kind == "fold" else Hopf if kind in HOPF else Layer)(kind)


def follow_equilibria(
    start: Any, kind: str | None, names: tuple[str, str], ranges: np.ndarray, how: How
) -> Branch:
    """The curve of a bifurcation of equilibria, to both sides (two_parameters.follow_curve)."""
    e, condition, begins = _condition(start, kind)
    problem = EquilibriumProblem(e, names, ranges, condition)
    found = problem.spot(problem.first * problem.sizes)
    if found is None:
        return Branch(names, ends=("the equations are not defined at the start.",), kind=condition.kind)
    condition.frame(found[0])
    first = problem.correct(problem.first, None, None)
    if first is None or not (begins or condition.genuine(first.spot)):
        return Branch(names, ends=(f"no {condition.kind} was found near to the start.",), kind=condition.kind)

    def begin(sign: float) -> tuple[EquilibriumCurveWay, EquilibriumPoint, EquilibriumPoint]:
        side, here = copy.copy(problem), replace(first, tangent=sign * first.tangent)
        side.condition = copy.deepcopy(condition)
        way = EquilibriumCurveWay(side, how)
        way.begins = begins
        return way, here, here

    return branch_of(*followed(begin, (-1.0, 1.0)), names, condition.kind)
