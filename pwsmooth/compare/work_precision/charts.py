"""Charts of work against precision: one colour a package throughout, each line labelled where it ends.

Open marks are wrong itineraries. A method with two knobs (eps, rtol) is drawn by its lower envelope, the least error
for each work.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...plotting import COLOUR
from .cases import CASES
from .point import Point

__all__ = ["best_width", "envelope", "plot_orders", "plot_widths", "plot_work"]

MARKS = "os^Dv<>P"
FLOOR = 1e-16  # an error of nothing is drawn here
SHORT = {
    "event-driven, 8(5,3) pair": "our 8(5,3) pair", "event-driven, stiff": "our stiff steps",
    "numbalsoda DOP853, events": "numbalsoda DOP853",
    "numbalsoda LSODA, bare sign": "LSODA, bare sign", "heyoka, events": "heyoka", "CVODE, events": "CVODE",
    "diffrax, events": "diffrax", "DOP853, restarted": "SciPy DOP853", "Radau, restarted": "SciPy Radau",
    "RK45, restarted": "SciPy RK45", "smoothed, algebraic": "smoothed", "smoothed, tanh": "smoothed, tanh",
}  # fmt: skip


def plot_work(
    points: Sequence[Point],
    axes: Any,
    *,
    work: str = "seconds",
    methods: Iterable[str] = (),
    label: bool = True,
) -> Any:
    """Error against work for one case, a line a method.

    Parameters
    ----------
    points : sequence of Point
        Of one case.
    axes : Axes
        Where to draw.
    work : {"seconds", "evaluations"}
        The horizontal axis.
    methods : iterable of str, optional
        Those that are drawn; all by default.
    label : bool
        Write its name at the end of each line.

    Returns
    -------
    Axes
        The same.

    Notes
    -----
    Open marks are wrong itineraries.

    Examples
    --------
    >>> from pwsmooth.compare import work_precision
    >>> from pwsmooth.compare.work_precision.charts import plot_work
    >>> from pwsmooth.plotting import new_figure
    >>> data = work_precision("relay", ["event-driven"], [1e-6, 1e-9], repeats=1)
    >>> plot_work(data, new_figure().subplots()).get_ylabel()
    'error of the state'
    """
    names = list(methods) or list(dict.fromkeys(p.method for p in points))
    counts: dict[str, int] = {}
    ends = []
    for name in names:
        line = [p for p in points if p.method == name and np.isfinite(p.error)]
        if not line:
            continue
        group = line[0].group
        mark = MARKS[counts.setdefault(group, 0) % len(MARKS)]
        counts[group] += 1
        if isinstance(line[0].setting, (list, tuple)):
            line = envelope(line, work)
        colour = COLOUR["exact" if group == "event-driven" else group]
        x = [getattr(p, work) for p in line]
        y = [max(p.error, FLOOR) for p in line]
        ours = group == "event-driven"
        axes.plot(x, y, ":" if "bare" in name else "-", color=colour, linewidth=1.6 if ours else 0.9,
                  zorder=4 if ours else 3)  # fmt: skip
        for wrong in (True, False):
            chosen = [i for i, p in enumerate(line) if (p.itinerary == "wrong") == wrong]
            axes.plot(
                [x[i] for i in chosen], [y[i] for i in chosen], mark, color=colour, markersize=3.2, zorder=4,
                markerfacecolor="white" if wrong else colour, label=None if wrong else name,
            )  # fmt: skip
        if x:
            # Where a line turns back, its name stands beside it, not on it.
            ends.append((max(x) if x[-1] > 0.2 * max(x) else x[-1], y[-1], SHORT.get(name, name), colour))
    _logarithmic(axes, "processor time (s)" if work == "seconds" else "evaluations", "error of the state")
    axes.set_ylim(min(1e-15, axes.get_ylim()[0]), min(axes.get_ylim()[1], 1e1))
    if label:
        _label(axes, ends)
    return axes


def envelope(line: Sequence[Point], work: str = "seconds") -> list[Point]:
    """Of the points with a right or no itinerary those that none beats in both error and work; else the least error.

    Parameters
    ----------
    line : sequence of Point
        Of one method on one case.
    work : {"seconds", "evaluations"}
        What is paid.

    Returns
    -------
    list of Point
        Of increasing work and falling error.

    Notes
    -----
    Source: the Pareto front.

    Examples
    --------
    >>> from pwsmooth.compare import work_precision
    >>> from pwsmooth.compare.work_precision.charts import envelope
    >>> data = work_precision("relay", ["event-driven"], [1e-6, 1e-9], repeats=1)
    >>> errors = [point.error for point in envelope(data, "evaluations")]
    >>> errors == sorted(errors, reverse=True)
    True
    """
    good = sorted((p for p in line if p.good), key=lambda p: (getattr(p, work), p.error))
    best: list[Point] = []
    for p in good:
        if not best or p.error < best[-1].error:
            best.append(p)
    return best or [min(line, key=lambda p: p.error)]


def _logarithmic(axes: Any, x: str, y: str) -> None:
    axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y)


def _label(axes: Any, ends: list[tuple[float, float, str, str]]) -> None:
    """Names at the right of the lines' ends, off one another and, where there is room nearby, off the lines."""
    from matplotlib.patheffects import withStroke

    left, right = axes.get_xlim()
    axes.set_xlim(left, right * (right / left) ** 0.42)
    low, high = (math.log10(y) for y in axes.get_ylim())
    begin, end = (math.log10(x) for x in axes.get_xlim())
    height, width = 0.052 * (high - low), 0.021 * (end - begin)  # of a line of text, and of a letter
    drawn = _traced(axes.lines)
    placed: list[tuple[float, float, float]] = []
    for x, y, text, colour in sorted(ends, key=lambda e: e[1]):
        across, wanted, long = math.log10(x) + 0.6 * width, math.log10(y), width * len(text)
        best, least = wanted, math.inf
        for shift in sorted(range(-24, 25), key=abs):
            at = wanted + shift * height / 3
            if not low + height / 2 <= at <= high - height / 2:
                continue
            taken = any(abs(at - b) < height and across < a + w and a < across + long for a, b, w in placed)
            inside = (np.abs(drawn[1] - at) < 0.4 * height) & (across < drawn[0]) & (drawn[0] < across + long)
            # Names must not overlap; a name may lie on a line, so that it stays near its own.
            cost = 1e3 * taken + abs(shift) + min(6.0, 0.5 * int(inside.sum()))
            if cost < least:
                best, least = at, cost
        placed.append((across, best, long))
        # Draw names over the lines and under the marks: no point is hidden.
        axes.annotate(
            text, (x, y), (10**across, 10**best), color=colour, fontsize=6.2, va="center", zorder=3.5,
            path_effects=[withStroke(linewidth=1.6, foreground="white")],
        )  # fmt: skip


def _traced(lines: Iterable[Any]) -> np.ndarray:
    """log10 of points along all lines, shape (2, points)."""
    pieces = [np.empty((2, 0))]
    for line in lines:
        x, y = (np.log10(np.asarray(values, float)) for values in line.get_data())
        if line.get_linestyle() == "None":
            pieces.append(np.array([x, y]))
        elif len(x) > 1:
            steps = np.linspace(0, len(x) - 1, 12 * len(x))
            pieces.append(np.array([np.interp(steps, np.arange(len(x)), values) for values in (x, y)]))
    return np.concatenate(pieces, axis=1)


def plot_orders(points: Sequence[Point], axes: Any) -> Any:
    """The event-driven path at each order on one case: error against time, the orders from light to dark.

    Parameters
    ----------
    points : sequence of Point
        Of one case.
    axes : Axes
        Where to draw.

    Returns
    -------
    Axes
        The same.

    Examples
    --------
    >>> from pwsmooth.compare import work_precision
    >>> from pwsmooth.compare.work_precision.charts import plot_orders
    >>> from pwsmooth.plotting import new_figure
    >>> data = work_precision("relay", ["event-driven, order 8", "event-driven, order 20"], [1e-9], repeats=1)
    >>> len(plot_orders(data, new_figure().subplots()).lines)
    2
    """
    import matplotlib
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    # Stiff steps choose their order as they go.
    names = [
        n for n in dict.fromkeys(p.method for p in points) if n.startswith("event-driven") and "stiff" not in n
    ]
    orders = [n for n in names if ", order" in n]
    shades = matplotlib.colormaps["viridis_r"](np.linspace(0.1, 1, max(1, len(orders))))
    for name in names:
        line = [p for p in points if p.method == name and np.isfinite(p.error)]
        colour = (
            shades[orders.index(name)] if name in orders else "black" if name == "event-driven" else "#999999"
        )
        axes.plot(
            [1e3 * p.seconds for p in line], [max(p.error, FLOOR) for p in line], "-o", color=colour, markersize=2.5,
            linewidth=2.2 if name == "event-driven" else 0.9, label=name.removeprefix("event-driven, ") or name,
            zorder=2 if name == "event-driven" else 3,
        )  # fmt: skip
    _logarithmic(axes, "processor time (ms)", "error of the state")
    # Plain numbers: at 1, 2, 5 where a panel spans a decade or so, else at equal distances; powers of ten at every
    # minor tick do not fit.
    left, right = axes.get_xlim()
    narrow = right < 4 * left
    axes.xaxis.set_major_locator(MaxNLocator(3) if narrow else LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    if narrow:
        axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    return axes


def best_width(points: Iterable[Point], error: float) -> Point | None:
    """The smoothed run of least time within an error: its setting is (eps, rtol).

    Parameters
    ----------
    points : iterable of Point
        Of one case.
    error : float, dimensionless
        Of the state, in units of its sizes.

    Returns
    -------
    Point or None
        None if no run is so good.

    Examples
    --------
    >>> from pwsmooth.compare.work_precision.charts import best_width
    >>> best_width([], 1e-3) is None
    True
    """
    good = [p for p in points if isinstance(p.setting, (list, tuple)) and p.good and p.error <= error]
    return min(good, key=lambda p: p.seconds, default=None)


def plot_widths(
    points: Sequence[Point], axes: Any, *, method: str = "smoothed, algebraic", what: str = "eps"
) -> Any:
    """The eps with which the smoothed path is cheapest, against the error asked for, a line a case.

    Parameters
    ----------
    points : sequence of Point
        Of several cases.
    axes : Axes
        Where to draw.
    method : str
        A method whose setting is (eps, rtol).
    what : {"eps", "seconds"}
        "seconds" is the time it takes, over that of the event-driven path at the same error.

    Returns
    -------
    Axes
        The same.

    Examples
    --------
    >>> from pwsmooth.compare.work_precision.charts import plot_widths
    >>> from pwsmooth.plotting import new_figure
    >>> plot_widths([], new_figure().subplots()).get_xlabel()
    'error asked for'
    """
    cases = list(dict.fromkeys(p.case for p in points if p.method == method and p.good))
    errors = 10.0 ** -np.arange(1, 9)
    for k, case in enumerate(cases):
        here = [p for p in points if p.case == case]
        exact = [p for p in here if p.method == "event-driven" and p.good]
        x, y = [], []
        for error in errors:
            cheapest = best_width((p for p in here if p.method == method), error)
            least = min((p.seconds for p in exact if p.error <= error), default=None)
            if cheapest and (what == "eps" or least):
                x.append(error)
                y.append(cheapest.setting[0] if what == "eps" or not least else cheapest.seconds / least)
        title = CASES[case].title if case in CASES else case
        axes.plot(x, y, "-" + MARKS[k % len(MARKS)], color=f"C{k}", markersize=3.5, label=title)
    _logarithmic(axes, "error asked for", "cheapest ε" if what == "eps" else "time / event-driven time")
    axes.invert_xaxis()
    if what != "eps":
        axes.axhline(1, color=COLOUR["mark"], linewidth=0.6)
    return axes
