"""Finer absolute tolerances for a motion that comes to rest in finite time, along a slide or by ever faster switching.

It goes below any absolute tolerance, and what it comes to shows in its last digits: there an error counts relative to
what is left of the motion.
"""

from ..machine.compiling import inlined_kernel, kernel

AS_ASKED, ON_ITS_WAY, SWITCHING = range(3)  # step.nears
_FINEST = 1e-20  # of the absolute tolerance asked for: a state that stands still has nothing left


@kernel
def follow_as_asked(P, C, W):
    """Overwrites step.atol by the tolerances asked for."""
    W.step.nears = AS_ASKED
    for i in range(P.n):
        W.step.atol[i] = C.atol[i]


@inlined_kernel
def _finer(C, i, left):
    return min(C.atol[i], max(C.rtol * left, _FINEST * C.atol[i]))


@kernel
def follow_to_rest(P, C, W, left):
    """Overwrites step.atol for a motion, on the polynomials of the step, that comes to rest after this time."""
    if W.step.nears == AS_ASKED:
        W.step.nears = ON_ITS_WAY
    for i in range(P.n):
        W.step.atol[i] = min(W.step.atol[i], _finer(C, i, left * abs(W.step.rows[i, 1])))


@kernel
def follow_arcs(P, C, S, W, j, interval):
    """Overwrites step.atol for arcs about surface j, of which one begins, with the rates in W.dx, of that interval."""
    step = W.step
    if step.nears != SWITCHING or step.leader != j:
        step.leader, step.turns = j, 0
    step.nears = SWITCHING
    step.turns += 1
    for i in range(P.n):
        before = step.met[0, i] if step.turns > 1 else 0.0
        step.atol[i] = _finer(C, i, interval * abs(W.dx[i]) + abs(S.x[i] - before))
        step.met[2, i] = step.met[1, i]
        step.met[1, i] = step.met[0, i]
        step.met[0, i] = S.x[i]


@kernel
def go_on_as_arcs(P, S, W, left):
    """Moves S.x on by this time at the mean rates of the last two arcs, when it stands at the end of them."""
    last = S.last[W.step.leader]
    span = last[1] + last[1] / last[2]
    for i in range(P.n):
        S.x[i] += left / span * (S.x[i] - W.step.met[2, i])
