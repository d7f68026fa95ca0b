"""A sweep in a store survives: killed at any moment it resumes, with the bits of a run that was not."""

import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
import xarray
from friction_oscillator import coulomb, omega

from pwsmooth import sweep
from pwsmooth.sweep import Amplitude

START = {"y": 0.5, "v": 0.3}
LONG = 6000  # periods of a transient that makes a chunk take some 50 ms: time to be killed in
AXES = {"k": np.linspace(1.5, 5, 12), "sigma": np.linspace(0.6, 3, 10)}


def run(store=None, **changes):
    arguments = dict(
        start=START, period=2 * sp.pi / omega, transient=20, periods=8, chunk=3, workers=2, store=store,
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
    script = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import test_sweep_store as here; "
    )
    command = [sys.executable, "-c", script + f"here.run({str(store)!r}, transient={LONG})"]
    moments, kills, cut_off = random.Random(7), 0, 0
    for attempt in range(5):
        before = _chunks(store)
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        # Killed as soon as there is a store, then a random time after the first new chunk; the last one is let be.
        while child.poll() is None and attempt < 4:
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
    assert same_bits(run(store, transient=3), whole)


@pytest.mark.parametrize(
    "changes, words",
    [
        (dict(transient=4), "transient and periods is 3, 8"),
        (dict(rtol=1e-8), "tolerances"),
        (dict(start={"y": 0.5, "v": 0.4}), "start is y = 0.5, v = 0.3"),
        (dict(measures="sticks"), "measures is"),
        (dict(period=6), "period is 2*pi/omega"),
    ],
)
def test_a_store_of_another_sweep_is_refused(tmp_path, changes, words):
    store = tmp_path / "sweep.zarr"
    run(store, transient=3)
    with pytest.raises(ValueError, match="was made by another sweep") as caught:
        run(store, **(dict(transient=3) | changes))
    assert words in str(caught.value)


def test_a_store_of_another_version_is_refused(tmp_path, monkeypatch):
    store = tmp_path / "sweep.zarr"
    run(store, transient=3)
    from pwsmooth.sweep import dataset

    real = dataset.version_items()
    monkeypatch.setattr(dataset, "version_items", lambda: real | {"pwsmooth": "9.9"})
    with pytest.raises(ValueError, match=r"its pwsmooth is .*, this one's is 9\.9"):
        run(store, transient=3)


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
