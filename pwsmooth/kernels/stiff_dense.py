"""Dense elimination of (mu_e/h) I - J with row pivoting, for patterns that are too full to be written out."""

from numba import njit

# lu[i, j] as rows of 8 (real parts of four eigenvalues, then imaginary parts) after n rows of pivots (lane e: row).


@njit(cache=True, fastmath={"contract"})
def dense_factor(n, J, mu, lu):
    """Overwrites lu with the eliminations of mu I - J in four lanes, each with its own pivots."""
    for e in range(4):
        for i in range(n):
            for j in range(n):
                a = n + i * n + j
                lu[a, e] = -J[i, j]
                lu[a, 4 + e] = 0.0
            lu[n + i * n + i, e] += mu[e]
            lu[n + i * n + i, 4 + e] = mu[4 + e]
        for k in range(n):
            best, row = -1.0, k
            for i in range(k, n):
                a = n + i * n + k
                size = abs(lu[a, e]) + abs(lu[a, 4 + e])
                if size > best:
                    best, row = size, i
            lu[k, e] = row
            if row != k:
                for j in range(n):
                    a, b = n + k * n + j, n + row * n + j
                    lu[a, e], lu[b, e] = lu[b, e], lu[a, e]
                    lu[a, 4 + e], lu[b, 4 + e] = lu[b, 4 + e], lu[a, 4 + e]
            a = n + k * n + k
            size2 = lu[a, e] ** 2 + lu[a, 4 + e] ** 2
            vr, vi = lu[a, e] / size2, -lu[a, 4 + e] / size2
            lu[a, e], lu[a, 4 + e] = vr, vi
            for i in range(k + 1, n):
                a = n + i * n + k
                ar, ai = lu[a, e], lu[a, 4 + e]
                if ar == 0.0 and ai == 0.0:
                    continue
                lr, li = ar * vr - ai * vi, ar * vi + ai * vr
                lu[a, e], lu[a, 4 + e] = lr, li
                for j in range(k + 1, n):
                    b, c = n + k * n + j, n + i * n + j
                    ur, ui = lu[b, e], lu[b, 4 + e]
                    lu[c, e] -= lr * ur - li * ui
                    lu[c, 4 + e] -= lr * ui + li * ur


@njit(cache=True, fastmath={"contract"})
def dense_solve(n, lu, R):
    """Overwrites R[i] (8 lanes) with the solutions."""
    for e in range(4):
        for k in range(n):
            row = int(lu[k, e])
            if row != k:
                R[k, e], R[row, e] = R[row, e], R[k, e]
                R[k, 4 + e], R[row, 4 + e] = R[row, 4 + e], R[k, 4 + e]
        for i in range(n):
            re, im = R[i, e], R[i, 4 + e]
            for j in range(i):
                a = n + i * n + j
                re -= lu[a, e] * R[j, e] - lu[a, 4 + e] * R[j, 4 + e]
                im -= lu[a, e] * R[j, 4 + e] + lu[a, 4 + e] * R[j, e]
            R[i, e], R[i, 4 + e] = re, im
        for i in range(n - 1, -1, -1):
            re, im = R[i, e], R[i, 4 + e]
            for j in range(i + 1, n):
                a = n + i * n + j
                re -= lu[a, e] * R[j, e] - lu[a, 4 + e] * R[j, 4 + e]
                im -= lu[a, e] * R[j, 4 + e] + lu[a, 4 + e] * R[j, e]
            a = n + i * n + i
            vr, vi = lu[a, e], lu[a, 4 + e]
            R[i, e], R[i, 4 + e] = re * vr - im * vi, re * vi + im * vr
