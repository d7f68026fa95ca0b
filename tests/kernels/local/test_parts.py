"""Parts of a large family that threads work on: cuts, the same bits on one thread and on two, and every way to stop.

Guards: kernels/local/parts.py.
"""

import threading

import numpy as np
import pytest
from chain_models import BELT, belt, chain, start_of, train, with_templates

from pwsmooth import Event, Family, Outcome, Switch, System, solve
from pwsmooth.families import Recorder
from pwsmooth.kernels.local.state import WITHOUT_PARTS
from pwsmooth.paths import local, parts
from pwsmooth.paths.parts import PARTS, cut


@pytest.fixture
def small(monkeypatch):
    """Parts of some hundred elements, with borders that still hold."""
    monkeypatch.setattr(parts, "_FROM", 100)
    monkeypatch.setattr(parts, "_WIDE", 12)


@pytest.fixture
def runs(monkeypatch):
    """Of each run that was begun: its number of parts and its code."""
    seen, run = [], local._Run._run

    def told(self, *arguments):
        code = run(self, *arguments)
        seen.append((self.A.parts, code))
        return code

    monkeypatch.setattr(local._Run, "_run", told)
    return seen


def same(one, other):
    for a, b in ((one.x, other.x), (one.mult, other.mult), (one.status, other.status)):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(one.events.times, other.events.times)
    np.testing.assert_array_equal(one.events.codes, other.events.codes)


# ---- cuts


def readers(near):
    pairs = np.stack([near.ravel(), np.repeat(np.arange(len(near)), near.shape[1])], axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    return np.concatenate([[0], np.cumsum(np.bincount(pairs[:, 0], minlength=len(near)))]), pairs[:, 1]


def lattice(side):
    i = np.arange(side * side)
    x, y = i % side, i // side
    moves = (x > 0, -1), (x < side - 1, 1), (y > 0, -side), (y < side - 1, side)
    return np.stack([np.where(there, i + step, i) for there, step in moves], axis=1)


def shuffled(near):
    old = np.random.default_rng(0).permutation(len(near))
    return np.argsort(old)[near[old]]


def one_way(n):
    i = np.arange(n)
    return np.minimum(i + 1, n - 1)[:, None]


@pytest.mark.parametrize(
    "near, by_table",
    [
        (lattice(1000)[:, :2][:5000], False),
        ((np.arange(6000)[:, None] + [-1, 1]) % 6000, False),
        (one_way(5000), False),
        (lattice(300), False),
        (shuffled(lattice(300)), True),
        (np.zeros((5000, 0), int), False),
    ],
    ids=["chain", "ring", "one-way", "lattice", "shuffled", "alone"],
)
def test_nothing_that_one_part_reads_or_writes_is_read_or_written_by_the_other(near, by_table):
    part = cut(near, *readers(near), by_table)
    sizes = np.bincount(part, minlength=PARTS + 1)
    assert sizes[:PARTS].min() > 0.7 * len(near) / PARTS
    reach = []
    for d in range(PARTS):
        own = part == d
        reads, read = np.zeros((2, len(near)), bool)
        reads[near[own]] = True
        read[(own[near] & (near != np.arange(len(near))[:, None])).any(axis=1)] = True
        reach.append(own | reads | read)
    assert not (reach[0] & reach[1]).any()


def test_what_has_no_good_cut_is_not_cut():
    numbers = np.random.default_rng(1)
    graph = numbers.integers(0, 5000, (5000, 4))
    for near in (graph, lattice(64), one_way(100)):
        assert not cut(near, *readers(near), True).any()


# ---- runs


def test_a_chain_has_the_same_bits_on_one_thread_and_on_two(runs, monkeypatch):
    system, start = with_templates(chain, 5000)
    one, two = (solve(system, (0, 8), start, t_eval=[0, 3, 8], local=True, threads=k) for k in (1, 2))
    same(one, two)
    assert runs == [(PARTS, Outcome.FINISHED)] * 2 and one.cost == two.cost
    monkeypatch.setattr(parts, "_FROM", 10**9)
    whole = solve(system, (0, 8), start, t_eval=[0, 3, 8], local=True)
    assert runs[-1] == (0, Outcome.FINISHED) and len(whole.events) == len(one.events) > 2500
    np.testing.assert_allclose(one.x, whole.x, rtol=0, atol=1e-11)
    assert (np.diff(one.events.times) >= 0).all()
    by_element = [np.lexsort((s.events.times, s.events.codes[:, 0])) for s in (one, whole)]
    np.testing.assert_array_equal(one.events.codes[by_element[0]], whole.events.codes[by_element[1]])
    times = one.events.times[by_element[0]], whole.events.times[by_element[1]]
    np.testing.assert_allclose(*times, rtol=0, atol=1e-10)


def test_elements_that_know_nothing_of_each_other_have_the_bits_of_a_run_without_parts(runs, monkeypatch):
    system, start = with_templates(chain, 5000, couple=None)
    two = solve(system, (0, 20), start, t_eval=[0, 20], local=True, threads=2)
    monkeypatch.setattr(parts, "_FROM", 10**9)
    whole = solve(system, (0, 20), start, t_eval=[0, 20], local=True)
    assert [run[0] for run in runs] == [PARTS, 0]
    np.testing.assert_array_equal(two.x, whole.x)
    np.testing.assert_array_equal(np.sort(two.events.times), np.sort(whole.events.times))


@pytest.mark.parametrize("threads", [1, 2])
def test_blocks_that_let_go_together_on_both_sides_of_a_border_do(runs, threads):
    """P2: 8 n events up to T = 60, released at 15 + m P."""
    n = 4200
    system = with_templates(belt, n, 1.5, np.ones(n))
    found = solve(
        system, (0, 60), start_of(system, np.zeros(n)), t_eval=[0, 60], rtol=1e-12, atol=1e-14, threads=threads
    )
    assert runs == [(PARTS, Outcome.FINISHED)] and len(found.events) == 8 * n
    period = 2 * 0.5 / BELT + 2 * np.pi - 2 * np.arctan(0.5 / BELT)
    release = 15.0 + period * np.arange(4)
    nearest = np.abs(found.events.times[:, None] - release).min(axis=1)
    assert (nearest < 1e-11).sum() == 4 * n
    assert np.ptp(found.x[:n, -1]) < 1e-12


def test_a_patch_that_reaches_over_the_border_is_not_lost(small, runs, monkeypatch):
    """A part that has gone on from what an event of the other one changes: all is done once more, without parts."""
    monkeypatch.setattr(parts, "_WIDE", 0)
    system, start = train(120)
    found = solve(system, (0, 200), start, local=True)
    assert runs == [(PARTS, WITHOUT_PARTS), (0, Outcome.FINISHED)]
    monkeypatch.setattr(parts, "_FROM", 10**9)
    same(found, solve(system, (0, 200), start, local=True))


@pytest.mark.parametrize("threads", [1, 2])
def test_a_run_that_was_stopped_ends_at_one_instant_and_goes_on(small, runs, monkeypatch, tmp_path, threads):
    """Parts that were at different times come to the same one; what is kept up to there is all that happened."""
    system, start = train(150)
    whole = solve(system, (0, 60), start, local=True, threads=1)
    monkeypatch.setattr(local, "SLICE", 40)
    record = Recorder(events=tmp_path / "run.zarr", checkpoint=tmp_path / "run.chk", checkpoint_every=100)
    for steps in (10, 25):
        stopped = solve(system, (0, 60), start, record=record, threads=threads, max_steps=steps)
        assert stopped.outcome is Outcome.TOO_MANY_STEPS and 0 < stopped.t[-1] < 60
        before = whole.events.times <= stopped.t[-1]
        np.testing.assert_array_equal(stopped.events.times, whole.events.times[before])
        there = solve(system, (0, stopped.t[-1]), start, t_eval=[0, stopped.t[-1]], local=True)
        np.testing.assert_allclose(stopped.x[:, -1], there.x[:, -1], rtol=0, atol=1e-11)
    # On as many threads as it was not on before.
    rest = solve(system, (0, 60), start, record=record, threads=3 - threads)
    assert all(run[0] == PARTS for run in runs)
    np.testing.assert_array_equal(rest.x, whole.x[:, [0, -1]])
    np.testing.assert_array_equal(rest.events.times, whole.events.times)
    np.testing.assert_array_equal(rest.events.codes, whole.events.codes)


def test_a_run_without_parts_goes_on_without_them(small, runs, monkeypatch, tmp_path):
    monkeypatch.setattr(parts, "_WIDE", 0)
    system, start = train(120)
    monkeypatch.setattr(local, "SLICE", 40)
    record = Recorder(events=tmp_path / "run.zarr", checkpoint=tmp_path / "run.chk", checkpoint_every=100)
    looks = []

    def late(self):
        looks.extend(runs)  # in the second run
        return len(looks) > 50

    with monkeypatch.context() as patch:
        patch.setattr("pwsmooth.paths.budget.Budget.late", late)
        stopped = solve(system, (0, 200), start, record=record)
    assert runs == [(PARTS, WITHOUT_PARTS), (0, Outcome.TIME_LIMIT)] and stopped.outcome is Outcome.TIME_LIMIT
    rest = solve(system, (0, 200), start, record=record)
    assert runs[2:] == [(0, Outcome.FINISHED)]
    same(rest, solve(system, (0, 200), start, record=Recorder()))


def test_what_happens_at_the_very_end_is_kept(small, runs):
    ticking = Family(200)
    (a,) = ticking.symbols("a")
    near = ticking.neighbour(a, 1) - 2 * a + ticking.neighbour(a, -1)
    system = System({a: near}, events=[Event(every=1, update={a: a + 1})])
    found = solve(system, (0, 3), {a: np.linspace(0, 1, 200)}, t_eval=[0, 3], local=True)
    assert runs == [(PARTS, Outcome.FINISHED)]
    np.testing.assert_array_equal(np.bincount(found.events.times.astype(int)), [0, 200, 200, 200])
    assert abs(found.x[:, -1].mean() - 3.5) < 1e-12


def test_the_stamps_of_patches_begin_anew(small, runs, monkeypatch):
    system, start = train(120)
    whole = solve(system, (0, 60), start, local=True)
    monkeypatch.setattr(local, "_STAMPS", 500)
    monkeypatch.setattr(local, "SLICE", 100)
    same(whole, solve(system, (0, 60), start, local=True))
    assert {run[0] for run in runs} == {PARTS}


def test_what_moves_across_the_border_is_looked_at_once_by_each_part(small, monkeypatch):
    # Of a chain of which every block slides each block is linked with the border: one look at the start of a slab
    # tells a part so, and not one from each of its blocks.
    n, patches, run = 200, [], local._Run._run

    def counted(self, *arguments):
        code = run(self, *arguments)
        patches.append(sum(part.A.patch.stamp // part.A.patch.stride for part in self.systems))
        return code

    monkeypatch.setattr(local._Run, "_run", counted)
    row = Family(n)
    x, v = row.symbols("x v")
    pull = row.neighbour(x, 1) - 2 * x + row.neighbour(x, -1) - x - Switch("lam", v + 2)
    start = {x: 0.3 * np.cos(np.arange(n)) - 1, v: 0}
    found = solve(System({x: v, v: pull}), (0, 2), start, t_eval=[0, 2], local=True, threads=1)
    assert found.success and not found.events and patches[0] < n


def test_no_thread_is_left(small):
    system, start = train(120)
    before = threading.active_count()
    solve(system, (0, 60), start, local=True, threads=2)
    assert threading.active_count() == before


@pytest.mark.parametrize("threads", [0, 1.5, "two", True])
def test_threads_are_a_positive_number(threads):
    system, start = train(5)
    with pytest.raises((ValueError, TypeError), match=r"`threads` is .*; give an integer >= 1"):
        solve(system, (0, 1), start, threads=threads)
