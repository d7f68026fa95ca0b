"""Capture thresholds of a layered view as curves in two parameters: where an arriving contact is just held.

    g(L(w_s), z*) = 0,   clearance(w_s) = 0      at one arrival of the orbit (separatrix.py), w_s an unknown
    max of s dh/dt over lambda = 0               of a layer without states, at its fold (holding.py)

To one side of it the contact is captured, to the other it goes through: the Poincare map jumps. Around the arrival the
motion is therefore solved by the view that decides as the orbit in question does: with the state of the layer slaved
(it captures as long as anything does) or in two stages (it lets through whatever does not have to stay). Both have the
slow motion of the finite ratio, so that the orbit is regular up to the threshold and beyond. Without states the models
of holding.py do the same; there the map jumps only if what is just held is held for a while.

Chain: separatrix.py, holding.py, tangencies.py, recutting.py -> **captures** -> curves/starts.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ....results.solution import Solution
from ...maps.holding import Strength, held, not_held, strength_of
from ...maps.sections import Stroboscopic
from ...maps.windows import Window, Windowed
from ...orbits.periodic_orbit import PeriodicOrbit
from ...orbits.recutting import Cut
from ...sticking.separatrix import FrozenLayer, frozen, one_state
from ..special import CAPTURE
from .conditions import Condition, Place
from .tangencies import Arrival, AtEvent

_AT = 1e-5  # of a clearance; beside a jump of the solver's own layer it is some 1e-7
_UNKNOWN = math.nan


class Capture(AtEvent):
    """At an arrival the layer's orbit meets the stable manifold of its saddle, at w_s = sinh of the extra unknown."""

    extras = 1

    def __init__(self, switch: str, ordinal: int) -> None:
        super().__init__(CAPTURE, switch, ordinal)

    def layer(self, place: Place) -> FrozenLayer | None:
        """The layer at the arrival."""
        found = self.state(place)
        if found is None:
            return None
        _, _, t, x, mult, side = found
        system = place.map.system
        j = [str(mu.symbol) for mu in system.model.multipliers].index(self.switch)
        return frozen(system.model, j, t, x, mult, np.array(system.parameter_values, float), side)

    def start(self, place: Place) -> np.ndarray:
        layer = self.layer(place)
        saddle = None if layer is None else layer.saddle()
        return np.array([_UNKNOWN if saddle is None else saddle])

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        layer = self.layer(place)
        if layer is None or not abs(extra[0]) < 30:
            return np.full(2, np.nan)
        return np.array([layer.still(layer.shape[0](math.sinh(extra[0]))), layer.clearance(float(extra[0]))])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray | None:
        return None

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        layer = self.layer(place)
        return {} if layer is None else {"capture + crossing-sliding": layer.turn(float(extra[0]))}

    def confirmed(self, name: str, place: Place) -> bool:
        return True

    def twin(self, place: Place) -> bool:
        return False

    def ends(self, name: str) -> str:
        if name == "capture + crossing-sliding":
            return "there the layer's saddle meets its node, and for larger ratios the fold decides"
        return ""

    def admissible(self, place: Place) -> bool:
        return True

    def beyond(self, place: Place, extra: np.ndarray) -> bool:
        layer = self.layer(place)
        return layer is None or layer.turn(float(extra[0])) < 0


class AtFold(Arrival):
    """At an arrival the layer just holds the motion, by its fold, and goes on to: the arriving motion is caught."""

    def __init__(self, switch: str, ordinal: int) -> None:
        super().__init__(CAPTURE, switch, ordinal)

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        """How fast the layer could hold more, along the motion that it holds."""
        found, model = self.state(place), place.map.system.model
        if found is None or not_held(model, self.switch):
            return {}
        _, _, t, x, mult, side = found
        rate = strength_of(model, self.switch, side).functions(held(model, self.switch))[1]
        p = np.array(place.map.system.parameter_values, float)
        return {"capture + crossing-sliding": float(rate(np.array([t]), x[:, None], mult[:, None], p)[0])}

    def confirmed(self, name: str, place: Place) -> bool:
        return True

    def twin(self, place: Place) -> bool:
        return False

    def ends(self, name: str) -> str:
        return "beyond it what is just held is let go at once, and nothing jumps"


def condition_at(event: tuple[str, int, bool]) -> Condition:
    """Of an arrival: switch, number, whether the fold of its layer decides."""
    switch, ordinal, fold = event
    return AtFold(switch, ordinal) if fold else Capture(switch, ordinal)


def clearances(orbit: PeriodicOrbit) -> list[tuple[str, int, float]]:
    """Of the arrivals within one application of an orbit's map: switch, number among its own, and the clearance.

    Empty where no layer has one state of a finite ratio, nor a hidden term; nan where the layer has no saddle, or holds
    most at its end.
    """
    model = orbit.system.model
    hidden = {str(mu.symbol) for mu in model.multipliers if mu.hidden and not not_held(model, str(mu.symbol))}
    if not (one_state(model) or hidden) or not isinstance(orbit.map, Stroboscopic):
        return []
    run = orbit.map._over(orbit.x, orbit.time)
    p, found, counts = np.array(orbit.system.parameter_values, float), [], {}  # type: ignore[var-annotated]
    names = [str(mu.symbol) for mu in model.multipliers]
    for e in run.events:
        if e.switch not in names or e.kind not in ("crossing", "stick") or not e.time > run.t[0]:
            continue
        column = int(np.searchsorted(run.t, e.time, side="left"))
        side, number = int(e.note.split(" to ")[0]), counts.get(e.switch, 0)
        x, mult = run.x[:, column], run.mult[:, column]
        if e.switch in hidden:
            clearance = _at_fold(strength_of(model, e.switch, side), model, e.time, x, mult, p)
        elif hidden:
            clearance = math.nan
        else:
            layer = frozen(model, names.index(e.switch), e.time, x, mult, p, side)
            saddle = layer.saddle()
            clearance = math.nan if saddle is None else layer.clearance(saddle)
        found.append((e.switch, number, clearance))
        counts[e.switch] = number + 1
    return found


def _at_fold(strength: Strength, model: Any, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> float:
    """c of an arrival; nan where the layer holds most at its end, or less and less: there nothing jumps."""
    at = np.array([t]), x[:, None], mult[:, None], p
    name = str(strength.lam)
    rate = strength.functions(held(model, name))[1](*at)[0]
    if abs(strength.level(model, *at)[strength.j, 0]) >= 1 or not rate > 0:
        return math.nan
    return float(strength.functions(model)[0](*at)[0])


def at_threshold(orbit: PeriodicOrbit) -> bool:
    """Whether an arrival of an orbit is just captured, or just not."""
    return any(abs(one[2]) < _AT for one in clearances(orbit))


def capture_cut(orbit: PeriodicOrbit, switch: str | None) -> tuple[Cut, tuple[str, int, bool]] | str:
    """The map that decides at one arrival as the orbit does, its point, and the arrival; in words why there is none.

    The arrival nearest to its threshold; of one switch, if that is given.
    """
    map_: Any = orbit.map
    fold = not one_state(orbit.system.model)
    if fold and not any(mu.hidden for mu in orbit.system.model.multipliers):
        return (
            "nothing in this system is hidden, and `layered` with one finite ratio, which gives a layer a state of its "
            "own, it is not"
        )
    near = [one for one in clearances(orbit) if switch in (None, one[0]) and math.isfinite(one[2])]
    if not near:
        return "no arrival has a saddle in its layer, or a fold"
    name, number, _ = min(near, key=lambda one: abs(one[2]))
    run = map_.solved(orbit.x, map_.start_time + map_.duration, map_.system)
    arrivals = [
        e for e in run.events if e.switch == name and e.kind in ("crossing", "stick") and e.time > run.t[0]
    ]
    at = arrivals[number]
    sticks, side = at.kind == "stick", int(at.note.split(" to ")[0])
    window = Window(name, side, 0.0, 0.0, 0.0)
    if fold:
        window = replace(window, arrives="caught" if sticks else "passed")
    else:
        window = replace(window, ratio=sp.oo if sticks else sp.Integer(0))
    return (*about(map_, [run], float(at.time), window), False), (name, 0, fold)


def about(map_: Any, runs: Sequence[Solution], t: float, window: Window) -> tuple[Windowed, np.ndarray]:
    """The map on a section before the arrival at the time t, with the view that decides there, and its point.

    From half way between the event before and the arrival to half way between the end of the stick (or the crossing)
    and the next event, or half way through the stick, of the runs over one application.
    """
    first, D, T = float(runs[0].t[0]), map_.duration, map_.forcing_period
    times = np.array([
        e.time for run in runs for e in run.events if e.time > first and e.kind != "sliding to sliding"
    ])  # fmt: skip

    def gap(since: float, sign: int) -> float:
        """From an event to the next one, or the one before."""
        away = sign * (times - since) % D
        return float(np.where((away > 1e-9 * D) & (away < (1 - 1e-9) * D), away, D).min())

    last = t + gap(t, 1) if window.ratio == sp.oo else t
    begin, end = t - 0.5 * gap(t, -1), last + 0.5 * gap(last, 1)
    shift = math.ceil((first - begin) / D - 1e-9) * D
    at = min(max(begin + shift, first), float(runs[-1].t[-1]))  # it may be on the section already
    run = next(r for r in runs if r.t[0] <= at <= r.t[-1])
    x = run.dense(np.array([at]))[0][:, 0]
    if shift and map_.symmetry is not None:
        x = np.linalg.matrix_power(np.linalg.inv(map_.symmetry), abs(round(shift / D))) @ x
    there = replace(window, begin=0.0, end=(end - begin) / T, near=(t - begin) / T)
    return Windowed(map_.at_phase(begin / T), there), x


def recentred(condition: Capture | AtFold, place: Place) -> tuple[Windowed, np.ndarray] | None:
    """The same with the window about the arrival where it has moved; None where it stands."""
    found, window, map_ = condition.state(place), place.map.window, place.map.base
    if found is None:
        return None
    part = (found[2] - map_.start_time) / map_.forcing_period
    moved = part / window.near
    rest = (window.end - part) / (window.end - window.near)
    if 0.7 < moved < 1.4 and 0.7 < rest < 1.4:
        return None
    return about(map_, place.image.runs, found[2], window)
