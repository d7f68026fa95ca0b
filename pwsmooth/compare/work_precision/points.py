"""What a comparison measured: a Point for each method and setting, and the list of them with its questions.

Three errors of a run: the state (largest over three ends of the span, in units of the states' sizes), the event times,
and the one that matters most here, a wrong itinerary: another sequence of crossings, sticks and slips than the
reference's. Work: processor time and evaluations of the right-hand side.
Chain: **this file** -> measuring.py, charts.py, experiments.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

__all__ = ["Point", "WorkPrecision"]


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


class WorkPrecision(list[Point]):
    """The Points of a comparison, with what is asked of them; a list.

    Parameters
    ----------
    points : iterable of Point
        Measured ones.
    references : dict of str to dict
        Of every case the source of its reference, its uncertainty and its number of events.

    Examples
    --------
    >>> from pwsmooth.compare import work_precision
    >>> data = work_precision("relay", ["event-driven"], [1e-6, 1e-9], repeats=1)
    >>> len(data), data.references["relay"]["source"]
    (2, 'closed form')
    >>> data.cheapest(1e-5, work="evaluations")["event-driven"].setting
    1e-06
    """

    def __init__(
        self, points: Iterable[Point] = (), references: dict[str, dict[str, Any]] | None = None
    ) -> None:
        super().__init__(points)
        self.references = references or {}

    def of(self, case: str) -> WorkPrecision:
        """The points of one case.

        Parameters
        ----------
        case : str
            Its name.

        Returns
        -------
        WorkPrecision
            With the same references.
        """
        return WorkPrecision((p for p in self if p.case == case), self.references)

    def cheapest(self, error: float, *, work: str = "seconds") -> dict[str, Point]:
        """Of every method its least work with an error within the bound, cheapest first.

        Parameters
        ----------
        error : float, dimensionless
            Of the state, in units of its sizes.
        work : {"seconds", "evaluations"}
            What is least.

        Returns
        -------
        dict of str to Point
            Name of the method -> its point.
        """
        best: dict[str, Point] = {}
        for p in self:
            if p.good and p.error <= error:
                if p.method not in best or getattr(p, work) < getattr(best[p.method], work):
                    best[p.method] = p
        return dict(sorted(best.items(), key=lambda item: getattr(item[1], work)))

    def plot(self, axes: Any = None, *, work: str = "seconds") -> Any:
        """Error against work of a comparison of one case, a line a method.

        Parameters
        ----------
        axes : Axes, optional
            Where to draw; of a new figure by default.
        work : {"seconds", "evaluations"}
            The horizontal axis.

        Returns
        -------
        Axes
            The same, or the new ones.
        """
        from ...plotting import new_figure
        from .charts import plot_work

        return plot_work(self, new_figure(6.0, 4.5).subplots() if axes is None else axes, work=work)
