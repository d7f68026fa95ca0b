"""How near a step comes to a singular argument (definition/singular.py), so that none is continued through unseen.

Near its zero an argument goes like a ~ C (T - t)^(1/(1 - p)) with

    p = a a''/a'^2,   T - t = a/((1 - p) |a'|)

p = 0 where it passes 0 with a speed, 1/2 where the root of a square does, that of the law where a' ~ -a^p comes to
rest; with p = 1, exponential decay, it never arrives. A step ends before a zero or a dip of its polynomial that is
not told from one, until the point is as near as the absolute tolerance tells; the last step goes to T.
"""

import math

from numba import types

from ..intervals import time_size
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_act, call_fields, call_linear
from ..outcome import Outcome
from ..state import (
    CROSSING,
    EV_REST,
    EV_SINGULAR,
    GO_ON,
    HELD,
    KINK,
    PAIR,
    SECOND_ORDER,
    Control,
    Problem,
    Record,
    State,
)
from ..surface.sliding import (
    is_memory,
    keep_on_surface,
    side_at_zero,
    surface_rounding,
    surface_size,
    surface_speed,
)
from ..work import Work
from .finer import ON_ITS_WAY, SWITCHING, follow_as_asked, follow_to_rest
from .recording import record_event, record_point
from .roots import GRAZING, NO_ROOT, first_root
from .steps import scaled, surface_rows, variation

# What there is at the zero of an argument (pwsmooth.definition.singular.KINDS).
POLE, END, CONE, BRANCH = range(1, 5)
_DIP = 1e3  # of the tolerance: a dip that deep, relative to the start of the step, is not told from a zero
_SAME = 0.01  # relative distance at which two instants may be one: zeros of order three are told to 1e-5
_SHARE = 0.9  # of the way to what may be a zero
_IN_SIGHT = 4.0  # steps
_DECAY = 0.95  # of p: nearer to 1 it may be an exponential
_STEEPEST = (
    -9.0
)  # of p, that of a fall into a force like r^-19: below it a' is what rounding leaves of a constant
_SLOWS = 0.05  # of p: a motion that passes 0 with a speed comes there with p = 0
# A motion that comes to rest on several surfaces at once is followed until this is left of it: of the time, relative,
# or of the absolute tolerance asked for; where no state is the argument, of the size of what that is made of.
_LAST_TIME, _LAST, _LAST_OF_SIZE = 1e-10, 1e-4, 1e-12
_LAST_OF_ARC = 1e-18  # of the same: an arc that looks like an arrival may still cross
_HALF = 0.5  # of the way left in a step: from farther it would land within the error of where it comes from
_STANDS = 1e-8  # of its speed before: as fast an argument is moved by what does not vanish with it


@kernel
def has_branch_point(P, j):
    """Whether a power of surface j below 1 stands in the field."""
    for i in range(P.ne):
        if P.watch[i] == BRANCH and abs(P.twin[i]) == j + 1:
            return True
    return False


@kernel
def _kink_at(P, i):
    """The switch that may be held at the branch point of argument i, where the field is continuous, or -1."""
    j = abs(P.twin[i]) - 1
    if P.watch[i] != BRANCH or j < 0:
        return -1
    return j if P.kind[j] == KINK or P.kind[j] == CROSSING or P.kind[j] == SECOND_ORDER else -1


@kernel
def _speed_at(P, S, W, i, share):
    """|da/dt| with the argument of event i put to this share of itself, nan where that is not defined.

    Leaves S.x there, and what the argument is there in W.h. At 0 its powers are 0, as where its kink is held.
    """
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    row, last = P.m + i, P.m + P.ne
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    square = 0.0
    for e in range(P.dh_row[row], P.dh_row[row + 1]):
        square += W.dh[e] ** 2 if not is_memory(P, P.dh_col[e]) else 0.0
    value = W.h[row]
    for e in range(P.dh_row[row], P.dh_row[row + 1]):
        if not is_memory(P, P.dh_col[e]):
            S.x[P.dh_col[e]] -= (1.0 - share) * W.dh[e] * value / square
    if P.watch_state[i] >= 0 and share == 0.0:
        S.x[P.watch_state[i]] = 0.0
    j = _kink_at(P, i) if share == 0.0 else -1
    lam = S.mult[j] if j >= 0 else 0.0
    if j >= 0:
        S.mult[j] = 0.0
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    if j >= 0:
        S.mult[j] = lam
    speed = W.dh[P.dh_row[last] + row]
    for e in range(P.dh_row[row], P.dh_row[row + 1]):
        speed += W.dh[e] * W.dx[P.dh_col[e]]
    return abs(speed)


@kernel
def _stands(P, S, W, i, speed):
    """Whether the argument of event i, now of that speed, stands still once it is 0."""
    for k in range(P.n):
        W.step.x[k] = S.x[k]
    there = _speed_at(P, S, W, i, 0.0)
    for k in range(P.n):
        S.x[k] = W.step.x[k]
    return there <= _STANDS * speed


@kernel
def _power(P, S, W, i, a, speed):
    """p of da/dt ~ a^p by the fields here and half-way to 0: a step of the pair over the point has no good a''."""
    for k in range(P.n):
        W.step.x[k] = S.x[k]
    there = _speed_at(P, S, W, i, 0.5)
    for k in range(P.n):
        S.x[k] = W.step.x[k]
    return math.log(there / speed) / math.log(abs(W.h[P.m + i]) / a)


@kernel
def _tolerance(P, S, W, i, atol):
    """By how much an absolute tolerance lets the argument of event i vary."""
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    total = 0.0
    for e in range(P.dh_row[P.m + i], P.dh_row[P.m + i + 1]):
        total += abs(W.dh[e]) * atol[P.dh_col[e]]
    return 2.0 * total


@kernel
def _is_near(P, C, S, W, i, a):
    """Whether argument i, of size a, is as near to 0 as its tolerance tells, or the error of what it is made of."""
    if a <= _tolerance(P, S, W, i, W.step.atol):
        return True
    error = C.rtol if W.step.kind == PAIR else _LAST_OF_SIZE
    return P.watch_state[i] < 0 and _kink_at(P, i) >= 0 and a <= error * surface_size(P, S, P.m + i, W)


@kernel
def _is_before(P, W, i, end):
    """Whether the step meets nothing before `end`, in its lengths, but argument i, wherever its multiple root is."""
    first = NO_ROOT
    for k in range(P.m + P.ne):
        if k + 1 != abs(P.twin[i]):
            first = min(first, W.meeting.tau[k])
    return first > min(1.0, end * (1.0 - _SAME))


@kernel
def _least(P, C, S, W, i):
    """Down to where argument i is followed to rest."""
    least = (_LAST_OF_ARC if W.step.nears == SWITCHING else _LAST) * _tolerance(P, S, W, i, C.atol)
    return least if P.watch_state[i] >= 0 else max(least, _LAST_OF_SIZE * surface_size(P, S, P.m + i, W))


@kernel
def _is_active(P, S, W, i):
    """Whether the branch in which argument i stands is evaluated."""
    return call_act(P.act, i, S.t, S.x, S.mult, P.p, W.firing.trial) != 0


@kernel
def _settle_beside(P, S, W, twin):
    """The switch of an argument that is 0 and those that rest with it are what conditions say of 0."""
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for k in range(P.m):
        rests = abs(W.h[k]) <= surface_rounding(P, S, k, W) and surface_speed(P, W, k) == 0.0
        if P.kind[k] == CROSSING and abs(S.status[k]) == 1 and (rests or k == twin):
            at = side_at_zero(P, S, k)
            if abs(at) == 1:
                S.status[k], S.mult[k] = at, float(at)


@kernel
def _arrived(P, S, R, W, i):
    """What is made of the zero of argument i, at which S has arrived: rest there or the end of the run."""
    row = W.step.rows[surface_rows(P, W.step.kind)[P.m + i]]
    stands = 0
    if P.watch[i] != POLE and P.watch[i] != CONE and _speed_at(P, S, W, i, 0.0) <= _STANDS * abs(row[1]):
        stands = 1
    S.deflate[:] = 0
    S.stalled = 0
    j, holds = abs(P.twin[i]) - 1, stands == 1 and P.watch_state[i] < 0 and _kink_at(P, i) >= 0
    if holds:  # no state that stays 0: its kink holds it
        keep_on_surface(P, S, j, W)
        S.status[j], S.mult[j] = HELD, 0.0
    passes = P.watch[i] == CONE or (stands == 1 and P.watch_state[i] >= 0) or holds
    if passes:
        _settle_beside(P, S, W, j)
    if P.watch[i] != CONE:
        record_event(S, R, P.m + i, EV_REST if passes else EV_SINGULAR, P.watch[i], stands)
    record_point(P, S, R)
    return GO_ON if passes else Outcome.SINGULAR_POINT


@unit(types.int64, Problem, Control, State, Record, Work)
def approach(P, C, S, R, W):
    """Overwrites step.length with the longest step before a singular point, or to the one that step.arrives then names.

    Called with W.step.arrives set where that step ends: acts on it and returns a code.
    """
    roots = W.roots
    m, K, kind, h = P.m, C.order, W.step.kind, W.step.length
    if W.step.arrives >= 0:
        return _arrived(P, S, R, W, W.step.arrives)
    if W.step.nears == ON_ITS_WAY:
        follow_as_asked(P, C, W)
    # An event of the user's at the same place says what happens there; a switch does not.
    first = NO_ROOT
    for j in range(m + P.ne):
        first = min(first, W.meeting.tau[j] * (1.0 + _SAME if j < m else 1.0 - _SAME))
    for i in range(P.ne):
        r = surface_rows(P, kind)[m + i]
        if P.watch[i] == 0 or r < 0:
            continue
        row = W.step.rows[r]
        side = 1.0 if row[0] > 0.0 else -1.0
        a, speed, bend = side * row[0], -side * row[1], 2.0 * side * row[2]
        if not a > 0.0 or (side < 0.0 and P.watch[i] != POLE and P.watch[i] != BRANCH):
            continue
        left = math.inf
        if kind == PAIR and a <= _IN_SIGHT * speed * h and not a * bend < _DECAY * speed * speed:
            bend = _power(P, S, W, i, a, speed) * speed * speed / a
        if speed > 0.0 and a * bend < _DECAY * speed * speed:
            left = a / ((1.0 - max(a * bend / (speed * speed), _STEEPEST)) * speed)
        in_sight = left <= _IN_SIGHT * h and left <= first * h
        slows = left < math.inf and a * bend > _SLOWS * speed * speed and _is_before(P, W, i, left / h)
        j = _kink_at(P, i) if slows and _is_active(P, S, W, i) else -1
        if j >= 0 and j != W.step.refused and not _stands(P, S, W, i, speed):
            W.step.length = min(W.step.length, _HALF * left)
            last = left <= _LAST_TIME * time_size(S) or a <= _least(P, C, S, W, i)
            if last and S.t + left < W.step.stop:
                W.step.arrives, W.step.rests, W.step.left = i, j, left - W.step.length
                return GO_ON
            follow_to_rest(P, C, W, left * (1.0 - W.step.length / left) ** (left * speed / a))
            continue
        if not in_sight and variation(row, W.step.power, K) < 0.5 * a:
            continue
        roots.guess = 0.0
        roots.shallow = _DIP * C.rtol / GRAZING
        roots.dips = 0
        scaled(row, W.step.power, roots.poly, K, 0, side / a)
        s = first_root(P, W.roots, K)
        if s > 1.0 and roots.dips != 0:
            s = roots.dip_at
        roots.shallow = 0.0
        if not (in_sight or s <= min(1.0, first)) or not _is_active(P, S, W, i):
            continue
        if in_sight:
            near = left <= 1e-13 * time_size(S) or _is_near(P, C, S, W, i, a)
            if near and W.step.nears != SWITCHING and (kind != PAIR or left <= max(1.2 * h, 1e-9)):
                if P.watch[i] != BRANCH or _stands(P, S, W, i, speed):
                    W.step.arrives = i
                    W.step.length = 2.0 * left if P.watch[i] == CONE else left
                    return GO_ON
        if s <= min(1.0, first) and (P.watch[i] != BRANCH or _stands(P, S, W, i, speed)):
            W.step.length = min(W.step.length, _SHARE * s * h)
    return GO_ON
