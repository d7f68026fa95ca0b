"""The command `pwsmooth`.

Only typer is imported here, so that `pwsmooth --help` is quick; each command imports what it needs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Exact switching for piecewise-smooth dynamics.",
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"pwsmooth {version('pwsmooth')}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Exact switching for piecewise-smooth dynamics."""


@app.command()
def figures(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Figures to make, e.g. 4 8; all without.")
    ] = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the figures and leave.")] = False,
    out: Annotated[Path, typer.Option(help="Directory for the PNG and PDF files and claims.json.")] = Path(
        "figures"
    ),
    fast: Annotated[bool, typer.Option("--fast", help="Coarser curves and shorter sweeps.")] = False,
) -> None:
    """Make the figures of the solid-friction paper, and the table of what it claims.

    Runs in a checkout of the project, where the scripts of the figures are.
    """
    from pwsmooth import figures as machinery

    try:
        if list_only:
            machinery.print_list()
            return
        all_made = machinery.make(names or [], out=out, fast=fast)
    except machinery.FiguresError as error:
        typer.echo(f"pwsmooth figures: {error}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo("pwsmooth figures: interrupted; the figures listed above are complete.", err=True)
        raise typer.Exit(130) from None
    if not all_made:
        raise typer.Exit(1)


@app.command()
def verify(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Problems to solve; all without.")
    ] = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the problems and leave.")] = False,
) -> None:
    """Solve the built-in problems with exact answers, and print computed, exact, error and time.

    The exit code is 1 when a number misses its exact value by more than its tolerance.
    """
    from pwsmooth.compare import report

    try:
        held = report.list_problems() if list_only else report.run(names or [])
    except ValueError as error:
        typer.echo(f"pwsmooth verify: {error}", err=True)
        raise typer.Exit(2) from None
    if not held:
        raise typer.Exit(1)


@app.command()
def sweep(
    study: Annotated[Path, typer.Argument(help="TOML file: system, axes, measures, tolerances.")],
    out: Annotated[Path, typer.Option(help="Directory for the store, <STUDY>.zarr.")] = Path("."),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a store that is there.")] = False,
    workers: Annotated[int | None, typer.Option(help="Threads; one a core without.")] = None,
) -> None:
    """Run a parameter study into a Zarr store that survives any kill.

    The format of the file is described in pwsmooth/sweep/study.py.
    """
    from pwsmooth.sweep.study import run_study

    try:
        data, store = run_study(study, out, resume, workers, None)
    except (ValueError, TypeError, ImportError, RuntimeError) as error:
        typer.echo(f"pwsmooth sweep: {error}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo("pwsmooth sweep: interrupted; finished chunks are kept, --resume goes on.", err=True)
        raise typer.Exit(130) from None
    names = dict(zip(data.outcome.attrs["flag_values"], data.outcome.attrs["flag_meanings"].split()))
    codes = data.outcome.values.ravel().tolist()
    told = ", ".join(f"{codes.count(code)} {names[code].replace('_', ' ')}" for code in sorted(set(codes)))
    typer.echo(f"{data.outcome.size} points: {told}; {store}")


@app.command()
def ladder(
    scene: Annotated[str, typer.Argument(help="One of the scenes that --list shows.")] = "",
    observable: Annotated[str, typer.Option(help="What is to be right; --list shows what a scene has.")] = "",
    tolerance: Annotated[
        str, typer.Option(help="Accepted distance from the richest model, e.g. 0.01 or 5%.")
    ] = "5%",
    out: Annotated[
        Path | None, typer.Option(help="Directory for the table (JSON) and the chart (PNG).")
    ] = None,
    list_only: Annotated[bool, typer.Option("--list", help="List scenes and observables, and leave.")] = False,
) -> None:
    """The simplest model that a scene needs: an observable on models of growing fidelity, and their cost."""
    from pwsmooth.compare.ladders import report

    try:
        report.show_list(scene) if list_only else report.run(scene, observable, tolerance, out)
    except (ValueError, TypeError) as error:
        typer.echo(f"pwsmooth ladder: {error}", err=True)
        raise typer.Exit(2) from None


def main() -> None:
    """Entry point of the console script."""
    app()


if __name__ == "__main__":
    main()
