"""Runners of the rivals: SciPy, time stepping, and the peers of the extra `bench`.

Chain: contract.py, plain.py, automaton.py, peers -> **this file** -> methods.py.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .case import Case
from .contract import MANY, MOST, CannotDo, Run, Runner
from .plain import plain
from .restarting import restarted
from .timestepping import bouncing, stepper


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


def event_ignoring(method: str) -> Callable[[Case, float], Runner]:
    """SciPy on the right-hand side with its bare sign: what happens when nothing is said of the switch."""

    def runner(case: Case, rtol: float) -> Runner:
        if case.restitution is not None:
            raise CannotDo("an impact is no term of a right-hand side")
        if any(not event.singular for event in case.system.model.events):
            raise CannotDo("events that change the state are no term of a right-hand side")
        from scipy.integrate import solve_ivp

        functions = plain(case.system)

        def run(t_end: float) -> Run:
            out = solve_ivp(
                bounded(functions.bare), (0.0, t_end), np.array(case.start), method, **case.tolerances(rtol)
            )
            if not out.success:
                raise RuntimeError(out.message)
            return Run(out.y[:, -1], None, int(out.nfev))

        return run

    return runner


def restarting(method: str) -> Callable[[Case, float], Runner]:
    """SciPy with terminal events, restarted at each; its step is bounded, so that none is stepped over."""

    def runner(case: Case, rtol: float) -> Runner:
        functions = plain(case.system)

        def run(t_end: float) -> Run:
            x, log, work = restarted(
                functions, (0.0, t_end), np.array(case.start), method=method, **case.tolerances(rtol),
                max_step=case.longest, most=2000, most_evaluations=MOST,
            )  # fmt: skip
            return Run(x, log, work)

        return run

    return runner


def time_stepping(case: Case, share: float) -> Runner:
    """Moreau-Jean with a fixed step, theta = 1/2."""
    functions = plain(case.system)
    if any(functions.contacts) and functions.m > 1:
        raise CannotDo("the baseline has no contact beside switches")
    if functions.events:
        raise CannotDo("the baseline has no events besides switches and contacts")
    advance = (bouncing if any(functions.contacts) else stepper)(functions)
    last = case.restitution if case.restitution is not None else 0.5

    def run(t_end: float) -> Run:
        steps = max(2, int(np.ceil(t_end / (share * case.longest))))
        x, lam, work = advance(0.0, t_end, np.array(case.start), steps, last)
        times = np.linspace(0.0, t_end, steps + 1)
        read = impulses if case.restitution is not None else statuses
        return Run(x[-1], lambda: read(times, lam), work)

    return run


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
    if case.restitution is not None or any(not event.singular for event in case.system.model.events):
        raise CannotDo("impacts and events are no term of a right-hand side")


def heyoka_events(case: Case, rtol: float) -> Runner:
    """heyoka with terminal events."""
    from .peers.heyoka import integrators

    integrator = integrators(case.system, plain(case.system), rtol)

    def run(t_end: float) -> Run:
        return Run(*integrator.run(t_end, np.array(case.start, float)))

    return run


def heyoka_smoothed(case: Case, setting: tuple[float, float]) -> Runner:
    """heyoka on the smoothed view."""
    _switches_only(case)
    from .peers.heyoka import Smooth

    eps, rtol = setting
    integrator = Smooth(case.system.smoothed(eps), rtol)

    def run(t_end: float) -> Run:
        x, work = integrator.run(t_end, np.array(case.start, float), MANY)
        return Run(x, None, work)

    return run


def cvode_events(method: str) -> Callable[[Case, float], Runner]:
    """CVODE, restarted at the roots that it finds."""

    def runner(case: Case, rtol: float) -> Runner:
        from .peers.sundae import Cvode

        integrator = Cvode(
            plain(case.system), MOST, method=method, max_step=case.longest, **case.tolerances(rtol)
        )

        def run(t_end: float) -> Run:
            return Run(*integrator.run(t_end, np.array(case.start, float)))

        return run

    return runner


def cvode_ignoring(method: str) -> Callable[[Case, float], Runner]:
    """CVODE on the right-hand side with its bare sign."""

    def runner(case: Case, rtol: float) -> Runner:
        _switches_only(case)
        from .peers.sundae import ignoring

        def run(t_end: float) -> Run:
            x, work = ignoring(
                plain(case.system),
                np.array(case.start, float),
                t_end,
                MOST,
                method=method,
                **case.tolerances(rtol),
            )
            return Run(x, None, work)

        return run

    return runner


def lsoda_ignoring(case: Case, rtol: float) -> Runner:
    """Compiled LSODA on the right-hand side with its bare sign."""
    _switches_only(case)
    from .peers.numbalsoda import solve_ignoring

    options = case.tolerances(rtol)

    def run(t_end: float) -> Run:
        x, work = solve_ignoring(plain(case.system), np.array(case.start, float), t_end, **options, most=MANY)
        return Run(x, None, work)

    return run


def compiled_events(case: Case, rtol: float) -> Runner:
    """Compiled DOP853, restarted at events by a compiled loop."""
    from .peers.numbalsoda import in_words, solve_events

    options = case.tolerances(max(rtol, 3e-14))

    def run(t_end: float) -> Run:
        start = np.array(case.start, float)
        x, events, work = solve_events(plain(case.system), start, t_end, **options, longest=case.longest)
        return Run(x, lambda: in_words(events), work)

    return run


def diffrax_events(case: Case, rtol: float) -> Runner:
    """diffrax's Dopri8, restarted at its events."""
    from .peers.diffrax import modes

    options = case.tolerances(rtol)
    integrator = modes(case.system, plain(case.system), case.longest, MANY // 13)

    def run(t_end: float) -> Run:
        return Run(*integrator.run(t_end, np.array(case.start, float), **options))

    return run


def diffrax_ignoring(case: Case, rtol: float) -> Runner:
    """diffrax's Dopri8 on the right-hand side with its bare sign."""
    _switches_only(case)
    from .peers.diffrax import solve_ignoring

    def run(t_end: float) -> Run:
        x, work = solve_ignoring(
            case.system, np.array(case.start, float), t_end, **case.tolerances(rtol), most=MANY
        )
        return Run(x, None, work)

    return run


def nosnoc_steps(stages: int) -> Callable[[Case, int], Runner]:
    """FESD: the setting is the number of steps of the simulation over the whole span."""

    def runner(case: Case, steps: int) -> Runner:
        _switches_only(case)
        functions = plain(case.system)
        if all(functions.kinks):
            raise CannotDo("a kink is no switch of a Filippov system: nothing to detect with complementarities")
        lams = {mu.symbol for mu in case.system.model.multipliers}
        if any(e.diff(lam, 2) != 0 for e in case.system.model.rhs for lam in lams & e.free_symbols):
            raise CannotDo("what is nonlinear in the multiplier is lost in a convex combination")
        from .peers.nosnoc import simulate

        def run(t_end: float) -> Run:
            count = max(1, round(steps * t_end / case.t_end))
            x, _, work = simulate(case.system, np.array(case.start, float), t_end, count, stages, 1e-9)
            return Run(x, None, work)

        return run

    return runner


def nivp(case: Case, rtol: float) -> Runner:
    """solve_nivp's projection of w on sign(h)."""
    _switches_only(case)
    functions = plain(case.system)
    if any(functions.kinks):
        raise CannotDo("its projection is that of a switch, not of a kink")
    from .peers.solve_nivp import simulate

    def run(t_end: float) -> Run:
        x, work = simulate(functions, np.array(case.start, float), t_end, rtol, rtol * min(case.sizes), MOST)
        return Run(x, None, work)

    return run
