"""One point of a sweep by solve().

Chain: plan.py -> point (here) -> chunk.py, orbits.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .plan import Plan, with_number


def solve_point(plan: Plan, columns: Mapping[str, np.ndarray], i: int, dense: bool) -> tuple[Any, Any]:
    """Solution and window of point i of a chunk; raises what solve() refuses: no single axis shows a combination."""
    from ..solve import solve

    t0, begin, end, period = (a[i] for a in plan.windows(columns, len(next(iter(columns.values())))))
    values, start, noise = {}, list(plan.start), plan.noise
    for name, kind in plan.kinds:
        if kind == "parameter":
            values[name] = float(columns[name][i])
        elif kind == "state":
            start[plan.setting.states.index(name)] = float(columns[name][i])
        elif kind == "noise":
            noise = with_number(noise, name, columns[name][i])
    options = {k: v for k, v in plan.options if v is not None}
    if noise is not None:
        options["noise"] = noise
    window = plan.window(begin, end, period)
    solution = solve(
        plan.system, (float(t0), float(end)), start, parameters=values, dense_output=dense, **options
    )
    return solution, window
