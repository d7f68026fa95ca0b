"""Whether the steps of a run still fit into memory: a run that keeps everything must end before the machine does.

Chain: **memory** -> event_driven.py, stiff_steps.py, which end with the outcome OUT_OF_MEMORY.
"""

from __future__ import annotations

import math
from pathlib import Path

_SMALL = 2**28  # bytes that are taken without asking: looking costs as much as a hundred steps
_SHARE = 0.8  # of what is available; the rest is for copies on the way into a Solution


def available() -> float:
    """Bytes that can be had without swapping; inf where the system does not tell."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
    except (OSError, ValueError):
        pass
    return math.inf


def fits(size: float) -> bool:
    """Whether `size` bytes more can be had."""
    return size <= _SMALL or size <= _SHARE * available()
