"""A look at the end of a step: whether its series tell what the model's functions do there."""

import math

from ..machine.compiling import kernel
from ..machine.lanes import load8
from ..machine.pointers import at, call_fields, sum8
from ..state import CONTACT, SOLVED
from ..surface.sliding import INSIDE
from .meeting import find_first
from .steps import SURFACE_ROUNDING, dot, powers, surface_rows

# Of a step whose end is not what its series says. What is off by rounding falls with the step, what a series does not
# tell far faster.
_MOST_SHORTENINGS, _MOST_IN_VAIN, _AS_FAST = 200, 6, 0.3


@kernel
def _misfit(P, C, S, t, s, W):
    """How far rates and surfaces at s are from the step's polynomials there, in units of what is allowed.

    exp(-(v/v_s)^2) and erf are so flat far from v = 0 that no 20 coefficients tell what they do there, and the last
    ones of a series in t^4 or t^12 may all vanish: only a look at the end of the step tells. 100: K terms of the
    tolerance's size in a derivative, and what a stiff field makes of it. W.step.power is of s.
    """
    n, m, K, x, mult, power = P.n, P.m, C.order, W.step.x, W.step.mult, W.step.power
    rows, mult_row, all_rows = W.step.rows, W.step.mult_row, surface_rows(P, W.step.kind)
    for i in range(n):
        x[i] = dot(rows[i], power, K + 1)
    for j in range(m):
        mult[j] = dot(rows[mult_row + j], power, K + 1) if S.status[j] == SOLVED else S.mult[j]
        if S.status[j] == SOLVED and abs(mult[j]) == 1.0 and P.kind[j] < CONTACT:
            mult[j] *= INSIDE  # at its bound, but held up to there
    call_fields(P.fields, t + s, x, mult, P.p, W.dx, W.h, W.g)
    for j in range(m):
        if S.status[j] == SOLVED and P.surface_state[j] >= 0:
            W.dx[P.surface_state[j]] = 0.0  # exactly, by construction
    worst = 0.0
    for i in range(n):
        rise = load8(rows[i], 0) * load8(power, 0) * load8(W.roots.counting, 0)
        for k in range(8, K + 1, 8):
            rise = rise + load8(rows[i], k) * load8(power, k) * load8(W.roots.counting, k)
        size = max(max(abs(at(rows[i], 0)), abs(x[i])), s * abs(at(rows[i], 1)))
        worst = max(worst, abs(s * W.dx[i] - sum8(rise)) / (C.atol[i] + C.rtol * size))
    for i in range(m + P.ne):
        if all_rows[i] >= n and (i >= m or abs(S.status[i]) == 1):
            row = rows[all_rows[i]]
            size = max(abs(at(row, 0)), max(s * abs(at(row, 1)), s * s * abs(at(row, 2))))
            tolerance = C.rtol * (size + 1e-3 * W.meeting.widest[i]) + SURFACE_ROUNDING
            worst = max(worst, abs(W.h[i] - dot(row, power, K + 1)) / tolerance)
    return 0.01 * worst


@kernel
def shorten_to_fit(P, C, S, W, best):
    """Shortens a step until its end is what its series says; returns it, and where something is met first in it."""
    step, power = W.step, W.step.power
    h, last, in_vain = step.length, math.inf, 0
    longest = h
    for _ in range(_MOST_SHORTENINGS):
        end = min(best, 1.0) * h
        powers(power, end)
        off = _misfit(P, C, S, step.start, end, W)
        if off <= _AS_FAST * last:
            longest, in_vain = h, 0
        else:
            in_vain += 1
        if off <= 1.0 or in_vain == _MOST_IN_VAIN:
            break
        # At first by what a series asks for whose terms beyond the last are about as large, then by halves.
        share = max(0.5, 0.9 * off ** (-1.0 / C.order)) if last == math.inf else 0.5
        last, h = off, share * end
        powers(power, h)
        step.length = h
        best = find_first(P, C, S, W)
    powers(power, longest)
    if longest != h:
        step.length = longest
        best = find_first(P, C, S, W)
    return longest, best
