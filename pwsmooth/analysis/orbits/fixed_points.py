"""Newton's method for fixed points of Poincare maps, and of the shift maps of segments.

    F(x) = P(x) - x = 0,    (D P - 1) dx = -F

D P comes from the variational equations and saltation matrices (first_order.py). A stick makes it singular, which does
no harm: only an eigenvalue 1 of D P does. The step is shortened while the return does not improve.

Whether what is found repeats in the period that follows is another question: the map begins each time at its own start
time and from states alone. A memory that counts on, a time that the period does not fit, and the branch of a layer are
unknown to it.

Chain: periodic_orbit.py -> **fixed_points** -> orbits.py, continuation.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...definition import pointwise
from ..maps.poincare import Image, why_stopped
from ..maps.scales import extents, fastest, unit_of
from ..maps.sections import Section, Stroboscopic, depends_on_time
from ..maps.segments import Segments, Shooting
from .periodic_orbit import PeriodicOrbit, none_found

TOLERANCE = 1e-11  # of what a return moves: a few roundings of a period
_TOLERATED = 10.0  # times the absolute tolerance of a run: what its steps may be off by
_ROUNDINGS = 1e-3  # times TOLERANCE: returns of one x scatter by some ten roundings of it, times their growth
_TIMES = 2e-15  # of the time of a return: roundings of the instants in it
_MOST_STEPS = 30
SAME = 1e-6  # relative to the states' size: nearer together two points are one, converged to TOLERANCE or not quite
_REPEATED = 1e3  # times the tolerance of the runs: what they differ by in one period and in the next
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
    """Newton's method from a point with this image; unknowns in units of what its return moves."""
    moves = extents(image.runs)
    units = [unit_of(move) if move > 0 else own for move, own in zip(moves.tolist(), map_.unit.tolist())]
    unit = np.tile(units, len(x) // len(units))
    off, size_off = off_and_size(map_, x, image, moves)
    steps = 0
    while size_off > TOLERANCE and steps < _MOST_STEPS:
        slope, step = image.jacobian - np.eye(len(x)), np.zeros(len(x))
        slope *= unit / unit[:, None]
        # A component that the map leaves at its start (a memory that events put back) keeps the first guess.
        free = (off != 0) | (np.abs(slope).max(axis=1) > PINNED)
        step[free] = np.linalg.lstsq(slope[:, free], -off / unit, rcond=1e-13)[0] * unit[free]
        fixed = pinned(image, unit)
        step[fixed] = off[fixed]
        closer = _shortened(map_, x, step, size_off, moves)
        if closer is None:
            break
        x, image = closer
        moves = np.maximum(moves, extents(image.runs))
        off, size_off = off_and_size(map_, x, image, moves)
        steps += 1
    success = size_off <= TOLERANCE
    message = f"Newton's method converged in {steps} steps."
    if not success:
        message = (
            f"Newton's method stopped after {steps} steps, |P(x) - x| = {size_off:.2g} of what a return moves: give a "
            "guess nearer to the orbit, a `transient`, or another `phase`."
        )
    return replace(orbit_of(map_, x, image, size_off, steps, success, message, kept), _image=image)


def pinned(image: Image, unit: Any = 1.0) -> np.ndarray:
    """Which components come back the same from every start nearby, bool (n,): v = 0 in a stick.

    They are set to that: a rounding would leave the surface. `unit` are the sizes of the states.
    """
    moved = np.hstack([image.jacobian * unit, image.by_parameter])
    return np.abs(moved).max(axis=1) <= PINNED * unit


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
            map_, x, size, image.jacobian, image.word, image.time, steps, success, message, image.degenerate,
            moves=extents(image.runs),
        )  # fmt: skip
    matrices, nodes = map_.matrices(image.jacobian), x.reshape(map_.number, -1)
    product = functools.reduce(lambda total, matrix: matrix @ total, matrices)
    return PeriodicOrbit(
        map_.map, nodes[0], size, product, image.word, image.time, steps, success, message, image.degenerate,
        Segments(map_.cuts, nodes, matrices, *kept), extents(image.runs),
    )  # fmt: skip


def off_and_size(
    map_: Any, x: np.ndarray, image: Image, moves: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    off = image.x - x
    return off, relative(map_, off, x, image, moves)


def relative(map_: Any, off: np.ndarray, x: np.ndarray, image: Image, moves: np.ndarray | None = None) -> float:
    """The largest part of P(x) - x, relative to what the return moves.

    Beside that stand what roundings of x and of times lead to, and the absolute tolerance of the runs. A state that
    does not move any more (one that has died down) is measured by how far it moved before, `moves` (without them by its
    unit), as far as the others still do.
    """
    here = extents(image.runs)
    before = np.maximum(map_.unit if moves is None else moves, here)
    moving = before > 0
    left = float((here[moving] / before[moving]).max(initial=0.0))
    least = (_TOLERATED * map_.tolerance + _TIMES * fastest(image.runs)) / TOLERANCE
    size = np.tile(here + left * before + least, len(x) // len(here))
    size += _ROUNDINGS * (np.abs(x) + np.abs(image.jacobian) @ np.abs(x))
    with np.errstate(invalid="ignore"):
        return float(np.abs(np.where(off == 0, 0.0, off / size)).max(initial=0.0))


def _shortened(
    map_: Any, x: np.ndarray, step: np.ndarray, size: float, moves: np.ndarray
) -> tuple[np.ndarray, Image] | None:
    """The first of x + step, x + step/2, ... whose return is better; the whole step beside a corner of the map."""
    fallback = None
    for k in range(8):
        trial = x + step / 2**k
        trial = onto_section(map_, trial)
        image = map_.image(trial, ())
        if not image.success:
            continue
        new = off_and_size(map_, trial, image, moves)[1]
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


def not_repeated(orbit: PeriodicOrbit) -> str:
    """What does not repeat in the period that follows, in words with a remedy; empty if all does."""
    map_, x = orbit.map.tighter(), orbit.x
    if isinstance(map_, Section):
        return _not_back(orbit, map_)
    if orbit.segments is not None:
        return _not_repeated_in_segments(orbit)
    times = map_.start_time + orbit.period * np.array([1.0, 2.0])
    run = map_._over(x, 2 * orbit.period, times=times)
    if len(run.t) < 2 or run.t[-1] < times[-1]:
        return f"the orbit closes after one period, but is not run through in the next: {why_stopped(run)}"
    unit = map_.unit
    growth = np.linalg.norm(orbit.jacobian * unit / unit[:, None]) ** (2 if orbit.symmetric else 1)
    # What a period is off grows once more in the next one.
    slack = _REPEATED * max(run.tolerances["rtol"], TOLERANCE) * (1 + growth) * np.array([1.0, 1 + growth])
    later = np.array([map_.within_a_turn(column, x) for column in run.x.T]).T
    off = np.abs(later - x[:, None]) / (unit + np.abs(x))[:, None]
    moved = np.flatnonzero((off > (np.sqrt(slack) if orbit.degenerate else slack)).any(axis=1))
    if not moved.size:
        return ""
    return _why_not_repeated(orbit, moved, off.max(axis=1)[moved], x, run.x)


def _not_back(orbit: PeriodicOrbit, map_: Section) -> str:
    """The same of returns, at another tolerance and, in segments, from point to point."""
    unit = map_.unit
    starts, matrices = orbit.x[None], orbit.jacobian[None]
    legs: list[Any] = [(0, 0.0, math.inf)]
    if orbit.segments is not None:
        starts, matrices = orbit.segments.nodes, orbit.segments.matrices
        legs = Shooting(map_, orbit.segments.cuts).legs
    targets = np.roll(starts, -1, axis=0)
    for start, target, leg, matrix in zip(starts, targets, legs, matrices):
        image = map_.image(start) if orbit.segments is None else map_.leg(start, leg)
        if not image.success:
            return f"the orbit closes, but its next return is none at another tolerance: {image.reason}"
        growth = float(np.linalg.norm(matrix * unit / unit[:, None]))
        slack = _REPEATED * max(image.runs[0].tolerances["rtol"], TOLERANCE) * (1 + growth)
        off = np.abs(image.x - target) / (unit + np.abs(target))
        if not (off <= (math.sqrt(slack) if orbit.degenerate else slack)).all():
            k = int(np.argmax(off))
            return (
                f"no orbit of period {orbit.period:.9g}: {orbit.system.model.states[k]} is {target[k]:.9g}, and at "
                f"another tolerance it comes back to {image.x[k]:.9g}; give a smaller `rtol`, or another `section`."
            )
    return ""


def _not_repeated_in_segments(orbit: PeriodicOrbit) -> str:
    """The same, segment by segment."""
    unit, matrices = orbit.map.unit, orbit.segments.matrices  # type: ignore[union-attr]
    for k, (target, run) in enumerate(orbit._legs(1)):
        slack = (
            _REPEATED
            * max(run.tolerances["rtol"], TOLERANCE)
            * (1 + np.linalg.norm(matrices[k % len(matrices)] * unit / unit[:, None]))
        )
        off = np.abs(orbit.map.within_a_turn(run.x[:, -1], target) - target) / (unit + np.abs(target))
        moved = np.flatnonzero(~(off <= (math.sqrt(slack) if orbit.degenerate else slack)))
        if moved.size:
            return _why_not_repeated(orbit, moved, off[moved], target, np.stack([run.x[:, -1]] * 2, axis=1))
    return ""


def _why_not_repeated(
    orbit: PeriodicOrbit, moved: np.ndarray, off: np.ndarray, x: np.ndarray, later: np.ndarray
) -> str:
    names = orbit.system.model.states
    memories = moved[moved >= len(names) - orbit.system.model.n_memory]
    k = int(memories[0]) if memories.size else int(moved[np.argmax(off)])
    if memories.size:
        why = (
            "this memory goes on from period to period; let it hold what repeats, as the time since an event does (a "
            "state of rate 1 that the event puts to 0)"
        )
    elif depends_on_time(orbit.system.model):
        why = "the system reads the time in another way than with this period; give the period of all that it reads"
    else:
        why = "it slides on another branch of the layer than the map begins with; choose another `phase`"
    return (
        f"no orbit of period {orbit.period:.9g}: {names[k]} is {x[k]:.9g} at first, then {later[k, 0]:.9g} and "
        f"{later[k, 1]:.9g}, one and two periods later: {why}."
    )


def repeats_after(orbit: PeriodicOrbit) -> int:
    """After how many of its map's `count` applications an orbit is back: a divisor of it."""
    count = orbit.map.count
    if count == 1:
        return 1
    if orbit.segments is None:
        points = replace(orbit.map, count=1).iterate(orbit.x, count)
    else:
        points = np.array([orbit.after(k) for k in range(1, count + 1)])
    points = np.array([orbit.map.within_a_turn(point, orbit.x) for point in points])
    back = np.abs((points - orbit.x) / (orbit.map.unit + np.abs(orbit.x))).max(axis=1) <= SAME
    return next((d for d in range(1, count) if count % d == 0 and back[d - 1]), count)
