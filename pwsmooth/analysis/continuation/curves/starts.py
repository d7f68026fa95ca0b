"""What a curve begins with: the condition of a bifurcation, a map on which it is regular, and the first point.

Chain: recutting.py, tangencies.py -> **starts** -> emanating.py, two_parameters.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ....door import checks
from ...maps.holding import not_held
from ...maps.impacts import FromRelease, from_impact, from_release
from ...maps.windows import PartedImage, Windowed
from ...orbits.itineraries import CHATTER, Change
from ...orbits.periodic_orbit import PeriodicOrbit
from ...orbits.recutting import Cut, of_orbit, touched
from ..bifurcations import BORDER
from ..conditions.captures import capture_cut, condition_at
from ..conditions.chatter import EndOfChatter, accumulates, chatter_cut
from ..conditions.conditions import BranchPoint, Condition, Critical, Torus
from ..conditions.tangencies import TOGETHER, Arrival, Border, Exit, LetGo, Touch
from ..special import ADDING, CAPTURE, Lead, Special

TOUCHES = ("grazing impact", "grazing", "grazing-sliding", "grazing of an event", "adding-sliding")
EXITS = ("exit by a fold",)
ARRIVALS = ("crossing-sliding", "switching-sliding")
SMOOTH = ("fold", "flip", "symmetry breaking", "torus", "branch point")
FOLLOWED = (CAPTURE, *SMOOTH, *TOUCHES, *ARRIVALS, *EXITS, CHATTER)
_OF_ORBITS = (*SMOOTH, *TOUCHES, BORDER, CAPTURE)


def condition_of(lead: Lead, name: str, names: tuple[str, str]) -> Condition:
    """The condition that what a curve begins with, found over the parameter `name`, puts on it."""
    kind, event = lead.kind, lead.event
    if kind in TOUCHES and isinstance(lead.cut[0], FromRelease):
        return LetGo(kind)
    if kind == CHATTER:
        return EndOfChatter(kind, *event)
    if kind == BORDER:
        return Border(event)
    if kind == CAPTURE:
        return condition_at(event)
    if event is not None:
        return (Arrival if kind in ARRIVALS else Exit)(kind, *event)
    if kind == "torus":
        return Torus()
    if kind in TOUCHES:
        return Touch(kind)
    if kind == "branch point":
        return BranchPoint(names.index(name) if name in names else 0)
    return Critical(kind, 1 if kind == "fold" else -1)


def given(start: PeriodicOrbit | Special, kind: str | None, switch: Any) -> tuple[Any, str, Lead]:
    """An orbit, over which parameter it was found, and what the curve begins with."""
    if isinstance(start, Special) and len(start.values) > 1:
        return start.point, "", start.lead(kind)
    if isinstance(start, Special):
        return _at_special(start, kind, switch)
    if not start.success:
        raise ValueError(f"`start` did not converge: {start.message}")
    if kind not in _OF_ORBITS:
        said = f"`kind` is {'missing' if kind is None else repr(kind)}"
        raise ValueError(f"{said}: `start` is an orbit; give one of {', '.join(_OF_ORBITS)}.")
    return start, "", _near(start, kind, switch)


def _at_special(start: Special, kind: str | None, switch: Any) -> tuple[Any, str, Lead]:
    """The same of a special point of a branch."""
    if kind is not None and kind != start.kind:
        raise ValueError(f"`kind` is {kind!r}, but `start` is a {start.kind}; leave `kind` out.")
    if start.kind not in FOLLOWED:
        raise ValueError(f"`start` is a {start.kind}; followed are {', '.join(FOLLOWED)}.")
    orbit, change, kind, (name, *_), phase = start.point, start.change, start.kind, start.values, None
    if orbit is None:
        raise ValueError(
            f"`start` is a {kind} of a diagram that was read, without its orbit; call diagram() with the same `store`."
        )
    if kind == CHATTER:
        rests = accumulates((orbit, start.beyond))
        switch = (*change.before, *change.after)[0].switch  # type: ignore[union-attr]
        bounces = "no contact closes" if rests is None else chatter_cut(rests, switch)
        if isinstance(bounces, str):
            raise ValueError(f"`start` is an {kind} that is not followed: {bounces}.")
        return rests, name, Lead(kind, *bounces, begins=False)
    if change is not None and kind in (*ARRIVALS, *EXITS):
        cut, event = at_event(orbit, kind, change)
        return orbit, name, Lead(kind, cut, event, begins=False)
    if kind == ADDING and start.jumps and change.before:  # type: ignore[union-attr]
        release = from_release(orbit.map, orbit.x)
        if release is None:
            raise ValueError(f"`start` is an {kind} of an orbit that no fold lets go; start from another one.")
        return orbit, name, Lead(kind, (*release, False), begins=False)
    if kind in TOUCHES and change is not None:
        switch, phase = max(change.before, change.after, key=len)[0].switch, change.time
        if len(change.before) > len(change.after) and start.beyond is not None:
            orbit = start.beyond
    return orbit, name, _near(orbit, kind, switch, phase)


def _near(orbit: PeriodicOrbit, kind: str, switch: Any, phase: float | None = None) -> Lead:
    """What a curve begins with beside an orbit near to a bifurcation, which touches a surface at a phase."""
    model = orbit.system.model
    if kind == CAPTURE:
        about = capture_cut(orbit, None if switch is None else str(switch))
        if isinstance(about, str):
            raise ValueError(f"`start` is at no capture threshold: {about}.")
        return Lead(kind, *about, begins=False)
    if kind == BORDER:
        known = {s.name: s for s in (*model.states, *orbit.system.parameters)}
        border = checks.expression(switch, "`switch`", known)
        if not border.free_symbols & set(model.states) or border.free_symbols - {*known.values()}:
            raise ValueError(f"`switch` is {border}; give a function of states {checks.listing(model.states)}.")
        return Lead(kind, of_orbit(orbit, orbit.map), border, begins=False)
    if kind not in TOUCHES:
        # Beside a slow impact or release DP has no bound; the motion from one to the next has.
        slow = kind in ("fold", "flip") and orbit.segments is None
        found = (from_impact(orbit.map, orbit.x) or from_release(orbit.map, orbit.x)) if slow else None
        return Lead(kind, of_orbit(orbit, orbit.map) if found is None else (*found, False), begins=False)
    names = [str(mu.symbol) for mu in model.multipliers if mu.surface is not None]
    names += [event.name for event in model.events if event.surface is not None and not event.singular]
    switch = names[0] if switch is None and len(names) == 1 else switch
    if str(switch) not in names:
        said = checks.shown(switch)
        raise ValueError(f"`switch` is {said}; give the one that is touched, of {', '.join(names) or 'none'}.")
    if kind == ADDING and (why := not_held(model, str(switch))):
        raise ValueError(f"`start` is an {kind} of {switch}, {why}; it is not followed.")
    window = touched(orbit, str(switch), phase, kind == ADDING)
    if isinstance(window, str):
        raise ValueError(f"`start` grazes nothing: {window}.")
    return Lead(kind, window, begins=False)


def at_event(orbit: PeriodicOrbit, kind: str, change: Change) -> tuple[Cut, tuple[str, int]]:
    """The map without a window, the points on its section, and the event at which the itinerary changes."""
    switch = change.before[0].switch
    found = of_orbit(orbit, Windowed(orbit.map))
    image = found[0].image(found[1], ())
    if not isinstance(image, PartedImage):
        raise ValueError(f"`start` is a {kind} of an orbit that is not run through: {image.reason}")
    if any(layer.ratio != sp.oo for layer in orbit.system.model.layer_states):
        raise ValueError(
            f"`start` is a {kind} of a layered view, whose layer has states; these are not followed."
        )
    probe = (Arrival if kind in ARRIVALS else Exit)(kind, switch, 0)
    part = 0.5 if orbit.symmetric else 1.0
    times = [time / orbit.period for time in probe.times(image)]
    off = [abs((t - change.before[0].time + part / 2) % part - part / 2) for t in times]
    if not off or min(off) > 3 * TOGETHER:
        raise ValueError(f"`start` is a {kind} whose event is not found in its orbit; start from another one.")
    return found, (switch, int(np.argmin(off)))
