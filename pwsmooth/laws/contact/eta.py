"""The table of damping factors eta(c_r) of the laws F = g(delta) (1 + eta v/v0).

Each law was derived so that its restitution comes near c_r; what it really is follows from `restitution(eta)`,
whatever g, the mass and the speed are. Where the formula was looked up stands in `source`.
Chain: restitution.py -> eta (here) -> impact.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import sympy as sp

from ...door import checks
from ...door.documenting import complete
from .restitution import exact_eta, restitution

__all__ = ["ETA", "Factor", "damping_factor", "effective_restitution"]


@complete
class Factor(NamedTuple):
    """One entry of the table `ETA`.

    Attributes
    ----------
    formula : callable
        c_r -> eta, both dimensionless; a number or an expression.
    source : str
        Where the formula comes from.

    Source: each entry has its own.

    >>> ETA["hunt-crossley"].formula(0.5)
    0.750000000000000
    """

    formula: Callable[[Any], Any]
    source: str


def _zhiying_qishao(c):
    return sp.Rational(3, 4) * (1 - c**2) * sp.exp(2 * (1 - c))


_KNOWN = "recalled from the literature, checked against a public implementation"
#: The table: name of a law -> its `Factor`.
ETA: dict[str, Factor] = {
    "hunt-crossley": Factor(lambda c: sp.Rational(3, 2) * (1 - c), f"Hunt, Crossley 1975; {_KNOWN}"),
    "herbert-mcwhannell": Factor(
        lambda c: 6 * (1 - c) / ((2 * c - 1) ** 2 + 3), f"Herbert, McWhannell 1977; {_KNOWN}"
    ),
    "lee-wang": Factor(lambda c: sp.Rational(3, 4) * (1 - c), f"Lee, Wang 1983; {_KNOWN}"),
    "lankarani-nikravesh": Factor(
        lambda c: sp.Rational(3, 4) * (1 - c**2),
        "Lankarani, Nikravesh 1990; the tables of Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545",
    ),
    "gonthier": Factor(lambda c: (1 - c**2) / c, f"Gonthier et al. 2004, its approximation; {_KNOWN}"),
    "zhang-sharf": Factor(exact_eta, "Zhang, Sharf 2004: the exact root, so that c_r is the restitution"),
    "zhiying-qishao": Factor(_zhiying_qishao, f"Zhiying, Qishao 2006; {_KNOWN}"),
    "wang-liu-ma": Factor(
        _zhiying_qishao,
        "Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, misprints corrected by its own tables; the "
        "factor of Zhiying and Qishao",
    ),
    "flores": Factor(lambda c: 8 * (1 - c) / (5 * c), f"Flores et al. 2011; {_KNOWN}"),
    "hu-guo": Factor(lambda c: 3 * (1 - c) / (2 * c), "Hu, Guo 2015, recalled from the literature"),
}


@checks.door(name=lambda value, what: checks.one_of(*ETA)(value, f"{what} of `eta`"))
def damping_factor(name: str, c_r: Any) -> Any:
    """The factor eta of a law of the table at `c_r`.

    Parameters
    ----------
    c_r : float or Expr, dimensionless
        Coefficient of restitution that is aimed at, > 0 and <= 1; an expression but for "zhang-sharf".

    Returns
    -------
    float or Expr
        Damping factor, dimensionless.

    Raises
    ------
    ValueError
        An unknown name, or c_r outside (0, 1].

    Source: that of the entry, `ETA[name].source`.

    >>> float(damping_factor("lankarani-nikravesh", 0.5))
    0.5625
    """
    c_r = checks.expression(c_r, "`c_r`") if isinstance(c_r, sp.Basic) else c_r
    if not isinstance(c_r, sp.Basic) or c_r.is_number:
        check_c_r(c_r)
    return ETA[name].formula(c_r)


@checks.door(c_r=checks.number)
def effective_restitution(name: str, c_r: float) -> float:
    """The restitution that a law of the table really has when it is asked for `c_r`.

    Parameters
    ----------
    c_r : float, dimensionless
        Coefficient of restitution that is aimed at, > 0 and <= 1.

    Returns
    -------
    float
        `restitution` at the law's factor, dimensionless; it depends neither on the speed nor on the mass.

    Raises
    ------
    ValueError
        An unknown name, or c_r outside (0, 1].

    Source: derived here, by the closed form of `restitution`.

    >>> round(effective_restitution("lankarani-nikravesh", 0.5), 6)
    0.725241
    """
    return float(restitution(float(damping_factor(name, c_r))))


def check_c_r(c_r, what="`c_r`"):
    """A coefficient of restitution is above 0 (where these laws divide by it) and at most 1."""
    if not 0 < checks.number(c_r, what) <= 1:
        raise ValueError(f"{what} is {c_r:g}; a coefficient of restitution must be > 0 and <= 1.")
