"""Whether an orbit repeats in the period that follows, and after how many applications of its map.

The map begins each time at its own start time and from states alone: a memory that counts on, a time that the period
does not fit, and the branch of a layer are unknown to it.

Chain: fixed_points.py -> **repetition** -> orbits.py, continuation.py.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..maps.poincare import why_stopped
from ..maps.sections import Section, depends_on_time
from .fixed_points import TOLERANCE
from .periodic_orbit import PeriodicOrbit

SAME = 1e-6  # relative to the states' size: nearer together two points are one, converged to TOLERANCE or not quite
_REPEATED = 1e3  # times the tolerance of the runs: what they differ by in one period and in the next


def not_repeated(orbit: PeriodicOrbit) -> str:
    """What does not repeat in the period that follows, in words with a remedy; empty if all does."""
    map_, x = orbit.map, orbit.x
    if isinstance(map_, Section):
        return ""
    if orbit.segments is not None:
        return _not_repeated_in_segments(orbit)
    times = map_.start_time + orbit.period * np.array([1.0, 2.0])
    run = map_._over(x, 2 * orbit.period, times=times)
    if len(run.t) < 2 or run.t[-1] < times[-1]:
        return f"the orbit closes after one period, but is not run through in the next: {why_stopped(run)}"
    growth = np.linalg.norm(orbit.jacobian) ** (2 if orbit.symmetric else 1)
    # What a period is off grows once more in the next one.
    slack = _REPEATED * max(run.tolerances["rtol"], TOLERANCE) * (1 + growth) * np.array([1.0, 1 + growth])
    off = np.abs(run.x - x[:, None]) / (1 + np.abs(x[:, None]))
    moved = np.flatnonzero((off > (np.sqrt(slack) if orbit.degenerate else slack)).any(axis=1))
    if not moved.size:
        return ""
    return _why_not_repeated(orbit, moved, off.max(axis=1)[moved], x, run.x)


def _not_repeated_in_segments(orbit: PeriodicOrbit) -> str:
    """The same, segment by segment."""
    matrices = orbit.segments.matrices  # type: ignore[union-attr]
    for k, (target, run) in enumerate(orbit._legs(1)):
        slack = (
            _REPEATED
            * max(run.tolerances["rtol"], TOLERANCE)
            * (1 + np.linalg.norm(matrices[k % len(matrices)]))
        )
        off = np.abs(run.x[:, -1] - target) / (1 + np.abs(target))
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
    back = np.abs((points - orbit.x) / (1 + np.abs(orbit.x))).max(axis=1) <= SAME
    return next((d for d in range(1, count) if count % d == 0 and back[d - 1]), count)
