"""What holds of every state that a run comes to: |lambda| <= 1, R >= 0, h = 0 on slides, the side that a status says.

Looked at only with PWSMOOTH_CHECK=1 in the environment, a debugging mode whose units have machine code of their own
(codegen/machine/cache.py): without it the loop has no trace of these looks.
Chain: trajectory.py -> **this file**.
"""

import os

from ..machine.compiling import kernel
from ..state import ALGEBRAIC, COMPONENT, CONTACT, HELD, SLIDING, SOLVED
from ..surface.sliding import surface_size, surface_tolerance
from ..surface.sparse import entry
from .contacts import friction_on
from .surface_rates import evaluate_surfaces

CHECK = os.environ.get("PWSMOOTH_CHECK", "0") not in ("", "0")


@kernel
def broken_by(P, C, S, W):
    """The first multiplier of which something does not hold that must, or -1."""
    evaluate_surfaces(P, S, W)
    force, unknown = 1e-12, 1.0
    for j in range(P.m):
        if P.kind[j] == CONTACT:
            force = max(force, abs(S.mult[j]))
        elif P.kind[j] == ALGEBRAIC:
            unknown = max(unknown, abs(S.mult[j]))
    for j in range(P.m):
        if P.kind[j] == ALGEBRAIC or (P.kind[j] == COMPONENT and S.status[j] != SOLVED):
            continue
        apart = 10.0 * max(C.rtol, 1e-9) * (surface_size(P, S, j, W) + (unknown if P.nested[j] else 0.0))
        apart += 10.0 * surface_tolerance(P, C, W, j)
        if S.status[j] == SOLVED or S.status[j] == HELD:
            holds = abs(W.h[j]) <= apart
            if P.kind[j] == CONTACT:
                own = abs(entry(P.g_row, P.g_col, W.G, j, j))
                holds = holds and own * (S.mult[j] + 1e-6 * force) >= -1e-12 * friction_on(P, W, j)
            else:
                holds = holds and abs(S.mult[j]) <= 1.0 + 1e-6
            # A root that repels is gone along only where that is recorded.
            if P.kind[j] == SLIDING and P.g_row[j + 1] - P.g_row[j] == 1 and S.ambiguities == 0:
                holds = holds and (S.status[j] == HELD or not W.G[P.g_diagonal[j]] > 1e-6 * abs(P.weight[j]))
        else:
            holds = S.status[j] * W.h[j] >= -apart
        if not holds:
            return j
    return -1
