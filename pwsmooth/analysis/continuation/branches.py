"""Branches of periodic orbits over one parameter, and the door to those of equilibria.

Every point is a trajectory of the exact system: where the itinerary changes, the branch goes on through the change if
the orbit does, and the change is located and named (itineraries.py). Where no orbit is found beyond a point, the
branch ends there and says why; nothing is continued on the far side of a surface.

Chain: orbit_problem.py, way.py, bifurcations.py, equilibria/branches.py -> **branches** -> following.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...door import checks
from ..equilibria.equilibrium import Equilibrium
from ..maps.sections import Stroboscopic, depends_on_time
from ..maps.symmetry import repeats_in
from ..orbits.fixed_points import not_repeated
from ..orbits.itineraries import JUMP
from ..orbits.periodic_orbit import PeriodicOrbit, none_found
from .bifurcations import bifurcations_between, collapse_between
from .branch import Branch, branch_of
from .equilibria.branches import coordinate, follow_equilibrium, value_at
from .jumps import end_at
from .orbit_problem import OrbitPoint, OrbitProblem, in_units, leaves, same_state, unit_along, value_of
from .special import CAPTURE, Special
from .way import How, Way, followed, used_up

__all__ = ["branch_off"]


def follow_branch(
    start: PeriodicOrbit | Equilibrium, parameter: Any, to: Any, way: int | None, how: How
) -> Branch:
    """The branch of an orbit or an equilibrium over a parameter, or of a set of equilibria along a state."""
    if not start.success:
        raise ValueError(f"`start` did not converge: {start.message}")
    if isinstance(start, Equilibrium):
        name = coordinate(start, parameter)
        at = value_at(start, name)
    else:
        if how.virtual:
            raise ValueError(
                "`virtual` is for equilibria; orbits are trajectories of the exact system. Leave it out."
            )
        name = checks.lookup(parameter, start.system.parameters, "`over`", "parameter").name
        start = _by_shorter_periods(start)
        at = value_of(start, name)
    ranges, signs = _ways(name, at, to, way)
    if isinstance(start, Equilibrium):
        return follow_equilibrium(start, name, ranges, signs, how)
    return branch_of(*followed(lambda sign: begin_orbits(start, name, ranges, sign, how), signs), (name,))


def begin_orbits(
    orbit: PeriodicOrbit, name: str, ranges: tuple[float, float], sign: float, how: How
) -> tuple[OrbitWay, OrbitPoint, OrbitPoint]:
    """The way to larger (1) or smaller (-1) values, its first point, and that on a section away from events."""
    problem = OrbitProblem(orbit, name, ranges[1] - ranges[0], ranges=ranges)
    problem.until = how.until
    first = problem.point(orbit, np.append(np.zeros(len(orbit.x)), sign))
    return OrbitWay(problem, how), first, problem.rephased(first)


def _ways(name: str, at: float, to: Any, way: int | None) -> tuple[tuple[float, float], tuple[float, ...]]:
    """The range, and the signs of the ways that a branch goes from its start."""
    if np.ndim(to) == 0:
        to = checks.number(to, f"`over` of {name}")
        if to == at:
            raise ValueError(f"`over` of {name} is {to:g}, where the start already is; give another value.")
        if way is not None:
            raise ValueError(
                f"`way` is for a range, and `over` of {name} is {to:g}; leave it out, or give (least, largest)."
            )
        (low, high), signs = sorted((at, to)), (1.0 if to > at else -1.0,)
    else:
        low, high = checks.interval(to, f"`over` of {name}")
        if not low <= at <= high:
            raise ValueError(
                f"`over` of {name} goes from {low:g} to {high:g}, and the start is at {at:g}; give a range that holds "
                "it."
            )
        signs = tuple(sign for sign, end in ((-1.0, low), (1.0, high)) if end != at and way in (None, sign))
        if not signs:
            raise ValueError(
                f"`way` is {way}, and the start is at this end of the range of {name}; give the other one."
            )
    if high - low > 1e100:
        raise ValueError(
            f"`over` of {name} reaches {to:g}, so far from {at:g} that no derivative has that scale; give less."
        )
    return (low, high), signs


def _by_shorter_periods(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """An orbit that was given by a multiple of the forcing's period, as one of several applications of its map.

    Else nothing tells that its branch turns, at a flip, onto the same orbits some periods later.
    """
    map_, x = orbit.map, orbit.x
    if not isinstance(map_, Stroboscopic) or map_.symmetry is not None or orbit.segments is not None:
        return orbit
    if not depends_on_time(orbit.system.model):
        return orbit
    for parts in (2, 3, 5):
        if repeats_in(orbit.system, map_.forcing_period / parts):
            single = replace(map_, period=map_.period / parts, phase=map_.phase * parts, count=1)
            if not same_state(single.image(x).x, x, map_.unit):
                return _by_shorter_periods(replace(orbit, map=replace(single, count=parts * map_.count)))
    return orbit


class OrbitWay(Way):
    """A branch of orbits to one side."""

    problem: OrbitProblem
    corner = False  # whether the next point is one around a corner

    def around(self, here: OrbitPoint) -> OrbitPoint | None:
        self.corner = True
        return self.problem.turn(here, self.ds)

    def met(self, here: OrbitPoint, there: OrbitPoint) -> OrbitPoint | None:
        problem, corner, self.corner = self.problem, self.corner, False
        if broken := not_repeated(there.orbit):
            self.end = f"at {problem.where(there)} there is {broken}"
            return None
        found = bifurcations_between(problem, here, there)
        if problem.late():  # what was found then is not known to be complete
            self.end = used_up(self)
            return None
        if corner and not any(b.change is not None for b in found):
            return None  # it has turned back without a corner
        if any(b.kind == JUMP for b in found):
            return (
                None  # the step has come to another branch: a shorter one keeps to this one, or finds its end
            )
        shorter = collapse_between(problem, here, there, found)
        if shorter is not None:
            # Without ends the step leads elsewhere: to the same orbits some periods later, or to another branch.
            count, ends = shorter
            self.add(ends)
            self.end = _collapse_in_words(problem, count, ends) if ends else ""
            return None
        self.add(found)
        if found and found[-1].jumps:
            what = "a contact is just captured" if found[-1].kind == CAPTURE else "a stick is just parted"
            at = f"{problem.name} = {found[-1].parameter:.10g}"
            self.end = f"no orbit beyond {at}: there {what}, and the Poincare map jumps."
            return None
        return _away(problem, here, there, found)

    def moved_on(self, there: OrbitPoint) -> OrbitPoint:
        here = self.problem.rescaled(self.problem.rephased(there))
        if there.orbit.segments is None and here.orbit.segments is not None:
            self.points[-1] = replace(there, orbit=here.orbit)  # the same one, better known
        return here

    def compared(self, point: OrbitPoint) -> tuple[np.ndarray, np.ndarray]:
        orbit = point.orbit
        phases = {getattr(p.orbit.map, "phase", None) for p in (self.points[0], point)}
        alike = orbit.segments is None and len(phases) == 1
        return (point.u, point.tangent) if alike else (point.u[:0], point.tangent[:0])

    def lost(self, here: OrbitPoint) -> None:
        """Why no step leads on, in words; what the branch ends at, if that has a name, is its last special point."""
        problem = self.problem
        if self.how.stops(self) or problem.late():
            self.end = used_up(self)
            return
        found = end_at(problem, here, 100 * self.ds * problem.scale)
        if found is None:
            self.end = problem.why_ended(here, self.ds)
            return
        self.add([found])
        why = f"{found.at_saddles}." if found.saddles else (
            "no orbit was found beyond it. `follow` goes on with it over two parameters."
        )  # fmt: skip
        self.end = f"{found.kind} at {problem.name} = {found.parameter:.10g}: {why}"


def _away(problem: OrbitProblem, here: OrbitPoint, there: OrbitPoint, found: list[Special]) -> OrbitPoint:
    """The point, its tangent away from a corner on the way to it: beyond an acute one the old tangent tells nothing."""
    corner = next((b.beyond for b in reversed(found) if b.beyond is not None), None)
    if corner is None or there.tangent @ here.tangent >= 0.8:
        return there
    if (1 if corner.segments is None else len(corner.segments)) * len(corner.x) + 1 != len(there.u):
        return there
    way = there.u - problem.unknowns(corner)
    return replace(there, tangent=-there.tangent) if way @ there.tangent < 0 else there


def _collapse_in_words(problem: OrbitProblem, count: int, ends: list[Special]) -> str:
    orbits = f"the orbits of {problem.map.count} applications of the map shrink onto one of {count}"
    kinds = " and ".join(f"{b.kind} at {problem.name} = {b.parameter:.10g}" for b in ends)
    return f"{orbits}: {kinds} of that one, which `specials[-1].point` is."


@checks.door(bifurcation=checks.instance(Special, "one of a branch's `specials`"), amplitude=checks.nonzero)
def branch_off(bifurcation: Special, amplitude: float = 1e-2) -> PeriodicOrbit:
    """An orbit on the branch that begins at a flip, where the symmetry breaks, or at a branch point.

    Parameters
    ----------
    bifurcation : Special
        Of kind "flip", "symmetry breaking" or "branch point".
    amplitude : float, in the units of the states
        Distance from the old orbit along the critical eigenvector, not 0; the parameter follows from it. The other
        sign is the other side: where the symmetry breaks, the mirror image.

    Returns
    -------
    PeriodicOrbit
        Of the doubled map (at a branch point of the same), at its own parameter value; `success` False if none was
        found.

    Raises
    ------
    ValueError
        Another kind of bifurcation.

    Notes
    -----
    At a branch point at which both branches cross the plane across the eigenvector it may be one of the stem.

    Source: Kuznetsov, Elements of Applied Special Theory, for the eigenvector as predictor.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 2.8}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> orbit = find_orbit(logistic, {x: 0.6}, seen=Strobe(1, phase=0.5))
    >>> (flip,) = follow(orbit, {a: 3.3}).specials
    >>> cycle = branch_off(flip, 0.02)
    >>> cycle.success, cycle.map.count, cycle.stable
    (True, 2, True)
    """
    if bifurcation.kind not in ("flip", "symmetry breaking", "branch point"):
        raise ValueError(
            f"`bifurcation` is a {bifurcation.kind}; branches begin at a flip, a symmetry breaking or a branch point."
        )
    old, beside = bifurcation.point, bifurcation.kind == "branch point"
    if not isinstance(old, PeriodicOrbit):
        raise ValueError(
            f"`bifurcation` is a {bifurcation.kind} of no orbit; give one of a branch of orbits, or of a diagram that "
            "was not read from a file."
        )
    ((name, at),) = bifurcation.values.items()
    doubled, x, direction = _critical(old) if beside else _doubled(old)
    problem = OrbitProblem(doubled, name, 1.0, unit_along(old))
    normal = np.append(direction / problem.units, 0.0)
    normal /= np.linalg.norm(normal)
    begun = np.append(x, at) / problem.sizes
    guess = begun + np.append(amplitude * direction, 0.0) / problem.sizes
    point = problem.correct(guess, normal, normal)
    lost = "give another `amplitude`, a smaller one as a rule."
    if point is None:
        return none_found(doubled.map, old.x, f"no orbit was found on the branch at this distance: {lost}")
    orbit = in_units(point.orbit, problem.unit)
    quarter = leaves(problem, begun, bifurcation.uncertainty, point, normal)
    # The critical multiplier leaves 1 as the square of the amplitude, and has not come as far as 0.
    if quarter is None or not np.abs(quarter.orbit.map_multipliers - 1).min(initial=np.inf) < 1 / 16:
        return replace(orbit, success=False, message=f"found was an orbit far from the bifurcation: {lost}")
    if beside:
        return orbit
    if orbit.segments is None:
        once = old.map.with_parameters({name: value_of(orbit, name)})(orbit.x)
    else:
        half = orbit.segments.nodes[len(orbit.segments) // 2]
        once = half if (G := getattr(old.map, "symmetry", None)) is None else np.linalg.solve(G, half)
    if same_state(once, orbit.x, problem.unit):
        return replace(orbit, success=False, message=f"found was an orbit of the branch's own stem: {lost}")
    return orbit


def _critical(old: PeriodicOrbit) -> tuple[PeriodicOrbit, np.ndarray, np.ndarray]:
    """An orbit, its points, and how these move along the eigenvector of the multiplier 1, 1 on the section."""
    if old.segments is not None:
        direction = old.segments.eigenvector(1.0)
        return old, old.segments.nodes.ravel(), (direction / np.linalg.norm(direction[0])).ravel()
    values, vectors = np.linalg.eig(old.jacobian)
    direction = vectors[:, np.argmin(np.abs(values - 1))].real
    return old, old.x, direction / np.linalg.norm(direction)


def _doubled(old: PeriodicOrbit) -> tuple[PeriodicOrbit, np.ndarray, np.ndarray]:
    """An orbit run through twice, its points, and how these move along the critical eigenvector, 1 on the section."""
    map_, segments = old.map.doubled(), old.segments
    if segments is None:
        values, vectors = np.linalg.eig(old.jacobian)
        direction = vectors[:, np.argmin(np.abs(values + 1))].real
        twice = PeriodicOrbit(map_, old.x, 0.0, old.jacobian, (), old.time, 0, True, "")
        return twice, old.x, direction / np.linalg.norm(direction)
    direction = segments.eigenvector(-1.0)
    direction /= np.linalg.norm(direction[0])
    again, cuts = np.eye(len(old.x)), segments.cuts * 2
    if isinstance(old.map, Stroboscopic) and old.map.symmetry is not None:
        # Both halves are one application of the doubled map.
        again, inner = old.map.symmetry, segments.cuts[0]
        cuts = ((*(0.5 * c for c in inner), 0.5, *(0.5 + 0.5 * c for c in inner)),)
    nodes = np.concatenate([segments.nodes, segments.nodes @ again.T])
    moves = np.concatenate([direction, -direction @ again.T])
    both = replace(segments, cuts=cuts, nodes=nodes, matrices=np.concatenate([segments.matrices] * 2))
    twice = PeriodicOrbit(map_, old.x, 0.0, old.jacobian, (), old.time, 0, True, "", segments=both)
    return twice, nodes.ravel(), moves.ravel()
