"""Branches of equilibria over a parameter, through the surfaces on which their mode changes.

On the way test functions are zeroed (equilibrium_tests.py), and how far the point is inside its mode. Where that ends,
a boundary equilibrium, the branch goes on in the mode beside: a regular equilibrium becomes a pseudo-equilibrium, a
contact closes. If the parameter goes on as well, that is *persistence*, and a *nonsmooth fold* if it turns back: then
both exist on one side. With N = f_x of the regular side, C = h_x and E what the field adds beyond the surface, the sign
of C N**-1 E tells them apart (positive: fold); that of tau_q on both sides says the same.

Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, ch. 5, for boundary
equilibria.
Chain: problem.py, tests.py, way.py -> **branches** -> continuation/branches.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....door import checks
from ...equilibria.boundary_cycles import cycle_born
from ...equilibria.equilibrium import Equilibrium
from ...equilibria.statics import RANK, ROUNDING, beyond
from ..branch import Branch, branch_of
from ..special import Special
from ..way import How, Way, followed
from .problem import EquilibriumPoint, EquilibriumProblem
from .tests import between

_MOST_MODES = 50  # of a branch: changes of mode


def follow_equilibrium(
    e: Equilibrium, name: str, ranges: tuple[float, float], signs: tuple[float, ...], how: How
) -> Branch:
    """The branch of an equilibrium over a parameter, or of a set of them along a state (branches.follow_branch)."""

    def begin(sign: float) -> tuple[EquilibriumWay, EquilibriumPoint, EquilibriumPoint]:
        problem = EquilibriumProblem(e, (name,), np.array([ranges]))
        direction = np.zeros(len(problem.first))
        direction[problem.place] = sign
        first = problem.point(problem.first, direction)
        assert first is not None
        way = EquilibriumWay(problem, how)
        return way, replace(first, equilibrium=e), first

    return branch_of(*followed(begin, signs), (name,))


def coordinate(e: Equilibrium, parameter: Any) -> str:
    """The name of the parameter, or of the state along which a set of equilibria is followed; ValueError else."""
    names = {s.name for s in e.system.parameters}
    own = e.system.model.states[: len(e.x) - e.system.model.n_memory]
    free = len(e.free_directions)
    key = str(getattr(checks.named(parameter), "name", parameter))
    if key not in names and free == 1 and any(s.name == key for s in own):
        if np.abs(e.free_directions[0, [s.name for s in own].index(key)]) <= RANK:
            raise ValueError(f"`over` names the state {key}, which is the same in the whole set of equilibria.")
        return key
    found = checks.lookup(parameter, e.system.parameters, "`over`", "parameter").name
    if free:
        raise ValueError(
            f"`start` is one of a set of equilibria of dimension {free}, so that no single one leads on over {found}. "
            + (f"Follow the set along one of the states {checks.listing(own)}." if free == 1 else
               "Leave states that nothing depends on out of the model.")
        )  # fmt: skip
    return found


def value_at(e: Equilibrium, name: str) -> float:
    """The value of a parameter, or of the state along which a set is followed."""
    return float({**e.x0, **{p.name: v for p, v in e.system.parameters.items()}}[name])


class EquilibriumWay(Way):
    """A branch of equilibria to one side, through the modes that it comes to."""

    problem: EquilibriumProblem
    beside: tuple[EquilibriumProblem, EquilibriumPoint] | None = None  # the mode beyond the border that was met
    modes = 0

    def met(self, here: EquilibriumPoint, there: EquilibriumPoint) -> EquilibriumPoint | None:
        problem, found = self.problem, list[Special]()
        crossed = _crossed(here, there)
        leaving = [j for j in crossed if here.margins[j] >= -here.on[j]]
        if leaving and not self.virtual:
            border = _border(problem, here, there, leaving)
            return None if border is None else self._met_border(here, *border)
        for j in crossed:
            border = _border(problem, here, there, [j])
            if border is not None:
                found.append(_boundary(problem, border[0], j, border[2])[0])
        self.add([*found, *between(problem, here, there)])
        return there

    def _met_border(self, here: EquilibriumPoint, point: EquilibriumPoint, j: int, width: float) -> Any:
        problem = self.problem
        # Where a set of equilibria begins at the border, that shows as a branch point there.
        at = problem.value(point)
        on_way = between(problem, here, point)
        self.add([b for b in on_way if b.kind != "branch point" or abs(b.parameter - at) > width])
        others = [k for k in range(len(point.margins)) if k != j]
        both = any(abs(point.margins[k]) <= point.on[k] and here.margins[k] > here.on[k] for k in others)
        bifurcation, self.beside = _boundary(problem, point, j, width)
        self.add([bifurcation])
        self.modes += 1
        if self.beside is not None and not both and self.modes <= _MOST_MODES:
            return point
        why = "two surfaces are met at once." if both else f"{bifurcation.note}."
        return self.ends_at(point, f"{bifurcation.kind} at {problem.where(point)}: {why}")

    def moved_on(self, there: EquilibriumPoint) -> EquilibriumPoint:
        if self.beside is None:
            return there
        (self.problem, there), self.beside, self.ds = self.beside, None, self.first
        return there


def _crossed(here: EquilibriumPoint, there: EquilibriumPoint) -> list[int]:
    """The multipliers whose bound was passed between two points, in either direction."""
    a, b = here.margins, there.margins
    at = np.abs(a) <= here.on
    out = (b < -there.on) & ((a > 0) | (at & (here.slopes < 0)))
    return [int(j) for j in np.flatnonzero(out | ((a < -here.on) & (b > there.on)))]


def _border(
    problem: EquilibriumProblem, here: EquilibriumPoint, there: EquilibriumPoint, crossed: list[int]
) -> tuple[EquilibriumPoint, int, float] | None:
    """The first of the bounds that are passed."""
    first = None
    for j in crossed:
        if abs(here.margins[j]) <= here.on[j]:
            return here, j, 1e-12 * (1 + abs(problem.value(here)))
        found = problem.zero(here, there, lambda p, j=j: float(p.margins[j]))  # type: ignore[misc]
        if found is None:
            return None
        distance = float(np.linalg.norm(found[0].u - here.u))
        if first is None or distance < first[0]:
            first = distance, (found[0], j, found[1])
    return None if first is None else first[1]


def _boundary(
    problem: EquilibriumProblem, point: EquilibriumPoint, j: int, width: float
) -> tuple[Special, tuple[EquilibriumProblem, EquilibriumPoint] | None]:
    """The boundary equilibrium at a point, and the problem and first point of the mode beside, where there is one."""
    e = point.equilibrium
    mu = e.system.model.multipliers[j]
    side, kink = e.sides[j], mu.kind == "switch" and mu.regularity == "kink"
    new = beyond(mu, side, e.mult[j])
    if mu.kind == "disc":
        what = (
            f"|{mu.symbol}| reaches 1: it slips" if side == 0 else f"the slip of {mu.symbol} ends: it is held"
        )
    elif mu.kind == "contact":
        what = f"the contact {mu.symbol} {'opens' if side == 0 else 'closes'}"
    elif kink:
        what = f"the kink {mu.surface} = 0 of {mu.symbol} is met"
    elif side == 0:
        what = f"{mu.symbol} reaches {new}: the pseudo-equilibrium leaves {mu.surface} = 0"
    else:
        what = f"{mu.surface} = 0 is met at {mu.symbol} = {side}: a pseudo-equilibrium is held there"
    kind = "end of the set" if problem.along_state else "boundary equilibrium"
    mult = e.mult.copy()
    mult[j] = new if mu.kind == "switch" and new else 0.0 if mu.kind == "contact" else side if not kink else new
    sides = (*e.sides[:j], new, *e.sides[j + 1 :])
    beside = replace(e, mult=mult, sides=sides, message="")
    cycle = None if problem.along_state else cycle_born(e, j)
    bifurcation = Special(kind, problem.values(point), e, width, note=what, cycle=cycle)
    if problem.along_state:
        return bifurcation, None
    after = problem.in_mode_of(beside)
    there = after.point(after.first, np.ones(len(after.first)))
    if (
        there is None
        or there.equilibrium.residual > 1e3 * ROUNDING
        or not (there.alone and there.equilibrium.isolated)
    ):
        return replace(bifurcation, note=what + ", and what lies beyond is no single equilibrium"), None
    if there.slopes[j] < 0:
        there = after.point(after.first, -there.tangent)
        assert there is not None
    q, ahead = point.tangent[problem.place], there.tangent[after.place]
    out = np.sign(point.slopes[j])  # 1 where a virtual branch comes back
    if min(abs(q), abs(ahead)) > 1e-9:
        kind += ": persistence" if q * ahead * -out > 0 else ": nonsmooth fold"
    return replace(bifurcation, kind=kind, beyond=there.equilibrium), (after, there)
