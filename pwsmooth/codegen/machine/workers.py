"""Compilation on all cores, and a word on what takes so long."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

from .clock import preparing

# Numba makes millions of objects and hardly a circle of them: to look for these would take a twelfth of the time.
_WORKER = """
import gc, sys
gc.disable()
from pwsmooth.codegen.machine.units import unit_address
for line in sys.stdin:
    unit_address(line.strip())
    print(flush=True)
"""
_QUIET = "PWSMOOTH_COMPILES_QUIETLY"  # set for the workers: their parent speaks


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def announced(what: str, parts: int = 1, *, after: float = 0.0) -> Iterator[Callable[[], None]]:
    """Says on stderr what is being done once, and how long it took; nothing if that is less than `after` seconds.

    Gives a function to call when one of several parts is done: a terminal shows how many are.
    """
    done, begin, told = 0, time.perf_counter(), threading.Event()
    line = f"pwsmooth: {what}, once for this machine and version ..."

    def tell() -> None:
        if not os.environ.get(_QUIET):
            print(line, end=" ", file=sys.stderr, flush=True)
            told.set()

    def one_more() -> None:
        nonlocal done
        done += 1
        if told.is_set() and sys.stderr.isatty():
            print(f"\r{line} {done} of {parts},", end=" ", file=sys.stderr, flush=True)

    timer = threading.Timer(after, tell)
    timer.daemon = True
    timer.start() if after else tell()
    try:
        with preparing():
            yield one_more
    finally:
        timer.cancel()
        if told.is_set():
            print(f"{time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)


def compile_beside(names: list[str], kept: Callable[[str], bool]) -> None:
    """Compiles these units into the cache, by a worker on each core; what fails or is not kept is left to the caller.

    `python -c` and no pool of processes: that would run the user's script again in each of them.
    """
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    waiting = iter(names)  # taken by one thread at a time
    turn = threading.Lock()

    def feed(worker) -> None:
        with contextlib.suppress(OSError), worker:  # it may have ended
            while True:
                with turn:
                    name = next(waiting, None)
                if name is None:
                    break
                print(name, file=worker.stdin, flush=True)
                if not worker.stdout.readline() or not kept(name):
                    break  # it failed, or no folder takes what it made

    workers, threads = [], []
    environment = os.environ | {"PYTHONPATH": paths, _QUIET: "1"}
    try:
        with contextlib.suppress(OSError):  # fewer workers, or none
            for _ in range(min(len(names), cores())):
                worker = subprocess.Popen(
                    [sys.executable, "-c", _WORKER], text=True, env=environment,
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                )  # fmt: skip
                workers.append(worker)
                threads.append(threading.Thread(target=feed, args=[worker], daemon=True))
                threads[-1].start()
        for thread in threads:
            thread.join()
    finally:
        for worker in workers:  # by Ctrl-C: their threads end with them
            worker.kill()
