"""Sigmoids: each slope is the derivative of its function, in terms of lambda."""

import mpmath
import pytest
import sympy as sp

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
