"""Bifurcations between two points of a branch of periodic orbits: located and named.

Fold, flip, symmetry breaking, branch point and torus are zeros of test functions between points of one itinerary:
tau_q, det(DP + 1), the same for the half-period map, det(DP - 1), and the product of mu_i mu_j - 1. A change of
itinerary is enclosed by bisection; itineraries.py says what it is, jumps.py where the map jumps.

Chain: orbit_problem.py, itineraries.py, jumps.py, naming.py -> **bifurcations** -> branches.py.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..orbits.finding import refined_to
from ..orbits.fixed_points import SAME
from ..orbits.itineraries import JUMP, Change, change_between, same_itinerary
from ..orbits.periodic_orbit import PeriodicOrbit
from .bracketing import zero_between
from .conditions.conditions import factors, pairs
from .jumps import jump_between
from .naming import BORDER, BRACKET, TOUCHED, border_between, has_multiplier, touches, turn_named
from .orbit_problem import OrbitPoint, OrbitProblem, unit_along
from .special import Special

P = TypeVar("P", bound=OrbitPoint)

_HALVINGS = 30  # of a step, in which a change of stability is enclosed that no test sees
ON_CIRCLE = 1e-7  # from 1: multipliers that may lie on either side
_SHARP = 0.95  # cosine between tangents: where a branch turns more within a step, its slopes may jump
_NEAR = 0.1  # to the unit circle: a multiplier that may be 1 or -1 but for roundings
# Of the arc, to either side of a change: there its events stand apart and can be named. What begins with the square
# root of the distance, as a slip at the end of a stick does, comes together only nearer; at a jump nothing does.
_APART = (1e-6, 1e-8, 1e-10)


def bifurcations_between(problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint) -> list[Special]:
    """All bifurcations on the way from one point of a branch to the next, located, named, in order.

    Test functions (Kuznetsov) are zeroed between points of one itinerary, and a change of itinerary is bisected.
    """
    bifurcations: list[Special] = []
    for _ in range(8):
        if same_itinerary(here.orbit, there.orbit):
            return bifurcations + _smooth_all(problem, here, there)
        left, right, part = change_enclosed(problem, here, there)
        if problem.late():
            return bifurcations
        left, right, width = _cornered(problem, here, there, left, right, part)
        for reach in _APART:
            apart = _apart(problem, here, there, left, right, reach)
            change = change_between(*(p.orbit for p in apart))
            if change.name != JUMP:
                break
        # So near to a grazing that the touch has no derivative, the orbits a little away have the multipliers.
        before, behind = (far if near.orbit.degenerate else near for near, far in zip((left, right), apart))
        bifurcations += _smooth_all(problem, here, before)
        if change.name == "lift-off":
            # The flight is as high as the square of the distance from it: lower than roundings it is none.
            width = max(width, math.sqrt(np.finfo(float).eps) * (1 + abs(problem.value(left))))
        if not of_no_effect(change, *(p.orbit for p in apart)):
            if change.name == JUMP and (found := jump_between(problem, left, right)) is not None:
                found = replace(found, change=found.change or change, beyond=behind.orbit)
                return [*bifurcations, found]
            if change.name in TOUCHED and not touches(change, *(p.orbit for p in apart)):
                change = replace(change, name="corner")
            one = Special(change.name, problem.values(left), left.orbit, width, behind.orbit, change=change)
            bifurcations = _with(bifurcations, one)
        here = behind
    return bifurcations


def _with(found: list[Special], one: Special) -> list[Special]:
    """With another change of itinerary: as one with the change before, if no parameter lies between them."""
    last = found[-1] if found else None
    if last is not None and last.change is not None and last.beyond is not None and one.beyond is not None:
        width = last.uncertainty + one.uncertainty
        if abs(last.parameter - one.parameter) <= width:
            both = change_between(last.point, one.beyond)
            if both.name != JUMP:
                if both.name in TOUCHED and not touches(both, last.point, one.beyond):
                    both = replace(both, name="corner")
                return [
                    *found[:-1],
                    replace(last, kind=both.name, uncertainty=width, change=both, beyond=one.beyond),
                ]
    return [*found, one]


def of_no_effect(change: Change, one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether independent events change their order: the map has the same derivative at two orbits so little apart."""
    if change.name != "change of order":
        return False
    unit = unit_along(one)
    a, b = (orbit.jacobian * unit / unit[:, None] for orbit in (one, other))
    return bool(np.abs(a - b).max(initial=0.0) <= 100 * _APART[0] * np.abs(a).max(initial=0.0))


def collapse_between(
    problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, bifurcations: list[Special]
) -> tuple[int, list[Special]] | None:
    """Where orbits of several applications of the map shrink onto one of fewer: how many, and what happens to that one.

    A doubled branch ends at the flip from which it comes. Its arc goes on, as it must: through a fold to the same
    orbits half a turn later, or on to the shorter orbit itself, run through twice. None where nothing of this is seen.
    """
    for count in range(1, problem.map.count):
        if problem.map.count % count == 0 and (near := _shrunk(problem, here, there, count)) is not None:
            break
    else:
        return None
    short, x = near
    orbit = refined_to(short.orbit, count, x)
    if not orbit.success:
        return count, []
    single = OrbitProblem(orbit, problem.name, problem.scale, problem.unit)
    at = single.point(orbit, (there.u - here.u)[[*range(len(orbit.x)), -1]])
    # The shorter orbit lives on both sides of the collapse: from well behind it to well before.
    q = [problem.value(p) for p in (here, there)]
    if short is here:
        turn = next((b.parameter for b in bifurcations if b.kind == "fold"), q[1])
        q = [turn + 2 * (max(q, key=lambda value: abs(value - turn)) - turn) * side for side in (1, -1)]
    before, behind = (single.at(at, single.place, value / single.scale) for value in q)
    if before is None or behind is None:
        return count, []
    return count, bifurcations_between(single, before, behind)


def _shrunk(
    problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, count: int
) -> tuple[OrbitPoint, np.ndarray] | None:
    """Where the way to the next point leads onto or through an orbit of `count` applications, and a guess of it."""
    steps = [(p.orbit.after(count) - p.orbit.x) / problem.unit for p in (here, there)]
    sizes = [np.linalg.norm(step) for step in steps]
    if sizes[1] <= SAME * (1 + np.linalg.norm(there.orbit.x / problem.unit)):
        return there, there.orbit.x
    # Through it the branch comes to the same orbits, `count` applications later, and turns back.
    turns = steps[0] @ steps[1] < -0.5 * sizes[0] * sizes[1] and here.tangent[-1] * there.tangent[-1] < 0
    if not turns:
        return None
    return here, here.orbit.x + (there.orbit.x - here.orbit.x) * sizes[0] / (sizes[0] + sizes[1])


def change_enclosed(problem: OrbitProblem, here: P, there: P) -> tuple[P, P, float]:
    """The first change of itinerary, enclosed between two points, and their distance as a part of the chord."""
    low, high, left, right = 0.0, 1.0, here, there
    length = np.linalg.norm(there.u - here.u)
    while (high - low) * length > BRACKET * (1 + np.abs(here.u).max()):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        point: Any = problem.along(here, there, middle, left)
        if point is not None and same_itinerary(here.orbit, point.orbit):
            low, left = middle, point
        else:
            # No orbit at all is a change too: beside a corner the chord's plane can miss the branch.
            high, right = middle, point or right
    return left, right, high - low


def _cornered(
    problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, left: OrbitPoint, right: OrbitPoint, part: float
) -> tuple[OrbitPoint, OrbitPoint, float]:
    """The points about a change, nearer where their gap tells of a corner; half the width of the bracket."""
    width = part * abs(there.u[-1] - here.u[-1])
    gap = float(np.linalg.norm(right.u - left.u))
    if gap > 1e3 * BRACKET * (1 + np.abs(here.u).max()):
        # At a corner both sides lead to it, each along its own tangent.
        left = _last(problem, left, left.tangent, 4 * gap)
        back = right.tangent if right.tangent @ (left.u - right.u) > 0 else -right.tangent
        right = _last(problem, right, back, 4 * gap)
        width += abs(right.u[-1] - left.u[-1])
    return left, right, width * problem.scale


def _last(problem: OrbitProblem, point: OrbitPoint, way: np.ndarray, length: float) -> OrbitPoint:
    """The last point of the same itinerary on the way along a tangent."""
    first, low, high = point, 0.0, length
    while high - low > BRACKET * (1 + np.abs(point.u).max()):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        guess = point.u + (middle - low) * way
        further = problem.correct(guess, way, first.tangent)
        if further is not None and same_itinerary(first.orbit, further.orbit):
            low, point = middle, further
        else:
            high = middle
    return point


def _apart(
    problem: OrbitProblem,
    here: OrbitPoint,
    there: OrbitPoint,
    left: OrbitPoint,
    right: OrbitPoint,
    reach: float,
) -> list[OrbitPoint]:
    """Points of the two itineraries a little away from the change."""
    found = []
    for point, end in ((left, here), (right, there)):
        chord = end.u - point.u
        length = float(np.linalg.norm(chord))
        way = chord / length if length > 0 else point.tangent
        further = problem.correct(point.u + min(reach, length) * way, way, end.tangent)
        same = further is not None and same_itinerary(further.orbit, point.orbit)
        found.append(further if same and further is not None else point)
    return found


def _smooth_all(problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, depth: int = 0) -> list[Special]:
    """Bifurcations of stability between two points of one itinerary, by halves where the tests miss one.

    Two zeros of one test have no change of sign between them, and near a branch point Newton's method may fail: then
    more multipliers come to lie outside of the unit circle than what was found explains.
    """
    found, earned = _smooth(problem, here, there)
    outside = [_outside(point.orbit) for point in (here, there)]
    if None in outside:
        explained = True
    else:
        off = abs(outside[1] - outside[0]) - sum(2 if one.kind == "torus" else 1 for one in found)  # type: ignore[operator]
        explained = off <= 0 and off % 2 == 0
    if earned and explained and here.tangent @ there.tangent > _SHARP:
        return found
    if (border := border_between(problem, here, there)) is not None:
        left, right = border
        before, behind = (_smooth(problem, *ends)[0] for ends in ((here, left), (right, there)))
        return [*before, _at_border(problem, left, right), *behind]
    if explained:
        return found
    # A chord's middle may be the branch point itself, where Newton's method fails.
    parts = (problem.along(here, there, part, here) for part in (0.5, 0.4))
    middle = next((point for point in parts if point is not None), None)
    if depth >= _HALVINGS or middle is None or not same_itinerary(here.orbit, middle.orbit):
        return found or _unnamed(problem, here, there, here)
    if _outside(middle.orbit) is None:
        return found or _unnamed(problem, here, there, middle)
    return _smooth_all(problem, here, middle, depth + 1) + _smooth_all(problem, middle, there, depth + 1)


def _outside(orbit: PeriodicOrbit) -> int | None:
    """How many multipliers lie outside of the unit circle; None where one lies on it."""
    sizes = np.abs(orbit.map_multipliers)
    off = np.abs(sizes - 1).min(initial=np.inf)
    if off < ON_CIRCLE or off < _NEAR and any(orbit._at_rounding(root) for root in (1, -1)):
        return None
    return int(np.sum(sizes > 1))


def undecided(here: OrbitPoint, there: OrbitPoint, kind: str) -> bool:
    """Whether a point has the multiplier of a bifurcation but for roundings: a change of sign there means nothing."""
    root = 1 if kind in ("fold", "branch point") else -1
    return any(point.orbit._at_rounding(root) for point in (here, there))


def _unnamed(problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, at: OrbitPoint) -> list[Special]:
    """The change of stability between two points, named by the multiplier that is nearest to the unit circle."""
    mu = at.orbit.map_multipliers
    critical = mu[np.argmin(np.abs(np.abs(mu) - 1))]
    if abs(critical.imag) > 1e-6:
        kind = "torus"
    elif critical.real > 0:
        kind = "fold" if here.tangent[-1] * there.tangent[-1] < 0 else "branch point"
    else:
        kind = "symmetry breaking" if here.orbit.symmetric else "flip"
    width = max(abs(problem.value(end) - problem.value(at)) for end in (here, there))
    if not has_multiplier(at.orbit, kind):
        return []
    return [Special(kind, problem.values(at), at.orbit, width)]


def _smooth(problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint) -> tuple[list[Special], bool]:
    """Bifurcations of stability between two points of one itinerary that change the sign of their tests.

    And whether all that change it have earned their name.
    """
    bifurcations, earned = [], True
    symmetric = here.orbit.symmetric
    tests = {
        "fold": lambda p: p.tangent[-1],
        "symmetry breaking" if symmetric else "flip": lambda p: factors(p.orbit.map_multipliers, -1),
        "branch point": lambda p: factors(p.orbit.map_multipliers, 1),
        "torus": lambda p: pairs(p.orbit.map_multipliers),
    }
    for kind, test in tests.items():
        a, b = test(here), test(there)
        if not (a * b < 0) or kind != "torus" and undecided(here, there, kind):
            continue
        if kind == "branch point" and here.tangent[-1] * there.tangent[-1] < 0:
            continue  # the same zero as the fold's
        point = zero_between(problem, here, there, test)
        if point is not None and kind == "fold" and has_multiplier(point.orbit, kind):
            kind = turn_named(problem, here, there, point)
        if point is None or not kind or not has_multiplier(point.orbit, kind):
            earned = False
            continue
        # Multipliers and tangents are known to some 1e-10; that over the slope of the test function.
        width = 1e-10 * max(abs(problem.value(there) - problem.value(here)) / abs(b - a), 1.0)
        bifurcations.append(Special(kind, problem.values(point), point.orbit, width))
    return sorted(bifurcations, key=lambda b: np.linalg.norm(b.point.x - here.orbit.x)), earned


def _at_border(problem: OrbitProblem, left: OrbitPoint, right: OrbitPoint) -> Special:
    """A border that the orbit crosses without an event of its own, as in a condition that an event reads."""
    # Both sides lead to it, each along its own tangent; a branch that turns there has no points between them.
    gap, ways = right.u - left.u, np.column_stack([left.tangent, -right.tangent])
    reach = np.linalg.lstsq(ways, gap, rcond=None)[0]
    off = float(np.linalg.norm(ways @ reach - gap) + np.linalg.norm(gap) ** 2)
    met = float(left.u[-1] + reach[0] * left.tangent[-1]) * problem.scale
    apart = max(abs(problem.value(right) - problem.value(left)), 1e-10 * problem.scale)
    at, width = (
        (met, off * problem.scale + 1e-10 * problem.scale)
        if off < 1e-2 * apart / problem.scale
        else (problem.value(left), apart)
    )
    what = Change(BORDER, (), (), 0.0)
    return Special(BORDER, {problem.name: at}, left.orbit, width, right.orbit, change=what)
