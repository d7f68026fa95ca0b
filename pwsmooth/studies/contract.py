"""The contract of measures: what one is asked for, and what it may know of the sweep.

Measures that the compiled ensemble knows (kernels/sweeping) are gathered from it; `of` computes the same from a
Solution, for paths that solve point by point and as an independent check.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..door import checks
from ..door.documenting import complete
from ..results.solution import Solution, _is_slip_velocity

NOT_RUN = -128  # outcome of a point that has not run


@complete
class Window(NamedTuple):
    """The part of an orbit that is measured, and the times at which it is strobed.

    Attributes
    ----------
    times : ndarray, shape (periods + 1,), in the unit of the model's time
        After every period of the drive, or of the returns to the section; without either the two ends.
    strobed : bool
        Whether there is a drive or a section.

    >>> window = Window(np.array([10.0, 12.0, 14.0]), strobed=True)
    >>> window.start, window.end, window.periods
    (10.0, 14.0, 2)
    """

    times: np.ndarray
    strobed: bool

    @property
    def start(self) -> float:
        """Where it begins, in the unit of the model's time."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Where it ends, in the unit of the model's time."""
        return float(self.times[-1])

    @property
    def periods(self) -> int:
        """Periods or returns in it; without a drive or a section one, as long as the window."""
        return len(self.times) - 1


class Variable(NamedTuple):
    """A variable of the Dataset: dimensions beyond the sweep's own, with their coordinates, and what it is."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: Any
    fill: Any
    attrs: dict[str, str]


@checks.door()
@dataclass(frozen=True)
class Measure:
    """Base of all measures; one of one's own defines `variables` and `of`.

    The class attribute `compiled` says whether the compiled ensemble knows it (`gather`), `bits` which numbers of its
    quantities the ensemble has to keep (1 extremes, 2 integrals).

    The time at which an orbit first crosses a surface, of every point of a sweep:

    >>> from dataclasses import dataclass
    >>> from pwsmooth.studies.contract import real
    >>> @dataclass(frozen=True)
    ... class FirstCrossing(Measure):
    ...     compiled = False
    ...
    ...     def variables(self, setting):
    ...         return {"first": real(setting, "time of the first crossing", setting.time_unit)}
    ...
    ...     def of(self, solution, window, setting):
    ...         return {"first": float(solution.event_times("crossing")[0])}
    >>> x, c = sp.symbols("x c", real=True)
    >>> ramp = System({x: c + sp.Heaviside(x)}, parameters={c: 1})
    >>> found = sweep(ramp, {"c": [0.5, 1.0]}, x0={"x": -1}, t_span=(0, 3), measures=[FirstCrossing()])
    >>> found["first"].values.round(12).tolist()
    [2.0, 1.0]
    """

    compiled: ClassVar[bool] = True
    bits: ClassVar[int] = 0

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of states, multipliers or outputs whose numbers the ensemble has to keep."""
        return ()

    @property
    def outputs(self) -> dict[str, Any]:
        """Outputs that it needs beside the system's own: name -> expression of states, parameters and the like."""
        return {}

    def variables(self, setting: Any) -> dict[str, Variable]:
        """The variables of the Dataset that it fills.

        Returns
        -------
        dict of str to Variable
            Name -> dimensions, type, fill value, attributes.
        """
        raise NotImplementedError

    def gather(self, orbits: Any, setting: Any) -> dict[str, np.ndarray]:
        """Its values for a chunk, from the compiled ensemble's arrays.

        Parameters
        ----------
        orbits : Orbits
            The ensemble's arrays, one row a point.

        Returns
        -------
        dict of str to ndarray
            Name -> values, first axis the points of the chunk, shape (nc, ...), in the units of the variables.
        """
        raise NotImplementedError

    def of(self, solution: Solution, window: Window, setting: Any) -> dict[str, Any]:
        """Its values for one Solution.

        Parameters
        ----------
        solution : Solution
            Of one point.
        window : Window
            What is measured of it.

        Returns
        -------
        dict of str to value
            Name -> number, word or array.
        """
        raise NotImplementedError


def real(setting, what, unit="", dims=(), shape=()):
    return Variable(dims, shape, np.float64, np.nan, {"long_name": what, **({"units": unit} if unit else {})})


def integer(dtype, what):
    return Variable((), (), dtype, -1, {"long_name": what, "units": "1"})


@dataclass(frozen=True)
class Setting:
    """What measures ask about the sweep: names, letters, units, the window's periods."""

    states: tuple[str, ...]
    switches: tuple[str, ...]  # of the columns below
    switch_columns: tuple[int, ...]  # multipliers that stick: switches and contacts
    word_columns: tuple[int, ...]
    alphabets: tuple[dict[int, str], ...]
    quantities: tuple[str, ...]
    bits: tuple[int, ...]
    periods: int
    strobed_by: str  # "period" of the drive, "return" to the section, or ""
    period_detector: Any  # the measure Period that decides for the itinerary too
    units: tuple[tuple[str, str], ...]
    time: str

    @property
    def switch_dims(self) -> tuple[tuple[str, ...], tuple[int, ...]]:
        """Dimension of a number per switch; none of a system with one."""
        return (("switch",), (len(self.switches),)) if len(self.switches) != 1 else ((), ())

    def unit(self, name: str) -> str:
        return dict(self.units).get(name, "")

    @property
    def time_unit(self) -> str:
        return self.unit(self.time)


def alphabet(model: Any, j: int) -> dict[int, str]:
    """Letters of multiplier j by status."""
    if model.multipliers[j].kind == "contact":
        return {0: "c", 1: "o", -1: "o"}
    if _is_slip_velocity(model, j):
        return {0: "S", 1: "R", -1: "L"}
    return {0: "0", 1: "+", -1: "-"}
