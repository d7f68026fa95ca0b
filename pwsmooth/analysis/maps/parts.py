"""Runs that are parts of an orbit, with their deviations, and functions of what stands on a surface along them.

Chain: paths/derivatives/tangents.py, first_order.py -> **parts** -> windows.py, impacts.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import Model
from ...definition.regularity import total_derivative
from ...paths.derivatives.linearised import rates
from ...results.outputs import vectorised
from ...results.solution import Solution
from .first_order import has_series, without_derivative

_EACH = 8  # places a step at which an extreme is looked for


@dataclass(frozen=True)
class Part:
    """A run with the deviations W (n, n + k) at its end, and at its instants (before, and of their times)."""

    run: Solution
    W: np.ndarray
    instant_t: np.ndarray
    instant_dt: np.ndarray
    instant_w: np.ndarray
    degenerate: tuple[str, ...]
    sample: np.ndarray


def part_of(
    run: Solution, chosen: Any, W: np.ndarray, seeds: np.ndarray, moves: tuple[np.ndarray, np.ndarray],
    times: np.ndarray | None = None,
) -> Part | None:  # fmt: skip
    """The deviations of a run, from W at its start, where start and end move with the columns by `moves`."""
    if not has_series(run):
        return None
    tape = run.tape
    start = W - np.outer(tape.first_rates(), moves[0])
    found = tape.deviations(start, seeds, times, points=False)
    total = found.end + np.outer(last_rates(run), moves[1])
    if not np.isnan(found.stopped):
        return None
    said = tuple(without_derivative(run, found.instant_t, found.instant_why))
    said += tuple(map(str, run.ambiguities))
    return Part(run, total, found.instant_t, found.instant_dt, found.instant_w, said, found.at_sample)


def seeds_of(model: Model, chosen: Any, first: int) -> np.ndarray:
    """Columns (np, first + k) of parameters behind `first` others."""
    seeds = np.zeros((len(model.parameters), first + len(chosen)))
    for column, symbol in enumerate(chosen, first):
        if symbol in model.parameters:
            seeds[model.parameters.index(symbol), column] = 1.0
    return seeds


def last_rates(run: Solution) -> np.ndarray:
    t, x, mult = run.tape.standing(-1)
    return rates(run.model, t, x, mult, run.tape.p)


@functools.lru_cache(maxsize=64)
def one_sided(model: Model, name: str, value: int) -> Model:
    """The model without the surface of this name, its multiplier at a value; without the event of this name."""
    for k, event in enumerate(model.events):
        if event.name == name and not any(str(mu.symbol) == name for mu in model.multipliers):
            return replace(model, events=model.events[:k] + model.events[k + 1 :])
    index = next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == name)
    fixed = {model.multipliers[index].symbol: sp.Integer(value)}
    there = rewritten(model, lambda e: e.xreplace(fixed))
    without = [j for j in range(len(model.multipliers)) if j != index]
    residuals, ratios = there.layer_residuals, there.eps_ratio
    return replace(
        there,
        multipliers=tuple(there.multipliers[j] for j in without),
        layer_residuals=tuple(residuals[j] for j in without) if residuals else (),
        eps_ratio=tuple(ratios[j] for j in without) if ratios else (),
    )


def rewritten(model: Model, change: Callable[[Any], Any]) -> Model:
    """The model with other expressions in the place of its own, but for the symbols of its multipliers."""

    def changed(part: Any) -> Any:
        if isinstance(part, sp.Basic):
            return change(part)
        if isinstance(part, tuple):
            return tuple(map(changed, part))
        return part

    def record(one: Any) -> Any:
        return replace(
            one, **{f.name: changed(getattr(one, f.name)) for f in fields(one) if f.name != "symbol"}
        )

    return replace(
        model,
        rhs=changed(model.rhs),
        multipliers=tuple(map(record, model.multipliers)),
        events=tuple(map(record, model.events)),
        outputs=changed(model.outputs),
        layer_states=tuple(map(record, model.layer_states)),
        layer_residuals=changed(model.layer_residuals),
    )


@functools.lru_cache(maxsize=64)
def with_ratio(model: Model, ratio: sp.Expr) -> Model:
    """The model whose layer has states of another ratio: slaved, or in two stages."""
    return replace(model, layer_states=tuple(replace(state, ratio=ratio) for state in model.layer_states))


def surface_of(model: Model, name: str) -> sp.Expr:
    found: list[Any] = [mu.surface for mu in model.multipliers if str(mu.symbol) == name]
    found += [event.surface for event in model.events if event.name == name]
    return found[0]


def minima(run: Solution, functions: tuple[Any, Any]) -> list[float]:
    """Times between events at which a function of (t, x, mult, p), given with its rate, has a minimum."""
    _, speed = functions
    knots = np.unique(np.concatenate([run.dense.t0, run.t[-1:]]))
    times = np.linspace(knots[:-1], knots[1:], _EACH, axis=1)
    times[:, -1] = np.nextafter(times[:, -1], times[:, 0])  # the step's own side of an event
    flat = times.ravel()
    x, mult = run.dense(flat)
    slopes = speed(flat, x, mult, run.tape.p).reshape(times.shape)
    rising = (slopes[:, :-1] < 0) & (slopes[:, 1:] >= 0)
    return [_zero_of(run, speed, times[i, k], times[i, k + 1]) for i, k in zip(*np.nonzero(rising))]


def _zero_of(run: Solution, speed: Any, low: float, high: float) -> float:
    from scipy.optimize import brentq

    def at(t: float) -> float:
        x, mult = run.dense(np.array([t]))
        return float(speed(np.array([t]), x, mult, run.tape.p)[0])

    return float(brentq(at, low, high, xtol=1e-15)) if at(low) * at(high) < 0 else float(high)


@functools.lru_cache(maxsize=64)
def functions_of(model: Model, surface: sp.Expr) -> tuple[Callable[..., Any], Callable[..., Any]]:
    return function_of(model, surface), function_of(model, speed_of(model, surface))


def speed_of(model: Model, h: sp.Expr) -> sp.Expr:
    """dh/dt, that of a multiplier in h from its own condition."""
    speed = total_derivative(h, model.time, model.states, model.rhs)
    for mu in model.multipliers:
        if mu.symbol in h.free_symbols:
            g = mu.condition
            along = total_derivative(g, model.time, model.states, model.rhs)
            speed = speed - h.diff(mu.symbol) * along / g.diff(mu.symbol)
    return speed


def function_of(model: Model, e: sp.Expr) -> Callable[..., Any]:
    function = vectorised(model, sp.Tuple(e))

    def evaluate(t: np.ndarray, x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.asarray(function(t, *x, *mult, *p)[0], float), t.shape)

    return evaluate
