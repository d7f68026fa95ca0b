"""Discs at an instant: a vector surface is reached, left, or its force has jumped.

At h = 0 the layer decides, w' = G(Lambda(|w|) w/|w|): it comes to a root of G in the disc, a stick, or runs out in a
direction n with G(n) = c n, c > 0, in which the slip goes on. Where G is affine in lambda and pushes back in every
direction there is one of the two and no layer is needed (the variational inequality of maximum dissipation).
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_layer_unit, call_linear, call_newton
from ..outcome import Outcome
from ..state import (
    AMB_GRAZING,
    AMB_NEAR_MISS,
    AMB_REPELLING,
    COMPONENT,
    CONTACT,
    DISC,
    EV_CROSSING,
    EV_RESET,
    EV_STICK,
    EV_TANGENCY,
    GO_ON,
    GROWS,
    HELD,
    NOTHING,
    SLIDING,
    SOLVED,
)
from ..step.recording import record_ambiguity, record_event
from ..surface.layer import ARRIVE
from ..surface.sliding import (
    INSIDE,
    keep_at_rest,
    mask_solved,
    put_in_slip,
    surface_tolerance,
)
from ..surface.sparse import link
from ..surface.vector import begins, own_slopes, push_of_disc, pushes_back, slopes_of_disc, turn
from .settling import layer_code, settle_arrivals, settle_at_rest
from .surface_rates import (
    FAINT,
    look_ahead,
    look_back,
    settle_beside,
)
from .together import depend, settle_dependent, stand_still

ALONE, AT_REST, ARRIVING = range(3)  # how discs are settled: without switches, or with those at their surfaces
_SWEEPS, _ALIKE = 200, 1e-10  # of discs that meet at an instant, and the change of lambda that ends them
_BOUND = 1e-13  # by which lambda . lambda may exceed 1 in a stick
_MOVED = 1e-12  # of G, above which something acts
_SAME = 1e-9  # of lambda: by less the force of a stick has not jumped
_ALONG = 0.9  # cosine: h/|h| next to h = 0 is made of roundings
_NUDGE = 1e-4  # of lambda, from a root that repels
_STILL = 100.0  # tolerances of h: what may be left of a slip where another one has come to rest, as in step/resting.py


@kernel
def hold(P, S, j):
    """From now on disc j sticks."""
    S.status[j], S.mult[j] = SOLVED, INSIDE
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.status[k] = SOLVED


@kernel
def release(P, S, j):
    """From now on disc j slips, at first in the direction of the lambda that it has."""
    size = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        size += S.mult[k] ** 2
    size = math.sqrt(size)
    S.status[j], S.mult[j], S.deflate[j] = 1, INSIDE, 1
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.status[k] = 1
        S.deflate[k] = 0
        S.mult[k] = S.mult[k] / size if size > 0.0 else 1.0 if k == j + 1 else 0.0


@kernel
def _settle_without_force(P, S, W, j):
    """Disc j at h = 0, where its lambda does not act: it is carried away, or stays as long as nothing moves it."""
    push = push_of_disc(P, S, W, j)
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.mult[k] = W.g[k] if push > _MOVED else 0.0
    if push > _MOVED:
        release(P, S, j)
    else:
        _rest_without_force(P, S, j, 0.0)


@kernel
def _rest_without_force(P, S, j, mult):
    """Disc j is HELD at h = 0; mult is 0 if nothing acts on it, INSIDE if its friction begins to."""
    S.status[j], S.mult[j], S.deflate[j] = HELD, mult, GROWS if mult > 0.0 else 0
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.status[k] = HELD


@kernel
def _rest_ahead(P, S, W, j):
    """As look_ahead, with disc j at rest there: what only its slip would bring is no friction that holds it."""
    look_ahead(P, S, W)
    put_in_slip(P, S, j, 0.0, S.mult, W)


@kernel
def _has_no_strength(P, S, W, j):
    """Whether the lambda of disc j does not act now, or only begins to."""
    now = slopes_of_disc(P, S, W, j)
    _rest_ahead(P, S, W, j)
    later = slopes_of_disc(P, S, W, j)
    look_back(P, S, W)
    return now <= FAINT * later


@kernel
def _find_way_out(P, S, W, j):
    """Newton's method for G(n) = c n, |n| = 1 from the direction in S.mult; False if it does not converge to c > 0."""
    c, change = 0.0, math.inf
    S.mult[j] = INSIDE
    for sweep in range(60):
        slopes_of_disc(P, S, W, j)
        push_of_disc(P, S, W, j)
        if sweep == 0:
            for k in range(j + 1, j + 1 + P.dim[j]):
                c += S.mult[k] * W.g[k]
        c, change = turn(P, S, W, j, c)
        if change <= 1e-13 or not change < math.inf:
            break
    S.mult[j] = INSIDE
    return change <= 1e-13 and c > 0.0


@kernel
def _slows(P, S, W, j):
    """The rate at which disc j comes to rest in the direction of S.mult; the rates of the states are in W.dx."""
    push_of_disc(P, S, W, j)
    rate = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        rate -= S.mult[k] * W.g[k]
    return rate


@kernel
def _only_touches(P, S, W, j):
    """Whether the lambda that would hold disc j leaves the friction circle so soon that the slip, were it not held,
    would dip below h = 0 by no more than what is next to it within rounding, b = W.meeting.blurred, twice: it may have
    been taken to h = 0 from as far. S.mult is its direction from then on.

        |h|' = -s + c t,   a dip of s^2/(2 c) < 2 b:      c t > 2 s at t = 8 b/s
    """
    size = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        size += S.mult[k] ** 2
    size = math.sqrt(size)
    if size < 0.5:  # far from the circle
        return False
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.mult[k] /= size
    t, slope = S.t, slopes_of_disc(P, S, W, j)
    slows = max(_slows(P, S, W, j), _SAME * slope)
    ahead = 8.0 * W.meeting.blurred[j] / slows
    for i in range(P.n):
        W.instant.x[i] = S.x[i]
        S.x[i] += ahead * W.dx[i]
    S.t += ahead
    touches = _slows(P, S, W, j) <= -slows
    S.t = t
    for i in range(P.n):
        S.x[i] = W.instant.x[i]
    if not touches:
        for k in range(j + 1, j + 1 + P.dim[j]):
            S.mult[k] *= size
        mask_solved(P, S, W)
        call_newton(P.newton_unit, P, S, W)
    return touches


@kernel
def _goes_on(P, S, W, j):
    """Whether the way out of disc j is that by which it came: a force that carries it off would not have let it come,
    but for rounding."""
    along = 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        along += S.mult[k] * W.instant.mult[k]
    return along >= _ALONG


@kernel
def _slip_on(S, R, W, j):
    """Disc j has only touched h = 0: that is no event."""
    record_ambiguity(S, R, j, AMB_GRAZING, 0)
    W.instant.hit[j] = False


@kernel
def _others_hold(P, S):
    """Whether contacts or switches may keep surfaces of a disc at 0."""
    some = len(P.contact) > 0
    for k in range(P.m):
        some = some or (P.kind[k] == SLIDING and S.status[k] == SOLVED)
    return some


@kernel
def settle_disc(P, S, R, W, j, arrives):
    """Disc j is at h = 0: it sticks, or slips on in the direction that is left in S.mult; a code.

    It comes in the direction of slip in the components' multipliers (`arrives`), or from the lambda that stands there.
    """
    W.meeting.widest[j] = 0.0  # the next slip has its own scale
    for k in range(j + 1, j + 1 + P.dim[j]):
        W.instant.mult[k] = S.mult[k]
    hold(P, S, j)
    keep_at_rest(P, S, W)
    if len(P.contact) > 0:
        stand_still(P, S, W)
    for k in range(j + 1, j + 1 + P.dim[j]):
        W.together.move[k] = 0.0
    if depend(P, S, W, j, False):
        return settle_dependent(P, S, R, W, False)
    if not _has_no_strength(P, S, W, j):
        if _others_hold(P, S) and depend(P, S, W, j, True):
            return settle_dependent(P, S, R, W, False)
        return _settle_one(P, S, R, W, j, arrives)
    if push_of_disc(P, S, W, j) > _MOVED:  # as where lambda stands beside |h| alone
        _settle_without_force(P, S, W, j)
        return GO_ON
    code = GO_ON
    _rest_ahead(P, S, W, j)
    if slopes_of_disc(P, S, W, j) <= FAINT * push_of_disc(P, S, W, j):
        _settle_without_force(P, S, W, j)
    else:
        code = _settle_one(P, S, R, W, j, False)
    for k in range(j, j + 1 + P.dim[j]):
        W.moment[P.n + k] = S.mult[k]
    look_back(P, S, W)
    if S.status[j] == SOLVED:
        _rest_without_force(P, S, j, INSIDE)
    return code


@kernel
def _settle_one(P, S, R, W, j, arrives):
    """As settle_disc, of a disc that is held by itself."""
    d, may_touch = P.dim[j], arrives and W.meeting.blurred[j] > 0.0
    slope = slopes_of_disc(P, S, W, j)
    push = push_of_disc(P, S, W, j)
    strict = pushes_back(P, W, j)
    if P.hidden[j + 1] == 0 and strict:
        mask_solved(P, S, W)
        if call_newton(P.newton_unit, P, S, W) == 0:
            return Outcome.NO_ROOT
        if S.mult[j] <= 1.0 + max(_BOUND, W.onset.allowed[j]):
            if may_touch and _only_touches(P, S, W, j):
                release(P, S, j)
                _slip_on(S, R, W, j)
            else:
                if S.mult[j] > 1.0 + _BOUND:
                    record_ambiguity(S, R, j, AMB_GRAZING, 1)
                S.mult[j] = min(S.mult[j], INSIDE)
            return GO_ON
        release(P, S, j)
        if not _find_way_out(P, S, W, j):
            return Outcome.NO_ROOT
        if may_touch and _goes_on(P, S, W, j):
            _slip_on(S, R, W, j)
        return GO_ON
    if not arrives and strict and push <= _SAME * slope:
        mask_solved(P, S, W)
        return GO_ON if call_newton(P.newton_unit, P, S, W) != 0 else Outcome.NO_ROOT
    S.layers += 1
    if not arrives and push <= _MOVED and not strict:
        record_ambiguity(S, R, j, AMB_REPELLING, 0)
        W.instant.mult[j + 1] += _NUDGE
    for k in range(d):
        S.mult[j + 1 + k] = W.instant.mult[j + 1 + k]
        W.instant.group[k] = j + 1 + k
        W.instant.arrival[k] = 1 if arrives else 0
    code = layer_code(P, S, R, j, call_layer_unit(P.layer_unit, P, S, W, ARRIVE, d, 0, 0.0))
    if code == GO_ON and arrives and S.status[j] == SOLVED:
        _note_near_miss(P, S, R, W, j)
    return slip_by_layer(P, S, W, j) if code == GO_ON else code


@kernel
def _note_near_miss(P, S, R, W, j):
    """Records a stick that only the motion exactly to h = 0 finds: its force exceeds the friction of any slip."""
    size = math.sqrt(S.mult[j])
    if size == 0.0:
        return
    for k in range(j, j + 1 + P.dim[j]):
        W.instant.mult[k] = S.mult[k]
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.mult[k] /= size
    if _find_way_out(P, S, W, j):
        record_ambiguity(S, R, j, AMB_NEAR_MISS, 0)
    for k in range(j, j + 1 + P.dim[j]):
        S.mult[k] = W.instant.mult[k]


@kernel
def slip_by_layer(P, S, W, j):
    """What the layer has made of disc j behind a fold: another stick, or a slip; a code."""
    if S.status[j] == SOLVED:
        return GO_ON
    release(P, S, j)
    return GO_ON if _find_way_out(P, S, W, j) else Outcome.NO_ROOT


@kernel
def free_components(P, S, W):
    """The components of discs that a jump has taken off h = 0 are fixed from now on; their slip has its own scale."""
    for j in range(P.m):
        if P.kind[j] == DISC and S.status[j] == 1:
            W.meeting.widest[j] = 0.0
            for k in range(j + 1, j + 1 + P.dim[j]):
                S.status[k] = 1


@kernel
def _stands(P, S, j):
    """Whether disc j is at h = 0: it sticks, or has just begun to slip."""
    return (P.kind[j] == DISC and S.status[j] == SOLVED) or begins(P, S, j)


@kernel
def _settle_switches(P, C, S, R, W, how):
    """The switches that come to their surfaces, from their side or put there by a jump, with the discs as they are; a
    code."""
    instant, size, code = W.instant, 0, GO_ON
    for j in range(P.m):
        comes = instant.hit[j] and P.kind[j] == SLIDING and instant.came[j] != SOLVED
        if comes and S.status[j] != HELD:
            instant.active[size] = j
            size += 1
    if how == AT_REST and size > 0:
        return settle_at_rest(P, C, S, R, W, size)
    for a in range(size):
        j = instant.active[a]
        S.status[j] = instant.came[j]
        instant.group[0], instant.arrival[0] = j, S.status[j]
        one = settle_arrivals(P, S, R, W, 1)
        code = code if one == GO_ON else one
    return code


@kernel
def _settle_with_others(P, C, S, R, W, switches):
    """All at h = 0, discs and, AT_REST or ARRIVING but not if ALONE, switches that come there, each with what the
    others do, until none changes; a code.

    Block by block that is the variational inequality on the product of their balls: what one does decides whether
    another slips.
    """
    count, ambiguities = 0, S.ambiguities
    for j in range(P.m):
        if _stands(P, S, j) or (switches != ALONE and W.instant.hit[j] and P.kind[j] == SLIDING):
            count += 1
    for _ in range(_SWEEPS if count > 1 else 0):
        for j in range(P.m):
            W.instant.before[j], W.closing_mult[j] = S.status[j], S.mult[j]
        S.ambiguities = ambiguities
        code = _settle_switches(P, C, S, R, W, switches) if switches != ALONE else GO_ON
        for j in range(P.m):
            if code == GO_ON and _stands(P, S, j):
                code = settle_disc(P, S, R, W, j, False)
                if S.status[j] == SOLVED:
                    S.deflate[j] = 0
        if code != GO_ON:
            return code
        change = 0.0
        for j in range(P.m):
            change += 1.0 if S.status[j] != W.instant.before[j] else 0.0
            if P.kind[j] == COMPONENT or P.kind[j] == SLIDING:
                change = max(change, abs(S.mult[j] - W.closing_mult[j]))
        if change <= _ALIKE:
            break
    return GO_ON


@kernel
def _hold_those_at_rest(P, C, S, W, j):
    """Holds the slipping discs linked to disc j whose |h| is 0 to the tolerance; whether there are any."""
    some = False
    link(P, S, W, j + 1)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for k in range(P.m):
        if P.kind[k] != DISC or S.status[k] != 1 or begins(P, S, k) or k == j:
            continue
        linked, tolerance = False, C.rtol * math.sqrt(W.meeting.widest[k])
        for i in range(k + 1, k + 1 + P.dim[k]):
            linked = linked or W.linear.linked[i] != 0
            tolerance += surface_tolerance(P, C, W, i)
        if linked and W.h[k] <= (_STILL * tolerance) ** 2:
            W.instant.hit[k] = some = True
            hold(P, S, k)
    return some


@kernel
def _arrive_together(P, C, S, W):
    """Discs that are at rest as well where one that they are linked to has come to rest: the points of one body.

    All are held before any is looked at: what one does depends on that the others rest.
    """
    for j in range(P.m):
        if P.kind[j] == DISC and W.instant.hit[j] and S.status[j] == 1 and _hold_those_at_rest(P, C, S, W, j):
            hold(P, S, j)
            stand_still(P, S, W)
            _hold_those_at_rest(P, C, S, W, j)  # two points at rest leave no other moving


@kernel
def settle_discs(P, C, S, R, W, jumped):
    """Every disc that has come to h = 0 or whose force has left the friction circle; a code, and whether one has."""
    some, joins = False, False
    for j in range(P.m):
        if P.kind[j] == DISC:
            W.instant.came[j] = S.status[j]
    if not jumped:
        _arrive_together(P, C, S, W)
    for j in range(P.m):
        if P.kind[j] != DISC or not W.instant.hit[j]:
            continue
        some = True
        if W.instant.came[j] == SOLVED and not jumped:
            W.instant.hit[j] = False
            code = GO_ON
            if depend(P, S, W, j, False):
                for i in range(W.together.size):
                    W.instant.hit[P.disc_of[W.together.comp[i]]] = False
                code = settle_dependent(P, S, R, W, True)
            else:
                release(P, S, j)
            for k in range(P.m):
                if P.kind[k] == DISC and W.instant.came[k] == SOLVED and S.status[k] == 1:
                    record_event(S, R, k, EV_TANGENCY, 0, 1)
                    W.instant.came[k] = 1
            if code != GO_ON:
                return code, True
            continue
        code = settle_disc(P, S, R, W, j, W.instant.came[j] == 1 and not jumped)
        if code != GO_ON:
            return code, True
        joins = True
    if joins:
        code = _settle_with_others(P, C, S, R, W, AT_REST if jumped else ALONE)
        if code != GO_ON:
            return code, True
        for j in range(P.m):
            if P.kind[j] != DISC:
                continue
            came, went = W.instant.came[j], S.status[j]
            if went != 1 and came == 1:
                record_event(S, R, j, EV_STICK, 1, 0)
                settle_beside(P, C, S, R, W)
            elif went == 1 and came != 1:
                record_event(S, R, j, EV_RESET, 0, 1)
            elif went == 1 and W.instant.hit[j]:
                record_event(S, R, j, EV_CROSSING, 1, 1)
    return GO_ON, some


@kernel
def _acts(P, S, W, j):
    """Whether something moves disc j, which stays at h = 0, or its friction acts."""
    return push_of_disc(P, S, W, j) > _MOVED or slopes_of_disc(P, S, W, j) > 0.0


@kernel
def release_discs(P, S, R, W):
    """Discs that stay at h = 0 without friction, on which something has begun to act: a code, NOTHING if none."""
    some = False
    for j in range(P.m):
        if P.kind[j] != DISC or S.status[j] != HELD or S.deflate[j] == GROWS:
            continue
        acts = _acts(P, S, W, j)
        if not acts:
            _rest_ahead(P, S, W, j)
            acts = _acts(P, S, W, j)
            look_back(P, S, W)
        push_of_disc(P, S, W, j)
        if W.h[j] > 0.0 and S.mult[j] == 0.0:
            # It has been carried away by less than a look ahead saw.
            S.status[j], S.mult[j] = 1, 1.0
            free_components(P, S, W)
            some = True
        elif acts:
            code = settle_disc(P, S, R, W, j, False)
            if code != GO_ON:
                return code
            if S.status[j] == 1:
                record_event(S, R, j, EV_RESET, 0, 1)
            some = True
    return GO_ON if some else NOTHING


@kernel
def some_share(P, S):
    """Whether a disc sticks that leaves some of its components to what else holds them."""
    some = False
    for k in range(P.m):
        j = P.disc_of[k]
        some = some or (j >= 0 and S.status[j] == SOLVED and S.status[k] != SOLVED)
    return some


@kernel
def _shares_anew(P, S, W, j):
    """Whether disc j, which sticks, has held something together with a contact that has opened or a switch that has let
    go, or does with one that has closed or stuck."""
    changed, short = False, False
    for k in range(P.m):
        holds = P.kind[k] == CONTACT or P.kind[k] == SLIDING
        changed = changed or (holds and (S.status[k] == SOLVED) != (W.instant.came[k] == SOLVED))
    for k in range(j + 1, j + 1 + P.dim[j]):
        short = short or S.status[k] != SOLVED
    return changed and (short or depend(P, S, W, j, True))


@kernel
def _others_have_changed(P, S, W):
    """Whether contacts may have, or a switch has taken another side at this instant."""
    some = len(P.contact) > 0
    for k in range(P.m):
        some = some or (P.kind[k] < DISC and S.status[k] != W.instant.came[k])
    return some


@kernel
def _is_pushed_back(P, S, W, j):
    """Whether the slip that disc j begins is pushed back, as by a contact that has opened since, or a switch that has
    crossed; one that only passes a touch goes on."""
    if not _others_have_changed(P, S, W):
        return False
    along = _SAME * slopes_of_disc(P, S, W, j)
    push_of_disc(P, S, W, j)
    for k in range(j + 1, j + 1 + P.dim[j]):
        along += S.mult[k] * W.g[k]
    return along < 0.0


@kernel
def resettle_discs(P, C, S, R, W, switches):
    """Sticking discs whose force has jumped, together with those at rest beside them, and with the `switches` that come
    to their surfaces: a code."""
    for j in range(P.m):
        if begins(P, S, j) and _is_pushed_back(P, S, W, j):
            code = settle_disc(P, S, R, W, j, False)
            return _settle_with_others(P, C, S, R, W, switches) if code == GO_ON else code
        if P.kind[j] != DISC or S.status[j] != SOLVED:
            continue
        slope = slopes_of_disc(P, S, W, j)
        if slope == 0.0 and own_slopes(P, S, W, j) == 0.0 and push_of_disc(P, S, W, j) <= _MOVED:
            _settle_without_force(P, S, W, j)  # its load has come to an end
            continue
        # A switch that has settled may have solved for this lambda as well, and left it beyond its bound.
        jumps = S.mult[j] > 1.0 + _SAME or not push_of_disc(P, S, W, j) <= _SAME * slope + _MOVED
        if jumps or _shares_anew(P, S, W, j):
            code = settle_disc(P, S, R, W, j, False)
            return _settle_with_others(P, C, S, R, W, switches) if code == GO_ON else code
    return GO_ON
