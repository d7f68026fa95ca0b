"""Runs backward in time: the mirrored system run forward, and its solution put into the order of time.

The run ends where the past is not unique: where the motion forward has come to slide or to rest, or touched a surface
at the end of a slide.
Chain: solve -> **this file** -> event_driven.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..definition.model import Model
from ..definition.pointwise import holds, value
from ..definition.reversal import passed
from ..results import outputs
from ..results.records import EventRecord, Outcome
from ..results.solution import Solution
from . import event_driven
from .call import Call
from .clock import given_for

# Kinds of events that leave no trace of what came before them.
_FORGETFUL = {
    "stick", "closed contact", "accumulation", "slip by tangency", "slip by fold", "sliding to sliding", "opening",
    "rest", "ambiguity",
}  # fmt: skip
# What a slide forward looks like from behind.
_SLIDES = {"repelling sliding": "stick", "grazing": "slip by tangency"}
# Of the larger rate of a surface on its sides: a crossing that steep may be the end of a slide, told to rounding.
_STEEP = 1e-4
_ROUNDING = 1e-13  # of states and of time: on a surface


def why_not(model: Model, call: Call) -> str:
    """Where the span increases.

    Raises
    ------
    ValueError
        What no run backward in time has.
    """
    options = call.options
    if call.span[0] < call.span[1]:
        return "`t_span` increases"
    several = call.noise is not None or options.dense or options.method == "stiff" or call.wanted is not None
    if several or call.local or call.record is not None:
        raise ValueError(
            "`t_span` decreases: backward in time there is no `noise`, no `dense_output`, no `by`, no "
            "method 'stiff', no `record`, and nothing is `local`; give `t_eval` for wanted times."
        )
    return ""


def run(call: Call) -> Solution:
    """The past of a state, in the order of time.

    Raises
    ------
    ValueError
        A system that has no reverse, or what no event-driven run has.
    """
    system, span = call.system, (-call.span[0], -call.span[1])
    mirrored, ends = system._backward()  # `ends`: names of the contacts and events that no run backward passes
    event_driven.why_not(mirrored.model, call)
    exact = span
    if any(event.every is not None or event.at for event in mirrored.model.events):
        # Forward the instant at which a run begins is not part of it, the one at which it ends is.
        span = tuple(s - 8 * np.spacing(abs(s)) for s in span)
        if given_for(mirrored.model, mirrored.parameters, exact[1]) is not None:
            span = span[0], exact[1] + 8 * np.spacing(abs(exact[1]))  # ... but for one that is given
    shifted = list(zip(span, exact))
    times: Any = None if call.times is None else np.sort(-call.times)
    for s, wanted in shifted if times is not None else ():
        times[times == wanted] = s

    given = mirrored.initial_state(call.start, span[0])
    undone, start = _undo_at_once(mirrored, given, span[0])

    def forward(span: Any, times: Any) -> Solution:
        return event_driven.run(call.changed(system=mirrored, span=span, start=start, times=times))

    whole = forward(span, None)
    end = where_it_ends(whole, mirrored, ends)
    at_once = end is not None and end.time <= span[0]
    if end is not None and not at_once:
        # To a state at that very instant, which may lie inside of a step.
        span = span[0], end.time
        times = None if times is None else np.append(times[times < end.time], end.time)
    if not at_once and (end is not None or times is not None):
        whole = forward(span, times)
    kept = slice(1) if at_once else slice(None)
    x, mult, status = (part[:, kept][:, ::-1] for part in (whole.x, whole.mult, whole.status))
    through = None
    if whole.course is not None:
        through = -whole.course[0][::-1], whole.course[1][:, ::-1]
    events = [e for e in whole.events if end is None or e.time < end.time] + ([] if end is None else [end])
    t = whole.t[kept][::-1].copy()
    if end is None and events and events[-1].kind == "reset" and len(t) > 1 and t[0] == t[1] == whole.t[-1]:
        # Forward a start on the surface of an event is none.
        if any(e.name == events[-1].switch and e.surface is not None for e in mirrored.model.events):
            t, x, mult, status, events = t[1:], x[:, 1:], mult[:, 1:], status[:, 1:], events[:-1]
    if undone is not None and times is None:
        t = np.append(t, t[-1])
        x = np.column_stack([x, given])
        mult, status = (np.column_stack([part, part[:, -1]]) for part in (mult, status))
    if undone is not None:
        events = [undone, *events]
    for s, wanted in shifted:
        t[t == s] = wanted
    return Solution(
        system, -t, x, mult, status, [_forward(e) for e in events[::-1]], None,
        whole.outcome if end is None else Outcome.IRREVERSIBLE, whole.cost, whole.tolerances, [], system.parameters,
        through, backward=True,
    )  # fmt: skip


def _undo_at_once(mirrored: Any, given: Any, at: float) -> tuple[EventRecord | None, Any]:
    """The event that has just happened in the given state, if there is one, and the state before it.

    A run forward that ends on the surface of an event ends with the state behind it.
    """
    model, order = mirrored.model, mirrored.model.states
    if model.families is not None:
        return None, given
    point = dict(zip(order, given, strict=True)) | dict(mirrored.parameters) | {model.time: at}
    for mu in model.multipliers:
        if mu.surface is not None:
            point[mu.symbol] = 1.0 if value(mu.surface, point) >= 0.0 else -1.0
    for event in model.events:
        if event.surface is None or event.singular or not event.update:
            continue
        slopes = [
            (value(event.surface.diff(x), point), x, rate) for x, rate in zip(order, model.rhs, strict=True)
        ]
        near = sum(
            abs(slope) * (_ROUNDING * abs(point[x]) + _ROUNDING * (1 + abs(at)) * abs(value(rate, point)))
            for slope, x, rate in slopes
            if slope != 0.0
        )
        if abs(value(event.surface, point)) <= near and holds(event.when, point):
            before = list(given)
            for k, e in event.update:
                before[k] = value(e, point)
            return EventRecord(at, event.name, "reset"), before
    return None, given


def _forward(event: EventRecord) -> EventRecord:
    """An event of the mirrored run as it happens forward."""
    came, to, went = event.note.partition(" to ")
    note = f"{went}{to}{came}" if to else event.note
    return replace(event, time=-event.time, note=note)


def where_it_ends(run: Solution, mirrored: Any, ends: frozenset[str]) -> EventRecord | None:
    """The first instant of the mirrored run behind which the past is not unique."""
    model = mirrored.model
    rests = [
        m.symbol.name for m, s in zip(model.multipliers, run.status[:, 0]) if m.kind != "algebraic" and s == 0
    ]
    if rests:
        return EventRecord(float(run.t[0]), rests[0], "stick")
    found = [e for e in run.events if e.kind in _FORGETFUL or (e.switch in ends and e.kind != "crossing")]
    at = [(passed(e.switch), e.time) for e in run.events]
    moment = 1e-12 * (
        1.0 + abs(run.t[0]) + abs(run.t[-1])
    )  # an event that is undone puts the state on its surface
    found = [e for e in found if not any(e.switch == name and abs(e.time - t) <= moment for name, t in at)]
    found += [EventRecord(a.time, a.switch, _SLIDES.get(a.kind, a.kind)) for a in run.ambiguities]
    found += _steep_crossings(run, model)
    return min(found, key=lambda e: e.time, default=None)


def _steep_crossings(run: Solution, model: Any) -> list[EventRecord]:
    """Crossings at which the surface hardly moves on one side: there a slide may have ended."""
    slides = {m.symbol.name: m for m in model.multipliers if m.kind == "switch" and m.regularity == "sliding"}
    found = []
    for event in run.events:
        if event.kind != "crossing" or event.switch not in slides:
            continue
        k = int(np.searchsorted(run.t, event.time))
        rate = outputs.vectorised(model, slides[event.switch].residual)
        index = [m.symbol.name for m in model.multipliers].index(event.switch)
        values = [run.parameters[str(p)] for p in model.parameters]
        speeds = []
        for side in (1.0, -1.0):
            mult = run.mult[:, k].copy()
            mult[index] = side
            speeds.append(abs(float(rate(run.t[k], *run.x[:, k], *mult, *values))))
        if not min(speeds) > _STEEP * max(speeds):
            found.append(EventRecord(event.time, event.switch, "slip by tangency"))
    return found
