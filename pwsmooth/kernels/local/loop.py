"""The loop over a family whose events cost their neighbourhood.

    slab:   renew what moves, cluster by cluster, up to a common end
            while some element has an event before that:
                the elements that meet something now -> the instant -> new polynomials of what they reach

What an event changes decays with the number of links that it crosses, the faster the shorter the time that is left:
by tau^(q D) / (q D)! over D links, for rates of order q (docs: why an event is local). So a patch is renewed as far as
its rim still changes by less than a share of the tolerances, which is looked at, not assumed. Large families are cut
into parts that are worked on beside each other (parts.py).
"""

import math

from numba import types

from ..instant.accumulation import at_once_within
from ..intervals import forget_intervals
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_unit
from ..outcome import Outcome
from ..state import AGAIN, GO_ON, SOLVED, Control, Problem, Record, State
from ..surface.sliding import follow, mask_solved
from ..work import Work
from .members import (
    begin_patch,
    close_rim,
    is_wall,
    number_of,
    open_rim,
    reach,
    take_in,
    take_in_cluster,
    take_in_targets,
    take_in_touching,
)
from .parts import (
    EVENTS_OF_PARTS,
    MOVING,
    ONE_EVENT,
    RESTING,
    call_part,
    dismiss,
    report,
    take_over,
    work_in_parts,
    worse,
)
from .patch import gather, note_records, scatter, state_at, write_asked
from .queue import first_key, put_in_queue
from .renewing import END_OF_SLAB, EVENT, EXPIRY, activate, bucket_of, has_room, renew, rests, retire
from .state import ELSEWHERE, Assembly

BEGIN, SLAB, EVENTS = range(3)  # phases
# Elements put at their start together, to which those about them come until all are four times as many; and, where no
# element knows of another, those whose events of one instant are made together.
_CHUNK = 64
_AROUND = 4  # links about them whose motion tells the orders in which a surface is left
_LOOK, _REST = 8, 24  # slabs of a look at what a length costs, and looks before another length is tried
_BETTER = 0.93


@kernel
def _begin(A, P, C, S, R, W):
    """All elements at their start, some at a time, with enough about them to tell how surfaces are left; a code."""
    T, E, n = A.patch, A.kind, len(A.begun)
    while A.begun_with < n:
        begin_patch(A)
        own = min(_CHUNK, n - A.begun_with)
        for k in range(own):
            take_in(A, A.begun_with + k)
        for _ in range(_AROUND):
            if T.count < 4 * _CHUNK:
                reach(A, 1)
        while True:
            if not close_rim(A) or not has_room(A, P, S, R):
                return Outcome.OUT_OF_MEMORY
            gather(A, P, C, S, W, A.t)
            if not take_in_touching(A, P, S, W):
                break
        S.started = 0
        S.step = min(1e-3, C.max_step)
        S.side[:] = 1
        S.deflate[:] = 0
        for j in range(P.m):
            forget_intervals(S.last[j], A.t)
        W.firing.last[:, :] = 0.0
        W.meeting.widest[:] = 0.0
        code = call_unit(P.instant_unit, P, C, S, R, W)
        # What holds from the start is no event.
        S.events = 0
        if code != GO_ON:
            note_records(A, P, S, R)
            return code
        note_records(A, P, S, R)
        scatter(A, P, S, W, own)
        for k in range(own):
            i = T.member[k]
            for b in range(E.ns):
                A.row[i, b, 0] = A.x[i, b]
            A.begun[i] = A.until[i] = A.known[i] = A.t
            A.length[i] = S.step
            for b in range(E.nm + E.ne):
                A.met[i, b] = A.grazed[i, b] = math.inf
        A.begun_with += own
    return GO_ON


@kernel
def _renew_moving(A, P, C, S, R, W, d):
    """New polynomials of what moves among the elements of part d, cluster by cluster, from the beginning of a slab on;
    a code."""
    T, first = A.patch, A.queue.first[d]
    free = A.slab == 0.0 or A.alone != 0
    stop = A.t_end if free else A.slab_end
    elsewhere = -1 - A.slabs if A.own >= 0 else 0  # marks what a part leaves to the run of all
    while A.scanned[d, 0] < A.actives[d]:
        if A.renewed >= A.due:
            return AGAIN
        i = A.active[first + A.scanned[d, 0]]
        if A.seen[i] != A.slabs and A.seen[i] != elsewhere and not is_wall(A, i):
            begin_patch(A)
            take_in(A, i)
            take_in_cluster(A)
            for k in range(T.count if T.beyond != 0 else 0):
                A.seen[T.member[k]] = elsewhere
            code = renew(A, P, C, S, R, W, A.t, stop, END_OF_SLAB)
            if code == ELSEWHERE:
                A.left[d] = 1
            elif code != GO_ON:
                return code
            else:
                for k in range(T.count):
                    A.seen[T.member[k]] = A.slabs
                if free:
                    A.trial = min(A.trial, W.step.length)
        A.scanned[d, 0] += 1
    return GO_ON


@kernel
def _renew_resting(A, P, C, S, R, W, d):
    """As _renew_moving, of what rests, one by one."""
    first = A.queue.first[d]
    while A.scanned[d, 1] < A.actives[d]:
        if A.renewed >= A.due:
            return AGAIN
        i = A.active[first + A.scanned[d, 1]]
        if A.seen[i] != A.slabs:
            begin_patch(A)
            take_in(A, i)
            code = renew(A, P, C, S, R, W, A.t, A.t_end, END_OF_SLAB)
            if code == ELSEWHERE:
                A.left[d] = 1
            elif code != GO_ON:
                return code
            else:
                A.seen[i] = A.slabs
                if A.known[i] == math.inf and A.slabs > 1 and rests(A, i, C.order):
                    if A.until[i] < A.t_end:
                        put_in_queue(A.queue, i, min(A.queue.key[i], A.until[i]))
                    retire(A, i)
                    continue  # another one stands in its place now
        A.scanned[d, 1] += 1
    return GO_ON


@kernel
def _renew_all(A, P, C, S, R, W):
    """New polynomials of all that is not at rest, from the beginning of a slab on; a code."""
    for task in (MOVING, RESTING):
        code = work_in_parts(A, task, math.inf) if A.parts > 0 else GO_ON
        for d in range(A.parts + 1):
            if code == GO_ON and (d == A.parts or A.left[d] != 0):
                if task == MOVING:
                    code = _renew_moving(A, P, C, S, R, W, d)
                else:
                    code = _renew_resting(A, P, C, S, R, W, d)
        if code != GO_ON:
            return code
    for d in range(A.parts if A.slabs == 1 else 0):
        A.trial = min(A.trial, A.shortest[d])
    return GO_ON


@kernel
def _tune(A):
    """The length of the next slab: by what the last ones have cost, in elements renewed a time."""
    A.window += 1
    for d in range(A.parts):
        A.spent += A.effort[d]
        A.effort[d] = 0
    if A.window < _LOOK:
        return
    rate = A.spent / A.spanned if A.spanned > 0.0 else 0.0
    A.window, A.spent, A.spanned = 0, 0.0, 0.0
    if A.trial != 1.0:
        if rate < _BETTER * A.best:
            A.best = rate
            A.slab *= A.trial  # further the same way
        else:
            A.slab /= A.trial
            A.way = 1.0 / A.trial
            A.trial, A.rest = 1.0, 0
        return
    A.best = rate
    A.rest += 1
    if A.rest >= _REST:
        A.trial = A.way
        A.slab *= A.trial


@kernel
def _next_slab(A):
    """Where the next slab begins and ends."""
    actives, first = 0, A.t_end
    for d in range(A.parts + 1):
        actives += A.actives[d]
        first = min(first, first_key(A.queue, d))
    if actives == 0:
        A.t = first
    A.slab_begin = A.t
    A.slab_end = A.t_end
    if A.alone == 0 and A.slab > 0.0 and A.t + A.slab < A.t_end - 1e-9 * A.slab:
        A.slab_end = A.t + A.slab
    A.now = A.t
    A.slabs += 1
    A.scanned[:, :] = 0


@kernel
def _meets_now(A, t):
    """Makes the elements whose key is t, to rounding, the members; why they are renewed."""
    T, Q, E = A.patch, A.queue, A.kind
    limit = t + at_once_within(t, A.length[Q.heap[Q.first[A.seat]]])
    # Where no element knows of another some come after the others, as the instant looks at all of its members; and of
    # contacts: those that act on each other touch, so that they are found whoever comes first.
    alone = A.alone != 0 and E.together == 0
    most = _CHUNK if alone else _CHUNK // 4 if len(E.contact) > 0 else len(A.begun)
    begin_patch(A)
    # Down the heap as long as keys are that early; the members so far are the places still to look at.
    for d in range(A.parts + 1):
        if (d == A.seat or A.own < 0) and first_key(Q, d) <= limit:
            take_in(A, Q.heap[Q.first[d]])
    k = 0
    while k < T.count:
        i = T.member[k]
        place, d = Q.place[i], Q.part[i]
        top, end = Q.first[d], Q.first[d] + Q.size[d]
        for below in range(2 * place + 1 - top, 2 * place + 3 - top):
            if below < end and Q.key[Q.heap[below]] <= limit and T.count < most:
                take_in(A, Q.heap[below])
        k += 1
    for k in range(T.count):
        i = T.member[k]
        for b in range(E.nm + E.ne):
            if A.met[i, b] <= limit:
                return EVENT
    return EXPIRY


@kernel
def _next_event(A, P, C, S, R, W):
    """What happens next among the elements of its seat; a code."""
    T, Q = A.patch, A.queue
    t = first_key(Q, A.seat)
    if T.kept != 0:
        open_rim(A)
    else:
        T.why = _meets_now(A, t)
        for k in range(T.count if T.why == EVENT else 0):
            take_in_targets(A, T.member[k])
        if T.why == EXPIRY:
            if t >= A.slab_end:
                for k in range(T.count):
                    put_in_queue(Q, T.member[k], math.inf)
                    activate(A, T.member[k])
                return GO_ON
            A.expiries += 1
        reach(A, T.depth[int(T.why == EXPIRY), bucket_of(A.slab_end - t)])
    code = renew(A, P, C, S, R, W, t, A.slab_end, T.why)
    if code != GO_ON:
        A.t = t
        if code == Outcome.AMBIGUITY:
            A.t = min(t, A.ambiguity_t[A.ambiguities - 1])
        return code
    A.now = t
    return GO_ON


@kernel
def _act(A, P, C, S, R, W):
    """All events of a slab, one instant after the other, those of the parts beside each other; a code."""
    while True:
        t, who = first_key(A.queue, A.parts), A.parts
        if A.parts > 0:
            code = work_in_parts(A, EVENTS_OF_PARTS, t)
            if code != GO_ON:
                return code
            for d in range(A.parts):
                if A.waits[d] < t:
                    t, who = A.waits[d], d
        if t > A.slab_end:
            return GO_ON
        if A.renewed >= A.due:
            return AGAIN  # to look at the clock
        if who < A.parts:
            A.task = ONE_EVENT
            call_part(A, who)
            code = worse(GO_ON, A.told[who])
        else:
            code = _next_event(A, P, C, S, R, W)
        if code != GO_ON:
            return code


@kernel
def _act_in_part(A, P, C, S, R, W, limit):
    """The events of a part before `limit`, up to one that reaches beyond it; a code."""
    Q, d = A.queue, A.seat
    t = first_key(Q, d)
    if A.pending[d] == 0:
        A.waits[d] = math.inf
    while A.waits[d] == math.inf and t < limit and t <= A.slab_end:
        if A.renewed >= A.due:
            return AGAIN
        # What happens at one instant with something of the border is made together with that.
        together = t + at_once_within(t, A.length[Q.heap[Q.first[d]]]) >= limit
        code = ELSEWHERE if together else _next_event(A, P, C, S, R, W)
        if code == ELSEWHERE:
            A.waits[d], A.pending[d] = t, A.patch.stamp if A.patch.kept != 0 else 0
        elif code != GO_ON:
            return code
        t = first_key(Q, d)
    return GO_ON


@kernel
def _work(A, all_of_them, P, C, S, R, W):
    """A part at the task of all parts; a code."""
    take_over(A, all_of_them)
    d, task = A.seat, all_of_them.task
    if task == MOVING:
        code = _renew_moving(A, P, C, S, R, W, d)
    elif task == RESTING:
        code = _renew_resting(A, P, C, S, R, W, d)
    elif task == EVENTS_OF_PARTS:
        code = _act_in_part(A, P, C, S, R, W, all_of_them.limit)
    else:
        A.own = -1
        code = _next_event(A, P, C, S, R, W)
        A.own = d
        if code == GO_ON:
            A.waits[d], A.pending[d] = math.inf, 0
    report(A)
    return code


@kernel
def _finish(A, P, C, S, R, W):
    """The states of all elements at the end, their multipliers, and what was asked for up to there."""
    K, stamp = C.order, A.patch.stamp
    for i in range(len(A.begun)):
        if A.fresh[i] != stamp:
            write_asked(A, i, A.t, K, True)
    for i in range(len(A.begun)):
        solved = False
        for b in range(A.kind.nm):
            solved = solved or A.status[i, b] == SOLVED
        if solved and A.fresh[i] != stamp:
            # What holds it is a matter of this instant alone.
            begin_patch(A)
            take_in(A, i)
            if close_rim(A):
                gather(A, P, C, S, W, A.t)
                mask_solved(P, S, W)
                if follow(P, S, W):
                    for b in range(A.kind.nm):
                        A.mult[i, b] = S.mult[number_of(A.kind, b, A.patch.count, 0)]
    begin_patch(A)
    for i in range(len(A.begun)):
        if A.fresh[i] != stamp:
            for b in range(A.kind.ns):
                A.x[i, b] = state_at(A, i, b, A.t, K)


@kernel
def _halt(A, P, C, S, R, W):
    """Ends the run at the last instant at which anything has happened, in whichever part."""
    code = Outcome.TIME_LIMIT
    if A.parts > 0 and A.phase == EVENTS:
        last = A.now
        for d in range(A.parts):
            last = max(last, A.clock[d])
        A.slab_end, A.now = last, last
        ended = _act(A, P, C, S, R, W)
        if ended != GO_ON:
            return ended
        A.now = last
    A.t = A.now
    return code


@unit(types.int64, Assembly, Assembly, Problem, Control, State, Record, Work)
def run(A, all_of_them, P, C, S, R, W):
    """Advances the assembly to its end or to the first reason to return: an Outcome, or AGAIN where it may go on; of
    the Assembly of a part its task, a code."""
    if A.seat < A.parts:
        return _work(A, all_of_them, P, C, S, R, W)
    code = _halt(A, P, C, S, R, W) if A.halts != 0 else _advance(A, P, C, S, R, W)
    dismiss(A)
    if code == Outcome.FINISHED or code == Outcome.TIME_LIMIT:
        begin_patch(A)
    if code < GO_ON and code != Outcome.OUT_OF_MEMORY:
        _finish(A, P, C, S, R, W)
    return code


@kernel
def _advance(A, P, C, S, R, W):
    if A.phase == BEGIN:
        code = _begin(A, P, C, S, R, W)
        if code != GO_ON:
            return code
        A.trial = math.inf
        _next_slab(A)
        A.phase = SLAB
    while True:
        if A.phase == SLAB:
            code = _renew_all(A, P, C, S, R, W)
            if code != GO_ON:
                return code
            if A.slabs == 1:
                # Now the motion of what rests is known, which others read: once more.
                A.slab = A.trial if A.trial < math.inf else 0.1 * (A.t_end - A.t)
                A.trial, A.way = 1.0, 0.5
                if A.alone != 0:
                    A.slabs, A.phase = 2, EVENTS
                    return AGAIN
                _next_slab(A)
                return AGAIN  # the state at the start, for whoever keeps it
            A.phase = EVENTS
        code = _act(A, P, C, S, R, W)
        if code != GO_ON:
            return code
        A.spanned += A.slab_end - A.slab_begin
        A.t = A.slab_end
        if A.t >= A.t_end:
            break
        if A.alone == 0:
            _tune(A)
        _next_slab(A)
        A.phase = SLAB
    return Outcome.FINISHED
