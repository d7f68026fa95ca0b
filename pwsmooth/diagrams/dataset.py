"""A diagram as an xarray Dataset: ragged branches one behind the other, special points, the orbit diagram.

Chain: **dataset** -> result.py.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray


def dataset_of(diagram: Any, title: str) -> xarray.Dataset:
    """The Dataset of a Diagram."""
    import xarray

    turns = max((branch.count for branch in diagram.branches), default=1)
    stacked: dict[str, list[Any]] = {
        key: [] for key in ("branch", "parameter", "points", "stable", "virtual", "size", "period")
    }
    for k, branch in enumerate(diagram.branches):
        a = branch.arrays
        points = np.full((len(branch.q), turns, len(diagram.states)), np.nan)
        points[:, : branch.count] = a["points"]
        ways = np.append(branch.stable, branch.stable[-1:])
        parts = (
            np.full(len(branch.q), k, np.int32),
            branch.q,
            points,
            ways,
            a["virtual"],
            a["size"],
            a["period"],
        )
        for values, part in zip(stacked.values(), parts):
            values.append(part)
    empty: dict[str, np.ndarray] = {
        "branch": np.zeros(0, np.int32),
        "points": np.zeros((0, turns, len(diagram.states))),
    }
    joined = {k: np.concatenate(v) if v else empty.get(k, np.zeros(0)) for k, v in stacked.items()}
    points = joined.pop("points")
    data: dict[str, Any] = {
        diagram.parameter if key == "parameter" else key: (("point",), values) for key, values in joined.items()
    }
    data |= {name: (("point", "turn"), points[:, :, k]) for k, name in enumerate(diagram.states)}
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
