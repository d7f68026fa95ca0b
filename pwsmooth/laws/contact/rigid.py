"""Rigid impact: 0 <= gap  complementary to  F >= 0, Newton's restitution, and the closed contact.

gap'(+) = -e gap'(-) at an impact;  F solves gap'' = 0 in the closed contact, until it would pull
"""

from __future__ import annotations

from typing import ClassVar

from ...primitives import Unilateral
from ..contract import Law, Pieces, law, parameter


@law
class RigidImpact(Law):
    """Newton's impact law; the contact closes after accumulation or at zero speed."""

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
