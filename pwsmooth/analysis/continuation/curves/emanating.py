"""Which curves begin, or pass, at a point of codimension 2, and with what they are started.

    two conditions on multipliers        the curve of the other one passes there
    resonances 1:1, 1:2                  the fold or flip passes, the torus begins with theta = 0, pi
    degenerate flip, symmetry breaking   the fold of the doubled orbit begins, along the critical eigenvector
    degenerate grazing                   the fold of orbits with a slow impact, in one or in several periods, begins, at
                                         speed 0
    a change of itinerary on a curve     the curve of that change passes, or begins
    a multiplier on one side of a change the fold, flip, ... of that side's orbits ends there

Source: Kuznetsov, Elements of Applied Bifurcation Theory, chapter 9; di Bernardo, Budd, Champneys, Kowalczyk,
Piecewise-smooth Dynamical Systems, 2008.

Chain: special.py, starts.py, problem.py -> **emanating** -> ways.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...maps.impacts import FromImpact
from ...maps.segments import Shooting
from ...maps.windows import Window, Windowed
from ...orbits.finding import refine
from ...orbits.itineraries import JUMP, Change, change_between
from ...orbits.periodic_orbit import PeriodicOrbit
from ...orbits.recutting import exact, of_orbit, touched
from ..conditions.captures import at_threshold, capture_cut
from ..conditions.conditions import Critical, Place
from ..conditions.tangencies import DEGENERATE, SIDES, Touch, TwoSided
from ..special import CAPTURE, Lead
from .problem import CurveProblem, Spot
from .starts import ARRIVALS, EXITS, SMOOTH, TOUCHES, at_event

_ASIDE = 1e-4  # of the scaled parameters: so far beside a change the orbits of one side are started from


def leads(problem: CurveProblem, spot: Spot, name: str) -> tuple[Lead, ...]:
    """What begins at a zero of a test function."""
    place, condition = problem.place_at(spot), problem.condition
    if place is None:
        return ()
    cut = (place.map, place.x, problem.held)
    first, _, second = name.partition(" + ")
    if name in _RESONANCES:
        if condition.kind == "torus":
            return (Lead(_real(name, place), cut),)
        return (Lead("torus", cut, extra=(_RESONANCES[name],)),)
    if name == f"degenerate {condition.kind}" and isinstance(condition, Critical):
        return _doubled(place, condition)
    if name.startswith(DEGENERATE) and isinstance(condition, Touch):
        found = condition.impacts(place, int(name.rpartition(" ")[2]) if "period" in name else 1)
        return () if found is None else (Lead("fold", (*found, False)),)
    if isinstance(condition, TwoSided) and second.endswith(tuple(SIDES)):
        return _of_one_side(problem, place, *second.split(", "))
    if second == "grazing impact" and isinstance(place.map, FromImpact):
        return _grazing(place, spot)
    return (Lead(second, cut),) if second in SMOOTH and first == condition.kind else ()


_RESONANCES = {"1:1 resonance": 1.0, "1:2 resonance": -1.0}


def _real(name: str, place: Place) -> str:
    """The bifurcation of a multiplier 1 or -1."""
    if name == "1:1 resonance":
        return "fold"
    return "symmetry breaking" if getattr(place.map, "symmetry", None) is not None else "flip"


def _doubled(place: Place, condition: Critical) -> tuple[Lead, ...]:
    """The fold of the orbit that goes around twice."""
    if isinstance(place.map, Shooting):
        return ()
    v, _, _ = condition.null(place)
    return (Lead("fold", (exact(place.map).doubled(), place.x, False), direction=v / np.linalg.norm(v)),)


def _grazing(place: Place, spot: Spot) -> tuple[Lead, ...]:
    """The touching orbit, from one whose impact has no speed."""
    map_: Any = place.map
    base = map_.base
    D, t = base.duration, float(place.x[-1])
    begin = t - map_.before * D
    start = base.at_phase(begin / base.forcing_period)
    orbit: Any = spot.orbit
    since = (begin - orbit.map.start_time) % D
    run = orbit.map.solved(orbit.x, orbit.map.start_time + since, orbit.map.system)
    if not run.success:
        return ()
    T = base.forcing_period
    window = Window(map_.name, 1, 0.0, (map_.before + map_.behind) * D / T, map_.before * D / T)
    return (Lead("grazing impact", (Windowed(start, window), run.x[:, -1], False)),)


def _of_one_side(problem: CurveProblem, place: Place, kind: str, side: str) -> tuple[Lead, ...]:
    """The fold, flip, ... of the orbits on one side of a change of itinerary."""
    slopes = problem.condition.slopes(place, np.empty(0))
    if slopes is None:
        return ()
    by = slopes[0, len(place.x) :] * problem.scales
    if not np.linalg.norm(by) > 0:
        return ()
    aside = SIDES[side] * _ASIDE * problem.scales * by / np.linalg.norm(by)
    values = {name: _value(place, name) + float(off) for name, off in zip(place.names, aside)}
    base = exact(place.map)
    map_ = base.map if isinstance(base, Shooting) else base
    try:
        orbit = refine(map_.with_parameters(values), place.x[: place.n])
    except ValueError:  # outside the assumptions of a parameter
        return ()
    return (Lead(kind, of_orbit(orbit, orbit.map)),) if orbit.success else ()


def change_along(one: PeriodicOrbit, other: PeriodicOrbit) -> Change:
    """What happens between two orbits of a curve; a jump at the threshold of a layer is a capture."""
    change = change_between(one, other)
    if change.name == JUMP and (at_threshold(one) or at_threshold(other)):
        return replace(change, name=CAPTURE)
    return change


def of_capture(orbit: PeriodicOrbit) -> tuple[Lead, ...]:
    """The curve of captures that passes at an orbit with one."""
    about = capture_cut(orbit, None)
    return () if isinstance(about, str) else (Lead(CAPTURE, *about),)


def leads_of_change(change: Change, one: PeriodicOrbit, other: PeriodicOrbit | None) -> tuple[Lead, ...]:
    """What begins where the itinerary changes along a curve, between an orbit and the one beyond."""
    if change.name == CAPTURE:
        return of_capture(one)
    letters = max(change.before, change.after, key=len)
    if not letters:
        return ()
    if change.name in TOUCHES:
        # The orbit that does not touch is regular.
        quiet = other if len(change.before) > len(change.after) and other is not None else one
        found = touched(quiet, letters[0].switch, change.time, change.name == "adding-sliding")
        return () if isinstance(found, str) else (Lead(change.name, found),)
    if change.name in (*ARRIVALS, *EXITS) and change.before:
        try:
            cut, event = at_event(one, change.name, change)
        except ValueError:
            return ()
        return (Lead(change.name, cut, event=event),)
    return ()


def _value(place: Place, name: str) -> float:
    return next(float(value) for p, value in place.map.system.parameters.items() if p.name == name)
