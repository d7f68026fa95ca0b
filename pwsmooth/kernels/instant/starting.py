"""Classification of every surface at the initial state: a start on a surface is classified, not found."""

import math

from ..intervals import forget_intervals
from ..machine.compiling import kernel
from ..machine.pointers import call_fields
from ..outcome import Outcome
from ..state import (
    ALGEBRAIC,
    AMB_SEVERAL_ROOTS,
    COMPONENT,
    CONTACT,
    CROSSING,
    DISC,
    GO_ON,
    KINK,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
)
from ..step.meeting import is_clocked
from ..step.recording import record_ambiguity, record_point
from ..surface.sliding import INSIDE, is_at_rest, mask_instant, surface_rounding
from ..surface.unknowns import has_other_root, solve_unknowns
from .contacts import UNCHANGED, close_at_start, is_behind, outcome_of
from .discs import settle_discs
from .firing import LATER, NOW, jumps_with_another, next_that_wait, place_those_that_wait, renew_unknowns
from .resting import hold_by_what_jumps, stay_at_rest
from .settling import settle_at_rest
from .surface_rates import (
    any_is,
    approach_speed,
    evaluate_surfaces,
    leading_order,
    order_at_rest,
    order_of_leaving,
    stays_at_zero,
)


@kernel
def _look_at_nested(P, C, S, W):
    """After a switch on its surface has taken its side: where the surfaces in which others stand are now."""
    renew_unknowns(P, S, W)
    evaluate_surfaces(P, S, W)
    for i in range(P.m + P.ne):
        with_unknowns = i < P.m and P.kind[i] < DISC
        if P.nested[i] == 0 or (P.rows_slip[i] < 0 and not with_unknowns):
            continue
        W.instant.hit[i] = abs(W.h[i]) <= surface_rounding(P, S, i, W)
        side = 1 if W.h[i] >= 0.0 else -1
        if i >= P.m:
            S.side[i - P.m] = side
        elif P.kind[i] < DISC and not W.instant.hit[i] and abs(S.status[i]) == 1 and not is_clocked(C, i):
            S.status[i] = side
            S.mult[i] = float(side)


@kernel
def _take_side(P, C, S, R, W, j):
    """Switch j, on its surface, takes the side to which the motion goes, or is what conditions say of 0 if it stays;
    returns whether that is new."""
    side = S.status[j]
    order, stays = order_at_rest(P, C, S, W, j)
    rests = stays and stays_at_zero(P, S, R, W, j)
    if order != 0 and not rests:
        S.status[j] = 1 if order > 0 else -1
        S.mult[j] = float(S.status[j])
        S.deflate[j] = abs(order)
    if S.status[j] != side:
        _look_at_nested(P, C, S, W)
    return S.status[j] != side


@kernel
def _settle_those_that_waited(P, C, S, R, W, code):
    """Switches on surfaces that jump with others, which have settled: those that still stand on them; a code."""
    for _ in range(P.m):
        size = next_that_wait(P, S, W)
        if code != GO_ON or size == 0:
            break
        code = settle_at_rest(P, C, S, R, W, size)
        _look_at_nested(P, C, S, W)
    return code


@kernel
def start(P, C, S, R, W):
    """The first instant: overwrites status, multipliers, sides and known zeros of S, records the point; a code."""
    S.started = 1
    instant = W.instant
    m, status, mult = P.m, S.status, S.mult
    W.pair.longest = math.inf
    for i in range(P.ne):
        forget_intervals(W.firing.last[i], S.t)
    for j in range(m):
        status[j] = SOLVED if P.kind[j] == ALGEBRAIC else 1
        mult[j] = 0.0 if P.kind[j] >= CONTACT else 1.0
        if is_clocked(C, j):
            status[j] = C.clock_side[j]
            mult[j] = float(status[j])
    # Until nothing changes: a surface may depend on inner switches that are known only after a look.
    for look in range(m + 1):
        call_fields(P.fields, S.t, S.x, mult, P.p, W.dx, W.h, W.g)
        changed = False
        for j in range(m):
            if P.kind[j] < CONTACT and not is_clocked(C, j):
                side = 1 if W.h[j] >= 0.0 else -1
                changed = changed or side != status[j]
                status[j] = side
                mult[j] = float(side)
        if look > 0 and not changed:
            break
    for j in range(m):
        if P.kind[j] == DISC and is_at_rest(P, S, j, W):
            mult[j] = INSIDE
    other_root = False
    if mask_instant(P, S, W):
        if not solve_unknowns(P, S, W):
            return Outcome.NO_ROOT
        other_root = has_other_root(P, S, W)
    evaluate_surfaces(P, S, W)
    for i in range(m + P.ne):
        instant.hit[i] = abs(W.h[i]) <= surface_rounding(P, S, i, W) and P.rows_slip[i] >= 0
        if i < m and P.kind[i] == DISC:
            instant.hit[i] = mult[i] == INSIDE
        if i < m and is_clocked(C, i):
            instant.hit[i] = False
    for i in range(P.ne):
        S.side[i] = 1 if W.h[m + i] >= 0.0 else -1
    if len(P.contact) > 0:
        if is_behind(P, C, S, W, True):
            record_point(P, S, R)
            return Outcome.BEHIND_CONTACT
        contacts = close_at_start(P, S, R, W)
        if contacts < UNCHANGED:
            return outcome_of(contacts)
    stay_at_rest(P, C, S, R, W)
    S.events, size = 0, 0
    for j in range(m):
        instant.came[j], instant.waits[j] = status[j], NOW if instant.hit[j] and P.kind[j] == SLIDING else 0
    for j in range(m):
        if not instant.hit[j] or P.kind[j] == DISC or P.kind[j] == COMPONENT:
            continue
        if P.kind[j] == CONTACT:
            if status[j] != SOLVED and approach_speed(P, S, j, W) > instant.rest_speed:
                S.deflate[j] = 1
        elif P.kind[j] == SLIDING or (
            P.kind[j] == SECOND_ORDER and abs(approach_speed(P, S, j, W)) <= instant.rest_speed
        ):
            # Where a surface is that jumps with another one is known once that has settled.
            if jumps_with_another(P, S, W, j):
                instant.waits[j] = LATER
            else:
                instant.active[size] = j
                size += 1
        elif abs(status[j]) == 1:
            _take_side(P, C, S, R, W, j)
    place_those_that_wait(P, S, W, size)
    code = settle_at_rest(P, C, S, R, W, size) if size > 0 else GO_ON
    if size > 0:
        _look_at_nested(P, C, S, W)
        code = _settle_those_that_waited(P, C, S, R, W, code)
    if code == GO_ON and size > 0 and any_is(P, S, SOLVED):
        # What slides carries the others to one side or the other, which may let it go.
        changed = False
        for j in range(m):
            met = instant.hit[j] and (P.kind[j] == CROSSING or P.kind[j] == KINK) and abs(status[j]) == 1
            changed = (met and _take_side(P, C, S, R, W, j)) or changed
        if changed:
            code = settle_at_rest(P, C, S, R, W, size)
    if code == GO_ON:
        hold_by_what_jumps(P, S, R, W)
        S.events = 0
    if code == GO_ON and P.discs != 0:
        code, _ = settle_discs(P, C, S, R, W, True)
        S.events = 0
        _look_at_nested(P, C, S, W)
    # What the switches have become acts on the contacts that were looked at before them.
    instant.look_again = int(size > 0 and len(P.contact) > 0)
    slipping = not any_is(P, S, SOLVED)
    for i in range(m + P.ne):
        if not instant.hit[i] or (i < m and (P.kind[i] != SLIDING or status[i] == SOLVED)):
            continue
        S.deflate[i] = 1
        if slipping:
            order = leading_order(P, C, S, W, i)
        elif i >= m and P.watch[i - m] == 0:
            order = order_of_leaving(P, C, S, W, i)
        else:
            continue
        if order != 0:
            S.deflate[i] = abs(order)
            if i >= m:
                S.side[i - m] = 1 if order > 0 else -1
    record_point(P, S, R)
    for j in range(m):
        if P.kind[j] == ALGEBRAIC and other_root:
            record_ambiguity(S, R, j, AMB_SEVERAL_ROOTS, 0)
            other_root = False
        if P.slip_share[j] > 0.0 and status[j] == SOLVED and abs(mult[j]) > P.slip_share[j]:
            record_ambiguity(S, R, j, AMB_SEVERAL_ROOTS, 0)  # slip would hold too
    if code == GO_ON and C.strict and S.ambiguities > 0:
        return Outcome.AMBIGUITY
    return code
