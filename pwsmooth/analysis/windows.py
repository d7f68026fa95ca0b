"""Poincare maps whose motion keeps to one side of a surface for a while: what makes grazing a regular equation.

    x(t0) --exact--> x(t_a) --lambda = +-1, no contact--> x(t_b) --exact--> P(x)

Between t_a and t_b one surface acts on nothing: the motion may come to it, touch it and go beyond, smoothly, where the
exact map has the square root of the distance. The extreme of h in the window and its slopes are smooth there (the
envelope theorem: dh = h_x dx + h_q dq at the instant of the extreme), and where that is 0 the map is the exact one.

Chain: sections.py, parts.py -> **windows** -> tangencies.py.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp

from ..definition.model import Model
from ..paths.linearised import linearise
from ..results.solution import Solution
from .parts import Part, functions_of, held, minima, one_sided, part_of, seeds_of, surface_of
from .poincare import RETURN, Image, lost, why_stopped
from .sections import Stroboscopic
from .variations import chosen_parameters

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
    held: bool = False  # the motion stays on the surface, and h = s - lambda instead


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
    def surface(self) -> sp.Expr:
        assert self.window is not None
        return approached(self.base.system.model, self.window)

    def image(self, x: Any, parameters: Sequence[Any] | None = None) -> Image:
        base, names = self.base, tuple(parameters or ())
        n, system = len(x), base.system
        chosen = chosen_parameters(system, names)
        W = np.eye(n, n + len(chosen))
        at, parts, runs = np.asarray(x, float), [], []
        approach = None
        T, begins = (base.forcing_period, base.start_time) if self.driven else (1.0, 0.0)
        fixed, slope = np.zeros(n + len(chosen)), np.zeros(n + len(chosen))
        if self.driven:
            slope[n:] = [base._period_slope(q) for q in chosen]
        seeds = seeds_of(system.model, chosen, n)
        phase = base.phase if self.driven else 0.0
        window = self.window
        cuts: list[tuple[float, float, bool]] = []  # from and to, in periods, and whether it is the window
        if window is not None:
            cuts += [(0.0, window.begin, False)] if window.begin > 0 else []
            cuts += [(window.begin, window.end, True)]
        if self.driven:
            last = cuts[-1][1] if cuts else 0.0
            cuts += [(last, base.duration / T, False)]
        for first, end, inside in cuts:
            there = system
            if inside:
                assert window is not None
                there = in_window(system, window)
            span = (begins + first * T, begins + end * T)
            run = base._solve(there, span, at, True)
            runs.append(run)
            if not (run.success and run.t[-1] == span[1]):
                return lost(n, tuple(runs), why_stopped(run))
            wanted = None
            if inside and window is not None:
                wanted = nearest(run, self.surface, window, T, begins)
                if wanted is None:
                    return lost(n, tuple(runs), "h has no extreme in the window.")
            moves = (fixed + slope * (phase + first), fixed + slope * (phase + end))
            part = part_of(run, chosen, W, seeds, moves, None if wanted is None else np.array([wanted[0]]))
            if part is None:
                return lost(n, tuple(runs), "a step has no Taylor series.")
            if wanted is not None:
                approach = _approach(run, chosen, self.surface, window, wanted, part.sample)
            parts.append(part)
            at, W = run.x[:, -1], part.W
        time = sum(float(run.t[-1] - run.t[0]) for run in runs)
        degenerate = tuple(text for part in parts for text in part.degenerate)
        if self.driven:
            back = np.eye(n) if base.symmetry is None else np.linalg.inv(base.symmetry)
            at, W = back @ at, back @ W
        else:
            rest = base.image(at, names)
            if not rest.success:
                return rest
            if window is None:
                moves = (fixed, fixed)
                done = part_of(rest.runs[0], chosen, W, seeds, moves)
                if done is None:
                    return lost(n, tuple(rest.runs), "a step has no Taylor series.")
                parts.append(done)
            runs += rest.runs
            B = rest.by_parameter
            W = rest.jacobian @ W
            W[:, n:] += B
            at, time, degenerate = rest.x, time + rest.time, degenerate + rest.degenerate
        return PartedImage(
            at, time, tuple(runs), W[:, :n], W[:, n:], degenerate, parts=tuple(parts), approach=approach
        )


def in_window(system: Any, window: Window) -> Any:
    if window.held:
        other = copy.copy(system)
        other.model = held(system.model, window.name)
        return other
    is_contact = any(str(mu.symbol) == window.name and mu.kind == "contact" for mu in system.model.multipliers)
    other = copy.copy(system)
    other.model = one_sided(system.model, window.name, 0 if is_contact else window.side)
    return other


def approached(model: Model, window: Window) -> sp.Expr:
    """h of a window, where s h is positive on the orbit's side: of a stick s - lambda."""
    if window.held:
        lam = next(mu.symbol for mu in model.multipliers if str(mu.symbol) == window.name)
        return sp.Integer(window.side) - lam
    return surface_of(model, window.name)


def nearest(
    run: Solution, surface: sp.Expr, window: Window, T: float, begins: float
) -> tuple[float, float] | None:
    """Time of the minimum of s h next to that of the last orbit, and the smallest s h of all others; None without."""
    places = minima(run, surface, window.side)
    if not places:
        return None
    h, _ = functions_of(run.model, surface)
    places.sort(key=lambda t: abs(t - begins - window.near * T))
    rest = np.array(places[1:])
    values = window.side * h(rest, *run.dense(rest), run.tape.p) if rest.size else np.array([np.inf])
    return places[0], float(values.min())


def _approach(
    run: Solution, chosen: Any, surface: sp.Expr, window: Any, wanted: tuple[float, float], sample: np.ndarray
) -> Approach:
    place, others = wanted
    model, p, n = run.model, run.tape.p, len(run.x)
    h, _ = functions_of(model, surface)
    t = np.array([place])
    x, mult = run.dense(t)
    W = sample[0, :n]
    w, _, by_mult = linearise(model, chosen).gradient(surface, place, x[:, 0], mult[:, 0], p)
    slopes = w[:n] @ W + by_mult @ sample[0, n:]
    slopes[n:] += w[n:]
    side = window.side
    return Approach(place, float(side * h(t, x, mult, p)[0]), side * slopes, x[:, 0], others)


def touching(
    map_: Any, x: np.ndarray, name: str, phase: float | None = None, stays: bool = False
) -> tuple[Windowed, np.ndarray] | str:
    """A map with a window about the nearest approach to a surface, that of a phase of the period, and x on its section.

    Why there is none, in words.
    """
    whole = Windowed(getattr(map_, "base", map_))
    base = whole.base
    T = base.forcing_period if whole.driven else 1.0
    begins = base.start_time if whole.driven else 0.0
    if whole.driven:
        run = base.solved(x, begins + base.duration, base.system)
    else:
        run = base._solve(base.system, (0.0, base.image(x).time), x, True)
    if not run.success:
        return f"the orbit was not run through: {why_stopped(run)}"
    symbols = [str(mu.symbol) for mu in run.model.multipliers]
    found = []
    for side in (1, -1):
        window = Window(name, side, 0.0, 1.0, 0.0, stays)
        surface = approached(run.model, window)
        h, _ = functions_of(run.model, surface)
        for t in minima(run, surface, side):
            states, mult = run.dense(np.array([t]))
            column = int(np.searchsorted(run.t, t, side="right")) - 1
            if name in symbols:
                j = symbols.index(name)
                contact = run.model.multipliers[j].kind == "contact"
                if run.status[j, column] != (0 if stays else 1 if contact else side):
                    continue
            distance = side * float(h(np.array([t]), states, mult, run.tape.p)[0])
            if distance >= -TOUCHED:
                found.append((distance, t, window))
    if not found:
        return f"{surface_of(run.model, name)} has no extreme along the orbit on a side of {name}"
    duration = float(run.t[-1] - run.t[0])
    if phase is not None:
        period = duration * (2 if getattr(base, "symmetry", None) is not None else 1)

        def off(t: float) -> float:
            part = duration / period
            return abs(((t - begins) / period - phase + part / 2) % part - part / 2)

        _, t, window = min(found, key=lambda f: off(f[1]))
    else:
        _, t, window = min(found, key=lambda f: f[0])
    return recentred(whole, [run], t, window, T, begins)


def recentred(
    map_: Windowed, runs: Sequence[Solution], t: float, window: Window, T: float, begins: float
) -> tuple[Windowed, np.ndarray]:
    """The map with a window about the time t of an orbit, whose runs over one application of the map are given."""
    base = map_.base
    first = end = float(runs[0].t[0])
    found: list[float] = []
    for run in runs:  # returns count their time anew
        found += [end + e.time - run.t[0] for e in run.events if e.switch != RETURN and e.time > run.t[0]]
        end += float(run.t[-1] - run.t[0])
    duration, times = end - first, np.array(found)
    away = (times - t) % duration
    back, on = (float(duration - away.max()), float(away.min())) if times.size else (duration, duration)
    sections = not map_.driven or window.held  # a section in a stick is none
    if sections:
        back, on = min(back, 2 * (t - first)), min(on, 2 * (first + duration - t))
    before, after = min(WIDEST * duration, back / 2), min(WIDEST * duration, on / 2)
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
