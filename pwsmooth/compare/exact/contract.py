"""The contract of a problem with an exact answer: its statement, where the answer comes from, Checks, a Verdict.

Chain: **this file** -> catalogue.py (the problems) -> verify.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ...door import checks

__all__ = ["Check", "ExactProblem", "Verdict"]


@checks.door()
@dataclass(frozen=True)
class Check:
    """One number beside its exact value.

    Parameters
    ----------
    quantity : str
        What it is, with its unit if it has one.
    computed, exact : float, in the unit of the quantity
        What the package gives, and what is known.
    tolerance : float, in the unit of the quantity
        Largest abs(computed - exact) that agrees; 0 for counts.

    >>> Check("half a turn, rad", 3.14159, 3.141592653589793, 1e-5).holds
    True
    """

    quantity: str
    computed: float
    exact: float
    tolerance: float

    @property
    def error(self) -> float:
        """Distance abs(computed - exact), in the unit of the quantity."""
        return abs(self.computed - self.exact)

    @property
    def holds(self) -> bool:
        """Whether the error is at most the tolerance; not so for nan."""
        return self.error <= self.tolerance


@checks.door()
@dataclass(frozen=True)
class ExactProblem:
    """A system whose answer is known.

    Parameters
    ----------
    name : str
        Short, for the command line.
    statement : str
        Equations and start, in one or two lines.
    source : str
        Where the exact answer comes from.
    answer : callable
        () -> iterable of Check; solves the problem.

    >>> def decay():
    ...     x = sp.Symbol("x", real=True)
    ...     end = solve(System({x: -x}), (0, 1), {x: 1})["x"][-1]
    ...     return [Check("x(1)", end, math.exp(-1), 5e-9)]  # five times rtol
    >>> problem = ExactProblem("decay", "x' = -x, x(0) = 1", "exp(-t)", decay)
    >>> [verdict.holds for verdict in verify(of=[problem])]
    [True]
    """

    name: str
    statement: str
    source: str
    answer: Callable[[], Iterable[Check]]


@dataclass(frozen=True)
class Verdict:
    """What one problem gave.

    Attributes
    ----------
    problem : ExactProblem
        The problem.
    checks : tuple of Check
        Its numbers.
    seconds : float, s
        Wall time, compilation included.
    failure : str
        The exception that ended it, in words; empty without one.

    Examples
    --------
    >>> from pwsmooth.compare.exact import verify
    >>> (verdict,) = verify(["hidden-term"])
    >>> verdict.problem.name, verdict.failure
    ('hidden-term', '')
    """

    problem: ExactProblem
    checks: tuple[Check, ...]
    seconds: float
    failure: str = ""

    @property
    def holds(self) -> bool:
        """Whether there are checks, and all of them hold."""
        return not self.failure and bool(self.checks) and all(check.holds for check in self.checks)
