"""A curve that grows out of a saddle: points as dense as its length and its turns ask for.

    s -> x(s);   between two points a third one, while they are further apart than the spacing, or turn by more than an
    angle, or the events on the way to them differ

(Krauskopf & Osinga, J. Comput. Phys. 146 (1998) 404-419, for the conditions.) At a corner points are added until they
are a thousandth of the spacing apart; where bisection in s does not bring two points together the curve jumps.

Chain: **arms** -> map_manifolds.py, level_sets.py, flow_manifolds.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...door.documenting import complete

__all__ = ["Arm", "Meeting"]

SMALLEST = 1e-3  # of the spacing: how near points come at a corner
_LOCATED = 1e-6  # of the spacing: to which a change of the events is known
_THINNED = 1e-4  # of the spacing: points that are nearer together are one
_FINEST = 1e-13  # in s: below it bisection ends
_HOLE = 1e-8  # in s: what is lost in a shorter interval is left out
_SHIFTS = (0.0, 1e-9, -1e-9, 1e-8, -1e-8, 1e-7, -1e-7)


class Lost(Exception):
    """There is no point at this place of the curve; the text says why."""


@dataclass(frozen=True)
class Rules:
    """Where a curve ends, and how dense its points are."""

    length: float
    low: np.ndarray
    high: np.ndarray
    spacing: float
    angle: float
    most: int

    def outside(self, x: np.ndarray) -> bool:
        return bool(np.any((x < self.low) | (x > self.high)))

    def needed(self, x: np.ndarray) -> int:
        """How many of these points, one a row, an arm's length and box take, and two beyond.

        Chords are no longer than the curve; the factor covers points that are left out because they are near the one
        before.
        """
        beyond = np.any((x < self.low) | (x > self.high), axis=1)
        beyond[1:] |= np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1)) > 2 * self.length
        return int(np.argmax(beyond)) + 3 if beyond.any() else len(beyond)


@complete
@dataclass(frozen=True)
class Meeting:
    """Where a manifold meets a surface, or the events on the way to it change.

    Attributes
    ----------
    arclength : float, in the units of the states
        From the saddle.
    what : str
        In words.

    >>> print(Meeting(0.25, np.array([1.0, 0.0]), "crossing [sgn(x)] (-1 to +1)"))
    crossing [sgn(x)] (-1 to +1), after 0.25
    """

    arclength: float
    x: np.ndarray
    what: str

    def __str__(self) -> str:
        return f"{self.what}, after {self.arclength:.6g}"


@complete
@dataclass(frozen=True)
class Arm:
    """One of the curves that a manifold consists of, from the saddle outwards.

    Attributes
    ----------
    points : ndarray, shape (n, N)
        In the units of the states; a column of nan where the curve jumps.
    arclength : ndarray, shape (N,)
        From the saddle, in the units of the states; jumps are not counted.
    meetings : tuple of Meeting
        Where it meets surfaces (of a flow), or where the events of the next or last application change (of a map).
    end : str
        Why it ends, in words.

    >>> Arm(np.array([[0.0, 3.0], [0.0, 4.0]]), np.array([0.0, 5.0]), (), "reached the length 5.").length
    5.0
    """

    points: np.ndarray
    arclength: np.ndarray
    meetings: tuple[Meeting, ...]
    end: str

    @property
    def length(self) -> float:
        """Of the whole curve, in the units of the states."""
        return float(self.arclength[-1])

    @property
    def jumps(self) -> int:
        """How often it jumps."""
        return int(np.isnan(self.points[0]).sum())


@dataclass(frozen=True)
class Sample:
    """A point of the curve and what tells its piece from others: the events on the way to it."""

    x: np.ndarray
    word: Any = ()


def dense(
    at: Callable[[float], Sample], s: np.ndarray, rules: Rules, room: int, cut: bool = False
) -> tuple[np.ndarray, list[Sample], str]:
    """Samples of a piece of the curve at s and in between, and why it ends before the last s; empty if it does not.

    `cut`: none far beyond the arm's length and box, where a run that leaves a saddle grows exponentially.
    """
    taken: list[float] = []
    samples: list[Sample] = []
    reason, closed = "", set()
    for place in map(float, s):
        try:
            place, sample = _beside(at, place, -math.inf, math.inf)
            samples.append(sample)
            taken.append(place)
        except Lost as lost:
            reason = str(lost)
            if taken:
                _towards(at, taken, samples, place, rules)
            break
    while 1 < len(taken) < room:
        if cut:
            needed = rules.needed(np.array([sample.x for sample in samples]))
            del taken[needed:], samples[needed:]
        wanted = [k for k in _wanted(np.array(taken), samples, rules).tolist() if taken[k] not in closed]
        if not wanted:
            break
        for k in wanted[::-1]:
            middle = (taken[k] + taken[k + 1]) / 2
            try:
                middle, sample = _beside(at, middle, taken[k], taken[k + 1])
                samples.insert(k + 1, sample)
            except Lost as lost:
                near = np.linalg.norm(samples[k + 1].x - samples[k].x) <= SMALLEST * rules.spacing
                if near or taken[k + 1] - taken[k] <= _HOLE:
                    closed.add(taken[k])  # a point without a past between two that have one
                    continue
                reason = str(lost)
                del taken[k + 1 :], samples[k + 1 :]
                _towards(at, taken, samples, middle, rules)
                break
            taken.insert(k + 1, middle)
    return np.array(taken), samples, reason


def _beside(at: Callable[[float], Sample], s: float, low: float, high: float) -> tuple[float, Sample]:
    """The point at s or, where just there is none (backward in time a graze has no past), beside it."""
    for shift in _SHIFTS:
        if low < s + shift < high:
            try:
                return s + shift, at(s + shift)
            except Lost as lost:
                last = lost
    raise last


def _towards(
    at: Callable[[float], Sample], taken: list[float], samples: list[Sample], lost: float, rules: Rules
) -> None:
    """Points up to where the curve is lost."""
    last = taken[-1]
    while lost - last > _FINEST * (1 + abs(last)):
        middle = (last + lost) / 2
        try:
            found = at(middle)
        except Lost:
            lost = middle
            continue
        near = np.linalg.norm(found.x - samples[-1].x) < SMALLEST * rules.spacing
        taken.append(middle)
        samples.append(found)
        last = middle
        if near:
            break


def _wanted(s: np.ndarray, samples: list[Sample], rules: Rules) -> np.ndarray:
    """Which intervals want a point."""
    steps = np.diff(np.array([sample.x for sample in samples]), axis=0)
    sizes = np.linalg.norm(steps, axis=1)
    wanted = sizes > rules.spacing
    cosines = np.einsum("ki,ki->k", steps[1:], steps[:-1]) / np.maximum(sizes[1:] * sizes[:-1], 1e-300)
    turns = np.arccos(np.clip(cosines, -1, 1)) > rules.angle
    far = sizes > SMALLEST * rules.spacing
    turns &= far[1:] | far[:-1]
    wanted[1:] |= turns & far[1:]
    wanted[:-1] |= turns & far[:-1]
    changed = np.array([a.word != b.word for a, b in zip(samples[:-1], samples[1:])])
    wanted |= changed & (sizes > _LOCATED * rules.spacing)
    return np.flatnonzero(wanted & (np.diff(s) > _FINEST * (1 + np.abs(s[1:]))))


class Growing:
    """An arm while its pieces are put together; a piece begins where the one before ended."""

    def __init__(self, saddle: np.ndarray, rules: Rules, told: Callable[[Any, Any], str]) -> None:
        self.rules, self.told = rules, told
        self.points, self.arclength, self.last = [saddle], [0.0], Sample(saddle)
        self.skipped: Sample | None = None
        self.meetings: list[Meeting] = []

    @property
    def room(self) -> int:
        return self.rules.most - len(self.points)

    @property
    def now(self) -> np.ndarray:
        """Where it has come to."""
        return (self.skipped or self.last).x

    def take(self, samples: list[Sample], first: bool = False) -> str:
        """Points are added; why the arm ends with them, empty if it does not."""
        for sample in samples:
            step = float(np.linalg.norm(sample.x - self.last.x))
            apart = not first and (sample.word != self.last.word or step > 2 * self.rules.spacing)
            if apart or first or step > _THINNED * self.rules.spacing:
                self._add(self.skipped)
                step = float(np.linalg.norm(sample.x - self.last.x))
                if apart and step > 2 * self.rules.spacing:
                    self.meetings.append(
                        Meeting(self.arclength[-1], self.last.x, "a jump, or what is not resolved")
                    )
                    self.lift(sample.x)
                if apart and (what := self.told(self.last.word, sample.word)):
                    self.meetings.append(Meeting(self.arclength[-1], sample.x, what))
                self._add(sample)
            else:
                self.skipped = sample  # what creeps along is drawn no denser than a corner
            if self.rules.outside(sample.x):
                return "left the box."
            if self.arclength[-1] > self.rules.length:
                return f"reached the length {self.rules.length:g}."
            first = False
        if self.room <= 0:
            return f"stopped after {len(self.points)} points (`max_points`)."
        return ""

    def lift(self, x: np.ndarray) -> None:
        """The curve goes on elsewhere."""
        self._add(self.skipped)
        self.points.append(np.full(len(x), np.nan))
        self.arclength.append(self.arclength[-1])
        self.last = Sample(x, self.last.word)

    def _add(self, sample: Sample | None) -> None:
        if sample is None:
            return
        self.arclength.append(self.arclength[-1] + float(np.linalg.norm(sample.x - self.last.x)))
        self.points.append(sample.x)
        self.last, self.skipped = sample, None

    def arm(self, end: str) -> Arm:
        self._add(self.skipped)
        return Arm(np.array(self.points).T, np.array(self.arclength), tuple(self.meetings), end)
