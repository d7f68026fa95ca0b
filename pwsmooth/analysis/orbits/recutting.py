"""Segments of the orbits of a curve: begun, cut anew, given up, and turned to another section.

Chain: pieces.py -> **recutting** -> continuation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...results.solution import Solution
from ..maps.first_order import sticks_at_start
from ..maps.impacts import EventImage, FromEvent
from ..maps.pieces import Pieces
from ..maps.poincare import why_stopped
from ..maps.sections import Stroboscopic
from ..maps.segments import (
    LONG_ENOUGH,
    TOO_LONG,
    Shooting,
    cut,
    growth,
    pressed,
    restless,
    rotated,
    settled,
    sizes,
)
from ..maps.windows import WIDEST, Windowed, touching
from .periodic_orbit import PeriodicOrbit

Cut = tuple[Any, np.ndarray, bool]  # a map, the points of its segments, and whether some may begin in a slide


def exact(map_: Any) -> Any:
    """The map of the system itself, without what a curve has put into it."""
    if isinstance(map_, Shooting):
        return Shooting(exact(map_.map), map_.cuts)
    return map_.base if isinstance(map_, (Windowed, FromEvent)) else map_


def begun(inner: Any, x: np.ndarray) -> tuple[Pieces, np.ndarray, Any] | None:
    """A map of one piece as that of its periods (returns), one a segment, their points and images."""
    pieces, X = Pieces(inner, ((),) * inner.turns), x
    for k in range(1, inner.turns):
        X = np.append(X, inner.leg(X[-len(x) :], (k - 1, 0.0, inner.end)).x)
    image = pieces.image(X, ()) if np.isfinite(X).all() else None
    return (pieces, X, image) if image is not None and image.success else None


def anew(
    map_: Any, x: np.ndarray, image: Any, largest: float, scales: np.ndarray, held: bool, must: bool
) -> Cut | None:
    """Other segments, where those of an orbit (or its one piece) have grown too long or too short; None where not.

    `largest` is that of the multipliers, `scales` are those of the parameters.
    """
    new: Any
    if isinstance(map_, FromEvent):
        # What a slow event makes large no segments make less.
        if not (
            isinstance(image, EventImage) and growth(image.pencil[1][:-1, :-1], sizes(image.runs)) > TOO_LONG
        ):
            return None
        inner, x = map_.exact(x, image)
        new = begun(inner, x)
    elif isinstance(map_, Shooting):
        if settled(list(map_.matrices(image.jacobian)), sizes(image.runs), largest):
            return map_.map, x[: len(x) // map_.number], False
        if not restless(map_, image, held, scales):
            return None
        new = (map_, x, image)
    else:
        if not (pressed(image, scales, largest) or must):
            return None
        new = begun(map_, x)
    if new is None or (found := cut(*new)) is None:
        return None
    cuts, X, _, held = found
    pieces, X = without_barred(new[0].map, cuts, X)
    return (pieces, X, held) if pieces.number > new[0].number or isinstance(map_, Shooting) else None


def at_section(pieces: Shooting, X: np.ndarray, image: Any, inner: Any) -> Cut | None:
    """The segments of an orbit turned to the section of another map of the same orbit."""
    old: Any = pieces.map
    place = (inner.phase - old.phase) * old.forcing_period / old.beat
    also = place % 1.0
    found = cut(pieces, X, image, also=also)
    if found is None:
        return None
    cuts, X, _, held = found
    turned, X, _ = rotated(Shooting(exact(old), cuts), X, np.zeros_like(X), place)
    there, X = without_barred(inner, turned.cuts, X)
    return there, X, held


def without_barred(inner: Any, cuts: Any, X: np.ndarray) -> tuple[Pieces, np.ndarray]:
    """Segments that do not begin within a window."""
    if not isinstance(inner, Windowed):
        return Pieces(inner, cuts), X
    pieces = Pieces(inner, cuts)
    keep = [not inner.barred(k, first) for k, first, _ in pieces.legs]
    left = tuple(tuple(place for place in own if not inner.barred(k, place)) for k, own in enumerate(cuts))
    return replace(pieces, cuts=left), X.reshape(pieces.number, -1)[keep].ravel()


def longest_slip(run: Solution) -> tuple[float, float]:
    """The middle of the longest time between events at which a run slips, and how long it is."""
    bounds = np.unique(np.concatenate([run.t[:1], [e.time for e in run.events], run.t[-1:]]))
    middles, lengths = (bounds[1:] + bounds[:-1]) / 2, np.diff(bounds)
    column = np.searchsorted(run.t, middles, side="right") - 1
    lengths = lengths * ~run._holds(run.status[:, column])
    best = int(np.argmax(lengths))
    return float(middles[best]), float(lengths[best])


def narrowed(pieces: Shooting, image: Any) -> float:
    """How wide a window is to either side: of an orbit in segments not much more than one of them.

    No segment begins in it, so that in all of it deviations may grow by no more than in a segment.
    """
    size = sizes(image.runs)
    lengths = [last - first for _, first, last in pieces.legs]
    fastest = max(
        math.log(max(1.0, growth(A, size))) / length
        for A, length in zip(pieces.matrices(image.jacobian), lengths)
    )
    return min(WIDEST, 0.5 / pieces.number, math.log(LONG_ENOUGH) / (2 * fastest) if fastest > 0 else WIDEST)


def of_orbit(orbit: PeriodicOrbit, inner: Any) -> Cut:
    """The segments of an orbit, of its map or of that with a window; its one piece."""
    if orbit.segments is None:
        return inner, orbit.x, False
    return Pieces(inner, orbit.segments.cuts), orbit.segments.nodes.ravel(), orbit.segments.held


def touched(orbit: PeriodicOrbit, name: str, phase: float | None = None, stays: bool = False) -> Cut | str:
    """The map with a window about the orbit's approach to a surface, and its points; why there is none, in words."""
    map_: Any = orbit.map
    driven = isinstance(map_, Stroboscopic)
    if orbit.segments is None:
        x = orbit.x
        for _ in range(2):
            span = (map_.start_time, map_.start_time + map_.duration) if driven else (0.0, orbit.time)
            runs: tuple[Any, ...] = (map_._solve(map_.system, span, x, True),)
            if not runs[0].success:
                return f"the orbit was not run through: {why_stopped(runs[0])}"
            middle, length = longest_slip(runs[0])
            if not (stays and driven and sticks_at_start(runs[0]) and length > 0):
                break
            # A stick that a section parts has no extreme there.
            phase = None if phase is None else (phase - (middle - map_.start_time) / orbit.period) % 1.0
            map_, x = map_.at_phase(middle / map_.forcing_period), runs[0].dense(np.array([middle]))[0][:, 0]
        found = touching(map_, runs, name, phase, stays)
        return found if isinstance(found, str) else (*found, False)
    if not driven:
        return "it is shot over in segments, which an autonomous orbit beside grazing is not yet"
    pieces, X, _ = of_orbit(orbit, map_)
    image = pieces.image(X, ())
    if not image.success:
        return f"the orbit was not run through: {image.reason}"
    found = touching(map_, image.runs, name, phase, stays, narrowed(pieces, image))
    if isinstance(found, str):
        return found
    return at_section(pieces, X, image, found[0]) or "its segments are not cut anew"
