"""The declared lowest (or the newest) versions on every Python, from the sdist, by hand:

    python tests/matrix.py [--newest] [--python 3.11 ...] [--tests tests/test_sweep.py ...]

For each Python that is found: the package as an sdist, a fresh environment with the lowest
versions that pyproject.toml allows (`uv pip install --resolution lowest-direct`), and the sdist's own tests in it.
`uv` is installed beside if it is not there. A row for each Python: what was installed, and how the tests ended.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# The command line, the solver's two paths, impacts, stores, pages: none of many minutes.
TESTS = ("test_cli", "test_exact_switching", "test_smooth_path", "test_contact_laws", "test_sweep", "test_docs")
STORES = "tests/test_sweep_store.py::test_a_finished_store_is_read_and_opens_in_xarray"
SHOWN = ("numpy", "scipy", "sympy", "numba", "typer", "xarray", "zarr")


def run(*command: object, **options) -> str:
    """Output of a command; its end, where it fails."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, **options)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command[:4]))}: {(done.stdout + done.stderr)[-1500:]}")
    return done.stdout


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--python", nargs="*", default=["3.11", "3.12", "3.13"])
    parser.add_argument("--newest", action="store_true")
    parser.add_argument("--tests", nargs="*", default=[*(f"tests/{name}.py" for name in TESTS), STORES])
    given = parser.parse_args()
    resolution = "highest" if given.newest else "lowest-direct"
    failed = 0
    with tempfile.TemporaryDirectory(prefix="matrix-") as name:
        work = Path(name)
        venv.create(work / "tools", with_pip=True)
        tools = work / "tools" / "bin"
        run(tools / "pip", "install", "--quiet", "uv", "build")
        run(tools / "python", "-m", "build", "--sdist", "--outdir", work / "dist", ROOT)
        sdist = next((work / "dist").glob("*.tar.gz"))
        with tarfile.open(sdist) as content:
            content.extractall(work / "unpacked", filter="data")
        source = next((work / "unpacked").iterdir())
        shutil.rmtree(source / "pwsmooth")  # the installed one is what runs
        for version in given.python:
            python = shutil.which(f"python{version}")
            if not python or subprocess.run([python, "-c", ""], capture_output=True).returncode:
                print(f"{version}: not found")
                continue
            home = work / version
            # Not the checkout's: nothing but the sdist and what was installed.
            env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
            env |= {"VIRTUAL_ENV": str(home), "PWSMOOTH_CACHE_DIR": str(home / "cache"), "MPLBACKEND": "Agg"}
            try:
                run(python, "-m", "venv", "--without-pip", home)
                install = tools / "uv", "pip", "install"
                wanted = "-r", source / "pyproject.toml", "--extra", "test"
                run(*install, "--resolution", resolution, *wanted, env=env)
                run(*install, "--no-deps", sdist, env=env)
                listed = dict(line.split("==") for line in run(tools / "uv", "pip", "freeze", env=env).split()
                              if "==" in line)  # fmt: skip
                print(f"{version}:", ", ".join(f"{n} {listed.get(n, '-')}" for n in SHOWN), flush=True)
                told = run(home / "bin" / "python", "-m", "pytest", *given.tests, cwd=source, env=env)
                print(f"{version}: {told.strip().splitlines()[-1]}", flush=True)
            except RuntimeError as error:
                failed += 1
                print(f"{version}: FAILED {error}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
