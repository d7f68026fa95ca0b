"""Moments that resist a contact's rolling and spinning: Coulomb's law of an angular velocity.

    M = N f omega/|omega|  of rolling, f the lever arm of the load;    M = mu N r_m sgn omega  of spinning

The load stands ahead of the contact's centre by f, of a wheel or a ball. A contact that only spins has the moment of
its friction over the distance from the centre, r_m = 2/3 R under uniform pressure, 3 pi/16 R under Hertz's, R on a
ring; one that slides as well has less, which is `Contensou`.
"""

import sympy as sp

from ..contract import Law, Pieces, law, parameter

_LEVERS = {"uniform": sp.Rational(2, 3), "Hertz": 3 * sp.pi / 16, "ring": sp.S.One}


@law
class RollingResistance(Law):
    """Rolling resistance: a moment against the rolling of a wheel or, with two components of it, of a ball.

    Its velocity is the angular one and its force a moment; with a normal load M_c is the lever arm, in m. It holds a
    wheel of radius r on a slope up to tan(slope) = M_c/r.

    >>> omega = sp.symbols("omega_x omega_y", real=True)
    >>> RollingResistance().attach(velocity=omega).force
    (lam_x*M_c + c*omega_x, lam_y*M_c + c*omega_y)
    """

    kind = "friction"
    source = "Coulomb 1785 on rolling; the lever arm of the load of every textbook of mechanics"
    in_plane = True
    M_c: float = parameter(1e-3, "N m", "rolling moment")
    c: float = parameter(0.0, "N m s/rad", "viscous part", "nonnegative")

    def pieces(self, at, p):
        moment = at.each(lambda lam, w: p.M_c * lam + p.c * w, at.slip("lam"), at.v)
        return Pieces(force=moment, surfaces=at.surfaces)

    def steady(self, v, p):
        return p.M_c * sp.sign(v) + p.c * v


@law
class TorsionalResistance(Law):
    """The moment of Coulomb friction against a pure spin of a contact; its velocity is that of the spin.

    >>> law = TorsionalResistance(F_c=3.0, R=0.5, pressure="Hertz")
    >>> print(f"{float(law.steady_force(1.0)):.6f}")
    0.883573
    """

    kind = "friction"
    source = (
        "integral of mu p r over the contact; Hertz's pressure: Lurie, as in Johnson, Contact Mechanics, 1985"
    )
    F_c: float = parameter(1.0, "N", "Coulomb force")
    R: float = parameter(1.0, "m", "radius of the contact")
    pressure: str = parameter(
        "uniform", "1", "The pressure over the contact", choices=("uniform", "Hertz", "ring")
    )

    def pieces(self, at, p):
        return Pieces(force=_LEVERS[self.pressure] * p.F_c * p.R * at.slip("lam"), surfaces=at.surfaces)

    def steady(self, v, p):
        return _LEVERS[self.pressure] * p.F_c * p.R * sp.sign(v)
