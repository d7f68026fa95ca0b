"""Stable and unstable curves of equilibria: trajectories that leave along one direction, or arrive along it.

    x0 +- delta v,  v the eigenvector of an eigenvalue alone on its side (along the surface, of a pseudo-equilibrium);
    x0 +- delta f+-,  the fields of both sides, where the surface itself attracts or repels

A pseudo-equilibrium whose surface attracts is reached from both sides in finite time; what leaves it slides. Where it
repels that is so backward in time. A stable curve is run backward: it ends where the past is not unique, at points
where the motion forward comes to slide or rest.

Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for pseudo-saddles.
Chain: arms.py, equilibrium.py, paths/backward.py -> **flow_manifolds** -> manifolds.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...door import checks
from ...paths.backward import where_it_ends
from ...paths.derivatives.linearised import linearise, rates
from ...results.records import Outcome
from ...solving import solve
from ..equilibria.disc_modes import in_mode
from ..equilibria.equilibrium import Equilibrium
from .arms import Arm, Growing, Meeting, Rules, Sample, dense

_FIRST = 1e-6  # relative to the states: how far from the equilibrium an arm along a direction begins
_FIRST_ACROSS = 1e-8  # the same across a surface, along the field itself
_DOUBLINGS = 12
_FIRST_TIME = 20.0  # in times of the eigenvalue: how long it takes to leave, some log(1/_FIRST)
_TINY = 1e-9  # of the length: growth by less in twice the time is none


def arms_of_equilibrium(e: Equilibrium, stable: bool, rules: Rules) -> list[Arm]:
    """The arms of a manifold of dimension one; ValueError for another dimension."""
    n = len(e.x)
    values, layer = e.eigenvalues, e.layer_eigenvalues
    sign = -1 if stable else 1
    along = [float(mu.real) for mu in values if sign * mu.real > 0]
    across = [float(mu.real) for mu in layer if sign * mu.real > 0]
    name = "stable" if stable else "unstable"
    if len(along) + len(across) != 1 or np.any(
        np.abs(values.real) < 1e-12 * (1 + np.abs(values).max(initial=0.0))
    ):
        raise ValueError(
            f"`saddle` has a {name} manifold of dimension {len(along) + len(across)} (eigenvalues "
            f"{', '.join(f'{mu:.3g}' for mu in values)}; {len(across)} directions across its surfaces); only curves "
            "are drawn: give a saddle with one direction on that side."
        )
    if stable or across:
        checks.without_discs(e.system.model, f"the {name} curves that run backward or across a surface")
    starts: list[tuple[np.ndarray, str]] = []
    if along:
        matrix, basis = e.linear.matrix, e.linear.along
        mu, vectors = np.linalg.eig(matrix)
        v = basis @ np.real(vectors[:, int(np.argmin(np.abs(mu - along[0])))])
        v = v / np.linalg.norm(v)
        size = _FIRST * (1 + float(np.abs(e.x).max()))
        starts = [(_onto(e, e.x + side * size * v), "") for side in (1, -1)]
        rate = abs(along[0])
    else:
        starts, rate = _across(e, stable), 1.0
    assert n == len(starts[0][0])
    return [_trajectory(e, start, why, stable, rate, rules) for start, why in starts]


def _onto(e: Equilibrium, x: np.ndarray) -> np.ndarray:
    """x moved onto the surfaces that are held."""
    line = linearise(in_mode(e.system.model, e.sides))
    # What a disc in slip is solved for takes no direction away.
    J = [j for j, (mu, side) in enumerate(zip(line.model.multipliers, e.sides))
         if side == 0 and (mu.kind != "component" or mu.surface is not None)]  # fmt: skip
    p = np.array(e.system.parameter_values, float)
    for _ in range(2):
        c, by_x, _ = (part[0] for part in line.constraints(np.zeros(1), x[:, None], e.mult[:, None], p))
        if not J:
            return x
        x = x - np.linalg.pinv(by_x[J]) @ c[J]
    return x


def _across(e: Equilibrium, stable: bool) -> list[tuple[np.ndarray, str]]:
    """Starts on both sides of the one surface that is held, and why there is none."""
    model, p = e.system.model, np.array(e.system.parameter_values, float)
    (j,) = (k for k, side in enumerate(e.sides) if side == 0)
    found = []
    for side in (1.0, -1.0):
        mult = e.mult.copy()
        mult[j] = side
        f = rates(model, 0.0, e.x, mult, p)
        gradient = linearise(model).gradient(model.multipliers[j].surface, 0.0, e.x, mult, p)[0][: len(f)]
        leaves = side * (gradient @ f) * (-1 if stable else 1)
        size = _FIRST_ACROSS * (1 + float(np.abs(e.x).max())) / max(float(np.linalg.norm(f)), 1e-300)
        why = "" if leaves > 0 else f"the field on the side {side:+.0f} of the surface does not lead there."
        found.append((e.x + (-size if stable else size) * f, why))
    return found


def _trajectory(e: Equilibrium, start: np.ndarray, why: str, stable: bool, rate: float, rules: Rules) -> Arm:
    """The arm from a start near the equilibrium."""
    if why:
        return Growing(e.x, rules, _told).arm(f"there is none: {why}")
    system, ends = e.system._backward() if stable else (e.system, frozenset())
    time = _FIRST_TIME / rate
    last = -1.0
    for _ in range(_DOUBLINGS):
        run = solve(system, (0.0, time), list(map(float, start)), rtol=1e-12, atol=1e-14, dense_output=True)
        arm, length = _drawn(e, run, _unique(run, system, ends, e) if stable else None, stable, rules)
        if not arm.end.startswith("after the time"):
            return arm
        if last >= 0 and length - last <= _TINY * (1 + length):
            return Arm(arm.points, arm.arclength, arm.meetings, "it comes to rest.")
        last, time = length, 2 * time
    return arm


def _unique(run: Any, system: Any, ends: frozenset[str], e: Equilibrium) -> Any:
    """The event of a run backward behind which the past is not unique; along a repelling surface sliding is."""
    if e.held:
        # It may slide from the start, which in the mirrored run is no sign of a lost past.
        names = [m.symbol.name for m in system.model.multipliers]
        held = [names.index(name) for name in e.held]
        if np.all(run.status[held, 0] == 0):
            left = [a for a in run.events if a.switch in e.held]
            return left[0] if left else None
    return where_it_ends(run, system, ends)


def _drawn(e: Equilibrium, run: Any, last: Any, stable: bool, rules: Rules) -> tuple[Arm, float]:
    """The arm that a run gives, up to an event."""
    until = run.t[-1] if last is None else last.time
    knots = np.unique(run.t[run.t <= until])
    if knots[-1] < until:
        knots = np.append(knots, until)
    # Events have two columns at one time: pieces end before them and begin after them.
    jumps = sorted({float(a) for a, b in zip(run.t[:-1], run.t[1:]) if a == b and 0 < a < until})
    bounds = [0.0, *jumps, float(until)]
    arm = Growing(e.x, rules, _told)
    end = arm.take([Sample(run.x[:, 0])], first=True)
    for first, final in zip(bounds[:-1], bounds[1:]):
        inside = knots[(knots > first) & (knots < final)]
        # The last instant of a piece is the one before its event.
        s = np.unique([np.nextafter(first, final) if first else first, *inside, np.nextafter(final, first)])
        end = end or arm.take(_samples(run, s, rules, arm.room, first > 0), first=not first)
        if end:
            break
        for event in run.events:
            if event.time == final and event.time < until:
                arm.meetings += [_meeting(arm, event, stable)]
        if final < until:
            after = run.x[:, np.flatnonzero(run.t == final)[-1]]
            if np.linalg.norm(after - arm.now) > 1e-6 * rules.spacing:
                arm.lift(after)
    length = arm.arclength[-1]
    if not end and last is not None:
        arm.meetings.append(_meeting(arm, last, stable))
        end = f"before {last.kind} [{last.switch}] the past is not unique: the motion forward slides or rests there."
    if not end and run.outcome is not Outcome.FINISHED:
        end = run.message
    return arm.arm(end or f"after the time {run.t[-1]:g}."), length


def _samples(run: Any, s: np.ndarray, rules: Rules, room: int, whole: bool) -> list[Sample]:
    return dense(lambda time: Sample(run(time)), s, rules, room, cut=True)[1][0 if whole else 1 :]


def _meeting(arm: Growing, event: Any, stable: bool) -> Meeting:
    came, to, went = event.note.partition(" to ")
    note = f"{went}{to}{came}" if stable and to else event.note
    said = f" ({note})" if note else ""
    return Meeting(arm.arclength[-1], arm.now, f"{event.kind} [{event.switch}]{said}")


def _told(before: Any, after: Any) -> str:
    return ""
