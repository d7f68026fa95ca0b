"""Elastic parts: the stiffness of Hertz's contact, and the bodies' composite modulus.

    1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2,     F = (4/3) E* sqrt(R) delta^(3/2)

R = R_i R_j/(R_i + R_j) outside, R_B R_J/(R_B - R_J) for a journal in its bearing (the sphere's formula is used for
internal cylinders too: Wang, Liu, Ma 2016, whose sigma_i = (1 - nu_i^2)/(pi E_i) give the same K).
Chain: stiffness (here) -> impact.py, scenes/slider_crank.py.
"""

from __future__ import annotations

from math import inf, sqrt

from ...door import checks

__all__ = ["composite_modulus", "hertz_stiffness", "journal_stiffness"]


@checks.door(
    E_1=checks.positive,
    nu_1=checks.number,
    E_2=checks.optional(checks.positive),
    nu_2=checks.optional(checks.number),
)
@checks.closed_form
def composite_modulus(E_1: float, nu_1: float, E_2: float | None = None, nu_2: float | None = None) -> float:
    """E* of two bodies, of one material if the second is not given.

    Parameters
    ----------
    E_1 : float, Pa
        Young's modulus.
    nu_1 : float, dimensionless
        Poisson's ratio, in (-1, 1/2].
    E_2, nu_2 : float, optional
        Those of the second body, in the same units; by default those of the first.

    Returns
    -------
    float
        E*, Pa.

    Raises
    ------
    ValueError
        A modulus that is not positive, a ratio that no isotropic body has.

    Source: Hertz 1882, 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2.

    >>> round(composite_modulus(207e9, 0.3) / 1e9, 4)
    113.7363
    """
    E_2, nu_2 = E_1 if E_2 is None else E_2, nu_1 if nu_2 is None else nu_2
    for name, nu in (("nu_1", nu_1), ("nu_2", nu_2)):
        if not -1 < nu <= 0.5:
            raise ValueError(f"`{name}` is {nu:g}; Poisson's ratio lies above -1 and is at most 1/2.")
    return 1 / ((1 - nu_1**2) / E_1 + (1 - nu_2**2) / E_2)


@checks.door(E_star=checks.positive, R_1=checks.extended, R_2=checks.extended)
@checks.closed_form
def hertz_stiffness(E_star: float, R_1: float, R_2: float = inf) -> float:
    """Stiffness K of the contact of two spheres, or of a sphere and a plane.

    Parameters
    ----------
    R_1, R_2 : float, m
        Radii; inf is a plane.

    Returns
    -------
    float
        K = (4/3) E* sqrt(R), N/m^1.5, with 1/R = 1/R_1 + 1/R_2.

    Raises
    ------
    ValueError
        A modulus or radius that is not positive.

    Source: Hertz 1882, F = K delta^(3/2).

    >>> hertz_stiffness(3.0, 4.0)
    8.0
    """
    for name, R in (("R_1", R_1), ("R_2", R_2)):
        if not R > 0:
            raise ValueError(f"`{name}` is {R:g}; a radius is positive (inf: a plane).")
    return 4 / 3 * E_star * sqrt(1 / (1 / R_1 + 1 / R_2))


@checks.door(**dict.fromkeys(("E_star", "R_J", "R_B"), checks.positive))
@checks.closed_form
def journal_stiffness(E_star: float, R_B: float, R_J: float) -> float:
    """Stiffness K of a journal in its bearing.

    Parameters
    ----------
    R_B, R_J : float, m
        Radii of the bearing and of the journal, R_J < R_B.

    Returns
    -------
    float
        K = (4/3) E* sqrt(R), N/m^1.5, with R = R_B R_J/(R_B - R_J): the formula of spheres, which is in use for
        internal cylinders too.

    Raises
    ------
    ValueError
        R_J >= R_B: the journal does not fit; a modulus or radius that is not positive.

    Source: Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545.

    >>> round(journal_stiffness(composite_modulus(207e9, 0.3), 0.01, 0.0095) / 1e10, 3)
    6.61
    """
    if not R_J < R_B:
        raise ValueError(
            f"`R_J` is {R_J:g} and `R_B` is {R_B:g}; the journal must be smaller than its bearing, by the clearance."
        )
    return 4 / 3 * E_star * sqrt(R_B * R_J / (R_B - R_J))
