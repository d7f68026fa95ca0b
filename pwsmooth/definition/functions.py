"""Systems made of functions: Python code in the place of formulas.

    dx/dt = f(t, x, lam, p),   lam_j = sign h_j(t, x, p) off the surface h_j = 0, in [-1, 1] on it

The Model has names and no formulas; the functions, as numba has compiled them, come with it. Of a surface the slopes
are taken by a complex step, Im h(x + i d)/d, exact to rounding (Squire and Trapp 1998), so that it has to be compiled
for complex numbers too.

Chain: primitives.py -> **functions** -> system.py; codegen/functions.py puts them in the place of generated ones.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from ..door import checks
from .model import EventSpec, Model, Multiplier
from .primitives import Event

_STEP = 1e-30  # of a complex step: far below what a slope can be lost in
_PROBES, _SEED = 16, 20  # points at which a surface is looked at


class Slot(NamedTuple):
    """An event's compiled functions, None for what it does not have."""

    surface: Any
    surface_complex: Any
    when: Any
    update: Any


@dataclass(frozen=True, eq=False)
class Functions:
    """The compiled functions of a system: equal to themselves alone, as their code is not looked at."""

    f: Any
    surfaces: tuple[tuple[Any, Any], ...]  # of every multiplier, for real and for complex numbers
    events: tuple[Slot, ...]


@dataclass(frozen=True)
class FunctionModel(Model):
    """A Model whose formulas are names: what it runs on is in `functions`."""

    functions: Any = field(default=None)

    __hash__ = Model.__hash__


class FunctionDefinition(NamedTuple):
    """What a System asks of its definition."""

    model: FunctionModel
    parameters: dict[sp.Symbol, float]
    memories: tuple = ()
    groups: dict = {}
    controls: tuple = ()

    @property
    def definition(self):
        return self

    def check_values(self, parameters):
        """Nothing: what values mean is in the code."""


def read_functions(f: Any, states: Any, surfaces: Any, parameters: Any, events: Any) -> FunctionDefinition:
    """The definition of the arguments of System.from_functions, with its functions compiled.

    Raises
    ------
    ValueError, TypeError
        No function, one that numba cannot compile, wrong lengths, names given twice, a surface without complex step.
    """
    names = states.split() if isinstance(states, str) else checks.several(states, "`states`")
    x = tuple(sp.Symbol(_name(s, "`states`"), real=True) for s in names)
    values = {
        sp.Symbol(_name(p, "`parameters`"), real=True): checks.number(value, f"`parameters` of {p}")
        for p, value in checks.mapping({} if parameters is None else parameters, "`parameters`").items()
    }
    if not hasattr(surfaces, "items"):
        given = checks.several(surfaces, "`surfaces`")
        surfaces = {f"lam{k}" if len(given) > 1 else "lam": h for k, h in enumerate(given, 1)}
    lams = tuple(sp.Symbol(_name(s, "`surfaces`"), real=True) for s in surfaces)
    time = sp.Symbol("t", real=True)
    every = [s.name for s in (time, *x, *values, *lams)]
    if twice := sorted({name for name in every if every.count(name) > 1}):
        raise ValueError(
            f"{', '.join(twice)} is given twice among `states`, `surfaces`, `parameters` and the time t; names have to "
            "differ."
        )
    if not x:
        raise ValueError("`states` is empty; give the names of the states, as in 'y v'.")
    door = _Door(len(x), len(lams), len(values))
    rates = door.vector(f, "`f`", "t, x, lam, p", len(x))
    compiled = [door.surface(h, f"`surfaces` of {s}") for s, h in surfaces.items()]
    slots, specs = [], []
    for k, event in enumerate(checks.all_of_kind("events", events, Event)):
        slot, spec = _event(event, event.name or f"event {k + 1}", door, x, tuple(values), time)
        slots.append(slot)
        specs.append(spec)

    def opaque(name: str) -> sp.Expr:
        return sp.Function(name)(time, *x, *lams)

    model = FunctionModel(
        time=time,
        states=x,
        parameters=tuple(values),
        rhs=tuple(opaque(f"f_{s}") for s in x),
        # Nothing is known of how they act: every residual is looked at as nonlinear in its multiplier.
        multipliers=tuple(
            Multiplier(s, "switch", opaque(f"g_{s}"), door.formula(h, x, opaque(f"h_{s}")), hidden=True)
            for s, (h, _) in zip(lams, compiled, strict=True)
        ),
        events=tuple(specs),
        eps_ratio=(1.0,) * len(lams),
        functions=Functions(rates, tuple(compiled), tuple(slots)),
    )
    return FunctionDefinition(model, values)


def check_start(model: FunctionModel, t: float, x: list[float], p: tuple[float, ...]) -> None:
    """ValueError where a function is not finite at the start, or f has not as many rates as there are states."""
    functions, state, values = model.functions, np.array(x), np.array(p)
    heights = []
    for mu, (h, _) in zip(model.multipliers, functions.surfaces, strict=True):
        heights.append(_called(h, f"the surface of {mu.symbol}", t, state, values))
        _finite(heights[-1], f"the surface of {mu.symbol}", t)
    for side in (1.0, -1.0):
        lam = np.array([np.sign(h) or side for h in heights])
        rates = np.asarray(_called(functions.f, "`f`", t, state, lam, values), float)
        if rates.shape != (len(model.states),):
            raise ValueError(
                f"`f` returns {rates.size} rates for {len(model.states)} states {checks.listing(model.states)}."
            )
        for s, rate in zip(model.states, rates, strict=True):
            _finite(rate, f"the rate of {s}", t)


def _called(function: Any, what: str, *arguments: Any) -> Any:
    try:
        return function(*arguments)
    except Exception as error:  # whatever its author raises
        raise ValueError(
            f"{what} raises {error!r} at the start, t = {arguments[0]:g}; mend it, or `x0`."
        ) from error


def _finite(value: float, what: str, t: float) -> None:
    if not np.isfinite(value):
        raise ValueError(f"{what} is {value} at the start, t = {t:g}; mend the function, or `x0`.")


def _name(value: Any, what: str) -> str:
    if isinstance(value, sp.Symbol):
        return value.name
    if not isinstance(value, str) or not value.isidentifier():
        raise TypeError(f"{what} names {checks.shown(value)}; give names, as 'v'.")
    return value


def _event(
    event: Event, name: str, door: _Door, states: tuple, parameters: tuple, time: sp.Symbol
) -> tuple[Slot, EventSpec]:
    given = {"surface": event.surface, "update": event.update, "when": event.when}
    for what, value in given.items():
        if not (value in (None, (), sp.true, sp.false) or checks.is_function(value)):
            raise TypeError(
                f"`{what}` of event {name!r} is a formula; a system of functions takes a function of (t, x, p)."
            )
    if event.together is not None:
        raise ValueError(
            f"`together` of event {name!r} has no meaning for a function, which gives all states; leave it out."
        )
    by_name = {p.name: p for p in parameters}
    clock = [e for e in (event.every, *event.at) if e is not None]
    known = [e.xreplace({s: by_name[s.name] for s in e.free_symbols if s.name in by_name}) for e in clock]
    if unknown := set().union(*(e.free_symbols for e in known)) - set(parameters):
        raise ValueError(f"the instants of event {name!r} depend on {checks.listing(unknown)}, no parameter.")
    surface = exact = None
    if event.surface is not None:
        surface, exact = door.surface(event.surface, f"`surface` of event {name!r}")
    when = update = None
    if checks.is_function(event.when):
        when = door.scalar(event.when, f"`when` of event {name!r}")
    if checks.is_function(event.update):
        update = door.vector(event.update, f"`update` of event {name!r}", "t, x, p", len(states))
    spec = EventSpec(
        name,
        None
        if surface is None
        else door.formula(surface, states, sp.Function(f"h_{name}".replace(" ", "_"))(time, *states)),
        known[0] if event.every is not None else None,
        tuple(known) if event.at else (),
        event.direction,
        event.when if event.when in (sp.true, sp.false) else sp.true,
        terminal=event.terminal,
    )
    return Slot(surface, exact, when, update), spec


class _Door:
    """Compiles functions of a system with n states, m multipliers and k parameters; looks at what they return."""

    def __init__(self, n: int, m: int, k: int):
        random = np.random.default_rng(_SEED)
        scales = 10.0 ** random.uniform(-2, 2, _PROBES)
        self.n, self.lam = n, np.zeros(m)
        self.points = [
            (s * random.uniform(), s * random.uniform(-1, 1, n), random.uniform(0.1, 2, k)) for s in scales
        ]

    def _compiled(self, function: Any, what: str, arguments: str, complex_: bool = False) -> Any:
        import numba
        from numba import types

        if not checks.is_function(function):
            raise TypeError(f"{what} is {checks.shown(function)}; give a function of ({arguments}).")
        plain = getattr(function, "py_func", function)  # of one that numba has compiled
        try:
            inspect.signature(plain).bind(*arguments.split(", "))
        except (TypeError, ValueError) as error:
            raise TypeError(f"{what} is no function of ({arguments}): {error}.") from None
        self._look_at_lengths(plain, what, arguments)
        number = types.complex128 if complex_ else types.float64
        kinds = {"t": number, "x": _read_only(number)}
        signature = tuple(kinds.get(a, _read_only(types.float64)) for a in arguments.split(", "))
        try:
            return numba.njit(signature, error_model="numpy")(plain)
        except Exception as error:  # whatever numba finds
            reason = "; ".join(line.strip() for line in str(error).splitlines() if line.strip())[:400]
            if complex_:
                raise TypeError(
                    f"{what} does not compile for complex numbers, by which its slopes are taken: write it with + - * "
                    f"/ and numpy's functions, without abs, comparisons and math. numba: {reason}"
                ) from error
            raise TypeError(f"{what} cannot be compiled by numba: {reason}") from error

    def _look_at_lengths(self, plain: Any, what: str, arguments: str) -> None:
        """One run in Python, which looks where compiled code would read beyond its arrays."""
        t, x, p = self.points[0]
        given = {"t": t, "x": x, "lam": self.lam, "p": p}
        lengths = ", ".join(f"{len(given[a])} in {a}" for a in arguments.split(", ")[1:])
        try:
            with np.errstate(all="ignore"):
                plain(*(given[a] if a == "t" else given[a].copy() for a in arguments.split(", ")))
        except Exception as error:
            # Whatever else there is numba or the start of a run will tell: 1/0 is an error in Python alone.
            if isinstance(error, IndexError) or "unpack" in str(error):
                raise ValueError(
                    f"{what} does not fit the lengths of its arguments, {lengths}, as `states`, `surfaces` and "
                    f"`parameters` have them: {error}."
                ) from error

    def vector(self, function: Any, what: str, arguments: str, n: int) -> Any:
        """A function that returns n numbers."""
        from numba import types

        compiled = self._compiled(function, what, arguments)
        kind = _result(compiled)
        numbers = (types.Integer, types.Float, types.Boolean)
        if isinstance(kind, types.BaseTuple):
            if len(kind) != n:
                raise ValueError(f"{what} returns {len(kind)} values for {n} states; give one for each.")
            if all(isinstance(part, numbers) for part in kind):
                return compiled
        elif isinstance(kind, types.Array) and kind.ndim == 1 and isinstance(kind.dtype, numbers):
            return compiled
        raise TypeError(f"{what} returns {kind}; give a tuple of {n} numbers, or an array of one dimension.")

    def scalar(self, function: Any, what: str, complex_: bool = False) -> Any:
        """A function of (t, x, p) that returns a number."""
        from numba import types

        compiled = self._compiled(function, what, "t, x, p", complex_)
        kind = _result(compiled)
        if complex_:
            if not isinstance(kind, types.Complex | types.Integer):
                raise TypeError(
                    f"{what} returns {kind} for complex numbers, by which its slopes are taken: leave out abs, real "
                    "and the like."
                )
        elif not isinstance(kind, types.Float | types.Integer | types.Boolean):
            raise TypeError(f"{what} returns {kind}; give a number.")
        return compiled

    def surface(self, function: Any, what: str) -> tuple[Any, Any]:
        """A surface for real and for complex numbers, the slopes of both compared."""
        real, exact = self.scalar(function, what), self.scalar(function, what, complex_=True)
        apart = seen = 0
        for t, x, p in self.points:
            way = np.cos(np.arange(self.n) + 1.0) * np.abs(x).max()
            d = 1e-6
            slope = complex(exact(complex(t), x + 1j * _STEP * way, p)).imag / _STEP
            plain = (real(t, x + d * way, p) - real(t, x - d * way, p)) / (2 * d)
            size = abs(slope) + abs(plain) + 1e-6 * abs(real(t, x, p))
            if np.isfinite(size):
                seen += 1
                apart += abs(slope - plain) > 1e-3 * size
        if apart > seen / 2:
            raise ValueError(
                f"{what} has other slopes by a complex step than by differences: it takes a real part, an absolute "
                "value or the like. Give a smooth function; kinks belong between surfaces."
            )
        return real, exact

    def formula(self, h: Any, states: tuple, otherwise: sp.Expr) -> sp.Expr:
        """The surface as a formula where it is a state, which is then kept on it exactly."""
        for i, s in enumerate(states):
            for sign in (1, -1):
                if all(h(t, x, p) == sign * x[i] for t, x, p in self.points):
                    return sign * s
        return otherwise


def _read_only(number: Any) -> Any:
    from numba import types

    return types.Array(number, 1, "C", readonly=True)


def _result(compiled: Any) -> Any:
    (signature,) = compiled.nopython_signatures
    return signature.return_type
