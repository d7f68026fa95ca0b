"""Charts of work against precision: one colour a package and one mark a method throughout.

Open marks are wrong itineraries. A method with two knobs (eps, rtol) is drawn by its lower envelope, the least error
for each work.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...door import checks
from ...plotting import COLOUR
from .cases import CASES
from .point import Point

__all__ = ["best_width", "envelope", "plot_orders", "plot_widths", "plot_work"]

MARKS = "os^Dv<>P"
# Apart in grey too, and the same in every panel of a page.
MARK = {
    "event-driven": "o", "event-driven, stiff": "s", "smoothed, algebraic": "d", "Moreau-Jean": "v",
    "DOP853, restarted": "^", "Radau, restarted": "<", "heyoka, events": "D", "CVODE, events": "X",
    "numbalsoda DOP853, events": "P", "diffrax, events": "h", "nosnoc, 4 stages": "*", "solve_nivp": "p",
    "BDF, bare sign": ">", "numbalsoda LSODA, bare sign": "8", "smoothed, tanh": "p", "RK45, restarted": "v",
}  # fmt: skip
FLOOR = 1e-16  # an error of nothing is drawn here
SHORT = {
    "event-driven, 8(5,3) pair": "our 8(5,3) pair", "event-driven, stiff": "our stiff steps",
    "numbalsoda DOP853, events": "numbalsoda DOP853",
    "numbalsoda LSODA, bare sign": "LSODA, bare sign", "heyoka, events": "heyoka", "CVODE, events": "CVODE",
    "diffrax, events": "diffrax", "DOP853, restarted": "SciPy DOP853", "Radau, restarted": "SciPy Radau",
    "RK45, restarted": "SciPy RK45", "smoothed, algebraic": "smoothed", "smoothed, tanh": "smoothed, tanh",
}  # fmt: skip


@checks.door()
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
    methods : iterable of str, optional
        Those that are drawn; all by default.
    label : bool
        Name the lines in a legend.

    Returns
    -------
    Axes
        Where it was drawn.

    Notes
    -----
    Open marks are wrong itineraries.

    >>> from pwsmooth.plotting import new_figure
    >>> data = work_precision("relay", ["event-driven"], [1e-6, 1e-9], repeats=1)
    >>> plot_work(data, new_figure().subplots()).get_ylabel()
    'error of the state'
    """
    names = list(methods) or list(dict.fromkeys(p.method for p in points))
    for name in names:
        line = [p for p in points if p.method == name and np.isfinite(p.error)]
        if not line:
            continue
        group = line[0].group
        mark = MARK.get(name, "o")
        if isinstance(line[0].setting, (list, tuple)):
            line = envelope(line, work)
        colour = COLOUR["exact" if group == "event-driven" else group]
        x = [getattr(p, work) for p in line]
        y = [max(p.error, FLOOR) for p in line]
        ours = group == "event-driven"
        look = dict(color=colour, markersize=4.0 if mark in "*dXPhp" else 3.2, markeredgewidth=0.7,
                    linewidth=1.6 if ours else 0.9, zorder=4 if ours else 3)  # fmt: skip
        axes.plot(x, y, mark + (":" if "bare" in name else "-"), label=SHORT.get(name, name), **look)
        wrong = [i for i, p in enumerate(line) if p.itinerary == "wrong"]
        if wrong:
            look |= dict(markerfacecolor="white", zorder=5)
            axes.plot([x[i] for i in wrong], [y[i] for i in wrong], mark, **look)
    _logarithmic(axes, "processor time (s)" if work == "seconds" else "evaluations", "error of the state")
    axes.set_ylim(min(1e-15, axes.get_ylim()[0]), min(axes.get_ylim()[1], 1e1))
    if label:
        axes.legend(fontsize=7)
    return axes


@checks.door()
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

    Source: the Pareto front.

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


@checks.door()
def plot_orders(points: Sequence[Point], axes: Any, *, error: float = 1e-9) -> Any:
    """What a fixed order costs: the time to an error over that at the order it chooses, a line a case.

    Parameters
    ----------
    points : sequence of Point
        Of several cases, of the event-driven path at its orders and at the one that it chooses from the tolerance.

    Returns
    -------
    Axes
        Where it was drawn.

    >>> from pwsmooth.plotting import new_figure
    >>> methods = ["event-driven", "event-driven, order 8", "event-driven, order 20"]
    >>> data = work_precision("relay", methods, [1e-12], repeats=1)
    >>> (line,) = plot_orders(data, new_figure().subplots()).lines
    >>> line.get_xdata().tolist()
    [8, 20]
    """
    start = "event-driven, order "
    for k, case in enumerate(dict.fromkeys(p.case for p in points)):
        least: dict[str, float] = {}
        for p in points:
            if p.case == case and p.good and p.error <= error:
                least[p.method] = min(p.seconds, least.get(p.method, np.inf))
        orders = sorted(int(name.removeprefix(start)) for name in least if name.startswith(start))
        if "event-driven" in least and orders:
            ratio = [least[f"{start}{order}"] / least["event-driven"] for order in orders]
            axes.plot(orders, ratio, "-", **_of_case(k, case))
    axes.set(yscale="log", xlabel="order", ylabel="time / time at the order that it chooses")
    return axes


def _of_case(k: int, case: str) -> dict[str, Any]:
    """The look of a case's line among several, with its title: marks tell them apart in grey."""
    shade = COLOUR[("right", "left", "stick", "approximation", "fast", "exact", "velocity")[k % 7]]
    title = CASES[case].title if case in CASES else case
    return dict(marker=(MARKS + "Xphd*")[k % 13], color=shade, markersize=3.5, linewidth=0.9, label=title)


@checks.door()
def best_width(points: Iterable[Point], error: float) -> Point | None:
    """The smoothed run of least time within an error: its setting is (eps, rtol).

    Parameters
    ----------
    points : iterable of Point
        Of one case.

    Returns
    -------
    Point or None
        None if no run is so good.

    >>> best_width([], 1e-3) is None
    True
    """
    good = [p for p in points if isinstance(p.setting, (list, tuple)) and p.good and p.error <= error]
    return min(good, key=lambda p: p.seconds, default=None)


@checks.door()
def plot_widths(
    points: Sequence[Point], axes: Any, *, method: str = "smoothed, algebraic", what: str = "eps"
) -> Any:
    """The eps with which the smoothed path is cheapest, against the error asked for, a line a case.

    Parameters
    ----------
    points : sequence of Point
        Of several cases.
    method : str
        A method whose setting is (eps, rtol).
    what : {"eps", "seconds"}
        "seconds" is the time it takes, over that of the event-driven path at the same error.

    Returns
    -------
    Axes
        Where it was drawn.

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
        axes.plot(x, y, "-", **_of_case(k, case))
    _logarithmic(axes, "error asked for", "cheapest ε" if what == "eps" else "time / event-driven time")
    axes.invert_xaxis()
    if what != "eps":
        axes.axhline(1, color=COLOUR["mark"], linewidth=0.6)
    return axes
