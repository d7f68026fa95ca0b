"""Branches over one parameter and curves of bifurcations over two, by one call.

    follow(start, {p: ...})  ->  branches.py        follow(start, {p: ..., q: ...})  ->  two_parameters.py

Chain: branches.py, two_parameters.py -> **following**.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...door import checks
from ...paths.budget import MOST_STEPS, Budget, opened, within
from ..equilibria.equilibrium import Equilibrium
from ..orbits.periodic_orbit import PeriodicOrbit
from .bifurcations import BORDER
from .branch import Branch
from .branches import follow_branch
from .curves.starts import FOLLOWED
from .equilibria import curves as of_equilibria
from .special import Special
from .steps import Steps
from .two_parameters import follow_curve
from .way import How, Way, used_up

__all__ = ["follow"]

_COUNTED = 2**62  # steps of a budget that only counts them: an orbit that is begun is ended


@checks.door(
    start=checks.instance(
        (PeriodicOrbit, Equilibrium, Special),
        "an orbit or an equilibrium, from find_orbit() or find_equilibrium(); over two parameters also a special point "
        "of a branch, a curve or a diagram",
    ),
    over=checks.mapping, way=checks.optional(checks.one_of(1, -1)), virtual=checks.flag,
    kind=checks.optional(checks.one_of(*FOLLOWED, BORDER, *of_equilibria.FOLLOWED)),
    tests=checks.optional(checks.mapping), steps=checks.optional(checks.instance(Steps, "Steps(...)")),
)  # fmt: skip
def follow(
    start: PeriodicOrbit | Equilibrium | Special,
    over: Mapping[Any, Any],
    *,
    way: int | None = None,
    kind: str | None = None,
    switch: Any = None,
    virtual: bool = False,
    tests: Mapping[str, Callable[[Any], float]] | None = None,
    steps: Steps | None = None,
    max_steps: int = 10 * MOST_STEPS,
    max_seconds: float | None = None,
) -> Branch:
    """Follow a periodic orbit or an equilibrium over a parameter, or a bifurcation over two.

    Parameters
    ----------
    start : PeriodicOrbit, Equilibrium or Special
        The first orbit or equilibrium, converged. Over two parameters: one of the `specials` of a branch or a diagram;
        an orbit or equilibrium near to one, whose `kind` is given; or one of the `specials` of a curve, at which
        another `begins`.
    over : mapping of (str or Symbol) to float or (float, float), in the units of the parameters
        One parameter or two. One with a value: the branch goes from the start to there, and ends where it comes back to
        the value at which it began. With the least and the largest value, which hold that of the start: it goes both
        ways, to either. Two: a curve goes both ways within the ranges. For one of a set of equilibria (a stuck block's)
        a state: the set is followed along it.
    way : {1, -1}, optional
        With the range of one parameter: the branch goes only one way, to larger or to smaller values at first.
    kind : str, optional
        Of an orbit: "fold", "flip", "symmetry breaking", "torus" or "branch point"; or, on the side that does not touch
        it, "grazing impact", "grazing", "grazing-sliding", "grazing of an event" or "adding-sliding";
        "border collision"; or "capture", of a layered view with a finite ratio. Of an equilibrium: "fold", "Hopf",
        "sliding Hopf", "hidden fold", "pseudo-Hopf", "two-fold" or "boundary equilibrium" (of the switch or contact
        whose border is nearest). Of a point of codimension 2: one of what it `begins`, if that is more than one.
    switch : Switch, Symbol, str or Expr, optional
        Of an orbit that is about to graze: the switch, contact or event. Of a border collision: h(x), of states and
        parameters, which is 0 at the orbit's point on its section.
    virtual : bool
        Whether equilibria are followed beyond the surface, the bound of lambda or the reaction 0 at which they become
        virtual, in the same mode; without it a branch goes on in the mode beside. A curve then goes on where orbits are
        none of the exact system, whose impact has a negative speed or which have crossed a surface that they graze:
        their `success` is False.
    tests : mapping of str to callable, optional
        Functions of an orbit or an equilibrium that return a number: where one changes its sign its zero is located and
        listed as a special point of that name. A function of an orbit is one of its whole motion, not of its section,
        which moves along the branch.
    steps : Steps, optional
        In the arc of (x, q/width), the width being that of the range; of equilibria x and multipliers count relative to
        1 + what they are at first. By default 0.02, at most 0.1 and at least 1e-7 long; of curves 0.01, 0.05 and 1e-6.
    max_steps, max_seconds : int, float (s), optional
        Bounds of the whole, looked at after each orbit: what was followed until then is returned.

    Returns
    -------
    Branch
        Orbits or equilibria, bifurcations or points of codimension 2, and why it ended.

    Raises
    ------
    ValueError, TypeError
        A start that did not converge, an unknown parameter, a value at which the start already is, a range that leaves
        it out; `virtual` with an orbit over one parameter; a parameter for one of a set of equilibria; a bifurcation
        over one parameter, or of a kind that has no condition here; `way` over two parameters, `kind` or `switch` over
        one; `tests` that are no functions, or return no number.

    Notes
    -----
    Orbits of several applications of the map (`count`) end where they shrink onto one of fewer, at its flip: that is
    the branch's last bifurcation, and its orbit leads on. A branch also ends where orbits are not isolated, and where
    they do not repeat in the period that follows (a `period` given as a number while the frequency changes).

    A period is shot over in one piece as long as its multipliers allow it (up to 1e4), then in segments, as many as
    their growth asks for; they begin where the motion slips and no event is near, and move with the events.

    Source: Keller's arclength continuation (1977); changes of itinerary as in di Bernardo, Budd,
    Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008; Govaerts, Numerical Methods for Bifurcations of
    Dynamical Equilibria, 2000, for bordered test functions; Kuznetsov, Elements of Applied Bifurcation Theory, for the
    names.

    >>> t, x, v = sp.symbols("t x v", real=True)
    >>> F = sp.Symbol("F", positive=True)
    >>> dry = System({x: v, v: sp.sin(2*t) - x - F*sp.sign(v)}, time=t, parameters={F: 0.3})
    >>> orbit = find_orbit(dry, {x: 1, v: 0.5}, seen=Strobe(sp.pi, symmetry={x: -x, v: -v}))
    >>> [b.kind for b in follow(orbit, {F: 0.8}, steps=Steps(first=0.1)).specials]
    ['crossing-sliding']

    The flip of the Henon map, 4 a = 3 (1 - b)**2:

    >>> t, x, y, a, b = sp.symbols("t x y a b", real=True)
    >>> step = Event(every=1, update={x: 1 - a * x**2 + y, y: b * x})
    >>> henon = System({x: 0 * x, y: 0 * y}, time=t, parameters={a: 0.1, b: 0.3}, events=[step])
    >>> orbit = find_orbit(henon, {x: 0.6, y: 0.2}, seen=Strobe(1, phase=0.5))
    >>> (flip,) = follow(orbit, {a: 0.6}).of_kind("flip")
    >>> curve = follow(flip, {a: (0, 2), b: (-0.5, 0.5)})
    >>> p, q = curve.values
    >>> bool(abs(4 * p - 3 * (1 - q) ** 2).max() < 1e-8)
    True

    Where the equilibrium of x' = a - x**3 is 1/2:

    >>> still = find_equilibrium(System({x: a - x**3}, parameters={a: 1}), {x: 1})
    >>> (half,) = follow(still, {a: 0}, tests={"half": lambda e: e.x[0] - 0.5}).of_kind("half")
    >>> print(f"{half.parameter:.9f}")
    0.125000000
    """
    steps, two = steps or Steps(), len(over) == 2
    bound = opened(max_steps, max_seconds)
    own = {name: _test(name, function) for name, function in (tests or {}).items()}
    with within(Budget(_COUNTED)) as counted:

        def stops(way: Way) -> str:
            return used_up(way) if _COUNTED - counted.left >= bound.left or bound.late() else ""

        lengths = steps._lengths(0.01, 0.05, 1e-6) if two else steps._lengths(0.02, 0.1, 1e-7)
        how = How(lengths, steps.max_points, stops, virtual, own, bound)
        if two:
            if way is not None:
                raise ValueError("`way` is for one parameter; leave it out: over two a curve goes both ways.")
            return follow_curve(start, over, kind, switch, how)
        if len(over) != 1:
            raise ValueError(
                f"`over` names {checks.listing(over)}; give one parameter for a branch, two for a curve of "
                "bifurcations."
            )
        if not isinstance(start, (PeriodicOrbit, Equilibrium)):
            raise TypeError(
                f"`start` is {checks.shown(start)}, which is followed over two parameters; give two, or an orbit or an "
                "equilibrium."
            )
        for name, value in (("kind", kind), ("switch", switch)):
            if value is not None:
                raise ValueError(
                    f"`{name}` is for curves over two parameters; leave it out, or give a second one."
                )
        ((parameter, to),) = over.items()
        return follow_branch(start, parameter, to, way, how)


def _test(name: Any, function: Any) -> Callable[[Any], float]:
    """A test of the user's own, whose values are numbers."""
    if not isinstance(name, str) or not callable(function):
        raise TypeError(
            f"`tests` has {checks.shown(name)}: {checks.shown(function)}; give a function for each name."
        )

    def value(point: Any) -> float:
        found = function(point)
        if np.ndim(found) or not np.isreal(found):
            raise TypeError(
                f"`tests` of {name!r} gave {checks.shown(found)}; give a function that returns a number."
            )
        return float(found)

    return value
