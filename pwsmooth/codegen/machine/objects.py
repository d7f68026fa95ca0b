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
from .cache import models

LIBM = (
    "tan",
    "sinh",
    "cosh",
    "tanh",
    "asin",
    "acos",
    "atan",
    "asinh",
    "acosh",
    "atanh",
    "erf",
    "erfc",
    "atan2",
    "exp",
    "log",
    "sin",
    "cos",
    "pow",
    "floor",
    "ceil",
)


@cache
def _host() -> tuple[llvm.Target, str, str]:
    """Target, processor and its features; makes libm known to the linker once."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL(ctypes.util.find_library("m") or "ucrtbase")
    for name in LIBM:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return llvm.Target.from_default_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _machine() -> llvm.TargetMachine:
    target, cpu, features = _host()
    return target.create_target_machine(cpu=cpu, features=features, opt=3, codemodel="jitdefault", jit=True)


def emit(translated: ir.Module) -> bytes:
    """Object code of an LLVM module for this machine."""
    machine = _machine()
    module = llvm.parse_assembly(str(translated))
    module.data_layout = str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    passes = llvm.create_pass_builder(machine, options)
    manager = passes.getModulePassManager()
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


@cache
def machine_mark() -> str:
    """Short name of this processor and of numba's settings: object code of another one is not used."""
    _, cpu, features = _host()
    settings = sorted(
        f"{k}={v}"
        for k, v in os.environ.items()
        if (k.startswith("NUMBA_") and not _HARMLESS.match(k)) or k == "PWSMOOTH_CHECK"
    )
    with contextlib.suppress(OSError):
        settings.append(Path(".numba_config.yaml").read_text())
    return hashlib.sha256(f"{cpu}{features}{settings or ''}".encode()).hexdigest()[:8]


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
            ctypes.c_int64.from_address(self._engine.get_global_value_address(f"n{f}")).value = n
        self._tables = tables
        for i, table in enumerate(tables):
            if place := self._engine.get_global_value_address(f"table{i}"):
                ctypes.c_void_p.from_address(place).value = table.rows.ctypes.data

    def address(self, name: str) -> int:
        return self._engine.get_function_address(name)


# Code that models share; it goes with the last of them.
_loaded: WeakValueDictionary[tuple[str, tuple[int, ...], tuple[Table, ...]], Code] = WeakValueDictionary()
_lock = threading.Lock()


def load(text: str, build, sizes: tuple[int, ...] = (), tables: tuple[Table, ...] = ()) -> Code:
    """Machine code of a generated source, from the cache where this machine made it before.

    `build(text)` gives its object code. `sizes` are the numbers of elements of its families: the loops' bounds, in
    memory of this copy of the code, as are the addresses of the `tables`.
    """
    name = hashlib.sha256(text.encode()).hexdigest()[:24]
    with _lock:
        code = _loaded.get((name, sizes, tables))
        if code is None:
            stored = f"{name}.{machine_mark()}.o"
            image = models().read(stored)
            if image is None:
                image = build(text)
                models().write(stored, image)
            code = _loaded[name, sizes, tables] = Code(text, image, sizes, tables)
        return code
