"""Generalised Maxwell-slip: elements that stick or slip, with a Stribeck curve and frictional lag in slip.

    stick: dz_i/dt = v;    slip: kappa_i dz_i/dt = C (lam_i sgn v - kappa_i z_i/s(v))
    f = sum (kappa_i z_i + sigma_i dz_i/dt) + sigma2 v

Stick -> slip where |kappa_i z_i| reaches lam_i s(v) (outwards), slip -> stick where v crosses zero: hybrid modes,
here a Memory for each element. s is even: the form sgn(v) C (lam_i - F_i/s) needs an odd one. In the plane the
size of z_i obeys this equation and its direction turns with v across it,

    slip: dz_i/dt = v - (n.v) n + C/kappa_i (lam_i - kappa_i |z_i|/s(v)) n,   n = z_i/|z_i|

until z_i.v falls through zero.
"""

import sympy as sp

from ...definition.primitives import Event
from ..contract import Pieces, law, parameter
from .stribeck import StribeckLaw, stribeck


@law
class GMS(StribeckLaw):
    """Generalised Maxwell-slip: elements that stick or slip, with a Stribeck curve and lag in slip.

    The defaults are the reference set of the multistate law (chosen), with C = F_c/tau_d.

    A single element, and ten:

    >>> GMS(kappa=1.0, share=1.0, sigma=0.0).elements, GMS().elements
    (1, 10)
    >>> [round(float(GMS().steady_force(v)), 6) for v in (1e-6, 8.0, 80.0)]
    [2.0, 1.367879, 1.0]
    """

    in_plane = True
    source = "Al-Bender, Lampaert, Swevers, IEEE TAC 50 (2005) 1883-1887; sigma_i as in Xiong et al. 2013"
    F_c: float = parameter(1.0, "N", "Coulomb force")
    F_s: float = parameter(2.0, "N", "static friction force")
    v_s: float = parameter(8.0, "um/s", "Stribeck velocity")
    C: float = parameter(50.0, "N/s", "rate of attraction in slip")
    kappa: tuple = parameter(tuple(2.5 / i for i in range(1, 11)), "N/um", "stiffness", each=True)
    share: tuple = parameter((0.1,) * 10, "1", "share of the strength", each=True)
    sigma: tuple = parameter((0.01,) * 10, "N s/um", "micro-damping", "nonnegative", each=True)
    sigma2: float = parameter(0.0, "N s/um", "viscous friction", "nonnegative")

    def pieces(self, at, p):
        elements, v = at.family(self.elements), at.v
        z = at.deflection("z", scale=self.F_s / max(self.kappas()), family=elements)
        # 0 while it sticks, else the direction of slip (in the plane 1), in which v cannot turn without sticking first.
        slip = elements.memory(at.label("slip"), 0)
        threshold = p.share * stribeck(v, p)
        along, square = at.dot(z, v), at.dot(z, z)
        if at.planar:
            # In slip kappa |z| never falls below share F_c, so that half of it changes nothing but a root of zero.
            least = p.share * p.F_c / p.kappa / 2
            size = least * sp.sqrt(sp.Max(1, square / least**2))
            radial = p.C / p.kappa * p.share * (1 - p.kappa * size / threshold) - along / size
            attraction = at.each(lambda z, v: v + radial * z / size, z, v)
            turns, begins = along, 1
        else:
            attraction = p.C / p.kappa * p.share * (slip - p.kappa * z / threshold)
            turns, begins = v, sp.sign(z)
        rate = at.each(lambda v, slides: sp.Piecewise((v, sp.Eq(slip, 0)), (slides, True)), v, attraction)
        events = (
            Event((1 - slip**2) * square * (p.kappa / threshold) ** 2 - 1, direction=1, update={slip: begins},
                  when=along > 0, name=at.label("slip")),
            Event(turns, direction=-1 if at.planar else 0, when=sp.Ne(slip, 0), update={slip: 0},
                  name=at.label("stick")),
        )  # fmt: skip
        return Pieces(
            force=at.each(lambda z, dz, v: elements.sum(p.kappa * z + p.sigma * dz) + p.sigma2 * v, z, rate, v),
            rates=at.rates(z, rate),
            events=events,
            outputs={"presliding": elements.sum(1 - slip**2)},
            surfaces=(turns, *at.bounds(at.each(lambda z: p.kappa * z, z), threshold)),
            fastest_rate=p.C / stribeck(v, p),
        )

    def kappas(self):
        """Stiffnesses of the elements.

        Returns
        -------
        tuple of float
            kappa_i, in the unit of `kappa`.
        """
        return self.kappa if isinstance(self.kappa, tuple) else (self.kappa,)
