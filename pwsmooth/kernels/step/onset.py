"""A collocation step of a slip in a disc: the first one from rest, where its direction is 0/0, and stiff ones.

At h = 0 the field of slip, with lambda = h/|h|, has no value. Where the force has just left the friction circle the
slip begins as h ~ p t^2/2, and its direction is that of a stiff equation whose rate is infinite at t = 0: it has one
bounded solution, the series of which diverges. Collocation (collocation.py) gives that solution, from a guess that is
near: what would all but hold, and the slip that its residuals make. Where the slip begins with an acceleration it does
as well; and where a slow slip follows a force that hardly exceeds the friction, and explicit steps would be as short
as |h|.
"""

import math

from numba import types

from ..intervals import time_size
from ..machine.compiling import kernel, unit
from ..machine.lanes import lane, load8, splat8, store8, vsqrt
from ..machine.pointers import call_fields, call_newton
from ..state import DISC, SOLVED, START, Control, Problem, State
from ..surface.dependent import gather_leaving, load_of_leaving, pace_of_leaving
from ..surface.sliding import INSIDE, put_in_slip
from ..surface.vector import begins, invert_slopes, push_of_disc, slopes_of_disc
from ..work import Work
from .collocation import NODES, integrate, misfit, polynomials, rates_at_nodes, solve
from .tables import STAGES

_TRIES, _PICARD = 40, 3
_SAME_EXCESS = 0.02  # of the force over the friction: a first guess is good enough when it changes by less
_PROJECTIONS = 50  # of several discs, one after the other
# The excess of the force over the friction, with so much of the square of the angle by which it turns, at the end of a
# first step, at rtol = 1e-12 and at most: as far as the polynomials of one step tell what happens, as the series of the
# direction converge the faster the later they begin.
_STIFF, _STIFFEST, _TURNED = 0.11, 0.25, 2.8
_AHEAD = 1e-3  # of the longest step: where it is looked at how fast lambda passes its bound
_AT_REST = 1e-7  # of the accelerations: a slip that begins with less begins with none
_LEFT = 0.1  # of |h|, that a first guess keeps
_ALL_BUT_FITS = 1e3  # such a misfit is of a step that was only too long


@kernel
def _go_along(P, S, W, t, tau):
    """Puts S where the rates of the start lead in the time tau."""
    for i in range(P.n):
        S.x[i] = W.onset.x[i] + tau * W.onset.first[i]
    S.t = t + tau


@kernel
def _slaved(P, S, W, j):
    """Whether disc j slips in the direction that its force says: slowly, or from rest."""
    if not begins(P, S, j):
        return W.onset.slow[j] != 0
    return W.onset.rests and W.onset.forced[j] != 0


@kernel
def _stand(P, S, W, h):
    """Overwrites onset.lam, the multipliers at the nodes, in slips that the force leads by the direction of the lambda
    that would hold them, by its slopes at the start where it is not solved for; and onset.excess, that of its size over
    1 at the last node."""
    onset, t0, solves = W.onset, S.t, W.onset.solves != 0
    for j in range(P.m):
        store8(onset.lam[j], 0, splat8(S.mult[j]))
        W.mask[j] = 1 if S.status[j] == SOLVED else 0
        if P.disc_of[j] >= 0 and _slaved(P, S, W, P.disc_of[j]):
            W.mask[j], solves = 1, solves or P.hidden[j] != 0
    if solves:
        for q in range(STAGES):
            for i in range(P.n):
                S.x[i] = onset.y[i, q]
            S.t = t0 + NODES[q] * h
            call_newton(P.newton_unit, P, S, W)
            for j in range(P.m):
                onset.lam[j, q] = S.mult[j]
        S.t = t0
    else:
        rates_at_nodes(P, S, W, t0, h, onset.y, onset.change)
    for j in range(P.m):
        if not _slaved(P, S, W, j):
            continue
        d, square = P.dim[j], splat8(0.0)
        for r in range(j + 1, j + 1 + d):
            lam = load8(onset.lam[r], 0)
            for c in range(0 if solves else d):
                lam = lam - load8(onset.residuals[j + 1 + c], 0) * onset.inverse[r, c]
            store8(onset.lam[r], 0, lam)
            square = square + lam * lam
        size = vsqrt(square)
        onset.excess[j] = lane(size, STAGES - 1) - 1.0
        for r in range(j + 1, j + 1 + d):
            store8(onset.lam[r], 0, load8(onset.lam[r], 0) / size)


@kernel
def _go_straight(P, W, h):
    """Overwrites onset.y where the rates of the start lead up to the nodes of a step."""
    for i in range(P.n):
        store8(W.onset.y[i], 0, load8(NODES, 0) * (h * W.onset.first[i]) + W.onset.x[i])


@kernel
def _guess_path(P, S, W, h):
    """Overwrites onset.y with the motion by the lambda that all but holds, to the fourth order in h (Picard) where that
    matters: what it slips is as little as the force is more, and its own direction does not stand out from less."""
    onset, n, excess = W.onset, P.n, math.inf
    _go_straight(P, W, h)
    for _ in range(_PICARD):
        _stand(P, S, W, h)
        before, excess = excess, 0.0
        for j in range(P.m):
            excess += onset.excess[j] if _slaved(P, S, W, j) else 0.0
        rates_at_nodes(P, S, W, S.t, h, onset.y, onset.k)
        for i in range(n):
            integrate(W, h, onset.k[i])
            store8(onset.y[i], 0, load8(onset.sums, 0) + onset.x[i])
        if abs(excess - before) <= _SAME_EXCESS * abs(excess):
            break


@kernel
def _guess_as_one(P, S, W, h):
    """Overwrites onset.y, the states at the nodes, by a body that begins to move with several discs at once."""
    onset, group, t0 = W.onset, W.together, S.t
    for q in range(STAGES):
        _go_along(P, S, W, t0, NODES[q] * h)
        onset.rest[q] = pace_of_leaving(P, S, W)
        for j in range(P.m):
            onset.lam[j, q] = group.move[j]
    integrate(W, h, onset.rest)
    for q in range(STAGES):
        _go_along(P, S, W, t0, NODES[q] * h)
        way = onset.sums[q]
        for j in range(P.m):
            onset.goal[j] = onset.lam[j, q]
        for _ in range(_PROJECTIONS):  # none of these surfaces can be moved without the others
            for j in range(P.m):
                if begins(P, S, j):
                    put_in_slip(P, S, j, way, onset.goal, W)
                elif P.kind[j] == DISC and S.status[j] == SOLVED:
                    put_in_slip(P, S, j, 0.0, onset.goal, W)
        for i in range(P.n):
            onset.y[i, q] = S.x[i]
    S.t = t0


@kernel
def _guess(P, S, W, h):
    """Overwrites onset.y, the states at the nodes: of that motion, with the slip that its residuals make."""
    onset, t0 = W.onset, S.t
    if onset.as_one:
        if onset.rests:
            _guess_as_one(P, S, W, h)
        else:
            _guess_path(P, S, W, h)
        return
    _guess_path(P, S, W, h)
    _stand(P, S, W, h)
    rates_at_nodes(P, S, W, t0, h, onset.y, onset.change)
    # What they slip, or move in the direction of an acceleration, in the place of its rates.
    for j in range(P.m):
        if _slaved(P, S, W, j):
            rate = splat8(0.0)
            for k in range(j + 1, j + 1 + P.dim[j]):
                rate = rate + load8(onset.lam[k], 0) * load8(onset.residuals[k], 0)
            store8(onset.residuals[j], 0, rate)
            integrate(W, h, onset.residuals[j])
            store8(onset.residuals[j], 0, load8(onset.sums, 0))
        elif begins(P, S, j):
            for k in range(j + 1, j + 1 + P.dim[j]):
                integrate(W, h, onset.residuals[k])
                store8(onset.residuals[k], 0, load8(onset.sums, 0))
    for q in range(STAGES):
        for i in range(P.n):
            S.x[i] = onset.y[i, q]
        S.t = t0 + NODES[q] * h
        for j in range(P.m):
            if _slaved(P, S, W, j):
                start = math.sqrt(onset.level[j])
                way = start + onset.residuals[j, q]
                for k in range(j + 1, j + 1 + P.dim[j]):
                    onset.goal[k] = onset.lam[k, q]
                put_in_slip(P, S, j, max(abs(way) if start == 0.0 else way, _LEFT * start), onset.goal, W)
            elif begins(P, S, j):
                for k in range(j + 1, j + 1 + P.dim[j]):
                    onset.goal[k] = onset.residuals[k, q]
                put_in_slip(P, S, j, 1.0, onset.goal, W)
        for i in range(P.n):
            onset.y[i, q] = S.x[i]
    S.t = t0


@kernel
def _guess_by_longer(P, W, h):
    """Overwrites onset.y, the states at the nodes, by the polynomials of a step that was too long."""
    rows = W.step.rows
    for q in range(STAGES):
        for i in range(P.n):
            value = rows[i, STAGES]
            for c in range(STAGES - 1, -1, -1):
                value = value * NODES[q] * h + rows[i, c]
            W.onset.y[i, q] = value


@kernel
def _unlike(P, S, W, t, tau):
    """By how much the force of slips that begin at rest exceeds the friction the time tau ahead, and a multiple of the
    square of the angle by which it turns. S is left anywhere."""
    if W.onset.as_one:
        _go_along(P, S, W, t, tau)
        return load_of_leaving(P, S, W) - 1.0
    S.t, most = t, 0.0
    _go_straight(P, W, tau)
    _stand(P, S, W, tau)
    for j in range(P.m):
        if _slaved(P, S, W, j):
            turned = 0.0
            for k in range(j + 1, j + 1 + P.dim[j]):
                turned += (W.onset.lam[k, STAGES - 1] - W.onset.mult[k]) ** 2
            most = max(most, W.onset.excess[j] + _TURNED * turned)
    return most


@kernel
def _restore(P, S, W):
    for i in range(P.n):
        S.x[i] = W.onset.x[i]
    for j in range(P.m):
        S.mult[j] = W.onset.mult[j]


@unit(types.float64, Problem, Control, State, Work, types.float64)
def onset(P, C, S, W, longest):
    """Overwrites W.step by the first step of a slip, from W.onset.least to `longest`; returns its length, 0 if none."""
    start, n, t = W.onset, P.n, S.t
    start.solves, start.goes_on = 0, 1
    for i in range(n):
        start.x[i], start.still[i] = S.x[i], 0
    for j in range(P.m):
        start.mult[j] = S.mult[j]
        if S.status[j] == SOLVED:
            start.solves = 1
            if P.surface_state[j] >= 0:
                start.still[P.surface_state[j]] = 1
    call_fields(P.fields, t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(P.m + P.ne):
        start.level[i] = W.h[i]
    for i in range(n):
        start.first[i] = W.dx[i]
    # How the slip begins: with an acceleration, or at rest with a force that goes on to grow.
    size, fastest, slope = 1e-300, 0.0, 0.0
    for j in range(P.m):
        if P.kind[j] == DISC and S.status[j] == 1:
            slope, d = slopes_of_disc(P, S, W, j), P.dim[j]
            known = invert_slopes(P, W, j)
            for r in range(d):
                for c in range(d):
                    start.inverse[j + 1 + r, c] = W.disc[r, d + c] if known else 0.0
        if begins(P, S, j):
            start.goes_on, start.mult[j] = 0, 1.0
            start.level[j] = 0.0
            start.forced[j] = 1 if slope > 0.0 else 0
            size, fastest = max(size, slope), max(fastest, push_of_disc(P, S, W, j))
            for k in range(j + 1, j + 1 + P.dim[j]):
                start.level[k] = 0.0
    start.rests = 1 if fastest <= _AT_REST * size else 0
    start.as_one = 1 if not start.goes_on and gather_leaving(P, S, W) else 0
    h = longest
    stiff = min(_STIFFEST, _STIFF * (1e12 * C.rtol) ** (1.0 / 10.0))
    if start.rests and not start.goes_on:
        ahead = _AHEAD * longest
        slope = _unlike(P, S, W, t, ahead) / ahead
        if slope > 0.0:
            h = min(h, stiff / slope)
            bend = (_unlike(P, S, W, t, h) / h - slope) / h
            if bend > 0.0:  # slope h + bend h^2
                h = min(h, 2.0 * stiff / (slope + math.sqrt(slope * slope + 4.0 * bend * stiff)))
        S.t = t
    again = False
    for _ in range(_TRIES):
        _restore(P, S, W)
        if again:
            _guess_by_longer(P, W, h)
        else:
            for j in range(P.m):
                if begins(P, S, j) or start.slow[j]:
                    S.mult[j] = INSIDE
            _guess(P, S, W, h)
        for j in range(P.m):
            S.mult[j] = start.mult[j]
        off = math.inf
        if solve(P, C, S, W, t, h):
            polynomials(P, S, W, h)
            off = misfit(P, C, S, W, h)
        _restore(P, S, W)
        if off <= 1.0:
            W.step.kind, W.step.mult_row = START, n
            return h
        again = off < _ALL_BUT_FITS and not again
        h *= max(0.25, 0.9 * off**-0.125) if off < math.inf else 0.25
        if h <= max(start.least, 1e-14 * time_size(S)):
            break
    # What is left is a body at rest, where lambda = h/|h| has no value.
    for j in range(P.m):
        if begins(P, S, j):
            S.mult[j] = INSIDE
    return 0.0
