"""Costs of a run and their exact gradients, through every event, backward in time.

    cost = integral(x**2) + (final(x) - 2)**2

A cost is an expression of quantities that a run gives (an integral, a value at the end, at a time or at an event, the
time of an event, an extreme, a duration, a misfit of data) and of parameters. Its gradient by many parameters costs a
few runs: slopes are carried back over the tape that the run has written (kernels/tangent/reverse.py).

Chain: System, solve() -> **costs** -> optimisation, fits.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from .definition import checks
from .definition.lambdified import numpy_function
from .derivatives import NoDerivative, Quantities, first_rates, problems, quantities
from .paths.clock import slopes_of_instants
from .paths.tangents import Readings, pull_back
from .results import outputs
from .solve import solve

__all__ = [
    "Gradient", "Objective", "Quantity", "at", "at_event", "duration", "event_time", "final", "integral", "largest",
    "misfit", "smallest", "value_and_gradient",
]  # fmt: skip


_NODES = 33  # at which an expression is looked at on a step, whose polynomial has degree 31 at most


class Quantity(sp.Symbol):
    """A number that a run gives, as a symbol: expressions of such symbols and of parameters are costs.

    The functions of this module make them.

    Parameters
    ----------
    kind : str
        What it is, the name of the function.
    expression : Expr or None
        Of what.
    where : tuple
        Where: times, an event, data.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth.costs import final, integral
    >>> x = sp.Symbol("x", real=True)
    >>> sorted(map(str, (integral(x**2) + final(x)).free_symbols))
    ['final(x)', 'integral(x**2)']
    """

    __slots__ = ("expression", "kind", "where")

    def __new__(cls, kind, expression=None, where=()):
        told = ", ".join(
            str(item)
            for item in ([] if expression is None else [expression]) + [*where]
            if item is not None and not isinstance(item, bytes)
        )
        self = sp.Symbol.__xnew__(cls, f"{kind}({told})", real=True)
        self.kind, self.expression, self.where = kind, expression, where
        return self

    def __getnewargs_ex__(self):
        return (self.kind, self.expression, self.where), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.kind, self.expression, self.where)


def _expression(e: Any) -> sp.Expr:
    return checks.expression(e, "`expression`")


def integral(expression: Any) -> Quantity:
    """The integral of an expression over the span, to the tolerance of the run.

    Parameters
    ----------
    expression : Expr
        Of states, multipliers, parameters and time.

    Returns
    -------
    Quantity
        In the unit of the expression times that of the time.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import integral, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, integral(v), (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 2.0000
    """
    return Quantity("integral", _expression(expression))


def final(expression: Any) -> Quantity:
    """An expression at the end of the span.

    Parameters
    ----------
    expression : Expr
        Of states, multipliers, parameters and time.

    Returns
    -------
    Quantity
        In the unit of the expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import final, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, final(x), (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 2.0000
    """
    return Quantity("final", _expression(expression))


def at(expression: Any, time: float) -> Quantity:
    """An expression at a time, at an event on the side after it.

    Parameters
    ----------
    expression : Expr
        Of states, multipliers, parameters and time.
    time : float, in the unit of the model's time
        When.

    Returns
    -------
    Quantity
        In the unit of the expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import at, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, at(x, 1), (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    3.0000 1.0000
    """
    return Quantity("at", _expression(expression), (checks.number(time, "`time`"),))


def _event(switch: Any, kind: str | None, number: int) -> tuple[str, str | None, int]:
    kind = None if kind is None else checks.name(kind, "`kind`")
    return str(checks.key(switch, "`switch`")), kind, checks.whole(number, "`number`", 0)


def event_time(switch: Any, kind: str | None = None, number: int = 0) -> Quantity:
    """The time of an event.

    Parameters
    ----------
    switch : Switch, Symbol or str
        Switch, contact or event, by its name.
    kind : str, optional
        As of `EventRecord`; any without.
    number : int
        0 for the first of these events.

    Returns
    -------
    Quantity
        In the unit of the model's time.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import event_time, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, event_time("sgn(v)"), (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    2.0000 0.5000
    """
    return Quantity("event_time", None, _event(switch, kind, number))


def at_event(
    expression: Any, switch: Any, kind: str | None = None, number: int = 0, after: bool = False
) -> Quantity:
    """An expression at an event, before or after what happens there.

    Parameters
    ----------
    expression : Expr
        Of states, parameters and time.
    switch : Switch, Symbol or str
        Switch, contact or event, by its name.
    kind : str, optional
        As of `EventRecord`; any without.
    number : int
        0 for the first of these events.
    after : bool
        On the side after it.

    Returns
    -------
    Quantity
        In the unit of the expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import at_event, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, at_event(x, "sgn(v)"), (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 2.0000
    """
    where = (*_event(switch, kind, number), checks.flag(after, "`after`"))
    return Quantity("at_event", _expression(expression), where)


def _window(kind: str, expression: Any, start: float | None, end: float | None) -> Quantity:
    ends = (
        None if t is None else checks.number(t, f"`{name}`") for name, t in (("start", start), ("end", end))
    )
    return Quantity(kind, _expression(expression), tuple(ends))


def largest(expression: Any, start: float | None = None, end: float | None = None) -> Quantity:
    """The largest value of an expression over a window; its slopes are those where it is taken (envelope theorem).

    Parameters
    ----------
    expression : Expr
        Of states, multipliers, parameters and time.
    start, end : float, in the unit of the model's time, optional
        The window; the span without.

    Returns
    -------
    Quantity
        In the unit of the expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import largest, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -x})
    >>> value, slope = value_and_gradient(body, largest(x), (0, 6), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 1.0000
    """
    return _window("largest", expression, start, end)


def smallest(expression: Any, start: float | None = None, end: float | None = None) -> Quantity:
    """The smallest value of an expression over a window, as `largest`.

    Parameters
    ----------
    expression : Expr
        Of states, multipliers, parameters and time.
    start, end : float, in the unit of the model's time, optional
        The window; the span without.

    Returns
    -------
    Quantity
        In the unit of the expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import smallest, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -x})
    >>> value, slope = value_and_gradient(body, smallest(x), (0, 6), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    -4.0000 -1.0000
    """
    return _window("smallest", expression, start, end)


def duration(switch: Any) -> Quantity:
    """How long a switch slides, sticking friction sticks, a contact is closed, over the span.

    Parameters
    ----------
    switch : Switch, Symbol or str
        Switch or contact, by its name.

    Returns
    -------
    Quantity
        In the unit of the model's time.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import duration, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, duration("sgn(v)"), (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    1.0000 -0.5000
    """
    return Quantity("duration", None, (str(checks.key(switch, "`switch`")),))


def misfit(expression: Any, times: Any, values: Any, sigma: Any = 1.0) -> Quantity:
    """The sum of squares of (expression - value)/sigma over data.

    Parameters
    ----------
    expression : Expr
        Of states, multipliers, parameters and time.
    times : array_like, shape (nd,), in the unit of the model's time
        When it was measured, not decreasing.
    values : array_like, shape (nd,), in the unit of the expression
        What was measured; nan where nothing was.
    sigma : float or array_like, shape (nd,), in the unit of the expression
        Its standard error.

    Returns
    -------
    Quantity
        Dimensionless.

    Raises
    ------
    ValueError
        Lengths that differ, times that decrease, an error that is not positive.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import misfit, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> cost = misfit(x, [1, 2], [2.5, 4])
    >>> value, slope = value_and_gradient(body, cost, (0, 3), {x: 0, v: 4}, with_respect_to=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    0.2500 1.0000
    """
    when, measured = checks.array(times, "`times`"), _numbers(values, "`values`")
    errors = _numbers(sigma, "`sigma`")
    if when.ndim != 1 or measured.shape != when.shape or np.any(np.diff(when) < 0):
        raise ValueError(
            f"`times` of shape {when.shape} and `values` of shape {measured.shape}: give two rows of one length, with "
            "times that do not decrease."
        )
    if errors.shape not in ((), when.shape) or not np.all(errors > 0):
        raise ValueError(
            "`sigma` is no row of positive numbers; give the standard error of all values or of each."
        )
    known = ~np.isnan(measured)
    data = np.stack([when[known], measured[known], np.broadcast_to(errors, when.shape)[known]])
    return Quantity("misfit", _expression(expression), (data.tobytes(),))


def _numbers(value: Any, what: str) -> np.ndarray:
    """As `checks.array`, with nan where nothing was measured."""
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{what} is {checks.shown(value)}; give numbers.") from None


class Gradient(NamedTuple):
    """A cost and its slopes.

    Attributes
    ----------
    value : float
        In the unit of the cost.
    gradient : ndarray, shape (k,)
        By the quantities, in the unit of the cost over theirs.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import final, value_and_gradient
    >>> x = sp.Symbol("x", real=True)
    >>> found = value_and_gradient(System({x: -2 * x}), final(x) ** 2, (0, 1), {x: 1}, with_respect_to=["x"])
    >>> print(f"{found.value:.6f} {found.gradient[0]:.6f}")  # exp(-4), twice that
    0.018316 0.036631
    """

    value: float
    gradient: np.ndarray


class Objective:
    """A cost as a function of quantities, with its gradient: ``objective(q)`` gives both, as optimisers take them.

    Parameters
    ----------
    system : System
        Event-driven.
    cost : Expr
        Of quantities of a run (`integral`, `final`, ...) and of parameters.
    t_span : (float, float), in the unit of the model's time
        As of `solve`.
    x0 : mapping of state to float, or sequence of float, length n
        As of `solve`, in the units of the states.
    with_respect_to : sequence of str or Symbol
        As of `solve`: parameters, initial values of states and memories, "t0".
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

    Examples
    --------
    >>> import numpy as np
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import Objective, final, integral
    >>> x = sp.Symbol("x", real=True)
    >>> k = sp.Symbol("k", positive=True)
    >>> decay = System({x: -k * x}, parameters={k: 1})
    >>> objective = Objective(decay, final(x) + integral(x), (0, 1), {x: 1}, [k, "x"])
    >>> value, gradient = objective(objective.start)
    >>> print(f"{value:.6f}", gradient.round(6).tolist())  # 1 for k = 1; by x too
    1.000000 [-0.632121, 1.0]
    """

    def __init__(
        self, system: Any, cost: Any, t_span: Sequence[float], x0: Any, with_respect_to: Sequence[Any], **options: Any
    ) -> None:  # fmt: skip
        checks.system(system, "`system`")
        system = system._written_out()
        if "parameters" in options:
            system = system.with_parameters(options.pop("parameters"))
        cost = checks.expression(cost, "`cost`")
        found = sorted((s for s in cost.free_symbols if isinstance(s, Quantity)), key=str)
        strange = cost.free_symbols - set(found) - set(system.parameters)
        if strange or not found:
            what = (
                f"names {checks.listing(sorted(strange, key=str))}" if strange else "reads nothing of the run"
            )
            raise ValueError(
                f"`cost` {what}; write it with quantities of a run (integral, final, at, ...) and parameters."
            )
        self._span = checks.span(t_span)
        integrated = [q for q in found if q.kind == "integral"]
        integrals = {sp.Symbol(f"integral {k}", real=True): q.expression for k, q in enumerate(integrated)}
        named = {
            f"read {k}": q for k, q in enumerate(found) if q.expression is not None and q not in integrated
        }
        read = {name: q.expression for name, q in named.items()}
        self._wanted: Quantities = quantities(system, with_respect_to)
        self.names = self._wanted.names
        self._plain = system
        self._system = system._extended(integrals, read)
        self._names = {q: name for name, q in named.items()}
        self._integrals = {q: s.name for s, q in zip(integrals, integrated)}
        self._found, self._options = found, options
        model = self._system.model
        places = {p.name: i for i, p in enumerate(model.parameters)}
        states = {s.name: i for i, s in enumerate(model.states)}
        self._integral_places = {q: states[name] for q, name in self._integrals.items()}
        # Of each quantity its place among the parameters, or the states of the model; none of the start time.
        self._places = [
            places[name] if p is not None else states.get(name)
            for name, p in zip(self.names, self._wanted.parameters)
        ]
        used = sorted(cost.free_symbols - set(found), key=str)
        self._used = np.array([places[s.name] for s in used], int)
        arguments = (*found, *used)
        self._cost = numpy_function(arguments, sp.Tuple(cost, *(cost.diff(s) for s in arguments)), cse=True)
        start = system.initial_state(x0, self._span[0])
        self._x0 = dict(zip(map(str, system.states), start))
        values = {s.name: value for s, value in system.parameters.items()}
        self.start = np.array(
            [
                values[name] if p is not None else self._span[0] if state is None else self._x0[name]
                for name, p, state in zip(self.names, self._wanted.parameters, self._wanted.states)
            ]
        )
        self._values = values

    def solve(self, q: Any) -> Any:
        """The run at these values of the quantities.

        Parameters
        ----------
        q : array_like, shape (k,)
            Values of the quantities, in their units.

        Returns
        -------
        Solution
            Of the system with the integrals of the cost as states behind its own.

        Raises
        ------
        ValueError
            Another number of values.
        """
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
        t0 = self._span[0] if self._wanted.start_time is None else values["t0"]
        return solve(
            self._system, (t0, self._span[1]), x0 | dict.fromkeys(self._integrals.values(), 0.0),
            parameters=parameters, with_respect_to=self.names, dense_output=True,
            **self._options,
        )  # fmt: skip

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
        run = self.solve(q)
        return _Reader(self, run).result()


class _Reader:
    """What a cost reads of one run, and with which slopes."""

    def __init__(self, objective: Objective, run: Any) -> None:
        if not run.success:
            raise NoDerivative(float(run.t[-1]), "", f"the run ends there: {run.message}")
        self.objective, self.run, self.model = objective, run, run.model
        self.n, self.m = len(run.x), len(run.mult)
        self.end = np.zeros(self.n + self.m)
        self.times: list[np.ndarray] = []
        self.slopes: list[np.ndarray] = []
        self.instants: dict[int, np.ndarray] = {}
        self.by_parameter = np.zeros(len(self.model.parameters))
        self.p = run.tape.p
        self.meets = run.tape.instants()

    def result(self) -> Gradient:
        objective, run = self.objective, self.run
        readers = [getattr(self, f"_{q.kind}")(q) for q in objective._found]
        numbers = [value for value, _ in readers]
        cost, *slopes = objective._cost(*numbers, *self.p[objective._used])
        for (_, add), slope in zip(readers, slopes):
            if slope != 0.0:
                add(float(slope))
        self.by_parameter[objective._used] += slopes[len(readers) :]
        found = self._pulled()
        gradient = np.zeros(len(objective.names))
        tape, given = run.tape, dict(zip(self.model.parameters, self.p))
        for k, (place, p) in enumerate(zip(objective._places, objective._wanted.parameters)):
            if p is not None:
                gradient[k] = found.parameters[place] + self.by_parameter[place]
                if len(tape.clock):
                    moved = slopes_of_instants(self.model, given, tape.clock, tape.clock_event, p)
                    gradient[k] += moved @ found.clock
            elif place is not None:
                gradient[k] = found.start[place]
            else:
                gradient[k] = -found.start @ first_rates(self.model, run.tape)
        return Gradient(float(cost), gradient)

    def _pulled(self) -> Any:
        times = np.concatenate([np.empty(0), *self.times])
        slopes = np.concatenate([np.empty((0, self.n + self.m)), *self.slopes])
        order = np.argsort(times, kind="stable")
        entries = np.array(sorted(self.instants), np.int64)
        at_instants = np.array([self.instants[k] for k in entries.tolist()]).reshape(-1, 2 * self.n + 1)
        # The end is a time like the others; multipliers deviate with the states there.
        times, slopes = np.append(times[order], self.run.t[-1]), np.vstack([slopes[order], self.end])
        readings = Readings(np.zeros(self.n), times, slopes, entries, at_instants)
        found = pull_back(self.model, self.run.tape, readings)
        objective = self.objective
        off = {
            name: found.off[place if p is None else self.n + place]
            for name, place, p in zip(objective.names, objective._places, objective._wanted.parameters)
            if place is not None
        }
        for problem in problems(self.run, [found.why] if found.why else [], off):
            raise problem
        return found

    # ---- expressions at points ---------------------------------------------------------------------

    def _evaluated(
        self, quantity: Quantity, t: np.ndarray, x: np.ndarray, mult: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values of the expression at points, and its slopes (states, multipliers, parameters, time; points)."""
        expression = self.run._expressions[self.objective._names[quantity]]
        made, rows = _with_slopes(self.model, expression)
        found = np.zeros((self.n + self.m + len(self.p) + 2, len(t)))
        for row, values in zip(rows, made(t, *x, *mult, *self.p)):
            found[row] = values
        return found[0], found[1:]

    def _read(self, quantity: Quantity, t: np.ndarray) -> tuple[np.ndarray, Any]:
        """Values at times, and what adds given slopes by these values to those of the cost."""
        x, mult = self.run.dense(t)
        last = t == self.run.t[-1]
        x[:, last], mult[:, last] = self.run.x[:, -1:], self.run.mult[:, -1:]
        values, slopes = self._evaluated(quantity, t, x, mult)
        inner = self.n + self.m

        def add(by_value: np.ndarray) -> None:
            self.times.append(t)
            self.slopes.append((slopes[:inner] * by_value).T)
            self.by_parameter += slopes[inner:-1] @ by_value

        return values, add

    # ---- kinds -------------------------------------------------------------------------------------

    def _integral(self, quantity: Quantity) -> tuple[float, Any]:
        i = self.objective._integral_places[quantity]

        def add(slope: float) -> None:
            self.end[i] += slope

        return float(self.run.x[i, -1]), add

    def _final(self, quantity: Quantity) -> tuple[float, Any]:
        return self._single(quantity, float(self.run.t[-1]))

    def _at(self, quantity: Quantity) -> tuple[float, Any]:
        (t,) = quantity.where
        if not self.run.t[0] <= t <= self.run.t[-1]:
            raise ValueError(f"`time` of {quantity} is outside the span.")
        return self._single(quantity, t)

    def _single(self, quantity: Quantity, t: float) -> tuple[float, Any]:
        values, add = self._read(quantity, np.array([t]))
        return float(values[0]), lambda slope: add(np.array([slope]))

    def _misfit(self, quantity: Quantity) -> tuple[float, Any]:
        t, measured, sigma = np.frombuffer(quantity.where[0]).reshape(3, -1)
        values, add = self._read(quantity, t.copy())
        off = (values - measured) / sigma
        return float(off @ off), lambda slope: add(2.0 * slope * off / sigma)

    def _entry(self, time: float) -> int:
        """The entry of the tape at which an event's instant begins."""
        k = self.meets[np.abs(self.run.tape.values[self.meets, 0] - time).argmin()]
        return int(k)

    def _time(self, quantity: Quantity) -> float:
        switch, kind, number, *_ = quantity.where
        times = self.run.event_times(kind, switch)
        if number >= len(times):
            raise NoDerivative(
                float(self.run.t[-1]), switch, f"{quantity} asks for an event that does not happen"
            )
        return float(times[number])

    def _instant(self, time: float, before: Any = 0.0, after: Any = 0.0, shift: float = 0.0) -> None:
        row = self.instants.setdefault(self._entry(time), np.zeros(2 * self.n + 1))
        row[: self.n] += before
        row[self.n : -1] += after
        row[-1] += shift

    def _event_time(self, quantity: Quantity) -> tuple[float, Any]:
        time = self._time(quantity)
        return time, lambda slope: self._instant(time, shift=slope)

    def _at_event(self, quantity: Quantity) -> tuple[float, Any]:
        time, after = self._time(quantity), quantity.where[-1]
        column = (
            np.searchsorted(self.run.t, time, side="right") - 1 if after else np.searchsorted(self.run.t, time)
        )
        return self._at_instant(quantity, time, int(column), after)

    def _at_instant(self, quantity: Quantity, time: float, column: int, after: bool) -> tuple[float, Any]:
        x, mult = self.run.x[:, column : column + 1], self.run.mult[:, column : column + 1]
        values, slopes = self._evaluated(quantity, np.array([time]), x, mult)
        n, inner = self.n, self.n + self.m
        if np.any(slopes[n:inner]):
            raise ValueError(f"{quantity} reads a multiplier at an event; ask for it at a time.")

        def add(slope: float) -> None:
            by_state = slope * slopes[:n, 0]
            self._instant(time, *((0.0, by_state) if after else (by_state, 0.0)), slope * slopes[-1, 0])
            self.by_parameter += slope * slopes[inner:-1, 0]

        return float(values[0]), add

    def _duration(self, quantity: Quantity) -> tuple[float, Any]:
        run = self.run
        (switch,) = quantity.where
        if switch not in run.multipliers:
            raise ValueError(
                f"{quantity}: the system has no switch of that name; it has {', '.join(run.multipliers)}."
            )
        j = run.multipliers.index(switch)
        pieces = [(s.start, s.end) for s in run.segments if s.status[j] == 0]
        ends = [(t, sign) for piece in pieces for t, sign in zip(piece, (-1.0, 1.0))]

        def add(slope: float) -> None:
            for t, sign in ends:
                if run.t[0] < t < run.t[-1]:
                    self._instant(t, shift=sign * slope)

        return sum(sign * t for t, sign in ends), add

    def _largest(self, quantity: Quantity, sign: float = 1.0) -> tuple[float, Any]:
        begin, end = quantity.where
        begin, end = (self.run.t[0] if begin is None else begin), (self.run.t[-1] if end is None else end)
        if not self.run.t[0] <= begin < end <= self.run.t[-1]:
            raise ValueError(f"The window of {quantity} is not within the span.")

        def value(t: np.ndarray) -> np.ndarray:
            return sign * self._read(quantity, t)[0]

        time = _highest(value, self.run, begin, end)
        events = np.unique(self.run.event_times())
        if begin < time < end and np.any(np.abs(events - time) <= 1e-13 * abs(end)):
            columns = np.flatnonzero(np.abs(self.run.t - time) <= 1e-13 * abs(end))
            tried = [self._at_instant(quantity, time, int(c), c == columns[-1]) for c in columns[[0, -1]]]
            return max(tried, key=lambda pair: sign * pair[0])
        return self._single(quantity, time)

    def _smallest(self, quantity: Quantity) -> tuple[float, Any]:
        return self._largest(quantity, -1.0)


def _highest(value: Any, run: Any, begin: float, end: float) -> float:
    """Where a function of time is largest: at an end of a step, or where its interpolant within one is stationary."""
    ends = np.unique(np.concatenate([[begin], run.t[(run.t > begin) & (run.t < end)], [end]]))
    nodes = np.polynomial.chebyshev.chebpts2(_NODES)
    low, high = ends[:-1, None], ends[1:, None]
    times = 0.5 * (low + high) + 0.5 * (high - low) * nodes
    heights = value(times.ravel()).reshape(times.shape)
    piece, k = np.unravel_index(int(heights.argmax()), heights.shape)
    best = float(times[piece, k])
    # Once more between its neighbours: a maximum's time is known to half the digits of its height, but to nearly all of
    # those of the slope.
    a, b = times[piece, max(k - 1, 0)], times[piece, min(k + 1, _NODES - 1)]
    fit = np.polynomial.Chebyshev.interpolate(
        lambda t: value(np.asarray(t)), _NODES // 2, domain=[float(a), float(b)]
    )
    roots = fit.deriv().roots()
    roots = roots[(np.abs(roots.imag) < 1e-9) & (a < roots.real) & (roots.real < b)].real
    return max([best, *roots.tolist()], key=lambda t: float(fit(t)))


@functools.lru_cache(maxsize=256)
def _with_slopes(model: Any, expression: sp.Basic) -> tuple[Any, list[int]]:
    """A numpy function of (t, *x, *mult, *p): an expression, and its slopes by the symbols that stand in it; and their
    rows where 0 is the expression, and states, multipliers, parameters and time follow."""
    symbols = (*model.states, *(mu.symbol for mu in model.multipliers), *model.parameters, model.time)
    rows = [k for k, s in enumerate(symbols) if s in expression.free_symbols]
    slopes = [expression.diff(symbols[k]) for k in rows]
    return outputs.vectorised(model, sp.Tuple(expression, *slopes)), [0, *(k + 1 for k in rows)]


def value_and_gradient(
    system: Any, cost: Any, t_span: Sequence[float], x0: Mapping[Any, float] | Sequence[float], *,
    with_respect_to: Sequence[Any], **options: Any,
) -> Gradient:  # fmt: skip
    """A cost of a run and its gradient, exact through every event: one run and one way back, by any number of names.

    Parameters
    ----------
    system : System
        Event-driven.
    cost : Expr
        Of quantities of a run (`integral`, `final`, `at`, `event_time`, ...) and of parameters.
    t_span : (float, float), in the unit of the model's time
        As of `solve`.
    x0 : mapping of state to float, or sequence of float, length n
        As of `solve`, in the units of the states.
    with_respect_to : sequence of str or Symbol
        As of `solve`: parameters, initial values of states and memories, "t0".
    **options
        Of `solve`.

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

    Notes
    -----
    Source: the adjoint of the saltation matrices, di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical
    Systems, 2008.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import event_time, value_and_gradient
    >>> x, v = sp.symbols("x v", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    >>> stop = event_time("sgn(v)", "stick")
    >>> value, gradient = value_and_gradient(body, stop, (0, 3), {x: 0, v: 4}, with_respect_to=[mu, "v"])
    >>> print(f"{value:.6f}", gradient.round(6).tolist())  # v/mu
    2.000000 [-1.0, 0.5]
    """
    objective = Objective(system, cost, t_span, x0, with_respect_to, **options)
    return objective(objective.start)
