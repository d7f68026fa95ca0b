"""Restitution of the contact laws F = g(delta) (1 + eta v/v0), v0 the speed at touch-down, in closed form.

With s = v/v0, m v0^2 s ds = -g (1 + eta s) d(delta): the two halves of an impact pass the same indentations, so that

    phi(eta) = phi(-eta e),     phi(x) = x - log(1 + x),

whatever g, the mass and the speed are. With Lambert's W (principal branch)

    e = (1 + W(-(1 + eta) exp(-(1 + eta)))) / eta;

the inverse eta(e) has two linear factors and no such form: Newton's iteration inside a bracket.
Chain: restitution (here) -> family.py, which puts eta(c_r) into a force.
"""

from __future__ import annotations

from math import exp, gamma, log1p, pi, sqrt

import numpy as np

from ...door import checks

__all__ = ["contact_duration", "exact_eta", "maximal_indentation", "phase_curve", "restitution"]

# e = sum c_k eta^k, from phi(-eta e) = phi(eta), coefficient by coefficient (rationals).
_SERIES = (1.0, -2 / 3, 4 / 9, -44 / 135, 104 / 405, -40 / 189, 7648 / 42525, -2848 / 18225, 31712 / 229635)
_SMALL_ETA = 1e-2  # the first dropped term is below 0.13 * 1e-18 there


@checks.door(eta=checks.array)
def restitution(eta):
    """Coefficient of restitution e of the law F = g(delta) (1 + eta v/v0).

    Parameters
    ----------
    eta : float or array_like, any shape, dimensionless
        Damping factor, >= 0.

    Returns
    -------
    float or ndarray
        e in (0, 1], dimensionless, of the shape of `eta`, to rounding; e < 1/eta, so that the force of a free impact
        never pulls.

    Raises
    ------
    ValueError
        `eta` negative or nan.

    Notes
    -----
    The two halves of an impact pass the same indentations, so that phi(eta) = phi(-eta e) with phi(x) = x - log(1 + x),
    whatever g, the mass and the speed are; e = (1 + W(-(1 + eta) exp(-(1 + eta))))/eta with Lambert's W.

    Source: derived here; the relation between eta and e is that of Zhang and Sharf 2004.

    >>> round(float(restitution(0.5)), 6)
    0.748435
    """
    return _elementwise(_restitution, eta)


@checks.door(e=checks.array)
def exact_eta(e):
    """The damping factor eta whose restitution is exactly `e`: the inverse of `restitution`.

    Parameters
    ----------
    e : float or array_like, any shape, dimensionless
        Coefficient of restitution in (0, 1].

    Returns
    -------
    float or ndarray
        eta in [0, 1/e), dimensionless, of the shape of `e`, to rounding.

    Raises
    ------
    ValueError
        `e` outside (0, 1].

    Source: Zhang, Sharf 2004; the exact form of Gonthier et al. 2004 with d = eta e.

    >>> round(float(exact_eta(0.5)), 6)
    1.432751
    """
    return _elementwise(_exact_eta, e)


@checks.door(**dict.fromkeys(("stiffness", "exponent", "mass", "speed"), checks.positive), eta=checks.number)
@checks.closed_form
def maximal_indentation(stiffness, exponent, mass, speed, eta=0.0):
    """Largest indentation of a free impact on F = K delta^n (1 + eta v/v0).

    Parameters
    ----------
    exponent : float, dimensionless
        n > 0; 3/2 is Hertz's.
    eta : float, dimensionless
        Damping factor; 0 is the elastic contact.

    Returns
    -------
    float
        Metres: ((n + 1) m v0^2 (eta - log(1 + eta))/(eta^2 K))^(1/(n + 1)); units of length.

    Raises
    ------
    ValueError
        An argument that is not positive, or `eta` negative.

    Source: derived here, by the integral of m v dv = -F d(delta) from v0 to 0.

    >>> float(maximal_indentation(1e5, 1, 1.0, 2.0)) == 2.0 * (1 / 1e5) ** 0.5
    True
    """
    work = mass * speed**2 * _phi_ratio(_eta(eta))
    return ((exponent + 1) * work / stiffness) ** (1 / (exponent + 1))


@checks.door(**dict.fromkeys(("stiffness", "exponent", "mass", "speed"), checks.positive))
@checks.closed_form
def contact_duration(stiffness, exponent, mass, speed):
    """How long an elastic free impact on F = K delta^n lasts.

    Parameters
    ----------
    exponent : float, dimensionless
        n > 0.

    Returns
    -------
    float
        Seconds, units of time: 2 (delta_max/v0) sqrt(pi) Gamma(1 + q)/Gamma(1/2 + q) with q = 1/(n + 1); 2.943
        delta_max/v0 for Hertz's n = 3/2.

    Raises
    ------
    ValueError
        An argument that is not positive.

    Source: Hertz 1882 for n = 3/2; derived here for other n, by the Beta function.

    >>> from math import pi
    >>> abs(contact_duration(4.0, 1, 1.0, 1.0) - pi / 2) < 1e-15
    True
    """
    depth = maximal_indentation(stiffness, exponent, mass, speed)
    q = 1 / (exponent + 1)
    return 2 * depth / speed * sqrt(pi) * gamma(1 + q) / gamma(0.5 + q)


@checks.door(eta=checks.number, s=checks.array)
@checks.closed_form
def phase_curve(eta, s):
    """Work that the elastic part has done at speed s v0: G(delta)/(m v0^2).

    Parameters
    ----------
    eta : float, dimensionless
        Damping factor, >= 0.
    s : array_like, any shape, dimensionless
        Speed over that at touch-down, from 1 down to -e.

    Returns
    -------
    ndarray
        (phi(eta) - phi(eta s))/eta^2, dimensionless, of the shape of `s`; delta follows by inverting the potential G of
        the elastic part g.

    Raises
    ------
    ValueError
        `eta` negative.

    Source: derived here, by the integral of m v dv = -F d(delta); phi(x) = x - log(1 + x).

    At the turning point of an elastic impact half of m v0^2 is stored:

    >>> float(phase_curve(0.0, 0.0))
    0.5
    """
    eta = _eta(eta)
    ratio = np.vectorize(lambda x: _phi_ratio(eta * x), otypes=[float])
    return _phi_ratio(eta) - s**2 * ratio(s)


# ---- phi(x) = x - log(1 + x) without cancellation -------------------------------------------------


def _phi_ratio(x):
    """phi(x)/x^2 = 1/2 - x/3 + x^2/4 - ..."""
    return 0.5 - x * _third(x)


def _third(x):
    """(1/2 - phi(x)/x^2)/x = 1/3 - x/4 + x^2/5 - ..., to rounding."""
    if -0.5 < x < 1:
        # With z = x/(2 + x):  log(1 + x) = 2 atanh z,  x = 2 z/(1 - z)  and  |z| < 1/3.
        z = x / (2 + x)
        odd = sum(z ** (2 * k) / (2 * k + 3) for k in range(16, -1, -1))  # the next term is below 1e-17
        return (1 - z) * (1 + (1 - z) ** 2 * odd) / 4
    return (0.5 - (x - log1p(x)) / x**2) / x


# ---- both directions ------------------------------------------------------------------------------


def _restitution(eta):
    eta = _eta(eta)
    if eta < _SMALL_ETA:
        return float(np.polynomial.polynomial.polyval(eta, _SERIES))
    if eta > 700:  # w = 1 - eta e < 1e-300
        return 1 / eta
    from scipy.special import lambertw

    # Near the branch point -1/e of W the form loses 1/eta^2 units of rounding; a Newton step on
    # phi(-u) = phi(eta), u = eta e, gives them back.
    w = -float(lambertw(-(1 + eta) * exp(-(1 + eta))).real)
    if w < 0.5:
        return (1 - w) / eta
    u = 1 - w
    u -= (u**2 * _phi_ratio(-u) - eta**2 * _phi_ratio(eta)) * (1 - u) / u
    return u / eta


def _exact_eta(e):
    e = float(e)
    if not 0 < e <= 1:
        raise ValueError(
            f"`e` is {e:g}, no coefficient of restitution that a contact can have; give 0 < e <= 1."
        )
    # phi(eta) = phi(-eta e), divided by eta^2 and sorted so that nothing cancels as e -> 1:
    #     rest(eta) = eta (third(eta) + e^3 third(-eta e)) - (1 - e)(1 + e)/2 = 0,  increasing.
    half = (1 - e) * (1 + e) / 2
    if half == 0:
        return 0.0
    if e < 1e-2:
        # w = 1 - eta e = (1 + eta) exp(-eta (1 + e)) < 1e-40: eta is 1/e to rounding.
        return 1 / e
    low, high = 0.0, 1 / e
    eta = min(half * 3 / (1 + e**3), 0.99 * high)
    for _ in range(200):
        rest = eta * (_third(eta) + e**3 * _third(-eta * e)) - half
        low, high = (eta, high) if rest < 0 else (low, eta)
        if eta < 1e-2:  # the other form loses its digits as eta -> 0
            slope = (1 + e**3) / 3 - eta * (1 - e**4) / 2
        else:
            slope = (e**2 / (1 - eta * e) - 1 / (1 + eta) - 2 * rest) / eta
        new = eta - rest / slope
        if not low < new < high:
            new = (low + high) / 2
        if abs(new - eta) <= 2e-16 * eta:
            return new
        eta = new
    return eta


def _elementwise(function, value):
    return np.vectorize(function, otypes=[float])(value)[()]


def _eta(value):
    if not value >= 0:
        raise ValueError(f"`eta` is {value:g}; the damping factor of a contact is >= 0.")
    return value
