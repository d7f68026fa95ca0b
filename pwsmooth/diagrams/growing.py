"""One curve of bifurcations in two parameters from one point, and whether another point lies on it.

Chain: plain.py -> **growing** -> sets.py, over_two.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..analysis.continuation.curves.starts import FOLLOWED
from ..analysis.continuation.equilibria import curves as of_equilibria
from ..analysis.continuation.following import follow
from ..analysis.continuation.steps import Steps
from ..analysis.equilibria.equilibrium import Equilibrium
from ..analysis.maps.sections import Section, Stroboscopic
from .plain import Setting, aligned, points_of, special_of


def grown(setting: Setting, task: Mapping[str, Any]) -> dict[str, Any]:
    """The curve of a task: {"arrays": ..., "about": ...}; only "about" with "lost" in words where there is none."""
    try:
        bifurcation = special_of(task["bifurcation"], setting)
        curve: Any = follow(
            bifurcation, task["ranges"], virtual=task["virtual"], steps=Steps(max_points=task["most"])
        )
    except (
        ArithmeticError,
        np.linalg.LinAlgError,
        ValueError,
    ) as error:  # one that cannot be followed, as a rule
        return {"arrays": {}, "about": {"lost": str(error)}}
    if len(curve.points) < 2:
        return {"arrays": {}, "about": {"lost": "; ".join(curve.ends)}}
    n = len(setting.system.model.states)
    pairs = [_points(item, setting, n) for item in curve.points]
    count = max(len(points) for points, _ in pairs)
    points, mirrored = (np.full((len(pairs), count, n), np.nan) for _ in range(2))
    for k, (own, other) in enumerate(pairs):
        shift = aligned(own, points[k - 1]) if k and own.shape == points[k - 1].shape else 0
        points[k, : len(own)] = np.roll(own, shift, axis=0)
        if other is not None:
            mirrored[k, : len(other)] = np.roll(other, shift, axis=0)
    arrays = {
        "values": curve.values, "points": points, "mirrored": mirrored, "admissible": curve.admissible,
        "size": np.array([_size(item) for item in curve.points]),
        "period": np.array([getattr(item, "period", np.nan) for item in curve.points]),
        **{f"test {name}": values for name, values in curve.tests.items()},
    }  # fmt: skip
    about = {
        "lost": "", "parameters": list(curve.parameters), "kind": curve.kind, "ends": list(curve.ends),
        "equilibria": curve.of_equilibria,
        "specials": [{"kind": p.kind, "at": list(p.values.values()), "note": p.note} for p in curve.specials],
    }  # fmt: skip
    return {"arrays": arrays, "about": about}


def condition_of(data: Mapping[str, Any]) -> str | None:
    """The kind of the curve on which a bifurcation lies, given as data; None where no such curves are followed."""
    kind, still = data["kind"], data["point"].get("equilibrium", False)
    if still and kind.startswith(of_equilibria.BOUNDARY):
        kind = of_equilibria.BOUNDARY
    return kind if kind in (of_equilibria.FOLLOWED if still else FOLLOWED) else None


def _size(item: Any) -> float:
    """The largest modulus of the multipliers; of an equilibrium the rightmost eigenvalue's real part."""
    if isinstance(item, Equilibrium):
        return float(item.eigenvalues.real.max(initial=-np.inf))
    return float(np.abs(item.multipliers).max(initial=0.0))


def _points(orbit: Any, setting: Setting, n: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Points once a period (returns), or the equilibrium; nan of virtual orbits, and of maps without such points."""
    if isinstance(orbit, Equilibrium):
        return points_of(orbit, setting)
    map_ = getattr(orbit.map, "base", orbit.map)
    if orbit.success and len(orbit.x) == n and isinstance(map_, (Stroboscopic, Section)):
        return points_of(replace(orbit, map=map_), setting)
    return np.full((1, n), np.nan), None
