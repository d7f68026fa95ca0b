"""What a comparison measured, one method at one setting: a Point.

Three errors of a run: the state (largest over three ends of the span, in units of the states' sizes), the event times,
and the one that matters most here, a wrong itinerary: another sequence of crossings, sticks and slips than the
reference's. Work: processor time and evaluations of the right-hand side.
Chain: **this file** -> charts.py, points.py.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Point:
    """One method at one setting on one case.

    Attributes
    ----------
    case, method, group : str
        Of the case and the method.
    setting : Any
        Of the method's knob: a tolerance, a share of the longest step, (eps, rtol).
    error : float, dimensionless
        Of the state, in units of the states' sizes; nan where there is none.
    event_error : float, s
        Largest error of an event time; nan without events or with a wrong itinerary.
    itinerary : str
        "right", "wrong", or "none" for methods that know no events.
    seconds : float, s
        Processor time of a run to the last end, median.
    first_call : float, s
        Processor time of the first call, compilation included.
    evaluations : int
        Of the right-hand side.
    note : str
        Why there is no result: "cannot do: ...", "not installed: ...", or the failure.

    Examples
    --------
    >>> from pwsmooth.compare import work_precision
    >>> (point,) = work_precision("relay", ["event-driven"], [1e-9], repeats=1)
    >>> point.itinerary, point.good
    ('right', True)
    """

    case: str
    method: str
    group: str
    setting: Any
    error: float
    event_error: float
    itinerary: str
    seconds: float
    first_call: float
    evaluations: int
    note: str = ""

    @property
    def good(self) -> bool:
        """Whether there is a result whose itinerary is not wrong."""
        return self.error < np.inf and self.itinerary != "wrong"

    def as_dict(self) -> dict[str, Any]:
        """The point for a data file.

        Returns
        -------
        dict of str to value
            Its attributes.
        """
        return asdict(self)
