"""A curve of equilibria to one side: what is met on its way, what begins there, and why it ends.

Chain: problem.py, way.py, special.py -> **ways** -> curves.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...equilibria.equilibrium import Equilibrium, made
from ...equilibria.statics import Statics, beyond
from ..bracketing import zero_between
from ..special import Lead, Special
from ..way import Way
from .conditions import BOUNDARY, Boundary, EquilibriumCondition, Hopf
from .problem import EquilibriumPoint, EquilibriumProblem

_INSIDE = 1e-7  # of a margin: what is less is the border itself


def beyond_border(e: Equilibrium, j: int | None) -> tuple[int, int]:
    """Of the multiplier (that whose border is nearest) also the side beyond."""
    if j is None:
        own = len(e.x) - e.system.model.n_memory
        statics = Statics(e.system, e.sides, e.x[own:])
        inside = statics.margins(statics.unknowns(e.x, e.mult))[0]
        if not np.isfinite(inside).any():
            raise ValueError(
                "`start` has no switch or contact, so that it comes to no boundary; give another `kind`."
            )
        j = int(np.argmin(np.abs(inside)))
    return j, beyond(e.system.model.multipliers[j], e.sides[j], e.mult[j])


class EquilibriumCurveWay(Way):
    """A curve to one side."""

    problem: EquilibriumProblem
    begins = False  # whether the first point is one of codimension 2 itself

    @property
    def condition(self) -> EquilibriumCondition:
        assert self.problem.condition is not None
        return self.problem.condition

    def moved_on(self, there: EquilibriumPoint) -> EquilibriumPoint:
        self.condition.frame(there.spot)
        return there

    def _leaves(self, here: EquilibriumPoint, there: EquilibriumPoint) -> bool:
        """Whether a way leads from the border of the mode out of it at once."""
        genuine = self.condition.genuine(there.spot)
        own = self._own()
        out = [
            j
            for j, margin in enumerate(there.margins)
            if j != own and margin < 0 and abs(here.margins[j]) < _INSIDE
        ]
        return bool(out) or not genuine

    def _own(self) -> int | None:
        return self.condition.j if isinstance(self.condition, Boundary) else None

    def met(self, here: EquilibriumPoint, there: EquilibriumPoint) -> EquilibriumPoint | None:
        """Locates what happens on the way between two points; the curve may end there."""
        problem, condition, found = self.problem, self.condition, []
        born = self.begins and len(self.points) == 1
        if born and not self.virtual and self._leaves(here, there):
            self.end = f"it begins at {problem.where(here)}."
            return None
        for name in here.tests:
            a, b = here.tests[name], there.tests.get(name, math.nan)
            if not a * b < 0 or born and abs(a) < 1e-6 * abs(b):
                continue
            at = zero_between(problem, here, there, _test(name))
            if at is not None and abs(at.tests[name]) <= 0.01 * (abs(a) + abs(b)) and self._is(name, at):
                found.append((at, name, condition.ends(name), self._leads(name, at, None)))
        for j, (a, b) in enumerate(zip(here.margins, there.margins)):
            if j == self._own() or not a * b < 0 or born and abs(a) < _INSIDE:
                continue
            at = zero_between(problem, here, there, _margin(j))
            if at is not None:
                name = f"{condition.kind} + {BOUNDARY}" if condition.kind != BOUNDARY else f"{BOUNDARY} twice"
                why = "beyond it the equilibrium is virtual" if a > 0 and not self.virtual else ""
                found.append((at, name, why, self._leads(name, at, j)))
        self.turned(here, there)
        chord = there.u - here.u
        for at, name, why, leads in sorted(found, key=lambda one: (one[0].u - here.u) @ chord):
            self.add([Special(name, problem.values(at), at.equilibrium, note=why, leads=leads)])
            if why:
                return self.ends_at(at, f"{name} at {problem.where(at)}: {why}.")
        return there

    def _is(self, name: str, at: EquilibriumPoint) -> bool:
        """Whether a zero is what its name says: of a boundary's Hopf point no neutral saddle."""
        kind = name.removeprefix(f"{BOUNDARY} + ")
        if not kind.startswith("Hopf") or kind == name:
            return True
        condition = self.condition
        spot = condition.beside(at.spot) if kind.endswith("beside") else at.spot
        return spot is not None and Hopf("Hopf").genuine(spot)

    def _leads(self, name: str, at: EquilibriumPoint, j: int | None) -> tuple[Lead, ...]:
        """The curves that begin or pass there."""
        e, kind = at.equilibrium, self.condition.kind
        cut = (e, e.x, False)
        if j is not None:
            return (Lead(BOUNDARY, cut, beyond_border(e, j)),)
        hopf = "sliding Hopf" if e.kind == "pseudo-equilibrium" else "Hopf"
        if name == "Bogdanov-Takens":
            return (Lead(hopf if kind == "fold" else "fold", cut),)
        second = name.partition(" + ")[2]
        if isinstance(self.condition, Boundary) and second.endswith("beside"):
            spot = self.condition.beside(at.spot)
            if spot is None:
                return ()
            there = made(spot.statics, spot.u, 0.0, 0, spot.system)
            cut, second = (there, there.x, False), second.removesuffix(" beside")
            hopf = "sliding Hopf" if there.kind == "pseudo-equilibrium" else "Hopf"
        if second in ("fold", "Hopf"):
            return (Lead(hopf if second == "Hopf" else "fold", cut),)
        return ()


def _test(name: str) -> Callable[[EquilibriumPoint], float]:
    return lambda point: point.tests.get(name, math.nan)


def _margin(j: int) -> Callable[[EquilibriumPoint], float]:
    return lambda point: float(point.margins[j])
