"""When the events of time happen: one list of instants, which both loops work off.

Chain: Model -> **this file** -> event_driven.py, stiff_steps.py.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp

from ..definition.model import Model, Table
from ..definition.pointwise import value
from .budget import MOST_STEPS


def instants_of_time(
    model: Model, values: Mapping[sp.Symbol, float], t0: float, t1: float, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sorted instants of the time events in (t0, t1], and the event of each; of each event the first `most`."""
    instants, owners = [np.empty(0)], [np.empty(0, np.int64)]
    if all(event.every is None and not event.at for event in model.events):
        return instants[0], owners[0]
    for i, event in enumerate(model.events):
        when = np.array([value(at, values) for at in event.at if not isinstance(at, Table)])
        for table in event.tables:
            table.check(t0, t1)
            when = table.instants
        if event.every is not None:
            every = value(event.every, values)
            if not every > 0:
                raise ValueError(f"Event {event.name!r}: `every` is {every:g}; give a period > 0.")
            # Every instant costs a step: beyond the bound on steps none is reached.
            first = np.floor(t0 / every)
            when = every * np.arange(
                first, min(np.floor(t1 / every) + 1, first + min(most, MOST_STEPS) + 2) + 1
            )
        when = when[(when > t0) & (when <= t1)]
        if not (np.diff(when) > 0).all():  # what `every` gives is in order already
            when = np.unique(when)
        instants.append(when)
        owners.append(np.full(len(when), i))
    when, which = np.concatenate(instants), np.concatenate(owners)
    if not (np.diff(when) > 0).all():
        order = np.argsort(when, kind="stable")
        when, which = when[order], which[order]
    # 3*0.1 and 0.3 are one instant; several roundings apart they are two.
    near = np.diff(when) <= 4 * np.spacing(np.abs(when[1:]))
    if near.any():
        merged = np.maximum.accumulate(np.where(np.append(False, near), 0, np.arange(len(when))))
        when = when[merged]
    return when, which


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
