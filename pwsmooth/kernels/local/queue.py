"""Elements in the order of their next events: a binary heap of each part of them that knows where each stands.

An element has one key, which is moved when it changes: no entry is ever out of date. Equal keys stand in the order of
the elements, so that a run has the same bits wherever it runs.
"""

import math

from ..machine.compiling import inlined_kernel, kernel


@inlined_kernel
def _before(Q, i, j):
    return Q.key[i] < Q.key[j] or (Q.key[i] == Q.key[j] and i < j)


@inlined_kernel
def first_key(Q, d):
    """When the next element of part d happens, inf for never."""
    return Q.key[Q.heap[Q.first[d]]] if Q.size[d] > 0 else math.inf


@kernel
def _rise(Q, top, k):
    i = Q.heap[k]
    while k > top:
        above = top + (k - top - 1) // 2
        j = Q.heap[above]
        if not _before(Q, i, j):
            break
        Q.heap[k] = j
        Q.place[j] = k
        k = above
    Q.heap[k] = i
    Q.place[i] = k


@kernel
def _sink(Q, top, end, k):
    i = Q.heap[k]
    while True:
        below = 2 * k + 1 - top
        if below >= end:
            break
        if below + 1 < end and _before(Q, Q.heap[below + 1], Q.heap[below]):
            below += 1
        j = Q.heap[below]
        if not _before(Q, j, i):
            break
        Q.heap[k] = j
        Q.place[j] = k
        k = below
    Q.heap[k] = i
    Q.place[i] = k


@kernel
def put_in_queue(Q, i, key):
    """Element i happens next at `key`; inf takes it out."""
    d, k = Q.part[i], Q.place[i]
    top = Q.first[d]
    Q.key[i] = key
    if key == math.inf:
        if k >= 0:
            Q.size[d] -= 1
            Q.place[i] = -1
            end = top + Q.size[d]
            if k < end:
                moved = Q.heap[end]
                Q.heap[k] = moved
                Q.place[moved] = k
                _rise(Q, top, k)
                _sink(Q, top, end, Q.place[moved])
        return
    if k < 0:
        k = top + Q.size[d]
        Q.heap[k] = i
        Q.place[i] = k
        Q.size[d] += 1
        _rise(Q, top, k)
        return
    _rise(Q, top, k)
    _sink(Q, top, top + Q.size[d], Q.place[i])
