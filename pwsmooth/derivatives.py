"""How a run moves with parameters, initial values and its start: `solve(with_respect_to=...)`.

Chain: paths/tangents.py, which plays the run's tape again -> **Derivatives**, `Solution.derivatives`.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from .definition import checks
from .definition.describe import Described, Rows, values
from .definition.model import Model
from .kernels.tangent.state import CORNER, GRAZES
from .paths.clock import slopes_of_instants
from .paths.limits import limits
from .paths.tangents import Deviations, Tape, replay
from .results import outputs

__all__ = ["Derivatives", "EventDerivative", "NoDerivative"]

START_TIME = "t0"
_TANGENT = 1e-9  # deviations out of a surface that are roundings
# Ambiguities in which one of several attractors is taken: what is near it is taken too.
_KEPT_CHOICES = ("several attracting states of the layer",)
_SAME_INSTANT = 1e-12  # of the larger of the time and the span


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

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> x, a = sp.symbols("x a", real=True)
    >>> run = solve(System({x: a * sp.sign(x)}, parameters={a: 1}), (0, 1), {x: 0}, with_respect_to=[a])
    >>> run.derivatives.end
    Traceback (most recent call last):
        ...
    pwsmooth.derivatives.NoDerivative: There is no derivative from t = 0 on: the motion is not unique ...
    """

    def __init__(self, t: float, cause: str, reason: str) -> None:
        self.t, self.cause, self.reason = t, cause, reason
        where = f" [{cause}]" if cause else ""
        super().__init__(f"There is no derivative from t = {t:.12g} on: {reason}{where}.")


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

    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> x, v = sp.symbols("x v", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    >>> stop = solve(body, (0, 3), {x: 0, v: 4}, with_respect_to=[mu]).derivatives.at_event(0)
    >>> print(f"{stop.time[0]:.6f} {stop.after[0, 0]:.6f}")  # of 4/mu and 8/mu
    -1.000000 -2.000000
    """

    time: np.ndarray
    before: np.ndarray
    after: np.ndarray


class Quantities(NamedTuple):
    """What is differentiated by: columns of parameters, of initial values, and that of the start time."""

    names: tuple[str, ...]
    parameters: tuple[sp.Symbol | None, ...]  # of each its parameter, if it is one
    states: tuple[int | None, ...]  # of each the state whose initial value it is
    start_time: int | None


def quantities(system: Any, wanted: Any) -> Quantities:
    """The quantities of a model that these names stand for.

    Raises
    ------
    ValueError
        A name that is none, or twice.
    """
    what = "`with_respect_to`"
    found = [getattr(name := checks.named(item), "name", name) for item in checks.several(wanted, what)]
    model = system.model
    parameters = {s.name: s for s in system.parameters}
    states = {s.name: i for i, s in enumerate(model.states)}
    cells = {s for event in model.events if event.tables for s, _ in event.update}
    for name in found:
        if name == START_TIME or name in parameters:
            continue
        if name not in states:
            known = ", ".join((*parameters, *states, START_TIME))
            raise ValueError(
                f"{what} names {checks.shown(name)}, which has no derivative here: give parameters, states or memories "
                f"(their initial values) or {START_TIME!r}, of {known}. The time of an Event, a restitution, a level "
                "of a switch is one if it is written as a parameter."
            )
        if model.states[states[name]] in cells:
            raise ValueError(f"{what} names {name!r}, which counts the cells of a drive: it has no derivative.")
    if len(set(found)) < len(found):
        raise ValueError(f"{what} names something twice: {', '.join(found)}.")
    of_parameters = tuple(parameters.get(name) for name in found)
    of_states = tuple(None if p is not None else states.get(name) for name, p in zip(found, of_parameters))
    start = found.index(START_TIME) if START_TIME in found and START_TIME not in parameters else None
    return Quantities(tuple(found), of_parameters, of_states, start)


def problems(
    solution: Any, marked: Sequence[tuple[int, int, float]], off: Mapping[str, float]
) -> list[NoDerivative]:
    """Why a run has no derivative, the first first: instants that a replay has `marked` with (code, cause, time),
    ambiguities, quantities that lead `off` the surfaces on which it begins."""
    model, found = solution.model, []
    names = [str(m.symbol) for m in model.multipliers] + [event.name for event in model.events]
    reasons = {
        GRAZES: "the surface is touched and not crossed, where the derivative by one side has no bound",
        CORNER: "several surfaces are met at once, in an order that any change may turn",
    }
    for why, cause, t in marked:
        reason = reasons.get(why, "the motion begins there anew by a rule that has no derivative")
        found.append(NoDerivative(float(t), names[cause] if 0 <= cause < len(names) else "", reason))
    for ambiguity in solution.ambiguities:
        if ambiguity.kind not in _KEPT_CHOICES:
            reason = f"the motion is not unique ({ambiguity.kind})"
            found.append(NoDerivative(ambiguity.time, ambiguity.switch, reason))
    for name in (name for name, size in off.items() if size > _TANGENT):
        reason = (
            f"it begins on a surface that holds it, and {name} leads out of that, to either side differently"
        )
        found.append(NoDerivative(float(solution.t[0]), "", reason))
    return sorted(found, key=lambda problem: problem.t)


class Derivatives(Described):
    """How a run moves with k quantities: d(state)/dq at its times and between them, d(event)/dq, d(output)/dq.

    Indexing gives those of a state, multiplier or output at the solution's times, ``derivatives["v"]`` of shape
    (k, nt); a call those at other times, ``derivatives(t, "v")``. At an event they are of the side after it, as values
    of the dense output are; a solution's two columns there have both.

    Parameters
    ----------
    solution : Solution
        The run; `solve` makes them.
    tape : Tape
        What the run has written.
    wanted : Quantities
        By what is differentiated.

    Attributes
    ----------
    names : tuple of str
        The k quantities, as they were given.

    Notes
    -----
    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for events; between
    them the variational equations are solved by Taylor series on the run's own steps.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, solve
    >>> x, v = sp.symbols("x v", real=True)
    >>> mu = sp.Symbol("mu", positive=True)
    >>> body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    >>> derivatives = solve(body, (0, 3), {x: 0, v: 4}, with_respect_to=[mu, "v"]).derivatives
    >>> print(derivatives.end[0].round(6).tolist())  # of v**2/(2*mu)
    [-2.0, 2.0]
    >>> print(derivatives(1.0, "x").round(6).tolist())  # of v*t - mu*t**2/2
    [-0.5, 1.0]
    """

    def __init__(self, solution: Any, tape: Tape, wanted: Quantities) -> None:
        self._solution, self._tape, self._wanted = solution, tape, wanted
        self.names = wanted.names

    # ---- what is played again ----------------------------------------------------------------------

    def _replay(self, times: np.ndarray | None, points: bool) -> Deviations:
        model, wanted, tape = self._solution.model, self._wanted, self._tape
        k, n = len(wanted.names), len(model.states)
        start, seeds = np.zeros((n, k)), np.zeros((len(model.parameters), k))
        clock = np.zeros((len(tape.clock), k))
        numbers = {s: i for i, s in enumerate(model.parameters)}
        given = dict(zip(model.parameters, tape.p))
        for column, (parameter, state) in enumerate(zip(wanted.parameters, wanted.states)):
            if parameter is not None:
                seeds[numbers[parameter], column] = 1.0
                clock[:, column] = slopes_of_instants(model, given, tape.clock, tape.clock_event, parameter)
            elif state is not None:
                start[state, column] = 1.0
        if wanted.start_time is not None:
            start[:, wanted.start_time] = -first_rates(model, tape)
        return replay(model, tape, start, seeds, times, clock, points)

    @functools.cached_property
    def _outline(self) -> Deviations:
        """The end and the events."""
        return self._replay(None, points=False)

    @functools.cached_property
    def problems(self) -> list[NoDerivative]:
        """Instants from which the run has no derivative, the first first."""
        run = self._outline
        marked = [(why, cause, t) for t, (why, cause) in zip(run.instant_t, run.instant_why) if why]
        found = problems(self._solution, marked, dict(zip(self.names, run.off)))
        if run.stopped == run.stopped:
            found.append(NoDerivative(run.stopped, "", "a step has no Taylor series"))
        return sorted(found, key=lambda problem: problem.t)

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

    @functools.cached_property
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
        """Of the states at the end of the run, shape (n, k)."""
        self._defined(self._solution.t[-1])
        return self._outline.end

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
            raise KeyError(f"{name!r} is {solution._none_of_these}")
        expression = solution._expressions[name]
        by_parameter = [p for p in self._wanted.parameters if p is not None]
        symbols = [*model.states, *(m.symbol for m in model.multipliers), *by_parameter]
        slopes = _gradient(model, expression, tuple(symbols))(t, *states, *forces, *self._tape.p)
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

    @functools.cached_property
    def _limits(self) -> dict[float, tuple[np.ndarray, np.ndarray]]:
        """Of the time of each accumulation the instants that lead to it, and what they weigh."""
        return limits(self._solution, self._outline.instant_t, self._outline.instant_why[:, 1])

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


def first_rates(model: Model, tape: Tape) -> np.ndarray:
    """f behind the start of a run."""
    n, m = len(model.states), len(model.multipliers)
    values = tape.values[0]
    rates = outputs.vectorised(model, sp.Tuple(*model.rhs))
    with np.errstate(all="ignore"):  # numpy takes both branches of what is written in pieces
        return np.array(rates(values[0], *values[2 : 2 + n + m], *tape.p), float)
