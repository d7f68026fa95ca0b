"""A diagram by one call: `diagram(system, parameter, range, x0, seen)`.

Chain: looking.py, tracing.py, work.py -> **one_parameter** -> study.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

from ..analysis.maps.seen import Return, Strobe
from ..door import calls, checks
from .looking import DOOR, SWEEPS, Starts, looking
from .plain import values_of
from .result import Diagram
from .tracing import traced
from .work import Store, Work, telling, working

__all__ = ["diagram"]


@checks.door((*calls.POINTS, "max_seconds"), **DOOR)
def diagram(
    system: Any,
    parameter: Any,
    range: tuple[float, float],
    x0: Starts | None = None,
    seen: Strobe | Return | None = None,
    *,
    orbits: Sequence[Any] = (),
    box: Mapping[Any, Any] | None = None,
    values: int = 60,
    transient: int = 200,
    keep: int = 16,
    max_count: int = 8,
    tol: float = 1e-6,
    max_depth: int = 6,
    max_branches: int = 60,
    max_points: int = 500,
    step: float = 0.005,
    longest_step: float = 0.03,
    shortest_step: float = 1e-7,
    virtual: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    store: Any = None,
    progress: bool | None = None,
    **options: Any,
) -> Diagram:
    """Find and follow everything over a range of a parameter: attractors, their branches, and those that begin there.

    Parameters
    ----------
    system : System
        Driven, seen by a Strobe, or autonomous, by a Return; for equilibria alone `seen` is left out.
    parameter : str or Symbol
        Of the system.
    range : (float, float), in the unit of the parameter
        The least and the largest value.
    x0 : mapping of state to float, or sequence of such, optional
        Where trajectories start at every value of the orbit diagram, in the units of the states.
    orbits : sequence of PeriodicOrbit or Equilibrium, any length
        More to begin with, at any value in the range.
    box : mapping of state to (float, float), in the units of the states, optional
        Of an autonomous system: equilibria in it are followed too, and the cycles from their Hopf points.
    values : int
        Of the parameter in the orbit diagram.
    max_branches, max_points : int
        Largest number of branches, and of points on each.
    step, longest_step, shortest_step : float, in units of the arc
        As of `follow`.
    virtual : bool
        Whether branches of equilibria go on where they are virtual.
    executor : concurrent.futures.Executor, optional
        Processes that follow branches; it needs to import what the system is made of.
    store : path, optional
        Zarr directory to which every branch is written as it finishes. The same call with the same store goes on where
        it was stopped, also by a kill, and gives the same result; another call's store is refused.
    **options
        For `solve`: rtol, atol, ... of all trajectories; those of the orbit diagram have rtol 1e-9 without.

    Returns
    -------
    Diagram
        Branches, bifurcations, the orbit diagram, and what is missing.

    Raises
    ------
    ValueError, TypeError
        Bad input; a store of another call.
    RuntimeError
        A worker process was lost.

    Notes
    -----
    Ends of trajectories that no branch explains begin new ones, until all are explained or no orbit is found beside
    them (chaos, long orbits, slow ones). Two branches are one if orbits of the one lie on the other.

    >>> t, x, a = sp.symbols("t x a", real=True)
    >>> logistic = System({x: 0 * x}, time=t, parameters={a: 3}, events=[Event(every=1, update={x: a * x * (1 - x)})])
    >>> found = diagram(logistic, a, (2.8, 3.5), {x: 0.3}, Strobe(1, phase=0.5), values=9)
    >>> len(found.branches), found.gaps, found.unexplained.tolist()
    (3, [], [])
    """
    name = checks.lookup(parameter, system.parameters, "`parameter`", "parameter").name
    bounds = checks.interval(range, "`range`")
    steps = {"step": step, "longest_step": longest_step, "shortest_step": shortest_step}
    look = looking(
        system, x0, seen, orbits, box, values, transient,
        keep, max_count, tol, max_depth, max_branches, max_points, steps, virtual, options,
    )  # fmt: skip
    kept = None
    if store is not None:
        kept = Store(store, "pwsmooth diagram", {**look.identity(), "parameter": name, "range": str(bounds)})
    with working(executor, workers) as hands, telling(progress) as tell:
        work = Work(traced, look.setting, hands, kept)
        sweeps = None if kept is None else kept.path / SWEEPS
        found = look.diagram(name, bounds, values_of(system), work, tell, sweeps)
    if kept is not None:
        found._write(kept.path)
    return found
