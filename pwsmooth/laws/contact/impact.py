"""Laws with a restitution: F = g(delta) (1 + eta(c_r) v/v0), v0 the speed at this contact's touch-down.

One law with a table of eta (eta.py) and three elastic parts g:

    HertzImpact   g = K delta^n
    LiuImpact     g = (pi E* L/2) delta^(3/2) / sqrt(2 (c + delta))                       a journal in its bearing
    BaiImpact     g = (pi E* L/8) delta sqrt(2 delta (3 c + 2 delta)^2/(c + delta)^3)     its tangent stiffness

v0 is hidden discrete memory: the touch-down event latches it. Lankarani and Nikravesh's law is HertzImpact with
"lankarani-nikravesh"; Wang, Liu and Ma's LiuImpact with "wang-liu-ma"; Wang and Liu's hybrid of 2015 LiuImpact with
"lankarani-nikravesh"; Bai's hybrid BaiImpact with "zhiying-qishao".
Sources: Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545 (misprints corrected by its own tables).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ...definition.primitives import Event
from ..contract import law, parameter
from .eta import ETA, check_c_r, damping_factor
from .wall import AtWall

RELEASES = ("zero force", "zero indentation")


@law
class ImpactLaw(AtWall):
    """What the three elastic parts share; not a law by itself."""

    c_r: float = parameter(0.9, "1", "coefficient of restitution that is aimed at")
    eta: str = parameter(
        "lankarani-nikravesh", "1", "damping factor, by its name in the table", choices=tuple(ETA)
    )
    # A re-contact at vanishing speed would have infinite damping.
    slowest: float = parameter(1e-6, "m/s", "floor of the latched speed")
    release: str = parameter(RELEASES[0], "1", "where contact ends under a pull", choices=RELEASES)

    def check(self):
        check_c_r(self.c_r, f"`c_r` of {type(self).__name__}")

    def elastic(self, d: Any, p: Any) -> Any:
        """Elastic force g(delta), N, at an indentation d > 0, m; `p` holds the parameters' symbols or values."""
        raise NotImplementedError

    def potential(self, d: Any, p: Any) -> Any:
        """Work of the elastic force, G(delta), J; arguments as of `elastic`."""
        raise NotImplementedError

    def pieces(self, at, p):
        d, v, surface = at.x, at.v, at.beyond(0)
        speed = at.memory("speed", self.slowest, positive=True)
        # The exact root has no form in symbols.
        exact = self.eta == "zhang-sharf"
        factor = sp.Float(damping_factor(self.eta, self.c_r)) if exact else damping_factor(self.eta, p.c_r)
        damping = 1 + factor * v / speed
        pushing = sp.Max(0, damping) if self.release == "zero force" else damping
        touch_down = [
            # The latched speed is that of the instant of touch-down, before anything else acts.
            Event(surface, direction=1, update={speed: v}, when=v >= p.slowest, name=at.label("touch-down")),
            Event(surface, direction=1, update={speed: p.slowest}, when=v < p.slowest,
                  name=at.label("slow touch-down")),
        ]  # fmt: skip
        return self._pieces(
            at,
            surface,
            self.elastic(d, p) * pushing,
            self.potential(d, p),
            touch_down=touch_down,
            surfaces=(damping,),
        )


@law
class HertzImpact(ImpactLaw):
    """The elastic part g = K delta^n: Hunt and Crossley, Lankarani and Nikravesh, Flores, ... by the choice of eta.

    >>> law = HertzImpact(K=1e9, c_r=0.5, eta="lankarani-nikravesh")
    >>> print(f"asked for {law.c_r}, has {effective_restitution(law.eta, law.c_r):.4f}")
    asked for 0.5, has 0.7252
    """

    source = "Hunt, Crossley 1975; Lankarani, Nikravesh 1990; and the table eta.py"
    K: float = parameter(1e5, "N/m^n", "stiffness")
    n: float = parameter(1.5, "1", "exponent, 3/2 for Hertz's contact", structural=True)

    def elastic(self, d, p):
        return p.K * d**p.n

    def potential(self, d, p):
        return p.K * d ** (p.n + 1) / (p.n + 1)


# Gauss-Legendre on [0, 1]: int_0^d s^1.5 q(s) ds = 2 d^2.5 int_0^1 u^4 q(d u^2) du has a smooth integrand, where
# the closed form with asinh cancels for d << c; ten nodes are exact to rounding for d < c.
_NODES, _WEIGHTS = (a.tolist() for a in np.polynomial.legendre.leggauss(10))


@law
class _JournalLaw(ImpactLaw):
    """g = delta^1.5 q(delta) of a journal in a bearing."""

    E_star: float = parameter(1.1373626e11, "Pa", "composite modulus")
    length: float = parameter(0.015, "m", "length of the joint")
    clearance: float = parameter(5e-4, "m", "radial clearance")

    def slope(self, d: Any, p: Any) -> Any:
        """Elastic force over its power of the indentation, q(delta) = g(delta)/delta^1.5.

        Parameters
        ----------
        d : Expr
            Indentation delta, m.
        p : namespace
            The parameters' symbols or values.

        Returns
        -------
        Expr
            N/m^1.5.
        """
        raise NotImplementedError

    def elastic(self, d, p):
        return d ** sp.Rational(3, 2) * self.slope(d, p)

    def potential(self, d, p):
        terms = [(w / 2, ((1 + u) / 2) ** 2) for u, w in zip(_NODES, _WEIGHTS)]
        return 2 * d ** sp.Rational(5, 2) * sum(w * u2**2 * self.slope(d * u2, p) for w, u2 in terms)


@law
class LiuImpact(_JournalLaw):
    """Liu's stiffness of a journal in its bearing; with "wang-liu-ma" the law of Wang, Liu and Ma.

    >>> d, v = sp.symbols("d v", real=True)
    >>> pieces = LiuImpact(clearance=5e-4).attach(position=d, velocity=v)
    >>> [event.name for event in pieces.events]
    ['touch-down', 'slow touch-down', 'lift-off']
    """

    source = "Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, after Liu et al."
    eta: str = parameter("wang-liu-ma", "1", "damping factor, by its name in the table", choices=tuple(ETA))

    def slope(self, d, p):
        return sp.pi * p.E_star * p.length / (2 * sp.sqrt(2)) / sp.sqrt(p.clearance + d)


@law
class BaiImpact(_JournalLaw):
    """Bai's hybrid: the tangent stiffness of Liu's force per length, and Zhiying and Qishao's factor.

    Well inside the clearance it is 3/2 times Liu's force, as a tangent to delta^(3/2) is:

    >>> from types import SimpleNamespace
    >>> laws = BaiImpact(clearance=5e-4), LiuImpact(clearance=5e-4)
    >>> bai, liu = (float(law.elastic(1e-9, SimpleNamespace(**law.values))) for law in laws)
    >>> print(f"{bai / liu:.5f}")
    1.50000
    """

    source = "Bai et al., recalled from the literature; the stiffness verified as the tangent of Liu's"
    eta: str = parameter("zhiying-qishao", "1", "damping factor, by its name in the table", choices=tuple(ETA))

    def slope(self, d, p):
        c = p.clearance
        return sp.sqrt(2) * sp.pi * p.E_star * p.length / 8 * (3 * c + 2 * d) / (c + d) ** sp.Rational(3, 2)
