"""Builds the documentation: draws the figures, runs the tutorials, makes the pages. Warnings are errors.

    pip install -e '.[docs]' && python docs/build.py

    --fast            figures with coarser curves and shorter sweeps
    --figures DIR     take the figures that `pwsmooth figures --out DIR` has made; those missing are drawn there
    --out DIR         where the pages go (docs/_build/html)
    --clean           forget earlier builds, executed pages included

Nothing is fetched. `python docs/check_pages.py` then opens every page in a browser.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
BUILD = DOCS / "_build"


def missing_figures(folder: Path, fast: bool) -> list[str]:
    """Names of figures that the folder lacks, or holds as fast ones where full ones are wanted."""
    from paper_figures.making import discover

    try:
        drawn = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        drawn = {}
    good = {name for name, entry in drawn.items() if fast or not entry["fast"]}
    return [name for name in discover() if name not in good]


def draw_figures(folder: Path, fast: bool) -> None:
    """Draw what is missing.

    Raises
    ------
    SystemExit
        A figure could not be drawn.
    """
    from paper_figures.making import make

    missing = missing_figures(folder, fast)
    if missing and not make(missing, out=folder, fast=fast):
        raise SystemExit("docs/build.py: a figure could not be drawn; its error stands above.")


def build(arguments: argparse.Namespace) -> int:
    """Figures, then Sphinx; the exit code of Sphinx."""
    sys.path.insert(0, str(ROOT))
    from pwsmooth.paths.warmup import warm_up

    if arguments.clean:
        for folder in (BUILD, DOCS / "auto"):
            shutil.rmtree(folder, ignore_errors=True)
    begun = time.perf_counter()
    figures = arguments.figures or BUILD / ("figures_fast" if arguments.fast else "figures")
    draw_figures(figures.resolve(), arguments.fast)
    warm_up()  # so that no page shows what a first run has to compile
    if (arguments.out / ".buildinfo").is_file():
        shutil.rmtree(arguments.out)  # pages of before, whose source is gone
    drawn = time.perf_counter()
    environment = os.environ | {"PWSMOOTH_DOCS_FIGURES": str(figures.resolve()), "MPLBACKEND": "Agg"}
    command = [
        sys.executable, "-m", "sphinx", "--builder", "html", "--fail-on-warning", "--keep-going", "--fresh-env",
        "--jobs", "auto", "--doctree-dir", str(BUILD / "doctrees"), *arguments.sphinx, str(DOCS), str(arguments.out),
    ]  # fmt: skip
    code = subprocess.run(command, env=environment, check=False).returncode
    ended = time.perf_counter()
    told = f"figures {drawn - begun:.0f} s, pages {ended - drawn:.0f} s"
    print(f"{arguments.out / 'index.html'} ({told})" if code == 0 else f"docs/build.py: FAILED ({told})")
    return code


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Build the documentation.")
    parser.add_argument("--fast", action="store_true", help="figures with coarser curves and shorter sweeps")
    parser.add_argument(
        "--figures", type=Path, metavar="DIR", help="figures made before; missing ones are drawn there"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", default=BUILD / "html", help="where the pages go")
    parser.add_argument("--clean", action="store_true", help="forget earlier builds, executed pages included")
    parser.add_argument("sphinx", nargs="*", help="further options of sphinx-build, after --")
    raise SystemExit(build(parser.parse_args()))


if __name__ == "__main__":
    main()
