"""Runs backward in time: the mirrored system run forward, and its solution put into the order of time.

The run ends where the past is not unique: where the motion forward has come to slide or to rest, or touched a surface
at the end of a slide.
Chain: solve -> **this file** -> event_driven.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..definition.model import Model
from ..results import outputs
from ..results.records import EventRecord, Outcome
from ..results.solution import Solution
from . import event_driven
from .call import Call

# Kinds of events that leave no trace of what came before them.
_FORGETFUL = {
    "stick", "closed contact", "accumulation", "slip by tangency", "slip by fold", "sliding to sliding", "opening",
    "rest", "ambiguity",
}  # fmt: skip
# What a slide forward looks like from behind.
_SLIDES = {"repelling sliding": "stick", "grazing": "slip by tangency"}
# Of the larger rate of a surface on its sides: a crossing that steep may be the end of a slide, told to rounding.
_STEEP = 1e-4


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
            "`t_span` decreases: backward in time there is no `noise`, no `dense_output`, no `with_respect_to`, no "
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
    shifted = list(zip(span, exact))
    times: Any = None if call.times is None else np.sort(-call.times)
    for s, wanted in shifted if times is not None else ():
        times[times == wanted] = s

    def forward(span: Any, times: Any) -> Solution:
        start = mirrored.initial_state(call.start, span[0])
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
    for s, wanted in shifted:
        t[t == s] = wanted
    return Solution(
        system, -t, x, mult, status, [_forward(e) for e in events[::-1]], None,
        whole.outcome if end is None else Outcome.IRREVERSIBLE, whole.cost, whole.tolerances, [], system.parameters,
        through, backward=True,
    )  # fmt: skip


def _forward(event: EventRecord) -> EventRecord:
    """An event of the mirrored run as it happens forward."""
    came, to, went = event.note.partition(" to ")
    return EventRecord(-event.time, event.switch, event.kind, f"{went}{to}{came}" if to else event.note)


def where_it_ends(run: Solution, mirrored: Any, ends: frozenset[str]) -> EventRecord | None:
    """The first instant of the mirrored run behind which the past is not unique."""
    model = mirrored.model
    rests = [
        m.symbol.name for m, s in zip(model.multipliers, run.status[:, 0]) if m.kind != "algebraic" and s == 0
    ]
    if rests:
        return EventRecord(float(run.t[0]), rests[0], "stick")
    found = [e for e in run.events if e.kind in _FORGETFUL or (e.switch in ends and e.kind != "crossing")]
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
