"""A bare sign in a right-hand side: what general-purpose integrators make of it.

On a sliding surface the right-hand side changes sign from stage to stage. The error of a step of length h is then h
times the jump, whatever the order, so that h falls to the absolute tolerance over the jump: the number of steps grows
as 1/atol, and implicit methods find no solution of their stage equations.
"""

from __future__ import annotations

import functools

import numpy as np

from ...solving import solve
from ..efficiency.case import Case
from ..efficiency.cases import CASES
from ..efficiency.plain import plain
from .failures import Finding, attempt
from .hazard import Axis, Hazard, decades
from .unguarded import SCIPY, cvode, scipy_end

MOST = 20_000  # evaluations; the restarted runs of the same scenes take 500 to 5000


@functools.cache
def _exact(name: str) -> np.ndarray:
    """State at the end of a scene, where the runs at two tolerances agree."""
    case = CASES[name]
    ends = [
        solve(case.system, (0.0, case.t_end), case.x0, rtol=rtol, atol=1e-2 * rtol).x[:, -1]
        for rtol in (1e-11, 1e-13)
    ]
    if np.max(np.abs(ends[0] - ends[1])) > 1e-8:
        raise RuntimeError(f"two runs of {name!r} disagree.")
    return ends[1]


def judged(case: Case, state: np.ndarray, rtol: float) -> Finding:
    off = case.apart(state, _exact(case.name))
    if not np.isfinite(off):
        return Finding("blow-up")
    if off > 0.1:
        return Finding("wrong itinerary", off)
    # A thousand tolerances: the events are met without being located.
    return Finding("inaccurate" if off > max(1e3 * rtol, 1e-6) else "right", off)


def bare_sign(fast: bool) -> Hazard:
    """Tolerances on scenes that cross, stick and slide."""
    names = ("crossing", "relay", "sticking") if fast else ("crossing", "relay", "sticking", "belt", "chain")

    def unguarded(method: str, rtol: float, row: float) -> Finding:
        case = CASES[names[int(row)]]
        run = cvode if method == "CVODE" else functools.partial(scipy_end, method)
        rates, span = plain(case.system).bare, (0.0, case.t_end)
        return attempt(run, lambda x: judged(case, x, rtol), rates, span, case.x0, rtol, rtol * 1e-2, most=MOST)

    def ours(rtol: float, row: float) -> Finding:
        case = CASES[names[int(row)]]
        return attempt(
            solve, lambda s: judged(case, s.x[:, -1], rtol), case.system, (0.0, case.t_end), case.x0, rtol=rtol,
            atol=rtol * 1e-2,
        )  # fmt: skip

    return Hazard(
        "bare-sign",
        "a bare sign in the right-hand side",
        Axis("rtol", decades(-9, -3, 1 / 6 if fast else 0.5)),
        Axis("scene", tuple(map(float, range(len(names)))), names),
        {m: functools.partial(unguarded, m) for m in (*SCIPY, "CVODE")} | {"event-driven": ours},
        unit="error of the state",
        truth="event-driven runs at two tolerances, which the restarted reference of the scene confirms (tests)",
    )
