"""What the compiled trajectory loop is told and what it carries from call to call: plain numbers, no objects."""

from .block import Bundle

# Kinds of multiplier (order of pwsmooth.model: a switch's regularity, then the other two kinds).
SLIDING, KINK, CROSSING, SECOND_ORDER, CONTACT, ALGEBRAIC = range(6)

# Status of a multiplier: +1 or -1 fixed (a contact: +1 open), SOLVED, or HELD with what it has: another one keeps its
# surface at 0, or an accumulation has left it there.
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
    EV_REST,
    EV_SINGULAR,
) = range(13)

# Records of non-uniqueness.
(
    AMB_REPELLING,
    AMB_SEVERAL_ROOTS,
    AMB_TWO_FOLD,
    AMB_CORNER,
    AMB_GRAZING,
    AMB_HIDDEN_OSCILLATION,
    AMB_FOLD,
    AMB_IMPACTS,
    AMB_UPDATES,
    AMB_ACCUMULATION,
    AMB_CHATTERING,
) = range(11)

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
    ACCUMULATED,
    BROKEN,  # an invariant does not hold: invariants.py, and W.touched says of which multiplier
    SINGULAR_POINT,
) = range(15)


class Problem(Bundle):
    """One model with its parameters, as the kernels see it."""

    fields: "int"  # addresses of generated functions
    linear: "int"
    act: "int"
    layer: "int"
    jet_slip: "int"
    jet_general: "int"
    jet_fold: "int"  # the same along the arc of a multiplier (see folds.py), 0 where no fold can occur
    own_slip: "int"  # first row of each program's own, behind the rows of all
    own_general: "int"
    own_fold: "int"
    fields_fold: "int"
    linear_fold: "int"
    fold_row: "i8[1]"  # g_row and g_col of the fold program
    fold_col: "i8[1]"
    root_unit: "int"  # addresses of the compiled units (compiling.py)
    newton_unit: "int"
    layer_unit: "int"
    fold_unit: "int"
    rk_unit: "int"  # 0 where no step can need the Runge-Kutta pair
    flat: "int"  # 1: a function that no Taylor coefficient foretells (exp, erf): the end of a step is looked at
    pair: "int"  # 1: the pair makes every step; 0: only those that have no Taylor series
    start_unit: "int"
    instant_unit: "int"
    approach_unit: "int"
    watches: "int"  # 1: some event is a singular argument
    n: "int"
    m: "int"
    ne: "int"
    nz: "int"
    p: "f8[1]"
    kind: "i8[1]"  # (m,)
    hidden: "i8[1]"  # (m,) the residual is nonlinear in its own multiplier
    slope_moves: "i8[1]"  # (m,) a sliding switch, not hidden, whose dg/dlambda can change its sign
    g_row: "i8[1]"  # (m + 1,) rows of the sparse dg/dmult: which multipliers stand in a residual; see sparse.py
    g_col: "i8[1]"  # ascending in each row, the diagonal always among them
    g_diagonal: "i8[1]"  # (m,) where
    block_row: "i8[1]"  # (blocks + 1,) multipliers in groups that couple only through the hubs
    block_member: "i8[1]"
    hub: "i8[1]"  # multipliers that couple many groups
    link_row: "i8[1]"  # (m + 1,) the same pattern and its transpose together, without the diagonal
    link_col: "i8[1]"
    contact: "i8[1]"  # the contacts among the multipliers
    dh_row: "i8[1]"  # (m + ne + 1,) rows of the sparse gradients of the surfaces
    dh_col: "i8[1]"
    nested: "i8[1]"  # (m,) another multiplier stands in the surface, which jumps when that one switches
    surface_state: "i8[1]"  # (m,) index of the state that is the surface, or -1
    direction: "i8[1]"  # (ne,)
    terminal: "i8[1]"  # (ne,)
    watch: "i8[1]"  # (ne,) what there is at a singular argument (singular.py), 0 for an event of the user's
    watch_state: "i8[1]"  # (ne,) index of the state that it is, or -1
    twin: (
        "i8[1]"  # (ne,) the event's surface is that of switch j up to a factor: j + 1 with its sign; 0: of none
    )
    rows_slip: "i8[1]"  # (m + ne,) row of each surface
    rows_general: "i8[1]"
    rows_fold: "i8[1]"
    rows_pair: "i8[1]"
    flat_slip: "i8[1]"  # rows of the arguments of functions that are flat far from 0: steps.keep_in_sight
    flat_general: "i8[1]"
    flat_fold: "i8[1]"
    mult_row: "int"
    fold_bias: "f8[1]"  # parameters of the fold program: p, then the m entries of c
    sigmoid: "int"
    weight: "f8[1]"  # (m,) eps_1 / eps_j
    ratio: "f8[1]"  # (nz,) eps / time constant of the layered states; 0 = two-stage


class Control(Bundle):
    """Tolerances and bounds of one run."""

    order: "int"
    rtol: "float"
    atol: "f8[1]"  # (n,)
    max_step: "float"
    t_end: "float"
    max_steps: "int"
    strict: "int"
    clock: "f8[1]"  # sorted instants of the time events
    clock_event: "i8[1]"  # their events


class State(Bundle):
    """What the loop carries from call to call; every field is overwritten."""

    t: "float"
    step: "float"  # length of the last one
    x: "f8[1]"  # (n,)
    mult: "f8[1]"  # (m,)
    status: "i8[1]"  # (m,) int64
    deflate: "i8[1]"  # (m + ne,) known zero orders of the surfaces at the step's start
    side: "i8[1]"  # (ne,) sign of each event surface
    last: "f8[2]"  # (m, 6) rows of intervals.py
    steps: "int"  # counts, since the start or since the caller has emptied the buffers
    jets: "int"
    layers: "int"
    events: "int"
    points: "int"
    pieces: "int"  # of the dense output
    ambiguities: "int"
    ticks: "int"  # instants of the clock that are over
    samples: "int"  # of the wanted times
    stalled: "int"  # instants in succession without progress in time
    minute: "int"  # crossings in succession between which the motion has stayed within its tolerance
    started: "int"


MOST_AT_ONCE = 60  # events without progress in time before the run says that they do not converge

PAD = 8  # zeros behind the coefficients of a row: loops run in blocks of eight, and known zeros are dropped by a shift


class Record(Bundle):
    """Buffers of what happened; the caller empties them between calls."""

    t: "f8[1]"  # (cap,)
    x: "f8[2]"  # (cap, n)
    mult: "f8[2]"  # (cap, m)
    status: "i1[2]"  # (cap, m) int8
    event_t: "f8[1]"
    event: "i8[2]"  # (cap, 4) int64: surface index, kind, from, to
    ambiguity_t: "f8[1]"
    ambiguity: "i8[2]"  # (cap, 3) int64: multiplier, kind, taken
    dense: "f8[3]"  # (cap or 0, n + m + 1, order + 1): states, multipliers, time, in powers of s
    dense_s: "f8[1]"  # (cap or 0,) length of the step in s
    t_eval: "f8[1]"
    x_eval: "f8[2]"  # (len(t_eval), n)
    mult_eval: "f8[2]"  # (len(t_eval), m)


class Work(Bundle):
    """What the parts of a step and of an instant tell each other, and scratch arrays, overwritten by everybody."""

    met: "float"  # where in the step the first surface is met
    length: "float"  # of the step
    elapsed: "float"  # since the last instant
    hop: "float"  # length of a hop over a fold
    guess: "float"  # where the next root is expected
    next_step: "float"  # of the Runge-Kutta pair
    longest: "float"  # step of the pair in a run of Taylor steps
    shallow: "float"  # size of a surface so far, against which a dip is shallow
    rest_speed: "float"  # size at which an approach speed is rounding
    pace: "float"  # factor of the layer's time, in which its fastest rate is of size 1
    dips: "int"  # whether the polynomial at hand grazes zero
    dip_at: "float"  # where
    dip_crosses: "int"  # whether that counts as crossing it
    touched: "int"  # switch whose root comes to a fold that is touched
    fold: "int"  # switch that stands at its fold at this instant, or -1
    way: "int"  # direction of time along its root there
    masked: "int"  # whether a layer solves the multipliers of every instant along
    at_clock: "int"  # whether a time event is due
    jumped: "int"  # whether the states have jumped at this instant
    together: "int"  # whether several coupled switches arrive at this instant
    pair_solves: "int"  # whether the Runge-Kutta pair solves for multipliers
    solved_there: "int"  # whether the solved multipliers are those of the state left behind
    look_again: "int"  # whether a contact at this instant may be moved by what happens after it
    rows_kind: "int"  # kind of the step's polynomials
    arrives: "int"  # singular argument whose zero the step ends at, or -1
    order: "int"  # of the polynomials
    per_order: "float"  # 1/order and 1/(order - 1)
    per_order_before: "float"
    dx: "f8[1]"
    h: "f8[1]"
    g: "f8[1]"
    G: "f8[1]"  # entries of the sparse dg/dmult
    dh: "f8[1]"  # entries of the sparse gradients of the surfaces, then (m + ne) derivatives by time
    place: "i8[1]"  # (m,) scratch of sparse.py
    border: "f8[2]"  # (m, hubs)
    mask: "i8[1]"  # (m,) int64
    rows: "f8[2]"  # (rows, order + PAD) Taylor coefficients, zero behind the last block of four orders
    power: "f8[1]"  # (order + PAD,) powers of the step
    end_power: "f8[1]"  # (order + PAD,) powers of where the step ends
    rhythm: "f8[2]"  # (3 (m + ne) + 1, 2) see rhythm.py
    poly: "f8[1]"  # (order + PAD,) one scaled polynomial
    counting: "f8[1]"  # (order + PAD,) k
    pairing: "f8[1]"  # (order + PAD,) k (k - 1)
    tripling: "f8[1]"  # (order + PAD,) k (k - 1) (k - 2)
    bernstein: "f8[1]"
    bernstein_table: "f8[1]"  # see tables.py
    short_table: "f8[1]"
    short_error: "f8[1]"
    short_powers: "f8[1]"
    near: "f8[1]"  # (order + PAD,) one polynomial on a part of the step
    left_half: "f8[1]"
    right_half: "f8[1]"
    z: "f8[1]"  # (nz,)
    q: "f8[1]"  # (nz,)
    fold_x: "f8[1]"  # states of the fold program
    fold_mult: "f8[1]"
    fold_mask: "i8[1]"
    fold_slope: "f8[1]"  # (order + PAD,) dt/ds along a fold step
    widest: "f8[1]"  # (m + ne,) largest |h| of each surface so far
    grazed: "f8[1]"  # (m,) where in the step each surface is grazed, in [0, 1]; 2 = not grazed
    graze_crosses: "i8[1]"  # (m,) and whether it counts as crossed
    tau: "f8[1]"  # (m + ne,) where in the step each surface is met, in [0, 1]; 2 = not met
    exit_side: "i8[1]"  # (m,) bound that a solved multiplier runs into
    hit: "b1[1]"  # (m + ne,) met at this instant
    arrived: "f8[1]"  # (n,) the state with which an instant begins
    before: "f8[1]"  # (n,)
    after: "f8[1]"  # (n,)
    active: "i8[1]"  # (m,)
    arrival: "i8[1]"  # (m,) side of arrival of the active switches
    group: "i8[1]"  # (m,) switches whose layers are settled together
    came: "i8[1]"  # (m,) status before the instant
    keep_status: "i8[1]"  # (m,)
    keep_mult: "f8[1]"  # (m,)
    rk_x: "f8[1]"  # (n,) a Runge-Kutta step's start
    rk_mult: "f8[1]"  # (m,)
    rk_k: "f8[2]"  # (16, n) its stages
    rest_status: "i8[1]"  # (m,)
    rest_mult: "f8[1]"  # (m,)
    linked: "i8[1]"  # (m,) see sparse.link
    stack: "i8[1]"  # (m,)
    touching: "i8[1]"  # (contacts,) see contacts.py
    chosen: "i8[1]"
    speed: "f8[1]"
    at_rest: "f8[1]"
    load: "f8[1]"
    impulse: "f8[1]"
    restitution: "f8[1]"
    sequel: "f8[1]"
    delassus: "f8[2]"  # (contacts, contacts)
    pivots: "f8[2]"  # (contacts, contacts + 1)
    fold_dx: "f8[1]"
    fold_h: "f8[1]"
    fold_g: "f8[1]"
    fold_G: "f8[1]"
    fold_dh: "f8[1]"
    matrix: "f8[2]"  # (size of a group, the same and one a hub), at least (m + 1, m + 1) where there are folds
    schur: "f8[2]"  # (hubs, hubs + 1)
    vector: "f8[1]"  # (m + 1,)
    index: "i8[1]"  # (m + 1,)
    layer_y: "f8[1]"  # (m + nz,) state of a layer run
    layer_new: "f8[1]"
    layer_k: "f8[2]"  # (7, m + nz)
    gradient: "f8[1]"  # (n,)
    fired: "f8[2]"  # (ne, 6) as State.last, for the firings of the events
    pending: "i8[1]"  # (ne,) events of this instant: 1 pending, 2 fired
    firing: "i8[1]"  # (ne,) those that act on the same values
    added: "i8[1]"  # (n,) states that they add to, and that they set
    was_set: "i8[1]"
    trial: "f8[1]"  # (n,)
    shifted: "f8[1]"  # (n,)
