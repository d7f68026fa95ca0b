"""A branch or a curve as what other orbits are compared with: whether they lie on it, and where it is stable.

Between two of its points a branch is nearly straight. An orbit that is near to the chord is looked at more closely:
Newton's method at the same parameter leads from the chord to the branch's own orbit, and the two are one or not.

Chain: plain.py, tracing.py -> **line** -> searching.py.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .plain import Setting, distance, found_at, points_of
from .tracing import UNDECIDED

SAME = 1e-5  # relative to unit + |x|: two orbits are one
_BESIDE = 0.5  # of a chord, plus `_FLOOR`: an orbit so far from it may be on the branch
_FLOOR = 1e-3
NARROW = 1e-5  # of the range: a gap so narrow is where a branch was not followed to its very end


@dataclass
class Line:
    """A branch over a parameter: the arrays and the words of tracing.py, and where it comes from."""

    arrays: Mapping[str, np.ndarray]
    about: dict[str, Any]
    origin: str = ""
    depth: int = 0
    root: Any = None  # the branch point at which it began
    known: dict[tuple[int, float], Any] = field(default_factory=dict, repr=False)

    @property
    def q(self) -> np.ndarray:
        return self.arrays["parameter"]

    @property
    def equilibria(self) -> bool:
        return bool(self.about["equilibria"])

    @property
    def count(self) -> int:
        return self.arrays["points"].shape[1]

    @property
    def bifurcations(self) -> list[dict[str, Any]]:
        return self.about["bifurcations"]

    @functools.cached_property
    def stable(self) -> np.ndarray:
        """Of the way from each point to the next, (K - 1,)."""
        at = self.arrays["stable"]
        a, b = at[:-1], at[1:]
        known = np.where(a == UNDECIDED, b, np.where(b == UNDECIDED, a, np.minimum(a, b)))
        return (known == 1) & ~(self.arrays["virtual"][:-1] & self.arrays["virtual"][1:])

    def holds(self, values: Mapping[str, float], q: float, points: np.ndarray, setting: Setting) -> bool:
        """Whether the orbit of these points (count, n) at a parameter value lies on it, or its mirror image does."""
        return self.segment(values, q, points, setting) is not None

    def segment(
        self, values: Mapping[str, float], q: float, points: np.ndarray, setting: Setting
    ) -> int | None:
        """The number of the way between two points on which it lies."""
        if points.shape[0] != self.count:
            return None
        q0, q1 = self.q[:-1], self.q[1:]
        slack = 1e-9 * (np.ptp(self.q) + abs(q))
        for k in np.flatnonzero((np.minimum(q0, q1) <= q + slack) & (q <= np.maximum(q0, q1) + slack)).tolist():
            for name in ("points", "mirrored"):
                if name in self.arrays and self._near(k, name, values, q, points, setting):
                    return k
        return None

    def _near(self, k: int, name: str, values: Any, q: float, points: np.ndarray, setting: Setting) -> bool:
        a, b = self.arrays[name][k : k + 2]
        if np.isnan(a).any() or np.isnan(b).any():
            return False
        width = self.q[k + 1] - self.q[k]
        part = np.clip((q - self.q[k]) / width, 0.0, 1.0) if width else 0.0
        guess = a + part * (b - a)
        off = distance(points, guess, setting)
        chord = float(np.abs((b - a) / (setting.sizes + np.abs(guess))).max())
        if off <= SAME:
            return True
        if off > _BESIDE * chord + _FLOOR:
            return False
        if self.equilibria or setting.map is None:
            return off <= 0.1 * chord + SAME
        if name == "mirrored":
            key = (-k - 1, q)
        else:
            key = (k, q)
        if key not in self.known:
            self.known[key] = found_at(setting, {**values, self.about["name"]: q}, guess)
        own = self.known[key]
        if own is None or own.map.count != len(points):
            return off <= 0.1 * chord + SAME
        return same_points(points, points_of(own, setting)[0], setting)

    def pieces(self) -> Iterator[tuple[slice, str]]:
        """Points of each stretch of one style: "stable", "unstable" or "virtual"."""
        v = self.arrays["virtual"]
        virtual = v[:-1] | v[1:]
        style = np.where(virtual, 2, np.where(self.stable, 1, 0))
        if not style.size:
            return
        cuts = [0, *(np.flatnonzero(np.diff(style)) + 1).tolist(), len(style)]
        for first, end in zip(cuts, cuts[1:]):
            yield slice(first, end + 1), ("unstable", "stable", "virtual")[style[first]]

    def covered(self) -> list[tuple[float, float]]:
        """Intervals of the parameter over which it is stable."""
        return [
            (float(self.q[piece].min()), float(self.q[piece].max()))
            for piece, style in self.pieces()
            if style == "stable"
        ]


def uncovered(intervals: list[tuple[float, float]], low: float, high: float) -> list[tuple[float, float]]:
    """The parts of a range that no interval covers."""
    gaps, at = [], low
    slack = NARROW * (high - low)
    for a, b in sorted(intervals):
        if a > at + slack:
            gaps.append((at, a))
        at = max(at, b)
    if at < high - slack:
        gaps.append((at, high))
    return gaps


def same_points(a: np.ndarray, b: np.ndarray, setting: Setting) -> bool:
    """Whether two cycles of points are one."""
    return distance(a, b, setting) <= SAME
