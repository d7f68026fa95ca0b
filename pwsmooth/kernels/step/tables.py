"""Constant tables that the kernels are handed."""

import functools
import math

import numpy as np

SHORT = 15  # degree of the polynomial that stands for a longer one: its coefficients are two vectors of eight
STAGES = 8  # of the collocation that begins a slip (onset.py): one vector
TABLES = 5  # known zeros at a step's start: up to three, one more at rounding level


@functools.cache
def bernstein_tables(order, width):
    """Flat tables[d][k, i] = binom(i, k)/binom(D, k), D = order - d; Bernstein coefficients: sum_k a[k] tables[d][k].

    One for each degree that known zeros at the step's start can leave.
    """
    tables = np.zeros((TABLES, width, width))
    for d in range(TABLES):
        degree = order - d
        for k in range(degree + 1):
            for i in range(k, degree + 1):
                tables[d, k, i] = math.comb(i, k) / math.comb(degree, k)
    return tables.ravel()


@functools.cache
def halving_tables(order, width):
    """(left, right), flat: de Casteljau at 1/2 by columns, left coefficients sum_k b[k] left[k], right by right[d][k].

    left[k, i] = binom(i, k)/2^i for every degree; right[d][k, i] = binom(D - i, k - i)/2^(D - i), D = order - d.
    """
    left, right = np.zeros((width, width)), np.zeros((TABLES, width, width))
    for i in range(order + 1):
        for k in range(i + 1):
            left[k, i] = math.comb(i, k) / 2**i
    for d in range(TABLES):
        degree = order - d
        right[d, : degree + 1, : degree + 1] = left[degree::-1, degree::-1]
    return left.ravel(), right.ravel()


@functools.cache
def short_tables(order, width):
    """(table, error, powers), flat: a polynomial of degree 15 close to a[0] + ... + a[order] s^order on [0, 1].

    Its Bernstein coefficients are sum_k a[k] table[k, i], i = 0..15, and it is off by sum_k |a[k]| error[k] at most:
    what remains of the Chebyshev series 2^(1 - 2k) (binom(2k, k)/2 + sum_j binom(2k, k - j) T*_j) of s^k, and
    roundings. powers[i, k] = (i/15)^k.
    """
    table, error = np.zeros((width, SHORT + 1)), np.zeros(width)
    chebyshev = np.zeros(
        (SHORT + 1, SHORT + 1)
    )  # of T*_j, whose own coefficients (degree j) are raised to degree 15
    for j in range(SHORT + 1):
        own = [(-1) ** (j - q) * math.comb(2 * j, 2 * q) / math.comb(j, q) for q in range(j + 1)]
        for i in range(SHORT + 1):
            chebyshev[j, i] = sum(
                math.comb(j, q) * math.comb(SHORT - j, i - q) * own[q]
                for q in range(max(0, i + j - SHORT), min(i, j) + 1)
            ) / math.comb(SHORT, i)
    for k in range(order + 1):
        if k <= SHORT:
            table[k] = [math.comb(i, k) / math.comb(SHORT, k) for i in range(SHORT + 1)]
        else:
            series = np.array([math.comb(2 * k, k - j) for j in range(k + 1)]) * 2.0 ** (1 - 2 * k)
            series[0] *= 0.5
            table[k] = series[: SHORT + 1] @ chebyshev
            error[k] = series[SHORT + 1 :].sum()
        error[k] += 1e-15
    powers = np.zeros((SHORT + 1, width))
    powers[:, : order + 1] = (np.arange(SHORT + 1) / SHORT)[:, None] ** np.arange(order + 1)
    return table.ravel(), error, powers.ravel()
