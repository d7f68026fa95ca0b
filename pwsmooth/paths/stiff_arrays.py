"""The Core of one run of the stiff loop, on a block of memory that each thread keeps.

A run of a few periods takes a millisecond: the first touch of the pages of its output would be a tenth of it. What the
caller keeps is copied out of the block (stiff.py).
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from ..kernels.stiff.state import STRIDE, Core

_kept = threading.local()
_MOST_KEPT = 2**23  # bytes
_OUTPUT = ("degree", "event_index", "times", "states", "length", "event_t", "event_x", "coefficients")


def _memory(size: int) -> np.ndarray:
    block = getattr(_kept, "block", None)
    if block is None or block.size < size:
        block = np.empty(size, np.uint8)
        if size <= _MOST_KEPT:
            _kept.block = block
    return block


def _plan(n: int, q: int, e: int, capacity: int, room: int, hoisted: int, slots: int, dense: bool):
    sizes = dict(n=n, q=q, e=e, capacity=capacity, room=room, hoisted=hoisted, stride=STRIDE, most=max(q, e),
                 elimination=8 * (slots or n * n + n), kept=capacity if dense else 1)  # fmt: skip
    return Core.planned(sizes, undefined=_OUTPUT)


def core(compiled: Any, room: int, capacity: int, dense: bool, **given: Any) -> Core:
    """The Core with room for so many events and points; its arrays, but the `given` ones, live until the thread's next
    run."""
    n, q, e = compiled.n, compiled.n_surfaces, compiled.n_events
    plan = _plan(n, q, e, capacity, room, compiled.n_hoisted, compiled.n_slots, dense)
    return Core.in_one_block(
        plan, _memory, n=n, q=q, e=e, capacity=capacity, room=room, evals=len(given["t_eval"]),
        instants=len(given["instant_t"]), dense=dense, **given,
    )  # fmt: skip
