"""The motion from an event to the same one a period later, regular where the event has no speed.

    z = (x, t) before it,   F = phi(t + D; t, R(x, t)) - x = 0,   h(x, t) = 0

    an impact                 h the gap; without speed the orbit grazes
    the release by a fold     h = c of holding.py; without speed the stick is just parted, and the Poincare map jumps

On a section elsewhere the map has the square root of how far h would go beyond 0.

Chain: windows.py, holding.py -> **impacts** -> conditions.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ...paths.derivatives.linearised import linearise
from ...results.solution import Solution
from .first_order import chosen_parameters
from .holding import held, index_of, not_held, strength_of
from .parts import function_of, last_rates, part_of, seeds_of, surface_of
from .poincare import Image, lost, why_stopped
from .sections import Stroboscopic
from .windows import WIDEST, Window, in_window


@dataclass(frozen=True)
class EventImage(Image):
    """Of z = (x, t) before an event: x is z + (F, h), the jacobian that of it, K(mu) the pencil of the multipliers.

    `speed` is how fast h falls through 0 there: the event is regular while that is positive.
    """

    speed: float = math.nan
    pencil: tuple[np.ndarray, np.ndarray] = (np.empty(0), np.empty(0))
    more: Mapping[str, float] = field(default_factory=dict)


class Happening(NamedTuple):
    """An event at z: h with its slopes (N,) and by time, the state behind with its slopes, and the speed.

    `more` are functions that are 0 where it becomes another event, by the name of that change.
    """

    h: float
    h_w: np.ndarray
    h_t: float
    x: np.ndarray
    R_w: np.ndarray
    R_t: np.ndarray
    speed: float
    more: Mapping[str, float] = {}


@dataclass(frozen=True)
class FromEvent:
    """The motion from one event to the same one a period later, regular where its speed goes to 0 and beyond.

        z = (x, t) before it,   F = phi(t + D; t, R(x, t)) - x = 0,   h(x, t) = 0

    The surface acts on nothing for a part of the period behind the event and before it. A deviation comes back as mu
    times itself where K(mu) = ((Phi R_x - mu, Phi (R_t - f) + mu f'), (h_x, h_t)) is singular, f behind the event and
    f' before it; for autonomous systems t stands for the period D, and K = ((Phi R_x - mu, f'), (h_x, 0)).
    """

    base: Any
    name: str
    behind: float  # the windows, parts of the period
    before: float

    touches = ""  # what happens where the event has no speed

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "base":
            raise AttributeError(name)
        return getattr(self.base, name)

    def with_parameters(self, values: Any) -> Any:
        return replace(self, base=self.base.with_parameters(values))

    @property
    def driven(self) -> bool:
        return isinstance(self.base, Stroboscopic)

    def happening(self, line: Any, t: float, x: np.ndarray, p: np.ndarray) -> Happening:
        """The event at a state and a time."""
        raise NotImplementedError

    def systems(self) -> tuple[Any, Any]:
        """What moves behind the event and before it."""
        raise NotImplementedError

    def again(self, map_: Any, x: np.ndarray) -> tuple[Any, np.ndarray] | None:
        """The same from an orbit on: its windows may have become wider or narrower."""
        raise NotImplementedError

    def image(self, z: Any, parameters: Sequence[Any] | None = None) -> Image:
        base, system, names = self.base, self.base.system, tuple(parameters or ())
        model, n = system.model, len(z) - 1
        chosen = chosen_parameters(system, names)
        x, last = np.asarray(z[:n], float), float(z[n])
        t0 = last if self.driven else 0.0
        D = base.duration if self.driven else last
        here = self.happening(linearise(model, chosen), t0, x, np.array(system.parameter_values, float))
        at = here.x
        W = np.zeros((n, n + 1 + len(chosen)))
        W[:, :n], W[:, n + 1 :] = here.R_w[:, :n], here.R_w[:, n:]
        moves = [np.zeros(n + 1 + len(chosen)) for _ in range(4)]
        if self.driven:
            W[:, n] = here.R_t
            long = np.array([base._period_slope(q) for q in chosen]) * D / base.forcing_period
            for k, part in enumerate((0.0, self.behind, 1 - self.before, 1.0)):
                moves[k][n] = 1.0
                moves[k][n + 1 :] = part * long
        else:
            for k, part in enumerate((0.0, self.behind, 1 - self.before, 1.0)):
                moves[k][n] = part
        seeds = seeds_of(model, chosen, n + 1)
        cuts = t0 + D * np.array([0.0, self.behind, 1 - self.before, 1.0])
        first, final = self.systems()
        runs: list[Solution] = []
        degenerate: list[str] = []
        for k, there in enumerate((first, system, final)):
            run = base._solve(there, (cuts[k], cuts[k + 1]), at, True)
            runs.append(run)
            if not (run.success and run.t[-1] == cuts[k + 1]):
                return lost(n + 1, tuple(runs), why_stopped(run))
            if k == 0 and (why := self.astray(run)):
                return lost(n + 1, tuple(runs), why)
            done = part_of(run, chosen, W, seeds, (moves[k], moves[k + 1]))
            if done is None:
                return lost(n + 1, tuple(runs), "a step has no Taylor series.")
            degenerate += done.degenerate
            at, W = run.x[:, -1], done.W
        f = last_rates(runs[-1])
        if getattr(base, "symmetry", None) is not None:
            back = np.linalg.inv(base.symmetry)
            at, W, f = back @ at, back @ W, back @ f
        J = np.zeros((n + 1, n + 1 + len(chosen)))
        J[:n] = W
        J[n, :n], J[n, n + 1 :] = here.h_w[:n], here.h_w[n:]
        if self.driven:
            J[n, n] = here.h_t
        A, B = np.zeros((n + 1, n + 1)), J[:, : n + 1].copy()
        A[:n, :n], A[:n, n] = np.eye(n), -f
        B[:n, n] -= f
        if not self.driven:
            A[:n, n], B[:n, n] = 0.0, f
        J[:n, :n] -= np.eye(n)
        end = np.asarray(z, float) + np.append(at - x, here.h)
        return EventImage(
            end, float(D), tuple(runs), J[:, : n + 1] + np.eye(n + 1), J[:, n + 1 :], tuple(degenerate),
            speed=here.speed, pencil=(A, B), more=here.more,
        )  # fmt: skip

    def astray(self, run: Solution) -> str:
        """Why the motion behind the event is none of its kind any more, in words; empty where it is."""
        return ""

    def exact(self, z: np.ndarray, image: Image) -> tuple[Any, np.ndarray]:
        """The exact map with its section behind the event's window, and the point there."""
        run = image.runs[1]
        place = self.place(run)
        x = run.dense(np.array([place]))[0][:, 0]
        if self.driven:
            return self.base.at_phase(place / self.base.forcing_period), x
        return self.base, x

    def place(self, run: Solution) -> float:
        """Where the exact map's section stands, in the run between the windows: in the middle between two events."""
        return 0.5 * float(run.t[0] + run.t[-1])


@dataclass(frozen=True)
class FromImpact(FromEvent):
    """From an impact on: h is the gap, R the impact, and without the wall the motion goes through it."""

    touches = "grazing impact"

    def happening(self, line: Any, t: float, x: np.ndarray, p: np.ndarray) -> Happening:
        model = line.model
        index = index_of(model, self.name)
        contact, (mult, J) = model.multipliers[index], line.unknowns(t, x, p)
        h_w, h_t, _ = line.gradient(contact.surface, t, x, mult, p)
        speed = -_speed_of(line, index, t, x, mult, p)
        h = float(function_of(model, contact.surface)(np.array([t]), x[:, None], mult[:, None], p)[0])
        behind, R_w, R_t = line.jump(contact.impact, t, x, mult, p, J)
        return Happening(h, h_w, h_t, behind, R_w, R_t, speed)

    def systems(self) -> tuple[Any, Any]:
        free = in_window(self.base.system, Window(self.name, 1, 0, 0, 0))
        return free, free

    def again(self, map_: Any, x: np.ndarray) -> tuple[Any, np.ndarray] | None:
        return from_impact(map_, x)


@dataclass(frozen=True)
class FromRelease(FromEvent):
    """From where the fold of a hidden term lets a stick go: h is what more it could hold (holding.py).

    Before it the motion is held whatever that takes, and behind it it slips to `side`, however little is too much.
    """

    side: int = 1

    touches = "adding-sliding"

    def happening(self, line: Any, t: float, x: np.ndarray, p: np.ndarray) -> Happening:
        model, n = line.model, len(x)
        strength = strength_of(model, self.name, -self.side)
        at = np.array([t]), x[:, None], np.zeros((len(model.multipliers), 1)), p
        mult = strength.level(model, *at)[:, 0]
        w, by_time, _ = line.gradient(strength.expression, t, x, mult, p)  # the envelope: largest over lambda
        h = float(strength.functions(model)[0](*at)[0])
        rate = float(strength.functions(held(model, self.name))[1](*at)[0])
        # Towards the end of the layer the fold comes where c does not grow from there any more.
        end = mult.copy()
        end[strength.j] = self.side
        slope = strength.expression.diff(strength.lam)
        inside = -self.side * float(function_of(model, slope)(at[0], at[1], end[:, None], p)[0])
        more = {"exit by a fold": inside}
        return Happening(h, w, by_time, x, np.eye(n, len(w)), np.zeros(n), -rate, more)

    def systems(self) -> tuple[Any, Any]:
        system = self.base.system
        return tuple(
            in_window(system, Window(self.name, self.side, 0, 0, 0, held=held)) for held in (False, True)
        )

    def again(self, map_: Any, x: np.ndarray) -> tuple[Any, np.ndarray] | None:
        return from_release(map_, x)

    def astray(self, run: Solution) -> str:
        surface = function_of(self.base.system.model, surface_of(self.base.system.model, self.name))
        at = run.t[-1:], run.x[:, -1:], np.zeros((len(self.base.system.model.multipliers), 1)), run.tape.p
        return "" if self.side * float(surface(*at)[0]) > 0 else "what was let go comes back within the window."

    def place(self, run: Solution) -> float:
        """Just behind the window, where it slips."""
        return float(run.t[0])


def from_release(map_: Any, x: np.ndarray) -> tuple[FromRelease, np.ndarray] | None:
    """The motion from the slowest release by a fold of an orbit on, and z there; None for orbits without."""
    if not isinstance(map_, Stroboscopic):
        return None
    model, system = map_.system.model, map_.system
    hidden = {str(mu.symbol) for mu in model.multipliers if mu.hidden and not not_held(model, str(mu.symbol))}
    if not hidden:
        return None
    run = map_.solved(x, map_.start_time + map_.duration, system)
    line, p = linearise(model, ()), np.array(system.parameter_values, float)
    best = None
    for event in run.events:
        if event.switch not in hidden or event.kind != "slip by fold" or not event.time > run.t[0]:
            continue
        state = run.x[:, int(np.searchsorted(run.t, event.time, side="left"))]
        release = FromRelease(map_, event.switch, 0.0, 0.0, int(event.note.split(" to ")[1]))
        speed = release.happening(line, event.time, state, p).speed
        if best is None or speed < best[0]:
            best = speed, event.time, release, state
    if best is None:
        return None
    _, t, release, state = best
    behind, before = _windows(run, t)
    return replace(release, behind=behind, before=before), np.append(state, t)


def _windows(run: Solution, t: float) -> tuple[float, float]:
    """How wide the windows behind an event and before it are, in parts of the run: half the way to other events."""
    D = float(run.t[-1] - run.t[0])
    away = (np.array([e.time for e in run.events if e.time != t]) - t) % D
    behind, before = (float(away.min()) / D, 1 - float(away.max()) / D) if away.size else (1.0, 1.0)
    return min(WIDEST, behind / 2), min(WIDEST, before / 2)


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
    return FromImpact(map_, name, *_windows(run, t)), np.append(state, t)
