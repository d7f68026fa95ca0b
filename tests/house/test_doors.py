"""No bad value passes a door: what is refused names the argument, and the generator of malformed calls agrees."""

import functools
import importlib.util
import inspect
import math
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import pwsmooth
from pwsmooth import (
    Diffusion,
    Drive,
    Event,
    Family,
    System,
    basins,
    find_orbit,
    lyapunov_exponents,
    orbit_diagram,
    solve,
    sweep,
)
from pwsmooth.laws.friction import Coulomb, Dahl
from pwsmooth.scenes import Scene, block_on_belt, force_driven, prescribed_motion
from pwsmooth.sweep import Period, Points

t, x, v, k = sp.symbols("t x v k", real=True)
T = 2 * sp.pi
START = {"x": 1.0, "v": 0.1}
BLOCK = System({x: v, v: sp.cos(t) - k * x - v / 5 - sp.sign(v) / 4}, time=t, parameters={k: 1})


def swept(**given):
    return sweep(
        BLOCK, {"k": [2.0, 3.0]}, **{"start": START, "period": T, "transient": 1, "periods": 1} | given
    )


# Each of them was accepted without a word, ran for ever, or ended in an error that named nothing.
REFUSED = {
    "noise of sweep": ("noise", lambda: swept(noise=0.1)),
    "measure_from beside a period": ("measure_from", lambda: swept(measure_from="abc")),
    "start_time nan": ("start_time", lambda: lyapunov_exponents(BLOCK, START, 10.0, start_time=math.nan)),
    "start_time inf": ("start_time", lambda: lyapunov_exponents(BLOCK, START, 10.0, start_time=math.inf)),
    "start_time without digits": ("start_time", lambda: lyapunov_exponents(BLOCK, START, 10.0, start_time=1e308)),
    "time beyond digits": ("time", lambda: lyapunov_exponents(BLOCK, START, 2**70, max_steps=20_000)),
    "tol nan": ("tol", lambda: basins(BLOCK, {"x": [1.0]}, T, start={"v": 0}, tol=math.nan)),
    "tol negative": ("tol", lambda: basins(BLOCK, {"x": [1.0]}, T, start={"v": 0}, tol=-1)),
    "tol inf": ("tol", lambda: basins(BLOCK, {"x": [1.0]}, T, start={"v": 0}, tol=math.inf)),
    "direction": ("direction", lambda: find_orbit(BLOCK, START, period=T, direction="abc")),
    "carry": ("carry", lambda: orbit_diagram(BLOCK, k, [1.0], START, T, carry="abc")),
    "period of a rig": ("period", lambda: prescribed_motion(Dahl(), position=sp.sin(t), period="abc")),
    "work of a rig": ("work", lambda: prescribed_motion(Dahl(), position=sp.sin(t), work="abc")),
    "c None": ("c", lambda: block_on_belt(Coulomb(), c=None)),
    "c text": ("c", lambda: block_on_belt(Coulomb(), c="")),
    "c list": ("c", lambda: block_on_belt(Coulomb(), c=[])),
    "t_span text": ("t_span", lambda: block_on_belt(Coulomb(), t_span="abc")),
    "t_span empty": ("t_span", lambda: block_on_belt(Coulomb()).solve(t_span="")),
    "parameters of a diffusion": ("parameters", lambda: Diffusion({x: 1}, step=0.1, parameters={"zz": 1})),
    "terminal": ("terminal", lambda: Event(x, terminal="abc")),
    "copies": ("n", lambda: Family(10**400)),
    "a number beyond floats": ("rtol", lambda: solve(BLOCK, (0, 1), START, rtol=10**400)),
    "a state beyond floats": ("x0", lambda: solve(BLOCK, (0, 1), {"x": 10**400, "v": 0})),
    "a span beyond floats": ("t_span", lambda: solve(BLOCK, (0, 10**400), START)),
    "an expression beyond floats": ("rates", lambda: System({x: -(10**5000)})),
    "periods beyond memory": ("periods", lambda: swept(periods=2**60)),
    "longest of Period": ("longest", lambda: Period(longest="abc")),
    "last of Points": ("last", lambda: Points("x", last=-1)),
    "law of a scene": ("law", lambda: force_driven("Coulomb", 1)),
    "start of a Scene": ("start", lambda: Scene("s", BLOCK, 5, (0, 1))),
    "times of a Drive": ("times", lambda: Drive("abc", [1, 2, 3, 4])),
    "a name where times stand": ("t", lambda: solve(BLOCK, (0, 1), START, dense_output=True)("x")),
    "a name that is none": ("name", lambda: solve(BLOCK, (0, 1), START, dense_output=True)(0.5, "mu")),
}  # fmt: skip


@pytest.mark.parametrize("call", REFUSED)
def test_what_was_accepted_without_a_word_is_refused(call):
    name, bad = REFUSED[call]
    with pytest.raises((ValueError, TypeError), match=rf"`{name}`"):
        bad()


def test_an_event_of_time_beyond_all_floats_ends_a_run_and_not_python():
    for method in ("auto", "stiff"):
        free = System({x: -x}, time=t, events=[Event(every=1e-9, update={x: x})])
        assert not solve(free, (0, 1e300), {"x": 1}, method=method, max_steps=100).success


@functools.cache
def generator():
    path = Path(__file__).parents[1] / "fuzz" / "doors.py"
    spec = importlib.util.spec_from_file_location("doors", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_public_callable_with_arguments_is_in_the_generator():
    doors = generator()
    names = doors.public_names.public_names()
    asked = {
        name
        for name, value in names.items()
        if (inspect.isfunction(value) or inspect.isclass(value)) and "Parameters\n" in (value.__doc__ or "")
    }
    missing = {name for name in asked - set(doors.subjects()) if not name.startswith(doors.NO_DOORS)}
    assert missing <= doors.INSIDE, missing - doors.INSIDE


def test_malformed_calls_are_refused_by_name(tmp_path, monkeypatch):
    """The long mode is `python -m tests.fuzz.doors --cases 12000`."""
    monkeypatch.chdir(tmp_path)  # some texts that are given are good names of files
    doors = generator()
    verdicts = [doors.judged("suite", i) for i in range(600)]
    kinds = [kind for kind, _ in verdicts]
    known = ("named", "unnamed", "accepted")
    assert set(kinds) <= set(known), [words for kind, words in verdicts if kind not in known]
    assert kinds.count("named") >= 0.97 * (kinds.count("named") + kinds.count("unnamed"))


def test_messages_show_anything_in_few_words():
    class Mute:
        def __repr__(self):
            raise RuntimeError

    for value in (10**5000, Mute(), list(range(10**5)), "x" * 10**4, sum(sp.symbols("a:999")), np.zeros(10**4)):
        assert 0 < len(pwsmooth.definition.checks.shown(value)) <= 210
