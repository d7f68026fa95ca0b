"""LuGre: bristles of mean deflection z.

    dz/dt = v - sigma0 |v| z/g(v),     f = sigma0 z + sigma1(v) dz/dt + sigma2 v

v = 0 is a kink (|v|). Stiff with speed: the rate sigma0 |v|/g grows without bound. Drifts under small forces.
Passive for all inputs if and only if sigma2 >= sigma1 (F_s - F_c)/F_c (Barahanov, Ortega 2000), which the standard
parameters violate; sigma1 that falls off with speed, sigma1 <= 4 g(v)/|v|, is a cure.
"""

import math

from ..contract import Pieces, law, parameter
from .stribeck import StribeckLaw, fading, stribeck


@law
class LuGre(StribeckLaw):
    """LuGre's law with constant bristle damping.

    The defaults are the standard example's (for 1 kg).

    Stick-slip of a 1 kg block on a slowly pulled spring:

    >>> solution = block_on_belt(LuGre(), t_span=(0, 30)).solve()
    >>> print(f"largest force of the spring {2 * solution['elongation'].max():.2f} N")
    largest force of the spring 1.51 N
    """

    source = "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995) 419-425"
    in_plane = True
    sigma0: float = parameter(1e5, "N/m", "bristle stiffness")
    sigma1: float = parameter(math.sqrt(1e5), "N s/m", "bristle damping", "nonnegative")
    sigma2: float = parameter(0.4, "N s/m", "viscous friction", "nonnegative")
    F_c: float = parameter(1.0, "N", "Coulomb force")
    F_s: float = parameter(1.5, "N", "static friction force")
    v_s: float = parameter(1e-3, "m/s", "Stribeck velocity")

    def pieces(self, at, p):
        z, v = at.deflection("z", scale=self.F_c / self.sigma0), at.v
        pull, damping = p.sigma0 * at.speed() / stribeck(v, p), self.damping(v, p)
        rate = at.each(lambda z, v: v - pull * z, z, v)
        force = at.each(lambda z, dz, v: p.sigma0 * z + damping * dz + p.sigma2 * v, z, rate, v)
        return Pieces(force=force, rates=at.rates(z, rate), surfaces=at.surfaces, fastest_rate=pull)

    def damping(self, v, p):
        """Bristle damping sigma1(v).

        Parameters
        ----------
        v : Expr
            Velocity.

        Returns
        -------
        Expr
            In the unit of sigma1.
        """
        return p.sigma1


@law
class LuGreFadingDamping(LuGre):
    """LuGre's law with sigma1(v) = sigma1 exp(-(v/v_d)^2), which keeps it passive.

    The force at constant speed is that of LuGre's law:

    >>> float(LuGreFadingDamping(v_d=1e-3).steady_force(0.1) - LuGre().steady_force(0.1))
    0.0
    """

    v_d: float = parameter(1e-3, "m/s", "velocity at which the bristle damping fades")

    def damping(self, v, p):
        return p.sigma1 * fading(v, p.v_d)
