"""Where a step first meets a surface, or a solved multiplier its bound, on the step's polynomials.

Chain: steps.py (the polynomials) -> **this file** (roots.py finds the zeros) -> trajectory.py, which acts on the first.
"""

import math

from ..intervals import time_size
from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import load8, store8
from ..machine.pointers import at, call_act, call_linear
from ..state import ALGEBRAIC, COMPONENT, CONTACT, DISC, HELD, KINK, PAIR, SLIDING, SOLVED, START
from ..surface.sliding import sum_terms, surface_size, surface_speed, surface_tolerance
from .collocation import DEFECT
from .finer import SWITCHING
from .rhythm import expected
from .roots import GRAZING, NO_ROOT, first_root, low_bounds, remainder
from .steps import REACH, SURFACE_ROUNDING, dot, powers, scaled, surface_rows, variation

_LEAST = 1e-3  # of its tolerance: the rounding of a state that is a surface, where its arcs shrink
_ROUNDING = 1e-13  # of what the terms of a series add up to
_ROUNDING_OF_A_FIT = 1e-12  # of a lambda near 1 in the terms of the pair's fit: 2^-53 times some thousands
_ROUNDING_OF_A_SERIES = 1e-14  # of what a surface is made of: the rounding of its Taylor series
_FOLLOWED = 100.0  # times as large: the rounding of rates in which the pair has solved for multipliers
_STANDS = 1e-13  # of the largest value that a surface has had: so near to 0 the states stand on it
_ALIKE = 1e-12  # of gradients: surfaces that are multiples of each other
_TOUCHES = 4  # orders to which a surface or a bound may be touched where a step begins, but for exact zeros
_BEFORE = 1e-6  # of a step
_AT_ONSET = 1e-3  # of a step: as near to its beginning as a defect makes a zero
_RESTING = 8  # terms of a series that are looked at
_NEARBY = 1e3  # times that: worth a look
_CURVED = 1e-6  # of a surface's change on the step: less is the bend of one that crosses with its slope 0
_STEEP = 1e-3  # of the slope with which a surface would have come straight: one that is crossed
_SHALLOW = 10.0  # tolerances: the interpolant of the pair is less good than its step


@inlined_kernel
def _past_touches(row, power, poly, degree, drop, sign, rounding):
    """The zero orders to drop where a step begins: more than known, if they are rounding and the next leads away."""
    more, lowest = 0, math.inf
    while more < degree and abs(at(poly, more)) <= (rounding if more < _TOUCHES else 0.0):
        lowest = min(lowest, at(poly, more))
        more += 1
    if lowest <= 0.0 and at(poly, more) > 0.0:
        drop += more
        scaled(row, power, poly, degree, drop, sign)
    return drop


@inlined_kernel
def meet(P, row, power, degree, drop, sign, W, rounding=SURFACE_ROUNDING, unknown=0.0, held=0.0):
    """First zero of sign * row on the step, known zero orders dropped; leaving at rounding level is none. Of terms
    below `unknown` nothing is known; what moves by no more than `held` rests where the step begins."""
    if drop == 2 and abs(at(row, 1)) > 1e-3 * abs(at(row, 2)) * at(power, 1):
        # Left with a slope, not tangentially: an algebraic unknown, or a field that has jumped again at this instant.
        drop = 1
    poly = W.roots.poly
    scaled(row, power, poly, degree, drop, sign)
    if held > 0.0:
        moved = 0.0
        for k in range(degree - drop + 1):
            moved += abs(poly[k])
        if moved * at(power, drop) <= held:
            return NO_ROOT
    if poly[0] <= rounding:
        size = 0.0
        for k in range(degree - drop + 1):
            size += abs(poly[k])
        if size <= (rounding if drop < 3 else 0.0):
            return NO_ROOT  # it rests where it is
        if drop < 3:
            told = _ROUNDING * size
            if unknown > 0.0:
                told = max(told, unknown / at(power, drop))
            drop = _past_touches(row, power, poly, degree, drop, sign, told)
    return first_root(P, W.roots, degree - drop)


@kernel
def _meet_at_onset(P, C, S, row, j, drop, sign, W, rounding, held):
    """As `meet`, where a slip begins from rest with no acceleration: a zero that unknown terms would make behind a
    start on the surface is that of the start. They are twice the defect of a step by collocation, as large where it
    begins as where it is looked at."""
    power, unknown = W.step.power, 0.0
    if W.onset.goes_on == 0 and (j >= P.m or P.kind[j] != CONTACT):
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        unknown = 2.0 * DEFECT * (surface_tolerance(P, C, W, j) + C.rtol * variation(row, power, C.order))
    met = meet(P, row, power, C.order, drop, sign, W, rounding, unknown, held)
    stands = unknown > 0.0 and drop == 0 and sign * at(row, 0) <= rounding
    return 0.0 if stands and met <= _AT_ONSET and abs(at(row, 1)) * at(power, 1) <= unknown else met


@inlined_kernel
def _meet_bounds(P, C, S, row, power, degree, j, W):
    """First zero of 1 - lambda or 1 + lambda on the step: the tangency exit; its side in W.meeting.exit_side."""
    roots = W.roots
    poly = roots.poly
    scaled(row, power, poly, degree, 0, 1.0)
    lo, hi = low_bounds(poly)
    rest = remainder(poly, degree)
    best = NO_ROOT
    if lo - rest > -1.0 and hi + rest < 1.0:
        return best
    heading = 1 if at(poly, 1) > 0.0 else -1
    for turn in range(2):
        side = heading if turn == 0 else -heading
        drop = 1 if 1.0 - side * S.mult[j] <= 1e-15 else 0
        scaled(row, power, poly, degree, drop, -1.0 * side)
        if drop == 0:
            poly[0] += 1.0
        else:
            # lambda stands at its bound and moves by less than rtol, as at rest under exactly the largest friction: no
            # exit. So small a motion may be rounding of the series, which a step lets grow to rtol/100.
            size, change = 0.0, 0.0
            for k in range(degree):
                size += abs(poly[k])
                change += poly[k]
            # Of collocation the end is known, and not how the polynomial goes there.
            if (abs(change) if W.step.kind == START else size) <= C.rtol:
                continue
            told = _ROUNDING * size
            if P.pair != 0:
                told = max(
                    told, _ROUNDING_OF_A_FIT / at(power, drop)
                )  # lambda without its first term, over time
            drop = _past_touches(row, power, poly, degree, drop, -1.0 * side, told)
        if best > 1.0:
            best = first_root(P, W.roots, degree - drop)
            if best <= 1.0:
                W.meeting.exit_side[j] = side
            continue
        # The other bound matters up to there only, and is hardly ever near.
        powers(W.step.end_power, best)
        for k in range(0, degree - drop + 1, 8):
            store8(poly, k, load8(poly, k) * load8(W.step.end_power, k))
        roots.guess = 0.0
        noted, at_first = roots.dips, roots.dip_at
        roots.dips = 0
        s = first_root(P, W.roots, degree - drop)
        if roots.dips != 0:
            roots.dip_at *= best
        elif noted != 0:
            roots.dips, roots.dip_at = noted, at_first
        if s < 1.0 and best > 0.0:
            best *= s
            W.meeting.exit_side[j] = side
    return best


@inlined_kernel
def _note_size(P, C, W, i, row, drop):
    """Leaves in roots.shallow the size of surface i so far, which a dip is measured by, if the pair makes the steps.

    A jet's step goes from afar to a tangency; the pair's last ones begin close to it, and are as good as its tolerance.
    """
    meeting = W.meeting
    if P.pair:
        meeting.widest[i] = max(meeting.widest[i], abs(at(row, 0)))
        W.roots.shallow = meeting.widest[i] * max(1.0, _SHALLOW * C.rtol / GRAZING) if drop == 0 else 0.0


@kernel
def _kink_met(P, C, S, row, power, j, met, W):
    """Where in the step kink j is met, if a series says at `met`.

    The field is continuous there, so the first nonzero derivative of h agrees on both sides: where both lead back to
    the surface it is rounding. A kink that stays well within the tolerance of 0 is no event.
    """
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    tolerance = max(0.01 * C.rtol, 1e-13) * surface_size(P, S, j, W)
    leads_to_it = row[2] == 0.0 and W.step.length <= 2.0 * REACH * time_size(S)  # by reach_singular_surface
    if abs(row[0]) > tolerance or leads_to_it:
        return met
    poly = W.roots.poly
    scaled(row, power, poly, C.order, 0, float(S.status[j]))
    size = 0.0
    for k in range(1, C.order + 1):
        size += abs(poly[k])
    if size <= tolerance:
        return NO_ROOT
    # It leaves with the second derivative, and the first one is rounding: a dip of no depth.
    if met <= 0.0 and poly[2] > 0.0 and poly[1] * poly[1] <= 4.0 * tolerance * poly[2]:
        scaled(row, power, poly, C.order, 2, float(S.status[j]))
        return first_root(P, W.roots, C.order - 2)
    return met


@inlined_kernel
def is_clocked(C, j):
    """Whether switch j crosses at instants that are known: it is not looked for."""
    return len(C.clock_side) > 0 and C.clock_side[j] != 0


@inlined_kernel
def _begins_on(P, S, W, i):
    """Whether the step begins on surface i: it has been met, or what has been met there has put the states on it."""
    row = surface_rows(P, W.step.kind)[i]
    if row < 0 or (i < P.m and S.status[i] == SOLVED):
        return False
    return S.deflate[i] != 0 or abs(W.step.rows[row, 0]) <= max(SURFACE_ROUNDING, _STANDS * W.meeting.widest[i])


@inlined_kernel
def _slope(P, W, i, k):
    """dh_i/dx_k, from W.dh."""
    for e in range(P.dh_row[i], P.dh_row[i + 1]):
        if P.dh_col[e] == k:
            return W.dh[e]
    return 0.0


@inlined_kernel
def _are_alike(a, b):
    return abs(a - b) <= _ALIKE * (abs(a) + abs(b))


@kernel
def _is_held(P, S, W, i):
    """Whether what holds the motion on another surface keeps it on surface i, too: the gradient of one
    is a multiple of that of the other, in time also; from W.dh."""
    in_time = P.dh_row[P.m + P.ne]
    for j in range(P.m if P.nested[i] == 0 else 0):
        rests = S.status[j] == SOLVED or (S.status[j] == HELD and P.kind[j] == SLIDING)
        if j == i or not rests or P.kind[j] == ALGEBRAIC or P.kind[j] == DISC or P.nested[j] != 0:
            continue
        factor = 0.0
        for e in range(P.dh_row[j], P.dh_row[j + 1]):
            if W.dh[e] != 0.0 and factor == 0.0:
                factor = _slope(P, W, i, P.dh_col[e]) / W.dh[e]
        alike = factor != 0.0 and _are_alike(W.dh[in_time + i], factor * W.dh[in_time + j])
        for e in range(P.dh_row[j], P.dh_row[j + 1]):
            alike = alike and _are_alike(_slope(P, W, i, P.dh_col[e]), factor * W.dh[e])
        for e in range(P.dh_row[i], P.dh_row[i + 1]):
            alike = alike and _are_alike(W.dh[e], factor * _slope(P, W, j, P.dh_col[e]))
        if alike:
            return True
    return False


@kernel
def _note_rounding(P, C, S, W):
    """Overwrites meeting.rounding and blur: what roundings may make of each surface on which the step begins, and by
    how much more for each unit of time that it takes; 0 of others.

    They are those of what the surface is made of, of the terms of its series and of all that adds up to the rates. A
    fit makes of the roundings of its nodes some thousands of them. Switches are looked at where something holds the
    motion; a surface on which it does rests there whatever a series says.
    """
    begins, first = False, P.m
    for i in range(P.m + P.ne):
        W.meeting.rounding[i] = W.meeting.blur[i] = 0.0
    for j in range(P.m):
        if S.status[j] == SOLVED and P.kind[j] != ALGEBRAIC:
            first = 0
    part, followed = (_ROUNDING_OF_A_FIT, _FOLLOWED) if P.pair != 0 else (_ROUNDING_OF_A_SERIES, 1.0)
    for i in range(first, P.m + P.ne):
        begins = begins or _begins_on(P, S, W, i)
    if not begins:
        return
    sum_terms(P, S, W, 0.0)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for i in range(first, P.m + P.ne):
        if _begins_on(P, S, W, i):
            way, length = 0.0, W.step.length
            for e in range(P.dh_row[i], P.dh_row[i + 1]):
                k = P.dh_col[e]
                terms = followed * length * W.terms[k]
                way += abs(W.dh[e]) * (variation(W.step.rows[k], W.step.power, C.order) + terms)
            if way < math.inf and length > 0.0:
                W.meeting.rounding[i] = math.inf if _is_held(P, S, W, i) else part * surface_size(P, S, i, W)
                W.meeting.blur[i] = part * way / length


@kernel
def rested_on(P, S, W, i):
    """Whether the last step began on surface i, and the motion has rested on it since."""
    row = surface_rows(P, W.step.kind)[i]
    if row < 0 or (i < P.m and (P.kind[i] != SLIDING or abs(S.status[i]) != 1)):
        return False
    if S.deflate[i] == 0 and (i < P.m or abs(W.step.rows[row, 0]) > W.meeting.rounding[i]):
        return False
    moved, power, length = 0.0, 1.0, W.step.length
    if W.step.kind == PAIR and W.step.sliding != 0:
        # Its fit has been made anew up to there, and of what is held it has roundings.
        length = min(length, W.end.length)
    for k in range(1, _RESTING):
        power *= length
        moved += abs(W.step.rows[row, k]) * power
    told = W.meeting.rounding[i] + length * W.meeting.blur[i]
    return moved <= max(SURFACE_ROUNDING if S.deflate[i] != 0 else 0.0, told)


@kernel
def late_by(P, W, i):
    """How far in time from the zero of surface i, which has been met, the instant is, by W.h and W.dh; 0 where it is
    nearly touched, which tells the instant by its square alone."""
    row, speed = surface_rows(P, W.step.kind)[i], abs(surface_speed(P, W, i))
    touched = row < 0 or speed * W.instant.elapsed <= _STEEP * abs(W.step.rows[row, 0])
    return 0.0 if touched else abs(W.h[i]) / speed


@inlined_kernel
def orders_at_rest(S, i):
    """The known zero orders of surface i, on which the motion rests on: one, where none was found up to the fourth."""
    return S.deflate[i] if 0 < S.deflate[i] < 4 else 1


@kernel
def leave_surfaces(P, S, W):
    """Behind a step: what was met before it is left, but where the motion has rested."""
    for i in range(P.m + P.ne):
        if S.deflate[i] != 0 or W.meeting.rounding[i] > 0.0:
            S.deflate[i] = orders_at_rest(S, i) if rested_on(P, S, W, i) else 0


@inlined_kernel
def find_first(P, C, S, W):
    """Overwrites tau and grazed: where in the step each surface or bound is met, grazed; returns the earliest met."""
    step, meeting = W.step, W.meeting
    rows, power, all_rows, mult_row, h = (
        step.rows,
        step.power,
        surface_rows(P, step.kind),
        step.mult_row,
        step.length,
    )
    roots = W.roots
    m, K, tau, status, kind, deflate = P.m, C.order, meeting.tau, S.status, P.kind, S.deflate
    best = NO_ROOT
    _note_rounding(P, C, S, W)
    for j in range(m):
        met = NO_ROOT
        roots.dips = 0
        roots.guess = expected(W, j, status[j], S.t, h)
        if status[j] == SOLVED:
            if kind[j] == CONTACT:
                met = meet(P, rows[mult_row + j], power, K, 1 if S.mult[j] <= 0.0 else 0, 1.0, W)
                meeting.exit_side[j] = 1
            elif kind[j] != ALGEBRAIC and kind[j] != COMPONENT:
                met = _meet_bounds(P, C, S, rows[mult_row + j], power, K, j, W)
        elif (
            all_rows[j] >= 0
            and status[j] != HELD
            and kind[j] != COMPONENT
            and kind[j] != DISC
            and not is_clocked(C, j)
        ):
            _note_size(P, C, W, j, rows[all_rows[j]], deflate[j])
            rounding, held = SURFACE_ROUNDING, meeting.rounding[j] + h * meeting.blur[j]
            if step.nears == SWITCHING and P.surface_state[j] >= 0:
                rounding = _LEAST * step.atol[P.surface_state[j]]
            if step.kind == START:
                met = _meet_at_onset(
                    P, C, S, rows[all_rows[j]], j, deflate[j], float(status[j]), W, rounding, held
                )
            else:
                met = meet(P, rows[all_rows[j]], power, K, deflate[j], float(status[j]), W, rounding, 0.0, held)
            if kind[j] == KINK and met <= 1.0:
                away = abs(at(rows[all_rows[j]], 0))
                meeting.widest[j] = max(meeting.widest[j], away)
                if away <= 1e-6 * meeting.widest[j]:
                    met = _kink_met(P, C, S, rows[all_rows[j]], power, j, met, W)
        roots.shallow = 0.0
        tau[j] = met
        best = min(best, met)
        meeting.grazed[j] = roots.dip_at if roots.dips != 0 else NO_ROOT
        meeting.graze_crosses[j] = roots.dip_crosses
    for i in range(m, m + P.ne):
        tau[i] = NO_ROOT
        meeting.grazed[i] = NO_ROOT
        if all_rows[i] >= 0 and P.watch[i - m] == 0:
            roots.dips = 0
            roots.guess = expected(W, i, S.side[i - m], S.t, h)
            _note_size(P, C, W, i, rows[all_rows[i]], deflate[i])
            row, side = rows[all_rows[i]], float(S.side[i - m])
            held = meeting.rounding[i] + h * meeting.blur[i]
            if step.kind == START:
                tau[i] = _meet_at_onset(P, C, S, row, i, deflate[i], side, W, SURFACE_ROUNDING, held)
            else:
                tau[i] = meet(P, row, power, K, deflate[i], side, W, SURFACE_ROUNDING, 0.0, held)
            best = min(best, tau[i])
            if roots.dips != 0 and _would_act(P, C, S, i - m, roots.dip_at, W):
                meeting.grazed[i], meeting.graze_crosses[i] = roots.dip_at, roots.dip_crosses
        roots.shallow = 0.0
    return best


@kernel
def _would_act(P, C, S, i, s, W):
    """Whether the `when` of event i holds where its surface is touched, or just before.

    Before, as a condition on the sign of what makes the surface turn there is on its own border: an element of a law
    of friction slips in its direction of motion, and a touch is where that turns round.
    """
    step, x = W.step, W.step.x
    for share in range(2):
        at_s = s * step.length * (1.0 if share == 0 else 1.0 - _BEFORE)
        powers(step.end_power, at_s)
        for k in range(P.n):
            x[k] = W.firing.after[k] = dot(step.rows[k], step.end_power, C.order + 1)
        t = (
            dot(step.rows[step.time_row], step.end_power, C.order + 1)
            if step.time_row >= 0
            else step.start + at_s
        )
        if call_act(P.act, i, t, x, S.mult, P.p, W.firing.after) != 0:
            return True
    return False


@kernel
def _undecided(C, W):
    """What a dip may have of a surface's size on the step and be none."""
    return max(GRAZING, _SHALLOW * C.rtol) if W.step.kind == PAIR else GRAZING


@kernel
def _touches_at(P, C, S, row, drop, sign, s, W):
    """Whether a polynomial, positive before, is touched at s of the step, where it is cut: zero with its slope."""
    poly, size, value, slope, bend, s_k = W.roots.poly, 0.0, 0.0, 0.0, 0.0, 1.0
    scaled(row, W.step.power, poly, C.order, drop, sign)
    for k in range(C.order - drop + 1):
        size += abs(poly[k]) * s_k
        value += poly[k] * s_k
        slope += k * poly[k] * s_k
        bend += k * (k - 1) * poly[k] * s_k
        s_k *= s
    small = _undecided(C, W) * size
    curved = size > SURFACE_ROUNDING and bend >= _CURVED * size
    return curved and abs(value) <= small and slope * slope <= 2.0 * small * bend


@kernel
def touched_at_the_end(P, C, S, fraction, W):
    """Notes as grazed what is touched where something else ends the step, at this share of it: what follows may be on
    either side."""
    step, meeting = W.step, W.meeting
    rows, all_rows, length, near = (
        step.rows,
        surface_rows(P, step.kind),
        fraction * step.length,
        _NEARBY * _undecided(C, W),
    )
    powers(step.end_power, length)
    for i in range(P.m + P.ne):
        solved = i < P.m and S.status[i] == SOLVED
        r = step.mult_row + i if solved else all_rows[i]
        if r < 0 or meeting.grazed[i] <= fraction or meeting.tau[i] < fraction:
            continue
        # Most are far from it: one look tells.
        row, value = rows[r], dot(rows[r], step.end_power, C.order + 1)
        side = 1.0 if value > 0.0 else -1.0
        if solved:
            if abs(side * value - 1.0) > near:
                continue
        elif abs(value) > near * (abs(row[0]) + length * (abs(row[1]) + length * abs(row[2]))):
            continue
        found = False
        if i >= P.m:
            if P.watch[i - P.m] == 0 and _touches_at(
                P, C, S, row, S.deflate[i], float(S.side[i - P.m]), fraction, W
            ):
                found = _would_act(P, C, S, i - P.m, fraction, W)
                powers(step.end_power, length)
        elif solved:
            if P.kind[i] != CONTACT and P.kind[i] != ALGEBRAIC and P.kind[i] != COMPONENT:
                at_bound = 1.0 - side * S.mult[i] <= 1e-15  # since the step's start
                keep = row[0]
                row[0] = keep - side
                found = not at_bound and _touches_at(P, C, S, row, 0, -side, fraction, W)
                row[0] = keep
        elif (
            S.status[i] != HELD
            and P.kind[i] != COMPONENT
            and P.kind[i] != DISC
            and P.kind[i] != KINK
            and not is_clocked(C, i)
        ):
            found = _touches_at(P, C, S, row, S.deflate[i], float(S.status[i]), fraction, W)
        if found:
            meeting.grazed[i], meeting.graze_crosses[i] = fraction, int(meeting.tau[i] <= fraction + GRAZING)


@inlined_kernel
def first_graze(P, W):
    """Where in the step the first surface is grazed."""
    first = NO_ROOT
    for j in range(P.m + P.ne):
        first = min(first, W.meeting.grazed[j])
    return first
