"""How the package is built: by setuptools, and a wheel with the kernels' machine code for each level of processors.

Such a wheel serves all versions of Python, numba and numpy on one platform (pwsmooth/codegen/machine/cache.py). An
editable install has no machine code: that is made at the first run.
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


def get_requires_for_build_wheel(config_settings=None):
    """What compiles the kernels, in the versions that the package runs with."""
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    compilers = [
        d for d in project["dependencies"] if d.startswith(("llvmlite", "numba", "numpy", "scipy", "sympy"))
    ]
    return [*build_meta.get_requires_for_build_wheel(config_settings), *compilers]


class CompiledKernels(build_py):
    """The modules, and beside them the object code of the kernels."""

    def run(self):
        super().run()
        if self.editable_mode:
            return
        # The package itself, as it stands beside this file: what compiles it is no requirement of a source archive.
        from pwsmooth.codegen.machine.cache import PACKAGE, SHIPPED
        from pwsmooth.codegen.machine.objects import all_levels, level_settings
        from pwsmooth.codegen.machine.units import ALL

        root = Path(self.build_lib).resolve()
        shipped = root / SHIPPED.relative_to(PACKAGE.parent)
        shutil.rmtree(shipped, ignore_errors=True)  # of an earlier build
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
                raise RuntimeError(
                    f"{len(made)} of {len(ALL)} parts of the kernels are in {shipped} for {level}"
                )


class PlatformWheel(bdist_wheel):
    """A wheel for one platform and any Python."""

    def initialize_options(self):
        super().initialize_options()
        self.distribution.has_ext_modules = lambda: True  # machine code, if none that Python loads

    def get_tag(self):
        tag = super().get_tag()[2].replace("universal2", platform.machine())
        if platform.libc_ver()[0] == "glibc":
            # The object code names a few functions of the C library that every version of it has.
            tag = tag.replace("linux_", "manylinux_2_17_", 1)
        return "py3", "none", tag
