"""Surfaces that are no coordinate: steep, of time alone, resting at zero, or jumping with another switch.

Guards: kernels/surface/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Algebraic, Event, Family, Memory, Switch, System, solve
from pwsmooth.laws.friction import MultistateXKY
from pwsmooth.scenes import prescribed_motion
from pwsmooth.scenes import t as drive_time

t, e, f, v, x = sp.symbols("t e f v x", real=True)


def test_an_event_surface_steeper_than_the_states_is_met_where_it_vanishes():
    # x = sin t - 9/10, and exp(-16 x^2) = 1/3 at |x| = sqrt(ln 3)/4
    event = Event(sp.exp(-((4 * x) ** 2)) - sp.Rational(1, 3), name="bell")
    solution = solve(System({x: sp.cos(t)}, time=t, events=[event]), (0, 10), {x: -0.9})
    inner = math.asin(0.9 - math.sqrt(math.log(3)) / 4)  # sin t would exceed 1 at the outer edge
    expected = [inner, math.pi - inner, 2 * math.pi + inner, 3 * math.pi - inner]
    assert solution.event_times() == pytest.approx(expected, abs=10 * 1e-9)


def test_a_switch_of_a_steep_function_crosses_where_it_vanishes():
    system = System({x: sp.cos(t), f: sp.sign(sp.tanh(20 * x) - sp.Rational(1, 2))}, time=t)
    solution = solve(system, (0, 10), {x: 0, f: 0}, rtol=1e-11)
    first = math.asin(math.atanh(0.5) / 20)
    expected = [first, math.pi - first, 2 * math.pi + first, 3 * math.pi - first]
    assert solution.event_times("crossing") == pytest.approx(expected, abs=1e-9)


def test_a_block_pulled_from_rest_breaks_away_once():
    # sticks until 2 e = 1 at t = 5; then v = 0.1 (1 - cos sqrt2 (t - 5)), which touches 0 and never sticks again
    block = System({e: sp.Rational(1, 10) - v, v: 2 * e - Switch("lam", v)})
    solution = solve(block, (0, 12), {e: 0, v: 0})
    assert [record.kind for record in solution.events if record.kind != "crossing"] == ["slip by tangency"]
    assert solution.events[0].time == pytest.approx(5, abs=1e-9)
    assert solution["v"][-1] == pytest.approx(0.1 * (1 - math.cos(math.sqrt(2) * 7)), abs=1e-8)


def saturating(n, gains):
    """f' = k v while |f| < 1 in the direction of v, at rest beyond: its surface stays at zero after it is met."""
    elements = Family(n)
    force, k = elements.symbols("f k")
    speed = 10 * sp.cos(2 * sp.pi * t)
    rate = k * speed * sp.Heaviside(1 - force * sp.sign(speed))
    return System({force: rate}, time=t, parameters={k: gains})


@pytest.mark.parametrize("gains", [[1.0], [1.0, 1.3, 1.9]])
def test_saturating_integrators_rest_at_their_bounds_and_leave_them_at_the_reversal(gains):
    solution = solve(saturating(len(gains), gains), (0, 1.25), {"f": 0})
    assert solution.success
    # from f = 1 at t = 1/4 (v = 0) the swing 2 k 10/(2 pi) > 2 reaches -1 at t = 3/4 and 1 again at 5/4
    assert solution.x[:, -1] == pytest.approx(np.ones(len(gains)), abs=1e-9)
    reached = [math.asin(2 * math.pi / 10 / gain) / (2 * math.pi) for gain in gains]
    assert sorted(solution.event_times("stick")[: len(gains)]) == pytest.approx(sorted(reached), abs=1e-9)


def test_an_event_on_a_surface_that_jumps_with_a_switch_fires_once():
    stuck = Memory("stuck", 1)
    speed = sp.Piecewise((1, t < sp.Rational(9, 10)), (-1, True))
    held = sp.Rational(1, 5) * sp.sign(f) * (1 - sp.Float(2) ** -40)
    system = System(
        {f: sp.Piecewise((speed, sp.Eq(stuck, 1)), (0, True))},
        time=t,
        events=[
            Event(stuck * (f / 0.2) ** 2 - 1, direction=1, update={stuck: 0}, name="slip"),
            Event(speed, update={stuck: 1, f: held}, when=sp.Eq(stuck, 0), name="stick"),
        ],
    )
    solution = solve(system, (0, 2), {f: 0})
    assert solution.success
    fired = [(record.switch, round(record.time, 9)) for record in solution.events if record.kind == "reset"]
    assert fired == [("slip", 0.2), ("stick", 0.9), ("slip", 1.3)]
    assert solution["f"][-1] == pytest.approx(-0.2, abs=1e-9)


def test_a_stribeck_curve_is_seen_although_it_is_flat_from_afar():
    # v' = -1 - exp(-(v/w)^2)/2 from 1: the stop is at the integral of dv/(1 + exp(-(v/w)^2)/2)
    w = 1e-3
    rates = {v: -Switch("lam", v) * (1 + sp.exp(-((v / w) ** 2)) / 2)}
    solution = solve(System(rates), (0, 2), {v: 1.0})
    u, weight = np.polynomial.legendre.leggauss(60)
    u, weight = 4 * (u + 1), 4 * weight  # to v = 8 w; beyond, the exponential is below 1e-27
    stop = 1 - w * np.sum(weight * np.exp(-(u**2)) / 2 / (1 + np.exp(-(u**2)) / 2))
    assert solution.event_times("stick") == pytest.approx([stop], abs=10 * 1e-9)


def test_a_surface_that_tends_to_zero_by_nature_does_not_stop_the_run():
    # At a reversal the surfaces of the saturated elements are of the size sigma v -> 0, all ten at one instant.
    stiffness = tuple(2.5e5 / i for i in range(1, 11))
    law = MultistateXKY(F_s=1.5, v_s=1e-3, kappa=stiffness, share=(0.1,) * 10, sigma=300.0, sigma2=0.4)
    motion = 5e-6 * sp.sin(2 * sp.pi * drive_time / 10)
    solution = prescribed_motion(law, position=motion, t_span=(0, 8)).solve(max_steps=20_000)
    assert solution.success


def test_a_surface_that_is_an_algebraic_unknown_is_left_with_a_slope():
    # a + sgn(a)/2 = 1 - t: a = 1/2 - t, at rest on a = 0 while |1 - t| <= 1/2, then a = 3/2 - t
    a = sp.Symbol("a", real=True)
    law = Algebraic(a, a + Switch("lam", a) / 2 - (1 - t))
    solution = solve(System({v: a}, time=t, algebraic=[law]), (0, 2), {v: 0})
    assert [event.kind for event in solution.events] == ["stick", "slip by tangency"]
    assert solution.event_times() == pytest.approx([0.5, 1.5], abs=1e-9)
    # v: 1/8 until t = 1/2, constant, then -1/8 from 3/2 to 2
    assert solution["v"][-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_no_state_is_moved_for_a_surface_that_time_alone_carries(method):
    # At t = pi the surface x sin t = 0 has no gradient in x: no change of x brings its sign about.
    x, t = sp.symbols("x t", real=True)
    rate = sp.cos(t) - x / 4 + sp.Abs(sp.tanh(x * sp.sin(t))) ** sp.Rational(3, 2)
    solution = solve(System({x: rate}, time=t), (2, 4), [1.0], method=method)
    expected = solve_ivp(sp.lambdify((t, x), [rate]), (2, 4), [1.0], method="DOP853", rtol=1e-12, atol=1e-13)
    # At its kinks, where only a third derivative jumps, the reference is good to 1e-8.
    assert solution["x"][-1] == pytest.approx(expected.y[0, -1], abs=1e-7)
    assert len(solution.events) == 2
