"""Curves in two parameters along which a bifurcation of periodic orbits persists.

    P(x; p, q) = x,   c(x, p, q, e) = 0,   tau . (u - u0) = ds,   u = (x, p/scale, q/scale, e)

c says which bifurcation (conditions.py); points at which a second condition holds are located and named. Every orbit is
one of the exact system: where the itinerary changes the curve says so, and ends where the bifurcation does.

Chain: bifurcations.py, conditions.py -> **curves**.
"""

from __future__ import annotations

import copy
import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.describe import Described, Rows
from ..paths.budget import MOST_STEPS, Budget, opened, within
from .arclength import Point, Walk, full_rank, quiet_time, tangent_of, value_of
from .bifurcations import Bifurcation, change_enclosed, of_no_effect, zero_between
from .conditions import (
    TOGETHER,
    Arrival,
    AtEvent,
    Border,
    BranchPoint,
    Condition,
    Critical,
    Exit,
    Place,
    Torus,
    Touch,
    differences,
)  # fmt: skip
from .itineraries import Change, change_between, same_itinerary
from .orbits import TOLERANCE, PeriodicOrbit, onto_section, refine
from .sections import Section, Stroboscopic
from .windows import FromImpact, PartedImage, Windowed, from_impact, recentred, touching

if TYPE_CHECKING:
    import pandas

__all__ = ["Codimension2", "Curve", "follow_curve"]

_COUNTED = 2**62
_MOST_NEWTON = 8
_CONVERGED, _ROUNDED = 1e-12, 1e-9  # of the unknowns: what the last correction is, and may be where it stays so
_BRACKET = 1e-10  # of the arc, in which the end of a curve is enclosed
_MOST_HALVED = 100
_FAR, _PARTS = (
    0.1,
    10,
)  # of the scaled unknowns: Newton's method is not trusted so far from a start; the steps instead
_REPEATED = 1e-6  # to which an orbit beside grazing comes back
_BESIDE = 1e-6  # of the scaled parameters: so far beyond a change of itinerary it is looked at
ADDING = "adding-sliding"
TOUCHES = ("grazing impact", "grazing", "grazing-sliding", "grazing of an event", ADDING)
BORDER = "border collision"
EXITS = ("exit by a fold",)
ARRIVALS = ("crossing-sliding", "switching-sliding")
SMOOTH = ("fold", "flip", "symmetry breaking", "torus", "branch point")

FOLLOWED = (*SMOOTH, *TOUCHES, *ARRIVALS, *EXITS)


@dataclass(frozen=True)
class Spot(Point):
    """A point of a curve: u = (x, p/scale, q/scale, e), what its own unknowns e are, and its test functions."""

    extra: np.ndarray = field(default_factory=lambda: np.empty(0))
    tests: Mapping[str, float] = field(default_factory=dict)
    twin: bool = False


@dataclass(frozen=True)
class Codimension2:
    """A point of a curve at which a second condition holds.

    Attributes
    ----------
    name : str
        "cusp", "1:1 resonance" to "1:4 resonance", "fold + flip", or two conditions that meet.
    values : dict of str to float, in the units of the parameters
        Both parameters.
    orbit : PeriodicOrbit
        At the point, or the last one before it where the curve ends there.
    note : str
        What else is to be said.

    Notes
    -----
    Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the smooth ones; di Bernardo, Budd, Champneys,
    Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the others.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import Event, System, find_orbit, follow, follow_curve
    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> step = Event(every=1, update={x: a + b * x - x**3})
    >>> cubic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 1.8}, events=[step])
    >>> orbit = find_orbit(cubic, {x: 1.2}, period=1, phase=0.5)
    >>> fold = follow(orbit, a, to=-1).of_kind("fold")[0]
    >>> (cusp,) = follow_curve(fold, {a: (-1, 1), b: (0, 2)}).of_kind("cusp")
    >>> print(f"{abs(cusp.values['a']):.6f} {cusp.values['b']:.6f}")
    0.000000 1.000000
    """

    name: str
    values: dict[str, float]
    orbit: PeriodicOrbit
    note: str = ""

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value:.10g}" for name, value in self.values.items())
        return f"{self.name} at {where}" + (f": {self.note}" if self.note else "")


@dataclass(repr=False)
class Curve(Described):
    """A curve of bifurcations in two parameters.

    Attributes
    ----------
    kind : str
        Of the bifurcation, as of `Bifurcation`.
    parameters : tuple of str
        The names of both.
    orbits : list of PeriodicOrbit
        In order along the curve.
    points : list of Codimension2
        Where a second condition holds, in order along the curve.
    ends : tuple of str
        Why it ended in either direction, in words; one of them where it closes.
    tests : dict of str to ndarray, each of shape (number of orbits,), dimensionless
        Functions along the curve that vanish at points of codimension 2, by their names.

    Notes
    -----
    Source: Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000, for the test functions.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import Event, System, find_orbit, follow, follow_curve
    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> step = Event(every=1, update={x: a - x**2 + b * x})
    >>> quadratic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
    >>> (flip,) = follow(find_orbit(quadratic, {x: 0.3}, period=1, phase=0.5), a, to=1).bifurcations
    >>> curve = follow_curve(flip, {a: (-1, 2), b: (-1, 1)})
    >>> curve.ends
    ('reached b = -1.', 'reached b = 1.')
    >>> p, q = curve.values
    >>> bool(abs(4 * p - (1 + q) * (3 - q)).max() < 1e-8)  # of x = (1 + b)/2
    True
    """

    kind: str
    parameters: tuple[str, str]
    orbits: list[PeriodicOrbit] = field(default_factory=list)
    points: list[Codimension2] = field(default_factory=list)
    ends: tuple[str, ...] = ()
    tests: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def values(self) -> np.ndarray:
        """Both parameters along the curve, shape (2, number of orbits), in their units."""
        return np.array([[value_of(orbit, name) for orbit in self.orbits] for name in self.parameters])

    @property
    def x(self) -> np.ndarray:
        """Points on the section, shape (n, number of orbits), in the units of the states."""
        return np.array([orbit.x for orbit in self.orbits]).T

    @property
    def admissible(self) -> np.ndarray:
        """Whether each orbit is one of the exact system, which all are unless `virtual` ones were asked for."""
        return np.array([orbit.success for orbit in self.orbits])

    def of_kind(self, name: str) -> list[Codimension2]:
        """Points of one name.

        Parameters
        ----------
        name : str
            As of `Codimension2`.

        Returns
        -------
        list of Codimension2
            In order along the curve.
        """
        return [point for point in self.points if point.name == name]

    def to_dataframe(self) -> pandas.DataFrame:
        """The orbits as a table.

        Returns
        -------
        pandas.DataFrame
            A row an orbit: both parameters, the point on the section, the period, the largest modulus of its
            multipliers, and the test functions.
        """
        import pandas

        names = [str(s) for s in self.orbits[0].system.states]
        return pandas.DataFrame(
            {
                **dict(zip(self.parameters, self.values)),
                **dict(zip(names, self.x)),
                "period": [orbit.period for orbit in self.orbits],
                "largest_multiplier": [abs(orbit.multipliers).max(initial=0.0) for orbit in self.orbits],
                **self.tests,
            }
        )

    def plot(self, ax: Any = None, **line: Any) -> Any:
        """The curve in the plane of its parameters, points of codimension 2 marked.

        Parameters
        ----------
        ax : Axes, optional
            Where to draw; a new figure by default.
        **line
            For `Axes.plot`.

        Returns
        -------
        Axes
            The same.
        """
        from ..plotting import COLOUR, axes_for

        (ax,) = axes_for(ax, 1, (5.5, 3.6), "one curve; give one")
        known = np.where(self.admissible, self.values, np.nan)
        ax.plot(*known, **{"color": COLOUR["exact"], "label": self.kind, **line})
        if not self.admissible.all():
            ax.plot(*self.values, **{"color": COLOUR["exact"], "linestyle": ":", "label": "virtual", **line})
        for name, mark in zip(dict.fromkeys(p.name for p in self.points), itertools.cycle("osD^vP*X")):
            at = [list(point.values.values()) for point in self.of_kind(name)]
            ax.plot(*zip(*at), mark, color=COLOUR["left"], fillstyle="none", label=name)
        ax.legend()
        ax.set(xlabel=self.parameters[0], ylabel=self.parameters[1])
        return ax

    def _described(self) -> tuple[str, Rows]:
        spans = [f"{q.min():.9g} to {q.max():.9g}" for q in self.values] if self.orbits else ["", ""]
        return f"Curve of {self.kind}: {len(self.orbits)} orbits", {
            "over": [f"{name} from {span}" for name, span in zip(self.parameters, spans)],
            "admissible": [] if self.admissible.all() else [f"{self.admissible.sum()} of {len(self.orbits)}"],
            "points": [str(point) for point in self.points],
            "ends": list(self.ends),
        }.items()


class CurveWalk(Walk):
    """Predictor and corrector in the space of states, two parameters and the condition's own unknowns."""

    def __init__(
        self, map_: Any, condition: Condition, names: tuple[str, str], scales: np.ndarray, n: int
    ) -> None:
        self.map: Any = map_
        self.condition, self.names, self.n = condition, names, n
        self.sizes = np.concatenate([np.ones(n), scales, np.ones(condition.extras)])
        self.offset: Any = 0.0  # what c is, on the way to a first point

    def place(self, w: np.ndarray) -> Place | None:
        """F and its slopes at w = (x, p, q), not scaled; None where the trajectory does not return."""
        x, n = w[: self.n], self.n
        try:
            here = self.map.with_parameters(dict(zip(self.names, map(float, w[n : n + 2]))))
        except ValueError:  # outside the assumptions of a parameter
            return None
        image = here.image(x, self.names)
        if not image.success:
            return None
        DF = np.column_stack([image.jacobian - np.eye(n), image.by_parameter])
        return Place(here, image, x, image.x - x, DF, self.names) if np.isfinite(DF).all() else None

    def slopes(self, place: Place, w: np.ndarray) -> np.ndarray | None:
        """Of the condition by (x, p, q, e), not scaled."""
        condition, extra = self.condition, w[self.n + 2 :]
        exact = condition.slopes(place, extra)
        if exact is not None:
            return exact
        found = differences(self.place, place, w[: self.n + 2], lambda there: condition.value(there, extra))
        if found is None or not condition.extras:
            return found
        h = 1e-6
        own = [
            (condition.value(place, extra + h * e) - condition.value(place, extra - h * e)) / (2 * h)
            for e in np.eye(condition.extras)
        ]
        return np.column_stack([found, *own])

    def correct(
        self, guess: np.ndarray, normal: np.ndarray | None, direction: np.ndarray | None
    ) -> Spot | None:
        """Newton's method in the plane normal . (u - guess) = 0, or to the nearest point without one."""
        try:
            return self._corrected(guess, normal, direction)
        except np.linalg.LinAlgError:
            return None

    def _corrected(
        self, guess: np.ndarray, normal: np.ndarray | None, direction: np.ndarray | None
    ) -> Spot | None:
        condition, n, u, last, slopes = self.condition, self.n, guess, math.inf, None
        for steps in range(_MOST_NEWTON + 1):
            w = u * self.sizes
            place = self.place(w[: n + 2])
            if place is None:
                return None
            extra = w[n + 2 :]
            # From the second step on the slopes are near enough: each evaluation runs 2 (n + 2) orbits.
            if steps < 2 or normal is None:
                slopes = self.slopes(place, w)
            if slopes is None:
                return None
            G = np.concatenate(
                [place.F + condition.unfolding(extra), condition.value(place, extra) - self.offset]
            )
            DG = np.vstack([np.hstack([place.DF, condition.unfolding_slopes(n)]), slopes]) * self.sizes
            rows, right = DG, -G
            if normal is not None:
                rows, right = np.vstack([DG, normal]), np.append(right, -normal @ (u - guess))
            if not (np.isfinite(rows).all() and np.isfinite(right).all()):
                return None
            move = np.linalg.lstsq(rows, right, rcond=1e-14)[0]
            off = float(np.abs(G[:n] / (1 + np.abs(w[:n]))).max(initial=0.0))
            size = float(np.abs(move / (1 + np.abs(u))).max())
            if not np.isfinite(size):
                return None
            stands = size > 0.3 * last and size <= _ROUNDED  # roundings are all that moves it
            if off <= TOLERANCE and (size <= _CONVERGED or stands):
                orbit = _orbit(condition, place, off, steps)
                tangent = tangent_of(DG, np.ones(len(u)) if direction is None else direction)
                tests = condition.tests(place, extra, slopes)
                return Spot(
                    u,
                    tangent,
                    orbit,
                    place.image.solution,
                    steps,
                    full_rank(DG),
                    extra,
                    tests,
                    condition.twin(place),
                )
            if steps == _MOST_NEWTON or size > 10 * last:
                return None
            last = size
            u = u + move
            if isinstance(_exact(place.map), Section):
                u = np.concatenate([onto_section(_exact(place.map), u[:n]), u[n:]])
        return None

    def framed(self, here: Spot) -> None:
        """Lets the condition follow to a point that has been reached."""
        place = self.place((here.u * self.sizes)[: self.n + 2])
        if place is not None:
            self.condition.frame(place, here.extra)

    def parameters(self, here: Spot) -> dict[str, float]:
        return {name: value_of(here.orbit, name) for name in self.names}

    def rephased(self, here: Any) -> Any:
        """The same orbit on a section at which it slips, where its own one sticks or an event has come near to it."""
        if isinstance(self.condition, AtEvent):
            return self._retimed(here)
        if isinstance(self.map, Windowed):
            return self._recentred(here)
        if isinstance(self.map, FromImpact):
            found = from_impact(here.orbit.map, here.orbit.x)
            if found is not None:
                self.map = dataclasses.replace(self.map, behind=found[0].behind, before=found[0].before)
            return here
        map_ = here.orbit.map
        # The way on is told from the parameters, which a cusp has not.
        told = np.linalg.norm(here.tangent[self.n : self.n + 2]) > 1e-3
        time = quiet_time(here.run, map_.forcing_period) if isinstance(map_, Stroboscopic) and told else None
        if time is None:
            return here
        part = map_.solved(here.orbit.x, time, map_.system)
        orbit = refine(map_.at_phase(time / map_.forcing_period), part.x[:, -1])
        return self._turned(here, orbit.map, orbit.x) if orbit.success else here

    def _retimed(self, here: Spot) -> Spot:
        """The same orbit on a section far from events, and the number of the one that matters counted from there."""
        map_, run = here.orbit.map, here.run
        if not isinstance(map_, Stroboscopic):
            return here
        time = quiet_time(run, map_.forcing_period)
        if time is None:
            return here
        condition = self.condition
        assert isinstance(condition, AtEvent)
        old = condition.ordinal
        count = len(condition.events(run))
        before = sum(run.events[k].time < time for k in condition.events(run))
        there = map_.solved(here.orbit.x, time, map_.system)
        condition.ordinal = (old - before) % count
        found = self._turned(here, Windowed(map_.at_phase(time / map_.forcing_period)), there.x[:, -1])
        if found is here:
            condition.ordinal = old
        return found

    def _recentred(self, here: Spot) -> Spot:
        """The same orbit with the window about its own approach."""
        place = self.place((here.u * self.sizes)[: self.n + 2])
        if place is None or place.map.window is None:
            return here
        map_, window, near = place.map, place.map.window, place.image.approach
        T, begins = (map_.forcing_period, map_.start_time) if map_.driven else (1.0, 0.0)
        part = ((near.place - begins) / T - window.begin) / (window.end - window.begin)
        if map_.driven and 0.3 < part < 0.7:
            self.map = dataclasses.replace(
                self.map, window=dataclasses.replace(window, near=(near.place - begins) / T)
            )
            return here
        return self._turned(here, *recentred(map_, place.image.runs, near.place, window, T, begins))

    def _turned(self, here: Spot, map_: Any, x: np.ndarray) -> Spot:
        """The same point with another map and its point there."""
        turned = copy.copy(self)
        turned.map = map_
        turned.condition = copy.deepcopy(self.condition)
        u = np.concatenate([x, here.u[self.n :]])
        place = turned.place((u * self.sizes)[: self.n + 2])
        if place is None:
            return here
        turned.condition.start(place)
        there = turned.correct(u, None, np.concatenate([np.zeros(self.n), here.tangent[self.n :]]))
        if there is None:
            return here
        self.map, self.condition = turned.map, turned.condition
        return there

    def at(self, near: Spot, other: Spot, index: int, value: float) -> Spot | None:
        """The point between two at which an entry of u has a value."""
        way = other.u - near.u
        guess = near.u + way * (value - near.u[index]) / way[index]
        guess[index] = value
        normal = np.zeros(len(guess))
        normal[index] = 1.0
        return self.correct(guess, normal, near.tangent)


def _exact(map_: Any) -> Any:
    return map_.base if isinstance(map_, (Windowed, FromImpact)) else map_


def _orbit(condition: Condition, place: Place, off: float, steps: int) -> PeriodicOrbit:
    """The orbit at a point of a curve, as one of the exact map."""
    map_, x, image, word = _exact(place.map), place.x, place.image, condition.word(place)
    if isinstance(place.map, FromImpact):
        map_, x = place.map.exact(x, image)
        exact = map_.image(x, ())
        # Of an impact without speed there is no exact map: what it was made from has the multipliers.
        if exact.success:
            image, off = exact, float(np.abs((exact.x - x) / (1 + np.abs(x))).max())
            word = image.word
    found = off <= _REPEATED and condition.admissible(place)
    message = "continued" if found else "virtual: it is none of the exact system"
    return PeriodicOrbit(
        map_, x, off, image.jacobian, word, image.time, steps, found, message, image.degenerate
    )


def condition_of(kind: str, name: str, names: tuple[str, str], event: Any) -> Condition:
    """The condition that a bifurcation of this kind, found over the parameter `name`, puts on its curve."""
    if kind == BORDER:
        return Border(event)
    if event is not None:
        return (Arrival if kind in ARRIVALS else Exit)(kind, *event)
    if kind == "torus":
        return Torus()
    if kind in TOUCHES:
        return Touch(kind)
    if kind == "branch point":
        return BranchPoint(names.index(name) if name in names else 0)
    return Critical(kind, 1 if kind == "fold" else -1)


@checks.door(
    start=checks.instance((Bifurcation, PeriodicOrbit), "a Bifurcation of a branch, or a PeriodicOrbit near to one"),
    ranges=checks.mapping, virtual=checks.flag, most=checks.integer(1),
    kind=checks.optional(checks.one_of(*SMOOTH, *TOUCHES, BORDER)),
    **dict.fromkeys(("step", "longest_step", "shortest_step"), checks.positive),
)  # fmt: skip
def follow_curve(
    start: Bifurcation | PeriodicOrbit,
    ranges: Mapping[Any, Any],
    *,
    kind: str | None = None,
    switch: Any = None,
    virtual: bool = False,
    step: float = 0.01,
    longest_step: float = 0.05,
    shortest_step: float = 1e-6,
    most: int = 500,
    max_steps: int = 10 * MOST_STEPS,
    max_seconds: float | None = None,
) -> Curve:
    """Follow a bifurcation over two parameters, to both sides.

    Parameters
    ----------
    start : Bifurcation or PeriodicOrbit
        One of a branch's `bifurcations`; or an orbit near to one, whose `kind` is given.
    ranges : mapping of (str or Symbol) to (float, float), in the units of the parameters
        The two parameters, each with the least and the largest value.
    kind : str, optional
        Of an orbit: "fold", "flip", "symmetry breaking", "torus" or "branch point"; or, on the side that does not touch
        it, "grazing impact", "grazing", "grazing-sliding", "grazing of an event" or "adding-sliding"; or
        "border collision".
    switch : Switch, Symbol, str or Expr, optional
        Of an orbit that is about to graze: the switch, contact or event. Of a border collision: h(x), of states and
        parameters, which is 0 at the orbit's point on its section.
    virtual : bool
        Go on where orbits are none of the exact system, whose impact has a negative speed or which have crossed a
        surface that they graze: their `success` is False.
    step, longest_step, shortest_step : float, in units of the arc
        Of the arc in (x, p/width, q/width), the widths being those of `ranges`.
    most : int
        Largest number of orbits to either side.
    max_steps, max_seconds : int, float (s), optional
        Bounds of the whole curve, looked at after each orbit: what was followed until then is returned.

    Returns
    -------
    Curve
        Orbits, points of codimension 2, and why it ended.

    Raises
    ------
    ValueError, TypeError
        A bifurcation of a kind that has no condition here, no two parameters, a start outside the ranges.

    Notes
    -----
    Source: Keller's arclength continuation (1977); Govaerts, Numerical Methods for Bifurcations of Dynamical
    Equilibria, 2000, for bordered test functions; Kuznetsov, Elements of Applied Bifurcation Theory, for the names.

    Examples
    --------
    The flip of the Henon map, 4 a = 3 (1 - b)**2:

    >>> import sympy as sp
    >>> from pwsmooth import Event, System, find_orbit, follow, follow_curve
    >>> t, x, y, a, b = sp.symbols("t x y a b", real=True)
    >>> step = Event(every=1, update={x: 1 - a * x**2 + y, y: b * x})
    >>> henon = System({x: 0 * x, y: 0 * y}, time=t, parameters={a: 0.1, b: 0.3}, events=[step])
    >>> orbit = find_orbit(henon, {x: 0.6, y: 0.2}, period=1, phase=0.5)
    >>> (flip,) = follow(orbit, a, to=0.6).of_kind("flip")
    >>> curve = follow_curve(flip, {a: (0, 2), b: (-0.5, 0.5)})
    >>> p, q = curve.values
    >>> bool(abs(4 * p - 3 * (1 - q) ** 2).max() < 1e-8)
    True
    """
    orbit, kind, name, map_, x, event = _given(start, kind, switch)
    known = orbit.system.parameters
    names = tuple(checks.lookup(key, known, "`ranges`", "parameter").name for key in ranges)
    if len(set(names)) != 2:
        raise ValueError(f"`ranges` names {', '.join(map(str, ranges)) or 'nothing'}; give two parameters.")
    both = (names[0], names[1])
    bounds = np.array([checks.interval(pair, f"`ranges` of {key}") for key, pair in ranges.items()])
    first = np.array([value_of(orbit, q) for q in names])
    if not np.all((bounds[:, 0] <= first) & (first <= bounds[:, 1])):
        at = ", ".join(f"{q} = {value:.9g}" for q, value in zip(names, first))
        raise ValueError(f"`ranges` leaves out the start, {at}; give ranges that hold it.")
    budget = opened(max_steps, max_seconds)
    lengths = step, longest_step, shortest_step
    with within(Budget(_COUNTED)) as counted:
        return _both_sides(
            map_, x, condition_of(kind, name, both, event), both, bounds, lengths, most, virtual,
            lambda: _COUNTED - counted.left >= budget.left or budget.late(),
        )  # fmt: skip


def _given(
    start: Bifurcation | PeriodicOrbit, kind: str | None, switch: Any
) -> tuple[PeriodicOrbit, str, str, Any, np.ndarray, Any]:
    """The orbit, its kind, over which parameter it was found, the map, its point there, and the event that matters."""
    followed = ", ".join(FOLLOWED)
    if isinstance(start, Bifurcation):
        if kind is not None and kind != start.kind:
            raise ValueError(f"`kind` is {kind!r}, but `start` is a {start.kind}; leave `kind` out.")
        if start.kind not in FOLLOWED:
            raise ValueError(f"`start` is a {start.kind}; followed are {followed}.")
        orbit, kind, name, phase = start.orbit, start.kind, start.name, None
        if start.change is not None and start.kind in (*ARRIVALS, *EXITS):
            return orbit, kind, name, *_at_event(start)
        if start.kind in TOUCHES and start.change is not None:
            change, phase = start.change, start.change.time
            letters = max(change.before, change.after, key=len)
            switch = letters[0].switch
            if len(change.before) > len(change.after) and start.beyond is not None:
                orbit = start.beyond
    else:
        if not start.success:
            raise ValueError(f"`start` did not converge: {start.message}")
        if kind is None:
            raise ValueError(f"`kind` is missing: `start` is an orbit; give one of {followed}.")
        orbit, name, phase = start, "", None
    if kind == BORDER:
        model = orbit.system.model
        known = {s.name: s for s in (*model.states, *orbit.system.parameters)}
        border = checks.expression(switch, "`switch`", known)
        if not border.free_symbols & set(model.states) or border.free_symbols - {*known.values()}:
            raise ValueError(f"`switch` is {border}; give a function of states {checks.listing(model.states)}.")
        return orbit, kind, name, orbit.map, orbit.x, border
    if kind not in TOUCHES:
        # Beside a slow impact DP has no bound; the motion from impact to impact has.
        found = from_impact(orbit.map, orbit.x) if kind in ("fold", "flip") else None
        return orbit, kind, name, *(found or (orbit.map, orbit.x)), None
    model = orbit.system.model
    names = [str(mu.symbol) for mu in model.multipliers if mu.surface is not None]
    names += [event.name for event in model.events if event.surface is not None and not event.singular]
    switch = names[0] if switch is None and len(names) == 1 else switch
    if str(switch) not in names:
        said = checks.shown(switch)
        raise ValueError(f"`switch` is {said}; give the one that is touched, of {', '.join(names) or 'none'}.")
    hidden = {str(mu.symbol) for mu in model.multipliers if mu.hidden}
    if kind == ADDING and str(switch) in hidden:
        raise ValueError(
            f"`start` is an {kind} of {switch}, whose hidden term has several roots; it is not followed."
        )
    window = touching(orbit.map, orbit.x, str(switch), phase, kind == ADDING)
    if isinstance(window, str):
        raise ValueError(f"`start` grazes nothing: {window}.")
    return orbit, kind, name, *window, None


def _at_event(start: Bifurcation) -> tuple[Windowed, np.ndarray, tuple[str, int]]:
    """The map in one piece, the point on its section, and the event at which the itinerary changes."""
    orbit, change = start.orbit, start.change
    assert change is not None
    switch = change.before[0].switch
    map_ = Windowed(orbit.map)
    image = map_.image(orbit.x, ())
    if not isinstance(image, PartedImage):
        raise ValueError(f"`start` is a {start.kind} of an orbit that is not run through: {image.reason}")
    run = image.parts[0].run
    if any(layer.ratio != sp.oo for layer in run.model.layer_states):
        raise ValueError(
            f"`start` is a {start.kind} of a layered view, whose layer has states; these are not followed."
        )
    probe = (Arrival if start.kind in ARRIVALS else Exit)(start.kind, switch, 0)
    part = 0.5 if orbit.symmetric else 1.0
    times = [(run.events[k].time - run.t[0]) / orbit.period for k in probe.events(run)]
    off = [abs((t - change.before[0].time + part / 2) % part - part / 2) for t in times]
    if not off or min(off) > 3 * TOGETHER:
        raise ValueError(
            f"`start` is a {start.kind} whose event is not found in its orbit; start from another one."
        )
    return map_, orbit.x, (switch, int(np.argmin(off)))


def _both_sides(map_, x, condition, names, bounds, lengths, most, virtual, used_up) -> Curve:
    curve, n = Curve(condition.kind, names), len(x)
    widths = bounds[:, 1] - bounds[:, 0]
    walk = CurveWalk(map_, condition, names, widths, n)
    given = {p.name: value for p, value in map_.system.parameters.items()}
    w = np.append(x, [given[q] for q in names])
    place = walk.place(w)
    if place is None:
        curve.ends = ("no orbit was found at the start.",)
        return curve
    u = np.append(w, condition.start(place)) / walk.sizes
    # The nearest point, or that with one of the parameters as it is: Newton's method may lead far from a far start.
    off = condition.value(place, u[n + 2 :])
    tried = [_nearer(walk, u, normal, off) for normal in (None, *np.eye(len(u))[n : n + 2])]
    middle = bounds.mean(axis=1) / widths
    inside = [s for s in tried if s is not None and np.all(np.abs(s.u[n : n + 2] - middle) <= 0.5 + 1e-9)]
    if not inside:
        curve.ends = (f"no {condition.kind} was found near to the start.",)
        return curve
    first = min(inside, key=lambda spot: np.linalg.norm(spot.u[n : n + 2] - u[n : n + 2]))
    walk.framed(first)
    again = walk.correct(first.u, None, first.tangent)
    first = again or first
    sides: list[tuple[list[Spot], list[Codimension2], str]] = []
    for sign in (-1.0, 1.0):
        side = copy.copy(walk)
        side.condition = copy.deepcopy(condition)
        here = copy.copy(first)
        object.__setattr__(here, "tangent", sign * first.tangent)
        way = _Way(side, bounds, lengths, most, virtual, used_up)
        sides.append(way.followed(here))
        if way.closed:
            break
    back, on = sides[0], sides[1] if len(sides) == 2 else ([first], [], "")
    spots = [*back[0][:0:-1], *on[0]]
    curve.orbits = [spot.orbit for spot in spots]
    curve.points = [*back[1][::-1], *on[1]]
    curve.ends = tuple(end for end in (back[2], on[2]) if end)
    curve.tests = {name: np.array([spot.tests.get(name, math.nan) for spot in spots]) for name in first.tests}
    return curve


def _nearer(walk: CurveWalk, u: np.ndarray, normal: np.ndarray | None, off: np.ndarray) -> Spot | None:
    """The first point of a curve, at once or with c in parts of what it is at the start; `normal` keeps an entry."""
    spot = walk.correct(u, normal, None)
    if spot is not None and np.linalg.norm(spot.u - u) < _FAR:
        return spot
    way = copy.copy(walk)
    for part in np.linspace(1, 0, _PARTS + 1)[1:]:
        way.offset = part * off
        near = way.correct(u, normal, None)
        if near is None:
            return spot
        u, spot_at_part = near.u, near
    return spot_at_part


class _Way:
    """A curve to one side."""

    def __init__(
        self, walk: CurveWalk, bounds: np.ndarray, lengths: Any, most: int, virtual: bool, used_up: Any
    ) -> None:
        self.walk, self.bounds, self.lengths, self.most, self.used_up = walk, bounds, lengths, most, used_up
        self.virtual = virtual
        self.points: list[Codimension2] = []
        self.closed = False

    def followed(self, here: Spot) -> tuple[list[Spot], list[Codimension2], str]:
        step, longest, shortest = self.lengths
        walk, spots, ds = self.walk, [here], min(step, longest)
        while len(spots) < self.most:
            where = _where(walk, here)
            if self.used_up():
                return self._ended(spots, f"`max_steps` or `max_seconds` are used up at {where}: give more.")
            if not here.alone:
                return self._ended(spots, f"at {where} no single way leads on: two curves meet there.")
            there = self._stepped(here, ds)
            if there is None:
                if ds > shortest:
                    ds *= 0.3
                    continue
                here = self._last(here, ds)
                spots.append(here)
                why, change = self._lost(here)
                beyond = self._beyond(here, change) if self.virtual else None
                if beyond is None:
                    return self._ended(spots, why)
                here, ds = beyond, step
                continue
            there, reached = self._within(here, there)
            if there is None:
                return self._ended(spots, f"no orbit was found at {reached}.")
            if end := self._between(here, there):
                last, why = end
                return self._ended([*spots, last], why)
            spots.append(there)
            if reached:
                return self._ended(spots, f"reached {reached}.")
            if self._closes(spots):
                self.closed = True
                return self._ended(spots, "it closes.")
            ds = min(ds * (2.0 if there.steps <= 3 else 1.0 if there.steps <= 5 else 0.5), longest)
            walk.framed(there)
            here = walk.rephased(there)
        return self._ended(spots, f"stopped after {len(spots)} orbits (`most`).")

    def _stepped(self, here: Spot, ds: float) -> Any:
        """One step, no further than the border of the ranges: beyond it a parameter may have no meaning."""
        walk, n = self.walk, self.walk.n
        ways = []
        for k in (0, 1):
            rate = here.tangent[n + k]
            border = self.bounds[k][int(rate > 0)] / walk.sizes[n + k]
            if rate and 0 < (border - here.u[n + k]) / rate < ds:
                ways.append(((border - here.u[n + k]) / rate, n + k, border))
        if not ways:
            return walk.step(here, ds)
        reach, index, border = min(ways)
        guess = here.u + reach * here.tangent
        guess[index] = border
        normal = np.zeros(len(guess))
        normal[index] = 1.0
        there = walk.correct(guess, normal, here.tangent)
        return (
            there
            if there is not None and np.linalg.norm(there.u - here.u) <= 2 * reach
            else walk.step(here, ds)
        )

    def _ended(self, spots: list[Spot], why: str) -> tuple[list[Spot], list[Codimension2], str]:
        return spots, self.points, why

    def _within(self, here: Spot, there: Spot) -> tuple[Spot | None, str]:
        """The point, or that on the border of the ranges which the way to it passes, and the border in words."""
        n, walk = self.walk.n, self.walk
        for k in (0, 1):
            u, scale = there.u[n + k], walk.sizes[n + k]
            low, high = self.bounds[k] / scale
            past = high if u >= high and u > here.u[n + k] else low if u <= low and u < here.u[n + k] else None
            if past is not None and u != past:
                at = walk.at(here, there, n + k, past)
                return at, f"{walk.names[k]} = {past * scale:.9g}"
            if past is not None:
                return there, f"{walk.names[k]} = {past * scale:.9g}"
        return there, ""

    def _between(self, here: Spot, there: Spot) -> tuple[Spot, str] | None:
        """Locates what happens on the way between two points; where and why the curve ends there, if it does."""
        walk, found = self.walk, []
        for name in here.tests:
            a, b = here.tests[name], there.tests.get(name, math.nan)
            if not a * b < 0:
                continue
            spot = zero_between(walk, here, there, _test(name))
            if spot is not None and abs(spot.tests[name]) <= 0.01 * (abs(a) + abs(b)):
                why = walk.condition.ends(name)
                found.append((spot, name, why))
        chord = there.u - here.u
        for spot, name, why in sorted(found, key=lambda f: (f[0].u - here.u) @ chord):
            self.points.append(Codimension2(name, walk.parameters(spot), spot.orbit, why))
            if why and not (self.virtual and "virtual" in why):
                return spot, f"{name} at {_where(walk, spot)}: {why}."
        if there.twin and not here.twin:
            name = f"{walk.condition.kind} twice"
            spot = self._before_twins(here, there)
            why = "from there on it holds at two events at once, as along symmetric orbits: follow these by `symmetry`"
            self.points.append(Codimension2(name, walk.parameters(spot), spot.orbit, why))
            return spot, f"{name} at {_where(walk, spot)}: {why}."
        if not same_itinerary(here.orbit, there.orbit):
            left, right, _ = change_enclosed(walk, here, there)
            change = change_between(left.orbit, right.orbit)
            if not of_no_effect(change, left.orbit, right.orbit):
                name = f"{walk.condition.kind} + {change.name}"
                note = "it goes on with another itinerary"
                self.points.append(Codimension2(name, walk.parameters(left), left.orbit, note))
        return None

    def _before_twins(self, here: Spot, there: Spot) -> Spot:
        """The last point at which it holds at one event alone: chords lead from one curve to the other there."""
        ds = 0.5 * float(np.linalg.norm(there.u - here.u))
        for _ in range(_MOST_HALVED):
            if ds <= _BRACKET:
                break
            spot: Any = self.walk.step(here, ds)
            if spot is None or spot.twin:
                ds *= 0.5
            else:
                here = spot
        return here

    def _last(self, here: Spot, ds: float) -> Spot:
        """The last point of the curve, no further than `ds` from here, by bisection."""
        low, high, last = 0.0, ds, here
        while high - low > _BRACKET:
            middle = 0.5 * (low + high)
            spot: Any = self.walk.step(here, middle)
            low, high, last = (low, middle, last) if spot is None else (middle, high, spot)
        return last

    def _beyond(self, here: Spot, change: Change | None) -> Spot | None:
        """The same point of a map that does not see the surface which the orbit begins to touch."""
        if change is None or change.name not in TOUCHES or len(change.before) > len(change.after):
            return None
        window = touching(here.orbit.map, here.orbit.x, change.after[0].switch, change.time)
        if isinstance(window, str):
            return None
        there = self.walk._turned(here, *window)
        return None if there is here else there

    def _lost(self, here: Spot) -> tuple[str, Change | None]:
        """What keeps the curve from going on, in words: a change of itinerary beside its end, as a rule."""
        walk, n = self.walk, self.walk.n
        where = _where(walk, here)
        for reach in (_BESIDE, 10 * _BESIDE, 100 * _BESIDE):
            ahead = ((here.u + reach * here.tangent) * walk.sizes)[n : n + 2]
            try:
                map_ = here.orbit.map.with_parameters(dict(zip(walk.names, map(float, ahead))))
            except ValueError:  # outside the assumptions of a parameter
                continue
            beyond = refine(map_, here.orbit.x)
            if not beyond.success or same_itinerary(here.orbit, beyond):
                continue
            change = change_between(here.orbit, beyond)
            name = f"{walk.condition.kind} + {change.name}"
            self.points.append(Codimension2(name, walk.parameters(here), here.orbit, str(change)))
            why = f"beyond it the orbit has another itinerary, and no {walk.condition.kind} beside."
            return f"{name} at {where}: {why}", change
        return f"no orbit was found beyond {where} with steps down to {self.lengths[2]:.1g}.", None

    def _closes(self, spots: list[Spot]) -> bool:
        """Whether the last step has passed the first point, along the same way."""
        if len(spots) < 5:
            return False
        n, first, a, b = self.walk.n, spots[0], spots[-2], spots[-1]
        pq = slice(n, n + 2)
        chord, to = b.u[pq] - a.u[pq], first.u[pq] - a.u[pq]
        length = float(chord @ chord)
        if length == 0 or not 0 <= to @ chord <= length:
            return False
        aside = np.linalg.norm(to - chord * (to @ chord) / length)
        along = first.tangent[pq] @ chord > 0.8 * np.linalg.norm(first.tangent[pq]) * math.sqrt(length)
        one, other = (np.abs(s.orbit.map_multipliers) for s in (first, b))
        same = np.allclose(one, other, rtol=0.1, atol=0.1)
        return bool(aside < 0.2 * math.sqrt(length) and along and same)


def _test(name: str) -> Callable[[Spot], float]:
    return lambda spot: spot.tests[name]


def _where(walk: CurveWalk, here: Spot) -> str:
    return ", ".join(f"{name} = {value:.10g}" for name, value in walk.parameters(here).items())
