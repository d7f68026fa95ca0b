"""The compile cache: hits in a second process, and none that is stale."""

import errno
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time

import pytest
import sympy as sp

from pwsmooth import System, solve
from pwsmooth.codegen.machine import cache, objects
from pwsmooth.codegen.machine.workers import announced
from pwsmooth.definition.model import Model, Multiplier

X = sp.Symbol("x", real=True)
PACKAGE = cache.PACKAGE


def run(tmp_path, program):
    """Run a program in a new process on the copy of the package; its report, with the parts of the core compiled."""
    env = os.environ | {"PWSMOOTH_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    parts = re.findall(r"compiling (one|\d+) parts? of its numerical core", done.stderr)
    return json.loads(done.stdout) | {"core": sum(1 if p == "one" else int(p) for p in parts)}


# Systems through solve(): a forced oscillator with dry friction, smoothed; itself, a relay, a hidden term.
BEGINS = """
import json
import sys
import sympy as sp
from pwsmooth import Switch, System, solve
from pwsmooth.codegen.machine import native, vectors

built = []
build, build_stiff = native.build, vectors.build
native.build = lambda text, first: built.append(text) or build(text, first)
vectors.build = lambda text, first: built.append(text) or build_stiff(text, first)
t, x, y = sp.symbols("t x y", real=True)
v = Switch("v", y)
w = Switch("w", x)
rubbing = System({x: y, y: sp.sin(t) - x - v / 2}, time=t)
solutions = [solve(rubbing.smoothed(eps=1e-3), (0, 20), {x: 1.0, y: 0.5})]
"""
THREE_MORE = """
solutions += [
    solve(rubbing, (0, 20), {x: 1.0, y: 0.5}),
    solve(System({x: sp.cos(t) - w * 2}, time=t), (0, 5), {x: 1.0}),
    solve(System({x: -w, y: 2 * w**2 - 1}, time=t), (0, 3), {x: 1.0, y: 0.0})]
"""
ENDS = """
print(json.dumps({
    "ends": [s.x[:, -1].tolist() for s in solutions], "steps": [int(s.cost["steps"]) for s in solutions],
    "models": len(built), "numba": "numba" in sys.modules}))
"""


# The exact loop with the five that these models call (no fold, no singular point), and the stiff one with five.
EXACT = "trajectory.run instant.instants.at_instant step.roots.isolate surface.layer.layer surface.sliding.newton " \
    "instant.other_motions.report_other_motions"  # fmt: skip
STIFF = "loop.integrate radau.attempt_unit step.taylor_unit sparse.sparse_factor sparse.sparse_solve events.events_unit"
CORE = {*EXACT.split(), *(f"stiff.{name}" for name in STIFF.split())}
QUICK = {"surface.sliding.newton", "stiff.sparse.sparse_solve"}  # to compile


def test_solves_share_one_core_that_is_a_hit_in_a_second_process_and_see_a_changed_kernel(tmp_path):
    program = BEGINS + THREE_MORE + ENDS

    def compiled():
        return {path.name: path for place in cache.kernels().places for path in place.glob("*.o")}

    if not CORE <= {name.rpartition(".o")[0].rpartition(".")[0] for name in compiled()}:
        subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)
    known = compiled()
    folder = tmp_path / "cache" / cache.kernels().places[0].name
    folder.mkdir(parents=True, mode=0o700)
    for name, path in known.items():
        if any(name.startswith(f"{part}.") for part in CORE - QUICK):
            shutil.copy(path, folder)
    shutil.copytree(PACKAGE, tmp_path / "pwsmooth", ignore=shutil.ignore_patterns("__pycache__"))
    first = run(tmp_path, program)
    assert first["core"] == len(QUICK) and first["models"] > 0
    second = run(tmp_path, program)
    assert second["core"] == 0 and second["models"] == 0 and not second["numba"]
    assert second["ends"] == first["ends"] and second["steps"] == first["steps"]

    # The step size rule stands in another file than the loop; its size and its time are kept.
    steps = tmp_path / "pwsmooth" / "kernels" / "stiff" / "taylor.py"
    stamp, text = steps.stat(), steps.read_text()
    assert "return 0.9 * min(" in text
    steps.write_text(text.replace("return 0.9 * min(", "return 0.2 * min("))
    os.utime(steps, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    third = run(tmp_path, BEGINS + ENDS)
    assert third["core"] == len(STIFF.split()) and third["steps"][0] > 1.2 * first["steps"][0]


def test_a_changed_kernel_has_another_key_whatever_its_size_and_time(tmp_path, monkeypatch):
    shutil.copytree(PACKAGE / "kernels", tmp_path / "kernels", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(cache, "PACKAGE", tmp_path)
    before, steps = cache.sources_key("kernels"), tmp_path / "kernels" / "stiff" / "taylor.py"
    stamp, text = steps.stat(), steps.read_text()
    steps.write_text(text.replace("return 0.9 * min(", "return 0.2 * min("))
    os.utime(steps, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert steps.stat().st_size == stamp.st_size and cache.sources_key("kernels") != before


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A Folder of two empty roots."""
    monkeypatch.setattr(cache, "roots", lambda: [tmp_path / "one", tmp_path / "two"])
    cache._warn_once.cache_clear()
    return cache.Folder("models", "key")


def forbid(monkeypatch, *roots, error=errno.EROFS):
    """Let writing into these fail, as on a disk that is full or read-only (the tests may run as root)."""
    write = cache.write_atomically

    def refuse(path, content):
        if any(root in path.parents for root in roots):
            raise OSError(error, os.strerror(error))
        write(path, content)

    monkeypatch.setattr(cache, "write_atomically", refuse)


def flip(content, bit=1234):
    return content[: bit // 8] + bytes([content[bit // 8] ^ 1 << bit % 8]) + content[bit // 8 + 1 :]


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-1],
        lambda content: content[: len(content) // 2],
        lambda content: bytes(len(content)),
        lambda content: content[:-64] + bytes(64),
        lambda content: content + b"0",
        flip,
        lambda content: flip(content, 3),
    ],
)
def test_a_damaged_file_is_a_miss_and_is_written_again(folder, damage):
    content = bytes(range(256))
    folder.write("a.o", content)
    path = folder.places[0] / "a.o"
    path.write_bytes(damage(path.read_bytes()))
    assert folder.read("a.o") is None
    folder.write("a.o", content)
    assert folder.read("a.o") == content
    assert not list(path.parent.glob(".*"))  # no temporary file is left behind


def test_a_file_is_not_taken_for_another(folder):
    folder.write("a.o", b"code")
    shutil.copy(folder.places[0] / "a.o", folder.places[0] / "b.o")
    assert folder.read("b.o") is None
    newer = cache.Folder("models", "other")
    shutil.copytree(folder.places[0], newer.places[0])
    assert newer.read("a.o") is None


@pytest.mark.parametrize("what", ["folder", "file"])
def test_what_another_user_may_have_written_is_neither_read_nor_added_to(folder, what):
    folder.write("a.o", b"code")
    place = folder.places[0]
    path = place if what == "folder" else place / "a.o"
    changes = [lambda: path.chmod(0o777), lambda: path.chmod(0o775)]
    if os.getuid() == 0:
        changes.append(lambda: os.chown(path, 12345, 12345))
    for change in changes:
        path.chmod(0o755)
        assert folder.read("a.o") == b"code"
        change()
        assert folder.read("a.o") is None
    if what == "folder":
        folder.write("b.o", b"code")
        assert not (place / "b.o").exists() and folder.read("b.o") == b"code"


def test_folders_are_closed_to_others_whatever_the_umask(folder):
    before = os.umask(0)
    try:
        folder.write("a.o", b"code")
    finally:
        os.umask(before)
    assert not (folder.places[0].stat().st_mode | folder.places[0].parent.stat().st_mode) & 0o022


def test_a_folder_that_can_only_be_read_is_read_and_what_it_lacks_is_kept_elsewhere(
    folder, monkeypatch, recwarn
):
    folder.write("a.o", b"code")
    forbid(monkeypatch, folder.places[0].parent)
    assert folder.read("a.o") == b"code"
    folder.write("b.o", b"more")
    assert folder.read("b.o") == b"more" and not recwarn.list
    assert [place.name for place in folder.places[1].iterdir()] == ["b.o"]


def test_on_a_full_disk_a_new_model_is_compiled_in_memory_and_that_is_said_once(folder, monkeypatch):
    solve(System({X: -sp.sign(X)}), (0, 1), {X: 2})  # compiles the units, if this is the first process
    a = sp.Symbol("a", positive=True)
    system = System({X: -a * sp.sign(X) - sp.cos(X)}, parameters={a: 2})
    for module in (cache, objects):
        monkeypatch.setattr(module, "models", lambda: folder)
    forbid(monkeypatch, *cache.roots(), error=errno.ENOSPC)
    with pytest.warns(RuntimeWarning, match="PWSMOOTH_CACHE_DIR") as said:
        solution = solve(system, (0, 3), {X: 1})
    assert len(said) == 1 and str(folder.places[0]) in str(said[0].message)
    assert "No space left" in str(said[0].message)
    assert solution.success and abs(solution.x[0, -1]) < 1e-9  # |cos 0| < 2: it rests on the surface


def test_folders_of_older_sources_are_removed_but_for_the_last_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "roots", lambda: [tmp_path])
    (tmp_path / "kernels-key").mkdir()
    (tmp_path / "thesis").mkdir()
    for k in range(cache.KEPT + 2):
        (tmp_path / f"models-{k}").mkdir()
        os.utime(tmp_path / f"models-{k}", (k, k))
    cache.Folder("models", "0")  # used again
    cache.Folder("models", "new").write("a.o", b"code")
    left = {path.name for path in tmp_path.iterdir()}
    kept = {"new", 0, *range(4, cache.KEPT + 2)}
    assert left == {"kernels-key", "thesis", *(f"models-{k}" for k in kept)}


def test_the_mark_of_a_machine_holds_the_settings_that_change_code(monkeypatch, tmp_path):
    mark = objects.machine_mark.__wrapped__
    usual = mark()
    for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT", "NUMBA_BOUNDSCHECK"):
        with monkeypatch.context() as m:
            m.setenv(name, "1")
            assert mark() != usual
    with monkeypatch.context() as m:
        m.setenv("NUMBA_NUM_THREADS", "1")
        assert mark() == usual
        m.chdir(tmp_path)
        (tmp_path / ".numba_config.yaml").write_text("opt: 0")
        assert mark() != usual


def test_models_have_one_fingerprint_exactly_if_they_are_equal():
    t, x, lam = sp.symbols("t x lam", real=True)
    a = sp.Symbol("a", positive=True)

    rate = -a * sp.sin(x)

    def model(rate=rate, name="lam", hidden=False):
        switch = Multiplier(sp.Symbol(name, real=True), "switch", -lam, x, hidden=hidden)
        return Model(t, (x,), (a,), (rate,), (switch,))

    same = cache.fingerprint(model())
    assert cache.fingerprint(model(sp.sin(x) * -a)) == same
    assumed = Model(t, (x,), (a,), (-sp.Symbol("a", real=True) * sp.sin(x),))
    others = [assumed, model(-a * sp.sin(2 * x)), model(name="mu"), model(hidden=True), model(-a * sp.cos(x))]
    renamed = Model(t, (sp.Symbol("w"),), (a,), (-a * sp.sin(sp.Symbol("w")),))
    plain = Model(t, (x,), (a,), (rate,))
    assert len({same, *map(cache.fingerprint, (*others, renamed, plain))}) == 8


def test_fingerprints_do_not_depend_on_the_process():
    program = (
        "import sympy as sp\n"
        "from pwsmooth.codegen.machine.cache import fingerprint\n"
        "from pwsmooth.definition.model import Model\n"
        "t, x, y = sp.symbols('t x y', real=True);"
        "e = sp.Piecewise((x*y + sp.sin(x), sp.And(x > 0, y > t)), (sp.Max(x, y, t), True));"
        "print(fingerprint(Model(t, (x, y), (), (e, x - y))))"
    )
    prints, command = set(), [sys.executable, "-c", program]
    for seed in ("1", "2"):
        env = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(PACKAGE.parent)}
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        prints.add(done.stdout)
    assert len(prints) == 1


BESIDE_NUMBA = """
import sys
import numpy as np, sympy as sp
from pwsmooth import Switch, System, solve
from pwsmooth.compare.efficiency.plain import plain
from pwsmooth.compare.efficiency.timestepping import stepper

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


AFTER_A_UNIT = """
import numba
import numpy as np
from pwsmooth.kernels.surface.layer import layer
layer.compiled()

@numba.njit
def mixed(n):
    a, b = np.zeros(n), np.empty((n, n))
    for i in range(n):
        a[i] = np.sqrt(i) + abs(-i) + max(i, 2) + int(1.5)
        for j in range(n):
            b[i, j] = i * j
    a[:] = a + 1.0
    return a.sum() + b.sum() + np.dot(a, a)

print(mixed(4) == mixed.py_func(4))
"""


def test_what_numba_kept_of_a_unit_serves_its_other_functions_too():
    """A unit's parts are neither optimised nor emitted one by one; numba finds some of them again."""
    printed = subprocess.run([sys.executable, "-c", AFTER_A_UNIT], capture_output=True, text=True)
    assert printed.stdout == "True\n", printed.stderr


COMPILES = """
from pwsmooth.codegen.machine.units import unit_address
from pwsmooth.kernels.machine.compiling import Unit
compiled = Unit.compiled
Unit.compiled = lambda unit: print("compiles") or compiled(unit)
unit_address("newton_unit")
"""


def test_cold_processes_wait_for_each_other_instead_of_compiling_the_same(tmp_path):
    env = os.environ | {"PWSMOOTH_CACHE_DIR": str(tmp_path), "NUMBA_DEBUG_JIT": "0"}  # nor the code of a wheel
    command = [sys.executable, "-c", COMPILES]
    both = [subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert sorted(process.communicate()[0] for process in both) == ["", "compiles\n"]
    assert [process.returncode for process in both] == [0, 0]
    assert not list(tmp_path.glob("*/.*"))  # no lock is left behind


HOLDS = """
import time
from pwsmooth.codegen.machine import cache
with cache.Folder("models", "key").alone("a.o"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """A process that makes a.o in the folder of `folder` and does not come to an end."""
    env = os.environ | {"PWSMOOTH_CACHE_DIR": str(tmp_path / "one")}
    process = subprocess.Popen([sys.executable, "-c", HOLDS], env=env, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_a_lock_ends_with_the_process_that_holds_it(folder, holder):
    entered = threading.Event()

    def enter():
        with folder.alone("a.o"):
            entered.set()

    threading.Thread(target=enter, daemon=True).start()
    assert not entered.wait(0.5)
    holder.kill()
    assert entered.wait(30)


def test_nobody_waits_for_ever_nor_for_another_file(folder, holder, monkeypatch):
    with folder.alone("b.o"):
        pass
    monkeypatch.setattr(cache, "PATIENCE", 0.2)
    with folder.alone("a.o"):
        pass


def test_where_no_folder_can_be_written_nobody_waits(folder, monkeypatch):
    def refuse(place):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(folder, "_open", refuse)
    with folder.alone("a.o"), folder.alone("a.o"):
        pass


def test_code_that_a_wheel_brought_is_read_and_never_written(folder, monkeypatch, tmp_path):
    monkeypatch.setattr(cache, "SHIPPED", tmp_path / "shipped")
    folder.write("a.o", b"code")
    shutil.copytree(tmp_path / "one", tmp_path / "shipped")
    shutil.rmtree(tmp_path / "one")
    assert folder.read("a.o") == b"code"
    folder.write("b.o", b"more")
    assert not list((tmp_path / "shipped").rglob("b.o"))


def test_what_takes_long_is_announced_and_what_does_not_is_not(capsys):
    with announced("doing little", after=60):
        pass
    assert capsys.readouterr().err == ""
    with announced("doing much", after=0.01):
        time.sleep(0.2)
    with announced("compiling"):
        pass
    first, second = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"pwsmooth: doing much, once for this machine and version ... \d+ s", first)
    assert re.fullmatch(r"pwsmooth: compiling, once for this machine and version ... 0 s", second)
