"""The first compilation of the core: on all processors, with a word on what takes so long."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

_WORKER = """
import sys
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
def announced(parts: int) -> Iterator[None]:
    """Says on stderr that parts of the core are being compiled, and how long it took."""
    if os.environ.get(_QUIET):
        yield
        return
    many = "one part" if parts == 1 else f"{parts} parts"
    text = f"pwsmooth: compiling {many} of its numerical core, once for this machine and version ..."
    print(text, end=" ", file=sys.stderr, flush=True)
    begin = time.perf_counter()
    try:
        yield
    finally:
        print(f"{time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)


def compile_beside(names: list[str], kept: Callable[[str], bool]) -> None:
    """Compiles these units into the cache, in a process for each core; what fails or is not kept is left to the caller.

    `python -c` and no pool of processes: that would run the user's script again in each of them.
    """
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    waiting = iter(names)  # taken by one thread at a time
    turn = threading.Lock()

    def feed(worker) -> None:
        with contextlib.suppress(OSError):  # a worker that has ended
            while True:
                with turn:
                    name = next(waiting, None)
                if name is None:
                    break
                print(name, file=worker.stdin, flush=True)
                if not worker.stdout.readline() or not kept(name):
                    break  # it failed, or no folder takes what it made
            worker.stdin.close()

    workers: list[subprocess.Popen] = []
    environment = os.environ | {"PYTHONPATH": paths, _QUIET: "1"}
    try:
        with contextlib.suppress(OSError):  # fewer workers, or none
            while len(workers) < min(len(names), cores()):
                workers.append(
                    subprocess.Popen(
                        [sys.executable, "-c", _WORKER], text=True, env=environment,
                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                    )
                )  # fmt: skip
        threads = [threading.Thread(target=feed, args=[worker], daemon=True) for worker in workers]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        for worker in workers:
            worker.kill()
            worker.stdout.close()
            worker.wait()
