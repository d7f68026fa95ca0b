"""numba's view of a Bundle (block.py): one pointer, whose numbers are loaded and stored, its arrays only loaded."""

from __future__ import annotations

import hashlib
from functools import cache

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)
from numba.np.arrayobj import populate_array

from .block import Number, Part

_SCALARS = {"int": types.int64, "float": types.float64}
_ELEMENTS = {"f8": types.float64, "i8": types.int64, "i4": types.int32, "i1": types.int8, "b1": types.boolean}


class BundleType(types.Type):
    """numba's type of a subclass of Bundle."""

    def __init__(self, struct):
        self.members = struct.members
        # A short name: it becomes part of every symbol.
        mark = hashlib.sha256(repr(struct.__annotations__).encode()).hexdigest()[:8]
        super().__init__(name=f"{struct.__name__}{mark}")

    def resolve(self, name):
        """(cell of the field, its numba type), or None."""
        member = self.members.get(name)
        return member and (member.at, _kind(member))


def _kind(member):
    if isinstance(member, Number):
        return _SCALARS[member.code]
    if isinstance(member, Part):
        return bundle_type(member.struct)
    element = _ELEMENTS[member.element]
    return types.CPointer(element) if member.pointer else types.Array(element, member.rank, "C")


register_model(BundleType)(models.OpaqueModel)


@cache
def bundle_type(struct):
    """The numba type of a subclass of Bundle."""
    return BundleType(struct)


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

    if isinstance(kind, BundleType):
        return builder.bitcast(builder.gep(cells, [ir.Constant(word, cell)]), context.get_value_type(kind))
    if kind is types.int64:
        return load(0)
    if kind is types.float64:
        return builder.bitcast(load(0), ir.DoubleType())
    if isinstance(kind, types.CPointer):
        return builder.inttoptr(load(0), context.get_value_type(kind))
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


@lower_setattr_generic(BundleType)
def _setattr(context, builder, sig, args, attr):
    cell, kind = sig.args[0].resolve(attr)
    bundle, value = args
    if kind not in _SCALARS.values():
        raise TypeError(f"{attr} of a Bundle cannot be replaced, only overwritten")
    word = ir.IntType(64)
    place = builder.gep(builder.bitcast(bundle, word.as_pointer()), [ir.Constant(word, cell)])
    builder.store(value if kind is types.int64 else builder.bitcast(value, word), place)
