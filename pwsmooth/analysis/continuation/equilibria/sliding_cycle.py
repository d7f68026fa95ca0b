"""The cycle that is born where a planar focus comes to a sliding surface, a little beside that point.

    x_e + (x_e - x_b)  ->  some turns  ->  its returns to the line through x_e(q) across x_e - x_b

x_b is the boundary equilibrium and x_e the focus at another parameter value q, which moves away from it in proportion.

Chain: boundary_cycles.py, orbits/finding.py -> **sliding_cycle** -> diagrams.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...equilibria.finding import find_equilibrium
from ...maps.sections import poincare_map
from ...maps.seen import Return
from ...orbits.finding import find_orbit
from ...orbits.periodic_orbit import PeriodicOrbit, none_found
from ..special import Special

_TURNS = 20  # before Newton's method
_FARTHEST = 100.0  # times the distance of the focus: a larger orbit is another one


def cycle_beside(born: Special, offset: float, **options: Any) -> PeriodicOrbit:
    """The attracting cycle of a boundary equilibrium, at `offset` from it in the parameter, to whichever side."""
    e, (mu,), (name, *_) = born.point, born.point.system.model.multipliers, born.values
    side = e.sides[0] or int(np.sign(e.mult[0]))
    q = next(p for p in e.system.parameters if p.name == name)
    for value in (born.parameter + offset, born.parameter - offset):
        try:
            system = e.system.with_parameters({q: value})
        except ValueError:  # outside the assumptions of the parameter
            continue
        focus = find_equilibrium(system, e.x0, sides={mu.symbol: side})
        if not focus.success or focus.border or focus.stability != "unstable":
            continue
        ahead = focus.x - e.x
        moves = [
            float(x) + (q - born.parameter) * float(d / (value - born.parameter)) for x, d in zip(e.x, ahead)
        ]
        section = sp.Add(
            *(float(d) * (s - x) for d, s, x in zip(ahead / np.abs(ahead).max(), system.states, moves))
        )
        orbit = find_orbit(system, (focus.x + ahead).tolist(), Return(section), transient=_TURNS, **options)
        if orbit.success and np.abs(orbit.x - focus.x).max() < _FARTHEST * np.abs(ahead).max():
            return orbit
    nothing = poincare_map(e.system, Return(system.states[0]), options)
    return none_found(nothing, e.x, "no cycle was found at this distance from the boundary equilibrium.")
