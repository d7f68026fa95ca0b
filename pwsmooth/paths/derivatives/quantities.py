"""What a run is differentiated by, from the names of `solve(by=...)`.

Chain: **this file** -> call.py, derivatives.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import sympy as sp

from ...definition.model import Model
from ...door import checks

START_TIME = "t0"


class Quantities(NamedTuple):
    """What is differentiated by: columns of parameters, of initial values, and that of the start time."""

    names: tuple[str, ...]
    parameters: tuple[sp.Symbol | None, ...]  # of each its parameter, if it is one
    states: tuple[int | None, ...]  # of each the state whose initial value it is
    start_time: int | None


def quantities(system: Any, wanted: Any) -> Quantities:
    """The quantities of a model that these names stand for.

    Raises
    ------
    ValueError
        A name that is none, or twice.
    """
    what = "`by`"
    found = [getattr(name := checks.named(item), "name", name) for item in checks.several(wanted, what)]
    return _quantities(system.model, tuple(system.parameters), tuple(found))


@functools.lru_cache(maxsize=256)
def _quantities(model: Model, owned: tuple[sp.Symbol, ...], found: tuple[Any, ...]) -> Quantities:
    what, parameters = "`by`", {s.name: s for s in owned}
    states = {s.name: i for i, s in enumerate(model.states)}
    cells = {s for event in model.events if event.tables for s, _ in event.update}
    for name in found:
        if name == START_TIME or name in parameters:
            continue
        if name not in states:
            known = ", ".join((*parameters, *states, START_TIME))
            raise ValueError(
                f"{what} names {checks.shown(name)}, which has no derivative here: give parameters, states or memories "
                f"(their initial values) or {START_TIME!r}, of {known}. The time of an Event, a restitution, a level "
                "of a switch is one if it is written as a parameter."
            )
        if model.states[states[name]] in cells:
            raise ValueError(f"{what} names {name!r}, which counts the cells of a drive: it has no derivative.")
    if len(set(found)) < len(found):
        raise ValueError(f"{what} names something twice: {', '.join(found)}.")
    of_parameters = tuple(parameters.get(name) for name in found)
    of_states = tuple(None if p is not None else states.get(name) for name, p in zip(found, of_parameters))
    start = found.index(START_TIME) if START_TIME in found and START_TIME not in parameters else None
    return Quantities(found, of_parameters, of_states, start)
