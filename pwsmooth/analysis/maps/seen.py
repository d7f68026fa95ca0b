"""How a motion is seen: once a period of the drive, or whenever it returns to a surface.

Chain: **seen** -> sections.py, which makes a map of it and of a system.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...door import checks

__all__ = ["Return", "Strobe"]

LONGEST = 1e3  # unit of the model's time: how long a return is waited for unless more is asked for


@checks.door()
@dataclass(frozen=True)
class Strobe:
    """A driven system seen once a period, at t = (k + phase)*period, k = 0, 1, ...

    Parameters
    ----------
    period : float, Expr or str, in the unit of the model's time
        Of the drive; an expression of parameters (2*pi/omega) where one of these changes.
    phase : float, dimensionless
        Part of the period at which it is seen, and starts. For orbits choose one at which nothing switches or sticks.
    symmetry : mapping of state to Expr, optional
        Images of states under (x, t) -> (G x, t + T/2), linear in the states. `find_orbit` then finds symmetric orbits,
        unstable ones too, through half a period; `diagram` follows symmetric orbits as such, and of two branches that
        are mirror images one. All other tools see whole periods.

    Raises
    ------
    ValueError, TypeError
        A period that is no positive number and no expression, a phase that is no number, a symmetry that is no mapping.
        What a system refuses is told where it is seen.

    >>> t, x = sp.symbols("t x", real=True)
    >>> seen = Strobe(2 * sp.pi, phase=0.25)
    >>> orbit = find_orbit(System({x: sp.cos(t) - x}, time=t), {x: 0}, seen)
    >>> round(float(orbit.x[0]), 9)  # (cos t + sin t)/2 at t = pi/2
    0.5
    """

    period: Any
    phase: float = 0.0
    symmetry: Mapping[Any, Any] | None = field(default=None, hash=False)

    def __post_init__(self) -> None:
        checks.fields(self, phase=checks.number, symmetry=checks.optional(checks.mapping))
        if not isinstance(self.period, str) and not checks.expression(self.period, "`period`").free_symbols:
            checks.period(self.period, {})


@checks.door()
@dataclass(frozen=True)
class Return:
    """An autonomous system seen whenever it crosses a surface h = 0 in one direction.

    Parameters
    ----------
    section : Expr or str
        h, a function of states and parameters.
    direction : {1, -1}
        Crossed with h rising or falling.
    longest : float, in the unit of the model's time
        A motion that is not back after this time does not return.

    Raises
    ------
    ValueError, TypeError
        A direction that is not 1 or -1, a time that is not positive. What a system refuses is told where it is seen.

    Source: the first return map of Poincare.

    Van der Pol's oscillator at its right turning points:

    >>> x, v = sp.symbols("x v", real=True)
    >>> pol = System({x: v, v: (1 - x**2) * v - x})
    >>> print(f"{find_orbit(pol, {x: 1, v: 0}, Return(v, direction=-1)).x[0]:.6f}")
    2.008620
    """

    section: Any
    direction: int = 1
    longest: float = LONGEST

    def __post_init__(self) -> None:
        checks.fields(self, direction=checks.one_of(1, -1), longest=checks.positive)
        if not isinstance(self.section, str):
            checks.expression(self.section, "`section`")


def how_seen(value: Any, what: str) -> Any:
    """A Strobe or a Return; TypeError with the remedy for anything else."""
    if isinstance(value, (Strobe, Return)):
        return value
    raise TypeError(
        f"{what} is {checks.shown(value)}; give Strobe(period) of a driven system, or Return(section) of an autonomous "
        "one."
    )
