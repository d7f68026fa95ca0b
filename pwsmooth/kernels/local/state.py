"""What a run of a family knows of each of its elements, and of the patch that it works on.

Sizes: `elements`; an element's states ns, multipliers nm, events ne, of which nt at given times, and parameters np;
nr neighbours that its rates read, of whose states they read `nx`; `kept` elements of which more is kept, at `times`;
`width` of a row; `parts` that threads work on (parts.py), each of which has an Assembly of its own, on the arrays of
all.
"""

from ..machine.block import Bundle

# Codes beside those of state.py: a patch reaches beyond its part; parts are of no use.
ELSEWHERE, WITHOUT_PARTS = 5, 6


class Kind(Bundle):
    """One element: what state.Problem says of all, block by block of the template."""

    ns: "int"
    nm: "int"
    ne: "int"
    np: "int"
    nr: "int"
    walls: "int"  # 1: nothing that others read of an element depends on its neighbours while it sticks
    rows_slip: "int"  # blocks of rows of elements in the programs, and rows of the whole
    rows_general: "int"
    fixed_slip: "int"
    fixed_general: "int"
    # Numbers of the surfaces, block by block: those of the whole before it, blocks of elements before it, whether every
    # element has its own, and the first among all surfaces of the whole system.
    s_fixed: "i8[nm + ne]"
    s_blocks: "i8[nm + ne]"
    s_own: "i8[nm + ne]"
    s_first: "i8[nm + ne]"
    memories: "int"  # of the states, the last ones
    fixed_m: "int"  # multipliers of the whole, and blocks of those of elements
    blocks_m: "int"
    together: "int"  # 1: what events of an element do depends on others, or acts on them
    timed: "i8[nt]"  # events at given times
    at_first: "i8[nt + 1]"
    at: "f8[:]"  # instants of those that have them one by one
    target: "i8[:]"  # columns of the neighbours that events and impacts write
    read: "i8[nx]"  # states that neighbours read
    kind: "i8[nm]"
    hidden: "i8[nm]"
    slope_moves: "i8[nm]"
    at_zero: "i8[nm]"
    nested: "i8[nm + ne]"
    wave: "i8[nm + ne]"
    surface_state: "i8[nm]"
    g_first: "i8[nm + 1]"
    g_block: "i8[:]"
    g_near: "i8[:]"  # in which neighbour: a column of `near`, -1 for the element itself
    link_first: "i8[nm + 1]"
    link_block: "i8[:]"
    link_near: "i8[:]"
    group_first: "i8[:]"
    group_block: "i8[:]"
    dh_first: "i8[nm + ne + 1]"
    dh_block: "i8[:]"
    dh_near: "i8[:]"
    contact: "i8[:]"  # blocks of contacts
    between: "i8[:]"  # of what may hold neighbours together: contacts, friction
    felt: "i8[:]"  # blocks of friction between neighbours, and before its places among the parameters
    felt_fixed: "int"  # numbers of the whole
    felt_blocks: "int"  # blocks of elements
    coupled: "i8[:]"  # blocks of multipliers of which those of neighbours act on each other
    reads_between: "int"  # 1: surfaces read neighbours
    acts_between: "int"  # 1: and what happens there acts on states
    surface_slip: "i8[nm + ne]"  # blocks of elements before the surface's row, -1 where it has none
    surface_general: "i8[nm + ne]"
    of_slip: "i8[nm + ne]"  # rows of the whole before it
    of_general: "i8[nm + ne]"
    own_slip: "i8[nm + ne]"  # whether every element has its own
    own_general: "i8[nm + ne]"
    flat_slip: (
        "i8[:]"  # rows of the arguments of flat functions: blocks before each, rows of the whole, own or not
    )
    flat_general: "i8[:]"
    flat_of_slip: "i8[:]"
    flat_of_general: "i8[:]"
    flat_own_slip: "i8[:]"
    flat_own_general: "i8[:]"
    direction: "i8[ne]"
    rule: "i8[ne]"
    terminal: "i8[ne]"
    twin: "i8[ne]"
    carried: "i8[ne]"
    atol: "f8[ns]"
    p_fixed: "i8[np]"  # where the parameters stand: numbers of the whole before a block, and blocks of elements
    p_blocks: "i8[np]"
    shared_fixed: "i8[:]"
    shared_blocks: "i8[:]"
    shared: "f8[:]"


class Queue(Bundle):
    """Elements by the time of their next event: a binary heap of each part, and of the border behind them."""

    part: "i1[elements]"
    first: "i8[parts + 1]"  # where in the lists of elements those of a part begin
    size: "i8[parts + 1]"
    heap: "i4[elements]"
    place: "i4[elements]"  # -1 for what is not in it
    key: "f8[elements]"


class Patch(Bundle):
    """The elements that are renewed together, and those whose motion they read."""

    stamp: "int"  # no other patch has it, of whichever part
    stride: "int"  # to the next stamp
    count: "int"  # members
    total: "int"  # with those that are read
    shaped: "i8[2]"  # numbers for which the arrays of the small problem are made
    member: "i4[elements]"  # the members, then those that are read
    mark: "i4[elements]"  # twice the stamp: a member; one more: it is read
    slot: "i4[elements]"
    near: "f8[near_places]"  # tables of the programs
    number: "f8[most]"
    cell: "i8[cells, 4]"  # address, number, so many for each member, and for each place
    depth: "i8[2, 128]"  # how far events (expiries) reached lately, by the exponent of the time that is left
    easy: "i8[2, 128]"  # times in succession that it was more than enough
    most: "int"  # members and places for which there is room
    needs: "int"  # and for which there is to be
    why: "int"  # it is renewed
    kept: "int"  # 1: its instant is over, its polynomials are still to come, once there is room for them
    beyond: "int"  # 1: it would have members that are none of the part's


class Assembly(Bundle):
    """A run over all elements."""

    kind: Kind
    queue: Queue
    patch: Patch
    phase: "int"  # 0: nothing is known yet; 1: slabs end; 2: events inside of one
    t: "float"
    t_end: "float"
    unit: "float"  # of the small systems' State
    now: "float"  # up to where all motions are known
    halts: "int"  # 1: to end there
    slab_begin: "float"
    slab_end: "float"
    slab: "float"  # length
    share: "float"  # of the tolerances, by which the rim of a patch may change
    alone: "int"  # 1: no element reads another one
    due: "int"  # so many renewed in all, and the run comes back to look at the clock
    # ---- parts
    parts: "int"
    seat: "int"  # the part whose events this Assembly works off; `parts`: the border, and all that is between parts
    own: "int"  # the part of which alone members may be, -1: any
    task: "int"  # of the parts
    limit: "float"  # before which they work off events
    orders: "int"  # given to the threads
    unit_of_parts: "int"  # address
    crew: "i8[parts, 6]"  # addresses of the Bundles of each part
    post: "i8[parts + 1, 16]"  # the last order; of each part the last one that is taken, and 8 places on, that is done
    post_address: "int"
    here: "int"  # address of this Bundle
    told: "i8[parts]"  # how the task ended
    waits: "f8[parts]"  # the time of an event that reaches beyond the part, inf for none
    pending: "i8[parts]"  # stamp of a patch whose instant is over and that waits so
    clock: "f8[parts]"  # of the last event
    left: "i8[parts]"  # 1: some of its elements move with elements beyond it
    effort: "i8[parts]"  # elements renewed in this look
    shortest: "f8[parts]"  # first step
    way: "float"  # factor of the slab's length that is tried next
    # ---- elements
    near: "i4[elements, nr]"  # itself beyond an open end
    reader_first: "i4[elements + 1]"
    reader: "i4[:]"
    p: "f8[elements, np]"
    x: "f8[elements, ns]"  # at `begun`
    row: "f8[elements, ns, width]"  # polynomials from `begun` to `until`
    begun: "f8[elements]"
    until: "f8[elements]"
    known: "f8[elements]"  # up to where others may read it: for ever, while it rests as a wall does
    length: "f8[elements]"  # of the last step
    fresh: "i4[elements]"  # the patch in which x was set last
    mult: "f8[elements, nm]"
    status: "i1[elements, nm]"
    side: "i1[elements, ne]"
    deflate: "i1[elements, nm + ne]"
    exit_side: "i1[elements, nm]"
    met: "f8[elements, nm + ne]"  # when each surface is met, inf for never
    grazed: "f8[elements, nm + ne]"
    graze_crosses: "i1[elements, nm + ne]"
    widest: "f8[elements, nm + ne]"
    last: "f8[elements, nm, 7]"
    arcs: "f8[elements, nm, 2]"
    fired: "f8[elements, ne, 7]"
    every: "f8[elements, nt]"  # periods of the others
    tick: "i8[elements, nt]"  # which instant is next
    slip_share: "f8[elements, nm]"
    stalled: "i1[elements]"
    minute: "i4[elements]"
    active: "i4[elements]"  # those that are renewed at the end of a slab, part by part
    actives: "i8[parts + 1]"
    active_place: "i4[elements]"  # -1: at rest among elements at rest
    seen: "i4[elements]"  # the slab at whose start it was renewed
    slabs: "int"
    begun_with: "int"  # elements at their start
    scanned: "i8[parts + 1, 2]"  # of those: that move, and that rest
    # ---- counters, and the length of a slab by them
    steps: "int"
    jets: "int"
    layers: "int"
    instants: "int"
    expiries: "int"
    renewed: "int"  # elements
    grown: "int"  # patches that reached further than expected
    window: "int"  # slabs in this look
    spent: "float"  # elements renewed in it
    spanned: "float"  # time
    best: "float"  # elements a time
    trial: "float"  # factor that is tried, 1 for none; at first the shortest step
    rest: "int"
    # ---- what is kept
    event_t: "f8[room]"
    event: "i8[room, 4]"  # number of the surface among those of the whole system, kind, from, to
    event_x: "f8[room, ns]"  # states of the element there
    events: "int"
    noted: "f8[nm]"  # the last instant at which a switch of no element was recorded
    ambiguity_t: "f8[unsure]"
    ambiguity: "i8[unsure, 3]"
    ambiguities: "int"
    asked: "f8[times]"
    keeps: "i4[elements]"  # number of an element among those of which times and multipliers are kept, or -1
    next_asked: "i8[kept]"
    x_asked: "f8[times, kept, ns]"
    mult_asked: "f8[times, kept, nm]"
    status_asked: "i1[times, kept, nm]"
    mult_row: "f8[kept, nm, width]"
    shift: "f8[width*width]"  # binomials, by columns
    power: "f8[width]"
    terms: "f8[width]"
    old: "f8[width]"
