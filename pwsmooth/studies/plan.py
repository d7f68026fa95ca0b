"""A sweep, checked and frozen: what every worker needs, and what a store must agree with.

Chain: sweep() -> **Plan** -> chunks (chunk.py) -> store.py, Dataset.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..analysis.maps.poincare import RETURN
from ..analysis.maps.sections import section_of, watching
from ..analysis.maps.seen import Return, Strobe, how_seen
from ..definition.lambdified import numpy_function
from ..definition.model import EventSpec
from ..door import calls, checks
from ..kernels.sweeping.state import NO_RETURN
from ..noise.diffusion import Diffusion
from ..noise.kicks import Kicks
from ..paths import memory
from ..paths.call import Inner, Path, Scratch, is_smoothed
from ..results.records import Outcome
from ..solving import behind_the_door, call_with, path_for
from .axes import Axes, read_axes
from .contract import NOT_RUN, Measure, Setting, Variable, alphabet, integer, real
from .measures import Function, Period, Points, measure_from_text

# Outcomes of a point beyond those of a solve.
REFUSED, FUNCTION_FAILED = -101, -102
_ATOL = 1e-12  # solve's own
_PILOTS = 8  # points of which a worker holds the periods at once, at least


@dataclass(frozen=True)
class Plan:
    """Everything that the value of a point depends on; picklable. Numbers of single points come with a chunk."""

    system: Any
    start: tuple[float, ...]
    kinds: tuple[tuple[str, str], ...]
    t0: float
    span: float | None  # without a drive: length of the run
    measure_from: float | None
    seen: Strobe | Return | None  # of a Return the last event of the system is the section
    transient: int
    periods: int
    measures: tuple[Measure, ...]
    setting: Setting
    options: tuple[tuple[str, Any], ...]  # of solve
    noise: Any = None

    @property
    def path(self) -> Path:
        """What solve() runs a point by, without noise."""
        return path_for(_call(self.system, dict(self.options)))

    @property
    def has_polynomials(self) -> bool:
        """Whether a run has values between its steps: a diffusion has none."""
        return not isinstance(self.noise, Diffusion)

    @functools.cached_property
    def _solvers(self) -> Scratch:
        return Scratch()

    def solver(self, dense: bool) -> Inner:
        """What runs single points, behind the door."""
        if dense not in self._solvers:
            options = {name: option for name, option in self.options if option is not None}
            self._solvers[dense] = behind_the_door(self.system, dense_output=dense, **options)
        return self._solvers[dense]

    @functools.cached_property
    def variables(self) -> dict[str, Variable]:
        """Of the Dataset, by name; `outcome` comes last: it marks a point as done."""
        named: dict[str, Variable] = {}
        owner: dict[str, Measure] = {}
        for measure in self.measures:
            for name, variable in measure.variables(self.setting).items():
                known = owner.setdefault(name, measure)
                # extremes(y) and extremes(y, v) say the same of y; two functions do not.
                if known is not measure and (type(known) is not type(measure) or not measure.compiled):
                    raise ValueError(f"two measures give {name!r}; leave one out, or give a Function `names`.")
                named[name] = variable
        named["t_reached"] = real(self.setting, "where the run ended", self.setting.time_unit)
        said = "recorded ambiguities: points from which the solution is not unique"
        named["ambiguities"] = integer(np.int32, said)
        named["outcome"] = Variable((), (), np.int16, NOT_RUN, _flags())
        return named

    def empty(self, count: int) -> dict[str, np.ndarray]:
        """Every variable of so many points, not run yet."""
        return {name: np.full((count, *v.shape), v.fill, dtype=v.dtype) for name, v in self.variables.items()}

    def windows(self, columns: Mapping[str, np.ndarray], count: int) -> tuple[np.ndarray, ...]:
        """Start time, window start, window end and period of every point of a chunk; each (count,).

        With a section all but the first are nan: the orbit tells them.
        """
        t0 = np.full(count, self.t0)
        for name, kind in self.kinds:
            if kind == "time":
                t0 = np.array(columns[name], float)
        if isinstance(self.seen, Return):
            unknown = np.full(count, np.nan)
            return t0, unknown, unknown, unknown
        if self.seen is None:
            begin = np.broadcast_to(self.t0 if self.measure_from is None else self.measure_from, t0.shape)
            end = t0 + self.span
            return t0, np.maximum(begin, t0), end, end - np.maximum(begin, t0)
        symbols = tuple(self.system.parameters)
        values = [columns.get(s.name, self.system.parameters[s]) for s in symbols]
        period = np.broadcast_to(np.asarray(_numeric(self.seen.period, symbols)(*values), float), t0.shape)
        t0 = t0 + self.seen.phase * period
        begin = t0 + self.transient * period
        return t0, begin, begin + self.periods * period, period

    def identity(self, axes: Axes) -> dict[str, str]:
        """What a store must agree with, item by item in words: equal identities give equal bits."""
        from ..codegen.machine.cache import fingerprint
        from .identity import digest as told

        look = self.seen
        period = look.period if isinstance(look, Strobe) else None
        floats = sorted(map(sp.srepr, period.atoms(sp.Float))) if period else []
        own = ("pwsmooth.studies.", "pwsmooth.analysis.")
        coded = [m for m in self.measures if isinstance(m, Function) or not type(m).__module__.startswith(own)]
        items = {
            "system": fingerprint(self.system.model),
            "parameters": _listed({str(p): v for p, v in self.system.parameters.items()}),
            "x0": _listed(dict(zip(self.setting.states, self.start))),
            "time": _listed(dict(t0=self.t0, span=self.span, measure_from=self.measure_from)),
            "period": str(period) + (f" with {', '.join(floats)}" if floats else ""),
            "transient and periods": f"{self.transient}, {self.periods}",
            "tolerances and method": _listed(dict(self.options)),
            "noise": repr(self.noise) + (f" {told(self.noise)}" if self.noise else ""),
            "measures": "; ".join(_described(m) for m in self.measures) + (f"; {told(coded)}" if coded else ""),
        }
        if isinstance(look, Strobe) and look.phase:
            items["phase"] = repr(look.phase)
        if isinstance(look, Return):
            event = self.system.model.events[-1]
            way = "rising" if event.direction > 0 else "falling"
            items["section"] = f"{event.surface} = 0 {way}, within {look.longest!r}"
        for name, (dim, values) in axes.values.items():
            digest = hashlib.sha256(values.tobytes()).hexdigest()[:12]
            items[f"axis {name}"] = (
                f"{len(values)} values from {values[0]:.9g} to {values[-1]:.9g} along {dim}, {digest}"
            )
        return items


def _listed(items):
    return ", ".join(f"{key} = {value!r}" for key, value in items.items())


def _described(measure: Measure) -> str:
    if not isinstance(measure, Function):
        return repr(measure)
    function = measure.function
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        code = getattr(function, "__code__", None)
        text = repr(code and (code.co_code, code.co_consts, code.co_names))
    name = f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', repr(function))}"
    return f"Function({name}, {measure.names}, {hashlib.sha256(text.encode()).hexdigest()[:12]})"


@functools.lru_cache(maxsize=64)
def _numeric(expression: sp.Expr, symbols: tuple[sp.Symbol, ...]) -> Any:
    return numpy_function(symbols, expression)


def _flags() -> dict[str, Any]:
    meanings = {o.value: o.name.lower() for o in Outcome}
    meanings |= {
        REFUSED: "refused_at_the_door", FUNCTION_FAILED: "function_failed", NO_RETURN: "no_return_to_the_section",
        NOT_RUN: "not_run",
    }  # fmt: skip
    return {
        "long_name": "how the run ended; >= 0 is success",
        "flag_values": list(meanings),
        "flag_meanings": " ".join(meanings.values()),
    }


def why_not(outcome: int) -> str:
    """Why a point has no values, from its outcome; empty if it has."""
    texts = {int(o): str(o) for o in Outcome} | {
        int(Outcome.FINISHED): "",
        REFUSED: "refused: the system does not take this value of the parameter or start.",
        NO_RETURN: "no return: it does not cross the section in this direction within `longest`; it may rest.",
    }
    return texts[outcome]


def read_plan(
    system: Any, axes: Any, points: Any, x0: Any, measures: Any, t_span: Any, measure_from: Any, seen: Any,
    transient: Any, periods: Any, units: Any, noise: Any, options: Mapping[str, Any],
) -> tuple[Plan, Axes]:  # fmt: skip
    """The checked plan and axes; `system` is a System or a scene."""
    if hasattr(system, "system") and hasattr(system, "x0"):
        scene, system = system, system.system
        x0 = checks.optional(checks.mapping)(x0, "`x0`")
        x0 = {**scene.x0, **{str(k): v for k, v in (x0 or {}).items()}}
        units = {**getattr(scene, "units", {}), **check_units(system, units)}
        if getattr(scene, "atol", None) and "atol" not in options:
            options = {**options, "atol": [scene.atol.get(str(s), _ATOL) for s in system.states]}
        if seen is None and t_span is None:
            seen, t_span = (Strobe(scene.period), None) if scene.period else (None, scene.t_span)
    else:
        checks.system(system, "`system`")
        units = check_units(system, units)
    if options.get("record") is None:
        system = system._without_levels()
    checks.optional(checks.instance((Kicks, Diffusion), "Kicks(...) or Diffusion(...)"))(noise, "`noise`")
    checks.optional(how_seen)(seen, "`seen`")
    if isinstance(seen, Return):
        if noise is not None:
            raise ValueError("`seen` counts the returns of a flow without `noise`; leave `noise` out.")
        surface = section_of(system, seen.section, "`section`")
        system = watching(system, EventSpec(RETURN, surface, direction=seen.direction))
    where = read_axes(system, axes, points)
    first = where.columns(0, 1)
    if x0 is not None and not isinstance(x0, Mapping):
        x0 = dict(zip(system.states, system.initial_state(x0), strict=True))
    given = {str(k): v for k, v in (x0 or {}).items()}
    swept = {name for name, kind in where.kinds.items() if kind == "state"}
    begin = checks.span(t_span)[0] if seen is None and t_span is not None else 0.0
    initial = system.initial_state(given | {name: float(first[name][0]) for name in swept}, begin)
    for name, kind in where.kinds.items():
        if kind == "noise" and not hasattr(noise, name):
            raise ValueError(f"an axis {name!r} needs `noise=` with a {name}, such as Kicks(..., {name}=0).")
    if (seen is None) == (t_span is None):
        raise ValueError(
            "give `seen` or `t_span`, not both." if seen is not None else "give `seen`, Strobe(period) of a driven "
            "system or Return(section) of an autonomous one, or `t_span`, how long a run lasts."
        )  # fmt: skip
    if t_span is None:
        if measure_from is not None:
            raise ValueError(
                "`measure_from` belongs to `t_span`; with `seen` measuring begins after `transient`."
            )
        transient = checks.whole(transient, "`transient`", 0)
        periods = checks.whole(periods, "`periods`", 1)
        if not memory.fits(_PILOTS * 8 * (periods + 1) * len(system.states)):
            raise ValueError(f"`periods` is {periods}; that many points do not fit into memory. Give fewer.")
        t0, span = 0.0, None
    if isinstance(seen, Strobe):
        at = {p.name: p for p in system.parameters}
        lowest = {at[name]: values.min() for name, (_, values) in where.values.items() if name in at}
        if seen.phase and "time" in where.kinds.values():
            raise ValueError("`seen` has a phase, and the start time is swept; leave one of them out.")
        seen = Strobe(checks.period(seen.period, system.parameters | lowest), seen.phase)
    elif t_span is not None:
        t0, t1 = checks.span(t_span)
        span, transient, periods = t1 - t0, 0, 1
        if measure_from is not None:
            measure_from = checks.number(measure_from, "`measure_from`")
            if not t0 <= measure_from < t1:
                raise ValueError(f"`measure_from` is {measure_from:g}; give a time in [{t0:g}, {t1:g}).")
    chosen = tuple(_measure(m) for m in _listing(measures))
    if more := {name: e for measure in chosen for name, e in measure.outputs.items()}:
        system = system._extended({}, more)
    strobed_by = "" if seen is None else "period" if isinstance(seen, Strobe) else "return"
    setting = _setting(system, chosen, periods, strobed_by, tuple(sorted(units.items())))
    plan = Plan(
        system=system, start=tuple(initial), kinds=tuple(where.kinds.items()), t0=t0, span=span,
        measure_from=measure_from, seen=seen, transient=transient, periods=periods, measures=chosen,
        setting=setting, options=_options(system, options), noise=noise,
    )  # fmt: skip
    if dict(plan.options).get("record") is not None and any(
        not isinstance(m, Function) or m.dense for m in chosen
    ):
        raise ValueError(
            "`measures`: with `record` a run keeps its events and no steps; give functions of the Solution, which has "
            "`catalogue` and `recorded`."
        )
    if noise is not None:
        _check_noise(plan, first)
    clash = [name for name in plan.variables if name in where.values or name in where.dims]
    if clash:
        raise ValueError(f"the measure {clash[0]!r} has the name of an axis; rename the axis' symbol.")
    return plan, where


def _check_noise(plan: Plan, columns: Mapping[str, np.ndarray]) -> None:
    """Refuse, at the first point, noise that the system does not take or that the measures cannot see."""
    lacking = [m for m in plan.measures if not m.compiled and getattr(m, "dense", False)]
    if lacking and not plan.has_polynomials:
        raise ValueError(
            f"`measures` has {_described(lacking[0])}, which needs values between steps, and a diffusion has none; "
            "leave it out, or give a function of the Solution with dense=False."
        )
    call = plan.solver(False).call
    t0, _, end, _ = (float(times[0]) for times in plan.windows(columns, 1))
    call = call.changed(system=plan.system, span=(t0, end), start=plan.start, noise=plan.noise)
    path_for(call)
    if not plan.has_polynomials and hasattr(call.random, "interval"):
        what = "`t_span`" if plan.seen is None else "the end of the last period"
        if call.random.interval(t0, what) == call.random.interval(end, what):
            raise ValueError(f"{what} is {end:g}, within one `step` of the diffusion; give a shorter `step`.")


def _listing(measures):
    if isinstance(measures, (str, Measure)) or callable(measures):
        return (measures,)
    return checks.several(measures, "`measures`")


def _measure(item):
    if isinstance(item, Measure):
        return item
    if isinstance(item, str):
        try:
            return measure_from_text(item)
        except ValueError as error:
            raise ValueError(f"`measures`: {error}") from None
    if isinstance(item, type) and issubclass(item, Measure):
        return item()
    if callable(item):
        return Function(item)
    raise TypeError(
        f"`measures` contains {checks.shown(item)}; give names such as 'sticks', Measures, or functions of a Solution."
    )


def check_units(system, units):
    """`units` as a dict of text; ValueError for a name that the system, or what it is a view of, does not have."""
    given = checks.mapping({} if units is None else units, "`units`", "names to units, such as {'k': 'N/m'}")
    known = {str(system.model.time or "t"): None}
    while system is not None:
        model = system.model
        symbols = (*model.states, *system.parameters, *(mu.symbol for mu in model.multipliers))
        known |= dict.fromkeys([*map(str, symbols), *(str(name) for name, _ in model.outputs), *system.groups])
        system = system._view.original if system._view else None
    for name in map(str, given):
        if name not in known:
            near = calls.closest(name, known)
            remedy = f"did you mean {near!r}?" if near else f"they are {', '.join(known)}."
            raise ValueError(f"`units` names {name!r}, which is no parameter, state, output or time; {remedy}")
    return {str(key): str(unit) for key, unit in given.items()}


def _setting(system, measures, periods, strobed_by, units):
    model = system.model
    names = [str(mu.symbol) for mu in model.multipliers]
    sticking = tuple(
        j for j, mu in enumerate(model.multipliers)
        if mu.kind == "contact" or mu.second is not None
        or (mu.kind in ("switch", "disc") and mu.regularity == "sliding")
    )  # fmt: skip
    words = tuple(j for j, mu in enumerate(model.multipliers) if mu.kind not in ("algebraic", "component"))
    states = tuple(str(s) for s in model.states)
    quantities: dict[str, int] = {}
    outputs = [str(name) for name, _ in model.outputs]
    for measure in measures:
        for name in measure.quantities:
            if name not in (*states, *names, *outputs):
                raise ValueError(
                    f"`measures` names {name!r}, which is no state, multiplier or output of this system; they are "
                    f"{', '.join((*states, *names, *outputs))}." + calls.hint(name, (*states, *names, *outputs))
                )
            quantities[name] = quantities.get(name, 0) | measure.bits
        lacking = [n for n in measure.names if n not in states] if isinstance(measure, Points) else []
        if lacking:
            raise ValueError(
                f"`measures`: Points names {lacking[0]!r}, which is no state; they are {', '.join(states)}."
            )
    kinds = {type(m).__name__ for m in measures}
    if is_smoothed(model) and kinds & {"Sticks", "Itinerary"}:
        raise ValueError(
            "a smoothed view has no sticks to count, as its switches never stand still; sweep the system itself, or "
            "measure with a function of the Solution."
        )
    if "Sticks" in kinds and not sticking:
        raise ValueError(
            "`measures` asks for sticks, but nothing in this system can stick (slide); leave it out."
        )
    if "Itinerary" in kinds and not 0 < len(words) <= 36:
        raise ValueError(
            f"`measures` asks for the itinerary, a word of 1 to 36 multipliers; this system has {len(words)}. Leave it "
            "out."
        )
    detector = next((m for m in measures if isinstance(m, Period)), Period())
    return Setting(
        states, tuple(names[j] for j in sticking), sticking, words, tuple(alphabet(model, j) for j in words),
        tuple(quantities), tuple(quantities.values()), periods, strobed_by, detector, units, str(model.time or "t"),
    )  # fmt: skip


def _call(system, options):
    """The call of a point: all elements of a family together, unless there is a record of them."""
    return call_with(system, options if options.get("record") else {**options, "local": False})


def _options(system, options):
    """Options of solve for every point, as the path that runs them takes them."""
    call = _call(system, options)
    path_for(call)
    checked: dict[str, Any] = {name: getattr(call.options, name) for name in (*calls.STEPS, "method")}
    checked["atol"] = tuple(call.options.absolute(system.model).tolist())
    if call.record is not None:
        if call.record.events is not None:
            raise ValueError(
                f"`record` of a sweep has `events` {str(call.record.events)!r}, over which all points would write; "
                "leave it out."
            )
        checked["record"] = call.record
    return tuple(sorted(checked.items()))
