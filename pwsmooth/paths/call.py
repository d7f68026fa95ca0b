"""A call of solve(), checked once: which system runs, from where, over which span, and how.

    system, t_span, x0, options -> `checked` -> Call -> the first path that serves it -> Solution

A path is one file with two functions, and what it refuses stands with it:

    why_not(model, call)    why this path leaves a call to the next one, in words; "" where it serves. A call that is
                            meant for this path and asks for what it does not have is refused there, with the remedy.
    run(call)               the Solution.

Chain: solve -> **call** -> the paths.
"""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..definition.families.recording import Recorder
from ..definition.model import Model
from ..door import checks
from ..results.solution import Solution
from .budget import MOST_STEPS, Budget
from .derivatives.quantities import Quantities, quantities


class Options(NamedTuple):
    """How a run is made, with numbers in the place of what stands for them."""

    method: str = "auto"
    rtol: float = 1e-9
    atol: Any = 1e-12  # a float for all states, or a tuple or array of one for each
    dense: bool = False
    max_step: float = math.inf
    max_steps: int = MOST_STEPS
    order: int | None = None
    strict: bool = False
    tape: bool = False
    rows: bool = False  # the steps' polynomials on the tape, which are then not made again

    def absolute(self, model: Model) -> np.ndarray:
        """Absolute tolerances of the states, shape (n,)."""
        n = len(model.states)
        return np.full(n, self.atol) if type(self.atol) is float else np.array(self.atol, float).reshape(n)


@dataclass(frozen=True, eq=False, init=False)
class Call:
    """What a path runs. Paths take it as it is: nothing in it has to be looked at again."""

    system: Any  # with its values of parameters
    options: Options
    seconds: float | None = None
    noise: Any = None
    wanted: Quantities | None = None  # by what is differentiated
    local: bool | None = None
    record: Recorder | None = None
    threads: int | None = None
    span: tuple[float, float] = (0.0, 1.0)
    start: Any = ()  # values in the order of the system's states
    continues: bool = False  # whether the start is the end of another run, at whose instants all has acted
    times: np.ndarray | None = None  # wanted ones
    within: Budget | None = None  # which it draws from, in the place of its own
    kept: Any = None  # what a path finds again in the next call through an inner entrance, by thread

    def __init__(self, **fields: Any) -> None:
        self.__dict__.update(fields)

    @property
    def random(self) -> Any:
        """The noise on this system, ready to run; None where nothing acts at random."""
        if self.noise is None:
            return None
        if "prepared" not in self.__dict__:
            self.__dict__["prepared"] = self.noise._prepared(self.system)
        return self.__dict__["prepared"]

    def budget(self) -> Budget:
        """Steps and seconds of one run."""
        return self.within or Budget(self.options.max_steps, self.seconds)

    def changed(self, **fields: Any) -> Call:
        """The same call with other fields, which have been looked at."""
        other = Call(**self.__dict__)
        other.__dict__.pop("prepared", None)
        other.__dict__.update(fields)
        return other


def is_smoothed(model: Model) -> bool:
    """Whether a model is a smoothed view: its switches have become layers."""
    return bool(model.smoothing) and not model.multipliers


class Scratch(dict[Any, Any]):
    """What a process keeps beside an object: it is neither copied nor pickled along with that."""

    def __deepcopy__(self, memo: Any) -> Scratch:
        return self

    def __reduce__(self) -> Any:
        return Scratch, ()


class Path(Protocol):
    """What each path is."""

    def why_not(self, model: Model, call: Call) -> str:
        """Why this path leaves a call to the next one; "" where it serves."""

    def run(self, call: Call) -> Solution:
        """The Solution of a call that this path serves."""


class Inner:
    """Runs of one model with options that were checked once, from start to start, at any values of its parameters."""

    def __init__(self, system: Any, call: Call, path_for: Callable[[Call], Path]) -> None:
        self.call, self.path_for = call.changed(kept=threading.local()), path_for
        self.paths: dict[tuple[bool, ...], Path] = {}
        self.has_levels = call.system is not system
        self.count = 0 if system._looks_at_starts else len(system.states)

    def __call__(
        self, system: Any, span: tuple[float, float], start: Any, times: Any = None, noise: Any = None
    ) -> Solution:
        """The Solution of a system with this model, from `start`, in the order of its states, at `times`, if wanted.

        Raises
        ------
        ValueError
            A span or values that no run has.
        """
        if not -math.inf < span[0] < span[1] < math.inf:
            span = checks.span(span, backward=True)
        if self.has_levels:
            system = system._without_levels()
        if len(start) != self.count or not math.isfinite(sum(start)):
            start = system.initial_state(start, span[0] if span[0] < span[1] else None)
        if times is not None:
            times = checks.wanted_times(times, *span)
        call = self.call.changed(system=system, span=span, start=start, times=times, noise=noise)
        key = span[0] < span[1], times is None
        path = self.paths.get(key) if noise is None else None  # whether noise acts depends on the parameters
        if path is None:
            path = self.path_for(call)
            if noise is None:
                self.paths[key] = path
        solution = path.run(call)
        solution.noise = noise
        return solution


def checked(system: Any, t_span: Any, x0: Any, *, t_eval: Any, parameters: Any, **how: Any) -> Call:
    """The call with these arguments, as `solve` takes them.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.
    """
    checks.system(system, "`system`", functions=True)
    if parameters is not None:
        system = system.with_parameters(parameters)
    call = without_start(system, **how)
    t0, t1 = span = checks.span(t_span, backward=True)
    # Backward the mirrored system asks for where drives and controls are.
    continues = isinstance(x0, Solution)
    if continues:
        x0 = _end_of(x0, call.system, t0)
    start = call.system.initial_state(x0, t0 if t0 < t1 else None)
    call.__dict__.update(span=span, start=start, times=checks.wanted_times(t_eval, t0, t1), continues=continues)
    return call


def _end_of(before: Solution, system: Any, t0: float) -> np.ndarray:
    """The state at which the run ended that this one continues."""
    end = float(before.t[-1]) if len(before.t) else math.nan
    if not abs(end - t0) <= 4 * np.spacing(abs(t0)):
        raise ValueError(
            f"`x0` is a Solution that ends at t = {end:g}, and `t_span` begins at {t0:g}; begin where it ends, or give "
            "a state, such as solution.x[:, -1]."
        )
    if before.x.shape[0] != len(system.model.states):
        raise ValueError(
            f"`x0` is a Solution with {before.x.shape[0]} states, but the system has {len(system.model.states)}; give "
            "the solution of a system with these states, or a state."
        )
    return before.x[:, -1]


def without_start(system: Any, *, atol: Any, noise: Any, by: Any, record: Any, **how: Any) -> Call:
    """A call of which is known how it runs, and not yet from where and over which span."""
    if type(atol) is not float or not 0 <= atol < math.inf:
        given = checks.absolute_tolerance(atol, system.model.states)
        atol = tuple(given.tolist()) if np.ndim(atol) else float(atol)
    try:
        known = _how(atol, **how)
    except TypeError:  # also of what has no hash
        known = None
    options, seconds, local, threads = known or _how.__wrapped__(atol, **how)
    if noise is not None and (isinstance(noise, type) or not hasattr(noise, "_prepared")):
        raise TypeError(
            f"`noise` is {checks.shown(noise)}; give Kicks(...), such as Kicks(1e-4, every=0.01, on=('y', 'v')), or "
            "Diffusion(...), such as Diffusion({v: 0.1}, step=0.01)."
        )
    if record is not None:
        checks.instance(Recorder, "Recorder(...)")(record, "`record`")
    wanted = None
    if by is not None:
        system = system._written_out()
        wanted = quantities(system, by)
    elif (options.dense or options.method == "stiff") and not (local or record):
        system = system._without_levels()
    return Call(
        system=system, options=options, seconds=seconds, noise=noise, wanted=wanted, local=local, record=record,
        threads=threads,
    )  # fmt: skip


@functools.lru_cache(maxsize=256, typed=True)  # typed: True is 1 to a dict, but not at the door
def _how(
    atol: Any, *, method: Any, rtol: Any, dense_output: Any, max_step: Any, max_steps: Any, max_seconds: Any,
    order: Any, strict: Any, local: Any, threads: Any,
) -> tuple[Options, float | None, bool | None, int | None]:  # fmt: skip
    """Options, seconds, `local` and threads: what is the same in most calls is looked at once."""
    options = Options(
        checks.name(method, "`method`"),
        checks.relative_tolerance(rtol),
        atol,
        checks.flag(dense_output, "`dense_output`"),
        checks.longest_step(max_step),
        checks.whole(max_steps, "`max_steps`", 1),
        checks.optional(checks.integer(8, 31))(order, "`order`"),
        checks.flag(strict, "`strict`"),
    )
    return (
        options,
        checks.optional(checks.positive)(max_seconds, "`max_seconds`"),
        checks.optional(checks.flag)(local, "`local`"),
        checks.optional(checks.integer(1))(threads, "`threads`"),
    )
