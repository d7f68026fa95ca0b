"""How an accumulation point moves: the limit of how the instants before it do.

The last bounces are so slow that their own times deviate by numbers with few digits, dt = -h_q/h' with h' -> 0. But the
deviations of the instants are a sum of terms q^(ik) and k q^(ik), with the ratio q of intervals in the limit: powers of
what is left, and their slopes by q. Each (E - q^i)/(1 - q^i), with the shift E from one instant to the next, takes one
of them away and leaves the limit, so that bounces tell it of which each is known to all digits.
Source: Sidi, Practical Extrapolation Methods, 2003, chapter 1 (Richardson's process with double terms).
Chain: the tape's instants -> **here** -> paths/derivatives/of_solution.py, costs/reading.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

_EVERY = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)  # which instants are taken: for a ratio near 1 not each
_MOST = 6  # powers that are taken away
_ROUNDING = 4e-16
_LARGE = 1e3  # by which the slopes of what is left over may exceed it
_LATE = 1e-6  # of the first interval: there the ratio is nearly that of the limit, and still told


def towards(times: np.ndarray, limit: float, begin: float = -np.inf) -> tuple[np.ndarray, np.ndarray]:
    """Places among the times of the instants before a limit, and the weights with which these sum up to it.

    Only those behind `begin` follow one law.

    >>> places, weights = towards(1 - 0.5 ** np.arange(40.0), 1.0)
    >>> print(f"{weights @ ((1 + places / 2**places) * np.cos(0.5**places)):.10f}")
    1.0000000000
    """
    # Those of the chatter alone: behind each an interval shorter than the last but one.
    intervals = np.diff(times)
    longer = np.flatnonzero(intervals[2:] >= intervals[:-2])
    first = max(int(longer[-1]) + 1 if longer.size else 0, int(np.searchsorted(times, begin, "right")))
    if len(times) - first < 5:
        return np.array([len(times) - 1]), np.ones(1)
    intervals = intervals[first:]
    late = min(int(np.argmax(intervals < _LATE * intervals[0])) or len(intervals), len(intervals) - 3)
    two = intervals[late + 2] / intervals[late]  # their ratio in the limit
    left = (limit - times[first:]) / (limit - times[first])
    alternates = abs(intervals[late + 1] ** 2 / (intervals[late] * intervals[late + 2]) - 1.0) > 1e-3
    best, chosen, weights = np.inf, np.array([len(left) - 1]), np.ones(1)
    for every in _EVERY[1::2] if alternates else _EVERY:
        q, taken = two ** (every / 2), np.ones(1)
        for powers in range(_MOST + 1):
            if powers:
                one = np.array([-(q**powers), 1.0]) / (1.0 - q**powers)
                taken = np.convolve(np.convolve(taken, one), one)
            begins = np.arange(len(left) - every * 2 * powers)
            if not begins.size:
                break
            at = begins[:, None] + every * np.arange(2 * powers + 1)
            # As far as the powers left over tell, and as the times themselves do, whose limit is known.
            error = left[begins] ** (powers + 1) * q ** (powers * (powers + 1))
            error = np.maximum(error, _LARGE * np.abs(left[at] @ taken))
            error = error + _ROUNDING * (np.abs(taken) / left[at]).sum(axis=1)
            if error.min() < best:
                best, chosen, weights = error.min(), at[error.argmin()], taken
    return first + chosen, weights


def limits(solution: Any, times: np.ndarray, causes: np.ndarray) -> dict[float, tuple[np.ndarray, np.ndarray]]:
    """Of the time of each accumulation of a run the places of instants that lead to it, and what they weigh.

    Instants have times, and causes: places among multipliers and events.
    """
    names = [*solution.multipliers, *(event.name for event in solution.model.events)]
    ends = [event for event in solution.events if event.kind == "accumulation"]
    found: dict[float, tuple[np.ndarray, np.ndarray]] = {}
    for event in ends:
        before, leads = times < event.time, causes == names.index(event.switch)
        own = np.flatnonzero(before & leads)
        if event.time in found or not own.size:
            continue
        together = [names.index(other.switch) for other in ends if other.time == event.time]
        foreign = times[before & ~np.isin(causes, together)]  # the field may jump there
        places, weights = towards(times[own], event.time, foreign.max(initial=-np.inf))
        found[event.time] = own[places], weights
    return found
