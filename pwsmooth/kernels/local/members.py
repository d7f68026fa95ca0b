"""Who is renewed together: members, what they read of others, and what has to come with them.

An event reaches its neighbourhood over links; what touches is reached at once, and so is what an event writes.
"""

from ..instant.surface_rates import evaluate_surfaces
from ..machine.compiling import inlined_kernel, kernel
from ..state import CONTACT, SLIDING, SOLVED
from ..surface.sliding import surface_rounding

SOON = 0.25  # of the time ahead: what is read expires so early that it is renewed too


@inlined_kernel
def number_of(E, s, M, k):
    """Number of surface s of member k: some belong to all elements."""
    return E.s_fixed[s] + E.s_blocks[s] * M + (k if E.s_own[s] else 0)


@kernel
def begin_patch(A):
    A.patch.stamp += A.patch.stride
    A.patch.count = A.patch.total = A.patch.beyond = 0


@inlined_kernel
def _may_not(A, i):
    """Whether element i is none of those that may be members; noted."""
    if A.own < 0 or A.queue.part[i] == A.own:
        return False
    A.patch.beyond = 1
    return True


@kernel
def take_in(A, i):
    """Makes element i a member."""
    T = A.patch
    if T.mark[i] != 2 * T.stamp and not _may_not(A, i):
        T.mark[i] = 2 * T.stamp
        T.slot[i] = T.count
        T.member[T.count] = i
        T.count += 1


@kernel
def is_wall(A, i):
    """Whether element i sticks such that what happens on one side of it does not reach the other."""
    if A.kind.walls == 0:
        return False
    for j in range(A.kind.nm):
        if A.kind.kind[j] == SLIDING and A.status[i, j] != SOLVED:
            return False
    return True


@kernel
def take_in_readers(A, i):
    for e in range(A.reader_first[i], A.reader_first[i + 1]):
        take_in(A, A.reader[e])


@kernel
def reach(A, depth):
    """Takes in what the members reach over so many links, through elements that move."""
    first, last = 0, A.patch.count
    for level in range(depth):
        for k in range(first, last):
            i = A.patch.member[k]
            if level == 0 or not is_wall(A, i):
                take_in_readers(A, i)
        first, last = last, A.patch.count
        if first == last:
            break


@kernel
def take_in_cluster(A):
    """Takes in all that is linked with the members through elements that move."""
    k = 0
    while k < A.patch.count:
        i = A.patch.member[k]
        if not is_wall(A, i):
            take_in_readers(A, i)
            for r in range(A.kind.nr):
                take_in(A, A.near[i, r])
        k += 1


@kernel
def open_rim(A):
    """Forgets what the members read of others, which may be taken in now."""
    T = A.patch
    T.beyond = 0
    for k in range(T.count, T.total):
        if T.mark[T.member[k]] == 2 * T.stamp + 1:
            T.mark[T.member[k]] = 0
    T.total = T.count


@kernel
def put_in_order(A):
    """Sorts the members by their numbers (Shell's way): of what touches, one after the other means something."""
    member, slot, count, step = A.patch.member, A.patch.slot, A.patch.count, 1
    while 3 * step < count:
        step = 3 * step + 1
    while step > 0:
        for k in range(step, count):
            new, j = member[k], k
            while j >= step and member[j - step] > new:
                member[j] = member[j - step]
                j -= step
            member[j] = new
        step //= 3
    for k in range(count):
        slot[member[k]] = k


@kernel
def take_in_held(A):
    """Takes in what touches the members and what touches that: forces go through it at once."""
    T, E = A.patch, A.kind
    k = 0
    while k < T.count and len(E.between) > 0:
        i = T.member[k]
        for c in range(len(E.between)):
            if A.status[i, E.between[c]] == SOLVED:
                for r in range(E.nr):
                    take_in(A, A.near[i, r])
            for e in range(A.reader_first[i], A.reader_first[i + 1]):
                if A.status[A.reader[e], E.between[c]] == SOLVED:
                    take_in(A, A.reader[e])
        k += 1


@kernel
def close_rim(A):
    """Finds what the members read of others; False where there is no room for so many."""
    take_in_held(A)
    T, nr = A.patch, A.kind.nr
    T.total = T.count
    for k in range(T.count):
        i = T.member[k]
        for r in range(nr):
            j = A.near[i, r]
            if T.mark[j] >> 1 != T.stamp:
                T.mark[j] = 2 * T.stamp + 1
                T.slot[j] = T.total
                T.member[T.total] = j
                T.total += 1
    if T.total > T.most:
        T.needs = T.total
        return False
    for k in range(T.count):
        i = T.member[k]
        T.number[k] = i + 1.0
        for r in range(nr):
            T.near[nr * k + r] = float(T.slot[A.near[i, r]])
    return True


@kernel
def take_in_targets(A, i):
    """Takes in the elements that events of element i write; whether one was none of the members."""
    T, E = A.patch, A.kind
    count = T.count
    for c in range(len(E.target)):
        take_in(A, A.near[i, E.target[c]])
    return T.count > count


@kernel
def take_in_written(A, S, W):
    """Takes in what members whose states have jumped may have written, and whose surfaces read them; True if those are
    more."""
    T, E = A.patch, A.kind
    if len(E.target) == 0:
        return False
    members, places = T.count, T.total
    open_rim(A)
    # Members grow over what they read: from behind, each is looked at before it is written over.
    for k in range(members, places):
        for b in range(E.ns):
            if S.x[b * places + k] != W.firing.arrived[b * places + k]:
                take_in(A, T.member[k])
                break
    for k in range(members):
        for b in range(E.ns):
            if S.x[b * places + k] != W.firing.arrived[b * places + k]:
                take_in_targets(A, T.member[k])
                if E.acts_between != 0:
                    take_in_readers(A, T.member[k])
                break
    some = T.count > members
    if not some:
        close_rim(A)
    return some


@kernel
def take_in_touching(A, P, S, W):
    """Takes in what members touch, and what may touch them; True if that is more. Forces and impacts go through it."""
    T, E = A.patch, A.kind
    if len(E.between) == 0:
        return False
    evaluate_surfaces(P, S, W)
    members = T.count
    open_rim(A)
    for k in range(members):
        for c in range(len(E.between)):
            j = number_of(E, E.between[c], members, k)
            h = W.h[j] if P.kind[j] == CONTACT else abs(W.h[j])
            if S.status[j] == SOLVED or W.meeting.tau[j] <= 0.0 or h <= surface_rounding(P, S, j, W):
                take_in_readers(A, T.member[k])
                for r in range(E.nr):
                    take_in(A, A.near[T.member[k], r])
    if T.count == members:
        close_rim(A)
        return False
    return True


@kernel
def take_in_rim_that_ends(A, t, stop):
    """Takes in what the members read of motions that end before long; True if there are any."""
    T = A.patch
    some = False
    for k in range(T.count, T.total):
        i = T.member[k]
        if t < A.known[i] < t + SOON * (stop - t):
            some = True
    if some:
        last = T.total
        ends = t + SOON * (stop - t)
        first = T.count
        # Members grow over what they read: from behind, each is looked at before it is written over.
        for k in range(first, last):
            i = T.member[k]
            T.mark[i] = 0
        count = first
        for k in range(first, last):
            i = T.member[k]
            if t < A.known[i] < ends and not _may_not(A, i):
                T.mark[i] = 2 * T.stamp
                T.slot[i] = count
                T.member[count] = i
                count += 1
        T.count = T.total = count
    return some


@kernel
def take_in_failing(A):
    T = A.patch
    open_rim(A)
    for k in range(T.count):
        i = T.member[k]
        if A.seen[i] == -1:
            A.seen[i] = A.slabs
            take_in_readers(A, i)
