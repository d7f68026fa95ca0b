"""Sparse rows of dg/dmult and of the surfaces' gradients, and the linear system of the solved multipliers.

    G u = b,   G = [[A_1, ..., C_1], [..., A_q, C_q], [B_1 ... B_q, D]]

Rows are compressed (row[i] .. row[i + 1] are the entries of row i, col their columns, ascending). The multipliers fall
into groups that do not couple: the blocks of a spring-block chain, the elements of a multistate law. What couples many
of them, a multiplier of the whole system, is a hub and is eliminated last (Schur complement), so that n elements cost
O(n), not O(n^3).
"""

import numpy as np

from ..machine.compiling import kernel
from ..machine.lanes import load8, splat8, store8
from ..state import CROSSING, KINK, SOLVED

# Of what it was: an entry that elimination leaves so little of is 0, in whatever units rows and unknowns are.
_CANCELLED = 4e-15
_WORTH_A_SWAP = 0.1  # of the largest entry of a column: a pivot as large as that stays where it is
_UNIT = np.eye(1, 16, 8)[0]  # whose eight entries from 8 - i on are 1 at i, else 0
_SHORT = 16  # entries of a row, up to which one is as soon found by looking at all


@kernel
def entry(row, col, values, i, j):
    """Entry (i, j) of a sparse matrix."""
    lo, hi = row[i], row[i + 1]
    if hi - lo <= _SHORT:  # perhaps in no order: in a patch of elements (kernels/local)
        for e in range(lo, hi):
            if col[e] == j:
                return values[e]
        return 0.0
    while lo < hi:
        mid = (lo + hi) // 2
        if col[mid] < j:
            lo = mid + 1
        else:
            hi = mid
    return values[lo] if lo < row[i + 1] and col[lo] == j else 0.0


@kernel
def link(P, S, W, j):
    """Overwrites W.linear.linked: 1 for the multipliers that act on multiplier j, or it on them, at this instant.

    Directly, or through what is solved at this instant as well: unknowns, closed contacts, sliding switches.
    """
    for i in range(P.m):
        W.linear.linked[i] = 0
    W.linear.linked[j] = 1
    W.linear.stack[0] = j
    size = 1
    while size > 0:
        size -= 1
        i = W.linear.stack[size]
        for e in range(P.link_row[i], P.link_row[i + 1]):
            k = P.link_col[e]
            if W.linear.linked[k] == 0:
                W.linear.linked[k] = 1
                if S.status[k] == SOLVED and P.kind[k] != KINK and P.kind[k] != CROSSING:
                    W.linear.stack[size] = k
                    size += 1


@kernel
def _pivot(A, i, size, width):
    """Swaps row i from column i on and the one below with the largest entry in that column; False if 0."""
    best = i
    for r in range(i + 1, size):
        if abs(A[r, i]) > abs(A[best, i]):
            best = r
    if not abs(A[best, i]) > 0.0:
        return False
    if best != i:
        for c in range(i, width):
            A[i, c], A[best, c] = A[best, c], A[i, c]
    return True


@kernel
def solve_dense(A, size, count):
    """Gaussian elimination with partial pivoting of A[:size, :size + count]; overwrites the right-hand sides that
    stand in the last columns with the solutions; False if singular."""
    width = size + count
    for i in range(size):
        if not _pivot(A, i, size, width):
            return False
        for r in range(i + 1, size):
            factor = A[r, i] / A[i, i]
            for c in range(i, width if factor != 0.0 else 0):
                before = abs(A[r, c])
                A[r, c] -= factor * A[i, c]
                if c < size and abs(A[r, c]) <= _CANCELLED * before:
                    A[r, c] = 0.0
    for k in range(size, width):
        for i in range(size - 1, -1, -1):
            total = A[i, k]
            for c in range(i + 1, size):
                total -= A[i, c] * A[c, k]
            A[i, k] = total / A[i, i]
    return True


@kernel
def invert_dense(A, row, size):
    """Overwrites A[:size, :size], whose column c is A[c] and whose size is a multiple of 8, by its inverse, with pivots
    that are not small in their columns; False if singular. A[:, size] is the order of the rows, `row` is overwritten.

    Eight entries of a column go at once. A solution is then a sum of columns: with factors each unknown would wait for
    the one before, and Newton's method needs several.
    """
    for i in range(size):
        A[i, size] = i
    for i in range(size):
        best, largest = i, abs(A[i, i]) / _WORTH_A_SWAP
        for r in range(i + 1, size):
            if abs(A[i, r]) > largest:
                best, largest = r, abs(A[i, r])
        if not largest > 0.0:
            return False
        if best != i:
            A[i, size], A[best, size] = A[best, size], A[i, size]
            for c in range(size):
                A[c, i], A[c, best] = A[c, best], A[c, i]
        pivot = A[i, i]
        for c in range(size):
            row[c] = A[c, i]
        row[i] = 1.0
        for r in range(0, size, 8):
            place = i - r
            own = load8(_UNIT, 8 - place) if 0 <= place < 8 else splat8(0.0)
            other = 1.0 - own
            column, scale = load8(A[i], r) * (1.0 / pivot) * other, own * (1.0 / pivot) + other
            store8(A[i], r, own)
            for c in range(size):
                store8(A[c], r, load8(A[c], r) * scale - column * row[c])
    return True


@kernel
def solve_inverted(A, size, b, u):
    """Overwrites u by the solution for b, of the matrix whose inverse stands in A."""
    for r in range(0, size, 8):
        total = splat8(0.0)
        for c in range(size):
            total = total + load8(A[c], r) * b[int(A[c, size])]
        store8(u, r, total)


@kernel
def find_strengths(W, A, strength, size):
    """Overwrites strength by D > 0 of A = S D, S symmetric, to a factor in all that are linked: how strong each acts.

    Along the largest entries, as a spanning tree grows (Prim).
    """
    best, along = W.linear.rhs, W.linear.place
    for i in range(size):
        strength[i] = best[i] = 0.0
    for _ in range(size):
        new = -1
        for k in range(size):
            if strength[k] == 0.0 and (new < 0 or best[k] > best[new]):
                new = k
        known = along[new]
        strength[new] = strength[known] * abs(A[known, new] / A[new, known]) if best[new] > 0.0 else 1.0
        for k in range(size):
            both = min(abs(A[new, k]), abs(A[k, new]))
            if both > best[k] and strength[k] == 0.0:
                best[k], along[k] = both, new


@kernel
def solve_masked(P, W):
    """Solves G u = b for the multipliers of W.mask, b and then u in W.linear.rhs; False if singular."""
    row, col, G, mask, b, place = P.g_row, P.g_col, W.G, W.mask, W.linear.rhs, W.linear.place
    A, Y, D, index = W.linear.matrix, W.linear.border, W.linear.schur, W.linear.index
    hubs = 0
    for j in range(P.m):
        place[j] = -1
    for k in range(len(P.hub)):
        if mask[P.hub[k]]:
            place[P.hub[k]] = hubs
            hubs += 1
    for k in range(len(P.hub)):
        i = P.hub[k]
        if mask[i]:
            for c in range(hubs):
                D[place[i], c] = 0.0
            D[place[i], hubs] = b[i]
            for e in range(row[i], row[i + 1]):
                if place[col[e]] >= 0:
                    D[place[i], place[col[e]]] = G[e]
    # The groups, each with the columns of the hubs as further right-hand sides.
    for q in range(len(P.block_row) - 1):
        size = 0
        for k in range(P.block_row[q], P.block_row[q + 1]):
            j = P.block_member[k]
            if mask[j]:
                if size == A.shape[0]:
                    return False
                index[size] = j
                size += 1
        if size == 0:
            continue
        if size == 1 and hubs == 0:
            j = index[0]
            if not abs(G[P.g_diagonal[j]]) > 0.0:
                return False
            b[j] = b[j] / G[P.g_diagonal[j]]
            continue
        for r in range(size):
            place[index[r]] = r
        for r in range(size):
            for c in range(size + 1 + hubs):
                A[r, c] = 0.0
            A[r, size] = b[index[r]]
            for e in range(row[index[r]], row[index[r] + 1]):
                j = col[e]
                if mask[j]:
                    # Hubs have their own count of places; no member of another group stands here.
                    # Of neighbours that are none the entries are 0, and stand where the element's own does.
                    A[r, place[j] + (size + 1 if hubs and _is_hub(P, j) else 0)] += G[e]
        for r in range(size):
            place[index[r]] = -1
        if not solve_dense(A, size, 1 + hubs):
            return False
        for r in range(size):
            b[index[r]] = A[r, size]
            for c in range(hubs):
                Y[index[r], c] = A[r, size + 1 + c]
    if hubs == 0:
        return True
    for k in range(len(P.hub)):
        i = P.hub[k]
        if not mask[i]:
            continue
        for e in range(row[i], row[i + 1]):
            j = col[e]
            if mask[j] and place[j] < 0:
                D[place[i], hubs] -= G[e] * b[j]
                for c in range(hubs):
                    D[place[i], c] -= G[e] * Y[j, c]
    if not solve_dense(D, hubs, 1):
        return False
    for j in range(P.m):
        if mask[j] and place[j] < 0:
            for c in range(hubs):
                b[j] -= Y[j, c] * D[c, hubs]
    for k in range(len(P.hub)):
        if mask[P.hub[k]]:
            b[P.hub[k]] = D[place[P.hub[k]], hubs]
    return True


@kernel
def _is_hub(P, j):
    for k in range(len(P.hub)):
        if P.hub[k] == j:
            return True
    return False
