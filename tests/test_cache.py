"""The compile cache: hits in a second process, and none that is stale."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import sympy as sp

from pwsmooth import System, solve
from pwsmooth.codegen import cache
from pwsmooth.model import Model, Multiplier

X = sp.Symbol("x", real=True)
PACKAGE = Path(cache.__file__).resolve().parent.parent

# Three models through one kernel, which reaches each of them by address; reports what was compiled and loaded.
PROGRAM = """
import json, sys
import numpy as np, sympy as sp
from pwsmooth.codegen import cache, compile_model, native
from pwsmooth.model import Model

built = []
original = cache.cached_modules
def counting(key, build):
    def counted():
        built.append(key)
        return build()
    return original(key, counted)
cache.cached_modules = counting

machine_code = []
build = native.build
native.build = lambda text: machine_code.append(text) or build(text)

probe = cache.load_kernels("probe")
t, x = sp.symbols("t x", real=True)
results = []
for rate in (-x, sp.sin(x), x * t):
    compiled = compile_model(Model(t, (x,), (), (rate,)))
    results.append(probe.sum_of_jet(compiled.jet_slip, np.array([2.0]), np.zeros((compiled.nrows_slip, 8))))
core = probe.sum_of_jet.stats
print(json.dumps({
    "results": results, "built": len(built),
    "core": [sum(core.cache_hits.values()), sum(core.cache_misses.values())],
    "models": len(machine_code),
    "kernels": cache.kernels_dir().name, "signatures": len(probe.sum_of_jet.signatures)}))
"""

PROBE = """
import numpy as np
from numba import njit

from .helper import weight
from .pointers import call_jet_slip


@njit(cache=True)
def sum_of_jet(address, x, rows):
    call_jet_slip(address, 0.5, x, x, x, 2, rows.shape[1], rows)
    return weight() * rows[0, :3].sum()
"""

HELPER = """
from numba import njit


@njit(cache=True)
def weight():
    return {value}
"""


def run(tmp_path, program=PROGRAM):
    """Run a program in a new process on the copy of the package; its report."""
    env = os.environ | {"PWSMOOTH_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_one_core_serves_three_models_hits_in_a_second_process_and_is_never_stale(tmp_path):
    kernels = tmp_path / "pwsmooth" / "kernels"
    shutil.copytree(PACKAGE, tmp_path / "pwsmooth", ignore=shutil.ignore_patterns("__pycache__"))
    (kernels / "probe.py").write_text(PROBE)
    (kernels / "helper.py").write_text(HELPER.format(value=1.0))
    sums = [2 - 2 + 1, None, 2 + 1 + 1.25]

    first = run(tmp_path)
    assert first["signatures"] == 1 and first["core"] == [0, 1]
    assert first["models"] == 3 and first["built"] == 3
    assert first["results"][0] == sums[0] and first["results"][2] == sums[2]

    second = run(tmp_path)
    assert second["core"] == [1, 0] and second["models"] == 0 and second["built"] == 0
    assert second["results"] == first["results"]

    # A helper in another file than the jitted core: numba's own stamp would not see it. Its size stays equal,
    # and so does its time.
    stamp = (kernels / "helper.py").stat()
    (kernels / "helper.py").write_text(HELPER.format(value=3.0))
    os.utime(kernels / "helper.py", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    third = run(tmp_path)
    assert third["results"] == [3 * r for r in first["results"]]
    assert third["core"] == [0, 1] and third["kernels"] != first["kernels"]


# Systems through solve(): a forced oscillator with dry friction, a relay, a hidden term; the first smoothed, too.
SOLVES = """
import json
import sys
import sympy as sp
from pwsmooth import Switch, System, solve
from pwsmooth.codegen import native, stiff_native, units

built, compiled = [], []
load = units.load_kernels
units.load_kernels = lambda name: compiled.append(name) or load(name)
build, build_stiff = native.build, stiff_native.build
native.build = lambda text: built.append(text) or build(text)
stiff_native.build = lambda text: built.append(text) or build_stiff(text)
t, x, y = sp.symbols("t x y", real=True)
v = Switch("v", y)
w = Switch("w", x)
rubbing = System({x: y, y: sp.sin(t) - x - v / 2}, time=t)
solutions = [
    solve(rubbing, (0, 20), {x: 1.0, y: 0.5}),
    solve(rubbing.smoothed(eps=1e-3), (0, 20), {x: 1.0, y: 0.5}),
    solve(System({x: sp.cos(t) - w * 2}, time=t), (0, 5), {x: 1.0}),
    solve(System({x: -w, y: 2 * w**2 - 1}, time=t), (0, 3), {x: 1.0, y: 0.0})]
print(json.dumps({
    "ends": [s.x[:, -1].tolist() for s in solutions], "steps": [int(s.cost["steps"]) for s in solutions],
    "models": len(built), "core": sorted(set(compiled)), "numba": "numba" in sys.modules}))
"""


def test_three_solves_share_one_core_that_is_a_hit_in_a_second_process_and_see_a_changed_kernel(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "pwsmooth", ignore=shutil.ignore_patterns("__pycache__"))
    first = run(tmp_path, SOLVES)
    assert {"trajectory", "stiff_loop"} <= set(first["core"]) and first["models"] > 0
    second = run(tmp_path, SOLVES)
    assert second["core"] == [] and second["models"] == 0 and not second["numba"]
    assert second["ends"] == first["ends"] and second["steps"] == first["steps"]

    # The step size rule stands in another file than the loop; its size and its time are kept.
    steps = tmp_path / "pwsmooth" / "kernels" / "steps.py"
    stamp, text = steps.stat(), steps.read_text()
    assert "return 0.94 * min(" in text
    steps.write_text(text.replace("return 0.94 * min(", "return 0.20 * min("))
    os.utime(steps, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    third = run(tmp_path, SOLVES)
    assert third["core"] == first["core"] and third["steps"][0] > 2 * first["steps"][0]


def test_a_source_is_written_once_and_keeps_its_stamp(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "models_dir", lambda: tmp_path)
    path = cache.write_module("value = 1\n")
    stamp = path.stat().st_mtime_ns
    os.utime(path, ns=(stamp - 10**9, stamp - 10**9))
    assert cache.write_module("value = 1\n") == path
    assert path.stat().st_mtime_ns == stamp - 10**9
    assert cache.write_module("value = 2\n") != path
    assert not list(tmp_path.glob(".*"))  # no temporary file is left behind


def test_an_unwritable_directory_falls_back_to_a_temporary_one(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("no directory")
    monkeypatch.setenv("PWSMOOTH_CACHE_DIR", str(blocked / "below"))
    root = cache.cache_root.__wrapped__()
    assert root.is_dir() and blocked not in root.parents
    with (root / "probe").open("w") as stream:
        stream.write("writable")
    (root / "probe").unlink()


def test_models_have_one_fingerprint_exactly_if_they_are_equal():
    t, x, lam = sp.symbols("t x lam", real=True)
    a = sp.Symbol("a", positive=True)

    rate = -a * sp.sin(x)

    def model(rate=rate, name="lam", hidden=False):
        switch = Multiplier(sp.Symbol(name, real=True), "switch", -lam, x, hidden=hidden)
        return Model(t, (x,), (a,), (rate,), (switch,))

    same = cache.fingerprint(model())
    assert cache.fingerprint(model(sp.sin(x) * -a)) == same
    others = [model(-a * sp.sin(2 * x)), model(name="mu"), model(hidden=True), model(-a * sp.cos(x))]
    renamed = Model(t, (sp.Symbol("w"),), (a,), (-a * sp.sin(sp.Symbol("w")),))
    plain = Model(t, (x,), (a,), (rate,))
    assert len({same, *map(cache.fingerprint, (*others, renamed, plain))}) == 7


def test_fingerprints_do_not_depend_on_the_process():
    program = (
        "import sympy as sp\n"
        "from pwsmooth.codegen.cache import fingerprint\n"
        "from pwsmooth.model import Model\n"
        "t, x, y = sp.symbols('t x y', real=True);"
        "e = sp.Piecewise((x*y + sp.sin(x), sp.And(x > 0, y > t)), (sp.Max(x, y, t), True));"
        "print(fingerprint(Model(t, (x, y), (), (e, x - y))))"
    )
    prints, command = set(), [sys.executable, "-c", program]
    for seed in ("1", "2", "3"):
        env = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(PACKAGE.parent)}
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        prints.add(done.stdout)
    assert len(prints) == 1


BESIDE_NUMBA = """
import sys
import numpy as np, sympy as sp
from pwsmooth import Switch, System, solve
from pwsmooth.compare.plain import plain
from pwsmooth.compare.timestepping import stepper

x, v = sp.symbols("x v", real=True)
system = System({x: v, v: -x - Switch("lam", v)})
plain(system).bare(0.0, np.array([12.0, 6.0]))  # numba has told the linker of its runtime
if "solve" in sys.argv:
    solve(system, (0, 1), {x: 12, v: 6})  # links the units
print(stepper(plain(system))(0.0, 1.0, np.array([12.0, 6.0]), 10, 0.5)[0][-1].tolist())
"""


def test_linked_units_leave_the_runtime_of_numba_alone():
    solve(System({X: -sp.sign(X)}), (0, 1), {X: 2})  # compiles the units, if this is the first process
    printed = [
        subprocess.run([sys.executable, "-c", BESIDE_NUMBA, *more], capture_output=True, text=True)
        for more in ([], ["solve"])
    ]
    assert [p.returncode for p in printed] == [0, 0], printed[1].stderr
    assert printed[0].stdout == printed[1].stdout
