"""Tasks through processes, and their results on disk: what a kill leaves is taken up again.

A task is data, and its result depends on nothing else. So it does not matter who computes it, when, or in which order:
the same call gives the same result with any number of workers, and after any kill. A result is a Zarr group of its own,
`items/<sha256 of the task>`, moved into place whole, with a sha256 of every array: a damaged one is computed again.

Chain: studies/stored.py -> **tasks** -> searching.py, over_two.py, calling.py.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..paths import interrupts
from ..studies import stored
from ..studies.dataset import version_items
from ..studies.work import Work

RESULT, ITEMS = "result", "items"
Task = dict[str, Any]
Item = dict[str, Any]


def key_of(task: Task) -> str:
    return hashlib.sha256(json.dumps(task, sort_keys=True).encode()).hexdigest()[:24]


class Tasks:
    """Results of tasks by `function(setting, task)`: from the store, from processes, or computed here."""

    def __init__(
        self, function: Callable[[Any, Task], Item], setting: Any, workers: Workers, store: Store | None
    ) -> None:
        self.function, self.setting, self.workers, self.store = function, setting, workers, store
        self.running: dict[str, Future[Item]] = {}

    def ask(self, tasks: Iterable[Task]) -> None:
        """Begin with tasks that will be wanted as it looks now; without processes nothing."""
        pool = self.workers.pool
        if pool is None:
            return
        for task in tasks:
            key = key_of(task)
            if key not in self.running and not (self.store is not None and self.store.has(key)):
                self.running[key] = pool.submit(self.function, self.setting, task)

    def result(self, task: Task) -> Item:
        """The result of a task; what other tasks have finished in the meantime is stored too."""
        key = key_of(task)
        if self.store is not None and (item := self.store.read(key)) is not None:
            return item
        self.ask([task])
        if key not in self.running:
            item = self.function(self.setting, task)
        else:
            try:
                item = interrupts.result(self.running[key], self.workers.look)
            except Exception as error:
                raise RuntimeError(
                    f"a worker was lost: {type(error).__name__}: {error}. What had finished is in the store, if there "
                    "is one; make the same call again to go on."
                ) from error
        if self.store is not None:
            self.store.keep(key, item)
            for other, future in self.running.items():
                if other != key and future.done() and not self.store.has(other) and not future.exception():
                    self.store.keep(other, future.result())
        return item


@dataclass(frozen=True)
class Workers:
    """Where tasks run, how many at a time, and what hears Ctrl-C meanwhile; without a pool they run in this process."""

    pool: Executor | None = None
    ahead: int = 1
    look: interrupts.Look = lambda: None


@contextlib.contextmanager
def working(work: Work) -> Iterator[Workers]:
    """The executor that is given, processes of one's own, or this process."""
    executor, workers = work.executor, work.workers
    if executor is not None:
        with interrupts.noted() as look:
            yield Workers(executor, getattr(executor, "_max_workers", None) or 8, look)
    elif workers is None or workers == 1:
        yield Workers()
    else:
        with interrupts.processes(workers) as (pool, look):
            yield Workers(pool, workers, look)


class Store:
    """A Zarr directory of one call: what it is, the items that have finished, and in the end the result."""

    def __init__(self, path: Any, title: str, identity: Mapping[str, str]) -> None:
        zarr = stored.zarr_itself()
        self.path = Path(path)
        about = {
            "title": title, "identity": json.dumps(dict(identity), indent=1),
            "versions": json.dumps(version_items(), indent=1),
        }  # fmt: skip
        if not (self.path / "zarr.json").exists():
            if self.path.exists() and any(self.path.iterdir()):
                raise ValueError(
                    f"`store` {str(self.path)!r} exists and is no store of a diagram (it has no zarr.json); give "
                    "another path."
                )
            with stored.explained(self.path, "be made", "make room, or give a path that may be written"):
                scratch = self.path.parent / f".{self.path.name}-{os.getpid()}"
                group = zarr.open_group(scratch, mode="w")
                group.attrs.update({**about, "sha256": stored.sum_of_attributes(about)})
                os.replace(scratch, self.path)
        there = read_about(self.path)
        for name in ("title", "identity", "versions"):
            if there[name] != about[name]:
                how = _differing(there[name], about[name])
                raise ValueError(
                    f"`store` {str(self.path)!r} was made by another call or version: its {how}; give another path."
                )
        self.items = self.path / ITEMS
        self.items.mkdir(exist_ok=True)
        for scratch in self.items.glob(".*"):
            shutil.rmtree(scratch, ignore_errors=True)

    def has(self, key: str) -> bool:
        return (self.items / key / "zarr.json").exists()

    def read(self, key: str) -> Item | None:
        """An item; None where there is none, or a damaged one."""
        if not self.has(key):
            return None
        try:
            return read_group(self.items / key)
        except Exception as error:  # zarr raises whatever its parsers raise
            warnings.warn(f"{self.items / key} is damaged, and computed again: {error}", stacklevel=2)
            shutil.rmtree(self.items / key, ignore_errors=True)
            return None

    def keep(self, key: str, item: Item) -> None:
        write_group(self.items, key, item)


def read_about(path: Path) -> dict[str, Any]:
    """What a store says of itself."""
    try:
        about = dict(stored.zarr_itself().open_group(path, mode="r").attrs)
        sound = about.pop("sha256") == stored.sum_of_attributes(about) and "title" in about
    except Exception as error:  # zarr raises whatever its parsers raise
        raise ValueError(f"`path` {str(path)!r} is no store of a diagram: {error}") from None
    if not sound:
        raise ValueError(f"`path` {str(path)!r} is no store of a diagram, or a damaged one; give another one.")
    return about


def read_result(path: Path) -> tuple[str, dict[str, Any]]:
    """The title of a store, and the result in it."""
    about = read_about(path)
    if not (path / RESULT / "zarr.json").exists():
        raise ValueError(
            f"{str(path)!r} is not finished: make the call that began it again, with this `store`."
        )
    try:
        return about["title"], read_group(path / RESULT)
    except Exception as error:  # zarr raises whatever its parsers raise
        raise ValueError(f"{str(path)!r} is damaged: {error}; make the call that made it again.") from error


def _differing(old: str, new: str) -> str:
    try:
        a, b = json.loads(old), json.loads(new)
    except json.JSONDecodeError:
        return f"title is {old}, this one's is {new}"
    key = next(k for k in {**a, **b} if a.get(k) != b.get(k))
    return f"{key} is {a.get(key, 'absent')}, this one's is {b.get(key, 'absent')}"


def write_group(folder: Path, name: str, item: Item) -> None:
    """Arrays and words as a group, moved into place whole."""
    zarr = stored.zarr_itself()
    scratch = folder / f".{name}-{os.getpid()}"
    shutil.rmtree(scratch, ignore_errors=True)
    remedy = "what had finished is kept; make room, and make the same call again to go on"
    with stored.explained(folder, f"be written at {name}", remedy):
        group = zarr.open_group(scratch, mode="w")
        sums = {}
        for key, values in item["arrays"].items():
            chunks = tuple(max(size, 1) for size in values.shape)
            made = group.create_array(key, shape=values.shape, dtype=values.dtype, chunks=chunks)
            made[...] = values
            sums[key] = stored.sum_of_array(made, values)
        about = {"about": json.dumps(item["about"]), "arrays": sums}
        group.attrs.update({**about, "sha256": stored.sum_of_attributes(about)})
        shutil.rmtree(folder / name, ignore_errors=True)
        os.replace(scratch, folder / name)


def read_group(path: Path) -> Item:
    """Arrays and words of a group; ValueError where a sha256 does not fit."""
    group = stored.zarr_itself().open_group(path, mode="r")
    about = dict(group.attrs)
    stated = about.pop("sha256")
    if stated != stored.sum_of_attributes(about):
        raise ValueError("its checksum does not fit")
    arrays: dict[str, np.ndarray] = {}
    for name, total in about["arrays"].items():
        values = group[name][...]
        if stored.sum_of_array(group[name], values) != total:
            raise ValueError(f"the checksum of {name} does not fit")
        arrays[name] = values
    return {"arrays": arrays, "about": json.loads(about["about"])}


@contextlib.contextmanager
def telling(work: Work) -> Iterator[Callable[[str], None]]:
    """A function that shows what a call is doing, on a terminal by default; elsewhere in lines, if it is asked to."""
    if not (sys.stderr.isatty() if work.progress is None else work.progress):
        yield lambda words: None
        return
    from rich.console import Console

    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield lambda words: console.print(words, highlight=False, soft_wrap=True)
        return
    with console.status("") as status:
        yield status.update
