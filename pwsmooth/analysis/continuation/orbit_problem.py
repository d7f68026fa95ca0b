"""Orbits along a branch: their equations, and a section that keeps away from events.

    P(x; q) - x = 0,    u = (x/unit, q/scale)

Each state has a unit of its own, of the size of its motion. Of an orbit in N segments x is the points at which these
begin, over sqrt(N), so that an arc is as long as with one.

Chain: problem.py, orbits/fixed_points.py -> **orbit_problem** -> bifurcations.py, branches.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...paths.budget import Budget, within
from ...results.solution import Solution
from ..maps.first_order import chosen_parameters, moved, sticks_at_start
from ..maps.poincare import Image
from ..maps.scales import Scale, extents, unit_of, units_of_motion
from ..maps.sections import Section, Stroboscopic
from ..maps.segments import Shooting, best_place, cut, pressed, restless, rotated, settled, sizes
from ..orbits.finding import refine
from ..orbits.fixed_points import SAME, TOLERANCE, onto_section, orbit_of, pinned, relative, shot
from ..orbits.itineraries import same_itinerary
from ..orbits.periodic_orbit import MULTIPLIERS, PeriodicOrbit
from ..orbits.recutting import longest_slip
from .problem import Equations, Point, Problem, only_way

_MORE = 0.5  # of the range, to either side: there orbits are looked for too
EASY = 3  # steps of Newton's method: where it takes more, it is seen whether segments would make it easier
NEAR = 0.03  # of the period: an event so near to the section moves it
_TRIAL, _FEWEST = 100, 100  # times the steps of the orbit before, and how many these are at least: of a guess
_ALONG = 0.8  # cosine between tangents and the chord of a step
_NEARER = 0.75  # of the distance from a bifurcation, with half of the amplitude
JUMP_OF_SLOPES = 0.02  # of 1 or their size: slopes that so differ between points close together jump
_MOVES = 1e-3  # of the arc: with longer steps than this an event comes so near first


def _weighted(units: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Units of the points at which segments begin, times the root of their number."""
    return units * math.sqrt(len(units) / len(unit)) if len(units) > len(unit) else units


def unit_along(orbit: PeriodicOrbit) -> np.ndarray:
    """Units of the states: those of the map, or how far the orbit moves each and how large it is, if that is more."""
    moves = extents(orbit.runs()) if orbit.moves is None else orbit.moves
    return np.maximum(orbit.map.unit, units_of_motion(moves, orbit.x))


def in_units(orbit: PeriodicOrbit, unit: np.ndarray) -> PeriodicOrbit:
    """A small orbit whose map keeps units of the states of what its branch begins at."""
    if np.all(unit_along(orbit) >= unit):
        return orbit
    sizes = tuple(np.maximum(unit_along(orbit), unit).tolist())
    return replace(orbit, map=orbit.map._with(scale=Scale(sizes, sizes)))


def value_of(orbit: PeriodicOrbit, name: str) -> float:
    return next(value for p, value in orbit.system.parameters.items() if p.name == name)


@dataclass(frozen=True)
class OrbitPoint(Point):
    """A point of a branch of orbits: u = (x, q/scale), the orbit, and its image."""

    orbit: PeriodicOrbit
    image: Image

    @property
    def item(self) -> PeriodicOrbit:
        """What is shown of it."""
        return self.orbit

    @property
    def run(self) -> Solution:
        """The trajectory; of several runs the last one."""
        return self.image.solution


class OrbitProblem(Problem):
    """The points at which the segments of an orbit begin, and one parameter."""

    tolerance, rank = TOLERANCE, MULTIPLIERS
    place = -1
    until: Budget | None = None  # of the whole walk

    def __init__(
        self, orbit: PeriodicOrbit, name: str, scale: float, unit: np.ndarray | None = None,
        ranges: tuple[float, float] = (-math.inf, math.inf),
    ) -> None:  # fmt: skip
        self.map, self.name, self.names, self.scale = orbit.map, name, (name,), scale
        self.ranges = np.sort(np.array([ranges]))
        self.usual = 0  # steps of solve() that the last orbit took
        self.unit, self.first = unit_along(orbit) if unit is None else unit, orbit.x
        self._take(orbit)

    def _take(self, orbit: PeriodicOrbit) -> None:
        """From now on in the segments of this orbit."""
        self.segments = orbit.segments
        self.units = np.tile(self.unit, 1 if orbit.segments is None else len(orbit.segments))
        self.n = self.place = len(self.units)
        self.sizes = np.append(_weighted(self.units, self.unit), self.scale)

    def equations(
        self, u: np.ndarray, before: Equations | None = None, known: bool = False
    ) -> Equations | None:
        """None where the trajectory does not return, q is not allowed, or the time is up, but for a `known` orbit."""
        value = float(u[-1] * self.scale)
        if not known and (self.late() or not self._tried(value)):
            return None
        try:
            here = self.map.with_parameters({self.name: value})
        except ValueError:  # outside the assumptions of the parameter
            return None
        shooting = here if self.segments is None else Shooting(here, self.segments.cuts)
        x = u[:-1] * self.sizes[:-1]
        with within(Budget() if known else self._trial()):
            image = shooting.image(x, (self.name,))
        if not image.success:
            return None
        F = image.x - x
        slope = (image.jacobian - np.eye(len(F))) * self.sizes[:-1]
        DF = np.column_stack([slope, image.by_parameter[:, 0] * self.scale]) / self.units[:, None]
        if not np.isfinite(DF).all():
            return None
        return Equations(F / self.units, DF, relative(shooting, F, x, image), (shooting, image))

    def _tried(self, value: float) -> bool:
        """Whether orbits are looked for: somewhat beyond the ends, not near to 0, where a drive's period has no end."""
        low, high = self.ranges[0]
        more = _MORE * (high - low) if math.isfinite(high - low) else math.inf
        least = max(low - more, low / 2 if low > 0 else -math.inf)
        return least <= value <= min(high + more, high / 2 if high < 0 else math.inf)

    def late(self) -> bool:
        """Whether the time of the whole problem is up."""
        return self.until is not None and self.until.late()

    def _trial(self) -> Budget:
        """What a guess may take: one that escapes to infinity is given up long before a call's own bound."""
        seconds = None if self.until is None or self.until.deadline == math.inf else self.until.remaining()
        steps = _TRIAL * max(self.usual, _FEWEST) if self.usual else math.inf
        return Budget(steps, None if seconds is None else max(seconds, 1e-3))

    def size(self, equations: Equations, move: np.ndarray, u: np.ndarray) -> float:
        return equations.error

    def made(
        self, u: np.ndarray, equations: Equations, steps: int, tangent: np.ndarray, alone: bool
    ) -> OrbitPoint:
        (here, image), x = equations.parts, u[:-1] * self.sizes[:-1]
        kept = (False, False) if self.segments is None else self.segments.kept
        orbit = orbit_of(here, x, image, equations.error, steps, True, "continued", kept)
        tangent[:-1][pinned(image)] = 0.0
        self.usual = sum(len(run.t) for run in image.runs)
        return OrbitPoint(u, tangent, steps, alone, orbit, image)

    def settled(self, u: np.ndarray, equations: Equations) -> np.ndarray | None:
        here, image = equations.parts
        n, sizes, stays = self.n, self.sizes[: self.n], pinned(image)
        u[:n][stays] = image.x[stays] / sizes[stays]
        if (there := self._moved(here, u)) is None:
            return None
        u[:n] = onto_section(there, u[:n] * sizes) / sizes
        return u

    def _moved(self, here: Any, u: np.ndarray) -> Any:
        """The map on the section at u, which may move with the parameters; None where that is not allowed."""
        map_: Any = here.map if isinstance(here, Shooting) else here
        if not (isinstance(map_, Section) and {*self.names} & {*map(str, map_.surface.free_symbols)}):
            return here
        values = (u * self.sizes)[self.n : self.n + len(self.names)]
        try:
            return here.with_parameters(dict(zip(self.names, map(float, values))))
        except ValueError:  # outside the assumptions of a parameter
            return None

    def unknowns(self, orbit: PeriodicOrbit) -> np.ndarray:
        """u of an orbit in these segments."""
        x = orbit.x if orbit.segments is None else orbit.segments.nodes.ravel()
        return np.append(x, value_of(orbit, self.name)) / self.sizes

    def point(self, orbit: PeriodicOrbit, direction: np.ndarray) -> OrbitPoint:
        """The point of a converged orbit, with its tangent along `direction` (of all points, or on the section)."""
        self._take(orbit)
        u = self.unknowns(orbit)
        if len(direction) != len(u):
            direction = np.concatenate(
                [direction[: len(orbit.x)], np.zeros(len(u) - 1 - len(orbit.x)), direction[-1:]]
            )
        equations = self.equations(u, known=True)
        assert equations is not None
        return replace(self.reached(u, equations, direction), orbit=orbit)

    def rephased(self, here: OrbitPoint) -> OrbitPoint:
        """The same orbit on a section at which it slips, where its own one sticks or an event has come near to it."""
        section = here.orbit.map
        here = self.segmented(here)
        if not (isinstance(self.map, Stroboscopic) and isinstance(section, Stroboscopic)):
            return here
        if here.orbit.segments is not None:
            return self._rephased_in_segments(here)
        time = quiet_time(here.run, section.forcing_period)
        if time is None:
            return here
        map_, period = self.map, section.forcing_period
        part = map_.solved(here.orbit.x, time, here.orbit.system)
        found = moved(part, chosen_parameters(part.system, (self.name,)))
        turned = map_.at_phase(time / period)
        slope = section._period_slope(self.name)
        along = found.matrix @ (here.tangent[:-1] * self.sizes[:-1]) + here.tangent[-1] * self.scale * (
            found.by_parameter[:, 0]
            + found.rates * slope * time / period
            - found.matrix @ found.first_rates * slope * map_.phase
        )
        orbit = refine(turned.with_parameters({self.name: self.value(here)}), part.x[:, -1])
        if not orbit.success:
            return here
        self.map = turned
        return self.point(orbit, np.append(along / self.unit, here.tangent[-1]))

    def _rephased_in_segments(self, here: OrbitPoint) -> OrbitPoint:
        segments, map_ = here.orbit.segments, here.orbit.map
        assert segments is not None and isinstance(map_, Stroboscopic)
        near, first, last = NEAR * map_.forcing_period, here.image.runs[0], here.image.runs[-1]
        edges = [e.time - first.t[0] for e in first.events] + [last.t[-1] - e.time for e in last.events]
        if min(edges, default=math.inf) > near:
            return here
        shooting = Shooting(map_, segments.cuts)
        place, distance = best_place(shooting, here.image)
        if not 0 < place < 1 or distance * map_.beat < 2 * near:
            return here
        found = cut(
            shooting, segments.nodes.ravel(), here.image, way=here.tangent[:-1] * self.sizes[:-1],
            speed=here.tangent[-1] * self.scale, name=self.name, also=place,
        )  # fmt: skip
        if found is None:
            return here
        cuts, X, way, held = found
        turned, X, way = rotated(Shooting(map_, cuts), X, way, place)
        other = shot(turned, X, (segments.asked, held))
        if not other.success:
            return here
        self.map = turned.map
        return self.point(other, np.append(self._scaled(way), here.tangent[-1]))

    def cut(self, here: OrbitPoint) -> OrbitPoint | None:
        """The same orbit in segments, where deviations grow on the way by more than its multipliers tell."""
        other = here if here.orbit.segments is not None else self.segmented(here, must=True)
        return None if other is here else other

    def segmented(self, here: OrbitPoint, must: bool = False) -> OrbitPoint:
        """The same orbit in other segments, where its own (or one piece) have grown too long or too short."""
        orbit, segments, size = here.orbit, here.orbit.segments, sizes(here.image.runs)
        largest = float(np.abs(orbit.map_multipliers).max(initial=0.0))
        if segments is None:
            if not (must or here.steps > EASY or pressed(here.image, self.scale, largest)):
                return here
            if (new := _begun(orbit)) is None:
                return here
            shooting, X, image = new
            way = np.concatenate([here.tangent[:-1] * self.sizes[:-1], np.zeros(len(X) - len(orbit.x))])
        else:
            shooting, X, image = Shooting(orbit.map, segments.cuts), segments.nodes.ravel(), here.image
            if not segments.asked and settled(list(segments.matrices), size, largest):
                whole = refine(orbit.map, orbit.x)
                if whole.success and whole.segments is None:
                    return self.point(whole, here.tangent)
            if not restless(shooting, image, segments.held, self.scale):
                return here
            way = here.tangent[:-1] * self.sizes[:-1]
        number = len(segments) if segments is not None and segments.asked else None
        found = cut(
            shooting, X, image, number=number, way=way, speed=here.tangent[-1] * self.scale, name=self.name
        )
        if found is None:
            return here
        cuts, X, way, held = found
        if segments is None and not len(X) > 2 * len(orbit.x):
            return here
        other = shot(Shooting(orbit.map, cuts), X, (number is not None, held))
        if not other.success:
            return here
        return self.point(other, np.append(self._scaled(way), here.tangent[-1]))

    def derivative(self, point: OrbitPoint) -> np.ndarray:
        """The derivative of the map at a point, in the units of the problem."""
        J = point.image.jacobian
        units = np.tile(self.unit, len(J) // len(self.unit))
        return J * units / units[:, None]

    def _scaled(self, way: np.ndarray) -> np.ndarray:
        """A way of all points at which segments begin, in the units of the problem."""
        return way / _weighted(np.tile(self.unit, len(way) // len(self.unit)), self.unit)

    def rescaled(self, here: OrbitPoint) -> OrbitPoint:
        """The same point in larger units, where the motion or its way along the branch has become much larger."""
        grown = np.maximum(extents(here.image.runs), np.abs(here.orbit.x - self.first))
        unit = np.maximum(self.unit, [unit_of(size) if size > 0 else 0.0 for size in grown.tolist()])
        if np.all(unit == self.unit):
            return here
        old, self.unit = self.sizes, unit
        self._take(here.orbit)
        return self.point(here.orbit, here.tangent * old / self.sizes)

    def leads(self, here: Any, there: Any, ds: float) -> bool:
        if ds > _MOVES and _sticks(there) and not _sticks(here):
            return False  # a shorter step comes near enough to move the section first
        # Within one itinerary the branch is smooth, and a chord lies along both tangents: one that does not leads to
        # another part of it, or to another branch. Between two itineraries it may have a corner.
        way = there.u - here.u
        along = min(
            there.tangent @ here.tangent, *(p.tangent @ way / np.linalg.norm(way) for p in (here, there))
        )
        return bool(along >= _ALONG) or not same_itinerary(here.orbit, there.orbit)

    def turn(self, here: OrbitPoint, ds: float) -> OrbitPoint | None:
        """Around a corner at which the branch turns back: along the tangent of the other side."""
        for reach in (10 * ds, 100 * ds, 1000 * ds):
            equations = self.equations(here.u + reach * here.tangent)
            if equations is None:
                continue
            other, _ = only_way(equations.DF, here.tangent, self.rank)
            for direction in (other, -other):
                there = self.correct(here.u + 2 * reach * direction, direction, direction)
                if there is None or np.linalg.norm(there.u - here.u) > 20 * reach:
                    continue
                if (
                    not same_itinerary(here.orbit, there.orbit)
                    or slopes_apart(self, here, there) > JUMP_OF_SLOPES
                ):
                    return there
        return None

    def why_ended(self, here: OrbitPoint, ds: float) -> str:
        where = self.where(here)
        equations = self.equations(here.u + 100 * ds * here.tangent)
        if equations is None:
            return f"no orbit beyond {where}: trajectories from there do not return."
        _, image = equations.parts
        gap = float(np.abs(equations.F * self.units).max(initial=0.0))
        if gap > 1e4 * ds and image.word != here.orbit.word:
            events = " | ".join(kind for _, kind, _ in image.word) or "no events"
            return (
                f"no orbit beyond {where}: the Poincare map jumps there by {gap:.2g}, from the itinerary "
                f"{' | '.join(kind for _, kind, _ in here.orbit.word) or 'no events'} to {events}."
            )
        return f"no orbit was found beyond {where} with steps down to {ds:.1g}."


def quiet_time(run: Solution, period: float) -> float | None:
    """The middle of the longest slip of a run that begins in a stick or near to an event; None where it may stay.

    Also of a short slip, where that is farther from its ends.
    """
    times = run.event_times()
    edge = min(times[0] - run.t[0], run.t[-1] - times[-1]) if times.size else math.inf
    if edge > NEAR * period:
        return None
    middle, length = longest_slip(run)
    return middle if length >= 4 * min(NEAR * period, edge) else None


def _begun(orbit: PeriodicOrbit) -> tuple[Shooting, np.ndarray, Image] | None:
    """The shift map of an orbit's periods (returns), one a segment, its points and their images."""
    map_ = orbit.map
    shooting, X = Shooting(map_, ((),) * map_.turns), orbit.x
    for k in range(1, map_.turns):
        X = np.append(X, replace(map_, count=k).image(orbit.x).x)
    image = shooting.image(X, ())
    return (shooting, X, image) if image.success else None


def same_state(one: np.ndarray, other: np.ndarray, unit: np.ndarray) -> bool:
    """Whether two points on the section are one, in units of their states."""
    return bool(np.linalg.norm((one - other) / unit) <= SAME * (1 + np.linalg.norm(other / unit)))


def leaves(
    problem: OrbitProblem, begun: np.ndarray, uncertainty: float, point: OrbitPoint, normal: np.ndarray
) -> OrbitPoint | None:
    """The point of a branch with a quarter of a point's amplitude, if the branch comes from its beginning to that one.

    With half of the amplitude a point is nearer by half, as its parameter is at least.
    """
    for _ in range(2):
        half = problem.correct(begun + 0.5 * (point.u - begun), normal, normal)
        if half is None:
            return None
        off, nearer = (float(np.linalg.norm(p.u - begun)) for p in (point, half))
        moved, less = (abs(float(p.u[-1] - begun[-1])) for p in (point, half))
        if nearer > _NEARER * off or less > _NEARER * moved + 2 * uncertainty / problem.scale:
            return None
        point = half
    return point


def slopes_apart(problem: OrbitProblem, one: OrbitPoint, other: OrbitPoint) -> float:
    """How much the derivatives of the map at two points differ, relative to 1 or to their size if that is more."""
    a, b = (problem.derivative(point) for point in (one, other))
    if a.shape != b.shape:
        return 0.0
    return float(np.abs(a - b).max(initial=0.0)) / max(1.0, np.abs(a).max(initial=0.0))


def in_other_pieces(orbit: PeriodicOrbit) -> PeriodicOrbit | None:
    """The same orbit in other segments than it was shot over in; None where there are none from which it is found."""
    if orbit.segments is None:
        begun = _begun(orbit)
        number = max(3, orbit.map.turns + 1)
    else:
        shooting, X = Shooting(orbit.map, orbit.segments.cuts), orbit.segments.nodes.ravel()
        begun, number = (shooting, X, shooting.image(X, ())), len(orbit.segments) + 1
    if begun is None or not begun[2].success or (found := cut(*begun, number=number)) is None:
        return None
    cuts, X, _, held = found
    other = shot(Shooting(orbit.map, cuts), X, (True, held))
    return other if other.success and np.isfinite(other.jacobian).all() else None


def _sticks(point: OrbitPoint) -> bool:
    """Whether the motion stands on a surface on its section.

    It may end so and not begin so: beside a surface, by a rounding, where the map lets go what is held.
    """
    return any(sticks_at_start(run) or run._holds(run.status[:, -1]) for run in point.image.runs)
