"""Accumulation points: impacts or switchings whose intervals shrink geometrically (chattering, Zeno).

When the limit t + d q/(1 - q) has come within rounding of the present instant it is passed: contacts become closed,
switches of relative degree 2 slide to second order, others of higher degree are held at lambda = 0, those of the
first settled by their layer.
"""

import math

from ..intervals import (
    SHRUNK,
    forget_intervals,
    have_shrunk,
    leads_as_far,
    note_interval,
    time_left,
    time_size,
    time_to_last_event,
)
from ..machine.compiling import inlined_kernel, kernel
from ..machine.pointers import call_act, call_fields
from ..outcome import Outcome
from ..state import (
    ACTS,
    ALGEBRAIC,
    AMB_ACCUMULATION,
    CONTACT,
    CROSSING,
    DISC,
    EV_ACCUMULATION,
    EV_CLOSED,
    EV_CROSSING,
    EV_OPENING,
    EV_STICK,
    GO_ON,
    HELD,
    KINK,
    NOTHING,
    SECOND_ORDER,
    SOLVED,
)
from ..step.finer import SWITCHING, follow_as_asked, go_on_as_arcs
from ..step.recording import record_ambiguity, record_event
from ..surface.sliding import (
    INSIDE,
    is_at_rest,
    keep_on_surface,
    surface_rounding,
    surface_size,
    surface_speed,
    surface_tolerance,
)
from .discs import settle_disc
from .settling import close_contact, settle_at_rest
from .surface_rates import approach_speed, evaluate_surfaces, stays_at_zero, stop_normal_speed

AT_ONCE = 1e-13  # instants closer than this (relative to the time) are one instant
# Where motions are fast beside the time: closer than this part of a step, or than the rounding of the time.
_OF_A_STEP, _TICK = 1e-8, 1e-15
WITHIN_ROUNDING = 1e-11  # an accumulation point this close is passed
_SLOW = 1e-9  # and one this close whose intervals come near to AT_ONCE: a ratio of 0.97 and more gets no nearer
_CLOSE = 1e-4  # and one whose surface is lost in its roundings before: its limit is told to the square
# Steps within an arc grow from a millionth of it, where it begins with the root of a height.
_SHORTEST, _SHRUNK_ARCS = 1e-7, 1e-4  # relative to the time, and to that over which they have shrunk
_RECENT = 10.0  # intervals: what has switched in the last ones accumulates with the others
_LOWEST = 1e-9  # of the size of what a surface is made of
_WHOLE = 1.0 - 1e-6  # of a flight: what one step takes of it
_WEAK = 1e-3  # of a speed: what a force changes that does not end its impacts
_AT_REST = 1e-5  # relative: what a bounce leaves of a speed where intervals are WITHIN_ROUNDING


@inlined_kernel
def at_once_within(t, length):
    """How far behind time t an instant is still the same, where steps have this length."""
    return min(AT_ONCE * abs(t), max(_OF_A_STEP * length, _TICK * abs(t)))


@kernel
def is_passed(S, j):
    """Whether the accumulation point of surface j is as near as its intervals let it come."""
    span, left = time_size(S), time_left(S.last[j])
    near = left <= WITHIN_ROUNDING * span or (left <= _SLOW * span and S.last[j, 1] <= 10.0 * AT_ONCE * span)
    return near and have_shrunk(S.last[j], left, SHRUNK, span)


@kernel
def _is_lost(P, S, W, i, interval):
    """Whether surface i, which is met now, has hardly been left since it was `interval` ago.

    Far from the origin a motion about it is lost in its roundings long before its instants are.
    """
    height = 0.25 * abs(approach_speed(P, S, i, W)) * interval  # of an arc
    return height <= 0.1 * surface_rounding(P, S, i, W)


@kernel
def _is_minute(P, S, W, j):
    """Whether the arcs about surface j, followed to their limit, are too short or too low to be followed longer."""
    if W.step.nears != SWITCHING or W.step.leader != j or W.step.turns < 3:
        return False
    next_height = 0.25 * abs(approach_speed(P, S, j, W)) * S.last[j, 1] * S.last[j, 2]
    low = P.surface_state[j] < 0 and next_height <= _LOWEST * surface_size(P, S, j, W)
    span, left = time_size(S), time_left(S.last[j])
    return low or (left <= _SHORTEST * span and have_shrunk(S.last[j], left, _SHRUNK_ARCS, span))


@kernel
def _comes_to(last, limit):
    """Whether the intervals of a surface come to the same limit, by their own estimate."""
    left = time_left(last)
    return abs(last[0] + left - limit) <= 0.5 * left < math.inf


@kernel
def _was_lost(P, S, W, i):
    """Whether the surface of event i, which x met at W.firing.arrived, had been lost since it fired."""
    for k in range(P.n):
        W.firing.after[k] = S.x[k]
        S.x[k] = W.firing.arrived[k]
    lost = _is_lost(P, S, W, P.m + i, W.firing.last[i, 1])
    for k in range(P.n):
        S.x[k] = W.firing.after[k]
    return lost


@kernel
def _comes_to_rest(P, S, W, i):
    """Whether the update of event i changes less and less: at the limit it changes nothing."""
    for k in range(P.n):
        W.firing.after[k] = S.x[k]
    call_act(P.act, i, S.t, S.x, S.mult, P.p, W.firing.after)
    rest = 0.0
    for k in range(P.n):
        rest = max(rest, abs(W.firing.after[k] - S.x[k]) / (1.0 + abs(S.x[k])))
    return rest <= _AT_REST


@kernel
def note_those_carried(P, S, W):
    """Notes the instant of events that fired at it because something else than the motion carried it there."""
    for i in range(P.ne):
        if W.firing.due[i] >= ACTS and S.t > W.firing.last[i, 0]:
            note_interval(W.firing.last[i], S.t)


@kernel
def events_accumulate(P, S, R, W):
    """Whether the events that fired at this instant (W.firing.due >= ACTS) come in intervals that shrink to nothing.

    What a system does beyond is not for its events to say: the run ends at the limit time, which S is moved to. A
    switch or a contact that accumulates with them is passed, and they with it.
    """
    t = S.t
    for i in range(P.ne):
        if W.firing.due[i] < ACTS or not W.instant.hit[P.m + i] or t <= W.firing.last[i, 0]:
            continue
        note_interval(W.firing.last[i], t)
        if time_to_last_event(W.firing.last[i], True, time_size(S)) == math.inf:
            continue
        left = time_to_last_event(W.firing.last[i], _was_lost(P, S, W, i), time_size(S))
        if left == math.inf:
            continue
        for j in range(P.m):
            if _comes_to(S.last[j], t + left) and left > 0.1 * WITHIN_ROUNDING * time_size(S):
                return False
        S.t = t + left
        record_event(S, R, P.m + i, EV_ACCUMULATION, S.side[i], 0)
        return True
    return False


@kernel
def _is_of_impacts_alone(P, S, W, j, left):
    """Whether no force says that the impacts at contact j end in the time left, as that on a bouncing ball does.

    Those of bodies on each other may turn round, and part: they are followed to their end (contacts.py).
    """
    if P.kind[j] != CONTACT:
        return False
    speed = approach_speed(P, S, j, W)  # leaves d2h/dt2 in W.g
    return left * abs(W.g[j]) < _WEAK * abs(speed)


@kernel
def _stop_discs(P, S, W):
    """Discs whose slip has ended with the impacts bear nothing at first: what presses there is for the contacts to
    bear. Whether there are any."""
    some = False
    for j in range(P.m):
        if P.kind[j] == DISC and S.status[j] == 1 and S.mult[j] == 1.0 and is_at_rest(P, S, j, W):
            some, S.mult[j] = True, INSIDE
            for k in range(j + 1, j + 1 + P.dim[j]):
                S.mult[k] = 0.0
    return some


@kernel
def _settle_stopped_discs(P, S, R, W):
    """What these discs do from then on: a code."""
    for j in range(P.m):
        if P.kind[j] == DISC and S.status[j] == 1 and S.mult[j] == INSIDE and S.deflate[j] == 0:
            code = settle_disc(P, S, R, W, j, False)
            if code != GO_ON:
                return code
            record_event(
                S, R, j, EV_STICK if S.status[j] == SOLVED else EV_CROSSING, 1, int(S.status[j] != SOLVED)
            )
    return GO_ON


@kernel
def _comes_to_zero(P, C, S, W, j, interval):
    """Whether the surface of switch j is 0 where others accumulate, but for what it changes by in some of the last
    intervals; it may only jump with them, from one value to another."""
    if P.nested[j] == 0 or P.kind[j] >= DISC:
        return True
    evaluate_surfaces(P, S, W)
    near = _RECENT * interval * abs(surface_speed(P, W, j)) + surface_tolerance(P, C, W, j)
    return abs(W.h[j]) <= near + surface_rounding(P, S, j, W)


@kernel
def pass_accumulation(P, C, S, R, W):
    """Passes an accumulation point that has come within rounding; NOTHING if there is none, else a code."""
    t = S.t
    leader, left = -1, math.inf
    for j in range(P.m):
        if W.instant.hit[j] and S.status[j] != SOLVED and W.instant.came[j] != SOLVED:
            estimate = time_left(S.last[j])
            if estimate < left:
                leader, left = j, estimate
    if leader < 0 or not left < _CLOSE * time_size(S):
        return NOTHING
    # A flight of one step is as good as its series; one that something has cut begins anew from a gap of roundings.
    cut = P.kind[leader] < CONTACT or W.instant.elapsed < _WHOLE * S.last[leader, 1]
    lost = cut and _is_lost(P, S, W, leader, S.last[leader, 1])
    minute = P.kind[leader] < CONTACT and _is_minute(P, S, W, leader)
    if not lost and not minute and not is_passed(S, leader):
        return NOTHING
    if _is_of_impacts_alone(P, S, W, leader, left):
        return NOTHING
    if leads_as_far(S.arcs[leader]):
        return Outcome.STEP_UNDERFLOW
    if minute:
        go_on_as_arcs(P, S, W, left)
    S.t = t + left
    interval = S.last[leader, 1]
    size, held, stopped = 0, 0, False
    for j in range(P.m):
        free = S.status[j] != SOLVED and S.status[j] != HELD and P.kind[j] != ALGEBRAIC
        recent = S.last[j, 1] > 0.0 and t - S.last[j, 0] <= _RECENT * interval
        if j != leader and not (free and recent and _comes_to_zero(P, C, S, W, j, interval)):
            continue
        record_event(S, R, j, EV_ACCUMULATION, S.status[j], 0)
        forget_intervals(S.last[j], S.t)
        keep_on_surface(P, S, j, W)
        if P.kind[j] == CONTACT:
            stop_normal_speed(P, S, j, W, True)
            stopped = _stop_discs(P, S, W) or stopped
            closed = close_contact(P, S, j, W)
            record_event(S, R, j, EV_CLOSED if closed else EV_OPENING, 1, S.status[j])
        elif P.kind[j] == CROSSING or P.kind[j] == KINK:
            if len(P.contact) == 0 or not stays_at_zero(P, S, R, W, j):
                S.status[j] = HELD
                S.mult[j] = 0.0
            held += 1
        else:
            if P.kind[j] == SECOND_ORDER:
                S.mult[j] = 0.0
                stop_normal_speed(P, S, j, W, False)
            W.instant.active[size] = j
            size += 1
    for j in range(P.m if held > 0 else 0):
        # Powers of the surfaces are 0 from here on.
        if S.status[j] == HELD and (P.kind[j] == CROSSING or P.kind[j] == KINK):
            stop_normal_speed(P, S, j, W, False)
    for i in range(P.ne):
        # Its surface may accumulate with these; what it does may have no limit.
        if (
            W.firing.last[i, 1] > 0.0
            and t - W.firing.last[i, 0] <= _RECENT * interval
            and not _comes_to_rest(P, S, W, i)
        ):
            record_ambiguity(S, R, P.m + i, AMB_ACCUMULATION, 0)
    code = settle_at_rest(P, C, S, R, W, size) if size > 0 else GO_ON
    if code == GO_ON and stopped:
        code = _settle_stopped_discs(P, S, R, W)
    if W.step.nears == SWITCHING:
        follow_as_asked(P, C, W)
    if code == GO_ON:
        # What is left of the way, with the field that the switchings come to on average.
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(0 if minute else P.n):
            S.x[i] += left * W.dx[i]
        for j in range(P.m):
            if S.status[j] == HELD or (S.status[j] == SOLVED and P.kind[j] != ALGEBRAIC):
                keep_on_surface(P, S, j, W)
    return code
