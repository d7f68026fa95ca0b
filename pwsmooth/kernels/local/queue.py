"""Elements in the order of their next events: a binary heap that knows where each of them stands.

An element has one key, which is moved when it changes: no entry is ever out of date. Equal keys stand in the order of
the elements, so that a run has the same bits wherever it runs.
"""

import math

from ..machine.compiling import inlined_kernel, kernel


@inlined_kernel
def _before(Q, i, j):
    return Q.key[i] < Q.key[j] or (Q.key[i] == Q.key[j] and i < j)


@kernel
def _rise(Q, k):
    i = Q.heap[k]
    while k > 0:
        above = (k - 1) // 2
        j = Q.heap[above]
        if not _before(Q, i, j):
            break
        Q.heap[k] = j
        Q.place[j] = k
        k = above
    Q.heap[k] = i
    Q.place[i] = k


@kernel
def _sink(Q, k):
    i = Q.heap[k]
    while True:
        below = 2 * k + 1
        if below >= Q.size:
            break
        if below + 1 < Q.size and _before(Q, Q.heap[below + 1], Q.heap[below]):
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
    k = Q.place[i]
    if key == math.inf:
        if k >= 0:
            Q.size -= 1
            Q.place[i] = -1
            if k < Q.size:
                moved = Q.heap[Q.size]
                Q.heap[k] = moved
                Q.place[moved] = k
                _rise(Q, k)
                _sink(Q, Q.place[moved])
        Q.key[i] = key
        return
    if k < 0:
        k = Q.size
        Q.heap[k] = i
        Q.place[i] = k
        Q.key[i] = key
        Q.size += 1
        _rise(Q, k)
        return
    Q.key[i] = key
    _rise(Q, k)
    _sink(Q, Q.place[i])
