"""The contract of measures: what one is asked for, and what it may know of the sweep.

Measures that the compiled ensemble knows (kernels/ensemble.py) are gathered from it; `of` computes the same from a
Solution, for paths that solve point by point and as an independent check.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..solution import Solution, _is_slip_velocity


class Window(NamedTuple):
    """The part of an orbit that is measured: from `start` to `end`, strobed every `period`.

    `periods` is their number; a sweep without a drive has one, as long as the window.
    """

    start: float
    end: float
    period: float
    periods: int
    forced: bool


class Variable(NamedTuple):
    """A variable of the Dataset: dimensions beyond the sweep's own, with their coordinates, and what it is."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: Any
    fill: Any
    attrs: dict[str, str]


@dataclass(frozen=True)
class Measure:
    """Base of all measures.

    `quantities` names states, multipliers or outputs; `bits` says which of their numbers the ensemble has to keep
    (1 extremes, 2 integrals).
    """

    compiled: ClassVar[bool] = True
    bits: ClassVar[int] = 0

    @property
    def quantities(self) -> tuple[str, ...]:
        return ()

    def variables(self, setting: Any) -> dict[str, Variable]:
        """Name -> Variable; `setting` is the Setting of the sweep (plan.py)."""
        raise NotImplementedError

    def gather(self, orbits: Any, setting: Any) -> dict[str, np.ndarray]:
        """Name -> values of a chunk from the compiled ensemble's arrays."""
        raise NotImplementedError

    def of(self, solution: Solution, window: Window, setting: Any) -> dict[str, Any]:
        """Name -> value of one Solution."""
        raise NotImplementedError


def real(setting, what, unit="", dims=(), shape=()):
    return Variable(dims, shape, np.float64, np.nan, {"long_name": what, **({"units": unit} if unit else {})})


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
    forced: bool
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


@dataclass(frozen=True)
class OfQuantities(Measure):
    names: tuple[str, ...]

    def __init__(self, *names: Any) -> None:
        if not names:
            raise ValueError(f"{type(self).__name__} needs the name of a state, multiplier or output.")
        object.__setattr__(self, "names", tuple(str(name) for name in names))

    @property
    def quantities(self):
        return self.names


def alphabet(model: Any, j: int) -> dict[int, str]:
    """Letters of multiplier j by status."""
    if model.multipliers[j].kind == "contact":
        return {0: "c", 1: "o", -1: "o"}
    if _is_slip_velocity(model, j):
        return {0: "S", 1: "R", -1: "L"}
    return {0: "0", 1: "+", -1: "-"}
