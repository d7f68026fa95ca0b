"""What the studies share: a question with its expected answer, a frozen configuration, data with provenance, a chart.

    python experiments/NAME.py [--fast] [--out DIR]       compute, write DIR/NAME.json, draw DIR/NAME.png
    python experiments/NAME.py --draw DIR/NAME.json       judge and draw again from the data

The chart and the claims are made from the data file's content alone.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchtools import provenance, write_json

from pwsmooth import plotting
from pwsmooth.claims import Claim, counted
from pwsmooth.results.files import write_whole

__all__ = ["Claim", "Study", "claim", "command"]

RESULTS = Path(__file__).resolve().parent / "results"


@dataclass(frozen=True)
class Study:
    """One study.

    `run` turns a configuration (a frozen dataclass) into data of plain numbers, lists and dicts; `claims` and `draw`
    take these data, as they come back from the file.
    """

    name: str
    question: str
    expected: str
    full: Any
    fast: Any
    run: Callable[[Any], dict]
    claims: Callable[[dict], list[Claim]]
    draw: Callable[[dict], Any]


def claim(
    statement: str,
    source: str,
    ours: str,
    holds: bool,
    otherwise: str,
    *,
    origin: str = "expected",
    where: str = "",
) -> Claim:
    """A Claim whose reason stands only where it does not hold."""
    return Claim(statement, source, ours, bool(holds), "" if holds else otherwise, origin, where)


DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1, 1, 1)))  # beside the colours, for print in grey


def draw_set(ax: Any, curves: list[tuple[str, Any]], meets: list[Any], rows: list[Any]) -> None:
    """A bifurcation set: curves (name, values (2, K)), points of codimension 2, points of its check."""
    names = "left right stick fast approximation velocity smoothed CVODE numbalsoda mark".split()
    keys, shown = sorted({name for name, _ in curves}), set()
    for name, values in curves:
        k = keys.index(name)
        ax.plot(
            *np.array(values), color=plotting.COLOUR[names[k % 10]], linewidth=1.2,
            linestyle=DASHES[k % 4], label=None if name in shown else name,
        )  # fmt: skip
        shown.add(name)
    if meets:
        look = dict(color=plotting.COLOUR["mark"], markersize=3.5, fillstyle="none", zorder=3)
        ax.plot(*np.array(meets).T, "o", label="codimension 2", **look)
    for good, mark, label in ((True, ".", "checked: admitted"), (False, "x", "checked: not admitted")):
        at = [row["at"] for row in rows if (not row["failures"]) == good]
        if at:
            colour = "#BBBBBB" if good else "#CC0000"
            ax.plot(*np.array(at).T, mark, color=colour, markersize=4, label=label, zorder=1)


def plain(value: Any) -> Any:
    """Arrays and numpy numbers as lists and numbers; nan and infinities as None, which JSON has."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(v) for v in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def result(study: Study, fast: bool = False) -> dict:
    """Compute a study: its data file's content."""
    config = study.fast if fast else study.full
    begun = time.process_time()
    data = plain(study.run(config))
    return {
        "study": study.name,
        "question": study.question,
        "expected": study.expected,
        "config": plain(dataclasses.asdict(config)),
        "fast": fast,
        "data": data,
        "claims": [claim.record() for claim in study.claims(data)],
        "cpu_seconds": round(time.process_time() - begun, 1),
        "provenance": provenance(),
    }


def draw(study: Study, content: dict, target: Path) -> None:
    """The chart as a PNG; of several, a mapping, the first has the name "" and the others add theirs to the file's."""
    import io

    with plotting.style():
        drawn = study.draw(content["data"] | {"provenance": content.get("provenance")})
        for name, figure in drawn.items() if isinstance(drawn, dict) else [("", drawn)]:
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png")
            write_whole(target.with_stem(target.stem + (f"_{name}" if name else "")), buffer.getvalue())


def command(study: Study) -> None:
    """The command line of a study."""
    parser = argparse.ArgumentParser(description=study.question)
    parser.add_argument("--fast", action="store_true", help="coarser, in seconds")
    parser.add_argument("--out", type=Path, default=RESULTS, help="directory of the data and the chart")
    parser.add_argument("--draw", type=Path, metavar="FILE.json", help="judge and draw again from a data file")
    options = parser.parse_args()
    if options.draw:
        content, folder = json.loads(options.draw.read_text()), options.draw.parent
        content["claims"] = [c.record() for c in study.claims(content["data"])]
    else:
        content, folder = result(study, options.fast), options.out
        folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / f"{study.name}.json", content)
    draw(study, content, folder / f"{study.name}.png")
    print(study.question, "\nexpected:", study.expected)
    for claim in content["claims"]:
        reason = f" ({claim['reason']})" if claim["reason"] else ""
        print(
            f"- {claim['claim']}\n    expected {claim['source']}; found {claim['ours']}: {claim['verdict']}{reason}"
        )
    print(f"{counted(content['claims'])}; written to {folder}; {content['cpu_seconds']} s")
