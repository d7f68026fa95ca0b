"""Steps along a branch of periodic orbits: predictor, corrector, and a section that keeps away from events.

    P(x; q) - x = 0,    tau . (u - u0) = ds,    u = (x/unit, q/scale)     (H. B. Keller, 1977)

Each state has a unit of its own, of the size of its motion. Of an orbit in N segments x is the points at which these
begin, over sqrt(N), so that an arc is as long as with one.

Chain: sections.py, fixed_points.py, orbits.py -> **arclength** -> bifurcations.py, continuation.py.
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

_MOST_NEWTON = 8
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
class Point:
    """A point of the branch: u = (x, q/scale), the unit tangent there, the orbit, its image and Newton's steps.

    `alone` is False where the equations leave more than one direction: a family of orbits at one parameter value.
    """

    u: np.ndarray
    tangent: np.ndarray
    orbit: PeriodicOrbit
    image: Image
    steps: int
    alone: bool = True

    @property
    def run(self) -> Solution:
        """The trajectory; of several runs the last one."""
        return self.image.solution


class Walk:
    """Predictor, corrector and bisection in the plane of states and one parameter."""

    until: Budget | None = None  # of the whole walk

    def __init__(self, orbit: PeriodicOrbit, name: str, scale: float, unit: np.ndarray | None = None) -> None:
        self.map, self.name, self.scale = orbit.map, name, scale
        self.bounds = (-math.inf, math.inf)  # of the parameter: what it is tried at
        self.usual = 0  # steps of solve() that the last orbit took
        self.unit, self.first = unit_along(orbit) if unit is None else unit, orbit.x
        self._take(orbit)

    def _take(self, orbit: PeriodicOrbit) -> None:
        """From now on in the segments of this orbit."""
        self.segments = orbit.segments
        self.units = np.tile(self.unit, 1 if orbit.segments is None else len(orbit.segments))
        self.sizes = _weighted(self.units, self.unit)

    def value(self, point: Point) -> float:
        return float(point.u[-1] * self.scale)

    def image(self, u: np.ndarray, known: bool = False):
        """F, DF (n, n + 1) and the image at u; None where the trajectory does not return or q is not allowed.

        Also where the time is up, but for a `known` orbit.
        """
        value = float(u[-1] * self.scale)
        if self.late() and not known or not self.bounds[0] <= value <= self.bounds[1]:
            return None
        try:
            here = self.map.with_parameters({self.name: value})
        except ValueError:  # outside the assumptions of the parameter
            return None
        shooting = here if self.segments is None else Shooting(here, self.segments.cuts)
        x = u[:-1] * self.sizes
        with within(Budget() if known else self._trial()):
            image = shooting.image(x, (self.name,))
        if not image.success:
            return None
        here, F = shooting, image.x - x
        slope = (image.jacobian - np.eye(len(F))) * self.sizes
        DF = np.column_stack([slope, image.by_parameter[:, 0] * self.scale]) / self.units[:, None]
        return (here, image, F, DF) if np.isfinite(DF).all() else None

    def late(self) -> bool:
        """Whether the time of the whole walk is up."""
        return self.until is not None and self.until.late()

    def _trial(self) -> Budget:
        """What a guess may take: one that escapes to infinity is given up long before a call's own bound."""
        seconds = None if self.until is None or self.until.deadline == math.inf else self.until.remaining()
        steps = _TRIAL * max(self.usual, _FEWEST) if self.usual else math.inf
        return Budget(steps, None if seconds is None else max(seconds, 1e-3))

    def unknowns(self, orbit: PeriodicOrbit) -> np.ndarray:
        """u of an orbit in these segments."""
        x = orbit.x if orbit.segments is None else orbit.segments.nodes.ravel()
        return np.append(x / self.sizes, value_of(orbit, self.name) / self.scale)

    def point(self, orbit: PeriodicOrbit, direction: np.ndarray) -> Point:
        """The point of a converged orbit, with its tangent along `direction` (of all points, or on the section)."""
        self._take(orbit)
        u = self.unknowns(orbit)
        if len(direction) != len(u):
            direction = np.concatenate(
                [direction[: len(orbit.x)], np.zeros(len(u) - 1 - len(orbit.x)), direction[-1:]]
            )
        equations = self.image(u, known=True)
        assert equations is not None
        tangent, alone = only_way(equations[3], direction)
        tangent[:-1][pinned(equations[1])] = 0.0
        self.usual = sum(len(run.t) for run in equations[1].runs)
        return Point(u, tangent, orbit, equations[1], 0, alone)

    def correct(self, guess: np.ndarray, normal: np.ndarray, direction: np.ndarray) -> Point | None:
        """Newton's method in the plane normal . (u - guess) = 0."""
        u, last = guess, math.inf
        for steps in range(_MOST_NEWTON + 1):
            equations = self.image(u)
            if equations is None:
                return None
            here, image, F, DF = equations
            x = u[:-1] * self.sizes
            size = relative(here, F, x, image)
            if size <= TOLERANCE:
                kept = (False, False) if self.segments is None else self.segments.kept
                orbit = orbit_of(here, x, image, size, steps, True, "continued", kept)
                tangent, alone = only_way(DF, direction)
                tangent[:-1][pinned(image)] = 0.0
                self.usual = sum(len(run.t) for run in image.runs)
                return Point(u, tangent, orbit, image, steps, alone)
            if size > 10 * last or steps == _MOST_NEWTON:
                return None
            last = size
            right = np.append(-F / self.units, -normal @ (u - guess))
            step = np.linalg.lstsq(np.vstack([DF, normal]), right, rcond=1e-14)[0]
            u = u + step
            stays = pinned(image)
            u[:-1][stays] = image.x[stays] / self.sizes[stays]
            if (there := self._moved(here, u)) is None:
                return None
            u = np.append(onto_section(there, u[:-1] * self.sizes) / self.sizes, u[-1])
        return None

    def _moved(self, shooting: Any, u: np.ndarray) -> Any:
        """The map on the section at u, which may move with the parameter; None where that is not allowed."""
        map_: Any = self.map
        if not (isinstance(map_, Section) and self.name in map(str, map_.surface.free_symbols)):
            return shooting
        try:
            there = map_.with_parameters({self.name: float(u[-1] * self.scale)})
        except ValueError:
            return None
        return there if self.segments is None else Shooting(there, self.segments.cuts)

    def rephased(self, here: Point) -> Point:
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
        along = found.matrix @ (here.tangent[:-1] * self.sizes) + here.tangent[-1] * self.scale * (
            found.by_parameter[:, 0]
            + found.rates * slope * time / period
            - found.matrix @ found.first_rates * slope * map_.phase
        )
        orbit = refine(turned.with_parameters({self.name: self.value(here)}), part.x[:, -1])
        if not orbit.success:
            return here
        self.map = turned
        return self.point(orbit, np.append(along / self.unit, here.tangent[-1]))

    def _rephased_in_segments(self, here: Point) -> Point:
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
            shooting, segments.nodes.ravel(), here.image, way=here.tangent[:-1] * self.sizes,
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

    def cut(self, here: Point) -> Point | None:
        """The same orbit in segments, where deviations grow on the way by more than its multipliers tell."""
        other = here if here.orbit.segments is not None else self.segmented(here, must=True)
        return None if other is here else other

    def segmented(self, here: Point, must: bool = False) -> Point:
        """The same orbit in other segments, where its own (or one piece) have grown too long or too short."""
        orbit, segments, size = here.orbit, here.orbit.segments, sizes(here.image.runs)
        largest = float(np.abs(orbit.map_multipliers).max(initial=0.0))
        if segments is None:
            if not (must or here.steps > EASY or pressed(here.image, self.scale, largest)):
                return here
            if (new := _begun(orbit)) is None:
                return here
            shooting, X, image = new
            way = np.concatenate([here.tangent[:-1] * self.sizes, np.zeros(len(X) - len(orbit.x))])
        else:
            shooting, X, image = Shooting(orbit.map, segments.cuts), segments.nodes.ravel(), here.image
            if not segments.asked and settled(list(segments.matrices), size, largest):
                whole = refine(orbit.map, orbit.x)
                if whole.success and whole.segments is None:
                    return self.point(whole, here.tangent)
            if not restless(shooting, image, segments.held, self.scale):
                return here
            way = here.tangent[:-1] * self.sizes
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

    def derivative(self, point: Point) -> np.ndarray:
        """The derivative of the map at a point, in the units of the walk."""
        J = point.image.jacobian
        units = np.tile(self.unit, len(J) // len(self.unit))
        return J * units / units[:, None]

    def _scaled(self, way: np.ndarray) -> np.ndarray:
        """A way of all points at which segments begin, in the units of the walk."""
        return way / _weighted(np.tile(self.unit, len(way) // len(self.unit)), self.unit)

    def rescaled(self, here: Point) -> Point:
        """The same point in larger units, where the motion or its way along the branch has become much larger."""
        grown = np.maximum(extents(here.image.runs), np.abs(here.orbit.x - self.first))
        unit = np.maximum(self.unit, [unit_of(size) if size > 0 else 0.0 for size in grown.tolist()])
        if np.all(unit == self.unit):
            return here
        old, self.unit = self.sizes, unit
        self._take(here.orbit)
        return self.point(here.orbit, np.append(here.tangent[:-1] * old / self.sizes, here.tangent[-1]))

    def step(self, here: Point, ds: float) -> Point | None:
        """One step along the tangent; None if it must be shorter."""
        there = self.correct(here.u + ds * here.tangent, here.tangent, here.tangent)
        if there is None or not 0 < np.linalg.norm(there.u - here.u) <= 2 * ds:
            return None
        if ds > _MOVES and _sticks(there) and not _sticks(here):
            return None  # a shorter step comes near enough to move the section first
        # Within one itinerary the branch is smooth, and a chord lies along both tangents: one that does not leads to
        # another part of it, or to another branch. Between two itineraries it may have a corner.
        way = there.u - here.u
        along = min(
            there.tangent @ here.tangent, *(p.tangent @ way / np.linalg.norm(way) for p in (here, there))
        )
        if along < _ALONG and same_itinerary(here.orbit, there.orbit):
            return None
        return there

    def turn(self, here: Point, ds: float) -> Point | None:
        """Around a corner at which the branch turns back: along the tangent of the other side."""
        for reach in (10 * ds, 100 * ds, 1000 * ds):
            equations = self.image(here.u + reach * here.tangent)
            if equations is None:
                continue
            other, _ = only_way(equations[3], here.tangent)
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

    def why_ended(self, here: Point, ds: float) -> str:
        where = f"{self.name} = {self.value(here):.10g}"
        equations = self.image(here.u + 100 * ds * here.tangent)
        if equations is None:
            return f"no orbit beyond {where}: trajectories from there do not return."
        _, image, F, _ = equations
        gap = float(np.abs(F).max(initial=0.0))
        if gap > 1e4 * ds and image.word != here.orbit.word:
            events = " | ".join(kind for _, kind, _ in image.word) or "no events"
            return (
                f"no orbit beyond {where}: the Poincare map jumps there by {gap:.2g}, from the itinerary "
                f"{' | '.join(kind for _, kind, _ in here.orbit.word) or 'no events'} to {events}."
            )
        return f"no orbit was found beyond {where} with steps down to {ds:.1g}."

    def at_parameter(self, near: Point, value: float, other: Point | None = None) -> Point | None:
        """The orbit at a value of the parameter, by the tangent of a point near it or between it and another one."""
        way = near.tangent if other is None else other.u - near.u
        normal = np.append(np.zeros(len(near.u) - 1), 1.0)
        guess = near.u + way * (value / self.scale - near.u[-1]) / way[-1]
        guess[-1] = value / self.scale
        return self.correct(guess, normal, near.tangent)

    def along(self, here: Point, there: Point, part: float, near: Point | None = None) -> Point | None:
        """The point whose projection on the chord is at a part of it: along the tangent of a near one first, or between
        those of both."""
        chord = there.u - here.u
        length = float(np.linalg.norm(chord))
        normal = chord / length
        target = here.u + part * chord
        guesses = [target]
        if near is not None and abs(slope := near.tangent @ normal) > 0.1:
            guesses.insert(0, near.u + near.tangent * (normal @ (target - near.u)) / slope)
        elif near is None and min(here.tangent @ normal, there.tangent @ normal) > 0.5:
            first, last = (p.tangent * length / (p.tangent @ normal) - chord for p in (here, there))
            guesses.insert(0, target + part * (1 - part) * ((1 - part) * first - part * last))
        for guess in guesses:
            point = self.correct(guess, normal, here.tangent)
            if point is not None:
                return point
        return None


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


def leaves(walk: Walk, begun: np.ndarray, uncertainty: float, point: Point, normal: np.ndarray) -> Point | None:
    """The point of a branch with a quarter of a point's amplitude, if the branch comes from its beginning to that one.

    With half of the amplitude a point is nearer by half, as its parameter is at least.
    """
    for _ in range(2):
        half = walk.correct(begun + 0.5 * (point.u - begun), normal, normal)
        if half is None:
            return None
        off, nearer = (float(np.linalg.norm(p.u - begun)) for p in (point, half))
        moved, less = (abs(float(p.u[-1] - begun[-1])) for p in (point, half))
        if nearer > _NEARER * off or less > _NEARER * moved + 2 * uncertainty / walk.scale:
            return None
        point = half
    return point


def slopes_apart(walk: Walk, one: Point, other: Point) -> float:
    """How much the derivatives of the map at two points differ, relative to 1 or to their size if that is more."""
    a, b = (walk.derivative(point) for point in (one, other))
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


def _sticks(point: Point) -> bool:
    """Whether the motion stands on a surface on its section.

    It may end so and not begin so: beside a surface, by a rounding, where the map lets go what is held.
    """
    return any(sticks_at_start(run) or run._holds(run.status[:, -1]) for run in point.image.runs)


def only_way(DF: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, bool]:
    """Unit null vector of DF (n, n + 1), to the side of `direction`; whether there is no other one.

    From two bordered systems: singular vectors of 30 segments' equations cost a hundred times as much.
    """
    sizes, last = np.linalg.svd(DF, compute_uv=False), np.append(np.zeros(len(DF)), 1.0)
    border = direction / (np.linalg.norm(direction) or 1.0)
    try:
        for _ in range(2):
            tangent = np.linalg.solve(np.vstack([DF, border]), last)
            border = tangent / np.linalg.norm(tangent)
        tangent = border
    except np.linalg.LinAlgError:  # the direction is across it, or there are others
        tangent = np.linalg.svd(DF)[2][-1]
    if not np.isfinite(tangent).all():
        tangent = np.linalg.svd(DF)[2][-1]
    tangent = tangent if tangent @ direction >= 0 else -tangent
    return tangent, bool(sizes[-1] > MULTIPLIERS * max(1.0, sizes[0]))
