"""Event-capturing time stepping, the plain baseline of nonsmooth mechanics: no event is ever located.

Switches, Moreau-Jean with an implicit relay: of x' = a(t, x) + B lam,

    (1 - theta h J)(x_{k+1} - x_k) = h (a_k + B lam),    lam_j in Sgn(h_j(x_{k+1})),

the inclusion being linearised in x and solved by projected Gauss-Seidel. What is nonlinear in lam is replaced by its
chord, as in every scheme that is linear in the multiplier: hidden terms are lost. Contacts at the level of
velocities: a gap that is closed at the midpoint prediction gets the impulse P >= 0 that is complementary to h'_{k+1}
+ e h'_k >= 0.
V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), on time stepping.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from .plain import Plain, elimination

SWEEPS = 60  # of Gauss-Seidel, a bound: one switch needs one


@functools.lru_cache(maxsize=64)
def stepper(functions: Plain) -> Any:
    """A compiled run(t0, t1, x0, steps, theta) -> (x, lam, number of evaluations) with x, lam of every step."""
    from numba import njit

    n, m = functions.n, functions.m
    rates, surfaces = functions.rates, functions.surfaces
    jacobian, gradients = functions.derivatives("jacobian"), functions.derivatives("gradients")
    eliminate = elimination()

    # In components: arithmetic and assignment of whole arrays compile for seconds.
    @njit(error_model="numpy")
    def run(t0, t1, x0, steps, theta):
        h = (t1 - t0) / steps
        xs, lams = np.empty((steps + 1, n)), np.zeros((steps + 1, m))
        x, lam, a, moved = x0.copy(), np.zeros(m), np.empty(n), np.empty(n)
        matrix, right = np.empty((n, n)), np.empty((n, 1 + m))
        J, G, W, level = np.empty((n, n)), np.empty((m, n)), np.empty((m, m)), np.empty(m)
        q, unit = np.empty(m), np.zeros(m)
        for i in range(n):
            xs[0, i] = x[i]
        for k in range(steps):
            t = t0 + h * k
            middle = t + theta * h
            for j in range(m):
                unit[j] = 0.0
            rates(middle, x, unit, a)
            for i in range(n):
                right[i, 0] = h * a[i]
            for j in range(m):
                unit[j] = 1.0
                rates(middle, x, unit, moved)
                unit[j] = 0.0
                for i in range(n):
                    right[i, 1 + j] = h * (moved[i] - a[i])
            jacobian(middle, x, unit, J)
            surfaces(t + h, x, unit, level)
            gradients(t + h, x, unit, G)
            for i in range(n):
                for l in range(n):
                    matrix[i, l] = (1.0 if i == l else 0.0) - theta * h * J[i, l]
            # The free motion in the first column, what the multipliers add in the others.
            eliminate(matrix, right)
            for j in range(m):
                q[j] = level[j]
                for l in range(n):
                    q[j] += G[j, l] * right[l, 0]
                for i in range(m):
                    W[j, i] = 0.0
                    for l in range(n):
                        W[j, i] += G[j, l] * right[l, 1 + i]
            for _ in range(SWEEPS):
                change = 0.0
                for j in range(m):
                    # h_{k+1} = q + W lam with lam_j in Sgn(h_j): attracting where W_jj < 0.
                    rest = q[j]
                    for i in range(m):
                        if i != j:
                            rest += W[j, i] * lam[i]
                    if W[j, j] < 0.0:
                        new = min(1.0, max(-1.0, -rest / W[j, j]))
                    else:
                        new = math.copysign(1.0, rest)
                    change = max(change, abs(new - lam[j]))
                    lam[j] = new
                if change < 1e-14:
                    break
            for i in range(n):
                step = right[i, 0]
                for j in range(m):
                    step += right[i, 1 + j] * lam[j]
                x[i] += step
                xs[k + 1, i] = x[i]
            for j in range(m):
                lams[k + 1, j] = lam[j]
        return xs, lams, steps * (m + 1)

    return run


@functools.lru_cache(maxsize=64)
def bouncing(functions: Plain) -> Any:
    """A compiled run(t0, t1, x0, steps, e) of a model with one contact and no switch; as `stepper`."""
    from numba import njit

    n = functions.n
    rates, surfaces, gradients = functions.rates, functions.surfaces, functions.derivatives("gradients")

    @njit(error_model="numpy")
    def run(t0, t1, x0, steps, e):
        h = (t1 - t0) / steps
        xs, forces = np.empty((steps + 1, n)), np.zeros((steps + 1, 1))
        x, a, pushed, direction = x0.copy(), np.empty(n), np.empty(n), np.empty(n)
        open_, closed, level, G = np.zeros(1), np.ones(1), np.empty(1), np.empty((1, n))
        middle, new, hit = np.empty(n), np.empty(n), np.empty(n)
        for i in range(n):
            xs[0, i] = x[i]
        for k in range(steps):
            t = t0 + h * k
            rates(t, x, open_, a)
            rates(t, x, closed, pushed)
            gradients(t, x, open_, G)
            before = 0.0
            for i in range(n):
                direction[i] = pushed[i] - a[i]
                before += G[0, i] * a[i]
                middle[i] = x[i] + 0.5 * h * a[i]
                new[i] = x[i] + h * a[i]
                hit[i] = new[i] + direction[i]
            surfaces(t + 0.5 * h, middle, open_, level)
            # Velocities first, then positions with the new velocities: the rates at the new state move the gap.
            impulse = 0.0
            if level[0] <= 0.0:
                rates(t + h, new, open_, a)
                rates(t + h, hit, open_, pushed)
                speed = gain = 0.0
                for i in range(n):
                    speed += G[0, i] * a[i]
                    gain += G[0, i] * (pushed[i] - a[i])
                impulse = max(0.0, -(speed + e * before) / gain)
            for i in range(n):
                new[i] += impulse * direction[i]
            rates(t + h, new, open_, a)
            for i in range(n):
                # A coordinate on which the impulse does not act moves with the new velocity.
                x[i] = new[i] if direction[i] != 0.0 else x[i] + h * a[i]
                xs[k + 1, i] = x[i]
            forces[k + 1, 0] = impulse / h
        return xs, forces, steps * 3

    return run
