"""Events of one instant on the event-driven path (the rule is that of kernels/firing.py), and the sides of the
switches after what jumped."""

from ..firing import counts, fire
from ..machine.compiling import kernel
from ..machine.pointers import call_act, call_fields
from ..outcome import Outcome
from ..state import (
    ACTS,
    ADD,
    AMB_UPDATES,
    CONTACT,
    DISC,
    DUE,
    EV_EVENT,
    EV_RESET,
    GO_ON,
    HELD,
    SECOND_ORDER,
    SET,
    TAPE_ACT,
    TAPE_ROUND,
    THROUGH,
    UNRECORDED,
)
from ..step.recording import put_on_tape, record_ambiguity, record_event
from ..surface.sliding import is_at_rest, surface_rounding
from .accumulation import events_accumulate
from .surface_rates import evaluate_surfaces

_MOST_INSIDE = 1e-9  # of the states and their way: what one may be moved by


@kernel
def _look(loop, t, x):
    """Overwrites level and rounding of the event surfaces at S."""
    P, S, R, W = loop
    evaluate_surfaces(P, S, W)
    for i in range(P.ne):
        W.firing.level[i] = W.h[P.m + i]
        rounding = 0.0
        for e in range(P.dh_row[P.m + i], P.dh_row[P.m + i + 1]):
            k = P.dh_col[e]
            rounding += 1e-13 * abs(W.dh[e]) * (abs(W.firing.before[k]) + abs(x[k]))
        W.firing.rounding[i] = rounding


@kernel
def _act(loop, i, t):
    P, S, R, W = loop
    acts = call_act(P.act, i, t, W.firing.before, S.mult, P.p, W.firing.after) != 0
    if acts and R.tape.shape[0] > 0:
        put_on_tape(P, S, R, TAPE_ACT, 0, i, 0, 0.0)
    return acts


@kernel
def _record(loop, i, t):
    P, S, R, W = loop
    if P.terminal[i] == UNRECORDED:
        return False
    record_event(S, R, P.m + i, EV_EVENT, -S.side[i], S.side[i])
    return P.terminal[i] != 0


@kernel
def _bring_together(loop, together):
    """What becomes of a state that one of the events that act sets, and others set or add to: as they say, or an
    ambiguity.

    What an event adds moves with the value that it is added to, what it sets does not: each is run from two values.
    """
    P, S, R, W = loop
    if R.tape.shape[0] > 0:
        put_on_tape(P, S, R, TAPE_ROUND, 0, 0, 0, 0.0)
    E = W.firing
    for i in range(P.ne):
        if E.due[i] == ACTS and P.rule[i] == SET:
            E.keeps = 1
    if together < 2 and E.keeps == 0:
        return
    for k in range(P.n):
        E.added[k] = E.was_set[k] = E.rule[k] = 0
        E.sum[k] = 0.0
    conflict, last = False, -1
    for i in range(P.ne):
        if E.due[i] != ACTS:
            continue
        last = i
        for k in range(P.n):
            E.trial[k], E.shifted[k] = 0.0, 1.0 + abs(E.before[k])
        call_act(P.act, i, S.t, E.before, S.mult, P.p, E.trial)
        call_act(P.act, i, S.t, E.before, S.mult, P.p, E.shifted)
        for k in range(P.n):
            if E.trial[k] == E.shifted[k]:
                conflict = conflict or (E.was_set[k] != 0 and E.value[k] != E.trial[k])
                E.was_set[k], E.value[k] = 1, E.trial[k]
                E.rule[k] = max(E.rule[k], P.rule[i])
            elif E.trial[k] != 0.0:
                E.added[k] = 1
                E.sum[k] += E.trial[k]
    for k in range(P.n):
        if E.kept[k] != 0 and E.was_set[k] == 0:
            E.after[k] = E.before[k]
        elif E.was_set[k] != 0 and E.added[k] != 0:
            if E.rule[k] == 0:
                conflict = True
            else:
                E.after[k] = E.value[k] + (E.sum[k] if E.rule[k] == ADD else 0.0)
        if E.was_set[k] != 0 and E.rule[k] == SET:
            E.kept[k] = 1
    if conflict:
        record_ambiguity(S, R, P.m + last, AMB_UPDATES, 0)


@kernel
def events(P, C, S, R, W):
    """The events of this instant, of surfaces and of the clock; returns as `fire`, or EVENTS_ACCUMULATE.

    Sets W.instant.jumped; keeps in W.firing.switch_level the switches' surfaces before the first update.
    """
    firing, instant = W.firing, W.instant
    m, some = P.m, False
    for i in range(P.ne):
        met = instant.hit[m + i]
        firing.due[i] = firing.left[i] = 0
        firing.met[i] = 1 if met else 0
        if met:
            S.deflate[m + i] = 1
            S.side[i] = -S.side[i]
            if counts(P.direction[i], S.side[i]):
                firing.due[i] = DUE
                some = True
    if instant.at_clock:
        while S.ticks < len(C.clock) and C.clock[S.ticks] <= S.t:
            firing.due[C.clock_event[S.ticks]] = DUE
            S.ticks += 1
            some = True
    for k in range(P.n):
        firing.arrived[k] = S.x[k]
    if not some:
        return GO_ON
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for j in range(m):
        firing.switch_level[j] = W.h[j]
    for i in range(P.ne):
        firing.level[i] = W.h[m + i]
    code = fire(
        firing, (P, S, R, W), P.n, P.ne, S.t, S.x, S.side, P.direction, _look, _act, _record, _bring_together
    )
    for k in range(P.n if firing.keeps != 0 else 0):
        firing.kept[k] = 0
    firing.keeps = 0
    instant.jumped = firing.jumped
    for i in range(P.ne):
        if firing.left[i]:
            S.deflate[m + i] = 0
        if firing.left[i] == THROUGH:
            instant.hit[m + i] = True
    if code == GO_ON and events_accumulate(P, S, R, W):
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
        if instant.hit[j] and W.h[j] == W.firing.switch_level[j]:
            continue  # the jump has not moved it: it is met, within the tolerance of the series that say so
        on = is_at_rest(P, S, j, W) if P.kind[j] == DISC else abs(W.h[j]) <= surface_rounding(P, S, j, W)
        if on:
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
            # Not beyond 0, where a power of the state itself may have its branch point.
            S.x[k] = S.x[k] + move if S.x[k] * (S.x[k] + move) >= 0.0 else 0.0
