"""Constant tables that the kernels are handed."""

import math

import numpy as np

TABLES = 5  # known zeros at a step's start: up to three, one more at rounding level


def bernstein_tables(order, width):
    """tables[d][k, i] = binom(i, k) / binom(D, k), D = order - d: Bernstein coefficients are sum_k a[k] tables[d][k].

    One for each degree that known zeros at the step's start can leave.
    """
    tables = np.zeros((TABLES, width, width))
    for d in range(TABLES):
        degree = order - d
        for k in range(degree + 1):
            for i in range(k, degree + 1):
                tables[d, k, i] = math.comb(i, k) / math.comb(degree, k)
    return tables
