"""The step loop of the stiff path: Radau IIA or Taylor, chosen every step by h rho(J), behind the gate.

In Radau, when the next step would have h rho < TO_TAYLOR, the motion may not be stiff: an expansion there says how
far Taylor would go, and it takes over if that is the better bargain. In Taylor, two steps in a row with
h rho > TO_RADAU: stability and not accuracy limits the step: Radau, with four times the step.
rho comes from one power iteration per step with a vector that is carried along.
"""

import numpy as np
from numba import njit

from pwsmooth.kernels import stiff_state as S
from pwsmooth.kernels.stiff_call import JACOBIAN, RATES1, SURFACES, call_point
from pwsmooth.kernels.stiff_gate import look, set_weights, step_limit
from pwsmooth.kernels.stiff_lanes import at, pointer
from pwsmooth.kernels.stiff_radau import step_polynomial
from pwsmooth.kernels.stiff_step import radau_step, taylor_reach, taylor_step

TO_TAYLOR, TO_RADAU = 10.0, 3.0
BARGAIN = 1.5  # time of a Radau step over time of a Taylor step
PATIENCE = 4  # Radau steps before Taylor is asked again


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
def _choose_method(s):
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
            if BARGAIN * taylor_reach(s) > num[S.H]:
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


@njit(cache=True)
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


@njit(cache=True)
def _value(coefficients, degree, i, theta):
    v = coefficients[17 * i + degree]
    for k in range(degree - 1, -1, -1):
        v = v * theta + coefficients[17 * i + k]
    return v


@njit(cache=True)
def _core(run):
    lanes, work, wide = pointer(run.lanes), pointer(run.work), run.n + 8
    return S.Core(
        run.n, run.q, run.e, pointer(run.adr), pointer(run.p), pointer(run.atol), pointer(run.surface_state),
        pointer(run.surface_row), pointer(run.num), pointer(run.cnt), pointer(run.x), pointer(run.f),
        pointer(run.poly), pointer(run.rows), pointer(run.power), pointer(run.surf), pointer(run.J), pointer(run.lu),
        lanes, at(lanes, 8 * run.n), at(lanes, 16 * run.n), at(lanes, 24 * run.n), at(lanes, 32 * run.n),
        pointer(run.hoisted), pointer(run.values), work, at(work, wide), at(work, 2 * wide), at(work, 3 * wide),
        at(work, 4 * wide), at(work, 5 * wide), at(work, 6 * wide), at(work, 7 * wide), pointer(run.coefficients),
    )  # fmt: skip


@njit(cache=True)
def integrate(run, out, steps):
    """Go on until the end, a full buffer, `steps` attempts or a failure; returns the status."""
    s = _core(run)
    num, cnt, n = s.num, s.cnt, s.n
    coefficients = pointer(out.coefficients) if cnt[S.DENSE_WANTED] else s.coefficients
    out.count[:] = 0
    points = 0
    if cnt[S.FIRST] == 2:
        _begin(s)
    for _ in range(steps):
        out.count[0] = points
        if num[S.T] >= num[S.T_END]:
            return S.DONE
        if cnt[S.STEPS_LEFT] <= 0:
            return S.TOO_MANY
        if points >= len(out.t):
            return S.FULL
        cnt[S.STEPS_LEFT] -= 1
        t, mode, rest = num[S.T], cnt[S.MODE], num[S.T_END] - num[S.T]
        look(s.adr, n, s.q, t, s.x, s.p, s.surface_state, s.surf)
        h = min(num[S.H], num[S.H_MAX])
        if s.q > 0:
            h = min(h, step_limit(n, s.q, s.surf, s.f))
        if h >= 0.99 * rest:
            h = rest
        elif h > 0.6 * rest:  # two equal steps rather than a sliver at the end
            h = 0.5 * rest
        num[S.H] = h
        if h < 1e-290 or (h < 4.0 * np.finfo(np.float64).eps * abs(t) and h < rest):
            return S.UNDERFLOW
        for i in range(n):
            s.start[i] = s.x[i]
        rtol = num[S.RTOL] if mode == S.RADAU else num[S.RTOL_TAYLOR]
        set_weights(n, s.q, s.x, rtol, s.atol, s.surf, s.weight, s.newton_weight)
        accepted = radau_step(s) if mode == S.RADAU else taylor_step(s)
        if not accepted:
            if num[S.TAKEN] != num[S.TAKEN]:
                return S.NOT_FINITE
            cnt[S.REJECTIONS] += 1
            continue
        if num[S.TAKEN] == rest:
            num[S.T] = num[S.T_END]
        for i in range(n):
            if not np.isfinite(s.f[i]):
                return S.NOT_FINITE
        cnt[S.STEPS] += 1
        here = at(coefficients, 17 * n * points) if cnt[S.DENSE_WANTED] else coefficients
        degree = -1
        if cnt[S.DENSE_WANTED]:
            degree = _polynomial(s, mode, here)
            out.degree[points] = degree
        while cnt[S.N_EVAL] < len(out.t_eval) and out.t_eval[cnt[S.N_EVAL]] <= num[S.T]:
            if degree < 0:
                degree = _polynomial(s, mode, here)
            theta = (out.t_eval[cnt[S.N_EVAL]] - t) / num[S.TAKEN]
            for i in range(n):
                out.x_eval[cnt[S.N_EVAL], i] = s.x[i] if theta >= 1.0 else _value(here, degree, i, theta)
            cnt[S.N_EVAL] += 1
        out.t[points], out.length[points] = num[S.T], num[S.TAKEN]
        for i in range(n):
            out.x[points, i] = s.x[i]
        points += 1
        _choose_method(s)
    out.count[0] = points
    return S.FULL
