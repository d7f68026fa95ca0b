"""Ensembles of a diffusion: one trajectory after the other through the same bundles, of which only snapshots stay."""

import math

from numba import types

from ..fresh import restart_counts
from ..intervals import forget_intervals
from ..machine.compiling import unit
from ..machine.pointers import caller
from ..outcome import Outcome
from ..state import Control, Problem, Record, State
from ..work import Work
from .state import Diffused

# diffuse
call_diffuse = caller("P, C, S, R, W, N", types.int64)


@unit(types.int64, types.int64, types.int64, types.int64, Problem, Control, State, Record, Work, Diffused)
def diffuse_many(address, first, stop, P, C, S, R, W, N):
    """Trajectories first..stop-1 of an ensemble; overwrites the rows of N.snapshots, N.ends and N.codes. Returns 0."""
    n, interval = P.n, N.interval
    t0 = N.starts[0, n]
    end = N.last
    base = N.trajectory
    for row in range(first, stop):
        N.trajectory = base + row
        N.interval = interval
        own = row if N.starts.shape[0] > 1 else 0
        for i in range(n):
            S.x[i] = N.starts[own, i]
        S.t = t0
        S.deflate[:] = 0
        restart_counts(S)
        for j in range(P.m):
            forget_intervals(S.last[j], t0)
        code, taken = Outcome.FINISHED, 0
        while taken <= len(N.grid) and code == Outcome.FINISHED:
            N.last = N.grid[taken] if taken < len(N.grid) else end
            code = Outcome.OUT_OF_MEMORY
            while code == Outcome.OUT_OF_MEMORY:
                code = call_diffuse(address, P, C, S, R, W, N)
                S.points = S.events = S.ambiguities = 0
            if taken < len(N.grid):
                for i in range(n):
                    N.snapshots[row, taken, i] = S.x[i] if code == Outcome.FINISHED else math.nan
            taken += 1
        while taken < len(N.grid):
            for i in range(n):
                N.snapshots[row, taken, i] = math.nan
            taken += 1
        N.ends[row, 0] = S.t
        for i in range(n):
            N.ends[row, 1 + i] = S.x[i]
        N.codes[row, 0] = code
        N.codes[row, 1] = S.steps
    N.trajectory = base
    N.interval = interval
    N.last = end
    return 0
