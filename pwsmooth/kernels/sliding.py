"""Solved multipliers: the sliding condition grad h . f + dh/dt = 0, and the surface kept exactly.

Newton's method on the residuals g of the masked multipliers; the projection x - dh'(dh dh')^-1 h for surfaces that
are no coordinate (a coordinate is set to exactly 0).
"""

import numpy as np
from numba import njit

from .pointers import call_fields, call_linear
from .state import ALGEBRAIC, CONTACT, SOLVED


@njit(cache=True)
def solve_dense(A, b, size):
    """Gaussian elimination with partial pivoting; overwrites A and b (the solution); False if singular."""
    for i in range(size):
        best = i
        for r in range(i + 1, size):
            if abs(A[r, i]) > abs(A[best, i]):
                best = r
        if A[best, i] == 0.0 or not np.isfinite(A[best, i]):
            return False
        if best != i:
            for c in range(size):
                A[i, c], A[best, c] = A[best, c], A[i, c]
            b[i], b[best] = b[best], b[i]
        for r in range(i + 1, size):
            factor = A[r, i] / A[i, i]
            if factor != 0.0:
                for c in range(i, size):
                    A[r, c] -= factor * A[i, c]
                b[r] -= factor * b[i]
    for i in range(size - 1, -1, -1):
        total = b[i]
        for c in range(i + 1, size):
            total -= A[i, c] * b[c]
        b[i] = total / A[i, i]
    return True


@njit(cache=True)
def newton(P, t, x, mult, mask, work):
    """Solves g = 0 for the masked multipliers, overwriting them; False when it does not converge."""
    m = P.m
    index = np.empty(m, np.int64)
    size = 0
    for j in range(m):
        if mask[j]:
            index[size] = j
            size += 1
    if size == 0:
        return True
    dx, h, g = work.dx, work.h, work.g
    G, dh = work.G, work.dh
    previous = np.inf
    for sweep in range(25):
        call_fields(P.fields, t, x, mult, P.p, dx, h, g)
        call_linear(P.linear, t, x, mult, P.p, G, dh)
        A = np.empty((size, size))
        b = np.empty(size)
        for r in range(size):
            b[r] = -g[index[r]]
            for c in range(size):
                A[r, c] = G[index[r] * m + index[c]]
        if not solve_dense(A, b, size):
            for r in range(size):
                if g[index[r]] != 0.0:
                    return False
            return True
        change = 0.0
        for r in range(size):
            mult[index[r]] += b[r]
            change = max(change, abs(b[r]) / (1.0 + abs(mult[index[r]])))
        if not np.isfinite(change):
            return False
        # One step more than it takes to see convergence: the residual then sits at rounding.
        if change <= 1e-15 or (sweep > 0 and change < 1e-9 and change >= 0.25 * previous):
            return True
        previous = change
    return change < 1e-10


@njit(cache=True)
def follow(P, t, x, mult, mask, work):
    """Newton only where a residual is above rounding: the usual case costs one evaluation."""
    call_fields(P.fields, t, x, mult, P.p, work.dx, work.h, work.g)
    clean = True
    for j in range(P.m):
        if mask[j] and not abs(work.g[j]) <= 1e-15:
            clean = False
    return True if clean else newton(P, t, x, mult, mask, work)


@njit(cache=True)
def instant_mask(P, status, mask):
    """Overwrites mask: the multipliers that are solved at every instant, whatever a switch does."""
    for j in range(P.m):
        mask[j] = 1 if P.kind[j] == ALGEBRAIC or (P.kind[j] == CONTACT and status[j] == SOLVED) else 0


@njit(cache=True)
def keep_on_surface(P, t, x, mult, j, work):
    """Puts x exactly on h_j = 0."""
    if P.surface_state[j] >= 0:
        x[P.surface_state[j]] = 0.0
        return
    for _ in range(3):
        call_fields(P.fields, t, x, mult, P.p, work.dx, work.h, work.g)
        if work.h[j] == 0.0:
            return
        call_linear(P.linear, t, x, mult, P.p, work.G, work.dh)
        square = 0.0
        for i in range(P.n):
            square += work.dh[j * P.n + i] ** 2
        if not square > 0.0:
            return
        for i in range(P.n):
            x[i] -= work.dh[j * P.n + i] * work.h[j] / square


@njit(cache=True)
def surface_rounding(P, x, j, dh):
    """The size at which h_j is indistinguishable from 0, from the gradient's row of dh."""
    total = 1e-300
    for i in range(P.n):
        total += abs(dh[j * P.n + i] * x[i])
    return 1e-13 * total
