"""Dahl's law and its kin: forces that depend on the path, not on the speed (rate independent).

    dF/dx = sigma0 |1 - (F/F_c) sgn v|^alpha sgn(1 - (F/F_c) sgn v)

v = 0 is a kink (|v|). No stiction, no Stribeck effect; small cycles drift, minor loops do not close. The internal
rate sigma0 |v|/F_c grows with speed.
"""

import sympy as sp

from ..contract import Law, Pieces, law, parameter


@law
class Dahl(Law):
    """Dahl's law with exponent alpha; the state is the deflection z = F/sigma0.

    The steady loop of amplitude X reaches F_c tanh(sigma0 X/F_c):

    >>> law = Dahl(sigma0=1e5, F_c=2.0)
    >>> rig = prescribed_motion(law, position=4e-5 * sp.sin(t), t_span=(0, 20))
    >>> print(f"{rig.solve()['force'].max():.6f} {2.0 * math.tanh(2.0):.6f}")
    1.928055 1.928055
    """

    kind = "friction"
    source = "Dahl 1968, The Aerospace Corp. TOR-0158(3107-18)-1"
    in_plane = True
    sigma0: float = parameter(1e5, "N/m", "stiffness at zero force")
    F_c: float = parameter(1.0, "N", "Coulomb force")
    alpha: float = parameter(1.0, "1", "exponent", structural=True)

    def pieces(self, at, p):
        z, v = at.deflection("z", scale=self.F_c / self.sigma0), at.v
        pull = p.alpha * p.sigma0 * at.speed() / p.F_c
        if p.alpha == 1:
            rate = at.each(lambda z, v: v - pull * z, z, v)
        elif at.planar:
            raise ValueError(f"`alpha` of Dahl is {self.alpha:g}; along a velocity with components it is 1.")
        else:
            share = p.sigma0 * z / p.F_c
            # Written for each sign of v, so that no surface jumps where v turns.
            ahead, back = (sp.Abs(1 - side * share) ** p.alpha * sp.sign(1 - side * share) for side in (1, -1))
            rate = v * sp.Piecewise((ahead, v > 0), (back, True))
        force = at.each(lambda z: p.sigma0 * z, z)
        return Pieces(force=force, rates=at.rates(z, rate), surfaces=at.surfaces, fastest_rate=pull)

    def steady(self, v, p):
        return p.F_c * sp.sign(v)


@law
class ModifiedDahl(Law):
    """Dahl's law between two parallel lines: dh/dx = beta (+-(F_c) + slope x - h) for +- v > 0.

    Reconstructed; slope 0 and beta = sigma0/F_c give Dahl's law with exponent 1.

    >>> x, v = sp.symbols("x v", real=True)
    >>> ModifiedDahl(slope=10.0).attach(position=x, velocity=v).rates
    {h: beta*(F_c*v + (-h + slope*x)*Abs(v))}
    """

    kind = "friction"
    source = "Bastien, Michon, Manin, Dufour, J. Sound Vib. 302 (2007); details reconstructed"
    certainty = "reconstructed"
    needs = ("position",)
    beta: float = parameter(1e5, "1/m", "rate of approach to the envelope")
    F_c: float = parameter(1.0, "N", "half the distance of the envelopes")
    slope: float = parameter(0.0, "N/m", "slope of the envelopes", "real")

    def pieces(self, at, p):
        h, v = at.state("h", scale=self.F_c), at.v
        rate = p.beta * (p.F_c * v + sp.Abs(v) * (p.slope * at.x - h))
        return Pieces(force=h, rates={h: rate}, surfaces=(v,), fastest_rate=p.beta * sp.Abs(v))


@law
class BlimanSorine(Law):
    """Bliman and Sorine's second-order law: a fast and a slow exponential of the path, F = x_f + x_s.

        eta epsilon dx_f/dl = -x_f + f_1 sgn v,    epsilon dx_s/dl = -x_s - f_2 sgn v,    dl = |v| dt

    Each reversal is followed by a peak (no Stribeck curve: it belongs to the path, not to the speed).

    After the peak of f_1 that follows a start or a reversal, f_1 - f_2 is left:

    >>> float(BlimanSorine(f_1=2.5, f_2=1.5).steady_force(0.1))
    1.0
    """

    kind = "friction"
    source = "Bliman, Sorine 1995, Proc. European Control Conf."
    f_1: float = parameter(2.5, "N", "strength of the fast part")
    f_2: float = parameter(1.5, "N", "strength of the slow part", "nonnegative")
    eta: float = parameter(0.5, "1", "ratio of the path lengths, < 1")
    epsilon: float = parameter(1e-5, "m", "path length of the slow part")

    def check(self):
        if not self.eta < 1:
            raise ValueError(f"`eta` of BlimanSorine is {self.eta:g}; give 0 < eta < 1, the fast part is fast.")
        if not self.f_1 > self.f_2:
            raise ValueError(
                f"`f_2` of BlimanSorine is {self.f_2:g}, not below `f_1` = {self.f_1:g}; f_1 - f_2 is the "
                "sliding force."
            )

    def pieces(self, at, p):
        fast, slow, v = at.state("x_f", scale=self.f_1), at.state("x_s", scale=self.f_1), at.v
        speed = sp.Abs(v)
        rates = {
            fast: (p.f_1 * v - speed * fast) / (p.eta * p.epsilon),
            slow: (-p.f_2 * v - speed * slow) / p.epsilon,
        }
        pull = speed / (p.eta * p.epsilon)
        return Pieces(force=fast + slow, rates=rates, surfaces=(v,), fastest_rate=pull)

    def steady(self, v, p):
        return (p.f_1 - p.f_2) * sp.sign(v)


@law
class BlimanSorineFirst(Law):
    """Bliman and Sorine's first-order law, epsilon dF/dl = f_1 sgn v - F: Dahl's with F_c = f_1, sigma0 = f_1/epsilon.

    It is Dahl's law of stiffness f_1/epsilon:

    >>> v = sp.Symbol("v", real=True)
    >>> BlimanSorineFirst(f_1=1.0, epsilon=1e-5).attach(velocity=v).rates
    {x_s: (f_1*v - x_s*Abs(v))/epsilon}
    """

    kind = "friction"
    source = "Bliman, Sorine 1995, Proc. European Control Conf."
    f_1: float = parameter(1.0, "N", "sliding force")
    epsilon: float = parameter(1e-5, "m", "path length")

    def pieces(self, at, p):
        force, v = at.state("x_s", scale=self.f_1), at.v
        rate = (p.f_1 * v - sp.Abs(v) * force) / p.epsilon
        return Pieces(force=force, rates={force: rate}, surfaces=(v,), fastest_rate=sp.Abs(v) / p.epsilon)

    def steady(self, v, p):
        return p.f_1 * sp.sign(v)
