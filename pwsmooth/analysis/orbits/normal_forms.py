"""The first coefficient of the flip's normal form: where it vanishes, the flip is degenerate.

    c = <w, C(v, v, v) + 3 B(v, (1 - A)^-1 B(v, v))>/6,    A v = -v,  w A = -w,  P = x + A d + B(d, d)/2 + C(d, d, d)/6

Second and third derivatives along v are differences of the exact first one, within the itinerary.

Source: Kuznetsov, Elements of Applied Bifurcation Theory, section 5.4 (over <w, v> there, 0 at a resonance 1:2).

Chain: poincare.py -> **normal_forms** -> conditions.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..maps.segments import sizes

# Of the states' size: fourth order leaves h^4, and D P has twelve digits, of which h^-2 takes.
_STEPS = (1e-2, 3e-3, 1e-3, 3e-4)
_NONE = 1e-8  # of the states: an orbit at rest at 0 has no size
_PLACES = (-2, -1, 1, 2)


def flip_coefficient(map_: Any, image: Any, x: np.ndarray, v: np.ndarray, w: np.ndarray) -> float:
    """c of a map at a fixed point with the multiplier -1; nan where its itinerary ends too near."""
    size = sizes(image.runs)
    unit = float(np.abs(v / (size if size.max() > _NONE else 1.0)).max())
    for step in _STEPS:
        h = step / unit
        around = [map_.image(x + k * h * v, ()) for k in _PLACES]
        if all(one.success and one.word == image.word for one in around):
            break
    else:
        return math.nan
    far, near, on, beyond = (one.jacobian for one in around)
    A = image.jacobian
    first = (far - 8 * near + 8 * on - beyond) / (12 * h)
    second = (-far + 16 * near - 30 * A + 16 * on - beyond) / (12 * h**2)
    bent = np.linalg.lstsq(np.eye(len(A)) - A, first @ v, rcond=1e-13)[0]
    return float(w @ (second @ v + 3 * first @ bent)) / 6
