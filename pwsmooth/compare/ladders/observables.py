"""Observables: numbers of a motion over a window, each a function that makes one for a named quantity.

Extremes are looked at three times closer around the largest sample, instants found by bisection; what is left of the
sampling is part of the error that the ladder reports.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from ...door import checks
from ...results.maximum import refined_maximum
from .rungs import Observable

__all__ = ["amplitude", "centre", "curve", "end_value", "least", "peak", "period", "share_below"]

_DOC = """{summary}

Parameters
----------
name : str
    Of the observable.
of : str
    Name of the quantity in the motion.
unit : str
    Of its value.

Returns
-------
Observable
    {value}

Examples
--------
>>> import numpy as np
>>> from pwsmooth.compare.ladders import {function}
{example}
"""


def _observable(text: str, value: str) -> Callable[..., Callable[[str, str, str], Observable]]:
    """Turns a measure (motion, window, points, of) -> float into a function (name, of, unit) -> Observable.

    `text` describes the observable of a quantity `of`, `value` its value; the measure's docstring is a sentence and an
    example.
    """

    def turn(measure: Callable[[Any, tuple[float, float], int, str], float]) -> Any:
        def make(name: str, of: str, unit: str) -> Observable:
            return Observable(name, unit, text.format(of=of), lambda m, w, n: measure(m, w, n, of))

        make.__name__ = make.__qualname__ = measure.__name__
        summary, _, example = inspect.cleandoc(measure.__doc__ or "").partition("\n\n")
        make.__doc__ = _DOC.format(summary=summary, value=value, function=measure.__name__, example=example)
        return make

    return turn


def _samples(motion, window, points, name):
    times = np.linspace(window[0], window[1], points)
    return times, np.asarray(motion(times, name), float)


def _top(motion: Any, window: tuple[float, float], points: int, name: str, sign: int = 1) -> float:
    """Maximum of a quantity (of its negative with sign -1), by samples and a closer look around the largest."""
    times, values = _samples(motion, window, points, name)
    return refined_maximum(lambda t: sign * np.asarray(motion(t, name), float), times, sign * values, 129, 3)


_BETWEEN = "Between samples it looks closer three times, at values that occur."


@checks.door()
@_observable("largest {of}", _BETWEEN)
def peak(motion, window, points, of):
    """Largest value of a quantity.

    >>> round(peak("top", "x", "m").measure(lambda t, name: np.sin(t), (0.0, 3.0), 11), 6)
    1.0
    """
    return _top(motion, window, points, of)


@checks.door()
@_observable("smallest {of}", _BETWEEN)
def least(motion, window, points, of):
    """Smallest value of a quantity.

    >>> round(least("lowest", "x", "m").measure(lambda t, name: np.sin(t), (3.0, 6.0), 11), 6)
    -1.0
    """
    return -_top(motion, window, points, of, -1)


@checks.door()
@_observable("half the range of {of}", "(largest - smallest)/2.")
def amplitude(motion, window, points, of):
    """Half the range of a quantity.

    >>> round(amplitude("size", "x", "m").measure(lambda t, name: 3 + np.sin(t), (0.0, 6.0), 101), 6)
    1.0
    """
    return (_top(motion, window, points, of) + _top(motion, window, points, of, -1)) / 2


@checks.door()
@_observable("distance of the middle of {of}'s range from 0", "Half the absolute value of largest + smallest.")
def centre(motion, window, points, of):
    """Distance of the middle of a quantity's range from 0, which it is of a symmetric orbit.

    >>> round(centre("offset", "x", "m").measure(lambda t, name: 3 + np.sin(t), (0.0, 6.0), 101), 6)
    3.0
    """
    return abs(_top(motion, window, points, of) - _top(motion, window, points, of, -1)) / 2


@checks.door()
@_observable("{of} at the end", "One value.")
def end_value(motion, window, points, of):
    """A quantity at the end of the window.

    >>> end_value("end", "x", "m").measure(lambda t, name: 2 * t, (0.0, 3.0), 11)
    6.0
    """
    return float(motion(window[1], of))


@checks.door()
def curve(name: str, of: str, unit: str, points: int = 400) -> Observable:
    """A quantity over the window: the distance of two is the largest one.

    Parameters
    ----------
    unit : str
        Of its value.
    points : int
        Middles of equal intervals at which it is taken.

    Returns
    -------
    Observable
        Its value has shape (points,).

    >>> curve("whole", "x", "m", points=4).measure(lambda t, name: 2 * t, (0.0, 4.0), 11).tolist()
    [1.0, 3.0, 5.0, 7.0]
    """

    def measure(motion, window, finer):
        # Middles of equal intervals: the ends, often instants of reversal, are where a switching force has no value.
        times = window[0] + (np.arange(points) + 0.5) * (window[1] - window[0]) / points
        return np.asarray(motion(times, of), float)

    return Observable(name, unit, f"{of} over the window", measure)


def _crossings(motion, window, points, name, level):
    """Instants at which a quantity passes a level upwards."""
    times, values = _samples(motion, window, points, name)
    k = np.flatnonzero((values[:-1] <= level) & (values[1:] > level))
    low, high = times[k], times[k + 1]
    for _ in range(50):  # to rounding
        middle = (low + high) / 2
        above = np.asarray(motion(middle, name)) > level if len(k) else middle > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return (low + high) / 2


@checks.door()
def period(name: str, of: str, level: float, unit: str = "s") -> Observable:
    """Mean time between upward passages of a level; nan with fewer than two.

    Parameters
    ----------
    level : float, in the unit of the quantity
        Which it passes.
    unit : str
        Of time.

    Returns
    -------
    Observable
        The instants are found by bisection.

    >>> round(period("period", "x", 0.5).measure(lambda t, name: np.sin(t), (0.0, 20.0), 101), 6)
    6.283185
    """

    def measure(motion, window, points):
        times = _crossings(motion, window, points, of, level)
        return float((times[-1] - times[0]) / (len(times) - 1)) if len(times) > 1 else float("nan")

    return Observable(name, unit, f"mean time between passages of {of} upwards through {level:g}", measure)


@checks.door()
def share_below(name: str, of: str, level: float) -> Observable:
    """Share of the time in which a quantity is small: of sticking, where the level is a small speed.

    Parameters
    ----------
    level : float, in the unit of the quantity
        It is small where its absolute value is at most this.

    Returns
    -------
    Observable
        Between 0 and 1.

    >>> round(share_below("slow", "v", 0.5).measure(lambda t, name: t, (-1.0, 1.0), 101), 6)
    0.5
    """

    def measure(motion, window, points):
        times, values = _samples(motion, window, points, of)
        excess = np.abs(values) - level
        # Straight between the samples.
        a, b = excess[:-1], excess[1:]
        with np.errstate(all="ignore"):
            part = np.where(a <= 0, np.where(b <= 0, 1.0, a / (a - b)), np.where(b <= 0, b / (b - a), 0.0))
        return float(np.mean(part))

    return Observable(name, "1", f"share of the time with |{of}| <= {level:g}", measure)
