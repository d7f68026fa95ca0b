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


def main() -> None:
    """Entry point of the console script."""
    app()


if __name__ == "__main__":
    main()
