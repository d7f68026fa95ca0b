"""Systems of Python functions: forward, on the explicit pair, without what needs formulas.

Chain: solve -> **this file** -> event_driven.py.
"""

from __future__ import annotations

from ..definition.model import Model
from ..results.solution import Solution
from . import event_driven
from .call import Call


def why_not(model: Model, call: Call) -> str:
    """Where the system is written in symbols.

    Raises
    ------
    ValueError
        What needs formulas.
    """
    if not model.functions:
        return "the system is written in symbols"
    asked = {
        f"`method` is {call.options.method!r}": call.options.method not in ("auto", "rk"),
        "`noise` is given": call.noise is not None,
        "`by` is given": call.wanted is not None,
        "`t_span` decreases": call.span[0] > call.span[1],
        "`local` is True": call.local,
    }
    if refused := [what for what, so in asked.items() if so]:
        raise ValueError(
            f"{refused[0]} for a system of functions, which runs forward on the pair, method 'rk', without noise "
            "and derivatives; leave it out, or write the model in symbols."
        )
    return event_driven.why_not(model, call)


def run(call: Call) -> Solution:
    """The Solution, on the pair."""
    return event_driven.run(call)
