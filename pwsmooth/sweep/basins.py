"""Basins of attraction and orbit diagrams: where trajectories of a driven system end, over starts and parameters.

Both are sweeps (sweep/) of the stroboscopic map; the attractors found are refined by Newton's method (orbits.py), so
that a basin is the basin of a periodic orbit with known multipliers, and not of a cloud of points.
Chain: sweep, orbits.py -> **basins**.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..analysis.orbits import PeriodicOrbit, refine
from ..analysis.sections import Stroboscopic
from ..definition import checks
from ..definition.describe import Described, Rows, number
from ..paths.budget import whole
from ..results.records import Outcome

__all__ = ["FAILED", "UNSETTLED", "Basins", "OrbitDiagram", "basins", "orbit_diagram"]

#: Label of a start whose trajectory had not become periodic.
UNSETTLED = -1
#: Label of a start whose trajectory failed.
FAILED = -2


@dataclass(frozen=True, repr=False)
class Basins(Described):
    """Which attractor every start leads to.

    Attributes
    ----------
    axes : dict of str to ndarray, shape (number of values,)
        Name of a state -> its values, in its unit.
    labels : ndarray of int
        Index into `attractors`, dimensionless, of the shape of the axes; -1 where the trajectory had not become
        periodic, -2 where it failed.
    attractors : list of PeriodicOrbit
        In the order of the size of their basins.

    Examples
    --------
    Of x -> x + (x - x^3)/2 the fixed points -1 and 1 attract, and 0 separates:

    >>> import sympy as sp
    >>> from pwsmooth import Event, System, basins
    >>> t, x = sp.symbols("t x", real=True)
    >>> clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: x + (x - x**3) / 2})
    >>> found = basins(System({x: 0 * x}, time=t, events=[clock]), {x: [-0.5, 0.1, 0.2]}, 1, transient=60)
    >>> [round(float(found.attractors[k].x[0]), 6) for k in found.labels]
    [-1.0, 1.0, 1.0]
    """

    axes: dict[str, np.ndarray]
    labels: np.ndarray
    attractors: list[PeriodicOrbit]

    @property
    def shares(self) -> np.ndarray:
        """Part of the starts that each attractor takes."""
        return np.array([np.mean(self.labels == k) for k in range(len(self.attractors))])

    def plot(self, ax: Any = None, colours: Sequence[str] | None = None) -> Any:
        """The basins over the first two axes; further ones at their first value.

        Parameters
        ----------
        ax : Axes, optional
            Where to draw; a new figure by default.
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
            rows.append((f"{share:.1%}", [f"period {orbit.period:.9g}, multipliers {sizes}"]))
        for label, word in ((UNSETTLED, "unsettled"), (FAILED, "failed")):
            if share := np.mean(self.labels == label):
                rows.append((f"{share:.1%}", [word]))
        return f"Basins of {len(self.attractors)} attractors, from {starts}", rows


@checks.door(
    system=checks.system, axes=checks.mapping, start=checks.optional(checks.mapping), tol=checks.positive,
    transient=checks.integer(0), longest=checks.integer(1, 10_000),
)  # fmt: skip
@whole
def basins(
    system: Any,
    axes: Mapping[Any, Sequence[float]],
    period: Any,
    *,
    start: Mapping[Any, float] | None = None,
    transient: int = 200,
    longest: int = 8,
    tol: float = 1e-5,
    **options: Any,
) -> Basins:
    """Find the basins of attraction over a grid of starts.

    Parameters
    ----------
    system : System
        Driven with `period`.
    axes : mapping of state to sequence of float, any length
        The grid, in the units of the states.
    period : float or Expr, in the unit of the model's time
        Of the drive.
    start : mapping of state to float, optional
        Values of the states that are no axes, in their units.
    transient : int
        Periods before a trajectory is looked at.
    longest : int
        Longest orbit, in periods, that counts as periodic.
    tol : float, dimensionless
        How near to an orbit a trajectory has come after the transient, in states (relative to 1 + abs(x)).
    **options
        For `sweep`: executor, workers, store, rtol, ...; `max_steps` bounds each start and all that follows the
        sweep, `max_seconds` the whole call.

    Returns
    -------
    Basins
        Labels of the starts, and the attractors as orbits with multipliers.

    Notes
    -----
    A sweep of the stroboscopic map, whose ends are refined by Newton's method.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import Event, System, basins
    >>> t, x = sp.symbols("t x", real=True)
    >>> clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: x + (x - x**3) / 2})
    >>> found = basins(System({x: 0 * x}, time=t, events=[clock]), {x: [-0.5, 0.1, 0.2]}, 1, transient=60)
    >>> [f"{share:.3f}" for share in found.shares]
    ['0.667', '0.333']
    """
    from . import Period, Points, sweep

    period = checks.period(period, system.parameters)
    names = [s.name for s in system.model.states]
    data = sweep(
        system, axes, start=start, period=period, transient=transient, periods=2 * longest,
        measures=[Period(longest, tol), Points(*names, last=longest)], **{"progress": False, **options},
    )  # fmt: skip
    axis_values = {str(getattr(key, "name", key)): np.asarray(values, float) for key, values in axes.items()}
    shape = tuple(len(values) for values in axis_values.values())
    points = np.stack([data[f"{name}_points"].values for name in names], axis=-1).reshape(
        -1, longest, len(names)
    )
    cycle = data["period"].values.reshape(-1)
    labels = np.where(data["outcome"].values.reshape(-1) >= 0, UNSETTLED, FAILED)
    # The same section as the sweep's strobes: whole periods after its start time.
    base = Stroboscopic(system, period)
    attractors: list[PeriodicOrbit] = []
    strobes: list[np.ndarray] = []  # of each of them
    tried: list[tuple[int, np.ndarray]] = []
    for i in np.flatnonzero((cycle > 0) & (labels == UNSETTLED)):
        count, at = int(cycle[i]), points[i, -1]
        near = [k for k, points_of in enumerate(strobes) if any(_near(at, x, 10 * tol) for x in points_of)]
        if not near:
            if any(n == count and _near(at, x, tol) for n, x in tried):
                continue
            orbit = refine(replace(base, count=count), at)
            if not (orbit.success and orbit.stable and _near(orbit.x, at, 100 * tol)):
                tried.append((count, at))
                continue
            # It may be one of them that this start, still on its way to it, took for a longer one.
            near = [k for k, points_of in enumerate(strobes) if any(_near(orbit.x, x, tol) for x in points_of)]
            if not near:
                near = [len(attractors)]
                attractors.append(orbit)
                strobes.append(replace(orbit.map, count=1).iterate(orbit.x, orbit.map.count))
        labels[i] = near[0]
    order = np.argsort([-np.sum(labels == k) for k in range(len(attractors))], kind="stable")
    settled = labels >= 0
    labels[settled] = np.argsort(order)[labels[settled]]
    return Basins(axis_values, labels.reshape(shape), [attractors[k] for k in order])


def _near(a: np.ndarray, b: np.ndarray, tol: float) -> bool:
    return bool(np.all(np.abs(a - b) <= tol * (1 + np.abs(b))))


@dataclass(frozen=True, repr=False)
class OrbitDiagram(Described):
    """Points of the stroboscopic map over a parameter.

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

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import Event, System, orbit_diagram
    >>> x, t, c = sp.symbols("x t c", real=True)
    >>> logistic = System({x: 0*x}, time=t, parameters={c: 3}, events=[Event(every=1, update={x: c*x*(1 - x)})])
    >>> orbit_diagram(logistic, c, [2.5, 3.2], {x: 0.3}, 1, keep=4)["x"].shape
    (2, 4)
    """

    parameter: str
    values: np.ndarray
    states: tuple[str, ...]
    points: np.ndarray
    reasons: tuple[str, ...]

    def __getitem__(self, name: Any) -> np.ndarray:
        """Points of one state, shape (values, kept points)."""
        return self.points[:, :, self.states.index(str(name))]

    @property
    def failures(self) -> dict[str, np.ndarray]:
        """Why runs failed, in a word or two -> the values of the parameter at which they did, in its unit."""
        words = [reason.partition(":")[0] for reason in self.reasons]
        return {word: self.values[[w == word for w in words]] for word in dict.fromkeys(words) if word}

    def plot(self, ax: Any = None, name: Any = None, **marks: Any) -> Any:
        """The diagram of one state; where runs failed, a mark on the axis says why.

        Parameters
        ----------
        ax : Axes, optional
            Where to draw; a new figure by default.
        name : str or Symbol, optional
            The state, by default the first one.
        **marks
            For matplotlib's `plot`.

        Returns
        -------
        Axes
            The same.
        """
        from ..plotting import COLOUR, axes_for

        (ax,) = axes_for(ax, 1, (7.0, 3.6), "one diagram; give one")
        name = self.states[0] if name is None else name
        at = np.repeat(self.values, self.points.shape[1])
        dots = {
            "color": COLOUR["exact"],
            "marker": ".",
            "markersize": 1.2,
            "linestyle": "none",
            "rasterized": True,
        }
        ax.plot(at, self[name].ravel(), **{**dots, **marks})
        on_axis = {"marker": "|", "linestyle": "none", "transform": ax.get_xaxis_transform()}
        for (word, failed), colour in zip(
            self.failures.items(), itertools.cycle(("left", "right", "fast", "mark"))
        ):
            ax.plot(failed, 0 * failed, color=COLOUR[colour], label=word, **on_axis)
        if self.failures:
            ax.legend()
        ax.set(xlabel=self.parameter, ylabel=f"{name}, once a period")
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
    system=checks.system, values=checks.numbers, start=checks.mapping, transient=checks.integer(0),
    keep=checks.integer(1, 10**7), carry=checks.flag,
)  # fmt: skip
@whole
def orbit_diagram(
    system: Any,
    parameter: Any,
    values: Sequence[float],
    start: Mapping[Any, float],
    period: Any,
    *,
    transient: int = 200,
    keep: int = 40,
    carry: bool = False,
    **options: Any,
) -> OrbitDiagram:
    """Find where the stroboscopic map settles, over a parameter.

    Parameters
    ----------
    system : System
        Driven with `period`.
    parameter : str or Symbol
        Of the system.
    values : sequence of float, any length
        In the unit of the parameter.
    start : mapping of state to float
        Of every run or, with `carry`, of the first one, in the units of the states.
    period : float or Expr, in the unit of the model's time
        Of the drive.
    transient, keep : int
        Periods unseen, and then shown.
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

    Examples
    --------
    The logistic map, before and after its first period doubling:

    >>> import sympy as sp
    >>> from pwsmooth import Event, System, orbit_diagram
    >>> x, t, c = sp.symbols("x t c", real=True)
    >>> logistic = System({x: 0*x}, time=t, parameters={c: 3}, events=[Event(every=1, update={x: c*x*(1 - x)})])
    >>> shown = orbit_diagram(logistic, c, [2.5, 3.2], {x: 0.3}, 1, carry=True, keep=4)
    >>> [len(set(row.round(6))) for row in shown["x"]]
    [1, 2]
    """
    name = checks.lookup(parameter, system.parameters, "`parameter`", "parameter").name
    at_values, period = np.asarray(values), checks.period(period, system.parameters)
    states = tuple(s.name for s in system.model.states)
    if not carry:
        from . import Points, sweep

        found = sweep(
            system, {name: at_values.tolist()}, start=start, period=period, transient=transient, periods=keep,
            measures=[Points(*states, last=keep)], **{"progress": False, **options},
        )  # fmt: skip
        points = np.stack([found[f"{s}_points"].values for s in states], axis=-1)
        return OrbitDiagram(
            name, at_values, states, points, tuple(map(_reason, found["outcome"].values.tolist()))
        )
    at = np.array(system.initial_state(start), float)
    points, reasons = np.full((len(at_values), keep, len(states)), np.nan), []
    for k, value in enumerate(at_values):
        step = Stroboscopic(system.with_parameters({name: value}), period, options=options)
        points[k], reason = step._iterated(at, keep, transient)
        reasons.append(reason)
        if np.isfinite(points[k, -1]).all():
            at = points[k, -1]
    return OrbitDiagram(name, at_values, states, points, tuple(reasons))


def _reason(outcome: int) -> str:
    """Why a point of a sweep did not finish, from its code; empty if it did."""
    texts = {int(o): str(o) for o in Outcome} | {int(Outcome.FINISHED): ""}
    return texts.get(outcome, "the system refuses this value of the parameter or start.")
