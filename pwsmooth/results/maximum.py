"""The maximum of a function of time that is known by samples and can be evaluated between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def refined_maximum(
    function: Callable[[np.ndarray], np.ndarray],
    times: np.ndarray,
    values: np.ndarray,
    points: int,
    rounds: int,
) -> float:
    """Largest of `values` and of what `rounds` closer looks find, each of `points` samples around the largest one.

    Only values that occur: a parabola through the samples would overshoot where a switching force jumps.
    """
    best = float(values.max())
    for _ in range(rounds):
        k = int(np.argmax(values))
        times = np.linspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], points)
        values = function(times)
        best = max(best, float(values.max()))
    return best
