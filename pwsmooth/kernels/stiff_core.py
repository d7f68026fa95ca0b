"""How the kernels read a Core (stiff_state.py): one pointer, whose attributes are loaded when they are used.

Passed by value, its fifty words would go through the stack in every call that is not inlined.
"""

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

from pwsmooth.kernels.stiff_state import Core, Doubles

_WORD = ir.IntType(64)
_POINTERS = types.CPointer(types.float64), types.CPointer(types.int64)


class CoreType(types.Type):
    """numba's type of a pointer to the words of a Core."""

    def __init__(self):
        super().__init__(name="StiffCore")


core_type = CoreType()
register_model(CoreType)(models.OpaqueModel)


def _kind(attribute):
    kind = Core.__annotations__[attribute]
    return types.int64 if kind is int else _POINTERS[kind != Doubles]


@infer_getattr
class _Attributes(AttributeTemplate):
    key = CoreType

    def generic_resolve(self, typ, attr):
        return _kind(attr) if attr in Core._fields else None


@lower_getattr_generic(CoreType)
def _getattr(context, builder, typ, value, attr):
    words = builder.bitcast(value, _WORD.as_pointer())
    word = builder.load(builder.gep(words, [ir.Constant(_WORD, Core._fields.index(attr))]))
    # The words stay what they are during a call, whatever is stored through them.
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    kind = _kind(attr)
    return word if kind is types.int64 else builder.inttoptr(word, context.get_value_type(kind))


@intrinsic
def core(typingctx, places):
    """The Core whose sizes and addresses stand at `places`."""

    def codegen(context, builder, sig, args):
        return builder.bitcast(args[0], context.get_value_type(core_type))

    return core_type(places), codegen
