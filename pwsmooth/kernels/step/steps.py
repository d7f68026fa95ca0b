"""One step's polynomial: Taylor jets of the states, the solved multipliers and the surfaces.

Three programs give one: all multipliers fixed (slip), some solved (general), and the same along the arc of a
multiplier (fold): near a fold lambda ~ sqrt(t* - t) has no Taylor series in t, but t(lambda) and x(lambda) have.
"""

import math

from numba import types

from ..machine.compiling import inlined_kernel, kernel, unit
from ..machine.lanes import load8, store8
from ..machine.pointers import (
    abs8,
    at,
    bits_float,
    call_fields,
    call_jet_general,
    call_jet_slip,
    call_linear,
    float_bits,
    powers8,
    sum8,
)
from ..state import SOLVED, Control, Problem, State
from ..surface.sliding import mask_solved
from ..surface.sparse import entry, solve_dense
from ..work import Work


@inlined_kernel
def dot(row, power, count):
    """sum row[k] power[k], k < count, by blocks of eight: rows are zero from count on."""
    total = load8(row, 0) * load8(power, 0)
    for k in range(8, count, 8):
        total = total + load8(row, k) * load8(power, k)
    return sum8(total)


@inlined_kernel
def powers(power, h):
    """Overwrites all of power with 1, h, h^2, ...: blocks of eight, each h^8 times the one before."""
    h2 = h * h
    h4 = h2 * h2
    h8 = h4 * h4
    block = powers8(h)
    store8(power, 0, block)
    for k in range(8, len(power), 8):
        block = block * h8
        store8(power, k, block)


@inlined_kernel
def scaled(row, power, poly, degree, drop, sign):
    """Overwrites poly with sign * row, the first `drop` known zero orders removed, on the unit interval."""
    for k in range(0, degree - drop + 1, 8):
        store8(poly, k, load8(row, k + drop) * load8(power, k) * sign)


@inlined_kernel
def variation(row, power, K):
    """Bound of the change of a polynomial on the step."""
    total = abs8(load8(row, 0) * load8(power, 0))
    for k in range(8, K + 1, 8):
        total = total + abs8(load8(row, k) * load8(power, k))
    return sum8(total) - abs(at(row, 0))


_FLAT_REACH = 5.0  # exp(-5): within that of 0 the coefficients show all
_FLAT_SHARE = 0.7  # of the way to 0, from farther
SURFACE_ROUNDING = 1e-15  # below which a surface's series is noise, as of one that rests at 0
_ONE_BIT, _BIAS = 4503599627370496.0, 1023.0  # a double's exponent counts from -1023 in units of 2^52


@inlined_kernel
def step_within(e0, e1, C, W, longest):
    """Step at which both of the last two terms, in units of the tolerance, are below 1; nan if they are not finite.

    min(e0^(-1/(order-1)), e1^(-1/order)) by exponent bits with the mantissa as a linear fraction, there and back,
    which is up to 6 % too large. What is neglected is then below the tolerance wherever two terms shrink by a half.
    """
    if not e0 + e1 < math.inf:
        return math.nan
    log0 = (float_bits(max(e0, 1e-290)) * (1.0 / _ONE_BIT) - _BIAS) * W.step.per_order_before
    log1 = (float_bits(max(e1, 1e-290)) * (1.0 / _ONE_BIT) - _BIAS) * W.step.per_order
    return 0.94 * min(longest, bits_float(int((_BIAS - max(log0, log1)) * _ONE_BIT)))


@inlined_kernel
def taylor_step_size(P, C, S, rows, surface_rows, mult_row, any_solved, W):
    """Step at which the last two orders fall below the tolerance; lambda counts 100 times stronger.

    Exits from sliding are often nearly tangent: an error tol there would become sqrt(tol) in time. A tolerance is
    relative to the size within the step, not at its start: after every event some velocity starts from 0. A surface
    that is no state has a series of its own (an exponential that the branch in force does not contain, say).
    """
    K, rtol, atol, x, count = C.order, C.rtol, C.atol, S.x, P.n
    reach = S.step
    while True:
        half, quarter = 0.5 * reach, 0.5 * reach * reach
        e0, e1, finite = 0.0, 0.0, 0.0
        for i in range(count):
            size = max(abs(x[i]), max(half * abs(at(rows[i], 1)), quarter * abs(at(rows[i], 2))))
            weight = 1.0 / (atol[i] + rtol * size)
            e0 = max(e0, abs(at(rows[i], K - 1)) * weight)
            e1 = max(e1, abs(at(rows[i], K)) * weight)
            finite += at(rows[i], K) * 0.0  # a nan is lost in max()
        if any_solved:
            for j in range(P.m):
                if S.status[j] == SOLVED:
                    row = rows[mult_row + j]
                    weight = 100.0 / (rtol * (1.0 + abs(S.mult[j])))
                    e0 = max(e0, abs(at(row, K - 1)) * weight)
                    e1 = max(e1, abs(at(row, K)) * weight)
                    finite += at(row, K) * 0.0
        for i in range(len(surface_rows)):
            # Beyond the states' rows; a multiplier's surface only while it is not kept on it.
            if surface_rows[i] >= count and (i >= P.m or abs(S.status[i]) == 1):
                row = rows[surface_rows[i]]
                size = max(abs(at(row, 0)), max(half * abs(at(row, 1)), quarter * abs(at(row, 2))))
                W.meeting.widest[i] = max(W.meeting.widest[i], abs(at(row, 0)))
                # A surface that comes to rest on 0 is small by nature: so its size over the whole run counts too.
                weight = 1.0 / (rtol * (size + 1e-3 * W.meeting.widest[i]) + SURFACE_ROUNDING)
                e0 = max(e0, abs(at(row, K - 1)) * weight)
                e1 = max(e1, abs(at(row, K)) * weight)
                finite += at(row, K) * 0.0
        h = step_within(e0 + finite, e1, C, W, C.max_step)
        if not h < 0.5 * reach:
            return h
        reach = h  # the size was taken over far more than the step


@kernel
def keep_in_sight(C, rows, flat_rows, h, W):
    """h, shortened so that no argument of a flat function goes far on it, seen from the distance to 0 at which it is.

    tanh(u), exp(-u) and erf(u) tell nothing of what they do at 0 where u is large: a step over it, back to where they
    are as flat, would end as its polynomial says. W.step.power is that of the h returned.
    """
    if at(W.step.power, 1) != h:
        powers(W.step.power, h)
    for a in range(len(flat_rows)):
        row = rows[flat_rows[a]]
        allowed = max(_FLAT_SHARE * abs(at(row, 0)), _FLAT_REACH)
        change = variation(row, W.step.power, C.order)
        while change > allowed:
            h *= max(allowed / change, 0.5)
            powers(W.step.power, h)
            change = variation(row, W.step.power, C.order)
    return h


@kernel
def misfit(P, C, S, rows, surface_rows, mult_row, t, s, W):
    """How far rates and surfaces at s are from the step's polynomials there, in units of what is allowed.

    exp(-(v/v_s)^2) and erf are so flat far from v = 0 that no 20 coefficients tell what they do there, and the last
    ones of a series in t^4 or t^12 may all vanish: only a look at the end of the step tells. 100: K terms of the
    tolerance's size in a derivative, and what a stiff field makes of it. W.step.power is of s.
    """
    n, m, K, x, mult, power = P.n, P.m, C.order, W.step.x, W.step.mult, W.step.power
    for i in range(n):
        x[i] = dot(rows[i], power, K + 1)
    for j in range(m):
        mult[j] = dot(rows[mult_row + j], power, K + 1) if S.status[j] == SOLVED else S.mult[j]
    call_fields(P.fields, t + s, x, mult, P.p, W.dx, W.h, W.g)
    for j in range(m):
        if S.status[j] == SOLVED and P.surface_state[j] >= 0:
            W.dx[P.surface_state[j]] = 0.0  # exactly, by construction
    worst = 0.0
    for i in range(n):
        rise = load8(rows[i], 0) * load8(power, 0) * load8(W.roots.counting, 0)
        for k in range(8, K + 1, 8):
            rise = rise + load8(rows[i], k) * load8(power, k) * load8(W.roots.counting, k)
        size = max(max(abs(at(rows[i], 0)), abs(x[i])), s * abs(at(rows[i], 1)))
        worst = max(worst, abs(s * W.dx[i] - sum8(rise)) / (C.atol[i] + C.rtol * size))
    for i in range(m + P.ne):
        if surface_rows[i] >= n and (i >= m or abs(S.status[i]) == 1):
            row = rows[surface_rows[i]]
            size = max(abs(at(row, 0)), max(s * abs(at(row, 1)), s * s * abs(at(row, 2))))
            tolerance = C.rtol * (size + 1e-3 * W.meeting.widest[i]) + SURFACE_ROUNDING
            worst = max(worst, abs(W.h[i] - dot(row, power, K + 1)) / tolerance)
    return 0.01 * worst


@inlined_kernel
def take_slip_jet(P, C, S, work):
    """Overwrites work.step.rows with the jet at (t, x, mult), every multiplier constant."""
    stride = work.step.rows.shape[1]
    own = P.own_slip * stride
    call_jet_slip(P.jet_slip, S.t, S.x, S.mult, P.p, C.order, stride, work.step.rows, own)


@inlined_kernel
def take_jet(P, C, S, any_solved, work):
    """Overwrites step.rows with the jet at (t, x, mult); returns the row of the first multiplier, -1 if it failed."""
    if any_solved:
        mask_solved(P, S, work)
        K, stride = C.order, work.step.rows.shape[1]
        own = P.own_general * stride
        code = call_jet_general(P.jet_general, S.t, S.x, S.mult, P.p, work.mask, K, stride, work.step.rows, own)
        return P.mult_row if code == 0 else -1
    take_slip_jet(P, C, S, work)
    return 0


@kernel
def near_fold(P, S, rows, mult_row, h):
    """The multiplier whose square-root singularity lies within three steps, or -1.

    For lambda ~ a - b sqrt(t* - t) the first two derivatives give t* - t = lambda'/(2 lambda'').
    """
    found, shortest = -1, 3.0 * h
    for j in range(P.m):
        if S.status[j] == SOLVED and P.hidden[j]:
            first, second = rows[mult_row + j, 1], 2.0 * rows[mult_row + j, 2]
            if first * second > 0.0 and first / second < 2.0 * shortest:
                found, shortest = j, first / (2.0 * second)
    return found


@unit(types.int64, Problem, Control, State, Work, types.int64, types.int64)
def fold_jet(P, C, S, W, j, toward):
    """Overwrites W.step.rows with the jet along lambda_j (direction `toward`); 0 where even that is singular.

    Rows: x, t, lambda_1..m. The multipliers of this program are dt/ds and dlambda_i/ds; they solve the bordered
    linear system  g_t dt/ds + G dlambda/ds = 0,  c . dlambda/ds = 1,  with c = toward e_j.
    """
    arc = W.arc
    n, m, count = P.n, P.m, len(P.p)
    bias, mult, mask, index = P.fold_bias, arc.mult, arc.mask, arc.index
    for i in range(n):
        arc.x[i] = S.x[i]
    arc.x[n] = S.t
    for i in range(count):
        bias[i] = P.p[i]
    mask[0] = 1
    mult[0] = 0.0
    index[0] = 0
    size = 1
    for i in range(m):
        bias[count + i] = float(toward) if i == j else 0.0
        arc.x[n + 1 + i] = S.mult[i]
        mult[1 + i] = 0.0
        mask[1 + i] = 1 if S.status[i] == SOLVED else 0
        if S.status[i] == SOLVED:
            index[size] = 1 + i
            size += 1
    call_fields(P.fields_fold, 0.0, arc.x, mult, bias, arc.dx, arc.h, arc.g)
    call_linear(P.linear_fold, 0.0, arc.x, mult, bias, arc.G, arc.dh)
    for r in range(size):
        for c in range(size):
            arc.matrix[r, c] = entry(P.fold_row, P.fold_col, arc.G, index[r], index[c])
        arc.matrix[r, size] = -arc.g[index[r]]
    if not solve_dense(arc.matrix, size, 1):
        return 0
    for r in range(size):
        mult[index[r]] = arc.matrix[r, size]
    stride = W.step.rows.shape[1]
    own = P.own_fold * stride
    code = call_jet_general(P.jet_fold, 0.0, arc.x, mult, bias, mask, C.order, stride, W.step.rows, own)
    return 1 if code == 0 else 0


@kernel
def fold_step_size(P, C, S, rows, W):
    """Step along the arc, by the same rule; the multipliers are states of this program.

    Time is also to be told within the step, by a thousandth of the tolerance: a fold may be 1e-7 away, and what ends
    the step there is the zero of dt/ds.
    """
    K, n, m = C.order, P.n, P.m
    span = 1.0 + abs(S.t)
    tolerance, h = 1e-3 * C.rtol * span, 0.0
    for _ in range(2):
        e0, e1, finite = 0.0, 0.0, 0.0
        for i in range(n + 1 + m):
            if i < n:
                weight = 1.0 / (C.atol[i] + C.rtol * abs(S.x[i]))
            elif i == n:
                weight = 1.0 / tolerance
            else:
                weight = 100.0 / C.rtol
            e0 = max(e0, abs(rows[i, K - 1]) * weight)
            e1 = max(e1, abs(rows[i, K]) * weight)
            finite += rows[i, K] * 0.0
        h = step_within(e0 + finite, e1, C, W, 0.5)  # at most a quarter of the multiplier's whole range
        passed = max(h * abs(rows[n, 1]), max(h * h * abs(rows[n, 2]), h * h * h * abs(rows[n, 3])))
        tolerance = min(tolerance, max(1e-3 * C.rtol, 1e-12) * passed + 1e-300)
    return h
