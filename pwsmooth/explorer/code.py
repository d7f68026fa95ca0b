"""A state of the page as a script, and as a figure in the house style: the same calls, written and made."""

from __future__ import annotations

import io
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from .. import plotting
from ..analysis.maps.seen import Strobe
from ..door import checks
from ..studies.attraction import basins, orbit_diagram
from .describe import characteristic
from .live import method_of, seen_by, state_of
from .subject import Subject

TYPES = {"png": "image/png", "pdf": "application/pdf", "svg": "image/svg+xml"}


def script(subject: Subject, asked: Mapping[str, Any]) -> str:
    """Python that gives the orbit of a state bit for bit, and plots the view `for`."""
    p, x0, span = state_of(subject, asked)
    changed = {n: v for n, v in p.items() if v != _own(subject, n)}
    begin = "solve(system, " if subject.alone else "scene.solve("
    body = [f"solution = {begin}{span!r}, {x0!r}, parameters={changed!r}, dense_output=True)"]
    body += [*_plot(subject, asked, changed, x0), "plt.show()"]
    # What makes the system, between the imports.
    makes = [line for line in subject.code if line.startswith((subject.what, "#"))]
    lines = ["# What `pwsmooth explore` shows, as a script."]
    if any("replace(" in line for line in makes):
        lines += ["from dataclasses import replace"]
    lines += [line for line in subject.code if line not in makes]
    lines += ["import matplotlib.pyplot as plt"]
    if any(" oo" in line for line in makes):
        lines += ["from sympy import oo"]
    if any("np." in line for line in body):
        lines += ["import numpy as np"]
    for home, names in (("", ("Return", "Strobe", "basins", "solve")), (".studies", ("orbit_diagram",))):
        if used := [name for name in names if any(f" {name}(" in line for line in body)]:
            lines += [f"from pwsmooth{home} import {', '.join(used)}"]
    return "\n".join([*lines, "from pwsmooth.plotting import style", "", *makes, "", *body, ""])


def _strobes(subject: Subject, asked: Mapping[str, Any]) -> str:
    """The arguments that say what makes the strobes, and by which method."""
    seen = seen_by(subject, asked)
    told = (
        f"Strobe({str(seen.period)!r})"
        if isinstance(seen, Strobe)
        else f"Return({seen.section!r}, {seen.direction})"
    )
    return ", ".join([told, *(f"{name}={value!r}" for name, value in method_of(subject, asked).items())])


def _own(subject: Subject, name: str) -> float | None:
    return next((float(v) for s, v in subject.system.parameters.items() if s.name == name), None)


def _plot(
    subject: Subject, asked: Mapping[str, Any], p: Mapping[str, float], x0: Mapping[str, float]
) -> list[str]:
    """The lines that draw a view."""
    view = asked.get("for", "time")
    known = f"system = {'system' if subject.alone else 'scene.system'}.with_parameters({dict(p)!r})"
    if view == "diagram":
        low, high, count, name = _diagram(asked)
        return [
            known,
            "with style():",
            f"    found = orbit_diagram(system, {name!r}, np.linspace({low!r}, {high!r}, {count}), {dict(x0)!r},",
            f"                          {_strobes(subject, asked)}, transient=100, keep=100)",
            "    ax = found.plot()",
        ]
    if view == "basins":
        axes, ranges, count = _basins(asked)
        grid = ", ".join(f"{n!r}: np.linspace({a!r}, {b!r}, {count})" for n, (a, b) in zip(axes, ranges))
        rest = {n: v for n, v in x0.items() if n not in axes}
        return [
            known,
            "with style():",
            f"    found = basins(system, {{{grid}}}, {_strobes(subject, asked)}, x0={rest!r})",
            "    ax = found.plot()",
        ]
    if view in ("phase", "characteristic"):
        return ["with style():", f"    axes = solution.plot(phase={tuple(_pair(subject, asked, view))!r})"]
    if view == "layer":
        return [
            "with style():",
            f"    ax = solution.plot_layer({str(asked.get('switch', ''))!r}, {_cursor(asked)!r})",
        ]
    return ["with style():", f"    axes = solution.plot({_names(asked, solution_names=None)!r})"]


def figure(subject: Subject, asked: Mapping[str, Any]) -> bytes:
    """The figure that the script draws, as a PNG, PDF or SVG file with the script in its metadata."""
    from matplotlib.figure import Figure

    kind = checks.one_of(*TYPES)(asked.get("format", "png"), "`format`")
    p, x0, span = state_of(subject, asked)
    view = asked.get("for", "time")
    values: Any
    with plotting.style():
        drawn = Figure(figsize=(7.0, 4.0), layout="constrained")
        if view == "diagram":
            low, high, count, name = _diagram(asked)
            values = np.linspace(low, high, count)
            found = orbit_diagram(
                subject.system.with_parameters(p), name, values, x0, seen_by(subject, asked),
                transient=100, keep=100, **method_of(subject, asked),
            )  # fmt: skip
            found.plot(ax=drawn.subplots())
        elif view == "basins":
            axes, ranges, count = _basins(asked)
            values = {n: np.linspace(a, b, count) for n, (a, b) in zip(axes, ranges)}
            rest = {n: v for n, v in x0.items() if n not in axes}
            system, seen = subject.system.with_parameters(p), seen_by(subject, asked)
            basins(system, values, seen, x0=rest, **method_of(subject, asked)).plot(ax=drawn.subplots())
        else:
            solution = subject.solve(span, x0, p)
            if view in ("phase", "characteristic"):
                solution.plot(phase=_pair(subject, asked, view), axes=drawn.subplots())
            elif view == "layer":
                solution.plot_layer(str(asked.get("switch", "")), _cursor(asked), drawn.subplots())
            else:
                names = _names(asked, solution)
                drawn.set_size_inches(7.0, 0.6 + 1.5 * len(names))
                solution.plot(names, np.atleast_1d(drawn.subplots(len(names), 1, sharex=True)))
        out = io.BytesIO()
        said, made = script(subject, asked), f"pwsmooth {version('pwsmooth')}"
        metadata = {
            "png": {"Software": made, "Description": said},
            "pdf": {"Creator": made, "Subject": said},
            "svg": {"Creator": made, "Description": said},
        }[kind]
        drawn.savefig(out, format=kind, metadata=metadata)
    return out.getvalue()


def _names(asked: Mapping[str, Any], solution: Any = None, solution_names: Any = None) -> list[str]:
    found = [str(n) for n in checks.several(asked.get("names", ()), "`names`") if not str(n).startswith("h:")]
    return found or ([*solution.states][:2] if solution is not None else [])


def _pair(subject: Subject, asked: Mapping[str, Any], view: str) -> list[str]:
    given = characteristic(subject.system.model) if view == "characteristic" else asked.get(view, ())
    pair = [str(n) for n in checks.several(given, f"`{view}`")]
    if len(pair) != 2:
        raise ValueError(f"`{view}` has {len(pair)} names; a plane has two.")
    return pair


def _cursor(asked: Mapping[str, Any]) -> float:
    return checks.number(asked.get("cursor", 0.0), "`cursor`")


def _diagram(asked: Mapping[str, Any]) -> tuple[float, float, int, str]:
    low, high = checks.interval(asked.get("range", ()), "`range`")
    return low, high, checks.whole(asked.get("columns", 800), "`columns`", 2), str(asked.get("parameter", ""))


def _basins(asked: Mapping[str, Any]) -> tuple[list[str], list[tuple[float, float]], int]:
    axes = [str(n) for n in checks.several(asked.get("axes", ()), "`axes`")]
    ranges = [checks.interval(r, "`ranges`") for r in checks.several(asked.get("ranges", ()), "`ranges`")]
    return axes, ranges, checks.whole(asked.get("cells", 300), "`cells`", 2)
