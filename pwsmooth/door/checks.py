"""Checks at the door: each takes a value and what it is called, gives what the call goes on with, or says the remedy.

    positive(value, "`mass`") -> a finite float > 0, or TypeError/ValueError with the argument, its value, the remedy

`door` passes the arguments of a function through such checks, `fields` those of a dataclass.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib.util
import inspect
import math
import operator
import os
import reprlib
import types
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
import sympy as sp
from sympy.core.function import AppliedUndef

from . import calls, formula
from .documenting import complete

_PREDICATES = {  # of a number, or of an array of them
    "positive": lambda v: v > 0,
    "negative": lambda v: v < 0,
    "nonnegative": lambda v: v >= 0,
    "nonpositive": lambda v: v <= 0,
    "nonzero": lambda v: v != 0,
    "zero": lambda v: v == 0,
    "integer": lambda v: v % 1 == 0,
    "noninteger": lambda v: v % 1 != 0,
    "even": lambda v: v % 2 == 0,
    "odd": lambda v: v % 2 == 1,
    "real": lambda v: True,
    "imaginary": lambda v: False,
}


ASSUMPTIONS = tuple(sp.Symbol("x", zero=True).assumptions0)  # all names that sympy knows of a number
P = ParamSpec("P")
R = TypeVar("R")
F = TypeVar("F")
Check = Callable[[Any, str], Any]
_HUGE = 2**1023  # near the largest float


def door(options: Iterable[str] | None = None, /, **tests: Check) -> Callable[[F], F]:
    """Decorator of what a user calls: a misspelt, missing or surplus argument is refused in words, before all else.

    Each argument that is named here and given passes its test. `options` are the names that a function with
    ``**options`` passes on; "parameters" among them become those of its `system`. Of a class the constructor and every
    public method are such calls. What many docstrings share is put in (documenting.py).
    """

    def decorate(target: Any) -> Any:
        complete(target)
        if isinstance(target, type):
            return _with_doors(target)
        return _checked(target, options, tests) if tests or options else _called(target)

    return decorate


def _called(function):
    """The function, whose calls that do not fit its signature are refused in words; any other costs a frame."""

    @functools.wraps(function)
    def called(*args, **kwargs):
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            inside = error.__traceback__ and error.__traceback__.tb_next
            if inside is None and (misfit := calls.misfit(function, args, kwargs)):
                raise misfit from None
            raise

    return _marked(called)


def _checked(function, options, tests):
    """The function behind the tests of its arguments."""
    signature = inspect.signature(function)
    names = signature.parameters
    spread = next((p.name for p in names.values() if p.kind is p.VAR_KEYWORD), None)
    known = None if spread is None or options is None else frozenset((*names, *options)) - {spread}
    pinned = known is not None and "system" in names and "parameters" in known and "parameters" not in names

    @functools.wraps(function)
    def checked(*args, **kwargs):
        try:
            given = signature.bind(*args, **kwargs)
        except TypeError as error:
            raise calls.misfit(function, args, kwargs, known) or error from None
        if known is not None and (unknown := kwargs.keys() - known):
            raise calls.misfit(function, args, kwargs, known) or TypeError(f"no such arguments: {unknown}")
        arguments = given.arguments
        for name, test in tests.items():
            if name in arguments:
                arguments[name] = test(arguments[name], f"`{name}`")
        if pinned and spread and "parameters" in kwargs:
            values = arguments[spread].pop("parameters")
            if values is not None:
                arguments["system"] = _with_parameters(arguments["system"], values)
        return function(*given.args, **given.kwargs)

    return _marked(checked, tests)


def _marked(call: Any, tests: Mapping[str, Check] | None = None) -> Any:
    """The call, known as a door, with the tests of its arguments."""
    call.is_door, call.tests = True, tests or {}
    return call


def _with_parameters(subject, values):
    """A system, or the scene of one, with other values of parameters."""
    if hasattr(subject, "system") and hasattr(subject, "x0"):
        return dataclasses.replace(subject, system=_with_parameters(subject.system, values))
    return system(subject, "`system`").with_parameters(values)


def _with_doors(cls):
    """The class, with doors at its constructor and its public methods, those of its private bases too."""
    constructor = "__init__" if "__init__" in vars(cls) else "__new__"
    fields = getattr(cls, "__dataclass_fields__", ())  # a function as the default of one is no method
    for owner in cls.__mro__:
        if owner is not cls and not owner.__name__.startswith("_"):
            continue
        for name, value in list(vars(owner).items()):
            if name in fields or (name.startswith("_") and name not in (constructor, "__call__")):
                continue
            kind = type(value) if isinstance(value, (classmethod, staticmethod)) else None
            function = value.__func__ if kind else value
            if isinstance(function, types.FunctionType) and not hasattr(function, "is_door"):
                setattr(owner, name, kind(_called(function)) if kind else _called(function))
    return cls


def closed_form(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator of a formula in plain floats: numbers that leave their range together are bad input too."""
    names = tuple(inspect.signature(function).parameters)

    @functools.wraps(function)
    def computed(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except (OverflowError, ZeroDivisionError):
            given = {**dict(zip(names, args)), **kwargs}
            said = ", ".join(f"`{name}` {shown(value)}" for name, value in given.items())
            raise ValueError(f"{said}: the result is beyond every float; give numbers of usual size.") from None

    return computed


def needs(module: str, requirement: str, extra: str, what: str) -> None:
    """Refuses what a package that is not installed would do, with a command that installs it."""
    if importlib.util.find_spec(module) is None:
        raise ImportError(
            f"{what} needs {module}: pip install {requirement!r}, or in a checkout pip install -e '.[{extra}]'."
        )


def fields(instance: Any, **tests: Check) -> None:
    """Passes fields of a frozen dataclass through their tests."""
    for name, test in tests.items():
        value = test(getattr(instance, name), f"`{name}` of {type(instance).__name__}")
        object.__setattr__(instance, name, value)


def shown(value: Any) -> str:
    """repr(), but short, and of anything: a message must not fail, nor fill a screen."""
    try:
        text = repr(value) if isinstance(value, (str, sp.Basic)) else reprlib.repr(value)
    except Exception:  # int beyond 4300 digits; a repr of the caller's own
        return f"a {type(value).__name__}"
    return text if len(text) <= 200 else f"{text[:200]}..."


def expression(value, what, names=None):
    """`value` as a sympy expression that a system can contain; text only where `names` says what stands in it."""
    try:
        if isinstance(value, str):
            e = None if names is None else formula.read(value, names, what)
        else:
            e = sp.sympify(value, strict=True)
    except (sp.SympifyError, TypeError, AttributeError, ArithmeticError):
        e = None
    if not isinstance(e, sp.Expr) or e.is_Matrix or e.atoms(sp.Dummy):
        raise TypeError(
            f"{what} is {shown(value)}, no expression; give a sympy expression or a number (conditions "
            "belong into Piecewise or `when`)."
        )
    e = plain_states(e, what)
    huge = any(abs(n.p) > _HUGE * n.q for n in e.atoms(sp.Rational))
    if huge or e.has(sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I):
        raise ValueError(f"{what} is {shown(e)}, which is not a finite real expression.")
    return e


def plain_states(e, what):
    """An expression or condition with the symbol y for every state that it writes as a function y(t) of time."""
    functions = e.atoms(AppliedUndef)
    for f in sorted((*e.atoms(sp.Derivative), *functions), key=str):
        if isinstance(f, sp.Derivative):
            raise ValueError(f"{what} contains {f}; write the state or the expression that this rate is.")
        if len(f.args) != 1 or type(f.args[0]) is not sp.Symbol:
            raise ValueError(f"{what} contains {f}; a state is y or y(t), at the present time.")
    return e.xreplace({f: named(f) for f in functions})


def is_one(value):
    """Whether a value is one for all elements of a family, and not one for each."""
    return isinstance(value, (str, sp.Basic)) or not hasattr(value, "__len__") or np.ndim(value) == 0


def named(key):
    """What names a state or a parameter: of a function y(t) its Symbol y, anything else as it is."""
    if isinstance(key, AppliedUndef) and len(key.args) == 1:
        return sp.Symbol(key.func.__name__, real=True)
    return key


def period(value, parameters, what="`period`"):
    """A period > 0 as an expression in parameters, from a number, an expression or text; `parameters`: with values."""
    known = {p.name: p for p in parameters}
    e = expression(value, what, known)
    e = e.xreplace({s: known[s.name] for s in e.free_symbols if s.name in known})
    unknown = e.free_symbols - parameters.keys()
    if unknown:
        raise ValueError(
            f"{what} is {e}, in which {listing(unknown)} is no parameter of the system; they are {listing(parameters)}."
        )
    if not (T := number(e.subs(parameters) if e.free_symbols else e, what)) > 0:
        raise ValueError(f"{what} is {e} = {T:g}; give a positive period.")
    return e


def assumptions(symbol):
    """The assumptions of a symbol in words."""
    return ", ".join(k if v else f"not {k}" for k, v in symbol._assumptions_orig.items() if k != "commutative")


def listing(symbols):
    return ", ".join(str(s) for s in symbols) or "none"


def as_float(value):
    """float(value), which would read text too: a number that is written as text is a slip."""
    if isinstance(value, (str, bytes, bytearray)):
        raise TypeError
    return float(value)


def as_floats(values):
    """An array of floats, which numpy would make of text too."""
    if np.asarray(values).dtype.kind in "SU":
        raise TypeError
    return np.array(values, float)


def _float(value, what, remedy="give a number"):
    """`value` as a float, which may be inf or nan."""
    try:
        return as_float(value)
    except OverflowError:
        raise ValueError(f"{what} is {shown(value)}, beyond every float; {remedy}.") from None
    except (TypeError, ValueError, ArithmeticError, RecursionError):
        raise TypeError(f"{what} is {shown(value)}; {remedy}.") from None


def number(value, what):
    """`value` as a finite float."""
    result = _float(value, what)
    if not math.isfinite(result):
        raise ValueError(f"{what} is {shown(value)}; give a finite number.")
    return result


def fits(symbol, value):
    """Whether a finite number has the properties that the symbol is declared to have."""
    # all() of a generator takes thrice as long, which short runs notice.
    for holds, wanted in _declared(symbol):
        if holds(value) != wanted:
            return False
    return True


def unfit(symbol, values):
    """Which of an array of finite numbers do not have the properties that the symbol is declared to have."""
    wrong = np.zeros(len(values), bool)
    for holds, wanted in _declared(symbol):
        wrong |= holds(values) != wanted
    return np.flatnonzero(wrong)


def is_free(symbol):
    """Whether every finite real number has the properties that the symbol is declared to have."""
    declared = symbol._assumptions_orig.items()
    return all(wanted if name == "real" else name not in _PREDICATES for name, wanted in declared)


@functools.lru_cache(maxsize=4096)
def _declared(symbol):
    """(predicate, whether it is declared to hold) of a symbol."""
    declared = symbol._assumptions_orig.items()
    return tuple((_PREDICATES[name], wanted) for name, wanted in declared if name in _PREDICATES)


def _bounds(symbol):
    """What a symbol's value must be, in words."""
    words = {
        "positive": "> 0",
        "negative": "< 0",
        "nonnegative": ">= 0",
        "nonpositive": "<= 0",
        "nonzero": "other than 0",
    }
    declared = [name if wanted else f"not {name}" for name, wanted in symbol._assumptions_orig.items()]
    said = [words[name] for name in declared if name in words]
    others = [name for name in declared if name not in (*words, "real", "commutative")]
    return " and ".join(said + others)


def _fitting(symbol, value, argument):
    """`value` as a float that fits the symbol's assumptions: sympy has simplified by them."""
    what = f"`{argument}`, value of {symbol.name!r}"
    result = number(value, what)
    if not fits(symbol, result):
        raise ValueError(
            f"{what} is {result:g}; {symbol.name} must be {_bounds(symbol)} (declared {assumptions(symbol)})."
        )
    return result


def parameter_value(symbol, value):
    """The value of a parameter as a float that fits the symbol's assumptions."""
    return _fitting(symbol, value, "parameters")


def lookup(key, symbols, what, owner):
    """The one of `symbols` that a Symbol or name stands for."""
    key = named(key)
    if not isinstance(key, (str, sp.Symbol)):
        raise TypeError(f"{what} names {shown(key)}; give a Symbol or its name.")
    name = str(getattr(key, "name", key))
    for s in symbols:
        if s.name == name:
            return s
    raise ValueError(
        f"{what} names {shown(name)}, which is no {owner} of this system; it has {listing(symbols)}."
        + calls.hint(name, symbols)
    )


def without_discs(model, what):
    """Refuses what a system with discs does not have."""
    discs = [mu.symbol for mu in model.multipliers if mu.kind == "disc"]
    if discs:
        raise ValueError(
            f"{what} of a system with a disc ({listing(discs)}) are not known; its `smoothed` view has them."
        )


def without_together(model, what):
    """Refuses events that say what holds beside others, where only the event-driven loop knows it."""
    events = [event.name for event in model.events if event.together]
    if events:
        raise ValueError(
            f"{what} of a system with `together` in its events ({listing(events)}) are not known; solve() with method "
            "'taylor' or 'rk' has them, without derivatives."
        )


def all_of_kind(argument, items, kind):
    """`items`, objects of a kind, as a tuple."""
    items = several(items, f"`{argument}`")
    for item in items:
        if not isinstance(item, kind):
            raise TypeError(f"`{argument}` contains {shown(item)}; give {kind.__name__} objects.")
    return items


def states(symbols):
    """Each state once, each a plain Symbol."""
    for i, x in enumerate(symbols):
        if x in symbols[:i]:
            raise ValueError(f"`rates` lists the state {x.name!r} twice; give it one rate.")
        if type(x) is not sp.Symbol:
            raise ValueError(f"`rates` gives a rate to {x.name!r}, a {type(x).__name__}; a state is a Symbol.")


def mapping(value, what, contents="names to values"):
    """`value`, which has to be a mapping of `contents` ("states to ratios")."""
    return instance(Mapping, f"a dict of {contents}")(value, what)


def values(value, what):
    """A mapping of Symbols or names to numbers, as name -> float."""
    given = mapping(value, what, "Symbols or names to numbers")
    return {str(named(key)): number(entry, f"{what}, value of {key}") for key, entry in given.items()}


def run_options(value, what):
    """A mapping of options of solve() that all runs of a map may have."""
    for option in (given := mapping(value, what, "options of solve to values")):
        if option not in calls.RUNS:
            raise ValueError(f"{what} has {shown(option)}: {calls.remedy(option, calls.RUNS)}")
    return given


def pairs(value, what, least=1):
    """A mapping, or pairs of what stands for one, as a tuple of pairs, of which there are at least so many."""
    found = tuple(value.items() if isinstance(value, Mapping) else several(value, what))
    for item in found:
        if not isinstance(item, (tuple, list)) or len(item) != 2:
            raise TypeError(f"{what} contains {shown(item)}; give a dict of states to rates, or pairs of them.")
    if len(found) < least:
        raise ValueError(f"{what} is empty; give the rate of at least one state.")
    return tuple(map(tuple, found))


def _such(holds, words, read=number):
    """The test of a float for which `holds`."""

    def test(value, what):
        result = read(value, what)
        if not holds(result):
            raise ValueError(f"{what} is {result:g}; give a number {words}.")
        return result

    return test


positive = _such(lambda v: v > 0, "> 0")
nonnegative = _such(lambda v: v >= 0, ">= 0")
nonzero = _such(lambda v: v != 0, "other than 0")
extended = _such(lambda v: v >= 0, ">= 0 (0 and inf are allowed)", _float)


def optional(test):
    """The test of an argument that may be None."""
    return lambda value, what: None if value is None else test(value, what)


def text(value, what):
    """`value`, which has to be a string that is not empty."""
    if not name(value, what):
        raise ValueError(f"{what} is ''; give a string that is not empty.")
    return value


def integer(low, high=2**62):
    """The test of an integer in this range."""
    return lambda value, what: whole(value, what, low, high)


def one_of(*choices):
    """The test of an argument with a few values."""

    def test(value, what):
        if not isinstance(value, (str, int)) or isinstance(value, bool) or value not in choices:
            near = calls.hint(value, choices) if isinstance(value, str) else ""
            raise ValueError(f"{what} is {shown(value)}; choose one of {', '.join(map(str, choices))}.{near}")
        return value

    return test


def instance(kind, remedy):
    """The test of an argument that is an object of a kind."""

    def test(value, what):
        if not isinstance(value, kind):
            raise TypeError(f"{what} is {shown(value)}; give {remedy}.")
        return value

    return test


name = instance(str, "a string")
function = instance(Callable, "a function")


def key(value, what):
    """A Symbol or a name; of a Disc, a contact or an event what stands for it is said."""
    if isinstance(value, (str, sp.Symbol)):
        return value
    parts, own = getattr(value, "components", ()), getattr(value, "name", None)
    remedy = f"its name, {own!r}" if isinstance(own, str) else "a Symbol or its name"
    if isinstance(parts, tuple) and parts:
        remedy = f"one of its components, disc[0] to disc[{len(parts) - 1}]: {listing(parts)}"
    raise TypeError(f"{what} is {shown(value)}; give {remedy}.")


def system(value, what, functions=False):
    """`value`, which has to be a System or a view of one; of functions only where `functions` says so."""
    if hasattr(value, "system") and hasattr(value, "x0") and not hasattr(value, "model"):
        raise TypeError(
            f"{what} is a scene, {shown(value.name)}; give its `system`, with its `x0`, or call its `solve()`."
        )
    if isinstance(value, type) or not (hasattr(value, "model") and hasattr(value, "initial_state")):
        raise TypeError(
            f"{what} is {shown(value)}; give a System, such as System({{x: -x}}), or one of its views."
        )
    if getattr(value.model, "functions", None) and not functions:
        raise TypeError(
            f"{what} is made of functions (System.from_functions), which solve() alone runs; write the model in "
            "symbols for all else."
        )
    return value


def is_function(value):
    """Whether a value is Python code: functions, numba's too, and no Symbol, which can be called as well."""
    return callable(value) and not isinstance(value, (sp.Basic, type))


def takes(value, names, what):
    """Refuses a Python function that does not take these arguments, where a formula or such a function is wanted."""
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):  # compiled code may not tell
        return
    try:
        signature.bind(*names)
    except TypeError:
        raise TypeError(
            f"{what} is a Python function of ({', '.join(signature.parameters)}); give a formula, such as x - 1 with a "
            f"Symbol x, or in System.from_functions a function of ({', '.join(names)})."
        ) from None


def array(value, what):
    """`value` as an array of finite floats, of any shape."""
    try:
        result = as_floats(value)
    except (TypeError, ValueError, ArithmeticError, RecursionError):
        raise TypeError(f"{what} is {shown(value)}; give a number or a sequence of numbers.") from None
    if not np.isfinite(result).all():
        at = int(np.flatnonzero(~np.isfinite(result.ravel()))[0])
        raise ValueError(f"{what} is {result.ravel()[at]} at index {at}; drop or mend what is not finite.")
    return result


def numbers(value, what):
    """`value` as an array of finite floats, of one dimension with at least one number."""
    result = array(value, what)
    if result.ndim != 1 or not result.size:
        raise ValueError(f"{what} has the shape {result.shape}; give a sequence of at least one number.")
    return result


def pair(value, what):
    """`value` as two finite floats."""
    result = numbers(value, what)
    if len(result) != 2:
        raise ValueError(f"{what} has {len(result)} numbers; give two.")
    return tuple(result.tolist())


def interval(value, what):
    """`value` as (lowest, highest), two floats that may be infinite."""
    try:
        low, high = map(as_float, value)
    except (TypeError, ValueError, ArithmeticError, RecursionError):
        raise TypeError(f"{what} is {shown(value)}; give two numbers, (lowest, highest).") from None
    if not low <= high:
        raise ValueError(f"{what} is ({low:g}, {high:g}); give the lowest first.")
    return low, high


def several(value, what):
    """`value` as a tuple of what it holds."""
    iterable = isinstance(value, (Iterable, sp.MatrixBase))
    if isinstance(value, (str, bytes)) or not iterable or getattr(value, "ndim", 1) == 0:
        raise TypeError(f"{what} is {shown(value)}; give a sequence.")
    return tuple(value)


def velocity(value, what):
    """An expression, or two or three of them as a tuple: the components of a vector."""
    if isinstance(value, (tuple, list, sp.Tuple, sp.MatrixBase)):
        parts = tuple(expression(e, what) for e in value)
        if len(parts) not in (2, 3):
            raise ValueError(
                f"{what} has {len(parts)} components; give one expression, or two or three of them."
            )
        return parts
    return expression(value, what)


def path(value, what):
    """`value` as a Path."""
    if not isinstance(value, (str, os.PathLike)) or not str(value) or "\0" in str(value):
        raise TypeError(f"{what} is {shown(value)}; give a path.")
    return Path(value)


def ratio(value, what):
    """sp.oo, 0 or a positive float."""
    result = _float(value, what, "give 0, a positive number or sympy.oo")
    if not result >= 0:
        raise ValueError(f"{what} is {result:g}; give 0, a positive number or sympy.oo.")
    return sp.oo if result == math.inf else result or 0


#: The default `atol`: a state this near to 0 is 0 as far as a run can tell.
UNRESOLVED = 1e-12


def initial_value(symbol, value):
    """The initial value of a state as a float that fits the symbol's assumptions.

    Where one run's end is the next one's start, a state that is never negative may be -7e-18: that is 0.
    """
    if type(value) is float and math.isfinite(value) and fits(symbol, value):
        return value  # fast path: no message is built for valid input
    if is_zero_of(symbol, number(value, f"`x0`, value of {symbol.name!r}")):
        return 0.0
    return _fitting(symbol, value, "x0")


def is_zero_of(symbol, value):
    """Whether a number stands for the 0 that a symbol may have, and only rounding is in the way of its assumptions."""
    return abs(value) <= UNRESOLVED and not fits(symbol, value) and fits(symbol, 0.0)


def initial_state(x0, states, initial_memory, gone):
    """x0 as a list of floats: a mapping by name, or a sequence in the order of the states.

    Memories may be left out; `gone` maps names that are no state of this view to the reason.
    """
    if type(x0) is tuple and len(x0) == len(states):
        # Fast path: no message is built for valid input.
        return [initial_value(s, v) for s, v in zip(states, x0)] + list(initial_memory.values())
    memories = tuple(initial_memory)
    names = (*states, *memories)
    if isinstance(x0, Mapping):
        given = {}
        by_name = {s.name: s for s in (*memories, *states)}
        for key, value in x0.items():
            key = named(key)
            name = key.name if isinstance(key, sp.Symbol) else str(key)
            if name in gone:
                raise ValueError(
                    f"`x0` names {name!r}, which is no state of this view: {gone[name]}. Leave it out."
                )
            symbol = by_name.get(name)
            if symbol is None:
                raise ValueError(
                    f"`x0` names {name!r}, which is no state of this system; its states are {listing(names)}."
                    + calls.hint(name, names)
                )
            if symbol in given:
                raise ValueError(f"`x0` gives {name!r} twice, as a Symbol and as a string; give it once.")
            given[symbol] = initial_value(symbol, value)
        if missing := [s for s in states if s not in given]:
            raise ValueError(f"`x0` has no value for {listing(missing)}; give every state of this view.")
        return [given[s] if s in given else initial_memory[s] for s in names]
    try:
        sequence = list(x0)
    except TypeError:
        raise TypeError(f"`x0` is {shown(x0)}; give a dict of states, or a sequence in their order.") from None
    if len(sequence) not in (len(states), len(states) + len(memories)):
        raise ValueError(
            f"`x0` has {len(sequence)} values; this view has {len(states)} states ({listing(states)})"
            + (f" and {len(memories)} memories ({listing(memories)})." if memories else ".")
        )
    start = [initial_value(s, v) for v, s in zip(sequence, names, strict=False)]
    return start + [initial_memory[m] for m in memories[len(start) - len(states) :]]


# ---- options of solve()


def span(t_span, what="`t_span`", backward=False):
    """`t_span` as two finite floats, increasing; with `backward` they may also decrease."""
    try:
        t0, t1 = map(as_float, t_span)
    except (TypeError, ValueError, ArithmeticError, KeyError, RecursionError):
        raise TypeError(f"{what} is {shown(t_span)}; give two numbers, (start, end).") from None
    if not (math.isfinite(t0) and math.isfinite(t1) and (t0 < t1 or (backward and t0 > t1))):
        order = "that differ" if backward else "with start < end"
        raise ValueError(f"{what} is ({t0!r}, {t1!r}); give finite times {order}.")
    return t0, t1


def wanted_times(t_eval, t0, t1):
    """`t_eval` as an increasing array inside the span, or None; of a span that decreases in any order."""
    if t_eval is None:
        return None
    try:
        times = as_floats(t_eval)  # the solution keeps it
    except (TypeError, ValueError, ArithmeticError):
        raise TypeError(f"`t_eval` is {shown(t_eval)}; give a sequence of times.") from None
    if times.ndim != 1 or times.size == 0:
        raise ValueError(
            f"`t_eval` has the shape {times.shape}; give a sequence of times, or leave it out for the steps' own."
        )
    if not np.isfinite(times).all():
        raise ValueError(f"`t_eval` contains {times[~np.isfinite(times)][0]}; give finite times.")
    if t0 > t1:
        times.sort()
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        i = back[0]
        raise ValueError(
            f"`t_eval` decreases from {times[i].item()!r} to {times[i + 1].item()!r}; give increasing times."
        )
    outside = times[(times < min(t0, t1)) | (times > max(t0, t1))]
    if outside.size:
        raise ValueError(
            f"`t_eval` contains {outside[0].item()!r}, outside of `t_span` ({t0!r}, {t1!r}); leave it out, or "
            "extend `t_span`."
        )
    return times


def relative_tolerance(rtol):
    """`rtol` as a float between 0 and 1."""
    result = number(rtol, "`rtol`")
    if not 0 < result < 1:
        raise ValueError(f"`rtol` is {result!r}; give a number between 0 and 1, such as 1e-9.")
    return result


def absolute_tolerance(atol, states):
    """`atol` as an array, one entry a state."""

    def remedy() -> str:  # names are words only where they are wanted: a short run would feel it
        return f"give a number >= 0, or one for each of the states {listing(states)}"

    try:
        result = as_floats(atol)
    except (TypeError, ValueError, ArithmeticError):
        raise TypeError(f"`atol` is {shown(atol)}; {remedy()}.") from None
    if result.shape not in ((), (len(states),)):
        raise ValueError(f"`atol` has the shape {result.shape}; {remedy()}.")
    if not (np.isfinite(result).all() and (result >= 0).all()):
        raise ValueError(f"`atol` is {atol!r}; {remedy()}.")
    return np.broadcast_to(result, (len(states),)).copy()


def longest_step(max_step):
    """`max_step` as a positive float; inf is no bound."""
    remedy = "give a number > 0, or math.inf for no bound"
    result = _float(max_step, "`max_step`", remedy)
    if not result > 0:
        raise ValueError(f"`max_step` is {shown(max_step)}; {remedy}.")
    return result


def whole(value, what, low, high=2**62):
    """`value` as an int from `low` to `high`; 1e6 is one, True is none."""
    wanted = f"give an integer from {low} to {high}" if high < 2**62 else f"give an integer >= {low}"
    result = math.nan if isinstance(value, bool) else _float(value, what, wanted)
    if not (low <= result <= high and result == math.floor(result)):
        raise ValueError(f"{what} is {shown(value)}; {wanted}.")
    return int(value)


def exact_integer(value, what):
    """`value`, an int from 0 on and no float: seeds that look the same are."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        result = operator.index(value)
    except TypeError:
        raise TypeError(f"{what} is {shown(value)}; give an integer >= 0.") from None
    if not 0 <= result < 2**63:
        raise ValueError(f"{what} is {shown(value)}; give an integer from 0 to 2**63 - 1.")
    return result


def flag(value, what):
    """`value`, which has to be True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what} is {shown(value)}; give True or False.")
    return bool(value)
