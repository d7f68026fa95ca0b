"""One wheel under the declared lowest (or the newest) versions on every Python, by hand:

    python tests/matrix.py [--newest] [--python 3.11 ...] [--wheel FILE] [--tests tests/studies/test_sweep.py ...]

The wheel is built once, from the sdist and with this Python. For each Python that is found: a fresh environment with
the lowest versions that pyproject.toml allows (`uv pip install --resolution lowest-direct`), the wheel, its commands
far from any checkout, and the sdist's tests; its machine code must serve them all, nothing of the core is compiled
again. `uv` is installed beside. Rows for each Python: what was installed, the first solution, how the tests ended.
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
TESTS = (
    "codegen/test_levels",
    "house/test_cli",
    "paths/test_exact_switching",
    "paths/test_smooth_path",
    "laws/test_contact_laws",
    "studies/test_sweep",
    "house/test_docs",
)
STORES = "tests/studies/test_sweep_store.py::test_a_finished_store_is_read_and_opens_in_xarray"
FIRST = """
import time
begin = time.perf_counter(), time.process_time()
import sympy as sp
from pwsmooth import System, solve
t, y, v = sp.symbols("t y v", real=True)
sol = solve(System({y: v, v: 2 * sp.sin(t) - 3 * y - v / 10 - sp.sign(v)}, time=t), (0, 25), {y: 0.5, v: 0.3})
assert sol.success and len(sol.events) > 3
wall, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
print(f"{wall:.1f} s to the first solution, {processor:.1f} s of a processor")
"""
STUDY = """
measures = ["sticks"]
[system]
scene = "block_on_belt"
law = "Coulomb"
[axes]
spring = [1.0, 2.0]
"""
COMMANDS = {
    "verify": 0,
    "ladder --list": 0,
    "sweep study.toml": 0,
    "warmup": 0,
    "figures": 2,
}  # with their exit codes
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
    parser.add_argument("--wheel", type=Path, help="one that is there, beside its sdist, instead of a new one")
    parser.add_argument("--tests", nargs="*", default=[*(f"tests/{name}.py" for name in TESTS), STORES])
    given = parser.parse_args()
    resolution = "highest" if given.newest else "lowest-direct"
    failed = 0
    with tempfile.TemporaryDirectory(prefix="matrix-") as name:
        work = Path(name)
        venv.create(work / "tools", with_pip=True)
        tools = work / "tools" / "bin"
        run(tools / "pip", "install", "--quiet", "uv", "build")
        if given.wheel:
            dist, wheel = given.wheel.resolve().parent, given.wheel.resolve()
        else:
            dist = work / "dist"
            run(tools / "python", "-m", "build", "-C", "core=compiled", "--outdir", dist, ROOT)
            wheel = next(dist.glob("*.whl"))
        sdist = next(dist.glob("*.tar.gz"))
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
                run(*install, "--no-deps", wheel, env=env)
                listed = dict(line.split("==") for line in run(tools / "uv", "pip", "freeze", env=env).split()
                              if "==" in line)  # fmt: skip
                print(f"{version}:", ", ".join(f"{n} {listed.get(n, '-')}" for n in SHOWN), flush=True)
                empty = home / "empty"
                empty.mkdir()
                print(
                    f"{version}:",
                    run(home / "bin" / "python", "-c", FIRST, cwd=empty, env=env).strip(),
                    flush=True,
                )
                (empty / "study.toml").write_text(STUDY)
                for command, code in COMMANDS.items():
                    program = [home / "bin" / "pwsmooth", *command.split()]
                    done = subprocess.run(program, cwd=empty, env=env, capture_output=True, text=True)
                    if done.returncode != code:
                        raise RuntimeError(
                            f"pwsmooth {command}: {done.returncode}, {done.stdout + done.stderr}"
                        )
                told = run(home / "bin" / "python", "-m", "pytest", *given.tests, cwd=source, env=env)
                print(f"{version}: {told.strip().splitlines()[-1]}", flush=True)
                if again := [*(home / "cache").glob("kernels-*/*.o")]:
                    raise RuntimeError(f"the wheel's code did not serve: {len(again)} parts were compiled")
            except RuntimeError as error:
                failed += 1
                print(f"{version}: FAILED {error}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
