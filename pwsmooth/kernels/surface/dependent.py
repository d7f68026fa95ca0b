"""G of several multipliers whose surfaces depend on each other, as a function of their lambda together.

The discs of one body on several points; the switches of dry friction in a loop. Each has its lambda in a ball: that of
a disc, or the interval of a switch, which is a ball of one dimension.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_linear, call_newton
from ..state import DISC, SOLVED
from .sharing import least_load, square_of_ball
from .sliding import mask_solved, put_in_slip
from .sparse import link, solve_dense
from .vector import begins

_DELTA = 1e-4  # of lambda
_PROJECTIONS = 20
_DEPENDS = 1e-9  # of the largest pivot: what is left of a surface that the others determine
PARTS = 1e-9  # of what friction does: less of a drift is rounding
_KEPT = 1e-3  # of the most that friction does to a surface: where it does less it may be roundings
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
def _mask_others(P, S, W, q):
    """Overwrites W.mask: what is solved beside the group; True if there is anything."""
    mask_solved(P, S, W)
    for i in range(q):
        k = W.together.comp[i]
        W.mask[k] = 0
        if P.disc_of[k] >= 0:
            W.mask[P.disc_of[k]] = 0
    some = False
    for k in range(P.m):
        some = some or W.mask[k] != 0
    return some


@kernel
def residuals(P, S, W, q):
    """Overwrites together.g by G of the group at the lambda in S.mult; whatever else is solved follows."""
    if _mask_others(P, S, W, q):
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(q):
        W.together.g[i] = W.g[W.together.comp[i]]


@kernel
def slopes_of_group(P, S, W, q):
    """Overwrites together.J by dG/dlambda of the group, and together.g by G; returns the largest |G|."""
    group = W.together
    if not _mask_others(P, S, W, q):
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        place = W.linear.place
        for k in range(P.m):
            place[k] = -1
        for c in range(q):
            place[group.comp[c]] = c
        for r in range(q):
            for c in range(q):
                group.J[r, c] = 0.0
            for e in range(P.g_row[group.comp[r]], P.g_row[group.comp[r] + 1]):
                if place[P.g_col[e]] >= 0:
                    group.J[r, place[P.g_col[e]]] += W.G[e]
    else:
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
def _comes_before(W, A, r, best):
    """Whether place r of the group is a better pivot than place `best`: not one of the late ones, or a larger one."""
    group = W.together
    r, best = group.order[r], group.order[best]
    if group.late[r] != group.late[best]:
        return group.late[r] < group.late[best]
    return abs(A[r, r]) > abs(A[best, best])


@kernel
def independent(W, q):
    """Overwrites together.order by the components of the group, those first that determine the others; how many.

    Those in together.late follow from others as far as these go.
    """
    group = W.together
    A, order, first = group.left, group.order, 0.0
    for r in range(q):
        order[r] = r
        first = max(first, abs(group.J[r, r]))
        for c in range(q):
            A[r, c] = group.J[r, c]
    for i in range(q):
        best = -1
        for r in range(i, q):
            if abs(A[order[r], order[r]]) > _DEPENDS * first and (best < 0 or _comes_before(W, A, r, best)):
                best = r
        if best < 0:
            return i
        order[i], order[best] = order[best], order[i]
        p = order[i]
        for r in range(i + 1, q):
            factor = A[order[r], p] / A[p, p]
            for c in range(i + 1, q if factor != 0.0 else 0):
                A[order[r], order[c]] -= factor * A[p, order[c]]
    return q


@kernel
def holds(S, W):
    """Whether together.lam holds all of the group, also those that the others determine."""
    group, holds, most = W.together, True, 0.0
    for r in range(group.size):
        most = max(most, abs(group.J[r, r]))
    for r in range(group.size):
        rest = group.g[r]
        for c in range(group.size):
            rest += group.J[r, c] * (group.lam[c] - S.mult[group.comp[c]])
        # Where something else keeps a surface there are only roundings of the others.
        holds = holds and abs(rest) <= PARTS * max(abs(group.J[r, r]), _KEPT * most)
    return holds


@kernel
def gather_leaving(P, S, W):
    """Overwrites W.together by the discs that begin to move as one body, with their slopes; whether there are any."""
    group, q = W.together, 0
    for k in range(P.m):
        if begins(P, S, k) and (group.move[k + 1] != 0.0 or group.move[k + 2] != 0.0):
            for i in range(k + 1, k + 1 + P.dim[k]):
                group.comp[q], group.ball[q] = i, k
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
        square, d = square_of_ball(W, i)
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
