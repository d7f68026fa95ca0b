"""One attempt at a step of Radau IIA (orders 5, 9, 13), for every model: Newton iteration in the eigenbasis, embedded
error, gate. Small models have it written out (codegen/stiff/attempt.py).

    (mu_e/h I - J) dW_e = (V^-1 F)_e - mu_e/h W_e,    Z += V dW
    err = (mu_0/h I - J)^-1 ( f(t, x) + sum_k ERROR_k Z_k / h )         order s

Hairer and Wanner, Solving ODEs II, IV.8. J is taken at the predicted middle stage, anew in every step.
f(t, x) is the slope of the last collocation polynomial at its end: it costs nothing, and in a stiff direction it is
nearer to the motion than f at a point that is off by the Newton tolerance.
Every array of stages or eigenvalues has 8 lanes and moves as one vector; the order is a run-time index m (s =
3 + 2m).
"""

from numba import types

from pwsmooth.kernels.machine.compiling import kernel, unit
from pwsmooth.kernels.machine.lanes import (
    high4,
    largest8,
    load4,
    load8,
    low4,
    splat8,
    store4,
    store8,
    vabs,
    vmax,
)
from pwsmooth.kernels.stiff import state as S
from pwsmooth.kernels.stiff.call import (  # fmt: skip
    FACTOR,
    HOIST,
    JACOBIAN,
    RATES1,
    RATES8,
    SOLVE,
    SPARSE_FACTOR,
    SPARSE_SOLVE,
    call_factor,
    call_hoist,
    call_point,
    call_rates8,
    call_solve,
    call_sparse_factor,
    call_sparse_solve,
)
from pwsmooth.kernels.stiff.gate import error_norm, passed
from pwsmooth.kernels.stiff.rules import DOUBLINGS, LONGEST_PREDICTION, MAX_NEWTON
from pwsmooth.kernels.stiff.tables import DENSE, ERROR, MU, NODES, PREDICT, TO_W, TO_Z, WLANE


@kernel
def set_stages(adr, m, t, h, p, t8, c8):
    """Overwrites the stage times t8 and everything that depends on time alone, c8."""
    store8(t8, 0, load8(NODES, 8 * m) * h + t)
    if adr[HOIST] != 0:
        call_hoist(adr[HOIST], t8, p, c8)


@kernel
def extrapolate(m, n, ratio, poly, Z):
    """Overwrites Z with the last collocation polynomial beyond its end: at (1 + ratio c_k), less its end
    value."""
    s = 3 + 2 * m
    tau = load8(NODES, 8 * m) * ratio
    for i in range(n):
        v = tau * poly[8 * i + s - 1]
        for j in range(s - 2, -1, -1):
            v = tau * (v + poly[8 * i + j])
        store8(Z, 8 * i, v)


@kernel
def end_polynomial(m, n, Z, poly):
    """Overwrites poly[8 i + j] with the coefficient of (theta - 1)^(j+1) of the step just taken."""
    for i in range(n):
        v = splat8(0.0)
        for l in range(3 + 2 * m):
            v = v + load8(PREDICT, 64 * m + 8 * l) * Z[8 * i + l]
        store8(poly, 8 * i, v)


@kernel
def step_polynomial(m, n, Z, x, coefficients):
    """Overwrites coefficients[17 i + j], of theta^j, j = 0..s, with the collocation polynomial of the step."""
    s = 3 + 2 * m
    for i in range(n):
        coefficients[17 * i] = x[i]
        for j in range(s):
            v = 0.0
            for l in range(s):
                v += DENSE[m, l, j] * Z[8 * i + l]
            coefficients[17 * i + j + 1] = v
    return s


@kernel
def factorise(s, t, h, predicted):
    """J at the predicted middle stage and the elimination of (mu/h) I - J; overwrites J, mu and lu."""
    m = s.order
    middle = 1 + m
    for i in range(s.n):
        s.scratch[i] = s.x[i] + s.Z[8 * i + middle] if predicted else s.x[i]
    call_point(s.adr[JACOBIAN], t + NODES[m, middle] * h, s.scratch, s.p, s.J)
    store8(s.mu, 0, load8(MU, 8 * m) * (1.0 / h))
    if s.adr[FACTOR] != 0:
        call_factor(s.adr[FACTOR], s.J, s.mu, s.lu)
    else:
        call_sparse_factor(s.adr[SPARSE_FACTOR], s.elimination, s.J, s.mu, s.lu)


@kernel
def _solve(s):
    """Overwrites R with the solutions."""
    if s.adr[SOLVE] != 0:
        call_solve(s.adr[SOLVE], s.lu, s.R)
    else:
        call_sparse_solve(s.adr[SPARSE_SOLVE], s.elimination, s.lu, s.R)


@kernel
def _iterate(s):
    """One Newton iteration for any n: overwrites Z, W, X, F and R, returns the norm of the increment."""
    m, n, x, Z, W, X, F, R, weight = s.order, s.n, s.x, s.Z, s.W, s.X, s.F, s.R, s.newton_weight
    stages = 3 + 2 * m
    mr, mi = load4(s.mu, 0), load4(s.mu, 4)
    for i in range(n):
        store8(X, 8 * i, load8(Z, 8 * i) + x[i])
    call_rates8(s.adr[RATES8], s.t8, s.hoisted, X, s.p, F)
    for i in range(n):
        v = splat8(0.0)
        for l in range(stages):
            v = v + load8(TO_W, 64 * m + 8 * l) * F[8 * i + l]
        wr, wi = load4(W, 8 * i), load4(W, 8 * i + 4)
        store4(R, 8 * i, low4(v) - (mr * wr - mi * wi))
        store4(R, 8 * i + 4, high4(v) - (mr * wi + mi * wr))
    _solve(s)
    largest = splat8(0.0)
    for i in range(n):
        store8(W, 8 * i, load8(W, 8 * i) + load8(R, 8 * i))
        v = splat8(0.0)
        for q in range(stages):
            v = v + load8(TO_Z, 64 * m + 8 * q) * R[8 * i + WLANE[m, q]]
        store8(Z, 8 * i, load8(Z, 8 * i) + v)
        largest = vmax(largest, vabs(v) * weight[i])
    return largest8(largest)


@kernel
def newton(s, predicted, eta):
    """Solve the stages, overwriting Z; returns (converged, iterations, eta, theta).

    Converged when the estimated rest eta * |last increment| is below kappa, in units of the tolerance. `eta`
    at entry is the last step's: a good predictor may then need one iteration only.
    """
    m, Z, W, kappa = s.order, s.Z, s.W, s.kappa
    for i in range(s.n):
        if predicted:
            v = splat8(0.0)
            for l in range(3 + 2 * m):
                v = v + load8(TO_W, 64 * m + 8 * l) * Z[8 * i + l]
            store8(W, 8 * i, v)
        else:
            store8(W, 8 * i, splat8(0.0))
            store8(Z, 8 * i, splat8(0.0))
    before, theta, rest = 0.0, 0.0, eta
    for it in range(MAX_NEWTON):
        norm = _iterate(s)
        if not norm < 1e300:
            return False, it + 1, rest, 2.0
        if it == 0:
            if eta * norm <= kappa:
                return True, 1, eta, theta
        else:
            theta = norm / before
            rest = theta / (1.0 - theta) if theta < 0.99 else eta
            if norm * norm <= kappa * (before - norm):
                return True, it + 1, rest, theta
            if not theta < 0.99:
                # Increments at rounding level no longer shrink: that is as converged as it gets.
                return norm < 0.1 * kappa, it + 1, rest, theta
            left = theta
            for _ in range(DOUBLINGS):
                left *= left
            if left * norm * norm > kappa * (before - norm):
                return False, it + 1, rest, theta
        before = norm
    return False, MAX_NEWTON, rest, theta


@kernel
def embedded_error(s, t, h, again):
    """Overwrites err; `again` filters it once more through f(t, x + err), against overestimates of stiff
    parts."""
    m, n, Z, R = s.order, s.n, s.Z, s.R
    if again:
        for i in range(n):
            s.scratch[i] = s.x[i] + s.err[i]
        call_point(s.adr[RATES1], t, s.scratch, s.p, s.scratch2)
    for i in range(n):
        v = 0.0
        for k in range(3 + 2 * m):
            v += ERROR[m, k] * Z[8 * i + k]
        store8(R, 8 * i, splat8(0.0))
        R[8 * i] = (s.scratch2[i] if again else s.f[i]) + v / h
    _solve(s)
    for i in range(n):
        s.err[i] = R[8 * i]


@unit(types.int64, S.Core, types.float64, types.float64, types.float64, types.float64)
def attempt_unit(s, t, h, ratio, eta):
    """An attempt at the step h from t: ACCEPTED, NOT_CONVERGED, INACCURATE or GATED, and its numbers in the Core.

    `ratio`: h over the length of the last step, whose polynomial predicts the stages; `eta`: the estimated rest of
    the first increment. When accepted, x, f, poly and Z are those of the step.
    """
    adr, n, x = s.adr, s.n, s.x
    m = s.order
    stages = 3 + 2 * m
    set_stages(adr, m, t, h, s.p, s.t8, s.hoisted)
    predicted = ratio < LONGEST_PREDICTION[m]
    if predicted:
        extrapolate(m, n, ratio, s.poly, s.Z)
    factorise(s, t, h, predicted)
    converged, iterations, eta, theta = newton(s, predicted, eta)
    s.iterations, s.eta, s.theta, s.again = iterations, eta, theta, 0.0
    if not converged:
        return S.NOT_CONVERGED
    embedded_error(s, t, h, False)
    size = error_norm(s)
    if not size < 1.0 and (s.first == 1 or s.rejected == 1):
        embedded_error(s, t, h, True)
        size = error_norm(s)
        s.again = 1.0
    s.error = size
    if not size < 1.0:
        return S.INACCURATE
    for i in range(n):
        store8(s.X, 8 * i, load8(s.Z, 8 * i) + x[i])
    s.gate = passed(adr, s.q, s.t8, s.X, s.p, s.surface_state, s.surf, s.values, stages)
    if s.gate > 0.0:
        return S.GATED
    end_polynomial(m, n, s.Z, s.poly)
    for i in range(n):
        x[i] = s.X[8 * i + stages - 1]
        s.f[i] = s.poly[8 * i] / h
    return S.ACCEPTED
