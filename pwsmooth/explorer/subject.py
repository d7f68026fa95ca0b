"""What is explored: a System with its start, span, period and words, from a scene, a study or a System of one's own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from .. import scenes
from ..analysis.maps.seen import Strobe
from ..definition.lambdified import numpy_function
from ..door import checks
from ..noise.diffusion import Diffusion
from ..noise.kicks import Kicks
from ..results.solution import Solution
from ..scenes.scene import Scene
from ..studies.study import Names, Study, StudyError, SystemTable, law_of, read_study, system_of

_T = sp.Symbol("t", real=True)
_SIN, _COS = sp.sin(_T), sp.cos(_T)


@dataclass(frozen=True)
class Made:
    """What a scene of the package is made of: its law by name, the values of that, and its other arguments."""

    law: str | None = "HiddenStatic"
    values: Mapping[str, Any] = field(default_factory=dict)
    arguments: Mapping[str, Any] = field(default_factory=dict)
    scene: str = ""


def made(law: str | None, **arguments: Any) -> Made:
    """Of a law at its defaults."""
    return Made(law, {}, arguments)


#: What scenes are made of where the command names no law.
USUAL: dict[str, Made] = {
    "free_impact": made("HuntCrossley"),
    "falling_ball": made("HuntCrossley"),
    "impact_oscillator": made("KelvinVoigt"),
    "pressed_block": made("KelvinVoigt", force=_SIN, t_span=(0.0, 30.0)),
    "slider_crank": made(None),
    "spinning_disc": made("LimitEllipsoid"),
    "gripped_bar": made("LimitEllipsoid", grip=100 - _T),
    "billiard_ball": made("Coulomb"),
    "incline": made("Coulomb"),
    "bristle_bot": made("Coulomb"),
    "block_on_belt": made("StribeckFriction"),
    "force_driven": made("LuGre", force=1.2 * _SIN, t_span=(0.0, 30.0), period=2 * math.pi),
    "prescribed_motion": Made(
        "Dahl", {"sigma0": 20.0}, {"position": _SIN, "t_span": (0.0, 20.0), "period": 2 * math.pi}
    ),
    "shaken_plate": made("Coulomb", plate=(_SIN, 0), lift=_COS, period=2 * math.pi),
    "planar_oscillator": made("Coulomb", force=(2 * _SIN, _COS), t_span=(0.0, 30.0), period=2 * math.pi),
    "pulled_block": made("Coulomb", path=(_T, 0), plate=(0, _SIN), start=(-1.0, 0.5)),
    "stacked_plates": made("Coulomb", force=(_T, 0)),
    "block_train": Made("StribeckFriction", {"v_s": 0.5, "sigma2": 0.0}),
    "block_lattice": Made("StribeckFriction", {"v_s": 0.5, "sigma2": 0.0}),
    "firing_lattice": made(None),
    "granular_chain": made(None),
    "plate_stack": made(None),
    "rate_state_train": made(None),
    "element_cloud": Made("MaxwellSlip", {}, {"position": 2 * _SIN, "period": 2 * math.pi}),
}


VIEWS = ("time", "mechanism", "phase", "characteristic", "layer", "diagram", "basins", "section", "noise")


@dataclass(frozen=True)
class Subject:
    """Everything that the processes of a page need; picklable."""

    name: str
    system: Any
    start: dict[str, float]
    t_span: tuple[float, float]
    period: Any = None  # a number, or an expression in parameters
    units: Mapping[str, str] = field(default_factory=dict)
    atol: Mapping[str, float] = field(default_factory=dict)
    meanings: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    code: tuple[str, ...] = (
        "# `scene` is your Scene: define it here, or import it.",
    )  # lines that make `scene`, or `system` of a System alone
    sketch: Any = None
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    views: tuple[str, ...] = ()
    command: str = ""  # that opens the same on another machine
    made: Made | None = None  # of a scene of the package, whose law can be another one
    names: tuple[str, ...] = ()  # of the first time series
    phase: tuple[str, ...] = ()  # of the first phase plane
    eps: float = 1e-2  # of the smoothed view
    noise: Any = None  # Kicks or Diffusion
    read_only: bool = False  # the page looks, and changes nothing
    alone: bool = False  # a System without a scene

    @property
    def what(self) -> str:
        """The name that its code gives it."""
        return "system" if self.alone else "scene"

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """States of the mechanism, which another law of its scene leaves as they are."""
        mine = law_of(self.made.law) if self.made and self.made.law else None
        if self.made is None or mine is None or mine.spins:  # laws that spin have no states
            return tuple(self.start)
        bare = "Hertz" if mine.kind == "contact" else "Coulomb"
        try:
            alone = named_subject(self.made.scene, bare, {}, self.made.arguments)
        except StudyError:  # it takes laws with states alone, and has none besides
            return ()
        return tuple(s.name for s in alone.system.states)

    @cached_property
    def scene(self) -> Scene:
        """As a Scene, whose `solve` a script calls too: the same door, the same tolerances, the same bits."""
        return Scene(
            self.name, self.system, self.start, self.t_span, units=dict(self.units), atol=dict(self.atol)
        )

    def solve(self, t_span: Any, x0: Any, parameters: Any, **options: Any) -> Solution:
        """The orbit of a state, with dense output."""
        return self.scene.solve(t_span, x0, parameters=parameters, dense_output=True, **options)

    def period_at(self, parameters: Mapping[str, float]) -> float | None:
        """The period where parameters have other values; None without one."""
        if self.period is None:
            return None
        with np.errstate(all="ignore"):  # a frequency may be 0
            found = float(self._period(*(parameters.get(s.name, v) for s, v in self.system.parameters.items())))
        return found if 0 < found < math.inf else None

    @cached_property
    def _period(self) -> Any:
        symbols = tuple(self.system.parameters)
        made = numpy_function(symbols, sp.sympify(self.period, strict=True)) if symbols else lambda: self.period
        return lambda *values: made(*map(np.float64, values))

    def __getstate__(self) -> dict[str, Any]:
        return {
            name: value for name, value in self.__dict__.items() if name not in ("_period", "scene", "moving")
        }


def subject_of(
    what: Any, x0: Any = None, *, t_span: Any = None, seen: Any = None, ranges: Any = None, views: Any = None,
    noise: Any = None,
) -> Subject:  # fmt: skip
    """The subject of a System or a scene; ValueError or TypeError for what cannot be explored."""
    subject = _of_scene(what) if isinstance(what, Scene) else _of_system(what, x0, t_span)
    if isinstance(what, Scene) and x0 is not None:
        start = subject.system.initial_state(x0)
        subject = replace(subject, start=dict(zip(map(str, subject.system.states), start)))
    if t_span is not None:
        subject = replace(subject, t_span=checks.span(t_span))
    if seen is not None:
        checks.instance(Strobe, "Strobe(period); a section is chosen on the page")(seen, "`seen`")
        if seen.phase or seen.symmetry:
            raise ValueError(
                "`seen` has a phase or a symmetry, which the page does not know; give Strobe(period)."
            )
        subject = replace(subject, period=checks.period(seen.period, subject.system.parameters))
    ranges = checks.mapping({} if ranges is None else ranges, "`ranges`", "parameters to (lowest, highest)")
    given = {str(k): checks.interval(v, f"`ranges` of {k}") for k, v in ranges.items()}
    for name in given:
        checks.lookup(name, subject.system.parameters, "`ranges`", "parameter")
    named = () if views is None else checks.several(views, "`views`")
    noise = checks.optional(checks.instance((Kicks, Diffusion), "Kicks(...) or Diffusion(...)"))(
        noise, "`noise`"
    )
    return replace(
        subject, ranges=given, views=tuple(checks.one_of(*VIEWS)(v, "`views`") for v in named), noise=noise
    )


def _of_system(system: Any, x0: Any, t_span: Any) -> Subject:
    checks.system(system, "`system_or_scene`")
    for name, given, remedy in (("x0", x0, "the initial state"), ("t_span", t_span, "(start, end)")):
        if given is None:
            raise ValueError(f"a System alone is explored from a start over a span: give `{name}`, {remedy}.")
    start = system.initial_state(x0)
    code = ("# `system` is your System: define it here, or import it.",)
    named = dict(zip(map(str, system.states), start))
    return Subject("system", system, named, checks.span(t_span), code=code, alone=True)


def _of_scene(
    scene: Scene,
    law: Any = None,
    code: tuple[str, ...] = ("# `scene` is your Scene: define it here, or import it.",),
) -> Subject:
    """`law`: an object whose fields tell what parameters mean."""
    law = law or _law_of(scene.name)
    meanings = {f.name: f.metadata["meaning"] for f in fields(law)} if law else {}
    system = scene.system
    start = dict(zip(map(str, system.states), system.initial_state(scene.x0)))
    period = None if scene.period is None else symbolic_period(system, scene.period)
    return Subject(
        scene.name, system, start, scene.t_span, period, dict(scene.units), dict(scene.atol), meanings, scene.note,
        code, getattr(scene, "sketch", None),
    )  # fmt: skip


def _law_of(name: str) -> Any:
    """The class of the law that a scene's name ends with, if it is one of the package's."""
    try:
        return law_of(name.rpartition(", ")[2])
    except StudyError:
        return None


def symbolic_period(system: Any, period: float) -> Any:
    """The period as an expression of parameters, where a harmonic term tells it, so that it follows their sliders."""
    time, values = system.model.time, system.parameters
    for wave in sorted(_expressions(system).atoms(sp.sin, sp.cos), key=str):
        frequency = wave.args[0].diff(time)
        if frequency.free_symbols and frequency.free_symbols <= set(values):
            candidate = 2 * sp.pi / frequency
            if abs(float(candidate.subs(values)) - period) <= 1e-9 * period:
                return candidate
    return period


def _expressions(system: Any) -> sp.Tuple:
    return sp.Tuple(*system.model.rhs) if system.model.families is None else sp.Tuple()


def named_subject(
    scene: str, law: str | None = None, values: Mapping[str, Any] | None = None, arguments: Any = None,
    *, folder: Path | None = None,
) -> Subject:  # fmt: skip
    """The subject of a scene's name, with a law's, or of 'file.py:name' in `folder`, which is run."""
    if ".py:" in scene:
        what = Names(folder=folder or Path(".")).get(scene, "what is explored")
        makes = callable(what) and not hasattr(what, "model") and not isinstance(what, Scene)
        what = what() if makes else what
        if not isinstance(what, Scene):
            raise StudyError(
                f"{scene} is no scene. A System needs a start and a span: wrap it, "
                "Scene(name, system, x0, t_span), or call pwsmooth.explore(system, x0, t_span=...)."
            )
        file, _, name = scene.partition(":")
        path = file if folder is None else str(folder / file)
        line = f"scene = run_path({path!r})[{name!r}]{'()' * makes}"
        return _of_scene(what, code=("from runpy import run_path", line))
    if scene.endswith(".py"):
        raise StudyError(f"{scene} is a file: write {scene}:NAME, with the NAME of a scene in it.")
    usual = USUAL.get(scene, Made())
    chosen = law or usual.law
    values = dict({} if law else usual.values) | dict(values or {})
    arguments = dict(usual.arguments if arguments is None else arguments)
    if scene == "stacked_plates":
        arguments["ground"] = law_of("Coulomb")()
    table = SystemTable(scene=scene, law=chosen, law_parameters=values, arguments=arguments)
    found = system_of(table, Names())
    subject = _of_scene(found, law_of(chosen) if chosen else None, _lines(scene, chosen, values, arguments))
    return replace(subject, made=Made(chosen, values, arguments, scene))


def with_law(subject: Subject, law: str, values: Mapping[str, Any] | None = None) -> Subject:
    """The subject's scene with another law, or other values of that shape it; start, span and words are kept.

    ValueError where the law does not fit, in its own words.
    """
    if subject.made is None or subject.made.law is None:
        raise ValueError(f"{subject.name} is no scene of the package with one law, so that it has no other.")
    law = checks.one_of(*laws_for(subject))(law, "`law`")
    own = subject.made.values if law == subject.made.law else {}
    again = named_subject(subject.made.scene, law, {**own, **(values or {})}, subject.made.arguments)
    known = {s.name for s in again.system.states} | {str(name) for name, _ in again.system.model.outputs}
    start = {n: v for n, v in subject.start.items() if n in again.start and n in subject.moving}
    return replace(
        subject, name=again.name, system=again.system, start=again.start | start, units=again.units, atol=again.atol,
        meanings=again.meanings, note=again.note, code=again.code, sketch=again.sketch, made=again.made,
        ranges={n: r for n, r in subject.ranges.items() if n in {p.name for p in again.system.parameters}},
        names=tuple(n for n in subject.names if n in known),
        phase=subject.phase if set(subject.phase) <= known else (),
    )  # fmt: skip


def laws_for(subject: Subject) -> list[str]:
    """The laws that fit where the subject has its own: of friction or of contact, with a form along its velocity."""
    if subject.made is None or subject.made.law is None:
        return []
    names = getattr(scenes, subject.made.scene).tests["law"].names()
    kind = law_of(subject.made.law).kind  # a scene that takes either kind keeps the one that it has
    return [name for name in names if law_of(name).kind == kind]


def _lines(
    scene: str, law: str | None, values: Mapping[str, Any], arguments: Mapping[str, Any]
) -> tuple[str, ...]:
    """Python that makes `scene`."""
    given = [] if law is None else [f"{law}({', '.join(f'{k}={v!r}' for k, v in values.items())})"]
    given += [f"{name}={value}" for name, value in arguments.items()]
    laws = ([law] if law else []) + [type(v).__name__ for v in arguments.values() if hasattr(v, "pieces")]
    lines = [f"from {law_of(name).__module__.rpartition('.')[0]} import {name}" for name in dict.fromkeys(laws)]
    several = (v if isinstance(v, tuple) else (v,) for v in arguments.values())
    formulas = sp.Tuple(*(e for group in several for e in group if isinstance(e, sp.Basic)))
    symbols = sorted(formulas.free_symbols - {_T}, key=str)
    used = {type(f).__name__ for f in formulas.atoms(sp.Function, sp.Piecewise)}
    used |= ({"pi"} if formulas.has(sp.pi) else set()) | ({"Symbol"} if symbols else set())
    lines += [f"from sympy import {', '.join(sorted(used))}"] * bool(used)
    return (
        *lines,
        f"from pwsmooth.scenes import {scene}{', t' * (_T in formulas.free_symbols)}",
        *(f"{s} = Symbol({s.name!r}, positive=True)" for s in symbols),
        f"scene = {scene}({', '.join(given)})",
    )


def subject_of_study(path: Path, *, allow_code: bool = False) -> Subject:
    """The subject of a study file: its system, start, period or span."""
    study: Study = read_study(path)
    made = system_of(study.system, Names({}, path.parent if allow_code else None))
    what = "scene" if isinstance(made, Scene) else "system"
    code = (
        "from pathlib import Path",
        "from pwsmooth.studies.study import Names, read_study, system_of",
        f"{what} = system_of(read_study({str(path)!r}).system, Names({{}}, {f'Path({str(path.parent)!r})' * allow_code or None}))",  # noqa: E501
    )[not allow_code :]  # fmt: skip
    if isinstance(made, Scene):
        subject = _of_scene(made, None, code)
    else:
        given = None if study.seen is None else study.seen.period
        if study.t_span is None and given is None:
            raise StudyError(f"{path}: give `t_span`, or `period` in [seen]: how long is a run to be?")
        period = None if given is None else checks.period(given, made.parameters)
        span = study.t_span or (0.0, 20 * float(sp.sympify(period, strict=True).subs(made.parameters)))
        start = made.initial_state(study.x0)
        subject = Subject(
            path.stem, made, dict(zip(map(str, made.states), start)), span, period, dict(study.units), code=code,
            alone=True,
        )  # fmt: skip
    return replace(subject, start={**subject.start, **study.x0}) if study.x0 else subject
