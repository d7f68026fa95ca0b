"""The step loop of the stiff path: Radau IIA or Taylor, chosen every step by h rho(J), behind the gate.

In Radau, when the next step would have h rho < TO_TAYLOR, the motion is not stiff: Taylor. In Taylor, two steps in
a row with h rho > TO_RADAU: stability and not accuracy limits the step: Radau, with four times the step.
rho comes from one power iteration per step with a vector that is carried along.
"""

import numpy as np
from numba import njit

from pwsmooth.kernels import stiff_state as S
from pwsmooth.kernels.stiff_call import (
    JACOBIAN, RATES1, SURFACES, TAYLOR, call_point, call_taylor,
)  # fmt: skip
from pwsmooth.kernels.stiff_gate import error_norm, look, passed, set_scales, step_limit
from pwsmooth.kernels.stiff_lanes import borrow
from pwsmooth.kernels.stiff_radau import (
    embedded_error, end_polynomial, extrapolate, factorise, newton, set_stages, step_polynomial,
)  # fmt: skip
from pwsmooth.kernels.stiff_taylor import defect, evaluate, taylor_length, taylor_passed

TO_TAYLOR, TO_RADAU = 10.0, 3.0
GROWTH, SHRINK = 8.0, 0.2


@njit(cache=True)
def spectral_radius(n, J, u, scratch):
    """sqrt(|J J u| / |u|) in the maximum norm; overwrites u with the direction found."""
    top = 0.0
    for _ in range(2):
        for i in range(n):
            v = 0.0
            for j in range(n):
                v += J[i, j] * u[j]
            scratch[i] = v
        for i in range(n):
            u[i] = scratch[i]
    for i in range(n):
        top = max(top, abs(u[i]))
    if not (top > 1e-280 and top < 1e280):
        for i in range(n):
            u[i] = 1.0 / (1.0 + i)
        return 0.0
    for i in range(n):
        u[i] /= top
    return np.sqrt(top)


@njit(cache=True)
def _too_short(num, h):
    return h <= 4.0 * np.finfo(np.float64).eps * abs(num[S.T]) or h < 1e-290


@njit(cache=True)
def _begin(s):
    """Rates, surfaces and the first step length at a (new) start."""
    adr, num, cnt, n = s.adr, s.num, s.cnt, len(s.x)
    if len(s.surface_state) > 0:
        call_point(adr[SURFACES], num[S.T], s.x, s.p, s.surf)
    call_point(adr[RATES1], num[S.T], s.x, s.p, s.f)
    cnt[S.F_EVALS] += 1
    cnt[S.ROWS_VALID] = 0
    cnt[S.PREDICTED] = 0
    cnt[S.FIRST] = 1
    cnt[S.STIFF_STEPS] = 0
    num[S.ETA] = 1.0
    num[S.ERR_OLD] = 1e-2
    if num[S.H] <= 0.0:
        speed = 0.0
        for i in range(n):
            speed = max(speed, abs(s.f[i]) / (s.atol[i] + num[S.RTOL] * abs(s.x[i])))
        num[S.H] = min(100.0 / speed if speed > 0.0 else np.inf, 1e-3 * num[S.H_MAX])


@njit(cache=True)
def radau_step(s, scale, newton_scale, err, scratch, scratch2, t8, mu):
    """One attempt; returns (accepted, step taken, status). After acceptance x, f, t and the next H are set."""
    adr, num, cnt, n, p, x = s.adr, s.num, s.cnt, len(s.x), s.p, s.x
    Z, W, X, F, R = s.lanes[0], s.lanes[1], s.lanes[2], s.lanes[3], s.lanes[4]
    m = cnt[S.ORDER]
    stages = 3 + 2 * m
    t, h = num[S.T], num[S.H]
    set_stages(adr, m, t, h, p, t8, s.hoisted)
    ratio = h / num[S.H_OLD] if cnt[S.PREDICTED] else np.inf
    predicted = ratio < 4.0 - m
    if predicted:
        extrapolate(m, n, ratio, s.poly, Z)
    factorise(adr, m, n, t, h, p, x, Z, predicted, s.J, mu, s.lu, scratch)
    cnt[S.JACOBIANS] += 1
    eta = max(num[S.ETA], 1e-16) ** 0.8
    converged, iterations, eta, theta = newton(
        adr, m, n, p, x, predicted, Z, W, X, F, R, t8, s.hoisted, mu, s.lu, newton_scale, num[S.KAPPA], eta, scratch
    )
    cnt[S.NEWTON] += iterations
    cnt[S.F_EVALS] += iterations * stages
    if not converged:
        num[S.H] = h * (0.5 if theta < 1.5 else 0.25)
        num[S.ETA] = 1.0
        cnt[S.REJECTED] = 1
        return False, h, S.DONE
    num[S.ETA] = eta
    again = cnt[S.FIRST] == 1 or cnt[S.REJECTED] == 1
    embedded_error(adr, m, n, t, h, p, x, s.f, Z, s.lu, R, err, scratch, scratch2, False)
    size = error_norm(n, err, scale, s.surf, num[S.RTOL])
    if again and size >= 1.0:
        embedded_error(adr, m, n, t, h, p, x, s.f, Z, s.lu, R, err, scratch, scratch2, True)
        size = error_norm(n, err, scale, s.surf, num[S.RTOL])
        cnt[S.F_EVALS] += 1
    if not np.isfinite(size):
        num[S.H] = 0.25 * h
        cnt[S.REJECTED] = 1
        return False, h, S.DONE
    size = max(size, 1e-12)
    exponent = -1.0 / (stages + 1)
    # A step that needed many iterations should not grow: its predictor was poor.
    safety = 0.9 * (2 * 15 + 1.0) / (2 * 15 + iterations)
    factor = min(GROWTH, max(SHRINK, safety * size**exponent))
    if size >= 1.0:
        num[S.H] = h * (0.1 if cnt[S.FIRST] else min(factor, 0.9))
        cnt[S.REJECTED] = 1
        return False, h, S.DONE
    for i in range(n):
        for k in range(stages):
            X[i, k] = x[i] + Z[i, k]
    gate = passed(adr, n, t8, X, p, s.surface_state, s.surf, s.values, stages)
    if gate > 0.0:
        num[S.H] = gate * h
        cnt[S.REJECTED] = 1
        return False, h, S.DONE
    if cnt[S.FIRST] == 0:
        predictive = safety * (h / num[S.H_OLD]) * (size * size / num[S.ERR_OLD]) ** exponent
        factor = max(SHRINK, min(factor, predictive))
    num[S.ERR_OLD] = max(1e-2, size)
    if cnt[S.REJECTED]:
        factor = min(factor, 1.0)
    end_polynomial(m, n, Z, s.poly)
    for i in range(n):
        x[i] = X[i, stages - 1]
    cnt[S.PREDICTED], cnt[S.FIRST], cnt[S.REJECTED], cnt[S.ROWS_VALID] = 1, 0, 0, 0
    num[S.H_OLD] = h
    num[S.T] = t + h
    num[S.H] = factor * h
    call_point(adr[RATES1], num[S.T], x, p, s.f)
    cnt[S.F_EVALS] += 1
    return True, h, S.DONE


@njit(cache=True)
def taylor_step(s, scale, scratch):
    """One attempt; returns (accepted, step taken, status). `num[H]` is the longest step allowed."""
    adr, num, cnt, n = s.adr, s.num, s.cnt, len(s.x)
    K = cnt[S.K]
    if not cnt[S.ROWS_VALID]:
        call_taylor(adr[TAYLOR], num[S.T], s.x, s.p, K, S.STRIDE, s.rows[cnt[S.ROWS_AT]])
        cnt[S.F_EVALS] += 1
        cnt[S.ROWS_VALID] = 1
    rows, other = s.rows[cnt[S.ROWS_AT]], s.rows[1 - cnt[S.ROWS_AT]]
    rtol = num[S.RTOL_TAYLOR]
    natural = taylor_length(n, K, rows, s.surface_row, s.surf, scale, rtol)
    if natural != natural:
        return False, 0.0, S.NOT_FINITE
    h = min(num[S.H], natural)
    gate = taylor_passed(K, rows, s.surface_row, s.surf, h, scratch)
    if gate > 0.0:
        num[S.H] = gate * h
        return False, h, S.DONE
    evaluate(n, K, rows, h, scratch)
    call_taylor(adr[TAYLOR], num[S.T] + h, scratch, s.p, K, S.STRIDE, other)
    cnt[S.F_EVALS] += 1
    size = defect(n, K, rows, other[:, 1], h, scale)
    if not size <= 1.0:
        num[S.H] = h * max(0.2, min(0.8, 0.9 * size ** (-1.0 / (K + 1)))) if size == size else 0.2 * h
        return False, h, S.DONE
    for i in range(n):
        s.x[i] = scratch[i]
        s.f[i] = other[i, 1]
    num[S.T] += h
    cnt[S.ROWS_AT] = 1 - cnt[S.ROWS_AT]
    cnt[S.TAYLOR_STEPS] += 1
    num[S.H_OLD] = h
    num[S.H] = natural
    return True, h, S.DONE


@njit(cache=True)
def _choose_method(s, h, scratch):
    """After an accepted step of length h: who takes the next one."""
    num, cnt, n = s.num, s.cnt, len(s.x)
    if cnt[S.MODE] == S.RADAU:
        if cnt[S.MAY_TAYLOR] and num[S.H] * spectral_radius(n, s.J, s.power, scratch) < TO_TAYLOR:
            cnt[S.MODE] = S.TAYLOR
            cnt[S.STIFF_STEPS] = 0
        return
    if not cnt[S.MAY_RADAU]:
        return
    call_point(s.adr[JACOBIAN], num[S.T], s.x, s.p, s.J)
    cnt[S.JACOBIANS] += 1
    stiff = h * spectral_radius(n, s.J, s.power, scratch) > TO_RADAU
    cnt[S.STIFF_STEPS] = cnt[S.STIFF_STEPS] + 1 if stiff else 0
    if cnt[S.STIFF_STEPS] >= 2:
        cnt[S.MODE] = S.RADAU
        cnt[S.PREDICTED] = cnt[S.REJECTED] = 0
        num[S.H] = num[S.H_OLD] = 4.0 * h
        num[S.ERR_OLD] = 1e-2
        num[S.ETA] = 1.0


@njit(cache=True)
def _polynomial(s, mode, h, start, coefficients):
    """Overwrites coefficients[i, k], of theta^k on the step just taken from `start`; returns the degree."""
    n, cnt = len(s.x), s.cnt
    if mode == S.RADAU:
        return step_polynomial(cnt[S.ORDER], n, s.lanes[0], start, coefficients)
    K = cnt[S.K]
    rows = s.rows[1 - cnt[S.ROWS_AT]]
    for i in range(n):
        power = 1.0
        for k in range(K + 1):
            coefficients[i, k] = rows[i, k] * power
            power *= h
    return K


@njit(cache=True)
def _value(coefficients, degree, i, theta):
    v = coefficients[i, degree]
    for k in range(degree - 1, -1, -1):
        v = v * theta + coefficients[i, k]
    return v


@njit(cache=True)
def integrate(lent, lent_out, steps):
    """Go on until the end, a full buffer, `steps` attempts or a failure; returns the status."""
    s, out = _borrow_run(lent), _borrow_output(lent_out)
    work = np.empty((8, len(s.x) + 8))
    status = _advance(s, out, steps, borrow(work))
    # Named once more: the scratch memory must outlive its borrowed form.
    work[0, 0] = status
    return status


@njit(cache=True)
def _borrow_run(s):
    return S.Stiff(
        borrow(s.adr), borrow(s.p), borrow(s.atol), borrow(s.surface_state), borrow(s.surface_row), borrow(s.num),
        borrow(s.cnt), borrow(s.x), borrow(s.f), borrow(s.poly), borrow(s.rows), borrow(s.power), borrow(s.surf),
        borrow(s.J), borrow(s.lu), borrow(s.lanes), borrow(s.hoisted), borrow(s.values),
        borrow(s.coefficients),
    )  # fmt: skip


@njit(cache=True)
def _borrow_output(o):
    return S.Output(
        borrow(o.t), borrow(o.x), borrow(o.degree), borrow(o.coefficients), borrow(o.length), borrow(o.count),
        borrow(o.t_eval), borrow(o.x_eval), borrow(o.event_t), borrow(o.event_index), borrow(o.event_x),
    )  # fmt: skip


@njit(cache=True)
def _advance(s, out, steps, work):
    adr, num, cnt, n, p = s.adr, s.num, s.cnt, len(s.x), s.p
    q = len(s.surface_state)
    scale, newton_scale, err, start = work[0], work[1], work[2], work[3]
    scratch, scratch2, t8, mu = work[4], work[5], work[6], work[7]
    coefficients = s.coefficients
    out.count[:] = 0
    if cnt[S.FIRST] == 2:
        _begin(s)
    for _ in range(steps):
        if num[S.T] >= num[S.T_END]:
            return S.DONE
        if cnt[S.STEPS_LEFT] <= 0:
            return S.TOO_MANY
        if out.count[0] >= len(out.t):
            return S.FULL
        cnt[S.STEPS_LEFT] -= 1
        look(adr, n, num[S.T], s.x, p, s.surface_state, s.surf)
        h = min(num[S.H], num[S.H_MAX])
        if q > 0:
            h = min(h, step_limit(n, s.surf, s.f))
        rest = num[S.T_END] - num[S.T]
        h = rest if h >= 0.99 * rest else min(h, 0.5 * rest) if h > 0.6 * rest else h
        num[S.H] = h
        if _too_short(num, h) and h < rest:
            return S.UNDERFLOW
        t, mode = num[S.T], cnt[S.MODE]
        for i in range(n):
            start[i] = s.x[i]
        if mode == S.RADAU:
            set_scales(n, s.x, num[S.RTOL], s.atol, s.surf, scale, newton_scale)
            accepted, h, status = radau_step(s, scale, newton_scale, err, scratch, scratch2, t8, mu)
        else:
            ratio = num[S.RTOL_TAYLOR] / num[S.RTOL]
            for i in range(n):
                scale[i] = (s.atol[i] + num[S.RTOL] * abs(s.x[i])) * ratio
            accepted, h, status = taylor_step(s, scale, scratch)
        if status != S.DONE:
            return status
        if not accepted:
            cnt[S.REJECTIONS] += 1
            continue
        if t + h >= num[S.T_END] or h == rest:
            num[S.T] = num[S.T_END]
        for i in range(n):
            if not np.isfinite(s.f[i]):
                return S.NOT_FINITE
        cnt[S.STEPS] += 1
        row = out.count[0]
        degree = -1
        if cnt[S.DENSE_WANTED]:
            degree = _polynomial(s, mode, h, start, out.coefficients[row])
            out.degree[row] = degree
        while cnt[S.N_EVAL] < len(out.t_eval) and out.t_eval[cnt[S.N_EVAL]] <= num[S.T]:
            if degree < 0:
                degree = _polynomial(s, mode, h, start, coefficients)
            theta = (out.t_eval[cnt[S.N_EVAL]] - t) / h
            for i in range(n):
                source = out.coefficients[row] if cnt[S.DENSE_WANTED] else coefficients
                out.x_eval[cnt[S.N_EVAL], i] = s.x[i] if theta >= 1.0 else _value(source, degree, i, theta)
            cnt[S.N_EVAL] += 1
        out.t[row], out.length[row] = num[S.T], h
        for i in range(n):
            out.x[row, i] = s.x[i]
        out.count[0] += 1
        _choose_method(s, h, scratch)
    return S.FULL
