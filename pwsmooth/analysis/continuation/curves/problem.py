"""Orbits with a condition along a curve of bifurcations, over two parameters.

    P(x; p, q) = x,   c(x, p, q, e) = 0,   u = (x, p/scale, q/scale, e)

Chain: orbit_problem.py, conditions/ -> **problem** -> ways.py.
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
from ...maps.sections import Stroboscopic
from ...maps.segments import Shooting, best_place
from ...maps.windows import WIDEST, Windowed, recentred
from ...orbits.finding import refine
from ...orbits.fixed_points import TOLERANCE, orbit_of, pinned
from ...orbits.periodic_orbit import PeriodicOrbit
from ...orbits.recutting import anew, at_section, exact, narrowed
from ..conditions import captures
from ..conditions.captures import AtFold, Capture
from ..conditions.conditions import Condition, Place, along, differences, place_of, units_of_unknowns
from ..conditions.tangencies import AtEvent
from ..orbit_problem import EASY, NEAR, OrbitPoint, OrbitProblem, quiet_time
from ..problem import Equations, Problem

HARDLY = 1e-5  # in the unit of dh/dt: the speed of a release that may as well be none
_REPEATED = 1e-6  # to which an orbit beside grazing comes back


@dataclass(frozen=True)
class Spot(OrbitPoint):
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


class CurveProblem(OrbitProblem):
    """An orbit, two parameters and the condition's own unknowns."""

    tolerance, converged, rounded = TOLERANCE, 1e-12, 1e-9

    def __init__(
        self,
        map_: Any,
        condition: Condition,
        names: tuple[str, str],
        ranges: np.ndarray,
        x: np.ndarray,
        held: bool,
    ) -> None:
        self.reach = 1.0  # how long the present step is
        self.condition, self.names, self.ranges = condition, names, ranges
        self.scales = ranges[:, 1] - ranges[:, 0]
        self.offset: Any = 0.0  # what c is, on the way to a first point
        runs = map_.image(x).runs
        moves = extents(runs)
        self.unit = units_of_motion(moves, x[: len(moves)])
        self.take(map_, len(x), held)

    def take(self, map_: Any, n: int, held: bool) -> None:
        """From now on with this map, of n unknowns: those of segments are counted as in orbit_problem.py."""
        self.map: Any = map_
        self.n = self.place = n
        self.held = held
        weight = math.sqrt(map_.number) if isinstance(map_, Shooting) else 1.0
        self.units = units_of_unknowns(self.unit, n)
        self.sizes = np.concatenate([weight * self.units, self.scales, np.ones(self.condition.extras)])

    def map_at(self, w: np.ndarray) -> Place | None:
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
            return along(self.map_at, place, u, value, bent, self.reach)
        found = differences(self.map_at, place, u, value, self.reach)
        if found is None or not condition.extras:
            return found
        h = 1e-6
        own = [
            (condition.value(place, extra + h * e) - condition.value(place, extra - h * e)) / (2 * h)
            for e in np.eye(condition.extras)
        ]
        return np.column_stack([found, *own])

    def equations(
        self, u: np.ndarray, before: Equations | None = None, known: bool = False
    ) -> Equations | None:
        # From the second step on the slopes are near enough: each evaluation runs 2 (n + 2) orbits.
        condition, n, w = self.condition, self.n, u * self.sizes
        place, extra = self.map_at(w[: n + 2]), w[n + 2 :]
        if place is None:
            return None
        slopes = self.slopes(place, w) if before is None else before.parts[1]
        if slopes is None:
            return None
        G = np.concatenate([place.F + condition.unfolding(extra), condition.value(place, extra) - self.offset])
        DG = np.vstack([np.hstack([place.DF, condition.unfolding_slopes(n)]), slopes]) * self.sizes
        off = float(np.abs(G[:n] / (self.units + np.abs(w[:n]))).max(initial=0.0))
        G[:n] /= self.units
        DG[:n] /= self.units[:, None]
        return Equations(G, DG, off, (place, slopes))

    def size(self, equations: Equations, move: np.ndarray, u: np.ndarray) -> float:
        return Problem.size(self, equations, move, u)

    def made(self, u: np.ndarray, equations: Equations, steps: int, tangent: np.ndarray, alone: bool) -> Spot:
        (place, slopes), condition, extra = equations.parts, self.condition, (u * self.sizes)[self.n + 2 :]
        orbit = _orbit(condition, place, equations.error, steps, self.held)
        tangent[: self.n][pinned(place.image)] = 0.0
        tests, twin = condition.tests(place, extra, slopes), condition.twin(place)
        return Spot(u, tangent, steps, alone, orbit, place.image, extra, tests, twin)

    def settled(self, u: np.ndarray, equations: Equations) -> np.ndarray | None:
        place, _ = equations.parts
        return super().settled(u, equations._replace(parts=(exact(place.map), place.image)))

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
        return self.map_at((here.u * self.sizes)[: self.n + 2])

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
        place = turned.map_at((u * turned.sizes)[: turned.n + 2])
        if place is None:
            return here
        condition.start(place)
        there = turned.correct(u, None, np.concatenate([np.zeros(len(x)), here.tangent[self.n :]]))
        if there is None:
            return here
        self.condition = condition
        self.take(map_, len(x), held)
        return there


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
