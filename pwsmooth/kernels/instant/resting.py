"""Arrival at rest on several surfaces at once, in finite time and without ever faster switching (accumulation.py).

    s = v + |x|**(1/2) sign x,   x' = v,   v' = -2 sign s + d:      x = ((T - t)/2)**2 along s = 0

From T on x = v = 0: the switch of x, a kink, is held at 0, and sign s takes the value d/2 that keeps the speed.
Whether the motion can rest there is not guessed: it does if the surfaces have no speed, every multiplier that is
solved for is in its bounds and pushes back, and the place is that to which the motion has come, within its tolerances.
Chain: surface_rates.py -> **this file** -> instants.py, accumulation.py.
"""

import math

from ..intervals import forget_intervals
from ..machine.compiling import kernel
from ..state import (
    CONTACT,
    CROSSING,
    EV_RESET,
    EV_STICK,
    EV_TANGENCY,
    HELD,
    KINK,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
    TAPE_MEET,
    TAPE_OTHER,
)
from ..step.finer import SWITCHING, follow_as_asked
from ..step.recording import put_on_tape, record_event
from ..surface.sliding import follow, keep_on_surface, mask_solved, surface_rounding, surface_tolerance
from ..surface.sparse import entry
from .surface_rates import approach_speed, evaluate_surfaces, order_of_leaving, stop_normal_speed

_SWEEPS = 4
_AS_NEAR = 10.0  # tolerances
_SHARE_OF_ARC = 1e-6
_HALVINGS = 60
_NO_SPEED = 1e-9  # of what pushes back


@kernel
def _rests_now(P, S, j):
    """Whether multiplier j belongs to a switch that rests on its surface."""
    return P.kind[j] < CONTACT and (S.status[j] == SOLVED or S.status[j] == HELD)


@kernel
def _rest_with(P, C, S, W, j):
    """Switch j, and with it the kinks on whose surface the motion now stands within tolerance, are held."""
    for k in range(P.m):
        continuous = P.kind[k] == KINK or P.kind[k] == CROSSING
        if k != j and (not continuous or abs(S.status[k]) != 1):
            continue
        evaluate_surfaces(P, S, W)
        if k == j or abs(W.h[k]) <= surface_tolerance(P, C, W, k):
            S.status[k] = SOLVED if P.kind[k] == SECOND_ORDER else HELD
            S.mult[k] = 0.0


@kernel
def _is_driven(P, S, W, k):
    """Whether a multiplier that is solved for acts on the speed of surface k."""
    for i in range(P.m):
        if S.status[i] == SOLVED and entry(P.g_row, P.g_col, W.G, k, i) != 0.0:
            return True
    return False


@kernel
def _put_on_surfaces(P, C, S, W, j):
    """Moves S.x to where the surfaces that are rested on and their speeds are 0; False if it does not come there."""
    for sweep in range(_SWEEPS):
        for k in range(P.m):
            if _rests_now(P, S, k):
                keep_on_surface(P, S, k, W)
        _rest_with(P, C, S, W, j)
        mask_solved(P, S, W)
        if not follow(P, S, W):
            return False
        still = True
        for k in range(P.m):
            if not _rests_now(P, S, k):
                continue
            # By its states alone a speed is stopped however small it is; by what is solved for it is 0 to rounding.
            moves = abs(approach_speed(P, S, k, W)) > W.instant.rest_speed
            still = still and not moves
            if moves or (sweep == 0 and not _is_driven(P, S, W, k)):
                stop_normal_speed(P, S, k, W, False)
        if still and sweep > 0:
            return True
    return False


@kernel
def _stays(P, C, S, W, left):
    """Whether what is solved for pushes back, what is held stays, and S.x is where x was going.

    Where a slide comes with more of a load than its multiplier can bear at rest, it is let go there, and the rest ends
    as it begins: what is held follows (settling.release_held).
    """
    let_go = False
    for k in range(P.m):
        if P.kind[k] < CONTACT and S.status[k] == SOLVED:
            if not (P.hidden[k] or W.G[P.g_diagonal[k]] < 0.0):
                return False
            if not abs(S.mult[k]) <= 1.0:
                if P.kind[k] != SLIDING or W.instant.status[k] != SOLVED or not abs(S.mult[k]) < math.inf:
                    return False
                S.status[k] = 1 if S.mult[k] > 0.0 else -1
                S.mult[k] = float(S.status[k])
                S.deflate[k] = 2
                let_go = True
    for i in range(P.n):
        near = _AS_NEAR * (C.atol[i] + C.rtol * abs(W.instant.x[i]))
        if W.step.nears == SWITCHING:
            near = min(near, _SHARE_OF_ARC * abs(W.step.met[0, i] - W.step.met[1, i]))
        if not abs(S.x[i] - W.instant.x[i]) <= near + 2.0 * left * abs(W.instant.dx[i]):
            return False
    for k in range(0 if let_go else P.m):
        held = S.status[k] == HELD and (P.kind[k] == KINK or P.kind[k] == CROSSING)
        if held and order_of_leaving(P, C, S, W, k) != 0:
            return False
    return True


@kernel
def come_to_rest(P, C, S, R, W, j, left):
    """Whether the motion, which comes to the surface of switch j after `left`, rests there; S is put there if so."""
    instant, t = W.instant, S.t
    evaluate_surfaces(P, S, W)
    for i in range(P.n):
        instant.x[i], instant.dx[i] = S.x[i], W.dx[i]
        S.x[i] += left * W.dx[i]
    S.t += left
    for k in range(P.m):
        instant.status[k], instant.mult[k] = S.status[k], S.mult[k]
    S.status[j], S.mult[j] = HELD, 0.0
    if _put_on_surfaces(P, C, S, W, j) and _stays(P, C, S, W, left):
        for k in range(P.m):
            if S.status[k] == instant.status[k]:
                continue
            forget_intervals(S.last[k], S.t)
            if abs(S.status[k]) == 1:
                record_event(S, R, k, EV_TANGENCY, 0, S.status[k])
            else:
                S.deflate[k] = 0
                record_event(S, R, k, EV_STICK, instant.status[k], 0)
        follow_as_asked(P, C, W)
        return True
    S.t = t
    for i in range(P.n):
        S.x[i] = instant.x[i]
    for k in range(P.m):
        S.status[k], S.mult[k] = instant.status[k], instant.mult[k]
    return False


@kernel
def _stands_in(P, S, W, j, k):
    """Whether kink j stands in surface k: away from where both are 0 the surface depends on its side."""
    keep = S.mult[j]
    for i in range(P.n):
        W.instant.x[i] = S.x[i]
    for e in range(P.dh_row[j], P.dh_row[j + 1]):
        S.x[P.dh_col[e]] += (1.0 + abs(S.x[P.dh_col[e]])) * (1.0 + 0.3 * (e - P.dh_row[j]))
    S.mult[j] = 1.0
    evaluate_surfaces(P, S, W)
    above = W.h[k]
    S.mult[j] = -1.0
    evaluate_surfaces(P, S, W)
    S.mult[j] = keep
    for i in range(P.n):
        S.x[i] = W.instant.x[i]
    return not W.h[k] == above  # also where one side has no value there, as a root


@kernel
def rests_on_kink(P, C, S, R, W, j):
    """Whether a slide comes to rest on the surface of kink j, which stands in that on which it slides."""
    for k in range(P.m):
        slides = P.kind[j] == KINK and P.kind[k] == SLIDING and S.status[k] == SOLVED and P.nested[k] != 0
        if slides and _stands_in(P, S, W, j, k):
            return come_to_rest(P, C, S, R, W, j, 0.0)
    return False


@kernel
def stay_at_rest(P, C, S, R, W):
    """Where a motion begins on the surfaces of a kink and of a switch in which it stands: both hold it, if it rests."""
    hit = W.instant.hit
    for j in range(P.m):
        for k in range(P.m if P.kind[j] == KINK and hit[j] and abs(S.status[j]) == 1 else 0):
            if P.kind[k] != SLIDING or not P.nested[k] or not hit[k] or abs(S.status[k]) != 1:
                continue
            if not _stands_in(P, S, W, j, k):
                continue
            side = S.status[k]
            S.status[k], S.mult[k] = SOLVED, 0.0
            if come_to_rest(P, C, S, R, W, j, 0.0):
                hit[j] = hit[k] = False
            else:
                S.status[k], S.mult[k] = side, float(side)


@kernel
def _at(P, S, W, j, lam, k):
    """Surface k with the multiplier of switch j at lam, which it keeps."""
    S.mult[j] = lam
    evaluate_surfaces(P, S, W)
    return W.h[k]


@kernel
def _changes_side_with(P, S, W, j, k):
    """Whether the surface of switch k, which may slide, jumps through 0 where switch j changes its side."""
    if k == j or P.nested[k] == 0 or P.kind[k] != SLIDING or abs(S.status[k]) != 1:
        return False
    side = S.status[j]
    here, there = _at(P, S, W, j, float(side), k), _at(P, S, W, j, float(-side), k)
    S.mult[j] = float(side)
    return here * S.status[k] > 0.0 and there * here < 0.0 and abs(there) > surface_rounding(P, S, k, W)


@kernel
def _push_back(P, S, W, j, k):
    """The speed with which the slower side of surface j leads back to it, by switch k, which changes its side with j;
    0 if one does not."""
    here = -S.status[j] * approach_speed(P, S, j, W)
    back = here > W.instant.rest_speed
    S.mult[j], S.mult[k] = float(-S.status[j]), float(-S.status[k])
    there = S.status[j] * approach_speed(P, S, j, W)
    back = back and there > W.instant.rest_speed
    S.mult[j], S.mult[k] = float(S.status[j]), float(S.status[k])
    return min(here, there) if back else 0.0


@kernel
def _moves_states(P, S, W, j):
    """Whether the rates change with the multiplier of switch j."""
    keep = S.mult[j]
    evaluate_surfaces(P, S, W)
    for i in range(P.n):
        W.instant.dx[i] = W.dx[i]
    S.mult[j] = 1.0 if keep < 0.5 else 0.0
    evaluate_surfaces(P, S, W)
    S.mult[j] = keep
    for i in range(P.n):
        if W.dx[i] != W.instant.dx[i]:
            return True
    return False


@kernel
def _put_at_zero(P, S, W, j, k):
    """Overwrites S.mult[j] by that with which surface k, which jumps through 0 with switch j, is 0."""
    low, high, above = -1.0, 1.0, _at(P, S, W, j, 1.0, k) > 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if (_at(P, S, W, j, middle, k) > 0.0) == above:
            high = middle
        else:
            low = middle
    S.mult[j] = 0.5 * (low + high)


@kernel
def hold_by_what_jumps(P, S, R, W):
    """Where both sides of a surface lead back to it by a switch whose own surface jumps with it, both hold the motion:
    the one that is crossed has the multiplier with which the other surface is 0, and that one is solved for.

    As x = 0 with x' = -sign(x/2 + lambda), lambda of x: there lambda is 0. So where both surfaces say the same of the
    states; else nothing holds.
    """
    for j in range(P.m):
        if not W.instant.hit[j] or abs(S.status[j]) != 1 or P.kind[j] > CROSSING:
            continue
        k = -1
        for i in range(P.m):
            if _changes_side_with(P, S, W, j, i):
                k = i if k == -1 else P.m
        push = _push_back(P, S, W, j, k) if 0 <= k < P.m else 0.0
        if push == 0.0:
            continue
        came, was = S.status[j], S.status[k]
        for i in range(P.m):
            W.instant.mult[i] = S.mult[i]
        _put_at_zero(P, S, W, j, k)
        S.status[j], S.status[k], S.mult[k] = HELD, SOLVED, 0.0
        mask_solved(P, S, W)
        holds = follow(P, S, W) and abs(S.mult[k]) <= 1.0
        if holds and abs(approach_speed(P, S, j, W)) <= _NO_SPEED * push:
            if R.tape.shape[0] > 0 and _moves_states(P, S, W, j):
                put_on_tape(P, S, R, TAPE_MEET, TAPE_OTHER, j, 0, 0.0)  # its deviation is not followed
            S.deflate[j] = 0
            S.deflate[k] = 1
            forget_intervals(S.last[j], S.t)
            record_event(S, R, j, EV_RESET, came, 0)
            record_event(S, R, k, EV_STICK, was, 0)
        else:
            S.status[j], S.status[k] = came, was
            for i in range(P.m):
                S.mult[i] = W.instant.mult[i]


@kernel
def _is_held_by_a_jump(P, S, W, j):
    """Whether switch j is solved for because its surface jumps through 0 with one that is HELD."""
    for i in range(P.m if P.nested[j] != 0 else 0):
        if S.status[i] == HELD and (P.kind[i] == KINK or P.kind[i] == CROSSING):
            keep = S.mult[i]
            ends = _at(P, S, W, i, 1.0, j) * _at(P, S, W, i, -1.0, j)
            S.mult[i] = keep
            if ends < 0.0:
                return True
    return False


@kernel
def follow_by_a_jump(P, S, W, j):
    """Whether switch j is held by a jump: then it has, once the rates have jumped, the multiplier with which the motion
    stays, or the side of the bound beyond which that is. Its residual says nothing of the way there."""
    if not _is_held_by_a_jump(P, S, W, j):
        return False
    mask_solved(P, S, W)
    if not follow(P, S, W):
        return False
    if abs(S.mult[j]) > 1.0:
        S.status[j] = 1 if S.mult[j] > 0.0 else -1
        S.mult[j], S.deflate[j] = float(S.status[j]), 1
    return True
