"""Branches of equilibria over a parameter, through the surfaces on which their mode changes.

On the way test functions are zeroed (equilibrium_tests.py), and how far the point is inside its mode. Where that ends,
a boundary equilibrium, the branch goes on in the mode beside: a regular equilibrium becomes a pseudo-equilibrium, a
contact closes. If the parameter goes on as well, that is *persistence*, and a *nonsmooth fold* if it turns back: then
both exist on one side. With N = f_x of the regular side, C = h_x and E what the field adds beyond the surface, the sign
of C N**-1 E tells them apart (positive: fold); that of tau_q on both sides says the same.

Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, ch. 5, for boundary
equilibria.
Chain: mode_walk.py, equilibrium_tests.py -> **equilibrium_branches** -> continuation.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ....door import checks
from ...equilibria.boundary_cycles import cycle_born
from ...equilibria.equilibrium import Equilibrium
from ...equilibria.statics import RANK, ROUNDING, beyond
from .branch import EquilibriumBifurcation, EquilibriumBranch
from .mode_walk import Point, Walk
from .tests import between

_MOST_MODES = 50  # of a branch: changes of mode


def follow_equilibrium(
    e: Equilibrium, name: str, bounds: tuple[float, float], lengths: tuple[float, float, float], most: int,
    virtual: bool, late: Callable[[], bool],
) -> EquilibriumBranch:  # fmt: skip
    """The branch of an equilibrium over a parameter, or of a set of them along a state (branches.follow_branch)."""
    branch = EquilibriumBranch(name, [e])
    branch.end = _followed(branch, e, bounds, lengths, most, virtual, late)
    return branch


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


def _followed(branch, e, bounds, lengths, most, virtual, late) -> str:
    (step, longest, shortest), (begin, end), name = lengths, bounds, branch.parameter
    walk = Walk(e, name, abs(end - begin))
    direction = np.zeros(len(walk.first))
    direction[walk.place] = math.copysign(1.0, end - begin)
    here = walk.point(walk.first, direction)
    assert here is not None
    modes, ds = 0, min(step, longest)
    while len(branch.equilibria) < most:
        where = f"{name} = {walk.value(here):.10g}"
        if late():
            return f"`max_seconds` are used up at {where}: give more, or go on from `equilibria[-1]`."
        if not walk.alone(here):
            return f"at {where} the equilibrium is not isolated: there is a set of them, and no single way leads on."
        there = walk.step(here, ds)
        if there is None:
            if ds > shortest:
                ds *= 0.3
                continue
            return f"no equilibrium was found beyond {where} with steps down to {ds:.1g}."
        past = _passed(walk.value(there), walk.value(here), begin, end)
        if past is not None:
            there = walk.at_value(here, there, past)
            if there is None:
                return f"no equilibrium was found at {name} = {past:g}."
        crossed = _crossed(here, there)
        leaving = [j for j in crossed if here.margins[j] >= -here.on[j]]
        if leaving and not virtual:
            border = _border(walk, here, there, leaving)
            if border is None:
                ds *= 0.3
                if ds < shortest:
                    return f"the border of the mode was lost beyond {where}."
                continue
            point, j, width = border
            # Where a set of equilibria begins at the border, that shows as a branch point there.
            on_way = between(walk, here, point)
            branch.bifurcations += [
                b for b in on_way if b.kind != "branch point" or abs(b.parameter - walk.value(point)) > width
            ]
            branch.equilibria.append(point.equilibrium)
            both = [k for k in range(len(point.margins)) if k != j and abs(point.margins[k]) <= point.on[k]
                    and here.margins[k] > here.on[k]]  # fmt: skip
            bifurcation, after = _boundary(walk, point, j, width, abs(end - begin))
            branch.bifurcations.append(bifurcation)
            modes += 1
            if after is None or both or modes > _MOST_MODES:
                return f"{bifurcation.kind} at {name} = {walk.value(point):.10g}: " + (
                    "two surfaces are met at once." if both else bifurcation.what + "."
                )
            walk, here = after
            ds = min(step, longest)
            continue
        for j in crossed:
            border = _border(walk, here, there, [j])
            if border is not None:
                branch.bifurcations.append(_boundary(walk, border[0], j, border[2], abs(end - begin))[0])
        branch.bifurcations += between(walk, here, there)
        branch.equilibria.append(there.equilibrium)
        if past is not None:
            return f"reached {name} = {past:g}."
        ds = min(ds * (2.0 if there.steps <= 3 else 1.0 if there.steps <= 5 else 0.5), longest)
        here = there
    return f"stopped after {len(branch.equilibria)} equilibria (`max_points`)."


def _passed(q: float, q0: float, begin: float, end: float) -> float | None:
    """The bound that the last step has passed: the end of the range or, after a turn, its beginning."""
    low, high = sorted((begin, end))
    if q >= high and q > q0:
        return high
    return low if q <= low and q < q0 else None


def _crossed(here: Point, there: Point) -> list[int]:
    """The multipliers whose bound was passed between two points, in either direction."""
    a, b = here.margins, there.margins
    at = np.abs(a) <= here.on
    out = (b < -there.on) & ((a > 0) | (at & (here.slopes < 0)))
    return [int(j) for j in np.flatnonzero(out | ((a < -here.on) & (b > there.on)))]


def _border(walk: Walk, here: Point, there: Point, crossed: list[int]) -> tuple[Point, int, float] | None:
    """The first of the bounds that are passed."""
    first = None
    for j in crossed:
        if abs(here.margins[j]) <= here.on[j]:
            return here, j, 1e-12 * (1 + abs(walk.value(here)))
        found = walk.zero(here, there, lambda p, j=j: float(p.margins[j]))  # type: ignore[misc]
        if found is None:
            return None
        distance = float(np.linalg.norm(found[0].u - here.u))
        if first is None or distance < first[0]:
            first = distance, (found[0], j, found[1])
    return None if first is None else first[1]


def _boundary(
    walk: Walk, point: Point, j: int, width: float, scale: float
) -> tuple[EquilibriumBifurcation, tuple[Walk, Point] | None]:
    """The boundary equilibrium at a point, and the walk and first point of the mode beside, where there is one."""
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
    kind = "boundary equilibrium" if walk.q is not None else "end of the set"
    mult = e.mult.copy()
    mult[j] = new if mu.kind == "switch" and new else 0.0 if mu.kind == "contact" else side if not kink else new
    sides = (*e.sides[:j], new, *e.sides[j + 1 :])
    beside = replace(e, mult=mult, sides=sides, message="")
    cycle = cycle_born(e, j) if walk.q is not None else None
    bifurcation = EquilibriumBifurcation(kind, walk.name, walk.value(point), width, e, None, what, cycle=cycle)
    if walk.q is None:
        return bifurcation, None
    after = Walk(beside, walk.name, scale)
    there = after.point(after.first, np.ones(len(after.first)))
    if (
        there is None
        or there.equilibrium.residual > 1e3 * ROUNDING
        or not (after.alone(there) and there.equilibrium.isolated)
    ):
        return replace(bifurcation, what=what + ", and what lies beyond is no single equilibrium"), None
    if there.slopes[j] < 0:
        there = after.point(after.first, -there.tangent)
        assert there is not None
    q, ahead = point.tangent[walk.place], there.tangent[after.place]
    out = np.sign(point.slopes[j])  # 1 where a virtual branch comes back
    if min(abs(q), abs(ahead)) > 1e-9:
        kind += ": persistence" if q * ahead * -out > 0 else ": nonsmooth fold"
    return replace(bifurcation, kind=kind, beyond=there.equilibrium), (after, there)
