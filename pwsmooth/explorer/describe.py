"""Controls and views of a subject, as data: what the page needs to know before its first orbit."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
import sympy as sp

from .. import plotting
from ..definition.model import Model
from ..studies.study import law_of
from .labels import spelled, written
from .subject import Subject, laws_for

#: What a page may ask of a process; `each` within a factor of 10 by the page.
LIMITS = {"span": 1000.0, "periods": 500, "steps": 200_000, "seconds": 2.0, "columns": 2000, "points": 1000,
          "cells": 600, "job": 600.0}  # fmt: skip
MOST = 100  # states, of which all are listed; of more these first ones
STARTS, CURVES = 12, 40  # states that have a slider, names that can be drawn over time
#: Views in the order in which they stand on the page.
TITLES = {
    "time": "Time series", "mechanism": "Mechanism", "phase": "Phase plane", "characteristic": "Characteristic",
    "layer": "Layer", "diagram": "Orbit diagram", "basins": "Basins", "section": "Poincaré section",
    "noise": "Under noise",
}  # fmt: skip
_MISSING = "No diagram, basins or section: "
#: What the page says of itself.
WORDS = {
    "keys": [
        ("Space", "play or pause"), (", .", "to the event before, after"), ("d", "orbit diagram"), ("b", "basins"),
        ("Esc", "stop a computation"), ("Ctrl Z", "undo"), ("Tab", "to the next slider, field or picture"),
        ("arrows", "a slider: its value; time series: the cursor; phase plane: the start; with Shift ten times"),
        ("click", "time series: the cursor; phase plane, basins: the start; orbit diagram: the orbit there"),
        ("drag", "the same, and of the orbit diagram a part that is computed anew"),
        ("wheel", "zoom; Fit shows all again"), ("finger", "scrolls; after a rest it moves a point"),
        ("?", "this list"),
    ],
    "figure": "Drawn by matplotlib in the package's style, with the script that makes it inside.",
    "start": "Drag the ring or click: another start. ",
    "band": "Band: it can stick there now.",
    "basins": "↻ shows which orbit each start leads to; click or drag to follow one.",
    "picked": "Undo restores the old start; this one is the diagram's, at",
    "live": "Computed anew when a parameter has rested",
    "fit": "All of it, at the best scale",
    "computing": "Computing ...",
    "number": "Give a number, such as 1.5.",
    "pair": "Give two numbers, the smaller one first.",
}  # fmt: skip


def describe(subject: Subject, solution: Any = None, view: Any = "") -> dict[str, Any]:
    """Title, names as they are written, sliders, menus, the views that it has, colours: JSON.

    With a first solution the ranges of the states are those that its motion suggests. `view` is the one that was asked
    for, in place of the system's own.
    """
    system, model = subject.system, subject.system.model
    states = [s.name for s in model.states[: len(model.states) - model.n_memory]][:MOST]
    multipliers = [str(m.symbol) for m in model.multipliers if m.kind != "component"][:MOST]
    outputs = [str(name) for name, _ in model.outputs] if model.families is None else (
        [n for n in dict.fromkeys((*subject.names, *subject.phase)) if n not in (*states, *multipliers)]
    )  # fmt: skip
    units = {name: unit for name, unit in subject.units.items() if unit != "1"}
    law = _law(subject)
    axes = {name: _reach(subject.start[name], k, solution) for k, name in enumerate(states)}
    known: dict[str, Any] = {
        "title": subject.name,
        "heading": (subject.name[:1].upper() + subject.name[1:]).replace(", ", " · "),
        "words": WORDS,
        "note": subject.note,
        "view": str(system._view.title) if system._view else "",
        "time": str(model.time or "t"),
        "states": states,
        "multipliers": multipliers,
        "outputs": outputs,
        "units": units,
        "start": {name: subject.start[name] for name in states},
        "t_span": list(subject.t_span),
        "period": subject.period_at({}),
        "axes": axes,
        "starts": [
            {"name": name, "min": low, "max": high, "tail": units.get(name, ""), "value": subject.start[name]}
            for name, (low, high) in list(axes.items())[:STARTS]
        ],
        "controls": controls(subject),
        "names": list(subject.names) or (states + outputs)[:2],
        "phase": list(subject.phase) or _phase(states, outputs),
        "characteristic": characteristic(model),
        "switches": switches(model),
        "models": _models(subject, law, str(view or "")),
        "map": _map(subject, states),
        "sketch": subject.sketch and {
            "shapes": subject.sketch.describe(),
            "note": subject.sketch.note and f"; {subject.sketch.note}",
        },
        "law": law,
        "noise": "" if subject.noise is None else str(subject.noise),
        "eps": subject.eps,
        "read_only": subject.read_only,
        "locked": subject.read_only,
        "command": f"On another machine:\n{subject.command or 'pwsmooth explore SCENE'} --state ",
        "colours": {
            "right": plotting.COLOUR["right"], "left": plotting.COLOUR["left"], "stick": plotting.COLOUR["stick"],
            "line": plotting.COLOUR["mark"], "fast": plotting.COLOUR["fast"],
            # Right, left and stick are phases here: basins take the others first.
            "basins": [plotting.COLOUR[k] for k in ("smoothed", "approximation", "fast", "velocity", "no events",
                                                    "with events", "stick")],
        },
        "limits": LIMITS,
    }  # fmt: skip
    told = [*states, *multipliers, *outputs, *known["characteristic"], known["time"],
            *(c["name"] for c in known["controls"])]  # fmt: skip
    known["labels"] = {
        name: (*spelled(name), text := written(name), f"{text} ({units[name]})" if name in units else text)
        for name in told
    }
    known["curves"] = [(n, written(n)) for n in (*states, *multipliers, *outputs)][:CURVES]
    return known | {"views": _views(subject, known), "menus": _menus(known)}


def _views(subject: Subject, known: dict[str, Any]) -> dict[str, str]:
    """The views that are offered, with their titles; maps that wait for a section are moved to those of the map."""
    plane, two = bool(known["phase"]), len(known["states"]) > 1
    has = {
        "time": True, "mechanism": subject.sketch is not None, "phase": plane,
        "characteristic": bool(known["characteristic"]), "layer": bool(known["switches"]), "diagram": True,
        "basins": two, "section": plane and two, "noise": subject.noise is not None,
    }  # fmt: skip
    offered = {key: title for key, title in TITLES.items() if has[key] and key in (subject.views or TITLES)}
    maps = (
        {}
        if known["map"]["ok"]
        else {k: offered.pop(k) for k in ("diagram", "basins", "section") if k in offered}
    )
    known["map"]["views"] = maps if known["map"]["sections"] else {}
    known["map"]["why"] *= "diagram" in maps
    return offered


def _menus(known: dict[str, Any]) -> dict[str, list[Any]]:
    """Menus of the views: (what it is for, the place in the state that it writes, its options with their texts)."""

    def named(names: list[str]) -> list[tuple[str, str]]:
        return [(name, written(name)) for name in names]

    states, outputs, everything = known["states"], known["outputs"], [*known["states"], *known["multipliers"]]
    ways = [(0, "same start"), (1, "carried on →"), (-1, "carried on ←")]
    sides = ("horizontal axis", "vertical axis")
    return {
        "phase": [(side, ("phase", k), named([*everything, *outputs])) for k, side in enumerate(sides)],
        "layer": [("switch", ("switch",), named(known["switches"]))] * (len(known["switches"]) > 1),
        "diagram": [
            ("parameter", ("diagram", "parameter"), named([c["name"] for c in known["controls"]])),
            ("what is shown", ("diagram", "y"), named(states)),
            ("where each column starts", ("diagram", "carry"), ways),
        ],
        "basins": [(f"{side} of the basins", ("basins", "axes", k), named(states)) for k, side in enumerate(sides)],
        "noise": [("what is shown", ("noise", "name"), named([*states, *outputs]))],
    }  # fmt: skip


def _models(subject: Subject, law: dict[str, Any], view: str) -> list[dict[str, Any]]:
    """Menus for another law, what shapes it, and another view: `name` is chosen, the `part` goes with it."""
    found = []
    if law and len(law["all"]) > 1:
        options = [(name, name) for name in law["all"]]
        found.append({"text": "Law", "label": "law", "name": "law", "value": law["name"], "options": options,
                      "part": {"values": {}, "view": ""}})  # fmt: skip
    for f in law.get("shape", ()):
        options = [(choice, choice) for choice in f["choices"]]
        found.append({"text": written(f["name"]), "label": f["meaning"], "name": f["name"], "value": f["value"],
                      "options": options, "part": {"law": law["name"]}, "shape": True})  # fmt: skip
    if view or switches(subject.system.model):
        options = [("", "as defined"), ("smoothed", f"smoothed, ε = {subject.eps:g}")]
        if view or _has_hidden(subject.system):
            options.insert(1, ("layered", "layered: fast states in the layer"))
        found.append({"text": "View", "label": "view of the system", "name": "view", "value": view,
                      "options": options, "part": {}})  # fmt: skip
    return found


def _law(subject: Subject) -> dict[str, Any]:
    """The law, those that fit in its place, and what shapes it: numbers and words that no slider can change."""
    if subject.made is None or subject.made.law is None:
        return {}
    law = law_of(subject.made.law)
    shaping = [f for f in fields(law) if f.metadata["structural"]]
    return {
        "name": subject.made.law, "all": laws_for(subject),
        "shape": [{"name": f.name, "value": subject.made.values.get(f.name, f.default),
                   "meaning": f.metadata["meaning"], "choices": list(f.metadata["choices"])} for f in shaping],
    }  # fmt: skip


def _phase(states: list[str], outputs: list[str]) -> list[str]:
    """The two names of the phase plane; none where there is one name only."""
    names = [*states, *outputs]
    return names[:2] if len(names) > 1 else []


def characteristic(model: Model) -> list[str]:
    """(slip velocity, force): the surface of a switch, "h:lam" where it is no state, and an output of it."""
    if model.families is not None:
        return []
    moving = [m for m in model.multipliers if _moves(model, m)]
    found = sorted(moving, key=lambda m: not can_slide(model, m))
    forces = {str(n): sp.sympify(e, strict=True).free_symbols for n, e in model.outputs}
    for m in found:
        slip = str(m.surface) if m.surface in model.states else f"h:{m.symbol}"
        named = [n for n, symbols in forces.items() if n in ("friction", "force") or m.symbol in symbols]
        if named and (m.surface in model.states or named[0] in ("friction", "force")):
            return [slip, named[0]]
        if m.surface in model.states:
            return [slip, str(m.symbol)]
    return []


def switches(model: Model) -> list[str]:
    """Names of the switches whose layer can be opened."""
    if model.families is not None:
        return []
    return [str(m.symbol) for m in model.multipliers if can_slide(model, m)]


def can_slide(model: Model, m: Any) -> bool:
    """Whether it is a switch with a layer: its surface moves with the states, and its dh/dt depends on it."""
    return _moves(model, m) and m.regularity == "sliding" and m.symbol in m.residual.free_symbols


def _moves(model: Model, m: Any) -> bool:
    """Whether it is a switch whose surface is one of states."""
    return m.kind == "switch" and bool(m.surface.free_symbols & set(model.states))


def _has_hidden(system: Any) -> bool:
    return system.model.families is None and bool(system.hidden_terms)


def _map(subject: Subject, states: list[str]) -> dict[str, Any]:
    """Whether orbit diagram, basins and section are offered; else why not."""
    controlled = [str(p) for p in subject.system.parameters]
    known: dict[str, Any] = {
        "ok": subject.period is not None, "why": "",
        "parameter": next((n for n in (*subject.ranges, *controlled) if n in controlled), None),
        "sections": [] if subject.period is not None else [
            (f"{n} {way}", f"{written(n)} = 0, {told}")
            for n in states[:20] for way, told in ((1, "rising"), (-1, "falling"))
        ],
    }  # fmt: skip
    if subject.system.model.smoothing:
        why = f"{_MISSING}a smoothed view runs on the stiff path, too slowly for a map that grows. "
        return known | {"ok": False, "why": why, "sections": []}
    if subject.period is None:
        known["why"] = (
            f"{_MISSING}no period: this system is not driven periodically, so that there are no strobes. "
        )
    return known


def _reach(start: float, k: int, solution: Any) -> list[float]:
    """A range of state k for sliders and basins: half as far again as the motion, in round numbers."""
    row = np.array([start]) if solution is None else np.append(solution.x[k][np.isfinite(solution.x[k])], start)
    most = 1.3 * float(np.abs(row).max()) or 1.0
    power = 10.0 ** math.floor(math.log10(most))
    reach = next(
        float(f"{r * power:.3g}") for r in (1, 1.5, 2, 2.5, 3, 4, 5, 8, 10) if r * power >= 0.999 * most
    )
    return [-reach, reach]


def controls(subject: Subject) -> list[dict[str, Any]]:
    """A slider for every parameter; one for the members of a family where they have one value."""
    system = subject.system
    values = {p.name: (p, float(v)) for p, v in system.parameters.items()}
    taken: set[str] = set()
    found = []
    for name, members in system.groups.items():
        inside = [m for m in members if m in values]
        if len(inside) > 1 and len({values[m][1] for m in inside}) == 1:
            each = _control(subject, name, *values[inside[0]])
            each["tail"] = f"{each['tail']} each of {len(inside)}".strip()
            found.append(each | {"each": len(inside)})
            taken |= set(inside)
    found += [_control(subject, name, p, v) for name, (p, v) in values.items() if name not in taken]
    order = list(values)
    return sorted(found, key=lambda c: order.index(c["name"]) if c["name"] in order else 0)


def _control(subject: Subject, name: str, symbol: Any, value: float) -> dict[str, Any]:
    low, high, log = _range(symbol, value)
    if name in subject.ranges:
        low, high = subject.ranges[name]
        log = log and low > 0 and high / low > 30
    span = (max(low, value / 10), min(high, 5 * value)) if log else (low or 1e-3 * high, high)
    base, unit = name.partition("_")[0], subject.units.get(name, "")
    return {
        "name": name, "value": value, "min": low, "max": high, "log": log, "span": span,
        "unit": "" if unit == "1" else unit, "tail": "" if unit == "1" else unit,
        "meaning": subject.meanings.get(name, subject.meanings.get(base, "")),
        "sign": "positive" if symbol.is_positive else "nonnegative" if symbol.is_nonnegative else "real",
    }  # fmt: skip


def _range(symbol: Any, value: float) -> tuple[float, float, bool]:
    """(lowest, highest, whether logarithmic) of a slider, by the symbol's assumptions and the value's size."""
    if symbol.is_positive:
        if value / 10 > 0.05 or value / 10 < 1e-3:
            return value / 100, 100 * value, True
        return value / 1000, 2 * value, False
    if symbol.is_nonnegative:
        return 0.0, 2 * value if value else 1.0, False
    reach = max(1.0, abs(value))
    return value - reach, value + reach, False
