"""Outputs of a model with families: the template's expressions over arrays of elements, not n written-out ones.

    y_i = e(x, z_i, z_(i+1), kappa_i, S, ...),   S = sum over the elements

Chain: template.py, Solution -> family_outputs (here).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..definition.model import Model
from ..definition.template import Families, named


@functools.lru_cache(maxsize=64)
def names(families: Families) -> dict[str, tuple[int, int | None]]:
    """Name of every output -> (block, element or None)."""
    places: dict[str, tuple[int, int | None]] = {}
    for b, (name, _) in enumerate(families.template.model.outputs):
        family = families.template.output_families[b]
        for k in range(families.sizes[family]) if family is not None else [None]:
            places[named(name, k)] = b, k
    return places


def evaluate(
    model: Model,
    name: str,
    function: Callable[[tuple[sp.Symbol, ...], sp.Expr], Callable[..., Any]],
    t: np.ndarray,
    x: np.ndarray,
    mult: np.ndarray,
    p: Sequence[float],
) -> np.ndarray:
    """Values of an output, shape (nt,); `function(symbols, expression)` makes a numpy function."""
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
        return function(symbols, e)(*map(symbol, symbols))

    result = value(template.model.outputs[block][1])
    if k is None:
        return np.array(np.broadcast_to(result, t.shape), float)
    family = template.output_families[block]
    assert family is not None
    return np.broadcast_to(result, (families.sizes[family], len(t)))[k].astype(float)
