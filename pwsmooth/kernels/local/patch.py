"""A patch: some elements as a small system of their own, which the kernels of all systems then work on.

Its members are computed; what they read of elements beside it has a motion that is known, its polynomials shifted to
the present instant. The arrays of the small system (state.Problem and its kin) are one block for all patches: their
extents are set anew for every one.
"""

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..instant.accumulation import at_once_within
from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import load8, store8
from ..machine.pointers import at, call_fields, call_linear
from ..state import HELD, SLIDING, SOLVED
from ..step.roots import NO_ROOT
from ..step.steps import dot, powers
from .members import number_of

_GIVEN = 1e300  # absolute tolerance of a motion that is given
_JUST_NOW = 10.0  # times what is one instant: what an element was left with so shortly ago still stands


@intrinsic
def _put_at(typingctx, address, value):
    """Writes an int64 at an address."""

    def codegen(context, builder, sig, args):
        builder.store(args[1], builder.inttoptr(args[0], ir.IntType(64).as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), codegen


# ---- the small system


@kernel
def _row(A, block, own, fixed, k, members, places):
    """Row of a block of rows for member k, -1 where there is none."""
    if block < 0:
        return -1
    ns = A.kind.ns
    states = min(block, ns)
    return fixed + states * places + (block - states) * members + (k if own else 0)


@kernel
def _place_near(A, k, column, below):
    """Place of a neighbour of member k, its own where there is none below this number."""
    T = A.patch
    if column < 0:
        return k
    place = int(T.near[A.kind.nr * k + column])
    return place if place < below else k


@kernel
def _fill_flat(A, rows, blocks, own, fixed):
    """Overwrites the rows of arguments of flat functions."""
    M, filled = A.patch.count, 0
    for f in range(len(blocks)):
        for k in range(M if own[f] else 1):
            rows[filled] = _row(A, blocks[f], own[f], fixed[f], k, M, A.patch.total)
            filled += 1


@kernel
def shape(A, P, C, W):
    """Overwrites what of the small system's arrays depends on the numbers of members and places."""
    T, E = A.patch, A.kind
    M, places = T.count, T.total
    if T.shaped[0] == M and T.shaped[1] == places:
        return
    T.shaped[0], T.shaped[1] = M, places
    if E.reads_between != 0 or len(E.contact) > 0:
        T.shaped[0] = -1  # which entries of its surfaces' gradients are whose, is another matter in every patch
    for c in range(T.cell.shape[0]):
        _put_at(T.cell[c, 0], T.cell[c, 1] + T.cell[c, 2] * M + T.cell[c, 3] * places)
    nm, ne = E.nm, E.ne
    P.n, P.memories = E.ns * places, E.memories * places
    P.m = number_of(E, nm, M, 0) if ne > 0 else E.fixed_m + E.blocks_m * M
    P.ne = ne * M
    P.mult_row = E.ns * places
    # What a program keeps for itself stands behind the rows of both: those are 0 behind their last order.
    slip = _row(A, E.rows_slip, 0, E.fixed_slip, 0, M, places)
    general = _row(A, E.rows_general, 0, E.fixed_general, 0, M, places)
    P.own_slip = P.own_general = max(slip, general)
    for r in range(P.own_slip):
        for c in range(C.order + 1, W.step.rows.shape[1]):
            W.step.rows[r, c] = 0.0
    at_g = at_link = at_dh = at_group = group = 0
    for b in range(nm):
        for k in range(M if E.s_own[b] else 1):
            j = number_of(E, b, M, k)
            P.kind[j], P.hidden[j] = E.kind[b], E.hidden[b]
            P.slope_moves[j], P.at_zero[j] = E.slope_moves[b], E.at_zero[b]
            P.surface_state[j] = E.surface_state[b] * places + k if E.surface_state[b] >= 0 else -1
            P.g_row[j], P.link_row[j] = at_g, at_link
            for e in range(E.g_first[b], E.g_first[b + 1]):
                if E.g_block[e] == b and E.g_near[e] < 0:
                    P.g_diagonal[j] = at_g
                P.g_col[at_g] = number_of(E, E.g_block[e], M, _place_near(A, k, E.g_near[e], M))
                at_g += 1
            for e in range(E.link_first[b], E.link_first[b + 1]):
                P.link_col[at_link] = number_of(E, E.link_block[e], M, _place_near(A, k, E.link_near[e], M))
                at_link += 1
    P.g_row[P.m], P.link_row[P.m] = at_g, at_link
    for g in range(len(E.group_first) - 1):
        for k in range(M if E.s_own[E.group_block[E.group_first[g]]] else 1):
            P.block_row[group] = at_group
            group += 1
            for e in range(E.group_first[g], E.group_first[g + 1]):
                P.block_member[at_group] = number_of(E, E.group_block[e], M, k)
                at_group += 1
    if len(E.coupled) > 0:
        P.block_row[group] = at_group
        group += 1
        for k in range(M):
            for e in range(len(E.coupled)):
                P.block_member[at_group] = number_of(E, E.coupled[e], M, k)
                at_group += 1
    P.block_row[group] = at_group
    for b in range(nm + ne):
        for k in range(M if E.s_own[b] else 1):
            i = number_of(E, b, M, k)
            P.dh_row[i], P.nested[i], P.wave[i] = at_dh, E.nested[b], E.wave[b]
            for e in range(E.dh_first[b], E.dh_first[b + 1]):
                P.dh_col[at_dh] = E.dh_block[e] * places + _place_near(A, k, E.dh_near[e], places)
                at_dh += 1
            P.rows_slip[i] = _row(A, E.surface_slip[b], E.own_slip[b], E.of_slip[b], k, M, places)
            P.rows_general[i] = _row(A, E.surface_general[b], E.own_general[b], E.of_general[b], k, M, places)
    P.dh_row[P.m + P.ne] = at_dh
    for b in range(len(E.contact)):
        for k in range(M):
            P.contact[b * M + k] = number_of(E, E.contact[b], M, k)
    for b in range(ne):
        for k in range(M):
            i = number_of(E, nm + b, M, k) - P.m
            P.direction[i], P.terminal[i], P.rule[i] = E.direction[b], E.terminal[b], E.rule[b]
            P.watch[i], P.watch_state[i], W.firing.carried[i] = 0, -1, E.carried[b]
            twin = abs(E.twin[b]) - 1
            P.twin[i] = (number_of(E, twin, M, k) + 1) * (1 if E.twin[b] > 0 else -1) if twin >= 0 else 0
    _fill_flat(A, P.flat_slip, E.flat_slip, E.flat_own_slip, E.flat_of_slip)
    _fill_flat(A, P.flat_general, E.flat_general, E.flat_own_general, E.flat_of_general)
    for b in range(len(E.shared)):
        P.p[E.shared_fixed[b] + E.shared_blocks[b] * places] = E.shared[b]
    for b in range(E.ns):
        for s in range(places):
            C.atol[b * places + s] = W.step.atol[b * places + s] = E.atol[b] if s < M else _GIVEN
    W.meeting.rhythm[:, 0] = 0.0
    W.meeting.rhythm[:, 1] = 1.0
    W.step.nears = 0


# ---- polynomials of elements


@kernel
def degree_of(row, K):
    """Of a polynomial: its last order that is not 0."""
    k = K
    while k > 0 and row[k] == 0.0:
        k -= 1
    return k


@inlined_kernel
def value(A, row, since, K):
    """A polynomial so long after its beginning."""
    powers(A.power, since)
    return dot(row, A.power, K + 1)


@kernel
def shifted(A, row, since, K, to):
    """Overwrites `to` by the polynomial from so long after its beginning on.

    With u_k = c_k s^k the new coefficients are sum_k binom(k, j) u_k / s^j: one product with a constant matrix.
    """
    degree = degree_of(row, K)
    width = len(A.power)
    if degree <= 1 or since == 0.0:
        for k in range(0, K + 1, 8):
            store8(to, k, load8(row, k))
        to[0] = row[0] + since * row[1]
        return
    powers(A.power, since)
    for k in range(0, K + 1, 8):
        store8(A.terms, k, load8(row, k) * load8(A.power, k))
    for start in range(0, K + 1, 8):
        total = load8(A.shift, start) * at(A.terms, 0)
        for k in range(1, degree + 1):
            total = total + load8(A.shift, k * width + start) * at(A.terms, k)
        store8(to, start, total)
    # Powers that vanish belong to orders whose part on what is left is none.
    for k in range(K + 1):
        to[k] = to[k] / A.power[k] if A.power[k] > 1e-290 else row[k]


@kernel
def state_at(A, i, b, t, K):
    """State b of element i at t."""
    if A.fresh[i] == A.patch.stamp or A.begun[i] == t:
        return A.x[i, b]
    return value(A, A.row[i, b], t - A.begun[i], K)


@kernel
def write_asked(A, i, t, K, last):
    """Keeps what was asked for of element i before t, at `last` too at it."""
    c = A.keeps[i]
    if c < 0:
        return
    k = A.next_asked[c]
    while k < len(A.asked) and (A.asked[k] < t or (last and A.asked[k] <= t)):
        since = A.asked[k] - A.begun[i]
        for b in range(A.kind.ns):
            A.x_asked[k, c, b] = value(A, A.row[i, b], since, K)
        for j in range(A.kind.nm):
            A.status_asked[k, c, j] = A.status[i, j] if A.status[i, j] != HELD else SOLVED
            solved = A.status[i, j] == SOLVED
            A.mult_asked[k, c, j] = value(A, A.mult_row[c, j], since, K) if solved else A.mult[i, j]
        k += 1
    A.next_asked[c] = k


# ---- there and back


@kernel
def gather(A, P, C, S, W, t):
    """Overwrites the small system's state by that of the members at t, and the rows of what they read."""
    T, E = A.patch, A.kind
    M, places, K = T.count, T.total, C.order
    shape(A, P, C, W)
    S.t, S.started, S.unit = t, 1, A.unit
    S.step = A.length[T.member[0]]
    S.ticks = S.points = S.events = S.ambiguities = S.pieces = S.taped = S.samples = 0
    S.minute = S.stalled = 0
    some = False
    for k in range(M):
        i = T.member[k]
        again = A.fresh[i] == T.stamp
        if not again:
            write_asked(A, i, t, K, False)
        for b in range(E.np):
            P.p[E.p_fixed[b] + E.p_blocks[b] * places + k] = A.p[i, b]
        for b in range(E.ns):
            S.x[b * places + k] = state_at(A, i, b, t, K)
            W.size[b * places + k] = abs(S.x[b * places + k])
        known = again or t - A.begun[i] <= _JUST_NOW * at_once_within(t, A.length[i])
        for b in range(E.nm):
            j = number_of(E, b, M, k)
            S.mult[j], S.status[j] = A.mult[i, b], A.status[i, b]
            P.slip_share[j] = A.slip_share[i, b]
            some = some or (not known and S.status[j] == SOLVED)
            for c in range(S.last.shape[1]):
                S.last[j, c] = A.last[i, b, c]
            S.arcs[j, 0], S.arcs[j, 1] = A.arcs[i, b, 0], A.arcs[i, b, 1]
            W.meeting.exit_side[j] = A.exit_side[i, b]
        for b in range(E.ne):
            j = number_of(E, E.nm + b, M, k) - P.m
            S.side[j] = A.side[i, b]
            for c in range(S.last.shape[1]):
                W.firing.last[j, c] = A.fired[i, b, c]
        for b in range(E.nm + E.ne):
            j = number_of(E, b, M, k)
            S.deflate[j] = A.deflate[i, b] if known else 0
            W.meeting.widest[j] = A.widest[i, b]
            W.meeting.tau[j] = NO_ROOT
            W.meeting.rounding[j] = W.meeting.blur[j] = 0.0
        S.minute = max(S.minute, A.minute[i])
    for k in range(M, places):
        i = T.member[k]
        for b in range(E.np):
            P.p[E.p_fixed[b] + E.p_blocks[b] * places + k] = A.p[i, b]
        for b in range(len(E.felt)):
            P.p[E.felt_fixed + (E.felt_blocks + b) * places + k] = A.mult[i, E.felt[b]]
        for b in range(E.ns):
            S.x[b * places + k] = W.size[b * places + k] = 0.0
            W.step.rows[b * places + k, :] = 0.0
        for c in range(len(E.read)):
            b = E.read[c]
            row = W.step.rows[b * places + k]
            shifted(A, A.row[i, b], t - A.begun[i], K, row)
            S.x[b * places + k] = row[0]
            W.size[b * places + k] = abs(row[0])
            W.dx[b * places + k] = row[1]  # the generated rates are those of the members
    if some:
        _keep_on_surfaces(A, P, S, W)


@kernel
def _keep_on_surfaces(A, P, S, W):
    """Puts the members exactly on the surfaces that they slide on."""
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    linear = False
    for j in range(P.m):
        if S.status[j] != SOLVED or P.kind[j] != SLIDING or W.h[j] == 0.0:
            continue
        if P.surface_state[j] >= 0:
            S.x[P.surface_state[j]] = 0.0
            continue
        if not linear:
            call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
            linear = True
        square = 0.0
        for e in range(P.dh_row[j], P.dh_row[j + 1]):
            square += W.dh[e] ** 2
        if square > 0.0:
            for e in range(P.dh_row[j], P.dh_row[j + 1]):
                S.x[P.dh_col[e]] -= W.dh[e] * W.h[j] / square


@kernel
def scatter(A, P, S, W, count):
    """The first `count` members take over what the small system has come to at its instant."""
    T, E = A.patch, A.kind
    M, places = T.count, T.total
    for k in range(count):
        i = T.member[k]
        A.fresh[i] = T.stamp
        for b in range(E.ns):
            A.x[i, b] = S.x[b * places + k]
        for b in range(E.nm):
            j = number_of(E, b, M, k)
            A.mult[i, b], A.status[i, b] = S.mult[j], S.status[j]
            A.exit_side[i, b] = W.meeting.exit_side[j]
            for c in range(S.last.shape[1]):
                A.last[i, b, c] = S.last[j, c]
            A.arcs[i, b, 0], A.arcs[i, b, 1] = S.arcs[j, 0], S.arcs[j, 1]
        for b in range(E.ne):
            j = number_of(E, E.nm + b, M, k) - P.m
            A.side[i, b] = S.side[j]
            for c in range(S.last.shape[1]):
                A.fired[i, b, c] = W.firing.last[j, c]
        for b in range(E.nm + E.ne):
            j = number_of(E, b, M, k)
            A.deflate[i, b] = S.deflate[j]
            A.widest[i, b] = W.meeting.widest[j]
        A.minute[i] = S.minute


@kernel
def _number_in_all(A, j):
    """Number of surface j of the small system among those of the whole, its member, and its block."""
    T, E = A.patch, A.kind
    s = E.nm + E.ne - 1
    while s > 0 and number_of(E, s, T.count, 0) > j:
        s -= 1
    k = j - number_of(E, s, T.count, 0) if E.s_own[s] else 0
    return E.s_first[s] + (T.member[k] if E.s_own[s] else 0), k, s


@kernel
def note_records(A, P, S, R):
    """Takes over what the small system has recorded: surfaces are numbered as those of the whole system."""
    T, E = A.patch, A.kind
    for a in range(S.events):
        number, k, s = _number_in_all(A, R.event[a, 0])
        if not E.s_own[s]:  # all elements meet it, some of which come after the others
            if abs(R.event_t[a] - A.noted[s]) <= at_once_within(S.t, A.length[T.member[0]]):
                continue
            A.noted[s] = R.event_t[a]
        A.event_t[A.events], A.event[A.events, 0] = R.event_t[a], number
        for b in range(E.ns):
            A.event_x[A.events, b] = S.x[b * T.total + k]
        for c in range(1, 4):
            A.event[A.events, c] = R.event[a, c]
        A.events += 1
    for a in range(S.ambiguities):
        A.ambiguity_t[A.ambiguities] = R.ambiguity_t[a]
        A.ambiguity[A.ambiguities, 0], _, _ = _number_in_all(A, R.ambiguity[a, 0])
        for c in range(1, 3):
            A.ambiguity[A.ambiguities, c] = R.ambiguity[a, c]
        A.ambiguities += 1
    S.events = S.ambiguities = 0


@kernel
def largest_change(A, C, W, k, t, h):
    """By how much the new polynomials of member k differ from the old ones on the next h, in units of tolerances."""
    T, E = A.patch, A.kind
    i, K, most = T.member[k], C.order, 0.0
    for b in range(E.ns):
        new = W.step.rows[b * T.total + k]
        shifted(A, A.row[i, b], t - A.begun[i], K, A.old)
        total, power, size = 0.0, 1.0, abs(new[0])
        for c in range(K + 1):
            total += abs(new[c] - A.old[c]) * power
            power *= h
        size += abs(new[1]) * h
        change = total / (A.share * (E.atol[b] + C.rtol * size))
        if not change <= most:
            most = change
    return most if most >= 0.0 else math.inf
