"""What a solution says at the instant of an event, inside a stick, and with numbers of more than 15 digits."""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Kicks, Switch, System, solve
from pwsmooth.definition.lambdified import numpy_function
from pwsmooth.laws.friction import Coulomb, StaticKinetic
from pwsmooth.scenes import friction_oscillator

t, x, y, v = sp.symbols("t x y v", real=True)
AT = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0])


def clocked(rate):
    return System({x: rate}, time=t, events=[Event(every=1.0, update={x: x + 1}, name="push")])


@pytest.mark.parametrize(
    "system",
    [clocked(-x), clocked(-x - sp.sign(x + 5) / 4), clocked(-sp.sign(x) - x).smoothed(eps=1e-2)],
    ids=["no switch", "switch", "smoothed"],
)
def test_at_an_event_every_form_of_a_solution_has_the_side_after_it(system):
    asked = solve(system, (0, 3), {x: 1.0}, t_eval=AT)
    dense = solve(system, (0, 3), {x: 1.0}, dense_output=True)
    last = [dense.x[0, np.flatnonzero(dense.t == instant)[-1]] for instant in (1.0, 2.0, 3.0)]
    assert asked.x[0, [2, 4, 5]].tolist() == last
    assert dense(AT[[2, 4, 5]], "x").tolist() == last
    # Elsewhere the two differ by the rounding of a polynomial, the smoothed one by its tolerance.
    assert np.abs(dense(AT, "x") - asked["x"]).max() < 1e-8
    before = np.array([dense.x[0, np.flatnonzero(dense.t == instant)[0]] for instant in (1.0, 2.0, 3.0)])
    assert np.allclose(np.array(last) - before, 1.0, rtol=0, atol=1e-15)


def test_a_located_event_has_its_side_after_too():
    ball = System({y: v, v: -1 + 0 * y}, events=[Event(y, direction=-1, update={v: -v / 2}, name="bounce")])
    at = solve(ball, (0, 2), {y: 0.5, v: 0}).event_times("reset")[0]
    assert at == pytest.approx(1.0, rel=1e-15)
    asked = solve(ball, (0, 2), {y: 0.5, v: 0}, t_eval=[at])
    assert asked["v"][0] == pytest.approx(0.5, rel=1e-14)
    assert solve(ball, (0, 2), {y: 0.5, v: 0}, dense_output=True)(at, "v") == asked["v"][0]


def test_a_multiplier_and_its_status_are_those_after_a_crossing():
    lam = Switch("lam", x - sp.Rational(1, 2))
    for rate, lams in ((1 - lam / 4, (1.0, 1)), (1 - 2 * lam, (0.5, 0))):
        asked = solve(
            System({x: rate}), (0, 1), {x: 0}, t_eval=solve(System({x: rate}), (0, 1), {x: 0}).event_times()
        )
        assert (asked["lam"][0], asked.status[0, 0]) == (pytest.approx(lams[0], rel=1e-15), lams[1])


def test_kicks_have_acted_at_their_instants():
    still = System({x: 0 * x})
    noise = Kicks(0.5, every=1, on=x, seed=3)
    at, beside = (solve(still, (0, 4), {x: 0}, noise=noise, t_eval=np.arange(4) + s)["x"] for s in (0.0, 0.5))
    assert np.array_equal(at, beside)


def test_a_stuck_velocity_is_zero_between_the_steps():
    scene = friction_oscillator(StaticKinetic(), amplitude=1.2)
    times = np.linspace(0, 60, 1001)
    asked, dense = scene.solve(t_eval=times), scene.solve(dense_output=True)
    stuck = asked.status[0] == 0
    assert stuck.sum() > 100
    assert not asked["v"][stuck].any() and not dense(times[stuck], "v").any()
    assert np.abs(asked["y"] - dense(times, "y")).max() < 1e-12


def test_numbers_keep_all_their_bits_in_outputs():
    third = 1 / 3
    assert sp.Float(third) != sp.Float(str(sp.Float(third)))  # 15 digits are not enough
    assert numpy_function(x, x * third)(1.0) == third
    assert numpy_function([x], sp.Tuple(third * sp.sin(x) ** 2, sp.sin(x) ** 2), cse=True)(1.0)[0] == (
        third * math.sin(1.0) ** 2
    )
    run = solve(System({x: 0 * x}, outputs={"o": third * x}), (0, 1), {x: 1})
    assert run["o"].tolist() == [third] * len(run.t)
    assert Coulomb(F_c=third).steady_force(1.0) == third
