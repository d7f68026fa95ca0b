"""One-step updates for controllers and co-simulation: no iteration, a fixed cost, compiled.

Backward Euler in closed form, for a given velocity or coupled to a mass (m dv/dt = u - f):

    parallel elements (XKY, Maxwell-slip)    f_i = clip(kappa_i a_i + S_i v, L_i),  S_i = sigma_i + h kappa_i
                                             a_i = (sigma_i a_i + h f_i)/S_i
    bristles (LuGre, Dahl)                   z = (z + h v)/(1 + h sigma0 |v|/g(v)),  linear in z and in v

With a mass the elements make a piecewise linear increasing equation for v, solved exactly by sorting its 2 n corners.
The functions are plain Python here; realtime.py compiles them. Arguments: p (parameters, see there), e (elements, shape
(3, n): kappa, sigma, share), state (overwritten), h.
"""

import math

import numpy as np


def strength(p, v):
    """g(v) of p = (F_c, F_s, v_s, ...)"""
    return p[0] + (p[1] - p[0]) * math.exp(-((v / p[2]) ** 2))


def lagged(p, state, v, h):
    """The strength s after the step (p[4] is tau_d; 0: no lag, s = g(v)); overwrites state[0]."""
    g = strength(p, v)
    state[0] = (p[4] * state[0] + h * g) / (p[4] + h)
    return state[0]


def carried(p, e, s, state, v, h):
    """Force of parallel elements of the strength s at the velocity v after the step; overwrites state[1:]."""
    force = p[3] * v
    for i in range(e.shape[1]):
        kappa, sigma, limit = e[0, i], e[1, i], e[2, i] * s
        S = sigma + h * kappa
        f = max(-limit, min(limit, kappa * state[i + 1] + S * v))
        state[i + 1] = (sigma * state[i + 1] + h * f) / S
        force += f
    return force


def elements_given(p, e, state, v, h):
    """Force of parallel elements at the velocity v after the step; overwrites state."""
    return carried(p, e, lagged(p, state, v, h), state, v, h)


def elements_coupled(p, e, state, v, u, m, h):
    """Velocity of a mass after the step under the force u; overwrites state. The strength is that at the old v."""
    n = e.shape[1]
    s = lagged(p, state, v, h)
    mass = m + h * p[3]
    free = (m * v + h * u) / mass  # the velocity without bristles
    corners = np.empty(2 * n)
    for i in range(n):
        S = e[1, i] + h * e[0, i]
        corners[2 * i] = (-e[2, i] * s - e[0, i] * state[i + 1]) / S
        corners[2 * i + 1] = (e[2, i] * s - e[0, i] * state[i + 1]) / S
    corners.sort()
    # F(w) = w - free + h/mass sum f_i(w) increases: the corners between which it changes sign.
    low, high = 0, 2 * n
    while low < high:
        middle = (low + high) // 2
        w = corners[middle]
        total = w - free
        for i in range(n):
            limit = e[2, i] * s
            f = e[0, i] * state[i + 1] + (e[1, i] + h * e[0, i]) * w
            total += h / mass * max(-limit, min(limit, f))
        if total < 0:
            low = middle + 1
        else:
            high = middle
    # Inside the piece below corner `low` every element is saturated or linear.
    left = corners[low - 1] if low > 0 else corners[0] - 1.0
    right = corners[low] if low < 2 * n else corners[2 * n - 1] + 1.0
    inside = 0.5 * (left + right)
    slope, constant = 1.0, -free
    for i in range(n):
        limit, S = e[2, i] * s, e[1, i] + h * e[0, i]
        f = e[0, i] * state[i + 1] + S * inside
        if f >= limit:
            constant += h / mass * limit
        elif f <= -limit:
            constant -= h / mass * limit
        else:
            slope += h / mass * S
            constant += h / mass * e[0, i] * state[i + 1]
    w = -constant / slope
    carried(p, e, s, state, w, h)
    return w


def bristle_given(p, e, state, v, h):
    """Force of LuGre's bristles at the velocity v after the step; overwrites state. p[4:6] are sigma0, sigma1."""
    z = state[0]
    state[0] = (z + h * v) / (1.0 + h * p[4] * abs(v) / strength(p, v))
    return p[4] * state[0] + p[5] * (state[0] - z) / h + p[3] * v


def bristle_coupled(p, e, state, v, u, m, h):
    """Velocity of a mass on LuGre's bristles after the step; overwrites state. |v|/g(v) is that at the old v."""
    z, D = state[0], 1.0 + h * p[4] * abs(v) / strength(p, v)
    held = (p[4] + p[5] / h) * z / D - p[5] * z / h
    w = (m * v + h * (u - held)) / (m + h * (p[3] + (p[4] * h + p[5]) / D))
    state[0] = (z + h * w) / D
    return w


def switch_given(p, e, state, v, h):
    """Force of g(v) Sgn(v) + sigma2 v; 0 at rest, where it is whatever holds the body."""
    side = 1.0 if v > 0 else -1.0 if v < 0 else 0.0
    return strength(p, v) * side + p[3] * v


def switch_coupled(p, e, state, v, u, m, h):
    """Velocity of a mass after the step: exactly 0 where the force g(v) can hold it."""
    push = m * v + h * u
    held = max(-h * strength(p, v), min(h * strength(p, v), push))
    return (push - held) / (m + h * p[3])
