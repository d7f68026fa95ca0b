"""What differs from orbit to orbit of an ensemble, and what is kept of each: see ensemble.py."""

from .block import Bundle

EXTREMES, INTEGRALS = 1, 2  # bits of Ensemble.wanted
K_STEPS, K_EVENTS, K_AMBIGUITIES, K_EVENTS_IN_WINDOW = range(4)
FLAG_POINT, FLAG_PIECE, FLAG_SEGMENTS = range(3)


class Ensemble(Bundle):
    """N orbits of one model; arrays of N rows are read or written orbit by orbit, the others are scratch."""

    run: "int"  # address of trajectory.run
    outputs: "int"  # address of the model's outputs, 0 where none is wanted
    longest: "int"  # largest period looked for, in drive periods
    period_tol: "float"
    stop: "i8[1]"  # (1,) set to 1 by another thread: no orbit goes on
    t_end: "f8[1]"  # (1,) the cell of Control.t_end
    p: "f8[2]"  # (N, np) parameters
    ratio: "f8[2]"  # (N, nz) Problem.ratio
    x0: "f8[2]"  # (N, n)
    t0: "f8[1]"  # (N,)
    window: "f8[2]"  # (N, 2) start and end of what is measured; the orbit ends there
    period: "f8[1]"  # (N,) between two strobes
    quantity: "i8[1]"  # (nq,) states 0..n-1, multipliers n..n+m-1, then the model's outputs
    wanted: "i8[1]"  # (nq,) EXTREMES + INTEGRALS
    word_digits: "i8[1]"  # (m,) 3**k of the multipliers that make a word, 0 of the others
    node: "f8[1]"  # (nodes,) of Gauss on [0, 1]
    weight: "f8[1]"
    code: "i8[1]"  # (N,) why the loop returned
    reached: "f8[1]"  # (N,) last time
    counts: "i8[2]"  # (N, 4) see the K_ names
    stick_time: "f8[2]"  # (N, m) time solved, inside the window
    sticks: "i8[2]"  # (N, m) sticks that begin inside the window
    strobe: "f8[3]"  # (N, strobes, n) states at window start, one period later, ...
    found: "i8[1]"  # (N,) period in drive periods, 0 where none was found
    word: "i8[2]"  # (N, most) statuses in base 3 of the segments that begin in the last period(s)
    word_length: "i8[1]"  # (N,) -1 where they are too many
    low: "f8[2]"  # (N, nq)
    high: "f8[2]"
    first: "f8[2]"  # (N, nq) integral over the window
    second: "f8[2]"  # (N, nq) of the square
    last: "f8[1]"  # (1,) time of the last point
    flags: "i8[1]"  # (3,)
    was: "i8[1]"  # (m,) status behind the last point
    before: "i8[1]"  # (m,) status of the last segment
    segment_t: "f8[1]"  # (ring,) when the last segments began
    segment: "i8[1]"  # (ring,) what they were
    value: "f8[2]"  # (nodes + 2, nq)
    at: "f8[1]"  # (nodes + 2,)
    poly: "f8[1]"  # (at least order + 1,) one scaled polynomial
    x: "f8[1]"  # (n,)
    mult: "f8[1]"  # (m,)
    out: "f8[1]"  # (outputs,)
