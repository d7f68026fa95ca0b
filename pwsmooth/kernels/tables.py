"""Constant tables that the kernels are handed."""

import functools
import math

import numpy as np

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
