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
from functools import cache

from ...definition.model import Table
from . import objects, sums
from .writer import (
    DOUBLE,
    FUSED,
    INT,
    NOTHING,
    POINTER,
    Callee,
    Product,
    Value,
    Writer,
    double,
    integer,
    llvm_name,
    truth,
)

# Kind of an argument, and of what stands at an address.
KINDS = {"D": (DOUBLE, ""), "I": (INT, ""), "P": (POINTER, DOUBLE), "Q": (POINTER, INT)}
INTRINSICS = {"exp", "log", "sin", "cos", "sqrt", "fabs", "floor", "ceil"}
# Sine and cosine, half as long as those of libm and the same everywhere: the argument less n pi/2 in three parts (the
# first two of 33 bits, so that n times them is exact), then the polynomials of fdlibm (k_sin.c, k_cos.c), in parallel
# halves. Below one unit in the last place up to 1e6, where libm takes over.
_TRIGONOMETRY = """
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
TRIGONOMETRY = {
    f"pws_{name}": _TRIGONOMETRY.format(name=name, odd=odd, turn=odd) for name, odd in (("sin", 0), ("cos", 1))
}
INTERNAL = {"sign", "heaviside", "mod", "lu_factor", "lu_solve"}
# Of integers, and of doubles: a nan is unequal to everything.
COMPARE = {
    ast.Lt: ("slt", "olt"), ast.LtE: ("sle", "ole"), ast.Gt: ("sgt", "ogt"), ast.GtE: ("sge", "oge"),
    ast.Eq: ("eq", "oeq"), ast.NotEq: ("ne", "une"),
}  # fmt: skip
FLOAT_OPS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
INT_OPS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.FloorDiv: "sdiv", ast.BitAnd: "and"}


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

    kinds, always_fuses = KINDS, False

    def __init__(self, module: Module, node: ast.FunctionDef, callee: Callee):
        self.module, self.returned, self.fuses = module, callee.returned, module.fuses
        self.writer = Writer()
        self.locals: dict[str, Value] = {}  # their memory
        # What they are at this point, where every way to it says the same, else None: by branch, the innermost last.
        self.known: list[dict[str, Value | None]] = [{}]
        self.pointers: dict[str, Value] = {}
        self.products: list[tuple[str, Product]] = []  # by the local that they were stored in
        self.loaded: set[str] = set()
        for argument, (kind, of) in zip(node.args.args, callee.arguments, strict=True):
            value = Value(kind, f"%.{argument.arg}", None, of)
            if of:
                self.pointers[argument.arg] = value
            else:
                self.store(argument.arg, value)
        self.block(node.body)
        if not self.writer.ended:
            self.writer.leave(NOTHING if self.returned == NOTHING else integer(0))
        for name, product in self.products:
            product.uses += name in self.loaded

    def text(self) -> str:
        # A local that is never loaded from memory needs no memory.
        return self.writer.text({place.name for name, place in self.locals.items() if name not in self.loaded})

    # ---- locals ----

    def value(self, name: str) -> Value | None:
        """What a local is known to be."""
        for branch in reversed(self.known):
            if name in branch:
                return branch[name]
        return None

    def store(self, name: str, value: Value) -> None:
        place = self.locals.get(name)
        if place is None:
            place = self.locals[name] = self.writer.local(value.kind)
        value = self.known[-1][name] = self.cast(value, place.of)
        if isinstance(value, Product):
            self.products.append((name, value))
        self.writer.store(value, place)

    def cast(self, value: Value, kind: str) -> Value:
        if value.kind == kind:
            return value
        if value.kind == INT and kind == DOUBLE:
            return (
                self.writer.convert("sitofp", value, DOUBLE) if value.number is None else double(value.number)
            )
        if value.kind == DOUBLE and kind == INT:
            return self.writer.convert("fptosi", value, INT)
        raise TypeError(f"{value.kind} does not become {kind}")

    def element(self, node: ast.Subscript) -> Value:
        name = node.value.id
        pointer = self.pointers.get(name) or self.writer.load(self.module.table(name), of=DOUBLE)
        return self.writer.element(pointer, self.expression(node.slice))

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
            place = self.element(target)
            self.writer.store(self.cast(value, place.of), place)

    def AugAssign(self, node):
        before = self.expression(node.target)
        self.assign(node.target, self.binary(node.op, before, self.expression(node.value)))

    def Expr(self, node):
        self.expression(node.value)

    def Return(self, node):
        value = NOTHING if node.value is None else self.cast(self.expression(node.value), self.returned)
        self.writer.leave(value)

    def If(self, node):
        then, after = self.writer.label("then"), self.writer.label("after")
        other = self.writer.label("else") if node.orelse else after
        self.writer.branch(self.expression(node.test), then, other)
        ends = []
        for start, body in ((then, node.body), (other, node.orelse)):
            if not body:
                continue
            self.writer.begin(start)
            self.known.append({})
            self.block(body)
            branch = self.known.pop()
            if not self.writer.ended:
                self.writer.go(after)
                ends.append(branch)
        for name, value in [item for end in ends for item in end.items()]:
            if self.value(name) is not value:
                self.known[-1][name] = None
        self.writer.begin(after)

    def For(self, node):
        bounds = [self.expression(a) for a in node.iter.args]
        first, stop, *step = bounds if len(bounds) > 1 else [integer(0), *bounds]
        step = step[0] if step else integer(1)
        test, body, after = (self.writer.label(word) for word in ("test", "loop", "done"))
        # The counter is its own, so that the body may change the variable, as in Python.
        counter = self.writer.local(INT)
        self.writer.store(first, counter)
        self.writer.go(test)
        self.known[-1].update(dict.fromkeys(_assigned([node])))
        self.known.append({})
        self.writer.begin(test)
        value = self.writer.load(counter)
        down = step.number is not None and step.number < 0
        self.writer.branch(self.writer.compare("sgt" if down else "slt", value, stop), body, after)
        self.writer.begin(body)
        self.store(node.target.id, value)
        self.block(node.body)
        if not self.writer.ended:
            self.writer.store(self.writer.binary("add", self.writer.load(counter), step), counter)
            self.writer.go(test)
        self.known.pop()
        self.writer.begin(after)

    # ---- expressions ----

    def expression(self, node) -> Value:
        value = getattr(self, f"_{type(node).__name__}")(node)
        if isinstance(value, Product):
            value.uses += 1
        return value

    def _Constant(self, node):
        if isinstance(node.value, bool):
            return truth(node.value)
        return integer(node.value) if isinstance(node.value, int) else double(node.value)

    def _Name(self, node):
        if node.id not in self.locals:
            return self.writer.load(self.module.sizes[node.id])
        value = self.value(node.id)
        if value is None:
            value = self.known[-1][node.id] = self.writer.load(self.locals[node.id])
            self.loaded.add(node.id)
        return value

    def _Attribute(self, node):
        return double(float(node.attr))

    def _Subscript(self, node):
        return self.writer.load(self.element(node))

    def _UnaryOp(self, node):
        value = self.expression(node.operand)
        if isinstance(node.op, ast.Not):
            return self.writer.binary("xor", value, truth(True))
        if value.number is not None:
            return double(-value.number) if value.kind == DOUBLE else integer(-value.number)
        return self.writer.negative(value)

    def _BinOp(self, node):
        return self.binary(node.op, self.expression(node.left), self.expression(node.right))

    def binary(self, op, a, b) -> Value:
        kind = type(op)
        if a.kind == b.kind == INT and kind in INT_OPS:
            return self.writer.binary(INT_OPS[kind], a, b)
        a, b = self.cast(a, DOUBLE), self.cast(b, DOUBLE)
        if kind is ast.Pow:
            return self.call(self.module.instruction("pow", DOUBLE, 2), [a, b])
        return self.arithmetic(FLOAT_OPS[kind], a, b)

    def arithmetic(self, name: str, a: Value, b: Value) -> Value:
        """A sum, difference, product or quotient of numbers, or of vectors of them."""
        if not self.fuses or name == "fdiv":
            return self.writer.binary(name, a, b)
        if name == "fmul":
            return self.writer.product(a, b)
        if a.number == 0.0 or b.number == 0.0:  # the sign of a zero does not matter
            if name == "fsub" and a.number == 0.0:
                return self.writer.negative(b)
            other = b if a.number == 0.0 else a
            if isinstance(other, Product):
                other.uses -= 1  # counted again where the sum is used
            return other
        if FUSED[a.kind] not in self.module.declarations:
            self.module.instruction("fmuladd", a.kind, 3)
        return self.writer.sum(a, b, name == "fsub")

    def _BoolOp(self, node):
        values = [self.expression(v) for v in node.values]
        result = values[0]
        for value in values[1:]:
            result = self.writer.binary("and" if isinstance(node.op, ast.And) else "or", result, value)
        return result

    @staticmethod
    def helper(name: str, count: int) -> str | None:
        """Text of functions, among them the one that calls of this name and number of arguments mean."""
        return None

    def compared(self, a, b):
        return a, b

    def choose(self, condition, a, b):
        return self.writer.select(condition, self.cast(a, DOUBLE), self.cast(b, DOUBLE))

    def _Compare(self, node):
        a, b = self.compared(self.expression(node.left), self.expression(node.comparators[0]))
        of_integers, of_doubles = COMPARE[type(node.ops[0])]
        if a.kind == b.kind == INT:
            return self.writer.compare(of_integers, a, b)
        return self.writer.compare(of_doubles, self.cast(a, DOUBLE), self.cast(b, DOUBLE))

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
            return self.writer.select(self.writer.compare("ogt" if name == "max" else "olt", b, a), b, a)
        if name == "int":
            return self.cast(args[0], INT)
        if name == "abs":
            name = "fabs"
        return self.call(self.module.callee(name, len(args)), args)

    def call(self, callee: Callee, values: list[Value]) -> Value:
        given = [self.cast(v, kind) for v, (kind, _) in zip(values, callee.arguments, strict=True)]
        return self.writer.call(callee.name, callee.returned, given)


class Module:
    """Translates one generated text into LLVM's."""

    def __init__(
        self, text: str, translated: type[Function] = Function, suffix: str = "", inside: bool = False
    ):
        self.translated = translated
        self.functions: dict[str, Callee] = {}
        self.public: list[Callee] = []  # those that kernels call
        # Text of what stands outside of functions, and of functions, by their names.
        self.declarations: dict[str, str] = {}
        self.definitions: dict[str, str] = {}
        nodes = self.read(text)
        self.fuses = self.constants.get("FUSES", translated.always_fuses)
        self.define(nodes, suffix, inside)

    def __str__(self) -> str:
        return "\n".join([*self.declarations.values(), *self.definitions.values()])

    def read(self, text: str) -> list[ast.FunctionDef]:
        """Function definitions of a text; its constants, and the numbers of elements that it reads, are noted."""
        self.constants, nodes = {}, []
        tree = objects.parsed.pop(text, None) or ast.parse(text)
        for node in tree.body:
            if isinstance(node, ast.Assign):
                self.constants[node.targets[0].id] = ast.literal_eval(node.value)
            elif isinstance(node, ast.FunctionDef):
                nodes.append(node)
        # The numbers of elements n0, n1, ... of families: written into the loaded code, so that one text serves all.
        self.sizes = {f"n{f}": self._variable(f"n{f}", INT, "0") for f in range(self.constants.get("SIZES", 0))}
        return nodes

    def define(self, nodes: list[ast.FunctionDef], suffix: str, inside: bool) -> None:
        """Functions that may call each other; the names of those that kernels call end with the suffix."""
        kinds = self.translated.kinds
        for node in nodes:
            own = inside or node.name in INTERNAL
            returned = kinds[node.returns.id][0] if node.returns else NOTHING
            arguments = [kinds[a.annotation.id] for a in node.args.args]
            callee = Callee(node.name if own else node.name + suffix, returned, arguments)
            self.functions[node.name] = callee
            if not own:
                self.public.append(callee)
        for node in nodes:
            callee = self.functions[node.name]
            given = ", ".join(
                f"{kind}{' noalias' if a.arg == 'rows' else ''} %.{a.arg}"
                for a, (kind, _) in zip(node.args.args, callee.arguments, strict=True)
            )
            head = f'define {"" if callee in self.public else "internal "}{callee.returned} @"{callee.name}"({given})'
            self.definitions[callee.name] = f"{head} {{\n{self.translated(self, node, callee).text()}\n}}"

    def _variable(self, name: str, kind: str, value: str) -> Value:
        self.declarations[name] = f"@{name} = global {kind} {value}"
        return Value(POINTER, f"@{name}", None, kind)

    def table(self, name: str) -> Value:
        """Where the pointer to a drive's table stands, which is written into the loaded code."""
        return self._variable(name, POINTER, "null")

    def declare(self, name: str, count: int, kind: str = DOUBLE) -> Callee:
        """A function of another library, or of LLVM."""
        self.declarations[name] = f'declare {kind} @"{name}"({", ".join([kind] * count)})'
        return Callee(name, kind, [(kind, "")] * count)

    def instruction(self, name: str, kind: str, count: int) -> Callee:
        """LLVM's own function of numbers, or of vectors lane by lane."""
        return self.declare(llvm_name(name, kind), count, kind)

    def callee(self, name: str, count: int) -> Callee:
        if name == "combine":  # one for each number of rows that is combined
            name, count = f"combine{count}", count - 6
        name = f"pws_{name}" if name in ("sin", "cos") else name
        if name in self.functions:
            return self.functions[name]
        part = None
        if name.startswith("pws_"):
            part = _part(Function, TRIGONOMETRY[name])
        elif text := self.translated.helper(name, count):
            part = _part(self.translated, text)
        if part:
            self.functions |= part.functions
            self.declarations |= part.declarations
            self.definitions |= part.definitions
            return self.functions[name]
        if name.startswith("libm_"):
            return self.declare(name[5:], count)
        if name in INTRINSICS:
            return self.instruction(name, DOUBLE, count)
        if name == "presum" or name.startswith("combine"):
            self.instruction("fmuladd", sums.BLOCK if name == "presum" else sums.ROW, 3)
            returned, kinds, self.definitions[name] = (
                sums.presum() if name == "presum" else sums.combine(name, count)
            )
            self.functions[name] = Callee(name, returned, [(kind, "") for kind in kinds])
            return self.functions[name]
        if name in objects.LIBM:
            return self.declare(name, count)
        raise NameError(f"generated code calls {name}, which is not known here")


@cache
def _part(translated: type[Function], text: str) -> Module:
    """Functions that many modules call, translated once."""
    return Module(f"FUSES = True\n{text}", translated, inside=True)


def object_code(text: str, first: bool, translated: type[Function]) -> bytes:
    """Object code of a generated text: the first code, or optimised."""
    module = Module(text, translated, objects.FIRST * first)
    return objects.emit(str(module), module.public if first else (), loops=bool(module.sizes))


def build(text: str, first: bool = False) -> bytes:
    """Object code of a generated text for this machine."""
    return object_code(text, first, Function)


def load(text: str, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> objects.Code:
    """Machine code of a generated text, with the numbers of elements of its families and the tables of its drives."""
    return objects.load(text, build, sizes, tables)
