"""Generated text -> machine code, without a compiler's front end in between.

Generated functions are plain Python in a small, typed subset: locals that are doubles, integers or truth
values, pointers indexed by integers, `if`, `for ... in range`, `return`, arithmetic, `math` and three helpers.
That subset maps line by line onto LLVM, through the llvmlite that numba brings along. numba itself would
spend 85 % of its time on type inference and lowering: a jet program takes 0.8 s there and 0.15 s here, and one
of forty blocks 22 s and 2 s.

    double t: D    integer i: I    pointer to doubles x: P    pointer to integers mask: Q

Chain: fields.py, jets.py -> text -> cache.cached_texts -> `load` (this file) -> addresses.
"""

from __future__ import annotations

import ast
from collections.abc import Collection
from functools import cache
from typing import Any

from llvmlite import binding, ir
from llvmlite.ir import instructions

from ...definition.model import Table
from . import objects
from .sums import BLOCK, BOOL, DOUBLE, INT, ROW, block_sum, combine

KINDS = {"D": DOUBLE, "I": INT, "P": DOUBLE.as_pointer(), "Q": INT.as_pointer()}
INTRINSICS = {"exp", "log", "sin", "cos", "sqrt", "fabs", "floor", "ceil"}
# Sine and cosine, half as long as those of libm and the same everywhere: the argument less n pi/2 in three parts (the
# first two of 33 bits, so that n times them is exact), then the polynomials of fdlibm (k_sin.c, k_cos.c), in parallel
# halves. Below one unit in the last place up to 1e6, where libm takes over.
TRIGONOMETRY = """
def pws_{name}(x: D) -> D:
    if not abs(x) <= 1e6:
        return libm_{name}(x)
    n = math.floor(x * 0.6366197723675814 + 0.5)
    r = ((x - n * 1.57079632673412561417) - n * 6.07710050630396597660e-11) - n * 2.02226624879595063154e-21
    q = int(n)
    z = r * r
    w = z * z
    s = z * r * (
        (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03)
        + w * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
        + w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    c = w * (
        (4.16666666666666019037e-02 - z * 1.38888888888741095749e-03)
        + w * ((2.48015872894767294178e-05 - z * 2.75573143513906633035e-07)
        + w * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11))
    )
    half = 0.5 * z
    one = 1.0 - half
    cosine = one + ((1.0 - one) - half + c)
    value = choose(q & 1 == {odd}, r + s, cosine)
    return choose((q + {turn}) & 2 == 2, -value, value)
"""
INTERNAL = {"sign", "heaviside", "mod", "lu_factor", "lu_solve"}
COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
FLOAT_OPS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
INT_OPS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.FloorDiv: "sdiv", ast.BitAnd: "and_"}


def _is_zero(value: ir.Value) -> bool:
    return isinstance(value, ir.Constant) and value.constant == 0.0


class Numbering:
    """Numbers the values of a function to name them. llvmlite's own way of naming takes three times as long."""

    def __init__(self) -> None:
        self.count = 0

    def register(self, name: str, deduplicate: bool = False) -> str:
        self.count += 1
        return f"{name}_{self.count}"


class Written(ir.Function):
    """A function whose definition is given as LLVM text."""

    definition = ""

    def __str__(self) -> str:
        return self.definition


class Product(ir.Instruction):
    """A product, which may become one fused instruction with a sum."""

    uses = 0


class Sum(ir.Instruction):
    """A sum or difference. With a product that nothing else uses it becomes one fused instruction.

    We choose this here and do not leave it to LLVM, so that every degree of optimisation rounds alike.
    """

    fused: ir.Function
    forms: list[tuple[Product, list[ir.Value]]]  # each product in it, and the arguments if that is taken in

    def descr(self, buf) -> None:
        parts = next((parts for product, parts in self.forms if product.uses == 1), None)
        if parts is None:
            return super().descr(buf)
        given = ", ".join(f"{part.type} {part.get_reference()}" for part in parts)
        buf.append(f"call {self.type} {self.fused.get_reference()}({given})\n")


def _assigned(statements) -> set[str]:
    """Names of the locals that statements assign."""
    names: set[str] = set()
    for node in statements:
        targets = getattr(node, "targets", None) or [getattr(node, "target", None)]
        names |= {target.id for target in targets if isinstance(target, ast.Name)}
        names |= _assigned([*getattr(node, "body", ()), *getattr(node, "orelse", ())])
    return names


class Function:
    """Translates one function definition."""

    kinds = KINDS

    def __init__(self, module: Module, node: ast.FunctionDef, function: ir.Function):
        self.module, self.function, self.fuses = module, function, module.fuses
        function.scope = Numbering()
        self.entry = ir.IRBuilder(function.append_basic_block("entry"))
        self.builder = ir.IRBuilder(function.append_basic_block("body"))
        self.locals: dict[str, ir.Value] = {}  # their memory
        self.known: dict[str, ir.Value] = {}  # what they are at this point, where every way to it says the same
        self.pointers: dict[str, ir.Value] = {}
        self.products: list[tuple[str, Product]] = []  # by the local that they were stored in
        self.loaded: set[str] = set()
        for argument, value in zip(node.args.args, function.args, strict=True):
            if value.type.is_pointer:
                self.pointers[argument.arg] = value
            else:
                self.store(argument.arg, value)
        self.block(node.body)
        if not self.builder.block.is_terminated:
            if function.function_type.return_type == ir.VoidType():
                self.builder.ret_void()
            else:
                self.builder.ret(INT(0))
        self.entry.branch(function.blocks[1])
        for name, product in self.products:
            product.uses += name in self.loaded
        # A local that is never loaded from memory needs no memory.
        idle = {id(slot) for name, slot in self.locals.items() if name not in self.loaded}
        for part in function.blocks:
            part.instructions = [
                i
                for i in part.instructions
                if id(i) not in idle
                and not (isinstance(i, instructions.StoreInstr) and id(i.operands[1]) in idle)
            ]

    # ---- locals ----

    def store(self, name: str, value: ir.Value) -> None:
        slot = self.locals.get(name)
        if slot is None:
            slot = self.locals[name] = self.entry.alloca(value.type, name=name)
        value = self.known[name] = self.cast(value, slot.type.pointee)
        if isinstance(value, Product):
            self.products.append((name, value))
        self.builder.store(value, slot)

    def cast(self, value: ir.Value, kind: ir.Type) -> ir.Value:
        if value.type == kind:
            return value
        if value.type == INT and kind == DOUBLE:
            if isinstance(value, ir.Constant):
                return DOUBLE(float(value.constant))
            return self.builder.sitofp(value, DOUBLE)
        if value.type == DOUBLE and kind == INT:
            return self.builder.fptosi(value, INT)
        raise TypeError(f"{value.type} does not become {kind}")

    def element(self, node: ast.Subscript) -> ir.Value:
        name = node.value.id
        pointer = self.pointers[name] if name in self.pointers else self.builder.load(self.module.table(name))
        return self.builder.gep(pointer, [self.expression(node.slice)])

    # ---- statements ----

    def block(self, statements) -> None:
        for statement in statements:
            getattr(self, type(statement).__name__)(statement)

    def Assign(self, node):
        value = self.expression(node.value)
        if isinstance(value, Product) and all(isinstance(target, ast.Name) for target in node.targets):
            value.uses -= 1  # giving it a name does not use it
        for target in node.targets:
            self.assign(target, value)

    def assign(self, target, value) -> None:
        if isinstance(target, ast.Name):
            self.store(target.id, value)
        else:
            pointer = self.element(target)
            self.builder.store(self.cast(value, pointer.type.pointee), pointer)

    def AugAssign(self, node):
        before = self.expression(node.target)
        self.assign(node.target, self.binary(node.op, before, self.expression(node.value)))

    def Expr(self, node):
        self.expression(node.value)

    def Return(self, node):
        if node.value is None:
            self.builder.ret_void()
        else:
            kind = self.function.function_type.return_type
            self.builder.ret(self.cast(self.expression(node.value), kind))

    def If(self, node):
        then, after = (self.function.append_basic_block(name) for name in ("then", "after"))
        other = self.function.append_basic_block("else") if node.orelse else after
        self.builder.cbranch(self.expression(node.test), then, other)
        before, ends = self.known, []
        for start, body in ((then, node.body), (other, node.orelse)):
            if not body:
                continue
            self.builder.position_at_end(start)
            self.known = dict(before)
            self.block(body)
            if not self.builder.block.is_terminated:
                self.builder.branch(after)
                ends.append(self.known)
        for end in ends:
            before = {name: value for name, value in before.items() if end.get(name) is value}
        self.known = before
        self.builder.position_at_end(after)

    def For(self, node):
        bounds = [self.expression(a) for a in node.iter.args]
        first, stop, *step = bounds if len(bounds) > 1 else [INT(0), *bounds]
        step = step[0] if step else INT(1)
        test, body, after = (self.function.append_basic_block(name) for name in ("test", "loop", "done"))
        # The counter is its own, so that the body may change the variable, as in Python.
        counter = self.entry.alloca(INT)
        self.builder.store(first, counter)
        self.builder.branch(test)
        changed = _assigned([node])
        before = {name: v for name, v in self.known.items() if name not in changed}
        self.known = dict(before)
        self.builder.position_at_end(test)
        value = self.builder.load(counter)
        down = isinstance(step, ir.Constant) and step.constant < 0
        self.builder.cbranch(self.builder.icmp_signed(">" if down else "<", value, stop), body, after)
        self.builder.position_at_end(body)
        self.store(node.target.id, value)
        self.block(node.body)
        if not self.builder.block.is_terminated:
            self.builder.store(self.builder.add(self.builder.load(counter), step), counter)
            self.builder.branch(test)
        self.known = before
        self.builder.position_at_end(after)

    # ---- expressions ----

    def expression(self, node) -> ir.Value:
        value = getattr(self, f"_{type(node).__name__}")(node)
        if isinstance(value, Product):
            value.uses += 1
        return value

    def _Constant(self, node):
        if isinstance(node.value, bool):
            return BOOL(node.value)
        return INT(node.value) if isinstance(node.value, int) else DOUBLE(node.value)

    def _Name(self, node):
        if node.id not in self.locals:
            return self.builder.load(self.module.sizes[node.id])
        if node.id not in self.known:
            self.known[node.id] = self.builder.load(self.locals[node.id])
            self.loaded.add(node.id)
        return self.known[node.id]

    def _Attribute(self, node):
        return DOUBLE({"nan": float("nan"), "inf": float("inf")}[node.attr])

    def _Subscript(self, node):
        return self.builder.load(self.element(node))

    def _UnaryOp(self, node):
        value = self.expression(node.operand)
        if isinstance(node.op, ast.Not):
            return self.builder.not_(value)
        if isinstance(value, ir.Constant):
            return value.type(-value.constant)
        return self.builder.fneg(value) if value.type == DOUBLE else self.builder.neg(value)

    def _BinOp(self, node):
        return self.binary(node.op, self.expression(node.left), self.expression(node.right))

    def binary(self, op, a, b) -> ir.Value:
        kind = type(op)
        if a.type == b.type == INT and kind in INT_OPS:
            return getattr(self.builder, INT_OPS[kind])(a, b)
        a, b = self.cast(a, DOUBLE), self.cast(b, DOUBLE)
        if kind is ast.Pow:
            return self.builder.call(self.module.instruction("pow", DOUBLE, 2), [a, b])
        return self.arithmetic(FLOAT_OPS[kind], a, b)

    def arithmetic(self, name: str, a: ir.Value, b: ir.Value) -> ir.Value:
        """A sum, difference, product or quotient of numbers, or of vectors of them."""
        if not self.fuses or name == "fdiv":
            return getattr(self.builder, name)(a, b)
        if name != "fmul" and (_is_zero(a) or _is_zero(b)):  # the sign of a zero does not matter
            if name == "fsub" and _is_zero(a):
                return self.builder.fneg(b)
            other = b if _is_zero(a) else a
            if isinstance(other, Product):
                other.uses -= 1  # counted again where the sum is used
            return other
        made = (Product if name == "fmul" else Sum)(self.builder.block, a.type, name, (a, b))
        if isinstance(made, Sum):
            made.fused, made.forms = self.module.instruction("fmuladd", a.type, 3), []
            signed = self.builder.fneg if name == "fsub" else lambda value: value
            if isinstance(a, Product):
                made.forms.append((a, [*a.operands, signed(b)]))
            if isinstance(b, Product):
                made.forms.append((b, [signed(b.operands[0]), b.operands[1], a]))
        self.builder._insert(made)
        return made

    def _BoolOp(self, node):
        values = [self.expression(v) for v in node.values]
        result = values[0]
        for value in values[1:]:
            result = (self.builder.and_ if isinstance(node.op, ast.And) else self.builder.or_)(result, value)
        return result

    @staticmethod
    def helper(name: str, count: int) -> str | None:
        """Text of a function that calls of this name and number of arguments mean."""
        return None

    def compared(self, a, b):
        return a, b

    def choose(self, condition, a, b):
        return self.builder.select(condition, self.cast(a, DOUBLE), self.cast(b, DOUBLE))

    def _Compare(self, node):
        a, b = self.compared(self.expression(node.left), self.expression(node.comparators[0]))
        op = COMPARE[type(node.ops[0])]
        if a.type == b.type == INT:
            return self.builder.icmp_signed(op, a, b)
        a, b = self.cast(a, DOUBLE), self.cast(b, DOUBLE)
        # nan is unequal to everything
        return self.builder.fcmp_unordered(op, a, b) if op == "!=" else self.builder.fcmp_ordered(op, a, b)

    def _Call(self, node):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id
        # A pointer is passed on by its name.
        args = [
            self.pointers[a.id] if isinstance(a, ast.Name) and a.id in self.pointers else self.expression(a)
            for a in node.args
        ]
        if name == "choose":
            return self.choose(*args)
        if name in ("max", "min"):
            a, b = (self.cast(v, DOUBLE) for v in args)
            return self.builder.select(self.builder.fcmp_ordered(">" if name == "max" else "<", b, a), b, a)
        if name == "int":
            return self.cast(args[0], INT)
        if name == "abs":
            name = "fabs"
        callee = self.module.callee(name, len(args))
        kinds = callee.function_type.args
        return self.builder.call(callee, [self.cast(v, k) for v, k in zip(args, kinds, strict=True)])


class Module:
    """Translates one generated text into an LLVM module."""

    def __init__(self, text: str, translated: type[Function] = Function, suffix: str = ""):
        self.translated = translated
        self.module = ir.Module("pwsmooth")
        self.module.triple = binding.get_default_triple()
        definitions = self.read(text)
        self.fuses = self.constants.get("FUSES", False)
        self.functions: dict[str, ir.Function] = {}
        self.define(definitions, suffix=suffix)

    def read(self, text: str) -> list[ast.FunctionDef]:
        """Function definitions of a text; its constants, and the numbers of elements that it reads, are noted."""
        self.constants, definitions = {}, []
        for node in ast.parse(text).body:
            if isinstance(node, ast.Assign):
                self.constants[node.targets[0].id] = ast.literal_eval(node.value)
            elif isinstance(node, ast.FunctionDef):
                definitions.append(node)
        # The numbers of elements n0, n1, ... of families: written into the loaded code, so that one text serves all.
        self.sizes = {
            f"n{f}": ir.GlobalVariable(self.module, INT, f"n{f}") for f in range(self.constants.get("SIZES", 0))
        }
        for variable in self.sizes.values():
            variable.initializer = INT(0)
        return definitions

    def define(self, definitions: list[Any], internal: Collection[str] = INTERNAL, suffix: str = "") -> None:
        """Functions that may call each other; the names of those that kernels call end with the suffix."""
        kinds = self.translated.kinds
        for node in definitions:
            arguments = [kinds[a.annotation.id] for a in node.args.args]
            returned = kinds[node.returns.id] if node.returns else ir.VoidType()
            name = node.name if node.name in internal else node.name + suffix
            function = ir.Function(self.module, ir.FunctionType(returned, arguments), name)
            if node.name in internal:
                function.linkage = "internal"
            for argument, value in zip(node.args.args, function.args, strict=True):
                if argument.arg == "rows":
                    value.add_attribute("noalias")
            self.functions[node.name] = function
        for node in definitions:
            self.translated(self, node, self.functions[node.name])

    def table(self, name: str) -> ir.GlobalVariable:
        """The pointer to a drive's table, which is written into the loaded code."""
        if name not in self.module.globals:
            variable = ir.GlobalVariable(self.module, KINDS["P"], name)
            variable.initializer = KINDS["P"](None)
        return self.module.globals[name]

    def instruction(self, name: str, kind: ir.Type, count: int) -> ir.Function:
        """LLVM's own function of numbers, or of vectors lane by lane."""
        full = f"llvm.{name}.v{kind.count}f64" if isinstance(kind, ir.VectorType) else f"llvm.{name}.f64"
        if full not in self.module.globals:
            ir.Function(self.module, ir.FunctionType(kind, [kind] * count), full)
        return self.module.globals[full]

    def callee(self, name: str, count: int) -> ir.Function:
        if name == "combine":  # one for each number of rows that is combined
            name, count = f"combine{count}", count - 6
        if name in self.functions:
            return self.functions[name]
        if text := self.translated.helper(name, count):
            self.define(ast.parse(text).body)
            return self.functions[name]
        if name in ("sin", "cos"):
            function = self.written(*_trigonometry(name))
        elif name.startswith("libm_"):
            function = ir.Function(self.module, ir.FunctionType(DOUBLE, [DOUBLE]), name[5:])
        elif name in INTRINSICS:
            return self.instruction(name, DOUBLE, count)
        elif name == "presum":
            function = block_sum(self.module, self.instruction("fmuladd", BLOCK, 3))
        elif name.startswith("combine"):
            function = combine(self.module, self.instruction("fmuladd", ROW, 3), name, count)
        elif name in objects.LIBM:
            function = ir.Function(self.module, ir.FunctionType(DOUBLE, [DOUBLE] * count), name)
        else:
            raise NameError(f"generated code calls {name}, which is not known here")
        self.functions[name] = function
        return function

    def written(self, first: ir.Function, definition: str) -> ir.Function:
        """A function of another module, known by its text, and what it calls declared."""
        for other in first.module.functions:
            if other is not first and other.name not in self.module.globals:
                ir.Function(self.module, other.function_type, other.name)
        function = Written(self.module, first.function_type, first.name)
        function.definition = definition
        return function


@cache
def _trigonometry(name: str) -> tuple[ir.Function, str]:
    """Sine or cosine and its definition, translated once: in each module anew it would take a tenth of all the time."""
    text = TRIGONOMETRY.format(name=name, odd=0 if name == "sin" else 1, turn=0 if name == "sin" else 1)
    module = Module(f"FUSES = True\n{text}")
    function = module.functions[f"pws_{name}"]
    function.linkage = "internal"
    return function, str(function)


def build(text: str, first: bool = False) -> bytes:
    """Object code of a generated text for this machine."""
    return objects.emit(Module(text, suffix=objects.FIRST * first).module)


def load(text: str, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> objects.Code:
    """Machine code of a generated text, with the numbers of elements of its families and the tables of its drives."""
    return objects.load(text, build, sizes, tables)
