"""Conditions on how an orbit comes to a surface, stays on it and leaves it: c(x, p, q) = 0, with exact slopes.

    grazing of a stop, a surface, an event; grazing-sliding    the smallest s h of a window is 0 (windows.py)
    adding-sliding                                             the smallest 1 -+ lambda of a stick without bounds is 0
    the same of what is let go by a fold                       the speed of its release is 0 (impacts.py)
    crossing-sliding, switching-sliding                        the largest s dh/dt over the layer is 0 at an arrival
    exit by a fold                                             d(dh/dt)/d lambda is 0 at the end where a stick is left
    border collision                                           h is 0 on the section

Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for what these are.

Chain: conditions.py, windows.py, impacts.py -> **tangencies** -> curves/problem.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....paths.derivatives.linearised import linearise
from ...maps.holding import strength_of
from ...maps.impacts import EventImage, FromImpact
from ...maps.parts import function_of
from ...maps.pieces import spectrum, spread
from ...maps.poincare import RETURN, Word, after_start
from ...maps.segments import Shooting
from .conditions import Condition, Place, factors, on_circle, pairs

DEGENERATE = "degenerate grazing"
SEVERAL = (2, 3)  # periods with one impact in all
TOGETHER = 1e-3  # of the period: events that come and go together at a change of itinerary
_ASIDE = 1e-8  # of c: so far to either side of it the map's slope is looked at
SIDES = {"below": -1.0, "above": 1.0}
_TWIN = 1e-7


class Touch(Condition):
    """The orbit comes to a surface and touches it: the smallest s h of a window is 0 (windows.py)."""

    of_multipliers = False

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        near = place.image.approach
        return np.array([np.nan if near is None else near.h])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray | None:
        near = place.image.approach
        return None if near is None else near.slopes[None]

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        near, mu = place.image.approach, place.multipliers
        flip = "symmetry breaking" if getattr(place.map, "symmetry", None) is not None else "flip"
        found = {
            f"{self.kind} + fold": factors(mu, 1), f"{self.kind} + {flip}": factors(mu, -1),
            f"{self.kind} + torus": pairs(mu), f"{self.kind} twice": near.others / (1 + near.others)
            if np.isfinite(near.others) else 1.0,
        }  # fmt: skip
        side = self.side_of_impacts(place)
        if side is None:
            return found
        # Where orbits with an impact in each period change sides, those with one in several do too: that is known.
        more = {
            f"{DEGENERATE}, period {m}": self.side_of_impacts(place, m) for m in SEVERAL if place.map.driven
        }
        return {
            DEGENERATE: side,
            **{name: other / side for name, other in more.items() if other and side},
            **found,
        }

    def impacts(self, place: Place, periods: int = 1) -> tuple[FromImpact, np.ndarray] | None:
        """The motion from contact to contact some periods later, and its point there; None where none is described."""
        map_, near, T = place.map, place.image.approach, 1.0
        if isinstance(map_, Shooting):
            return None
        contacts = [str(mu.symbol) for mu in map_.system.model.multipliers if mu.kind == "contact"]
        if map_.window.name not in contacts or getattr(map_.base, "symmetry", None) is not None:
            return None
        D = place.image.time
        if map_.driven:
            T = map_.forcing_period
        at = (near.place - (map_.start_time if map_.driven else 0.0)) / T
        behind, before = ((part * T / D) for part in (map_.window.end - at, at - map_.window.begin))
        # In the periods between the orbit touches too, and does not hit: there the wall is left out.
        behind, before = (periods - 1 + behind) / periods, before / periods
        base = replace(map_.base, count=periods * map_.base.count) if periods > 1 else map_.base
        contact = FromImpact(base, map_.window.name, behind, before)
        return contact, np.append(near.x, near.place if map_.driven else D)

    def side_of_impacts(self, place: Place, periods: int = 1) -> float | None:
        """det K(1) from contact to contact: its sign says to which side orbits with a slow impact exist."""
        found = self.impacts(place, periods)
        image = None if found is None else found[0].image(found[1], ())
        if not isinstance(image, EventImage):
            return None
        A, B = image.pencil
        K = B - A
        return float(np.linalg.det(K / (1e-300 + np.linalg.norm(K, axis=1, keepdims=True))))

    def ends(self, name: str) -> str:
        if name == f"{self.kind} twice":
            return "beyond it the orbit crosses the surface elsewhere, and the curve is virtual"
        return ""


class LetGo(Condition):
    """What a fold lets go has no speed there: a moment later the layer could have held it (impacts.py).

    On the other side of the curve it does, so that the orbits that are let go end there.
    """

    of_multipliers = False

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return np.array([place.image.speed])

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        return {f"{self.kind} + {change}": value for change, value in place.image.more.items()}

    def ends(self, name: str) -> str:
        return "there the fold comes to the end of the layer, and a slip begins with no speed"

    def admissible(self, place: Place) -> bool:
        return True


class TwoSided(Condition):
    """The map has another slope on either side of c = 0: what its multipliers do is looked at on both."""

    of_multipliers = False

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        found: dict[str, float] = {}
        flip = "symmetry breaking" if getattr(place.map, "symmetry", None) is not None else "flip"
        for side in SIDES:
            mu = self._beside(place, slopes, side)
            if mu is None:
                continue
            found |= {
                f"{self.kind} + fold, {side}": factors(mu, 1), f"{self.kind} + {flip}, {side}": factors(mu, -1),
                f"{self.kind} + torus, {side}": pairs(mu),
            }  # fmt: skip
        return found

    def confirmed(self, name: str, place: Place) -> bool:
        if "torus" not in name:
            return True
        slopes = self.slopes(place, np.empty(0))
        mu = None if slopes is None else self._beside(place, slopes, name.rpartition(", ")[2])
        return mu is not None and on_circle(mu)

    @staticmethod
    def _beside(place: Place, slopes: np.ndarray, side: str) -> np.ndarray | None:
        """Multipliers on a side, from slopes at two distances to it."""
        w = np.append(place.x, [_value(place.map, name) for name in place.names])
        near = []
        for aside in (_ASIDE, 2 * _ASIDE):
            u = w + SIDES[side] * aside * slopes[0] / (slopes[0] @ slopes[0])
            near.append(_slope_at(place, u))
        # To c = 0, along a line.
        slope = 2 * near[0] - near[1]
        return spectrum(place.map, slope) if np.isfinite(slope).all() else None


class Border(TwoSided):
    """A surface h(x, p) = 0 on the section: a fixed point of a map meets the border of its branches."""

    kind = "border collision"

    def __init__(self, surface: Any) -> None:
        self.surface = surface

    def _row(self, place: Place) -> tuple[float, np.ndarray]:
        system = place.map.system
        model = system.model
        chosen = tuple(p for name in place.names for p in system.parameters if p.name == name)
        mult, values = np.zeros(len(model.multipliers)), np.array(system.parameter_values, float)
        t = getattr(place.map, "start_time", 0.0)
        x, number = place.x[: place.n], len(place.x) // place.n
        h = function_of(model, self.surface)(np.array([t]), x[:, None], mult[:, None], values)[0]
        slopes = linearise(model, chosen).gradient(self.surface, t, x, mult, values)[0]
        return float(h), spread(slopes, 0, number, place.n)

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return np.array([self._row(place)[0]])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return self._row(place)[1][None]


class AtEvent(TwoSided):
    """Something vanishes at one event of the orbit: the events are known with their slopes (windows.py).

    `ordinal` counts the switch's events of its sort: those that come to the surface, or those that leave a stick.
    """

    arrives = True

    def __init__(self, kind: str, switch: str, ordinal: int) -> None:
        self.kind, self.switch, self.ordinal = kind, switch, ordinal

    def events(self, image: Any) -> list[tuple[int, int]]:
        """The events that are counted: in which part of the orbit, and their places among all of its run."""
        return [
            (i, k)
            for i, part in enumerate(image.parts)
            for k, e in enumerate(part.run.events)
            if e.switch == self.switch and e.time > after_start(part.run)
            and (e.kind in ("crossing", "stick")) == self.arrives
            and (self.arrives or e.kind.startswith("slip by"))
        ]  # fmt: skip

    def times(self, image: Any) -> list[float]:
        """Their times, since the section."""
        begins = np.cumsum([0.0, *(float(part.run.t[-1] - part.run.t[0]) for part in image.parts)])
        runs = [part.run for part in image.parts]
        return [begins[i] + runs[i].events[k].time - runs[i].t[0] for i, k in self.events(image)]

    def place_of(self, image: Any) -> tuple[int, int] | None:
        """Of the event itself; None where the orbit does not have it."""
        found = self.events(image)
        return found[self.ordinal] if self.ordinal < len(found) else None

    def word(self, place: Place) -> Word:
        """Without a slip that follows at once, which comes and goes along the curve."""
        parts, own = place.image.parts, self.place_of(place.image)
        near = TOGETHER * place.image.time
        letters = []
        for i, part in enumerate(parts):
            at = parts[own[0]].run.events[own[1]].time if own is not None and own[0] == i else np.nan
            for k, e in enumerate(part.run.events):
                if not e.time > after_start(part.run) or e.switch == RETURN:
                    continue
                if e.switch == self.switch and abs(e.time - at) <= near:
                    if (i, k) == own:
                        sort = "arrival" if self.arrives else "slip"
                        letters.append((e.switch, sort, e.note.split(" to ")[0]))
                    continue
                letters.append((e.switch, e.kind, e.note))
        return tuple(letters)

    def state(
        self, place: Place, own: tuple[int, int] | None = None
    ) -> tuple[int, int, float, np.ndarray, np.ndarray, int] | None:
        """Of the event: part, instant, time, state and multipliers before it, and the side it comes from or goes to."""
        own = self.place_of(place.image) if own is None else own
        if own is None or not len(place.image.parts[own[0]].instant_t):
            return None
        part = place.image.parts[own[0]]
        run, event = part.run, part.run.events[own[1]]
        column = int(np.searchsorted(run.t, event.time, side="left"))
        sides = event.note.split(" to ")
        side = int(sides[0] if self.arrives else sides[1])
        instant = int(np.argmin(np.abs(part.instant_t - event.time)))
        return own[0], instant, event.time, run.x[:, column], run.mult[:, column].copy(), side

    def measured(self, place: Place, own: tuple[int, int] | None = None) -> tuple[float, np.ndarray] | None:
        """c and its slopes by the point on the section (those of segments) and the parameters, (n + 2,)."""
        found = self.state(place, own)
        if found is None:
            return None
        i, instant, t, x, mult, side = found
        part = place.image.parts[i]
        model, n = place.map.system.model, len(x)  # in a window the run has another one
        chosen = tuple(p for name in place.names for p in part.run.system.parameters if p.name == name)
        line, p = linearise(model, chosen), part.run.tape.p
        j = next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == self.switch)
        e, value, mult = self.quantity(line, j, t, x, mult, p, side)
        w, by_time, _ = line.gradient(e, t, x, mult, p)
        slopes = w[:n] @ part.instant_w[instant, :n] + by_time * part.instant_dt[instant]
        slopes[n:] += w[n:]
        nodes = getattr(place.image, "nodes", None)
        return value, slopes if nodes is None else spread(slopes, nodes[i], len(place.x) // n, n)

    def quantity(
        self, line: Any, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
    ) -> tuple[Any, float, np.ndarray]:
        """The expression that is 0, its value, and the multipliers with which it is evaluated."""
        raise NotImplementedError

    def twin(self, place: Place) -> bool:
        """Whether the same holds at another event too, as it does all along a curve of symmetric orbits."""
        own = self.place_of(place.image)
        found = [self.measured(place, k) for k in self.events(place.image) if k != own]
        return any(abs(other[0]) < _TWIN for other in found if other is not None)

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        found = self.measured(place)
        return np.array([np.nan if found is None else found[0]])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray | None:
        found = self.measured(place)
        return None if found is None else found[1][None]


class Arrival(AtEvent):
    """The orbit comes to a surface where it begins to be held: the largest s dh/dt of lambda in [-1, 1] is 0 there.

    It comes from the side s with s dh/dt < 0, and lambda goes to -s: what stops it is the first zero on the way. With
    lambda linear the largest value is that at -s (the field beyond is tangent); of a hidden term, that of its fold.
    """

    def quantity(
        self, line: Any, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
    ) -> tuple[Any, float, np.ndarray]:
        strength = strength_of(line.model, self.switch, side)
        at = np.array([t]), x[:, None], mult[:, None], p
        mult = strength.level(line.model, *at)[:, 0]
        return strength.expression, float(strength.functions(line.model)[0](*at)[0]), mult


class Exit(AtEvent):
    """The orbit leaves a stick at the end of the layer and at its fold at once: d(dh/dt)/d lambda is 0 at that end."""

    arrives = False

    def quantity(
        self, line: Any, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
    ) -> tuple[Any, float, np.ndarray]:
        e = line.speed(j).diff(line.symbols[j])
        mult[j] = float(side)
        return e, float(function_of(line.model, e)(np.array([t]), x[:, None], mult[:, None], p)[0]), mult


def _slope_at(place: Place, w: np.ndarray) -> np.ndarray:
    """DP at another (x, p, q); nan where there is none."""
    n = len(place.x)
    try:
        image = place.map.with_parameters(dict(zip(place.names, map(float, w[n:])))).image(w[:n], ())
    except ValueError:  # outside the assumptions of a parameter
        return np.full((n, n), np.nan)
    return image.jacobian if image.success else np.full((n, n), np.nan)


def _value(map_: Any, name: str) -> float:
    return next(float(value) for p, value in map_.system.parameters.items() if p.name == name)
