"""Bouc-Wen: a smooth hysteresis law.

    dz/dt = A v - beta |v| |z|^(n-1) z - gamma v |z|^n,     F = alpha k x + (1 - alpha) k z

n = 1, gamma = 0, A = 1, beta = sigma0/F_c is Dahl's law. Bounded by z_max = (A/(beta + gamma))^(1/n), dissipative
for beta >= |gamma|; small cycles drift and loops do not close. Surfaces v = 0 and, for n < 2, z = 0: kinks.
In the plane

    dz/dt = A v - (beta |z.v| + gamma z.v) |z|^(n-2) z,    n = 2, 4, ...

with the kink z.v = 0; |z| <= z_max. Park, Wen and Ang (1986) have n = 2 and |z_x v_x| + |z_y v_y| for |z.v|: the
same along every straight line, but on a curve it depends on the axes.
"""

import sympy as sp

from ..contract import Law, Pieces, law, parameter


@law
class BoucWen(Law):
    """Bouc and Wen's smooth hysteresis law.

    The defaults are chosen: 1 N at 10 um, as Dahl's.

    >>> law = BoucWen(A=1.0, beta=5e4, gamma=5e4)
    >>> print(f"{law.bound():.1e} m")
    1.0e-05 m
    """

    kind = "friction"
    source = "Bouc 1967; Wen, J. Eng. Mech. Div. 102 (1976); defaults chosen"
    needs = ("position",)
    in_plane = True
    k: float = parameter(1e5, "N/m", "stiffness")
    A: float = parameter(1.0, "1", "slope at rest")
    beta: float = parameter(5e4, "1/m^n", "dissipative shape parameter")
    gamma: float = parameter(5e4, "1/m^n", "other shape parameter", "real")
    alpha: float = parameter(0.0, "1", "share of the elastic part", "nonnegative")
    n: float = parameter(1.0, "1", "exponent", structural=True)

    def check(self):
        if self.n < 1:
            raise ValueError(
                f"`n` of BoucWen is {self.n:g}; below 1 the rate has no slope at z = 0: give n >= 1."
            )
        if not self.beta + self.gamma > 0:
            raise ValueError(
                f"`gamma` of BoucWen is {self.gamma:g}; beta + gamma must be > 0, or z is not bounded."
            )
        if self.alpha > 1:
            raise ValueError(f"`alpha` of BoucWen is {self.alpha:g}; it is a share, give 0 <= alpha <= 1.")

    def pieces(self, at, p):
        surfaces: tuple[sp.Expr, ...]
        z, v = at.deflection("z", scale=self.bound()), at.v
        if at.planar:
            if self.n % 2:
                raise ValueError(
                    f"`n` of BoucWen is {self.n:g}; along a velocity with components it is 2, 4 or another even "
                    "number, of which the rate has derivatives at z = 0."
                )
            along, square = at.dot(z, v), at.dot(z, z)
            pull = (p.beta * sp.Abs(along) + p.gamma * along) * square ** (p.n / 2 - 1)
            rate = at.each(lambda z, v: p.A * v - pull * z, z, v)
            surfaces, fastest = (along,), p.n * pull
        else:
            size = sp.Abs(z)
            rate = p.A * v - p.beta * sp.Abs(v) * size ** (p.n - 1) * z - p.gamma * v * size**p.n
            surfaces = (v, z)
            fastest = p.n * (p.beta + sp.Abs(p.gamma)) * sp.Abs(v) * size ** (p.n - 1)
        force = at.each(lambda x, z: p.alpha * p.k * x + (1 - p.alpha) * p.k * z, at.x, z)
        return Pieces(force=force, rates=at.rates(z, rate), surfaces=surfaces, fastest_rate=fastest)

    def bound(self):
        """Bound of the internal state.

        Returns
        -------
        float
            z_max = (A/(beta + gamma))^(1/n), in units of length (m).
        """
        return (self.A / (self.beta + self.gamma)) ** (1 / self.n)
