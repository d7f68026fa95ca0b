"""Steps see what their events depend on: surfaces with their own series, functions flat where a step begins.

Guards: kernels/step/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_ivp
from scipy.special import erf

from pwsmooth import Event, Family, System, solve

v, x = sp.symbols("v x", real=True)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_surface_that_varies_where_the_state_is_a_straight_line_is_met_at_every_zero(rtol):
    # v = t: the state alone would allow one step. sin(20 t) = 1/2 at (pi/6 + 2 k pi)/20 and (5 pi/6 + 2 k pi)/20.
    system = System({v: 1}, events=[Event(sp.sin(20 * v) - sp.Rational(1, 2))])
    solution = solve(system, (0, 3), {v: 0}, rtol=rtol)
    turns = 2 * math.pi * np.arange(10)
    expected = np.sort(np.concatenate([math.pi / 6 + turns, 5 * math.pi / 6 + turns])) / 20
    # The surface's slope there is 20 cos(pi/6) = 17; its error is rtol of its size within a step, at most some 20.
    assert solution.event_times() == pytest.approx(expected[expected < 3], abs=max(2 * rtol, 1e-12))


@pytest.mark.parametrize("order", [12, 20, 28])
@pytest.mark.parametrize("peak", [sp.exp(-((10 * v) ** 2)), 1 - sp.erf(10 * v)])
def test_a_peak_near_standstill_is_not_stepped_over_from_afar(order, peak):
    # At v = 10 = 100 v_s the peak and all its derivatives are 0 to rounding: no coefficient tells of it.
    rate = 1 + 9 * peak
    solution = solve(System({v: -rate}, events=[Event(v, terminal=True)]), (0, 20), {v: 10}, order=order)
    inverse = sp.lambdify(v, 1 / rate, "math")
    time = sum(quad(inverse, a, b, epsabs=1e-13, epsrel=1e-13)[0] for a, b in ((0, 0.1), (0.1, 0.5), (0.5, 10)))
    # rtol * v = 1e-8 in v at the speed 1 before the peak
    assert solution.event_times() == pytest.approx([time], abs=1e-8)


PULSES = {
    "tanh": lambda u: sp.tanh(u) ** 2,
    "exp": lambda u: sp.exp(-(u**2)),
    "power": lambda u: sp.Rational(1, 10) ** (u**2),
    "erf": lambda u: sp.erf(u) ** 2,
    "cosh": lambda u: 1 / sp.cosh(u),
}


@pytest.mark.parametrize("width", [1e-2, 0.1, 1.0])
@pytest.mark.parametrize("pulse", PULSES.values(), ids=PULSES)
def test_a_pulse_is_not_stepped_over_to_where_the_field_is_as_before(pulse, width):
    at = [-5 * width, -width, width, 5 * width]
    area = quad(sp.lambdify(v, pulse(v / width)), -1, 2, points=at, epsabs=1e-13, epsrel=1e-13, limit=300)[0]
    solution = solve(System({v: 1, x: pulse(v / width)}), (0, 3), [-1, 0])
    assert solution["x"][-1] == pytest.approx(area, abs=2e-9)


t = sp.Symbol("t", real=True)
GAPS = {
    "t**4": (1 / (1 + t**4) - x / 4, 0.3),
    "t**12": (1 / (1 + t**12) - x / 4, 0.3),
    "asinh(t**2)": (sp.atan(sp.asinh(t**2)) + sp.cos(t) - x / 4, -0.8),
    "atan(t**3)": (sp.atan(t**3), 1.0),
    "x**4": (1 / (1 + x**4), 0.0),
    "cos(t**4)": (sp.cos(t**4) / 2, 0.0),
    "root": (sp.sqrt(x) / (1 + t**4), 0.3),
    "power": (sp.Pow(1 + x, sp.Rational(3, 2)) / (8 + t**12), 0.3),
    "product": (t**3 * sp.cos(x) ** 2, 0.0),
}


@pytest.mark.parametrize("order", [12, 13, 14, 15, None])
@pytest.mark.parametrize("rate, start", GAPS.values(), ids=GAPS)
def test_a_series_without_its_last_orders_is_not_believed_beyond_its_radius(rate, start, order):
    f = sp.lambdify((t, x), [rate])
    expected = solve_ivp(f, (0, 2.5), [start], method="DOP853", rtol=1e-13, atol=1e-14).y[0, -1]
    solution = solve(System({x: rate}, time=t), (0, 2.5), [start], order=order)
    # Some 15 steps of 1e-9 each, which the rates amplify by less than e.
    assert solution["x"][-1] == pytest.approx(expected, abs=4e-8)


@pytest.mark.parametrize("rtol", [4e-8, 1e-10, 1e-12])
def test_a_dip_of_a_flat_function_whose_argument_turns_back_before_0_is_met(rtol):
    # Far from the dips the rate is 1 to rounding, and x a line: nothing but the argument limits a step.
    inner = (x + sp.sin(t) + x**2) * sp.cos(x * sp.sin(t))
    rate = sp.tanh(sp.sqrt(1 + inner**2))
    f = sp.lambdify((t, x), [rate])
    span = (0, 4.329701016603277)
    reference = solve_ivp(f, span, [1.13296605], method="DOP853", rtol=1e-13, atol=1e-14, max_step=1e-2)
    solution = solve(System({x: rate}, time=t), span, [1.13296605], rtol=rtol)
    # Errors of some 50 steps; the dips multiply them by less than 2.
    assert solution["x"][-1] == pytest.approx(reference.y[0, -1], abs=1e-11 + 100 * rtol)


@pytest.mark.parametrize("order", [12, 20, 24, None])
@pytest.mark.parametrize("span", [1e9, 1e12, 1e14])
def test_straight_lines_over_long_spans_end_where_they_should(order, span):
    solution = solve(System({x: v, v: 0}, events=[Event(x - span / 3)]), (0, span), [0, 1], order=order)
    assert solution.success
    assert solution["x"][-1] == pytest.approx(span, rel=1e-12)
    assert solution.event_times() == pytest.approx([span / 3], rel=1e-12)


@pytest.mark.parametrize("of_neighbours", [False, True])
def test_the_pulses_of_a_family_are_seen_by_each_element(of_neighbours):
    ring = Family(10, periodic=True)
    z, area = ring.symbols("z area")
    (w,) = ring.symbols("w", positive=True)
    (u,) = ring.symbols("u")
    # u is the argument itself, of the element or of its neighbour.
    argument = ring.neighbour(u, 1) if of_neighbours else u
    system = System({z: 1, u: -2 * w**2 * z, area: sp.exp(argument)}, parameters={w: 1})
    begin, width = -1 - np.arange(10) / 100, 10.0 * np.arange(1, 11)
    start = {z: begin, u: -((width * begin) ** 2), area: 0}
    solution = solve(system, (0, 3), start, parameters={w: width})
    if of_neighbours:
        begin, width = np.roll(begin, -1), np.roll(width, -1)
    expected = math.sqrt(math.pi) / (2 * width) * (erf(width * (begin + 3)) - erf(width * begin))
    assert [solution[f"area_{k + 1}"][-1] for k in range(10)] == pytest.approx(expected, abs=1e-9)
