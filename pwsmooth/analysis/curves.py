"""Curves in two parameters along which a bifurcation of periodic orbits persists.

    P(x; p, q) = x,   c(x, p, q, e) = 0,   tau . (u - u0) = ds,   u = (x, p/scale, q/scale, e)

c says which bifurcation (conditions.py); points at which a second condition holds are located and named. Every orbit is
one of the exact system: where the itinerary changes the curve says so, and ends where the bifurcation does.

Chain: curve_ways.py -> **curves**.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.describe import Described, Rows
from ..paths.budget import MOST_STEPS, Budget, opened, within
from .arclength import value_of
from .bifurcations import Bifurcation
from .conditions import BranchPoint, Condition, Critical, Torus
from .curve_walk import CurveWalk, Spot
from .curve_ways import TOUCHES, Codimension2, Way
from .impacts import from_impact
from .orbits import PeriodicOrbit
from .recutting import Cut, of_orbit, touched
from .tangencies import TOGETHER, Arrival, Border, Exit, Touch
from .windows import PartedImage, Windowed

if TYPE_CHECKING:
    import pandas

__all__ = ["Codimension2", "Curve", "follow_curve"]

_COUNTED = 2**62
_FAR, _PARTS = (
    0.1,
    10,
)  # of the scaled unknowns: Newton's method is not trusted so far from a start; the steps instead
ADDING, BORDER = "adding-sliding", "border collision"
EXITS = ("exit by a fold",)
ARRIVALS = ("crossing-sliding", "switching-sliding")
SMOOTH = ("fold", "flip", "symmetry breaking", "torus", "branch point")
FOLLOWED = (*SMOOTH, *TOUCHES, *ARRIVALS, *EXITS)


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
    turns : list of Codimension2
        Where it turns back in one of the parameters, in order along the curve; no bifurcations, but the largest and
        smallest values at which they exist.
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
    turns: list[Codimension2] = field(default_factory=list)
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
            "turns": [str(point) for point in self.turns],
            "ends": list(self.ends),
        }.items()


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
    orbit, kind, name, first_of, event = _given(start, kind, switch)
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
            first_of, condition_of(kind, name, both, event), both, bounds, lengths, most, virtual,
            lambda: _COUNTED - counted.left >= budget.left or budget.late(),
        )  # fmt: skip


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


def _given(
    start: Bifurcation | PeriodicOrbit, kind: str | None, switch: Any
) -> tuple[PeriodicOrbit, str, str, Cut, Any]:
    """The orbit, its kind, over which parameter it was found, the map with points, and the event that matters."""
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
        return orbit, kind, name, of_orbit(orbit, orbit.map), border
    if kind not in TOUCHES:
        # Beside a slow impact DP has no bound; the motion from impact to impact has.
        slow = kind in ("fold", "flip") and orbit.segments is None
        found = from_impact(orbit.map, orbit.x) if slow else None
        return orbit, kind, name, of_orbit(orbit, orbit.map) if found is None else (*found, False), None
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
    window = touched(orbit, str(switch), phase, kind == ADDING)
    if isinstance(window, str):
        raise ValueError(f"`start` grazes nothing: {window}.")
    return orbit, kind, name, window, None


def _at_event(start: Bifurcation) -> tuple[Cut, tuple[str, int]]:
    """The map without a window, the points on its section, and the event at which the itinerary changes."""
    orbit, change = start.orbit, start.change
    assert change is not None
    switch = change.before[0].switch
    found = of_orbit(orbit, Windowed(orbit.map))
    image = found[0].image(found[1], ())
    if not isinstance(image, PartedImage):
        raise ValueError(f"`start` is a {start.kind} of an orbit that is not run through: {image.reason}")
    if any(layer.ratio != sp.oo for layer in orbit.system.model.layer_states):
        raise ValueError(
            f"`start` is a {start.kind} of a layered view, whose layer has states; these are not followed."
        )
    probe = (Arrival if start.kind in ARRIVALS else Exit)(start.kind, switch, 0)
    part = 0.5 if orbit.symmetric else 1.0
    times = [time / orbit.period for time in probe.times(image)]
    off = [abs((t - change.before[0].time + part / 2) % part - part / 2) for t in times]
    if not off or min(off) > 3 * TOGETHER:
        raise ValueError(
            f"`start` is a {start.kind} whose event is not found in its orbit; start from another one."
        )
    return found, (switch, int(np.argmin(off)))


def _both_sides(first_of, condition, names, bounds, lengths, most, virtual, used_up) -> Curve:
    map_, x, held = first_of
    curve, n = Curve(condition.kind, names), len(x)
    widths = bounds[:, 1] - bounds[:, 0]
    walk = CurveWalk(map_, condition, names, widths, n, held)
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
    ways: list[Way] = []
    sides: list[tuple[list[Spot], list[Codimension2], str]] = []
    for sign in (-1.0, 1.0):
        side = copy.copy(walk)
        side.condition = copy.deepcopy(condition)
        here = copy.copy(first)
        object.__setattr__(here, "tangent", sign * first.tangent)
        way = Way(side, bounds, lengths, most, virtual, used_up)
        ways.append(way)
        sides.append(way.followed(here))
        if way.closed:
            break
    back, on = sides[0], sides[1] if len(sides) == 2 else ([first], [], "")
    spots = [*back[0][:0:-1], *on[0]]
    curve.orbits = [spot.orbit for spot in spots]
    curve.points = [*back[1][::-1], *on[1]]
    curve.turns = [*ways[0].turns[::-1], *(ways[1].turns if len(ways) == 2 else [])]
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
