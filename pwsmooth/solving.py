"""solve(): the call is checked, and the first path that serves it runs.

    solve(system, t_span, x0, ...)  --checked()-->  Call  --path_for()-->  path.run(call)  -->  Solution

Chain: System -> paths/call.py (the door and what a path is) -> the paths -> **solve** -> Solution.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping, Sequence
from typing import Any

from .definition.families.recording import Recorder
from .door import checks
from .noise import diffusion_path
from .paths import backward, event_driven, functions, smoothed, stiff_events, stiffness
from .paths import local as local_events
from .paths.budget import MOST_STEPS
from .paths.call import Call, Inner, Path, checked, without_start
from .paths.event_driven import EventDriven, prepared_run
from .paths.locality import LOCAL_FROM, MANY
from .results.solution import Solution


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
    by: Sequence[Any] | None = None,
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
        left at their initial value. A Solution that ends where `t_span` begins is continued: what happens at that
        instant has happened.
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
    by : sequence of str or Symbol, optional
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
    call = checked(
        system, t_span, x0, method=method, rtol=rtol, atol=atol, t_eval=t_eval, dense_output=dense_output,
        max_step=max_step, max_steps=max_steps, max_seconds=max_seconds, order=order, strict=strict,
        parameters=parameters, noise=noise, by=by, local=local, record=record,
        threads=threads,
    )  # fmt: skip
    solution = path_for(call).run(call)
    solution.noise = noise
    if call.wanted is not None:
        from .paths.derivatives.of_solution import derivatives_of

        solution.derived = derivatives_of(call, solve)
    return solution


for _name, _number in (("few", LOCAL_FROM), ("many", MANY), ("look", stiffness.LOOK)):
    solve.__doc__ = (solve.__doc__ or "").replace(f"{{{_name}}}", str(_number))

#: Explicit steps from event to event: what no other path takes. Where stiffness holds them short, implicit ones follow.
EXPLICIT: tuple[Path, ...] = stiffness, event_driven
#: In the order in which they are asked.
PATHS: tuple[Path, ...] = functions, backward, diffusion_path, local_events, smoothed, stiff_events, *EXPLICIT


_MOST = 256  # models and ways of running them whose path is known
_known: dict[Any, Path] = {}


def path_for(call: Call) -> Path:
    """The first path that serves a call.

    Raises
    ------
    ValueError
        It asks its path for what that does not have.
    """
    model = call.system.model
    key = None
    if call.noise is None and call.wanted is None and call.record is None:
        key = model, call.options, call.local, call.span[0] < call.span[1], call.times is None
        if key in _known:
            return _known[key]
    for path in PATHS:
        if not path.why_not(model, call):
            if key is not None:
                if len(_known) >= _MOST:
                    _known.clear()
                _known[key] = path
            return path
    raise AssertionError("event_driven.py takes what no other path does.")


def call_with(system: Any, options: Mapping[str, Any]) -> Call:
    """A call with these options of `solve`, checked, of which the start and the span are still to come."""
    return without_start(system, **{**_HOW, **options})


def behind_the_door(system: Any, **options: Any) -> Inner:
    """The entrance for calls that solve often: what the options say is checked once, here.

    `options` are those of `solve` but `parameters` and `t_eval`.
    """
    return Inner(system, call_with(system, options), path_for)


# How a run is made, apart from its start and its span: the options of `solve` with their defaults.
_HOW = {
    name: option.default
    for name, option in inspect.signature(solve).parameters.items()
    if option.kind is option.KEYWORD_ONLY and name not in ("t_eval", "parameters")
}


def taped_run(
    system: Any, options: Mapping[str, Any], dense: bool = False, rows: bool = False
) -> EventDriven | None:
    """The event-driven run that solve() would make of these options, with a tape; None for any other."""
    if not options.keys() <= _OF_A_TAPE or system.model.families is not None:
        return None
    call = call_with(system, options)
    if path_for(call) not in EXPLICIT:
        return None
    run = prepared_run(system.model, call.options._replace(dense=dense, tape=True, rows=rows))
    return None if run.one_step else run


_OF_A_TAPE = {
    "method",
    "rtol",
    "atol",
    "dense_output",
    "max_step",
    "max_steps",
    "max_seconds",
    "order",
    "strict",
}
