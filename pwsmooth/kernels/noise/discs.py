"""Slips in a disc that the noise leaves alone: so slow beside a step that their direction follows the force.

Explicit steps would be as short as |h|. Over a step of length L such a slip has a constant lambda, the direction that
it has at its end (Moreau's implicit rule; first order in L):

    h(t + L; n) = r n,   |n| = 1

With r < 0 it has come to rest on the way.
Chain: surface/vector.py -> **this file** -> path.py, whose steps these are.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_linear
from ..state import DISC
from ..step.closing import pull_of
from ..surface.sliding import INSIDE, put_in_slip
from ..surface.vector import slopes_of_disc, turn

SWEEPS, ALIKE = 30, 1e-11  # of Newton's method, and the change of n that ends them


@kernel
def slips(P, S, j):
    """Whether j is a disc that slips."""
    return P.kind[j] == DISC and S.status[j] == 1


@kernel
def time_to_turn(P, S, W, N):
    """The least time in which a slip may turn or come to rest; leaves |h| and its largest rates in N."""
    least, known = math.inf, False
    for j in range(P.m):
        if not slips(P, S, j):
            continue
        if not known:
            call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        known = True
        W.meeting.widest[j] = max(W.meeting.widest[j], W.h[j])
        N.size[j], N.speed[j] = math.sqrt(W.h[j]), pull_of(P, W, j) + 1e-300
        for k in range(j + 1, j + 1 + P.dim[j]):
            N.speed[j] = max(N.speed[j], abs(W.g[k]))
        least = min(least, N.size[j] / N.speed[j])
    return least


@kernel
def mark_slow(P, S, W, N, length):
    """Marks the slips that explicit steps of this length do not follow; whether there are any."""
    some = False
    for j in range(P.m):
        N.rests[j] = 0
        N.slow[j] = 1 if slips(P, S, j) and N.resolution * N.size[j] < 0.999 * length * N.speed[j] else 0
        if N.slow[j] == 0:
            continue
        N.pace[j], some = math.nan, True
        if S.mult[j] == 1.0:
            call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
            for k in range(j + 1, j + 1 + P.dim[j]):
                S.mult[k] = W.h[k] / N.size[j]
            S.mult[j] = INSIDE
    return some


@kernel
def turn_slow(P, S, W, N, length):
    """Newton's method for the lambda of slow slips, by a step that has led to S; how far they still were from it."""
    change = 0.0
    for j in range(P.m):
        if N.slow[j] == 0:
            continue
        slopes_of_disc(P, S, W, j)
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        first, along = math.isnan(N.pace[j]), 0.0
        for k in range(j + 1, j + 1 + P.dim[j]):
            W.g[k] = W.h[k] / length
            along += S.mult[k] * W.g[k]
        N.pace[j], turned = turn(P, S, W, j, along if first else N.pace[j])
        change = max(change, turned)
    return change


@kernel
def end_slow(P, S, W, N, length):
    """Leaves S as slow slips end their step: in the direction of their lambda, or at rest."""
    for j in range(P.m):
        if N.slow[j] == 0:
            continue
        if N.pace[j] > 0.0:
            put_in_slip(P, S, j, N.pace[j] * length, S.mult, W)
            S.mult[j] = 1.0
        else:
            N.rests[j] = 1
