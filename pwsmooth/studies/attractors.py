"""Which attractor each of many trajectories goes to, from its last points on a section.

A trajectory that repeats is at an orbit, which Newton's method finds exactly and whose multipliers say whether it
attracts. One that does not repeat is led on. Near an orbit its points obey an affine map, whose fixed point is where
Newton's method starts; and it belongs to the orbit found if this attracts and draws it in, which the trajectory itself
has to show: with d its distance from the orbit on the section, D the derivative of the map there and W weights,

    V(d) = d^T P d,    P = D^T P D + W,    V falls by d^T W d a step near the orbit,

it has to fall by half of that at least at every step of a window (Lyapunov's function of the orbit, Stein's equation).

Chain: sweep, analysis/orbits/finding.py, kinds.py -> **attractors** -> basins.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..analysis.maps.sections import Section
from ..analysis.orbits.finding import refine
from ..analysis.orbits.periodic_orbit import PeriodicOrbit
from ..results.records import Outcome
from .kinds import rests
from .plan import NO_RETURN, why_not

#: Label of a start whose trajectory had not become periodic.
UNSETTLED = -1
#: Label of a start whose trajectory failed.
FAILED = -2

_WINDOW = 200  # periods or returns at least, in which an orbit has to draw a trajectory in
_FALLS = 8  # steps of the orbit at least, at which its Lyapunov function has to fall
_ROUNDS = 4  # of leading on: with 0, 1, 3 and 7 transients before the window
_AFFINE = 1e-2  # of the points' spread, by which they may miss an affine map: Newton's method does the rest
_TRIALS = 32  # orbits that are looked for by Newton's method in a round
_NEAR = (
    1e-3  # of an orbit, relative to the states' size: there its map is as good as linear, and one fall tells
)
_EVEN = 1e-6  # of what a period moves a running state on by
_STILL = 1e-6  # of the size of the states: what a motion at rest still moves
_ONWARD = 10.0  # times what it goes to and fro: how far a running state goes on in the points
_SAME = 1e-3  # nearer than that, relative to the states' size, two guesses are one


@dataclass(frozen=True)
class Ends:
    """Where trajectories have come to: their last points, after how many these repeat, and how they ended."""

    points: np.ndarray  # (trajectories, points, n)
    cycle: np.ndarray  # (trajectories,), 0 for none
    outcome: np.ndarray  # (trajectories,)

    def only(self, which: np.ndarray) -> Ends:
        return Ends(self.points[which], self.cycle[which], self.outcome[which])


@dataclass(frozen=True)
class _Attractor:
    """An attracting orbit as what trajectories come to."""

    orbit: PeriodicOrbit
    unit: np.ndarray  # of the states, (n,)

    @property
    def size(self) -> np.ndarray:
        """Of the states, (n,): their units and what they are."""
        return self.unit + np.abs(self.orbit.x)

    @functools.cached_property
    def points(self) -> np.ndarray:
        """In which it meets the section, (count, n)."""
        return replace(self.orbit.map, count=1).iterate(self.orbit.x, self.orbit.map.count)

    @functools.cached_property
    def form(self) -> np.ndarray:
        """P of its Lyapunov function, in units of the states' size."""
        from scipy.linalg import solve_discrete_lyapunov

        size = self.size
        D = self.orbit.jacobian * size / size[:, None]
        if self.orbit.integrals is not None:  # deviations that change nothing of what the motion keeps
            rows = np.linalg.svd(self.orbit.integrals * size)[2][len(self.orbit.integrals) :]
            D = rows.T @ rows @ D @ rows.T @ rows
        return solve_discrete_lyapunov(D.T, np.eye(len(size)))

    def meets(self, x: np.ndarray, tol: float) -> bool:
        return any(_near(x, point, tol, self.unit) for point in self.points)

    def draws_in(self, points: np.ndarray, tol: float) -> bool:
        """Whether its Lyapunov function falls along a trajectory's points (number, n), until they are at the orbit."""
        count = self.orbit.map.count
        first = int(np.argmin(np.abs(points[:count] - self.orbit.x).sum(axis=1)))
        falls = self._falls(points[first::count], tol)
        return len(falls) >= _FALLS and bool(np.all(falls))

    def _falls(self, points: np.ndarray, tol: float) -> np.ndarray:
        """Where its Lyapunov function falls from one of points (..., number, n) to the next, or is at the orbit."""
        x = self.orbit.x
        off = (points - x) / self.size
        height, share = np.einsum("...i,ij,...j->...", off, self.form, off), (off**2).sum(axis=-1)
        return (height[..., 1:] <= height[..., :-1] - share[..., :-1] / 2) | (share[..., :-1] <= tol**2)

    def draws_near(self, points: np.ndarray, tol: float) -> np.ndarray:
        """Of many trajectories (trajectories, points, n) which are near the orbit, with its function falling."""
        count, last = self.orbit.map.count, points.shape[1] - 1
        scaled = (points[:, -1, None] - self.points) / (self.unit + np.abs(self.points))
        off = np.abs(scaled).max(axis=2)
        near, phase = off.min(axis=1) <= _NEAR, off.argmin(axis=1)
        for j in range(count):  # the orbit's own point is met j steps before the last
            rows = np.flatnonzero(near & (phase == j))
            places = np.arange(last - j, -1, -count)[::-1]
            if not len(rows) or len(places) < 2:
                near[rows] = False
                continue
            near[rows] = self._falls(points[np.ix_(rows, places[-2:])], tol)[:, -1]
        return near


@dataclass
class Attractors:
    """Those found so far. At whatever phase a trajectory meets one, it has the points in common with it."""

    map: Any  # of one period or return
    max_count: int
    tol: float
    found: list[_Attractor] = field(default_factory=list)

    @property
    def window(self) -> int:
        """Points of a trajectory that is led on."""
        return max(_WINDOW, 2 * self.max_count, 4 * (len(self.map.system.model.states) + 3))

    def label(
        self, ends: Ends, transient: int, lead_on: Callable[[np.ndarray, int], Ends]
    ) -> tuple[np.ndarray, np.ndarray, dict[int, np.ndarray]]:
        """Every trajectory's label, an index into `found`, and why it has none, each (trajectories,); and the last
        points (number, n) of those that are led on in vain.

        `lead_on(starts, turns)` leads trajectories on from these starts, unseen for so many periods or returns and
        seen for `window` more.
        """
        labels = np.full(len(ends.cycle), UNSETTLED)
        reasons = np.full(len(ends.cycle), "", object)
        waiting, done = np.arange(len(ends.cycle)), transient
        for k in range(_ROUNDS + 1):
            before = len(waiting)
            for i, (label, reason) in zip(waiting, self._repeating(ends)):
                labels[i], reasons[i] = label, reason
            still = (labels[waiting] == UNSETTLED) & (reasons[waiting] == "")
            waiting, ends = waiting[still], ends.only(still)
            if k > 0:
                names = [s.name for s in self.map.system.model.states]
                reasons[waiting] = [running(x, self.max_count, names, self.map.unit) for x in ends.points]
                still = reasons[waiting] == ""
                waiting, ends = waiting[still], ends.only(still)
                for i, (label, reason) in zip(waiting, self._drawn_in(ends)):
                    labels[i], reasons[i] = label, reason
                still = labels[waiting] == UNSETTLED
                waiting, ends = waiting[still], ends.only(still)
            if k == _ROUNDS or not len(waiting) or (k > 0 and len(waiting) == before):
                break
            unseen = (2**k - 1) * transient
            ends = lead_on(ends.points[:, -1], unseen)
            done += unseen + self.window
        turns = "returns" if isinstance(self.map, Section) else "periods"
        for i in waiting:
            reasons[i] = reasons[i] or (
                f"unsettled: after {done} {turns} it neither repeats nor is near an orbit; it is chaotic, "
                "quasi-periodic, or slow: give a larger `transient`."
            )
        return labels, reasons, dict(zip(waiting.tolist(), ends.points))

    def by_size(self, labels: np.ndarray) -> tuple[list[PeriodicOrbit], np.ndarray]:
        """The attractors, the largest basin first, and the labels that are indices into this list."""
        order = np.argsort([-np.sum(labels == k) for k in range(len(self.found))], kind="stable")
        has_one = labels >= 0
        labels = labels.copy()
        labels[has_one] = np.argsort(order)[labels[has_one]]
        return [self.found[k].orbit for k in order], labels

    def arrived(self, points: np.ndarray) -> np.ndarray:
        """Label of each of many trajectories (trajectories, points, n) that an attractor draws in, near it; else -1."""
        labels = np.full(len(points), UNSETTLED)
        for k, known in enumerate(self.found):
            left = np.flatnonzero(labels == UNSETTLED)
            labels[left[known.draws_near(points[left], self.tol)]] = k
        return labels

    def _repeating(self, ends: Ends) -> list[tuple[int, str]]:
        """Label and reason of each: neither where a trajectory may still come to an orbit."""
        result: list[tuple[int, str]] = []
        tried: list[tuple[int, np.ndarray, str]] = []
        for points, count, outcome in zip(ends.points, ends.cycle.tolist(), ends.outcome.tolist()):
            at, label, reason = points[-1], None, ""
            if outcome != Outcome.FINISHED:
                reason = why_not(outcome)
                label = FAILED if outcome < 0 and outcome != NO_RETURN else None
            elif count > 0:
                label = self._known(at, 10 * self.tol)
                known = [why for n, x, why in tried if n == count and _near(at, x, self.tol, self.map.unit)]
                if label is None and known:
                    reason = known[0]
                elif label is None:
                    new, reason = self._attracting(count, at)
                    # A slow one seems to repeat before it is there.
                    if new is not None and _near(new.orbit.x, at, 100 * self.tol, self.map.unit):
                        label = self._index(new)
                    else:
                        tried.append((count, at, reason))
            result.append((UNSETTLED if label is None else label, reason))
        return result

    def _drawn_in(self, ends: Ends) -> list[tuple[int, str]]:
        """Label and reason of each, of attractors that draw it in, known or found beside it."""
        result: list[tuple[int, str]] = []
        tried: list[tuple[int, np.ndarray, _Attractor | None, str]] = []
        for points in ends.points:
            drawing = next((known for known in self.found if known.draws_in(points, self.tol)), None)
            reason = ""
            for count, guess in () if drawing is not None else _centres(points, self.max_count):
                beside = [
                    (new, why)
                    for n, x, new, why in tried
                    if n == count and _near(guess, x, _SAME, self.map.unit)
                ]
                if not beside and len(tried) == _TRIALS:
                    break
                if not beside:
                    beside = [self._attracting(count, guess)]
                    tried.append((count, guess, *beside[0]))
                new, reason = beside[0]
                if new is not None and new.draws_in(points, self.tol):
                    drawing = new
                    break
                if new is not None:
                    reason = "slow: it is near an orbit that attracts, but not drawn in yet; give a larger `transient`."
            result.append((UNSETTLED, reason) if drawing is None else (self._index(drawing), ""))
        return result

    def _known(self, at: np.ndarray, tol: float) -> int | None:
        return next((k for k, known in enumerate(self.found) if known.meets(at, tol)), None)

    def _index(self, attractor: _Attractor) -> int:
        """Its index; one that is not known yet is kept."""
        k = self._known(attractor.orbit.x, self.tol)
        if k is None:
            k = len(self.found)
            self.found.append(attractor)
        return k

    def _attracting(self, count: int, at: np.ndarray) -> tuple[_Attractor | None, str]:
        """The attractor to which Newton's method leads from a point; or None, and what the orbit there lacks."""
        orbit = refine(replace(self.map, count=count), at)
        if not orbit.success:
            still = " rest" in orbit.message or (isinstance(self.map, Section) and rests(self.map, orbit.x))
            return None, f"rest: {orbit.message}" if still else ""
        if orbit.rest and not orbit.stable:
            return None, "rest: it stands still, and so does what starts beside it, elsewhere."
        if orbit.stable:
            return _Attractor(orbit, self.map.unit), ""
        size = np.abs(orbit.multipliers).max()
        return None, f"unsettled: it is at an orbit that has a multiplier of size {size:.9g}."


def _centres(points: np.ndarray, max_count: int) -> Iterator[tuple[int, np.ndarray]]:
    """(count, fixed point) of the affine maps that every count-th of a trajectory's last points (number, n) obeys."""
    least = points.shape[1] + 3
    for count in range(1, max_count + 1):
        some = points[::-count][: max(len(points) // 2, least)][::-1]
        if len(some) < least:
            return
        middle = some.mean(axis=0)
        off = some - middle
        known = np.column_stack([off[:-1], np.ones(len(off) - 1)])
        fitted, *_ = np.linalg.lstsq(known, off[1:], rcond=1e-9)
        if np.abs(known @ fitted - off[1:]).max() <= _AFFINE * np.abs(off).max():
            slope = np.eye(len(middle)) - fitted[:-1].T
            yield count, middle + np.linalg.lstsq(slope, fitted[-1], rcond=1e-9)[0]


def running(x: np.ndarray, max_count: int, states: list[str], unit: np.ndarray) -> str:
    """The name of a running motion of these points; empty for others."""
    for count in range(1, min(max_count, len(x) // 3) + 1):
        on = x[count:] - x[:-count]
        step = on[-1]
        even = np.abs(on[-count - 1 :] - step).max(axis=0) <= _EVEN * (unit + np.abs(step))
        k = int(np.argmax(np.abs(step) / unit))
        if even.all() and abs(step[k]) > 1e3 * _EVEN * unit[k]:
            return f"running: {states[k]} by {step[k]:.6g} in {count}"
    on = np.diff(x, axis=0)
    ways = np.abs(on.mean(axis=0)) * len(on)
    off = np.ptp(x - np.arange(len(x))[:, None] * on.mean(axis=0), axis=0) + _STILL * (unit + np.abs(x[-1]))
    goes = ((on > 0).all(axis=0) | (on < 0).all(axis=0)) & (ways > _ONWARD * off)
    if goes.any():
        k = int(np.argmax(goes))
        return f"running: {states[k]} by {on[:, k].mean():.4g} in 1 on average"
    return ""


def _near(a: np.ndarray, b: np.ndarray, tol: float, unit: np.ndarray) -> bool:
    return bool(np.all(np.abs(a - b) <= tol * (unit + np.abs(b))))
