"""method="auto" takes implicit steps where stiffness holds explicit ones short, and nowhere else.

Guards: paths/stiffness.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import System, solve
from pwsmooth.laws import friction
from pwsmooth.paths import stiff_events, stiffness
from pwsmooth.scenes import block_on_belt, block_train, friction_oscillator

t, x, v, z = sp.symbols("t x v z", real=True)
STIFF = (
    "BlimanSorine", "BlimanSorineFirst", "BoucWen", "Dahl", "Elastoplastic", "ElastoplasticFixed", "LuGre",
    "LuGreFadingDamping", "ModifiedDahl",
)  # fmt: skip


@pytest.fixture
def no_implicit_steps(monkeypatch):
    def never(*args):
        raise AssertionError("implicit steps are made")

    monkeypatch.setattr(stiff_events, "switched_by_events", never)


def same(one, other):
    return one.outcome == other.outcome and np.array_equal(one.t, other.t) and np.array_equal(one.x, other.x)


@pytest.mark.parametrize("name", STIFF)
def test_a_bristle_law_at_its_defaults_runs_by_implicit_steps(name):
    scene = friction_oscillator(getattr(friction, name)())
    run = scene.solve(max_steps=200_000)
    assert run.success and run.tolerances["method"] == "stiff"
    assert same(run, scene.solve(method="stiff"))


def test_both_kinds_of_steps_give_one_motion():
    scene = friction_oscillator(friction.LuGre())
    by = {method: scene.solve((0, 3), method=method) for method in ("taylor", "auto")}
    assert (
        by["auto"].tolerances["method"] == "stiff"
        and by["auto"].cost["steps"] * 50 < by["taylor"].cost["steps"]
    )
    # y and v are of size 1, z of size 1e-5; rtol is 1e-9 a step, of which some hundred are implicit.
    assert (np.abs(by["auto"].x[:, -1] - by["taylor"].x[:, -1]) < [1e-7, 1e-7, 1e-12]).all()
    assert [e.switch for e in by["auto"].events] == [e.switch for e in by["taylor"].events]


def test_the_choice_is_the_same_with_wanted_times_and_dense_output():
    scene = block_on_belt(friction.LuGre())
    plain, dense = scene.solve(), scene.solve(dense_output=True)
    wanted = scene.solve(t_eval=[1.0, 20.0])
    assert {run.tolerances["method"] for run in (plain, dense, wanted)} == {"stiff"}
    assert np.array_equal(plain.x, dense.x) and wanted.t.tolist() == [1.0, 20.0]
    np.testing.assert_allclose(dense(wanted.t), wanted.x, atol=1e-9)


def test_a_system_of_ones_own_is_looked_at_too():
    bristle = v - 1e5 * sp.Abs(v) * z
    own = System({x: v, v: sp.cos(t) - x - 1e5 * z - 300 * bristle, z: bristle}, time=t)
    assert solve(own, (0, 20), {x: 0.5, v: 0.3, z: 0}).tolerances["method"] == "stiff"


def test_what_stops_by_explicit_steps_is_run_by_implicit_ones_after_all():
    # Its first 10 000 steps are those of the start, which is no easier for implicit ones.
    scene = block_on_belt(friction.BlimanSorine())
    assert "method" not in scene.solve().tolerances
    run = scene.solve((0, 150), max_steps=100_000)
    assert run.success and run.tolerances["method"] == "stiff"


def test_a_family_of_stiff_bristles_is_run_by_implicit_steps():
    scene = block_train(friction.LuGre(sigma0=1e6, sigma1=1e3, v_s=0.05), n=6, t_span=(0, 3))
    run = scene.solve()
    assert run.tolerances["method"] == "stiff" and same(run, scene.solve(method="stiff"))


@pytest.mark.parametrize(
    "rates, start, end",
    [
        ({x: v, v: -x}, {x: 1, v: 0}, 2e5),  # steps of a radian
        ({x: v, v: -x - sp.Abs(v) * v / 100 + sp.sin(2 * t)}, {x: 1, v: 0}, 3e4),  # crosses all the time
        ({x: v, v: -sp.sign(x)}, {x: 1, v: 0}, 3e4),  # an event for each step
    ],
)
def test_what_is_long_and_not_stiff_keeps_its_steps(rates, start, end, no_implicit_steps):
    system = System(rates, time=t)
    run = solve(system, (0, end), start)
    assert run.cost["steps"] > stiffness.LOOK and same(run, solve(system, (0, end), start, method="taylor"))


def test_a_run_of_few_steps_is_not_looked_at(no_implicit_steps):
    for law in (friction.MultistateXKY(), friction.MaxwellSlip(), friction.Dahl(sigma0=20.0)):
        scene = friction_oscillator(law)
        assert same(scene.solve(), scene.solve(method="taylor"))
    scene = friction_oscillator(friction.LuGre())
    assert same(scene.solve(max_steps=5000), scene.solve(max_steps=5000, method="taylor"))


def test_what_can_slide_keeps_explicit_steps_however_stiff(no_implicit_steps):
    system = System({x: -1e4 * (x - sp.cos(t)), v: sp.sin(t) - 2 * sp.sign(v)}, time=t)
    run = solve(system, (0, 20), {x: 1, v: 1}, max_steps=30_000)
    assert run.cost["steps"] > stiffness.LOOK and "method" not in run.tolerances


def test_explicit_steps_that_are_asked_for_are_made():
    run = friction_oscillator(friction.LuGre()).solve(method="taylor", max_steps=20_000)
    assert run.outcome.name == "TOO_MANY_STEPS"
    for options in ({"order": 20}, {"strict": True}):
        other = friction_oscillator(friction.LuGre()).solve(max_steps=20_000, **options)
        assert other.outcome.name == "TOO_MANY_STEPS"
