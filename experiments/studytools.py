"""What the studies share: a question with its expected answer, a frozen configuration, data with provenance, a chart.

    python experiments/NAME.py [--fast] [--out DIR]       compute, write DIR/NAME.json, draw DIR/NAME.png
    python experiments/NAME.py --draw DIR/NAME.json       judge and draw again from the data

After a kill the first goes on with the parts that were finished, where the study has any.

The chart and the claims are made from the data file's content alone.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchtools import provenance, write_json

from paper_figures.claims import Claim, counted
from pwsmooth import plotting
from pwsmooth.paths.interrupts import SECONDS, processes
from pwsmooth.results.files import write_whole

__all__ = ["Claim", "Study", "claim", "command", "part", "parts"]

RESULTS = Path(__file__).resolve().parent / "results"


@dataclass(frozen=True)
class Study:
    """One study.

    `run` turns a configuration (a frozen dataclass) into data of plain numbers, lists and dicts; `claims` and `draw`
    take these data, as they come back from the file; `verdict` says from them in a sentence or two whether what was
    expected held.
    """

    name: str
    question: str
    expected: str
    full: Any
    fast: Any
    run: Callable[[Any], dict]
    claims: Callable[[dict], list[Claim]]
    draw: Callable[[dict], Any]
    verdict: Callable[[dict], str] | None = None


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


_parts: dict = {}
_parts_file: list[Path] = []  # of the study that runs as a command
_began = {"cpu": 0.0, "clock": 0.0}  # when the run did, moved back by what a killed one had spent on its parts


def _spent() -> dict[str, float]:
    return {"cpu": time.process_time() - _began["cpu"], "clock": time.monotonic() - _began["clock"]}


def _keep(name: str, value: Any) -> None:
    _parts[name] = value
    _parts["spent"] = _spent()
    for file in _parts_file:
        write_json(file, _parts)


def part(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments) as plain data; a study that was killed finds it again, in NAME.parts.json."""
    return parts({name: (function, *arguments)}, workers=1)[0]


def parts(cases: Mapping[str, tuple[Any, ...]], workers: int | None = None) -> list[Any]:
    """Parts that do not know of one another: name -> (function, *arguments); in processes, one a core.

    What is in the cases has to be importable from where it stands, as processes begin with nothing.
    """
    missing = [name for name in cases if name not in _parts]
    if workers == 1 or len(missing) < 2:
        for name in missing:
            _keep(name, plain(cases[name][0](*cases[name][1:])))
        return [_parts[name] for name in cases]
    with processes(min(workers or os.cpu_count() or 1, len(missing))) as (pool, look):
        running = {pool.submit(_measured, *cases[name]): name for name in missing}
        left = set(running)
        while left:
            done, left = wait(left, SECONDS, return_when=FIRST_COMPLETED)
            for one in done:
                value, cpu = one.result()
                _began["cpu"] -= cpu
                _keep(running[one], value)
            look()
    return [_parts[name] for name in cases]


_imported: list[bool] = []


def _measured(function: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """In a process of its own: function(*arguments) as plain data, and the processor time since what came before it."""
    since = time.process_time() if _imported else 0.0  # the first part pays for the imports
    _imported.append(True)
    return plain(function(*arguments)), time.process_time() - since


def _resume(file: Path, begun: dict) -> None:
    """Takes up what a run of the same script, configuration and versions has left."""
    _parts.clear()
    left = json.loads(file.read_text()) if file.is_file() else {}
    _parts.update(left if left.get("begun") == begun else {"begun": begun})
    _parts_file[:] = [file]


def judged(study: Study, data: dict) -> dict:
    """What a data file says of its data."""
    said = {"claims": [claim.record() for claim in study.claims(data)]}
    return said if study.verdict is None else {"verdict": study.verdict(data)} | said


def result(study: Study, fast: bool = False) -> dict:
    """Compute a study: its data file's content."""
    config = study.fast if fast else study.full
    if not _parts_file:
        _parts.clear()
    _began.update(cpu=0.0, clock=0.0)
    earlier, now = _parts.get("spent", {"cpu": 0.0, "clock": 0.0}), _spent()
    _began.update({key: now[key] - earlier[key] for key in now})
    data, spent = plain(study.run(config)), _spent()
    return {
        "study": study.name,
        "question": study.question,
        "expected": study.expected,
        "config": plain(dataclasses.asdict(config)),
        "fast": fast,
        "data": data,
        **judged(study, data),
        "cpu_seconds": round(spent["cpu"], 1),
        "clock_seconds": round(spent["clock"], 1),
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
        content |= judged(study, content["data"])
    else:
        folder = options.out
        folder.mkdir(parents=True, exist_ok=True)
        script = hashlib.sha256(Path(sys.argv[0]).read_bytes()).hexdigest()
        config = plain(dataclasses.asdict(study.fast if options.fast else study.full))
        _resume(folder / f"{study.name}.parts.json", {"script": script, "config": config, **provenance()})
        content = result(study, options.fast)
    write_json(folder / f"{study.name}.json", content)
    for file in _parts_file:
        file.unlink(missing_ok=True)
    draw(study, content, folder / f"{study.name}.png")
    print(study.question, "\nexpected:", study.expected)
    print("found:", content.get("verdict", ""))
    for claim in content["claims"]:
        reason = f" ({claim['reason']})" if claim["reason"] else ""
        print(
            f"- {claim['claim']}\n    expected {claim['source']}; found {claim['ours']}: {claim['verdict']}{reason}"
        )
    print(f"{counted(content['claims'])}; written to {folder}; {content['cpu_seconds']} s of processor time")
