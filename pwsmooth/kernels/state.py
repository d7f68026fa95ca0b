"""What the compiled trajectory loop is told and what it carries from call to call: plain numbers, no objects."""

from typing import NamedTuple

import numpy as np

# Kinds of multiplier (order of pwsmooth.model: a switch's regularity, then the other two kinds).
SLIDING, KINK, CROSSING, CONTACT, ALGEBRAIC = range(5)

# Status of a multiplier: +1 or -1 fixed (a contact: +1 open), SOLVED, or HELD at 0 after an accumulation.
SOLVED, HELD = 0, 2

# What happened at an instant.
(
    EV_CROSSING,
    EV_STICK,
    EV_TANGENCY,
    EV_FOLD,
    EV_FOLD_TO_SLIDING,
    EV_EVENT,
    EV_IMPACT,
    EV_CLOSED,
    EV_OPENING,
    EV_ACCUMULATION,
    EV_RESET,
) = range(11)

# Records of non-uniqueness.
(AMB_REPELLING, AMB_SEVERAL_ROOTS, AMB_TWO_FOLD, AMB_CORNER, AMB_GRAZING, AMB_HIDDEN_OSCILLATION) = range(6)

# Why the loop returned.
(
    DONE,
    TERMINAL,
    FULL,
    NOT_FINITE,
    UNDERFLOW,
    CHATTERING,
    NO_ROOT_FOUND,
    HIDDEN_OSCILLATION,
    MAX_STEPS,
    STRICT,
    NEWTON_FAILED,
    DETERMINACY_LOST,
) = range(12)


class Problem(NamedTuple):
    """One model with its parameters, as the kernels see it."""

    fields: int  # addresses of generated functions
    linear: int
    act: int
    layer: int
    jet_slip: int
    jet_general: int
    jet_fold: int  # the same along the arc of a multiplier (see folds.py), 0 where no fold can occur
    fields_fold: int
    linear_fold: int
    n: int
    m: int
    ne: int
    nz: int
    p: np.ndarray
    kind: np.ndarray  # (m,)
    hidden: np.ndarray  # (m,) the residual is nonlinear in its own multiplier
    coupled: np.ndarray  # (m, m) residual i depends on multiplier j
    surface_state: np.ndarray  # (m,) index of the state that is the surface, or -1
    direction: np.ndarray  # (ne,)
    terminal: np.ndarray  # (ne,)
    rows_slip: np.ndarray  # (m + ne,) row of each surface
    rows_general: np.ndarray
    rows_fold: np.ndarray
    mult_row: int
    fold_bias: np.ndarray  # parameters of the fold program: p, then the m entries of c
    sigmoid: int
    weight: np.ndarray  # (m,) eps_1 / eps_j
    ratio: np.ndarray  # (nz,) eps / time constant of the layered states; 0 = two-stage


class Control(NamedTuple):
    """Tolerances and bounds of one run."""

    order: int
    rtol: float
    atol: np.ndarray  # (n,)
    max_step: float
    t_end: float
    max_steps: int
    strict: int
    clock: np.ndarray  # sorted instants of the time events
    clock_event: np.ndarray  # their events


class State(NamedTuple):
    """What the loop carries from call to call; every array is overwritten."""

    now: np.ndarray  # t, last step size
    x: np.ndarray  # (n,)
    mult: np.ndarray  # (m,)
    status: np.ndarray  # (m,) int64
    deflate: np.ndarray  # (m + ne,) known zero orders of the surfaces at the step's start
    side: np.ndarray  # (ne,) sign of each event surface
    counts: np.ndarray  # int64: see the C_ names
    last: np.ndarray  # (m, 4) time last met, interval before it, ratio of the last two intervals, and the one before


(C_STEPS, C_EVENTS, C_POINTS, C_DENSE, C_AMBIGUITIES, C_CLOCK, C_EVAL, C_STALLED, C_JETS, C_LAYERS, C_STARTED) = range(11)
N_COUNTS = 11


class Record(NamedTuple):
    """Buffers of what happened; the caller empties them between calls."""

    t: np.ndarray  # (cap,)
    x: np.ndarray  # (cap, n)
    mult: np.ndarray  # (cap, m)
    status: np.ndarray  # (cap, m) int8
    event_t: np.ndarray
    event: np.ndarray  # (cap, 4) int64: surface index, kind, from, to
    ambiguity_t: np.ndarray
    ambiguity: np.ndarray  # (cap, 3) int64: multiplier, kind, taken
    dense: np.ndarray  # (cap or 0, n + m + 1, order + 1): states, multipliers, time, in powers of s
    dense_s: np.ndarray  # (cap or 0,) length of the step in s
    t_eval: np.ndarray
    x_eval: np.ndarray  # (len(t_eval), n)
    mult_eval: np.ndarray  # (len(t_eval), m)


class Work(NamedTuple):
    """Scratch arrays, overwritten by everybody."""

    dx: np.ndarray
    h: np.ndarray
    g: np.ndarray
    G: np.ndarray
    dh: np.ndarray
    mask: np.ndarray  # (m,) int64
    rows: np.ndarray  # (rows, order + 4) Taylor coefficients
    power: np.ndarray  # (order + 4,) powers of the step
    poly: np.ndarray  # (order + 4,) one scaled polynomial
    bernstein: np.ndarray
    z: np.ndarray  # (nz,)
    q: np.ndarray  # (nz,)
    fold_x: np.ndarray  # states of the fold program
    fold_mult: np.ndarray
    fold_mask: np.ndarray
    fold_slope: np.ndarray  # (order + 4,) dt/ds along a fold step
    code: np.ndarray  # int64: return code of a helper; multiplier at its fold or -1; direction there
    tau: np.ndarray  # (m + ne,) where in the step each surface is met, in [0, 1]; 2 = not met
    exit_side: np.ndarray  # (m,) bound that a solved multiplier runs into
    hit: np.ndarray  # (m + ne,) met at this instant
    before: np.ndarray  # (n,)
    after: np.ndarray  # (n,)
    active: np.ndarray  # (m,)
    arrival: np.ndarray  # (m,) side of arrival of the active switches
