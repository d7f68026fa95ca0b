"""One step of Radau IIA (orders 5, 9, 13): simplified Newton iteration in the eigenbasis, embedded error.

    (mu_e/h I - J) dW_e = (V^-1 F)_e - mu_e/h W_e,    Z += V dW
    err = (mu_0/h I - J)^-1 ( f(t, x) + sum_k ERROR_k Z_k / h )         order s

Hairer and Wanner, Solving ODEs II, IV.8. J is taken at the predicted middle stage, anew in every step.
Every array of stages or eigenvalues has 8 lanes and moves as one vector; the order is a run-time index m (s =
3 + 2m).
"""

import numpy as np

from pwsmooth.kernels.lanes import (
    fused,
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
from pwsmooth.kernels.stiff_call import (
    DENSE_FACTOR,
    DENSE_SOLVE,
    FACTOR,
    HOIST,
    JACOBIAN,
    NEWTON8,
    RATES1,
    RATES8,
    SOLVE,
    call_dense_factor,
    call_dense_solve,
    call_factor,
    call_hoist,
    call_newton8,
    call_point,
    call_rates8,
    call_solve,
)  # fmt: skip
from pwsmooth.kernels.stiff_tables import DENSE, ERROR, MU, NODES, PREDICT, TO_W, TO_Z, WLANE

MAX_NEWTON = 15


@fused
def set_stages(adr, m, t, h, p, t8, c8):
    """Overwrites the stage times t8 and everything that depends on time alone, c8."""
    store8(t8, 0, load8(NODES, 8 * m) * h + t)
    if adr[HOIST] != 0:
        call_hoist(adr[HOIST], t8, p, c8)


@fused
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


@fused
def end_polynomial(m, n, Z, poly):
    """Overwrites poly[8 i + j] with the coefficient of (theta - 1)^(j+1) of the step just taken."""
    for i in range(n):
        v = splat8(0.0)
        for l in range(3 + 2 * m):
            v = v + load8(PREDICT, 64 * m + 8 * l) * Z[8 * i + l]
        store8(poly, 8 * i, v)


@fused
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


@fused
def factorise(adr, m, n, t, h, p, x, Z, predicted, J, mu, lu, scratch):
    """J at the predicted middle stage and the elimination of (mu/h) I - J; overwrites J, mu and lu."""
    middle = 1 + m
    for i in range(n):
        scratch[i] = x[i] + Z[8 * i + middle] if predicted else x[i]
    call_point(adr[JACOBIAN], t + NODES[m, middle] * h, scratch, p, J)
    store8(mu, 0, load8(MU, 8 * m) * (1.0 / h))
    if adr[FACTOR] != 0:
        call_factor(adr[FACTOR], J, mu, lu)
    else:
        call_dense_factor(adr[DENSE_FACTOR], n, J, mu, lu)


@fused
def _solve(adr, n, lu, R):
    if adr[SOLVE] != 0:
        call_solve(adr[SOLVE], lu, R)
    else:
        call_dense_solve(adr[DENSE_SOLVE], n, lu, R)


@fused
def _iterate(adr, m, n, p, x, Z, W, X, F, R, t8, c8, mu, lu, weight):
    """One Newton iteration for any n: overwrites Z, W, X, F and R, returns the norm of the increment."""
    s = 3 + 2 * m
    mr, mi = load4(mu, 0), load4(mu, 4)
    for i in range(n):
        store8(X, 8 * i, load8(Z, 8 * i) + x[i])
    call_rates8(adr[RATES8], t8, c8, X, p, F)
    for i in range(n):
        v = splat8(0.0)
        for l in range(s):
            v = v + load8(TO_W, 64 * m + 8 * l) * F[8 * i + l]
        wr, wi = load4(W, 8 * i), load4(W, 8 * i + 4)
        store4(R, 8 * i, low4(v) - (mr * wr - mi * wi))
        store4(R, 8 * i + 4, high4(v) - (mr * wi + mi * wr))
    _solve(adr, n, lu, R)
    largest = splat8(0.0)
    for i in range(n):
        store8(W, 8 * i, load8(W, 8 * i) + load8(R, 8 * i))
        v = splat8(0.0)
        for q in range(s):
            v = v + load8(TO_Z, 64 * m + 8 * q) * R[8 * i + WLANE[m, q]]
        store8(Z, 8 * i, load8(Z, 8 * i) + v)
        largest = vmax(largest, vabs(v) * weight[i])
    return largest8(largest)


@fused
def newton(adr, m, n, p, x, predicted, Z, W, X, F, R, t8, c8, mu, lu, weight, kappa, eta, scratch):
    """Solve the stages, overwriting Z; returns (converged, iterations, eta, theta).

    Converged when the estimated rest eta * |last increment| is below kappa, in units of the tolerance. `eta`
    at entry is the last step's: a good predictor may then need one iteration only.
    """
    s = 3 + 2 * m
    for i in range(n):
        if predicted:
            v = splat8(0.0)
            for l in range(s):
                v = v + load8(TO_W, 64 * m + 8 * l) * Z[8 * i + l]
            store8(W, 8 * i, v)
        else:
            store8(W, 8 * i, splat8(0.0))
            store8(Z, 8 * i, splat8(0.0))
    before, theta = 0.0, 0.0
    for it in range(MAX_NEWTON):
        if adr[NEWTON8] != 0:
            norm = call_newton8(adr[NEWTON8], m, t8, c8, x, p, mu, lu, Z, W, F, R, weight)
        else:
            norm = _iterate(adr, m, n, p, x, Z, W, X, F, R, t8, c8, mu, lu, weight)
        if not np.isfinite(norm):
            return False, it + 1, eta, 2.0
        if it > 0:
            theta = norm / before if before > 0.0 else 0.0
            if theta >= 0.99:
                # Increments at rounding level no longer shrink: that is as converged as it gets.
                return norm < 0.1 * kappa, it + 1, eta, theta
            eta = theta / (1.0 - theta)
            left = MAX_NEWTON - 1 - it
            if theta**left * eta * norm > kappa:
                return False, it + 1, eta, theta
        if eta * norm <= kappa or norm == 0.0:
            return True, it + 1, eta, theta
        before = norm
    return False, MAX_NEWTON, eta, theta


@fused
def embedded_error(adr, m, n, t, h, p, x, f0, Z, lu, R, err, scratch, scratch2, again):
    """Overwrites err; `again` filters it once more through f(t, x + err), against overestimates of stiff
    parts."""
    for i in range(n):
        v = 0.0
        for k in range(3 + 2 * m):
            v += ERROR[m, k] * Z[8 * i + k]
        err[i] = v / h
        store8(R, 8 * i, splat8(0.0))
        R[8 * i] = f0[i] + err[i]
    _solve(adr, n, lu, R)
    if again:
        for i in range(n):
            scratch[i] = x[i] + R[8 * i]
        call_point(adr[RATES1], t, scratch, p, scratch2)
        for i in range(n):
            r = scratch2[i] + err[i]
            store8(R, 8 * i, splat8(0.0))
            R[8 * i] = r
        _solve(adr, n, lu, R)
    for i in range(n):
        err[i] = R[8 * i]
