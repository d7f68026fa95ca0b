"""Steps of a slow slip in a disc: |h| falls to 0 in finite time, at which the series of slip end, or stays small under
a force that hardly exceeds the friction, where they are stiff."""

import math

from ..intervals import time_size
from ..machine.compiling import kernel
from ..machine.pointers import at, call_fields, call_linear
from ..state import ALGEBRAIC, CLOSING, CONTACT, DISC, HELD, SOLVED, TAPE_STEP
from ..surface.sliding import INSIDE
from .closing import MOST, MOST_KEPT, STEADY, close, direction_decides, pull_of, wants
from .recording import put_on_tape
from .roots import GRAZING
from .steps import surface_rows

_NEAR = 100.0  # tolerances of h: so near to rest the slip is closed at once
_EARLY = 1e-5  # of the largest |h|: so near to rest it is closed if nothing else happens by then
_SHORT = 0.75  # of the time to rest: a step in time that is worth one that closes it
_FASTEST = 1e9  # rate of its turn: twenty powers of a thousand times that are still numbers
_TURNS = 20.0  # of what counts as a line: how far from it a slip that is closed early may be
_FAST = 0.005  # of the friction: the deceleration of a slip that is closed early
_BLURRED = 1e-10  # of what a surface is made of that is no state: its roundings are 1e-5 of such a |h|
_FAR = 8.0  # by how much later than the last slope of |h| tells it may come to rest
_STIFF = 2.5  # of |h| over the friction: over a step as long the direction of the slip forgets what it was
_LOST = 10.0  # tolerances of h: a slip that has never been more is given up after many stiff steps
_FALLEN = 1e-6  # of its largest |h|^2: what is less is given up after a few
_SEEN = 5  # such steps in a row
_LEAST = 1e-13  # of the time: an explicit step as short is none
WORTH, PATIENCE = 20.0, 50  # explicit steps: what a collocation step costs, and until it is tried again
_LEAST_LEFT, _MOST_LEFT = 1e-3, 0.1  # of the time to rest, by a step towards it


@kernel
def _note_slow(P, S, W, h):
    """Overwrites onset.slow: slips so slow that over a step of length h their direction forgets what it was; whether
    there are any. None is given up."""
    rows, all_rows, some = W.step.rows, surface_rows(P, W.step.kind), False
    for j in range(P.m):
        W.onset.slow[j], W.onset.allowed[j] = 0, 0.0
        if P.kind[j] == DISC and S.status[j] == 1:
            size = math.sqrt(at(rows[all_rows[j]], 0))
            W.onset.slow[j] = 1 if h * pull_of(P, W, j) > _STIFF * size else 0
            some = some or W.onset.slow[j] != 0
    return some


@kernel
def is_stiff(P, S, W, h):
    """(Whether explicit steps have been as short as a slow slip makes them, for how long it stays slow), by the slopes
    that come_to_rest_in_disc has left."""
    rows, all_rows, longest, least = W.step.rows, surface_rows(P, W.step.kind), math.inf, _LEAST * time_size(S)
    none = not h > least  # also where the series are no numbers
    if none:
        h = least
    W.onset.stiff = W.onset.stiff + 1 if _note_slow(P, S, W, h) else 0
    if W.onset.wait > 0 and not none:
        W.onset.wait -= 1
        return False, longest
    if W.onset.stiff <= (0 if none else _SEEN):
        return False, longest
    for j in range(P.m):
        if P.kind[j] == DISC and S.status[j] == 1:
            square, slope, bend = at(rows[all_rows[j]], 0), at(rows[all_rows[j]], 1), at(rows[all_rows[j]], 2)
            longest = min(longest, 4.0 * square / (abs(slope) + 1e-300))
            longest = min(longest, math.sqrt(4.0 * square / (abs(bend) + 1e-300)))
    _note_slow(P, S, W, longest)
    return not longest <= WORTH * h, longest if longest < math.inf else math.inf


@kernel
def _near_rest(P, C, S, W, j):
    """|h|^2 of disc j from which on its slip is closed, and that from which on whatever else may happen by then; the
    tolerance of h.

    At the first jets that keep it begin to lose digits of the direction of h, at the second they have. Leaves in
    W.meeting.blurred where h is next to 0 within rounding.
    """
    tolerance, terms = C.rtol * math.sqrt(W.meeting.widest[j]), 0.0
    for k in range(j + 1, j + 1 + P.dim[j]):
        for e in range(P.dh_row[k], P.dh_row[k + 1]):
            tolerance += abs(W.dh[e]) * C.atol[P.dh_col[e]]
            if P.surface_state[k] < 0:
                terms += abs(W.dh[e] * S.x[P.dh_col[e]])
    W.meeting.blurred[j] = GRAZING * (math.sqrt(W.meeting.widest[j]) + terms)
    last = max(_NEAR * tolerance, _BLURRED * terms) ** 2
    return max(last, _EARLY**2 * W.meeting.widest[j]), last, tolerance


@kernel
def _is_alone(P, S, W, j, left):
    """Whether no surface, and no bound of what is solved for, can be met before disc j is at rest."""
    rows, all_rows, far = W.step.rows, surface_rows(P, W.step.kind), _FAR * left
    for i in range(P.m + P.ne):
        solved = i < P.m and S.status[i] == SOLVED
        free = i < P.m and (P.kind[i] == ALGEBRAIC or S.status[i] == HELD or P.disc_of[i] >= 0 or i == j)
        row = W.step.mult_row + i if solved else all_rows[i]
        if free or row < 0:
            continue
        margin = abs(at(rows[row], 0))
        if solved and P.kind[i] != CONTACT:
            margin = abs(1.0 - margin)
        if margin <= far * (abs(at(rows[row], 1)) + far * abs(at(rows[row], 2))):
            return False
    return True


@kernel
def _closes_early(P, S, W, j, h, left, first, tolerance):
    """Whether the way to rest of disc j is left to `close` from here, where the next step in time is h long."""
    row = W.step.rows[surface_rows(P, W.step.kind)[j]]
    square, slope, pull = at(row, 0), at(row, 1), pull_of(P, W, j)
    if -slope < 2.0 * _FAST * pull * math.sqrt(square):  # its direction is stiff in tau
        return False
    if h > _SHORT * left and pull < _FASTEST * math.sqrt(square) and not direction_decides(P, S, W, j):
        # A step in time goes farther than several of those that close it, as long as it turns.
        across = first * square - 0.25 * slope * slope
        if across > -0.5 * slope * pull * _TURNS * STEADY * tolerance:
            return False
    return _is_alone(P, S, W, j, left)


@kernel
def _close(P, C, S, R, W, j, square, late, tolerance, latest):
    """Moves S to where disc j is at rest, with the direction from which it comes in S.mult; False if it passes by, or
    comes there later than at the `latest`. `late` and `tolerance` are as in _near_rest, which has left W.G."""
    size, k = math.sqrt(square), S.taped
    most = MOST if square <= late else MOST_KEPT
    for i in range(P.m):
        W.closing_mult[i] = S.mult[i]
    _come_from(P, S, R, W, j)
    rests = close(P, C, S, R, W, j, size, tolerance, latest, most, False)
    if rests and R.tape.shape[0] > 0:
        R.tape_x[k, 1] = S.t - W.closing_t
    if rests and not (square > late and wants(P, S, R, S.t)):
        return True
    S.t = W.closing_t
    for i in range(P.n):
        S.x[i] = W.closing_x[i]
    for i in range(P.m):
        S.mult[i] = W.closing_mult[i]
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    if not rests:
        S.taped = k
        return False
    # The same way once more, now that it is known to lead to rest.
    _take_direction(P, S, W, j)
    return close(P, C, S, R, W, j, size, tolerance, latest, most, True)


@kernel
def _take_direction(P, S, W, j):
    """Lambda of disc j is from now on what the multipliers of its components say: h/|h|."""
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.mult[k] = W.h[k] / math.sqrt(W.h[j])
    S.mult[j] = INSIDE


@kernel
def _come_from(P, S, R, W, j):
    """Disc j begins to come to rest."""
    _take_direction(P, S, W, j)
    if R.tape.shape[0] > 0:
        put_on_tape(P, S, R, TAPE_STEP, CLOSING, j, 0, 0.0)


@kernel
def come_to_rest_in_disc(P, C, S, R, W, h):
    """(h, shortened so that no disc comes to rest within it, nan where the series are not finite; the disc that is at
    rest now, S moved to there, or -1)."""
    rows, all_rows, known = W.step.rows, surface_rows(P, W.step.kind), False
    for j in range(P.m):
        if P.kind[j] != DISC or S.status[j] != 1:
            continue
        if not known:
            call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        known = True
        square, slope = at(rows[all_rows[j]], 0), at(rows[all_rows[j]], 1)
        W.meeting.widest[j] = max(W.meeting.widest[j], square)
        first, ticks = 1e-300, 1e-15 * time_size(S)
        for k in range(j + 1, j + 1 + P.dim[j]):
            first += at(rows[all_rows[k]], 1) ** 2
        early, late, tolerance = _near_rest(P, C, S, W, j)
        blurred = square <= W.meeting.blurred[j] ** 2 and square < W.meeting.widest[j]
        given_up = W.onset.stiff > (_SEEN if square <= _FALLEN * W.meeting.widest[j] else PATIENCE)
        lost = given_up and W.meeting.widest[j] <= (_LOST * tolerance) ** 2
        lost = lost and h * pull_of(P, W, j) > _STIFF * math.sqrt(square)
        if lost or blurred or square <= ticks * ticks * first:
            # Nearer than h or the clock tells, on its way to rest or past it; or a force that is the friction to
            # rounding makes a slip of no size, which no step follows: it is held.
            W.onset.allowed[j] = C.rtol if lost or (blurred and W.onset.stiff > _SEEN) else 0.0
            _come_from(P, S, R, W, j)
            return h, j
        if not slope < 0.0:
            continue
        left = -2.0 * square / slope
        if square <= early or math.isnan(h):
            # Also where powers of its rate are no numbers any more, as in a short unit of time.
            closes, latest = square <= late or math.isnan(h), W.step.stop
            if not closes:
                latest = min(latest, S.t + _FAR * left)
                closes = _closes_early(P, S, W, j, h, left, first, tolerance)
            if closes and S.t + left < latest and _close(P, C, S, R, W, j, square, late, tolerance, latest):
                return h, j
        if left <= ticks:
            _come_from(P, S, R, W, j)
            return h, j
        if h > (1.0 - _MOST_LEFT) * left:
            # How much the approach is going to bend, in direction and in speed.
            second = 0.0
            for k in range(j + 1, j + 1 + P.dim[j]):
                second += at(rows[all_rows[k]], 2) ** 2
            bends = math.sqrt(max(0.0, 1.0 - 0.25 * slope * slope / (square * first)))
            bends += 2.0 * left * math.sqrt(second / first)
            h = min(h, (1.0 - min(max(bends, _LEAST_LEFT), _MOST_LEFT)) * left)
    return h, -1
