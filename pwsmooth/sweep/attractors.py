"""Which attractor each of many trajectories goes to, from its last points on a section.

A trajectory that repeats is at an orbit, which Newton's method finds exactly and whose multipliers say whether it
attracts. One that does not repeat yet may be slow: where Newton's method leads from ends like its own to orbits that
attract, it is led on, and belongs to one of them if that draws it in, which the trajectory itself has to show: with
d its distance from the orbit on the section, D the derivative of the map there and W weights,

    V(d) = d^T P d,    P = D^T P D + W,    V falls by d^T W d a step near the orbit,

it has to fall by half of that at least at every step of a window (Lyapunov's function of the orbit, Stein's equation).

Chain: sweep, analysis/orbits.py -> **attractors** -> basins.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..analysis.orbits import PeriodicOrbit, refine
from ..analysis.sections import Section
from ..results.records import Outcome
from .plan import NO_RETURN, why_not

#: Label of a start whose trajectory had not become periodic.
UNSETTLED = -1
#: Label of a start whose trajectory failed.
FAILED = -2

WINDOW = 200  # periods or returns at least, in which an orbit has to draw a trajectory in
_ROUNDS = 4  # of leading on: with 0, 1, 3 and 7 transients before the window
_TRIALS = (
    8  # ends that repeat best, and as many spread over the others, from which Newton's method is tried a round
)


@dataclass(frozen=True)
class Ends:
    """Where trajectories have come to: their last points, after how many these repeat, and how they ended."""

    points: np.ndarray  # (trajectories, points, n)
    cycle: np.ndarray  # (trajectories,), 0 for none
    outcome: np.ndarray  # (trajectories,)

    def only(self, which: np.ndarray) -> Ends:
        return Ends(self.points[which], self.cycle[which], self.outcome[which])


@dataclass
class Attractors:
    """Orbits found so far, and the points in which each meets the section: at whatever phase, it is the same one."""

    map: Any  # of one period or return
    tol: float
    orbits: list[PeriodicOrbit] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)

    def find(
        self, ends: Ends, transient: int, lead_on: Callable[[np.ndarray, int], Ends]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Label of every trajectory and why it has none, each (trajectories,).

        `lead_on(starts, turns)` leads trajectories on from these starts, unseen for so many periods or returns.
        """
        turns = "returns" if isinstance(self.map, Section) else "periods"
        labels = np.full(len(ends.cycle), UNSETTLED)
        reasons = np.full(len(ends.cycle), "", object)
        waiting, done = np.arange(len(ends.cycle)), transient
        beside: list[PeriodicOrbit] = []
        for k in range(_ROUNDS + 1):
            for i, (label, reason) in zip(waiting, self._settled(ends, beside)):
                labels[i], reasons[i] = label, reason
            still = (labels[waiting] == UNSETTLED) & (ends.outcome == Outcome.FINISHED)
            waiting, ends = waiting[still], ends.only(still)
            beside = self._attracting(ends)
            if k == _ROUNDS or not beside:
                break
            unseen = (2**k - 1) * transient
            ends = lead_on(ends.points[:, -1], unseen)
            done += unseen + ends.points.shape[1]
        why = (
            "slow: Newton's method finds orbits that attract beside ends like its own, but none has drawn it in; "
            "give a larger `transient`"
            if beside
            else "unsettled: Newton's method finds no orbit that attracts beside ends like its own; it is chaotic, "
            "quasi-periodic or slower still"
        )
        for i in waiting:
            reasons[i] = reasons[i] or f"{why} (it does not repeat after {done} {turns})."
        order = np.argsort([-np.sum(labels == k) for k in range(len(self.orbits))], kind="stable")
        led = labels >= 0
        labels[led] = np.argsort(order)[labels[led]]
        self.orbits = [self.orbits[k] for k in order]
        return labels, reasons

    def _settled(self, ends: Ends, beside: list[PeriodicOrbit]) -> list[tuple[int, str]]:
        """Label and reason of each: of those that repeat, and of those that an orbit draws in, known or `beside`."""
        found: list[tuple[int, str]] = []
        tried: list[tuple[int, np.ndarray, str]] = []
        for points, count, outcome in zip(ends.points, ends.cycle.tolist(), ends.outcome.tolist()):
            at, label, reason = points[-1], None, ""
            if outcome != Outcome.FINISHED:
                failed = outcome < 0 and outcome != NO_RETURN
                found.append((FAILED if failed else UNSETTLED, why_not(outcome)))
                continue
            if count > 0:
                label = self._near(at, 10 * self.tol)
                known = [why for n, x, why in tried if n == count and _near(at, x, self.tol)]
                if label is None and known:
                    reason = known[0]
                elif label is None:
                    label, reason = self._repeated(count, at)
                    if label is None:
                        tried.append((count, at, reason))
            if label is None and beside:
                drawing = next((o for o in [*self.orbits, *beside] if _draws_in(o, points, self.tol)), None)
                label = None if drawing is None else self._index(drawing)
            found.append((UNSETTLED, reason) if label is None else (label, ""))
        return found

    def _near(self, at: np.ndarray, tol: float) -> int | None:
        return next((k for k, points in enumerate(self.points) if any(_near(at, x, tol) for x in points)), None)

    def _index(self, orbit: PeriodicOrbit) -> int:
        """Its index; an orbit that is not known yet is kept."""
        k = self._near(orbit.x, self.tol)
        if k is None:
            k = len(self.orbits)
            self.orbits.append(orbit)
            self.points.append(replace(orbit.map, count=1).iterate(orbit.x, orbit.map.count))
        return k

    def _repeated(self, count: int, at: np.ndarray) -> tuple[int | None, str]:
        """The attractor at a point that repeats after `count`; or None, and what its orbit lacks."""
        orbit = refine(replace(self.map, count=count), at)
        if not orbit.success:
            return None, f"unsettled: it repeats, but {orbit.message}"
        if not orbit.stable:
            size = np.abs(orbit.multipliers).max()
            return None, f"unsettled: it repeats, but its orbit has a multiplier of size {size:.9g}."
        # A slow one seems to repeat before it is there.
        return (self._index(orbit), "") if _near(orbit.x, at, 100 * self.tol) else (None, "")

    def _attracting(self, ends: Ends) -> list[PeriodicOrbit]:
        """Attracting orbits to which Newton's method leads from some of the ends."""
        last = ends.points[:, -1:]
        back = np.abs((ends.points[:, -2::-1] - last) / (1 + np.abs(last))).max(
            axis=2
        )  # the nearest in time first
        order = np.argsort(back.min(axis=1, initial=np.inf), kind="stable")
        others = order[_TRIALS:]
        found: list[PeriodicOrbit] = []
        for i in [*order[:_TRIALS], *others[:: max(1, len(others) // _TRIALS)][:_TRIALS]]:
            nearest = int(np.argmin(back[i])) + 1 if back.shape[1] else 1
            for count in dict.fromkeys([int(ends.cycle[i]) or 1, nearest, 1]):
                orbit = refine(replace(self.map, count=count), ends.points[i, -1])
                if orbit.success and orbit.stable:
                    found.append(orbit)
                    break
        return found


def _near(a: np.ndarray, b: np.ndarray, tol: float) -> bool:
    return bool(np.all(np.abs(a - b) <= tol * (1 + np.abs(b))))


def _draws_in(orbit: PeriodicOrbit, points: np.ndarray, tol: float) -> bool:
    """Whether the orbit's Lyapunov function falls along points (number, n) of the map, until they are at the orbit."""
    from scipy.linalg import solve_discrete_lyapunov

    count = orbit.map.count
    first = int(np.argmin(np.abs(points[:count] - orbit.x).sum(axis=1)))
    off = (points[first::count] - orbit.x) / (1 + np.abs(orbit.x))
    size = 1 + np.abs(orbit.x)
    derivative = orbit.jacobian * size / size[:, None]
    form = solve_discrete_lyapunov(derivative.T, np.eye(len(size)))
    height, share = np.einsum("ki,ij,kj->k", off, form, off), (off**2).sum(axis=1)
    moving = share[:-1] > tol**2
    return bool(np.all((height[1:] <= height[:-1] - share[:-1] / 2)[moving]))
