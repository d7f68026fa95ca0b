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

from ...definition.model import Table
from . import native, objects
from .writer import BLOCK, DOUBLE, INT, ROW, WIDTHS, Value, integer, vector

KINDS = native.KINDS | {"V": (ROW, ""), "H": (BLOCK, "")}
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

    kinds, always_fuses = KINDS, True

    def vector(self, value: Value) -> bool:
        return WIDTHS.get(value.kind, 0) > 0

    def cast(self, value: Value, kind: str) -> Value:
        if WIDTHS.get(kind) and not self.vector(value):
            return self.writer.spread(super().cast(value, DOUBLE), kind)
        return super().cast(value, kind)

    def binary(self, op, a, b) -> Value:
        kind = a.kind if self.vector(a) else b.kind if self.vector(b) else None
        if kind is None:
            return super().binary(op, a, b)
        return self.arithmetic(native.FLOAT_OPS[type(op)], self.cast(a, kind), self.cast(b, kind))

    # ---- statements and expressions that native.py does without ----

    def Pass(self, node):
        """Nothing."""

    def Break(self, node):
        self.writer.go(self.leave[-1])

    def For(self, node):
        # The block after the loop has its name before the loop: `break` goes there.
        after = self.writer.label("left")
        self.leave = [*getattr(self, "leave", []), after]
        super().For(node)
        self.leave = self.leave[:-1]
        self.writer.go(after)
        self.writer.begin(after)

    def _UnaryOp(self, node):
        if isinstance(node.op, ast.USub):
            value = self.expression(node.operand)
            if self.vector(value):
                return self.writer.negative(value)
        return super()._UnaryOp(node)

    def _IfExp(self, node):
        condition, a, b = (self.expression(part) for part in (node.test, node.body, node.orelse))
        kind = a.kind if a.kind == b.kind else DOUBLE
        return self.writer.select(condition, self.cast(a, kind), self.cast(b, kind))

    # ---- calls ----

    @staticmethod
    def helper(name: str, count: int) -> str | None:
        return PRELUDE if name in ("vsin", "vcos") else None

    def _Call(self, node):
        if isinstance(node.func, ast.Attribute):
            return super()._Call(node)
        name = node.func.id
        special = getattr(self, f"call_{name}", None)
        if special:
            return special(*node.args)
        if name in _INSTRUCTIONS:
            args = [self.expression(a) for a in node.args]
            return self.call(self.module.instruction(_INSTRUCTIONS[name], args[0].kind, len(args)), args)
        if name.startswith("library_") or (name[0] == "v" and name[1:] in _LIBRARY):
            callee = self.module.callee(name.removeprefix("library_").removeprefix("v"), 1)
            return self.lane_by_lane(callee, self.expression(node.args[0]))
        return super()._Call(node)

    def lane_by_lane(self, callee, value, *others) -> Value:
        lanes = (self.writer.lane(value, integer(k)) for k in range(WIDTHS[value.kind]))
        return self.writer.join([self.call(callee, [x, *others]) for x in lanes])

    def place(self, pointer, index) -> Value:
        return self.writer.element(self.pointers[pointer.id], self.expression(index))

    def call_load8(self, pointer, index):
        return self.writer.load(self.place(pointer, index), ROW)

    def call_load4(self, pointer, index):
        return self.writer.load(self.place(pointer, index), BLOCK)

    def call_store8(self, pointer, index, value):
        return self.writer.store(self.cast(self.expression(value), ROW), self.place(pointer, index))

    def call_store4(self, pointer, index, value):
        return self.writer.store(self.cast(self.expression(value), BLOCK), self.place(pointer, index))

    def call_splat8(self, value):
        return self.cast(self.expression(value), ROW)

    def call_splat4(self, value):
        return self.cast(self.expression(value), BLOCK)

    def call_V8(self, *values):
        return vector([float(ast.literal_eval(v)) for v in values])

    call_H4 = call_V8

    def call_lane(self, value, k):
        return self.writer.lane(self.expression(value), self.expression(k))

    def call_spread(self, value, k):
        return self.writer.shuffle(self.expression(value), [ast.literal_eval(k)] * 8)

    def call_low4(self, value):
        return self.writer.shuffle(self.expression(value), range(4))

    def call_high4(self, value):
        return self.writer.shuffle(self.expression(value), range(4, 8))

    def call_join8(self, a, b):
        return self.writer.shuffle(self.expression(a), range(8), self.expression(b))

    def call_vpow(self, value, exponent):
        power = self.module.instruction("pow", DOUBLE, 2)
        return self.lane_by_lane(power, self.expression(value), self.cast(self.expression(exponent), DOUBLE))

    def maximum(self, a: Value, b: Value) -> Value:
        """Of doubles that are not negative, as integers: a nan is larger than all, and one instruction serves where
        comparisons that look for a nan are a chain of five."""
        bits = f"<{WIDTHS[a.kind]} x {INT}>" if self.vector(a) else INT
        x, y = (self.writer.convert("bitcast", v, bits) for v in (a, b))
        larger = self.writer.select(self.writer.compare("sgt", x, y), x, y)
        return self.writer.convert("bitcast", larger, a.kind)

    def call_vmax(self, a, b):
        a = self.expression(a)
        return self.maximum(a, self.cast(self.expression(b), a.kind))

    def fold(self, value, operation) -> Value:
        v, width = self.expression(value), 8
        while width > 1:
            width //= 2
            v = operation(self.writer.shuffle(v, range(width)), self.writer.shuffle(v, range(width, 2 * width)))
        return self.writer.lane(v, integer(0))

    def call_largest8(self, value):
        return self.fold(value, self.maximum)

    def call_total8(self, value):
        return self.fold(value, lambda a, b: self.writer.binary("fadd", a, b))


def build(text: str, first: bool = False) -> bytes:
    """Object code of a generated text with vectors for this machine."""
    return native.object_code(text, first, Function)


def load(text: str, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> objects.Code:
    """Machine code of a generated source with vectors, from the cache where this machine made it before."""
    return objects.load(text, build, sizes, tables)
