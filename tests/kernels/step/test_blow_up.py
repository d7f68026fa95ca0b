"""Motions that go to infinity in finite time while they switch ever faster: no accumulation that could be passed."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Family, Outcome, System, Unilateral, solve

y, w, t = sp.symbols("y w t", real=True)


def reference(c, extra=lambda y, w: 0.0):
    """When y'' = -y^3 + c |y| w - extra has gone to infinity from (1, 0): in a time s of its own, dt = ds/rho."""

    def rates(s, q):
        rho = np.sqrt(q[0] ** 2 + abs(q[1]))
        return [q[1] / rho, (-(q[0] ** 3) + c * abs(q[0]) * q[1] - extra(*q[:2])) / rho, 1 / rho]

    return solve_ivp(rates, (0, 250 / c), [1.0, 0.0, 0.0], "DOP853", rtol=1e-11, atol=1e-13, max_step=0.5).y[
        2, -1
    ]


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("c", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("friction", [0, 0.001])
def test_a_spring_that_is_driven_ever_faster(c, friction, method):
    system = System({y: w, w: -(y**3) + c * sp.Abs(y) * w - friction * sp.sign(w)})
    found = solve(system, (0, 100), {y: 1, w: 0}, method=method)
    assert found.outcome is Outcome.STEP_UNDERFLOW
    assert "accumulation" not in {e.kind for e in found.events}
    assert abs(found.t[-1] - reference(c, lambda y, w: friction * np.sign(w))) < 1e-6


@pytest.mark.parametrize("restitution", [0.3, 0.9])
def test_a_ball_that_is_driven_to_its_wall_ever_faster(restitution):
    """What falls is pushed: it bounces ever faster, and lower where the wall takes more than the push gives."""
    wall = Unilateral(y, restitution=restitution)
    system = System({y: w, w: -(y**3) - y * sp.Max(-w, 0) + wall.reaction}, contacts=[wall])
    found = solve(system, (0, 100), {y: 1, w: 0}, max_steps=100_000)
    if restitution == 0.3:
        assert found.success and abs(found.x[:, -1]).max() < 0.1
        return
    assert found.outcome is Outcome.STEP_UNDERFLOW and found.x[1].max() > 1e15
    impacts = found.event_times("impact")[-3:]
    ratio = np.diff(impacts)[1] / np.diff(impacts)[0]
    assert abs(found.t[-1] - (impacts[-1] + np.diff(impacts)[1] * ratio / (1 - ratio))) < 1e-9


def test_a_chirp_of_constant_height_is_not_passed():
    """y = sin(log(1 - t)): its zeros accumulate at 1, where it has no limit."""
    system = System({y: w, w: (w - y / (1 - t)) / (1 - t) + sp.sign(y) / 10**9}, time=t)
    found = solve(system, (0, 2), {y: 0, w: -1})
    assert found.outcome is Outcome.STEP_UNDERFLOW and abs(found.t[-1] - 1) < 1e-6


def test_in_one_element_of_many():
    springs = Family(120)
    z, v, k = springs.symbols("z v k")
    c = np.full(120, -0.2)
    c[7] = 0.5
    system = System({z: v, v: -(z**3) + k * sp.Abs(z) * v}, parameters={k: list(c)})
    runs = [solve(system, (0, 20), {z: 1.0, v: 0.0}, t_eval=[0, 20], local=way) for way in (True, False)]
    for found in runs:
        assert found.outcome is Outcome.STEP_UNDERFLOW and abs(found.t[-1] - reference(0.5)) < 1e-6
