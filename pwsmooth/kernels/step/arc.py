"""A step by a fold: lambda runs, and time is one of its polynomials.

Near a fold, and where lambda^3 = t, lambda has no Taylor series in t; but t(lambda) and x(lambda) have.
Chain: steps.py -> **this file**, one of the methods of `propose` (trajectory.py).
"""

import math

from numba import types

from ..intervals import time_size
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_fields, call_fold, call_jet_general, call_linear
from ..state import ARC, SLIDING, SOLVED, Control, Problem, State
from ..surface.sparse import entry, solve_dense
from ..work import Work
from .meeting import meet
from .roots import NO_ROOT, first_root
from .steps import step_within

_TURN = 1e-9  # of dt/ds: time then turns back by (1e-9)^(3/2) of an arc, less than it is known to


@kernel
def _near_fold(P, S, rows, mult_row, h):
    """The multiplier whose square-root singularity lies within three steps, or -1.

    For lambda ~ a - b sqrt(t* - t) the first two derivatives give t* - t = lambda'/(2 lambda''). So they do, and as
    near, beside a point where lambda = c_0 + c_n t^n comes to rest; the third tells: c_1 c_3/c_2^2 is 2/3 (n - 2)/(n
    - 1), which is 2 for n = 1/2, 5/3 for 1/3, and less than 2/3 for n = 2, 3, ...
    """
    found, shortest = -1, 3.0 * h
    for j in range(P.m):
        if S.status[j] == SOLVED and P.hidden[j]:
            first, second = rows[mult_row + j, 1], 2.0 * rows[mult_row + j, 2]
            third = 6.0 * rows[mult_row + j, 3]
            near = first * second > 0.0 and first / second < 2.0 * shortest
            if near and first * third > 1.5 * second * second:  # c_1 c_3 > c_2^2
                found, shortest = j, first / (2.0 * second)
    return found


@kernel
def _flattest(P, S, W):
    """The hidden switch whose residual depends least on its own multiplier, or -1."""
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    best, least = -1, math.inf
    for j in range(P.m):
        if S.status[j] == SOLVED and P.hidden[j] and P.kind[j] == SLIDING and abs(W.G[P.g_diagonal[j]]) < least:
            best, least = j, abs(W.G[P.g_diagonal[j]])
    return best


@kernel
def _known_zeros(row):
    """How many of the first terms of a series are nothing but rounding."""
    for k in range(4):
        if abs(row[k]) > 1e-12:
            return k
    return 0


@kernel
def _way_of_time(P, C, S, W, j):
    """The direction of lambda_j in which time goes on from a point where dt/dlambda_j = 0; 0 where none does."""
    for toward in range(1, -2, -2):
        if call_fold(P.fold_unit, P, C, S, W, j, toward):
            row = W.step.rows[P.n]
            for k in range(1, 5):
                if abs(row[k]) > 1e-12:
                    if row[k] > 0.0:
                        return toward
                    break
    return 0


@kernel
def _turns_back(slope, s, h, count):
    """Whether dt/ds, zero at s on an arc of length h, becomes negative there by more than rounding: a fold."""
    first, second, size, s_k, h_k = 0.0, 0.0, abs(slope[0]), 1.0, h
    for k in range(1, count):
        first += k * slope[k] * s_k
        size += abs(slope[k]) * h_k
        if k + 1 < count:
            second += (k + 1.0) * k * slope[k + 1] * s_k
        s_k *= s
        h_k *= h
    return not (second > 0.0 and 0.5 * first * first < _TURN * second * size)


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
        bias[count + m + i] = float(S.status[i])
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
    span = time_size(S)
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


@kernel
def propose_arc(P, C, S, W, h, singular):
    """Overwrites the jet of length h by an arc if a fold is near; the step's length, -1 where neither exists.

    `singular`: there is no jet.
    """
    step = W.step
    if singular:
        step.fold = _flattest(P, S, W)
        step.toward = _way_of_time(P, C, S, W, step.fold) if step.fold >= 0 else 0
    else:
        within = h if h > 0.0 else 1e-12 * time_size(S)
        step.fold = _near_fold(P, S, step.rows, step.mult_row, within)
        if step.fold < 0:
            return h
        step.toward = 1 if step.rows[step.mult_row + step.fold, 1] > 0.0 else -1
    if step.toward == 0 or not call_fold(P.fold_unit, P, C, S, W, step.fold, step.toward):
        return -1.0
    S.jets += 1
    step.kind, step.time_row, step.mult_row = ARC, P.n, P.n + 1
    return fold_step_size(P, C, S, step.rows, W)


@kernel
def end_of_arc(P, C, best, stop, singular, W):
    """What is met first where an arc ends: (share of the arc, what is met, whether that is the fold, or the stop).

    dt/ds > 0 until the fold; its zero ends the step, and so does the end of the span. `best`: the first surface.
    """
    step, K, slope = W.step, C.order, W.arc.slope
    time, power, h = step.rows[step.time_row], step.power, step.length
    fraction, folded, capped = 1.0, False, False
    W.roots.guess = 0.0
    for k in range(K):
        slope[k] = (k + 1.0) * time[k + 1]
    s = meet(P, slope, power, K - 1, _known_zeros(slope) if singular else 0, 1.0, W)
    if s <= 1.0 and not _turns_back(slope, s * h, h, K):
        # lambda^3 = t: dt/dlambda vanishes, but time goes on. Not where the step ends: the next has no series.
        if s > 0.8:
            fraction = 0.5 * s
        s = NO_ROOT
    if s < best and s <= fraction:
        folded, best = True, s
    for k in range(K + 1):
        W.roots.poly[k] = -time[k] * power[k]
    W.roots.poly[0] += stop
    s = first_root(P, W.roots, K)
    if s < min(best, fraction):
        fraction, folded, capped = s, False, True
    return fraction, best, folded, capped
