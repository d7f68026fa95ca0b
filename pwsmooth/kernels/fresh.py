"""What a run begins with: no counts, no flags of a run before it."""

from .compiling import kernel


@kernel
def restart_counts(S):
    S.steps = S.jets = S.layers = 0
    S.events = S.points = S.pieces = S.ambiguities = 0
    S.ticks = S.samples = S.stalled = S.minute = S.started = 0


@kernel
def restart_flags(W):
    W.dips = W.dip_crosses = W.touched = W.fold = W.way = W.masked = W.at_clock = 0
    W.jumped = W.together = W.pair_solves = W.solved_there = W.look_again = W.rows_kind = W.arrives = 0
