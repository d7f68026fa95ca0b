"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a number takes one, an array its
address and shape, a Bundle inside it all of its own. To a kernel `bundle.x` is an ordinary array (bundle.py); the
Python object keeps the memory alive.
"""

from __future__ import annotations

import math
import struct

import numpy as np

_DTYPES = {
    "f8": np.dtype(np.float64),
    "i8": np.dtype(np.int64),
    "i1": np.dtype(np.int8),
    "b1": np.dtype(np.bool_),
}
_FLOAT, _WORD = struct.Struct("d").pack, struct.Struct("q").unpack
_LINE = 64  # bytes of a cache line: a vector of eight that begins elsewhere lies across two of them


class _Number:
    """A scalar field: kernels write it too, so it is read where it stands."""

    def __init__(self, at, code):
        self.at, self.kind = at, code

    def __get__(self, bundle, owner=None):
        if bundle is None:
            return self
        cell = self.cell(bundle)
        return int(cell[0]) if self.kind == "int" else float(cell[0])

    def __set__(self, bundle, value):
        self.cell(bundle)[0] = value

    def cell(self, bundle):
        """The field as an array of one element."""
        part = bundle.cells[self.at : self.at + 1]
        return part if self.kind == "int" else part.view(np.float64)


def _product(term, sizes):
    """A size such as "3*m": numbers and names of sizes."""
    return math.prod(int(f) if f.isdecimal() else sizes[f] for f in map(str.strip, term.split("*")))


class Bundle:
    """Base of the structs in state.py and work.py.

    An annotation is "int", "float", an array's element and shape such as "f8[m + ne, 3]", whose sizes have names
    (only their number binds, but for `zeros`), or another Bundle. Numbers that are not given begin at 0.
    """

    layout: tuple  # (name, "int" | "float" | element and rank such as "f8[2]" | Bundle) of every field
    shapes: dict  # what stands in the brackets, split at the commas
    size: int  # cells

    def __init_subclass__(cls):
        layout, cls.shapes, cls.size = [], {}, 0
        for name, code in cls.__annotations__.items():
            if isinstance(code, type):
                width = code.size
            elif code in ("int", "float"):
                width = 1
                setattr(cls, name, _Number(cls.size, code))
            else:
                cls.shapes[name] = code[3:-1].split(",")
                width = 1 + len(cls.shapes[name])
                code = f"{code[:2]}[{width - 1}]"
            layout.append((name, code))
            cls.size += width
        cls.layout = tuple(layout)

    def __init__(self, **values):
        cells, parts = [], []
        for name, code in self.layout:
            if code == "int":
                cells.append(values.pop(name, 0))
            elif code == "float":
                cells += _WORD(_FLOAT(values.pop(name, 0.0)))
            elif isinstance(code, type):
                parts.append((len(cells), values[name]))
                cells += values[name].cells.tolist()
                setattr(self, name, values.pop(name))
            else:
                value = np.ascontiguousarray(values.pop(name), _DTYPES[code[:2]])
                if value.ndim != int(code[3]):
                    raise TypeError(f"{type(self).__name__}.{name} has rank {value.ndim}, declared {code}.")
                cells += [value.ctypes.data, *value.shape]
                setattr(self, name, value)
        if values:
            raise TypeError(f"{type(self).__name__} has no fields {', '.join(values)}.")
        self.cells = np.array(cells, np.int64)
        self.address = self.cells.ctypes.data
        for at, part in parts:
            # One memory: what the kernels write is read there.
            part.cells, part.address = self.cells[at : at + part.size], self.address + 8 * at

    @classmethod
    def zeros(cls, sizes, **values):
        """With zeros for every array that is not given, its shape told by the `sizes` that its annotation names.

        They begin on cache lines.
        """
        for name, code in cls.layout:
            if name in values:
                continue
            if isinstance(code, type):
                values[name] = code.zeros(sizes)
            elif name in cls.shapes:
                shape = [sum(_product(term, sizes) for term in s.split("+")) for s in cls.shapes[name]]
                values[name] = on_cache_lines(np.zeros(shape, _DTYPES[code[:2]]))
        return cls(**values)

    @classmethod
    def in_one_block(cls, shapes, least=0, **others):
        """With uninitialised arrays of these shapes in one `block` of at least `least` bytes, and other fields."""
        codes, places, size = dict(cls.layout), {}, 0
        for name, shape in shapes.items():
            dtype = _DTYPES[codes[name][:2]]
            places[name] = shape, dtype, size
            size += -(-math.prod(shape) * dtype.itemsize // 8) * 8
        block = np.empty(max(size, least), np.uint8)
        made = cls(**{name: np.ndarray(s, d, block, at) for name, (s, d, at) in places.items()}, **others)
        made.block = block
        return made

    def changed(self, **values):
        """Another one with some fields replaced."""
        return type(self)(**{name: getattr(self, name) for name, _ in type(self).layout} | values)

    def scalar(self, name):
        """A number as an array of one element on its own memory."""
        return getattr(type(self), name).cell(self)


def on_cache_lines(values):
    """A copy that begins on a cache line."""
    room = np.empty(values.nbytes + _LINE, np.uint8)
    begin = -room.ctypes.data % _LINE
    copy = room[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    copy[...] = values
    return copy
