"""Jets of linear models as matrix products (responses.py): the series of the recurrence, for any parameters.

Guards: codegen/taylor/responses.py.
"""

import ctypes

import friction_oscillator as oscillator
import mpmath
import numpy as np
import pytest
import sympy as sp
from reference.coulomb_oscillator import trajectory

from pwsmooth import Strobe, Switch, System, solve, sweep
from pwsmooth.codegen import compile_model

t, x, y, v, lam = sp.symbols("t x y v lam", real=True)
k, c, N, sigma, omega = oscillator.k, oscillator.c, oscillator.N, oscillator.sigma, oscillator.omega


class Program:
    """One of a model's programs on one block of rows, as a run holds it."""

    def __init__(self, system, order, general):
        self.code = compile_model(system.model)
        self.general = general
        self.count, own = self.code.nrows_general if general else self.code.nrows_slip
        self.rows = np.zeros((self.count + own, -(-(order + 1) // 8) * 8 + 8))
        self.order = order

    def __call__(self, t0, start, mult, p):
        inputs = [np.array([*q, 0.0], float) for q in (start, mult, p)]
        if self.general:
            inputs.append(np.ones(len(mult) + 1, np.int64))
        address = self.code.jet_general if self.general else self.code.jet_slip
        kinds = [
            ctypes.c_double,
            *[ctypes.c_void_p] * len(inputs),
            ctypes.c_int64,
            ctypes.c_int64,
            ctypes.c_void_p,
            ctypes.c_int64,
        ]
        call = ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)(address)
        stride, own = self.rows.shape[1], self.count * self.rows.shape[1]
        code = call(t0, *(q.ctypes.data for q in inputs), self.order, stride, self.rows.ctypes.data, own)
        return code, self.rows[: self.count, : self.order + 1].copy()


def slip_series(t0, start, side, values, order):
    """Taylor coefficients of y and v of the slipping oscillator by the recurrence, and with all its terms > 0."""
    stiffness, damping, load, drive, frequency = values
    found = []
    for majorant in (False, True):
        with mpmath.workdps(40):
            ys, vs = [mpmath.mpf(start[0])], [mpmath.mpf(start[1])]
            if majorant:
                ys, vs = [abs(ys[0])], [abs(vs[0])]
            for n in range(order):
                wave = 1 if majorant else -mpmath.sin(mpmath.mpf(frequency) * t0 + n * mpmath.pi / 2)
                others = (
                    stiffness * ys[n] + damping * vs[n] + (load * (1 if majorant else side) if n == 0 else 0)
                )
                force = drive * mpmath.mpf(frequency) ** n / mpmath.factorial(n) * wave
                ys.append(vs[n] / (n + 1))
                vs.append((force + others if majorant else force - others) / (n + 1))
            found.append(np.array([[float(q) for q in row] for row in (ys, vs)]))
    return found


@pytest.mark.parametrize("order", [20, 31])
def test_slip_rows_are_the_series_whatever_parameters_came_before(order):
    program = Program(oscillator.coulomb(), order, False)
    assert program.code.by_responses
    rng = np.random.default_rng(order)
    names = [q.name for q in compile_model(oscillator.coulomb().model).model.parameters]
    for trial in range(12):
        values = dict(zip(("k", "c", "N", "sigma", "omega"), rng.uniform(0.1, 3, 5)))
        if trial == 7:
            # A start that is not finite leaves no trace in what comes after it.
            code, rows = program(0.3, (np.inf, 0.0), (1.0,), [values[q] for q in names])
            assert not np.isfinite(rows[:2, 1:]).all()
        for t0 in rng.uniform(0, 10, 2):
            start, side = rng.normal(size=2), 1.0 if trial % 2 else -1.0
            code, rows = program(t0, start, (side,), [values[q] for q in names])
            expected, majorant = slip_series(t0, start, side, values.values(), order)
            # A term is a sum of responses, each with roundings, and omega t0 <= 30 is known to 30 eps.
            assert code == 0 and np.all(np.abs(rows[:2] - expected) <= 64 * 2.3e-16 * majorant)


def test_a_stick_s_multiplier_is_the_force_s_series():
    program = Program(oscillator.coulomb(), 31, True)
    names = [q.name for q in program.code.model.parameters]
    values = dict(k=3.1, c=0.1, N=1.0, sigma=1.2, omega=1.3)
    for t0 in (0.2, 1.7):
        start = (0.1, 0.0)
        lam0 = (-1.2 * np.sin(1.3 * t0) - 0.31) / 1.0
        code, rows = program(t0, start, (lam0,), [values[q] for q in names])
        with mpmath.workdps(40):
            series = mpmath.taylor(lambda s: -mpmath.mpf("1.2") * mpmath.sin(mpmath.mpf("1.3") * s), t0, 31)
        assert code == 0 and np.all(rows[:2, 1:] == 0.0)
        np.testing.assert_allclose(rows[2, 1:], [float(q) for q in series[1:]], rtol=1e-13, atol=1e-30)


@pytest.mark.parametrize(
    "rate", [-x * y, -x + sp.sin(x), -x * t, sp.exp(-(t**2)), -x / (2 + sp.sin(t)), -x + lam * x]
)
def test_a_coefficient_that_moves_is_left_to_the_recurrence(rate):
    system = System({x: rate.subs(lam, Switch("lam", y)), y: -y - Switch("lam", y)}, time=t)
    assert not compile_model(system.model).by_responses


def test_two_switches_stick_each_with_its_own_responses():
    # Two masses between springs: slip and stick in all four combinations, against the same system by Runge-Kutta.
    x1, x2, v1, v2 = sp.symbols("x1 x2 v1 v2", real=True)
    a, b = Switch("a", v1), Switch("b", v2)
    system = System(
        {
            x1: v1,
            x2: v2,
            v1: -2 * x1 + x2 - 0.7 * a + sp.sin(t),
            v2: x1 - 2 * x2 - 0.6 * b + sp.Rational(1, 2) * sp.cos(1.3 * t),
        },
        time=t,
    )
    assert compile_model(system.model).by_responses
    start = {x1: 0.3, x2: -0.2, v1: 0.0, v2: 0.1}
    taylor = solve(system, (0, 30), start, rtol=1e-9)
    pair = solve(system, (0, 30), start, rtol=1e-10, atol=1e-12, method="rk")
    kinds = {tuple(column) for column in np.sign(np.round(taylor.status.T)).tolist()}
    assert len({tuple(q == 0 for q in kind) for kind in kinds}) == 4
    assert [(e.switch, e.kind) for e in taylor.events] == [(e.switch, e.kind) for e in pair.events]
    # Near-tangential exits make the square root of a rounding; the events here are none.
    np.testing.assert_allclose([e.time for e in taylor.events], [e.time for e in pair.events], atol=1e-8)


def test_an_oscillator_goes_from_event_to_event_in_a_step():
    for value, events in ((2.4, 2), (1.2, 4)):
        solution = solve(oscillator.coulomb(sigma=value), (0, 200 * np.pi), {y: 0.5, v: 0.3}, rtol=1e-9)
        assert solution.tolerances["order"] == 31
        # A step more where the approach to the orbit changes the intervals.
        assert solution.cost["steps"] <= 100 * events + 15


def test_long_steps_at_loose_tolerances_keep_the_events():
    values = dict(k=3.1, c=0.1, N=1.0, sigma=1.2, omega=1.0)
    times, kinds = np.empty(5000), np.empty(5000, np.int64)
    end = 100 * np.pi
    count, y_end, v_end = trajectory(3.1, 1.2, 0.1, 1.0, 1.0, 1.0, 1.0, 0.0, 0.5, 0.3, end, times, kinds)
    for rtol in (1e-6, 1e-8, 1e-10):
        solution = solve(oscillator.coulomb(**values), (0, end), {y: 0.5, v: 0.3}, rtol=rtol)
        assert len(solution.events) == count
        # Measured 1e-12: the steps could be longer than the events let them be.
        np.testing.assert_allclose([e.time for e in solution.events], times[:count], atol=rtol, rtol=0)


def test_parameters_that_change_from_orbit_to_orbit_have_their_own_responses():
    system = oscillator.coulomb()
    points = {"k": [1.6, 3.1, 1.6, 3.1, 1.6], "sigma": [1.2, 1.2, 2.4, 2.4, 1.2]}
    start = {y: 0.5, v: 0.3}
    options = dict(seen=Strobe(2 * sp.pi), transient=0, periods=5, measures=["points"])
    grid = sweep(system, points=points, x0=start, **options)
    found = grid.v_points.values
    assert np.array_equal(found[0], found[4])
    for i, (stiffness, drive) in enumerate(((1.6, 1.2), (3.1, 1.2), (1.6, 2.4), (3.1, 2.4))):
        alone = solve(oscillator.coulomb(k=stiffness, sigma=drive), (0, 10 * np.pi), {y: 0.5, v: 0.3})
        assert found[i, -1] == alone.x[1, -1]
