"""A lifted field backward in time: dx/ds = -f(-s, x) with s = -t.

Crossings are passed as they stand, impacts return 1/e of the speed, and an event undoes its update x+ = A x + b: it
happens where the motion meets the image of its surface, if before the jump the surface was met in the event's
direction. What leaves no trace of the past (sliding, a contact that stays closed, an impact with e = 0, a memory that
is set) has no reverse: the run has to end there.
Chain: lowering.py (Field) -> **reversal** -> system.py, paths/backward.py.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from ..door import checks
from .model import Select
from .regularity import total_derivative


def backward(field, parameters):
    """(field in s = -t, names of the contacts and events at which a run backward has to end)."""
    if field.discs:
        raise ValueError(
            f"`t_span` decreases, but {field.discs[0].symbol} is a disc: at its surfaces what is after does not tell "
            "what was before. Integrate forward."
        )
    mirror = _mirror(field.time)
    ends = set()
    contacts = []
    for R, gap, e in field.contacts:
        returns = e.free_symbols <= parameters.keys() and e.subs(parameters) != 0
        ends |= set() if returns else {R.name}
        contacts.append((R, mirror(gap), 1 / e if returns else sp.S.One))
    events = []
    for event in field.events:
        if event.tables:
            raise ValueError(
                f"`t_span` decreases, but the system has the drive {event.tables[0].name!r}, which is followed forward "
                "only; integrate forward."
            )
        events += _undone(field, event, mirror, ends)
    reversed_field = field.map(mirror)
    rates = tuple(-mirror(e) for e in field.rates)
    return replace(reversed_field, rates=rates, contacts=tuple(contacts), events=tuple(events)), frozenset(ends)


def _mirror(time):
    return lambda e: e.xreplace({time: -time})


def passed(name):
    """Name of what tells that the surface of an event, which its update moves, is passed where the event would act."""
    return f"{name}, passed"


def _undone(field, event, mirror, ends):
    """What undoes `event`; one that cannot be undone ends the run, and its name is added to `ends`."""
    order = (*field.states, *field.memories)
    written = dict((order[i], e) for i, e in event.update)
    inverse = _inverse(written)
    if inverse is None:
        if any(x in field.states for x in written):
            raise ValueError(
                f"`t_span` decreases, but the update of event {event.name!r} cannot be undone: it has to be linear in "
                f"{checks.listing(list(written))} with an inverse. Integrate forward."
            )
        ends.add(event.name)
        inverse = {}  # only memories are set, so that the states stand on the surface as they do forward
    before = lambda e: e.xreplace(inverse)  # noqa: E731
    instants = {"at": tuple(-a for a in event.at)}
    if event.surface is None:
        when = event.when if event.name in ends else before(event.when)
        update = tuple((order.index(x), mirror(e)) for x, e in inverse.items())
        return [replace(event, when=mirror(when), update=update, **instants)]
    there = replace(event, surface=mirror(event.surface), direction=-event.direction, update=())
    if event.name in ends:
        return [replace(there, when=sp.true)]
    surface, when = before(event.surface), before(event.when)
    direction = -event.direction
    if inverse and direction:
        direction = 0
        rate = _by_sides(total_derivative(event.surface, field.time, field.states, field.rates), field)
        when = sp.And(when, before(event.direction * rate) > 0)
    update = tuple((order.index(x), mirror(e)) for x, e in inverse.items())
    undone = replace(event, surface=mirror(surface), direction=direction, when=mirror(when), update=update)
    if sp.expand(surface - event.surface) == 0:
        return [undone]
    # Between its images the motion must not come to its surface: forward the event would act there.
    ends.add(passed(event.name))
    return [undone, replace(there, name=passed(event.name), when=mirror(event.when), terminal=False)]


def _inverse(written):
    """{x: its value before} of an update that is linear in what it writes; None where it has no inverse."""
    if not written:
        return {}
    states = list(written)
    A = sp.Matrix([[e.diff(x) for x in states] for e in written.values()])
    if not A.free_symbols.isdisjoint(states) or A.has(Select) or A.det() == 0:
        return None
    rest = sp.Matrix([e.xreplace(dict.fromkeys(states, sp.S.Zero)) for e in written.values()])
    return dict(zip(states, A.LUsolve(sp.Matrix(states) - rest)))


def _by_sides(e, field):
    """An expression with the sign of its surface for every multiplier of a switch."""
    for lam, h in reversed(field.switches):
        if e.has(lam):
            e = e.xreplace({s: s.affine() for s in e.atoms(Select) if s.args[0] == lam}).xreplace(
                {lam: sp.sign(h)}
            )
    return e
