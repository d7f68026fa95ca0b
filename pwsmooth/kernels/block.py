"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a scalar takes one, an array its
address and shape, a bare pointer its address. To a kernel `bundle.x` is an ordinary array, or a pointer (bundle.py);
the Python object keeps the memory alive.
"""

from __future__ import annotations

import ctypes
import math
from typing import NamedTuple

import numpy as np

NUMBERS = ("int", "float")
_DTYPES = {
    "f8": np.dtype(np.float64),
    "i8": np.dtype(np.int64),
    "i1": np.dtype(np.int8),
    "b1": np.dtype(np.bool_),
}


def rank(code):
    """Of an array; 0 of a number and of a bare pointer, which have no shape in the cells."""
    return int(code[3]) if code.endswith("]") else 0


def _address(array):
    if not array.size:
        return 0
    # `array.ctypes.data` takes twice as long, which short runs would notice.
    return ctypes.addressof(ctypes.c_char.from_buffer(array)) if array.flags.writeable else array.ctypes.data


class _Number:
    """A scalar field: kernels write it too, so it is read where it stands."""

    def __init__(self, name, code, at):
        self.code, self.at, self.cells = code, at, "cells" if code == "int" else "floats"

    def __get__(self, bundle, owner=None):
        return self if bundle is None else getattr(bundle, self.cells).item(self.at)

    def __set__(self, bundle, value):
        getattr(bundle, self.cells)[self.at] = value

    give = __set__

    def cell(self, bundle):
        """The field as an array of one element."""
        return getattr(bundle, self.cells)[self.at : self.at + 1]


class _Array:
    """An array, or a bare pointer to one. In a block it is made when Python first looks at it: most are the kernels'
    alone, and runs are short."""

    def __init__(self, name, code, at):
        self.name, self.code, self.at, self.dtype = name, code, at, _DTYPES[code[:2]]

    def __get__(self, bundle, owner=None):
        if bundle is None:
            return self
        shape, offset = bundle.places[self.name]
        array = bundle.__dict__[self.name] = np.ndarray(shape, self.dtype, bundle.block, offset)
        return array

    def give(self, bundle, value):
        """An array of its own."""
        array = bundle.__dict__[self.name] = np.ascontiguousarray(value, self.dtype)
        self.write(bundle.cells, _address(array), array.shape)

    def write(self, cells, address, shape):
        """Its address and what the cells keep of its shape."""
        cells[self.at] = address
        if self.code.endswith("]"):
            if len(shape) != rank(self.code):
                raise TypeError(f"{self.name} has rank {len(shape)}, declared {self.code}.")
            cells[self.at + 1 : self.at + 1 + len(shape)] = shape


class Plan(NamedTuple):
    """How arrays of a Bundle share a block."""

    places: dict  # shape and offset of each
    cells: np.ndarray  # with the block at address 0
    addresses: np.ndarray  # which of the cells are
    zeros: int  # bytes that are 0 in the beginning
    size: int  # in bytes
    others: set  # arrays that are not in the block


class Bundle:
    """Base of the structs in state.py; an annotation is "int", "float" or an element's code with "[rank]" or "*".

    Numbers that are not given begin at 0.
    """

    members: dict[str, _Number | _Array]
    blank: np.ndarray  # cells
    plain: Plan

    def __init_subclass__(cls):
        cls.members, at = {}, 0
        for name, code in cls.__annotations__.items():
            cls.members[name] = (_Number if code in NUMBERS else _Array)(name, code, at)
            setattr(cls, name, cls.members[name])
            at += 1 + rank(code)
        cls.blank = np.zeros(at, np.int64)
        cls.plain = cls.planned({}, {})

    def __init__(self, **values):
        self._begin(self.plain, self.plain.cells.copy(), values)

    @classmethod
    def planned(cls, zero, undefined):
        """The Plan for arrays of these shapes, which begin at 0 or undefined."""
        cells, places, size, zeros = cls.blank.copy(), {}, 0, 0
        for shapes in (zero, undefined):
            zeros = size
            for name, shape in shapes.items():
                array = cls.members[name]
                array.write(cells, size, shape)
                places[name] = shape, size
                size += -(-math.prod(shape) * array.dtype.itemsize // 8) * 8
        addresses = np.array([cls.members[name].at for name in places], np.int64)
        others = {name for name, member in cls.members.items() if type(member) is _Array and name not in places}
        return Plan(places, cells, addresses, zeros, size, others)

    @classmethod
    def in_one_block(cls, plan, memory=None, **values):
        """With the planned arrays in one `block` of `memory(bytes)`, new by default, and other fields."""
        made = cls.__new__(cls)
        block = made.block = memory(plan.size) if memory else np.empty(plan.size, np.uint8)
        block[: plan.zeros] = 0
        cells = plan.cells.copy()
        cells[plan.addresses] += _address(block)
        made._begin(plan, cells, values)
        return made

    def _begin(self, plan, cells, values):
        self.places, self.cells, self.floats = plan.places, cells, cells.view(np.float64)
        self.address = _address(cells)
        members = self.members
        if not (plan.others <= values.keys() <= members.keys()):
            wrong = sorted(plan.others - values.keys()), sorted(values.keys() - members.keys())
            raise TypeError("{} needs {} and has no {}.".format(type(self).__name__, *wrong))
        for name, value in values.items():
            members[name].give(self, value)

    def changed(self, **values):
        """Another one with some fields replaced."""
        return type(self)(**{name: getattr(self, name) for name in self.members} | values)

    def scalar(self, name):
        """A number as an array of one element on its own memory."""
        return self.members[name].cell(self)
