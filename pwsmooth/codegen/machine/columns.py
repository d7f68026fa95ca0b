"""Generated text -> machine code that works on eight columns at once: native.py with vectors for all doubles.

Columns differ in what enters linearly, deviations. What is nonlinear, a comparison, a function, a power, is the same
in all of them and done once, in the first lane.

Chain: codegen/taylor/jets.py, whose text says LANES = 8 -> native.load -> **columns**.
"""

from __future__ import annotations

import ast

from ...definition.model import Table
from . import native, objects
from .writer import DOUBLE, LANES, POINTER, ROW, Value, integer

KINDS = native.KINDS | {"P": (POINTER, ROW), "V": (ROW, "")}

# presum of sums.py on rows of vectors. In it j counts orders of the first series; those of the second end at 4 q.
PRESUM = """
def presum(rows: P, a: I, b: I, q: I, out: I):
    s0 = 0.0
    s1 = 0.0
    s2 = 0.0
    s3 = 0.0
    if q > 0:
        n = b + 4 * q
        s0 = rows[a + 1] * rows[n] + rows[a + 2] * rows[n - 1] + (rows[a + 3] * rows[n - 2] + rows[a + 4] * rows[n - 3])
        s1 = rows[a + 2] * rows[n] + rows[a + 3] * rows[n - 1] + rows[a + 4] * rows[n - 2]
        s2 = rows[a + 3] * rows[n] + rows[a + 4] * rows[n - 1]
        s3 = rows[a + 4] * rows[n]
        for j in range(5, 4 * q + 1):
            c = rows[a + j]
            s0 += c * rows[n + 1 - j]
            s1 += c * rows[n + 2 - j]
            s2 += c * rows[n + 3 - j]
            s3 += c * rows[n + 4 - j]
    rows[out] = s0
    rows[out + 1] = s1
    rows[out + 2] = s2
    rows[out + 3] = s3
"""
assert LANES == 4


def combine(name: str, count: int) -> str:
    """Text of combine of sums.py on rows of vectors."""
    given = "".join(f", c{j}: V" for j in range(count))
    terms = " + ".join(f"c{j} * rows[table + {j} * stride + k]" for j in range(count))
    return f"""
def {name}(rows: P, out: I, value: V, table: I, stride: I, K: I{given}):
    rows[out] = value
    for k in range(1, K + 1):
        rows[out + k] = {terms}
"""


class Function(native.Function):
    """Translates one function definition."""

    kinds = KINDS

    def spread(self, value: Value) -> Value:
        return value if value.kind == ROW else self.writer.spread(super().cast(value, DOUBLE), ROW)

    def first(self, value: Value) -> Value:
        return self.writer.lane(value, integer(0)) if value.kind == ROW else value

    def store(self, name: str, value: Value) -> None:
        super().store(name, self.spread(value) if value.kind == DOUBLE else value)

    def cast(self, value: Value, kind: str) -> Value:
        return self.spread(value) if kind == ROW else super().cast(self.first(value), kind)

    def _UnaryOp(self, node):
        if isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant):
            value = self.expression(node.operand)
            if value.kind == ROW:
                return self.writer.negative(value)
        return super()._UnaryOp(node)

    def binary(self, op, a, b) -> Value:
        if ROW not in (a.kind, b.kind):
            return super().binary(op, a, b)
        if isinstance(op, ast.Pow):
            return super().binary(op, self.first(a), self.first(b))
        return self.arithmetic(native.FLOAT_OPS[type(op)], self.spread(a), self.spread(b))

    def compared(self, a, b):
        return self.first(a), self.first(b)

    def choose(self, condition, a, b):
        return self.writer.select(condition, self.spread(a), self.spread(b))

    @staticmethod
    def helper(name: str, count: int) -> str | None:
        return PRESUM if name == "presum" else combine(name, count) if name.startswith("combine") else None


def build(text: str, first: bool = False) -> bytes:
    """Object code of a generated text for this machine."""
    return native.object_code(text, first, Function)


def load(text: str, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> objects.Code:
    """Machine code as of native.load, of a text that says LANES = 8."""
    return objects.load(text, build, sizes, tables)
