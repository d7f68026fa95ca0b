"""Runners of the rivals: SciPy, time stepping, and the peers of the extra `bench`.

Chain: contract.py, plain.py, automaton.py, peers -> **this file** -> methods.py.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from .case import Case
from .contract import MANY, MOST, CannotDo, Run, Runner, without_jumps
from .plain import plain
from .restarting import restarted
from .timestepping import bouncing, stepper


def _from_start(case: Case, solve: Callable[..., Any]) -> Runner:
    """The runner of solve(t_end, x0) -> (state at the end, events, evaluations)."""
    return lambda t_end: Run(*solve(t_end, np.array(case.x0, float)))


def bounded(rates: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """The same function for MOST calls: an integrator that grinds on a sliding surface is stopped."""
    calls = 0

    def counted(t: float, x: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        if calls > MOST:
            raise RuntimeError(f"more than {MOST:g} evaluations before the end of the span")
        return rates(t, x)

    return counted


def event_ignoring(method: str, case: Case, rtol: float) -> Runner:
    """SciPy on the right-hand side with its bare sign: what happens when nothing is said of the switch."""
    reason = "no term of a right-hand side"
    without_jumps(case, f"an impact is {reason}", f"events that change the state are {reason}")
    from scipy.integrate import solve_ivp

    functions, tolerances = plain(case.system), case.tolerances(rtol)

    def solve(t_end: float, x0: np.ndarray) -> Any:
        out = solve_ivp(bounded(functions.bare), (0.0, t_end), x0, method, **tolerances)
        if not out.success:
            raise RuntimeError(out.message)
        return out.y[:, -1], None, int(out.nfev)

    return _from_start(case, solve)


def restarting(method: str, case: Case, rtol: float) -> Runner:
    """SciPy with terminal events, restarted at each; its step is bounded, so that none is stepped over."""
    functions = plain(case.system)
    options = dict(
        method=method, **case.tolerances(rtol), max_step=case.longest, most=2000, most_evaluations=MOST
    )
    return _from_start(case, lambda t_end, x0: restarted(functions, (0.0, t_end), x0, **options))


def time_stepping(case: Case, share: float) -> Runner:
    """Moreau-Jean with a fixed step, theta = 1/2."""
    functions = plain(case.system)
    if any(functions.contacts) and functions.m > 1:
        raise CannotDo("the baseline has no contact beside switches")
    if functions.events:
        raise CannotDo("the baseline has no events besides switches and contacts")
    if case.restitution is not None and np.isnan(case.restitution):
        raise CannotDo("the baseline has one number for the restitution of a contact")
    advance = (bouncing if any(functions.contacts) else stepper)(functions)
    last = case.restitution if case.restitution is not None else 0.5
    read = impulses if case.restitution is not None else statuses

    def solve(t_end: float, x0: np.ndarray) -> Any:
        steps = max(2, int(np.ceil(t_end / (share * case.longest))))
        x, lam, work = advance(0.0, t_end, x0, steps, last)
        return x[-1], lambda: read(np.linspace(0.0, t_end, steps + 1), lam), work

    return _from_start(case, solve)


def statuses(t: np.ndarray, lam: np.ndarray) -> list[tuple[float, str]]:
    """Events of a time-stepping run: |lam| < 1 on two successive steps sticks, a change of sign crosses.

    The time is that of the end of the last step before.
    """
    log = []
    for row in lam[1:].T:
        stuck = np.abs(row) < 1 - 1e-9
        stuck &= np.append(stuck[1:], stuck[-1]) | np.append(False, stuck[:-1])
        for k in np.flatnonzero(np.diff(stuck.astype(int))):
            log.append((t[k + 1], "stick" if stuck[k + 1] else "slip"))
        side, free = np.sign(row), ~stuck
        where = np.flatnonzero(free[:-1] & free[1:] & (side[:-1] * side[1:] < 0))
        log += [(t[k + 1], "crossing") for k in where]
    return sorted(log)


def impulses(t: np.ndarray, force: np.ndarray) -> list[tuple[float, str]]:
    """Impacts of a time-stepping run: a first step with an impulse after one without."""
    pushed = force[1:, 0] > 0
    first = np.flatnonzero(pushed & ~np.append(False, pushed[:-1]))
    return [(t[k + 1], "impact") for k in first]


# ---- peers


def _switches_only(case: Case) -> None:
    without_jumps(case, *["impacts and events are no term of a right-hand side"] * 2)


def heyoka_events(case: Case, rtol: float) -> Runner:
    """heyoka with terminal events."""
    from .peers.heyoka import integrators

    return _from_start(case, integrators(case.system, plain(case.system), rtol).run)


def heyoka_smoothed(case: Case, setting: tuple[float, float]) -> Runner:
    """heyoka on the smoothed view."""
    _switches_only(case)
    from .peers.heyoka import Smooth

    eps, rtol = setting
    return _from_start(case, Smooth(case.system.smoothed(eps), rtol, MANY).run)


def cvode_events(method: str, case: Case, rtol: float) -> Runner:
    """CVODE, restarted at the roots that it finds."""
    from .peers.sundae import Cvode

    options = dict(method=method, max_step=case.longest, **case.tolerances(rtol))
    return _from_start(case, Cvode(plain(case.system), MOST, **options).run)


def cvode_ignoring(method: str, case: Case, rtol: float) -> Runner:
    """CVODE on the right-hand side with its bare sign."""
    _switches_only(case)
    from .peers.sundae import ignoring

    options = dict(most=MOST, method=method, **case.tolerances(rtol))
    return _from_start(case, partial(ignoring, plain(case.system), **options))


def lsoda_ignoring(case: Case, rtol: float) -> Runner:
    """Compiled LSODA on the right-hand side with its bare sign."""
    _switches_only(case)
    from .peers.numbalsoda import solve_ignoring

    return _from_start(case, partial(solve_ignoring, plain(case.system), **case.tolerances(rtol), most=MANY))


def compiled_events(case: Case, rtol: float) -> Runner:
    """Compiled DOP853, restarted at events by a compiled loop."""
    from .peers.numbalsoda import solve_events

    options = dict(longest=case.longest, **case.tolerances(max(rtol, 3e-14)))
    return _from_start(case, partial(solve_events, plain(case.system), **options))


def diffrax_events(case: Case, rtol: float) -> Runner:
    """diffrax's Dopri8, restarted at its events."""
    from .peers.diffrax import modes

    integrator = modes(case.system, plain(case.system), case.longest, MANY // 13)
    return _from_start(case, partial(integrator.run, **case.tolerances(rtol)))


def diffrax_ignoring(case: Case, rtol: float) -> Runner:
    """diffrax's Dopri8 on the right-hand side with its bare sign."""
    _switches_only(case)
    from .peers.diffrax import solve_ignoring

    return _from_start(case, partial(solve_ignoring, case.system, **case.tolerances(rtol), most=MANY))


def nosnoc_steps(stages: int, case: Case, steps: int) -> Runner:
    """FESD: the setting is the number of steps of the simulation over the whole span."""
    _switches_only(case)
    functions = plain(case.system)
    if all(functions.kinks):
        raise CannotDo("a kink is no switch of a Filippov system: nothing to detect with complementarities")
    lams = {mu.symbol for mu in case.system.model.multipliers}
    if any(e.diff(lam, 2) != 0 for e in case.system.model.rhs for lam in lams & e.free_symbols):
        raise CannotDo("what is nonlinear in the multiplier is lost in a convex combination")
    from .peers.nosnoc import simulate

    def solve(t_end: float, x0: np.ndarray) -> Any:
        return simulate(case.system, t_end, x0, max(1, round(steps * t_end / case.t_end)), stages, 1e-9)

    return _from_start(case, solve)


def nivp(case: Case, rtol: float) -> Runner:
    """solve_nivp's projection of w on sign(h)."""
    _switches_only(case)
    functions = plain(case.system)
    if any(functions.kinks):
        raise CannotDo("its projection is that of a switch, not of a kink")
    from .peers.solve_nivp import simulate

    return _from_start(case, partial(simulate, functions, rtol=rtol, atol=rtol * min(case.sizes), most=MOST))
