"""New polynomials of a patch: what its members meet, as far as the change reaches, and when they meet something next.

Chain: loop.py -> **this file** -> members.py (who belongs to a patch), patch.py (the small system that it is).
"""

import math

from ..instant.accumulation import at_once_within
from ..machine.compiling import kernel
from ..machine.pointers import at, call_unit, float_bits
from ..outcome import Outcome
from ..state import AGAIN, AMB_GRAZING, GO_ON, SOLVED
from ..step.looking import shorten_to_fit
from ..step.meeting import find_first
from ..step.recording import record_ambiguity
from ..step.steps import powers
from ..surface.sliding import follow, mask_solved
from ..trajectory import find_multipliers, propose
from .members import (
    close_rim,
    is_wall,
    number_of,
    open_rim,
    put_in_order,
    take_in_failing,
    take_in_held,
    take_in_rim_that_ends,
    take_in_touching,
    take_in_written,
)
from .parts import (
    is_ahead,
)
from .patch import degree_of, gather, largest_change, note_records, scatter
from .queue import put_in_queue
from .state import ELSEWHERE, WITHOUT_PARTS

EVENT, EXPIRY, END_OF_SLAB = range(3)  # why a patch is renewed
_DEEPEST = 40
_EASY = 1e-4  # of what is allowed: a depth that leaves so little is more than enough
_OFTEN = 24  # times
_BRIEF = 1e-12  # of the time: too short for a step


@kernel
def has_room(A, P, S, R):
    """For all that may happen to the members at one instant."""
    T, E = A.patch, A.kind
    most = 8 * (E.nm + E.ne) * T.count + 64
    if A.events + most >= len(A.event_t) or A.ambiguities + most >= len(A.ambiguity_t):
        T.needs = 0
        return False
    if most >= len(R.event_t) or most >= len(R.ambiguity_t):
        T.needs = T.most + 1
        return False
    return True


@kernel
def bucket_of(time_left):
    """The exponent of a time, from 0 to 127."""
    return min(max((float_bits(max(time_left, 1e-300)) >> 52) - 1023 + 96, 0), 127)


@kernel
def _prepare_instant(A, S, W, t):
    """What the members meet now, for the unit of the instant; whether they meet anything."""
    T, E = A.patch, A.kind
    instant = W.instant
    instant.fold, instant.way, instant.at_clock, instant.solved_there = -1, 0, 0, 0
    instant.met = instant.elapsed = 0.0
    W.step.length = 1.0
    some, stalled = False, -1
    for k in range(T.count):
        i = T.member[k]
        rounding = at_once_within(t, A.length[i])
        for b in range(E.nm + E.ne):
            if A.met[i, b] - t <= rounding:
                W.meeting.tau[number_of(E, b, T.count, k)] = 0.0
                some = True
                if t - A.begun[i] <= 1e-14 * (S.unit + abs(t)):
                    stalled = max(stalled, A.stalled[i])
    S.stalled = stalled
    for k in range(E.ns * T.total if len(E.target) > 0 else 0):
        W.firing.arrived[k] = S.x[k]
    return some


@kernel
def _next_tick(A, i, q):
    """When timed event q of element i happens next."""
    E, k = A.kind, A.tick[i, q]
    if E.at_first[q + 1] > E.at_first[q]:
        return E.at[E.at_first[q] + k] if E.at_first[q] + k < E.at_first[q + 1] else math.inf
    return A.every[i, q] * k


@kernel
def _after_instant(A, S, t):
    """Instants in succession of the members that met something, without progress in time."""
    T, E = A.patch, A.kind
    for k in range(T.count):
        i = T.member[k]
        A.stalled[i] = 0
        rounding = at_once_within(t, A.length[i])
        for b in range(E.nm + E.ne):
            if A.met[i, b] - t <= rounding:
                A.stalled[i] = min(S.stalled, 127)
        for q in range(len(E.timed)):
            if A.met[i, E.nm + E.timed[q]] - t <= rounding:
                A.tick[i, q] += 1


@kernel
def _keep_grazes(A, S, R, t):
    """Records what the members have grazed on polynomials that now end."""
    T, E = A.patch, A.kind
    for k in range(T.count):
        i = T.member[k]
        if A.fresh[i] == T.stamp:
            continue
        for b in range(E.nm + E.ne):
            if A.grazed[i, b] < t:
                S.t = A.grazed[i, b]
                record_ambiguity(S, R, number_of(E, b, T.count, k), AMB_GRAZING, A.graze_crosses[i, b])
                A.grazed[i, b] = math.inf
    S.t = t


@kernel
def _common_end(A, t, stop):
    """Up to where all that is read is known."""
    T = A.patch
    for k in range(T.count, T.total):
        i = T.member[k]
        if A.known[i] > t:
            stop = min(stop, A.known[i])
    return stop


@kernel
def _grow(A, C, W, t, why):
    """Takes in what the rim of a patch still acts on; True if there is any. Notes how far the event has reached."""
    T = A.patch
    members, h, most = T.count, W.step.length, 0.0
    row, bucket = int(why == EXPIRY), bucket_of(h)
    failing = 0
    for k in range(members):
        i = T.member[k]
        if not A.until[i] > A.begun[i]:
            continue  # it has no polynomials yet
        beyond = False
        for e in range(A.reader_first[i], A.reader_first[i + 1]):
            if T.mark[A.reader[e]] != 2 * T.stamp:
                beyond = True
        if beyond:
            change = largest_change(A, C, W, k, t, h)
            most = max(most, change)
            if change > 1.0:
                A.seen[i] = -1  # marked, until its readers are taken in
                failing += 1
    if failing == 0:
        if most < _EASY:
            T.easy[row, bucket] += 1
            if T.easy[row, bucket] >= _OFTEN:
                T.easy[row, bucket] = 0
                T.depth[row, bucket] = max(T.depth[row, bucket] - 1, 1 - row)
        else:
            T.easy[row, bucket] = 0
        return False
    T.easy[row, bucket] = 0
    T.depth[row, bucket] = min(T.depth[row, bucket] + 1, _DEEPEST)
    return True


@kernel
def renew(A, P, C, S, R, W, t, stop, why):
    """New polynomials of the members of the patch from t on, up to `stop` at most; a code."""
    T = A.patch
    settled, checked = why != EVENT or T.kept != 0, why == END_OF_SLAB
    first = T.kept == 0
    while True:
        if why == EVENT and len(A.kind.between) > 0:
            take_in_held(A)
            put_in_order(A)
        if T.beyond != 0:
            return ELSEWHERE
        if not close_rim(A) or not has_room(A, P, S, R):
            return Outcome.OUT_OF_MEMORY
        if A.parts > 0 and not checked and A.own < 0 and is_ahead(A, t):
            return WITHOUT_PARTS
        # A first pass, up to the end of the span, tells how long steps are; it is done once more.
        if first and A.slab > 0.0 and take_in_rim_that_ends(A, t, stop):
            continue
        gather(A, P, C, S, W, t)
        _keep_grazes(A, S, R, t)
        note_records(A, P, S, R)
        if C.strict and A.ambiguities > 0:
            return Outcome.AMBIGUITY
        first = False
        # So short before the end of a slab, where all is renewed, what others do then does not matter.
        brief = stop - t <= _BRIEF * (S.unit + abs(t))
        C.t_end = t + max(A.slab, _BRIEF) if brief else _common_end(A, t, stop)
        S.step = A.length[T.member[0]] if A.alone != 0 else C.t_end - t
        code = GO_ON
        if not settled and _prepare_instant(A, S, W, t):
            if take_in_touching(A, P, S, W):
                continue
            # What holds the members is that of the instant at which they were renewed: an instant asks for its own.
            mask_solved(P, S, W)
            follow(P, S, W)
            code = call_unit(P.instant_unit, P, C, S, R, W)
            A.instants += 1
            if code >= GO_ON and take_in_written(A, S, W):
                continue  # the instant once more, with those that its events reach
            _after_instant(A, S, t)
            if code == GO_ON and S.t != t:
                # An accumulation has been passed: what is read moves on to its limit too.
                note_records(A, P, S, R)
                scatter(A, P, S, W, T.count)
                open_rim(A)
                t, settled, T.kept = S.t, True, 1
                continue
        settled = True
        while code == GO_ON or code == AGAIN:
            S.points = 0
            code = find_multipliers(P, C, S, R, W)
            if code == GO_ON:
                code = propose(P, C, S, R, W)
                if code == GO_ON:
                    break
        note_records(A, P, S, R)
        A.steps += S.steps
        A.jets += S.jets
        A.layers += S.layers
        S.steps = S.jets = S.layers = 0
        scatter(A, P, S, W, T.count)
        T.kept = 1
        if code != GO_ON:
            return code
        h = W.step.length
        if at(W.step.power, 1) != h:
            powers(W.step.power, h)
        best = find_first(P, C, S, W)
        if W.step.unsure != 0:
            fits, best = shorten_to_fit(P, C, S, W, best)
            if fits != h:
                h, W.end.stopped = fits, 0
        if checked or brief or not _grow(A, C, W, t, why):
            break
        A.grown += 1
        take_in_failing(A)
    _keep(A, P, C, S, W, t, h)
    T.kept = 0
    return GO_ON


@kernel
def _keep(A, P, C, S, W, t, h):
    """The members take over their polynomials, and when they meet what."""
    T, E = A.patch, A.kind
    M, places, K = T.count, T.total, C.order
    A.renewed += M
    A.spent += M
    for k in range(M):
        i = T.member[k]
        for b in range(E.ns):
            row, new = A.row[i, b], W.step.rows[b * places + k]
            for c in range(K + 1):
                row[c] = new[c]
        c = A.keeps[i]
        if c >= 0:
            for b in range(E.nm):
                if A.status[i, b] == SOLVED:
                    row, new = A.mult_row[c, b], W.step.rows[W.step.mult_row + number_of(E, b, M, k)]
                    for q in range(K + 1):
                        row[q] = new[q]
        A.begun[i], A.until[i], A.length[i] = t, C.t_end if W.end.stopped else t + h, h
        A.known[i] = math.inf if is_wall(A, i) and _stands(A, i, K) else A.until[i]
        key = math.inf
        for b in range(E.nm + E.ne):
            j = number_of(E, b, M, k)
            tau = W.meeting.tau[j]
            A.met[i, b] = t + tau * h if tau <= 1.0 else math.inf
            key = min(key, A.met[i, b])
            grazed = W.meeting.grazed[j]
            A.grazed[i, b] = t + grazed * h if grazed <= 1.0 else math.inf
            A.graze_crosses[i, b] = W.meeting.graze_crosses[j]
            A.widest[i, b] = W.meeting.widest[j]
            if b < E.nm:
                A.exit_side[i, b] = W.meeting.exit_side[j]
        for q in range(len(E.timed)):
            A.met[i, E.nm + E.timed[q]] = _next_tick(A, i, q)
            key = min(key, A.met[i, E.nm + E.timed[q]])
        if A.until[i] < A.slab_end or (A.alone != 0 and A.until[i] < A.t_end):
            key = min(key, A.until[i])
        put_in_queue(A.queue, i, key)
        activate(A, i)


@kernel
def activate(A, i):
    """Element i is renewed at the end of every slab from now on."""
    if A.active_place[i] < 0:
        d = A.queue.part[i]
        place = A.queue.first[d] + A.actives[d]
        A.active_place[i] = place
        A.active[place] = i
        A.actives[d] += 1


@kernel
def retire(A, i):
    """Element i is at rest among elements at rest: nothing is spent on it until a neighbour moves."""
    k, d = A.active_place[i], A.queue.part[i]
    A.active_place[i] = -1
    A.actives[d] -= 1
    last = A.queue.first[d] + A.actives[d]
    if k < last:
        A.active[k] = A.active[last]
        A.active_place[A.active[k]] = k


@kernel
def _stands(A, i, K):
    """Whether what others read of element i is known for ever: polynomials of a low degree."""
    for c in range(len(A.kind.read)):
        if degree_of(A.row[i, A.kind.read[c]], K) > K // 2:
            return False
    return True


@kernel
def rests(A, i, K):
    """Whether all of the motion of element i is known so."""
    for b in range(A.kind.ns):
        if degree_of(A.row[i, b], K) > K // 2:
            return False
    return True
