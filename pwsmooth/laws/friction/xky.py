"""Xiong, Kikuuwe and Yamamoto's law: a differential-algebraic inclusion that is a continuous ODE.

    0 in kappa a + sigma da/dt - g(v) Sgn(v - da/dt),      f = kappa a + sigma da/dt
    <=>  f = clip(kappa a + sigma v, g(v)),    da/dt = (f - kappa a)/sigma

|f| <= g(v) exactly, f continuous; passive for every g >= 0; no drift while |kappa a + sigma v| < g. The surfaces are
|kappa a + sigma v| = g(v); v = 0 is none. The micro-damping sigma must not vanish. The multistate law has parallel
elements with thresholds lam_i s, where s lags behind g(v): tau_d ds/dt = g(v) - s. In the plane a, f and v are vectors
and the clip is the projection on a disc: the inclusion, its proof and passivity stay word for word.
"""

import sympy as sp

from ..contract import Pieces, law, parameter
from ..inclusions import clip, sat_of_sgn
from .stribeck import StribeckLaw, stribeck


@law
class XKY(StribeckLaw):
    """Xiong, Kikuuwe and Yamamoto's continuous law with one state.

    The defaults are LuGre's standard ones.

    Its force never exceeds the Stribeck curve, and it does not drift:

    >>> rig = prescribed_motion(XKY(F_c=1.0, F_s=1.5, sigma2=0.0), velocity=1e-2 * sp.sin(t), t_span=(0, 7))
    >>> bool(rig.solve()["force"].max() <= 1.5)
    True
    """

    source = "Xiong, Kikuuwe, Yamamoto, J. Appl. Math. 2013:320276; parameters of LuGre's standard example"
    in_plane = True
    kappa: float = parameter(1e5, "N/m", "stiffness")
    sigma: float = parameter(316.22776601683796, "N s/m", "micro-damping, by which the law divides,")
    F_c: float = parameter(1.0, "N", "Coulomb force")
    F_s: float = parameter(1.5, "N", "static friction force")
    v_s: float = parameter(1e-3, "m/s", "Stribeck velocity")
    sigma2: float = parameter(0.4, "N s/m", "viscous friction", "nonnegative")

    def pieces(self, at, p):
        a, v, g = at.deflection("a", scale=self.F_c / self.kappa), at.v, stribeck(at.v, p)
        trial = at.each(lambda a, v: p.kappa * a + p.sigma * v, a, v)
        # Sgn -> sat with x = v + kappa a/sigma and y = f: x - y/sigma = v - da/dt
        bristle = sat_of_sgn(at.each(lambda e: e / p.sigma, trial), g, p.sigma)
        return Pieces(
            force=at.each(lambda f, v: f + p.sigma2 * v, bristle, v),
            rates=at.rates(a, at.each(lambda f, a: (f - p.kappa * a) / p.sigma, bristle, a)),
            surfaces=at.bounds(trial, g),
            fastest_rate=p.kappa / p.sigma,
        )


@law
class MultistateXKY(StribeckLaw):
    """Xiong, Kikuuwe and Yamamoto's law with parallel elements and frictional lag.

    Equations (4.13a-c) of Xiong's thesis; equations and defaults are reconstructed.

    >>> law = MultistateXKY(kappa=(1.0, 0.5), sigma=0.01, share=(0.6, 0.4))
    >>> law.elements
    2
    >>> print(f"{float(law.steady_force(8.0)):.6f}")
    1.367879
    """

    source = (
        "Xiong, Kikuuwe, Yamamoto, Tribol. Lett. 51 (2013) 513-523, eq. (4.13) of Xiong's thesis; reconstructed"
    )
    certainty = "reconstructed"
    in_plane = True
    F_c: float = parameter(1.0, "N", "Coulomb force")
    F_s: float = parameter(2.0, "N", "static friction force")
    v_s: float = parameter(8.0, "um/s", "Stribeck velocity")
    tau_d: float = parameter(0.02, "s", "time of the frictional lag")
    kappa: tuple = parameter(tuple(2.5 / i for i in range(1, 11)), "N/um", "stiffness", each=True)
    sigma: tuple = parameter((0.01,) * 10, "N s/um", "micro-damping, by which the law divides,", each=True)
    share: tuple = parameter((0.1,) * 10, "1", "share of the strength", each=True)
    sigma2: float = parameter(0.0, "N s/um", "viscous friction", "nonnegative")

    def pieces(self, at, p):
        elements, v = at.family(self.elements), at.v
        # The level stays between F_c and F_s: with a negative one the clip would jump and its surfaces would slide.
        s = at.state("s", stribeck(v, p), self.F_c, positive=True)
        a = at.deflection("a", scale=self.F_c / max(k for k, _ in self.pairs()), family=elements)
        limit = p.share * s
        trial = at.each(lambda a, v: p.kappa * a + p.sigma * v, a, v)
        bristle = clip(trial, limit)
        surfaces = at.bounds(trial, limit)
        # Within all of them: the last of a number is turned round.
        held = sp.Piecewise(*((0, h > 0) for h in (surfaces[0], *(-h for h in surfaces[1:]))), (1, True))
        return Pieces(
            force=at.each(lambda f, v: elements.sum(f) + p.sigma2 * v, bristle, v),
            rates={s: (stribeck(v, p) - s) / p.tau_d}
            | at.rates(a, at.each(lambda f, a: (f - p.kappa * a) / p.sigma, bristle, a)),
            outputs={"presliding": elements.sum(held)},
            surfaces=surfaces,
            fastest_rate=max(k / s for k, s in self.pairs()),
        )

    def pairs(self):
        """Stiffness and micro-damping of the elements.

        Returns
        -------
        list of (float, float)
            (kappa_i, sigma_i), in the units of the parameters.
        """
        n = self.elements
        kappa, sigma = ((x if isinstance(x, tuple) else (x,) * n) for x in (self.kappa, self.sigma))
        return list(zip(kappa, sigma))
