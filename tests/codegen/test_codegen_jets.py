"""Taylor programs against series from elsewhere: closed-form trajectories differentiated by mpmath.

Guards: codegen/taylor/.
"""

import ctypes
import math

import mpmath
import numpy as np
import pytest
import sympy as sp

from pwsmooth.codegen import compile_model
from pwsmooth.codegen.taylor.jets import write_jets
from pwsmooth.definition.model import EventSpec, Model, Multiplier, Select

K = 12
t, x, y, v, w, lam, mu, nu = sp.symbols("t x y v w lam mu nu", real=True)
a, b, c = sp.symbols("a b c", positive=True)


def jet(model, x0, p=(), mult=(), mask=None, t0=0.0, order=K):
    """Rows of a jet: (array (nrows, order + 1), return code); the general program where a mask is given."""
    compiled = compile_model(model)
    count, own = compiled.nrows_slip if mask is None else compiled.nrows_general
    # Rubbish in the buffer: a program must write every order that it is asked for.
    rows = np.full((count + own, order + 4), 7.5)
    inputs = [np.array([*q, 0.0], float) for q in (x0, mult, p)]
    if mask is not None:
        inputs.append(np.array([*mask, 0], np.int64))
    number, pointer = ctypes.c_int64, ctypes.c_void_p
    kinds = [ctypes.c_double, *[pointer] * len(inputs), number, number, pointer, number]
    address = compiled.jet_slip if mask is None else compiled.jet_general
    call = ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)(address)
    stride = rows.shape[1]
    code = call(t0, *(q.ctypes.data for q in inputs), order, stride, rows.ctypes.data, count * stride)
    # Behind the last block of four orders a row keeps what it holds, or gets zeros.
    behind = rows[:count, order + 1 + -order % 4 :]
    assert np.all((behind == 7.5) | (behind == 0.0))
    return rows[:count], code


def interpreted_jet(model, x0, p=(), t0=0.0, order=K):
    """Rows of the slip program, its text run by Python itself: the recurrences without a compilation each."""
    text = write_jets(model)["slip"]

    def presum(rows, a, b, q, out):
        for lane in range(4):
            k = 4 * q + lane + 1
            rows[out + lane] = sum(rows[a + j] * rows[b + k - j] for j in range(lane + 1, 4 * q + 1))

    def combine(rows, out, value, table, stride, order, *factors):
        for k in range(order + 1):
            rows[out + k] = sum(c * rows[table + j * stride + k] for j, c in enumerate(factors))
        rows[out] = value

    helpers = {"presum": presum, "combine": combine, "choose": lambda condition, u, v: u if condition else v}
    scope = {"math": math, **helpers}
    exec("from __future__ import annotations\n" + text, scope)
    count, stride = scope["NROWS"], order + 4
    rows = np.full((count + scope["OWN_ROWS"], stride), 7.5)
    assert scope["jet_slip"](t0, x0, (), p, order, stride, rows.reshape(-1), count * stride) == 0
    return rows[:count]


def series(function, order=K):
    """Taylor coefficients of a function of one variable at 0, by mpmath in 60 digits."""
    with mpmath.workdps(60):
        return np.array([float(q) for q in mpmath.taylor(function, 0, order)])


def assert_series(found, expected, digits=1e-12):
    scale = np.maximum.accumulate(np.abs(expected)[::-1])[::-1] + 1e-3 * np.abs(expected).max()
    assert np.all(np.abs(found - expected) <= digits * scale), (found, expected)


UNARY = [
    sp.exp,
    sp.log,
    sp.sin,
    sp.cos,
    sp.tan,
    sp.sinh,
    sp.cosh,
    sp.tanh,
    sp.asin,
    sp.acos,
    sp.atan,
    sp.asinh,
    sp.atanh,
    sp.erf,
    sp.erfc,
    sp.sqrt,
    lambda u: sp.acosh(1 + u),
    lambda u: u**3,
    lambda u: u**-2,
    lambda u: u ** sp.Rational(3, 2),
    lambda u: u**1.37,
    lambda u: u**c,
    lambda u: (1 + u) ** u,
    lambda u: 2**u,
    lambda u: c / (1 + u),
    lambda u: u / (1 + u * u),
    sp.cot,
    sp.sech,
]


@pytest.mark.parametrize("argument", ["general", "affine"])
@pytest.mark.parametrize("number", range(len(UNARY)))
def test_every_recurrence_gives_the_series_of_its_function(number, argument):
    f = UNARY[number]
    # x = exp(-a s)/2 is a general series, 1/2 - a t an affine one; y integrates f along it.
    inner = x if argument == "general" else sp.Rational(1, 2) - a * t
    model = Model(t, (x, y), (a, c), (-a * x, f(inner)))
    rows = interpreted_jet(model, (0.5, 0.0), (0.7, 1.9))
    u = sp.symbols("u")
    F = sp.lambdify(u, f(u).subs(c, sp.Float("1.9", 60)), "mpmath")

    def along(s):
        q = mpmath.mpf(0.7) * s
        return F(mpmath.exp(-q) / 2 if argument == "general" else 0.5 - q)

    expected = series(along, K - 1)
    assert_series(rows[1, 1 : K + 1] * np.arange(1, K + 1), expected)


def test_compiled_and_interpreted_programs_agree():
    rates = (-a * x, sum(f(x) / 10 for f in UNARY[::3]))
    model = Model(t, (x, y), (a, c), rates)
    rows, code = jet(model, (0.5, 0.0), (0.7, 1.9))
    assert code == 0
    expected = interpreted_jet(model, (0.5, 0.0), (0.7, 1.9))
    np.testing.assert_allclose(rows[:2, : K + 1], expected[:2, : K + 1], rtol=1e-11)


@pytest.mark.parametrize("mask", [None, (0,), (1,)])
def test_a_program_writes_the_orders_asked_for_and_nothing_beyond(mask):
    rate = sp.sin(t) / 2 - lam * (1 + a * (1 - lam**2)) - x * y / 9
    model = Model(t, (x, y), (a,), (rate, x * y + lam), (Multiplier(lam, "switch", rate, x, hidden=True),))
    start, mult = ((0.0, 0.4), (0.0,)) if mask == (1,) else ((0.3, 0.4), (1.0,))
    longest, _ = jet(model, start, (0.4,), mult, mask, order=13)
    first, where = compile_model(model).mult_row0, [0, 1] if mask is None else [0, 1, 2]
    assert mask is None or first == 2
    for order in range(1, 13):
        rows, code = jet(model, start, (0.4,), mult, mask, order=order)
        assert code == 0
        np.testing.assert_array_equal(rows[where, : order + 1], longest[where, : order + 1])
        assert np.all(rows[where, order + 1 :] == 7.5)


def test_products_of_constants_lines_and_states_have_their_series():
    f = (
        a * x * t
        + t**2 * x
        + x**2 * y
        + t * (1 + 2 * t) / (1 + t)
        + x * y / (2 + a * t)
        + a / (x + y)
        + (a + t) * sp.sin(x) * sp.cos(x * y)
    )
    model = Model(t, (x, y, v), (a,), (y, -x, f))
    rows, _ = jet(model, (0.5, 0.3, 0.0), (0.7,), t0=0.2)
    F = sp.lambdify((t, x, y), f.subs(a, sp.Float("0.7", 60)), "mpmath")

    def along(s):
        X = 0.5 * mpmath.cos(s) + 0.3 * mpmath.sin(s)
        Y = 0.3 * mpmath.cos(s) - 0.5 * mpmath.sin(s)
        return F(0.2 + s, X, Y)

    assert_series(rows[2, 1 : K + 1] * np.arange(1, K + 1), series(along, K - 1))


def test_states_with_constant_rates_cost_nothing_and_are_right():
    # w is a phase angle, v a constant; sin(w) is then a function of an affine argument.
    model = Model(t, (w, v, y), (a,), (a, sp.Integer(0), v * sp.sin(w) + w * v))
    assert "presum" not in write_jets(model)["slip"]  # no convolution is needed
    rows, _ = jet(model, (0.4, 2.0, 0.0), (1.5,))
    assert_series(rows[0, : K + 1], np.array([0.4, 1.5] + [0.0] * (K - 1)))
    assert_series(rows[1, : K + 1], np.array([2.0] + [0.0] * K))
    expected = series(lambda s: 2 * mpmath.sin(0.4 + 1.5 * s) + 2 * (0.4 + 1.5 * s), K - 1)
    assert_series(rows[2, 1 : K + 1] * np.arange(1, K + 1), expected)


def test_surfaces_have_rows_and_share_those_of_states():
    switch = Multiplier(lam, "switch", -sp.sin(t) - lam, v)
    events = (EventSpec("far", x * v - 1), EventSpec("clock", at=(sp.Integer(3),)), EventSpec("late", t - 5))
    model = Model(t, (x, v), (), (v, -sp.sin(t) - lam), (switch,), events)
    rows, _ = jet(model, (0.5, 0.3), mult=(1.0,))
    where = compile_model(model).surface_rows_slip
    assert where[0] == 1 and where[2] == -1
    X, V = rows[0, : K + 1], rows[1, : K + 1]
    product = np.convolve(X, V)[: K + 1]
    product[0] -= 1
    assert_series(rows[where[1], : K + 1], product)
    assert_series(rows[where[3], : K + 1], np.array([-5.0, 1.0] + [0.0] * (K - 1)))


def implicit_series(residuals, start, order=8):
    """Taylor coefficients of the roots of residuals(s, lambda), by Newton and differences in 60 digits."""
    m = len(start)

    def root(i):
        def at(s):
            if m == 1:
                return mpmath.findroot(lambda q: residuals(s, [q])[0], start[0])
            return mpmath.findroot(lambda *q: residuals(s, q), start)[i]

        return at

    with mpmath.workdps(60):
        return np.array([[float(q) for q in mpmath.taylor(root(i), 0, order)] for i in range(m)])


def sliding_model(m, nonlinear):
    """m velocities that all stick, coupled through their multipliers; positions rest."""
    unknowns, speeds = (lam, mu, nu)[:m], sp.symbols("v0:3", real=True)[:m]
    drives = (sp.sin(t), sp.cos(2 * t) / 2, t / 3 + sp.exp(-t) / 5)[:m]
    rates = []
    for i in range(m):
        rate = drives[i] - 2 * unknowns[i] - sum(unknowns) / (i + 2)
        if nonlinear:
            rate += -a * unknowns[i] * (1 - unknowns[i] ** 2) - unknowns[i] * unknowns[i - 1] / 7
        rates.append(rate)
    multipliers = tuple(
        Multiplier(u, "switch", r, s, hidden=nonlinear) for u, r, s in zip(unknowns, rates, speeds, strict=True)
    )
    return Model(t, (*speeds, y), (a,), (*rates, speeds[0] + unknowns[0] * unknowns[-1]), multipliers), rates


@pytest.mark.parametrize("nonlinear", [False, True])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_sliding_multipliers_solve_their_residuals_at_every_order(m, nonlinear):
    model, rates = sliding_model(m, nonlinear)
    unknowns = [q.symbol for q in model.multipliers]
    F = sp.lambdify((t, *unknowns), [r.subs(a, sp.Float("0.4", 60)) for r in rates], "mpmath")
    order = 8
    expected = implicit_series(lambda s, q: F(0.3 + s, *q), [0.1] * m, order)
    rows, code = jet(model, [0.0] * m + [1.0], (0.4,), expected[:, 0], [1] * m, t0=0.3, order=order)
    assert code == 0
    first = compile_model(model).mult_row0
    for j in range(m):
        assert_series(rows[first + j, : order + 1], expected[j], 1e-11)
        assert np.all(rows[j, : order + 1] == 0.0)  # surfaces that are states stay exactly 0
    integrand = np.convolve(expected[0], expected[-1])[:order]
    assert_series(rows[m, 1 : order + 1] * np.arange(1, order + 1), integrand, 1e-11)


@pytest.mark.parametrize("fixed", [0, 1])
def test_mixed_status_solves_only_the_masked_multipliers(fixed):
    model, rates = sliding_model(2, True)
    F = sp.lambdify((t, lam, mu), [r.subs(a, sp.Float("0.4", 60)) for r in rates], "mpmath")
    free, order = 1 - fixed, 8

    def residual(s, q):
        both = [q[0], q[0]]
        both[fixed] = mpmath.mpf(1)
        return [F(0.3 + s, *both)[free]]

    expected = implicit_series(residual, [0.1], order)[0]
    mult = [1.0, 1.0]
    mult[free] = expected[0]
    rows, code = jet(model, [0.0, 0.0, 1.0], (0.4,), mult, [fixed, 1 - fixed], t0=0.3, order=order)
    assert code == 0
    first = compile_model(model).mult_row0
    assert_series(rows[first + free, : order + 1], expected, 1e-11)
    assert_series(rows[first + fixed, : order + 1], np.array([1.0] + [0.0] * order))
    assert np.all(rows[free, 1 : order + 1] == 0.0) and np.any(rows[fixed, 1 : order + 1] != 0.0)


def test_general_program_without_mask_is_the_slip_program():
    model, _ = sliding_model(3, True)
    start, p, mult = (0.1, -0.2, 0.3, 1.0), (0.4,), (1.0, -1.0, 1.0)
    slip, _ = jet(model, start, p, mult)
    general, code = jet(model, start, p, mult, [0, 0, 0])
    assert code == 0
    np.testing.assert_allclose(general[:4, : K + 1], slip[:4, : K + 1], rtol=1e-13, atol=1e-15)


def test_a_bordered_system_with_zeros_on_its_diagonal_is_solved():
    one = Multiplier(lam, "algebraic", mu + lam**2 - 1 - t)
    two = Multiplier(mu, "algebraic", lam - sp.sin(t))
    model = Model(t, (y,), (), (lam * mu,), (one, two))
    rows, code = jet(model, [0.0], (), [0.0, 1.0], [1, 1], order=8)
    assert code == 0
    # dg/dmult = [[0, 1], [1, 0]] at the start: no pivot without exchange of rows
    assert_series(rows[1, :9], series(mpmath.sin, 8))
    assert_series(rows[2, :9], series(lambda s: 1 + s - mpmath.sin(s) ** 2, 8))


@pytest.mark.parametrize("m", [1, 2])
def test_a_singular_matrix_is_reported(m):
    if m == 1:
        multipliers = (Multiplier(lam, "algebraic", lam**2 - t),)
    else:
        multipliers = tuple(Multiplier(u, "algebraic", lam + mu - i * t) for i, u in enumerate((lam, mu)))
    model = Model(t, (y,), (), (lam,), multipliers)
    _, code = jet(model, [0.0], (), [0.0] * m, [1] * m)
    assert code == 1


def test_only_the_active_branch_of_a_selection_is_evaluated():
    deep = sp.sqrt(x) * x  # nan for x < 0
    switch = Multiplier(lam, "switch", v, x, regularity="kink")
    model = Model(t, (x, v), (), (v, Select(lam, -deep, sp.Integer(0)) - x), (switch,))
    rows, _ = jet(model, (-0.5, 0.3), mult=(-1.0,))
    expected = series(lambda s: -0.5 * mpmath.cos(s) + 0.3 * mpmath.sin(s))
    assert_series(rows[0, : K + 1], expected)
    rows, _ = jet(model, (-0.5, 0.3), mult=(-1.0,), mask=[0])
    assert_series(rows[0, : K + 1], expected)
    rows, _ = jet(model, (0.5, 0.3), mult=(1.0,))
    assert rows[1, 1] == pytest.approx(-(0.5**1.5) - 0.5, rel=1e-15) and np.all(np.isfinite(rows[:2, : K + 1]))


@pytest.mark.parametrize("mask", [None, (0,)])
def test_a_state_that_only_an_idle_branch_reads_keeps_its_row(mask):
    model = Model(t, (x, y), (a,), (a, Select(lam, t, sp.sin(x))), (Multiplier(lam, "switch", -lam, y),))
    rows, _ = jet(model, (0.5, 0.8), (0.7,), (1.0,), mask)
    np.testing.assert_array_equal(rows[0, :4], [0.5, 0.7, 0.0, 0.0])
    np.testing.assert_array_equal(rows[1, :4], [0.8, 0.0, 0.5, 0.0])


def test_a_constant_rate_may_be_a_selection_by_a_multiplier_that_selects_elsewhere():
    rates = (Select(lam, a, 2 * a), Select(lam, x * t, sp.sin(x)))
    model = Model(t, (x, y), (a,), rates, (Multiplier(lam, "switch", -lam, y),))
    rows, _ = jet(model, (0.5, 0.8), (0.7,), (-1.0,))
    assert_series(rows[0, : K + 1], np.array([0.5, 1.4] + [0.0] * (K - 1)))
    expected = series(lambda s: mpmath.sin(0.5 + mpmath.mpf(1.4) * s), K - 1)
    assert_series(rows[1, 1 : K + 1] * np.arange(1, K + 1), expected)


def test_a_solved_selection_takes_its_affine_form():
    # x' = 0.3 + sin(t)/2 - Select(lam, 1 + t, -1): slides with lam = ((0.3 + sin t/2) - t/2)/(1 + t/2)
    rate = sp.Rational(3, 10) + sp.sin(t) / 2 - Select(lam, 1 + t, sp.Integer(-1))
    model = Model(t, (x, y), (), (rate, Select(lam, 2 + t, x)), (Multiplier(lam, "switch", rate, x),))
    expected = series(lambda s: (0.3 + mpmath.sin(s) / 2 - s / 2) / (1 + s / 2))
    rows, code = jet(model, (0.0, 0.0), mult=(expected[0],), mask=[1])
    assert code == 0
    assert_series(rows[2, : K + 1], expected)
    integrand = np.convolve(expected, np.array([1, 0.5] + [0] * (K - 1)))[:K]
    integrand[:2] += 1, 0.5
    assert_series(rows[1, 1 : K + 1] * np.arange(1, K + 1), integrand)


def test_the_slip_program_refuses_a_selection_between_its_ends():
    model = Model(t, (x,), (), (Select(lam, x, -x),), (Multiplier(lam, "switch", -lam, x),))
    assert jet(model, (1.0,), mult=(0.5,))[1] == 2
    assert jet(model, (1.0,), mult=(-1.0,))[1] == 0


def test_a_function_without_recurrence_has_no_jets_and_no_error():
    model = Model(t, (x,), (), (sp.Abs(x),))
    compiled = compile_model(model)
    assert not compiled.has_jets and compiled.jet_slip == 0 and compiled.fields != 0


def test_a_condition_on_memories_selects_a_branch():
    rate = sp.Piecewise((-x, sp.Eq(v, 0)), (sp.log(v) * x, True))
    model = Model(t, (x, v), (), (rate, sp.Integer(0)), n_memory=1)
    rows, _ = jet(model, (1.0, 0.0))
    assert_series(rows[0, : K + 1], series(lambda s: mpmath.exp(-s)))
    rows, _ = jet(model, (1.0, 2.0))
    assert_series(rows[0, : K + 1], series(lambda s: mpmath.exp(mpmath.log(2) * s)))
