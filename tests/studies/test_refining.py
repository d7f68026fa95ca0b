"""Sweeps that are looked at while they run: the coarse picture first, the same numbers in the end."""

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import hidden, omega, z

from pwsmooth import Event, Strobe, System, basins, sweep
from pwsmooth.studies import Period, Points, Work, make_plan, orbit_diagram, refine, refining
from pwsmooth.studies.attraction import refine_basins
from pwsmooth.studies.refining import spread

DRIVE = 2 * sp.pi / omega
START = {"y": 0.5, "v": 0.3, "z": 0}
x, t, c = sp.symbols("x t c", real=True)
VALUES = np.append(np.linspace(2.0, 3.9, 99), 10 / 3)


def logistic(**values):
    jump = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: c * x * (1 - x)})
    return System({x: 0 * x}, time=t, parameters={c: 3}, events=[jump]).with_parameters(values)


def doubling(**more):
    """From a fixed point through 2, 4, 8 points to chaos."""
    arguments = dict(
        x0={x: 0.3}, seen=Strobe(1), transient=100, periods=60, measures=[Points("x", last=61), Period()]
    )
    return make_plan(logistic(), {c: VALUES}, **arguments | more)


@pytest.mark.parametrize("shape", [(1,), (7,), (64,), (5, 9), (16, 16), (3, 4, 5)])
def test_the_default_order_has_every_point_once_and_the_first_of_them_spread(shape):
    order = spread(shape)
    assert np.array_equal(np.sort(order), np.arange(np.prod(shape)))
    if shape == (16, 16):
        # The grids of step 16, 8, 4, 2, 1, each complete before the next one.
        for step in (16, 8, 4, 2, 1):
            places = np.unravel_index(order[: (16 // step) ** 2], shape)
            assert all(np.all(place % step == 0) for place in places)
    if shape == (64,):
        assert np.array_equal(np.sort(order[:8]), np.arange(0, 64, 8))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_complete_refinement_is_the_sweep_to_the_bit(workers):
    plan = doubling()
    whole = sweep(
        logistic(), {c: VALUES}, x0={x: 0.3}, seen=Strobe(1), transient=100, periods=60,
        measures=[Points("x", last=61), Period()], work=Work(progress=False),
    )  # fmt: skip
    assert plan.dataset(refine(plan, settle=None, workers=workers)).identical(whole)


def test_an_order_may_follow_from_what_was_found():
    plan, seen = doubling(), []

    def onwards():
        yield from range(40)  # as many as are in the first chunk
        yield 99 - int(seen[0][-1])

    for numbers, _ in refine(plan, onwards()):
        seen.append(numbers)
    assert [part.tolist() for part in seen] == [list(range(40)), [60]]
    with pytest.raises(ValueError, match="order"):
        next(refine(plan, iter([0, 100])))


def test_orbits_that_settle_early_have_the_points_of_those_that_do_not(monkeypatch):
    plan = doubling()
    early, full = plan.dataset(refine(plan)), plan.dataset(refine(plan, settle=None))
    # Beyond 3.57 it is chaotic but for windows, and runs in full.
    chaotic = full.period.values == 0
    assert 0 < chaotic.sum() < 60
    assert np.array_equal(early.x_points.values[chaotic], full.x_points.values[chaotic])
    # 111 periods are left out, in each of which an orbit may creep by 1e-6 (1 + abs(x)).
    assert np.abs(early.x_points.values - full.x_points.values).max() <= 111 * 1e-6 * 2
    np.testing.assert_array_equal(early.period.values, full.period.values)
    assert (early.outcome == full.outcome).all() and (early.t_reached == full.t_reached).all()
    # From 0.3 the map of c = 10/3 steps onto its fixed point 0.7, which repels: a rounding leads to the two-cycle.
    assert np.ptp(early.x_points.values[-1]) > 0.3
    # A fixed point of multiplier 2 - c is settled after 18 periods for c < 2.4: of these 110 periods were not run.
    ran = 0
    work = refining.run_chunk

    def counted(plan, columns, **more):
        nonlocal ran
        ran += len(columns["c"]) * (plan.transient + plan.periods)
        return work(plan, columns, **more)

    monkeypatch.setattr(refining, "run_chunk", counted)
    plan.dataset(refine(plan))
    assert 100 * 50 + chaotic.sum() * 160 <= ran <= 100 * 50 + (VALUES > 2.4).sum() * 160


def test_an_orbit_diagram_of_sticks_is_the_same_whether_refined_or_not():
    values = np.linspace(0.5, 6, 12)
    plan = make_plan(
        hidden(),
        {"rho": values},
        x0=START,
        seen=Strobe(DRIVE),
        transient=60,
        periods=20,
        measures=[Points(last=20)],
    )
    refined = plan.dataset(refine(plan))
    whole = orbit_diagram(hidden(), "rho", values, START, Strobe(DRIVE), transient=60, keep=20)
    for name in "yvz":
        assert np.abs(refined[f"{name}_points"].values - whole[name]).max() < 30 * 1e-6


def test_a_refinement_ends_when_it_is_closed_and_when_its_budget_is_spent():
    plan = doubling()
    chunks = refine(plan)
    indices, values = next(chunks)
    assert len(indices) == 40 and np.ptp(plan.values(indices)["c"]) > 0.95 * 1.9
    assert values["x_points"].shape == (40, 61)
    chunks.close()
    assert next(chunks, None) is None
    assert len(list(refine(plan, max_seconds=1e-9))) == 1
    some = plan.dataset(refine(plan, [3, 1]))
    assert np.flatnonzero(some.outcome.values >= 0).tolist() == [1, 3]


def test_bad_orders_and_budgets_are_refused_before_anything_runs():
    plan = doubling()
    for bad, error in (([0, 100], ValueError), ([-1], ValueError), ([0.5], TypeError), ([[0]], TypeError)):
        with pytest.raises(error, match="`order`"):
            refine(plan, bad)
    with pytest.raises(ValueError, match="`max_seconds` is 0"):
        refine(plan, max_seconds=0)
    with pytest.raises(ValueError, match="`settle` is -1"):
        refine(plan, settle=-1)
    with pytest.raises(TypeError, match="`plan` is"):
        refine((plan, 1))
    with pytest.raises(ValueError, match="`axes` names 'c', which is no state"):
        refine_basins(logistic(), {c: [2.5]}, Strobe(1), x0={x: 0.3})


def test_refined_basins_are_those_of_all_starts_run_to_the_end():
    # Three attractors, of which one takes a few of a hundred starts: see test_basins.py.
    grid = {"y": np.linspace(-2, 2, 14), "v": np.linspace(-3, 3, 14)}
    whole = basins(hidden(), grid, Strobe(2 * sp.pi), x0={z: 0}, transient=150)
    labels, found = np.full(14 * 14, -9), []
    for indices, some, attractors in refine_basins(hidden(), grid, Strobe(2 * sp.pi), x0={z: 0}, transient=150):
        assert [a.x.tolist() for a in attractors[: len(found)]] == [a.x.tolist() for a in found]
        labels[indices], found = some, attractors
    assert len(found) == len(whole.attractors) == 3 and all(orbit.stable for orbit in found)
    same = [min(range(3), key=lambda k: np.abs(whole.attractors[k].x - orbit.x).max()) for orbit in found]
    assert sorted(same) == [0, 1, 2]
    assert np.array_equal(np.array(same)[labels].reshape(14, 14), whole.labels)


def test_starts_of_chaos_have_no_label_when_refined_either():
    chunks = list(refine_basins(logistic(c=3.9), {x: [0.3, 0.4]}, Strobe(1), transient=100))
    assert [(labels.tolist(), found) for _, labels, found in chunks] == [([-1, -1], [])]
