"""The last moments of a slip in a disc: along dt = r dtau they have no singularity.

    n' = G - (n.G) n,   (log r)' = n.G,   t' = r,   x' = r f,      h = r n

(Antali and Stepan 2018 for limit directions.) The motion comes to rest, or passes by. By the pair 8(5,3), in units of
the |h| with which it begins.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_newton
from ..state import DISC
from ..surface.pair import DEGREE, STAGES, errors, interpolant, stage_point
from ..surface.sliding import INSIDE, mask_solved
from ..surface.vector import invert_slopes, push_of_disc, pushes_back, slopes_of_disc
from .recording import keep_dense, sample

_LEAST, _MOST = 1e-8, 1e-6  # tolerance of the time
_DIRECTION = 1e-6  # what is enough of a direction at its end that decides
_STRAIGHT = 1e-5  # of the angle off the direction in which it ends
_SLOWEST = 1e-3  # of the friction: the least deceleration that counts
_NEARER = 1e-2  # of what is next to h = 0 within rounding: so far what does not pass by is followed
_FADES = 0.25  # of n.G, while r falls by e: with more, as where h is only touched, n.G comes to 0 before r does
_BENT = 1e-9  # of n.G, what that takes from it
_ROUNDING = 1e-15  # of the friction: what roundings make of n.G, in which forces cancel
STEADY = 0.1  # tolerances of h: what the change of n.G on the rest of the way is worth
_PASSED = 0.5
_FIRST = 2.0  # over dG/dlambda: a first step, after which most are straight enough
_GONE = 1e-8  # of |h|^2 of another disc: what is left of it at most where it comes to rest with this one
FARTHEST = 100.0  # of log(r/r1), where a stage of a step too long may be
MOST, MOST_KEPT = 1000, 200  # steps, and where states on the way may be asked for
_LOG, _TIME, _X = 3, 4, 5  # places behind n


@kernel
def error_of(fifth, third, step):
    """The error of a step, from the largest of both in units of the tolerance."""
    return abs(step) * fifth * fifth / math.sqrt(fifth * fifth + 0.01 * third * third + 1e-300)


@kernel
def next_step(step, error):
    """By how long a step goes on."""
    return step * min(4.0, max(0.2, 0.9 * (error + 1e-12) ** -0.125)) if error < math.inf else 0.1 * step


@kernel
def _stand(P, S, W, size, y):
    """Puts S at the time and the states of y."""
    for i in range(P.n):
        S.x[i] = W.closing_x[i] + size * y[_X + i]
    S.t = W.closing_t + size * y[_TIME]


@kernel
def _closing_rates(P, S, W, j, size, y, out, stage):
    """Overwrites out[stage] with the rates at y; leaves f in W.dx and S at y; returns n.G."""
    d, along, length = P.dim[j], 0.0, 0.0
    for i in range(d):
        length += y[i] ** 2
    length = math.sqrt(length)
    for i in range(d):
        S.mult[j + 1 + i] = y[i] / length
    _stand(P, S, W, size, y)
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
def _step_error(W, d, n, step, tolerance, enough):
    """The error of the step just made; that of the direction matters less as less is left, until it is `enough`."""
    y, k, fifth, third = W.closing_y, W.closing_k, 0.0, 0.0
    direction = min(enough, tolerance * math.exp(-min(y[_LOG], 0.0)))
    for i in range(_X + n):
        if d <= i < _LOG:
            continue
        e5, e3 = errors(k, i)
        scale = direction if i <= _LOG else tolerance
        fifth, third = max(fifth, abs(e5) / scale), max(third, abs(e3) / scale)
        if not fifth + third < math.inf:
            return math.inf
    return error_of(fifth, third, step)


@kernel
def _keeps_dense(P, R):
    """Whether dense output is asked for; polynomials that are kept for a tape alone are not of these moments."""
    return len(R.dense_s) > 0 and R.dense.shape[1] > P.n + P.m


@kernel
def wants(P, S, R, t):
    """Whether the states on the way to a time are asked for."""
    return _keeps_dense(P, R) or (S.samples < R.t_eval.shape[0] and R.t_eval[S.samples] <= t)


@kernel
def _leave(P, C, S, R, W, j, t_new):
    """Keeps what is asked for of the polynomials in W.step, up to a time."""
    keep, W.step.mult_row, W.end.length = S.mult[j], P.n, W.step.length
    S.mult[j] = 1.0  # lambda is h/|h| of the states
    if _keeps_dense(P, R):
        keep_dense(P, C, S, R, W)
    sample(P, C, S, R, t_new, W)
    S.mult[j] = keep


@kernel
def _clear(P, S, W):
    """Rows of zeros, but for the multipliers, which change evenly from those in W.step.mult to the present ones."""
    rows, n, m = W.step.rows, P.n, P.m
    for r in range(n + m + 1):
        for c in range(rows.shape[1]):
            rows[r, c] = 0.0
    for i in range(m):
        rows[n + i, 0] = W.step.mult[i]
        rows[n + i, 1] = (S.mult[i] - W.step.mult[i]) / W.step.length


@kernel
def _leave_step(P, C, S, R, W, j, size, step):
    """Keeps what is asked for of the step from closing_y to closing_new, of which the interpolant's stages are missing;
    its polynomials are those of (t, x) in its share, as along an arc."""
    n, m, y, new, k, look, rows = P.n, P.m, W.closing_y, W.closing_new, W.closing_k, W.closing_look, W.step.rows
    W.step.length, W.step.time_row = 1.0, n + m
    _clear(P, S, W)
    for i in range(m):
        W.closing_end[i] = S.mult[i]
    for s in range(STAGES + 1, 16):
        stage_point(y, k, s, _X + n, step, look)
        _closing_rates(P, S, W, j, size, look, k, s)
    for i in range(n + 1):
        at, row = _X + i if i < n else _TIME, rows[i if i < n else n + m]
        interpolant(k, at, step, new[at] - y[at], row)
        for c in range(DEGREE + 1):
            row[c] *= size
        row[0] += size * y[at] + (W.closing_x[i] if i < n else W.closing_t)
    # Back at the end, to the last bit.
    for i in range(m):
        S.mult[i] = W.closing_end[i]
    _stand(P, S, W, size, new)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    _leave(P, C, S, R, W, j, S.t)
    W.step.time_row = -1


@kernel
def _aim_at_rest(P, S, W, j, left):
    """Overwrites lambda of disc j by its mean over the time left, in which all of h falls to 0; W.dx, W.g follow."""
    d = P.dim[j]
    if slopes_of_disc(P, S, W, j) > 0.0 and invert_slopes(P, W, j):
        for r in range(d):
            for c in range(d):
                S.mult[j + 1 + r] -= W.disc[r, d + c] * (W.g[j + 1 + c] + W.h[j + 1 + c] / left)
        push_of_disc(P, S, W, j)


@kernel
def _rest_of_line(P, C, S, R, W, j, left, leaves):
    """Moves S by a time in which h falls to 0 along a line: the rates change in proportion to it."""
    first, start, before = W.closing_new, W.closing_look, W.closing_end
    for i in range(P.m):
        W.step.mult[i], before[i] = S.mult[i], W.h[i]
    for i in range(P.n):
        first[i], start[i] = W.dx[i], S.x[i]
        S.x[i] += left * W.dx[i]
    t, S.t = S.t, S.t + left
    # Discs that come to rest with it keep their direction: at the end h/|h| is a quotient of roundings.
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for k in range(P.m):
        if P.kind[k] == DISC and S.status[k] == 1 and k != j and W.h[k] <= _GONE * before[k]:
            S.mult[k] = INSIDE
            for i in range(k + 1, k + 1 + P.dim[k]):
                S.mult[i] = before[i] / math.sqrt(before[k])
    if W.layer.masked:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for k in range(P.m):
        if P.kind[k] == DISC and S.status[k] == 1 and k != j:
            S.mult[k] = 1.0
    W.step.length = left
    if leaves:
        _clear(P, S, W)
    for i in range(P.n):
        bend = 0.5 * (W.dx[i] - first[i]) / left
        S.x[i] += left * left * bend
        if leaves:
            W.step.rows[i, 0], W.step.rows[i, 1], W.step.rows[i, 2] = start[i], first[i], bend
    if leaves:
        end, S.t = S.t, t
        _leave(P, C, S, R, W, j, end)
        S.t = end


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
def direction_decides(P, S, W, j):
    """Whether several sticks or slips may go on from h = 0 of disc j, and the direction in which it comes decides."""
    return P.hidden[j + 1] != 0 or slopes_of_disc(P, S, W, j) == 0.0 or not pushes_back(P, W, j)


@kernel
def close(P, C, S, R, W, j, size, tolerance, latest, most, leaves):
    """Moves S from |h| = size of disc j, in the direction in S.mult, to its rest; False, and S anywhere, if it passes,
    or is there later than at the `latest` or not in so many steps.

    The state before it is left in W.closing_t, W.closing_x; W.G is that of its slip, and `tolerance` that of h. If it
    `leaves` them, states on the way are kept where they are asked for; W.step is overwritten.
    """
    d, n, y, new, k = P.dim[j], P.n, W.closing_y, W.closing_new, W.closing_k
    decides = direction_decides(P, S, W, j)
    enough, relative = _DIRECTION if decides else 1.0, min(max(_LEAST, STEADY * tolerance / size), _MOST)
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
    along, turns = _closing_rates(P, S, W, j, size, y, k, 0), 0.0
    for i in range(d):
        turns = max(turns, abs(k[0, i]))
    step = _FIRST / (W.layer.pace * pull)
    for i in range(P.m):
        W.step.mult[i] = S.mult[i]
    for _ in range(most):
        before = along
        for s in range(1, STAGES + 1):
            stage_point(y, k, s, _X + n, step, new)
            along = _closing_rates(P, S, W, j, size, new, k, s)
        # The slower it comes to rest the more an error changes when it does.
        slow = min(max(abs(along) / fastest, _SLOWEST), 1.0)
        error = _step_error(W, d, n, step, relative * slow, enough)
        if not error <= 1.0:
            along = before
            step = next_step(step, error)
            continue
        if new[_LOG] > _PASSED:
            return False
        if leaves:
            _leave_step(P, C, S, R, W, j, size, step)
        turned, turns = turns, 0.0
        for i in range(_X + n):
            y[i], k[0, i] = new[i], k[STAGES, i]
        for i in range(d):
            turns = max(turns, abs(k[0, i]))
        for i in range(P.m):
            W.step.mult[i] = S.mult[i]
        # Along a direction that it no longer leaves, and at a rate that it keeps, the rest is a line. Where it turns
        # less and less, h comes to 0 across it as well; where it turns away, what is across is by how much it misses.
        aims = not decides and turns < turned
        angle = turns / (W.layer.pace * pull)
        change = (abs(along - before) + _ROUNDING * pull) / (step * abs(k[0, _LOG]))
        left, worth = size * math.exp(y[_LOG]), STEADY * tolerance * abs(along)
        if decides:
            straight = angle <= _STRAIGHT and angle * angle * pull <= _BENT * abs(along)
        else:
            straight = angle * (angle if aims else 1.0) * left * pull <= worth
        straight = straight and change * left <= worth and change <= _FADES * abs(along)
        near = left <= W.meeting.blurred[j] * (_NEARER if along < 0.0 else 1.0)
        if along < 0.0 and (straight or (near and change <= abs(along))):
            for i in range(d):
                y[i] = S.mult[j + 1 + i]
            if aims:
                _aim_at_rest(P, S, W, j, left / -along)
            _rest_of_line(P, C, S, R, W, j, left / -along, leaves)
            for i in range(d):
                S.mult[j + 1 + i] = y[i]
            return S.t < latest
        if near:
            return S.t < latest
        step = next_step(step, error)
    return False
