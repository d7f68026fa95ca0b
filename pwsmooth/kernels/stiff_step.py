"""One attempt at a step of the stiff path, by Radau IIA or by Taylor: error test, gate, next length."""

import numpy as np
from numba import types

from pwsmooth.kernels import stiff_state as S
from pwsmooth.kernels.compiling import unit
from pwsmooth.kernels.lanes import at, fused
from pwsmooth.kernels.stiff_call import ATTEMPT_UNIT, RADAU, TAYLOR, call_attempt_unit, call_radau, call_taylor
from pwsmooth.kernels.stiff_core import core
from pwsmooth.kernels.stiff_gate import root
from pwsmooth.kernels.stiff_taylor import defect, evaluate, taylor_length, taylor_passed

GROWTH, SHRINK = 8.0, 0.2
LEAST_RATE = 2e-3
# Behind a layer the error constant falls from step to step; the controller may count on it up to this factor.
BOLDNESS = 1.6
# Rate of Newton's iteration beyond which a step is shortened: near a fold the next one would fail.
SLOW = 0.1
# An error that was very small by chance must not forbid the next step to keep its length.
LONGEST_MEMORY = 2.5


@fused
def _reject(s, h):
    s.num[S.H] = h
    s.cnt[S.REJECTED] = 1
    return False


@fused
def _attempt(s, places, t, h, ratio, eta):
    """By the code written out for this model, or by the general one."""
    adr, num, cnt = s.adr, s.num, s.cnt
    if adr[RADAU] == 0:
        return call_attempt_unit(adr[ATTEMPT_UNIT], places, t, h, ratio, eta)
    again = 1 if cnt[S.FIRST] == 1 or cnt[S.REJECTED] == 1 else 0
    return call_radau(
        adr[RADAU], t, h, ratio, eta, num[S.KAPPA], num[S.RTOL], again, s.p, s.x, s.f, s.weight, s.newton_weight,
        s.surf, s.poly, s.Z, s.J, s.out,
    )  # fmt: skip


@fused
def radau_step(s, places):
    """One attempt with step num[H]; whether it was accepted. Then x, f, t and the next H are set."""
    num, cnt, out = s.num, s.cnt, s.out
    stages = 3 + 2 * cnt[S.ORDER]
    t, h = num[S.T], num[S.H]
    ratio = h / num[S.H_OLD] if cnt[S.PREDICTED] else np.inf
    # The last step's rate says nothing about a layer that this one enters: with the floor, one iteration
    # suffices only where the predicted stages, at which f was looked at, are within a few tolerances of the
    # stages found.
    eta = np.sqrt(max(num[S.ETA], LEAST_RATE))
    eta *= np.sqrt(eta)
    result = _attempt(s, places, t, h, ratio, eta)
    iterations = int(out[S.O_ITERATIONS])
    cnt[S.JACOBIANS] += 1
    cnt[S.NEWTON] += iterations
    cnt[S.F_EVALS] += iterations * stages + int(out[S.O_AGAIN])
    if result == S.NOT_CONVERGED:
        num[S.ETA] = 1.0
        return _reject(s, h * (0.5 if out[S.O_THETA] < 1.5 else 0.25))
    num[S.ETA] = out[S.O_ETA]
    if not np.isfinite(out[S.O_SIZE]):
        return _reject(s, 0.25 * h)
    growth = root(max(out[S.O_SIZE], 1e-12), stages + 1)
    # A step that needed many iterations should not grow: its predictor was poor.
    safety = 0.9 * 31.0 / (30.0 + iterations)
    factor = min(GROWTH, max(SHRINK, safety * growth))
    if result == S.INACCURATE:
        return _reject(s, h * (0.1 if cnt[S.FIRST] == 1 else min(factor, 0.9)))
    if result == S.GATED:
        return _reject(s, out[S.O_GATE] * h)
    if cnt[S.FIRST] == 0:
        predictive = safety * (h / num[S.H_OLD]) * growth * growth / num[S.GROWTH_OLD]
        factor = max(SHRINK, min(BOLDNESS * factor, predictive, GROWTH))
    num[S.GROWTH_OLD] = min(growth, LONGEST_MEMORY)
    if out[S.O_THETA] > SLOW:
        # J changes along the step: the rate of the iteration goes with the square of the step.
        factor = min(factor, np.sqrt(SLOW / out[S.O_THETA]))
    if cnt[S.REJECTED]:
        factor = min(factor, 1.0)
    cnt[S.PREDICTED], cnt[S.FIRST], cnt[S.REJECTED], cnt[S.ROWS_VALID] = 1, 0, 0, 0
    num[S.H_OLD] = num[S.TAKEN] = h
    num[S.T] = t + h
    num[S.H] = factor * h
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
    # What is asked for may be that short: an instant a rounding behind another.
    if natural < num[S.H] and h < 4.0 * np.finfo(np.float64).eps * abs(num[S.T]):
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
        return _reject(s, h * (max(0.2, min(0.8, 0.9 * root(size, K + 1))) if size == size else 0.2))
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


@unit(types.int64, types.CPointer(types.int64), types.int64)
def taylor_unit(places, task):
    """STEP: one attempt by Taylor, 1 if accepted. REACH_ONLY: overwrites num[REACH]."""
    s = core(places)
    if task == S.REACH_ONLY:
        s.num[S.REACH] = taylor_reach(s)
        return 0
    return 1 if taylor_step(s) else 0
