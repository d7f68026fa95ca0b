"""Slopes of a cost, from the end of a run to its start: the transposed maps of forward.py, in the opposite order.

With w1 = Phi w0 + Psi q over a step, slopes c by w1 become slopes Phi' c by w0 and Psi' c by the parameters. On a step
the recurrence of flow.py is transposed term by term, so that both directions agree to roundings. At instants and along
arcs, which are few, Phi and Psi are made as they stand, with a column for each state and each parameter.
"""

from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import load8, splat8, store8
from ..state import (
    PAIR,
    SLIP,
    SOLVED,
    TAPE_ACT,
    TAPE_CLOCK,
    TAPE_MEET,
    TAPE_NOTHING,
    TAPE_STEP,
    TAPE_SURFACE,
)
from ..step.steps import dot, powers
from .flow import number_unknowns, plan
from .forward import begin, by_columns, factor, go_over, has_length, jet, leave, stand_at
from .saltation import keep_held, look
from .state import FINE, H_P, H_X, ZEROS

_PARTS = 32  # that a step is taken in, at most
_HELD = 1e-9  # of a gradient: what is left of it along the surfaces that are held


@inlined_kernel
def _base(place):
    """Where the orders K to 0 of a series stand, from its place in V.series."""
    return (place >> 3) - ZEROS


@inlined_kernel
def _scatter(orders, at, rows, row, count, c):
    """Adds c times a row to so many orders below one, which stand behind each other."""
    for l in range(0, count, 8):
        store8(orders, at + l, load8(orders, at + l) + load8(rows, row + l) * c)


@kernel
def _transposed(V, A, states, size, parameters):
    """Slopes by order 0 of the states, from those by all orders in V.back; by parameters too, if wanted."""
    K, equations, at, row, rows, matrix = V.order, A.equations, A.term_at, A.term_row, V.rows_flat, V.matrix
    back, slope_q, stride, count = V.back, V.slope_q, V.order + 1 + ZEROS, A.count[0]
    for k in range(K, -1, -1):
        order = K - k  # where it stands
        for q in range(6 * (count if k < K else size) - 6, -6, -6):
            if equations[q + 1] < 0:
                c = back[_base(equations[q] - 8) + order - 1] / (k + 1.0)
            else:
                c = 0.0
                for r in range(size):
                    c -= matrix[r, size + equations[q + 1]] * back[stride * (states + r) + order]
            for e in range(equations[q - 1] if q > 0 else 0, equations[q + 2]):
                back[_base(at[e]) + order] += c * rows[row[e]]
            for e in range(equations[q + 2], equations[q + 3]):
                _scatter(back, _base(at[e]) + order + 1, rows, row[e] + 1, k, c)
            if parameters:
                for e in range(equations[q + 3], equations[q + 4]):
                    slope_q[at[e]] += c * rows[row[e] + k]
                for e in range(equations[q + 4], equations[q + 5] if k == 0 else 0):
                    slope_q[at[e]] += c * rows[row[e]]


@kernel
def _seed(V, states, unknowns, s, lowest):
    """Overwrites V.back by the slopes of the orders from `lowest` on, from those by the state at a way s."""
    K, stride = V.order, V.order + 1 + ZEROS
    for l in range(0, stride * (states + unknowns), 8):
        store8(V.back, l, splat8(0.0))
    for i in range(states):
        power = 1.0
        for k in range(K + 1):
            if k >= lowest:
                V.back[stride * i + K - k] = power * V.slope[i]
            power *= s


@kernel
def _seed_costs(V, t, states, m, lowest):
    """Adds the slopes of the orders from `lowest` on, from those by what the cost reads from t on."""
    K, stride = V.order, V.order + 1 + ZEROS
    while V.cost > 0 and V.t_eval[V.cost - 1] >= t:
        V.cost -= 1
        power, way = 1.0, max(V.t_eval[V.cost] - t, 0.0)
        for k in range(K + 1):
            for i in range(states if k >= lowest else 0):
                V.back[stride * i + K - k] += power * V.cost_slope[V.cost, i]
            for j in range(m if k >= lowest else 0):
                if V.unknown[j] >= 0:
                    V.back[stride * (states + V.unknown[j]) + K - k] += power * V.cost_slope[V.cost, states + j]
            power *= way


@kernel
def _pull_step(V, A, states, m, size, t, s, last):
    """Slopes by the state at a way s from t become those by that at t; False, and nothing done, where these would owe
    more than the tolerance to the last two orders, unless it is the `last` try."""
    K, stride, parameters, cost = V.order, V.order + 1 + ZEROS, V.w.shape[1] * V.parameters, V.cost
    if not last:
        _seed(V, states, size, s, K - 1)
        _seed_costs(V, t, states, m, K - 1)
        _transposed(V, A, states, size, False)
        V.cost = cost
        for i in range(states):
            V.x[i] = V.back[stride * i + K]
        for j in range(0, parameters, V.w.shape[1]):
            V.slope_q[j + 1] = V.slope_q[j]
    _seed(V, states, size, s, 0)
    _seed_costs(V, t, states, m, 0)
    _transposed(V, A, states, size, True)
    for i in range(states):
        if not last and abs(V.x[i]) > V.tolerance * (abs(V.slope[i]) + abs(V.back[stride * i + K])):
            V.cost = cost
            for j in range(0, parameters, V.w.shape[1]):
                V.slope_q[j] = V.slope_q[j + 1]
            return False
    for i in range(states):
        V.slope[i] = V.back[stride * i + K]
    return True


@kernel
def _stand(V, k, n, m):
    """Overwrites V.x, V.mult by the start of the step of entry k."""
    for i in range(n):
        V.x[i] = V.tape_x[k, 2 + i]
    for j in range(m):
        V.mult[j] = V.tape_x[k, 2 + n + j]
        V.mask[j] = 1 if V.tape[k, 4 + j] == SOLVED else 0


@kernel
def _step_back(P, V, A, k):
    """Slopes by the end of the step of entry k become those by its start; False where there is no series."""
    n, m, K, kind, piece = P.n, P.m, V.order, V.tape[k, 1], V.tape[k, 2]
    t, length, parts = V.tape_x[k, 0], V.tape_x[k, 1], 1
    part = parts - 1
    while part >= 0:
        begin_at = length * part / parts
        way = length * (part + 1) / parts - begin_at
        _stand(V, k, n, m)
        if part > 0 and V.given:
            stand_at(V, piece, begin_at, n, m)
        elif part > 0:
            if not jet(P, V, A, kind, t, piece, 0.0):
                return False
            powers(V.power, begin_at)
            for j in range(m):
                if V.mask[j]:
                    V.mult[j] = dot(V.rows[n + j], V.power, K + 1)
            for i in range(n):
                V.x[i] = dot(V.rows[i], V.power, K + 1)
        if not jet(P, V, A, kind, t + begin_at, piece, begin_at):
            return False
        size = number_unknowns(V, V.mask, m)
        plan(V, A, n, size)
        if size > 0 and not factor(V, A, size):
            return False
        if _pull_step(V, A, n, m, size, t + begin_at, way, part < parts - 1 or parts == _PARTS):
            part -= 1
        else:
            parts *= 2
            part = parts - 1
    return True


@kernel
def _begin_columns(P, V, k):
    """At entry k of the tape a column for each state, beside those of V.seeds for the parameters and of the clock."""
    V.inside, V.on_arc, V.why, V.instants, V.points = 0, 0, FINE, 0, 0
    for c in range(V.w.shape[1]):
        V.normal[c] = 0.0
    for i in range(P.n):
        V.scale[i] = abs(V.tape_x[k, 2 + i])
        for c in range(V.w.shape[1]):
            V.w[i, c] = 1.0 if i == c else 0.0


@kernel
def _met_first(V, a, b):
    """The surface whose zero begins the instant of the entries between a and b, or -1."""
    k = a + 1
    while k < b and not (V.tape[k, 0] == TAPE_MEET and V.tape[k, 1] != TAPE_NOTHING):
        k += 1
    return V.tape[k, 2] if k < b and V.tape[k, 1] == TAPE_SURFACE else -1


@kernel
def _keep_possible(P, V, a, b):
    """Leaves in the columns what the run can deviate by before the instant of the entries between a and b.

    That is along what it slides on, also where other surfaces meet that. And what leads out of the surface that is met
    goes to one column of its own, behind that of the clock, with the others' parts in it in V.normal: times of slow
    impacts deviate by it over a small speed. If each column did so by itself, it would owe roundings to that which do
    not cancel where the columns' own do, in the deviations that a run has.
    """
    i, last, entries = _met_first(V, a, b), P.n + len(P.p) + 1, V.entries_point
    _stand(V, a + 1, P.n, P.m)
    t = V.tape_x[a + 1, 0]
    look(P, V, t, V.x, V.mult)
    for e in range(entries.shape[0] if i >= 0 else 0):
        if entries[e, 0] == H_X and entries[e, 1] == i:
            V.w[entries[e, 2], last] = V.jac[e]
    keep_held(P, V, t, V.x, V.mult, V.tape[a + 1, 4:], 1)
    if i < 0:
        return
    square, size = 0.0, 0.0
    for e in range(entries.shape[0]):
        kind, j, value = entries[e, 0], entries[e, 2], V.jac[e]
        if entries[e, 1] != i or not (kind == H_X or kind == H_P):
            continue
        for block in range(0, V.columns, 8):
            row = load8(V.w[j], block) if kind == H_X else load8(V.seeds, V.w.shape[1] * j + block)
            store8(V.normal, block, load8(V.normal, block) + row * value)
        if kind == H_X:
            square += value * value
            size += abs(value * V.x[j])
    out = V.normal[last]
    if not out > _HELD * square:  # what it slides on is that surface, too
        for j in range(P.n):
            V.w[j, last] = 0.0
        for c in range(V.columns):
            V.normal[c] = 0.0
        return
    for j in range(P.n):
        V.w[j, last] /= out
        for c in range(last):
            V.w[j, c] -= V.normal[c] * V.w[j, last]
    V.normal[last] = 0.0
    V.scale[last] = size


@kernel
def _pull(P, V, first):
    """Slopes by what the columns have become are those by what they began as; samples begin with the `first`."""
    n, count = P.n, len(P.p)
    at_instant = V.cost_events > 0 and V.instants > 0 and V.cost_entry[V.cost_events - 1] == V.met
    if at_instant:
        V.cost_events -= 1
    for block in range(0, V.columns, 8):
        total = splat8(0.0)
        for i in range(n):
            total = total + load8(V.w[i], block) * V.slope[i]
        for q in range(first, V.samples):
            for i in range(n + P.m):
                total = total + load8(V.at_sample[q - first, i], block) * V.cost_slope[q, i]
        if at_instant:
            total = total + load8(V.instant_dt[0], block) * V.cost_instant[V.cost_events, 2 * n]
            for i in range(2 * n):
                total = total + load8(V.instant_w[0, i], block) * V.cost_instant[V.cost_events, i]
        store8(V.other_dt, block, total)
    by_normal = V.other_dt[n + count + 1]
    for i in range(n):
        V.slope[i] = V.other_dt[i] + V.normal[i] * by_normal
    for j in range(count):
        V.slope_q[V.w.shape[1] * j] += V.other_dt[n + j] + V.normal[n + j] * by_normal
    if V.why != FINE:
        V.bad, V.bad_why, V.bad_cause = V.met, V.why, V.cause
    V.cost = first


@kernel
def _first_sample(V, t):
    first = V.cost
    while first > 0 and V.t_eval[first - 1] >= t:
        first -= 1
    return first


@kernel
def _instant_back(P, V, a, b):
    """Slopes behind the instant of the entries between a and b become those before it, or before the arc of a."""
    arc, tick, some = by_columns(V, a), -1, False
    for k in range(a + 1, b):
        some = some or V.tape[k, 0] == TAPE_MEET or V.tape[k, 0] == TAPE_ACT
        if V.tape[k, 0] == TAPE_MEET and V.tape[k, 1] == TAPE_CLOCK and tick < 0:
            tick = V.tape[k, 2]
    if not (arc or some):
        return True
    _begin_columns(P, V, a if arc else a + 1)
    if not arc:
        _keep_possible(P, V, a, b)
    V.samples = V.first_sample = _first_sample(V, V.tape_x[a, 0]) if arc else V.cost
    for k in range(a if arc else a + 1, b):
        if not go_over(P, V, k):
            return False
    leave(P, V, b)
    _pull(P, V, V.first_sample)
    if tick >= 0:
        V.slope_clock[tick] += V.other_dt[P.n + len(P.p)]
    return True


@kernel
def pull_back(P, V, count):
    """Slopes of a cost by the last entry's state, in V.slope, become those by the first one's and by the parameters."""
    b = count - 1
    _begin_columns(P, V, b)
    V.samples = V.first_sample = _first_sample(V, V.tape_x[b, 0])
    go_over(P, V, b)
    _pull(P, V, V.first_sample)
    while b > 0:
        a = b - 1
        while a > 0 and not (V.tape[a, 0] == TAPE_STEP and has_length(V, a)):
            a -= 1
        if not _instant_back(P, V, a, b):
            return a
        kind = V.tape[a, 1]
        if V.tape[a, 0] == TAPE_STEP and not by_columns(V, a):
            if kind == PAIR or not _step_back(P, V, V.slip if kind == SLIP else V.general, a):
                return a
        b = a
    _begin_columns(P, V, 0)
    begin(P, V)
    V.samples = V.first_sample = V.cost
    _pull(P, V, V.cost)
    return -1
