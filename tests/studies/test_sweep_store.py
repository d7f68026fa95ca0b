"""A sweep in a store survives: killed at any moment it resumes, with the bits of a run that was not.

Guards: studies/store.py, studies/running.py.
"""

import errno
import functools
import json
import math
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
import xarray
from friction_oscillator import coulomb, omega

from pwsmooth import Strobe, sweep
from pwsmooth.codegen.machine import cache
from pwsmooth.studies import Amplitude, Function, Measure, Work, read_store
from pwsmooth.studies.contract import Variable
from pwsmooth.studies.identity import UNKNOWN, digest

START = {"y": 0.5, "v": 0.3}
HERE = [str(folder) for folder in Path(__file__).parents[:2]]  # what another process imports from
LONG = 6000  # periods of a transient that makes a chunk take some 50 ms: time to be killed in
AXES = {"k": np.linspace(1.5, 5, 12), "sigma": np.linspace(0.6, 3, 10)}


def run(store=None, executor=None, chunk=3, workers=2, **changes):
    arguments = dict(
        x0=START, seen=Strobe(2 * sp.pi / omega), transient=20, periods=8, work=Work(executor, workers, chunk, store),
        measures=["sticks", "itinerary", "period", "points(y)", Amplitude("y")],
    ) | changes  # fmt: skip
    return sweep(coulomb(), AXES, **arguments)


def same_bits(one, other):
    return one.identical(other) and all(
        one[name].values.tobytes() == other[name].values.tobytes() for name in one.variables
    )


def test_killed_at_random_moments_it_resumes_with_the_same_bits(tmp_path):
    """SIGKILL, again and again at random moments of its working, until a run comes to its end."""
    store = tmp_path / "sweep.zarr"
    script = f"import sys; sys.path[:0] = {HERE!r}; import test_sweep_store as here; "
    command = [sys.executable, "-c", script + f"here.run({str(store)!r}, transient={LONG})"]
    moments, kills, cut_off = random.Random(7), 0, 0
    for attempt in range(4):
        before = _chunks(store)
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        # Killed as soon as there is a store, then a random time after the first new chunk; the last one is let be.
        while child.poll() is None and attempt < 3:
            if _chunks(store) > before or (attempt == 0 and store.exists()):
                time.sleep(moments.uniform(0, 0.2) * (attempt > 1))
                os.kill(child.pid, signal.SIGKILL)
                break
            time.sleep(0.002)
        _, errors = child.communicate()
        assert child.returncode in (0, -signal.SIGKILL), errors.decode()
        kills += child.returncode != 0
        cut_off += 0 < _chunks(store) < 40
    assert kills >= 3 and cut_off >= 2, "the sweep was too short to be killed at work"
    assert child.returncode == 0
    assert same_bits(run(store, transient=LONG), run(transient=LONG))


def _chunks(store):
    """Files of finished chunks: one for every chunk of `outcome`."""
    return sum(1 for p in (store / "outcome" / "c").rglob("*") if p.is_file()) if store.exists() else 0


def test_a_finished_store_is_read_and_opens_in_xarray(tmp_path):
    store = tmp_path / "sweep.zarr"
    first = run(store, transient=3)
    stamps = {p: p.stat().st_mtime_ns for p in store.rglob("*") if p.is_file()}
    again = run(store, transient=3, workers=1, chunk=50)
    assert same_bits(first, again)
    assert stamps == {p: p.stat().st_mtime_ns for p in store.rglob("*") if p.is_file()}
    with xarray.open_zarr(store, consolidated=False) as opened:
        for name in first.variables:
            np.testing.assert_array_equal(opened[name].values.astype(first[name].dtype), first[name].values)
            assert opened[name].dims == first[name].dims


def test_a_chunk_without_its_mark_is_run_again(tmp_path):
    store = tmp_path / "sweep.zarr"
    whole = run(store, transient=3)
    marks = sorted(p for p in (store / "outcome" / "c").rglob("*") if p.is_file())
    for mark in marks[::3]:
        mark.unlink()
    # Half-written data behind a missing mark are overwritten.
    damaged = [store / "stick_time" / mark.relative_to(store / "outcome") for mark in marks[::3]]
    for path in damaged:
        path.write_bytes(b"")
    with pytest.warns(UserWarning, match="damaged, and computed again"):
        assert same_bits(run(store, transient=3), whole)
    assert same_bits(run(store, transient=3), whole)


@pytest.mark.parametrize(
    "changes, words",
    [
        (dict(transient=4), "transient and periods is 3, 8"),
        (dict(rtol=1e-8), "tolerances"),
        (dict(x0={"y": 0.5, "v": 0.4}), "x0 is y = 0.5, v = 0.3"),
        (dict(measures="sticks"), "measures is"),
        (dict(seen=Strobe(6)), "period is 2*pi/omega"),
        (
            dict(seen=Strobe(2 * sp.pi / omega * 1.0)),
            "this one's is 2.0*pi/omega with Float('2.0'",
        ),
    ],
)
def test_a_store_of_another_sweep_is_refused(tmp_path, changes, words):
    store = tmp_path / "sweep.zarr"
    run(store, transient=3)
    with pytest.raises(ValueError, match="was made by another sweep") as caught:
        run(store, **(dict(transient=3) | changes))
    assert words in str(caught.value)


def test_a_period_is_known_to_its_last_bit(tmp_path):
    period = 6.283185307179586
    run(tmp_path / "sweep.zarr", transient=3, seen=Strobe(period))
    with pytest.raises(ValueError, match=r"its period is .*5862'.*, this one's is .*5871'"):
        run(tmp_path / "sweep.zarr", transient=3, seen=Strobe(np.nextafter(period, 7)))


def test_a_finished_store_of_another_version_is_read_and_another_one_refused(tmp_path, monkeypatch):
    store = tmp_path / "sweep.zarr"
    whole = run(store, transient=3)
    from pwsmooth.studies import dataset

    real = dataset.version_items()
    monkeypatch.setattr(dataset, "version_items", lambda: real | {"pwsmooth": "9.9"})
    with pytest.warns(UserWarning, match=r"its pwsmooth is .*, this one's is 9\.9.*only read"):
        assert same_bits(run(store, transient=3), whole)
    (store / "chunk_sha256" / "c" / "3" / "0").unlink()
    with pytest.raises(ValueError, match=r"this one's is 9\.9, and 1 of its 48 chunks have still to run"):
        run(store, transient=3)
    with pytest.warns(UserWarning, match="points 9 to 9"):
        assert int((read_store(store).outcome == -128).sum()) == 1


def test_the_versions_of_a_store_hold_every_source_of_the_package(tmp_path, monkeypatch):
    shutil.copytree(cache.PACKAGE, tmp_path / "pwsmooth", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(cache, "PACKAGE", tmp_path / "pwsmooth")
    known = {cache.sources_key()}
    sources = sorted((tmp_path / "pwsmooth").rglob("*.py"))
    for source in random.Random(1).sample(sources, 20):
        source.write_text(source.read_text() + "\n")
        known.add(cache.sources_key())
    assert len(known) == 21


def test_a_store_of_before_checksums_is_read_with_a_warning(tmp_path):
    store = tmp_path / "sweep.zarr"
    whole = run(store, transient=3, seen=Strobe(6.25))
    group = json.loads((store / "zarr.json").read_text())
    about = group["attributes"]
    identity, versions = (json.loads(about[name]) for name in ("identity", "versions"))
    identity |= {"system": "another hash", "period": identity["period"].partition(" with")[0]}
    for name in ("sha256", "arrays", "variables", "coordinates"):
        del about[name]
    about |= {"identity": json.dumps(identity), "versions": json.dumps(versions | {"sources": "older"})}
    (store / "zarr.json").write_text(json.dumps(group))
    shutil.rmtree(store / "chunk_sha256")
    stamps = {p: p.stat().st_mtime_ns for p in store.rglob("*")}
    with pytest.warns(UserWarning, match="no checksums"):
        assert same_bits(
            run(store, transient=3, seen=Strobe(6.25)), whole.assign_attrs(versions=about["versions"])
        )
    with pytest.warns(UserWarning, match="before stores had checksums"):
        read = read_store(store)
    assert all(
        (read[name].values == whole[name].values).all() for name in ("sticks", "itinerary", "k", "outcome")
    )
    with pytest.raises(ValueError, match=r"its period is 6\.250*, this one\'s is 6\.26"):
        run(store, transient=3, seen=Strobe(6.26))
    assert stamps == {p: p.stat().st_mtime_ns for p in store.rglob("*")}
    chunk = store / "stick_time" / "c" / "1" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-3])
    with pytest.raises(ValueError, match="chunks have still to run"):
        run(store, transient=3, seen=Strobe(6.25))


SCALE = 2.0


def scaled(solution):
    return SCALE * solution["y"][-1]


def made(factor):
    return lambda solution: factor * solution["y"][-1]


def counted(solution, n=1):
    return float(sum(math.comb(3, k) for k in range(n)))


def more(solution):
    return np.sum(solution["y"]) + made(3.0)(solution)


class Scaled:
    """A callable of a user's own that holds more than a function."""

    def __init__(self, func, factor):
        self.func, self.factor = func, factor

    def __call__(self, solution):
        return self.factor * self.func(solution)


@dataclass(frozen=True)
class Last(Measure):
    """A measure of a user's own."""

    compiled = False
    factor: float = 1.0

    def variables(self, setting):
        return {"last": Variable((), (), np.float64, np.nan, {})}

    def of(self, solution, window, setting):
        return {"last": self.factor * solution["y"][-1]}


def test_what_measures_is_known_to_the_last_bit(monkeypatch):
    """Everything that the value of a measure depends on: code, closures, defaults, globals, what they call."""
    numbers = np.arange(3.0)
    measures = [
        made(1.0), made(np.nextafter(1, 2)), scaled, counted, functools.partial(counted, n=2), more, Last(), Last(1.5),
        functools.partial(counted, n=numbers), functools.partial(counted, n=numbers + 1), np.sum, np.mean,
        functools.lru_cache(counted), Function(scaled, dense=True), Function(scaled), {"a": sp.Symbol("a")},
        Scaled(scaled, 1.0), Scaled(scaled, 2.0),
        {"a": sp.Float(0.1, 15)}, {"a": sp.Float("0.1", 30)}, re.compile("a"), re.compile("b"), omega, coulomb(),
    ]  # fmt: skip
    digests = [digest(measure) for measure in measures]
    assert len(set(digests)) == len(measures) and not any(UNKNOWN in d for d in digests)
    monkeypatch.setitem(globals(), "SCALE", 3.0)
    assert digest(scaled) != digests[2]
    monkeypatch.setitem(globals(), "made", lambda factor: made(-factor))
    assert digest(more) != digests[5]
    assert [digest(m) for m in (made, counted)] == [digest(m) for m in (made, counted)]


def digests_of_measures():
    return [digest(m) for m in (functools.partial(counted, n=2), more, Last(1.5), np.sin, coulomb())]


def test_what_measures_is_known_in_another_process():
    program = (
        f"import sys; sys.path[:0] = {HERE!r}; import test_sweep_store as t; print(t.digests_of_measures())"
    )
    env = os.environ | {"PYTHONHASHSEED": "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"}
    done = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, check=True)
    assert done.stdout == f"{digests_of_measures()}\n" and UNKNOWN not in done.stdout


def test_a_measure_that_cannot_be_compared_is_stored_but_not_resumed(tmp_path):
    store = tmp_path / "sweep.zarr"
    with open(os.devnull) as stream:
        measure = Function(lambda solution: solution["y"][-1] + bool(stream), names="last")
        whole = run(store, transient=3, measures=[measure])
        with pytest.raises(ValueError, match="measures is .*holds what cannot be compared: _io.TextIOWrapper"):
            run(store, transient=3, measures=[measure])
    assert same_bits(read_store(store), whole)


def test_a_process_that_comes_second_uses_the_store_of_the_first(tmp_path, monkeypatch):
    store, move = tmp_path / "sweep.zarr", os.replace

    def late(source, target, **more):
        if Path(target) == store:
            monkeypatch.setattr(os, "replace", move)
            run(store, transient=3, chunk=5)  # the other process, within the call
        move(source, target, **more)

    monkeypatch.setattr(os, "replace", late)
    first = run(store, transient=3, chunk=3)
    assert same_bits(first, run(store, transient=3)) and read_store(store).identical(first)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.zarr"]


def test_what_a_killed_creation_left_is_removed_and_nothing_else(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    host, names = socket.gethostname(), []
    for pid, machine in ((dead.pid, host), (os.getpid(), host), (dead.pid, "elsewhere")):
        names.append(f".sweep.zarr-{pid}@{machine}-abcd_123")
        (tmp_path / names[-1] / "new").mkdir(parents=True)
    (tmp_path / ".sweep.zarr-notes").mkdir()
    run(tmp_path / "sweep.zarr", transient=3)
    assert {p.name for p in tmp_path.iterdir()} == {"sweep.zarr", ".sweep.zarr-notes", *names[1:]}


def test_a_full_disk_is_an_error_in_words_and_what_was_written_is_kept(tmp_path, monkeypatch):
    import zarr.storage

    store, room = tmp_path / "sweep.zarr", 100
    write = zarr.storage.LocalStore.set

    async def full(self, key, value):
        nonlocal room
        room -= 1
        if room < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        await write(self, key, value)

    with monkeypatch.context() as m:
        m.setattr(zarr.storage.LocalStore, "set", full)
        with pytest.raises(
            OSError, match=r"sweep\.zarr.* cannot be written at .*No space left.*call sweep\(\) again"
        ):
            run(store, transient=3)
    assert 0 < _chunks(store) < 48
    assert same_bits(run(store, transient=3), run(transient=3))
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(OSError, match=r"sweep\.zarr' cannot be made: .*give a path"):
        run(tmp_path / "file" / "sweep.zarr", transient=3)


def test_a_damaged_description_is_made_again_and_a_damaged_root_is_refused(tmp_path):
    store = tmp_path / "sweep.zarr"
    whole = run(store, transient=3)
    for name, old, new in (
        ("stick_time", "float64", "float32"), ("k", '"k"', '"q"'), ("sticks", "1", "x"), ("outcome", "{", ""),
    ):  # fmt: skip
        path = store / name / "zarr.json"
        path.write_text(path.read_text().replace(old, new))
        with pytest.raises(ValueError, match=f"damaged at {name}/zarr.json"):
            read_store(store)
        with pytest.warns(UserWarning, match=f"{name}/zarr.json"):
            assert same_bits(run(store, transient=3), whole)
        assert read_store(store).identical(whole)
    root = (store / "zarr.json").read_text()
    for damaged in (
        "",
        root[:100],
        root.replace('"chunk": 3', '"chunk": 1e30'),
        root.replace("sha256", "sha257"),
    ):
        (store / "zarr.json").write_text(damaged)
        with pytest.raises(ValueError, match=r"sweep\.zarr' is damaged at zarr\.json: .*restore it"):
            run(store, transient=3)
        with pytest.raises(ValueError, match="is damaged at zarr.json"):
            read_store(store)
    (store / "zarr.json").unlink()
    with pytest.raises(ValueError, match="no store of a sweep"):
        read_store(store)


def test_a_directory_that_is_no_store_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ValueError, match="no store of a sweep"):
        run(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_processes_give_the_bits_of_threads(tmp_path):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert same_bits(run(executor=pool, transient=20), run(transient=20))


def test_two_dask_workers_give_the_bits_of_threads_and_fill_a_store(tmp_path):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(tmp_path)
    )
    with cluster, distributed.Client(cluster) as client:
        assert len(client.scheduler_info()["workers"]) == 2
        pids = set(client.run(os.getpid).values())
        assert len(pids) == 2 and os.getpid() not in pids
        found = run(tmp_path / "sweep.zarr", executor=client.get_executor(), transient=20, chunk=10)
    assert same_bits(found, run(transient=20))


def test_a_lost_worker_keeps_what_was_finished(tmp_path):
    """A worker that dies is an error in words; the next call goes on."""
    store = tmp_path / "sweep.zarr"

    class Dying:
        def __init__(self):
            self.left = 5

        def submit(self, function, *arguments):
            from concurrent.futures import Future

            future, self.left = Future(), self.left - 1
            if self.left < 0:
                future.set_exception(MemoryError("killed by the system"))
            else:
                future.set_result(function(*arguments))
            return future

    with pytest.raises(RuntimeError, match="was lost: MemoryError"):
        run(store, executor=Dying(), transient=3)
    assert 0 < _chunks(store) < 40
    assert same_bits(run(store, transient=3), run(transient=3))
