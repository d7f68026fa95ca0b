"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a scalar takes one, an array its
address and shape. To a kernel `bundle.x` is an ordinary array (bundle.py); the Python object keeps the memory alive.
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


class Bundle:
    """Base of the structs in state.py; an annotation is "int", "float" or an element's code with "[rank]".

    Numbers that are not given begin at 0.
    """

    layout: tuple[tuple[str, str], ...]

    def __init_subclass__(cls):
        cls.layout = tuple(cls.__annotations__.items())
        at = 0
        for name, code in cls.layout:
            if code in ("int", "float"):
                setattr(cls, name, _Number(at, code))
            at += 1 if code in ("int", "float") else 1 + int(code[3])

    def __init__(self, **values):
        cells = []
        for name, code in self.layout:
            if code == "int":
                cells.append(values.pop(name, 0))
            elif code == "float":
                cells += _WORD(_FLOAT(values.pop(name, 0.0)))
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
