"""A map of a hazard: what became of every run, and the border that theory draws.

Chain: failures.py, hazard.py -> **this file** -> maps.py, charts.py, tables.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door import checks
from .failures import HARMLESS, KINDS
from .hazard import Axis, group_of

if TYPE_CHECKING:
    import xarray

WORDS = ("title", "law", "unit", "truth", "worse")  # as in `Hazard`


@checks.door()
@dataclass(frozen=True)
class StabilityMap:
    """Where each method fails, and how.

    Parameters
    ----------
    name, title : str
        As in `Hazard`.
    x, rows : Axis
        The ratio that decides, and the circumstance.
    counts : dict of str to dict
        Method -> way of failing -> ndarray of int, shape (rows, x): runs that came to it. Ways that never occurred
        are left out.
    sizes : dict of str to ndarray
        Largest number behind the verdicts, shape (rows, x), in `unit`.
    border : dict of str to ndarray
        x at which theory has the method fail, shape (rows,), in the unit of x; nan where it says nothing.
    law, unit, truth, worse : str
        As in `Hazard`.
    left_out : dict of str to str
        Methods that were not run, and why.
    seconds : float
        Processor time, in units of s.

    >>> kicked = stability("noise", fast=True)
    >>> kicked.methods
    ('smoothed path', 'event-driven')
    >>> print(kicked.table_row()["event-driven"])
    right
    """

    name: str
    title: str
    x: Axis
    rows: Axis
    counts: dict[str, dict[str, np.ndarray]]
    sizes: dict[str, np.ndarray]
    border: dict[str, np.ndarray]
    law: str = ""
    unit: str = ""
    truth: str = ""
    worse: str = "right"
    left_out: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods that were run."""
        return tuple(self.counts)

    def total(self, method: str) -> np.ndarray:
        """Runs of a method.

        Returns
        -------
        ndarray of int
            Counts, dimensionless, shape (rows, x).
        """
        return sum(self.counts[method].values(), np.zeros((len(self.rows), len(self.x)), int))

    def failed(self, method: str) -> np.ndarray:
        """Runs of a method that failed.

        Returns
        -------
        ndarray of int
            Counts, dimensionless, shape (rows, x).
        """
        return self.total(method) - sum(self.counts[method].get(kind, 0) for kind in HARMLESS)

    def tally(self, method: str) -> dict[str, int]:
        """Runs of each kind over the whole map.

        Returns
        -------
        dict of str to int
            Way of failing -> number of runs, the most frequent first.
        """
        sums = {kind: int(n.sum()) for kind, n in self.counts[method].items()}
        return dict(sorted(sums.items(), key=lambda item: -item[1]))

    def agreement(self, method: str) -> float:
        """How far theory and measurement agree.

        Returns
        -------
        float
            Share of the runs on whose side of the border theory is right, dimensionless; nan without a border.
        """
        edge = self.border[method]
        bordered = ~np.isnan(edge)
        if not bordered.any():
            return float("nan")
        x = np.array(self.x.values)
        beyond = x[None, :] > edge[:, None] if self.worse == "right" else x[None, :] < edge[:, None]
        total, failed = self.total(method), self.failed(method)
        agreed = np.where(beyond, failed, total - failed)[bordered]
        return float(agreed.sum() / max(1, total[bordered].sum()))

    @property
    def data(self) -> xarray.Dataset:
        """Counts, sizes and borders as an xarray Dataset over solver, row, x and failure."""
        import xarray

        kinds = list(KINDS)
        cube = np.zeros((len(self.methods), len(self.rows), len(self.x), len(kinds)), int)
        for i, method in enumerate(self.methods):
            for kind, n in self.counts[method].items():
                cube[i, :, :, kinds.index(kind)] = n
        names = {"x_name": self.x.name, "row_name": self.rows.name}
        return xarray.Dataset(
            {
                "runs": (("solver", "row", "x", "failure"), cube),
                "size": (("solver", "row", "x"), np.array([self.sizes[m] for m in self.methods])),
                "border": (("solver", "row"), np.array([self.border[m] for m in self.methods])),
            },
            coords={
                "solver": list(self.methods),
                "row": list(self.rows.words or self.rows.values),
                "x": list(self.x.values),
                "failure": kinds,
            },
            attrs={"hazard": self.name, **names, **{word: getattr(self, word) for word in WORDS}},
        )

    def chart(self, axes: Any = None) -> Any:
        """The map: a band a method, its border over it.

        Parameters
        ----------
        axes : matplotlib Axes, optional
            A figure of its own without.

        Returns
        -------
        matplotlib Axes
            With the map in it.
        """
        from .charts import plot_map

        return plot_map(self, axes)

    def table_row(self) -> dict[str, str]:
        """What happens, in a few words.

        Returns
        -------
        dict of str to str
            Method -> its verdict.
        """
        return {method: what_happens(self, method) for method in self.methods}

    def record(self) -> dict[str, Any]:
        """The map for a data file.

        Returns
        -------
        dict
            Plain numbers, lists and dicts.
        """
        return {
            "name": self.name,
            **{word: getattr(self, word) for word in WORDS},
            "seconds": self.seconds,
            "x": vars(self.x),
            "rows": vars(self.rows),
            "left_out": self.left_out,
            "methods": {
                m: {
                    "group": group_of(m),
                    "counts": {kind: n.tolist() for kind, n in self.counts[m].items()},
                    "sizes": [[_plain(float(f"{s:.3g}")) for s in row] for row in self.sizes[m].tolist()],
                    "border": [_plain(b) for b in self.border[m].tolist()],
                }
                for m in self.methods
            },
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> StabilityMap:
        """The map of a data file.

        Parameters
        ----------
        record : mapping
            As `record()` gives it.

        Returns
        -------
        StabilityMap
            The same map.
        """
        axes: dict[str, Any] = {
            k: Axis(record[k]["name"], tuple(record[k]["values"]), tuple(record[k]["words"]))
            for k in ("x", "rows")
        }
        methods = record["methods"]
        return cls(
            **{word: record[word] for word in ("name", *WORDS, "seconds")},
            **axes,
            left_out=dict(record["left_out"]),
            counts={m: {kind: np.array(n) for kind, n in e["counts"].items()} for m, e in methods.items()},
            sizes={m: np.array([[_number(s) for s in row] for row in e["sizes"]]) for m, e in methods.items()},
            border={m: np.array([_number(b) for b in e["border"]]) for m, e in methods.items()},
        )


def what_happens(map_: StabilityMap, method: str) -> str:
    """ "right", "right or recorded", or the ways of failing with their shares of all runs."""
    tally, total = map_.tally(method), int(map_.total(method).sum())
    failures = [(kind, n) for kind, n in tally.items() if kind not in HARMLESS]
    if not failures:
        return "right or recorded" if tally.get("recorded") else "right"
    words = [f"{kind} {_share(n, total)}" for kind, n in failures[:3]]
    beyond = ", at theory's border" if map_.agreement(method) >= 0.95 else ""
    return ", ".join(words) + beyond


def _share(n: int, total: int) -> str:
    percent = 100 * n / total
    return f"{percent:.0f} %" if percent >= 1 else f"{n} of {total}"


def _plain(value: float) -> Any:
    """JSON has neither nan nor infinity."""
    return value if np.isfinite(value) else "inf" if value > 0 else None


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)
