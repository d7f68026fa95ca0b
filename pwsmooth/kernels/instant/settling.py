"""Settling switches and contacts that are on their surfaces: what the start, resets and accumulation points share."""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_layer_unit, call_linear, call_newton, call_others
from ..outcome import Outcome
from ..state import (
    AMB_FORCES,
    AMB_HIDDEN_OSCILLATION,
    AMB_REPELLING,
    AMB_SEVERAL_ROOTS,
    COMPONENT,
    DISC,
    EV_FOLD,
    EV_RESET,
    EV_TANGENCY,
    GO_ON,
    GROWS,
    HELD,
    NOTHING,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
)
from ..step.recording import record_ambiguity, record_event
from ..surface.fast import LOST, OSCILLATES
from ..surface.layer import ARRIVE, FIRST_ZERO
from ..surface.sliding import follow, mask_instant, mask_solved, surface_rounding
from ..surface.sparse import entry, link
from ..surface.unknowns import solve_unknowns
from .dry_friction import is_held, let_part, settle_friction, sliding_with
from .holding import (
    held_by,
    hold_beside,
    hold_second_order,
    hold_supported,
    is_coupled,
    rest_with_friction,
    some_second_order,
    take_side,
    take_sides,
)
from .resting import follow_by_a_jump
from .surface_rates import (
    FAINT,
    any_is,
    evaluate_surfaces,
    hold_at_zero,
    is_supported,
    look_ahead,
    look_back,
    order_of_leaving,
    residual,
)

_SAME = 1e-9  # of lambda: by less a slide is at its bound
_SLIGHT = 1e-6  # of lambda: what an instant's rounding makes of it, as where impacts have come to their limit
_NUDGE = 1e-3  # of lambda, to see what room a hidden term has
# Of lambda: so near to its fold a hidden term is held, which takes some 1e-10 of its force; the pair knows it less.
_INSIDE, _INSIDE_OF_PAIR = 1e-5, 1e-4


@kernel
def layer_code(P, S, R, j, outcome):
    """The loop's return code for what a layer run ended in."""
    if outcome == OSCILLATES:
        record_ambiguity(S, R, j, AMB_HIDDEN_OSCILLATION, 0)
        return Outcome.LAYER_UNSETTLED
    return Outcome.NO_ROOT if outcome == LOST else GO_ON


@kernel
def settle_arrivals(P, S, R, W, size):
    """Runs the layer of W.instant.group[:size], come from W.instant.arrival; returns the loop's code."""
    S.layers += 1
    j = W.instant.group[0]
    code = layer_code(P, S, R, j, call_layer_unit(P.layer_unit, P, S, W, ARRIVE, size, 0, 0.0))
    for a in range(size):  # those that rest stand first
        if code == GO_ON and S.status[W.instant.group[a]] == HELD:
            record_ambiguity(S, R, j, AMB_FORCES, 0)
            break
    return code


@kernel
def _one_at_rest(P, S, R, W, j):
    """One switch on its surface that came from no side: u = 0, lambda = 0. Says so where that does not decide."""
    plus, minus = residual(P, S, W, j, 1.0), residual(P, S, W, j, -1.0)
    middle = residual(P, S, W, j, 0.0)
    if abs(middle) <= 1e-14 * max(abs(plus), abs(minus)) and residual(P, S, W, j, 1e-4) > 0.0:
        # lambda = 0 is a repelling root: which way it leaves is not decided by the equations.
        found = call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, 1, 1e-4)
        S.status[j] = SOLVED if found else 1
        record_ambiguity(S, R, j, AMB_REPELLING, S.status[j])
        mask_solved(P, S, W)
        return GO_ON if follow(P, S, W) else Outcome.NO_ROOT
    if plus > 0.0 and minus < 0.0:
        record_ambiguity(S, R, j, AMB_REPELLING, 1 if middle > 0.0 else -1)
    elif P.hidden[j]:
        from_below, from_above = -1.0, 1.0
        if minus >= 0.0:
            found = call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, 1, -1.0)
            from_below = S.mult[j] if found else 1.0
        if plus <= 0.0:
            found = call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, -1, 1.0)
            from_above = S.mult[j] if found else -1.0
        if abs(from_below - from_above) > 1e-9:
            record_ambiguity(S, R, j, AMB_SEVERAL_ROOTS, 0)
    S.mult[j] = 0.0
    W.instant.group[0] = j
    W.instant.arrival[0] = 0
    return settle_arrivals(P, S, R, W, 1)


@kernel
def settle_together(P, S, R, W, size, joint):
    """Settles the coupled switches group[:joint] from u = 0, of which the first `size` are new; a code."""
    code = settle_friction(P, S, R, W, joint, False)
    if code != NOTHING:
        return code
    code = settle_arrivals(P, S, R, W, joint)
    unique = True
    for a in range(joint):
        unique = unique and S.status[W.instant.active[a]] != HELD
    if code == GO_ON and unique:
        call_others(P.others_unit, P, S, R, W, size, joint)
    return code


@kernel
def _strength(P, S, W, j):
    """How much lambda_j changes g_j, whatever else is solved for following."""
    middle = residual(P, S, W, j, 0.0)
    return max(abs(residual(P, S, W, j, 1.0) - middle), abs(residual(P, S, W, j, -1.0) - middle))


@kernel
def _note_slopes(P, S, W, size):
    """Overwrites instant.faint: which of active[:size] may have no strength, as slopes say, or contacts beside them."""
    slope, faint = W.linear.start, W.instant.faint
    evaluate_surfaces(P, S, W)
    for a in range(size):
        slope[W.instant.active[a]] = W.G[P.g_diagonal[W.instant.active[a]]]
    look_ahead(P, S, W)
    evaluate_surfaces(P, S, W)
    look_back(P, S, W)
    for a in range(size):
        j = W.instant.active[a]
        weaker = abs(slope[j]) <= FAINT * abs(W.G[P.g_diagonal[j]])
        faint[j] = int(weaker or len(P.contact) > 0)


@kernel
def _has_no_strength(P, S, W, j):
    """Whether nothing that switch j does acts on its surface now: it has no load, or another one keeps it there."""
    now = _strength(P, S, W, j)
    look_ahead(P, S, W)
    later = _strength(P, S, W, j)
    look_back(P, S, W)
    return now <= FAINT * later


@kernel
def _settle_without_strength(P, C, S, R, W, j):
    """Switch j at its surface, on which its lambda does not act: it is held as long as nothing moves it, or until its
    strength has grown, or it is carried away; a code."""
    parts = W.instant.parting > 0 and W.instant.drift[j] != 0.0
    if mask_instant(P, S, W):
        follow(P, S, W)
    look_ahead(P, S, W)
    code = GO_ON
    if not parts and is_supported(P, S, W, j):
        hold_at_zero(P, S, R, W, j)
    else:
        code = _one_at_rest(P, S, R, W, j)
    lam = S.mult[j]
    look_back(P, S, W)
    S.mult[j] = lam
    S.deflate[j] = 0
    if S.status[j] == SOLVED:
        S.status[j], S.deflate[j] = HELD, GROWS
    elif S.status[j] != HELD and parts:
        S.status[j] = 1 if W.instant.drift[j] > 0.0 else -1
        S.mult[j], S.deflate[j] = float(S.status[j]), W.instant.parting
    elif S.status[j] != HELD:
        S.deflate[j] = max(1, abs(order_of_leaving(P, C, S, W, j)))
    return code


@kernel
def settle_at_rest(P, C, S, R, W, size):
    """Settles the switches active[:size], at rest on their surfaces: jointly where coupled, else one by one; last those
    that have no strength."""
    instant, strong, count = W.instant, 0, 0
    for a in range(size):
        S.mult[instant.active[a]] = 0.0
    size = hold_second_order(P, S, R, W, take_sides(P, C, S, R, W, size, False))
    _note_slopes(P, S, W, size)
    for a in range(size):
        j = instant.active[a]
        if instant.faint[j] and _has_no_strength(P, S, W, j):
            instant.weak[count] = j
            count += 1
        else:
            instant.active[strong] = j
            strong += 1
    for a in range(count):
        instant.active[strong + a] = instant.weak[a]
    code = _settle_strong(P, S, R, W, hold_supported(P, S, R, W, strong))
    for a in range(count):
        one = _settle_without_strength(P, C, S, R, W, instant.weak[a])
        code = code if one == GO_ON else one
    if some_second_order(P):
        hold_beside(P, S, W)
    if code == GO_ON and C.strict and S.ambiguities > 0:
        return Outcome.AMBIGUITY
    return code


@kernel
def _settle_strong(P, S, R, W, size):
    """Settles the switches active[:size], at rest on surfaces on which they act; a code."""
    instant = W.instant
    together = False
    for a in range(size):
        if size > 1:
            link(P, S, W, instant.active[a])
            for b in range(size):
                together = together or (a != b and W.linear.linked[instant.active[b]] != 0)
    code = GO_ON
    if together:
        for a in range(size):
            instant.group[a] = instant.active[a]
            instant.arrival[a] = 0
        code = settle_together(P, S, R, W, size, size)
    else:
        for a in range(size):
            one = _one_at_rest(P, S, R, W, instant.active[a])
            code = code if one == GO_ON else one
    return code


@kernel
def _has_room(P, S, W, j, k, side):
    """By how much the lambda of switch k may change in the way that keeps switch j from leaving to `side`; of one with
    a hidden term 1 if a small change helps, else 0. W.G has the slopes, which are lost."""
    way = side if entry(P.g_row, P.g_col, W.G, j, k) <= 0.0 else -side
    if P.hidden[k] == 0:
        return 1.0 - way * S.mult[k]
    now, keep, room = residual(P, S, W, j, S.mult[j]), S.mult[k], 0.0
    for way in range(-1, 2, 2):
        S.mult[k] = keep + way * _NUDGE
        if abs(S.mult[k]) <= 1.0 and side * (residual(P, S, W, j, S.mult[j]) - now) < 0.0:
            room = 1.0
    S.mult[k] = keep
    return room


@kernel
def hand_over(P, S, R, W, j, side):
    """Switch j, which sticks together with others that are HELD, can hold no more on the way to `side`: the one with
    the most room is solved for in its place. A code, NOTHING if none has any; then those at their bounds leave as j."""
    best, room, inside = -1, _SAME, _INSIDE_OF_PAIR if P.pair != 0 else _INSIDE
    if not any_is(P, S, HELD):
        return NOTHING
    link(P, S, W, j)
    evaluate_surfaces(P, S, W)
    S.status[j] = HELD
    for k in range(P.m):
        linked = k != j and P.kind[k] == SLIDING and W.linear.linked[k] != 0
        W.instant.weak[k] = int(linked and S.status[k] == HELD and not is_held(P, S, W, k))
    S.status[j] = SOLVED
    for k in range(P.m):
        if W.instant.weak[k]:
            evaluate_surfaces(P, S, W)
            more = _has_room(P, S, W, j, k, side)
            if more > room:
                best, room = k, more
    if best >= 0:
        S.status[j], S.status[best] = HELD, SOLVED
        S.mult[j] = float(side) if abs(S.mult[j]) >= 1.0 - _SAME else S.mult[j] - side * inside
        mask_solved(P, S, W)
        return GO_ON if call_newton(P.newton_unit, P, S, W) != 0 else Outcome.NO_ROOT
    for k in range(P.m):
        if W.instant.weak[k]:
            S.status[k] = 1 if S.mult[k] > 0.0 else -1
            S.mult[k], S.deflate[k] = float(S.status[k]), 1 if P.hidden[k] else 2
            record_event(S, R, k, EV_FOLD if P.hidden[k] else EV_TANGENCY, 0, S.status[k])
    return NOTHING


@kernel
def _let_go(P, C, S, R, W):
    """What switches do that are HELD, and begin to leave their surfaces on the next step; a code."""
    code, size = let_part(P, S, R, W)
    for a in range(size):
        W.instant.kept[0, a] = W.instant.active[a]
    if code == NOTHING:
        code = settle_at_rest(P, C, S, R, W, size)
        for a in range(size):
            j = W.instant.kept[0, a]
            if abs(S.status[j]) == 1:
                record_event(S, R, j, EV_TANGENCY, 0, S.status[j])
    W.instant.parting = 0
    return code


@kernel
def _forget_zeros_jumped_off(P, S, W):
    """Surfaces that have jumped with a switch that is let go are not 0 any more."""
    evaluate_surfaces(P, S, W)
    for j in range(P.m):
        if P.nested[j] != 0 and S.deflate[j] != 0 and abs(W.h[j]) > surface_rounding(P, S, j, W):
            S.deflate[j] = 0


@kernel
def release_held(P, C, S, R, W):
    """Settles the switches held at 0 that nothing holds any more; -1 where there are none, else a code.

    After an accumulation another switch does, which sticks; on a piston at its stop, the closed contact.
    """
    solved, some, size = any_is(P, S, SOLVED), False, 0
    for i in range(P.m + P.ne):
        W.meeting.tau[i] = 2.0
    if W.instant.parting > 0:
        return _let_go(P, C, S, R, W)
    evaluate_surfaces(P, S, W)
    for j in range(P.m):
        if S.status[j] != HELD or P.kind[j] == DISC or P.kind[j] == COMPONENT or S.deflate[j] == GROWS:
            continue
        held = is_held(P, S, W, j) if P.kind[j] == SLIDING else held_by(P, S, W, j) >= 0
        if not held and (P.kind[j] == SLIDING or P.kind[j] == SECOND_ORDER):
            W.instant.active[size] = j
            size += 1
        if P.kind[j] == SLIDING or P.kind[j] == SECOND_ORDER:
            continue
        order = order_of_leaving(P, C, S, W, j)
        if order != 0:
            S.status[j] = 1 if order > 0 else -1
            S.mult[j] = float(S.status[j])
            S.deflate[j] = abs(order)
            if not solved and order_of_leaving(P, C, S, W, j) * order < 0:
                return Outcome.CHATTERING  # it is pushed back, and its mean is not that of one lambda
            record_event(S, R, j, EV_RESET, 0, S.status[j])
            some = True
    if some:
        _forget_zeros_jumped_off(P, S, W)
    size = hold_supported(P, S, R, W, size)
    if size > 0:
        rest_with_friction(P, S)
        return settle_at_rest(P, C, S, R, W, size)
    return GO_ON if some else NOTHING


@kernel
def close_contact(P, S, j, W):
    """Contact j touches at zero speed: closed if it presses (R >= 0), else it opens. True if closed."""
    S.status[j] = SOLVED
    S.mult[j] = 0.0
    mask_solved(P, S, W)
    if call_newton(P.newton_unit, P, S, W) == 0 or S.mult[j] < 0.0:
        S.status[j] = 1
        S.mult[j] = 0.0
        S.deflate[j] = 2
        return False
    return True


@kernel
def _with_those_held(P, S, W, size):
    """Appends to W.instant.group[:size] the switches that are HELD with these, and not by something else."""
    joint = size
    link(P, S, W, W.instant.group[0])
    for k in range(P.m):
        W.instant.weak[k] = int(S.status[k] == HELD and P.kind[k] == SLIDING and W.linear.linked[k] != 0)
    for k in range(P.m):
        if W.instant.weak[k] and not is_supported(P, S, W, k):
            W.instant.group[joint] = k
            joint += 1
    return joint


@kernel
def _follow_slightly(P, S, W):
    """Solves for what slides where that is no more than the rounding of an instant away: its root has not jumped."""
    mask_solved(P, S, W)
    for j in range(P.m):
        W.instant.mult[j] = S.mult[j]
    near = follow(P, S, W)
    for j in range(P.m):
        if W.mask[j] and P.kind[j] == SLIDING:
            moved = abs(S.mult[j] - W.instant.mult[j])
            near = near and moved <= _SLIGHT and abs(S.mult[j]) <= 1.0 + _SAME
    for j in range(0 if near else P.m):
        S.mult[j] = W.instant.mult[j]


@kernel
def _has_no_load(P, S, W, j):
    """Whether the load of switch j has come to an end: its lambda does nothing; reads W.G."""
    return W.G[P.g_diagonal[j]] == 0.0 and _strength(P, S, W, j) == 0.0


@kernel
def let_go_without_load(P, S, R, W):
    """Sticks without a load are no longer solved for, with which nothing else could be: they go where all else does."""
    for j in range(P.m):
        if S.status[j] != SOLVED or P.kind[j] != SLIDING or is_coupled(P, S, W, j):
            continue
        evaluate_surfaces(P, S, W)
        if _has_no_load(P, S, W, j):
            g = residual(P, S, W, j, 0.0)
            S.deflate[j] = int(g != 0.0)
            if g == 0.0:
                hold_at_zero(P, S, R, W, j)
                continue
            S.status[j] = 1 if g > 0.0 else -1
            S.mult[j] = float(S.status[j])
            record_event(S, R, j, EV_RESET, SOLVED, S.status[j])


@kernel
def resettle(P, C, S, R, W):
    """Sliding switches whose residual has jumped follow the layer flow from where they are, coupled ones together.

    Leaves the side of those that slip in S.status; returns a code.
    """
    instant = W.instant
    if mask_instant(P, S, W) and not (solve_unknowns(P, S, W) if instant.jumped else follow(P, S, W)):
        return Outcome.NO_ROOT
    _follow_slightly(P, S, W)
    known = False  # W.g is that of the present multipliers: usually one evaluation serves all switches
    for j in range(P.m):
        if (S.status[j] != SOLVED and S.status[j] != HELD) or P.kind[j] != SLIDING:
            continue
        lam = S.mult[j]
        if abs(lam) > 1.0 + _SAME:
            # What has settled before has solved for it as well, and left it beyond its bound.
            lam = S.mult[j] = math.copysign(1.0, lam)
            known = False
        if not known:
            residual(P, S, W, j, lam)
            call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
            known = True
        g = W.g[j]
        if g == 0.0 and _has_no_load(P, S, W, j):
            hold_at_zero(P, S, R, W, j)
            known = False
            continue
        pushed = abs(g) > 1e-12 * max(1.0, abs(W.G[P.g_diagonal[j]]))
        if not pushed and 1.0 - abs(lam) > _SAME:
            continue
        known = False
        toward = 1 if (g if pushed else lam) > 0.0 else -1
        if take_side(P, C, S, R, W, j, toward, False):
            continue
        S.mult[j] = lam
        if not pushed or follow_by_a_jump(P, S, W, j):
            continue
        size = sliding_with(P, S, W, j)
        code = settle_friction(P, S, R, W, size, False)
        if code == GO_ON or (code == NOTHING and S.status[j] == HELD):
            continue
        if code != NOTHING:
            return code
        size = _with_those_held(P, S, W, size)
        if size > 1:
            for a in range(size):
                instant.arrival[a] = 0
                instant.active[a] = instant.group[a]
            code = settle_arrivals(P, S, R, W, size)
            if code != GO_ON:
                return code
            for a in range(size):
                S.deflate[instant.active[a]] = 1
            continue
        if call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, toward, lam) == 0:
            S.status[j] = toward
            S.mult[j] = float(toward)
            S.deflate[j] = 1
    mask_solved(P, S, W)
    return GO_ON if follow(P, S, W) else Outcome.NO_ROOT
