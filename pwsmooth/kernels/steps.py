"""One step's polynomial: Taylor jets of the states, the solved multipliers and the surfaces.

Three programs give one: all multipliers fixed (slip), some solved (general), and the same along the arc of a
multiplier (fold): near a fold lambda ~ sqrt(t* - t) has no Taylor series in t, but t(lambda) and x(lambda) have.
"""

import math

import numpy as np
from numba import njit

from .pointers import call_fields, call_jet_general, call_jet_slip, call_linear
from .sliding import solve_dense
from .state import SOLVED


@njit(cache=True, fastmath={"reassoc", "contract"}, inline="always")
def dot(row, power, count):
    """sum row[k] power[k]: with reassociation it runs in vector lanes, a Horner chain does not."""
    total = 0.0
    for k in range(count):
        total += row[k] * power[k]
    return total


@njit(cache=True, inline="always")
def powers(power, h, count):
    """Overwrites power[0..count-1] with 1, h, h^2, ... (blocks of eight: no serial product)."""
    power[0] = 1.0
    power[1] = h
    for k in range(2, 8):
        power[k] = power[k - 1] * h
    h8 = power[7] * h
    for k in range(8, count):
        power[k] = power[k - 8] * h8


@njit(cache=True, inline="always")
def _root_of(e, k):
    """e^(-1/k), to a few per cent: exponent bits and a linear mantissa."""
    mantissa, exponent = math.frexp(e)
    y = -(exponent - 2.0 + 2.0 * mantissa) / k
    whole = math.floor(y)
    return math.ldexp(1.0 + (y - whole), int(whole))


@njit(cache=True)
def taylor_step_size(P, C, S, rows, mult_row, any_solved):
    """Step at which the last two orders fall below the tolerance; lambda counts 100 times stronger.

    Exits from sliding are often nearly tangent: an error tol there would become sqrt(tol) in time.
    """
    K = C.order
    e0, e1 = 0.0, 0.0
    for i in range(P.n):
        weight = 1.0 / (C.atol[i] + C.rtol * abs(S.x[i]))
        e0 = max(e0, abs(rows[i, K - 1]) * weight)
        e1 = max(e1, abs(rows[i, K]) * weight)
    if any_solved:
        for j in range(P.m):
            if S.status[j] == SOLVED:
                weight = 100.0 / (C.rtol * (1.0 + abs(S.mult[j])))
                e0 = max(e0, abs(rows[mult_row + j, K - 1]) * weight)
                e1 = max(e1, abs(rows[mult_row + j, K]) * weight)
    if not (e0 < math.inf and e1 < math.inf):
        return math.nan
    h = C.max_step
    if e0 > 1e-290:
        h = min(h, _root_of(e0, K - 1))
    if e1 > 1e-290:
        h = min(h, _root_of(e1, K))
    return 0.9 * h


@njit(cache=True)
def take_jet(P, C, S, any_solved, work):
    """Overwrites work.rows with the jet at (t, x, mult); returns the row of the first multiplier, or -1 if it failed."""
    stride = work.rows.shape[1]
    if any_solved:
        for j in range(P.m):
            work.mask[j] = 1 if S.status[j] == SOLVED else 0
        code = call_jet_general(P.jet_general, S.now[0], S.x, S.mult, P.p, work.mask, C.order, stride, work.rows)
        return P.mult_row if code == 0 else -1
    call_jet_slip(P.jet_slip, S.now[0], S.x, S.mult, P.p, C.order, stride, work.rows)
    return 0


@njit(cache=True)
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


@njit(cache=True)
def take_fold_jet(P, C, S, j, toward, work):
    """Overwrites work.rows with the jet along lambda_j (direction `toward`); False where even that is singular.

    Rows: x, t, lambda_1..m. The multipliers of this program are dt/ds and dlambda_i/ds; they solve the bordered
    linear system  g_t dt/ds + G dlambda/ds = 0,  c . dlambda/ds = 1,  with c = toward e_j.
    """
    n, m, np_ = P.n, P.m, P.p.shape[0]
    work.fold_x[:n] = S.x
    work.fold_x[n] = S.now[0]
    P.fold_bias[:np_] = P.p
    P.fold_bias[np_:] = 0.0
    P.fold_bias[np_ + j] = float(toward)
    work.fold_mult[:] = 0.0
    work.fold_mask[0] = 1
    index = np.empty(m + 1, np.int64)
    index[0] = 0
    size = 1
    for i in range(m):
        work.fold_x[n + 1 + i] = S.mult[i]
        work.fold_mask[1 + i] = 1 if S.status[i] == SOLVED else 0
        if S.status[i] == SOLVED:
            index[size] = 1 + i
            size += 1
    big = m + 1
    surfaces = m + 1 + m + P.ne
    dx, h, g = np.empty(n + 1 + m), np.empty(surfaces), np.empty(big)
    G, dh = np.empty(big * big), np.empty(surfaces * (n + 2 + m))
    call_fields(P.fields_fold, 0.0, work.fold_x, work.fold_mult, P.fold_bias, dx, h, g)
    call_linear(P.linear_fold, 0.0, work.fold_x, work.fold_mult, P.fold_bias, G, dh)
    A, b = np.empty((size, size)), np.empty(size)
    for r in range(size):
        b[r] = -g[index[r]]
        for c in range(size):
            A[r, c] = G[index[r] * big + index[c]]
    if not solve_dense(A, b, size):
        return False
    for r in range(size):
        work.fold_mult[index[r]] = b[r]
    stride = work.rows.shape[1]
    code = call_jet_general(
        P.jet_fold, 0.0, work.fold_x, work.fold_mult, P.fold_bias, work.fold_mask, C.order, stride, work.rows
    )
    return code == 0


@njit(cache=True)
def fold_step_size(P, C, S, rows):
    """Step along the arc, by the same rule; the multipliers are states of this program."""
    K, n, m = C.order, P.n, P.m
    e0, e1 = 0.0, 0.0
    for i in range(n + 1 + m):
        if i < n:
            weight = 1.0 / (C.atol[i] + C.rtol * abs(S.x[i]))
        elif i == n:
            weight = 1.0 / (1e-3 * C.rtol * (1.0 + abs(S.now[0])))
        else:
            weight = 100.0 / C.rtol
        e0 = max(e0, abs(rows[i, K - 1]) * weight)
        e1 = max(e1, abs(rows[i, K]) * weight)
    if not (e0 < math.inf and e1 < math.inf):
        return math.nan
    h = 0.5  # a quarter of the multiplier's whole range
    if e0 > 1e-290:
        h = min(h, _root_of(e0, K - 1))
    if e1 > 1e-290:
        h = min(h, _root_of(e1, K))
    return 0.9 * h
