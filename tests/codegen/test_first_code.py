"""A model's first code and its optimised code: the same bits, and one after the other.

Guards: codegen/machine/objects.py, codegen/machine/native.py, codegen/machine/vectors.py, codegen/machine/writer.py.
"""

import _thread
import ast
import os
import subprocess
import sys
import threading

import pytest
import sympy as sp

from pwsmooth import Event, Family, Switch, System, Unilateral, solve
from pwsmooth.codegen.machine import cache, objects

t, x, y, v, z = sp.symbols("t x y v z", real=True)
lam, wall = Switch("lam", v), Unilateral(x, restitution=sp.Rational(9, 10), name="W")
UNITS = sp.Rational(1025, 1024)  # in no other test, so that no code of these models is loaded already

SYSTEMS = {
    "hidden friction": {y: v, v: -2.4 * sp.sin(UNITS * t) - 3.1 * y - lam * (1 + 3 * z), z: (1 - lam**2 - z) * 10},
    "pendulum": {y: v, v: -UNITS * sp.sin(y) - sp.sign(v) / 5 + sp.cos(t) - v**3 / 7},
    "Stribeck": {y: v, v: -UNITS * y + sp.sign(1 - v) * (0.3 + 0.7 / (1 + 3 * sp.Abs(1 - v)))},
    "impacts": {x: v, v: -UNITS * x - v / 20 + sp.cos(2 * t) + wall.reaction},
    "coupled rows": {x: y, y: v, v: -UNITS * x * v - y - sp.exp(-x) * sp.tanh(y) + sp.sqrt(1 + z**2), z: x - z * y},
}  # fmt: skip
STARTS = {y: 0.5, v: 0.3, x: 1.0, z: 0.25}


@pytest.fixture
def files(monkeypatch):
    """What is compiled in a test stays in it, and is optimised when the test says so."""
    kept = {}
    monkeypatch.setattr(objects, "MANY", 10**9)

    class Folder:
        read, write = kept.get, kept.__setitem__

    monkeypatch.setattr(objects, "models", Folder)
    return kept


def run(system, **options):
    start = {s: STARTS[s] for s in system.states}
    return solve(system, (0, 20), start, **options)


def loaded(before):
    return [code for code in objects._loaded.values() if code not in before]


@pytest.mark.parametrize(
    "name, eps", [*((name, None) for name in SYSTEMS), *((name, 1e-2) for name in list(SYSTEMS)[:3])]
)
def test_first_and_optimised_code_give_the_same_bits(name, eps, files):
    before = list(objects._loaded.values())
    events = [Event(sp.sin(3 * t) - y, direction=1)] if y in SYSTEMS[name] else []
    system = System(SYSTEMS[name], time=t, events=events)
    if eps:
        system = system.smoothed(eps=eps)
    first = run(system)
    codes = loaded(before)
    assert first.success and codes and all(file.endswith(".first.o") for file in files)
    for code in codes:
        code.optimise()
        assert any(code.place(f"{function}_now") for function in code._names)
    second = run(system)
    assert second.t.tobytes() == first.t.tobytes() and second.x.tobytes() == first.x.tobytes()
    assert [e.time for e in second.events] == [e.time for e in first.events]
    assert second.cost == first.cost


@pytest.mark.parametrize("eps", [None, 1e-2])
def test_families_too_and_their_loops_as_vectors(eps, files):
    chain = Family(21)
    q, w = chain.symbols("q w")
    pull = chain.neighbour(q, 1) - 2 * q + chain.neighbour(q, -1)
    event = Event(w - UNITS / 4, direction=1, name="fast")
    system = System(
        {q: w, w: UNITS * pull - q**3 / 9 + sp.cos(t + chain.index) * 2 - sp.sign(w - sp.sin(q) / 8) / 2},
        time=t, events=[] if eps else [event],
    )  # fmt: skip
    system = system.smoothed(eps=eps) if eps else system
    before = list(objects._loaded.values())
    start = [0.1] * 42
    first = solve(system, (0, 5), start)
    codes = loaded(before)
    assert first.success and codes and all(file.endswith(".first.o") for file in files)
    for code in codes:
        code.optimise()
    second = solve(system, (0, 5), start)
    assert second.t.tobytes() == first.t.tobytes() and second.x.tobytes() == first.x.tobytes()
    assert second.cost == first.cost


def test_what_is_called_often_is_optimised_meanwhile_and_loaded_so_from_then_on(files, monkeypatch):
    monkeypatch.setattr(objects, "MANY", 10)
    before = list(objects._loaded.values())
    system = System({y: v, v: -2 * UNITS * sp.sin(y) - sp.sign(v) / 5 + sp.cos(t)}, time=t)
    parse, parsing = ast.parse, set()
    monkeypatch.setattr(ast, "parse", lambda *a, **k: parsing.add(threading.current_thread()) or parse(*a, **k))
    found = run(system)
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and not thread.daemon:
            thread.join(timeout=60)
    assert (
        parsing == {threading.current_thread()} and not objects.parsed
    )  # beside another thread Python may fail to
    codes = [code for code in loaded(before) if code._optimised]
    optimised = [file for file in files if not file.endswith(".first.o")]
    assert codes and len(codes) == len(optimised) < len(files)
    assert run(system).x.tobytes() == found.x.tobytes()
    again = objects.Code(codes[0].text, codes[0]._build)
    assert again.place("calls") == 0  # it is the optimised code, which counts nothing


FORKS = """
import multiprocessing, time
import sympy as sp
from pwsmooth import System, solve
from pwsmooth.codegen.machine import native, objects

objects.MANY = 10
emit, t, y, v = objects.emit, *sp.symbols("t y v", real=True)

def emit_slowly(*given, **kinds):
    machine = objects._machine()  # of LLVM, which is in use meanwhile
    time.sleep(1 if threads() else 0)
    return emit(*given, **kinds)

def threads():
    return any(thread.is_alive() for thread in objects._optimising)

def run(c):
    return solve(System({y: v, v: -c * sp.sin(y) - sp.sign(v) / 5 + sp.cos(t)}, time=t), (0, 20), [0.5, 0.3]).success

if __name__ == "__main__":
    objects.emit = emit_slowly
    assert run(sp.Rational(1025, 512)) and threads()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert not threads()
        print(pool.apply_async(run, [3]).get(timeout=60))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_process_that_forks_finishes_its_optimising_first(tmp_path):
    script = tmp_path / "forks.py"
    script.write_text(FORKS)
    environment = os.environ | {"PWSMOOTH_CACHE_DIR": str(tmp_path)}
    for kernels in cache.kernels().places:  # but the kernels are not compiled anew
        if kernels.exists():
            (tmp_path / kernels.name).symlink_to(kernels)
    done = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "True\n", done.stderr


def test_an_interrupt_that_arrives_while_the_calls_are_heard_of_is_not_lost(monkeypatch):
    class Interrupted(dict):
        def pop(self, *_):
            raise KeyboardInterrupt

    heard = []
    monkeypatch.setattr(objects, "_counting", Interrupted())
    monkeypatch.setattr(_thread, "interrupt_main", lambda: heard.append(True))
    objects._called_often(0)
    assert heard == [True]
