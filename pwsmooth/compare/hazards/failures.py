"""The ways of failing, and the rules by which a run is put into one of them.

    right             the decision and the numbers are those of the exact solution
    recorded          the solver says that it cannot decide: an honest answer, no failure
    inaccurate        the right events, but numbers off by more than the hazard's bound
    missed event      an event of the exact solution is not there
    wrong itinerary   other events, or another decision at one, than the exact solution's
    creep in stick    motion where the exact solution stands still
    drift             a constraint (surface, gap) is left, or a mean value moves that must not
    energy growth     an invariant bound of the exact flow is exceeded
    blow-up           not finite, or beyond a million times that bound
    stall             the end is not reached within the evaluations, steps or events allowed
    step collapse     the solver gives up: its step fell below the spacing of numbers, or its iteration failed

Chain: **this file** -> hazard.py, the hazards -> maps.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...door import checks
from ...results.records import Outcome

#: Ways a run can end -> their colours, the same in every map.
KINDS = {
    "right": "#EDEFF2",
    "recorded": "#BFE5C0",
    "inaccurate": "#B8B8A0",
    "missed event": "#E69F00",
    "wrong itinerary": "#D62728",
    "creep in stick": "#F0E442",
    "drift": "#009E73",
    "energy growth": "#CC79A7",
    "blow-up": "#5E2A84",
    "stall": "#0072B2",
    "step collapse": "#222222",
}
HARMLESS = ("right", "recorded")
MILLION = 1e6


@checks.door()
@dataclass(frozen=True)
class Finding:
    """What one run came to.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
    size : float
        The number behind the verdict, in the unit that the hazard names; nan where there is none.

    Raises
    ------
    ValueError
        `kind` is none of `KINDS`.

    >>> Finding("drift", 1e-3).kind
    'drift'
    """

    kind: str
    size: float = float("nan")

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"`kind` is {self.kind!r}, which is none of {', '.join(KINDS)}.")


class Stalled(Exception):
    """More evaluations, steps or events than allowed."""


class Collapsed(Exception):
    """The solver gave up."""


def attempt(
    run: Callable[..., Any], judge: Callable[[Any], Finding], *arguments: Any, **options: Any
) -> Finding:
    """`judge(run(*arguments, **options))`, where a run that ends before its time is put into its own kind."""
    try:
        got = run(*arguments, **options)
    except Stalled:
        return Finding("stall")
    except Collapsed:
        return Finding("step collapse")
    except FloatingPointError:
        return Finding("blow-up")
    outcome = getattr(got, "outcome", None)
    if isinstance(outcome, Outcome) and not outcome.success:
        return Finding(_OF_OUTCOME.get(outcome, "stall"))
    return judge(got)


_OF_OUTCOME = {
    Outcome.AMBIGUITY: "recorded",
    Outcome.DETERMINACY_LOST: "recorded",
    Outcome.NOT_FINITE: "blow-up",
    Outcome.STEP_UNDERFLOW: "step collapse",
    Outcome.NO_ROOT: "step collapse",
    Outcome.SINGULAR: "step collapse",
}


def held(level: np.ndarray, bound: float, slack: float = 1e-6) -> Finding | None:
    """A blow-up or an energy growth of `level` over a bound of the exact flow; None if the bound holds.

    `slack` is relative: what the truncation error of a stable run is allowed beyond the bound.
    """
    if not np.all(np.isfinite(level)) or np.max(level) > MILLION * bound:
        return Finding("blow-up", float("inf"))
    if np.max(level) > bound * (1 + slack):
        return Finding("energy growth", float(np.max(level) / bound))
    return None
