"""Where compiled code lives: one directory of kernels, one of models, both named by what they were made from.

numba keys its disk cache by the stamp of *one* source file: a jitted helper edited in another file still hits
the old machine code. Here the directory carries the hash of every source that can reach the code in it:

    <root>/kernels-<hash of kernels/>              machine code of pwsmooth.kernels
    <root>/models-<hash of kernels/ and codegen/>  generated sources m<hash of text>.py, their machine code
                                                   (*.o by native.py, stiff_native.py), and
                                                   f<hash of model>.txt: which sources belong to a model

Chain: Model -> fingerprint -> (text cache, or symbolic work) -> write_module -> native.load.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib
import os
import platform
import sys
import tempfile
import threading
from functools import cache
from pathlib import Path
from types import ModuleType

import sympy as sp

_lock = threading.RLock()


@cache
def cache_root() -> Path:
    """Directory of everything compiled: PWSMOOTH_CACHE_DIR, or the user's cache, or a temporary one."""
    named = os.environ.get("PWSMOOTH_CACHE_DIR")
    if named:
        candidates = [Path(named)]
    else:
        import platformdirs

        candidates = [Path(platformdirs.user_cache_dir("pwsmooth"))]
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    candidates.append(Path(tempfile.gettempdir()) / f"pwsmooth-{user}")
    for path in candidates:
        try:
            path.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=path):
                return path
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="pwsmooth-"))


@cache
def _versions() -> str:
    from importlib.metadata import version

    packages = ("numba", "llvmlite", "numpy", "sympy")
    return "|".join((platform.python_version(), platform.machine(), *(version(name) for name in packages)))


def sources_key(*packages: str) -> str:
    """Hash of every source of the named subpackages and of the versions that compile them."""
    digest = hashlib.sha256(_versions().encode())
    here = Path(__file__).resolve().parent.parent
    # These two define what the generators read.
    files = [here / "model.py", here / "template.py"] if "codegen" in packages else []
    for package in packages:
        files += sorted((here / package).rglob("*.py"))
    for path in files:
        digest.update(path.relative_to(here).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def kernels_dir() -> Path:
    """Directory of the kernels' machine code; its name changes with any kernel source."""
    path = cache_root() / f"kernels-{sources_key('kernels')}"
    path.mkdir(parents=True, exist_ok=True)
    return path


@cache
def models_dir() -> Path:
    """Directory of generated models; its name changes with any source of kernels or codegen."""
    path = cache_root() / f"models-{sources_key('kernels', 'codegen')}"
    path.mkdir(parents=True, exist_ok=True)
    return path


@contextlib.contextmanager
def numba_cache(directory: Path | None = None):
    """`cache=True` functions decorated inside keep their machine code in `directory` (default: kernels_dir)."""
    from numba import config

    with _lock:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(directory or kernels_dir())
        try:
            yield
        finally:
            config.CACHE_DIR = before


def load_kernels(name: str) -> ModuleType:
    """Import `pwsmooth.kernels.<name>`, with its machine code in the kernels' directory.

    The first import decides, also for the kernels that it imports in turn: import kernels only through here.
    """
    full = f"pwsmooth.kernels.{name}"
    module = sys.modules.get(full)
    # A module that another thread is still importing stands in sys.modules too.
    if module is not None and not getattr(module.__spec__, "_initializing", False):
        return module
    with numba_cache():
        return importlib.import_module(full)


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file under a temporary name and move it into place, so that no reader meets half of it."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def write_module(text: str) -> Path:
    """Path of the generated source `text`, named by its content and written only if absent.

    A second writing would move the file's stamp, by which numba judges its own cache.
    """
    path = models_dir() / f"m{hashlib.sha256(text.encode()).hexdigest()[:24]}.py"
    if not path.exists():
        write_atomically(path, text)
    return path


def fingerprint(model) -> str:
    """Hash of a Model (or any nest of dataclasses, tuples and sympy expressions), equal in every process.

    As srepr, but each shared subexpression is written once: linear in the size of the graph, not of the tree.
    """
    digest = hashlib.sha256()
    number: dict = {}

    def visit(item) -> str:
        if isinstance(item, sp.Basic):
            if item in number:
                return number[item]
            if item.is_Symbol:
                # Two symbols of one name and different assumptions keep different numbers.
                line = f"{type(item).__name__}:{item.name}"
            elif item.args:
                line = f"{type(item).__name__}({','.join(visit(a) for a in item.args)})"
            else:
                line = sp.srepr(item)
            label = number[item] = f"e{len(number)}"
            digest.update(f"{label}={line}\n".encode())
            return label
        if dataclasses.is_dataclass(item):
            parts = (f"{f.name}={visit(getattr(item, f.name))}" for f in dataclasses.fields(item))
            return f"{type(item).__name__}({';'.join(parts)})"
        if isinstance(item, (tuple, list)):
            return f"[{','.join(visit(i) for i in item)}]"
        return repr(item)

    digest.update(visit(model).encode())
    return digest.hexdigest()[:24]


def cached_modules(key: str, build) -> dict[str, Path]:
    """Paths of the sources filed under `key`; `build()` -> {name: text} runs only if some are missing.

    This is what spares a second process the symbolic work.
    """
    index = models_dir() / f"f{key}.txt"
    with contextlib.suppress(OSError, ValueError):
        lines = index.read_text(encoding="utf-8").split("\n")
        paths = {name: models_dir() / file for name, file in (line.split(" ") for line in lines if line)}
        if paths and all(p.exists() for p in paths.values()):
            return paths
    paths = {name: write_module(text) for name, text in build().items()}
    write_atomically(index, "".join(f"{name} {p.name}\n" for name, p in paths.items()))
    return paths
