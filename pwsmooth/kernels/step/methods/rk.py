"""Dormand-Prince 8(5,3) as the plain alternative to jets: for functions without a recurrence, and as a second opinion.

A step gives the same thing as a jet: polynomials of the states (the method's own interpolant of order 7) and, fitted
at Chebyshev points of it, of the solved multipliers and of every surface. An event found on them is refined by steps
that end there, so that the state at the event has the order of the step, not of the interpolant.
"""

import math

import numpy as np
from numba import types

from ...intervals import time_size
from ...machine.compiling import inlined_kernel, kernel, unit
from ...machine.pointers import call_fields, call_linear, call_newton
from ...state import CONTACT, SOLVED, Control, Problem, State
from ...surface.pair import DEGREE, STAGES, TIMES, errors, interpolant, stage_point
from ...surface.sliding import mask_solved, surface_rounding, surface_size, surface_speed
from ...work import Work
from ..steps import REACH

_MOST_HALVES = 20
_CONVERGED = 1e-6  # of a step: by so little a zero of the step moves at last, however good the slope is
_MINUTE = 1e-12  # of a surface's size: the height of an arc of a thousand roundings
_DEFECT = 100.0  # of the tolerance: that of the interpolant, whose order is lower, over a step that is good
_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
_BETWEEN = 0.5 - 0.5 * math.cos(
    math.pi * (DEGREE - 0.5) / DEGREE
)  # between the last two: the fit is worst there
_FIT = np.linalg.inv(np.vander(_NODES, increasing=True))
# The same with the slope at the start in place of the value at the first node: where a surface has just been left it is
# small beside the step, and the next root is as good as its slope.
_POWERS = np.vander(_NODES, increasing=True)
_POWERS[1] = np.eye(DEGREE + 1)[1]
_FIT_WITH_SLOPE = np.linalg.inv(_POWERS)


@kernel
def _rate(P, S, W, t, out, stage):
    """Overwrites out[stage] with f at S.x, the solved multipliers solved there; False when they have no solution."""
    keep = S.t
    S.t = t
    found = True
    if W.pair.solves:
        mask_solved(P, S, W)
        found = call_newton(P.newton_unit, P, S, W) != 0
    call_fields(P.fields, t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    S.t = keep
    for i in range(P.n):
        out[stage, i] = W.dx[i]
    return found


@kernel
def _try_step(P, C, S, W, h):
    """One step of size h from (pair.x, pair.mult); leaves the end in S.x, S.mult. Returns the scaled error, or nan."""
    n, k, x0, t = P.n, W.pair.k, W.pair.x, S.t
    for s in range(STAGES + 1):
        stage_point(x0, k, s, n, h, S.x)
        if not _rate(P, S, W, t + (TIMES[s] * h if s < STAGES else h), k, s):
            return math.nan
    e5, e3 = 0.0, 0.0
    for i in range(n):
        scale = W.step.atol[i] + C.rtol * max(abs(x0[i]), abs(S.x[i]))
        a, b = errors(k, i)
        e5 += (a / scale) ** 2
        e3 += (b / scale) ** 2
    if e5 == 0.0 and e3 == 0.0:
        return 0.0
    return abs(h) * e5 / math.sqrt((e5 + 0.01 * e3) * max(n, 1))


@kernel
def _restore(P, S, W):
    for i in range(P.n):
        S.x[i] = W.pair.x[i]
    for j in range(P.m):
        S.mult[j] = W.pair.mult[j]


@inlined_kernel
def _knows_slope(P, W, j, all_known):
    """Whether the slope of surface j where a step starts is known: of a gap it does not change with what is solved."""
    return all_known or (j < P.m and P.kind[j] == CONTACT and P.nested[j] == 0)


@inlined_kernel
def _fit_one(row, fit, q, value):
    """Adds what is known at node q to a polynomial, whose first coefficient is the value at the start."""
    if q == 0:
        row[0] = value
        return
    change = value - row[0]
    for c in range(1, DEGREE + 1):
        row[c] += fit[c, q] * change


@kernel
def _polynomials(P, S, W, h):
    """Overwrites step.rows: states, multipliers, surfaces along the step made, in powers of t; S back at its start."""
    pair = W.pair
    n, m, k, rows, t = P.n, P.m, pair.k, W.step.rows, S.t
    surfaces = m + P.ne
    for i in range(n):
        pair.end[i] = S.x[i]
    found = True
    for s in range(3):
        stage = STAGES + 1 + s
        stage_point(pair.x, k, stage, n, h, S.x)
        found = found and _rate(P, S, W, t + TIMES[stage] * h, k, stage)
    for i in range(n):
        for c in range(rows.shape[1]):
            rows[i, c] = 0.0
        interpolant(k, i, h, pair.end[i] - pair.x[i], rows[i])
        rows[i, 0] += pair.x[i]
    for r in range(m + surfaces):
        for c in range(rows.shape[1]):
            rows[n + r, c] = 0.0
    _restore(P, S, W)
    for i in range(n):
        W.dx[i] = k[0, i]
    call_linear(P.linear, t, S.x, S.mult, P.p, W.G, W.dh)
    # While multipliers are solved for, surfaces in which they stand change with them.
    with_slope = pair.solves == 0
    for j in range(surfaces):
        with_slope = with_slope and abs(surface_speed(P, W, j)) < math.inf
    for j in range(surfaces):
        for c in range(DEGREE + 1 if _knows_slope(P, W, j, with_slope) else 0):
            rows[n + m + j, c] = _FIT_WITH_SLOPE[c, 1] * h * surface_speed(P, W, j)
    for q in range(DEGREE + 1):
        theta = _NODES[q]
        for i in range(n):
            value = rows[i, DEGREE]
            for c in range(DEGREE - 1, -1, -1):
                value = value * theta + rows[i, c]
            S.x[i] = value
        found = found and _rate(P, S, W, t + theta * h, k, 0) if pair.solves else found
        if not pair.solves:
            call_fields(P.fields, t + theta * h, S.x, S.mult, P.p, W.dx, W.h, W.g)
        # Of the changes since the start: a fit of the values would make thousands of roundings of what hardly changes.
        for j in range(m):
            _fit_one(rows[n + j], _FIT, q, S.mult[j])
        for j in range(surfaces):
            if not _knows_slope(P, W, j, with_slope):
                _fit_one(rows[n + m + j], _FIT, q, W.h[j])
            elif q != 1:
                _fit_one(rows[n + m + j], _FIT_WITH_SLOPE, q, W.h[j])
    _restore(P, S, W)
    scale = 1.0
    for c in range(1, DEGREE + 1):
        scale /= h
        for r in range(n + m + surfaces):
            rows[r, c] *= scale
    return found


@kernel
def _misfit(P, C, S, W, h):
    """How far rates, multipliers and surfaces are from their polynomials between two nodes, in units of the tolerance.

    The error estimate of a step passes through 0 now and then, where its defect does not. In a stick the states may be
    constant, and their error says nothing of how fast lambda goes to its bound.
    """
    n, m, rows, s = P.n, P.m, W.step.rows, _BETWEEN * h
    for i in range(n):
        S.x[i] = _value(rows[i], s)
    worst = 0.0 if _rate(P, S, W, S.t + s, W.pair.k, 0) else math.inf
    for i in range(n):
        slope = 0.0
        for c in range(DEGREE, 0, -1):
            slope = slope * s + c * rows[i, c]
        scale = W.step.atol[i] + C.rtol * max(abs(rows[i, 0]), abs(S.x[i]))
        worst = max(worst, abs(h * (slope - W.dx[i])) / (_DEFECT * scale))
    call_linear(P.linear, S.t + s, S.x, S.mult, P.p, W.G, W.dh)
    for r in range(n, n + m + m + P.ne):
        i = r - n if r < n + m else r - n - m
        # A multiplier counts while it is solved for, a surface while it is not kept at 0.
        if i < m and (S.status[i] == SOLVED) != (r < n + m):
            continue
        now = S.mult[i] if r < n + m else W.h[i]
        size = 1.0 if r < n + m else max(abs(rows[r, 0]), abs(h * rows[r, 1]))
        rounding = 1e-14 if r < n + m else max(1e-14, 1e-15 * surface_size(P, S, i, W))
        worst = max(worst, abs(now - _value(rows[r], s)) / (10.0 * C.rtol * (size + abs(now)) + rounding))
    _restore(P, S, W)
    return worst


@kernel
def _value(row, s):
    """A polynomial of the step at s."""
    value = row[DEGREE]
    for c in range(DEGREE - 1, -1, -1):
        value = value * s + row[c]
    return value


@kernel
def _linear_terms(P, S, W):
    """Overwrites rows with value and slope only, where no step can be made: a surface may be met within rounding."""
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    W.step.rows[:, :] = 0.0
    for i in range(P.n):
        W.step.rows[i, 0] = S.x[i]
        W.step.rows[i, 1] = W.dx[i]
    for j in range(P.m):
        W.step.rows[P.n + j, 0] = S.mult[j]
    for i in range(P.m + P.ne):
        W.step.rows[P.n + P.m + i, 0] = W.h[i]
        W.step.rows[P.n + P.m + i, 1] = surface_speed(P, W, i)


@kernel
def _slope_after(P, C, S, W, i, h):
    """dh_i/dt where a step of size h ends; nan if there is none."""
    _restore(P, S, W)
    if not _try_step(P, C, S, W, h) < math.inf:
        return math.nan
    call_linear(P.linear, S.t + h, S.x, S.mult, P.p, W.G, W.dh)
    return surface_speed(P, W, i)


@kernel
def _end_of_minute_arc(P, C, S, W, i, h):
    """Where surface i, left at the start of a step of size h, is met again; 0 if not by a minute arc.

    An arc whose height is in the last digits of h_i is a parabola, and its slopes, which no digits cancel from, are
    opposite at its ends.
    """
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    first, size = surface_speed(P, W, i), surface_size(P, S, i, W)
    if not 0.25 * abs(first) * h < _MINUTE * size:
        return 0.0
    for _ in range(4):
        last = _slope_after(P, C, S, W, i, h)
        longer = 2.0 * first / (first - last)
        if not 0.0 < longer < 10.0:
            return 0.0
        h *= longer
        if abs(longer - 1.0) < 1e-9:
            break
    return h


@kernel
def _stop_before(P, C, S, W, i, h):
    """A step of h/2, h/4, ... that ends before surface i, which is looked for again from there; returns less its size,
    or 0 if there is none."""
    side = float(S.status[i] if i < P.m else S.side[i - P.m])
    for _ in range(_MOST_HALVES):
        h *= 0.5
        _restore(P, S, W)
        if _try_step(P, C, S, W, h) < math.inf and side * W.h[i] > 0.0:
            _polynomials(P, S, W, h)
            W.pair.next_step = h
            return -h
    return 0.0


@unit(types.float64, Problem, Control, State, Work, types.float64, types.int64)
def step(P, C, S, W, h, refine):
    """A step of at most h, or one to the zero of a surface near h: the contract of this folder."""
    pair = W.pair
    n, m = P.n, P.m
    pair.solves = 0
    for i in range(n):
        pair.x[i] = S.x[i]
    for j in range(m):
        pair.mult[j] = S.mult[j]
        if S.status[j] == SOLVED:
            pair.solves = 1
    _rate(P, S, W, S.t, pair.k, 0)
    if refine < 0:
        # At a power that vanishes, t^2.5 say, the error falls like a small power of h, from far above the tolerance.
        power, least = (-0.125, 0.2) if P.pair else (-1.0 / 3.0, 0.01)
        if not P.pair:
            h = min(h, pair.longest)
        for _ in range(60):
            _restore(P, S, W)
            error = _try_step(P, C, S, W, h)
            if not error < math.inf:
                h *= 0.25
            elif error <= 1.0:
                # The next step's size, kept in S by the caller.
                pair.next_step = h * min(10.0, 0.9 * max(error, 1e-12) ** power)
                pair.longest = pair.next_step
                misfit = math.inf
                if _polynomials(P, S, W, h):
                    misfit = _misfit(P, C, S, W, h) if P.pair else 0.0
                if misfit <= 1.0:
                    if P.pair:
                        pair.next_step = min(pair.next_step, h * 0.9 * max(misfit, 1e-12) ** -0.125)
                    return h
                _restore(P, S, W)
                _rate(P, S, W, S.t, pair.k, 0)
                h *= max(0.25, 0.9 * misfit**-0.125)
            else:
                h *= max(least, 0.9 * error**power)
            if h <= 1e-15 * abs(S.t) + 1e-300:
                break
        _restore(P, S, W)
        _rate(P, S, W, S.t, pair.k, 0)
        _linear_terms(P, S, W)
        return 0.0
    arc = 0.0
    if refine < m and P.kind[refine] == CONTACT and S.status[refine] != SOLVED and S.deflate[refine] != 0:
        arc = _end_of_minute_arc(P, C, S, W, refine, h)
        h = arc if arc > 0.0 else h
    value, change, bound = 0.0, 0.0, refine < m and S.status[refine] == SOLVED
    for _ in range(8 if arc == 0.0 else 0):
        _restore(P, S, W)
        if not _try_step(P, C, S, W, h) < math.inf:
            return math.nan
        if bound:
            row = W.step.rows[n + refine]
            value = S.mult[refine] - (float(W.meeting.exit_side[refine]) if P.kind[refine] < CONTACT else 0.0)
        else:
            row = W.step.rows[n + m + refine]
            value = W.h[refine]
        slope = 0.0
        for c in range(DEGREE, 0, -1):
            slope = slope * h + c * row[c]
        change = value / slope if slope != 0.0 else 0.0
        if not abs(change) < 0.1 * h:
            break
        h -= change
        if abs(change) <= 1e-15 * (abs(S.t) + h):
            break
    if not (bound or abs(change) < _CONVERGED * h) and h > REACH * time_size(S):
        call_linear(P.linear, S.t + h, S.x, S.mult, P.p, W.G, W.dh)
        # The step itself may not be 0 near there: what the polynomials are off by has made the zero.
        shorter = _stop_before(P, C, S, W, refine, h) if abs(value) > surface_rounding(P, S, refine, W) else 0.0
        if shorter < 0.0:
            return shorter
    _restore(P, S, W)
    _rate(P, S, W, S.t, pair.k, 0)
    if not h > 1e-15 * abs(S.t):
        _linear_terms(P, S, W)  # the surface is met where the step begins: its twin was a rounding earlier
        return 0.0
    _try_step(P, C, S, W, h)
    _polynomials(P, S, W, h)
    return h
