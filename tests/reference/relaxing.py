"""The oscillator with a relaxing hidden term, event by event with SciPy: the stick has no closed form.

    y' = v,   v' = -sigma sin(omega t) - k y - c v - N lam (1 + rho z),   beta z' = gamma(lam) - z

Limit eps -> 0 at fixed beta: z is frozen while v passes through 0, so a contact is captured when
|F| <= N (1 + rho z), F = -sigma sin(omega t) - k y, and let go where lam = F/(N (1 + rho z)) reaches 1 in size.
In a slip phase z = z_0 exp(-t/beta) is inserted, which leaves a system that is not stiff.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp


def _advance(rhs, event, t, t_end, x, max_step):
    """DOP853 to the event's fall through zero or t_end: (time, state, whether the event happened)."""
    event.terminal, event.direction = True, -1
    run = solve_ivp(rhs, (t, t_end), x, "DOP853", events=event, max_step=max_step, rtol=1e-13, atol=1e-15)
    return float(run.t[-1]), [float(a) for a in run.y[:, -1]], run.status == 1


def _stick(force, t, z, t_end, y, N, rho, beta):
    """A stick from t at position y: (time, z, whether it ended by |lam| = 1)."""

    def rate(t, x):
        lam = force(t, y) / (N * (1 + rho * x[0]))
        return [(1 - lam * lam - x[0]) / beta]

    def margin(t, x):
        return N * (1 + rho * x[0]) - abs(force(t, y))

    t, (z,), ended = _advance(rate, margin, t, t_end, [z], min(0.05, beta))
    return t, z, ended


def _slip(force, start, y, v, z, t_end, side, c, N, rho, beta):
    """A slip phase of one side: (time, y, v, z, whether v reached 0)."""

    def rate(t, x):
        decayed = z * math.exp(-(t - start) / beta)
        return [x[1], force(t, x[0]) - c * x[1] - N * side * (1 + rho * decayed)]

    def velocity(t, x):
        return side * x[1]

    # The hidden term dies within some 40 beta, where the steps have to resolve it.
    fade = min(t_end, start + 40 * beta)
    t, (y, v), ended = _advance(rate, velocity, start, fade, [y, v], min(0.05, beta))
    if not ended and fade < t_end:
        t, (y, v), ended = _advance(rate, velocity, fade, t_end, [y, v], 0.05)
    return t, y, v, z * math.exp(-(t - start) / beta), ended


def relaxing_orbit(
    beta, rho=3.0, *, k=3.1, sigma=2.4, c=0.1, N=1.0, omega=1.0, y0=0.6, v0=-1.07, z0=0.0, t_end=60.0
):
    """Events [(time, kind)] and the state (y, v, z) at t_end, from (y0, v0, z0) at t = 0 with v0 != 0."""

    def force(t, y):
        return -sigma * math.sin(omega * t) - k * y

    t, y, v, z, side = 0.0, y0, v0, z0, math.copysign(1.0, v0)
    events = []
    while True:
        if side == 0:
            t, z, ended = _stick(force, t, z, t_end, y, N, rho, beta)
            if not ended:
                return events, np.array([y, 0.0, z])
            side = math.copysign(1.0, force(t, y))
            events.append((t, "slip by tangency"))
            continue
        t, y, v, z, ended = _slip(force, t, y, v, z, t_end, side, c, N, rho, beta)
        if not ended:
            return events, np.array([y, v, z])
        v = 0.0
        if abs(force(t, y)) <= N * (1 + rho * z):
            side = 0
            events.append((t, "stick"))
        else:
            side = -side
            events.append((t, "crossing"))


def segments_of(events, omega=1.0):
    """[(kind of the segment's first event, duration, start phase modulo 2 pi)] between consecutive events."""
    return [
        (first[1], after[0] - first[0], (omega * first[0]) % (2 * math.pi))
        for first, after in zip(events, events[1:], strict=False)
    ]
