"""What happens at one instant: events, impacts, then the switches with the field after.

Order (the contract of Event): all events whose `when` holds fire from the values before, repeated until none newly
fires; then impacts; then every switch that is on its surface is settled by its layer, and every sliding switch whose
field has jumped is settled again.
"""

import math

import numpy as np
from numba import njit

from .layer import LOST, OSCILLATES, arrive, first_zero, leave_fold
from .pointers import call_act, call_fields, call_jet_slip, call_linear
from .sliding import follow, instant_mask, keep_on_surface, newton, surface_rounding
from .state import (
    ALGEBRAIC,
    AMB_CORNER,
    AMB_HIDDEN_OSCILLATION,
    AMB_REPELLING,
    AMB_SEVERAL_ROOTS,
    AMB_TWO_FOLD,
    C_AMBIGUITIES,
    C_CLOCK,
    C_EVENTS,
    C_LAYERS,
    C_POINTS,
    C_STALLED,
    CHATTERING,
    CONTACT,
    CROSSING,
    DETERMINACY_LOST,
    DONE,
    EV_ACCUMULATION,
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
    HIDDEN_OSCILLATION,
    KINK,
    NO_ROOT_FOUND,
    SLIDING,
    SOLVED,
    STRICT,
    TERMINAL,
)

_AT_ONCE = 1e-13  # instants closer than this (relative) are one instant
_MOST_AT_ONCE = 60  # events without progress in time before the run says that they do not converge


@njit(cache=True)
def record_point(P, S, R):
    i = S.counts[C_POINTS]
    R.t[i] = S.now[0]
    for k in range(P.n):
        R.x[i, k] = S.x[k]
    for j in range(P.m):
        R.mult[i, j] = S.mult[j]
        R.status[i, j] = S.status[j]
    S.counts[C_POINTS] += 1


@njit(cache=True)
def record_event(S, R, index, kind, came, went):
    i = S.counts[C_EVENTS]
    R.event_t[i] = S.now[0]
    R.event[i, 0] = index
    R.event[i, 1] = kind
    R.event[i, 2] = came
    R.event[i, 3] = went
    S.counts[C_EVENTS] += 1


@njit(cache=True)
def record_ambiguity(S, R, index, kind, taken):
    i = S.counts[C_AMBIGUITIES]
    R.ambiguity_t[i] = S.now[0]
    R.ambiguity[i, 0] = index
    R.ambiguity[i, 1] = kind
    R.ambiguity[i, 2] = taken
    S.counts[C_AMBIGUITIES] += 1


@njit(cache=True)
def _layer_code(P, S, R, j, outcome):
    """The loop's return code for what a layer run ended in."""
    if outcome == OSCILLATES:
        record_ambiguity(S, R, j, AMB_HIDDEN_OSCILLATION, 0)
        return HIDDEN_OSCILLATION
    return NO_ROOT_FOUND if outcome == LOST else DONE


@njit(cache=True)
def _residual(P, t, x, mult, status, j, lam, W):
    """g_j at lambda_j = lam with the multipliers of every instant solved along; mult is left as it was."""
    keep = mult[j]
    mult[j] = lam
    instant_mask(P, status, W.mask)
    follow(P, t, x, mult, W.mask, W)
    call_fields(P.fields, t, x, mult, P.p, W.dx, W.h, W.g)
    mult[j] = keep
    return W.g[j]


@njit(cache=True)
def _at_rest_on_surface(P, C, S, R, active, size, W):
    """Settles switches that are on their surfaces without having come from a side: u = 0, lambda = 0."""
    t, x, mult, status = S.now[0], S.x, S.mult, S.status
    for i in range(size):
        mult[active[i]] = 0.0
    taken_from_rest = True
    if size == 1:
        j = active[0]
        plus = _residual(P, t, x, mult, status, j, 1.0, W)
        minus = _residual(P, t, x, mult, status, j, -1.0, W)
        middle = _residual(P, t, x, mult, status, j, 0.0, W)
        size_g = max(abs(plus), abs(minus))
        if abs(middle) <= 1e-14 * size_g:
            beside = _residual(P, t, x, mult, status, j, 1e-4, W)
            if beside > 0.0 and (plus > 0.0 or P.hidden[j]):
                # lambda = 0 is a repelling root: which way it leaves is not decided by the equations.
                taken_from_rest = False
                mult[j] = 1e-4
                found, lam = first_zero(P, t, x, mult, status, j, 1e-4, 1, P.nz > 0 and P.ratio.max() == 0.0, W)
                status[j] = SOLVED if found else 1
                mult[j] = lam if found else 1.0
                record_ambiguity(S, R, j, AMB_REPELLING, status[j])
        if taken_from_rest and plus > 0.0 and minus < 0.0:
            record_ambiguity(S, R, j, AMB_REPELLING, 1 if middle > 0.0 else -1)
        elif taken_from_rest and P.hidden[j]:
            up, high = first_zero(P, t, x, mult, status, j, -1.0, 1, False, W)
            down, low = first_zero(P, t, x, mult, status, j, 1.0, -1, False, W)
            mult[j] = 0.0
            if up != down or abs(high - low) > 1e-9:
                record_ambiguity(S, R, j, AMB_SEVERAL_ROOTS, 0)
    if taken_from_rest:
        for i in range(size):
            W.arrival[i] = 0
        S.counts[C_LAYERS] += 1
        code = _layer_code(P, S, R, active[0], arrive(P, t, x, mult, status, active, size, W.arrival, W))
        if code != DONE:
            return code
    return STRICT if C.strict and S.counts[C_AMBIGUITIES] > 0 else DONE


@njit(cache=True)
def _first_order_that_counts(P, C, S, j, W):
    """Sign and number of leading zero orders of surface j on the trajectory that starts here."""
    row = P.rows_slip[j]
    if row < 0:
        return 1, 0
    call_jet_slip(P.jet_slip, S.now[0], S.x, S.mult, P.p, C.order, W.rows.shape[1], W.rows)
    total = 0.0
    for i in range(P.n):
        total += abs(S.x[i]) + abs(W.rows[i, 1])
    for k in range(4):
        if abs(W.rows[row, k]) > 1e-12 * (total + 1e-3):
            return (1 if W.rows[row, k] > 0.0 else -1), k
    return 1, 4


@njit(cache=True)
def _close_contact(P, S, j, W):
    """Contact j touches at zero speed: closed if it presses (R >= 0), else it opens. Returns the new status."""
    S.status[j] = SOLVED
    S.mult[j] = 0.0
    for i in range(P.m):
        W.mask[i] = 1 if S.status[i] == SOLVED else 0
    if not newton(P, S.now[0], S.x, S.mult, W.mask, W) or S.mult[j] < 0.0:
        S.status[j] = 1
        S.mult[j] = 0.0
        S.deflate[j] = 2
    return S.status[j]


@njit(cache=True)
def _approach_speed(P, S, j, W):
    """dh_j/dt with the present field, and the size at which it is rounding."""
    call_fields(P.fields, S.now[0], S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.now[0], S.x, S.mult, P.p, W.G, W.dh)
    speed = W.dh[(P.m + P.ne) * P.n + j]
    size = abs(speed)
    for i in range(P.n):
        speed += W.dh[j * P.n + i] * W.dx[i]
        size += abs(W.dh[j * P.n + i]) * abs(W.dx[i])
    return speed, 1e-14 * size + 1e-13


@njit(cache=True)
def start(P, C, S, R, W):
    """Classifies every surface at the initial state; records the first point."""
    t, x, mult, status = S.now[0], S.x, S.mult, S.status
    m = P.m
    for j in range(m):
        status[j] = SOLVED if P.kind[j] == ALGEBRAIC else 1
        mult[j] = 0.0 if P.kind[j] >= CONTACT else 1.0
    # Twice: a surface may depend on an inner switch that is known only after the first look.
    for _ in range(2):
        call_fields(P.fields, t, x, mult, P.p, W.dx, W.h, W.g)
        for j in range(m):
            if P.kind[j] < CONTACT:
                status[j] = 1 if W.h[j] >= 0.0 else -1
                mult[j] = float(status[j])
    instant_mask(P, status, W.mask)
    if not newton(P, t, x, mult, W.mask, W):
        return NO_ROOT_FOUND
    call_fields(P.fields, t, x, mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, t, x, mult, P.p, W.G, W.dh)
    size = 0
    active = np.empty(m, np.int64)
    touching = np.zeros(m + P.ne, np.bool_)
    for j in range(m + P.ne):
        touching[j] = abs(W.h[j]) <= surface_rounding(P, x, j, W.dh) and (j >= m or P.kind[j] != ALGEBRAIC)
    for j in range(m):
        if touching[j] and P.kind[j] == CONTACT:
            speed, tiny = _approach_speed(P, S, j, W)
            if speed < -tiny:
                S.deflate[j] = 0
                touching[j] = True
            elif speed > tiny:
                S.deflate[j] = 1
            else:
                _close_contact(P, S, j, W)
        elif touching[j] and P.kind[j] != ALGEBRAIC:
            if P.kind[j] == SLIDING:
                active[size] = j
                size += 1
            else:
                sign, order = _first_order_that_counts(P, C, S, j, W)
                status[j] = sign
                mult[j] = float(sign)
                S.deflate[j] = order
    code = DONE
    if size > 0:
        code = _settle_group(P, C, S, R, active, size, W)
        for i in range(size):
            j = active[i]
            if status[j] != SOLVED:
                sign, order = _first_order_that_counts(P, C, S, j, W) if not _any_solved(P, S) else (status[j], 1)
                S.deflate[j] = order
    for i in range(P.ne):
        h = W.h[m + i]
        S.side[i] = 1 if h >= 0.0 else -1
        if touching[m + i] and P.rows_slip[m + i] >= 0:
            sign, order = _first_order_that_counts(P, C, S, m + i, W) if not _any_solved(P, S) else (S.side[i], 0)
            S.side[i] = sign
            S.deflate[m + i] = min(order, 3)
    record_point(P, S, R)
    return code


@njit(cache=True)
def _any_solved(P, S):
    for j in range(P.m):
        if S.status[j] == SOLVED:
            return True
    return False


@njit(cache=True)
def _settle_group(P, C, S, R, active, size, W):
    """Settles switches at rest on their surfaces: jointly where they are coupled, else one by one."""
    together = False
    for a in range(size):
        for b in range(size):
            if a != b and P.coupled[active[a], active[b]]:
                together = True
    if together:
        return _at_rest_on_surface(P, C, S, R, active.copy(), size, W)
    one = np.empty(P.m, np.int64)
    code = DONE
    for a in range(size):
        one[0] = active[a]
        code = max(code, _at_rest_on_surface(P, C, S, R, one, 1, W))
    return code


@njit(cache=True)
def _fire_events(P, C, S, R, at_clock, W):
    """Fires the events of this instant until none newly does; returns (x changed, code)."""
    m, n, ne = P.m, P.n, P.ne
    pending = np.zeros(ne, np.bool_)
    done = np.zeros(ne, np.bool_)
    some = False
    for i in range(ne):
        if W.hit[m + i]:
            S.side[i] = -S.side[i]
            S.deflate[m + i] = 1
            if P.direction[i] == 0 or P.direction[i] == S.side[i]:
                pending[i] = True
                some = True
    if at_clock:
        while S.counts[C_CLOCK] < C.clock.shape[0] and C.clock[S.counts[C_CLOCK]] <= S.now[0]:
            pending[C.clock_event[S.counts[C_CLOCK]]] = True
            S.counts[C_CLOCK] += 1
            some = True
    if not some:
        return False, DONE
    changed = False
    code = DONE
    for _ in range(_MOST_AT_ONCE):
        newly = False
        W.before[:] = S.x
        W.after[:] = S.x
        for i in range(ne):
            if pending[i] and not done[i]:
                if call_act(P.act, i, S.now[0], W.before, S.mult, P.p, W.after) != 0:
                    done[i] = True
                    newly = True
                    record_event(S, R, m + i, EV_EVENT, -S.side[i], S.side[i])
                    if P.terminal[i]:
                        code = TERMINAL
        if not newly:
            return changed, code
        for k in range(n):
            if W.after[k] != S.x[k]:
                changed = True
                S.x[k] = W.after[k]
        call_fields(P.fields, S.now[0], S.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(ne):
            # An event surface that the update has jumped through is met as well.
            if P.rows_slip[m + i] >= 0 and W.h[m + i] * S.side[i] < 0.0 and not W.hit[m + i]:
                S.side[i] = -S.side[i]
                W.hit[m + i] = True
                S.deflate[m + i] = 0
                if P.direction[i] == 0 or P.direction[i] == S.side[i]:
                    pending[i] = True
    return changed, CHATTERING


@njit(cache=True)
def _impacts(P, S, R, W):
    """Newton impacts of every contact that touches while approaching; returns (x changed, code)."""
    changed = False
    m = P.m
    for sweep in range(_MOST_AT_ONCE):
        newly = False
        for j in range(m):
            if P.kind[j] != CONTACT or S.status[j] == SOLVED:
                continue
            call_fields(P.fields, S.now[0], S.x, S.mult, P.p, W.dx, W.h, W.g)
            call_linear(P.linear, S.now[0], S.x, S.mult, P.p, W.G, W.dh)
            if not (W.hit[j] or W.h[j] <= surface_rounding(P, S.x, j, W.dh)):
                continue
            speed, tiny = _approach_speed(P, S, j, W)
            if speed < -tiny:
                W.after[:] = S.x
                call_act(P.act, P.ne + j, S.now[0], S.x, S.mult, P.p, W.after)
                S.x[:] = W.after
                keep_on_surface(P, S.now[0], S.x, S.mult, j, W)
                changed = True
                newly = True
                S.deflate[j] = 1
                record_event(S, R, j, EV_IMPACT, 1, 1)
                speed, tiny = _approach_speed(P, S, j, W)
            if speed <= tiny and speed >= -tiny and W.hit[j]:
                if _close_contact(P, S, j, W) == SOLVED:
                    record_event(S, R, j, EV_CLOSED, 1, 0)
        if not newly:
            return changed, DONE
    return changed, CHATTERING


@njit(cache=True)
def _note_interval(S, j):
    """Remembers when surface j was last met, the interval since, and the ratio to the one before."""
    t = S.now[0]
    interval = t - S.last[j, 0]
    S.last[j, 3] = S.last[j, 2]
    S.last[j, 2] = interval / S.last[j, 1] if S.last[j, 1] > 0.0 else math.inf
    S.last[j, 1] = interval
    S.last[j, 0] = t


@njit(cache=True)
def _time_left(S, j):
    """Time to the accumulation point if the intervals of surface j shrink geometrically, else inf."""
    q = S.last[j, 2]
    if not (q < 0.9999999 and abs(q - S.last[j, 3]) <= 0.02 * q):
        return math.inf
    return S.last[j, 1] * q / (1.0 - q)


@njit(cache=True)
def _pass_accumulation(P, C, S, R, W):
    """Passes an accumulation point that has come within rounding: rest on the surfaces that take part.

    Contacts become closed. Switches of higher relative degree are held at lambda = 0, the others settled by their
    layer. Returns (passed, code).
    """
    m = P.m
    t = S.now[0]
    leader, left = -1, math.inf
    for j in range(m):
        if W.hit[j] and S.status[j] != SOLVED:
            estimate = _time_left(S, j)
            if estimate < left:
                leader, left = j, estimate
    if leader < 0 or left > 1e-11 * (1.0 + abs(t)):
        return False, DONE
    S.now[0] = t + left
    size = 0
    active = np.empty(m, np.int64)
    for j in range(m):
        takes_part = j == leader
        if S.status[j] != SOLVED and S.status[j] != HELD and P.kind[j] != ALGEBRAIC and j != leader:
            takes_part = S.last[j, 1] > 0.0 and t - S.last[j, 0] <= 10.0 * S.last[leader, 1]
        if not takes_part:
            continue
        record_event(S, R, j, EV_ACCUMULATION, S.status[j], 0)
        if P.kind[j] == CONTACT:
            _stop_normal_speed(P, S, j, W)
            _close_contact(P, S, j, W)
            record_event(S, R, j, EV_CLOSED if S.status[j] == SOLVED else EV_OPENING, 1, S.status[j])
        elif P.kind[j] == CROSSING or P.kind[j] == KINK:
            keep_on_surface(P, S.now[0], S.x, S.mult, j, W)
            _stop_normal_speed(P, S, j, W)
            S.status[j] = HELD
            S.mult[j] = 0.0
        else:
            keep_on_surface(P, S.now[0], S.x, S.mult, j, W)
            active[size] = j
            size += 1
        S.last[j, 1] = 0.0
    code = DONE
    if size > 0:
        code = _settle_group(P, C, S, R, active, size, W)
    return True, code


@njit(cache=True)
def _stop_normal_speed(P, S, j, W):
    """Removes what is left of dh_j/dt: through the impact map for a contact, along its own gradient for a switch."""
    if P.kind[j] == CONTACT:
        speed, tiny = _approach_speed(P, S, j, W)
        if abs(speed) <= 0.0:
            return
        W.after[:] = S.x
        call_act(P.act, P.ne + j, S.now[0], S.x, S.mult, P.p, W.after)
        W.before[:] = S.x
        S.x[:] = W.after
        rebound, tiny = _approach_speed(P, S, j, W)
        # The impact map is affine in its impulse: the share of it that leaves dh/dt = 0.
        share = speed / (speed - rebound) if speed != rebound else 0.0
        for i in range(P.n):
            S.x[i] = W.before[i] + share * (W.after[i] - W.before[i])
        return
    # dh/dt = dh . f(x): its gradient by differences, minimum-norm Newton, twice.
    for _ in range(2):
        speed, tiny = _approach_speed(P, S, j, W)
        square = 0.0
        gradient = np.zeros(P.n)
        for i in range(P.n):
            keep = S.x[i]
            step = 1e-6 * (1.0 + abs(keep))
            S.x[i] = keep + step
            moved, tiny = _approach_speed(P, S, j, W)
            S.x[i] = keep
            gradient[i] = (moved - speed) / step
            square += gradient[i] ** 2
        if square == 0.0:
            return
        for i in range(P.n):
            S.x[i] -= gradient[i] * speed / square


@njit(cache=True)
def two_fold(P, C, S, R, t0, rows, mult_row, time_row, s_end, W):
    """Whether attracting sliding has turned repelling inside the step without a fold (a two-fold point).

    If so, S is put back to that point, the ambiguity recorded and the return code left in W.code[0].
    """
    m = P.m
    if time_row >= 0:
        return False
    for j in range(m):
        if S.status[j] == SOLVED and P.kind[j] == SLIDING and not P.hidden[j]:
            call_linear(P.linear, S.now[0], S.x, S.mult, P.p, W.G, W.dh)
            if W.G[j * m + j] >= 0.0 and not P.coupled[j].sum() > 1:
                lo, hi = 0.0, s_end
                for _ in range(200):
                    mid = 0.5 * (lo + hi)
                    if mid == lo or mid == hi:
                        break
                    _state_at(P, S, rows, mult_row, mid, W)
                    call_linear(P.linear, t0 + mid, S.x, S.mult, P.p, W.G, W.dh)
                    if W.G[j * m + j] < 0.0:
                        lo = mid
                    else:
                        hi = mid
                _state_at(P, S, rows, mult_row, hi, W)
                S.now[0] = t0 + hi
                keep_on_surface(P, S.now[0], S.x, S.mult, j, W)
                record_ambiguity(S, R, j, AMB_TWO_FOLD, 0)
                W.code[0] = STRICT if C.strict else DETERMINACY_LOST
                return True
    return False


@njit(cache=True)
def _state_at(P, S, rows, mult_row, s, W):
    """Overwrites S.x and the solved multipliers with the step's polynomials at s."""
    K = W.power.shape[0] - 4
    for i in range(P.n):
        value = rows[i, K]
        for k in range(K - 1, -1, -1):
            value = value * s + rows[i, k]
        S.x[i] = value
    for j in range(P.m):
        if S.status[j] == SOLVED:
            value = rows[mult_row + j, K]
            for k in range(K - 1, -1, -1):
                value = value * s + rows[mult_row + j, k]
            S.mult[j] = value


@njit(cache=True)
def _resettle(P, C, S, R, W):
    """Sliding switches whose residual has jumped follow the layer flow from where they are."""
    m = P.m
    t, x, mult, status = S.now[0], S.x, S.mult, S.status
    instant_mask(P, status, W.mask)
    if not follow(P, t, x, mult, W.mask, W):
        return NO_ROOT_FOUND
    for j in range(m):
        if status[j] != SOLVED or P.kind[j] != SLIDING:
            continue
        g = _residual(P, t, x, mult, status, j, mult[j], W)
        if abs(g) <= 1e-12:
            continue
        toward = 1 if g > 0.0 else -1
        found, lam = first_zero(P, t, x, mult, status, j, mult[j], toward, False, W)
        mult[j] = lam
        if not found:
            status[j] = toward
            mult[j] = float(toward)
            S.deflate[j] = 1
            record_event(S, R, j, EV_RESET, 0, toward)
    for j in range(m):
        W.mask[j] = 1 if status[j] == SOLVED else 0
    return DONE if follow(P, t, x, mult, W.mask, W) else NO_ROOT_FOUND


@njit(cache=True)
def at_instant(P, C, S, R, best, h, at_clock, elapsed, W):
    """Acts on everything that happens at the present instant; S already stands at it. Returns a code."""
    m, ne = P.m, P.ne
    t, x, mult, status = S.now[0], S.x, S.mult, S.status
    fold, fold_way = W.code[1], W.code[2]
    any_hit = False
    for i in range(m + ne):
        W.hit[i] = W.tau[i] <= 1.0 and (W.tau[i] - best) * h <= _AT_ONCE * max(abs(t), h)
        if not W.hit[i] and elapsed > 1e-12 * (1.0 + abs(t)):
            S.deflate[i] = 0
        any_hit = any_hit or W.hit[i]
    if fold >= 0:
        W.hit[fold] = False
    for j in range(m):
        if W.hit[j] and status[j] != SOLVED and P.surface_state[j] >= 0:
            x[P.surface_state[j]] = 0.0
    record_point(P, S, R)
    S.counts[C_STALLED] = S.counts[C_STALLED] + 1 if elapsed <= 1e-14 * (1.0 + abs(t)) else 0
    if S.counts[C_STALLED] > _MOST_AT_ONCE:
        return CHATTERING
    events_before = S.counts[C_EVENTS]

    jumped, stop = _fire_events(P, C, S, R, at_clock, W) if ne > 0 else (False, DONE)
    if stop == CHATTERING:
        return CHATTERING
    struck, code = _impacts(P, S, R, W)
    if code != DONE:
        return code
    for j in range(m):
        if W.hit[j] and P.kind[j] == CONTACT and status[j] == SOLVED and W.tau[j] <= 1.0 and not struck:
            if mult[j] <= 1e-12:
                status[j] = 1
                mult[j] = 0.0
                S.deflate[j] = 3
                record_event(S, R, j, EV_OPENING, 0, 1)
    jumped = jumped or struck
    switched = jumped
    size = 0
    active = W.active
    if jumped:
        call_fields(P.fields, t, x, mult, P.p, W.dx, W.h, W.g)
        call_linear(P.linear, t, x, mult, P.p, W.G, W.dh)
        for j in range(m):
            if P.kind[j] >= CONTACT or status[j] == HELD:
                continue
            value = W.h[j]
            if abs(value) <= surface_rounding(P, x, j, W.dh):
                continue  # still, or now, on its surface: settled below
            side = 1 if value > 0.0 else -1
            if status[j] != side:
                record_event(S, R, j, EV_RESET, status[j], side)
                status[j] = side
                mult[j] = float(side)
                S.deflate[j] = 0
            W.hit[j] = False
        for j in range(m):
            if P.kind[j] < CONTACT and status[j] != HELD and status[j] != SOLVED:
                if abs(W.h[j]) <= surface_rounding(P, x, j, W.dh):
                    W.hit[j] = True
    for j in range(m):
        if not W.hit[j] or P.kind[j] >= CONTACT or status[j] == HELD:
            continue
        if status[j] == SOLVED:
            if not jumped:
                side = W.exit_side[j]
                status[j] = side
                mult[j] = float(side)
                S.deflate[j] = 2
                record_event(S, R, j, EV_TANGENCY, 0, side)
        elif P.kind[j] == SLIDING:
            active[size] = j
            size += 1
        else:
            came = status[j]
            went = -came
            if jumped:
                sign, order = _first_order_that_counts(P, C, S, j, W)
                went = sign
            status[j] = went
            mult[j] = float(went)
            S.deflate[j] = 1
            switched = True
            if went != came:
                record_event(S, R, j, EV_CROSSING, came, went)
            _note_interval(S, j)
    if fold >= 0:
        j = fold
        S.counts[C_LAYERS] += 1
        code = _layer_code(P, S, R, j, leave_fold(P, t, x, mult, status, j, fold_way, W))
        if code != DONE:
            return code
        S.deflate[j] = 1
        record_event(S, R, j, EV_FOLD_TO_SLIDING if status[j] == SOLVED else EV_FOLD, 0, status[j])
        switched = True
    if size > 0:
        code = _arrivals(P, C, S, R, active, size, jumped, W)
        if code != DONE:
            return code
        switched = True
    passed = False
    for j in range(m):
        if W.hit[j] and P.kind[j] == CONTACT and struck:
            _note_interval(S, j)
    if any_hit:
        passed, code = _pass_accumulation(P, C, S, R, W)
        if code != DONE:
            return code
    if switched:
        code = _resettle(P, C, S, R, W)
        if code != DONE:
            return code
    if S.counts[C_EVENTS] > events_before:
        record_point(P, S, R)
    if C.strict and S.counts[C_AMBIGUITIES] > 0:
        return STRICT
    return stop


@njit(cache=True)
def _arrivals(P, C, S, R, active, size, jumped, W):
    """Settles switches that met their surfaces: one by one where uncoupled, else in one layer system."""
    m = P.m
    mult, status = S.mult, S.status
    came = np.empty(m, np.int64)
    for j in range(m):
        came[j] = status[j]
    joint = False
    for a in range(size):
        for b in range(m):
            j = active[a]
            if b != j and (P.coupled[j, b] or P.coupled[b, j]) and P.kind[b] == SLIDING:
                partner = status[b] == SOLVED
                for c in range(size):
                    partner = partner or active[c] == b
                joint = joint or partner
    group = active.copy()
    count = size
    if joint:
        for b in range(m):
            if status[b] == SOLVED and P.kind[b] == SLIDING:
                linked = False
                for a in range(size):
                    linked = linked or P.coupled[active[a], b] or P.coupled[b, active[a]]
                if linked:
                    group[count] = b
                    count += 1
        for a in range(count):
            W.arrival[a] = 0 if status[group[a]] == SOLVED or jumped else status[group[a]]
            if jumped and status[group[a]] != SOLVED:
                mult[group[a]] = 0.0
        S.counts[C_LAYERS] += 1
        members = group.copy()
        code = _layer_code(P, S, R, group[0], arrive(P, S.now[0], S.x, mult, status, group, count, W.arrival, W))
        if code != DONE:
            return code
        if size > 1:
            _try_other_ratio(P, S, R, members, size, came, W)
        group = members
    else:
        one = np.empty(m, np.int64)
        for a in range(size):
            one[0] = active[a]
            if jumped:
                code = _at_rest_on_surface(P, C, S, R, one, 1, W)
            else:
                W.arrival[0] = status[active[a]]
                S.counts[C_LAYERS] += 1
                code = _layer_code(P, S, R, active[a], arrive(P, S.now[0], S.x, mult, status, one, 1, W.arrival, W))
            if code != DONE:
                return code
    for a in range(count):
        j = group[a]
        S.deflate[j] = 1
        if status[j] == SOLVED and came[j] != SOLVED:
            record_event(S, R, j, EV_STICK, came[j], 0)
            keep_on_surface(P, S.now[0], S.x, mult, j, W)
        elif status[j] != came[j]:
            record_event(S, R, j, EV_CROSSING if came[j] != SOLVED else EV_RESET, came[j], status[j])
        _note_interval(S, j)
    return DONE


@njit(cache=True)
def _try_other_ratio(P, S, R, members, size, came, W):
    """Runs the corner's layer again with eps_1/eps_2 changed by 10 and 1/10; another outcome is an ambiguity."""
    m = P.m
    status, mult = np.empty(m, np.int64), np.empty(m)
    keep = P.weight[members[0]]
    for factor in (10.0, 0.1):
        for j in range(m):
            status[j] = came[j]
            mult[j] = S.mult[j] if came[j] == SOLVED else float(came[j])
        for a in range(size):
            W.arrival[a] = came[members[a]]
        P.weight[members[0]] = keep * factor
        outcome = arrive(P, S.now[0], S.x, mult, status, members.copy(), size, W.arrival, W)
        P.weight[members[0]] = keep
        same = outcome == 0
        for j in range(m):
            same = same and status[j] == S.status[j]
        if not same:
            record_ambiguity(S, R, members[0], AMB_CORNER, 0)
            return
