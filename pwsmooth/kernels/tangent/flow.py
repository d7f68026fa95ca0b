"""Deviations along a step: the linearised flow as a Taylor series in the step's own variable.

    w' = f_x w + f_lambda l + f_p q,      0 = g_x w + g_lambda l + g_p q     for the multipliers that are solved for

With the series of the Jacobians' entries, order k + 1 of w follows from the orders up to k of w and l, and order k of l
from one linear system with g_lambda at order 0, whose inverse is made once a step. Eight columns at a time.
"""

from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import load8, splat8, store8
from ..machine.pointers import abs8, below_zero8
from ..surface.sparse import solve_dense
from .state import BY_MULT, BY_P, BY_X, ZEROS

FIRST = 8 * ZEROS


@kernel
def number_unknowns(V, mask, m):
    """Overwrites V.unknown by the places of the masked multipliers; how many there are."""
    size = 0
    for j in range(m):
        V.unknown[j] = -1
        if mask[j]:
            V.unknown[j] = size
            size += 1
    return size


@kernel
def invert(V, size):
    """Overwrites the right half of V.matrix by the inverse of the left one; False if singular."""
    matrix = V.matrix
    for i in range(size):
        for j in range(size):
            matrix[i, size + j] = 1.0 if i == j else 0.0
    return solve_dense(matrix, size, size)


@inlined_kernel
def _product(rows, row, series, start, k):
    """Orders 1 to k of a coefficient times the orders k - 1 to 0 of a column block; before order 0 stand zeros.

    By eights: a loop whose length changed with every k would end in a mispredicted branch.
    """
    one, two, at, last = splat8(0.0), splat8(0.0), row + 1, start + 8 * (k - 1)
    for _ in range(0, k, 8):
        one = one + load8(series, last) * rows[at]
        two = two + load8(series, last - 8) * rows[at + 1]
        one = one + load8(series, last - 16) * rows[at + 2]
        two = two + load8(series, last - 24) * rows[at + 3]
        one = one + load8(series, last - 32) * rows[at + 4]
        two = two + load8(series, last - 40) * rows[at + 5]
        one = one + load8(series, last - 48) * rows[at + 6]
        two = two + load8(series, last - 56) * rows[at + 7]
        at, last = at + 8, last - 64
    return one + two


@kernel
def plan(V, A, states, size):
    """Overwrites the plan of a flow by what its rows are made of where V.unknown are solved for, if that has changed.

    Each equation has terms of order 0 of an entry, products of the others, and parameters; residuals come first.
    """
    unknown, equations, at, row = V.unknown, A.equations, A.term_at, A.term_row
    changed = A.solved[0] != size
    for j in range(A.residuals):
        changed = changed or A.solved[1 + j] != unknown[j]
        A.solved[1 + j] = unknown[j]
    if not changed:
        return
    A.solved[0] = size
    orders, terms, count = 8 * (V.order + 1 + ZEROS), 0, 0
    for turn in range(states + A.residuals):
        i = states + turn if turn < A.residuals else turn - A.residuals
        residual = i >= states
        if residual and unknown[i - states] < 0:
            continue
        # Held at 0 by its multiplier: a row without terms.
        empty = not residual and size > 0 and A.same[i] >= 0 and unknown[A.same[i]] >= 0
        place = states + unknown[i - states] if residual else i
        equations[6 * count] = FIRST + orders * place + (0 if residual else 8)
        equations[6 * count + 1] = unknown[i - states] if residual else -1
        for section in range(4):
            for e in range(A.first[i], A.first[i] if empty else A.first[i + 1]):
                what, column = A.what[e], A.index[e]
                if what == BY_P:
                    if section == (2 if A.moves[e] else 3):
                        at[terms], row[terms] = column, A.place[e]
                        terms += 1
                    continue
                if what == BY_MULT:
                    if unknown[column] < 0:
                        continue
                    column = states + unknown[column]
                if (section == 0 and (what == BY_X or not residual)) or (section == 1 and A.moves[e]):
                    at[terms], row[terms] = FIRST + orders * column, A.place[e]
                    terms += 1
            equations[6 * count + 2 + section] = terms
        count += 1
    A.count[0] = count


@kernel
def _series(V, A, K, states, size, block):
    """Overwrites V.series by the orders 0 to K of a block of columns, of which order 0 of the states is there."""
    series, sums, matrix, rows, seeds = V.series, V.sums, V.matrix, V.rows_flat, V.seeds
    equations, at, row, count = A.equations, A.term_at, A.term_row, A.count[0]
    orders = 8 * (K + 1 + ZEROS)
    for k in range(K + 1):
        inv, first = 1.0 / (k + 1.0), 0
        # The residuals first, which give order k of the multipliers; then the rates: order k + 1 of the states.
        for q in range(0, 6 * (count if k < K else size), 6):
            total = splat8(0.0)
            for e in range(first, equations[q + 2]):
                total = total + load8(series, at[e] + 8 * k) * rows[row[e]]
            for e in range(equations[q + 2], equations[q + 3]):
                total = total + _product(rows, row[e], series, at[e], k)
            for e in range(equations[q + 3], equations[q + 4]):
                total = total + load8(seeds, at[e] + block) * rows[row[e] + k]
            if k == 0:
                for e in range(equations[q + 4], equations[q + 5]):
                    total = total + load8(seeds, at[e] + block) * rows[row[e]]
            first = equations[q + 5]
            if equations[q + 1] < 0:
                store8(series, equations[q] + 8 * k, total * inv)
            elif size == 1:
                store8(series, equations[q] + 8 * k, total * -matrix[0, 1])
            else:
                store8(sums, 8 * equations[q + 1], total)
                if equations[q + 1] == size - 1:
                    _solve(V, FIRST + orders * states + 8 * k, orders, size)


@kernel
def _solve(V, start, orders, size):
    for r in range(size):
        total = splat8(0.0)
        for c in range(size):
            total = total - load8(V.sums, 8 * c) * V.matrix[r, size + c]
        store8(V.series, start + orders * r, total)


@inlined_kernel
def _value(series, start, K, s):
    total = load8(series, start + 8 * K)
    for k in range(K - 1, -1, -1):
        total = total * s + load8(series, start + 8 * k)
    return total


@kernel
def _holds(V, K, states, s):
    """Whether the last two orders of the block are small on a way s, against its first three."""
    series, orders = V.series, 8 * (K + 1 + ZEROS)
    power = abs(s) ** (K - 1)
    for i in range(states):
        start = FIRST + orders * i
        total = abs8(load8(series, start)) + abs8(load8(series, start + 8)) * abs(s)
        total = total + abs8(load8(series, start + 16)) * (s * s)
        last = abs8(load8(series, start + 8 * (K - 1))) * power
        last = last + abs8(load8(series, start + 8 * K)) * (power * abs(s))
        if below_zero8(total * V.tolerance - last) != 0:
            return False
    return True


@kernel
def row_holds(V, first, states, s):
    """The same of one column, whose series are rows from the `first` on."""
    K = V.order
    power = abs(s) ** (K - 1)
    for i in range(states):
        row = V.rows[first + i]
        total = abs(row[0]) + abs(row[1] * s) + abs(row[2] * s * s)
        if not abs(row[K - 1]) * power + abs(row[K]) * power * abs(s) <= V.tolerance * total:
            return False
    return True


@kernel
def _start(V, A, w, states, size, K, block):
    for i in range(states):
        store8(V.series, FIRST + 8 * (K + 1 + ZEROS) * i, load8(w[i], block))
    _series(V, A, K, states, size, block)


@kernel
def way_within(V, A, w, states, size, K, s):
    """How far along the step whose rows these are, at most s, the series of the deviations w hold."""
    for block in range(0, V.columns, 8):
        _start(V, A, w, states, size, K, block)
        shortest = 1e-6 * abs(s)
        while abs(s) > shortest and not _holds(V, K, states, s):
            s *= 0.8
    return s


@inlined_kernel
def _place(V, states, j):
    return states + V.unknown[j] if V.unknown[j] >= 0 else -1


@kernel
def move(V, A, w, states, size, K, s, time_row):
    """Moves the deviations w by s, and leaves those at the wanted places V.place of this way in V.at_sample.

    On an arc these are the ones at one time: less the pace of the states there times the deviation of the time.
    """
    series, orders = V.series, 8 * (K + 1 + ZEROS)
    n = states if time_row < 0 else time_row
    for block in range(0, V.columns, 8):
        if V.columns > 8:
            _start(V, A, w, states, size, K, block)
        for q in range(V.wanted):
            here = V.place[q]
            row = V.at_sample[V.samples - V.first_sample + q]
            for i in range(row.shape[0]):
                # Behind the states their multipliers: on an arc they are states, else unknowns or fixed.
                from_series = i if i < n else (i + 1 if time_row >= 0 else _place(V, states, i - n))
                value = splat8(0.0)
                if from_series >= 0:
                    value = _value(series, FIRST + orders * from_series, K, here)
                if time_row >= 0:
                    shift = _value(series, FIRST + orders * time_row, K, here)
                    value = value - shift * V.pace[q, from_series]
                store8(row[i], block, value)
        for i in range(states):
            store8(w[i], block, _value(series, FIRST + orders * i, K, s))
    V.samples += V.wanted
    V.wanted = 0
