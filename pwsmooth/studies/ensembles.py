"""Ensembles: many trajectories of one system with noise, of which only what is asked for is kept.

Chain: **this file** -> diffusion_run.py and kernels/noise/path.py (one compiled loop), or solve() for kicks.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..door import calls, checks
from ..door.documenting import complete
from ..noise.diffusion import Diffusion
from ..noise.diffusion_run import DiffusionRun, Path
from ..noise.kicks import Kicks
from ..paths.budget import MOST_STEPS, Budget, within
from ..results.records import Outcome

__all__ = ["Ensemble", "ensemble"]

_VISIT = 0.1  # s of compiled code between two looks at the keyboard


@complete
@dataclass(frozen=True)
class Ensemble:
    """Many trajectories of one system with noise.

    Attributes
    ----------
    t : ndarray, shape (nt,)
        The asked-for times, in the unit of the model's time.
    x : ndarray, shape (count, n, nt)
        States there, in the units of the model; nan where a trajectory had ended before.
    end_time, end : ndarray, shapes (count,) and (count, n)
        Where and in which state each ended, in the units of the model.
    outcomes : tuple of Outcome
        How each ended.
    steps : ndarray of int, shape (count,)
        Numbers of steps, dimensionless.
    states : tuple of str
        Names of the states.

    >>> x = sp.Symbol("x")
    >>> noise = Diffusion({x: 1}, step=1 / 16, seed=1)
    >>> many = ensemble(System({x: -x}), (0, 1), {x: 0}, noise, 5, t_eval=[0.5, 1.0])
    >>> many["x"].shape, many.end.shape
    ((5, 2), (5, 1))
    """

    t: np.ndarray
    x: np.ndarray
    end_time: np.ndarray
    end: np.ndarray
    outcomes: tuple[Outcome, ...]
    steps: np.ndarray
    states: tuple[str, ...]

    def __contains__(self, name: Any) -> bool:
        """Whether indexing takes a name (or Symbol)."""
        return str(checks.named(name)) in self.states

    def __getitem__(self, name: Any) -> np.ndarray:
        """One state by name or Symbol, shape (count, nt)."""
        if str(name) not in self.states:
            raise KeyError(f"{str(name)!r} is no state of this ensemble; they are {', '.join(self.states)}.")
        return self.x[:, self.states.index(str(name))]


@checks.door(
    (*calls.STEPS, "method", "strict"),
    system=checks.system, noise=checks.instance((Kicks, Diffusion), "Kicks(...) or Diffusion(...)"),
    count=checks.integer(1, 10**8), max_seconds=checks.optional(checks.positive),
    parameters=checks.optional(checks.mapping),
)  # fmt: skip
def ensemble(
    system: Any,
    t_span: Any,
    x0: Any,
    noise: Kicks | Diffusion,
    count: int,
    *,
    t_eval: Any = None,
    parameters: Mapping[Any, float] | None = None,
    max_steps: int = MOST_STEPS,
    max_seconds: float | None = None,
    **options: Any,
) -> Ensemble:
    """Run many trajectories of a system with noise, of which only what is asked for is kept.

    Trajectory k has the noise `replace(noise, trajectory=noise.trajectory + k)` and is to the bit what solve() gives.
    So an ensemble may be cut into parts, in any order, on any number of workers. Those of a Diffusion run in one
    compiled loop.

    Parameters
    ----------
    system : System
        A system or one of its views.
    t_span : (float, float), in the unit of the model's time
        Start and end.
    x0 : mapping, sequence, or ndarray of shape (count, n)
        One start for all, or one a trajectory, in the units of the states.
    noise : Kicks or Diffusion
        With the seed of all and the number of the first trajectory.
    count : int
        Number of trajectories.
    t_eval : array_like, shape (nt,), in the unit of the model's time, optional
        Times of the states that are kept; without it only the ends are.
    parameters : mapping of Symbol to float, optional
        Values that replace the system's own, in its units.
    max_steps : int
        Bound on the steps of a trajectory.
    max_seconds : float, in units of wall time, s, optional
        Bound on the whole call; a trajectory that it stops, or keeps from starting, has the outcome TIME_LIMIT.
    **options
        With Kicks: further options of `solve`.

    Returns
    -------
    Ensemble
        Kept states, ends and outcomes.

    Raises
    ------
    ValueError, TypeError
        As `solve`; starts of a wrong shape.

    The stationary variance of dx = -x dt + dW is 1/2:

    >>> x = sp.Symbol("x")
    >>> many = ensemble(System({x: -x}), (0, 4), {x: 0}, Diffusion({x: 1}, step=1 / 16, seed=1), 2000)
    >>> bool(abs(many.end.var() - 0.5) < 0.1)
    True
    """
    if parameters is not None:
        system = system.with_parameters(parameters)
    t0, t1 = checks.span(t_span)
    if isinstance(x0, np.ndarray) and x0.ndim == 2:
        if len(x0) != count:
            raise ValueError(f"`x0` has {len(x0)} rows for {count} trajectories; give one row each.")
        starts = np.array([system.initial_state(row, t0) for row in x0], float)
    else:
        starts = np.array([system.initial_state(x0, t0)], float)
    times = checks.wanted_times(t_eval, t0, t1)
    max_steps = checks.whole(max_steps, "`max_steps`", 1)
    run = DiffusionRun(system, noise) if isinstance(noise, Diffusion) else None
    if options and run is not None and run.acts:
        raise ValueError(f"{checks.listing(options)} do not act on a diffusion; leave them out.")
    with within(Budget(seconds=max_seconds)) as spending:
        if run is not None and run.acts:
            return _all_at_once(run, (t0, t1), starts, count, times, max_steps, spending)
        return _one_by_one(system, (t0, t1), starts, noise, count, times, max_steps, options)


def _one_by_one(system, t_span, starts, noise, count, times, max_steps, options) -> Ensemble:
    """Trajectories by solve()."""
    from ..solving import behind_the_door

    solve = behind_the_door(system, max_steps=max_steps, **options)
    n = starts.shape[1]
    asked = np.empty(0) if times is None else times
    x = np.full((count, n, len(asked)), np.nan)
    end_time, end, steps, outcomes = np.zeros(count), np.zeros((count, n)), np.zeros(count, np.int64), []
    wanted = None if times is None else np.append(asked, t_span[1])
    for k in range(count):
        own = replace(noise, trajectory=noise.trajectory + k)
        start = starts[k if len(starts) > 1 else 0]
        run = solve(system, t_span, start, wanted, noise=own)
        # A run that stopped early ends with the state where it stopped, which was not asked for.
        same = run.t[: len(asked)] == asked[: len(run.t)]
        reached = int(np.argmin(np.append(same, False)))
        x[k, :, :reached] = run.x[:, :reached]
        end_time[k], end[k], steps[k] = run.t[-1], run.x[:, -1], run.cost["steps"]
        outcomes.append(run.outcome)
    names = tuple(str(s) for s in system.states)
    return Ensemble(asked, x, end_time, end, tuple(outcomes), steps, names)


def _all_at_once(run, t_span, starts, count, times, max_steps, spending) -> Ensemble:
    """`count` trajectories in one compiled loop; starts (1 or count, n)."""
    from ..codegen.machine.units import unit_address

    first, last = (run.interval(t, "`t_span`") for t in t_span)
    asked = np.empty(0) if times is None else times
    grid = np.array([run.interval(t, "an entry of `t_eval`") for t in asked], np.int64)
    step, n = run.noise.step, starts.shape[1]
    path = Path(run, max_steps, False)
    t0, t1 = first * step, last * step
    control, state = path.timed(t0, t1, run.values), path.begin(t0, t1, starts[0])
    begun = np.column_stack([starts, np.full(len(starts), t0)])
    noise = run.bundle(starts=begun, snapshots=np.empty((count, len(grid), n)), grid=grid)
    noise.interval, noise.last, noise.trajectory = first, last, run.noise.trajectory
    loop = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 6)(
        unit_address("diffuse_many")
    )
    bundles = (path.problem, control, state, path.first_record(), path.work, noise)
    one = unit_address("diffuse")
    noise.codes[:, 0], noise.ends[:], noise.snapshots[:] = Outcome.TIME_LIMIT, np.nan, np.nan
    row, rows = 0, 1
    while row < count and not (row and spending.late()):
        since = time.monotonic()
        loop(one, row, min(row + rows, count), *(bundle.address for bundle in bundles))
        row += rows
        # Between two calls of the kernel Ctrl-C and the deadline take effect.
        rows = 2 * rows if time.monotonic() - since < _VISIT else max(1, rows // 2)
    return Ensemble(
        grid * step,
        noise.snapshots.transpose(0, 2, 1).copy(),
        noise.ends[:, 0].copy(),
        noise.ends[:, 1:].copy(),
        tuple(map(Outcome, noise.codes[:, 0].tolist())),
        noise.codes[:, 1].copy(),
        tuple(str(s) for s in run.system.states),
    )
