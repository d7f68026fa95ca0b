"""Observables: numbers of a motion over a window, each a function that makes one for a named quantity.

Extremes are looked at closer twice around the largest sample, instants found by bisection; what is left of the sampling
is part of the error that the ladder reports.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .rungs import Observable

__all__ = ["amplitude", "centre", "curve", "end_value", "least", "peak", "period", "share_below"]


def _samples(motion, window, points, name):
    times = np.linspace(window[0], window[1], points)
    return times, np.asarray(motion(times, name), float)


def _top(motion: Any, window: tuple[float, float], points: int, name: str, sign: int = 1) -> float:
    """Maximum of a quantity (of its negative with sign -1): the largest sample, then twice a closer look around it.

    Only values that occur: a parabola through the samples would overshoot where a switching force jumps.
    """
    times, values = _samples(motion, window, points, name)
    best = -np.inf
    for _ in range(3):
        i = int(np.argmax(sign * values))
        best = max(best, float(sign * values[i]))
        near = times[max(i - 1, 0)], times[min(i + 1, len(times) - 1)]
        times, values = _samples(motion, near, 129, name)
    return max(best, float(np.max(sign * values)))


def peak(name: str, of: str, unit: str) -> Observable:
    """Largest value of a quantity.

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
        Between samples it looks closer twice, at values that occur.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.compare.ladders import peak
    >>> round(peak("top", "x", "m").measure(lambda t, name: np.sin(t), (0.0, 3.0), 11), 6)
    1.0
    """
    return Observable(name, unit, f"largest {of}", lambda m, w, n: _top(m, w, n, of))


def least(name: str, of: str, unit: str) -> Observable:
    """Smallest value of a quantity.

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
        Between samples it looks closer twice, at values that occur.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.compare.ladders import least
    >>> round(least("lowest", "x", "m").measure(lambda t, name: np.sin(t), (3.0, 6.0), 11), 6)
    -1.0
    """
    return Observable(name, unit, f"smallest {of}", lambda m, w, n: -_top(m, w, n, of, -1))


def amplitude(name: str, of: str, unit: str) -> Observable:
    """Half the range of a quantity.

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
        (largest - smallest)/2.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.compare.ladders import amplitude
    >>> round(amplitude("size", "x", "m").measure(lambda t, name: 3 + np.sin(t), (0.0, 6.0), 101), 6)
    1.0
    """
    return Observable(name, unit, f"half the range of {of}",
                      lambda m, w, n: (_top(m, w, n, of) + _top(m, w, n, of, -1)) / 2)  # fmt: skip


def centre(name: str, of: str, unit: str) -> Observable:
    """Distance of the middle of a quantity's range from 0, which it is of a symmetric orbit.

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
        Half the absolute value of largest + smallest.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.compare.ladders import centre
    >>> round(centre("offset", "x", "m").measure(lambda t, name: 3 + np.sin(t), (0.0, 6.0), 101), 6)
    3.0
    """
    return Observable(name, unit, f"distance of the middle of {of}'s range from 0",
                      lambda m, w, n: abs(_top(m, w, n, of) - _top(m, w, n, of, -1)) / 2)  # fmt: skip


def end_value(name: str, of: str, unit: str) -> Observable:
    """A quantity at the end of the window.

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
        One value.

    Examples
    --------
    >>> from pwsmooth.compare.ladders import end_value
    >>> end_value("end", "x", "m").measure(lambda t, name: 2 * t, (0.0, 3.0), 11)
    6.0
    """
    return Observable(name, unit, f"{of} at the end", lambda m, w, n: float(m(w[1], of)))


def curve(name: str, of: str, unit: str, points: int = 400) -> Observable:
    """A quantity over the window: the distance of two is the largest one.

    Parameters
    ----------
    name : str
        Of the observable.
    of : str
        Name of the quantity in the motion.
    unit : str
        Of its value.
    points : int
        Middles of equal intervals at which it is taken.

    Returns
    -------
    Observable
        Its value has shape (points,).

    Examples
    --------
    >>> from pwsmooth.compare.ladders import curve
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


def period(name: str, of: str, level: float, unit: str = "s") -> Observable:
    """Mean time between upward passages of a level; nan with fewer than two.

    Parameters
    ----------
    name : str
        Of the observable.
    of : str
        Name of the quantity in the motion.
    level : float, in the unit of the quantity
        Which it passes.
    unit : str
        Of time.

    Returns
    -------
    Observable
        The instants are found by bisection.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.compare.ladders import period
    >>> round(period("period", "x", 0.5).measure(lambda t, name: np.sin(t), (0.0, 20.0), 101), 6)
    6.283185
    """

    def measure(motion, window, points):
        times = _crossings(motion, window, points, of, level)
        return float((times[-1] - times[0]) / (len(times) - 1)) if len(times) > 1 else float("nan")

    return Observable(name, unit, f"mean time between passages of {of} upwards through {level:g}", measure)


def share_below(name: str, of: str, level: float) -> Observable:
    """Share of the time in which a quantity is small: of sticking, where the level is a small speed.

    Parameters
    ----------
    name : str
        Of the observable.
    of : str
        Name of the quantity in the motion.
    level : float, in the unit of the quantity
        It is small where its absolute value is at most this.

    Returns
    -------
    Observable
        Between 0 and 1.

    Examples
    --------
    >>> from pwsmooth.compare.ladders import share_below
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
