"""What branches have in common, of periodic orbits and of equilibria: values, tables, pictures.

Chain: **branch** -> equilibrium_branch.py, continuation.py.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door import checks
from ...door.describe import Described, Rows

if TYPE_CHECKING:
    import pandas


class _Along(Described):
    """Points with a system each along a parameter."""

    parameter: str
    bifurcations: list[Any]
    end: str
    _noun = "points"
    _where = ""  # that a state in a picture is taken at

    @property
    def _points(self) -> list[Any]:
        raise NotImplementedError

    @staticmethod
    def _at(bifurcation: Any) -> Any:
        """The point of a bifurcation."""
        raise NotImplementedError

    def _drawn(self, point: Any) -> tuple[tuple[Any, ...], str]:
        """Symbols of what can be drawn, and what they are called."""
        return point.system.states, "state"

    def _row(self, point: Any) -> np.ndarray:
        """Their values at a point."""
        return point.x

    def _columns(self) -> dict[str, Any]:
        """Further columns of the table."""
        raise NotImplementedError

    @property
    def values(self) -> np.ndarray:
        """The parameter along the branch, shape (number of points,), in its unit."""
        return np.array([self._value(point) for point in self._points])

    def _value(self, point: Any) -> float:
        return next(value for p, value in point.system.parameters.items() if p.name == self.parameter)

    @property
    def x(self) -> np.ndarray:
        """Points in the state space, shape (n, number of points), in the units of the states."""
        return np.array([point.x for point in self._points]).T

    @property
    def stable(self) -> np.ndarray:
        """Whether each point is stable."""
        return np.array([point.stable for point in self._points])

    def of_kind(self, kind: str) -> list[Any]:
        """Bifurcations of one kind.

        Parameters
        ----------
        kind : str
            As of the branch's bifurcations.

        Returns
        -------
        list of Bifurcation or EquilibriumBifurcation
            In the order in which they were found.
        """
        return [b for b in self.bifurcations if b.kind == kind]

    def to_dataframe(self) -> pandas.DataFrame:
        """The points as a table.

        Returns
        -------
        pandas.DataFrame
            A row a point: the parameter, the states, whether it is stable; of orbits the period, the largest modulus of
            the multipliers and the largest Lyapunov exponent, of equilibria the multipliers, the stability in words and
            the rightmost eigenvalue.
        """
        import pandas

        names = [str(s) for s in self._points[0].system.states]
        return pandas.DataFrame({self.parameter: self.values, **dict(zip(names, self.x)), **self._columns()})

    def plot(self, name: Any = None, ax: Any = None) -> Any:
        """A state over the parameter: stable points as lines, others dashed, virtual ones dotted, bifurcations marked.

        Parameters
        ----------
        name : str or Symbol, optional
            A state, of equilibria a multiplier too; by default the first state.
        ax : Axes, optional
            Where to draw; a new figure by default.

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

        names, what = self._drawn(self._points[0])
        k = 0 if name is None else names.index(checks.lookup(name, names, "`name`", what))
        (ax,) = axes_for(ax, 1, (5.5, 3.6), "one branch; give one")
        q, x = self.values, np.array([self._row(point)[k] for point in self._points])
        styles = np.where(self.stable, "-", "--").astype(object)
        styles[[bool(getattr(point, "virtual", "")) for point in self._points]] = ":"
        changes = (np.flatnonzero(styles[1:] != styles[:-1]) + 1).tolist()
        for first, end in zip([0, *changes], [*changes, len(q)]):
            piece = slice(first, end + 1)  # as far as the first point of the next one
            ax.plot(q[piece], x[piece], styles[first], color=COLOUR["exact"])
        kinds = dict.fromkeys(b.kind for b in self.bifurcations)
        for kind, mark in zip(kinds, itertools.cycle("osD^vP*X")):
            points = [(b.parameter, self._row(self._at(b))[k]) for b in self.of_kind(kind)]
            ax.plot(*zip(*points), mark, color=COLOUR["left"], fillstyle="none", label=kind)
        if kinds:
            ax.legend()
        ax.set(xlabel=self.parameter, ylabel=f"{names[k]}{self._where}")
        return ax

    def _described(self) -> tuple[str, Rows]:
        q = self.values
        span = f", {self.parameter} from {q.min():.9g} to {q.max():.9g}" if q.size else ""
        found = [line.strip() for b in self.bifurcations for line in str(b).splitlines()]
        return f"Branch: {len(q)} {self._noun}{span}; {self.end}", {
            "stable": [f"{np.sum(self.stable)} of {len(q)}"],
            "bifurcations": found,
        }.items()
