"""solve_nivp: implicit integrators whose nonsmooth relations are projections, with adaptive steps.

Given as in its notebooks on friction and sliding modes: the multiplier w is an unknown beside the state, w in
sign(h) by the projection `sign`; the composite method, semismooth Newton, Richardson's step control. For the ball
the projection `unilateral` with Newton's restitution. D. Riley, I. Stefanou, solve_nivp.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..plain import Plain


def simulate(functions: Plain, t_end: float, x0: np.ndarray, rtol: float, atol: float, most: int) -> Any:
    """(state at the end, no events, evaluations).

    The unknowns are (x, h, w): h = surface(t, x) by an algebraic row, w by the projection.
    RuntimeError where the steps fail or need more than `most` evaluations.
    """
    from solve_nivp import solve_ivp_ns

    n, m, calls = functions.n, functions.m, 0
    rates, walls, level = functions.rates, functions.walls, np.empty(functions.n_walls)

    def rhs(t, z, *_):
        nonlocal calls
        calls += 1
        if calls > most:
            raise RuntimeError(f"more than {most} evaluations before the end of the span")
        x, w = np.ascontiguousarray(z[:n]), np.ascontiguousarray(z[n + m :])
        out = np.zeros(n + 2 * m)
        rates(t, x, w, out[:n])
        walls(t, x, w, level)
        out[n : n + m] = level[:m] - z[n : n + m]
        return out

    start = np.concatenate([x0, np.zeros(2 * m)])
    walls(0.0, x0, np.ones(m), level)
    start[n : n + m], start[n + m :] = level[:m], np.sign(level[:m])
    mass = np.diag(np.concatenate([np.ones(n), np.zeros(2 * m)]))
    t, z, *_ = solve_ivp_ns(
        rhs, (0.0, t_end), start, method="composite", projection="sign",
        projection_opts=dict(y_indices=list(range(n, n + m)), w_indices=list(range(n + m, n + 2 * m))),
        solver="semismooth_newton", solver_opts=dict(tol=min(1e-8, rtol * 1e-2), max_iter=50), A=mass, rtol=rtol,
        atol=atol, h0=1e-3, component_slices=[slice(0, n), slice(n, n + m), slice(n + m, n + 2 * m)],
        skip_error_indices=[1, 2],
    )  # fmt: skip
    if not t[-1] >= t_end * (1 - 1e-9):
        raise RuntimeError(f"solve_nivp stopped at t = {t[-1]:g}")
    return np.asarray(z[-1][:n], float), None, calls
