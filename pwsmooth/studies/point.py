"""One point of a sweep by solve().

Chain: plan.py -> point (here) -> chunk.py, orbits.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..analysis.maps.poincare import RETURN
from ..analysis.maps.seen import Return
from ..results.records import Outcome
from .contract import Window
from .plan import Plan


def solve_point(
    plan: Plan, columns: Mapping[str, np.ndarray], i: int, dense: bool, times: Any = None
) -> tuple[Any, Any]:
    """Solution and window of point i of a chunk; raises what solve() refuses: no single axis shows a combination.

    With a section the run ends with the last return of the window (`times`, if they are known), or as one does that has
    too few of them: there the window is None.
    """
    windows = plan.windows(columns, len(next(iter(columns.values()))))
    t0, begin, end, period = (float(a[i]) for a in windows)
    values, start, noise = {}, list(plan.start), plan.noise
    for name, kind in plan.kinds:
        if kind == "parameter":
            values[name] = float(columns[name][i])
        elif kind == "state":
            start[plan.setting.states.index(name)] = float(columns[name][i])
        elif kind == "noise":
            noise = replace(noise, **{name: int(columns[name][i])})
    system = plan.system.with_parameters(values)

    def run(until: float, dense_output: bool = False) -> Any:
        return plan.solver(dense_output)(system, (t0, until), start, noise=noise)

    if isinstance(plan.seen, Return):
        if times is None:
            times, solution = _returns(plan, run, t0)
            if times is None:
                return solution, None
        return run(times[-1], dense_output=dense), Window(times, True)
    times = begin + period * np.arange(plan.setting.periods + 1)
    times[-1] = end
    return run(end, dense_output=dense), Window(times, plan.seen is not None)


def _returns(plan: Plan, run: Any, t0: float) -> tuple[Any, Any]:
    """Times of the window's returns, None where they are too few; and the last run that was looked at."""
    wanted, longest = plan.transient + plan.setting.periods + 1, plan.seen.longest
    span = longest / 1024
    while True:
        solution = run(t0 + span)
        times = solution.event_times(switch=RETURN)[:wanted]
        enough = len(times) == wanted
        waits = np.diff(np.concatenate([[t0], times, [] if enough else [solution.t[-1]]]))
        if waits.max() >= longest or not (enough or solution.outcome is Outcome.FINISHED):
            return None, solution
        if enough:
            return times[plan.transient :], solution
        span *= 2
