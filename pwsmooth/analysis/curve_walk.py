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

from .arclength import Point, Walk, only_way, quiet_time, value_of
from .conditions import Condition, Place, differences
from .fixed_points import TOLERANCE, onto_section
from .impacts import FromImpact, from_impact
from .orbits import refine
from .periodic_orbit import PeriodicOrbit
from .sections import Section, Stroboscopic
from .tangencies import AtEvent
from .windows import Windowed, recentred

_MOST_NEWTON = 8
_CONVERGED, _ROUNDED = 1e-12, 1e-9  # of the unknowns: what the last correction is, and may be where it stays so
_REPEATED = 1e-6  # to which an orbit beside grazing comes back


@dataclass(frozen=True)
class Spot(Point):
    """A point of a curve: u = (x, p/scale, q/scale, e), what its own unknowns e are, and its test functions."""

    extra: np.ndarray = field(default_factory=lambda: np.empty(0))
    tests: Mapping[str, float] = field(default_factory=dict)
    twin: bool = False


class CurveWalk(Walk):
    """Predictor and corrector in the space of states, two parameters and the condition's own unknowns."""

    def __init__(
        self, map_: Any, condition: Condition, names: tuple[str, str], scales: np.ndarray, n: int
    ) -> None:
        self.map: Any = map_
        self.segments, self.weight, self.must = None, 1.0, False
        self.condition, self.names, self.n = condition, names, n
        self.sizes = np.concatenate([np.ones(n), scales, np.ones(condition.extras)])
        self.offset: Any = 0.0  # what c is, on the way to a first point

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
        DF = np.column_stack([image.jacobian - np.eye(n), image.by_parameter])
        return Place(here, image, x, image.x - x, DF, self.names) if np.isfinite(DF).all() else None

    def slopes(self, place: Place, w: np.ndarray) -> np.ndarray | None:
        """Of the condition by (x, p, q, e), not scaled."""
        condition, extra = self.condition, w[self.n + 2 :]
        exact = condition.slopes(place, extra)
        if exact is not None:
            return exact
        found = differences(self.place, place, w[: self.n + 2], lambda there: condition.value(there, extra))
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
        condition, n, u, last, slopes = self.condition, self.n, guess, math.inf, None
        for steps in range(_MOST_NEWTON + 1):
            w = u * self.sizes
            place = self.place(w[: n + 2])
            if place is None:
                return None
            extra = w[n + 2 :]
            # From the second step on the slopes are near enough: each evaluation runs 2 (n + 2) orbits.
            if steps < 2 or normal is None:
                slopes = self.slopes(place, w)
            if slopes is None:
                return None
            G = np.concatenate(
                [place.F + condition.unfolding(extra), condition.value(place, extra) - self.offset]
            )
            DG = np.vstack([np.hstack([place.DF, condition.unfolding_slopes(n)]), slopes]) * self.sizes
            rows, right = DG, -G
            if normal is not None:
                rows, right = np.vstack([DG, normal]), np.append(right, -normal @ (u - guess))
            if not (np.isfinite(rows).all() and np.isfinite(right).all()):
                return None
            move = np.linalg.lstsq(rows, right, rcond=1e-14)[0]
            off = float(np.abs(G[:n] / (1 + np.abs(w[:n]))).max(initial=0.0))
            size = float(np.abs(move / (1 + np.abs(u))).max())
            if not np.isfinite(size):
                return None
            stands = size > 0.3 * last and size <= _ROUNDED  # roundings are all that moves it
            if off <= TOLERANCE and (size <= _CONVERGED or stands):
                orbit = _orbit(condition, place, off, steps)
                tangent, alone = only_way(DG, np.ones(len(u)) if direction is None else direction)
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
            last = size
            u = u + move
            if isinstance(_exact(place.map), Section):
                u = np.concatenate([onto_section(_exact(place.map), u[:n]), u[n:]])
        return None

    def framed(self, here: Spot) -> None:
        """Lets the condition follow to a point that has been reached."""
        place = self.place((here.u * self.sizes)[: self.n + 2])
        if place is not None:
            self.condition.frame(place, here.extra)

    def parameters(self, here: Spot) -> dict[str, float]:
        return {name: value_of(here.orbit, name) for name in self.names}

    def rephased(self, here: Any) -> Any:
        """The same orbit on a section at which it slips, where its own one sticks or an event has come near to it."""
        if isinstance(self.condition, AtEvent):
            return self._retimed(here)
        if isinstance(self.map, Windowed):
            return self._recentred(here)
        if isinstance(self.map, FromImpact):
            found = from_impact(here.orbit.map, here.orbit.x)
            if found is not None:
                self.map = dataclasses.replace(self.map, behind=found[0].behind, before=found[0].before)
            return here
        map_ = here.orbit.map
        # The way on is told from the parameters, which a cusp has not.
        told = np.linalg.norm(here.tangent[self.n : self.n + 2]) > 1e-3
        time = quiet_time(here.run, map_.forcing_period) if isinstance(map_, Stroboscopic) and told else None
        if time is None:
            return here
        part = map_.solved(here.orbit.x, time, map_.system)
        orbit = refine(map_.at_phase(time / map_.forcing_period), part.x[:, -1])
        return self._turned(here, orbit.map, orbit.x) if orbit.success else here

    def _retimed(self, here: Spot) -> Spot:
        """The same orbit on a section far from events, and the number of the one that matters counted from there."""
        map_, run = here.orbit.map, here.run
        if not isinstance(map_, Stroboscopic):
            return here
        time = quiet_time(run, map_.forcing_period)
        if time is None:
            return here
        condition = self.condition
        assert isinstance(condition, AtEvent)
        old = condition.ordinal
        count = len(condition.events(run))
        before = sum(run.events[k].time < time for k in condition.events(run))
        there = map_.solved(here.orbit.x, time, map_.system)
        condition.ordinal = (old - before) % count
        found = self._turned(here, Windowed(map_.at_phase(time / map_.forcing_period)), there.x[:, -1])
        if found is here:
            condition.ordinal = old
        return found

    def _recentred(self, here: Spot) -> Spot:
        """The same orbit with the window about its own approach."""
        place = self.place((here.u * self.sizes)[: self.n + 2])
        if place is None or place.map.window is None:
            return here
        map_, window, near = place.map, place.map.window, place.image.approach
        T, begins = (map_.forcing_period, map_.start_time) if map_.driven else (1.0, 0.0)
        part = ((near.place - begins) / T - window.begin) / (window.end - window.begin)
        if map_.driven and 0.3 < part < 0.7:
            self.map = dataclasses.replace(
                self.map, window=dataclasses.replace(window, near=(near.place - begins) / T)
            )
            return here
        return self._turned(here, *recentred(map_, place.image.runs, near.place, window, T, begins))

    def _turned(self, here: Spot, map_: Any, x: np.ndarray) -> Spot:
        """The same point with another map and its point there."""
        turned = copy.copy(self)
        turned.map = map_
        turned.condition = copy.deepcopy(self.condition)
        u = np.concatenate([x, here.u[self.n :]])
        place = turned.place((u * self.sizes)[: self.n + 2])
        if place is None:
            return here
        turned.condition.start(place)
        there = turned.correct(u, None, np.concatenate([np.zeros(self.n), here.tangent[self.n :]]))
        if there is None:
            return here
        self.map, self.condition = turned.map, turned.condition
        return there

    def at(self, near: Spot, other: Spot, index: int, value: float) -> Spot | None:
        """The point between two at which an entry of u has a value."""
        way = other.u - near.u
        guess = near.u + way * (value - near.u[index]) / way[index]
        guess[index] = value
        normal = np.zeros(len(guess))
        normal[index] = 1.0
        return self.correct(guess, normal, near.tangent)


def _exact(map_: Any) -> Any:
    return map_.base if isinstance(map_, (Windowed, FromImpact)) else map_


def _orbit(condition: Condition, place: Place, off: float, steps: int) -> PeriodicOrbit:
    """The orbit at a point of a curve, as one of the exact map."""
    map_, x, image, word = _exact(place.map), place.x, place.image, condition.word(place)
    if isinstance(place.map, FromImpact):
        map_, x = place.map.exact(x, image)
        exact = map_.image(x, ())
        # Of an impact without speed there is no exact map: what it was made from has the multipliers.
        if exact.success:
            image, off = exact, float(np.abs((exact.x - x) / (1 + np.abs(x))).max())
            word = image.word
    found = off <= _REPEATED and condition.admissible(place)
    message = "continued" if found else "virtual: it is none of the exact system"
    return PeriodicOrbit(
        map_, x, off, image.jacobian, word, image.time, steps, found, message, image.degenerate
    )


def where(walk: CurveWalk, here: Spot) -> str:
    return ", ".join(f"{name} = {value:.10g}" for name, value in walk.parameters(here).items())
