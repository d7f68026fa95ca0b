"""What curves in two parameters have in common, of periodic orbits and of equilibria: values, tables, pictures.

Chain: codimension.py -> **plane** -> curves.py, equilibrium_curves.py.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door.describe import Described, Rows
from .codimension import Codimension2

if TYPE_CHECKING:
    import pandas


@dataclass(repr=False)
class InPlane(Described):
    """Points in the plane of two parameters, along a curve."""

    kind: str
    parameters: tuple[str, str]
    points: list[Codimension2] = field(default_factory=list)
    ends: tuple[str, ...] = ()
    turns: list[Codimension2] = field(default_factory=list)
    tests: dict[str, np.ndarray] = field(default_factory=dict)

    _noun = "points"

    @property
    def values(self) -> np.ndarray:
        """Both parameters along the curve, shape (2, number of points), in their units."""
        return np.array([[_value(item, name) for item in self._items] for name in self.parameters])

    @property
    def _items(self) -> list[Any]:
        raise NotImplementedError

    def _columns(self) -> dict[str, Any]:
        """Further columns of the table."""
        raise NotImplementedError

    @property
    def x(self) -> np.ndarray:
        """States, of orbits on the section, shape (n, number of points), in the units of the states."""
        return np.array([item.x for item in self._items]).T

    @property
    def admissible(self) -> np.ndarray:
        """Whether each is one of the exact system, which all are unless `virtual` ones were asked for."""
        return np.array([item.success and not getattr(item, "virtual", "") for item in self._items])

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
        """The curve as a table.

        Returns
        -------
        pandas.DataFrame
            A row an orbit or equilibrium: both parameters, the states, of orbits the period and the largest modulus of
            the multipliers, of equilibria the multipliers and the rightmost eigenvalue, and the test functions.
        """
        import pandas

        names = [str(s) for s in self._items[0].system.states]
        return pandas.DataFrame(
            {
                **dict(zip(self.parameters, self.values)),
                **dict(zip(names, self.x)),
                **self._columns(),
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
        from ...plotting import COLOUR, axes_for

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
        spans = [f"{q.min():.9g} to {q.max():.9g}" for q in self.values] if self._items else ["", ""]
        return f"Curve of {self.kind}: {len(self._items)} {self._noun}", {
            "over": [f"{name} from {span}" for name, span in zip(self.parameters, spans)],
            "admissible": [] if self.admissible.all() else [f"{self.admissible.sum()} of {len(self._items)}"],
            "points": [str(point) for point in self.points],
            "turns": [str(point) for point in self.turns],
            "ends": list(self.ends),
        }.items()


def _value(item: Any, name: str) -> float:
    return next(float(value) for p, value in item.system.parameters.items() if p.name == name)
