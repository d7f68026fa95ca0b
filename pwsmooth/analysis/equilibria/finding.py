"""Equilibria of a piecewise-smooth system: all in a box of states, or the one nearest to a start.

    f(x, lam) = 0,   h_j(x, lam) = 0 for what is held,   lam_j = 1 or -1, R_j = 0 for what is not

In every mode Newton's method solves the equations in the states and in the multipliers that are free (statics.py). As
f vanishes, dh/dt does so by itself: g(lam) = 0 needs no equation of its own, and several lam on one surface are
several solutions.

Chain: equilibrium_modes.py -> **equilibria** -> equilibrium_branches.py.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...door import checks
from ..maps.scales import units_at
from .equilibrium import Equilibrium, made
from .modes import SAME, autonomous, beside_exact, fits, modes, same, set_ending_at, without_idle
from .statics import MOST_NEWTON, RANK, ROUNDING, Sides, Statics, beyond, free_directions, newton

__all__ = ["equilibria", "find_equilibrium"]

_MOST_MODES = 4096
_BATCH = 256  # starts of Newton's method at once
_JUST_BEYOND = 1e-3  # of a multiplier beyond its bound
_MOST_BATCHES = 8  # of a mode that goes on giving new solutions


@checks.door(
    system=checks.system, box=checks.mapping, sides=checks.optional(checks.mapping), virtual=checks.flag,
    starts=checks.integer(1, 10**7),
)  # fmt: skip
def equilibria(
    system: Any, box: Mapping[Any, Any], *, sides: Any = None, virtual: bool = False, starts: int = 256
) -> list[Equilibrium]:
    """The equilibria in a box of states: regular ones, pseudo-equilibria and rests on contacts, of every mode.

    Parameters
    ----------
    box : mapping of state to (float, float)
        The lowest and the highest value of every state, in its unit.
    virtual : bool
        Whether virtual ones are given too: of a field beyond its surface, of lambda beyond [-1, 1], of a reaction < 0.
    starts : int
        Starts of Newton's method in each mode, which are spread evenly; doubled while they give new solutions.

    Returns
    -------
    list of Equilibrium
        Admissible ones first. Of a set of equilibria (a sticking block's) one member a mode and a kind of stability.

    Raises
    ------
    ValueError, TypeError
        A system that depends on time; a box that lacks a state; more than 4096 combinations of sides.

    Notes
    -----
    Where the equations of a mode are linear, the one solution is found for certain; else all to which a start leads.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the kinds; Jeffrey,
    On the mathematical basis of solid friction, for several lambda on one surface.

    Static friction as a hidden term holds a block under a force in three ways, one of which repels:

    >>> v = sp.Symbol("v", real=True)
    >>> lam = Switch("lam", v)
    >>> pulled = System({v: 1.2 - lam * (1 + 3 * (1 - lam**2))})
    >>> [(round(e.multipliers["lam"], 6), e.stability) for e in equilibria(pulled, {v: (-1, 1)})]
    [(0.32598, 'stable'), (0.956669, 'unstable')]
    """
    system = autonomous(system, "`system`")
    model = system.model
    own = model.states[: len(model.states) - model.n_memory]
    bounds = {}
    names = [(str(getattr(checks.named(key), "name", key)), key, pair) for key, pair in box.items()]
    groups = system.groups  # of a family: one pair for all of its elements
    for each, pair in ((each, pair) for name, key, pair in names for each in groups.get(name, (key,))):
        s = checks.lookup(each, own, "`box`", "state")
        low, high = bounds[s] = checks.pair(pair, f"`box` of {s}")
        if not low < high:
            raise ValueError(f"`box` of {s} is ({low:g}, {high:g}); give the lowest first.")
    if missing := [s for s in own if s not in bounds]:
        raise ValueError(
            f"`box` has no bounds for {checks.listing(missing)}; give (lowest, highest) of every state."
        )
    low, high = np.array([bounds[s] for s in own]).reshape(-1, 2).T
    unit = high - low
    memories = np.array([float(system.initial_memory[m]) for m in system.initial_memory])
    found: list[Equilibrium] = []
    options = modes(system, sides)
    if (count := math.prod(map(len, options))) > _MOST_MODES:
        raise ValueError(
            f"`system` has {count} combinations of sides, more than {_MOST_MODES}; give the side of some switches in "
            "`sides`."
        )
    seeds = beside_exact(system, lambda exact: equilibria(
        exact, {s: pair for s, pair in bounds.items() if s in exact.states}, starts=starts))  # fmt: skip
    for mode in itertools.product(*options):
        for e in _of_mode(Statics(system, mode, memories, unit=unit), low, high, starts, virtual, seeds):
            if not any(same(one, e, unit) for one in found):
                found.append(e)
    found = without_idle(found)
    found = [e for e in found if set_ending_at(e, found) is None]
    return sorted(found, key=lambda e: (bool(e.virtual), e.held != (), *e.x, *e.mult))


def _of_mode(
    statics: Statics, low: np.ndarray, high: np.ndarray, starts: int, virtual: bool, seeds: np.ndarray
) -> list[Equilibrium]:
    """All solutions of a mode inside the box to which starts lead."""
    from scipy.stats import qmc

    system, n = statics.system, statics.n
    slack = 1e-9 * (high - low)
    points = qmc.Halton(statics.size, scramble=False)
    points.fast_forward(1)  # the first one is a corner
    found: list[Equilibrium] = []
    count = min(starts, _BATCH)
    taken = 0
    while taken < max(starts, 1) * _MOST_BATCHES:
        u = _spread(points.random(count), statics, low, high, virtual)
        if taken == 0 and _one_solution(statics, u):
            u = u[:1]
        if taken == 0 and len(seeds):
            u = np.concatenate([seeds, u])
        taken += count
        u, errors, steps = newton(statics, u)
        new = False
        near = 0.1 * SAME * (statics.unit + np.abs(u))
        looked: list[int] = []
        for k in np.flatnonzero(np.isfinite(errors)):
            x = u[k, :n]
            if np.any((x < low - slack) | (x > high + slack)):
                continue
            if np.any(np.all(np.abs(u[looked] - u[k]) <= near[k], axis=1)):
                continue  # most starts lead to a point that is there already
            looked.append(k)
            e = made(statics, u[k], errors[k], steps[k], system)
            if not fits(system, e.x) or (e.virtual and not virtual):
                continue
            if any(same(one, e, statics.unit[:n]) or _one_set(one, e) for one in found):
                continue
            found.append(e)
            new = True
        if len(u) == 1 or (taken >= starts and not new):
            break
    return found


def _one_set(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether two are taken for members of one set of equilibria."""
    if one.isolated or other.isolated or one.sides != other.sides:
        return False
    return bool(one.virtual) == bool(other.virtual) and one.stability == other.stability


def _spread(points: np.ndarray, statics: Statics, low: np.ndarray, high: np.ndarray, wide: bool) -> np.ndarray:
    """Points of the unit cube over the box; multipliers of switches over [-1, 1], others over a long-tailed line."""
    u = points.copy()
    n = statics.n
    u[:, :n] = low + (high - low) * points[:, :n]
    for k, j in enumerate(statics.J, n):
        centred = 2 * points[:, k] - 1
        tail = np.tan(0.499 * math.pi * centred)
        if statics.system.model.multipliers[j].kind not in ("switch", "component"):
            u[:, k] = tail
        else:
            u[:, k] = centred
            if wide:  # every second one beyond
                u[1::2, k] = 2 * tail[1::2]
    return statics.along_slip(u, (np.arange(len(u)) % 2 == 1) & wide)


def _one_solution(statics: Statics, u: np.ndarray) -> bool:
    """Whether the equations are linear, as the same derivatives at all these points say, and not singular."""
    DF = statics(u)[1]
    if not np.isfinite(DF).all():
        return False
    if not np.all(np.abs(DF - DF[0]) <= 1e-13 * np.abs(DF[0]).max(initial=0.0)):
        return False
    return free_directions(DF[0] * statics.unit).shape[0] == 0


@checks.door(system=checks.system, sides=checks.optional(checks.mapping), virtual=checks.flag)
def find_equilibrium(system: Any, x0: Any, *, sides: Any = None, virtual: bool = False) -> Equilibrium:
    """Find an equilibrium near a start, in whatever mode it lies.

    Parameters
    ----------
    x0 : mapping or sequence of float, length n
        First guess, in the units of the states; a mapping may name multipliers too, to choose between several lambda.
    virtual : bool
        Whether a virtual one will do where no admissible one is found.

    Returns
    -------
    Equilibrium
        The admissible one nearest to the guess; `success` False and a `message` where there is none.

    Raises
    ------
    ValueError, TypeError
        A system that depends on time; bad input.

    Notes
    -----
    Newton's method in every mode; of more than 4096 in that of the start, and from there, while what it finds is
    virtual, in the mode to which that points. Of several multipliers at one state the nearest to the guess of it is
    taken, and without one what is stable.

    Source: Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, for pseudo-equilibria.

    A ball on a floor, which carries it:

    >>> y, v = sp.symbols("y v", real=True)
    >>> floor = Unilateral(y, restitution=0.5, name="R")
    >>> rest = find_equilibrium(System({y: v, v: -9.81 + floor.reaction}), {y: 1, v: 0})
    >>> rest.kind, rest.multipliers
    ('rest on a contact', {'R': 9.81})
    """
    system = autonomous(system, "`system`")
    model = system.model
    guesses = {}
    if isinstance(x0, Mapping):
        names = {str(mu.symbol): j for j, mu in enumerate(model.multipliers)}
        key = {k: str(getattr(checks.named(k), "name", k)) for k in x0}
        guesses = {
            names[key[k]]: checks.number(value, f"`x0`, value of {k}")
            for k, value in x0.items()
            if key[k] in names
        }
        x0 = {k: value for k, value in x0.items() if key[k] not in names}
    start = np.array(system.initial_state(x0), float)
    n = len(start) - model.n_memory
    unit = units_at(start[:n])
    found: list[tuple[float, float, Equilibrium]] = []
    named = {str(s): value for s, value in zip(model.states, start)}
    seeds = beside_exact(system, lambda exact: filter(lambda e: e.success, [
        find_equilibrium(exact, {s: named[str(s)] for s in exact.states if str(s) in named})]))  # fmt: skip

    def tried(mode: Sides) -> list[Equilibrium]:
        statics = Statics(system, mode, start[n:], unit=unit)
        first = _from(start[:n], statics, guesses)
        if len(seeds):
            first = np.concatenate([seeds, first])
        u, errors, steps = newton(statics, first)
        distances = np.linalg.norm((u[:, :n] - start[:n]) / (unit + np.abs(start[:n])), axis=1).round(8)
        these: list[Equilibrium] = []
        for k in sorted(np.flatnonzero(np.isfinite(errors)), key=lambda k: distances[k]):
            far = float(distances[k])
            if these and far > min((far for far, _, e in found if e.admissible), default=math.inf):
                break  # another one is nearer; of a set there are many
            e = made(statics, u[k], errors[k], steps[k], system)
            these.append(e)
            # At its end a set has a point in common with another mode, which need not know that there is a set.
            alike = (other for *_, other in found if e.isolated or e.sides == other.sides)
            if fits(system, e.x) and not any(same(e, other, unit) for other in alike):
                off = max((abs(e.mult[j] - guess) for j, guess in guesses.items()), default=0.0)
                found.append((far, off, e))
        return these

    options = modes(system, sides)
    if math.prod(map(len, options)) <= _MOST_MODES:
        for mode in itertools.product(*options):
            tried(mode)
    else:
        _pivoted(system, start, options, tried)
    every = without_idle([e for *_, e in found])
    found = [one for one in found if any(one[-1] is e for e in every)]
    found = [(far, off, set_ending_at(e, every) or e) for far, off, e in found]
    order = sorted(found, key=lambda one: (one[0], one[1], not one[2].stable, np.abs(one[2].mult).sum()))
    admissible = [e for *_, e in order if e.admissible]
    if admissible:
        return admissible[0]
    if order and virtual:
        return order[0][-1]
    nothing = "Newton's method converged in no mode: give a nearer guess, or a box of them to equilibria()."
    why = f"the nearest is virtual, {order[0][-1].virtual}; `virtual=True` gives it." if order else nothing
    lost = np.full(len(model.multipliers), np.nan)
    return Equilibrium(system, start, lost, (0,) * len(lost), math.inf, 0, False, why)


def _pivoted(system: Any, start: np.ndarray, options: list[tuple[int, ...]], tried: Any) -> None:
    """Of many modes, that of the start, and from each solution that is virtual the mode in which it would not be."""
    model = system.model
    n, m = len(model.states) - model.n_memory, len(model.multipliers)
    statics = Statics(system, (1,) * m, start[n:])
    h, on, _ = statics.margins(statics.along_slip(np.append(start[:n], np.zeros(len(statics.J)))[None])[0])
    mode = [0 if abs(h_j) <= size else int(np.sign(h_j)) for h_j, size in zip(h, on)]
    seen: set[Sides] = set()
    while True:
        mode = [side if side in allowed else allowed[0] for side, allowed in zip(mode, options)]
        if tuple(mode) in seen:
            return
        seen.add(tuple(mode))
        these = tried(tuple(mode))
        if not these or any(e.admissible for e in these):
            return
        e = these[0]
        statics = Statics(system, e.sides, start[n:])
        inside = statics.margins(statics.unknowns(e.x, e.mult))[0]
        for j in np.flatnonzero(inside < 0):
            mode[j] = beyond(model.multipliers[j], mode[j], e.mult[j])


def _from(x: np.ndarray, statics: Statics, guesses: Mapping[int, float]) -> np.ndarray:
    """Starts at one state: with several values of what is held, where none is given."""
    multipliers = statics.system.model.multipliers
    values: list[tuple[float, ...]] = []
    for j in statics.J:
        if j in guesses:
            values.append((guesses[j],))
        elif multipliers[j].kind in ("switch", "component"):
            values.append((0.0, 0.5, -0.5, 0.9, -0.9, 0.25, -0.25, 1.0, -1.0)[: 9 if len(statics.J) < 3 else 3])
        else:
            values.append((0.0, 1.0) if len(statics.J) < 3 else (0.3,))
    rows = list(itertools.islice(itertools.product(*values), 512))
    free = np.array(rows, float).reshape(len(rows), len(statics.J))
    u = statics.along_slip(np.column_stack([np.tile(x, (len(free), 1)), free]))
    if not statics.J:
        return u
    # A start within a set of equilibria, of a block that sticks there, stays: the multipliers alone are solved for.
    still = _partly(statics, u, slice(statics.n, None))
    if still is None:
        return u
    # One just beyond its end, with a multiplier beyond its bound, is moved there: the states alone are solved for.
    bounded = statics.bounded(still)
    past = np.abs(bounded - still).max(axis=1)
    ends = _partly(statics, bounded[(past > 0) & (past < _JUST_BEYOND)], slice(statics.n))
    return np.concatenate([still, u] if ends is None else [still, ends, u])


def _partly(statics: Statics, u: np.ndarray, part: slice) -> np.ndarray | None:
    """The rows of u after Newton's method in a part of the unknowns; None where the equations are not defined."""
    u = u.copy()
    for _ in range(MOST_NEWTON):
        F, DF = statics(u)
        if not (np.isfinite(F).all() and np.isfinite(DF).all()):
            return None
        step = (np.linalg.pinv(DF[:, :, part], rcond=RANK) @ F[:, :, None])[:, :, 0]
        u[:, part] -= step
        if np.all(np.abs(step) <= ROUNDING * (1 + np.abs(u[:, part]))):
            break
    return u
