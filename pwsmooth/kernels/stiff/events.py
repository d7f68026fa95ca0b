"""Events on the polynomial of a stiff step: zeros of surfaces, and what fires at one instant.

A surface is looked at in 8 points of the step and, where a parabola through three of them comes near zero, in
8 more around its vertex, closer and closer until it turns out to stay away or to pass; a change of sign is then
narrowed sevenfold a round, on the surface itself and not on a fit. Where the surface is so small that what the
polynomial misses counts, the step is made once more up to the zero, until what is between its ends does not matter.

`side` is the sign that each surface had last: a start on a surface, or the instant after an event, is
no zero. What fires at one instant follows kernels/firing.py.
"""

import numpy as np
from numba import types

from pwsmooth.kernels.firing import counts, fire
from pwsmooth.kernels.intervals import note_interval, time_to_last_event
from pwsmooth.kernels.machine.compiling import kernel, unit
from pwsmooth.kernels.machine.lanes import at, load8, splat8, store8
from pwsmooth.kernels.outcome import Outcome
from pwsmooth.kernels.state import ACTS, AGAIN, DUE, GO_ON, MOST_AT_ONCE, SILENT, TIMED
from pwsmooth.kernels.stiff import state as S
from pwsmooth.kernels.stiff.call import ACT, RATES1, WATCH8, call_event, call_lanes, call_point

NONE = 2.0  # no zero: beyond the step
POINTS = np.arange(8) / 7.0
NEAR = 0.2  # of its bend over a sample: a parabola whose vertex lies higher does not come near zero
DEPTH = 12  # looks around a vertex, each four times as close
SMALLEST = 5e-324
NOISE = 1e-14  # of a surface's size on the step: so deep a dip is rounding
DIP = 10.0  # of the tolerance: a dip that deep, relative to its size on the step, is not told from a zero
DIGITS = 1e-13  # of the states: what they cannot say
NEARBY = 1e-3  # of a step, over which the speed of a surface is taken
TICK = 1e-15  # of the time: its rounding
_IDLE = -1.0  # in `found`, while it is made
STANDS = 2  # in `met`: put on the surface by an update, or resting there
MET = 4  # in `postponed`, beside DUE: met, until switches of time alone have crossed
ROUGH = 1e-3  # of a surface's size on the step: what the polynomial may miss at a zero
ROUNDED = 3.0  # times what the last digits of the states make of a surface: a smaller one tells nothing
NEAR_ZERO = 1e-6  # of a surface at the start, or of the first step in doubt: so far beyond a zero one may end
SHORTEST = 1e-12  # of the time: a step that is made once more
AT_ZERO = 1e-3  # of a surface's size on a step up to what may be its zero: less is one
LEAST_SHARE = 1e-3  # of a step, to which one that is made once more may shrink


@kernel
def sample(s, coefficients, degree, t, h, a, b):
    """Overwrites values[8 j + k] with surface j at the points a + (b - a) k/7 of the step."""
    theta = load8(POINTS, 0) * (b - a) + a
    store8(s.t8, 0, theta * h + t)
    for r in range(s.reads):
        i = s.read[r]
        row = 17 * i
        v = splat8(coefficients[row + degree])
        for k in range(degree - 1, -1, -1):
            v = v * theta + coefficients[row + k]
        store8(s.X, 8 * i, v)
    call_lanes(s.adr[WATCH8], s.t8, s.X, s.p, s.values)


@kernel
def _note_slack(s, coefficients, degree, t, h, theta):
    """Overwrites slack: what surfaces change by in the rounding of time at theta, at their speed on the step before."""
    begin = max(0.0, theta - NEARBY)
    sample(s, coefficients, degree, t, h, begin, theta)
    for j in range(s.e):
        change = abs(s.values[8 * j + 7] - s.values[8 * j])
        s.slack[j] = TICK * (s.unit + abs(t)) * change / ((theta - begin) * h) if theta > begin else 0.0


@kernel
def _sign(v):
    return 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)


@kernel
def _look(s, t, x, before):
    """Overwrites level with the surfaces at (t, x), and rounding with what the last digits of x and `before` make of
    them."""
    n = s.n
    for first in range(0, s.groups, 8):
        for q in range(8):
            s.t8[q] = t
        for i in range(n):
            for q in range(8):
                s.X[8 * i + q] = x[i]
        if first == 0:
            call_lanes(s.adr[WATCH8], s.t8, s.X, s.p, s.values)
            for j in range(s.e):
                s.level[j], s.rounding[j] = s.values[8 * j], s.slack[j]
        for i in range(n):
            q = s.group[i] - first
            if 0 <= q and q < 8:
                s.X[8 * i + q] += DIGITS * (abs(x[i]) + abs(before[i]))
        call_lanes(s.adr[WATCH8], s.t8, s.X, s.p, s.values)
        for j in range(s.e):
            for q in range(min(8, s.groups - first)):
                s.rounding[j] += abs(s.values[8 * j + q] - s.level[j])


@kernel
def start_sides(s, t, x):
    """Overwrites side[j] with the sign of each surface at a start, or with what remembers it; `met` where it is 0."""
    for j in range(s.e):
        s.slack[j] = 0.0
    _look(s, t, x, x)
    for j in range(s.e):
        k = s.remembers[j]
        s.side[j] = x[k] if k >= 0 else _sign(s.level[j])
        s.met[j] = 1 if k < 0 and s.carried[j] != TIMED and abs(s.level[j]) <= s.rounding[j] else 0
        s.fired[7 * j] = s.fired[7 * j + 6] = t


@kernel
def set_sides(s, t, x, f, h):
    """Overwrites side[j] with the sign that each surface on which x stands (`met`) is about to have when the motion
    goes on from (t, x), and the states in x that remember one; returns whether that changed any."""
    # As little ahead as shows: behind rounding, before anything can happen.
    for q in range(8):
        d = 0.0 if q == 0 else 10.0 ** (q - 7) * h
        s.t8[q] = t + d
        for i in range(s.n):
            s.X[8 * i + q] = x[i] + d * f[i]
    call_lanes(s.adr[WATCH8], s.t8, s.X, s.p, s.values)
    changed = False
    for j in range(s.e):
        if s.met[j] == 0:
            continue
        k, came = s.remembers[j], s.side[j]
        s.side[j] = 0.0
        for q in range(7, 0, -1):
            rise = s.values[8 * j + q] - s.values[8 * j]
            if abs(rise) > 0.01 * s.rounding[j]:
                s.side[j] = _sign(rise)
        if s.met[j] == STANDS and s.side[j] != 0.0:
            s.side[j] = came  # it is crossed where the motion goes on
            continue
        # A surface that hugs zero within rounding would leave a memory that was only ever turned round on either side.
        side = s.side[j]
        if k >= 0 and side == 0.0:
            side = _side_at_rest(s, j, t, x)
        if k >= 0 and side != 0.0 and x[k] != side:
            x[k] = side
            changed = True
    return changed


@kernel
def _side_at_rest(s, j, t, x):
    """The memory of switch j where its surface stays at 0: what conditions say of that, else the side that it has."""
    k, i = s.remembers[j], s.at_rest[j]
    if i < 0:
        return x[k]
    for q in range(s.n):
        s.before[q] = s.after[q] = x[q]
    _act(s, i, t)
    return s.after[k]


@kernel
def _bracket(s, j, side, a, b, deep):
    """First interval of the sampled ones where surface j leaves `side` by more than `deep`: (lo, hi), or NONE twice."""
    for k in range(1, 8):
        if s.values[8 * j + k] * side <= -deep:
            return a + (b - a) * (k - 1) / 7.0, a + (b - a) * k / 7.0
    return NONE, NONE


@kernel
def _near_vertex(s, j, side, a, b):
    """Where the first parabola through three samples that comes to (almost) zero does so; NONE if none does."""
    for k in range(1, 7):
        left, mid, right = (
            side * s.values[8 * j + k - 1],
            side * s.values[8 * j + k],
            side * s.values[8 * j + k + 1],
        )
        bend = left - 2.0 * mid + right
        if bend > 0.0 and abs(left - right) <= 2.0 * bend:
            if mid - (right - left) ** 2 / (8.0 * bend) < NEAR * bend:
                return a + (b - a) * (k + 0.5 * (left - right) / bend) / 7.0
    return NONE


@kernel
def _dips(s, coefficients, degree, t, h, j, side, a):
    """Interval of the part [a, 1] just sampled where surface j passes zero and soon comes back; NONE twice if it does
    not."""
    size = 0.0
    for k in range(8):
        size = max(size, abs(s.values[8 * j + k]))
    left, right, lo, hi = a, 1.0, NONE, NONE
    for _ in range(DEPTH):
        vertex = _near_vertex(s, j, side, left, right)
        if vertex == NONE:
            break
        width = 0.125 * (right - left)
        left, right = max(left, vertex - width), min(right, vertex + width)
        sample(s, coefficients, degree, t, h, left, right)
        lo, hi = _bracket(s, j, side, left, right, NOISE * size)
        if lo != NONE:
            break
    return lo, hi


@kernel
def _comes_to_zero(s, coefficients, degree, t, h, j, side, a):
    """Where on the part [a, 1] a singular argument comes to 0, to within the tolerance; NONE if it does not.

    Beyond a pole or a branch point the step's polynomial goes on as if there were none: a dip counts as well.
    """
    sample(s, coefficients, degree, t, h, a, 1.0)
    lo, hi = _bracket(s, j, side, a, 1.0, 0.0)
    if lo != NONE:
        return _narrow(s, coefficients, degree, t, h, j, side, lo, hi)
    least = 0.0
    for k in range(8):
        least = max(least, abs(s.values[8 * j + k]))
    least *= DIP * s.rtol
    left, right = a, 1.0
    for _ in range(DEPTH):
        vertex = _near_vertex(s, j, side, left, right)
        if vertex == NONE:
            break
        width = 0.125 * (right - left)
        left, right = max(left, vertex - width), min(right, vertex + width)
        sample(s, coefficients, degree, t, h, left, right)
        for k in range(8):
            if side * s.values[8 * j + k] <= least:
                return left + (right - left) * k / 7.0
    return NONE


@kernel
def _narrow(s, coefficients, degree, t, h, j, side, lo, hi):
    """End of the interval, as short as rounding allows, over which surface j leaves `side`."""
    for _ in range(20):
        if hi - lo < 4e-16:
            break
        sample(s, coefficients, degree, t, h, lo, hi)
        a, b = _bracket(s, j, side, lo, hi, 0.0)
        if a == NONE:
            break
        lo, hi = a, b
    return hi


@kernel
def _rests(s, j, rounding):
    """Whether surface j stays as near to 0 on the part just sampled."""
    for k in range(8):
        if abs(s.values[8 * j + k]) > rounding:
            return False
    return True


@kernel
def _is_idle(s, j):
    """Whether surface j is not looked for on the part just sampled; its side follows where it has none.

    Nothing happens to a switch whose surface rests at zero, and an event on one that does is left without firing.
    """
    k = s.remembers[j]
    if s.carried[j] == TIMED:
        return True
    if k >= 0:
        s.side[j] = s.x[k] if s.side[j] == 0.0 else s.side[j]
        s.passed_side[j] = s.side[j]
        return _rests(s, j, s.rounding[j])
    if s.side[j] != 0.0 and not _rests(s, j, 0.0):
        return False
    s.side[j] = s.passed_side[j] = _sign(s.values[8 * j + 7])
    return True


@kernel
def next_zero(s, coefficients, degree, t, h, begin):
    """First theta in (begin, 1] at which a watched surface passes zero in a direction that counts; else NONE.

    Overwrites `found` with the theta of every surface (NONE without a zero) and, when nothing is found, `side`.
    """
    first = NONE
    sample(s, coefficients, degree, t, h, begin, 1.0)
    for j in range(s.e):
        s.found[j] = _IDLE if _is_idle(s, j) else NONE
    for j in range(s.e):
        if s.found[j] == _IDLE:
            s.found[j] = NONE
            continue
        side, a, here, least = s.side[j], begin, False, SMALLEST if s.remembers[j] >= 0 else 0.0
        if s.carried[j] == SILENT:
            s.found[j], s.passed_side[j] = _comes_to_zero(s, coefficients, degree, t, h, j, side, a), side
            first = min(first, s.found[j])
            continue
        for _ in range(8):
            sample(s, coefficients, degree, t, h, a, 1.0)
            lo, hi = _bracket(s, j, side, a, 1.0, least)
            if lo == NONE:
                lo, hi = _dips(s, coefficients, degree, t, h, j, side, a)
                if lo == NONE:
                    break
            zero = _narrow(s, coefficients, degree, t, h, j, side, lo, hi)
            if counts(s.direction[j], -side):
                s.found[j], here = zero, True
                break
            side, a, least = -side, zero, SMALLEST  # it is still at 0 there
            if a >= 1.0:
                break
        if here:
            first = min(first, s.found[j])
        elif first == NONE:
            s.passed_side[j] = side
    if first == NONE:
        for j in range(s.e):
            if s.carried[j] != TIMED and s.side[j] != 0.0:
                s.side[j] = s.passed_side[j]
    return first


@kernel
def value(coefficients, degree, i, theta):
    """State i on the step, at theta."""
    v = coefficients[17 * i + degree]
    for k in range(degree - 1, -1, -1):
        v = v * theta + coefficients[17 * i + k]
    return v


@kernel
def _due(s, t, theta, h, instant):
    """Mark as due and met the surfaces found at theta, and as due the events of time at an `instant`."""
    close = theta + 1e-13 * max(abs(t), h) / h
    for j in range(s.e):
        s.left[j] = 0
        s.due[j] = s.met[j] = 1 if s.carried[j] != TIMED and s.found[j] <= close else 0
        if s.met[j]:
            s.side[j] = -s.side[j]
    k = s.ticks
    while instant and k < s.instants and s.instant_t[k] <= t:
        s.due[s.instant_event[k]] = DUE
        k += 1
    s.ticks = k


@kernel
def _look_again(s, t, x):
    """As _look, behind an update: switches that it has moved off their surfaces have the side where they are, and so do
    the surfaces in which they stand."""
    _look(s, t, x, s.before)
    for _ in range(s.e):
        found = -1
        for j in range(s.e):
            k = s.remembers[j]
            moved = found < 0 and k >= 0 and s.carried[j] != TIMED and s.level[j] != s.was[j]
            if moved and abs(s.level[j]) > s.rounding[j] and x[k] * s.level[j] < 0.0:
                found = j  # those that stand in others come first
        if found < 0 or not has_room(s):
            break  # what is left of the room is for events
        k = s.remembers[found]
        _record(s, found, t)
        x[k] = s.side[found] = -x[k]
        _look(s, t, x, s.before)


@kernel
def has_room(s):
    """Whether the records have room for all that may happen at one instant."""
    return s.records + 2 * s.e + MOST_AT_ONCE < s.room


@kernel
def _act(s, j, t):
    return call_event(s.adr[ACT], j, t, s.before, s.p, s.after) != 0


@kernel
def _record(s, j, t):
    """Write the record of event j, which acts on `before`; returns whether it ends the run."""
    record, n = s.records, s.n
    s.event_t[record], s.event_index[record] = t, j
    for i in range(n):
        s.event_x[2 * n * record + i] = s.before[i]
    s.records = record + 1
    return s.stops[j] != 0


@kernel
def _note_nothing(s, together):
    """Contradictions are told from the records (paths/smoothed.py)."""


@kernel
def _strike(s, t, x):
    """Fire the switches of time alone whose instant has come, before all that is due; what was met is looked at again.

    Returns as `fire`. At an instant a function of time has the value that it has from there on.
    """
    some = False
    for j in range(s.e):
        some = some or (s.due[j] == DUE and s.carried[j] == TIMED and s.remembers[j] >= 0)
    if not some:
        return GO_ON
    for j in range(s.e):
        if s.met[j]:
            s.side[j], s.due[j], s.met[j], s.postponed[j] = -s.side[j], 0, 0, MET
        elif s.due[j] == DUE and s.remembers[j] < 0:
            s.due[j], s.postponed[j] = 0, DUE
    code = fire(s, s, s.n, s.e, t, x, s.side, s.direction, _look_again, _act, _record, _note_nothing)
    for j in range(s.e):
        if s.postponed[j] == MET and abs(s.level[j]) <= s.rounding[j]:
            s.side[j], s.due[j], s.met[j] = -s.side[j], DUE, 1
        elif s.postponed[j] == DUE:
            s.due[j] = DUE
        s.postponed[j] = 0
    return code


@kernel
def _fire(s, t, x):
    """Fire at time t everything that is due; returns as `fire`. Overwrites x and the records."""
    n, first = s.n, s.records
    _look(s, t, x, x)
    for j in range(s.e):
        # A zero may have been passed in a direction that does not count.
        if s.met[j] == 0 and s.remembers[j] < 0 and abs(s.level[j]) > s.rounding[j]:
            s.side[j] = _sign(s.level[j])
    code = _strike(s, t, x)
    struck = s.jumped
    if code == GO_ON:
        code = fire(s, s, n, s.e, t, x, s.side, s.direction, _look_again, _act, _record, _note_nothing)
    s.jumped = max(s.jumped, struck)
    if code == Outcome.EVENT_LOOP:
        s.records = first
    for record in range(first, s.records):
        for i in range(n):
            s.event_x[2 * n * record + n + i] = x[i]
    for j in range(s.e):
        if s.jumped != 0 and s.met[j] == 0 and s.at_rest[j] >= 0 and abs(s.level[j]) <= s.rounding[j]:
            s.met[j] = STANDS
    return code


@kernel
def _accumulate(s, coefficients, degree, t, h, theta, when):
    """Whether the events that fired at t + theta h, which is `when`, come in intervals that shrink to nothing
    (accumulation.py): the last record is then of their limit."""
    sample(s, coefficients, degree, t, h, 0.0, theta)
    for j in range(s.e):
        last = at(s.fired, 7 * j)
        if s.due[j] < ACTS or s.carried[j] == TIMED or s.remembers[j] >= 0 or when <= last[0]:
            continue
        note_interval(last, when)
        # An event is an advance, however soon it comes: of steps between them there are not too many.
        s.mark, s.since_mark = when, 0
        height = 0.0
        for q in range(8):
            height = max(height, abs(s.values[8 * j + q]))
        left = time_to_last_event(last, height <= s.rounding[j], s.unit + abs(when))
        if left < np.inf:
            _record(s, j, when + left)
            return True
    return False


@kernel
def _doubt(s, coefficients, degree, t, h, theta):
    """What becomes of a first zero at theta, on the polynomial of an implicit step, where what that misses of the rates
    is as much as the surface: only the ends of steps tell then on which side the motion is.

    Returns where the step has to end that is made once more to find out; else the first zero that counts: the end of
    the step where no shorter one tells more, and none of those that the ends know nothing of.
    """
    for i in range(s.n):
        s.err[i] = value(coefficients, degree, i, theta)
    call_point(s.adr[RATES1], t + theta * h, s.err, s.p, s.scratch)
    for i in range(s.n):
        slope = degree * coefficients[17 * i + degree]
        for k in range(degree - 1, 0, -1):
            slope = slope * theta + k * coefficients[17 * i + k]
        s.scratch2[i] = s.err[i] + (slope - h * s.scratch[i])
    for j in range(s.e):
        s.slack[j] = 0.0
    _look(s, t + theta * h, s.err, s.err)
    for j in range(s.e):
        s.slack[j] = s.level[j]
    _look(s, t + theta * h, s.scratch2, s.err)
    sample(s, coefficients, degree, t, h, 0.0, 1.0)
    again, first, least = NONE, NONE, SHORTEST * (s.unit + abs(t))
    if s.confirming == 0:
        s.doubted = h
    for j in range(s.e):
        size = 0.0
        for k in range(8):
            size = max(size, abs(s.values[8 * j + k]))
        begin, end = s.side[j] * s.values[8 * j], s.side[j] * s.values[8 * j + 7]
        digits = s.rounding[j] - s.slack[j]
        rough = s.confirming > 0 or abs(s.level[j] - s.slack[j]) > ROUGH * size
        rough = rough and s.carried[j] != TIMED and s.found[j] <= theta and size > ROUNDED * digits
        if rough and s.confirming == 0 and begin > digits and theta * h >= least:
            again = theta
        elif rough and (s.confirming > 0 or begin <= digits):
            share = max(begin / (begin - end), LEAST_SHARE) if end < 0.0 else NONE
            if -end > max(NEAR_ZERO * begin, digits) and h > NEAR_ZERO * s.doubted and share * h >= least:
                again = min(again, share)
            s.found[j] = 1.0 if end <= (AT_ZERO * size if begin > digits else -digits) else NONE
        first = min(first, s.found[j])
    s.confirming = s.confirming + 1 if again < 1.0 else 0
    return again if again < 1.0 else first


@unit(types.int64, S.Core, types.float64, types.int64, types.int64)
def events_unit(s, t, degree, offset):
    """Everything that happens on the step just taken from t; its polynomial stands at `offset` of the
    coefficients.

    Events that change nothing are recorded and passed. At the first that changes the state (`jumped`) or ends the run,
    x and t become those just before it and scratch2 the state after. Returns GO_ON or the Outcome; AGAIN, with the
    length of the step in s.h, where the step is to be made once more up to what may be the first zero.
    """
    n = s.n
    for j in range(s.e):
        s.was[j] = s.side[j]
    h, theta, coefficients = s.taken, 0.0, at(s.coefficients, offset)
    instant = s.ticks < s.instants and s.t >= s.instant_t[s.ticks]
    while has_room(s):
        begin = theta
        theta = next_zero(s, coefficients, degree, t, h, begin)
        if begin == 0.0 and theta < 1.0 and s.mode == S.RADAU:
            theta = _doubt(s, coefficients, degree, t, h, theta)
            if s.confirming > 0:
                for j in range(s.e):
                    s.side[j] = s.was[j]
                s.h = theta * h
                return AGAIN
        elif begin == 0.0:
            s.confirming = 0
        if theta == NONE and not instant:
            return GO_ON
        theta = min(theta, 1.0)
        if instant and (1.0 - theta) * h <= 1e-13 * max(abs(s.t), h):
            theta = 1.0  # what is met and the clock are at one instant
        when = t + theta * h if theta < 1.0 else s.t
        for i in range(n):
            s.err[i] = s.scratch2[i] = s.x[i] if theta == 1.0 else value(coefficients, degree, i, theta)
        _note_slack(s, coefficients, degree, t, h, theta)
        _due(s, when, theta, h, instant and theta == 1.0)
        instant = instant and theta < 1.0
        code = _fire(s, when, s.scratch2)
        if code != GO_ON or s.jumped:
            s.t = when
            for i in range(n):
                s.x[i] = s.err[i]
            if code == GO_ON and _accumulate(s, coefficients, degree, t, h, theta, when):
                return Outcome.EVENTS_ACCUMULATE
            return code
        if theta >= 1.0:
            break
    return GO_ON
