"""A branch to one side: its steps, what is met between them, and why it ends; and both sides as one.

    ahead  ->  what is met on the way  ->  the next point, or the end
    a step that finds nothing: more unknowns, a shorter step, around a corner, the end

Chain: problem.py, bracketing.py -> **way** -> branches.py, two_parameters.py, equilibria/.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ...paths.budget import Budget
from .bracketing import zero_between
from .special import Special

CLOSED = "it closes."
_SHORTER = 0.3
_TURNS = 1e-7  # of a unit tangent: what is less may be a rounding
_LEFT = 0.01  # of the values beside it: what a test function is at a zero, where it does not jump


class How(NamedTuple):
    """How a branch is followed.

    `lengths` of the first, the longest and the shortest step, `most` points to a side, `stops(way)` why it ends early
    in words, `virtual` points too, `tests` of the user's own by name, the budget `until` whose time is up.
    """

    lengths: tuple[float, ...]
    most: int
    stops: Callable[[Way], str]
    virtual: bool = False
    tests: Mapping[str, Callable[[Any], float]] = MappingProxyType({})
    until: Budget | None = None


class Way:
    """A branch to one side: `points` (of the problem), `specials` and how many points come before each, `turns`."""

    def __init__(self, problem: Any, how: How) -> None:
        self.problem, self.how, self.virtual = problem, how, how.virtual
        step, self.longest, self.shortest = how.lengths
        self.first = self.ds = min(step, self.longest)  # `ds`: the next step's
        self.points: list[Any] = []
        self.specials: list[Any] = []
        self.places: list[int] = []
        self.turns: list[Any] = []
        self.end = ""

    # ---- what a branch is

    def met(self, here: Any, there: Any) -> Any:
        """Notes what lies between two points, and gives the next point; None if the step must be shorter.

        Where the branch ends on the way, `end` says why.
        """
        return there

    def around(self, here: Any) -> Any:
        """A point around a corner, where no step leads on."""
        return None

    def lost(self, here: Any) -> Any:
        """Says why no step leads on; or gives another point to go on from."""
        problem = self.problem
        self.end = (
            f"no {problem.noun} was found beyond {problem.where(here)} with steps down to {self.shortest:.1g}."
        )

    def moved_on(self, there: Any) -> Any:
        """The point as the next step begins at it."""
        return there

    def halts(self) -> str:
        """Why nothing new comes, in words."""
        return CLOSED if self._closes() else ""

    def compared(self, point: Any) -> tuple[np.ndarray, np.ndarray]:
        """Entries of u and of the tangent by which it is seen that a branch closes."""
        return point.u, point.tangent

    def longer(self, here: Any, there: Any) -> float:
        """By what the next step is longer."""
        return 2.0 if there.steps <= 3 else 1.0 if there.steps <= 5 else 0.5

    # ---- the way

    def follow(self, first: Any, here: Any = None) -> Way:
        """All points from the first one on, which is walked from as `here`."""
        self.points = [first]
        here, looked_at = first if here is None else here, None
        while not self.end:
            problem = self.problem  # another one where the mode has changed
            if len(self.points) >= self.how.most:
                self.end = f"stopped after {len(self.points)} {problem.nouns} (`max_points`)."
            else:
                self.end = self.how.stops(self)
            if not self.end and not here.alone:
                self.end = (
                    f"at {problem.where(here)} the {problem.noun} is not isolated: many exist at one value, or two "
                    "branches meet there, and no single way leads on."
                )
            if self.end:
                break
            there, border = problem.ahead(here, self.ds), ""
            if there is None:
                if here is not looked_at and (other := problem.cut(here)) is not None:
                    here = looked_at = other
                    continue
                looked_at = here  # whose unknowns are those that it asks for
                if self.ds > self.shortest:
                    self.ds *= _SHORTER
                    continue
                there = self.around(here)
            if there is not None:
                there, border = problem.within(here, there)
            points, specials = len(self.points), len(self.specials)
            met = None if there is None else self.met(here, there)
            # Where it ends on the way, or the next point.
            last = self.points[-1] if len(self.points) > points else met
            if self.how.tests and last is not None:
                self._tested(here, last, points, specials)
            if self.end:
                break
            if met is None:
                if self.ds > self.shortest:
                    self.ds *= _SHORTER
                else:
                    here = self.lost(here)
                continue
            self.points.append(met)
            self.end = f"reached {border}." if border and met is there else self.halts()
            self.ds = min(self.ds * self.longer(here, met), self.longest)
            if not self.end:
                here = self.moved_on(met)
        return self

    def _tested(self, here: Any, there: Any, points: int, specials: int) -> None:
        """Adds zeros of the user's tests on the way from one point to the next, in order with what was met there."""
        problem, found, at_first = self.problem, list[Special](), here.item
        for name, test in self.how.tests.items():
            a, b = test(here.item), test(there.item)
            if not a * b < 0:
                continue
            point = zero_between(problem, here, there, lambda p, test=test: test(p.item), 1e-12)  # type: ignore[misc]
            if point is not None and abs(test(point.item)) <= _LEFT * (abs(a) + abs(b)):  # else it jumps
                width = 1e-10 * (abs(problem.value(point)) + abs(problem.value(there) - problem.value(here)))
                found.append(Special(name, problem.values(point), point.item, width))
        if found:
            self.places += [points] * len(found)
            self.specials[specials:] = sorted(
                self.specials[specials:] + found, key=lambda b: float(np.linalg.norm(b.point.x - at_first.x))
            )

    def add(self, specials: Sequence[Any]) -> None:
        """Special points behind the last point."""
        self.specials += specials
        self.places += [len(self.points)] * len(specials)

    def ends_at(self, point: Any, why: str) -> None:
        """The last point, and why it is the last one."""
        self.points.append(point)
        self.end = why

    def turned(self, here: Any, there: Any) -> None:
        """Notes where the branch turns back in one of its parameters between two points."""
        problem = self.problem
        for k, name in enumerate(problem.names, problem.place):
            rates = here.tangent[k], there.tangent[k]
            if rates[0] * rates[1] < 0 and max(np.abs(rates)) > _TURNS:
                point = zero_between(problem, here, there, lambda p, k=k: float(p.tangent[k]), 1e-12)  # type: ignore[misc]
                if point is not None:
                    self.turns.append(Special(f"turns in {name}", problem.values(point), point.item))

    def _closes(self) -> bool:
        """Whether the last step has passed the first point, along the same way."""
        if len(self.points) < 5:
            return False
        (first, way), (a, _), (b, _) = (self.compared(self.points[k]) for k in (0, -2, -1))
        if not len(first) == len(a) == len(b):
            return False
        chord, to = b - a, first - a
        length = float(chord @ chord)
        if length == 0 or not 0 <= to @ chord <= length:
            return False
        aside = np.linalg.norm(to - chord * (to @ chord) / length)
        along = way @ chord > 0.8 * np.linalg.norm(way) * math.sqrt(length)
        if aside >= 0.2 * math.sqrt(length) or not along:
            return False
        # Beside a canard a multiplier changes by much within a step: the first one's is between those of its ends.
        items = [self.points[k].item for k in (0, -2, -1)]
        one, *ends = (np.abs(getattr(item, "map_multipliers", np.zeros(1))) for item in items)
        if not one.shape == ends[0].shape == ends[1].shape:
            return False
        beside = np.maximum(np.min(ends, axis=0) - one, one - np.max(ends, axis=0))
        return bool(np.all(beside <= 0.1 * (1 + one)))


def used_up(way: Way) -> str:
    """Why a branch was not followed to its end, in words."""
    at = way.problem.where(way.points[-1])
    return f"`max_steps` or `max_seconds` are used up at {at}: give more, or go on from the last {way.problem.noun}."


def followed(begin: Callable[[float], tuple[Way, Any, Any]], signs: Sequence[float]) -> tuple[Way, list[str]]:
    """The ways to one side or to both as one, from the end of the first, and why they end.

    `begin(sign)` gives a way, its first point, and that as it is walked from.
    """
    ways: list[Way] = []
    for sign in signs:
        way, first, here = begin(sign)
        ways.append(way.follow(first, here))
        if way.end == CLOSED:
            break
    back, ends = ways[0], [way.end for way in ways]
    if len(signs) == 1:
        return back, ends
    number = len(back.points)
    back.points, back.places = back.points[::-1], [number - k for k in reversed(back.places)]
    back.specials, back.turns = back.specials[::-1], back.turns[::-1]
    for on in ways[1:]:
        back.points += on.points[1:]
        back.places += [number - 1 + k for k in on.places]
        back.specials, back.turns = back.specials + on.specials, back.turns + on.turns
    return back, ends
