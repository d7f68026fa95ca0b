"""Calls of generated functions by their address: one compiled core serves every model.

Each `call_*` takes the int64 address of a cfunc and passes arrays as plain data pointers. A function object as an
argument would compile the core anew for every model and never hit the disk cache.
"""

from inspect import Parameter, Signature

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .lanes import LanesType

_DOUBLE, _INT64 = ir.DoubleType(), ir.IntType(64)


def caller(arguments, result=types.void):
    """A kernel function of an address and these arguments that calls what stands there; arrays become pointers."""

    def call(typingctx, *kinds):
        def codegen(context, builder, sig, args):
            values = []
            for ty, value in zip(sig.args[1:], args[1:], strict=True):
                if isinstance(ty, types.Array):
                    value = context.make_array(ty)(context, builder, value=value).data
                values.append(value)
            returned = {types.void: ir.VoidType(), types.int64: _INT64, types.float64: _DOUBLE}[result]
            pointer = builder.inttoptr(
                args[0], ir.FunctionType(returned, [v.type for v in values]).as_pointer()
            )
            out = builder.call(pointer, values)
            return context.get_dummy_value() if result is types.void else out

        return result(*kinds), codegen

    names = ["typingctx", "address", *arguments.split(", ")]
    call.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in names])
    return intrinsic(call)


# fields: overwrites the rates dx, surfaces h and residuals g.
call_fields = caller("t, x, mult, p, dx, h, g")

# fields8: the same at eight points, of which all arrays have a vector in the place of a number.
call_fields8 = caller("t, x, mult, p, dx, h, g")

# linear: overwrites dg/dmult and the gradients of the surfaces.
call_linear = caller("t, x, mult, p, G, dh")

# outputs: overwrites the model's outputs.
call_outputs = caller("t, x, mult, p, out")

# act: fires event i; overwrites the entries of xnew that it sets; 0 if `when` fails.
call_act = caller("i, t, x, mult, p, xnew", types.int64)

# act_slopes: overwrites the gradients of what update i writes.
call_act_slopes = caller("i, t, x, mult, p, out", types.int64)

# layer: overwrites the residuals g with the layered states free, and their rates q.
call_layer = caller("t, x, mult, z, p, g, q")

# jet_slip: overwrites the Taylor rows, all multipliers constant.
call_jet_slip = caller("t, x, mult, p, K, stride, rows, scratch", types.int64)

# jet_general: the same, masked multipliers solved.
call_jet_general = caller("t, x, mult, p, mask, K, stride, rows, scratch", types.int64)

# Any unit of these arguments.
call_unit = caller("P, C, S, R, W", types.int64)

# newton: solves the multipliers of W.mask, 0 when it did not converge.
call_newton = caller("P, S, W", types.int64)

# layer; see layer.py for the tasks.
call_layer_unit = caller("P, S, W, task, j, toward, start", types.int64)

# other_motions: records where several motions begin; see other_motions.py.
call_others = caller("P, S, R, W, size, joint", types.int64)

# fold jet: overwrites W.step.rows, 0 where it is singular.
call_fold = caller("P, C, S, W, j, toward", types.int64)

# onset: the first step of a slip in a disc; its length, 0 where there is none.
call_onset = caller("P, C, S, W, longest", types.float64)

# isolate; see roots.py.
call_root = caller("roots, degree", types.float64)

# step: the step's size, its polynomials in W.step.rows.
call_step = caller("P, C, S, W, h, refine", types.float64)


@intrinsic
def float_bits(typingctx, x):
    """The bits of a double as int64."""

    def codegen(context, builder, sig, args):
        return builder.bitcast(args[0], _INT64)

    return types.int64(types.float64), codegen


@intrinsic
def bits_float(typingctx, bits):
    """The double with these bits."""

    def codegen(context, builder, sig, args):
        return builder.bitcast(args[0], _DOUBLE)

    return types.float64(types.int64), codegen


@intrinsic
def at(typingctx, a, k):
    """a[k] of a contiguous row, without the wrap-around test of a negative k, which keeps loops from vectorising."""

    def codegen(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, value=args[0]).data
        return builder.load(builder.gep(data, [args[1]]))

    return types.float64(a, types.intp), codegen


@intrinsic
def put(typingctx, a, k, value):
    """a[k] = value, in the same way."""

    def codegen(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, value=args[0]).data
        builder.store(args[2], builder.gep(data, [args[1]]))
        return context.get_dummy_value()

    return types.void(a, types.intp, types.float64), codegen


def _blend(builder, a, b, pattern):
    """Lanes of a where the pattern has 0, of b where it has 1."""
    mask = [k + 8 * from_b for k, from_b in enumerate(pattern)]
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), 8), mask))


@intrinsic
def powers8(typingctx, h):
    """The vector 1, h, ..., h^7. In registers: a load of eight numbers just stored waits for all the stores."""

    def codegen(context, builder, sig, args):
        vector = ir.VectorType(_DOUBLE, 8)
        ones = ir.Constant(vector, [1.0] * 8)
        factor, result = args[0], None
        for bit in (1, 2, 4):
            splat = builder.shuffle_vector(
                builder.insert_element(
                    ir.Constant(vector, ir.Undefined), factor, ir.Constant(ir.IntType(32), 0)
                ),
                ir.Constant(vector, ir.Undefined),
                ir.Constant(ir.VectorType(ir.IntType(32), 8), [0] * 8),
            )
            part = _blend(builder, ones, splat, [k & bit != 0 for k in range(8)])
            result = part if result is None else builder.fmul(result, part)
            factor = builder.fmul(factor, factor)
        return result

    return LanesType(8)(types.float64), codegen


@intrinsic
def below_zero8(typingctx, v):
    """Bit k tells whether lane k is negative."""

    def codegen(context, builder, sig, args):
        lanes = builder.fcmp_ordered("<", args[0], ir.Constant(args[0].type, [0.0] * 8))
        return builder.zext(builder.bitcast(lanes, ir.IntType(8)), _INT64)

    return types.int64(v), codegen


@intrinsic
def count_bits(typingctx, bits):
    """Number of ones among the bits."""

    def codegen(context, builder, sig, args):
        return builder.ctpop(args[0])

    return types.int64(types.int64), codegen


def _halves(builder, vector, operation):
    """Folds a vector of 8 to one number."""
    width = 8
    while width > 1:
        width //= 2
        lanes = ir.IntType(32)
        low = ir.Constant(ir.VectorType(lanes, width), list(range(width)))
        high = ir.Constant(ir.VectorType(lanes, width), list(range(width, 2 * width)))
        vector = operation(
            builder.shuffle_vector(vector, vector, low), builder.shuffle_vector(vector, vector, high)
        )
    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


@intrinsic
def sum8(typingctx, v):
    """Sum of 8 lanes."""

    def codegen(context, builder, sig, args):
        return _halves(builder, args[0], builder.fadd)

    return types.float64(v), codegen


@intrinsic
def abs8(typingctx, v):
    """Lane by lane |v|."""

    def codegen(context, builder, sig, args):
        kind = args[0].type
        fabs = cgutils.get_or_insert_function(builder.module, ir.FunctionType(kind, [kind]), "llvm.fabs.v8f64")
        return builder.call(fabs, [args[0]])

    return v(v), codegen
