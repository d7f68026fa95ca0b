"""Event-capturing time stepping, the plain baseline of nonsmooth mechanics: no event is ever located.

Switches, Moreau-Jean with an implicit relay: of x' = a(t, x) + B lam,

    (1 - theta h J)(x_{k+1} - x_k) = h (a_k + B lam),    lam_j in Sgn(h_j(x_{k+1})),

the inclusion being linearised in x and solved by projected Gauss-Seidel. What is nonlinear in lam is replaced by its
chord, as in every scheme that is linear in the multiplier: hidden terms are lost. Contacts at the level of
velocities: a gap that is closed at the midpoint prediction gets the impulse P >= 0 that is complementary to h'_{k+1}
+ e h'_k >= 0.
V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), ch. 10.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from .plain import Plain

SWEEPS = 60  # of Gauss-Seidel, a bound: one switch needs one


@functools.lru_cache(maxsize=64)
def stepper(functions: Plain) -> Any:
    """A compiled run(t0, t1, x0, steps, theta) -> (x, lam, number of evaluations) with x, lam of every step."""
    from numba import njit

    n, m = functions.n, functions.m
    rates, surfaces, jacobian, gradients = (
        functions.rates, functions.surfaces, functions.jacobian, functions.gradients,
    )  # fmt: skip

    @njit(error_model="numpy")
    def run(t0, t1, x0, steps, theta):
        h = (t1 - t0) / steps
        xs, lams = np.empty((steps + 1, n)), np.zeros((steps + 1, m))
        x, lam, a, moved = x0.copy(), np.zeros(m), np.empty(n), np.empty(n)
        B, J, G, W, level = np.empty((n, m)), np.empty((n, n)), np.empty((m, n)), np.empty((m, m)), np.empty(m)
        q, unit = np.empty(m), np.zeros(m)
        xs[0] = x
        for k in range(steps):
            t = t0 + h * k
            middle = t + theta * h
            unit[:] = 0.0
            rates(middle, x, unit, a)
            for j in range(m):
                unit[j] = 1.0
                rates(middle, x, unit, moved)
                unit[j] = 0.0
                B[:, j] = moved - a
            jacobian(middle, x, unit, J)
            surfaces(t + h, x, unit, level)
            gradients(t + h, x, unit, G)
            matrix = np.eye(n) - theta * h * J
            free = np.linalg.solve(matrix, h * a)
            force = np.linalg.solve(matrix, h * B)
            W[:] = G @ force
            q[:] = level + G @ free
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
            x += free + force @ lam
            xs[k + 1], lams[k + 1] = x, lam
        return xs, lams, steps * (m + 1)

    return run


@functools.lru_cache(maxsize=64)
def bouncing(functions: Plain) -> Any:
    """A compiled run(t0, t1, x0, steps, e) of a model with one contact and no switch; as `stepper`."""
    from numba import njit

    n = functions.n
    rates, surfaces, gradients = functions.rates, functions.surfaces, functions.gradients

    @njit(error_model="numpy")
    def run(t0, t1, x0, steps, e):
        h = (t1 - t0) / steps
        xs, forces = np.empty((steps + 1, n)), np.zeros((steps + 1, 1))
        x, a, pushed = x0.copy(), np.empty(n), np.empty(n)
        open_, closed, level, G = np.zeros(1), np.ones(1), np.empty(1), np.empty((1, n))
        xs[0] = x
        for k in range(steps):
            t = t0 + h * k
            rates(t, x, open_, a)
            rates(t, x, closed, pushed)
            direction = pushed - a
            gradients(t, x, open_, G)
            before = np.dot(G[0], a)
            surfaces(t + 0.5 * h, x + 0.5 * h * a, open_, level)
            new = x + h * a
            # Velocities first, then positions with the new velocities: the rates at the new state move the gap.
            impulse = 0.0
            if level[0] <= 0.0:
                rates(t + h, new, open_, a)
                speed = np.dot(G[0], a)
                rates(t + h, new + direction, open_, pushed)
                gain = np.dot(G[0], pushed - a)
                impulse = max(0.0, -(speed + e * before) / gain)
            new += impulse * direction
            rates(t + h, new, open_, a)
            for i in range(n):
                # A coordinate on which the impulse does not act moves with the new velocity.
                x[i] = new[i] if direction[i] != 0.0 else x[i] + h * a[i]
            xs[k + 1], forces[k + 1, 0] = x, impulse / h
        return xs, forces, steps * 3

    return run
