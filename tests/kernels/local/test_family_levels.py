"""Hidden static friction of a family in runs of all its elements: two levels in loops, shown as lambda and folds.

Guards: paths/levels.py.
"""

import numpy as np
import pytest
import sympy as sp
from family_models import template_from

from pwsmooth import Diffusion, Event, Family, Kicks, Outcome, Switch, System, solve, sweep

t, u = sp.symbols("t u", real=True)


N = 6


def blocks(n=N, periodic=False, events=False):
    """(place, velocity, System): blocks on a belt, whose static friction is above the kinetic one."""
    family = Family(n, periodic)
    x, v = family.symbols("x v")
    F, rho = family.symbols("F rho", positive=True)
    lam = Switch("lam", v - u)
    pull = family.neighbour(x, 1) + family.neighbour(x, -1) - 2 * x
    values = {F: [1 + 0.02 * k for k in range(n)], rho: [0.35 + 0.1 * k for k in range(n)], u: 0.2}
    more = [Event(x - 0.8, direction=1, update={x: 0.5}, name="back")] if events else []
    rates = {x: v, v: pull - x - F * lam * (1 + rho * (1 - lam**2))}
    with template_from(1):
        system = System(rates, time=t, parameters=values, events=more, outputs={"rub": family.sum(F * lam**2)})
    return x, v, system


def itinerary(run):
    return sorted((e.switch, e.kind, e.note) for e in run.events)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("method", ["taylor", "rk"])
def test_loops_are_the_elements_written_out(periodic, method):
    x, v, system = blocks(periodic=periodic, events=True)
    start = {x: np.sin(np.arange(N)).tolist(), v: 0.2}
    options = dict(rtol=1e-11, atol=1e-13, method=method)
    looped, written = (solve(each, (0, 14), start, **options) for each in (system, system._written_out()))
    assert looped.model.families is not None and written.model.families is None
    assert {"slip by fold", "stick"} <= {e.kind for e in looped.events}
    assert itinerary(looped) == itinerary(written)
    wanted = np.linspace(0.01, 13.97, 57)
    asked = [solve(each, (0, 14), start, t_eval=wanted, **options) for each in (system, system._written_out())]
    for name in (*written.states, "lam_2", "lam_5", "rub"):
        assert np.abs(asked[0][str(name)] - asked[1][str(name)]).max() < 1e-8
        assert abs(looped[str(name)][-1] - written[str(name)][-1]) < 1e-8


def test_a_start_between_both_levels_is_recorded_and_strict_stops_there():
    x, v, system = blocks()
    # At rest on the belt, held by more than slip would: both go on.
    start = {x: [-1.15] + [-1.13] * (N - 1), v: 0.2}
    runs = [solve(each, (0, 1), start) for each in (system, system._written_out())]
    assert runs[0].ambiguities and [a.kind for a in runs[0].ambiguities] == [
        a.kind for a in runs[1].ambiguities
    ]
    assert solve(system, (0, 1), start, strict=True).outcome is Outcome.AMBIGUITY


def test_what_needs_the_polynomials_of_lambda_has_them():
    x, v, system = blocks()
    start, wanted = {x: np.sin(np.arange(N)).tolist(), v: 0.2}, np.linspace(0, 5, 11)
    plain = solve(system, (0, 5), start, t_eval=wanted, rtol=1e-11)
    dense = solve(system, (0, 5), start, dense_output=True, rtol=1e-11)
    assert np.abs(dense(wanted, "lam_3") - plain["lam_3"]).max() < 1e-8
    kicks = Kicks(0.05, every=0.25, on=v, seed=3)
    ends = [solve(system, (0, 3), start, noise=kicks, dense_output=way).x[:, -1] for way in (False, True)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
    rows = solve(system, (0, 1), start, by=["u"])
    assert rows.derivatives is not None


def test_sweeps_take_such_families():
    x, v, system = blocks()
    start = {x: np.sin(np.arange(N)).tolist(), v: 0.2}
    found = sweep(system, {"u": [0.1, 0.2]}, x0=start, measures=["points", "extremes(lam_3)"], t_span=(0, 3))
    runs = [solve(system, (0, 3), start, parameters={"u": a}) for a in (0.1, 0.2)]
    assert np.allclose(found["x_1_points"].values[..., -1].ravel(), [run.x[0, -1] for run in runs], atol=1e-8)
    assert found["lam_3_max"].values.tolist() == pytest.approx([run["lam_3"].max() for run in runs], abs=1e-6)


def test_noise_on_one_element_is_that_on_it_written_out():
    x, v, system = blocks()
    start, noise = {x: np.sin(np.arange(N)).tolist(), v: 0.2}, Diffusion({"x_3": 0.05}, 1 / 64, seed=3)
    one, written = (solve(each, (0, 2), start, noise=noise) for each in (system, system._written_out()))
    assert itinerary(one) == itinerary(written) and "slip by fold" in {e.kind for e in one.events}
    assert np.array_equal(one.x, written.x) and np.array_equal(one.mult, written.mult)


def test_noise_tears_blocks_off_at_the_same_folds():
    x, v, system = blocks(12)
    start, noise = {x: np.sin(np.arange(12)).tolist(), v: 0.2}, Diffusion({x: 0.05}, 1 / 64, seed=3)
    looped, written = (solve(each, (0, 4), start, noise=noise) for each in (system, system._written_out()))
    assert len(looped.events) > 5 and itinerary(looped) == itinerary(written)
    # Near the fold steps go by sigma, or by lambda: they differ, and so do the paths by the error of their steps.
    assert np.abs(looped.x[:, -1] - written.x[:, -1]).max() < 1e-5
    assert max(abs(a.time - b.time) for a, b in zip(looped.events, written.events)) < 1e-4
