"""States that are worth a look, and views of a subject.

Numbers of the paper's figures are those of `paper_figures/oscillator.py`; tests/test_explore.py compares them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import sympy as sp

from .subject import Subject, named_subject

#: Ends of sliders of scenes, where a system alone would only guess.
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "friction_oscillator": {
        "rho": (0.05, 8.0), "beta": (0.01, 1.0), "amplitude": (0.0, 6.0), "omega": (0.2, 3.0), "F_c": (0.1, 3.0),
        "mass": (0.2, 3.0), "spring": (0.5, 8.0), "damper": (0.0, 1.0),
    },
    "impact_oscillator": {"omega": (0.2, 3.0), "amplitude": (0.0, 3.0)},
}  # fmt: skip


@dataclass(frozen=True)
class Preset:
    """A scene at certain values, with the view to look at first."""

    scene: str
    said: str
    law: str | None = None
    law_values: Mapping[str, float] = field(default_factory=dict)
    p: Mapping[str, float] = field(default_factory=dict)
    x0: Mapping[str, float] = field(default_factory=dict)
    t_span: tuple[float, float] | None = None
    view: str = ""


PRESETS: dict[str, Preset] = {
    "figure-7": Preset(
        "friction_oscillator", "spikes of static friction: sticks once a period and crosses once", "HiddenStatic",
        {"rho": 3.0, "beta": 0.01}, x0={"y": 0.6, "v": -1.07, "z": 0.0},
    ),
    "figure-8": Preset(
        "friction_oscillator", "stick-slip with a hidden static term, the paper's numbers", "HiddenStatic",
        {"rho": 3.0, "beta": 0.1},
    ),
    "fold": Preset(
        "friction_oscillator", "static friction that acts at once: sticks end in a fold of the layer", "HiddenStatic",
        {"rho": 3.0, "beta": 0.1}, t_span=(0.0, 25.0), view="layered",
    ),
    "coulomb": Preset("friction_oscillator", "the same without the hidden term", "Coulomb"),
    "lugre": Preset("block_on_belt", "stick-slip of the bristle model", "LuGre"),
    "stribeck": Preset("block_on_belt", "stick-slip where friction falls with speed", "StribeckFriction"),
    "bouncing": Preset("falling_ball", "a ball whose bounces come to rest", "HuntCrossley"),
    "impacts": Preset("impact_oscillator", "a driven mass that meets a wall", "KelvinVoigt"),
}  # fmt: skip


def preset_of(name: str) -> Preset:
    """The preset of that name; ValueError with all names."""
    if name not in PRESETS:
        raise ValueError(f"`preset` is {name!r}; presets are {', '.join(PRESETS)}.")
    return PRESETS[name]


def subject_of_preset(name: str) -> Subject:
    """The subject of a preset."""
    preset = preset_of(name)
    subject = with_ranges(named_subject(preset.scene, preset.law, preset.law_values), preset.scene)
    return in_view(with_preset(subject, preset), preset.view)


def with_preset(subject: Subject, preset: Preset) -> Subject:
    """The subject at the values of a preset; ValueError where it has no such names."""
    system = subject.system.with_parameters(preset.p)
    start = {**subject.start, **preset.x0}
    system.initial_state(start)
    return replace(subject, system=system, start=start, t_span=preset.t_span or subject.t_span)


def with_ranges(subject: Subject, scene: str) -> Subject:
    """The subject with the ends of sliders that the package knows of its scene."""
    names = {p.name for p in subject.system.parameters}
    known = {n: r for n, r in RANGES.get(scene, {}).items() if n in names}
    return replace(subject, ranges={**known, **subject.ranges})


def in_view(subject: Subject, view: str) -> Subject:
    """The subject in the view "layered" (fast states at their equilibrium) or "smoothed"; "" is its own."""
    if not view:
        return subject
    system = subject.system
    if view == "layered":
        fast = {h.where for h in system.hidden_terms} & {s.name for s in system.states}
        system = system.layered(dict.fromkeys(sorted(fast), sp.oo))
        code = (*subject.code, f"scene = replace(scene, system=scene.system.layered({{{', '.join(f'{n!r}: oo' for n in sorted(fast))}}}))")  # noqa: E501  # fmt: skip
    elif view == "smoothed":
        system = system.smoothed(1e-2)
        code = (*subject.code, "scene = replace(scene, system=scene.system.smoothed(0.01))")
    else:
        raise ValueError(f"the view {view!r} is none of layered, smoothed.")
    states = {s.name for s in system.states}
    start = {n: v for n, v in subject.start.items() if n in states}
    return replace(subject, system=system, start=start, code=code, name=f"{subject.name}, {view}")
