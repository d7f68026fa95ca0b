"""Symmetries (x, t) -> (G x, t + T/2) of a driven system, given in words and checked against its field.

Chain: paths/derivatives/linearised.py -> **symmetry** -> sections.py (the half-period map).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import of_event
from ...definition.pointwise import value
from ...door import checks
from ...paths.derivatives.linearised import rates


def symmetry_matrix(system: Any, symmetry: Mapping[Any, Any], period: float) -> np.ndarray:
    """The matrix G (n, n) of a symmetry (x, t) -> (G x, t + T/2), checked against the field at random points.

    ValueError where it is not linear, not invertible, or no symmetry of the system.
    """
    states = system.model.states
    images = {x: x for x in states}
    named = {s.name: s for s in states}
    for key, image in checks.mapping(symmetry, "`symmetry`", "states to linear expressions").items():
        x = checks.lookup(key, states, "`symmetry`", "state")
        images[x] = checks.expression(image, f"`symmetry`, image of {x}", named)
    rows = [[sp.expand(images[x]).diff(y) for y in states] for x in states]
    if any(not e.is_number for row in rows for e in row) or any(
        images[x].subs(dict.fromkeys(states, 0)) != 0 for x in states
    ):
        raise ValueError(f"`symmetry` is {dict(symmetry)}; give linear expressions of states, as {{y: -y}}.")
    G = np.array(rows, float)
    if abs(np.linalg.det(G)) < 1e-12:
        raise ValueError(
            f"`symmetry` is {dict(symmetry)}, which is not invertible; give one image for each state."
        )
    worst = _asymmetry(system, G, period)
    if not worst < 1e-9:
        raise ValueError(
            f"`symmetry` is {dict(symmetry)}, but the system does not have it together with a shift of time by half "
            f"the period {period:g}: the fields differ by {worst:.2g}. Leave it out, or give another one."
        )
    return G


def turns_of(system: Any, angles: Mapping[Any, Any], surface: sp.Expr | None) -> tuple[float, ...]:
    """A turn of each state that is an angle, 0 of the others, (n,); `surface` is that of a section.

    Raises
    ------
    ValueError
        No state of that name, or the system or the section is another one after a turn.
    """
    model, turns = system.model, dict.fromkeys(system.model.states, 0.0)
    for key, turn in checks.mapping(angles, "`angles`", "states to their turns, as {x: 2*pi}").items():
        turns[checks.lookup(key, model.states, "`angles`", "state")] = checks.positive(turn, "`angles`")
    parts = [*model.rhs, *(part for event in model.events for part in of_event(event) if part is not None)]
    for mu in model.multipliers:
        parts += [part for part in (mu.residual, mu.surface) if part is not None]
    own = {k for event in model.events for k, _ in event.update}
    given: dict[Any, float] = dict(zip(model.parameters, system.parameter_values)) | system.parameters
    rng = np.random.default_rng(1)
    for k, (x, turn) in enumerate(turns.items()):
        read = [
            part for part in (*parts, surface) if turn and isinstance(part, sp.Expr) and x in part.free_symbols
        ]
        for part in read:
            for _ in range(8):
                point = given | {symbol: rng.normal() for symbol in part.free_symbols if symbol not in given}
                one, other = (value(part, point | {x: point[x] + far}) for far in (0.0, turn))
                if k in own or not abs(one - other) <= 1e-9 * (abs(one) + abs(other)):
                    what = f"the section {surface}" if part is surface else "the system"
                    raise ValueError(
                        f"`angles` has {x.name!r} with a turn of {turn:.9g}, but {what} is another one after it; give "
                        "a turn of all that reads the angle, or leave it out."
                    )
    return tuple(turns.values())


@functools.lru_cache(maxsize=64)
def repeats_in(system: Any, time: float) -> bool:
    """Whether the system is the same after this time: its clocks, and at random points all that reads the time."""
    model = system.model
    given: dict[Any, float] = dict(zip(model.parameters, system.parameter_values))
    parts: list[Any] = [*model.rhs, *model.layer_residuals]
    for mu in model.multipliers:
        parts += [mu.residual, mu.surface, *(mu.impact or ())]
    for layer in model.layer_states:
        parts += [layer.rate, layer.equilibrium]
    for event in model.events:
        if event.at:
            return False
        if event.every is not None:
            ticks = time / value(event.every, given)
            if abs(ticks - round(ticks)) > 1e-9 or round(ticks) < 1:
                return False
        parts += [part for part in of_event(event) if part is not event.every]
    timed = [part for part in parts if part is not None and model.time in part.free_symbols]
    if any(not isinstance(part, sp.Expr) for part in timed):
        return False
    rng = np.random.default_rng(0)
    for _ in range(8):
        t = rng.uniform(0, time)
        for part in timed:
            point = given | {symbol: rng.normal() for symbol in part.free_symbols if symbol not in given}
            one, other = (value(part, point | {model.time: at}) for at in (t, t + time))
            if not abs(one - other) <= 1e-9 * (abs(one) + abs(other)):
                return False
    return True


def _asymmetry(system: Any, G: np.ndarray, period: float) -> float:
    """Largest relative difference of G f(t, x) and f(t + T/2, G x) at random points off the surfaces."""
    model = system.model
    p = np.array(system.parameter_values, float)
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(8):
        t, x = rng.uniform(0, period), rng.normal(size=len(model.states))
        fields = []
        for time, at in ((t, x), (t + period / 2, G @ x)):
            point = {model.time: time, **dict(zip(model.states, at)), **dict(zip(model.parameters, p))}
            for mu in model.multipliers:
                # A closed contact or an algebraic unknown has no side: at 0 they take no part in the check.
                point[mu.symbol] = 0.0
                if mu.kind == "switch":
                    point[mu.symbol] = 1.0 if value(mu.surface, point) > 0 else -1.0
            mult = np.array([point[mu.symbol] for mu in model.multipliers])
            fields.append(rates(model, time, at, mult, p))
        difference = np.abs(G @ fields[0] - fields[1]).max(initial=0.0)
        worst = max(worst, difference / (1e-300 + np.abs(fields[1]).max(initial=0.0) + 1e-12))
    return float(worst)
