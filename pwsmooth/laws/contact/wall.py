"""Contact at a wall: a force where its surface is positive, and none elsewhere.

Chain: contract.py -> **wall** -> elastic.py, impact.py, residual.py.
"""

from __future__ import annotations

from typing import ClassVar

import sympy as sp

from ...definition.primitives import Event
from ..contract import Law, Pieces


class AtWall(Law):
    """A law of the indentation, with the energy that it stores."""

    kind: ClassVar[str] = "contact"
    needs: ClassVar[tuple[str, ...]] = ("position",)

    def _pieces(self, at, surface, force, stored, *, touch_down=None, released=0, surfaces=(), **more):
        """`stored` in contact and `released` outside of it; `touch_down`: events at its begin with something to do."""
        begin = touch_down or (Event(surface, direction=1, name=at.label("touch-down")),)
        inside = surface > 0
        return Pieces(
            force=sp.Piecewise((force, inside), (0, True)),
            events=(*begin, Event(surface, direction=-1, name=at.label("lift-off"))),
            outputs={"stored": sp.Piecewise((stored, inside), (released, True))},
            surfaces=(surface, *surfaces),
            **more,
        )
