"""The table: hazard by group of methods, and what happens."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .hazard import group_of
from .stability_map import StabilityMap, what_happens

# Groups of methods in the order of the columns, with their headings.
COLUMNS = {
    "event-driven": "event-driven (this package)",
    "smoothed": "smoothed (this package)",
    "with events": "stopped at events",
    "no events": "unguarded adaptive",
    "fixed step": "fixed step",
}


def table(records: Iterable[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Rows {"hazard": title, group: "method: what happens; ..."} of the records of a data file."""
    rows = []
    for record in records:
        map_ = StabilityMap.from_record(record)
        cells: dict[str, list[str]] = {group: [] for group in COLUMNS}
        for method in map_.methods:
            cells[group_of(method)].append(f"{method}: {what_happens(map_, method)}")
        rows.append({"hazard": map_.title} | {g: "; ".join(c) for g, c in cells.items()})
    return rows


def markdown(content: Mapping[str, Any]) -> str:
    """The table of a data file (experiments/results/stability.json) as markdown.

    A row a hazard, a column a group of methods; shares are of all runs of the map, content["data"]["maps"].
    """
    rows = table(content["data"]["maps"])
    used = [g for g in COLUMNS if any(row[g] for row in rows)]
    lines = [["hazard", *(COLUMNS[g] for g in used)], ["---"] * (len(used) + 1)]
    for row in rows:
        cells = [row[g].replace("; ", "<br>").replace("|", "\\|") or "–" for g in used]
        lines.append([row["hazard"], *cells])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
