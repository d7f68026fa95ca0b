"""Whether a cycle is born where a planar equilibrium comes to a sliding surface: what the local motion says.

    h > 0:  x' = N (x - x_e),  C x_e = d;    h < 0:  x' = E + ...,  C E = e;    on h = 0:  x' = f - (C f/C E) E

N is the Jacobian of the regular side and E the field of the other one, at the point; to leading order the motion near
it scales with the distance d. For e > 0 the surface attracts where C f < 0. Around an unstable focus that is
admissible (d > 0) the motion leaves the surface at the fold T, where C f = 0, turns once around the focus and lands at
L. If it then slides to T, past no pseudo-equilibrium, that is a cycle, which attracts: it sticks. For e < 0 time is
reversed: a stable focus, and a cycle that repels.

Source: Yu. Kuznetsov, S. Rinaldi, A. Gragnani, One-parameter bifurcations in planar Filippov systems, Int. J.
Bifurcation Chaos 13 (2003) 2157-2188 (boundary foci BF1 to BF5).

Chain: equilibria.py -> **boundary_cycles** -> equilibrium_branches.py.
"""

from __future__ import annotations

import math

import numpy as np

from ...paths.derivatives.linearised import linearise
from .equilibrium import Equilibrium

_PLACES = 721  # of a turn around the focus, at which a return is looked for
_FEWEST = 1e-12


def cycle_born(e: Equilibrium, j: int) -> str | None:
    """ "attracting" or "repelling" where a cycle is born at a boundary equilibrium of switch j, "" where none is.

    None where that is not decided: of more or fewer than two states, a hidden term, a kink, a contact, several
    multipliers.
    """
    model = e.system.model
    mu = model.multipliers[j]
    planar = len(model.states) - model.n_memory == 2 and len(model.multipliers) == 1
    if not planar or mu.kind != "switch" or mu.regularity != "sliding" or mu.hidden or model.layer_states:
        return None
    side = float(e.sides[j] or np.sign(e.mult[j]))
    line, p = linearise(model), np.array(e.system.parameter_values, float)
    here, there = (np.array([side * s]) for s in (1, -1))
    at = (np.zeros(1), e.x[:, None])
    N = line.blocks(*at, here[:, None], p).f_w[0][:2, :2]
    E = line.blocks(*at, there[:, None], p).f[0][:2]
    C = side * line.gradient(mu.surface, 0.0, e.x, here, p)[0][:2]
    if abs(C @ E) <= _FEWEST * np.linalg.norm(C) * np.linalg.norm(E):
        return None
    if C @ E < 0:
        return "repelling" if _turns(-N, C, -E) else ""
    return "attracting" if _turns(N, C, E) else ""


def _turns(N: np.ndarray, C: np.ndarray, E: np.ndarray) -> bool:
    """Whether the motion from the fold comes back to it, of an equilibrium at C x_e = 1."""
    from scipy.linalg import expm
    from scipy.optimize import brentq

    mu = np.linalg.eigvals(N)
    if not (abs(mu[0].imag) > 0 and mu[0].real > 0):
        return False
    rest = C / (C @ C)
    along = np.array([-C[1], C[0]]) / np.linalg.norm(C)
    if abs(C @ N @ along) <= _FEWEST * np.abs(N).max():
        return False
    fold = (C @ N @ rest) / (C @ N @ along)  # C N (s along - rest) = 0
    start = fold * along - rest

    def height(t: float) -> float:
        return float(C @ expm(N * t) @ start) + 1.0

    times = np.linspace(0, 2 * math.pi / abs(mu[0].imag), _PLACES)
    heights = np.array([height(t) for t in times])
    down = np.flatnonzero((heights[1:-1] > 0) & (heights[2:] <= 0)) + 1
    if not down.size or heights[1] < 0:
        return False
    t = brentq(height, times[down[0]], times[down[0] + 1], xtol=1e-14)
    landed = float(along @ (expm(N * t) @ start + rest))

    def slide(s: float) -> float:
        f = N @ (s * along - rest)
        return float(along @ (f - (C @ f) / (C @ E) * E))

    a, b = slide(landed), slide(fold)  # linear between
    return bool(a * (fold - landed) > 0 and b * (fold - landed) > 0)
