"""Object code of this machine: made of an LLVM module, kept, linked and loaded.

Chain: native.py, vectors.py -> LLVM module -> object code (this file) -> cache.py; numba's own goes through `link` too.
"""

from __future__ import annotations

import ast
import contextlib
import ctypes
import ctypes.util
import hashlib
import os
import re
import threading
from functools import cache
from pathlib import Path
from weakref import WeakValueDictionary

import llvmlite.binding as llvm
from llvmlite import ir

from ...definition.model import Table
from ...kernels.machine import NEVER_CALLED
from .cache import models
from .workers import announced

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
_nothing = ctypes.CFUNCTYPE(None)(lambda: None)


@cache
def _host() -> tuple[llvm.Target, str, str]:
    """Target, processor and its features; makes libm known to the linker once."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL(ctypes.util.find_library("m") or "ucrtbase")
    for name in LIBM:
        if function := getattr(library, name, None):
            llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    llvm.add_symbol(NEVER_CALLED, ctypes.cast(_nothing, ctypes.c_void_p).value)
    return llvm.Target.from_default_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _machine() -> llvm.TargetMachine:
    target, cpu, features = _host()
    return target.create_target_machine(cpu=cpu, features=features, opt=3, codemodel="jitdefault", jit=True)


# For lines without loops, which the writer has simplified already: all of LLVM's passes take eight times as long, and
# what they make runs no faster (from 2 % faster to 2 % slower).
_PASSES = ("sroa", "new_gvn", "instruction_combine", "simplify_cfg")


def emit(translated: ir.Module) -> bytes:
    """Object code of an LLVM module for this machine."""
    machine = _machine()
    module = llvm.parse_assembly(str(translated))
    module.data_layout = str(machine.target_data)
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    if "n0" in translated.globals:  # loops over the elements of a family become vectors
        manager = passes.getModulePassManager()
    else:
        manager = llvm.create_new_module_pass_manager()
        for name in _PASSES:
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

    def __init__(self, text: str, image: bytes, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()):
        head = ast.parse(text.partition("\ndef ")[0])  # constants stand before the functions
        self.constants = {
            node.targets[0].id: ast.literal_eval(node.value)
            for node in head.body
            if isinstance(node, ast.Assign)
        }
        self._engine = link(image)
        for f, n in enumerate(sizes):
            ctypes.c_int64.from_address(self.place(f"n{f}")).value = n
        self._tables = tables
        for i, table in enumerate(tables):
            if place := self.place(f"table{i}"):
                ctypes.c_void_p.from_address(place).value = table.rows.ctypes.data

    def address(self, name: str) -> int:
        return self._engine.get_function_address(name)

    def place(self, name: str) -> int:
        """Address of a number or pointer that this copy of the code reads, 0 where it reads none."""
        return self._engine.get_global_value_address(name)


# Code that models share; it goes with the last of them.
_loaded: WeakValueDictionary[tuple[str, tuple[int, ...], tuple[Table, ...]], Code] = WeakValueDictionary()
_lock = threading.Lock()


def load(text: str, build, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> Code:
    """Machine code of a generated source, from the cache where this machine made it before.

    `build(text)` gives its object code. `sizes` are the numbers of elements of its families: the loops' bounds, in
    memory of this copy of the code, as are the addresses of the `tables`.
    """
    name = _name(text)
    with _lock:
        code = _loaded.get((name, sizes, tables))
        if code is None:
            code = _loaded[name, sizes, tables] = Code(text, _image(text, build), sizes, tables)
        return code


def load_alone(text: str, build, tables: tuple[Table, ...] = ()) -> Code:
    """A copy of its own, whose sizes one run changes as it goes."""
    return Code(text, _image(text, build), (), tables)


def _name(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _image(text: str, build) -> bytes:
    stored = f"{_name(text)}.{machine_mark()}.o"
    image = models().read(stored)
    if image is None:
        with announced("compiling the functions of a model", after=2):
            image = build(text)
        models().write(stored, image)
    return image
