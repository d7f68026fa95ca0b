"""Newton's method for fixed points of Poincare maps, and of the shift maps of segments.

    F(x) = P(x) - x = 0,    (D P - 1) dx = -F

D P comes from the variational equations and saltation matrices (variations.py). A stick makes it singular, which does
no harm: only an eigenvalue 1 of D P does. The step is shortened while the return does not improve.

Chain: periodic_orbit.py -> **fixed_points** -> orbits.py, arclength.py.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ...definition import pointwise
from ..maps.poincare import Image
from ..maps.sections import Section, Stroboscopic
from ..maps.segments import Segments, Shooting
from .periodic_orbit import PeriodicOrbit, none_found

TOLERANCE = 1e-11  # of the return, relative to the states' size: a few roundings of a period
_ROUNDINGS = 1e-3  # times TOLERANCE: returns of one x scatter by some ten roundings of it, times their growth
_MOST_STEPS = 30
PINNED = 1e-12  # of a row of the map's Jacobian: rounding


def shot(shooting: Shooting, X: np.ndarray, kept: tuple[bool, bool] = (False, False)) -> PeriodicOrbit:
    """Newton's method from points at which segments begin."""
    image = shooting.image(X, ())
    if not image.success:
        return none_found(
            shooting.map, X[: len(X) // shooting.number], f"a segment did not end: {image.reason}"
        )
    return newton(shooting, X, image, kept)


def newton(
    map_: Stroboscopic | Section | Shooting,
    x: np.ndarray,
    image: Image,
    kept: tuple[bool, bool] = (False, False),
) -> PeriodicOrbit:
    off, size = off_and_size(x, image)
    steps = 0
    while size > TOLERANCE and steps < _MOST_STEPS:
        slope, step = image.jacobian - np.eye(len(x)), np.zeros(len(x))
        # A component that the map leaves at its start (a memory that events put back) keeps the first guess.
        free = (off != 0) | (np.abs(slope).max(axis=1) > PINNED)
        step[free] = np.linalg.lstsq(slope[:, free], -off, rcond=1e-13)[0]
        step[pinned(image)] = off[pinned(image)]
        closer = _shortened(map_, x, step, size)
        if closer is None:
            break
        x, image = closer
        off, size = off_and_size(x, image)
        steps += 1
    success = size <= TOLERANCE
    message = f"Newton's method converged in {steps} steps."
    if not success:
        message = (
            f"Newton's method stopped after {steps} steps, |P(x) - x| = {size:.2g}: give a guess nearer to the "
            "orbit, a `transient`, or another `phase`."
        )
    return orbit_of(map_, x, image, size, steps, success, message, kept)


def pinned(image: Image) -> np.ndarray:
    """Which components come back the same from every start nearby, bool (n,): v = 0 in a stick.

    They are set to that: a rounding would leave the surface.
    """
    return np.abs(np.hstack([image.jacobian, image.by_parameter])).max(axis=1) <= PINNED


def orbit_of(
    map_: Any,
    x: np.ndarray,
    image: Image,
    size: float,
    steps: int,
    success: bool,
    message: str,
    kept: tuple[bool, bool] = (False, False),
) -> PeriodicOrbit:
    """The orbit of a fixed point of a Poincare map, or of the shift map of its segments."""
    if not isinstance(map_, Shooting):
        return PeriodicOrbit(
            map_, x, size, image.jacobian, image.word, image.time, steps, success, message, image.degenerate
        )
    matrices, nodes = map_.matrices(image.jacobian), x.reshape(map_.number, -1)
    product = functools.reduce(lambda total, matrix: matrix @ total, matrices)
    return PeriodicOrbit(
        map_.map, nodes[0], size, product, image.word, image.time, steps, success, message, image.degenerate,
        Segments(map_.cuts, nodes, matrices, *kept),
    )  # fmt: skip


def off_and_size(x: np.ndarray, image: Image) -> tuple[np.ndarray, float]:
    off = image.x - x
    return off, relative(off, x, image)


def relative(off: np.ndarray, x: np.ndarray, image: Image) -> float:
    """The largest part of P(x) - x, relative to the states' size and to what roundings of them grow to."""
    size = 1 + np.abs(x) + _ROUNDINGS * (np.abs(image.jacobian) @ np.abs(x))
    return float(np.abs(off / size).max(initial=0.0))


def _shortened(map_: Any, x: np.ndarray, step: np.ndarray, size: float) -> tuple[np.ndarray, Image] | None:
    """The first of x + step, x + step/2, ... whose return is better; the whole step beside a corner of the map."""
    fallback = None
    for k in range(8):
        trial = x + step / 2**k
        trial = onto_section(map_, trial)
        image = map_.image(trial, ())
        if not image.success:
            continue
        new = off_and_size(trial, image)[1]
        if new < size or new <= TOLERANCE:
            return trial, image
        # Across a change of itinerary the derivative is a different one: a step to a worse return may still lead on.
        if fallback is None and new < 10 * size:
            fallback = trial, image
    return fallback


def onto_section(map_: Any, x: np.ndarray) -> np.ndarray:
    """x moved onto the section of a return map along its gradient, shape (n,); of segments the points after returns."""
    if isinstance(map_, Shooting) and isinstance(map_.map, Section):
        nodes = x.reshape(map_.number, -1).copy()
        for k in map_.firsts:
            nodes[k] = onto_section(map_.map, nodes[k])
        return nodes.ravel()
    if not isinstance(map_, Section):
        return x
    states = map_.system.model.states
    for _ in range(3):
        point = {**map_.system.parameters, **dict(zip(states, map(float, x)))}
        gradient = map_.gradient(x)
        x = x - gradient * pointwise.value(map_.surface, point) / (gradient @ gradient)
    return x
