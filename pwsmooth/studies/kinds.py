"""What trajectories come to, by name, where they come to no orbit that attracts.

    running         each period moves a state on by the same, and the others come back
    chaotic         the largest Lyapunov exponent is positive
    quasi-periodic  the largest exponent is 0, and the points do not come closer to each other
    rest            the motion stands still, and so does not return to a section
    not settled     none of these is sure

Chain: analysis/lyapunov.py -> **kinds** -> attractors.py, basins.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.lyapunov import lyapunov_exponents
from ..analysis.maps.scales import extents
from ..analysis.maps.sections import Section
from ..analysis.orbits.periodic_orbit import PeriodicOrbit

NOT_SETTLED, FAILURE = "not settled", "failed"
_LOOKS = 8  # trajectories of different sets that are looked at, for exponents or a rest
_PERIODS = 400  # of an exponent
_ZERO = 5e-3  # per period or return: an exponent that is 0 within what so many periods tell
_ALIKE = 0.25  # of their spread, by which two sets of points of one attractor differ
_SHRINKS = 0.7  # the spread of later points over that of earlier ones: points that come closer have not settled
_STANDS = 1e-6  # of the size of the states: what a motion at rest still moves


def kind_of(orbit: PeriodicOrbit) -> str:
    """The name of an orbit that attracts."""
    return "rest" if orbit.rest else f"orbit of period {orbit.map.count}"


def kinds_of(map_: Any, points: list[np.ndarray]) -> list[str]:
    """The names of trajectories from their last points (number, n), each a list of them."""
    known: list[tuple[np.ndarray, np.ndarray, str]] = []
    names = []
    for x in points:
        if not np.isfinite(x).all() or len(x) < 2:
            names.append(NOT_SETTLED)
            continue
        middle, spread = x.mean(axis=0), np.ptp(x, axis=0) + _STANDS * map_.unit
        alike = (
            said
            for at, width, said in known
            if (np.abs(at - middle) <= _ALIKE * width).all()
            and (np.abs(width - spread) <= _ALIKE * width).all()
        )
        name = next(alike, "")
        if not name:
            name = _by_exponent(map_, x) if len(known) < _LOOKS else NOT_SETTLED
            known.append((middle, spread, name))
        names.append(name)
    return names


def _by_exponent(map_: Any, x: np.ndarray) -> str:
    """Chaotic or quasi-periodic, by the largest exponent; `NOT_SETTLED` where it is negative or not sure."""
    half = len(x) // 2
    early, late = np.ptp(x[:half], axis=0), np.ptp(x[half:], axis=0)
    if (late <= _SHRINKS * early).all():
        return NOT_SETTLED
    image = map_.image(x[-1])
    if not image.success:
        return NOT_SETTLED
    start = 0.0 if isinstance(map_, Section) else map_.start_time
    found = lyapunov_exponents(
        map_.system,
        x[-1].tolist(),
        _PERIODS * image.time,
        transient=20 * image.time,
        start_time=start,
        **map_.options,
    )
    growth, error = float(found.exponents[0]) * image.time, float(found.errors[0]) * image.time
    if growth > max(3 * error, _ZERO):
        return f"chaotic: exponent {found.exponents[0]:.3g}"
    return "quasi-periodic" if abs(growth) <= max(error, _ZERO) else NOT_SETTLED


def rests(map_: Any, x: np.ndarray) -> bool:
    """Whether a motion that does not return to its section stands still."""
    run = map_._over(x, map_.longest)
    if not run.success:
        return False
    last = map_._over(run.x[:, -1], map_.longest / 100)
    return last.success and bool((extents((last,)) <= _STANDS * (map_.unit + np.abs(last.x[:, -1]))).all())
