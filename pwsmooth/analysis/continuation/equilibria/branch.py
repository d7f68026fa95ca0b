"""A branch of equilibria over a parameter, and the bifurcations on it.

Chain: branch.py, equilibrium.py -> **equilibrium_branch** -> equilibrium_tests.py, equilibrium_branches.py, hopf.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....door import checks
from ....door.documenting import complete
from ...equilibria.equilibrium import Equilibrium
from ..branch import _Along

__all__ = ["EquilibriumBifurcation", "EquilibriumBranch"]


@complete
@dataclass(frozen=True)
class EquilibriumBifurcation:
    """A point of a branch of equilibria at which their number, stability or mode changes.

    Attributes
    ----------
    kind : str
        "fold", "branch point", "Hopf", "sliding Hopf" (of the flow on a sliding surface), "hidden fold" (dg/dlambda = 0
        of a hidden term), "pseudo-Hopf" (of a planar switch whose two folds meet, both invisible), "two-fold" (other
        ones), "layer Hopf" (of several multipliers in their layer), "boundary equilibrium: persistence", "boundary
        equilibrium: nonsmooth fold", "boundary equilibrium" (where what lies beyond is no single branch), "end of the
        set" (of a set of equilibria, followed along a state), "surface of an event".
    name : str
        The parameter's.
    parameter : float, in the unit of the parameter
        Its value.
    uncertainty : float, in the unit of the parameter
        To which it is known.
    equilibrium : Equilibrium
        At the bifurcation.
    beyond : Equilibrium or None
        The same point in the mode in which the branch goes on.
    what : str
        Which surface, and what it changes into, in words.
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

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008; Kuznetsov, Elements of
    Applied Bifurcation Theory, for fold and Hopf points.

    >>> x, a = sp.symbols("x a", real=True)
    >>> branch = follow(find_equilibrium(System({x: a - x**2}, parameters={a: 1}), {x: 1}), {a: -1})
    >>> print(branch.bifurcations[0].kind, f"{abs(branch.bifurcations[0].parameter):.9f}")
    fold 0.000000000
    """

    kind: str
    name: str
    parameter: float
    uncertainty: float
    equilibrium: Equilibrium
    beyond: Equilibrium | None = None
    what: str = ""
    frequency: float = math.nan
    lyapunov: float | None = None
    cycle: str | None = None

    def __str__(self) -> str:
        at = 0.0 if abs(self.parameter) < self.uncertainty else self.parameter
        kind = f"virtual {self.kind}" if self.equilibrium.virtual else self.kind
        text = f"{kind} at {self.name} = {at:.10g} (+- {self.uncertainty:.1g})"
        if math.isfinite(self.frequency):
            text += f", frequency {self.frequency:.9g}"
        if self.lyapunov is not None:
            kinds = {-1: "supercritical", 0: "degenerate: linear to third order", 1: "subcritical"}
            text += f", first Lyapunov coefficient {self.lyapunov:.6g} ({kinds[int(np.sign(self.lyapunov))]})"
        if self.cycle is not None:
            text += (
                f", with {'an' if self.cycle[0] == 'a' else 'a'} {self.cycle} cycle"
                if self.cycle
                else ", without a cycle"
            )
        return f"{text}\n    {self.what}" if self.what else text


@checks.door()
@dataclass(repr=False)
class EquilibriumBranch(_Along):
    """Equilibria along a parameter.

    Attributes
    ----------
    parameter : str
        Its name; of a set of equilibria followed along a state, the state's.
    equilibria : list of Equilibrium
        In the order in which they were found.
    bifurcations : list of EquilibriumBifurcation
        In the order in which they were found.
    end : str
        Why it ended, in words.
    places : list of int
        Of each bifurcation how many of the equilibria come before it.

    Source: Keller's arclength continuation (1977); di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical
    Systems, 2008, for what happens at surfaces.

    >>> x, a = sp.symbols("x a", real=True)
    >>> relay = System({x: a - sp.sign(x) - x}, parameters={a: 0})
    >>> branch = follow(find_equilibrium(relay, {x: 0.3}), {a: 2})
    >>> [b.kind for b in branch.bifurcations], branch.end
    (['boundary equilibrium: persistence'], 'reached a = 2.')
    """

    parameter: str
    equilibria: list[Equilibrium] = field(default_factory=list)
    bifurcations: list[EquilibriumBifurcation] = field(default_factory=list)
    end: str = ""
    places: list[int] = field(default_factory=list)

    _noun = "equilibria"

    @property
    def _points(self) -> list[Any]:
        return self.equilibria

    @staticmethod
    def _at(bifurcation: Any) -> Any:
        return bifurcation.equilibrium

    @property
    def values(self) -> np.ndarray:
        """The parameter along the branch, shape (number of equilibria,), in its unit."""
        names = [str(s) for s in self.equilibria[0].system.states]
        if self.parameter in names:
            return self.x[names.index(self.parameter)]
        return super().values

    @property
    def virtual(self) -> np.ndarray:
        """Whether each equilibrium is virtual."""
        return np.array([bool(e.virtual) for e in self.equilibria])

    @property
    def mult(self) -> np.ndarray:
        """Multipliers, shape (m, number of equilibria); those of switches dimensionless."""
        return np.array([e.mult for e in self.equilibria]).T

    def _drawn(self, point: Any) -> tuple[tuple[Any, ...], str]:
        model = point.system.model
        return (*model.states, *(mu.symbol for mu in model.multipliers)), "state or multiplier"

    def _row(self, point: Any) -> np.ndarray:
        return np.concatenate([point.x, point.mult])

    def _columns(self) -> dict[str, Any]:
        names = [str(mu.symbol) for mu in self.equilibria[0].system.model.multipliers]
        return {
            "stable": self.stable,
            **dict(zip(names, self.mult)),
            "stability": [e.stability for e in self.equilibria],
            "virtual": self.virtual,
            "rightmost_eigenvalue": [e.eigenvalues.real.max(initial=-math.inf) for e in self.equilibria],
        }
