"""Generated functions of the stiff path against independent computations.

Guards: codegen/stiff/.
"""

import ctypes
import dataclasses

import mpmath
import numpy as np
import pytest
import sympy as sp
from stiff_models import dense_relaxation, friction, slowed_chain, two_blocks, values

from pwsmooth.codegen.machine.cache import load_kernels
from pwsmooth.codegen.machine.units import unit_address
from pwsmooth.codegen.stiff import functions as codegen
from pwsmooth.definition.model import EventSpec, Model, Select

t, x, y, z, a, b = sp.symbols("t x y z a b", real=True)
RECURRENCES = [
    Model(
        t, (x, y, z), (a, b),
        (sp.sin(a * t) * sp.exp(-x) + sp.log(2 + y) / (1 + z**2), sp.sqrt(1 + x**2) * sp.tanh(y),
         (2 + y) ** b - z),
    ),
    Model(t, (x, y, z), (a, b), (a / b, x * sp.tan(z / 3) + b, sp.asin(x / 4) * y)),  # x moves with constant speed
    Model(
        t, (x, y, z), (a, b),
        (sp.atan(x * y) - sp.cos(x + b * t), sp.erf(z - y) - sp.Rational(1, 2), (3 + z) ** sp.Rational(-3, 2)),
    ),
    Model(
        t, (x, y, z), (a, b),
        (sp.sinh(x) / sp.cosh(a * y), (2 + x) ** sp.Rational(5, 3) - sp.exp(t) * z, sp.cos(y) ** 2),
    ),
]  # fmt: skip


def call(compiled, name, *arguments):
    """A generated function with arrays as pointers, floats and integers as they are."""
    kind = {float: ctypes.c_double, int: ctypes.c_int64, np.ndarray: ctypes.c_void_p}
    kinds = [kind[type(v)] for v in arguments]
    given = [v.ctypes.data if isinstance(v, np.ndarray) else v for v in arguments]
    result = ctypes.c_int64 if name == "act" else None
    return ctypes.CFUNCTYPE(result, *kinds)(int(compiled.address[codegen.NAMES.index(name)]))(*given)


def test_the_tables_are_those_of_collocation_at_the_radau_nodes():
    tables = load_kernels("stiff.tables")
    for m in range(3):
        s = 3 + 2 * m
        q = sp.Symbol("q")
        poly = sp.Poly(sp.diff(q ** (s - 1) * (q - 1) ** s, q, s - 1), q)
        nodes = [mpmath.mpf(str(r)) for r in sorted(poly.nroots(n=40, maxsteps=500))]
        assert max(abs(float(c) - d) for c, d in zip(nodes, tables.NODES[m], strict=False)) < 1e-15
        with mpmath.workdps(40):
            V = mpmath.matrix(s, s)
            moments = mpmath.matrix(s, s)
            for i in range(s):
                for k in range(s):
                    V[i, k], moments[i, k] = nodes[i] ** k, nodes[i] ** (k + 1) / (k + 1)
            inverse = (moments * V**-1) ** -1
        lane = tables.WLANE[m, :s]
        # W <- F, times mu as complex lanes, Z <- W: together the inverse of the Runge-Kutta matrix.
        W = tables.TO_W[m, :s]
        mu, part = tables.MU[m, :4] + 1j * tables.MU[m, 4:], W[:, :4] + 1j * W[:, 4:]
        product = part * mu
        full = np.hstack([product.real, product.imag])[:, lane] @ tables.TO_Z[m, :s, :s]
        expected = np.array(inverse.tolist(), float).T
        assert np.abs(full - expected).max() < 1e-13 * np.abs(expected).max()


def test_dense_and_predictor_polynomials_pass_through_the_stages():
    tables = load_kernels("stiff.tables")
    for m in range(3):
        s = 3 + 2 * m
        c, Z = tables.NODES[m, :s], np.random.default_rng(m).normal(size=s)
        inside = sum((Z @ tables.DENSE[m, :s])[j] * c ** (j + 1) for j in range(s))
        beyond = sum((Z @ tables.PREDICT[m, :s])[j] * (c - 1) ** (j + 1) for j in range(s))
        assert np.allclose(inside, Z, atol=1e-11) and np.allclose(beyond + Z[-1], Z, atol=1e-11)


@pytest.mark.parametrize("model", [friction("erf"), two_blocks(), *RECURRENCES])
def test_rates_and_jacobian_are_those_of_sympy(model):
    compiled = codegen.compile_stiff(model)
    n, rng = compiled.n, np.random.default_rng(3)
    p = rng.uniform(0.3, 1.0, len(model.parameters))
    symbols = (model.time, model.states, model.parameters)
    f = sp.lambdify(symbols, model.rhs, ["scipy", "numpy"])
    J = sp.lambdify(symbols, sp.Matrix(model.rhs).jacobian(model.states), ["scipy", "numpy"])
    points, times = rng.uniform(-1, 1, (n, 8)), rng.uniform(0, 3, 8)
    lanes, hoisted = np.zeros((n, 8)), np.zeros((compiled.n_hoisted, 8))
    entries = np.zeros(len(compiled.pattern[0]))
    if compiled.n_hoisted:
        call(compiled, "hoist", times, p, hoisted)
    call(compiled, "rates8", times, hoisted, points, p, lanes)
    for k in range(8):
        out, state = np.zeros(n), points[:, k].copy()
        call(compiled, "rates1", float(times[k]), state, p, out)
        call(compiled, "jacobian", float(times[k]), state, p, entries)
        expected = np.array(f(times[k], state, p), float)
        assert np.allclose(out, expected, rtol=1e-13, atol=1e-13)
        assert np.allclose(lanes[:, k], expected, rtol=1e-13, atol=1e-13)
        assert np.allclose(compiled.matrix(entries), J(times[k], state, p), rtol=1e-12, atol=1e-12)


def test_every_function_of_lanes_is_that_of_one_point():
    rates = (sp.floor(3 * t), *(f(y + 2) for f in (sp.Abs, sp.asinh, sp.erfc, sp.sinh, sp.tan, sp.sqrt)))
    states = (x, y, *sp.symbols("u0:5", real=True))
    compiled = codegen.compile_stiff(Model(t, states, (), rates))
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (7, 8))
    times, hoisted = np.linspace(0.1, 2, 8), np.zeros((compiled.n_hoisted, 8))
    lanes, empty, out = np.zeros((7, 8)), np.zeros(0), np.zeros(7)
    call(compiled, "hoist", times, empty, hoisted)
    call(compiled, "rates8", times, hoisted, points, empty, lanes)
    for k in range(8):
        call(compiled, "rates1", float(times[k]), points[:, k].copy(), empty, out)
        assert np.allclose(lanes[:, k], out, rtol=1e-14, atol=0)
        assert np.allclose(
            out, [float(rate.subs({y: points[1, k], t: times[k]})) for rate in rates], rtol=1e-13
        )


@pytest.mark.parametrize("scale", [1.0, 1e3, 1e17])
def test_sines_of_eight_lanes_keep_their_digits_far_from_zero(scale):
    # Beyond a million quarter turns the polynomials give way to the C library.
    compiled = codegen.compile_stiff(Model(t, (x, y), (), (sp.sin(x), sp.cos(y))))
    points = scale * np.random.default_rng(7).uniform(-4, 4, (2, 8))
    lanes, empty = np.zeros((2, 8)), np.zeros(0)
    call(compiled, "rates8", np.zeros(8), empty, points, empty, lanes)
    # The argument's own rounding is exact here; what is left is that of the reduction and of the polynomials.
    assert np.abs(lanes - [np.sin(points[0]), np.cos(points[1])]).max() < 4 * np.finfo(float).eps


@pytest.mark.parametrize("form", ["u", "v"])
def test_the_hidden_term_keeps_its_digits_far_outside_the_layer(form):
    model = friction()
    if form == "v":  # lam**2 = v**2/(eps**2 + v**2), as a System writes it
        (v, width), beta = model.smoothing[0], model.parameters[1]
        last = (1 - v**2 / (width**2 + v**2) - model.states[2]) / beta
        model = dataclasses.replace(model, rhs=(*model.rhs[:2], last))
    compiled = codegen.compile_stiff(model)
    p, out = values(1e-6, 1.0), np.zeros(3)
    call(compiled, "rates1", 0.0, np.array([0.0, 5.0, 0.0]), p, out)
    exact = 1 / (1 + (5.0 / 1e-6) ** 2)  # 1 - lam**2 in doubles has no digit left here
    assert abs(out[2] / exact - 1) < 1e-14


@pytest.mark.parametrize("model", [friction(), two_blocks(), slowed_chain(6), dense_relaxation(14)],
                         ids=["3", "4", "12", "dense"])  # fmt: skip
def test_the_elimination_solves_the_real_and_the_complex_systems(model):
    compiled = codegen.compile_stiff(model)
    n, rng = compiled.n, np.random.default_rng(5)
    p, state, J = np.full(len(model.parameters), 0.2), rng.normal(size=n), np.zeros(len(compiled.pattern[0]))
    call(compiled, "jacobian", 0.4, state, p, J)
    mu = np.concatenate([rng.uniform(5, 9, 4), [0.0], rng.uniform(1, 9, 3)])
    right = rng.normal(size=(n, 8))
    right[:, 4] = 0.0
    solved, lu = right.copy(), np.zeros(compiled.eliminated)
    written_out = compiled.address[codegen.NAMES.index("factor")] != 0
    assert written_out == (n != 14)
    if written_out:
        call(compiled, "factor", J, mu, lu)
        call(compiled, "solve", lu, solved)
    else:
        plan, *pointers = [v.ctypes.data for v in (compiled.elimination, J, mu, lu, solved)]
        kinds = [ctypes.c_void_p] * 4
        ctypes.CFUNCTYPE(None, *kinds)(unit_address("sparse_factor"))(plan, *pointers[:3])
        ctypes.CFUNCTYPE(None, *kinds[:3])(unit_address("sparse_solve"))(plan, *pointers[2:])
    for lane in range(4):
        matrix = (mu[lane] + 1j * mu[4 + lane]) * np.eye(n) - compiled.matrix(J)
        expected = np.linalg.solve(matrix, right[:, lane] + 1j * right[:, 4 + lane])
        assert np.allclose(solved[:, lane] + 1j * solved[:, 4 + lane], expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("model", RECURRENCES)
def test_every_recurrence_gives_the_taylor_coefficients_of_the_solution(model):
    compiled = codegen.compile_stiff(model)
    p, state, K = np.array([0.7, 1.3]), np.array([0.2, -0.4, 0.3]), 16
    rows = np.zeros((3, 24))
    call(compiled, "taylor", 0.5, state, p, K, 24, rows)
    with mpmath.workdps(40):
        f = sp.lambdify((t, (x, y, z)), [r.subs({a: p[0], b: p[1]}) for r in model.rhs], "mpmath")
        # Picard iteration on truncated polynomials: order k is exact after k rounds.
        coefficients = [[mpmath.mpf(v)] for v in state]
        for k in range(10):

            def rate(s, i):
                at = [mpmath.polyval(c[::-1], s) for c in coefficients]
                return f(mpmath.mpf(0.5) + s, at)[i]

            new = [mpmath.taylor(lambda s, i=i: rate(s, i), 0, k)[k] / (k + 1) for i in range(3)]
            for c, v in zip(coefficients, new, strict=True):
                c.append(v)
    expected = np.array([[float(v) for v in c] for c in coefficients])
    assert np.allclose(rows[:, :11], expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("model", RECURRENCES)
def test_coefficients_of_high_order_add_up_to_the_solution(model):
    compiled = codegen.compile_stiff(model)
    p, state = np.array([0.7, 1.3]), np.array([0.2, -0.4, 0.3])
    rows = np.zeros((3, 24))
    call(compiled, "taylor", 0.5, state, p, 16, 24, rows)
    h = 0.02
    ahead, rates = rows[:, :17] @ h ** np.arange(17), np.zeros(3)
    slope = (rows[:, 1:17] * np.arange(1, 17)) @ h ** np.arange(16)
    call(compiled, "rates1", 0.5 + h, ahead, p, rates)
    assert np.abs(slope - rates).max() < 1e-14 * np.abs(rates).max() + 1e-14


def test_a_branch_that_does_not_exist_is_not_used():
    lam = Select(sp.Max(-1, sp.Min(1, 1000 * x)), x ** sp.Rational(3, 2), sp.S.Zero)
    contact = Model(t, (x, y), (), (y, -lam))
    compiled = codegen.compile_stiff(contact)
    out, empty = np.zeros(2), np.zeros(0)
    call(compiled, "rates1", 0.0, np.array([-1.0, 0.5]), empty, out)
    assert out.tolist() == [0.5, 0.0]
    call(compiled, "rates1", 0.0, np.array([4.0, 0.5]), empty, out)
    assert out.tolist() == [0.5, -8.0]
    assert compiled.address[codegen.NAMES.index("taylor")] == 0


def test_an_event_acts_on_the_values_before_and_only_if_its_condition_holds():
    swap = EventSpec(
        "swap", surface=x, when=sp.And(x > -1, sp.Or(y > 1, sp.Not(z > 0))), update=((0, y), (1, x))
    )
    compiled = codegen.compile_stiff(Model(t, (x, y, z), (), (y, z, x), events=(swap,)))
    empty, after = np.zeros(0), np.array([9.0, 9.0, 9.0])
    assert call(compiled, "act", 0, 0.0, np.array([-2.0, 5.0, 0.0]), empty, after) == 0
    assert after.tolist() == [9.0, 9.0, 9.0]
    assert call(compiled, "act", 0, 0.0, np.array([0.0, 5.0, 1.0]), empty, after) == 1
    assert after.tolist() == [5.0, 0.0, 9.0]


def test_a_model_with_multipliers_is_refused_with_their_names():
    from pwsmooth.definition.model import Multiplier

    model = Model(t, (x,), (), (y,), multipliers=(Multiplier(y, "switch", x, x),))
    with pytest.raises(ValueError, match="still has y"):
        codegen.compile_stiff(model)


def test_an_unknown_function_or_symbol_is_named():
    for rate, name in ((sp.besselj(0, x), "besselj"), (x + sp.Symbol("stranger"), "stranger")):
        with pytest.raises((ValueError, TypeError), match=name):
            codegen.compile_stiff(Model(t, (x,), (), (rate,)))
