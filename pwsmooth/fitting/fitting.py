"""fit(): parameters of any system from records of its motion, by multiple shooting on exact derivatives.

    min over p, unknown x(t_0) of  sum_i ((y(t_i) - y_i)/sigma_i)^2 + sum_j ((p_j - m_j)/s_j)^2

Chain: records.py, shooting.py, routes.py -> **fitting** -> laws.py.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..costs.telling import telling
from ..door import checks
from ..scenes import Scene
from .coordinates import Coordinates, coordinate
from .gauss_newton import STUCK, Iteration, Minimum, minimise
from .noisy_drives import unstated
from .records import Record
from .result import Fit
from .routes import search
from .shooting import Experiment, RunFailed, Shooting

__all__ = ["fit"]

_ROUNDS, _SETTLED = 10, 0.01  # of the estimation of noise levels: at most so many, until they change by less


@checks.door(
    intervals=checks.optional(checks.integer(1)), rtol=lambda value, what: checks.relative_tolerance(value),
    max_runs=checks.integer(1), max_steps=checks.integer(1), progress=checks.optional(checks.flag),
    callback=checks.optional(checks.function), bounds=checks.optional(checks.mapping),
    priors=checks.optional(checks.mapping),
)  # fmt: skip
def fit(
    system: Any,
    records: Record | Sequence[Record],
    by: Sequence[Any] | Mapping[Any, float],
    *,
    bounds: Mapping[Any, tuple[float, float]] | None = None,
    priors: Mapping[Any, tuple[float, float]] | None = None,
    intervals: int | None = None,
    rtol: float = 1e-9,
    max_runs: int = 200,
    max_steps: int = 200_000,
    progress: bool | None = None,
    callback: Callable[[Iteration], None] | None = None,
) -> Fit:
    """Fit parameters of a system, and unknown initial values, to records of its motion.

    Parameters
    ----------
    system : System or Scene
        Free, forced or controlled; not smoothed.
    records : Record or sequence of Record
        What was measured.
    by : sequence of (str or Symbol), or mapping of them to float
        What is fitted, with first guesses in their units; a name of a family stands for all its elements. Without
        guesses they begin at the system's values.
    bounds : mapping of (str or Symbol) to (float, float), in units of the parameters, optional
        Lowest and highest value of a parameter; infinite ones are none.
    priors : mapping of (str or Symbol) to (float, float), in units of the parameters, optional
        Mean and standard deviation of what is known of a parameter before.
    intervals : int, optional
        Into how many each record is cut on the first route, where a state is measured that decides on no event
        (multiple shooting); by default one of 20 samples each, 30 at most. 1 is single shooting.
    max_runs : int
        Bound on runs along all records.
    max_steps : int
        Bound on the steps of one run, over an interval.
    progress : bool, optional
        Tell each iteration on stderr; by default on a terminal.
    callback : callable, optional
        It gets an Iteration after each step.

    Returns
    -------
    Fit
        Also after Ctrl-C, with the best point until then.

    Raises
    ------
    ValueError, TypeError
        Unknown names, guesses outside of bounds, fewer samples than unknowns, a first guess whose run stops.

    Notes
    -----
    Several routes lead from the first guess: by intervals, by one run, and by the beginning of the records first and
    then more and more of them. The best end is returned, and none is worse than the first guess. It is called a success
    if it leaves what could be independent noise, or if two routes lead to it and the records see all that is fitted;
    and if no point one standard error beside it is better.

    Positive parameters are fitted by their logarithm: they stay positive, and steps are relative. Where a run has no
    derivative at an instant (`Fit.problems`) its deviation is taken on as it came.

    Source: Bock, Recent advances in parameter identification techniques for O.D.E., 1983, for multiple shooting.

    Friction, stiffness and the unknown initial velocity of a block on a spring, from its displacement:

    >>> x, v = sp.symbols("x v", real=True)
    >>> F, k = sp.symbols("F k", positive=True)
    >>> block = System({x: v, v: -k * x - F * sp.sign(v)}, parameters={F: 0.3, k: 2.0})
    >>> t = np.linspace(0, 8, 60)
    >>> data = solve(block.with_parameters({F: 0.5, k: 1.5}), (0, 8), {x: 3, v: 0.4}, t_eval=t)["x"]
    >>> found = fit(block, Record(t, {"x": data}, unknown=["v"], x0={"x": 3, "v": 0}), ["F", "k"])
    >>> f"{found.values['F']:.6f} {found.values['k']:.6f} {found.starts[0]['v']:.6f}"
    '0.500000 1.500000 0.400000'
    """
    given = [records] if isinstance(records, Record) else checks.all_of_kind("records", records, Record)
    if not given:
        raise ValueError("`records` is empty; give at least one Record.")
    own = checks.system(system.system if isinstance(system, Scene) else system, "`system`")
    guesses = _guesses(own, by)
    limits = {
        name: checks.interval(pair, f"`bounds` of {name}")
        for name, pair in _spread(own, bounds, "bounds", guesses)
    }
    options = dict(rtol=rtol, max_steps=max_steps)
    experiments = [Experiment(record, system, guesses, intervals, options) for record in given]
    coordinates, columns, first = _coordinates(own, guesses, limits, experiments)
    names = list(guesses)
    known = [
        (names.index(name), *_prior(pair, f"`priors` of {name}"))
        for name, pair in _spread(own, priors, "priors", guesses)
    ]
    samples, unknowns = sum(r.samples for r in given), len(first)
    if samples + len(known) <= unknowns:
        raise ValueError(
            f"{samples} samples cannot determine {unknowns} unknowns; give more data, or fit fewer parameters."
        )
    sizes = {
        name: float(np.nanmax(np.abs(record.values[name]))) or 1.0
        for record in given for name in record.values if name not in record.noise
    }  # fmt: skip
    problem = Shooting(experiments, coordinates, columns, known, sizes)
    fixed = coordinates.low == coordinates.high

    def words(at: Iteration) -> str:
        return f"fit: step {at.number}, misfit {at.misfit / samples:.6g} a sample, gaps {at.gap:.2g}"

    with telling(progress, callback, words) as told:
        try:
            found = search(problem, first, fixed, max_runs, told)
            for i in range(_ROUNDS if sizes else 0):
                before, levels = problem.levels, _levels(problem, found, sizes, rtol, 1 - unknowns / samples)
                problem.weigh(levels)
                settled = all(
                    abs(level - before[name]) <= _SETTLED * before[name] for name, level in levels.items()
                )
                if settled or not found.success or i == _ROUNDS - 1:
                    at = problem.evaluate(found.z, found.at.nodes, found.every)
                    found = found._replace(at=at, slopes=problem.linearise(found.z, at))
                    break
                again = minimise(problem, found.z, found.at.nodes, fixed, max_runs, told, found.every)
                if again.message == STUCK:  # a corner stays one
                    again = again._replace(success=found.success, message=found.message)
                found = again._replace(runs=found.runs + again.runs, failures=found.failures + again.failures)
        except RunFailed as error:
            raise ValueError(
                f"the run from the first guess stops: {error} Give other guesses or fewer `intervals`."
            ) from None
    if found.success and (why := unstated(problem, found, fixed, guesses, options)):
        found = found._replace(success=False, message=why)
    begun = clock.process_time()
    for e, arcs in zip(experiments, found.at.arcs):
        e.plain(arcs[0].start, found.at.values)
    cost = (clock.process_time() - begun) / sum(e.t[-1] - e.begin for e in experiments)
    return Fit(own, problem, found, len(guesses), problem.levels, fixed, cost, dict(most=max_runs))


def _guesses(system: Any, by: Any) -> dict[str, float]:
    """Fitted parameters by name, those of a family each, with their first guesses."""
    if not isinstance(by, Mapping):
        listed = [str(checks.named(name)) for name in checks.several(by, "`by`")]
        values = {p.name: value for p, value in system.parameters.items()}
        listed = [member for name in listed for member in system.groups.get(name, (name,))]
        if missing := [name for name in listed if name not in values]:
            raise ValueError(
                f"`by` names {', '.join(missing)}; parameters of the system are {', '.join(values)}."
            )
        by = {name: values[name] for name in listed}
    changed = system.with_parameters(by)
    wanted = [str(checks.named(key)) for key in by]
    members = [member for name in wanted for member in system.groups.get(name, (name,))]
    if not members:
        raise ValueError("`by` is empty; name at least one parameter to fit.")
    values = {p.name: value for p, value in changed.parameters.items()}
    return {name: values[name] for name in members}


def _spread(system: Any, wanted: Any, what: str, names: Mapping[str, float]) -> Iterator[tuple[str, Any]]:
    """Entries of `bounds` or `priors` by the names of single parameters."""
    for key, value in (wanted or {}).items():
        name = str(checks.named(key))
        for member in system.groups.get(name, (name,)):
            if member not in names:
                raise ValueError(f"`{what}` names {name!r}, which is not fitted; `by` has {', '.join(names)}.")
            yield member, value


def _prior(pair: Any, what: str) -> tuple[float, float]:
    mean, spread = checks.pair(pair, what)
    return mean, checks.positive(spread, f"{what}, standard deviation")


def _coordinates(
    system: Any,
    guesses: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
    experiments: list[Experiment],
) -> tuple[Coordinates, list[list[int]], np.ndarray]:
    """Coordinates of the parameters and then of all unknown starts; the latter's columns by record; the first guess."""
    symbols = {p.name: p for p in system.parameters}
    rows: list[tuple[str, bool, float, float, float, float]] = []
    for name, value in guesses.items():
        low, high = limits.get(name, (-np.inf, np.inf))
        if not low <= value <= high:
            raise ValueError(
                f"the first guess of {name!r} is {value:g}, outside of its `bounds` ({low:g}, {high:g})."
            )
        positive = bool(symbols[name].is_nonnegative) or low >= 0
        logarithmic = positive and value > 0
        unit = (
            1.0
            if logarithmic
            else abs(value) or next((abs(x) for x in (high, low) if np.isfinite(x) and x), 1.0)
        )
        low = max(low, 0.0) if positive else low
        rows.append((name, logarithmic, unit, coordinate(low, logarithmic, unit), coordinate(high, logarithmic, unit),
                     coordinate(value, logarithmic, unit)))  # fmt: skip
    columns = []
    for i, e in enumerate(experiments):
        columns.append(list(range(len(rows), len(rows) + len(e.unknown))))
        for k in e.unknown:
            name, scale = f"{e.states[k]} of record {i}", e.scale[k]
            rows.append((name, False, scale, -np.inf, np.inf, e.start[k] / scale))
    names, logs, *numbers = zip(*rows)
    units, lowest, highest, first = (np.array(of) for of in numbers)
    return Coordinates(names, np.array(logs), units, lowest, highest), columns, first


def _levels(
    problem: Shooting, found: Minimum, sizes: Mapping[str, float], rtol: float, share: float
) -> dict[str, float]:
    """Noise levels from what remains of each column that has none, of which the fitted quantities took their share."""
    squares, counts = dict.fromkeys(sizes, 0.0), dict.fromkeys(sizes, 0)
    for e, arcs in zip(problem.experiments, found.at.arcs):
        model = np.concatenate([e.values(arc) for arc in arcs], axis=1)
        for name, of, data, there in zip(e.names, model, e.data, e.there):
            if name not in e.record.noise:
                squares[name] += float(np.sum((of - data)[there] ** 2))
                counts[name] += int(there.sum())
    # Data without noise are met up to the error of the runs.
    return {
        name: max(float(np.sqrt(squares[name] / counts[name] / share)), rtol * sizes[name]) for name in sizes
    }
