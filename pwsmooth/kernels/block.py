"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a scalar takes one, an array its
address and shape, a bare pointer its address. To a kernel `bundle.x` is an ordinary array, or a pointer (bundle.py);
the Python object keeps the memory alive.
"""

from __future__ import annotations

import functools
import math

import numpy as np

NUMBERS = ("int", "float")
_DTYPES = {
    "f8": np.dtype(np.float64),
    "i8": np.dtype(np.int64),
    "i1": np.dtype(np.int8),
    "b1": np.dtype(np.bool_),
}


def _new(size):
    return np.empty(size, np.uint8)


def rank(code):
    """Of an array; 0 of a number and of a bare pointer, which have no shape in the cells."""
    return int(code[3]) if code.endswith("]") else 0


class _Number:
    """A scalar field: kernels write it too, so it is read where it stands."""

    def __init__(self, at, code):
        self.at, self.cells = at, "cells" if code == "int" else "floats"

    def __get__(self, bundle, owner=None):
        return self if bundle is None else getattr(bundle, self.cells).item(self.at)

    def __set__(self, bundle, value):
        getattr(bundle, self.cells)[self.at] = value

    def cell(self, bundle):
        """The field as an array of one element."""
        return getattr(bundle, self.cells)[self.at : self.at + 1]


class Bundle:
    """Base of the structs in state.py; an annotation is "int", "float" or an element's code with "[rank]" or "*".

    Numbers that are not given begin at 0.
    """

    layout: tuple[tuple[str, str], ...]
    first_cell: dict[str, int]  # of each field
    _places: dict[str, tuple] = {}  # in the block: shape, dtype and offset of each array

    def __init_subclass__(cls):
        cls.layout, cls.first_cell, at = tuple(cls.__annotations__.items()), {}, 0
        for name, code in cls.layout:
            cls.first_cell[name] = at
            if code in NUMBERS:
                setattr(cls, name, _Number(at, code))
            at += 1 + rank(code)
        cls._blank = np.zeros(at, np.int64)
        cls._arrays = {name: code for name, code in cls.layout if code not in NUMBERS}

    def __init__(self, **values):
        self._write(self._blank.copy(), values)

    @classmethod
    def in_one_block(cls, zero, undefined, memory=_new, **others):
        """With arrays of these shapes, at 0 or undefined, in one `block` of `memory(bytes)`, and other fields.

        Python's arrays are made when they are first looked at: most are the kernels' alone, and runs are short.
        """
        places, cells, addresses, zeros, size = _placed(cls, tuple(zero.items()), tuple(undefined.items()))
        made = cls.__new__(cls)
        made.block, made._places = memory(size), places
        made.block[:zeros] = 0
        cells = cells.copy()
        cells[addresses] += made.block.ctypes.data
        made._write(cells, others)
        return made

    def _write(self, cells, values):
        self.cells, self.floats, self.address = cells, cells.view(np.float64), cells.ctypes.data
        absent = self._arrays.keys() - values.keys() - self._places.keys()
        unknown = values.keys() - self.first_cell.keys()
        if absent or unknown:
            raise TypeError(
                f"{type(self).__name__} needs {sorted(absent)} and does not know {sorted(unknown)}."
            )
        for name, value in values.items():
            code = self._arrays.get(name)
            if code is not None:
                value = np.ascontiguousarray(value, _DTYPES[code[:2]])
                if code.endswith("]") and value.ndim != rank(code):
                    raise TypeError(f"{type(self).__name__}.{name} has rank {value.ndim}, declared {code}.")
                at = self.first_cell[name]
                cells[at : at + 1 + rank(code)] = value.ctypes.data, *value.shape[: rank(code)]
            setattr(self, name, value)

    def __getattr__(self, name):
        if name not in self._places:
            raise AttributeError(f"{type(self).__name__} has no field {name}.")
        shape, dtype, at = self._places[name]
        array = self.__dict__[name] = np.ndarray(shape, dtype, self.block, at)
        return array

    def changed(self, **values):
        """Another one with some fields replaced."""
        return type(self)(**{name: getattr(self, name) for name, _ in type(self).layout} | values)

    def scalar(self, name):
        """A number as an array of one element on its own memory."""
        return getattr(type(self), name).cell(self)


@functools.lru_cache(maxsize=256)
def _placed(cls, zero, undefined):
    """Where arrays of these shapes stand in a block, the cells for a block at address 0, which of these are addresses,
    and the bytes to be zeroed and in all."""
    places, cells, addresses, size, zeros = {}, cls._blank.copy(), [], 0, 0
    for shapes in (zero, undefined):
        zeros = size
        for name, shape in shapes:
            dtype, at = _DTYPES[cls._arrays[name][:2]], cls.first_cell[name]
            places[name] = shape, dtype, size
            cells[at : at + 1 + rank(cls._arrays[name])] = size, *shape[: rank(cls._arrays[name])]
            addresses.append(at)
            size += -(-math.prod(shape) * dtype.itemsize // 8) * 8
    return places, cells, addresses, zeros, size
