"""What a cost reads of a run, and with which slopes: values and covectors, pulled back over the run's tape.

A long run comes in parts, one of which is in memory at a time: once along all for the values, and back over each, which
is run again from where it began.
Chain: quantities.py, Solutions with their tapes -> **reading** -> `pull_back` of the tapes -> objective.py.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import sympy as sp

from ..definition.lambdified import numpy_function
from ..door.documenting import complete
from ..paths.derivatives.of_solution import NoDerivative, problems
from ..paths.derivatives.quantities import Quantities
from ..paths.derivatives.tangents import Readings, Slopes
from ..paths.limits import limits
from ..results import outputs
from .quantities import Quantity

_HALVINGS, _SAME = 12, 1e-13  # of a step of a quadrature at most, and by how much halves may differ from it
_NODES = 33  # at which an expression is looked at on a step, whose polynomial has degree 31 at most


@complete
class Gradient(NamedTuple):
    """A cost and its slopes.

    Attributes
    ----------
    value : float
        In the unit of the cost.
    gradient : ndarray, shape (k,)
        By the quantities, in the unit of the cost over theirs.

    >>> x = sp.Symbol("x", real=True)
    >>> found = value_and_gradient(System({x: -2 * x}), final(x) ** 2, (0, 1), {x: 1}, by=["x"])
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
    costs: list[Any]  # of (*found, *used): each cost and its slopes by them


class Parts(Protocol):
    """A run in parts."""

    def along(self) -> Iterator[Any]:
        """The Solution of each part; it stands until the next one is asked for."""

    def again(self, k: int) -> Any:
        """That of part k, once more."""


def read(asked: Asked, parts: Parts) -> tuple[Found, Reader]:
    """What the quantities come to, and the reader of the last part."""
    found = Found(asked)
    for run in parts.along():
        found.take(reader := Reader(asked, run, found.parts, found.seen[-1]))
    return found, reader


def gradients(asked: Asked, parts: Parts) -> list[Gradient]:
    """Of each cost value and gradient.

    Raises
    ------
    NoDerivative
        As of `Objective`.
    """
    (found, reader), costs = read(asked, parts), asked.costs
    numbers, used = found.numbers(reader), reader.p[asked.used]
    values = [cost(*numbers, *used) for cost in costs]
    slopes, own = (np.array([by for _, *by in values], float)[:, part] for part in found.sections)
    by_state, by_parameter = np.zeros((len(costs), reader.n)), np.zeros((len(costs), len(reader.p)))
    by_parameter[:, asked.used] = own
    problems: list[NoDerivative] = []
    for k in range(found.parts - 1, -1, -1):
        if k < found.parts - 1:
            reader = Reader(asked, parts.again(k), k, found.seen[k])
        for row, by in enumerate(slopes):
            wanted = [slope if owner in (k, None) else 0.0 for slope, owner in zip(by, found.owner)]
            back = reader.pulled(wanted, by_state[row])
            by_state[row], by_parameter[row] = back.start, by_parameter[row] + back.parameters
            problems += reader.problems(back)
    if problems:
        raise min(problems, key=lambda problem: problem.t)
    gradient = np.empty((len(costs), len(asked.by.names)))
    for k, (place, p) in enumerate(zip(asked.places, asked.by.parameters)):
        if place is None:
            gradient[:, k] = -by_state @ reader.tape.first_rates()
        else:
            gradient[:, k] = (by_state if p is None else by_parameter)[:, place]
    return [Gradient(float(value), row) for (value, *_), row in zip(values, gradient)]


def value_of(cost: Any, found: Sequence[Quantity], outputs: dict[Quantity, str], run: Any) -> float:
    """A cost of one Solution with dense output; of each quantity `outputs` names the expression."""
    asked = Asked(Quantities((), (), (), None), [], list(found), outputs, {}, np.empty(0, int), [])
    if run.derivatives is None and run.tape is None and run.dense is None:
        raise ValueError("the Solution has no dense output; solve with dense_output=True.")
    values = Found(asked)
    values.take(reader := Reader(asked, run, 0, {}))
    given = [q for q in sorted(cost.free_symbols, key=str) if not isinstance(q, Quantity)]
    numbers = [run.parameters[str(p)] for p in given]
    return float(_numeric(cost, (*found, *given))(*values.numbers(reader), *numbers))


@functools.lru_cache(maxsize=64)
def _numeric(cost: sp.Expr, symbols: tuple[sp.Symbol, ...]) -> Any:
    return numpy_function(symbols, cost)


class Found:
    """What the quantities of a cost come to along the parts of a run, and in which part that is (None: in all)."""

    def __init__(self, asked: Asked) -> None:
        self.asked, count = asked, len(asked.found)
        self.values: list[float | None] = [None] * count
        self.owner: list[int | None] = [None] * count
        # Before each part and behind the last: events of a quantity.
        self.seen: list[dict[Quantity, int]] = [{}]
        self.sections = slice(0, count), slice(count, None)

    @property
    def parts(self) -> int:
        return len(self.seen) - 1

    def take(self, reader: Reader) -> None:
        for i, quantity in enumerate(self.asked.found):
            read = reader.read(quantity)
            if read is None:
                continue
            (value, _), known = read, self.values[i]
            if quantity.kind in ("misfit", "duration"):
                self.values[i] = value + (known or 0.0)
                continue
            sign = {"largest": 1, "smallest": -1}.get(quantity.kind, 0)
            # Of other quantities the last part that has one, as the state at the end.
            if known is None or sign == 0 or sign * value > sign * known:
                self.values[i], self.owner[i] = value, reader.part
        self.seen.append(reader.seen)

    def numbers(self, reader: Reader) -> list[float]:
        for quantity, value in zip(self.asked.found, self.values):
            if value is None and quantity.kind in ("event_time", "at_event"):
                what = f"{quantity} asks for an event that does not happen"
                raise NoDerivative(float(reader.run.t[-1]), quantity.where[0], what)
            if value is None:
                raise ValueError(
                    f"{quantity} asks for times outside of the run, which ends at {reader.run.t[-1]:g}."
                )
        return self.values  # type: ignore[return-value]


class Reader:
    """What a cost reads of one part of a run, and with which slopes."""

    def __init__(self, asked: Asked, run: Any, part: int, seen: dict[Quantity, int]) -> None:
        if not run.success:
            raise NoDerivative(float(run.t[-1]), "", f"the run ends there: {run.message}")
        self.asked, self.run, self.model = asked, run, run.model
        self.n, self.m = len(run.x), len(run.mult)
        self.p = np.array([run.parameters[p.name] for p in run.model.parameters])
        self.part, self.before, self.seen = part, seen, dict(seen)
        self.reads: dict[Quantity, Any] = {}
        self._clear()

    @functools.cached_property
    def tape(self) -> Any:
        return self.run.tape if self.run.derivatives is None else self.run.derivatives.tape

    def _clear(self) -> None:
        self.end = np.zeros(self.n + self.m)
        self.times: list[np.ndarray] = []
        self.slopes: list[np.ndarray] = []
        self.instants: dict[int, np.ndarray] = {}
        self.by_parameter = np.zeros(len(self.p))

    def read(self, quantity: Quantity) -> tuple[float, Any] | None:
        """Its value, and what adds a slope by it to those by what it reads; None where this part has none of it."""
        if quantity not in self.reads:
            self.reads[quantity] = getattr(self, f"_{quantity.kind}")(quantity)
        return self.reads[quantity]

    def pulled(self, slopes: Sequence[float], end: np.ndarray) -> Slopes:
        """Slopes by the part's start and by parameters, from those by quantities and by the state at its end."""
        self._clear()
        for quantity, slope in zip(self.asked.found, slopes):
            if slope != 0.0 and (read := self.read(quantity)) is not None:
                read[1](float(slope))
        times = np.concatenate([np.empty(0), *self.times])
        at = np.concatenate([np.empty((0, self.n + self.m)), *self.slopes])
        order = np.argsort(times, kind="stable")
        entries = np.array(sorted(self.instants), np.int64)
        at_instants = np.array([self.instants[k] for k in entries.tolist()]).reshape(-1, 2 * self.n + 1)
        # The end is a time like the others; multipliers deviate with the states there.
        times, at = np.append(times[order], self.run.t[-1]), np.vstack([at[order], self.end])
        back = self.tape.pull_back(Readings(end, times, at, entries, at_instants))
        return back._replace(parameters=back.parameters + self.by_parameter)

    def problems(self, back: Slopes) -> list[NoDerivative]:
        """Where this part has no derivative."""
        asked = self.asked
        off = {
            name: back.off[place if p is None else self.n + place]
            for name, place, p in zip(asked.by.names, asked.places, asked.by.parameters)
            if place is not None and self.part == 0
        }
        return problems(self.run, [back.why] if back.why else [], off)

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
        last = t == self.run.t[-1]
        if last.all():  # at the end the dense output is not asked, and may not have been kept
            x, mult = np.repeat(self.run.x[:, -1:], len(t), 1), np.repeat(self.run.mult[:, -1:], len(t), 1)
        else:
            x, mult = self.run.dense(t)
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
        if quantity not in self.asked.integrals:
            return _quadrature(lambda t: self._read(quantity, t)[0], self.run), None
        i = self.asked.integrals[quantity]

        def add(slope: float) -> None:
            self.end[i] += slope

        return float(self.run.x[i, -1]), add

    def _final(self, quantity: Quantity) -> tuple[float, Any]:
        return self._single(quantity, float(self.run.t[-1]))

    def _at(self, quantity: Quantity) -> tuple[float, Any] | None:
        (t,) = quantity.where
        return self._single(quantity, t) if self.run.t[0] <= t <= self.run.t[-1] else None

    def _single(self, quantity: Quantity, t: float) -> tuple[float, Any]:
        values, add = self._read(quantity, np.array([t]))
        return float(values[0]), lambda slope: add(np.array([slope]))

    def _misfit(self, quantity: Quantity) -> tuple[float, Any]:
        t = quantity.data[0]
        # A sample between two parts belongs to the one that ends there.
        inside = (t > self.run.t[0]) & (t <= self.run.t[-1]) | (t == self.run.t[0]) & (self.part == 0)
        t, measured, sigma = quantity.data[:, inside]
        values, add = self._read(quantity, t.copy())
        off = (values - measured) / sigma
        return float(off @ off), lambda slope: add(2.0 * slope * off / sigma)

    def _time(self, quantity: Quantity) -> float | None:
        switch, kind, number, *_ = quantity.where
        times, seen = self.run.event_times(kind, switch), self.before.get(quantity, 0)
        self.seen[quantity] = seen + len(times)
        return float(times[number - seen]) if seen <= number < seen + len(times) else None

    @functools.cached_property
    def _limits(self) -> dict[float, tuple[np.ndarray, np.ndarray]]:
        return limits(self.run, *self.tape.met())

    def _entries(self, time: float) -> list[tuple[int, float]]:
        """Entries of the tape at which an event's instant begins, or those that lead to it; and what they weigh."""
        entries = self.tape.instants
        if time in self._limits:
            places, weights = self._limits[time]
            return list(zip(entries[places].tolist(), weights.tolist()))
        return [(int(entries[np.abs(self.tape.met()[0] - time).argmin()]), 1.0)]

    def _instant(self, time: float, before: Any = 0.0, after: Any = 0.0, shift: float = 0.0) -> None:
        for entry, weight in self._entries(time):
            row = self.instants.setdefault(entry, np.zeros(2 * self.n + 1))
            row[: self.n] += weight * before
            row[self.n : -1] += weight * after
            row[-1] += weight * shift

    def _event_time(self, quantity: Quantity) -> tuple[float, Any] | None:
        time = self._time(quantity)
        return None if time is None else (time, lambda slope: self._instant(time, shift=slope))

    def _at_event(self, quantity: Quantity) -> tuple[float, Any] | None:
        time, after = self._time(quantity), quantity.where[-1]
        if time is None:
            return None
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
        solved = (run.status[run.multipliers.index(switch)] == 0).astype(int)
        changes = np.flatnonzero(np.diff(solved))
        ends = list(zip(run.t[changes + 1].tolist(), -np.diff(solved)[changes]))

        def add(slope: float) -> None:
            for t, sign in ends:
                if t > run.t[0]:
                    self._instant(t, shift=sign * slope)

        whole = [(run.t[0], -solved[0]), *ends, (run.t[-1], solved[-1])]
        return float(sum(sign * t for t, sign in whole)), add

    def _largest(self, quantity: Quantity, sign: float = 1.0) -> tuple[float, Any] | None:
        t, (begin, end) = self.run.t, quantity.where
        begin = t[0] if begin is None else max(begin, t[0])
        end = t[-1] if end is None else min(end, t[-1])
        if not begin < end:
            return None

        def value(t: np.ndarray) -> np.ndarray:
            return sign * self._read(quantity, t)[0]

        time = _highest(value, self.run, begin, end)
        events = np.unique(self.run.event_times())
        if begin < time < end and np.any(np.abs(events - time) <= 1e-13 * abs(end)):
            columns = np.flatnonzero(np.abs(t - time) <= 1e-13 * abs(end))
            tried = [self._at_instant(quantity, time, int(c), c == columns[-1]) for c in columns[[0, -1]]]
            return max(tried, key=lambda pair: sign * pair[0])
        return self._single(quantity, time)

    def _smallest(self, quantity: Quantity) -> tuple[float, Any] | None:
        return self._largest(quantity, -1.0)


def _quadrature(value: Any, run: Any) -> float:
    """The integral of a function of time over a run, step by step: Gauss's rule, by halves where these differ."""
    x, weights = np.polynomial.legendre.leggauss(16)
    ends = np.unique(run.t)
    low, high = ends[:-1], ends[1:]

    def rule(low: np.ndarray, high: np.ndarray) -> np.ndarray:
        times = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * x
        return 0.5 * (high - low) * (value(times.ravel()).reshape(times.shape) @ weights)

    whole, total = rule(low, high), 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        left, right = rule(low, middle), rule(middle, high)
        rough = np.abs(left + right - whole) > _SAME * (np.abs(left) + np.abs(right))
        total += (left + right)[~rough].sum()
        low, high = np.append(low[rough], middle[rough]), np.append(middle[rough], high[rough])
        whole = np.append(left[rough], right[rough])
    return float(total + whole.sum())


def _highest(value: Any, run: Any, begin: float, end: float) -> float:
    """Where a function of time is largest: at an end of a step, or where its interpolant within one is stationary."""
    ends = np.unique(np.concatenate([[begin], run.t[(run.t > begin) & (run.t < end)], [end]]))
    nodes = np.polynomial.chebyshev.chebpts2(_NODES)
    low, high = ends[:-1, None], ends[1:, None]
    times = 0.5 * (low + high) + 0.5 * (high - low) * nodes
    heights = value(times.ravel()).reshape(times.shape)
    # Of every step that could hold it: beside the end of one it is in the next.
    rise = np.abs(np.diff(heights, axis=1)).max(axis=1)
    found = []
    for piece in np.flatnonzero(heights.max(axis=1) + rise >= heights.max()):
        k = int(heights[piece].argmax())
        found.append(float(times[piece, k]))
        # A maximum's time is known to half the digits of its height, but to nearly all of those of the slope.
        a, b = (float(times[piece, q]) for q in (max(k - 1, 0), min(k + 1, _NODES - 1)))
        fit = np.polynomial.Chebyshev.interpolate(lambda t: value(np.asarray(t)), _NODES // 2, domain=[a, b])
        roots = fit.deriv().roots()
        found += roots[(np.abs(roots.imag) < 1e-9) & (a < roots.real) & (roots.real < b)].real.tolist()
    return found[int(value(np.array(found)).argmax())]


@functools.lru_cache(maxsize=256)
def _with_slopes(model: Any, expression: sp.Basic) -> tuple[Any, list[int]]:
    """A numpy function of (t, *x, *mult, *p): an expression, and its slopes by the symbols that stand in it; and their
    rows where 0 is the expression, and states, multipliers, parameters and time follow."""
    symbols = (*model.states, *(mu.symbol for mu in model.multipliers), *model.parameters, model.time)
    rows = [k for k, s in enumerate(symbols) if s in expression.free_symbols]
    slopes = [expression.diff(symbols[k]) for k in rows]
    return outputs.vectorised(model, sp.Tuple(expression, *slopes)), [0, *(k + 1 for k in rows)]
