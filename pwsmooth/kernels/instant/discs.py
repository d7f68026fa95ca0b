"""Discs at an instant: a vector surface is reached, left, or its force has jumped.

At h = 0 the layer decides, w' = G(Lambda(|w|) w/|w|): it comes to a root of G in the disc, a stick, or runs out in a
direction n with G(n) = c n, c > 0, in which the slip goes on. Where G is affine in lambda and pushes back in every
direction there is one of the two and no layer is needed (the variational inequality of maximum dissipation).
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_layer_unit, call_linear, call_newton
from ..outcome import Outcome
from ..state import DISC, EV_RESET, EV_STICK, EV_TANGENCY, GO_ON, SOLVED
from ..step.recording import record_event
from ..surface.layer import ARRIVE
from ..surface.sliding import INSIDE, mask_solved, put_in_slip
from ..surface.sparse import entry, solve_dense
from .settling import layer_code

_BOUND = 1e-13  # by which lambda . lambda may exceed 1 in a stick
_SWEEPS, _ALIKE = 200, 1e-10  # of discs that meet at an instant, and the change of lambda that ends them
_MOVED = 1e-12  # of a residual, above which the force of a stick has jumped


@kernel
def hold(P, S, j):
    """From now on disc j sticks."""
    S.status[j], S.mult[j] = SOLVED, 0.5
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.status[k] = SOLVED


@kernel
def release(P, S, j):
    """From now on disc j slips, at first in the direction of the lambda that it has."""
    size = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        size += S.mult[k] ** 2
    size = math.sqrt(size)
    # Until its first step is made h/|h| is 0/0, or a rounding's direction: lambda is what its multipliers say.
    S.status[j], S.mult[j], S.deflate[j] = 1, INSIDE, 1
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.status[k] = 1
        S.deflate[k] = 0
        S.mult[k] = S.mult[k] / size if size > 0.0 else 1.0 if k == j + 1 else 0.0


@kernel
def _pushes_back(P, W, j):
    """Whether dG/dlambda of disc j is negative in every direction, from the entries in W.G."""
    d, A = P.dim[j], W.disc
    for r in range(d):
        for c in range(d):
            a, b = j + 1 + r, j + 1 + c
            A[r, c] = -entry(P.g_row, P.g_col, W.G, a, b) - entry(P.g_row, P.g_col, W.G, b, a)
    # Cholesky's pivots.
    for r in range(d):
        if not A[r, r] > 0.0:
            return False
        for i in range(r + 1, d):
            for c in range(r + 1, d):
                A[i, c] -= A[i, r] * A[r, c] / A[r, r]
    return True


@kernel
def _find_way_out(P, S, W, j):
    """Newton's method for G(n) = c n, |n| = 1 from the direction in S.mult; False if it does not converge to c > 0."""
    d, A, c = P.dim[j], W.disc, 0.0
    S.mult[j] = 0.5  # lambda is what its multipliers say
    for sweep in range(30):
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        if sweep == 0:
            for r in range(d):
                c += S.mult[j + 1 + r] * W.g[j + 1 + r]
        square = 0.0
        for r in range(d):
            n = S.mult[j + 1 + r]
            square += n * n
            for k in range(d):
                A[r, k] = entry(P.g_row, P.g_col, W.G, j + 1 + r, j + 1 + k) - (c if r == k else 0.0)
            A[r, d], A[d, r] = -n, n
            A[r, d + 1] = c * n - W.g[j + 1 + r]
        A[d, d], A[d, d + 1] = 0.0, 0.5 * (1.0 - square)
        if not solve_dense(A, d + 1, 1):
            break
        change = abs(A[d, d + 1]) / (1.0 + abs(c))
        for r in range(d):
            S.mult[j + 1 + r] += A[r, d + 1]
            change = max(change, abs(A[r, d + 1]))
        c += A[d, d + 1]
        if not change < math.inf:
            break
        if change <= 1e-13:
            S.mult[j] = INSIDE
            return c > 0.0
    S.mult[j] = INSIDE
    return False


@kernel
def settle_disc(P, S, R, W, j, arrives):
    """Disc j is at h = 0: it sticks, or slips on in the direction that is left in S.mult; a code.

    It comes in the direction of slip in the components' multipliers (`arrives`), or from the lambda that stands there.
    """
    d = P.dim[j]
    put_in_slip(P, S, j, 0.0, S.mult, W)
    for k in range(d):
        W.instant.mult[j + 1 + k] = S.mult[j + 1 + k]
    hold(P, S, j)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    if P.hidden[j + 1] == 0 and _pushes_back(P, W, j):
        mask_solved(P, S, W)
        if call_newton(P.newton_unit, P, S, W) == 0:
            return Outcome.NO_ROOT
        if S.mult[j] <= 1.0 + _BOUND:
            S.mult[j] = min(S.mult[j], INSIDE)
            return GO_ON
        release(P, S, j)
        return GO_ON if _find_way_out(P, S, W, j) else Outcome.NO_ROOT
    S.layers += 1
    for k in range(d):
        S.mult[j + 1 + k] = W.instant.mult[j + 1 + k]
        W.instant.group[k] = j + 1 + k
        W.instant.arrival[k] = 1 if arrives else 0
    code = layer_code(P, S, R, j, call_layer_unit(P.layer_unit, P, S, W, ARRIVE, d, 0, 0.0))
    return slip_by_layer(P, S, W, j) if code == GO_ON else code


@kernel
def slip_by_layer(P, S, W, j):
    """What the layer has made of disc j behind a fold: another stick, or a slip; a code."""
    if S.status[j] == SOLVED:
        return GO_ON
    release(P, S, j)
    return GO_ON if _find_way_out(P, S, W, j) else Outcome.NO_ROOT


@kernel
def free_components(P, S):
    """The components of discs that a jump has taken off h = 0 are fixed from now on."""
    for j in range(P.m):
        if P.kind[j] == DISC and S.status[j] != SOLVED:
            for k in range(j + 1, j + 1 + P.dim[j]):
                S.status[k] = 1


@kernel
def _stands(P, S, j):
    """Whether disc j is at h = 0: it sticks, or has just begun to slip."""
    return P.kind[j] == DISC and (S.status[j] == SOLVED or S.deflate[j] != 0)


@kernel
def _settle_with_others(P, S, R, W):
    """All discs at h = 0, each with what the others do, over and over until none changes; a code.

    Block by block that is the variational inequality on the product of their balls: what one does decides whether
    another slips.
    """
    count = 0
    for j in range(P.m):
        if _stands(P, S, j):
            count += 1
    for _ in range(_SWEEPS if count > 1 else 0):
        change = 0.0
        for j in range(P.m):
            if not _stands(P, S, j):
                continue
            was = S.status[j]
            for k in range(P.dim[j]):
                W.instant.arrival[k] = 0
                W.closing_y[k] = S.mult[j + 1 + k]
            code = settle_disc(P, S, R, W, j, False)
            if code != GO_ON:
                return code
            if S.status[j] == SOLVED:
                S.deflate[j] = 0
            change += 1.0 if S.status[j] != was else 0.0
            for k in range(P.dim[j]):
                change = max(change, abs(S.mult[j + 1 + k] - W.closing_y[k]))
        if change <= _ALIKE:
            break
    return GO_ON


@kernel
def settle_discs(P, S, R, W, jumped):
    """Every disc that has come to h = 0 or whose force has left the friction circle; a code, and whether one has."""
    some, joins = False, False
    for j in range(P.m):
        if P.kind[j] != DISC or not W.instant.hit[j]:
            continue
        came = S.status[j]
        if came == SOLVED and not jumped:
            release(P, S, j)
            record_event(S, R, j, EV_TANGENCY, 0, 1)
            W.instant.came[j] = S.status[j]
            some = True
            continue
        W.instant.came[j] = came
        code = settle_disc(P, S, R, W, j, came != SOLVED and not jumped)
        if code != GO_ON:
            return code, True
        some = joins = True
    if joins:
        for j in range(P.m):
            if P.kind[j] == DISC and not W.instant.hit[j]:
                W.instant.came[j] = S.status[j]
        code = _settle_with_others(P, S, R, W)
        if code != GO_ON:
            return code, True
        for j in range(P.m):
            if P.kind[j] != DISC:
                continue
            came = W.instant.came[j]
            if S.status[j] == SOLVED and came != SOLVED:
                record_event(S, R, j, EV_STICK, came, 0)
            elif came == SOLVED and S.status[j] != SOLVED:
                record_event(S, R, j, EV_RESET, 0, 1)
    return GO_ON, some


@kernel
def resettle_discs(P, S, R, W):
    """Sticking discs whose force has jumped: a code."""
    for j in range(P.m):
        if P.kind[j] != DISC or S.status[j] != SOLVED:
            continue
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        moved = False
        for k in range(j + 1, j + 1 + P.dim[j]):
            moved = moved or not abs(W.g[k]) <= _MOVED
        if moved:
            code = settle_disc(P, S, R, W, j, False)
            return _settle_with_others(P, S, R, W) if code == GO_ON else code
    return GO_ON
