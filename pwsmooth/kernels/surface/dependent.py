"""G of several discs whose surfaces depend on each other, as a function of their lambda together."""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_newton
from ..state import DISC, SOLVED
from .sliding import mask_solved, put_in_slip
from .sparse import find_strengths, link, solve_dense
from .vector import begins

_DELTA = 1e-4  # of lambda
_PROJECTIONS = 20
_DEPENDS = 1e-9  # of the largest pivot: what is left of a surface that the others determine
# Of the interior-point method: how fast w falls near its path and off it, to what, and how near to a bound a step goes.
_CENTRED, _OFF_CENTRE, _GAP, _INSIDE, _ITERATIONS = 0.1, 0.5, 1e-14, 0.99, 100
_CORNER = 1e-9  # of the largest square of a row of J: of less it is not made


@kernel
def gather(P, S, W, j):
    """Overwrites W.together.comp by the components of disc j and of those at h = 0 that are linked to it; how many."""
    group, q = W.together, 0
    link(P, S, W, j + 1)
    for k in range(P.m):
        if P.kind[k] != DISC or (k != j and S.status[k] != SOLVED and not begins(P, S, k)):
            continue
        linked, hidden = k == j, False
        for i in range(k + 1, k + 1 + P.dim[k]):
            linked = linked or W.linear.linked[i] != 0
            hidden = hidden or P.hidden[i] != 0
        if not linked or (hidden and k != j):
            continue
        if hidden:
            return 0
        for i in range(k + 1, k + 1 + P.dim[k]):
            group.comp[q] = i
            q += 1
    return q


@kernel
def put_at_rest(P, S, W):
    """Puts S.x where h = 0 for all discs that stand: one after the other, as each moves the others, ever less."""
    for _ in range(_PROJECTIONS):
        for j in range(P.m):
            if P.kind[j] == DISC and (S.status[j] == SOLVED or begins(P, S, j)):
                put_in_slip(P, S, j, 0.0, S.mult, W)


@kernel
def residuals(P, S, W, q):
    """Overwrites together.g by G of the group at the lambda in S.mult; whatever else is solved follows."""
    mask_solved(P, S, W)
    for i in range(q):
        k = W.together.comp[i]
        W.mask[k] = W.mask[P.disc_of[k]] = 0
    some = False
    for k in range(P.m):
        some = some or W.mask[k] != 0
    if some:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(q):
        W.together.g[i] = W.g[W.together.comp[i]]


@kernel
def slopes_of_group(P, S, W, q):
    """Overwrites together.J by dG/dlambda of the group, and together.g by G; returns the largest |G|."""
    group = W.together
    for c in range(q):
        k = group.comp[c]
        keep = S.mult[k]
        for sign in range(2):
            S.mult[k] = keep + (_DELTA if sign == 0 else -_DELTA)
            residuals(P, S, W, q)
            for r in range(q):
                group.J[r, c] = group.g[r] if sign == 0 else (group.J[r, c] - group.g[r]) / (2.0 * _DELTA)
        S.mult[k] = keep
    residuals(P, S, W, q)
    largest = 0.0
    for r in range(q):
        largest = max(largest, abs(group.g[r]))
    return largest


@kernel
def independent(W, q):
    """Overwrites together.order by the components of the group, those first that determine the others; how many."""
    group = W.together
    A, order, first = group.left, group.order, 0.0
    for r in range(q):
        order[r] = r
        for c in range(q):
            A[r, c] = group.J[r, c]
    for i in range(q):
        best = i
        for r in range(i + 1, q):
            if abs(A[order[r], order[r]]) > abs(A[order[best], order[best]]):
                best = r
        order[i], order[best] = order[best], order[i]
        p = order[i]
        first = max(first, abs(A[p, p]))
        if not abs(A[p, p]) > _DEPENDS * first:
            return i
        for r in range(i + 1, q):
            factor = A[order[r], p] / A[p, p]
            for c in range(i + 1, q):
                A[order[r], order[c]] -= factor * A[p, order[c]]
    return q


@kernel
def square_of_disc(W, i):
    """(|lambda|^2 in together.lam of the disc whose components begin at i, how many these are)."""
    group, d, total = W.together, 0, 0.0
    while i + d < group.size and group.disc[i + d] == group.disc[i]:
        total += group.lam[i + d] ** 2
        d += 1
    return total, d


@kernel
def largest_lambda(W):
    """The largest |lambda| in together.lam."""
    i, largest = 0, 0.0
    while i < W.together.size:
        square, d = square_of_disc(W, i)
        largest = max(largest, square)
        i += d
    return math.sqrt(largest)


@kernel
def _newton_for_load(W, s, rank, discs):
    """Overwrites together.matrix by Newton's equations for the optimum; returns how far the sum of the products
    held_k (s - |lambda_k|^2/s), which vanish there, is from it."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    size, gap, i = q + 1 + rank + discs, 0.0, 0
    for r in range(size):
        for c in range(size + 1):
            A[r, c] = 0.0
    A[q, size] = -1.0
    for k in range(discs):
        square, d = square_of_disc(W, i)
        at, held, beyond, slope = q + 1 + rank + k, group.held[k], square / s - s, -1.0 - square / s**2
        for r in range(i, i + d):
            A[r, r] = 2.0 * held / s
            A[r, q] = A[q, r] = -2.0 * held * lam[r] / s**2
            A[r, at] = 2.0 * lam[r] / s
            A[at, r] = held * A[r, at]
            A[r, size] = -held * A[r, at]
        A[q, q] += 2.0 * held * square / s**3
        A[q, at], A[at, q] = slope, held * slope
        A[q, size] -= held * slope
        A[at, at], A[at, size] = beyond, -held * beyond
        gap -= held * beyond
        i += d
    for r in range(rank):
        row = group.order[r]
        A[q + 1 + r, size] = group.goal[r]
        for c in range(q):
            slope = group.J[row, c]
            A[q + 1 + r, c] = A[c, q + 1 + r] = slope
            A[q + 1 + r, size] -= slope * lam[c]
            A[c, size] -= slope * group.push[r]
    return gap


@kernel
def _share_inside(W, s, rank, discs):
    """How much of a step of Newton's method leaves all |lambda_k| < s and all held_k > 0."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    size, share = q + 1 + rank + discs, 1.0
    for k in range(discs):
        if A[q + 1 + rank + k, size] < 0.0:
            share = min(share, -_INSIDE * group.held[k] / A[q + 1 + rank + k, size])
    for _ in range(60):
        ahead, i, inside = s + share * A[q, size], 0, True
        for _ in range(discs):
            square, d = square_of_disc(W, i)
            new = 0.0
            for r in range(i, i + d):
                new += (lam[r] + share * A[r, size]) ** 2
            inside = inside and ahead > 0.0 and ahead - new / ahead > (1.0 - _INSIDE) * (s - square / s)
            i += d
        if inside:
            break
        share *= 0.8
    return share


@kernel
def least_load(P, S, W, rank):
    """Overwrites together.lam by the lambda with G = 0, by slopes in together.J, whose largest |lambda_k| is least, to
    the end of the path of centres to it; returns a bound of all |lambda_k|, inf if there is none.

    minimise s, |lambda_k|^2/s <= s: Newton's method for held_k (s - |lambda_k|^2/s) = w and a stationary Lagrangian,
    with w falling to 0 (Boyd and Vandenberghe 2004, 11.7).
    """
    group, q = W.together, W.together.size
    A, order, lam = group.matrix, group.order, group.lam
    # The shortest lambda to begin with, J'y with J J'y = b.
    for r in range(rank):
        total = -group.g[order[r]]
        for c in range(q):
            total += group.J[order[r], c] * S.mult[group.comp[c]]
        group.goal[r] = A[r, rank] = total
        for c in range(rank):
            A[r, c] = 0.0
            for i in range(q):
                A[r, c] += group.J[order[r], i] * group.J[order[c], i]
    if not solve_dense(A, rank, 1):
        return math.inf
    for i in range(q):
        lam[i] = 0.0
        for r in range(rank):
            lam[i] += group.J[order[r], i] * A[r, rank]
    find_strengths(W, group.J, group.strength, q)  # G = -S strength
    s = 1.5 * largest_lambda(W)
    if s == 0.0:
        return 0.0
    discs, total, i = 0, 0.0, 0
    while i < q:
        square, d = square_of_disc(W, i)
        total += 1.0 + square / s**2
        discs, i = discs + 1, i + d
    for k in range(discs):
        group.held[k] = 1.0 / total
    for r in range(rank):
        group.push[r] = 0.0
    size, share = q + 1 + rank + discs, 1.0
    for _ in range(_ITERATIONS):
        gap = _newton_for_load(W, s, rank, discs)
        centre = (_CENTRED if share > 0.5 else _OFF_CENTRE) * gap / discs
        for k in range(discs):
            A[q + 1 + rank + k, size] -= centre
        if gap <= _GAP * s or not solve_dense(A, size, 1):
            break
        share = _share_inside(W, s, rank, discs)
        for i in range(q):
            lam[i] += share * A[i, size]
        s += share * A[q, size]
        for r in range(rank):
            group.push[r] += share * A[q + 1 + r, size]
        for k in range(discs):
            group.held[k] += share * A[q + 1 + rank + k, size]
    # How they begin to move, if they do, to a common factor: what is dual to G = 0.
    for i in range(q):
        group.move[group.comp[i]] = 0.0
        for r in range(rank):
            group.move[group.comp[i]] -= group.J[order[r], i] * group.push[r]
        group.move[group.comp[i]] /= group.strength[i]
    return s


@kernel
def gather_leaving(P, S, W):
    """Overwrites W.together by the discs that begin to move as one body, with their slopes; whether there are any."""
    group, q = W.together, 0
    for k in range(P.m):
        if begins(P, S, k) and (group.move[k + 1] != 0.0 or group.move[k + 2] != 0.0):
            for i in range(k + 1, k + 1 + P.dim[k]):
                group.comp[q], group.disc[q] = i, k
                q += 1
    group.size = q
    if q > 0:
        slopes_of_group(P, S, W, q)
        group.rank = independent(W, q)
    return q > 0


@kernel
def load_of_leaving(P, S, W):
    """The largest |lambda_k| at the least with which that group would still be held."""
    residuals(P, S, W, W.together.size)
    return least_load(P, S, W, W.together.rank)


@kernel
def pace_of_leaving(P, S, W):
    """d/dt of the common factor of all h of that group, which are as W.together.move.

    They go as the load at the time says, in the directions of the lambda that would hold it, and these in S.mult. Then
    G + J tau = rate move, where tau, how the directions turn, is normal to each and as short as it can be; at a corner
    of the limit surface, where no tau does, with the least rest.
    """
    group, q, rank, A = W.together, W.together.size, W.together.rank, W.together.matrix
    largest = 0.0
    load = load_of_leaving(P, S, W)
    if not 0.0 < load < math.inf:
        return math.nan
    i = 0
    while i < q:
        square, d = square_of_disc(W, i)
        for r in range(i, i + d):
            S.mult[group.comp[r]] = group.lam[r] / math.sqrt(square)
        i += d
    residuals(P, S, W, q)
    for r in range(rank):
        # Row r of J without what is along the directions.
        row = group.order[r]
        for i in range(q):
            j = P.disc_of[group.comp[i]]
            along = 0.0
            for c in range(q):
                if P.disc_of[group.comp[c]] == j:
                    along += group.J[row, c] * S.mult[group.comp[c]]
            group.left[r, i] = group.J[row, i] - along * S.mult[group.comp[i]]
    for r in range(rank):
        row = group.order[r]
        for c in range(rank):
            A[r, c] = 0.0
            for i in range(q):
                A[r, c] += group.left[r, i] * group.left[c, i]
        speed = group.move[group.comp[row]]
        A[r, rank], A[rank, r], A[r, rank + 1] = -speed, speed, -group.g[row]
        largest = max(largest, A[r, r])
    for r in range(rank):
        A[r, r] += _CORNER * largest
    A[rank, rank] = A[rank, rank + 1] = 0.0
    return A[rank, rank + 1] if solve_dense(A, rank + 1, 1) else math.nan
