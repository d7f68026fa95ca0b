"""One rung, measured and judged, and which one is recommended.

Times within a quarter are the same, and within a millisecond if the poorer rung takes no more steps.
Chain: **this file** -> result.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...door import checks

__all__ = ["Step", "judge", "recommend"]

SAME_COST = 1.25  # processor times of one run on a shared machine differ by this: no reason to climb
CALL = 1e-3  # s; below it the time is that of the call and of the machine's other work: fewer steps decide


@dataclass(frozen=True)
class Step:
    """One rung, measured.

    Attributes
    ----------
    name, matched : str
        Of the rung.
    value : ndarray, shape () or (k,)
        The observable, in its unit; nan where the motion does not have it.
    error, spread : float, in the unit of the observable
        Numerical error, and half width of the 95 % interval of a mean over noise.
    seconds : float, s
        Processor time of one run, compilation apart.
    steps : int
        Of that run.
    failure : str
        Why there is no value.
    distance, bar : float, in the unit of the observable
        From the richest rung, and the error bar of that.
    verdict : str
        "within", "outside", "undecided", "failed", or "richest".

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.compare.ladders import Step
    >>> Step("Coulomb", "given", np.array(0.5), error=1e-9, spread=0.0, seconds=1e-3, steps=12).verdict
    ''
    """

    name: str
    matched: str
    value: np.ndarray
    error: float
    spread: float
    seconds: float
    steps: int
    failure: str = ""
    distance: float = math.nan
    bar: float = math.nan
    verdict: str = ""


@checks.door()
def judge(distance: float, bar: float, tolerance: float) -> str:
    """Whether a distance known up to its bar lies within a tolerance.

    Parameters
    ----------
    distance, bar, tolerance : float, in the unit of the observable
        All three >= 0.

    Returns
    -------
    str
        "within", "outside" or "undecided".

    >>> [judge(distance, 0.1, 1.0) for distance in (0.5, 0.95, 2.0)]
    ['within', 'undecided', 'outside']
    """
    if distance + bar <= tolerance:
        return "within"
    return "outside" if distance - bar > tolerance or math.isinf(distance) else "undecided"


@checks.door()
def recommend(steps: Sequence[Step], tolerance: float) -> tuple[str | None, str]:
    """The recommended one of judged steps, and why.

    Parameters
    ----------
    steps : sequence of Step
        Judged, poorest first, the last the richest.

    Returns
    -------
    (str or None, str)
        Name of the rung, None if none can be recommended; the reason in words.

    Notes
    -----
    The cheapest rung that is surely within the tolerance; of rungs that cost the same the poorer one.

    >>> cheap = Step("Coulomb", "", np.array(1.0), 0.0, 0.0, seconds=1e-3, steps=9, verdict="within")
    >>> rich = Step("LuGre", "", np.array(1.0), 0.0, 0.0, seconds=1e-2, steps=90, verdict="richest")
    >>> recommend([cheap, rich], 0.1)[0]
    'Coulomb'
    """
    top = steps[-1]
    if top.failure:
        return None, f"none: the richest rung failed ({top.failure})"
    if not np.all(np.isfinite(top.value)):
        return None, "none: the richest rung's motion has no such quantity"
    if top.error + top.spread > tolerance:
        return None, (
            f"none: the richest rung's own error, {top.error + top.spread:.2g}, exceeds the tolerance; ask for less, "
            "run it tighter, or over a shorter span"
        )
    good = [step for step in steps if step.verdict in ("within", "richest")]
    doubtful = [step.name for step in steps if step.verdict == "undecided"]
    doubt = f"; undecided: {', '.join(doubtful)}" if doubtful else ""
    if good == [top]:
        return None, f"none is: no rung below {top.name} is surely within the tolerance{doubt}"
    fastest = min(good, key=lambda step: step.seconds)
    least = fastest.seconds

    def as_cheap(step: Step) -> bool:
        if step.seconds <= SAME_COST * least:
            return True
        return step.seconds <= least + CALL and step.steps <= fastest.steps

    chosen = next(step for step in good if as_cheap(step))
    if chosen is top:
        return top.name, f"{top.name}: within the tolerance by itself, and no coarser rung costs less{doubt}"
    cheapest = "the cheapest rung within the tolerance"
    if chosen.seconds > least:
        cheapest = "the poorest of the rungs within the tolerance whose times are as good as equal"
    return chosen.name, f"{chosen.name}: {cheapest}{doubt}"
