"""Contact laws without memory: Hertz, Kelvin-Voigt, Hunt-Crossley, Anagnostopoulos.

    Hertz            F = K p^n                      p >= 0, else 0
    Kelvin-Voigt     F = K (p + b v)                (5.1): jumps at touch-down, pulls before release
    Hunt-Crossley    F = K p^n (1 + b v)            (5.2): continuous; pulls where v < -1/b
    Anagnostopoulos  F = K p + 2 zeta sqrt(K m) v,  zeta from c_r

p is the indentation and v its rate. (5.1), (5.2): X. Xiong's thesis, chapter 5. `release` says where contact ends:
"zero indentation" is the law as printed; with "zero force" it never pulls.
"""

from __future__ import annotations

import sympy as sp

from ..contract import law, parameter
from .eta import check_c_r
from .impact import RELEASES
from .wall import AtWall


@law
class Hertz(AtWall):
    """Hertz's elastic contact, F = K p^n.

    An elastic impact returns all of its speed:

    >>> print(f"{free_impact(Hertz(K=1e5), speed=2.0).solve()['v'][-1]:.6f} m/s")
    -2.000000 m/s
    """

    source = "Hertz 1882; hertz_stiffness and journal_stiffness give K"
    K: float = parameter(1e5, "N/m^n", "stiffness")
    n: float = parameter(1.5, "1", "exponent", structural=True)

    def pieces(self, at, p):
        return self._pieces(at, at.beyond(0), p.K * at.x**p.n, p.K * at.x ** (p.n + 1) / (p.n + 1))


@law
class KelvinVoigt(AtWall):
    """Spring and dashpot in parallel, F = K (p + b v).

    It jumps at touch-down, and pulls at the end of the contact where it is not released before:

    >>> for release in ("zero indentation", "zero force"):
    ...     force = free_impact(KelvinVoigt(b=0.02, release=release), speed=1.0).solve()["force"]
    ...     print(f"{release}: begins with {force[0]:.1f} N, pulls with {max(0.0, -force.min()):.1f} N")
    zero indentation: begins with 20.0 N, pulls with 7.0 N
    zero force: begins with 20.0 N, pulls with 0.0 N
    """

    source = "X. Xiong's thesis, (5.1)"
    K: float = parameter(1000.0, "N/m", "stiffness")
    b: float = parameter(0.02, "s", "viscous coefficient over stiffness", "nonnegative")
    release: str = parameter(RELEASES[1], "1", "where contact ends", choices=RELEASES)

    def pieces(self, at, p):
        push = at.x + p.b * at.v
        force = sp.Max(0, push) if self.release == "zero force" else push
        return self._pieces(at, at.beyond(0), p.K * force, p.K * at.x**2 / 2, surfaces=(push,))


@law
class HuntCrossley(AtWall):
    """Damping in proportion to the elastic force, F = K p^n (1 + b v).

    A free impact at speed v0 has the restitution of eta = b v0:

    >>> end = free_impact(HuntCrossley(b=0.3), speed=2.0).solve()["v"][-1]
    >>> print(f"{-end / 2.0:.6f} {float(restitution(0.3 * 2.0)):.6f}")
    0.711950 0.711950
    """

    source = "X. Xiong's thesis, (5.2), after Hunt, Crossley 1975"
    K: float = parameter(1e5, "N/m^n", "stiffness")
    b: float = parameter(0.3, "s/m", "damping", "nonnegative")
    n: float = parameter(1.5, "1", "exponent", structural=True)
    release: str = parameter(RELEASES[1], "1", "where contact ends", choices=RELEASES)

    def pieces(self, at, p):
        damping = 1 + p.b * at.v
        factor = sp.Max(0, damping) if self.release == "zero force" else damping
        stored = p.K * at.x ** (p.n + 1) / (p.n + 1)
        return self._pieces(at, at.beyond(0), p.K * at.x**p.n * factor, stored, surfaces=(damping,))


@law
class Anagnostopoulos(AtWall):
    """Linear: the dashpot that gives c_r to the mass `m`, with zeta = -ln c_r/sqrt(pi^2 + ln^2 c_r).

    A free impact of the mass that it was made for returns the share c_r of its speed:

    >>> impact = free_impact(Anagnostopoulos(c_r=0.5, m=2.0), m=2.0, speed=1.0)
    >>> print(f"{impact.solve()['v'][-1]:.6f} m/s")
    -0.500000 m/s
    """

    source = "Anagnostopoulos 1988, recalled from the literature"
    K: float = parameter(1e5, "N/m", "stiffness")
    m: float = parameter(1.0, "kg", "reduced mass of the bodies")
    c_r: float = parameter(0.5, "1", "coefficient of restitution")

    def check(self):
        check_c_r(self.c_r, "`c_r` of Anagnostopoulos")

    def pieces(self, at, p):
        log = sp.log(p.c_r)
        zeta = -log / sp.sqrt(sp.pi**2 + log**2)
        force = p.K * at.x + 2 * zeta * sp.sqrt(p.K * p.m) * at.v
        return self._pieces(at, at.beyond(0), force, p.K * at.x**2 / 2)
