"""Chunks through an executor: bounded in flight, collected as they finish, with a progress bar.

The default executor is a pool of threads: compiled orbits run without Python's lock. Any concurrent.futures.Executor
serves unchanged (processes, MPI, Dask's `Client.get_executor()`), as a chunk is a picklable call.
"""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from ..codegen.machine.workers import cores
from ..paths.budget import Stop
from ..paths.interrupts import SECONDS, noted, result
from .axes import Axes
from .chunk import run_chunk
from .plan import Plan
from .work import Work

_SECONDS = 0.5  # of work in a chunk: a kill costs no more, and the hand-over little beside it
_MOST = 16384  # points in a chunk: bounds the memory of the chunks in flight
_PILOTS = 8


def chunk_target(plan: Plan, axes: Axes, workers: int, deadline: float = math.inf) -> int:
    """Points in a chunk, from the time that a few points take; it does not change any value."""
    pilots = np.unique(np.linspace(0, axes.size - 1, min(_PILOTS, axes.size)).astype(int))
    whole = [axes.columns(int(i), int(i) + 1) for i in pilots]
    columns = {name: np.concatenate([c[name] for c in whole]) for name in whole[0]}
    _apart(plan, {name: c[:1] for name, c in columns.items()}, deadline)  # compiles, or loads what was compiled
    begin = time.perf_counter()
    _apart(plan, columns, deadline)
    per_point = (time.perf_counter() - begin) / len(pilots)
    target = min(_SECONDS / max(per_point, 1e-7), _MOST, math.ceil(axes.size / (4 * workers)))
    return max(1, int(target))


def _apart(plan: Plan, columns: dict[str, np.ndarray], deadline: float) -> None:
    """A chunk in a thread of its own: in this one Ctrl-C would be heard only at its end."""
    stop = Stop()
    with noted() as look, ThreadPoolExecutor(1) as pool:
        try:
            result(pool.submit(run_chunk, plan, columns, deadline, stop), look)
        except BaseException:
            stop.set()
            raise


def run_chunks(
    plan: Plan,
    axes: Axes,
    todo: list[tuple[int, int]],
    work: Work,
    keep: Callable[[int, int, dict[str, np.ndarray]], None],
    deadline: float = math.inf,
) -> None:
    """Run the chunks (start, stop) of `todo` and hand each result to `keep`, in the order in which they finish.

    RuntimeError where a worker was lost; chunks handed to `keep` before are complete.
    """
    own = work.executor is None
    workers = work.workers or (cores() if own else getattr(work.executor, "_max_workers", None) or 64)
    pool: Executor = work.executor or ThreadPoolExecutor(workers)
    if own and todo:
        # Compile once, before the threads start: otherwise each would.
        _apart(plan, axes.columns(todo[0][0], todo[0][0] + 1), deadline)
    # Compiled orbits of this process stop at once; other processes end their chunks first.
    stop = Stop() if own else None
    waiting = iter(todo)
    running: dict[Any, tuple[int, int]] = {}
    try:
        with noted() as look, _bar(work.progress, todo) as advance:
            while True:
                # A few more than there are workers, so that none is idle; not all, so that memory stays bounded.
                while len(running) < 2 * workers and (chunk := next(waiting, None)) is not None:
                    running[pool.submit(run_chunk, plan, axes.columns(*chunk), deadline, stop)] = chunk
                if not running:
                    break
                done, _ = wait(running, SECONDS, FIRST_COMPLETED)
                look()
                for future in done:
                    chunk = running.pop(future)
                    try:
                        result = future.result()
                    except Exception as error:
                        raise RuntimeError(
                            f"the worker of points {chunk[0]} to {chunk[1] - 1} was lost: "
                            f"{type(error).__name__}: {error}. Chunks that had finished are in the store, if "
                            "there is one; call sweep() again to go on."
                        ) from error
                    keep(*chunk, result)
                    advance(chunk[1] - chunk[0], int(np.sum(result["outcome"] < 0)))
    except BaseException:
        if stop is not None:
            stop.set()
        for future in running:
            future.cancel()
        raise
    finally:
        if own:
            pool.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def _bar(progress: Any, todo: list[tuple[int, int]]) -> Iterator[Callable[[int, int], None]]:
    """A function (points, failures) -> None that moves the bar; by default there is one on a terminal."""
    total = sum(stop - start for start, stop in todo)
    if not total or not (sys.stderr.isatty() if progress is None else progress):
        yield lambda points, failures: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(), MofNCompleteColumn(), TextColumn("points, {task.fields[rate]:.4g}/s,"),
        TextColumn("{task.fields[failed]} failed,"), TimeRemainingColumn(),
    )  # fmt: skip
    begin, finished, failed = time.perf_counter(), 0, 0
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=total, rate=0.0, failed=0)

        def advance(points: int, failures: int) -> None:
            nonlocal finished, failed
            finished, failed = finished + points, failed + failures
            rate = finished / max(time.perf_counter() - begin, 1e-9)
            bar.update(task, advance=points, rate=rate, failed=failed)

        yield advance
