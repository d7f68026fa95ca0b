"""Convolutions of Taylor rows and the small linear solver of sliding jets, called by generated programs.

A row is a stretch of one buffer of doubles, given by its offset. The sums leave out both ends, j = 0 and
j = k: the caller adds them from values that it has in registers.
"""

from numba import njit


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def conv(rows, a, b, k):
    """sum over 0 < j < k of a_j b_(k-j); two sums, because one would wait for each addition."""
    b += k
    s0, s1 = 0.0, 0.0
    j = 1
    while j < k - 1:
        s0 += rows[a + j] * rows[b - j]
        s1 += rows[a + j + 1] * rows[b - j - 1]
        j += 2
    if j < k:
        s0 += rows[a + j] * rows[b - j]
    return s0 + s1


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def square(rows, a, k):
    """sum over 0 < j < k of a_j a_(k-j), each pair once."""
    b = a + k
    s0, s1 = 0.0, 0.0
    half = (k + 1) // 2
    j = 1
    while j < half - 1:
        s0 += rows[a + j] * rows[b - j]
        s1 += rows[a + j + 1] * rows[b - j - 1]
        j += 2
    if j < half:
        s0 += rows[a + j] * rows[b - j]
    s0 = 2.0 * (s0 + s1)
    if k % 2 == 0:
        s0 += rows[a + half] * rows[a + half]
    return s0


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def weighted(rows, a, b, k):
    """sum over 0 < j < k of j a_j b_(k-j)."""
    b += k
    s0, s1, w = 0.0, 0.0, 1.0
    j = 1
    while j < k - 1:
        s0 += w * rows[a + j] * rows[b - j]
        s1 += (w + 1.0) * rows[a + j + 1] * rows[b - j - 1]
        w += 2.0
        j += 2
    if j < k:
        s0 += w * rows[a + j] * rows[b - j]
    return s0 + s1


@njit(cache=True, error_model="numpy")
def lu_factor(rows, a, n):
    """Factorise the n*n matrix at offset a in place, numbers of the pivot rows after it; 1 where singular."""
    scale = 0.0
    for i in range(n * n):
        scale = max(scale, abs(rows[a + i]))
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(rows[a + r * n + c]) > abs(rows[a + best * n + c]):
                best = r
        rows[a + n * n + c] = best
        for i in range(n):
            rows[a + c * n + i], rows[a + best * n + i] = rows[a + best * n + i], rows[a + c * n + i]
        pivot = rows[a + c * n + c]
        # Rounding leaves a few eps of the largest entry where the exact pivot is 0.
        if not abs(pivot) > 2e-15 * scale:
            return 1
        for r in range(c + 1, n):
            f = rows[a + r * n + c] / pivot
            rows[a + r * n + c] = f
            for i in range(c + 1, n):
                rows[a + r * n + i] -= f * rows[a + c * n + i]
    return 0


@njit(cache=True, error_model="numpy")
def lu_solve(rows, a, n):
    """Solve with the factors at offset a; right-hand side and solution stand after the pivot numbers."""
    b = a + n * n + n
    for c in range(n):
        best = b + int(rows[a + n * n + c])
        rows[b + c], rows[best] = rows[best], rows[b + c]
    for r in range(n):
        for i in range(r):
            rows[b + r] -= rows[a + r * n + i] * rows[b + i]
    for r in range(n - 1, -1, -1):
        for i in range(r + 1, n):
            rows[b + r] -= rows[a + r * n + i] * rows[b + i]
        rows[b + r] /= rows[a + r * n + r]
