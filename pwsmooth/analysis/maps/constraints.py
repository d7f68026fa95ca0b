"""Starts on the constraints of a mechanism: a map is made of the flow behind a projection onto them.

    P o Pi,   Pi(x) = x - R+ (c(x), 0),   R = (grad c, grad h),   D Pi = 1 - R+ (grad c, 0)

The flow keeps c, so that each of its levels has orbits of its own, with multipliers 1 across them: other lengths of a
rod. Behind the projection there are those of c = 0 alone, and the multipliers across are 0. The surface h of a section
is not left.

Chain: paths/derivatives/linearised.py -> **constraints** -> poincare.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...paths.derivatives.linearised import linearise

_STEPS, _THERE = 20, 1e-14  # of Newton's method, and of a state a change that is rounding
_REDUNDANT = 1e-9  # of the largest singular value of unit rows: a constraint that others imply


def on_constraints(
    system: Any, t: float, x: np.ndarray, normal: np.ndarray | None, chosen: tuple[sp.Symbol, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The projection of a state (n,), and its derivatives by the state (n, n) and by chosen parameters (n, k)."""
    model, n = system.model, len(x)
    line, p = linearise(model, chosen), np.array(system.parameter_values, float)
    mult = np.zeros((len(model.multipliers), 1))
    at = np.array(x, float)
    for _ in range(_STEPS):
        c, slopes = (part[0] for part in line.values(system._constraints, np.array([t]), at[:, None], mult, p))
        rows = slopes[:, :n] if normal is None else np.vstack([slopes[:, :n], normal])
        sizes = np.linalg.norm(rows, axis=1)
        sizes[sizes == 0] = 1.0
        back = np.linalg.pinv(rows / sizes[:, None], rcond=_REDUNDANT) / sizes
        back = back[:, : len(c)]
        step = back @ c
        if not np.isfinite(step).all() or np.all(np.abs(step) <= _THERE * np.abs(at).max()):
            break
        at = at - step
    return at, np.eye(n) - back @ slopes[:, :n], -back @ slopes[:, n:]
