"""A branch or a curve as what other orbits are compared with: whether they lie on it, and where it is stable.

Between two of its points a branch is nearly straight. An orbit that is near to the chord is looked at more closely:
Newton's method at the same parameter leads from the chord to the branch's own orbit, and the two are one or not.

Chain: plain.py, tracing.py -> **line** -> searching.py.
"""

from __future__ import annotations

import copy
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
_BEND = 0.1  # of a step of a curve: its bend between two points is less
_NEAREST = 1e-6  # of the ranges
NARROW = 1e-5  # of the range: a gap so narrow is where a branch was not followed to its very end


@dataclass
class Line:
    """A branch over a parameter, or a curve over two, as data: what a task gives, and where it comes from.

    `arrays`: values of the parameters (K,) or (2, K), points (K, count, n) once a period (return) and perhaps those of
    the mirror image, admissible, size (the largest multiplier, or the rightmost eigenvalue), period; of a branch stable
    and `located`, the number of the special point at each, -1 for none; of a curve test functions by "test " and their
    name. `about`: the names of the parameters, kind, ends, special points.
    """

    arrays: Mapping[str, np.ndarray]
    about: dict[str, Any]
    origin: str = ""
    depth: int = 0
    root: Any = None  # the branch point at which it began
    known: dict[tuple[int, float], Any] = field(default_factory=dict, repr=False)

    @property
    def values(self) -> np.ndarray:
        """As of `Branch`."""
        return self.arrays["values"]

    @property
    def admissible(self) -> np.ndarray:
        """As of `Branch`."""
        return self.arrays["admissible"]

    @property
    def kind(self) -> str:
        """Of a curve: of its bifurcation."""
        return self.about["kind"]

    @property
    def ends(self) -> tuple[str, ...]:
        """Why it ended to either side, in words."""
        return tuple(self.about["ends"])

    @property
    def of_equilibria(self) -> bool:
        return bool(self.about["equilibria"])

    @property
    def count(self) -> int:
        """Of the points once a period (return)."""
        return self.arrays["points"].shape[1]

    @property
    def located(self) -> list[dict[str, Any]]:
        """Special points, as data."""
        return self.about["specials"]

    def to_data(self, head: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Arrays by `head` and their names, and words that JSON takes."""
        about = copy.deepcopy(self.about)
        for b in about["specials"]:
            b |= {key: np.asarray(b[key]).tolist() for key in ("points", "mirrored") if b.get(key) is not None}
        words = {"about": about, "origin": self.origin, "depth": self.depth}
        return {head + name: values for name, values in self.arrays.items()}, words

    @staticmethod
    def from_data(arrays: Mapping[str, np.ndarray], head: str, words: Mapping[str, Any]) -> Line:
        return Line(under(head, arrays), words["about"], words["origin"], words["depth"])

    # ---- of a branch

    @functools.cached_property
    def stable(self) -> np.ndarray:
        """Of the way from each point to the next, (K - 1,)."""
        at = self.arrays["stable"]
        a, b = at[:-1], at[1:]
        known = np.where(a == UNDECIDED, b, np.where(b == UNDECIDED, a, np.minimum(a, b)))
        return (known == 1) & (self.admissible[:-1] | self.admissible[1:])

    def holds(self, values: Mapping[str, float], q: float, points: np.ndarray, setting: Setting) -> bool:
        """Whether the orbit of these points (count, n) at a parameter value lies on it, or its mirror image does."""
        return self.segment(values, q, points, setting) is not None

    def segment(
        self, values: Mapping[str, float], q: float, points: np.ndarray, setting: Setting
    ) -> int | None:
        """The number of the way between two points on which it lies."""
        if points.shape[0] != self.count:
            return None
        q0, q1 = self.values[:-1], self.values[1:]
        slack = 1e-9 * (np.ptp(self.values) + abs(q))
        for k in np.flatnonzero((np.minimum(q0, q1) <= q + slack) & (q <= np.maximum(q0, q1) + slack)).tolist():
            for name in ("points", "mirrored"):
                if name in self.arrays and self._near(k, name, values, q, points, setting):
                    return k
        return None

    def _near(self, k: int, name: str, values: Any, q: float, points: np.ndarray, setting: Setting) -> bool:
        a, b = self.arrays[name][k : k + 2]
        if np.isnan(a).any() or np.isnan(b).any():
            return False
        width = self.values[k + 1] - self.values[k]
        part = np.clip((q - self.values[k]) / width, 0.0, 1.0) if width else 0.0
        guess = a + part * (b - a)
        off = distance(points, guess, setting)
        chord = float(np.abs((b - a) / (setting.sizes + np.abs(guess))).max())
        if off <= SAME:
            return True
        if off > _BESIDE * chord + _FLOOR:
            return False
        if self.of_equilibria or setting.map is None:
            return off <= 0.1 * chord + SAME
        if name == "mirrored":
            key = (-k - 1, q)
        else:
            key = (k, q)
        if key not in self.known:
            self.known[key] = found_at(setting, {**values, self.about["parameters"][0]: q}, guess)
        own = self.known[key]
        if own is None or own.map.count != len(points):
            return off <= 0.1 * chord + SAME
        return same_points(points, points_of(own, setting)[0], setting)

    def pieces(self) -> Iterator[tuple[slice, str]]:
        """Points of each stretch of one style: "stable", "unstable" or "virtual"."""
        virtual = ~(self.admissible[:-1] & self.admissible[1:])
        style = np.where(virtual, 2, np.where(self.stable, 1, 0))
        if not style.size:
            return
        cuts = [0, *(np.flatnonzero(np.diff(style)) + 1).tolist(), len(style)]
        for first, end in zip(cuts, cuts[1:]):
            yield slice(first, end + 1), ("unstable", "stable", "virtual")[style[first]]

    def covered(self) -> list[tuple[float, float]]:
        """Intervals of the parameter over which it is stable."""
        return [
            (float(self.values[piece].min()), float(self.values[piece].max()))
            for piece, style in self.pieces()
            if style == "stable"
        ]

    # ---- of a curve

    def distance(self, at: np.ndarray, widths: np.ndarray) -> tuple[float, int, float]:
        """How far a point of the plane is, in units of the ranges; the way nearest to it, and its part before."""
        u, v = (self.values / widths[:, None]).T, at / widths
        a, b = u[:-1], u[1:]
        chord = b - a
        length = np.maximum((chord**2).sum(axis=1), 1e-300)
        part = np.clip(((v - a) * chord).sum(axis=1) / length, 0.0, 1.0)
        off = np.linalg.norm(a + part[:, None] * chord - v, axis=1)
        k = int(np.argmin(off))
        return float(off[k]), k, float(part[k])

    def meets(
        self, kind: str | None, at: np.ndarray, points: np.ndarray, widths: np.ndarray, setting: Setting
    ) -> bool:
        """Whether a bifurcation of this kind, at a point of the plane and of an orbit of these points, lies on it."""
        if kind != self.kind:
            return False
        off, k, part = self.distance(at, widths)
        u = self.values / widths[:, None]
        if off > _BEND * float(np.linalg.norm(u[:, k + 1] - u[:, k])) + _NEAREST:
            return False
        compared = False
        for name in ("points", "mirrored"):
            a, b = self.arrays[name][k : k + 2]
            if np.isnan(a).any() or np.isnan(b).any() or np.isnan(points).any():
                continue
            compared = True
            chord = float(np.abs((b - a) / (setting.sizes + np.abs(a))).max())
            if distance(points, a + part * (b - a), setting) <= 0.5 * chord + 1e-3:
                return True
        return not compared


def under(head: str, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays whose names begin so, by the rest of their names."""
    return {name.removeprefix(head): values for name, values in arrays.items() if name.startswith(head)}


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
