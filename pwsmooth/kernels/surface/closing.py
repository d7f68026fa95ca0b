"""The last moments of a slip in a disc, where nothing but the direction of slip still changes.

    n' = (1 - n n) G(n),   r' = r n.G(n),   dt = r dtau,   h = r n

with t and x frozen (Antali and Stepan 2018 for limit directions). It comes to rest, at a time and with a mean lambda
that follow, or passes by.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_newton
from .fast import defect, stage_point
from .sliding import INSIDE, mask_instant

_TOLERANCE = 1e-7  # of the direction and, relative, of the time
_CLOSED = 1e-6  # of |h| at the beginning
_STRAIGHT, _BENT = 1e-6, 1e-7  # of the fastest turning, and the square of it beside the speed of approach
_PASSED = 1.5
_STEPS = 2000
_D = 3  # components at most: the state is n, then r, t, and the integral of lambda


@kernel
def _closing_rates(P, S, W, j, y, out, stage):
    """Overwrites out[stage] with the rates at y; leaves G in W.g."""
    d, along, size = P.dim[j], 0.0, 0.0
    for i in range(d):
        size += y[i] ** 2
    size = math.sqrt(size)
    for i in range(d):
        S.mult[j + 1 + i] = y[i] / size
    if W.layer.masked:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(d):
        along += S.mult[j + 1 + i] * W.g[j + 1 + i]
    for i in range(d):
        n = S.mult[j + 1 + i]
        out[stage, i] = W.layer.pace * (W.g[j + 1 + i] - along * n)
        out[stage, _D + 2 + i] = W.layer.pace * y[_D] * n
    out[stage, _D] = W.layer.pace * y[_D] * along
    out[stage, _D + 1] = W.layer.pace * y[_D]
    return along


@kernel
def close(P, S, W, j, size):
    """Time to rest of disc j from |h| = size in the direction in S.mult, where the mean lambda on the way is left.

    Negative where it passes by.
    """
    d, y, new, k = P.dim[j], W.closing_y, W.closing_new, W.closing_k
    W.layer.masked = 1 if mask_instant(P, S, W) else 0
    keep = S.mult[j]
    S.mult[j] = INSIDE
    for i in range(len(y)):
        y[i] = 0.0
        for s in range(7):
            k[s, i] = 0.0
    for i in range(d):
        y[i] = S.mult[j + 1 + i]
    y[_D] = 1.0
    W.layer.pace = 1.0
    _closing_rates(P, S, W, j, y, k, 0)
    fastest = 1e-300
    for i in range(d):
        fastest = max(fastest, abs(W.g[j + 1 + i]))
    W.layer.pace = 1.0 / fastest
    along = _closing_rates(P, S, W, j, y, k, 0)
    step, left, turned = 0.1, -1.0, math.inf
    for _ in range(_STEPS):
        for s in range(1, 7):
            for i in range(len(y)):
                new[i] = stage_point(y, k, s, i, step)
            along = _closing_rates(P, S, W, j, new, k, s)
        error = 0.0
        for i in range(len(y)):
            error = max(error, abs(step * defect(k, i)) / (_TOLERANCE * (y[_D] if i >= _D else 1.0)))
        if not error < math.inf:
            break
        factor = 0.9 * (error + 1e-10) ** -0.2
        if error <= 1.0:
            for i in range(len(y)):
                y[i] = new[i]
                k[0, i] = k[6, i]
            if y[_D] > _PASSED:
                break
            turns = 0.0
            for i in range(d):
                turns = max(turns, abs(k[0, i]))
            # Along a direction that it no longer leaves the rest is a line, which may be long beside the turning.
            straight = turns <= min(turned, _STRAIGHT) and turns * turns <= _BENT * abs(along) * W.layer.pace
            turned = turns
            if (y[_D] < _CLOSED or straight) and along < 0.0:
                rest = y[_D] / abs(along)
                left = y[_D + 1] + rest
                for i in range(d):
                    S.mult[j + 1 + i] = (y[_D + 2 + i] + rest * y[i]) / left
                left *= size
                break
        step *= min(5.0, max(0.2, factor))
    S.mult[j] = keep
    return left
