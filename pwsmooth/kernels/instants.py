"""What happens at one instant: events, impacts, then the switches with the field after.

Order (the contract of Event): all events whose `when` holds fire from the values before, repeated until none newly
fires; then impacts; then every switch that is on its surface is settled by its layer, and every sliding switch whose
field has jumped is settled again.
"""

from numba import types

from .accumulation import pass_accumulation
from .compiling import kernel, unit
from .layer import LEAVE_FOLD, SETTLED
from .pointers import call_act, call_fields, call_layer_unit
from .records import record_ambiguity, record_event, record_point
from .settling import (
    approach_speed,
    close_contact,
    evaluate_surfaces,
    layer_code,
    leading_order,
    note_interval,
    resettle,
    settle_arrivals,
    settle_at_rest,
)
from .sliding import keep_on_surface, surface_rounding
from .sparse import couples
from .state import (
    AMB_CORNER,
    C_AMBIGUITIES,
    C_CLOCK,
    C_EVENTS,
    C_LAYERS,
    C_STALLED,
    CHATTERING,
    CONTACT,
    DONE,
    EV_CLOSED,
    EV_CROSSING,
    EV_EVENT,
    EV_FOLD,
    EV_FOLD_TO_SLIDING,
    EV_IMPACT,
    EV_OPENING,
    EV_RESET,
    EV_STICK,
    EV_TANGENCY,
    HELD,
    SLIDING,
    SOLVED,
    STRICT,
    TERMINAL,
    Control,
    Problem,
    Record,
    State,
    Work,
)

_AT_ONCE = 1e-13  # instants closer than this (relative) are one instant
_MOST_AT_ONCE = 60  # events without progress in time before the run says that they do not converge


@kernel
def _meet_event(P, S, W, i):
    """Event surface i has been met: flips its side and marks the event as pending if the direction fits."""
    S.side[i] = -S.side[i]
    if P.direction[i] == 0 or P.direction[i] == S.side[i]:
        W.pending[i] = 1


@kernel
def _fire_events(P, C, S, R, W):
    """Fires the pending events until none newly does; returns DONE, TERMINAL or CHATTERING, x changed in W.code[5].

    Keeps in W.tau the event surfaces before each update.
    """
    m, n, ne = P.m, P.n, P.ne
    code = DONE
    fired = 0
    while fired <= ne + _MOST_AT_ONCE - 1:
        newly = False
        for k in range(n):
            W.before[k] = S.x[k]
            W.after[k] = S.x[k]
        call_fields(P.fields, S.now[0], S.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(m, m + ne):
            W.tau[i] = W.h[i]
        for i in range(ne):
            if W.pending[i] == 1 and call_act(P.act, i, S.now[0], W.before, S.mult, P.p, W.after) != 0:
                W.pending[i] = 2
                newly = True
                fired += 1
                record_event(S, R, m + i, EV_EVENT, -S.side[i], S.side[i])
                if P.terminal[i]:
                    code = TERMINAL
        if not newly:
            return code
        for k in range(n):
            if W.after[k] != S.x[k]:
                W.code[5] = 1
                S.x[k] = W.after[k]
        evaluate_surfaces(P, S, W)
        for i in range(ne):
            if P.rows_slip[m + i] < 0 or W.h[m + i] == W.tau[m + i] or W.h[m + i] * S.side[i] >= 0.0:
                continue
            rounding = 0.0
            for e in range(P.dh_row[m + i], P.dh_row[m + i + 1]):
                k = P.dh_col[e]
                rounding += 1e-13 * abs(W.dh[e]) * (abs(W.before[k]) + abs(S.x[k]))
            if abs(W.h[m + i]) <= rounding:
                continue
            S.deflate[m + i] = 0
            if W.hit[m + i] and abs(W.tau[m + i]) <= rounding:
                # Put back from the surface that it had just reached: it will be met again from there.
                S.side[i] = -S.side[i]
            else:
                # An event surface that the update has jumped through is met as well.
                W.hit[m + i] = True
                _meet_event(P, S, W, i)
    return CHATTERING


@kernel
def _events(P, C, S, R, W):
    """The events of this instant, from their surfaces and from the clock; returns as _fire_events."""
    some = False
    for i in range(P.ne):
        W.pending[i] = 0
        if W.hit[P.m + i]:
            S.deflate[P.m + i] = 1
            _meet_event(P, S, W, i)
            some = some or W.pending[i] == 1
    if W.code[4]:
        while S.counts[C_CLOCK] < len(C.clock) and C.clock[S.counts[C_CLOCK]] <= S.now[0]:
            W.pending[C.clock_event[S.counts[C_CLOCK]]] = 1
            S.counts[C_CLOCK] += 1
            some = True
    return _fire_events(P, C, S, R, W) if some else DONE


@kernel
def _contacts(P, S, R, W):
    """Newton impacts and openings. True when it converged; x changed in W.code[5]."""
    for sweep in range(_MOST_AT_ONCE):
        newly = False
        for j in range(P.m):
            if P.kind[j] != CONTACT:
                continue
            if S.status[j] == SOLVED:
                if W.hit[j] and sweep == 0 and S.mult[j] <= 1e-12:
                    S.status[j] = 1
                    S.mult[j] = 0.0
                    S.deflate[j] = 3
                    W.hit[j] = False
                    record_event(S, R, j, EV_OPENING, 0, 1)
                continue
            evaluate_surfaces(P, S, W)
            if not (W.hit[j] or W.h[j] <= -surface_rounding(P, S, j, W)):
                continue
            speed = approach_speed(P, S, j, W)
            if speed < -W.answer[3]:
                for i in range(P.n):
                    W.after[i] = S.x[i]
                call_act(P.act, P.ne + j, S.now[0], S.x, S.mult, P.p, W.after)
                for i in range(P.n):
                    S.x[i] = W.after[i]
                keep_on_surface(P, S, j, W)
                W.code[5] = 1
                newly = True
                S.deflate[j] = 1
                W.hit[j] = True
                if sweep == 0:
                    note_interval(S, j)
                record_event(S, R, j, EV_IMPACT, 1, 1)
                speed = approach_speed(P, S, j, W)
            if abs(speed) <= W.answer[3] and W.hit[j] and close_contact(P, S, j, W):
                record_event(S, R, j, EV_CLOSED, 1, 0)
        if not newly:
            return True
    return False


@kernel
def _sides_after_jump(P, S, R, W):
    """After x has jumped: switches off their surfaces take their sides; those on them stay or become hit."""
    evaluate_surfaces(P, S, W)
    for j in range(P.m):
        if P.kind[j] >= CONTACT or S.status[j] == HELD:
            continue
        if abs(W.h[j]) <= surface_rounding(P, S, j, W):
            W.hit[j] = True  # still, or now, on its surface
            continue
        W.hit[j] = False
        side = 1 if W.h[j] > 0.0 else -1
        if S.status[j] != side:
            record_event(S, R, j, EV_RESET, S.status[j], side)
            S.status[j] = side
            S.mult[j] = float(side)
            S.deflate[j] = 0


@kernel
def _step_inside(P, S, j, W):
    """Moves S.x by roundings onto the side S.status[j] of h_j: a power may have its branch point on h_j = 0.

    A located zero of a curved surface is one to rounding, of either sign, and delta^1.5 does not exist on the other.
    """
    if P.surface_state[j] >= 0:
        return
    evaluate_surfaces(P, S, W)
    best, most, total = -1, 0.0, 0.0
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        part = abs(W.dh[e] * S.x[P.dh_col[e]])
        total += part
        if part > most:
            best, most = e, part
    side = float(S.status[j])
    if best >= 0 and side * W.h[j] < 4e-16 * total:
        S.x[P.dh_col[best]] += (side * 8e-16 * total - W.h[j]) / W.dh[best]


@kernel
def _arrivals(P, C, S, R, W, size, jumped):
    """Settles the switches W.active[:size] that met their surfaces: one by one where uncoupled, else in one layer."""
    m = P.m
    joint = size
    for b in range(m):
        if P.kind[b] != SLIDING:
            continue
        arriving = False
        linked = False
        for a in range(size):
            j = W.active[a]
            arriving = arriving or j == b
            linked = linked or (j != b and (couples(P, j, b) or couples(P, b, j)))
        if linked and S.status[b] == SOLVED and not arriving:
            W.active[joint] = b
            joint += 1
        elif linked and arriving and size > 1:
            joint = max(joint, size)
            W.code[6] = 1
    code = DONE
    if joint > size or W.code[6]:
        for a in range(joint):
            j = W.active[a]
            W.group[a] = j
            W.arrival[a] = 0 if S.status[j] == SOLVED or jumped else S.status[j]
            if jumped and S.status[j] != SOLVED:
                S.mult[j] = 0.0
        code = settle_arrivals(P, S, R, W, joint)
        if code == DONE and size > 1 and not jumped:
            _try_other_ratio(P, S, R, W, size)
    elif jumped:
        code = settle_at_rest(P, C, S, R, W, size)
    else:
        for a in range(size):
            W.group[0] = W.active[a]
            W.arrival[0] = S.status[W.active[a]]
            code = max(code, settle_arrivals(P, S, R, W, 1))
    if code != DONE:
        return code
    for a in range(joint):
        j = W.active[a]
        came = W.came[j]
        S.deflate[j] = 1
        if S.status[j] == SOLVED and came != SOLVED:
            record_event(S, R, j, EV_STICK, came, 0)
            keep_on_surface(P, S, j, W)
        elif S.status[j] != came:
            record_event(S, R, j, EV_CROSSING if came != SOLVED else EV_RESET, came, S.status[j])
        if came != SOLVED:
            note_interval(S, j)
    return DONE


@kernel
def _try_other_ratio(P, S, R, W, size):
    """Runs the corner's layer again with eps_1/eps_2 changed by 10 and 1/10; another outcome is an ambiguity."""
    m, first = P.m, W.active[0]
    for j in range(m):
        W.keep_status[j] = S.status[j]
        W.keep_mult[j] = S.mult[j]
    weight = P.weight[first]
    same = True
    for factor in (10.0, 0.1):
        for j in range(m):
            S.status[j] = W.came[j]
            S.mult[j] = W.keep_mult[j] if W.came[j] == SOLVED else float(W.came[j])
        for a in range(size):
            W.group[a] = W.active[a]
            W.arrival[a] = W.came[W.active[a]]
        P.weight[first] = weight * factor
        same = same and call_layer_unit(P.layer_unit, P, S, W, 0, size, 0, 0.0) == SETTLED
        for j in range(m):
            same = same and S.status[j] == W.keep_status[j]
    P.weight[first] = weight
    for j in range(m):
        S.status[j] = W.keep_status[j]
        S.mult[j] = W.keep_mult[j]
    if not same:
        record_ambiguity(S, R, first, AMB_CORNER, 0)


@unit(types.int64, Problem, Control, State, Record, Work)
def at_instant(P, C, S, R, W):
    """Acts on everything that happens at the present instant, at which S already stands. Returns a code.

    In W.answer: where in the step the first surface was met, the step, the time since the last instant; in W.code:
    1 the switch at its fold or -1, 2 its direction, 4 whether a time event is due. 5 and 6 are set here.
    """
    m, ne, t, mult, status = P.m, P.ne, S.now[0], S.mult, S.status
    best, h, elapsed = W.answer[0], W.answer[1], W.answer[2]
    fold, fold_way = W.code[1], W.code[2]
    W.code[5] = 0  # x has jumped
    W.code[6] = 0  # several coupled switches arrive at once
    for i in range(m + ne):
        W.hit[i] = W.tau[i] <= 1.0 and (W.tau[i] - best) * h <= _AT_ONCE * max(abs(t), h)
        if not W.hit[i] and elapsed > 1e-12 * (1.0 + abs(t)):
            S.deflate[i] = 0
    if fold >= 0:
        W.hit[fold] = False
    for j in range(m):
        W.came[j] = status[j]
        if W.hit[j] and status[j] != SOLVED and P.surface_state[j] >= 0:
            S.x[P.surface_state[j]] = 0.0
        elif W.hit[j] and status[j] != SOLVED and P.kind[j] < CONTACT and P.rk_unit != 0:
            _step_inside(P, S, j, W)  # the last state of this side: on the other one its field may not exist
    record_point(P, S, R)
    S.counts[C_STALLED] = S.counts[C_STALLED] + 1 if elapsed <= 1e-14 * (1.0 + abs(t)) else 0
    if S.counts[C_STALLED] > _MOST_AT_ONCE:
        return CHATTERING
    events_before = S.counts[C_EVENTS]

    stop = _events(P, C, S, R, W) if ne > 0 else DONE
    if stop == CHATTERING or not _contacts(P, S, R, W):
        return CHATTERING
    jumped = W.code[5] != 0
    if jumped:
        _sides_after_jump(P, S, R, W)
    switched = jumped
    size = 0
    for j in range(m):
        if not W.hit[j] or P.kind[j] >= CONTACT or status[j] == HELD:
            continue
        if status[j] == SOLVED:
            if not jumped:
                status[j] = W.exit_side[j]
                mult[j] = float(status[j])
                S.deflate[j] = 2
                record_event(S, R, j, EV_TANGENCY, 0, status[j])
        elif P.kind[j] == SLIDING:
            W.active[size] = j
            size += 1
        else:
            went = -status[j]
            if jumped:
                if P.rk_unit != 0:
                    _step_inside(P, S, j, W)
                went = 1 if leading_order(P, C, S, W, j) > 0 else -1
            if went != status[j]:
                record_event(S, R, j, EV_CROSSING, status[j], went)
            status[j] = went
            mult[j] = float(went)
            S.deflate[j] = 1
            switched = True
            note_interval(S, j)
            if P.rk_unit != 0:
                _step_inside(P, S, j, W)
    if fold >= 0:
        S.counts[C_LAYERS] += 1
        outcome = call_layer_unit(P.layer_unit, P, S, W, LEAVE_FOLD, fold, fold_way, 0.0)
        code = layer_code(P, S, R, fold, outcome)
        if code != DONE:
            return code
        S.deflate[fold] = 1
        record_event(S, R, fold, EV_FOLD_TO_SLIDING if status[fold] == SOLVED else EV_FOLD, 0, status[fold])
        switched = True
    if size > 0:
        code = _arrivals(P, C, S, R, W, size, jumped)
        if code != DONE:
            return code
        switched = True
    code = pass_accumulation(P, C, S, R, W)
    if code > DONE:
        return code
    if switched or code == DONE:
        for j in range(m):
            W.keep_status[j] = status[j]
        code = resettle(P, S, R, W)
        if code != DONE:
            return code
        for j in range(m):
            if status[j] != W.keep_status[j]:
                record_event(S, R, j, EV_RESET, SOLVED, status[j])
    if S.counts[C_EVENTS] > events_before:
        record_point(P, S, R)
    if C.strict and S.counts[C_AMBIGUITIES] > 0:
        return STRICT
    return stop
