"""A curve of equilibria to one side: what is met on its way, what begins there, and why it ends.

Chain: equilibrium_walk.py, codimension.py -> **equilibrium_ways** -> equilibrium_curves.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...equilibria.equilibrium import Equilibrium, made
from ...equilibria.statics import Statics, beyond
from ..bracketing import zero_between
from ..codimension import Codimension2, Lead
from .conditions import BOUNDARY, Boundary, Hopf
from .walk import Point, Walk2

_INSIDE = 1e-7  # of a margin: what is less is the border itself
_TURNS = 1e-7  # of a unit tangent
CLOSED = "it closes."


def beyond_border(e: Equilibrium, j: int | None) -> tuple[int, int]:
    """Of the multiplier (that whose border is nearest) also the side beyond."""
    if j is None:
        own = len(e.x) - e.system.model.n_memory
        statics = Statics(e.system, e.sides, e.x[own:])
        inside = statics.margins(statics.unknowns(e.x, e.mult))[0]
        if not np.isfinite(inside).any():
            raise ValueError(
                "`start` has no switch or contact, so that it comes to no boundary; give another `kind`."
            )
        j = int(np.argmin(np.abs(inside)))
    return j, beyond(e.system.model.multipliers[j], e.sides[j], e.mult[j])


class EquilibriumWay:
    """A curve to one side: its points, what is met between them, and why it ends."""

    def __init__(
        self, walk: Walk2, bounds: np.ndarray, lengths: Any, most: int, virtual: bool, late: Callable[[], bool]
    ) -> None:
        self.walk, self.lengths, self.most, self.virtual, self.late = walk, lengths, most, virtual, late
        self.bounds = bounds / walk.unit[walk.size :, None]
        self.passed: list[Point] = []
        self.points: list[Codimension2] = []
        self.turns: list[Codimension2] = []
        self.end = ""

    def follow(self, here: Point, begins: bool) -> None:
        (step, longest, shortest), walk = self.lengths, self.walk
        self.passed, ds = [here], min(step, longest)
        while not self.end:
            if len(self.passed) >= self.most:
                self.end = f"stopped after {self.most} points (`max_points`)."
            elif self.late():
                self.end = f"`max_seconds` are used up at {self._where(here)}: give more."
            if self.end:
                return
            reach, there = self._stepped(here, ds)
            if there is None:
                ds = 0.3 * reach
                if ds < shortest:
                    self.end = f"no equilibrium was found beyond {self._where(here)} with steps down to {shortest:.1g}."
                continue
            if begins and len(self.passed) == 1 and not self.virtual and self._leaves(here, there):
                self.end = f"it begins at {self._where(here)}."
                return
            last = self._between(here, there, begins and len(self.passed) == 1)
            self.passed.append(there if last is None else last)
            if last is None:
                self._ended(there)
            ds = min(ds * (2.0 if there.steps <= 3 else 1.0 if there.steps <= 5 else 0.5), longest)
            here = there
            walk.condition.frame(here.spot)

    def _where(self, point: Point) -> str:
        return ", ".join(f"{name} = {value:.10g}" for name, value in self.walk.values(point).items())

    def _stepped(self, here: Point, ds: float) -> tuple[float, Point | None]:
        """One step, no further than the border of the ranges, and its length."""
        size, there = self.walk.size, None
        ahead = [(*self._reach(here, k), k) for k in (0, 1)]
        reach, border, k = min(ahead)
        if reach > ds:
            there = self.walk.step(here, ds)
            if there is None:
                return ds, None
            past = [k for k in (0, 1) if not self.bounds[k][0] <= there.u[size + k] <= self.bounds[k][1]]
            if not past:
                return ds, there
            # The way bends: beyond the border a parameter may have no meaning.
            k, reach = past[0], ds
            border = self.bounds[k][int(there.u[size + k] > self.bounds[k][1])]
        way = here.tangent if there is None else there.u - here.u
        guess, normal = (
            here.u + way * (border - here.u[size + k]) / way[size + k],
            np.eye(len(here.u))[size + k],
        )
        guess[size + k] = border
        at = self.walk.correct(guess, normal, here.tangent)
        return reach, at if at is not None and np.linalg.norm(at.u - here.u) <= 2 * reach + 1e-12 else None

    def _reach(self, here: Point, k: int) -> tuple[float, float]:
        """How far it is to the border of a parameter's range, and that."""
        rate, at = here.tangent[self.walk.size + k], here.u[self.walk.size + k]
        border = float(self.bounds[k][int(rate > 0)])
        reach = (border - at) / rate if rate else math.inf
        return (reach if reach > 0 else math.inf), border

    def _leaves(self, here: Point, there: Point) -> bool:
        """Whether a way leads from the border of the mode out of it at once."""
        genuine = self.walk.condition.genuine(there.spot)
        own = self._own()
        out = [
            j
            for j, margin in enumerate(there.margins)
            if j != own and margin < 0 and abs(here.margins[j]) < _INSIDE
        ]
        return bool(out) or not genuine

    def _own(self) -> int | None:
        return self.walk.condition.j if isinstance(self.walk.condition, Boundary) else None

    def _between(self, here: Point, there: Point, born: bool) -> Point | None:
        """Locates what happens on the way between two points; the last point, where the curve ends there."""
        walk, condition, found = self.walk, self.walk.condition, []
        for name in here.tests:
            a, b = here.tests[name], there.tests.get(name, math.nan)
            if not a * b < 0 or born and abs(a) < 1e-6 * abs(b):
                continue
            at = zero_between(walk, here, there, _test(name))
            if at is not None and abs(at.tests[name]) <= 0.01 * (abs(a) + abs(b)) and self._is(name, at):
                found.append((at, name, condition.ends(name), self._leads(name, at, None)))
        for j, (a, b) in enumerate(zip(here.margins, there.margins)):
            if j == self._own() or not a * b < 0 or born and abs(a) < _INSIDE:
                continue
            at = zero_between(walk, here, there, _margin(j))
            if at is not None:
                name = f"{condition.kind} + {BOUNDARY}" if condition.kind != BOUNDARY else f"{BOUNDARY} twice"
                why = "beyond it the equilibrium is virtual" if a > 0 and not self.virtual else ""
                found.append((at, name, why, self._leads(name, at, j)))
        self._turned(here, there)
        chord = there.u - here.u
        for at, name, why, leads in sorted(found, key=lambda one: (one[0].u - here.u) @ chord):
            self.points.append(Codimension2(name, walk.values(at), at.equilibrium, why, leads))
            if why:
                self.end = f"{name} at {self._where(at)}: {why}."
                return at
        return None

    def _is(self, name: str, at: Point) -> bool:
        """Whether a zero is what its name says: of a boundary's Hopf point no neutral saddle."""
        kind = name.removeprefix(f"{BOUNDARY} + ")
        if not kind.startswith("Hopf") or kind == name:
            return True
        condition = self.walk.condition
        spot = condition.beside(at.spot) if kind.endswith("beside") else at.spot
        return spot is not None and Hopf("Hopf").genuine(spot)

    def _leads(self, name: str, at: Point, j: int | None) -> tuple[Lead, ...]:
        """The curves that begin or pass there."""
        e, kind = at.equilibrium, self.walk.condition.kind
        cut = (e, e.x, False)
        if j is not None:
            return (Lead(BOUNDARY, cut, beyond_border(e, j)),)
        hopf = "sliding Hopf" if e.kind == "pseudo-equilibrium" else "Hopf"
        if name == "Bogdanov-Takens":
            return (Lead(hopf if kind == "fold" else "fold", cut),)
        second = name.partition(" + ")[2]
        if isinstance(self.walk.condition, Boundary) and second.endswith("beside"):
            spot = self.walk.condition.beside(at.spot)
            if spot is None:
                return ()
            there = made(spot.statics, spot.u, 0.0, 0, spot.system)
            cut, second = (there, there.x, False), second.removesuffix(" beside")
            hopf = "sliding Hopf" if there.kind == "pseudo-equilibrium" else "Hopf"
        if second in ("fold", "Hopf"):
            return (Lead(hopf if second == "Hopf" else "fold", cut),)
        return ()

    def _turned(self, here: Point, there: Point) -> None:
        for k, name in enumerate(self.walk.names, self.walk.size):
            rates = here.tangent[k], there.tangent[k]
            if rates[0] * rates[1] < 0 and max(np.abs(rates)) > _TURNS:
                at = zero_between(self.walk, here, there, _rate(k))
                if at is not None:
                    self.turns.append(Codimension2(f"turns in {name}", self.walk.values(at), at.equilibrium))

    def _ended(self, there: Point) -> None:
        """Whether the curve has reached the border of the ranges, or closes."""
        size, walk = self.walk.size, self.walk
        for k in (0, 1):
            low, high = self.bounds[k]
            at, rate = there.u[size + k], there.tangent[size + k]
            past = high if at >= high and rate > 0 else low if at <= low and rate < 0 else None
            if past is not None:
                self.end = f"reached {walk.names[k]} = {past * walk.unit[size + k]:.9g}."
                return
        if len(self.passed) < 5:
            return
        first, chord = self.passed[0], there.u - self.passed[-2].u
        to, length = first.u - self.passed[-2].u, float(chord @ chord)
        if length and 0 <= to @ chord <= length and first.tangent @ chord > 0.8 * math.sqrt(length):
            if np.linalg.norm(to - chord * (to @ chord) / length) < 0.2 * math.sqrt(length):
                self.end = CLOSED


def _test(name: str) -> Callable[[Point], float]:
    return lambda point: point.tests.get(name, math.nan)


def _margin(j: int) -> Callable[[Point], float]:
    return lambda point: float(point.margins[j])


def _rate(k: int) -> Callable[[Point], float]:
    return lambda point: float(point.tangent[k])
