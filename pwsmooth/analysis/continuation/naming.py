"""Whether a special point of a branch has earned its name: what holds there, and on both sides of it.

    fold                        a multiplier 1, which goes through 1 while the branch turns as a parabola does
    flip, symmetry breaking     a multiplier -1
    branch point, torus         a multiplier 1, a pair on the unit circle
    grazings                    the rate of the surface vanishes where it is touched
    border collision            none of these: the slopes of the map jump, without an event that tells why
    corner                      no grazing: the surface is touched at a finite rate

A test function changes its sign where multipliers jump, too, and at a corner where a tangent turns. So multipliers are
looked at where the test vanishes, and once more with the orbit shot over in other pieces.

Chain: orbit_problem.py, itineraries.py -> **naming** -> bifurcations.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from ...definition.pointwise import value
from ...definition.regularity import total_derivative
from ...results.solution import Solution
from ..orbits.itineraries import Change, same_itinerary
from ..orbits.periodic_orbit import PeriodicOrbit
from .conditions.conditions import factors, on_circle
from .orbit_problem import JUMP_OF_SLOPES, OrbitPoint, OrbitProblem, in_other_pieces, slopes_apart

BORDER = "border collision"
TOUCHED = ("grazing", "grazing-sliding", "grazing impact", "grazing of an event")
BRACKET = 1e-12  # of the arc, in which a change of itinerary is enclosed
_NEARLY = 1e-3  # to 1 or -1: a multiplier at a located fold or flip
_SHARE = 0.3  # of a jump of the map's slopes: what is left of it between points as near as can be
_VANISHES = (
    1e-2  # of the largest rate of a surface along an orbit: a touch grows as the root of the distance from it
)
_SAMPLES = 30  # of an orbit, at which the rate of a surface is looked at


def has_multiplier(orbit: PeriodicOrbit, kind: str) -> bool:
    """Whether the multipliers are those of the kind, also where the orbit is shot over in other pieces.

    A test function changes its sign at a corner or where multipliers jump, too.
    """
    if not _on_locus(orbit.map_multipliers, kind):
        return False
    other = in_other_pieces(orbit)
    return other is None or _on_locus(other.map_multipliers, kind)


def _on_locus(mu: np.ndarray, kind: str) -> bool:
    if kind == "torus":
        return on_circle(mu)
    root = 1 if kind in ("fold", "branch point") else -1
    return bool(np.abs(mu - root).min(initial=np.inf) <= _NEARLY)


def turn_named(problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, point: OrbitPoint) -> str:
    """What a point is at which a branch turns back: a fold, if its multiplier goes through 1.

    If it only touches 1, another branch meets this one at its vertex. Empty where it stays 1: there the branch is a set
    of orbits at one value of the parameter.
    """
    chord = there.u - here.u
    part = float((point.u - here.u) @ chord / (chord @ chord))
    beside = [problem.along(here, there, part + side * min(part, 1 - part) / 2) for side in (-1, 1)]
    orbits = [(end if near is None else near).orbit for near, end in zip(beside, (here, there))]
    if any(orbit._at_rounding(1) for orbit in orbits):
        return ""
    values = [factors(orbit.map_multipliers, 1) for orbit in orbits]
    return "fold" if values[0] * values[1] < 0 else "branch point"


def border_between(
    problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint
) -> tuple[OrbitPoint, OrbitPoint] | None:
    """Two points of one itinerary, within the bracket of a change, between which the slopes of the map jump.

    None where they do not: a jump stays as large while its two sides come together.
    """
    jump = slopes_apart(problem, here, there)
    if not jump > JUMP_OF_SLOPES or here.orbit.degenerate or there.orbit.degenerate:
        return None
    left, right, low, high = here, there, 0.0, 1.0
    length = float(np.linalg.norm(there.u - here.u))
    while (high - low) * length > BRACKET * (1 + np.abs(here.u).max()):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        point = problem.along(here, there, middle, left)
        if point is None or not same_itinerary(here.orbit, point.orbit):
            return None
        before, behind = slopes_apart(problem, left, point), slopes_apart(problem, point, right)
        if max(before, behind) < _SHARE * jump:
            return None  # it bends, and does not jump
        if before < behind:
            low, left = middle, point
        else:
            high, right = middle, point
    a, b = (np.sort_complex(point.orbit.map_multipliers) for point in (left, right))
    apart = float(np.abs(a - b).max(initial=0.0)) / max(1.0, float(np.abs(a).max(initial=0.0)))
    jumps = slopes_apart(problem, left, right) > _SHARE * jump and apart > JUMP_OF_SLOPES
    return (left, right) if jumps else None


# ---- touches


def touches(change: Change, one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether the events that only one of two orbits has begin with a vanishing rate of their surface.

    It grows as the root of the distance from the touch. Where the motion has a corner as it comes to the surface, the
    rate stays finite.
    """
    letters, orbit = (change.before, one) if len(change.before) > len(change.after) else (change.after, other)
    first, period, begin = letters[0], orbit.period, 0.0
    best: tuple[float, Solution, float] | None = None
    for run in orbit.runs():
        for e in run.events:
            if e.switch == first.switch:
                phase = (begin + (e.time - run.t[0])) / period
                off = abs((phase - first.time + 0.5) % 1.0 - 0.5)
                if best is None or off < best[0]:
                    best = off, run, float(e.time)
        begin += float(run.t[-1] - run.t[0])
    if best is None:
        return True
    _, run, t = best
    rate = _rate_of(run.model, first.switch)
    if rate is None:
        return True
    column = int(np.searchsorted(run.t, t, side="left"))
    every = np.unique(np.linspace(0, len(run.t) - 1, _SAMPLES).astype(int))
    largest = max(abs(_at(rate, run, int(k))) for k in every)
    own = abs(_at(rate, run, column))
    apart = float(np.abs(one.x - other.x).max()) / _size(run) if one.x.shape == other.x.shape else 0.0
    return not own > (_VANISHES + 3 * math.sqrt(apart)) * largest


def _size(run: Solution) -> float:
    """Of a motion, in the unit of its largest state."""
    return float(np.abs(run.x).max(initial=0.0)) or 1.0


def _rate_of(model: Any, name: str) -> sp.Expr | None:
    """dh/dt of a switch, a contact or an event."""
    surfaces = {str(mu.symbol): mu.surface for mu in model.multipliers}
    surfaces |= {event.name: event.surface for event in model.events}
    h = surfaces.get(name)
    return None if h is None else total_derivative(h, model.time, model.states, model.rhs)


def _at(expression: sp.Expr, run: Solution, column: int) -> float:
    model = run.model
    symbols = (*model.states, *(mu.symbol for mu in model.multipliers))
    point = dict(zip(symbols, map(float, (*run.x[:, column], *run.mult[:, column]))))
    return value(expression, {**point, **run.system.parameters, model.time: float(run.t[column])})
