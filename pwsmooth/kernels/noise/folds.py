"""Folds of sticks under noise: a root of g is lost within a step, or Newton's method comes to one that repels.

Chain: surface/vector.py -> **this file** -> path.py, which locates them on the Brownian path.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_linear
from ..state import DISC, SLIDING, SOLVED
from ..surface.vector import invert_slopes, own_slopes, slopes_of_disc
from .state import SLOPE


@kernel
def _keeps_direction(A, d):
    """Whether det(-A) > 0: none of its real eigenvalues, all negative where the layer comes back, has passed 0."""
    det = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    if d == 3:
        det *= -A[2, 2]
        det += A[0, 2] * (A[1, 1] * A[2, 0] - A[1, 0] * A[2, 1])
        det += A[1, 2] * (A[0, 0] * A[2, 1] - A[0, 1] * A[2, 0])
    return det > 0.0


@kernel
def attracts(P, S, W, N, j):
    """Whether the root of multiplier j is on the branch to which the layer comes back, up to a fold."""
    if P.kind[j] != DISC:
        return N.out[N.at[SLOPE] + j] < 0.0
    return P.hidden[j + 1] == 0 or (slopes_of_disc(P, S, W, j) > 0.0 and _keeps_direction(W.disc, P.dim[j]))


@kernel
def flattest(P, S, W, fold):
    """The multiplier whose own residual depends least on it, of those that may have folds; `fold` if there is none."""
    least = math.inf
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for j in range(P.m):
        if S.status[j] == SOLVED and P.kind[j] == SLIDING and P.hidden[j]:
            slope = abs(W.G[P.g_diagonal[j]])
            if slope < least:
                fold, least = j, slope
    for j in range(P.m):
        if S.status[j] == SOLVED and P.kind[j] == DISC and P.hidden[j + 1]:
            own_slopes(P, S, W, j)
            steepest, d = math.inf, P.dim[j]  # of the inverse
            if invert_slopes(P, W, j):
                steepest = 0.0
                for r in range(d):
                    for c in range(d, 2 * d):
                        steepest = max(steepest, abs(W.disc[r, c]))
            if 1.0 / steepest < least:
                fold, least = j, 1.0 / steepest
    return fold


@kernel
def aim_beyond(P, S, W, j):
    """Leaves in W.arc.mult the way on for the lambda of disc j past its fold, with g in W: -A^-1 g, along which it
    hardly acts."""
    own_slopes(P, S, W, j)
    known, d = invert_slopes(P, W, j), P.dim[j]
    for r in range(d):
        W.arc.mult[2 + j + r] = 0.0 if known else W.g[j + 1 + r]
        for c in range(d if known else 0):
            W.arc.mult[2 + j + r] -= W.disc[r, d + c] * W.g[j + 1 + c]
