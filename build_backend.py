"""How the package is built: by setuptools, and on demand a wheel that brings the numerical core compiled.

    pip install .                              compiles nothing: the first run compiles what it needs
    pip wheel --no-deps -C core=compiled .     some minutes, on all cores: the wheel of a release
    python -m build -C core=compiled           the same wheel, and an archive of the sources

The compiled core is machine code for each level of processors, and serves all versions of Python, numba and numpy on
one platform (pwsmooth/codegen/machine/cache.py).
"""

import os
import platform
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

_compiled = False  # whether the wheel that this process builds brings the core compiled


def _asks_for_core(config_settings):
    """Whether the front end was given `-C core=compiled`."""
    core = (config_settings or {}).get("core")
    if core not in (None, "compiled"):
        raise ValueError(
            f"`core` is {core!r}; `-C core=compiled` builds a wheel with its core compiled, and without it "
            "nothing is compiled."
        )
    return core is not None


def get_requires_for_build_wheel(config_settings=None):
    """Nothing for a plain wheel; what compiles the core, in the versions that the package runs with, on demand."""
    needed = build_meta.get_requires_for_build_wheel(config_settings)
    if not _asks_for_core(config_settings):
        return needed
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    compilers = ("llvmlite", "numba", "numpy", "scipy", "sympy")
    return [*needed, *(d for d in project["dependencies"] if d.startswith(compilers))]


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """The wheel: of the sources alone, or with the core compiled."""
    global _compiled
    _compiled = _asks_for_core(config_settings)
    return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)


class Modules(build_py):
    """The modules that there are, and beside them on demand the object code of the core."""

    def run(self):
        if not self.editable_mode:
            shutil.rmtree(Path(self.build_lib) / "pwsmooth", ignore_errors=True)  # of an earlier build
        super().run()
        if _compiled:
            _compile_core(Path(self.build_lib).resolve())


class Wheel(bdist_wheel):
    """A wheel for any Python: on any platform, or with the core compiled on this one."""

    def initialize_options(self):
        super().initialize_options()
        if _compiled:
            self.distribution.has_ext_modules = lambda: True  # machine code, if none that Python loads

    def get_tag(self):
        if not _compiled:
            return super().get_tag()
        tag = super().get_tag()[2].replace("universal2", platform.machine())
        if platform.libc_ver()[0] == "glibc":
            # The object code names a few functions of the C library that every version of it has.
            tag = tag.replace("linux_", "manylinux_2_17_", 1)
        return "py3", "none", tag


def _compile_core(root):
    """The core's object code for each level of processors, by the package as it was copied to `root`."""
    # The package itself, as it stands beside this file: what compiles it is no requirement of a source archive.
    from pwsmooth.codegen.machine.cache import PACKAGE, SHIPPED
    from pwsmooth.codegen.machine.objects import all_levels, level_settings
    from pwsmooth.codegen.machine.units import ALL

    shipped = root / SHIPPED.relative_to(PACKAGE.parent)
    usual = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    # An isolated build finds its requirements by PYTHONPATH.
    paths = os.pathsep.join([str(root), *filter(None, [os.environ.get("PYTHONPATH")])])
    usual |= {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1", "PWSMOOTH_CACHE_DIR": str(shipped)}
    for level in all_levels():
        program = "from pwsmooth.codegen.machine.units import ALL, unit_addresses; unit_addresses(ALL)"
        command = [sys.executable, "-c", program]
        subprocess.run(command, env=usual | level_settings(level), cwd=root, check=True)
        made = [*shipped.glob(f"*/*.{level}.o")]
        if len(made) != len(ALL):
            raise RuntimeError(f"{len(made)} of {len(ALL)} parts of the core are in {shipped} for {level}")
