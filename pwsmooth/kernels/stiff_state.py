"""What the stiff loop is told and what it carries from call to call: plain arrays, no objects."""

from typing import NamedTuple

from numba.extending import register_jitable

from pwsmooth.kernels.lanes import doubles, integers

# Why the loop returned.
DONE, TERMINAL, FULL, NOT_FINITE, UNDERFLOW, TOO_MANY, EVENT_LOOP = range(7)

# Which method takes the next step, and what the user allows.
RADAU, TAYLOR = 0, 1

# Tasks of the Taylor unit.
STEP, REACH_ONLY = 0, 1
# What the events of a step did.
NOTHING, JUMP, STOP, NO_END = range(4)

# Kinds of event: the sign after the zero that counts, or any, or none (events of time).
BOTH, TIMED = 0, 2

# Entries of `num`.
T, T_END, H, H_OLD, GROWTH_OLD, ETA, RTOL, RTOL_TAYLOR, H_MAX, KAPPA, TAKEN, REACH = range(12)
# Entries of `cnt`: settings, then the state of the loop, then counters.
(
    ORDER, K, MODE, MAY_RADAU, MAY_TAYLOR, DENSE_WANTED, PREDICTED, FIRST,
    REJECTED, STIFF_STEPS, ROWS_AT, ROWS_VALID, N_EVAL, STEPS, REJECTIONS, F_EVALS,
    JACOBIANS, NEWTON, TAYLOR_STEPS, STEPS_LEFT, WAIT, N_INSTANT, N_POINTS, N_RECORDS, HAPPENED,
) = range(25)  # fmt: skip


class Core(NamedTuple):
    """One run: n states, q surfaces (layers), e events; pointers to contiguous arrays."""

    n: int
    q: int
    e: int
    capacity: int  # points that the output holds
    room: int  # event records that it holds
    evals: int  # wanted times
    instants: int
    adr: object  # addresses of the generated functions and of the units
    surface_state: object  # (q,) state index of a surface that is one, else -1
    surface_row: object  # (q,) its row in the Taylor coefficients
    cnt: object
    kind: object  # (e,) +1, -1: direction that counts; BOTH; TIMED
    stops: object  # (e,) 1 for a terminal event
    due: object  # (e,)
    degree: object  # (capacity,) of the polynomial of the step that ends here
    event_index: object  # (room,)
    instant_event: object  # (instants,)
    p: object
    atol: object  # (n,)
    num: object
    x: object  # (n,)
    f: object  # (n,) rates at x
    start: object  # (n,) x at the start of the step
    poly: object  # (n, 8) last collocation polynomial, from its end
    rows: object  # (2, n + q, STRIDE) Taylor coefficients, at x and at the end of the step under trial
    power: object  # (n,) vector of the power iteration
    surf: object  # (q, n + 3)
    J: object  # (n, n)
    lu: object  # elimination
    Z: object  # (n, 8) as W, X, F, R
    W: object
    X: object
    F: object
    R: object
    hoisted: object  # (rows, 8)
    values: object  # (max(q, e, 1), 8)
    weight: object  # (n,)
    newton_weight: object  # (n,)
    err: object  # (n,)
    scratch: object  # (n + 8,)
    scratch2: object  # (n + 8,)
    t8: object
    mu: object  # (8,)
    coefficients: object  # (n, 17) polynomial of the last step, or of every one (capacity, n, 17)
    side: object  # (e,) sign that each surface had last
    found: object  # (e,)
    passed_side: object  # (e,)
    before: object  # (n,)
    after: object  # (n,)
    t: object  # (capacity,)
    states: object  # (capacity, n)
    length: object  # (capacity,) of the step that ends here
    t_eval: object  # (evals,)
    x_eval: object  # (evals, n)
    event_t: object  # (room,)
    event_x: object  # (room, 2, n): before and after
    instant_t: object  # (instants,) ascending


N_SIZES, N_INTEGERS = 7, 10
STRIDE = 24
TOO_SHORT = -1.0  # in num[TAKEN]: no step of this length moves the time


@register_jitable
def core(places):
    """The Core whose sizes and addresses stand in `places`."""
    return Core(
        places[0], places[1], places[2], places[3], places[4], places[5], places[6], integers(places[7]),
        integers(places[8]), integers(places[9]), integers(places[10]), integers(places[11]),
        integers(places[12]),
        integers(places[13]), integers(places[14]), integers(places[15]), integers(places[16]),
        doubles(places[17]), doubles(places[18]), doubles(places[19]), doubles(places[20]), doubles(places[21]),
        doubles(places[22]), doubles(places[23]), doubles(places[24]), doubles(places[25]), doubles(places[26]),
        doubles(places[27]), doubles(places[28]), doubles(places[29]), doubles(places[30]), doubles(places[31]),
        doubles(places[32]), doubles(places[33]), doubles(places[34]), doubles(places[35]), doubles(places[36]),
        doubles(places[37]), doubles(places[38]), doubles(places[39]), doubles(places[40]), doubles(places[41]),
        doubles(places[42]), doubles(places[43]), doubles(places[44]), doubles(places[45]), doubles(places[46]),
        doubles(places[47]), doubles(places[48]), doubles(places[49]), doubles(places[50]), doubles(places[51]),
        doubles(places[52]), doubles(places[53]), doubles(places[54]), doubles(places[55]), doubles(places[56]),
    )  # fmt: skip
