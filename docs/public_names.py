"""What is public, in one place: the tests of docstrings and the reference pages both ask here.

A module that declares `__all__` is public with the names there; one without is internal, as the compiled core is.
A name that several modules list has one home, the shortest path; of equally long ones that where it is defined.
"""

import functools
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pwsmooth

# Numbers and text for the compiler: nothing a user imports, and slow to load.
INTERNAL = ("pwsmooth.kernels", "pwsmooth.codegen", "pwsmooth.__main__")


def public_modules() -> Iterator[ModuleType]:
    """The package and all modules below it that declare `__all__`."""
    yield pwsmooth
    for found in pkgutil.walk_packages(pwsmooth.__path__, "pwsmooth.", onerror=_raise):
        if not found.name.startswith(INTERNAL):
            module = importlib.import_module(found.name)
            if hasattr(module, "__all__"):
                yield module


def _raise(name: str) -> None:
    raise ImportError(f"{name} cannot be imported")


def public_names() -> dict[str, Any]:
    """Full name at its home -> object, in alphabetical order of modules, then of names."""
    homes: dict[tuple[str, int], tuple[tuple[int, bool, str], str, Any]] = {}
    for module in public_modules():
        for name in module.__all__:
            value = getattr(module, name)
            path = module.__name__
            elsewhere = path != getattr(value, "__module__", path)
            rank = path.count("."), elsewhere, path
            key = name, id(value)
            if key not in homes or rank < homes[key][0]:
                homes[key] = rank, name, value
    found = sorted(((rank[2], name), value) for rank, name, value in homes.values())
    return {f"{path}.{name}": value for (path, name), value in found}


def members(cls: type) -> dict[str, Any]:
    """Public methods and properties that a class or a private base of it defines, as they stand there."""
    kinds = (property, functools.cached_property, classmethod, staticmethod)
    fields = getattr(cls, "__dataclass_fields__", {})  # a function as the default of one is no method
    bases = [
        base for base in cls.__mro__ if base.__module__.startswith("pwsmooth") and base.__name__.startswith("_")
    ]
    return {
        name: value
        for owner in dict.fromkeys((*reversed(bases), cls))
        for name, value in vars(owner).items()
        if not name.startswith("_")
        and name not in fields
        and (inspect.isfunction(value) or isinstance(value, kinds))
    }
