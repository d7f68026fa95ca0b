"""Running a hazard: every method at every situation, counted by its way of failing.

Chain: hazard.py and the hazards -> **this file** -> charts.py, tables.py, experiments/stability.py.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .failures import HARMLESS, KINDS, Finding
from .hazard import GROUPS, Axis, Hazard

if TYPE_CHECKING:
    import xarray

WORDS = ("name", "title", "law", "unit", "truth", "worse", "seconds")
#: Name of a built-in hazard -> the file that builds it.
HAZARDS = {
    "lugre": "explicit_friction",
    "dai-friction": "explicit_friction",
    "dai-contact": "explicit_contact",
    "stiff-contact": "explicit_contact",
    "smoothed-random": "smoothed",
    "smoothed-grazing": "smoothed",
    "smoothed-tails": "smoothed",
    "layer-steps": "layers",
    "capture-ratio": "layers",
    "noise": "layers",
    "near-fold": "folds",
    "accumulation": "corners",
    "several-sliding": "corners",
    "simultaneous": "corners",
    "bare-sign": "bare",
    "long-stick": "sticks",
    "grazing": "tangency",
    "two-crossings": "tangency",
}


def hazard(name: str, fast: bool = False) -> Hazard:
    """The built-in hazard of that name; `fast` is a coarser map.

    Raises
    ------
    ValueError
        No such hazard.
    """
    if name not in HAZARDS:
        raise ValueError(f"`hazard` is {name!r}, which is none of {', '.join(HAZARDS)}.")
    home = importlib.import_module(f".{HAZARDS[name]}", __package__)
    return getattr(home, name.replace("-", "_"))(fast)


@dataclass(frozen=True)
class StabilityMap:
    """Where each method fails, and how.

    Attributes
    ----------
    name, title, law, unit, truth, worse : str
        As in `Hazard`.
    x, rows : Axis
        The plane of situations.
    counts : dict of str to dict of str to ndarray of int, shape (rows, x)
        Method -> way of failing -> runs that came to it, dimensionless; ways that never occurred are left out.
    sizes : dict of str to ndarray, shape (rows, x)
        Largest number behind the verdicts, in `unit`.
    border : dict of str to ndarray, shape (rows,)
        x at which theory has the method fail, in the unit of x, nan where it says nothing.
    left_out : dict of str to str
        Methods that were not run, and why.
    seconds : float, s
        Processor time.

    Notes
    -----
    Source: defined here.

    Examples
    --------
    >>> from pwsmooth.compare.stability import Axis, Finding, Hazard, stability
    >>> def euler(h, rate):
    ...     return Finding("right" if abs(1 - h * rate) <= 1 else "blow-up")
    >>> decay = Hazard("decay", "Euler's method on x' = -rate x", Axis("h (s)", (0.5, 1.5, 2.5)),
    ...                Axis("rate (1/s)", (1.0, 2.0)), {"explicit Euler": euler}, border=lambda method, rate: 2 / rate)
    >>> found = stability(decay)
    >>> found.tally("explicit Euler"), found.agreement("explicit Euler")
    ({'right': 3, 'blow-up': 3}, 1.0)
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
        """Runs of a method at every situation.

        Parameters
        ----------
        method : str
            Its name.

        Returns
        -------
        ndarray of int, shape (rows, x)
            Numbers of runs, dimensionless.
        """
        return sum(self.counts[method].values(), np.zeros((len(self.rows), len(self.x)), int))

    def failed(self, method: str) -> np.ndarray:
        """Runs of a method that failed, at every situation.

        Parameters
        ----------
        method : str
            Its name.

        Returns
        -------
        ndarray of int, shape (rows, x)
            Numbers of runs, dimensionless.
        """
        return self.total(method) - sum(self.counts[method].get(kind, 0) for kind in HARMLESS)

    def tally(self, method: str) -> dict[str, int]:
        """Number of runs for each way of failing, over the whole map.

        Parameters
        ----------
        method : str
            Its name.

        Returns
        -------
        dict of str to int
            The most frequent first.
        """
        sums = {kind: int(n.sum()) for kind, n in self.counts[method].items()}
        return dict(sorted(sums.items(), key=lambda item: -item[1]))

    def agreement(self, method: str) -> float:
        """Share of the runs on whose side of the border theory is right.

        Parameters
        ----------
        method : str
            Its name.

        Returns
        -------
        float
            Between 0 and 1, dimensionless; nan without a border.
        """
        edge = self.border[method]
        known = np.isfinite(edge) | np.isinf(edge)
        if not known.any():
            return float("nan")
        x = np.array(self.x.values)
        beyond = x[None, :] > edge[:, None] if self.worse == "right" else x[None, :] < edge[:, None]
        total, failed = self.total(method), self.failed(method)
        agreed = np.where(beyond, failed, total - failed)[known]
        return float(agreed.sum() / max(1, total[known].sum()))

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
        words = ("title", "law", "unit", "truth", "worse")
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
            attrs={"hazard": self.name, **names, **{word: getattr(self, word) for word in words}},
        )

    def chart(self, axes: Any = None) -> Any:
        """The map: a band a method, its border over it.

        Parameters
        ----------
        axes : Axes, optional
            Where to draw; of a new figure by default.

        Returns
        -------
        Axes
            The same, or the new ones.
        """
        from .charts import plot_map

        return plot_map(self, axes)

    def table_row(self) -> dict[str, str]:
        """What happens to each method here, in a few words.

        Returns
        -------
        dict of str to str
            Method -> words.
        """
        from .tables import what_happens

        return {method: what_happens(self, method) for method in self.methods}

    def record(self) -> dict[str, Any]:
        """Plain numbers, lists and dicts, for a data file.

        Returns
        -------
        dict of str to value
            JSON can hold it.
        """
        return {
            **{word: getattr(self, word) for word in WORDS},
            "x": vars(self.x),
            "rows": vars(self.rows),
            "left_out": self.left_out,
            "methods": {
                m: {
                    "group": GROUPS.get(m, "no events"),
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
            As `record` gives it.

        Returns
        -------
        StabilityMap
            Equal to the one that was written, but for the digits of its sizes.
        """
        axes: dict[str, Any] = {
            k: Axis(record[k]["name"], tuple(record[k]["values"]), tuple(record[k]["words"]))
            for k in ("x", "rows")
        }
        methods = record["methods"]
        return cls(
            **{word: record[word] for word in WORDS},
            **axes,
            left_out=dict(record["left_out"]),
            counts={m: {kind: np.array(n) for kind, n in e["counts"].items()} for m, e in methods.items()},
            sizes={m: np.array([[_number(s) for s in row] for row in e["sizes"]]) for m, e in methods.items()},
            border={m: np.array([_number(b) for b in e["border"]]) for m, e in methods.items()},
        )


def _plain(value: float) -> Any:
    """JSON has neither nan nor infinity."""
    return value if np.isfinite(value) else "inf" if value > 0 else None


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def stability(
    hazard: str | Hazard,
    methods: Iterable[str] | None = None,
    fast: bool = False,
    *,
    tell: Callable[[str, float], None] | None = None,
) -> StabilityMap:
    """Map where methods fail on a hazard, and how.

    Parameters
    ----------
    hazard : str or Hazard
        A name from `HAZARDS`, or one of your own.
    methods : iterable of str, optional
        Of the hazard's methods; all by default. Those whose package is not installed are left out, and listed.
    fast : bool
        A coarser map, in seconds.
    tell : callable, optional
        Called with every method's name and its processor time in seconds.

    Returns
    -------
    StabilityMap
        Counts of the ways of failing, their sizes, and theory's border.

    Raises
    ------
    ValueError
        Unknown hazard or method.

    Notes
    -----
    Source: defined here; each built-in hazard names its own.

    Examples
    --------
    Explicit Euler on LuGre's bristles, whose rate grows with speed:

    >>> from pwsmooth.compare.stability import stability
    >>> bristles = stability("lugre", ["explicit Euler"], fast=True)
    >>> list(bristles.tally("explicit Euler"))
    ['right', 'blow-up', 'energy growth']
    """
    from .maps import hazard as named

    case = named(hazard, fast) if isinstance(hazard, str) else hazard
    chosen = list(case.methods) if methods is None else list(methods)
    unknown = [m for m in chosen if m not in case.methods]
    if unknown:
        raise ValueError(
            f"`methods` contains {unknown[0]!r}, which is not tried on {case.name!r}; choose from "
            f"{', '.join(case.methods)}."
        )
    counts: dict[str, dict[str, np.ndarray]] = {}
    sizes: dict[str, np.ndarray] = {}
    border: dict[str, np.ndarray] = {}
    left_out: dict[str, str] = {}
    begin = time.process_time()
    for method in chosen:
        started = time.process_time()
        try:
            counts[method], sizes[method] = _tried(case, method)
        except ImportError as reason:
            left_out[method] = f"{reason.name} is not installed"
            continue
        border[method] = np.array([case.border(method, row) for row in case.rows.values], float)
        if tell:
            tell(method, time.process_time() - started)
    return StabilityMap(
        case.name, case.title, case.x, case.rows, counts, sizes, border, case.law, case.unit, case.truth,
        case.worse, left_out, time.process_time() - begin,
    )  # fmt: skip


def _tried(case: Hazard, method: str) -> tuple[dict[str, np.ndarray], np.ndarray]:
    shape = len(case.rows), len(case.x)
    counts = {kind: np.zeros(shape, int) for kind in KINDS}
    sizes = np.full(shape, np.nan)
    for i, row in enumerate(case.rows.values):
        for k, x in enumerate(case.x.values):
            found = case.methods[method](x, row)
            for one in [found] if isinstance(found, Finding) else found:
                counts[one.kind][i, k] += 1
                sizes[i, k] = np.fmax(sizes[i, k], one.size)
    return {kind: n for kind, n in counts.items() if n.any()}, sizes
