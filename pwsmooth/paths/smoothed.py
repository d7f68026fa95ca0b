"""The smoothed path of solve(): the stiff integrator's result as a Solution.

Chain: solve -> **this file** -> stiff_steps.py (the product's own methods, which never step over a layer) or SciPy's.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..definition.model import Model
from ..definition.pointwise import value
from ..door import calls
from ..results.records import CONFLICTING_UPDATES, Ambiguity, EventRecord, Outcome, StepPolynomials, places
from ..results.solution import Solution
from .call import Call, Options, is_smoothed
from .clock import require_none_at_start
from .words import singular_cause, words_of


@dataclass(frozen=True)
class SciPyDense:
    """SciPy's own dense output in the form of ours."""

    interpolant: Any

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (n, nt) and no multipliers (0, nt)."""
        return self.interpolant(t), np.zeros((0, len(t)))

    def _placed(
        self, points: int, end: float, wanted: Sequence[int]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `Dense._placed`."""
        knots = np.minimum(self.interpolant.ts, end)
        steps = np.flatnonzero(np.diff(knots) > 0)
        t = knots[steps, None] + np.diff(knots)[steps, None] * places(points, len(steps))
        return steps, t, self.interpolant(t.ravel()).reshape(-1, *t.shape)[list(wanted)]


def why_not(model: Model, call: Call) -> str:
    """Where the system is no smoothed view.

    Raises
    ------
    ValueError
        What no run of one has.
    """
    if not is_smoothed(model):
        return "the system is no smoothed view"
    from . import stiff_steps as stiff

    options, known = call.options, (*stiff.METHODS, *stiff.SCIPY_METHODS)
    if options.method not in known:
        raise ValueError(
            f"`method` is {options.method!r}, which no smoothed view has; choose one of {', '.join(known)}."
            + calls.hint(options.method, known)
        )
    if options.method in stiff.SCIPY_METHODS and call.wanted is not None:
        raise ValueError(
            "`by` is given for one of SciPy's methods, which have no derivatives; leave `method` out."
        )
    if options.method in stiff.SCIPY_METHODS and call.random is not None:
        raise ValueError(
            f"`method` is {options.method!r}, which runs without events and so without kicks; use 'auto' with `noise`."
        )
    explicit_alone(options)
    return ""


def explicit_alone(options: Options) -> None:
    """Refuses what implicit steps do not have."""
    if options.order is not None or options.strict:
        raise ValueError(
            "`order` and `strict` belong to Taylor steps and the pair; leave them out for a smoothed view and with "
            "method='stiff'."
        )


def run(call: Call) -> Solution:
    """The Solution of a smoothed view.

    Raises
    ------
    ValueError
        A method that the model does not allow.
    """
    from . import stiff_steps as stiff

    kicks, method, times, (t0, t1) = call.random, call.options.method, call.times, call.span
    system = call.system if kicks is None else kicks.system
    model, values = system.model, system.parameters
    if not call.continues:
        require_none_at_start(model, values, t0, "a smoothed view")
    start, p = np.array(call.start), np.array(system.parameter_values, float)
    rtol, atol = min(call.options.rtol, stiff.LOOSEST_RTOL), call.options.absolute(model)
    dense = call.options.dense or call.wanted is not None  # derivatives go along the steps' polynomials
    tolerances = {"rtol": rtol, "atol": float(atol.max(initial=0.0)), "method": method}
    common = dict(
        method=method, rtol=rtol, atol=atol, max_step=call.options.max_step, t_eval=times, dense=dense
    )
    if method in stiff.SCIPY_METHODS:
        pieces = _scipy(model, call.span, start, p, dict(common, spending=call.budget()))
    else:
        *pieces, columns = own(model, call.span, start, p, dict(common, kicks=kicks), call.budget())
    t, x, events, polynomials, outcome, cost, ambiguities = pieces

    def solution(t, x):
        none = np.zeros((0, len(t)))
        return Solution(
            system, t, x, none, none, events, polynomials, outcome, cost, tolerances, ambiguities, values
        )

    found = solution(t, x)
    if times is not None:
        ends = [t0, *([t1] if outcome is Outcome.FINISHED else t[-1:])]
        found.course = np.array(ends), np.zeros((0, len(ends)), np.int8)
        if method in stiff.METHODS:
            found.whole = solution(*columns)
    return found


def own(model, t_span, start, p, options, spending, words=None):
    """Times, states, events, dense output, outcome, cost and all columns of a run of the package's own integrator.

    `words` gives switch, kind and note of an event by its index and the state before it.
    """
    from . import stiff_steps as stiff

    run = stiff.integrate(model, t_span, start, p, spending=spending, **options)
    outcome = Outcome(run.status)
    events = [
        EventRecord(when, *(words(i, before) if words else words_of(model, i)))
        for when, i, before, _ in run.events
        if model.events[i].recorded
    ]
    if outcome is Outcome.EVENTS_ACCUMULATE:
        events[-1] = EventRecord(events[-1].time, events[-1].switch, "accumulation")
    if outcome is Outcome.TERMINATED and model.events[run.events[-1][1]].singular:
        outcome = Outcome.SINGULAR_POINT
    elif outcome in (Outcome.NOT_FINITE, Outcome.STEP_UNDERFLOW):
        cause = singular_cause(model, run.t[-1:], run.x[:, -1:], np.zeros((0, 1)), p, options["atol"])
        if cause is not None:
            outcome = Outcome.SINGULAR_POINT
            events.append(EventRecord(float(run.t[-1]), *words_of(model, cause)))
    cost = {**run.counters, "events": len(events)}
    t, x = run.t, run.x
    if run.t_eval is not None and run.x_eval is not None:
        # Wanted times beyond the end of a run that stopped early were never reached.
        reached = ~np.isnan(run.x_eval).any(axis=0)
        t, x = run.t_eval[reached], run.x_eval[:, reached]
        # At an event the side after it, as the dense output has it.
        column = np.clip(np.searchsorted(run.t, t, side="right") - 1, 0, None)
        met = run.t[column] == t
        x[:, met] = run.x[:, column[met]]
        if outcome is not Outcome.FINISHED and (t.size == 0 or t[-1] < run.t[-1]):
            # Where and in which state it stopped, as the event-driven path gives it.
            t, x = np.append(t, run.t[-1]), np.column_stack([x, run.x[:, -1]])
    dense = _polynomials(run.dense, len(model.states)) if options["dense"] else None
    return t, x, events, dense, outcome, cost, _conflicts(model, run.events, p), (run.t, run.x)


def _conflicts(model, fired, p) -> list[Ambiguity]:
    """Where of events that acted on the same values one set a state that another set or added to otherwise.

    What kernels/instant/firing.py records on the event-driven path.
    """
    found: list[Ambiguity] = []
    if not any(one[0] == other[0] for one, other in itertools.pairwise(fired)):
        return found  # as of a hundred thousand kicks
    for (when, before), group in itertools.groupby(fired, key=lambda event: (event[0], event[2].tobytes())):
        indices = [event[1] for event in group]
        if len(indices) < 2:
            continue
        values = dict(zip(model.states, np.frombuffer(before)))
        point = {model.time: when} | dict(zip(model.parameters, p)) | values
        writes: dict[int, set] = {}
        for i in indices:
            for k, e, adds in model.events[i].writes(model.states):
                if not (adds and value(e, point) == 0):
                    writes.setdefault(k, set()).add(None if adds else value(e, point))
        if any(len(kinds) > 1 for kinds in writes.values()):
            name, continuations = CONFLICTING_UPDATES
            found.append(Ambiguity(when, model.events[indices[-1]].name, name, continuations[0], continuations))
    return found


def _polynomials(dense, n) -> StepPolynomials | None:
    if not dense:
        return None
    width = max(c.shape[1] for _, _, c in dense)
    coefficients = np.zeros((len(dense), n, width))
    for row, (_, _, c) in zip(coefficients, dense):
        row[:, : c.shape[1]] = c
    return StepPolynomials(np.array([d[0] for d in dense]), np.array([d[1] for d in dense]), coefficients)


def _scipy(model, t_span, start, p, options):
    from . import stiff_steps as stiff

    run = stiff.integrate_scipy(model, t_span, start, p, **options)
    # Where no wanted time was reached SciPy gives empty lists.
    run.t, run.y = np.asarray(run.t, float), np.asarray(run.y, float).reshape(len(start), -1)
    finite = bool(np.isfinite(run.y).all())
    if not finite:
        outcome = Outcome.NOT_FINITE
    elif run.ended:
        outcome = Outcome(run.ended)
    else:
        # SciPy tells one more failure apart from success: its step became too small.
        outcome = Outcome.FINISHED if run.success else Outcome.STEP_UNDERFLOW
    kept = np.isfinite(run.y).all(axis=0)
    if options["t_eval"] is None:
        kept[0] = True  # the start was checked
    t, y = run.t[kept], run.y[:, kept]
    when, where = run.last
    if outcome is not Outcome.FINISHED and np.isfinite(where).all() and (t.size == 0 or t[-1] < when):
        # Where and in which state it stopped, as the event-driven path gives it.
        t, y = np.append(t, when), np.column_stack([y, where])
    cost = {"steps": run.steps, "f_evals": int(run.nfev), "jac": int(run.njev), "lu": int(run.nlu)}
    dense = SciPyDense(run.sol) if options["dense"] else None
    return t, y, [], dense, outcome, cost, []
