"""Sticks that begin where friction has to give all that it can: what comes next is told by the next order in time."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Switch, System, solve

t, x = sp.symbols("t x", real=True)
lam = Switch("lam", x)


@pytest.mark.parametrize("force", [sp.cos(t), 1 - t, 1 - t**2, 1 - t**3, -sp.cos(t), t**2 - 1])
@pytest.mark.parametrize("method", ["auto", "rk"])
def test_a_force_that_falls_from_the_largest_is_held(force, method):
    run = solve(System({x: force - lam}, time=t), (0, 1), {x: 0}, method=method, rtol=1e-10)
    assert run.success and not run.events and np.all(run["x"] == 0)
    assert run["lam"][-1] == pytest.approx(float(force.subs(t, 1)), abs=1e-9)


@pytest.mark.parametrize("force", [1 + t, 1 + t**2, 1 + t**3, 1 + t**4, sp.exp(t)])
def test_a_force_that_rises_from_the_largest_is_not(force):
    run = solve(System({x: force - lam}, time=t), (0, 1), {x: 0}, rtol=1e-12, atol=1e-14)
    assert run["x"][-1] == pytest.approx(float(sp.integrate(force - 1, (t, 0, 1))), abs=1e-11)


def test_a_force_that_comes_back_is_left_to_where_it_exceeds_the_largest_again():
    run = solve(System({x: 1 - t**2 + 2 * t**3 - lam}, time=t), (0, 1), {x: 0}, rtol=1e-12, atol=1e-14)
    assert run.event_times("slip") == pytest.approx([0.5], abs=1e-12)
    assert run["x"][-1] == pytest.approx(1 / 6 + 1 / 96, abs=1e-12)


def test_random_forces_that_begin_at_the_largest_are_held_or_not_as_their_polynomials_say():
    """The first order that is not 0 decides; the slip that follows is the integral of the polynomial."""
    orders = sp.symbols("c1:5", real=True)
    block = System({x: 1 + sum(c * t ** (k + 1) for k, c in enumerate(orders)) - lam}, time=t,
                   parameters=dict.fromkeys(orders, 0))  # fmt: skip
    random = np.random.default_rng(3)
    for leading in (1, 2, 3, 4) * 10:
        rising = random.random() < 0.5
        values = np.zeros(4)
        values[leading - 1 :] = (1 if rising else -1) * random.uniform(0.1, 0.3, 5 - leading)
        run = solve(block, (0, 1), {x: 0}, parameters=dict(zip(orders, values)), rtol=1e-12, atol=1e-14)
        exact = values @ [1 / 2, 1 / 3, 1 / 4, 1 / 5] if rising else 0.0
        assert run["x"][-1] == pytest.approx(exact, abs=1e-12), values
