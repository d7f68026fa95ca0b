"""Dry friction between masses: several switches on their surfaces, which act on each other.

Where g is affine in lambda and dg/dlambda = -S D with S symmetric and positive, D > 0, the layer is the gradient of a
convex function on the box of the lambda: what it comes to is its minimum, which needs no layer. All stick where some
lambda in the box has g = 0, else some slip (the variational inequality of maximum dissipation).
S is singular where friction stands in a loop: two brakes on one shaft, bodies that rub each other in a ring or on the
ground as well. Together they hold more than there is to move, and lambda is not unique, though the motion is: that
whose largest is least says how much is left. What is redundant is HELD with its lambda, the rest is solved for. Where
the least load reaches 1, those begin to move whose lambda is the largest in every such load. Where what is redundant
would not stay on its surface, as two brakes on one shaft whose discs turn differently, some let go as well: the drift
adds to what is minimised a term that no lambda balances.
Chain: holding.py -> **this file** -> settling.py, instants.py.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_linear, call_newton
from ..outcome import Outcome
from ..state import AMB_FORCES, EV_RESET, EV_TANGENCY, GO_ON, GROWS, HELD, NOTHING, SLIDING, SOLVED
from ..step.recording import record_ambiguity, record_event
from ..step.steps import surface_rows
from ..surface.dependent import PARTS, holds, independent, slopes_of_group
from ..surface.sharing import FULL, least_load, slip_or_stick
from ..surface.sliding import mask_solved
from ..surface.sparse import entry, find_strengths, link, solve_dense, solve_masked
from .surface_rates import is_supported

_SYMMETRIC = 1e-7  # of slopes, which differences tell
_ALIKE = 1e-9  # of a slope: what is left of it where the others that stick determine the surface
_PUSH = 1e-4  # of a friction: enough of a drift that is of higher order to tell which let go
_SPARE = 0.9  # of the room to its bound: how far a lambda that is solved for may be led towards it


@kernel
def is_held(P, S, W, j):
    """Whether what is solved for keeps switch j on its surface, whatever its lambda is. W.G has the slopes; W.mask is
    lost."""
    mask_solved(P, S, W)
    row, col, u = P.g_row, P.g_col, W.linear.rhs
    for k in range(P.m):
        u[k] = 0.0
    for k in range(P.m):
        for e in range(row[k], row[k + 1]):
            if col[e] == j and W.mask[k]:
                u[k] = -W.G[e]
    if not solve_masked(P, W):
        return False
    total, size = W.G[P.g_diagonal[j]], abs(W.G[P.g_diagonal[j]])
    for e in range(row[j], row[j + 1]):
        if W.mask[col[e]]:
            total += W.G[e] * u[col[e]]
            size = max(size, abs(W.G[e] * u[col[e]]))
    return abs(total) <= _ALIKE * size


@kernel
def _gather(P, S, W, size):
    """Overwrites W.together.comp by the switches W.instant.group[:size] and those that stick and act on them, also
    through ones that are HELD; how many, 0 if there is no dry friction between them."""
    group, known, q = W.together, W.together.known, size
    for k in range(P.m):
        known[k] = 0
    for a in range(size):
        known[W.instant.group[a]] = 1
        if a < len(group.comp):
            group.comp[a] = W.instant.group[a]
    a = 0
    while a < q:
        if q > len(group.comp):
            return 0
        if a == 0 or S.status[group.comp[a]] == HELD:
            link(P, S, W, group.comp[a])
            for k in range(P.m):
                sticks = S.status[k] == SOLVED or S.status[k] == HELD
                if W.linear.linked[k] == 0 or P.kind[k] != SLIDING or not sticks or known[k] != 0:
                    continue
                known[k] = 1
                if S.status[k] == SOLVED or not is_supported(P, S, W, k):
                    if q < len(group.comp):
                        group.comp[q] = k
                    q += 1
        a += 1
    for a in range(q):
        j = group.comp[a]
        if P.hidden[j] != 0 or P.nested[j] != 0:
            return 0
        group.ball[a], group.late[a] = j, 0
    group.size = q
    return q if q > 1 else 0


@kernel
def _rank_of_friction(P, S, W, q):
    """How many of the group's surfaces determine the others, 0 if dg/dlambda, put into together.J, is not -S D."""
    group = W.together
    J, strength = group.J, group.strength
    slopes_of_group(P, S, W, q)
    find_strengths(W, J, strength, q)
    for r in range(q):
        if not J[r, r] < 0.0:
            return 0
        for c in range(r):
            near = math.sqrt(J[r, r] * J[c, c] / (strength[r] * strength[c]))
            if not abs(J[r, c] / strength[c] - J[c, r] / strength[r]) <= _SYMMETRIC * near:
                return 0
    rank = independent(W, q)
    for r in range(rank):
        if not group.left[group.order[r], group.order[r]] < 0.0:
            return 0
    return rank


@kernel
def _row_of_slopes(W, r, q):
    """One number of the slopes of g_r by all lambda, which changes with any of them."""
    total = 0.0
    for c in range(q):
        total += (1.0 + c) * W.together.J[r, c]
    return total


@kernel
def _push_by_drift(W):
    """Adds to together.g, all of which can be balanced, a little of the drift, which cannot."""
    group, most, size = W.together, 0.0, 0.0
    for r in range(group.size):
        most = max(most, abs(W.instant.drift[group.comp[r]]))
        size = max(size, abs(group.J[r, r]))
    for r in range(group.size if most > 0.0 else 0):
        group.g[r] += _PUSH * size * W.instant.drift[group.comp[r]] / most


@kernel
def _find_lambda(P, S, W, rank, leaves):
    """Overwrites together.lam by what holds the group, or by that with which it moves on; the largest |lambda| that
    holds it, inf if none does, and whether it moves."""
    group, q = W.together, W.together.size
    A, load, parts = group.matrix, 0.0, False
    if rank < q:
        if W.instant.parting > 0:
            _push_by_drift(W)
        load = least_load(P, S, W, rank)
        parts = not holds(S, W)
        if parts and leaves:
            return math.inf, False
    else:
        for r in range(q):
            A[r, q] = -group.g[r]
            for c in range(q):
                A[r, c] = group.J[r, c]
        if not solve_dense(A, q, 1):
            return math.inf, False
        for r in range(q):
            group.lam[r] = S.mult[group.comp[r]] + A[r, q]
            load = max(load, abs(group.lam[r]))
    moves = parts or load > (1.0 - FULL if leaves else 1.0)
    if moves and not leaves and load < math.inf:
        for r in range(q):
            group.lam[r] = S.mult[group.comp[r]]
        slip_or_stick(W)
    return load, moves


@kernel
def _is_affine(P, S, W, q):
    """Whether the slopes by lambda, in together.J, are the same at the lambda found."""
    group, same = W.together, True
    for r in range(q):
        W.linear.start[r] = _row_of_slopes(W, r, q)
        k = group.comp[r]
        group.kept[r], S.mult[k] = S.mult[k], group.lam[r]
    slopes_of_group(P, S, W, q)
    for r in range(q):
        bend = _row_of_slopes(W, r, q) - W.linear.start[r]
        same = same and abs(bend) <= _SYMMETRIC * q * abs(group.J[r, r])
    for r in range(q):
        S.mult[group.comp[r]] = group.kept[r]
    return same


@kernel
def _lead_to_bounds(P, S, W, load):
    """Shares out a load below 1 so that a lambda which is solved for comes to its bound where the load comes to 1; how
    many are solved for.

    Those that are free are led to their bounds, but for the one that acts most, which is left to carry the rest; as
    far as the others allow that.
    """
    group, q, best, total, rest = W.together, W.together.size, -1, 0.0, 0.0
    for r in range(q):
        group.late[r] = group.free[r]
        if group.free[r]:
            # What is dual to G = 0 says how much of the load each carries.
            group.goal[r] = abs(group.strength[r] * group.move[group.comp[r]])
            total += group.goal[r]
            if best < 0 or group.goal[r] > group.goal[best]:
                best = r
    group.late[best] = 0
    rest = total - group.goal[best]
    rank = independent(W, q)
    if not rest > 0.0:
        return rank
    level = 1.0 if load * total >= rest - group.goal[best] else load * total / rest
    for r in range(q):
        k = group.comp[r]
        S.status[k] = HELD
        if group.late[r]:
            S.mult[k] = math.copysign(level, group.lam[r])
    for r in range(rank):
        S.status[group.comp[group.order[r]]] = SOLVED
    mask_solved(P, S, W)
    call_newton(P.newton_unit, P, S, W)
    share = 1.0
    for r in range(q):
        step = S.mult[group.comp[r]] - group.lam[r]
        room = _SPARE * (1.0 - math.copysign(group.lam[r], step * group.lam[r]))
        if S.status[group.comp[r]] == SOLVED and abs(step) > room:
            share = min(share, room / abs(step))
    for r in range(q):
        k = group.comp[r]
        S.mult[k] = group.lam[r] + share * (S.mult[k] - group.lam[r])
    return rank


@kernel
def sliding_with(P, S, W, j):
    """Overwrites W.instant.group by switch j and the sliding ones that act on it or it on them; returns how many."""
    link(P, S, W, j)
    size = 0
    for i in range(P.m):
        if W.linear.linked[i] and P.kind[i] == SLIDING and (i == j or S.status[i] == SOLVED):
            W.instant.group[size] = i
            size += 1
    return size


@kernel
def settle_friction(P, S, R, W, size, leaves):
    """The switches W.instant.group[:size] stand on their surfaces: what they do if that is dry friction between masses.

    They come to rest there, or their force has jumped, or it `leaves` what a loop can hold. A code, or NOTHING, with
    nothing changed, if they are none.
    """
    q = _gather(P, S, W, size)
    rank = _rank_of_friction(P, S, W, q) if q > 1 and P.nz == 0 else 0
    if rank == 0 or (leaves and rank == q):
        return NOTHING
    group = W.together
    load, moves = _find_lambda(P, S, W, rank, leaves)
    if not load < math.inf or not _is_affine(P, S, W, q):
        return NOTHING
    sticking, smooth = 0, leaves or W.instant.parting > 0
    for r in range(q):
        j = group.comp[r]
        S.mult[j], S.deflate[j] = group.lam[r], 0
        W.instant.hit[j] = W.instant.hit[j] and not leaves
        if moves and group.free[r]:
            S.status[j] = 1 if group.lam[r] > 0.0 else -1
            S.mult[j] = float(S.status[j])
            S.deflate[j] = 2 if leaves else max(W.instant.parting, 1)
            if smooth:
                record_event(S, R, j, EV_TANGENCY, 0, S.status[j])
            elif r >= size:  # the caller does not know of it
                record_event(S, R, j, EV_RESET, 0, S.status[j])
                W.instant.status[j] = S.status[j]
        else:
            S.status[j] = HELD
            group.comp[sticking], group.lam[sticking], group.free[sticking] = j, group.lam[r], group.free[r]
            group.strength[sticking] = group.strength[r]
            sticking += 1
    group.size = sticking
    if rank == q:
        for r in range(sticking):
            S.status[group.comp[r]] = SOLVED
    elif sticking > 0:
        slopes_of_group(P, S, W, sticking)
        rank = independent(W, sticking)
        if rank < sticking and not moves:
            if load > 0.0:
                rank = _lead_to_bounds(P, S, W, load)
            if not leaves:
                record_ambiguity(S, R, group.comp[0], AMB_FORCES, 0)
        for r in range(sticking):
            group.late[r] = 0
        for r in range(rank):
            S.status[group.comp[group.order[r]]] = SOLVED
    mask_solved(P, S, W)
    return GO_ON if call_newton(P.newton_unit, P, S, W) != 0 else Outcome.NO_ROOT


@kernel
def leave_loop(P, S, R, W, j):
    """Switch j, which sticks, has come to its bound: a code, NOTHING if it is in no loop of dry friction.

    Others take over what it carried as long as they can.
    """
    for k in range(P.m):
        if S.status[k] == HELD and P.kind[k] == SLIDING:
            return settle_friction(P, S, R, W, sliding_with(P, S, W, j), True)
    return NOTHING


@kernel
def begins_to_part(P, C, S, W, h):
    """Whether switches that are HELD leave their surfaces on the polynomials of a step of length h, which are found
    without them; W.instant.parting and W.instant.drift say how."""
    instant, rows, all_rows = W.instant, W.step.rows, surface_rows(P, W.step.kind)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    parting = C.order + 1
    instant.drift[:] = 0.0
    for j in range(P.m):
        grows = S.deflate[j] == GROWS
        if S.status[j] != HELD or P.kind[j] != SLIDING or all_rows[j] < 0 or grows:
            continue
        strength = abs(W.G[P.g_diagonal[j]])
        for r in range(P.m if strength == 0.0 else 0):  # of a force that acts by unknowns
            strength = max(strength, abs(entry(P.g_row, P.g_col, W.G, r, j)))
        size = h * strength
        for e in range(P.dh_row[j], P.dh_row[j + 1]):
            for k in range(C.order + 1):
                size += abs(W.dh[e] * rows[P.dh_col[e], k]) * h**k
        for k in range(1, min(parting, C.order) + 1):
            drift = rows[all_rows[j], k]
            if abs(drift) * h**k > max(PARTS, 10.0 * C.rtol) * size:
                if k < parting:
                    instant.drift[:] = 0.0
                    parting = k
                instant.drift[j] = drift
                break
    instant.parting = parting if parting <= C.order else 0
    return instant.parting > 0


@kernel
def let_part(P, S, R, W):
    """What switches do that `begins_to_part` has found and that stand in loops; a code, and how many there are in
    W.instant.active that stand in none."""
    instant, size, code = W.instant, 0, GO_ON
    for j in range(P.m):
        if instant.drift[j] != 0.0:
            instant.active[size] = instant.group[size] = j
            size += 1
    code = settle_friction(P, S, R, W, size, False)
    return code, size
