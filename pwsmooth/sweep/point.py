"""One point of a sweep by solve().

Chain: plan.py -> point (here) -> chunk.py, orbits.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .contract import Window
from .plan import Plan


def solve_point(plan: Plan, columns: Mapping[str, np.ndarray], i: int, dense: bool) -> tuple[Any, Any]:
    """Solution and window of point i of a chunk; raises what solve() refuses: no single axis shows a combination."""
    from ..solve import solve

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
    options = {k: v for k, v in plan.options if v is not None}
    if noise is not None:
        options["noise"] = noise
    solution = solve(plan.system, (t0, end), start, parameters=values, dense_output=dense, **options)
    return solution, Window(begin, end, period, plan.setting.periods, plan.forced)
