"""A second simulator without modes: short Runge-Kutta steps, every switch as its point says. Called on differences.

Its error is that of one step at each switching; a slide is chattering. It has no contacts, discs and hidden friction.
Chain: reference.py (the functions) -> **plain** -> __init__.py.
"""

from __future__ import annotations

import math

import numpy as np

from . import reference

STEP = 2e-4


def values(smooth, one, until):
    """States and memories at the instants up to `until`; None of models that it does not do."""
    return None if any(a.kind == "hid" for a in smooth.atoms) else _Walk(smooth, one).go(until)


class _Walk(reference.Run):
    """A run in short steps."""

    closed = ()

    def point(self, t, x):
        """Modes as the signs are."""
        M = [0.0] * len(self.S.atoms)
        given, zeros = self.given(t), self.zeros
        for j, atom in enumerate(self.S.atoms):
            h = self.S.h[j](t, x, M, *given, *zeros)[0]
            if atom.kind == "floor":
                M[j] = math.floor(h)
            elif h == 0:
                M[j] = {">": -1, ">=": 1}.get(atom.kind, 0)
            else:
                M[j] = math.copysign(1, h)
        return M

    def rate(self, t, x):
        P = reference.Phase(self.point(t, x), closed=self.closed)
        f = self.field(t, x, P)[0]
        if any(mu < 0 for mu in P.multipliers):
            self.closed = ()
            f = self.field(t, x, reference.Phase(P.M))[0]
        return f

    def step(self, t, x, h):
        k1 = self.rate(t, x)
        k2 = self.rate(t + h / 2, [a + h / 2 * b for a, b in zip(x, k1)])
        k3 = self.rate(t + h / 2, [a + h / 2 * b for a, b in zip(x, k2)])
        k4 = self.rate(t + h, [a + h * b for a, b in zip(x, k3)])
        return [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]

    def bounce(self, t, x):
        """The state after the impacts of this step; slow ones close."""
        P, given = reference.Phase(self.point(t, x)), self.given(t)
        D = self.directions(t, x, P, given)
        gap, speed = (f(t, x, P.M, *given, *self.zeros) for f in (self.S.gap, self.S.speed))
        for k, (g, v) in enumerate(zip(gap, speed)):
            if g <= 0 and v < 0 and k not in self.closed:
                rest = -v < 8 * STEP
                x = self.impact(k, t, x, P, given, D, v, 0.0 if rest else None)
                if rest:
                    self.closed = (*self.closed, k)
        return x

    def signs(self, t, x):
        return self.S.surface(t, x, self.point(t, x), *self.given(t), *self.zeros)

    def go(self, until):
        """The values."""
        S, found = self.S, self.answer.values
        self.zeros = [0.0] * len(S.gaps), [0.0] * 2 * len(S.discs)
        t, x, P = self.t0, list(self.case.start), None
        clocks, at, instants = list(self.clocks), 0, self.case.instants
        before = [0.0 if abs(h) < 1e-9 else h for h in self.signs(t, x)]
        self.started, self.last, self.due, self.knots = True, None, set(), set()
        self.before = list(before)
        try:
            while t < until - 1e-12 and at < len(instants):
                stop = min([c[0] for c in clocks[:1]] + [instants[at], t + STEP])
                x = self.step(t, x, stop - t) if stop > t else x
                t = stop
                struck = [c for c in clocks if abs(c[0] - t) <= 1e-12 * max(1, abs(t))]
                clocks = clocks[len(struck) :]
                self.forced, terminal = self.passed_now(before, self.signs(t, x)), False
                if self.forced or struck:
                    self.before = list(before)
                    x, terminal = self.events(t, x, P, struck)
                    before = self.before
                if S.gaps:
                    x = self.bounce(t, x)
                now = self.signs(t, x)
                jumped = self.passed_now(before, now) - self.forced
                if jumped and not terminal:
                    x, terminal = self.events(t, x, P, [], jumped)
                    now = self.signs(t, x)
                if terminal:
                    return found
                before = [b if abs(h) < 1e-12 else h for b, h in zip(before, now)]
                while at < len(instants) and instants[at] <= t:
                    found[at] = [*x, *self.m]
                    at += 1
        except (reference.UndecidedError, OverflowError, ValueError, ZeroDivisionError):
            return found
        return np.array(found)

    def passed_now(self, before, now):
        """Events whose surface has changed its sign in their direction."""
        return {
            k
            for k, e in enumerate(self.S.model.events)
            if e.surface is not None and before[k] * now[k] < 0 and e.direction in (0, math.copysign(1, now[k]))
        }

    def met(self, t, x, P):
        return set(self.forced)
