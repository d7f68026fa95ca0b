"""Steps along a curve of bifurcations: predictor and corrector in states, two parameters and what a condition adds.

    P(x; p, q) = x,   c(x, p, q, e) = 0,   tau . (u - u0) = ds,   u = (x, p/scale, q/scale, e)

Chain: arclength.py, conditions.py, tangencies.py -> **curve_walk** -> curve_ways.py.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...maps.impacts import FromEvent
from ...maps.scales import extents, units_of_motion
from ...maps.sections import Section, Stroboscopic
from ...maps.segments import Shooting, best_place
from ...maps.windows import WIDEST, Windowed, recentred
from ...orbits.finding import refine
from ...orbits.fixed_points import TOLERANCE, onto_section, orbit_of, pinned
from ...orbits.periodic_orbit import PeriodicOrbit
from ...orbits.recutting import anew, at_section, exact, narrowed
from ..arclength import EASY, NEAR, Point, Walk, only_way, quiet_time, value_of
from ..conditions import captures
from ..conditions.captures import AtFold, Capture
from ..conditions.conditions import Condition, Place, along, differences, place_of, units_of_unknowns
from ..conditions.tangencies import AtEvent

_MOST_NEWTON = 8
_CONVERGED, _ROUNDED = 1e-12, 1e-9  # of the unknowns: what the last correction is, and may be where it stays so
_SLOW = 1e-2  # of the last correction: what is not less takes new slopes
HARDLY = 1e-5  # in the unit of dh/dt: the speed of a release that may as well be none
_REPEATED = 1e-6  # to which an orbit beside grazing comes back


@dataclass(frozen=True)
class Spot(Point):
    """A point of a curve: u = (x, p/scale, q/scale, e), what its own unknowns e are, and its test functions."""

    extra: np.ndarray = field(default_factory=lambda: np.empty(0))
    tests: Mapping[str, float] = field(default_factory=dict)
    twin: bool = False

    @property
    def at(self) -> np.ndarray:
        """Both parameters, scaled."""
        return self.u[len(self.u) - len(self.extra) - 2 :][:2]

    @property
    def way(self) -> np.ndarray:
        """How they move along the curve."""
        return self.tangent[len(self.u) - len(self.extra) - 2 :][:2]


class CurveWalk(Walk):
    """Predictor and corrector in the space of states, two parameters and the condition's own unknowns."""

    def __init__(
        self,
        map_: Any,
        condition: Condition,
        names: tuple[str, str],
        scales: np.ndarray,
        x: np.ndarray,
        held: bool,
    ) -> None:
        self.reach = 1.0  # how long the present step is
        self.condition, self.names, self.scales = condition, names, scales
        self.offset: Any = 0.0  # what c is, on the way to a first point
        runs = map_.image(x).runs
        moves = extents(runs)
        self.unit = units_of_motion(moves, x[: len(moves)])
        self.take(map_, len(x), held)

    def take(self, map_: Any, n: int, held: bool) -> None:
        """From now on with this map, of n unknowns: those of segments are counted as in arclength.py."""
        self.map: Any = map_
        self.n, self.held = n, held
        weight = math.sqrt(map_.number) if isinstance(map_, Shooting) else 1.0
        self.units = units_of_unknowns(self.unit, n)
        self.sizes = np.concatenate([weight * self.units, self.scales, np.ones(self.condition.extras)])

    def place(self, w: np.ndarray) -> Place | None:
        """F and its slopes at w = (x, p, q), not scaled; None where the trajectory does not return."""
        x, n = w[: self.n], self.n
        try:
            here = self.map.with_parameters(dict(zip(self.names, map(float, w[n : n + 2]))))
        except ValueError:  # outside the assumptions of a parameter
            return None
        image = here.image(x, self.names)
        if not image.success:
            return None
        place = place_of(here, image, x, self.names)
        return place if np.isfinite(place.DF).all() else None

    def slopes(self, place: Place, w: np.ndarray) -> np.ndarray | None:
        """Of the condition by (x, p, q, e), not scaled."""
        condition, extra = self.condition, w[self.n + 2 :]
        exact = condition.slopes(place, extra)
        if exact is not None:
            return exact
        u, bent = w[: self.n + 2], condition.bent(place)

        def value(there: Place) -> np.ndarray:
            return condition.value(there, extra)

        if bent is not None:
            return along(self.place, place, u, value, bent, self.reach)
        found = differences(self.place, place, u, value, self.reach)
        if found is None or not condition.extras:
            return found
        h = 1e-6
        own = [
            (condition.value(place, extra + h * e) - condition.value(place, extra - h * e)) / (2 * h)
            for e in np.eye(condition.extras)
        ]
        return np.column_stack([found, *own])

    def correct(
        self, guess: np.ndarray, normal: np.ndarray | None, direction: np.ndarray | None
    ) -> Spot | None:
        """Newton's method in the plane normal . (u - guess) = 0, or to the nearest point without one."""
        try:
            return self._corrected(guess, normal, direction)
        except np.linalg.LinAlgError:
            return None

    def _corrected(
        self, guess: np.ndarray, normal: np.ndarray | None, direction: np.ndarray | None
    ) -> Spot | None:
        condition, n, u, last, slopes, slow = self.condition, self.n, guess, math.inf, None, False
        for steps in range(_MOST_NEWTON + 1):
            w = u * self.sizes
            place = self.place(w[: n + 2])
            if place is None:
                return None
            extra = w[n + 2 :]
            # From the second step on the slopes are near enough, as a rule: each evaluation runs 2 (n + 2) orbits.
            if steps < 2 or normal is None or slow:
                slopes = self.slopes(place, w)
            if slopes is None:
                return None
            G = np.concatenate(
                [place.F + condition.unfolding(extra), condition.value(place, extra) - self.offset]
            )
            DG = np.vstack([np.hstack([place.DF, condition.unfolding_slopes(n)]), slopes]) * self.sizes
            DG[:n] /= self.units[:, None]
            rows, right = DG, np.append(-G[:n] / self.units, -G[n:])
            if normal is not None:
                rows, right = np.vstack([DG, normal]), np.append(right, -normal @ (u - guess))
            if not (np.isfinite(rows).all() and np.isfinite(right).all()):
                return None
            move = np.linalg.lstsq(rows, right, rcond=1e-14)[0]
            off = float(np.abs(G[:n] / (self.units + np.abs(w[:n]))).max(initial=0.0))
            size = float(np.abs(move / (1 + np.abs(u))).max())
            if not np.isfinite(size):
                return None
            stands = size > 0.3 * last and size <= _ROUNDED  # roundings are all that moves it
            if off <= TOLERANCE and (size <= _CONVERGED or stands):
                orbit = _orbit(condition, place, off, steps, self.held)
                tangent, alone = only_way(DG, np.ones(len(u)) if direction is None else direction)
                tangent[:n][pinned(place.image)] = 0.0
                tests = condition.tests(place, extra, slopes)
                return Spot(
                    u,
                    tangent,
                    orbit,
                    place.image,
                    steps,
                    alone,
                    extra,
                    tests,
                    condition.twin(place),
                )
            if steps == _MOST_NEWTON or size > 10 * last:
                return None
            last, slow = size, size > _SLOW * last
            u, weight, stays = u + move, self.sizes[:n], pinned(place.image)
            u[:n][stays] = place.image.x[stays] / weight[stays]
            if (there := self._moved(place.map, u)) is None:
                return None
            u = np.concatenate([onto_section(there, u[:n] * weight) / weight, u[n:]])
        return None

    def _moved(self, map_: Any, u: np.ndarray) -> Any:
        map_ = exact(map_)
        inner = map_.map if isinstance(map_, Shooting) else map_
        if not (isinstance(inner, Section) and {*self.names} & {*map(str, inner.surface.free_symbols)}):
            return map_
        values = (u * self.sizes)[self.n : self.n + 2]
        try:
            return map_.with_parameters(dict(zip(self.names, map(float, values))))
        except ValueError:  # outside the assumptions of a parameter
            return None

    def step(self, here: Any, ds: float) -> Any:
        self.reach = ds
        there = super().step(here, ds)
        self.reach = 1.0
        return there

    def framed(self, here: Spot) -> None:
        """Lets the condition follow to a point that has been reached."""
        place = self.place_at(here)
        if place is not None:
            self.condition.frame(place, here.extra)

    def parameters(self, here: Spot) -> dict[str, float]:
        return {name: value_of(here.orbit, name) for name in self.names}

    def rephased(self, here: Any) -> Any:
        """The same orbit on a section at which it slips, where its own one sticks or an event has come near to it.

        In segments where deviations grow too much on the way, in others where they have changed.
        """
        here = self.segmented(here)
        if isinstance(self.map, FromEvent):
            found = self.map.again(here.orbit.map, here.orbit.x)
            if found is not None:
                self.map = dataclasses.replace(self.map, behind=found[0].behind, before=found[0].before)
            return here
        # The way on is told from the parameters, which a cusp has not.
        told = np.linalg.norm(here.way) > 1e-3
        pieces = isinstance(self.map, Shooting)
        inner = self.map.map if pieces else self.map
        if isinstance(self.condition, (Capture, AtFold)):
            place = self.place_at(here)
            about = None if place is None or pieces else captures.recentred(self.condition, place)
            return here if about is None else self._turned(here, *about)
        if isinstance(inner, Windowed) and inner.window is not None:
            return self._recentred(here)
        if not isinstance(here.orbit.map, Stroboscopic) or not told:
            return here
        return self._in_pieces_rephased(here) if pieces else self._in_one_rephased(here)

    def _in_one_rephased(self, here: Spot) -> Spot:
        map_: Any = here.orbit.map
        time = quiet_time(here.run, map_.forcing_period)
        if time is None:
            return here
        part = map_.solved(here.orbit.x, time, map_.system)
        there, x = map_.at_phase(time / map_.forcing_period), part.x[:, -1]
        if isinstance(self.condition, AtEvent):
            return self._turned(here, Windowed(there), x, passed=time - map_.start_time)
        orbit = refine(there, x)
        return self._turned(here, orbit.map, orbit.x) if orbit.success else here

    def _in_pieces_rephased(self, here: Spot) -> Spot:
        map_: Any = here.orbit.map
        place = self.place_at(here)
        if place is None:
            return here
        near, first, last = NEAR * map_.forcing_period, place.image.runs[0], place.image.runs[-1]
        edges = [e.time - first.t[0] for e in first.events] + [last.t[-1] - e.time for e in last.events]
        if min(edges, default=math.inf) > near:
            return here
        at, distance = best_place(place.map, place.image)
        if not 0 < at < 1 or distance * map_.beat < 2 * near:
            return here
        turned = map_.at_phase(map_.phase + at * map_.beat / map_.forcing_period)
        inner = Windowed(turned) if isinstance(place.map.map, Windowed) else turned
        found = at_section(place.map, place.x, place.image, inner)
        return here if found is None else self._turned(here, *found, passed=at * map_.beat)

    def segmented(self, here: Any, must: bool = False) -> Any:
        """The same orbit in segments, in others or in none any more, as deviations from it ask for."""
        place, largest = self.place_at(here), float(np.abs(here.orbit.map_multipliers).max(initial=0.0))
        if place is None or not np.linalg.norm(here.way) > 1e-3 or not self.condition.in_segments:
            return here
        must = must or here.steps > EASY
        found = anew(place.map, place.x, place.image, largest, self.scales, self.held, must)
        if found is None:
            return here
        map_, x, held = found
        return self._turned(here, map_, x, held)

    def cut(self, here: Any) -> Any:
        """The same orbit in segments; None where it is in segments or deviations do not grow on the way."""
        if isinstance(self.map, (Shooting, FromEvent)):
            return None
        there = self.segmented(here, must=True)
        return None if there is here else there

    def _recentred(self, here: Spot) -> Spot:
        """The same orbit with the window about its own approach."""
        place = self.place_at(here)
        if place is None:
            return here
        pieces = isinstance(place.map, Shooting)
        map_, near = place.map.map if pieces else place.map, place.image.approach
        window = map_.window
        T, begins = (map_.forcing_period, map_.start_time) if map_.driven else (1.0, 0.0)
        part = ((near.place - begins) / T - window.begin) / (window.end - window.begin)
        if map_.driven and 0.3 < part < 0.7:
            moved = dataclasses.replace(
                map_, window=dataclasses.replace(window, near=(near.place - begins) / T)
            )
            self.map = dataclasses.replace(self.map, map=moved) if pieces else moved
            return here
        widest = narrowed(place.map, place.image) if pieces else WIDEST
        inner, x = recentred(map_, place.image.runs, near.place, window, T, begins, widest)
        if not pieces:
            return self._turned(here, inner, x)
        if not map_.driven:
            return here
        found = at_section(place.map, place.x, place.image, inner)
        return here if found is None else self._turned(here, *found)

    def place_at(self, here: Any) -> Place | None:
        """The map at a point that has been reached."""
        return self.place((here.u * self.sizes)[: self.n + 2])

    def _turned(self, here: Spot, map_: Any, x: np.ndarray, held: bool = False, passed: float = 0.0) -> Spot:
        """The same point with another map and its points there, on a section which the orbit comes to after a time."""
        turned = copy.copy(self)
        turned.condition = copy.deepcopy(self.condition)
        condition = turned.condition
        if isinstance(condition, AtEvent) and passed and (old := self.place_at(here)) is not None:
            times = condition.times(old.image)
            condition.ordinal = (condition.ordinal - sum(time < passed for time in times)) % len(times)
        turned.take(map_, len(x), held)
        u = np.concatenate([x / turned.sizes[: len(x)], here.u[self.n :]])
        place = turned.place((u * turned.sizes)[: turned.n + 2])
        if place is None:
            return here
        condition.start(place)
        there = turned.correct(u, None, np.concatenate([np.zeros(len(x)), here.tangent[self.n :]]))
        if there is None:
            return here
        self.condition = condition
        self.take(map_, len(x), held)
        return there

    def at(self, near: Spot, other: Spot, index: int, value: float) -> Spot | None:
        """The point between two at which an entry of u has a value."""
        way = other.u - near.u
        guess = near.u + way * (value - near.u[index]) / way[index]
        guess[index] = value
        normal = np.zeros(len(guess))
        normal[index] = 1.0
        return self.correct(guess, normal, near.tangent)


def _orbit(condition: Condition, place: Place, off: float, steps: int, held: bool) -> PeriodicOrbit:
    """The orbit at a point of a curve, as one of the exact map."""
    map_, x, image, word = exact(place.map), place.x, place.image, condition.word(place)
    if isinstance(place.map, FromEvent):
        map_, x = place.map.exact(x, image)
        there = map_.image(x, ())
        # Of an event without speed there is no exact map: what it was made from has the multipliers. Whether the
        # exact motion has a release that is as slow is a matter of rounding.
        if there.success:
            if image.speed > HARDLY or place.map.touches != "adding-sliding":
                off, word = float(np.abs((there.x - x) / (1 + np.abs(x))).max()), there.word
            image = there
    found = off <= _REPEATED and condition.admissible(place)
    message = "continued" if found else "virtual: it is none of the exact system"
    orbit = orbit_of(map_, x, image, off, steps, found, message, (False, held))
    return dataclasses.replace(orbit, word=word)


def where(walk: CurveWalk, here: Spot) -> str:
    return ", ".join(f"{name} = {value:.10g}" for name, value in walk.parameters(here).items())
