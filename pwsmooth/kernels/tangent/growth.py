"""Growth of deviations along a tape: they are made orthonormal behind every step, before they turn into one direction.

    q_k+1 r_k = F_k q_k,     log|r_k,ii| is kept

F_k is a step with the instant before it. Source: Benettin, Galgani, Giorgilli & Strelcyn, Meccanica 15 (1980) 9-30;
Gram and Schmidt's method, twice, which leaves no more than rounding (Giraud, Langou & Rozloznik, 2005).
"""

import math

import numpy as np
from numba import types

from ..machine.compiling import kernel, unit
from ..machine.pointers import caller
from ..state import TAPE_END, TAPE_STEP, Problem
from .state import Tangent

_GONE = 1e-14  # of what has grown most: what is left of a direction that is taken away is rounding

_call_replay = caller("P, V, count", types.int64)


@unit(types.int64, Problem, Tangent)
def growth(P, V):
    """Carries the frame, the first columns of V.w, over the tape; the entry that has no series, or -1."""
    entries = V.tape.shape[0]
    for k in range(entries):
        if V.tape[k, 0] != TAPE_STEP and V.tape[k, 0] != TAPE_END:
            continue
        if _call_replay(V.replay, P, V, k + 1) >= 0:
            return k
        if V.on_arc:  # its end is not looked at yet, so that V.w still stands at its beginning
            continue
        _orthonormalise(P.n, V.grown.shape[1], V.w, V.grown[V.factors])
        V.grown_t[V.factors] = V.tape_x[min(k + 1, entries - 1), 0]
        V.factors += 1
    return -1


@kernel
def _orthonormalise(n, count, w, log):
    """Makes the columns of w orthonormal, one after the other; overwrites `log` by the logarithms of their lengths."""
    largest = 0.0
    for i in range(n):
        for c in range(count):
            largest = max(largest, abs(w[i, c]))
    for c in range(count):
        size = _straighten(n, c, w)
        log[c] = math.log(size) if size > _GONE * largest else -np.inf
        if size <= _GONE * largest:
            # Nothing is left: another direction goes on, the axis that those before it hold least of.
            for i in range(n):
                w[i, c] = 0.0
            w[_least_held(n, c, w), c] = 1.0
            size = _straighten(n, c, w)
        for i in range(n):
            w[i, c] /= size


@kernel
def _straighten(n, c, w):
    """Takes from column c what lies along the columns before it; its length."""
    for _ in range(2 if c > 0 else 0):
        for b in range(c):
            part = 0.0
            for i in range(n):
                part += w[i, b] * w[i, c]
            for i in range(n):
                w[i, c] -= part * w[i, b]
    size = 0.0
    for i in range(n):
        size += w[i, c] * w[i, c]
    return math.sqrt(size)


@kernel
def _least_held(n, c, w):
    best, least = 0, np.inf
    for i in range(n):
        held = 0.0
        for b in range(c):
            held += w[i, b] * w[i, b]
        if held < least:
            best, least = i, held
    return best
