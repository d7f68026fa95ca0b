"""LLVM's text of a function, written line by line in the order in which it runs.

The objects of llvmlite would take three times as long to make and print, longer than LLVM takes to compile the text.

Chain: native.py, vectors.py, columns.py -> **lines of text** (this file) -> objects.py.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

DOUBLE, INT, BOOL, LANE, POINTER, NOTHING = "double", "i64", "i1", "i32", "ptr", "void"
BLOCK, ROW = "<4 x double>", "<8 x double>"
WIDTHS = {DOUBLE: 0} | {f"<{n} x double>": n for n in (1, 2, 4, 8)}  # numbers of lanes
LANES = WIDTHS[BLOCK]
ALIGNED = ", align 8"  # a vector stands anywhere among doubles


class Value:
    """A number, vector or address, as LLVM's text names it.

    `number` is the number of a constant, `of` the kind of what stands at an address.
    """

    __slots__ = ("kind", "name", "number", "of")

    def __init__(self, kind: str, name: str, number: float | None = None, of: str = ""):
        self.kind, self.name, self.number, self.of = kind, name, number, of

    def __str__(self) -> str:
        return f"{self.kind} {self.name}"


class Callee(NamedTuple):
    """A function as calls see it.

    `returned` is the kind of its result; of each argument we have the kind and the kind of what stands at an address.
    """

    name: str
    returned: str
    arguments: list[tuple[str, str]]


class Product(Value):
    """A product, which may become one fused instruction with a sum."""

    __slots__ = ("fused", "parts", "uses")

    def __init__(self, name: str, a: Value, b: Value):
        super().__init__(a.kind, name)
        self.parts, self.uses, self.fused = (a, b), 0, False

    def line(self) -> str:
        a, b = self.parts
        return "" if self.fused else f"{self.name} = fmul {a}, {b.name}"


class Sum(Value):
    """A sum or difference. With a product that nothing else uses it becomes one fused instruction.

    We choose this here and do not leave it to LLVM, so that every degree of optimisation rounds alike.
    """

    __slots__ = ("minus", "parts")

    def __init__(self, name: str, minus: bool, a: Value, b: Value):
        super().__init__(a.kind, name)
        self.minus, self.parts = minus, (a, b)

    def line(self) -> str:
        a, b = self.parts
        product = next((part for part in self.parts if isinstance(part, Product) and part.uses == 1), None)
        if product is None:
            return f"{self.name} = {'fsub' if self.minus else 'fadd'} {a}, {b.name}"
        product.fused = True
        (first, second), other = product.parts, b if product is a else a
        before, negative = "", Value(self.kind, f"{self.name}n")
        if self.minus and product is a:  # first second - other
            before, other = f"{negative.name} = fneg {other}\n", negative
        elif self.minus:  # other - first second
            before, first = f"{negative.name} = fneg {first}\n", negative
        return f"{before}{self.name} = call {self.kind} @{FUSED[self.kind]}({first}, {second}, {other})"


def llvm_name(name: str, kind: str) -> str:
    """Name of LLVM's own function of numbers, or of vectors lane by lane."""
    return f"llvm.{name}.v{width}f64" if (width := WIDTHS[kind]) else f"llvm.{name}.f64"


FUSED = {kind: llvm_name("fmuladd", kind) for kind in WIDTHS}


@lru_cache(10_000)
def _digits(bits: bytes) -> str:
    return f"0x{int.from_bytes(bits, 'little'):016x}"


def double(number: float) -> Value:
    return Value(DOUBLE, _digits(struct.pack("<d", number)), number)


def integer(number: int) -> Value:
    return Value(INT, str(number), number)


def truth(holds: bool) -> Value:
    return Value(BOOL, "true" if holds else "false")


def vector(numbers: Sequence[float]) -> Value:
    return Value(f"<{len(numbers)} x double>", f"<{', '.join(str(double(number)) for number in numbers)}>")


class Writer:
    """The lines of one function."""

    def __init__(self) -> None:
        self.memory: dict[str, str] = {}  # of its locals
        # Text; of a store into the memory of a local also its name.
        self.lines: list[str | Product | Sum | tuple[str, str]] = []
        self.count = 0
        self.ended = False  # whether the block that is being written is complete

    def text(self, idle: set[str]) -> str:
        """All lines but those about the memory of the locals that are named."""
        found = []
        for line in self.lines:
            if isinstance(line, tuple):
                if line[0] not in idle:
                    found.append(line[1])
            else:
                found.append(line.line() if isinstance(line, Sum) else line)
        memory = [line for name, line in self.memory.items() if name not in idle]
        return "\n".join([*memory, *(line.line() if isinstance(line, Product) else line for line in found)])

    def name(self) -> str:
        """A name that no other value of the function has."""
        self.count += 1
        return f"%v{self.count}"

    def add(self, kind: str, text: str, of: str = "") -> Value:
        """Writes an instruction; its result."""
        name = self.name()
        self.lines.append(f"{name} = {text}")
        return Value(kind, name, None, of)

    # ---- blocks ----

    def label(self, word: str) -> str:
        self.count += 1
        return f"{word}{self.count}"

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")
        self.ended = False

    def go(self, label: str) -> None:
        self._end(f"br label %{label}")

    def branch(self, condition: Value, then: str, other: str) -> None:
        self._end(f"br {condition}, label %{then}, label %{other}")

    def leave(self, value: Value | str = NOTHING) -> None:
        self._end(f"ret {value}")

    def _end(self, text: str) -> None:
        self.lines.append(text)
        self.ended = True

    # ---- memory ----

    def local(self, kind: str) -> Value:
        """Memory of a local."""
        name = self.name()
        self.memory[name] = f"{name} = alloca {kind}"
        return Value(POINTER, name, None, kind)

    def load(self, place: Value, kind: str = "", of: str = "") -> Value:
        kind = kind or place.of
        return self.add(kind, f"load {kind}, {place}{ALIGNED if kind in WIDTHS else ''}", of)

    def store(self, value: Value, place: Value) -> None:
        text = f"store {value}, {place}{ALIGNED if value.kind in WIDTHS else ''}"
        self.lines.append((place.name, text) if place.name in self.memory else text)

    def element(self, start: Value, index: Value) -> Value:
        return self.add(POINTER, f"getelementptr {start.of}, {start}, {index}", start.of)

    # ---- numbers ----

    def binary(self, name: str, a: Value, b: Value) -> Value:
        return self.add(a.kind, f"{name} {a}, {b.name}")

    def product(self, a: Value, b: Value) -> Product:
        found = Product(self.name(), a, b)
        self.lines.append(found)
        return found

    def sum(self, a: Value, b: Value, minus: bool) -> Sum:
        found = Sum(self.name(), minus, a, b)
        self.lines.append(found)
        return found

    def negative(self, a: Value) -> Value:
        return self.add(a.kind, f"sub {INT} 0, {a.name}" if a.kind == INT else f"fneg {a}")

    def compare(self, relation: str, a: Value, b: Value) -> Value:
        kind = BOOL if a.kind in (INT, DOUBLE) else a.kind.replace(INT, BOOL)
        return self.add(kind, f"{'icmp' if INT in a.kind else 'fcmp'} {relation} {a}, {b.name}")

    def select(self, condition: Value, a: Value, b: Value) -> Value:
        return self.add(a.kind, f"select {condition}, {a}, {b}")

    def convert(self, name: str, value: Value, kind: str) -> Value:
        return self.add(kind, f"{name} {value} to {kind}")

    def call(self, name: str, returned: str, arguments: Sequence[Value]) -> Value:
        text = f'call {returned} @"{name}"({", ".join(map(str, arguments))})'
        if returned != NOTHING:
            return self.add(returned, text)
        self.lines.append(text)
        return Value(NOTHING, "")

    # ---- lanes ----

    def lane(self, value: Value, k: Value) -> Value:
        return self.add(DOUBLE, f"extractelement {value}, {k}")

    def shuffle(self, a: Value, lanes: Sequence[int], b: Value | str = "") -> Value:
        mask = f"<{len(lanes)} x {LANE}> <{', '.join(f'{LANE} {k}' for k in lanes)}>"
        return self.add(f"<{len(lanes)} x double>", f"shufflevector {a}, {b or f'{a.kind} undef'}, {mask}")

    def spread(self, value: Value, kind: str) -> Value:
        """A number in every lane."""
        one = self.add(kind, f"insertelement {kind} undef, {value}, {LANE} 0")
        return self.shuffle(one, [0] * WIDTHS[kind])

    def join(self, values: Sequence[Value]) -> Value:
        """A vector of these numbers."""
        kind = f"<{len(values)} x double>"
        found = Value(kind, "undef")
        for k, value in enumerate(values):
            found = self.add(kind, f"insertelement {found}, {value}, {LANE} {k}")
        return found
