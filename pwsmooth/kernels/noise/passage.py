"""First passages: where within a step a path meets the surface of an event on which the noise acts.

Between the ends of a step, where the surface is at h0 > 0 and h1, the path is a Brownian bridge of variance v a time,
whatever its drift. Over a step of length T

    it meets h = 0, for h1 > 0, with probability exp(-2 h0 h1 / (v T))
    and does so for the first time at s:  s/(T - s) is inverse Gaussian with mean h0/|h1| and shape h0^2/(v T)

(I. Karatzas, S. E. Shreve, Brownian Motion and Stochastic Calculus, 1991, section 4.3; A. Beskos, G. O. Roberts,
Annals of Applied Probability 15 (2005) 2422-2444). There the state is the mean of the bridge, given that h = 0.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_linear
from ..step.roots import NO_ROOT
from ..surface.sliding import surface_rounding
from .random import normal_pair, philox, unit_interval
from .state import BRIDGE, SPREAD
from .tree import length_here

_LIKELY = 12.0  # of the exponent: a longer step is halved where its path may have passed by more than 6e-6
_CORRECTIONS = 10  # of the state, at most: Newton's on a curved surface


@kernel
def _numbers(N, i):
    """Four random words of the present part of the path, for surface i."""
    return philox(N.seed, N.trajectory, N.interval, (1 << N.depth) + N.position, i, BRIDGE)


@kernel
def has_passed(W, N, i):
    """Whether a step that ends on the side of surface i where it began has met it in between; of one that can be
    halved, whether it may have."""
    square = N.out_start[N.at[SPREAD] + i] * length_here(N)
    if not (square > 0.0 and N.surface[i] * W.h[i] > 0.0):
        return False
    exponent = 2.0 * N.surface[i] * W.h[i] / square
    if N.depth < N.level + N.finest:
        return exponent < _LIKELY
    word, _, _, _ = _numbers(N, i)
    return unit_interval(word) < math.exp(-exponent)


@kernel
def _share(W, N, i):
    """The part of the step after which its path meets surface i for the first time."""
    square = N.out_start[N.at[SPREAD] + i] * length_here(N)
    before, after = abs(N.surface[i]), abs(W.h[i])
    if not (square > 0.0 and after > 0.0):
        return 1.0
    _, first, second, third = _numbers(N, i)
    z, _ = normal_pair(first, second)
    # Michael, Schucany and Haas, The American Statistician 30 (1976) 88-90, without cancellation.
    mean, bend = before / after, z * z * square / (2.0 * before * after)
    low = mean / (1.0 + bend + math.sqrt(bend * (2.0 + bend)))
    ratio = low if unit_interval(third) * (mean + low) <= mean else mean * (mean / low)
    return ratio / (1.0 + ratio)


@kernel
def _move_onto(P, S, W, N, i):
    """Moves the state along what the noise does to surface i until it is on it, to rounding."""
    for _ in range(_CORRECTIONS):
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        if abs(W.h[i]) <= surface_rounding(P, S, i, W):
            return
        N.across[:] = 0.0
        for e in range(P.dh_row[i], P.dh_row[i + 1]):
            for k in range(N.G_row[P.dh_col[e]], N.G_row[P.dh_col[e] + 1]):
                N.across[N.G_source[k]] += W.dh[e] * N.out_start[N.G_place[k]]
        square = 0.0
        for s in range(N.q):
            square += N.across[s] ** 2
        if not square > 0.0:
            return
        for j in range(P.n):
            for k in range(N.G_row[j], N.G_row[j + 1]):
                S.x[j] -= W.h[i] / square * N.out_start[N.G_place[k]] * N.across[N.G_source[k]]


@kernel
def go_to_first_passage(P, S, W, N, t):
    """Moves S from the end of the step that began at t back to where the path first meets one of the marked surfaces.

    N.rest is what the step does from there on. False, and S as it was, where more is marked than events that the noise
    acts on, or where the step began beyond one of them.
    """
    m, meeting, found, least = P.m, W.meeting, -1, 2.0
    for i in range(m + P.ne):
        if meeting.tau[i] < NO_ROOT:
            if i < m or not N.noisy[i] or P.watch[i - m] != 0 or not N.surface[i] * S.side[i - m] > 0.0:
                return False
            share = _share(W, N, i)
            if share < least:
                found, least = i, share
    if found < 0 or W.instant.fold >= 0:
        return False
    for i in range(m, m + P.ne):
        if i != found:
            meeting.tau[i] = NO_ROOT
    for j in range(P.n):
        N.rest[j] = S.x[j]
        S.x[j] = N.x[j] + least * (S.x[j] - N.x[j])
    S.t = t + least * (S.t - t)
    _move_onto(P, S, W, N, found)
    for j in range(P.n):
        N.rest[j] -= S.x[j]
    return True
