"""Events of one instant, and the sides of the switches after what jumped.

All events whose `when` holds fire from the values before, repeated until none newly fires.
"""

from ..machine.compiling import kernel
from ..machine.pointers import call_act, call_fields
from ..outcome import Outcome
from ..state import (
    AMB_UPDATES,
    CONTACT,
    EV_EVENT,
    EV_RESET,
    GO_ON,
    HELD,
    MOST_AT_ONCE,
    SECOND_ORDER,
)
from ..step.recording import record_ambiguity, record_event
from ..surface.sliding import surface_rounding
from .accumulation import events_accumulate
from .surface_rates import evaluate_surfaces

_MOST_INSIDE = 1e-9  # of the states and their way: what one may be moved by


@kernel
def _meet_event(P, S, W, i):
    """Event surface i has been met: flips its side and marks the event as pending if the direction fits."""
    S.side[i] = -S.side[i]
    if P.direction[i] == 0 or P.direction[i] == S.side[i]:
        W.firing.pending[i] = 1


@kernel
def _note_conflicts(P, S, R, W, size):
    """Records an ambiguity where one of the events together[:size] sets a state that another sets or adds to otherwise.

    What an event adds moves with the value that it is added to, what it sets does not: each is run from two values.
    """
    firing = W.firing
    added, was_set, value, trial, shifted = (
        firing.added,
        firing.was_set,
        firing.value,
        firing.trial,
        firing.shifted,
    )
    for k in range(P.n):
        added[k] = was_set[k] = 0
    conflict = -1
    for a in range(size):
        i = firing.together[a]
        for k in range(P.n):
            trial[k] = firing.before[k]
            shifted[k] = firing.before[k] + 1.0 + abs(firing.before[k])
        call_act(P.act, i, S.t, firing.before, S.mult, P.p, trial)
        call_act(P.act, i, S.t, firing.before, S.mult, P.p, shifted)
        for k in range(P.n):
            if trial[k] == shifted[k]:
                if added[k] or (was_set[k] and value[k] != trial[k]):
                    conflict = i
                was_set[k] = 1
                value[k] = trial[k]
            elif trial[k] != firing.before[k]:
                if was_set[k]:
                    conflict = i
                added[k] = 1
    if conflict >= 0:
        record_ambiguity(S, R, P.m + conflict, AMB_UPDATES, 0)


@kernel
def _fire_events(P, C, S, R, W):
    """Fires the pending events until none newly does; returns GO_ON, TERMINATED or CHATTERING; sets W.instant.jumped.

    Keeps in W.firing.level the event surfaces before each update, and the switches' before the first.
    """
    instant = W.instant
    firing = W.firing
    m, n, ne = P.m, P.n, P.ne
    code = GO_ON
    fired = 0
    while fired <= ne + MOST_AT_ONCE - 1:
        newly, together = False, 0
        for k in range(n):
            firing.before[k] = S.x[k]
            firing.after[k] = S.x[k]
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(m if fired > 0 else 0, m + ne):
            firing.level[i] = W.h[i]
        for i in range(ne):
            if (
                firing.pending[i] == 1
                and call_act(P.act, i, S.t, firing.before, S.mult, P.p, firing.after) != 0
            ):
                firing.pending[i] = 2
                newly = True
                fired += 1
                together += 1
                firing.together[together - 1] = i
                record_event(S, R, m + i, EV_EVENT, -S.side[i], S.side[i])
                if P.terminal[i]:
                    code = Outcome.TERMINATED
        if not newly:
            return code
        if together > 1:
            _note_conflicts(P, S, R, W, together)
        for k in range(n):
            if firing.after[k] != S.x[k]:
                instant.jumped = 1
                S.x[k] = firing.after[k]
        evaluate_surfaces(P, S, W)
        for i in range(ne):
            if P.watch[i] != 0 or P.rows_slip[m + i] < 0 or W.h[m + i] == firing.level[m + i]:
                continue
            rounding = 0.0
            for e in range(P.dh_row[m + i], P.dh_row[m + i + 1]):
                k = P.dh_col[e]
                rounding += 1e-13 * abs(W.dh[e]) * (abs(firing.before[k]) + abs(S.x[k]))
            if abs(W.h[m + i]) <= rounding:
                continue
            S.deflate[m + i] = 0  # the update has left the surface, to whichever side
            if W.h[m + i] * S.side[i] >= 0.0:
                continue
            acted = False
            for a in range(together):
                acted = acted or firing.together[a] == i
            if acted or (instant.hit[m + i] and abs(firing.level[m + i]) <= rounding):
                # Put back, from the surface that it had just reached or to where another update had carried it: it will
                # be met again from there. An update fires no event that acts with it: one that only records at the
                # surface of another would make that act twice.
                S.side[i] = -S.side[i]
            else:
                # An event surface that the update has jumped through is met as well.
                instant.hit[m + i] = True
                _meet_event(P, S, W, i)
    return Outcome.CHATTERING


@kernel
def events(P, C, S, R, W):
    """The events of this instant, of surfaces and of the clock; returns as _fire_events, or EVENTS_ACCUMULATE."""
    firing = W.firing
    some = False
    for i in range(P.ne):
        firing.pending[i] = 0
        if W.instant.hit[P.m + i]:
            S.deflate[P.m + i] = 1
            _meet_event(P, S, W, i)
            some = some or firing.pending[i] == 1
    if W.instant.at_clock:
        while S.ticks < len(C.clock) and C.clock[S.ticks] <= S.t:
            firing.pending[C.clock_event[S.ticks]] = 1
            S.ticks += 1
            some = True
    for k in range(P.n):
        firing.arrived[k] = S.x[k]
    code = _fire_events(P, C, S, R, W) if some else GO_ON
    if code == GO_ON and some and events_accumulate(P, S, R, W):
        return Outcome.EVENTS_ACCUMULATE
    return code


@kernel
def sides_after_crossing(P, S, R, W):
    """A surface in which another multiplier stands has jumped with it: its switch takes the side it finds itself on."""
    for _ in range(P.m):
        evaluate_surfaces(P, S, W)
        changed = False
        for j in range(P.m):
            if P.nested[j] == 0 or W.instant.hit[j]:
                continue
            if abs(W.h[j]) <= surface_rounding(P, S, j, W):
                continue
            S.deflate[j] = 0
            side = 1 if W.h[j] > 0.0 else -1
            if S.status[j] != side:
                record_event(S, R, j, EV_RESET, S.status[j], side)
                S.status[j] = side
                S.mult[j] = float(side)
                changed = True
        if not changed:
            return


@kernel
def sides_after_jump(P, S, R, W):
    """After x has jumped: switches off their surfaces take their sides; those on them stay or become hit."""
    instant = W.instant
    evaluate_surfaces(P, S, W)
    for j in range(P.m):
        if P.kind[j] >= CONTACT:
            continue
        if instant.hit[j] and W.h[j] == W.firing.level[j]:
            continue  # the jump has not moved it: it is met, within the tolerance of the series that say so
        if abs(W.h[j]) <= surface_rounding(P, S, j, W):
            if S.status[j] == HELD and P.kind[j] != SECOND_ORDER:
                continue
            if not instant.hit[j]:
                S.last[j, 2] = 0.0  # what puts it there comes back to its surface, not the motion
            instant.hit[j] = True  # still, or now, on its surface
            continue
        instant.hit[j] = False
        S.deflate[j] = 0
        side = 1 if W.h[j] > 0.0 else -1
        if S.status[j] != side:
            S.last[j, 2] = 0.0
            record_event(S, R, j, EV_RESET, S.status[j], side)
            S.status[j] = side
            S.mult[j] = float(side)


@kernel
def step_inside(P, S, j, W):
    """Moves S.x by roundings onto the side S.status[j] of h_j: a power may have its branch point on h_j = 0.

    A located zero of a curved surface is one to rounding, of either sign, and delta^1.5 does not exist on the other.
    """
    if P.surface_state[j] >= 0:
        return
    evaluate_surfaces(P, S, W)
    best, most, total, way = -1, 0.0, 0.0, 0.0
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        part = abs(W.dh[e] * S.x[P.dh_col[e]])
        total += part
        way += abs(S.x[P.dh_col[e]]) + (abs(S.t) + S.step) * abs(W.dx[P.dh_col[e]])
        if part > most:
            best, most = e, part
    side = float(S.status[j])
    if best >= 0 and side * W.h[j] < 4e-16 * total:
        k = P.dh_col[best]
        move = (side * 8e-16 * total - W.h[j]) / W.dh[best]
        # Where time alone carries the surface, as x sin t at t = pi, no state is moved for it.
        if abs(move) <= _MOST_INSIDE * way:
            S.x[k] += move
