"""Generated text with vectors -> machine code: native.py's subset of Python, and lanes.

    vector of 8 doubles: V    vector of 4: H    else as in native.py (D, I, P, Q)

All stages of a Radau step lie in one vector. + - * / and negation work lane by lane, also with a plain double;
load8(a, i), store8(a, i, v), lane(v, k), spread(v, k) (lane k in every lane), low4, high4, join8 move lanes; V8(...)
is a constant; total8 and largest8 fold; vsqrt, vabs, vmax, vfma, vfloor, vrint are one instruction each; vexp and its
like call the C library lane by lane, vsin and vcos are polynomials. vmax and largest8 are for lanes that are not
negative, where a nan wins; of negative lanes only that they are less than the others is kept.

Chain: codegen/stiff -> text -> cache.cached_texts -> `load` (this file) -> addresses.
"""

from __future__ import annotations

import ast

import llvmlite.binding as llvm
from llvmlite import ir

from ...definition.model import Table
from . import native, objects
from .sums import DOUBLE, LANE

KINDS = native.KINDS | {"V": ir.VectorType(DOUBLE, 8), "H": ir.VectorType(DOUBLE, 4)}
_INSTRUCTIONS = {"vsqrt": "sqrt", "vabs": "fabs", "vfloor": "floor", "vrint": "rint", "vfma": "fma"}
_LIBRARY = "exp log tan sinh cosh tanh atan asin acos asinh acosh atanh erf erfc".split()

# Functions of one argument that act lane by lane.
LANE_BY_LANE = {*_LIBRARY, "sin", "cos", "sqrt", "fabs", "floor"}

# Beyond FAR quarter turns the two-part pi/2 runs out of digits. Polynomials of fdlibm (k_sin.c, k_cos.c).
PRELUDE = """\
def quarters(x: V, k: V, k2: V) -> V:
    r = vfma(k, splat8(-1.5707963267948966), x)
    r = vfma(k, splat8(-6.123233995736766e-17), r)
    z = r * r
    s = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08
    s = z * (z * (z * s + 2.75573137070700676789e-06) - 1.98412698298579493134e-04) + 8.33333333332248946124e-03
    s = z * s
    s = r + r * z * (s - 1.66666666666666324348e-01)
    c = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09
    c = z * (z * (z * c - 2.75573143513906633035e-07) + 2.48015872894767294178e-05) - 1.38888888888741095749e-03
    c = z * c
    c = 1.0 - 0.5 * z + z * z * (c + 4.16666666666666019037e-02)
    half = vfloor(k2 * 0.5)
    odd = k2 - 2.0 * half
    turned = half - 2.0 * vfloor(half * 0.5)
    return (s * (1.0 - odd) + c * odd) * (1.0 - 2.0 * turned)


def vsin(x: V) -> V:
    k = vrint(x * 0.6366197723675814)
    if largest8(vabs(k)) < 1e6:
        return quarters(x, k, k)
    return library_sin(x)


def vcos(x: V) -> V:
    k = vrint(x * 0.6366197723675814)
    if largest8(vabs(k)) < 1e6:
        return quarters(x, k, k + 1.0)
    return library_cos(x)


"""


class Function(native.Function):
    """Translates one function definition with vectors."""

    kinds = KINDS

    def vector(self, value: ir.Value) -> bool:
        return isinstance(value.type, ir.VectorType)

    def splat(self, value: ir.Value, width: int) -> ir.Value:
        return self.spread(self.builder.insert_element(self.undefined(width), value, LANE(0)), 0)

    def spread(self, value: ir.Value, k: int, width: int | None = None) -> ir.Value:
        return self.shuffle(value, [k] * (width or value.type.count))

    def undefined(self, width: int) -> ir.Constant:
        return ir.Constant(ir.VectorType(DOUBLE, width), ir.Undefined)

    def shuffle(self, a: ir.Value, lanes: list[int], b: ir.Value | None = None) -> ir.Value:
        mask = ir.Constant(ir.VectorType(LANE, len(lanes)), lanes)
        return self.builder.shuffle_vector(a, self.undefined(a.type.count) if b is None else b, mask)

    def cast(self, value: ir.Value, kind: ir.Type) -> ir.Value:
        if isinstance(kind, ir.VectorType) and not self.vector(value):
            return self.splat(super().cast(value, DOUBLE), kind.count)
        return super().cast(value, kind)

    def binary(self, op, a, b) -> ir.Value:
        kind = a.type if self.vector(a) else b.type if self.vector(b) else None
        if kind is None:
            return super().binary(op, a, b)
        a, b = self.cast(a, kind), self.cast(b, kind)
        return self.arithmetic(native.FLOAT_OPS[type(op)], a, b)

    # ---- statements and expressions that native.py does without ----

    def Pass(self, node):
        """Nothing."""

    def Break(self, node):
        self.builder.branch(self.leave[-1])

    def For(self, node):
        # The block after the loop exists before the loop: `break` goes there.
        after = self.function.append_basic_block("left")
        self.leave = [*getattr(self, "leave", []), after]
        super().For(node)
        self.leave = self.leave[:-1]
        self.builder.branch(after)
        self.builder.position_at_end(after)

    def _UnaryOp(self, node):
        if isinstance(node.op, ast.USub):
            value = self.expression(node.operand)
            if self.vector(value):
                return self.builder.fneg(value)
        return super()._UnaryOp(node)

    def _IfExp(self, node):
        condition, a, b = (self.expression(part) for part in (node.test, node.body, node.orelse))
        kind = a.type if a.type == b.type else DOUBLE
        return self.builder.select(condition, self.cast(a, kind), self.cast(b, kind))

    # ---- calls ----

    def _Call(self, node):
        if isinstance(node.func, ast.Attribute):
            return super()._Call(node)
        name = node.func.id
        special = getattr(self, f"call_{name}", None)
        if special:
            return special(*node.args)
        if name in _INSTRUCTIONS:
            args = [self.expression(a) for a in node.args]
            callee = self.module.instruction(_INSTRUCTIONS[name], args[0].type, len(args))
            return self.builder.call(callee, [self.cast(a, args[0].type) for a in args])
        if name.startswith("library_") or (name[0] == "v" and name[1:] in _LIBRARY):
            callee = self.module.callee(name.removeprefix("library_").removeprefix("v"), 1)
            return self.lane_by_lane(callee, self.expression(node.args[0]))
        return super()._Call(node)

    def lane_by_lane(self, callee, value, *others) -> ir.Value:
        result = self.undefined(value.type.count)
        for k in range(value.type.count):
            x = self.builder.extract_element(value, LANE(k))
            result = self.builder.insert_element(result, self.builder.call(callee, [x, *others]), LANE(k))
        return result

    def place(self, pointer, index, width: int) -> ir.Value:
        element = self.builder.gep(self.pointers[pointer.id], [self.expression(index)])
        return self.builder.bitcast(element, ir.VectorType(DOUBLE, width).as_pointer())

    def call_load8(self, pointer, index):
        return self.builder.load(self.place(pointer, index, 8), align=8)

    def call_load4(self, pointer, index):
        return self.builder.load(self.place(pointer, index, 4), align=8)

    def call_store8(self, pointer, index, value):
        return self.builder.store(
            self.cast(self.expression(value), KINDS["V"]), self.place(pointer, index, 8), align=8
        )

    def call_store4(self, pointer, index, value):
        return self.builder.store(
            self.cast(self.expression(value), KINDS["H"]), self.place(pointer, index, 4), align=8
        )

    def call_splat8(self, value):
        return self.cast(self.expression(value), KINDS["V"])

    def call_splat4(self, value):
        return self.cast(self.expression(value), KINDS["H"])

    def call_V8(self, *values):
        return ir.Constant(KINDS["V"], [float(ast.literal_eval(v)) for v in values])

    def call_H4(self, *values):
        return ir.Constant(KINDS["H"], [float(ast.literal_eval(v)) for v in values])

    def call_lane(self, value, k):
        return self.builder.extract_element(self.expression(value), self.expression(k))

    def call_spread(self, value, k):
        return self.spread(self.expression(value), ast.literal_eval(k), 8)

    def call_low4(self, value):
        return self.shuffle(self.expression(value), [0, 1, 2, 3])

    def call_high4(self, value):
        return self.shuffle(self.expression(value), [4, 5, 6, 7])

    def call_join8(self, a, b):
        return self.shuffle(self.expression(a), list(range(8)), self.expression(b))

    def call_vpow(self, value, exponent):
        power = self.module.instruction("pow", DOUBLE, 2)
        return self.lane_by_lane(power, self.expression(value), self.cast(self.expression(exponent), DOUBLE))

    def maximum(self, a, b) -> ir.Value:
        """Of doubles that are not negative, as integers: a nan is larger than all, and one instruction serves where
        comparisons that look for a nan are a chain of five."""
        bits = ir.VectorType(ir.IntType(64), a.type.count)
        x, y = self.builder.bitcast(a, bits), self.builder.bitcast(b, bits)
        larger = self.builder.select(self.builder.icmp_signed(">", x, y), x, y)
        return self.builder.bitcast(larger, a.type)

    def call_vmax(self, a, b):
        a = self.expression(a)
        return self.maximum(a, self.cast(self.expression(b), a.type))

    def fold(self, value, operation) -> ir.Value:
        v, width = self.expression(value), 8
        while width > 1:
            width //= 2
            v = operation(self.shuffle(v, list(range(width))), self.shuffle(v, list(range(width, 2 * width))))
        return self.builder.extract_element(v, LANE(0))

    def call_largest8(self, value):
        return self.fold(value, self.maximum)

    def call_total8(self, value):
        return self.fold(value, self.builder.fadd)


class Module(native.Module):
    """Translates one generated text with vectors into an LLVM module."""

    def __init__(self, text: str, suffix: str = ""):
        self.module = ir.Module("pwsmooth")
        self.module.triple = llvm.get_default_triple()
        self.fuses = True
        self.functions: dict[str, ir.Function] = {}
        prelude = [node for node in ast.parse(PRELUDE).body if isinstance(node, ast.FunctionDef)]
        self.translated = Function
        self.define([*prelude, *self.read(text)], {*native.INTERNAL, *(node.name for node in prelude)}, suffix)


def build(text: str, first: bool = False) -> bytes:
    """Object code of a generated text with vectors for this machine."""
    return objects.emit(Module(text, objects.FIRST * first).module)


def load(text: str, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> objects.Code:
    """Machine code of a generated source with vectors, from the cache where this machine made it before."""
    return objects.load(text, build, sizes, tables)
