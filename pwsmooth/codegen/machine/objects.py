"""Object code of this machine: made of an LLVM module, kept, linked and loaded.

A model is compiled at most twice. LLVM makes the first code in a sixth of the time; it runs 1.3 to 1.9 times as long,
loops over the elements of a family several times. Most models are called so seldom that it suffices. After MANY calls,
of a family fewer, a thread of its own optimises the code. From then on every call goes to the optimised code, and
later processes load that at once. Both codes give the same bits: our text for LLVM fixes every rounding, whatever the
degree of optimisation.

Chain: native.py, vectors.py -> LLVM's text -> object code (this file) -> cache.py; numba's own goes through `link` too.
"""

from __future__ import annotations

import _thread
import ast
import contextlib
import ctypes
import ctypes.util
import hashlib
import os
import re
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from weakref import WeakSet, WeakValueDictionary

import llvmlite.binding as llvm

from ...definition.model import Table
from ...kernels.machine import NEVER_CALLED
from .cache import models
from .clock import preparing
from .workers import announced
from .writer import Callee

# The functions of the C library that machine code may call; not every system has sincos.
LIBM = tuple(
    "tan sinh cosh tanh asin acos atan asinh acosh atanh erf erfc atan2 exp exp2 log log2 sin cos sincos pow floor "
    "ceil".split()
)
# Levels of x86-64, the richest first, and the features that a processor of each has beyond the next (System V ABI).
_LEVELS = {
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl",
    "x86-64-v3": "avx avx2 bmi bmi2 f16c fma lzcnt movbe",
    "x86-64-v2": "cx16 popcnt sahf sse3 sse4.1 sse4.2 ssse3",
}
_LONG = 50_000  # characters of a text: half a second
_nothing = ctypes.CFUNCTYPE(None)(lambda: None)
# Calls of the first code after which it is optimised: about what this costs, over what a call then gains.
MANY = 10_000
CALLED_OFTEN = "pwsmooth_called_often"
FIRST = "_first"  # how the names of the functions end in the first code


@cache
def _host() -> tuple[llvm.Target, str, str]:
    """Target, processor and its features; makes libm known to the linker once."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL(ctypes.util.find_library("m") or "ucrtbase")
    for name in LIBM:
        if function := getattr(library, name, None):
            llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    for name, function in ((NEVER_CALLED, _nothing), (CALLED_OFTEN, _called_often)):
        llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return llvm.Target.from_default_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _machine(level: int = 3) -> llvm.TargetMachine:
    target, cpu, features = _host()
    return target.create_target_machine(cpu=cpu, features=features, opt=level, codemodel="jitdefault", jit=True)


# For lines without loops, which the writer has simplified already: all of LLVM's passes take eight times as long, and
# what they make runs no faster (from 2 % faster to 2 % slower).
_PASSES = ("sroa", "new_gvn", "instruction_combine", "simplify_cfg")


def _counted(function: Callee) -> str:
    """A function that counts its calls and goes on to the code that `<name>_now` points to, at first the first one."""
    name, kind = function.name.removesuffix(FIRST), function.returned
    given = ", ".join(f"{k} %a{i}" for i, (k, _) in enumerate(function.arguments))
    result, returned = ("", "void") if kind == "void" else ("%result = ", f"{kind} %result")
    return f"""
@{name}_now = global ptr @{function.name}
define {kind} @{name}({given}) {{
  %now = load ptr, ptr @{name}_now
  %same = icmp eq ptr %now, @{function.name}
  br i1 %same, label %count, label %go
count:
  %before = load i64, ptr @calls
  %left = sub i64 %before, 1
  store i64 %left, ptr @calls
  %end = icmp eq i64 %left, 0
  br i1 %end, label %often, label %go
often:
  call void @{CALLED_OFTEN}(ptr @calls)
  br label %go
go:
  {result}call {kind} %now({given})
  ret {returned}
}}"""


def emit(text: str, first: Sequence[Callee] = (), *, loops: bool = False) -> bytes:
    """Object code of LLVM's text for this machine: optimised, or the first code, in which these functions are counted.

    With `loops` over the elements of a family, which become vectors.
    """
    if first:
        counter = f"@calls = global i64 0\ndeclare void @{CALLED_OFTEN}(ptr)"
        text = "\n".join([text, counter, *map(_counted, first)])
    machine = _machine(0 if first else 3)
    module = llvm.parse_assembly(f'target triple = "{llvm.get_default_triple()}"\n{text}')
    module.data_layout = str(machine.target_data)
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    if loops and not first:
        manager = passes.getModulePassManager()
    else:
        manager = llvm.create_new_module_pass_manager()
        for name in _PASSES[:1] if first else _PASSES:
            getattr(manager, f"add_{name}_pass")()
    manager.run(module, passes)
    # llvmlite would keep it for ever, 0.3 MB a text: an empty method of another base hides its destructor.
    own = [
        k._dispose
        for k in type(manager).__mro__
        if k.__module__.endswith("passmanagers") and "_dispose" in vars(k)
    ]
    if own:
        own[0](manager)
        manager.detach()
    return machine.emit_object(module)


# Settings of numba that do not reach machine code; any other may.
_HARMLESS = re.compile("NUMBA_(CACHE|NUM_THREADS|THREADING|WARNINGS|.*WARNING|FULL_TRACE|COLOR|CUDA)")


def _settings() -> list[str]:
    found = [
        f"{k}={v}"
        for k, v in os.environ.items()
        if (k.startswith("NUMBA_") and not _HARMLESS.match(k)) or k == "PWSMOOTH_CHECK"
    ]
    with contextlib.suppress(OSError):
        found.append(Path(".numba_config.yaml").read_text())
    return sorted(found)


@cache
def machine_mark() -> str:
    """Short name of this processor and of numba's settings: object code of another one is not used."""
    _, cpu, features = _host()
    content = f"{llvm.get_process_triple()}{cpu}{features}{_settings() or ''}"
    return hashlib.sha256(content.encode()).hexdigest()[:8]


def level_settings(level: str) -> dict[str, str]:
    """The environment in which numba compiles for all processors of a level, in the same way on all machines."""
    settings = {"NUMBA_CPU_NAME": level, "NUMBA_DISABLE_INTEL_SVML": "1"}
    # Without features numba adds those of the processor that compiles, but to "generic"; these every level has.
    return settings | ({"NUMBA_CPU_FEATURES": "+sse2"} if level in _LEVELS else {})


def all_levels() -> list[str]:
    """Levels of processors of this architecture, the richest first."""
    return [*_LEVELS] if llvm.get_process_triple().startswith("x86_64") else ["generic"]


@cache
def unit_marks() -> list[str]:
    """Names of the kinds of machine code of kernels that run here: the richest level, ..., this very processor.

    In the environment of a level its code is used, and in one with other settings of numba code of that alone.
    """
    settings = _settings()
    for level in all_levels():
        if settings == sorted(f"{k}={v}" for k, v in level_settings(level).items()):
            return [level]
    if settings:
        return [machine_mark()]
    has = llvm.get_host_cpu_features()
    levels = all_levels()
    while levels and not all(map(has.get, " ".join(_LEVELS.get(k, "") for k in levels).split())):
        del levels[0]  # a level needs the features of those below it too
    return [*levels, machine_mark()]


def link(image: bytes) -> llvm.ExecutionEngine:
    """Object code made executable; it lives as long as the engine."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(image))
    engine.finalize_object()
    return engine


class Code:
    """Loaded object code; it lives as long as this object."""

    def __init__(self, text: str, build, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()):
        head, *functions = text.split("\ndef ")  # constants stand before the functions
        self.constants = {
            node.targets[0].id: ast.literal_eval(node.value)
            for node in ast.parse(head).body
            if isinstance(node, ast.Assign)
        }
        self.text, self._build, self._sizes, self._tables = text, build, sizes, tables
        self._names = [function.partition("(")[0] for function in functions]
        self._optimised: llvm.ExecutionEngine | None = None
        self._turn = threading.Lock()
        # A call of a family's code does the work of all its elements. That of a patch reads numbers of elements and
        # tables that are written into the code that is loaded first: an optimised one would not have them.
        few = 2 * MANY // max(sum(sizes), 2)  # calls of the first code
        patch = not sizes and self.constants.get("SIZES")
        self._engine = self._linked(_image(text, build, first=few > 1 and not patch))
        if calls := self.place("calls"):
            ctypes.c_int64.from_address(calls).value = few
            _counting[calls] = self

    def _linked(self, image: bytes) -> llvm.ExecutionEngine:
        """An engine with this copy's sizes and tables."""
        engine = link(image)
        for f, n in enumerate(self._sizes):
            ctypes.c_int64.from_address(engine.get_global_value_address(f"n{f}")).value = n
        for i, table in enumerate(self._tables):
            if place := engine.get_global_value_address(f"table{i}"):
                ctypes.c_void_p.from_address(place).value = table.rows.ctypes.data
        return engine

    def optimise(self) -> None:
        """Makes the optimised code; calls go to it from then on."""
        with self._turn:
            if self._optimised:
                return
            engine = self._optimised = self._linked(_make(self.text, self._build, first=False))
            parsed.pop(self.text, None)
            for name in self._names:
                if place := self.place(f"{name}_now"):
                    ctypes.c_void_p.from_address(place).value = engine.get_function_address(name)

    def address(self, name: str) -> int:
        return self._engine.get_function_address(name)

    def place(self, name: str) -> int:
        """Address of a number or pointer that this copy of the code reads, 0 where it reads none."""
        return self._engine.get_global_value_address(name)


# Code that models share; it goes with the last of them.
_loaded: WeakValueDictionary[tuple[str, tuple[int, ...], tuple[Table, ...]], Code] = WeakValueDictionary()
_counting: WeakValueDictionary[int, Code] = WeakValueDictionary()  # by where it counts its calls
_optimising: WeakSet[threading.Thread] = WeakSet()
_lock = threading.Lock()
# Texts to be optimised, parsed by the thread that calls them: two threads of Python 3.11 cannot parse at one time.
parsed: dict[str, ast.Module] = {}


@ctypes.CFUNCTYPE(None, ctypes.c_size_t)
def _called_often(place: int) -> None:
    """Starts the thread that optimises a code. The first code itself calls this, in the midst of a run."""
    try:
        if code := _counting.pop(place, None):
            parsed[code.text] = ast.parse(code.text)
            thread = threading.Thread(target=code.optimise)
            _optimising.add(thread)
            thread.start()
    except KeyboardInterrupt:  # meant for the run; an exception here would be lost
        _thread.interrupt_main()
    except RuntimeError:  # Python is shutting down and starts no thread
        pass


def _finish_optimising() -> None:
    """Waits for the threads that optimise. A fork while they compile would leave LLVM locked in the child for ever."""
    for thread in list(_optimising):
        if thread.is_alive() and thread is not threading.current_thread():
            thread.join()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_finish_optimising)


def load(text: str, build, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> Code:
    """Machine code of a generated source, from the cache where this machine made it before.

    `build(text, first)` gives its object code. `sizes` are the numbers of elements of its families: the loops' bounds,
    in memory of this copy of the code, as are the addresses of the `tables`.
    """
    key = text, sizes, tables
    with _lock:
        code = _loaded.get(key)
        if code is None:
            code = _loaded[key] = Code(text, build, sizes, tables)
        return code


def _image(text: str, build, first: bool) -> bytes:
    """Object code, optimised where that was made before; else, where the first will do, that."""
    for one in (False, True) if first else (False,):
        if image := models().read(_file(text, one)):
            return image
    # Compiling a short text takes too little time to announce.
    with announced("compiling the functions of a model", after=2) if len(text) > _LONG else preparing():
        return _make(text, build, first)


def _make(text: str, build, first: bool) -> bytes:
    image = build(text, first)
    models().write(_file(text, first), image)
    return image


def _file(text: str, first: bool) -> str:
    return f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.{machine_mark()}{'.first' if first else ''}.o"
