"""A revolute joint with clearance: a journal that moves in its bearing, carried by any contact and friction law.

    e = S - B (journal centre from bearing centre),  n = e/|e|,  tau = (-n_y, n_x),  delta = |e| - c
    v_T = e'.tau + omega_J R_J - omega_B R_B,         force on the journal  F = -F_N n - F_T tau

The wall is one case of a unilateral surface: in free flight, where n is 0/0 at the centre, it is the zero of
(e.e - c^2)/(2 c), and n is e/c.
Chain: laws -> **journal** -> slider_crank.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import sympy as sp

from ..definition.primitives import Event, Memory
from ..door import checks
from ..door.documenting import complete
from ..laws import Law, Pieces
from .drive import OF_CONTACT, OF_FRICTION

__all__ = ["ClearanceJoint", "clearance_joint"]


@complete
class ClearanceJoint(NamedTuple):
    """What the joint does to the two bodies, and what it brings to the System.

    Attributes
    ----------
    force : (Expr, Expr)
        On the journal, N; the opposite one acts on the bearing, at its centre.
    moments : (Expr, Expr)
        On the journal's and on the bearing's body, about the centres, N m.
    normal, friction : Expr
        F_N >= 0, and F_T, which opposes v_T, N.
    indentation : Expr
        delta, m, negative in free flight.
    slip : Expr
        v_T, m/s.
    pieces : list of Pieces
        Of the laws.
    events : tuple of Event
        The joint's own, where the law has none on the wall.

    Source: Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, for the kinematics.

    >>> x, y, u, v = sp.symbols("x y u v", real=True)
    >>> joint = clearance_joint((x, y), (u, v), c=1e-3, R_B=0.01, R_J=0.009, normal=Hertz())
    >>> joint.indentation, joint.friction
    (sqrt(x**2 + y**2) - 0.001, 0)
    """

    force: tuple[Any, Any]
    moments: tuple[Any, Any]
    normal: Any
    friction: Any
    indentation: Any
    slip: Any
    pieces: list[Pieces]
    events: tuple[Event, ...]


def _two(value: Any, what: str) -> tuple[sp.Expr, ...]:
    parts = tuple(checks.expression(e, what) for e in checks.several(value, what))
    if len(parts) != 2:
        raise ValueError(f"{what} has {len(parts)} parts; give two.")
    return parts


@checks.door(
    e=_two, rate=_two, **dict.fromkeys(("c", "R_B", "R_J", "spin_B", "spin_J"), checks.expression), name=checks.name,
    normal=OF_CONTACT, tangential=checks.optional(OF_FRICTION),
)  # fmt: skip
def clearance_joint(
    e: Sequence[Any],
    rate: Sequence[Any],
    *,
    c: Any,
    R_B: Any,
    R_J: Any,
    spin_B: Any = 0,
    spin_J: Any = 0,
    normal: Law,
    tangential: Law | None = None,
    name: str = "",
) -> ClearanceJoint:
    """The forces of a revolute joint with clearance, from the motion of the journal in the bearing.

    Parameters
    ----------
    e, rate : (Expr, Expr)
        Journal centre from bearing centre, m, and its rate, m/s.
    c, R_B, R_J : Expr or float, m
        Radial clearance and radii.
    spin_B, spin_J : Expr
        Angular velocities of the bearing's and the journal's body, rad/s.
    normal : Law
        Contact law.
    tangential : Law, optional
        Friction law, per unit of load.
    name : str
        Put behind the names of the joint's symbols.

    Returns
    -------
    ClearanceJoint
        Forces, moments, and what the laws bring.

    Raises
    ------
    ValueError
        A friction law that needs more than the slip velocity.

    Source: Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, for the kinematics; the form that is regular at the
    bearing's centre is derived here.

    >>> x, y, u, v = sp.symbols("x y u v", real=True)
    >>> joint = clearance_joint((x, y), (u, v), c=1e-3, R_B=0.01, R_J=0.009, normal=Hertz())
    >>> [event.name for event in joint.pieces[0].events]
    ['touch-down', 'lift-off']
    """
    if tangential is not None and tangential.needs:
        raise ValueError(
            f"`tangential` is {type(tangential).__name__}, which needs the {' and '.join(tangential.needs)} of its "
            "joint; a journal only has a slip velocity. Give a law of that, such as Coulomb, Dahl or LuGre."
        )
    ex, ey = e
    square = ex**2 + ey**2
    touching = Memory(f"touching_{name}" if name else "touching", 0)

    def beyond(level):
        return (square - (c + level) ** 2) / (2 * c)

    # The normal e/|e| in contact and e/c in flight, where it is regular at the centre; equal at the wall.
    length = sp.sqrt(c**2 + touching * (square - c**2))
    nx, ny = ex / length, ey / length
    approach = rate[0] * nx + rate[1] * ny
    slip = rate[1] * nx - rate[0] * ny + spin_J * R_J - spin_B * R_B

    def past(level):
        return (square - (c + level) ** 2) / (sp.sqrt(square) + c + level)

    pieces = [normal.attach(position=past(0), velocity=approach, name=name, beyond=beyond, past=past)]
    push = pieces[0].force
    friction: Any = sp.S.Zero
    if tangential is not None:
        pieces.append(tangential.attach(velocity=slip, normal=push, name=name))
        friction = pieces[1].force
    flags = {1: 1, -1: 0}
    # The law's own events on the wall carry the flag along; one event an instant costs less than two.
    merged = tuple(
        Event(event.surface, direction=event.direction, update={**dict(event.update), touching: flags[event.direction]},
              when=event.when, name=event.name)
        if event.surface == beyond(0) else event
        for event in pieces[0].events
    )  # fmt: skip
    carried = {event.direction for event in merged if event.surface == beyond(0)}
    pieces[0] = replace(pieces[0], events=merged)
    events = tuple(
        Event(beyond(0), direction=way, update={touching: flags[way]}, name=f"wall {word}{name and ' ' + name}")
        for way, word in ((1, "reached"), (-1, "left"))
        if way not in carried
    )
    force = (-push * nx + friction * ny, -push * ny - friction * nx)
    return ClearanceJoint(
        force=force,
        moments=(-R_J * friction, R_B * friction),
        normal=push,
        friction=friction,
        indentation=sp.sqrt(square) - c,
        slip=slip,
        pieces=pieces,
        events=events,
    )
