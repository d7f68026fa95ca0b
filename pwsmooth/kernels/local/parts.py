"""Parts of a large family that are worked on beside each other, with a border between them that no part enters.

    events of the parts before the first one of the border, or up to one that reaches into it        beside each other
    the earliest of what waits: that of the border, or of a part                                     alone
    ...

No element of a part reads one of another part, so that the parts write different elements and read nothing that
another one writes. Which elements are in which part is the family's structure alone, and so is the order of all that
is done one after the other: the bits are the same for any number of threads, one included. A part may be ahead of an
event that waits, of the border or of another part; should it have gone on from what that event changes, which so wide
a border keeps from happening, all is done once more without parts.
"""

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..instant.accumulation import at_once_within
from ..machine.compiling import kernel, unit
from ..machine.pointers import caller
from ..outcome import Outcome
from ..state import AGAIN, GO_ON
from .state import WITHOUT_PARTS, Assembly

MOVING, RESTING, EVENTS_OF_PARTS, ONE_EVENT = range(4)  # tasks of a part
# Places of a post: so far from that of all, which has the order, to that of part 0, and from part to part, which is
# more than a cache line; in each the last order that is taken, and that is done.
_LINE = 16
_TAKEN, _DONE = 0, 8

_call_part = caller("A, all, P, C, S, R, W", types.int64)


def _pointer(builder, a, k):
    return builder.gep(builder.inttoptr(a, ir.IntType(64).as_pointer()), [k])


@intrinsic
def _tell(typingctx, address, k, value):
    """Writes an int64 for another thread, behind all that was written before."""

    def codegen(context, builder, sig, args):
        builder.store_atomic(args[2], _pointer(builder, *args[:2]), "release", 8)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), codegen


@intrinsic
def _hear(typingctx, address, k):
    """Reads an int64 that another thread writes, before all that is read behind it."""

    def codegen(context, builder, sig, args):
        return builder.load_atomic(_pointer(builder, *args), "acquire", 8)

    return types.int64(types.int64, types.int64), codegen


@intrinsic
def _take(typingctx, address, k, before, value):
    """Writes an int64 where `before` stands, unless another thread has; whether it has not."""

    def codegen(context, builder, sig, args):
        place, before, value = _pointer(builder, *args[:2]), *args[2:]
        return builder.extract_value(builder.cmpxchg(place, before, value, "acq_rel", "acquire"), 1)

    return types.boolean(types.int64, types.int64, types.int64, types.int64), codegen


@kernel
def call_part(A, d):
    """Part d at its task; its code is in A.told."""
    crew = A.crew[d]
    A.told[d] = _call_part(A.unit_of_parts, crew[0], A.here, crew[1], crew[2], crew[3], crew[4], crew[5])


@kernel
def _call_if_free(A, d, order):
    """Part d at the task of this order, where no other thread has begun it."""
    place = _LINE * (1 + d)
    if _take(A.post_address, place + _TAKEN, order - 1, order):
        call_part(A, d)
        _tell(A.post_address, place + _DONE, order)


@kernel
def work_in_parts(A, task, limit):
    """All parts at a task, beside each other; a code. No thread waits for one that has not begun yet."""
    A.task, A.limit = task, limit
    A.orders += 1
    _tell(A.post_address, 0, A.orders)
    for d in range(A.parts):
        _call_if_free(A, d, A.orders)
    code = GO_ON
    for d in range(A.parts):
        while _hear(A.post_address, _LINE * (1 + d) + _DONE) != A.orders:
            pass
        code = worse(code, A.told[d])
    return code


@kernel
def worse(code, other):
    """Of how two parts have ended, what all have to do: without parts where one has failed."""
    if other < GO_ON and other != Outcome.OUT_OF_MEMORY:
        other = WITHOUT_PARTS
    if code == WITHOUT_PARTS or other == WITHOUT_PARTS:
        return WITHOUT_PARTS
    if code == Outcome.OUT_OF_MEMORY or other == Outcome.OUT_OF_MEMORY:
        return Outcome.OUT_OF_MEMORY
    return AGAIN if code == AGAIN or other == AGAIN else GO_ON


@kernel
def dismiss(A):
    """The other threads are done."""
    if A.parts > 0:
        _tell(A.post_address, 0, -1)


@unit(types.int64, Assembly)
def stand_by(A):
    """What another thread does for the Assembly of all, until it is dismissed."""
    order = 0
    while order >= 0:
        new = _hear(A.post_address, 0)
        if new != order:
            order = new
            for k in range(A.parts if order > 0 else 0):
                _call_if_free(A, A.parts - 1 - k, order)
    return 0


@kernel
def _is_ahead_at(A, i, t):
    if A.begun[i] > t + at_once_within(t, A.length[i]):
        return True
    for d in range(A.parts):
        if A.pending[d] != 0 and A.pending[d] != A.patch.stamp and A.fresh[i] == A.pending[d]:
            return True
    return False


@kernel
def is_ahead(A, t):
    """Whether a part has gone on, beyond t, from what the patch changes or reads."""
    T = A.patch
    for k in range(T.total):
        i = T.member[k]
        if _is_ahead_at(A, i, t):
            return True
        for e in range(A.reader_first[i], A.reader_first[i + 1] if k < T.count else A.reader_first[i]):
            if _is_ahead_at(A, A.reader[e], t):
                return True
    return False


@kernel
def take_over(A, all_of_them):
    """What holds for all parts now."""
    A.t, A.t_end = all_of_them.t, all_of_them.t_end
    A.slab, A.slab_begin, A.slab_end = all_of_them.slab, all_of_them.slab_begin, all_of_them.slab_end
    if A.slabs != all_of_them.slabs:
        A.slabs = all_of_them.slabs
        A.scanned[:, :] = 0
        A.left[A.seat] = 0
        if A.slabs == 1:
            A.trial = math.inf


@kernel
def report(A):
    """What the whole run wants to know of a part."""
    A.clock[A.seat] = A.now
    A.effort[A.seat] += A.spent
    A.spent = 0
    A.shortest[A.seat] = A.trial
