"""What happens to a method on a stability map, in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from .failures import HARMLESS


def what_happens(map_: Any, method: str) -> str:
    """ "right", "right or recorded", or the ways of failing with their shares of all runs, of a StabilityMap."""
    tally, total = map_.tally(method), int(map_.total(method).sum())
    failures = [(kind, n) for kind, n in tally.items() if kind not in HARMLESS]
    if not failures:
        return "right or recorded" if tally.get("recorded") else "right"
    words = [f"{kind} {_share(n, total)}" for kind, n in failures[:3]]
    agreement = map_.agreement(method)
    beyond = "" if not np.isfinite(agreement) or agreement < 0.95 else ", at theory's border"
    return ", ".join(words) + beyond


def _share(n: int, total: int) -> str:
    percent = 100 * n / total
    return f"{percent:.0f} %" if percent >= 1 else f"{n} of {total}"
