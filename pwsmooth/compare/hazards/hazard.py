"""A hazard: a plane of situations, the methods that are tried there, and the border that theory draws through it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...door import checks
from .failures import Finding
from .fixed import FIXED
from .stopping import SEERS

Trial = Callable[[float, float], "Finding | Sequence[Finding]"]


# Methods of one group share a column of the table.
GROUPS = {
    "event-driven": (
        "event-driven", "event-driven, 8(5,3) pair", "event-driven, layered", "event-driven, slaved",
        "event-driven, two-stage",
    ),
    "smoothed": ("smoothed path",),
    "fixed step": (*FIXED, "closed-form backward Euler", "Moreau-Jean"),
    "with events": ("DOP853, restarted", *SEERS, *(f"{name}, steps unbounded" for name in SEERS)),
}  # fmt: skip


def group_of(method: str) -> str:
    """Key of `GROUPS`, or "no events"."""
    return next((group for group, methods in GROUPS.items() if method in methods), "no events")


@checks.door()
@dataclass(frozen=True)
class Axis:
    """One coordinate of a map.

    Parameters
    ----------
    name : str
        With its unit.
    values : tuple of float
        In order, all positive or evenly spaced, in the unit that the name says.
    words : tuple of str
        Names of the values where they are cases and no numbers.

    >>> len(Axis("step h (s)", (1e-3, 1e-2, 1e-1)))
    3
    """

    name: str
    values: tuple[float, ...]
    words: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.values)


@checks.door()
@dataclass(frozen=True)
class Hazard:
    """One map to be made.

    Parameters
    ----------
    name, title : str
        For data files, and for readers.
    x, rows : Axis
        The ratio that decides, and the circumstance: every method is tried at every pair.
    methods : dict of str to Trial
        (x, row) -> one Finding, or one for every start tried there.
    border : callable, optional
        (method, row) -> x at which theory has the method fail; nan where it says nothing, as everywhere without it.
    law : str
        The border in words.
    worse : {"right", "left"}
        The side of the border on which theory expects failure.
    unit : str
        What the size of a finding is.
    truth : str
        Where the right answer comes from.

    Examples
    --------
    A hazard of one's own: Euler's method on x' = -100 x.

    >>> def euler(h, row):
    ...     return Finding("energy growth" if abs(1 - 100 * h) > 1 else "right")
    >>> mine = Hazard("decay", "x' = -100 x", Axis("h (s)", (0.005, 0.01, 0.05)), Axis("", (0.0,)),
    ...               {"explicit Euler": euler}, border=lambda method, row: 0.02, law="h = 2/100")
    >>> stability(mine).table_row()
    {'explicit Euler': "energy growth 33 %, at theory's border"}
    """

    name: str
    title: str
    x: Axis
    rows: Axis
    methods: dict[str, Trial]
    border: Callable[[str, float], float] | None = None
    law: str = ""
    worse: str = "right"
    unit: str = ""
    truth: str = "closed form"


def decades(first: float, last: float, each: float = 1) -> tuple[float, ...]:
    """Powers of ten from 10**first to 10**last, `each` to a decade; rounded, so that files read well."""
    n = int(round(abs(last - first) * each)) + 1
    return tuple(float(f"{10**e:.4g}") for e in np.linspace(first, last, n))
