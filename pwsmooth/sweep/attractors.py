"""Which attractor each of many trajectories goes to, from its last points on a section.

A trajectory that repeats is at an orbit, which Newton's method finds exactly and whose multipliers say whether it
attracts. One that does not repeat yet may be slow: where Newton's method leads from its end to an orbit that attracts,
it is led on for as long as the orbit's multipliers say that it takes. So it is the trajectory itself that tells where
it goes, and never a guess from a distance.

Chain: sweep, analysis/orbits.py -> **attractors** -> basins.py.
"""

from __future__ import annotations

import math
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

_PATIENCE = 20  # transients, for which a slow trajectory is led on
_TRIALS = (
    8  # ends that repeat best, and as many spread over the others, from which Newton's method is tried a round
)
_MARGIN = 1.2  # of the time in which an orbit draws in what is near it


@dataclass(frozen=True)
class Ends:
    """Where trajectories have come to: the last points on the section, after how many they repeat, how they ended."""

    points: np.ndarray  # (trajectories, points, n)
    cycle: np.ndarray  # (trajectories,), 0 for none
    outcome: np.ndarray  # (trajectories,)


@dataclass
class Attractors:
    """Labels of trajectories, the orbits that they are indices of, and words for those that lead to none."""

    map: Any  # of one period or return
    tol: float
    orbits: list[PeriodicOrbit] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)  # in which each of the orbits meets the section

    @property
    def turns(self) -> str:
        """What lies between two points."""
        return "returns" if isinstance(self.map, Section) else "periods"

    def find(self, ends: Ends, transient: int, go_on: Callable[[np.ndarray, int], Ends]) -> Any:
        """(labels, reasons), each (trajectories,); `go_on(starts, periods)` leads trajectories on, unseen so long."""
        count = len(ends.cycle)
        labels, reasons = np.full(count, UNSETTLED), np.full(count, "", object)
        waiting, spent, most = np.arange(count), 0, _PATIENCE * max(transient, 1)
        while True:
            for i, label, reason in zip(waiting, *self._settled(ends)):
                labels[i], reasons[i] = label, reason
            still = (labels[waiting] == UNSETTLED) & (ends.outcome == Outcome.FINISHED)
            waiting, ends = waiting[still], _only(ends, still)
            periods, slow = self._how_long(ends, most - spent)
            for k, needed in slow.items():
                reasons[waiting[k]] = (
                    f"slow: Newton's method leads from its end to an orbit that attracts, but so weakly that it takes "
                    f"some {needed:.2g} {self.turns} more to get there; give a larger `transient`."
                )
            if not periods:
                break
            periods = min(max(periods, transient), most - spent)
            spent += periods
            ends = go_on(ends.points[:, -1], periods)
        for i in waiting:
            reasons[i] = reasons[i] or (
                f"unsettled: it does not repeat after {transient + spent} {self.turns}, and Newton's method finds no "
                "orbit that attracts beside ends like its own: it is chaotic, quasi-periodic or slower still."
            )
        order = np.argsort([-np.sum(labels == k) for k in range(len(self.orbits))], kind="stable")
        led = labels >= 0
        labels[led] = np.argsort(order)[labels[led]]
        self.orbits = [self.orbits[k] for k in order]
        return labels, reasons

    def _settled(self, ends: Ends) -> tuple[np.ndarray, list[str]]:
        """Labels and reasons of all ends: the attractors of those that repeat, new ones among them."""
        labels, reasons = np.full(len(ends.cycle), UNSETTLED), []
        tried: list[tuple[int, np.ndarray, str]] = []
        for i, (points, count, outcome) in enumerate(
            zip(ends.points, ends.cycle.tolist(), ends.outcome.tolist())
        ):
            at, reason = points[-1], ""
            if outcome != Outcome.FINISHED:
                reason = why_not(outcome)
                labels[i] = FAILED if outcome < 0 and outcome != NO_RETURN else UNSETTLED
            elif count > 0 and (k := self._near(at, 10 * self.tol)) is not None:
                labels[i] = k
            elif count > 0:
                known = next((why for n, x, why in tried if n == count and near(at, x, self.tol)), None)
                if known is None:
                    k, known = self._attractor(count, at)
                    if k is None:
                        tried.append((count, at, known))
                    else:
                        labels[i] = k
                reason = known
            reasons.append(reason)
        return labels, reasons

    def _near(self, at: np.ndarray, tol: float) -> int | None:
        """The attractor one of whose points is this one: the first in the list, at whatever phase it is met."""
        return next((k for k, points in enumerate(self.points) if any(near(at, x, tol) for x in points)), None)

    def _attractor(self, count: int, at: np.ndarray) -> tuple[int | None, str]:
        """The attractor at which a trajectory repeats after `count`, kept if it is new; or None and the reason."""
        orbit = refine(replace(self.map, count=count), at)
        if not orbit.success:
            return None, f"unsettled: it repeats after {count} {self.turns}, but {orbit.message}"
        if not orbit.stable:
            size = np.abs(orbit.multipliers).max()
            return (
                None,
                f"unsettled: it repeats, but its orbit does not attract: a multiplier has the size {size:.9g}.",
            )
        if not near(orbit.x, at, 100 * self.tol):
            return None, ""  # on its way, and there is time to go on
        # It may be one of them that this start, still on its way to it, took for a longer one.
        k = self._near(orbit.x, self.tol)
        if k is None:
            k = len(self.orbits)
            self.orbits.append(orbit)
            self.points.append(replace(orbit.map, count=1).iterate(orbit.x, orbit.map.count))
        return k, ""

    def _how_long(self, ends: Ends, most: int) -> tuple[int, dict[int, float]]:
        """Periods after which attracting orbits beside some ends have drawn these in; and the ends that need more.

        0 where no attracting orbit is found, or all need more than `most`.
        """
        periods, slow = 0, {}
        back = _returns(ends.points)
        order = np.argsort(back.min(axis=1, initial=np.inf), kind="stable")
        spread = order[_TRIALS :: max(1, len(order[_TRIALS:]) // _TRIALS)][:_TRIALS]
        for i in [*order[:_TRIALS], *spread]:
            at = ends.points[i, -1]
            counts = dict.fromkeys(
                [int(ends.cycle[i]) or 1, int(np.argmin(back[i])) + 1 if back.size else 1, 1]
            )
            found = (refine(replace(self.map, count=count), at) for count in counts)
            orbit = next((orbit for orbit in found if orbit.success and orbit.stable), None)
            if orbit is None:
                continue
            decay = -math.log(max(np.abs(orbit.multipliers).max(initial=0.0), 1e-300)) / orbit.map.count
            far = np.abs((orbit.x - at) / (1 + np.abs(orbit.x))).max() / self.tol
            needed = 1 + _MARGIN * math.log(max(far, 1.0)) / decay
            if needed > most:
                slow[i] = needed
            else:
                periods = max(periods, math.ceil(needed))
        return periods, slow


def near(a: np.ndarray, b: np.ndarray, tol: float) -> bool:
    return bool(np.all(np.abs(a - b) <= tol * (1 + np.abs(b))))


def _only(ends: Ends, which: np.ndarray) -> Ends:
    return Ends(ends.points[which], ends.cycle[which], ends.outcome[which])


def _returns(points: np.ndarray) -> np.ndarray:
    """How far the last of the points is from each before it, the nearest in time first; (trajectories, points - 1)."""
    last = points[:, -1:]
    return np.abs((points[:, -2::-1] - last) / (1 + np.abs(last))).max(axis=2)
