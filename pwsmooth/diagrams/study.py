"""A diagram over one parameter or two in a TOML file: `pwsmooth diagram STUDY.toml`, whose --help lists the keys.

A study is data, as those of sweeps are (studies/study.py), with the same tables and the same rule for code.

Chain: studies/study.py, calling.py -> **study** -> cli.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from ..analysis.continuation.steps import Steps
from ..analysis.maps.seen import Strobe
from ..codegen.machine.workers import cores
from ..door import checks
from ..studies.study import (
    Names,
    SeenTable,
    StudyError,
    SystemTable,
    Table,
    Values,
    called,
    read_study,
    seen_of,
    system_of,
    values_of,
)
from ..studies.work import Work
from .calling import diagram

Pair = Annotated[tuple[float, float], Field(strict=False)]  # TOML has lists


class StepsTable(Table):
    """Keys of Steps."""

    first: float | None = None
    longest: float | None = None
    shortest: float | None = None
    max_points: int = 500


class DiagramStudy(Table):
    """The whole file: keys of `diagram`."""

    title: str = ""
    system: SystemTable
    over: dict[str, Pair]
    lines: dict[str, Values] = {}
    x0: list[dict[str, float]] = []
    seen: SeenTable | None = None
    box: dict[str, Pair] | None = None
    values: int = 60
    transient: int = 200
    max_count: int = 8
    tol: float = 1e-6
    max_depth: int = 6
    max_branches: int = 60
    virtual: bool = False
    steps: StepsTable | None = None
    rtol: float | None = None
    atol: float | list[float] | None = None
    method: str | None = None
    max_steps: int | None = None


def run_study(
    path: Any,
    out: Any,
    resume: bool = False,
    workers: int | None = None,
    progress: bool | None = None,
    *,
    names: Mapping[str, Any] | None = None,
    allow_code: bool = False,
) -> tuple[Any, Path]:
    """Run a study into the store OUT/<name of the file>.zarr, and draw OUT/<name of the file>.png.

    Parameters
    ----------
    path : str or Path
        The TOML file.
    out : str or Path
        Directory for store and picture.
    resume : bool
        Whether to go on with a store that is there.
    workers : int, optional
        Processes; by default one a core.
    progress : bool, optional
        Whether it tells how far it is, by default on a terminal.
    names : mapping of str to System, optional
        What the study may name as `object`.
    allow_code : bool
        Whether it may name, and so run, code in files beside it.

    Returns
    -------
    tuple of (Diagram or BifurcationSet, Path)
        The result, and the store.

    Raises
    ------
    StudyError
        A file that is no study; a store that is there, without `resume`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import sympy as sp
    >>> from pwsmooth import Event, System
    >>> from pwsmooth.diagrams.study import run_study
    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 3}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> folder = Path(tempfile.mkdtemp())
    >>> text = "seen = {period = 1, phase = 0.5}\\nvalues = 5\\nx0 = [{ x = 0.3 }]\\nover = { a = [2.8, 3.4] }\\n"
    >>> _ = (folder / "study.toml").write_text(text + "[system]\\nobject = 'logistic'\\n")
    >>> found, store = run_study(folder / "study.toml", folder, workers=1, names={"logistic": logistic})
    >>> [b.kind for b in found.specials], store.name
    (['flip'], 'study.zarr')
    """
    path = checks.path(path, "`path`")
    names = checks.optional(checks.mapping)(names, "`names`")
    allow_code = checks.flag(allow_code, "`allow_code`")
    study = read_study(path, DiagramStudy)
    store = checks.path(out, "`out`") / f"{path.stem}.zarr"
    if store.exists() and not checks.flag(resume, "`resume`"):
        raise StudyError(f"{store} exists; add --resume to go on with it, or give another --out.")
    arguments = _arguments_of(study, Names(names or {}, path.parent if allow_code else None))
    found = diagram(**arguments, work=Work(workers=workers or cores(), store=store, progress=progress))
    _draw(found, store.with_suffix(".png"))
    return found, store


def _arguments_of(study: DiagramStudy, names: Names) -> dict[str, Any]:
    """The arguments of `diagram`."""
    system = system_of(study.system, names)
    seen, x0 = seen_of(study.seen), study.x0 or None
    if hasattr(system, "system") and hasattr(system, "x0"):  # a scene brings its own
        if seen is None and getattr(system, "period", None):
            seen = Strobe(system.period)
        own = {str(getattr(key, "name", key)): value for key, value in system.x0.items()}
        system = system.system
        own = {s.name: own[s.name] for s in system.model.states if s.name in own}  # a view may have fewer
        x0 = [own | given for given in study.x0 or [{}]]
    given = study.model_dump(exclude={"title", "system", "lines", "x0", "seen", "steps"}, exclude_none=True)
    if study.lines:
        given["lines"] = {name: values_of(values) for name, values in study.lines.items()}
    steps = Steps() if study.steps is None else called(Steps, study.steps.model_dump(), "steps")
    return {**given, "system": system, "x0": x0, "seen": seen, "steps": steps}


def _draw(found: Any, path: Path) -> None:
    from matplotlib import use

    from ..plotting import new_figure, style

    use("Agg")
    with style():
        figure = new_figure(9.0, 4.6)
        found.plot(ax=figure.subplots())
        figure.savefig(path)
