"""LuGre: bristles of mean deflection z.

    dz/dt = v - sigma0 |v| z/g(v),     f = sigma0 z + sigma1(v) dz/dt + sigma2 v

Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995) 419-425. v = 0 is a kink (|v|). Stiff with speed:
the rate sigma0 |v|/g grows without bound. Drifts under small forces; passive only if
sigma2 >= sigma1 (F_s - F_c)/F_c, or with sigma1 that falls off with speed.
"""

import math

import sympy as sp

from ..contract import Law, Pieces, law, parameter
from .stribeck import check_stribeck, stribeck


@law
class LuGre(Law):
    """LuGre's law; the defaults are the standard example's (1 kg, SI)."""

    source = "Canudas de Wit et al., IEEE TAC 40 (1995) 419-425"
    sigma0: float = parameter(1e5, "N/m", "bristle stiffness")
    sigma1: float = parameter(math.sqrt(1e5), "N s/m", "bristle damping", "nonnegative")
    sigma2: float = parameter(0.4, "N s/m", "viscous friction", "nonnegative")
    F_c: float = parameter(1.0, "N", "Coulomb force")
    F_s: float = parameter(1.5, "N", "static friction force")
    v_s: float = parameter(1e-3, "m/s", "Stribeck velocity")

    def check(self):
        check_stribeck(self)

    def pieces(self, at, p):
        z, v = at.state("z"), at.v
        pull = p.sigma0 * sp.Abs(v) / stribeck(v, p)
        rate = v - pull * z
        force = p.sigma0 * z + self.damping(v, p) * rate + p.sigma2 * v
        return Pieces(force=force, rates={z: rate}, surfaces=(v,), fastest_rate=pull)

    def damping(self, v, p):
        """sigma1(v)"""
        return p.sigma1
