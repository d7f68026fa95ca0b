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


def cut(near: np.ndarray, first: np.ndarray, reader: np.ndarray, by_table: bool) -> np.ndarray:
    """The part of each element, shape (n,), or `PARTS` for the border between them; 0 everywhere where there is no
    good cut.

    Row i of `near` has what element i reads, `reader[first[i]:first[i + 1]]` who reads it; with a table of links
    numbers say nothing of who is far from whom.
    """
    n = len(near)
    whole, part = np.zeros(n, np.int8), (PARTS * np.arange(n) // n).astype(np.int8)
    if n < _FROM:
        return whole
    if by_table:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        part[reverse_cuthill_mckee(csr_array((np.ones(len(reader), np.int8), reader, first), (n, n)))] = (
            part.copy()
        )
    border = np.zeros(n, bool)
    reads = part[near] != part[:, None]
    border[near[reads]] = border[reads.any(axis=1)] = True
    new = np.flatnonzero(border)
    for _ in range(_WIDE):
        count = first[new + 1] - first[new]
        readers = reader[np.repeat(first[new + 1] - np.cumsum(count), count) + np.arange(count.sum())]
        new = np.unique(np.concatenate([near[new].ravel(), readers]))
        new = new[~border[new]]
        border[new] = True
        if border.mean() > _MOST:
            return whole
    part[border] = PARTS
    return part


def threads_for(wanted: int | None, inside: bool) -> int:
    """Threads of a run: as many as are wanted; else all cores up to the number of parts, one inside of a longer call,
    whose own threads are busy."""
    return min(PARTS, wanted or (1 if inside else cores()))


@contextlib.contextmanager
def beside(A: Any, threads: int) -> Iterator[None]:
    """All threads but this one stand by while the kernel of an Assembly runs."""
    from ..codegen.machine.units import stand_by

    A.post[:] = A.orders = 0
    others = threads - 1 if A.parts else 0
    helpers = [threading.Thread(target=stand_by(), args=[A.address], daemon=True) for _ in range(others)]
    try:
        for helper in helpers:
            helper.start()
        yield
    finally:
        A.post[0, 0] = -1  # dismissed, as by the kernel, which may not have come to it
        for helper in helpers:
            if helper.ident is not None:
                helper.join()
