"""Vectors of 4 or 8 doubles as numba values: one instruction serves all stages of a step.

LLVM's own vectoriser gives up on these loops (short, many pointers that might overlap), so the vectors are
explicit: `load8(a, i)` and `store8(a, i, v)` move 8 doubles from index i of an array or pointer, and + - * /
and negation work lane by lane, also with a plain float. Functions of the C library are called lane by lane.
"""

import math
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_jitable, register_model

_DOUBLE = ir.DoubleType()

# A kernel function whose products and sums may fuse.
fused = register_jitable(error_model="numpy", fastmath={"contract", "nsz"})


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


def _from_address(pointee):
    @intrinsic
    def convert(typingctx, address):
        def codegen(context, builder, sig, args):
            return builder.inttoptr(args[0], context.get_value_type(sig.return_type))

        return types.CPointer(pointee)(types.int64), codegen

    return convert


# Arrays as bare pointers: an array's reference count is atomic and costs more than a whole stage.
doubles, integers = _from_address(types.float64), _from_address(types.int64)


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


@intrinsic
def join8(typingctx, a, b):
    """Two vectors of 4 as one of 8."""

    def codegen(context, builder, sig, args):
        mask = ir.Constant(ir.VectorType(ir.IntType(32), 8), list(range(8)))
        return builder.shuffle_vector(args[0], args[1], mask)

    return lanes8(lanes4, lanes4), codegen


def _instruction(name):
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


vsqrt, vabs, vfloor, vrint = (_instruction(name) for name in ("sqrt", "fabs", "floor", "rint"))


@intrinsic
def vfma(typingctx, a, b, c):
    """a * b + c with one rounding."""

    def codegen(context, builder, sig, args):
        vector = args[0].type
        declared = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(vector, [vector] * 3), f"llvm.fma.v{vector.count}f64"
        )
        return builder.call(declared, args)

    return a(a, a, a), codegen


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


@fused
def largest8(v):
    """Largest of 8 lanes; a nan wins."""
    w = vmax(low4(v), high4(v))
    top = lane(w, 0)
    for k in range(1, 4):
        x = lane(w, k)
        if not x <= top:
            top = x
    return top


def _library(scalar):
    @intrinsic
    def function(typingctx, v):
        def codegen(context, builder, sig, args):
            result = args[0]
            for k in range(sig.return_type.width):
                index = ir.Constant(ir.IntType(32), k)
                x = builder.extract_element(args[0], index)
                y = context.compile_internal(builder, scalar, types.float64(types.float64), [x])
                result = builder.insert_element(result, y, index)
            return result

        return v(v), codegen

    return function


def _power(x, r):
    return x**r


@intrinsic
def vpow(typingctx, v, r):
    """Lane by lane power with one real exponent."""

    def codegen(context, builder, sig, args):
        result = args[0]
        for k in range(sig.return_type.width):
            index = ir.Constant(ir.IntType(32), k)
            x = builder.extract_element(args[0], index)
            y = context.compile_internal(
                builder, _power, types.float64(types.float64, types.float64), [x, args[1]]
            )
            result = builder.insert_element(result, y, index)
        return result

    return v(v, types.float64), codegen


def _scalar(name):
    """A function of its own per name: numba compiles it by the global it calls."""
    scope = {"f": getattr(math, name)}
    exec(f"def {name}(x):\n    return f(x)", scope)
    return scope[name]


vexp, vlog, _sin, _cos, vtan, vsinh, vcosh, vtanh, vatan, vasin, vacos, verf, verfc = (
    _library(_scalar(name)) for name in "exp log sin cos tan sinh cosh tanh atan asin acos erf erfc".split()
)

# Beyond this many quarter turns the two-part pi/2 runs out of digits.
_FAR = 1e6


@fused
def _quarters(x, k, k2):
    """sin(x - k pi/2) turned by k2 quarter turns; polynomials of fdlibm (k_sin.c, k_cos.c)."""
    r = vfma(k, splat8(-1.5707963267948966), x)
    r = vfma(k, splat8(-6.123233995736766e-17), r)
    z = r * r
    s = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08
    s = z * (
        z * (z * (z * s + 2.75573137070700676789e-06) - 1.98412698298579493134e-04) + 8.33333333332248946124e-03
    )
    s = r + r * z * (s - 1.66666666666666324348e-01)
    c = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09
    c = z * (
        z * (z * (z * c - 2.75573143513906633035e-07) + 2.48015872894767294178e-05) - 1.38888888888741095749e-03
    )
    c = 1.0 - 0.5 * z + z * z * (c + 4.16666666666666019037e-02)
    half = vfloor(k2 * 0.5)
    odd = k2 - 2.0 * half
    turned = half - 2.0 * vfloor(half * 0.5)
    return (s * (1.0 - odd) + c * odd) * (1.0 - 2.0 * turned)


@fused
def _all_near(k):
    top = 0.0
    for i in range(8):
        top = max(top, abs(lane(k, i)))
    return top < _FAR


@fused
def vsin(x):
    """Sine of 8 lanes; one vector evaluation instead of 8 library calls."""
    k = vrint(x * 0.6366197723675814)
    return _quarters(x, k, k) if _all_near(k) else _sin(x)


@fused
def vcos(x):
    """Cosine of 8 lanes."""
    k = vrint(x * 0.6366197723675814)
    return _quarters(x, k, k + 1.0) if _all_near(k) else _cos(x)
