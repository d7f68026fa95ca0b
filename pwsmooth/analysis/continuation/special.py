"""Special points: bifurcations of a branch, points of codimension 2 of a curve, and what leads on from them.

Chain: orbits, equilibria -> **special** -> way.py, bifurcations.py, equilibria/, curves/.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...door import checks
from ..equilibria.equilibrium import Equilibrium
from ..orbits.itineraries import Change
from ..orbits.periodic_orbit import PeriodicOrbit
from ..orbits.recutting import Cut

__all__ = ["Special"]

ADDING, CAPTURE = "adding-sliding", "capture"
_OF_LYAPUNOV = {-1: "supercritical", 0: "degenerate: linear to third order", 1: "subcritical"}


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
class Special:
    """A special point: a bifurcation of a branch over one parameter, a point of codimension 2 of a curve over two.

    Attributes
    ----------
    kind : str
        Of orbits: "fold", "flip", "symmetry breaking", "branch point", "torus", the name of a change of itinerary,
        "border collision" where multipliers jump without an event, or "capture": of a layered view with a finite ratio,
        whose contact is captured on one side of it and passes on the other; "homoclinic orbit" or "heteroclinic cycle"
        where a branch of cycles ends at saddles. Of equilibria: "fold", "branch point", "Hopf", "sliding Hopf" (of the
        flow on a sliding surface), "hidden fold" (dg/dlambda = 0 of a hidden term), "pseudo-Hopf" (of a planar switch
        whose two folds meet, both invisible), "two-fold" (other ones), "layer Hopf" (of several multipliers in their
        layer), "boundary equilibrium: persistence", "boundary equilibrium: nonsmooth fold", "boundary equilibrium"
        (where what lies beyond is no single branch), "end of the set" (of a set of equilibria, followed along a state),
        "surface of an event". Along curves: "cusp", "1:1 resonance" to "1:4 resonance", "Bogdanov-Takens", "generalised
        Hopf", "hidden cusp", or two conditions that meet, as "fold + flip". Or the name of a test of one's own.
    values : dict of str to float, in the units of the parameters
        The parameter or both parameters there.
    point : PeriodicOrbit, Equilibrium or None
        There, on the side from which the branch comes; where a curve ends there, the last one before. None of a diagram
        that was read without its system.
    uncertainty : float, in the unit of the parameter
        Half width of the bracket; nan along curves.
    beyond : PeriodicOrbit, Equilibrium or None
        The orbit on the other side of a change of itinerary; the equilibrium in the mode in which the branch goes on.
    note : str
        What happens there, in words.
    change : Change or None
        Which events change, for changes of itinerary.
    saddles : tuple of Equilibrium
        Of a homoclinic orbit or a heteroclinic cycle: those that it comes to.
    frequency : float, in radians per unit of time
        Of a Hopf point; nan for others.
    lyapunov : float or None
        First Lyapunov coefficient of a Hopf point of a smooth mode, in the units of the states: negative where the
        cycles are stable in their plane, 0 where the Hopf point is degenerate, as in a linear mode. None where it is
        not computed (on a sliding surface).
    cycle : str or None
        Of a boundary equilibrium: "attracting" or "repelling" where a cycle around a focus is born too, which slides on
        the surface; "" where none is. None where that is not decided: it is for two states and one switch without
        hidden terms.
    leads : tuple of Lead
        Other curves that begin or pass at a point of a curve, for `follow`.

    Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the smooth ones; di Bernardo, Budd, Champneys,
    Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the others.

    The logistic map's first period doubling, at 3, and a cusp:

    >>> t, x, a, b = sp.symbols("t x a b", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 2.8}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> orbit = find_orbit(logistic, {x: 0.6}, seen=Strobe(1, phase=0.5))
    >>> (flip,) = follow(orbit, {a: 3.3}).specials
    >>> print(flip.kind, f"{flip.parameter:.6f}")
    flip 3.000000
    >>> step = Event(every=1, update={x: a + b * x - x**3})
    >>> cubic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 1.8}, events=[step])
    >>> orbit = find_orbit(cubic, {x: 1.2}, seen=Strobe(1, phase=0.5))
    >>> fold = follow(orbit, {a: -1}).of_kind("fold")[0]
    >>> (cusp,) = follow(fold, {a: (-1, 1), b: (0, 2)}).of_kind("cusp")
    >>> print(f"{abs(cusp.values['a']):.6f} {cusp.values['b']:.6f}")
    0.000000 1.000000
    """

    kind: str
    values: dict[str, float]
    point: Any = None
    uncertainty: float = math.nan
    beyond: Any = None
    note: str = ""
    change: Change | None = None
    saddles: tuple[Equilibrium, ...] = ()
    frequency: float = math.nan
    lyapunov: float | None = None
    cycle: str | None = None
    leads: tuple[Lead, ...] = field(default=(), repr=False)

    @property
    def parameter(self) -> float:
        """The value of the (first) parameter, in its unit."""
        return next(iter(self.values.values()))

    @property
    def jumps(self) -> bool:
        """Whether the Poincare map jumps there, so that the branch ends."""
        if self.kind != ADDING or self.beyond is None or self.change is None:
            return self.kind in (CAPTURE, ADDING)
        # What a fold of the layer lets go is gone; what only comes to the end of it slips and is back at once.
        return not self.change.before and any("fold" in letter.kind for letter in self.change.after)

    @property
    def at_saddles(self) -> str:
        """Where the orbit comes to rest on its way, in words; empty where it does not."""
        places = [", ".join(f"{name} = {x:.9g}" for name, x in e.x0.items()) for e in self.saddles]
        beside = " and that at ".join(places)
        return f"its period grows without bound beside the saddle at {beside}" if places else ""

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
        if self.point is None:
            raise ValueError(
                f"`start` is a {self.kind} of a set of curves, without its orbit; take it from the curve itself, which "
                "`follow` gives."
            )
        if not self.leads:
            raise ValueError(f"`start` is a {self.kind}, at which no other curve begins that is followed.")
        found = [lead for lead in self.leads if kind in (None, lead.kind)]
        if not found or kind is None and len(found) > 1:
            said = "missing" if kind is None else repr(kind)
            raise ValueError(
                f"`kind` is {said}; at this {self.kind} begins {' or '.join(self.begins)}: give that."
            )
        return found[0]

    def __str__(self) -> str:
        near = {q: 0.0 if abs(value) < self.uncertainty else value for q, value in self.values.items()}
        at = ", ".join(f"{name} = {value:.10g}" for name, value in near.items())
        kind = f"virtual {self.kind}" if getattr(self.point, "virtual", "") else self.kind
        if len(self.values) > 1:
            begins = f" (begins: {', '.join(self.begins)})" if self.begins else ""
            return f"{kind} at {at}" + (f": {self.note}" if self.note else "") + begins
        text = f"{kind} at {at} (+- {self.uncertainty:.1g})"
        if math.isfinite(self.frequency):
            text += f", frequency {self.frequency:.9g}"
        if self.lyapunov is not None:
            kind = _OF_LYAPUNOV[int(np.sign(self.lyapunov))]
            text += f", first Lyapunov coefficient {self.lyapunov:.6g} ({kind})"
        if self.cycle is not None:
            article = "an" if self.cycle[:1] == "a" else "a"
            text += f", with {article} {self.cycle} cycle" if self.cycle else ", without a cycle"
        notes = [self.at_saddles, self.note]
        if self.change is not None and isinstance(self.beyond, PeriodicOrbit):
            sizes = [", ".join(f"{m:.4g}" for m in orbit.multipliers) for orbit in (self.point, self.beyond)]
            notes += [str(self.change), f"multipliers {sizes[0]} -> {sizes[1]}"]
        return "\n    ".join([text, *filter(None, notes)])
