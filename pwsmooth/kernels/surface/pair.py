"""Dormand and Prince's pair 8(5,3): its stages, its errors and its interpolant of order 7.

Source: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 1993, II.5 and II.6; tables of SciPy.
"""

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop

from ..machine.compiling import kernel
from ..machine.lanes import load8, splat8, store8

STAGES, DEGREE = 12, 7  # of a step; of the interpolant, for which there are three more
_A, _B, _D, _E3, _E5 = dop.A.copy(), dop.B.copy(), dop.D.copy(), dop.E3.copy(), dop.E5.copy()
TIMES = dop.C.copy()


def _basis():
    """Coefficients in theta of the interpolant's seven products theta^a (1 - theta)^b."""
    rows = np.zeros((7, DEGREE + 1))
    for i in range(7):
        product = np.polynomial.Polynomial([0, 1]) ** (i // 2 + 1) * np.polynomial.Polynomial([1, -1]) ** (
            (i + 1) // 2
        )
        rows[i, : len(product.coef)] = product.coef
    return rows


_BASIS = _basis()


@kernel
def _weight(s, r):
    return _B[r] if s == STAGES else _A[s, r]


@kernel
def stage_point(y, k, s, n, step, out):
    """Overwrites out[:n] by the point at which stage s is taken; stage 12 is the end of the step."""
    for i in range(0, n if n >= 8 else 0, 8):
        at = min(i, n - 8)  # the last eight once more rather than one after the other
        total = splat8(0.0)
        for r in range(s):
            if _weight(s, r) != 0.0:
                total = total + _weight(s, r) * load8(k[r], at)
        store8(out, at, load8(y, at) + step * total)
    for i in range(n if n < 8 else 0):
        rest = 0.0
        for r in range(s):
            if _weight(s, r) != 0.0:
                rest += _weight(s, r) * k[r, i]
        out[i] = y[i] + step * rest


@kernel
def errors(k, i):
    """Component i of the errors of orders 5 and 3, over the length of the step."""
    fifth, third = 0.0, 0.0
    for r in range(STAGES + 1):
        fifth += _E5[r] * k[r, i]
        third += _E3[r] * k[r, i]
    return fifth, third


@kernel
def interpolant(k, i, step, change, row):
    """Adds to a row component i of the step's polynomial in theta of [0, 1], less its value at the start, from all 16
    stages; `change` is that over the step."""
    for part in range(7):
        if part == 0:
            value = change
        elif part == 1:
            value = step * k[0, i] - change
        elif part == 2:
            value = 2.0 * change - step * (k[STAGES, i] + k[0, i])
        else:
            value = 0.0
            for r in range(16):
                value += _D[part - 3, r] * k[r, i]
            value *= step
        for c in range(DEGREE + 1):
            row[c] += value * _BASIS[part, c]
