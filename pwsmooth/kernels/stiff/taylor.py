"""Explicit Taylor steps of the stiff path: for the transients inside a layer, and for everything that is not
stiff.

    x(t + s h) = sum_k x_k h^k s^k,   h from the last two coefficients (Jorba and Zou, 2005)

A truncated series cannot see a layer ahead (all derivatives of erf(h/eps) underflow outside it), so besides
the gate every step is judged by its defect, h |x'(h) - f(x(h))| / (K+1), which the next expansion gives for
nothing.
"""

import numpy as np

from pwsmooth.kernels.machine.compiling import kernel
from pwsmooth.kernels.machine.lanes import load8, splat8, store8
from pwsmooth.kernels.stiff.gate import root
from pwsmooth.kernels.stiff.rules import REACH, THETA

SAMPLES = np.arange(1, 9) / 8.0
RIM = 6.0  # in eps: where every sigmoid is at its limit to rounding, or warns early by its tail


@kernel
def _order_size(n, q, k, stride, rows, surface_row, surf, weight, rtol):
    size = 0.0
    for i in range(n):
        e = abs(rows[i * stride + k]) * weight[i]
        if not e <= size:
            size = e
    for j in range(q):
        e = abs(rows[surface_row[j] * stride + k]) / (rtol * (surf[3 * j + 2] + abs(surf[3 * j])))
        if not e <= size:
            size = e
    return size


@kernel
def taylor_length(n, q, K, stride, rows, surface_row, surf, weight, rtol):
    """Step at which the last two terms fall below the tolerance (R1 included); nan if a coefficient is."""
    last = _order_size(n, q, K, stride, rows, surface_row, surf, weight, rtol)
    size = _order_size(n, q, K - 1, stride, rows, surface_row, surf, weight, rtol)
    if not last + size < np.inf:
        return np.nan
    return 0.9 * min(root(max(last, 1e-290), K), root(max(size, 1e-290), K - 1))


@kernel
def evaluate(n, K, stride, rows, h, x):
    """Overwrites x with the polynomial at h."""
    for i in range(n):
        row = i * stride
        v = rows[row + K]
        for k in range(K - 1, -1, -1):
            v = v * h + rows[row + k]
        x[i] = v


@kernel
def taylor_passed(q, K, stride, rows, surface_row, surf, h, moved):
    """R3 over the whole step: 0, or the factor by which to shrink it.

    The sum of the moduli settles most steps; otherwise the polynomial is looked at in 8 points (`moved`). A dip
    into the rim of a layer that turns back within the step is refused too: the series, blind to the layer, would
    leave it as if nothing had been there, with both ends outside.
    """
    factor = 0.0
    for j in range(q):
        row, h0, eps = surface_row[j] * stride, surf[3 * j], surf[3 * j + 2]
        rim, allowed = RIM * eps, THETA * (abs(h0) + REACH * eps)
        bound = 0.0
        for k in range(K, 0, -1):
            bound = (bound + abs(rows[row + k])) * h
        if bound <= allowed and (bound <= 0.3 * abs(h0) or bound <= abs(h0) - rim):
            continue
        tau = load8(SAMPLES, 0) * h
        v = splat8(rows[row + K])
        for k in range(K - 1, 0, -1):
            v = v * tau + rows[row + k]
        store8(moved, 0, v * tau)
        far = 0.0
        for k in range(8):
            far = max(far, -moved[k] if h0 > 0.0 else moved[k])
        if far > allowed:
            shrink = min(0.7, max(0.2, 0.9 * allowed / far))
            factor = shrink if factor == 0.0 else min(factor, shrink)
        end = abs(h0 + moved[7])
        for k in range(7):
            left = abs(h0 + moved[k])
            if left < rim and left < 0.7 * min(abs(h0), end):
                shrink = SAMPLES[k]
                factor = shrink if factor == 0.0 else min(factor, shrink)
                break
    return factor


@kernel
def defect(n, K, stride, rows, ahead, h, weight):
    """Estimated error of the step in units of its tolerance, from the expansion `ahead` at its end."""
    size = 0.0
    for i in range(n):
        row = i * stride
        v = K * rows[row + K]
        for k in range(K - 1, 0, -1):
            v = v * h + k * rows[row + k]
        e = abs(v - ahead[row + 1]) * weight[i]
        if not e <= size:
            size = e
    return h * size / (K + 1)
