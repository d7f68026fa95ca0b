"""The replay of a tape: each step and instant of a run again, forward for deviations, backward for slopes of a cost."""

from numba import types

from ..machine.compiling import unit
from ..state import Problem
from .forward import begin, go_over
from .reverse import pull_back
from .state import Tangent


@unit(types.int64, Problem, Tangent, types.int64)
def replay(P, V, count):
    """Carries the deviations of V over the entries of the tape before `count`, or with V.backward the slopes of a cost
    from its last entry to its first; the entry that has no series, or -1."""
    if V.backward:
        return pull_back(P, V, count)
    if V.read == 0:
        begin(P, V)
    for k in range(V.read, count):
        if not go_over(P, V, k):
            return k
    V.read = count
    return -1
