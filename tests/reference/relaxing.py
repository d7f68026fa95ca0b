"""The oscillator with a relaxing hidden term, event by event with SciPy: no closed form exists in the stick.

    y' = v,   v' = -sigma sin(omega t) - k y - c v - N lam (1 + rho z),   beta z' = gamma(lam) - z

Limit eps -> 0 at fixed beta: z is frozen while v passes through 0, so a contact is captured when
|F| <= N (1 + rho z), F = -sigma sin(omega t) - k y, and let go where lam = F/(N (1 + rho z)) reaches 1 in size.
In a slip phase z = z_0 exp(-t/beta) is inserted, which leaves a system that is not stiff.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

TOL = dict(method="DOP853", rtol=1e-13, atol=1e-15)


def relaxing_orbit(beta, rho=3.0, *, k=3.1, sigma=2.4, c=0.1, N=1.0, omega=1.0, y0=0.6, v0=-1.07, z0=0.0, t_end=60.0):
    """Events [(time, kind, side)] and the state (y, v, z) at t_end.

    kind is "crossing", "stick" or "slip by tangency"; side is the sign of v after the event (0 while it sticks).
    """

    def force(t, y):
        return -sigma * math.sin(omega * t) - k * y

    t, y, v, z, side = 0.0, y0, v0, z0, math.copysign(1.0, v0)
    events = []
    while True:
        if side == 0:

            def rate(t, x):
                lam = force(t, y) / (N * (1 + rho * x[0]))
                return [(1 - lam * lam - x[0]) / beta]

            def margin(t, x):
                return N * (1 + rho * x[0]) - abs(force(t, y))

            margin.terminal, margin.direction = True, -1
            run = solve_ivp(rate, (t, t_end), [z], events=margin, max_step=min(0.05, beta), **TOL)
            t, z = run.t[-1], run.y[0, -1]
            if run.status == 0:
                return events, np.array([y, 0.0, z])
            side = math.copysign(1.0, force(t, y))
            events.append((t, "slip by tangency", side))
            continue

        start, z_start = t, z

        def rate(t, x):
            z = z_start * math.exp(-(t - start) / beta)
            return [x[1], force(t, x[0]) - c * x[1] - N * side * (1 + rho * z)]

        def velocity(t, x):
            return side * x[1]

        velocity.terminal, velocity.direction = True, -1
        # The hidden term dies within some 40 beta, where the steps have to resolve it.
        fade = min(t_end, start + 40 * beta)
        run = solve_ivp(rate, (t, fade), [y, v], events=velocity, max_step=min(0.05, beta), **TOL)
        if run.status == 0 and fade < t_end:
            y, v = run.y[:, -1]
            run = solve_ivp(rate, (fade, t_end), [y, v], events=velocity, max_step=0.05, **TOL)
        t, (y, v) = run.t[-1], run.y[:, -1]
        z = z_start * math.exp(-(t - start) / beta)
        if run.status == 0:
            return events, np.array([y, v, z])
        v = 0.0
        if abs(force(t, y)) <= N * (1 + rho * z):
            side = 0
            events.append((t, "stick", 0))
        else:
            side = -side
            events.append((t, "crossing", side))


def segments_of(events, omega=1.0):
    """[(kind of the segment's first event, duration, start phase modulo 2 pi)] between consecutive events."""
    return [
        (kind, after[0] - time, (omega * time) % (2 * math.pi))
        for (time, kind, *_), after in zip(events, events[1:], strict=False)
    ]
