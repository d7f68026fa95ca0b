"""What holds a motion on a surface, and the model in which it is held whatever that takes, or let through.

    c = max of s dh/dt over lambda in [-1, 1]       held from the side s while c >= 0, to the fold of hidden terms

    held      g = 0 with g = dh/dt, whatever lambda; of hidden terms f - r g with r = f_lambda/g_lambda, which knows no
              lambda: what lambda does is one force
    caught    f(s) - r g(s) (1 - s lambda)               what comes from s is held from then on, with lambda = 0
    passed    f(1) (1 + lambda)/2 + f(-1) (1 - lambda)/2   Filippov's: nothing is held that one side lets go

Near c = 0 the exact motion jumps, or has a square root; in these models it is smooth, and beside it the same.

Source: A. F. Filippov, Differential Equations with Discontinuous Righthand Sides (1988), for the last one.

Chain: parts.py -> **holding** -> windows.py, tangencies.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import Model, Multiplier
from ...definition.regularity import total_derivative
from .parts import function_of, rewritten, speed_of

_LAYER = 201  # places in [-1, 1] at which a layer is looked at
_NEWTON = 4  # steps from there to its extreme


def index_of(model: Model, name: str) -> int:
    return next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == name)


@functools.lru_cache(maxsize=64)
def held(model: Model, name: str) -> Model:
    """The model whose motion stays on the surface of this name: lambda has no bounds, a hidden one no effect."""
    j = index_of(model, name)
    mu = model.multipliers[j]
    lam, g = mu.symbol, mu.condition
    if not mu.hidden:
        return _with_own(model, j, Multiplier(lam, "algebraic", g))
    off = _off(model, j)
    there = _with(model, lambda e: (e - off(e) * g).subs(lam, 0) if e.has(lam) else e)
    return _with_own(there, j, Multiplier(lam, "algebraic", lam))


@functools.lru_cache(maxsize=64)
def caught(model: Model, name: str, side: int) -> Model:
    """The model that holds what comes to the surface from a side."""
    j = index_of(model, name)
    lam, g, off = model.multipliers[j].symbol, model.multipliers[j].condition, _off(model, j)

    def force(e: sp.Expr) -> sp.Expr:
        return e.subs(lam, side) - off(e) * g.subs(lam, side) * (1 - side * lam) if e.has(lam) else e

    return _linear(_with(model, force), j)


@functools.lru_cache(maxsize=64)
def passed(model: Model, name: str) -> Model:
    """The model without what is nonlinear in lambda."""
    j = index_of(model, name)
    lam = model.multipliers[j].symbol

    def mean(e: sp.Expr) -> sp.Expr:
        return (e.subs(lam, 1) * (1 + lam) + e.subs(lam, -1) * (1 - lam)) / 2 if e.has(lam) else e

    return _linear(_with(model, mean), j)


def not_held(model: Model, name: str) -> str:
    """Why a motion that a switch holds is not described without its layer, in words; empty where it is."""
    if any(layer.ratio != sp.oo for layer in model.layer_states):
        return "whose layer has states of its own"
    try:
        held(model, name)
    except ValueError:
        return "whose multiplier acts as more than one force"
    return ""


def _off(model: Model, j: int) -> Callable[[sp.Expr], sp.Expr]:
    """r of an expression: how it changes with the force that changes dh/dt by 1."""
    mu = model.multipliers[j]

    @functools.cache
    def off(e: sp.Expr) -> sp.Expr:
        r = sp.cancel(e.diff(mu.symbol) / mu.condition.diff(mu.symbol))
        r = sp.simplify(r) if r.has(mu.symbol) else r
        if r.has(mu.symbol):
            raise ValueError(f"{mu.symbol} acts as more than one force: {e} and {mu.condition} differ in how")
        return r

    return off


def _with(model: Model, change: Callable[[sp.Expr], sp.Expr]) -> Model:
    """The model with other expressions in the place of those that a multiplier enters; slaved states are in them."""
    return rewritten(replace(model, outputs=(), layer_states=(), layer_residuals=(), eps_ratio=()), change)


def _linear(model: Model, j: int) -> Model:
    return _with_own(model, j, replace(model.multipliers[j], hidden=False))


def _with_own(model: Model, j: int, own: Multiplier) -> Model:
    return replace(model, multipliers=(*model.multipliers[:j], own, *model.multipliers[j + 1 :]))


@functools.lru_cache(maxsize=64)
def strength_of(model: Model, name: str, side: int) -> Strength:
    """That of a switch and a side, whose functions are made once for each model that it is looked at along."""
    return Strength(model, name, side)


class Strength:
    """c of a switch and a side: how much more the layer could hold against what lets go to the other side."""

    def __init__(self, model: Model, name: str, side: int) -> None:
        self.j, self.side = index_of(model, name), side
        self.hidden = model.multipliers[self.j].hidden
        self.lam = model.multipliers[self.j].symbol
        self.there = sp.Dummy(real=True)
        self.rates: dict[Model, Any] = {}
        self.known: dict[Model, tuple[Any, Any, Any]] = {}
        self.expression = side * total_derivative(
            model.multipliers[self.j].surface, model.time, model.states, model.rhs
        )

    def level(self, model: Model, t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> np.ndarray:
        """The multipliers (m, nt) with that of the switch where s dh/dt is largest; of any model of these states."""
        value, *slopes = self._functions(model)
        if not self.hidden:
            found = np.array(mult, float)
            found[self.j] = np.where(slopes[0](t, x, found, p) >= 0, 1.0, -1.0)
            return found
        lam = np.linspace(-1.0, 1.0, _LAYER)
        times = np.repeat(t, _LAYER)
        many = np.repeat(mult, _LAYER, axis=1)
        many[self.j] = np.tile(lam, len(t))
        values = value(times, np.repeat(x, _LAYER, axis=1), many, p).reshape(len(t), _LAYER)
        found = np.array(mult, float)
        best = np.argmax(values, axis=1)
        found[self.j] = lam[best]
        inside = (best > 0) & (best < _LAYER - 1)
        for _ in range(_NEWTON if inside.any() else 0):
            first, second = (slope(t, x, found, p) for slope in slopes)
            with np.errstate(all="ignore"):
                move = np.where(inside & (second < 0), -first / second, 0.0)
            found[self.j] = np.clip(found[self.j] + np.clip(move, -1 / _LAYER, 1 / _LAYER), -1.0, 1.0)
        return found

    def folds(self, model: Model, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> int:
        """How many largest values there are beside the ends of the layer."""
        lam = np.linspace(-1.0, 1.0, _LAYER)
        many = np.tile(mult[:, None], (1, _LAYER))
        many[self.j] = lam
        values = self._functions(model)[0](np.full(_LAYER, t), np.tile(x[:, None], (1, _LAYER)), many, p)
        inner = values[1:-1]
        return int(np.sum((inner > values[:-2]) & (inner >= values[2:])))

    def functions(self, model: Model) -> tuple[Any, Any]:
        """c and its rate along the motion, of (t, x, mult, p), whatever lambda is in `mult`."""
        value, rate = self._functions(model)[0], self._rate(model)

        def speed(t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> np.ndarray:
            return rate(t, x, mult, [*p, self.level(model, t, x, mult, p)[self.j]])

        return lambda t, x, mult, p: value(t, x, self.level(model, t, x, mult, p), p), speed

    def _rate(self, model: Model) -> Any:
        """dc/dt: that of s dh/dt at a lambda which stays where that is largest, while the motion has its own."""
        if model not in self.rates:
            wider = replace(model, parameters=(*model.parameters, self.there))
            e = self.expression.xreplace({self.lam: self.there})
            self.rates[model] = function_of(wider, speed_of(wider, e))
        return self.rates[model]

    def _functions(self, model: Model) -> tuple[Any, Any, Any]:
        if model not in self.known:
            e = self.expression
            slope = e.diff(self.lam)
            each = (function_of(model, one) for one in (e, slope, slope.diff(self.lam)))
            self.known[model] = tuple(each)  # type: ignore[assignment]
        return self.known[model]
