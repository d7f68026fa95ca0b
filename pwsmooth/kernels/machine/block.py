"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a number takes one, an array its
address and shape, a bare pointer its address, a Bundle inside it all of its own. To a kernel `bundle.x` is an ordinary
array, or a pointer (bundle.py); the Python object keeps the memory alive.
"""

from __future__ import annotations

import ctypes
import functools
import math
from typing import NamedTuple

import numpy as np

_DTYPES = {
    "f8": np.dtype(np.float64),
    "i8": np.dtype(np.int64),
    "i4": np.dtype(np.int32),
    "i1": np.dtype(np.int8),
    "b1": np.dtype(np.bool_),
}
_LINE = 64  # bytes of a cache line: a vector of eight that begins elsewhere lies across two of them


def _address(array):
    if not array.size:
        return 0
    # `array.ctypes.data` takes twice as long, which short runs would notice.
    return ctypes.addressof(ctypes.c_char.from_buffer(array)) if array.flags.writeable else array.ctypes.data


class Number:
    """A scalar field: kernels write it too, so it is read where it stands."""

    width = 1  # cells

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


class Array:
    """An array, or a bare pointer to one. In a block it is made when Python first looks at it: most are the kernels'
    alone, and runs are short."""

    def __init__(self, name, code, at):
        element, _, shape = code.partition("[")
        self.name, self.at, self.pointer, self.element = name, at, element.endswith("*"), element[:2]
        self.dtype, self.shape = _DTYPES[self.element], [size.strip() for size in shape[:-1].split(",")]
        self.rank = len(self.shape)
        self.width = 1 if self.pointer else 1 + self.rank

    def __get__(self, bundle, owner=None):
        if bundle is None:
            return self
        shape, offset = bundle.places[self.name]
        array = bundle.__dict__[self.name] = np.ndarray(shape, self.dtype, bundle.block, offset)
        return array

    def give(self, bundle, value):
        """An array of its own."""
        array = bundle.__dict__[self.name] = np.ascontiguousarray(value, self.dtype)
        if array.ndim != self.rank:
            raise TypeError(f"{self.name} has rank {array.ndim}, declared {self.rank}.")
        self.write(bundle.cells, _address(array), array.shape)

    def write(self, cells, address, shape):
        """Its address and what the cells keep of its shape."""
        cells[self.at] = address
        cells[self.at + 1 : self.at + self.width] = shape[: self.width - 1]

    def extents(self, sizes):
        """Its shape where the names in its declaration stand for `sizes`; None where one is not among them."""
        try:
            return tuple(sum(_product(term, sizes) for term in size.split("+")) for size in self.shape)
        except KeyError:
            return None


def _product(term, sizes):
    """A size such as "3*m": numbers and names of sizes."""
    return math.prod(int(f) if f.isdecimal() else sizes[f] for f in map(str.strip, term.split("*")))


class Part:
    """A Bundle inside another one, on the cells of that."""

    def __init__(self, name, struct, at):
        self.name, self.struct, self.at, self.width = name, struct, at, len(struct.blank)

    def give(self, bundle, value):
        place = bundle.cells[self.at : self.at + self.width]
        place[:] = value.cells
        value.stand_on(place)
        bundle.__dict__[self.name] = value


class Plan(NamedTuple):
    """How arrays of a Bundle share a block."""

    places: dict  # shape and offset of each
    cells: np.ndarray  # with the block at address 0
    addresses: np.ndarray  # which of the cells are
    zeros: int  # bytes that are 0 in the beginning
    size: int  # in bytes
    others: set  # fields that must be given


class Bundle:
    """Base of the structs in state.py, work.py and their like.

    An annotation is "int", "float", an array's element and shape such as "f8[m + ne, 3]", the same as a bare pointer,
    "f8*[n, 8]", or another Bundle. Sizes are sums of products of numbers and names; ":" is a size that only an array
    that is given tells (0 if none is). Numbers that are not given begin at 0.
    """

    members: dict[str, Number | Array | Part]
    blank: np.ndarray  # cells
    plain: Plan

    def __init_subclass__(cls):
        cls.members, at = {}, 0
        for name, code in cls.__annotations__.items():
            kind = Part if isinstance(code, type) else Number if code in ("int", "float") else Array
            cls.members[name] = kind(name, code, at)
            setattr(cls, name, cls.members[name])
            at += cls.members[name].width
        cls.blank = np.zeros(at, np.int64)
        cls.plain = cls.planned({})

    def __init__(self, **values):
        self._begin(self.plain, self.plain.cells.copy(), values)

    @classmethod
    def planned(cls, sizes, undefined=(), given=()):
        """The Plan for all arrays whose shapes these sizes tell, each on cache lines; they begin at 0, or undefined.

        What is `given` has memory of its own.
        """
        return _planned(cls, tuple(sizes.items()), tuple(undefined), tuple(given))

    @classmethod
    def in_one_block(cls, plan, memory=None, **values):
        """With the planned arrays in one `block` of `memory(bytes)`, new by default, and other fields."""
        made = cls.__new__(cls)
        room = memory(plan.size + _LINE) if memory else np.empty(plan.size + _LINE, np.uint8)
        begin = -_address(room) % _LINE
        block = made.block = room[begin : begin + plan.size]
        block[: plan.zeros] = 0
        cells = plan.cells.copy()
        cells[plan.addresses] += _address(block)
        made._begin(plan, cells, values)
        return made

    @classmethod
    def zeros(cls, sizes, **values):
        """With zeros where nothing is given, in the Bundles inside as well."""
        sizes = {":": 0, **sizes}
        plan = cls.planned(sizes, given=values)
        for name in plan.others - values.keys():
            values[name] = cls.members[name].struct.zeros(sizes)
        return cls.in_one_block(plan, **values)

    def _begin(self, plan, cells, values):
        self.places = plan.places
        self.stand_on(cells)
        members = self.members
        if not (plan.others <= values.keys() <= members.keys()):
            wrong = sorted(plan.others - values.keys()), sorted(values.keys() - members.keys())
            raise TypeError("{} needs {} and has no {}.".format(type(self).__name__, *wrong))
        for name, value in values.items():
            members[name].give(self, value)

    def stand_on(self, cells):
        """Makes these cells, which hold what its own do, its memory: what the kernels write there is read."""
        self.cells, self.floats, self.address = cells, cells.view(np.float64), _address(cells)

    def changed(self, **values):
        """Another one with some fields replaced."""
        return type(self)(**{name: getattr(self, name) for name in self.members} | values)

    def scalar(self, name):
        """A number as an array of one element on its own memory."""
        return self.members[name].cell(self)


@functools.lru_cache(maxsize=256)
def _planned(cls, sizes, undefined, given):
    sizes = dict(sizes)
    cells, places, size, zeros = cls.blank.copy(), {}, 0, 0
    arrays = [(name, m) for name, m in cls.members.items() if isinstance(m, Array) and name not in given]
    for late in (False, True):
        zeros = size
        for name, array in arrays:
            shape = array.extents(sizes)
            if shape is not None and late == (name in undefined):
                array.write(cells, size, shape)
                places[name] = shape, size
                size += -(-math.prod(shape) * array.dtype.itemsize // _LINE) * _LINE
    addresses = np.array([cls.members[name].at for name in places], np.int64)
    others = {name for name, m in cls.members.items() if not isinstance(m, Number) and name not in places}
    return Plan(places, cells, addresses, zeros, size, others)
