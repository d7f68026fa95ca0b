"""Kicks: exact answers, reproducibility, and what they do to switches.

Guards: kernels/noise/kicks.py, kernels/noise/random.py.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from family_models import template_from
from noise_numbers import draws

from pwsmooth import Event, Family, Kicks, Memory, Outcome, Switch, System, solve
from pwsmooth.noise.kicks import KickedRun
from pwsmooth.studies import ensemble

t, x, y, v, z = sp.symbols("t x y v z", real=True)
lam = Switch("lam", v)


def still(*states):
    """States that nothing but noise moves."""
    return System({s: 0 * s for s in states})


def block(**options):
    """A block on dry ground: v' = -sign v."""
    return System({v: -lam}, **options)


def oscillator(beta=0.1):
    drive = -2.4 * sp.sin(t) - 3.1 * y - 0.1 * v
    return System({y: v, v: drive - lam * (1 + 3 * z), z: (1 - lam**2 - z) / beta}, time=t)


# ---- the numbers


@pytest.mark.parametrize("law", ["uniform", "normal"])
@pytest.mark.parametrize("seed, trajectory", [(0, 0), (1, 5), (2**63 - 1, 2**62)])
def test_kicks_are_the_numbers_of_philox_at_their_address(law, seed, trajectory):
    states = sp.symbols("a0:5")
    sizes = {s: 0.1 * (i + 1) for i, s in enumerate(states)}
    run = solve(still(*states), (0, 3.5), dict.fromkeys(states, 0), noise=Kicks(sizes, 1, law=law, seed=seed,
                trajectory=trajectory))  # fmt: skip
    kicks = np.array([draws(seed, trajectory, k, 5, law) for k in (1, 2, 3)])
    expected = np.cumsum(kicks, axis=0)[-1] * list(sizes.values())
    # Sums of three numbers of size 1; libm's log and cosine differ from numpy's by an ulp.
    assert np.abs(run.x[:, -1] - expected).max() <= 16 * np.finfo(float).eps


@pytest.mark.parametrize(
    ("law", "variance", "fourth"), [("uniform", 1 / 3, 1 / 5), ("normal", 1, 3), ("laplace", 1, 6)]
)
def test_the_laws_have_their_moments(law, variance, fourth):
    n = 100_000
    noise = Kicks(1.0, 1, on=x, law=law, seed=3)
    kicks = np.diff(solve(still(x), (0, n + 0.5), {x: 0}, noise=noise, t_eval=np.arange(n + 1) + 0.5)["x"])
    # Five standard errors of the estimates of mean and variance.
    assert abs(kicks.mean()) < 5 * math.sqrt(variance / n)
    assert abs(np.mean(kicks**2) - variance) < 5 * math.sqrt((fourth - variance**2) / n)


def test_trajectories_and_states_are_independent():
    n = 20_000
    columns = []
    for trajectory in (0, 1):
        noise = Kicks(1.0, 1, on=(x, y), seed=3, trajectory=trajectory)
        between = np.arange(n + 1) + 0.5
        run = solve(still(x, y), (0, n + 0.5), {x: 0, y: 0}, noise=noise, t_eval=between)
        columns += list(np.diff(run.x, axis=1))
    correlation = np.corrcoef(columns)
    # The correlation of independent samples has the standard deviation 1/sqrt(n).
    assert np.abs(correlation - np.eye(4)).max() < 5 / math.sqrt(n)


# ---- reproducibility


@pytest.mark.parametrize("view", ["exact", "smoothed"])
def test_kicks_of_size_zero_leave_the_deterministic_run_to_the_bit(view):
    system = oscillator() if view == "exact" else oscillator().smoothed(eps=0.01)
    start = {y: 0.5, v: 0.3, z: 0}
    plain = solve(system, (0, 10), start)
    noisy = solve(system, (0, 10), start, noise=Kicks(0, 0.1, on=(y, v), seed=1))
    assert np.array_equal(plain.t, noisy.t) and np.array_equal(plain.x, noisy.x)


@pytest.mark.parametrize("view", ["exact", "smoothed"])
def test_equal_seeds_give_equal_bits_and_other_seeds_do_not(view):
    system = oscillator() if view == "exact" else oscillator().smoothed(eps=0.01)
    runs = [
        solve(system, (0, 10), {y: 0.5, v: 0.3, z: 0}, noise=Kicks(1e-3, 0.1, on=(y, v), seed=seed)).x
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(runs[0], runs[1]) and not np.array_equal(runs[0][:, -1], runs[2][:, -1])


def test_a_run_cut_in_two_meets_the_kicks_of_the_whole_run():
    noise = Kicks(1.0, 0.25, on=x, seed=9)
    whole = solve(still(x), (-3, 7), {x: 0}, noise=noise)
    first = solve(still(x), (-3, 1.1), {x: 0}, noise=noise)
    second = solve(still(x), (1.1, 7), {x: first["x"][-1]}, noise=noise)
    assert second["x"][-1] == whole["x"][-1]
    # -2.75, -2.5, ..., 7: the start is left to what came before, the end belongs to the run.
    assert len(whole.event_times("reset")) == 40


# ---- switches


def test_a_resting_block_is_kicked_into_slip_and_comes_to_rest_after_its_speed():
    run = solve(block(), (0, 3.5), {v: 0}, noise=Kicks(0.4, 1, on=v, seed=4))
    kicks = 0.4 * np.array([draws(4, 0, k, 1, "uniform")[0] for k in (1, 2, 3)])
    slips = [s for s in run.segments if s.status != (0,)]
    assert [s.status[0] for s in slips] == list(np.sign(kicks))
    assert np.allclose([s.start for s in slips], [1, 2, 3], rtol=0, atol=1e-15)
    # Friction of 1 on the mass 1 takes |v| seconds.
    assert np.allclose([s.duration for s in slips], np.abs(kicks), rtol=0, atol=1e-14)


def test_the_plain_pair_meets_the_same_kicks():
    noise = Kicks(1e-2, 0.1, on=(y, v), seed=3)
    runs = [
        solve(oscillator(), (0, 4), {y: 0.5, v: 0.3, z: 0}, noise=noise, method=m) for m in ("taylor", "rk")
    ]
    # Both at rtol 1e-9; a kick of y or v after another one forgets no error: 40 of them add up.
    assert np.abs(runs[0].x[:, -1] - runs[1].x[:, -1]).max() < 40 * 1e-9


def test_a_kick_across_the_surface_changes_the_side():
    noise = Kicks(2.0, 1, on=v, seed=0)
    kick = 2.0 * draws(0, 0, 1, 1, "uniform")[0]
    start = -np.sign(kick) * (1 + abs(kick) / 2)  # |kick|/2 against it when the kick comes
    run = solve(block(), (0, 1.01), {v: start}, noise=noise)
    assert run.mult[0, 0] == -np.sign(kick) and run.mult[0, -1] == np.sign(kick)
    assert math.isclose(run["v"][-1], kick / 2 - np.sign(kick) * 0.01, abs_tol=1e-12)


def test_a_kick_along_the_surface_keeps_the_stick():
    system = System({x: v, v: -lam - x / 10})
    run = solve(system, (0, 2.5), {x: 0.0, v: 0.0}, noise=Kicks(0.1, 1, on=x, seed=2))
    assert run.itinerary == ("stick (lam sliding)",) and abs(run["lam"][-1] + run["x"][-1] / 10) < 1e-15


def test_a_kick_comes_on_top_of_a_reset_of_the_same_instant():
    latch = Memory("latch", 0)
    events = [Event(every=1, update={x: 5, latch: latch + 1})]
    system = System({x: 0 * x + 0 * latch}, events=events)
    run = solve(system, (0, 1.5), {x: 0}, noise=Kicks(0.1, 1, on=x, seed=6))
    assert run["x"][-1] == 5 + 0.1 * draws(6, 0, 1, 1, "uniform")[0]
    assert run["latch"][-1] == 1


def test_the_kicked_smoothed_block_tends_to_the_event_driven_one():
    noise = Kicks(0.3, 0.2, on=v, law="normal", seed=8)
    system = System({x: v, v: sp.sin(3 * t) / 2 - lam}, time=t)
    exact = solve(system, (0, 6), {x: 0, v: 0.5}, noise=noise)
    errors = [
        np.abs(solve(system.smoothed(eps=eps), (0, 6), {x: 0, v: 0.5}, noise=noise).x[0, -1] - exact.x[0, -1])
        for eps in (1e-3, 1e-4)
    ]
    # Every slip ends within O(eps) of the exact one, and there are 30 kicks: first order, up to a logarithm.
    assert errors[1] < errors[0] / 5 and errors[0] < 30 * 1e-3


# ---- the door


@pytest.mark.parametrize(
    ("error", "arguments", "said"),
    [
        (ValueError, dict(size=-1e-3, every=1, on="x"), "`size` of 'x' is -0.001"),
        (ValueError, dict(size=math.nan, every=1, on="x"), "`size` of 'x' is nan"),
        (ValueError, dict(size={"x": math.inf}, every=1), "`size` of 'x' is inf"),
        (TypeError, dict(size="big", every=1, on="x"), "give a number"),
        (ValueError, dict(size=1, every=0, on="x"), "`every` of the kicks is 0"),
        (ValueError, dict(size=1, every=-2, on="x"), "`every` of the kicks is -2"),
        (ValueError, dict(size=1, every=1), "`on` is not given"),
        (ValueError, dict(size=1, every=1, on=()), "`on` is empty"),
        (TypeError, dict(size=1, every=1, on=3), "`on` is 3"),
        (ValueError, dict(size=1, every=1, on=("x", x)), "names a state twice"),
        (ValueError, dict(size={"x": 1}, every=1, on=("x", "y")), "`size` has values for"),
        (ValueError, dict(size=1, every=1, on="x", law="cauchy"), "choose one of uniform, normal, laplace"),
        (TypeError, dict(size=1, every=1, on="x", seed=1.5), "`seed` is 1.5"),
        (TypeError, dict(size=1, every=1, on="x", seed=True), "`seed` is True"),
        (ValueError, dict(size=1, every=1, on="x", seed=-1), "`seed` is -1"),
        (ValueError, dict(size=1, every=1, on="x", trajectory=2**63), "`trajectory` is"),
    ],
)
def test_bad_kicks_are_refused_where_they_are_made(error, arguments, said):
    with pytest.raises(error) as caught:
        Kicks(**arguments)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("error", "options", "said"),
    [
        (ValueError, dict(noise=Kicks(1, 1, on="w")), "`on` of the kicks names 'w'"),
        (ValueError, dict(noise=Kicks(1, 1, on="latch")), "which is a memory"),
        (TypeError, dict(noise=0.1), "give Kicks("),
        (ValueError, dict(noise=Kicks(1, 1, on="v"), method="LSODA"), "runs without events"),
    ],
)
def test_kicks_that_do_not_fit_the_system_are_refused(error, options, said):
    system = block(events=[Event(every=1, update={Memory("latch", 0): 1})]).smoothed(eps=0.1)
    with pytest.raises(error) as caught:
        solve(system, (0, 1), {v: 0}, **options)
    assert said in str(caught.value)


def test_the_solution_says_what_kicked_it():
    run = solve(block(), (0, 1.5), {v: 0}, noise=Kicks(0.4, 1, on=v, seed=4))
    assert "uniform kicks of v by 0.4, every 1, seed 4" in repr(run)
    assert run.to_dataset().attrs["noise"] == str(run.noise)


def test_an_ensemble_of_kicked_runs_is_what_solve_gives():
    noise = Kicks(0.4, 1, on=v, seed=4)
    many = ensemble(block(), (0, 3.5), {v: 0}, noise, 4, t_eval=[1.1, 2.1])
    for k in range(4):
        one = solve(block(), (0, 3.5), {v: 0}, noise=replace(noise, trajectory=k), t_eval=[1.1, 2.1, 3.5])
        assert np.array_equal(many["v"][k], one["v"][:2]) and many.end[k, 0] == one["v"][2]


def test_an_ensemble_keeps_what_came_before_a_stop():
    system = System({x: 1 + 0 * x}, events=[Event(x - 2, terminal=True)])
    many = ensemble(system, (0, 9), {x: 0}, Kicks(0.5, 1, on=x, seed=5), 3, t_eval=[0.5, 1, 4, 8])
    assert set(many.outcomes) == {Outcome.TERMINATED}
    assert np.array_equal(np.isnan(many["x"]), np.tile([0, 0, 1, 1], (3, 1)).astype(bool))
    # One is kicked across the surface of the event, which ends it as well.
    assert np.all((many.end >= 2) & (many.end < 2.5)) and np.all(many.end_time < 4)


def test_the_copies_of_a_family_are_kicked_like_single_states():
    blocks = Family(8)
    (w,) = blocks.symbols("w")
    run = solve(
        System({w: -Switch("rub", w)}), (0, 1.05), {w: 0}, noise=Kicks(0.5, 1, on=("w_1", "w_8"), seed=2)
    )
    kicks = 0.5 * np.array(draws(2, 0, 1, 2, "uniform"))
    after = kicks - np.sign(kicks) * (run.t[-1] - 1)
    assert np.allclose(run.x[[0, 7], -1], np.where(np.abs(kicks) > 0.05, after, 0), rtol=0, atol=1e-12)
    assert not run.x[1:7].any()


# ---- families


@pytest.mark.parametrize("hidden", [0, 0.2])
def test_elements_of_a_family_are_kicked_as_those_that_are_written_out(hidden):
    def rubbing(n):
        blocks = Family(n)
        a, b = blocks.symbols("a b")
        pull = blocks.neighbour(a, 1) - 2 * a + blocks.neighbour(a, -1)
        rub = Switch("rub", b)
        event = Event(a - 1, direction=1, update={a: 0.5})
        rates = {a: b, b: pull - a - rub * (0.1 + hidden * (1 - rub**2))}
        return System(rates, events=[event]), {a: np.cos(np.arange(n)), b: 0.0}, (a, b)

    n, kicks = 12, {"every": 0.25, "seed": 3}
    found = []
    for least in (1, 10**9):
        with template_from(least):
            system, start, (a, b) = rubbing(n)
        assert (system.model.families is None) == (least > n)
        found.append(
            solve(system, (0, 8), start, noise=Kicks({b: 0.05, a: 0.01}, **kicks), rtol=1e-12, atol=1e-14)
        )
        if least == 1:
            assert KickedRun(system, Kicks(0.05, on=b, **kicks)).system.model.families is not None
    one, other = found
    assert len(one.event_times("reset")) > 30 and len(one.events) == len(other.events)
    np.testing.assert_allclose(one.events.times, other.events.times, rtol=0, atol=1e-10)
    np.testing.assert_allclose(one.x[:, -1], other.x[:, -1], rtol=0, atol=1e-11)
    names = [f"b_{i + 1}" for i in range(n)]
    by_name = Kicks({**dict.fromkeys(names, 0.05), **{f"a_{i + 1}": 0.01 for i in range(n)}}, **kicks)
    same = solve(system, (0, 8), start, noise=by_name, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(same.x, other.x)


def test_a_large_family_is_kicked_without_writing_its_elements_out():
    blocks = Family(1000)
    a, b = blocks.symbols("a b")
    system = System({a: b, b: -a - sp.sign(b) / 10})
    start = {a: np.linspace(-1, 1, 1000), b: 0}
    run = solve(system, (0, 3), start, noise=Kicks(0.01, 0.5, on=b, seed=1), t_eval=[0, 3])
    kicked = KickedRun(system, Kicks(0.01, 0.5, on=b))
    assert kicked.system.model.families is not None and len(kicked.where) == 1000
    assert run.success and len(run.event_times("reset")) == 6
