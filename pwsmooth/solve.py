"""solve(): checks at the door and the choice of path.

Event-driven for systems that switch (paths/event_driven.py), the stiff path for smoothed views (paths/smoothed.py).
Chain: System -> Model -> codegen -> kernels -> the two paths -> **solve** -> Solution.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .definition.families.recording import Recorder
from .door import checks
from .paths.budget import MOST_STEPS, Budget, opened
from .paths.event_driven import LOOSEST, EventDriven, Options, prepared_run
from .paths.local import run_locally
from .paths.locality import LOCAL_FROM, MANY, runs_locally
from .paths.parts import threads_for
from .paths.stiffness import LOOK, instead, look_after, passes_only
from .results.solution import Outcome, Solution


@checks.door()
def solve(
    system: Any,
    t_span: Sequence[float],
    x0: Mapping[Any, float] | Sequence[float],
    *,
    method: str = "auto",
    rtol: float = 1e-9,
    atol: float | Sequence[float] = 1e-12,
    t_eval: Any = None,
    dense_output: bool = False,
    max_step: float = math.inf,
    max_steps: int = MOST_STEPS,
    max_seconds: float | None = None,
    order: int | None = None,
    strict: bool = False,
    parameters: Mapping[Any, float] | None = None,
    noise: Any = None,
    with_respect_to: Sequence[Any] | None = None,
    local: bool | None = None,
    record: Recorder | None = None,
    threads: int | None = None,
) -> Solution:
    """Solve a piecewise-smooth system from `x0` over `t_span`.

    A system with switches, contacts or algebraic unknowns runs event-driven: slipping, the fast transition and
    sliding, with every event located on the step's polynomial. A smoothed view runs on the stiff path.

    Parameters
    ----------
    system : System
        A system or one of its views (`smoothed`, `layered`).
    t_span : (float, float), in the unit of the model's time
        Start and end. Where they decrease the run goes back in time, through crossings, impacts and events whose
        updates have an inverse, and the solution, in the order of time, ends in `x0`; where the past is not unique it
        begins with the outcome IRREVERSIBLE.
    x0 : mapping of state to float, or sequence of float, length n
        Initial value of every state by name or Symbol, or positionally, in the units of the states; memories may be
        left at their initial value.
    method : str
        "auto"; event-driven: "taylor", "rk" (Dormand-Prince 8(5,3), the plain alternative), and "stiff" (implicit
        steps, for bristle laws and the like, whose switches are passed and never slid on). "auto" is "taylor", and
        "stiff" where {look} steps (of more than ten states fewer) did not reach the end, no switch can slide, and
        implicit steps need a tenth as many; the solution's `tolerances` say which. Smoothed: "radau5",
        "radau9", "radau13", "taylor", and SciPy's "Radau", "BDF", "LSODA", "DOP853" as an independent cross-check.
    rtol : float, dimensionless
        Relative tolerance; looser than 1e-6 (event-driven) or 1e-3 (smoothed) runs at that bound, and so does
        "rk" below 1e-13.
    atol : float or sequence of float, length n
        Absolute tolerance, in the unit of each state.
    t_eval : array_like, shape (nt,), in the unit of the model's time, optional
        Times at which the solution is returned, instead of the steps' own; at an event the side after it. A run
        that stops before the last of them ends with the state where it stopped.
    dense_output : bool
        Keep the steps' polynomials, so that `solution(t)` works.
    max_step : float, in units of time
        Bound on the step. Methods that look at the field in points (all but Taylor steps) need one where it has
        pulses much narrower than their steps, which they would step over.
    max_steps : int
        Bound on the number of steps; reaching it is an outcome with the partial solution.
    max_seconds : float, in units of wall time, s, optional
        Bound on the time of the run, without that of compiling; reaching it is the outcome TIME_LIMIT.
    order : int, optional
        Order of the Taylor polynomials (8 to 31), by default chosen by `rtol`.
    strict : bool
        Stop at the first ambiguity instead of following the recorded continuation.
    parameters : mapping of Symbol to float, optional
        Values that replace the system's own for this run, in its units.
    noise : Kicks or Diffusion, optional
        Random kicks at regular times, or white noise. A diffusion has steps of its own:
        tolerances do not act on it.
    with_respect_to : sequence of str or Symbol, optional
        Quantities by which the solution is differentiated, through every event: parameters, states and memories (their
        initial values), and "t0", the start of the span. The solution's `derivatives` has the results.
    local : bool, optional
        Whether an event of a `Family` renews only the elements that it reaches, at a cost that does not depend on their
        number, or all of them. By default it does where the structure allows it (`System.describe` says), of
        {few} elements and more with `t_eval`, and of more than {many} elements without: then the solution has
        the start and the end alone.
    record : Recorder, optional
        Of a run with local events: which elements are kept, where the events go, a checkpoint.
    threads : int, optional
        Threads of a run with local events of some thousand elements and more that has independent parts (at most two
        are of use); the results have the same bits with any number. By default as many as there are cores, one inside
        of a longer call such as a sweep, whose own threads are busy.

    Returns
    -------
    Solution
        Up to the end of the span, or to where `outcome` says that the run stopped.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy. A numerical failure is an Outcome, not an exception.

    Source: Filippov 1988 for sliding; Jeffrey, On the mathematical basis of solid friction, for the layer that decides
    between crossing and sticking, and for folds.

    >>> t, x = sp.symbols("t x", real=True)
    >>> relay = System({x: 1 - 2 * sp.sign(x - 2)}, time=t)
    >>> solve(relay, (0, 5), {x: 0}).itinerary
    ('sgn(x - 2)=-1', 'sgn(x - 2) sliding')
    """
    checks.system(system, "`system`", functions=True)
    method = checks.name(method, "`method`")
    if parameters is not None:
        system = system.with_parameters(parameters)
    t0, t1 = checks.span(t_span, backward=True)
    if system.model.functions:
        asked = {
            f"`method` is {method!r}": method not in ("auto", "rk"),
            "`noise` is given": noise is not None,
            "`with_respect_to` is given": with_respect_to is not None,
            "`t_span` decreases": t0 > t1,
        }
        if refused := [what for what, so in asked.items() if so]:
            raise ValueError(
                f"{refused[0]} for a system of functions, which runs forward on the pair, method 'rk', without noise "
                "and derivatives; leave it out, or write the model in symbols."
            )
    if with_respect_to is not None:
        from .paths.derivatives.of_solution import Derivatives, quantities, run_beside

        system = given = system._written_out()
        wanted = quantities(system, with_respect_to)
    if t0 > t1:
        several = noise is not None or dense_output or method == "stiff" or with_respect_to is not None
        if several or local or record is not None:
            raise ValueError(
                "`t_span` decreases: backward in time there is no `noise`, no `dense_output`, no `with_respect_to`, no "
                "method 'stiff', no `record`, and nothing is `local`; give `t_eval` for wanted times."
            )
        from .paths.backward import solve_backward

        def run(mirrored, span, times):
            return solve(
                mirrored, span, x0, method=method, rtol=rtol, atol=atol, t_eval=times, max_step=max_step,
                max_steps=max_steps, max_seconds=max_seconds, order=order, strict=strict,
            )  # fmt: skip

        mirrored, ends = system._backward()
        return solve_backward(system, mirrored, ends, run, (-t0, -t1), t_eval)
    if (dense_output or with_respect_to is not None or method == "stiff") and not (local or record):
        system = system._without_levels()
    kicks: Any = None  # a KickedRun or a DiffusionRun
    if noise is not None:
        from .noise.prepared import prepared

        kicks = prepared(system, noise, method)
        system = kicks.system if kicks else system
    model = system.model
    start = system.initial_state(x0, t0)
    if with_respect_to is not None:
        same = dict(
            method=method,
            rtol=rtol,
            atol=atol,
            max_step=max_step,
            max_steps=max_steps,
            order=order,
            noise=noise,
        )
        beside = functools.partial(run_beside, solve, given, (t0, t1), start, same, wanted)
        derived = functools.partial(Derivatives, wanted=wanted, again=beside, kept={})
    times = checks.wanted_times(t_eval, t0, t1)
    diffuses, smoothed = hasattr(kicks, "solve"), bool(model.smoothing) and not model.multipliers
    stiff = method == "stiff" and not smoothed
    threads = checks.optional(checks.integer(1))(threads, "`threads`")
    spending = opened(max_steps, max_seconds)
    if local and (diffuses or smoothed or stiff):
        what = "a diffusion" if diffuses else "a smoothed view" if smoothed else "method='stiff'"
        raise ValueError(f"`local` is True, but {what} is a run of the whole system; leave it out.")
    if not (diffuses or smoothed or stiff):
        rows = with_respect_to is not None
        taped = rows or (dense_output and model.families is None)
        options = Options(method, rtol, atol, dense_output, max_step, max_steps, order, strict, taped, rows)
        record = checks.optional(checks.instance(Recorder, "Recorder(...)"))(record, "`record`")
        present = (record is not None, kicks is not None, with_respect_to is not None)
        if runs_locally(model, options, times, local, *present):
            threads = threads_for(threads, spending.outer is not None)
            return run_locally(system, t0, t1, start, times, options, record, threads, spending)
        if record is not None:
            raise ValueError("`record` is given, but the run is not one of local events; leave it out.")
        p = np.array(system.parameter_values, float)
        ready = prepared_run(model, options)
        if with_respect_to is not None and not ready.by_series:
            ready = prepared_run(model, options._replace(dense=True))

        def explicit(within: Budget) -> Solution:
            return ready.solve(system, p, t0, t1, start, times, within, kicks)

        chooses = method == "auto" and kicks is None and not rows and order is None and not strict
        if chooses and max_steps > (look := look_after(model)) and passes_only(model):
            solution = explicit(spending.part(look))
            if solution.outcome == Outcome.TOO_MANY_STEPS:
                from .paths.stiff_events import solve_stiff

                tight = min(checks.relative_tolerance(rtol), LOOSEST)
                absolute, longest = checks.absolute_tolerance(atol, model.states), checks.longest_step(max_step)

                def implicit(span: tuple[float, float], within: Budget) -> Solution:
                    at = times if span[1] == t1 else None
                    return solve_stiff(
                        system, span, np.array(start), p, tight, absolute, at, options.dense, longest, within
                    )

                if times is not None:  # the steps' own are looked at
                    solution = ready.solve(system, p, t0, t1, start, None, spending.part(look))
                solution = instead(solution, explicit, implicit, t1, spending)
        else:
            solution = explicit(spending)
        solution.noise = noise
        if with_respect_to is not None:
            solution.derived = derived
        return solution
    if with_respect_to is not None:
        from .paths.stiff_steps import SCIPY_METHODS

        if diffuses or method in SCIPY_METHODS:
            raise ValueError(
                "`with_respect_to` is given for a diffusion or one of SciPy's methods, which have no derivatives; "
                "leave `noise`, or `method`, out."
            )
    initial, p = np.array(start), np.array(system.parameter_values, float)
    rtol, absolute = checks.relative_tolerance(rtol), checks.absolute_tolerance(atol, model.states)
    max_step = checks.longest_step(max_step)
    strict, dense = checks.flag(strict, "`strict`"), checks.flag(dense_output, "`dense_output`")
    dense = dense or with_respect_to is not None  # derivatives go along the steps' polynomials
    if diffuses:
        return kicks.solve((t0, t1), initial, times, strict, spending, max_step, dense, order)
    if order is not None or strict:
        raise ValueError(
            "`order` and `strict` belong to Taylor steps and the pair; leave them out for a smoothed view and with "
            "method='stiff'."
        )
    if stiff:
        from .paths.stiff_events import solve_stiff

        if kicks is not None:
            raise ValueError("`noise` is given with method='stiff', which knows none; leave `method` out.")
        solution = solve_stiff(
            system, (t0, t1), initial, p, min(rtol, LOOSEST), absolute, times, dense, max_step, spending
        )
    else:
        from .paths.smoothed import solve_smoothed

        solution = solve_smoothed(
            system, (t0, t1), initial, p, system.parameters, method, rtol, absolute, times, dense, max_step,
            spending, kicks,
        )  # fmt: skip
        if times is not None:
            ends = [t0, *([t1] if solution.outcome is Outcome.FINISHED else solution.t[-1:])]
            solution.course = np.array(ends), np.zeros((0, len(ends)), np.int8)
        solution.noise = noise
    if with_respect_to is not None:
        solution.derived = derived
    return solution


for _name, _number in (("few", LOCAL_FROM), ("many", MANY), ("look", LOOK)):
    solve.__doc__ = (solve.__doc__ or "").replace(f"{{{_name}}}", str(_number))


def taped_run(
    system: Any, options: Mapping[str, Any], dense: bool = False, rows: bool = False
) -> EventDriven | None:
    """The event-driven run that solve() would make of these options, with a tape; None for any other."""
    model, known = system.model, {name: option.default for name, option in _OPTIONS.items()}
    given = {name: value for name, value in {**known, **options}.items() if name in Options._fields}
    if not options.keys() <= {*given, "max_seconds", "dense_output"}:
        return None
    if given["method"] not in ("auto", "taylor") or model.families is not None:
        return None
    if model.smoothing and not model.multipliers:
        return None
    run = prepared_run(model, Options(**given, dense=dense, tape=True, rows=rows))
    return None if run.one_step else run


_OPTIONS = inspect.signature(solve).parameters
