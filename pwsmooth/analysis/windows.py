"""Poincare maps whose motion keeps to one side of a surface for a while: what makes grazing a regular equation.

    x(t0) --exact--> x(t_a) --lambda = +-1, no contact--> x(t_b) --exact--> P(x)

Between t_a and t_b one surface acts on nothing: the motion may come to it, touch it and go beyond, smoothly, where the
exact map has the square root of the distance. The extreme of h in the window and its slopes are smooth there (the
envelope theorem: dh = h_x dx + h_q dq at the instant of the extreme), and where that is 0 the map is the exact one.

Chain: sections.py, paths/tangents.py -> **windows** -> conditions.py.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import sympy as sp

from ..definition.model import Model, Multiplier
from ..definition.pointwise import value
from ..definition.regularity import total_derivative
from ..paths.linearised import linearise, rates
from ..results.outputs import vectorised
from ..results.solution import Solution
from .poincare import RETURN, Image, lost, why_stopped
from .sections import Stroboscopic
from .variations import chosen_parameters, has_series, without_derivative

_WIDEST = 0.25  # of one application of the map: a window to either side of what it is about
TOUCHED = 1e-6  # in the unit of h: an orbit that touches
_EACH = 8  # places a step at which an extreme is looked for


@functools.lru_cache(maxsize=64)
def one_sided(model: Model, name: str, value: int) -> Model:
    """The model without the surface of this name, its multiplier at a value; without the event of this name."""
    for k, event in enumerate(model.events):
        if event.name == name and not any(str(mu.symbol) == name for mu in model.multipliers):
            return replace(model, events=model.events[:k] + model.events[k + 1 :])
    index = next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == name)
    fixed = {model.multipliers[index].symbol: sp.Integer(value)}

    def at_value(part: Any) -> Any:
        if isinstance(part, sp.Basic):
            return part.xreplace(fixed)
        if isinstance(part, tuple):
            return tuple(map(at_value, part))
        return part

    def rewritten(record: Any) -> Any:
        symbols = {f.name: at_value(getattr(record, f.name)) for f in fields(record) if f.name != "symbol"}
        return replace(record, **symbols)

    without = [j for j in range(len(model.multipliers)) if j != index]
    residuals, ratios = model.layer_residuals, model.eps_ratio
    return replace(
        model,
        rhs=at_value(model.rhs),
        multipliers=tuple(rewritten(model.multipliers[j]) for j in without),
        events=tuple(map(rewritten, model.events)),
        outputs=at_value(model.outputs),
        layer_states=tuple(map(rewritten, model.layer_states)),
        layer_residuals=tuple(at_value(residuals[j]) for j in without) if residuals else (),
        eps_ratio=tuple(ratios[j] for j in without) if ratios else (),
    )


@functools.lru_cache(maxsize=64)
def held(model: Model, name: str) -> Model:
    """The model whose motion stays on the surface of this name: lambda is what that takes, and has no bounds."""
    index = next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == name)
    mu = model.multipliers[index]
    free = Multiplier(mu.symbol, "algebraic", mu.condition)
    return replace(model, multipliers=(*model.multipliers[:index], free, *model.multipliers[index + 1 :]))


@dataclass(frozen=True)
class Approach:
    """The extreme of s h in a window: s h is smallest there.

    `place` is its time, `h` the value of s h, `slopes` (n + k,) by the point on the section and the parameters,
    `curvature` s h'', `gradient` h_x (n,), `W` (n, n + k) of the state there, `others` the smallest s h at other
    extremes in the window.
    """

    place: float
    h: float
    slopes: np.ndarray
    curvature: float
    gradient: np.ndarray
    x: np.ndarray
    W: np.ndarray
    others: float


@dataclass(frozen=True)
class Part:
    """A run with the deviations W (n, n + k) at its end, and at its instants (before, and of their times)."""

    run: Solution
    W: np.ndarray
    instant_t: np.ndarray
    instant_dt: np.ndarray
    instant_w: np.ndarray
    degenerate: tuple[str, ...]
    sample: np.ndarray


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
        seeds = _seeds(system.model, chosen, n)
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
                there = _in_window(system, window)
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
            part = _part(run, chosen, W, seeds, moves, None if wanted is None else np.array([wanted[0]]))
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
                done = _part(rest.runs[0], chosen, W, seeds, moves)
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


def _in_window(system: Any, window: Window) -> Any:
    if window.held:
        other = copy.copy(system)
        other.model = held(system.model, window.name)
        return other
    is_contact = any(str(mu.symbol) == window.name and mu.kind == "contact" for mu in system.model.multipliers)
    other = copy.copy(system)
    other.model = one_sided(system.model, window.name, 0 if is_contact else window.side)
    return other


@dataclass(frozen=True)
class ImpactImage(Image):
    """Of z = (x, t) before an impact: x is z + (F, h), the jacobian that of it, K(mu) the pencil of the multipliers."""

    speed: float = math.nan
    pencil: tuple[np.ndarray, np.ndarray] = (np.empty(0), np.empty(0))


@dataclass(frozen=True)
class FromImpact:
    """The motion from one impact to the same one a period later, regular where its speed goes to 0 and beyond.

        z = (x, t) before the impact,   F = phi(t + D; t, R(x, t)) - x = 0,   h(x, t) = 0

    The wall acts on nothing for a part of the period behind the impact and before it. A deviation comes back as mu
    times itself where K(mu) = ((Phi R_x - mu, Phi (R_t - f) + mu f'), (h_x, h_t)) is singular, f behind the impact and
    f' before it; for autonomous systems t stands for the period D, and K = ((Phi R_x - mu, f'), (h_x, 0)).
    """

    base: Any
    contact: str
    behind: float  # the windows, parts of the period
    before: float

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "base":
            raise AttributeError(name)
        return getattr(self.base, name)

    def with_parameters(self, values: Any) -> FromImpact:
        return replace(self, base=self.base.with_parameters(values))

    @property
    def driven(self) -> bool:
        return isinstance(self.base, Stroboscopic)

    def image(self, z: Any, parameters: Sequence[Any] | None = None) -> Image:
        base, system, names = self.base, self.base.system, tuple(parameters or ())
        model, n = system.model, len(z) - 1
        chosen = chosen_parameters(system, names)
        line, p = linearise(model, chosen), np.array(system.parameter_values, float)
        index = next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == self.contact)
        contact, mult = model.multipliers[index], np.zeros(len(model.multipliers))
        x, last = np.asarray(z[:n], float), float(z[n])
        t0 = last if self.driven else 0.0
        D = base.duration if self.driven else last
        h_w, h_t, _ = line.gradient(contact.surface, t0, x, mult, p)
        at, R_w, R_t = line.jump(contact.impact, t0, x, mult, p)
        W = np.zeros((n, n + 1 + len(chosen)))
        W[:, :n], W[:, n + 1 :] = R_w[:, :n], R_w[:, n:]
        moves = [np.zeros(n + 1 + len(chosen)) for _ in range(4)]
        if self.driven:
            W[:, n] = R_t
            long = np.array([base._period_slope(q) for q in chosen]) * D / base.forcing_period
            for k, part in enumerate((0.0, self.behind, 1 - self.before, 1.0)):
                moves[k][n] = 1.0
                moves[k][n + 1 :] = part * long
        else:
            for k, part in enumerate((0.0, self.behind, 1 - self.before, 1.0)):
                moves[k][n] = part
        seeds = _seeds(model, chosen, n + 1)
        cuts = t0 + D * np.array([0.0, self.behind, 1 - self.before, 1.0])
        free = _in_window(system, Window(self.contact, 1, 0, 0, 0))
        runs: list[Solution] = []
        degenerate: list[str] = []
        for k, there in enumerate((free, system, free)):
            run = base._solve(there, (cuts[k], cuts[k + 1]), at, True)
            runs.append(run)
            if not (run.success and run.t[-1] == cuts[k + 1]):
                return lost(n + 1, tuple(runs), why_stopped(run))
            done = _part(run, chosen, W, seeds, (moves[k], moves[k + 1]))
            if done is None:
                return lost(n + 1, tuple(runs), "a step has no Taylor series.")
            degenerate += done.degenerate
            at, W = run.x[:, -1], done.W
        point = dict(zip((*model.states, *(mu.symbol for mu in model.multipliers)), (*x, *mult)))
        point |= {**system.parameters, model.time: t0}
        h = value(contact.surface, point)
        f = _last_rates(runs[-1])
        J = np.zeros((n + 1, n + 1 + len(chosen)))
        J[:n] = W
        J[n, :n], J[n, n + 1 :] = h_w[:n], h_w[n:]
        if self.driven:
            J[n, n] = h_t
        A, B = np.zeros((n + 1, n + 1)), J[:, : n + 1].copy()
        A[:n, :n], A[:n, n] = np.eye(n), -f
        B[:n, n] -= f
        if not self.driven:
            A[:n, n], B[:n, n] = 0.0, f
        J[:n, :n] -= np.eye(n)
        where = np.append(at - x, h)
        end = np.asarray(z, float) + where
        return ImpactImage(
            end, float(D), tuple(runs), J[:, : n + 1] + np.eye(n + 1), J[:, n + 1 :], tuple(degenerate),
            speed=-float(_speed_of(line, index, t0, x, mult, p)), pencil=(A, B),
        )  # fmt: skip

    def exact(self, z: np.ndarray, image: Image) -> tuple[Any, np.ndarray]:
        """The exact map with its section in the middle between two impacts, and the point there."""
        run = image.runs[1]
        middle = 0.5 * float(run.t[0] + run.t[-1])
        x = run.dense(np.array([middle]))[0][:, 0]
        if self.driven:
            return self.base.at_phase(middle / self.base.forcing_period), x
        return self.base, x


def _speed_of(line: Any, index: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> float:
    found = function_of(line.model, line.speed(index))(np.array([t]), x[:, None], mult[:, None], p)
    return float(found[0])


def from_impact(map_: Any, x: np.ndarray) -> tuple[FromImpact, np.ndarray] | None:
    """The motion from the slowest impact of an orbit on, and z there; None for orbits without, or of half a period."""
    model = map_.system.model
    contacts = {str(mu.symbol): j for j, mu in enumerate(model.multipliers) if mu.kind == "contact"}
    if getattr(map_, "symmetry", None) is not None or not contacts or not isinstance(map_, Stroboscopic):
        return None
    run = map_.solved(x, map_.start_time + map_.duration, map_.system)
    line, p = linearise(model, ()), np.array(map_.system.parameter_values, float)
    best = None
    for event in run.events:
        if event.kind != "impact" or event.switch not in contacts or not event.time > run.t[0]:
            continue
        column = int(np.searchsorted(run.t, event.time, side="left"))
        state, mult = run.x[:, column], run.mult[:, column]
        speed = abs(_speed_of(line, contacts[event.switch], event.time, state, mult, p))
        if best is None or speed < best[0]:
            best = speed, event.time, event.switch, state
    if best is None:
        return None
    _, t, name, state = best
    D = float(run.t[-1] - run.t[0])
    times = np.array([e.time for e in run.events if e.time != t])
    away = (times - t) % D if times.size else np.array([D])
    behind, before = float(away.min()) / D, 1 - float(away.max()) / D if times.size else 1.0
    found = FromImpact(map_, name, min(_WIDEST, behind / 2), min(_WIDEST, before / 2))
    return found, np.append(state, t)


def approached(model: Model, window: Window) -> sp.Expr:
    """h of a window, where s h is positive on the orbit's side: of a stick s - lambda."""
    if window.held:
        lam = next(mu.symbol for mu in model.multipliers if str(mu.symbol) == window.name)
        return sp.Integer(window.side) - lam
    return surface_of(model, window.name)


def surface_of(model: Model, name: str) -> sp.Expr:
    found: list[Any] = [mu.surface for mu in model.multipliers if str(mu.symbol) == name]
    found += [event.surface for event in model.events if event.name == name]
    return found[0]


def _seeds(model: Model, chosen: Any, first: int) -> np.ndarray:
    """Columns (np, first + k) of parameters behind `first` others."""
    seeds = np.zeros((len(model.parameters), first + len(chosen)))
    for column, symbol in enumerate(chosen, first):
        if symbol in model.parameters:
            seeds[model.parameters.index(symbol), column] = 1.0
    return seeds


def _part(
    run: Solution, chosen: Any, W: np.ndarray, seeds: np.ndarray, moves: tuple[np.ndarray, np.ndarray],
    times: np.ndarray | None = None,
) -> Part | None:  # fmt: skip
    """The deviations of a run, from W at its start, where start and end move with the columns by `moves`."""
    if not has_series(run):
        return None
    tape = run.tape
    start = W - np.outer(tape.first_rates(), moves[0])
    found = tape.deviations(start, seeds, times, points=False)
    total = found.end + np.outer(_last_rates(run), moves[1])
    if not np.isnan(found.stopped):
        return None
    said = tuple(without_derivative(run, found.instant_t, found.instant_why))
    said += tuple(map(str, run.ambiguities))
    return Part(run, total, found.instant_t, found.instant_dt, found.instant_w, said, found.at_sample)


def _last_rates(run: Solution) -> np.ndarray:
    t, x, mult = run.tape.standing(-1)
    return rates(run.model, t, x, mult, run.tape.p)


def nearest(
    run: Solution, surface: sp.Expr, window: Window, T: float, begins: float
) -> tuple[float, float] | None:
    """Time of the minimum of s h next to that of the last orbit, and the smallest s h of all others; None without."""
    places = minima(run, surface, window.side)
    if not places:
        return None
    h, _ = _functions(run.model, surface)
    places.sort(key=lambda t: abs(t - begins - window.near * T))
    rest = np.array(places[1:])
    values = window.side * h(rest, *run.dense(rest), run.tape.p) if rest.size else np.array([np.inf])
    return places[0], float(values.min())


def _approach(
    run: Solution, chosen: Any, surface: sp.Expr, window: Any, wanted: tuple[float, float], sample: np.ndarray
) -> Approach:
    place, others = wanted
    model, p, n = run.model, run.tape.p, len(run.x)
    h, _ = _functions(model, surface)
    t = np.array([place])
    x, mult = run.dense(t)
    W = sample[0, :n]
    w, _, by_mult = linearise(model, chosen).gradient(surface, place, x[:, 0], mult[:, 0], p)
    slopes = w[:n] @ W + by_mult @ sample[0, n:]
    slopes[n:] += w[n:]
    bend = _curvature(model, surface)(t, x, mult, p)
    side = window.side
    return Approach(
        place,
        float(side * h(t, x, mult, p)[0]),
        side * slopes,
        float(side * bend[0]),
        w[:n],
        x[:, 0],
        W,
        others,
    )


@functools.lru_cache(maxsize=64)
def _functions(model: Model, surface: sp.Expr) -> tuple[Callable[..., Any], Callable[..., Any]]:
    return function_of(model, surface), function_of(model, speed_of(model, surface))


def speed_of(model: Model, h: sp.Expr) -> sp.Expr:
    """dh/dt, that of a multiplier in h from its own condition."""
    speed = total_derivative(h, model.time, model.states, model.rhs)
    for mu in model.multipliers:
        if mu.symbol in h.free_symbols:
            g = mu.condition
            along = total_derivative(g, model.time, model.states, model.rhs)
            speed = speed - h.diff(mu.symbol) * along / g.diff(mu.symbol)
    return speed


@functools.lru_cache(maxsize=64)
def _curvature(model: Model, surface: sp.Expr) -> Callable[..., Any]:
    return function_of(model, speed_of(model, speed_of(model, surface)))


def function_of(model: Model, e: sp.Expr) -> Callable[..., Any]:
    function = vectorised(model, sp.Tuple(e))

    def evaluate(t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.asarray(function(t, *x, *mult, *p)[0], float), t.shape)

    return evaluate


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
        h, _ = _functions(run.model, surface)
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
    before, after = min(_WIDEST * duration, back / 2), min(_WIDEST * duration, on / 2)
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


def minima(run: Solution, surface: sp.Expr, side: int) -> list[float]:
    """Times between events at which s h has a minimum."""
    _, speed = _functions(run.model, surface)
    knots = np.unique(np.concatenate([run.dense.t0, run.t[-1:]]))
    times = np.linspace(knots[:-1], knots[1:], _EACH, axis=1)
    times[:, -1] = np.nextafter(times[:, -1], times[:, 0])  # the step's own side of an event
    flat = times.ravel()
    x, mult = run.dense(flat)
    slopes = (side * speed(flat, x, mult, run.tape.p)).reshape(times.shape)
    rising = (slopes[:, :-1] < 0) & (slopes[:, 1:] >= 0)
    return [_zero_of(run, speed, times[i, k], times[i, k + 1]) for i, k in zip(*np.nonzero(rising))]


def _zero_of(run: Solution, speed: Any, low: float, high: float) -> float:
    from scipy.optimize import brentq

    def at(t: float) -> float:
        x, mult = run.dense(np.array([t]))
        return float(speed(np.array([t]), x, mult, run.tape.p)[0])

    return float(brentq(at, low, high, xtol=1e-15)) if at(low) * at(high) < 0 else float(high)
