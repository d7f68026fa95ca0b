"""Problems with exact answers: solve each, set the computed numbers beside the exact ones.

A problem is a statement, where its answer comes from, and a function that solves it and returns Checks. The
command `pwsmooth verify` runs the list on the user's machine; the tests run the same list.
Chain: contract.py -> catalogue.py (the problems) -> **this file** -> cli.py.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from ...door import checks
from ...door.documenting import complete
from .contract import ExactProblem, Verdict

__all__ = ["problems", "verify"]


@complete
def problems() -> dict[str, ExactProblem]:
    """Every built-in problem by its name.

    Returns
    -------
    dict of str to ExactProblem
        In the order of `pwsmooth verify`.

    Source: each problem has its own.

    >>> "hidden-term" in problems()
    True
    """
    from .catalogue import PROBLEMS

    return {problem.name: problem for problem in PROBLEMS}


@checks.door()
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

    Source: each problem has its own; it is `pwsmooth verify`.

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
