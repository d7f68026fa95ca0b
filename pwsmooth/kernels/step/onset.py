"""A collocation step of a slip in a disc: the first one from rest, where its direction is 0/0, and stiff ones.

At h = 0 the field of slip, with lambda = h/|h|, has no value. Where the force has just left the friction circle the
slip begins as h ~ p t^2/2, and its direction is that of a stiff equation whose rate is infinite at t = 0: it has one
bounded solution, the series of which diverges. Radau's collocation (Hairer and Wanner 1996, IV.5) never looks at t = 0,
is stable however stiff, and gives that solution. Where the slip begins with an acceleration it does as well; and where
a slow slip follows a force that hardly exceeds the friction, and explicit steps would be as short as |h|.
"""

import math

import numpy as np
from numba import types

from ..intervals import time_size
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_fields, call_linear, call_newton
from ..state import DISC, SOLVED, START, Control, Problem, State
from ..surface.dependent import gather_leaving, load_of_leaving, pace_of_leaving
from ..surface.sliding import INSIDE, mask_solved, put_in_slip
from ..surface.sparse import factor_dense, solve_dense, solve_factored
from ..surface.vector import begins, push_of_disc, slopes_of_disc
from ..work import Work
from .tables import STAGES

_LEGENDRE = np.polynomial.legendre
_TRIES, _SWEEPS, _PICARD = 40, 24, 3
_SAME_EXCESS = 0.02  # of the force over the friction: a first guess is good enough when it changes by less
_NARROW = 4  # sweeps with the slopes by the surfaces' states alone
_DAMPED = 0.7  # of the way: by how much Newton's method changes it at most, lest it turns
_PROJECTIONS = 50  # of several discs, one after the other
_CHORD = 0.05  # of the change before: by less a sweep serves with the slopes that it has
# Of 1/(d|lambda|/dt), at rtol = 1e-12 and at most: at once as far as the polynomials of one step tell what happens, as
# the series of the direction converge the faster the later they begin.
_STIFF, _STIFFEST = 1.0 / 11.0, 0.25
_AHEAD = 1e-3  # of the longest step: where it is looked at how fast lambda passes its bound
_AT_REST = 1e-7  # of the accelerations: a slip that begins with less begins with none
_ALIKE = 1e-8  # of the way since the start: what Newton's method is content with where it comes no nearer
_CHANGED = 1e-12  # of that way: the last change of Newton's method
_LEFT = 0.1  # of |h|, that a first guess keeps
_HELD = 1e-10  # of the multipliers of other sticks: roundings of a direction are no less
_ALL_BUT_FITS = 1e3  # such a misfit is of a step that was only too long
_ROUNDING, _BLURRED = 1e-15, 1e-3  # of the states, and of a rate: what roundings may make of it
_DEFECT = 10.0  # tolerances: that of the polynomial, whose order is half of that of the step's end


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
_COLUMNS = WEIGHTS.T.copy()
_RATES = np.linalg.inv(WEIGHTS)
_BETWEEN = 0.5 * (NODES[-1] + NODES[-2])


@kernel
def _rates(P, S, W, t):
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
def _go_along(P, S, W, t, tau):
    """Puts S where the rates of the start lead in the time tau."""
    for i in range(P.n):
        S.x[i] = W.onset.x[i] + tau * W.onset.first[i]
    S.t = t + tau


@kernel
def _slaved(P, S, W, j):
    """Whether disc j slips in the direction that its force says: slowly, or from rest."""
    if W.onset.goes_on:
        return W.onset.slow[j] != 0
    return W.onset.rests and begins(P, S, j) and W.onset.forced[j] != 0


@kernel
def _stand(P, S, W, q, t):
    """Puts S at node q, with the lambda that would hold in slips that the force leads; returns its excess over 1."""
    excess = 0.0
    for i in range(P.n):
        S.x[i] = W.onset.y[q, i]
    S.t = t
    for j in range(P.m):
        if _slaved(P, S, W, j):
            excess += _follow_force(P, S, W, j)
    return excess


@kernel
def _integrate(W, h, rates):
    """Overwrites onset.sums by the integrals up to the nodes of what has these values there."""
    sums = W.onset.sums
    for q in range(STAGES):
        sums[q] = 0.0
    for s in range(STAGES):
        rate = h * rates[s]
        for q in range(STAGES):  # by lanes
            sums[q] += rate * _COLUMNS[s, q]


@kernel
def _guess_path(P, S, W, h):
    """Overwrites onset.y with the motion by the lambda that all but holds, to the fourth order in h (Picard) where that
    matters: what it slips is as little as the force is more, and its own direction does not stand out from less."""
    onset, n, t0, excess = W.onset, P.n, S.t, math.inf
    for q in range(STAGES):
        for i in range(n):
            onset.y[q, i] = onset.x[i] + NODES[q] * h * onset.first[i]
    for _ in range(_PICARD):
        before = excess
        for q in range(STAGES):
            excess = _stand(P, S, W, q, t0 + NODES[q] * h)
            _rates(P, S, W, S.t)
            for i in range(n):
                onset.k[q, i] = W.dx[i]
        for i in range(n):
            _integrate(W, h, onset.k[:, i])
            for q in range(STAGES):
                onset.y[q, i] = onset.x[i] + onset.sums[q]
        if abs(excess - before) <= _SAME_EXCESS * abs(excess):
            break
    S.t = t0


@kernel
def _guess_as_one(P, S, W, h):
    """Overwrites onset.y, the states at the nodes, by a body that begins to move with several discs at once."""
    onset, group, t0 = W.onset, W.together, S.t
    for q in range(STAGES):
        _go_along(P, S, W, t0, NODES[q] * h)
        onset.rate[q, 0] = pace_of_leaving(P, S, W)
        for j in range(P.m):
            onset.toward[q, j] = group.move[j]
    for q in range(STAGES):
        _go_along(P, S, W, t0, NODES[q] * h)
        way = 0.0
        for r in range(STAGES):
            way += h * WEIGHTS[q, r] * onset.rate[r, 0]
        for j in range(P.m):
            onset.goal[j] = onset.toward[q, j]
        for _ in range(_PROJECTIONS):  # none of these surfaces can be moved without the others
            for j in range(P.m):
                if begins(P, S, j):
                    put_in_slip(P, S, j, way, onset.goal, W)
                elif P.kind[j] == DISC and S.status[j] == SOLVED:
                    put_in_slip(P, S, j, 0.0, onset.goal, W)
        for i in range(P.n):
            onset.y[q, i] = S.x[i]
    S.t = t0


@kernel
def _guess(P, S, W, h):
    """Overwrites onset.y, the states at the nodes: of that motion, with the slip that its residuals make."""
    onset, t0 = W.onset, S.t
    if onset.as_one:
        if onset.rests:
            _guess_as_one(P, S, W, h)
        else:
            _guess_path(P, S, W, h)
        return
    _guess_path(P, S, W, h)
    for q in range(STAGES):
        _stand(P, S, W, q, t0 + NODES[q] * h)
        for j in range(P.m):
            if _slaved(P, S, W, j) or begins(P, S, j):
                push_of_disc(P, S, W, j)
        for j in range(P.m):
            onset.rate[q, j] = W.g[j]
            onset.toward[q, j] = S.mult[j]
    for q in range(STAGES):
        for i in range(P.n):
            S.x[i] = onset.y[q, i]
        S.t = t0 + NODES[q] * h
        for j in range(P.m):
            if _slaved(P, S, W, j):
                start = math.sqrt(onset.level[j])
                way = start
                for r in range(STAGES):
                    for k in range(j + 1, j + 1 + P.dim[j]):
                        way += h * WEIGHTS[q, r] * onset.toward[r, k] * onset.rate[r, k]
                for k in range(j + 1, j + 1 + P.dim[j]):
                    onset.goal[k] = onset.toward[q, k]
                put_in_slip(P, S, j, max(abs(way) if start == 0.0 else way, _LEFT * start), onset.goal, W)
            elif begins(P, S, j):
                for k in range(j + 1, j + 1 + P.dim[j]):
                    onset.goal[k] = 0.0
                    for r in range(STAGES):
                        onset.goal[k] += h * WEIGHTS[q, r] * onset.rate[r, k]
                put_in_slip(P, S, j, 1.0, onset.goal, W)
        for i in range(P.n):
            onset.y[q, i] = S.x[i]
    S.t = t0


@kernel
def _follow_force(P, S, W, j):
    """Leaves in S.mult the direction of the lambda that would hold disc j; returns its excess over 1."""
    d, A, size = P.dim[j], W.disc, 0.0
    if W.onset.solves or P.hidden[j + 1]:
        for k in range(P.m):
            W.mask[k] = 1 if S.status[k] == SOLVED or P.disc_of[k] == j else 0
        call_newton(P.newton_unit, P, S, W)
    else:
        slopes_of_disc(P, S, W, j)
        push_of_disc(P, S, W, j)
        for r in range(d):
            A[r, d] = -W.g[j + 1 + r]
        if solve_dense(A, d, 1):
            for r in range(d):
                S.mult[j + 1 + r] += A[r, d]
    for k in range(j + 1, j + 1 + P.dim[j]):
        size += S.mult[k] ** 2
    size = math.sqrt(size)
    for k in range(j + 1, j + 1 + P.dim[j]):
        S.mult[k] /= size
    return size - 1.0


@kernel
def _nudge(P, W, q, i, reach):
    """A change of state i that moves no slipping surface by more than a small part of what it is at node q."""
    nudge = 1e-7 * (reach + abs(W.onset.y[q, i] - W.onset.x[i])) + 1e-300
    for j in range(P.m):
        if P.disc_of[j] >= 0 and W.onset.slips[P.disc_of[j]]:
            for e in range(P.dh_row[j], P.dh_row[j + 1]):
                if P.dh_col[e] == i and W.dh[e] != 0.0:
                    size, slope = W.onset.size[P.disc_of[j]], abs(W.dh[e])
                    # A surface that is no state is known to the rounding of what it is made of.
                    rounding = 0.0 if P.surface_state[j] >= 0 else 1e-16 * slope * abs(W.onset.y[q, i])
                    nudge = min(nudge, max(1e-6 * size, math.sqrt(rounding * size)) / slope)
    return nudge


@kernel
def _stage(P, S, W, q, t):
    """Overwrites onset.k[q], the rates at node q; False if none."""
    onset = W.onset
    for i in range(P.n):
        S.x[i] = onset.y[q, i]
    found = _rates(P, S, W, t)
    for i in range(P.n):
        onset.k[q, i] = W.dx[i]
        found = found and abs(W.dx[i]) < math.inf
    return found


@kernel
def _slopes(P, S, W, q, t):
    """Overwrites onset.slope[q], the derivatives by the states in onset.columns of what _stage has just left."""
    onset, n, reach = W.onset, P.n, 0.0
    for i in range(n):
        reach = max(reach, abs(onset.y[q, i] - onset.x[i]))
    for j in range(P.m):
        onset.slips[j] = 0
        if P.kind[j] == DISC and S.status[j] == 1:
            onset.slips[j] = 1
            onset.size[j] = math.sqrt(W.h[j])
    call_linear(P.linear, t, S.x, S.mult, P.p, W.G, W.dh)
    for c in range(onset.narrow):
        i = onset.columns[c]
        nudge, keep = _nudge(P, W, q, i, reach), S.x[i]
        S.x[i] = keep + nudge
        moved = S.x[i] - keep
        if moved == 0.0:
            moved = 4e-16 * abs(keep)
            S.x[i] = keep + moved
        _rates(P, S, W, t)
        for r in range(n):
            onset.slope[q, r, c] = (W.dx[r] - onset.k[q, r]) / moved
        S.x[i] = keep


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
def _factor(P, W, h):
    """Factors the matrix of Newton's method for the states in onset.columns; False if it is singular."""
    onset, A, width = W.onset, W.onset.matrix, W.onset.narrow
    for q in range(STAGES):
        for r in range(width):
            row = q * width + r
            for s in range(STAGES):
                for c in range(width):
                    A[row, s * width + c] = -h * WEIGHTS[q, s] * onset.slope[s, onset.columns[r], c]
            A[row, row] += 1.0
    return factor_dense(A, STAGES * width)


@kernel
def _newton_step(P, W, h):
    """Overwrites onset.change by a step of Newton's method: of the states in onset.columns, and what the others make of
    it."""
    onset, n, width = W.onset, P.n, W.onset.narrow
    for r in range(n):
        _integrate(W, h, onset.k[:, r])
        for q in range(STAGES):
            onset.change[r, q] = onset.x[r] - onset.y[q, r] + onset.sums[q]
    for c in range(width):
        for q in range(STAGES):
            onset.rest[q * width + c] = onset.change[onset.columns[c], q]
    solve_factored(onset.matrix, STAGES * width, onset.rest, onset.found)
    for r in range(n):
        for s in range(STAGES):
            onset.rest[s] = 0.0
            for c in range(width):
                onset.rest[s] += onset.slope[s, r, c] * onset.found[s * width + c]
        _integrate(W, h, onset.rest)
        for q in range(STAGES):
            onset.change[r, q] += onset.sums[q]
    # Of their own states what has been solved for, to the last bit.
    for c in range(width):
        for q in range(STAGES):
            onset.change[onset.columns[c], q] = onset.found[q * width + c]


@kernel
def _rate_rounding(W, i):
    """What roundings of the states make of rate i at the end of the step, at most a small part of it: h/|h| of a slip
    that has hardly begun."""
    onset, total = W.onset, 0.0
    for c in range(onset.narrow):
        total += abs(onset.slope[STAGES - 1, i, c] * onset.y[STAGES - 1, onset.columns[c]])
    return min(_ROUNDING * total, _BLURRED * abs(onset.k[STAGES - 1, i]))


@kernel
def _solve(P, C, S, W, t, h):
    """Newton's method for the states at the nodes, with slopes anew where it is slow; whether it converges."""
    onset, n = W.onset, P.n
    before, anew = math.inf, True
    _choose_columns(P, S, W, False)
    for sweep in range(_SWEEPS):
        if sweep == _NARROW and anew:
            _choose_columns(P, S, W, True)
        for q in range(STAGES):
            if not _stage(P, S, W, q, t + NODES[q] * h):
                return False
            if anew:
                _slopes(P, S, W, q, t + NODES[q] * h)
        if anew and not _factor(P, W, h):
            return False
        _newton_step(P, W, h)
        change, total = 0.0, 0.0
        for i in range(n):
            known = h * _rate_rounding(W, i)
            for q in range(STAGES):
                step = onset.change[i, q]
                # Beside the way since the start: of a slip that has just begun its own size is what matters.
                way = abs(onset.y[q, i] - onset.x[i]) + 10.0 * C.atol[i]
                if onset.still[i] == 0:
                    change = max(change, (abs(step) - 4e-15 * abs(onset.y[q, i]) - known) / way)
                total += step
        share = min(1.0, _DAMPED / change) if anew else 1.0
        for q in range(STAGES):
            for i in range(n):
                onset.y[q, i] += share * onset.change[i, q]
        if not abs(total) < math.inf or (anew and sweep > 12 and change > before):
            return False
        if change <= max(_CHANGED, 1e-2 * C.rtol) or (sweep > 2 and change <= _ALIKE and change > 0.5 * before):
            return True
        anew = change > _CHORD * before
        before = change
    return before <= _ALIKE


@kernel
def _polynomials(P, S, W, h):
    """Overwrites step.rows: states, multipliers, surfaces in powers of the time since the start."""
    onset, n, m, rows = W.onset, P.n, P.m, W.step.rows
    for r in range(n + 2 * m + P.ne):
        for c in range(rows.shape[1]):
            rows[r, c] = 0.0
    # Rates from the states: the model's own know h/|h| of a slip that has just begun to a rounding over |h| only.
    for q in range(STAGES):
        for i in range(n):
            onset.k[q, i] = 0.0
            for s in range(STAGES):
                onset.k[q, i] += _RATES[q, s] * (onset.y[s, i] - onset.x[i]) / h
    for i in range(n):
        rows[i, 0], rows[i, 1] = onset.x[i], onset.first[i]
        scale = 1.0
        for c in range(STAGES):
            total = 0.0
            for q in range(STAGES):
                total += LAGRANGE[c, q] * (onset.k[q, i] - onset.first[i])
            rows[i, c + 1] += total * scale / (c + 1)
            scale /= h
    for j in range(m):
        rows[n + j, 0] = onset.mult[j]
    for i in range(m + P.ne):
        rows[n + m + i, 0] = onset.level[i]
    # Of what is no state the values at the nodes, less that at the start, over the time since: one order less.
    for q in range(STAGES):
        for i in range(n):
            S.x[i] = onset.y[q, i]
        _rates(P, S, W, S.t + NODES[q] * h)
        for r in range(2 * m + P.ne):
            now = S.mult[r] if r < m else W.h[r - m]
            change = (now - rows[n + r, 0]) / NODES[q]
            scale = 1.0 / h
            for c in range(STAGES):
                rows[n + r, c + 1] += LAGRANGE[c, q] * change * scale
                scale /= h


@kernel
def _misfit(P, C, S, W, h):
    """The defect of the polynomials between the last two nodes, in units of the tolerance."""
    rows, n, s, worst = W.step.rows, P.n, _BETWEEN * h, 0.0
    for i in range(n):
        value = rows[i, STAGES]
        for c in range(STAGES - 1, -1, -1):
            value = value * s + rows[i, c]
        S.x[i] = value
    if not _rates(P, S, W, S.t + s):
        return math.inf
    for i in range(n):
        slope = STAGES * rows[i, STAGES]
        for c in range(STAGES - 1, 0, -1):
            slope = slope * s + c * rows[i, c]
        scale = C.atol[i] + C.rtol * max(abs(S.x[i]), h * abs(rows[i, 1]))
        defect = (abs(slope - W.dx[i]) - _rate_rounding(W, i)) * h / (_DEFECT * scale)
        if not defect < math.inf:
            return math.inf
        worst = max(worst, defect)
    # What other sticks hold with decides when they end; that of one body is not unique until its motion says it.
    for j in range(P.m):
        if S.status[j] == SOLVED and W.onset.as_one == 0:
            value = rows[n + j, STAGES]
            for c in range(STAGES - 1, -1, -1):
                value = value * s + rows[n + j, c]
            worst = max(worst, abs(value - S.mult[j]) / (_DEFECT * max(C.rtol, _HELD) * (1.0 + abs(value))))
    return worst


@kernel
def _guess_by_longer(P, W, h):
    """Overwrites onset.y, the states at the nodes, by the polynomials of a step that was too long."""
    rows = W.step.rows
    for q in range(STAGES):
        for i in range(P.n):
            value = rows[i, STAGES]
            for c in range(STAGES - 1, -1, -1):
                value = value * NODES[q] * h + rows[i, c]
            W.onset.y[q, i] = value


@kernel
def _restore(P, S, W):
    for i in range(P.n):
        S.x[i] = W.onset.x[i]
    for j in range(P.m):
        S.mult[j] = W.onset.mult[j]


@unit(types.float64, Problem, Control, State, Work, types.float64)
def onset(P, C, S, W, longest):
    """Overwrites W.step by the first step of a slip, from W.onset.least to `longest`; returns its length, 0 if none."""
    start, n, t = W.onset, P.n, S.t
    start.solves, start.goes_on = 0, 1
    for i in range(n):
        start.x[i], start.still[i] = S.x[i], 0
    for j in range(P.m):
        start.mult[j] = S.mult[j]
        if S.status[j] == SOLVED:
            start.solves = 1
            if P.surface_state[j] >= 0:
                start.still[P.surface_state[j]] = 1
    call_fields(P.fields, t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(P.m + P.ne):
        start.level[i] = W.h[i]
    for i in range(n):
        start.first[i] = W.dx[i]
    # How the slip begins: with an acceleration, or at rest with a force that goes on to grow.
    size, fastest = 1e-300, 0.0
    for j in range(P.m):
        if begins(P, S, j):
            start.goes_on, start.mult[j] = 0, 1.0
            start.level[j] = 0.0
            slope = slopes_of_disc(P, S, W, j)
            start.forced[j] = 1 if slope > 0.0 else 0
            size, fastest = max(size, slope), max(fastest, push_of_disc(P, S, W, j))
            for k in range(j + 1, j + 1 + P.dim[j]):
                start.level[k] = 0.0
    start.rests = 1 if fastest <= _AT_REST * size else 0
    start.as_one = 1 if not start.goes_on and gather_leaving(P, S, W) else 0
    h = longest
    stiff = min(_STIFFEST, _STIFF * (1e12 * C.rtol) ** (1.0 / 16.0))
    if start.rests and not start.goes_on:
        ahead = _AHEAD * longest
        _go_along(P, S, W, t, ahead)
        excess = load_of_leaving(P, S, W) - 1.0 if start.as_one else 0.0
        for j in range(P.m):
            if begins(P, S, j) and start.forced[j] and not start.as_one:
                excess = max(excess, _follow_force(P, S, W, j))
        if excess > 0.0:
            h = min(h, stiff * ahead / excess)
        S.t = t
    again = False
    for _ in range(_TRIES):
        _restore(P, S, W)
        if again:
            _guess_by_longer(P, W, h)
        else:
            for j in range(P.m):
                if begins(P, S, j) or (start.goes_on and start.slow[j]):
                    S.mult[j] = INSIDE
            _guess(P, S, W, h)
        for j in range(P.m):
            S.mult[j] = start.mult[j]
        misfit = math.inf
        if _solve(P, C, S, W, t, h):
            _polynomials(P, S, W, h)
            misfit = _misfit(P, C, S, W, h)
        _restore(P, S, W)
        if misfit <= 1.0:
            W.step.kind, W.step.mult_row = START, n
            return h
        again = misfit < _ALL_BUT_FITS and not again
        h *= max(0.25, 0.9 * misfit**-0.125) if misfit < math.inf else 0.25
        if h <= max(start.least, 1e-14 * time_size(S)):
            break
    # What is left is a body at rest, where lambda = h/|h| has no value.
    for j in range(P.m):
        if begins(P, S, j):
            S.mult[j] = INSIDE
    return 0.0
