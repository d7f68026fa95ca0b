"""Event location near grazing, and two crossings in one step.

    h = 1 + d - sin t      touches 0 at t = pi/2 for d = 0; misses it by d > 0, dips through it for d < 0
    h = (t - 1)^2 + d      the same for a polynomial

The motion is integrated (y'' = -y; y' = 2 (t - 1)), so that a solver knows h within its tolerance only: a distance
below 1e-12 cannot be decided in double precision, and has to be recorded. A step that begins before a dip and ends
behind it shows a change of sign to nobody: the border is the step against the duration of the dip, 2 arccos(1 + d).
"""

from __future__ import annotations

import functools
import math
from typing import Any

import sympy as sp

from ...definition.primitives import Switch
from ...solving import solve
from ...system import System
from .failures import Finding, attempt
from .hazard import Axis, Hazard, decades
from .stopping import SEERS, Motion

RTOL = 1e-12
CAREFUL = 0.1  # the bound on the step that a careful user sets: a sixtieth of a turn
DECIDABLE = 1e-12


def _wave(hy: Any) -> Any:
    y, w = hy.make_vars("y", "w")
    return [(y, w), (w, -y)], hy.par[0] - y


def _parabola(hy: Any) -> Any:
    y = hy.make_vars("y")
    return [(y, 2.0 * (hy.time - 1.0))], y - hy.par[0]


def _motion(wave: bool, level: float) -> Motion:
    """h = level - y on the wave, y - level on the parabola."""
    if wave:
        return Motion(lambda t, x: [x[1], -x[0]], lambda t, x: level - x[0], _wave, level)
    return Motion(lambda t, x: [2 * (t - 1)], lambda t, x: x[0] - level, _parabola, level)


@functools.cache
def _system(wave: bool) -> System:
    t, y, w, z, level = sp.symbols("t y w z level", real=True)
    lam = Switch("lam", level - y if wave else y - level)
    rates = {y: w, w: -y} if wave else {y: 2 * (t - 1)}
    # z' = lam lets the switch act without acting back on the motion.
    return System({**rates, z: lam}, time=t, parameters={level: 1.0})


def _judged(events: int, expected: int, recorded: bool) -> Finding:
    if recorded:
        return Finding("recorded", events)
    if events == expected:
        return Finding("right", events)
    return Finding("missed event" if events < expected else "wrong itinerary", events)


def _methods(situation: Any) -> dict[str, Any]:
    """Trials of all methods; `situation(x, row)` is (wave, level, span, number of crossings)."""

    def ours(x: float, row: float, **options: Any) -> Finding:
        wave, level, span, expected = situation(x, row)
        start = {"y": 0.0, "w": 1.0, "z": 0.0} if wave else {"y": 1.0, "z": 0.0}

        def judge(s: Any) -> Finding:
            crossings = len(s.event_times("crossing"))
            return _judged(crossings, expected, any(a.kind == "grazing" for a in s.ambiguities))

        options |= dict(rtol=RTOL, atol=1e-14, parameters={"level": level})
        return attempt(solve, judge, _system(wave), span, start, **options)

    def seer(name: str, longest: float, x: float, row: float) -> Finding:
        wave, level, span, expected = situation(x, row)
        motion, start = _motion(wave, level), (0.0, 1.0) if wave else (1.0,)
        return attempt(
            SEERS[name], lambda zeros: _judged(len(zeros), expected, False), motion, span, start, RTOL, longest
        )

    methods = {"event-driven": ours, "event-driven, 8(5,3) pair": functools.partial(ours, method="rk")}
    for name in SEERS:
        methods[name] = functools.partial(seer, name, CAREFUL)
        methods[f"{name}, steps unbounded"] = functools.partial(seer, name, math.inf)
    return methods


def grazing(fast: bool) -> Hazard:
    """Distance to tangency, down to rounding."""

    def situation(d: float, row: float) -> Any:
        wave, clear = row < 2, row in (0.0, 2.0)
        distance = d if clear else -d
        expected = 0 if clear else 2
        if wave:
            return True, 1.0 + distance, (0.0, math.pi), expected
        return False, -distance, (0.0, 2.0), expected

    return Hazard(
        "grazing",
        "grazing: is the surface touched?",
        Axis("distance to tangency", decades(-16, -2, 0.5 if fast else 1)),
        Axis(
            "motion",
            (0.0, 1.0, 2.0, 3.0),
            ("sine, clear", "sine, through", "parabola, clear", "parabola, through"),
        ),
        _methods(situation),
        lambda method, row: DECIDABLE,
        "1e-12: below it the distance is within the errors of the motion, and has to be recorded",
        worse="left",
        unit="crossings found",
    )


def two_crossings(fast: bool) -> Hazard:
    """Duration of a dip through the surface against the step: three dips in three turns."""
    turns = 3

    def situation(duration: float, row: float) -> Any:
        return True, math.cos(duration / 2), (0.0, 2 * math.pi * turns), 2 * turns

    return Hazard(
        "two-crossings",
        "two crossings in one step",
        Axis("duration of the dip (rad)", decades(-4, 0, 2 if fast else 4)),
        Axis("", (0.0,)),
        _methods(situation),
        # The others' own steps are shorter at this tolerance, or they look for all roots inside a step.
        lambda method, row: CAREFUL if method == "DOP853, events" else math.nan,
        "the bound on the step, 0.1, against the duration",
        worse="left",
        unit="crossings found",
    )
