"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a scalar takes one, an array its
address and shape. To a kernel `bundle.x` is an ordinary array; the Python object keeps the memory alive.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array

_SCALARS = {"int": types.int64, "float": types.float64}
_ELEMENTS = {"f8": types.float64, "i8": types.int64, "i1": types.int8, "b1": types.boolean}


class BundleType(types.Type):
    """numba's type of a Bundle; `fields` holds (name, "int" | "float" | element code + "[rank]")."""

    def __init__(self, name, fields):
        self.fields = fields
        super().__init__(name=f"Bundle({name}: {fields})")

    def resolve(self, name):
        """(cell of the field, its numba type), or None."""
        cell = 0
        for field, code in self.fields:
            rank = 0 if code in _SCALARS else int(code[3])
            if field == name:
                return cell, (types.Array(_ELEMENTS[code[:2]], rank, "C") if rank else _SCALARS[code])
            cell += 1 + rank
        return None


register_model(BundleType)(models.OpaqueModel)


class Bundle:
    """Base of the structs in state.py, whose annotations are the fields' codes."""

    numba_type: BundleType
    fields: tuple[tuple[str, str], ...]

    def __init_subclass__(cls):
        cls.fields = tuple(cls.__annotations__.items())
        cls.numba_type = BundleType(cls.__name__, cls.fields)

    def __init__(self, **values):
        cells = []
        for name, code in self.fields:
            value = values.pop(name)
            if code in _SCALARS:
                cells.append(np.float64(value).view(np.int64) if code == "float" else np.int64(value))
            else:
                dtype = {"f8": np.float64, "i8": np.int64, "i1": np.int8, "b1": np.bool_}[code[:2]]
                value = np.ascontiguousarray(value, dtype)
                if value.ndim != int(code[3]):
                    raise TypeError(f"{type(self).__name__}.{name} has rank {value.ndim}, declared {code}.")
                cells += [value.ctypes.data, *value.shape]
            setattr(self, name, value)
        if values:
            raise TypeError(f"{type(self).__name__} has no fields {', '.join(values)}.")
        self.cells = np.array(cells, np.int64)
        self.address = self.cells.ctypes.data


@typeof_impl.register(Bundle)
def _typeof(value, c):
    return value.numba_type


@unbox(BundleType)
def _unbox(typ, obj, c):
    address = c.pyapi.object_getattr_string(obj, "address")
    number = c.pyapi.long_as_longlong(address)
    c.pyapi.decref(address)
    return NativeValue(c.builder.inttoptr(number, cgutils.voidptr_t))


@infer_getattr
class _Attributes(AttributeTemplate):
    key = BundleType

    def generic_resolve(self, typ, attr):
        found = typ.resolve(attr)
        return found and found[1]


@lower_getattr_generic(BundleType)
def _getattr(context, builder, typ, value, attr):
    cell, kind = typ.resolve(attr)
    word = ir.IntType(64)
    cells = builder.bitcast(value, word.as_pointer())

    def load(k):
        return builder.load(builder.gep(cells, [ir.Constant(word, cell + k)]))

    if kind is types.int64:
        return load(0)
    if kind is types.float64:
        return builder.bitcast(load(0), ir.DoubleType())
    array = context.make_array(kind)(context, builder)
    element = context.get_data_type(kind.dtype)
    size = context.get_abi_sizeof(element)
    shape = [load(1 + k) for k in range(kind.ndim)]
    strides, stride = [], ir.Constant(word, size)
    for extent in reversed(shape):
        strides.insert(0, stride)
        stride = builder.mul(stride, extent)
    populate_array(
        array,
        data=builder.inttoptr(load(0), element.as_pointer()),
        shape=shape,
        strides=strides,
        itemsize=size,
        meminfo=None,
    )
    return array._getvalue()
