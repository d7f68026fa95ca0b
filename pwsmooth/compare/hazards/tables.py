"""The table: hazard by group of methods, and what happens."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
    lines = [_line(["hazard", *(COLUMNS[g] for g in used)]), _line(["---"] * (len(used) + 1))]
    lines += [_line([row["hazard"], *(_cell(row[g]) for g in used)]) for row in rows]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("; ", "<br>").replace("|", "\\|") or "–"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
