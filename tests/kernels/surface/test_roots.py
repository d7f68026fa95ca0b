"""The first root of a step's polynomial on [0, 1]: complete, and to rounding.

Guards: kernels/step/roots.py.
"""

import ctypes

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Switch, System, solve
from pwsmooth.codegen.machine.units import unit_address
from pwsmooth.paths.problem import compiled_problem

NO_ROOT = 2.0


@pytest.fixture(scope="module")
def first_root():
    """coefficients, positive at 0 -> the first root; the compiled unit on its own scratch arrays."""
    x = sp.Symbol("x", real=True)
    problem = compiled_problem(System({x: -Switch("lam", x)}).model)
    unit = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_int64)(unit_address("root_unit"))
    searches = {order: problem.work(order).roots for order in range(7, 32)}

    def call(coefficients, expected=0.0):
        degree = len(coefficients) - 1
        roots = searches[degree]
        roots.poly[:] = 0
        roots.poly[: degree + 1] = coefficients
        roots.guess = expected
        return unit(roots.address, degree)

    return call


def padded(polynomial, degree):
    c = np.zeros(degree + 1)
    c[: len(polynomial.coef)] = polynomial.coef
    return c if c[0] > 0 else -c


def test_the_first_of_several_roots_is_found_also_of_a_close_pair(first_root):
    rng = np.random.default_rng(0)
    found = 0
    for trial in range(4000):
        degree = int(rng.integers(7, 21))
        roots = np.sort(rng.uniform(-1, 2, rng.integers(0, 5)))
        if trial % 3 == 0 and len(roots) > 1:
            # Closer pairs than 1e-6 dip below zero by less than GRAZING = 1e-12: recorded, and not decided.
            roots[1] = roots[0] + 10 ** rng.uniform(-5, -2)
        p = np.polynomial.Polynomial.fromroots(roots) if len(roots) else np.polynomial.Polynomial([1.0])
        while p.degree() + 2 <= degree:
            z = complex(rng.uniform(-2, 3), rng.uniform(0.05, 3))
            p = p * np.polynomial.Polynomial([abs(z) ** 2, -2 * z.real, 1]) / (1 + abs(z) ** 2)
        inside = roots[(roots > 0) & (roots <= 1)]
        expected = inside.min() if len(inside) else NO_ROOT
        found += len(inside) > 0
        # Coefficients carry 1e-16 of the largest value; a simple root beside another is that much less certain.
        assert first_root(padded(p, degree)) == pytest.approx(expected, abs=1e-7)
    assert found > 1500


def test_a_simple_root_is_found_to_rounding(first_root):
    rng = np.random.default_rng(1)
    checked = 0
    for _ in range(4000):
        degree, root = int(rng.integers(16, 21)), rng.uniform(0.05, 0.95)
        rest = np.r_[1, rng.normal(size=degree - 1) * 0.5 ** np.arange(1, degree) * rng.uniform(0, 1)]
        if np.polyval(rest[::-1], np.linspace(0, 1, 400)).min() < 0.05:
            continue  # another root, or nearly
        checked += 1
        assert abs(first_root(np.convolve([root, -1], rest)) - root) < 1e-13
    assert checked > 2000


@pytest.mark.parametrize("length", [1.0, 3.0, 6.0])
def test_the_first_zero_of_a_long_wave_is_found_wherever_it_is_expected(first_root, length):
    # cos(w s) - level over up to six radians: several zeros, none, shallow ones.
    rng = np.random.default_rng(int(length))
    k = np.arange(32)
    factorial = np.cumprod(np.r_[1.0, k[1:]])
    found = 0
    for _ in range(1500):
        phase, level = rng.uniform(-1.5, 1.5), rng.uniform(-1.1, 1.1)
        a = np.cos(phase + 0.5 * np.pi * k) * length**k / factorial
        a[0] -= level
        if a[0] <= 1e-3:
            continue
        zeros = [] if abs(level) >= 1 else [(sign * np.arccos(level) - phase) % (2 * np.pi) for sign in (1, -1)]
        inside = [z / length for z in zeros if z <= length]
        if abs(abs(level) - 1) < 1e-3 or any(abs(z - length) < 1e-6 for z in zeros):
            continue  # touching, or at the very end
        expected = min(inside, default=NO_ROOT)
        found += expected < NO_ROOT
        # The series of six radians is cut at 6^32/32! = 3e-11 of the amplitude, and its zero is as uncertain as
        # the slope there, sqrt(1 - level^2), tells.
        cut = max(length**32 / factorial[31] / 32, 1e-15) / np.sqrt(abs(1 - level**2)) * 4 + 1e-13
        for hint in (0.0, expected, rng.uniform(0, 1), 1e-9, 1 - 1e-9):
            assert first_root(a, hint) == pytest.approx(expected, abs=cut)
    assert found > 250


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_an_event_on_an_odd_power_is_located_as_its_base(method):
    # cos t changes its sign at pi/2 and 3 pi/2, with falling and rising powers.
    x, v = sp.symbols("x v", real=True)
    for surface, direction, times in (
        (x**7, 0, [0.5, 1.5]),
        (x**9, -1, [0.5]),
        (-3 * x**5 - 2 * x**7, 1, [0.5]),
        (x**3 * (1 + v**2), 1, [1.5]),
    ):
        zero = System({x: v, v: -x}, events=[Event(surface, direction=direction, name="zero")])
        run = solve(zero, (0, 6), {x: 1, v: 0}, method=method)
        np.testing.assert_allclose(run.event_times(switch="zero"), np.pi * np.array(times), atol=1e-8)
        assert not run.ambiguities
