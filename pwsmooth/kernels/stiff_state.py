"""What the stiff loop is told and what it carries from call to call: plain arrays, no objects."""

from typing import NamedTuple

import numpy as np

# Why the loop returned.
DONE, TERMINAL, FULL, NOT_FINITE, UNDERFLOW, TOO_MANY, EVENT_LOOP = range(7)

# Which method takes the next step, and what the user allows.
RADAU, TAYLOR = 0, 1

# Kinds of event: the sign after the zero that counts, or any, or none (events of time).
BOTH, TIMED = 0, 2

# Entries of `num`.
T, T_END, H, H_OLD, GROWTH_OLD, ETA, RTOL, RTOL_TAYLOR, H_MAX, KAPPA, TAKEN = range(11)
# Entries of `cnt`: settings, then the state of the loop, then counters.
(ORDER, K, MODE, MAY_RADAU, MAY_TAYLOR, DENSE_WANTED, PREDICTED, FIRST, REJECTED, STIFF_STEPS, ROWS_AT, ROWS_VALID,
 N_EVAL, STEPS, REJECTIONS, F_EVALS, JACOBIANS, NEWTON, TAYLOR_STEPS, STEPS_LEFT, WAIT, N_INSTANT) = range(22)  # fmt: skip


class Run(NamedTuple):
    """One run. n states, q surfaces (layers), e events; all arrays contiguous."""

    n: int
    q: int
    e: int
    adr: np.ndarray  # addresses of the generated functions
    p: np.ndarray
    atol: np.ndarray  # (n,)
    surface_state: np.ndarray  # (q,) state index of a surface that is one, else -1
    surface_row: np.ndarray  # (q,) its row in the Taylor coefficients
    num: np.ndarray
    cnt: np.ndarray
    x: np.ndarray  # (n,)
    f: np.ndarray  # (n,) rates at x
    poly: np.ndarray  # (n, 8) last collocation polynomial, from its end
    rows: np.ndarray  # (2, n + q, STRIDE) Taylor coefficients, at x and at the end of the step under trial
    power: np.ndarray  # (n,) vector of the power iteration
    surf: np.ndarray  # (q, n + 3)
    J: np.ndarray  # (n, n)
    lu: np.ndarray  # elimination
    lanes: np.ndarray  # (5, n, 8): Z, W, X, F, R
    hoisted: np.ndarray  # (rows, 8)
    values: np.ndarray  # (max(q, e, 1), 8)
    work: np.ndarray  # (8, n + 8)
    coefficients: np.ndarray  # (n, 17) polynomial of the last step, where it is needed
    kind: np.ndarray  # (e,) +1, -1: direction that counts; BOTH; TIMED
    stops: np.ndarray  # (e,) 1 for a terminal event
    due: np.ndarray  # (e,)
    watched: np.ndarray  # (3, e): side, found, side after the step
    jump: np.ndarray  # (2, n): state before and after an event


class Output(NamedTuple):
    """Buffers of one call; `count` = (points written, event records written)."""

    t: np.ndarray  # (capacity,)
    x: np.ndarray  # (capacity, n)
    length: np.ndarray  # (capacity,) of the step that ends here
    degree: np.ndarray  # (capacity,) of its polynomial
    coefficients: np.ndarray  # (capacity, n, 17) of powers of (t - start)/length; empty unless dense
    count: np.ndarray
    t_eval: np.ndarray
    x_eval: np.ndarray
    event_t: np.ndarray
    event_index: np.ndarray
    event_x: np.ndarray  # (events, 2, n): before and after
    instant_t: np.ndarray  # instants of the events of time, ascending
    instant_event: np.ndarray


class Core(NamedTuple):
    """The arrays of a Run as pointers: what the steps work on."""

    n: int
    q: int
    e: int
    adr: object
    p: object
    atol: object
    surface_state: object
    surface_row: object
    num: object
    cnt: object
    x: object
    f: object
    poly: object
    rows: object
    power: object
    surf: object
    J: object
    lu: object
    Z: object
    W: object
    X: object
    F: object
    R: object
    hoisted: object
    values: object
    weight: object
    newton_weight: object
    err: object
    start: object
    scratch: object
    scratch2: object
    t8: object
    mu: object
    coefficients: object
    kind: object
    stops: object
    due: object
    side: object
    found: object
    passed_side: object
    before: object
    after: object


STRIDE = 24
