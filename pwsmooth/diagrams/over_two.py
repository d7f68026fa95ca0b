"""Curves of the bifurcations that diagrams along lines in the plane of two parameters meet.

    diagrams along lines  ->  their bifurcations  ->  the curve of each that is on none yet

Chain: growing.py, searching.py -> **over_two** -> calling.py.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..door import checks
from .growing import condition_of
from .line import Line
from .result import Diagram
from .searching import bare
from .tasks import Task, Tasks


def lines_in(lines: Any, names: list[str], bounds: list[Any]) -> list[tuple[str, float]]:
    """The parameter that is held, and its value, of every line."""
    if lines is None:
        return [(name, 0.5 * (low + high)) for name, (low, high) in zip(reversed(names), reversed(bounds))]
    held = []
    for key, numbers in lines.items():
        name = str(getattr(key, "name", key))
        if name not in names:
            raise ValueError(f"`lines` names {name}; give values of {names[0]} or {names[1]}.")
        low, high = bounds[names.index(name)]
        for value in checks.numbers(numbers, f"`lines` of {name}"):
            if not low <= value <= high:
                raise ValueError(
                    f"`lines` of {name} holds {value:g}, outside of its range from {low:g} to {high:g}."
                )
            held.append((name, float(value)))
    if not held:
        raise ValueError("`lines` is empty; leave it out, or give values at which a parameter is held.")
    return held


class Growing:
    """Curves from the bifurcations of diagrams, in their order."""

    def __init__(self, work: Tasks, names, bounds, max_points, virtual, max_branches, tell) -> None:
        self.work, self.names, self.most, self.tell = work, names, max_branches, tell
        self.widths = np.array([high - low for low, high in bounds])
        self.common = {
            "ranges": dict(zip(names, map(list, bounds))), "most": max_points, "virtual": virtual,
        }  # fmt: skip
        self.found: list[Line] = []
        self.lost: list[str] = []

    def grow(self, diagrams: list[Diagram], held: list[tuple[str, float]]) -> None:
        starts = [
            (b, found.parameter, (name, value))
            for found, (name, value) in zip(diagrams, held)
            for b in found._located
        ]
        others = Counter(b["kind"] for b, *_ in starts if condition_of(b) is None)
        self.lost += [f"{number} of {kind}: no curves of it are followed." for kind, number in others.items()]
        starts = [start for start in starts if condition_of(start[0]) is not None]
        for number, start in enumerate(starts):
            if self.known(*start):
                continue
            if len(self.found) >= self.most:
                self.lost.append(f"{len(starts) - number} more bifurcations: `max_branches` ends the search.")
                return
            self.work.ask(itertools.islice(self.tasks(starts[number:]), self.work.workers.ahead))
            b, *_ = start
            self.tell(f"curve {len(self.found) + 1}, of a {b['kind']}; {len(starts) - number} starts left")
            item = self.work.result(self.task(b))
            at = self.at(*start)
            origin = f"{b['kind']} at {self.names[0]} = {at[0]:.9g}, {self.names[1]} = {at[1]:.9g}"
            if item["about"]["lost"]:
                self.lost.append(f"{origin}: {item['about']['lost']}")
                continue
            curve = Line(item["arrays"], item["about"], origin)
            if not self.same(curve):
                self.found.append(curve)

    def tasks(self, starts: Any) -> Iterator[Task]:
        return (self.task(start[0]) for start in starts if not self.known(*start))

    def task(self, b: Any) -> Task:
        return {"bifurcation": bare(b), **self.common}

    def at(self, b: Any, name: str, line: tuple[str, float]) -> np.ndarray:
        values = {name: b["parameter"], line[0]: line[1]}
        return np.array([values[name] for name in self.names])

    def known(self, b: Any, name: str, line: tuple[str, float]) -> bool:
        at = self.at(b, name, line)
        kind = condition_of(b)
        return any(
            curve.meets(kind, at, np.asarray(b["points"]), self.widths, self.work.setting)
            for curve in self.found
        )

    def same(self, curve: Line) -> bool:
        """Whether a curve is one that is known, of which two of its points say so."""
        number = curve.values.shape[1]
        return any(
            all(
                known.meets(
                    curve.kind, curve.values[:, k], curve.arrays["points"][k], self.widths, self.work.setting
                )
                for k in (number // 3, (2 * number) // 3)
            )
            for known in self.found
        )
