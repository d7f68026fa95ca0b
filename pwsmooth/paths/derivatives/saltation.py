"""Saltation matrices: what an event does to a small deviation.

At the zero of H(t, x) with a jump x+ = R(t, x-) (identity at a switching), a deviation w = (dx, dq) becomes

    S w = R_w w + (R_x f- + R_t - f+) dt,      dt = -H_w w/(H_t + H_x f-)

(di Bernardo, Budd, Champneys & Kowalczyk, Piecewise-smooth Dynamical Systems, 2008). H is

    crossing, stick     the switching surface h           (a stick drops the rank: grad h S = 0)
    slip by tangency    lambda -+ 1: the field is continuous there, so S = 1
    fold                psi g, psi the left null vector of g_lambda (envelope theorem: only g's own derivatives stay)
    reset, impact       the event's surface, the gap; a clock's instant has dt = 0

Chain: linearised.py -> **saltation** -> collocation.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations, islice

import numpy as np
import sympy as sp

from ...door.documenting import complete
from ...kernels.tangent.state import CORNER, FINE, GRAZES, UNKNOWN
from ...results.outputs import vectorised
from ...results.solution import EventRecord, Solution
from ..words import why_not
from .linearised import Blocks, Linearised

__all__ = ["Saltation"]

# Slower than this part of its scale a surface is not crossed but touched: grazing has no saltation matrix.
_TOUCHING = 1e-9
_LANDED = 1e-6  # of a state: contacts that close with a jump take away what speed is left
_MOST_WAYS = 32  # in which the events of one instant may have fired, of those that are tried
CHATTER = 1e-6  # before an accumulation, relative to the time


@complete
@dataclass(frozen=True)
class Saltation:
    """What the events of one instant do to a small deviation: a matrix, or why there is none.

    Attributes
    ----------
    time : float, in the unit of the model's time
        The instant.
    kinds : tuple of str
        Of its events.
    matrix : ndarray, shape (N, N)
        On deviations of (x, q), states and parameters, in their units.
    delay : ndarray, shape (N,)
        Shift of the instant as a row over (x, q), in units of time over theirs.
    rates : (ndarray, ndarray), shapes (n,)
        f before and after the events, in the units of the model.
    why : int
        0, or why there is no derivative: it is touched (1), several meet (2), the rule is unknown (3).
    cause : str
        The switch, contact or event at fault, by its name.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008.

    A crossing of x = 1, at which the speed doubles, doubles the deviation:

    >>> x = sp.Symbol("x", real=True)
    >>> run = solve(System({x: 1 + sp.Heaviside(x - 1)}), (0, 2), {x: 0}, dense_output=True)
    >>> (crossing,) = variations(run).saltations
    >>> crossing.matrix.tolist(), crossing.delay.tolist()
    ([[2.0]], [-1.0])
    """

    time: float
    kinds: tuple[str, ...]
    matrix: np.ndarray
    delay: np.ndarray
    rates: tuple[np.ndarray, np.ndarray]
    why: int = FINE
    cause: str = ""

    @property
    def degenerate(self) -> str:
        """Why there is no derivative (grazing, a corner), in words; empty where there is one."""
        return f"t = {self.time:.9g}: {why_not(self.why, self.cause)}" if self.why else ""


def saltations(line: Linearised, solution: Solution, p: np.ndarray) -> list[Saltation]:
    """Of all instants of an event-driven solution after its start, in order of time."""
    t = solution.t
    instants: dict[float, list[EventRecord]] = {}
    for event in solution.events:
        if event.time > t[0]:
            instants.setdefault(event.time, []).append(event)
    if not instants:
        return []
    times = np.array(list(instants))
    before = np.searchsorted(t, times, side="left")
    after = np.searchsorted(t, times, side="right") - 1
    fields = [line.blocks(t[c], solution.x[:, c], solution.mult[:, c], p) for c in (before, after)]
    jumps = [
        _Instant(line, solution, p, fields, k, int(before[k]), int(after[k]), events).saltation()
        for k, events in enumerate(instants.values())
    ]
    # The last impacts before an accumulation are always slow; the projector of the accumulation contains their effect.
    ends = np.array([s.time for s in jumps if "accumulation" in s.kinds])
    return [
        replace(s, why=FINE) if np.any((ends >= s.time) & (ends - s.time < CHATTER * (1 + abs(s.time)))) else s
        for s in jumps
    ]


class _Instant:
    """One instant of a solution: the columns before and after it, and the Jacobian blocks there."""

    def __init__(self, line, solution, p, fields, k, before, after, events):
        self.line, self.p, self.events = line, p, events
        self.t = float(solution.t[before])
        self.x, self.mult = solution.x[:, before], solution.mult[:, before]
        self.x_after, self.mult_after = solution.x[:, after], solution.mult[:, after]
        self.status, self.status_after = solution.status[:, before], solution.status[:, after]
        self.blocks, self.blocks_after = (at(blocks, k) for blocks in fields)
        self.f, self.f_after = self.blocks.f[0], self.blocks_after.f[0]
        self.names = [str(s) for s in line.symbols]
        self.J = line.solved(self.status)

    def saltation(self) -> Saltation:
        line, n, N = self.line, self.line.n, self.line.N
        kinds = tuple(e.kind for e in self.events)
        if "accumulation" in kinds:
            projector = _projector(line, self.t, self.x_after, self.mult_after, self.p, self.status_after,
                                   self.blocks_after)  # fmt: skip
            matrix = np.eye(N) if projector is None else projector
            return Saltation(self.t, kinds, matrix, np.zeros(N), (self.f, self.f_after))
        jumps = [e for e in self.events if self._new(e) is not None]
        R_w, R_t, known = self._jump(jumps)
        first, alone = self._first(jumps)
        why, cause = FINE if known else UNKNOWN, "" if first is None else first.switch
        why = why if alone else CORNER
        S = np.eye(N)
        S[:n] = R_w
        delay = np.zeros(N)
        around = self.f, self.f_after
        if first is None:
            return Saltation(self.t, kinds, S, delay, around, why, cause)
        H_w, H_t = self._surface(first)
        if H_w is None:
            delay = H_t  # a clock's instant moves with parameters alone
        else:
            speed = H_t + H_w[:n] @ self.f
            size = abs(H_t) + np.abs(H_w[:n] * self.f).sum()
            if not abs(speed) > _TOUCHING * (size + _TOUCHING):
                return Saltation(self.t, kinds, S, delay, around, why or GRAZES, cause)
            delay = -H_w / speed
        S[:n] += np.outer(R_w[:, :n] @ self.f + R_t - self.f_after, delay)
        return Saltation(self.t, kinds, S, delay, around, why, cause)

    def _first(self, jumps) -> tuple[EventRecord | None, bool]:
        """The event whose surface sets the instant, and whether it alone does."""
        causes = [e for e in self.events if e.kind not in ("slip by reset", "closed contact", "terminal")]
        if not causes:
            return None, True
        first = next((e for e in causes if e in jumps), causes[0])
        others = (e for e in causes if e.switch != first.switch and self._reached(e) and self._apart(e, first))
        return first, next(others, None) is None

    def _reached(self, event: EventRecord) -> bool:
        """Whether an event of this instant stands on its own: not a consequence of another one's jump."""
        if not np.any(self.x != self.x_after):
            return self._surface(event)[0] is not None
        if event.switch in self.names:
            surface = self.line.model.multipliers[self.names.index(event.switch)].surface
        else:
            surface = next(s for s in self.line.model.events if s.name == event.switch).surface
        if surface is None or event.kind not in ("crossing", "stick", "impact", "reset"):
            return surface is None and event.kind == "reset"
        h_w, *_ = self.line.gradient(surface, self.t, self.x, self.mult, self.p)
        h = float(vectorised(self.line.model, surface)(self.t, *self.x, *self.mult, *self.p))
        return abs(h) <= _TOUCHING * (_TOUCHING + np.abs(h_w[: self.line.n] * self.x).sum())

    def _apart(self, one: EventRecord, other: EventRecord) -> bool:
        """Whether the instants of two events move apart with the state or a parameter."""
        with np.errstate(all="ignore"):  # one that only touches its surface is no twin of another
            first, second = (
                H_t if H_w is None else -H_w / (H_t + H_w[: self.line.n] @ self.f)
                for H_w, H_t in (self._surface(one), self._surface(other))
            )
        return not np.allclose(first, second, rtol=_TOUCHING, atol=_TOUCHING)

    def _new(self, event: EventRecord) -> tuple[sp.Expr, ...] | None:
        """State after an event as expressions of the state before, or None where it stays."""
        model = self.line.model
        if event.kind == "impact":
            return model.multipliers[self.names.index(event.switch)].impact
        spec = next((s for s in model.events if s.name == event.switch), None)
        if event.kind not in ("reset", "terminal") or spec is None or not spec.update:
            return None
        update = dict(spec.update)
        return tuple(update.get(i, x) for i, x in enumerate(model.states))

    def _jump(self, jumps) -> tuple[np.ndarray, np.ndarray, bool]:
        """R_w (n, N), R_t (n,) of the jumps of this instant, and whether an order is known that leads to its end.

        Events of one round act on the values before it, impacts one after the other. The log does not say where a
        round ends: what it must come to does.
        """
        line, n, N = self.line, self.line.n, self.line.N
        extra = np.eye(N)[n:]
        if not jumps:
            return np.eye(n, N), np.zeros(n), True
        for rounds in _rounds(jumps):
            R, W, T = self.x, np.eye(n, N), np.zeros(n)
            for events in rounds:
                R, R_w, R_t = line.jump(self._together(events), self.t, R, self.mult, self.p, self.J)
                W, T = R_w @ np.concatenate([W, extra]), R_w[:, :n] @ T + R_t
            if np.allclose(R, self.x_after, rtol=_LANDED, atol=_LANDED):
                return W, T, True
        return W, T, False

    def _together(self, events) -> tuple[sp.Expr, ...]:
        """State after events of one round: increments of a state add up, otherwise the last one says."""
        states = self.line.model.states
        new = list(states)
        for event in events:
            for i, (x, to) in enumerate(zip(states, self._new(event) or states)):
                if to != x:
                    step = to - x
                    new[i] = new[i] + step if new[i] != x and x not in step.free_symbols else to
        return tuple(new)

    def _surface(self, event: EventRecord) -> tuple[np.ndarray | None, np.ndarray]:
        """H_w (N,), H_t of an event; (None, dt as a row) for an instant of a clock."""
        line, blocks, J = self.line, self.blocks, self.J
        model = line.model
        if event.switch in self.names:
            j = self.names.index(event.switch)
            if event.kind in ("slip by fold", "sliding to sliding"):
                matrix = blocks.g_lam[0][np.ix_(J, J)]
                psi = np.linalg.svd(matrix)[0][:, -1]
                return psi @ blocks.g_w[0, J], psi @ blocks.g_t[0, J]
            if event.kind in ("slip by tangency", "opening", "slip by reset") and j in J:
                lam_w, lam_t = blocks.solved(J)
                return lam_w[0, J.index(j)], lam_t[0, J.index(j)]
            surface = model.multipliers[j].surface
        else:
            spec = next(s for s in model.events if s.name == event.switch)
            if spec.surface is None:
                return None, self._clock(spec)
            surface = spec.surface
        h_w, h_t, h_lam = line.gradient(surface, self.t, self.x, self.mult, self.p)
        if J and np.any(h_lam[J] != 0):  # solved multipliers in it are eliminated
            lam_w, lam_t = blocks.solved(J)
            h_w, h_t = h_w + h_lam[J] @ lam_w[0], h_t + h_lam[J] @ lam_t[0]
        return h_w, h_t

    def _clock(self, spec) -> np.ndarray:
        """How the present instant of a clock moves with the parameters, as a row (N,)."""
        model, line = self.line.model, self.line
        values = dict(zip(model.parameters, self.p))
        row = np.zeros(line.N)
        candidates = list(spec.at)
        if spec.every is not None:
            candidates.append(spec.every * round(self.t / float(spec.every.subs(values))))
        at = min(candidates, key=lambda e: abs(float(e.subs(values)) - self.t))
        for k, q in enumerate(line.chosen):
            row[line.n + k] = float(at.diff(q).subs(values))
        return row


def _rounds(jumps: list[EventRecord]) -> Iterator[list[list[EventRecord]]]:
    """Ways to part the jumps of an instant into rounds, few rounds first; an impact is one of its own."""
    places = range(1, len(jumps))
    sure = [i for i in places if "impact" in (jumps[i - 1].kind, jumps[i].kind)]
    free = [i for i in places if i not in sure]
    ways = chain.from_iterable(combinations(free, count) for count in range(len(free) + 1))
    for more in islice(ways, _MOST_WAYS):
        ends = sorted((*sure, *more))
        yield [jumps[i:j] for i, j in zip((0, *ends), (*ends, len(jumps)))]


def at(blocks: Blocks, k: int) -> Blocks:
    """Those of point k alone."""
    return Blocks(*(getattr(blocks, name)[k : k + 1] for name in blocks.__dataclass_fields__))


def tangent_projector(
    line: Linearised, t: float, x: np.ndarray, mult: np.ndarray, status: np.ndarray, p: np.ndarray
) -> np.ndarray | None:
    """Projector (N, N) on deviations along the surfaces that are slid on; None if there are none."""
    blocks = line.blocks(np.array([t]), x[:, None], mult[:, None], p)
    return _projector(line, t, x, mult, p, status, blocks)


def _projector(line, t, x, mult, p, status, blocks) -> np.ndarray | None:
    """1 - D (C D)**-1 C with the gradients C of what is held at 0, and directions D out of it."""
    n, N = line.n, line.N
    C, D = [], []
    for j, mu in enumerate(line.model.multipliers):
        if status[j] != 0 or mu.kind == "algebraic" or mu.regularity == "kink":
            continue
        twice = mu.kind == "contact" or mu.second is not None
        surfaces = [mu.surface, line.speed(j)] if twice else [mu.surface]
        rows = [line.gradient(h, t, x, mult, p)[0] for h in surfaces]
        directions = [row[:n] for row in rows]
        if twice:
            directions[-1] = blocks.f_lam[0, :, j]  # an impact takes the normal velocity along its push
        C += rows
        D += directions
    if not C:
        return None
    constraints, along = np.array(C), np.zeros((N, len(D)))
    along[:n] = np.array(D).T
    return np.eye(N) - along @ np.linalg.pinv(constraints @ along) @ constraints
