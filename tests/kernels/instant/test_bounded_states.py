"""Bounded states: a field that vanishes beyond a bound holds the state on it, and lets it go as smoothly.

Limited integrators, anti-windup and ideal diodes, each in the ways in which they are written; closed forms throughout.

Guards: kernels/instant/holding.py, kernels/instant/settling.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Family, Memory, System, solve

t, x, y, w, u, c, i, v, z, a = sp.symbols("t x y w u c i v z a", real=True)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


def limited(h, u):
    """The rate u of a state with h >= 0, in the ways in which it is written."""
    return {
        "or": sp.Piecewise((u, (h > 0) | (u > 0)), (0, True)),
        "and not": sp.Piecewise((0, (h <= 0) & (u < 0)), (u, True)),
        "nested": sp.Piecewise((sp.Piecewise((u, u > 0), (0, True)), h <= 0), (u, True)),
        "maximum": sp.Piecewise((u, h > 0), (sp.Max(u, 0), True)),
        "heaviside": sp.Max(u, 0) + sp.Min(u, 0) * sp.Heaviside(h),
    }


WAYS = pytest.mark.parametrize("way", limited(x, u))


@METHODS
@WAYS
def test_a_limited_integrator_rests_at_its_limit_and_leaves_it(method, way):
    # sin t to pi, at rest, and 1 + sin t from 3 pi/2; the limit at `a`, of either sign
    for sign in (1, -1):
        rate = sign * limited(sign * (x - a), sign * u)[way]
        system = System({x: rate, u: sign * y, y: -sign * u}, parameters={a: 0})
        for limit in (0, 0.1):
            run = solve(system, (0, 7), [limit, sign, 0], parameters={a: limit}, method=method)
            assert run.success and run["x"][-1] == pytest.approx(limit + sign * (1 + np.sin(7)), abs=1e-7)
            assert not run.ambiguities


@METHODS
@WAYS
def test_a_limit_is_left_however_slowly_the_input_turns(method, way):
    for power, end in ((1, 4.5), (3, 81 / 4)):
        run = solve(System({x: limited(x, (t - 2) ** power)[way]}, time=t), (0, 5), {x: 0.5}, method=method)
        assert run.success and run["x"][-1] == pytest.approx(end, abs=1e-7)


@WAYS
def test_a_start_on_the_limit_goes_where_the_input_does(way):
    system = System({x: limited(x, t - a)[way]}, time=t, parameters={a: 0})
    for release in (0, 1, -1):
        end = (2 - release) ** 2 / 2 - min(release, 0) ** 2 / 2
        assert solve(system, (0, 2), {x: 0}, parameters={a: release})["x"][-1] == pytest.approx(end, abs=1e-9)


@METHODS
def test_anti_windup_holds_at_both_limits(method):
    u = a * sp.cos(t)
    rate = sp.Piecewise((0, (x >= 1) & (u > 0)), (0, (x <= -1) & (u < 0)), (u, True))
    run = solve(
        System({x: rate}, time=t, parameters={a: 2}), (0, 9), {x: 0}, method=method, t_eval=[1, 4, 6, 9]
    )
    # at 1 up to pi/2, at -1 from pi to 3 pi/2, at 1 from 2 pi to 5 pi/2
    assert run["x"] == pytest.approx([1, -1, 1 + 2 * np.sin(6), 2 * np.sin(9) - 1], abs=1e-8)


@METHODS
@WAYS
def test_an_ideal_diode_conducts_from_where_its_voltage_turns(method, way):
    # i' = 2 (sin t - i) from i = 0: a half wave that ends later than the voltage, the same in every period
    rate = limited(i, 2 * (sp.sin(t) - i))[way]
    run = solve(
        System({i: rate}, time=t), (0, 20), {i: 0}, method=method, t_eval=[2, 2 + 2 * np.pi, 2 + 4 * np.pi]
    )
    wave = (4 * np.sin(2) - 2 * np.cos(2) + 2 * np.exp(-4)) / 5
    assert run["i"] == pytest.approx([wave] * 3, abs=1e-8)


@pytest.mark.parametrize("blocked", [0, sp.Max(0, 5 - v)])
def test_a_boost_converter_in_discontinuous_conduction(blocked):
    on = Memory("on", 1)
    slope = sp.Piecewise((1, on > 0.5), (5 - v, i > 0), (blocked, True))
    events = [Event(every=1, update={on: 1, c: 0}), Event(c - 0.3, direction=1, update={on: 0})]
    run = solve(System({i: slope, v: 0, z: i, c: 1}, events=events), (0, 10), {i: 0, v: 6, z: 0, c: 0})
    assert run["z"][-1] == pytest.approx(0.9, abs=1e-9)  # ten triangles of height and half-width 0.3


def test_derivatives_go_through_a_limit():
    # from the limit x = b on: b + a (1 + sin t)
    b = sp.Symbol("b", real=True)
    rate = limited(x - b, a * u)["maximum"]
    system = System({x: rate, u: y, y: -u}, parameters={a: 2, b: 0.1})
    run = solve(system, (0, 7), [0.3, 1, 0], by=[a, b, x])
    assert run.derivatives.x[0][:, -1] == pytest.approx([1 + np.sin(7), 1, 0], abs=1e-7)


def test_members_of_a_family_have_limits_of_their_own():
    family = Family(12)
    x, u, y = family.symbols("x u y")
    system = System({x: limited(x, u)["or"], u: y, y: -u})
    phases = np.linspace(0, 1, 12)
    run = solve(system, (0, 7), {x: 0, u: np.cos(phases), y: -np.sin(phases)})
    assert run.x[:12, -1] == pytest.approx(1 + np.sin(7 + phases), abs=1e-7)
