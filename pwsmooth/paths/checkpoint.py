"""Checkpoints of a run of a large family: it goes on from them with the same bits.

Chain: local.py -> **this file**.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..codegen.machine.cache import fingerprint

# What the same call makes again.
_STATIC = {*"near reader_first reader p part shift asked slip_share keeps number cell most".split()}
_STATIC |= {*"crew post post_address here unit_of_parts orders".split()}


def was_in_parts(path: Path | None) -> bool:
    """Whether a run is made in parts, where it may be: one that goes on from a checkpoint as it began."""
    if path is None or not path.exists():
        return True
    with np.load(path) as kept:
        return "parts" in kept and bool(kept["parts"])


class Saved:
    """A checkpoint: all that a run carries from call to call, in one file that is replaced as a whole."""

    def __init__(self, run: Any, ends: np.ndarray, start: Any):
        self.run, self.path, self.every = run, run.record.checkpoint, run.record.checkpoint_every
        options = run.options._replace(max_steps=0)  # how far one call goes is no part of what it computes
        told = repr(
            ("in parts", ends.tolist(), options, run.order, run.n, run.A.asked.tolist(), run.A.keeps.max())
        )
        told += repr({**(run.record.statistics or {})})
        content = (
            told.encode() + np.array(start, float).tobytes() + np.array(run.system.parameter_values).tobytes()
        )
        content += fingerprint(run.template).encode()
        self.mark = hashlib.sha256(content).hexdigest()

    def _parts(self) -> Iterator[tuple[str, Any, str, bool]]:
        seen = set()
        for k, system in enumerate(self.run.systems):
            A, of = system.A, f"part {k}." if k else ""
            for name, bundle in (("", A), ("queue.", A.queue), ("patch.", A.patch)):
                for key, member in type(bundle).members.items():
                    is_array = hasattr(member, "rank")
                    if key in _STATIC or not (is_array or hasattr(member, "cell")):
                        continue
                    if is_array and getattr(bundle, key).size:
                        if bundle.cells[member.at] in seen:
                            continue  # an array of all parts
                        seen.add(bundle.cells[member.at])
                    yield of + name + key, bundle, key, is_array

    def write(self) -> None:
        run = self.run
        kept = {name: np.asarray(getattr(bundle, key)) for name, bundle, key, _ in self._parts()}
        for name, part in zip(("x", "mult", "status"), run.initial or (), strict=False):
            kept[f"initial.{name}"] = part
        for i, statistic in enumerate(run.statistics.values()):
            kept |= {f"statistic {i}.{name}": value for name, value in statistic.numbers().items()}
        beside = self.path.with_name(self.path.name + ".new")
        with open(beside, "wb") as stream:
            np.savez(stream, mark=np.array(self.mark), rows=np.array(run.log.rows), **kept)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(beside, self.path)

    def load(self) -> int:
        """Where the run was, if it was saved, and how many events it had kept.

        Raises
        ------
        ValueError
            The file is of another run.
        """
        if not self.path.exists():
            return 0
        run = self.run
        with np.load(self.path) as kept:
            if str(kept["mark"]) != self.mark:
                raise ValueError(
                    f"`checkpoint` {str(self.path)!r} is of another run: system, values, start, times or options "
                    "differ; remove it, or give another name."
                )
            for name, bundle, key, is_array in self._parts():
                if not is_array:
                    setattr(bundle, key, kept[name][()])
                elif kept[name].shape == getattr(bundle, key).shape:
                    getattr(bundle, key)[...] = kept[name]
                else:
                    type(bundle).members[key].give(bundle, kept[name])
            if "initial.x" in kept:
                run.initial = tuple(kept[f"initial.{name}"] for name in ("x", "mult", "status"))
            for i, statistic in enumerate(run.statistics.values()):
                own = f"statistic {i}."
                statistic.go_on({name.removeprefix(own): kept[name] for name in kept if name.startswith(own)})
            rows = int(kept["rows"])
        for system in run.systems:
            system.A.patch.shaped[:] = -1
        return rows

    def remove(self) -> None:
        self.path.unlink(missing_ok=True)
