"""Unknowns of every instant together with the sides of the switches whose surfaces they stand in.

    g(a, lambda) = 0,   lambda_j = sign h_j(a)

Newton's method on a function that bends (Qi & Sun 1993, semismooth): each step takes the branches in force where it
stands, and is halved where the residual grows. A switch that is turned to and fro jumps there: its surface is the root.
Where it finds none, every choice of the sides is tried. Of a root the sides are those of its own surfaces.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_linear, call_newton
from ..state import CONTACT, HELD, SLIDING, SOLVED
from .sliding import surface_rounding, surface_size
from .sparse import solve_masked

_SWEEPS, _HALVINGS = 60, 30
_TURNS = 4  # of a switch to and fro, before its surface is taken for the root
_WRONG_SIDE = 1e-9  # of the size of a surface: so far on the other side it is not on the one in force
_MOST_SIDES = 8  # switches whose sides are tried: 256 choices
_APART = 1e-9  # of a multiplier: two roots
_OFF = 1e-3  # from where a slope is infinite


@kernel
def _defect(P, S, W, turned):
    """Largest masked residual with the sides in force at S.mult; counts in instant.came the switches that `turned`."""
    for _ in range(P.m):
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        changed = False
        for j in range(P.m):
            if P.nested[j] == 0 or P.kind[j] >= CONTACT or S.status[j] == SOLVED or S.status[j] == HELD:
                continue
            side = 1 if W.h[j] >= 0.0 else -1
            if side != S.status[j]:
                call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
                if abs(W.h[j]) <= surface_rounding(P, S, j, W):
                    continue  # it stands on its surface, whatever the unknowns are
                W.instant.came[j] += turned
                S.status[j], S.mult[j], changed = side, float(side), True
        if not changed:
            break
    worst = 0.0
    for j in range(P.m):
        if W.mask[j]:
            worst = max(worst, abs(W.g[j])) if W.g[j] == W.g[j] else math.inf
    return worst


@kernel
def _turns(P, S, j):
    """Whether switch j takes its side from multipliers that are solved for."""
    return P.nested[j] != 0 and P.kind[j] < CONTACT and S.status[j] != SOLVED and S.status[j] != HELD


@kernel
def _holds(P, S, W):
    """Solves for the masked multipliers with the sides in force; whether a root stands on these sides."""
    if call_newton(P.newton_unit, P, S, W) == 0:
        return False
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for j in range(P.m):
        if not _turns(P, S, j):
            continue
        size = surface_size(P, S, j, W)
        for e in range(P.g_row[j], P.g_row[j + 1]):
            size += abs(W.G[e] * S.mult[P.g_col[e]])
        if S.status[j] * W.h[j] < -_WRONG_SIDE * size:
            return False
    return True


@kernel
def _next_root(P, S, W, choice):
    """From this choice of sides on, the first at which a root stands, which S then holds; -1 for none."""
    count = 0
    for j in range(P.m):
        count += _turns(P, S, j)
    while count <= _MOST_SIDES and choice < 1 << count:
        bit = 0
        for j in range(P.m):
            if _turns(P, S, j):
                S.status[j] = 1 if choice >> bit & 1 else -1
                S.mult[j] = float(S.status[j])
                bit += 1
        if _holds(P, S, W):
            return choice
        choice += 1
    return -1


@kernel
def solve_unknowns(P, S, W):
    """Overwrites S.mult where W.mask is set, and the sides of the switches on these; False if there is no solution."""
    bends = False
    for j in range(P.m):
        W.instant.came[j] = 0
        bends = bends or (P.nested[j] != 0 and P.kind[j] < CONTACT)
    if not bends:
        return call_newton(P.newton_unit, P, S, W) != 0
    defect = _defect(P, S, W, 0)
    for _ in range(_SWEEPS):
        call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
        total = 0.0
        for j in range(P.m):
            W.linear.rhs[j] = -W.g[j]
        solvable = solve_masked(P, W)
        for j in range(P.m):
            # Also where the slope is infinite, as that of a root at 0.
            if not (solvable and abs(W.linear.rhs[j]) < math.inf and (W.linear.rhs[j] != 0.0 or W.g[j] == 0.0)):
                W.linear.rhs[j] = -math.copysign(_OFF, W.g[j])
            W.linear.start[j] = S.mult[j]
            if W.mask[j]:
                total = max(total, abs(W.linear.rhs[j]) / (1.0 + abs(S.mult[j])))
        if defect == 0.0 or (solvable and total <= 1e-13):
            break
        share = 1.0
        for halving in range(_HALVINGS):
            for j in range(P.m):
                if W.mask[j]:
                    S.mult[j] = W.linear.start[j] + share * W.linear.rhs[j]
            new = _defect(P, S, W, 1 if halving == 0 else 0)
            if new < defect or not solvable:
                break
            share *= 0.5
        defect = new
        for j in range(P.m):
            if W.instant.came[j] >= _TURNS and P.kind[j] == SLIDING:
                S.status[j], W.mask[j] = SOLVED, 1
                defect = math.inf
    if _holds(P, S, W):
        return True
    return _next_root(P, S, W, 0) >= 0


@kernel
def has_other_root(P, S, W):
    """Whether the masked multipliers have another root than S.mult, on other sides."""
    mult, status = W.instant.mult, W.instant.came
    for j in range(P.m):
        mult[j], status[j] = S.mult[j], S.status[j]
    choice, other = _next_root(P, S, W, 0), False
    while choice >= 0 and not other:
        for j in range(P.m):
            other = other or (W.mask[j] != 0 and abs(S.mult[j] - mult[j]) > _APART * (1.0 + abs(mult[j])))
        choice = _next_root(P, S, W, choice + 1)
    for j in range(P.m):
        S.mult[j], S.status[j] = mult[j], status[j]
    return other
