"""The elastoplastic law: LuGre's bristles with a purely elastic range, in which nothing drifts.

    dz/dt = v (1 - alpha(z, v) sgn(v) z/z_ss(v)),   z_ss = g(v)/sigma0,   f = sigma0 z + sigma1 dz/dt + sigma2 v

alpha is 0 while w = z sgn(v) <= z_ba, 1 from w >= z_max on, half a sine between (in |z|; written in w, which is the
same where alpha acts and includes that alpha = 0 where z opposes v). In the plane only the part of v along z is
plastic,

    dz/dt = v - alpha(|z|, v) max(0, z.v) z/(|z| z_ss)

which is the law above on a line, never leaves |z| <= z_ss and is continuous.
"""

import sympy as sp

from ..contract import Pieces, law, parameter
from .lugre import LuGre
from .stribeck import stribeck


@law
class Elastoplastic(LuGre):
    """Dupont's elastoplastic law with z_max = z_ss(v), which holds at all speeds.

    Below break-away nothing drifts; a force that comes and goes ten times leaves the body where it was:

    >>> pulses = 0.6 * sp.sin(sp.pi * t) ** 2
    >>> ends = [force_driven(law, pulses, t_span=(0, 10)).solve()["x"][-1] for law in (Elastoplastic(), LuGre())]
    >>> print(", ".join(f"{1e6 * abs(end):.2f} um" for end in ends))
    0.00 um, 26.17 um
    """

    source = "Dupont, Hayward, Armstrong, Altpeter, IEEE TAC 47 (2002) 787-792"
    z_ba: float = parameter(7e-6, "m", "break-away deflection")

    def check(self):
        super().check()
        if not self.z_ba < self.F_c / self.sigma0:
            raise ValueError(
                f"`z_ba` of {type(self).__name__} is {self.z_ba:g}, not below z_max, which falls to F_c/sigma0 = "
                f"{self.F_c / self.sigma0:g} with speed; give a smaller one."
            )

    def pieces(self, at, p):
        z, v = at.deflection("z", scale=self.F_c / self.sigma0), at.v
        steady = stribeck(v, p) / p.sigma0
        z_max = self.z_max_of(steady, p)
        # Steady slip is at z_max. A surface there would be met again and again by rounding; up to this one
        # alpha is 1 to rounding.
        top = z_max * (1 + 2.0**-28)

        def rise(w):
            """alpha between z_ba and z_max"""
            return (1 + sp.sin(sp.pi * (w - (z_max + p.z_ba) / 2) / (z_max - p.z_ba))) / 2

        def slip(w):
            """alpha(w) w/z_ss, w = z sgn(v)"""
            alpha = sp.Piecewise((0, w <= p.z_ba), (rise(w), w < top), (1, True))
            return alpha * w / steady

        if at.planar:
            square, along = at.dot(z, z), at.dot(z, v) / p.z_ba
            size = p.z_ba * sp.sqrt(sp.Max(1, square / p.z_ba**2))  # where alpha acts; at z_ba it rises from 0
            alpha = sp.Piecewise((rise(size), square / top**2 < 1), (1, True))
            pull = alpha * sp.Max(0, along) * p.z_ba / (size * steady)
            rate = at.each(lambda z, v: v - pull * z, z, v)
            turns, fastest = (along,), pull
        else:
            # Written for each sign of v, so that no surface jumps where v turns.
            rate = v * sp.Piecewise((1 - slip(z), v > 0), (1 - slip(-z), True))
            turns, fastest = (v,), sp.Abs(v) / steady
        force = at.each(lambda z, dz, v: p.sigma0 * z + p.sigma1 * dz + p.sigma2 * v, z, rate, v)
        surfaces = (*turns, *at.bounds(z, p.z_ba), *at.bounds(z, top))
        return Pieces(force=force, rates=at.rates(z, rate), surfaces=surfaces, fastest_rate=fastest)

    def z_max_of(self, steady, p):
        """Deflection from which the bristles slip wholly.

        Parameters
        ----------
        steady : Expr
            z_ss(v), m.

        Returns
        -------
        Expr
            z_max, m.
        """
        return steady


@law
class ElastoplasticFixed(Elastoplastic):
    """Dupont's elastoplastic law with a constant z_max, for presliding: at speed z_ss falls below it.

    Its elastic range ends at sigma0 z_ba = 1.3 N; below nothing drifts:

    >>> pulses = 1.2 * sp.sin(sp.pi * t) ** 2
    >>> solution = force_driven(ElastoplasticFixed(), pulses, t_span=(0, 10)).solve()
    >>> print(f"{1e6 * abs(solution['x'][-1]):.2f} um")
    0.00 um
    """

    z_ba: float = parameter(13e-6, "m", "break-away deflection")
    z_max: float = parameter(15e-6, "m", "deflection from which the bristles slip wholly")

    def check(self):
        LuGre.check(self)
        if not self.z_max > self.z_ba:
            raise ValueError(
                f"`z_max` of ElastoplasticFixed is {self.z_max:g}, not above `z_ba` = {self.z_ba:g}; alpha rises "
                "between them, so give z_max > z_ba."
            )
        # One rounding above: 1.5/1e5 is not the nearest number to 15e-6.
        if self.z_max > self.F_s / self.sigma0 * (1 + 1e-15):
            raise ValueError(
                f"`z_max` of ElastoplasticFixed is {self.z_max:g}, above F_s/sigma0 = {self.F_s / self.sigma0:g}; "
                "no bristle gets there: give z_max <= F_s/sigma0."
            )

    def z_max_of(self, steady, p):
        return p.z_max
