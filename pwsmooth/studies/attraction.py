"""Basins of attraction and orbit diagrams: where trajectories end, over starts and parameters.

Both are sweeps of a Poincare map, stroboscopic or of returns to a section; attractors are refined by Newton's
method (attractors.py), so that a basin is the basin of a periodic orbit with known multipliers, and not of a cloud of
points.
Chain: sweep, attractors.py -> **basins**.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..analysis.lyapunov import lyapunov_exponents
from ..analysis.maps.scales import scale_along
from ..analysis.maps.sections import poincare_map
from ..analysis.maps.seen import Return, Strobe, how_seen
from ..analysis.orbits.periodic_orbit import PeriodicOrbit
from ..definition.lambdified import numpy_function
from ..door import calls, checks
from ..door.describe import Described, Rows, number
from ..paths.budget import whole
from ..results.records import Outcome
from .attractors import FAILED, UNSETTLED, Attractors, Ends
from .axes import read_axes
from .chunk import run_chunk
from .kinds import FAILURE, NOT_SETTLED, kind_of, kinds_of, rests
from .measures import Period, Points
from .plan import why_not
from .refining import SweepPlan, in_chunks, make_plan, ordered
from .sweeping import sweep
from .work import Work

__all__ = ["Basins", "OrbitDiagram", "basins", "orbit_diagram", "refine_basins"]

_TURNS = 6  # periods or returns between two looks at where a trajectory is
_SCOUTS = 8  # starts that look for the first attractors, and for the units of the states
_RESTING = 64  # starts without a return that are looked at for a rest
_ATOL = 1e-12  # solve's own, of a state of size 1


@checks.door()
@dataclass(frozen=True, repr=False)
class Basins(Described):
    """Which attractor every start leads to.

    Attributes
    ----------
    axes : dict of str to ndarray, shape (number of values,)
        Name of a state or parameter -> its values, in its unit.
    labels : ndarray of int
        Index into `attractors`, dimensionless, of the shape of the axes; -1 where the trajectory had not become
        periodic, -2 where it failed.
    attractors : list of PeriodicOrbit
        In the order of the size of their basins, each with the parameters of its system: along an axis of a parameter
        each value has its own.
    reasons : ndarray of str, dimensionless, of the shape of the axes
        Why a start has no attractor, in words that begin with "slow", "unsettled", "rest", "running", "no return" or
        the name of the outcome; empty where it has one.
    kinds : ndarray of str, dimensionless, of the shape of the axes
        What a start comes to: "rest", "orbit of period n", "running: ..." by how much, "quasi-periodic",
        "chaotic: ..." with its exponent, "not settled" or "failed".

    Of x -> x + (x - x^3)/2 the fixed points -1 and 1 attract, and 0 separates:

    >>> t, x = sp.symbols("t x", real=True)
    >>> clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: x + (x - x**3) / 2})
    >>> found = basins(System({x: 0 * x}, time=t, events=[clock]), {x: [-0.5, 0.1, 0.2]}, Strobe(1), transient=60)
    >>> [round(float(found.attractors[k].x[0]), 6) for k in found.labels]
    [-1.0, 1.0, 1.0]
    """

    axes: dict[str, np.ndarray]
    labels: np.ndarray
    attractors: list[PeriodicOrbit]
    reasons: np.ndarray
    kinds: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """Part of the starts that each attractor takes."""
        return np.array([np.mean(self.labels == k) for k in range(len(self.attractors))])

    def plot(self, ax: Any = None, colours: Sequence[str] | None = None) -> Any:
        """The basins over the first two axes; further ones at their first value.

        Parameters
        ----------
        colours : sequence of str, optional
            One for each attractor.

        Returns
        -------
        Axes
            The same, with a legend of the attractors, and of starts that are unsettled or failed.
        """
        from ..plotting import areas

        names = {k: f"{k + 1}: period {orbit.period:.6g}" for k, orbit in enumerate(self.attractors)}
        return areas(self.axes, self.labels, names | {UNSETTLED: "unsettled", FAILED: "failed"}, ax, colours)

    def _described(self) -> tuple[str, Rows]:
        starts = " x ".join(f"{len(values)} {name}" for name, values in self.axes.items())
        rows: list[tuple[str, list[str]]] = []
        for orbit, share in zip(self.attractors, self.shares):
            sizes = ", ".join(map(number, orbit.multipliers))
            kind = f"{kind_of(orbit)}, " if orbit.rest or orbit.map.count > 1 else ""
            rows.append((f"{share:.1%}", [f"{kind}period {orbit.period:.9g}, multipliers {sizes}"]))
        kinds, numbers = np.unique(self.kinds[self.labels < 0].astype(str), return_counts=True)
        rows += [
            (f"{many / self.kinds.size:.1%}", [kind]) for kind, many in zip(kinds.tolist(), numbers.tolist())
        ]
        attractors = f"{len(self.attractors)} attractor{'s' * (len(self.attractors) != 1)}"
        return f"Basins of {attractors}, from {starts}", rows


@checks.door(
    calls.SWEEPS,
    system=checks.system, axes=checks.mapping, x0=checks.optional(checks.mapping), tol=checks.positive,
    transient=checks.integer(0), max_count=checks.integer(1, 10_000), seen=how_seen,
    work=checks.optional(checks.instance(Work, "Work(...)")),
)  # fmt: skip
@whole
def basins(
    system: Any,
    axes: Mapping[Any, Sequence[float]],
    seen: Strobe | Return,
    *,
    x0: Mapping[Any, float] | None = None,
    transient: int = 200,
    max_count: int = 8,
    tol: float = 1e-5,
    work: Work | None = None,
    **options: Any,
) -> Basins:
    """Find the basins of attraction over a grid of starts.

    Parameters
    ----------
    transient : int
        Periods or returns before a trajectory is looked at. Slow ones are led on (see Notes).
    tol : float, dimensionless
        How near to an orbit a trajectory has come after the transient, relative to the size of the states.
    **options
        For `sweep`: rtol, parameters, ...; `max_steps` bounds each start and all that follows
        the sweep, `max_seconds` the whole call.

    Returns
    -------
    Basins
        Labels of the starts, and the attractors as orbits with multipliers.

    Raises
    ------
    ValueError, TypeError
        Bad input: axes without a state, a store for several values of a parameter, and what `sweep` refuses.

    Notes
    -----
    A sweep of the Poincare map, whose ends are refined by Newton's method. Starts that have not settled are led on,
    while more of them do, for up to 11 times as long and 800 periods or returns. Newton's method begins at the fixed
    point of the affine map that their points obey; a start belongs to an orbit that attracts and draws it in: whose
    quadratic Lyapunov function falls step by step through 200 of them. These further runs are in no store.

    >>> t, x = sp.symbols("t x", real=True)
    >>> clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: x + (x - x**3) / 2})
    >>> found = basins(System({x: 0 * x}, time=t, events=[clock]), {x: [-0.5, 0.1, 0.2]}, Strobe(1), transient=60)
    >>> [f"{share:.3f}" for share in found.shares]
    ['0.667', '0.333']

    Of two circles of an autonomous system that attract, of radius 1 and 3, the circle of radius 2 separates the basins:

    >>> x, y = sp.symbols("x y", real=True)
    >>> r2 = x**2 + y**2
    >>> growth = (1 - r2) * (4 - r2) * (9 - r2) / 20
    >>> circles = System({x: growth * x - y, y: growth * y + x})
    >>> found = basins(circles, {x: [0.5, 1.9, 2.1]}, x0={y: 0}, seen=Return(y), transient=20)
    >>> [f"{sp.Float(found.attractors[k].x[0], 4)}" for k in found.labels]
    ['1.000', '1.000', '3.000']
    """
    where = read_axes(system, axes, None)
    if strangers := [name for name, kind in where.kinds.items() if kind not in ("state", "parameter")]:
        raise ValueError(
            f"`axes` names {strangers[0]!r}, which is no state or parameter; give starts and parameters."
        )
    columns, moved = where.columns(0, where.size), {s.name for s in system.states}
    starts = {name: column for name, column in columns.items() if name in moved}
    fixed = {str(key): value for key, value in (x0 or {}).items()}
    for name in [name for name, value in fixed.items() if getattr(value, "free_symbols", None)]:
        starts[name] = _following(fixed.pop(name), name, columns)
    labels = np.full(where.size, UNSETTLED)
    reasons, kinds = np.full(where.size, "", object), np.full(where.size, "", object)
    attractors: list[PeriodicOrbit] = []
    values = [name for name in columns if name not in moved]
    if values and work is not None and work.store is not None:
        raise ValueError("`work` has a store, but `axes` has a parameter; keep a store for each of its values.")
    if not starts:
        raise ValueError("`axes` has no state; give starts, such as {x: [0.0, 1.0]}, or use orbit_diagram().")
    chosen = np.unique(np.stack([columns[name] for name in values]), axis=1).T if values else [()]
    for one in chosen:
        here = np.all(
            [columns[name] == value for name, value in zip(values, one)] or [labels == UNSETTLED], axis=0
        )
        at_value = system.with_parameters(dict(zip(values, map(float, one)))) if values else system
        search = _Search(at_value, seen, max_count, tol, options, work)
        grid = (axes, {}) if not values and len(starts) == len(columns) else (
            None, {"points": {name: column[here] for name, column in starts.items()}}
        )  # fmt: skip
        begun = _starts(at_value, fixed, {name: column[here] for name, column in starts.items()})
        search.take_units(begun)
        first = search.ends(grid[0], 2 * max_count, 2 * max_count + 1, x0=fixed, transient=transient, **grid[1])
        own, reasons[here], left = search.attractors.label(first, transient, search.lead_on)
        kinds[here] = search.kinds(own, reasons[here], left, begun)
        orbits, own = search.attractors.by_size(own)
        labels[here] = np.where(own >= 0, own + len(attractors), own)
        attractors += orbits
    order = np.argsort([-np.sum(labels == k) for k in range(len(attractors))], kind="stable")
    labels = np.where(labels >= 0, np.argsort(order)[np.maximum(labels, 0)] if len(order) else labels, labels)
    axis_values = {name: values for name, (_, values) in where.values.items()}
    return Basins(
        axis_values, labels.reshape(where.shape), [attractors[k] for k in order], reasons.reshape(where.shape),
        kinds.reshape(where.shape),
    )  # fmt: skip


def _starts(system: Any, fixed: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Starts (number, n) in the order of the states."""
    names = [s.name for s in system.states]
    first = {name: float(column[0]) for name, column in columns.items()}
    starts = np.tile(
        np.array(system.initial_state({**fixed, **first}), float), (len(next(iter(columns.values()))), 1)
    )
    for name, column in columns.items():
        starts[:, names.index(name)] = column
    return starts


def _following(value: Any, name: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Starts of a state that follow the axes."""
    known = {str(s): s for s in value.free_symbols}
    if strangers := sorted(known.keys() - columns.keys()):
        raise ValueError(
            f"`x0` of {name!r} is {value}, in which {strangers[0]!r} has no axis; write it with "
            f"{checks.listing(columns)}."
        )
    symbols = tuple(known.values())
    found = numpy_function(symbols, value)(*(columns[str(s)] for s in symbols))
    return np.broadcast_to(np.asarray(found, float), next(iter(columns.values())).shape)


class _Search:
    """Runs of the Poincare map of one system, and the attractors that they have led to."""

    def __init__(
        self, system: Any, seen: Strobe | Return, max_count: int, tol: float, options: Mapping[str, Any],
        work: Work | None = None,
    ) -> None:  # fmt: skip
        base = poincare_map(system, seen, {})
        self.system, self.seen, self.max_count, self.options = system, seen, max_count, dict(options)
        self.names = [s.name for s in system.model.states]
        self.work = replace(work or Work(), progress=bool(work and work.progress))
        self.attractors = Attractors(base, max_count, tol)

    def take_units(self, starts: np.ndarray) -> None:
        """Take the units of the states from what the map makes of some starts (number, n)."""
        some = starts[np.unique(np.linspace(0, len(starts) - 1, _SCOUTS).astype(int))]
        ends = [image for image in map(self.attractors.map.image, some) if image.success]
        if not ends:
            return
        scale = scale_along([run for image in ends for run in image.runs], np.empty((0, 0)))
        self.attractors.map = self.attractors.map._with(scale=scale)
        if scale is not None and "atol" not in self.options:
            self.options = {**self.options, "atol": [_ATOL * unit for unit in scale.unit]}

    def measures(self, kept: int) -> list[Any]:
        return [Period(self.max_count, self.attractors.tol), Points(*self.names, last=kept)]

    def ends(self, grid: Any, seen: int, kept: int, **more: Any) -> Ends:
        data = sweep(
            self.system, grid, seen=self.seen, periods=seen, measures=self.measures(kept),
            **{"work": self.work, **self.options, **more},
        )  # fmt: skip
        return self.read({str(name): values.values for name, values in data.items()})

    def read(self, values: Mapping[str, np.ndarray]) -> Ends:
        points = np.stack([values[f"{name}_points"] for name in self.names], axis=-1)
        points = points.reshape(-1, *points.shape[-2:])
        cycle, outcome = (values[name].reshape(-1) for name in ("period", "outcome"))
        if self.attractors.map.scale is not None:
            # What the runs count as a repetition is one in states of size 1.
            detector, unit = Period(self.max_count, self.attractors.tol), self.attractors.map.unit
            cycle = np.where(cycle < 0, cycle, [detector.find(x, unit) for x in points])
        return Ends(points, cycle, outcome)

    def kinds(
        self, labels: np.ndarray, reasons: np.ndarray, left: Mapping[int, np.ndarray], starts: np.ndarray
    ) -> np.ndarray:
        """What each start comes to, by name; `left` are the last points of those that no orbit has drawn in."""
        map_, found = self.attractors.map, self.attractors.found
        orbits = [kind_of(known.orbit) for known in found]
        kinds = np.array(
            [orbits[k] if k >= 0 else FAILURE if k == FAILED else NOT_SETTLED for k in labels], object
        )
        waiting = [i for i in left if labels[i] == UNSETTLED]
        kinds[waiting] = kinds_of(map_, [left[i] for i in waiting])
        for i, reason in enumerate(reasons):
            kinds[i] = (
                reason if reason.startswith("running") else "rest" if reason.startswith("rest") else kinds[i]
            )
        still = [
            i for i, reason in enumerate(reasons) if labels[i] == UNSETTLED and reason.startswith("no return")
        ]
        for i in still[:_RESTING]:
            kinds[i] = "rest" if rests(map_, starts[i]) else NOT_SETTLED
        return kinds

    def lead_on(self, starts: np.ndarray, unseen: int) -> Ends:
        window, again = self.attractors.window, dict(zip(self.names, starts.T))
        return self.ends(
            None, window, window, points=again, transient=unseen, work=replace(self.work, store=None)
        )


@checks.door(
    calls.POINTS,
    system=checks.system, axes=checks.mapping, x0=checks.optional(checks.mapping), tol=checks.positive,
    transient=checks.integer(0), max_count=checks.integer(1, 10_000), seen=how_seen,
)  # fmt: skip
def refine_basins(
    system: Any,
    axes: Mapping[Any, Sequence[float]],
    seen: Strobe | Return,
    *,
    x0: Mapping[Any, float] | None = None,
    transient: int = 200,
    max_count: int = 8,
    tol: float = 1e-5,
    order: Iterable[int] | None = None,
    max_seconds: float | None = None,
    **options: Any,
) -> Iterator[tuple[np.ndarray, np.ndarray, list[PeriodicOrbit]]]:
    """Find basins chunk by chunk, the coarse picture first, for as long as it is wanted.

    As `basins`, which runs all starts to the end: here a trajectory is finished as soon as an attractor that is known
    draws it in from a thousandth away, mostly after a dozen periods.

    Parameters
    ----------
    transient : int
        Periods or returns after which a trajectory that no known attractor has drawn in is looked at as `basins` does.
    tol : float, dimensionless
        As of `basins`.
    order : iterable of int, optional
        Numbers of the starts to run, the last axis fastest, in this order; by default as of `sweep.refine`, which says
        what an iterator is good for.
    **options
        rtol, atol, method, max_step, max_steps, parameters of `solve`.

    Returns
    -------
    iterator of (ndarray of int, shape (k,), ndarray of int, shape (k,), list of PeriodicOrbit)
        Numbers of starts in a chunk, their labels as in `Basins`, and the attractors found so far, to which labels are
        indices: each confirmed by Newton's method, and never renumbered.

    Raises
    ------
    ValueError, TypeError
        Bad input, as `basins` and `sweep.refine` say it.

    >>> t, x = sp.symbols("t x", real=True)
    >>> clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: x + (x - x**3) / 2})
    >>> cubic = System({x: 0 * x}, time=t, events=[clock])
    >>> grid = {x: np.linspace(-0.5, 0.5, 100)}
    >>> for indices, labels, attractors in refine_basins(cubic, grid, Strobe(1), transient=60):
    ...     print(len(indices), sorted(round(float(orbit.x[0]), 6) for orbit in attractors))
    ...     break
    40 [-1.0, 1.0]
    """
    search = _Search(system, seen, max_count, tol, options)
    plan = functools.partial(
        make_plan, system, axes, x0=x0, seen=seen, transient=transient, periods=2 * max_count,
        measures=search.measures(2 * max_count + 1),
    )  # fmt: skip
    planned = plan(**options)
    if strangers := [name for name, kind in planned.where.kinds.items() if kind != "state"]:
        raise ValueError(f"`axes` names {strangers[0]!r}, which is no state; a basin is a set of starts.")
    columns = planned.where.at(np.unique(np.linspace(0, planned.where.size - 1, _SCOUTS).astype(int)))
    search.take_units(_starts(system, dict(zip(search.names, planned.plan.start)), columns))
    if search.options != options:
        planned = plan(**search.options)
    numbers, most = ordered(planned, order), checks.optional(checks.positive)(max_seconds, "`max_seconds`")
    return in_chunks(functools.partial(_arrivals, search, planned), numbers, most)


def _arrivals(
    search: _Search, planned: SweepPlan, numbers: np.ndarray
) -> tuple[np.ndarray, list[PeriodicOrbit]]:
    """Labels of the starts of these numbers, and the attractors so far."""
    # Where no attractor is known all would run to the end: a few look for the first ones.
    parts = [numbers] if search.attractors.found else np.split(numbers, [_SCOUTS])
    labels = [_labels(search, planned, part) for part in parts]
    return np.concatenate(labels), [known.orbit for known in search.attractors.found]


def _labels(search: _Search, planned: SweepPlan, numbers: np.ndarray) -> np.ndarray:
    """Of the starts of these numbers: which attractor has drawn each of them in."""
    names, attractors = search.names, search.attractors
    plan = replace(planned.plan, kinds=tuple((name, "state") for name in names))
    x = np.tile(np.array(plan.start), (len(numbers), 1))
    for name, column in planned.where.at(numbers).items():
        x[:, names.index(name)] = column

    def strobes(rows: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        going = replace(
            plan,
            transient=0,
            periods=count,
            measures=(Points(*names),),
            setting=replace(plan.setting, periods=count),
        )
        found = run_chunk(going, dict(zip(names, x[rows].T)))
        return np.stack([found[f"{name}_points"] for name in names], axis=-1), found["outcome"]

    labels, rows, done = np.full(len(numbers), UNSETTLED), np.arange(len(numbers)), 0
    lost: list[np.ndarray] = []
    # A few periods at a time, later as many as before; of a longer cycle so many that one of its points is met twice.
    least = max([_TURNS, *(2 * known.orbit.map.count + 1 for known in attractors.found)])
    while attractors.found and len(rows) and done + (count := max(least, done // 2)) <= plan.transient:
        points, outcome = strobes(rows, count)
        sound = outcome == Outcome.FINISHED
        lost.append(rows[~sound])
        rows, points = rows[sound], points[sound]
        x[rows], labels[rows] = points[:, -1], attractors.arrived(points)
        rows, done = rows[labels[rows] == UNSETTLED], done + count
    rows = np.concatenate([*lost, rows])
    if len(rows):
        rest = replace(plan, transient=plan.transient - done)
        ends = search.read(run_chunk(rest, dict(zip(names, x[rows].T))))
        labels[rows], _, _ = attractors.label(ends, plan.transient, search.lead_on)
    return labels


@checks.door()
@dataclass(frozen=True, repr=False)
class OrbitDiagram(Described):
    """Points of the Poincare map over a parameter.

    Indexing gives the points of one state, shape (number of values, kept points).

    Attributes
    ----------
    parameter : str
        Its name.
    values : ndarray, shape (number of values,)
        In the unit of the parameter.
    states : tuple of str
        Their names.
    points : ndarray, shape (number of values, kept points, n)
        In the units of the states; nan where a run failed.
    reasons : tuple of str
        For each value why its run ended before its time, in words; empty where it did not.
    seen : Strobe or Return, optional
        How the points were seen.
    system : System or None
        Of which; `exponents` needs it.

    >>> x, t, c = sp.symbols("x t c", real=True)
    >>> logistic = System({x: 0*x}, time=t, parameters={c: 3}, events=[Event(every=1, update={x: c*x*(1 - x)})])
    >>> orbit_diagram(logistic, c, [2.5, 3.2], {x: 0.3}, Strobe(1), keep=4)["x"].shape
    (2, 4)
    """

    parameter: str
    values: np.ndarray
    states: tuple[str, ...]
    points: np.ndarray
    reasons: tuple[str, ...]
    seen: Strobe | Return | None = None
    system: Any = None

    @checks.door(calls.RUNS, time=checks.positive, transient=checks.nonnegative)
    def exponents(self, time: float, *, transient: float = 0.0, count: int = 1, **options: Any) -> np.ndarray:
        """Lyapunov exponents of what the diagram shows, from the last point at every value.

        Parameters
        ----------
        time : float, in the unit of the model's time
            Length of the average.
        transient : float, in the unit of the model's time
            Before it.
        count : int
            How many, 1 to the number of states.
        **options
            For `solve`; `max_steps` and `max_seconds` bound each run.

        Returns
        -------
        ndarray, shape (number of values, count)
            Largest first, in units of 1/time; nan where the run of the diagram failed.

        Raises
        ------
        ValueError
            A diagram without its system.

        Notes
        -----
        Of a driven system the runs begin at the phase of the points. Along an autonomous flow one is 0.

        Source: Mueller, Chaos, Solitons & Fractals, 1995 (`lyapunov_exponents`).
        """
        if self.system is None:
            raise ValueError("this diagram has no `system`; make it by orbit_diagram().")
        found = np.full((len(self.values), count), np.nan)
        for row, value, x in zip(found, self.values.tolist(), self.points[:, -1]):
            if np.isfinite(x).all():
                system = self.system.with_parameters({self.parameter: value})
                begin = poincare_map(system, self.seen, {}).start_time if isinstance(self.seen, Strobe) else 0.0
                row[:] = lyapunov_exponents(
                    system, x.tolist(), time, transient=transient, start_time=begin, count=count, **options
                ).exponents
        return found

    def __contains__(self, name: Any) -> bool:
        """Whether indexing takes a name (or Symbol)."""
        return str(checks.named(name)) in self.states

    def __getitem__(self, name: Any) -> np.ndarray:
        """Points of one state, shape (values, kept points)."""
        name = str(checks.named(name))
        if name not in self.states:
            raise KeyError(f"{name!r} is no state of this diagram; they are {', '.join(self.states)}.")
        return self.points[:, :, self.states.index(name)]

    @property
    def failures(self) -> dict[str, np.ndarray]:
        """Why runs failed, in a word or two -> the values of the parameter at which they did, in its unit."""
        words = [reason.partition(":")[0] for reason in self.reasons]
        return {word: self.values[[w == word for w in words]] for word in dict.fromkeys(words) if word}

    def plot(self, ax: Any = None, name: Any = None, **marks: Any) -> Any:
        """The diagram of one state; where runs failed, a mark on the axis says why.

        Parameters
        ----------
        name : str or Symbol, optional
            The state, by default the first one.
        **marks
            For matplotlib's `plot`.

        Returns
        -------
        Axes
            Where it was drawn.

        Raises
        ------
        KeyError
            No state of that name.
        """
        from ..plotting import COLOUR, axes_for

        name = self.states[0] if name is None else name
        points = self[name]
        (ax,) = axes_for(ax, 1, (7.0, 3.6), "one diagram; give one")
        at = np.repeat(self.values, self.points.shape[1])
        dots = {
            "color": COLOUR["exact"],
            "marker": ".",
            "markersize": 1.2,
            "linestyle": "none",
            "rasterized": True,
        }
        ax.plot(at, points.ravel(), **{**dots, **marks})
        on_axis = {"marker": "|", "linestyle": "none", "transform": ax.get_xaxis_transform()}
        for (word, failed), colour in zip(
            self.failures.items(), itertools.cycle(("left", "right", "fast", "mark"))
        ):
            ax.plot(failed, 0 * failed, color=COLOUR[colour], label=word, **on_axis)
        if self.failures:
            ax.legend()
        ax.set(
            xlabel=self.parameter,
            ylabel=f"{name}, once a {'return' if isinstance(self.seen, Return) else 'period'}",
        )
        return ax

    def _described(self) -> tuple[str, Rows]:
        count, kept, _ = self.points.shape
        span = f"{self.values.min():.9g} to {self.values.max():.9g}"
        return f"OrbitDiagram of {', '.join(self.states)} over {self.parameter}", {
            "values": [f"{count}, {span}"],
            "kept": [f"{kept} points of each"],
            "failed": [f"{len(at)} {word}, first at {at[0]:.9g}" for word, at in self.failures.items()],
        }.items()


@checks.door(
    calls.SWEEPS,
    system=checks.system, values=checks.numbers, x0=checks.mapping, transient=checks.integer(0),
    keep=checks.integer(1, 10**7), carry=checks.flag, seen=how_seen,
    work=checks.optional(checks.instance(Work, "Work(...)")),
)  # fmt: skip
@whole
def orbit_diagram(
    system: Any,
    parameter: Any,
    values: Sequence[float],
    x0: Mapping[Any, float],
    seen: Strobe | Return,
    *,
    transient: int = 200,
    keep: int = 40,
    carry: bool = False,
    work: Work | None = None,
    **options: Any,
) -> OrbitDiagram:
    """Find where the Poincare map settles, over a parameter.

    Parameters
    ----------
    parameter : str or Symbol
        Of the system.
    values : sequence of float, any length
        In the unit of the parameter.
    x0 : mapping of state to float
        Of every run or, with `carry`, of the first one, in the units of the states.
    transient, keep : int
        Periods or returns unseen, and then shown.
    carry : bool
        Begin each run where the one before ended: follows an attractor and shows hysteresis when the values come
        back. Without it all runs are independent and use all cores.
    **options
        For `sweep`, or for `solve` with `carry`.

    Returns
    -------
    OrbitDiagram
        The points.

    Raises
    ------
    ValueError, TypeError
        No parameter of that name; bad input, as `sweep` says it.

    The logistic map, before and after its first period doubling:

    >>> x, t, c = sp.symbols("x t c", real=True)
    >>> logistic = System({x: 0*x}, time=t, parameters={c: 3}, events=[Event(every=1, update={x: c*x*(1 - x)})])
    >>> shown = orbit_diagram(logistic, c, [2.5, 3.2], {x: 0.3}, Strobe(1), carry=True, keep=4)
    >>> [len(set(row.round(6))) for row in shown["x"]]
    [1, 2]

    Without a drive, by a section: the amplitude of an oscillator that friction drives is in proportion to the friction.

    >>> x, u, f = sp.symbols("x u f", real=True)
    >>> driven = System({x: u, u: -x - u/5 + f*sp.sign(u)}, parameters={f: 1})
    >>> orbit_diagram(driven, f, [1, 2], {x: 3, u: 0}, Return(u, -1), keep=1)["x"].round(4).tolist()
    [[6.3868], [12.7736]]
    """
    name = checks.lookup(parameter, system.parameters, "`parameter`", "parameter").name
    at_values = np.asarray(values)
    if carry and (idle := sorted([*options.keys() - set(calls.RUNS), *["work"] * (work is not None)])):
        raise ValueError(f"`{idle[0]}` is for independent runs; leave it out, or `carry`.")
    base = poincare_map(system, seen, options if carry else {})
    states = tuple(s.name for s in system.model.states)
    if not carry:
        found = sweep(
            system, {name: at_values.tolist()}, x0=x0, seen=seen, transient=transient, periods=keep,
            measures=[Points(*states, last=keep)], work=work or Work(progress=False), **options,
        )  # fmt: skip
        points = np.stack([found[f"{s}_points"].values for s in states], axis=-1)
        reasons = [why_not(outcome) for outcome in found["outcome"].values.tolist()]
        return OrbitDiagram(name, at_values, states, points, tuple(reasons), seen, system)
    at = np.array(system.initial_state(x0), float)
    points, reasons = np.full((len(at_values), keep, len(states)), np.nan), list[str]()
    for k, value in enumerate(at_values):
        step = base.with_parameters({name: value})
        points[k], reason = step._iterated(at, keep, transient)
        reasons.append(reason)
        if np.isfinite(points[k, -1]).all():
            at = points[k, -1]
    return OrbitDiagram(name, at_values, states, points, tuple(reasons), seen, system)
