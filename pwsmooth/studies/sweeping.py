"""sweep(): a system over a grid or a list of points, through an executor, into a Dataset or a store.

Chain: plan.py, refining.py, running.py, work.py -> **sweeping** -> study.py, attraction.py.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

from ..analysis.maps.seen import Return, Strobe
from ..door import calls, checks
from .refining import make_plan
from .work import Work

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray

__all__ = ["sweep"]


@checks.door((*calls.POINTS, "record"), work=checks.optional(checks.instance(Work, "Work(...)")))
def sweep(
    system: Any,
    axes: Mapping[Any, Sequence[float]] | None = None,
    x0: Mapping[Any, float] | Sequence[float] | None = None,
    seen: Strobe | Return | None = None,
    *,
    points: Mapping[Any, Sequence[float]] | None = None,
    measures: Any = ("sticks", "itinerary", "period"),
    transient: int = 100,
    periods: int = 20,
    t_span: Sequence[float] | None = None,
    measure_from: float | None = None,
    units: Mapping[Any, str] | None = None,
    noise: Any = None,
    work: Work | None = None,
    max_seconds: float | None = None,
    **options: Any,
) -> xarray.Dataset:
    """Run a system over a grid or a list of points and keep measures of every orbit.

    Event-driven systems run in compiled code on all cores, with the arithmetic of `solve`: a point of a sweep and a
    solve over the same span with the same tolerances give the same bits. Smoothed and noisy systems, and
    functions of the Solution, run through `solve`, point by point.

    Parameters
    ----------
    system : System or Scene
        A scene brings its start, period and units.
    axes : mapping of name to sequence of float, any length
        A grid: parameters, initial values of states, the time symbol (start time), "seed" or "trajectory" of the
        noise; in the units of the model.
    seen : Strobe or Return, optional
        An orbit runs for `transient` periods of the drive (returns of an autonomous system) unseen, then `periods` more
        are measured. One that is not back in time has the outcome no_return_to_the_section.
    points : mapping of name to sequence of float, all of one length
        A list of points, one of each sequence, in the units of the model; with `axes` too, the whole grid at every
        point of the list.
    measures : sequence of Measure, str or callable
        Names ("sticks", "itinerary", "period", "amplitude(y)", "extremes(y)", "statistics(mu)", "points(y, v)",
        "counts", "lyapunov"), Measures of this module, functions of the Solution.
    units : mapping of name to str
        Of parameters, states, outputs and time; they label coordinates and variables.
    noise : Kicks or Diffusion, optional
        As for `solve`; the axes "seed" and "trajectory" replace its numbers.
    work : Work, optional
        Executor, workers, chunk, store, progress.
    max_seconds : float, in units of wall time, s, optional
        Bound on the whole sweep. Points that it leaves out have the outcome TIME_LIMIT; in a store they have not run,
        and the same call goes on with them.
    **options
        rtol, atol, method, order, max_step, max_steps, parameters of `solve`; `record`, a Recorder without a folder,
        makes every point a run of a large family by local events, of which functions of the Solution see the catalogue.

    Returns
    -------
    xarray.Dataset
        Dimensions are the axes. `outcome` holds for every point how its run ended (>= 0 is success, in words
        in its attribute flag_meanings), `t_reached` where; a failed point has nan, -1 or "" in its measures.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.
    RuntimeError
        A worker process was lost.

    >>> t, y, v = sp.symbols("t y v", real=True)
    >>> k, sigma = sp.symbols("k sigma", positive=True)
    >>> lam = Switch("lam", v)
    >>> block = System({y: v, v: -sigma*sp.sin(t) - k*y - v/10 - lam}, time=t, parameters={k: 3.1, sigma: 2.4})
    >>> found = sweep(block, {"sigma": [1.2, 2.4]}, x0={"y": 0.5, "v": 0.3}, seen=Strobe(2*sp.pi),
    ...               measures=["itinerary", "amplitude(y)"], units={"y": "m"})
    >>> found.itinerary.values.tolist()
    ['S R S L', 'R L']

    Van der Pol's oscillator has no drive: it is measured from return to return, here to its right turning point:

    >>> x, u = sp.symbols("x u", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> pol = System({x: u, u: mu*(1 - x**2)*u - x}, parameters={mu: 1})
    >>> found = sweep(pol, {"mu": [0.1, 1.0]}, x0={"x": 1, "u": 0}, seen=Return(u, -1),
    ...               measures=["period", "amplitude(x)"])
    >>> found.period_time.values.round(5).tolist()
    [6.28711, 6.66329]
    """
    from ..codegen.machine.workers import cores
    from ..door import checks
    from ..paths.budget import spending
    from ..results.records import Outcome
    from .dataset import make_dataset
    from .running import chunk_target, run_chunks

    work = work or Work()
    planned = make_plan(
        system, axes, points=points, x0=x0, measures=measures, seen=seen, transient=transient, periods=periods,
        t_span=t_span, measure_from=measure_from, units=units, noise=noise, **options,
    )  # fmt: skip
    plan, where = planned.plan, planned.where
    limit = checks.optional(checks.positive)(max_seconds, "`max_seconds`")
    left = spending().remaining()  # of the call that this one is part of
    deadline = time.time() + min(left, math.inf if limit is None else limit)

    def target() -> int:
        threads = work.workers or getattr(work.executor, "_max_workers", None) or cores()
        return work.chunk or chunk_target(plan, where, threads, deadline)

    if work.store is not None:
        from .store import Store

        chunk_store = Store(work.store, plan, where, target)

        def complete(first: int, stop: int, result: dict[str, Any]) -> None:
            # A chunk that ran out of time is not stored: the same call runs it again.
            if not (result["outcome"] == Outcome.TIME_LIMIT).any():
                chunk_store.keep(first, stop, result)

        run_chunks(plan, where, chunk_store.todo, work, complete, deadline)
        return chunk_store.dataset()
    arrays = plan.empty(where.size)

    def keep(first: int, stop: int, result: dict[str, Any]) -> None:
        for name, values in result.items():
            arrays[name][first:stop] = values

    _, chunks = where.boxes(target())
    run_chunks(plan, where, chunks, work, keep, deadline)
    return make_dataset(plan, where, arrays)
