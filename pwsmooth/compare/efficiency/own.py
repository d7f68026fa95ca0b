"""Runners of this package's own two paths, for comparisons.

Chain: contract.py -> **this file** -> methods.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...paths.stiff_events import switched_by_events
from ...solving import solve
from .case import Case, basic
from .contract import CannotDo, Run, Runner, without_jumps
from .plain import plain


def _solved(system: Any, case: Case, t_end: float, **options: Any) -> Any:
    solution = solve(system, (0.0, t_end), case.x0, **options)
    if not solution.success:
        raise RuntimeError(solution.message)
    return solution


def event_driven(case: Case, rtol: float, **options: Any) -> Runner:
    """This package's event-driven path as a user calls it."""
    method = options.get("method")
    if method == "stiff":
        try:
            switched_by_events(case.system.model)
        except ValueError as error:
            raise CannotDo("stiff steps know no switch that can slide, and no contact") from error
    options |= case.tolerances(rtol)

    def run(t_end: float) -> Run:
        solution = _solved(case.system, case, t_end, **options)
        work = solution.cost.get("f_evals")
        if work is None:
            order = 11 if method == "rk" else solution.tolerances["order"]
            work = (order + 1) * solution.cost["jets"]
        return Run(solution.x[:, -1], lambda: [(e.time, basic(e.kind)) for e in solution.events], work)

    return run


def smoothed(case: Case, setting: tuple[float, float], sigmoid: str = "algebraic") -> Runner:
    """This package's smoothed path; eps is an accuracy knob of its own."""
    eps, rtol = setting
    without_jumps(case, "an impact has no smoothed form", "events that change the state are not smoothed")
    view, functions, tolerances = case.system.smoothed(eps, sigmoid), plain(case.system), case.tolerances(rtol)

    def run(t_end: float) -> Run:
        solution = _solved(view, case, t_end, **tolerances)
        return Run(
            solution.x[:, -1],
            lambda: inside_layers(functions, solution.t, solution.x, eps),
            int(solution.cost.get("f_evals", 0)),
        )

    return run


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
        # A start in a stick has no speed of arrival: the largest of the run stands in for it.
        fastest = float(np.max(np.abs(np.diff(row)) / np.diff(t), initial=0.0, where=np.diff(t) > 0))
        if inside[0] and stops.size and (t[stops[0]] - t[0]) * fastest > 10 * 6 * eps:
            log.append((t[stops[0]], "slip"))
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
