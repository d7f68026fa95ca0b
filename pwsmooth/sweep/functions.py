"""Measures that run through solve(), point by point: a user's function, the largest Lyapunov exponent."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .contract import Measure, real


@dataclass(frozen=True)
class Function(Measure):
    """A user's function of the Solution.

    Parameters
    ----------
    function : callable
        function(solution) or function(solution, window) -> float, or a mapping with a float for each of `names`.
        To run in other processes it must be importable there. What it raises is recorded as the point's outcome.
    names : str or sequence of str, optional
        Of the variables; the function's own name by default, "value" if it has none.
    dense : bool
        Whether it needs values between steps.
    units : mapping, optional
    """

    compiled = False
    function: Callable[..., Any]
    names: Any = None
    dense: bool = False
    units: Any = None

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(f"Function needs a callable, not {self.function!r}.")
        own = getattr(self.function, "__name__", "<lambda>")
        names = self.names or ("value" if own == "<lambda>" else own)
        names = (names,) if isinstance(names, str) else tuple(names)
        object.__setattr__(self, "names", tuple(re.sub(r"\W", "_", name) for name in names))
        object.__setattr__(self, "units", tuple(sorted(dict(self.units or {}).items())))

    def variables(self, setting):
        units = dict(self.units)
        return {name: real(setting, name, units.get(name, "")) for name in self.names}

    def of(self, solution, window, setting):
        import inspect

        try:
            wants_window = len(inspect.signature(self.function).parameters) > 1
        except (TypeError, ValueError):
            wants_window = False
        value = self.function(solution, window) if wants_window else self.function(solution)
        if isinstance(value, Mapping):
            return {name: float(value[name]) for name in self.names}
        values = np.ravel(np.asarray(value, float))
        if len(values) != len(self.names):
            raise ValueError(
                f"the function {getattr(self.function, '__name__', self.function)!r} returned {len(values)} numbers "
                f"for {len(self.names)} names ({', '.join(self.names)}); give `names` one for each."
            )
        return dict(zip(self.names, values.tolist()))


@dataclass(frozen=True)
class Lyapunov(Measure):
    """`lyapunov`: the largest Lyapunov exponent, averaged over the window (analysis/lyapunov.py)."""

    compiled = False
    dense: ClassVar[bool] = True

    def variables(self, setting):
        unit = f"1/{setting.time_unit}" if setting.time_unit else ""
        return {"lyapunov": real(setting, "largest Lyapunov exponent", unit)}

    def of(self, solution, window, setting):
        from ..analysis.lyapunov import largest_exponent

        return {"lyapunov": largest_exponent(solution, after=window.start)}
