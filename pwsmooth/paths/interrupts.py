"""Ctrl-C while threads and processes work: noted at once, raised where this thread holds no lock.

Python raises KeyboardInterrupt wherever the main thread stands, in the midst of a pool's locks as well. A lock whose
release is skipped so stays held, and what waits for it then waits for ever.

    with noted() as look:                 Ctrl-C is noted from here on
        ...                               submit, print, write: nothing here is interrupted
        result(future, look)              waits; `look` raises KeyboardInterrupt where one came
    with processes(2) as (pool, look):    the same with processes, none of which is left at the end of the block

Chain: figures, sweep, diagrams -> **interrupts**.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, wait
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, TypeVar

Look = Callable[[], None]
T = TypeVar("T")
SECONDS = 0.2  # between two looks for Ctrl-C


class Noted:
    """A handler of SIGINT that only notes it; `look` does what the handler `before` would have done."""

    def __init__(self, before: Callable[..., Any]) -> None:
        self.before = before
        self.call: tuple[Any, ...] = ()

    def __call__(self, *call: Any) -> None:
        self.call = call

    def look(self) -> None:
        if self.call:
            call, self.call = self.call, ()
            self.before(*call)


@contextlib.contextmanager
def noted() -> Iterator[Look]:
    """Within the block Ctrl-C is noted; the function that is handed over raises it, and at last the block's end."""
    before = signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None
    if isinstance(before, Noted):
        yield before.look
    elif not callable(before):  # ignored, or not this thread's affair
        yield lambda: None
    else:
        handler = Noted(before)
        signal.signal(signal.SIGINT, handler)
        try:
            yield handler.look
        finally:
            signal.signal(signal.SIGINT, before)
            handler.look()


def result(future: Future[T], look: Look) -> T:
    """The result of a future, once it is there."""
    while not wait([future], SECONDS).done:
        look()
    return future.result()


class _Process(SpawnProcess):
    def start(self) -> None:
        """Begin with SIGINT blocked: a process inherits that, and hears nothing of it even while it still imports."""
        if not hasattr(signal, "pthread_sigmask"):
            return super().start()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class _Context(SpawnContext):
    Process = _Process


def _begin() -> None:
    """What a process of a pool does first: it ignores SIGINT where that cannot be blocked, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A parent that is killed closes no pipe that its processes hold as well: they would wait for work for ever.
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def processes(number: int) -> Iterator[tuple[ProcessPoolExecutor, Look]]:
    """A pool of processes that Ctrl-C does not reach; those that still work at the end of the block are ended."""
    context = _Context()  # not forked: compiled code has threads
    others = {*multiprocessing.active_children()}
    with noted() as look, ProcessPoolExecutor(number, context, _begin) as pool:
        try:
            yield pool, look
        finally:
            for process in {*multiprocessing.active_children()} - others:
                process.terminate()
            pool.shutdown(cancel_futures=True)
