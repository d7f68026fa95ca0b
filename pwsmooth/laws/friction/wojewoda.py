"""Acceleration-dependent friction: a higher force while the sliding body accelerates than while it slows down.

    f = f_c [1 + (f_s - f_c)/f_c exp(-a_1 |v|/(|a| + a_2)) sgn(v a)] sgn v,   a = dv/dt

The formula is the group's of 2003 as recalled, not checked against the paper of 2008. It is implicit in a, which a
body's scene solves for; surfaces v = 0 and a = 0 (motion at constant speed for a band of forces).
"""

import sympy as sp

from ..contract import Law, Pieces, law, parameter


@law
class Wojewoda(Law):
    """Wojewoda's non-reversible friction: more force while accelerating than while slowing down.

    The defaults are chosen.

    The force is larger while the body accelerates (a > 0) than while it slows down:

    >>> v, a = sp.symbols("v a", real=True)
    >>> pieces = Wojewoda(f_c=1.0, f_s=1.5).attach(velocity=v, acceleration=a)
    >>> pieces.force
    lam*f_c + lam_a*(-f_c + f_s)*exp(-a_1*Abs(v)/(a_2 + Abs(a)))
    """

    kind = "friction"
    source = (
        "Wojewoda, Stefanski, Wiercigroch, Kapitaniak, Phil. Trans. R. Soc. A 366 (2008) 747-765; as recalled"
    )
    certainty = "reconstructed"
    needs = ("acceleration",)
    f_c: float = parameter(1.0, "N", "Coulomb force")
    f_s: float = parameter(1.5, "N", "static friction force")
    a_1: float = parameter(1.0, "1/s", "rate of the fall with speed")
    a_2: float = parameter(0.1, "m/s^2", "acceleration offset")

    def check(self):
        if self.f_s < self.f_c:
            raise ValueError(
                f"`f_s` of Wojewoda is {self.f_s:g}, below `f_c` = {self.f_c:g}; then the acceleration would not "
                "be unique."
            )

    def pieces(self, at, p):
        v, a = at.v, at.a
        fall = sp.exp(-p.a_1 * sp.Abs(v) / (sp.Abs(a) + p.a_2))
        # sgn(v a) sgn v = sgn a where v is not 0
        force = p.f_c * at.switch("lam", v) + (p.f_s - p.f_c) * fall * at.switch("lam_a", a)
        return Pieces(force=force, surfaces=(v, a))

    def steady(self, v, p):
        return p.f_c * sp.sign(v)
