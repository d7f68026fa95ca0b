"""Charts of work against precision: one colour a group of methods, open marks for wrong itineraries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..plotting import COLOUR
from .work_precision import Point

MARKS = "osD^v<>P"
_COLOUR_OF = {"event-driven": "exact"}
FLOOR = 1e-16  # an error of nothing is drawn here


def plot_work(points: Sequence[Point], axes: Any, *, work: str = "seconds") -> Any:
    """Error against work for one case, a line a method; returns the Axes.

    Parameters
    ----------
    points : sequence of Point
        Of one case.
    axes : matplotlib Axes
    work : {"seconds", "evaluations"}
    """
    counts: dict[str, int] = {}
    for method in dict.fromkeys(p.method for p in points):
        line = [p for p in points if p.method == method and np.isfinite(p.error)]
        if not line:
            continue
        group = line[0].group
        mark = MARKS[counts.setdefault(group, 0) % len(MARKS)]
        counts[group] += 1
        colour = COLOUR[_COLOUR_OF.get(group, group)]
        x = [getattr(p, work) for p in line]
        y = [max(p.error, FLOOR) for p in line]
        axes.plot(x, y, color=colour, linewidth=0.9)
        for wrong in (True, False):
            chosen = [i for i, p in enumerate(line) if (p.itinerary == "wrong") == wrong]
            axes.plot(
                [x[i] for i in chosen], [y[i] for i in chosen], mark, color=colour, markersize=4,
                markerfacecolor="white" if wrong else colour, label=None if wrong else method,
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("processor time (s)" if work == "seconds" else "evaluations")
    axes.set_ylabel("error of the state")
    return axes
