"""A guess for the next root: the same interval as the last one between these two instants.

A periodic motion meets its surfaces at regular intervals: started there, the search of a root takes one step, and it
need not wait for a first guess. Where the intervals differ the expectation is not followed, and it never decides
anything: the root is the same to rounding.

    rhythm[3 i + status + 1] = interval, how far it was off;   rhythm[-1] = time of the last instant, -
"""

from ..machine.compiling import inlined_kernel, kernel
from ..state import HELD

_REGULAR = 0.02  # of an interval: nearer than what the coefficients of the polynomial tell


@inlined_kernel
def expected(W, i, status, t, h):
    """Where in the step from t to t + h surface i is expected to be met; 0 for no expectation."""
    rhythm, row = W.meeting.rhythm, 3 * i + status + 1
    if status == HELD or not rhythm[row, 1] <= _REGULAR * rhythm[row, 0]:
        return 0.0
    return (rhythm[rhythm.shape[0] - 1, 0] + rhythm[row, 0] - t) / h


@kernel
def note_rhythm(P, S, W, best, t):
    """Takes note of the surfaces that are met at t, an instant."""
    rhythm, last = W.meeting.rhythm, W.meeting.rhythm.shape[0] - 1
    interval = t - rhythm[last, 0]
    for i in range(P.m + P.ne):
        if W.meeting.tau[i] == best:
            status = S.status[i] if i < P.m else S.side[i - P.m]
            if status != HELD:
                row = 3 * i + status + 1
                rhythm[row, 1] = abs(interval - rhythm[row, 0])
                rhythm[row, 0] = interval
    rhythm[last, 0] = t


@kernel
def forget_rhythm(S, W):
    """Before the first step of a run."""
    W.meeting.rhythm[:, 0] = 0.0
    W.meeting.rhythm[:, 1] = 1.0
    W.meeting.rhythm[W.meeting.rhythm.shape[0] - 1, 0] = S.t
