"""The last moments of a slip in a disc: along dt = r dtau they have no singularity.

    n' = G - (n.G) n,   (log r)' = n.G,   t' = r,   x' = r f,      h = r n

(Antali and Stepan 2018 for limit directions.) The motion comes to rest, or passes by. The pair 8(5,3) of Dormand and
Prince as in step/methods/rk.py, here in units of the |h| with which it begins.
"""

import math

from scipy.integrate._ivp import dop853_coefficients as dop

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_newton
from .sliding import INSIDE, mask_solved

_A, _B, _E3, _E5 = dop.A.copy(), dop.B.copy(), dop.E3.copy(), dop.E5.copy()
STAGES = 12
_TOLERANCE, _DIRECTION = 1e-9, 1e-6  # of the time, and what is enough of the direction at its end
_CLOSED = -20.0  # of log(r/r1): what is left does not matter
_STRAIGHT, _BENT = (
    1e-6,
    1e-9,
)  # of the angle off the direction in which it ends, and of what that takes from n.G
_STEADY = 0.1  # tolerances of h: what the change of n.G on the rest of the way is worth
_PASSED = 0.5
FARTHEST = 100.0  # of log(r/r1), where a stage of a step too long may be
_STEPS = 1000
_LOG, _TIME, _X = 3, 4, 5  # places behind n


@kernel
def stage_point(y, k, s, i, step):
    """Component i of the point at which stage s is taken; stage 12 is the end of the step."""
    total = 0.0
    for r in range(min(s, STAGES)):
        total += (_A[s, r] if s < STAGES else _B[r]) * k[r, i]
    return y[i] + step * total


@kernel
def misfit(k, i):
    """Component i of the errors of orders 5 and 3, over the length of the step."""
    fifth, third = 0.0, 0.0
    for r in range(STAGES + 1):
        fifth += _E5[r] * k[r, i]
        third += _E3[r] * k[r, i]
    return fifth, third


@kernel
def error_of(fifth, third, step):
    """The error of a step, from the largest of both in units of the tolerance."""
    return abs(step) * fifth * fifth / math.sqrt(fifth * fifth + 0.01 * third * third + 1e-300)


@kernel
def next_step(step, error):
    """By how long a step goes on."""
    return step * min(4.0, max(0.2, 0.9 * (error + 1e-12) ** -0.125)) if error < math.inf else 0.1 * step


@kernel
def _closing_rates(P, S, W, j, size, y, out, stage):
    """Overwrites out[stage] with the rates at y; leaves f in W.dx and S at y; returns n.G."""
    d, along, length = P.dim[j], 0.0, 0.0
    for i in range(d):
        length += y[i] ** 2
    length = math.sqrt(length)
    for i in range(d):
        S.mult[j + 1 + i] = y[i] / length
    for i in range(P.n):
        S.x[i] = W.closing_x[i] + size * y[_X + i]
    S.t = W.closing_t + size * y[_TIME]
    if W.layer.masked:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(d):
        along += S.mult[j + 1 + i] * W.g[j + 1 + i]
    for i in range(d):
        out[stage, i] = W.layer.pace * (W.g[j + 1 + i] - along * S.mult[j + 1 + i])
    pace = W.layer.pace * math.exp(min(y[_LOG], FARTHEST))
    out[stage, _LOG] = W.layer.pace * along
    out[stage, _TIME] = pace
    for i in range(P.n):
        out[stage, _X + i] = pace * W.dx[i]
    return along


@kernel
def _step_error(W, d, n, step):
    """The error of the step just made; that of the direction matters less as less is left."""
    y, k, fifth, third = W.closing_y, W.closing_k, 0.0, 0.0
    direction = min(_DIRECTION, _TOLERANCE * math.exp(-min(y[_LOG], 0.0)))
    for i in range(_X + n):
        if d <= i < _LOG:
            continue
        e5, e3 = misfit(k, i)
        scale = direction if i <= _LOG else _TOLERANCE
        fifth, third = max(fifth, abs(e5) / scale), max(third, abs(e3) / scale)
        if not fifth + third < math.inf:
            return math.inf
    return error_of(fifth, third, step)


@kernel
def _rest_of_line(P, S, W, left):
    """Moves S by a time in which h falls to 0 along a line: the rates change in proportion to it."""
    for i in range(P.n):
        W.closing_new[_X + i] = W.dx[i]
        S.x[i] += left * W.dx[i]
    S.t += left
    if W.layer.masked:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(P.n):
        S.x[i] += 0.5 * left * (W.dx[i] - W.closing_new[_X + i])


@kernel
def pull_of(P, W, j):
    """The largest entry of dG/dlambda of disc j in W.G."""
    pull = 0.0
    for r in range(j + 1, j + 1 + P.dim[j]):
        for e in range(P.g_row[r], P.g_row[r + 1]):
            if P.disc_of[P.g_col[e]] == j:
                pull = max(pull, abs(W.G[e]))
    return pull


@kernel
def close(P, S, W, j, size, tolerance):
    """Moves S from |h| = size of disc j, in the direction in S.mult, to its rest; False, and S anywhere, if it passes.

    The state before it is left in W.closing_t, W.closing_x; W.G is that of its slip, and `tolerance` that of h.
    """
    d, n, y, new, k = P.dim[j], P.n, W.closing_y, W.closing_new, W.closing_k
    mask_solved(P, S, W)
    W.layer.masked = 0
    for i in range(P.m):
        if W.mask[i]:
            W.layer.masked = 1
    S.mult[j] = INSIDE
    for i in range(len(y)):
        y[i] = 0.0
    for i in range(d):
        y[i] = S.mult[j + 1 + i]
    W.closing_t = S.t
    for i in range(n):
        W.closing_x[i] = S.x[i]
    W.layer.pace = 1.0
    _closing_rates(P, S, W, j, size, y, k, 0)
    fastest = 1e-300
    for i in range(d):
        fastest = max(fastest, abs(W.g[j + 1 + i]))
    pull = max(fastest, pull_of(P, W, j))
    W.layer.pace = 1.0 / fastest
    along = _closing_rates(P, S, W, j, size, y, k, 0)
    step = 0.2 / (W.layer.pace * pull)
    for _ in range(_STEPS):
        before = along
        for s in range(1, STAGES + 1):
            for i in range(_X + n):
                new[i] = stage_point(y, k, s, i, step)
            along = _closing_rates(P, S, W, j, size, new, k, s)
        error = _step_error(W, d, n, step)
        if not error <= 1.0:
            along = before
            step = next_step(step, error)
            continue
        turns = 0.0
        for i in range(_X + n):
            y[i], k[0, i] = new[i], k[STAGES, i]
        for i in range(d):
            turns = max(turns, abs(k[0, i]))
        if y[_LOG] > _PASSED:
            return False
        # Along a direction that it no longer leaves, and at a rate that it keeps, the rest is a line.
        angle, change = turns / (W.layer.pace * pull), abs(along - before) / (step * abs(k[0, _LOG]))
        straight = angle <= _STRAIGHT and angle * angle * pull <= _BENT * abs(along)
        straight = straight and change * size * math.exp(y[_LOG]) <= _STEADY * tolerance * abs(along)
        if along < 0.0 and (straight or y[_LOG] < _CLOSED):
            _rest_of_line(P, S, W, size * math.exp(y[_LOG]) / -along)
            return True
        step = next_step(step, error)
    return False
