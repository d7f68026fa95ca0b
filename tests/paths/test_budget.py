"""`max_steps` and `max_seconds` bound a call as a whole, and Ctrl-C is heard in the middle of a sweep."""

import signal
import subprocess
import sys
import textwrap
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Event, Outcome, Return, Strobe, System, find_orbit, solve, sweep
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.analysis.maps.sections import Section, Stroboscopic
from pwsmooth.codegen.machine import clock, native
from pwsmooth.paths import budget  # fmt: skip
from pwsmooth.studies import Work, ensemble, orbit_diagram

t, x, v, k = sp.symbols("t x v k", real=True)
PERIOD = 2 * sp.pi
START = {"x": 1, "v": 0.1}
DRIVEN = System({x: v, v: sp.cos(t) - k * x - v / 5 - sp.sign(v) / 4}, time=t, parameters={k: 1})
FREE = System({x: v, v: (1 - x**2) * v - x})
LONG = (0, 1e7)  # some minutes, with t_eval to keep memory small
PATHS = {
    "taylor": lambda **o: solve(DRIVEN, LONG, START, t_eval=[1.0], **o),
    "rk": lambda **o: solve(DRIVEN, LONG, START, t_eval=[1.0], method="rk", **o),
    "stiff": lambda **o: solve(FREE, LONG, START, t_eval=[1.0], method="stiff", **o),
    "smoothed": lambda **o: solve(DRIVEN.smoothed(1e-2), LONG, START, t_eval=[1.0], **o),
    "SciPy": lambda **o: solve(DRIVEN.smoothed(1e-2), LONG, START, t_eval=[1.0], method="LSODA", **o),
    "diffusion": lambda **o: solve(
        FREE, (0, 2**20), START, t_eval=[1.0], noise=Diffusion({v: 0.1}, step=1 / 64), **o
    ),
}


@pytest.mark.parametrize("path", PATHS)
def test_a_run_out_of_time_says_so_and_keeps_where_it_was(path):
    PATHS[path](max_steps=10)  # compiled
    begun = time.process_time()
    run = PATHS[path](max_seconds=0.1, max_steps=2**50)
    assert run.outcome is Outcome.TIME_LIMIT and not run.success and "max_seconds" in run.message
    assert run.t[-1] > 0 and np.isfinite(run.x[:, -1]).all()
    # Minutes without it; a slice of steps and the solution's words are allowed for.
    assert time.process_time() - begun < 10


@pytest.mark.parametrize("path", PATHS)
def test_a_run_that_is_over_in_time_keeps_its_bits(path, monkeypatch):
    """The loop is left and entered again: after every slice of steps as after none."""
    one = PATHS[path](max_steps=3000)
    monkeypatch.setattr(budget.Slices, "next", lambda slices, made: 7)
    other = PATHS[path](max_steps=3000, max_seconds=1e6)
    assert one.outcome is other.outcome is Outcome.TOO_MANY_STEPS
    assert (
        one.cost["steps"] == other.cost["steps"]
        and np.array_equal(one.x, other.x)
        and np.array_equal(one.t, other.t)
    )


class Watch:
    """A clock that tests set, in the place of that of the process."""

    def __init__(self, monkeypatch):
        self.seconds = 100.0
        monkeypatch.setattr(clock, "time", self)

    def monotonic(self):
        return self.seconds


def test_a_slice_has_as_many_steps_as_fit_between_two_looks(monkeypatch):
    watch, cost = Watch(monkeypatch), 1e-3  # seconds a step
    slices = budget.Slices(budget.first_slice(1200))
    lengths = []
    for _ in range(5):
        lengths.append(slices.next(lengths[-1] if lengths else 0))
        watch.seconds += lengths[-1] * cost
    assert lengths[0] == lengths[1] // budget._GROWTH == 8  # 8 ms: more, but not at once
    assert lengths[2:] == pytest.approx([100, 100, 100], abs=1)
    watch.seconds += 1000.0
    assert slices.next(100) == 1


def test_the_clock_stands_still_while_something_is_made_ready(monkeypatch):
    watch, begun = Watch(monkeypatch), clock.now()
    with clock.preparing():
        watch.seconds += 5
        with clock.preparing():
            watch.seconds += 5
            assert clock.now() == begun
        watch.seconds += 5
        other = threading.Thread(target=lambda: seen.append(clock.now()))
        seen = []
        other.start()
        other.join()
    watch.seconds += 1
    assert seen == [begun] and clock.now() == begun + 1


@pytest.mark.parametrize("method", ["taylor", "stiff"])
def test_compiling_is_no_part_of_a_run(method, monkeypatch):
    watch, build = Watch(monkeypatch), native.build
    compiled = []

    def slow(text, first):
        watch.seconds += 60
        compiled.append(text)
        return build(text, first)

    monkeypatch.setattr(native, "build", slow)
    number = sp.Rational(time.time_ns() % 10**9, 10**10)  # of no run before
    system = System({x: sp.cos(3 * x + number) - x})
    run = solve(system, (0, 5), {x: 0.3}, method=method, max_seconds=1)
    assert compiled and run.success


@pytest.fixture
def steps(monkeypatch):
    """Steps that all solves take together."""
    taken = []
    spend = budget.Budget.spend

    def counted(self, number):
        if self.outer is None:
            taken.append(number)
        spend(self, number)

    monkeypatch.setattr(budget.Budget, "spend", counted)
    return taken


LONG_CALLS = {
    "exponents": lambda: lyapunov_exponents(DRIVEN, START, 1e6, max_steps=2_000).outcome,
    "orbit": lambda: find_orbit(DRIVEN, START, seen=Strobe(PERIOD), transient=10**5, max_steps=2_000).success,
    "section": lambda: (
        find_orbit(FREE, START, seen=Return(v, direction=-1), transient=10**5, max_steps=2_000).success
    ),
    "map": lambda: np.isfinite(
        Stroboscopic(DRIVEN, PERIOD, options={"max_steps": 2_000}).iterate(START, 10**5)
    ).all(),
    "returns": lambda: np.isfinite(
        Section(FREE, surface=v, options={"max_steps": 2_000}).iterate(START, 10**5)
    ).all(),
    "diagram": lambda: np.isfinite(
        orbit_diagram(
            DRIVEN, k, np.linspace(1, 2, 1000), START, Strobe(PERIOD), carry=True, max_steps=2_000
        ).points
    ).all(),
}


@pytest.mark.parametrize("call", LONG_CALLS)
def test_max_steps_bounds_a_long_call_whole(call, steps):
    result = LONG_CALLS[call]()
    assert result is Outcome.TOO_MANY_STEPS or not result
    assert 0 < sum(steps) <= 2_000


def test_seconds_bound_a_long_call_whole():
    begun = time.monotonic()
    found = lyapunov_exponents(DRIVEN, START, 1e7, max_steps=2**50, max_seconds=0.3)
    assert found.outcome is Outcome.TIME_LIMIT and time.monotonic() - begun < 30
    many = ensemble(FREE, (0, 2**14), START, Diffusion({v: 0.1}, step=1 / 64), 2000, max_seconds=0.3)
    assert many.outcomes[-1] is Outcome.TIME_LIMIT and np.isnan(many.end[-1]).all()
    assert time.monotonic() - begun < 60


@pytest.mark.parametrize("value", [0, -1, np.nan, "long"])
def test_a_bound_on_seconds_is_a_positive_number(value):
    for call in (lambda: solve(DRIVEN, (0, 1), START, max_seconds=value),
                 lambda: sweep(DRIVEN, {"k": [1.0]}, x0=START, t_span=(0, 1), max_seconds=value),
                 lambda: ensemble(FREE, (0, 1), START, Diffusion({v: 1}, step=1), 2, max_seconds=value)):  # fmt: skip
        with pytest.raises((ValueError, TypeError), match="`max_seconds`"):
            call()


@pytest.mark.parametrize("clocked", [False, True])
def test_points_that_a_sweep_has_no_time_for_say_so_and_run_later(clocked, tmp_path):
    events = [Event(every=1000, update={x: x})] if clocked else []
    system = System({x: v, v: sp.cos(t) - k * x - v / 5}, time=t, parameters={k: 1}, events=events)
    asked = dict(x0=START, measures=["counts"], max_steps=2**40)
    values, work = [1.0 + i / 10 for i in range(6)], Work(workers=2, chunk=1)
    late = sweep(system, {"k": values}, t_span=(0, 1e8), max_seconds=0.2, work=work, **asked)
    assert (late.outcome == Outcome.TIME_LIMIT).any() and "time_limit" in late.outcome.attrs["flag_meanings"]
    assert (late["steps"].values[late.outcome.values < 0] >= -1).all()
    store = tmp_path / "s.zarr"
    part = sweep(
        system, {"k": values}, t_span=(0, 3000), work=replace(work, store=store), max_seconds=1e-3, **asked
    )
    assert (part.outcome == -128).any()
    full = sweep(system, {"k": values}, t_span=(0, 3000), work=replace(work, store=store), **asked)
    fresh = sweep(system, {"k": values}, t_span=(0, 3000), work=work, **asked)
    assert (full.outcome == 0).all() and np.array_equal(full["steps"], fresh["steps"])


INTERRUPTED = """
import signal
import sympy as sp
from pwsmooth import System, sweep
from pwsmooth.studies import Function, Work
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job begins deaf to it
t, x, v, k = sp.symbols("t x v k", real=True)
system = System({x: v, v: sp.cos(t) - k*x - v/5 - sp.sign(v)/4}, time=t, parameters={k: 1})
options = dict(x0={"x": 1, "v": 0}, measures=["counts"], max_steps=2**50, work=Work(workers=2, chunk=2))
sweep(system, {"k": [1.0, 2.0]}, t_span=(0, 5), **options)
print("begun", flush=True)
try:
    sweep(system, {"k": [1 + i/100 for i in range(100)]}, t_span=(0, 1e7), **CHANGED)
except KeyboardInterrupt:
    print("heard", flush=True)
"""


@pytest.mark.parametrize("chunk", [2, None])
@pytest.mark.parametrize("measure", ["'counts'", "Function(lambda s: s['x'][-1], names='end')"])
def test_ctrl_c_is_heard_in_the_middle_of_a_chunk(chunk, measure, tmp_path):
    changed = f"{{**options, 'work': Work(workers=2, chunk={chunk}), 'measures': [{measure}]}}"
    script = textwrap.dedent(INTERRUPTED).replace("CHANGED", changed)
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        begun = time.monotonic()
        assert process.stdout.readline() == "heard\n"
        # A point takes minutes: what is heard at its end is heard never. A second is what an idle machine needs.
        assert time.monotonic() - begun < 5
        process.kill()
