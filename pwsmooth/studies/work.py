"""By whom a study is worked off, in what parts, and where it is kept: nothing of it changes a value.

Chain: **work** -> sweep(), basins.py, diagrams.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from ..door import checks

__all__ = ["Work"]


@checks.door()
@dataclass(frozen=True)
class Work:
    """How a sweep, basins, an orbit diagram or a diagram is worked off. No value depends on it.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        By default threads on all cores, which compiled orbits keep busy; diagrams are made in this process. Functions
        of the Solution that are slow Python gain from processes: ``ProcessPoolExecutor()``; a cluster: Dask's
        ``Client(...).get_executor()``. Processes need to import what the system is made of.
    workers : int, optional
        Threads of the default executor; of diagrams processes.
    chunk : int, optional
        Points of a sweep that a worker takes at a time, by default about half a second of work.
    store : path, optional
        Zarr directory to which chunks, or branches and curves, are written as they finish. The same call with the same
        store goes on where it was stopped, also by a kill, and gives the same bits as a run that was not; the store of
        another call is refused.
    progress : bool, optional
        Whether it tells how far it is, by default on a terminal.

    Raises
    ------
    ValueError, TypeError
        No executor, no positive numbers.

    >>> x, k = sp.symbols("x k", real=True)
    >>> decay = System({x: -k * x}, parameters={k: 1})
    >>> found = sweep(decay, {"k": [1.0, 2.0]}, x0={"x": 1}, t_span=(0, 1), measures=["counts"], work=Work(workers=2))
    >>> found.outcome.values.tolist()
    [0, 0]
    """

    executor: Executor | None = None
    workers: int | None = None
    chunk: int | None = None
    store: Any = None
    progress: bool | None = None

    def __post_init__(self) -> None:
        checks.fields(
            self, workers=checks.optional(checks.integer(1, 10_000)), chunk=checks.optional(checks.integer(1)),
            store=checks.optional(checks.path), progress=checks.optional(checks.flag),
        )  # fmt: skip
        if self.executor is not None and not hasattr(self.executor, "submit"):
            raise TypeError(
                f"`executor` is {checks.shown(self.executor)}; give a concurrent.futures.Executor, such as "
                "ProcessPoolExecutor() or a Dask client's `get_executor()`."
            )
