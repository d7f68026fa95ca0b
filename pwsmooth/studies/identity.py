"""What a value is to the last bit, as a hash that is equal in every process: what a resumed sweep must agree on.

A measure is more than the text of its function: closures, defaults and the globals that it reads decide its values
too. Code of installed packages is known by their versions, everything else by what it consists of. What has no such
description (an open file, a lock) is not compared but refused.

Chain: plan.identity -> **this** -> store.py.
"""

from __future__ import annotations

import copyreg
import dis
import hashlib
import inspect
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from ..codegen.machine.cache import fingerprint
from ..system import System

UNKNOWN = "holds what cannot be compared"
# Attributes of a class that are not its code.
_ABOUT = ("__dict__", "__weakref__", "__doc__", "__module__", "__annotations__", "__annotate__", "__abstractmethods__",
          "__annotations_cache__", "__dataclass_fields__", "__dataclass_params__", "__firstlineno__", "_abc_impl",
          "__static_attributes__", "__orig_bases__", "__parameters__")  # fmt: skip


def digest(value: Any) -> str:
    """Short hash of a value; UNKNOWN and the culprit's type where one process cannot compare it with another's."""
    teller = _Teller()
    try:
        words = teller.tell(value)
    except RecursionError:
        teller.unknown.append(f"{type(value).__qualname__}, nested too deeply")
    if teller.unknown:
        return f"{UNKNOWN}: {teller.unknown[0]}"
    return hashlib.sha256(words.encode()).hexdigest()[:12]


class _Teller:
    def __init__(self) -> None:
        self.named: dict[int, tuple[int, Any]] = {}  # functions, classes and modules, each described once
        self.within: list[int] = []  # what is being described: a cycle ends there
        self.unknown: list[str] = []

    def tell(self, item: Any) -> str:
        """The value in words."""
        if item is None or item is Ellipsis or type(item) in (bool, int, complex, str, bytes):
            return f"{type(item).__name__} {item!r}"
        if type(item) is float:
            return f"float {item.hex()}"
        if isinstance(item, sp.Basic):
            return f"expression {fingerprint(item)}"
        if isinstance(item, (types.FunctionType, type, types.ModuleType)):
            if id(item) in self.named:
                return f"number {self.named[id(item)][0]}"
            self.named[id(item)] = len(self.named), item
        elif id(item) in self.within:
            return f"around {self.within.index(id(item))}"
        self.within.append(id(item))
        try:
            return self._parts(item)
        finally:
            self.within.pop()

    def _parts(self, item: Any) -> str:
        kind, tell = type(item).__qualname__, self.tell
        if isinstance(item, (np.ndarray, np.generic)) and not item.dtype.hasobject:
            return f"array {item.dtype.str} {item.shape} {hashlib.sha256(item.tobytes()).hexdigest()}"
        if type(item) in (tuple, list):
            return f"{kind} [{'; '.join(map(tell, item))}]"
        if type(item) in (set, frozenset):
            return f"{kind} [{'; '.join(sorted(map(tell, item)))}]"
        if type(item) in (dict, types.MappingProxyType):
            return f"{kind} [{'; '.join(f'{tell(k)}: {tell(v)}' for k, v in item.items())}]"
        if isinstance(item, types.ModuleType):
            return installed(item.__name__) or f"module {tell(_source(item))}"
        if isinstance(item, (types.FunctionType, type)):
            known = installed(item.__module__ or "")
            return f"{kind} {known or item.__module__}.{item.__qualname__} {tell(_inside(item, bool(known)))}"
        if isinstance(item, types.CodeType):
            code = item.co_code, item.co_names, item.co_varnames, item.co_freevars, item.co_exceptiontable
            return f"code {tell(code)} {tell(item.co_consts)}"
        # The function inside partials, methods, properties, numba dispatchers and caches; a user's class may hold more.
        for inner in ("func", "__func__", "fget", "py_func", "__wrapped__") * bool(
            installed(type(item).__module__)
        ):
            if isinstance(function := getattr(item, inner, None), types.FunctionType):
                held = [getattr(item, name, None) for name in ("__self__", "args", "keywords", "fset")]
                return f"{kind} {tell(function)} {tell(held)}"
        if isinstance(item, System):
            return f"system {fingerprint(item.model)} {tell(dict(item.parameters))}"
        try:
            reduce = copyreg.dispatch_table.get(type(item))  # as pickle sees it
            made = reduce(item) if reduce else item.__reduce_ex__(4)
        except Exception:
            self.unknown.append(f"{type(item).__module__}.{kind}")
            return ""
        if isinstance(made, str):
            module = getattr(item, "__module__", None) or ""
            return f"{installed(module) or module} {made}"
        head, items = list(made[:3]), [list(part or ()) for part in made[3:5]]
        return f"{kind} {tell(head)} {tell(items)}"


def installed(module: str) -> str:
    """Package and version of what is not the user's own code, else ""."""
    root = module.partition(".")[0]
    if root in sys.stdlib_module_names or root == "pwsmooth":
        return module  # the sweep's versions tell these
    package = sys.modules.get(root)
    where = Path(getattr(package, "__file__", None) or ".").parts
    version = getattr(package, "__version__", "") if {"site-packages", "dist-packages"} & set(where) else ""
    return version and f"{module} {version}"


def _inside(item: Any, packaged: bool) -> Any:
    """What a function or a class consists of; where its code is known, what is not in the code."""
    if isinstance(item, type):
        if packaged:
            return None
        held = {k: v for k, v in vars(item).items() if k not in _ABOUT and not inspect.isdatadescriptor(v)
                or isinstance(v, property)}  # fmt: skip
        return [item.__bases__, held]
    cells = [cell.cell_contents if cell != types.CellType() else None for cell in item.__closure__ or ()]
    if packaged:
        return item.__code__.co_firstlineno, cells
    read = {name: item.__globals__[name] for name in sorted(_read(item.__code__)) if name in item.__globals__}
    return [item.__code__, item.__defaults__, item.__kwdefaults__, cells, read, item.__dict__]


def _read(code: types.CodeType) -> set[str]:
    """Names of the globals that the code reads."""
    names = {i.argval for i in dis.get_instructions(code) if i.opname in ("LOAD_GLOBAL", "LOAD_NAME")}
    return names.union(*(_read(c) for c in code.co_consts if isinstance(c, types.CodeType)))


def _source(module: types.ModuleType) -> Any:
    try:
        return inspect.getsource(module)
    except (OSError, TypeError):
        return vars(module)  # made by hand
