"""What the replay of a tape is told and what it carries from call to call.

Sizes: n states, m multipliers, np parameters; `wide` columns, of which the last block of eight holds the time: at an
instant a deviation is one of (x, p, t). An array of `entries` has rows (kind, row, column, place, whether constant) of
codegen/jacobian.py.
"""

from ..machine.block import Bundle

# Kinds of entries at a point (codegen/jacobian.py): rates, residuals, surfaces, speeds of gaps, by states, multipliers,
# parameters, time.
BY_X, BY_MULT, BY_P = range(3)
F_X, F_MULT, F_P, G_X, G_MULT, G_P, G_T, H_X, H_MULT, H_P, H_T, S_X, S_P, S_T = range(14)

ZEROS = 8  # orders before order 0 of a series of deviations

# Why an instant, or a step, has no derivative.
FINE, GRAZES, CORNER, UNKNOWN, NO_SERIES = range(5)


class Flow(Bundle):
    """Entries of the linearised flow in a Taylor program, by rows: the rates, then the residuals of the multipliers."""

    jet: "int"
    reads: "i8[:]"  # rows that stand there for it
    own: "int"  # first row of what the program keeps for itself
    residuals: "int"
    first: "i8*[:]"
    what: "i8*[:]"  # by a state, a multiplier or a parameter
    index: "i8*[:]"  # which; of a parameter the place of its deviations
    place: "i8*[:]"  # of the entry's series in the rows
    moves: "i8*[:]"  # 0: only its order 0
    same: "i8*[:]"  # of a rate the residual that it is, or -1
    by_mult: "i8[:, 3]"  # the entries of residuals by multipliers: row, column, place
    # What `plan` of flow.py makes of them: how many unknowns, and the place of each; equations and their terms.
    solved: "i8*[:]"
    count: "i8*[:]"
    # Of each where its series is written, its place among the unknowns, the ends of its four kinds of terms.
    equations: "i8*[:]"
    term_at: "i8*[:]"
    term_row: "i8*[:]"


class Tangent(Bundle):
    """The linearised model, the deviations where the tape has been read to, and what is asked for of them."""

    slip: Flow
    general: Flow
    fold: Flow
    jacobian: "int"
    act_slopes: "int"
    entries_point: "i8[:, 5]"
    write_first: "i8[:]"  # of every update the first of its writes
    write_state: "i8[:]"  # the state that one writes, and whether it adds
    write_adds: "i8[:]"
    tape: "i8[:, :]"  # step/recording.py
    tape_x: "f8[:, :]"
    columns: "int"  # without the time's
    given: "int"  # whether the run has kept its polynomials
    lanes: "int"  # of how many columns at once the programs make series on these, 1 or 8; 0 where flow.py makes them
    dense: "f8[:, :, :]"  # of each step: states, multipliers, time
    binomials: "f8*[:]"  # i over k in rows i
    order: "int"
    tolerance: "float"
    seeds: "f8*[np, wide]"  # deviations of the parameters
    clock: "f8[:, wide]"  # of the instants of the clock
    scale: "f8[wide]"  # size of what each column deviates, 0 if it has none
    instant: "float"  # times that differ by less are one
    read: "int"  # entries of the tape that have been read
    # The deviations, and those of an instant: at its own time, and before a round of updates.
    w: "f8[n, wide]"
    event: "f8[n, wide]"
    before: "f8[n, wide]"
    met_w: "f8[n, wide]"  # before the first of them
    lam: "f8[m, wide]"
    dt: "f8[wide]"
    other_dt: "f8[wide]"
    sizes: "f8[wide]"
    rates: "f8[n]"
    off: "f8[wide]"  # what leads out of the surfaces that hold the start
    inside: "int"  # whether the instant that has begun is not over
    met: "int"  # entry of the tape at which it began
    acted: "int"
    fresh: "int"  # whether the next update begins a round
    first_point: "int"
    why: "int"  # FINE, or why it has no derivative
    cause: "int"
    # An arc whose end has not been looked at: deviations and rates of (x, t) along it.
    on_arc: "int"
    arc_w: "f8[all, wide]"  # and lambda
    arc_rates: "f8[all]"
    # Discs (discs.py): the last moments of a slip, and the step that begins one.
    passes: "int"  # whether it does not come to rest
    closing_t: "float"
    closing_size: "float"
    closing_pace: "float"
    closing_x: "f8[n]"
    closing_ft: "f8[n]"
    closing_y: "f8[moments]"
    closing_new: "f8[moments]"
    closing_k: "f8[13, moments]"
    closing_b: "f8[3, wide]"
    closing_f: "f8[n, wide]"
    closing_g: "f8[m, wide]"
    closing_others: "f8[unknowns, wide]"
    nodes: "f8[node_rows, node_columns]"
    # Scratch.
    jac: "f8[:]"
    slopes: "f8[:]"
    rows: "f8[rows, width]"
    rows_flat: "f8*[:]"  # the same
    series: "f8*[series]"  # of one block of columns: states and multipliers, orders, eight columns
    sums: "f8*[sums]"
    # What such programs read: behind states, multipliers and parameters what they deviate by.
    column_x: "f8*[16*n]"
    column_mult: "f8*[16*m]"
    column_p: "f8*[16*np]"
    column_rows: "f8*[8*columned]"
    unknown: "i8*[unknowns + 1]"  # place of a multiplier among those that are solved for, or -1
    matrix: "f8[unknowns, twice]"
    held: "f8[closed, wider]"
    x: "f8[all]"
    mult: "f8[all]"
    mask: "i8[all]"
    bias: "f8[:]"
    power: "f8[width]"
    # What is asked for.
    place: "f8[room]"  # of wanted times on a way, and how many; on an arc the rates of the states over that of time
    wanted: "int"
    pace: "f8[room, all]"
    kept: "f8[all, wide]"
    points: "int"
    pending: "int"  # the first point whose deviations the end of the instant tells
    at_point: "f8[:, :, :]"  # states and multipliers
    samples: "int"
    first_sample: "int"  # of those in at_sample
    t_eval: "f8[:]"
    at_sample: "f8[:, :, :]"
    instants: "int"
    instant_t: "f8[:]"
    instant_why: "i8[:, 2]"
    instant_dt: "f8[:, :]"
    instant_w: "f8[:, :, :]"  # of the state at the instant's own time, before it and after it
    # Of a frame (growth.py): the unit that plays a tape, ends of its factors, logarithms of what they make it grow by.
    replay: "int"
    factors: "int"
    grown_t: "f8[:]"
    grown: "f8[:, :]"
    # Of a cost (reverse.py): its slopes by the state where the tape has been read back to, by parameters (rows of their
    # seeds), by instants of the clock; by states and multipliers at t_eval, of which the first `cost` are left; by the
    # state before and after an instant and by its time, of which the first `cost_events` are left.
    backward: "int"
    slope: "f8[n]"
    parameters: "int"
    slope_q: "f8*[np, wide]"  # and a copy
    slope_clock: "f8[:]"
    normal: "f8[wide]"  # of each column what has been put into one more, behind that of the clock
    cost: "int"
    cost_slope: "f8[:, :]"
    cost_events: "int"
    cost_entry: "i8[:]"
    cost_instant: "f8[:, :]"
    back: "f8*[series]"  # orders K to 0 of all series
    bad: "int"  # entry of the first instant without derivative, and why
    bad_why: "int"
    bad_cause: "int"
