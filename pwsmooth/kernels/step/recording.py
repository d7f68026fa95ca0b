"""Writing what happened into the Record buffers."""

from ..intervals import time_size
from ..machine.compiling import inlined_kernel, kernel
from ..machine.lanes import load8, store8
from ..state import (
    AMB_GRAZING,
    ARC,
    HELD,
    SOLVED,
    START,
    TAPE_BOUND,
    TAPE_CLOCK,
    TAPE_FOLD,
    TAPE_MEET,
    TAPE_NODE,
    TAPE_NOTHING,
    TAPE_POINT,
    TAPE_STEP,
    TAPE_SURFACE,
)
from ..surface.sliding import INSIDE
from ..surface.vector import begins
from .collocation import NODES, STAGES
from .steps import dot, powers, surface_rows

_AT_ONCE, _LEVEL = 1e-13, 1e-9  # of the time, and of a surface's bend on the step: no way and no slope
_LAST_MOMENTS = 256  # pieces of dense output that those of a slip in a disc may leave: closing.py


@inlined_kernel
def has_room(P, R, S):
    """Whether the buffers can take another step with all that may happen at its end."""
    pieces = 1 if P.discs == 0 else _LAST_MOMENTS
    return (
        S.points + 8 < R.t.shape[0]
        and S.events + R.most_events < R.event_t.shape[0]
        and S.ambiguities + R.most_unsure < R.ambiguity_t.shape[0]
        and (R.dense.shape[0] == 0 or S.pieces + pieces < R.dense.shape[0])
        and (
            R.tape.shape[0] == 0 or S.taped + 5 * S.last.shape[0] + 6 * S.side.shape[0] + 256 < R.tape.shape[0]
        )
    )


@kernel
def put_on_tape(P, S, R, kind, first, second, third, length):
    """Writes where the run stands, and what it does there, for kernels/tangent."""
    k, n, m = S.taped, P.n, P.m
    tape, values = R.tape[k], R.tape_x[k]
    tape[0], tape[1], tape[2], tape[3] = kind, first, second, third
    values[0], values[1] = S.t, length
    for i in range(n):
        values[2 + i] = S.x[i]
    for j in range(m):
        tape[4 + j] = S.status[j]
        values[2 + n + j] = S.mult[j]
    S.taped += 1


@kernel
def put_step_on_tape(P, S, R, W):
    """A step, with the number of its polynomials, if they are kept."""
    step = W.step
    if step.time_row < 0:
        put_on_tape(P, S, R, TAPE_STEP, step.kind, S.pieces - 1, 0, W.end.length)
        if step.kind == START:
            _put_nodes_on_tape(P, S, R, W)
    else:
        put_on_tape(P, S, R, TAPE_STEP, ARC, step.fold, step.toward, W.end.length)
        for j in range(P.m + 1):
            R.tape_x[S.taped - 1, 2 + P.n + P.m + j] = W.arc.mult[j]


@kernel
def _put_nodes_on_tape(P, S, R, W):
    """The states and multipliers at the nodes of the collocation that has just been put there."""
    k, n = S.taped - 1, P.n
    R.tape_x[k, 2 + n + P.m] = W.step.length
    for j in range(P.m):
        if begins(P, S, j):
            R.tape_x[k, 2 + n + j] = INSIDE  # at the start lambda is what its components say
    for q in range(STAGES):
        put_on_tape(P, S, R, TAPE_NODE, 0, 0, 0, 0.0)
        for i in range(n):
            R.tape_x[S.taped - 1, 2 + i] = W.onset.y[i, q]
        for j in range(P.m):
            if S.status[j] == SOLVED:
                row, value = W.step.rows[W.step.mult_row + j], 0.0
                for c in range(STAGES, -1, -1):
                    value = value * NODES[q] * W.step.length + row[c]
                R.tape_x[S.taped - 1, 2 + n + j] = value


@kernel
def _leaves_from_rest(P, S, W, i):
    """Whether the motion, which has rested on surface i, leaves it at this instant without speed: no zero of it."""
    r = surface_rows(P, W.step.kind)[i]
    still = r >= 0 and W.instant.elapsed <= _AT_ONCE * time_size(S)
    return still and abs(W.step.rows[r, 1]) <= _LEVEL * W.step.length * abs(W.step.rows[r, 2])


@kernel
def put_causes_on_tape(P, C, S, R, W):
    """What the instant that begins is the zero of."""
    instant, some = W.instant, W.instant.fold >= 0
    if some:
        put_on_tape(P, S, R, TAPE_MEET, TAPE_FOLD, instant.fold, 0, 0.0)
    for i in range(P.m if some else 0):
        if instant.folds[i] != 0:
            put_on_tape(P, S, R, TAPE_MEET, TAPE_FOLD, i, 0, 0.0)
    for i in range(P.m + P.ne):
        if instant.hit[i] and not (S.deflate[i] != 0 and _leaves_from_rest(P, S, W, i)):
            at_bound = i < P.m and S.status[i] == SOLVED
            put_on_tape(P, S, R, TAPE_MEET, TAPE_BOUND if at_bound else TAPE_SURFACE, i, 0, 0.0)
            some = True
    tick = S.ticks
    while instant.at_clock and tick < len(C.clock) and C.clock[tick] <= S.t:
        if C.clock_event[tick] < P.ne:  # a switch is met as its surface is
            put_on_tape(P, S, R, TAPE_MEET, TAPE_CLOCK, tick, 0, 0.0)
            some = True
        tick += 1
    if not some:
        put_on_tape(P, S, R, TAPE_MEET, TAPE_NOTHING, 0, 0, 0.0)


@inlined_kernel
def record_point(P, S, R):
    if R.tape.shape[0] > 0:
        put_on_tape(P, S, R, TAPE_POINT, 0, 0, 0, 0.0)
    i = S.points
    R.t[i] = S.t
    for k in range(P.n):
        R.x[i, k] = S.x[k]
    for j in range(P.m):
        R.mult[i, j] = S.mult[j]
        R.status[i, j] = S.status[j] if S.status[j] != HELD else SOLVED  # at 0 both
    S.points += 1


@kernel
def record_event(S, R, index, kind, came, went):
    i = S.events
    R.event_t[i] = S.t
    R.event[i, 0] = index
    R.event[i, 1] = kind
    R.event[i, 2] = came
    R.event[i, 3] = went
    S.events += 1


@kernel
def record_ambiguity(S, R, index, kind, taken):
    i = S.ambiguities
    for k in range(i - 1, -1, -1):
        if R.ambiguity_t[k] != S.t:
            break
        if R.ambiguity[k, 0] == index and R.ambiguity[k, 1] == kind and R.ambiguity[k, 2] == taken:
            return  # said at another look at this instant
    R.ambiguity_t[i] = S.t
    R.ambiguity[i, 0] = index
    R.ambiguity[i, 1] = kind
    R.ambiguity[i, 2] = taken
    S.ambiguities += 1


@kernel
def sample(P, C, S, R, t_new, W):
    """Fills the asked-for instants inside the step just made, which ends at t_new."""
    m, K, rows, h, power = P.m, C.order, W.step.rows, W.end.length, W.step.end_power
    mult_row, time_row = W.step.mult_row, W.step.time_row
    while S.samples < R.t_eval.shape[0] and R.t_eval[S.samples] <= t_new:
        i = S.samples
        s = R.t_eval[i] - S.t
        if time_row >= 0:
            # Along a multiplier's arc: invert t(s), monotone, by Newton inside [0, h].
            want = R.t_eval[i]
            lo, hi = 0.0, h
            s = 0.5 * h
            for _ in range(100):
                powers(power, s)
                value = dot(rows[time_row], power, K + 1) - want
                if value > 0.0:
                    hi = s
                else:
                    lo = s
                slope = 0.0
                for k in range(K, 0, -1):
                    slope = slope * s + k * rows[time_row, k]
                new = s - value / slope if slope > 0.0 else 0.5 * (lo + hi)
                if not lo <= new <= hi:
                    new = 0.5 * (lo + hi)
                if abs(new - s) <= 1e-16:
                    break
                s = new
        powers(power, s)
        for k in range(P.n):
            R.x_eval[i, k] = dot(rows[k], power, K + 1)
        for j in range(m):
            solved = S.status[j] == SOLVED
            R.mult_eval[i, j] = dot(rows[mult_row + j], power, K + 1) if solved else S.mult[j]
        S.samples += 1


@inlined_kernel
def _copy_row(row, kept, K):
    """Orders 0 to K, of which there are eight at least."""
    for k in range(0, K - 7, 8):
        store8(kept, k, load8(row, k))
    store8(kept, K - 7, load8(row, K - 7))


@kernel
def keep_dense(P, C, S, R, W):
    """Stores the step's polynomials: states, multipliers, time."""
    i, K, rows = S.pieces, C.order, W.step.rows
    mult_row, time_row = W.step.mult_row, W.step.time_row
    block = R.dense[i]
    for k in range(P.n):
        _copy_row(rows[k], block[k], K)
    for j in range(P.m):
        if S.status[j] == SOLVED:
            _copy_row(rows[mult_row + j], block[P.n + j], K)
        else:
            block[P.n + j, :] = 0.0
            block[P.n + j, 0] = S.mult[j]
    if block.shape[0] == P.n + P.m:  # kept for a tape alone, which knows the times
        pass
    elif time_row >= 0:
        _copy_row(rows[time_row], block[P.n + P.m], K)
    else:
        block[P.n + P.m, :] = 0.0
        block[P.n + P.m, 0] = S.t
        block[P.n + P.m, 1] = 1.0
    R.dense_s[i] = W.end.length
    S.pieces += 1


@kernel
def record_grazes(P, C, S, R, W):
    """Records every surface grazed in the step up to its end; leaves S.t at one of them."""
    t0, rows, time_row = S.t, W.step.rows, W.step.time_row
    for j in range(P.m + P.ne):
        if W.meeting.grazed[j] <= W.end.last_graze:
            s = W.meeting.grazed[j] * W.step.length
            S.t = t0 + s
            if time_row >= 0:
                powers(W.step.end_power, s)
                S.t = dot(rows[time_row], W.step.end_power, C.order + 1)
            record_ambiguity(S, R, j, AMB_GRAZING, W.meeting.graze_crosses[j])
