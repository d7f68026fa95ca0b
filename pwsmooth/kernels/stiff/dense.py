"""Dense elimination of (mu_e/h) I - J with row pivoting, for patterns that are too full to be written out."""

from numba import types

from pwsmooth.kernels.machine.compiling import unit

doubles = types.CPointer(types.float64)

# lu[i, j] as rows of 8 (real parts of four eigenvalues, then imaginary parts) after n rows of pivots (lane e:
# row).


@unit(types.void, types.int64, doubles, doubles, doubles)
def dense_factor(n, J, mu, lu):
    """Overwrites lu with the eliminations of mu I - J in four lanes, each with its own pivots."""
    for e in range(4):
        for i in range(n):
            for j in range(n):
                a = n + i * n + j
                lu[8 * a + e] = -J[i * n + j]
                lu[8 * a + 4 + e] = 0.0
            lu[8 * (n + i * n + i) + e] += mu[e]
            lu[8 * (n + i * n + i) + 4 + e] = mu[4 + e]
        for k in range(n):
            best, row = -1.0, k
            for i in range(k, n):
                a = n + i * n + k
                size = abs(lu[8 * a + e]) + abs(lu[8 * a + 4 + e])
                if size > best:
                    best, row = size, i
            lu[8 * k + e] = row
            if row != k:
                for j in range(n):
                    a, b = n + k * n + j, n + row * n + j
                    lu[8 * a + e], lu[8 * b + e] = lu[8 * b + e], lu[8 * a + e]
                    lu[8 * a + 4 + e], lu[8 * b + 4 + e] = lu[8 * b + 4 + e], lu[8 * a + 4 + e]
            a = n + k * n + k
            size2 = lu[8 * a + e] ** 2 + lu[8 * a + 4 + e] ** 2
            vr, vi = lu[8 * a + e] / size2, -lu[8 * a + 4 + e] / size2
            lu[8 * a + e], lu[8 * a + 4 + e] = vr, vi
            for i in range(k + 1, n):
                a = n + i * n + k
                ar, ai = lu[8 * a + e], lu[8 * a + 4 + e]
                if ar == 0.0 and ai == 0.0:
                    continue
                lr, li = ar * vr - ai * vi, ar * vi + ai * vr
                lu[8 * a + e], lu[8 * a + 4 + e] = lr, li
                for j in range(k + 1, n):
                    b, c = n + k * n + j, n + i * n + j
                    ur, ui = lu[8 * b + e], lu[8 * b + 4 + e]
                    lu[8 * c + e] -= lr * ur - li * ui
                    lu[8 * c + 4 + e] -= lr * ui + li * ur


@unit(types.void, types.int64, doubles, doubles)
def dense_solve(n, lu, R):
    """Overwrites R[i] (8 lanes) with the solutions."""
    for e in range(4):
        for k in range(n):
            row = int(lu[8 * k + e])
            if row != k:
                R[8 * k + e], R[8 * row + e] = R[8 * row + e], R[8 * k + e]
                R[8 * k + 4 + e], R[8 * row + 4 + e] = R[8 * row + 4 + e], R[8 * k + 4 + e]
        for i in range(n):
            re, im = R[8 * i + e], R[8 * i + 4 + e]
            for j in range(i):
                a = n + i * n + j
                re -= lu[8 * a + e] * R[8 * j + e] - lu[8 * a + 4 + e] * R[8 * j + 4 + e]
                im -= lu[8 * a + e] * R[8 * j + 4 + e] + lu[8 * a + 4 + e] * R[8 * j + e]
            R[8 * i + e], R[8 * i + 4 + e] = re, im
        for i in range(n - 1, -1, -1):
            re, im = R[8 * i + e], R[8 * i + 4 + e]
            for j in range(i + 1, n):
                a = n + i * n + j
                re -= lu[8 * a + e] * R[8 * j + e] - lu[8 * a + 4 + e] * R[8 * j + 4 + e]
                im -= lu[8 * a + e] * R[8 * j + 4 + e] + lu[8 * a + 4 + e] * R[8 * j + e]
            a = n + i * n + i
            vr, vi = lu[8 * a + e], lu[8 * a + 4 + e]
            R[8 * i + e], R[8 * i + 4 + e] = re * vr - im * vi, re * vi + im * vr
