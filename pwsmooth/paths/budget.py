"""What a call may take as a whole: steps, seconds, and whether its caller still wants it.

A long call (exponents, basins, an orbit) solves many times. It opens a budget, and every solve() inside draws from it
beside its own bounds; nothing is handed through the functions between.

    find_orbit(..., max_steps=N, max_seconds=T)     opens one of N steps and T seconds
        solve(..., max_steps=n)                     takes the smaller of n and of what is left

Chain: solve, analysis, sweep -> **budget**; compiled loops come back after a slice of steps, some ten times a second,
and are asked.
"""

from __future__ import annotations

import contextlib
import contextvars
import functools
import math
import threading
from collections.abc import Callable, Iterator
from typing import Any, ParamSpec, TypeVar

import numpy as np

from ..codegen.machine import clock
from ..door import checks

SLICE = 10_000  # steps at most between the first two looks at the clock
VISIT = 0.1  # seconds from one look to the next
_GROWTH = 8.0  # at most, from one slice of steps to the next
MOST_STEPS = 10_000_000  # of a call that names no bound
P = ParamSpec("P")
R = TypeVar("R")


class Stopped(BaseException):
    """The caller has gone; no Exception, so that nothing on the way takes it for a failed point."""


class Stop:
    """A wish to stop that compiled code hears too: `cell` is 1 once it is set."""

    def __init__(self) -> None:
        self.cell = np.zeros(1, np.int64)

    def set(self) -> None:
        self.cell[0] = 1


class Budget:
    """Steps and seconds that are left, of a call and of those that it is part of."""

    __slots__ = ("deadline", "left", "outer", "stop", "watched")

    def __init__(self, steps: float = math.inf, seconds: float | None = None, stop: Stop | None = None) -> None:
        self.outer = outer = _current.get()
        self.left = steps if outer is None else max(0, min(steps, outer.left))
        self.deadline = math.inf if seconds is None else clock.now() + seconds
        self.stop = stop
        self.watched = not (outer is seconds is stop is None)  # by more than the bound on its own steps

    def part(self, steps: float) -> Budget:
        """One of so many steps beside it, which ends at the same time."""
        found = Budget(steps, stop=self.stop)
        found.deadline, found.watched = self.deadline, self.watched
        return found

    def spend(self, steps: int) -> None:
        """Take steps off what is left."""
        self.left -= steps
        if self.outer is not None:
            self.outer.spend(steps)

    def late(self) -> bool:
        """Whether the time is up; raises `Stopped` where the caller has gone."""
        if not self.watched:
            return False
        if self.stop is not None and self.stop.cell[0]:
            raise Stopped
        if self.deadline != math.inf and clock.now() > self.deadline:
            return True
        return self.outer is not None and self.outer.late()

    def remaining(self) -> float:
        """Seconds until the time is up."""
        return self.deadline - clock.now()

    @contextlib.contextmanager
    def heard(self) -> Iterator[np.ndarray]:
        """A cell for compiled code, which knows no clock: 1 once the time is up or the caller has gone."""
        stop = self.stop or Stop()
        remaining = self.remaining()
        alarm = None if remaining == math.inf else threading.Timer(max(0.0, remaining), stop.set)
        if alarm:
            alarm.daemon = True
            alarm.start()
        try:
            yield stop.cell
        finally:
            if alarm:
                alarm.cancel()


class Slices:
    """How many steps a compiled loop makes before the clock is looked at again: as many as `VISIT` seconds hold."""

    __slots__ = ("begun", "length")

    def __init__(self, length: int) -> None:
        self.length, self.begun = length, 0.0

    def next(self, made: int) -> int:
        """The length of the next slice after one of `made` steps; the cost of the first of all nobody has taken."""
        begun, self.begun = self.begun, clock.now()
        if begun:
            took = max(self.begun - begun, VISIT / _GROWTH)
            self.length = max(1, int(made * VISIT / took) if made else self.length // 2)
        return self.length


def first_slice(size: int) -> int:
    """Steps of the first slice, of whose cost nothing is known but how many numbers a step works on."""
    return max(1, SLICE // max(1, size))


_current: contextvars.ContextVar[Budget | None] = contextvars.ContextVar("budget", default=None)


def spending() -> Budget:
    """What the present call is bounded by."""
    return _current.get() or Budget()


def opened(max_steps: Any = MOST_STEPS, max_seconds: Any = None) -> Budget:
    """The budget of a call with these options, checked."""
    if max_seconds is not None:
        max_seconds = checks.positive(max_seconds, "`max_seconds`")
    if (
        type(max_steps) is not int or not 0 < max_steps <= 2**62
    ):  # a short run would feel words that nobody reads
        max_steps = checks.whole(max_steps, "`max_steps`", 1)
    return Budget(max_steps, max_seconds)


@contextlib.contextmanager
def within(inside: Budget) -> Iterator[Budget]:
    """Everything inside draws from a budget too."""
    token = _current.set(inside)
    try:
        yield inside
    finally:
        _current.reset(token)


def whole(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator of a long call: its `max_steps` and `max_seconds`, or its map's, bound all its solves together."""

    @functools.wraps(function)
    def bounded(*args: P.args, **kwargs: P.kwargs) -> R:
        options: Any = getattr(args[0], "options", None) if args else None
        options = kwargs if options is None else options
        with within(opened(options.get("max_steps", MOST_STEPS), options.get("max_seconds"))):
            return function(*args, **kwargs)

    return bounded
