"""How a large family is cut into parts that threads work on beside each other, and those threads.

Chain: local.py -> **this file** -> kernels/local/parts.py, which says why the bits do not depend on the threads.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..codegen.machine.workers import cores

PARTS = 2
_FROM = 4096  # elements
_WIDE = 24  # links that the border reaches on each side: patches reach over a few
_MOST = 0.25  # of the elements in the border


def cut(near: np.ndarray, by_table: bool) -> np.ndarray:
    """The part of each element, shape (n,), or `PARTS` for the border between them; 0 everywhere where there is no
    good cut. Row i of `near` has what element i is linked to; numbers far from each other are linked `by_table`."""
    from scipy.sparse import coo_array  # which the import of the package does without
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    n = len(near)
    i = np.arange(n)
    if n < _FROM:
        return np.zeros(n, np.int8)
    from_, to = np.repeat(i, near.shape[1]), near.ravel()
    if not (from_ != to).any():
        return (PARTS * i // n).astype(np.int8)
    ends = np.concatenate([from_, to]), np.concatenate([to, from_])
    links = coo_array((np.ones(len(ends[0]), np.int32), ends), (n, n)).tocsr()
    order = reverse_cuthill_mckee(links, symmetric_mode=True) if by_table else i
    part = np.empty(n, np.int8)
    part[order] = PARTS * i // n
    border = np.zeros(n, bool)
    border[from_[part[from_] != part[to]]] = border[to[part[from_] != part[to]]] = True
    for _ in range(_WIDE):
        border |= links @ border > 0
    part[border] = PARTS
    return part if border.mean() <= _MOST else np.zeros(n, np.int8)


def threads_for(wanted: int | None, inside: bool) -> int:
    """Threads of a run: as many as are wanted; else all cores up to the number of parts, one inside of a longer call,
    whose own threads are busy."""
    return min(PARTS, wanted or (1 if inside else cores()))


@contextlib.contextmanager
def beside(A: Any) -> Iterator[None]:
    """The other threads of an Assembly stand by while its kernel runs."""
    from ..codegen.machine.units import stand_by

    A.post[:] = A.orders = 0
    helpers = [threading.Thread(target=stand_by(), args=[A.address, w], daemon=True) for w in range(1, A.threads)]
    for helper in helpers:
        helper.start()
    yield  # the kernel tells them when it is done
    for helper in helpers:
        helper.join()
