"""What the stiff loop is told and what it carries from call to call: plain arrays, no objects.

No compiler is imported here: solve() fills a Core in processes that compile nothing. How the kernels read it
stands in stiff_core.py.
"""

from typing import NamedTuple

# Why the loop returned.
DONE, TERMINAL, FULL, NOT_FINITE, UNDERFLOW, TOO_MANY, EVENT_LOOP, ACCUMULATED = range(8)

# Which method takes the next step, and what the user allows.
RADAU, TAYLOR = 0, 1

# What became of an attempt by Radau, and what it reports (entries of `out`).
ACCEPTED, NOT_CONVERGED, INACCURATE, GATED = range(4)
O_ITERATIONS, O_ETA, O_THETA, O_SIZE, O_GATE, O_AGAIN = range(6)

# Tasks of the Taylor unit.
STEP, REACH_ONLY = 0, 1
# What the events of a step did.
NOTHING, JUMP, STOP, NO_END, LIMIT = range(5)

# Kinds of event: the sign after the zero that counts, or any, or none (events of time).
BOTH, TIMED = 0, 2

# Entries of `num`.
(
    T, T_END, H, H_OLD, GROWTH_OLD, ETA, RTOL, RTOL_TAYLOR, H_MAX, KAPPA, TAKEN, REACH, MARK, LEAST_ADVANCE,
) = range(14)  # fmt: skip
# Entries of `cnt`: settings, then the state of the loop, then counters.
(
    ORDER, K, MODE, MAY_RADAU, MAY_TAYLOR, DENSE_WANTED, PREDICTED, FIRST,
    REJECTED, STIFF_STEPS, ROWS_AT, ROWS_VALID, N_EVAL, STEPS, REJECTIONS, F_EVALS,
    JACOBIANS, NEWTON, TAYLOR_STEPS, STEPS_LEFT, WAIT, N_INSTANT, N_POINTS, N_RECORDS, HAPPENED, SINCE_MARK,
) = range(26)  # fmt: skip


class Doubles:
    """Kind of a pointer to doubles."""


class Integers:
    """Kind of a pointer to integers of 64 bits."""


class Core(NamedTuple):
    """One run: n states, q surfaces (layers), e events; pointers to contiguous arrays."""

    n: int
    q: int
    e: int
    capacity: int  # points that the output holds
    room: int  # event records that it holds
    evals: int  # wanted times
    instants: int
    adr: Integers  # addresses of the generated functions and of the units
    surface_state: Integers  # (q,) state index of a surface that is one, else -1
    surface_row: Integers  # (q,) its row in the Taylor coefficients
    cnt: Integers
    kind: Integers  # (e,) +1, -1: direction that counts; BOTH; TIMED
    stops: Integers  # (e,) 1 for a terminal event, 2 for a singular argument
    remembers: Integers  # (e,) index of the state that keeps the side of the surface, or -1
    due: Integers  # (e,) events of this instant: 1 due, 2 acts in this round, 3 acted before
    met: Integers  # (e,) 1: the motion has come to the surface at this instant, and no jump has taken it off
    degree: Integers  # (capacity,) of the polynomial of the step that ends here
    event_index: Integers  # (room,)
    instant_event: Integers  # (instants,)
    p: Doubles
    atol: Doubles  # (n,)
    num: Doubles
    x: Doubles  # (n,)
    f: Doubles  # (n,) rates at x
    start: Doubles  # (n,) x at the start of the step
    poly: Doubles  # (n, 8) last collocation polynomial, from its end
    rows: Doubles  # (2, n + q, STRIDE) Taylor coefficients, at x and at the end of the step under trial
    power: Doubles  # (n,) vector of the power iteration
    surf: Doubles  # (q, n + 3)
    J: Doubles  # (n, n)
    lu: Doubles  # elimination
    Z: Doubles  # (n, 8) as W, X, F, R
    W: Doubles
    X: Doubles
    F: Doubles
    R: Doubles
    hoisted: Doubles  # (rows, 8)
    values: Doubles  # (max(q, e, 1), 8)
    weight: Doubles  # (n,)
    newton_weight: Doubles  # (n,)
    err: Doubles  # (n,)
    out: Doubles  # (8,) what an attempt reports, see stiff_radau.py
    scratch: Doubles  # (n + 8,)
    scratch2: Doubles  # (n + 8,)
    t8: Doubles
    mu: Doubles  # (8,)
    coefficients: Doubles  # (n, 17) polynomial of the last step, or of every one (capacity, n, 17)
    side: Doubles  # (e,) sign that each surface had last
    found: Doubles  # (e,)
    passed_side: Doubles  # (e,)
    level: Doubles  # (e,) surfaces at an instant
    was: Doubles  # (e,) and before the last update
    rounding: Doubles  # (e,) what the last digits of the states make of them
    fired: Doubles  # (e, 6) rows of intervals.py
    before: Doubles  # (n,)
    after: Doubles  # (n,)
    t: Doubles  # (capacity,)
    states: Doubles  # (capacity, n)
    length: Doubles  # (capacity,) of the step that ends here
    t_eval: Doubles  # (evals,)
    x_eval: Doubles  # (evals, n)
    event_t: Doubles  # (room,)
    event_x: Doubles  # (room, 2, n): before and after
    instant_t: Doubles  # (instants,) ascending


STRIDE = 24
TOO_SHORT = -1.0  # in num[TAKEN]: no step of this length moves the time
