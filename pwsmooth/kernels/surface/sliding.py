"""Solved multipliers: the sliding condition grad h . f + dh/dt = 0, and the surface kept exactly.

Newton's method on the residuals g of the masked multipliers; the projection x - dh'(dh dh')^-1 h for surfaces that
are no coordinate (a coordinate is set to exactly 0).
"""

import math

from numba import types

from ..intervals import time_size
from ..machine.compiling import inlined_kernel, kernel, unit
from ..machine.pointers import call_act, call_fields, call_linear, call_newton
from ..state import ALGEBRAIC, BY_ACT, COMPONENT, CONTACT, DISC, SECOND_ORDER, SOLVED, Problem, State
from ..work import Work
from .sparse import entry, solve_dense, solve_masked

# At exactly +1 and -1 the fields are those of slip; just inside, lambda of a disc is what the multipliers of its
# components say, where h/|h| is 0/0. Of a switch they differ from the affine form by a power of a surface that has
# it, sqrt(|h|) of a rounding say.
INSIDE = 1.0 - 2.0**-53
_PART = 2.0**-26  # by which sizes are moved to see their terms: half of the digits


@kernel
def side_at_zero(P, S, j):
    """What conditions say of switch j where it stays on its surface, at the present state: 1, 0, -1, BOTH or ANY."""
    if P.at_zero[j] != BY_ACT:
        return P.at_zero[j]
    return 1 if call_act(P.act, P.ne + j, S.t, S.x, S.mult, P.p, S.x) != 0 else -1  # it writes nothing


@kernel
def _has_infinite_slope(P, W):
    """Whether Newton's method stands still where it has not arrived, as at a root at 0; else it has, to rounding."""
    for j in range(P.m):
        if W.mask[j] and not abs(W.G[P.g_diagonal[j]]) < math.inf:
            return True
    return False


@unit(types.int64, Problem, State, Work)
def newton(P, S, W):
    """Solves g = 0 for the multipliers of W.mask, overwriting S.mult; 0 when it does not converge."""
    m, t = P.m, S.t
    x, mult, g, mask, b = S.x, S.mult, W.g, W.mask, W.linear.rhs
    previous = math.inf
    change = 0.0
    for sweep in range(25):
        call_fields(P.fields, t, x, mult, P.p, W.dx, W.h, g)
        call_linear(P.linear, t, x, mult, P.p, W.G, W.dh)
        rest = 0.0
        for j in range(m):
            b[j] = -g[j]
            if mask[j]:
                rest = max(rest, abs(g[j]))
        if not solve_masked(P, W):
            return 1 if rest == 0.0 else 0
        change = 0.0
        for j in range(m):
            if mask[j]:
                mult[j] += b[j]
                if abs(mult[j]) == 1.0 and P.kind[j] != ALGEBRAIC and P.kind[j] != CONTACT:
                    mult[j] *= INSIDE
                change = max(change, abs(b[j]) / (1.0 + abs(mult[j])))
        if not change < math.inf or (change == 0.0 and rest > 1e-14 and _has_infinite_slope(P, W)):
            return 0
        # One step more than it takes to see convergence: the residual then sits at rounding.
        if change <= 1e-15 or (sweep > 0 and change < 1e-9 and change >= 0.25 * previous):
            return 1
        previous = change
    return 1 if change < 1e-10 else 0


@inlined_kernel
def _has_unit(P, j):
    """Whether a multiplier is no number between -1 and 1, but has a unit."""
    return P.kind[j] == ALGEBRAIC or P.kind[j] == CONTACT


@inlined_kernel
def _is_rounding_of_lambda(P, S, W):
    """Whether small residuals are, in whatever units they stand, what roundings of the multipliers make."""
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for j in range(P.m):
        if W.mask[j] == 0 or (P.hidden[j] != 0 and not _has_unit(P, j)):
            continue
        told = 1e-14 * abs(S.mult[j]) if _has_unit(P, j) else 1e-12
        if not abs(W.g[j]) <= told * abs(W.G[P.g_diagonal[j]]):
            return False
    return True


@inlined_kernel
def follow(P, S, W):
    """Newton only where a masked residual is above rounding: the usual case costs one evaluation."""
    some = False
    for j in range(P.m):
        some = some or W.mask[j] != 0
    if not some:
        return True
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    if W.step.nears == 0:  # a motion that comes to rest has residuals below any rounding of others
        clean, exact = True, True
        for j in range(P.m):
            # The rounding of a residual whose terms are of order 10; a multiplier is followed to rtol/100 at best.
            if W.mask[j] and W.g[j] != 0.0:
                clean, exact = clean and (_has_unit(P, j) or abs(W.g[j]) <= 1e-14), False
        if exact or (clean and _is_rounding_of_lambda(P, S, W)):
            return True
    return call_newton(P.newton_unit, P, S, W) != 0


@inlined_kernel
def mask_solved(P, S, W):
    """Overwrites W.mask: the multipliers that are solved now."""
    for j in range(P.m):
        W.mask[j] = 1 if S.status[j] == SOLVED else 0


@kernel
def mask_instant(P, S, W):
    """Overwrites W.mask: those that are solved at every instant, whatever a switch does; True if there are any."""
    some = False
    for j in range(P.m):
        kind = P.kind[j]
        held = S.status[j] == SOLVED and (kind == CONTACT or kind == SECOND_ORDER or kind == COMPONENT)
        W.mask[j] = 1 if kind == ALGEBRAIC or held else 0
        some = some or W.mask[j] != 0
    return some


@inlined_kernel
def is_memory(P, i):
    """Whether nothing but an update changes state i, not even by a rounding."""
    return i >= P.n - P.memories


@inlined_kernel
def _is_kept(P, S, i, j):
    """Whether state i is a memory, or 0 as the surface of another multiplier that is solved for, but for those of the
    disc of j."""
    if is_memory(P, i):
        return True
    k = P.holder[i]
    return k >= 0 and S.status[k] == SOLVED and k != j and (P.disc_of[k] < 0 or P.disc_of[k] != P.disc_of[j])


@kernel
def common_gradient(P, S, W, j, k):
    """The product of the gradients of surfaces j and k in W.dh, over the states that no other surface keeps at 0."""
    total = 0.0
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        if not _is_kept(P, S, P.dh_col[e], j):
            total += W.dh[e] * (W.dh[e] if k == j else entry(P.dh_row, P.dh_col, W.dh, k, P.dh_col[e]))
    return total


@kernel
def go_down_gradient(P, S, W, j, part, whole):
    """Moves S.x against the gradient of surface j in W.dh, by part/whole of it, but not what another one keeps."""
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        if not _is_kept(P, S, P.dh_col[e], j):
            S.x[P.dh_col[e]] -= W.dh[e] * part / whole


@kernel
def keep_on_surface(P, S, j, W):
    """Puts S.x exactly on h_j = 0, by the least change of what no other surface keeps."""
    if P.surface_state[j] >= 0:
        S.x[P.surface_state[j]] = 0.0
        return
    for _ in range(3):
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        if W.h[j] == 0.0:
            return
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        square = common_gradient(P, S, W, j, j)
        if not square > 0.0:
            return
        go_down_gradient(P, S, W, j, W.h[j], square)


@kernel
def is_at_rest(P, S, j, W):
    """Whether h of disc j is 0, or changes by as much in less than the clock resolves; W has the fields of its slip."""
    keep, fastest = S.mult[j], 0.0
    S.mult[j] = 1.0  # its lambda is h/|h| in the rates; residuals g have the multipliers of its components
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    S.mult[j] = keep
    for k in range(j + 1, j + 1 + P.dim[j]):
        rate = W.dh[P.dh_row[P.m + P.ne] + k]
        for e in range(P.dh_row[k], P.dh_row[k + 1]):
            rate += W.dh[e] * W.dx[P.dh_col[e]]
        fastest = max(fastest, abs(rate))
    return W.h[j] == 0.0 or math.sqrt(W.h[j]) <= 1e-15 * time_size(S) * fastest


@kernel
def _are_states(P, j):
    """Whether the surfaces of disc j are states."""
    for k in range(j + 1, j + 1 + P.dim[j]):
        if P.surface_state[k] < 0:
            return False
    return True


@kernel
def keep_at_rest(P, S, W):
    """Puts S.x where h = 0 for all discs that stick, inside their bound: first where that says what states are, which
    the others leave."""
    for turn in range(2):
        for j in range(P.m):
            if P.kind[j] == DISC and S.status[j] == SOLVED and _are_states(P, j) == (turn == 0):
                if S.mult[j] == 1.0:
                    S.mult[j] = INSIDE
                put_in_slip(P, S, j, 0.0, S.mult, W)


@kernel
def put_in_slip(P, S, j, size, toward, W):
    """Puts S.x where the surfaces of disc j are `size` in the direction `toward` (m,), by the least change of what no
    other disc keeps.

    All rows at once, Dh Dh' u = h - level: one after another they would spoil each other where gradients are not
    orthogonal.
    """
    d, A = P.dim[j], W.disc
    if _are_states(P, j):
        for k in range(j + 1, j + 1 + d):
            S.x[P.surface_state[k]] = size * toward[k] if size != 0.0 else 0.0
        return
    for _ in range(3):
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        there = True
        for r in range(d):
            k = j + 1 + r
            A[r, d] = W.h[k] - size * toward[k]
            there = there and A[r, d] == 0.0
            for c in range(d):
                A[r, c] = common_gradient(P, S, W, k, j + 1 + c)
        if there or not solve_dense(A, d, 1):
            return
        for r in range(d):
            go_down_gradient(P, S, W, j + 1 + r, A[r, d], 1.0)


@inlined_kernel
def surface_speed(P, W, i):
    """dh_i/dt from the gradients in W.dh and the rates in W.dx; its change with the multipliers is not in it."""
    speed = W.dh[P.dh_row[P.m + P.ne] + i]
    for e in range(P.dh_row[i], P.dh_row[i + 1]):
        speed += W.dh[e] * W.dx[P.dh_col[e]]
    return speed


@kernel
def surface_size(P, S, j, W):
    """The size of what h_j is made of, from the gradient's row and the time slope in W.dh."""
    total = 1e-300 + abs(W.dh[P.dh_row[P.m + P.ne] + j] * S.t) + P.wave[j]
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        if S.x[P.dh_col[e]] != 0.0:  # where a root has its branch point its slope is infinite
            total += abs(W.dh[e] * S.x[P.dh_col[e]])
    if P.unknowns[j] >= 0 and W.dh[P.unknowns[j]] < math.inf:
        total += W.dh[P.unknowns[j]]
    return total


@kernel
def surface_tolerance(P, C, W, j):
    """What the absolute tolerances of the states leave of h_j, from W.dh."""
    total = 0.0
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        total += abs(W.dh[e]) * C.atol[P.dh_col[e]]
    return total


@kernel
def surface_rounding(P, S, j, W):
    """The size at which h_j is indistinguishable from 0, from W.dh."""
    return 1e-13 * surface_size(P, S, j, W)


@kernel
def _shift(P, S, W, turns):
    """Overwrites W.shifted_x and W.shifted_mult: all that rates are made of, changed by a small part of its size, by
    turns up and down where it `turns`."""
    up = _PART
    for i in range(P.n):
        W.shifted_x[i] = S.x[i] + up * W.sizes[i]
        up *= turns
    for j in range(P.m):
        W.shifted_mult[j] = S.mult[j] * (1.0 + up) if S.status[j] == SOLVED else S.mult[j]
        up *= turns


@kernel
def sum_terms(P, S, W, within):
    """Overwrites W.terms: what the terms of each rate add up to, whatever cancels.

    It is by how much a rate changes where all that it is made of changes by a small part, all up, and by turns up and
    down: terms that cancel in one of them do not in the other. The part is one of the largest that a state has been, or
    of what it is where a power may have its branch point, and of what its own terms come to `within` a time.
    """
    W.terms[:] = 0.0
    for _ in range(2 if within > 0.0 else 1):
        for i in range(P.n):
            size = W.size[i] if P.watches == 0 else abs(S.x[i])
            W.sizes[i] = 0.0 if is_memory(P, i) else size + within * W.terms[i]
        _shift(P, S, W, -1.0)
        call_fields(P.fields, S.t * (1.0 + _PART), W.shifted_x, W.shifted_mult, P.p, W.terms, W.h, W.g)
        _shift(P, S, W, 1.0)
        call_fields(P.fields, S.t, W.shifted_x, W.shifted_mult, P.p, W.up, W.h, W.g)
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(P.n):
            terms = (abs(W.terms[i] - W.dx[i]) + abs(W.up[i] - W.dx[i])) / _PART
            W.terms[i] = abs(W.dx[i]) + (terms if terms < math.inf else 0.0)
