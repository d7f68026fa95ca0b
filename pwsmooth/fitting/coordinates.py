"""Fitted quantities as coordinates of size 1: log p of what is positive, p over its unit else.

Chain: **coordinates** -> shooting.py, which turns them into runs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Coordinates(NamedTuple):
    """Of each fitted quantity its name, whether its logarithm is fitted, its unit and its bounds."""

    names: tuple[str, ...]
    logarithmic: np.ndarray
    unit: np.ndarray
    low: np.ndarray  # of coordinates
    high: np.ndarray

    def values(self, q: np.ndarray) -> np.ndarray:
        """In the units of the model."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, q, 0.0)), q * self.unit)

    def slopes(self, q: np.ndarray) -> np.ndarray:
        """d value/d coordinate."""
        return np.where(self.logarithmic, self.values(q), self.unit)


def coordinate(value: float, logarithmic: bool, unit: float) -> float:
    """Of a value or a bound; a bound <= 0 of a logarithm is none."""
    if not logarithmic:
        return value / unit
    return float(np.log(value)) if value > 0 else -np.inf
