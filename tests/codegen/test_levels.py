"""Machine code of the kernels: which level of processors runs here, and that all of them compute the same."""

import os
import pickle
import re
import subprocess
import sys
from pathlib import Path

import llvmlite.binding as llvm
import pytest
import sympy as sp
import yardstick

from pwsmooth import System, solve
from pwsmooth.codegen.machine import cache, objects, units

X = sp.Symbol("x", real=True)
ADDED = [set(words.split()) for words in objects._LEVELS.values()]  # by each level, the richest first


def marks(monkeypatch, features, settings=None):
    """unit_marks() of a processor with these features, in an environment with these settings."""
    with monkeypatch.context() as m:
        m.setattr(llvm, "get_host_cpu_features", lambda: dict.fromkeys(features, True))
        m.setattr(llvm, "get_process_triple", lambda: "x86_64-unknown-linux-gnu")
        m.setattr(objects, "_host", lambda: (None, "cpu", str(sorted(features))))
        for name, value in (settings or {}).items():
            m.setenv(name, value)
        m.setattr(objects, "machine_mark", objects.machine_mark.__wrapped__)
        return objects.unit_marks.__wrapped__()


def test_a_processor_uses_the_levels_that_it_has_every_feature_of(monkeypatch):
    v4, v3, v2 = ADDED
    assert marks(monkeypatch, v4 | v3 | v2)[:-1] == ["x86-64-v4", "x86-64-v3", "x86-64-v2"]
    assert marks(monkeypatch, v4 | v3 | v2 - {"popcnt"})[:-1] == []
    assert marks(monkeypatch, v3 | v2 | v4 - {"avx512vl"})[:-1] == ["x86-64-v3", "x86-64-v2"]
    assert marks(monkeypatch, v2)[:-1] == ["x86-64-v2"]


def test_settings_of_numba_have_code_of_their_own_and_those_of_a_level_its_code(monkeypatch):
    usual = marks(monkeypatch, set.union(*ADDED))
    level = usual[1]
    assert marks(monkeypatch, set.union(*ADDED), objects.level_settings(level)) == [level]
    for name in ("NUMBA_CPU_NAME", "NUMBA_OPT", "NUMBA_BOUNDSCHECK", "PWSMOOTH_CHECK"):
        (own,) = marks(monkeypatch, set.union(*ADDED), {name: "1"})
        assert own not in usual


def test_object_code_names_nothing_of_python_or_numba():
    solve(System({X: -sp.sign(X)}), (0, 1), {X: 2})  # compiles some units, if this is the first process
    images = [image for image in map(units._read, units.ALL) if image is not None]
    assert len(images) > 5
    for image in images:
        assert b"pwsmooth.kernels." in image
        # numba's functions that count references are in it; none is called that is elsewhere.
        named = re.findall(rb"\0_?(Py[A-Z_]\w*|_Py\w+|NRT_\w+|numba_\w+)\0", image)
        assert {*named} <= {b"NRT_incref", b"NRT_decref"}


@pytest.mark.skipif(
    not cache.SHIPPED.is_dir(), reason="only a wheel has the code of all levels; tests/matrix.py"
)
def test_all_levels_that_run_here_give_the_same_bits(tmp_path):
    levels = [mark for mark in objects.unit_marks() if mark in objects.all_levels()]
    found = {}
    for level in levels:
        out = tmp_path / level
        command = [sys.executable, "-W", "ignore", yardstick.__file__, "--write", str(out), "--only", "1e-09"]
        env = os.environ | objects.level_settings(level) | {"PYTHONPATH": str(Path(yardstick.__file__).parent)}
        done = subprocess.run(command, env=env, capture_output=True, text=True)
        assert done.returncode == 0 and "numerical core" not in done.stderr, done.stderr
        found[level] = pickle.loads(out.read_bytes())
    first = found[levels[0]]
    assert len(first) > 20
    for results in found.values():
        for name, parts in first.items():
            for part, value in parts.items():
                assert not yardstick.difference(value, results[name][part]), f"{name}: {part}"
