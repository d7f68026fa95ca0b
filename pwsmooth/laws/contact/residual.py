"""Contact with residual indentation: the force is lost at p > 0 and comes back there.

    0 in a + (1/gamma + beta) a' - dio(gamma (a - p) + a'),   F = K (a + (1/gamma + beta) a')            (5.3)
    a' = max(-gamma a/(1 + gamma beta), gamma (p - a)),       F = K max(0, p + beta gamma (p - a))       (5.4)

X. Xiong's thesis, chapter 5; (5.3) and (5.4) are the same by the theorem 0 <= w, y, w y = 0 <=> min(w, y) = 0. A
unilateral standard linear solid: a spring K beside a Maxwell branch. Contact is where the force is positive,
p > p* = beta gamma a/(1 + beta gamma): the next touch-down happens there, not at p = 0.
With nonlinear compliance (Xiong, Kikuuwe, Yamamoto, J. Appl. Mech. 81(2) 021003, whose text was not available) two
reconstructions keep all published features:

    R1  F = K [max(0, p + beta gamma (p - a))]^n        R2  F = K p^(n-1) max(0, p + beta gamma (p - a))
"""

from __future__ import annotations

import sympy as sp

from ..contract import law, parameter
from .wall import AtWall


class _Residual(AtWall):
    """The rate of a, which all forms share."""

    def _with_rate(self, at, p, force, stored, released):
        """`force(push)` with push = p + beta gamma (p - a) > 0 in contact."""
        # a >= 0 stays so; below -c, which no contact reaches, a curved wall would have a second surface.
        a = at.state("a", scale=1e-3, nonnegative=True)
        level = p.beta * p.gamma * a / (1 + p.beta * p.gamma)
        # p + beta gamma (p - a), written with the zero of its surface: a power of it does not exist beside that.
        surface = at.beyond(level)
        push = (1 + p.beta * p.gamma) * at.past(level)
        rate = sp.Piecewise((p.gamma * (at.x - a), surface > 0), (-p.gamma * a / (1 + p.gamma * p.beta), True))
        return self._pieces(
            at,
            surface,
            force(push),
            stored(push, a),
            released=released(a),
            rates={a: rate},
            fastest_rate=p.gamma,
        )


@law
class LinearResidual(_Residual):
    """(5.4): linear, with residual indentation; gamma -> oo is Kelvin-Voigt released at zero force.

    The force is gone before the indentation is:

    >>> solution = free_impact(LinearResidual(), speed=1.0).solve(dense_output=True)
    >>> lift_off = solution.event_times("reset", "lift-off")[0]
    >>> print(f"lift-off at an indentation of {1e3 * solution(lift_off, 'p'):.2f} mm")
    lift-off at an indentation of 8.93 mm
    """

    source = "X. Xiong's thesis, (5.3) and (5.4)"
    K: float = parameter(1000.0, "N/m", "stiffness")
    beta: float = parameter(0.02, "s", "damping", "nonnegative")
    gamma: float = parameter(500.0, "1/s", "rate of the internal state")

    def pieces(self, at, p):
        bg = p.beta * p.gamma
        return self._with_rate(
            at,
            p,
            force=lambda push: p.K * push,
            stored=lambda push, a: p.K / 2 * (at.x**2 + bg * (at.x - a) ** 2),
            released=lambda a: p.K / 2 * bg / (1 + bg) * a**2,
        )


@law
class _Nonlinear(_Residual):
    """The parameters that both reconstructions share."""

    certainty = "reconstructed"
    K: float = parameter(1e5, "N/m^n", "stiffness")
    beta: float = parameter(0.005, "s", "damping", "nonnegative")
    gamma: float = parameter(1000.0, "1/s", "rate of the internal state")
    n: float = parameter(1.5, "1", "exponent of the compliance", structural=True)


@law
class ResidualIndentation(_Nonlinear):
    """R1: nonlinear compliance with residual indentation, a reconstruction.

    >>> solution = free_impact(ResidualIndentation(), speed=1.0).solve(dense_output=True)
    >>> lift_off = solution.event_times("reset", "lift-off")[0]
    >>> bool(solution(lift_off, "p") > 0)
    True
    """

    source = "reconstructed from the abstract of Xiong, Kikuuwe, Yamamoto, J. Appl. Mech. 81(2) 021003 (R1)"

    def pieces(self, at, p):
        n = p.n
        # V = int_a^p F ds + K a^(n+1)/(n+1), of which int F ds = K push^(n+1)/((n+1)(1 + bg)), push = a at p = a.
        share = 1 + p.beta * p.gamma

        def stored(push, a):
            return p.K / (n + 1) * ((push ** (n + 1) - a ** (n + 1)) / share + a ** (n + 1))

        def released(a):
            return p.K / (n + 1) * a ** (n + 1) * (1 - 1 / share)

        return self._with_rate(at, p, force=lambda push: p.K * push**n, stored=stored, released=released)


@law
class ResidualHuntCrossley(_Nonlinear):
    """R2: as Hunt-Crossley in the limit gamma -> oo, a reconstruction.

    Without damping it is elastic:

    >>> impact = free_impact(ResidualHuntCrossley(beta=0.0), speed=1.0)
    >>> print(f"{impact.solve()['v'][-1]:.6f} m/s")
    -1.000000 m/s
    """

    source = "reconstructed from the abstract of Xiong, Kikuuwe, Yamamoto, J. Appl. Mech. 81(2) 021003 (R2)"

    def pieces(self, at, p):
        n, bg = p.n, p.beta * p.gamma

        def work(x, a):
            """int_a^x K s^(n-1) (s + bg (s - a)) ds + K a^(n+1)/(n+1)"""
            whole = (1 + bg) * (x ** (n + 1) - a ** (n + 1)) / (n + 1) - bg * a * (x**n - a**n) / n
            return p.K * (whole + a ** (n + 1) / (n + 1))

        return self._with_rate(
            at,
            p,
            force=lambda push: p.K * at.x ** (n - 1) * push,
            stored=lambda push, a: work(at.x, a),
            released=lambda a: work(bg * a / (1 + bg), a),
        )
