"""A sweep in a TOML file: `pwsmooth sweep STUDY.toml`, whose --help lists the keys and shows one.

A study is data: it names scenes and laws of the package, and what the caller of run_study() registers in `names`.
Only with allow_code=True (--allow-code) may it also name code in a file beside it: object = "models.py:oscillator"
(a System, a scene, or a function that returns one), measures = ["models.py:peak_force"]. That file is run.
"""

from __future__ import annotations

import importlib.util
import inspect
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, model_validator

from ..analysis.maps.seen import LONGEST, Return, Strobe
from ..door import calls, checks
from ..laws.catalogue import known_laws
from .work import Work

_HELPERS = ("assemble", "chain_of_blocks", "grazing_amplitude")  # functions among the scenes that make none


class StudyError(ValueError):
    """A study file that cannot be run; the text names the file, the key and the remedy."""


class Table(BaseModel):
    """A table of a file: no key that it does not know, no value of another kind."""

    model_config = ConfigDict(extra="forbid", strict=True)


class Spaced(Table):
    """Equally spaced values, or equally spaced logarithms."""

    from_: float = Field(alias="from")
    to: float
    count: Annotated[int, Field(ge=1, le=10_000_000)]
    spacing: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _has_logarithms(self) -> Spaced:
        if self.spacing == "log" and not (self.from_ > 0 and self.to > 0):
            raise ValueError("spacing = 'log' needs `from` and `to` > 0")
        return self

    def values(self) -> np.ndarray:
        space = np.geomspace if self.spacing == "log" else np.linspace
        return space(self.from_, self.to, self.count)


# One of the two is tried, so that a mistake is told once.
Values = Annotated[
    Annotated[Spaced, Tag("<spaced>")] | Annotated[list[float], Tag("<list>")],
    Discriminator(lambda values: "<spaced>" if isinstance(values, (dict, Spaced)) else "<list>"),
]


class SystemTable(Table):
    """What is swept: a scene with a law, or an object that is registered or stands in a file."""

    object: str | None = None
    scene: str | None = None
    law: str | None = None
    law_parameters: dict[str, Any] = {}
    arguments: dict[str, Any] = {}
    parameters: dict[str, float] = {}
    layered: dict[str, float] | None = None
    smoothed: dict[str, Any] | None = None

    @model_validator(mode="after")
    def _names_one(self) -> SystemTable:
        if (self.object is None) == (self.scene is None):
            raise ValueError("give `object` or `scene`, one of them")
        return self


class SeenTable(Table):
    """How motions are seen: keys of Strobe (period, phase, symmetry) or of Return (section, direction, longest)."""

    period: float | str | None = None
    phase: float = 0.0
    symmetry: dict[str, str] | None = None
    section: str | None = None
    direction: Literal[1, -1] = 1
    longest: float = LONGEST

    @model_validator(mode="after")
    def _is_one(self) -> SeenTable:
        if (self.period is None) == (self.section is None):
            raise ValueError("give `period` of a driven system or `section` of an autonomous one, one of them")
        other, kind = ({"section", "direction", "longest"}, "period") if self.section is None else (
            {"period", "phase", "symmetry"}, "section"
        )  # fmt: skip
        if idle := sorted(other & self.model_fields_set):
            raise ValueError(f"`{idle[0]}` does not belong to `{kind}`; leave it out")
        return self

    def value(self) -> Strobe | Return:
        if self.section is None:
            return Strobe(self.period, self.phase, self.symmetry)
        return Return(self.section, self.direction, self.longest)


def seen_of(table: SeenTable | None) -> Strobe | Return | None:
    """What the table says; StudyError for what the value refuses."""
    return None if table is None else called(table.value, {}, "seen")


class Study(Table):
    """The whole file."""

    title: str = ""
    system: SystemTable
    axes: dict[str, Values] = {}
    points: dict[str, Values] = {}
    x0: dict[str, float] = {}
    measures: list[str] = ["sticks", "itinerary", "period"]
    seen: SeenTable | None = None
    transient: int = 100
    periods: int = 20
    t_span: Annotated[tuple[float, float], Field(strict=False)] | None = None  # TOML has lists
    measure_from: float | None = None
    units: dict[str, str] = {}
    kicks: dict[str, Any] | None = None
    rtol: float | None = None
    atol: float | list[float] | None = None
    method: str | None = None
    max_steps: int | None = None


def read_study(path: Any, kind: Any = Study) -> Any:
    """The checked study of a TOML file, of this kind.

    StudyError for no such file, no TOML, an unknown or missing key, a value of the wrong kind: every one of them, with
    its key and line.
    """
    path = checks.path(path, "`path`")
    if not (isinstance(kind, type) and issubclass(kind, Table)):
        raise TypeError(f"`kind` is {checks.shown(kind)}; give Study, or another Table.")
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise StudyError(f"{path}: no text in UTF-8: {error.reason} at byte {error.start}") from None
    try:
        return kind.model_validate(tomllib.loads(text))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise StudyError(f"{path}: no TOML: {error}") from None
    except ValidationError as error:
        lines = []
        for item in error.errors():
            # Drop the members of a union that pydantic lists among the keys.
            keys = [str(k) for k in item["loc"] if k not in ("<spaced>", "<list>", "float", "str")]
            known = ""
            if item["type"] == "extra_forbidden":
                tables = {"system": SystemTable, "seen": SeenTable}
                table = tables.get(keys[0], Spaced) if len(keys) > 1 else kind
                fields = [f.alias or n for n, f in table.model_fields.items()]
                near = calls.closest(keys[-1], fields)
                known = f"; did you mean {near}?" if near else f"; keys there are {', '.join(fields)}"
            value = "" if item["type"] in ("missing", "extra_forbidden") else f" (here: {item['input']!r})"
            what = "no such key" if known else item["msg"].removeprefix("Value error, ")
            lines.append(f"{path}{_line(text, keys)}: {'.'.join(keys) or 'study'}: {what}{value}{known}")
        raise StudyError("\n".join(dict.fromkeys(lines))) from None


def _line(text: str, keys: list[str]) -> str:
    """ ", line 3", where the innermost of the keys that stands in the file is set."""
    table = ""
    best, depth = 0, -1
    for number, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if stripped.startswith("["):
            table = stripped.strip("[] ").split("]")[0]
            here = [table]
        else:
            here = [k for k in (table, stripped.partition("=")[0].strip().strip('"')) if k]
        shared = [k for k in keys if k in here]
        if shared == keys[: len(shared)] and here == keys[: len(here)] and len(shared) > depth and shared:
            best, depth = number, len(shared)
    return f", line {best}" if best else ""


class Names(NamedTuple):
    """What a study may name besides the package's own: registered objects and, if allowed, code in its folder."""

    registered: Mapping[str, Any] = {}
    folder: Path | None = None  # None: no code

    def get(self, reference: str, key: str) -> Any:
        """The object of a registered name or of "file.py:name"."""
        if reference in self.registered:
            return self.registered[reference]
        where, _, name = reference.partition(":")
        if not (where.endswith(".py") and name):
            known = f"; registered are {', '.join(self.registered)}" if self.registered else ""
            raise StudyError(
                f"{key} is {reference!r}; write 'file.py:name', a file beside the study, with --allow-code{known}."
            )
        if self.folder is None:
            raise StudyError(
                f"{key} is {reference!r}, which is code: a study is data. If you trust that file, add --allow-code "
                "(allow_code=True), which runs it."
            )
        folder = self.folder.resolve()
        path = (folder / where).resolve()
        if not path.is_relative_to(folder):
            raise StudyError(
                f"{key} is {reference!r}, outside of the study's folder {str(folder)!r}; move it there."
            )
        if not path.is_file():
            raise StudyError(f"{key}: there is no file {str(path)!r}.")
        # Under its own name, so that workers in other processes can be told what to import.
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:  # a user's file may raise anything
            said = f"{type(error).__name__}: {str(error).rstrip('.')}.{calls.symbols_hint(error)}"
            raise StudyError(f"{key}: {where} raised {said}") from error
        if not hasattr(module, name):
            raise StudyError(f"{key}: {where} has no {name!r}." + calls.hint(name, vars(module)))
        return getattr(module, name)


def arguments_of(study: Study, names: Names | None = None) -> tuple[Any, dict[str, Any]]:
    """System (or scene) and keyword arguments of sweep(); StudyError for what does not exist or is of no use."""
    checks.instance(Study, "what read_study() gives")(study, "`study`")
    names = checks.optional(checks.instance(Names, "Names(...)"))(names, "`names`") or Names()
    system = system_of(study.system, names)
    measures = [names.get(m, "measures") if ":" in m or m in names.registered else m for m in study.measures]
    arguments: dict[str, Any] = dict(
        axes={name: values_of(v) for name, v in study.axes.items()},
        points={name: values_of(v) for name, v in study.points.items()},
        x0=study.x0, measures=measures, seen=seen_of(study.seen), transient=study.transient,
        periods=study.periods,
        t_span=study.t_span, measure_from=study.measure_from, units=study.units,
    )  # fmt: skip
    options = {name: getattr(study, name) for name in ("rtol", "atol", "method", "max_steps")}
    arguments |= {name: value for name, value in options.items() if value is not None}
    if study.kicks is not None:
        from ..noise.kicks import Kicks

        arguments["noise"] = called(Kicks, study.kicks, "kicks")
    return system, arguments


def values_of(values: Any) -> Any:
    """Of a list, or of equally spaced ones."""
    return values.values() if isinstance(values, Spaced) else values


def system_of(table: SystemTable, names: Names) -> Any:
    """The System, or the scene, of a study; StudyError for what does not exist or is of no use."""
    if table.object is not None:
        system = names.get(table.object, "system.object")
        if callable(system) and not hasattr(system, "model"):
            system = called(system, table.arguments, "system.arguments")
    else:
        known = known_scenes()
        if table.scene not in known:
            raise StudyError(f"system.scene is {table.scene!r}{_meant(table.scene, known, 'scenes')}")
        arguments = dict(table.arguments)
        if law := _law(known[table.scene], table):
            arguments["law"] = law
        system = called(known[table.scene], arguments, "system.arguments")
    return _viewed(system, table)


def _meant(name: str | None, known: Iterable[str], kind: str) -> str:
    """ "; did you mean ...?", or all names where none is near."""
    known = list(known)
    near = calls.closest(name or "", known)
    return f"; did you mean {near!r}?" if near else f"; {kind} are {', '.join(known)}."


def _law(scene: Any, table: SystemTable) -> Any:
    """The law of a scene; None of one that takes none. StudyError for one that does not fit, or is missing."""
    takes, name = getattr(scene, "tests", {}).get("law"), scene.__name__
    if takes is None:
        if table.law is not None:
            raise StudyError(
                f"system.law is {table.law!r}, but {name} takes no law by this name; leave it out."
            )
        return None
    if table.law is None:
        raise StudyError(f"system.law is missing: {name} takes one of {', '.join(takes.names())}.")
    law = law_of(table.law, takes.names())
    if reason := takes.why_not(law):
        raise StudyError(
            f"system.law is {table.law!r}, {reason}; those that fit are {', '.join(takes.names())}."
        )
    return called(law, table.law_parameters, "system.law_parameters")


def _viewed(system: Any, table: SystemTable) -> Any:
    """The system, or the scene with its system replaced, in the view and at the parameters of the study."""
    from dataclasses import replace

    bare = system.system if hasattr(system, "system") and hasattr(system, "x0") else system
    if not hasattr(bare, "model"):
        raise StudyError(f"system.object is {bare!r}; give a System, a scene, or a function that returns one.")
    if table.parameters:
        bare = called(bare.with_parameters, {"parameters": table.parameters}, "system.parameters")
    if table.layered:
        bare = called(bare.layered, {"ratios": table.layered}, "system.layered")
    if table.smoothed:
        bare = called(bare.smoothed, table.smoothed, "system.smoothed")
    return replace(system, system=bare) if bare is not system and hasattr(system, "x0") else bare


def known_scenes() -> dict[str, Any]:
    """Name -> function of every scene of the package."""
    from .. import scenes

    return {n: f for n in scenes.__all__ if inspect.isfunction(f := getattr(scenes, n)) and n not in _HELPERS}


def law_of(name: str, fit: Iterable[str] | None = None) -> Any:
    """The law of that name, a class; StudyError if there is none, with the names of those that fit."""
    known = known_laws()
    if name not in known:
        raise StudyError(f"system.law is {name!r}{_meant(name, known if fit is None else fit, 'laws')}")
    return known[name]


def called(function: Any, arguments: dict[str, Any], key: str) -> Any:
    try:
        return function(**arguments)
    except (TypeError, ValueError) as error:
        raise StudyError(f"{key}: {error}") from None


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
    """Run a study into the store OUT/<name of the file>.zarr; returns its Dataset and the store's path.

    `names` registers what the study may name as `object` or in `measures`; `allow_code` lets it name, and so run, code
    in files beside it.
    StudyError as `read_study`, or if the store exists and `resume` was not asked for; otherwise what sweep() refuses.
    """
    from .sweeping import sweep

    path = checks.path(path, "`path`")
    names = checks.optional(checks.mapping)(names, "`names`")
    allow_code = checks.flag(allow_code, "`allow_code`")
    study: Study = read_study(path)
    store = checks.path(out, "`out`") / f"{path.stem}.zarr"
    if store.exists() and not checks.flag(resume, "`resume`"):
        raise StudyError(f"{store} exists; add --resume to go on with it, or give another --out.")
    system, arguments = arguments_of(study, Names(names or {}, path.parent if allow_code else None))
    return sweep(system, work=Work(workers=workers, store=store, progress=progress), **arguments), store
