"""Deviations of a run's start and of its parameters along its tape, entry by entry.

The loop writes what it does and where it stands (step/recording.py); nothing is decided anew, so that the deviations
belong to this very run. Entries: a step; a point that is recorded; at an instant the surfaces, bounds, folds and ticks
of the clock that it is the zero of, then the updates that act, by rounds; and the end of the run.
"""

import math

import numpy as np

from ..machine.compiling import kernel
from ..machine.lanes import load8, splat8, store8
from ..machine.pointers import call_jet_general, call_jet_slip
from ..state import (
    ARC,
    CLOSING,
    DISC,
    PAIR,
    SLIP,
    SOLVED,
    START,
    TAPE_ACT,
    TAPE_BOUND,
    TAPE_CLOCK,
    TAPE_END,
    TAPE_FOLD,
    TAPE_NODE,
    TAPE_NOTHING,
    TAPE_POINT,
    TAPE_ROUND,
    TAPE_STEP,
    TAPE_SURFACE,
)
from ..step.steps import dot, powers
from .discs import close, collocate
from .flow import invert, move, number_unknowns, plan, put_in_lanes, way_within
from .saltation import (
    act,
    begin_instant,
    end_instant,
    keep_held,
    look,
    meet_again,
    meet_bound,
    meet_clock,
    meet_fold,
    meet_surface,
    multipliers,
)
from .state import UNKNOWN


@kernel
def _take_rows(V, reads, piece, s, rows):
    """Overwrites what is read of the rows by the polynomials of a step, which the run has kept, around its place s."""
    K, power, width = V.order, V.power, V.rows.shape[1]
    if s != 0.0:
        power[K] = 1.0
        for k in range(K - 1, -1, -1):
            power[k] = power[k + 1] * s
        store8(power, K + 1, splat8(0.0))
    for q in range(len(reads)):
        r = reads[q]
        row, kept = width * r, V.dense[piece, r]
        if s == 0.0:
            for k in range(0, K - 7, 8):
                store8(rows, row + k, load8(kept, k))
            store8(rows, row + K - 7, load8(kept, K - 7))
        else:  # order k becomes sum over i >= k of (i choose k) s^(i - k) times order i
            for k in range(0, K + 1, 8):
                total = splat8(0.0)
                for i in range(k, K + 1):
                    total = total + load8(V.binomials, width * i + k) * load8(power, K - i + k) * kept[i]
                store8(rows, row + k, total)
        store8(rows, row + K + 1, splat8(0.0))


@kernel
def _stand_in_columns(P, V, reads, piece, s):
    """The same for programs that make the series of columns, with states and multipliers where their parts begin."""
    n, m, stride, lanes = P.n, P.m, V.rows.shape[1], V.lanes
    rows = V.column_rows if lanes == 1 else V.rows_flat
    _take_rows(V, reads, piece, s, rows)
    for q in range(len(reads) if lanes > 1 else 0):
        for k in range(stride * reads[q], stride * reads[q] + V.order + 1):
            store8(V.column_rows, 8 * k, splat8(rows[k]))
    for i in range(n):
        put_in_lanes(lanes, V.column_x, i, V.x[i])
    for j in range(m):
        put_in_lanes(lanes, V.column_mult, j, V.mult[j])
        put_in_lanes(lanes, V.column_mult, m + j, 0.0)


@kernel
def jet(P, V, A, kind, t, piece, s):
    """Overwrites V.rows by the jet at (t, V.x, V.mult), s behind the start of the step, with what the program of A has
    to tell of its deviations; False where there is none."""
    stride, K = V.rows.shape[1], V.order
    own = A.own * stride
    if V.given and kind != ARC:
        _take_rows(V, A.reads, piece, s, V.rows_flat)
    if kind == SLIP:
        return call_jet_slip(A.jet, t, V.x, V.mult, P.p, K, stride, V.rows, own) == 0
    return (
        call_jet_general(A.jet, t, V.x, V.mult, V.bias if kind == ARC else P.p, V.mask, K, stride, V.rows, own)
        == 0
    )


@kernel
def factor(V, A, size):
    """Overwrites the right half of V.matrix by the inverse of g_lambda at order 0 of the rows."""
    for r in range(size):
        for c in range(size):
            V.matrix[r, c] = 0.0
    for e in range(A.by_mult.shape[0]):
        i, j = A.by_mult[e, 0], A.by_mult[e, 1]
        if V.unknown[i] >= 0 and V.unknown[j] >= 0:
            V.matrix[V.unknown[i], V.unknown[j]] = V.rows_flat[A.by_mult[e, 2]]
    return invert(V, size)


@kernel
def _slope(row, K, s):
    """Derivative of a polynomial at s."""
    total = 0.0
    for k in range(K, 0, -1):
        total = total * s + k * row[k]
    return total


@kernel
def _place_on_arc(V, time_row, way, want):
    """Where the time along an arc is the wanted one; the rates there over that of the time in V.pace."""
    K, low, high, s = V.order, 0.0, way, 0.5 * way
    for _ in range(100):
        powers(V.power, s)
        value = dot(V.rows[time_row], V.power, K + 1) - want
        if value > 0.0:
            high = s
        else:
            low = s
        slope = _slope(V.rows[time_row], K, s)
        new = s - value / slope if slope > 0.0 else 0.5 * (low + high)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        if abs(new - s) <= 1e-16:
            break
        s = new
    slope = _slope(V.rows[time_row], K, s)
    for i in range(V.arc_w.shape[0]):
        V.pace[V.wanted, i] = _slope(V.rows[i], K, s) / slope
    return s


@kernel
def _note_places(V, t, end, way, time_row):
    """Overwrites V.place by the places of the wanted times on this way; its end belongs to what follows."""
    V.wanted = 0
    count = V.cost if V.backward else len(V.t_eval)  # backward, those behind them have been read
    if time_row >= 0:
        powers(V.power, way)
        end = dot(V.rows[time_row], V.power, V.order + 1)
    while V.samples + V.wanted < count and V.wanted < len(V.place):
        want = V.t_eval[V.samples + V.wanted]
        if want >= end:
            return
        if time_row >= 0:
            V.place[V.wanted] = _place_on_arc(V, time_row, way, want)
        else:
            V.place[V.wanted] = max(want - t, 0.0)
        V.wanted += 1


@kernel
def stand_at(V, piece, s, n, m):
    """Overwrites V.x, V.mult by states and multipliers at a place s of a step that the run has kept."""
    for i in range(n + m):
        kept, total = V.dense[piece, i], 0.0
        for k in range(V.order, -1, -1):
            total = total * s + kept[k]
        if i < n:
            V.x[i] = total
        else:
            V.mult[i - n] = total


@kernel
def _move(P, V, A, kind, w, piece, t, length, states, unknowns):
    """Deviations w over a step of this length from (t, V.x, V.mult), taken again in parts where need be.

    Leaves in V.rows the polynomials of the last part; returns its length, -1 where there are no series.
    """
    K, at, time_row = V.order, 0.0, states - unknowns if kind == ARC else -1
    for _ in range(200):
        size = number_unknowns(V, V.mask, unknowns)
        if V.lanes > 0 and kind != ARC:
            _stand_in_columns(P, V, A.reads, piece, at)
        else:
            if not jet(P, V, A, kind, t + at, piece, at):
                return -1.0
            plan(V, A, states, size)
            if size > 0 and not factor(V, A, size):
                return -1.0
        left = length - at
        way = way_within(P, V, A, kind, w, t + at, states, size, left)
        if math.isnan(way):
            return -1.0
        while True:
            # The step's own end to the last bit, as an event may be there.
            _note_places(V, t + at, t + (length if way == left else at + way), way, time_row)
            full = V.wanted == len(V.place) > 0
            if not full:
                break
            for i in range(states):  # more places than there is room for: the same way once more for the rest
                for block in range(0, V.columns, 8):
                    store8(V.kept[i], block, load8(w[i], block))
            move(P, V, A, kind, w, t + at, states, size, way, time_row)
            for i in range(states):
                for block in range(0, V.columns, 8):
                    store8(w[i], block, load8(V.kept[i], block))
        move(P, V, A, kind, w, t + at, states, size, way, time_row)
        if way == left:
            return way
        at += way
        if V.given and kind != ARC:
            stand_at(V, piece, at, states, unknowns)
            continue
        powers(V.power, way)
        for j in range(unknowns):
            if V.mask[j]:
                V.mult[j] = dot(V.rows[states + j], V.power, K + 1)
        for i in range(states):
            V.x[i] = dot(V.rows[i], V.power, K + 1)
    return -1.0


@kernel
def _step(P, V, k):
    """Deviations over the step of entry k of the tape; False where it has no series."""
    n, m = P.n, P.m
    kind, t, length = V.tape[k, 1], V.tape_x[k, 0], V.tape_x[k, 1]
    if kind == PAIR:
        return False
    if kind == CLOSING:
        V.passes = 0 if close(P, V, k) else 1
        return True
    for i in range(n):
        V.x[i] = V.tape_x[k, 2 + i]
    for j in range(m):
        V.mult[j] = V.tape_x[k, 2 + n + j]
        V.mask[j] = 1 if V.tape[k, 4 + j] == SOLVED else 0
    if kind == ARC:
        return _arc(P, V, k, t, length)
    if kind == START:
        return collocate(P, V, k)
    A, piece = V.slip if kind == SLIP else V.general, V.tape[k, 2]
    return _move(P, V, A, kind, V.w, piece, t, length, n, m) >= 0.0


@kernel
def _arc(P, V, k, t, length):
    """The same along a multiplier: deviations of (x, t, lambda) at one place of its arc."""
    n, m, count = P.n, P.m, len(P.p)
    look(P, V, t, V.x, V.mult)
    for block in range(0, V.columns, 8):
        store8(V.other_dt, block, splat8(0.0))
    if not multipliers(P, V, V.w, V.other_dt, V.mask, 0, V.columns):
        return False
    for block in range(0, V.columns, 8):
        for i in range(n):
            store8(V.arc_w[i], block, load8(V.w[i], block))
        store8(V.arc_w[n], block, splat8(0.0))
        for j in range(m):
            store8(V.arc_w[n + 1 + j], block, load8(V.lam[j], block))
    for i in range(count):
        V.bias[i] = P.p[i]
    V.x[n] = t
    for j in range(m):
        V.x[n + 1 + j] = V.mult[j]
        V.bias[count + j] = float(V.tape[k, 3]) if j == V.tape[k, 2] else 0.0
        V.bias[count + m + j] = float(V.tape[k, 4 + j])
    for j in range(m, 0, -1):
        V.mask[j] = V.mask[j - 1]
    V.mask[0] = 1
    for j in range(m + 1):
        V.mult[j] = V.tape_x[k, 2 + n + m + j]
    way = _move(P, V, V.fold, ARC, V.arc_w, -1, 0.0, length, n + 1 + m, m + 1)
    for i in range(n + 1):
        V.arc_rates[i] = _slope(V.rows[i], V.order, way)
    V.on_arc = 1
    return way >= 0.0


@kernel
def _leave_arc(P, V):
    """Deviations at one time from those at one place of an arc."""
    n = P.n
    for i in range(n if V.on_arc else 0):
        pace = V.arc_rates[i] / V.arc_rates[n]
        for block in range(0, V.columns, 8):
            store8(V.w[i], block, load8(V.arc_w[i], block) - load8(V.arc_w[n], block) * pace)
    V.on_arc = 0


@kernel
def _put(P, V, target, point):
    """Copies the deviations to `target`, with those of the multipliers at entry `point` of the tape."""
    n, m = P.n, P.m
    for i in range(n):
        for block in range(0, V.columns, 8):
            store8(target[i], block, load8(V.w[i], block))
    if m == 0:
        return
    for i in range(n):
        V.x[i] = V.tape_x[point, 2 + i]
    for j in range(m):
        V.mult[j] = V.tape_x[point, 2 + n + j]
        V.mask[j] = 1 if V.tape[point, 4 + j] == SOLVED else 0
    look(P, V, V.tape_x[point, 0], V.x, V.mult)
    for block in range(0, V.columns, 8):
        store8(V.other_dt, block, splat8(0.0))
    known = multipliers(P, V, V.w, V.other_dt, V.mask, 0, V.columns)
    for j in range(m):
        for block in range(0, V.columns, 8):
            store8(target[n + j], block, load8(V.lam[j], block) if known else splat8(np.nan))


@kernel
def _record_instant(P, V):
    k = V.instants
    V.instant_t[k] = V.tape_x[V.met, 0]
    V.instant_why[k, 0], V.instant_why[k, 1] = V.why, V.cause
    for c in range(V.columns if k < V.instant_w.shape[0] else 0):
        V.instant_dt[k, c] = V.dt[c] if V.cause >= 0 else 0.0
        for i in range(P.n):
            V.instant_w[k, i, c] = V.met_w[i, c] if V.acted else V.event[i, c]
            V.instant_w[k, P.n + i, c] = V.w[i, c] + V.rates[i] * V.dt[c]
    V.instants += 1


@kernel
def _end(P, V, k):
    """Entry k of the tape stands behind an instant, with the multipliers that hold from there on."""
    n, m = P.n, P.m
    for i in range(n):
        V.x[i] = V.tape_x[k, 2 + i]
    for j in range(m):
        V.mult[j] = V.tape_x[k, 2 + n + j]
    end_instant(P, V, V.tape_x[k, 0], V.x, V.mult, V.tape[k, 4:], V.tape[V.met, 4:])
    _record_instant(P, V)
    for q in range(V.pending, min(V.points, V.at_point.shape[0])):
        _put(P, V, V.at_point[q], k)


@kernel
def _meet(P, V, k):
    """Entry k of the tape tells a cause of an instant, which begins with its first one."""
    n, m, what, i = P.n, P.m, V.tape[k, 1], V.tape[k, 2]
    if what == TAPE_NOTHING:
        return
    if not V.inside:
        for q in range(n):
            V.x[q] = V.tape_x[k, 2 + q]
        for j in range(m):
            V.mult[j] = V.tape_x[k, 2 + n + j]
        if what != TAPE_FOLD and not (what == TAPE_SURFACE and i < m and P.kind[i] == DISC):
            _leave_arc(P, V)
        V.met = k
        begin_instant(P, V, V.tape_x[k, 0], V.x, V.mult, V.tape[k, 4:])
        V.pending = V.points
    if what == TAPE_SURFACE and V.acted:
        for q in range(n):
            V.x[q] = V.tape_x[k, 2 + q]
        for j in range(m):
            V.mult[j] = V.tape_x[k, 2 + n + j]
        meet_again(P, V, i, V.tape_x[k, 0], V.x, V.mult)
    elif what == TAPE_SURFACE:
        meet_surface(P, V, i)
    elif what == TAPE_BOUND:
        meet_bound(P, V, i)
    elif what == TAPE_CLOCK:
        meet_clock(P, V, i)
    elif what == TAPE_FOLD:
        meet_fold(P, V, i)
    else:
        V.why = UNKNOWN


@kernel
def has_length(V, k):
    """Whether time passes, or an arc or rest is begun, at entry k: a step of a rounding parts no instants."""
    kind = V.tape[k, 1]
    return kind == ARC or kind == CLOSING or V.tape_x[k, 1] > 1e-15 * abs(V.tape_x[k, 0])


@kernel
def by_columns(V, k):
    """Whether the step of entry k has no transposed series: the slopes of a cost go back over it by columns."""
    kind = V.tape[k, 1]
    return V.tape[k, 0] == TAPE_STEP and (kind == ARC or kind == START or kind == CLOSING)


@kernel
def leave(P, V, k):
    """What has begun is over where entry k of the tape stands."""
    if V.inside:
        _end(P, V, k)
    _leave_arc(P, V)


@kernel
def go_over(P, V, k):
    """Carries the deviations over entry k of the tape; False where a step has no series."""
    n, m, what = P.n, P.m, V.tape[k, 0]
    if what == TAPE_STEP and not has_length(V, k):
        return True
    if what == TAPE_STEP or what == TAPE_END:
        leave(P, V, k)
    if what == TAPE_STEP:
        return _step(P, V, k)
    if what == TAPE_POINT:
        if V.on_arc and not V.inside:
            _leave_arc(P, V)
        if V.points < V.at_point.shape[0] and (not V.inside or V.first_point):
            _put(P, V, V.at_point[V.points], k)
            V.first_point = 0
            V.pending = V.points + 1
        V.points += 1
    elif what == TAPE_ACT:
        for i in range(n):
            V.x[i] = V.tape_x[k, 2 + i]
        for j in range(m):
            V.mult[j] = V.tape_x[k, 2 + n + j]
        act(P, V, V.tape[k, 2], V.tape_x[k, 0], V.x, V.mult, V.tape[k, 4:])
    elif what == TAPE_ROUND:
        V.fresh = 1
    elif what == TAPE_NODE:
        pass  # its step has read it
    elif what == TAPE_END:
        while V.samples < len(V.t_eval):
            _put(P, V, V.at_sample[V.samples - V.first_sample], k)
            V.samples += 1
    else:
        _meet(P, V, k)
    return True


@kernel
def begin(P, V):
    """A start that is held on surfaces moves along them; V.off tells what of each column leads out of them."""
    n, m = P.n, P.m
    for j in range(len(P.p) if V.lanes > 0 else 0):
        put_in_lanes(V.lanes, V.column_p, j, P.p[j])
    for i in range(n):
        V.x[i] = V.tape_x[0, 2 + i]
        for block in range(0, V.columns, 8):
            store8(V.event[i], block, load8(V.w[i], block))
    for j in range(m):
        V.mult[j] = V.tape_x[0, 2 + n + j]
    keep_held(P, V, V.tape_x[0, 0], V.x, V.mult, V.tape[0, 4:], 1)
    for c in range(V.columns):
        V.off[c], size = 0.0, 1e-300
        for i in range(n):
            V.off[c] = max(V.off[c], abs(V.event[i, c] - V.w[i, c]))
            size = max(size, abs(V.event[i, c]))
        V.off[c] /= size
