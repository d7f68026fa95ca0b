"""A sweep on disk that survives: Zarr, one file for every variable and chunk, and the sha256 of every chunk.

Why Zarr: a chunk is its own file, moved into place whole, so no kill can damage what was finished; half-finished
stores open in xarray like finished ones; the same layout works on object stores. (NetCDF/HDF5 keeps one file whose
index a kill can corrupt.) A chunk counts as finished when what is read of it bears out its sha256, which is written
after everything else of it: one that a disk lost or damaged is run again. What the store says of itself, the root's
attributes, bears a sha256 too.
"""

from __future__ import annotations

import contextlib
import glob
import json
import os
import re
import shutil
import socket
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import stored
from .axes import Axes
from .dataset import attributes, coordinates, make_dataset
from .identity import UNKNOWN
from .plan import Plan

if TYPE_CHECKING:
    import xarray


class Store:
    """Chunks of one sweep in a Zarr directory; `todo`: first and last + 1 of the points of every chunk that has to run.

    A directory made by another sweep is refused. One made by another version is read, and refused if there is something
    to run. `target` gives the points in a chunk, asked only if the store is new: a resumed one keeps its own layout.
    """

    def __init__(self, path: Any, plan: Plan, axes: Axes, target: Any) -> None:
        zarr = stored.zarr_itself()
        self.path, self.plan, self.axes = Path(path), plan, axes
        self.arrays, self.attrs = plan.empty(axes.size), attributes(plan, axes)
        new = False
        if not (self.path / "zarr.json").exists():
            if self.path.exists() and any(self.path.iterdir()):
                raise ValueError(
                    f"`store` {str(self.path)!r} exists and is no store of a sweep (it has no zarr.json); give another "
                    "path."
                )
            chunk = int(target())
            with stored.explained(self.path, "be made", "make room, or give a path that may be written"):
                new = self._create(zarr, chunk)
        self.group, there = stored.opened(self.path, "r+")
        other = "" if new else self._compare(there)
        self.boxes = axes.boxes(there["chunk"])[1]
        damaged = [] if other else self._mend(there)
        with zarr.config.set(stored.EVERY_CHUNK):
            self.files = stored.files_of(
                self.path, self.group, [*plan.variables] + [stored.SUMS] * ("sha256" in there)
            )
        sound, lost = stored.read_chunks(self.files, self.arrays, self.boxes, axes.shape)
        damaged += lost
        done = self.arrays["outcome"] != stored.NOT_RUN
        self.todo = [box for i, box in enumerate(self.boxes) if not (sound[i] and done[slice(*box)].all())]
        if other and self.todo:
            raise ValueError(
                f"`store` {str(self.path)!r} {other}, and {len(self.todo)} of its {len(self.boxes)} chunks have still "
                "to run; finish it with that version, or give another path (studies.read_store reads this one)."
            )
        if other:
            self.attrs["versions"] = there["versions"]
            warnings.warn(f"`store` {str(self.path)!r} {other}; it is finished, and only read.", stacklevel=3)
        if damaged:
            stored.say_damage(self.path, damaged, "computed again")

    def _create(self, zarr: Any, target: int) -> bool:
        """Everything but the chunks, in a directory that is moved into place whole, unless another process did it."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        _remove_scratch(self.path)
        prefix = f".{self.path.name}-{os.getpid()}@{socket.gethostname()}-"
        scratch = Path(tempfile.mkdtemp(prefix=prefix, dir=self.path.parent))
        try:
            group = zarr.open_group(scratch / "new", mode="w")
            layout = self._layout(target)
            sums = {name: _describe(group, name, *parts) for name, parts in layout.items()}
            about = {
                **self.attrs, "chunk": target, "variables": [*self.plan.variables], "arrays": sums,
                "coordinates": [name for name, (_, values) in layout.items() if values is not None],
            }  # fmt: skip
            group.attrs.update({**about, "sha256": stored.sum_of_attributes(about)})
            with contextlib.suppress(OSError):
                self.path.rmdir()  # empty: see __init__
            try:
                os.replace(scratch / "new", self.path)
            except OSError:
                if (self.path / "zarr.json").exists():
                    return False
                raise
            return True
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def _layout(self, chunk: int) -> dict[str, tuple[dict[str, Any], Any]]:
        """Name -> arguments of create_array, and the values of a coordinate."""
        from zarr.codecs import ZstdCodec

        usual = {"compressors": ZstdCodec(checksum=True), "config": {"write_empty_chunks": True}}
        layout: dict[str, tuple[dict[str, Any], Any]] = {}
        for name, (dims, values, attrs) in coordinates(self.plan, self.axes).items():
            if values.dtype == object:
                values = values.astype(str).astype(np.dtypes.StringDType())
            layout[name] = {"shape": values.shape, "chunks": values.shape, "dtype": _stored(values.dtype),
                            "dimension_names": dims, "attributes": attrs, **usual}, values  # fmt: skip
        shape, boxes = self.axes.boxes(chunk)
        for name, v in self.plan.variables.items():
            layout[name] = {
                "shape": (*self.axes.shape, *v.shape), "chunks": (*shape, *(max(s, 1) for s in v.shape)),
                "dtype": _stored(v.dtype), "fill_value": v.fill, "dimension_names": (*self.axes.dims, *v.dims),
                "attributes": _plain(v.attrs), **usual,
            }, None  # fmt: skip
        layout[stored.SUMS] = {"shape": (len(boxes), 32), "chunks": (1, 32), "dtype": "uint8", "fill_value": 0,
                               "dimension_names": stored.SUM_DIMS, **usual}, None  # fmt: skip
        return layout

    def _compare(self, there: dict[str, Any]) -> str:
        """In what way it was made by another version, "" for none; refuses a store of another sweep in words."""
        before = "sha256" not in there
        old, new = json.loads(there["identity"]), json.loads(self.attrs["identity"])
        unknown = [key for key in new if UNKNOWN in new[key]]
        # Stores of earlier versions record less: no last digits, no code behind a measure, another hash of the system.
        keys = [k for k in old if k != "system"] if before else list({**old, **new})
        differing = [
            k for k in keys if old.get(k) != new.get(k) and not (before and new.get(k, "").startswith(old[k]))
        ]
        if unknown or differing:
            key = (unknown or differing)[0]
            more = len(differing) - 1
            raise ValueError(
                f"`store` {str(self.path)!r} was made by another sweep, or one that cannot be known to be this: its "
                f"{key} is {old.get(key, 'absent')}, this one's is {new.get(key, 'absent')}"
                + (f" (and {more} more differ)" if more > 0 else "")
                + "; give another path, or the sweep that it was made with (studies.read_store reads this one)."
            )
        old, new = json.loads(there["versions"]), json.loads(self.attrs["versions"])
        differing = [k for k in {**old, **new} if old.get(k) != new.get(k)]
        words = [f"its {k} is {old.get(k, 'absent')}, this one's is {new.get(k, 'absent')}" for k in differing]
        if before:
            words = [
                "it has no checksums, and of its system and measures only names and values can be compared"
            ]
        return f"was made by another version: {'; '.join(words)}" if words else ""

    def _mend(self, there: dict[str, Any]) -> list[str]:
        """Describe arrays again whose description is damaged, and write damaged coordinates; what was mended."""
        mended = []
        for name, (array, values) in self._layout(there["chunk"]).items():
            try:
                stored.check_array(self.group, name, there)
            except Exception as error:  # zarr raises whatever its parsers raise
                mended.append(f"{name}/zarr.json: {type(error).__name__}: {error}")
                with stored.explained(
                    self.path, f"be mended in {name}", "restore it from a copy, or give another path"
                ):
                    # The chunks stay: their checksums show whether they are whole.
                    (self.path / name / "zarr.json").unlink(missing_ok=True)
                    _describe(self.group, name, array, values)
        return mended

    def keep(self, start: int, stop: int, result: dict[str, np.ndarray]) -> None:
        """Write a chunk, then its sum, which marks it as finished."""
        for name, values in result.items():
            self.arrays[name][start:stop] = values
        number = self.boxes.index((start, stop))
        region = stored.region_of((start, stop), self.axes.shape)
        box = tuple(s.stop - s.start for s in region)
        remedy = "what had finished is kept; make room, or wait for the disk, and call sweep() again to go on"
        for name in self.plan.variables:
            values = self.arrays[name][start:stop]
            with stored.explained(self.path, f"be written at {name}", remedy):
                self.files[name][region] = values.reshape(*box, *values.shape[1:])
        with stored.explained(self.path, f"be written at {stored.SUMS}", remedy):
            self.files[stored.SUMS][number] = np.frombuffer(
                stored.sum_of_chunk(self.arrays, start, stop), np.uint8
            )

    def dataset(self) -> xarray.Dataset:
        """The whole sweep."""
        return make_dataset(self.plan, self.axes, self.arrays).assign_attrs(self.attrs)


def _describe(group: Any, name: str, array: dict[str, Any], values: Any) -> str:
    """Make an array, with the values of a coordinate; its sum."""
    made = group.create_array(name, **array)
    if values is not None:
        made[...] = values
    return stored.sum_of_array(made, values)


def _stored(dtype: Any) -> Any:
    return str if np.dtype(dtype).kind in "OT" else dtype


def _plain(attrs: dict[str, Any]) -> dict[str, Any]:
    return {k: [int(i) for i in v] if isinstance(v, list) else v for k, v in attrs.items()}


def _remove_scratch(path: Path) -> None:
    """Remove what processes left beside the store that were killed while they made it."""
    for scratch in path.parent.glob(f".{glob.escape(path.name)}-*"):
        maker = re.fullmatch(r"(\d+)@(.+)-\w{8}", scratch.name[len(path.name) + 2 :])
        if maker and maker[2] == socket.gethostname() and not _lives(int(maker[1])):
            shutil.rmtree(scratch, ignore_errors=True)


def _lives(process: int) -> bool:
    if os.name != "posix":
        return True  # there, os.kill would end it
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True
