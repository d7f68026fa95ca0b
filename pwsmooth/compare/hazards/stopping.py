"""Event location of general-purpose integrators, where the surface acts on nothing: which zeros of h do they see?

SciPy's `events` on dense output, heyoka's on the Taylor polynomial, CVODE's rootfinding. All look for a change of sign
between two ends of a step, heyoka for all roots of the polynomial. `longest` bounds the step, as a careful user does.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .failures import Collapsed
from .unguarded import quiet


class Motion(NamedTuple):
    """x' = rates(t, x) with a surface h(t, x); `equations(hy)` is (system, surface with hy.par[0]) for heyoka."""

    rates: Callable[..., Any]
    surface: Callable[..., float]
    equations: Any
    parameter: float


def _scipy(
    method: str, motion: Motion, span: tuple[float, float], x0: Any, rtol: float, longest: float
) -> np.ndarray:
    from scipy.integrate import solve_ivp

    run = solve_ivp(
        motion.rates, span, x0, method, rtol=max(rtol, 3e-14), atol=rtol * 1e-2, max_step=longest,
        events=motion.surface,
    )  # fmt: skip
    if run.status < 0:
        raise Collapsed(run.message)
    return run.t_events[0]


@functools.cache
def _taylor(equations: Any, rtol: float) -> Any:
    import heyoka

    system, surface = equations(heyoka)
    seen: list[float] = []
    event = heyoka.nt_event(surface, lambda stepper, t, direction: seen.append(t))
    return heyoka.taylor_adaptive(system, np.zeros(len(system)), tol=rtol, nt_events=[event]), seen


def _heyoka(motion: Motion, span: tuple[float, float], x0: Any, rtol: float, longest: float) -> np.ndarray:
    stepper, seen = _taylor(motion.equations, rtol)
    seen.clear()
    stepper.time = span[0]
    stepper.state[:] = x0
    if len(stepper.pars):
        stepper.pars[0] = motion.parameter
    stepper.propagate_until(span[1], max_delta_t=longest)
    return np.array(seen)


def _cvode(motion: Motion, span: tuple[float, float], x0: Any, rtol: float, longest: float) -> np.ndarray:
    from sksundae.cvode import CVODE

    def rhs(t: float, x: np.ndarray, out: np.ndarray) -> None:
        out[:] = motion.rates(t, x)

    def events(t: float, x: np.ndarray, out: np.ndarray) -> None:
        out[0] = motion.surface(t, x)

    events.terminal = [False]  # type: ignore[attr-defined]
    bound = 0.0 if math.isinf(longest) else longest
    with quiet():
        solver = CVODE(
            rhs, rtol=max(rtol, 1e-14), atol=rtol * 1e-2, max_step=bound, max_num_steps=100_000, eventsfn=events,
            num_events=1,
        )  # fmt: skip
        run = solver.solve(np.array(span), np.array(x0, float))
    if not run.success:
        raise Collapsed(run.message)
    return np.array([]) if run.t_events is None else np.array(run.t_events)


# Name -> zeros(motion, span, x0, rtol, longest) -> times.
SEERS: dict[str, Callable[..., np.ndarray]] = {
    "DOP853, events": functools.partial(_scipy, "DOP853"),
    "RK45, events": functools.partial(_scipy, "RK45"),
    "heyoka, events": _heyoka,
    "CVODE, events": _cvode,
}
