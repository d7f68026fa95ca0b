"""Where compiled code lives: one folder of kernels, one of models, both named by what they were made from.

The name carries the hash of every source that can reach the code in it, so that no stamp of a file decides:

    <root>/kernels-<hash of kernels/>              <unit>.<machine>.o: machine code of pwsmooth.kernels (units.py)
    <root>/models-<hash of kernels/ and codegen/>  <hash of model>.json: generated sources of a model,
                                                   <hash of source>.<machine>.o: their machine code (objects.py)

Machine code of kernels names nothing of Python's or numba's and serves every version of them; a wheel brings it
(build_backend.py), in a root that is only read. What is generated may change with the version of sympy or llvmlite:
the hash of models holds these. Every file begins with the sha256 of its place and its content. A file that does not
bear it out, as of a disk that lost a page, or that another user may have written, is none: its content is made again.
Code is looked up in every folder of the roots, kept in the first that takes it, and in memory alone where none does.

Chain: Model -> fingerprint -> (text cache, or symbolic work) -> native.load -> objects.load.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import hashlib
import importlib
import json
import os
import platform
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import IO

import sympy as sp

from .workers import announced

PACKAGE = Path(__file__).resolve().parent.parent.parent
SHIPPED = PACKAGE / "_compiled"  # the root that a wheel brings
KEPT = 8  # folders of a kind in a root, the ones used last
PATIENCE = 600.0  # seconds: another process that has not made a file by then is taken to be stopped
_USER = os.geteuid() if hasattr(os, "geteuid") else None


@cache
def roots() -> list[Path]:
    """Where folders may be: PWSMOOTH_CACHE_DIR or the user's cache, then a temporary one of this user."""
    named = os.environ.get("PWSMOOTH_CACHE_DIR")
    if not named:
        import platformdirs

        named = platformdirs.user_cache_dir("pwsmooth")
    user = os.environ.get("USERNAME", "user") if _USER is None else _USER
    return [Path(named).absolute(), Path(tempfile.gettempdir()) / f"pwsmooth-{user}"]


def _trusted(found: os.stat_result, path: Path) -> bool:
    """Whether only the user, root, or who installed the package can have written it: machine code is run unread."""
    if _USER is None:
        return True  # Windows: a user's folders are closed to others by their access lists
    closed = found.st_uid in (0, _USER) and not found.st_mode & 0o022
    return closed or path.resolve().is_relative_to(PACKAGE)


def _lock(stream: IO) -> None:
    """The system's lock on an open file, which ends with the process that holds it; an OSError where it is held."""
    if os.name == "nt":
        import msvcrt

        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)


class Folder:
    """Checked files of one kind, in the folder `<root>/<kind>-<key>` of every root."""

    def __init__(self, kind: str, key: str):
        self.kind, self.name = kind, f"{kind}-{key}"
        self.places = [root / self.name for root in roots()]
        for place in self.places:
            with contextlib.suppress(OSError):
                os.utime(place)  # used last: see _tidy

    def _mark(self, file: str, content: bytes) -> bytes:
        # With the place, so that one file renamed to another is not taken for it.
        return hashlib.sha256(f"{self.name}/{file}\0".encode() + content).digest()

    def read(self, file: str) -> bytes | None:
        """Content of the file; None where no trusted folder holds it undamaged."""
        for place in (SHIPPED / self.name, *self.places):
            with contextlib.suppress(OSError):
                if not _trusted(place.stat(), place):
                    continue
                with open(place / file, "rb") as stream:
                    if not _trusted(os.fstat(stream.fileno()), place / file):
                        continue
                    content = stream.read()
                if content[:32] == self._mark(file, content[32:]):
                    return content[32:]
        return None

    def write(self, file: str, content: bytes) -> None:
        """Keep the content for later processes, in the first folder that takes it; a warning where none does."""
        refused = []
        for place in self.places:
            try:
                self._open(place)
                return write_atomically(place / file, self._mark(file, content) + content)
            except OSError as error:
                refused.append(f"{place}: {error}")
        _warn_once(tuple(refused))

    @contextlib.contextmanager
    def alone(self, file: str) -> Iterator[None]:
        """No other process makes this file meanwhile: it waits here, and finds it made.

        Nobody waits where no folder can be written or locked, nor longer than PATIENCE.
        """
        for place in self.places:
            try:
                self._open(place)
                stream = open(place / f".{file}.lock", "ab")
                break
            except OSError:
                continue
        else:
            yield
            return
        with stream:
            end = time.monotonic() + PATIENCE
            while time.monotonic() < end:
                try:
                    _lock(stream)
                    break
                except OSError as error:
                    if error.errno not in (errno.EACCES, errno.EAGAIN):
                        break  # this disk knows no locks
                time.sleep(0.05)
            try:
                yield
            finally:  # who waits for it has it open; Windows removes no such file
                with contextlib.suppress(OSError):
                    os.unlink(stream.name)

    def _open(self, place: Path) -> None:
        """Makes the folder if need be; an OSError if this user cannot, or must not write there."""
        if not place.exists():
            # Whatever the umask, as others may not write here; they may read, as a shared cache must be.
            place.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
            place.mkdir(mode=0o755, exist_ok=True)
            self._tidy(place.parent)
        if not _trusted(place.stat(), place):
            raise PermissionError("it belongs to another user, or others may write to it")

    def _tidy(self, root: Path) -> None:
        """Remove the folders of older sources."""
        with contextlib.suppress(OSError):  # another process may do the same
            found = [(p.stat().st_mtime, p) for p in root.glob(f"{self.kind}-*")]
            for _, old in sorted(found, reverse=True)[KEPT:]:
                shutil.rmtree(old, ignore_errors=True)


@cache
def _warn_once(refused: tuple[str, ...]) -> None:
    warnings.warn(
        f"compiled code cannot be kept ({'; '.join(refused)}), so every process compiles again. Make room, or name a "
        "folder of yours in PWSMOOTH_CACHE_DIR.",
        RuntimeWarning,
        stacklevel=2,
    )


@cache
def versions() -> str:
    """What generated code may depend on beside the sources."""
    from importlib.metadata import version

    packages = ("numba", "llvmlite", "numpy", "sympy")
    return "|".join((platform.python_version(), platform.machine(), *map(version, packages)))


def sources_key(*packages: str, besides: str = "") -> str:
    """Hash of every source of the named subpackages, or of all."""
    # The format of the files too: versions that write another one keep to their own folders.
    digest = hashlib.sha256(f"sha256|{besides}".encode())
    files = []
    for package in packages or ("",):
        files += sorted((PACKAGE / package).rglob("*.py"))
    for path in files:
        digest.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def kernels() -> Folder:
    """The kernels' machine code; the folder's name changes with any kernel source."""
    return Folder("kernels", sources_key("kernels"))


@cache
def models() -> Folder:
    """Generated models; the folder's name changes with any source of what a Model is, kernels or codegen."""
    return Folder("models", sources_key("door", "definition", "kernels", "codegen", besides=versions()))


def load_kernels(name: str) -> ModuleType:
    """Import `pwsmooth.kernels.<name>`, which compiles it."""
    return importlib.import_module(f"pwsmooth.kernels.{name}")


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under a temporary name and move it into place, so that no reader meets half of it.

    After a power cut the name may stand without the content, which its mark then tells: nobody waits for the disk.
    """
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


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
                # Two symbols of one name and different assumptions keep different numbers. What is known of a
                # symbol may decide how an expression of it is written.
                known = sorted(item.assumptions0.items())
                line = f"{type(item).__name__}:{item.name}:{known}"
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


def cached_texts(key: str, build: Callable[[], dict[str, str]]) -> dict[str, str]:
    """The sources filed under `key`; `build()` -> {name: text} runs only if they are missing.

    This is what spares a second process the symbolic work.
    """
    content = models().read(f"{key}.json")
    if content is not None:
        return json.loads(content)
    with announced("deriving the functions of a model", after=2):
        texts = build()
    models().write(f"{key}.json", json.dumps(texts).encode())
    return texts
