"""The end of complete chatter as a curve in two parameters: bounces that accumulate just where the contact opens.

    w = u alpha/a**2,   w_n+1 = W(w_n),   w* = (1 - r)(2 + r)/6,   e = r**2 (2 + r)/(1 + 2 r)

u is the speed at which a bounce begins, a the acceleration towards the wall, alpha the rate at which that goes to 0.
Where a falls evenly, the next bounce has w that is a function of this one's, with the fixed point w*: there bounces
become shorter by the ratio r for ever, until a is 0. It repels, by Lambda = (2 + r)**2/(r (1 + 2 r)**2) a bounce: from
less w the bounces come to an end before, from more the contact opens first. So the orbit at which complete chatter
ends has its n-th bounce at w* but for (r/Lambda)**n, and

    c = (w_n/w* - 1)/Lambda**n,   of which the last error is extrapolated away,

is a smooth function of everything to both sides, whatever number of bounces there is. r is an unknown of its own.

Source: A. B. Nordmark, P. T. Piiroinen, Nonlinear Dynamics 58 (2009) 85-106, for complete and incomplete chatter.

Chain: tangencies.py -> **chatter** -> curves/starts.py.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp

from ....definition.model import Model
from ....definition.regularity import total_derivative
from ....paths.derivatives.linearised import linearise
from ...maps.holding import index_of
from ...maps.parts import function_of
from ...maps.poincare import Word, after_start
from ...maps.sections import Stroboscopic
from ...maps.windows import Windowed
from ...orbits.periodic_orbit import PeriodicOrbit
from .conditions import Place
from .tangencies import AtEvent

_NEAR = 0.3  # of w*: so near to it bounces repeat themselves but for their size
_SLOWEST = 1e-6  # of the fastest impact: slower ones are known to too few digits
_PLAIN = ("impact", "closed contact", "accumulation", "opening")


class EndOfChatter(AtEvent):
    """The bounces behind the `ordinal`-th one of a contact accumulate just where it opens."""

    extras = 1
    arrives = False
    in_segments = False

    def events(self, image: Any) -> list[tuple[int, int]]:
        return [
            (i, k)
            for i, part in enumerate(image.parts)
            for k, e in enumerate(part.run.events)
            if e.switch == self.switch and e.kind == "impact" and e.time > after_start(part.run)
        ]

    def word(self, place: Place) -> Word:
        """Without the contact's own events: how many bounces there are says nothing."""
        return tuple(
            (e.switch, e.kind, e.note)
            for part in place.image.parts
            for e in part.run.events
            if e.time > after_start(part.run) and not (e.switch == self.switch and e.kind in _PLAIN)
        )

    def bounce(self, place: Place, own: tuple[int, int]) -> tuple[float, float, np.ndarray, np.ndarray] | None:
        """w and e of an impact, and their slopes by the point on the section and the parameters."""
        i, k = own
        part, model = place.image.parts[i], place.map.system.model
        event = part.run.events[k]
        if not len(part.instant_t):
            return None
        column = int(np.searchsorted(part.run.t, event.time, side="left"))
        x, mult = part.run.x[:, column], np.zeros(len(model.multipliers))
        instant = int(np.argmin(np.abs(part.instant_t - event.time)))
        chosen = tuple(p for name in place.names for p in part.run.system.parameters if p.name == name)
        line, p, n = linearise(model, chosen), part.run.tape.p, len(x)
        values, slopes = [], []
        for e in expressions(model, self.switch):
            w, by_time, _ = line.gradient(e, event.time, x, mult, p)
            row = w[:n] @ part.instant_w[instant, :n] + by_time * part.instant_dt[instant]
            row[n:] += w[n:]
            values.append(float(function_of(model, e)(np.array([event.time]), x[:, None], mult[:, None], p)[0]))
            slopes.append(row)
        return values[0], values[1], slopes[0], slopes[1]

    def chosen(self, place: Place, r: float) -> list[tuple[int, tuple[float, float, np.ndarray, np.ndarray]]]:
        """The last two bounces that repeat themselves and are known well, by their number."""
        at, fastest, found = fixed(r)[0], 0.0, []
        for number, own in enumerate(self.events(place.image)[self.ordinal :]):
            one = self.bounce(place, own)
            if one is None:
                break
            speed = self.speed(place, own)
            fastest = max(fastest, speed)
            if speed < _SLOWEST * fastest:
                break
            if abs(one[0] / at - 1) < _NEAR:
                found.append((number, one))
        return found[-2:]

    def speed(self, place: Place, own: tuple[int, int]) -> float:
        model = place.map.system.model
        run = place.image.parts[own[0]].run
        event = run.events[own[1]]
        x = run.x[:, int(np.searchsorted(run.t, event.time, side="left"))]
        h = function_of(model, approach(model, self.switch))
        mult = np.zeros((len(model.multipliers), 1))
        return abs(float(h(np.array([event.time]), x[:, None], mult, run.tape.p)[0]))

    def start(self, place: Place) -> np.ndarray:
        found = self.events(place.image)[self.ordinal :]
        one = self.bounce(place, found[0]) if found else None
        e = np.nan if one is None else one[1]
        return np.array([_ratio(e)])

    def _both(self, place: Place, extra: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """c and the equation of r, and their slopes (2, n + 3)."""
        r, found = float(extra[0]), []
        if 0 < r < 1:
            found = self.chosen(place, r)
        if len(found) < 2:
            return None
        at, grows, at_r, grows_r = fixed(r)
        q = r / grows
        q_r = 1 / grows - r * grows_r / grows**2
        (_, early), (n, late) = found
        # delta_n = (w_n/w* - 1)/Lambda^n = delta + C q^n: without C.
        ends = []
        for number, (w, _, w_x, _) in ((n - 1, early), (n, late)):
            size = grows**-number
            by_r = -w * at_r / at**2 * size - number * grows_r / grows * (w / at - 1) * size
            ends.append(((w / at - 1) * size, np.append(w_x / at * size, by_r)))
        (d0, s0), (d1, s1) = ends
        value, slope = (d1 - q * d0) / (1 - q), (s1 - q * s0) / (1 - q)
        slope[-1] += q_r * (-d0 * (1 - q) + (d1 - q * d0)) / (1 - q) ** 2
        _, e, _, e_x = late
        other = e * (1 + 2 * r) - r**2 * (2 + r)
        other_slope = np.append(e_x * (1 + 2 * r), 2 * e - 4 * r - 3 * r**2)
        return np.array([value, other]), np.array([slope, other_slope])

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        found = self._both(place, extra)
        return np.full(2, np.nan) if found is None else found[0]

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray | None:
        found = self._both(place, extra)
        return None if found is None else found[1]

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        return {}

    def twin(self, place: Place) -> bool:
        return False

    def admissible(self, place: Place) -> bool:
        return True


def fixed(r: float) -> tuple[float, float, float, float]:
    """w* and Lambda, and their derivatives by r."""
    at, at_r = (1 - r) * (2 + r) / 6, -(1 + 2 * r) / 6
    grows = (2 + r) ** 2 / (r * (1 + 2 * r) ** 2)
    return at, grows, at_r, grows * (2 / (2 + r) - 1 / r - 4 / (1 + 2 * r))


def _ratio(e: float) -> float:
    """r of a restitution, nan where that is none."""
    from scipy.optimize import brentq

    if not 0 < e < 1:
        return np.nan
    return float(brentq(lambda r: r**2 * (2 + r) - e * (1 + 2 * r), 0.0, 1.0, xtol=1e-15))


@functools.lru_cache(maxsize=64)
def expressions(model: Model, name: str) -> tuple[sp.Expr, sp.Expr]:
    """w and e of an impact at the state before it."""
    mu = model.multipliers[index_of(model, name)]
    assert mu.surface is not None and mu.impact is not None
    free = {other.symbol: sp.Integer(0) for other in model.multipliers if other.kind == "contact"}
    rates = [e.xreplace(free) for e in model.rhs]
    h: list[sp.Expr] = [mu.surface]
    for _ in range(3):
        h.append(total_derivative(h[-1], model.time, model.states, rates))
    behind = dict(zip(model.states, mu.impact))
    first, second, third = (e.xreplace(behind) for e in h[1:])
    return first * third / second**2, -first / h[1]


@functools.lru_cache(maxsize=64)
def approach(model: Model, name: str) -> sp.Expr:
    """dh/dt of a contact that is open."""
    mu = model.multipliers[index_of(model, name)]
    assert mu.surface is not None
    return total_derivative(mu.surface, model.time, model.states, model.rhs).xreplace(
        {mu.symbol: sp.Integer(0)}
    )


def chatter_cut(
    orbit: PeriodicOrbit, switch: str
) -> tuple[tuple[Any, np.ndarray, bool], tuple[str, int]] | str:
    """The map without a window, its point, and from which impact on the bounces accumulate; why not, in words."""
    if not isinstance(orbit.map, Stroboscopic):
        return "it is no orbit of a driven system"
    map_ = Windowed(orbit.map)
    image: Any = map_.image(orbit.x, ())
    if not image.success:
        return f"it is not run through: {image.reason}"
    events = [e for part in image.parts for e in part.run.events if e.switch == switch]
    closed = [k for k, e in enumerate(events) if e.kind == "closed contact"]
    if not closed:
        return f"nothing accumulates at {switch} on this side of it"
    # Those since the contact opened, or the section.
    last = closed[-1]
    first = next((k for k in range(last, -1, -1) if events[k].kind == "opening"), -1)
    ordinal = sum(e.kind == "impact" for e in events[: max(first, 0)])
    return (map_, orbit.x, False), (switch, ordinal)


def accumulates(orbits: Sequence[PeriodicOrbit | None]) -> PeriodicOrbit | None:
    """The first of some orbits in which a contact closes behind bounces."""
    closes = (o for o in orbits if o is not None and any(kind == "closed contact" for _, kind, _ in o.word))
    return next(closes, None)
