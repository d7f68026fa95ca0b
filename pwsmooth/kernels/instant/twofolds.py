"""Two-folds: points where attracting sliding turns repelling without a fold of the root."""

from ..machine.compiling import kernel
from ..machine.pointers import call_linear
from ..outcome import Outcome
from ..state import AMB_TWO_FOLD, NOTHING, SOLVED
from ..step.recording import record_ambiguity
from ..surface.sliding import keep_on_surface


@kernel
def _state_at(P, C, S, rows, mult_row, s, W):
    """Overwrites S.x and the solved multipliers with the step's polynomials at s."""
    K = C.order
    for i in range(P.n):
        value = rows[i, K]
        for k in range(K - 1, -1, -1):
            value = value * s + rows[i, k]
        S.x[i] = value
    for j in range(P.m):
        if S.status[j] == SOLVED:
            value = rows[mult_row + j, K]
            for k in range(K - 1, -1, -1):
                value = value * s + rows[mult_row + j, k]
            S.mult[j] = value


@kernel
def _alone(P, j):
    """Whether residual j depends on no other multiplier: its own slope then tells its stability."""
    return P.g_row[j + 1] - P.g_row[j] == 1


@kernel
def two_fold(P, C, S, R, t0, rows, mult_row, time_row, s_end, W):
    """Looks whether attracting sliding has turned repelling inside the step without a fold (a two-fold point).

    If so, S is put back to that point and the ambiguity recorded; returns why the loop returns, or -1.
    """
    m = P.m
    if time_row >= 0:
        return NOTHING
    for j in range(m):
        if S.status[j] == SOLVED and P.slope_moves[j]:
            call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
            if W.G[P.g_diagonal[j]] >= 0.0 and _alone(P, j):
                lo, hi = 0.0, s_end
                for _ in range(200):
                    mid = 0.5 * (lo + hi)
                    if mid == lo or mid == hi:
                        break
                    _state_at(P, C, S, rows, mult_row, mid, W)
                    call_linear(P.linear, t0 + mid, S.x, S.mult, P.p, W.G, W.dh)
                    if W.G[P.g_diagonal[j]] < 0.0:
                        lo = mid
                    else:
                        hi = mid
                _state_at(P, C, S, rows, mult_row, hi, W)
                S.t = t0 + hi
                keep_on_surface(P, S, j, W)
                record_ambiguity(S, R, j, AMB_TWO_FOLD, 0)
                return Outcome.AMBIGUITY if C.strict else Outcome.DETERMINACY_LOST
    return NOTHING
