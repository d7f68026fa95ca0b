"""Restitution in closed form, against 90-digit arithmetic and against the equations of motion."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from pwsmooth.laws.contact import (
    ETA,
    contact_duration,
    damping_factor,
    effective_restitution,
    exact_eta,
    maximal_indentation,
    phase_curve,
    restitution,
)

ETAS = [*np.logspace(-12, 3, 91), 9.99e-3, 1e-2, 700.0, 701.0]
RESTITUTIONS = [*(1 - np.logspace(-14, -0.5, 15)), *np.linspace(0.02, 0.7, 18), 5e-3, 9.9e-3]


def lambert(eta):
    """e by Lambert's W with 90 digits: near its branch point half of them are lost."""
    eta = mpmath.mpf(eta)
    return (1 + mpmath.lambertw(-(1 + eta) * mpmath.exp(-(1 + eta))).real) / eta


@pytest.fixture(autouse=True)
def many_digits():
    with mpmath.workdps(90):
        yield


def test_restitution_agrees_with_lambert_w_to_fourteen_digits_from_tiny_to_huge_damping():
    worst = max(abs(mpmath.mpf(float(restitution(eta))) / lambert(eta) - 1) for eta in ETAS)
    assert worst < 1e-14


def test_the_inverse_agrees_with_lambert_w_to_fourteen_digits():
    for e in RESTITUTIONS:
        # e(eta) falls: bisection of the closed form, independent of the inverse's own equation.
        e = mpmath.mpf(float(e))
        low, high = 1 - e, 1 / e if e < 0.9 else 3 * (1 - e)
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if lambert(middle) > e else (low, middle)
        assert abs(mpmath.mpf(float(exact_eta(float(e)))) / low - 1) < 1e-14, float(e)


def test_restitution_and_its_inverse_take_arrays_and_their_ends():
    assert restitution([0.0, 1.0]).shape == (2,)
    assert restitution(0.0) == 1.0
    assert exact_eta(1.0) == 0.0
    assert exact_eta(restitution(2.5)) == pytest.approx(2.5, rel=1e-14)


# eta -> e and c_r -> e of every law: the specification's table, computed independently, half a unit of its last digit.
TABLE = {
    "hunt-crossley": (0.581288, 0.662962, 0.909016, 0.990099),
    "herbert-mcwhannell": (0.519967, 0.593624, 0.900893, 0.990001),
    "lee-wang": (0.738995, 0.799199, 0.952370, 0.995025),
    "lankarani-nikravesh": (0.684225, 0.725241, 0.913177, 0.990148),
    "gonthier": (0.304225, 0.487741, 0.876435, 0.986776),
    "zhang-sharf": (0.3, 0.5, 0.9, 0.99),
    "zhiying-qishao": (0.326697, 0.482608, 0.895918, 0.989951),
    "wang-liu-ma": (0.326697, 0.482608, 0.895918, 0.989951),
    "flores": (0.256208, 0.470445, 0.893921, 0.989340),
    "hu-guo": (0.270658, 0.487741, 0.899900, 0.990000),
}


@pytest.mark.parametrize("name", ETA)
def test_effective_restitution_of_every_law_of_the_table(name):
    got = [effective_restitution(name, c) for c in (0.3, 0.5, 0.9, 0.99)]
    assert got == pytest.approx(TABLE[name], abs=6e-7)


def test_the_exact_factor_is_that_of_the_specification():
    assert exact_eta([0.3, 0.5, 0.9, 0.99]) == pytest.approx([3.087082, 1.432751, 0.166482, 0.015151], abs=6e-7)
    assert restitution([0.1, 0.5, 1, 5]) == pytest.approx([0.937476, 0.748435, 0.593624, 0.196980], abs=6e-7)


def test_elastic_contact_lasts_as_long_as_its_quadrature():
    # int dp/v with v^2 = v0^2 - 2 G(p)/m, the root at the turning point taken out by p = delta (1 - u^2)
    K, n, m, v0 = 3e4, 1.5, 0.7, 1.3
    depth = maximal_indentation(K, n, m, v0)
    assert depth == pytest.approx((5 * m * v0**2 / (4 * K)) ** 0.4, rel=1e-15)
    half = quad(lambda u: 2 * u / np.sqrt(1 - (1 - u**2) ** (n + 1)), 0, 1, epsabs=1e-13, epsrel=1e-13)[0]
    assert contact_duration(K, n, m, v0) == pytest.approx(2 * depth / v0 * half, rel=1e-12)


def test_the_phase_curve_closes_at_the_restitution():
    for eta in (1e-6, 0.3, 4.0):
        assert phase_curve(eta, 1.0) == pytest.approx(0, abs=1e-15)
        assert phase_curve(eta, -restitution(eta)) == pytest.approx(0, abs=1e-15)
    assert phase_curve(0.0, [0.0, 0.5]) == pytest.approx([0.5, 0.375])


def test_bad_input_is_refused_by_name():
    with pytest.raises(ValueError, match="`eta` is -1"):
        restitution(-1)
    with pytest.raises(ValueError, match="0 < e <= 1"):
        exact_eta([0.5, 1.01])
    with pytest.raises(ValueError, match="`name` of `eta` is 'newton'; choose one of hunt-crossley"):
        damping_factor("newton", 0.5)
    with pytest.raises(ValueError, match="`c_r` is 0"):
        damping_factor("flores", 0)
    with pytest.raises(ValueError, match="`mass` is 0"):
        maximal_indentation(1.0, 1.5, 0.0, 1.0)
