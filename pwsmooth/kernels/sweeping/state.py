"""What differs from orbit to orbit of an ensemble, and what is kept of each: see ensemble.py."""

from ..machine.block import Bundle

EXTREMES, INTEGRALS = 1, 2  # bits of Ensemble.wanted
NO_RETURN = -103  # code of an orbit that was not back on its section in time: no end of a run of solve()


class Ensemble(Bundle):
    """N orbits of one model; arrays of N rows are read or written orbit by orbit, the others are scratch."""

    run: "int"  # address of trajectory.run
    outputs: "int"  # address of the model's outputs, 0 where none is wanted
    section: "int"  # the event that strobes the orbits, -1 where the period does
    transient: "int"  # of the section: returns before the window
    longest_return: "float"  # and how long an orbit may be on its way to it
    longest: "int"  # largest period looked for, in strobes
    period_tol: "float"
    stop: "i8[1]"  # set to 1 by another thread: no orbit goes on
    p: "f8[N, np]"  # parameters
    ratio: "f8[N, nz]"  # Problem.ratio
    x0: "f8[N, n]"
    t0: "f8[N]"
    window: (
        "f8[N, 2]"  # start and end of what is measured; the orbit ends there; of a section overwritten when met
    )
    period: "f8[N]"  # between two strobes; not read with a section
    quantity: "i8[nq]"  # states 0..n-1, multipliers n..n+m-1, then the model's outputs
    wanted: "i8[nq]"  # EXTREMES + INTEGRALS
    word_digits: "i8[m]"  # 3**k of the multipliers that make a word, 0 of the others
    node: "f8[nodes]"  # of Gauss on [0, 1]
    weight: "f8[nodes]"
    code: "i8[N]"  # why the loop returned
    reached: "f8[N]"  # last time
    steps: "i8[N]"
    events: "i8[N]"
    ambiguities: "i8[N]"
    events_inside: "i8[N]"  # of the window
    stick_time: "f8[N, m]"  # time solved, inside the window
    sticks: "i8[N, m]"  # sticks that begin inside the window
    strobe: "f8[N, strobes, n]"  # states at window start, one period or return later, ...
    strobe_t: "f8[N, strobes]"  # when that was
    found: "i8[N]"  # period in strobes, 0 where none was found
    word: "i8[N, most]"  # statuses in base 3 of the segments that begin in the last period(s)
    word_length: "i8[N]"  # -1 where they are too many
    low: "f8[N, nq]"
    high: "f8[N, nq]"
    first: "f8[N, nq]"  # integral over the window
    second: "f8[N, nq]"  # of the square
    last: "float"  # time of the last point
    returns: "int"  # to the section, of the orbit at hand
    has_point: "int"  # of the orbit at hand: whether there has been one, and a piece between two
    has_piece: "int"
    segments: "int"  # so far
    was: "i8[m]"  # status behind the last point
    before: "i8[m]"  # status of the last segment
    segment_t: "f8[ring]"  # when the last segments began
    segment: "i8[ring]"  # what they were
    value: "f8[nodes + 2, nq]"
    at: "f8[nodes + 2]"
    poly: "f8[:]"  # (at least order + 1,) one scaled polynomial
    x: "f8[n]"
    mult: "f8[m]"
    out: "f8[outputs]"
