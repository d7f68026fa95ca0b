"""Quantities of a run as symbols, of which costs are made."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ..door import checks


@checks.door()
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

    @property
    def data(self) -> np.ndarray:
        """Of a misfit its times, values and standard errors."""
        return np.frombuffer(self.where[0]).reshape(3, -1)

    @property
    def times(self) -> np.ndarray:
        """The times, in the unit of the model's time, at which it asks for a run."""
        if self.kind == "misfit":
            return self.data[0]
        windows = self.where if self.kind in ("at", "largest", "smallest") else ()
        return np.array([t for t in windows if t is not None], float)

    def __getnewargs_ex__(self):
        return (self.kind, self.expression, self.where), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.kind, self.expression, self.where)


def _expression(e: Any) -> sp.Expr:
    return checks.expression(e, "`expression`")


@checks.door()
def integral(expression: Any) -> Quantity:
    """The integral of an expression over the span, to the tolerance of the run.

    Returns
    -------
    Quantity
        In the unit of the expression times that of the time.

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, integral(v), (0, 3), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 2.0000
    """
    return Quantity("integral", _expression(expression))


@checks.door()
def final(expression: Any) -> Quantity:
    """An expression at the end of the span.

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, final(x), (0, 3), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 2.0000
    """
    return Quantity("final", _expression(expression))


@checks.door()
def at(expression: Any, time: float) -> Quantity:
    """An expression at a time, at an event on the side after it.

    Parameters
    ----------
    time : float, in the unit of the model's time
        When.

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, at(x, 1), (0, 3), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    3.0000 1.0000
    """
    return Quantity("at", _expression(expression), (checks.number(time, "`time`"),))


def _event(switch: Any, kind: str | None, number: int) -> tuple[str, str | None, int]:
    kind = None if kind is None else checks.name(kind, "`kind`")
    return str(checks.key(switch, "`switch`")), kind, checks.whole(number, "`number`", 0)


@checks.door()
def event_time(switch: Any, kind: str | None = None, number: int = 0) -> Quantity:
    """The time of an event.

    Returns
    -------
    Quantity
        In the unit of the model's time.

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, event_time("sgn(v)"), (0, 3), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    2.0000 0.5000
    """
    return Quantity("event_time", None, _event(switch, kind, number))


@checks.door()
def at_event(
    expression: Any, switch: Any, kind: str | None = None, number: int = 0, after: bool = False
) -> Quantity:
    """An expression at an event, before or after what happens there.

    Parameters
    ----------
    expression : Expr
        Of states, parameters and time.
    after : bool
        On the side after it.

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, at_event(x, "sgn(v)"), (0, 3), {x: 0, v: 4}, by=["v"])
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


@checks.door()
def largest(expression: Any, start: float | None = None, end: float | None = None) -> Quantity:
    """The largest value of an expression over a window; its slopes are those where it is taken (envelope theorem).

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -x})
    >>> value, slope = value_and_gradient(body, largest(x), (0, 6), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    4.0000 1.0000
    """
    return _window("largest", expression, start, end)


@checks.door()
def smallest(expression: Any, start: float | None = None, end: float | None = None) -> Quantity:
    """The smallest value of an expression over a window, as `largest`.

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -x})
    >>> value, slope = value_and_gradient(body, smallest(x), (0, 6), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    -4.0000 -1.0000
    """
    return _window("smallest", expression, start, end)


@checks.door()
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

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> value, slope = value_and_gradient(body, duration("sgn(v)"), (0, 3), {x: 0, v: 4}, by=["v"])
    >>> print(f"{value:.4f} {slope[0]:.4f}")
    1.0000 -0.5000
    """
    return Quantity("duration", None, (str(checks.key(switch, "`switch`")),))


@checks.door()
def misfit(expression: Any, times: Any, values: Any, sigma: Any = 1.0) -> Quantity:
    """The sum of squares of (expression - value)/sigma over data.

    Parameters
    ----------
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

    >>> x, v = sp.symbols("x v", real=True)
    >>> body = System({x: v, v: -2 * sp.sign(v)})
    >>> cost = misfit(x, [1, 2], [2.5, 4])
    >>> value, slope = value_and_gradient(body, cost, (0, 3), {x: 0, v: 4}, by=["v"])
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
        return checks.as_floats(value)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{what} is {checks.shown(value)}; give numbers.") from None
