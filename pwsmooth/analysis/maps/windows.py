"""Poincare maps whose motion keeps to one side of a surface for a while: what makes grazing a regular equation.

    x(t0) --exact--> x(t_a) --lambda = +-1, no contact; or held--> x(t_b) --exact--> P(x)

Between t_a and t_b one surface acts on nothing: the motion may come to it, touch it and go beyond, smoothly, where the
exact map has the square root of the distance. The extreme of h in the window and its slopes are smooth there (the
envelope theorem: dh = h_x dx + h_q dq at the instant of the extreme), and where that is 0 the map is the exact one.

Chain: sections.py, holding.py -> **windows** -> tangencies.py.
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...definition.model import Model
from ...paths.derivatives.linearised import linearise
from ...results.solution import Solution
from .first_order import chosen_parameters
from .holding import caught, held, passed, strength_of
from .parts import Part, functions_of, minima, one_sided, part_of, seeds_of, surface_of, with_ratio
from .poincare import RETURN, Image, lost, why_stopped
from .sections import Leg, Stroboscopic

WIDEST = 0.25  # of one application of the map: a window to either side of what it is about
TOUCHED = 1e-6  # in the unit of h: an orbit that touches


@dataclass(frozen=True)
class Approach:
    """The extreme of s h in a window: s h is smallest there.

    `place` is its time, `h` the value of s h, `slopes` (n + k,) by the point on the section and the parameters, `x` the
    state there, `others` the smallest s h at other extremes in the window.
    """

    place: float
    h: float
    slopes: np.ndarray
    x: np.ndarray
    others: float


@dataclass(frozen=True)
class PartedImage(Image):
    """An image whose runs are known with the deviations at their events."""

    parts: tuple[Part, ...] = ()
    approach: Approach | None = None


@dataclass(frozen=True)
class Window:
    """Where a surface acts on nothing: its name, its side s, times from the section (driven: parts of the period)."""

    name: str
    side: int
    begin: float
    end: float
    near: float  # the extreme of the last orbit, likewise
    held: bool = False  # the motion stays on the surface, and instead of s h there is what more could be held
    ratio: Any = None  # of the layer's states instead of their own, while the surface acts as it does
    arrives: str = ""  # "caught" or "passed": what comes from the side is held, or let through

    @property
    def decides(self) -> bool:
        """Whether it is about an arrival, not about an extreme."""
        return self.ratio is not None or bool(self.arrives)


@dataclass(frozen=True)
class Windowed:
    """A map with a window, or in one piece without.

    It has what orbits, curves and their points ask of a map; all else it leaves to the map that it is made of.
    """

    base: Any
    window: Window | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "base":
            raise AttributeError(name)
        return getattr(self.base, name)

    def with_parameters(self, values: Any) -> Windowed:
        return replace(self, base=self.base.with_parameters(values))

    @property
    def driven(self) -> bool:
        return isinstance(self.base, Stroboscopic)

    @property
    def approached(self) -> Approached:
        assert self.window is not None
        return approached(self.base.system.model, self.window)

    def image(self, x: Any, parameters: Sequence[Any] | None = None) -> Image:
        if self.driven:
            return self.closed(self.leg(x, (0, 0.0, float(self.turns)), parameters))
        image = self.leg(x, (0, 0.0, math.inf), parameters)
        for k in range(1, self.turns):
            if image.success:
                image = _joined(image, self.base.leg(image.x, (k, 0.0, math.inf), tuple(parameters or ())))
        return image

    def leg(self, x: Any, leg: Leg, parameters: Sequence[Any] | None = None) -> Image:
        """The flow over a leg, as of the map that it is made of; with the approach where the window is within it."""
        base, names, n = self.base, tuple(parameters or ()), len(x)
        chosen = chosen_parameters(base.system, names)
        columns = n + len(chosen)
        slope = np.zeros(columns)
        T, begins, phase = 1.0, 0.0, 0.0
        if self.driven:
            T, begins, phase = base.forcing_period, base.start_time, base.phase
            slope[n:] = [base._period_slope(q) for q in chosen]
        seeds = seeds_of(base.system.model, chosen, n)
        found = PartedImage(np.asarray(x, float), 0.0, (), np.eye(n), np.zeros((n, len(chosen))))
        for first, end, window in self._spans(leg):
            W = np.hstack([found.jacobian, found.by_parameter])
            if end == math.inf:
                rest = base.leg(found.x, (leg[0], first, end), names)
                part = part_of(rest.runs[0], chosen, W, seeds, (slope, slope)) if rest.success else None
                if rest.success and part is None:
                    return lost(n, (*found.runs, *rest.runs), _NO_SERIES)
                return _joined(found, rest, part)
            there = base.system if window is None else in_window(base.system, window)
            span = (begins + first * T, begins + end * T)
            run = base._solve(there, span, found.x, True)
            runs = (*found.runs, run)
            if not (run.success and run.t[-1] == span[1]):
                return lost(n, runs, why_stopped(run))
            wanted, approach = None, found.approach
            if window is not None and not window.decides and (first, end) == (window.begin, window.end):
                wanted = nearest(run, self.approached, window, T, begins)
                if wanted is None:
                    return lost(n, runs, "h has no extreme in the window.")
            moves = (slope * (phase + first), slope * (phase + end))
            part = part_of(run, chosen, W, seeds, moves, None if wanted is None else np.array([wanted[0]]))
            if part is None:
                return lost(n, runs, _NO_SERIES)
            if wanted is not None:
                approach = _approach(run, chosen, self.approached, wanted, part.sample)
            found = PartedImage(
                run.x[:, -1], found.time + float(run.t[-1] - run.t[0]), runs, part.W[:, :n], part.W[:, n:],
                (*found.degenerate, *part.degenerate), parts=(*found.parts, part), approach=approach,
            )  # fmt: skip
        return found

    def barred(self, k: int, place: float) -> bool:
        """Whether no leg may begin at a place of an application: within the window."""
        (begin, _, _), *_ = self._spans((k, place, math.inf))
        window = self.window
        return window is not None and (self.driven or k == 0) and window.begin < begin < window.end

    def _spans(self, leg: Leg) -> list[tuple[float, float, Window | None]]:
        """Pieces of a leg, from and to in periods (of autonomous systems in time since the return), and the window."""
        k, first, last = leg
        if self.driven:
            unit = self.base.beat / self.base.forcing_period
            first, last = (k + first) * unit, (k + last) * unit
        window = self.window
        if window is None or k and not self.driven:
            return [(first, last, None)]
        a, b = max(first, window.begin), min(last, window.end)
        if not a < b:
            return [(first, last, None)]
        pieces = [(first, a, None), (a, b, window), (b, last, None)]
        return [(begin, end, inside) for begin, end, inside in pieces if begin < end]


_NO_SERIES = "a step has no Taylor series."


def _joined(one: Image, other: Image, part: Part | None = None) -> Image:
    """Of a point the image of its image."""
    runs = (*one.runs, *other.runs)
    if not other.success:
        return lost(len(one.x), runs, other.reason)
    parts = getattr(one, "parts", ()) + (() if part is None else (part,))
    return PartedImage(
        other.x, one.time + other.time, runs, other.jacobian @ one.jacobian,
        other.jacobian @ one.by_parameter + other.by_parameter, (*one.degenerate, *other.degenerate), parts=parts,
        approach=getattr(one, "approach", None),
    )  # fmt: skip


def in_window(system: Any, window: Window) -> Any:
    if window.ratio is not None:
        other = copy.copy(system)
        other.model = with_ratio(system.model, window.ratio)
        return other
    if window.held or window.arrives:
        other, name = copy.copy(system), window.name
        other.model = (
            held(system.model, name)
            if window.held
            else caught(system.model, name, window.side)
            if window.arrives == "caught"
            else passed(system.model, name)
        )
        return other
    is_contact = any(str(mu.symbol) == window.name and mu.kind == "contact" for mu in system.model.multipliers)
    other = copy.copy(system)
    other.model = one_sided(system.model, window.name, 0 if is_contact else window.side)
    return other


class Approached:
    """What is smallest where the motion touches: s h; of a stick, what more the layer could hold."""

    def __init__(self, model: Model, window: Window) -> None:
        self.side, self.strength, self.expression = window.side, None, None
        if window.held:
            self.strength = strength_of(model, window.name, window.side)
        else:
            self.expression = window.side * surface_of(model, window.name)

    def functions(self, model: Model) -> tuple[Any, Any]:
        """It and its rate of (t, x, mult, p), along a run of this model."""
        if self.strength is not None:
            return self.strength.functions(model)
        return functions_of(model, self.expression)

    def slopes(self, model: Model, chosen: Any, t: float, x: Any, mult: Any, p: Any) -> tuple[np.ndarray, ...]:
        """Its derivatives by (x, q) and by multipliers, (N,) and (m,)."""
        line = linearise(model, chosen)
        if self.strength is None:
            w, _, by_mult = line.gradient(self.expression, t, x, mult, p)
            return w, by_mult
        at = self.strength.level(model, np.array([t]), x[:, None], mult[:, None], p)[:, 0]
        w, _, by_mult = line.gradient(self.strength.expression, t, x, at, p)
        by_mult[self.strength.j] = 0.0  # the envelope: it is the largest over lambda
        return w, by_mult


@functools.lru_cache(maxsize=64)
def _approached(model: Model, name: str, side: int, stays: bool) -> Approached:
    return Approached(model, Window(name, side, 0.0, 1.0, 0.0, stays))


def approached(model: Model, window: Window) -> Approached:
    return _approached(model, window.name, window.side, window.held)


def nearest(
    run: Solution, what: Approached, window: Window, T: float, begins: float
) -> tuple[float, float] | None:
    """Time of the minimum next to that of the last orbit, and the smallest value of all others; None without."""
    functions = what.functions(run.model)
    places = minima(run, functions)
    if not places:
        return None
    places.sort(key=lambda t: abs(t - begins - window.near * T))
    rest = np.array(places[1:])
    values = functions[0](rest, *run.dense(rest), run.tape.p) if rest.size else np.array([np.inf])
    return places[0], float(values.min())


def _approach(
    run: Solution, chosen: Any, what: Approached, wanted: tuple[float, float], sample: np.ndarray
) -> Approach:
    place, others = wanted
    model, p, n = run.model, run.tape.p, len(run.x)
    t = np.array([place])
    x, mult = run.dense(t)
    W = sample[0, :n]
    w, by_mult = what.slopes(model, chosen, place, x[:, 0], mult[:, 0], p)
    slopes = w[:n] @ W + by_mult @ sample[0, n:]
    slopes[n:] += w[n:]
    return Approach(place, float(what.functions(model)[0](t, x, mult, p)[0]), slopes, x[:, 0], others)


def touching(
    map_: Any,
    runs: Sequence[Solution],
    name: str,
    phase: float | None = None,
    stays: bool = False,
    widest: float = WIDEST,
) -> tuple[Windowed, np.ndarray] | str:
    """A map with a window about the nearest approach to a surface, that of a phase of the period, and x on its section.

    Of the runs of an orbit over one application of the map. Why there is none, in words.
    """
    whole = Windowed(getattr(map_, "base", map_))
    base, model = whole.base, runs[0].model
    T = base.forcing_period if whole.driven else 1.0
    begins = base.start_time if whole.driven else 0.0
    symbols = [str(mu.symbol) for mu in model.multipliers]
    found = []
    for side, run in itertools.product((1, -1), runs):
        window = Window(name, side, 0.0, 1.0, 0.0, stays)
        functions = approached(model, window).functions(run.model)
        for t in minima(run, functions):
            states, mult = run.dense(np.array([t]))
            column = int(np.searchsorted(run.t, t, side="right")) - 1
            if name in symbols:
                j = symbols.index(name)
                contact = run.model.multipliers[j].kind == "contact"
                if run.status[j, column] != (0 if stays else 1 if contact else side):
                    continue
            distance = float(functions[0](np.array([t]), states, mult, run.tape.p)[0])
            if distance >= -TOUCHED:
                found.append((distance, t, window))
    if not found:
        return f"{surface_of(model, name)} has no extreme along the orbit on a side of {name}"
    duration = sum(float(run.t[-1] - run.t[0]) for run in runs)
    if phase is not None:
        period = duration * (2 if getattr(base, "symmetry", None) is not None else 1)

        def off(t: float) -> float:
            part = duration / period
            return abs(((t - begins) / period - phase + part / 2) % part - part / 2)

        _, t, window = min(found, key=lambda f: off(f[1]))
    else:
        _, t, window = min(found, key=lambda f: f[0])
    return recentred(whole, runs, t, window, T, begins, widest)


def recentred(
    map_: Windowed,
    runs: Sequence[Solution],
    t: float,
    window: Window,
    T: float,
    begins: float,
    widest: float = WIDEST,
) -> tuple[Windowed, np.ndarray]:
    """The map with a window about the time t of an orbit, whose runs over one application of the map are given.

    `widest` is how wide it may be, to either side, as a part of that.
    """
    base = map_.base
    first = end = float(runs[0].t[0])
    found: list[float] = []
    for run in runs:  # returns count their time anew
        found += [end + e.time - run.t[0] for e in run.events if e.switch != RETURN and e.time > run.t[0]]
        end += float(run.t[-1] - run.t[0])
    duration, times = end - first, np.array(found)
    away = (times - t) % duration
    back, on = (float(duration - away.max()), float(away.min())) if times.size else (duration, duration)
    sections = not map_.driven or window.held and times.size > 0  # a section in a stick is none, but of a rest
    if sections:
        back, on = min(back, 2 * (t - first)), min(on, 2 * (first + duration - t))
    before, after = min(widest * duration, back / 2), min(widest * duration, on / 2)
    a = t - before
    if sections:
        about = replace(window, begin=(a - first) / T, end=(t + after - first) / T, near=(t - first) / T)
        return replace(map_, window=about), runs[0].x[:, 0]
    shift = math.ceil((first - a) / duration) * duration
    if a + shift >= first + duration:
        shift -= duration
    run = next(r for r in runs if r.t[0] <= a + shift <= r.t[-1])
    x = run.dense(np.array([a + shift]))[0][:, 0]
    if getattr(base, "symmetry", None) is not None and shift:
        # The half-period map leads the orbit on to its mirror image.
        turn = np.linalg.matrix_power(np.linalg.inv(base.symmetry), abs(round(shift / duration)) % 2)
        x = turn @ x
    about = replace(window, begin=0.0, end=(before + after) / T, near=before / T)
    return Windowed(base.at_phase(a / T), about), x
