"""The rules that keep a step from passing over a layer of width eps around a surface h = 0.

    R1  the error of h counts relative to its distance from the layer: rtol (eps + |h|), no atol
    R2  before the step: towards the layer from |h| > C eps, at most 0.9 theta (|h| + C eps) / |dh/dt|
    R3  after the step: reject if h moved towards or through zero by more than theta (|h| + C eps), at the end
        and at every stage

R1 alone and R2-R3 alone both fail; together they found every layer. A change of sign is thus accepted only from
within about C eps. The constants may vary widely (theta 0.5..0.97, C 0.5..50) without harm.
"""

import numpy as np

from pwsmooth.kernels.machine.compiling import kernel
from pwsmooth.kernels.machine.pointers import bits_float, float_bits
from pwsmooth.kernels.stiff.call import SURFACES, SURFACES8, call_lanes, call_point
from pwsmooth.kernels.stiff.rules import REACH, THETA

ONE_BIT, BIAS = 4503599627370496.0, 1023.0  # a double's exponent counts from -1023 in units of 2^52


@kernel
def root(size, order):
    """size^(-1/order) to a few per cent: exponent bits with the mantissa as a linear fraction, there and back."""
    exponent = (float_bits(size) * (1.0 / ONE_BIT) - BIAS) * (1.0 / order)
    return bits_float(int((BIAS - exponent) * ONE_BIT))


@kernel
def look(adr, q, t, x, p, surface_state, surf):
    """Overwrites surf: of each of q surfaces h, dh/dt at fixed x, eps, and then the gradients (only h where all are
    states)."""
    full = False
    for j in range(q):
        full = full or surface_state[j] < 0
    if full:
        call_point(adr[SURFACES], t, x, p, surf)
    else:
        for j in range(q):
            surf[3 * j] = x[surface_state[j]]


@kernel
def along(s, j, f):
    """The gradient of surface j times f."""
    v = 0.0
    for k in range(s.slope_first[j], s.slope_first[j + 1]):
        v += s.surf[3 * s.q + k] * f[s.slope_state[k]]
    return v


@kernel
def step_limit(s, f):
    """R2: longest step allowed before the layers are looked at again."""
    limit = np.inf
    for j in range(s.q):
        h, eps = s.surf[3 * j], s.surf[3 * j + 2]
        v = s.surf[3 * j + 1] + along(s, j, f)
        if h * v < 0.0 and abs(h) > REACH * eps:
            limit = min(limit, 0.9 * THETA * (abs(h) + REACH * eps) / abs(v))
    return limit


@kernel
def passed(adr, q, t8, X, p, surface_state, surf, values, lanes):
    """R3 over the first `lanes` points: 0 if none moved too far, else the factor by which to shrink the
    step."""
    factor = 0.0
    if adr[SURFACES8] == 0:
        return factor
    called = False
    for j in range(q):
        h, eps, state = surf[3 * j], surf[3 * j + 2], surface_state[j]
        if state < 0 and not called:
            call_lanes(adr[SURFACES8], t8, X, p, values)
            called = True
        allowed = THETA * (abs(h) + REACH * eps)
        far = 0.0
        for k in range(lanes):
            g = X[8 * state + k] if state >= 0 else values[8 * j + k]
            far = max(far, h - g if h > 0.0 else g - h)
        if far > allowed:
            shrink = min(0.7, max(0.2, 0.9 * allowed / far))
            factor = shrink if factor == 0.0 else min(factor, shrink)
    return factor


@kernel
def set_weights(s, rtol):
    """Overwrites the weights (1/tolerance) of the error test and of the Newton iteration (which R1
    tightens)."""
    for i in range(s.n):
        s.weight[i] = 1.0 / (s.atol[i] + rtol * abs(s.x[i]))
        s.newton_weight[i] = s.weight[i]
    for j in range(s.q):
        layer = 1.0 / (rtol * (s.surf[3 * j + 2] + abs(s.surf[3 * j])))
        for k in range(s.slope_first[j], s.slope_first[j + 1]):
            i = s.slope_state[k]
            s.newton_weight[i] = max(s.newton_weight[i], abs(s.surf[3 * s.q + k]) * layer)


@kernel
def error_norm(s):
    """Largest error in units of its tolerance, R1 included; nan if any is."""
    norm = 0.0
    for i in range(s.n):
        e = abs(s.err[i]) * s.weight[i]
        if not e <= norm:
            norm = e
    for j in range(s.q):
        e = abs(along(s, j, s.err)) / (s.rtol * (s.surf[3 * j + 2] + abs(s.surf[3 * j])))
        if not e <= norm:
            norm = e
    return norm
