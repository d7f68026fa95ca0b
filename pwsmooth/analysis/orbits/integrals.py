"""What the motion keeps beside an orbit: first integrals and constraints, whose multipliers are 1.

    I(P(x)) = I(x)                  grad I is a left eigenvector of D P, with the multiplier 1
    J(P(x)) = J(x) + c I(x)         as with a constraint J whose rate is kept: 1 once more

Looked for are linear and quadratic ones, by returns from starts beside the orbit: lengths of rods (a constraint that
LagrangesMethod keeps by its second derivative), momenta, sliders that never slip. D P has their multipliers to the
root of its roundings only, so they are taken out of it; the others are those of D P where all of them stay.

Chain: periodic_orbit.py, fixed_points.py -> **integrals** -> finding.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fixed_points import onto_section
from .periodic_orbit import PeriodicOrbit

_NEAR_ONE = 1e-4  # a multiplier that may be 1
_BESIDE = 1e-2  # of how far a state moves: starts beside the orbit
_KEPT = 1e-7  # of what starts differ by: so little a kept quantity changes
_MOST = 8  # states: of more, the starts are too many
_MORE = 6  # starts than there are monomials


def with_integrals(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with the gradients of what the motion keeps, if it has multipliers near 1 and keeps anything."""
    n, mu = len(orbit.x), orbit.map_multipliers
    if orbit.segments is not None or orbit.degenerate or n > _MOST or not (np.abs(mu - 1) <= _NEAR_ONE).any():
        return orbit
    assert orbit.moves is not None
    size = _BESIDE * np.where(orbit.moves > 0, orbit.moves, orbit.map.unit)
    count = n + n * (n + 1) // 2 + _MORE
    rng = np.random.default_rng(51)
    before, after = [], []
    for _ in range(count):
        start = onto_section(orbit.map, orbit.x + size * rng.uniform(-1, 1, n))
        image = orbit.map.image(start)
        if not image.success:
            return orbit
        before.append((start - orbit.x) / size)
        after.append((image.x - orbit.x) / size)
    old, new = _monomials(np.array(before)), _monomials(np.array(after))
    kept = _kernel(new - old)
    if not len(kept):
        return orbit
    values = old @ kept.T
    slow = _kernel(np.hstack([new - old, -values]))[:, : old.shape[1]]
    gradients = np.vstack([kept, slow])[:, :n]
    sizes, rows = np.linalg.svd(gradients)[1:]
    rank = int((sizes > 1e-3 * sizes.max(initial=0.0)).sum())
    if not rank or rank > int((np.abs(mu - 1) <= _NEAR_ONE).sum()):
        return orbit
    return replace(orbit, integrals=rows[:rank] / size)


def _monomials(q: np.ndarray) -> np.ndarray:
    """Those of degree 1 and 2 at points (number, n)."""
    first, second = np.triu_indices(q.shape[1])
    return np.hstack([q, q[:, first] * q[:, second]])


def _kernel(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal combinations of the columns that vanish, (k, columns)."""
    _, sizes, rows = np.linalg.svd(matrix)
    return rows[int((sizes > _KEPT * max(1.0, sizes.max(initial=0.0))).sum()) :]
