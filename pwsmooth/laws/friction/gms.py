"""Generalised Maxwell-slip: elements that stick or slip, with a Stribeck curve and frictional lag in slip.

    stick: dz_i/dt = v;    slip: kappa_i dz_i/dt = C (lam_i sgn v - kappa_i z_i/s(v))
    f = sum (kappa_i z_i + sigma_i dz_i/dt) + sigma2 v

Stick -> slip where |kappa_i z_i| reaches lam_i s(v) (outwards), slip -> stick where v crosses zero: hybrid modes,
here a Memory for each element. s is even: the form sgn(v) C (lam_i - F_i/s) needs an odd one.
"""

import sympy as sp

from ...definition.primitives import Event
from ..contract import Pieces, law, parameter
from .stribeck import StribeckLaw, stribeck


@law
class GMS(StribeckLaw):
    """Generalised Maxwell-slip: elements that stick or slip, with a Stribeck curve and lag in slip.

    The defaults are the reference set of the multistate law (chosen), with C = F_c/tau_d.

    Examples
    --------
    A single element, and ten:

    >>> from pwsmooth.laws.friction import GMS
    >>> GMS(kappa=1.0, share=1.0, sigma=0.0).elements, GMS().elements
    (1, 10)
    >>> [round(float(GMS().steady_force(v)), 6) for v in (1e-6, 8.0, 80.0)]
    [2.0, 1.367879, 1.0]
    """

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
        z = at.member(elements, "z", scale=self.F_s / max(self.kappas()))
        # 0 while it sticks, else the direction of slip, in which v cannot turn without sticking first.
        slip = elements.memory(at.label("slip"), 0)
        threshold = p.share * stribeck(v, p)
        attraction = p.C / p.kappa * p.share * (slip - p.kappa * z / threshold)
        rate = sp.Piecewise((v, sp.Eq(slip, 0)), (attraction, True))
        events = (
            Event((1 - slip**2) * (p.kappa * z / threshold) ** 2 - 1, direction=1, update={slip: sp.sign(z)},
                  when=z * v > 0, name=at.label("slip")),
            Event(v, when=sp.Ne(slip, 0), update={slip: 0}, name=at.label("stick")),
        )  # fmt: skip
        return Pieces(
            force=elements.sum(p.kappa * z + p.sigma * rate) + p.sigma2 * v,
            rates={z: rate},
            events=events,
            outputs={"presliding": elements.sum(1 - slip**2)},
            surfaces=(v, sp.Abs(p.kappa * z) - threshold),
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
