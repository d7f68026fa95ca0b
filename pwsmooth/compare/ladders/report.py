"""What `pwsmooth ladder` prints and writes."""

from __future__ import annotations

import json
import platform
from importlib.metadata import version
from pathlib import Path

from .catalogue import scenes, setting_of
from .climbing import ladder
from .result import Ladder


def show_list(scene: str = "") -> None:
    """Prints the scenes and their observables; of one scene if it is named."""
    for name in (scene,) if scene else scenes():
        setting = setting_of(name)
        print(f"{setting.name}: {setting.title}")
        width = max(len(o.name) for o in setting.observables)
        for observable in setting.observables:
            unit = f" ({observable.unit})" if observable.unit != "1" else ""
            print(f"    {observable.name:<{width}}  {observable.meaning}{unit}")


def run(scene: str, observable: str, tolerance: str, out: Path | None) -> Ladder:
    """Climbs, prints the table, and writes data and chart into `out`."""
    if not scene:
        raise ValueError(f"no scene is named; choose one of {', '.join(scenes())}, or --list.")
    if not observable:
        names = ", ".join(o.name for o in setting_of(scene).observables)
        raise ValueError(f"no observable is named; choose one of {names} with --observable.")
    from rich.console import Console

    # The status line is shown on a terminal only, and disappears afterwards.
    with Console(stderr=True).status(f"running every model of {scene!r} at two tolerances, and timing it ..."):
        found = ladder(scene, observable, tolerance)
    print(found)
    if out is not None:
        print(f"\nwritten to {', '.join(str(path) for path in write(found, out))}")
    return found


def write(ladder: Ladder, out: Path) -> tuple[Path, Path]:
    """The data file and the chart of a ladder; returns their paths."""
    import io

    from ... import plotting
    from ...results.files import write_whole

    out.mkdir(parents=True, exist_ok=True)
    stem = f"ladder {ladder.scene} {ladder.observable.name}".replace(" ", "_")
    data, chart = out / f"{stem}.json", out / f"{stem}.png"
    versions = {
        "pwsmooth": version("pwsmooth"),
        "python": platform.python_version(),
        "machine": platform.machine(),
    }
    write_whole(data, json.dumps({**ladder.records(), "provenance": versions}, indent=1).encode())
    with plotting.style():
        buffer = io.BytesIO()
        ladder.chart()[0].figure.savefig(buffer, format="png")
    write_whole(chart, buffer.getvalue())
    return data, chart
