"""What the stiff loop is told and what it carries from call to call: plain numbers, no objects.

No compiler is imported here: solve() fills a Core in processes that compile nothing.
"""

from ..machine.block import Bundle

# Which method takes the next step, and what the user allows.
RADAU, TAYLOR = 0, 1

# What became of an attempt by Radau.
ACCEPTED, NOT_CONVERGED, INACCURATE, GATED = range(4)

# Tasks of the Taylor unit.
STEP, REACH_ONLY = 0, 1

STRIDE = 24
TOO_SHORT = -1.0  # in `taken`: no step of this length moves the time


class Core(Bundle):
    """One run: n states, q surfaces (layers), e events; what the caller says, what the loop carries, and scratch."""

    n: "int"
    q: "int"
    e: "int"
    entries: "int"  # of J
    reads: "int"  # states that surfaces of events read
    groups: "int"  # of states, no two of which stand in one event's surface
    rows_length: "int"  # of `rows`: numbers of one expansion
    capacity: "int"  # points that the output holds
    room: "int"  # event records that it holds
    evals: "int"  # wanted times
    instants: "int"  # of the events of time
    order: "int"  # of Radau IIA: 5, 9 or 13 as 0, 1 or 2
    taylor_order: "int"
    may_radau: "int"
    may_taylor: "int"
    dense: "int"  # 1: the polynomial of every step is kept
    t_end: "float"
    unit: "float"  # min(1, length of the run): time_size in intervals.py
    rtol: "float"  # of Radau
    rtol_taylor: "float"
    h_max: "float"
    kappa: "float"  # rest of Newton's iteration, in units of the tolerance
    least_advance: "float"  # of time, in as many attempts as tell a stall
    t: "float"
    h: "float"  # of the next attempt; 0: found by the loop
    h_old: "float"  # of the last step, whose polynomial is `poly`
    taken: "float"  # length of the last step; nan for a coefficient that is, or TOO_SHORT
    growth_old: "float"  # by which the last error would have let the step grow
    eta: "float"  # rest of Newton's iteration after an increment, in units of it
    reach: "float"  # length of the Taylor step from x
    mark: "float"  # when the time was last seen to advance
    mode: "int"  # RADAU or TAYLOR
    first: "int"  # 1: no step yet since a start or a jump; 2: nor anything else
    predicted: "int"  # 1: `poly` predicts the next stages
    rejected: "int"  # 1: the last attempt was
    stiff_steps: "int"  # in succession by Taylor
    wait: "int"  # steps before Taylor is asked again
    rows_at: "int"  # which of the two `rows` is the expansion at x
    rows_valid: "int"  # 1: it is there
    since_mark: "int"  # attempts
    steps_left: "int"  # attempts
    ticks: "int"  # instants that are over
    samples: "int"  # wanted times that are over
    points: "int"  # of the output, since the caller has emptied it
    records: "int"  # of events, likewise
    steps: "int"  # counts since the start
    rejections: "int"
    f_evals: "int"
    jacobians: "int"
    newton: "int"
    taylor_steps: "int"
    iterations: "float"  # of Newton in the last attempt by Radau: generated code writes doubles
    theta: "float"  # rate of their convergence
    error: "float"  # in units of the tolerance
    again: "float"  # 1: its estimate was filtered once more
    gate: "float"  # by which the gate shrinks the step, or 0
    adr: "i8*[:]"  # addresses of the generated functions and of the units
    surface_state: "i8*[q]"  # state index of a surface that is one, else -1
    surface_row: "i8*[q]"  # its row in the Taylor coefficients
    slope_first: (
        "i8*[q + 1]"  # where the gradient of each surface begins in `slope_state`, and in `surf` behind 3 q
    )
    slope_state: "i8*[:]"  # the states that it has entries of
    J_row: "i8*[entries]"  # of each entry of J; rows and columns beyond the states are those of sums
    J_column: "i8*[entries]"
    elimination: "i8*[:]"  # the plan of sparse.py, where no code eliminates
    confirming: "int"  # steps in succession that were made once more, up to a zero
    doubted: "float"  # length of the first of these
    jumped: "int"  # from here to `left` as kernels/firing.py says
    read: "i8*[:]"  # these states
    group: "i8*[n]"  # of every state
    direction: "i8*[e]"
    carried: "i8*[e]"
    due: "i8*[e]"
    met: "i8*[e]"
    left: "i8*[e]"
    stops: "i8*[e]"  # 1 for an event that ends the run
    remembers: "i8*[e]"  # index of the state that keeps the side of the surface, or -1
    at_rest: "i8*[e]"  # event whose update says what that state is where the surface stays at 0, or -1
    degree: "i8*[capacity]"  # of the polynomial of the step that ends here
    event_index: "i8*[room]"
    instant_event: "i8*[instants]"
    p: "f8*[:]"  # parameters
    atol: "f8*[n]"
    x: "f8*[n]"
    f: "f8*[n]"  # rates at x
    start: "f8*[n]"  # x at the start of the step
    poly: "f8*[n, 8]"  # last collocation polynomial, from its end
    rows: "f8*[2, rows_length]"  # Taylor coefficients, at x and at the end of the step under trial
    power: "f8*[n]"  # vector of the power iteration
    surf: "f8*[layers]"  # of every surface h, dh/dt at fixed x, eps; then the entries of their gradients
    J: "f8*[entries]"
    lu: "f8*[eliminated]"  # eliminations of (mu/h) I - J, as the generated code or sparse.py orders them
    Z: "f8*[n, 8]"  # as W, X, F, R
    W: "f8*[n, 8]"
    X: "f8*[n, 8]"
    F: "f8*[n, 8]"
    R: "f8*[n, 8]"
    hoisted: "f8*[hoisted, 8]"
    values: "f8*[most, 8]"  # of surfaces or events
    weight: "f8*[n]"
    newton_weight: "f8*[n]"
    err: "f8*[n]"
    scratch: "f8*[n + 8]"
    scratch2: "f8*[n + 8]"
    t8: "f8*[8]"  # times of the stages
    mu: "f8*[8]"  # eigenvalues over h
    coefficients: "f8*[kept, n, 17]"  # polynomial of the last step, or of every one
    side: "f8*[e]"  # sign that each surface had last
    found: "f8*[e]"
    passed_side: "f8*[e]"
    level: "f8*[e]"  # surfaces at an instant
    was: "f8*[e]"  # and before the last update
    rounding: "f8*[e]"  # what the last digits of the states make of them
    postponed: "i8*[e]"  # what is due behind the switches of time alone
    slack: "f8*[e]"  # and what the rounding of the instant does
    fired: "f8*[e, 7]"  # rows of intervals.py
    before: "f8*[n]"
    after: "f8*[n]"
    times: "f8*[capacity]"  # of the points
    states: "f8*[capacity, n]"
    length: "f8*[capacity]"  # of the step that ends here
    t_eval: "f8*[evals]"
    x_eval: "f8*[evals, n]"
    event_t: "f8*[room]"
    event_x: "f8*[room, 2, n]"  # before and after
    instant_t: "f8*[instants]"  # ascending
