"""Filippov's solution by a general-purpose integrator that is stopped at every event and started anew.

What a careful user of `scipy.integrate.solve_ivp` writes: one smooth mode at a time, terminal events on the surfaces
and, while sliding, on |lambda| = 1; at an event the fields on both sides decide. Multipliers that are linear in
their residuals only. It shares no code with the kernels, so that it also serves as an independent reference.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .plain import Plain

CROSSING, STICK, SLIP, IMPACT = "crossing", "stick", "slip", "impact"


def fixed(functions: Plain, status: np.ndarray) -> np.ndarray:
    """Multipliers off their surfaces: the side of a switch, no reaction of an open contact."""
    return np.where(functions.contacts, 0.0, status.astype(float))


class Mode:
    """The smooth system between two events: statuses 1, -1 (off a surface), 0 (on it)."""

    def __init__(self, functions: Plain, status: np.ndarray) -> None:
        self.functions, self.status = functions, status
        self.out = np.empty(functions.n)
        self.g = np.empty(functions.m)

    def multipliers(self, t: float, x: np.ndarray) -> np.ndarray:
        """lam with the sliding ones solved from their linear residuals."""
        slides = np.flatnonzero(self.status == 0)
        lam = fixed(self.functions, self.status)
        if slides.size:
            residuals, g = self.functions.residuals, self.g
            residuals(t, x, lam, g)
            at_zero = g[slides].copy()
            matrix = np.empty((slides.size, slides.size))
            for column, j in enumerate(slides):
                lam[j] = 1.0
                residuals(t, x, lam, g)
                matrix[:, column] = g[slides] - at_zero
                lam[j] = 0.0
            lam[slides] = np.linalg.solve(matrix, -at_zero)
        return lam

    def rates(self, t: float, x: np.ndarray) -> np.ndarray:
        self.functions.rates(t, x, self.multipliers(t, x), self.out)
        return self.out.copy()

    def events(self) -> list[Any]:
        """One terminal event a switch."""
        return [self._event(j) for j in range(self.functions.m)]

    def _event(self, j):
        level = np.empty(self.functions.m)

        def off(t, x):
            self.functions.surfaces(t, x, self.multipliers(t, x), level)
            return self.status[j] * level[j] if self.status[j] else 1.0

        def on(t, x):
            return 1.0 - abs(self.multipliers(t, x)[j])

        event = on if self.status[j] == 0 else off
        event.terminal, event.direction = True, -1.0
        return event


def restarted(
    functions: Plain,
    t_span: tuple[float, float],
    x0: np.ndarray,
    *,
    method: str = "DOP853",
    rtol: float,
    atol: float,
    max_step: float = np.inf,
    restitution: float = 0.0,
    most: int = 100_000,
    most_evaluations: int = 10_000_000,
) -> tuple[np.ndarray, list[tuple[float, str]], int]:
    """(state at the end, events as (time, kind), evaluations of the right-hand side).

    Raises
    ------
    RuntimeError
        The integrator fails, or there are more than `most` events or `most_evaluations`.
    """
    from scipy.integrate import solve_ivp

    (t, end), x = t_span, np.array(x0, float)
    status = _start(functions, t, x)
    log: list[tuple[float, str]] = []
    evaluations = 0
    while len(log) <= most:
        mode = Mode(functions, status)
        run = solve_ivp(
            mode.rates, (t, end), x, method, events=mode.events(), rtol=rtol, atol=atol, max_step=max_step
        )
        evaluations += run.nfev
        t, x = float(run.t[-1]), run.y[:, -1].copy()
        if run.status < 0 or evaluations > most_evaluations:
            raise RuntimeError(run.message if run.status < 0 else f"more than {most_evaluations} evaluations")
        if run.status == 0:
            return x, log, evaluations
        j = next(j for j, times in enumerate(run.t_events) if times.size)
        if functions.contacts[j]:
            log.append((t, IMPACT))
            after = np.empty((sum(functions.contacts), functions.n))
            functions.impacts(t, x, fixed(functions, status), after)
            x = after[0]
        elif status[j] == 0:
            lam = mode.multipliers(t, x)
            status = status.copy()
            status[j] = 1 if lam[j] > 0 else -1
            log.append((t, SLIP))
        else:
            status = status.copy()
            status[j] = _decide(functions, t, x, status, j)
            log.append((t, STICK if status[j] == 0 else CROSSING))
            _land(functions, t, x, j)
    raise RuntimeError(f"more than {most} events")


def _start(functions, t, x):
    """1 or -1 by the side; a start on a surface is decided by the fields."""
    level = np.empty(functions.m)
    functions.surfaces(t, x, np.ones(functions.m), level)
    status = np.where(level < 0, -1, 1)
    for j in np.flatnonzero(level == 0):
        status[j] = 1 if functions.contacts[j] else _decide(functions, t, x, status, j)
    return status


def _decide(functions, t, x, status, j):
    """0 where both fields point to the surface j, else the side to which the flow goes."""
    g, lam = np.empty(functions.m), fixed(functions, status)
    rates = {}
    for side in (1, -1):
        lam[j] = side
        functions.residuals(t, x, lam, g)
        rates[side] = g[j]
    if rates[1] < 0 < rates[-1]:
        return 0
    if status[j] == 0:
        return 1 if rates[1] > 0 else -1
    return -status[j] if rates[-status[j]] * -status[j] > 0 else status[j]


def _land(functions, t, x, j):
    """Puts a state that is itself the surface exactly on it: what is left of the event's tolerance."""
    gradient = np.empty((functions.m, functions.n))
    functions.gradients(t, x, np.ones(functions.m), gradient)
    level = np.empty(functions.m)
    functions.surfaces(t, x, np.ones(functions.m), level)
    direction = gradient[j]
    x -= level[j] * direction / (direction @ direction)
