"""Predictor and corrector along equilibria of one mode.

    F(u) = (f, h_J) = 0,   tau . (u - u0) = ds,   u = (x, lam_J, q),   each in a unit of its own   (H. B. Keller, 1977)

Chain: statics.py, equilibrium.py -> **mode_walk** -> equilibrium_tests.py, equilibrium_branches.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...equilibria.equilibrium import Equilibrium, made
from ...equilibria.statics import RANK, ROUNDING, Statics
from ...maps.scales import unit_of
from ..bracketing import zero_between

_MOST_NEWTON = 10
_STRAIGHT = 0.95  # least cosine between tangents of neighbours
_STEP = 1e-11  # of a Newton step, relative, after which a point is converged


@dataclass(frozen=True)
class Point:
    """u (N,) in units of the walk, the unit tangent, the equilibrium there, Newton's steps, margins of the mode."""

    u: np.ndarray
    tangent: np.ndarray
    DF: np.ndarray
    equilibrium: Equilibrium
    steps: int
    margins: np.ndarray
    on: np.ndarray  # sizes of the margins that count as nothing
    slopes: np.ndarray  # of the margins along the tangent


def units_of(statics: Statics, e: Equilibrium, u: np.ndarray) -> np.ndarray:
    """Of the unknowns at a first point: sizes of the states, of reactions and solved unknowns, 1 of multipliers."""
    size, kinds = np.ones(len(u)), [e.system.model.multipliers[j].kind for j in statics.J]
    size[: statics.n] = e.unit
    for k, kind in enumerate(kinds, statics.n):
        if kind in ("contact", "algebraic") and u[k]:
            size[k] = unit_of(abs(u[k]))
    return size + np.abs(u)


class Walk:
    """Predictor and corrector in one mode, over a parameter or, along a set of equilibria, a state."""

    def __init__(self, e: Equilibrium, name: str, scale: float) -> None:
        self.system, self.name = e.system, name
        own = len(e.x) - e.system.model.n_memory
        q = next((p for p in e.system.parameters if p.name == name), None)
        self.q = q
        self.statics = Statics(e.system, e.sides, e.x[own:], q, e.unit)
        states = [str(s) for s in e.system.model.states]
        self.place = self.statics.size if q is not None else states.index(name)
        u = self.statics.unknowns(e.x, e.mult)
        self.unit = units_of(self.statics, e, u)
        if q is not None:
            u, self.unit = np.append(u, e.system.parameters[q]), np.append(self.unit, scale)
        else:
            self.unit[self.place] = scale
        self.first = u / self.unit

    def value(self, point: Point) -> float:
        return float(point.u[self.place] * self.unit[self.place])

    def equations(self, u: np.ndarray) -> tuple[Any, ...] | None:
        """The system, F, DF in units of the walk, and the error; None where q is not allowed or nothing is defined."""
        at = u * self.unit
        system = self.system
        if self.q is not None:
            try:
                system = system.with_parameters({self.q: float(at[-1])})
            except ValueError:  # outside the assumptions of the parameter
                return None
        F, DF = self.statics(at[None])
        if not (np.isfinite(F).all() and np.isfinite(DF).all()):
            return None
        return system, F[0], DF[0] * self.unit, float(self.statics.error(F, DF, at[None])[0])

    def point(self, u: np.ndarray, direction: np.ndarray, steps: int = 0) -> Point | None:
        """The point at a solution, its tangent along `direction`."""
        equations = self.equations(u)
        if equations is None:
            return None
        system, _, DF, error = equations
        sizes = np.abs(DF).max(axis=1, keepdims=True)
        tangent = np.linalg.svd(DF / np.where(sizes > 0, sizes, 1.0))[2][-1]
        if tangent @ direction < 0:
            tangent = -tangent
        at = u * self.unit
        e = made(self.statics, at, error, steps, system)
        margins, on, slopes = self.statics.margins(at)
        return Point(u, tangent, DF, e, steps, margins, on, slopes @ (self.unit * tangent))

    def alone(self, point: Point) -> bool:
        """Whether the tangent is the one way on."""
        sizes = np.abs(point.DF).max(axis=1, keepdims=True)
        found = np.linalg.svd(point.DF / np.where(sizes > 0, sizes, 1.0), compute_uv=False)
        return bool(np.sum(found > RANK * max(1.0, found[0])) == len(point.u) - 1)

    def correct(self, guess: np.ndarray, normal: np.ndarray, direction: np.ndarray) -> Point | None:
        """Newton's method in the plane normal . (u - guess) = 0."""
        u = guess
        last = math.inf
        for steps in range(_MOST_NEWTON + 1):
            equations = self.equations(u)
            if equations is None:
                return None
            _, F, DF, error = equations
            step = np.linalg.lstsq(
                np.vstack([DF, normal]), np.append(-F, -normal @ (u - guess)), rcond=RANK * 1e-3
            )[0]
            size = float(np.abs(step / (1 + np.abs(u))).max())
            if (size <= _STEP and error <= ROUNDING) or (error <= 1e-3 * ROUNDING and steps):
                return self.point(u + step if size <= _STEP else u, direction, steps)
            if size > 2 * last or steps == _MOST_NEWTON:
                return None
            u, last = u + step, size
        return None

    def step(self, here: Point, ds: float) -> Point | None:
        """One step along the tangent; None if it must be shorter."""
        there = self.correct(here.u + ds * here.tangent, here.tangent, here.tangent)
        if there is None or np.linalg.norm(there.u - here.u) > 2 * ds:
            return None
        return there if there.tangent @ here.tangent >= _STRAIGHT else None

    def along(self, here: Point, there: Point, part: float) -> Point | None:
        """The point whose projection on the chord is at a part of it."""
        chord = there.u - here.u
        return self.correct(here.u + part * chord, chord / np.linalg.norm(chord), here.tangent)

    def at_value(self, here: Point, there: Point, wanted: float) -> Point | None:
        """The point between two at which the parameter has a value."""
        way = there.u - here.u
        normal = np.zeros(len(way))
        normal[self.place] = 1.0
        guess = here.u + way * (wanted / self.unit[self.place] - here.u[self.place]) / way[self.place]
        guess[self.place] = wanted / self.unit[self.place]
        return self.correct(guess, normal, here.tangent)

    def zero(self, here: Point, there: Point, test: Callable[[Point], float]) -> tuple[Point, float] | None:
        """Where a test function of opposite signs at two points is zero, and how well the parameter is known there."""
        point = zero_between(self, here, there, test, 1e-15)
        if point is None:
            return None
        span = abs(self.value(there) - self.value(here))
        slope = abs(test(there) - test(here))
        return point, 1e-12 * max(abs(self.value(point)), 1.0) + 1e-10 * min(span / slope, 1.0)
