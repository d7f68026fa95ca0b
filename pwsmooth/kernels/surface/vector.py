"""G of a disc, the rates of its surfaces, as a function of its lambda alone: whatever else is solved follows."""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_linear, call_newton
from ..state import DISC, SOLVED
from .sliding import mask_solved
from .sparse import entry, solve_dense

_DELTA = 1e-4  # of lambda
_NOTHING = 1e-10  # a slope by differences that is rounding, beside G


@kernel
def begins(P, S, j):
    """Whether j is a disc that is about to slip from rest."""
    return P.kind[j] == DISC and S.status[j] == 1 and S.deflate[j] != 0


@kernel
def push_of_disc(P, S, W, j):
    """The largest component of G of disc j, left in W.g, at the lambda of its components' multipliers."""
    mask_solved(P, S, W)
    W.mask[j], some = 0, False
    for k in range(P.m):
        if P.disc_of[k] == j:
            W.mask[k] = 0
        some = some or W.mask[k] != 0
    if some:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    largest = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        largest = max(largest, abs(W.g[k]))
    return largest


@kernel
def _follows(P, S, j):
    """Whether anything but disc j is solved at every instant: a mass matrix, a closed contact, another stick."""
    for k in range(P.m):
        if S.status[k] == SOLVED and P.dim[k] == 0 and P.disc_of[k] != j:
            return True
    return False


@kernel
def own_slopes(P, S, W, j):
    """As slopes_of_disc, with what is solved for beside disc j as it is."""
    d, A, largest = P.dim[j], W.disc, 0.0
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for r in range(d):
        for c in range(d):
            A[r, c] = entry(P.g_row, P.g_col, W.G, j + 1 + r, j + 1 + c)
            largest = max(largest, abs(A[r, c]))
    return largest


@kernel
def slopes_of_disc(P, S, W, j):
    """Overwrites W.disc[:d, :d] by dG/dlambda of disc j; returns its largest entry, 0 where lambda does not act.

    That is so under a contact that is open, and where only |h| stands in the field.
    """
    d, A, largest = P.dim[j], W.disc, 0.0
    if not _follows(P, S, j):
        return own_slopes(P, S, W, j)
    size = 1.0 + push_of_disc(P, S, W, j)
    for c in range(d):
        keep = S.mult[j + 1 + c]
        S.mult[j + 1 + c] = keep + _DELTA
        push_of_disc(P, S, W, j)
        for r in range(d):
            A[r, c] = W.g[j + 1 + r]
        S.mult[j + 1 + c] = keep - _DELTA
        push_of_disc(P, S, W, j)
        for r in range(d):
            A[r, c] = (A[r, c] - W.g[j + 1 + r]) / (2.0 * _DELTA)
            largest = max(largest, abs(A[r, c]))
        S.mult[j + 1 + c] = keep
    push_of_disc(P, S, W, j)
    return largest if largest > _NOTHING * size else 0.0


@kernel
def invert_slopes(P, W, j):
    """Overwrites W.disc[:d, d:2 d] by the inverse of the slopes in W.disc[:d, :d], and these too; False if singular."""
    d, A = P.dim[j], W.disc
    for r in range(d):
        for c in range(d):
            A[r, d + c] = 1.0 if r == c else 0.0
    return solve_dense(A, d, d)


@kernel
def pushes_back(P, W, j):
    """Whether the slopes in W.disc are negative in every direction; overwrites them."""
    d, A = P.dim[j], W.disc
    for r in range(d):
        for c in range(r):
            A[r, c] = A[c, r] = 0.5 * (A[r, c] + A[c, r])
    # The pivots of Cholesky's decomposition of -A.
    for r in range(d):
        if not A[r, r] < 0.0:
            return False
        for i in range(r + 1, d):
            for c in range(r + 1, d):
                A[i, c] -= A[i, r] * A[r, c] / A[r, r]
    return True


@kernel
def turn(P, S, W, j, c):
    """A step of Newton's method for G(n) = c n, |n| = 1, with G in W.g and its slopes in W.disc, which it overwrites.

    Moves n in S.mult; returns c and by how much both change, 0 at a solution and inf where there is no step.
    """
    d, A, square, off = P.dim[j], W.disc, 0.0, 0.0
    for r in range(d):
        n = S.mult[j + 1 + r]
        square += n * n
        for k in range(d):
            A[r, k] -= c if r == k else 0.0
        A[r, d], A[d, r] = -n, n
        A[r, d + 1] = c * n - W.g[j + 1 + r]
        off = max(off, abs(A[r, d + 1]))
    A[d, d], A[d, d + 1] = 0.0, 0.5 * (1.0 - square)
    off = max(off / (1.0 + abs(c)), abs(square - 1.0))
    if off <= 1e-14:
        return c, 0.0  # also where every direction is one
    if not solve_dense(A, d + 1, 1):
        return c, math.inf
    change = abs(A[d, d + 1]) / (1.0 + abs(c))
    for r in range(d):
        S.mult[j + 1 + r] += A[r, d + 1]
        change = max(change, abs(A[r, d + 1]))
    return c + A[d, d + 1], change
