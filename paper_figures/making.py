"""The command `pwsmooth figures`: finds the figures of a checkout, makes them, and tabulates their claims.

A figure is one file `paper_figures/figure_NN.py` with NAME, TITLE, CAPTION and `draw(fast)`, which returns a
matplotlib Figure and its Claims. Figures that keep runs for each other say so by one word, SHARES: they are made in one
process. Files appear whole or not at all: written beside their place, then moved.
"""

from __future__ import annotations

import importlib
import io
import json
import sys
import time
import traceback
from collections.abc import Generator, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import closing
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

from pwsmooth.codegen.machine.workers import cores
from pwsmooth.door import checks
from pwsmooth.paths.interrupts import processes, result
from pwsmooth.paths.warmup import warm_up
from pwsmooth.results.files import PARTIAL, write_whole

from .claims import Claim, print_claims

__all__ = ["Claim", "FiguresError", "discover", "make", "print_list"]


class FiguresError(ValueError):
    """The command cannot run as asked; the text says what to do.

    Examples
    --------
    >>> from paper_figures.making import FiguresError
    >>> issubclass(FiguresError, Exception)
    True
    """


def discover(names: Iterable[str] = ()) -> dict[str, ModuleType]:
    """Modules of the figures by name, in the order of their numbers.

    Parameters
    ----------
    names : iterable of str
        Those wanted, as "4", "04", "figure_04"; all by default.

    Returns
    -------
    dict of str to module
        Name -> the figure's module, with NAME, TITLE, CAPTION and draw.

    Raises
    ------
    FiguresError
        A name is unknown.

    Examples
    --------
    >>> from paper_figures.making import discover
    >>> list(discover(["4"]))
    ['4']
    """
    modules: dict[str, ModuleType] = {}
    for path in sorted(Path(__file__).parent.glob("figure_*.py")):
        module = importlib.import_module(f"paper_figures.{path.stem}")
        modules[str(module.NAME)] = module
    wanted = [_plain(name) for name in names]
    unknown = [name for name in wanted if name not in modules]
    if unknown:
        raise FiguresError(f"no figure is named {', '.join(unknown)}; there are {', '.join(modules)}")
    return {name: module for name, module in modules.items() if not wanted or name in wanted}


def _plain(name: str) -> str:
    """ "4", "04", "figure_04" and "figure 4" all name figure 4."""
    bare = name.lower().removesuffix(".py").removeprefix("figure").strip(" _-")
    return bare.lstrip("0") or name


def print_list() -> None:
    """Print the name and title of every figure.

    Notes
    -----
    It is `pwsmooth figures --list`.

    Examples
    --------
    >>> from paper_figures.making import print_list
    >>> print_list()  # doctest: +ELLIPSIS
      1  Switching characteristics for friction
      2  ...
    """
    from rich.console import Console

    console = Console()
    for name, module in discover().items():
        console.print(f"{name:>3}  {module.TITLE}", highlight=False, soft_wrap=True)


@checks.door()
def make(
    names: Sequence[str] = (), *, out: Path, fast: bool = False, jobs: int | None = 1, everything: bool = False
) -> bool:
    """Make figures and write `figure_NN.png`, `figure_NN.pdf`, `captions.md` and `claims.json` into `out`.

    Parameters
    ----------
    names : sequence of str
        Figures to make; all if empty.
    out : Path
        Made if missing.
    fast : bool
        Coarser curves and shorter sweeps.
    jobs : int or None
        Figures that are made at a time, each in a process of its own where it is more than one; one a core for None.
        A script that asks for several is guarded by ``if __name__ == "__main__"``.
    everything : bool
        Print every claim, and not only their counts and those that do not hold.

    Returns
    -------
    bool
        Whether every figure was made; a figure that fails is reported and the others go on.

    Raises
    ------
    FiguresError
        A name is unknown, `jobs` is below 1, or `out` cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from paper_figures.making import make
    >>> with tempfile.TemporaryDirectory() as out:
    ...     done = make(["4"], out=out, fast=True)  # doctest: +ELLIPSIS
    ...     written = sorted(path.name for path in Path(out).iterdir())
    figure  4 ...
    >>> done, written
    (True, ['captions.md', 'claims.json', 'figure_04.pdf', 'figure_04.png'])
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    jobs = cores() if jobs is None else jobs
    if jobs < 1:
        raise FiguresError(f"`jobs` is {jobs}; at least one figure is made at a time")
    modules = discover(names)
    out = Path(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        for leftover in out.glob(f"{PARTIAL}*"):  # of a run that was killed
            leftover.unlink(missing_ok=True)
    except OSError as error:
        raise FiguresError(f"`--out` {out} cannot be written: {error.strerror}") from error
    # Off a terminal the table keeps its columns instead of folding them to 80 characters.
    console = Console() if sys.stdout.isatty() else Console(width=160)
    entries: dict[str, dict[str, Any]] = {}
    failures: list[str] = []
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    jobs = min(jobs, len(modules))
    if jobs > 1 and not names:
        warm_up()  # once, before each process finds out that it has to
    with Progress(*columns, console=console) as progress, closing(_attempts(modules, out, fast, jobs)) as made:
        task = progress.add_task("figures", total=len(modules))
        for name, module in modules.items():
            progress.update(task, description=f"figure {name}")
            claims, wrong, seconds = next(made)
            if wrong:
                failures.append(name)
                progress.console.print(f"figure {name} FAILED\n{wrong}", markup=False)
            else:
                entries[name] = _entry(module, claims, fast)
                _write_records(out, entries)
                progress.console.print(f"figure {name:>2}  {seconds:5.1f} s  {module.TITLE}", highlight=False)
            progress.advance(task)
    print_claims(console, entries, everything=everything)
    console.print(f"written to {out}", highlight=False, soft_wrap=True)
    if failures:
        console.print(f"FAILED: figures {', '.join(failures)}", style="bold red")
    return not failures


_Attempt = tuple[list[Claim], str, float]  # claims, what went wrong, seconds


def _attempts(
    modules: dict[str, ModuleType], out: Path, fast: bool, jobs: int
) -> Generator[_Attempt, None, None]:
    """One attempt after another, in the order of the figures, however many run at a time."""
    if jobs == 1:
        for module in modules.values():
            yield _attempt(module, out, fast)
        return
    sharing: dict[str, list[str]] = {}
    for name, module in modules.items():
        sharing.setdefault(getattr(module, "SHARES", name), []).append(name)
    with processes(jobs) as (pool, look):
        futures: dict[str, Future[dict[str, _Attempt]]] = {}
        for names in sorted(sharing.values(), key=len, reverse=True):  # what may take longest begins first
            futures |= dict.fromkeys(names, pool.submit(_attempts_of, names, out, fast))
        pool.submit(int)  # only from now on does the pool surely notice the end of the process that began last
        for name in modules:
            try:
                yield result(futures[name], look)[name]
            except BrokenExecutor as error:  # killed, as where memory is short: the pool has ended with it
                yield [], f"{error}\n", 0.0


def _attempts_of(names: list[str], out: Path, fast: bool) -> dict[str, _Attempt]:
    return {name: _attempt(module, out, fast) for name, module in discover(names).items()}


def _attempt(module: ModuleType, out: Path, fast: bool) -> _Attempt:
    begun = time.perf_counter()
    try:
        claims, wrong = _make_one(module, out, fast), ""
    except Exception:  # one broken figure must not cost the others
        claims, wrong = [], traceback.format_exc()
    return claims, wrong, time.perf_counter() - begun


def _stem(module: ModuleType) -> str:
    return module.__name__.rpartition(".")[2]


def _legible(figure: Any) -> None:
    """No legend below 6 pt where the figure is printed in one column, 3.5 in wide."""
    least = 6 * figure.get_figwidth() / 3.5
    for legend in [*figure.legends, *(ax.get_legend() for ax in figure.axes)]:
        for text in legend.get_texts() if legend else ():
            text.set_fontsize(max(text.get_fontsize(), least))


def _make_one(module: ModuleType, out: Path, fast: bool) -> list[Claim]:
    from pwsmooth import plotting

    with plotting.style():
        figure, claims = module.draw(fast)
        _legible(figure)
        rendered = {}
        for suffix in ("png", "pdf"):
            buffer = io.BytesIO()
            # No date in the file: the same input gives the same bytes.
            metadata = {"Title": module.TITLE} | ({"CreationDate": None} if suffix == "pdf" else {})
            figure.savefig(buffer, format=suffix, metadata=metadata)
            rendered[suffix] = buffer.getvalue()
    for suffix, content in rendered.items():
        write_whole(out / f"{_stem(module)}.{suffix}", content)
    return list(claims)


def _entry(module: ModuleType, claims: Sequence[Claim], fast: bool) -> dict[str, Any]:

    return {
        "title": module.TITLE,
        "caption": " ".join(module.CAPTION.split()),
        "files": [f"{_stem(module)}.png", f"{_stem(module)}.pdf"],
        "fast": fast,
        "pwsmooth": version("pwsmooth"),
        "claims": [claim.record() for claim in claims],
    }


def _write_records(out: Path, entries: dict[str, dict[str, Any]]) -> None:
    """claims.json and captions.md; figures of an earlier run that are still there keep their entries."""
    path = out / "claims.json"
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        kept = {}
    merged = {**kept, **entries}
    merged = {name: merged[name] for name in sorted(merged, key=lambda n: (len(n), n))}
    write_whole(path, (json.dumps(merged, indent=2, ensure_ascii=False) + "\n").encode())
    parts = [f"## Figure {name}. {entry['title']}\n\n{entry['caption']}\n" for name, entry in merged.items()]
    write_whole(out / "captions.md", "\n".join(parts).encode())
