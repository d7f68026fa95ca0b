"""Steps along a curve of equilibria in two parameters: predictor and corrector in one mode.

    F(u) = 0,   c(u) = 0,   tau . (u - u0) = ds,   u = (x, lam_J, p, q),   each in a unit of its own

Chain: equilibrium_conditions.py -> **equilibrium_walk** -> equilibrium_ways.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...equilibria.equilibrium import Equilibrium, made
from ...equilibria.statics import ROUNDING
from .conditions import Boundary, Spot, Statics2, differences
from .mode_walk import units_of

_MOST_NEWTON = 12
_STEP = 1e-10  # of a Newton step, in units, after which a point is converged: c has twelve digits
_STRAIGHT = 0.95  # least cosine between tangents of neighbours


@dataclass(frozen=True)
class Point:
    """u in units, the unit tangent, Newton's steps, the spot, tests, and the margins of the mode."""

    u: np.ndarray
    tangent: np.ndarray
    steps: int
    spot: Spot
    equilibrium: Equilibrium
    tests: dict[str, float]
    margins: np.ndarray


class Walk2:
    """Predictor and corrector in one mode, over two parameters."""

    def __init__(self, e: Equilibrium, names: tuple[str, str], widths: np.ndarray, condition: Any) -> None:
        own = len(e.x) - e.system.model.n_memory
        self.names, self.condition = names, condition
        self.statics = Statics2(e.system, e.sides, e.x[own:], names, e.unit)
        self.size = self.statics.size
        x = self.statics.unknowns(e.x, e.mult)
        values = [
            float(next(v for p, v in e.system.parameters.items() if p.name == q)) for q in self.statics.names
        ]
        self.unit = np.concatenate([units_of(self.statics, e, x), widths])
        self.first = np.concatenate([x, values]) / self.unit

    def spot(self, u: np.ndarray) -> tuple[Spot, np.ndarray, float] | None:
        """The spot at u (not in units), F and its error; None where a parameter is not allowed."""
        try:
            system = self.statics.at(u)
        except ValueError:  # outside the assumptions of a parameter
            return None
        F, DF = self.statics(u[None])
        if not (np.isfinite(F).all() and np.isfinite(DF).all()):
            return None
        error = float(self.statics.error(F, DF, u[None])[0])
        return Spot(self.statics, u, DF[0], system), F[0], error

    def slopes(self, spot: Spot) -> np.ndarray:
        if isinstance(self.condition, Boundary):
            return self.condition.slopes(spot)

        def at(u: np.ndarray) -> Spot | None:
            found = self.spot(u)
            return None if found is None else found[0]

        return differences(self.condition, at, spot, self.unit)

    def correct(
        self, guess: np.ndarray, normal: np.ndarray | None, direction: np.ndarray | None
    ) -> Point | None:
        """Newton's method in the plane normal . (u - guess) = 0, or to the nearest point without one."""
        u, last = guess, math.inf
        for steps in range(_MOST_NEWTON + 1):
            found = self.spot(u * self.unit)
            if found is None:
                return None
            spot, F, error = found
            try:
                c, slopes = self.condition.value(spot), self.slopes(spot)
            except np.linalg.LinAlgError:
                return None
            rows = np.vstack([spot.DF, slopes]) * self.unit
            right = np.append(-F, -c)
            if normal is not None:
                rows, right = np.vstack([rows, normal]), np.append(right, -normal @ (u - guess))
            if not (np.isfinite(rows).all() and np.isfinite(right).all()):
                return None
            scale = np.abs(rows).max(axis=1)
            scale = np.where(scale > 0, scale, 1.0)
            move = np.linalg.lstsq(rows / scale[:, None], right / scale, rcond=1e-14)[0]
            size = float(np.abs(move / (1 + np.abs(u))).max())
            if error <= ROUNDING and (size <= _STEP or size > 0.3 * last and size <= 100 * _STEP):
                return self._point(u, rows[: self.size + 1], spot, error, steps, slopes, direction)
            if steps == _MOST_NEWTON or size > 10 * last:
                return None
            u, last = u + move, size
        return None

    def _point(self, u, rows, spot, error, steps, slopes, direction) -> Point:
        scale = np.abs(rows).max(axis=1, keepdims=True)
        tangent = np.linalg.svd(rows / np.where(scale > 0, scale, 1.0))[2][-1]
        if direction is not None and tangent @ direction < 0:
            tangent = -tangent
        e = made(self.statics, spot.u, error, steps, spot.system)
        tests = self.condition.tests(spot, slopes)
        margins, _, _ = self.statics.margins(spot.u)
        return Point(u, tangent, steps, spot, e, tests, margins)

    def step(self, here: Point, ds: float) -> Point | None:
        there = self.correct(here.u + ds * here.tangent, here.tangent, here.tangent)
        if there is None or np.linalg.norm(there.u - here.u) > 2 * ds:
            return None
        return there if there.tangent @ here.tangent >= _STRAIGHT else None

    def along(self, here: Point, there: Point, part: float) -> Point | None:
        chord = there.u - here.u
        return self.correct(here.u + part * chord, chord / np.linalg.norm(chord), here.tangent)

    def values(self, point: Point) -> dict[str, float]:
        return dict(zip(self.names, map(float, point.spot.u[self.size :])))
