"""Surfaces at a state: their values, their rates, the first of their derivatives that is not 0.

Chain: pointers.py, sliding.py -> **this file** -> holding.py and all that acts at an instant.
"""

import math

from ..intervals import pace
from ..machine.compiling import inlined_kernel, kernel
from ..machine.pointers import call_act, call_fields, call_linear
from ..state import (
    AMB_AT_ZERO,
    AMB_FORCES,
    ANY,
    BOTH,
    COMPONENT,
    CONTACT,
    CROSSING,
    DISC,
    EV_RESET,
    GROWS,
    HELD,
    KINK,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
)
from ..step.recording import record_ambiguity, record_event
from ..step.steps import take_jet, take_slip_jet
from ..surface.sliding import (
    follow,
    is_memory,
    keep_on_surface,
    mask_instant,
    mask_solved,
    side_at_zero,
    sum_terms,
    surface_rounding,
    surface_size,
)
from ..surface.vector import begins

_HIGHEST = 7  # order with which a surface is left
_NO_SLOPE = 1e-12  # of the terms of g
_ROUNDING = 1e-13  # of the states and what they change by
_SMALL = 1e-6  # of the size of the states over a unit of time: a speed as small may be rounding
MOMENT = 1e-6  # of the unit of time
AT_BOUND = 1e-9  # a multiplier no farther beyond its bound has come to it smoothly
FAINT = 1e-3  # of the strength of a friction a moment later: what is as small now only begins to grow


@kernel
def evaluate_surfaces(P, S, W):
    """Overwrites W.dx, W.h, W.g, W.G, W.dh at the present state."""
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)


@kernel
def any_is(P, S, status):
    """Whether some multiplier has this status."""
    for j in range(P.m):
        if S.status[j] == status:
            return True
    return False


@kernel
def any_kind(P, kind):
    """Whether some multiplier is of this kind."""
    for j in range(P.m):
        if P.kind[j] == kind:
            return True
    return False


@kernel
def is_growing(P, S):
    """Whether something is HELD whose friction has no strength yet, and grows."""
    for j in range(P.m):
        if S.status[j] == HELD and S.deflate[j] == GROWS:
            return True
    return False


@inlined_kernel
def rests_along(P, S, W, k):
    """Whether switch k is on its surface to rounding, without having met it: it comes there with another one."""
    if P.kind[k] != SLIDING or abs(S.status[k]) != 1 or S.deflate[k] != 0 or W.instant.hit[k]:
        return False
    return abs(W.h[k]) <= surface_rounding(P, S, k, W)


@kernel
def residual(P, S, W, j, lam):
    """g_j at lambda_j = lam with the multipliers of every instant solved along; S.mult[j] is left as it was."""
    keep = S.mult[j]
    S.mult[j] = lam
    if mask_instant(P, S, W):
        follow(P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    S.mult[j] = keep
    return W.g[j]


@kernel
def approach_speed(P, S, j, W):
    """dh_j/dt with the present field; leaves in W.instant.rest_speed the size at which it is rounding: of what its
    terms add up to, which is looked at where the speed is small beside the states."""
    evaluate_surfaces(P, S, W)
    speed, per_time = W.dh[P.dh_row[P.m + P.ne] + j], 1.0 / pace(S)
    terms = abs(speed) + per_time
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        part = W.dh[e] * W.dx[P.dh_col[e]]
        speed += part
        terms += abs(part) + abs(W.dh[e]) * per_time * W.size[P.dh_col[e]]
    if abs(speed) <= _SMALL * terms:
        sum_terms(P, S, W, 0.0)
        for e in range(P.dh_row[j], P.dh_row[j + 1]):
            terms += abs(W.dh[e]) * W.terms[P.dh_col[e]]
    W.instant.rest_speed = _ROUNDING * terms
    return speed


@kernel
def arc_ahead(P, S, W, j):
    """Time until surface j, just met, is met again: as before, or a parabola's where d2h/dt2 is known; fills W.dx."""
    speed = approach_speed(P, S, j, W)
    if P.kind[j] != SECOND_ORDER or not speed * W.g[j] < 0.0:
        return S.last[j, 1]
    return min(S.last[j, 1], -2.0 * speed / W.g[j])


@kernel
def _size_within(P, S, W, j, h):
    """The size of what surface j is made of, and of what its states change by within h, whatever cancels."""
    evaluate_surfaces(P, S, W)
    sum_terms(P, S, W, h)
    size = surface_size(P, S, j, W)
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        if abs(W.dh[e]) < math.inf:
            size += abs(W.dh[e]) * (W.sizes[P.dh_col[e]] + W.terms[P.dh_col[e]] * h)
    return size


@kernel
def leading_order(P, C, S, W, i):
    """Number of leading zero orders of surface i, on which S stands, on the slip trajectory; negative if it goes there.

    +1 means a nonzero first derivative, +2 a nonzero second one, ..., +4 zero as far as it looks (without jets: the
    first derivative). The value itself is 0 by definition, within what the series say that met it.
    """
    if P.jet_slip == 0:
        speed = approach_speed(P, S, i, W)
        return 4 if abs(speed) <= W.instant.rest_speed else (1 if speed > 0.0 else -1)
    if take_slip_jet(P, C, S, W) != 0:
        speed = approach_speed(
            P, S, i, W
        )  # a selection stands between its branches: there is no slip trajectory
        return 4 if abs(speed) <= W.instant.rest_speed else (1 if speed > 0.0 else -1)
    row, h = W.step.rows[P.rows_slip[i]], pace(S)
    size, power = _size_within(P, S, W, i, h), 1.0
    for order in range(1, 4):
        power *= h
        for e in range(P.dh_row[i], P.dh_row[i + 1]):
            if abs(W.dh[e]) < math.inf:
                size += abs(W.dh[e] * W.step.rows[P.dh_col[e], order]) * power
        if abs(row[order]) * power > 1e-12 * size:
            return order if row[order] > 0.0 else -order
    return 4


@kernel
def look_ahead(P, S, W):
    """Moves S a moment along the present motion; what it was stands in W.moment until `look_back`."""
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    W.moment[P.n + P.m] = S.t
    for i in range(P.n):
        W.moment[i] = S.x[i]
        S.x[i] += MOMENT * S.unit * W.dx[i]
    for j in range(P.m):
        W.moment[P.n + j] = S.mult[j]
    S.t += MOMENT * S.unit


@kernel
def look_back(P, S, W):
    """Puts states, time and multipliers back where they were before `look_ahead`."""
    S.t = W.moment[P.n + P.m]
    for i in range(P.n):
        S.x[i] = W.moment[i]
    for j in range(P.m):
        S.mult[j] = W.moment[P.n + j]


@kernel
def _order_of_speed(P, S, W, j):
    """As `order_of_leaving`, from the speed of surface j now and a moment later: 1 or 2, or 0 where it has none.

    With an unknown in it the surface has no gradient that tells its speed: it is looked at a moment later.
    """
    if P.nested[j] != 0:
        evaluate_surfaces(P, S, W)
        before, rounding = W.h[j], surface_rounding(P, S, j, W)
        look_ahead(P, S, W)
        mask_solved(P, S, W)
        follow(P, S, W)
        evaluate_surfaces(P, S, W)
        gain = W.h[j] - before
        look_back(P, S, W)
        return 0 if abs(gain) <= rounding else 1 if gain > 0.0 else -1
    speed = approach_speed(P, S, j, W)
    if abs(speed) > W.instant.rest_speed:
        return 1 if speed > 0.0 else -1
    look_ahead(P, S, W)
    speed = approach_speed(P, S, j, W)
    look_back(P, S, W)
    if abs(speed) <= W.instant.rest_speed:
        return 0
    return 2 if speed > 0.0 else -2


@kernel
def _term_within(row, bound, h):
    """h, or the shorter time within which no term of this series is larger than `bound`."""
    for k in range(1, _HIGHEST):
        if 0.0 < bound < abs(row[k]) * h**k:
            h = (bound / abs(row[k])) ** (1.0 / k)
    return h


@kernel
def _within_series(P, S, W, first, h):
    """h, or the shorter time within which the series of states, and of what is solved for from row `first` on, do not
    grow: farther on the terms of a surface that cancel leave large roundings."""
    rows = W.step.rows
    for i in range(P.n):
        h = _term_within(rows[i], W.sizes[i], h)
    for j in range(P.m):
        if S.status[j] == SOLVED and P.kind[j] != DISC:
            row, bounded = rows[first + j], P.kind[j] == SLIDING or P.kind[j] == COMPONENT
            h = _term_within(row, 1.0 if bounded else abs(row[0]) + abs(row[1]) * h + abs(row[2]) * h**2, h)
    return h


@kernel
def order_of_leaving(P, C, S, W, j):
    """Number of leading zero orders of surface j, whose switch is held, on the motion as it goes on; 0 if it stays.

    Negative if it goes there. Those of the slip trajectory where nothing can slide, or where there are no series.
    """
    if P.jet_general == 0:
        return _order_of_speed(P, S, W, j)
    mask_solved(P, S, W)
    first = take_jet(P, C, S, True, W) if follow(P, S, W) else -1
    if first < 0:
        return 0
    row, h, power, finite = W.step.rows[P.rows_general[j]], pace(S), 1.0, 0.0
    made = _size_within(P, S, W, j, h)
    shorter = _within_series(P, S, W, first, h)
    if shorter < h:
        h, made = shorter, _size_within(P, S, W, j, shorter)
    size, rounding = 1e-3 * made, _ROUNDING * made
    for k in range(1, _HIGHEST):
        power *= h
        size, finite = max(size, abs(row[k]) * power), finite + 0.0 * row[k]
    if finite != 0.0:
        return _order_of_speed(P, S, W, j)  # a power has its branch point here
    power = 1.0
    for k in range(1, _HIGHEST):
        power *= h
        # A bound is met within its tolerance, and leaves as much where an order vanishes.
        if abs(row[k]) * power > max(1e-9 * size, rounding):
            return k if row[k] > 0.0 else -k
    return 0


@kernel
def order_at_rest(P, C, S, W, j):
    """With how many zero orders surface j, on which S stands, is left, negative downwards; and whether it stays 0."""
    if any_is(P, S, SOLVED):
        order = order_of_leaving(P, C, S, W, j)
        return order, order == 0
    order = leading_order(P, C, S, W, j)
    return order, abs(order) == 4


@kernel
def _is_borne(P, S, W, j, lam):
    """Whether what holds the motion can hold it with the multiplier of switch j at lam: it could not come to rest with
    a value that lets it go."""
    if not any_is(P, S, SOLVED):
        return True
    keep = S.mult[j]
    for i in range(P.m):
        W.arc.mult_before[i] = S.mult[i]
    S.mult[j] = lam
    mask_solved(P, S, W)
    borne = follow(P, S, W)
    for i in range(P.m):
        if S.status[i] == SOLVED and P.kind[i] <= DISC:
            borne = borne and abs(S.mult[i]) <= max(1.0 - AT_BOUND, abs(W.arc.mult_before[i]) + AT_BOUND)
        elif S.status[i] == SOLVED and P.kind[i] == CONTACT:
            borne = borne and S.mult[i] >= min(0.0, W.arc.mult_before[i])
    for i in range(P.m):
        S.mult[i] = W.arc.mult_before[i]
    S.mult[j] = keep
    return borne


@kernel
def stays_at_zero(P, S, R, W, j):
    """Switch j stands on its surface and stays there: its multiplier becomes what conditions say of 0.

    False where they say different things, of which an ambiguity tells, and where what holds the motion cannot hold it
    so: the side remains from which it came. The multiplier of a Switch of the user's is 0, as a sign's, and an
    ambiguity tells that it could be another.
    """
    at = side_at_zero(P, S, j)
    if at == ANY and P.kind[j] != CROSSING:
        return False
    if at == BOTH or ((at == 0 or at == ANY) and P.jet_general == 0):
        record_ambiguity(S, R, j, AMB_AT_ZERO, 0)
        return False
    some = at == ANY
    at = 0 if some else at
    if not _is_borne(P, S, W, j, float(at)):
        return False
    if some:
        record_ambiguity(S, R, j, AMB_FORCES, 0)
    S.status[j], S.mult[j] = at if at != 0 else HELD, float(at)
    return True


@kernel
def is_supported(P, S, W, j):
    """Whether contacts and the like keep switch j on its surface, whatever its lambda is and those of others are."""
    most = max(abs(residual(P, S, W, j, 1.0)), abs(residual(P, S, W, j, -1.0)))
    evaluate_surfaces(P, S, W)
    terms = 0.0
    for e in range(P.g_row[j], P.g_row[j + 1]):
        terms += abs(W.G[e]) * (1.0 if P.g_col[e] == j else abs(S.mult[P.g_col[e]]))
    return most <= _NO_SLOPE * terms


@kernel
def hold_at_zero(P, S, R, W, j):
    """Holds switch j, which something else keeps on its surface, with what conditions say of 0, or 0 where they say
    nothing, different things, or what the motion is not held with."""
    at = side_at_zero(P, S, j)
    if at == BOTH:
        record_ambiguity(S, R, j, AMB_AT_ZERO, 0)
    S.status[j] = HELD
    S.mult[j] = float(at) if abs(at) == 1 and _is_borne(P, S, W, j, float(at)) else 0.0


@kernel
def _sum_of_nested(P, W):
    """A number that changes with any surface in which multipliers stand."""
    total = 0.0
    for i in range(P.m + P.ne):
        total += (1.0 + 0.1 * i) * W.h[i] if P.nested[i] != 0 else 0.0
    return total


@kernel
def _moves_surfaces(P, S, W, j):
    """Whether another surface changes where switch j takes the side that it has at 0."""
    came, at = S.mult[j], side_at_zero(P, S, j)
    if at == ANY or at == BOTH or float(at) == came:
        return False
    S.mult[j] = float(at)
    evaluate_surfaces(P, S, W)
    there = _sum_of_nested(P, W)
    S.mult[j] = came
    evaluate_surfaces(P, S, W)
    return there != _sum_of_nested(P, W)


@kernel
def settle_beside(P, C, S, R, W):
    """Switches that come to rest on their surfaces with what has come to rest are what conditions say of 0; False,
    with nothing changed, where what is solved for has no root, or a disc begins to slip: that is settled first."""
    for j in range(P.m):
        if begins(P, S, j):
            return False
        W.arc.mult_before[j] = S.mult[j]
    mask_solved(P, S, W)
    if not follow(P, S, W):
        for j in range(P.m):
            S.mult[j] = W.arc.mult_before[j]
        return False
    evaluate_surfaces(P, S, W)
    for k in range(P.m):
        crosses = P.kind[k] == CROSSING or P.kind[k] == KINK
        if not crosses or abs(S.status[k]) != 1 or abs(W.h[k]) > surface_rounding(P, S, k, W):
            continue
        if P.kind[k] == KINK and not _moves_surfaces(P, S, W, k):
            continue
        rests = P.nested[k] != 0 or abs(approach_speed(P, S, k, W)) <= W.instant.rest_speed
        if rests and order_of_leaving(P, C, S, W, k) == 0 and rests_at_zero(P, S, R, W, k):
            W.instant.hit[k] = False
        evaluate_surfaces(P, S, W)
    return True


@kernel
def rests_at_zero(P, S, R, W, j):
    """As `stays_at_zero`; records what becomes of the switch."""
    came = S.status[j]
    if not stays_at_zero(P, S, R, W, j):
        return False
    if S.status[j] != came:
        record_event(S, R, j, EV_RESET, came, S.status[j] if S.status[j] != HELD else 0)
    return True


@kernel
def note_rests_along(P, S, R, W, j, came):
    """Records the switches that come to rest on their surfaces with j, which sticks, and do not act on it themselves:
    what they are on average, as sign(sin x) beside sign(x), nothing says."""
    if not any_kind(P, CROSSING):
        return
    held = S.mult[j]
    for k in range(P.m):
        if P.kind[k] != CROSSING or abs(S.status[k]) != 1:
            continue
        if abs(approach_speed(P, S, k, W)) > W.instant.rest_speed or abs(W.h[k]) > surface_rounding(P, S, k, W):
            continue
        S.mult[j] = float(came)
        if abs(approach_speed(P, S, k, W)) > W.instant.rest_speed:
            record_ambiguity(S, R, k, AMB_FORCES, 0)
        S.mult[j] = held


@kernel
def stop_normal_speed(P, S, j, W, contact):
    """Removes what is left of dh_j/dt: through the impact map for a contact, along its own gradient for a switch."""
    if contact:
        speed = approach_speed(P, S, j, W)
        for i in range(P.n):
            W.contacts.before[i] = S.x[i]
            W.contacts.after[i] = S.x[i]
        call_act(P.act, P.ne + j, S.t, S.x, S.mult, P.p, W.contacts.after)
        for i in range(P.n):
            S.x[i] = W.contacts.after[i]
        rebound = approach_speed(P, S, j, W)
        # The impact map is affine in its impulse: the share of it that leaves dh/dt = 0.
        share = speed / (speed - rebound) if speed != rebound else 0.0
        for i in range(P.n):
            S.x[i] = W.contacts.before[i] + share * (W.contacts.after[i] - W.contacts.before[i])
        return
    # dh/dt = dh . f(x): its gradient by differences, minimum-norm Newton, twice.
    for _ in range(2):
        speed = approach_speed(P, S, j, W)
        square = 0.0
        for i in range(P.n):
            if is_memory(P, i):
                W.instant.gradient[i] = 0.0
                continue
            keep = S.x[i]
            step = 1e-6 * (1.0 + abs(keep))
            S.x[i] = keep + step
            W.instant.gradient[i] = (approach_speed(P, S, j, W) - speed) / step
            S.x[i] = keep
            square += W.instant.gradient[i] ** 2
        if square == 0.0:
            return
        for i in range(P.n):
            S.x[i] -= W.instant.gradient[i] * speed / square


@kernel
def keep_sliding(P, S, j, W):
    """Puts S.x exactly on h_j = 0, of a second-order slide on dh_j/dt = 0 too."""
    keep_on_surface(P, S, j, W)
    if P.kind[j] == SECOND_ORDER and abs(approach_speed(P, S, j, W)) > W.instant.rest_speed:
        stop_normal_speed(P, S, j, W, False)


@kernel
def keep_surfaces(P, S, W):
    """Puts S.x on the surfaces of all switches that hold: first where that says what states are, which others leave."""
    others = False
    for turn in range(2):
        for j in range(P.m):
            held = S.status[j] == HELD and (P.kind[j] == KINK or P.kind[j] == CROSSING)
            if not held and (S.status[j] != SOLVED or P.kind[j] >= DISC):
                continue
            if (P.surface_state[j] >= 0) == (turn == 0):
                keep_sliding(P, S, j, W)
            else:
                others = True
        if not others:
            break
