"""What `diagram` gives over two parameters: curves in their plane and their points of codimension 2, as data.

Chain: growing.py, result.py -> **sets** -> two_parameters.py.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.continuation.special import Special
from ..door import checks
from ..door.describe import Described, Rows, some
from .dataset import columns_of
from .line import Line, under
from .result import Diagram
from .tasks import RESULT, Store, read_result, write_group

if TYPE_CHECKING:
    import xarray

__all__ = ["BifurcationSet", "read_diagram"]

TITLE = "pwsmooth bifurcation set"
_SAME = 1e-6  # of the ranges: points of codimension 2 nearer together, of one name, are one


@checks.door()
@dataclass(repr=False, eq=False)
class BifurcationSet(Described):
    """Curves of bifurcations over two parameters, and the diagrams along lines in which they were found.

    Attributes
    ----------
    parameters : tuple of str
        Their names.
    ranges : tuple of ((float, float), (float, float)), in the units of the parameters
        Of both.
    curves : list of Line
        In the order in which they were found, with `kind`, `values`, `admissible` and `ends`.
    diagrams : list of Diagram
        Along the lines.
    lines : tuple of (str, float), in the units of the parameters
        Of each diagram the parameter that is held, and its value.
    lost : tuple of str
        What was found and has no curve, in words.

    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> step = Event(every=1, update={x: a - x**2 + b * x})
    >>> quadratic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
    >>> found = diagram(quadratic, {a: (-1, 1), b: (-0.5, 0.5)}, {x: 0.1}, Strobe(1, phase=0.5), values=6)
    >>> sorted({curve.kind for curve in found.curves})
    ['flip', 'fold']
    """

    parameters: tuple[str, str]
    ranges: tuple[tuple[float, float], tuple[float, float]]
    curves: list[Line]
    diagrams: list[Diagram]
    lines: tuple[tuple[str, float], ...]
    lost: tuple[str, ...] = ()

    @property
    def specials(self) -> list[Special]:
        """Points of codimension 2, each once, without their orbits."""
        found: list[Special] = []
        widths = np.ptp(np.array(self.ranges), axis=1)
        for p in (p for curve in self.curves for p in curve.located):
            at = dict(zip(self.parameters, p["at"]))

            def same(other: Special, p: Any = p) -> bool:
                off = np.array(p["at"]) - list(other.values.values())
                names = (sorted(kind.split(" + ")) for kind in (p["kind"], other.kind))
                return bool(np.abs(off / widths).max() <= _SAME and next(names) == next(names))

            if not any(same(other) for other in found):
                found.append(Special(p["kind"], at, note=p["note"]))
        return found

    def of_kind(self, kind: str) -> list[Line]:
        """Curves of one kind.

        Parameters
        ----------
        kind : str
            As of `Special`.

        Returns
        -------
        list of Line
            In the order in which they were found.
        """
        return [curve for curve in self.curves if curve.kind == kind]

    def distance(self, values: Any) -> float:
        """How far a point of the plane is from the nearest curve.

        Parameters
        ----------
        values : sequence of float, length 2
            Of both parameters, in their units.

        Returns
        -------
        float
            Dimensionless, in parts of the ranges; inf without curves.
        """
        widths = np.ptp(np.array(self.ranges), axis=1)
        at = checks.numbers(values, "`values`")
        return min((curve.distance(np.array(at, float), widths)[0] for curve in self.curves), default=np.inf)

    def plot(self, ax: Any = None) -> Any:
        """The curves, a colour a kind, virtual ones dotted, and their points of codimension 2.

        Returns
        -------
        Axes
            Where it was drawn.
        """
        from ..plotting import axes_for, style
        from .drawing import draw_set

        with style():
            (ax,) = axes_for(ax, 1, (7.2, 4.4), "one set; give one")
            draw_set(self, ax)
            ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax

    # ---- as data

    def to_dataset(self) -> xarray.Dataset:
        """The curves as a Dataset.

        Returns
        -------
        xarray.Dataset
            Points of all curves along "point", their curve in `curve`; kinds along "curves"; points of codimension 2
            along "special". The diagrams have Datasets of their own.
        """
        import xarray

        p, q = self.parameters
        specials, states = self.specials, self.diagrams[0].states if self.diagrams else ()
        data = columns_of(self.curves, "curve", self.parameters, states) | {
            "kind": (("curves",), np.array([curve.kind for curve in self.curves], dtype=object)),
            "special_kind": (("special",), np.array([m.kind for m in specials], dtype=object)),
            f"special_{p}": (("special",), np.array([m.values[p] for m in specials])),
            f"special_{q}": (("special",), np.array([m.values[q] for m in specials])),
        }  # fmt: skip
        attrs = {
            "title": TITLE, "ranges": json.dumps(self.ranges), "lines": json.dumps(self.lines), "lost": list(self.lost),
            "ends": json.dumps([curve.ends for curve in self.curves]),
        }  # fmt: skip
        return xarray.Dataset(data, attrs=attrs)

    def save(self, path: Any) -> None:
        """Write it into a Zarr directory, which `read_diagram` reads.

        Parameters
        ----------
        path : str or Path
            A new directory.
        """
        path = checks.path(path, "`path`")
        Store(path, TITLE, {"saved": " and ".join(self.parameters)})
        write_group(path, RESULT, self._item())

    def _item(self) -> dict[str, Any]:
        arrays: dict[str, np.ndarray] = {}
        curves = []
        for k, curve in enumerate(self.curves):
            own, words = curve.to_data(f"curve_{k}_")
            arrays |= own
            curves.append(words)
        diagrams = []
        for k, found in enumerate(self.diagrams):
            item = found._item()
            arrays |= {f"diagram_{k}_{name}": values for name, values in item["arrays"].items()}
            diagrams.append(item["about"])
        about = {
            "parameters": list(self.parameters), "ranges": [list(r) for r in self.ranges], "diagrams": diagrams,
            "curves": curves,
            "lines": [list(line) for line in self.lines], "lost": list(self.lost),
        }  # fmt: skip
        return {"arrays": arrays, "about": about}

    def _described(self) -> tuple[str, Rows]:
        spans = [f"{name} from {a:.9g} to {b:.9g}" for name, (a, b) in zip(self.parameters, self.ranges)]
        kinds = Counter(curve.kind for curve in self.curves)
        met = Counter(special.kind for special in self.specials)
        return (
            f"Bifurcation set over {' and '.join(spans)}: {len(self.curves)} curve{'s' * (len(self.curves) != 1)}",
            {
                "curves": some([f"{number} {kind}" for kind, number in kinds.items()]),
                "special points": some([f"{number} {kind}" for kind, number in met.items()]),
                "lines": some([f"{name} = {value:.9g}" for name, value in self.lines]),
                "lost": some(list(self.lost)),
            }.items(),
        )


@checks.door()
def read_diagram(path: Any) -> Diagram | BifurcationSet:
    """What `diagram` gave, from its store or from what `save` wrote.

    Parameters
    ----------
    path : str or Path
        Zarr directory.

    Returns
    -------
    Diagram or BifurcationSet
        Without the system.

    Raises
    ------
    ValueError
        No diagram there, an unfinished or a damaged one.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> step = Event(every=1, update={x: a - x**2})
    >>> folded = System({x: 0 * x}, time=t, parameters={a: 0.2}, events=[step])
    >>> path = tempfile.mkdtemp() + "/folded.zarr"
    >>> found = diagram(folded, {a: (-0.5, 0.5)}, {x: 0.1}, Strobe(1, phase=0.5), values=5, work=Work(store=path))
    >>> [b.kind for b in read_diagram(path).specials] == [b.kind for b in found.specials]
    True
    """
    title, item = read_result(checks.path(path, "`path`"))
    if title != TITLE:
        return Diagram._of(item)
    arrays, about = item["arrays"], item["about"]

    curves = [Line.from_data(arrays, f"curve_{k}_", words) for k, words in enumerate(about["curves"])]
    diagrams = [
        Diagram._of({"arrays": under(f"diagram_{k}_", arrays), "about": one})
        for k, one in enumerate(about["diagrams"])
    ]
    p, q = about["parameters"]
    (a, b), (c, d) = about["ranges"]
    lines = tuple((name, value) for name, value in about["lines"])
    return BifurcationSet((p, q), ((a, b), (c, d)), curves, diagrams, lines, tuple(about["lost"]))
