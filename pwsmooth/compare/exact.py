"""Problems with exact answers: solve each, set the computed numbers beside the exact ones.

A problem is a statement, where its answer comes from, and a function that solves it and returns Checks. The
command `pwsmooth verify` runs the list on the user's machine; the tests run the same list.
Chain: solve, analysis -> exact_problems.py (the list) -> **this file** -> cli.py.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

__all__ = ["Check", "ExactProblem", "Verdict", "problems", "verify"]


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

    Notes
    -----
    Source: defined here.

    Examples
    --------
    >>> from pwsmooth.compare.exact import Check
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

    Notes
    -----
    Source: defined here; each problem has its own.

    Examples
    --------
    >>> import math
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> from pwsmooth.compare.exact import Check, ExactProblem, verify
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

    Notes
    -----
    Source: defined here.

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


def problems() -> dict[str, ExactProblem]:
    """Every built-in problem by its name.

    Returns
    -------
    dict of str to ExactProblem
        In the order of `pwsmooth verify`.

    Notes
    -----
    Source: each problem has its own.

    Examples
    --------
    >>> from pwsmooth.compare.exact import problems
    >>> "hidden-term" in problems()
    True
    """
    from . import exact_problems

    return {problem.name: problem for problem in exact_problems.PROBLEMS}


def verify(
    names: Sequence[str] = (),
    *,
    tell: Callable[[Verdict], None] | None = None,
    of: Sequence[ExactProblem] | None = None,
) -> list[Verdict]:
    """Solve the problems with exact answers.

    Parameters
    ----------
    names : sequence of str
        Those to solve; all by default.
    tell : callable, optional
        Called with every Verdict as soon as it is there.
    of : sequence of ExactProblem, optional
        Problems to choose from, instead of the built-in ones.

    Returns
    -------
    list of Verdict
        In the order of `names`.

    Raises
    ------
    ValueError
        An unknown name.

    Notes
    -----
    Source: each problem has its own; it is `pwsmooth verify`.

    Examples
    --------
    >>> from pwsmooth.compare.exact import verify
    >>> all(verdict.holds for verdict in verify(["hidden-term"]))
    True
    """
    known = {problem.name: problem for problem in of} if of is not None else problems()
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"`names` contains {unknown[0]!r}, which is no problem; choose from {', '.join(known)}."
        )
    verdicts = []
    for name in names or known:
        begin = time.perf_counter()
        try:
            checks, failure = tuple(known[name].answer()), ""
        except Exception as error:  # one broken problem must not hide the others
            checks, failure = (), f"{type(error).__name__}: {error}"
        verdicts.append(Verdict(known[name], checks, time.perf_counter() - begin, failure))
        if tell:
            tell(verdicts[-1])
    return verdicts
