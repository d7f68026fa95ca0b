"""A sweep on disk that survives: Zarr, one file for every variable and chunk, `outcome` written last.

Why Zarr: a chunk is its own file, moved into place whole, so no kill can damage what was finished; half-finished
stores open in xarray like finished ones; the same layout works on object stores. (NetCDF/HDF5 keeps one file whose
index a kill can corrupt.) `outcome` is the mark: a chunk counts as finished when its outcomes are there, and they
are written after everything else of it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .axes import Axes
from .dataset import attributes, coordinates, empty_arrays, make_dataset
from .plan import NOT_RUN, Plan


class Store:
    """Chunks of one sweep in a Zarr directory.

    Parameters
    ----------
    path : str or Path
    plan, axes
        A directory made by another sweep, or by another version, is refused.
    target : callable -> int
        Points in a chunk, asked only if the store is new: a resumed one keeps its own layout.
    """

    def __init__(self, path: Any, plan: Plan, axes: Axes, target: Any) -> None:
        try:
            import zarr
        except ImportError as error:
            raise ImportError("`store` needs zarr, 3.1 or newer: pip install 'zarr>=3.1'.") from error
        self.path, self.plan, self.axes = Path(path), plan, axes
        self.group: Any
        if (self.path / "zarr.json").exists():
            self.group = zarr.open_group(self.path, mode="r+")
            self._compare()
        elif self.path.exists() and any(self.path.iterdir()):
            raise ValueError(
                f"`store` {str(self.path)!r} exists and is no store of a sweep; give another path."
            )
        else:
            self._create(zarr, int(target()))
        self.shape, boxes = axes.boxes(int(self.group.attrs["chunk"]))
        self._finished = self._read_finished()
        self.todo = [box for box in boxes if not self._finished[slice(*box)].all()]

    def _create(self, zarr: Any, target: int) -> None:
        """Everything but the chunks, in a directory that is moved into place whole."""
        import os
        import shutil
        import tempfile

        self.path.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{self.path.name}-", dir=self.path.parent))
        try:
            group = zarr.open_group(scratch / "new", mode="w")
            group.attrs.update({**attributes(self.plan, self.axes), "chunk": target})
            for name, (dims, values, attrs) in coordinates(self.plan, self.axes).items():
                values = (
                    values.astype(str).astype(np.dtypes.StringDType()) if values.dtype == object else values
                )
                array = group.create_array(
                    name,
                    shape=values.shape,
                    dtype=_stored(values.dtype),
                    dimension_names=dims,
                    attributes=attrs,
                )
                array[...] = values
            shape, _ = self.axes.boxes(target)
            for name, v in self.plan.variables.items():
                group.create_array(
                    name, shape=(*self.axes.shape, *v.shape), chunks=(*shape, *(max(s, 1) for s in v.shape)),
                    dtype=_stored(v.dtype), fill_value=v.fill, dimension_names=(*self.axes.dims, *v.dims),
                    attributes=_plain(v.attrs),
                )  # fmt: skip
            if self.path.exists():
                self.path.rmdir()  # empty: see __init__
            os.replace(scratch / "new", self.path)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
        self.group = zarr.open_group(self.path, mode="r+")

    def _compare(self) -> None:
        """Refuses a store of another sweep, and says in what they differ."""
        there, here = dict(self.group.attrs), attributes(self.plan, self.axes)
        if "identity" not in there or "versions" not in there:
            raise ValueError(
                f"`store` {str(self.path)!r} is a Zarr group, but none of a sweep; give another path."
            )
        for item, advice in (
            ("versions", "finish it with that version, or give another path"),
            ("identity", "give another path, or the sweep that it was made with"),
        ):
            old, new = json.loads(there[item]), json.loads(here[item])
            differing = [key for key in {**old, **new} if old.get(key) != new.get(key)]
            if differing:
                key = differing[0]
                raise ValueError(
                    f"`store` {str(self.path)!r} was made by another sweep: its {key} is {old.get(key, 'absent')}, "
                    f"this one's is {new.get(key, 'absent')}"
                    + (f" (and {len(differing) - 1} more differ)" if len(differing) > 1 else "")
                    + f"; {advice}."
                )

    def _read_finished(self) -> np.ndarray:
        return self.group["outcome"][...].reshape(-1) != NOT_RUN

    def keep(self, start: int, stop: int, result: dict[str, np.ndarray]) -> None:
        """Write a chunk; `outcome`, the last of the plan's variables, marks it as finished."""
        low = np.unravel_index(start, self.axes.shape)
        high = np.unravel_index(stop - 1, self.axes.shape)
        region = tuple(slice(a, b + 1) for a, b in zip(low, high))
        box = tuple(b - a + 1 for a, b in zip(low, high))
        for name in self.plan.variables:
            values = result[name]
            self.group[name][region] = values.reshape(*box, *values.shape[1:])
        self._finished[start:stop] = True

    def dataset(self) -> Any:
        """The whole sweep, read into memory."""
        arrays = empty_arrays(self.plan, self.axes)
        for name in arrays:
            arrays[name][:] = self.group[name][...].reshape(arrays[name].shape)
        return make_dataset(self.plan, self.axes, arrays)


def _stored(dtype: Any) -> Any:
    return str if np.dtype(dtype).kind in "OT" else dtype


def _plain(attrs: dict[str, Any]) -> dict[str, Any]:
    return {k: [int(i) for i in v] if isinstance(v, list) else v for k, v in attrs.items()}
