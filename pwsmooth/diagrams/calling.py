"""A diagram by one call, over one parameter or two: `diagram(system, {p: (low, high)}, x0, seen)`.

Chain: looking.py, tracing.py, over_two.py, tasks.py -> **calling** -> study.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..analysis.continuation.steps import Steps
from ..analysis.maps.seen import Return, Strobe, how_seen
from ..door import calls, checks
from ..studies.work import Work
from .growing import grown
from .looking import SWEEPS, looking
from .over_two import Growing, lines_in
from .plain import values_of
from .result import TITLE, Diagram
from .sets import TITLE as TITLE_OF_SET
from .sets import BifurcationSet
from .tasks import RESULT, Store, Tasks, telling, working, write_group
from .tracing import traced

__all__ = ["diagram"]


@checks.door(
    (*calls.POINTS, "max_seconds"),
    system=checks.system, over=checks.mapping, seen=checks.optional(how_seen), lines=checks.optional(checks.mapping),
    box=checks.optional(checks.mapping), values=checks.integer(2, 10**6), transient=checks.integer(0),
    tol=checks.positive, max_count=checks.integer(1, 10_000), max_depth=checks.integer(0, 1000),
    max_branches=checks.integer(1, 10**6), virtual=checks.flag,
    steps=checks.optional(checks.instance(Steps, "Steps(...)")),
    work=checks.optional(checks.instance(Work, "Work(...)")),
)  # fmt: skip
def diagram(
    system: Any,
    over: Mapping[Any, tuple[float, float]],
    x0: Any = None,
    seen: Strobe | Return | None = None,
    *,
    lines: Mapping[Any, Sequence[float]] | None = None,
    box: Mapping[Any, Any] | None = None,
    values: int = 60,
    transient: int = 200,
    tol: float = 1e-6,
    max_count: int = 8,
    max_depth: int = 6,
    max_branches: int = 60,
    virtual: bool = False,
    steps: Steps | None = None,
    work: Work | None = None,
    **options: Any,
) -> Diagram | BifurcationSet:
    """Find and follow all attractors over a parameter and the branches that begin there; over two, their bifurcations.

    Parameters
    ----------
    system : System
        Driven, seen by a Strobe, or autonomous, by a Return; for equilibria alone `seen` is left out.
    over : mapping of (str or Symbol) to (float, float), in the units of the parameters
        One parameter or two, each with the least and the largest value.
    x0 : mapping of state to float, PeriodicOrbit, Equilibrium, or sequence of such, optional
        Where trajectories start at every value of the orbit diagram, in the units of the states; orbits and equilibria
        to begin with, at any value in the range (on the lines).
    lines : mapping of (str or Symbol) to sequence of float, any length, optional
        Over two parameters: values, in its unit, at which either is held, while the other one goes over its range. By
        default one each, in the middle.
    box : mapping of state to (float, float), in the units of the states, optional
        Of an autonomous system: equilibria in it are followed too, and the cycles from their Hopf points; over two
        parameters also curves of their folds, Hopf points and boundary equilibria.
    values : int
        Of the parameter in the orbit diagram.
    transient : int
        Periods or returns before a trajectory counts as one that has ended.
    tol : float, dimensionless
        How near two points of a trajectory are that count as one, relative to 1 + abs(x).
    max_count : int
        Longest orbit that is looked for, in periods or returns.
    max_depth : int
        Of branches on branches on branches.
    max_branches : int
        Largest number of branches (on a line), and of curves.
    virtual : bool
        Whether branches of equilibria, and curves, go on where they are virtual.
    steps : Steps, optional
        Of branches, by default 0.005, at most 0.03 and at least 1e-7 long in the arc of `follow`. Curves have the
        lengths of `follow`, and as many points to either side.
    **options
        For `solve`: rtol, atol, ... of all trajectories; those of the orbit diagram have rtol 1e-9 without.

    Returns
    -------
    Diagram or BifurcationSet
        Over one parameter branches, bifurcations, the orbit diagram, and what is missing. Over two the curves of
        bifurcations, points of codimension 2, and the diagrams along the lines.

    Raises
    ------
    ValueError, TypeError
        Bad input; a store of another call.
    RuntimeError
        A worker process was lost.

    Notes
    -----
    Ends of trajectories that no branch explains begin new ones, until all are explained or no orbit is found beside
    them (chaos, long orbits, slow ones). Two branches are one if orbits of the one lie on the other. A curve that meets
    none of the lines is not found. Two curves are one if a point of the one lies on the other, with the same orbit or,
    by a symmetry, its mirror image.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 3}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> found = diagram(logistic, {a: (2.8, 3.5)}, {x: 0.3}, Strobe(1, phase=0.5), values=9)
    >>> len(found.branches), found.gaps, found.unexplained.tolist()
    (3, [], [])

    The flips of x -> a - x**2 + b x lie on 4 a = (1 + b) (3 - b):

    >>> b = sp.Symbol("b", real=True)
    >>> step = Event(every=1, update={x: a - x**2 + b * x})
    >>> quadratic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
    >>> found = diagram(quadratic, {a: (-1, 1), b: (-0.5, 0.5)}, {x: 0.1}, Strobe(1, phase=0.5), values=6)
    >>> p, q = found.of_kind("flip")[0].values
    >>> bool(abs(4 * p - (1 + q) * (3 - q)).max() < 1e-8)
    True
    """
    names = [checks.lookup(key, system.parameters, "`over`", "parameter").name for key in over]
    bounds = [checks.interval(pair, f"`over` of {name}") for name, pair in zip(names, over.values())]
    if len(names) not in (1, 2):
        raise ValueError(
            f"`over` names {checks.listing(names)}; give one parameter, or two for a set of bifurcations."
        )
    if lines is not None and len(names) == 1:
        raise ValueError("`lines` are for two parameters; leave them out, or name a second one in `over`.")
    held = lines_in(lines, names, bounds) if len(names) == 2 else []
    work, steps = work or Work(), steps or Steps()
    look = looking(
        system, x0, seen, box, virtual, options, values=values, transient=transient, tol=tol, max_count=max_count,
        max_depth=max_depth, max_branches=max_branches, steps=steps,
    )  # fmt: skip
    kept = None
    if work.store is not None:
        about = {"over": str(dict(zip(names, bounds))), "lines": str(held)}
        kept = Store(work.store, TITLE_OF_SET if held else TITLE, {**look.identity(), **about})
    sweeps = None if kept is None else kept.path / SWEEPS
    with working(work) as hands, telling(work) as tell:
        tasks = Tasks(traced, look.setting, hands, kept)
        if not held:
            found: Any = look.diagram(names[0], bounds[0], values_of(system), tasks, tell, sweeps)
        else:
            diagrams = []
            for number, (name, value) in enumerate(held):
                k = 1 - names.index(name)
                at, folder = {**values_of(system), name: value}, sweeps and sweeps / str(number)
                diagrams.append(look.diagram(names[k], bounds[k], at, tasks, tell, folder))
            curves = Tasks(grown, look.setting, hands, kept)
            growing = Growing(curves, names, bounds, steps.max_points, virtual, max_branches, tell)
            growing.grow(diagrams, held)
            found = BifurcationSet(
                tuple(names), tuple(bounds), growing.found, diagrams, tuple(held), tuple(growing.lost)
            )
    if kept is not None:
        write_group(kept.path, RESULT, found._item())
    return found
