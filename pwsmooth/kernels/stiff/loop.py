"""The step loop of the stiff path: Radau IIA or Taylor, chosen every step by h rho(J), behind the gate.

In Radau, when the next step would have h rho < TO_TAYLOR, the motion may not be stiff: an expansion there
says how far Taylor would go, and it takes over if that is the better bargain. In Taylor, two steps in a row
with h rho > TO_RADAU: stability and not accuracy limits the step: Radau, with four times the step.
rho comes from one power iteration per step with a vector that is carried along.
"""

import numpy as np
from numba import types

from pwsmooth.kernels.machine.compiling import kernel, unit
from pwsmooth.kernels.machine.lanes import at
from pwsmooth.kernels.outcome import Outcome
from pwsmooth.kernels.state import AGAIN, GO_ON, MOST_AT_ONCE
from pwsmooth.kernels.stiff import state as S
from pwsmooth.kernels.stiff.call import (  # fmt: skip
    EVENTS_UNIT,
    JACOBIAN,
    RATES1,
    SURFACES,
    TAYLOR_UNIT,
    call_events_unit,
    call_point,
    call_taylor_unit,
)
from pwsmooth.kernels.stiff.events import set_sides, start_sides, value
from pwsmooth.kernels.stiff.gate import look, set_weights, step_limit
from pwsmooth.kernels.stiff.radau import step_polynomial
from pwsmooth.kernels.stiff.step import radau_step

TO_TAYLOR, TO_RADAU = 10.0, 3.0
BARGAIN = 1.5  # time of a Radau step over time of a Taylor step
PATIENCE = 4  # Radau steps before Taylor is asked again
STALL = 8192  # attempts within which the time must advance by LEAST_ADVANCE


@kernel
def spectral_radius(s, u, scratch):
    """sqrt(|J J u| / |u|) in the maximum norm, of a model without sums over elements; overwrites u with the direction
    found."""
    n = s.n
    for _ in range(2):
        for i in range(n):
            scratch[i] = 0.0
        for k in range(s.entries):
            scratch[s.J_row[k]] += s.J[k] * u[s.J_column[k]]
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


@kernel
def _begin(s):
    """Rates, surfaces and the first step length at a (new) start."""
    adr = s.adr
    if s.q > 0:
        call_point(adr[SURFACES], s.t, s.x, s.p, s.surf)
    call_point(adr[RATES1], s.t, s.x, s.p, s.f)
    s.f_evals += 1
    s.rows_valid = s.predicted = s.stiff_steps = s.rejected = 0
    s.first = 1
    s.eta = s.growth_old = 1.0
    if s.h <= 0.0:
        speed = 0.0
        for i in range(s.n):
            speed = max(speed, abs(s.f[i]) / (s.atol[i] + s.rtol * abs(s.x[i])))
        s.h = min(100.0 / speed if speed > 0.0 else np.inf, 1e-3 * s.h_max)
        if s.mode == S.TAYLOR:  # an expansion knows its own length
            s.h = s.h_max


@kernel
def _choose_method(s):
    """After an accepted step: who takes the next one."""
    if s.mode == S.RADAU:
        trace = 0.0
        for k in range(s.entries):
            if s.J_row[k] == s.J_column[k]:
                trace += s.J[k]
        # |trace| / n is below the spectral radius, and often settles it.
        if not s.may_taylor or s.h * abs(trace) > s.n * TO_TAYLOR:
            return
        if s.wait > 0:
            s.wait -= 1
            return
        if s.h * spectral_radius(s, s.power, s.scratch) < TO_TAYLOR:
            look(s.adr, s.q, s.t, s.x, s.p, s.surface_state, s.surf)
            set_weights(s, s.rtol_taylor)
            call_taylor_unit(s.adr[TAYLOR_UNIT], s, S.REACH_ONLY)
            if BARGAIN * s.reach > s.h:
                s.mode = S.TAYLOR
                s.stiff_steps = 0
                s.h = s.h_max
            else:
                s.wait = PATIENCE
        return
    if not s.may_radau:
        return
    call_point(s.adr[JACOBIAN], s.t, s.x, s.p, s.J)
    s.jacobians += 1
    stiff = s.taken * spectral_radius(s, s.power, s.scratch) > TO_RADAU
    s.stiff_steps = s.stiff_steps + 1 if stiff else 0
    if s.stiff_steps >= 2:
        s.mode = S.RADAU
        s.predicted = s.rejected = 0
        s.h = s.h_old = 4.0 * s.taken
        s.eta = s.growth_old = 1.0


@kernel
def _polynomial(s, mode, coefficients):
    """Overwrites coefficients[17 i + k], of theta^k on the step just taken; returns the degree."""
    n = s.n
    if mode == S.RADAU:
        return step_polynomial(s.order, n, s.Z, s.start, coefficients)
    rows = at(s.rows, s.rows_length * (1 - s.rows_at))
    for i in range(n):
        power = 1.0
        for k in range(s.taylor_order + 1):
            coefficients[17 * i + k] = rows[i * S.STRIDE + k] * power
            power *= s.taken
    return s.taylor_order


@kernel
def _write_point(s, length, degree):
    point = s.points
    s.times[point], s.length[point], s.degree[point] = s.t, length, degree
    for i in range(s.n):
        s.states[s.n * point + i] = s.x[i]
    s.points = point + 1


@kernel
def _write_eval(s, t, degree, coefficients):
    """States at the wanted times up to T, on the step from t."""
    k = s.samples
    while k < s.evals and s.t_eval[k] <= s.t:
        theta = (s.t_eval[k] - t) / s.taken
        for i in range(s.n):
            s.x_eval[s.n * k + i] = value(coefficients, degree, i, theta)
        k += 1
    s.samples = k


@kernel
def _next_length(s, t, rest):
    """h within what the user, the gate and the rest of the way allow."""
    h = min(s.h, s.h_max)
    if s.q > 0:
        h = min(h, step_limit(s, s.f))
    if h >= 0.99 * rest:
        h = rest
    elif h > 0.6 * rest:  # two equal steps rather than a sliver at the end
        h = 0.5 * rest
    s.h = h
    return h < 1e-290 or (h < 4.0 * np.finfo(np.float64).eps * abs(t) and h < rest)


@kernel
def _after_step(s, t, mode):
    """Polynomial, events and wanted times of the step just accepted from t; returns GO_ON, AGAIN or the Outcome."""
    n = s.n
    dense = s.dense == 1
    wanted = s.samples < s.evals and s.t_eval[s.samples] <= s.t
    offset = 17 * n * s.points if dense else 0
    degree, code, jumped = -1, GO_ON, 0
    if dense or wanted or s.e > 0:
        degree = _polynomial(s, mode, at(s.coefficients, offset))
        if s.e > 0:
            s.jumped = 0
            code = call_events_unit(s.adr[EVENTS_UNIT], s, t, degree, offset)
            if code == Outcome.EVENT_LOOP or code == AGAIN:
                return code
            jumped = s.jumped
        if wanted:
            _write_eval(s, t, degree, at(s.coefficients, offset))
    length = s.taken
    _write_point(s, length, degree)
    if code != GO_ON or jumped:
        for i in range(n):
            s.x[i] = s.scratch2[i]
        if code == Outcome.EVENTS_ACCUMULATE:
            s.t = s.event_t[s.records - 1]
        _write_point(s, 0.0, -1)  # the jump
        if code != GO_ON:
            return code
        # Start afresh after the jump; where two instants lie within rounding the old step is no guide either.
        s.h = length if length > 64.0 * np.finfo(np.float64).eps * abs(s.t) else 0.0
        _begin(s)
        if set_sides(s, s.t, s.x, s.f, length):
            s.points -= 1
            _write_point(s, 0.0, -1)
            _begin(s)
    else:
        _choose_method(s)
    return GO_ON


@kernel
def _stalled(s):
    """Whether the last STALL attempts led nowhere: at the end of existence steps may stay at the size of the tolerance
    for ever, each a little wrong, without any of them being too short."""
    s.since_mark += 1
    if s.since_mark < STALL:
        return False
    stalled = s.t - s.mark < s.least_advance
    s.since_mark, s.mark = 0, s.t
    return stalled


@unit(types.int64, S.Core, types.int64)
def integrate(s, steps):
    """Go on until the end, a full buffer, `steps` attempts or a failure; returns the status."""
    s.points = s.records = 0
    if s.first == 2:
        _begin(s)
        if s.e > 0:
            start_sides(s, s.t, s.x)
            set_sides(s, s.t, s.x, s.f, 1e-3 * s.h_max)
    for _ in range(steps):
        if s.t >= s.t_end:
            return Outcome.FINISHED
        if s.steps_left <= 0:
            return Outcome.TOO_MANY_STEPS
        if s.points + 2 > s.capacity or s.records + 2 * s.e + MOST_AT_ONCE >= s.room:
            break
        if _stalled(s):
            return Outcome.STEP_UNDERFLOW
        s.steps_left -= 1
        t, mode, stop = s.t, s.mode, s.t_end
        if s.ticks < s.instants:
            stop = min(stop, s.instant_t[s.ticks])
        look(s.adr, s.q, t, s.x, s.p, s.surface_state, s.surf)
        if _next_length(s, t, stop - t):
            return Outcome.STEP_UNDERFLOW
        for i in range(s.n):
            s.start[i] = s.x[i]
        rtol = s.rtol if mode == S.RADAU else s.rtol_taylor
        set_weights(s, rtol)
        if mode == S.RADAU:
            accepted = radau_step(s)
        else:
            accepted = call_taylor_unit(s.adr[TAYLOR_UNIT], s, S.STEP) == 1
        if not accepted:
            if s.taken != s.taken:
                return Outcome.NOT_FINITE
            if s.taken == S.TOO_SHORT:
                return Outcome.STEP_UNDERFLOW
            s.rejections += 1
            continue
        if s.taken == stop - t:
            s.t = stop
        for i in range(s.n):
            if not np.isfinite(s.f[i]):
                return Outcome.NOT_FINITE
        s.steps += 1
        status = _after_step(s, t, mode)
        if status == AGAIN:
            s.t = t
            s.steps -= 1
            s.rejections += 1
            for i in range(s.n):
                s.x[i] = s.start[i]
            _begin(s)
        elif status != GO_ON:
            return status
    return Outcome.OUT_OF_MEMORY
