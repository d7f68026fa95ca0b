"""What the benchmark scripts share: where the references are, and the provenance of a result file."""

from __future__ import annotations

import json
import os
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# The references are shared with the tests, which keep them independent of the package.
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "tests"), str(ROOT)]  # models of the tests; paper_figures

PACKAGES = ("pwsmooth", "numpy", "scipy", "sympy", "numba", "llvmlite", "heyoka", "numbalsoda", "scikit-sundae",
            "diffrax", "jax", "nosnoc", "casadi", "solve_nivp")  # fmt: skip


def provenance():
    """Versions and kind of machine: ratios travel between machines, absolute times do not."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    return {
        "versions": versions,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "processor": processor(),
        "system": platform.system(),
        "cores": os.cpu_count(),
    }


def processor():
    """The processor's name where the system tells it."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text().splitlines() if told.exists() else []
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor()
    )


def write_json(path, data):
    """Write whole or not at all; where it was written to is no part of a result."""
    if "options" in data:
        data = data | {"options": {name: value for name, value in data["options"].items() if name != "out"}}
    target = Path(path)
    part = target.with_name(target.name + ".part")
    part.write_text(json.dumps(data, indent=1, default=float) + "\n")
    part.replace(target)
