"""Static friction of two levels (template.Level), shown as what it stands for: lambda in the place of sigma, and folds.

Chain: template.py -> **this file** -> problem.py, event_driven.py, local.py.
"""

from __future__ import annotations

import numpy as np

from ..definition.families.template import Families
from ..kernels import state as names

_LEAN = 2**16  # elements at a time: of millions what lies between takes much room


class Levels:
    """The levels of a model with families, at parameter values p; empty where it has none."""

    def __init__(self, families: Families | None, p: np.ndarray):
        self.families = families
        self.of_block: dict[
            int, list[np.ndarray]
        ] = {}  # q, the peak, and what slip has of it, of every element
        for level in families.template.levels if families else ():
            family = families.template.families("multipliers")[level.multiplier]
            wanted = level.q, level.peak, level.slip / level.peak
            self.of_block[level.multiplier] = [families.of_parameters(e, p, family) for e in wanted]

    def _rows(self, block: int) -> tuple[int, int]:
        """First multiplier of a block, and the end."""
        assert self.families is not None
        first = self.families.starts("multipliers")
        return first[block], first[block + 1]

    def shares(self, m: int) -> np.ndarray:
        """Of all m multipliers, the part of the largest static friction that slip has; 0 where there are no two."""
        found = np.zeros(m)
        for block, (*_, share) in self.of_block.items():
            first, end = self._rows(block)
            found[first:end] = share
        return found

    def show(self, mult: np.ndarray, status: np.ndarray) -> np.ndarray:
        """Overwrites sigma by lambda in multipliers, shape (m, nt), with these statuses."""
        for block in self.of_block:
            first, end = self._rows(block)
            for at in range(first, end, _LEAN):
                rows = np.arange(at, min(at + _LEAN, end))
                mult[rows] = self.lambdas(block, mult[rows], status[rows], rows - first)
        return mult

    def lambdas(self, block: int, sigma: np.ndarray, status: np.ndarray, elements: np.ndarray) -> np.ndarray:
        """Of some elements, a row each: lambda + q lambda^3 = peak sigma on the branch between the folds, by the triple
        angle."""
        q, peak = (values[elements, None] for values in self.of_block[block][:2])
        size = np.sqrt(1 / (3 * np.maximum(np.abs(q), 1e-300)))
        part = 1.5 * peak * sigma / size
        held = 2 * size * np.sin(np.arcsin(np.clip(part, -1.0, 1.0)) / 3)
        if (q >= 0).any():  # no fold at all
            held = np.where(q > 0, 2 * size * np.sinh(np.arcsinh(part) / 3), np.where(q < 0, held, sigma))
        return np.where(status == names.SOLVED, held, sigma)

    def name_folds(self, codes: np.ndarray) -> None:
        """Overwrites the kinds of events, codes (k, 4): a bound of sigma is the fold of lambda."""
        for block, (q, *_) in self.of_block.items():
            first, end = self._rows(block)
            own = (codes[:, 0] >= first) & (codes[:, 0] < end) & (codes[:, 1] == names.EV_TANGENCY)
            own = np.flatnonzero(own)
            folds = 1 + 3 * q < 0  # else lambda comes to its bound before
            codes[own[folds[codes[own, 0] - first]], 1] = names.EV_FOLD
