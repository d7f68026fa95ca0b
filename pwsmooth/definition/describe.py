"""A System in words: the equations as written, its switches with their classes, hidden terms, values."""

from __future__ import annotations

from html import escape

import sympy as sp

from .model import Model

SHOWN = 12  # entries of a list; families can be long
_FILIPPOV = [
    "filippov: on a surface the convex combination of both sides, in place of terms nonlinear in its switch"
]


def rows(system):
    """(heading, lines) of the description of a system."""
    model: Model = system.model
    # A family in one line: as it was written.
    element = None if system._view else system._element
    definition = element.definition if element else system.definition
    if element and model.families:
        model = model.families.template.model
    gone = system._view.gone if system._view else {}
    slaved = {x: f"   ({why})" for x, why in gone.items() if why}
    yield "rates", [f"{x}' = {rate}{slaved.get(x, '')}" for x, rate in definition.rates]
    yield "algebraic", [f"{a.unknown}: {a.residual} = 0" for a in definition.algebraic]
    classes = {m.symbol.name: f"   ({m.regularity})" for m in model.multipliers if m.kind == "switch"}
    yield "switches", [f"{s} = sign({s.surface}){classes.get(s.name, '')}" for s in definition.switches]
    # A hidden term on a surface that slides has no template.
    hidden = () if element else system.hidden_terms
    yield "hidden terms", [f"{term}   in {where}'" for where, _, term in hidden]
    yield "contacts", [f"0 <= {R.gap}, {R} >= 0, restitution {R.restitution}" for R in definition.contacts]
    yield "memories", [f"{m}, at first {m.initial:g}" for m in system.initial_memory]
    events = zip(model.events, definition.events)
    yield "events", [_event(spec, event) for spec, event in events]
    yield "watched", [f"{e.name} at {e.surface} = 0   ({e.singular})" for e in model.events if e.singular]
    yield "outputs", [f"{name} = {e}" for name, e in definition.outputs]
    values = _short([f"{p} = {v:g}" for p, v in system.parameters.items()])
    yield "parameters", [", ".join(values)] if values else []
    yield "convention", _FILIPPOV if system._convention == "filippov" else []
    yield "view", [*([system._view.title] if system._view else []), *system._notes]


def _event(spec, event):
    if event.surface is not None:
        instant = f"{event.surface} = 0" + {0: "", 1: ", rising", -1: ", falling"}[event.direction]
    else:
        instant = f"every {event.every}" if event.every is not None else f"at {', '.join(map(str, event.at))}"
    effect = ", ".join(f"{key} := {value}" for key, value in event.update)
    guard = "" if event.when is sp.true else f" if {event.when}"
    stop = ", stops" if event.terminal else ""
    return f"{spec.name}: {instant}{guard}" + (f": {effect}" if effect else "") + stop


def _short(entries):
    """The first entries of a long list."""
    return entries if len(entries) <= SHOWN + 1 else [*entries[:SHOWN], f"... and {len(entries) - SHOWN} more"]


def text(system):
    """The repr of a system."""
    states = [str(x) for x in system.states]
    lines = [f"System with states {', '.join(_short(states))}"]
    for heading, entries in rows(system):
        if entries:
            lines.append(f"  {heading}")
            lines += [f"    {entry}" for entry in _short(entries)]
    return "\n".join(lines)


def html(system):
    """The notebook view of a system."""
    body = "".join(
        f"<tr><th style='text-align:left;vertical-align:top'>{escape(heading)}</th><td style='text-align:left'>"
        + "<br>".join(f"<code>{escape(entry)}</code>" for entry in _short(entries))
        + "</td></tr>"
        for heading, entries in rows(system)
        if entries
    )
    return f"<table><caption>System</caption>{body}</table>"
