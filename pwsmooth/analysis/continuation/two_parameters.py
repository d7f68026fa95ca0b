"""Curves in two parameters along which a bifurcation of periodic orbits persists.

    P(x; p, q) = x,   c(x, p, q, e) = 0,   tau . (u - u0) = ds,   u = (x, p/scale, q/scale, e)

c says which bifurcation (conditions.py); points at which a second condition holds are located and named. Every orbit is
one of the exact system: where the itinerary changes the curve says so, and ends where the bifurcation does.

Chain: curves/ways.py, equilibria/curves.py -> **two_parameters** -> following.py.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...door import checks
from ..equilibria.equilibrium import Equilibrium
from ..maps.impacts import FromEvent
from .branch import Branch, branch_of
from .conditions.conditions import Condition
from .curves.problem import CurveProblem, Spot
from .curves.starts import condition_of, given
from .curves.ways import CurveWay
from .equilibria.curves import follow_equilibria
from .special import Lead, Special
from .way import How, followed

# Of the scaled unknowns: Newton's method is not trusted so far from a start; the steps instead.
_FAR, _PARTS = 0.1, 10
# Of the states' size, to both sides: at which what is born at a point is looked for.
_AMPLITUDES = (0.02, -0.02, 0.06, -0.06, 0.2, -0.2)
_ASIDE = 1e-4  # of the arc: so far along it is seen whether a curve begins


def follow_curve(start: Any, over: Mapping[Any, Any], kind: str | None, switch: Any, how: How) -> Branch:
    """The curve of a bifurcation over two parameters, to both sides."""
    still = start.point if isinstance(start, Special) else start
    if isinstance(still, Equilibrium):
        return follow_equilibria(start, kind, *_in_ranges(over, still.system), how)
    orbit, name, lead = given(start, kind, switch)
    names, ranges = _in_ranges(over, orbit.system)
    return _both_sides(lead, condition_of(lead, name, names), names, ranges, how)


def _in_ranges(over: Mapping[Any, Any], system: Any) -> tuple[tuple[str, str], np.ndarray]:
    """The names of both parameters and the bounds, which hold the system's values."""
    known = system.parameters
    names = tuple(checks.lookup(key, known, "`over`", "parameter").name for key in over)
    if len(set(names)) != 2:
        raise ValueError(f"`over` names {', '.join(map(str, over)) or 'nothing'}; give two parameters.")
    bounds = np.array([checks.interval(pair, f"`over` of {key}") for key, pair in over.items()])
    first = np.array([next(float(v) for p, v in known.items() if p.name == q) for q in names])
    if not np.all((bounds[:, 0] <= first) & (first <= bounds[:, 1])):
        at = ", ".join(f"{q} = {value:.9g}" for q, value in zip(names, first))
        raise ValueError(f"`over` leaves out the start, {at}; give ranges that hold it.")
    return (names[0], names[1]), bounds


def _both_sides(lead, condition, names, bounds, how) -> Branch:
    begun = _begun(lead, condition, names, bounds)
    if isinstance(begun, str):
        return Branch(names, ends=(begun,), kind=condition.kind)
    problem, first = begun
    problem.framed(first)
    if lead.direction is None:  # nearly along the curve itself, the nearest point may be far
        first = problem.correct(first.u, None, first.tangent) or first
    if not isinstance(problem.map, FromEvent):
        first = problem.segmented(first)  # what grows in a window or beside it did not for the branch

    def begin(sign: float) -> tuple[CurveWay, Spot, Spot]:
        side, here = copy.copy(problem), replace(first, tangent=sign * first.tangent)
        side.condition = copy.deepcopy(problem.condition)
        way = CurveWay(side, how)
        if lead.begins:
            way.born, way.end = here, _begins(side, here, lead, how.virtual)
        return way, here, here

    return branch_of(*followed(begin, (-1.0, 1.0)), names, condition.kind)


def _begun(lead: Lead, condition: Condition, names: tuple[str, str], bounds: np.ndarray) -> Any:
    """The problem of a curve and its first point; in words why there is none."""
    map_, x, held = lead.cut
    n, widths = len(x), bounds[:, 1] - bounds[:, 0]
    given_ = {p.name: value for p, value in map_.system.parameters.items()}
    middle = bounds.mean(axis=1) / widths
    for amplitude in (0.0,) if lead.direction is None else _AMPLITUDES:
        problem = CurveProblem(map_, condition, names, bounds, x, held)
        at = x if lead.direction is None else x + amplitude * (1 + np.abs(x).max()) * lead.direction
        w = np.append(at, [given_[q] for q in names])
        place = problem.map_at(w)
        if place is None:
            continue
        extra = condition.start(place)
        u = np.append(w, lead.extra or extra) / problem.sizes
        # The nearest point, or that with one of the parameters as it is: Newton's method may lead far from a far start.
        off, normals = condition.value(place, u[n + 2 :]), [None, *np.eye(len(u))[n : n + 2]]
        if lead.direction is not None:
            normals = [np.append(lead.direction, np.zeros(len(u) - n))]
        tried = [_nearer(problem, u, normal, off) for normal in normals]
        inside = [s for s in tried if s is not None and np.all(np.abs(s.at - middle) <= 0.5 + 1e-9)]
        if inside:
            return problem, min(inside, key=lambda spot: np.linalg.norm(spot.at - u[n : n + 2]))
    return f"no {condition.kind} was found near to the start."


def _begins(problem: CurveProblem, here: Spot, lead: Lead, virtual: bool) -> str:
    """Whether a curve that begins at a point of codimension 2 begins at this end, in words; empty where it goes on."""
    there: Any = problem.step(here, _ASIDE)
    if there is None:
        return ""
    if lead.direction is not None:
        grown = (
            (there.orbit.x - here.orbit.x) @ lead.direction * ((here.orbit.x - lead.cut[1]) @ lead.direction)
        )
        return f"it begins near {problem.where(here)}." if grown < 0 else ""
    place = problem.place_at(there)
    if virtual or place is None or not problem.condition.beyond(place, there.extra):
        return ""
    return f"it begins at {problem.where(here)}."


def _nearer(problem: CurveProblem, u: np.ndarray, normal: np.ndarray | None, off: np.ndarray) -> Spot | None:
    """The first point of a curve, at once or with c in parts of what it is at the start; `normal` keeps an entry."""
    spot = problem.correct(u, normal, None)
    if spot is not None and np.linalg.norm(spot.u - u) < _FAR:
        return spot
    way = copy.copy(problem)
    for part in np.linspace(1, 0, _PARTS + 1)[1:]:
        way.offset = part * off
        near = way.correct(u, normal, None)
        if near is None:
            return spot
        u, spot_at_part = near.u, near
    return spot_at_part
