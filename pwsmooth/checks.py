"""Checks at the door: names, parameter values and initial states, each error with its remedy."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np
import sympy as sp
from sympy.core.function import AppliedUndef

from .primitives import Reaction, Switch

_PREDICATES = {
    "positive": lambda v: v > 0,
    "negative": lambda v: v < 0,
    "nonnegative": lambda v: v >= 0,
    "nonpositive": lambda v: v <= 0,
    "nonzero": lambda v: v != 0,
    "zero": lambda v: v == 0,
    "integer": lambda v: v == int(v),
    "noninteger": lambda v: v != int(v),
    "even": lambda v: v == int(v) and v % 2 == 0,
    "odd": lambda v: v == int(v) and v % 2 == 1,
    "real": lambda v: True,
    "imaginary": lambda v: False,
}


def expression(value, what):
    """`value` as a sympy expression that a system can contain."""
    try:
        e = sp.sympify(value, strict=True)
    except (sp.SympifyError, TypeError):
        e = None
    if not isinstance(e, sp.Expr):
        raise TypeError(f"{what} is {value!r}; give a sympy expression or a number.")
    undefined = e.atoms(AppliedUndef, sp.Derivative)
    if undefined:
        first = sorted(map(str, undefined))[0]
        raise ValueError(f"{what} contains {first}; states are plain Symbols here, write y and not y(t).")
    if e.has(sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I):
        raise ValueError(f"{what} is {e}, which is not a finite real expression.")
    return e


def symbols_of(expressions):
    """All symbols of the expressions, those inside of surfaces and gaps too; the inner ones first."""
    found: dict[sp.Symbol, None] = {}

    def visit(e):
        for s in sorted(e.free_symbols, key=lambda s: s.name):
            if s in found:
                continue
            if isinstance(s, Switch):
                visit(s.surface)
            elif isinstance(s, Reaction):
                visit(s.gap)
                visit(s.restitution)
            found[s] = None

    for e in expressions:
        visit(e)
    return list(found)


class Names:
    """Symbols by name: a name stands for one symbol in a system."""

    def __init__(self, symbols):
        self.by_name: dict[str, sp.Symbol] = {}
        for s in symbols:
            self.add(s)

    def add(self, symbol):
        if isinstance(symbol, sp.Dummy):
            raise TypeError(f"{symbol} is a Dummy, which has no name of its own; give a Symbol.")
        known = self.by_name.setdefault(symbol.name, symbol)
        if known == symbol:
            return symbol
        if isinstance(known, Switch) and isinstance(symbol, Switch):
            raise ValueError(
                f"two switches are named {symbol.name!r}, with the surfaces {known.surface} and "
                f"{symbol.surface}; give each its own name."
            )
        kinds = [f"{type(s).__name__} {assumptions(s)}".strip() for s in (known, symbol)]
        raise ValueError(
            f"two different symbols are named {symbol.name!r} ({kinds[0]}; {kinds[1]}). sympy tells symbols "
            "apart by their assumptions: make the symbol once and use it everywhere, or rename one."
        )

    def __call__(self, key, what):
        """The symbol that a Symbol or a string names."""
        if isinstance(key, str):
            return self.by_name.get(key) or self.add(sp.Symbol(key, real=True))
        if isinstance(key, sp.Symbol):
            return self.add(key)
        raise TypeError(f"{what} names {key!r}; give a Symbol or its name.")


def assumptions(symbol):
    """The assumptions of a symbol in words."""
    return ", ".join(k if v else f"not {k}" for k, v in symbol._assumptions_orig.items() if k != "commutative")


def listing(symbols):
    return ", ".join(str(s) for s in symbols) or "none"


def number(value, what):
    """`value` as a finite float."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{what} is {value!r}; give a number.") from None
    if not math.isfinite(result):
        raise ValueError(f"{what} is {value}; give a finite number.")
    return result


def fits(symbol, value):
    """Whether a finite number has the properties that the symbol is declared to have."""
    for holds, wanted in _declared(symbol):
        if holds(value) != wanted:
            return False
    return True


@functools.lru_cache(maxsize=4096)
def _declared(symbol):
    """(predicate, whether it is declared to hold) of a symbol."""
    declared = symbol._assumptions_orig.items()
    return tuple((_PREDICATES[name], wanted) for name, wanted in declared if name in _PREDICATES)


def parameter_value(symbol, value):
    """The value of a parameter as a float that fits the symbol's assumptions."""
    result = number(value, f"parameter {symbol.name!r}")
    if not fits(symbol, result):
        raise ValueError(
            f"parameter {symbol.name!r} is {result:g}, but its symbol is declared {assumptions(symbol)}; "
            "give such a value, or declare the symbol without that assumption."
        )
    return result


def values_fit(field, parameters):
    """What values of parameters must satisfy beyond the assumptions of their symbols."""
    zero = {p for p, value in parameters.items() if value == 0}
    for x, rate in zip(field.states, field.rates) if zero else ():
        for power in rate.atoms(sp.Pow):
            base, exponent = power.args
            inside = base.free_symbols
            if inside & zero and inside <= parameters.keys() and exponent.is_negative:
                if float(base.subs(parameters)) == 0:
                    raise ValueError(
                        f"the rate of {x.name!r} divides by {base}, which is 0 for {listing(inside & zero)} "
                        "= 0. A vanishing time constant is a view: system.layered({z: sympy.oo})."
                    )
    for event in field.events:
        if event.every is not None and not event.every.subs(parameters) > 0:
            raise ValueError(
                f"`every` of event {event.name!r} is {event.every} = {event.every.subs(parameters)}; give a "
                "period > 0."
            )
    for R, _, e in field.contacts:
        if e.free_symbols <= parameters.keys() and not 0 <= e.subs(parameters) <= 1:
            raise ValueError(
                f"the restitution {e} of contact {R.name!r} is {e.subs(parameters)}; give 0 <= e <= 1."
            )


def lookup(key, symbols, what, owner):
    """The one of `symbols` that a Symbol or name stands for."""
    name = key if isinstance(key, str) else getattr(key, "name", None)
    for s in symbols:
        if s == key or s.name == name:
            return s
    raise ValueError(
        f"{what} names {str(key)!r}, which is no {owner} of this system; it has {listing(symbols)}."
    )


def all_of_kind(argument, items, kind):
    for item in items:
        if not isinstance(item, kind):
            raise TypeError(f"`{argument}` contains {item!r}; give {kind.__name__} objects.")


def states(symbols):
    """Each state once, each a plain Symbol."""
    for i, x in enumerate(symbols):
        if x in symbols[:i]:
            raise ValueError(f"`rates` lists the state {x.name!r} twice; give it one rate.")
        if type(x) is not sp.Symbol:
            raise ValueError(f"`rates` gives a rate to {x.name!r}, a {type(x).__name__}; a state is a Symbol.")


def reactions(contacts, found):
    """Reactions in the equations; those of the given contacts must be among them."""
    for c in contacts:
        if c.reaction not in found:
            raise ValueError(
                f"the reaction of contact {c.name!r} stands in no rate: the contact has no force. Add its "
                "`.reaction` to the rate of the velocity on which it acts."
            )
    return [s for s in found if isinstance(s, Reaction)]


def mapping(value, what, contents):
    """`value`, which has to be a mapping of `contents` ("states to ratios")."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{what} is {value!r}; give a dict of {contents}.")
    return value


def positive(value, what):
    value = number(value, what)
    if value <= 0:
        raise ValueError(f"{what} is {value:g}; give a number > 0.")
    return value


def ratio(value, what):
    """sp.oo, 0 or a positive float."""
    if value == sp.oo or value == math.inf:
        return sp.oo
    value = number(value, what)
    if value < 0:
        raise ValueError(f"{what} is {value:g}; give 0, a positive number or sympy.oo.")
    return value or 0


def initial_value(symbol, value):
    """The initial value of a state as a float that fits the symbol's assumptions: sympy has simplified by them."""
    if type(value) is float and math.isfinite(value) and fits(symbol, value):
        return value  # the common case, without words that nobody reads
    what = f"`x0`, value of {symbol.name!r}"
    result = number(value, what)
    if not fits(symbol, result):
        raise ValueError(
            f"{what} is {result:g}, but its symbol is declared {assumptions(symbol)}; give such a value, or "
            "declare the symbol without that assumption."
        )
    return result


def initial_state(x0, states, initial_memory, gone):
    """x0 as a list of floats: a mapping by name, or a sequence in the order of the states.

    Memories may be left out; `gone` maps names that are no state of this view to the reason.
    """
    if type(x0) is tuple and len(x0) == len(states):
        # The common case, without words that nobody reads.
        return [initial_value(s, v) for s, v in zip(states, x0)] + list(initial_memory.values())
    memories = tuple(initial_memory)
    if isinstance(x0, Mapping):
        values, given = dict(initial_memory), set()
        by_name = {s.name: s for s in (*memories, *states)}
        for key, value in x0.items():
            name = key.name if isinstance(key, sp.Symbol) else str(key)
            if name in gone:
                raise ValueError(
                    f"`x0` names {name!r}, which is no state of this view: {gone[name]}. Leave it out."
                )
            symbol = by_name.get(name)
            if symbol is None:
                raise ValueError(
                    f"`x0` names {name!r}, which is no state of this system; its states are "
                    f"{listing((*states, *memories))}."
                )
            if symbol in given:
                raise ValueError(f"`x0` gives {name!r} twice, as a Symbol and as a string; give it once.")
            given.add(symbol)
            values[symbol] = initial_value(symbol, value)
        missing = [s for s in states if s not in values]
        if missing:
            raise ValueError(f"`x0` has no value for {listing(missing)}; give every state of this view.")
        return [values[s] for s in (*states, *memories)]
    try:
        sequence = list(x0)
    except TypeError:
        raise TypeError(f"`x0` is {x0!r}; give a dict of states, or a sequence in their order.") from None
    if len(sequence) not in (len(states), len(states) + len(memories)):
        raise ValueError(
            f"`x0` has {len(sequence)} values; this view has {len(states)} states ({listing(states)})"
            + (f" and {len(memories)} memories ({listing(memories)})." if memories else ".")
        )
    names = (*states, *memories)
    start = [initial_value(s, v) for v, s in zip(sequence, names, strict=False)]
    return start + [initial_memory[m] for m in memories[len(start) - len(states) :]]


# ---- options of solve()


def span(t_span):
    """`t_span` as two finite, increasing floats."""
    try:
        start, end = t_span
        t0, t1 = float(start), float(end)
    except (TypeError, ValueError):
        raise TypeError(f"`t_span` is {t_span!r}; give two numbers, (start, end).") from None
    if not (math.isfinite(t0) and math.isfinite(t1) and t0 < t1):
        raise ValueError(f"`t_span` is ({t0!r}, {t1!r}); give finite times with start < end.")
    return t0, t1


def wanted_times(t_eval, t0, t1):
    """`t_eval` as an increasing array inside the span, or None."""
    if t_eval is None:
        return None
    try:
        times = np.array(t_eval, float)  # the solution keeps it
    except (TypeError, ValueError):
        raise TypeError(f"`t_eval` is {t_eval!r}; give a sequence of times.") from None
    if times.ndim != 1 or times.size == 0:
        raise ValueError(
            f"`t_eval` has the shape {times.shape}; give a sequence of times, or leave it out for the steps' own."
        )
    if not np.isfinite(times).all():
        raise ValueError(f"`t_eval` contains {times[~np.isfinite(times)][0]}; give finite times.")
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        i = back[0]
        raise ValueError(
            f"`t_eval` decreases from {times[i].item()!r} to {times[i + 1].item()!r}; give increasing times."
        )
    outside = times[(times < t0) | (times > t1)]
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
        raise ValueError(f"`rtol` is {rtol!r}; give a number between 0 and 1, such as 1e-9.")
    return result


def absolute_tolerance(atol, states):
    """`atol` as an array, one entry a state."""

    def remedy() -> str:  # names are words only where they are wanted: a short run would feel it
        return f"give a number >= 0, or one for each of the states {listing(states)}"

    try:
        result = np.asarray(atol, float)
    except (TypeError, ValueError):
        raise TypeError(f"`atol` is {atol!r}; {remedy()}.") from None
    if result.shape not in ((), (len(states),)):
        raise ValueError(f"`atol` has the shape {result.shape}; {remedy()}.")
    if not (np.isfinite(result).all() and (result >= 0).all()):
        raise ValueError(f"`atol` is {atol!r}; {remedy()}.")
    return np.broadcast_to(result, (len(states),)).copy()


def longest_step(max_step):
    """`max_step` as a positive float; inf is no bound."""
    try:
        result = float(max_step)
    except (TypeError, ValueError):
        raise TypeError(f"`max_step` is {max_step!r}; give a number > 0, or math.inf for no bound.") from None
    if not result > 0:
        raise ValueError(f"`max_step` is {max_step!r}; give a number > 0, or math.inf for no bound.")
    return result


def whole(value, what, low, high=2**62):
    """`value` as an int from `low` to `high`; 1e6 is one, True is none."""
    wanted = f"give an integer from {low} to {high}" if high < 2**62 else f"give an integer >= {low}"
    try:
        result = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{what} is {value!r}; {wanted}.") from None
    if not (low <= result <= high and result == math.floor(result)):
        raise ValueError(f"{what} is {value!r}; {wanted}.")
    return int(value)


def flag(value, what):
    """`value`, which has to be True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what} is {value!r}; give True or False.")
    return bool(value)
