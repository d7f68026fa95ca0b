"""What a ladder says: a table, a chart, a data set, and one recommendation.

Chain: climbing.py, judging.py -> **result** -> the command, docs, experiments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...door import checks
from .judging import Step, judge, recommend
from .rungs import Observable, Setting

if TYPE_CHECKING:
    import xarray

__all__ = ["Ladder"]

READ = "distance: from the richest rung; error bar: what the runs' own errors make of it; within, outside: surely so"


@checks.door()
@dataclass(frozen=True)
class Ladder:
    """An observable on every rung of a ladder, poorest first; indexing gives a `Step` by its rung's name.

    Attributes
    ----------
    scene, title : str
        Of the setting.
    steps : tuple of Step
        Poorest first, the last the richest.
    recommended : str or None
        Name of a rung; None if no rung below the richest is within the tolerance, or the richest has no answer.
    reason : str
        The recommendation in words.

    >>> found = ladder("impact", "restitution", "1%", repeats=1)
    >>> [step.verdict for step in found.steps]
    ['within', 'within', 'outside', 'richest']
    """

    scene: str
    title: str
    observable: Observable
    tolerance: float
    steps: tuple[Step, ...]
    recommended: str | None
    reason: str

    @classmethod
    def of(cls, setting: Setting, observable: Observable, tolerance: float, steps: Sequence[Step]) -> Ladder:
        """Judge measured steps, of which the last is the richest.

        Parameters
        ----------
        setting : Setting
            Whose name and title it takes.
        steps : sequence of Step
            Measured, poorest first.

        Returns
        -------
        Ladder
            With verdicts and a recommendation.
        """
        top = steps[-1]
        judged = []
        for step in steps:
            if step.failure:
                judged.append(replace(step, verdict="failed"))
            elif step is top:
                judged.append(replace(step, distance=0.0, bar=step.error + step.spread, verdict="richest"))
            else:
                distance = _distance(step.value, top.value)
                bar = step.error + step.spread + top.error + top.spread
                bar = bar if math.isfinite(distance) else 0.0
                judged.append(
                    replace(step, distance=distance, bar=bar, verdict=judge(distance, bar, tolerance))
                )
        name, reason = recommend(judged, tolerance)
        return cls(setting.name, setting.title, observable, tolerance, tuple(judged), name, reason)

    def __getitem__(self, name: str) -> Step:
        """A step by its rung's name."""
        for step in self.steps:
            if step.name == name:
                return step
        raise KeyError(f"{name!r} is no rung of this ladder; they are {', '.join(s.name for s in self.steps)}.")

    def __repr__(self) -> str:
        unit = f" {self.observable.unit}" if self.observable.unit != "1" else ""
        head = f"{self.title}: {self.observable.name}, {self.observable.meaning}"
        size = float(np.max(np.abs(self.steps[-1].value)))
        share = f", {100 * self.tolerance / size:.2g} % of the richest rung's value" if size > 0 else ""
        head += f"\ntolerance {self.tolerance:.3g}{unit}{share}"
        rows = self._rows()
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = [
            "  ".join(
                c.ljust(w) if k in (0, 6) else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths))
            ).rstrip()
            for row in rows
        ]
        matched = [f"  {s.name}: {s.failure or s.matched}" for s in self.steps]
        said = [f"recommended: {self.reason}", "", READ, "", "where the parameters come from:"]
        return "\n".join([head, "", *lines, "", *said, *matched])

    def _rows(self) -> list[tuple[str, ...]]:
        unit = f" ({self.observable.unit})" if self.observable.unit != "1" else ""
        rows = [("rung", f"value{unit}", "distance", "error bar", "time a run", "steps", "")]
        return rows + [
            (s.name, _value(s.value), _number(s.distance), _number(s.bar), _seconds(s.seconds),
             str(s.steps) if s.steps else "-", s.verdict) for s in self.steps
        ]  # fmt: skip

    def _repr_html_(self) -> str:
        from html import escape

        def line(row, cell, bold):
            weight = "font-weight:bold" if bold else ""
            aligned = ["left", *["right"] * 5, "left"]
            style = "padding:0 .6em;text-align"
            cells = [f"<{cell} style='{style}:{a}'>{escape(c)}</{cell}>" for a, c in zip(aligned, row)]
            return f"<tr style='{weight}'>{''.join(cells)}</tr>"

        head, *rows = self._rows()
        body = line(head, "th", False) + "".join(line(row, "td", row[0] == self.recommended) for row in rows)
        unit = f" {self.observable.unit}" if self.observable.unit != "1" else ""
        caption = f"{self.title}: {self.observable.meaning}; tolerance {self.tolerance:.3g}{unit}"
        return f"<table><caption>{escape(caption)}</caption>{body}</table><p>recommended: {escape(self.reason)}</p>"

    def records(self) -> dict[str, Any]:
        """Plain numbers and words, for a data file.

        Returns
        -------
        dict of str to value
            None where there is no finite number.
        """
        return {
            "scene": self.scene,
            "title": self.title,
            "observable": self.observable.name,
            "meaning": self.observable.meaning,
            "unit": self.observable.unit,
            "tolerance": _plain(self.tolerance),
            "recommended": self.recommended,
            "reason": self.reason,
            "rungs": [{key: _plain(value) for key, value in vars(step).items()} for step in self.steps],
        }

    @classmethod
    def from_records(cls, records: dict[str, Any]) -> Ladder:
        """The Ladder of a data file.

        Parameters
        ----------
        records : dict
            As `records` gives them.

        Returns
        -------
        Ladder
            Its observable can no longer be measured.
        """

        def number(x):
            return math.nan if x is None else x

        steps = []
        for row in records["rungs"]:
            numbers = ("error", "spread", "seconds", "distance", "bar")
            values = {k: number(v) if k in numbers else v for k, v in row.items()}
            steps.append(Step(**{**values, "value": np.array(row["value"], float)}))
        about = Observable(records["observable"], records["unit"], records["meaning"], lambda *_: None)
        return cls(records["scene"], records["title"], about, number(records["tolerance"]), tuple(steps),
                   records["recommended"], records["reason"])  # fmt: skip

    def to_dataset(self) -> xarray.Dataset:
        """The ladder as a labelled data set.

        Returns
        -------
        xarray.Dataset
            Every number over the dimension `rung`; a curve has a second one, `point`.
        """
        import xarray

        values = np.stack([np.broadcast_to(s.value, self.steps[-1].value.shape) for s in self.steps])
        dims = ("rung", "point") if values.ndim == 2 else ("rung",)
        data: dict[str, Any] = {"value": (dims, values)}
        for field in ("error", "spread", "distance", "bar", "seconds", "steps", "verdict", "matched"):
            data[field] = ("rung", [getattr(step, field) for step in self.steps])
        for field in ("error", "spread", "distance", "bar"):
            data[field] = (*data[field], {"units": self.observable.unit})
        about = {key: value for key, value in self.records().items() if key != "rungs"}
        about["recommended"] = self.recommended or "none is"
        return xarray.Dataset(data, coords={"rung": [s.name for s in self.steps]}, attrs=about)

    def chart(self, axes: Any = None) -> Any:
        """Distance and cost of every rung.

        Parameters
        ----------
        axes : sequence of two Axes, optional
            Those of a new figure by default.

        Returns
        -------
        sequence of two Axes
            Distance, and cost.
        """
        from .chart import plot_ladder

        return plot_ladder(self, axes)


def _distance(a, b):
    if a.shape != b.shape:
        raise ValueError(
            f"the observable has shape {a.shape} on one rung and {b.shape} on the richest; let it return the same."
        )
    distance = np.where(a == b, 0.0, np.abs(np.where(a == b, 0.0, a) - np.where(a == b, 0.0, b)))
    return float(np.max(np.where(np.isnan(distance), np.inf, distance)))


def _plain(value):
    if isinstance(value, np.ndarray):
        return [_plain(float(v)) for v in value] if value.ndim else _plain(float(value))
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _value(value):
    if value.ndim:
        return f"curve, {value.size} points"
    return "does not occur" if np.isnan(value) else f"{float(value):.6g}"


def _number(x):
    return f"{x:.2g}" if math.isfinite(x) else "-"


def _seconds(x):
    return "-" if math.isnan(x) or x == 0 else f"{x * 1e3:.3g} ms"
