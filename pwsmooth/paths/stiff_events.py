"""Stiff steps for a system that switches and never slides: method="stiff" of solve().

A bristle law (LuGre, elastoplastic) or a contact with strong damping is stiff, and its switches are kinks: the field
bends at them, no layer forms. Each multiplier then is a memory, +1 or -1, that an event at its surface writes, and the
integrator of the smoothed path (stiff.py) makes implicit steps between these events: nothing is smoothed.
Chain: solve -> **this file** -> stiff_steps.py; the first side of every switch comes from event_driven.py.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ..codegen.fields import above_at_zero
from ..codegen.graph.dag import UNARY
from ..codegen.taylor.recurrences import FLAT
from ..definition.families.template import family_model, named
from ..definition.model import EventSpec, Model, Select
from ..results.records import course
from ..results.solution import Solution
from .budget import Budget
from .call import Call
from .clock import Periodic, periodic_switches, require_none_at_start
from .event_driven import LOOSEST, prepared_run
from .smoothed import explicit_alone, own
from .words import Words, words_of

_FLAT = tuple(function for function, name in UNARY.items() if name in FLAT)
WIDTH = sp.Float(1e-6)  # of the strip around a surface that is looked at where nothing tells its width


def strip(mu: Any, model: Model, sums: tuple[sp.Expr, ...] = ()) -> sp.Expr | None:
    """Width around a switch's surface in which functions like exp(-(h/w)^2) change; None without such functions.

    They are flat elsewhere: a step that ends beyond the strip sees nothing of it, so none may pass over it unseen
    (kernels/stiff/gate.py, which protects the layers of smoothed views in the same way).
    """
    h, found = sp.Dummy("h", positive=True), set()
    atoms = set().union(*(e.atoms(*_FLAT) for e in (*model.rhs, *sums)))
    for atom in atoms:
        argument = atom.args[0].xreplace({mu.symbol: sp.Integer(1)}).subs(mu.surface, h)
        factor, power = argument.as_independent(h, as_Add=False)
        base, exponent = power.as_base_exp()
        if base == h:
            found.add(sp.Abs(factor) ** (-1 / exponent))
    # Keep widths that depend on parameters only.
    found = {w for w in found if w.free_symbols <= set(model.parameters)}
    return (sp.Min(*found) if found else WIDTH) if atoms else None


@functools.lru_cache(maxsize=64)
def switched_by_events(model: Model) -> Model:
    """The model with its switches as memories, behind the others, and an event for each behind its own; behind these
    one for each of which conditions say what it is where its surface stays at 0.

    Raises
    ------
    ValueError
        A switch that can slide, a disc, a contact or an algebraic unknown: these need a multiplier that is solved for.
    """
    families = model.families
    if families is None or families.template.mirrors:  # what two neighbours tell of one surface is one event
        return _switched(model)
    template = families.template
    switched = _switched(template.model, tuple(e for *_, e in template.sums), of_elements=True)
    sums = tuple((s, family, _selecting(e)) for s, family, e in template.sums)
    of_switches = template.families("multipliers")
    at_rest = (f for f, mu in zip(of_switches, template.model.multipliers) if _said_at_zero(mu) is not None)
    family_of = {mu.surface: family for mu, family in zip(template.model.multipliers, of_switches)}
    for h, width in switched.smoothing:
        # A surface of all has one width, the least of all elements.
        of_elements = family_of[h] is None and width.free_symbols & template.place.keys()
        if of_elements or h.free_symbols & {s for s, *_ in sums}:
            return _switched(model)
    kept = zip(template.model.events, template.event_families)
    changed = replace(
        template, model=switched, sums=sums, output_families=(), levels=(),
        event_families=(*(f for e, f in kept if _watched(e)), *of_switches, *at_rest),
        layer_families=tuple(family_of[h] for h, _ in switched.smoothing),
    )  # fmt: skip
    return family_model(replace(families, template=changed))


def _watched(event: EventSpec) -> bool:
    """Implicit steps rest on a branch point by themselves."""
    return event.singular != "branch"


def _selecting(e: Any) -> Any:
    """An expression in which a memory selects, in the place of a switch."""
    return e.replace(Select, lambda lam, a, b: sp.Piecewise((a, lam > 0), (b, True), evaluate=False))


def _said_at_zero(mu: Any) -> sp.Expr | None:
    """The side of a switch whose surface stays at 0, as conditions say; None where they say none."""
    if isinstance(mu.at_zero, sp.Expr):
        return sp.Piecewise((1, above_at_zero(mu)), (-1, True))
    return sp.Integer(mu.at_zero) if mu.at_zero in (1, -1) else None


def _when(mu: Any, periodic: Periodic | None) -> dict[str, Any]:
    """When a switch crosses: at the instants of its clock, or at its surface."""
    return (
        {"surface": mu.surface} if periodic is None else {"every": periodic.period, "offset": periodic.offset}
    )


def _switched(model: Model, sums: tuple[sp.Expr, ...] = (), of_elements: bool = False) -> Model:
    """The same for a plain model, or for that of one element with the summands of its `sums`."""
    model = replace(model, outputs=(), events=tuple(filter(_watched, model.events)))
    for mu in model.multipliers:
        if mu.kind != "switch" or mu.regularity == "sliding":
            kinds = {"switch": "can slide (stick)", "disc": "is a disc", "contact": "is a contact"}
            what = f"{named(str(mu.symbol), 0)} {kinds.get(mu.kind, 'is an algebraic unknown')}"
            raise ValueError(
                f"`method` is 'stiff', but {what}; stiff steps know switches that the motion only passes. Use 'auto', "
                "or the smoothed view."
            )
    first, periodic = len(model.states), {} if of_elements else periodic_switches(model)
    events = tuple(
        replace(
            EventSpec(str(mu.symbol), update=((first + j, -mu.symbol),)), **_when(mu, periodic.get(mu.symbol))
        )
        for j, mu in enumerate(model.multipliers)
    )
    at_rest = tuple(
        EventSpec(f"{mu.symbol} at rest", update=((first + j, _selecting(side)),))
        for j, mu in enumerate(model.multipliers)
        if (side := _said_at_zero(mu)) is not None
    )
    widths = [strip(mu, model, sums) for mu in model.multipliers]

    def selected(event: EventSpec) -> EventSpec:
        return replace(
            event,
            surface=None if event.surface is None else _selecting(event.surface),
            when=_selecting(event.when),
            update=tuple((i, _selecting(value)) for i, value in event.update),
        )

    return replace(
        model,
        states=(*model.states, *(mu.symbol for mu in model.multipliers)),
        rhs=(*map(_selecting, model.rhs), *(sp.Integer(0) for _ in events)),
        multipliers=(),
        events=(*map(selected, (*model.events, *events)), *at_rest),
        smoothing=tuple(
            (mu.surface, width) for mu, width in zip(model.multipliers, widths) if width is not None
        ),
        n_memory=model.n_memory + len(events),
        eps_ratio=(),
        layer_states=(),
        layer_residuals=(),
    )


def why_not(model: Model, call: Call) -> str:
    """Where implicit steps are not asked for.

    Raises
    ------
    ValueError
        What no run by them has.
    """
    if call.options.method != "stiff":
        return "`method` is not 'stiff'"
    explicit_alone(call.options)
    if call.random is not None:
        raise ValueError("`noise` is given with method='stiff', which knows none; leave `method` out.")
    switched_by_events(model)
    return ""


def run(call: Call) -> Solution:
    """The Solution of a system whose switches never slide."""
    system, start, times, options = call.system, np.array(call.start), call.times, call.options
    model, p = system.model, np.array(system.parameter_values, float)
    if not call.continues:
        require_none_at_start(model, system.parameters, call.span[0], "method='stiff'")
    n, m = len(model.states), len(model.multipliers)
    view = switched_by_events(model)
    rtol, atol = min(options.rtol, LOOSEST), options.absolute(model)
    dense = options.dense or call.wanted is not None  # derivatives go along the steps' polynomials
    # The event-driven kernels decide the side of a start on a surface: they know all its derivatives.
    first_step = options._replace(method="auto", dense=False, max_steps=1)
    begun = prepared_run(model, first_step).solve(system, p, *call.span, start, None, Budget(), continues=True)
    moved = np.flatnonzero(begun.t > call.span[0])
    if not moved.size:
        return begun  # it stopped where it began, and says why

    at_rest = [j for j, mu in enumerate(model.multipliers) if _said_at_zero(mu) is not None]
    switches = len(view.events) - len(at_rest) - m  # the first of their events

    def words(i: int, before: np.ndarray) -> Words:
        if i < switches:
            return words_of(view, i)
        came = int(before[n + i - switches])
        return view.events[i].name, "crossing", f"{came:+d} to {-came:+d}"

    remembers, rests = np.full((2, len(view.events)), -1)
    remembers[switches : switches + m] = range(n, n + m)
    rests[[switches + j for j in at_rest]] = range(switches + m, len(view.events))
    steps = dict(
        rtol=rtol, atol=np.append(atol, np.ones(m)), max_step=options.max_step, t_eval=times, method="auto",
        dense=dense, kicks=None, remembers=remembers, at_rest=rests,
    )  # fmt: skip
    both = np.append(start, begun.mult[:, moved[0]])
    *pieces, ambiguities, columns = own(view, call.span, both, p, steps, call.budget(), words)
    t, x, events, polynomials, outcome, cost = pieces
    tolerances = {"rtol": rtol, "atol": float(atol.max(initial=0.0)), "method": "stiff"}

    def solution(t: np.ndarray, x: np.ndarray, course: Any = None) -> Solution:
        return Solution(
            system, t, x[:n], x[n:], x[n:].astype(np.int8), events, polynomials and replace(polynomials, n=n),
            outcome, cost, tolerances, ambiguities, system.parameters, course,
        )  # fmt: skip

    if times is None:
        return solution(t, x)
    found = solution(t, x, course(columns[0], columns[1][n:]))
    found.whole = solution(*columns)
    return found
