"""Branches of periodic orbits over one parameter, and the door to those of equilibria.

Every point is a trajectory of the exact system: where the itinerary changes, the branch goes on through the change if
the orbit does, and the change is located and named (itineraries.py). Where no orbit is found beyond a point, the
branch ends there and says why; nothing is continued on the far side of a surface.

Chain: arclength.py, bifurcations.py, equilibrium_branches.py -> **continuation**.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...door import checks
from ...paths.budget import Budget, opened, within
from ..equilibria.equilibrium import Equilibrium
from ..maps.sections import Stroboscopic, depends_on_time
from ..maps.symmetry import repeats_in
from ..orbits.fixed_points import not_repeated
from ..orbits.itineraries import JUMP
from ..orbits.periodic_orbit import PeriodicOrbit, none_found
from .arclength import Point, Walk, in_units, leaves, same_state, unit_along, value_of
from .bifurcations import Bifurcation, bifurcations_between, collapse_between
from .branch import _Along
from .conditions.captures import CAPTURE
from .equilibria.branch import EquilibriumBranch
from .equilibria.branches import coordinate, follow_equilibrium, value_at
from .jumps import end_at
from .steps import Steps

__all__ = ["Bifurcation", "Branch", "branch_off"]


_MORE = 0.5  # of the range, to either side
_COUNTED = 2**62  # steps of a budget that only counts them: an orbit that is begun is ended


@checks.door()
@dataclass(repr=False)
class Branch(_Along):
    """Periodic orbits along a parameter.

    Attributes
    ----------
    parameter : str
        Its name.
    orbits : list of PeriodicOrbit
        In the order in which they were found.
    bifurcations : list of Bifurcation
        In the order in which they were found.
    end : str
        Why it ended, in words.
    places : list of int
        Of each bifurcation how many of the orbits come before it.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> system = System({x: a * sp.cos(t) - x}, time=t, parameters={a: 1})
    >>> branch = follow(find_orbit(system, {x: 0}, seen=Strobe(2 * sp.pi)), {a: 2})
    >>> branch.end, bool(branch.stable.all())
    ('reached a = 2.', True)
    >>> print(f"{branch.values[-1]:g} {branch.x[0, -1]:.9f}")
    2 1.000000000
    """

    parameter: str
    orbits: list[PeriodicOrbit] = field(default_factory=list)
    bifurcations: list[Bifurcation] = field(default_factory=list)
    end: str = ""
    places: list[int] = field(default_factory=list)

    _noun, _where = "orbits", " on the section"

    @property
    def _points(self) -> list[Any]:
        return self.orbits

    @staticmethod
    def _at(bifurcation: Any) -> Any:
        return bifurcation.orbit

    def _joined(self, other: Branch) -> Branch:
        """The way there, backwards, and another way from the same start."""
        last = len(self.orbits)
        places = [*(last - k for k in reversed(self.places)), *(last - 1 + k for k in other.places)]
        return Branch(
            self.parameter, [*self.orbits[:0:-1], *other.orbits], [*self.bifurcations[::-1], *other.bifurcations],
            f"{self.end} {other.end}", places,
        )  # fmt: skip

    @property
    def exponents(self) -> np.ndarray:
        """Lyapunov exponents of the orbits, log|multiplier|/period, shape (number of multipliers, number of orbits).

        Largest first, in units of 1/time; -inf where an orbit sticks or lands, nan where there are no multipliers.
        """
        return np.array([orbit.exponents for orbit in self.orbits]).T

    def _columns(self) -> dict[str, Any]:
        return {
            "period": [orbit.period for orbit in self.orbits],
            "stable": self.stable,
            "largest_multiplier": [abs(orbit.multipliers).max(initial=0.0) for orbit in self.orbits],
            "largest_exponent": [orbit.exponents.max(initial=-math.inf) for orbit in self.orbits],
        }


def follow_branch(
    start: PeriodicOrbit | Equilibrium, parameter: Any, to: Any, way: int | None, virtual: bool, steps: Steps,
    max_steps: int, max_seconds: float | None,
) -> Branch | EquilibriumBranch:  # fmt: skip
    """The branch of an orbit or an equilibrium over a parameter, or of a set of equilibria along a state."""
    if not start.success:
        raise ValueError(f"`start` did not converge: {start.message}")
    if isinstance(start, Equilibrium):
        name = coordinate(start, parameter)
        at = value_at(start, name)
    else:
        if virtual:
            raise ValueError(
                "`virtual` is for equilibria; orbits are trajectories of the exact system. Leave it out."
            )
        name = checks.lookup(parameter, start.system.parameters, "`over`", "parameter").name
        start = _by_shorter_periods(start)
        at = value_of(start, name)
    lengths, bound = steps._lengths(0.02, 0.1, 1e-7), opened(max_steps, max_seconds)
    sides: list[Any] = []
    for begin, end in _ways(name, at, to, way):
        if abs(end - begin) > 1e100:
            raise ValueError(
                f"`over` of {name} reaches {end:g}, so far from {begin:g} that no derivative has that scale; give less."
            )
        if isinstance(start, Equilibrium):
            sides.append(
                follow_equilibrium(start, name, (begin, end), lengths, steps.max_points, virtual, bound.late)
            )
            continue
        branch, walk = Branch(name, [start]), Walk(start, name, abs(end - begin))
        walk.until = bound
        with within(Budget(_COUNTED)) as counted:
            branch.end = followed(
                branch, walk, begin, end, lengths, steps.max_points,
                lambda: _COUNTED - counted.left >= bound.left or bound.late(),
            )  # fmt: skip
        sides.append(branch)
    return sides[0] if len(sides) == 1 else sides[0]._joined(sides[1])


def _ways(name: str, at: float, to: Any, way: int | None) -> list[tuple[float, float]]:
    """(where a branch stops that has turned back, where it stops) of every way that it goes."""
    if np.ndim(to) == 0:
        to = checks.number(to, f"`over` of {name}")
        if to == at:
            raise ValueError(f"`over` of {name} is {to:g}, where the start already is; give another value.")
        if way is not None:
            raise ValueError(
                f"`way` is for a range, and `over` of {name} is {to:g}; leave it out, or give (least, largest)."
            )
        return [(at, to)]
    low, high = checks.interval(to, f"`over` of {name}")
    if not low <= at <= high:
        raise ValueError(
            f"`over` of {name} goes from {low:g} to {high:g}, and the start is at {at:g}; give a range that holds it."
        )
    ends = [(high, low, -1), (low, high, 1)]
    found = [(begin, end) for begin, end, sign in ends if end != at and way in (None, sign)]
    if not found:
        raise ValueError(
            f"`way` is {way}, and the start is at this end of the range of {name}; give the other one."
        )
    return found


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


def followed(branch, walk, begin, end, lengths, most, used_up) -> str:
    """Adds to a branch what there is up to its end, or until it is `used_up()` (bool); why it ends."""
    (step, longest_step, shortest_step), name, (orbit,) = lengths, walk.name, branch.orbits
    walk.bounds = _tried(*sorted((begin, end)))
    here = walk.point(orbit, np.append(np.zeros(len(orbit.x)), math.copysign(1.0, end - begin)))
    here = walk.rephased(here)
    ds = min(step, longest_step)
    looked_at: Point | None = None  # whose segments are those that it asks for
    while len(branch.orbits) < most:
        if used_up():
            return _used_up(walk, here)
        if not here.alone:
            return (
                f"at {name} = {walk.value(here):.10g} the orbit is not isolated: many exist at one value, or "
                "two branches meet there, and no single way leads on."
            )
        there, turned = walk.step(here, ds), False
        if there is None:
            if here is not looked_at and (other := walk.cut(here)) is not None:
                here = looked_at = other
                continue
            looked_at = here
            if ds > shortest_step:
                ds *= 0.3
                continue
            there, turned = walk.turn(here, ds), True
            if there is None:
                return _used_up(walk, here) if used_up() else _ended(branch, walk, here, ds)
        past = _passed(there, here, walk, begin, end)
        if past is not None:
            bound, reach = walk.at_parameter(here, past, there), np.linalg.norm(there.u - here.u)
            # One so much farther than the point beyond the bound is of another branch.
            if bound is None or np.linalg.norm(bound.u - here.u) > 2 * reach:
                if ds > shortest_step:
                    ds *= 0.3
                    continue
                return f"no orbit was found at {name} = {past:g}."
            there = bound
        if broken := not_repeated(there.orbit):
            return f"at {name} = {walk.value(there):.10g} there is {broken}"
        found = bifurcations_between(walk, here, there)
        if walk.late():  # what was found then is not known to be complete
            return _used_up(walk, here)
        if turned and not any(b.change is not None for b in found):
            return _ended(branch, walk, here, ds)  # it has turned back without a corner
        if any(b.kind == JUMP for b in found):
            # The step has come to another branch: a shorter one keeps to this one, or finds its end.
            if ds > shortest_step:
                ds *= 0.3
                continue
            return _ended(branch, walk, here, ds)
        shorter = collapse_between(walk, here, there, found)
        if shorter is not None:
            count, ends = shorter
            if not ends and ds > shortest_step:
                ds *= 0.3
                continue
            if (
                not ends
            ):  # the step leads elsewhere: to the same orbits some periods later, or to another branch
                return _ended(branch, walk, here, ds)
            branch.bifurcations += ends
            branch.places += [len(branch.orbits)] * len(ends)
            return _collapse_in_words(walk, count, ends)
        there = _away(walk, here, there, found)
        branch.bifurcations += found
        branch.places += [len(branch.orbits)] * len(found)
        if found and found[-1].jumps:
            what = "a contact is just captured" if found[-1].kind == CAPTURE else "a stick is just parted"
            return f"no orbit beyond {name} = {found[-1].parameter:.10g}: there {what}, and the Poincare map jumps."
        branch.orbits.append(there.orbit)
        if past is not None:
            return f"reached {name} = {past:g}."
        ds = min(ds * (2.0 if there.steps <= 3 else 1.0 if there.steps <= 5 else 0.5), longest_step)
        here = walk.rescaled(walk.rephased(there))
        if there.orbit.segments is None and here.orbit.segments is not None:
            branch.orbits[-1] = here.orbit  # the same one, better known
    return f"stopped after {len(branch.orbits)} orbits (`max_points`)."


def _used_up(walk: Walk, here: Point) -> str:
    return (
        f"`max_steps` or `max_seconds` are used up at {walk.name} = {walk.value(here):.10g}: give more, or go on from "
        "`orbits[-1]`."
    )


def _tried(low: float, high: float) -> tuple[float, float]:
    """Where orbits are looked for: somewhat beyond the ends, but not near to 0, where a drive's period has no end."""
    more = _MORE * (high - low)
    return (
        max(low - more, low / 2 if low > 0 else -math.inf),
        min(high + more, high / 2 if high < 0 else math.inf),
    )


def _ended(branch: Branch, walk: Walk, here: Point, ds: float) -> str:
    """Why no step leads on from a point, in words; what the branch ends at, if that has a name, is its last one."""
    found = end_at(walk, here, 100 * ds * walk.scale)
    if found is None:
        return walk.why_ended(here, ds)
    last = Bifurcation(*found[:6], saddles=found.saddles)
    branch.bifurcations.append(last)
    branch.places.append(len(branch.orbits))
    if last.saddles:
        return f"{last.kind} at {walk.name} = {last.parameter:.10g}: {last.at_saddles}."
    return (
        f"{last.kind} at {walk.name} = {last.parameter:.10g}: no orbit was found beyond it. `follow` goes on with it "
        "over two parameters."
    )


def _away(walk: Walk, here: Point, there: Point, found: list[Bifurcation]) -> Point:
    """The point, its tangent away from a corner on the way to it: beyond an acute one the old tangent tells nothing."""
    corner = next((b.beyond for b in reversed(found) if b.beyond is not None), None)
    if corner is None or there.tangent @ here.tangent >= 0.8:
        return there
    if (1 if corner.segments is None else len(corner.segments)) * len(corner.x) + 1 != len(there.u):
        return there
    way = there.u - walk.unknowns(corner)
    return replace(there, tangent=-there.tangent) if way @ there.tangent < 0 else there


def _collapse_in_words(walk: Walk, count: int, ends: list[Bifurcation]) -> str:
    orbits = f"the orbits of {walk.map.count} applications of the map shrink onto one of {count}"
    kinds = " and ".join(f"{b.kind} at {b.name} = {b.parameter:.10g}" for b in ends)
    return f"{orbits}: {kinds} of that one, which `bifurcations[-1].orbit` is."


def _passed(there: Point, here: Point, walk: Walk, begin: float, end: float) -> float | None:
    """The bound that the last step has passed: the end of the range or, after a turn, its beginning."""
    q, q0 = (walk.value(p) for p in (there, here))
    low, high = sorted((begin, end))
    if q >= high and q > q0:
        return high
    if q <= low and q < q0:
        return low
    return None


@checks.door(
    bifurcation=checks.instance(Bifurcation, "one of a branch's `bifurcations`"), amplitude=checks.nonzero
)
def branch_off(bifurcation: Bifurcation, amplitude: float = 1e-2) -> PeriodicOrbit:
    """An orbit on the branch that begins at a flip, where the symmetry breaks, or at a branch point.

    Parameters
    ----------
    bifurcation : Bifurcation
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

    Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the eigenvector as predictor.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 2.8}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> orbit = find_orbit(logistic, {x: 0.6}, seen=Strobe(1, phase=0.5))
    >>> (flip,) = follow(orbit, {a: 3.3}).bifurcations
    >>> cycle = branch_off(flip, 0.02)
    >>> cycle.success, cycle.map.count, cycle.stable
    (True, 2, True)
    """
    if bifurcation.kind not in ("flip", "symmetry breaking", "branch point"):
        raise ValueError(
            f"`bifurcation` is a {bifurcation.kind}; branches begin at a flip, a symmetry breaking or a branch point."
        )
    old, beside = bifurcation.orbit, bifurcation.kind == "branch point"
    doubled, x, direction = _critical(old) if beside else _doubled(old)
    walk = Walk(doubled, bifurcation.name, 1.0, unit_along(old))
    normal = np.append(direction / walk.units, 0.0)
    normal /= np.linalg.norm(normal)
    guess = np.append((x + amplitude * direction) / walk.sizes, bifurcation.parameter)
    point = walk.correct(guess, normal, normal)
    lost = "give another `amplitude`, a smaller one as a rule."
    if point is None:
        return none_found(doubled.map, old.x, f"no orbit was found on the branch at this distance: {lost}")
    orbit = in_units(point.orbit, walk.unit)
    begun = np.append(x / walk.sizes, bifurcation.parameter)
    quarter = leaves(walk, begun, bifurcation.uncertainty, point, normal)
    # The critical multiplier leaves 1 as the square of the amplitude, and has not come as far as 0.
    if quarter is None or not np.abs(quarter.orbit.map_multipliers - 1).min(initial=np.inf) < 1 / 16:
        return replace(orbit, success=False, message=f"found was an orbit far from the bifurcation: {lost}")
    if beside:
        return orbit
    if orbit.segments is None:
        once = old.map.with_parameters({bifurcation.name: value_of(orbit, bifurcation.name)})(orbit.x)
    else:
        half = orbit.segments.nodes[len(orbit.segments) // 2]
        once = half if (G := getattr(old.map, "symmetry", None)) is None else np.linalg.solve(G, half)
    if same_state(once, orbit.x, walk.unit):
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
