"""Methods of a comparison: each takes a case and one setting, and gives a runner to be timed.

A runner solves the case from its start to `t_end` and returns a Run. What a method cannot do it says at once, by
CannotDo, and the chart says so too. Compilation happens in the first call, which is not timed.
Chain: cases.py, restarting.py, timestepping.py, peers.py -> **this file** -> work_precision.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..solve import solve
from .cases import Case, basic
from .plain import plain
from .restarting import restarted
from .timestepping import bouncing, stepper

__all__ = ["METHODS", "CannotDo", "Method", "Run"]


class CannotDo(Exception):
    """The method has no form for this case; the text says why."""


@dataclass(frozen=True)
class Run:
    """What one run gave.

    Attributes
    ----------
    x : ndarray (n,)
        State at the end.
    events : list of (float, str), or None
        Time and kind ("crossing", "stick", "slip", "impact"); None for a method that knows no events.
    evaluations : int
        Of the right-hand side; a Taylor polynomial of order K counts K + 1.
    """

    x: np.ndarray
    events: list[tuple[float, str]] | None
    evaluations: int


MOST = 100_000  # evaluations of a right-hand side through Python
Runner = Callable[[float], Run]


@dataclass(frozen=True)
class Method:
    """One line of a chart.

    Parameters
    ----------
    name : str
    group : str
        Methods of one group share a colour in every chart.
    knob : str
        What the setting is: "rtol", "step" (share of the longest step), "(eps, rtol)".
    settings : tuple
        From loose to tight.
    runner : callable
        (case, setting) -> runner(t_end); raises CannotDo.
    extra : str
        The package that it needs besides the core.
    """

    name: str
    group: str
    knob: str
    settings: tuple[Any, ...]
    runner: Callable[[Case, Any], Runner]
    extra: str = ""


RTOLS = tuple(10.0**-k for k in range(6, 14))
LOOSE = tuple(10.0**-k for k in range(3, 13))


def _solved(system: Any, case: Case, **options: Any) -> Callable[[float], Any]:
    def run(t_end: float) -> Any:
        solution = solve(system, (0.0, t_end), case.start, **options)
        if not solution.success:
            raise RuntimeError(solution.message)
        return solution

    return run


def event_driven(**options: Any) -> Callable[[Case, float], Runner]:
    """This package's event-driven path as a user calls it."""

    def runner(case: Case, rtol: float) -> Runner:
        solved = _solved(case.system, case, rtol=rtol, atol=rtol * 1e-2, **options)

        def run(t_end: float) -> Run:
            solution = solved(t_end)
            log = [(event.time, basic(event.kind)) for event in solution.events]
            order = 11 if options.get("method") == "rk" else solution.tolerances["order"]
            work = (order + 1) * solution.cost["jets"]
            return Run(solution.x[:, -1], [entry for entry in log if entry[1]], work)

        return run

    return runner


def smoothed(sigmoid: str = "algebraic") -> Callable[[Case, tuple[float, float]], Runner]:
    """This package's smoothed path; eps is an accuracy knob of its own."""

    def runner(case: Case, setting: tuple[float, float]) -> Runner:
        eps, rtol = setting
        if case.restitution is not None:
            raise CannotDo("an impact has no smoothed form")
        view = case.system.smoothed(eps, sigmoid)
        solved = _solved(view, case, rtol=rtol, atol=rtol * 1e-2)
        functions = plain(case.system)

        def run(t_end: float) -> Run:
            solution = solved(t_end)
            log = inside_layers(functions, solution.t, solution.x, eps)
            return Run(solution.x[:, -1], log, int(solution.cost.get("f_evals", 0)))

        return run

    return runner


def inside_layers(functions: Any, t: np.ndarray, x: np.ndarray, eps: float) -> list[tuple[float, str]]:
    """The events of a smoothed orbit: a stay inside |h| < 3 eps is a stick if the flow lingers, else a crossing.

    Lingers: longer than ten times as long as crossing at the speed of arrival takes.
    """
    level, log = np.empty((functions.m, len(t))), []
    h, lam = np.empty(functions.m), np.ones(functions.m)
    for k in range(len(t)):
        functions.surfaces(t[k], x[:, k].copy(), lam, h)
        level[:, k] = h
    for row in level:
        inside = np.abs(row) < 3 * eps
        edges = np.flatnonzero(np.diff(inside.astype(int)))
        starts, stops = edges[~inside[edges]], edges[inside[edges]]
        for a in starts:
            b = stops[stops > a]
            stay = (t[b[0]] if b.size else t[-1]) - t[a + 1]
            speed = abs(row[a] - row[a + 1]) / (t[a + 1] - t[a])
            if stay > 10 * 6 * eps / max(speed, 1e-300):
                log.append((t[a + 1], "stick"))
                if b.size:
                    log.append((t[b[0]], "slip"))
            elif b.size and row[a] * row[b[0] + 1] < 0:
                log.append((0.5 * (t[a + 1] + t[b[0]]), "crossing"))
    return sorted(log)


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
        from scipy.integrate import solve_ivp

        functions = plain(case.system)

        def run(t_end: float) -> Run:
            out = solve_ivp(
                bounded(functions.bare), (0.0, t_end), np.array(case.start), method, rtol=rtol, atol=rtol * 1e-2
            )
            if not out.success:
                raise RuntimeError(out.message)
            return Run(out.y[:, -1], None, int(out.nfev))

        return run

    return runner


def restarting(method: str, careful: bool = True) -> Callable[[Case, float], Runner]:
    """SciPy with terminal events, restarted at each; `careful` bounds the step so that none is stepped over."""

    def runner(case: Case, rtol: float) -> Runner:
        functions = plain(case.system)
        longest = case.longest if careful else np.inf

        def run(t_end: float) -> Run:
            x, log, work = restarted(
                functions, (0.0, t_end), np.array(case.start), method=method, rtol=max(rtol, 3e-14),
                atol=rtol * 1e-2, max_step=longest, most=2000, most_evaluations=MOST,
            )  # fmt: skip
            return Run(x, log, work)

        return run

    return runner


def time_stepping(case: Case, share: float) -> Runner:
    """Moreau-Jean with a fixed step, theta = 1/2."""
    functions = plain(case.system)
    if any(functions.contacts) and functions.m > 1:
        raise CannotDo("the baseline has no contact beside switches")
    advance = (bouncing if any(functions.contacts) else stepper)(functions)
    last = case.restitution if case.restitution is not None else 0.5

    def run(t_end: float) -> Run:
        steps = max(2, int(np.ceil(t_end / (share * case.longest))))
        x, lam, work = advance(0.0, t_end, np.array(case.start), steps, last)
        times = np.linspace(0.0, t_end, steps + 1)
        log = impulses(times, lam) if case.restitution is not None else statuses(times, lam)
        return Run(x[-1], log, work)

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


STEPS = tuple(0.5**k for k in range(0, 14, 2))
WIDTHS = tuple((10.0**-k, min(1e-3, 10.0 ** -(k + 1))) for k in range(1, 9))
METHODS = {
    method.name: method
    for method in (
        Method("event-driven", "event-driven", "rtol", RTOLS, event_driven()),
        Method("event-driven, order 12", "event-driven", "rtol", RTOLS, event_driven(order=12)),
        Method("event-driven, order 20", "event-driven", "rtol", RTOLS, event_driven(order=20)),
        Method("event-driven, 8(5,3) pair", "event-driven", "rtol", RTOLS, event_driven(method="rk")),
        Method("smoothed, algebraic", "smoothed", "(eps, rtol)", WIDTHS, smoothed()),
        Method("smoothed, tanh", "smoothed", "(eps, rtol)", WIDTHS, smoothed("tanh")),
        Method("DOP853, restarted at events", "with events", "rtol", LOOSE, restarting("DOP853")),
        Method("RK45, restarted at events", "with events", "rtol", LOOSE, restarting("RK45")),
        Method("DOP853, bare sign", "no events", "rtol", LOOSE[:7], event_ignoring("DOP853")),
        Method("RK45, bare sign", "no events", "rtol", LOOSE[:7], event_ignoring("RK45")),
        Method("BDF, bare sign", "no events", "rtol", LOOSE[:7], event_ignoring("BDF")),
        Method("Moreau-Jean time stepping", "time stepping", "step", STEPS, time_stepping),
    )
}
