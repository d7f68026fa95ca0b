"""Sliding branches that a step leaves behind: a fold touched from the attracting side.

Near a fold  g(t, lambda) = e(t) - b (lambda - lambda_f)^2, e > 0. Where e only just stays positive, e = d + a
s^2/2, the attracting root has its branch points at s = +-i sqrt(2 d/a), and from a distance its series is that
of d = 0: a straight line through lambda_f, onto the repelling root. A step that ends there is made again, up to
shortly before the point where dg/dlambda = 0: nearer by, its series tells d. What is left at the distance of a
hop is below rounding: then the attracting root beyond is looked for, and the fold recorded as touched.
"""

import math

from ..intervals import time_size
from ..machine.compiling import kernel
from ..machine.pointers import at, call_fields, call_layer_unit, call_linear
from ..outcome import Outcome
from ..state import AMB_FOLD, GO_ON, NOTHING, PAIR, SLIDING, SOLVED
from ..step.recording import record_ambiguity
from ..step.roots import NO_ROOT
from ..step.steps import dot, powers
from ..surface.layer import FIRST_ZERO
from ..surface.sliding import follow, mask_solved
from ..surface.sparse import solve_masked

HOPPED, PASSED, LEFT = range(1, 4)
SHARE_TO_A_FOLD = 0.8  # of the way: five times nearer with every step
SHORTEST_HOP = 0.2  # as a share of it, where the step ends soon behind the fold
# Of lambda: the errors that it leaves in g and in the states are of size HOP^2, below rounding.
HOP = 3e-7
_BEND = 1e-4  # step of lambda for d2g/dlambda2
_NEAR = 4.5e-8  # lambda this near to that of a fold: e = b (lambda - lambda_f)^2 < 2e-15 b, the rounding of g
# The same where the pair's steps are rounding of t: lambda_f - lambda ~ sqrt(t_f - t).
_VANISHED = 1e-5
_LATE = 1e-15  # of the time: its rounding, and that of the step to it


@kernel
def _slope(P, S, W, t, x, mult, j):
    """dg_j/dlambda_j, the other solved multipliers solved along: negative on an attracting root, 0 at a fold."""
    call_linear(P.linear, t, x, mult, P.p, W.G, W.dh)
    if P.g_row[j + 1] - P.g_row[j] == 1:
        return W.G[P.g_diagonal[j]]
    mask_solved(P, S, W)
    for i in range(P.m):
        W.linear.rhs[i] = 0.0
    W.linear.rhs[j] = 1.0
    return 1.0 / W.linear.rhs[j] if solve_masked(P, W) and W.linear.rhs[j] != 0.0 else 0.0


@kernel
def _slope_at(P, C, S, s, j, W):
    """The same where the step's polynomials stand at s; overwrites W.arc.there and W.arc.mult_there with them."""
    arc, rows, mult_row = W.arc, W.step.rows, W.step.mult_row
    powers(W.step.end_power, s)
    for i in range(P.n):
        arc.there[i] = dot(rows[i], W.step.end_power, C.order + 1)
    for i in range(P.m):
        arc.mult_there[i] = (
            dot(rows[mult_row + i], W.step.end_power, C.order + 1) if S.status[i] == SOLVED else S.mult[i]
        )
    return _slope(P, S, W, W.step.start + s, arc.there, arc.mult_there, j)


@kernel
def _bend(P, S, W, t, x, mult, j, slope, way):
    """d2g_j/dlambda_j^2 from the side `way`."""
    keep = mult[j]
    mult[j] = keep + way * _BEND
    bend = (_slope(P, S, W, t, x, mult, j) - slope) / (way * _BEND)
    mult[j] = keep
    return bend


@kernel
def _inward(lam):
    """Sign of a small step that stays in [-1, 1]."""
    return 1.0 if lam < 0.0 else -1.0


@kernel
def _is_near(P, S, W, t, x, mult, j, slope):
    """Whether lambda_j stands within rounding of its fold."""
    return abs(slope) <= _NEAR * abs(_bend(P, S, W, t, x, mult, j, slope, _inward(mult[j])))


@kernel
def _is_fold_ahead(P, S, W, speed, j, slope, h):
    """Whether lambda_j comes to its fold, by a step of length h, as sqrt(t_f - t) does and not as by a touch.

    Then h is its distance over twice its speed, and not over its speed.
    """
    bend = _bend(P, S, W, S.t, S.x, S.mult, j, slope, _inward(S.mult[j]))
    return abs(slope) > 1.5 * h * abs(speed * bend)


@kernel
def where_attraction_ends(P, C, S, s_end, W):
    """Where within the step a root ceases to attract that began as attracting; inf if none does.

    Leaves that switch in W.arc.touched and the length of a hop over the point in W.arc.hop; -1 where a root comes to
    stand within rounding of its fold.
    """
    arc, rows, mult_row, t, h = W.arc, W.step.rows, W.step.mult_row, W.step.start, W.step.length
    found = math.inf
    for j in range(P.m):
        if S.status[j] != SOLVED or not P.hidden[j] or P.kind[j] != SLIDING:
            continue
        last = _slope_at(P, C, S, s_end, j, W)
        speed = abs(at(rows[mult_row + j], 1))
        # At a distance s two roots stand 2 lambda' s apart, and the way along the wrong one is lambda' s^2.
        arc.hop = HOP / (speed + 1e-300)
        if not last >= 0.0:
            call_fields(P.fields, t + s_end, arc.there, arc.mult_there, P.p, W.dx, W.h, W.g)
            if abs(W.g[j]) > 1e-11 * abs(last):
                # Off its root, which is not far from the fold: what is small among all lambda is not small there.
                bend = _bend(P, S, W, t + s_end, arc.there, arc.mult_there, j, last, _inward(arc.mult_there[j]))
                rounding = _NEAR * _NEAR * abs(bend)
                if abs(W.g[j] * bend) > 0.1 * last * last and abs(W.g[j]) > rounding:
                    arc.hop = min(arc.hop, 0.1 * s_end)
                    return 0.5 / SHARE_TO_A_FOLD * s_end
            # The steps by a fold are short: lambda hardly moves.
            if speed * s_end < 1e-6 and _is_near(P, S, W, t + s_end, arc.there, arc.mult_there, j, last):
                first = _slope(P, S, W, t, S.x, S.mult, j)
                if W.step.kind == PAIR and _is_fold_ahead(P, S, W, speed, j, first, s_end):
                    continue  # the pair's steps vanish on the way there
                if not _is_near(P, S, W, t, S.x, S.mult, j, first):
                    arc.touched = j
                    found = -1.0
            continue
        bend = abs(_bend(P, S, W, t + s_end, arc.there, arc.mult_there, j, last, _inward(arc.mult_there[j])))
        if W.step.kind == PAIR and last <= _NEAR * bend:
            continue  # the rounding of a fold that it comes to: its steps vanish there, or the root is lost
        first = _slope_at(P, C, S, 0.0, j, W)
        alone = P.g_row[j + 1] - P.g_row[j] == 1
        if first >= 0.0 and not alone:
            continue  # among several switches a joint root attracts with slopes of either sign
        lo, hi, middle = 0.0, s_end if first < 0.0 else 0.0, first
        for _ in range(60):
            s = 0.5 * (lo + hi)
            if s == lo or s == hi:
                break
            middle = _slope_at(P, C, S, s, j, W)
            if middle < 0.0:
                lo = s
            else:
                hi = s
        if abs(middle) > abs(first) > 0.0:
            continue  # a pole: the others have their fold there
        # Two branches that cross (transcritical) are no fold: they separate linearly in time.
        arc.hop = HOP / max(speed, min(abs(last - first) / (bend * s_end + 1e-300), 1.0 / h))
        arc.touched = j
        return hi
    return found


@kernel
def _past_the_touch(P, S, W, j, toward):
    """Puts switch j, repelling behind a touched fold, on the attracting root beside it; False if there is none."""
    beyond = S.mult[j]
    slope = _slope(P, S, W, S.t, S.x, S.mult, j)
    bend = _bend(P, S, W, S.t, S.x, S.mult, j, slope, -toward)
    top = beyond - slope / bend if bend != 0.0 else math.inf
    if not 0.0 < toward * (beyond - top) < 0.1:
        top = beyond - toward * _BEND  # no simple fold
    if call_layer_unit(P.layer_unit, P, S, W, FIRST_ZERO, j, -toward, top) != 0:
        mask_solved(P, S, W)
        if follow(P, S, W) and toward * (top - S.mult[j]) > 0.0:
            if _slope(P, S, W, S.t, S.x, S.mult, j) < 0.0:
                return True
    S.mult[j] = top
    return False


@kernel
def _root_is_back(P, S, W, j, toward):
    """Whether the root of switch j, which stands at its fold, exists again a hop (W.arc.hop) later."""
    arc = W.arc
    t, hop = S.t, arc.hop
    call_fields(P.fields, t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(P.n):
        arc.there[i] = S.x[i]
        S.x[i] += hop * W.dx[i]
    for i in range(P.m):
        arc.mult_there[i] = S.mult[i]
    S.t = t + hop
    mask_solved(P, S, W)
    W.mask[j] = 0
    back = follow(P, S, W)
    call_fields(P.fields, t + hop, S.x, S.mult, P.p, W.dx, W.h, W.g)
    back = back and toward * W.g[j] <= 0.0
    S.t = t
    for i in range(P.n):
        S.x[i] = arc.there[i]
    for i in range(P.m):
        S.mult[i] = arc.mult_there[i]
    return back


@kernel
def touch(P, C, S, R, how, t_touch, toward, W):
    """What becomes of switch arc.touched at a fold HOPPED over, PASSED by or LEFT by; records what is within rounding.

    Returns a code; NOTHING where it leaves, for which S stands at the fold's lambda.
    """
    j, now = W.arc.touched, S.t
    stays = how == PASSED or (how == HOPPED and _past_the_touch(P, S, W, j, toward))
    if how == LEFT and not _root_is_back(P, S, W, j, toward):
        return GO_ON
    S.t = t_touch
    record_ambiguity(S, R, j, AMB_FOLD, 0 if stays else 1)
    S.t = now
    if C.strict:
        return Outcome.AMBIGUITY
    if how != HOPPED or stays:
        return GO_ON
    _leave(W, toward)
    return NOTHING


@kernel
def _leave(W, toward):
    """Makes the present instant one at which switch W.arc.touched stands at its fold, and nothing else happens."""
    W.meeting.tau[:] = NO_ROOT
    W.instant.met, W.step.length, W.instant.elapsed = NO_ROOT, 0.0, 0.0
    W.instant.fold, W.instant.way, W.instant.at_clock = W.arc.touched, toward, 0


@kernel
def _is_late(P, S, W, j, slope, bend):
    """Whether lambda_j stands as near to its fold as the rounding of a late time can tell: e = slope^2/(2 bend)."""
    arc, late = W.arc, _LATE * time_size(S)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    now = W.g[j]
    for i in range(P.n):
        arc.there[i] = S.x[i] + late * W.dx[i]
    call_fields(P.fields, S.t + late, arc.there, S.mult, P.p, W.dx, W.h, W.g)
    return slope * slope <= 2.0 * abs(bend * (W.g[j] - now))


@kernel
def note_folds_beside(P, S, W):
    """Overwrites instant.folds: the directions in which switches go on that stand at their folds too, as members of a
    family that move alike do; puts them there. What depends on others leaves with these, in one layer."""
    near = _VANISHED if P.pair != 0 else _NEAR
    for j in range(P.m):
        W.instant.folds[j] = 0
        alone = P.g_row[j + 1] - P.g_row[j] == 1 and j != W.instant.fold
        if not alone or S.status[j] != SOLVED or not P.hidden[j] or P.kind[j] != SLIDING:
            continue
        slope = _slope(P, S, W, S.t, S.x, S.mult, j)
        bend = _bend(P, S, W, S.t, S.x, S.mult, j, slope, _inward(S.mult[j]))
        if abs(slope) <= near * abs(bend) or _is_late(P, S, W, j, slope, bend):
            W.instant.folds[j] = 1 if bend > 0.0 else -1
            S.mult[j] -= slope / bend


@kernel
def lost_at_a_fold(P, C, S, R, W, clear):
    """A root that Newton's method has lost, from W.arc.mult_before, within rounding of its fold: it leaves, recorded.

    Not recorded where that is `clear`, as the pair's steps have vanished on the root's way there, whose speed is
    infinite, or where a late time's rounding hides that way, and it does not come back.
    Returns a code; NOTHING where S stands at the fold's lambda.
    """
    for i in range(P.m):
        S.mult[i] = W.arc.mult_before[i]
    for j in range(P.m):
        if S.status[j] != SOLVED or not P.hidden[j] or P.kind[j] != SLIDING:
            continue
        slope = _slope(P, S, W, S.t, S.x, S.mult, j)
        bend = _bend(P, S, W, S.t, S.x, S.mult, j, slope, _inward(S.mult[j]))
        late = not abs(slope) <= (_VANISHED if clear else _NEAR) * abs(bend)
        if not late or _is_late(P, S, W, j, slope, bend):
            W.arc.touched = j
            S.mult[j] -= slope / bend
            toward = (
                1 if bend > 0.0 else -1
            )  # past the fold g has the sign of its bend, and pushes lambda that way
            _leave(W, toward)
            W.arc.hop = HOP * time_size(S)
            if (clear or late) and not _root_is_back(P, S, W, j, toward):
                return NOTHING
            record_ambiguity(S, R, j, AMB_FOLD, 1)
            return Outcome.AMBIGUITY if C.strict else NOTHING
    return Outcome.SINGULAR
