"""The trajectory loop: step, look for the earliest event on the step's polynomial, act, go on.

It reads like the theory: slipping and sliding steps alike give polynomials of the states and of every surface; a
surface met is a crossing, a stick or an event; a solved multiplier that meets its bound is a tangency exit, and one
that meets a zero of dt/dlambda a fold.
"""

import math

from numba import types

from .fresh import restart_flags
from .instant.contacts import stop_closed
from .instant.folds import (
    HOP,
    HOPPED,
    LEFT,
    PASSED,
    SHARE_TO_A_FOLD,
    SHORTEST_HOP,
    flattest,
    known_zeros,
    lost_at_a_fold,
    touch,
    turns_back,
    way_of_time,
    where_attraction_ends,
)
from .instant.invariants import CHECK, broken_by
from .instant.settling import release_held
from .instant.surface_rates import any_is, keep_sliding
from .instant.twofolds import two_fold
from .machine.compiling import inlined_kernel, kernel, unit
from .machine.pointers import at, call_fold, call_rk, call_unit
from .outcome import Outcome
from .state import (
    ALGEBRAIC,
    BROKEN,
    CONTACT,
    GO_ON,
    HELD,
    NOTHING,
    SOLVED,
    Control,
    Problem,
    Record,
    State,
)
from .step.meeting import find_first, first_graze, meet
from .step.recording import keep_dense, record_grazes, record_point, sample
from .step.rhythm import forget_rhythm, note_rhythm
from .step.roots import NO_ROOT, first_root
from .step.singular import ROWS_ARC, ROWS_GENERAL, ROWS_PAIR, ROWS_SLIP
from .step.steps import (
    dot,
    fold_step_size,
    keep_in_sight,
    misfit,
    near_fold,
    powers,
    take_jet,
    taylor_step_size,
)
from .surface.sliding import follow, mask_solved
from .work import Work

# Behind an event, which will most likely cut it short as well, the step before is taken again, whose powers are known,
# if it is at least this share of what the series allow.
SHORTEST_AGAIN = 0.6
# Of a step whose end is not what its series says. What is off by rounding falls with the step, what a series does not
# tell far faster.
_MOST_HALVINGS, _MOST_IN_VAIN, _AS_FAST = 200, 6, 0.3


@kernel
def _reach_singular_surface(P, S, rows, surface_rows, mult_row, h):
    """A step of rounding size that ends on a surface where a power has its branch point: linear terms suffice.

    There the Taylor steps shrink with the distance left (delta^1.5 at release) and would never arrive.
    """
    reach = 1e-11 * (1.0 + abs(S.t))
    for i in range(P.m + P.ne):
        row = surface_rows[i]
        if row >= 0 and rows[row, 1] != 0.0:
            left = -rows[row, 0] / rows[row, 1]
            if 0.0 < left < reach:
                # Rows further behind are what the programs keep from call to call.
                top = max(P.n, mult_row + P.m)
                for k in range(P.m + P.ne):
                    top = max(top, surface_rows[k] + 1)
                for r in range(top):
                    for k in range(2, rows.shape[1]):
                        rows[r, k] = 0.0
                return 2.0 * left
    return h


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


@inlined_kernel
def _find_roots(P, C, S, R, W):
    """Solves for the multipliers at the present state; NOTHING, or where a root is lost what is made of it."""
    mask_solved(P, S, W)
    if W.instant.solved_there == 0:
        if P.jet_fold != 0:
            for j in range(P.m):
                W.arc.mult_before[j] = S.mult[j]
        if not follow(P, S, W):
            code = lost_at_a_fold(P, C, S, R, W) if P.jet_fold != 0 else Outcome.SINGULAR
            return call_unit(P.instant_unit, P, C, S, R, W) if code == NOTHING else code
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
def _settle_again(P, C, S, R, W):
    """An instant at which nothing is met but what W.meeting.tau says; a code."""
    W.instant.fold, W.instant.way, W.instant.at_clock = -1, 0, 0
    W.instant.met, W.step.length, W.instant.elapsed = 0.0, 0.0, 0.0
    return call_unit(P.instant_unit, P, C, S, R, W)


@kernel
def _take_arc(P, C, S, rows, mult_row, singular, fold, W):
    """Overwrites rows by series in the multiplier of `fold`; the direction in which it goes, 0 if time has none."""
    if singular:
        toward = way_of_time(P, C, S, W, fold)
    else:
        toward = 1 if rows[mult_row + fold, 1] > 0.0 else -1
    if toward == 0 or not call_fold(P.fold_unit, P, C, S, W, fold, toward):
        return 0
    S.jets += 1
    return toward


@kernel
def _end_of_arc(P, C, time, power, h, stop, singular, best, W):
    """Where an arc ends on which t is the series `time`, and what is met first there.

    dt/ds > 0 until the fold; its zero ends the step, and so does the end of the span. Returns the share of the arc,
    where something is met, whether that is the fold, and whether it is the end of the span.
    """
    K, fraction, folded, capped, slope = C.order, 1.0, False, False, W.arc.slope
    W.roots.guess = 0.0
    for k in range(K):
        slope[k] = (k + 1.0) * time[k + 1]
    s = meet(P, slope, power, K - 1, known_zeros(slope) if singular else 0, 1.0, W)
    if s <= 1.0 and not turns_back(slope, s * h, h, K):
        # lambda^3 = t: dt/dlambda vanishes, but time goes on. Not where the step ends: the next has no series.
        if s > 0.8:
            fraction = 0.5 * s
        s = NO_ROOT
    if s < best and s <= fraction:
        folded, best = True, s
    for k in range(K + 1):
        W.roots.poly[k] = -time[k] * power[k]
    W.roots.poly[0] += stop
    s = first_root(P, W.roots, K)
    if s < min(best, fraction):
        fraction, folded, capped = s, False, True
    return fraction, best, folded, capped


@inlined_kernel
def _shorten_to_fit(P, C, S, rows, power, surface_rows, mult_row, t0, h, best, W):
    """Halves a step until its end is what its series says; returns it, and where something is met first in it."""
    longest, last, in_vain = h, math.inf, 0
    for _ in range(_MOST_HALVINGS):
        end = min(best, 1.0) * h
        powers(power, end)
        off = misfit(P, C, S, rows, surface_rows, mult_row, t0, end, W)
        if off <= _AS_FAST * last:
            longest, in_vain = h, 0
        else:
            in_vain += 1
        if off <= 1.0 or in_vain == _MOST_IN_VAIN:
            break
        last, h = off, 0.5 * end
        powers(power, h)
        best = find_first(P, C, S, rows, power, surface_rows, mult_row, h, W)
    if longest != h:
        powers(power, longest)
        best = find_first(P, C, S, rows, power, surface_rows, mult_row, longest, W)
    powers(power, longest)
    return longest, best


@inlined_kernel
def _room(R, S):
    """Whether the buffers can take another step with all that may happen at its end."""
    return (
        S.points + 8 < R.t.shape[0]
        and S.events + 2 * S.last.shape[0] + 3 * S.side.shape[0] + 64 < R.event_t.shape[0]
        and S.ambiguities + S.last.shape[0] + 8 < R.ambiguity_t.shape[0]
        and (R.dense.shape[0] == 0 or S.pieces + 1 < R.dense.shape[0])
    )


@unit(types.int64, Problem, Control, State, Record, Work)
def run(P, C, S, R, W):
    """Advances S to C.t_end or to the first reason to return; see the codes of state.py."""
    n, m, K, rows, power, x = P.n, P.m, C.order, W.step.rows, W.step.power, S.x
    if S.started == 0:
        S.started = 1
        W.meeting.widest[:] = 0.0
        W.firing.last[:, :] = 0.0
        forget_rhythm(S, W)
        restart_flags(W)
        code = call_unit(P.start_unit, P, C, S, R, W)
        if code == GO_ON and W.instant.look_again:
            W.meeting.tau[:] = NO_ROOT
            code = _settle_again(P, C, S, R, W)
            S.events, S.points = 0, 0  # what holds from the start is no event
            record_point(P, S, R)
        if code != GO_ON:
            return code
    while S.t < C.t_end:
        if not _room(R, S):
            return Outcome.OUT_OF_MEMORY
        if S.steps >= C.max_steps:
            return Outcome.TOO_MANY_STEPS
        if any_is(P, S, HELD):
            code = release_held(P, C, S, R, W)
            if code == GO_ON:
                code = _settle_again(P, C, S, R, W)
            if code != GO_ON and code != NOTHING:
                return code
        sliding = any_is(P, S, SOLVED)
        if sliding:
            code = _find_roots(P, C, S, R, W)
            if code == GO_ON:
                continue
            if code != NOTHING:
                return code
        if CHECK and broken_by(P, C, S, W) >= 0:
            W.broken = broken_by(P, C, S, W)
            return BROKEN
        # The step: polynomials of states, surfaces and solved multipliers, and how far they hold.
        S.jets += 1
        S.steps += 1
        by_pair, singular = P.pair != 0, False
        h = math.nan
        if not by_pair:
            mult_row = take_jet(P, C, S, sliding, W)
            singular = mult_row < 0
            if singular and P.jet_fold == 0 and P.rk_unit == 0:
                return Outcome.SINGULAR
            surface_rows = P.rows_general if sliding else P.rows_slip
            h = S.step
            if singular and P.jet_fold == 0:
                h = math.nan  # of a power that vanishes, perhaps: the pair will see
            elif not singular:
                h = taylor_step_size(P, C, S, rows, surface_rows, mult_row, sliding, W)
        if P.rk_unit != 0 and not h > max(1e-9 * S.step, 1e-13 * (1.0 + abs(S.t))):
            # No Taylor series from here, or one of rounding size: a power that vanishes at an event, such as
            # delta^1.5 at touch-down.
            by_pair = True
            mult_row, surface_rows = n, P.rows_pair
            longest = min(C.max_step, next_stop(C, S) - S.t)
            h = call_rk(P.rk_unit, P, C, S, W, min(S.step, longest), -1)
            if singular and not h > 0.0:
                return Outcome.SINGULAR
            singular = False
        by_arc = sliding and P.jet_fold != 0 and not by_pair
        if math.isnan(h):
            if not by_arc:
                return Outcome.NOT_FINITE
            h = 0.0  # a start within rounding of a fold: the series in t have no finite coefficients
        look = 0 if by_pair else P.look_general if sliding else P.look_slip
        if h < 1e-12 * (1.0 + abs(S.t)):
            to_surface = _reach_singular_surface(P, S, rows, surface_rows, mult_row, h)
            if to_surface != h:
                h, look = to_surface, 0  # of rounding size, and linear
        fold, toward, time_row = -1, 0, -1
        if by_arc:
            within = h if h > 0.0 else 1e-12 * (1.0 + abs(S.t))
            fold = flattest(P, S, W) if singular else near_fold(P, S, rows, mult_row, within)
        if fold >= 0:
            # Near a fold lambda runs, not time: the step is an arc of the root, and t one of its polynomials.
            toward = _take_arc(P, C, S, rows, mult_row, singular, fold, W)
            time_row, mult_row, surface_rows = n, n + 1, P.rows_fold
            if toward != 0:
                h = fold_step_size(P, C, S, rows, W)
        if singular and fold < 0 or fold >= 0 and toward == 0:
            return Outcome.SINGULAR
        if math.isnan(h):
            return Outcome.NOT_FINITE
        if look:
            flat_rows = P.flat_slip
            if time_row >= 0:
                flat_rows = P.flat_fold
            elif sliding:
                flat_rows = P.flat_general
            h = keep_in_sight(C, rows, flat_rows, h, W)
        t0 = S.t
        stop = next_stop(C, S)
        if time_row < 0 and not by_pair and SHORTEST_AGAIN * h <= S.step <= h and after_event(P, S):
            h = S.step
        capped = False
        if time_row < 0 and h >= stop - t0:
            h = stop - t0
            capped = True
        if time_row < 0 and not capped and h <= 1e-15 * abs(t0) + 1e-300:
            if not by_arc:
                return Outcome.STEP_UNDERFLOW
            # Within rounding of a fold, on the root that does not attract.
            for j in range(m):
                W.arc.mult_before[j] = S.mult[j]
            code = lost_at_a_fold(P, C, S, R, W)
            if code == NOTHING:
                code = call_unit(P.instant_unit, P, C, S, R, W)
            if code == GO_ON:
                continue
            return Outcome.STEP_UNDERFLOW if code == Outcome.SINGULAR else code
        # What is met first on it, and where it therefore ends.
        if at(power, 1) != h:
            powers(power, h)
        best = find_first(P, C, S, rows, power, surface_rows, mult_row, h, W)
        if look and time_row < 0:
            asked = h
            h, best = _shorten_to_fit(P, C, S, rows, power, surface_rows, mult_row, t0, h, best, W)
            capped = capped and h == asked
        arrives = False
        if P.watches != 0:
            W.step.kind = (
                ROWS_ARC if time_row >= 0 else ROWS_PAIR if by_pair else ROWS_GENERAL if sliding else ROWS_SLIP
            )
            W.step.arrives, W.step.length = -1, h
            call_unit(P.approach_unit, P, C, S, R, W)
            arrives = W.step.arrives >= 0
            if arrives and time_row < 0 and W.step.length > stop - t0:
                arrives = False  # beyond the end of the span or the next instant of a time event
            elif W.step.length != h:
                h, capped = W.step.length, False
                powers(power, h)
                best = find_first(P, C, S, rows, power, surface_rows, mult_row, h, W)
            if arrives:
                best = NO_ROOT
                W.meeting.grazed[:] = NO_ROOT
        fraction, folded = 1.0, False
        if time_row >= 0:
            fraction, best, folded, capped = _end_of_arc(
                P, C, rows[time_row], power, h, stop, singular, best, W
            )
        happened = best <= fraction
        if happened:
            fraction, capped = best, False
        last_graze = fraction
        grazes = first_graze(P, W) <= fraction
        if grazes and C.strict:
            fraction, happened, capped = first_graze(P, W), False, False
            last_graze = fraction
        s_end = fraction * h
        if happened and by_pair and h > 1e-11 * (1.0 + abs(t0)):
            met = 0
            for i in range(m + P.ne):
                if W.meeting.tau[i] < W.meeting.tau[met]:
                    met = i
            s_end = call_rk(P.rk_unit, P, C, S, W, s_end, met)
            if math.isnan(s_end):
                return Outcome.NOT_FINITE
            fraction = 0.5  # a new s_end: its powers are to be made
        touched, t_touch = LEFT if folded else 0, t0
        if by_arc and time_row < 0:
            end = where_attraction_ends(P, C, S, rows, mult_row, t0, s_end, h, W)
            hop = W.arc.hop
            if end < 0.0:
                touched, t_touch = PASSED, t0 + s_end
            elif end < s_end:
                hop = min(hop, s_end - end)
                if end <= W.arc.hop and hop >= SHORTEST_HOP * W.arc.hop:
                    touched, t_touch, s_end = HOPPED, t0 + end, end + hop
                    toward = 1 if rows[mult_row + W.arc.touched, 1] > 0.0 else -1
                else:
                    s_end = SHARE_TO_A_FOLD * end
                fraction, happened, capped, grazes = 0.5, False, False, False
        # There.
        final = power
        if fraction < 1.0:
            final = W.step.end_power
            powers(final, s_end)
        t_new = dot(rows[time_row], final, K + 1) if time_row >= 0 else t0 + s_end
        if capped or t_new > stop or abs(t_new - stop) <= 4e-16 * abs(stop):
            t_new = stop
        at_clock = t_new >= stop and S.ticks < len(C.clock) and C.clock[S.ticks] <= stop
        if len(R.dense_s) > 0:
            keep_dense(P, C, S, R, rows, mult_row, time_row, s_end)
        if S.samples < R.t_eval.shape[0] and R.t_eval[S.samples] <= t_new:
            sample(P, C, S, R, rows, mult_row, time_row, s_end, t_new, W)
            final = W.step.end_power
            powers(final, s_end)
        for i in range(n):
            x[i] = dot(rows[i], final, K + 1)
        if sliding:
            for j in range(m):
                if S.status[j] == SOLVED:
                    S.mult[j] = dot(rows[mult_row + j], final, K + 1)
        if grazes:
            record_grazes(P, C, S, R, rows, time_row, h, last_graze, W)
        S.t = t_new
        S.step = W.pair.next_step if by_pair else h
        if grazes and C.strict:
            record_point(P, S, R)
            return Outcome.AMBIGUITY
        total = 0.0
        for i in range(n):
            total += abs(x[i])
        if not total < math.inf:
            return Outcome.NOT_FINITE
        if sliding:
            for j in range(m):
                if S.status[j] == SOLVED and P.kind[j] != ALGEBRAIC and P.kind[j] != CONTACT:
                    keep_sliding(P, S, j, W)
            if len(P.contact) > 0:
                stop_closed(P, S, W)
            code = two_fold(P, C, S, R, t0, rows, mult_row, time_row, s_end, W)
            if code != NOTHING:
                record_point(P, S, R)
                return code
        if arrives and s_end == h:
            code = call_unit(P.approach_unit, P, C, S, R, W)
            if code != GO_ON:
                return code
            continue
        # What happens there.
        if touched != 0:
            if touched == LEFT:
                W.arc.touched, t_touch = fold, t_new
                W.arc.hop = HOP * (t_new - t0) / s_end  # at the pace of this arc
            code = touch(P, C, S, R, touched, t_touch, toward, W)
            if code == NOTHING:
                code = call_unit(P.instant_unit, P, C, S, R, W)
                if code == GO_ON:
                    continue
            if code != GO_ON:
                record_point(P, S, R)
                return code
        if happened or at_clock:
            W.instant.fold = fold if folded else -1
            W.instant.way = toward
            W.instant.at_clock = 1 if at_clock else 0
            W.instant.met = best if happened else NO_ROOT
            W.step.length = h
            W.instant.elapsed = t_new - t0
            note_rhythm(P, S, W, best, t_new)
            code = call_unit(P.instant_unit, P, C, S, R, W)
            if code != GO_ON:
                return code
        else:
            S.deflate[:] = 0
            S.stalled = 0
            record_point(P, S, R)
    return Outcome.FINISHED
