"""When the events of time happen: one list of instants, which both loops work off.

Switches of periodic functions of time stand in it too: sin(a t + b) vanishes at (k pi - b)/a, so that Mod(t, T) jumps
just where the clock of `every=T` strikes.
Chain: Model -> **this file** -> event_driven.py, stiff_steps.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import sympy as sp

from ..definition.model import EventSpec, Model, Table
from ..definition.pointwise import value
from .budget import MOST_STEPS

_ROUNDINGS = 4  # of a time: what is no further apart is one instant


class Periodic(NamedTuple):
    """A switch that crosses at offset + k period, and nowhere else; both are of parameters alone."""

    surface: sp.Expr
    time: sp.Symbol
    period: sp.Expr
    offset: sp.Expr

    def instants(
        self, values: Mapping[sp.Symbol, float], t0: float, t1: float, most: int
    ) -> tuple[np.ndarray, int]:
        """The first `most` instants in (t0, t1] and the side just behind t0; side 0 where it never crosses."""
        period, offset = abs(value(self.period, values)), value(self.offset, values)
        if not (0 < period < np.inf and np.isfinite(offset)):
            return np.empty(0), 0
        first = np.floor((t0 - offset) / period) - 1
        last = min(np.floor((t1 - offset) / period) + 1, first + min(most, MOST_STEPS) + 3)
        knots = offset + period * np.arange(first, last + 1)
        ahead = np.searchsorted(knots, t0 + _ROUNDINGS * np.spacing(max(abs(t0), abs(offset))), side="right")
        begun = offset + period * (first + ahead - 0.5)
        side = 1 if value(self.surface, {**values, self.time: begun}) > 0 else -1
        return _up_to(knots[ahead:], t1), side


def periodic_switches(model: Model) -> dict[sp.Symbol, Periodic]:
    """The switches whose surface is the sine or cosine of a line in time, by their multipliers."""
    found, fixed = {}, set(model.parameters)
    for mu in model.multipliers:
        if mu.kind != "switch" or mu.regularity == "sliding" or mu.second is not None:
            continue
        wave = mu.surface.as_coeff_Mul()[1]
        if not isinstance(wave, (sp.sin, sp.cos)) or not mu.surface.has(model.time):
            continue
        rate, phase = wave.args[0].diff(model.time), wave.args[0].subs(model.time, 0)
        if (rate.free_symbols | phase.free_symbols) <= fixed:
            quarter = sp.pi / 2 if isinstance(wave, sp.cos) else 0
            found[mu.symbol] = Periodic(mu.surface, model.time, sp.pi / rate, (quarter - phase) / rate)
    return found


def _is_at(when: np.ndarray, t0: float) -> np.ndarray:
    return np.abs(when - t0) <= _ROUNDINGS * np.spacing(abs(t0))


def _acts_at_start(event: EventSpec) -> bool:
    """Whether an instant of this event that is the start of a run belongs to it: not of drives and controls."""
    return bool(event.at) and not event.tables and event.recorded


def given_for(model: Model, values: Mapping[sp.Symbol, float], t0: float) -> str | None:
    """An event among whose given instants t0 is, or None."""
    for event in model.events:
        if _acts_at_start(event) and _is_at(np.array([value(at, values) for at in event.at]), t0).any():
            return event.name
    return None


def require_none_at_start(model: Model, values: Mapping[sp.Symbol, float], t0: float, what: str) -> None:
    """Refuses an event that is given for the start of a run, for `what` begins behind it."""
    if (name := given_for(model, values, t0)) is not None:
        raise ValueError(
            f"event {name!r} happens at the start t = {t0:g} of the run, where {what} lets none act; give the state "
            "behind it as `x0`, and leave this instant out of `at`."
        )


def _up_to(when: np.ndarray, t1: float) -> np.ndarray:
    """Those of sorted instants that are not behind t1 but for a rounding."""
    return np.minimum(when[when <= t1 + _ROUNDINGS * np.spacing(abs(t1))], t1)


def instants_of_time(
    model: Model,
    values: Mapping[sp.Symbol, float],
    t0: float,
    t1: float,
    most: int,
    switches: Sequence[tuple[Periodic, np.ndarray]] = (),
    begins: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sorted instants of the time events in (t0, t1], and the event of each; of each event the first `most`.

    Where a run `begins` at t0 and continues no other, instants that are given (`at`) may be t0 itself.

    Behind the events the multipliers of `switches` are owners as well; last their sides at t0, with 0 for others.
    """
    instants, owners = [np.empty(0)], [np.empty(0, np.int64)]
    sides = np.zeros(len(model.multipliers) if switches else 0, np.int64)
    for periodic, which in switches:
        when, side = periodic.instants(values, t0, t1, most)
        sides[which] = side
        for j in which.tolist() if side else ():
            instants.append(when)
            owners.append(np.full(len(when), len(model.events) + j))
    if all(event.every is None and not event.at for event in model.events) and len(instants) == 1:
        return instants[0], owners[0], sides
    for i, event in enumerate(model.events):
        when = np.array([value(at, values) for at in event.at if not isinstance(at, Table)])
        begin = t0
        if begins and _acts_at_start(event):
            when[_is_at(when, t0)] = t0
            begin = np.nextafter(t0, -np.inf)
        for table in event.tables:
            table.check(t0, t1)
            when = table.instants
        if event.offset is not None:
            when = Periodic(sp.S.One, model.time, event.every, event.offset).instants(values, t0, t1, most)[0]
        elif event.every is not None:
            every = value(event.every, values)
            if not every > 0:
                raise ValueError(f"Event {event.name!r}: `every` is {every:g}; give a period > 0.")
            # Every instant costs a step: beyond the bound on steps none is reached.
            first = np.floor(t0 / every)
            when = every * np.arange(
                first, min(np.floor(t1 / every) + 1, first + min(most, MOST_STEPS) + 2) + 1
            )
            begin = t0 + _ROUNDINGS * np.spacing(abs(t0))
            when = _up_to(when, t1)
        when = when[(when > begin) & (when <= t1)]
        if not (np.diff(when) > 0).all():  # what `every` gives is in order already
            when = np.unique(when)
        instants.append(when)
        owners.append(np.full(len(when), i))
    when, which = np.concatenate(instants), np.concatenate(owners)
    if not (np.diff(when) > 0).all():
        order = np.argsort(when, kind="stable")
        when, which = when[order], which[order]
    # 3*0.1 and 0.3 are one instant; several roundings apart they are two.
    near = np.diff(when) <= _ROUNDINGS * np.spacing(np.abs(when[1:]))
    if near.any():
        merged = np.maximum.accumulate(np.where(np.append(False, near), 0, np.arange(len(when))))
        when = when[merged]
    return when, which, sides


def slopes_of_instants(
    model: Model, values: Mapping[sp.Symbol, float], instants: np.ndarray, owners: np.ndarray, symbol: sp.Symbol
) -> np.ndarray:
    """d(instant)/d(parameter) of the time events at these instants, as `instants_of_time` gives them."""
    slopes = np.zeros(len(instants))
    for i, event in enumerate(model.events):
        own = owners == i
        if not own.any():
            continue
        when = instants[own]
        if event.every is not None and symbol in event.every.free_symbols:
            slopes[own] = when * value(event.every.diff(symbol) / event.every, values)
        for at in event.at:
            if not isinstance(at, Table) and symbol in at.free_symbols:
                here = own & np.isclose(instants, value(at, values), rtol=1e-14, atol=0.0)
                slopes[here] = value(at.diff(symbol), values)
    return slopes
