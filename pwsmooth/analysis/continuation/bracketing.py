"""The zero of a test function between two points of a branch or a curve, whose points a problem computes.

Chain: problem.py -> **bracketing** -> way.py, bifurcations.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

P = TypeVar("P")


class _Lost(Exception):
    """Newton's method found no point between two."""


def zero_between(problem: Any, here: P, there: P, test: Callable[[P], float], xtol: float = 1e-14) -> P | None:
    """The point, to `xtol` of the chord, at which a test function with different signs at two points vanishes.

    None where `problem.along` finds no point on the way, or the function has no sign.
    """
    from scipy.optimize import brentq

    points = {0.0: here, 1.0: there}

    def at(part: float) -> float:
        if part not in points:
            point: Any = problem.along(here, there, part)
            if point is None:
                raise _Lost
            points[part] = point
        return test(points[part])

    try:
        zero = float(brentq(at, 0.0, 1.0, xtol=xtol, rtol=10 * xtol))
        at(zero)
    except (_Lost, ValueError):
        return None
    return points[zero]
