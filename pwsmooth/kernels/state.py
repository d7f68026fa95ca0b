"""What the compiled trajectory loop is told and what it carries from call to call: plain numbers, no objects."""

from .machine.block import Bundle

# Kinds of multiplier (order of pwsmooth.definition.model: a switch's regularity, then the other kinds). That of a disc
# is lambda . lambda while it sticks and 1 while it slips; its components follow it.
SLIDING, KINK, CROSSING, SECOND_ORDER, DISC, CONTACT, ALGEBRAIC, COMPONENT = range(8)

# In `at_zero` beside a value: conditions say different things, as definition/model.py; none says anything; `act` tells.
BOTH, ANY, BY_ACT = 2, 3, 4

# Status of a multiplier: +1 or -1 fixed (a contact: +1 open), SOLVED, or HELD with what it has: another one keeps its
# surface at 0, or an accumulation has left it there.
SOLVED, HELD = 0, 2

# In `deflate` of what is HELD: its friction has no strength yet, and grows; it is settled a moment later.
GROWS = 9

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
    AMB_NEAR_MISS,
    AMB_INDETERMINATE,
    AMB_FORCES,
    AMB_AT_ZERO,
) = range(15)

# Kinds of step: the jet with all multipliers fixed, or some solved; the Runge-Kutta pair; an arc by a fold; the first
# one of a slip in a disc, and its last moments.
SLIP, GENERAL, PAIR, ARC, START, CLOSING = range(6)

# Entries of a tape (step/recording.py, kernels/tangent): a step, and the nodes of one by collocation; a recorded point;
# what an instant is the zero of (a surface, the bound of a multiplier, a fold, a tick of the clock, something else,
# nothing new); an update that acts, and the end of its round; the end of the run.
TAPE_STEP, TAPE_POINT, TAPE_MEET, TAPE_ACT, TAPE_ROUND, TAPE_NODE, TAPE_END = range(7)
TAPE_SURFACE, TAPE_BOUND, TAPE_FOLD, TAPE_CLOCK, TAPE_OTHER, TAPE_NOTHING = range(6)

# Events of an instant (firing.py). In `due`:
DUE, ACTS, ACTED = 1, 2, 3
# In `carried`: no surface; a singular argument, which fires nothing; an event; a switch kept as a memory of its side.
TIMED, SILENT, PLAIN, ALWAYS = -1, 0, 1, 2
# `terminal` of an event that no record tells of: a sample of a drive.
UNRECORDED = 2
# In `rule`, as in definition/primitives.py.
ADD, SET = 1, 2
# In `left`.
OFF, THROUGH = 1, 2
MOST_AT_ONCE = 60  # events without progress in time before the run says that they do not converge

# What a part of the loop returns that ends no run: this is done, go on; an instant has been settled, begin the next
# step; nothing was to be done here. What is less is the Outcome of the run. OUT_OF_MEMORY says that the buffers are
# full: the caller gives larger ones, or ends it there.
GO_ON, AGAIN, NOTHING = 2, 3, 4
BROKEN = -99  # an invariant does not hold: invariants.py, and W.broken says of which multiplier


class Problem(Bundle):
    """One model with its parameters, as the kernels see it."""

    fields: "int"  # addresses of generated functions
    fields8: "int"  # at the nodes of a collocation step, 0 where only one after the other
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
    fold_row: "i8[m + 2]"  # g_row and g_col of the fold program
    fold_col: "i8[:]"
    root_unit: "int"  # addresses of the compiled units (compiling.py)
    newton_unit: "int"
    layer_unit: "int"
    others_unit: "int"
    fold_unit: "int"
    onset_unit: "int"
    step_unit: "int"  # a method of one step (step/methods/); 0 where no step can need it
    look_slip: (
        "int"  # 1: the last Taylor coefficients may not tell how far they hold: the end of a step is looked at
    )
    look_general: "int"
    pair: "int"  # 1: the pair makes every step; 0: only those that have no Taylor series
    instant_unit: "int"
    approach_unit: "int"
    watches: "int"  # 1: some event is a singular argument
    n: "int"
    memories: "int"  # of the states, the last ones: what they are set to has no rounding
    m: "int"
    ne: "int"
    nz: "int"
    p: "f8[:]"
    kind: "i8[m]"
    discs: "int"  # how many
    dim: "i8[m]"  # components of a disc, 0 for what is none
    disc_of: "i8[m]"  # multiplier of the disc whose component it is, -1 for what is none
    hidden: "i8[m]"  # the residual is nonlinear in its own multiplier
    slope_moves: "i8[m]"  # a sliding switch, not hidden, whose dg/dlambda can change its sign
    g_row: "i8[m + 1]"  # rows of the sparse dg/dmult: which multipliers stand in a residual; see sparse.py
    g_col: "i8[:]"  # ascending in each row, the diagonal always among them
    g_diagonal: "i8[m]"  # where
    block_row: "i8[blocks + 1]"  # multipliers in groups that couple only through the hubs
    block_member: "i8[:]"
    hub: "i8[:]"  # multipliers that couple many groups
    link_row: "i8[m + 1]"  # the same pattern and its transpose together, without the diagonal
    link_col: "i8[:]"
    contact: "i8[:]"  # the contacts among the multipliers
    dh_row: "i8[m + ne + 1]"  # rows of the sparse gradients of the surfaces
    dh_col: "i8[:]"
    inner: "int"  # 1: unknowns stand in some surface
    unknowns: "i8[m + ne]"  # behind these and the slopes in time: where a surface's size in unknowns is, or -1
    nested: "i8[m + ne]"  # another multiplier stands in the surface, which jumps when that one switches
    at_zero: (
        "i8[m]"  # of a switch that is only crossed: its value where its surface stays at 0, or one of the above
    )
    wave: "i8[m + ne]"  # the surface is a sine of what moves, of size 1 whatever the states are
    surface_state: "i8[m]"  # index of the state that is the surface, or -1
    holder: "i8[n]"  # the multiplier that keeps a state at 0 while it is solved for, or -1
    direction: "i8[ne]"
    rule: "i8[ne]"  # ADD, SET, or 0
    terminal: "i8[ne]"
    watch: "i8[ne]"  # what there is at a singular argument (singular.py), 0 for an event of the user's
    watch_state: "i8[ne]"  # index of the state that it is, or -1
    twin: "i8[ne]"  # the event's surface is that of switch j up to a factor: j + 1 with its sign; else 0
    rows_slip: "i8[m + ne]"  # row of each surface
    rows_general: "i8[m + ne]"
    rows_fold: "i8[m + ne]"
    rows_pair: "i8[m + ne]"
    flat_slip: "i8[:]"  # rows of the arguments of functions that are flat far from 0: steps.keep_in_sight
    flat_general: "i8[:]"
    flat_fold: "i8[:]"
    mult_row: "int"
    fold_bias: "f8[:]"  # parameters of the fold program: p, then the m entries of c and the statuses
    sigmoid: "int"  # fields of Sigmoid.model()
    weight: "f8[m]"  # eps_1 / eps_j
    slip_share: "f8[m]"  # of the largest static friction that slip has; 0 where there are no two levels
    ratio: "f8[nz]"  # eps / time constant of the layered states; 0 = two-stage


class Control(Bundle):
    """Tolerances and bounds of one run."""

    order: "int"
    rtol: "float"
    atol: "f8[n]"
    max_step: "float"
    t_end: "float"
    max_steps: "int"
    strict: "int"
    clock: "f8[:]"  # sorted instants of the time events
    clock_event: "i8[:]"  # their events, and behind these the switches that cross at known instants
    clock_side: "i8[:]"  # of such a switch its side at the start, of others 0; empty where there is none


class State(Bundle):
    """What the loop carries from call to call; every field is overwritten."""

    t: "float"
    step: "float"  # length of the last one
    unit: "float"  # of time, for tolerances near t = 0: the length of the run, at most 1
    x: "f8[n]"
    mult: "f8[m]"
    status: "i8[m]"
    deflate: "i8[m + ne]"  # known zero orders of the surfaces at the step's start
    side: "i8[ne]"  # sign of each event surface
    last: "f8[m, 7]"  # rows of intervals.py
    arcs: "f8[m, 2]"  # how far the last way between two meetings has led from a surface, and the farthest of them since
    # their intervals shrink
    steps: "int"  # counts, since the start or since the caller has emptied the buffers
    jets: "int"
    layers: "int"
    events: "int"
    points: "int"
    pieces: "int"  # of the dense output
    ambiguities: "int"
    ticks: "int"  # instants of the clock that are over
    taped: "int"  # entries of the tape
    samples: "int"  # of the wanted times
    stalled: "int"  # instants in succession without progress in time
    minute: "int"  # crossings in succession between which the motion has stayed within its tolerance
    started: "int"


PAD = 8  # zeros behind the coefficients of a row: loops run in blocks of eight, and known zeros are dropped by a shift


class Record(Bundle):
    """Buffers of what happened; the caller empties them between calls."""

    t: "f8[room]"
    x: "f8[room, n]"
    mult: "f8[room, m]"
    status: "i1[room, m]"
    most_events: "int"  # that may be recorded at the end of a step: `room` rows have as many more of events
    most_unsure: "int"
    event_t: "f8[events]"
    event: "i8[events, 4]"  # surface index, kind, from, to
    push: "f8[pushes, m]"  # of events that are impacts: Contacts.push; without rows where there are no contacts
    ambiguity_t: "f8[unsure]"
    ambiguity: "i8[unsure, 3]"  # multiplier, kind, taken
    dense: (
        "f8[pieces, polynomials, order + 1]"  # states, multipliers, time (not for a tape alone), in powers of s
    )
    dense_s: "f8[pieces]"  # length of the step in s
    tape: "i8[tapes, 4 + m]"  # kind of entry, three numbers of it, the statuses
    tape_x: "f8[tapes, 3 + n + 2*m]"  # time, length, states, multipliers; their rates along an arc, or the whole step
    t_eval: "f8[times]"
    x_eval: "f8[times, n]"
    mult_eval: "f8[times, m]"
