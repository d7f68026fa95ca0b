"""Where another way through a point ends elsewhere, the equations do not say which is taken: it is recorded.

A corner of several switches depends on the ratio of their layers. A start or a reset on several coupled surfaces is
settled from u = 0, as if all layers were entered in their middle; what other corners lead to is looked at in a unit
of its own, which is large and seldom needed.
"""

from numba import types

from ..machine.compiling import kernel, unit
from ..machine.pointers import call_fields, call_layer_unit
from ..state import AMB_CORNER, AMB_REPELLING, SOLVED, Problem, Record, State
from ..step.recording import record_ambiguity
from ..surface.fast import OSCILLATES, SETTLED
from ..surface.layer import ARRIVE
from ..surface.sliding import mask_instant
from ..work import Work

_MOST_CORNERS, _BESIDE_CORNER = 8, 0.999


@kernel
def _keep(P, S, W):
    """Notes what the switches have settled to, before another way there is tried."""
    for j in range(P.m):
        W.instant.status[j] = S.status[j]
        W.instant.mult[j] = S.mult[j]


@kernel
def _take_back(P, S, W):
    """Overwrites S by what was noted last."""
    for j in range(P.m):
        S.status[j] = W.instant.status[j]
        S.mult[j] = W.instant.mult[j]


@kernel
def try_other_ratio(P, S, R, W, size):
    """Runs the corner's layer again with eps_1/eps_2 changed by 10 and 1/10; another outcome is an ambiguity."""
    instant = W.instant
    m, first = P.m, instant.active[0]
    _keep(P, S, W)
    weight = P.weight[first]
    same = True
    for factor in (10.0, 0.1):
        for j in range(m):
            S.status[j] = instant.came[j]
            S.mult[j] = instant.mult[j] if instant.came[j] == SOLVED else float(instant.came[j])
        for a in range(size):
            instant.group[a] = instant.active[a]
            instant.arrival[a] = instant.came[instant.active[a]]
        P.weight[first] = weight * factor
        same = same and call_layer_unit(P.layer_unit, P, S, W, 0, size, 0, 0.0) == SETTLED
        for j in range(m):
            sticks = abs(S.status[j]) != 1 and abs(instant.status[j]) != 1  # one or the other is solved for
            same = same and (sticks or S.status[j] == instant.status[j])
    P.weight[first] = weight
    _take_back(P, S, W)
    if not same:
        record_ambiguity(S, R, first, AMB_CORNER, 0)


@kernel
def _one_motion(P, S, W, size):
    """Whether g is affine in the switches active[:size], with a definite slope: then one motion begins here.

    So it is with Coulomb friction between bodies. Overwrites S.mult.
    """
    active, M, value = W.instant.active, W.linear.matrix, W.linear.rhs
    if size > M.shape[0] or mask_instant(P, S, W):
        return False
    for a in range(size):
        S.mult[active[a]] = 0.0
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for a in range(size):
        value[a] = W.g[active[a]]
    for b in range(size):
        S.mult[active[b]] = 1.0
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        S.mult[active[b]] = 0.0
        for a in range(size):
            M[a, b] = value[a] - W.g[active[a]]
    for b in range(size):
        lam = 0.9 * (-0.7) ** b  # anywhere
        S.mult[active[b]] = lam
        for a in range(size):
            value[a] -= M[a, b] * lam
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for a in range(size):
        if abs(W.g[active[a]] - value[a]) > 1e-9 * (abs(value[a]) + abs(M[a, a])):
            return False
    for a in range(size):
        for b in range(a):
            M[a, b] = M[b, a] = 0.5 * (M[a, b] + M[b, a])
    for c in range(size):  # definite if all pivots are positive
        if not M[c, c] > 1e-9 * abs(M[0, 0]):
            return False
        for a in range(c + 1, size):
            share = M[a, c] / M[c, c]
            for b in range(c + 1, size):
                M[a, b] -= share * M[c, b]
    return True


@unit(types.int64, Problem, State, Record, Work, types.int64, types.int64)
def report_other_motions(P, S, R, W, size, joint):
    """Says so where active[:joint], settled from u = 0, settle otherwise with active[:size] coming from some corner.

    Then several motions begin in this point, and the equations do not say which is taken. S is kept. Returns 0.
    """
    instant = W.instant
    _keep(P, S, W)
    confirmed = _one_motion(P, S, W, joint)
    flipped, other = -1, -1
    for corner in range(0 if confirmed else min(1 << size, _MOST_CORNERS)):
        _take_back(P, S, W)
        for a in range(joint):
            j = instant.active[a]
            instant.group[a] = j
            instant.arrival[a] = 0
            if a < size:
                # A corner and then the one opposite: those count most where there are more than are tried.
                S.mult[j] = _BESIDE_CORNER if ((corner >> 1) >> a & 1) == (corner & 1) else -_BESIDE_CORNER
        outcome = call_layer_unit(P.layer_unit, P, S, W, ARRIVE, joint, 0, 0.0)
        same = True
        for a in range(joint):
            j = instant.active[a]
            near = abs(S.mult[j] - instant.mult[j]) <= (1e-6 if outcome == SETTLED else 1e-3)
            here = near and (S.status[j] == instant.status[j] or outcome == OSCILLATES)
            same = same and here
            if not here:
                other = j
                leaves = S.status[j] != SOLVED and S.status[j] != instant.status[j]
                flipped = j if leaves and outcome != OSCILLATES else flipped
        confirmed = confirmed or same
    _take_back(P, S, W)
    if flipped >= 0:
        record_ambiguity(S, R, flipped, AMB_REPELLING, S.status[flipped])
    elif other >= 0:
        record_ambiguity(S, R, other, AMB_CORNER, 0)
    elif not confirmed:
        # An equilibrium to which the layer comes from nowhere: it stays there only if it begins there.
        record_ambiguity(S, R, instant.active[0], AMB_REPELLING, 0)
    return 0
