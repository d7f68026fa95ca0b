"""Curves of bifurcations of equilibria in two parameters.

    F(u) = (f, h_J) = 0,   c(u) = 0,   tau . (u - u0) = ds,   u = (x, lam_J, p, q),   each in a unit of its own

c is that of equilibrium_conditions.py. Where the equilibrium comes to the border of its mode, the curve ends: beyond it
is virtual.

Chain: equilibrium_ways.py, equilibrium_branches.py -> **equilibrium_curves** -> curves.py.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....door.documenting import complete
from ...equilibria.equilibrium import Equilibrium
from ..codimension import Codimension2
from ..plane import InPlane
from ..way import Lengths, Way, followed
from .branch import EquilibriumBifurcation
from .conditions import BOUNDARY, HOPF, LAYER, Boundary, EquilibriumCondition, Fold, Hopf, Layer
from .problem import EquilibriumPoint, EquilibriumProblem
from .ways import EquilibriumCurveWay, beyond_border

__all__ = ["EquilibriumCurve"]

FOLLOWED = ("fold", *HOPF, *LAYER, BOUNDARY)


@complete
@dataclass(repr=False)
class EquilibriumCurve(InPlane):
    """A curve of bifurcations of equilibria in two parameters.

    Attributes
    ----------
    kind : str
        Of the bifurcation, as of `EquilibriumBifurcation`; all boundary equilibria are "boundary equilibrium".
    parameters : tuple of str
        The names of both.
    equilibria : list of Equilibrium
        In order along the curve.
    points : list of Codimension2
        Where a second condition holds, in order along the curve: "cusp", "Bogdanov-Takens", "generalised Hopf", "hidden
        cusp", or two conditions that meet.
    ends : tuple of str
        Why it ended in either direction, in words.
    turns : list of Codimension2
        Where it turns back in one of the parameters.
    tests : dict of str to ndarray, each of shape (number of points,), dimensionless
        Functions along the curve that vanish at points of codimension 2, by their names.

    Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the names.

    >>> x, a, b = sp.symbols("x a b", real=True)
    >>> cubic = System({x: a + b * x - x**3}, parameters={a: 1, b: 1})
    >>> (fold, _) = follow(find_equilibrium(cubic, {x: 1.3}), {a: -1}, steps=Steps(first=0.1)).bifurcations
    >>> curve = follow(fold, {a: (-1, 1), b: (-1, 1)})
    >>> [point.name for point in curve.points], curve.ends
    (['cusp'], ('reached b = 1.', 'reached b = 1.'))
    """

    equilibria: list[Equilibrium] = field(default_factory=list)

    _noun = "equilibria"

    @property
    def _items(self) -> list[Any]:
        return self.equilibria

    def _columns(self) -> dict[str, Any]:
        names = [str(mu.symbol) for mu in self.equilibria[0].system.model.multipliers]
        return {
            **dict(zip(names, np.array([e.mult for e in self.equilibria]).T)),
            "rightmost_eigenvalue": [e.eigenvalues.real.max(initial=-math.inf) for e in self.equilibria],
        }


def _condition(start: Any, kind: str | None) -> tuple[Equilibrium, EquilibriumCondition, bool]:
    """The equilibrium, the condition, and whether the curve begins at a point of codimension 2."""
    if isinstance(start, Codimension2):
        lead = start.lead(kind)
        return lead.cut[0], _of_kind(lead.kind, lead.cut[0], lead.event), True
    if isinstance(start, EquilibriumBifurcation):
        own = BOUNDARY if start.kind.startswith(BOUNDARY) else start.kind
        if kind not in (None, own):
            raise ValueError(f"`kind` is {kind!r}, but `start` is a {start.kind}; leave `kind` out.")
        if own not in FOLLOWED:
            raise ValueError(f"`start` is a {start.kind}; followed are {', '.join(FOLLOWED)}.")
        e, event = start.equilibrium, None
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
    start: Any, kind: str | None, names: tuple[str, str], ranges: np.ndarray, lengths: Lengths, most: int,
    virtual: bool, stops: Callable[[Way], str],
) -> EquilibriumCurve:  # fmt: skip
    """The curve of a bifurcation of equilibria, to both sides (two_parameters.follow_curve)."""
    e, condition, begins = _condition(start, kind)
    curve = EquilibriumCurve(condition.kind, names)
    problem = EquilibriumProblem(e, names, ranges, condition)
    found = problem.spot(problem.first * problem.sizes)
    if found is None:
        curve.ends = ("the equations are not defined at the start.",)
        return curve
    condition.frame(found[0])
    first = problem.correct(problem.first, None, None)
    if first is None or not (begins or condition.genuine(first.spot)):
        curve.ends = (f"no {condition.kind} was found near to the start.",)
        return curve

    def begin(sign: float) -> tuple[EquilibriumCurveWay, EquilibriumPoint, EquilibriumPoint]:
        side, here = copy.copy(problem), replace(first, tangent=sign * first.tangent)
        side.condition = copy.deepcopy(condition)
        way = EquilibriumCurveWay(side, lengths, most, stops, virtual)
        way.begins = begins
        return way, here, here

    way, ends = followed(begin, (-1.0, 1.0))
    curve.equilibria = [point.equilibrium for point in way.points]
    curve.points, curve.turns, curve.ends = way.specials, way.turns, tuple(ends)
    curve.tests = {name: np.array([p.tests.get(name, math.nan) for p in way.points]) for name in first.tests}
    return curve
