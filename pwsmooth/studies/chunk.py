"""The value of a chunk of points: what a worker does, in whichever thread, process or machine.

Event-driven systems run as a compiled ensemble (orbits.py), smoothed and noisy ones, stiff steps and users' functions
through solve(), point by point. Both give the same bits wherever a point is computed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np

from ..analysis.maps.seen import Return
from ..paths.budget import Budget, Stop, within
from ..results.records import Outcome
from ..solving import EXPLICIT
from .plan import FUNCTION_FAILED, NO_RETURN, REFUSED, Plan
from .point import solve_point


def run_chunk(
    plan: Plan, columns: Mapping[str, np.ndarray], deadline: float = math.inf, stop: Stop | None = None
) -> dict[str, np.ndarray]:
    """Name -> values, shape (points, ...), of the points whose swept values are `columns`.

    A point that `deadline` (of time.time(), which machines share) finds unfinished has the outcome TIME_LIMIT; `stop`
    is set where nobody waits for the result.
    """
    seconds = None if deadline == math.inf else deadline - time.time()
    with within(Budget(seconds=seconds, stop=stop)) as spending:
        return _values(plan, columns, spending)


def _values(plan, columns, spending):
    result = plan.empty(len(next(iter(columns.values()))))
    ensemble, returns = goes_as_ensemble(plan), None
    if ensemble:
        from .orbits import run_orbits

        orbits = run_orbits(plan, columns)
        returns = orbits.strobe_t if isinstance(plan.seen, Return) else None
        for measure in (m for m in plan.measures if m.compiled):
            for name, values in measure.gather(orbits, plan.setting).items():
                result[name][:] = values
        result["t_reached"][:] = orbits.reached
        result["ambiguities"][:] = orbits.ambiguities
        result["outcome"][:] = orbits.outcome
    rest = [m for m in plan.measures if not (ensemble and m.compiled)]
    if rest or not ensemble:
        _one_by_one(plan, columns, result, rest, ensemble, returns, spending)
    return result


def goes_as_ensemble(plan: Plan) -> bool:
    """Whether the measures run in compiled code: explicit steps from event to event, without noise."""
    return plan.noise is None and plan.path in EXPLICIT


def _one_by_one(plan, columns, result, measures, outcome_known, returns, spending):
    dense = plan.has_polynomials and any(getattr(m, "dense", True) for m in measures)
    for i in range(len(result["outcome"])):
        if outcome_known and (result["outcome"][i] < 0 or (returns is not None and np.isnan(returns[i, -1]))):
            continue  # it failed, or another event ended it before its last return
        if spending.late():
            result["outcome"][i] = Outcome.TIME_LIMIT
            continue
        try:
            solution, window = solve_point(plan, columns, i, dense, None if returns is None else returns[i])
        except (ValueError, TypeError):
            result["outcome"][i] = REFUSED
            continue
        if not outcome_known:
            result["t_reached"][i] = solution.t[-1]
            result["ambiguities"][i] = len(solution.ambiguities)
            result["outcome"][i] = solution.outcome
            if window is None and solution.outcome == Outcome.FINISHED:
                result["outcome"][i] = NO_RETURN
            if window is None or solution.outcome < Outcome.FINISHED:
                continue
        for measure in measures:
            try:
                values = measure.of(solution, window, plan.setting)
                for name, value in values.items():
                    result[name][i] = value
            except Exception:  # a user's function may raise anything: a point must not cost the sweep
                result["outcome"][i] = FUNCTION_FAILED
