"""The Stribeck curve that several laws share: g(v) = F_c + (F_s - F_c) exp(-|v/v_s|^2)."""

import sympy as sp

from ..contract import Law


def stribeck(v, p):
    """g(v) of the parameters F_c, F_s, v_s: even and smooth, so that v = 0 is no surface of it; v may be a vector."""
    return p.F_c + (p.F_s - p.F_c) * fading(v, p.v_s)


def fading(v, scale):
    """exp(-|v/scale|^2) of a velocity, or of its components."""
    parts = v if isinstance(v, tuple) else (v,)
    return sp.exp(-sp.Add(*((part / scale) ** 2 for part in parts)))


class StribeckLaw(Law):
    """A law with static friction F_s, no smaller than the kinetic one; steady on the Stribeck curve."""

    kind = "friction"
    F_c: float
    F_s: float

    def check(self):
        if self.F_s < self.F_c:
            raise ValueError(
                f"`F_s` of {type(self).__name__} is {self.F_s:g}, below `F_c` = {self.F_c:g}; static friction is at "
                "least the kinetic one."
            )

    def steady(self, v, p):
        return stribeck(v, p) * sp.sign(v) + p.sigma2 * v
