"""Measures that run through solve(), point by point: a user's function, a cost, the largest Lyapunov exponent."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import sympy as sp

from ..costs import Quantity
from ..costs.reading import value_of
from ..door import checks
from .contract import Measure, real


@checks.door()
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
    units : mapping of str to str, optional
        Of the variables.

    >>> x, k = sp.symbols("x k", nonnegative=True)
    >>> last = Function(lambda solution: solution["x"][-1], names="last", units={"last": "m"})
    >>> found = sweep(System({x: -k * x}, parameters={k: 1}), {"k": [0.0, 1.0]}, x0={"x": 1}, t_span=(0, 1),
    ...               measures=[last])
    >>> found["last"].values.round(6).tolist()
    [1.0, 0.367879]
    """

    compiled = False
    function: Callable[..., Any]
    names: Any = None
    dense: bool = False
    units: Any = None

    def __post_init__(self) -> None:
        checks.fields(
            self, function=checks.function, dense=checks.flag, units=checks.optional(checks.mapping),
            names=checks.optional(lambda value, what: value if isinstance(value, str) else checks.several(value, what)),
        )  # fmt: skip
        own = getattr(self.function, "__name__", "<lambda>")
        names = self.names or ("value" if own == "<lambda>" else own)
        names = (names,) if isinstance(names, str) else tuple(names)
        for name in names:
            checks.name(name, "`names` of Function")
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


@checks.door()
@dataclass(frozen=True, repr=False)
class Cost(Measure):
    """The variable `<name>`: a cost of the whole run.

    Parameters
    ----------
    name : str
        Of the variable.
    cost : Expr
        Of quantities of a run (`pwsmooth.costs`) and of parameters.
    unit : str
        Of the variable.

    Raises
    ------
    ValueError
        The cost reads nothing of a run.

    Notes
    -----
    Integrals are as exact as the run's dense output.

    >>> x = sp.Symbol("x", real=True)
    >>> k = sp.Symbol("k", positive=True)
    >>> found = sweep(System({x: -k * x}, parameters={k: 1}), {"k": [1.0, 2.0]}, x0={"x": 1}, t_span=(0, 1),
    ...               measures=[Cost("effort", final(x) + k * integral(x))])
    >>> found["effort"].values.round(9).tolist()
    [1.0, 1.0]
    """

    compiled = False
    dense: ClassVar[bool] = True
    name: str
    cost: Any
    unit: str = ""

    def __post_init__(self) -> None:
        checks.fields(self, name=checks.name, cost=checks.expression)
        if not self._found:
            raise ValueError(
                f"`cost` of Cost {self.name!r} reads nothing of the run; write it with quantities of a run (integral, "
                "final, at, ...)."
            )

    @property
    def _found(self) -> list[Quantity]:
        return sorted((q for q in self.cost.free_symbols if isinstance(q, Quantity)), key=str)

    def __repr__(self) -> str:
        # The names of quantities do not tell their data.
        told = repr([(q.kind, sp.srepr(q.expression), q.where) for q in self._found])
        return f"Cost({self.name!r}, {self.cost}, {hashlib.sha256(told.encode()).hexdigest()[:12]})"

    @property
    def outputs(self):
        return {f"{self.name}: {q}": q.expression for q in self._found if q.expression is not None}

    def variables(self, setting):
        return {self.name: real(setting, str(self.cost), self.unit)}

    def of(self, solution, window, setting):
        outputs = {q: f"{self.name}: {q}" for q in self._found}
        return {self.name: value_of(self.cost, self._found, outputs, solution)}


@checks.door()
@dataclass(frozen=True)
class Lyapunov(Measure):
    """The variable `lyapunov`: the largest Lyapunov exponent, averaged over the window, in units of 1/time.

    Source: as `largest_exponent` of `pwsmooth.analysis`.

    >>> x, k = sp.symbols("x k", positive=True)
    >>> found = sweep(System({x: -k * x}, parameters={k: 1}), {"k": [0.5, 1.0]}, x0={"x": 1}, t_span=(0, 20),
    ...               measures=[Lyapunov()])
    >>> found["lyapunov"].values.round(6).tolist()
    [-0.5, -1.0]
    """

    compiled = False
    dense: ClassVar[bool] = True

    def variables(self, setting):
        unit = f"1/{setting.time_unit}" if setting.time_unit else ""
        return {"lyapunov": real(setting, "largest Lyapunov exponent", unit)}

    def of(self, solution, window, setting):
        from ..analysis.lyapunov import largest_exponent

        return {"lyapunov": largest_exponent(solution, after=window.start)}
