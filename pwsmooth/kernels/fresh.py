"""What a run begins with: no counts, no flags of a run before it."""

from .machine.compiling import kernel


@kernel
def restart_counts(S):
    S.steps = S.jets = S.layers = 0
    S.events = S.points = S.pieces = S.ambiguities = S.taped = 0
    S.ticks = S.samples = S.stalled = S.minute = S.started = 0


@kernel
def restart_flags(W):
    instant, step, roots = W.instant, W.step, W.roots
    roots.dips = roots.dip_crosses = W.arc.touched = W.layer.masked = W.pair.solves = 0
    step.kind = step.arrives = step.nears = 0
    instant.fold = instant.way = instant.at_clock = instant.jumped = instant.together = 0
    instant.solved_there = instant.look_again = instant.parting = instant.released = instant.unsettled = 0
    instant.rests = step.refused = -1
