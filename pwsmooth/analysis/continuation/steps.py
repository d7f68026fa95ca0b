"""How a branch or a curve is walked along: the lengths of its steps, and how many points it may have.

Chain: **steps** -> following.py, diagrams.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...door import checks

__all__ = ["Steps"]


@checks.door()
@dataclass(frozen=True)
class Steps:
    """The steps along a branch or a curve, in the arc of scaled states and parameters that its tool describes.

    Parameters
    ----------
    first, longest, shortest : float, in units of the arc, optional
        Length of the first step, of the longest, and of the shortest that is tried; by default those of the tool.
    max_points : int
        Largest number of points, of a curve to either side.

    Raises
    ------
    ValueError, TypeError
        Lengths that are not positive, no points.

    >>> x, a = sp.symbols("x a", real=True)
    >>> start = find_equilibrium(System({x: a - x**3}, parameters={a: 1}), {x: 1})
    >>> len(follow(start, {a: 8}, steps=Steps(longest=0.01, max_points=5)).points)
    5
    """

    first: float | None = None
    longest: float | None = None
    shortest: float | None = None
    max_points: int = 500

    def __post_init__(self) -> None:
        lengths = dict.fromkeys(("first", "longest", "shortest"), checks.optional(checks.positive))
        checks.fields(self, **lengths, max_points=checks.integer(1, 10**6))

    def _lengths(self, *usual: float) -> tuple[float, ...]:
        """(first, longest, shortest), of which those that are not given are the usual ones."""
        given = (self.first, self.longest, self.shortest)
        return tuple(own if one is None else one for one, own in zip(given, usual, strict=True))
