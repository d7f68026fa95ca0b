"""The layer of a switch at an instant of a solution: the field in which its multiplier moves there.

    lambda' = w Lambda'(u) g(lambda, z),   z' = r Q(lambda, z),   g = dh/dt on the surface h = 0, t and x frozen

Chain: Model -> layers (here) -> Solution.plot_layer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..definition.sigmoids import sigmoid
from ..door import checks
from .outputs import vectorised

_POINTS = 401  # of lambda from -1 to 1
_ROWS = 41  # of a fast state


@dataclass(frozen=True)
class Layer:
    """`g` over `lam`, (k,); with a state `z` as fast as the layer the speeds `dlam`, `dz` over both, (rows, k)."""

    switch: str
    time: float
    lam: np.ndarray
    g: np.ndarray
    before: float
    after: float
    state: str = ""
    z: np.ndarray | None = None
    dlam: np.ndarray | None = None
    dz: np.ndarray | None = None


def layer_of(solution: Any, switch: Any, t: float | None) -> Layer:
    """The layer of a switch at its event nearest to t, the first one without; ValueError where there is none."""
    model = solution.model
    if model.families is not None:
        raise ValueError(
            "the system has a family; the layer is drawn of systems whose elements are written out."
        )
    switches = {m.symbol.name: j for j, m in enumerate(model.multipliers) if m.kind == "switch"}
    met = [e.switch for e in solution.events if e.switch in switches]
    if not met:
        raise ValueError("no switch of this solution meets its surface: there is no layer to draw.")
    name = met[0] if switch is None else str(checks.key(switch, "`switch`"))
    if name not in met:
        raise ValueError(
            f"`switch` is {name!r}, which does not meet its surface in this solution; those that do are "
            f"{checks.listing(dict.fromkeys(met))}."
        )
    times = solution.event_times(switch=name)
    time = float(times[0] if t is None else times[np.argmin(np.abs(times - checks.number(t, "`t`")))])
    sides = np.flatnonzero(solution.t == time)
    if not sides.size:
        raise ValueError(
            f"the solution has no column at t = {time:.9g}, where {name} meets its surface; solve without `t_eval`."
        )
    j = switches[name]
    first, last = sides[[0, -1]]
    before, after = (float(solution.mult[j, column]) for column in (max(first - (first == last), 0), last))
    lam = np.linspace(-1, 1, _POINTS)
    fast = [s for s in model.layer_states if s.ratio != sp.oo]

    def over(expression: sp.Expr, lam: np.ndarray, z: Any = None) -> np.ndarray:
        free = {} if z is None else {fast[0].symbol: z}
        x, mult = solution.x[:, last], solution.mult[:, first]
        return field_over(model, expression, j, time, x, mult, solution.parameters, lam, free)

    g = over(model.multipliers[j].residual, lam)
    if len(fast) != 1:
        return Layer(name, time, lam, g, before, after)
    (state,) = fast
    rest = over(state.equilibrium, lam)
    margin = 0.2 * (np.ptp(rest) or 1.0)
    z = np.linspace(rest.min() - margin, rest.max() + margin, _ROWS)
    lams, zs = np.meshgrid(lam, z)
    slope = sigmoid(model.sigmoid).slope(model.multipliers[j].symbol)
    dlam = over(slope * model.layer_residuals[j], lams, zs)
    return Layer(
        name, time, lam, g, before, after, str(state.symbol), z, dlam, over(state.ratio * state.rate, lams, zs)
    )


def field_over(
    model: Any, expression: sp.Expr, j: int, time: float, x: Any, mult: Any, parameters: Any, lam: np.ndarray,
    free: Any = None,
) -> np.ndarray:  # fmt: skip
    """An expression of the model over multiplier j, all else as it is at one instant; shape of `lam`.

    `parameters`: name -> value; `free`: values of further symbols, over `lam` too.
    """
    at = [lam if i == j else value for i, value in enumerate(mult)]
    p = [parameters[str(s)] for s in model.parameters]
    free = free or {}
    found = vectorised(model, expression, tuple(free))(time, *x, *at, *p, *free.values())
    return np.array(np.broadcast_to(found, np.shape(lam)), float)
