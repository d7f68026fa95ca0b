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
from pwsmooth.kernels.stiff_events import NONE, ROUNDS, fire, next_zero, set_sides
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
    watched, jump = pointer(run.watched), pointer(run.jump)
    return S.Core(
        run.n, run.q, run.e, pointer(run.adr), pointer(run.p), pointer(run.atol), pointer(run.surface_state),
        pointer(run.surface_row), pointer(run.num), pointer(run.cnt), pointer(run.x), pointer(run.f),
        pointer(run.poly), pointer(run.rows), pointer(run.power), pointer(run.surf), pointer(run.J), pointer(run.lu),
        lanes, at(lanes, 8 * run.n), at(lanes, 16 * run.n), at(lanes, 24 * run.n), at(lanes, 32 * run.n),
        pointer(run.hoisted), pointer(run.values), work, at(work, wide), at(work, 2 * wide), at(work, 3 * wide),
        at(work, 4 * wide), at(work, 5 * wide), at(work, 6 * wide), at(work, 7 * wide), pointer(run.coefficients),
        pointer(run.kind), pointer(run.stops), pointer(run.due), watched, at(watched, run.e), at(watched, 2 * run.e),
        jump, at(jump, run.n),
    )  # fmt: skip


@njit(cache=True)
def _write_point(s, out, points):
    out.t[points], out.length[points] = s.num[S.T], s.num[S.TAKEN]
    for i in range(s.n):
        out.x[points, i] = s.x[i]
    return points + 1


@njit(cache=True)
def _write_eval(s, out, t, end, degree, coefficients):
    """States at the wanted times up to `end`, on the step from t."""
    k = s.cnt[S.N_EVAL]
    while k < len(out.t_eval) and out.t_eval[k] <= end:
        theta = (out.t_eval[k] - t) / s.num[S.TAKEN]
        for i in range(s.n):
            out.x_eval[k, i] = _value(coefficients, degree, i, theta)
        k += 1
    s.cnt[S.N_EVAL] = k


@njit(cache=True)
def _restart(s):
    """Go on from a new state: nothing of the old motion is used."""
    _begin(s)
    set_sides(s, s.num[S.T], s.x, s.f, s.num[S.TAKEN])


@njit(cache=True)
def _events(s, out, records, t, degree, coefficients):
    """Everything that happens on the step just taken from t; returns (records, terminal, changed).

    Events that change nothing are recorded and passed. At the first that changes the state, or stops, x and T become
    those just before it and scratch2 the state after. records = -1: the events at one instant do not come to an end.
    """
    num, n, h = s.num, s.n, s.num[S.TAKEN]
    theta, terminal, changed = 0.0, False, False
    at_instant = s.cnt[S.N_INSTANT] < len(out.instant_t) and num[S.T] >= out.instant_t[s.cnt[S.N_INSTANT]]
    while records + ROUNDS * s.e < len(out.event_t):
        theta = next_zero(s, coefficients, degree, t, h, theta)
        last = theta == NONE
        if last and not at_instant:
            return records, False, False
        theta = min(theta, 1.0)
        when = t + theta * h if theta < 1.0 else num[S.T]
        for i in range(n):
            s.err[i] = s.scratch2[i] = s.x[i] if theta == 1.0 else _value(coefficients, degree, i, theta)
        records, terminal, changed = fire(s, out, records, when, s.scratch2, theta, h, at_instant and theta == 1.0)
        at_instant = at_instant and theta < 1.0
        if records < 0 or terminal or changed:
            num[S.T] = when
            for i in range(n):
                s.x[i] = s.err[i]
            return records, terminal, changed
        for j in range(s.e):
            if s.kind[j] != S.TIMED and s.found[j] <= theta:
                s.side[j] = -s.side[j]
        if theta >= 1.0:
            break
    return records, False, False


@njit(cache=True)
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


@njit(cache=True)
def integrate(run, out, steps):
    """Go on until the end, a full buffer, `steps` attempts or a failure; returns the status."""
    s = _core(run)
    num, cnt, n = s.num, s.cnt, s.n
    dense = cnt[S.DENSE_WANTED] == 1
    coefficients = pointer(out.coefficients) if dense else s.coefficients
    points = records = 0
    status = S.FULL
    if cnt[S.FIRST] == 2:
        _begin(s)
        if s.e > 0:
            set_sides(s, num[S.T], s.x, s.f, 1e-3 * num[S.H_MAX])
    for _ in range(steps):
        if num[S.T] >= num[S.T_END]:
            status = S.DONE
            break
        if cnt[S.STEPS_LEFT] <= 0:
            status = S.TOO_MANY
            break
        if points + 2 > len(out.t) or records + ROUNDS * s.e >= len(out.event_t):
            break
        cnt[S.STEPS_LEFT] -= 1
        t, mode, stop = num[S.T], cnt[S.MODE], num[S.T_END]
        if cnt[S.N_INSTANT] < len(out.instant_t):
            stop = min(stop, out.instant_t[cnt[S.N_INSTANT]])
        look(s.adr, n, s.q, t, s.x, s.p, s.surface_state, s.surf)
        if _next_length(s, t, stop - t):
            status = S.UNDERFLOW
            break
        for i in range(n):
            s.start[i] = s.x[i]
        rtol = num[S.RTOL] if mode == S.RADAU else num[S.RTOL_TAYLOR]
        set_weights(n, s.q, s.x, rtol, s.atol, s.surf, s.weight, s.newton_weight)
        accepted = radau_step(s) if mode == S.RADAU else taylor_step(s)
        if not accepted:
            if num[S.TAKEN] != num[S.TAKEN]:
                status = S.NOT_FINITE
                break
            cnt[S.REJECTIONS] += 1
            continue
        if num[S.TAKEN] == stop - t:
            num[S.T] = stop
        for i in range(n):
            if not np.isfinite(s.f[i]):
                return _close(out, points, records, S.NOT_FINITE)
        cnt[S.STEPS] += 1
        here = at(coefficients, 17 * n * points) if dense else coefficients
        wanted = cnt[S.N_EVAL] < len(out.t_eval) and out.t_eval[cnt[S.N_EVAL]] <= num[S.T]
        changed = terminal = False
        if dense or wanted or s.e > 0:
            degree = _polynomial(s, mode, here)
            if dense:
                out.degree[points] = degree
            if s.e > 0:
                before = records
                records, terminal, changed = _events(s, out, records, t, degree, here)
                if records < 0:
                    return _close(out, points, before, S.EVENT_LOOP)
            if wanted:
                _write_eval(s, out, t, num[S.T], degree, here)
        points = _write_point(s, out, points)
        if terminal or changed:
            for i in range(n):
                s.x[i] = s.scratch2[i]
            if dense:  # a point of length 0: the jump
                out.degree[points] = -1
            length = num[S.TAKEN]
            num[S.TAKEN] = 0.0
            points = _write_point(s, out, points)
            num[S.TAKEN] = length
            if terminal:
                status = S.TERMINAL
                break
            num[S.H] = length
            _restart(s)
            continue
        _choose_method(s)
    return _close(out, points, records, status)


@njit(cache=True)
def _close(out, points, records, status):
    out.count[0], out.count[1] = points, records
    return status
