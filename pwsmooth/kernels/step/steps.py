"""One step's polynomial: Taylor jets of the states, the solved multipliers and the surfaces.

Two programs give one: all multipliers fixed (slip), or some solved (general). Beside them stand the arc (arc.py) and
the methods of one step (methods/).
"""

import math

from ..intervals import time_size
from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import load8, store8
from ..machine.pointers import (
    abs8,
    at,
    bits_float,
    call_fields,
    call_jet_general,
    call_jet_slip,
    call_step,
    float_bits,
    powers8,
    sum8,
)
from ..state import GENERAL, PAIR, SLIP, SOLVED, START
from ..surface.sliding import follow, mask_solved


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


_TICKS = 4e-15  # of the time: some of its roundings
REACH = 1e-11  # of the time: how near a surface is on which a power has its branch point
_NEAR = 1e-3  # of a step: so far its end moves at most where unknowns are solved for
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
    K, rtol, atol, x, count = C.order, C.rtol, W.step.atol, S.x, P.n
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
def keep_in_sight(P, C, h, W):
    """h, shortened so that no argument of a flat function goes far on it, seen from the distance to 0 at which it is.

    tanh(u), exp(-u) and erf(u) tell nothing of what they do at 0 where u is large: a step over it, back to where they
    are as flat, would end as its polynomial says. W.step.power is that of the h returned.
    """
    if at(W.step.power, 1) != h:
        powers(W.step.power, h)
    flat_rows = P.flat_general if W.step.sliding else P.flat_slip
    if W.step.time_row >= 0:
        flat_rows = P.flat_fold
    for a in range(len(flat_rows)):
        row = W.step.rows[flat_rows[a]]
        allowed = max(_FLAT_SHARE * abs(at(row, 0)), _FLAT_REACH)
        change = variation(row, W.step.power, C.order)
        while change > allowed:
            h *= max(allowed / change, 0.5)
            powers(W.step.power, h)
            change = variation(row, W.step.power, C.order)
    return h


@inlined_kernel
def surface_rows(P, kind):
    """Where among the polynomials of this kind of step the surfaces stand, -1 for none."""
    if kind == SLIP:
        return P.rows_slip
    if kind == GENERAL:
        return P.rows_general
    return P.rows_pair if kind == PAIR or kind == START else P.rows_fold


@inlined_kernel
def take_slip_jet(P, C, S, work):
    """Overwrites work.step.rows with the jet at (t, x, mult), every multiplier constant; not 0 where there is none."""
    stride = work.step.rows.shape[1]
    own = P.own_slip * stride
    return call_jet_slip(P.jet_slip, S.t, S.x, S.mult, P.p, C.order, stride, work.step.rows, own)


@inlined_kernel
def take_jet(P, C, S, any_solved, work):
    """Overwrites step.rows with the jet at (t, x, mult); returns the row of the first multiplier, -1 if it failed."""
    if any_solved:
        mask_solved(P, S, work)
        K, stride = C.order, work.step.rows.shape[1]
        own = P.own_general * stride
        code = call_jet_general(P.jet_general, S.t, S.x, S.mult, P.p, work.mask, K, stride, work.step.rows, own)
        return P.mult_row if code == 0 else -1
    return 0 if take_slip_jet(P, C, S, work) == 0 else -1


@inlined_kernel
def propose_jet(P, C, S, W):
    """Overwrites the step by Taylor series; returns how far they hold, nan if they are not finite.

    step.mult_row is -1 where the equations of the solved multipliers are singular: there is no series.
    """
    step = W.step
    step.kind = GENERAL if step.sliding else SLIP
    step.mult_row = take_jet(P, C, S, step.sliding, W)
    if step.mult_row < 0:
        return S.step if P.jet_fold != 0 else math.nan
    return taylor_step_size(P, C, S, step.rows, surface_rows(P, step.kind), step.mult_row, step.sliding, W)


@kernel
def propose_pair(P, C, S, W):
    """Overwrites the step by one of the pair; returns its length, 0 where none can be made and nan where it failed."""
    W.step.kind, W.step.mult_row = PAIR, P.n
    return call_step(P.step_unit, P, C, S, W, min(S.step, min(C.max_step, W.step.stop - S.t)), -1)


@kernel
def _first_met(P, W):
    """The surface that is met first."""
    first = 0
    for i in range(P.m + P.ne):
        if W.meeting.tau[i] < W.meeting.tau[first]:
            first = i
    return first


@kernel
def refine_by_pair(P, C, S, W, h):
    """Overwrites the step by one that ends where the first surface is met, near h; returns its length, or nan; where it
    is not met near there, less the length of a shorter one that meets nothing."""
    return call_step(P.step_unit, P, C, S, W, h, _first_met(P, W))


@kernel
def refine_by_unknowns(P, C, S, W, h):
    """Where near h the surface that is met first is 0 with its unknowns solved for, which the polynomials have to the
    tolerance of the step alone; h where no unknown stands in it."""
    step, power, rows, first, K = W.step, W.step.end_power, W.step.rows, _first_met(P, W), C.order
    if P.unknowns[first] < 0 or step.sliding == 0 or math.isnan(h):
        return h
    powers(power, h)
    for i in range(P.n):
        W.instant.x[i], S.x[i] = S.x[i], dot(rows[i], power, K + 1)
    for j in range(P.m):
        W.instant.mult[j] = S.mult[j]
        if S.status[j] == SOLVED:
            S.mult[j] = dot(rows[step.mult_row + j], power, K + 1)
    S.t += h
    mask_solved(P, S, W)
    solved, slope = follow(P, S, W), 0.0
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for k in range(K, 0, -1):
        slope = slope * h + k * rows[surface_rows(P, step.kind)[first], k]
    S.t = step.start
    for i in range(P.n):
        S.x[i] = W.instant.x[i]
    for j in range(P.m):
        S.mult[j] = W.instant.mult[j]
    by = -W.h[first] / slope if solved and slope != 0.0 else 0.0
    return h + by if abs(by) <= _NEAR * h and h + by <= step.length else h


@kernel
def _is_linear(P, C, S, W, s):
    """Whether what is not linear in the motion up to s is within the tolerance: by its rates half-way, as where no step
    can be made the series have no more terms."""
    rows, x = W.step.rows, W.step.x
    for i in range(P.n):
        x[i] = rows[i, 0] + 0.5 * s * rows[i, 1]
    call_fields(P.fields, S.t + 0.5 * s, x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(P.n):
        if not abs(W.dx[i] - rows[i, 1]) * s <= C.atol[i] + C.rtol * abs(rows[i, 0]):
            return False
    return True


@kernel
def reach_singular_surface(P, C, S, W, h):
    """A step of rounding size that ends on a surface where a power has its branch point, if linear terms suffice.

    There the Taylor steps shrink with the distance left (delta^1.5 at release) and would never arrive.
    """
    rows, mult_row, reach = W.step.rows, W.step.mult_row, REACH * time_size(S)
    all_rows = surface_rows(P, W.step.kind)
    for i in range(P.m + P.ne):
        row = all_rows[i]
        if row >= 0 and S.deflate[i] == 0 and rows[row, 1] != 0.0:
            left = -rows[row, 0] / rows[row, 1]
            if h < left < reach and (left <= _TICKS * time_size(S) or _is_linear(P, C, S, W, left)):
                # Rows further behind are what the programs keep from call to call.
                top = max(P.n, mult_row + P.m)
                for k in range(P.m + P.ne):
                    top = max(top, all_rows[k] + 1)
                for r in range(top):
                    for k in range(2, rows.shape[1]):
                        rows[r, k] = 0.0
                return 2.0 * left
    return h
