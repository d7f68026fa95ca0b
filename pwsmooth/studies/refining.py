"""A sweep that may be looked at while it runs: chunks that spread over all axes first, and fill the gaps later.

The points are numbered as the sweep does, the last axis fastest. An axis of N values is taken in the order of van der
Corput's sequence: i before j where its bits, read backwards, are the smaller number. Of several axes the grid of every
2^l-th value of all is complete before the finer one begins.

Chain: plan.py, chunk.py -> **refining** -> sweep(), pages that draw while they compute.
"""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.maps.seen import Return, Strobe
from ..door import calls, checks
from ..paths.budget import Stop
from ..paths.interrupts import noted, result
from ..results.records import Outcome
from .axes import Axes
from .chunk import goes_as_ensemble, run_chunk
from .measures import Period, Points
from .plan import Plan, read_plan

if TYPE_CHECKING:
    import xarray

_FIRST = 40  # points in the first chunk: enough to see where things are
_SECONDS = 0.05  # of processor time in a later one: a picture that grows by its chunks moves
_GROWTH = 4  # of a chunk over the one before it
_SETTLED = 50  # periods after which an orbit that repeats is finished
_REPEATS = 32  # strobes that have to repeat
_LEAVES = 4  # times: growth of the misses in 16 strobes, of a multiplier 1.09; 1.09^200 * 1e-11 is not seen
_ROUNDING = 1e-14  # misses below do not tell


@checks.door()
@dataclass(frozen=True)
class SweepPlan:
    """A sweep that is checked and has not run: what `refine` takes.

    Attributes
    ----------
    plan : Plan
        What the value of a point depends on.
    where : Axes
        The points.

    >>> x, a = sp.symbols("x a", real=True)
    >>> decay = System({x: -a * x}, parameters={a: 1})
    >>> plan = make_plan(decay, {a: [1, 2, 3], x: [1, 2]}, t_span=(0, 1), measures=["counts"])
    >>> plan.shape, plan.values([0, 5])
    ((3, 2), {'a': array([1., 3.]), 'x': array([1., 2.])})
    """

    plan: Plan
    where: Axes

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values along the axes."""
        return self.where.shape

    @property
    def size(self) -> int:
        """Number of points."""
        return self.where.size

    def values(self, indices: Any) -> dict[str, np.ndarray]:
        """What is swept, at some points.

        Parameters
        ----------
        indices : sequence of int, length k
            Numbers of points, the last axis fastest.

        Returns
        -------
        dict of str to ndarray, shape (k,)
            Name -> values, in its unit.
        """
        return self.where.at(_indices(indices, self.size, "`indices`"))

    def dataset(self, chunks: Any) -> xarray.Dataset:
        """Chunks of `refine` as the Dataset of `sweep`.

        Parameters
        ----------
        chunks : iterable of (ndarray of int, dict of str to ndarray), shape (k,)
            In the units of the sweep, as `refine` yields them; a generator is run to its end.

        Returns
        -------
        xarray.Dataset
            Points that are in no chunk have the outcome `not_run`.
        """
        from .dataset import make_dataset

        arrays = self.plan.empty(self.size)
        for indices, values in chunks:
            for name, found in values.items():
                arrays[name][indices] = found
        return make_dataset(self.plan, self.where, arrays)


@checks.door((*calls.POINTS, "record"))
def make_plan(
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
    **options: Any,
) -> SweepPlan:
    """Check a sweep without running it.

    Parameters
    ----------
    system : System or Scene
        As all that follows as of `sweep`, whose page says more.
    axes : mapping of name to sequence of float, any length
        A grid, in the units of the model.
    points : mapping of name to sequence of float, all of one length
        A list of points, in the units of the model.
    measures : sequence of Measure, str or callable
        What is kept of each orbit.
    units : mapping of name to str
        Of parameters, states, outputs and time.
    noise : Kicks or Diffusion, optional
        As for `solve`.
    **options
        rtol, atol, method, order, max_step, max_steps, parameters of `solve`; `record`.

    Returns
    -------
    SweepPlan
        For `refine`.

    Raises
    ------
    ValueError, TypeError
        Bad input, as `sweep` says it.

    >>> x, a = sp.symbols("x a", real=True)
    >>> decay = System({x: -a * x}, parameters={a: 1})
    >>> make_plan(decay, {a: [1, 2, 3]}, x0={x: 1}, t_span=(0, 1), measures=["counts"]).size
    3
    """
    plan, where = read_plan(
        system, axes, points, x0, measures, t_span, measure_from, seen, transient, periods, units, noise, options,
    )  # fmt: skip
    _ = plan.variables  # two measures of one name are refused before anything runs
    return SweepPlan(plan, where)


def spread(shape: Sequence[int]) -> np.ndarray:
    """Numbers of all points of a grid, those first that spread over it."""
    depth, place = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    for k, size in enumerate(shape):
        bits = max(1, (size - 1).bit_length())
        i = np.arange(size)
        backwards = sum(((i >> b) & 1) << (bits - 1 - b) for b in range(bits))
        # How fine a grid has to be to have the value: 0 of the first one, then the place of the lowest bit.
        fine = np.where(i == 0, 0, bits - np.log2(np.maximum(i & -i, 1)).astype(np.int64))
        along = [1] * len(shape)
        along[k] = size
        depth = np.maximum(depth, fine.reshape(along))
        place = (place << bits) + np.asarray(backwards).reshape(along)
    return np.lexsort((place.ravel(), depth.ravel()))


@checks.door()
def refine(
    plan: SweepPlan,
    order: Iterable[int] | None = None,
    max_seconds: float | None = None,
    *,
    settle: float | None = 1e-6,
    workers: int = 1,
) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Run a sweep chunk by chunk, the coarse picture first, for as long as it is wanted.

    It ends when the generator is closed (`break` out of the loop is enough), when `max_seconds` are spent, or with the
    last point. Chunks take about a twentieth of a second.

    Parameters
    ----------
    plan : SweepPlan
        Of `make_plan`.
    order : iterable of int, optional
        Numbers of the points to run, in this order; by default all of them, so that each chunk spreads over the whole
        range of every axis (van der Corput's sequence). Of an iterator no more is taken than a chunk needs: what comes
        later may follow from what was found.
    settle : float, dimensionless, optional
        With a period of a drive and the measures `Points` and `Period` alone: an orbit whose last 32 strobes of 50
        repeat within settle (1 + abs(x)), less and less or evenly so, is finished then, and its later points are those
        of the cycle. None runs all orbits to their end, with the bits of `sweep`.
    workers : int
        Threads.

    Returns
    -------
    iterator of (ndarray of int, shape (k,), dict of str to ndarray)
        Numbers of the points in a chunk, and the variables of `sweep`'s Dataset there, each with k rows.

    Raises
    ------
    ValueError, TypeError
        Numbers that are none of points, `max_seconds` that are not positive.

    Notes
    -----
    A settled orbit that still creeps, by less than settle a period, is off by that times the periods that are left out.

    A period doubling, seen after the first chunk:

    >>> x, t, c = sp.symbols("x t c", real=True)
    >>> clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: c * x * (1 - x)})
    >>> logistic = System({x: 0*x}, time=t, parameters={c: 3}, events=[clock])
    >>> plan = make_plan(logistic, {c: np.linspace(2.5, 3.4, 400)}, x0={x: 0.3}, seen=Strobe(1), periods=8,
    ...                  measures=[Points(last=2)])
    >>> for indices, found in refine(plan):
    ...     doubled = np.ptp(found["x_points"], axis=1) > 0.1
    ...     print(len(indices), 2.99 < plan.values(indices)["c"][doubled].min() < 3.1)
    ...     break
    40 True
    """
    if not isinstance(plan, SweepPlan):
        raise TypeError(f"`plan` is {checks.shown(plan)}; give what make_plan() returns.")
    most = checks.optional(checks.positive)(max_seconds, "`max_seconds`")
    settle = checks.optional(checks.positive)(settle, "`settle`")
    workers = checks.whole(workers, "`workers`", 1)
    numbers, stop = ordered(plan, order), Stop()
    short = None if settle is None else _shortened(plan.plan)

    def values(points: np.ndarray) -> tuple[dict[str, np.ndarray]]:
        columns = plan.where.at(points)
        if short is None or settle is None:
            return (run_chunk(plan.plan, columns, stop=stop),)
        return (_settled_first(plan.plan, short, columns, settle, stop),)

    return in_chunks(values, numbers, most, workers, stop)


def ordered(plan: SweepPlan, order: Any) -> Iterable[int]:
    """The numbers of an argument `order`, checked: those of an iterator when they are taken."""
    if isinstance(order, Iterator):
        return (checks.whole(k, "`order`", 0, plan.size - 1) for k in order)
    return spread(plan.shape) if order is None else _indices(order, plan.size, "`order`")


def _indices(given: Any, size: int, what: str) -> np.ndarray:
    try:
        found = np.asarray(given)
    except (TypeError, ValueError):
        found = np.array(given, object)
    if found.ndim != 1 or (found.size and found.dtype.kind not in "iu"):
        raise TypeError(f"{what} is {checks.shown(given)}; give whole numbers of points, 0 to {size - 1}.")
    if found.size and not 0 <= found.min() <= found.max() < size:
        raise ValueError(f"{what} reaches from {found.min()} to {found.max()}; points are 0 to {size - 1}.")
    return found.astype(np.int64)


def in_chunks(
    work: Callable[[np.ndarray], tuple[Any, ...]],
    order: Iterable[int],
    budget: float | None,
    workers: int = 1,
    stop: Stop | None = None,
) -> Iterator[tuple[Any, ...]]:
    """(numbers, *work(numbers)) of the points in this order, in chunks whose size follows from the time of the last.

    `stop` is set where nobody waits for more.
    """

    def timed(points: np.ndarray) -> tuple[tuple[Any, ...], float]:
        begin = time.thread_time()
        return work(points), time.thread_time() - begin

    # In threads of its own: in this one Ctrl-C would be heard only at the end of a chunk.
    pool = ThreadPoolExecutor(workers)
    running: deque[tuple[np.ndarray, Any]] = deque()
    size, waiting, left, wide = _FIRST, iter(order), math.inf if budget is None else budget, 1
    try:
        while True:
            while len(running) < wide and left > 0:
                points = np.fromiter(itertools.islice(waiting, size), np.int64)
                if not len(points):
                    break
                running.append((points, pool.submit(timed, points)))
            if not running:
                return
            points, future = running.popleft()
            with noted() as look:
                found, seconds = result(future, look)
            left, wide = left - seconds, workers  # the first chunk compiles what the others use
            size = int(np.clip(len(points) * _SECONDS / max(seconds, 1e-6), 1, _GROWTH * len(points)))
            yield points, *found
    finally:
        if stop is not None:
            stop.set()
        pool.shutdown(cancel_futures=True)


def _shortened(plan: Plan) -> Plan | None:
    """The plan up to where an orbit may have settled; None where none is finished early."""
    longest = plan.setting.period_detector.max_count
    periods = _REPEATS - 1 + longest
    whole = max(_SETTLED, periods)
    if (
        not isinstance(plan.seen, Strobe)
        or not goes_as_ensemble(plan)
        or plan.transient + plan.periods <= whole
    ):
        return None
    if not all(isinstance(measure, (Points, Period)) for measure in plan.measures):
        return None
    return replace(
        plan, transient=whole - periods, periods=periods, measures=(Points(*plan.setting.states),),
        setting=replace(plan.setting, periods=periods),
    )  # fmt: skip


def _settled_first(
    plan: Plan, short: Plan, columns: Mapping[str, np.ndarray], settle: float, stop: Stop
) -> dict[str, np.ndarray]:
    """The variables of a chunk; orbits that repeat are not run to their end, the others are run from their start."""
    states = plan.setting.states
    found = run_chunk(short, columns, stop=stop)
    x = np.stack([found[f"{name}_points"] for name in states], axis=-1)  # (points, strobes, n)
    count = len(x)
    cycle, detector = np.zeros(count, int), plan.setting.period_detector
    reported = np.zeros(count, int)
    for lag in range(detector.max_count, 0, -1):
        near, far = x[:, -_REPEATS:], x[:, -_REPEATS - lag : -lag]
        off = (np.abs(near - far) / (1 + np.abs(far))).max(axis=2)
        worst, half = off.max(axis=1), _REPEATS // 2
        # What leaves an orbit that repels repeats for a while as well, each time a little less nearly.
        leaves = off[:, half:].max(axis=1) > np.maximum(_LEAVES * off[:, :half].max(axis=1), _ROUNDING)
        cycle[(worst <= settle) & ~leaves] = lag
        reported[(worst <= detector.tol) & ~leaves] = lag
    settled = (found["outcome"] == Outcome.FINISHED) & (cycle > 0) & (reported > 0)
    values = plan.empty(count)
    if not settled.all():
        rest = run_chunk(plan, {name: column[~settled] for name, column in columns.items()}, stop=stop)
        for name, kept in rest.items():
            values[name][~settled] = kept
    rows = np.flatnonzero(settled)
    # Strobe number s, the last one of the short run being e, is that number e - (e - s) mod cycle.
    ahead = short.transient + short.periods - (plan.transient + plan.periods)
    for measure in plan.measures:
        if isinstance(measure, Period):
            values["period"][rows] = reported[rows]
            continue
        for name, variable in measure.variables(plan.setting).items():
            back = np.arange(variable.shape[0])[::-1] + ahead
            at = -1 - back % cycle[rows, None]
            values[name][rows] = x[rows[:, None], at, states.index(name.removesuffix("_points"))]
    values["t_reached"][rows] = plan.windows(columns, count)[2][rows]
    values["ambiguities"][rows] = found["ambiguities"][rows]
    values["outcome"][rows] = found["outcome"][rows]
    return values
