"""The typed subset of Python that generated code is written in: machine code against Python itself.

Guards: codegen/machine/, kernels/machine/.
"""

import ctypes
import gc
import math
import os
import threading
import weakref
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp

from pwsmooth import System, solve
from pwsmooth.codegen import compile_model
from pwsmooth.codegen.graph.scalar import HELPERS
from pwsmooth.codegen.machine import cache, native, objects
from pwsmooth.codegen.stiff.functions import compile_stiff
from pwsmooth.definition.model import Model
from pwsmooth.paths.problem import compiled_problem


def both(text, name, *arguments):
    """Results of a function in Python and as machine code: (value, arrays) twice."""
    scope = {"math": math, "choose": lambda condition, u, v: u if condition else v}
    exec("from __future__ import annotations\n" + text, scope)
    code = objects.Code(text, native.build)
    results = []
    for compiled in (False, True):
        values = [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]
        if compiled:
            kinds = [
                ctypes.c_void_p
                if isinstance(a, np.ndarray)
                else ctypes.c_double
                if isinstance(a, float)
                else ctypes.c_int64
                for a in values
            ]
            kind = scope[name].__annotations__.get("return")
            returned = {"D": ctypes.c_double, "I": ctypes.c_int64}.get(kind)
            function = ctypes.CFUNCTYPE(returned, *kinds)(code.address(name))
            value = function(*(a.ctypes.data if isinstance(a, np.ndarray) else a for a in values))
        else:
            value = scope[name](*values)
        results.append((value, [a for a in values if isinstance(a, np.ndarray)]))
    return results


def assert_same(text, name, *arguments):
    (expected, before), (found, after) = both(text, name, *arguments)
    if expected is not None:
        assert found == pytest.approx(expected, rel=1e-15)
    for a, b in zip(before, after, strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-14, atol=1e-300)


CONTROL = """
def f(x: P, n: I) -> I:
    count = 0
    for i in range(n):
        for j in range(n - 1, i, -1):
            if x[j] < x[i] and not x[j] == 0.0:
                x[j] -= x[i] / 2
                count += 1
            elif x[i] != x[i] or j & 3 == 3:
                x[i] = -x[j] ** 3
            else:
                x[j] += i
    for k in range(2, 3 * n, 3):
        count += k // 2
        k = 5
    if count > 10**6:
        return 0
    return count - 7
"""


def test_control_flow_is_python_s():
    assert_same(CONTROL, "f", np.array([3.0, -1.5, math.nan, 2.0, 7.5, 1.25]), 6)
    assert_same(CONTROL, "f", np.array([3.0, -1.5, 0.0, 2.0, 7.5, 1.25]), 6)


FUNCTIONS = [
    "exp",
    "log",
    "sin",
    "cos",
    "tan",
    "sinh",
    "cosh",
    "tanh",
    "asin",
    "acos",
    "atan",
    "asinh",
    "atanh",
    "erf",
    "erfc",
    "sqrt",
    "fabs",
    "floor",
    "ceil",
]


def test_mathematical_functions_are_those_of_the_c_library():
    lines = [f"    y[{i}] = math.{name}(x[0])" for i, name in enumerate(FUNCTIONS)]
    others = "math.atan2(x[0], -x[1]) + max(x[0], x[1]) - 3 * min(x[1], x[0]) + abs(-x[0])"
    lines += [f"    y[{len(FUNCTIONS)}] = {others}"]
    text = "def f(x: P, y: P):\n" + "\n".join(lines) + "\n"
    assert_same(text, "f", np.array([0.37, 1.9]), np.zeros(len(FUNCTIONS) + 1))


@pytest.mark.parametrize("largest", [0.8, 10.0, 1e4, 1e6, 1e9])
def test_sine_and_cosine_are_good_to_a_rounding_or_two(largest):
    text = "def pair(x: D, out: P):\n    out[0] = math.sin(x)\n    out[1] = math.cos(x)\n"
    code = objects.Code(text, native.build)
    pair = ctypes.CFUNCTYPE(None, ctypes.c_double, ctypes.c_void_p)(code.address("pair"))
    out = np.zeros(2)
    rng = np.random.default_rng(3)
    quarters = np.round(rng.uniform(-largest, largest, 50) / (np.pi / 2)) * (np.pi / 2)
    with mpmath.workdps(40):
        for x in [*rng.uniform(-largest, largest, 500), *quarters, -0.0, largest]:
            pair(x, out.ctypes.data)
            exact = np.array([float(mpmath.sin(mpmath.mpf(x))), float(mpmath.cos(mpmath.mpf(x)))])
            # Beside a zero the reduced argument carries an error of 1e-21 a quarter turn.
            assert np.all(np.abs(out - exact) <= 2 * np.spacing(np.abs(exact)) + 1e-20 * abs(x))
    for x in (math.nan, math.inf):
        pair(x, out.ctypes.data)
        assert np.isnan(out).all()


@pytest.mark.parametrize("u", [1.5, -2.5, 0.0, -0.0, 1e300])
def test_helpers_agree_with_their_text(u):
    text = "".join(HELPERS[name] for name in ("sign", "heaviside", "mod"))
    text += "\n\ndef f(u: D) -> D:\n    return sign(u) + 10 * heaviside(u) + 100 * mod(u, 0.75)\n"
    assert_same(text, "f", u)


@pytest.mark.parametrize("name", ["sign", "heaviside"])
def test_a_nan_stays_a_nan(name):
    text = HELPERS[name] + f"\n\ndef f(u: D) -> D:\n    return {name}(u)\n"
    assert math.isnan(both(text, "f", math.nan)[1][0])


def test_nothing_raises_where_python_would():
    text = "def f(u: D) -> D:\n    return math.sqrt(u) + 1.0 / (u + 1.0)\n"
    code = objects.Code(text, native.build)
    assert math.isnan(ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(code.address("f"))(-1.0))


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_the_solver_of_sliding_jets_solves(n):
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n)), rng.normal(size=n)
    A[0, 0] = 0.0 if n > 1 else A[0, 0]
    text = HELPERS["lu_factor"] + HELPERS["lu_solve"]
    text += "\n\ndef f(rows: P, n: I) -> I:\n    code = lu_factor(rows, 0, n)\n"
    text += "    lu_solve(rows, 0, n)\n    return code\n"
    rows = np.concatenate([A.ravel(), np.zeros(n), b])
    _, (code, (found,)) = both(text, "f", rows, n)
    assert code == 0
    np.testing.assert_allclose(found[-n:], np.linalg.solve(A, b), rtol=1e-11)


@pytest.mark.parametrize("q", [0, 1, 2, 4])
def test_block_sums_hold_every_pair_before_the_block_and_no_other(q):
    text = "def f(rows: P, q: I):\n    presum(rows, 0, 40, q, 80)\n"
    code = objects.Code(text, native.build)
    rng = np.random.default_rng(q)
    rows = rng.normal(size=84)
    rows[4 * q + 1 : 40] = np.nan  # orders of this block and beyond do not exist yet
    rows[40 + 4 * q + 1 : 80] = np.nan
    expected = [
        sum(rows[j] * rows[40 + k - j] for j in range(1, 4 * q + 1) if 1 <= k - j <= 4 * q)
        for k in range(4 * q + 1, 4 * q + 5)
    ]
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(code.address("f"))(rows.ctypes.data, q)
    np.testing.assert_allclose(rows[80:], expected, rtol=1e-13, atol=1e-15)


def test_an_unknown_function_is_named():
    with pytest.raises(NameError, match="frobnicate"):
        native.build("def f(u: D) -> D:\n    return frobnicate(u)\n")


def test_machine_code_is_stored_and_found_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "roots", lambda: [tmp_path])
    monkeypatch.setattr(objects, "models", lambda: cache.Folder("models", "key"))
    text = "ORDER = 3\n\n\ndef f(u: D) -> D:\n    return 2.0 * u\n"
    assert native.load(text).constants == {"ORDER": 3}
    assert native.load(text) is native.load(text)
    monkeypatch.setattr(objects, "_loaded", {})
    monkeypatch.setattr(native, "build", None)  # a second process must not need it
    code = native.load(text)
    assert ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(code.address("f"))(1.5) == 3.0


def test_the_machine_code_of_a_model_goes_with_it_and_not_before():
    t, x = sp.symbols("t x", real=True)
    model = Model(t, (x,), (), (-sp.cos(x) * sp.Rational(355, 113),))
    compiled = compile_model(model)
    compiled.fields  # noqa: B018
    code = weakref.ref(compiled._modules[0])
    gc.collect()
    assert code() is not None and compile_model(model) is compiled
    del compiled
    gc.collect()
    assert code() is None


def test_a_run_keeps_the_machine_code_that_it_uses():
    """A long run in one thread, while others drop every model that is kept."""
    gc.collect()
    gc.freeze()  # what other tests have left is not looked through each time
    t, x, v = sp.symbols("t x v", real=True)
    rate = sp.sin(t) - x - sp.sign(v) * sp.Rational(22, 7) / 10
    systems = [System({x: v, v: rate}, time=t), System({x: v, v: rate}, time=t).smoothed(eps=1e-2)]
    alone = [solve(s, (0, 300), {x: 1, v: 0.5}).x.tobytes() for s in systems]
    done = threading.Event()

    def drop():
        while not done.is_set():
            compiled_problem.cache_clear()
            compile_stiff.cache_clear()
            gc.collect()

    dropping = threading.Thread(target=drop)
    dropping.start()
    try:
        beside = [[solve(s, (0, 300), {x: 1, v: 0.5}).x.tobytes() for s in systems] for _ in range(3)]
    finally:
        done.set()
        dropping.join()
        gc.unfreeze()
    assert beside == [alone] * 3


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the memory of a process is read there")
def test_compiling_leaves_no_memory_behind():
    def size():
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    terms = " + ".join(f"math.sin({k}.0 * u)" for k in range(1, 30))
    text = f"def f(u: D) -> D:\n    return {terms}\n"
    for _ in range(3):
        native.build(text)
    before = size()
    for _ in range(40):
        native.build(text)
    # A pass manager that is not freed takes 0.3 MB.
    assert (size() - before) / 40 < 0.1e6
