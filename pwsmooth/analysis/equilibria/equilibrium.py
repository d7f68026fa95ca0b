"""An equilibrium: regular, pseudo, on closed contacts; admissible or virtual; with its stability.

Chain: statics.py, equilibrium_stability.py -> **equilibrium** -> equilibrium_modes.py, equilibrium_branch.py.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...door.describe import Described, Rows, listed, number, values
from ...door.documenting import complete
from ..maps.scales import unit_of
from .disc_modes import places
from .stability import Linear, linear_at, signs
from .statics import Sides, Statics

__all__ = ["Equilibrium"]


@complete
@dataclass(frozen=True, repr=False, eq=False)
class Equilibrium(Described):
    """A point at which the system stands still, or the best that was found (`success` False, `message` why).

    Attributes
    ----------
    system : System
        With the parameter values of the equilibrium.
    mult : ndarray, shape (m,)
        Multipliers there: those of switches dimensionless, reactions and unknowns in the units of the model.
    sides : tuple of int
        Of each multiplier 1 or -1 off its surface, 0 where it is held (a contact: 1 open, 0 closed; a disc: 1 slips,
        0 held, and its components always 0).
    residual : float, dimensionless
        Largest equation, relative to its terms.
    steps : int
        Of Newton's method.
    success : bool
        Whether there is one.
    message : str
        In words, with what to try next.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for regular, pseudo-,
    virtual and boundary equilibria; Jeffrey, On the mathematical basis of solid friction, for the layer's stability.

    A relay that pushes to both sides of x = 0, against a wind:

    >>> x = sp.Symbol("x", real=True)
    >>> rest = find_equilibrium(System({x: 0.5 - sp.sign(x)}), {x: 1})
    >>> rest.kind, rest.multipliers, rest.stability
    ('pseudo-equilibrium', {'sgn(x)': 0.5}, 'stable')
    """

    system: Any
    x: np.ndarray
    mult: np.ndarray
    sides: Sides
    residual: float
    steps: int
    success: bool = True
    message: str = ""
    _free: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    _unit: tuple[float, ...] = ()  # of the states: what was looked for it with

    @property
    def unit(self) -> np.ndarray:
        """Sizes of the states against which deviations are measured, shape (n,), as powers of 1024."""
        own = len(self.x) - self.system.model.n_memory
        return np.array([unit_of(size) for size in self._unit or (1.0,) * own])

    @property
    def x0(self) -> dict[str, float]:
        """The state by name, as `solve` takes it."""
        return {str(s): float(value) for s, value in zip(self.system.model.states, self.x)}

    @property
    def multipliers(self) -> dict[str, float]:
        """Multipliers by name."""
        return {str(mu.symbol): float(v) for mu, v in zip(self.system.model.multipliers, self.mult)}

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the switches, discs and contacts that are held on their surfaces."""
        pairs = zip(self.system.model.multipliers, self.sides)
        following = "algebraic", "component"
        return tuple(str(mu.symbol) for mu, side in pairs if side == 0 and mu.kind not in following)

    @property
    def kind(self) -> str:
        """ "regular", "pseudo-equilibrium" where a switch or disc is held, "rest on a contact" where one is closed."""
        pairs = zip(self.system.model.multipliers, self.sides)
        kinds = {mu.kind for mu, side in pairs if side == 0}
        if kinds & {"switch", "disc"}:
            return "pseudo-equilibrium"
        return "rest on a contact" if "contact" in kinds else "regular"

    @functools.cached_property
    def border(self) -> str:
        """Where it lies on the border of its mode, in words; empty off the border."""
        return "; ".join(self._words(lambda margin, on: abs(margin) <= on))

    @functools.cached_property
    def virtual(self) -> str:
        """Why it is one of a field's continuation, not of the system, in words; empty for an admissible one."""
        return "; ".join(self._words(lambda margin, on: margin < -on))

    def _words(self, wanted: Any) -> Iterator[str]:
        statics = Statics(self.system, self.sides, self.x[len(self.x) - self.system.model.n_memory :])
        inside, on, _ = statics.margins(statics.unknowns(self.x, self.mult))
        for mu, side, margin, size, lam in zip(
            self.system.model.multipliers, self.sides, inside, on, self.mult
        ):
            if not wanted(margin, size):
                continue
            if mu.kind == "contact":
                yield (
                    f"the reaction {mu.symbol} is {lam:.6g}"
                    if side == 0
                    else (f"the gap {mu.surface} of {mu.symbol} is {margin:.6g}")
                )
            elif mu.kind == "disc" and side:
                yield f"the speed of slip along {mu.symbol} is {margin:.6g}"
            elif mu.kind == "disc":
                yield f"|{mu.symbol}| is {1 - margin:.6g}, " + (
                    "beyond 1" if margin < -size else "on its bound"
                )
            elif side == 0:
                yield f"{mu.symbol} is {lam:.6g}, " + ("beyond [-1, 1]" if margin < -size else "on its bound")
            else:
                yield f"{mu.surface} is {side * margin:.6g}, with {mu.symbol} = {side}"

    @property
    def admissible(self) -> bool:
        """Whether the system itself stands still here, on the border of a mode included."""
        return self.success and not self.virtual

    @functools.cached_property
    def linear(self) -> Linear:
        """Jacobian of the flow along what is held, and of the layer (equilibrium_stability.py)."""
        if not self.success:
            return Linear(
                np.full((len(self.x),) * 2, np.nan), np.eye(len(self.x)), np.zeros((0, 0)), self.message
            )
        return linear_at(self.system, self.x, self.mult, self.sides)

    @property
    def eigenvalues(self) -> np.ndarray:
        """Of the flow on the manifold of what is held, the rightmost first, in units of 1/time."""
        return self.linear.eigenvalues

    @property
    def layer_eigenvalues(self) -> np.ndarray:
        """Of the layer's motion, in units of 1/time times the width eps; empty without a held switch."""
        return self.linear.layer_eigenvalues

    @property
    def free_directions(self) -> np.ndarray:
        """Directions (x, multipliers held) in which there are more equilibria, shape (dimension, N)."""
        return self._free

    @property
    def isolated(self) -> bool:
        """Whether no other equilibria lie beside it at the same parameters: False for a sticking block's."""
        return len(self._free) == 0

    @functools.cached_property
    def stability(self) -> str:
        """ "stable", "unstable", "neutral" or "undecided"; "stable set" where it lies in a set that attracts."""
        if not self.success:
            return "undecided"
        layer, flow = signs(self.layer_eigenvalues), signs(self.eigenvalues)
        if np.isnan(self.linear.matrix).any() or np.isnan(self.linear.layer).any():
            return "undecided"
        if layer[2] or (flow[2] and not self.linear.undecided):
            return "unstable"
        if self.linear.undecided:
            return "undecided"
        if layer[1] or flow[1] > len(self._free):
            return "neutral"
        return "stable set" if len(self._free) else "stable"

    @property
    def stable(self) -> bool:
        """Whether it attracts, layer included; a set of equilibria: whether the set does."""
        return self.stability.startswith("stable")

    def _described(self) -> tuple[str, Rows]:
        if not self.success:
            return f"No equilibrium: {self.message}", {}.items()
        kind = ", ".join(filter(None, ["virtual" if self.virtual else "", self.kind, self.stability]))
        names, held = self.multipliers, set(self.held)
        kinds = {str(mu.symbol): mu.kind for mu in self.system.model.multipliers}
        shown = {k: v for k, v in names.items() if kinds[k] != "disc" and (k in held or kinds[k] != "switch")}
        sides = [f"{k} = {v:+.0f}" for k, v in names.items() if kinds[k] == "switch" and k not in held]
        sides += [f"{k} slips" for k in names if kinds[k] == "disc" and k not in held]
        return f"Equilibrium: {kind}", {
            "at": values(self.x0, self.x),
            "held": values(shown, list(shown.values())),
            "sides": listed(sides),
            "eigenvalues": listed(list(map(number, self.eigenvalues))),
            "layer": listed(list(map(number, self.layer_eigenvalues))),
            "virtual": [self.virtual] if self.virtual else [],
            "border": [self.border] if self.border else [],
            "undecided": [self.linear.undecided] if self.linear.undecided else [],
            "set": [f"one of a set of dimension {len(self._free)}"] if len(self._free) else [],
            "message": [self.message] if self.message else [],
        }.items()


def made(
    statics: Statics, u: np.ndarray, error: float, steps: int, system: Any, message: str = ""
) -> Equilibrium:
    """The Equilibrium of a solution u (N,)."""
    x, mult, _ = statics.parts(u[None])
    free = statics.free(statics(u[None])[1][0])
    mult[[own for own, _ in places(system.model) if statics.sides[own]]] = 1.0
    return Equilibrium(
        system, x[:, 0], mult[:, 0], statics.sides, float(error), int(steps), True, message, free,
        tuple(statics.unit[: statics.n].tolist()),
    )  # fmt: skip
