"""What is followed along a branch: unknowns, equations and units; and the steps along it, the same for all that is.

    F(u) = 0,   tau . (u - u0) = ds,   u = (unknowns, parameters) / sizes     (H. B. Keller, 1977)

    orbit_problem.py          orbits: the points at which segments begin, a parameter
    curves/problem.py         orbits with a condition: two parameters, the condition's own unknowns
    equilibria/problem.py     equilibria: states, multipliers that are held, one parameter or two with a condition

Chain: **problem** -> bracketing.py, way.py and the three problems.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

_AT = 1e-14  # of the ranges: on the border
_CUTOFF = 1e-14  # of singular values in Newton's method


@dataclass(frozen=True)
class Point:
    """A point of a branch: u (N,), the unit tangent there, and the steps that Newton's method took.

    `alone` is False where the equations leave more than one direction: a family at one parameter value.
    """

    u: np.ndarray
    tangent: np.ndarray
    steps: int
    alone: bool


class Equations(NamedTuple):
    """F (N - 1,) or more, its slopes (N - 1, N) by u, how far F is from 0, and what a point is made of."""

    F: np.ndarray
    DF: np.ndarray
    error: float
    parts: Any


class Problem:
    """Unknowns and equations of what is followed, and the problem along its solutions.

    A problem says `equations`, what it makes of a solution (`made`), how Newton's method ends (`most_newton`,
    `tolerance` of the error, `converged` and `rounded` of the last move, relative: inf where the error alone tells),
    and when a step leads on (`leads`).
    """

    noun, nouns = "orbit", "orbits"
    names: tuple[str, ...]  # of the parameters (or of the state) along which it is followed
    ranges: np.ndarray  # (number of parameters, 2), in their units
    sizes: np.ndarray  # (N,), of each unknown
    place: int  # of the first parameter among the unknowns

    most_newton = 8
    tolerance = 0.0
    converged, rounded = math.inf, 0.0
    diverged = 10.0  # times the move before
    rank = 0.0  # of the smallest singular value of DF to the largest: below it there is another direction

    # ---- what a problem is

    def equations(self, u: np.ndarray, before: Equations | None = None) -> Equations | None:
        """F and DF at u, with slopes of those `before` where these are given; None where nothing is defined."""
        raise NotImplementedError

    def made(self, u: np.ndarray, equations: Equations, steps: int, tangent: np.ndarray, alone: bool) -> Any:
        """The point of a solution; None where it is none."""
        raise NotImplementedError

    def leads(self, here: Any, there: Any, ds: float) -> bool:
        """Whether a point is the next one of the same branch."""
        return True

    def settled(self, u: np.ndarray, equations: Equations) -> np.ndarray | None:
        """What is moved by Newton's method, as the section has it; None where that is not allowed."""
        return u

    def size(self, equations: Equations, move: np.ndarray, u: np.ndarray) -> float:
        """What becomes smaller from step to step of Newton's method."""
        return float(np.abs(move / (1 + np.abs(u))).max())

    def solved(self, error: float, size: float, last: float, steps: int) -> bool:
        """Whether Newton's method has ended."""
        stands = size > 0.3 * last and size <= self.rounded  # roundings are all that moves it
        return error <= self.tolerance and (size <= self.converged or stands)

    def cut(self, here: Any) -> Any:
        """The same point with more unknowns, with which it is better known; None where there are none."""
        return None

    # ---- values

    def value(self, point: Any) -> float:
        """The (first) parameter."""
        return float(point.u[self.place] * self.sizes[self.place])

    def values(self, point: Any) -> dict[str, float]:
        """All parameters."""
        at = slice(self.place, self.place + len(self.names))
        return dict(zip(self.names, map(float, (point.u * self.sizes)[at])))

    def where(self, point: Any) -> str:
        """The parameters in words."""
        return ", ".join(f"{name} = {value:.10g}" for name, value in self.values(point).items())

    # ---- the walk

    def correct(self, guess: np.ndarray, normal: np.ndarray | None, direction: np.ndarray | None) -> Any:
        """Newton's method in the plane normal . (u - guess) = 0, or to the nearest point without one."""
        try:
            return self._corrected(guess, normal, direction)
        except np.linalg.LinAlgError:
            return None

    def _corrected(self, guess, normal, direction) -> Any:
        u: Any = guess
        last, slow, equations = math.inf, True, None
        for steps in range(self.most_newton + 1):
            # From the second step on slopes are near enough, as a rule.
            old = None if steps < 2 or normal is None or slow else equations
            if (equations := self.equations(u, old)) is None:
                return None
            if self.converged == math.inf and equations.error <= self.tolerance:
                return self.reached(u, equations, direction, steps)
            rows, right = equations.DF, -equations.F
            if normal is not None:
                rows, right = np.vstack([rows, normal]), np.append(right, -normal @ (u - guess))
            if not (np.isfinite(rows).all() and np.isfinite(right).all()):
                return None
            move = np.linalg.lstsq(rows, right, rcond=_CUTOFF)[0]
            size = self.size(equations, move, u)
            if self.solved(equations.error, size, last, steps):
                return self.reached(u, equations, direction, steps)
            if not np.isfinite(size) or steps == self.most_newton or size > self.diverged * last:
                return None
            last, slow, u = size, size > 1e-2 * last, u + move
            if normal is not None and np.count_nonzero(normal) == 1:
                u[normal != 0] = guess[normal != 0]  # an unknown that is given stays so to the last bit
            if (u := self.settled(u, equations)) is None:
                return None
        return None

    def reached(self, u: np.ndarray, equations: Equations, direction: np.ndarray | None, steps: int = 0) -> Any:
        """The point of a solution, its tangent to the side of `direction`."""
        along = np.ones(len(u)) if direction is None else direction
        return self.made(u, equations, steps, *only_way(equations.DF, along, self.rank))

    def step(self, here: Any, ds: float) -> Any:
        """One step along the tangent; None if it must be shorter."""
        there = self.correct(here.u + ds * here.tangent, here.tangent, here.tangent)
        near = there is not None and 0 < np.linalg.norm(there.u - here.u) <= 2 * ds
        return there if near and self.leads(here, there, ds) else None

    def ahead(self, here: Any, ds: float) -> Any:
        """One step, no further than the border of the ranges: beyond it a parameter may have no meaning."""
        ways = []
        for k, (low, high) in enumerate(self.ranges, self.place):
            rate = here.tangent[k]
            border = (high if rate > 0 else low) / self.sizes[k]
            if rate and 0 < (border - here.u[k]) / rate < ds:
                ways.append(((border - here.u[k]) / rate, k, border))
        if ways:
            reach, k, border = min(ways)
            there = self.at(here, k, border)
            if there is not None and np.linalg.norm(there.u - here.u) <= 2 * reach:
                if self.leads(here, there, reach):
                    return there
        return self.step(here, ds)

    def within(self, here: Any, there: Any) -> tuple[Any, str]:
        """The point, or that on the border of the ranges which the way to it passes, and the border in words."""
        for k, (name, (low, high)) in enumerate(zip(self.names, self.ranges), self.place):
            u, scale = there.u[k], self.sizes[k]
            over = u >= high / scale - _AT and u > here.u[k]
            if not (over or u <= low / scale + _AT and u < here.u[k]):
                continue
            past = high if over else low
            if abs(u - past / scale) > _AT:
                at, reach = self.at(here, k, past / scale, there), np.linalg.norm(there.u - here.u)
                # One so much farther than the point beyond the border is of another branch.
                there = None if at is None or np.linalg.norm(at.u - here.u) > 2 * reach else at
            return there, f"{name} = {past:.9g}"
        return there, ""

    def at(self, near: Any, k: int, value: float, other: Any = None) -> Any:
        """The point at which an unknown has a value: by the tangent of a point near it, or between two."""
        way = near.tangent if other is None else other.u - near.u
        guess, normal = near.u + way * (value - near.u[k]) / way[k], np.zeros(len(near.u))
        guess[k], normal[k] = value, 1.0
        return self.correct(guess, normal, near.tangent)

    def along(self, here: Any, there: Any, part: float, near: Any = None) -> Any:
        """The point whose projection on the chord is at a part of it: along the tangent of a near one first, or between
        those of both."""
        chord = there.u - here.u
        length = float(np.linalg.norm(chord))
        normal = chord / length
        target = here.u + part * chord
        guesses = [target]
        if near is not None and abs(slope := near.tangent @ normal) > 0.1:
            guesses.insert(0, near.u + near.tangent * (normal @ (target - near.u)) / slope)
        elif near is None and min(here.tangent @ normal, there.tangent @ normal) > 0.5:
            first, last = (p.tangent * length / (p.tangent @ normal) - chord for p in (here, there))
            guesses.insert(0, target + part * (1 - part) * ((1 - part) * first - part * last))
        found = (self.correct(guess, normal, here.tangent) for guess in guesses)
        return next((point for point in found if point is not None), None)


def only_way(DF: np.ndarray, direction: np.ndarray, rank: float) -> tuple[np.ndarray, bool]:
    """Unit null vector of DF (N - 1, N), to the side of `direction`; whether there is no other one.

    From two bordered systems: singular vectors of 30 segments' equations cost a hundred times as much. DF may have more
    rows, which follow from the others.
    """
    N = len(direction)
    sizes, last = np.linalg.svd(DF, compute_uv=False), np.append(np.zeros(N - 1), 1.0)
    tangent = direction / (np.linalg.norm(direction) or 1.0)
    try:
        for _ in range(2):
            tangent = np.linalg.solve(np.vstack([DF, tangent]), last)
            tangent = tangent / np.linalg.norm(tangent)
    except (np.linalg.LinAlgError, ValueError):  # the direction is across it, there are others, or more rows
        tangent[:] = np.nan
    if not np.isfinite(tangent).all():
        tangent = np.linalg.svd(DF)[2][-1]
    tangent = tangent if tangent @ direction >= 0 else -tangent
    return tangent, bool(sizes[N - 2] > rank * max(1.0, sizes[0]))
