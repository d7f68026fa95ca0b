"""What a run begins with: no counts, no flags of a run before it."""

from .compiling import kernel


@kernel
def restart_counts(S):
    S.steps = S.jets = S.layers = 0
    S.events = S.points = S.pieces = S.ambiguities = 0
    S.ticks = S.samples = S.stalled = S.minute = S.started = 0


@kernel
def restart_flags(W):
    W.roots.dips = W.roots.dip_crosses = W.arc.touched = W.instant.fold = W.instant.way = W.layer.masked = (
        W.instant.at_clock
    ) = 0
    W.instant.jumped = W.instant.together = W.pair.solves = W.instant.solved_there = W.instant.look_again = (
        W.step.kind
    ) = W.step.arrives = 0
