"""The trajectory loop: step, look for the earliest event on the step's polynomial, act, go on.

It reads like the theory: slipping and sliding steps alike give polynomials of the states and of every surface; a
surface met is a crossing, a stick or an event; a solved multiplier that meets its bound is a tangency exit, and one
that meets a zero of dt/dlambda a fold.
"""

import math

from numba import types

from .fresh import restart_flags
from .instant.accumulation import at_once_within
from .instant.contacts import jams, stop_closed
from .instant.discs import release_discs
from .instant.dry_friction import begins_to_part
from .instant.folds import (
    HOP,
    HOPPED,
    LEFT,
    PASSED,
    SHARE_TO_A_FOLD,
    SHORTEST_HOP,
    lost_at_a_fold,
    touch,
    where_attraction_ends,
)
from .instant.invariants import CHECK, broken_by
from .instant.settling import release_held
from .instant.surface_rates import MOMENT, any_is, is_growing, keep_surfaces
from .instant.twofolds import two_fold
from .intervals import time_size
from .machine.compiling import inlined_kernel, kernel, loop_kernel, unit
from .machine.pointers import at, call_onset, call_unit
from .outcome import Outcome
from .state import (
    AGAIN,
    BROKEN,
    CONTACT,
    GO_ON,
    HELD,
    NOTHING,
    PAIR,
    SOLVED,
    START,
    TAPE_MEET,
    TAPE_OTHER,
    Control,
    Problem,
    Record,
    State,
)
from .step.arc import end_of_arc, propose_arc
from .step.finer import follow_as_asked
from .step.looking import shorten_to_fit
from .step.meeting import find_first, first_graze, leave_surfaces, touched_at_the_end
from .step.recording import (
    has_room,
    keep_dense,
    put_on_tape,
    put_step_on_tape,
    record_grazes,
    record_point,
    sample,
)
from .step.resting import PATIENCE, WORTH, come_to_rest_in_disc, is_stiff
from .step.rhythm import forget_rhythm, note_rhythm
from .step.roots import NO_ROOT
from .step.steps import (
    dot,
    keep_in_sight,
    powers,
    propose_jet,
    propose_pair,
    reach_singular_surface,
    refine_by_pair,
    refine_by_unknowns,
)
from .surface.sliding import follow, keep_at_rest, mask_solved
from .surface.vector import begins
from .work import Work

# Behind an event, which will most likely cut it short as well, the step before is taken again, whose powers are known,
# if it is at least this share of what the series allow.
SHORTEST_AGAIN = 0.6
_ROUNDING = 1e-12  # of the time, below which a step's size is rounding


@unit(types.int64, Problem, Control, State, Record, Work)
def run(P, C, S, R, W):
    """Advances S to C.t_end or to the first reason to return: the Outcome, OUT_OF_MEMORY where the buffers are full."""
    code = GO_ON
    if S.started == 0:
        code = begin(P, C, S, R, W)
    while code >= GO_ON and S.t < C.t_end:
        if not has_room(P, R, S):
            return Outcome.OUT_OF_MEMORY
        if S.steps >= C.max_steps:
            return Outcome.TOO_MANY_STEPS
        code = find_multipliers(P, C, S, R, W)  # g = 0 on the surfaces that are slid on
        if code == GO_ON:
            code = propose(P, C, S, R, W)  # a jet, the pair or an arc: polynomials, and how far they hold
        if code == GO_ON:
            find_end(P, C, S, R, W)  # the first surface, bound, fold, stop or singular argument on it
            code = advance(P, C, S, R, W)  # dense output, wanted times, the states there
        if code == GO_ON:
            code = act(P, C, S, R, W)  # crossing, stick, exit, fold, event, impact
    if len(P.contact) > 0 and (code == Outcome.SINGULAR or code == Outcome.STEP_UNDERFLOW) and jams(P, S, W):
        return Outcome.JAM
    return code if code < GO_ON else Outcome.FINISHED


@kernel
def begin(P, C, S, R, W):
    """The sides of all surfaces at the start, and what holds on those that the start stands on."""
    W.meeting.widest[:] = 0.0
    W.firing.last[:, :] = 0.0
    follow_as_asked(P, C, W)
    forget_rhythm(S, W)
    restart_flags(W)
    code = call_unit(P.instant_unit, P, C, S, R, W)
    if code == GO_ON and W.instant.look_again:
        W.meeting.tau[:] = NO_ROOT
        code = _settle_again(P, C, S, R, W)
        S.events, S.points, S.taped = 0, 0, 0  # what holds from the start is no event
        record_point(P, S, R)
    if code == GO_ON and S.ticks < len(C.clock) and C.clock[S.ticks] <= S.t:
        W.meeting.tau[:] = NO_ROOT
        code = _settle_again(P, C, S, R, W, 1)  # an event of time at the start
    return code


@kernel
def _settle_again(P, C, S, R, W, at_clock=0):
    """An instant at which nothing is met but what W.meeting.tau and the clock say; a code."""
    W.instant.fold, W.instant.way, W.instant.at_clock = -1, 0, at_clock
    W.instant.met, W.step.length, W.instant.elapsed = 0.0, 0.0, 0.0
    return call_unit(P.instant_unit, P, C, S, R, W)


@loop_kernel
def find_multipliers(P, C, S, R, W):
    """Solves for the multipliers at the present state; AGAIN where a root is lost and an instant has settled that."""
    W.step.sliding = int(any_is(P, S, SOLVED))
    W.step.held = int(any_is(P, S, HELD))
    if W.step.held:
        code = release_held(P, C, S, R, W)
        if code == GO_ON:
            W.instant.released = 1
            code = _settle_again(P, C, S, R, W)
        if code >= GO_ON and P.discs != 0:
            code = release_discs(P, S, R, W)
        if code < GO_ON:
            return code
        W.step.sliding = int(any_is(P, S, SOLVED) or (P.jet_general != 0 and any_is(P, S, HELD)))
    if W.step.sliding:
        code = _find_roots(P, C, S, R, W)
        if code != NOTHING:
            return AGAIN if code == GO_ON else code
    if CHECK and broken_by(P, C, S, W) >= 0:
        W.broken = broken_by(P, C, S, W)
        return BROKEN
    return GO_ON


@kernel
def _find_roots(P, C, S, R, W):
    """The roots of g; NOTHING, or where one is lost what is made of it."""
    mask_solved(P, S, W)
    if W.instant.solved_there == 0:
        folds = P.jet_fold != 0 or _pair_meets_folds(P)
        if folds:
            _remember_multipliers(P, S, W)
        if not follow(P, S, W):
            vanished = P.pair != 0 and S.step < _ROUNDING * time_size(S)
            return _leave_by_a_fold(P, C, S, R, W, vanished) if folds else Outcome.SINGULAR
    W.instant.solved_there = 0
    for j in range(P.m):
        if S.status[j] == SOLVED and P.kind[j] < CONTACT and abs(S.mult[j]) > 1.0 + max(1e-9, C.rtol):
            # Its bound was passed between two looks: it leaves, and all are settled again with the field after.
            W.meeting.tau[:] = NO_ROOT
            W.meeting.tau[j] = 0.0
            W.meeting.exit_side[j] = 1 if S.mult[j] > 0.0 else -1
            return _settle_again(P, C, S, R, W)
    return NOTHING


@kernel
def _remember_multipliers(P, S, W):
    for j in range(P.m):
        W.arc.mult_before[j] = S.mult[j]


@kernel
def _leave_by_a_fold(P, C, S, R, W, clear):
    """From W.arc.mult_before, where Newton's method loses a root or the step vanishes (a pair's: `clear`): a code."""
    code = lost_at_a_fold(P, C, S, R, W, clear)
    if clear and code == NOTHING:
        S.step = 1e-6 * time_size(S)  # behind it nothing is singular
    return call_unit(P.instant_unit, P, C, S, R, W) if code == NOTHING else code


@loop_kernel
def propose(P, C, S, R, W):
    """Overwrites W.step by polynomials of states, surfaces and solved multipliers, and how far they hold; a code.

    A method leaves the polynomials in step.rows and its kind in step.kind (`surface_rows` tells where the surfaces
    stand), and returns the length: nan, where nothing is finite.
    """
    step = W.step
    S.jets += 1
    S.steps += 1
    step.start, step.time_row, step.fold, step.toward, step.stop = S.t, -1, -1, 0, next_stop(C, S)
    step.singular = step.arcs = step.unsure = 0
    h, code = _begin_step(P, C, S, W)  # an onset, a jet, or the pair
    if code == GO_ON:
        h, code = _reach_folds(P, C, S, W, h)  # arcs, which pass them; singular surfaces
    if code == GO_ON and P.discs != 0 and step.kind != START:
        h, code = _near_rest(P, C, S, R, W, h)  # discs that come to rest, or are stiff beside it
    if code == GO_ON:
        h, code = _end_in_time(P, C, S, R, W, h)  # the end of the span, an instant of a clock
    if code == GO_ON and step.held and step.time_row < 0 and begins_to_part(P, C, S, W, h):
        return AGAIN
    step.length = h
    return code


@loop_kernel
def _begin_step(P, C, S, W):
    """Polynomials from the present state, and how far they hold: a disc's first slip, a jet, or the pair's; a code."""
    step = W.step
    span, h = time_size(S), math.nan
    from_rest = P.discs != 0 and _begins_to_slip(P, S)
    if from_rest:
        W.onset.least = 0.0
        # Behind a pass within rounding the last step says nothing of what is ahead.
        h = call_onset(
            P.onset_unit, P, C, S, W, min(max(S.step, 1e-3 * span), min(C.max_step, step.stop - S.t))
        )
        if not h > 0.0:
            return h, Outcome.STEP_UNDERFLOW
    elif P.pair == 0:
        h = propose_jet(P, C, S, W)
        step.singular = int(step.mult_row < 0)
        if step.singular and P.jet_fold == 0 and P.step_unit == 0:
            return h, Outcome.SINGULAR
    if P.step_unit != 0 and not from_rest and not h > max(1e-9 * S.step, 1e-13 * span):
        # No Taylor series from here, or one of rounding size: a power that vanishes at an event, such as delta^1.5 at
        # touch-down.
        h = propose_pair(P, C, S, W)
        if step.singular and not h > 0.0:
            return h, Outcome.SINGULAR
        step.singular = 0
    return h, GO_ON


@loop_kernel
def _reach_folds(P, C, S, W, h):
    """The length where arcs follow the roots of g past their folds, and where a singular surface is near; a code."""
    step = W.step
    arcs = step.sliding != 0 and P.jet_fold != 0 and step.kind != PAIR and step.kind != START
    if math.isnan(h):
        if not arcs:
            return h, GO_ON if P.discs != 0 else Outcome.NOT_FINITE
        h = 0.0  # a start within rounding of a fold: the series in t have no finite coefficients
    if step.kind != PAIR and step.kind != START:
        step.unsure = P.look_general if step.sliding else P.look_slip
    if h < _ROUNDING * time_size(S):
        to_surface = reach_singular_surface(P, C, S, W, h)
        if to_surface != h:
            h, step.unsure = to_surface, 0  # linear
    if arcs:
        h = propose_arc(P, C, S, W, h, step.singular != 0)
        if h == -1.0:
            return h, Outcome.SINGULAR
        if math.isnan(h):
            return h, Outcome.NOT_FINITE
    step.arcs = int(arcs or (step.sliding != 0 and _pair_meets_folds(P)))
    return h, GO_ON


@loop_kernel
def _near_rest(P, C, S, R, W, h):
    """The length where a disc comes to rest on the step, or turns fast beside its rest; a code."""
    step = W.step
    h, at_rest = come_to_rest_in_disc(P, C, S, R, W, h)
    if at_rest >= 0:
        W.meeting.tau[:] = NO_ROOT
        W.meeting.tau[at_rest] = 0.0
        code = _settle_again(P, C, S, R, W)
        return h, AGAIN if code == GO_ON else code
    stiff, longest = is_stiff(P, S, W, h)
    if stiff and step.time_row < 0 and step.kind != PAIR:
        W.onset.least = WORTH * h if h > 0.0 else 0.0
        longer = call_onset(P.onset_unit, P, C, S, W, min(longest, min(C.max_step, step.stop - S.t)))
        if longer > W.onset.least:
            h, step.unsure = longer, 0
        else:
            h, W.onset.wait = min(h, propose_jet(P, C, S, W)), PATIENCE
    return h, Outcome.NOT_FINITE if math.isnan(h) else GO_ON


@loop_kernel
def _end_in_time(P, C, S, R, W, h):
    """The length within sight of all surfaces and up to the next known instant, W.end.stopped where it ends there."""
    step = W.step
    if step.unsure:
        h = keep_in_sight(P, C, h if step.time_row >= 0 else min(h, step.stop - S.t), W)
    W.end.stopped = 0
    if step.time_row >= 0:
        return h, GO_ON
    if step.kind != PAIR and step.kind != START and SHORTEST_AGAIN * h <= S.step <= h and after_event(P, S):
        h = S.step
    if step.held and is_growing(P, S):
        h = min(h, MOMENT * S.unit)
    left = step.stop - S.t
    if h >= left:
        W.end.stopped = 1
        return left, GO_ON
    if h <= 1e-15 * abs(S.t) + 1e-300:
        return h, _leave_within_rounding(P, C, S, R, W)
    return h, GO_ON


@kernel
def _leave_within_rounding(P, C, S, R, W):
    """What a step of rounding size means: a fold, left by an arc or by the pair, or a singular motion; a code."""
    # An arc follows the root that does not attract, the pair the one that does.
    by_pair = W.step.sliding != 0 and _pair_meets_folds(P)
    if W.step.arcs == 0:
        return Outcome.STEP_UNDERFLOW
    _remember_multipliers(P, S, W)
    code = _leave_by_a_fold(P, C, S, R, W, by_pair)
    return AGAIN if code == GO_ON else Outcome.STEP_UNDERFLOW if code == Outcome.SINGULAR else code


@kernel
def _begins_to_slip(P, S):
    """Whether some disc slips from rest."""
    for j in range(P.m):
        if begins(P, S, j):
            return True
    return False


@kernel
def _pair_meets_folds(P):
    """Whether steps are the pair's, which has no arcs, and some multiplier may come to a fold."""
    for j in range(P.m if P.pair != 0 else 0):
        if P.hidden[j] != 0:
            return True
    return False


@inlined_kernel
def next_stop(C, S):
    """The end of the span or the next instant of a time event, whichever comes first."""
    if S.ticks < len(C.clock):
        return min(C.t_end, C.clock[S.ticks])
    return C.t_end


@inlined_kernel
def after_event(P, S):
    """Whether the step begins on a surface, behind an event."""
    for i in range(P.m + P.ne):
        if S.deflate[i] != 0:
            return True
    return False


@kernel
def _look_for_arrival(P, C, S, R, W, h, best):
    """(length of the step, what is met first on it), if the motion may arrive where a field is singular: `end.arrives`
    if it does.
    """
    step = W.step
    step.arrives = step.rests = -1
    call_unit(P.approach_unit, P, C, S, R, W)
    arrives = step.arrives >= 0
    if arrives and step.time_row < 0 and step.length > step.stop - step.start:
        arrives = False  # beyond the end of the span or the next instant of a time event
        step.length = h
    elif step.length != h:
        h, W.end.stopped = step.length, 0
        powers(step.power, h)
        best = find_first(P, C, S, W)
    if arrives:
        best = NO_ROOT
        W.meeting.grazed[:] = NO_ROOT
    W.end.arrives = int(arrives)
    return h, best


@loop_kernel
def find_end(P, C, S, R, W):
    """Overwrites W.end: what is met first on the step, and where it therefore ends."""
    step, end, power = W.step, W.end, W.step.power
    h = step.length
    if at(power, 1) != h:
        powers(power, h)
    best = find_first(P, C, S, W)
    if step.unsure and step.time_row < 0:
        asked = h
        h, best = shorten_to_fit(P, C, S, W, best)
        end.stopped = end.stopped if h == asked else 0
    end.arrives = 0
    if P.watches != 0:
        h, best = _look_for_arrival(P, C, S, R, W, h, best)
    fraction, folded = 1.0, False
    if step.time_row >= 0:
        fraction, best, folded, stopped = end_of_arc(P, C, best, step.stop, step.singular, W)
        end.stopped = int(stopped)
    happened = best <= fraction
    if happened:
        fraction, end.stopped = best, 0
    if happened or end.stopped:
        touched_at_the_end(P, C, S, fraction, W)
    end.met, end.last_graze = fraction, fraction
    grazes = first_graze(P, W) <= fraction
    if grazes and C.strict:
        fraction, happened, end.stopped = first_graze(P, W), False, 0
        end.last_graze = fraction
    length = fraction * h
    if happened and step.kind == PAIR and h > 1e-11 * time_size(S):
        length = refine_by_pair(P, C, S, W, length)
        fraction = 0.5  # its powers are to be made
        if length < 0.0:
            length, happened, grazes = -length, False, False  # no zero is there
    if happened and step.time_row < 0 and P.inner != 0:
        length, fraction = refine_by_unknowns(P, C, S, W, length), 0.5
    if happened and step.time_row < 0 and S.ticks < len(C.clock):
        left = C.clock[S.ticks] - step.start
        if 0.0 < left - length <= at_once_within(C.clock[S.ticks], h):
            length, fraction = left, 0.5  # what is met and the clock are at one instant
    end.touched = LEFT if folded else 0
    if step.arcs and step.time_row < 0:
        before = where_attraction_ends(P, C, S, length, W)
        if before < 0.0:
            end.touched, end.touched_at = PASSED, step.start + length
        elif before < length:
            hop = min(W.arc.hop, length - before)
            if before <= W.arc.hop and hop >= SHORTEST_HOP * W.arc.hop:
                end.touched, end.touched_at, length = HOPPED, step.start + before, before + hop
                step.toward = 1 if step.rows[step.mult_row + W.arc.touched, 1] > 0.0 else -1
            else:
                length = SHARE_TO_A_FOLD * before
            fraction, happened, end.stopped, grazes = 0.5, False, 0, False
    end.length, end.whole = length, int(fraction >= 1.0)
    end.happened, end.folded, end.grazes = int(happened), int(folded), int(grazes)


@loop_kernel
def advance(P, C, S, R, W):
    """Moves S to the end of the step, on its polynomials; keeps what is asked for on the way. A code."""
    n, K, x, rows = P.n, C.order, S.x, W.step.rows
    step, end = W.step, W.end
    mult_row, length = step.mult_row, end.length
    if math.isnan(length):
        return Outcome.NOT_FINITE
    final = step.power
    if not end.whole:
        final = step.end_power
        powers(final, length)
    t_new = dot(rows[step.time_row], final, K + 1) if step.time_row >= 0 else step.start + length
    if end.stopped or t_new > step.stop or abs(t_new - step.stop) <= 4e-16 * abs(step.stop):
        t_new = step.stop
    end.at_clock = int(t_new >= step.stop and S.ticks < len(C.clock) and C.clock[S.ticks] <= step.stop)
    if len(R.dense_s) > 0:
        keep_dense(P, C, S, R, W)
    if R.tape.shape[0] > 0:
        put_step_on_tape(P, S, R, W)
    if S.samples < R.t_eval.shape[0] and R.t_eval[S.samples] <= t_new:
        sample(P, C, S, R, t_new, W)
        final = step.end_power
        powers(final, length)
    total = 0.0
    for i in range(n):
        x[i] = dot(rows[i], final, K + 1)
        total += abs(x[i])
    if step.sliding:
        for j in range(P.m):
            if S.status[j] == SOLVED:
                S.mult[j] = dot(rows[mult_row + j], final, K + 1)
    if end.grazes:
        record_grazes(P, C, S, R, W)
    S.t = t_new
    S.step = W.pair.next_step if step.kind == PAIR else step.length
    if end.grazes and C.strict:
        record_point(P, S, R)
        return Outcome.AMBIGUITY
    if not total < math.inf:
        return Outcome.NOT_FINITE
    if step.sliding:
        keep_surfaces(P, S, W)
        if P.discs != 0:
            keep_at_rest(P, S, W)
        if len(P.contact) > 0:
            stop_closed(P, S, W)
        code = two_fold(P, C, S, R, W)
        if code != NOTHING:
            record_point(P, S, R)
            return code
    return GO_ON


@kernel
def _come_to_rest(P, C, S, R, W):
    """The motion has come to a branch point with no speed left: it rests there with others, or goes on; a code."""
    S.deflate[:] = 0
    S.stalled = 0
    W.meeting.tau[:] = NO_ROOT
    W.instant.rests = W.step.rests
    return _settle_again(P, C, S, R, W)


@loop_kernel
def act(P, C, S, R, W):
    """What happens at the end of the step; a code."""
    step, end = W.step, W.end
    if end.arrives and end.length == step.length:
        if R.tape.shape[0] > 0:
            put_on_tape(P, S, R, TAPE_MEET, TAPE_OTHER, 0, 0, 0.0)
        if step.rests >= 0:
            return _come_to_rest(P, C, S, R, W)
        return call_unit(P.approach_unit, P, C, S, R, W)
    if end.touched != 0:
        if end.touched == LEFT:
            W.arc.touched, end.touched_at = step.fold, S.t
            W.arc.hop = HOP * (S.t - step.start) / end.length  # at the pace of this arc
        code = touch(P, C, S, R, end.touched, end.touched_at, step.toward, W)
        if code == NOTHING:
            code = call_unit(P.instant_unit, P, C, S, R, W)
            if code == GO_ON:
                return AGAIN
        if code != GO_ON:
            record_point(P, S, R)
            return code
    if end.happened or end.at_clock:
        W.instant.fold = step.fold if end.folded else -1
        W.instant.way = step.toward
        W.instant.at_clock = end.at_clock
        W.instant.met = end.met
        W.instant.elapsed = S.t - step.start
        note_rhythm(P, S, W, end.met, S.t)
        return call_unit(P.instant_unit, P, C, S, R, W)
    leave_surfaces(P, S, W)
    S.stalled = 0
    record_point(P, S, R)
    return GO_ON
