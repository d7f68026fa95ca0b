"""The arrays of one run of the stiff loop, in one block of memory that each thread keeps.

A run of a few periods takes a millisecond: fifty allocations, and the first touch of the pages of its output, would
be a tenth of it. What the caller keeps is copied out of the block (stiff.py).
"""

from __future__ import annotations

import functools
import math
import threading
from types import SimpleNamespace

import numpy as np

from .kernels import stiff_state as S

_kept = threading.local()
_MOST_KEPT = 2**20  # words
# What Python writes before a run or reads after it.
_SEEN = ("cnt", "num", "kind", "stops", "remembers", "x", "power", "degree", "event_index", "t", "states", "length",
         "event_t", "event_x", "coefficients")  # fmt: skip


@functools.lru_cache(maxsize=64)
def _layout(n: int, q: int, e: int, capacity: int, room: int, hoisted: int, slots: int, dense: bool):
    """Words to be zeroed, words in all, offset in bytes of every field of a Core, and the arrays that Python sees."""
    shapes = {
        "cnt": (S.SINCE_MARK + 1,), "num": (S.LEAST_ADVANCE + 1,), "kind": (e,), "stops": (e,), "remembers": (e,),
        "due": (e,), "met": (e,),
        "x": (n,), "f": (n,), "start": (n,), "poly": (n, 8), "rows": (2, n + q, S.STRIDE), "power": (n,),
        "surf": (q, n + 3), "J": (n, n), "lu": (slots or n * n + n, 8), "Z": (n, 8), "W": (n, 8), "X": (n, 8),
        "F": (n, 8), "R": (n, 8), "hoisted": (hoisted, 8), "values": (max(q, e), 8), "weight": (n,),
        "newton_weight": (n,), "err": (n,), "scratch": (n + 8,), "scratch2": (n + 8,), "out": (8,), "t8": (8,),
        "mu": (8,), "side": (e,), "found": (e,), "passed_side": (e,), "level": (e,), "was": (e,), "rounding": (e,),
        "fired": (e, 6), "before": (n,), "after": (n,),
    }  # fmt: skip
    output = {
        "degree": (capacity,), "event_index": (room,), "t": (capacity,), "states": (capacity, n),
        "length": (capacity,), "event_t": (room,), "event_x": (room, 2, n),
        "coefficients": (capacity if dense else 1, n, 17),
    }  # fmt: skip
    first, word = {}, 0
    for name, shape in (shapes | output).items():
        first[name] = word
        word += math.prod(shape)
    offsets = np.array([8 * first.get(name, 0) for name in S.Core._fields])
    seen = [
        (
            name,
            slice(first[name], first[name] + math.prod(shape)),
            shape,
            S.Core.__annotations__[name] is S.Integers,
        )
        for name, shape in (shapes | output).items()
        if name in _SEEN
    ]
    return first["degree"], word, offsets, seen


def core(compiled, given: dict, room: int, capacity: int, dense: bool) -> tuple[SimpleNamespace, np.ndarray]:
    """Arrays by name (zero, outputs undefined, besides the `given` ones), and the words of kernels.stiff_state.Core.

    The arrays that are not given belong to the thread: they live until its next run.
    """
    n, q, e = compiled.n, compiled.n_surfaces, compiled.n_events
    zeroed, words, offsets, seen = _layout(n, q, e, capacity, room, compiled.n_hoisted, compiled.n_slots, dense)
    block = getattr(_kept, "block", None)
    if block is None or block.size < words:
        block = np.empty(words)
        if words <= _MOST_KEPT:
            _kept.block = block
    block[:zeroed] = 0.0
    addresses = offsets + block.ctypes.data
    values = {name: array.ctypes.data for name, array in given.items()}
    values |= dict(n=n, q=q, e=e, capacity=capacity, room=room, evals=len(given["t_eval"]),
                   instants=len(given["instant_t"]))  # fmt: skip
    for name, value in values.items():
        addresses[_INDEX[name]] = value
    kinds = block, block.view(np.int64)
    arrays = {name: kinds[whole][part].reshape(shape) for name, part, shape, whole in seen}
    return SimpleNamespace(**given, **arrays, block=block), addresses


_INDEX = {name: i for i, name in enumerate(S.Core._fields)}
