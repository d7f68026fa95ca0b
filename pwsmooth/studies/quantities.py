"""Measures of named quantities: numbers of a state, multiplier or output over the window.

Chain: contract.py, of_solution.py -> **quantities** -> measures.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..door import checks
from .contract import Measure, real
from .of_solution import moments, range_of


@dataclass(frozen=True)
class OfQuantities(Measure):
    """Base of measures of named quantities: one variable `<name>_<part>` for each name and part."""

    parts: ClassVar[dict[str, str]] = {}  # suffix of a variable -> what it is
    _gathered: ClassVar[Any]  # (orbits, column of a quantity in the ensemble's arrays) -> its parts
    _measured: ClassVar[Any]  # (solution, name of a quantity, window) -> its parts
    names: tuple[str, ...]

    def __init__(self, *names: Any) -> None:
        for name in names:
            checks.key(name, f"`names` of {type(self).__name__}")
        if not names:
            raise ValueError(f"{type(self).__name__} needs the name of a state, multiplier or output.")
        object.__setattr__(self, "names", tuple(str(name) for name in names))

    @property
    def quantities(self):
        return self.names

    def variables(self, setting):
        return {
            f"{name}_{part}": real(setting, f"{words} of {name}", setting.unit(name))
            for name in self.names
            for part, words in self.parts.items()
        }

    def gather(self, orbits, setting):
        with np.errstate(all="ignore"):  # an orbit that never reached its window has inf - inf, and no time
            return self._named(lambda name: self._gathered(orbits, setting.quantities.index(name)))

    def of(self, solution, window, setting):
        return self._named(lambda name: self._measured(solution, name, window))

    def _named(self, values):
        return {f"{name}_{part}": value for name in self.names for part, value in zip(self.parts, values(name))}


@checks.door()
class Extremes(OfQuantities):
    """The variables `<name>_min` and `<name>_max`, over the window and between steps too.

    >>> import math
    >>> x, v = sp.symbols("x v", real=True)
    >>> found = sweep(System({x: v, v: -x}), {"x": [1.0, 2.0]}, x0={"v": 0}, t_span=(0, 10),
    ...               measures=[Extremes("x")])
    >>> found["x_max"].values.round(6).tolist()
    [1.0, 2.0]
    """

    bits = 1
    parts = {"min": "minimum", "max": "maximum"}

    def _gathered(self, orbits, column):
        return [np.where(orbits.ok, end[:, column], np.nan) for end in (orbits.low, orbits.high)]

    _measured = staticmethod(range_of)


@checks.door()
class Amplitude(OfQuantities):
    """The variable `<name>_amplitude`: half the distance from minimum to maximum over the window.

    >>> x, v = sp.symbols("x v", real=True)
    >>> found = sweep(System({x: v, v: 1 - x}), {"x": [1.5, 2.0]}, x0={"v": 0}, t_span=(0, 10),
    ...               measures=[Amplitude("x")])
    >>> found["x_amplitude"].values.round(6).tolist()
    [0.5, 1.0]
    """

    bits = 1
    parts = {"amplitude": "amplitude"}

    def _gathered(self, orbits, column):
        return [np.where(orbits.ok, 0.5 * (orbits.high[:, column] - orbits.low[:, column]), np.nan)]

    def _measured(self, solution, name, window):
        low, high = range_of(solution, name, window)
        return [0.5 * (high - low)]


@checks.door()
class Statistics(OfQuantities):
    """The variables `<name>_mean` and `<name>_rms`: time averages over the window.

    Parameters
    ----------
    *names : str or Symbol
        States, multipliers or outputs (forces).

    >>> x, v = sp.symbols("x v", real=True)
    >>> found = sweep(System({x: v, v: -x}), {"x": [1.0, 2.0]}, x0={"v": 0}, t_span=(0, 4 * math.pi),
    ...               measures=[Statistics("x")])
    >>> found["x_rms"].values.round(6).tolist()  # x/sqrt(2)
    [0.707107, 1.414214]
    """

    bits = 2
    parts = {"mean": "time average", "rms": "root mean square"}

    def _gathered(self, orbits, column):
        span = np.where(orbits.ok, orbits.reached - orbits.window[:, 0], np.nan)
        return [orbits.first[:, column] / span, np.sqrt(orbits.second[:, column] / span)]

    _measured = staticmethod(moments)
