"""Minimum: the best point of a search, what holds there, how it was found.

Chain: minimising.py -> **minimum**.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..door import checks
from ..door.describe import Described, Rows, values
from ..door.documenting import complete
from ..paths.derivatives.of_solution import NoDerivative
from ..solving import solve

HELD = 1e-7  # violation up to which a constraint counts as held


@complete
class Evaluation(NamedTuple):
    """A point that a search has tried.

    Attributes
    ----------
    number : int
        Of the run, from 1 on.
    values : dict of str to float
        Of the unknowns, in their units.
    cost : float
        In the unit of the cost; nan where the run or a derivative of it failed.
    violation : float
        The largest amount by which a constraint does not hold, dimensionless: over its slope by the unknowns, these
        in units of their size, at the first point; nan as the cost.

    >>> x = sp.Symbol("x", real=True)
    >>> found = minimise(System({x: 2 - sp.sign(x)}), (final(x) - 1) ** 2, (0, 2), {x: -2}, ["x"])
    >>> first = found.history[0]
    >>> first.number, first.values, round(first.cost, 9)
    (1, {'x': -2.0}, 0.111111111)
    """

    number: int
    values: dict[str, float]
    cost: float
    violation: float


@checks.door()
class Minimum(Described):
    """The least cost that was found; `minimise` makes it.

    Parameters
    ----------
    system : System
        With the values that were found.
    values : mapping of str to float, in their units
        As the attribute.
    cost : float, in its unit
        As the attribute.
    gradient : ndarray, shape (k,), in the unit of the cost over those of the unknowns
        As the attribute.
    constraints : mapping of str to float, in their units
        As the attribute.
    holds : mapping of str to bool
        As the attribute.
    success : bool
        As the attribute.
    message : str
        As the attribute.
    history : sequence of Evaluation
        As the attribute.
    problem : NoDerivative or None
        As the attribute.
    refused : int
        As the attribute.
    run : tuple
        Span, initial state and options of `solve` for the best run.

    Attributes
    ----------
    system : System
        With the values that were found.
    values : dict of str to float
        Of the unknowns, in their units.
    cost : float
        In its unit.
    gradient : ndarray, shape (k,), in the unit of the cost over those of the unknowns
        Of the cost, in the order of `values`.
    constraints : dict of str to float
        Of each its left side minus its right side, in its unit.
    holds : dict of str to bool
        Whether each holds, up to the tolerance of the search.
    success : bool
        Whether it is a least cost: no direction that the constraints leave lowers it, and no run beside it is better.
    message : str
        How the search ended.
    history : list of Evaluation
        All points, in their order.
    refused : int
        How many of them had no run or no derivative; the search went on beside them.
    problem : NoDerivative or None
        The first reason of these.

    >>> x = sp.Symbol("x", real=True)
    >>> relay = System({x: 2 - sp.sign(x)})
    >>> found = minimise(relay, integral(x**2), (0, 2), {x: -2}, ["x"], constraints=[final(x) >= 1.6])
    >>> print(f"{found.values['x']:.6f}", found.holds, f"{found.solution['x'][-1]:.6f}")
    -1.200000 {'final(x) >= 1.6': True} 1.600000
    """

    def __init__(
        self, system: Any, values: Mapping[str, float], cost: float, gradient: np.ndarray,
        constraints: Mapping[str, float], holds: Mapping[str, bool], success: bool, message: str,
        history: Sequence[Evaluation], problem: NoDerivative | None, refused: int, run: tuple[Any, Any, Any],
    ) -> None:  # fmt: skip
        self.system, self.values, self.cost, self.gradient = system, dict(values), cost, gradient
        self.constraints, self.holds = dict(constraints), dict(holds)
        self.success, self.message, self.history = success, message, list(history)
        self.problem, self.refused, self._run = problem, refused, run

    @property
    def evaluations(self) -> int:
        """Number of runs."""
        return len(self.history)

    @functools.cached_property
    def solution(self) -> Any:
        """The run at the best point, a Solution with dense output."""
        span, x0, options = self._run
        return solve(self.system, span, x0, dense_output=True, **options)

    def plot(self, ax: Any = None) -> Any:
        """The cost of every point that was tried, filled where the constraints hold.

        Returns
        -------
        Axes
            Where it was drawn.
        """
        from .. import plotting

        (ax,) = plotting.axes_for(None if ax is None else [ax], 1, (4.5, 3.0), "one search")
        number, cost = np.array([(e.number, e.cost) for e in self.history]).T
        open_ = np.array([e.violation > HELD for e in self.history])
        ax.plot(number, cost, color=plotting.COLOUR["right"], linewidth=0.8)
        for those, fill in ((open_, "none"), (~open_, plotting.COLOUR["right"])):
            ax.plot(
                number[those],
                cost[those],
                "o",
                color=plotting.COLOUR["right"],
                markerfacecolor=fill,
                markersize=4,
            )
        ax.axhline(self.cost, color=plotting.COLOUR["mark"], linewidth=0.8)
        ax.set(xlabel="run", ylabel="cost")
        return ax

    def _described(self) -> tuple[str, Rows]:
        margins = [
            f"{name}" + ("" if self.holds[name] else f": fails by {abs(value):.3g}")
            for name, value in self.constraints.items()
        ]
        refused = f", {self.refused} without a derivative" if self.refused else ""
        return f"Minimum {self.cost:.9g}", {
            "at": values(self.values, self.values.values()),
            "constraints": margins,
            "runs": [f"{self.evaluations}{refused}"],
            "message": [self.message],
            "first without": [str(self.problem)] if self.problem else [],
        }.items()
