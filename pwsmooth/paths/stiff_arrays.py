"""The Core of one run of the stiff loop, on a block of memory that each thread keeps.

A run of a few periods takes a millisecond: the first touch of the pages of its output would be a tenth of it. What the
caller keeps is copied out of the block (stiff.py).
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from ..kernels.state import MOST_AT_ONCE
from ..kernels.stiff.state import Core

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


_MOST_OUTPUT = 2**24  # numbers that the points of one call of the loop take, and those that its events do


def core(compiled: Any, capacity: int, dense: bool, **given: Any) -> Core:
    """The Core with room for `capacity` points, fewer of large models, and for events.

    Its arrays, but the `given` ones, live until the thread's next run.
    """
    n, q, e = compiled.n, compiled.n_surfaces, compiled.n_events
    capacity = min(capacity, max(64, _MOST_OUTPUT // max(1, n * (18 if dense else 1))))
    # What happens at one instant has room in any case.
    room = 2 * e + MOST_AT_ONCE + max(64, min(64 * e, _MOST_OUTPUT // max(1, 2 * n)))
    sizes = dict(n=n, q=q, e=e, capacity=capacity, room=room, hoisted=compiled.n_hoisted, most=max(q, e),
                 layers=3 * q + len(compiled.slopes[1]),
                 entries=len(compiled.pattern[0]), rows_length=compiled.rows_length,
                 eliminated=compiled.eliminated, kept=capacity if dense else 1)  # fmt: skip
    own = dict(
        J_row=compiled.pattern[0], J_column=compiled.pattern[1], slope_first=compiled.slopes[0],
        slope_state=compiled.slopes[1], elimination=compiled.elimination, surface_state=compiled.surface_state,
        surface_row=compiled.surface_row, group=compiled.group, read=compiled.read,
    )  # fmt: skip
    numbers = {name: sizes[name] for name in ("n", "q", "e", "capacity", "room", "entries", "rows_length")}
    plan = Core.planned(sizes, undefined=_OUTPUT, given=tuple(own))
    return Core.in_one_block(
        plan, _memory, groups=int(compiled.group.max(initial=-1)) + 1, reads=len(compiled.read),
        evals=len(given["t_eval"]), instants=len(given["instant_t"]), dense=dense, **(numbers | own | given),
    )  # fmt: skip
