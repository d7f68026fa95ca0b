"""Settling switches and contacts that are on their surfaces: what the start, resets and accumulation points share."""

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_layer_unit, call_newton
from ..outcome import Outcome
from ..state import (
    AMB_CORNER,
    AMB_HIDDEN_OSCILLATION,
    AMB_REPELLING,
    AMB_SEVERAL_ROOTS,
    EV_RESET,
    GO_ON,
    HELD,
    NOTHING,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
)
from ..step.recording import record_ambiguity, record_event
from ..surface.fast import LOST, OSCILLATES, SETTLED
from ..surface.layer import ARRIVE, FIRST_ZERO
from ..surface.sliding import follow, mask_instant, mask_solved
from ..surface.sparse import link
from ..surface.unknowns import solve_unknowns
from .holding import (
    held_by,
    hold_beside,
    hold_second_order,
    hold_supported,
    rest_with_friction,
    some_second_order,
)
from .surface_rates import any_is, evaluate_surfaces, leading_order, residual

_MOST_CORNERS, _BESIDE_CORNER = 8, 0.999


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
    return layer_code(P, S, R, j, call_layer_unit(P.layer_unit, P, S, W, ARRIVE, size, 0, 0.0))


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
def _one_motion(P, S, W, size):
    """Whether g is affine in the switches active[:size], with a definite slope: then one motion begins here.

    So it is with Coulomb friction between bodies. Overwrites S.mult.
    """
    active, M, value = W.instant.active, W.linear.matrix, W.linear.rhs
    if size > M.shape[0] or mask_instant(P, S, W):
        return False
    for a in range(size):
        S.mult[active[a]] = 0.0
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for a in range(size):
        value[a] = W.g[active[a]]
    for b in range(size):
        S.mult[active[b]] = 1.0
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        S.mult[active[b]] = 0.0
        for a in range(size):
            M[a, b] = value[a] - W.g[active[a]]
    for b in range(size):
        lam = 0.9 * (-0.7) ** b  # anywhere
        S.mult[active[b]] = lam
        for a in range(size):
            value[a] -= M[a, b] * lam
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for a in range(size):
        if abs(W.g[active[a]] - value[a]) > 1e-9 * (abs(value[a]) + abs(M[a, a])):
            return False
    for a in range(size):
        for b in range(a):
            M[a, b] = M[b, a] = 0.5 * (M[a, b] + M[b, a])
    for c in range(size):  # definite if all pivots are positive
        if not M[c, c] > 1e-9 * abs(M[0, 0]):
            return False
        for a in range(c + 1, size):
            share = M[a, c] / M[c, c]
            for b in range(c + 1, size):
                M[a, b] -= share * M[c, b]
    return True


@kernel
def _report_other_motions(P, S, R, W, size, joint):
    """Says so where active[:joint], settled from u = 0, settle otherwise with active[:size] coming from some corner.

    Then several motions begin in this point, and the equations do not say which is taken. S is kept.
    """
    instant = W.instant
    for j in range(P.m):
        instant.status[j] = S.status[j]
        instant.mult[j] = S.mult[j]
    confirmed = _one_motion(P, S, W, joint)
    flipped, other = -1, -1
    for corner in range(0 if confirmed else min(1 << size, _MOST_CORNERS)):
        for j in range(P.m):
            S.status[j] = instant.status[j]
            S.mult[j] = instant.mult[j]
        for a in range(joint):
            j = instant.active[a]
            instant.group[a] = j
            instant.arrival[a] = 0
            if a < size:
                # A corner and then the one opposite: those count most where there are more than are tried.
                S.mult[j] = _BESIDE_CORNER if ((corner >> 1) >> a & 1) == (corner & 1) else -_BESIDE_CORNER
        outcome = call_layer_unit(P.layer_unit, P, S, W, ARRIVE, joint, 0, 0.0)
        same = True
        for a in range(joint):
            j = instant.active[a]
            near = abs(S.mult[j] - instant.mult[j]) <= (1e-6 if outcome == SETTLED else 1e-3)
            here = near and (S.status[j] == instant.status[j] or outcome == OSCILLATES)
            same = same and here
            if not here:
                other = j
                leaves = S.status[j] != SOLVED and S.status[j] != instant.status[j]
                flipped = j if leaves and outcome != OSCILLATES else flipped
        confirmed = confirmed or same
    for j in range(P.m):
        S.status[j] = instant.status[j]
        S.mult[j] = instant.mult[j]
    if flipped >= 0:
        record_ambiguity(S, R, flipped, AMB_REPELLING, S.status[flipped])
    elif other >= 0:
        record_ambiguity(S, R, other, AMB_CORNER, 0)
    elif not confirmed:
        # An equilibrium to which the layer comes from nowhere: it stays there only if it begins there.
        record_ambiguity(S, R, instant.active[0], AMB_REPELLING, 0)


@kernel
def settle_together(P, S, R, W, size, joint):
    """Runs the layer of the coupled switches group[:joint] from u = 0, of which the first `size` are new; a code."""
    code = settle_arrivals(P, S, R, W, joint)
    if code == GO_ON:
        _report_other_motions(P, S, R, W, size, joint)
    return code


@kernel
def settle_at_rest(P, C, S, R, W, size):
    """Settles the switches active[:size], at rest on their surfaces: jointly where coupled, else one by one."""
    instant = W.instant
    for a in range(size):
        S.mult[instant.active[a]] = 0.0
    size = hold_supported(P, S, W, hold_second_order(P, S, R, W, size))
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
    if some_second_order(P):
        hold_beside(P, S, W)
    if code == GO_ON and C.strict and S.ambiguities > 0:
        return Outcome.AMBIGUITY
    return code


@kernel
def release_held(P, C, S, R, W):
    """Settles the switches held at 0 that nothing holds any more; -1 where there are none, else a code.

    After an accumulation another switch does, which sticks; on a piston at its stop, the closed contact.
    """
    solved, some, size = any_is(P, S, SOLVED), False, 0
    evaluate_surfaces(P, S, W)
    for i in range(P.m + P.ne):
        W.meeting.tau[i] = 2.0
    for j in range(P.m):
        if S.status[j] != HELD:
            continue
        if P.kind[j] == SLIDING or (P.kind[j] == SECOND_ORDER and held_by(P, S, W, j) < 0):
            W.instant.active[size] = j
            size += 1
        if P.kind[j] == SLIDING or P.kind[j] == SECOND_ORDER:
            continue
        order = leading_order(P, C, S, W, j)
        # The series is that of fixed multipliers: of solved ones it knows the first derivative that they act on.
        if abs(order) <= (2 if solved else 3):
            S.status[j] = 1 if order > 0 else -1
            S.mult[j] = float(S.status[j])
            S.deflate[j] = abs(order)
            if leading_order(P, C, S, W, j) * order < 0:
                return Outcome.CHATTERING  # it is pushed back, and its mean is not that of one lambda
            record_event(S, R, j, EV_RESET, 0, S.status[j])
            some = True
    size = hold_supported(P, S, W, size)
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
def resettle(P, S, R, W):
    """Sliding switches whose residual has jumped follow the layer flow from where they are, coupled ones together.

    Leaves the side of those that slip in S.status; returns a code.
    """
    instant = W.instant
    if mask_instant(P, S, W) and not (solve_unknowns(P, S, W) if instant.jumped else follow(P, S, W)):
        return Outcome.NO_ROOT
    known = False  # W.g is that of the present multipliers: usually one evaluation serves all switches
    for j in range(P.m):
        if S.status[j] != SOLVED or P.kind[j] != SLIDING:
            continue
        lam = S.mult[j]
        if not known:
            residual(P, S, W, j, lam)
            known = True
        g = W.g[j]
        if abs(g) <= 1e-12:
            continue
        known = False
        size = _sliding_with(P, S, W, j)
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
        toward = 1 if g > 0.0 else -1
        if call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, toward, lam) == 0:
            S.status[j] = toward
            S.mult[j] = float(toward)
            S.deflate[j] = 1
    mask_solved(P, S, W)
    return GO_ON if follow(P, S, W) else Outcome.NO_ROOT


@kernel
def _sliding_with(P, S, W, j):
    """Overwrites W.instant.group by switch j and the sliding ones that act on it or it on them; returns how many."""
    link(P, S, W, j)
    size = 0
    for i in range(P.m):
        if W.linear.linked[i] and S.status[i] == SOLVED and P.kind[i] == SLIDING:
            W.instant.group[size] = i
            size += 1
    return size
