"""Sparse elimination of (mu_e/h) I - J for patterns that are too large to be written out, four eigenvalues at once.

Pivots on the diagonal, in an order made for little fill (codegen/stiff/linear.py, `plan`): mu/h dominates there. Sums
over elements are unknowns of the whole behind the states, with 1 in the place of mu/h:

    (mu/h - J) dx - U dS = r,    - V dx + (1 - W) dS = 0

A plan is one array: N and n, its numbers of unknowns and of states; then for every row in the order of elimination the
unknown, where its entries of J begin, where those of L and of U; then these entries: place in J and column, columns of
L, columns of U. `lu` has rows of 8 (real parts of four eigenvalues, then imaginary parts): pivots, inverted, L, U, and
one row of scratch for every unknown.
"""

from numba import types

from pwsmooth.kernels.machine.compiling import kernel, unit
from pwsmooth.kernels.machine.lanes import load4, splat4, store4

doubles, integers = types.CPointer(types.float64), types.CPointer(types.int64)


@kernel
def _places(plan):
    """N, n, then where the five tables of the plan begin: unknowns, entries of J, L and U of every row, and columns."""
    N = plan[0]
    unknown = 2
    entry = unknown + N
    lower = entry + N + 1
    upper = lower + N + 1
    return N, plan[1], unknown, entry, lower, upper, upper + N + 1


@unit(types.void, integers, doubles, doubles, doubles)
def sparse_factor(plan, J, mu, lu):
    """Overwrites lu with the eliminations of mu I - J in four lanes."""
    N, n, unknown, entry, lower, upper, first = _places(plan)
    entries = plan[entry + N]
    columns_l = first + 2 * entries
    columns_u = columns_l + plan[lower + N]
    at_l = N
    at_u = at_l + plan[lower + N]
    scratch = at_u + plan[upper + N]
    zero, one = splat4(0.0), splat4(1.0)
    mr, mi = load4(mu, 0), load4(mu, 4)
    for r in range(N):
        l0, l1, u0, u1 = plan[lower + r], plan[lower + r + 1], plan[upper + r], plan[upper + r + 1]
        for k in range(l0, l1):
            a = 8 * (scratch + plan[columns_l + k])
            store4(lu, a, zero)
            store4(lu, a + 4, zero)
        for k in range(u0, u1):
            a = 8 * (scratch + plan[columns_u + k])
            store4(lu, a, zero)
            store4(lu, a + 4, zero)
        a = 8 * (scratch + r)
        if plan[unknown + r] < n:
            store4(lu, a, mr)
            store4(lu, a + 4, mi)
        else:
            store4(lu, a, one)
            store4(lu, a + 4, zero)
        for k in range(plan[entry + r], plan[entry + r + 1]):
            a = 8 * (scratch + plan[first + entries + k])
            store4(lu, a, load4(lu, a) - J[plan[first + k]])
        for k in range(l0, l1):
            c = plan[columns_l + k]
            a = 8 * (scratch + c)
            wr, wi, vr, vi = load4(lu, a), load4(lu, a + 4), load4(lu, 8 * c), load4(lu, 8 * c + 4)
            lr, li = wr * vr - wi * vi, wr * vi + wi * vr
            store4(lu, 8 * (at_l + k), lr)
            store4(lu, 8 * (at_l + k) + 4, li)
            for j in range(plan[upper + c], plan[upper + c + 1]):
                b, d = 8 * (at_u + j), 8 * (scratch + plan[columns_u + j])
                ur, ui = load4(lu, b), load4(lu, b + 4)
                store4(lu, d, load4(lu, d) - (lr * ur - li * ui))
                store4(lu, d + 4, load4(lu, d + 4) - (lr * ui + li * ur))
        for k in range(u0, u1):
            a, b = 8 * (scratch + plan[columns_u + k]), 8 * (at_u + k)
            store4(lu, b, load4(lu, a))
            store4(lu, b + 4, load4(lu, a + 4))
        a = 8 * (scratch + r)
        pr, pi = load4(lu, a), load4(lu, a + 4)
        size = one / (pr * pr + pi * pi)
        store4(lu, 8 * r, pr * size)
        store4(lu, 8 * r + 4, zero - pi * size)


@unit(types.void, integers, doubles, doubles)
def sparse_solve(plan, lu, R):
    """Overwrites R[i] (8 lanes, of the states) with the solutions."""
    N, n, unknown, entry, lower, upper, first = _places(plan)
    columns_l = first + 2 * plan[entry + N]
    columns_u = columns_l + plan[lower + N]
    at_l = N
    at_u = at_l + plan[lower + N]
    scratch = at_u + plan[upper + N]
    for r in range(N):
        i = plan[unknown + r]
        re, im = splat4(0.0), splat4(0.0)
        if i < n:
            re, im = load4(R, 8 * i), load4(R, 8 * i + 4)
        for k in range(plan[lower + r], plan[lower + r + 1]):
            a, b = 8 * (at_l + k), 8 * (scratch + plan[columns_l + k])
            lr, li, yr, yi = load4(lu, a), load4(lu, a + 4), load4(lu, b), load4(lu, b + 4)
            re, im = re - (lr * yr - li * yi), im - (lr * yi + li * yr)
        store4(lu, 8 * (scratch + r), re)
        store4(lu, 8 * (scratch + r) + 4, im)
    for r in range(N - 1, -1, -1):
        b = 8 * (scratch + r)
        re, im = load4(lu, b), load4(lu, b + 4)
        for k in range(plan[upper + r], plan[upper + r + 1]):
            a, c = 8 * (at_u + k), 8 * (scratch + plan[columns_u + k])
            ur, ui, yr, yi = load4(lu, a), load4(lu, a + 4), load4(lu, c), load4(lu, c + 4)
            re, im = re - (ur * yr - ui * yi), im - (ur * yi + ui * yr)
        vr, vi = load4(lu, 8 * r), load4(lu, 8 * r + 4)
        xr, xi = re * vr - im * vi, re * vi + im * vr
        store4(lu, b, xr)
        store4(lu, b + 4, xi)
        i = plan[unknown + r]
        if i < n:
            store4(R, 8 * i, xr)
            store4(R, 8 * i + 4, xi)
