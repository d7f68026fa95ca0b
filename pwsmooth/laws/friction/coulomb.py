"""Coulomb friction and its relatives: forces that switch with the velocity, without a bristle.

    f = g(v) Sgn(v) + sigma2 v

The multiplier lam of v = 0 is the friction force in sticking. Static friction above the kinetic one is either the
value g(0) of a Stribeck curve, or a hidden term: a part of f(lam) that vanishes in slip (lam = 1 or -1).
"""

import sympy as sp

from ..contract import Law, Pieces, law, parameter
from ..inclusions import clip
from .stribeck import StribeckLaw, stribeck


@law
class Coulomb(Law):
    """Coulomb friction, f = F_c Sgn(v) + sigma2 v.

    >>> Coulomb(F_c=2.0, sigma2=0.5).steady_force([-1.0, 2.0]).tolist()
    [-2.5, 3.0]
    """

    kind = "friction"
    source = "Coulomb 1785"
    in_plane = True
    F_c: float = parameter(1.0, "N", "Coulomb force")
    sigma2: float = parameter(0.0, "N s/m", "viscous friction", "nonnegative")

    def pieces(self, at, p):
        force = at.each(lambda lam, v: p.F_c * lam + p.sigma2 * v, at.slip("lam"), at.v)
        return Pieces(force=force, surfaces=at.surfaces)

    def steady(self, v, p):
        return p.F_c * sp.sign(v) + p.sigma2 * v


@law
class StaticKinetic(StribeckLaw):
    """Two levels: sticking up to F_s, slip at F_c; what exceeds F_c is a hidden term.

        f = F_c lam (1 + rho (1 - lam^2)) + sigma2 v,    max over lam of f = F_s at v = 0

    The fold of f(lam) is the break-away: rho solves 2 rho ((1 + rho)/(3 rho))^(3/2) = F_s/F_c.

    Under a slowly rising force the body breaks away at F_s, not at the force of slip:

    >>> solution = force_driven(StaticKinetic(F_c=1.0, F_s=1.5), 0.1 * t, t_span=(0, 20)).solve()
    >>> event = solution.events[-1]
    >>> print(event.kind, f"{0.1 * event.time:.9f}")
    slip by fold 1.500000000
    """

    source = (
        "two-level law as hidden dynamics; fold of Jeffrey, On the mathematical basis of solid friction, sec. 4"
    )
    in_plane = True
    F_c: float = parameter(1.0, "N", "kinetic friction force")
    F_s: float = parameter(1.5, "N", "static friction force")
    sigma2: float = parameter(0.0, "N s/m", "viscous friction", "nonnegative")

    @staticmethod
    def rho(p):
        """The root rho >= 1/2 of 4 (1 + rho)^3 = 27 r^2 rho, r = F_s/F_c, by its trigonometric form.

        Parameters
        ----------
        p : namespace
            With F_s and F_c, as numbers or symbols; of one unit.

        Returns
        -------
        Expr
            Strength of the hidden term, dimensionless.
        """
        r = p.F_s / p.F_c
        return 3 * r * sp.cos(sp.acos(-1 / r) / 3) - 1

    def pieces(self, at, p):
        slip = at.slip("lam")
        level = p.F_c * (1 + self.rho(p) * (1 - at.square(slip)))
        return Pieces(
            force=at.each(lambda lam, v: level * lam + p.sigma2 * v, slip, at.v), surfaces=at.surfaces
        )

    def steady(self, v, p):
        return p.F_c * sp.sign(v) + p.sigma2 * v


@law
class VelocityWeakening(StaticKinetic):
    """Friction that falls as 1/v, with two levels at rest: sticking up to F_s, from where slip begins at F_c.

        f = F_c lam (1 + rho (1 - lam^2))/(1 + |v|/v_w) + sigma2 v,    rho as of StaticKinetic

    In Carlson and Langer's scaling v_w = 1/(2 alpha), where F_s = F_c.

    >>> VelocityWeakening(F_c=1.0, F_s=1.2, v_w=0.5).steady_force([-0.5, 1.5]).tolist()
    [-0.5, 0.25]
    """

    source = "Carlson, Langer, Phys. Rev. A 40 (1989) 6470-6484; two levels at rest added"
    in_plane = False
    v_w: float = parameter(0.5, "m/s", "velocity that halves friction")

    def pieces(self, at, p):
        lam, v = at.slip("lam"), at.v
        level = p.F_c * (1 + self.rho(p) * (1 - lam**2)) / (1 + at.speed() / p.v_w)
        return Pieces(force=level * lam + p.sigma2 * v, surfaces=at.surfaces)

    def steady(self, v, p):
        return p.F_c * sp.sign(v) / (1 + sp.Abs(v) / p.v_w) + p.sigma2 * v


@law
class StribeckFriction(StribeckLaw):
    """Stribeck friction, f = g(v) Sgn(v) + sigma2 v: the limit of LuGre and XKY for stiff bristles.

    >>> law = StribeckFriction(F_c=1.0, F_s=1.5, v_s=1e-3, sigma2=0.0)
    >>> [round(force, 6) for force in law.steady_force([1e-9, 1e-3, 1e-2]).tolist()]
    [1.5, 1.18394, 1.0]
    """

    source = "Stribeck 1902; the switching block g(v) Sgn(v) of Kikuuwe et al. 2006"
    in_plane = True
    F_c: float = parameter(1.0, "N", "Coulomb force")
    F_s: float = parameter(1.5, "N", "static friction force")
    v_s: float = parameter(1e-3, "m/s", "Stribeck velocity")
    sigma2: float = parameter(0.4, "N s/m", "viscous friction", "nonnegative")

    def pieces(self, at, p):
        level = stribeck(at.v, p)
        force = at.each(lambda lam, v: level * lam + p.sigma2 * v, at.slip("lam"), at.v)
        return Pieces(force=force, surfaces=at.surfaces)


@law
class HiddenStatic(Law):
    """Static friction as a hidden state z that relaxes to gamma(lam) = 1 - lam^2 in the time beta.

    f = F_c lam (1 + rho z),    beta dz/dt = 1 - lam^2 - z

    >>> v = sp.Symbol("v", real=True)
    >>> pieces = HiddenStatic(F_c=1.0, rho=3.0).attach(velocity=v)
    >>> pieces.force
    lam*F_c*(rho*z + 1)
    >>> pieces.rates
    {z: (-lam**2 - z + 1)/beta}
    """

    kind = "friction"
    source = "Jeffrey, On the mathematical basis of solid friction, eq. (25)"
    in_plane = True
    F_c: float = parameter(1.0, "N", "kinetic friction force")
    rho: float = parameter(3.0, "1", "strength of static friction", "nonnegative")
    beta: float = parameter(0.1, "s", "relaxation time")

    def pieces(self, at, p):
        slip, z = at.slip("lam"), at.state("z")
        return Pieces(
            force=at.each(lambda lam: p.F_c * lam * (1 + p.rho * z), slip),
            rates={z: (1 - at.square(slip) - z) / p.beta},
            surfaces=at.surfaces,
            fastest_rate=1 / p.beta,
        )

    def steady(self, v, p):
        return p.F_c * sp.sign(v)


@law
class ModifiedCoulomb(Law):
    """Regularised: no force below v_0, linear up to v_1, F_c above; it creeps and never sticks.

    f = F_c c_d sgn(v),  c_d = clip((|v| - v_0)/(v_1 - v_0), 0, 1)  =  F_c (clip(v, v_1) - clip(v, v_0))/(v_1 - v_0)

    >>> law = ModifiedCoulomb(F_c=2.0, v_0=0.1, v_1=0.3)
    >>> [round(float(law.steady_force(v)), 9) for v in (0.05, 0.2, 1.0)]
    [0.0, 1.0, 2.0]
    """

    kind = "friction"
    source = "Ambrosio 2003, as in Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545; v_0, v_1 chosen"
    F_c: float = parameter(1.0, "N", "kinetic friction force")
    v_0: float = parameter(1e-4, "m/s", "velocity up to which there is no force")
    v_1: float = parameter(1e-3, "m/s", "velocity from which the force is full")

    def check(self):
        if not self.v_1 > self.v_0:
            raise ValueError(
                f"`v_1` of ModifiedCoulomb is {self.v_1:g}, not above `v_0` = {self.v_0:g}; the force rises "
                "between them, so give v_1 > v_0."
            )

    def pieces(self, at, p):
        v = at.v
        return Pieces(
            force=self.steady(v, p), surfaces=(v - p.v_0, v + p.v_0, v - p.v_1, v + p.v_1)
        )  # the second form has no surface v = 0

    def steady(self, v, p):
        low, high = clip(v, p.v_0), clip(v, p.v_1)
        return p.F_c * (high - low) / (p.v_1 - p.v_0)
