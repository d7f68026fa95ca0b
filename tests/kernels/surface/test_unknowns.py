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
