"""A Solution as one file: a zip of arrays (.npy) and of a JSON text that holds all else.

The system is in it as a tree of names (definition/tree.py): opening a file runs nothing of it. `numpy.load` reads the
arrays, and any zip program the text.
Chain: Solution.save -> saving (here) -> System, records.
"""

from __future__ import annotations

import io
import json
import warnings
import zipfile
import zlib
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from ..definition import tree
from ..system import System
from .assembly import COLUMNS, Catalogue, Recorded
from .records import Ambiguity, Dense, EventLog, Outcome, StepPolynomials

_FORMAT = "pwsmooth solution"
_VERSION = 1
CALLER = 4  # how far up the code stands that has called `save`: it is behind a door
_TEXT = "solution.json"
_DAMAGES = zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError  # as zipfile tells them
_DENSE: dict[str, type] = {kind.__name__: kind for kind in (Dense, StepPolynomials)}


def pack(solution: Any) -> bytes:
    """The content of a file; TypeError or ValueError for what it cannot hold."""
    dense, events = solution.dense, list(solution.events)
    if dense is not None and type(dense) not in _DENSE.values():
        raise ValueError(
            "the dense output is SciPy's, which no file can hold; solve with one of the package's own methods, or with "
            "`t_eval` for the times that you need."
        )
    kinds: dict[tuple[str, str, str], int] = {}
    which = [kinds.setdefault((e.switch, e.kind, e.note), len(kinds)) for e in events]
    arrays = {name: getattr(solution, name) for name in ("t", "x", "mult", "status")}
    arrays |= {"event_t": np.array([e.time for e in events], float), "event_kind": np.array(which, np.int64)}
    impulses = [e.impulse or {} for e in events]
    if impulsive := sorted({name for impulse in impulses for name in impulse}):
        arrays["event_impulse"] = np.array([[i.get(name, np.nan) for name in impulsive] for i in impulses])
    if solution.course:
        arrays["course_t"], arrays["course_status"] = solution.course
    text = {
        "format": _FORMAT,
        "version": _VERSION,
        "system": tree.write(solution.system._written()),
        "parameters": solution.parameters,
        "outcome": solution.outcome.name,
        "backward": solution.backward,
        "cost": solution.cost,
        "tolerances": solution.tolerances,
        "event kinds": list(kinds),
        "impulses": impulsive,
        "ambiguities": [asdict(a) for a in solution.ambiguities],
        "noise": None if solution.noise is None else str(solution.noise),
        "dense": None,
    }
    if (kept := solution.recorded) is not None:
        arrays |= {"recorded_t": kept.t, **{f"recorded_x_{name}": rows for name, rows in kept.x.items()}}
        text["recorded"] = {"elements": kept.elements, "names": list(kept.x)}
    if (log := solution.catalogue) is not None:
        columns = {name: getattr(log, name) for name in COLUMNS} | {
            f"state {k}": v for k, v in log.states.items()
        }
        arrays |= {f"catalogue_{name}": _wide(column) for name, column in columns.items()}
        arrays["catalogue_links"] = _wide(log._links)
        text["catalogue"] = {"surfaces": log.surfaces, "states": list(log.states)}
    if dense is not None:
        held = {f.name: getattr(dense, f.name) for f in fields(dense)}
        arrays |= {f"dense_{name}": part for name, part in held.items() if isinstance(part, np.ndarray)}
        rest = {name: part for name, part in held.items() if not isinstance(part, np.ndarray)}
        text["dense"] = {"kind": type(dense).__name__, **rest}
    buffer = io.BytesIO()
    # Without times of writing: one solution is one content.
    with zipfile.ZipFile(buffer, "w") as file:
        for name, array in arrays.items():
            with file.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array), allow_pickle=False)
        file.writestr(zipfile.ZipInfo(_TEXT), json.dumps(text, default=np.generic.item), zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _wide(column: Any) -> np.ndarray:
    """A column of a catalogue, also of one on the disk, in the types of a file."""
    array = np.asarray(column[:])
    return array.astype(np.int64) if array.dtype.kind == "i" and array.dtype != np.int8 else array


def warn_of_what_is_left_out(solution: Any) -> None:
    """Names what the run was made for and no file holds."""
    lost = {
        "derivatives": solution.derived,
        "statistics": solution.statistics or None,
    }
    if names := [name for name, part in lost.items() if part is not None]:
        warnings.warn(
            f"the file holds no {', '.join(names)} of this solution; keep what you need of them as arrays, "
            "or solve again after `load`.",
            stacklevel=CALLER,
        )


def unpack(content: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arguments of a Solution and further attributes, its noise in words; ValueError for what `pack` did not give."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            # Each member is read to its end, where its checksum is compared.
            members = {name: file.read(name) for name in file.namelist()}
        text = json.loads(members.pop(_TEXT))
        if text["format"] != _FORMAT:
            raise ValueError(f"its format is {text['format']!r}")
        if text["version"] > _VERSION:
            raise ValueError(f"a later version of the package wrote it (format {text['version']})")
        arrays = {
            name.removesuffix(".npy"): np.lib.format.read_array(io.BytesIO(part), allow_pickle=False)
            for name, part in members.items()
        }
        if any(array.dtype not in (np.float64, np.int64, np.int8) for array in arrays.values()):
            raise ValueError("an array holds no numbers")
        return _arguments(text, arrays), {"noise": text["noise"], **_kept(text, arrays)}
    except KeyError as error:
        raise ValueError(f"it has no {error}") from None
    except (*_DAMAGES, TypeError, AttributeError, LookupError, ArithmeticError) as error:
        raise ValueError(str(error) or type(error).__name__) from None


def _arguments(text: dict[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    system = System._read(tree.read(text["system"]))
    t = arrays["t"]
    n, m = len(system.model.states), len(system.model.multipliers)
    rows = {"x": n, "mult": m, "status": m}
    _shaped(arrays, {"t": (len(t),), **{name: (count, len(t)) for name, count in rows.items()}})
    kinds = [tuple(kind) for kind in text["event kinds"]]
    event_t, which = arrays["event_t"], arrays["event_kind"]
    _shaped(arrays, {"event_t": (len(event_t),), "event_kind": (len(event_t),)})
    if which.size and not 0 <= which.min() <= which.max() < len(kinds):
        raise ValueError("it has events of no kind")
    course = None
    if "course_t" in arrays:
        course = arrays["course_t"], arrays["course_status"]
        _shaped(arrays, {"course_status": (m, len(course[0]))})
    dense = None
    if text["dense"] is not None:
        kind, rest = _DENSE[text["dense"]["kind"]], {k: v for k, v in text["dense"].items() if k != "kind"}
        parts = {name: part for name, part in arrays.items() if name.startswith("dense_")}
        steps = len(parts["dense_t0"])
        _shaped(parts, {name: (steps, *part.shape[1:]) for name, part in parts.items()})
        dense = kind(**{name.removeprefix("dense_"): part for name, part in parts.items()}, **rest)
    return {
        "system": system,
        **{name: arrays[name] for name in ("t", *rows)},
        "events": EventLog(
            event_t,
            np.stack([which, np.zeros_like(which)], axis=1),
            lambda i, _: kinds[i],
            _impulses(text["impulses"], arrays["event_impulse"]) if text.get("impulses") else None,
        ),
        "dense": dense,
        "outcome": Outcome[text["outcome"]],
        "cost": text["cost"],
        "tolerances": text["tolerances"],
        "ambiguities": [
            Ambiguity(**{**a, "continuations": tuple(a["continuations"])}) for a in text["ambiguities"]
        ],
        "parameters": text["parameters"],
        "course": course,
        "backward": bool(text.get("backward", False)),
    }


def _impulses(names: list[str], rows: np.ndarray) -> Any:
    """Index of an event -> its impulse."""
    return lambda i: {name: v for name, v in zip(names, rows[i].tolist()) if not np.isnan(v)} or None


def _kept(text: dict[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """What a Recorder has kept of the elements of a family, and the catalogue of their events."""
    found: dict[str, Any] = {}
    if of := text.get("recorded"):
        t, elements = arrays["recorded_t"], tuple(int(number) for number in of["elements"])
        rows = {name: arrays[f"recorded_x_{name}"] for name in of["names"]}
        _shaped(rows, dict.fromkeys(rows, (len(elements), len(t))))
        found["recorded"] = Recorded(t, elements, rows)
    if of := text.get("catalogue"):
        names = [*COLUMNS, *(f"state {name}" for name in of["states"])]
        columns = {name: arrays[f"catalogue_{name}"].astype(COLUMNS.get(name, "f8")) for name in names}
        _shaped(columns, dict.fromkeys(names, columns["t"].shape))
        links = arrays["catalogue_links"].astype(np.int32)
        found["catalogue"] = Catalogue(columns, of["surfaces"], of["states"], links)
    return found


def _shaped(arrays: dict[str, np.ndarray], shapes: dict[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"its `{name}` has the shape {arrays[name].shape} and not {shape}")
