"""Equilibria along a branch of one mode, and with a condition along a curve over two parameters.

    F(u) = (f, h_J) = 0,   c(u) = 0 with a condition,   u = (x, lam_J, q) or (x, lam_J, p, q),   in a unit each

Chain: statics.py, equilibrium.py, problem.py, conditions.py -> **problem** -> tests.py, branches.py, ways.py.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...equilibria.equilibrium import Equilibrium, made
from ...equilibria.statics import RANK, ROUNDING, Statics
from ...maps.scales import unit_of
from ..bracketing import zero_between
from ..problem import Equations, Point, Problem
from .conditions import Boundary, EquilibriumCondition, Spot, differences

_STRAIGHT = 0.95  # least cosine between tangents of neighbours
_STEP = 1e-11  # of a Newton step, relative, after which a point is converged


@dataclass(frozen=True)
class EquilibriumPoint(Point):
    """A point of a branch of equilibria, and how far it is inside its mode.

    The equations' rows, margins of the mode, how large they are where they count as nothing, their slopes along the
    tangent, and test functions along a curve.
    """

    rows: np.ndarray
    spot: Spot
    equilibrium: Equilibrium
    margins: np.ndarray
    on: np.ndarray
    slopes: np.ndarray
    tests: dict[str, float]

    @property
    def item(self) -> Equilibrium:
        """What is shown of it."""
        return self.equilibrium


class EquilibriumProblem(Problem):
    """An equilibrium in one mode: over a parameter, along a state of a set of them, or with a condition over two."""

    noun, nouns = "equilibrium", "equilibria"
    most_newton, tolerance = 10, ROUNDING
    converged, rounded = 10 * _STEP, 1e3 * _STEP  # with a condition, which has twelve digits

    def __init__(
        self, e: Equilibrium, names: tuple[str, ...], ranges: np.ndarray,
        condition: EquilibriumCondition | None = None,
    ) -> None:  # fmt: skip
        self.names, self.name, self.ranges, self.condition = names, names[0], ranges, condition
        if condition is None:
            self.rank, self.diverged = RANK, 2.0
        else:
            self.most_newton = 12
        self.take(e)

    def take(self, e: Equilibrium) -> None:
        """From now on in the mode of this equilibrium, which is near to the `first` point."""
        known, widths = {p.name: p for p in e.system.parameters}, np.ptp(self.ranges, axis=1)
        q = tuple(known[name] for name in self.names if name in known)
        self.statics = Statics(e.system, e.sides, e.x[len(e.x) - e.system.model.n_memory :], q, e.unit)
        u = self.statics.unknowns(e.x, e.mult)
        self.sizes, self.place = _units_of(self.statics, e, u), self.statics.size
        if q:
            u, self.sizes = np.append(u, [e.system.parameters[p] for p in q]), np.append(self.sizes, widths)
        else:
            self.place = [str(s) for s in e.system.model.states].index(self.name)
            self.sizes[self.place] = widths[0]
        self.first = u / self.sizes

    def in_mode_of(self, e: Equilibrium) -> EquilibriumProblem:
        """The same in another mode."""
        other = copy.copy(self)
        other.take(e)
        return other

    @property
    def along_state(self) -> bool:
        """Whether a set of equilibria is followed along a state."""
        return not self.statics.q

    def spot(self, at: np.ndarray) -> tuple[Spot, np.ndarray, float] | None:
        """The spot at u, not in units, F and its error; None where a parameter is not allowed or nothing is defined."""
        try:
            system = self.statics.at(at)
        except ValueError:  # outside the assumptions of a parameter
            return None
        F, DF = self.statics(at[None])
        if not (np.isfinite(F).all() and np.isfinite(DF).all()):
            return None
        return Spot(self.statics, at, DF[0], system), F[0], float(self.statics.error(F, DF, at[None])[0])

    def equations(self, u: np.ndarray, before: Equations | None = None) -> Equations | None:
        found, slopes = self.spot(u * self.sizes), np.empty(0)
        if found is None:
            return None
        spot, F, error = found
        rows = spot.DF * self.sizes
        if self.condition is not None:
            F, slopes = np.append(F, self.condition.value(spot)), self._slopes(spot)
            rows = np.vstack([rows, slopes * self.sizes])
        scale = np.abs(rows).max(axis=1)
        scale = np.where(scale > 0, scale, 1.0)
        return Equations(F / scale, rows / scale[:, None], error, (spot, slopes))

    def _slopes(self, spot: Spot) -> np.ndarray:
        """Of the condition."""
        if isinstance(self.condition, Boundary):
            return self.condition.slopes(spot)

        def at(u: np.ndarray) -> Spot | None:
            found = self.spot(u)
            return None if found is None else found[0]

        return differences(self.condition, at, spot, self.sizes)

    def solved(self, error: float, size: float, last: float, steps: int) -> bool:
        if self.condition is not None:
            return super().solved(error, size, last, steps)
        return size <= _STEP and error <= ROUNDING or error <= 1e-3 * ROUNDING and steps > 0

    def made(self, u: np.ndarray, equations: Equations, steps: int, tangent: np.ndarray, alone: bool) -> Any:
        spot, slopes = equations.parts
        e = made(self.statics, spot.u, equations.error, steps, spot.system)
        margins, on, along = self.statics.margins(spot.u)
        tests = {} if self.condition is None else self.condition.tests(spot, slopes)
        along = along @ (self.sizes * tangent)
        rows = spot.DF * self.sizes
        return EquilibriumPoint(u, tangent, steps, alone, rows, spot, e, margins, on, along, tests)

    def point(self, u: np.ndarray, direction: np.ndarray) -> EquilibriumPoint | None:
        """The point at a solution, its tangent along `direction`."""
        equations = self.equations(u)
        return None if equations is None else self.reached(u, equations, direction)

    def leads(self, here: Any, there: Any, ds: float) -> bool:
        return bool(there.tangent @ here.tangent >= _STRAIGHT)

    def zero(self, here: Any, there: Any, test: Callable[[Any], float]) -> tuple[Any, float] | None:
        """Where a test function of opposite signs at two points is zero, and how well the parameter is known there."""
        point = zero_between(self, here, there, test, 1e-15)
        if point is None:
            return None
        span = abs(self.value(there) - self.value(here))
        slope = abs(test(there) - test(here))
        return point, 1e-12 * max(abs(self.value(point)), 1.0) + 1e-10 * min(span / slope, 1.0)


def _units_of(statics: Statics, e: Equilibrium, u: np.ndarray) -> np.ndarray:
    """Of the unknowns at a first point: sizes of the states, of reactions and solved unknowns, 1 of multipliers."""
    size, kinds = np.ones(len(u)), [e.system.model.multipliers[j].kind for j in statics.J]
    size[: statics.n] = e.unit
    for k, kind in enumerate(kinds, statics.n):
        if kind in ("contact", "algebraic") and u[k]:
            size[k] = unit_of(abs(u[k]))
    return size + np.abs(u)
