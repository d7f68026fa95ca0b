"""Ctrl-C while pools work: it is heard at looks and at the end of the block alone, and no process is left."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
import sympy as sp

from pwsmooth import Event, Strobe, System, diagram
from pwsmooth.paths.interrupts import noted, processes, result
from pwsmooth.studies import Work


@pytest.fixture(autouse=True)
def heard():
    """Ctrl-C raises, as usual; a shell's background job begins deaf to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def press():
    signal.raise_signal(signal.SIGINT)


def test_it_is_raised_at_a_look_and_nowhere_before():
    done = []
    with pytest.raises(KeyboardInterrupt), noted() as look:
        press()
        done.append("the work after it")
        look()
        done.append("the work after the look")
    assert done == ["the work after it"]


def test_it_is_raised_at_the_end_of_the_block_if_nobody_looked():
    done = []
    with pytest.raises(KeyboardInterrupt), noted():
        press()
        done.append("the rest of the block")
    assert done == ["the rest of the block"]


def test_an_interrupt_outlives_the_error_that_comes_of_it():
    with pytest.raises(KeyboardInterrupt), noted():
        press()
        raise RuntimeError("a worker was lost")


def test_the_handler_of_before_is_there_again():
    before = signal.getsignal(signal.SIGINT)
    with noted():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_a_block_within_a_block_raises_at_its_own_looks():
    done = []
    with pytest.raises(KeyboardInterrupt), noted(), noted() as look:
        press()
        done.append("the work after it")
        look()
        done.append("the work after the look")
    assert done == ["the work after it"]


def test_who_ignores_it_is_not_interrupted():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with noted() as look:
            press()
            look()
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_leave_the_handler_alone():
    seen = []

    def inside():
        with noted() as look:
            seen.append(signal.getsignal(signal.SIGINT))
            look()

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=inside)
    thread.start()
    thread.join()
    assert seen == [before]


def test_a_result_is_waited_for_until_ctrl_c_and_no_process_is_left():
    others = {*multiprocessing.active_children()}
    with pytest.raises(KeyboardInterrupt), processes(2) as (pool, look):
        assert result(pool.submit(abs, -3), look) == 3
        endless = pool.submit(time.sleep, 600)
        threading.Timer(0.3, press).start()
        result(endless, look)
    assert {*multiprocessing.active_children()} == others


def test_processes_do_not_hear_it():
    with processes(1) as (pool, look):
        assert result(pool.submit(press), look) is None


KILLED = """
import multiprocessing, time
from pwsmooth.paths.interrupts import processes

if __name__ == "__main__":
    with processes(2) as (pool, look):
        running = [pool.submit(time.sleep, 600) for _ in range(2)]
        while sum(one.running() for one in running) < 2 or len(multiprocessing.active_children()) < 2:
            time.sleep(0.05)
        pool.submit(abs, 1)
        print(*(process.pid for process in multiprocessing.active_children()), flush=True)
        time.sleep(600)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal here")
def test_processes_end_with_a_parent_that_is_killed(tmp_path):
    (tmp_path / "killed.py").write_text(KILLED)
    parent = subprocess.Popen(
        [sys.executable, "killed.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    children = [int(pid) for pid in parent.stdout.readline().split()]
    parent.kill()
    parent.wait()
    parent.stdout.close()

    def alive(pid):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        return True

    for _ in range(300):
        if not any(map(alive, children)):
            break
        time.sleep(0.1)
    assert len(children) == 2 and not any(map(alive, children))


def test_a_diagram_through_processes_is_interrupted_and_taken_up_again(tmp_path):
    t, x, a = sp.symbols("t x a", real=True)
    logistic = System(
        {x: 0 * x}, time=t, parameters={a: 3.2}, events=[Event(every=1, update={x: a * x * (1 - x)})]
    )

    def made(**options):
        return diagram(logistic, {a: (2.9, 3.2)}, {x: 0.3}, Strobe(1, phase=0.5), values=9, **options)

    timer = threading.Timer(0.5, press)  # while its processes begin
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        made(work=Work(workers=2, store=tmp_path / "store"))
    assert str(made(work=Work(store=tmp_path / "store"))) == str(made())
