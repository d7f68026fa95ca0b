"""Deviations where a disc comes to rest and where it begins to slip, which have no Taylor series.

Its last moments, dt = r dtau, are those of step/closing.py, with the deviations at one tau of all that moves there.
With a and b for r1 times those of log r and of n (n.b = 0; r1 is where they begin), D for r1 times that of G:

    D = Jb + r1 (G_x dx + G_t dT + G_p q),   a' = b.G + n.D,   b' = D - (b.G + n.D) n - (n.G) b
    dT' = (r/r1) a,   dx' = (r/r1) (f a + f_lambda b + r1 (f_x dx + f_t dT + f_p q)),   J = dG/dlambda

The first step of a slip is Radau's collocation (step/collocation.py); its derivative is a linear one at its nodes.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_fields
from ..state import SOLVED
from ..step.closing import FARTHEST, error_of, next_step
from ..step.collocation import LAGRANGE, NODES, WEIGHTS
from ..step.collocation import STAGES as COLLOCATED
from ..surface.pair import STAGES, errors, stage_point
from ..surface.sparse import solve_dense
from .flow import invert, number_unknowns
from .saltation import look
from .state import F_MULT, F_P, F_X, G_MULT, G_P, G_T, G_X, H_P, H_X

_TOLERANCE, _DIRECTION = 1e-11, 1e-6
_ENDED = -25.0  # of log(r/r1)
_PASSED = 0.5
_STRAIGHT, _STEADY = 1e-9, 1e-6  # of the changes of n and b, and of n.G, while r falls by e: the rest is a line
_STEPS = 20000
_SWEEPS = 12
_NEARBY = 1e-4  # of time, over which rates are differenced
_LOG, _TIME, _X = 3, 4, 5  # places behind n; dT and dx stand at the same behind a and b


@kernel
def _follow(P, V, t, size):
    """Newton's method for the multipliers of V.unknown at V.x, V.mult; leaves the fields in V.rates, g in V.sums, the
    Jacobians in V.jac and the inverse of g_lambda in V.matrix; False where there is none."""
    for _ in range(_SWEEPS):
        call_fields(P.fields, t, V.x, V.mult, P.p, V.rates, V.slopes, V.sums)
        look(P, V, t, V.x, V.mult)
        if size == 0:
            return True
        for r in range(size):
            for c in range(size):
                V.matrix[r, c] = 0.0
        for e in range(V.entries_point.shape[0]):
            i, j = V.entries_point[e, 1], V.entries_point[e, 2]
            if V.entries_point[e, 0] == G_MULT and V.unknown[i] >= 0 and V.unknown[j] >= 0:
                V.matrix[V.unknown[i], V.unknown[j]] = V.jac[e]
        if not invert(V, size):
            return False
        change = 0.0
        for j in range(P.m):
            total, r = 0.0, V.unknown[j]
            for i in range(P.m if r >= 0 else 0):
                if V.unknown[i] >= 0:
                    total -= V.matrix[r, size + V.unknown[i]] * V.sums[i]
            if r >= 0:
                V.mult[j] += total
                change = max(change, abs(total) / (1.0 + abs(V.mult[j])))
        if change <= 1e-14:
            return True
        if not change < math.inf:
            return False
    return False


@kernel
def _changes(P, V, j, size, y):
    """Overwrites V.closing_f, V.closing_g by r1 times the deviations of the rates and of the residuals at y, the others
    of the multipliers solved along."""
    n, columns, r1, entries, seeds = P.n, V.columns, V.closing_size, V.entries_point, V.w.shape[1]
    own = _X + n
    f, g, others = V.closing_f, V.closing_g, V.closing_others
    for c in range(columns):
        for i in range(n):
            f[i, c] = r1 * V.closing_ft[i] * y[own + columns * _TIME + c]
        for i in range(P.m):
            g[i, c] = 0.0
    for turn in range(2):
        for e in range(entries.shape[0]):
            kind, i, k, value = entries[e, 0], entries[e, 1], entries[e, 2], V.jac[e]
            if kind > G_T:
                continue
            row = f[i] if kind < G_X else g[i]
            if turn == 1:
                if (kind == F_MULT or kind == G_MULT) and V.unknown[k] >= 0:
                    for c in range(columns):
                        row[c] += value * others[V.unknown[k], c]
            elif kind == F_X or kind == G_X:
                for c in range(columns):
                    row[c] += r1 * value * y[own + columns * (_X + k) + c]
            elif kind == F_P or kind == G_P:
                for c in range(columns):
                    row[c] += r1 * value * V.seeds[seeds * k + c]
            elif kind == G_T:
                for c in range(columns):
                    row[c] += r1 * value * y[own + columns * _TIME + c]
            elif P.disc_of[k] == j:
                for c in range(columns):
                    row[c] += value * V.closing_b[k - j - 1, c]
        for r in range(size if turn == 0 else 0):
            for c in range(columns):
                others[r, c] = 0.0
            for i in range(P.m):
                if V.unknown[i] >= 0:
                    for c in range(columns):
                        others[r, c] -= V.matrix[r, size + V.unknown[i]] * g[i, c]


@kernel
def _rates(P, V, j, size, y, out, stage):
    """Overwrites out[stage] by the rates of y = (n, log r/r1, t, x, then of all columns a, b, dT, dx); n.G, or nan."""
    n, d, columns, along, length, pace = P.n, P.dim[j], V.columns, 0.0, 0.0, V.closing_pace
    own = _X + n
    for i in range(d):
        length += y[i] ** 2
    length = math.sqrt(length)
    for i in range(d):
        V.mult[j + 1 + i] = y[i] / length
    for i in range(n):
        V.x[i] = V.closing_x[i] + V.closing_size * y[_X + i]
    if not _follow(P, V, V.closing_t + V.closing_size * y[_TIME], size):
        return math.nan
    for c in range(columns):
        out_of = 0.0
        for i in range(d):
            out_of += V.mult[j + 1 + i] * y[own + columns * (1 + i) + c]
        for i in range(d):  # roundings along n would grow
            V.closing_b[i, c] = y[own + columns * (1 + i) + c] - out_of * V.mult[j + 1 + i]
    _changes(P, V, j, size, y)
    for i in range(d):
        along += V.mult[j + 1 + i] * V.sums[j + 1 + i]
    for i in range(d):
        out[stage, i] = pace * (V.sums[j + 1 + i] - along * V.mult[j + 1 + i])
    rho = math.exp(min(y[_LOG], FARTHEST))
    out[stage, _LOG], out[stage, _TIME] = pace * along, pace * rho
    for i in range(n):
        out[stage, _X + i] = pace * rho * V.rates[i]
    for c in range(columns):
        faster, a = 0.0, y[own + c]
        for i in range(d):
            faster += V.closing_b[i, c] * V.sums[j + 1 + i] + V.mult[j + 1 + i] * V.closing_g[j + 1 + i, c]
        out[stage, own + c] = pace * faster
        for i in range(d):
            turn = V.closing_g[j + 1 + i, c] - faster * V.mult[j + 1 + i] - along * V.closing_b[i, c]
            out[stage, own + columns * (1 + i) + c] = pace * turn
        out[stage, own + columns * _TIME + c] = pace * rho * a
        for i in range(n):
            out[stage, own + columns * (_X + i) + c] = pace * rho * (V.rates[i] * a + V.closing_f[i, c])
    return along


@kernel
def _step_error(P, V, d, step):
    """The error of the step just made, in units of the tolerance; that of dx goes with those of the others."""
    y, k, columns, fifth, third = V.closing_y, V.closing_k, V.columns, 0.0, 0.0
    direction = min(_DIRECTION, _TOLERANCE * math.exp(-min(y[_LOG], 0.0)))
    for i in range(_X):
        if not d <= i < _LOG:
            e5, e3 = errors(k, i)
            scale = direction if i <= _LOG else _TOLERANCE
            fifth, third = max(fifth, abs(e5) / scale), max(third, abs(e3) / scale)
    for c in range(columns):
        at = _X + P.n + c
        size = 1e-300
        for r in range(1 + d):
            size = max(size, abs(y[at + columns * r]), abs(V.closing_new[at + columns * r]))
        for r in range(2 + d):
            e5, e3 = errors(k, at + columns * (r if r < 1 + d else _TIME))
            scale = size * (direction if r < 1 + d else _TOLERANCE * V.closing_pace)
            fifth, third = max(fifth, abs(e5) / scale), max(third, abs(e3) / scale)
    return error_of(fifth, third, step) if fifth + third < math.inf else math.inf


@kernel
def _is_straight(P, V, d):
    """Whether the direction and what it deviates by have settled."""
    y, k, columns = V.closing_y, V.closing_k, V.columns
    settled = _STRAIGHT * abs(k[0, _LOG])
    for i in range(d):
        if abs(k[0, i]) > settled:
            return False
    for c in range(columns):
        at, size = _X + P.n + c, 0.0
        for r in range(1 + d):
            size = max(size, abs(y[at + columns * r]))
        for r in range(1, 1 + d):
            if abs(k[0, at + columns * r]) > settled * size:
                return False
    return True


@kernel
def _rest_of_line(P, V, j, size, along):
    """Overwrites the deviations of t and x at one tau by those at rest, to which h falls along a line: the rates change
    in proportion to it."""
    y, new, k, n, columns = V.closing_y, V.closing_new, V.closing_k, P.n, V.columns
    own, left = _X + n, math.exp(y[_LOG]) / -along
    for i in range((_X + n) * (1 + columns)):
        new[i] = y[i]
    new[_TIME] += left
    new[_LOG] = -700.0
    for half in range(2):
        for c in range(columns):
            faster = k[0, own + c] / V.closing_pace
            later = left * (y[own + c] + faster / -along)
            new[own + columns * _TIME + c] = y[own + columns * _TIME + c] + later
            for i in range(n):
                # Of the first round what stands there, of the second its mean with that at the end.
                change = V.rates[i] * later + V.closing_f[i, c] * left
                at = own + columns * (_X + i) + c
                new[at] = y[at] + change if half == 0 else 0.5 * (new[at] + y[at] + change)
        for i in range(n if half == 0 else 0):
            new[_X + i] = y[_X + i] + left * V.rates[i]
        if half == 0:
            _rates(P, V, j, size, new, k, 1)
    for i in range((_X + n) * (1 + columns)):
        y[i] = new[i]


@kernel
def _run_to_rest(P, V, j, size):
    """Runs the last moments of disc j from V.closing_y; False if it passes by."""
    y, new, k, n, d, columns = V.closing_y, V.closing_new, V.closing_k, P.n, P.dim[j], V.columns
    length = (_X + n) * (1 + columns)
    V.closing_pace = 1.0
    if math.isnan(_rates(P, V, j, size, y, k, 0)):
        return False
    fastest = 1e-300
    for i in range(d):
        fastest = max(fastest, abs(V.sums[j + 1 + i]))
    V.closing_pace = 1.0 / fastest
    along = _rates(P, V, j, size, y, k, 0)
    step = 0.1
    for _ in range(_STEPS):
        before = along
        for s in range(1, STAGES + 1):
            stage_point(y, k, s, length, step, new)
            along = _rates(P, V, j, size, new, k, s)
        error = _step_error(P, V, d, step)
        if not error <= 1.0:
            along, step = before, next_step(step, error)
            continue
        for i in range(length):
            y[i], k[0, i] = new[i], k[STAGES, i]
        if y[_LOG] > _PASSED:
            return False
        steady = abs(along - before) <= _STEADY * abs(along) * min(1.0, step * abs(k[0, _LOG]))
        straight = steady and _is_straight(P, V, d)
        if along < 0.0 and (straight or y[_LOG] < _ENDED):
            _rest_of_line(P, V, j, size, along)
            return True
        step = next_step(step, error)
    return False


@kernel
def close(P, V, k):
    """Deviations over the last moments of the slip of a disc, entry k of the tape: of (x, t), as at the end of an arc;
    False if the slip passes by."""
    n, m, j, columns, y = P.n, P.m, V.tape[k, 2], V.columns, V.closing_y
    d, t, own, square = P.dim[j], V.tape_x[k, 0], _X + P.n, 0.0
    for i in range(m):
        V.mult[i] = V.tape_x[k, 2 + n + i]
        V.mask[i] = 1 if V.tape[k, 4 + i] == SOLVED else 0
    for side in (-1.0, 1.0, 0.0):
        for i in range(n):
            V.x[i] = V.tape_x[k, 2 + i]
        call_fields(P.fields, t + side * _NEARBY, V.x, V.mult, P.p, V.rates, V.slopes, V.sums)
        for i in range(n):
            V.closing_ft[i] = side * V.rates[i] / (2.0 * _NEARBY) + (V.closing_ft[i] if side > -1.0 else 0.0)
    for i in range(n):
        V.closing_x[i] = V.x[i]
    V.closing_t = t
    for i in range(d):
        square += V.slopes[j + 1 + i] ** 2
    V.closing_size = math.sqrt(square)
    for i in range((_X + n) * (1 + columns)):
        y[i] = 0.0
    for i in range(d):
        y[i] = V.mult[j + 1 + i]
    look(P, V, t, V.x, V.mult)
    for e in range(V.entries_point.shape[0]):
        kind, i, at = V.entries_point[e, 0], V.entries_point[e, 1], V.entries_point[e, 2]
        if i >= m or P.disc_of[i] != j or not (kind == H_X or kind == H_P):
            continue
        for c in range(columns):
            by = V.w[at, c] if kind == H_X else V.seeds[V.w.shape[1] * at + c]
            y[own + columns * (i - j) + c] += V.jac[e] * by
    for c in range(columns):
        for i in range(d):
            y[own + c] += y[i] * y[own + columns * (1 + i) + c]
        for i in range(d):
            y[own + columns * (1 + i) + c] -= y[i] * y[own + c]
        for i in range(n):
            y[own + columns * (_X + i) + c] = V.w[i, c]
    rests = _run_to_rest(P, V, j, number_unknowns(V, V.mask, m))
    for c in range(columns):
        V.arc_w[n, c] = y[own + columns * _TIME + c]
        for i in range(n):
            V.arc_w[i, c] = y[own + columns * (_X + i) + c]
    for i in range(n):
        V.arc_rates[i] = V.rates[i]
    V.arc_rates[n] = 1.0
    V.on_arc = 1
    return rests


@kernel
def _equations(P, V, k, t, h, each):
    """Overwrites V.nodes by the linear equations of the deviations at the nodes of the step of entry k."""
    n, m, A, columns = P.n, P.m, V.nodes, V.columns
    for r in range(COLLOCATED * each):
        for c in range(COLLOCATED * each + columns):
            A[r, c] = 0.0
    behind = COLLOCATED * each
    for q in range(COLLOCATED):
        for i in range(n):
            V.x[i] = V.tape_x[k + 1 + q, 2 + i]
        for i in range(m):
            V.mult[i] = V.tape_x[k + 1 + q, 2 + n + i]
        look(P, V, t + NODES[q] * h, V.x, V.mult)
        for i in range(n):
            A[q * each + i, q * each + i] += 1.0
            for c in range(columns):
                A[q * each + i, behind + c] += V.w[i, c]
        for e in range(V.entries_point.shape[0]):
            kind, i, j, value = V.entries_point[e, 0], V.entries_point[e, 1], V.entries_point[e, 2], V.jac[e]
            if kind == F_X or (kind == F_MULT and V.unknown[j] >= 0):
                column = q * each + (j if kind == F_X else n + V.unknown[j])
                for s in range(COLLOCATED):
                    A[s * each + i, column] -= h * WEIGHTS[s, q] * value
            elif kind == F_P:
                for s in range(COLLOCATED):
                    for c in range(columns):
                        A[s * each + i, behind + c] += h * WEIGHTS[s, q] * value * V.seeds[V.w.shape[1] * j + c]
            elif (kind == G_X or kind == G_MULT or kind == G_P) and V.unknown[i] >= 0:
                row = q * each + n + V.unknown[i]
                if kind == G_X:
                    A[row, q * each + j] += value
                elif kind == G_MULT and V.unknown[j] >= 0:
                    A[row, q * each + n + V.unknown[j]] += value
                elif kind == G_P:
                    for c in range(columns):
                        A[row, behind + c] -= value * V.seeds[V.w.shape[1] * j + c]


@kernel
def collocate(P, V, k):
    """Carries the deviations over entry k of the tape, a step by collocation; False where it has none."""
    n, m, A, columns = P.n, P.m, V.nodes, V.columns
    t, length, h = V.tape_x[k, 0], V.tape_x[k, 1], V.tape_x[k, 2 + n + m]
    each = n + number_unknowns(V, V.mask, m)
    behind = COLLOCATED * each
    _equations(P, V, k, t, h, each)
    if not solve_dense(A, behind, columns):
        return False
    count = V.cost if V.backward else len(V.t_eval)
    while V.samples < count and V.t_eval[V.samples] < t + length:
        row, s = V.at_sample[V.samples - V.first_sample], max(V.t_eval[V.samples] - t, 0.0) / h
        for i in range(row.shape[0]):
            place = i if i < n else -1 if V.unknown[i - n] < 0 else n + V.unknown[i - n]
            for c in range(columns):
                row[i, c] = _between(V, place, each, behind, s, c) if place >= 0 else 0.0
        V.samples += 1
    s = length / h
    for i in range(n):
        for c in range(columns):
            V.sizes[c] = _between(V, i, each, behind, s, c)
        for c in range(columns):
            V.w[i, c] = V.sizes[c]
    return True


@kernel
def _between(V, place, each, behind, s, c):
    """The collocation's polynomial of a deviation, in column c, at a share s of the step."""
    is_state, total = place < V.w.shape[0], 0.0
    start = V.w[place, c] if is_state else 0.0
    for power in range(COLLOCATED - 1, -1, -1):
        total *= s
        for q in range(COLLOCATED):
            value = V.nodes[q * each + place, behind + c]
            # Of a state the values less that at the start, over the time since.
            total += LAGRANGE[power, q] * ((value - start) / NODES[q] if is_state else value)
    return start + s * total if is_state else total
