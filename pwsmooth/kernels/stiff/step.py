"""One attempt at a step of the stiff path, by Radau IIA or by Taylor: error test, gate, next length."""

import numpy as np
from numba import types

from pwsmooth.kernels.machine.compiling import kernel, unit
from pwsmooth.kernels.machine.lanes import at
from pwsmooth.kernels.stiff import state as S
from pwsmooth.kernels.stiff.call import ATTEMPT_UNIT, RADAU, TAYLOR, call_attempt_unit, call_radau, call_taylor
from pwsmooth.kernels.stiff.gate import root
from pwsmooth.kernels.stiff.taylor import defect, evaluate, taylor_length, taylor_passed

GROWTH, SHRINK = 8.0, 0.2
LEAST_RATE = 2e-3
# Behind a layer the error constant falls from step to step; the controller may count on it up to this factor.
BOLDNESS = 1.6
# Rate of Newton's iteration beyond which a step is shortened: near a fold the next one would fail.
SLOW = 0.1
# An error that was very small by chance must not forbid the next step to keep its length.
LONGEST_MEMORY = 2.5


@kernel
def _reject(s, h):
    s.h = h
    s.rejected = 1
    return False


@kernel
def _attempt(s, t, h, ratio, eta):
    """By the code written out for this model, or by the general one."""
    adr = s.adr
    if adr[RADAU] == 0:
        return call_attempt_unit(adr[ATTEMPT_UNIT], s, t, h, ratio, eta)
    again = 1 if s.first == 1 or s.rejected == 1 else 0
    return call_radau(
        adr[RADAU], t, h, ratio, eta, s.kappa, s.rtol, again, s.p, s.x, s.f, s.weight, s.newton_weight,
        s.surf, s.poly, s.Z, s.J, s,
    )  # fmt: skip


@kernel
def radau_step(s):
    """One attempt with step h; whether it was accepted. Then x, f, t and the next h are set."""
    stages = 3 + 2 * s.order
    t, h = s.t, s.h
    ratio = h / s.h_old if s.predicted else np.inf
    # The last step's rate says nothing about a layer that this one enters: with the floor, one iteration
    # suffices only where the predicted stages, at which f was looked at, are within a few tolerances of the
    # stages found.
    eta = np.sqrt(max(s.eta, LEAST_RATE))
    eta *= np.sqrt(eta)
    result = _attempt(s, t, h, ratio, eta)
    iterations = int(s.iterations)
    s.jacobians += 1
    s.newton += iterations
    s.f_evals += iterations * stages + int(s.again)
    if result == S.NOT_CONVERGED:
        s.eta = 1.0
        return _reject(s, h * (0.5 if s.theta < 1.5 else 0.25))
    if not np.isfinite(s.error):
        return _reject(s, 0.25 * h)
    growth = root(max(s.error, 1e-12), stages + 1)
    # A step that needed many iterations should not grow: its predictor was poor.
    safety = 0.9 * 31.0 / (30.0 + iterations)
    factor = min(GROWTH, max(SHRINK, safety * growth))
    if result == S.INACCURATE:
        return _reject(s, h * (0.1 if s.first == 1 else min(factor, 0.9)))
    if result == S.GATED:
        return _reject(s, s.gate * h)
    if s.first == 0:
        predictive = safety * (h / s.h_old) * growth * growth / s.growth_old
        factor = max(SHRINK, min(BOLDNESS * factor, predictive, GROWTH))
    s.growth_old = min(growth, LONGEST_MEMORY)
    if s.theta > SLOW:
        # J changes along the step: the rate of the iteration goes with the square of the step.
        factor = min(factor, np.sqrt(SLOW / s.theta))
    if s.rejected:
        factor = min(factor, 1.0)
    s.predicted, s.first, s.rejected, s.rows_valid = 1, 0, 0, 0
    s.h_old = s.taken = h
    s.t = t + h
    s.h = factor * h
    return True


@kernel
def taylor_reach(s):
    """Length that the expansion at x allows (made if there is none yet); nan if a coefficient is."""
    n = s.n
    rows = at(s.rows, s.rows_length * s.rows_at)
    if not s.rows_valid:
        call_taylor(s.adr[TAYLOR], s.t, s.x, s.p, s.taylor_order, S.STRIDE, rows)
        s.f_evals += 1
        s.rows_valid = 1
    return taylor_length(
        n, s.q, s.taylor_order, S.STRIDE, rows, s.surface_row, s.surf, s.weight, s.rtol_taylor
    )  # fmt: skip


@kernel
def taylor_step(s):
    """One attempt of at most the step h; whether it was accepted. Where there is none, `taken` says why."""
    adr, n = s.adr, s.n
    K = s.taylor_order
    rows, ahead = at(s.rows, s.rows_length * s.rows_at), at(s.rows, s.rows_length * (1 - s.rows_at))
    natural = taylor_reach(s)
    if natural != natural:
        s.taken = np.nan
        return False
    h = min(s.h, natural)
    # What is asked for may be that short: an instant a rounding behind another.
    if natural < s.h and h < 4.0 * np.finfo(np.float64).eps * abs(s.t):
        s.taken = S.TOO_SHORT
        return False
    gate = taylor_passed(s.q, K, S.STRIDE, rows, s.surface_row, s.surf, h, s.scratch)
    if gate > 0.0:
        return _reject(s, gate * h)
    evaluate(n, K, S.STRIDE, rows, h, s.scratch)
    call_taylor(adr[TAYLOR], s.t + h, s.scratch, s.p, K, S.STRIDE, ahead)
    s.f_evals += 1
    size = defect(n, K, S.STRIDE, rows, ahead, h, s.weight)
    if not size <= 1.0:
        return _reject(s, h * (max(0.2, min(0.8, 0.9 * root(size, K + 1))) if size == size else 0.2))
    for i in range(n):
        s.x[i] = s.scratch[i]
        s.f[i] = ahead[i * S.STRIDE + 1]
    s.t += h
    s.rows_at = 1 - s.rows_at
    s.taylor_steps += 1
    s.rejected = s.first = 0
    s.h_old = s.taken = h
    # Growth is left to the next expansion: it knows its own length.
    s.h = GROWTH * h
    return True


@unit(types.int64, S.Core, types.int64)
def taylor_unit(s, task):
    """STEP: one attempt by Taylor, 1 if accepted. REACH_ONLY: overwrites `reach`."""
    if task == S.REACH_ONLY:
        s.reach = taylor_reach(s)
        return 0
    return 1 if taylor_step(s) else 0
