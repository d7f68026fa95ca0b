"""Points of codimension 2 on a curve, and what leads on from them.

Chain: recutting.py -> **codimension** -> curves/, equilibria/ways.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...door import checks
from ..orbits.recutting import Cut

__all__ = ["Codimension2"]


@dataclass(frozen=True)
class Lead:
    """Where another curve begins: its kind, the map and its point, and what the condition starts with.

    `event` is the switch and ordinal of an arrival or exit (of a capture also whether a fold decides), `extra` the
    condition's own unknowns. Along `direction` the point is left by an amplitude (what is born there has none at the
    point itself).
    """

    kind: str
    cut: Cut
    event: Any = None
    extra: tuple[float, ...] = ()
    direction: np.ndarray | None = None
    begins: bool = True  # at a point of codimension 2


@checks.door()
@dataclass(frozen=True)
class Codimension2:
    """A point of a curve at which a second condition holds.

    Attributes
    ----------
    name : str
        "cusp", "1:1 resonance" to "1:4 resonance", "fold + flip", or two conditions that meet.
    values : dict of str to float, in the units of the parameters
        Both parameters.
    orbit : PeriodicOrbit or Equilibrium
        At the point, or the last one before it where the curve ends there.
    note : str
        What else is to be said.
    leads : tuple of Lead
        The other curves that begin or pass there, for `follow`.

    Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the smooth ones; di Bernardo, Budd, Champneys,
    Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the others.

    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> step = Event(every=1, update={x: a + b * x - x**3})
    >>> cubic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 1.8}, events=[step])
    >>> orbit = find_orbit(cubic, {x: 1.2}, seen=Strobe(1, phase=0.5))
    >>> fold = follow(orbit, {a: -1}).of_kind("fold")[0]
    >>> (cusp,) = follow(fold, {a: (-1, 1), b: (0, 2)}).of_kind("cusp")
    >>> print(f"{abs(cusp.values['a']):.6f} {cusp.values['b']:.6f}")
    0.000000 1.000000
    """

    name: str
    values: dict[str, float]
    orbit: Any
    note: str = ""
    leads: tuple[Lead, ...] = field(default=(), repr=False)

    @property
    def begins(self) -> tuple[str, ...]:
        """Kinds of the other curves that begin or pass there: `follow(point, over, kind=...)` follows them."""
        return tuple(lead.kind for lead in self.leads)

    def lead(self, kind: str | None) -> Lead:
        """What a curve of a kind begins with there.

        Parameters
        ----------
        kind : str or None
            One of `begins`; None where that is the only one.

        Returns
        -------
        Lead
            For `follow`.

        Raises
        ------
        ValueError
            Nothing of that kind begins there, or several kinds do and none is given.
        """
        if not self.leads:
            raise ValueError(f"`start` is a {self.name}, at which no other curve begins that is followed.")
        found = [lead for lead in self.leads if kind in (None, lead.kind)]
        if not found or kind is None and len(found) > 1:
            said = "missing" if kind is None else repr(kind)
            raise ValueError(
                f"`kind` is {said}; at this {self.name} begins {' or '.join(self.begins)}: give that."
            )
        return found[0]

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value:.10g}" for name, value in self.values.items())
        begins = f" (begins: {', '.join(self.begins)})" if self.begins else ""
        return f"{self.name} at {where}" + (f": {self.note}" if self.note else "") + begins
