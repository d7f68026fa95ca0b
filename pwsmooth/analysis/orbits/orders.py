"""An orbit that meets two surfaces at one instant: its multipliers by differences, in either order of the two.

    D P d = (P(x + h d) - P(x - h d))/(2 h),     P(x + h d) - P(x) = P(x) - P(x - h d) + o(h)

A deviation to one side meets one surface first, one to the other side the other. Where both go on alike there is one
derivative, which the tape of the orbit does not know. Where they do not, the map has a corner: no multipliers say
whether deviations die down.

Chain: periodic_orbit.py, fixed_points.py -> **orders** -> finding.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...paths.words import meets_several
from ..maps.sections import Section
from .fixed_points import onto_section
from .periodic_orbit import PeriodicOrbit

_STEP = 1e-6  # of the units of the states
_KNOWN = 1e-5  # to which multipliers by differences are known
_ALIKE = 1e-3  # of the change: what both sides differ by where the map has a derivative


def in_both_orders(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with the derivative that both orders have; where they differ, one that is said to have a corner."""
    if orbit.segments is not None or not meets_several(orbit.degenerate):
        return orbit
    map_, x, unit = orbit.map, orbit.x, orbit.map.unit
    basis = np.eye(len(x))
    if isinstance(map_, Section):
        basis = np.linalg.svd((map_.gradient(x) * unit)[None])[2][1:].T
    generic = np.random.default_rng(29).normal(size=(basis.shape[1], 2)) / np.sqrt(basis.shape[1])
    columns = []
    for d in np.hstack([basis, basis @ generic]).T:
        ends = [map_.image(onto_section(map_, x + side * _STEP * unit * d)) for side in (1, -1)]
        if not all(end.success for end in ends):
            return _with_corner(orbit)
        one, other = (side * (end.x - x) / (_STEP * unit) for side, end in zip((1, -1), ends))
        if np.abs(one - other).max() > _ALIKE * max(1.0, np.abs(one).max()):
            return _with_corner(orbit)
        columns.append((one + other) / 2)
    matrix = np.array(columns[: basis.shape[1]]).T
    if np.abs(matrix @ generic - np.array(columns[basis.shape[1] :]).T).max() > _ALIKE * max(
        1.0, np.abs(matrix).max()
    ):
        return _with_corner(orbit)
    jacobian = matrix @ basis.T * unit[:, None] / unit
    return replace(orbit, jacobian=jacobian, accuracy=_KNOWN)


def _with_corner(orbit: PeriodicOrbit) -> PeriodicOrbit:
    said = (
        " Two surfaces are met at one instant, and deviations go on differently in either order: its multipliers are "
        "those of one order, and it is not called stable."
    )
    return replace(orbit, message=orbit.message + said, corner=True)
