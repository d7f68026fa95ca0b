"""First root of a polynomial on [0, 1]: the event test of every step.

A surface along a step is a_0 + a_1 s + ... + a_K s^K, s in [0, 1]. In the Bernstein basis the coefficients bound the
polynomial and their sign changes bound the number of roots (Descartes): none -> no root, one -> exactly one,
more -> subdivide, left half first. Most steps are settled by a Bernstein form of degree 6 plus a remainder, most of
the others by the best one of degree 15 and its error (tables.py): then the polynomial itself is never converted.
"""

import math

from numba import types

from ..machine.compiling import inlined_kernel, kernel, unit
from ..machine.lanes import load8, store8
from ..machine.pointers import abs8, at, below_zero8, call_root, count_bits, powers8, sum8
from ..work import Roots
from .tables import SHORT

NO_ROOT = 2.0  # outside [0, 1]
_LOW = 6  # degree of the quick test
GRAZING = 1e-12  # a dip this shallow, or this close to one, is not decided silently
_DEEPEST = 46  # subdivisions: 2^-46 of a step is at rounding level
_TURNS = 20  # of Newton's method for where a dip is lowest


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
def _to_bernstein(roots, degree, b):
    """Overwrites b with the Bernstein coefficients of roots.poly on [0, 1]; returns which are negative, as bits."""
    a, table, negative, width = roots.poly, roots.bernstein_table, 0, len(roots.poly)
    columns = (roots.order - degree) * width * width
    for start in range(0, degree + 1, 8):
        # By columns, in two sums: a sum of one chain would wait for each addition. Columns beyond the degree are zero.
        column = columns + start
        even = load8(table, column) * at(a, 0)
        odd = load8(table, column + width) * at(a, 1)
        for k in range(2, min(start + 8, degree + 1), 2):
            column += 2 * width
            even = even + load8(table, column) * at(a, k)
            odd = odd + load8(table, column + width) * at(a, k + 1)
        block = even + odd
        store8(b, start, block)
        negative |= below_zero8(block) << start
    return negative


@kernel
def _short_form(roots, a, degree, b):
    """Overwrites b[:16] with coefficients of degree 15 of a; returns which are negative and which undecided, as bits,
    and the bound of what they leave out."""
    table, error = roots.short_table, roots.short_error
    low0, high0 = load8(table, 0) * at(a, 0), load8(table, 8) * at(a, 0)
    low1, high1 = load8(table, 16) * at(a, 1), load8(table, 24) * at(a, 1)
    for k in range(2, degree + 1, 2):
        column = 16 * k
        low0 = low0 + load8(table, column) * at(a, k)
        high0 = high0 + load8(table, column + 8) * at(a, k)
        low1 = low1 + load8(table, column + 16) * at(a, k + 1)
        high1 = high1 + load8(table, column + 24) * at(a, k + 1)
    left = abs8(load8(a, 0)) * load8(error, 0)
    for k in range(8, degree + 1, 8):
        left = left + abs8(load8(a, k)) * load8(error, k)
    rest = sum8(left)
    low, high = low0 + low1, high0 + high1
    store8(b, 0, low)
    store8(b, 8, high)
    negative = below_zero8(low) | below_zero8(high) << 8
    undecided = below_zero8(abs8(low) + -rest) | below_zero8(abs8(high) + -rest) << 8
    return negative, undecided, rest


@kernel
def _note_grazing(roots, s, crosses):
    """Leaves word for the loop: near s the surface is touched to within GRAZING of its value at the start."""
    roots.dips = 1
    roots.dip_crosses = crosses
    roots.dip_at = s


@kernel
def _polish(roots, degree, lo, hi, s):
    """The single root of roots.poly in [lo, hi], positive at lo, by Householder steps from s inside the bracket.

    Returns also s p'(s) and s^2 p''(s) there.
    """
    a, n1, n2, n3 = roots.poly, roots.counting, roots.pairing, roots.tripling
    before, d, c = 0.0, 0.0, 0.0
    for _ in range(60):
        # p and s, s^2, s^3 times its derivatives at once, eight terms a block: a_k s^k times 1, k, k (k - 1), ...
        s2 = s * s
        s4 = s2 * s2
        s8 = s4 * s4
        block = powers8(s)
        term = load8(a, 0) * block
        value, slope, bend, twist = term, term * load8(n1, 0), term * load8(n2, 0), term * load8(n3, 0)
        for k in range(8, degree + 1, 8):
            block = block * s8
            term = load8(a, k) * block
            value = value + term
            slope = slope + term * load8(n1, k)
            bend = bend + term * load8(n2, k)
            twist = twist + term * load8(n3, k)
        f, d, c, e = sum8(value), sum8(slope), sum8(bend), sum8(twist)
        if f == 0.0:
            break
        if f > 0.0:
            lo = s
        else:
            hi = s
        bottom = d * (d * d - f * c) + f * f * e * (1.0 / 6.0)
        new = s - s * f * (d * d - 0.5 * f * c) / bottom if bottom != 0.0 else lo - 1.0
        step = abs(new - s)
        if step <= 2e-16 * max(s, 1e-3) or hi - lo <= 1e-16:
            break
        if lo < new < hi:
            s = new
            # Convergence of order 4, step = C before^4: the next step would be step (step/before)^4.
            square, was = step * step, before * before
            if square * square * step < 1e-17 * s * (was * was):
                break
            # A start this close converges in one step unless the root is nearly double.
            if before == 0.0 and step <= 1e-5 * s and abs(c) * step <= 1e-3 * abs(d) * s:
                break
            before = step
        else:
            s = 0.5 * (lo + hi)
            before = 0.0  # the length of a bisection says nothing of convergence
    return s, d, c


@kernel
def _note_shallow(roots, s, d, c):
    if c > 0.0 and 0.5 * d * d < GRAZING * c * max(at(roots.poly, 0), roots.shallow):
        _note_grazing(roots, s, 1)  # it turns back after a dip that shallow


@kernel
def _refine(roots, degree, lo, hi, s):
    """The single root of roots.poly in [lo, hi], near s."""
    s, d, c = _polish(roots, degree, lo, hi, s)
    _note_shallow(roots, s, d, c)
    return s


@kernel
def _lowest(roots, degree, lo, hi, s):
    """Where roots.poly is lowest in [lo, hi], by Newton's method on its slope from s; s where it is not convex."""
    for _ in range(_TURNS):
        slope, bend = 0.0, 0.0
        for k in range(degree, 0, -1):
            bend = bend * s + slope
            slope = slope * s + k * at(roots.poly, k)
        if not bend > 0.0:
            break
        before, s = s, min(hi, max(lo, s - slope / bend))
        if abs(s - before) <= 1e-12:
            break
    return s


@kernel
def _guess(degree, b):
    """Where a polynomial with one root in [0, 1] and Bernstein coefficients b crosses zero, roughly."""
    first, last = b[0], b[degree]
    drop = last - first
    r = first / -drop
    slope0, slope1 = degree * (b[1] - first), degree * (last - b[degree - 1])
    if slope0 < 0.0 and slope1 < 0.0:
        # The cubic s(p) with the same ends and slopes there.
        s = r * r * (3.0 - 2.0 * r) + r * (1.0 - r) * (drop / slope0 * (1.0 - r) - drop / slope1 * r)
        if 0.0 < s < 1.0:
            return s
    # The parabola with the same ends and the same slope at 0.
    disc = slope0 * slope0 - 4.0 * first * (drop - slope0)
    s = 2.0 * first / (math.sqrt(max(disc, 0.0)) - slope0)
    return s if 0.0 < s < 1.0 else r


@inlined_kernel
def _sign_changes(negative, degree):
    """Sign changes among coefficients 0..degree, given which of them are negative."""
    return count_bits((negative ^ negative >> 1) & ((1 << degree) - 1))


@kernel
def _split(roots, degree, stride, slot):
    """The halves of the polynomial in slot `slot` of roots.bernstein: left in the next slot, right in place.

    Returns which coefficients of the left half are negative. Columns of de Casteljau's weights at 1/2.
    """
    work, negative, width = roots.bernstein, 0, len(roots.poly)
    left, right = roots.left_half, roots.right_half
    here, there = slot * stride, (slot + 1) * stride
    for start in range(0, degree + 1, 8):
        block = load8(left, start) * at(work, here)
        for k in range(1, min(start + 8, degree + 1)):
            block = block + load8(left, k * width + start) * at(work, here + k)
        store8(work, there + start, block)
        negative |= below_zero8(block) << start
    columns = (roots.order - degree) * width * width
    for start in range(0, degree + 1, 8):
        # From coefficient `start` on, so that those written are not read again.
        block = load8(right, columns + start * width + start) * at(work, here + start)
        for k in range(start + 1, degree + 1):
            block = block + load8(right, columns + k * width + start) * at(work, here + k)
        store8(work, here + start, block)
    return negative


@kernel
def _subdivide(roots, degree, stride, negative):
    """First root where more than one is possible: halves, left first. `bernstein` holds [0, 1] in its first slot."""
    a, work = roots.poly, roots.bernstein
    top = 0.0
    for k in range(degree + 1):
        top = max(top, abs(work[k]))
    noise = 4e-16 * top
    depth, left, size = 0, 0.0, 1.0
    pending = 0  # bit d: the right half of an interval of depth d waits in slot d
    while True:
        c = work[depth * stride : (depth + 1) * stride]
        changes = _sign_changes(negative, degree)
        if c[0] <= 0.0:
            return left
        if changes == 1 or (changes > 1 and depth >= _DEEPEST and c[degree] < -noise):
            return _refine(roots, degree, left, left + size, left + size * _guess(degree, c))
        if changes == 0:
            if c[degree] == 0.0:
                return left + size
            if depth > 0:
                last = (
                    degree if left + size >= 1.0 else degree + 1
                )  # the step's end is the next step's business
                for k in range(1, last):
                    if c[k] < GRAZING * max(a[0], roots.shallow):
                        s = left + size * k / degree
                        _note_grazing(roots, _lowest(roots, degree, left, left + size, s), 0)
        elif depth < _DEEPEST:
            lowest = c[0]
            for k in range(degree + 1):
                lowest = min(lowest, c[k])
            if lowest > -noise and c[degree] > 0.0:
                # Touches within rounding: not decided by the numbers.
                s = _lowest(roots, degree, left, left + size, left + 0.5 * size)
                _note_grazing(roots, s, 0)
            else:
                negative = _split(roots, degree, stride, depth)
                pending |= 1 << depth
                size *= 0.5
                depth += 1
                continue
        # No root here: go to the next waiting right half, one slot up, so that its own left half has room.
        while True:
            if pending == 0:
                return NO_ROOT
            depth -= 1
            size *= 2.0
            if pending >> depth & 1:
                break
        pending ^= 1 << depth
        size *= 0.5
        left = math.floor(left / (2.0 * size)) * 2.0 * size + size
        negative = 0
        for k in range(degree + 1):
            work[(depth + 1) * stride + k] = work[depth * stride + k]
            if work[depth * stride + k] < 0.0:
                negative |= 1 << k
        depth += 1


@kernel
def _lone_guess(b, k):
    """Where the polynomial with Bernstein coefficients b of degree 15 crosses zero between those of k and k + 1."""
    # Its values at k/15 and (k + 1)/15 are the coefficients less their own bend: b + x (1 - x) 15 p''/2 + O(1/15^2).
    left, right = at(b, k), at(b, k + 1)
    x, y = k * (1.0 / SHORT), (k + 1) * (1.0 / SHORT)
    bend0 = right - 2.0 * left + at(b, max(k - 1, 0)) if k > 0 else 0.0
    bend1 = at(b, min(k + 2, SHORT)) - 2.0 * right + left if k + 1 < SHORT else 0.0
    left += 0.5 * (SHORT - 1.0) * x * (1.0 - x) * bend0
    right += 0.5 * (SHORT - 1.0) * y * (1.0 - y) * bend1
    share = left / (left - right)
    return x + (1.0 / SHORT) * share if -1.0 < share < 2.0 else x + 0.5 / SHORT


@kernel
def _isolate_short(roots, degree):
    """The first root of roots.poly by its best polynomial of degree 15; below 0 where that does not decide."""
    a, b, scaled = roots.poly, roots.bernstein, roots.near
    negative, undecided, rest = _short_form(roots, a, degree, b)
    if undecided != 0:
        return -1.0
    if negative == 0:
        return NO_ROOT
    end = 1.0
    if _sign_changes(negative, SHORT) > 1:
        # Look again at the part up to the middle of the first dip.
        first = count_bits((negative & -negative) - 1)
        beyond = ~(negative >> first)
        last = first + count_bits((beyond & -beyond) - 1) - 1
        middle = (first + last) // 2
        end = middle * (1.0 / SHORT)
        row = middle * len(a)
        for k in range(0, degree + 1, 8):
            store8(scaled, k, load8(a, k) * load8(roots.short_powers, row + k))
        negative, undecided, rest = _short_form(roots, scaled, degree, b)
        if undecided != 0 or negative == 0 or _sign_changes(negative, SHORT) != 1:
            return -1.0
    guess = roots.guess
    if not 0.0 < guess < end:
        guess = end * _lone_guess(b, count_bits((negative & -negative) - 1) - 1)
    s, d, c = _polish(roots, degree, 0.0, end, guess)
    # The polynomial differs by `rest` from one with a single root: it has a second one only beside a flat one.
    bend = load8(roots.pairing, 0) * abs8(load8(a, 0))
    for k in range(8, degree + 1, 8):
        bend = bend + load8(roots.pairing, k) * abs8(load8(a, k))
    if not d * d > 4.0 * rest * sum8(bend) * s * s:
        return -1.0
    _note_shallow(roots, s, d, c)
    return s


@unit(types.float64, Roots, types.int64)
def isolate(roots, degree):
    """First root of roots.poly, which is positive at 0; NO_ROOT if there is none. Overwrites roots.bernstein."""
    s = _isolate_short(roots, degree)
    if s >= 0.0:
        return s
    negative = _to_bernstein(roots, degree, roots.bernstein)
    if negative == 0:
        return 1.0 if roots.bernstein[degree] == 0.0 else NO_ROOT
    if _sign_changes(negative, degree) == 1:
        return _refine(roots, degree, 0.0, 1.0, _guess(degree, roots.bernstein))
    return _subdivide(roots, degree, len(roots.poly), negative)


@inlined_kernel
def first_root(P, roots, degree):
    """First s in [0, 1] where roots.poly, positive at 0, ceases to be positive; else NO_ROOT.

    A value <= 0 at s = 0 is a root there. A dip that stays above zero is none, however shallow; one that only touches
    within rounding is none either.
    """
    if roots.poly[0] <= 0.0:
        return 0.0
    if low_bounds(roots.poly)[0] > remainder(roots.poly, degree):
        return NO_ROOT
    return call_root(P.root_unit, roots, degree)
