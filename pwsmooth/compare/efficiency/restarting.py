"""Filippov's solution by SciPy, stopped at every event and started anew.

What a careful user of `scipy.integrate.solve_ivp` writes: one smooth mode at a time, with terminal events on the
surfaces and, while sliding, on |lambda| = 1; at an event the fields on both sides decide (automaton.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .automaton import Strike, automaton, follow
from .plain import Plain


def restarted(
    functions: Plain,
    t_span: tuple[float, float],
    x0: np.ndarray,
    *,
    method: str = "DOP853",
    most: int = 100_000,
    most_evaluations: int = 10_000_000,
    **options: Any,
) -> tuple[np.ndarray, list[tuple[float, str]], int]:
    """(state at the end, events as (time, kind), evaluations of the right-hand side).

    `options` are solve_ivp's: rtol, atol, max_step. RuntimeError where the integrator fails, or after more than `most`
    events or `most_evaluations`.
    """
    from scipy.integrate import solve_ivp

    rules = automaton(functions)
    field, margins = rules.field, rules.margins
    level = np.empty(functions.n_walls)

    def advance(t, end, x, status, watched):
        rates = np.empty(functions.n)

        def rhs(time, y):
            field(time, y, status, rates)
            return rates.copy()

        def event(k):
            def margin(time, y):
                # The start lies on the wall that was struck, on either side of it to rounding.
                if time <= t:
                    return 1e-300
                margins(time, y, status, level)
                return level[k]

            margin.terminal, margin.direction = True, -1.0  # type: ignore[attr-defined]
            return margin

        run = solve_ivp(rhs, (t, end), x, method, events=[event(k) for k in watched], **options)
        if run.status < 0:
            raise RuntimeError(run.message)
        wall = None
        if run.status == 1:
            wall = next(k for k, times in zip(watched, run.t_events) if times.size)
        return Strike(float(run.t[-1]), run.y[:, -1].copy(), wall, int(run.nfev))

    return follow(rules, advance, t_span, x0, most=most, most_evaluations=most_evaluations)
