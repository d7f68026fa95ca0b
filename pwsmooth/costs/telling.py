"""How a search tells where it is: a line on the terminal, a caller's function."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def telling(
    progress: bool | None, callback: Callable[[Any], None] | None, words: Callable[[Any], str]
) -> Iterator[Callable[[Any], None]]:
    """What each step of a search is told to: the terminal in these words, the callback, both or none.

    On a terminal, where it is the default, the line is written over.
    """
    terminal = sys.stderr.isatty()
    shown = terminal if progress is None else progress

    def told(at: Any) -> None:
        if shown:
            print(f"{words(at):<70}", end="\r" if terminal else "\n", file=sys.stderr, flush=True)
        if callback is not None:
            callback(at)

    yield told
    if shown and terminal:
        print(file=sys.stderr)
