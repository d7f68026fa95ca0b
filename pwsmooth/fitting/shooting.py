"""Residuals of a system along records, and their exact slopes, with the records cut into intervals (multiple shooting).

    r_i = w_i (y(t_i; p, s_j) - y_i),       c_j = x(t_(j+1); t_j, s_j, p) - s_(j+1)

Where intervals meet, a state that is measured, or the rate of one, is an unknown s_j: a guess from the data, whose gap
c_j closes on the way to the solution. All other states, and all memories, are handed on. The gaps, linearised, give
ds_j in terms of the fitted quantities z alone: what is minimised has no more unknowns than z (condensing):

    ds_(j+1) = c_j + dx/dp dp + dx/ds ds_j  =:  A_(j+1) dz + b_(j+1)

Source: Bock, Recent advances in parameter identification techniques for O.D.E., 1983.
Chain: records.py, coordinates.py -> **shooting** -> gauss_newton.py, routes.py.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..door import checks
from ..results.solution import Solution
from ..scenes import Scene
from ..solving import solve
from .coordinates import Coordinates
from .records import Record

_BESIDE = (
    1e-9,
    1e-7,
    1e-5,
)  # of an interval: how near to an instant without a derivative a run ends, and begins anew
_SAMPLES, _MOST = 20, 30  # of an interval, and intervals, where the user says nothing
_CHOICES = "the motion is not unique", "it begins on a surface"  # reasons of NoDerivative at a start
_MANY = 20  # such instants of one interval: after them its samples move with nothing


class Arc(NamedTuple):
    """A run over an interval."""

    begin: float
    start: np.ndarray
    end: float
    times: np.ndarray  # of the samples in it
    rows: slice  # these among all of the record
    states: list[str]  # by whose value at its start it is differentiated
    solution: Solution


class Experiment:
    """A record and its system, cut into intervals."""

    def __init__(
        self,
        record: Record,
        system: Any,
        guesses: Mapping[str, float],
        intervals: int | None,
        options: Mapping[str, Any],
    ) -> None:
        model = record.system if record.system is not None else system
        self.scene = model if isinstance(model, Scene) else None
        self.system = checks.system(model if self.scene is None else model.system, "`system`")
        self.options = options
        self.record, self.parameters = record, dict(record.parameters)
        names = list(guesses)
        self.free = [name for name in names if name in {p.name for p in self.system.parameters}]
        self.numbers = [
            names.index(name) for name in self.free
        ]  # of the fitted parameters those of this system
        self.states = [s.name for s in self.system.states]
        self.names, self.data = list(record.values), np.array(list(record.values.values()))
        self._known()
        self.there = np.isfinite(self.data)
        self.sizes = np.array([np.nanmax(np.abs(row)) or 1.0 for row in self.data])  # of what was measured
        used = self.there.any(axis=0)
        self.t, self.data, self.there = record.t[used], self.data[:, used], self.there[:, used]
        self.begin = record.t[0] if record.begin is None else record.begin
        if not self.t[-1] > self.begin:
            raise ValueError(
                "a Record has one sample at the time it begins; give several times, or an earlier `begin`."
            )
        self.start = self._start()
        self.unknown = [self.states.index(name) for name in record.unknown]
        curves = self._curves()
        wanted = min(len(self.t) // _SAMPLES, _MOST) if intervals is None else intervals
        self.cuts = self._cuts(max(1, wanted) if curves else 1)
        tables = {k for event in self.system.model.events if event.tables for k, _ in event.update}
        self.differentiable = [name for i, name in enumerate(self.states) if i not in tables]
        self.nodes = self._first_nodes(curves, guesses)

    def _known(self) -> None:
        model = self.system.model
        outputs = [str(name) for name, _ in model.outputs]
        known = [*self.states, *(str(m.symbol) for m in model.multipliers), *outputs]
        for what, names, owner in (
            ("values", self.names, known),
            ("unknown", self.record.unknown, self.states),
        ):
            for name in names:
                if name not in owner and (model.families is None or what == "unknown"):
                    raise ValueError(f"`{what}` of a Record names {name!r}; the system has {', '.join(owner)}.")

    def _start(self) -> np.ndarray:
        known: dict[str, float] = {} if self.scene is None else {str(k): v for k, v in self.scene.x0.items()}
        for name in self.record.unknown:
            if name in self.names:
                row = self.names.index(name)
                known[name] = float(self.data[row, self.there[row]][0])
        known |= self.record.x0
        if missing := [name for name in self.record.unknown if name not in known]:
            raise ValueError(
                f"`unknown` names {', '.join(missing)}, neither measured nor in `x0`; give `x0` a first guess."
            )
        return np.array(self.system.initial_state(known, self.begin), float)

    def _curves(self) -> dict[str, Any]:
        """State -> a function of time near to it, of measured states and of those that are a measured one's rate.

        None of a state that decides whether an event acts or a contact is met: noise in it would lose an event, and
        with it all that the event remembers.
        """
        from scipy.interpolate import make_smoothing_spline

        model, found = self.system.model, {}
        acting = [event.surface for event in model.events if event.update and event.surface is not None]
        acting += [mu.surface for mu in model.multipliers if mu.kind == "contact"]
        deciding = {s.name for surface in acting for s in surface.free_symbols}
        memories = {str(m) for m in self.system.initial_memory}
        rates = {s.name: str(rate) for s, rate in zip(model.states, model.rhs)}
        for name, row, there in zip(self.names, self.data, self.there):
            if name in self.states and name not in memories and there.sum() >= 5:
                # In samples, not in the unit of the time, in which SciPy's equations may be ill-posed.
                first, beat = self.t[there][0], float(np.mean(np.diff(self.t[there])))
                curve = make_smoothing_spline((self.t[there] - first) / beat, row[there])
                curve.extrapolate = False
                found[name] = functools.partial(_at, curve, first, beat, 1.0)
                if (rate := rates[name]) in self.states and rate not in (*memories, *self.names):
                    found[rate] = functools.partial(_at, curve.derivative(), first, beat, beat)
        return {name: curve for name, curve in found.items() if name not in deciding}

    def _cuts(self, intervals: int) -> np.ndarray:
        """The ends of intervals of equally many samples."""
        places = np.linspace(0, len(self.t) - 1, min(intervals, len(self.t) - 1) + 1).round().astype(int)
        return np.concatenate([[self.begin], self.t[places[1:-1]], [self.t[-1]]])

    def _first_nodes(self, curves: Mapping[str, Any], values: Mapping[str, float]) -> np.ndarray:
        """States between the intervals, shape (intervals - 1, n); also which are relaxed, and sizes."""
        self.relaxed = np.zeros((len(self.cuts) - 2, len(self.states)), bool)
        x, found, size = self.start, [], np.abs(self.start)
        for j in range(len(self.cuts) - 1):
            solution = self.arc(j, x, values).solution
            size = np.fmax(size, np.abs(solution.x).max(axis=1))
            x = np.where(np.isfinite(solution.x[:, -1]), solution.x[:, -1], x)
            for name, curve in curves.items():
                if j < len(self.relaxed) and np.isfinite(value := curve(self.cuts[j + 1])):
                    k = self.states.index(name)
                    x[k], self.relaxed[j, k] = value, True
            found.append(x)
        for name, row, there in zip(self.names, self.data, self.there):
            if name in self.states:
                size[self.states.index(name)] = np.abs(row[there]).max()
        self.scale = np.where((size > 0) & np.isfinite(size), size, 1.0)
        return np.array(found[:-1]).reshape(-1, len(self.states))

    @functools.cached_property
    def _surfaces(self) -> np.ndarray:
        """Of each multiplier the states that are not free while it is solved, shape (m, n)."""
        model = self.system.model
        rates = dict(zip(model.states, model.rhs))
        found = np.zeros((len(model.multipliers), len(self.states)), bool)
        for row, multiplier in zip(found, model.multipliers):
            if multiplier.surface is not None:
                of = multiplier.surface.free_symbols
                if multiplier.kind == "contact":
                    of = of.union(*(rates[x].free_symbols for x in of if x in rates))
                row[:] = [x in of for x in model.states]
        return found

    def confined(self, status: np.ndarray) -> np.ndarray:
        """States that lie on a surface with this status of the multipliers; shape (n,)."""
        return self._surfaces[status == 0].any(axis=0)

    def until(self, part: float) -> Experiment:
        """The same over the first part of the record, in one interval."""
        other = copy.copy(self)
        count = max(math.ceil(part * len(self.t)), 2)
        other.t, other.data, other.there = self.t[:count], self.data[:, :count], self.there[:, :count]
        other.cuts, other.nodes = np.array([self.begin, other.t[-1]]), self.nodes[:0]
        return other

    # ---- runs

    def arc(self, j: int, x: np.ndarray, values: Mapping[str, float]) -> Arc:
        """The run over interval j from a state; `values` are those of fitted parameters."""
        a, b = self.cuts[j], self.cuts[j + 1]
        first, end = np.searchsorted(self.t, a), np.searchsorted(self.t, b)
        if j == len(self.cuts) - 2:
            end = len(self.t)
        by = list(self.record.unknown) if j == 0 else self.differentiable
        times = self.t[first:end]
        return Arc(a, x, b, times, slice(first, end), by, self._solved(a, b, x, values, times, by))

    def _run(self, span: tuple[float, float], x: list[float], **more: Any) -> Solution:
        if self.scene is not None:
            return self.scene.solve(span, x, **self.options, **more)
        return solve(self.system, span, x, **self.options, **more)

    def _solved(self, a, b, x, values, times, by) -> Solution:
        """The run from a to b, with columns at these times and at b."""
        given = self.parameters | {name: values[name] for name in self.free}
        every = times if len(times) and times[-1] == b else np.append(times, b)
        return self._run((a, b), list(x), parameters=given, t_eval=every, by=[*self.free, *by] or None)

    def plain(self, x: np.ndarray, values: Mapping[str, float]) -> Solution:
        """The run along the whole record, without anything for derivatives."""
        given = self.parameters | {name: values[name] for name in self.free}
        return self._run((self.begin, self.t[-1]), list(x), parameters=given, t_eval=self.t)

    def values(self, arc: Arc) -> np.ndarray:
        """What was measured, of a run at its samples, shape (k, nt)."""
        return np.array([arc.solution[name][: len(arc.times)] for name in self.names])

    def difference(self, arcs: Sequence[Arc]) -> np.ndarray:
        """Model minus data, shape (k, nt); nan where a sample is missing."""
        return np.concatenate([self.values(arc) for arc in arcs], axis=1) - self.data

    def slopes(self, arc: Arc, values: Mapping[str, float], problems: list) -> tuple[np.ndarray, np.ndarray]:
        """d(what was measured)/dq, shape (k, nt, nq), and d(end)/dq, shape (n, nq): the parameters, then `arc.states`.

        `problems` gets instants without a derivative, at which the deviation goes on as it came.
        """
        p, n = len(self.free), len(self.states)
        rows, moved = (
            np.zeros((len(self.names), len(arc.times), p + len(arc.states))),
            np.zeros((n, p + len(arc.states))),
        )
        moved[[self.states.index(name) for name in arc.states], np.arange(p, moved.shape[1])] = 1.0
        if not moved.shape[1]:
            return rows, moved
        a, x, by, solution = arc.begin, arc.start, arc.states, arc.solution

        def along(solution, last):
            place = [self.states.index(name) for name in by]
            d, first = solution.derivatives, np.searchsorted(arc.times, a)
            for k, name in enumerate(self.names):
                of = d[name].T[: last - first]
                rows[k, first:last] = of[:, p:] @ moved[place]
                rows[k, first:last, :p] += of[:, :p]
            end = d.end[:, p:] @ moved[place]
            end[:, :p] += d.end[:, :p]
            return end

        for _ in range(_MANY):
            # Where a run may begin in several ways the one that was taken stays, and states on a surface stay there.
            d = solution.derivatives
            d.problems[:] = [
                found for found in d.problems if found.t > a or not found.reason.startswith(_CHOICES)
            ]
            if not solution.derivatives.problems:
                return rows, along(solution, len(arc.times))
            problems.append(problem := solution.derivatives.problems[0])
            for near in np.array(_BESIDE) * (arc.end - arc.begin):
                if problem.t - near <= a:
                    continue
                last = np.searchsorted(arc.times, problem.t - near, side="right")
                times = arc.times[np.searchsorted(arc.times, a) : last]
                before = self._solved(a, problem.t - near, x, values, times, by)
                if not before.derivatives.problems:
                    moved = along(before, last)
                    break
            if (past := problem.t + near) >= arc.end:
                break
            x = self._solved(a, past, x, values, np.empty(0), []).x[:, -1]
            a, by = past, self.differentiable
            solution = self._solved(a, arc.end, x, values, arc.times[arc.times >= a], by)
        return rows, moved


def _at(curve: Any, first: float, beat: float, over: float, t: float) -> float:
    return float(curve((t - first) / beat)) / over


class Evaluation(NamedTuple):
    """Runs from one set of fitted quantities and nodes."""

    values: dict[str, float]
    residual: np.ndarray
    gaps: np.ndarray  # in units of the size of the states
    arcs: list[list[Arc]]
    nodes: list[np.ndarray]  # with what was handed on

    @property
    def misfit(self) -> float:
        return 0.5 * float(self.residual @ self.residual)

    @property
    def gap(self) -> float:
        return float(np.abs(self.gaps).sum())


class Linearised(NamedTuple):
    """Slopes of an Evaluation, with the nodes expressed by the nq fitted quantities."""

    jacobian: np.ndarray  # (m, nq), of the residual along closed gaps
    closing: np.ndarray  # (m,), change of the residual as the gaps close
    node_slopes: list[np.ndarray]  # (intervals - 1, n, nq)
    node_closing: list[np.ndarray]  # (intervals - 1, n)
    problems: list[Any]  # of NoDerivative


class RunFailed(ArithmeticError):
    """A run did not reach the end of its interval."""


class Shooting:
    """The least-squares problem: residuals and gaps of all experiments, and what is known before."""

    def __init__(
        self, experiments: Sequence[Experiment], coordinates: Coordinates, columns: Sequence[Sequence[int]],
        priors: Sequence[tuple[int, float, float]], levels: Mapping[str, float],
    ) -> None:  # fmt: skip
        self.experiments, self.coordinates, self.columns = experiments, coordinates, columns
        self.priors = priors
        self.weigh(levels)

    def weigh(self, levels: Mapping[str, float]) -> None:
        """Takes noise levels, by the name of what is measured, where a record gives none."""
        self.levels = dict(levels)
        self.weights = [
            np.array([np.where(there, 1 / e.record.noise.get(name, self.levels.get(name, 1.0)), 0.0)
                      for name, there in zip(e.names, e.there)])
            for e in self.experiments
        ]  # fmt: skip

    @property
    def nodes(self) -> list[np.ndarray]:
        """First guesses of the states between the intervals."""
        return [e.nodes for e in self.experiments]

    def until(self, part: float, known: Sequence[tuple[int, float, float]]) -> Shooting:
        """The same problem of the first part of every record, with more knowledge of the fitted quantities."""
        experiments = [e.until(part) for e in self.experiments]
        return Shooting(experiments, self.coordinates, self.columns, [*self.priors, *known], self.levels)

    def bearing_jumps(self, z: np.ndarray, outlier: float, rounding: float) -> Shooting:
        """The same with Cauchy's weights at z: a sample counts half at `outlier` medians of its column's residuals."""
        other, at = copy.copy(self), self.evaluate(z, self.nodes)
        other.weights = []
        for e, arcs, weights in zip(self.experiments, at.arcs, self.weights):
            off = np.abs(np.where(e.there, e.difference(arcs), 0.0))
            middle = [np.median(row[there]) if there.any() else 0.0 for row, there in zip(off, e.there)]
            usual = np.fmax(outlier * np.array(middle), rounding * e.sizes)
            other.weights.append(weights / np.sqrt(1 + (off / usual[:, None]) ** 2))
        return other

    def misfit(self, z: np.ndarray) -> float:
        """Half the sum of squared residuals of one run along each record, without slopes; RunFailed as `evaluate`."""
        numbers = self.coordinates.values(z)
        values = dict(zip(self.coordinates.names, numbers.tolist()))
        squares = sum(((numbers[i] - mean) / spread) ** 2 for i, mean, spread in self.priors)
        for e, columns, weights in zip(self.experiments, self.columns, self.weights):
            x = e.start.copy()
            x[e.unknown] = numbers[columns]
            run = e.plain(x, values)
            if not run.success:
                raise RunFailed(run.message)
            off = np.array([run[name] for name in e.names]) - e.data
            squares += float(np.sum((weights * np.where(e.there, off, 0.0)) ** 2))
        return 0.5 * squares if math.isfinite(squares) else math.inf

    def evaluate(self, z: np.ndarray, nodes: Sequence[np.ndarray], every: int = 1) -> Evaluation:
        """Runs all experiments; RunFailed where one stops, ValueError for values that a system does not take."""
        numbers = self.coordinates.values(z)
        values = dict(zip(self.coordinates.names, numbers.tolist()))
        arcs, residual, gaps, all_nodes = [], [], [], []
        for e, columns, weights, own in zip(self.experiments, self.columns, self.weights, nodes):
            x, runs, here = e.start.copy(), [], own.copy()
            x[e.unknown] = numbers[columns]
            for j in range(len(own) + 1):
                arc = e.arc(j, x, values)
                if not (arc.solution.success and np.isfinite(of := e.values(arc)).all()):
                    raise RunFailed(f"{arc.solution.message} (from t = {arc.begin:.9g})")
                difference = np.where(e.there[:, arc.rows], of - e.data[:, arc.rows], 0.0)
                residual.append((weights[:, arc.rows] * difference).ravel())
                runs.append(arc)
                if j < len(own):
                    end = arc.solution.x[:, -1]
                    held = ~e.relaxed[j] | e.confined(arc.solution.status[:, -1]) | ((j + 1) % every != 0)
                    here[j, held] = end[held]
                    gaps.append((end - here[j]) / e.scale)
                    x = here[j]
            arcs.append(runs)
            all_nodes.append(here)
        known = [(numbers[i] - mean) / spread for i, mean, spread in self.priors]
        return Evaluation(
            values, np.concatenate([*residual, known]), np.concatenate([np.empty(0), *gaps]), arcs, all_nodes
        )

    def linearise(self, z: np.ndarray, at: Evaluation) -> Linearised:
        """Slopes of what was evaluated at z."""
        slope, count = self.coordinates.slopes(z), len(z)
        rows, closing, all_slopes, all_closing = [], [], [], []
        problems: list[Any] = []
        for e, columns, weights, arcs in zip(self.experiments, self.columns, self.weights, at.arcs):
            n, p = len(e.states), len(e.free)
            by_z = np.zeros((p, count))  # of the parameters
            by_z[np.arange(p), e.numbers] = slope[e.numbers]
            A, b = np.zeros((n, count)), np.zeros(n)
            A[e.unknown, columns] = slope[columns]
            node_slopes, node_closing = [], []
            for j, arc in enumerate(arcs):
                of, end = e.slopes(arc, at.values, problems)
                place = [e.states.index(name) for name in arc.states]
                weighted = (weights[:, arc.rows, None] * of).reshape(-1, of.shape[2])
                rows.append(weighted[:, :p] @ by_z + weighted[:, p:] @ A[place])
                closing.append(weighted[:, p:] @ b[place])
                if j < len(arcs) - 1:
                    gap = arc.solution.x[:, -1] - arcs[j + 1].start
                    A, b = end[:, :p] @ by_z + end[:, p:] @ A[place], gap + end[:, p:] @ b[place]
                    node_slopes.append(A)
                    node_closing.append(b)
            all_slopes.append(np.array(node_slopes).reshape(-1, n, count))
            all_closing.append(np.array(node_closing).reshape(-1, n))
        known = np.zeros((len(self.priors), count))
        for k, (i, _, spread) in enumerate(self.priors):
            known[k, i] = slope[i] / spread
        return Linearised(
            np.concatenate([*rows, known]), np.concatenate([*closing, np.zeros(len(known))]), all_slopes, all_closing,
            problems,
        )  # fmt: skip
