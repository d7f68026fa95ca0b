"""States that are worth a look, each with its question, and views of a subject.

Presets are data. Numbers of figures are those of `paper_figures`; tests/explorer/test_explore.py compares them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import sympy as sp

from ..door import calls, checks
from ..noise.kicks import Kicks
from ..scenes.drive import t
from ..scenes.scene import Scene
from ..studies.study import law_of
from ..system import System
from .subject import Subject, named_subject, subject_of, with_law

#: Ends of sliders of scenes, where a system alone would only guess.
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "friction_oscillator": {
        "rho": (0.05, 8.0), "beta": (0.01, 1.0), "amplitude": (0.0, 6.0), "omega": (0.2, 3.0), "F_c": (0.1, 3.0),
        "mass": (0.2, 3.0), "spring": (0.5, 8.0), "damper": (0.0, 1.0),
    },
    "impact_oscillator": {"omega": (0.2, 3.0), "amplitude": (0.0, 3.0)},
}  # fmt: skip


def two_fold() -> Scene:
    """An invisible two-fold at the origin: above x = 0 it turns over y = 0, below over z = 0."""
    x, y, z, V = sp.symbols("x y z V", real=True)
    right = x > 0
    sides = {x: ((-y, right), (z, True)), y: ((1, right), (V, True)), z: ((V, right), (1, True))}
    system = System({s: sp.Piecewise(*pieces) for s, pieces in sides.items()}, parameters={V: -2})
    return Scene("two-fold", system, {"x": 0.0, "y": 0.5, "z": 0.5}, (0.0, 2.0))


@dataclass(frozen=True)
class Preset:
    """A scene at certain values, and the question that they ask."""

    scene: str | Callable[[], Scene]
    said: str
    law: str | None = None
    law_values: Mapping[str, Any] = field(default_factory=dict)
    arguments: Mapping[str, Any] | None = None  # of the scene, in place of its usual ones
    x0: Mapping[str, float] = field(default_factory=dict)
    t_span: tuple[float, float] | None = None
    view: str = ""
    shown: Mapping[str, Any] = field(default_factory=dict)  # names, phase, ranges, noise, eps of the Subject


_HIDDEN = {"rho": 3.0, "beta": 0.1}
_SIZE, _RATE = sp.symbols("size rate", positive=True)
_STEEL = 207e9 / (2 * (1 - 0.3**2))  # composite modulus of two steel bodies, Pa
_EPS = 1e-3  # of the kicked oscillator, beta too
_UP, _HELD = 1.425, 5  # N, s of the slow force of presliding


def _slow(force: float, held: float) -> sp.Expr:
    """A force that goes up, down and up again between +- `force` in 10 and 20 s, and is held at each end."""
    q, hold = sp.nsimplify(force), sp.nsimplify(held)
    corners = [(0, 0), (10, q), (10 + hold, q), (30 + hold, -q), (30 + 2 * hold, -q), (50 + 2 * hold, q)]
    pieces = [(b + (t - a) * (d - b) / (c - a), t < c) for (a, b), (c, d) in zip(corners, corners[1:])]
    return sp.Piecewise(*pieces, (q, True))


PRESETS: dict[str, Preset] = {
    "figure-4": Preset(
        "friction_oscillator", "How far from the spring's rest can friction hold? Lower rho to 0.4, and look at the "
        "folds of the layer.", "HiddenStatic", _HIDDEN, {"amplitude": 0.0}, {"y": 1.5, "v": 0.0}, (0.0, 10.0),
        "layered",
    ),
    "figure-5": Preset(
        "friction_oscillator", "Slip, fast transition, sticking: which of the three comes next from a start of yours?",
        "HiddenStatic", _HIDDEN, None, {"y": 0.3, "v": 0.9}, (0.1, math.pi), "layered",
    ),
    "figure-6": Preset(
        "friction_oscillator", "It crosses, outside the sticking region. From which start on does it stick?",
        "HiddenStatic", _HIDDEN, None, {"y": -1.25, "v": -0.9}, (0.95, 2.2), "layered",
    ),
    "figure-7": Preset(
        "friction_oscillator", "Spikes of static friction: why does it stick once a period, and cross once?",
        "HiddenStatic", {"rho": 3.0, "beta": 0.01}, None, {"y": 0.6, "v": -1.07, "z": 0.0},
    ),
    "figure-8": Preset(
        "friction_oscillator", "Stick-slip with a hidden static term: for which rho does it stick twice a period?",
        "HiddenStatic", _HIDDEN,
    ),
    "figure-13": Preset(
        "friction_oscillator", "Does static friction outlive kicks of a fifth of the layer's width?", "HiddenStatic",
        {"rho": 3.0, "beta": _EPS}, None, {"y": 0.78, "v": -1.03, "z": 0.0}, (0.0, 2 * math.pi), "smoothed",
        {"eps": _EPS, "noise": Kicks(_EPS / 5, 2 * math.pi / 500, on=("y", "v"), seed=1), "names": ("friction", "v")},
    ),
    "fold": Preset(
        "friction_oscillator", "Static friction that acts at once: where does a stick end?", "HiddenStatic", _HIDDEN,
        t_span=(0.0, 25.0), view="layered",
    ),
    "coulomb": Preset("friction_oscillator", "What is left without the hidden term?", "Coulomb"),
    "two-fold": Preset(
        two_fold, "Which way from the two-fold, where many solutions leave and none is chosen?",
        shown={"names": ("x", "y", "z"), "phase": ("y", "z"), "views": ("time", "phase")},
    ),
    "lugre": Preset("block_on_belt", "How does a bristle model slip, and when does it stick?", "LuGre"),
    "lugre-presliding": Preset(
        "force_driven", "How far does it creep below the force that breaks it away?", "LuGre", {},
        {"force": _slow(_UP, _HELD), "t_span": (0.0, 65.0)}, shown={"names": ("x", "drive"), "phase": ("x", "drive")},
    ),
    "lugre-lag": Preset(
        "prescribed_motion", "Why is friction larger while speed rises than while it falls?", "LuGre", {},
        {"velocity": (sp.Rational(3, 2) + sp.cos(_RATE * t)) / 1000, "t_span": (0.0, 2.0),
         "parameters": {"rate": 10.0}},
        shown={"names": ("velocity", "force"), "phase": ("velocity", "force"), "ranges": {"rate": (1.0, 25.0)}},
    ),
    "lugre-break-away": Preset(
        "force_driven", "Does a force that rises faster break it away later or sooner?", "LuGre", {},
        {"force": _RATE * t, "t_span": (0.0, 2.1), "parameters": {"rate": 1.0}},
        shown={"names": ("v", "friction"), "phase": ("x", "friction"), "ranges": {"rate": (0.9, 50.0)}},
    ),
    "lugre-hunting": Preset(
        "position_control", "Why does a controller with integral action never find its target?", "LuGre", {}, {},
    ),
    "lugre-drift": Preset(
        "force_driven", "A force below break-away, and still it drifts. With which law does it not?", "LuGre", {},
        {"force": sp.Rational(3, 4) + sp.sin(2 * sp.pi * t) / 2, "t_span": (0.0, 20.0), "period": 1.0},
        shown={"names": ("x", "drive"), "phase": ("x", "drive")},
    ),
    "stribeck": Preset(
        "block_on_belt", "Friction that falls with speed: how fast must the belt be for sticks to end?",
        "StribeckFriction",
    ),
    "figure-4.8": Preset(
        "prescribed_motion", "Presliding: does each loop of hysteresis lie inside the next larger one?",
        "MultistateXKY", {"sigma": 0.01},
        {"position": _SIZE * sp.sin(sp.pi * t / 2), "t_span": (0.0, 8.0), "parameters": {"size": 1.0}},
        shown={"names": ("position", "force"), "phase": ("position", "force"), "ranges": {"size": (0.1, 1.5)}},
    ),
    "figure-c1": Preset(
        "free_impact", "How much of its indentation does a contact keep when it lets go?", "ResidualIndentation",
        {"K": 1000.0, "beta": 0.02, "gamma": 500.0, "n": 1.5}, {},
        shown={"names": ("p", "force"), "phase": ("p", "force")},
    ),
    "figure-c2": Preset(
        "falling_ball", "Does it bounce for ever, or does it come to rest? Ask the other laws.", "ResidualIndentation",
        {"beta": 0.005}, {"t_span": (0.0, 1.5)}, shown={"names": ("height", "force")},
    ),
    "figure-c3": Preset(
        "free_impact", "Asked for a restitution of one half: what does the law give?", "HertzImpact",
        {"K": 5e9, "c_r": 0.5}, {"speed": 0.3, "t_span": (0.0, 1e-4)}, shown={"names": ("p", "v"), "phase": ("p", "v")},
    ),
    "figure-c4": Preset(
        "free_impact", "A journal meets its bearing: how does damping open the loop of force and indentation?",
        "LiuImpact", {"E_star": _STEEL, "clearance": 5e-4, "c_r": 0.5}, {"speed": 0.3, "t_span": (0.0, 2e-3)},
        shown={"names": ("p", "force"), "phase": ("p", "force")},
    ),
    "figure-c5": Preset(
        "slider_crank", "How hard does a pin strike in a hole that is half a millimetre too wide?", None, {},
        {"clearance": 5e-4, "revolutions": 2.0}, shown={"names": ("velocity", "acceleration"), "phase": ("e_x", "e_y")},
    ),
    "bouncing": Preset("falling_ball", "A ball whose bounces come to rest: how many are there?", "HuntCrossley"),
    "train": Preset(
        "block_train", "Blocks in a row on a belt: does one slip carry the next one with it? Lower v_s.",
    ),
    "lattice": Preset(
        "block_lattice", "Does a slip of block 1, in a corner, take its neighbours along, 2 in its row, 7 in the next? "
        "And block 8 between these? Stiffen the springs.", shown={"names": ("v_1", "v_2", "v_7", "v_8")},
    ),
    "firing": Preset("firing_lattice", "Elements that push each other over the edge: do they come to fire together?"),
    "cradle": Preset(
        "granular_chain", "A blow runs through balls in a row: how much of it comes out? Lower the restitution.",
    ),
    "cloud": Preset(
        "element_cloud", "Many small sliders: where has the force a corner when only some of them give way?",
        shown={"names": ("position", "force"), "phase": ("position", "force")},
    ),
    "impacts": Preset(
        "impact_oscillator", "A driven mass before a wall: when do impacts lose their rhythm?", "KelvinVoigt",
    ),
}  # fmt: skip


def preset_of(name: str) -> Preset:
    """The preset of that name; ValueError with all names."""
    if name not in PRESETS:
        raise ValueError(f"`preset` is {name!r}; presets are {', '.join(PRESETS)}." + calls.hint(name, PRESETS))
    return PRESETS[name]


def subject_of_preset(name: str) -> Subject:
    """The subject of a preset."""
    preset = preset_of(name)
    if isinstance(preset.scene, str):
        subject = named_subject(preset.scene, preset.law, preset.law_values, preset.arguments)
        subject = with_ranges(subject, preset.scene)
    else:
        made = preset.scene.__name__
        code = (f"from {preset.scene.__module__} import {made}", f"scene = {made}()")
        subject = replace(subject_of(preset.scene()), code=code)
    return in_view(with_preset(subject, preset), preset.view)


def with_preset(subject: Subject, preset: Preset) -> Subject:
    """The subject at the start, span and names of a preset; ValueError where it has no such names."""
    start = {**subject.start, **preset.x0}
    subject.system.initial_state(start)
    shown = {**preset.shown, "ranges": {**subject.ranges, **preset.shown.get("ranges", {})}}
    return replace(subject, start=start, t_span=preset.t_span or subject.t_span, note=preset.said, **shown)


def with_ranges(subject: Subject, scene: str) -> Subject:
    """The subject with the ends of sliders that the package knows of its scene."""
    names = {p.name for p in subject.system.parameters}
    known = {n: r for n, r in RANGES.get(scene, {}).items() if n in names}
    return replace(subject, ranges={**known, **subject.ranges})


def as_asked(subject: Subject, asked: Mapping[str, Any]) -> Subject:
    """The subject with the `law`, its `values` and the `view` that a page asks for; ValueError for what is none."""
    law = checks.name(asked.get("law", ""), "`law`")
    values = checks.mapping(asked.get("values", {}), "`values`")
    words = {f.name for f in fields(law_of(law)) if f.metadata["choices"]} if law and values else set()
    for name, value in values.items():
        if isinstance(value, str) and name not in words:
            raise TypeError(f"`values` of {name} is {checks.shown(value)}; give a number.")
    if law and (subject.made is None or law != subject.made.law or values):
        subject = with_law(subject, law, values)
    return in_view(subject, str(asked.get("view", "")))


def in_view(subject: Subject, view: str) -> Subject:
    """The subject in the view "layered" (fast states at their equilibrium) or "smoothed"; "" is its own."""
    if not view:
        return subject
    system = subject.system
    if view == "layered":
        fast = {h.where for h in system.hidden_terms} & {s.name for s in system.states}
        system = system.layered(dict.fromkeys(sorted(fast), sp.oo))
        call = f"layered({{{', '.join(f'{n!r}: oo' for n in sorted(fast))}}})"
    elif view == "smoothed":
        system = system.smoothed(subject.eps)
        call = f"smoothed({subject.eps!r})"
    else:
        raise ValueError(f"the view {view!r} is none of layered, smoothed.")
    line = f"system = system.{call}" if subject.alone else f"scene = replace(scene, system=scene.system.{call})"
    code = (*subject.code, line)
    states = {s.name for s in system.states}
    start = {n: v for n, v in subject.start.items() if n in states}
    return replace(subject, system=system, start=start, code=code, name=f"{subject.name}, {view}")
