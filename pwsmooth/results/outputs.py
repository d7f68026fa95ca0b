"""Values of expressions along a run: numpy functions, with families over arrays of elements, not n written-out ones.

    y_i = e(x, z_i, z_(i+1), kappa_i, S, ...),   S = sum over the elements

Chain: Model, template.py -> outputs (here) -> Solution.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..definition.families.template import LINKED, Families, named
from ..definition.lambdified import numpy_function
from ..definition.model import Held, Model, Select


def vectorised(model: Model, expression: sp.Basic, further: tuple[sp.Symbol, ...] = ()) -> Any:
    """A numpy function of (t, *x, *mult, *p, *further) for an expression or a Tuple of them."""
    arguments = (model.time, *model.states, *(m.symbol for m in model.multipliers), *model.parameters, *further)
    return _function(arguments, expression, tuple((m.symbol, m.surface) for m in model.multipliers))


@functools.lru_cache(maxsize=256)
def _function(
    arguments: tuple[sp.Symbol, ...], expression: sp.Basic, surfaces: tuple[tuple[sp.Symbol, Any], ...] = ()
) -> Any:
    """A numpy function of the symbols; a Select picks its branch where its multiplier is exactly +-1."""
    surface = dict(surfaces)

    def piecewise(lam: sp.Expr, a: sp.Expr, b: sp.Expr) -> sp.Expr:
        return sp.Piecewise(
            (a, sp.Eq(lam, 1)), (b, sp.Eq(lam, -1)), (Select(lam, a, b).affine(surface.get(lam)), True)
        )

    def shown(lam: sp.Expr, apart: sp.Expr, held: sp.Expr) -> sp.Expr:
        # At the instant at which a slip begins from rest h/|h| is 0/0, and lambda what its components say.
        sizes = [p.base for p in apart.atoms(sp.Pow) if p.exp == -sp.S.Half]
        return sp.Piecewise((apart, sp.And(sp.Eq(sp.Abs(lam), 1), *(size > 0 for size in sizes))), (held, True))

    # Before the selections, some of which stand inside.
    expression = expression.replace(Held, shown)
    while expression.has(Select):
        # Innermost first, one level a pass: Selects nest in clips and in the elastoplastic law.
        expression = expression.replace(
            lambda e: isinstance(e, Select) and not any(a.has(Select) for a in e.args),
            lambda e: piecewise(*e.args),
        )
    return numpy_function(arguments, expression, cse=True)


@functools.lru_cache(maxsize=64)
def names(families: Families) -> dict[str, tuple[int, int | None]]:
    """Name of every output -> (block, element or None)."""
    places: dict[str, tuple[int, int | None]] = {}
    for b, (name, _) in enumerate(families.template.model.outputs):
        family = families.template.output_families[b]
        for k in range(families.sizes[family]) if family is not None else [None]:
            places[named(name, k)] = b, k
    return places


def of_family(
    model: Model,
    name: str,
    t: np.ndarray,
    x: np.ndarray,
    mult: np.ndarray,
    p: Sequence[float],
) -> np.ndarray:
    """Values of an output of a model with families, shape (nt,)."""
    families = model.families
    assert families is not None
    template = families.template
    block, k = names(families)[name]
    arrays = {"states": x, "multipliers": mult, "parameters": np.asarray(p, float)[:, None]}
    numbers: dict[sp.Symbol, tuple[str, int]] = {}
    for kind in arrays:
        for b, item in enumerate(getattr(template.model, kind)):
            numbers[item.symbol if kind == "multipliers" else item] = kind, b
    starts = {kind: families.starts(kind) for kind in arrays}
    sums = {s: (family, e) for s, family, e in template.sums}

    def member(s: sp.Symbol) -> np.ndarray:
        """The n values of a symbol of elements, shape (n, nt) or (n, 1)."""
        place = template.place[s]
        n = families.sizes[place.family]
        if place.base is None:
            return np.arange(1.0, n + 1)[:, None]
        kind, b = numbers[place.base]
        own = arrays[kind][starts[kind][b] : starts[kind][b] + n]
        if not place.offset:
            return own
        if place.offset >= LINKED:
            return own[families.links[place.family].rows[:, place.offset - LINKED].astype(int)]
        at = np.arange(n) + place.offset
        if template.periodic[place.family]:
            return own[at % n]
        inside = (at >= 0) & (at < n)
        assert place.outside is not None
        return np.where(inside[:, None], own[np.clip(at, 0, n - 1)], value(place.outside))

    def symbol(s: sp.Symbol) -> Any:
        if s == template.model.time:
            return t
        if s in sums:
            family, e = sums[s]
            return np.broadcast_to(value(e), (families.sizes[family], len(t))).sum(axis=0)
        if s in template.place:
            return member(s)
        kind, b = numbers[s]
        return arrays[kind][starts[kind][b]]

    def value(e: sp.Expr) -> Any:
        symbols = tuple(sorted(e.free_symbols, key=str))
        return _function(symbols, e)(*map(symbol, symbols))

    result = value(template.model.outputs[block][1])
    if k is None:
        return np.array(np.broadcast_to(result, t.shape), float)
    family = template.output_families[block]
    assert family is not None
    return np.broadcast_to(result, (families.sizes[family], len(t)))[k].astype(float)
