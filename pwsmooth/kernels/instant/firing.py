"""Events of one instant on the event-driven path (the rule is that of kernels/firing.py), and the sides of the
switches after what jumped."""

import math

from ..firing import counts, fire
from ..intervals import time_size
from ..machine.compiling import kernel
from ..machine.pointers import call_act
from ..outcome import Outcome
from ..state import (
    ACTS,
    ADD,
    ALGEBRAIC,
    AMB_UPDATES,
    COMPONENT,
    CONTACT,
    CROSSING,
    DISC,
    DUE,
    EV_CROSSING,
    EV_EVENT,
    EV_RESET,
    GO_ON,
    HELD,
    KINK,
    SECOND_ORDER,
    SET,
    SOLVED,
    TAPE_ACT,
    TAPE_ROUND,
    THROUGH,
    UNRECORDED,
)
from ..step.meeting import is_clocked, late_by
from ..step.recording import put_on_tape, record_ambiguity, record_event
from ..surface.sliding import (
    follow,
    is_at_rest,
    is_memory,
    keep_on_surface,
    mask_instant,
    surface_rounding,
    surface_speed,
)
from .accumulation import at_once_within, events_accumulate
from .surface_rates import any_kind, approach_speed, evaluate_surfaces

_MOST_INSIDE = 1e-9  # of the states and their way: what one may be moved by
_TICK = 1e-15  # of the time: its rounding
NOW, LATER = 1, 2  # in instant.waits: met and about to be settled; once what its surface jumps with has settled
BETWEEN = 0.3  # a multiplier inside (-1, 1): stairs that have a step at both of its sides have none here
_OF_A_STEP = 1e-8  # by so much at most the series of a step tells an instant too late or too early


@kernel
def _look(loop, t, x):
    """Overwrites level and rounding of the event surfaces at S, with what the state says of switches and unknowns."""
    P, S, R, W = loop
    _renew_multipliers(P, S, W)
    evaluate_surfaces(P, S, W)
    for i in range(P.ne):
        W.firing.level[i] = W.h[P.m + i]
        W.firing.rounding[i] = W.firing.slack[i] + _rounding_of_update(P, S, W, P.m + i)
    _note_what_updates_read(P, S, W)


@kernel
def _rounding_of_update(P, S, W, i):
    """What surface i may be off by as the last round of updates has made its states of the values before, from W.dh."""
    total = 0.0
    for e in range(P.dh_row[i], P.dh_row[i + 1]):
        k = P.dh_col[e]
        total += abs(W.dh[e]) * (abs(W.firing.before[k]) + abs(S.x[k]))
    return 1e-13 * total


@kernel
def _note_what_updates_read(P, S, W):
    """Overwrites firing.read: the multipliers, but 0 for a switch that is on its surface and does not hold it there."""
    for j in range(P.m):
        on = P.kind[j] < DISC and abs(S.status[j]) == 1 and abs(W.h[j]) <= surface_rounding(P, S, j, W)
        W.firing.read[j] = 0.0 if on else S.mult[j]


@kernel
def renew_unknowns(P, S, W):
    """Solves for what is solved for at every instant, where there are unknowns."""
    if any_kind(P, ALGEBRAIC) and mask_instant(P, S, W):
        follow(P, S, W)


@kernel
def _lets_go(P, S, W, solved):
    """Puts multipliers that can hold no more to their bounds, and takes note of them in instant.weak; whether there are
    any.

    They have been solved for and are beyond, or, not `solved`, those of switches have no root: those that have none
    alone, if there are such. With hidden terms a root may be on the wrong side: a switch goes where its surface does at
    the multiplier that it had (instant.mult).
    """
    some, moves = False, False
    alone = not solved and _have_no_root_alone(P, S, W)
    for j in range(P.m):
        if not W.mask[j]:
            continue
        if P.kind[j] == CONTACT and S.mult[j] < 0.0:
            S.mult[j] = 0.0
            W.instant.weak[j], some = 1, True
        elif P.kind[j] < DISC and (abs(S.mult[j]) > 1.0 if solved else not alone or W.instant.faint[j] != 0):
            W.instant.weak[j], some = 1, True
            if solved and P.hidden[j] == 0:
                S.mult[j] = math.copysign(1.0, S.mult[j])
            else:
                S.mult[j], moves = W.instant.mult[j], True
        elif P.kind[j] == COMPONENT:
            some = _slips(P, S, W, P.disc_of[j]) or some
    if moves:
        renew_unknowns(P, S, W)
        evaluate_surfaces(P, S, W)
        for j in range(P.m):
            if W.instant.weak[j] and P.kind[j] < DISC and abs(S.mult[j]) != 1.0:
                S.mult[j] = math.copysign(1.0, W.g[j])
    return some


@kernel
def _have_no_root_alone(P, S, W):
    """Overwrites instant.faint: the switches in W.mask that have no root while the others in it stay; whether there are
    any."""
    some = False
    for j in range(P.m):
        W.instant.kept[0, j] = W.mask[j]
    for j in range(P.m):
        W.instant.faint[j] = 0
        if W.instant.kept[0, j] == 0 or P.kind[j] >= DISC:
            continue
        for k in range(P.m):
            W.mask[k] = int(k == j or (W.instant.kept[0, k] != 0 and P.kind[k] == ALGEBRAIC))
        if not follow(P, S, W):
            W.instant.faint[j], some = 1, True
        for k in range(P.m):
            S.mult[k] = W.instant.mult[k]
    for j in range(P.m):
        W.mask[j] = W.instant.kept[0, j]
    return some


@kernel
def _slips(P, S, W, j):
    """Puts the multipliers of disc j, which are solved for, on its rim if they are beyond; whether they are."""
    size = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        size += S.mult[k] ** 2
    for k in range(j + 1, j + 1 + P.dim[j] if size > 1.0 else 0):
        S.mult[k] /= math.sqrt(size)
        W.instant.weak[k] = 1
    return size > 1.0


@kernel
def _renew_multipliers(P, S, W):
    """Between two rounds of events: multipliers of switches that an update has moved are those of their new sides.

    Those that hold follow, and are at their bounds where they can hold no more. What an update has put on a surface, to
    the rounding of what it is made of, stands on it. What statuses become is settled when no event acts any more.
    """
    let_go = False
    for j in range(P.m):
        W.instant.weak[j] = 0
    for sweep in range(2 * P.m + 1):
        evaluate_surfaces(P, S, W)
        solves, renewed = False, False
        for j in range(P.m):
            W.mask[j] = int(S.status[j] == SOLVED and W.instant.weak[j] == 0)
            if P.kind[j] < DISC:
                moved = W.h[j] != W.firing.switch_level[j]
                if moved and W.h[j] != 0.0 and abs(W.h[j]) <= _rounding_of_update(P, S, W, j):
                    if renewed:
                        continue  # a switch renewed in this sweep may stand in this surface
                    keep_on_surface(P, S, j, W)  # 1 - 1 is 0
                    evaluate_surfaces(P, S, W)
                side = float(S.status[j]) if not moved else 1.0 if W.h[j] > 0.0 else -1.0
                if abs(W.h[j]) > surface_rounding(P, S, j, W) if moved else abs(S.status[j]) == 1:
                    W.mask[j] = 0
                    renewed = renewed or S.mult[j] != side
                    S.mult[j] = side
            solves = solves or W.mask[j] != 0
        changed = let_go or renewed
        if sweep > 0 and not changed:
            return
        let_go = False
        if solves:
            for j in range(P.m):
                W.instant.mult[j] = S.mult[j]
            solved = follow(P, S, W)
            for j in range(0 if solved else P.m):
                S.mult[j] = W.instant.mult[j]
            let_go = _lets_go(P, S, W, solved)
        elif not changed:
            return


@kernel
def _moment(S, W):
    """The rounding of an instant."""
    return max(at_once_within(S.t, W.step.length), _TICK * time_size(S))


@kernel
def note_surfaces(P, S, W):
    """Overwrites instant.stood and firing.slack: the surfaces at S, before something at this instant may move them, and
    what those of events change by in the rounding of time. Unknowns are solved for, as they are after what moves them.
    """
    renew_unknowns(P, S, W)
    evaluate_surfaces(P, S, W)
    for i in range(P.m + P.ne):
        W.instant.stood[i] = W.h[i]
    for i in range(P.ne):
        W.firing.slack[i] = _TICK * time_size(S) * abs(surface_speed(P, W, P.m + i))


@kernel
def _leave_what_jumps(P, S, W):
    """Surfaces that were met and have since jumped with a switch that stands in them are not met any more; returns
    whether there are any."""
    some = False
    evaluate_surfaces(P, S, W)
    for i in range(P.m + P.ne):
        if P.nested[i] == 0 or not W.instant.hit[i]:
            continue
        within = surface_rounding(P, S, i, W) + _moment(S, W) * abs(surface_speed(P, W, i))
        if abs(W.h[i] - W.instant.stood[i]) > within and abs(W.h[i]) > within:
            W.instant.hit[i], some = False, True
    return some


@kernel
def leave_what_jumps(P, S, R, W):
    """Surfaces that were met and have since jumped with a switch that stands in them are not met any more; switches on
    them have at once the sides where they are, and so on."""
    while _leave_what_jumps(P, S, W):
        sides_after_crossing(P, S, R, W)


@kernel
def jumps_with_another(P, S, W, j):
    """Whether the surface of switch j, or unknowns in it, jump with another switch that is met and not settled yet."""
    for i in range(P.m if P.nested[j] != 0 else 0):
        if i == j or W.instant.waits[i] == 0 or not W.instant.hit[i] or abs(S.status[i]) != 1:
            continue
        for k in range(P.m):
            W.instant.mult[k] = S.mult[k]
        lowest, highest = math.inf, -math.inf
        for look in range(3):
            S.mult[i] = -1.0 if look == 0 else 1.0 if look == 1 else BETWEEN
            if P.nested[i] == 0:
                renew_unknowns(P, S, W)
            evaluate_surfaces(P, S, W)
            lowest, highest = min(lowest, W.h[j]), max(highest, W.h[j])
        for k in range(P.m):
            S.mult[k] = W.instant.mult[k]
        evaluate_surfaces(P, S, W)
        if highest - lowest > surface_rounding(P, S, j, W):
            return True
    return False


@kernel
def next_that_wait(P, S, W):
    """Overwrites instant.active by the switches still met whose surfaces jump with no other one that waits, or by all
    that wait; how many."""
    waits, size, some = W.instant.waits, 0, False
    for j in range(P.m):
        if waits[j] != LATER or not W.instant.hit[j] or abs(S.status[j]) != 1:
            waits[j] = 0
        some = some or waits[j] != 0
    for j in range(P.m if some else 0):
        if waits[j] == LATER and not jumps_with_another(P, S, W, j):
            W.instant.active[size], waits[j] = j, NOW
            size += 1
    for j in range(P.m if some and size == 0 else 0):
        if waits[j] == LATER:
            W.instant.active[size], waits[j] = j, NOW
            size += 1
    return size


@kernel
def place_those_that_wait(P, S, W, size):
    """Switches on surfaces that jump with active[:size] have, as these settle, the sides of what is in between."""
    some = False
    for j in range(P.m):
        W.instant.mult[j] = S.mult[j]
        some = some or W.instant.waits[j] == LATER
    if not some:
        return
    for a in range(size):
        S.mult[W.instant.active[a]] = BETWEEN
    renew_unknowns(P, S, W)
    evaluate_surfaces(P, S, W)
    for j in range(P.m):
        S.mult[j] = W.instant.mult[j]
        if W.instant.waits[j] == LATER and abs(W.h[j]) > surface_rounding(P, S, j, W):
            S.status[j] = 1 if W.h[j] > 0.0 else -1
            S.mult[j] = float(S.status[j])


@kernel
def _strike(S, R, W, j, order):
    """Switch j takes its other side by the time alone, with so many known zero orders of its surface."""
    record_event(S, R, j, EV_CROSSING, S.status[j], -S.status[j])
    S.status[j] = -S.status[j]
    S.mult[j] = float(S.status[j])
    S.deflate[j] = order
    W.instant.hit[j] = False


@kernel
def _is_met_in_time(P, C, S, W, j):
    """Whether switch j, which the motion only passes, is met, or just behind a rounding of the clock, and no state or
    unknown stands in its surface."""
    passes = (P.kind[j] == CROSSING or P.kind[j] == KINK) and abs(S.status[j]) == 1 and not is_clocked(C, j)
    if not passes or P.dh_row[j] < P.dh_row[j + 1] or P.unknowns[j] >= 0:
        return False
    if W.instant.hit[j]:
        return True
    evaluate_surfaces(P, S, W)
    comes = S.status[j] * surface_speed(P, W, j) < 0.0
    return comes and S.deflate[j] == 0 and abs(W.h[j]) <= surface_rounding(P, S, j, W)


@kernel
def strike_switches(P, C, S, R, W):
    """Switches of time alone whose instant has come cross; returns whether there are any.

    They come first: at an instant a function of time has the value that it has from there on.
    """
    some, tick = False, S.ticks
    for j in range(P.m):
        some = some or _is_met_in_time(P, C, S, W, j)
    while tick < len(C.clock) and C.clock[tick] <= S.t:
        some = some or C.clock_event[tick] >= P.ne
        tick += 1
    if some:
        note_surfaces(P, S, W)
        for j in range(P.m):
            if _is_met_in_time(P, C, S, W, j):
                _strike(S, R, W, j, 1)
        for k in range(S.ticks, tick):
            if C.clock_event[k] >= P.ne:
                _strike(S, R, W, C.clock_event[k] - P.ne, 0)
        renew_unknowns(P, S, W)
        leave_what_jumps(P, S, R, W)
        sides_after_crossing(P, S, R, W)
    return some


@kernel
def may_be_carried(P):
    """Whether something else than motion and updates can carry it through the surface of an event."""
    if P.ne > 0 and len(P.contact) > 0:
        return True
    for i in range(P.m, P.m + P.ne):
        if P.nested[i] != 0:
            return True
    return False


@kernel
def carried_along(P, S, W):
    """Makes due the events through whose surfaces something else than the motion has carried it since `stood`: an
    impact, a switch that stands in them. Returns whether there are any.

    A surface that it is left on is met when the motion goes on to the other side. One on whose zero the motion stands,
    since it came there, is not jumped through but left.
    """
    some = False
    evaluate_surfaces(P, S, W)
    for i in range(P.ne):
        j = P.m + i
        W.firing.due[i], W.firing.met[i] = 0, int(S.deflate[j] != 0)
        if P.rows_slip[j] < 0 or P.watch[i] != 0:
            continue
        speed = surface_speed(P, W, j)
        within = surface_rounding(P, S, j, W) + max(W.firing.slack[i], _moment(S, W) * abs(speed))
        if abs(W.h[j]) <= within:
            rests = abs(approach_speed(P, S, j, W)) <= W.instant.rest_speed
            if S.deflate[j] == 0 and (speed * S.side[i] > 0.0 or rests):
                S.deflate[j] = 1  # it was met, rested there, and is left
            continue
        if abs(W.h[j] - W.instant.stood[j]) <= within:
            continue
        stood_at_zero = S.deflate[j] != 0
        S.deflate[j] = 0
        if W.h[j] * S.side[i] < 0.0:
            S.side[i] = -S.side[i]
            if counts(P.direction[i], S.side[i]) and not stood_at_zero:
                W.firing.due[i] = DUE
                some = True
    return some


@kernel
def _act(loop, i, t):
    P, S, R, W = loop
    acts = call_act(P.act, i, t, W.firing.before, W.firing.read, P.p, W.firing.after) != 0
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
        call_act(P.act, i, S.t, E.before, E.read, P.p, E.trial)
        call_act(P.act, i, S.t, E.before, E.read, P.p, E.shifted)
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
def events(P, C, S, R, W, struck):
    """The events of this instant, of surfaces and of the clock; returns as `fire`, or EVENTS_ACCUMULATE.

    Sets W.instant.jumped; keeps in W.firing.switch_level the switches' surfaces before the first update. `struck`:
    whether switches have crossed by the clock, which may carry through surfaces of events.
    """
    firing, instant = W.firing, W.instant
    m, some = P.m, struck and carried_along(P, S, W)
    for i in range(P.ne):
        met = instant.hit[m + i]
        if not struck:
            firing.due[i] = 0
        if met:
            S.deflate[m + i] = 1
            S.side[i] = -S.side[i]
            if counts(P.direction[i], S.side[i]):
                firing.due[i] = DUE
                some = True
        firing.met[i] = int(S.deflate[m + i] != 0)
    if instant.at_clock:
        while S.ticks < len(C.clock) and C.clock[S.ticks] <= S.t:
            if C.clock_event[S.ticks] < P.ne:
                firing.due[C.clock_event[S.ticks]] = DUE
                some = True
            S.ticks += 1
    for k in range(P.n):
        firing.arrived[k] = S.x[k]
    if not some:
        if may_be_carried(P):
            note_surfaces(P, S, W)
        return GO_ON
    code = fire_due(P, S, R, W)
    if code == GO_ON and events_accumulate(P, S, R, W):
        return Outcome.EVENTS_ACCUMULATE
    return code


@kernel
def fire_due(P, S, R, W):
    """Lets what is due act, and what that makes due, from the present state; returns as `fire`, sets instant.jumped."""
    firing, m = W.firing, P.m
    note_surfaces(P, S, W)
    for i in range(P.ne):
        firing.left[i] = 0
    _note_what_updates_read(P, S, W)
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
    W.instant.jumped = firing.jumped
    for i in range(P.ne):
        W.instant.stood[m + i] = firing.level[i]
        if firing.left[i]:
            S.deflate[m + i] = 0
        if firing.left[i] == THROUGH:
            W.instant.hit[m + i] = True
    return code


@kernel
def _latest(P, S, W):
    """How late or early the instant may be: what the surfaces of switches that cross say."""
    late = 0.0
    for i in range(P.m):
        if W.instant.hit[i] and P.kind[i] < DISC and abs(S.status[i]) == 1:
            late = max(late, late_by(P, W, i))
    return min(late, _OF_A_STEP * W.step.length)


@kernel
def sides_after_crossing(P, S, R, W):
    """A surface in which another multiplier stands has jumped with it: its switch takes the side it finds itself on."""
    for _ in range(P.m):
        renew_unknowns(P, S, W)
        evaluate_surfaces(P, S, W)
        changed = False
        for j in range(P.m):
            if P.nested[j] == 0 or W.instant.hit[j] or P.kind[j] >= CONTACT:
                continue
            if S.deflate[j] != 0 and abs(S.status[j]) == 1 and W.h[j] == W.instant.stood[j]:
                continue  # it has been met at this instant, within the tolerance of a step, and nothing has moved it
            within = surface_rounding(P, S, j, W) + _latest(P, S, W) * abs(surface_speed(P, W, j))
            if not abs(W.h[j]) > within:  # nan where a root has its branch point
                if S.deflate[j] == 0 and S.status[j] * approach_speed(P, S, j, W) > W.instant.rest_speed:
                    S.deflate[j] = 1  # it has jumped onto its surface, and is left on the side that it has
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
    """After x has jumped: switches off their surfaces take their sides; those on them stay or become hit.

    Again for surfaces in which one stands that has taken another side: they have jumped as well.
    """
    for turn in range(P.m + 1):
        renew_unknowns(P, S, W)
        evaluate_surfaces(P, S, W)
        changed = False
        for j in range(P.m):
            if P.kind[j] < CONTACT and (turn == 0 or P.nested[j] != 0):
                changed = _side_after_jump(P, S, R, W, j) or changed
        if not changed:
            return


@kernel
def _side_after_jump(P, S, R, W, j):
    """Switch j is off its surface, or met; returns whether it has taken another side."""
    instant, unmoved = W.instant, W.h[j] == W.firing.switch_level[j]
    if instant.hit[j] and unmoved:
        return False  # the jump has not moved it: it is met, within the tolerance of the series that say so
    on = is_at_rest(P, S, j, W) if P.kind[j] == DISC else abs(W.h[j]) <= surface_rounding(P, S, j, W)
    left = not on or (S.deflate[j] != 0 and not instant.hit[j] and P.kind[j] < DISC)
    if unmoved and left and abs(S.status[j]) == 1:
        return False  # it may have crossed at this instant, within that tolerance, or been left
    if on:
        if S.status[j] == HELD and P.kind[j] != SECOND_ORDER:
            return False
        if abs(S.status[j]) == 1:
            S.mult[j] = float(S.status[j])  # whatever an earlier round has made of it
        if not instant.hit[j]:
            S.last[j, 2] = 0.0  # what puts it there comes back to its surface, not the motion
        instant.hit[j] = True  # still, or now, on its surface
        return False
    instant.hit[j] = False
    S.deflate[j] = 0
    side = 1 if W.h[j] > 0.0 else -1
    S.mult[j] = float(side)
    if S.status[j] == side:
        return False
    S.last[j, 2] = 0.0
    record_event(S, R, j, EV_RESET, S.status[j], side)
    S.status[j] = side
    return True


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
        if part > most and not is_memory(P, P.dh_col[e]):
            best, most = e, part
    side = float(S.status[j])
    if best >= 0 and side * W.h[j] < 4e-16 * total:
        k = P.dh_col[best]
        move = (side * 8e-16 * total - W.h[j]) / W.dh[best]
        # Where time alone carries the surface, as x sin t at t = pi, no state is moved for it.
        if abs(move) <= _MOST_INSIDE * way:
            # Not beyond 0, where a power of the state itself may have its branch point.
            S.x[k] = S.x[k] + move if S.x[k] * (S.x[k] + move) >= 0.0 else 0.0
