"""What `diagram` gives: branches, bifurcations, the orbit diagram, and what is missing, as data.

Chain: searching.py, drawing.py -> **result** -> looking.py.
"""

from __future__ import annotations

import functools
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.continuation.special import Special
from ..door import checks
from ..door.describe import Described, Rows, some
from .line import Line, uncovered
from .plain import Setting, special_of
from .searching import IN_A_SET, NOWHERE, Ends
from .tasks import RESULT, Store, write_group

if TYPE_CHECKING:
    import xarray

__all__ = ["Diagram"]

TITLE = "pwsmooth diagram"
_OF_ENDS = ("values", "points", "cycle", "outcome")


@checks.door()
@dataclass(repr=False, eq=False)
class Diagram(Described):
    """All branches that were found over a parameter, and the orbit diagram with them.

    Attributes
    ----------
    parameter : str
        Its name.
    range : tuple of (float, float), in the unit of the parameter
        From the least to the largest value.
    states : tuple of str
        Names of the states.
    branches : list of Line
        In the order in which they were found, with `values`, `stable`, `ends` and `origin`.
    ends : Ends or None
        The orbit diagram: where trajectories from the starts end.
    explained : ndarray of int, shape (values, starts)
        The number of the branch on which an end lies, -1 for none, -2 at an orbit that is not isolated (a set of
        orbits, as of a block at rest); dimensionless.
    lost : tuple of str
        Where a branch was expected and none was found, in words.
    left : int
        Branches that were not followed, as the bounds on depth, number and length say.
    strobed_by : str
        What lies between two points of an orbit: a "period", a "return", or "" of equilibria.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 3}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> found = diagram(logistic, {a: (2.8, 3.5)}, {x: 0.3}, Strobe(1, phase=0.5), values=8)
    >>> [f"{b.kind} {b.parameter:.6f}" for b in found.specials]
    ['flip 3.000000', 'flip 3.449490']
    """

    parameter: str
    range: tuple[float, float]
    states: tuple[str, ...]
    branches: list[Line]
    ends: Ends | None
    explained: np.ndarray
    lost: tuple[str, ...] = ()
    left: int = 0
    strobed_by: str = "period"
    _setting: Setting | None = None

    @functools.cached_property
    def specials(self) -> list[Special]:
        """Special points, each once, by the parameter, for `branch_off`, `cycle_from` and `follow` over two.

        Those of a diagram that was read have no orbits: make the same call with its `store` for these.
        """
        return [special_of(data, self._setting) for data in self._located]

    @property
    def _located(self) -> list[dict[str, Any]]:
        """The same as data, with the number of the first branch on which each was met."""
        found = [
            {**b, "branch": k}
            for k, branch in enumerate(self.branches)
            for b in branch.located
            if b.get("first")
        ]
        return sorted(found, key=lambda b: b["parameter"])

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Intervals of the parameter over which no branch is stable and no set of orbits attracts, in its unit.

        A set is taken to attract between two neighbouring values at which trajectories end in one. Gaps narrower than
        1e-5 of the range are not told: branches may not be followed to their very end.
        """
        known = [interval for branch in self.branches for interval in branch.covered()]
        if self.ends is not None:
            q, resting = self.ends.values, (self.explained == IN_A_SET).any(axis=1)
            known += [(float(a), float(b)) for a, b, x, y in zip(q, q[1:], resting, resting[1:]) if x and y]
        return uncovered(known, *self.range)

    @property
    def unexplained(self) -> np.ndarray:
        """Values of the parameter at which an end of a trajectory is on no branch, shape (number,), in its unit."""
        return np.zeros(0) if self.ends is None else self.ends.values[(self.explained == NOWHERE).any(axis=1)]

    def plot(self, name: Any = None, ax: Any = None) -> Any:
        """A state over the parameter: stable solid, unstable dashed, virtual dotted, the orbit diagram behind.

        Parameters
        ----------
        name : str or Symbol, optional
            The state, by default the first one.

        Returns
        -------
        Axes
            Where it was drawn.

        Raises
        ------
        ValueError
            No state of that name.
        """
        from ..plotting import axes_for, style
        from .drawing import draw_diagram

        name = self.states[0] if name is None else str(getattr(name, "name", name))
        if name not in self.states:
            raise ValueError(f"`name` is {name!r}; the states are {', '.join(self.states)}.")
        with style():
            (ax,) = axes_for(ax, 1, (7.2, 4.0), "one diagram; give one")
            draw_diagram(self, self.states.index(name), ax)
            ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax

    # ---- as data

    def to_dataset(self) -> xarray.Dataset:
        """Everything as a Dataset.

        Returns
        -------
        xarray.Dataset
            Points of all branches along "point", their branch in `branch`; states over (point, turn); special
            points along "special"; the orbit diagram over ("value", "start", "kept").
        """
        from .dataset import dataset_of

        return dataset_of(self, TITLE)

    def save(self, path: Any) -> None:
        """Write it into a Zarr directory, which `read_diagram` reads.

        Parameters
        ----------
        path : str or Path
            A new directory.
        """
        path = checks.path(path, "`path`")
        Store(path, TITLE, {"saved": self.parameter})
        write_group(path, RESULT, self._item())

    def _item(self) -> dict[str, Any]:
        arrays: dict[str, np.ndarray] = {"explained": self.explained}
        branches = []
        for k, branch in enumerate(self.branches):
            own, words = branch.to_data(f"branch_{k}_")
            arrays |= own
            branches.append(words)
        if self.ends is not None:
            arrays |= {f"ends_{key}": getattr(self.ends, key) for key in _OF_ENDS}
        about = {
            "parameter": self.parameter, "range": list(self.range), "states": list(self.states), "branches": branches,
            "lost": list(self.lost), "left": self.left, "strobed_by": self.strobed_by,
            "tol": self.ends.tol if self.ends is not None else None,
        }  # fmt: skip
        return {"arrays": arrays, "about": about}

    @staticmethod
    def _of(item: dict[str, Any]) -> Diagram:
        arrays, about = item["arrays"], item["about"]
        branches = [Line.from_data(arrays, f"branch_{k}_", words) for k, words in enumerate(about["branches"])]
        ends = None
        if "ends_values" in arrays:
            ends = Ends(*(arrays[f"ends_{key}"] for key in _OF_ENDS), about["tol"])
        low, high = about["range"]
        return Diagram(
            about["parameter"], (low, high), tuple(about["states"]), branches, ends, arrays["explained"],
            tuple(about["lost"]), about["left"], about["strobed_by"],
        )  # fmt: skip

    def _described(self) -> tuple[str, Rows]:
        low, high = self.range
        kinds = Counter(b["kind"] for b in self._located)
        rows: list[tuple[str, list[str]]] = [
            ("special points", some([f"{number} {kind}" for kind, number in kinds.items()])),
            ("no attractor", some([f"{self.parameter} from {a:.9g} to {b:.9g}" for a, b in self.gaps])),
        ]
        if self.ends is not None:
            count, starts = self.explained.shape
            off, resting = (int(np.sum(self.explained == code)) for code in (NOWHERE, IN_A_SET))
            told = f", {resting} in sets of orbits" if resting else ""
            looked = f"{count} values, {starts} start{'s' * (starts != 1)}"
            of = self.explained.size
            rows.append(("orbit diagram", [f"{looked}; {off} of {of} runs end on no branch{told}"]))
        rows.append(("lost", some(list(self.lost))))
        if self.left:
            bounds = "`max_depth`, `max_branches` and `max_count`"
            rows.append(("not followed", [f"{self.left} more branches, for the bounds {bounds}"]))
        branches = f"{len(self.branches)} branch{'es' * (len(self.branches) != 1)}"
        return f"Diagram over {self.parameter} from {low:.9g} to {high:.9g}: {branches}", rows
