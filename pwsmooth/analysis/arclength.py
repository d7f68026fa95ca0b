"""Steps along a branch of periodic orbits: predictor, corrector, and a section that keeps away from events.

    P(x; q) - x = 0,    tau . (u - u0) = ds,    u = (x, q/scale)          (H. B. Keller, 1977)

Chain: sections.py, orbits.py -> **arclength** -> bifurcations.py, continuation.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..results.solution import Solution
from .itineraries import same_itinerary
from .orbits import MULTIPLIERS, TOLERANCE, PeriodicOrbit, onto_section, refine
from .sections import Section, Stroboscopic
from .variations import chosen_parameters, moved, sticks_at_start

_MOST_NEWTON = 8
_NEAR = 0.03  # of the period: an event so near to the section moves it


def value_of(orbit: PeriodicOrbit, name: str) -> float:
    return next(value for p, value in orbit.system.parameters.items() if p.name == name)


@dataclass(frozen=True)
class Point:
    """A point of the branch: u = (x, q/scale), the unit tangent there, the orbit, its run and Newton's steps.

    `alone` is False where the equations leave more than one direction: a family of orbits at one parameter value.
    """

    u: np.ndarray
    tangent: np.ndarray
    orbit: PeriodicOrbit
    run: Solution
    steps: int
    alone: bool = True


class Walk:
    """Predictor, corrector and bisection in the plane of states and one parameter."""

    def __init__(self, orbit: PeriodicOrbit, name: str, scale: float) -> None:
        self.map, self.name, self.scale = orbit.map, name, scale

    def value(self, point: Point) -> float:
        return float(point.u[-1] * self.scale)

    def image(self, u: np.ndarray):
        """F, DF (n, n + 1) and the image at u; None where the trajectory does not return or q is not allowed."""
        try:
            here = self.map.with_parameters({self.name: float(u[-1] * self.scale)})
        except ValueError:  # outside the assumptions of the parameter
            return None
        image = here.image(u[:-1], (self.name,))
        if not image.success:
            return None
        F = image.x - u[:-1]
        DF = np.column_stack([image.jacobian - np.eye(len(F)), image.by_parameter[:, 0] * self.scale])
        return (here, image, F, DF) if np.isfinite(DF).all() else None

    def point(self, orbit: PeriodicOrbit, direction: np.ndarray) -> Point:
        """The point of a converged orbit, with its tangent along `direction`."""
        u = np.append(orbit.x, value_of(orbit, self.name) / self.scale)
        equations = self.image(u)
        assert equations is not None
        return Point(
            u, _tangent(equations[3], direction), orbit, equations[1].solution, 0, _full_rank(equations[3])
        )

    def correct(self, guess: np.ndarray, normal: np.ndarray, direction: np.ndarray) -> Point | None:
        """Newton's method in the plane normal . (u - guess) = 0."""
        u, last = guess, math.inf
        for steps in range(_MOST_NEWTON + 1):
            equations = self.image(u)
            if equations is None:
                return None
            here, image, F, DF = equations
            size = float(np.abs(F / (1 + np.abs(u[:-1]))).max(initial=0.0))
            if size <= TOLERANCE:
                orbit = PeriodicOrbit(
                    here, u[:-1], size, image.jacobian, image.word, image.time, steps, True,
                    "continued", image.degenerate,
                )  # fmt: skip
                return Point(u, _tangent(DF, direction), orbit, image.solution, steps, _full_rank(DF))
            if size > 10 * last or steps == _MOST_NEWTON:
                return None
            last = size
            right = np.append(-F, -normal @ (u - guess))
            u = u + np.linalg.lstsq(np.vstack([DF, normal]), right, rcond=1e-14)[0]
            if isinstance(here, Section):
                u = np.append(onto_section(here, u[:-1]), u[-1])
        return None

    def rephased(self, here: Point) -> Point:
        """The same orbit on a section at which it slips, where its own one sticks or an event has come near to it."""
        section = here.orbit.map
        if not (isinstance(self.map, Stroboscopic) and isinstance(section, Stroboscopic)):
            return here
        run, period = here.run, section.forcing_period
        times = np.array([e.time for e in run.events])
        edge = min(times[0] - run.t[0], run.t[-1] - times[-1]) if times.size else math.inf
        if edge > _NEAR * period:
            return here
        bounds = np.unique(np.concatenate([run.t[:1], times, run.t[-1:]]))
        middles, lengths = (bounds[1:] + bounds[:-1]) / 2, np.diff(bounds)
        column = np.searchsorted(run.t, middles, side="right") - 1
        lengths = lengths * np.all(run.status[:, column] != 0, axis=0)
        best = int(np.argmax(lengths))
        if lengths[best] < 4 * _NEAR * period:
            return here
        map_, time = self.map, middles[best]
        part = map_.solved(here.u[:-1], time, here.orbit.system)
        found = moved(part, chosen_parameters(part.system, (self.name,)))
        turned = map_.at_phase(time / period)
        slope = section._period_slope(self.name)
        along = found.matrix @ here.tangent[:-1] + here.tangent[-1] * self.scale * (
            found.by_parameter[:, 0]
            + found.rates * slope * time / period
            - found.matrix @ found.first_rates * slope * map_.phase
        )
        orbit = refine(turned.with_parameters({self.name: self.value(here)}), part.x[:, -1])
        if not orbit.success:
            return here
        self.map = turned
        return self.point(orbit, np.append(along, here.tangent[-1]))

    def step(self, here: Point, ds: float) -> Point | None:
        """One step along the tangent; None if it must be shorter."""
        there = self.correct(here.u + ds * here.tangent, here.tangent, here.tangent)
        if there is None or np.linalg.norm(there.u - here.u) > 2 * ds:
            return None
        if ds > 1e-3 and sticks_at_start(there.run) and not sticks_at_start(here.run):
            return None  # a shorter step comes near enough to move the section first
        # Within one itinerary the branch is smooth; between two it may have a corner.
        if there.tangent @ here.tangent < 0.8 and same_itinerary(here.orbit, there.orbit):
            return None
        return there

    def turn(self, here: Point, ds: float) -> Point | None:
        """Around a corner at which the branch turns back: along the tangent of the other side."""
        for reach in (10 * ds, 100 * ds, 1000 * ds):
            equations = self.image(here.u + reach * here.tangent)
            if equations is None:
                continue
            other = _tangent(equations[3], here.tangent)
            for direction in (other, -other):
                there = self.correct(here.u + 2 * reach * direction, direction, direction)
                if there is None or np.linalg.norm(there.u - here.u) > 20 * reach:
                    continue
                if not same_itinerary(here.orbit, there.orbit):
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
        largest = float(np.abs(here.orbit.map_multipliers).max())
        if largest > 1e4:
            return (
                f"no orbit was found beyond {where} with steps down to {ds:.1g}: its largest multiplier has grown to "
                f"{largest:.2g}, so that a period is too long to be shot over."
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
        """The point whose projection on the chord is at a part of it, along the tangent of a near one first."""
        chord = there.u - here.u
        normal = chord / np.linalg.norm(chord)
        target = here.u + part * chord
        guesses = [target]
        if near is not None and abs(slope := near.tangent @ normal) > 0.1:
            guesses.insert(0, near.u + near.tangent * (normal @ (target - near.u)) / slope)
        for guess in guesses:
            point = self.correct(guess, normal, here.tangent)
            if point is not None:
                return point
        return None


def _full_rank(DF: np.ndarray) -> bool:
    sizes = np.linalg.svd(DF, compute_uv=False)
    return bool(sizes[-1] > MULTIPLIERS * max(1.0, sizes[0]))


def _tangent(DF: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Unit null vector of DF (n, n + 1), to the side of `direction`."""
    tangent = np.linalg.svd(DF)[2][-1]
    return tangent if tangent @ direction >= 0 else -tangent
