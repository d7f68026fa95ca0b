"""First root of a polynomial on [0, 1]: the event test of every step.

A surface along a step is a_0 + a_1 s + ... + a_K s^K, s in [0, 1]. In the Bernstein basis the coefficients bound the
polynomial and their sign changes bound the number of roots (Descartes): none -> no root, one -> exactly one,
more -> subdivide, left half first. Most steps are settled by a Bernstein form of degree 6 plus a remainder.
"""

import math

from numba import types

from .compiling import inlined_kernel, kernel, unit
from .lanes import load8, store8
from .pointers import abs8, at, call_root, sum8
from .state import Work
from .steps import first_powers

NO_ROOT = 2.0  # outside [0, 1]
_LOW = 6  # degree of the quick test
GRAZING = 1e-12  # a dip this shallow, or this close to one, is not decided silently
_DEEPEST = 46  # subdivisions: 2^-46 of a step is at rounding level


@inlined_kernel
def low_bounds(a):
    """Smallest and largest Bernstein coefficient of a[0] + ... + a[6] s^6 on [0, 1], written out."""
    a0, a1, a2, a3, a4, a5 = at(a, 0), at(a, 1), at(a, 2), at(a, 3), at(a, 4), at(a, 5)
    b1 = a0 + (1.0 / 6.0) * a1
    b2 = a0 + (1.0 / 3.0) * a1 + (1.0 / 15.0) * a2
    b3 = a0 + 0.5 * a1 + 0.2 * a2 + 0.05 * a3
    b4 = a0 + (2.0 / 3.0) * a1 + 0.4 * a2 + 0.2 * a3 + (1.0 / 15.0) * a4
    b5 = a0 + (5.0 / 6.0) * a1 + (2.0 / 3.0) * a2 + 0.5 * a3 + (1.0 / 3.0) * a4 + (1.0 / 6.0) * a5
    b6 = ((a0 + a1) + (a2 + a3)) + ((a4 + a5) + at(a, 6))
    lo = min(min(min(a0, b1), min(b2, b3)), min(min(b4, b5), b6))
    hi = max(max(max(a0, b1), max(b2, b3)), max(max(b4, b5), b6))
    return lo, hi


@inlined_kernel
def remainder(a, degree):
    """Bound of the terms above degree 6 on [0, 1]; a is zero from degree + 1 on, up to a multiple of 8."""
    total = abs8(load8(a, 8))
    for k in range(16, degree + 1, 8):
        total = total + abs8(load8(a, k))
    return abs(at(a, _LOW + 1)) + (sum8(total) if degree >= 8 else 0.0)


@kernel
def _to_bernstein(W, degree, b):
    """Overwrites b with the Bernstein coefficients of W.poly on [0, 1], by columns: no chain from one to the next."""
    a, table = W.poly, W.bernstein_table[W.order - degree]
    for start in range(0, degree + 1, 8):
        block = load8(table[0], start) * at(a, 0)
        for k in range(1, min(start + 8, degree + 1)):
            block = block + load8(table[k], start) * at(a, k)
        store8(b, start, block)


@inlined_kernel
def _derive(W, a, d, degree):
    """Overwrites d with the derivative of a; both are zero from their degree on, up to a multiple of 8."""
    for k in range(0, degree + 1, 8):
        store8(d, k, load8(W.counting, k) * load8(a, k + 1))


@kernel
def _note_grazing(W, s, crosses):
    """Leaves word for the loop: near s the surface is touched to within GRAZING of its value at the start."""
    W.code[8] = 1
    W.code[10] = crosses
    W.answer[6] = s


@kernel
def _refine(W, degree, lo, hi, s):
    """The single root of W.poly in [lo, hi], positive at lo, by Halley steps from s inside the bracket."""
    a, first, second, power = W.poly, W.first, W.second, W.root_power
    before, d, c = 1.0, 0.0, 0.0
    for _ in range(60):
        # Value and two derivatives at once, eight terms a block.
        s8 = first_powers(power, s)
        block = load8(power, 0)
        value, slope, bend = load8(a, 0) * block, load8(first, 0) * block, load8(second, 0) * block
        for k in range(8, degree + 1, 8):
            block = block * s8
            value = value + load8(a, k) * block
            slope = slope + load8(first, k) * block
            bend = bend + load8(second, k) * block
        f, d, c = sum8(value), sum8(slope), sum8(bend)
        if f == 0.0:
            break
        if f > 0.0:
            lo = s
        else:
            hi = s
        bottom = d * d - 0.5 * f * c
        new = s - f * d / bottom if bottom != 0.0 else lo - 1.0
        step = abs(new - s)
        if step <= 2e-16 * max(s, 1e-3) or hi - lo <= 1e-16:
            break
        if lo < new < hi:
            s = new
            # Cubic convergence: after a step of 1e-7 that was 1000 times shorter than the one before, s is at rounding.
            if step < 1e-7 * s and step < 1e-3 * before:
                break
            before = step
        else:
            s = 0.5 * (lo + hi)
            before = 0.0  # the length of a bisection says nothing of convergence
    if c > 0.0 and 0.5 * d * d < GRAZING * c * at(a, 0):
        _note_grazing(W, s, 1)  # it turns back after a dip that shallow
    return s


@unit(types.float64, Work, types.int64)
def isolate(W, degree):
    """First root of the polynomial W.poly, which is positive at 0; NO_ROOT if there is none. Overwrites W.bernstein."""
    a, work = W.poly, W.bernstein
    _derive(W, a, W.first, degree)
    _derive(W, W.first, W.second, degree)
    if low_bounds(W.first)[1] + remainder(W.first, degree) < 0.0:
        # Falls all the way: one root if it ends below zero, none else. The usual case of a surface that is met.
        end = 0.0
        for k in range(degree + 1):
            end += at(a, k)
        if end > 0.0:
            return NO_ROOT
        # From the parabola with the same value and slope at 0 and the same end.
        slope = at(a, 1)
        disc = slope * slope - 4.0 * at(a, 0) * (end - at(a, 0) - slope)
        return _refine(W, degree, 0.0, 1.0, 2.0 * at(a, 0) / (math.sqrt(max(disc, 0.0)) - slope))
    width = degree + 1
    b = work[: width + 8]
    _to_bernstein(W, degree, b)
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
            return _refine(W, degree, left, left + size, left + s * size)
        if changes == 0 and c[width - 1] == 0.0:
            return left + size
        if changes == 0 and depth > 0:
            last = degree if left + size >= 1.0 else degree + 1  # the step's end is the next step's business
            for k in range(1, last):
                if c[k] < GRAZING * a[0]:
                    _note_grazing(W, left + size * k / degree, 0)
        if changes > 1 and depth < _DEEPEST:
            lowest = c[0]
            for k in range(width):
                lowest = min(lowest, c[k])
            if lowest > -noise and c[width - 1] > 0.0:
                changes = 0  # touches within rounding: grazing, no crossing, but not decided by the numbers
                _note_grazing(W, left + 0.5 * size, 0)
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


@inlined_kernel
def first_root(P, W, poly, degree):
    """First s in [0, 1] where `poly` (which is W.poly), positive at 0, ceases to be positive; else NO_ROOT.

    A value <= 0 at s = 0 is a root there. A dip that stays above zero is none, however shallow; one that only touches
    within rounding is none either.
    """
    if poly[0] <= 0.0:
        return 0.0
    if low_bounds(poly)[0] > remainder(poly, degree):
        return NO_ROOT
    return call_root(P.root_unit, W, degree)
