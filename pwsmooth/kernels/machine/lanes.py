"""Vectors of 4 or 8 doubles as numba values: one instruction serves all stages of a step.

LLVM's own vectoriser gives up on these loops (short, many pointers that might overlap), so the vectors are
explicit: `load8(a, i)` and `store8(a, i, v)` move 8 doubles from index i of an array or pointer, and + - * /
and negation work lane by lane, also with a plain float.
"""

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from .compiling import kernel

_DOUBLE = ir.DoubleType()


class LanesType(types.Type):
    """Type of a vector of `width` doubles."""

    def __init__(self, width):
        self.width = width
        super().__init__(name=f"lanes{width}")


lanes4, lanes8 = LanesType(4), LanesType(8)


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, ir.VectorType(_DOUBLE, fe_type.width))


def _is_lanes(ty):
    return isinstance(ty, LanesType)


def _splat(builder, value, width):
    vector = ir.VectorType(_DOUBLE, width)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), mask)


def _register(op, method):
    @infer_global(op)
    class _Typing(AbstractTemplate):
        def generic(self, args, kws):
            a, b = args
            if _is_lanes(a) and (a == b or b == types.float64):
                return signature(a, a, b)
            if _is_lanes(b) and a == types.float64:
                return signature(b, a, b)
            return None

    def lower(context, builder, sig, args):
        width = sig.return_type.width
        values = [
            v if _is_lanes(ty) else _splat(builder, v, width) for ty, v in zip(sig.args, args, strict=True)
        ]
        return getattr(builder, method)(*values)

    lower_builtin(op, LanesType, LanesType)(lower)
    lower_builtin(op, LanesType, types.Float)(lower)
    lower_builtin(op, types.Float, LanesType)(lower)


for _op, _method in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _register(_op, _method)


@infer_global(operator.neg)
class _Negation(AbstractTemplate):
    def generic(self, args, kws):
        return signature(args[0], args[0]) if _is_lanes(args[0]) else None


@lower_builtin(operator.neg, LanesType)
def _lower_negation(context, builder, sig, args):
    return builder.fneg(args[0])


def _address(context, builder, ty, value, index, width):
    if isinstance(ty, types.Array):
        value = context.make_array(ty)(context, builder, value=value).data
    element = builder.gep(value, [index])
    return builder.bitcast(element, ir.VectorType(_DOUBLE, width).as_pointer())


def _memory(width):
    lanes = LanesType(width)

    @intrinsic
    def load(typingctx, a, i):
        def codegen(context, builder, sig, args):
            pointer = _address(context, builder, sig.args[0], args[0], args[1], width)
            return builder.load(pointer, align=8)

        return lanes(a, types.int64), codegen

    @intrinsic
    def store(typingctx, a, i, v):
        def codegen(context, builder, sig, args):
            pointer = _address(context, builder, sig.args[0], args[0], args[1], width)
            builder.store(args[2], pointer, align=8)
            return context.get_dummy_value()

        return types.void(a, types.int64, lanes), codegen

    @intrinsic
    def splat(typingctx, x):
        def codegen(context, builder, sig, args):
            return _splat(builder, args[0], width)

        return lanes(types.float64), codegen

    return load, store, splat


load4, store4, splat4 = _memory(4)
load8, store8, splat8 = _memory(8)


@intrinsic
def at(typingctx, p, i):
    """Pointer to the element i of what p points to."""

    def codegen(context, builder, sig, args):
        return builder.gep(args[0], [args[1]])

    return p(p, types.int64), codegen


def _half(start):
    @intrinsic
    def half(typingctx, v):
        def codegen(context, builder, sig, args):
            mask = ir.Constant(ir.VectorType(ir.IntType(32), 4), [start + k for k in range(4)])
            return builder.shuffle_vector(args[0], ir.Constant(args[0].type, ir.Undefined), mask)

        return lanes4(lanes8), codegen

    return half


low4, high4 = _half(0), _half(4)


def _of_each(name):
    @intrinsic
    def function(typingctx, v):
        def codegen(context, builder, sig, args):
            vector = args[0].type
            declared = cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(vector, [vector]), f"llvm.{name}.v{vector.count}f64"
            )
            return builder.call(declared, args)

        return v(v), codegen

    return function


vabs, vsqrt = _of_each("fabs"), _of_each("sqrt")  # lane by lane


@intrinsic
def vmax(typingctx, a, b):
    """Lane by lane maximum; a nan in either lane stays."""

    def codegen(context, builder, sig, args):
        larger = builder.fcmp_unordered(">", args[0], args[1])
        nan = builder.fcmp_unordered("uno", args[1], args[1])
        return builder.select(builder.or_(larger, nan), builder.select(nan, args[1], args[0]), args[1])

    return a(a, a), codegen


@intrinsic
def lane(typingctx, v, i):
    """One lane as a float."""

    def codegen(context, builder, sig, args):
        return builder.extract_element(args[0], args[1])

    return types.float64(v, types.int64), codegen


@kernel
def largest8(v):
    """Largest of 8 lanes; a nan wins."""
    w = vmax(low4(v), high4(v))
    top = lane(w, 0)
    for k in range(1, 4):
        x = lane(w, k)
        if not x <= top:
            top = x
    return top
