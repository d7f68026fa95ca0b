"""A disc in the equations of equilibria: it slips or is held, both without the quotient h/|h|.

    slip     h_i = r lambda_i,   lambda . lambda = 1      r is the speed of slip: < 0 against lambda, of a virtual one
    stick    h_i = 0,   lambda . lambda <= 1

Both are smooth at the border r = 0, lambda . lambda = 1 between them, where lambda still has its direction. In the
place of the disc's own multiplier stands r in slip and lambda . lambda in stick.

Chain: definition/discs.py, parts.py -> **disc_modes** -> equilibrium_stability.py, statics.py.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ...definition.discs import discs_of
from ...definition.model import Held, Model, Multiplier
from ..maps.parts import rewritten

Sides = tuple[int, ...]


def places(model: Model) -> list[tuple[int, list[int]]]:
    """Of every disc the index of its own multiplier and those of its components."""
    index = {mu.symbol: j for j, mu in enumerate(model.multipliers)}
    return [(index[own.symbol], [index[mu.symbol] for mu in parts]) for own, *parts in discs_of(model)]


def unknowns(model: Model, sides: Sides) -> list[int]:
    """The multipliers that are solved for in a mode: those held, and all of a disc."""
    kinds = "disc", "component"
    return [j for j, side in enumerate(sides) if side == 0 or model.multipliers[j].kind in kinds]


def held(model: Model, sides: Sides) -> list[int]:
    """The switches held on their surfaces, and the components of the discs that are."""
    found = [j for j, mu in enumerate(model.multipliers) if mu.kind == "switch" and sides[j] == 0]
    return found + [c for own, parts in places(model) if sides[own] == 0 for c in parts]


def idle(model: Model) -> list[int]:
    """Components that act through |h| alone: at h = 0 they may have any direction."""
    return [c for own, parts in places(model) if model.multipliers[own].regularity == "kink" for c in parts]


def in_mode(model: Model, sides: Sides) -> Model:
    """The model in a mode of its discs; the model itself where it has none."""
    slips = tuple(sides[own] == 1 for own, _ in places(model))
    return _in_mode(model, slips) if slips else model


@functools.lru_cache(maxsize=64)
def _in_mode(model: Model, slips: tuple[bool, ...]) -> Model:
    discs = discs_of(model)
    own = {disc.symbol for disc, *_ in discs}
    sizes = {}  # of |h|^2 what |h| is: r, and in stick what vanishes there as smoothly
    for (disc, *parts), slip in zip(discs, slips, strict=True):
        sizes[disc.surface] = disc.symbol if slip else sp.Add(*(mu.symbol * mu.surface for mu in parts))

    def freed(e: sp.Basic) -> sp.Basic:
        e = e.replace(lambda a: isinstance(a, Held) and a.args[0] in own, lambda a: a.args[2])
        for square, size in sizes.items():
            e = e.replace(
                lambda a, s=square: a.is_Pow and a.exp.is_Rational and a.exp.q == 2 and sp.expand(a.base - s) == 0,
                lambda a, size=size: size ** (2 * a.exp),
            )  # fmt: skip
        return e

    model = rewritten(model, freed)
    solved: dict[sp.Symbol, Multiplier] = {}
    for (disc, *parts), slip in zip(discs, slips, strict=True):
        r, square = disc.symbol, sp.Add(*(mu.symbol**2 for mu in parts))
        solved[r] = replace(disc, residual=square - 1 if slip else r - square, surface=None)
        for mu in parts if slip else ():
            assert mu.surface is not None
            solved[mu.symbol] = replace(mu, residual=mu.surface - r * mu.symbol, surface=None)
    return replace(model, multipliers=tuple(solved.get(mu.symbol, mu) for mu in model.multipliers))


def completed(line: Any, sides: Sides, x: np.ndarray, mult: np.ndarray, p: Any) -> np.ndarray:
    """The multipliers (m, K) at x (n, K) with r or lambda . lambda in the places of the discs' own."""
    discs = places(line.model)
    if not discs:
        return mult
    mult = mult.copy()
    mult[[own for own, _ in discs]] = 0.0
    h = line.constraints(np.zeros(mult.shape[1]), x, mult, p)[0].T
    for own, parts in discs:
        mult[own] = (mult[parts] * (h if sides[own] else mult)[parts]).sum(axis=0)
    return mult


def along_slip(
    line: Any, sides: Sides, x: np.ndarray, mult: np.ndarray, p: Any, against: Any = False
) -> np.ndarray:
    """The multipliers (m, K) with lambda = h/|h| of what slips, where |h| is not 0: a start for Newton's method.

    With -h/|h| where `against` (K,) says so, which leads to virtual ones.
    """
    mult = mult.copy()
    for own, parts in places(line.model):
        if sides[own]:
            mult[own] = 0.0
            h = line.constraints(np.zeros(mult.shape[1]), x, mult, p)[0].T[parts]
            way = np.where((h != 0).any(axis=0), np.where(against, -h, h), mult[parts])
            size = np.linalg.norm(way, axis=0)
            mult[parts] = way / np.where(size > 0, size, 1.0)
    return completed(line, sides, x, mult, p)
