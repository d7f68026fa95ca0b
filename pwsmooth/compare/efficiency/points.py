"""The list of what a comparison measured, with the questions that are asked of it.

Chain: point.py, charts.py -> **this file** -> measuring.py, experiments.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ...door import checks
from ...plotting import new_figure
from .charts import plot_work
from .point import Point

__all__ = ["Point", "WorkPrecision"]


@checks.door()
class WorkPrecision(list[Point]):
    """The Points of a comparison, with what is asked of them; a list.

    Parameters
    ----------
    points : iterable of Point
        Measured ones.
    references : dict of str to dict
        Of every case the source of its reference, its uncertainty and its number of events.

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

        Returns
        -------
        Axes
            The same, or the new ones.
        """
        return plot_work(self, new_figure(6.0, 4.5).subplots() if axes is None else axes, work=work)
