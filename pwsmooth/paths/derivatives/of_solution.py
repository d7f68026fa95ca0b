"""How a run moves with parameters, initial values and its start: `solve(by=...)`.

Chain: tangents.py, which plays a run's tape again, and collocation.py, for runs by implicit steps ->
**Derivatives**, `Solution.derivatives`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from ...definition.model import Model
from ...door import checks
from ...door.describe import Described, Rows, values
from ...door.documenting import complete
from ...kernels.outcome import Outcome
from ...kernels.tangent.state import CORNER, GRAZES, NO_SERIES
from ...results import outputs
from ..limits import limits
from .collocation import Collocation
from .quantities import Quantities
from .tangents import Deviations

__all__ = ["Derivatives", "EventDerivative", "NoDerivative", "Sides"]

_TANGENT = 1e-9  # deviations out of a surface that are roundings
# Ambiguities that leave the motion what it is beside others: of several attractors the one near by is taken there, too;
# of forces that are not unique the sum is.
_KEPT_CHOICES = "several attracting states of the layer", "multipliers not unique"
# How far beside a run others tell a derivative's limit, how many, and what the last two may differ by.
_FARTHEST, _BESIDE, _AGREED = 1e-4, 6, 1e-6
_SAME_INSTANT = 1e-12  # of the larger of the time and the span


@complete
class NoDerivative(ArithmeticError):
    """A run has no derivative from an instant on.

    Parameters
    ----------
    t : float, in the unit of the model's time
        The instant.
    cause : str
        The surface, contact or event, by its name.
    reason : str
        Why.

    Attributes
    ----------
    t, cause, reason
        As given.

    >>> x, a = sp.symbols("x a", real=True)
    >>> run = solve(System({x: a * sp.sign(x)}, parameters={a: 1}), (0, 1), {x: 0}, by=[a])
    >>> run.derivatives.end
    Traceback (most recent call last):
        ...
    pwsmooth.paths.derivatives.of_solution.NoDerivative: There is no derivative from t = 0 on: ...
    """

    def __init__(self, t: float, cause: str, reason: str) -> None:
        self.t, self.cause, self.reason = t, cause, reason
        where = f" [{cause}]" if cause else ""
        super().__init__(f"There is no derivative from t = {t:.12g} on: {reason}{where}.")


@complete
class EventDerivative(NamedTuple):
    """How an event moves with k quantities.

    Attributes
    ----------
    time : ndarray, shape (k,)
        d(time of the event)/dq, in units of the time over those of the quantities.
    before, after : ndarray, shape (n, k)
        d(state at the event)/dq, along with its time, before and after what happens there; in the units of the states
        over those of the quantities.

    Examples
    --------
    A body that friction stops: when, and where, by the friction.

    >>> x, v = sp.symbols("x v", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    >>> stop = solve(body, (0, 3), {x: 0, v: 4}, by=[mu]).derivatives.at_event(0)
    >>> print(f"{stop.time[0]:.6f} {stop.after[0, 0]:.6f}")  # of 4/mu and 8/mu
    -1.000000 -2.000000
    """

    time: np.ndarray
    before: np.ndarray
    after: np.ndarray


@complete
class Sides(NamedTuple):
    """Derivatives by a quantity from either side; None where that side has none either.

    Attributes
    ----------
    below, above : ndarray, shape (n,), or None
        Of the states at the end of the run, in their units over that of the quantity: limits from smaller and from
        larger values.

    Examples
    --------
    A swing whose turning point touches a wall: one side misses it, on the other one the derivative has no bound.

    >>> x, v = sp.symbols("x v", real=True)
    >>> wall = Unilateral(x, restitution=0.8, name="wall")
    >>> swing = System({x: v, v: 1 - x + wall.reaction})
    >>> run = solve(swing, (0, 5), {x: 2, v: 0}, by=["x"])
    >>> sides = run.derivatives.sides("x")
    >>> print(sides.below.round(6).tolist(), sides.above)  # (cos 5, -sin 5)
    [0.283662, 0.958924] None
    """

    below: np.ndarray | None
    above: np.ndarray | None


def problems(
    solution: Any, marked: Sequence[tuple[int, int, float]], off: Mapping[str, float]
) -> list[NoDerivative]:
    """Why a run has no derivative, the first first: instants that a replay has `marked` with (code, cause, time),
    ambiguities, quantities that lead `off` the surfaces on which it begins."""
    strays = [name for name, size in off.items() if size > _TANGENT]
    if not (marked or strays or solution.ambiguities):
        return []
    model, found = solution.model, []
    names = [str(m.symbol) for m in model.multipliers] + [event.name for event in model.events]
    reasons = {
        GRAZES: "the surface is touched and not crossed, where the derivative by one side has no bound",
        CORNER: "several surfaces are met at once, in an order that any change may turn",
        NO_SERIES: "a step has no Taylor series",
    }
    undecided = {ambiguity.time for ambiguity in solution.ambiguities}
    for why, cause, t in marked:
        if why not in reasons and t in undecided:
            continue  # the ambiguity says it better
        reason = reasons.get(why, "the motion begins there anew by a rule that has no derivative")
        found.append(NoDerivative(float(t), names[cause] if 0 <= cause < len(names) else "", reason))
    for ambiguity in solution.ambiguities:
        if ambiguity.kind not in _KEPT_CHOICES:
            reason = f"the motion is not unique ({ambiguity.kind})"
            found.append(NoDerivative(ambiguity.time, ambiguity.switch, reason))
    for name in strays:
        reason = (
            f"it begins on a surface that holds it, and {name} leads out of that, to either side differently"
        )
        found.append(NoDerivative(float(solution.t[0]), "", reason))
    return sorted(found, key=lambda problem: problem.t)


def derivatives_of(call: Any, solve: Callable[..., Any]) -> Callable[[Any], Any]:
    """What makes the Derivatives of the Solution of a call, of which there are such by `call.wanted`."""
    o = call.options
    same = dict(
        method=o.method, rtol=o.rtol, atol=o.atol, max_step=o.max_step, max_steps=o.max_steps, order=o.order,
        noise=call.noise,
    )  # fmt: skip
    beside = functools.partial(run_beside, solve, call.system, call.span, call.start, same, call.wanted)
    return functools.partial(Derivatives, wanted=call.wanted, again=beside, kept={})


def run_beside(
    solve: Callable[..., Any], system: Any, span: tuple[float, float], start: Sequence[float],
    options: Mapping[str, Any], wanted: Quantities, name: str, change: float,
) -> Any:  # fmt: skip
    """The run from `start` over `span` with one of the quantities changed."""
    k, (begin, end) = wanted.names.index(name), span
    first, values = dict(zip(map(str, system.model.states), start)), dict(system.parameters)
    parameter = wanted.parameters[k]
    if parameter is not None:
        values[parameter] += change
    elif k == wanted.start_time:
        begin += change
    else:
        first[name] += change
    return solve(system, (begin, end), first, parameters=values, by=[name], **options)


def _once(method: Callable[[Any], Any]) -> Any:
    """A property whose value the run keeps."""
    name = method.__name__

    def value(self: Any) -> Any:
        if name not in self._kept:
            self._kept[name] = method(self)
        return self._kept[name]

    return property(functools.wraps(method)(value))


@checks.door()
class Derivatives(Described):
    """How a run moves with k quantities: d(state)/dq at its times and between them, d(event)/dq, d(output)/dq.

    Indexing gives those of a state, multiplier or output at the solution's times, ``derivatives["v"]`` of shape
    (k, nt); a call those at other times, ``derivatives(t, "v")``. At an event they are of the side after it, as values
    of the dense output are; a solution's two columns there have both.

    Parameters
    ----------
    solution : Solution
        The run; `solve` makes them.
    wanted : Quantities
        By what is differentiated.
    again : callable
        (name, change) -> the Solution with one of them changed.
    kept : dict
        Where what has been computed is found again.

    Attributes
    ----------
    names : tuple of str
        The k quantities, as they were given.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for events; between
    them the variational equations are solved on the run's own steps, by Taylor series or, where these are implicit, by
    collocation.

    >>> x, v = sp.symbols("x v", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    >>> derivatives = solve(body, (0, 3), {x: 0, v: 4}, by=[mu, "v"]).derivatives
    >>> print(derivatives.end[0].round(6).tolist())  # of v**2/(2*mu)
    [-2.0, 2.0]
    >>> print(derivatives(1.0, "x").round(6).tolist())  # of v*t - mu*t**2/2
    [-0.5, 1.0]
    """

    def __init__(
        self, solution: Any, wanted: Quantities, again: Callable[[str, float], Any], kept: dict[str, Any]
    ) -> None:
        self._solution, self._wanted, self._again, self._kept = solution, wanted, again, kept
        self.names = wanted.names

    @_once
    def tape(self) -> Any:
        """By what the run is gone through again."""
        solution = self._solution
        if solution.tape is not None and solution.tape.by_series:
            return solution.tape
        return Collocation(
            solution.whole or solution, tuple(p for p in self._wanted.parameters if p is not None)
        )

    # ---- what is played again ----------------------------------------------------------------------

    def _replay(self, times: np.ndarray | None, points: bool) -> Deviations:
        model, wanted, tape = self._solution.model, self._wanted, self.tape
        k, n = len(wanted.names), len(model.states)
        start, seeds = np.zeros((n, k)), np.zeros((len(model.parameters), k))
        numbers = {s: i for i, s in enumerate(model.parameters)}
        for column, (parameter, state) in enumerate(zip(wanted.parameters, wanted.states)):
            if parameter is not None:
                seeds[numbers[parameter], column] = 1.0
            elif state is not None:
                start[state, column] = 1.0
        if wanted.start_time is not None:
            start[:, wanted.start_time] = -tape.first_rates()
        return tape.deviations(start, seeds, times, points)

    @_once
    def _outline(self) -> Deviations:
        """The end and the events."""
        return self._replay(None, points=False)

    @_once
    def problems(self) -> list[NoDerivative]:
        """Instants from which the run has no derivative, the first first."""
        run = self._outline
        at = np.flatnonzero(run.instant_why[:, 0])
        marked = [(*run.instant_why[k].tolist(), run.instant_t[k]) for k in at]
        if run.stopped == run.stopped:
            marked.append((NO_SERIES, -1, run.stopped))
        return problems(self._solution, marked, dict(zip(self.names, run.off)))

    def _defined(self, until: float) -> None:
        if self.problems and self.problems[0].t <= until:
            raise self.problems[0]

    # ---- values ------------------------------------------------------------------------------------

    @property
    def x(self) -> np.ndarray:
        """Of the states, shape (n, k, nt), at the solution's times.

        Raises
        ------
        NoDerivative
            From an instant of the run on; a call gives those before it.
        """
        return self._rows[0]

    @_once
    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Of states and multipliers, quantities, times."""
        solution = self._solution
        self._defined(solution.t[-1])
        own = solution.course is None
        run, n = self._replay(None if own else solution.t, points=own), len(solution.x)
        found = run.at_point if own else run.at_sample
        found = np.moveaxis(found, 0, -1)
        return found[:n], found[n:]

    @property
    def end(self) -> np.ndarray:
        """Of the states at the end of the run, shape (n, k): behind a terminal event, along with its time."""
        solution = self._solution
        self._defined(solution.t[-1])
        last = len(solution.events) - 1
        return self.at_event(last).after if solution.outcome is Outcome.TERMINATED else self._outline.end

    def __getitem__(self, name: Any) -> np.ndarray:
        """Of a state, multiplier or output at the solution's times, shape (k, nt)."""
        solution = self._solution
        x, mult = self._rows
        return self._of(checks.named(name), solution.t, solution.x, solution.mult, x, mult)

    def __call__(self, t: Any, name: Any = None) -> np.ndarray:
        """At other times.

        Parameters
        ----------
        t : float or array_like, shape (nt,)
            Times inside the solved span.
        name : str or Symbol, optional
            One state, multiplier or output; all states without.

        Returns
        -------
        ndarray
            Shape (n, k) or (n, k, nt) without `name`, (k,) or (k, nt) with it.

        Raises
        ------
        ValueError
            A time outside the solved span; of an output, no dense output was kept.
        NoDerivative
            A time after an instant from which the run has no derivative.
        """
        at = checks.array(t, "`t`")
        flat = at.ravel()
        order = np.argsort(flat, kind="stable")
        solution = self._solution
        begin, end = solution.t[0], solution.t[-1]
        if flat.size and not (flat.min() >= begin and flat.max() <= end):
            raise ValueError(
                f"`t` reaches from {flat.min():.9g} to {flat.max():.9g}: it leaves the solved span [{begin:.9g}, "
                f"{end:.9g}]."
            )
        if flat.size:
            self._defined(flat.max())
        found = np.empty((len(solution.x) + len(solution.mult), len(self.names), len(flat)))
        found[:, :, order] = np.moveaxis(self._replay(flat[order], points=False).at_sample, 0, -1)
        x, mult = found[: len(solution.x)], found[len(solution.x) :]
        if name is None:
            result = x
        else:
            name = checks.named(name)
            known = str(name) in (*solution.states, *solution.multipliers)
            states, forces = (solution.x, solution.mult) if known else (None, None)
            if not known:
                solution(flat, name)  # raises what is to be said of the name, or of the missing dense output
                states, forces = solution.dense(flat)
            result = self._of(name, flat, states, forces, x, mult)
        return result[..., 0] if at.ndim == 0 else result.reshape(*result.shape[:-1], *at.shape)

    def _of(self, name: Any, t: Any, states: Any, forces: Any, x: np.ndarray, mult: np.ndarray) -> np.ndarray:
        solution, model, name = self._solution, self._solution.model, str(name)
        if name in solution.states:
            return x[solution.states.index(name)]
        if name in solution.multipliers:
            return mult[solution.multipliers.index(name)]
        if model.families is not None or name not in solution._expressions:
            raise KeyError(f"{name!r} is {solution._none_of_these(name)}")
        expression = solution._expressions[name]
        by_parameter = [p for p in self._wanted.parameters if p is not None]
        symbols = [*model.states, *(m.symbol for m in model.multipliers), *by_parameter]
        slopes = _gradient(model, expression, tuple(symbols))(t, *states, *forces, *self.tape.p)
        slopes = [np.broadcast_to(np.asarray(slope, float), np.shape(t)) for slope in slopes]
        n, m = len(states), len(forces)
        total = np.einsum("it,ikt->kt", np.array(slopes[:n]), x)
        if m:
            total = total + np.einsum("it,ikt->kt", np.array(slopes[n : n + m]), mult)
        rest = iter(slopes[n + m :])
        for column, parameter in enumerate(self._wanted.parameters):
            if parameter is not None:
                total[column] += next(rest)
        return total

    # ---- events ------------------------------------------------------------------------------------

    def at_event(self, i: int) -> EventDerivative:
        """Of event i of the solution.

        Parameters
        ----------
        i : int
            Its place among `Solution.events`.

        Returns
        -------
        EventDerivative
            Of its time and of the state there.

        Raises
        ------
        NoDerivative
            The event has none, or one before it has none.
        IndexError, ValueError
            There is no such event; one at the very start.
        """
        event = self._solution.events[i]
        run = self._outline
        near = _SAME_INSTANT * max(abs(event.time), float(np.ptp(self._solution.t)))
        self._defined(event.time + near)
        n = len(self._solution.x)
        if event.time in self._limits:
            places, weights = self._limits[event.time]
            state = np.tensordot(weights, run.instant_w[places, n:], 1)
            return EventDerivative(weights @ run.instant_dt[places], state, state)
        k = int(np.argmin(np.abs(run.instant_t - event.time))) if len(run.instant_t) else -1
        if k < 0 or abs(run.instant_t[k] - event.time) > near:
            raise ValueError(f"`i` is {i}: {event} is no instant between steps, which alone have derivatives.")
        return EventDerivative(run.instant_dt[k], run.instant_w[k, :n], run.instant_w[k, n:])

    def event_times(self, kind: str | None = None, switch: Any = None) -> np.ndarray:
        """Of the times of events of one kind or switch, both, or all, in the order of `Solution.event_times`.

        Parameters
        ----------
        kind : str, optional
            As of `Solution.event_times`.
        switch : Switch, Symbol or str, optional
            As of `Solution.event_times`.

        Returns
        -------
        ndarray, shape (ne, k)
            In units of the time over those of the quantities.

        Raises
        ------
        NoDerivative
            One of them has none.
        """
        run = self._outline
        times = self._solution.event_times(kind, switch)
        if not len(times):
            return np.zeros((0, len(self.names)))
        self._defined(times[-1])
        found = run.instant_dt[np.abs(run.instant_t[None, :] - times[:, None]).argmin(axis=1)]
        for time, (places, weights) in self._limits.items():
            found[times == time] = weights @ run.instant_dt[places]
        return found

    @_once
    def _limits(self) -> dict[float, tuple[np.ndarray, np.ndarray]]:
        """Of the time of each accumulation the instants that lead to it, and what they weigh."""
        return limits(self._solution, self._outline.instant_t, self._outline.instant_why[:, 1])

    def sides(self, name: Any) -> Sides:
        """Of the end of the run by one of the quantities, from smaller and from larger values of it.

        What is left to say where there is no derivative: limits of those of runs beside this one.

        Parameters
        ----------
        name : str or Symbol
            One of `names`.

        Returns
        -------
        Sides
            They agree where there is a derivative.

        Raises
        ------
        ValueError
            Another name.
        """
        name = str(checks.key(name, "`name`"))
        if name not in self.names:
            raise ValueError(f"`name` is {name!r}; differentiated is by {', '.join(self.names)}.")
        return Sides(*(self._side(name, sign) for sign in (-1.0, 1.0)))

    def _side(self, name: str, sign: float) -> np.ndarray | None:
        """The limit for changes that go to 0: from runs that are ever nearer, by Neville's extrapolation."""
        steps = sign * _FARTHEST * 0.25 ** np.arange(_BESIDE)
        rows: list[list[np.ndarray]] = []
        for k, step in enumerate(steps):
            try:
                row = [self._again(name, float(step)).derivatives.end[:, 0]]
            except (NoDerivative, ValueError):
                return None
            for j in range(1, k + 1):
                row.append(row[j - 1] + (row[j - 1] - rows[k - 1][j - 1]) / (steps[k - j] / step - 1.0))
            rows.append(row)
        near, nearer = rows[-2][-1], rows[-1][-1]
        size = np.abs(nearer).max()
        return nearer if np.abs(nearer - near).max() <= _AGREED * (1.0 + size) else None

    # ---- repr --------------------------------------------------------------------------------------

    def _described(self) -> tuple[str, Rows]:
        problems = self.problems
        return f"Derivatives with respect to {', '.join(self.names)}", {
            "problems": [str(problem) for problem in problems],
            **(
                {}
                if problems
                else {
                    f"by {name}": values(self._solution._shown, column)
                    for name, column in zip(self.names, self.end.T)
                }
            ),
        }.items()


@functools.lru_cache(maxsize=256)
def _gradient(model: Model, expression: sp.Basic, symbols: Sequence[sp.Symbol]) -> Any:
    """A numpy function of (t, *x, *mult, *p): the slopes of an expression by these symbols."""
    return outputs.vectorised(model, sp.Tuple(*(expression.diff(s) for s in symbols)))
