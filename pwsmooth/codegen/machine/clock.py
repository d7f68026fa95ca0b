"""A clock that stands still while something is made ready: derived, compiled, or loaded for the first time.

Bounds of time are bounds of a run. What is done once for a model, or once on a machine, is not part of them.
"""

from __future__ import annotations

import contextlib
import threading
import time

_lock = threading.Lock()
_busy = 0  # threads that make something ready now
_begun = 0.0  # when the first of them began
_left_out = 0.0  # seconds, of all times that nobody counts


def now() -> float:
    """Seconds of this process since some instant, without the time of making ready."""
    with _lock:
        return (_begun if _busy else time.monotonic()) - _left_out


class preparing(contextlib.ContextDecorator):
    """Around what is made ready: the clock stands still, for all threads."""

    def __enter__(self) -> None:
        global _busy, _begun
        with _lock:
            if not _busy:
                _begun = time.monotonic()
            _busy += 1

    def __exit__(self, *_: object) -> None:
        global _busy, _left_out
        with _lock:
            _busy -= 1
            if not _busy:
                _left_out += time.monotonic() - _begun
