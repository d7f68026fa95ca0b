"""Bouc-Wen: a smooth hysteresis law.

    dz/dt = A v - beta |v| |z|^(n-1) z - gamma v |z|^n,     F = alpha k x + (1 - alpha) k z

n = 1, gamma = 0, A = 1, beta = sigma0/F_c is Dahl's law. Bounded by z_max = (A/(beta + gamma))^(1/n), dissipative
for beta >= |gamma|; small cycles drift and loops do not close. Surfaces v = 0 and, for n < 2, z = 0: kinks.
"""

import sympy as sp

from ..contract import Law, Pieces, law, parameter


@law
class BoucWen(Law):
    """Bouc and Wen's smooth hysteresis law.

    The defaults are chosen: 1 N at 10 um, as Dahl's.

    Examples
    --------
    >>> from pwsmooth.laws.friction import BoucWen
    >>> law = BoucWen(A=1.0, beta=5e4, gamma=5e4)
    >>> print(f"{law.bound():.1e} m")
    1.0e-05 m
    """

    source = "Bouc 1967; Wen, J. Eng. Mech. Div. 102 (1976); defaults chosen"
    needs = ("position",)
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
        z, v = at.state("z", scale=self.bound()), at.v
        size = sp.Abs(z)
        rate = p.A * v - p.beta * sp.Abs(v) * size ** (p.n - 1) * z - p.gamma * v * size**p.n
        pull = p.n * (p.beta + sp.Abs(p.gamma)) * sp.Abs(v) * size ** (p.n - 1)
        force = p.alpha * p.k * at.x + (1 - p.alpha) * p.k * z
        return Pieces(force=force, rates={z: rate}, surfaces=(v, z), fastest_rate=pull)

    def bound(self):
        """Bound of the internal state.

        Returns
        -------
        float
            z_max = (A/(beta + gamma))^(1/n), in units of length (m).
        """
        return (self.A / (self.beta + self.gamma)) ** (1 / self.n)
