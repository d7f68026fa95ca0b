"""Large families: events that write their neighbours or come at given times, what is kept, and checkpoints.

Guards: paths/checkpoint.py, results/assembly.py, results/counting.py.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
import zarr
from chain_models import train
from family_models import template_from

from pwsmooth import Event, Family, Outcome, Switch, System, solve, sweep
from pwsmooth.families import Recorder
from pwsmooth.paths import local
from pwsmooth.studies import Function, Work

TIGHT = dict(rtol=1e-12, atol=1e-14)


def both(make, *arguments):
    """The system with a template, and with its elements written out, and the start."""
    with template_from(8):
        system, start = make(*arguments)
    with template_from(10**9):
        written, _ = make(*arguments)
    return system, written, start


def alike(make, *arguments, end=8.0):
    """A run by elements is that of the elements written out."""
    system, written, start = both(make, *arguments)
    asked = np.linspace(0, end, 9)
    found = solve(system, (0, end), start, t_eval=asked, local=True, **TIGHT)
    whole = solve(written, (0, end), start, t_eval=asked, **TIGHT)
    assert len(found.events) == len(whole.events) > 20
    np.testing.assert_allclose(found.x, whole.x, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(found.status, whole.status)
    return found


def toppling(kind, n=36):
    """Sites that are filled, and give what they have to their neighbours when they are full."""
    sites = Family(n, periodic=kind == "ring")
    (u,) = sites.symbols("u")
    if kind == "lattice":
        links = sites.lattice((6, 6))
        others = [links.neighbour(u, k) for k in range(1, 5)]
    else:
        others = [sites.neighbour(u, 1), sites.neighbour(u, -1)]
    share = sp.Rational(8, 10) / len(others)
    full = Event(u - 1, direction=1, update={u: 0} | {o: o + share * u for o in others}, name="topple")
    return System({u: 1}, events=[full]), {u: np.random.default_rng(3).uniform(0, 1, n)}


@pytest.mark.parametrize("kind", ["chain", "ring", "lattice"])
def test_what_an_event_gives_its_neighbours_starts_avalanches(kind):
    found = alike(toppling, kind)
    # Some sites topple at the instant of others.
    assert len(np.unique(np.round(found.events.times, 9))) < len(found.events)


def kicked(own):
    """Blocks that rub, kicked at given times: all at once, or each with a period of its own."""
    blocks = Family(12)
    x, v = blocks.symbols("x v")
    F, period = blocks.symbols("F period", positive=True)
    beat = sp.Symbol("beat", positive=True)
    pull = blocks.neighbour(x, 1) - 2 * x + blocks.neighbour(x, -1)
    events = [
        Event(every=period if own else beat, update={v: v + sp.Rational(1, 2) + x / 3}, name="kick"),
        Event(at=(1.5, 4, 3 * beat), update={v: v - 1}, name="pull"),
    ]
    i = np.arange(12)
    values = {F: 0.3 + 0.1 * np.cos(i), beat: 0.8} | ({period: 0.7 + 0.05 * np.sin(3 * i)} if own else {})
    rates = {x: v, v: -x + 2 * pull - F * Switch("lam", v) - v / 10}
    return System(rates, parameters=values, events=events), {x: np.sin(2 * i), v: 0.0}


@pytest.mark.parametrize("own", [False, True])
def test_kicks_at_given_times_are_those_of_the_elements_written_out(own):
    alike(kicked, own)


def test_what_is_kept_of_some_elements_is_what_a_run_that_keeps_all_has(tmp_path):
    system, start = train(120)
    asked = np.linspace(0, 20, 21)
    whole = solve(system, (0, 20), start, t_eval=asked)
    some = solve(
        system, (0, 20), start, t_eval=asked, record=Recorder(elements=[3, -1], events=tmp_path / "run.zarr")
    )
    np.testing.assert_array_equal(some.recorded["x"], whole.x[[2, 119]])
    np.testing.assert_array_equal(some.recorded["lam"], whole.mult[[2, 119]])
    np.testing.assert_array_equal(some.x, whole.x[:, [0, -1]])
    np.testing.assert_allclose(some.mult, whole.mult[:, [0, -1]], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(some.events.times, whole.events.times)
    assert [str(e) for e in some.events[:5]] == [str(e) for e in whole.events[:5]]
    assert some.recorded.elements == (3, 120) and len(some.catalogue) == len(whole.events)


def test_avalanches_are_slips_of_neighbours_at_the_same_time():
    system, start = train(120)
    run = solve(system, (0, 30), start, record=Recorder())
    slips = run.catalogue.avalanches(drift=0.1)
    log = run.catalogue
    # The same by hand: intervals of slip, joined where neighbours overlap.
    begun, intervals = {}, []
    for t, i, came, went, x in zip(log.t, log.element, log.came, log.went, log.states["x"], strict=True):
        if came == 0 and went != 0:
            begun[i] = t, x
        elif went == 0 and i in begun:
            (t0, x0) = begun.pop(i)
            intervals.append((t0, t, int(i), abs(x - x0 - 0.1 * (t - t0))))
    label = list(range(len(intervals)))
    for a, (t0, t1, i, _) in enumerate(intervals):
        for b, (s0, s1, j, _) in enumerate(intervals):
            if abs(i - j) == 1 and s0 <= t1 and t0 <= s1:
                label = [label[a] if c == label[b] else c for c in label]
    groups = {c: [q for q, d in zip(intervals, label, strict=True) if d == c] for c in set(label)}
    expected = sorted(
        (min(q[0] for q in g), len({q[2] for q in g}), sum(q[3] for q in g)) for g in groups.values()
    )
    assert len(slips) == len(expected) > 5 and slips.area.max() > 3
    np.testing.assert_allclose(slips.start, [e[0] for e in expected])
    np.testing.assert_array_equal(slips.area, [e[1] for e in expected])
    np.testing.assert_allclose(slips.moment, [e[2] for e in expected])


RUN = """
import hashlib, sys
from pathlib import Path
import numpy as np
from pwsmooth import solve
from pwsmooth.families import Recorder
from pwsmooth.paths import local
from pwsmooth.studies import Function
from chain_models import train
local.SLICE = 200  # elements renewed between two looks
print("begins" if not Path(sys.argv[1] + ".run").exists() else "goes on")
system, start = train(400)
record = Recorder(elements=[7], events=sys.argv[1] + ".zarr", checkpoint=sys.argv[1] + ".run", checkpoint_every=1000)
run = solve(system, (0, 250), start, t_eval=np.linspace(0, 250, 51), record=record)
bits = (run.x, run.mult, run.events.times, run.events.codes, run.recorded["x"], run.recorded["lam"])
print(run.outcome.name, len(run.events), hashlib.sha256(b"".join(a.tobytes() for a in bits)).hexdigest())
"""


def test_a_run_that_was_killed_goes_on_with_the_same_bits(tmp_path):
    def begun(name):
        tests = str(Path(__file__).parents[1])
        return subprocess.Popen(
            [sys.executable, "-c", RUN, str(tmp_path / name)], stdout=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([tests, str(Path(tests).parent)])},
        )  # fmt: skip

    whole = begun("whole").communicate()[0]
    assert whole.startswith("begins\nFINISHED")
    for _ in range(2):
        process, file = begun("killed"), tmp_path / "killed.run"
        seen = file.stat().st_mtime_ns if file.exists() else 0
        deadline = time.monotonic() + 120
        while process.poll() is None and time.monotonic() < deadline:
            if file.exists() and file.stat().st_mtime_ns != seen:
                process.send_signal(signal.SIGKILL)
                break
            time.sleep(0.005)
        process.communicate()
        assert process.returncode == -signal.SIGKILL and file.exists()
    assert begun("killed").communicate()[0] == whole.replace("begins", "goes on")
    assert not (tmp_path / "killed.run").exists()


class _Interrupted(Exception):
    pass


@pytest.mark.parametrize("end", ["interrupt", "time"])
def test_a_run_that_was_stopped_loses_no_event_and_goes_on(tmp_path, monkeypatch, end):
    system, start = train(120)
    monkeypatch.setattr(local, "SLICE", 50)
    record = Recorder(events=tmp_path / "run.zarr", checkpoint=tmp_path / "run.chk", checkpoint_every=200)
    whole = solve(system, (0, 60), start, local=True)
    looks = []

    def late(self):
        looks.append(self)
        if len(looks) == 120 and end == "interrupt":
            raise _Interrupted
        return len(looks) >= 120

    with monkeypatch.context() as patch:
        patch.setattr("pwsmooth.paths.budget.Budget.late", late)
        if end == "interrupt":
            with pytest.raises(_Interrupted):
                solve(system, (0, 60), start, record=record)
        else:
            part = solve(system, (0, 60), start, record=record)
            assert part.outcome is Outcome.TIME_LIMIT and 0 < part.t[-1] < 60
            # Nothing after it, and all before it.
            assert len(part.events) == np.sum(whole.events.times <= part.t[-1])
    kept = zarr.open_group(tmp_path / "run.zarr", mode="r")["t"][:]
    assert 200 < len(kept) < len(whole.events)
    np.testing.assert_array_equal(kept, whole.events.times[: len(kept)])
    (tmp_path / "run.zarr" / "t" / "zarr.6230a3.partial").touch()  # as a kill in the midst of writing leaves it
    rest = solve(system, (0, 60), start, record=record)
    assert not list((tmp_path / "run.zarr").rglob("*.partial"))
    np.testing.assert_array_equal(rest.events.times, whole.events.times)
    np.testing.assert_array_equal(rest.events.codes, whole.events.codes)
    np.testing.assert_array_equal(rest.x, whole.x[:, [0, -1]])


def test_a_checkpoint_whose_events_are_gone_is_refused(tmp_path, monkeypatch):
    system, start = train(120)
    record = Recorder(events=tmp_path / "run.zarr", checkpoint=tmp_path / "run.chk")
    monkeypatch.setattr(local, "SLICE", 50)
    assert solve(system, (0, 60), start, record=record, max_steps=40).outcome is Outcome.TOO_MANY_STEPS
    shutil.rmtree(tmp_path / "run.zarr")
    with pytest.raises(ValueError, match=r"has lost events .* bring them back, or remove the checkpoint"):
        solve(system, (0, 60), start, record=record)
    with pytest.raises(ValueError, match="give a folder for the events too"):
        Recorder(checkpoint="run.chk")


@pytest.mark.parametrize("parts", [0, 2])
@pytest.mark.parametrize(
    "make", [lambda: train(120), lambda: toppling("chain", 120)], ids=["train", "toppling"]
)
def test_an_event_for_which_there_is_no_room_happens_once(monkeypatch, make, parts):
    """Room is found too small at almost every event, before its instant and after."""
    system, start = make()
    if parts:
        monkeypatch.setattr("pwsmooth.paths.parts._FROM", 100)
        monkeypatch.setattr("pwsmooth.paths.parts._WIDE", 12)
    whole = solve(system, (0, 60), start, local=True, t_eval=[0, 60])
    met, call, grow = [], local._Run._call, local.SmallSystem.enlarge

    def narrow(run):
        if not met or not met[-1]:
            for small in run.systems:
                small.A.patch.most = 1
        code = call(run)
        met.append(code == Outcome.OUT_OF_MEMORY)
        return code

    def enlarge(small):
        patch = small.A.patch
        if patch.needs:
            patch.most, patch.needs = patch.needs, 0
        else:
            grow(small)

    monkeypatch.setattr(local._Run, "_call", narrow)
    monkeypatch.setattr(local.SmallSystem, "enlarge", enlarge)
    monkeypatch.setattr(local, "SLICE", 1)
    found = solve(system, (0, 60), start, local=True, t_eval=[0, 60])
    assert sum(met) > len(whole.events) / 2
    np.testing.assert_array_equal(found.events.times, whole.events.times)
    np.testing.assert_array_equal(found.x, whole.x)


def quakes(solution):
    found = solution.catalogue.avalanches(drift=0.1)
    return {"avalanches": len(found), "moment": found.moment.sum()}


def test_a_sweep_of_local_runs_has_the_bits_of_solve_on_threads_and_on_a_cluster(tmp_path):
    system, start = train(150)
    stiffness = [1.0, 1.5, 2.0, 3.0]

    def swept(**more):
        measure = Function(quakes, names=("avalanches", "moment"))
        return sweep(
            system, {"k": stiffness}, x0=start, t_span=(0, 20), measures=[measure], record=Recorder(),
            work=Work(chunk=1, progress=False, **more),
        )  # fmt: skip

    found = swept()
    alone = [
        quakes(solve(system.with_parameters({"k": k}), (0, 20), start, record=Recorder())) for k in stiffness
    ]
    assert (found.outcome == 0).all() and found.avalanches.min() > 10
    for name in ("avalanches", "moment"):
        np.testing.assert_array_equal(found[name], [one[name] for one in alone])
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(tmp_path)
    )
    with cluster, distributed.Client(cluster) as client:
        far = swept(executor=client.get_executor(), store=tmp_path / "sweep.zarr")
    for name in ("avalanches", "moment", "outcome"):
        np.testing.assert_array_equal(far[name], found[name])


@pytest.mark.parametrize(
    "options, words",
    [
        ({"record": Recorder(events="run.zarr")}, "over which all points would write"),
        ({"record": 3}, r"`record` is 3; give Recorder"),
        ({"record": Recorder(), "measures": ["counts"]}, "keeps its events and no steps; give functions"),
    ],
)
def test_a_sweep_says_what_a_recorder_cannot_do_there(options, words):
    system, start = train(150)
    arguments = {"measures": [Function(quakes, names=("avalanches", "moment"))], "t_span": (0, 1)} | options
    with pytest.raises((ValueError, TypeError), match=words):
        sweep(system, {"k": [1.0]}, x0=start, **arguments)
    with pytest.raises(ValueError, match="`record` is given, but its elements are written out"):
        sweep(System({sp.Symbol("x", real=True): 1}), t_span=(0, 1), x0=[0], points={"t": [0.0]}, measures=quakes,
              record=Recorder())  # fmt: skip


def test_many_elements_are_set_up_without_an_object_for_each():
    blocks = Family(200_000)
    x, v = blocks.symbols("x v")
    (F,) = blocks.symbols("F", positive=True)
    system = System({x: v, v: -x - F * Switch("lam", v)}, parameters={F: np.linspace(0.1, 0.2, 200_000)})
    assert len(system.states) == 400_000 and system.states[3].name == "x_4"
    assert system.parameters["F_200000"] == 0.2
    changed = system.with_parameters({F: 0.3, "F_7": 0.4})
    assert (changed.parameters["F_6"], changed.parameters["F_7"]) == (0.3, 0.4)
    with pytest.raises(ValueError, match="positive"):
        system.with_parameters({"F_9": -1})
    with pytest.raises(ValueError, match="2 values to F, which has 200000 elements"):
        system.with_parameters({F: [1, 2]})
    with pytest.raises(ValueError, match="give all of x, v"):
        solve(system, (0, 1), {x: 1})
    run = solve(system, (0, 0.1), {x: 1.0, v: 0.0})
    assert run.success and run.x.shape == (400_000, 2)
    # From rest x - F -> cos t.
    np.testing.assert_allclose(run["x_1"][-1], 0.1 + 0.9 * np.cos(0.1), rtol=1e-8)


def test_every_value_of_many_elements_fits_what_its_symbol_is_declared():
    n = 20_000
    cells = Family(n)
    x = cells.symbols("x", nonnegative=True)[0]
    (number,) = cells.symbols("k", integer=True)
    values = np.arange(n, dtype=float) - 5
    system = System({x: number - x}, parameters={number: values})
    values[7_000] = 0.5  # neither the smallest nor the largest, and not 0
    with pytest.raises(ValueError, match=r"value of 'k_7001' is 0.5; k_7001 must be integer"):
        system.with_parameters({number: values})
    with pytest.raises(ValueError, match="has the shape"):
        system.with_parameters({number: np.zeros((n, 2))})
    # What is 0 to rounding, as the end of another run may be, is 0 in an array as it is alone.
    start = np.where(np.arange(n) % 2, -7e-18, 1.0)
    run = solve(system.with_parameters({number: 0}), (0, 1e-6), {x: start})
    assert (run.x[1::2] == 0).all()


def test_a_recorder_is_refused_where_nothing_is_local():
    system = System({sp.Symbol("x", real=True): 1})
    with pytest.raises(ValueError, match="`record` is given, but its elements are written out"):
        solve(system, (0, 1), [0], record=Recorder())
    with pytest.raises(TypeError, match="`record` is 3"):
        solve(system, (0, 1), [0], record=3)
    with pytest.raises(ValueError, match="ends in .zarr"):
        Recorder(events="log.csv")
    with pytest.raises(ValueError, match="from 1 on"):
        Recorder(elements=[0])
