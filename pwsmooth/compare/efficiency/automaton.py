"""Filippov's rules as a hybrid automaton for integrators that know nothing of switching.

An integrator carries one smooth mode to its first terminal event; what happens there is decided here, once for all
rivals and compiled, so that none of them pays for Python at its events:

    off a surface     side h > 0,     lam = side
    on it             1 - |lam| > 0,  lam solved from the residuals g = 0, which must be linear in it
    at h = 0          0 where both fields point to the surface, else the side to which the flow goes

It shares no code with the kernels, so that it also serves as an independent reference.
A. F. Filippov, Differential Equations with Discontinuous Righthand Sides (1988).
Chain: plain.py -> **this file** -> restarting.py, peers.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .plain import Plain, elimination

KINDS = ("", "crossing", "stick", "slip", "impact", "reset")
NOTHING, CROSSING, STICK, SLIP, IMPACT, RESET = range(6)
AGAIN = 1e-9  # a wall struck this soon after the slip from it is the double zero that every slip begins with


@dataclass(frozen=True)
class Automaton:
    """Compiled rules; `status` holds 1, -1 or 0 for every wall, `x` is changed in place.

    Attributes
    ----------
    field : (t, x, status, out)
        dx/dt in the mode.
    margins : (t, x, status, out)
        Of every wall a function that is positive in the mode and falls through zero at its end.
    strike : (k, t, x, status) -> code
        What happens at wall k.
    sides : (t, x, status)
        Writes the sides of all walls that are off zero.
    begin : (t, x, status)
        The status at a start, which the fields decide on a surface.
    """

    functions: Plain
    field: Callable[..., None]
    margins: Callable[..., None]
    strike: Callable[..., int]
    sides: Callable[..., None]
    begin: Callable[..., None]


@functools.lru_cache(maxsize=64)
def automaton(functions: Plain) -> Automaton:
    """The rules of one model, compiled."""
    from numba import njit

    n, m, nw, ne = functions.n, functions.m, functions.n_walls, len(functions.events)
    contacts, kinks = (np.array([*flags, False]) for flags in (functions.contacts, functions.kinks))
    wall_of = np.array([*(k for k, _, _ in functions.events), -1])
    direction = np.array([*(d for _, d, _ in functions.events), 0])
    rates, residuals, walls = functions.rates, functions.residuals, functions.walls
    impacts, whens, updates = functions.impacts, functions.whens, functions.updates
    slide = any(not contact and not kink for contact, kink in zip(functions.contacts, functions.kinks))
    # Without a switch that slides nobody calls it.
    gradients = functions.derivatives("gradients") if slide else residuals
    n_contacts = max(1, int(contacts.sum()))
    eliminate = elimination()

    @njit(error_model="numpy")
    def multipliers(t, x, status, lam):
        """Fixed sides, 0 of an open contact, sliding ones from their residuals."""
        slides = 0
        for j in range(m):
            lam[j] = 0.0 if contacts[j] else status[j]
            slides += status[j] == 0 and not contacts[j]
        if slides == 0:
            return
        which, g, at_zero = np.empty(slides, np.int64), np.empty(m), np.empty(m)
        k = 0
        for j in range(m):
            if status[j] == 0 and not contacts[j]:
                which[k] = j
                k += 1
        residuals(t, x, lam, at_zero)
        if slides == 1:
            j = which[0]
            lam[j] = 1.0
            residuals(t, x, lam, g)
            lam[j] = -at_zero[j] / (g[j] - at_zero[j])
            return
        matrix, right = np.empty((slides, slides)), np.empty((slides, 1))
        for column in range(slides):
            lam[which[column]] = 1.0
            residuals(t, x, lam, g)
            lam[which[column]] = 0.0
            for row in range(slides):
                matrix[row, column] = g[which[row]] - at_zero[which[row]]
            right[column, 0] = -at_zero[which[column]]
        eliminate(matrix, right)
        for k in range(slides):
            lam[which[k]] = right[k, 0]

    @njit(error_model="numpy")
    def field(t, x, status, out):
        lam = np.empty(m)
        multipliers(t, x, status, lam)
        rates(t, x, lam, out)

    @njit(error_model="numpy")
    def margins(t, x, status, out):
        lam = np.empty(m)
        multipliers(t, x, status, lam)
        walls(t, x, lam, out)
        for k in range(nw):
            out[k] = 1.0 - abs(lam[k]) if k < m and status[k] == 0 else status[k] * out[k]

    @njit(error_model="numpy")
    def decided(t, x, status, j):
        """0 where both fields point to the surface j, else the side to which the flow goes."""
        lam, g = np.empty(m), np.empty(m)
        multipliers(t, x, status, lam)
        lam[j] = 1.0
        residuals(t, x, lam, g)
        above = g[j]
        lam[j] = -1.0
        residuals(t, x, lam, g)
        below = g[j]
        if above < 0.0 < below:
            return 0
        if status[j] == 0:
            return 1 if above > 0.0 else -1
        ahead = below if status[j] > 0 else -above
        return -status[j] if ahead < 0.0 else status[j]

    @njit(error_model="numpy")
    def land(t, x, status, j):
        """Puts the state on the surface: what is left of the event's tolerance."""
        lam, level, gradient = np.ones(m), np.empty(nw), np.empty((m, n))
        multipliers(t, x, status, lam)
        gradients(t, x, lam, gradient)
        walls(t, x, lam, level)
        square = 0.0
        for i in range(n):
            square += gradient[j, i] ** 2
        if square > 0.0:
            for i in range(n):
                x[i] -= level[j] * gradient[j, i] / square

    @njit(error_model="numpy")
    def strike(k, t, x, status):
        lam = np.empty(m)
        multipliers(t, x, status, lam)
        if k < m and contacts[k]:
            after = np.empty((n_contacts, n))
            impacts(t, x, lam, after)
            row = 0
            for j in range(k):
                row += contacts[j]
            # In components: an assignment of arrays compiles the text of its error message.
            for i in range(n):
                x[i] = after[row, i]
            return IMPACT
        if k < m and status[k] == 0:
            status[k] = 1 if lam[k] > 0.0 else -1
            return SLIP
        came, code = status[k], NOTHING
        if ne:
            holds, after = np.empty(ne), np.empty((ne, n))
            level, new = np.empty(nw), np.empty(nw)
            walls(t, x, lam, level)
            whens(t, x, lam, holds)
            updates(t, x, lam, after)
            before = x.copy()
            for e in range(ne):
                if wall_of[e] == k and direction[e] * came <= 0 and holds[e] > 0.0:
                    code = RESET
                    for i in range(n):
                        if after[e, i] != before[i]:
                            x[i] = after[e, i]
            if code == RESET:
                # Walls that the reset has moved have the side on which the state is now; a wall that is crossed stays.
                multipliers(t, x, status, lam)
                walls(t, x, lam, new)
                for j in range(nw):
                    if new[j] != level[j] and new[j] != 0.0 and not (j < m and contacts[j]):
                        status[j] = 1 if new[j] > 0.0 else -1
                if new[k] != level[k]:
                    return RESET
        if k >= m or kinks[k]:
            status[k] = -came
            return code if k >= m else max(code, CROSSING)
        status[k] = decided(t, x, status, k)
        land(t, x, status, k)
        return max(code, STICK if status[k] == 0 else CROSSING)

    @njit(error_model="numpy")
    def sides(t, x, status):
        """From the surfaces; a wall on zero keeps its side, a nested one follows the switches before it."""
        lam, level = np.ones(m), np.empty(nw)
        for j in range(nw):
            for i in range(m):
                lam[i] = 0.0 if contacts[i] else status[i]
            walls(t, x, lam, level)
            if status[j] != 0 and level[j] != 0.0 and not (j < m and contacts[j]):
                status[j] = 1 if level[j] > 0.0 else -1

    @njit(error_model="numpy")
    def begin(t, x, status):
        for k in range(nw):
            status[k] = 1
        sides(t, x, status)
        lam, level = np.ones(m), np.empty(nw)
        walls(t, x, lam, level)
        for j in range(m):
            if level[j] == 0.0 and not contacts[j] and not kinks[j]:
                status[j] = 0
                status[j] = decided(t, x, status, j)

    return Automaton(functions, field, margins, strike, sides, begin)


@dataclass
class Strike:
    """Where an integrator stopped: time, state, wall (None at the end of the span), evaluations spent."""

    t: float
    x: np.ndarray
    wall: int | None
    evaluations: int


def follow(
    rules: Automaton,
    advance: Callable[..., Strike],
    t_span: tuple[float, float],
    x0: np.ndarray,
    *,
    most: int = 100_000,
    most_evaluations: int = 10_000_000,
) -> tuple[np.ndarray, list[tuple[float, str]], int]:
    """The whole motion, mode after mode: (state at the end, events as (time, kind), evaluations).

    `advance(t, end, x, status, watched)` gives the Strike at the first margin that falls through zero; `watched` are
    the walls that matter in this mode. RuntimeError after more than `most` events or `most_evaluations`.
    """
    functions = rules.functions
    # A whole number would compile the rules anew.
    t, end = map(float, t_span)
    x = np.array(x0, float)
    status = np.ones(functions.n_walls, np.int64)
    rules.begin(t, x, status)
    log: list[tuple[float, str]] = []
    slipped: dict[int, float] = {}
    evaluations = 0
    watched = watch(functions, status)
    for _ in range(most):
        stop = advance(t, end, x, status, watched)
        evaluations += stop.evaluations
        t, x = stop.t, stop.x
        if stop.wall is None:
            return x, log, evaluations
        if evaluations > most_evaluations:
            raise RuntimeError(f"more than {most_evaluations} evaluations")
        k = stop.wall
        if k in slipped and t - slipped[k] < AGAIN * (1 + abs(t)):
            continue
        code = rules.strike(k, t, x, status)
        if code == SLIP:
            slipped[k] = t
        log.append((t, KINDS[code]))
        now = watch(functions, status)
        if set(now) - set(watched):
            # Walls that come into play have a side of their own; the others must keep theirs.
            standing = [j for j in range(functions.n_walls) if j in watched or status[j] == 0]
            fresh = status.copy()
            rules.sides(t, x, fresh)
            fresh[standing] = status[standing]
            status[:] = fresh
            now = watch(functions, status)
        watched = now
    raise RuntimeError(f"more than {most} events")


def watch(functions: Plain, status: Any) -> tuple[int, ...]:
    """Walls that matter in a mode: of switches on which the rates depend, and of events."""
    matters = functions.matters(tuple(status[: functions.m].tolist()))
    events = {k for k, _, _ in functions.events}
    return tuple(
        k for k in range(functions.n_walls)
        if k in events or (k < functions.m and (matters[k] or status[k] == 0 or functions.contacts[k]))
    )  # fmt: skip
