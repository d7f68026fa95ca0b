"""What the noise kernels are told: plain numbers, no objects."""

from ..machine.block import Bundle

KICKS = 0x6B69636B  # word of the counter that belongs to kicks alone


class Kick(Bundle):
    """One sequence of kicks."""

    act: "int"  # address of the model's own function
    index: "int"  # number of the event that kicks
    every: "float"
    law: "int"  # 0: uniform, 1: standard normal, 2: Laplace of variance 1
    seed: "int"
    trajectory: "int"
    where: "i8[:]"  # states that are kicked
    size: "f8[:]"


# Words of the counter that belong to the Brownian path: whole intervals, their halves, and first passages.
ROOT, SPLIT, BRIDGE = 0x726F6F74, 0x73706C69, 0x62726964
DEEPEST = 40  # halvings of an interval
LOCATED = 34  # halvings after which an event counts as located: 6e-11 of an interval


# Parts of what the generated function gives (noise/lowering.py): behind the entries of G and Milstein's terms, of which
# G_place and M_place tell; parts SPREAD - RATE of the rate, of each the largest counts; |dh.G|^2 of every surface;
# |dg.G|^2, dg/dlambda and d2g/dlambda2 of every multiplier; h, dh/dt, |dh.G|^2 and the width of every layer.
RATE, SPREAD, PULL, SLOPE, BEND, GATE, SPEED, ACROSS, WIDTH = 2, 8, 9, 10, 11, 12, 13, 14, 15


class Diffused(Bundle):
    """One diffusion: dx = f dt + G dW with q sources, on a Brownian path made of intervals of length `step`."""

    outputs: "int"  # address of the generated function that fills `out`
    at: "i8[:]"  # the first place of each part in `out`, and the end
    q: "int"
    G_row: "i8[:]"  # where the entries of each state begin,
    G_source: "i8[:]"  # their sources
    G_place: "i8[:]"  # and places in `out`
    M_row: "i8[:]"  # the same of Milstein's terms: none where G depends on time alone
    M_first: "i8[:]"
    M_second: "i8[:]"
    M_place: "i8[:]"
    moving: "int"  # 1: G depends on time
    step: "float"
    resolution: "float"
    level: "int"  # halvings of every interval
    finest: "int"  # further ones beside a surface that the noise acts on
    seed: "int"
    noisy: "i8[m + ne]"  # the noise acts on this surface
    trajectory: "int"
    interval: "int"  # where on the Brownian path the run stands
    depth: "int"  # halvings of that interval
    position: "int"  # part of it
    last: "int"  # interval at whose start the run ends
    recording: "int"  # whether the points are kept
    rejected: "int"  # steps
    out: "f8[outputs]"
    out_start: "f8[outputs]"  # the same at the start of the step
    out_ahead: "f8[outputs]"
    increment: "f8[levels, q]"  # of every level: increment of W over the present part of the interval
    area: "f8[levels, q]"  # ... and its space-time area H = int W ds / h - W/2
    right_increment: "f8[levels, q]"  # the same of the other half
    right_area: "f8[levels, q]"
    x: "f8[n]"  # start of the step
    f: "f8[n]"
    surface: "f8[m + ne]"
    rest: "f8[n]"  # what a step does after a first passage
    across: "f8[q]"  # what each source does to a surface
    mult: "f8[m]"
    status: "i8[m]"
    size: "f8[m]"  # |h| of discs that slip
    speed: "f8[m]"  # and its largest rates
    slow: "i8[m]"  # of these, slips that follow the force over the step
    pace: "f8[m]"  # |h| of theirs at its end over its length, negative
    rests: "i8[m]"  # where they have come to rest
    starts: "f8[:, n + 1]"  # of an ensemble, one or each its own: states and time
    snapshots: "f8[trajectories, times, n]"
    grid: "i8[times]"  # interval at whose start each snapshot is taken
    ends: "f8[trajectories, n + 1]"  # time and state at the end of each
    codes: "i8[trajectories, 2]"  # why it ended, steps
