"""An unknown holds its equation at every instant, or the run ends: no root, one that ends, and one of several."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Algebraic, Outcome, System, solve

t, x, v, a, k = sp.symbols("t x v a k", real=True)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


@METHODS
def test_a_wedge_that_jams_has_no_acceleration(method):
    """a + k + |k + 2a| sgn v: for v > 0 it is 2k + 3a >= k/2 where a >= -k/2, and -a > k/2 where a < -k/2."""
    wedge = System(
        {x: v, v: a}, algebraic=[Algebraic(a, a + k + sp.Abs(k + 2 * a) * sp.sign(v))], parameters={k: 1}
    )
    for unit in (1e-6, 1, 1e6):
        run = solve(wedge, (0, 0.5), {x: 0, v: 2}, parameters={k: unit}, method=method)
        assert run.outcome is Outcome.NO_ROOT and run.t[-1] == 0


@METHODS
@pytest.mark.parametrize("left", [a + 2 * sp.Abs(a), sp.Abs(a), a * sp.Abs(a - 1)])
def test_a_root_that_ends_on_a_kink_ends_the_run(left, method):
    """left(a) = 1 - t has a least or greatest value on the branch that the run follows: 0, at t = 1."""
    run = solve(System({x: a}, time=t, algebraic=[Algebraic(a, left - 1 + t)]), (0, 3), {x: 0}, method=method)
    assert run.outcome is Outcome.NO_ROOT and run.t[-1] == pytest.approx(1, abs=1e-9)
    assert np.abs(sp.lambdify((a, t), left - 1 + t)(run["a"], run.t)).max() < 1e-9


@METHODS
def test_of_several_roots_one_is_taken_and_reported(method):
    """max(2a - 4, -a - 1) = -1 at a = 0 and at a = 3/2."""
    equation = sp.Max(2 * a - 4, -a - 1) + k
    rest = System({x: a}, algebraic=[Algebraic(a, equation)], parameters={k: 1})
    run = solve(rest, (0, 1), {x: 0}, method=method)
    ends = {0.0, 1.5}
    assert run.success and min(abs(run["x"][-1] - end) for end in ends) < 1e-9
    assert [found.kind for found in run.ambiguities] == ["several roots of an unknown"]


def test_one_root_is_not_reported():
    rest = System({x: a - x}, algebraic=[Algebraic(a, a + sp.Abs(a - x) / 2 - k)], parameters={k: 1})
    run = solve(rest, (0, 5), {x: 3})
    assert run.success and not len(run.ambiguities)
    assert np.abs(run["a"] + np.abs(run["a"] - run["x"]) / 2 - 1).max() < 1e-12


@METHODS
def test_a_condition_on_an_unknown_is_crossed_where_the_unknown_passes(method):
    """a follows x, which meets 3/4 + (3/4)^3/4 at x - 1/2 = 91/256; twice as fast from there on."""
    jump = sp.Piecewise((1, a > sp.Rational(3, 4)), (0, True))
    passed = System({x: 1 + jump}, algebraic=[Algebraic(a, a + a**3 / 4 - x)])
    run = solve(passed, (0, 2), {x: 0.5}, method=method)
    met = 91 / 256
    assert run.success and run["x"][-1] == pytest.approx(0.5 + met + 2 * (2 - met), abs=1e-8)


# x' = 1/2 - c, so that x is held where a is 3/4; what a follows, and x there.
SLIDES = pytest.mark.parametrize(
    ("equation", "held"), [(a - x, 0.75), (a + a**3 / 4 - x, 219 / 256), (2 * a + v - x, 1.5)]
)


@METHODS
@SLIDES
def test_a_switch_of_an_unknown_holds_the_states_that_the_unknown_follows(equation, held, method):
    jump = sp.Piecewise((1, a > sp.Rational(3, 4)), (0, True))
    held_so = System({x: sp.Rational(1, 2) - jump, v: 0}, algebraic=[Algebraic(a, equation)])
    run = solve(held_so, (0, 3), {x: 0.5, v: 0}, method=method)
    assert run.success and run["x"][-1] == pytest.approx(held, abs=1e-9)
    assert run["a"][-1] == pytest.approx(0.75, abs=1e-9)


@pytest.mark.parametrize(("m", "at", "shift", "start"), [(0.73, 0.08, -0.4, -0.15), (-0.73, 0.44, 0.05, -0.38)])
def test_a_switch_of_an_unknown_beside_coupled_ones_is_that_written_by_hand(m, at, shift, start):
    """a stands in one of two coupled equations and follows v alone; how the others move is no rounding of a."""
    mass = sp.Matrix([[2, m], [m, 2]])
    force = sp.Matrix([a / 2 - x, 1 - sp.sign(x + a / 2 - at)])
    pulled, unknown = {v: sp.cos(3 * t) - v}, [Algebraic(a, a - v - shift)]
    coupled = System(pulled, time=t, mass_matrix=mass, forcing=dict(zip((x, k), force)), algebraic=unknown)
    by_hand = System({**pulled, **dict(zip((x, k), (mass.inv() * force).subs(a, v + shift)))}, time=t)
    one, other = (solve(system, (0, 3), {v: 1, x: start, k: 0}) for system in (coupled, by_hand))
    assert one.success and one.x[:, -1] == pytest.approx(other.x[:, -1], abs=1e-8)
