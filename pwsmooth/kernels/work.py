"""What the parts of a step and of an instant tell each other, and their scratch arrays: one struct a user.

Sizes: n states, m multipliers, ne events, nz layered states; K the order of the polynomials, `width` K + 1 made up to
blocks of eight and one more (state.PAD); `contacts`, `hubs`; `struck` contacts with friction in their pushes, and this;
`rows` of the Taylor programs; `group` the largest group of coupled multipliers.
"""

from .machine.block import Bundle


class Linear(Bundle):
    """Systems with the sparse dg/dmult: see sparse.py."""

    matrix: "f8[group, group + 1 + hubs]"
    schur: "f8[hubs, hubs + 1]"
    border: "f8[m, hubs]"
    rhs: "f8[m + 1]"  # and then the solution
    index: "i8[m + 1]"
    place: "i8[m]"
    linked: "i8[m]"  # multipliers that a residual reaches
    stack: "i8[m]"
    start: "f8[m]"  # multipliers from which a damped step of Newton's goes


class Step(Bundle):
    """The polynomials of a step, and how far they hold."""

    kind: "int"  # SLIP, GENERAL, PAIR or ARC of state.py
    start: "float"  # time
    length: "float"
    stop: "float"  # time beyond which no step goes: the end of the span, or the next instant of a time event
    sliding: "int"  # whether some multiplier is solved for
    held: "int"  # whether some is HELD
    mult_row: "int"  # rows of the first multiplier and, on an arc, of time; -1 for none
    time_row: "int"
    fold: "int"  # switch by whose fold an arc goes, or -1
    toward: "int"  # and in which direction
    singular: "int"  # whether there was no jet
    unsure: "int"  # whether the series may not tell how far they hold
    arcs: "int"  # whether the step could be an arc
    arrives: "int"  # singular argument whose zero the step ends at, or -1
    rests: "int"  # switch that it may come to rest on with others, or -1
    left: "float"  # time from the end of the step to that rest
    refused: "int"  # switch on which the motion does not rest, as has been seen since the last switching, or -1
    nears: "int"  # whether the motion comes to a rest: to what it `atol` is relative then
    per_order: "float"  # 1/K and 1/(K - 1)
    per_order_before: "float"
    rows: "f8[rows, width]"  # Taylor coefficients, zero behind the last block of four orders
    power: "f8[width]"  # powers of the length
    end_power: "f8[width]"  # powers of where the step ends
    x: "f8[n]"  # a look ahead
    mult: "f8[m]"
    atol: "f8[n]"  # absolute tolerances: those asked for, or finer ones
    leader: "int"  # switch whose arcs shrink, and how often it has been met since that was seen
    turns: "int"
    met: "f8[3, n]"  # states at its last switchings, the newest first


class End(Bundle):
    """Where a step ends, and why."""

    length: "float"  # of what is taken of the step
    whole: "int"  # whether that is all of it
    met: "float"  # share of the step at which it ends: what is met beyond is not met
    happened: "int"  # whether that ends the step
    folded: "int"  # or the fold of an arc does
    stopped: "int"  # or the stop
    arrives: "int"  # or a singular argument
    grazes: "int"  # whether surfaces are grazed before
    last_graze: "float"  # share of the step up to which they are recorded
    touched: "int"  # HOPPED, PASSED or LEFT of folds.py, or 0
    touched_at: "float"  # time
    at_clock: "int"  # whether a time event is due


class Roots(Bundle):
    """One polynomial on a step, and its first root: see roots.py."""

    order: "int"  # K
    guess: "float"  # where the root is expected, 0 for no guess
    shallow: "float"  # size against which a dip is shallow, if larger than the value at the start
    dips: "int"  # answer: whether the polynomial grazes zero
    dip_at: "float"  # where
    dip_crosses: "int"  # whether that counts as crossing it
    poly: "f8[width]"  # scaled to [0, 1]
    counting: "f8[width]"  # k, k (k - 1), k (k - 1) (k - 2)
    pairing: "f8[width]"
    tripling: "f8[width]"
    bernstein: "f8[48*width]"
    bernstein_table: "f8[5*width*width]"  # see tables.py
    short_table: "f8[16*width]"
    short_error: "f8[width]"
    short_powers: "f8[16*width]"
    left_half: "f8[width*width]"
    right_half: "f8[5*width*width]"
    near: "f8[width]"  # the polynomial on a part of the step


class Meeting(Bundle):
    """Which surfaces a step meets: see meeting.py."""

    tau: "f8[m + ne]"  # where in the step each surface is met, in [0, 1]; 2 = not met
    exit_side: "i8[m]"  # bound that a solved multiplier runs into
    grazed: "f8[m + ne]"  # where in the step each surface is grazed, in [0, 1]; 2 = not grazed
    graze_crosses: "i8[m + ne]"  # and whether it counts as crossed
    widest: "f8[m + ne]"  # largest |h| of each surface so far
    rounding: "f8[m + ne]"  # what roundings make of each surface on which a step begins
    blur: "f8[m + ne]"  # and by how much more for each unit of time that the step takes
    blurred: "f8[m]"  # |h| of discs next to which 0 is not told from
    rhythm: "f8[3*m + 3*ne + 1, 2]"  # see rhythm.py


class Pair(Bundle):
    """A step of the Runge-Kutta pair: see methods/."""

    next_step: "float"
    longest: "float"  # in a run of Taylor steps
    solves: "int"  # whether it solves for multipliers
    x: "f8[n]"  # at its start
    mult: "f8[m]"
    k: "f8[16, n]"  # its stages
    end: "f8[n]"


class Arc(Bundle):
    """Folds of a multiplier, and the step along one: see step/steps.fold_jet and instant/folds.py."""

    touched: "int"  # switch whose root comes to a fold that is touched
    hop: "float"  # length of a hop over a fold
    x: "f8[n + 1 + m]"  # states of the fold program: states, time, multipliers
    mult: "f8[m + 1]"
    mask: "i8[m + 1]"
    dx: "f8[n + 1 + m]"
    h: "f8[m + 1 + ne]"
    g: "f8[m + 1]"
    G: "f8[fold_entries]"
    dh: "f8[fold_gradients]"
    matrix: "f8[fold_size, fold_size + 1]"
    index: "i8[m + 1]"
    slope: "f8[width]"  # dt/ds along the arc
    there: "f8[n]"  # a state beside the present one, and its multipliers
    mult_there: "f8[m]"
    mult_before: "f8[m]"  # last multipliers that Newton's method has found


class Onset(Bundle):
    """The first step of a slip from rest: see step/onset.py. Its size is n with discs, else 0."""

    stiff: "int"  # explicit steps in a row that were as short as a slip is slow
    wait: "int"  # steps before collocation is tried again
    goes_on: "int"  # whether all slips have begun before
    rests: "int"  # whether the slip begins without acceleration
    solves: "int"  # whether it solves for multipliers
    least: "float"  # length of a step that is worth its cost
    narrow: "int"  # states by which Newton's method knows the slopes
    x: "f8[onset]"  # at its start
    first: "f8[onset]"  # rates there
    as_one: "int"  # whether discs begin to slip that depend on each other
    still: "i8[onset]"  # states that another stick keeps at 0, of which all else is rounding
    mult: "f8[m]"
    level: "f8[m + ne]"  # surfaces there
    times: "f8[8]"  # of the nodes
    lam: "f8[m, 8]"  # multipliers at the nodes
    surfaces: "f8[m + ne, 8]"  # what the model gives there
    residuals: "f8[m, 8]"
    excess: "f8[m]"  # of the force over the friction, at the last node
    nudge: "f8[onset, 8]"  # by which states are moved to see slopes
    goal: "f8[m]"  # surfaces that a guess is to have
    forced: "i8[m]"  # discs that begin to slip and whose lambda acts on them
    slow: "i8[m]"  # discs whose slip has made explicit steps short
    allowed: "f8[m]"  # of lambda . lambda: by how much a force may exceed the friction where a slip has been given up
    slips: "i8[m]"  # discs that slip
    size: "f8[m]"  # their |h| at a node
    columns: "i8[onset]"  # those states
    y: "f8[onset, 8]"  # states at the nodes
    k: "f8[onset, 8]"  # rates
    slope: "f8[onset, onset, 8]"  # their derivatives by the states
    matrix: "f8[8*onset, 8*onset + 8]"  # of Newton's method, by columns, then its inverse; its rows' order
    inverse: "f8[m, 3]"  # of dG/dlambda of each disc at the start, in the rows of its components
    rest: "f8[8*onset]"  # its right-hand side
    found: "f8[8*onset]"  # and solution
    change: "f8[onset, 8]"  # by which all states at the nodes change
    sums: "f8[8]"  # integrals of a rate up to the nodes


class Together(Bundle):
    """Multipliers whose surfaces depend on each other: see surface/dependent.py, sharing.py. Its size is that of all
    discs and of switches that act on each other."""

    size: "int"  # of the group
    rank: "int"  # how many of its components determine the others
    comp: "i8[joint]"  # its components
    known: "i8[m]"  # whether a multiplier has been looked at for it
    ball: "i8[joint]"  # the disc whose they are, or the switch that they are
    order: "i8[joint]"  # places in the group, those first that determine the others
    late: "i8[joint]"  # whether these are rather among the others
    free: "i8[joint]"  # whether they may move: they slip, or their share of the load is the largest
    move: "f8[m]"  # h of discs that begin to move as one body, to a common factor; 0 of others
    g: "f8[joint]"
    J: "f8[joint, joint]"  # dG/dlambda
    left: "f8[joint, joint]"  # of it, behind some pivots
    lam: "f8[joint]"
    kept: "f8[joint]"  # multipliers before
    strength: "f8[joint]"
    goal: "f8[joint]"
    push: "f8[joint]"  # what is dual to G = 0 where the load is least
    held: "f8[joint]"  # and to the bound of each ball
    matrix: "f8[3*joint + 1, 3*joint + 2]"


class Layer(Bundle):
    """A run of the layer: see layer.py."""

    masked: "int"  # whether it solves the multipliers of every instant along
    pace: "float"  # factor of its time, in which its fastest rate is of size 1
    pair: "f8[2]"  # u and lambda, of the sigmoid and its inverse
    value: "f8[2]"
    z: "f8[nz]"
    q: "f8[nz]"
    y: "f8[m + nz]"  # its state
    new: "f8[m + nz]"
    k: "f8[7, m + nz]"
    status: "i8[m]"  # where it began
    mult: "f8[m]"


class Contacts(Bundle):
    """Contacts that touch, and their impulses: see contacts.py."""

    touching: "i8[contacts]"
    chosen: "i8[contacts]"
    speed: "f8[contacts]"
    at_rest: "f8[contacts]"
    load: "f8[contacts]"
    impulse: "f8[contacts]"
    together: "f8[contacts]"  # speeds after the impulses
    rebound: "float"  # speed after that of one alone
    push: "f8[m]"  # impulses of the instant, and the lambda of the friction in them
    pushed: "f8[m]"  # impulses of which that lambda is the mean
    delassus: "f8[contacts, contacts]"
    pivots: "f8[contacts, contacts + 1]"
    solved: "f8[n]"  # state after impulses with friction
    first: "f8[n]"  # state before all, and before and after a rebound
    before: "f8[n]"
    after: "f8[n]"


class Struck(Bundle):
    """What an impact strikes: contacts, then friction; see impacts.py. Its size is 0 without friction."""

    contacts: "int"  # how many, and with the multipliers of friction
    size: "int"
    member: "i8[struck]"
    mode: "i8[struck]"  # whether a contact pushes; 0 of friction that sticks, the side of a switch, or 1, of what slips
    aim: "f8[struck]"  # speeds of the contacts after
    unit: "f8[struck]"  # sizes of impulses and lambda
    value: "f8[struck]"  # these
    kept: "f8[struck]"
    slip: "f8[struck]"  # what lambda changes of a slip
    rest: "f8[struck]"  # residuals, and those a step ahead
    ahead: "f8[struck]"
    matrix: "f8[struck, 2*struck + 1]"  # their slopes, and the products of its rows
    met: "i8[m]"
    mult: "f8[m]"  # before
    x: "f8[n]"


class Firing(Bundle):
    """Events of an instant: see firing.py."""

    last: "f8[ne, 7]"  # as State.last, for the firings of the events
    jumped: "int"  # these are as kernels/firing.py says
    due: "i8[ne]"
    met: "i8[ne]"
    carried: "i8[ne]"
    left: "i8[ne]"
    level: "f8[ne]"
    was: "f8[ne]"
    rounding: "f8[ne]"
    slack: "f8[ne]"  # what the rounding of the instant itself makes of them
    before: "f8[n]"  # state before and after their updates
    after: "f8[n]"
    arrived: "f8[n]"  # state with which the instant begins
    read: "f8[m]"  # the multipliers that they read
    switch_level: "f8[m]"  # the switches' surfaces before the first update; nan for none
    added: "i8[n]"  # states that they add to, and that they set
    was_set: "i8[n]"
    rule: "i8[n]"  # of Problem.rule
    keeps: "int"  # whether some state keeps at this instant what it was set to
    kept: "i8[n]"  # whether this one does
    value: "f8[n]"  # to what they are set, and what is added
    sum: "f8[n]"
    trial: "f8[n]"
    shifted: "f8[n]"


class Instant(Bundle):
    """What happens at an instant: see instants.py."""

    met: "float"  # where in the step the instant is
    elapsed: "float"  # since the last instant
    fold: "int"  # switch that stands at its fold, or -1
    way: "int"  # direction of time along its root there
    folds: "i8[m]"  # the same of switches that stand at their folds beside that one, of others 0
    at_clock: "int"  # whether a time event is due
    jumped: "int"  # whether the states have jumped
    together: "int"  # whether several coupled switches arrive
    solved_there: "int"  # whether the solved multipliers are those of the state left behind
    look_again: "int"  # whether a contact may be moved by what happens after it
    rests: "int"  # switch on whose surface the motion may come to rest now, or -1
    released: "int"  # whether switches that were held have just been let go
    unsettled: "int"  # whether those that may come to rest are looked at once what holds the motion is known
    rest_speed: "float"  # size at which an approach speed is rounding
    parting: (
        "int"  # how many derivatives of surfaces vanish from which switches part that are HELD; 0 if none does
    )
    drift: "f8[m]"  # the next ones, to a common factor
    hit: "b1[m + ne]"  # met
    stood: "f8[m + ne]"  # the surfaces before something at this instant may have moved them
    waits: "i8[m]"  # of a switch that is met 1 until it is settled, 2 if others are first, with which its surface jumps
    came: "i8[m]"  # status before the instant
    active: "i8[m]"  # switches that are settled
    faint: "i8[m]"  # whether they may have no strength
    weak: "i8[m]"  # those of them that have none
    kept: "i8[2, m]"  # these, while discs are, and the status of all before
    arrival: "i8[m]"  # side of arrival of the active ones
    group: "i8[m]"  # those whose layers are settled together
    status: "i8[m]"  # kept over another look
    before: "i8[m]"  # kept over another sweep
    mult: "f8[m]"
    gradient: "f8[n]"
    x: "f8[n]"  # before the motion is put to rest
    dx: "f8[n]"


class Work(Bundle):
    """All of them, and what the model's functions gave last."""

    dx: "f8[n]"
    size: "f8[n]"  # the largest that each state has been at an instant
    terms: "f8[n]"  # what the terms of each rate add up to, whatever cancels
    up: "f8[n]"  # the rates where all that they are made of is a little larger
    sizes: "f8[n]"  # of the states, with what their terms come to
    shifted_x: "f8[n]"  # states and multipliers, moved by a small part of themselves
    shifted_mult: "f8[m]"
    h: "f8[m + ne]"
    g: "f8[m]"
    G: "f8[entries]"  # entries of the sparse dg/dmult
    dh: "f8[gradients]"  # of the surfaces: sparse gradients, (m + ne) slopes in time, sizes of unknowns
    mask: "i8[m]"  # multipliers that are solved for
    disc: "f8[4, 6]"  # small matrices of a disc
    moment: "f8[n + m + 1]"  # states, multipliers and time while a moment later is looked at
    closing_t: "float"  # see step/closing.py
    closing_x: "f8[n]"
    closing_mult: "f8[m]"
    closing_end: "f8[m]"
    closing_y: "f8[5 + n]"
    closing_new: "f8[5 + n]"
    closing_look: "f8[5 + n]"
    closing_k: "f8[16, 5 + n]"
    broken: "int"  # multiplier whose invariant does not hold: invariants.py
    linear: Linear
    step: Step
    end: End
    roots: Roots
    meeting: Meeting
    pair: Pair
    arc: Arc
    onset: Onset
    together: Together
    layer: Layer
    contacts: Contacts
    struck: Struck
    firing: Firing
    instant: Instant
