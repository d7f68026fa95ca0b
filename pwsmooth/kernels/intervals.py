"""Instants whose intervals shrink geometrically: what is kept of them, and the limit that they come to.

With intervals d, d q, d q^2, ... the limit lies d q/(1 - q) behind the last instant. One rule for the surfaces of
switches, contacts and events, in both loops. A row `last` holds the time of the last instant, the interval before it,
the last four ratios of intervals, the newest first, and the time since which they shrink.
"""

import math

from .machine.compiling import inlined_kernel, kernel

_LAST_EVENTS = 1e-9  # much closer, a bounce of an event disappears in the roundings of its surface
SHRUNK = 1e-7  # of the time over which intervals have shrunk: a motion on that scale is followed so near to its limit
_AS_FAR = 0.5  # of the farthest
_UNSEEN = 1e-14  # of the time: intervals that its rounding hides
_LOST_EVENTS = 1e-3  # and less close not: a surface that is met without a slope hugs zero as well


@inlined_kernel
def time_size(S):
    """What a tolerance of time is relative to: the time, and near 0 the length of the run, at most 1."""
    return S.unit + abs(S.t)


@inlined_kernel
def pace(S):
    """The time by which rates are told from 0: the unit of time, and more where steps are a thousand times longer.

    Not less: between two bounces a step is as long as the flight could be, and says nothing of how slow they are.
    """
    return max(S.unit, 1e-3 * S.step)


@kernel
def forget_intervals(last, t):
    """Overwrites last as of a motion that begins at t."""
    last[0] = t
    for k in range(1, 6):
        last[k] = 0.0
    last[6] = t


@kernel
def note_interval(last, t):
    """Overwrites last at an instant t."""
    interval = t - last[0]
    last[5] = last[4]
    last[4] = last[3]
    last[3] = last[2]
    last[2] = interval / last[1] if last[1] > 0.0 else math.inf
    if not (last[2] > 0.0 and last[3] > 0.0 and last[2] * last[3] < 1.0):
        last[6] = last[0]
    last[1] = interval
    last[0] = t


@kernel
def note_arc(S, j, speed):
    """Notes an instant at which surface j is met at this speed, and how far the way since the last one has led from it:
    as far as a parabola."""
    last, arcs = S.last[j], S.arcs[j]
    before = last[0]
    note_interval(last, S.t)
    arcs[0] = 0.25 * abs(speed) * last[1]
    arcs[1] = arcs[0] if last[6] == before else max(arcs[1], arcs[0])


@inlined_kernel
def leads_as_far(arcs):
    """Whether the ways between the meetings of a surface lead as far from it as ever, while their times shrink to 0.

    Then the motion has no limit: it goes to infinity in finite time, or turns ever faster.
    """
    return arcs[0] >= _AS_FAR * arcs[1] > 0.0


@kernel
def time_left(last):
    """Time from the last instant to the limit of the intervals if they shrink geometrically, else inf."""
    interval, q = last[1], last[2]
    # A ratio of 0 is none: so it stands where the surface has not been met before, as after a start in a stick.
    if not 0.0 < q < math.inf:
        return math.inf
    if abs(q - last[3]) <= 0.02 * q:
        return interval * q / (1.0 - q) if q < 0.9999999 else math.inf
    # Without one ratio, as around a corner with unequal quarters, or where a latch changes the rates at each event,
    # those of pairs tell.
    pair = q * last[3]
    if 0.0 < pair < 0.99 and abs(q - last[4]) <= 0.02 * q and abs(last[3] - last[5]) <= 0.02 * last[3]:
        return (interval + interval / q) * pair / (1.0 - pair)
    return math.inf


@kernel
def have_shrunk(last, left, share, size):
    """Whether what is left to the limit is no more than a share of the time over which the intervals have shrunk, or
    the clock, whose size is that of time_size, tells no shorter ones."""
    return left <= share * (last[0] - last[6]) or last[1] <= _UNSEEN * size


@kernel
def _alike(q, other):
    """Whether two ratios are of one sequence, be it one that drifts."""
    return 0.5 * other <= q <= 2.0 * other


@kernel
def time_to_last_event(last, lost, size):
    """Time from the last instant to the limit of the events of these intervals, if it is all but reached; else inf.

    Close is relative to `size` (time_size). `lost`: the surface stays within its roundings between them, as far from
    the origin that of a bounce does sooner.
    """
    close = (_LOST_EVENTS if lost else _LAST_EVENTS) * size
    left = time_left(last)
    if left <= close and (lost or have_shrunk(last, left, SHRUNK, size)):
        return left
    # Where each reset changes the rates the ratios drift, and so near the limit that of a pair says where it is.
    interval, q = last[1], last[2]
    pair = q * last[3]
    drift = _alike(q, last[3]) and _alike(last[3], last[4])
    drift = drift or (_alike(q, last[4]) and _alike(last[3], last[5]))
    if 0.0 < pair < 0.99 and interval <= close and drift:
        left = (interval + interval / q) * pair / (1.0 - pair)
        return left if lost or have_shrunk(last, left, SHRUNK, size) else math.inf
    return math.inf
