"""Deviations at an instant: a deviation of the state, of the parameters and of the time at which it happens.

At the zero of H(t, x, lambda; p) a run that deviates by (w, q) arrives by dt later, at x + w + f- dt:

    H_x (w + f- dt) + H_lambda l + H_p q + H_t dt = 0

Every update acts there, R_x (...) + R_p q + R_t dt, and the field after leads back to one time, w+ = ... - f+ dt (di
Bernardo, Budd, Champneys & Kowalczyk, Piecewise-smooth Dynamical Systems, 2008). A motion that is held on surfaces
from there on has no deviation out of them: w -> (1 - D (C D)^-1 C) w, with their gradients and rates C and the
directions D in which an impact without rebound would stop it.
"""

import math

from ..machine.compiling import kernel
from ..machine.lanes import load8, splat8, store8
from ..machine.pointers import abs8, call_act_slopes, call_fields, call_outputs
from ..state import (
    COMPONENT,
    CONTACT,
    DISC,
    HELD,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
    TAPE_MEET,
    TAPE_STEP,
    TAPE_SURFACE,
)
from ..step.roots import GRAZING
from .flow import invert, number_unknowns
from .state import (
    CORNER,
    F_MULT,
    FINE,
    G_MULT,
    G_P,
    G_T,
    G_X,
    GRAZES,
    H_MULT,
    H_P,
    H_T,
    H_X,
    S_P,
    S_X,
    UNKNOWN,
)

_INFINITE = 1e300  # stands for what lets nothing move
_TOUCHING = 1e-9  # of its scale: what differs by less is one
_ROUNDING = 1e-13  # of the terms of a speed: a smaller one is rounding
_NEARBY = 1e-5  # of a step: over which a speed is differenced


@kernel
def look(P, V, t, x, mult):
    """Overwrites V.jac by the Jacobians at a point."""
    call_outputs(V.jacobian, t, x, mult, P.p, V.jac)


@kernel
def _leave_out_idle(P, V, size):
    """A multiplier that acts on nothing at a point, kappa*v*lambda at v = 0, does not deviate there."""
    for j in range(P.m):
        r, idle = V.unknown[j], V.unknown[j] >= 0
        for c in range(size if idle else 0):
            idle = idle and V.matrix[r, c] == 0.0
        for e in range(V.entries_point.shape[0] if idle else 0):
            kind, column = V.entries_point[e, 0], V.entries_point[e, 2]
            acts = kind == F_MULT or kind == G_MULT or kind == H_MULT
            idle = idle and not (acts and column == j and V.jac[e] != 0.0)
        if idle:
            V.matrix[r, r] = _INFINITE


@kernel
def multipliers(P, V, w, dt, mask, first, last):
    """Overwrites V.lam by the deviations of the multipliers under the mask, from those of states and time; False if
    these are not determined. V.jac is that of the point."""
    entries, unknown, lam = V.entries_point, V.unknown, V.lam
    size = number_unknowns(V, mask, P.m)
    for j in range(P.m):
        for block in range(first, last, 8):
            store8(lam[j], block, splat8(0.0))
    if size == 0:
        return True
    for r in range(size):
        for c in range(size):
            V.matrix[r, c] = 0.0
    for e in range(entries.shape[0]):
        i, j = entries[e, 1], entries[e, 2]
        if entries[e, 0] == G_MULT and unknown[i] >= 0 and unknown[j] >= 0:
            V.matrix[unknown[i], unknown[j]] = V.jac[e]
    _leave_out_idle(P, V, size)
    if not invert(V, size):
        return False
    for e in range(entries.shape[0]):
        kind, i, j = entries[e, 0], entries[e, 1], entries[e, 2]
        if not G_X <= kind <= G_T or kind == G_MULT or unknown[i] < 0:
            continue
        for block in range(first, last, 8):
            if kind == G_X:
                term = load8(w[j], block)
            elif kind == G_P:
                term = load8(V.seeds, V.w.shape[1] * j + block)
            else:
                term = load8(dt, block)
            store8(lam[i], block, load8(lam[i], block) + term * V.jac[e])
    for block in range(first, last, 8):
        for j in range(P.m):
            if unknown[j] >= 0:
                store8(V.sums, 8 * unknown[j], load8(lam[j], block))
        for j in range(P.m):
            if unknown[j] >= 0:
                total = splat8(0.0)
                for c in range(size):
                    total = total - load8(V.sums, 8 * c) * V.matrix[unknown[j], size + c]
                store8(lam[j], block, total)
    return True


@kernel
def _change(P, V, i, kinds, out):
    """Overwrites `out` by the deviations at fixed time of surface i (`kinds` is H_X), or of residual i with its
    multiplier fixed (G_X), its rate as that of the last column but seven; returns the size of the rate's terms."""
    entries, wide, size = V.entries_point, V.w.shape[1], 0.0
    for block in range(0, wide, 8):
        store8(out, block, splat8(0.0))
    for e in range(entries.shape[0]):
        kind, j = entries[e, 0] - kinds + H_X, entries[e, 2]
        if kind < H_X or kind > H_T or entries[e, 1] != i or (kind == H_MULT and kinds == G_X):
            continue
        value = V.jac[e]
        if kind == H_T:
            out[V.columns] += value
            size += abs(value)
            continue
        if kind == H_X:
            size += abs(value * V.rates[j])
        for block in range(0, wide, 8):
            if kind == H_X:
                term = load8(V.w[j], block)
            elif kind == H_MULT:
                term = load8(V.lam[j], block)
            else:
                term = load8(V.seeds, V.w.shape[1] * j + block)
            store8(out, block, load8(out, block) + term * value)
    return size


@kernel
def begin_instant(P, V, t, x, mult, status):
    """The point before an instant: its rates as another column, its Jacobians, the multipliers' deviations."""
    n, wide, time = P.n, V.w.shape[1], V.columns
    V.inside, V.acted, V.fresh, V.first_point, V.why, V.cause = 1, 0, 1, 1, FINE, -1
    call_fields(P.fields, t, x, mult, P.p, V.rates, V.slopes, V.sums)
    for i in range(n):
        for block in range(time, wide, 8):
            store8(V.w[i], block, splat8(0.0))
        V.w[i, time] = V.rates[i]
    for block in range(0, wide, 8):
        store8(V.dt, block, splat8(0.0))
    V.dt[time] = 1.0
    look(P, V, t, x, mult)
    for j in range(P.m):
        V.mask[j] = 1 if status[j] == SOLVED else 0
    if not multipliers(P, V, V.w, V.dt, V.mask, 0, wide):
        V.why = UNKNOWN
    _shift(P, V)


@kernel
def _shift(P, V):
    """Overwrites V.event by the deviations at the instant's own time."""
    for i in range(P.n):
        for block in range(0, V.columns, 8):
            store8(V.event[i], block, load8(V.w[i], block) + load8(V.dt, block) * V.rates[i])


@kernel
def _take(P, V, out, which):
    """Makes `out` the shift of the instant, or compares it with the one that another cause has set."""
    if V.cause >= 0:
        for c in range(V.columns):
            apart = abs(out[c] - V.dt[c])
            # A quantity that changes by its own size must part them, else it is a rounding that does.
            if not (apart <= _TOUCHING * (abs(out[c]) + abs(V.dt[c])) or 0.0 < apart * V.scale[c] <= V.instant):
                V.why = CORNER
        return
    V.cause = which
    for block in range(0, V.columns, 8):
        store8(V.dt, block, load8(out, block))
    _shift(P, V)


@kernel
def _take_arc(P, V, which):
    """The same of the shift and the deviations in which an arc, or the last moments of a slip, have ended."""
    V.on_arc = 0
    if V.cause >= 0:
        _take(P, V, V.arc_w[P.n], which)
        return
    V.cause = which
    for block in range(0, V.columns, 8):
        shift = load8(V.arc_w[P.n], block)
        store8(V.dt, block, shift)
        for i in range(P.n):
            store8(V.event[i], block, load8(V.arc_w[i], block))
            store8(V.w[i], block, load8(V.arc_w[i], block) - shift * V.rates[i])


@kernel
def _rate_near(P, V, i, by):
    """Rate of surface i at the instant's point, moved along the motion by a time; overwrites V.x, V.slopes, V.jac."""
    n, t, rate = P.n, V.tape_x[V.met, 0] + by, 0.0
    for k in range(n):
        V.x[k] = V.tape_x[V.met, 2 + k] + by * V.w[k, V.columns]
    call_fields(P.fields, t, V.x, V.mult, P.p, V.rates, V.slopes, V.sums)
    look(P, V, t, V.x, V.mult)
    for e in range(V.entries_point.shape[0]):
        kind = V.entries_point[e, 0]
        if V.entries_point[e, 1] == i and kind == H_X:
            rate += V.jac[e] * V.rates[V.entries_point[e, 2]]
        elif V.entries_point[e, 1] == i and kind == H_T:
            rate += V.jac[e]
    return rate


@kernel
def _farthest(P, V, i):
    """Value of surface i where it turned to this instant: at the starts of the steps since it was met last."""
    n, far = P.n, 0.0
    for k in range(V.met - 1, -1, -1):
        kind = V.tape[k, 0]
        if kind == TAPE_MEET and V.tape[k, 1] == TAPE_SURFACE and V.tape[k, 2] == i:
            break
        if kind != TAPE_STEP:
            continue
        for q in range(n):
            V.x[q] = V.tape_x[k, 2 + q]
        for j in range(P.m):
            V.mult[j] = V.tape_x[k, 2 + n + j]
        call_fields(P.fields, V.tape_x[k, 0], V.x, V.mult, P.p, V.rates, V.slopes, V.sums)
        if abs(V.slopes[i]) < far:
            break
        far = abs(V.slopes[i])
    for j in range(P.m):
        V.mult[j] = V.tape_x[V.met, 2 + n + j]
    return far


@kernel
def _is_crossed(P, V, i, speed, size):
    """Whether a surface is crossed at this speed, whose terms have this size, and not touched.

    How deep the motion would dip, speed^2/(2 |h''|), is compared with how far from the surface it came: so the low hops
    of a chatter cross, which begin on it, and a dip as shallow as what the loop calls a grazing does not.
    """
    if not abs(speed) > _ROUNDING * size:
        return False
    k = V.met - 1
    while V.tape[k, 0] != TAPE_STEP:  # an instant ends a step
        k -= 1
    by = -_NEARBY * V.tape_x[k, 1]
    bend = (_rate_near(P, V, i, by) - speed) / by if by < 0.0 else 0.0
    crossed = speed * speed > 2.0 * GRAZING * abs(bend) * _farthest(P, V, i)
    _rate_near(P, V, i, 0.0)  # the point and what stands for it are as before
    return crossed


@kernel
def _is_slid_on(P, V, i):
    """Whether surface i is, but for a factor, one that a multiplier slides on up to this instant."""
    entries, row, other = V.entries_point, V.held[0], V.held[1]
    for j in range(P.m):
        if V.tape[V.met, 4 + j] != SOLVED or P.kind[j] != SLIDING:
            continue
        if j == i:
            return True
        by_time, by_time_too = 0.0, 0.0
        for k in range(P.n):
            row[k], other[k] = 0.0, 0.0
        for e in range(entries.shape[0]):
            kind, which = entries[e, 0], entries[e, 1]
            if kind == H_X and which == i:
                row[entries[e, 2]] = V.jac[e]
            elif kind == H_X and which == j:
                other[entries[e, 2]] = V.jac[e]
            elif kind == H_T and which == i:
                by_time = V.jac[e]
            elif kind == H_T and which == j:
                by_time_too = V.jac[e]
        dot, length = _product(row, other), _product(other, other)
        apart = abs(by_time * length - by_time_too * dot)
        for k in range(P.n):
            apart = max(apart, abs(row[k] * length - other[k] * dot))
        if length > 0.0 and apart <= _TOUCHING * abs(dot) * math.sqrt(length):
            return True
    return False


@kernel
def meet_surface(P, V, i):
    """The instant is the zero of surface i; of a disc, the end of its last moments."""
    if i < P.m and P.kind[i] == DISC:
        if V.on_arc and not V.passes:
            _take_arc(P, V, i)
        else:
            V.on_arc, V.why, V.cause = 0, GRAZES, i
        return
    if _is_slid_on(P, V, i):
        return  # the run has been on it all along: what else happens at this instant says when it leaves
    out, time = V.other_dt, V.columns
    size = _change(P, V, i, H_X, out)
    speed = out[time]
    if size == 0.0 and _is_zero(V, out):
        return  # the run and its neighbours rest on it; another cause at this instant says when they leave
    if not _is_crossed(P, V, i, speed, size):
        V.why = GRAZES
        V.cause = i
        return
    for block in range(0, time, 8):
        store8(out, block, load8(out, block) * (-1.0 / speed))
    _take(P, V, out, i)
    if V.cause == i:
        _stand_on_state(P, V, i)


@kernel
def _is_zero(V, out):
    for c in range(V.columns):
        if out[c] != 0.0:
            return False
    return True


@kernel
def _stand_on_state(P, V, i):
    """Clears the deviation of a state that is itself the surface: at its zero only rounding is left of it."""
    alone = -1
    for e in range(V.entries_point.shape[0]):
        kind = V.entries_point[e, 0]
        if V.entries_point[e, 1] == i and H_X <= kind <= H_T:
            if kind != H_X or alone >= 0:
                return
            alone = V.entries_point[e, 2]
    if alone >= 0:
        for block in range(0, V.columns, 8):
            store8(V.event[alone], block, splat8(0.0))


@kernel
def meet_again(P, V, i, t, x, mult):
    """Updates have carried the run over surface i, which moves nothing, or onto it, where all runs must stay."""
    entries, out, reach = V.entries_point, V.other_dt, 0.0
    call_fields(P.fields, t, x, mult, P.p, V.rates, V.slopes, V.sums)
    h = V.slopes[i]
    look(P, V, t, x, mult)
    for block in range(0, V.columns, 8):
        store8(out, block, splat8(0.0))
        store8(V.sizes, block, splat8(0.0))
    for e in range(entries.shape[0]):
        kind, j = entries[e, 0], entries[e, 2]
        if entries[e, 1] != i or (kind != H_X and kind != H_P and kind != H_T):
            continue
        if kind == H_X:
            reach += abs(V.jac[e] * x[j])
        for block in range(0, V.columns, 8):
            if kind == H_X:
                term = load8(V.event[j], block)
            elif kind == H_P:
                term = load8(V.seeds, V.w.shape[1] * j + block)
            else:
                term = load8(V.dt, block)
            store8(out, block, load8(out, block) + term * V.jac[e])
            store8(V.sizes, block, load8(V.sizes, block) + abs8(term * V.jac[e]))
    if abs(h) > _TOUCHING * (reach + abs(h)):
        return
    for c in range(V.columns):
        if abs(out[c]) > _TOUCHING * V.sizes[c]:
            V.why, V.cause = CORNER, i


@kernel
def meet_bound(P, V, j):
    """The instant is where multiplier j, which is solved for, comes to its bound."""
    out, time = V.other_dt, V.columns
    speed = V.lam[j, time]
    if not abs(speed) > 0.0:
        V.why = GRAZES
        V.cause = j
        return
    for block in range(0, time, 8):
        store8(out, block, load8(V.lam[j], block) * (-1.0 / speed))
    _take(P, V, out, j)


@kernel
def meet_clock(P, V, tick):
    """The instant is one of the clock."""
    for block in range(0, V.columns, 8):
        store8(V.other_dt, block, load8(V.clock[tick], block))
    _take(P, V, V.other_dt, P.m + P.ne)


@kernel
def meet_fold(P, V, j):
    """The instant is the fold of multiplier j at which the last arc has ended: t'(s) = 0 there, and x'(s) with it.
    Without an arc it is the zero of dg/dlambda, at which g does not read lambda."""
    if not V.on_arc:
        _change(P, V, j, G_X, V.other_dt)
        speed = V.other_dt[V.columns]
        alone = P.g_row[j + 1] - P.g_row[j] == 1 or number_unknowns(V, V.mask, P.m) == 1
        if not alone or speed == 0.0:
            V.why = UNKNOWN
            return
        for block in range(0, V.columns, 8):
            store8(V.other_dt, block, load8(V.other_dt, block) * (-1.0 / speed))
        V.why = FINE
        _take(P, V, V.other_dt, P.m + P.ne + 1)
        return
    if V.cause < 0:
        V.why = FINE  # whatever dg/dlambda = 0 leaves undetermined: along the arc all deviations are known
    _take_arc(P, V, P.m + P.ne + 1)


@kernel
def act(P, V, i, t, x, mult, status):
    """Update i acts on the deviations before its round."""
    n, m, count, time = P.n, P.m, len(P.p), V.columns
    first, last = V.write_first[i], V.write_first[i + 1]
    if first == last:
        return
    if V.fresh:
        for k in range(n):
            for block in range(0, time, 8):
                store8(V.before[k], block, load8(V.event[k], block))
                if V.acted == 0:
                    store8(V.met_w[k], block, load8(V.event[k], block))
        V.fresh = 0
    V.acted = 1
    call_act_slopes(V.act_slopes, i, t, x, mult, P.p, V.slopes)
    width = n + m + count + 1
    if m > 0:
        look(P, V, t, x, mult)
        for j in range(m):
            V.mask[j] = 1 if status[j] == SOLVED else 0
        if not multipliers(P, V, V.before, V.dt, V.mask, 0, time):
            V.why = UNKNOWN
    for r in range(first, last):
        at, k = width * (r - first), V.write_state[r]
        for block in range(0, time, 8):
            total = load8(V.dt, block) * V.slopes[at + n + m + count]
            if V.write_adds[r]:
                total = total + load8(V.event[k], block)
            for j in range(n):
                if V.slopes[at + j] != 0.0:
                    total = total + load8(V.before[j], block) * V.slopes[at + j]
            for j in range(m):
                if V.slopes[at + n + j] != 0.0:
                    total = total + load8(V.lam[j], block) * V.slopes[at + n + j]
            for j in range(count):
                if V.slopes[at + n + m + j] != 0.0:
                    total = total + load8(V.seeds, V.w.shape[1] * j + block) * V.slopes[at + n + m + j]
            store8(V.event[k], block, total)


@kernel
def end_instant(P, V, t, x, mult, status, before):
    """The field after leads back to one time; what is held from here on does not deviate from its surfaces."""
    call_fields(P.fields, t, x, mult, P.p, V.rates, V.slopes, V.sums)
    for i in range(P.n):
        for block in range(0, V.columns, 8):
            store8(V.w[i], block, load8(V.event[i], block) - load8(V.dt, block) * V.rates[i])
    hold = False
    for j in range(P.m):
        if j == V.cause and P.kind[j] == DISC and before[j] == 1 and status[j] == 1:
            V.why = GRAZES  # it slips on through its rest, beside which others turn away
        closed = status[j] == SOLVED and (
            P.kind[j] == CONTACT or P.kind[j] == SECOND_ORDER or P.kind[j] == COMPONENT
        )
        hold = hold or (closed and (V.acted != 0 or before[j] != SOLVED))
        hold = hold or (status[j] == HELD and before[j] != HELD)
    if hold:
        keep_held(P, V, t, x, mult, status, 0)
    V.inside = 0


@kernel
def _is_kept(P, V, j, status, sliding):
    """Whether deviations are kept on the surface of multiplier j. One that slides keeps them there by itself."""
    if status[j] == HELD:
        return True
    if P.kind[j] == COMPONENT:  # also where it begins to slip from rest at the very start
        return status[j] == SOLVED or (sliding != 0 and V.slopes[P.disc_of[j]] == 0.0)
    twice = P.kind[j] == CONTACT or P.kind[j] == SECOND_ORDER
    return status[j] == SOLVED and (twice or (sliding != 0 and P.kind[j] == SLIDING))


@kernel
def keep_held(P, V, t, x, mult, status, sliding):
    """Takes from the deviations V.w what leads out of the surfaces that are held, or on which it is `sliding`."""
    entries, held = V.entries_point, V.held
    if sliding:
        call_fields(P.fields, t, x, mult, P.p, V.rates, V.slopes, V.sums)
    look(P, V, t, x, mult)
    count, half = 0, held.shape[0] // 2  # gradients above, directions out of the surfaces before below
    for j in range(P.m):
        twice = P.kind[j] == CONTACT or P.kind[j] == SECOND_ORDER
        for level in range(0 if not _is_kept(P, V, j, status, sliding) else 2 if twice else 1):
            gradient, out = held[count], held[half + count]
            for i in range(P.n):
                gradient[i], out[i] = 0.0, 0.0
            for block in range(0, V.columns, 8):
                store8(V.other_dt, block, splat8(0.0))
            for e in range(entries.shape[0]):
                kind, i, k = entries[e, 0], entries[e, 1], entries[e, 2]
                if kind == (H_X if level == 0 else S_X) and i == j:
                    gradient[k] = V.jac[e]
                    _add(V, V.w[k], V.jac[e])
                elif kind == (H_P if level == 0 else S_P) and i == j:
                    for block in range(0, V.columns, 8):
                        term = load8(V.seeds, V.w.shape[1] * k + block) * V.jac[e]
                        store8(V.other_dt, block, load8(V.other_dt, block) + term)
                if level == 1 and kind == F_MULT and k == j:
                    out[i] = V.jac[e]
            for i in range(P.n if level == 0 else 0):
                out[i] = gradient[i]
            size = _product(gradient, out)
            for r in range(count):
                share = _product(held[r], out) / _product(held[r], held[half + r])
                for i in range(P.n):
                    out[i] -= share * held[half + r, i]
            pivot = _product(gradient, out)
            if abs(pivot) <= _TOUCHING * abs(size):
                continue  # the surfaces before it keep it
            count += 1
            for i in range(P.n):
                for block in range(0, V.columns, 8):
                    share8 = load8(V.other_dt, block) * (-out[i] / pivot)
                    store8(V.w[i], block, load8(V.w[i], block) + share8)


@kernel
def _add(V, row, c):
    for block in range(0, V.columns, 8):
        store8(V.other_dt, block, load8(V.other_dt, block) + load8(row, block) * c)


@kernel
def _product(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total
