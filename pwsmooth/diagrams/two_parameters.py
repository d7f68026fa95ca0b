"""A bifurcation set by one call: `bifurcation_set(system, (p, q), ranges, x0, seen)`.

    diagrams along lines in the plane  ->  their bifurcations  ->  the curve of each that is on none yet

Chain: looking.py, growing.py, sets.py -> **two_parameters** -> study.py.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from ..analysis.maps.seen import Return, Strobe
from ..door import calls, checks
from .growing import Grown, condition_of, grown
from .looking import DOOR, SWEEPS, Starts, looking
from .plain import values_of
from .result import Diagram
from .searching import bare
from .sets import TITLE, BifurcationSet
from .tracing import traced
from .work import RESULT, Store, Task, Work, telling, working, write_group

__all__ = ["bifurcation_set"]

_CURVE = {"step": 0.01, "longest_step": 0.05, "shortest_step": 1e-6}  # as of follow_curve


@checks.door(
    (*calls.POINTS, "max_seconds"),
    **DOOR,
    lines=checks.optional(checks.mapping),
    max_curves=checks.integer(1, 10**6),
)
def bifurcation_set(
    system: Any,
    parameters: tuple[Any, Any],
    ranges: Sequence[tuple[float, float]],
    x0: Starts | None = None,
    seen: Strobe | Return | None = None,
    *,
    lines: Mapping[Any, Sequence[float]] | None = None,
    orbits: Sequence[Any] = (),
    box: Mapping[Any, Any] | None = None,
    values: int = 60,
    transient: int = 200,
    keep: int = 16,
    max_count: int = 8,
    tol: float = 1e-6,
    max_depth: int = 6,
    max_branches: int = 60,
    max_points: int = 500,
    max_curves: int = 100,
    step: float = 0.005,
    longest_step: float = 0.03,
    shortest_step: float = 1e-7,
    virtual: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    store: Any = None,
    progress: bool | None = None,
    **options: Any,
) -> BifurcationSet:
    """Find bifurcations along lines in the plane of two parameters, and follow each over the plane.

    Parameters
    ----------
    system : System
        As of `diagram`.
    parameters : (str or Symbol, str or Symbol)
        The two.
    ranges : ((float, float), (float, float)), in the units of the parameters
        Of each the least and the largest value.
    x0 : mapping of state to float, or sequence of such, optional
        Where trajectories start at every value on the lines, in the units of the states.
    lines : mapping of (str or Symbol) to sequence of float, any length, optional
        The lines: values, in its unit, at which either parameter is held, while the other one goes over its range. By
        default one each, in the middle.
    orbits : sequence of PeriodicOrbit or Equilibrium, any length
        More to begin with, on the lines.
    box : mapping of state to (float, float), in the units of the states, optional
        Equilibria in it are followed too, and curves of their folds, Hopf points and boundary equilibria.
    values : int
        On each line in the orbit diagram.
    max_branches, max_points : int
        Largest number of branches on a line, and of points on each branch, and on a curve to either side.
    max_curves : int
        Largest number of curves.
    step, longest_step, shortest_step : float, in units of the arc
        Of branches, as of `follow`; curves have the steps of `follow_curve`.
    virtual : bool
        Whether curves and branches of equilibria go on where they are virtual.
    executor : concurrent.futures.Executor, optional
        Processes that follow branches and curves.
    store : path, optional
        Zarr directory to which every branch and curve is written as it finishes; the same call goes on with it.

    Returns
    -------
    BifurcationSet
        Curves, points of codimension 2, and the diagrams along the lines.

    Raises
    ------
    ValueError, TypeError
        Bad input; a store of another call.
    RuntimeError
        A worker process was lost.

    Notes
    -----
    A curve that meets none of the lines is not found. Two curves are one if a point of the one lies on the other, with
    the same orbit or, by a symmetry, its mirror image.

    The flips of x -> a - x**2 + b x lie on 4 a = (1 + b) (3 - b):

    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> step = Event(every=1, update={x: a - x**2 + b * x})
    >>> quadratic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
    >>> found = bifurcation_set(quadratic, (a, b), ((-1, 1), (-0.5, 0.5)), {x: 0.1}, Strobe(1, phase=0.5), values=6)
    >>> p, q = found.of_kind("flip")[0].values
    >>> bool(abs(4 * p - (1 + q) * (3 - q)).max() < 1e-8)
    True
    """
    pair = tuple(parameters) if isinstance(parameters, Sequence) and not isinstance(parameters, str) else ()
    if len(pair) != 2:
        raise ValueError(f"`parameters` is {checks.shown(parameters)}; give two of the system.")
    names = [checks.lookup(key, system.parameters, "`parameters`", "parameter").name for key in pair]
    if names[0] == names[1]:
        raise ValueError(f"`parameters` names {names[0]} twice; give two of the system.")
    bounds = [checks.interval(one, "`ranges`") for one in checks.several(ranges, "`ranges`")]
    if len(bounds) != 2:
        raise ValueError(f"`ranges` holds {len(bounds)}; give two, each (least, largest).")
    held = _lines(lines, names, bounds)
    steps = {"step": step, "longest_step": longest_step, "shortest_step": shortest_step}
    look = looking(
        system, x0, seen, orbits, box, values, transient,
        keep, max_count, tol, max_depth, max_branches, max_points, steps, virtual, options,
    )  # fmt: skip
    kept = None
    if store is not None:
        about = {
            "parameters": str(names),
            "ranges": str(bounds),
            "lines": str(held),
            "max_curves": str(max_curves),
        }
        kept = Store(store, TITLE, {**look.identity(), **about})
    with working(executor, workers) as hands, telling(progress) as tell:
        diagrams = []
        for number, (name, value) in enumerate(held):
            other = names[1 - names.index(name)]
            work = Work(traced, look.setting, hands, kept)
            sweeps = None if kept is None else kept.path / SWEEPS / str(number)
            at = {**values_of(system), name: value}
            diagrams.append(look.diagram(other, bounds[names.index(other)], at, work, tell, sweeps))
        growing = _Growing(
            Work(grown, look.setting, hands, kept), names, bounds, max_points, virtual, max_curves, tell
        )
        growing.grow(diagrams, held)
    (p, q), (first, second) = names, bounds
    found = BifurcationSet((p, q), (first, second), growing.found, diagrams, tuple(held), tuple(growing.lost))
    if kept is not None:
        write_group(kept.path, RESULT, found._item())
    return found


def _lines(lines: Any, names: list[str], bounds: list[Any]) -> list[tuple[str, float]]:
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


class _Growing:
    """Curves from the bifurcations of diagrams, in their order."""

    def __init__(self, work: Work, names, bounds, points, virtual, most, tell) -> None:
        self.work, self.names, self.most, self.tell = work, names, most, tell
        self.widths = np.array([high - low for low, high in bounds])
        self.common = {
            "ranges": dict(zip(names, map(list, bounds))), "most": points, "virtual": virtual, "steps": _CURVE,
        }  # fmt: skip
        self.found: list[Grown] = []
        self.lost: list[str] = []

    def grow(self, diagrams: list[Diagram], held: list[tuple[str, float]]) -> None:
        starts = [
            (b, found.parameter, (name, value))
            for found, (name, value) in zip(diagrams, held)
            for b in found.bifurcations
        ]
        others = Counter(b.kind for b, *_ in starts if condition_of(b.data) is None)
        self.lost += [f"{number} of {kind}: no curves of it are followed." for kind, number in others.items()]
        starts = [start for start in starts if condition_of(start[0].data) is not None]
        for number, start in enumerate(starts):
            if self.known(*start):
                continue
            if len(self.found) >= self.most:
                self.lost.append(f"{len(starts) - number} more bifurcations: `max_curves` ends the search.")
                return
            self.work.ask(itertools.islice(self.tasks(starts[number:]), self.work.workers.ahead))
            b, *_ = start
            item = self.work.result(self.task(b))
            at = self.at(*start)
            origin = f"{b.kind} at {self.names[0]} = {at[0]:.9g}, {self.names[1]} = {at[1]:.9g}"
            if item["about"]["lost"]:
                self.lost.append(f"{origin}: {item['about']['lost']}")
                continue
            curve = Grown(item["arrays"], item["about"], origin)
            if not self.same(curve):
                self.found.append(curve)
            self.tell(f"{len(self.found)} curves")

    def tasks(self, starts: Any) -> Iterator[Task]:
        return (self.task(start[0]) for start in starts if not self.known(*start))

    def task(self, b: Any) -> Task:
        return {"bifurcation": bare(b.data), **self.common}

    def at(self, b: Any, name: str, line: tuple[str, float]) -> np.ndarray:
        values = {name: b.parameter, line[0]: line[1]}
        return np.array([values[name] for name in self.names])

    def known(self, b: Any, name: str, line: tuple[str, float]) -> bool:
        at = self.at(b, name, line)
        kind = condition_of(b.data)
        return any(curve.holds(kind, at, b.points, self.widths, self.work.setting) for curve in self.found)

    def same(self, curve: Grown) -> bool:
        """Whether a curve is one that is known, of which two of its points say so."""
        number = curve.values.shape[1]
        return any(
            all(
                known.holds(
                    curve.kind, curve.values[:, k], curve.arrays["points"][k], self.widths, self.work.setting
                )
                for k in (number // 3, (2 * number) // 3)
            )
            for known in self.found
        )
