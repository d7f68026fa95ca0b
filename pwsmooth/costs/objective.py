"""Costs as functions of quantities: value and gradient."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..definition.lambdified import numpy_function
from ..door import calls, checks
from ..paths.budget import MOST_STEPS, opened
from ..paths.call import Scratch
from ..paths.derivatives.quantities import Quantities, quantities
from ..paths.event_driven import Checkpoint, EventDriven
from ..solving import solve, taped_run
from .quantities import Quantity
from .reading import Asked, Gradient, Parts, gradients, read

# Bytes that the steps of a run may take; a longer one is gone through in parts, each run again on the way back.
_MOST = 2**26
_KEPT = 8  # objectives whose lowered form a system keeps
_INSIDE = "at", "misfit", "largest", "smallest"  # what is looked for between the ends of steps


@checks.door()
class Objective:
    """A cost as a function of quantities, with its gradient: ``objective(q)`` gives both, as optimisers take them.

    Parameters
    ----------
    cost : Expr
        Of quantities of a run (`integral`, `final`, ...) and of parameters.
    **options
        Of `solve`: `rtol`, `atol`, `max_step`, `max_steps`, `max_seconds`, `order`, `parameters`.

    Attributes
    ----------
    names : tuple of str
        The quantities.
    start : ndarray, shape (k,)
        Their values in the system and in `x0`, in their units.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.

    >>> import numpy as np
    >>> x = sp.Symbol("x", real=True)
    >>> k = sp.Symbol("k", positive=True)
    >>> decay = System({x: -k * x}, parameters={k: 1})
    >>> objective = Objective(decay, final(x) + integral(x), (0, 1), {x: 1}, [k, "x"])
    >>> value, gradient = objective(objective.start)
    >>> print(f"{value:.6f}", gradient.round(6).tolist())  # 1 for k = 1; by x too
    1.000000 [-0.632121, 1.0]
    """

    @checks.door((*calls.RUNS, "noise", "parameters"))
    def __init__(
        self, system: Any, cost: Any, t_span: Sequence[float], x0: Any, by: Sequence[Any], **options: Any
    ) -> None:  # fmt: skip
        self._prepare(system, {"`cost`": cost}, t_span, x0, by, options)

    @classmethod
    def _of_several(
        cls, system: Any, costs: Mapping[str, Any], t_span: Sequence[float], x0: Any, by: Sequence[Any],
        **options: Any,
    ) -> Objective:  # fmt: skip
        """Of costs that share a run, by what they are called; `_each` gives them all."""
        self = cls.__new__(cls)
        self._prepare(system, costs, t_span, x0, by, options)
        return self

    def _prepare(
        self, system: Any, costs: Mapping[str, Any], t_span: Any, x0: Any, by: Any, options: dict[str, Any]
    ) -> None:  # fmt: skip
        checks.system(system, "`system`")
        kept = system._cache.setdefault("objectives", Scratch())
        system = system._written_out()
        if "parameters" in options:
            system = system.with_parameters(options.pop("parameters"))
        costs = {what: checks.expression(cost, what) for what, cost in costs.items()}
        self._span = checks.span(t_span)
        wanted = quantities(system, by)
        key = *costs.items(), wanted
        if key not in kept:
            if len(kept) == _KEPT:
                kept.pop(next(iter(kept)))
            kept[key] = _lowered(system, costs, wanted)
        values = {s.name: value for s, value in system.parameters.items()}
        self.names, (extended, self._asked) = wanted.names, kept[key]
        self._system, self._options = extended.with_parameters(values), options
        start = system.initial_state(x0, self._span[0])
        self._x0 = dict(zip(map(str, system.states), start))
        self._x0 |= {str(q): 0.0 for q in self._asked.integrals}
        self.start = np.array(
            [
                values[name] if p is not None else self._span[0] if state is None else self._x0[name]
                for name, p, state in zip(wanted.names, wanted.parameters, wanted.states)
            ]
        )
        self._values = values

    def solve(self, q: Any) -> Any:
        """The run at these values of the quantities.

        Returns
        -------
        Solution
            Of the system with the integrals of the cost, up to each time, as states behind its own:
            ``solution["integral(x**2)"]``.

        Raises
        ------
        ValueError
            Another number of values.
        """
        parameters, span, x0 = self._given(q)
        return solve(
            self._system, span, x0, parameters=parameters, by=self.names, dense_output=True,
            **self._options,
        )  # fmt: skip

    def _given(self, q: Any) -> tuple[dict[str, float], tuple[float, float], dict[str, float]]:
        """Parameters, span and start of the run at these values."""
        q = checks.array(q, "`q`")
        if q.shape != self.start.shape:
            raise ValueError(
                f"`q` has shape {q.shape}; give {len(self.start)} values, of {', '.join(self.names)}."
            )
        values = dict(zip(self.names, q.tolist()))
        parameters = {name: values[name] for name in self._values if name in values}
        x0 = {
            name: values.get(name, value) if name not in parameters else value
            for name, value in self._x0.items()
        }
        t0 = self._span[0] if self._asked.by.start_time is None else values["t0"]
        for quantity in self._asked.found:
            if len(t := quantity.times) and not (t0 <= t.min() and t.max() <= self._span[1]):
                raise ValueError(
                    f"{quantity} asks for times from {t.min():g} to {t.max():g}, outside the span ({t0:g}, "
                    f"{self._span[1]:g})."
                )
        return parameters, (t0, self._span[1]), x0

    def __call__(self, q: Any) -> Gradient:
        """The cost and its gradient.

        Parameters
        ----------
        q : array_like, shape (k,)
            Values of the quantities, in their units.

        Returns
        -------
        Gradient
            (value, gradient).

        Raises
        ------
        NoDerivative
            The run stops, reads an event that does not happen, or meets an instant at which it has no derivative.
        """
        return self._each(q)[0]

    def value(self, q: Any) -> float:
        """The cost alone; it exists where the gradient does not.

        Returns
        -------
        float
            In the unit of the cost.

        Raises
        ------
        NoDerivative
            The run stops, or reads an event that does not happen.
        """
        found, reader = read(self._asked, self._parts(q))
        return float(self._asked.costs[0](*found.numbers(reader), *reader.p[self._asked.used])[0])

    def _each(self, q: Any) -> list[Gradient]:
        """Of every cost value and gradient, from one run and one way back each."""
        return gradients(self._asked, self._parts(q))

    def _parts(self, q: Any) -> Parts:
        """The run, in parts where it is long."""
        inside = any(quantity.kind in _INSIDE for quantity in self._asked.found)
        ready = taped_run(self._system, self._options, dense=inside)
        if ready is None or not ready.by_series:
            return _Whole(self.solve(q))
        parameters, span, x0 = self._given(q)
        system = self._system.with_parameters(parameters)
        return _Cut(ready, system, checks.span(span), x0, self._options)


def _lowered(system: Any, costs: Mapping[str, Any], wanted: Quantities) -> tuple[Any, Asked]:
    """The system with what the costs read of a run, and how they read it."""
    symbols = set().union(*(cost.free_symbols for cost in costs.values()))
    found = sorted((s for s in symbols if isinstance(s, Quantity)), key=str)
    for what, cost in costs.items():
        strange = cost.free_symbols - set(found) - set(system.parameters)
        if strange or not found:
            why = f"names {checks.listing(sorted(strange, key=str))}" if strange else "reads nothing of the run"
            raise ValueError(
                f"{what} {why}; write it with quantities of a run (integral, final, at, ...) and parameters."
            )
    integrated = [q for q in found if q.kind == "integral"]
    integrals = {sp.Symbol(str(q), real=True): q.expression for q in integrated}
    named = {f"read {k}": q for k, q in enumerate(found) if q.expression is not None and q not in integrated}
    extended = system._extended(integrals, {name: q.expression for name, q in named.items()})
    model = extended.model
    places = {p.name: i for i, p in enumerate(model.parameters)}
    states = {s.name: i for i, s in enumerate(model.states)}
    used = sorted(symbols - set(found), key=str)
    arguments = (*found, *used)
    return extended, Asked(
        by=wanted,
        places=[
            places[name] if p is not None else states.get(name)
            for name, p in zip(wanted.names, wanted.parameters)
        ],
        found=found,
        outputs={q: name for name, q in named.items()},
        integrals={q: states[s.name] for s, q in zip(integrals, integrated)},
        used=np.array([places[s.name] for s in used], int),
        costs=[
            numpy_function(arguments, sp.Tuple(cost, *(cost.diff(s) for s in arguments)), cse=True)
            for cost in costs.values()
        ],
    )


class _Whole:
    """A run in one part."""

    def __init__(self, run: Any) -> None:
        self.run = run

    def along(self) -> Iterator[Any]:
        yield self.run

    def again(self, k: int) -> Any:
        return self.run


class _Cut:
    """An event-driven run in parts that take `_MOST` bytes at most, and where each began."""

    def __init__(
        self, ready: EventDriven, system: Any, span: tuple[float, float], x0: Any, options: Mapping[str, Any]
    ) -> None:
        self.ready, self.system, self.span, self.x0 = ready, system, span, x0
        self.spending = opened(options.get("max_steps", MOST_STEPS), options.get("max_seconds"))
        self.begun: list[Checkpoint] = []

    def along(self) -> Iterator[Any]:
        begin, end = self.span
        p, start = np.array(self.system.parameter_values, float), self.system.initial_state(self.x0, begin)
        parts = self.ready.parts_of(self.system, p, begin, [end], start, self.spending, _MOST)
        for part, begun in parts:
            self.begun.append(begun)
            yield part

    def again(self, k: int) -> Any:
        return self.ready.again(self.begun[k], self.spending)


@checks.door((*calls.RUNS, "noise", "parameters"))
def value_and_gradient(
    system: Any, cost: Any, t_span: Sequence[float], x0: Mapping[Any, float] | Sequence[float], *,
    by: Sequence[Any], **options: Any,
) -> Gradient:  # fmt: skip
    """A cost of a run and its gradient, exact through every event: one run and one way back, by any number of names.

    Parameters
    ----------
    cost : Expr
        Of quantities of a run (`integral`, `final`, `at`, `event_time`, ...) and of parameters.

    Returns
    -------
    Gradient
        (value, gradient).

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.
    NoDerivative
        The run stops, reads an event that does not happen, or meets an instant at which it has no derivative.

    Source: the adjoint of the saltation matrices, di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical
    Systems, 2008.

    >>> x, v = sp.symbols("x v", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    >>> stop = event_time("sgn(v)", "stick")
    >>> value, gradient = value_and_gradient(body, stop, (0, 3), {x: 0, v: 4}, by=[mu, "v"])
    >>> print(f"{value:.6f}", gradient.round(6).tolist())  # v/mu
    2.000000 [-1.0, 0.5]
    """
    objective = Objective(system, cost, t_span, x0, by, **options)
    return objective(objective.start)
