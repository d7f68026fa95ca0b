"""The motion from an impact to the same one a period later, regular where the impact has no speed.

    z = (x, t) before the impact,   F = phi(t + D; t, R(x, t)) - x = 0,   h(x, t) = 0

Chain: windows.py -> **impacts** -> conditions.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..definition.pointwise import value
from ..paths.linearised import linearise
from ..results.solution import Solution
from .parts import function_of, last_rates, part_of, seeds_of
from .poincare import Image, lost, why_stopped
from .sections import Stroboscopic
from .variations import chosen_parameters
from .windows import WIDEST, Window, in_window


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
        seeds = seeds_of(model, chosen, n + 1)
        cuts = t0 + D * np.array([0.0, self.behind, 1 - self.before, 1.0])
        free = in_window(system, Window(self.contact, 1, 0, 0, 0))
        runs: list[Solution] = []
        degenerate: list[str] = []
        for k, there in enumerate((free, system, free)):
            run = base._solve(there, (cuts[k], cuts[k + 1]), at, True)
            runs.append(run)
            if not (run.success and run.t[-1] == cuts[k + 1]):
                return lost(n + 1, tuple(runs), why_stopped(run))
            done = part_of(run, chosen, W, seeds, (moves[k], moves[k + 1]))
            if done is None:
                return lost(n + 1, tuple(runs), "a step has no Taylor series.")
            degenerate += done.degenerate
            at, W = run.x[:, -1], done.W
        point = dict(zip((*model.states, *(mu.symbol for mu in model.multipliers)), (*x, *mult)))
        point |= {**system.parameters, model.time: t0}
        h = value(contact.surface, point)
        f = last_rates(runs[-1])
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
    found = FromImpact(map_, name, min(WIDEST, behind / 2), min(WIDEST, before / 2))
    return found, np.append(state, t)
