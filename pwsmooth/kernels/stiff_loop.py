"""The step loop of the stiff path: Radau IIA or Taylor, chosen every step by h rho(J), behind the gate.

In Radau, when the next step would have h rho < TO_TAYLOR, the motion may not be stiff: an expansion there
says how far Taylor would go, and it takes over if that is the better bargain. In Taylor, two steps in a row
with h rho > TO_RADAU: stability and not accuracy limits the step: Radau, with four times the step.
rho comes from one power iteration per step with a vector that is carried along.
"""

import numpy as np
from numba import types

from pwsmooth.kernels import stiff_state as S
from pwsmooth.kernels.compiling import unit
from pwsmooth.kernels.lanes import at, fused
from pwsmooth.kernels.state import MOST_AT_ONCE
from pwsmooth.kernels.stiff_call import (
    EVENTS_UNIT,
    JACOBIAN,
    RATES1,
    SURFACES,
    TAYLOR_UNIT,
    call_events_unit,
    call_point,
    call_taylor_unit,
)  # fmt: skip
from pwsmooth.kernels.stiff_core import core
from pwsmooth.kernels.stiff_events import set_sides, start_sides, value
from pwsmooth.kernels.stiff_gate import look, set_weights, step_limit
from pwsmooth.kernels.stiff_radau import step_polynomial
from pwsmooth.kernels.stiff_step import radau_step

TO_TAYLOR, TO_RADAU = 10.0, 3.0
BARGAIN = 1.5  # time of a Radau step over time of a Taylor step
PATIENCE = 4  # Radau steps before Taylor is asked again
STALL = 8192  # attempts within which the time must advance by LEAST_ADVANCE


@fused
def spectral_radius(n, J, u, scratch):
    """sqrt(|J J u| / |u|) in the maximum norm; overwrites u with the direction found."""
    for _ in range(2):
        for i in range(n):
            v = 0.0
            for j in range(n):
                v += J[i * n + j] * u[j]
            scratch[i] = v
        for i in range(n):
            u[i] = scratch[i]
    top = 0.0
    for i in range(n):
        top = max(top, abs(u[i]))
    if not (top > 1e-280 and top < 1e280):
        for i in range(n):
            u[i] = 1.0 / (1.0 + i)
        return 0.0
    scale = 1.0 / top
    for i in range(n):
        u[i] *= scale
    return np.sqrt(top)


@fused
def _begin(s):
    """Rates, surfaces and the first step length at a (new) start."""
    adr, num, cnt = s.adr, s.num, s.cnt
    if s.q > 0:
        call_point(adr[SURFACES], num[S.T], s.x, s.p, s.surf)
    call_point(adr[RATES1], num[S.T], s.x, s.p, s.f)
    cnt[S.F_EVALS] += 1
    cnt[S.ROWS_VALID] = cnt[S.PREDICTED] = cnt[S.STIFF_STEPS] = cnt[S.REJECTED] = 0
    cnt[S.FIRST] = 1
    num[S.ETA] = 1.0
    num[S.GROWTH_OLD] = 1.0
    if num[S.H] <= 0.0:
        speed = 0.0
        for i in range(s.n):
            speed = max(speed, abs(s.f[i]) / (s.atol[i] + num[S.RTOL] * abs(s.x[i])))
        num[S.H] = min(100.0 / speed if speed > 0.0 else np.inf, 1e-3 * num[S.H_MAX])
        if cnt[S.MODE] == S.TAYLOR:  # an expansion knows its own length
            num[S.H] = num[S.H_MAX]


@fused
def _choose_method(s, places):
    """After an accepted step: who takes the next one."""
    num, cnt = s.num, s.cnt
    if cnt[S.MODE] == S.RADAU:
        trace = 0.0
        for i in range(s.n):
            trace += s.J[i * s.n + i]
        # |trace| / n is below the spectral radius, and often settles it.
        if not cnt[S.MAY_TAYLOR] or num[S.H] * abs(trace) > s.n * TO_TAYLOR:
            return
        if cnt[S.WAIT] > 0:
            cnt[S.WAIT] -= 1
            return
        if num[S.H] * spectral_radius(s.n, s.J, s.power, s.scratch) < TO_TAYLOR:
            look(s.adr, s.n, s.q, num[S.T], s.x, s.p, s.surface_state, s.surf)
            set_weights(s.n, s.q, s.x, num[S.RTOL_TAYLOR], s.atol, s.surf, s.weight, s.newton_weight)
            call_taylor_unit(s.adr[TAYLOR_UNIT], places, S.REACH_ONLY)
            if BARGAIN * num[S.REACH] > num[S.H]:
                cnt[S.MODE] = S.TAYLOR
                cnt[S.STIFF_STEPS] = 0
                num[S.H] = num[S.H_MAX]
            else:
                cnt[S.WAIT] = PATIENCE
        return
    if not cnt[S.MAY_RADAU]:
        return
    call_point(s.adr[JACOBIAN], num[S.T], s.x, s.p, s.J)
    cnt[S.JACOBIANS] += 1
    stiff = num[S.TAKEN] * spectral_radius(s.n, s.J, s.power, s.scratch) > TO_RADAU
    cnt[S.STIFF_STEPS] = cnt[S.STIFF_STEPS] + 1 if stiff else 0
    if cnt[S.STIFF_STEPS] >= 2:
        cnt[S.MODE] = S.RADAU
        cnt[S.PREDICTED] = cnt[S.REJECTED] = 0
        num[S.H] = num[S.H_OLD] = 4.0 * num[S.TAKEN]
        num[S.GROWTH_OLD] = 1.0
        num[S.ETA] = 1.0


@fused
def _polynomial(s, mode, coefficients):
    """Overwrites coefficients[17 i + k], of theta^k on the step just taken; returns the degree."""
    n, cnt = s.n, s.cnt
    if mode == S.RADAU:
        return step_polynomial(cnt[S.ORDER], n, s.Z, s.start, coefficients)
    rows = at(s.rows, (n + s.q) * S.STRIDE * (1 - cnt[S.ROWS_AT]))
    for i in range(n):
        power = 1.0
        for k in range(cnt[S.K] + 1):
            coefficients[17 * i + k] = rows[i * S.STRIDE + k] * power
            power *= s.num[S.TAKEN]
    return cnt[S.K]


@fused
def _write_point(s, length, degree):
    point = s.cnt[S.N_POINTS]
    s.t[point], s.length[point], s.degree[point] = s.num[S.T], length, degree
    for i in range(s.n):
        s.states[s.n * point + i] = s.x[i]
    s.cnt[S.N_POINTS] = point + 1


@fused
def _write_eval(s, t, degree, coefficients):
    """States at the wanted times up to T, on the step from t."""
    k = s.cnt[S.N_EVAL]
    while k < s.evals and s.t_eval[k] <= s.num[S.T]:
        theta = (s.t_eval[k] - t) / s.num[S.TAKEN]
        for i in range(s.n):
            s.x_eval[s.n * k + i] = value(coefficients, degree, i, theta)
        k += 1
    s.cnt[S.N_EVAL] = k


@fused
def _next_length(s, t, rest):
    """num[H] within what the user, the gate and the rest of the way allow."""
    num = s.num
    h = min(num[S.H], num[S.H_MAX])
    if s.q > 0:
        h = min(h, step_limit(s.n, s.q, s.surf, s.f))
    if h >= 0.99 * rest:
        h = rest
    elif h > 0.6 * rest:  # two equal steps rather than a sliver at the end
        h = 0.5 * rest
    num[S.H] = h
    return h < 1e-290 or (h < 4.0 * np.finfo(np.float64).eps * abs(t) and h < rest)


@fused
def _after_step(s, places, t, mode):
    """Polynomial, events and wanted times of the step just accepted from t; returns the status, FULL to go
    on."""
    num, cnt, n = s.num, s.cnt, s.n
    dense = cnt[S.DENSE_WANTED] == 1
    wanted = cnt[S.N_EVAL] < s.evals and s.t_eval[cnt[S.N_EVAL]] <= num[S.T]
    offset = 17 * n * cnt[S.N_POINTS] if dense else 0
    degree, happened = -1, S.NOTHING
    if dense or wanted or s.e > 0:
        degree = _polynomial(s, mode, at(s.coefficients, offset))
        if s.e > 0:
            happened = call_events_unit(s.adr[EVENTS_UNIT], places, t, degree, offset)
            if happened == S.NO_END:
                return S.EVENT_LOOP
        if wanted:
            _write_eval(s, t, degree, at(s.coefficients, offset))
    length = num[S.TAKEN]
    _write_point(s, length, degree)
    if happened != S.NOTHING:
        for i in range(n):
            s.x[i] = s.scratch2[i]
        if happened == S.LIMIT:
            num[S.T] = s.event_t[cnt[S.N_RECORDS] - 1]
        _write_point(s, 0.0, -1)  # the jump
        if happened == S.STOP:
            return S.TERMINAL
        if happened == S.LIMIT:
            return S.ACCUMULATED
        # Nothing of the old motion is used, and not even its step if an instant is a rounding behind another.
        num[S.H] = length if length > 64.0 * np.finfo(np.float64).eps * abs(num[S.T]) else 0.0
        _begin(s)
        if set_sides(s, num[S.T], s.x, s.f, length):
            _begin(s)
    else:
        _choose_method(s, places)
    return S.FULL


@fused
def _stalled(s):
    """Whether the last STALL attempts led nowhere: at the end of existence steps may stay at the size of the tolerance
    for ever, each a little wrong, without any of them being too short."""
    num, cnt = s.num, s.cnt
    cnt[S.SINCE_MARK] += 1
    if cnt[S.SINCE_MARK] < STALL:
        return False
    stalled = num[S.T] - num[S.MARK] < num[S.LEAST_ADVANCE]
    cnt[S.SINCE_MARK], num[S.MARK] = 0, num[S.T]
    return stalled


@unit(types.int64, types.CPointer(types.int64), types.int64)
def integrate(places, steps):
    """Go on until the end, a full buffer, `steps` attempts or a failure; returns the status."""
    s = core(places)
    num, cnt = s.num, s.cnt
    cnt[S.N_POINTS] = cnt[S.N_RECORDS] = 0
    if cnt[S.FIRST] == 2:
        _begin(s)
        if s.e > 0:
            start_sides(s, num[S.T], s.x)
            set_sides(s, num[S.T], s.x, s.f, 1e-3 * num[S.H_MAX])
    for _ in range(steps):
        if num[S.T] >= num[S.T_END]:
            return S.DONE
        if cnt[S.STEPS_LEFT] <= 0:
            return S.TOO_MANY
        if cnt[S.N_POINTS] + 2 > s.capacity or cnt[S.N_RECORDS] + 2 * s.e + MOST_AT_ONCE >= s.room:
            break
        if _stalled(s):
            return S.UNDERFLOW
        cnt[S.STEPS_LEFT] -= 1
        t, mode, stop = num[S.T], cnt[S.MODE], num[S.T_END]
        if cnt[S.N_INSTANT] < s.instants:
            stop = min(stop, s.instant_t[cnt[S.N_INSTANT]])
        look(s.adr, s.n, s.q, t, s.x, s.p, s.surface_state, s.surf)
        if _next_length(s, t, stop - t):
            return S.UNDERFLOW
        for i in range(s.n):
            s.start[i] = s.x[i]
        rtol = num[S.RTOL] if mode == S.RADAU else num[S.RTOL_TAYLOR]
        set_weights(s.n, s.q, s.x, rtol, s.atol, s.surf, s.weight, s.newton_weight)
        if mode == S.RADAU:
            accepted = radau_step(s, places)
        else:
            accepted = call_taylor_unit(s.adr[TAYLOR_UNIT], places, S.STEP) == 1
        if not accepted:
            if num[S.TAKEN] != num[S.TAKEN]:
                return S.NOT_FINITE
            if num[S.TAKEN] == S.TOO_SHORT:
                return S.UNDERFLOW
            cnt[S.REJECTIONS] += 1
            continue
        if num[S.TAKEN] == stop - t:
            num[S.T] = stop
        for i in range(s.n):
            if not np.isfinite(s.f[i]):
                return S.NOT_FINITE
        cnt[S.STEPS] += 1
        status = _after_step(s, places, t, mode)
        if status != S.FULL:
            return status
    return S.FULL
