"""A branch: orbits or equilibria along one parameter, or along a curve of bifurcations over two.

Chain: special.py -> **branch** -> branches.py, two_parameters.py, equilibria/.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door import checks
from ...door.describe import Described, Rows
from ..equilibria.equilibrium import Equilibrium
from .special import Special

if TYPE_CHECKING:
    import pandas

__all__ = ["Branch"]


@checks.door()
@dataclass(repr=False)
class Branch(Described):
    """Periodic orbits or equilibria along a parameter, or along a curve of bifurcations over two.

    Attributes
    ----------
    parameters : tuple of str
        The name of the parameter or of both; of a set of equilibria followed along a state, the state's.
    points : list of PeriodicOrbit or list of Equilibrium
        In order along the branch.
    specials : list of Special
        Bifurcations, or points of codimension 2 of a curve, in order along the branch.
    ends : tuple of str
        Why it ended in the directions in which it was followed, in words; one of them where it closes.
    kind : str
        Of a curve: of its bifurcation; all boundary equilibria are "boundary equilibrium". Empty of a branch.
    turns : list of Special
        Where a curve turns back in one of the parameters, in order along it; no bifurcations, but the largest and
        smallest values at which they exist.
    tests : dict of str to ndarray, each of shape (number of points,)
        Values along the branch of the user's own tests; of a curve also of the functions, dimensionless, that vanish at
        points of codimension 2, by the names of these.
    places : list of int
        Of each special point how many of the points come before it.

    Source: Keller's arclength continuation (1977); di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical
    Systems, 2008, for what happens at surfaces; Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria,
    2000, for the test functions along curves.

    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> system = System({x: a * sp.cos(t) - x}, time=t, parameters={a: 1})
    >>> branch = follow(find_orbit(system, {x: 0}, seen=Strobe(2 * sp.pi)), {a: 2})
    >>> branch.ends, bool(branch.stable.all())
    (('reached a = 2.',), True)
    >>> print(f"{branch.values[-1]:g} {branch.x[0, -1]:.9f}")
    2 1.000000000

    >>> relay = System({x: a - sp.sign(x) - x}, parameters={a: 0})
    >>> branch = follow(find_equilibrium(relay, {x: 0.3}), {a: 2})
    >>> [b.kind for b in branch.specials], branch.ends
    (['boundary equilibrium: persistence'], ('reached a = 2.',))

    >>> cubic = System({x: a + b * x - x**3}, parameters={a: 1, b: 1})
    >>> (fold, _) = follow(find_equilibrium(cubic, {x: 1.3}), {a: -1}, steps=Steps(first=0.1)).specials
    >>> curve = follow(fold, {a: (-1, 1), b: (-1, 1)})
    >>> [point.kind for point in curve.specials], curve.ends
    (['cusp'], ('reached b = 1.', 'reached b = 1.'))
    """

    parameters: tuple[str, ...]
    points: list[Any] = field(default_factory=list)
    specials: list[Special] = field(default_factory=list)
    ends: tuple[str, ...] = ()
    kind: str = ""
    turns: list[Special] = field(default_factory=list)
    tests: dict[str, np.ndarray] = field(default_factory=dict)
    places: list[int] = field(default_factory=list)

    @property
    def of_equilibria(self) -> bool:
        """Whether it is one of equilibria."""
        return bool(self.points) and isinstance(self.points[0], Equilibrium)

    @property
    def end(self) -> str:
        """Why it ended, in words: `ends` one after the other."""
        return " ".join(self.ends)

    @property
    def values(self) -> np.ndarray:
        """The parameter along the branch, shape (number of points,), in its unit; of a curve both, (2, number)."""
        found = np.array([[_value(point, name) for point in self.points] for name in self.parameters])
        return found if len(self.parameters) > 1 else found[0]

    @property
    def x(self) -> np.ndarray:
        """States, of orbits on the section, shape (n, number of points), in the units of the states."""
        return np.array([point.x for point in self.points]).T

    @property
    def stable(self) -> np.ndarray:
        """Whether each point is stable."""
        return np.array([point.stable for point in self.points])

    @property
    def admissible(self) -> np.ndarray:
        """Whether each point is one of the exact system, which all are unless `virtual` ones were asked for."""
        return np.array([point.success and not getattr(point, "virtual", "") for point in self.points], bool)

    @property
    def mult(self) -> np.ndarray:
        """Multipliers of equilibria, shape (m, number of points); those of switches dimensionless."""
        return np.array([e.mult for e in self.points]).T

    @property
    def exponents(self) -> np.ndarray:
        """Lyapunov exponents of orbits, log|multiplier|/period, shape (number of multipliers, number of points).

        Largest first, in units of 1/time; -inf where an orbit sticks or lands, nan where there are no multipliers.
        """
        return np.array([orbit.exponents for orbit in self.points]).T

    def of_kind(self, kind: str) -> list[Special]:
        """Special points of one kind.

        Parameters
        ----------
        kind : str
            As of `Special`.

        Returns
        -------
        list of Special
            In order along the branch.
        """
        return [special for special in self.specials if special.kind == kind]

    def to_dataframe(self) -> pandas.DataFrame:
        """The points as a table.

        Returns
        -------
        pandas.DataFrame
            A row a point: the parameters, the states, whether it is stable; of orbits the period, the largest modulus
            of the multipliers and the largest Lyapunov exponent, of equilibria the multipliers, the stability in words,
            whether it is virtual, and the rightmost eigenvalue; of a curve its test functions.
        """
        import pandas

        columns = dict(zip(self.parameters, np.atleast_2d(self.values)))
        columns |= dict(zip(map(str, self.points[0].system.states), self.x))
        if self.of_equilibria:
            names = [str(mu.symbol) for mu in self.points[0].system.model.multipliers]
            columns |= {
                "stable": self.stable,
                **dict(zip(names, self.mult)),
                "stability": [e.stability for e in self.points],
                "virtual": ~self.admissible,
                "rightmost_eigenvalue": [e.eigenvalues.real.max(initial=-math.inf) for e in self.points],
            }
        else:
            columns |= {
                "period": [orbit.period for orbit in self.points],
                "stable": self.stable,
                "largest_multiplier": [abs(orbit.multipliers).max(initial=0.0) for orbit in self.points],
                "largest_exponent": [orbit.exponents.max(initial=-math.inf) for orbit in self.points],
            }
        return pandas.DataFrame(columns | self.tests)

    def plot(self, name: Any = None, ax: Any = None, color: Any = None) -> Any:
        """A state over the parameter, or a curve in the plane of its parameters; special points marked.

        Stable points are drawn as lines, others dashed, virtual ones dotted; curves as lines.

        Parameters
        ----------
        name : str or Symbol, optional
            Of a branch: a state, of equilibria a multiplier too; by default the first state.
        ax : Axes, optional
            Where to draw; a new figure by default.
        color : matplotlib colour, optional
            Of the lines.

        Returns
        -------
        Axes
            The same.

        Raises
        ------
        ValueError
            Nothing of that name.
        """
        from ...plotting import COLOUR, axes_for

        (ax,) = axes_for(ax, 1, (5.5, 3.6), "one branch; give one")
        styles = np.where(self.stable, "-", "--").astype(object)
        if len(self.parameters) > 1:
            if name is not None:
                raise ValueError(
                    f"`name` is {name!r}, and a curve is drawn over both parameters; leave it out."
                )
            (q, y), label = self.values, self.parameters[1]
            styles[:] = "-"
            marked = {special.kind: [] for special in self.specials}
            for special in self.specials:
                marked[special.kind].append(tuple(special.values.values()))
        else:
            model, where = self.points[0].system.model, "" if self.of_equilibria else " on the section"
            names: tuple[Any, ...] = self.points[0].system.states
            if self.of_equilibria:
                names = (*model.states, *(mu.symbol for mu in model.multipliers))
            what = "state or multiplier" if self.of_equilibria else "state"
            k = 0 if name is None else names.index(checks.lookup(name, names, "`name`", what))
            q, y, label = self.values, np.array([_row(point)[k] for point in self.points]), f"{names[k]}{where}"
            marked = {special.kind: [] for special in self.specials}
            for special in self.specials:
                marked[special.kind].append((special.parameter, _row(special.point)[k]))
        styles[~self.admissible] = ":"
        changes = (np.flatnonzero(styles[1:] != styles[:-1]) + 1).tolist()
        for first, end in zip([0, *changes], [*changes, len(q)]):
            piece = slice(first, end + 1)  # as far as the first point of the next one
            told = {"label": "virtual" if styles[first] == ":" else self.kind} if self.kind else {}
            ax.plot(q[piece], y[piece], styles[first], color=color or COLOUR["exact"], **told)
        for (kind, places), mark in zip(marked.items(), itertools.cycle("osD^vP*X")):
            ax.plot(*zip(*places), mark, color=COLOUR["left"], fillstyle="none", label=kind)
        if marked or self.kind:
            ax.legend()
        ax.set(xlabel=self.parameters[0], ylabel=label)
        return ax

    def _described(self) -> tuple[str, Rows]:
        number = len(self.points)
        noun = (
            ("equilibrium" if number == 1 else "equilibria")
            if self.of_equilibria
            else f"orbit{'s' * (number != 1)}"
        )
        spans = [
            f"{name} from {q.min():.9g} to {q.max():.9g}"
            for name, q in zip(self.parameters, np.atleast_2d(self.values)) if q.size
        ]  # fmt: skip
        lines = [line.strip() for special in self.specials for line in str(special).splitlines()]
        virtual, stable = int(np.sum(~self.admissible)), int(np.sum(self.stable))
        return f"{f'Curve of {self.kind}' if self.kind else 'Branch'}: {number} {noun}", {
            "over": spans,
            "stable": [] if self.kind else [f"{stable} of {number}"],
            "virtual": [f"{virtual} of {number}"] if virtual else [],
            "special points": lines,
            "turns": [str(turn) for turn in self.turns],
            "ends": list(self.ends),
        }.items()


def branch_of(way: Any, ends: Sequence[str], parameters: tuple[str, ...], kind: str = "") -> Branch:
    """The branch that was followed; of a curve with its kind."""
    points, names = [point.item for point in way.points], way.points[0].tests if kind else ()
    tests = {name: np.array([p.tests.get(name, math.nan) for p in way.points]) for name in names}
    tests |= {name: np.array([test(point) for point in points]) for name, test in way.how.tests.items()}
    return Branch(parameters, points, way.specials, tuple(ends), kind, way.turns, tests, way.places)


def _value(point: Any, name: str) -> float:
    known = {p.name: float(value) for p, value in point.system.parameters.items()}
    return known[name] if name in known else float(point.x0[name])


def _row(point: Any) -> np.ndarray:
    """What can be drawn of a point."""
    return np.concatenate([point.x, point.mult]) if isinstance(point, Equilibrium) else point.x
