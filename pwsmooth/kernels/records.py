"""Writing what happened into the Record buffers."""

from .compiling import inlined_kernel, kernel
from .state import C_AMBIGUITIES, C_EVENTS, C_POINTS


@inlined_kernel
def record_point(P, S, R):
    i = S.counts[C_POINTS]
    R.t[i] = S.now[0]
    for k in range(P.n):
        R.x[i, k] = S.x[k]
    for j in range(P.m):
        R.mult[i, j] = S.mult[j]
        R.status[i, j] = S.status[j]
    S.counts[C_POINTS] += 1


@kernel
def record_event(S, R, index, kind, came, went):
    i = S.counts[C_EVENTS]
    R.event_t[i] = S.now[0]
    R.event[i, 0] = index
    R.event[i, 1] = kind
    R.event[i, 2] = came
    R.event[i, 3] = went
    S.counts[C_EVENTS] += 1


@kernel
def record_ambiguity(S, R, index, kind, taken):
    i = S.counts[C_AMBIGUITIES]
    R.ambiguity_t[i] = S.now[0]
    R.ambiguity[i, 0] = index
    R.ambiguity[i, 1] = kind
    R.ambiguity[i, 2] = taken
    S.counts[C_AMBIGUITIES] += 1
