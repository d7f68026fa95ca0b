"""Rigid impact: 0 <= gap  complementary to  F >= 0, Newton's restitution, and the closed contact.

gap'(+) = -e gap'(-) at an impact;  F solves gap'' = 0 in the closed contact, until it would pull
"""

from __future__ import annotations

from typing import ClassVar

from ...definition.primitives import Unilateral
from ..contract import Law, Pieces, law, parameter


@law
class RigidImpact(Law):
    """Newton's impact law; the contact closes after accumulation or at zero speed.

    The bounces of a ball add up to sqrt(2 h/g) (1 + e)/(1 - e), then it rests:

    >>> last = falling_ball(RigidImpact(e=0.5), height=1.0, g=9.81).solve().events[-1]
    >>> print(f"{last.kind} at {last.time:.9f} s; {math.sqrt(2 / 9.81) * 3:.9f} s")
    closed contact at 1.354570923 s; 1.354570923 s
    """

    kind = "contact"
    source = "Newton's restitution"
    needs: ClassVar[tuple[str, ...]] = ("position",)
    e: float = parameter(0.9, "1", "restitution", "nonnegative")

    def check(self):
        if self.e > 1:
            raise ValueError(
                f"`e` of RigidImpact is {self.e:g}; an impact returns at most its speed, so give e <= 1."
            )

    def pieces(self, at, p):
        floor = Unilateral(-at.beyond(0), restitution=p.e, name=at.label("R"))
        return Pieces(force=floor.reaction, contacts=(floor,), surfaces=(at.beyond(0),))
