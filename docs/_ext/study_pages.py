"""A page for every experiment, from its script and the data file that it wrote; the benchmarks on a page of theirs."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

from page import (
    AUTO,
    ROOT,
    card,
    claims_table,
    code,
    fenced,
    grid,
    number,
    picture,
    plain,
    prose,
    provenance_text,
    shown,
    table,
    toctree,
    write,
)

SCRIPTS = ROOT / "experiments"
RESULTS = SCRIPTS / "results"
STUDIES = AUTO / "experiments"
# Shared by the scripts, no studies.
TOOLS = ("benchtools", "studytools", "gradient_peers", "noise_layer", "noise_oscillator")


def write_pages() -> None:
    """Gallery of the experiments, and the page of the benchmarks."""
    scripts = [p for p in sorted(SCRIPTS.glob("*.py")) if p.stem not in TOOLS]
    studies = [p for p in scripts if not p.stem.startswith("bench_")]
    cards = [_write_study(path) for path in studies]
    # Those with a chart first.
    cards = sorted(cards, key=lambda c: ":img-top:" not in c)
    tools = "".join(code(SCRIPTS / f"{name}.py") for name in TOOLS)
    write(
        STUDIES / "index.md",
        "# Experiments\n\nOne study a file: its question, the answer that was expected, a frozen configuration, data "
        "with their provenance, a chart drawn from the data.\n\n" + grid(cards) + f"\n## What they share\n\n{tools}\n"
        + toctree([path.stem for path in studies]),
    )  # fmt: skip
    _write_benchmarks([p for p in scripts if p.stem.startswith("bench_")])


def _docstring(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""


def _record(path: Path) -> dict[str, Any] | None:
    data = RESULTS / f"{path.stem}.json"
    return json.loads(data.read_text(encoding="utf-8")) if data.is_file() else None


def _title(path: Path) -> str:
    return path.stem.replace("_", " ").capitalize()


def _write_study(path: Path) -> str:
    """Writes the page, returns its card."""
    record, doc, title = _record(path), _docstring(path), _title(path)
    charts = _charts(path)
    parts = [f"# {plain(title)}\n"]
    question = (record or {}).get("question") or doc.split("\n\n")[0]
    if record and "question" in record:
        parts += [
            f"**Question.** {shown(record['question'])}\n",
            f"**Expected.** {shown(record['expected'])}\n",
        ]
        parts += [f"**Found.** {shown(record['verdict'])}\n"] if "verdict" in record else []
    parts += _pictures(path, plain(title), STUDIES)
    if record and record.get("claims"):
        parts += ["## Findings\n", claims_table(record["claims"], source="expected")]
    parts += ["## The study\n", prose(doc)]
    if record:
        parts += _provenance(path, record)
        if record.get("config"):
            parts.append(f"Configuration:\n\n{table(('parameter', 'value'), record['config'].items())}")
    else:
        parts.append("No data of it are kept in the repository; running it prints the table.\n")
    parts += ["## How to run it\n", fenced(f"python experiments/{path.name}", "console"), "", code(path)]
    write(STUDIES / f"{path.stem}.md", "\n".join(parts))
    return card(plain(title), question, path.stem, f"thumbnails/{charts[0].name}" if charts else None)


def _pictures(path: Path, title: str, folder: Path) -> list[str]:
    """Puts the charts of a script beside its page."""
    for chart in _charts(path):
        picture(chart, folder / chart.name)
    return [f"```{{image}} {c.name}\n:alt: {title}\n:width: 100%\n```\n" for c in _charts(path)]


def _charts(path: Path) -> list[Path]:
    """NAME.png and NAME_*.png, but for those of a study with a longer name."""
    longer = [p.stem for p in SCRIPTS.glob(f"{path.stem}_*.py")]
    found = [RESULTS / f"{path.stem}.png", *sorted(RESULTS.glob(f"{path.stem}_*.png"))]
    return [p for p in found if p.is_file() and not p.stem.startswith(tuple(longer))]


def _provenance(path: Path, record: dict[str, Any]) -> list[str]:
    parts = ["## Data\n"]
    source = record.get("provenance") or record.get("about") or {}
    told = provenance_text(source)
    if record.get("cpu_seconds"):
        told += plain(f"; {record['cpu_seconds']} s of processor time")
    if record.get("fast"):
        told += "; the fast configuration"
    parts.append(f"Made with {told}. {{download}}`{path.stem}.json <{_download(path)}>`\n")
    return parts


def _download(path: Path) -> str:
    return f"/../experiments/results/{path.stem}.json"


def _write_benchmarks(scripts: list[Path]) -> None:
    parts = [
        "# Benchmarks\n",
        "Tables against peers, made from the data files that the scripts write. Times are processor time, medians of "
        "interleaved rounds, compilation apart; each script says how rivals are tuned and which error they have to "
        "meet. Absolute times belong to the machine named; ratios travel.\n",
    ]
    for path in scripts:
        doc, record = _docstring(path), _record(path)
        title = plain(_title(path).removeprefix("Bench ").capitalize())
        parts += [f"## {title}\n", prose(doc)]
        rerun = f"python experiments/{path.name} --out experiments/results/{path.stem}.json"
        if record is None:
            parts.append("**No result is kept in the repository yet.** It is made by\n")
        else:
            parts += ["### Result\n", *_pictures(path, title, AUTO), *result_tables(record)]
            options = record.get("options")
            if options:
                shown = ", ".join(f"{k} {number(v)}" for k, v in options.items() if k != "out")
                parts.append(f"Options: {plain(shown)}.\n")
            source = record.get("provenance") or record.get("about") or {}
            told = f"Made with {provenance_text(source)}."
            parts.append(f"{told} {{download}}`{path.stem}.json <{_download(path)}>`\n\nAgain with\n")
        parts += [fenced(rerun, "console"), "", code(path)]
    write(AUTO / "benchmarks.md", "\n".join(parts))


_ASIDE = ("provenance", "options", "about", "config", "all rounds", "rounds")
_UNNAMED = ("results", "result", "rows")


def result_tables(record: dict[str, Any], title: str = "") -> list[str]:
    """Tables of whatever a benchmark has written: named numbers, rows of records, and groups of these.

    Groups that speak of the same things (time, error, setting of each entrant) are columns of one table; lists of
    raw rounds stay in the data file.
    """
    content = {k: v for k, v in record.items() if k not in _ASIDE and not _is_raw(v)}
    parts: list[str] = []
    scalars = {k: v for k, v in content.items() if not isinstance(v, dict) and not _is_table(v)}
    if scalars:
        parts += [_heading(title), table(("", "value"), scalars.items())]
    done: set[str] = set()
    for key, value in content.items():
        if key in done or key in scalars:
            continue
        name = " ".join(word for word in (title, "" if key in _UNNAMED else key) if word)
        if _is_table(value):
            columns = [k for k in value[0] if not isinstance(value[0][k], (dict, list))]
            parts += [_heading(name), table(columns, ([row.get(c) for c in columns] for row in value))]
        elif _is_flat(value):
            group = {k: v for k, v in content.items() if k not in done and _is_flat(v) and _alike(value, v)}
            done |= set(group)
            rows = list(dict.fromkeys(row for v in group.values() for row in v))
            head = ("", *(k if len(group) > 1 else "value" for k in group))
            parts += [_heading(title if len(group) > 1 else name)]
            parts += [table(head, ([row, *(v.get(row) for v in group.values())] for row in rows))]
        elif value and all(map(_is_flat, value.values())) and _all_alike(list(value.values())):
            columns = list(dict.fromkeys(c for v in value.values() for c in v))
            rows = ([row, *(v.get(c) for c in columns)] for row, v in value.items())
            parts += [_heading(name), table(("", *columns), rows)]
        else:
            parts += result_tables(value, name)
    return [part for part in parts if part]


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) for v in value)


def _is_raw(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(v, list) for v in value)


def _is_flat(value: Any) -> bool:
    return isinstance(value, dict) and bool(value) and not any(isinstance(v, dict) for v in value.values())


def _alike(one: dict, other: dict) -> bool:
    """Whether at least half of the names are common."""
    return 2 * len(one.keys() & other.keys()) >= min(len(one), len(other))


def _all_alike(groups: list[dict]) -> bool:
    return all(_alike(groups[0], group) for group in groups)


def _heading(title: str) -> str:
    return f"**{plain(title)}**\n" if title else ""
