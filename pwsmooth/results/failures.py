"""Runs that ended because something goes to infinity in finite time, or began behind a stop: what did, in words.

    |dx/dt| ulp(t) >> |x|:  over some spacings of numbers at this time a state would change by its own size

Chain: records (Outcome) -> **failures** -> Solution.message.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from .outputs import vectorised

_SPACINGS = 1e9  # of numbers at this time, in which the motion changes by its own size: no step resolves it
_GROWN = 1e3  # times the size at the start: a state, or its rate, has gone up


def blow_up_in_words(solution: Any) -> str:
    """Which state goes to infinity, or which rate; empty where neither does, or cannot be told."""
    model = solution.model
    if model.families is not None or getattr(model, "functions", None):
        return ""
    first, last = (-1, 0) if solution.backward else (0, -1)
    begin, end = (_rates(solution, column) for column in (first, last))
    n = len(end)
    x0, x = (np.abs(solution.x[:n, column]) for column in (first, last))
    t0, t = float(solution.t[first]), float(solution.t[last])
    spacing = np.spacing(abs(t) or 1.0)
    with np.errstate(all="ignore"):
        fast = ~(np.abs(end) * _SPACINGS * spacing < x)
        grown = fast & (x > _GROWN * np.maximum(x0, 1e-12))
        steeper = fast & ~(np.abs(end) < _GROWN * np.abs(begin))
    if grown.any():
        i = int(np.argmax(np.where(grown, x, 0.0)))
        what = f"{solution.states[i]} goes to infinity: it is {solution.x[i, last]:.3g} at t = {t:.9g}"
    elif not fast.any():
        return ""
    else:
        i = int(np.argmax(np.where(steeper if t != t0 else fast, np.abs(end), 0.0)))
        what = f"the rate of {solution.states[i]} is {end[i]:.3g} at t = {t:.9g}"
        if t == t0:
            return (
                f"{what}, where the run begins, too fast for any step: a singularity of the motion, or one that the "
                "parameters or the start make; look at these."
            )
        if not steeper.any():
            return ""
    return (
        f"{what}. The motion has a singularity there (a blow-up in finite time, or a pole), past which no option "
        "leads: look at the model, or let a terminal Event stop the run before."
    )


def gaps_in_words(solution: Any) -> str:
    """Which gaps are negative at the last instant."""
    model = solution.model
    if model.families is not None:
        return ""
    contacts = [mu for mu in model.multipliers if mu.kind == "contact"]
    gaps = _values(solution, -1, [mu.surface for mu in contacts])
    return ", ".join(
        f"the gap {mu.surface} of {mu.symbol} is {g:.6g}" for mu, g in zip(contacts, gaps) if g < 0
    )


def _rates(solution: Any, column: int) -> np.ndarray:
    return _values(solution, column, solution.model.rhs)


def _values(solution: Any, column: int, expressions: Any) -> np.ndarray:
    model = solution.model
    values = [solution.parameters[str(p)] for p in model.parameters]
    with np.errstate(all="ignore"):
        found = vectorised(model, sp.Tuple(*expressions))(
            solution.t[column], *solution.x[:, column], *solution.mult[:, column], *values
        )
    return np.array([float(np.ravel(part)[0]) for part in found])
