"""Running a hazard: every method at every situation, counted by its way of failing.

Chain: hazard.py, the hazards, stability_map.py -> **this file** -> experiments/stability.py.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable

import numpy as np

from ...door import checks
from .failures import KINDS, Finding
from .hazard import Hazard
from .stability_map import StabilityMap

#: Built-in hazards: name -> the file that builds it.
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


def built_in(name: str, fast: bool = False) -> Hazard:
    """The built-in hazard of that name, or a ValueError; `fast` is a coarser map."""
    if name not in HAZARDS:
        raise ValueError(f"`hazard` is {name!r}, which is none of {', '.join(HAZARDS)}.")
    home = importlib.import_module(f".{HAZARDS[name]}", __package__)
    return getattr(home, name.replace("-", "_"))(fast)


@checks.door()
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
        A coarser map, which takes seconds.
    tell : callable, optional
        Called with every method's name and its processor time (s).

    Returns
    -------
    StabilityMap
        Counts of every way of failing, and the border that theory draws.

    Raises
    ------
    ValueError
        Unknown hazard or method.

    Notes
    -----
    Each hazard's file says where its border comes from.

    >>> bristles = stability("lugre", ["explicit Euler"], fast=True)
    >>> sorted(bristles.tally("explicit Euler"))[-1]
    'right'
    """
    case = built_in(hazard, fast) if isinstance(hazard, str) else hazard
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
        border[method] = np.array(
            [case.border(method, row) if case.border else np.nan for row in case.rows.values]
        )
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
