"""What a sweep's store is on disk, and what of it is believed.

Files have the checksum of their codec, for other readers. Here counts, of every chunk, the sha256 of its values in the
array `chunk_sha256`; of the root's attributes and the coordinates, a sha256 among the attributes.

Chain: store.py writes it -> **this** reads it -> Dataset.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..door import checks
from .axes import Axes
from .contract import NOT_RUN

if TYPE_CHECKING:
    import xarray

SUMS, SUM_DIMS = "chunk_sha256", ("chunk_number", "sha256_byte")
EVERY_CHUNK = {"array.write_empty_chunks": True}  # a missing file is damage, and never means the fill value


@checks.door()
def read_store(path: Any) -> xarray.Dataset:
    """The Dataset in a store, whatever sweep and version of the package made it, finished or not.

    Parameters
    ----------
    path : str or Path
        Zarr directory of a sweep.

    Returns
    -------
    xarray.Dataset
        As of `sweep`. Points that have not run, or whose chunk is damaged, have the outcome -128.

    Raises
    ------
    ValueError, TypeError
        No path, no store of a sweep, or one whose description is damaged.

    Warns
    -----
    UserWarning
        A chunk is damaged; or the store was made before stores had checksums, so that damage would not be noticed.

    >>> x, k = sp.symbols("x k", positive=True)
    >>> path = tempfile.mkdtemp() + "/decay.zarr"
    >>> found = sweep(System({x: -k * x}, parameters={k: 1}), {"k": [0.5, 1.0]}, x0={"x": 1}, t_span=(0, 1),
    ...               measures=["counts"], work=Work(store=path))
    >>> read_store(path).identical(found)
    True
    """
    import xarray

    path = checks.path(path, "`path`")
    group, about = opened(path, "r")
    if "sha256" not in about:
        warnings.warn(
            f"the store {str(path)!r} was made before stores had checksums: damage to it cannot be noticed.",
            stacklevel=2,
        )
        return xarray.open_zarr(path, consolidated=False, chunks=None).load()
    for name in about["arrays"]:
        try:
            check_array(group, name, about)
        except Exception as error:
            raise _damaged(path, name, error) from error
    files = files_of(path, group, [*about["variables"], SUMS])
    outcome = files["outcome"]
    axes = Axes(outcome.metadata.dimension_names, outcome.shape, {}, {})
    arrays = {}
    for name in about["variables"]:
        file = files[name]
        dtype = np.dtypes.StringDType() if file.dtype.kind in "OT" else file.dtype
        arrays[name] = np.full((axes.size, *file.shape[outcome.ndim :]), file.fill_value, dtype)
    _, lost = read_chunks(files, arrays, axes.boxes(about["chunk"])[1], axes.shape)
    if lost:
        say_damage(path, lost, f"given as not run (outcome {NOT_RUN})")
    data = {
        name: (file.metadata.dimension_names, fixed_width(arrays[name].reshape(file.shape)), dict(file.attrs))
        for name, file in files.items()
        if name in arrays
    }
    coords = {}
    for name, file in files_of(path, group, about["coordinates"]).items():
        values = file[...]
        values = values.astype(object) if values.dtype.kind == "T" else values
        coords[name] = file.metadata.dimension_names, values, dict(file.attrs)
    return xarray.Dataset(data, coords, {name: about[name] for name in ("title", "identity", "versions")})


def zarr_itself() -> Any:
    checks.needs("zarr", "zarr>=3.1", "store", "`store`")
    import zarr

    return zarr


def opened(path: Path, mode: Any) -> tuple[Any, dict[str, Any]]:
    """Group and attributes of a store; one without a sha256 was made before stores had them."""
    zarr = zarr_itself()
    try:
        group = zarr.open_group(path, mode=mode)
        about = dict(group.attrs)
        before = "sha256" not in about and SUMS not in group
        told = [json.loads(about[name]) for name in ("identity", "versions") if name in about]
    except FileNotFoundError:
        raise ValueError(
            f"`store` {str(path)!r} is no store of a sweep: there is no zarr.json in it."
        ) from None
    except Exception as error:  # zarr raises whatever its parsers raise
        raise _damaged(path, "", error) from error
    if before and not (len(told) == 2 and isinstance(about.get("chunk"), int) and about["chunk"] > 0):
        raise ValueError(f"`store` {str(path)!r} is a Zarr group, but none of a sweep; give another path.")
    stated = about.pop("sha256", "")
    if not before and stated != sum_of_attributes(about):
        raise _damaged(path, "", "its checksum does not fit")
    return group, about if before else {**about, "sha256": stated}


def files_of(path: Path, group: Any, names: Any) -> dict[str, Any]:
    """Arrays of a store by name."""
    files = {}
    for name in names:
        try:
            files[name] = group[name]
        except Exception as error:
            raise _damaged(path, name, error) from error
    return files


def read_chunks(
    files: dict[str, Any], arrays: dict[str, np.ndarray], boxes: list[tuple[int, int]], shape: tuple[int, ...]
) -> tuple[list[bool], list[str]]:
    """Fill the arrays with every chunk that bears out its sum, and leave the others; which do, and what is damaged."""
    empty = {name: array[:1].copy() for name, array in arrays.items()}
    sums = {SUMS: np.zeros((len(boxes), 32), np.uint8)} if SUMS in files else {}
    why: dict[int, str] = {}
    for name, array in (arrays | sums).items():
        try:
            array[...] = files[name][...].reshape(array.shape)
        except Exception:  # of one chunk at least: one by one, then
            for i, box in enumerate(boxes):
                own, region = slice(*box), region_of(box, shape)
                if name == SUMS:
                    own, region = slice(i, i + 1), (slice(i, i + 1),)
                try:
                    array[own] = files[name][region].reshape(array[own].shape)
                except Exception as error:
                    at = [s.start // c for s, c in zip(region, files[name].chunks)]
                    at += [0] * (files[name].ndim - len(at))
                    why.setdefault(i, f"{name}/c/{'/'.join(map(str, at))}: {type(error).__name__}: {error}")
    sound, damaged = [], []
    for i, (start, stop) in enumerate(boxes):
        stated = sums[SUMS][i].tobytes() if sums else None  # a store of before has none
        sound.append(i not in why and stated in (None, sum_of_chunk(arrays, start, stop)))
        if not sound[i]:
            if i in why or sums[SUMS][i].any() or (arrays["outcome"][start:stop] != NOT_RUN).any():
                damaged.append(f"points {start} to {stop - 1}: {why.get(i, f'not what {SUMS}/c/{i}/0 says')}")
            for name, array in arrays.items():
                array[start:stop] = empty[name]
    return sound, damaged


def region_of(box: tuple[int, int], shape: tuple[int, ...]) -> tuple[slice, ...]:
    """The box of the grid that a chunk is."""
    low, high = np.unravel_index(box[0], shape), np.unravel_index(box[1] - 1, shape)
    return tuple(slice(int(a), int(b) + 1) for a, b in zip(low, high))


def check_array(group: Any, name: str, about: dict[str, Any]) -> None:
    """Raises if an array's description, or a coordinate, is not what the attributes say."""
    file = group[name]
    if sum_of_array(file, file[...] if name in about["coordinates"] else None) != about["arrays"][name]:
        raise ValueError("its checksum does not fit")


def sum_of_array(file: Any, values: Any) -> str:
    """sha256 of the description of an array, and of the values of a coordinate."""
    kind = "text" if file.dtype.kind in "OT" else file.dtype.str
    names = file.metadata.dimension_names
    words = [file.shape, file.chunks, kind, str(file.fill_value), names, dict(file.attrs)]
    total = _sum([] if values is None else [values])
    total.update(json.dumps(words, sort_keys=True).encode())
    return total.hexdigest()


def _sum(arrays: Any) -> Any:
    """sha256 of arrays, equal on every machine."""
    total = hashlib.sha256()
    for array in arrays:
        if array.dtype.kind in "OTU":
            total.update(json.dumps(array.tolist()).encode())
        else:
            total.update(np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes())
    return total


def sum_of_chunk(arrays: dict[str, np.ndarray], start: int, stop: int) -> bytes:
    total = _sum(arrays[name][start:stop] for name in sorted(arrays))
    total.update(f"{start} {stop}".encode())  # one chunk is not taken for another
    return total.digest()


def sum_of_attributes(about: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()


# ---- words ----


@contextlib.contextmanager
def explained(path: Path, what: str, remedy: str) -> Any:
    """An OSError inside names the store and the remedy."""
    try:
        yield
    except OSError as error:
        raise OSError(
            error.errno, f"`store` {str(path)!r} cannot {what}: {error.strerror or error}; {remedy}"
        ) from error


def _damaged(path: Path, name: str, why: Any) -> ValueError:
    why = f"{type(why).__name__}: {why}" if isinstance(why, Exception) else why
    return ValueError(
        f"`store` {str(path)!r} is damaged at {Path(name, 'zarr.json')}: {why}; restore it from a copy, or remove the "
        "store to run its sweep anew."
    )


def say_damage(path: Path, damaged: list[str], fate: str) -> None:
    more = f" (and {len(damaged) - 1} more)" if len(damaged) > 1 else ""
    warnings.warn(f"`store` {str(path)!r}: damaged, and {fate}: {damaged[0]}{more}.", stacklevel=4)


def fixed_width(values: np.ndarray) -> np.ndarray:
    """Text of fixed width, which every tool around xarray reads; numbers as they are."""
    if not isinstance(values.dtype, np.dtypes.StringDType):
        return values
    return values.astype(f"U{max(1, int(np.strings.str_len(values).max()))}")
