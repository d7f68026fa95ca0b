"""The command `pwsmooth`.

Only typer is imported here, so that `pwsmooth --help` is quick; each command imports what it needs.
"""

from __future__ import annotations

import contextlib
import functools
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup


def _bare(params: list[Any]) -> list[Any]:
    """Options, of which flags are shown without a type: they take no value."""
    for param in params:
        if getattr(param, "is_flag", False):
            param.metavar = ""
    return params


class _Command(TyperCommand):
    def get_params(self, ctx: Any) -> list[Any]:
        return _bare(super().get_params(ctx))


class _Group(TyperGroup):
    def get_params(self, ctx: Any) -> list[Any]:
        return _bare(super().get_params(ctx))


app = typer.Typer(
    cls=_Group,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Exact switching for piecewise-smooth dynamics.",
)


command = functools.partial(app.command, cls=_Command)


def _version(wanted: bool) -> None:
    if wanted:
        import pwsmooth

        typer.echo(f"pwsmooth {pwsmooth.__version__}")
        raise typer.Exit


@contextlib.contextmanager
def _telling(out: Path | None) -> Iterator[None]:
    """Says that a folder is new, which a slip of the pen in its name would be."""
    new = out is not None and not out.exists()
    try:
        yield
    finally:
        if new and out is not None and out.exists():
            typer.echo(f"{out} is a new folder.", err=True)


@contextlib.contextmanager
def _in_words(command: str, interrupted: str = "interrupted.") -> Iterator[None]:
    """What a call refuses, a disk cannot do and a user stops, in one line and an exit code."""
    try:
        yield
    except typer.Exit:
        raise
    except (ValueError, TypeError, ImportError, RuntimeError, KeyError, OSError, MemoryError) as error:
        said = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
        said = said or "there is not enough memory"
        typer.echo(f"pwsmooth {command}: {said}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo(f"pwsmooth {command}: {interrupted}", err=True)
        raise typer.Exit(130) from None


def _find_paper_figures() -> None:
    """Make `paper_figures` importable: it stands beside the package, or in the working directory; else a ValueError."""
    for root in (Path(__file__).resolve().parent.parent, Path.cwd()):
        if (root / "paper_figures").is_dir() and (root / "pyproject.toml").is_file():
            if str(root) not in sys.path:
                sys.path.insert(0, str(root))
            return
    raise ValueError(
        "the scripts of the figures are not part of the installed package. Unpack the project's source archive (or "
        "clone the project), go to its folder, and run `pip install -e . && pwsmooth figures` there."
    )


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Exact switching for piecewise-smooth dynamics."""


@command()
def figures(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Figures to make, e.g. 4 8; all without.")
    ] = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the figures and leave.")] = False,
    out: Annotated[Path, typer.Option(help="Directory for the PNG and PDF files and claims.json.")] = Path(
        "figures"
    ),
    fast: Annotated[bool, typer.Option("--fast", help="Coarser curves and shorter sweeps.")] = False,
    jobs: Annotated[int | None, typer.Option(min=1, help="Figures made at a time; one a core without.")] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Print every claim, not only what does not hold.")
    ] = False,
) -> None:
    """Make the figures of the sources, and a table of which of their claims hold.

    Runs from the project's source archive or a checkout, where the scripts of the figures are.
    """
    with _in_words("figures", "interrupted; the figures listed above are complete."), _telling(out):
        _find_paper_figures()
        from paper_figures import making as machinery

        if list_only:
            machinery.print_list()
            return
        all_made = machinery.make(names or [], out=out, fast=fast, jobs=jobs, everything=everything)
    if not all_made:
        raise typer.Exit(1)


@command()
def verify(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Problems to solve; all without.")
    ] = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the problems and leave.")] = False,
) -> None:
    """Solve the built-in problems with exact answers, and print computed, exact, error and time.

    The exit code is 1 when a number misses its exact value by more than its tolerance.
    """
    from pwsmooth.compare.exact import report

    with _in_words("verify"):
        held = report.list_problems() if list_only else report.run(names or [])
    if not held:
        raise typer.Exit(1)


@command()
def sweep(
    study: Annotated[Path, typer.Argument(help="TOML file: system, axes, measures, tolerances.")],
    out: Annotated[Path, typer.Option(help="Directory for the store, <STUDY>.zarr.")] = Path("."),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a store that is there.")] = False,
    workers: Annotated[int | None, typer.Option(help="Threads; one a core without.")] = None,
    allow_code: Annotated[
        bool, typer.Option("--allow-code", help="Let the study run code: 'file.py:name', a file beside it.")
    ] = False,
) -> None:
    r"""Run a parameter study into a Zarr store that survives any kill.

    The file is data: it names scenes, laws, axes and measures of the package, and reading it runs nothing. An example:

        measures = ["sticks", "itinerary", "amplitude(y)"]
        \[seen]
        period = "2*pi/omega"
        \[system]
        scene = "friction_oscillator"
        law = "HiddenStatic"
        arguments = { omega = 1.1 }
        \[axes]
        amplitude = { from = 0.6, to = 3, count = 25 }
        spring = \[2, 3.1, 4]

    Keys of the file:
        title          what the study is called
        measures       what is kept: sticks, itinerary, period, amplitude(y), ...
        transient      periods or returns that are not measured, 100 by default
        periods        periods or returns that are measured, 20 by default
        t_span         without \[seen]: start and end, as \[0, 50]
        measure_from   without \[seen]: the time at which measuring begins
        rtol, atol     tolerances
        method         of solve
        max_steps      bound on the steps of an orbit

    Its tables:
        \[system]      scene and law, or object (see --allow-code); law_parameters,
                      arguments of the scene, parameters; a view, as
                      layered = { z = inf } or smoothed = { eps = 1e-3 }
        \[seen]        of a driven system: period, a number or a formula in parameters;
                      phase, the part of it at which runs begin. Of an autonomous
                      one: section, a surface, as "y"; direction, 1 (rising) or -1;
                      longest, the time after which a return is given up
        \[axes]        parameters or states: lists, or { from, to, count } with
                      spacing = "linear" or "log"
        \[points]      lists of one length that are swept together
        \[x0]          initial values of states
        \[units]       of parameters and states, as words
        \[kicks]       arguments of Kicks: size, every, on, ...
    """
    with _in_words("sweep", "interrupted; finished chunks are kept, --resume goes on."), _telling(out):
        from pwsmooth.studies.study import run_study

        data, store = run_study(study, out, resume, workers, allow_code=allow_code)
    names = dict(zip(data.outcome.attrs["flag_values"], data.outcome.attrs["flag_meanings"].split()))
    codes = data.outcome.values.ravel().tolist()
    told = ", ".join(f"{codes.count(code)} {names[code].replace('_', ' ')}" for code in sorted(set(codes)))
    size = data.outcome.size
    typer.echo(
        f"{size} point{'s' * (size != 1)}: {told}; {store}\nIn Python: pwsmooth.studies.read_store({str(store)!r})"
    )


@command()
def diagram(
    study: Annotated[Path, typer.Argument(help="TOML file: system, over, x0.")],
    out: Annotated[
        Path, typer.Option(help="Directory for the store, <STUDY>.zarr, and the picture, <STUDY>.png.")
    ] = Path("."),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a store that is there.")] = False,
    workers: Annotated[int | None, typer.Option(help="Processes; one a core without.")] = None,
    allow_code: Annotated[
        bool, typer.Option("--allow-code", help="Let the study run code: 'file.py:name', a file beside it.")
    ] = False,
) -> None:
    r"""All branches over a parameter, or all curves over two, into a Zarr store that survives any kill.

    One parameter in \[over] gives a diagram, two give a bifurcation set. The file is data, as that of a sweep:

        x0 = \[{ y = 0.5, v = 0.3 }, { y = -1, v = 1 }]
        \[system]
        scene = "friction_oscillator"
        law = "HiddenStatic"
        layered = { z = inf }
        \[over]
        omega = \[0.4, 3]
        amplitude = \[0.5, 5]
        \[lines]
        omega = \[0.6, 1, 2]
        \[seen]
        period = "2*pi/omega"
        symmetry = { y = "-y", v = "-v" }

    Keys of the file:
        title          what the study is called
        x0             list of tables: where trajectories start
        values         of a parameter in the orbit diagram
        transient, tol periods before an end counts, and how nearly it repeats
        max_count      longest orbit, in periods
        max_depth      of branches on branches on branches
        max_branches   number of branches, and of curves
        virtual        whether virtual equilibria and curves are followed
        rtol, atol, method, max_steps   of solve

    Its tables:
        \[system]      as of `pwsmooth sweep`: scene and law, or object
        \[over]        one or two parameters: \[least, largest]
        \[steps]       along a branch: first, longest, shortest, max_points
        \[lines]       of two: values at which either is held
        \[seen]        as of `pwsmooth sweep`; with a period also symmetry, images of
                      states under (x, t) -> (G x, t + T/2)
        \[box]         states: \[least, largest], where equilibria are looked for
    """
    with _in_words("diagram", "interrupted; finished branches are kept, --resume goes on."), _telling(out):
        from pwsmooth.diagrams.study import run_study

        found, store = run_study(study, out, resume, workers, allow_code=allow_code)
    typer.echo(f"{found}\n{store}\nIn Python: pwsmooth.diagrams.read_diagram({str(store)!r})")


@command()
def explore(
    what: Annotated[
        str,
        typer.Argument(
            help="A scene (--list), a STUDY.toml, or file.py:name, a scene in a file, which is run."
        ),
    ] = "",
    law: Annotated[str | None, typer.Option(help="Law of the scene, such as LuGre.")] = None,
    preset: Annotated[str | None, typer.Option(help="A state worth a look (--list).")] = None,
    state: Annotated[str, typer.Option(help="What `Copy link` of a page gave.")] = "",
    port: Annotated[int, typer.Option(min=0, max=65535, help="On 127.0.0.1; any that is free without.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page.")] = True,
    allow_code: Annotated[
        bool, typer.Option("--allow-code", help="Let a study run code: 'file.py:name', a file beside it.")
    ] = False,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="The page looks, and changes neither parameters, start nor law.")
    ] = False,
    export: Annotated[
        Path | None, typer.Option(help="Write one HTML file that needs no Python, with a slider, and leave.")
    ] = None,
    over: Annotated[str, typer.Option(help="The slider of that file: NAME=LOW:HIGH:COUNT.")] = "",
    list_only: Annotated[bool, typer.Option("--list", help="List scenes and presets, and leave.")] = False,
) -> None:
    """A page on which a system answers while a slider moves: orbit, phase plane, layer, orbit diagram, basins.

    It is served on this machine alone, to whoever has the printed address, until Ctrl-C. It needs websockets:
    pip install websockets, or in a checkout pip install -e '.\\[explore]'.
    """
    with _in_words("explore"):
        from pwsmooth.explorer import opening

        if list_only:
            typer.echo(opening.listing())
            return
        opening.command(
            what, law, preset, state, port, browser, allow_code, typer.echo, read_only, export, over
        )


@command()
def warmup() -> None:
    """Compile the whole numerical core now, on all cores, instead of each part when it is first needed.

    A wheel brings it compiled, and nothing is left to do. Models are still compiled when they are first solved.
    """
    with _in_words("warmup", "interrupted; the parts that are compiled are kept."):
        from pwsmooth.paths.warmup import warm_up

        typer.echo(f"{warm_up()} parts of the numerical core are compiled.")


@command()
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

    with _in_words("ladder"), _telling(out):
        report.show_list(scene) if list_only else report.run(scene, observable, tolerance, out)


def main() -> None:
    """Entry point of the console script."""
    app()


if __name__ == "__main__":
    main()
