"""Radau's collocation (Hairer and Wanner 1996, IV.5): a step of slips whose equation is stiff, or has no rate at first.

It never looks at the start of the step, is stable however stiff, and gives the bounded solution of an equation whose
rate is infinite there. W.onset.y holds the states at the nodes: a guess before, the step's after.
Chain: tables.py, surface -> **this file** -> onset.py, which knows where such a step is wanted, and guesses it.
"""

import math

import numpy as np

from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import largest8, load8, splat8, store8, vabs, vmax
from ..machine.pointers import call_fields, call_fields8, call_linear, call_newton, powers8, sum8
from ..state import DISC, SOLVED
from ..surface.sliding import mask_solved
from ..surface.sparse import invert_dense, solve_inverted
from .tables import STAGES

_LEGENDRE = np.polynomial.legendre
_SWEEPS = 24
_DAMPED = 0.7  # of the way: by how much Newton's method changes it at most, lest it turns
_NARROW = 4  # sweeps with the slopes by the surfaces' states alone, and then until new ones do not help
_CHORD = 0.08  # of the change before: by less a sweep serves with the slopes that it has
_ALIKE = 1e-8  # of the way since the start: what Newton's method is content with where it comes no nearer
_CHANGED = 1e-13  # of that way, and 0.1 of rtol: what Newton's method would still change, at its pace
_HELD = 1e-10  # of the multipliers of other sticks: roundings of a direction are no less
_ROUNDING, _BLURRED = 1e-15, 1e-3  # of the states, and of a rate: what roundings may make of it
DEFECT = 10.0  # tolerances: that of the polynomial, whose order is half of that of the step's end


def _radau():
    """Nodes in (0, 1] of Radau's quadrature with STAGES points, and integrals of their Lagrange polynomials to each."""
    radau = np.zeros(STAGES + 1)
    radau[-2:] = -1.0, 1.0
    nodes = np.sort(_LEGENDRE.legroots(radau))
    slope = _LEGENDRE.legder(radau)
    for _ in range(3):
        nodes -= _LEGENDRE.legval(nodes, radau) / _LEGENDRE.legval(nodes, slope)
    nodes[-1] = 1.0
    values = _LEGENDRE.legvander(nodes, STAGES - 1)
    integrals = (
        np.array([_LEGENDRE.legval(nodes, _LEGENDRE.legint(row, lbnd=-1)) for row in np.eye(STAGES)]).T / 2
    )
    # Coefficients in theta = (nodes + 1)/2 of the Lagrange polynomials, by columns.
    powers = np.array(
        [
            np.polynomial.Polynomial(_LEGENDRE.leg2poly(row))(np.polynomial.Polynomial([-1, 2])).coef
            if row[0] != 1
            else np.eye(STAGES)[0]
            for row in np.eye(STAGES)
        ],
        dtype=object,
    )
    table = np.zeros((STAGES, STAGES))
    for i, coefficients in enumerate(powers):
        table[: len(coefficients), i] = coefficients
    inverse = np.linalg.inv(values)
    return (nodes + 1) / 2, integrals @ inverse, table @ inverse


NODES, WEIGHTS, LAGRANGE = _radau()
# By columns: integrals, rates and coefficients from values at the nodes; and what integrates a power.
_COLUMNS, _RATES, _LAGRANGE = WEIGHTS.T.copy(), np.linalg.inv(WEIGHTS).T.copy(), LAGRANGE.T.copy()
_SHARES = 1.0 / np.arange(1.0, STAGES + 1)
_BETWEEN = 0.5 * (NODES[-1] + NODES[-2])


@kernel
def rates(P, S, W, t):
    """Overwrites W.dx, W.h, W.g with what the model gives at S.x; False where solved multipliers have no solution."""
    keep, found = S.t, True
    S.t = t
    if W.onset.solves:
        mask_solved(P, S, W)
        found = call_newton(P.newton_unit, P, S, W) != 0
    call_fields(P.fields, t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    S.t = keep
    return found


@kernel
def rates_at_nodes(P, S, W, t, h, y, k):
    """Overwrites k, onset.surfaces and onset.residuals with what the model gives at the nodes of a step from t, for the
    states y and the multipliers in onset.lam; of these the solved ones, False where they have no solution."""
    onset, keep, found = W.onset, S.t, True
    store8(onset.times, 0, load8(NODES, 0) * h + t)
    mask_solved(P, S, W)
    for q in range(STAGES if onset.solves else 0):
        S.t = onset.times[q]
        for i in range(P.n):
            S.x[i] = y[i, q]
        for j in range(P.m):
            if not W.mask[j]:  # what is solved for is sought from where it was at the node before
                S.mult[j] = onset.lam[j, q]
        found = call_newton(P.newton_unit, P, S, W) != 0 and found
        for j in range(P.m):
            onset.lam[j, q] = S.mult[j]
    S.t = keep
    if P.fields8 != 0:
        call_fields8(P.fields8, onset.times, y, onset.lam, P.p, k, onset.surfaces, onset.residuals)
        return found
    x, mult = W.step.x, W.step.mult
    for q in range(STAGES):
        for i in range(P.n):
            x[i] = y[i, q]
        for j in range(P.m):
            mult[j] = onset.lam[j, q]
        call_fields(P.fields, onset.times[q], x, mult, P.p, W.dx, W.h, W.g)
        for i in range(P.n):
            k[i, q] = W.dx[i]
        for i in range(P.m + P.ne):
            onset.surfaces[i, q] = W.h[i]
        for j in range(P.m):
            onset.residuals[j, q] = W.g[j]
    return found


@inlined_kernel
def _combined(columns, values):
    """The sum of the columns, each times its value, as a vector."""
    total = load8(columns[0], 0) * values[0]
    for s in range(1, STAGES):
        total = total + load8(columns[s], 0) * values[s]
    return total


@kernel
def integrate(W, h, rates):
    """Overwrites onset.sums by the integrals up to the nodes of what has these values there."""
    store8(W.onset.sums, 0, _combined(_COLUMNS, rates) * h)


@kernel
def _nudge(P, W, q, i, reach):
    """A change of state i that moves no slipping surface by more than a small part of what it is at node q."""
    nudge = 1e-7 * (reach + abs(W.onset.y[i, q] - W.onset.x[i])) + 1e-300
    for j in range(P.m):
        if P.disc_of[j] >= 0 and W.onset.slips[P.disc_of[j]]:
            for e in range(P.dh_row[j], P.dh_row[j + 1]):
                if P.dh_col[e] == i and W.dh[e] != 0.0:
                    size, slope = W.onset.size[P.disc_of[j]], abs(W.dh[e])
                    # A surface that is no state is known to the rounding of what it is made of.
                    rounding = 0.0 if P.surface_state[j] >= 0 else 1e-16 * slope * abs(W.onset.y[i, q])
                    nudge = min(nudge, max(1e-6 * size, math.sqrt(rounding * size)) / slope)
    return nudge


@kernel
def _slopes(P, S, W, t, h):
    """Overwrites onset.slope, the derivatives by the states in onset.columns of what rates_at_nodes has just left."""
    onset, n = W.onset, P.n
    for j in range(P.m):
        onset.slips[j] = 1 if P.kind[j] == DISC and S.status[j] == 1 else 0
    for q in range(STAGES):
        reach = 0.0
        for i in range(n):
            S.x[i] = onset.y[i, q]
            reach = max(reach, abs(onset.y[i, q] - onset.x[i]))
        for j in range(P.m):
            S.mult[j] = onset.lam[j, q]
            if onset.slips[j]:
                onset.size[j] = math.sqrt(onset.surfaces[j, q])
        call_linear(P.linear, onset.times[q], S.x, S.mult, P.p, W.G, W.dh)
        for c in range(onset.narrow):
            i = onset.columns[c]
            nudge = _nudge(P, W, q, i, reach)
            moved = (S.x[i] + nudge) - S.x[i]
            onset.nudge[c, q] = moved if moved != 0.0 else 4e-16 * abs(S.x[i])
    for c in range(onset.narrow):
        i = onset.columns[c]
        keep = load8(onset.y[i], 0)
        store8(onset.y[i], 0, keep + load8(onset.nudge[c], 0))
        rates_at_nodes(P, S, W, t, h, onset.y, onset.change)
        store8(onset.y[i], 0, keep)
        for r in range(n):
            change = load8(onset.change[r], 0) - load8(onset.k[r], 0)
            store8(onset.slope[r, c], 0, change / load8(onset.nudge[c], 0))


@kernel
def _choose_columns(P, S, W, all_of_them):
    """Overwrites onset.columns: the states of slipping surfaces, by which the rates are stiff, or all states."""
    onset = W.onset
    onset.narrow = 0
    for i in range(P.n):
        takes = all_of_them
        for j in range(P.m):
            if P.disc_of[j] >= 0 and S.status[P.disc_of[j]] == 1:
                for e in range(P.dh_row[j], P.dh_row[j + 1]):
                    takes = takes or P.dh_col[e] == i
        if takes:
            onset.columns[onset.narrow] = i
            onset.narrow += 1


@kernel
def _invert(P, W, h):
    """Inverts the matrix of Newton's method for the states in onset.columns; False if it is singular."""
    onset, A, width = W.onset, W.onset.matrix, W.onset.narrow
    for c in range(width):
        for s in range(STAGES):
            column = A[c * STAGES + s]
            for r in range(width):
                store8(column, r * STAGES, load8(_COLUMNS[s], 0) * (-h * onset.slope[onset.columns[r], c, s]))
            column[c * STAGES + s] += 1.0
    return invert_dense(A, onset.rest, STAGES * width)


@kernel
def _newton_step(P, W, h):
    """Overwrites onset.change by a step of Newton's method: of the states in onset.columns, and what the others make of
    it."""
    onset, n, width = W.onset, P.n, W.onset.narrow
    for r in range(n):
        way = load8(onset.y[r], 0) - splat8(onset.x[r])
        store8(onset.change[r], 0, _combined(_COLUMNS, onset.k[r]) * h - way)
    for c in range(width):
        store8(onset.rest, c * STAGES, load8(onset.change[onset.columns[c]], 0))
    solve_inverted(onset.matrix, STAGES * width, onset.rest, onset.found)
    for r in range(n):
        rest = splat8(0.0)
        for c in range(width):
            rest = rest + load8(onset.slope[r, c], 0) * load8(onset.found, c * STAGES)
        store8(onset.rest, 0, rest)
        store8(onset.change[r], 0, load8(onset.change[r], 0) + _combined(_COLUMNS, onset.rest) * h)
    # Of their own states what has been solved for, to the last bit.
    for c in range(width):
        store8(onset.change[onset.columns[c]], 0, load8(onset.found, c * STAGES))


@kernel
def _rate_rounding(W, i):
    """What roundings of the states make of rate i at the end of the step, at most a small part of it: h/|h| of a slip
    that has hardly begun."""
    onset, total = W.onset, 0.0
    for c in range(onset.narrow):
        total += abs(onset.slope[i, c, STAGES - 1] * onset.y[onset.columns[c], STAGES - 1])
    return min(_ROUNDING * total, _BLURRED * abs(onset.k[i, STAGES - 1]))


@kernel
def solve(P, C, S, W, t, h):
    """Newton's method for the states at the nodes, with slopes anew where it is slow; whether it converges."""
    onset, n = W.onset, P.n
    before, anew, fresh = math.inf, True, False
    for j in range(P.m):
        store8(onset.lam[j], 0, splat8(S.mult[j]))
    _choose_columns(P, S, W, False)
    for sweep in range(_SWEEPS):
        if sweep >= _NARROW and anew and fresh and onset.narrow < n:
            _choose_columns(P, S, W, True)
        fresh = anew
        if not rates_at_nodes(P, S, W, t, h, onset.y, onset.k):
            return False
        total = 0.0
        for i in range(n):
            total += sum8(load8(onset.k[i], 0))
        if not abs(total) < math.inf:
            return False
        if anew:
            _slopes(P, S, W, t, h)
            if not _invert(P, W, h):
                return False
        _newton_step(P, W, h)
        worst, total = splat8(0.0), splat8(0.0)
        for i in range(n):
            step, y, known = load8(onset.change[i], 0), load8(onset.y[i], 0), h * _rate_rounding(W, i)
            # Beside the way since the start: of a slip that has just begun its own size is what matters.
            if onset.still[i] == 0:
                way = vabs(y - splat8(onset.x[i])) + 10.0 * C.atol[i]
                worst = vmax(worst, (vabs(step) - vabs(y) * 4e-15 - splat8(known)) / way)
            total = total + step
        change, total = largest8(worst), sum8(total)
        share = min(1.0, _DAMPED / change) if anew else 1.0
        for i in range(n):
            store8(onset.y[i], 0, load8(onset.y[i], 0) + load8(onset.change[i], 0) * share)
        if not abs(total) < math.inf or (anew and sweep > 12 and change > before):
            return False
        pace = min(1.0, change / before) if sweep > 0 else 1.0
        if change * pace <= max(_CHANGED, 0.1 * C.rtol) or (sweep > 2 and change <= _ALIKE and pace > 0.5):
            return True
        anew = change > _CHORD * before
        before = change
    return before <= _ALIKE


@kernel
def polynomials(P, S, W, h):
    """Overwrites step.rows: states, multipliers, surfaces in powers of the time since the start."""
    onset, n, m, rows = W.onset, P.n, P.m, W.step.rows
    for r in range(n + 2 * m + P.ne):
        for c in range(rows.shape[1]):
            rows[r, c] = 0.0
    scale = powers8(1.0 / h)
    for i in range(n):
        # Rates from the states: the model's own know h/|h| of a slip that has just begun to a rounding over |h| only.
        for q in range(STAGES):
            onset.rest[q] = onset.y[i, q] - onset.x[i]
        store8(onset.k[i], 0, _combined(_RATES, onset.rest) * (1.0 / h))
        for q in range(STAGES):
            onset.rest[q] = onset.k[i, q] - onset.first[i]
        rows[i, 0] = onset.x[i]
        store8(rows[i], 1, _combined(_LAGRANGE, onset.rest) * load8(_SHARES, 0) * scale)
        rows[i, 1] += onset.first[i]
    for j in range(m):
        rows[n + j, 0] = onset.mult[j]
    for i in range(m + P.ne):
        rows[n + m + i, 0] = onset.level[i]
    # Of what is no state the values at the nodes, less that at the start, over the time since: one order less.
    rates_at_nodes(P, S, W, S.t, h, onset.y, onset.change)
    for r in range(2 * m + P.ne):
        now = load8(onset.lam[r], 0) if r < m else load8(onset.surfaces[r - m], 0)
        store8(onset.rest, 0, (now - splat8(rows[n + r, 0])) / (load8(NODES, 0) * h))
        store8(rows[n + r], 1, _combined(_LAGRANGE, onset.rest) * scale)


@kernel
def _loss_by_turning(P, W, i):
    """What the errors in onset.change make of rate i by turning slips: of a friction a half of the angle's square."""
    onset, loss = W.onset, 0.0
    for j in range(P.m):
        if P.kind[j] != DISC or not onset.slips[j]:
            continue
        square, steepest = 0.0, 0.0
        for k in range(j + 1, j + 1 + P.dim[j]):
            off = 0.0
            for e in range(P.dh_row[k], P.dh_row[k + 1]):
                off += W.dh[e] * onset.change[P.dh_col[e], STAGES - 1]
            square += off * off
        for c in range(onset.narrow):
            steepest = max(steepest, abs(onset.slope[i, c, STAGES - 1]))
        loss += 0.5 * steepest * square / math.sqrt(W.h[j] + 1e-300)
    return loss


@kernel
def misfit(P, C, S, W, h):
    """What the defect of the polynomials between the last two nodes makes of the states, in units of the tolerance: of
    those in onset.columns by Newton's matrix, as a stiff equation leads back what leaves it."""
    onset, rows, n, s, worst = W.onset, W.step.rows, P.n, _BETWEEN * h, 0.0
    for i in range(n):
        value = rows[i, STAGES]
        for c in range(STAGES - 1, -1, -1):
            value = value * s + rows[i, c]
        S.x[i] = value
    if not rates(P, S, W, S.t + s):
        return math.inf
    for i in range(n):
        slope = STAGES * rows[i, STAGES]
        for c in range(STAGES - 1, 0, -1):
            slope = slope * s + c * rows[i, c]
        defect = slope - W.dx[i]
        if not abs(defect) < math.inf:
            return math.inf
        defect = math.copysign(max(abs(defect) - _rate_rounding(W, i), 0.0), defect)
        store8(onset.change[i], 0, load8(NODES, 0) * (h * defect))
    led_back = onset.narrow if onset.goes_on else 0
    for c in range(led_back):
        store8(onset.rest, c * STAGES, load8(onset.change[onset.columns[c]], 0))
    if led_back > 0:
        solve_inverted(onset.matrix, STAGES * led_back, onset.rest, onset.found)
    for c in range(led_back):
        onset.change[onset.columns[c], STAGES - 1] = onset.found[c * STAGES + STAGES - 1]
    for i in range(n):
        scale = C.atol[i] + C.rtol * max(abs(S.x[i]), h * abs(rows[i, 1]))
        off = abs(onset.change[i, STAGES - 1]) + (h * _loss_by_turning(P, W, i) if led_back > 0 else 0.0)
        worst = max(worst, off / (DEFECT * scale))
    # What other sticks hold with decides when they end; that of one body is not unique until its motion says it.
    for j in range(P.m):
        if S.status[j] == SOLVED and W.onset.as_one == 0:
            value = rows[n + j, STAGES]
            for c in range(STAGES - 1, -1, -1):
                value = value * s + rows[n + j, c]
            worst = max(worst, abs(value - S.mult[j]) / (DEFECT * max(C.rtol, _HELD) * (1.0 + abs(value))))
    return worst
