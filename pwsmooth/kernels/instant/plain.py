"""The instant that nearly every event is: one switch alone meets its surface or its bound, and g is affine in lambda.

Then g on the far side and its slope decide between crossing and sticking (Filippov's convex combination), without the
layer and without a look at the other switches.
"""

import math

from ..intervals import note_arc
from ..machine.compiling import kernel
from ..outcome import Outcome
from ..state import (
    CONTACT,
    EV_CROSSING,
    EV_STICK,
    EV_TANGENCY,
    GO_ON,
    HELD,
    NOTHING,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
)
from ..step.recording import record_event
from ..surface.sliding import follow, keep_on_surface, mask_solved, surface_speed
from .surface_rates import evaluate_surfaces, note_rests_along, rests_along

_NO_PUSH = 1e-12  # of dg/dlambda


@kernel
def only_one(P, S, W):
    """The switch that alone meets its surface or its bound where nothing else happens or slides, or -1.

    Nearly every instant of a run is one; what follows from it needs no layer and leaves no other switch to look at.
    """
    only = -1
    for j in range(P.m):
        beside = P.kind[j] == CONTACT or P.kind[j] == SECOND_ORDER
        slides = S.status[j] == SOLVED or (S.status[j] == HELD and P.kind[j] == SLIDING)
        if beside or P.nested[j] != 0 or (slides and not W.instant.hit[j]):
            return -1
        if W.instant.hit[j]:
            if only >= 0 or P.kind[j] != SLIDING or S.status[j] == HELD:
                return -1
            only = j
    for i in range(P.m, P.m + P.ne):
        if W.instant.hit[i] or P.nested[i] != 0:
            return -1
    return only if only >= 0 and not P.hidden[only] and P.nz == 0 else -1


@kernel
def cross_stick_or_leave(P, S, R, W, j):
    """What switch j does that alone has met its surface or its bound; -1, with nothing changed, if that is open.

    g is affine in lambda_j: its value on the far side and its slope decide.
    """
    came = S.status[j]
    if came == SOLVED:
        side = W.meeting.exit_side[j]
        S.status[j], S.mult[j], S.deflate[j] = side, float(side), 2
        record_event(S, R, j, EV_TANGENCY, 0, side)
        return GO_ON
    S.mult[j] = float(-came)
    evaluate_surfaces(P, S, W)
    for k in range(P.m):
        if rests_along(P, S, W, k):
            S.mult[j] = float(came)
            return NOTHING
    far, slope = W.g[j], W.G[P.g_diagonal[j]]
    ahead = -came * far  # > 0: the far side carries it on
    if not (ahead - 2.0 * slope > 0.0 and abs(far) > -_NO_PUSH * slope and abs(ahead) < math.inf):
        S.mult[j] = float(came)  # a side does not push: grazing, or rest beyond a bound
        return NOTHING
    S.layers += 1
    S.deflate[j] = 1
    note_arc(S, j, surface_speed(P, W, j))
    if ahead > 0.0:
        S.status[j] = -came
        record_event(S, R, j, EV_CROSSING, came, -came)
        return GO_ON
    S.status[j] = SOLVED
    S.mult[j] -= far / slope
    keep_on_surface(P, S, j, W)
    mask_solved(P, S, W)
    if not follow(P, S, W):
        return Outcome.NO_ROOT
    W.instant.solved_there = 1
    record_event(S, R, j, EV_STICK, came, 0)
    note_rests_along(P, S, R, W, j, came)
    return GO_ON
