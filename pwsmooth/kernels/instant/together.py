"""Discs at rest whose surfaces depend on each other: several points of one rigid body.

Together they hold more than the body can move, so that G = 0 does not say what lambda is; the motion is unique all the
same. The body rests as long as some lambda in the balls has G = 0, and that whose largest |lambda_k| is least says how
much is left: it is found by an interior-point method, and what is redundant in it keeps its value from there on. Where
it reaches 1 the body begins to move, all points in the direction of their lambda but those whose |lambda_k| is less:
about these it turns.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_newton
from ..outcome import Outcome
from ..state import AMB_FORCES, GO_ON, SOLVED
from ..step.recording import record_ambiguity
from ..surface.dependent import gather, holds, independent, put_at_rest, slopes_of_group
from ..surface.sharing import FULL, largest_lambda, least_load, slip_or_stick, square_of_ball
from ..surface.sliding import INSIDE, mask_solved
from .contacts import closed_move, stop_closed

_ALIKE = 1e-12  # of G
_TURNS = 1e-5  # of the balls: a point with more left is one about which the body turns
_NEWTON, _PROJECTIONS = 20, 20


@kernel
def depend(P, S, W, j, alone):
    """Whether surfaces of disc j depend on those of other discs at h = 0, or if it is `alone`, on what keeps one there;
    leaves their group in W.together."""
    q = gather(P, S, W, j)
    if q <= (0 if alone else P.dim[j]):
        return False
    for i in range(q):
        W.together.ball[i] = P.disc_of[W.together.comp[i]]
        S.mult[W.together.ball[i]] = INSIDE
    slopes_of_group(P, S, W, q)
    W.together.size = q
    return independent(W, q) < q


@kernel
def stand_still(P, S, W):
    """Puts S.x where h = 0 for all discs that stand, and the gaps of closed contacts keep: by turns, as each moves the
    others, ever less."""
    put_at_rest(P, S, W)
    for _ in range(_PROJECTIONS):
        if not closed_move(P, S, W):
            return
        stop_closed(P, S, W)
        put_at_rest(P, S, W)
    stop_closed(P, S, W)


@kernel
def _put(S, W):
    """Takes the lambda of the group over."""
    for i in range(W.together.size):
        S.mult[W.together.comp[i]] = W.together.lam[i]


@kernel
def _rests_already(P, S, W, q):
    """Whether the lambda of the group hold it, as another look at an instant finds it."""
    group, pull = W.together, 0.0
    largest = slopes_of_group(P, S, W, q)
    for i in range(q):
        pull = max(pull, abs(group.J[i, i]))
    return largest <= _ALIKE * pull and largest_lambda(W) <= 1.0


@kernel
def _find_shares(P, S, W, leaves):
    """Overwrites lambda of the group in W.together by what holds it, or by that with which it moves on.

    Returns the largest |lambda_k| of the least load, inf if there is none and 0 if it rests already, and whether it
    moves. If its force has not jumped it `leaves` where no lambda in the balls holds it any more.
    """
    group, load, parts = W.together, math.inf, False
    q = group.size
    for i in range(q):
        group.lam[i] = S.mult[group.comp[i]]
    if not leaves and _rests_already(P, S, W, q):
        return 0.0, False
    for _ in range(_NEWTON):
        largest = slopes_of_group(P, S, W, q)
        load = least_load(P, S, W, independent(W, q))
        if not load < math.inf:
            return load, False
        parts = len(P.contact) > 0 and not leaves and not holds(S, W)
        if parts or (load > 1.0 and not leaves):
            for i in range(q):
                group.lam[i] = S.mult[group.comp[i]]
            slip_or_stick(W)
        change = 0.0
        for i in range(q):
            change = max(change, abs(group.lam[i] - S.mult[group.comp[i]]))
        _put(S, W)
        if change <= 1e-9 or largest == 0.0:
            break
    return load, parts or load > 1.0 or (leaves and load > 1.0 - FULL)


@kernel
def settle_dependent(P, S, R, W, leaves):
    """The group of discs in W.together is at h = 0: it rests, or moves on; a code. It `leaves` as _find_shares says."""
    group = W.together
    q = group.size
    stand_still(P, S, W)
    load, moves = _find_shares(P, S, W, leaves)
    if not load < math.inf:
        return Outcome.NO_ROOT
    # What slips keeps its direction; of what sticks as much is solved for as is independent.
    i, sticking = 0, 0
    while i < q:
        square, d = square_of_ball(W, i)
        j = group.ball[i]
        size = math.sqrt(square)
        slips = moves and (size >= load * (1.0 - _TURNS) if leaves else group.free[i] != 0)
        S.mult[j] = INSIDE
        S.status[j] = 1 if slips else SOLVED
        S.deflate[j] = 1 if slips else 0
        for r in range(i, i + d):
            k = group.comp[r]
            S.status[k], S.deflate[k] = 1, 0
            # Of bodies that begin to move with an acceleration it says how.
            group.move[k] = 0.0 if not slips else group.move[k] if leaves else group.g[r]
            if slips:
                S.mult[k] /= size
            else:
                group.comp[sticking] = k
                sticking += 1
        if not slips:
            S.mult[j] = min(square, INSIDE)
        i += d
    group.size = sticking
    if sticking == 0:
        return GO_ON
    slopes_of_group(P, S, W, sticking)
    rank = independent(W, sticking)
    for r in range(rank):
        S.status[group.comp[group.order[r]]] = SOLVED
    if rank < sticking and not leaves:
        record_ambiguity(S, R, P.disc_of[group.comp[0]], AMB_FORCES, 0)
    mask_solved(P, S, W)
    return GO_ON if call_newton(P.newton_unit, P, S, W) != 0 else Outcome.NO_ROOT
