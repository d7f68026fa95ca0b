"""Runners of this package's own two paths, for comparisons.

Chain: contract.py -> **this file** -> methods.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...paths.stiff_events import switched_by_events
from ...solve import solve
from .case import Case, basic
from .contract import CannotDo, Run, Runner
from .plain import plain


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
        if options.get("method") == "stiff":
            try:
                switched_by_events(case.system.model)
            except ValueError as error:
                raise CannotDo("stiff steps know no switch that can slide, and no contact") from error
        solved = _solved(case.system, case, **case.tolerances(rtol), **options)

        def run(t_end: float) -> Run:
            solution = solved(t_end)

            def log():
                return [(event.time, basic(event.kind)) for event in solution.events]

            if "f_evals" in solution.cost:
                return Run(solution.x[:, -1], log, solution.cost["f_evals"])
            order = 11 if options.get("method") == "rk" else solution.tolerances["order"]
            return Run(solution.x[:, -1], log, (order + 1) * solution.cost["jets"])

        return run

    return runner


def smoothed(sigmoid: str = "algebraic") -> Callable[[Case, tuple[float, float]], Runner]:
    """This package's smoothed path; eps is an accuracy knob of its own."""

    def runner(case: Case, setting: tuple[float, float]) -> Runner:
        eps, rtol = setting
        if case.restitution is not None:
            raise CannotDo("an impact has no smoothed form")
        if any(not event.singular for event in case.system.model.events):
            raise CannotDo("events that change the state are not smoothed")
        view = case.system.smoothed(eps, sigmoid)
        solved = _solved(view, case, **case.tolerances(rtol))
        functions = plain(case.system)

        def run(t_end: float) -> Run:
            solution = solved(t_end)
            return Run(
                solution.x[:, -1],
                lambda: inside_layers(functions, solution.t, solution.x, eps),
                int(solution.cost.get("f_evals", 0)),
            )

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
