"""First root of a polynomial on [0, 1]: the event test of every step.

A surface along a step is a_0 + a_1 s + ... + a_K s^K, s in [0, 1]. In the Bernstein basis the coefficients bound the
polynomial and their sign changes bound the number of roots (Descartes): none -> no root, one -> exactly one,
more -> subdivide, left half first. Most steps are settled by a Bernstein form of degree 6 plus a remainder.
"""

import math

import numpy as np

from numba import types

from .compiling import kernel, unit
from .pointers import call_root
from .state import Work

NO_ROOT = 2.0  # outside [0, 1]
_LOW = 6  # degree of the quick test
_DEEPEST = 46  # subdivisions: 2^-46 of a step is at rounding level


def _quick_table():
    table = np.zeros((_LOW + 1, _LOW + 1))
    for i in range(_LOW + 1):
        c = 1.0
        for k in range(i + 1):
            table[i, k] = c  # binom(i, k) / binom(LOW, k)
            c *= (i - k) / (_LOW - k) if k < _LOW else 0.0
    return table


_TABLE = _quick_table()


@kernel
def lower_bound(a, degree):
    """Lower bound of the polynomial on [0, 1] from a Bernstein form of degree 6 and the remainder (a[0..6] set)."""
    rest = 0.0
    for k in range(_LOW + 1, degree + 1):
        rest += abs(a[k])
    lo = a[0]
    for i in range(1, _LOW + 1):
        b = a[0]
        for k in range(1, i + 1):
            b += _TABLE[i, k] * a[k]
        lo = min(lo, b)
    return lo - rest


@kernel
def to_bernstein(a, degree, b):
    """Overwrites b[0..degree] with the Bernstein coefficients of a on [0, 1]."""
    scale = 1.0
    for k in range(degree + 1):
        b[k] = a[k] * scale
        scale *= (k + 1.0) / (degree - k) if k < degree else 0.0
    for j in range(1, degree + 1):
        for i in range(degree, j - 1, -1):
            b[i] += b[i - 1]


@kernel
def evaluate(a, degree, s):
    """Value of the polynomial at s."""
    value = a[degree]
    for k in range(degree - 1, -1, -1):
        value = value * s + a[k]
    return value


@kernel
def refine(a, degree, lo, hi, s):
    """The single root in [lo, hi] by Halley steps from s, kept inside the bracket."""
    f_lo = evaluate(a, degree, lo)
    for _ in range(60):
        f = a[degree]
        d = 0.0
        c = 0.0
        for k in range(degree - 1, -1, -1):
            c = c * s + d
            d = d * s + f
            f = f * s + a[k]
        if f == 0.0:
            return s
        if (f > 0.0) == (f_lo > 0.0):
            lo = s
        else:
            hi = s
        bottom = d * d - f * c  # c is half of the second derivative
        step = -f * d / bottom if bottom != 0.0 else 0.0
        new = s + step
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
            step = new - s
        s = new
        if abs(step) <= 2e-16 * max(s, 1e-3) or hi - lo <= 1e-16:
            return s
    return s


@unit(types.float64(Work.numba_type, types.int64))
def isolate(W, degree):
    """First root of the polynomial W.poly, which is positive at 0; NO_ROOT if there is none. Overwrites W.bernstein."""
    a, work = W.poly, W.bernstein
    width = degree + 1
    b = work[:width]
    to_bernstein(a, degree, b)
    top = 0.0
    for k in range(width):
        top = max(top, abs(b[k]))
    noise = 4e-16 * top
    depth = 0
    # Depth-first over dyadic intervals; slot d of `work` keeps the right half that waits at depth d.
    left, size = 0.0, 1.0
    pending = 0  # bit d: a right half waits at depth d
    while True:
        base = depth * width
        c = work[base : base + width]
        changes = 0
        previous = 1.0 if c[0] > 0.0 else -1.0
        zero_at = -1
        for k in range(1, width):
            if c[k] != 0.0:
                sign = 1.0 if c[k] > 0.0 else -1.0
                if sign != previous:
                    changes += 1
                    if zero_at < 0:
                        zero_at = k
                    previous = sign
        if c[0] <= 0.0:
            return left
        if changes == 1 or (changes > 1 and depth >= _DEEPEST and c[width - 1] < -noise):
            # Where the control polygon crosses zero.
            s = (zero_at - 1 + c[zero_at - 1] / (c[zero_at - 1] - c[zero_at])) / degree
            return refine(a, degree, left, left + size, left + s * size)
        if changes == 0 and c[width - 1] == 0.0:
            return left + size
        if changes > 1 and depth < _DEEPEST:
            lowest = c[0]
            for k in range(width):
                lowest = min(lowest, c[k])
            if lowest > -noise and c[width - 1] > 0.0:
                changes = 0  # touches within rounding: grazing, no crossing
        if changes > 1 and depth < _DEEPEST:
            # de Casteljau at 1/2: left half in place one level deeper, right half stays at this level.
            d = work[base + width : base + 2 * width]
            for i in range(width):
                d[i] = c[0]
                for k in range(width - 1 - i):
                    c[k] = 0.5 * (c[k] + c[k + 1])
            pending |= 1 << depth
            size *= 0.5
            depth += 1
            continue
        # No root here: go to the next waiting right half.
        while depth > 0:
            depth -= 1
            size *= 2.0
            if pending >> depth & 1:
                pending ^= 1 << depth
                left_parent = math.floor(left / size) * size
                left = left_parent + 0.5 * size
                size *= 0.5
                # The right half is processed as if it were one level deeper, in its own slot.
                src = work[depth * width : (depth + 1) * width]
                dst = work[(depth + 1) * width : (depth + 2) * width]
                for k in range(width):
                    dst[k] = src[k]
                depth += 1
                break
        else:
            return NO_ROOT
        if depth == 0:
            return NO_ROOT


@kernel
def first_root(P, W, degree):
    """First s in [0, 1] where the polynomial W.poly, positive at 0, ceases to be positive; NO_ROOT if there is none.

    A value <= 0 at s = 0 is a root there. A dip that stays above zero is none, however shallow; one that only touches
    within rounding is none either.
    """
    if W.poly[0] <= 0.0:
        return 0.0
    if lower_bound(W.poly, degree) > 0.0:
        return NO_ROOT
    return call_root(P.root_unit, W, degree)
