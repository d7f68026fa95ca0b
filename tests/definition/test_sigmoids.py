"""Sigmoids: each slope is the derivative of its function, in terms of lambda."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from friction_oscillator import hidden, z

from pwsmooth import solve
from pwsmooth.definition.sigmoids import SIGMOIDS, sigmoid

u, lam = sp.symbols("u lam", real=True)


@pytest.mark.parametrize("name", SIGMOIDS)
@pytest.mark.parametrize("at", [-2.5, -0.3, 0.0, 0.7, 1.9])
def test_the_slope_in_lambda_is_the_derivative_in_u(name, at):
    family = SIGMOIDS[name]
    derivative = sp.lambdify(u, family.function(u), "mpmath")
    with mpmath.workdps(40):
        at = mpmath.mpf(at)
        slope = sp.lambdify(lam, family.slope(lam), "mpmath")(derivative(at))
        assert abs(slope - mpmath.diff(derivative, at)) < mpmath.mpf(10) ** -25


@pytest.mark.parametrize("name", SIGMOIDS)
def test_the_inverse_undoes_the_function(name):
    family = SIGMOIDS[name]
    there, back = sp.lambdify(u, family.function(u), "mpmath"), sp.lambdify(lam, family.inverse(lam), "mpmath")
    with mpmath.workdps(30):
        assert abs(back(there(mpmath.mpf("1.3"))) - mpmath.mpf("1.3")) < mpmath.mpf(10) ** -25


@pytest.mark.parametrize("name", ["algebraic", "tanh"])
def test_the_slope_is_the_declared_power_of_gamma(name):
    assert SIGMOIDS[name].slope(lam) == (1 - lam**2) ** SIGMOIDS[name].exponent


def test_the_error_function_has_no_exponent():
    assert SIGMOIDS["erf"].exponent is None


@pytest.mark.parametrize("name", SIGMOIDS)
def test_the_smooth_switch_tends_to_the_sign(name):
    h, eps = sp.symbols("h eps", positive=True)
    smooth = SIGMOIDS[name].smooth(h, eps)
    assert sp.limit(smooth, eps, 0, "+") == 1
    assert sp.simplify(smooth - SIGMOIDS[name].function(h / eps)) == 0


def test_the_square_of_the_algebraic_switch_has_no_quotient_of_eps():
    h, eps = sp.symbols("h eps", real=True)
    assert SIGMOIDS["algebraic"].smooth(h, eps) ** 2 == h**2 / (eps**2 + h**2)


def test_an_unknown_sigmoid_is_refused_with_the_choice():
    with pytest.raises(
        ValueError, match="`sigmoid` is 'step', the name of none; choose one of algebraic, tanh, erf"
    ):
        sigmoid("step")


# ---- sigmoids given as an expression

ARCTAN = 2 / sp.pi * sp.atan(u)
CUBIC_TAIL = 2 / sp.pi * (u / (1 + u**2) + sp.atan(u))


@pytest.mark.parametrize("name", SIGMOIDS)
def test_an_expression_is_solved_as_the_sigmoid_of_that_name(name):
    w = sp.Symbol("w")  # whatever the symbol is called, and without assumptions
    own = SIGMOIDS[name].function(w)
    start = {"y": 0.7, "v": -1.0, "z": 0.0}
    ends = [solve(hidden().smoothed(0.05, f), (0, 8), start, rtol=1e-10).x[:, -1] for f in (name, own)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-8
    # In the layer the ratio decides what is captured: the same instants of stick and slip.
    runs = [solve(hidden().layered({z: 0.3}, sigmoid=f), (0, 30), {"y": 0.7, "v": -1}) for f in (name, own)]
    assert [e.kind for e in runs[0].events] == [e.kind for e in runs[1].events]
    assert np.allclose([e.time for e in runs[0].events], [e.time for e in runs[1].events], rtol=0, atol=1e-10)


@pytest.mark.parametrize("expression", [ARCTAN, CUBIC_TAIL])
def test_the_inverse_and_the_slope_of_an_expression_are_those_of_its_function(expression):
    own = sigmoid(expression)
    places = np.array([-300.0, -2.5, 0.0, 0.7, 40.0])
    levels = sp.lambdify(u, own.function(u))(places)
    assert np.allclose(sp.lambdify(lam, own.inverse(lam))(levels), places, rtol=1e-9, atol=1e-14)
    exact = sp.lambdify(u, expression.diff(u))(places)
    assert np.allclose(sp.lambdify(lam, own.slope(lam))(levels), exact, rtol=1e-9, atol=1e-14)


def test_the_arctangent_has_the_slope_of_its_closed_form():
    slope = sp.lambdify(lam, sigmoid(ARCTAN).slope(lam))
    levels = np.linspace(-0.99, 0.99, 9)
    assert np.allclose(slope(levels), 2 / np.pi * np.cos(np.pi * levels / 2) ** 2, rtol=1e-10)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (u / (1 + u**2), "does not increase"),
        (u**2 / (1 + u**2), "not odd"),
        (sp.tanh(u) / 2, "at u = 1e9 it is 0.5"),
        (u / (1 + sp.Abs(u)), r"Abs\(u\) has a kink"),
        (sp.Symbol("a") * sp.tanh(u), "has 2 symbols"),
        (sp.Rational(1, 2), "it is a number"),
        (sp.log(u), "no real numbers"),
    ],
)
def test_an_expression_that_is_no_smooth_switch_is_refused_with_the_reason(given, why):
    with pytest.raises(ValueError, match=why):
        hidden().smoothed(0.1, given)
