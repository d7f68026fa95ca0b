"""Which families have events that are local, and what of an element that sticks stops their way.

Chain: template.py -> **this file** -> local.py.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import sympy as sp
from sympy.solvers.solveset import NonlinearError

from ..definition.families.template import Families, family_model
from ..definition.lambdified import numpy_function
from ..definition.model import Held, Model, Select
from ..kernels import state as names
from .problem import FEW, CompiledProblem, compiled_problem

LOCAL_FROM = 100  # elements: of fewer one loop over all is as fast
MANY = 1000  # elements, of more of which a run that is asked for no times keeps the ends alone


def why_global(model: Model) -> str:
    """What makes every event of a model one of the whole system; "" where it is one of a neighbourhood."""
    families = model.families
    if families is None:
        return "its elements are written out"
    template = families.template
    text = template.model
    if len(families.sizes) != 1:
        return "it has several families"
    moving = [*text.rhs]
    for holder in (*text.multipliers, *text.events):
        moving += [e for e in (holder.surface, getattr(holder, "residual", None)) if e is not None]
    for event in text.events:
        moving += [e for _, e in event.update] + ([event.when] if isinstance(event.when, sp.Basic) else [])
    used = set().union(*(e.free_symbols for e in moving))
    if used & {s for s, _, _ in template.sums}:
        return "a sum over the elements acts on them"
    for kind in ("states", "events"):
        if None in template.families(kind):
            return f"some of its {kind} belong to no element"
    for mu, family in zip(text.multipliers, template.families("multipliers"), strict=True):
        known = {text.time, *text.parameters}
        if family is None and not (mu.kind == "switch" and mu.surface.free_symbols <= known):
            return f"multiplier {mu.symbol} belongs to no element and does not switch at known times"
    for event in text.events:
        if event.tables or any(e.free_symbols & template.place.keys() for e in event.at):
            return "it has sampled drives, or instants that differ from element to element"
    states = set(text.states)
    used = set().union(*(e.free_symbols for e in moving))
    read = {template.place[s].base for s in used & template.beside}
    linked = {text.multipliers[b].symbol for b in template.linked}
    # What acts on two elements stands between them: they are renewed together.
    acts = {template.place[s].base for s in template.beside & set().union(*(e.free_symbols for e in text.rhs))}
    alone = {
        mu.symbol
        for mu in text.multipliers
        if mu.surface is None or not mu.surface.free_symbols & template.beside
    }
    if read - states - set(text.parameters) - linked or acts & alone:
        return "elements read the multipliers of others"
    return _why_not_by_series(few_elements(template))


def _why_not_by_series(parts: CompiledProblem) -> str:
    if not parts.has_jets or parts.singular:
        return "some function has no Taylor series everywhere"
    fixed = parts.fixed
    if fixed["watches"]:
        return "some function has a singular argument"
    if parts.fold is not None or fixed["discs"] or np.any(parts.kind == names.SECOND_ORDER):
        return "its switches have folds or slides of second order"
    return ""


def few_of(template: Any) -> Families:
    """A few elements: what is known of one of them holds for any number."""
    return Families(template, (FEW,))


@functools.lru_cache(maxsize=16)
def few_elements(template: Any) -> CompiledProblem:
    return compiled_problem(family_model(few_of(template)))


@functools.lru_cache(maxsize=16)
def walls(template: Any) -> bool:
    """Whether what others read of an element that sticks does not depend on its neighbours."""
    model = template.model
    sliding = [m for m in model.multipliers if m.kind == "switch" and m.regularity == "sliding"]
    if not sliding or template.felt or any(m.kind == "contact" for m in model.multipliers):
        return False
    beside = {s for s, p in template.places if p.base is not None and p.offset}
    solved = [m for m in model.multipliers if m.kind == "algebraic" or m in sliding]
    unknowns = [m.symbol for m in solved]
    # Solved multipliers are held; what is chosen may be any mixture.
    whole = [
        e.replace(Held, lambda lam, apart, held: held).replace(
            Select, lambda lam, a, b: (a + b) / 2 + lam * (a - b) / 2
        )
        for e in (*model.rhs, *(m.residual for m in solved))
    ]
    chosen = {e: sp.Add(*(sp.Dummy() * a for a, _ in e.args)) for r in whole for e in r.atoms(sp.Piecewise)}
    held = {}  # states that stand where the surfaces are met
    for h in (m.surface for m in sliding):
        of = (x for x in model.states if x in h.free_symbols and not h.diff(x).free_symbols & set(model.states))
        held |= {x: sp.expand(x - h / h.diff(x)) for x in list(of)[:1]}
    whole = [r.xreplace(chosen).subs(held) for r in whole]
    rhs, residuals = whole[: len(model.rhs)], whole[len(model.rhs) :]
    try:
        linear = sp.linear_eq_to_matrix(residuals, unknowns)
    except NonlinearError:
        return False
    # What depends on what is seen in numbers at a point that has nothing special: formulas take minutes to cancel.
    symbols = sorted(set().union(*(r.free_symbols for r in (*rhs, *residuals))) - set(unknowns), key=str)
    solve = numpy_function([symbols], sp.Tuple(*linear))
    rates = numpy_function([symbols, unknowns], sp.Tuple(*rhs))
    numbers = np.random.default_rng(0)

    def at(place: np.ndarray) -> np.ndarray:
        matrix, right = solve(place)
        return np.array(rates(place, np.linalg.solve(matrix, right)[:, 0]), float)

    for _ in range(
        20
    ):  # there are formulas for some numbers alone, such as those of a larger and a smaller force
        point = numbers.uniform(0.5, 1.5, len(symbols))
        try:
            with np.errstate(all="ignore"):
                base = at(point)
                moved = [at(point + 0.1 * unit) for unit in np.eye(len(symbols))]
        except np.linalg.LinAlgError:
            continue
        if np.isfinite([base, *moved]).all():
            break
    else:
        return False
    acts = ~(np.abs(np.array(moved) - base) <= 1e-9 * (1 + np.abs(base)))  # symbol, rate
    waiting, known = [p.base for _, p in template.places if p.offset and p.base in model.states], set()
    while waiting:
        x = waiting.pop()
        if x in known:
            continue
        known.add(x)
        free = {s for s, row in zip(symbols, acts, strict=True) if row[model.states.index(x)]}
        if free & beside:
            return False
        waiting += [s for s in free if s in model.states]
    return True
