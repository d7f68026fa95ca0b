"""A curve to one side: what is met between its points, and why it ends.

Chain: problem.py, way.py, bifurcations.py -> **ways** -> two_parameters.py.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...orbits.finding import refine
from ...orbits.itineraries import JUMP, Change, same_itinerary
from ...orbits.periodic_orbit import PeriodicOrbit
from ...orbits.recutting import touched
from ..bifurcations import change_enclosed, of_no_effect, undecided
from ..bracketing import zero_between
from ..conditions.captures import at_threshold
from ..orbit_problem import OrbitProblem
from ..special import CAPTURE, Lead, Special
from ..way import Way
from .emanating import change_along, leads, leads_of_change, of_capture
from .problem import HARDLY, CurveProblem, Spot
from .starts import SMOOTH, TOUCHES

_BRACKET = 1e-10  # of the arc, in which the end of a curve is enclosed
_LOCATED = 1e-12  # of a chord: test functions along curves are known to some 1e-10
_MOST_HALVED = 100
_BEGUN = 1e-6  # of a test function: what is less is a rounding at a start
_EXTRAPOLATED = 5  # points
_RUN_OUT = 5e-3  # of the ranges: so near to its end a curve may have no more points
# So many orbits in a row with such a part of the longest step between them: a step doubles with each, else.
_LAST, _STUCK = 40, 1e-3
_STRAIGHT = 0.02  # of a step: so little aside it comes to lie where the next one may be longer
_CORNER = 0.1  # of that: so near to it a branch is looked for around a corner, ten times that far and more
_BESIDE = 1e-6  # of the scaled parameters: so far beyond a change of itinerary it is looked at


class CurveWay(Way):
    """A curve to one side."""

    problem: CurveProblem
    born: Spot | None = None  # a first point that is one of codimension 2 itself

    def compared(self, point: Spot) -> tuple[np.ndarray, np.ndarray]:
        return point.at, point.way

    def longer(self, here: Spot, there: Spot) -> float:
        # Steps of Newton's method alone do not tell: where slopes have few digits it takes as many with any length. So
        # they count only where the curve bends.
        way = there.u - here.u
        off = np.linalg.norm(way - (way @ here.tangent) * here.tangent)
        return 2.0 if off <= _STRAIGHT * np.linalg.norm(way) else super().longer(here, there)

    def moved_on(self, there: Spot) -> Spot:
        self.problem.framed(there)
        return self.problem.rephased(there)

    def halts(self) -> str:
        last = [spot.at for spot in self.points[-_LAST:]]
        arc = float(np.linalg.norm(np.diff(last, axis=0), axis=1).sum())
        if (said := super().halts()) or len(last) < _LAST or arc >= _STUCK * _LAST * self.longest:
            return said
        why = f"the last {_LAST} of {len(self.points)} orbits cover {arc:.2g} of the ranges"
        return f"stopped at {self.problem.where(self.points[-1])}: {why}."

    def lost(self, here: Spot) -> Spot | None:
        here = self._last(here, self.ds)
        self.points.append(here)
        if self._run_out():
            return None
        why, lost = self._lost(here)
        beyond = self._beyond(here, lost) if self.virtual else None
        if beyond is None:
            self.end = why
        self.ds = self.first
        return beyond

    def met(self, here: Spot, there: Spot) -> Spot | None:
        """Locates what happens on the way; None where the orbit jumps: that point is one of another curve."""
        slow = f"{self.problem.condition.kind} + adding-sliding"
        if min(abs(spot.tests.get(slow, math.inf)) for spot in (here, there)) < HARDLY:
            return self._between(here, there, None)  # their words are of different motions
        if here is self.born or same_itinerary(here.orbit, there.orbit):
            return self._between(here, there, None)
        left, right, _ = change_enclosed(self.problem, here, there)
        change = change_along(left.orbit, right.orbit)
        return None if change.name == JUMP else self._between(here, there, (left, right, change))

    def _between(self, here: Spot, there: Spot, change: Any) -> Spot | None:
        problem, found = self.problem, []
        for name in here.tests:
            a, b = here.tests[name], there.tests.get(name, math.nan)
            if not a * b < 0 or here is self.born and abs(a) < _BEGUN * abs(b):
                continue
            second = name.rpartition(" + ")[2]
            if second in SMOOTH and second != "torus" and undecided(here, there, second):
                continue  # as all along a curve of orbits at rest
            spot = zero_between(problem, here, there, _test(name), _LOCATED)
            why = problem.condition.ends(name)
            if spot is None and why:  # its last part has no points to Newton's method
                return self._short_of(here, there, name, why)
            if spot is None or not abs(spot.tests[name]) <= 0.01 * (abs(a) + abs(b)):
                continue
            place = problem.place_at(spot)
            if place is not None and problem.condition.confirmed(name, place):
                found.append((spot, name, why))
        chord = there.u - here.u
        for spot, name, why in sorted(found, key=lambda f: (f[0].u - here.u) @ chord):
            self._add(name, spot, why, leads(problem, spot, name))
            if why and not (self.virtual and "virtual" in why):
                return self.ends_at(spot, f"{name} at {problem.where(spot)}: {why}.")
        self.turned(here, there)
        if there.twin and not here.twin:
            name = f"{problem.condition.kind} twice"
            # Chords lead from one curve to the other there.
            spot = self._before(here, there, lambda spot: spot.twin)
            why = "from there on it holds at two events at once, as along symmetric orbits: follow these by `symmetry`"
            self._add(name, spot, why)
            return self.ends_at(spot, f"{name} at {problem.where(spot)}: {why}.")
        if change is not None:
            left, right, what = change
            if not of_no_effect(what, left.orbit, right.orbit):
                name = f"{problem.condition.kind} + {what.name}"
                note = "it goes on with another itinerary"
                self._add(name, left, note, leads_of_change(what, left.orbit, right.orbit))
        return there

    def _add(self, name: str, spot: Spot, note: str = "", begins: tuple[Lead, ...] = ()) -> None:
        self.add([Special(name, self.problem.values(spot), spot.orbit, note=note, leads=begins)])

    def _before(self, here: Spot, there: Spot, passed: Callable[[Spot], bool]) -> Spot:
        """The last point before something has been passed, by ever shorter steps."""
        ds = 0.5 * float(np.linalg.norm(there.u - here.u))
        for _ in range(_MOST_HALVED):
            if ds <= _BRACKET:
                break
            spot: Any = self.problem.step(here, ds)
            if spot is None or passed(spot):
                ds *= 0.5
            else:
                here = spot
        return here

    def _short_of(self, here: Spot, there: Spot, name: str, why: str) -> None:
        """The end of a curve whose last part has no points to Newton's method: extrapolated in its test function."""
        spots = [here]
        last = self._before(here, there, lambda spot: not self._nearer(spots, spot, name))
        self.ends_at(last, self._at_zero(spots, name, why))

    def _at_zero(self, spots: list[Spot], name: str, why: str) -> str:
        """The point at which a test function vanishes beyond the last spots of a curve, added; in words."""
        last = spots[-_EXTRAPOLATED:]
        values = dict(zip(self.problem.names, map(float, extrapolated(last, name) * self.problem.scales)))
        where_ = ", ".join(f"{q} = {value:.7g}" for q, value in values.items())
        self.add([Special(name, values, last[-1].orbit, note=f"{why} (extrapolated)")])
        return f"{name} at {where_} (extrapolated): {why}."

    def _run_out(self) -> bool:
        """Whether steps have grown shorter and shorter towards a point at which the curve ends."""
        spots = self.points
        for name in spots[-1].tests:
            why, parts = self.problem.condition.ends(name), [spots[-1]]
            for spot in spots[-2::-1]:
                if abs(spot.tests.get(name, math.nan)) > 1.1 * abs(parts[0].tests[name]):
                    parts.insert(0, spot)
            if not why or len(parts) < _EXTRAPOLATED:
                continue
            if np.linalg.norm(extrapolated(parts[-_EXTRAPOLATED:], name) - spots[-1].at) < _RUN_OUT:
                self.end = self._at_zero(parts, name, why)
                return True
        return False

    @staticmethod
    def _nearer(spots: list[Spot], spot: Spot, name: str) -> bool:
        """Whether a test function is nearer to 0 than it was, which is kept; far enough apart to be extrapolated."""
        a, b = spots[-1].tests[name], spot.tests.get(name, math.nan)
        if not a * b > 0:
            return False
        if abs(b) < 0.9 * abs(a):
            spots.append(spot)
        return True

    def _last(self, here: Spot, ds: float) -> Spot:
        """The last point of the curve with its itinerary, no further than `ds` from here, by bisection.

        Beside a change of itinerary Newton's method may settle a rounding beyond it, where slopes have no bound.
        """
        low, high, last = 0.0, ds, here
        while high - low > _BRACKET:
            middle = 0.5 * (low + high)
            spot: Any = self.problem.step(here, middle)
            if spot is None or not same_itinerary(here.orbit, spot.orbit):
                high = middle
            else:
                low, last = middle, spot
        return last

    def _beyond(self, here: Spot, change: Change | None) -> Spot | None:
        """The same point of a map that does not see the surface which the orbit begins to touch."""
        if not self.problem.condition.of_multipliers:
            return None
        if change is None or change.name not in TOUCHES or len(change.before) > len(change.after):
            return None
        found = touched(here.orbit, change.after[0].switch, change.time)
        if isinstance(found, str):
            return None
        there = self.problem._turned(here, *found)
        return None if there is here else there

    def _lost(self, here: Spot) -> tuple[str, Change | None]:
        """What keeps the curve from going on, in words: a change of itinerary beside its end, as a rule."""
        problem = self.problem
        at = problem.where(here)
        for beyond in self._orbits_beside(here):
            if same_itinerary(here.orbit, beyond):
                continue
            change = change_along(here.orbit, beyond)
            name = f"{problem.condition.kind} + {change.name}"
            self._add(name, here, str(change), leads_of_change(change, here.orbit, beyond))
            why = (
                f"beyond it the orbit has another itinerary, and no {problem.condition.kind} was found beside."
            )
            return f"{name} at {at}: {why}", change
        if at_threshold(here.orbit):
            name = f"{problem.condition.kind} + {CAPTURE}"
            why = "beyond it the contact is captured or passes, and the Poincare map jumps"
            self._add(name, here, why, of_capture(here.orbit))
            return f"{name} at {at}: {why}.", None
        return f"no orbit was found beyond {at} with steps down to {self.shortest:.1g}.", None

    def _orbits_beside(self, here: Spot) -> Iterator[PeriodicOrbit]:
        """Orbits beside the end of a curve: ahead of it, and on the branch over one parameter, to both sides.

        That branch turns at a fold: those that are ahead may be none of its orbits.
        """
        problem, n = self.problem, self.problem.n
        reaches = (_BESIDE, 10 * _BESIDE, 100 * _BESIDE)
        for reach in reaches:
            ahead = ((here.u + reach * here.tangent) * problem.sizes)[n : n + 2]
            try:
                map_ = here.orbit.map.with_parameters(dict(zip(problem.names, map(float, ahead))))
            except ValueError:  # outside the assumptions of a parameter
                continue
            if (beyond := refine(map_, here.orbit.x)).success:
                yield beyond
        branch = OrbitProblem(here.orbit, problem.names[0], float(problem.scales[0]))
        point = branch.point(here.orbit, np.append(np.ones(len(here.orbit.x)), 1.0))
        for reach in reaches:
            for side in (1, -1):
                on = dataclasses.replace(point, tangent=side * point.tangent)
                there = branch.step(on, reach) or branch.turn(on, _CORNER * reach)
                if there is not None:
                    yield there.orbit


def extrapolated(spots: list[Spot], name: str) -> np.ndarray:
    """Both parameters, scaled, where a test function vanishes, from its values at some points."""
    e = np.array([spot.tests[name] for spot in spots])
    weights = [np.prod(np.delete(e, k) / (np.delete(e, k) - e[k])) for k in range(len(e))]
    return np.array(weights) @ np.array([spot.at for spot in spots])


def _test(name: str) -> Callable[[Spot], float]:
    return lambda spot: spot.tests[name]
