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


class Bundle:
    """Base of the structs in state.py; an annotation is "int", "float" or an element's code with "[rank]"."""

    fields: tuple[tuple[str, str], ...]

    def __init_subclass__(cls):
        cls.fields = tuple(cls.__annotations__.items())

    def __init__(self, **values):
        cells = []
        for name, code in self.fields:
            value = values.pop(name)
            if code == "int":
                cells.append(value)
            elif code == "float":
                cells += _WORD(_FLOAT(value))
            else:
                value = np.ascontiguousarray(value, _DTYPES[code[:2]])
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
        codes, places, size = dict(cls.fields), {}, 0
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
        return type(self)(**{name: getattr(self, name) for name, _ in type(self).fields} | values)

    def scalar(self, name):
        """A "float" as an array of one element on its own memory."""
        at = 0
        for field, code in type(self).fields:
            if field == name:
                return self.cells[at : at + 1].view(np.float64)
            at += 1 if code in ("int", "float") else 1 + int(code[3])
        raise KeyError(name)
