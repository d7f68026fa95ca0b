"""The wire format: one binary frame is a JSON header and the arrays that it names.

    uint32 length of the header | header, padded to 4 | array | array | ...

Each array is float32, uint8, int8 or int32 (uint16 of its range in files), padded to 4 bytes; the header lists (name,
type, shape) of all. Where the span of an array is below 1e-4 of its place float32 would not resolve it: its offset
travels in the header then.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

TYPES: dict[str, Any] = {
    "f": np.dtype("<f4"),
    "b": np.dtype("u1"),
    "c": np.dtype("i1"),
    "i": np.dtype("<i4"),
    "h": np.dtype("<u2"),
}
_STEPS = 65535
_NARROW = 1e-4  # span by place, below which an offset is taken off


def pack(header: Mapping[str, Any], arrays: Mapping[str, Any] | None = None, *, short: bool = False) -> bytes:
    """A frame; floats become float32, bool uint8, integers of one byte stay, others become int32.

    `short`: floats become 16 bits of each one's range, its last one standing for nan.
    """
    listed, parts = [], []
    for name, values in (arrays or {}).items():
        values = np.asarray(values)
        entry: dict[str, Any] = {"name": name}
        if values.dtype.kind == "f" and short:
            finite = values[np.isfinite(values)]
            low = float(finite.min()) if finite.size else 0.0
            scale = (float(finite.max()) - low) / (_STEPS - 1) if finite.size else 0.0
            entry |= {"offset": low, "scale": scale or 1.0}
            values = np.where(np.isfinite(values), np.rint((values - low) / (scale or 1.0)), _STEPS)
            kind = "h"
        elif values.dtype.kind == "f":
            finite = values[np.isfinite(values)]
            if finite.size and np.ptp(finite) < _NARROW * np.abs(finite).max():
                entry["offset"] = float(finite[0])
                values = values - finite[0]
            kind = "f"
        else:
            kind = "c" if values.dtype == np.int8 else "b" if values.dtype.itemsize == 1 else "i"
        with np.errstate(over="ignore"):  # beyond float32, and beyond any picture
            raw = np.ascontiguousarray(values).astype(TYPES[kind], casting="unsafe").tobytes()
        listed.append(entry | {"type": kind, "shape": list(values.shape)})
        parts.append(raw + bytes(-len(raw) % 4))
    text = json.dumps(_finite({**header, "arrays": listed}), separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<I", len(text)), text, *parts])


def unpack(frame: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """(header, arrays) of a frame, as the page reads it."""
    (length,) = struct.unpack_from("<I", frame)
    header = json.loads(frame[4 : 4 + length])
    at, arrays = 4 + length, {}
    for entry in header.pop("arrays"):
        kind, count = TYPES[entry["type"]], math.prod(entry["shape"])
        values = np.frombuffer(frame, kind, count, at).reshape(entry["shape"])
        if entry["type"] == "h":
            arrays[entry["name"]] = np.where(
                values == _STEPS, np.nan, entry["offset"] + entry["scale"] * values
            )
        else:
            arrays[entry["name"]] = values + entry["offset"] if "offset" in entry else values
        at += -(-count * kind.itemsize // 4) * 4
    return header, arrays


def _finite(item: Any) -> Any:
    """The same without nan and infinity, which JSON does not know: null."""
    if isinstance(item, float):
        return item if math.isfinite(item) else None
    if isinstance(item, Mapping):
        return {str(key): _finite(value) for key, value in item.items()}
    return [_finite(value) for value in item] if isinstance(item, (list, tuple)) else item
