"""Statistics of events that are added up while a run goes on are those of the catalogue of all events."""

import numpy as np
import pytest

from pwsmooth.families import Activity, Histogram, Recorder, SlipHistogram
from pwsmooth.laws.friction import StaticKinetic
from pwsmooth.paths import local as path
from pwsmooth.scenes import block_train, granular_chain


@pytest.fixture(scope="module")
def runs():
    """A run with the catalogue of its events, and one that keeps none, in blocks of a few events."""
    scene = block_train(StaticKinetic(F_s=1.3), n=120, t_span=(0, 40))
    statistics = kinds_of_statistics()
    before = path._FLUSHED, path.SLICE
    path._FLUSHED, path.SLICE = 17, 100  # many blocks
    try:
        run = scene.solve(record=Recorder(statistics=statistics, keep_events=False))
    finally:
        path._FLUSHED, path.SLICE = before
    return scene.solve(record=Recorder()), run


def kinds_of_statistics():
    return {
        "waits": Histogram("waiting", np.linspace(0, 6, 13), kind="stick"),
        "places": Histogram("x", [-1, 0, 0.5, 1, 1.5]),
        "activity": Activity(0.7, lags=5),
        "slips": Activity(1e9),
        "areas": SlipHistogram("area", [1, 2, 5, 20, 121]),
        "moments": SlipHistogram("moment", np.linspace(0, 60, 7), drift=0.1),
        "lengths": SlipHistogram("length", np.linspace(0, 2, 9), drift=0.1),
        "durations": SlipHistogram("duration", np.linspace(0, 9, 5)),
    }


def test_memory_keeps_no_events(runs):
    whole, run = runs
    assert len(run.events) == len(run.catalogue) == 0 and run.cost["events"] == len(whole.events) > 500
    np.testing.assert_array_equal(run.x, whole.x)


def test_histograms_are_those_of_the_catalogue(runs):
    whole, run = runs
    log, found = whole.catalogue, run.statistics["places"]
    x = log.states["x"]
    assert found.counts.tolist() == np.histogram(x, found.edges)[0].tolist()  # none on the last edge
    assert (found.below, found.above) == ((x < -1).sum(), (x > 1.5).sum())
    assert found.mean == pytest.approx(x.mean(), rel=1e-12)
    k = np.argmax(x)
    assert (found.largest, found.largest_t, found.largest_element) == (x[k], log.t[k], log.element[k])


def test_waiting_times_are_those_of_each_element(runs):
    whole, run = runs
    log = whole.catalogue
    stick = np.array([e.kind == "stick" for e in whole.events])
    waits = np.concatenate([np.diff(np.sort(log.t[stick & (log.element == i)])) for i in range(1, 121)])
    found = run.statistics["waits"]
    assert found.counts.tolist() == np.histogram(waits, found.edges)[0].tolist() and found.counts.sum() > 100
    assert found.largest == pytest.approx(waits.max(), abs=0)


def test_the_activity_is_that_of_the_catalogue(runs):
    whole, run = runs
    found = run.statistics["activity"]
    count = np.bincount(np.floor(whole.catalogue.t / 0.7).astype(int), minlength=58)[:57].astype(float)
    assert (found.spans, found.largest) == (57, count.max())
    assert (found.mean, found.variance) == pytest.approx((count.mean(), count.var()), rel=1e-12)
    off = count - count.mean()
    lags = [(off[k:] @ off[: len(off) - k]) / (len(off) - k) / count.var() for k in range(6)]
    assert found.autocorrelation == pytest.approx(lags, abs=1e-12)
    assert run.statistics["slips"].spans == 0 and np.isnan(run.statistics["slips"].mean)


@pytest.mark.parametrize("name", ["areas", "moments", "durations"])
def test_avalanches_are_those_of_the_catalogue(runs, name):
    whole, run = runs
    found = run.statistics[name]
    log = whole.catalogue.avalanches(drift=0.1)
    values = getattr(log, name.removesuffix("s"))
    assert len(log) > 20 and found.counts.tolist() == np.histogram(values, found.edges)[0].tolist()
    k = np.argmax(values)
    assert found.largest == pytest.approx(values[k], abs=1e-12)
    assert (found.largest_t, found.largest_element) == (log.start[k], log.epicentre[k])


def test_lengths_of_slips_are_those_of_the_catalogue(runs):
    whole, run = runs
    found, log = run.statistics["lengths"], whole.catalogue.slips(drift=0.1)
    assert found.counts.tolist() == np.histogram(log.length, found.edges)[0].tolist()
    assert found.mean == pytest.approx(log.length.mean(), rel=1e-12)


def test_what_was_added_up_goes_on_from_a_checkpoint(runs, tmp_path):
    """Stopped and taken up again and again: the same bits as in one go, and no event is kept."""
    scene = block_train(StaticKinetic(F_s=1.3), n=120, t_span=(0, 40))
    _, run = runs
    kinds = kinds_of_statistics()
    record = Recorder(statistics=kinds, keep_events=False, checkpoint=tmp_path / "run", checkpoint_every=100)
    calls, found = 0, None
    while found is None or not found.success:
        found = scene.solve(record=record, max_steps=15)
        calls += 1
        assert calls < 200
    assert calls > 3 and len(found.events) == 0 and found.cost["events"] == run.cost["events"]
    np.testing.assert_array_equal(found.x, run.x)
    for name in kinds:
        mine, one = found.statistics[name].numbers(), run.statistics[name].numbers()
        assert sorted(mine) == sorted(one)
        for what in mine:
            np.testing.assert_array_equal(mine[what], one[what])


def test_what_is_none_is_refused_by_name():
    chain = granular_chain(n=12)
    for wrong, what in (
        (Histogram("y", [0, 1]), "`of` of statistic 'a' is 'y'; give one of waiting, x, v"),
        (Histogram("x", [0, 1], kind="bang"), "`kind` of statistic 'a' is 'bang'"),
        (Activity(1.0, surface="lam"), "`surface` of statistic 'a' is 'lam'; give one of R"),
        (SlipHistogram("area", [0, 1], state="u"), "`state` of statistic 'a' is 'u'; give one of x, v"),
    ):
        with pytest.raises(ValueError, match=what):
            chain.solve(record=Recorder(statistics={"a": wrong}))
    with pytest.raises(ValueError, match="`edges`"):
        Histogram("x", [1, 0])
    with pytest.raises((ValueError, TypeError), match="`statistics` of 'a'"):
        Recorder(statistics={"a": 3})
    with pytest.raises(ValueError, match="`of` is 'v'; give one of length, moment"):
        SlipHistogram("v", [0, 1])
    with pytest.raises(ValueError, match="`keep_events`"):
        Recorder(events="a.zarr", keep_events=False)
