"""A curve to one side: its steps, what is met between them, and why it ends.

Chain: curve_walk.py, bifurcations.py -> **curve_ways** -> curves.py.
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
from ..arclength import Walk
from ..bifurcations import change_enclosed, of_no_effect, undecided
from ..bracketing import zero_between
from ..codimension import Codimension2
from ..conditions.captures import CAPTURE, at_threshold
from .emanating import change_along, leads, leads_of_change, of_capture
from .starts import SMOOTH, TOUCHES
from .walk import HARDLY, CurveWalk, Spot, where

_BRACKET = 1e-10  # of the arc, in which the end of a curve is enclosed
_LOCATED = 1e-12  # of a chord: test functions along curves are known to some 1e-10
_MOST_HALVED = 100
_BEGUN = 1e-6  # of a test function: what is less is a rounding at a start
_EXTRAPOLATED = 5  # points
_RUN_OUT = 5e-3  # of the ranges: so near to its end a curve may have no more points
_TURNS = 1e-7  # of a unit tangent: what is less may be a rounding
# So many orbits in a row with such a part of the longest step between them: a step doubles with each, else.
_LAST, _STUCK = 40, 1e-3
_AT = 1e-14  # of the ranges: on the border
_STRAIGHT = 0.02  # of a step: so little aside it comes to lie where the next one may be longer
_CORNER = 0.1  # of that: so near to it a branch is looked for around a corner, ten times that far and more
_BESIDE = 1e-6  # of the scaled parameters: so far beyond a change of itinerary it is looked at


class Way:
    """A curve to one side."""

    def __init__(
        self, walk: CurveWalk, bounds: np.ndarray, lengths: Any, most: int, virtual: bool, used_up: Any
    ) -> None:
        self.walk, self.bounds, self.lengths, self.most, self.used_up = walk, bounds, lengths, most, used_up
        self.virtual = virtual
        self.points: list[Codimension2] = []
        self.turns: list[Codimension2] = []
        self.closed = False
        self.born: Spot | None = None  # a first point that is one of codimension 2 itself

    def followed(self, here: Spot) -> tuple[list[Spot], list[Codimension2], str]:
        step, longest, shortest = self.lengths
        walk, spots, ds = self.walk, [here], min(step, longest)
        looked_at = None  # the point whose segments are those that it asks for
        while len(spots) < self.most:
            at = where(walk, here)
            if self.used_up():
                return self._ended(spots, f"`max_steps` or `max_seconds` are used up at {at}: give more.")
            if not here.alone:
                return self._ended(spots, f"at {at} no single way leads on: two curves meet there.")
            there, change = self._stepped(here, ds), None
            if there is not None:
                there, reached = self._within(here, there)
                if there is None:
                    return self._ended(spots, f"no orbit was found at {reached}.")
                there, change = self._next(here, there)
            if there is None:
                if here is not looked_at and (other := walk.cut(here)) is not None:
                    here = looked_at = other
                    continue
                looked_at = here
                if ds > shortest:
                    ds *= 0.3
                    continue
                here = self._last(here, ds)
                spots.append(here)
                if said := self._run_out(spots):
                    return self._ended(spots, said)
                why, lost = self._lost(here)
                beyond = self._beyond(here, lost) if self.virtual else None
                if beyond is None:
                    return self._ended(spots, why)
                here, ds = beyond, step
                continue
            if end := self._between(here, there, change):
                last, why = end
                return self._ended([*spots, last], why)
            spots.append(there)
            if reached:
                return self._ended(spots, f"reached {reached}.")
            if self._closes(spots):
                self.closed = True
                return self._ended(spots, "it closes.")
            ds = min(ds * self._longer(here, there), longest)
            walk.framed(there)
            here = walk.rephased(there)
            if (arc := self._covered(spots)) < _STUCK * _LAST * longest:
                why = f"the last {_LAST} of {len(spots)} orbits cover {arc:.2g} of the ranges"
                return self._ended(spots, f"stopped at {where(walk, here)}: {why}.")
        return self._ended(spots, f"stopped after {len(spots)} orbits (`max_points`).")

    def _stepped(self, here: Spot, ds: float) -> Any:
        """One step, no further than the border of the ranges: beyond it a parameter may have no meaning."""
        walk, n = self.walk, self.walk.n
        ways = []
        for k in (0, 1):
            rate = here.tangent[n + k]
            border = self.bounds[k][int(rate > 0)] / walk.sizes[n + k]
            if rate and 0 < (border - here.u[n + k]) / rate < ds:
                ways.append(((border - here.u[n + k]) / rate, n + k, border))
        if not ways:
            return walk.step(here, ds)
        reach, index, border = min(ways)
        guess = here.u + reach * here.tangent
        guess[index] = border
        normal = np.zeros(len(guess))
        normal[index] = 1.0
        there = walk.correct(guess, normal, here.tangent)
        return (
            there
            if there is not None and np.linalg.norm(there.u - here.u) <= 2 * reach
            else walk.step(here, ds)
        )

    @staticmethod
    def _covered(spots: list[Spot]) -> float:
        """How far the last orbits have led, in the plane of both parameters."""
        last = [spot.at for spot in spots[-_LAST:]]
        if len(last) < _LAST:
            return math.inf
        return float(np.linalg.norm(np.diff(last, axis=0), axis=1).sum())

    @staticmethod
    def _longer(here: Spot, there: Spot) -> float:
        """By what the next step is longer.

        Steps of Newton's method alone do not tell: where slopes have few digits it takes as many with any length. So
        they count only where the curve bends.
        """
        way = there.u - here.u
        off = np.linalg.norm(way - (way @ here.tangent) * here.tangent)
        if there.steps <= 3 or off <= _STRAIGHT * np.linalg.norm(way):
            return 2.0
        return 1.0 if there.steps <= 5 else 0.5

    def _ended(self, spots: list[Spot], why: str) -> tuple[list[Spot], list[Codimension2], str]:
        return spots, self.points, why

    def _within(self, here: Spot, there: Spot) -> tuple[Spot | None, str]:
        """The point, or that on the border of the ranges which the way to it passes, and the border in words."""
        n, walk = self.walk.n, self.walk
        for k in (0, 1):
            u, scale = there.u[n + k], walk.sizes[n + k]
            low, high = self.bounds[k] / scale
            over, under = u >= high - _AT and u > here.u[n + k], u <= low + _AT and u < here.u[n + k]
            past = high if over else low if under else None
            if past is not None and abs(u - past) > _AT:
                at = walk.at(here, there, n + k, past)
                return at, f"{walk.names[k]} = {past * scale:.9g}"
            if past is not None:
                return there, f"{walk.names[k]} = {past * scale:.9g}"
        return there, ""

    def _next(self, here: Spot, there: Spot) -> tuple[Spot | None, Any]:
        """The next point, with the last and the first one about a change of itinerary on the way and its name.

        None where the orbit jumps: that point is one of another part of the curve, or of another curve.
        """
        slow = f"{self.walk.condition.kind} + adding-sliding"
        if min(abs(spot.tests.get(slow, math.inf)) for spot in (here, there)) < HARDLY:
            return there, None  # their words are of different motions
        if here is self.born or same_itinerary(here.orbit, there.orbit):
            return there, None
        left, right, _ = change_enclosed(self.walk, here, there)
        change = change_along(left.orbit, right.orbit)
        return (None, None) if change.name == JUMP else (there, (left, right, change))

    def _between(self, here: Spot, there: Spot, change: Any) -> tuple[Spot, str] | None:
        """Locates what happens on the way between two points; where and why the curve ends there, if it does."""
        walk, found = self.walk, []
        for name in here.tests:
            a, b = here.tests[name], there.tests.get(name, math.nan)
            if not a * b < 0 or here is self.born and abs(a) < _BEGUN * abs(b):
                continue
            second = name.rpartition(" + ")[2]
            if second in SMOOTH and second != "torus" and undecided(here, there, second):
                continue  # as all along a curve of orbits at rest
            spot = zero_between(walk, here, there, _test(name), _LOCATED)
            why = walk.condition.ends(name)
            if spot is None and why:
                return self._short_of(here, there, name, why)
            if spot is None or not abs(spot.tests[name]) <= 0.01 * (abs(a) + abs(b)):
                continue
            place = walk.place_at(spot)
            if place is not None and walk.condition.confirmed(name, place):
                found.append((spot, name, why))
        chord = there.u - here.u
        for spot, name, why in sorted(found, key=lambda f: (f[0].u - here.u) @ chord):
            self.points.append(
                Codimension2(name, walk.parameters(spot), spot.orbit, why, leads(walk, spot, name))
            )
            if why and not (self.virtual and "virtual" in why):
                return spot, f"{name} at {where(walk, spot)}: {why}."
        self._turns(here, there)
        if there.twin and not here.twin:
            name = f"{walk.condition.kind} twice"
            # Chords lead from one curve to the other there.
            spot = self._before(here, there, lambda spot: spot.twin)
            why = "from there on it holds at two events at once, as along symmetric orbits: follow these by `symmetry`"
            self.points.append(Codimension2(name, walk.parameters(spot), spot.orbit, why))
            return spot, f"{name} at {where(walk, spot)}: {why}."
        if change is not None:
            left, right, what = change
            if not of_no_effect(what, left.orbit, right.orbit):
                name = f"{walk.condition.kind} + {what.name}"
                note = "it goes on with another itinerary"
                begins = leads_of_change(what, left.orbit, right.orbit)
                self.points.append(Codimension2(name, walk.parameters(left), left.orbit, note, begins))
        return None

    def _turns(self, here: Spot, there: Spot) -> None:
        """Where the curve turns back in one of the parameters between two points."""
        for k, name in enumerate(self.walk.names, self.walk.n):
            rates = here.tangent[k], there.tangent[k]
            if rates[0] * rates[1] < 0 and max(np.abs(rates)) > _TURNS:
                spot = zero_between(self.walk, here, there, _rate(k), _LOCATED)
                if spot is not None:
                    turn = Codimension2(f"turns in {name}", self.walk.parameters(spot), spot.orbit)
                    self.turns.append(turn)

    def _before(self, here: Spot, there: Spot, passed: Callable[[Spot], bool]) -> Spot:
        """The last point before something has been passed, by ever shorter steps."""
        ds = 0.5 * float(np.linalg.norm(there.u - here.u))
        for _ in range(_MOST_HALVED):
            if ds <= _BRACKET:
                break
            spot: Any = self.walk.step(here, ds)
            if spot is None or passed(spot):
                ds *= 0.5
            else:
                here = spot
        return here

    def _short_of(self, here: Spot, there: Spot, name: str, why: str) -> tuple[Spot, str]:
        """The end of a curve whose last part has no points to Newton's method: extrapolated in its test function."""
        spots = [here]
        last = self._before(here, there, lambda spot: not self._nearer(spots, spot, name))
        return last, self._at_zero(spots, name, why)

    def _at_zero(self, spots: list[Spot], name: str, why: str) -> str:
        """The point at which a test function vanishes beyond the last spots of a curve, added; in words."""
        last = spots[-_EXTRAPOLATED:]
        values = dict(zip(self.walk.names, map(float, extrapolated(last, name) * self.walk.scales)))
        where_ = ", ".join(f"{q} = {value:.7g}" for q, value in values.items())
        self.points.append(Codimension2(name, values, last[-1].orbit, f"{why} (extrapolated)"))
        return f"{name} at {where_} (extrapolated): {why}."

    def _run_out(self, spots: list[Spot]) -> str:
        """Whether steps have grown shorter and shorter towards a point at which the curve ends, in words."""
        for name in spots[-1].tests:
            why, parts = self.walk.condition.ends(name), [spots[-1]]
            for spot in spots[-2::-1]:
                if abs(spot.tests.get(name, math.nan)) > 1.1 * abs(parts[0].tests[name]):
                    parts.insert(0, spot)
            if not why or len(parts) < _EXTRAPOLATED:
                continue
            if np.linalg.norm(extrapolated(parts[-_EXTRAPOLATED:], name) - spots[-1].at) < _RUN_OUT:
                return self._at_zero(parts, name, why)
        return ""

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
            spot: Any = self.walk.step(here, middle)
            if spot is None or not same_itinerary(here.orbit, spot.orbit):
                high = middle
            else:
                low, last = middle, spot
        return last

    def _beyond(self, here: Spot, change: Change | None) -> Spot | None:
        """The same point of a map that does not see the surface which the orbit begins to touch."""
        if not self.walk.condition.of_multipliers:
            return None
        if change is None or change.name not in TOUCHES or len(change.before) > len(change.after):
            return None
        found = touched(here.orbit, change.after[0].switch, change.time)
        if isinstance(found, str):
            return None
        there = self.walk._turned(here, *found)
        return None if there is here else there

    def _lost(self, here: Spot) -> tuple[str, Change | None]:
        """What keeps the curve from going on, in words: a change of itinerary beside its end, as a rule."""
        walk = self.walk
        at = where(walk, here)
        for beyond in self._orbits_beside(here):
            if same_itinerary(here.orbit, beyond):
                continue
            change = change_along(here.orbit, beyond)
            name = f"{walk.condition.kind} + {change.name}"
            begins = leads_of_change(change, here.orbit, beyond)
            self.points.append(Codimension2(name, walk.parameters(here), here.orbit, str(change), begins))
            why = f"beyond it the orbit has another itinerary, and no {walk.condition.kind} was found beside."
            return f"{name} at {at}: {why}", change
        if at_threshold(here.orbit):
            name = f"{walk.condition.kind} + {CAPTURE}"
            why = "beyond it the contact is captured or passes, and the Poincare map jumps"
            begins = of_capture(here.orbit)
            self.points.append(Codimension2(name, walk.parameters(here), here.orbit, why, begins))
            return f"{name} at {at}: {why}.", None
        return f"no orbit was found beyond {at} with steps down to {self.lengths[2]:.1g}.", None

    def _orbits_beside(self, here: Spot) -> Iterator[PeriodicOrbit]:
        """Orbits beside the end of a curve: ahead of it, and on the branch over one parameter, to both sides.

        That branch turns at a fold: those that are ahead may be none of its orbits.
        """
        walk, n = self.walk, self.walk.n
        reaches = (_BESIDE, 10 * _BESIDE, 100 * _BESIDE)
        for reach in reaches:
            ahead = ((here.u + reach * here.tangent) * walk.sizes)[n : n + 2]
            try:
                map_ = here.orbit.map.with_parameters(dict(zip(walk.names, map(float, ahead))))
            except ValueError:  # outside the assumptions of a parameter
                continue
            if (beyond := refine(map_, here.orbit.x)).success:
                yield beyond
        branch = Walk(here.orbit, walk.names[0], float(walk.scales[0]))
        point = branch.point(here.orbit, np.append(np.ones(len(here.orbit.x)), 1.0))
        for reach in reaches:
            for side in (1, -1):
                on = dataclasses.replace(point, tangent=side * point.tangent)
                there = branch.step(on, reach) or branch.turn(on, _CORNER * reach)
                if there is not None:
                    yield there.orbit

    def _closes(self, spots: list[Spot]) -> bool:
        """Whether the last step has passed the first point, along the same way."""
        if len(spots) < 5:
            return False
        first, a, b = spots[0], spots[-2], spots[-1]
        chord, to = b.at - a.at, first.at - a.at
        length = float(chord @ chord)
        if length == 0 or not 0 <= to @ chord <= length:
            return False
        aside = np.linalg.norm(to - chord * (to @ chord) / length)
        along = first.way @ chord > 0.8 * np.linalg.norm(first.way) * math.sqrt(length)
        # Beside a canard a multiplier changes by much within a step: the first one's is between those of its ends.
        one, *ends = (np.abs(spot.orbit.map_multipliers) for spot in (first, a, b))
        beside = np.maximum(np.min(ends, axis=0) - one, one - np.max(ends, axis=0))
        return bool(aside < 0.2 * math.sqrt(length) and along and np.all(beside <= 0.1 * (1 + one)))


def extrapolated(spots: list[Spot], name: str) -> np.ndarray:
    """Both parameters, scaled, where a test function vanishes, from its values at some points."""
    e = np.array([spot.tests[name] for spot in spots])
    weights = [np.prod(np.delete(e, k) / (np.delete(e, k) - e[k])) for k in range(len(e))]
    return np.array(weights) @ np.array([spot.at for spot in spots])


def _test(name: str) -> Callable[[Spot], float]:
    return lambda spot: spot.tests[name]


def _rate(k: int) -> Callable[[Spot], float]:
    return lambda spot: float(spot.tangent[k])
