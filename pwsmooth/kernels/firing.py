"""The contract of events at one instant, for both loops.

All that are due and whose `when` holds act on the values before, together. What their updates carry through zero is
due next, with the values after; until nothing newly acts.

Both loops have arrays of these names, with one entry an event: `due`, `met` (the motion has come to the surface at
this instant or before, and nothing has taken it off), `side` (the sign that the surface had last), `carried` (what an
update does that carries the surface through zero), `level` and `rounding` (the surfaces, and what the last digits of
the states make of them), `was` (before the last update), `left` (whether an update has taken the states off the
surface, or through it); and `before` and `after`, the states around one round of updates.
"""

from .machine.compiling import kernel
from .outcome import Outcome
from .state import ACTED, ACTS, ALWAYS, DUE, GO_ON, MOST_AT_ONCE, OFF, PLAIN, THROUGH, TIMED


@kernel
def counts(direction, side):
    """Whether a zero after which the surface has this sign is one that an event of this direction waits for."""
    return direction == 0 or direction == side


@kernel
def _carry_through(E, side, direction, ne):
    """Makes due what the last update has carried through zero: from `was` to `level`.

    An event that acts with it is not: one that only records at the surface of another would make that act twice. Nor
    is what is taken off a surface to which the motion had come, or on which it rested: it will be met again from there.
    Where an update puts the state on a surface, the motion meets it when it goes on to the other side.
    """
    for j in range(ne):
        acted = E.due[j] == ACTS
        if acted:
            E.due[j] = ACTED
        was, now = E.was[j], E.level[j]
        if E.carried[j] == TIMED or now == was or abs(now) <= E.rounding[j]:
            continue
        stood = E.met[j] == 1 and abs(was) <= E.rounding[j]
        E.met[j], E.left[j] = 0, max(E.left[j], OFF)
        if now * side[j] >= 0.0:
            continue
        side[j] = -side[j]
        if E.carried[j] == ALWAYS or (E.carried[j] == PLAIN and not (acted or stood)):
            E.left[j] = THROUGH
            if counts(direction[j], side[j]):
                E.due[j] = DUE


@kernel
def fire(E, loop, n, ne, t, x, side, direction, look, act, record, note):
    """Lets what is due act until nothing newly does; returns GO_ON, TERMINATED or EVENT_LOOP, and sets E.jumped.

    Called with E.level as at (t, x). `look(loop, t, x)` overwrites it and E.rounding; `act(loop, j, t)` lets event j
    act from E.before on E.after and returns whether its `when` holds; `record(loop, j, t)` returns whether it ends the
    run; `note(loop, together)` is told how many acted together, before x changes: E.after may be mended by it.
    """
    code, count, E.jumped = GO_ON, 0, 0
    while count < ne + MOST_AT_ONCE:
        for i in range(n):
            E.before[i] = E.after[i] = x[i]
        together = 0
        for j in range(ne):
            if E.due[j] == DUE and act(loop, j, t):
                E.due[j] = ACTS
                together += 1
                if record(loop, j, t):
                    code = Outcome.TERMINATED
        note(loop, together)
        moved = False
        for i in range(n):
            moved = moved or E.after[i] != x[i]
            x[i] = E.after[i]
        if not moved:
            return code
        count += together
        E.jumped = 1
        for j in range(ne):
            E.was[j] = E.level[j]
        look(loop, t, x)
        _carry_through(E, side, direction, ne)
    return Outcome.EVENT_LOOP
