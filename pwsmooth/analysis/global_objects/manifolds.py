"""Stable and unstable curves of saddles: of orbits on their section, of equilibria in the state space.

    W^u = {x : P^-k(x) -> saddle},    W^s = {x : P^k(x) -> saddle}

The stable curve of a saddle orbit separates basins of attraction. A curve that comes to slide stays one forward;
backward it ends there, as the past of what slides is not unique.

Chain: map_manifolds.py, level_sets.py, flow_manifolds.py -> **manifolds**.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door import checks
from ...door.describe import Described, Rows, number, some, values
from ...paths.budget import MOST_STEPS, opened, within
from ..equilibria.equilibrium import Equilibrium
from ..orbits.periodic_orbit import MULTIPLIERS, PeriodicOrbit
from .arms import Arm, Rules
from .flow_manifolds import arms_of_equilibrium
from .level_sets import traced_arms
from .map_manifolds import arms_of_map, reversible

if TYPE_CHECKING:
    import pandas

__all__ = ["Manifold", "manifold"]

_COLLAPSES = 1e-3  # a multiplier below it: no fundamental domain is resolved
_CONTRACTS = 0.05  # the same of a map whose motion cannot be run backward: level sets are better conditioned
_SAME = 1e-5  # relative to the states: so near to a saddle a crossing is the saddle
_PARTS = 200  # of the length, or of the box: the spacing


@checks.door()
@dataclass(frozen=True, repr=False)
class Manifold(Described):
    """A stable or unstable manifold of dimension one.

    Attributes
    ----------
    saddle : PeriodicOrbit or Equilibrium
        Of which.
    kind : str
        "stable" or "unstable".
    arms : tuple of Arm
        The curves that it consists of, from the saddle outwards.

    Source: Krauskopf and Osinga, J. Comput. Phys. 146 (1998) 404-419, for one-dimensional manifolds of maps.

    Of a saddle beyond which the field is another one; its unstable curve is y = 0, its stable one x = 0:

    >>> x, y = sp.symbols("x y", real=True)
    >>> bent = System({x: x, y: -y + sp.Heaviside(x - 1) * (x - 1)})
    >>> out = manifold(find_equilibrium(bent, {x: 0, y: 0}), "unstable", length=3)
    >>> [arm.end for arm in out.arms]
    ['reached the length 3.', 'reached the length 3.']
    >>> [meeting.what for arm in out.arms for meeting in arm.meetings]
    ['crossing [sgn(x - 1)] (-1 to +1)']
    """

    saddle: Any
    kind: str
    arms: tuple[Arm, ...]

    @property
    def points(self) -> np.ndarray:
        """All points, shape (n, N), in the units of the states; a column of nan between the arms and at jumps."""
        gap = np.full((len(self.saddle.x), 1), np.nan)
        return np.hstack([part for arm in self.arms for part in (arm.points, gap)][:-1])

    def distance(self, x: Any) -> np.ndarray:
        """How far points are from the curve, as a polygon through its points.

        Parameters
        ----------
        x : array_like, shape (n, k)
            Points, in the units of the states.

        Returns
        -------
        ndarray, shape (k,)
            In the units of the states.
        """
        at = np.asarray(x, float).T
        start, end = self.points[:, :-1].T, self.points[:, 1:].T
        solid = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
        start, way = start[solid], (end - start)[solid]
        size = np.maximum((way * way).sum(axis=1), 1e-300)
        nearest = np.full(len(at), math.inf)
        for k, point in enumerate(at):
            part = np.clip(((point - start) * way).sum(axis=1) / size, 0, 1)
            nearest[k] = np.linalg.norm(start + part[:, None] * way - point, axis=1).min(initial=math.inf)
        return nearest

    def crossings(self, other: Manifold) -> np.ndarray:
        """Where the curve crosses another one in the plane: homoclinic points, or heteroclinic ones of two saddles.

        Parameters
        ----------
        other : Manifold
            Of the same section; of systems with two states.

        Returns
        -------
        ndarray, shape (2, k)
            In the units of the states, along this curve from its saddles outwards; of the polygons through the points,
            so that they are as good as the square of the spacing. Without common saddles.

        Raises
        ------
        ValueError
            Not two states.
        """
        if len(self.saddle.x) != 2 or len(other.saddle.x) != 2:
            raise ValueError(f"the saddle has {len(self.saddle.x)} states; curves cross in a plane of two.")
        start, way = self.points[:, :-1].T, np.diff(self.points, axis=1).T
        begin, along = other.points[:, :-1].T, np.diff(other.points, axis=1).T
        found = []
        for at, step in zip(start, way):
            turned = step[0] * along[:, 1] - step[1] * along[:, 0]
            off = begin - at
            with np.errstate(all="ignore"):
                part = (off[:, 0] * along[:, 1] - off[:, 1] * along[:, 0]) / turned
                far = (off[:, 0] * step[1] - off[:, 1] * step[0]) / turned
            for k in np.flatnonzero((part >= 0) & (part < 1) & (far >= 0) & (far < 1)):
                found.append(at + part[k] * step)
        saddles = [self.saddle.x, other.saddle.x]
        kept = [
            x for x in found if all(np.abs(x - at).max() > _SAME * (1 + np.abs(at).max()) for at in saddles)
        ]
        return np.array(kept).reshape(-1, 2).T

    def to_dataframe(self) -> pandas.DataFrame:
        """The points as a table.

        Returns
        -------
        pandas.DataFrame
            A row a point: the number of its arm, the arclength, the states; nan where the curve jumps.
        """
        import pandas

        names = [str(s) for s in self.saddle.system.model.states]
        tables = [
            pandas.DataFrame({"arm": k, "arclength": arm.arclength, **dict(zip(names, arm.points))})
            for k, arm in enumerate(self.arms)
        ]
        return pandas.concat(tables, ignore_index=True)

    def plot(self, ax: Any = None, x: Any = None, y: Any = None, **line: Any) -> Any:
        """The curve in the plane of two states, the saddle and what surfaces it meets.

        Parameters
        ----------
        x, y : str or Symbol, optional
            The states, by default the first two.
        **line
            For matplotlib's `plot`.

        Returns
        -------
        Axes
            Where it was drawn.
        """
        from ...plotting import COLOUR, axes_for

        states = self.saddle.system.model.states
        i, j = (
            k if name is None else states.index(checks.lookup(name, states, what, "state"))
            for k, name, what in ((0, x, "`x`"), (1, y, "`y`"))
        )
        (ax,) = axes_for(ax, 1, (5.0, 4.0), "one manifold; give one")
        colour = COLOUR["right"] if self.kind == "stable" else COLOUR["left"]
        drawn = {"color": colour, "linewidth": 1.0, "label": self.kind, **line}
        ax.plot(self.points[i], self.points[j], **drawn)
        ax.plot(self.saddle.x[i], self.saddle.x[j], "o", color=COLOUR["exact"], markersize=4)
        met = np.array([meeting.x for arm in self.arms for meeting in arm.meetings])
        if len(met):
            ax.plot(met[:, i], met[:, j], "|", color=COLOUR["mark"], markersize=6)
        ax.set(xlabel=str(states[i]), ylabel=str(states[j]))
        return ax

    def _described(self) -> tuple[str, Rows]:
        what = "orbit" if isinstance(self.saddle, PeriodicOrbit) else "equilibrium"
        lines = [f"length {arm.length:.6g}, {arm.points.shape[1]} points: {arm.end}" for arm in self.arms]
        met = [str(meeting) for arm in self.arms for meeting in arm.meetings]
        return f"Manifold: {self.kind}, of an {what}", {
            "at": values(self.saddle.x0, self.saddle.x),
            "arms": lines,
            "meets": list(some(met)),
        }.items()


@checks.door(
    saddle=checks.instance(
        (PeriodicOrbit, Equilibrium), "a PeriodicOrbit or an Equilibrium, from find_orbit() or find_equilibrium()"
    ),
    kind=checks.one_of("unstable", "stable"), length=checks.optional(checks.positive),
    box=checks.optional(checks.mapping), spacing=checks.optional(checks.positive), angle=checks.positive,
    max_points=checks.integer(10, 10**7),
)  # fmt: skip
def manifold(
    saddle: PeriodicOrbit | Equilibrium,
    kind: str = "unstable",
    *,
    length: float | None = None,
    box: Mapping[Any, Any] | None = None,
    spacing: float | None = None,
    angle: float = 0.2,
    max_points: int = 20_000,
    max_steps: int = 10 * MOST_STEPS,
    max_seconds: float | None = None,
) -> Manifold:
    """The stable or unstable curve of a saddle orbit or equilibrium, through every event.

    Parameters
    ----------
    saddle : PeriodicOrbit or Equilibrium
        With one real multiplier outside the unit circle (inside it, for a stable curve), or one direction on that side.
        Of an orbit the curve lies on its section, and belongs to its first point.
    kind : {"unstable", "stable"}
        Which one.
    length : float, optional
        Of each arm, in the units of the states, which ends with the first point beyond it; or
    box : mapping of state to (float, float), optional
        Bounds of states, in their units: an arm ends with its first point outside. Both may be given.
    spacing : float, optional
        Largest distance of neighbours, in the units of the states; by default 1/200 of the length or of the box.
    angle : float, in radians
        Largest turn at a point; corners keep theirs.
    max_points : int
        Points of an arm at most.
    max_steps, max_seconds : int, float (s), optional
        Bounds of all runs together: an arm ends where they are used up.

    Returns
    -------
    Manifold
        Its arms, each with where it met surfaces and why it ended.

    Raises
    ------
    ValueError, TypeError
        No saddle with a curve of that kind; neither `length` nor `box`; bad input.

    Notes
    -----
    Orbits: growth out of a fundamental domain, stable ones backward in time or, where events cannot be undone, by
    preimages with Newton's method; where the orbit sticks or contracts strongly, as a level set of the map (two states
    only). Equilibria: trajectories. What is not there: a stable curve ends where the motion forward slides
    or rests, since it has no single past there; manifolds of more dimensions.

    Source: B. Krauskopf, H. Osinga, J. Comput. Phys. 146 (1998) 404-419, for spacing and angles.

    The unstable curve of the saddle 0 of (x, y) -> (2 x, y/2 + x^2) is y = 2/7 x^2:

    >>> t, x, y = sp.symbols("t x y", real=True)
    >>> square = Event(every=1, update={x: 2 * x, y: y / 2 + x**2})
    >>> saddle = find_orbit(System({x: 0 * x, y: 0 * y}, time=t, events=[square]), {x: 0, y: 0}, seen=Strobe(1))
    >>> out = manifold(saddle, "unstable", box={x: (-1, 1)})
    >>> bool(abs(out.points[1] - 2 / 7 * out.points[0] ** 2)[:200].max() < 1e-11)
    True
    """
    system = saddle.system
    states = system.model.states
    if not saddle.success:
        raise ValueError(f"`saddle` is none that was found: {saddle.message}")
    if length is None and not box:
        raise ValueError("neither `length` nor `box` is given; give one of them, or both, as the curve's end.")
    low, high = np.full(len(states), -math.inf), np.full(len(states), math.inf)
    for key, pair in (box or {}).items():
        k = states.index(checks.lookup(key, states, "`box`", "state"))
        low[k], high[k] = checks.pair(pair, f"`box` of {states[k]}")
        if not low[k] < saddle.x[k] < high[k]:
            raise ValueError(
                f"`box` of {states[k]} is ({low[k]:g}, {high[k]:g}), and the saddle is at {saddle.x[k]:.6g}; give "
                "bounds around it, the lowest first."
            )
    sizes = (high - low)[np.isfinite(high - low)]
    reach = min(
        math.inf if length is None else length, float(np.linalg.norm(sizes)) if sizes.size else math.inf
    )
    rules = Rules(
        math.inf if length is None else length, low, high, spacing or reach / _PARTS, angle, max_points
    )
    grown: Any = arms_of_equilibrium if isinstance(saddle, Equilibrium) else _arms
    with within(opened(max_steps, max_seconds)):
        return Manifold(saddle, kind, tuple(grown(saddle, kind == "stable", rules)))


def _arms(orbit: PeriodicOrbit, stable: bool, rules: Rules) -> list[Arm]:
    multipliers = orbit.map_multipliers
    inside, outside = (
        [m for m in multipliers if keep(abs(m))]
        for keep in (lambda size: size < 1 - MULTIPLIERS, lambda size: size > 1 + MULTIPLIERS)
    )
    these = inside if stable else outside
    if len(these) != 1 or these[0].imag or len(inside) + len(outside) < len(multipliers):
        raise ValueError(
            f"`saddle` has the multipliers {', '.join(map(number, multipliers))}: no single one "
            f"{'inside' if stable else 'outside'} the unit circle, so that its {'' if stable else 'un'}stable manifold "
            "is no curve; give a saddle for which it is one."
        )
    multiplier = float(these[0].real)
    planar = len(orbit.x) == 2 and bool(outside)
    # Preimages by Newton's method are good to the roundings of P over the multiplier.
    least = _CONTRACTS if stable and planar and not reversible(orbit) else _COLLAPSES
    if not stable or abs(multiplier) >= least:
        return arms_of_map(orbit, multiplier, stable, rules)
    if not planar:
        raise ValueError(
            f"`saddle` contracts by the multiplier {multiplier:.3g} and has {len(orbit.x)} states: such a stable curve "
            "is traced as a level set, in two states only."
        )
    return traced_arms(orbit, float(outside[0].real), rules)
