"""Whether stiffness holds explicit steps short: then method="auto" makes implicit ones.

A bristle that slides relaxes within 1/(sigma0 |v|/g), 1e-5 s of a usual one: explicit steps must be as short, however
slow the motion is. So a run is looked at that `look_after` explicit steps did not bring to its end. Where its motion
hardly turns from step to step, events are rare, and implicit steps cover the same stretch with `FEWER` times fewer,
these run it whole, from its start. Every shorter run keeps its steps, and so does one whose switches can slide.
Chain: stiff_events.py, event_driven.py -> **this file** -> solve.
"""

from __future__ import annotations

import contextlib
import functools

import numpy as np

from ..definition.model import Model
from ..results.records import Outcome
from ..results.solution import Solution
from . import event_driven, stiff_events
from .call import Call

LOOK, _LEAST = 10_000, 1000  # steps: 15 ms of three states; fewer of more than ten, which take longer
FEWER = 10  # an implicit step takes the time of some four explicit ones
_RARE = 20  # steps for each event: with fewer it is events that hold the steps
# Over a hundredth of these steps a motion that stiffness holds goes on in one direction nearly all the time. It gets
# by half at least of the way that it makes, with stiff bristles, and another one by less than a tenth.
_APART, _ALONG = 100, 0.25


@functools.lru_cache(maxsize=256)
def passes_only(model: Model) -> bool:
    """Whether the motion only passes its switches, as implicit steps need it: none slides, nothing is held."""
    families = model.families
    found = model.multipliers if families is None else families.template.model.multipliers
    return all(m.kind == "switch" and m.regularity != "sliding" for m in found)


def look_after(model: Model) -> int:
    """So many explicit steps are made before a run is looked at."""
    return max(_LEAST, min(LOOK, 10 * LOOK // len(model.states)))


def why_not(model: Model, call: Call) -> str:
    """Where the kind of steps is chosen already, or implicit ones cannot be."""
    options = call.options
    if options.method != "auto" or options.order is not None or options.strict:
        return "its steps are chosen"
    if call.random is not None or call.wanted is not None:
        return "noise and derivatives go along explicit steps"
    if not passes_only(model) or options.max_steps <= look_after(model):
        return "it is short, or something in it holds"
    return event_driven.why_not(model, call)


def run(call: Call) -> Solution:
    """The Solution by the steps that suit it."""
    spending, steps = call.budget(), look_after(call.system.model)
    looked = event_driven.run(call, spending.part(steps))
    if looked.outcome != Outcome.TOO_MANY_STEPS:
        return looked
    if call.times is not None:  # the steps' own are looked at
        looked = event_driven.run(call.changed(times=None), spending.part(steps))
    whole, again = call.changed(within=spending), call.changed(within=spending.part(spending.left))
    if not _is_held(looked, steps):
        return event_driven.run(whole)
    with contextlib.suppress(ValueError):  # such steps do not run this system
        span = float(looked.t[0]), float(looked.t[-1])
        part = call.changed(span=span, times=None, within=spending.part(steps // FEWER))
        if stiff_events.run(part).outcome == Outcome.FINISHED:
            found = stiff_events.run(whole)
            if found.success or found.outcome in (Outcome.TOO_MANY_STEPS, Outcome.TIME_LIMIT):
                return found
    found = event_driven.run(whole)
    if found.outcome == Outcome.TOO_MANY_STEPS:  # the stretch was no picture of the whole
        with contextlib.suppress(ValueError):
            if (other := stiff_events.run(again)).success:
                return other
    return found


def _is_held(looked: Solution, steps: int) -> bool:
    """Whether the steps are far shorter than what the motion does in them."""
    if _RARE * len(looked.events) > steps:
        return False
    size = np.abs(looked.x).max(axis=1, initial=np.finfo(float).tiny)[:, None]
    way, apart = (np.abs(np.diff(x / size)).sum() for x in (looked.x, looked.x[:, :: steps // _APART]))
    return bool(apart > _ALONG * way)
