"""Where a branch ends: the Poincare map jumps, or a saddle is met.

    capture           an arrival is just held, or just not                    captures.py
    adding-sliding    a stick of a hidden term could just hold no more        holding.py, windows.py
                      or is just let go                                       impacts.py
    grazing           a stop, an event or static friction is just touched, where the branch finds no orbit beyond
    homoclinic orbit  the motion comes to rest at a saddle on its way         homoclinic.py

Chain: orbit_problem.py, captures.py, recutting.py -> **jumps** -> bifurcations.py, branches.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..maps.holding import not_held, strength_of
from ..maps.impacts import from_release
from ..maps.parts import minima
from ..maps.sections import Stroboscopic
from ..orbits.finding import refine
from ..orbits.itineraries import Change, Letter, same_itinerary
from ..orbits.periodic_orbit import PeriodicOrbit
from ..orbits.recutting import touched
from .conditions.captures import at_threshold, clearances
from .homoclinic import HETEROCLINIC, HOMOCLINIC, saddles_met
from .orbit_problem import OrbitPoint, OrbitProblem
from .special import ADDING, CAPTURE, Special

# Of the parameter: in which a jump is enclosed, and to which the layer is resolved.
_THRESHOLD, _LAYER = 1e-10, 1e-6
_PARTED = 1e-6  # in the unit of dh/dt: so little more the layer holds beside a jump
_GRAZED = 1e-4  # in the unit of h: so near the last orbit of a branch comes, within its shortest step


def jump_between(problem: OrbitProblem, left: OrbitPoint, right: OrbitPoint) -> Special | None:
    """Whether a jump is that of a contact which is just captured, just not, or just let go; located over the parameter.

    The chord leads from one orbit to another there, and says little of where the first one ends.
    """
    if not (clearances(left.orbit) or parted(left.orbit, math.inf)):
        return None
    last, first = left.orbit, left.orbit
    low, high = problem.value(left), problem.value(right)
    if left.tangent[-1] * (high - low) <= 0:
        high = low + math.copysign(max(abs(high - low), 1e-3 * problem.scale), left.tangent[-1])
    while abs(high - low) > _THRESHOLD * (abs(low) + problem.scale):
        middle = 0.5 * (low + high)
        found = refine(first.map.with_parameters({problem.name: middle}), last.x)
        if found.success and same_itinerary(first, found):
            low, last = middle, found
        else:
            high = middle
    width = abs(high - low) + _LAYER * (abs(low) + problem.scale)
    if at_threshold(last):
        return Special(CAPTURE, {problem.name: low}, last, width)
    change = parted(last, _PARTED)
    return None if change is None else Special(ADDING, {problem.name: low}, last, width, change=change)


def parted(orbit: PeriodicOrbit, within: float) -> Change | None:
    """The stick of a hidden term whose layer could hold no more than `within` at one time: where it lets go."""
    best: Any = None
    for mu in orbit.system.model.multipliers:
        name = str(mu.symbol)
        if not mu.hidden or not_held(orbit.system.model, name):
            continue
        found = touched(orbit, name, stays=True)
        image = None if isinstance(found, str) else found[0].image(found[1], ())
        near = getattr(image, "approach", None)
        if near is not None and near.h <= within and (best is None or near.h < best[1].h):
            best = name, near, found[0].window.side  # type: ignore[union-attr]
    if best is None:
        return None
    name, near, side = best
    first = orbit.map.start_time if isinstance(orbit.map, Stroboscopic) else 0.0
    time = float((near.place - first) / orbit.period % 1.0)
    return Change(ADDING, (), (Letter(time, name, "slip by fold", 0, -side),), time)


def let_go(orbit: PeriodicOrbit, within: float) -> Change | None:
    """The stick of a hidden term that is just let go, whose layer could have held it with `within` more."""
    found = from_release(orbit.map, orbit.x)
    if found is None:
        return None
    release, z = found
    t, D = float(z[-1]), release.duration
    _, stays = release.systems()
    run = release._solve(stays, (t, t + release.behind * D), z[:-1], True)
    functions = strength_of(orbit.system.model, release.name, -release.side).functions(run.model)
    places = minima(run, functions) if run.success else []
    if not places:
        return None
    at = np.array(places[:1])
    if functions[0](at, *run.dense(at), run.tape.p)[0] < -within:
        return None
    time = (t - release.start_time) / orbit.period % 1.0
    return Change(ADDING, (Letter(time, release.name, "slip by fold", 0, release.side),), (), time)


def end_at(problem: OrbitProblem, here: OrbitPoint, width: float) -> Special | None:
    """What a branch ends at: a capture, the grazing of a stop or of an event, where the map jumps, or a saddle."""
    at, orbit = problem.values(here), here.orbit
    if saddles := saddles_met(orbit):
        kind = HOMOCLINIC if len(saddles) == 1 else HETEROCLINIC
        return Special(kind, at, orbit, width, saddles=tuple(saddles))
    if at_threshold(here.orbit):
        return Special(CAPTURE, at, orbit, width)
    for ends in (parted, let_go):
        if (change := ends(here.orbit, _GRAZED)) is not None:
            return Special(ADDING, at, orbit, width, change=change)
    model, best = here.orbit.system.model, None
    kinds = {str(mu.symbol): ("grazing impact", "impact") for mu in model.multipliers if mu.kind == "contact"}
    # Static friction holds at once what just comes to rest.
    kinds |= {str(mu.symbol): ("grazing-sliding", "stick") for mu in model.multipliers if mu.hidden}
    for event in model.events:
        if event.surface is not None and not event.singular:
            kinds[event.name] = ("grazing of an event", "reset")
    for name in kinds:
        found = touched(here.orbit, name)
        image = None if isinstance(found, str) else found[0].image(found[1], ())
        near = getattr(image, "approach", None)
        if near is not None and (best is None or near.h < best[1].h):
            best = name, near, found[0]
    if best is None or not best[1].h <= _GRAZED:
        return None
    name, near, _ = best
    kind, letter = kinds[name]
    first = here.orbit.map.start_time if isinstance(here.orbit.map, Stroboscopic) else 0.0
    time = float((near.place - first) / here.orbit.period % 1.0)
    change = Change(kind, (), (Letter(time, name, letter, 0, 0),), time)
    return Special(kind, at, orbit, width, change=change)
