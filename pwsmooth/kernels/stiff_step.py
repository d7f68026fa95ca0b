"""One attempt at a step of the stiff path, by Radau IIA or by Taylor: error test, gate, next length."""

import numpy as np
from numba import types

from pwsmooth.kernels import stiff_state as S
from pwsmooth.kernels.lanes import at, fused, unit
from pwsmooth.kernels.stiff_call import RATES1, TAYLOR, call_point, call_taylor
from pwsmooth.kernels.stiff_gate import error_norm, passed
from pwsmooth.kernels.stiff_radau import (
    embedded_error,
    end_polynomial,
    extrapolate,
    factorise,
    newton,
    set_stages,
)
from pwsmooth.kernels.stiff_taylor import defect, evaluate, taylor_length, taylor_passed

GROWTH, SHRINK = 8.0, 0.2
LEAST_RATE = 2e-3
# An error that was very small by chance must not forbid the next step to keep its length.
LONGEST_MEMORY = 2.5


@fused
def _reject(s, h):
    s.num[S.H] = h
    s.cnt[S.REJECTED] = 1
    return False


@fused
def radau_step(s):
    """One attempt with step num[H]; whether it was accepted. Then x, f, t and the next H are set."""
    adr, num, cnt, n, x = s.adr, s.num, s.cnt, s.n, s.x
    m = cnt[S.ORDER]
    stages = 3 + 2 * m
    t, h = num[S.T], num[S.H]
    set_stages(adr, m, t, h, s.p, s.t8, s.hoisted)
    ratio = h / num[S.H_OLD] if cnt[S.PREDICTED] else np.inf
    predicted = ratio < 4.0 - m
    if predicted:
        extrapolate(m, n, ratio, s.poly, s.Z)
    factorise(adr, m, n, t, h, s.p, x, s.Z, predicted, s.J, s.mu, s.lu, s.scratch)
    cnt[S.JACOBIANS] += 1
    # The last step's rate says nothing about a layer that this one enters: with the floor, one iteration
    # suffices only where the predicted stages, at which f was looked at, are within a few tolerances of the
    # stages found.
    eta = np.sqrt(max(num[S.ETA], LEAST_RATE))
    eta *= np.sqrt(eta)
    converged, iterations, eta, theta = newton(
        adr, m, n, s.p, x, predicted, s.Z, s.W, s.X, s.F, s.R, s.t8, s.hoisted, s.mu, s.lu, s.newton_weight,
        num[S.KAPPA], eta, s.scratch,
    )  # fmt: skip
    cnt[S.NEWTON] += iterations
    cnt[S.F_EVALS] += iterations * stages
    if not converged:
        num[S.ETA] = 1.0
        return _reject(s, h * (0.5 if theta < 1.5 else 0.25))
    num[S.ETA] = eta
    embedded_error(adr, m, n, t, h, s.p, x, s.f, s.Z, s.lu, s.R, s.err, s.scratch, s.scratch2, False)
    size = error_norm(n, s.q, s.err, s.weight, s.surf, num[S.RTOL])
    if size >= 1.0 and (cnt[S.FIRST] == 1 or cnt[S.REJECTED] == 1):
        embedded_error(adr, m, n, t, h, s.p, x, s.f, s.Z, s.lu, s.R, s.err, s.scratch, s.scratch2, True)
        size = error_norm(n, s.q, s.err, s.weight, s.surf, num[S.RTOL])
        cnt[S.F_EVALS] += 1
    if not np.isfinite(size):
        return _reject(s, 0.25 * h)
    size = max(size, 1e-12)
    growth = size ** (-1.0 / (stages + 1))
    # A step that needed many iterations should not grow: its predictor was poor.
    safety = 0.9 * 31.0 / (30.0 + iterations)
    factor = min(GROWTH, max(SHRINK, safety * growth))
    if size >= 1.0:
        return _reject(s, h * (0.1 if cnt[S.FIRST] else min(factor, 0.9)))
    for i in range(n):
        for k in range(stages):
            s.X[8 * i + k] = x[i] + s.Z[8 * i + k]
    gate = passed(adr, n, s.q, s.t8, s.X, s.p, s.surface_state, s.surf, s.values, stages)
    if gate > 0.0:
        return _reject(s, gate * h)
    if cnt[S.FIRST] == 0:
        predictive = safety * (h / num[S.H_OLD]) * growth * growth / num[S.GROWTH_OLD]
        factor = max(SHRINK, min(factor, predictive))
    num[S.GROWTH_OLD] = min(growth, LONGEST_MEMORY)
    if cnt[S.REJECTED]:
        factor = min(factor, 1.0)
    end_polynomial(m, n, s.Z, s.poly)
    for i in range(n):
        x[i] = s.X[8 * i + stages - 1]
    cnt[S.PREDICTED], cnt[S.FIRST], cnt[S.REJECTED], cnt[S.ROWS_VALID] = 1, 0, 0, 0
    num[S.H_OLD] = num[S.TAKEN] = h
    num[S.T] = t + h
    num[S.H] = factor * h
    call_point(adr[RATES1], num[S.T], x, s.p, s.f)
    cnt[S.F_EVALS] += 1
    return True


@fused
def taylor_reach(s):
    """Length that the expansion at x allows (made if there is none yet); nan if a coefficient is."""
    num, cnt, n = s.num, s.cnt, s.n
    rows = at(s.rows, (n + s.q) * S.STRIDE * cnt[S.ROWS_AT])
    if not cnt[S.ROWS_VALID]:
        call_taylor(s.adr[TAYLOR], num[S.T], s.x, s.p, cnt[S.K], S.STRIDE, rows)
        cnt[S.F_EVALS] += 1
        cnt[S.ROWS_VALID] = 1
    return taylor_length(
        n, s.q, cnt[S.K], S.STRIDE, rows, s.surface_row, s.surf, s.weight, num[S.RTOL_TAYLOR]
    )  # fmt: skip


@fused
def taylor_step(s):
    """One attempt of at most num[H]; whether it was accepted; num[TAKEN] nan for a coefficient that is, or
    TOO_SHORT."""
    adr, num, cnt, n = s.adr, s.num, s.cnt, s.n
    K = cnt[S.K]
    block = (n + s.q) * S.STRIDE
    rows, ahead = at(s.rows, block * cnt[S.ROWS_AT]), at(s.rows, block * (1 - cnt[S.ROWS_AT]))
    natural = taylor_reach(s)
    if natural != natural:
        num[S.TAKEN] = np.nan
        return False
    h = min(num[S.H], natural)
    if h < 4.0 * np.finfo(np.float64).eps * abs(num[S.T]):
        num[S.TAKEN] = S.TOO_SHORT
        return False
    gate = taylor_passed(n, s.q, K, S.STRIDE, rows, s.surface_row, s.surf, h, s.scratch)
    if gate > 0.0:
        return _reject(s, gate * h)
    evaluate(n, K, S.STRIDE, rows, h, s.scratch)
    call_taylor(adr[TAYLOR], num[S.T] + h, s.scratch, s.p, K, S.STRIDE, ahead)
    cnt[S.F_EVALS] += 1
    size = defect(n, K, S.STRIDE, rows, ahead, h, s.weight)
    if not size <= 1.0:
        return _reject(s, h * (max(0.2, min(0.8, 0.9 * size ** (-1.0 / (K + 1)))) if size == size else 0.2))
    for i in range(n):
        s.x[i] = s.scratch[i]
        s.f[i] = ahead[i * S.STRIDE + 1]
    num[S.T] += h
    cnt[S.ROWS_AT] = 1 - cnt[S.ROWS_AT]
    cnt[S.TAYLOR_STEPS] += 1
    cnt[S.REJECTED] = cnt[S.FIRST] = 0
    num[S.H_OLD] = num[S.TAKEN] = h
    # Growth is left to the next expansion: it knows its own length.
    num[S.H] = GROWTH * h
    return True


@unit(types.int64(types.CPointer(types.int64)))
def radau_unit(places):
    """One attempt by Radau; 1 if accepted."""
    return 1 if radau_step(S.core(places)) else 0


@unit(types.int64(types.CPointer(types.int64), types.int64))
def taylor_unit(places, task):
    """STEP: one attempt by Taylor, 1 if accepted. REACH_ONLY: overwrites num[REACH]."""
    s = S.core(places)
    if task == S.REACH_ONLY:
        s.num[S.REACH] = taylor_reach(s)
        return 0
    return 1 if taylor_step(s) else 0
