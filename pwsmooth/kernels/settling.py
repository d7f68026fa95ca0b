"""Settling switches and contacts that are on their surfaces: what the start, resets and accumulation points share."""

from .compiling import inlined_kernel, kernel
from .layer import ARRIVE, FIRST_ZERO, LOST, OSCILLATES, SETTLED
from .pointers import call_act, call_fields, call_layer_unit, call_linear, call_newton
from .records import record_ambiguity, record_event
from .sliding import follow, keep_on_surface, mask_instant, mask_solved, surface_rounding
from .sparse import entry, link
from .state import (
    A_AT_REST,
    AMB_HIDDEN_OSCILLATION,
    AMB_REPELLING,
    AMB_SEVERAL_ROOTS,
    C_AMBIGUITIES,
    C_LAYERS,
    CHATTERING,
    DONE,
    EV_RESET,
    HELD,
    HIDDEN_OSCILLATION,
    I_JUMPED,
    NO_ROOT_FOUND,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
    STRICT,
)
from .steps import take_slip_jet
from .unknowns import solve_unknowns

AT_BOUND = 1e-9  # a multiplier no farther beyond its bound has come to it smoothly


@kernel
def evaluate_surfaces(P, S, W):
    """Overwrites W.dx, W.h, W.g, W.G, W.dh at the present state."""
    call_fields(P.fields, S.now[0], S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.now[0], S.x, S.mult, P.p, W.G, W.dh)


@kernel
def any_solved(P, S):
    for j in range(P.m):
        if S.status[j] == SOLVED:
            return True
    return False


@kernel
def any_held(P, S):
    for j in range(P.m):
        if S.status[j] == HELD:
            return True
    return False


@kernel
def layer_code(P, S, R, j, outcome):
    """The loop's return code for what a layer run ended in."""
    if outcome == OSCILLATES:
        record_ambiguity(S, R, j, AMB_HIDDEN_OSCILLATION, 0)
        return HIDDEN_OSCILLATION
    return NO_ROOT_FOUND if outcome == LOST else DONE


@kernel
def settle_arrivals(P, S, R, W, size):
    """Runs the layer of W.group[:size], come from W.arrival; returns the loop's code."""
    S.counts[C_LAYERS] += 1
    j = W.group[0]
    return layer_code(P, S, R, j, call_layer_unit(P.layer_unit, P, S, W, ARRIVE, size, 0, 0.0))


@kernel
def residual(P, S, W, j, lam):
    """g_j at lambda_j = lam with the multipliers of every instant solved along; S.mult[j] is left as it was."""
    keep = S.mult[j]
    S.mult[j] = lam
    if mask_instant(P, S, W):
        follow(P, S, W)
    call_fields(P.fields, S.now[0], S.x, S.mult, P.p, W.dx, W.h, W.g)
    S.mult[j] = keep
    return W.g[j]


@kernel
def hold_supported(P, S, W, size):
    """Holds at 0 those of W.active[:size] whose surface a closed contact keeps at 0 whatever lambda is.

    As a piston at its stop: lambda and the reaction are not unique there. Returns the size without them.
    """
    rest = 0
    for a in range(size):
        j = W.active[a]
        most = max(abs(residual(P, S, W, j, 1.0)), abs(residual(P, S, W, j, -1.0)))
        evaluate_surfaces(P, S, W)
        if most <= 1e-12 * abs(W.G[P.g_diagonal[j]]):
            S.status[j] = HELD
            S.mult[j] = 0.0
        else:
            W.active[rest] = j
            rest += 1
    return rest


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
        return DONE if follow(P, S, W) else NO_ROOT_FOUND
    if plus > 0.0 and minus < 0.0:
        record_ambiguity(S, R, j, AMB_REPELLING, 1 if middle > 0.0 else -1)
    elif P.hidden[j]:
        up = call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, 1, -1.0)
        high = S.mult[j]
        down = call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, -1, 1.0)
        if up != down or abs(high - S.mult[j]) > 1e-9:
            record_ambiguity(S, R, j, AMB_SEVERAL_ROOTS, 0)
    S.mult[j] = 0.0
    W.group[0] = j
    W.arrival[0] = 0
    return settle_arrivals(P, S, R, W, 1)


@kernel
def _rest_repels(P, S, W, size):
    """Whether the joint rest state on which the switches W.active[:size] stand is left when lambda is moved a bit.

    The layer is run from beside it, along two directions that no stable manifold contains for long. S is kept.
    """
    for j in range(P.m):
        W.keep_status[j] = S.status[j]
        W.keep_mult[j] = S.mult[j]
    repels = False
    for sign in range(-1, 2, 2):
        for j in range(P.m):
            S.status[j] = W.keep_status[j]
            S.mult[j] = W.keep_mult[j]
        shift = 1e-3
        for a in range(size):
            W.group[a] = W.active[a]
            W.arrival[a] = 0
            S.mult[W.active[a]] += shift
            shift *= 0.7 * sign
        settled = call_layer_unit(P.layer_unit, P, S, W, ARRIVE, size, 0, 0.0) == SETTLED
        for j in range(P.m):
            same = S.status[j] == W.keep_status[j] and abs(S.mult[j] - W.keep_mult[j]) < 1e-6
            repels = repels or not (settled and same)
    for j in range(P.m):
        S.status[j] = W.keep_status[j]
        S.mult[j] = W.keep_mult[j]
    return repels


@kernel
def _leave(S, j, side, order):
    """Sets switch j to a side that it leaves to, `order` derivatives of its surface, from the zeroth on, being 0."""
    S.status[j] = side
    S.mult[j] = float(side)
    S.deflate[j] = order


@kernel
def hold_second_order(P, S, R, W, size):
    """Settles those of W.active[:size] that can slide to second order; returns the size without them.

    With h = dh/dt = 0 such a switch stays where lambda between its bounds keeps d2h/dt2 = 0, as a closed contact does
    with its reaction, and leaves to the side of the bound where it would take more.
    """
    count, rest = 0, 0
    for a in range(size):
        j = W.active[a]
        if P.kind[j] == SECOND_ORDER:
            W.group[count] = j
            count += 1
            S.status[j] = SOLVED
            S.mult[j] = 0.0
        else:
            W.active[rest] = j
            rest += 1
    if count == 0:
        return rest
    for a in range(count):
        j = W.group[a]
        speed = approach_speed(P, S, j, W)
        slope = W.G[P.g_diagonal[j]]
        if abs(speed) > W.answer[A_AT_REST]:
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
                j = W.group[a]
                if S.status[j] == SOLVED:
                    S.status[j] = HELD  # two that hold one motion: neither has a lambda of its own
                    S.mult[j] = 0.0
            return rest
        most, worst = 1.0, -1
        for a in range(count):
            j = W.group[a]
            if S.status[j] == SOLVED and abs(S.mult[j]) > most:
                most, worst = abs(S.mult[j]), j
        if worst < 0:
            break
        _leave(S, worst, 1 if S.mult[worst] > 0.0 else -1, 3 if most <= 1.0 + AT_BOUND else 2)
    return rest


@inlined_kernel
def some_second_order(P):
    """Whether the model has a switch that can slide to second order."""
    for j in range(P.m):
        if P.kind[j] == SECOND_ORDER:
            return True
    return False


@kernel
def _holder(P, S, W, k):
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
        j = _holder(P, S, W, k)
        still = j >= 0 and abs(W.g[k]) <= 1e-9 * abs(entry(P.g_row, P.g_col, W.G, k, j))
        if still and abs(approach_speed(P, S, k, W)) <= W.answer[A_AT_REST]:
            S.status[k] = HELD


@kernel
def hold_instead(P, S, R, W, j):
    """Whether switches that have been held beside switch j, which slips now, keep it at rest; it is held then."""
    evaluate_surfaces(P, S, W)
    size, order = 0, 3 if abs(S.mult[j]) <= 1.0 + AT_BOUND else 2
    for k in range(P.m):
        if S.status[k] == HELD and P.kind[k] == SECOND_ORDER and entry(P.g_row, P.g_col, W.G, k, j) != 0.0:
            W.linked[size] = W.active[size] = k
            W.keep_mult[k] = S.mult[k]
            size += 1
    if size == 0:
        return False
    lam = S.mult[j]
    S.status[j], S.mult[j] = HELD, 0.0
    hold_second_order(P, S, R, W, size)
    turned = False
    for a in range(size):
        k = W.linked[a]
        if S.status[k] == SOLVED:
            return True
        turned = turned or S.mult[k] != W.keep_mult[k]
    S.status[j], S.mult[j] = SOLVED, lam
    if turned:
        # At their other bound they leave it less to hold.
        mask_solved(P, S, W)
        if follow(P, S, W) and abs(S.mult[j]) <= 1.0:
            hold_beside(P, S, W)
            return True
        S.mult[j] = lam
    for a in range(size):
        S.deflate[W.linked[a]] = order
    return False


@kernel
def rest_with_friction(P, S):
    """A contact that has just opened smoothly is not left so, where friction now holds what the contact held."""
    for c in range(len(P.contact)):
        S.deflate[P.contact[c]] = min(S.deflate[P.contact[c]], 2)


@kernel
def settle_at_rest(P, C, S, R, W, size):
    """Settles the switches W.active[:size], at rest on their surfaces: jointly where coupled, else one by one."""
    for a in range(size):
        S.mult[W.active[a]] = 0.0
    size = hold_supported(P, S, W, hold_second_order(P, S, R, W, size))
    together = False
    for a in range(size):
        if size > 1:
            link(P, S, W, W.active[a])
            for b in range(size):
                together = together or (a != b and W.linked[W.active[b]] != 0)
    code = DONE
    if together:
        for a in range(size):
            W.group[a] = W.active[a]
            W.arrival[a] = 0
        code = settle_arrivals(P, S, R, W, size)
        still = code == DONE
        for a in range(size):
            # A layer run that never moved: at rest, but nothing says that it stays so.
            still = still and S.status[W.active[a]] == SOLVED and abs(S.mult[W.active[a]]) < 1e-9
        if still and _rest_repels(P, S, W, size):
            record_ambiguity(S, R, W.active[0], AMB_REPELLING, 0)
    else:
        for a in range(size):
            code = max(code, _one_at_rest(P, S, R, W, W.active[a]))
    if some_second_order(P):
        hold_beside(P, S, W)
    if code == DONE and C.strict and S.counts[C_AMBIGUITIES] > 0:
        return STRICT
    return code


@kernel
def release_held(P, C, S, R, W):
    """Settles the switches held at 0 that nothing holds any more; -1 where there are none, else a code.

    After an accumulation another switch does, which sticks; on a piston at its stop, the closed contact.
    """
    solved, some, size = any_solved(P, S), False, 0
    evaluate_surfaces(P, S, W)
    for i in range(P.m + P.ne):
        W.tau[i] = 2.0
    for j in range(P.m):
        if S.status[j] != HELD:
            continue
        if P.kind[j] == SLIDING or (P.kind[j] == SECOND_ORDER and _holder(P, S, W, j) < 0):
            W.active[size] = j
            size += 1
        if P.kind[j] == SLIDING or P.kind[j] == SECOND_ORDER:
            continue
        order = leading_order(P, C, S, W, j)
        # The series is that of fixed multipliers: of solved ones it knows the first derivative that they act on.
        if abs(order) <= (3 if solved else 4):
            S.status[j] = 1 if order > 0 else -1
            S.mult[j] = float(S.status[j])
            S.deflate[j] = abs(order) - 1
            if leading_order(P, C, S, W, j) * order < 0:
                return CHATTERING  # it is pushed back, and its mean is not that of one lambda
            record_event(S, R, j, EV_RESET, 0, S.status[j])
            some = True
    size = hold_supported(P, S, W, size)
    if size > 0:
        rest_with_friction(P, S)
        return settle_at_rest(P, C, S, R, W, size)
    return DONE if some else -1


@kernel
def approach_speed(P, S, j, W):
    """dh_j/dt with the present field; leaves in A_AT_REST the size at which it is rounding."""
    evaluate_surfaces(P, S, W)
    speed = W.dh[P.dh_row[P.m + P.ne] + j]
    size = abs(speed)
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        part = W.dh[e] * W.dx[P.dh_col[e]]
        speed += part
        size += abs(part)
    W.answer[A_AT_REST] = 1e-14 * size + 1e-13
    return speed


@kernel
def leading_order(P, C, S, W, i):
    """Number of leading zero orders of surface i on the slip trajectory from here, negative if it goes negative.

    Counted from 1: +1 means a nonzero value, +2 a nonzero first derivative, ..., +5 zero as far as it looks (without
    jets: the first derivative).
    """
    if P.jet_slip == 0:
        speed = approach_speed(P, S, i, W)
        if abs(W.h[i]) > surface_rounding(P, S, i, W):
            return 1 if W.h[i] > 0.0 else -1
        return 5 if abs(speed) <= W.answer[A_AT_REST] else (2 if speed > 0.0 else -2)
    take_slip_jet(P, C, S, W)
    row = W.rows[P.rows_slip[i]]
    size = 1e-3
    for k in range(P.n):
        size += abs(S.x[k]) + abs(W.rows[k, 1])
    for k in range(4):
        if abs(row[k]) > 1e-12 * size:
            return k + 1 if row[k] > 0.0 else -(k + 1)
    return 5


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
def stop_normal_speed(P, S, j, W, contact):
    """Removes what is left of dh_j/dt: through the impact map for a contact, along its own gradient for a switch."""
    if contact:
        speed = approach_speed(P, S, j, W)
        for i in range(P.n):
            W.before[i] = S.x[i]
            W.after[i] = S.x[i]
        call_act(P.act, P.ne + j, S.now[0], S.x, S.mult, P.p, W.after)
        for i in range(P.n):
            S.x[i] = W.after[i]
        rebound = approach_speed(P, S, j, W)
        # The impact map is affine in its impulse: the share of it that leaves dh/dt = 0.
        share = speed / (speed - rebound) if speed != rebound else 0.0
        for i in range(P.n):
            S.x[i] = W.before[i] + share * (W.after[i] - W.before[i])
        return
    # dh/dt = dh . f(x): its gradient by differences, minimum-norm Newton, twice.
    for _ in range(2):
        speed = approach_speed(P, S, j, W)
        square = 0.0
        for i in range(P.n):
            keep = S.x[i]
            step = 1e-6 * (1.0 + abs(keep))
            S.x[i] = keep + step
            W.gradient[i] = (approach_speed(P, S, j, W) - speed) / step
            S.x[i] = keep
            square += W.gradient[i] ** 2
        if square == 0.0:
            return
        for i in range(P.n):
            S.x[i] -= W.gradient[i] * speed / square


@kernel
def keep_sliding(P, S, j, W):
    """Puts S.x exactly on h_j = 0, of a second-order slide on dh_j/dt = 0 too."""
    keep_on_surface(P, S, j, W)
    if P.kind[j] == SECOND_ORDER and abs(approach_speed(P, S, j, W)) > W.answer[A_AT_REST]:
        stop_normal_speed(P, S, j, W, False)


@kernel
def resettle(P, S, R, W):
    """Sliding switches whose residual has jumped follow the layer flow from where they are, coupled ones together.

    Leaves the side of those that slip in S.status; returns a code.
    """
    if mask_instant(P, S, W) and not (solve_unknowns(P, S, W) if W.code[I_JUMPED] else follow(P, S, W)):
        return NO_ROOT_FOUND
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
                W.arrival[a] = 0
                W.active[a] = W.group[a]
            code = settle_arrivals(P, S, R, W, size)
            if code != DONE:
                return code
            for a in range(size):
                S.deflate[W.active[a]] = 1
            continue
        toward = 1 if g > 0.0 else -1
        if call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, toward, lam) == 0:
            S.status[j] = toward
            S.mult[j] = float(toward)
            S.deflate[j] = 1
    mask_solved(P, S, W)
    return DONE if follow(P, S, W) else NO_ROOT_FOUND


@kernel
def _sliding_with(P, S, W, j):
    """Overwrites W.group by switch j and the sliding ones that act on it or it on them; returns how many."""
    link(P, S, W, j)
    size = 0
    for i in range(P.m):
        if W.linked[i] and S.status[i] == SOLVED and P.kind[i] == SLIDING:
            W.group[size] = i
            size += 1
    return size
