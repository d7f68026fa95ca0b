"""What holds the motion on a surface at rest beside, or in the place of, that surface's own multiplier.

A closed contact holds a piston at its stop whatever friction does there. A switch of relative degree 2 holds
h = dh/dt = 0 with a lambda between its bounds, sliding to second order, as a closed contact does with its reaction: a
relay that holds a position. Friction on the same body may hold with it; of two that hold one motion one knows its
lambda, and the other one is HELD with what it has. A field that vanishes beyond a bound keeps the motion on the bound
by itself: the switch is on that side.
Chain: settling.py, instants.py -> **this file** -> surface_rates.py, sliding.py.
"""

from ..machine.compiling import inlined_kernel, kernel
from ..state import AMB_REPELLING, EV_RESET, EV_STICK, HELD, SECOND_ORDER, SLIDING, SOLVED
from ..step.recording import record_ambiguity, record_event
from ..surface.sliding import follow, keep_on_surface, mask_instant, mask_solved, surface_rounding
from ..surface.sparse import entry, link
from .surface_rates import (
    AT_BOUND,
    approach_speed,
    evaluate_surfaces,
    hold_at_zero,
    is_supported,
    order_of_leaving,
    residual,
)

AGAIN = 2  # instants at one time: where a field vanishes, and is not rounding, its surface is not met again


@kernel
def hold_supported(P, S, R, W, size):
    """Holds at 0 those of W.instant.active[:size] whose surface is kept at 0 whatever their lambda is.

    By a closed contact, as a piston at its stop, or by a second-order slide: lambda is what conditions say of 0.
    Returns the size without them.
    """
    rest = 0
    for a in range(size):
        j = W.instant.active[a]
        if is_supported(P, S, W, j):
            hold_at_zero(P, S, R, W, j)
        else:
            W.instant.active[rest] = j
            rest += 1
    return rest


@kernel
def hold_what_contacts_keep(P, S, R, W):
    """Holds switches that could slide, on whose surfaces a contact that has just closed keeps the motion."""
    mask_solved(P, S, W)
    if not follow(P, S, W):
        return
    for j in range(P.m):
        slides = P.kind[j] == SLIDING or P.kind[j] == SECOND_ORDER
        if not slides or abs(S.status[j]) != 1:
            continue
        evaluate_surfaces(P, S, W)
        if abs(W.h[j]) <= surface_rounding(P, S, j, W) and is_supported(P, S, W, j):
            came = S.status[j]
            hold_at_zero(P, S, R, W, j)
            record_event(S, R, j, EV_STICK, came, 0)


@kernel
def _order_on(P, C, S, W, j, side):
    """As order_of_leaving, by the field of one side of surface j."""
    S.status[j], S.mult[j] = side, float(side)
    speed = approach_speed(P, S, j, W)
    if abs(speed) > W.instant.rest_speed:
        return 1 if speed > 0.0 else -1
    return order_of_leaving(P, C, S, W, j)


@kernel
def is_coupled(P, S, W, j):
    """Whether something else that is solved for, held or just met acts on switch j, or it on that."""
    link(P, S, W, j)
    for k in range(P.m):
        alone = abs(S.status[k]) == 1 and (P.kind[k] != SLIDING or not W.instant.hit[k])
        if k != j and W.linear.linked[k] and not alone:
            return True
    return False


@kernel
def take_side(P, C, S, R, W, j, far, met):
    """Whether switch j, on its surface, takes a side because the field there does not move the surface at once.

    It stays on the surface where that of one side never does and the other one leads back, as at the limit of an
    integrator; where both fields vanish together, as at its release, it goes where both lead. `met`: from -far.
    """
    if P.hidden[j] != 0 or P.nested[j] != 0 or is_coupled(P, S, W, j):
        return False
    status, mult, side = S.status[j], S.mult[j], 0
    back, ahead = far * _order_on(P, C, S, W, j, -far), far * _order_on(P, C, S, W, j, far)
    if ahead == 0 or ahead > 1:
        if back > 0 or (back == 0 and met) or (ahead == 0 and back < -1):
            side = far
        elif back == 0 and ahead > 1:
            side = -far
    elif ahead < 0 and (back == 0 or max(ahead, back) < -1):
        side = -far
    if side == 0 or (S.stalled > AGAIN and (back == 0 or ahead == 0)):
        S.status[j], S.mult[j] = status, mult
        return False
    if (ahead == 0 and back < -1) or (back == 0 and ahead > 1 and not met):
        record_ambiguity(S, R, j, AMB_REPELLING, side)
    order = ahead if side == far else back
    S.status[j], S.mult[j], S.deflate[j] = side, float(side), max(abs(order), 1)
    keep_on_surface(P, S, j, W)
    return True


@kernel
def take_sides(P, C, S, R, W, size, met):
    """Settles those of W.instant.active[:size] that take a side so, and puts them behind the rest; how many remain."""
    rest = 0
    for a in range(size):
        j = W.instant.active[a]
        came = S.status[j] if abs(S.status[j]) == 1 else -1
        if not take_side(P, C, S, R, W, j, -came, met):
            W.instant.active[a], W.instant.active[rest] = W.instant.active[rest], j
            rest += 1
    return rest


@kernel
def rest_with_friction(P, S):
    """A contact that has just opened smoothly is not left so, where friction now holds what the contact held."""
    for c in range(len(P.contact)):
        S.deflate[P.contact[c]] = min(S.deflate[P.contact[c]], 2)


@kernel
def _leave(S, j, side, order):
    """Sets switch j to a side that it leaves to, `order` derivatives of its surface, from the zeroth on, being 0."""
    S.status[j] = side
    S.mult[j] = float(side)
    S.deflate[j] = order


@inlined_kernel
def some_second_order(P):
    """Whether the model has a switch that can slide to second order."""
    for j in range(P.m):
        if P.kind[j] == SECOND_ORDER:
            return True
    return False


@kernel
def hold_second_order(P, S, R, W, size):
    """Settles those of W.instant.active[:size] that can slide to second order; returns the size without them.

    With h = dh/dt = 0 such a switch stays where lambda between its bounds keeps d2h/dt2 = 0, as a closed contact does
    with its reaction, and leaves to the side of the bound where it would take more. Where a contact holds the motion
    it has nothing to hold.
    """
    instant = W.instant
    count, rest = 0, 0
    for a in range(size):
        j = instant.active[a]
        if P.kind[j] == SECOND_ORDER:
            if len(P.contact) > 0 and is_supported(P, S, W, j):
                hold_at_zero(P, S, R, W, j)
            else:
                S.status[j], S.mult[j] = SOLVED, 0.0
                instant.group[count] = j
                count += 1
        else:
            instant.active[rest] = j
            rest += 1
    if count == 0:
        return rest
    for a in range(count):
        j = instant.group[a]
        speed = approach_speed(P, S, j, W)
        slope = W.G[P.g_diagonal[j]]
        if abs(speed) > instant.rest_speed:
            _leave(S, j, 1 if speed > 0.0 else -1, 1)
        elif not slope < 0.0:
            force = residual(P, S, W, j, 0.0)
            side = 1 if force >= 0.0 else -1
            if slope > 0.0 and abs(force) <= slope:
                record_ambiguity(S, R, j, AMB_REPELLING, side)
            _leave(S, j, side, 2)
    for _ in range(count):
        mask_instant(P, S, W)
        if not follow(P, S, W):
            for a in range(count):
                j = instant.group[a]
                if S.status[j] == SOLVED:
                    S.status[j] = HELD  # two that hold one motion: neither has a lambda of its own
                    S.mult[j] = 0.0
            return rest
        most, worst = 1.0, -1
        for a in range(count):
            j = instant.group[a]
            if S.status[j] == SOLVED and abs(S.mult[j]) > most:
                most, worst = abs(S.mult[j]), j
        if worst < 0:
            break
        _leave(S, worst, 1 if S.mult[worst] > 0.0 else -1, 3 if most <= 1.0 + AT_BOUND else 2)
    return rest


@kernel
def held_by(P, S, W, k):
    """A switch that sticks, and keeps at rest what switch k at its own surface would move; -1 if there is none."""
    for j in range(P.m):
        if P.kind[j] == SLIDING and (S.status[j] == SOLVED or S.status[j] == HELD):
            if entry(P.g_row, P.g_col, W.G, k, j) != 0.0:
                return j
    return -1


@kernel
def hold_beside(P, S, W):
    """Switches that could slide to second order, but which friction keeps at their surface: held with their lambda.

    As a relay at its bound beside the friction on its body. Of two that hold one motion one has to know its lambda.
    """
    evaluate_surfaces(P, S, W)
    for k in range(P.m):
        if P.kind[k] != SECOND_ORDER or abs(S.status[k]) != 1 or abs(W.h[k]) > surface_rounding(P, S, k, W):
            continue
        j = held_by(P, S, W, k)
        still = j >= 0 and abs(W.g[k]) <= 1e-9 * abs(entry(P.g_row, P.g_col, W.G, k, j))
        if still and abs(approach_speed(P, S, k, W)) <= W.instant.rest_speed:
            S.status[k] = HELD


@kernel
def hold_instead(P, S, R, W, j):
    """Whether switches that have been held beside switch j, which slips now, keep it at rest; it is held then."""
    instant = W.instant
    evaluate_surfaces(P, S, W)
    size, order = 0, 3 if abs(S.mult[j]) <= 1.0 + AT_BOUND else 2
    for k in range(P.m):
        if S.status[k] == HELD and P.kind[k] == SECOND_ORDER and entry(P.g_row, P.g_col, W.G, k, j) != 0.0:
            W.linear.linked[size] = instant.active[size] = k
            instant.mult[k] = S.mult[k]
            size += 1
    if size == 0:
        return False
    lam = S.mult[j]
    S.status[j], S.mult[j] = HELD, 0.0
    hold_second_order(P, S, R, W, size)
    turned = False
    for a in range(size):
        k = W.linear.linked[a]
        if S.status[k] == SOLVED:
            return True
        turned = turned or S.mult[k] != instant.mult[k]
    S.status[j], S.mult[j] = SOLVED, lam
    if turned:
        # At their other bound they leave it less to hold.
        mask_solved(P, S, W)
        if follow(P, S, W) and abs(S.mult[j]) <= 1.0:
            hold_beside(P, S, W)
            return True
        S.mult[j] = lam
    for a in range(size):
        S.deflate[W.linear.linked[a]] = order
    return False


@kernel
def hold_what_rests(P, S, R, W):
    """After x has jumped: switches on whose surface it stands at rest slide to second order, or slide no longer."""
    instant = W.instant
    size = 0
    for j in range(P.m):
        if P.kind[j] == SECOND_ORDER and instant.hit[j]:
            rests = abs(approach_speed(P, S, j, W)) <= instant.rest_speed
            if rests or S.status[j] == SOLVED or S.status[j] == HELD:
                instant.active[size] = j
                size += 1
    if size == 0:
        return
    hold_second_order(P, S, R, W, size)
    size = 0
    for j in range(P.m):
        if P.kind[j] == SLIDING and S.status[j] == SOLVED:
            instant.active[size] = j
            size += 1
    hold_supported(P, S, R, W, size)
    for j in range(P.m):
        held = S.status[j] == SOLVED or instant.came[j] == SOLVED or instant.came[j] == HELD
        if P.kind[j] == SECOND_ORDER and instant.hit[j] and held:
            instant.hit[j] = False
            if S.status[j] != instant.came[j]:
                record_event(S, R, j, EV_RESET, instant.came[j], S.status[j])
