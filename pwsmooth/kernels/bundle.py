"""numba's view of a Bundle (block.py): one pointer, whose numbers are loaded and stored, and its arrays loaded."""

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

_SCALARS = {"int": types.int64, "float": types.float64}
_ELEMENTS = {"f8": types.float64, "i8": types.int64, "i1": types.int8, "b1": types.boolean}


class BundleType(types.Type):
    """numba's type of a Bundle; `fields` holds (name, "int" | "float" | element code + "[rank]" | a BundleType)."""

    def __init__(self, name, fields, size):
        self.fields, self.size = fields, size
        # A short name: it becomes part of every symbol.
        mark = hashlib.sha256(repr(fields).encode()).hexdigest()[:8]
        super().__init__(name=f"{name}{mark}")

    def resolve(self, name):
        """(cell of the field, its numba type), or None."""
        cell = 0
        for field, code in self.fields:
            inside = isinstance(code, BundleType)
            rank = 0 if inside or code in _SCALARS else int(code[3])
            if field == name:
                if rank:
                    return cell, types.Array(_ELEMENTS[code[:2]], rank, "C")
                return cell, code if inside else _SCALARS[code]
            cell += code.size if inside else 1 + rank
        return None


register_model(BundleType)(models.OpaqueModel)


@cache
def bundle_type(struct):
    """The numba type of a subclass of Bundle."""
    fields = tuple((name, bundle_type(c) if isinstance(c, type) else c) for name, c in struct.layout)
    return BundleType(struct.__name__, fields, struct.size)


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
        raise TypeError(f"{attr} of a Bundle is no number: it cannot be replaced, only overwritten")
    word = ir.IntType(64)
    place = builder.gep(builder.bitcast(bundle, word.as_pointer()), [ir.Constant(word, cell)])
    builder.store(value if kind is types.int64 else builder.bitcast(value, word), place)
