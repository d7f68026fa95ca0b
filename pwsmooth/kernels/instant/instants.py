"""What happens at one instant: events, impacts, then the switches with the field after.

Order (the contract of Event): all events whose `when` holds fire from the values before, repeated until none newly
fires; then impacts; then every switch that is on its surface is settled by its layer, and every sliding switch whose
field has jumped is settled again.
"""

import math

from numba import types

from ..intervals import forget_intervals, note_arc, time_size
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_layer_unit
from ..outcome import Outcome
from ..state import (
    ALGEBRAIC,
    AMB_CHATTERING,
    ANY,
    COMPONENT,
    CROSSING,
    DISC,
    EV_ACCUMULATION,
    EV_CROSSING,
    EV_FOLD,
    EV_FOLD_TO_SLIDING,
    EV_RESET,
    EV_STICK,
    EV_TANGENCY,
    GO_ON,
    HELD,
    KINK,
    MOST_AT_ONCE,
    NOTHING,
    PAIR,
    SECOND_ORDER,
    SLIDING,
    SOLVED,
    Control,
    Problem,
    Record,
    State,
)
from ..step.finer import SWITCHING, follow_arcs, follow_as_asked
from ..step.meeting import is_clocked, late_by, orders_at_rest, rested_on
from ..step.recording import put_causes_on_tape, record_ambiguity, record_event, record_point
from ..step.singular import POLE, has_branch_point
from ..surface.layer import LEAVE_FOLD
from ..surface.sliding import (
    INSIDE,
    follow,
    keep_on_surface,
    mask_solved,
    surface_rounding,
    surface_speed,
    surface_tolerance,
)
from ..surface.sparse import link
from ..surface.vector import begins
from ..work import Work
from .accumulation import AT_ONCE, at_once_within, is_passed, note_those_carried, pass_accumulation
from .contacts import (
    UNCHANGED,
    UNTOLD,
    collapses,
    cross_without_load,
    crosses_as_contacts_open,
    impact_to_the_end,
    is_behind,
    outcome_of,
    part_or_press,
    settle_contacts,
    stop_closed,
)
from .discs import (
    ALONE,
    ARRIVING,
    AT_REST,
    free_components,
    resettle_discs,
    settle_discs,
    slip_by_layer,
    some_share,
)
from .dry_friction import leave_loop, settle_friction
from .firing import (
    LATER,
    NOW,
    carried_along,
    events,
    fire_due,
    jumps_with_another,
    leave_what_jumps,
    may_be_carried,
    next_that_wait,
    place_those_that_wait,
    sides_after_crossing,
    sides_after_jump,
    step_inside,
    strike_switches,
)
from .folds import note_folds_beside
from .holding import (
    AGAIN,
    hold_beside,
    hold_instead,
    hold_second_order,
    hold_supported,
    hold_what_contacts_keep,
    hold_what_rests,
    rest_with_friction,
    some_second_order,
    take_sides,
)
from .other_motions import try_other_ratio
from .plain import cross_stick_or_leave, only_one
from .resting import come_to_rest, hold_by_what_jumps, rests_on_kink, stay_at_rest
from .settling import (
    hand_over,
    layer_code,
    let_go_without_load,
    resettle,
    settle_arrivals,
    settle_at_rest,
    settle_together,
)
from .starting import start
from .surface_rates import (
    AT_BOUND,
    any_kind,
    approach_speed,
    arc_ahead,
    evaluate_surfaces,
    note_rests_along,
    order_at_rest,
    order_of_leaving,
    residual,
    rests_along,
    rests_at_zero,
    settle_beside,
    stop_normal_speed,
)

# A relay of relative degree 2 with damping crosses ever more often, and never ends: so many crossings below the
# tolerance say so, and it slides to second order from then on. Switchings that accumulate at an instant come to it
# with fewer.
_MOST_MINUTE = 10_000
_OF_A_FIT = 1e-6  # of a step of the pair: by so much its fit may tell zeros of one instant apart


@kernel
def _take_along(P, S, W, size):
    """Appends to the switches active[:size] those that they act on and that come to their surfaces with them, but for
    those that jump off with them."""
    instant, first = W.instant, size
    for a in range(first):
        evaluate_surfaces(P, S, W)
        link(P, S, W, instant.active[a])
        for k in range(P.m):
            if W.linear.linked[k] and rests_along(P, S, W, k) and not jumps_with_another(P, S, W, k):
                instant.hit[k] = True
                instant.active[size] = k
                size += 1
    return size


@kernel
def _arrivals(P, C, S, R, W, size, jumped, turned):
    """Settles the switches active[:size] that met their surfaces: one by one where uncoupled, else in one layer.

    `turned`: whether something else has happened at this instant that may turn them back.
    """
    instant = W.instant
    all_met = size
    size = take_sides(P, C, S, R, W, size, not jumped)
    for a in range(size, all_met):
        j = instant.active[a]
        if S.status[j] != instant.came[j]:
            record_event(S, R, j, EV_RESET if jumped else EV_CROSSING, instant.came[j], S.status[j])
    if len(P.contact) > 0:
        if not jumped:
            size = cross_without_load(P, S, R, W, size)
        size = hold_supported(P, S, R, W, size)
        for j in range(P.m):
            if S.status[j] == HELD and instant.came[j] != HELD and instant.hit[j]:
                record_event(S, R, j, EV_STICK, instant.came[j], 0)
                keep_on_surface(P, S, j, W)
                forget_intervals(S.last[j], S.t)
    if size == 0:
        return GO_ON
    size = _take_along(P, S, W, size)
    joint = size
    for a in range(size):
        link(P, S, W, instant.active[a])
        for b in range(P.m):
            if W.linear.linked[b] == 0 or P.kind[b] != SLIDING or b == instant.active[a]:
                continue
            known = -1
            for c in range(joint):
                if instant.active[c] == b:
                    known = c
            if 0 <= known < size:
                instant.together = 1
            elif known < 0 and S.status[b] == SOLVED:
                instant.active[joint] = b
                joint += 1
    code = GO_ON
    if joint > size or instant.together:
        for a in range(joint):
            j = instant.active[a]
            instant.group[a] = j
            instant.arrival[a] = 0 if S.status[j] == SOLVED or jumped else S.status[j]
            if jumped and S.status[j] != SOLVED:
                S.mult[j] = 0.0
        if jumped:
            code = settle_together(P, S, R, W, size, joint)
        else:
            code = settle_friction(P, S, R, W, joint, False)
            if code == NOTHING:
                code = settle_arrivals(P, S, R, W, joint)
                if code == GO_ON and size > 1:
                    try_other_ratio(P, S, R, W, size)
    elif jumped:
        code = settle_at_rest(P, C, S, R, W, size)
    else:
        for a in range(size):
            j = instant.active[a]
            if turned and S.status[j] * approach_speed(P, S, j, W) > instant.rest_speed:
                continue
            if P.discs != 0:
                order = _begins_to_leave(P, C, S, W, j)
                if order != 0:
                    S.status[j] = 1 if order > 0 else -1
                    S.mult[j], S.deflate[j] = float(S.status[j]), -abs(order)
                    continue
            instant.group[0] = j
            instant.arrival[0] = S.status[j]
            one = settle_arrivals(P, S, R, W, 1)
            code = code if one == GO_ON else one
    if code == GO_ON:
        _hold_what_is_met_again(P, S, W, size)
    for a in range(size if len(P.contact) > 0 and code == GO_ON and not jumped else 0):
        j = instant.active[a]
        if S.status[j] == SOLVED and abs(instant.came[j]) == 1 and crosses_as_contacts_open(P, S, W, j):
            instant.look_again = 1
    if code == GO_ON and P.discs != 0:
        for a in range(joint):
            instant.kept[0, a] = instant.active[a]
        for j in range(P.m):
            instant.kept[1, j] = S.status[j]
        code = resettle_discs(P, C, S, R, W, AT_REST if jumped else ARRIVING)
        for a in range(joint):
            instant.active[a] = instant.kept[0, a]
    if code != GO_ON:
        return code
    for a in range(joint):
        j = instant.active[a]
        came = SOLVED if instant.came[j] == HELD else instant.came[j]
        went = SOLVED if S.status[j] == HELD else S.status[j]
        S.deflate[j] = -S.deflate[j] if S.deflate[j] < 0 else 1
        if went == SOLVED and came != SOLVED:
            record_event(S, R, j, EV_STICK, came, 0)
            keep_on_surface(P, S, j, W)
            rest_with_friction(P, S)
            if some_second_order(P):
                hold_beside(P, S, W)
            if not jumped:
                note_rests_along(P, S, R, W, j, came)
        elif went != came:
            record_event(S, R, j, EV_CROSSING if came != SOLVED else EV_RESET, came, went)
        if came != SOLVED:
            note_arc(S, j, approach_speed(P, S, j, W))
        if S.status[j] != SOLVED and P.step_unit != 0:
            step_inside(P, S, j, W)
    for j in range(P.m):
        if P.kind[j] == DISC and instant.kept[1, j] == SOLVED and S.status[j] == 1:
            record_event(S, R, j, EV_RESET, 0, 1)
    return GO_ON


@kernel
def _has_no_speed(P, S, W, j):
    """Whether surface j is left or met as slowly as roundings tell."""
    plain = P.hidden[j] == 0 and abs(S.status[j]) == 1
    return plain and abs(approach_speed(P, S, j, W)) <= W.instant.rest_speed


@kernel
def _begins_to_leave(P, C, S, W, j):
    """As order_of_leaving, of surface j where a motion only begins, as the slip of a disc from rest; 0 where it has a
    speed, or is led back from the other side."""
    if not _has_no_speed(P, S, W, j):
        return 0
    far, order = residual(P, S, W, j, float(-S.status[j])), order_of_leaving(P, C, S, W, j)
    if order * S.status[j] > 0:
        return order
    return (1 if far > 0.0 else -1) if order * far > 0.0 else 0


@kernel
def _hold_what_is_met_again(P, S, W, size):
    """Of W.instant.active[:size] those hold, with all that they have, that would stay on their side once more and are
    met again at once: their field there is rounding."""
    for a in range(size if S.stalled > AGAIN else 0):
        j = W.instant.active[a]
        if S.status[j] != W.instant.came[j] or not _has_no_speed(P, S, W, j):
            continue
        came, S.status[j] = S.status[j], SOLVED
        mask_solved(P, S, W)
        if not follow(P, S, W) or abs(S.mult[j]) > 1.0 + AT_BOUND:
            S.status[j], S.mult[j] = came, float(came)
            mask_solved(P, S, W)
            follow(P, S, W)


@kernel
def _is_minute(P, C, S, W, j, speed, interval):
    """Whether an arc about surface j that takes `interval` is within the states' absolute tolerances of 0, or nothing
    beside the farthest one: no unit of the states decides."""
    height = 0.25 * abs(speed) * interval
    return height < max(surface_tolerance(P, C, W, j), C.rtol * S.arcs[j, 1])


@kernel
def _look_at_arcs(P, C, S, W, j):
    """Overwrites the tolerances of the arcs to come: those about surface j may shrink to nothing in finite time."""
    leads = W.step.nears == SWITCHING and W.step.leader == j
    ahead = arc_ahead(P, S, W, j)
    grows = 1.0 <= S.last[j, 2] < math.inf
    if ahead < S.last[j, 1] or not grows:
        if leads or W.step.nears != SWITCHING or S.t - S.last[W.step.leader, 0] > 10.0 * S.last[j, 1]:
            follow_arcs(P, C, S, W, j, ahead)
    elif leads:
        follow_as_asked(P, C, W)


@kernel
def _is_flat(P, C, S, W, j):
    """Whether surface j is 0 and stays there, as that of Max(1 - t, 0) from t = 1 on."""
    evaluate_surfaces(P, S, W)
    return abs(W.h[j]) <= P.wave[j] * surface_rounding(P, S, j, W) and order_at_rest(P, C, S, W, j)[1]


@kernel
def _note_those_inside(P, S, W):
    """Overwrites instant.waits, and instant.stood of switches; whether one is met in whose surface another may stand
    that is met too."""
    nested, met = False, 0
    for j in range(P.m):
        W.instant.waits[j] = 0
        if W.instant.hit[j] and P.kind[j] < DISC:
            W.instant.waits[j] = NOW if abs(S.status[j]) == 1 else 0
            nested = nested or P.nested[j] != 0
            met += 1
    inside = nested and met > 1
    if inside:
        evaluate_surfaces(P, S, W)
        for j in range(P.m):
            W.instant.stood[j] = W.h[j]
    return inside


@kernel
def _cross(P, C, S, R, W, j, jumped):
    """Switch j, which is met and does not slide, goes over to its other side, or rests; a code, and whether it goes."""
    W.instant.waits[j] = 0
    if not jumped and rests_on_kink(P, C, S, R, W, j):
        return GO_ON, False
    went = -S.status[j]
    if jumped:
        if P.step_unit != 0:
            step_inside(P, S, j, W)
        order, stays = order_at_rest(P, C, S, W, j)
        went = S.status[j] if order == 0 or stays else 1 if order > 0 else -1
        if stays and rests_at_zero(P, S, R, W, j):
            return GO_ON, False
    elif P.nested[j] != 0 and P.at_zero[j] != ANY and _is_flat(P, C, S, W, j):
        if rests_at_zero(P, S, R, W, j):
            return GO_ON, False
    if went != S.status[j]:
        record_event(S, R, j, EV_CROSSING, S.status[j], went)
    S.status[j] = went
    S.mult[j] = float(went)
    S.deflate[j] = 1
    speed = approach_speed(P, S, j, W)
    note_arc(S, j, speed)
    singular = has_branch_point(P, j)
    if singular:
        _look_at_arcs(P, C, S, W, j)
    interval = arc_ahead(P, S, W, j) if singular else S.last[j, 1]
    S.minute = S.minute + 1 if _is_minute(P, C, S, W, j, speed, interval) else 0
    told = singular and P.kind[j] == SECOND_ORDER  # an arc that has not been seen yet
    if S.minute > 0 and told and come_to_rest(P, C, S, R, W, j, 0.0):
        S.minute = 0
        return GO_ON, True
    if S.minute > _MOST_MINUTE:
        if P.kind[j] != SECOND_ORDER:
            return Outcome.CHATTERING, True
        record_event(S, R, j, EV_ACCUMULATION, S.status[j], 0)
        forget_intervals(S.last[j], S.t)
        stop_normal_speed(P, S, j, W, False)
        W.instant.active[0] = j
        hold_second_order(P, S, R, W, 1)
        record_ambiguity(S, R, j, AMB_CHATTERING, S.status[j])
        S.minute = 0
    if P.step_unit != 0:
        step_inside(P, S, j, W)
    return GO_ON, True


@kernel
def _settle_switches(P, C, S, R, W):
    """Every switch that is met leaves its bound, crosses or slides; a code, and whether one has changed."""
    instant = W.instant
    m, mult, status = P.m, S.mult, S.status
    jumped = instant.jumped != 0
    if jumped:
        sides_after_jump(P, S, R, W)
        for j in range(m):
            instant.hit[j] = instant.hit[j] and not is_clocked(C, j)  # it has crossed by the clock
        if P.discs != 0:
            free_components(P, S, W)
        stay_at_rest(P, C, S, R, W)
        hold_what_rests(P, S, R, W)
    switched = jumped
    size, later = 0, False
    inside = _note_those_inside(P, S, W)
    for j in range(m):
        if not instant.hit[j] or P.kind[j] >= DISC or status[j] == HELD:
            continue
        if inside and P.nested[j] != 0:
            leave_what_jumps(P, S, R, W)
            if not instant.hit[j]:
                continue  # it has jumped with a switch that stands in it
        if status[j] == SOLVED:
            if not jumped:
                # d2h/dt2 of a second-order slide is 0 there, unless a force has jumped.
                smooth = P.kind[j] == SECOND_ORDER and abs(mult[j]) <= 1.0 + AT_BOUND
                if P.kind[j] == SLIDING:
                    if some_second_order(P) and hold_instead(P, S, R, W, j):
                        continue
                    code = leave_loop(P, S, R, W, j)
                    if code == NOTHING:
                        code = hand_over(P, S, R, W, j, W.meeting.exit_side[j])
                    if code == GO_ON:
                        continue
                    if code != NOTHING:
                        return code, True
                status[j] = W.meeting.exit_side[j]
                mult[j] = float(status[j])
                S.deflate[j] = 3 if smooth else 2
                if P.kind[j] == SECOND_ORDER:
                    hold_beside(P, S, W)  # by friction that may take over, which has been held so far
                if status[j] != HELD:
                    record_event(S, R, j, EV_TANGENCY, 0, status[j])
                    part_or_press(P, S, W, j)
                    switched = switched or (P.discs != 0 and some_share(P, S))
        elif inside and jumps_with_another(P, S, W, j):
            instant.waits[j], later = LATER, True
        elif P.kind[j] == SLIDING:
            instant.active[size] = j
            size += 1
        else:
            code, crossed = _cross(P, C, S, R, W, j, jumped)
            if code != GO_ON:
                return code, True
            switched = switched or crossed
    if P.discs != 0:
        code, some = settle_discs(P, C, S, R, W, jumped)
        if code != GO_ON:
            return code, True
        switched = switched or some
    if later and jumped:
        place_those_that_wait(P, S, W, size)
    if size > 0:
        code = _arrivals(P, C, S, R, W, size, jumped, switched or instant.at_clock != 0)
        if code != GO_ON:
            return code, True
        switched = True
    if later:
        code = _settle_what_jumps(P, C, S, R, W, jumped)
        if code != GO_ON:
            return code, True
        switched = True
    if switched and _rest_anew(P, S, W, jumped):
        instant.unsettled = int(not settle_beside(P, C, S, R, W))
    return GO_ON, switched


@kernel
def _settle_what_jumps(P, C, S, R, W, jumped):
    """Switches whose surfaces jump with others of this instant: what is still met settles behind these; a code."""
    instant = W.instant
    for j in range(P.m):
        if instant.waits[j] == LATER and abs(S.status[j]) == 1 and abs(instant.came[j]) == 1:
            S.status[j] = instant.came[j]  # it was somewhere in between
            S.mult[j] = float(S.status[j])
    for _ in range(P.m):
        leave_what_jumps(P, S, R, W)
        if next_that_wait(P, S, W) == 0:
            break
        code, size = GO_ON, 0
        for j in range(P.m):
            if instant.waits[j] == NOW and P.kind[j] != SLIDING and code == GO_ON:
                code = _cross(P, C, S, R, W, j, jumped)[0]
        for j in range(P.m):
            if instant.waits[j] == NOW:
                instant.active[size] = j
                size += 1
        if code == GO_ON and size > 0:
            code = _arrivals(P, C, S, R, W, size, jumped, True)
        if code != GO_ON:
            return code
    return GO_ON


@kernel
def _rest_anew(P, S, W, jumped):
    """Whether others may rest on their surfaces because of what a switch has done: a jump, a turn of the rates, or a
    change to a side on which nothing moves it off its surface. What slides says nothing of them."""
    if not any_kind(P, CROSSING):
        return False
    may = False
    for j in range(P.m):
        if P.kind[j] >= DISC or not W.instant.hit[j] or S.status[j] == W.instant.came[j]:
            continue
        if P.kind[j] != SLIDING or jumped:
            may = True
        elif abs(S.status[j]) != 1:
            return False
        else:
            may = may or abs(approach_speed(P, S, j, W)) <= W.instant.rest_speed
    return may


@kernel
def _leave_folds(P, S, R, W, fold):
    """What stands at the folds of its roots leaves them, one after the other: the others have no root meanwhile."""
    folds = W.instant.folds
    for j in range(P.m):
        if folds[j] != 0:
            S.status[j] = HELD
    code = _leave_fold(P, S, R, W, fold, W.instant.way)
    for j in range(P.m):
        if folds[j] != 0 and code == GO_ON:
            S.status[j] = SOLVED
            code = _leave_fold(P, S, R, W, j, folds[j])
    return code


@kernel
def _leave_fold(P, S, R, W, fold, way):
    """The switch or disc that stands at the fold of its root goes where its layer takes it from there; a code."""
    mult, status, at_fold = S.mult, S.status, S.mult[fold]
    if P.disc_of[fold] < 0:
        code = hand_over(P, S, R, W, fold, way)
        if code != NOTHING:
            return code
    S.layers += 1
    outcome = call_layer_unit(P.layer_unit, P, S, W, LEAVE_FOLD, fold, way, 0.0)
    code = layer_code(P, S, R, fold, outcome)
    if code == GO_ON and P.disc_of[fold] >= 0:
        fold = P.disc_of[fold]
        at_fold = mult[fold]
        code = slip_by_layer(P, S, W, fold)
    if code != GO_ON:
        return code
    # A fold at the bound is left as a tangency is: the field does not jump.
    S.deflate[fold] = 2 if status[fold] != SOLVED and abs(mult[fold] - at_fold) <= 1e-6 else 1
    record_event(S, R, fold, EV_FOLD_TO_SLIDING if status[fold] == SOLVED else EV_FOLD, 0, status[fold])
    return GO_ON


@kernel
def _left_behind(P, S, W, i):
    """Whether surface i, met at the last instant, has since changed by more than rounding."""
    evaluate_surfaces(P, S, W)
    return abs(W.h[i]) > surface_rounding(P, S, i, W)


@kernel
def _forget_what_was_met(P, S, W):
    """Before another look at the contacts of an instant: nothing is met but by what they do now."""
    instant = W.instant
    instant.jumped = 0
    for j in range(P.m):
        instant.hit[j] = False
        instant.came[j] = S.status[j]
        W.firing.switch_level[j] = math.nan


@kernel
def _follow_up(P, C, S, R, W):
    """Switches inside surfaces that have jumped, and sliding ones whose residual has; returns a code."""
    sides_after_crossing(P, S, R, W)
    hold_by_what_jumps(P, S, R, W)
    for j in range(P.m):
        W.instant.status[j] = S.status[j]
    switches = AT_REST if W.instant.jumped != 0 else ALONE
    code = resettle_discs(P, C, S, R, W, switches) if P.discs != 0 else GO_ON
    if code == GO_ON:
        code = resettle(P, C, S, R, W)
    if code == GO_ON and P.discs != 0 and some_share(P, S):
        code = resettle_discs(P, C, S, R, W, switches)  # what a switch has held it may have let go
    for j in range(P.m):
        if S.status[j] != W.instant.status[j] and S.status[j] != HELD and P.kind[j] != COMPONENT:
            record_event(S, R, j, EV_RESET, SOLVED, S.status[j])
    return code


@kernel
def _enter_domains(P, S, W):
    """Sets a state under a root to 0 if it is below 0 by a rounding, and passes 0 upwards within this instant."""
    evaluate_surfaces(P, S, W)
    for i in range(P.ne):
        j, k = P.m + i, P.watch_state[i]
        if P.watch[i] > POLE and k >= 0 and W.h[j] < 0.0:
            if -W.h[j] <= AT_ONCE * time_size(S) * surface_speed(P, W, j):
                S.x[k] = 0.0


@kernel
def _is_freed(P, S, W):
    """Whether a contact or switch that held the motion before this instant has let it go."""
    for j in range(P.m):
        if W.instant.came[j] == SOLVED and S.status[j] != SOLVED and P.kind[j] != ALGEBRAIC:
            return True
    return False


@kernel
def _leave_what_was_rested_on(P, C, S, R, W):
    """After a release: switches that the motion crosses, on whose surfaces it has rested, are on the side to which it
    goes, and left from there. A slip that begins in a disc takes them along itself."""
    changed = False
    for j in range(P.m):
        if begins(P, S, j):
            return
    evaluate_surfaces(P, S, W)
    for j in range(P.m):
        crossed = (P.kind[j] == KINK or P.kind[j] == CROSSING) and abs(S.status[j]) == 1
        if not crossed or S.deflate[j] != 0 or abs(W.h[j]) > surface_rounding(P, S, j, W):
            continue
        order = order_of_leaving(P, C, S, W, j)
        S.deflate[j] = abs(order)
        if order * S.status[j] < 0:
            record_event(S, R, j, EV_CROSSING, S.status[j], -S.status[j])
            S.status[j] = -S.status[j]
            S.mult[j], changed = float(S.status[j]), True
        evaluate_surfaces(P, S, W)
    if changed:
        sides_after_crossing(P, S, R, W)


@kernel
def _sides_of_events(P, C, S, W, freed):
    """Sets the sides of events on whose surfaces x stands to where the motion goes on, which may have turned.

    If what held the motion has `freed` it, these are all such events; else those that were met.
    """
    for i in range(P.m, P.m + P.ne):
        if S.deflate[i] != 0 and P.watch[i - P.m] == 0 and (freed or W.instant.hit[i]):
            way = approach_speed(P, S, i, W)
            rests = abs(way) <= W.instant.rest_speed
            if P.nested[i] != 0 or rests:  # unknowns in it move as well; or only its acceleration tells
                order = order_of_leaving(P, C, S, W, i)
                S.deflate[i], way = max(S.deflate[i], abs(order)), float(order)
            if way != 0.0:
                S.side[i - P.m] = 1 if way > 0.0 else -1


@kernel
def _note_clocks(P, C, S, W):
    """Switches of time alone whose instants have come are met."""
    tick = S.ticks
    while tick < len(C.clock) and C.clock[tick] <= S.t:
        if C.clock_event[tick] >= P.ne:
            W.instant.hit[C.clock_event[tick] - P.ne] = True
        tick += 1


@kernel
def _note_what_is_met(P, C, S, W):
    """Overwrites instant.hit, known zeros of S and instant.came; states that are surfaces are put on them."""
    instant = W.instant
    m, ne, status, elapsed = P.m, P.ne, S.status, instant.elapsed
    within, told, late = max(at_once_within(S.t, W.step.length), AT_ONCE * elapsed), 0.0, 0.0
    if W.step.kind == PAIR:
        evaluate_surfaces(P, S, W)
        told = _OF_A_FIT * elapsed
        for i in range(m + ne):
            first = W.meeting.tau[i] <= 1.0 and (W.meeting.tau[i] - instant.met) * W.step.length <= within
            late = max(late, late_by(P, W, i)) if first else late
        late = min(late, told)
    for i in range(m + ne):
        later = (W.meeting.tau[i] - instant.met) * W.step.length
        instant.hit[i] = W.meeting.tau[i] <= 1.0 and later <= max(within, told)
        if instant.hit[i] and later > within:
            near = surface_rounding(P, S, i, W) + 2.0 * late * abs(surface_speed(P, W, i))
            instant.hit[i] = abs(W.h[i]) <= near
        if not instant.hit[i] and (S.deflate[i] != 0 or W.meeting.rounding[i] > 0.0):
            if rested_on(P, S, W, i):
                S.deflate[i] = orders_at_rest(S, i)
            elif elapsed > 1e-12 * time_size(S) or _left_behind(P, S, W, i):
                S.deflate[i] = 0
        if i < m and begins(P, S, i):
            S.mult[i] = INSIDE  # at h = 0 still: its direction is not yet h/|h|
    if instant.at_clock:
        _note_clocks(P, C, S, W)
    for i in range(ne):
        # One surface, met once: roundings may put its two series' zeros on either side of the step's end.
        j = abs(P.twin[i]) - 1
        if j < 0 or P.watch[i] != 0 or instant.hit[m + i] == instant.hit[j]:
            continue
        if S.side[i] * P.twin[i] == status[j] * (j + 1):
            instant.hit[m + i] = instant.hit[j] = True
    if instant.fold >= 0:
        instant.hit[instant.fold] = False
    for j in range(m):
        instant.came[j] = status[j]
        W.firing.switch_level[j] = math.nan
        if instant.hit[j] and status[j] != SOLVED and P.surface_state[j] >= 0:
            S.x[P.surface_state[j]] = 0.0
        elif instant.hit[j] and status[j] != SOLVED and P.kind[j] < DISC and P.step_unit != 0:
            step_inside(P, S, j, W)  # the last state of this side: on the other one its field may not exist
    if P.watches != 0:
        _enter_domains(P, S, W)


@kernel
def _unknowns_turn(P, W):
    """Whether a kink of what an unknown stands in has been met: both sides lead back to it where a root ends there."""
    found = False
    for j in range(P.m):
        found = found or (W.instant.hit[j] and P.nested[j] != 0 and P.kind[j] == KINK)
    return found and any_kind(P, ALGEBRAIC)


@kernel
def _closed(P, S):
    """How many contacts are closed."""
    closed = 0
    for j in P.contact:
        closed += int(S.status[j] == SOLVED)
    return closed


@unit(types.int64, Problem, Control, State, Record, Work)
def at_instant(P, C, S, R, W):
    """Acts on everything that happens at the present instant, at which S already stands. Returns a code.

    Reads of W.instant: met, elapsed, fold, way and at_clock; sets jumped, together and solved_there.
    """
    for i in range(P.n):
        W.size[i] = max(W.size[i] if S.started != 0 else 0.0, abs(S.x[i]))
    if S.started == 0:
        return start(P, C, S, R, W)
    instant = W.instant
    fold, elapsed = instant.fold, instant.elapsed
    instant.jumped = 0
    instant.together = 0
    if instant.rests >= 0:
        j, instant.rests = instant.rests, -1
        record_point(P, S, R)
        if come_to_rest(P, C, S, R, W, j, W.step.left):
            record_point(P, S, R)
        else:
            W.step.refused = j
        return GO_ON
    W.step.refused = -1
    _note_what_is_met(P, C, S, W)
    if fold >= 0:
        note_folds_beside(P, S, W)
    if R.tape.shape[0] > 0:
        put_causes_on_tape(P, C, S, R, W)
    record_point(P, S, R)
    S.stalled = S.stalled + 1 if elapsed <= UNTOLD * time_size(S) else 0
    events_before, closed = S.events, _closed(P, S)
    endless = S.stalled > MOST_AT_ONCE
    if endless or (len(P.contact) > 1 and collapses(P, S, W)):
        # Derivatives do not go through what is told as one instant.
        if len(P.contact) > 0 and R.tape.shape[0] == 0 and impact_to_the_end(P, S, R, W, endless):
            S.stalled = 0
        elif endless:
            return Outcome.NO_ROOT if _unknowns_turn(P, W) else Outcome.CHATTERING
    only = only_one(P, S, W) if fold < 0 and instant.at_clock == 0 else -1
    if only >= 0:
        code = cross_stick_or_leave(P, S, R, W, only)
        if code != NOTHING and (code != GO_ON or not is_passed(S, only)):
            if _is_freed(P, S, W):
                _leave_what_was_rested_on(P, C, S, R, W)
                _sides_of_events(P, C, S, W, True)
            record_point(P, S, R)
            return code
        if code == NOTHING:
            only = -1
        instant.solved_there = 0
    stop, jumped = GO_ON, False
    struck = instant.at_clock != 0 and strike_switches(P, C, S, R, W)
    changed = struck or instant.released != 0
    instant.released = 0
    if P.ne == 0 and instant.at_clock != 0:
        while S.ticks < len(C.clock) and C.clock[S.ticks] <= S.t:
            S.ticks += 1
    if only < 0 and P.ne > 0:
        stop = events(P, C, S, R, W, struck)
        jumped = instant.jumped != 0
        if stop == Outcome.EVENTS_ACCUMULATE:
            record_point(P, S, R)
        if stop != GO_ON and stop != Outcome.TERMINATED:
            return stop
    code = _settle(P, C, S, R, W, fold, only, changed)
    for _ in range(P.ne + MOST_AT_ONCE):
        # What impacts and switches have done to the surfaces of events is looked at when they have come to an end.
        carries = only < 0 and (jumped or may_be_carried(P)) and (code == GO_ON and stop == GO_ON)
        if not carries or not carried_along(P, S, W):
            break
        if S.events - events_before + 2 * (P.m + P.ne) + MOST_AT_ONCE > R.most_events:
            return Outcome.EVENT_LOOP
        _forget_what_was_met(P, S, W)
        stop = fire_due(P, S, R, W)
        note_those_carried(P, S, W)
        jumped = jumped or instant.jumped != 0
        if stop != GO_ON and stop != Outcome.TERMINATED:
            return stop
        code = _settle(P, C, S, R, W, -1, -1, False)
    else:
        return Outcome.EVENT_LOOP  # what events do is undone by an impact, for ever
    if code != GO_ON:
        return code
    if len(P.contact) > 0:
        stop_closed(P, S, W)
        if _closed(P, S) > closed:
            settle_beside(P, C, S, R, W)  # on what the contact keeps from there
            hold_what_contacts_keep(P, S, R, W)
    freed = _is_freed(P, S, W)
    if P.ne > 0:
        _sides_of_events(P, C, S, W, freed)
    if S.events > events_before:
        record_point(P, S, R)
    if C.strict and S.ambiguities > 0:
        return Outcome.AMBIGUITY
    return stop


@kernel
def _settle(P, C, S, R, W, fold, only, changed):
    """Contacts and switches in turns until neither changes; a code. `changed`: whether something has, before.

    What leaves a fold comes first: there is no root there by which contacts could be looked at.
    """
    instant = W.instant
    if fold >= 0:
        code = _leave_folds(P, S, R, W, fold)
        if code != GO_ON:
            return code
        changed = True
    for turn in range(MOST_AT_ONCE + 1):
        if turn == MOST_AT_ONCE:
            return Outcome.CHATTERING
        contacts = UNCHANGED
        if len(P.contact) > 0:
            if turn > 0:
                # What the contacts do has its own consequences: look again, at nothing but these.
                _forget_what_was_met(P, S, W)
            if is_behind(P, C, S, W, instant.jumped != 0):
                record_point(P, S, R)
                return Outcome.BEHIND_CONTACT
            contacts = settle_contacts(P, S, R, W)
            if contacts < UNCHANGED:
                return outcome_of(contacts)
            if turn > 0 and contacts == UNCHANGED:
                break
        if P.discs != 0:
            let_go_without_load(P, S, R, W)
        code, switched = NOTHING, True
        if only < 0 or turn > 0:
            code, switched = _settle_switches(P, C, S, R, W)
            if code != GO_ON:
                return code
        code = pass_accumulation(P, C, S, R, W) if turn == 0 else NOTHING
        if code != GO_ON and code != NOTHING:
            return code
        if switched or changed or code == GO_ON or contacts != UNCHANGED:
            code = _follow_up(P, C, S, R, W)
            if code == GO_ON and instant.unsettled != 0 and settle_beside(P, C, S, R, W):
                code = _follow_up(P, C, S, R, W)
            instant.unsettled = 0
            if code != GO_ON:
                return code
        if len(P.contact) == 0 or instant.look_again == 0:
            break
    if _is_freed(P, S, W):
        _leave_what_was_rested_on(P, C, S, R, W)
    return GO_ON
