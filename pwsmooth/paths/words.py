"""The event-driven kernels' integers in words: events, ambiguities, instants without derivative.

Chain: kernels/state.py (the integers) -> **this file** -> event_driven.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import sympy as sp

from ..definition.model import Model
from ..definition.singular import remedy
from ..kernels import state as names
from ..kernels.tangent.state import CORNER, GRAZES
from ..results.outputs import vectorised
from ..results.records import CONFLICTING_UPDATES, Ambiguity

KINDS = {
    names.EV_CROSSING: "crossing",
    names.EV_STICK: "stick",
    names.EV_TANGENCY: "slip by tangency",
    names.EV_FOLD: "slip by fold",
    names.EV_FOLD_TO_SLIDING: "sliding to sliding",
    names.EV_EVENT: "reset",
    names.EV_IMPACT: "impact",
    names.EV_CLOSED: "closed contact",
    names.EV_OPENING: "opening",
    names.EV_ACCUMULATION: "accumulation",
    names.EV_RESET: "slip by reset",
}
Words = tuple[str, str, str]  # of an event: its switch, kind and note
_STOPPED = 1e-7  # of an argument's size: a run into a singular point stops that near


def event_words(model: Model) -> Callable[..., Words]:
    """What the kernels recorded of an event -> its switch, kind and note."""
    multipliers = model.multipliers

    @functools.cache
    def words(index: int, kind: int, came: int, went: int) -> Words:
        if index >= len(multipliers):
            return words_of(model, index - len(multipliers), kind, bool(went))
        contact = multipliers[index].kind == "contact"
        note = "" if contact else f"{came:+d} to {went:+d}".replace("+0", "0")
        return multipliers[index].symbol.name, KINDS[kind], note

    return words


def words_of(model: Model, i: int, kind: int = names.EV_EVENT, stands: bool = False) -> Words:
    """Switch, kind and note of the model's event i: also a singular argument that has come to 0."""
    event = model.events[i]
    if event.singular and kind == names.EV_REST:
        return event.name, "rest", f"{event.surface} = 0"
    if event.singular:
        zero = f"{event.surface} {'<=' if event.singular == 'end' and not stands else '='} 0"
        return event.name, "singular point", f"{zero}: {remedy(model, event, stands)}"
    if kind == names.EV_ACCUMULATION:
        return event.name, KINDS[kind], ""
    return event.name, "terminal" if event.terminal else "reset", ""


def singular_cause(model: Model, t: Any, x: Any, mult: Any, p: Any, atol: Any) -> int | None:
    """The event of a singular argument because of which a run stopped at this one instant, or None.

    One that has left its domain, or that a change of the states by their last digits brings to 0.
    """
    for i, event in enumerate(model.events):
        if event.singular in ("pole", "end") and event.surface is not None:
            slopes = sp.Tuple(event.surface, *(event.surface.diff(s) for s in model.states))
            with np.errstate(all="ignore"):
                value, *gradient = (
                    float(np.ravel(part)[0]) for part in vectorised(model, slopes)(t, *x, *mult, *p)
                )
            reach = sum(abs(g) * (_STOPPED * abs(float(s[0])) + 1e3 * e) for g, s, e in zip(gradient, x, atol))
            if not abs(value) > reach or (event.singular == "end" and value < 0):
                return i
    return None


def ambiguities_in_words(model: Model, times: np.ndarray, records: np.ndarray) -> list[Ambiguity]:
    words = {
        names.AMB_REPELLING: ("repelling sliding", ("leave to +1", "leave to -1", "stay on the surface")),
        names.AMB_SEVERAL_ROOTS: (
            "several attracting states of the layer",
            ("from lam = 0", "from -1", "from +1"),
        ),
        names.AMB_TWO_FOLD: ("two-fold", ("leave to +1", "leave to -1", "stay on the surface")),
        names.AMB_CORNER: ("corner", ("the outcome changes with eps_ratio",)),
        names.AMB_GRAZING: ("grazing", ("touch and stay on this side", "cross")),
        names.AMB_HIDDEN_OSCILLATION: ("hidden oscillation", ("the layer never comes to rest",)),
        names.AMB_FOLD: ("fold", ("touch and stay on the surface", "leave by the fold")),
        names.AMB_IMPACTS: ("simultaneous impacts", ("together", "one after the other")),
        names.AMB_INDETERMINATE: ("indeterminate contact", ("part", "stay closed", "tangential impact")),
        names.AMB_UPDATES: CONFLICTING_UPDATES,
        names.AMB_ACCUMULATION: (
            "events that accumulate",
            ("as after the last that is resolved", "as after another"),
        ),
        names.AMB_CHATTERING: (
            "chattering within atol",
            ("on the surface, as on average", "to and fro, ever more often"),
        ),
        names.AMB_FORCES: (
            "multipliers not unique",
            ("the largest as small as it can be", "others of the same sum"),
        ),
        names.AMB_AT_ZERO: (
            "rest on the border of a condition",
            ("as on the side from which it comes", "as the condition says of 0"),
        ),
        names.AMB_NEAR_MISS: ("near miss", ("stick", "slip on, as every motion beside this one")),
    }
    found = []
    for t, (index, kind, taken) in zip(times.tolist(), records.tolist(), strict=True):
        name, continuations = words[kind]
        if kind == names.AMB_SEVERAL_ROOTS and model.multipliers[index].kind == "algebraic":
            name, continuations = "several roots of an unknown", ("this root", "another one, of other sides")
        disc = index < len(model.multipliers) and model.multipliers[index].kind == "disc"
        if kind in (names.AMB_TWO_FOLD, names.AMB_HIDDEN_OSCILLATION):
            choice = "stopped"
        elif kind in (names.AMB_GRAZING, names.AMB_FOLD, names.AMB_INDETERMINATE):
            if kind == names.AMB_GRAZING and disc:
                continuations = ("touch and slip on", "stick until the force exceeds the friction")
            choice = continuations[taken]
        elif kind == names.AMB_REPELLING and disc:
            continuations = ("leave along the first axis", "leave in another direction", "stay on the surface")
            choice = continuations[0]
        elif kind == names.AMB_REPELLING:
            choice = "stay on the surface" if taken == 0 else f"leave to {taken:+d}"
        else:
            choice = continuations[0]
        m = len(model.multipliers)
        what = str(model.multipliers[index].symbol) if index < m else model.events[index - m].name
        found.append(Ambiguity(t, what, name, choice, continuations))
    return found


def why_not(reason: int, cause: str) -> str:
    """Why an instant has no derivative."""
    reasons = {
        GRAZES: "touches its surface (grazing)",
        CORNER: "meets its surface together with others, in an order that any change may turn (a corner)",
    }
    return f"{cause} {reasons.get(reason, 'begins anew by a rule that has no derivative')}".lstrip()


def meets_several(without: Iterable[str]) -> bool:
    """Whether words of instants without derivative have one at which several surfaces are met."""
    return any(said.endswith(why_not(CORNER, "")) for said in without)


def instants_without(model: Model, times: np.ndarray, why: np.ndarray) -> Iterator[tuple[float, str]]:
    """Instants of a replay that have no derivative, and why in words."""
    known = [str(mu.symbol) for mu in model.multipliers] + [event.name for event in model.events]
    for t, (reason, cause) in zip(times.tolist(), why.tolist()):
        if reason:
            yield t, why_not(reason, known[cause] if 0 <= cause < len(known) else "")
