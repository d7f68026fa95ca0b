"""Diagrams and bifurcation sets as xarray Datasets: branches one behind the other, special points.

Chain: line.py -> **dataset** -> result.py, sets.py.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .line import Line

if TYPE_CHECKING:
    import xarray


def columns_of(
    lines: Sequence[Line], index: str, parameters: Sequence[str], states: Sequence[str]
) -> dict[str, Any]:
    """Points of branches or curves one behind the other along "point": their number by `index`, parameters, states."""
    turns = max((line.count for line in lines), default=1)

    def joined(one: Callable[[Line], np.ndarray], empty: tuple[int, ...] = (0,)) -> np.ndarray:
        return np.concatenate([one(line) for line in lines]) if lines else np.zeros(empty)

    def padded(line: Line) -> np.ndarray:
        points = line.arrays["points"]
        return np.pad(points, ((0, 0), (0, turns - line.count), (0, 0)), constant_values=np.nan)

    sizes, points = [line.arrays["points"].shape[0] for line in lines], joined(padded, (0, turns, len(states)))
    values = joined(lambda line: np.atleast_2d(line.values).T, (0, len(parameters)))
    return {
        index: (("point",), np.repeat(np.arange(len(lines), dtype=np.int32), sizes)),
        **{name: (("point",), values[:, k]) for k, name in enumerate(parameters)},
        **{name: (("point", "turn"), points[:, :, k]) for k, name in enumerate(states)},
        **{
            key: (("point",), joined(lambda line, key=key: line.arrays[key]))  # type: ignore[misc]
            for key in ("admissible", "size", "period")
        },
    }


def dataset_of(diagram: Any, title: str) -> xarray.Dataset:
    """The Dataset of a Diagram."""
    import xarray

    data = columns_of(diagram.branches, "branch", (diagram.parameter,), diagram.states)
    ways = [np.append(branch.stable, branch.stable[-1:]) for branch in diagram.branches]
    data["stable"] = ("point",), np.concatenate(ways) if ways else np.zeros(0, bool)
    found = diagram._located
    data["special_kind"] = ("special",), np.array([b["kind"] for b in found], dtype=object)
    for key in ("parameter", "uncertainty", "branch"):
        data[f"special_{key}"] = ("special",), np.array([b[key] for b in found])
    if diagram.ends is not None:
        ends = diagram.ends
        data["value"] = ("value",), ends.values
        data |= {
            f"{name}_end": (("value", "start", "kept"), ends.points[..., k])
            for k, name in enumerate(diagram.states)
        }
        data["cycle"], data["outcome"] = (
            (("value", "start"), ends.cycle),
            (("value", "start"), ends.outcome),
        )
        data["explained_by"] = ("value", "start"), diagram.explained
    attrs = {
        "title": title, "parameter": diagram.parameter, "range": list(diagram.range),
        "origins": [branch.origin for branch in diagram.branches], "gaps": json.dumps(diagram.gaps),
        "lost": list(diagram.lost), "not_followed": diagram.left,
    }  # fmt: skip
    return xarray.Dataset(data, attrs=attrs)
