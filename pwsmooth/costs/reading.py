"""What a cost reads of a run, and with which slopes: values and covectors, pulled back over the run's tape.

Chain: quantities.py, a Solution with its tape -> **reading** -> paths/tangents.py `pull_back` -> objective.py.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from ..derivatives import NoDerivative, Quantities, first_rates, problems
from ..paths.clock import slopes_of_instants
from ..paths.limits import limits
from ..paths.tangents import Readings, pull_back
from ..results import outputs
from .quantities import Quantity

_NODES = 33  # at which an expression is looked at on a step, whose polynomial has degree 31 at most


class Gradient(NamedTuple):
    """A cost and its slopes.

    Attributes
    ----------
    value : float
        In the unit of the cost.
    gradient : ndarray, shape (k,)
        By the quantities, in the unit of the cost over theirs.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.costs import final, value_and_gradient
    >>> x = sp.Symbol("x", real=True)
    >>> found = value_and_gradient(System({x: -2 * x}), final(x) ** 2, (0, 1), {x: 1}, with_respect_to=["x"])
    >>> print(f"{found.value:.6f} {found.gradient[0]:.6f}")  # exp(-4), twice that
    0.018316 0.036631
    """

    value: float
    gradient: np.ndarray


class Asked(NamedTuple):
    """What a cost asks of every run."""

    by: Quantities  # by what is differentiated
    places: list[int | None]  # of each its place among the model's parameters or states; none of the start time
    found: list[Quantity]  # what the cost is made of
    outputs: dict[Quantity, str]  # the model's output that is the expression of one
    integrals: dict[Quantity, int]  # the model's state that is one
    used: np.ndarray  # places of the parameters that stand in the cost
    cost: Any  # of (*found, *used): the cost and its slopes by them


class Reader:
    """What a cost reads of one run, and with which slopes."""

    def __init__(self, asked: Asked, run: Any) -> None:
        if not run.success:
            raise NoDerivative(float(run.t[-1]), "", f"the run ends there: {run.message}")
        self.asked, self.run, self.model = asked, run, run.model
        self.n, self.m = len(run.x), len(run.mult)
        self.end = np.zeros(self.n + self.m)
        self.times: list[np.ndarray] = []
        self.slopes: list[np.ndarray] = []
        self.instants: dict[int, np.ndarray] = {}
        self.by_parameter = np.zeros(len(self.model.parameters))
        self.p = run.tape.p
        self.meets = run.tape.instants()

    def result(self) -> Gradient:
        asked, run = self.asked, self.run
        readers = [getattr(self, f"_{q.kind}")(q) for q in asked.found]
        numbers = [value for value, _ in readers]
        cost, *slopes = asked.cost(*numbers, *self.p[asked.used])
        for (_, add), slope in zip(readers, slopes):
            if slope != 0.0:
                add(float(slope))
        self.by_parameter[asked.used] += slopes[len(readers) :]
        found = self._pulled()
        gradient = np.zeros(len(asked.by.names))
        tape, given = run.tape, dict(zip(self.model.parameters, self.p))
        for k, (place, p) in enumerate(zip(asked.places, asked.by.parameters)):
            if p is not None:
                gradient[k] = found.parameters[place] + self.by_parameter[place]
                if len(tape.clock):
                    moved = slopes_of_instants(self.model, given, tape.clock, tape.clock_event, p)
                    gradient[k] += moved @ found.clock
            elif place is not None:
                gradient[k] = found.start[place]
            else:
                gradient[k] = -found.start @ first_rates(self.model, run.tape)
        return Gradient(float(cost), gradient)

    def _pulled(self) -> Any:
        times = np.concatenate([np.empty(0), *self.times])
        slopes = np.concatenate([np.empty((0, self.n + self.m)), *self.slopes])
        order = np.argsort(times, kind="stable")
        entries = np.array(sorted(self.instants), np.int64)
        at_instants = np.array([self.instants[k] for k in entries.tolist()]).reshape(-1, 2 * self.n + 1)
        # The end is a time like the others; multipliers deviate with the states there.
        times, slopes = np.append(times[order], self.run.t[-1]), np.vstack([slopes[order], self.end])
        readings = Readings(np.zeros(self.n), times, slopes, entries, at_instants)
        found = pull_back(self.model, self.run.tape, readings)
        asked = self.asked
        off = {
            name: found.off[place if p is None else self.n + place]
            for name, place, p in zip(asked.by.names, asked.places, asked.by.parameters)
            if place is not None
        }
        for problem in problems(self.run, [found.why] if found.why else [], off):
            raise problem
        return found

    # ---- expressions at points ---------------------------------------------------------------------

    def _evaluated(
        self, quantity: Quantity, t: np.ndarray, x: np.ndarray, mult: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values of the expression at points, and its slopes (states, multipliers, parameters, time; points)."""
        expression = self.run._expressions[self.asked.outputs[quantity]]
        made, rows = _with_slopes(self.model, expression)
        found = np.zeros((self.n + self.m + len(self.p) + 2, len(t)))
        for row, values in zip(rows, made(t, *x, *mult, *self.p)):
            found[row] = values
        return found[0], found[1:]

    def _read(self, quantity: Quantity, t: np.ndarray) -> tuple[np.ndarray, Any]:
        """Values at times, and what adds given slopes by these values to those of the cost."""
        x, mult = self.run.dense(t)
        last = t == self.run.t[-1]
        x[:, last], mult[:, last] = self.run.x[:, -1:], self.run.mult[:, -1:]
        values, slopes = self._evaluated(quantity, t, x, mult)
        inner = self.n + self.m

        def add(by_value: np.ndarray) -> None:
            self.times.append(t)
            self.slopes.append((slopes[:inner] * by_value).T)
            self.by_parameter += slopes[inner:-1] @ by_value

        return values, add

    # ---- kinds -------------------------------------------------------------------------------------

    def _integral(self, quantity: Quantity) -> tuple[float, Any]:
        i = self.asked.integrals[quantity]

        def add(slope: float) -> None:
            self.end[i] += slope

        return float(self.run.x[i, -1]), add

    def _final(self, quantity: Quantity) -> tuple[float, Any]:
        return self._single(quantity, float(self.run.t[-1]))

    def _at(self, quantity: Quantity) -> tuple[float, Any]:
        (t,) = quantity.where
        if not self.run.t[0] <= t <= self.run.t[-1]:
            raise ValueError(f"`time` of {quantity} is outside the span.")
        return self._single(quantity, t)

    def _single(self, quantity: Quantity, t: float) -> tuple[float, Any]:
        values, add = self._read(quantity, np.array([t]))
        return float(values[0]), lambda slope: add(np.array([slope]))

    def _misfit(self, quantity: Quantity) -> tuple[float, Any]:
        t, measured, sigma = np.frombuffer(quantity.where[0]).reshape(3, -1)
        values, add = self._read(quantity, t.copy())
        off = (values - measured) / sigma
        return float(off @ off), lambda slope: add(2.0 * slope * off / sigma)

    @functools.cached_property
    def _limits(self) -> dict[float, tuple[np.ndarray, np.ndarray]]:
        tape = self.run.tape
        return limits(self.run, tape.values[self.meets, 0], tape.entries[self.meets, 2])

    def _entries(self, time: float) -> list[tuple[int, float]]:
        """Entries of the tape at which an event's instant begins, or those that lead to it; and what they weigh."""
        if time in self._limits:
            places, weights = self._limits[time]
            return list(zip(self.meets[places].tolist(), weights.tolist()))
        return [(int(self.meets[np.abs(self.run.tape.values[self.meets, 0] - time).argmin()]), 1.0)]

    def _time(self, quantity: Quantity) -> float:
        switch, kind, number, *_ = quantity.where
        times = self.run.event_times(kind, switch)
        if number >= len(times):
            raise NoDerivative(
                float(self.run.t[-1]), switch, f"{quantity} asks for an event that does not happen"
            )
        return float(times[number])

    def _instant(self, time: float, before: Any = 0.0, after: Any = 0.0, shift: float = 0.0) -> None:
        for entry, weight in self._entries(time):
            row = self.instants.setdefault(entry, np.zeros(2 * self.n + 1))
            row[: self.n] += weight * before
            row[self.n : -1] += weight * after
            row[-1] += weight * shift

    def _event_time(self, quantity: Quantity) -> tuple[float, Any]:
        time = self._time(quantity)
        return time, lambda slope: self._instant(time, shift=slope)

    def _at_event(self, quantity: Quantity) -> tuple[float, Any]:
        time, after = self._time(quantity), quantity.where[-1]
        column = (
            np.searchsorted(self.run.t, time, side="right") - 1 if after else np.searchsorted(self.run.t, time)
        )
        return self._at_instant(quantity, time, int(column), after)

    def _at_instant(self, quantity: Quantity, time: float, column: int, after: bool) -> tuple[float, Any]:
        x, mult = self.run.x[:, column : column + 1], self.run.mult[:, column : column + 1]
        values, slopes = self._evaluated(quantity, np.array([time]), x, mult)
        n, inner = self.n, self.n + self.m
        if np.any(slopes[n:inner]):
            raise ValueError(f"{quantity} reads a multiplier at an event; ask for it at a time.")

        def add(slope: float) -> None:
            by_state = slope * slopes[:n, 0]
            self._instant(time, *((0.0, by_state) if after else (by_state, 0.0)), slope * slopes[-1, 0])
            self.by_parameter += slope * slopes[inner:-1, 0]

        return float(values[0]), add

    def _duration(self, quantity: Quantity) -> tuple[float, Any]:
        run = self.run
        (switch,) = quantity.where
        if switch not in run.multipliers:
            raise ValueError(
                f"{quantity}: the system has no switch of that name; it has {', '.join(run.multipliers)}."
            )
        j = run.multipliers.index(switch)
        pieces = [(s.start, s.end) for s in run.segments if s.status[j] == 0]
        ends = [(t, sign) for piece in pieces for t, sign in zip(piece, (-1.0, 1.0))]

        def add(slope: float) -> None:
            for t, sign in ends:
                if run.t[0] < t < run.t[-1]:
                    self._instant(t, shift=sign * slope)

        return sum(sign * t for t, sign in ends), add

    def _largest(self, quantity: Quantity, sign: float = 1.0) -> tuple[float, Any]:
        begin, end = quantity.where
        begin, end = (self.run.t[0] if begin is None else begin), (self.run.t[-1] if end is None else end)
        if not self.run.t[0] <= begin < end <= self.run.t[-1]:
            raise ValueError(f"The window of {quantity} is not within the span.")

        def value(t: np.ndarray) -> np.ndarray:
            return sign * self._read(quantity, t)[0]

        time = _highest(value, self.run, begin, end)
        events = np.unique(self.run.event_times())
        if begin < time < end and np.any(np.abs(events - time) <= 1e-13 * abs(end)):
            columns = np.flatnonzero(np.abs(self.run.t - time) <= 1e-13 * abs(end))
            tried = [self._at_instant(quantity, time, int(c), c == columns[-1]) for c in columns[[0, -1]]]
            return max(tried, key=lambda pair: sign * pair[0])
        return self._single(quantity, time)

    def _smallest(self, quantity: Quantity) -> tuple[float, Any]:
        return self._largest(quantity, -1.0)


def _highest(value: Any, run: Any, begin: float, end: float) -> float:
    """Where a function of time is largest: at an end of a step, or where its interpolant within one is stationary."""
    ends = np.unique(np.concatenate([[begin], run.t[(run.t > begin) & (run.t < end)], [end]]))
    nodes = np.polynomial.chebyshev.chebpts2(_NODES)
    low, high = ends[:-1, None], ends[1:, None]
    times = 0.5 * (low + high) + 0.5 * (high - low) * nodes
    heights = value(times.ravel()).reshape(times.shape)
    piece, k = np.unravel_index(int(heights.argmax()), heights.shape)
    best = float(times[piece, k])
    # Once more between its neighbours: a maximum's time is known to half the digits of its height, but to nearly all of
    # those of the slope.
    a, b = times[piece, max(k - 1, 0)], times[piece, min(k + 1, _NODES - 1)]
    fit = np.polynomial.Chebyshev.interpolate(
        lambda t: value(np.asarray(t)), _NODES // 2, domain=[float(a), float(b)]
    )
    roots = fit.deriv().roots()
    roots = roots[(np.abs(roots.imag) < 1e-9) & (a < roots.real) & (roots.real < b)].real
    return max([best, *roots.tolist()], key=lambda t: float(fit(t)))


@functools.lru_cache(maxsize=256)
def _with_slopes(model: Any, expression: sp.Basic) -> tuple[Any, list[int]]:
    """A numpy function of (t, *x, *mult, *p): an expression, and its slopes by the symbols that stand in it; and their
    rows where 0 is the expression, and states, multipliers, parameters and time follow."""
    symbols = (*model.states, *(mu.symbol for mu in model.multipliers), *model.parameters, model.time)
    rows = [k for k, s in enumerate(symbols) if s in expression.free_symbols]
    slopes = [expression.diff(symbols[k]) for k in rows]
    return outputs.vectorised(model, sp.Tuple(expression, *slopes)), [0, *(k + 1 for k in rows)]
