"""The layer system: what happens on a surface h = 0 in the fast time t/eps.

    du_j/dtau = w_j g_j(t, x, lambda, z),   lambda_j = Lambda(u_j),   dz/dtau = r Q(t, x, lambda, z)

for every switch that is on its surface, t and x frozen, w_j = eps_1/eps_j. One switch without layered states
moves monotonically in lambda, so the first zero of g on its way decides. Otherwise the system is integrated.
"""

import math

from numba import types

from ..machine.compiling import kernel, unit
from ..machine.pointers import call_fields
from ..state import COMPONENT, SLIDING, SOLVED, Problem, State
from ..work import Work
from .fast import LOST, SETTLED, integrate, push_toward, relax, relax_from_zero, sigmoid, sigmoid_inverse
from .sliding import follow, mask_instant, mask_solved
from .sparse import link

# Tasks of the layer unit: j and toward are a switch and a direction; ARRIVE takes j = size of W.instant.group.
ARRIVE, LEAVE_FOLD, FIRST_ZERO = range(3)
_SCAN = 48  # intervals over [-1, 1] in which the first zero of a hidden g is sought


@kernel
def _prepare(P, S, W, j):
    """Masks the multipliers of every instant, without switch j."""
    W.layer.masked = 1 if mask_instant(P, S, W) else 0
    W.mask[j] = 0


@kernel
def _first_zero(P, S, W, j, start, toward, frozen):
    """First lambda_j from `start` on the way to `toward` (+1 or -1) where g_j stops pushing that way.

    Returns whether there is one; leaves it in S.mult[j] (else the end of the way).
    """
    _prepare(P, S, W, j)
    end = float(toward)
    push = push_toward(P, S, W, j, start, toward, frozen)
    if push <= 0.0:
        return True
    if not P.hidden[j] and not frozen:
        last = push_toward(P, S, W, j, end, toward, frozen)
        if last > 0.0:
            return False
        S.mult[j] = start + (end - start) * push / (push - last)
        return True
    steps = max(4, int(math.ceil(_SCAN * abs(end - start) / 2.0)))
    a, before, push_before = start, start, push
    for i in range(1, steps + 1):
        b = start + (end - start) * i / steps if i < steps else end
        ahead = push_toward(P, S, W, j, b, toward, frozen)
        if ahead <= 0.0:
            _bisect(P, S, W, j, a, b, toward, frozen)
            return True
        if i > 1 and push <= push_before and push <= ahead:
            # An interior minimum: the pair of zeros beside a fold may hide in it.
            c = _lowest(P, S, W, j, before, b, toward, frozen)
            if push_toward(P, S, W, j, c, toward, frozen) <= 0.0:
                _bisect(P, S, W, j, before, c, toward, frozen)
                return True
        before, push_before = a, push
        a, push = b, ahead
    S.mult[j] = end
    return False


@kernel
def _bisect(P, S, W, j, a, b, toward, frozen):
    """Leaves in S.mult[j] the zero of g_j between a (pushing toward) and b (not)."""
    for _ in range(80):
        c = 0.5 * (a + b)
        if c == a or c == b:
            break
        if push_toward(P, S, W, j, c, toward, frozen) > 0.0:
            a = c
        else:
            b = c
    S.mult[j] = 0.5 * (a + b)


@kernel
def _lowest(P, S, W, j, a, b, toward, frozen):
    """Minimum of toward * g_j in [a, b] by golden sections, ended as soon as a value is not positive."""
    ratio = 0.6180339887498949
    for _ in range(50):
        c, d = b - ratio * (b - a), a + ratio * (b - a)
        push_c = push_toward(P, S, W, j, c, toward, frozen)
        if push_c <= 0.0:
            return c
        push_d = push_toward(P, S, W, j, d, toward, frozen)
        if push_d <= 0.0:
            return d
        if push_c < push_d:
            b = d
        else:
            a = c
    return 0.5 * (a + b)


@kernel
def _close(P, S, W):
    """Polishes every solved multiplier; SETTLED or LOST."""
    mask_solved(P, S, W)
    return SETTLED if follow(P, S, W) else LOST


@kernel
def _settle_one(P, S, W, j, start, toward):
    """One switch without layered states, or with two-stage ones: the first zero of g on its way decides."""
    two_stage = P.nz > 0
    found = _first_zero(P, S, W, j, start, toward, two_stage)
    if found and two_stage:
        left = relax(P, S, W, j, True)
        if left != 0:
            found, toward = False, left
    S.status[j] = SOLVED if found else toward
    if not found:
        S.mult[j] = float(toward)
    return _close(P, S, W)


@kernel
def _arrive(P, S, W, size):
    """Settles the switches group[:size], come to their surfaces from the side `arrival` (0: at rest there, u = 0)."""
    instant = W.instant
    one = size == 1 and (P.nz == 0 or P.ratio[0] == 0.0)
    if one:
        j = instant.group[0]
        side = instant.arrival[0]
        S.mult[j] = float(side)
        if P.nz > 0:
            relax_from_zero(P, S, W, j)
        toward = -side
        if side == 0:
            _prepare(P, S, W, j)
            toward = 1 if push_toward(P, S, W, j, 0.0, 1, P.nz > 0) > 0.0 else -1
        return _settle_one(P, S, W, j, float(side), toward)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    top, slowest = 1e-300, 1.0
    for i in range(size):
        if instant.arrival[i] != 0:
            top = max(top, abs(W.g[instant.group[i]]) * P.weight[instant.group[i]])
    for i in range(P.nz):
        slowest = min(slowest, P.ratio[i])
    # Far enough that fast layered states have settled on the way.
    tail = 1e3 + 50.0 * (top if P.nz > 0 else min(top, 100.0)) / slowest
    for i in range(size):
        j = instant.group[i]
        if P.kind[j] == COMPONENT:
            W.layer.y[i] = tail * S.mult[j] if instant.arrival[i] != 0 else _within(P, S, W, j)
        elif instant.arrival[i] == 0:
            W.layer.y[i] = sigmoid_inverse(P, W, S.mult[j])
        else:
            # Along the straight approach all |h_j| vanish at one instant: |u_j| in the ratio of the speeds.
            share = abs(W.g[j]) * P.weight[j] / top
            W.layer.y[i] = instant.arrival[i] * tail * max(share, 1e-6)
            S.mult[j] = sigmoid(P, W, W.layer.y[i])
    if P.nz > 0:
        relax_from_zero(P, S, W, instant.group[0])
    return integrate(P, S, W, size)


@kernel
def _within(P, S, W, j):
    """The layer's coordinate of component j where lambda of its disc is what its multipliers say."""
    square = 0.0
    for k in range(P.disc_of[j] + 1, P.disc_of[j] + 1 + P.dim[P.disc_of[j]]):
        square += S.mult[k] ** 2
    size = math.sqrt(square)
    return sigmoid_inverse(P, W, size) * S.mult[j] / size if size > 0.0 else 0.0


@kernel
def _leave_fold_of_disc(P, S, W, j):
    """After a fold of the root of a disc, met along component j: on from there along its arc."""
    disc = P.disc_of[j]
    step, d = 0.0, P.dim[disc]
    for k in range(disc + 1, disc + 1 + d):
        step = max(step, abs(W.arc.mult[1 + k]))
    for k in range(d):
        i = disc + 1 + k
        S.mult[i] += 1e-3 * W.arc.mult[1 + i] / step
        W.instant.group[k] = i
    for k in range(d):
        W.layer.y[k] = _within(P, S, W, disc + 1 + k)
    return integrate(P, S, W, d)


@kernel
def _leave_fold(P, S, W, j, toward):
    """After a fold of switch j's root the layer decides again, going on in the direction `toward`."""
    instant = W.instant
    size = 1
    instant.group[0] = j
    link(P, S, W, j)
    for i in range(P.m):
        if i != j and W.linear.linked[i] and S.status[i] == SOLVED and P.kind[i] == SLIDING:
            instant.group[size] = i
            size += 1
    fold = S.mult[j]
    if size == 1 and P.nz == 0 and toward * fold >= 1.0 - 1e-6:
        # A fold at the bound itself, where a tangency would be: no lambda is left to go on to.
        S.status[j] = toward
        S.mult[j] = float(toward)
        return _close(P, S, W)
    if size == 1 and P.nz == 0:
        _prepare(P, S, W, j)
        # g vanishes to second order here: start where it pushes clearly.
        ahead = fold + 1e-6 * toward
        if push_toward(P, S, W, j, ahead, toward, False) <= 0.0:
            ahead = fold + 1e-3 * toward
        return _settle_one(P, S, W, j, ahead, toward)
    S.mult[j] = fold + 1e-3 * toward
    if P.nz > 0:
        relax_from_zero(P, S, W, j)
        if size == 1 and P.ratio[0] == 0.0:
            left = relax(P, S, W, j, True)
            if left != 0:
                S.status[j] = left
                S.mult[j] = float(left)
            return _close(P, S, W)
    for i in range(size):
        W.layer.y[i] = sigmoid_inverse(P, W, S.mult[instant.group[i]])
    return integrate(P, S, W, size)


@unit(types.int64, Problem, State, Work, types.int64, types.int64, types.int64, types.float64)
def layer(P, S, W, task, j, toward, start):
    """Overwrites S.mult and S.status; SETTLED, OSCILLATES or LOST (FIRST_ZERO: 1 if found, lambda in S.mult[j])."""
    if task == ARRIVE:
        return _arrive(P, S, W, j)
    if task == LEAVE_FOLD and P.kind[j] == COMPONENT:
        return _leave_fold_of_disc(P, S, W, j)
    if task == LEAVE_FOLD:
        return _leave_fold(P, S, W, j, toward)
    return 1 if _first_zero(P, S, W, j, start, toward, P.nz > 0 and P.ratio[0] == 0.0) else 0
