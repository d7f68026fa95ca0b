"""The Stribeck curve that several laws share: g(v) = F_c + (F_s - F_c) exp(-|v/v_s|^2)."""

import sympy as sp

from ..contract import Law


def stribeck(v, p):
    """g(v) of the parameters F_c, F_s, v_s: even and smooth, so that v = 0 is no surface of it."""
    return p.F_c + (p.F_s - p.F_c) * sp.exp(-((v / p.v_s) ** 2))


class StribeckLaw(Law):
    """A law with static friction F_s, no smaller than the kinetic one; steady on the Stribeck curve."""

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
