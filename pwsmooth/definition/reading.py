"""A definition as the user writes it -> the lifted field, after all checks of names and values.

Chain: primitives.py, family.py -> definition (here), lifting.py -> lowering.py -> system.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ..door import checks
from . import drives
from .controls import Control
from .families.expansion import Expansion
from .lifting import JUMPING, Lifting, plain
from .lowering import Field
from .mobilities import with_mobilities
from .model import Beside, EventSpec, of_event
from .primitives import Algebraic, Disc, Event, Memory, Reaction, Switch, Unilateral, symbols_of

_EVALUATED = {"new_switches": False}  # what is evaluated, not followed, makes no switches of its own


@dataclass(frozen=True)
class Definition:
    """What was written, and the field that it means."""

    rates: tuple[tuple[sp.Symbol, sp.Expr], ...]  # as written, families in one line
    outputs: tuple[tuple[str, sp.Expr], ...]
    events: tuple[Event, ...]
    contacts: tuple[Reaction, ...]
    controls: tuple[Control, ...]
    algebraic: tuple[Algebraic, ...]
    switches: tuple[Switch, ...]
    discs: tuple[Disc, ...]
    memories: tuple[Memory, ...]
    parameters: dict[sp.Symbol, float]
    groups: dict[str, tuple[str, ...]]  # member of a family -> its names in all elements
    field: Field


def read(rates, time, parameters, outputs, events, contacts, algebraic, sampled, families=None):
    """The `Definition` of the arguments of a System; `families` writes families out, or only their one element."""
    pairs = list(rates)
    written = tuple((x, checks.expression(e, f"`rates`, the rate of {x}")) for x, e in pairs)
    seen = tuple((str(name), checks.expression(e, f"`outputs`, {name!r}")) for name, e in outputs.items())
    events, contacts, algebraic = (
        checks.all_of_kind(argument, items, kind)
        for argument, items, kind in (
            ("events", events, Event), ("contacts", contacts, Unilateral), ("algebraic", algebraic, Algebraic)
        )
    )  # fmt: skip

    families = families or Expansion()
    pairs, outputs = families.rates(written), families.outputs(dict(seen))
    events, contacts, algebraic = (
        tuple(one for item in items for one in families.items(item)) for items in (events, contacts, algebraic)
    )
    symbols = symbols_of([*(e for _, e in pairs), *(a.residual for a in algebraic)])
    meanings, moving, behind = families.further()
    symbols = list(dict.fromkeys([*symbols, *symbols_of(behind)]))
    reactions = _reactions(contacts, symbols)
    symbols = symbols_of([*symbols, *outputs.values(), *(e for event in events for e in of_event(event))])
    names = _Names(symbols)
    states = [names(x, "`rates`") for x, _ in pairs]
    checks.states(states)
    time = _time(time, names, states)
    controls = {u: u._meaning(time) for u in symbols if isinstance(u, Control)}
    changes = tuple(event for u in controls.values() for event in u.events)
    symbols = [*symbols, *map(names.add, [p for u in controls.values() for p in u.parameters])]
    updated = [names(key, "`update` of an event") for event in (*events, *changes) for key, _ in event.update]
    pieces = drives.pieces([(names(u, "`drives`"), drive) for u, drive in sampled.items()], time)
    if unused := [u for u in pieces if u not in symbols]:
        raise ValueError(
            f"`drives` names {checks.listing(unused)}, which stands nowhere in this system; leave it out."
        )
    outputs = {u.name: u for u in (*pieces, *controls)} | outputs
    memories = tuple(
        dict.fromkeys(
            [
                *(s for s in (*symbols, *updated) if isinstance(s, Memory)),
                *(cell for _, cell, _ in pieces.values()),
            ]
        )
    )
    unknowns = [names(a.unknown, "`algebraic`") for a in algebraic]
    taken = {
        time: "time",
        **dict.fromkeys(states, "a state"),
        **dict.fromkeys(unknowns, "an unknown"),
        **dict.fromkeys(pieces, "a drive"),
        **dict.fromkeys(controls, "a control"),
    }
    own = {p: value for u in controls.values() for p, value in u.parameters.items()}
    values = _parameters(
        own | families.parameters(parameters), names, symbols, taken | meanings, families.groups
    )

    moving |= {time, *states, *unknowns, *map(plain, reactions), *pieces, *controls}
    stand_ins = {u: value for u, (value, *_) in (*pieces.items(), *controls.items())}
    given = [s for s in symbols if isinstance(s, Switch)]
    bent = [s for s in given if any(e.diff(s, 2) != 0 for _, e in pairs)]
    jumps = {*unknowns, *given}
    jumping = [x for x, (_, e) in zip(states, pairs, strict=True) if jumps & e.free_symbols or e.has(*JUMPING)]
    lift = Lifting(moving, given, stand_ins, bent, [*unknowns, *jumping], _solved(unknowns, algebraic))
    inside = dict(zip(unknowns, (item.residual for item in algebraic), strict=True))
    said = [(e, *(inside[s] for s in e.free_symbols if s in inside)) for _, e in pairs]
    lift.take_directions([(x, sp.Tuple(*es)) for x, es in zip(states, said, strict=True)])
    # Rates first: their surfaces give the switches their order.
    lifted = {
        "rates": tuple(lift(e) for _, e in pairs),
        "algebraic": tuple((a, lift(item.residual)) for a, item in zip(unknowns, algebraic, strict=True)),
        "sums": tuple((s, lift(e)) for s, (_, e) in families.sums.items()),
    }
    gaps = [lift(R.gap) for R in reactions]
    specs = _events(
        (*events, *changes),
        lift,
        [*states, *memories],
        [*states, *memories, *unknowns, *pieces, *controls, time],
        families.beside,
    )
    specs += drives.sampling(pieces, [*states, *memories])
    field = Field(
        time=time,
        states=tuple(states),
        parameters=tuple(values),
        memories=tuple(map(plain, memories)),
        switches=tuple(lift.switches.items()),
        at_zero=lift.at_zero,
        discs=tuple(lift.discs.values()),
        contacts=tuple(
            (plain(R), gap, lift(R.restitution, **_EVALUATED)) for R, gap in zip(reactions, gaps, strict=True)
        ),
        events=specs,
        outputs=tuple((name, lift(e, **_EVALUATED)) for name, e in outputs.items()),
        initial_memory=tuple(m.initial for m in memories),
        typical=tuple(values.values()),
        members=families.members,
        **lifted,
    )
    switches = tuple(lift.notation[lam] for lam, _ in field.switches)
    return Definition(
        written, seen, events, tuple(reactions), tuple(controls), algebraic, switches, tuple(lift.discs), memories,
        values, families.groups, with_mobilities(field),
    )  # fmt: skip


def _solved(unknowns, algebraic):
    """Unknown -> what it is, where its equation is linear in it and contains what may jump."""
    found = {}
    for u, item in zip(unknowns, algebraic, strict=True):
        slope = item.residual.diff(item.unknown)
        if slope.is_number and slope != 0 and (item.residual.has(*JUMPING) or item.residual.atoms(Switch)):
            found[u] = -item.residual.xreplace({item.unknown: sp.S.Zero}) / slope
    return found


class _Names:
    """Symbols by name: a name stands for one symbol in a system."""

    def __init__(self, symbols):
        self.by_name: dict[str, sp.Symbol] = {}
        for s in symbols:
            self.add(s)

    def add(self, symbol):
        if isinstance(symbol, sp.Dummy):
            raise TypeError(f"{symbol} is a Dummy, which has no name of its own; give a Symbol.")
        first = self.by_name.setdefault(symbol.name, symbol)
        if first == symbol:
            return symbol
        if isinstance(first, Switch) and isinstance(symbol, Switch):
            raise ValueError(
                f"two switches are named {symbol.name!r}, with the surfaces {first.surface} and "
                f"{symbol.surface}; give each its own name."
            )
        kinds = [f"{type(s).__name__} {checks.assumptions(s)}".strip() for s in (first, symbol)]
        raise ValueError(
            f"two different symbols are named {symbol.name!r} ({kinds[0]}; {kinds[1]}). sympy tells symbols "
            "apart by their assumptions: make the symbol once and use it everywhere, or rename one."
        )

    def __call__(self, key, what):
        """The symbol that a Symbol or a string names."""
        key = checks.named(key)
        if isinstance(key, str):
            return self.by_name.get(key) or self.add(sp.Symbol(key, real=True))
        if isinstance(key, sp.Symbol):
            return self.add(key)
        raise TypeError(f"{what} names {checks.shown(key)}; give a Symbol or its name.")


def _reactions(contacts, symbols):
    """Reactions in the equations; those of the given contacts must be among them."""
    for c in contacts:
        if c.reaction not in symbols:
            raise ValueError(
                f"the reaction of contact {c.name!r} stands in no rate: the contact has no force. Add its "
                "`.reaction` to the rate of the velocity on which it acts."
            )
    return [s for s in symbols if isinstance(s, Reaction)]


def _time(time, names, states):
    if time is None:
        return sp.Symbol("t" if "t" not in names.by_name else "time", real=True)
    time = names(time, "`time`")
    if time in states:
        raise ValueError(f"`time` is {time}, which is a state; time needs no rate.")
    return time


def _parameters(values_of, names, symbols, taken, groups):
    """Parameter -> value, in the order given; every symbol without another meaning has one."""
    there = {s.name for s in symbols}
    some = {name for group in groups.values() if not there.isdisjoint(group) for name in group}
    open_symbols = [s for s in symbols if type(s) is sp.Symbol and s not in taken]
    values = {}
    for key, value in values_of.items():
        p = names(key, "`parameters`")
        if p in taken or type(p) is not sp.Symbol:
            meaning = taken.get(p, f"a {type(p).__name__}")
            raise ValueError(f"`parameters` gives a value to {p.name!r}, which is {meaning}; leave it out.")
        if p.name in some and p not in symbols:
            continue  # of elements at an end, which lack what others have
        if p not in symbols:
            raise ValueError(
                f"`parameters` names {p.name!r}, which stands nowhere in this system; leave it out. Its "
                f"symbols without another meaning: {checks.listing(open_symbols)}."
            )
        values[p] = checks.parameter_value(p, value)
    undefined = [s for s in open_symbols if s not in values]
    if undefined:
        first = undefined[0].name
        hint = f" If {first} is time, say time={first}." if first in ("t", "time") else ""
        raise ValueError(
            f"the system uses {checks.listing(undefined)}, without a rate or a value; add to `rates` or "
            f"`parameters`.{hint}"
        )
    return values


def _written(key, order, what, beside):
    """Index of what an event writes."""
    place = beside(key)
    if place is None:
        return order.index(checks.lookup(key, order, what, "state or memory"))
    base, offset = place
    return Beside(order.index(checks.lookup(base, order, what, "state or memory")), offset, key)


def _with_simple_zeros(h):
    """A surface with the sign of `h` and a slope where odd powers have none: a zero of x**7 is located as that of x."""
    factors = sp.Mul.make_args(sp.factor_terms(h) if h.is_Add else h)
    if not any(f.is_Pow and f.exp.is_odd and f.exp > 1 for f in factors):
        return h
    simple = [f.base if f.is_Pow and f.exp.is_odd and f.exp > 1 else f for f in factors]
    return sp.Mul(*(f for f in simple if f.is_number or not f.is_positive))


def _events(events, lift, order, moving, beside):
    # All surfaces first: guards and updates then find their switches.
    surfaces = [None if event.surface is None else _with_simple_zeros(lift(event.surface)) for event in events]
    specs = []
    for k, (event, surface) in enumerate(zip(events, surfaces, strict=True)):
        name = event.name or f"event {k + 1}"
        update = tuple(
            (_written(key, order, f"`update` of event {name!r}", beside), lift(e, **_EVALUATED, at_instant=True))
            for key, e in event.update
        )  # fmt: skip
        for e in (event.every, *event.at):
            inside = [s for s in moving if e is not None and s in e.free_symbols]
            if inside:
                raise ValueError(
                    f"the instants of event {name!r} depend on {checks.listing(inside)}; `every` and `at` take "
                    "numbers and parameters. Use a surface for what the state decides."
                )
        when = lift(event.when, **_EVALUATED, at_instant=True)
        own = event.every, event.at, event.direction, when, update, event.terminal
        specs.append(EventSpec(name, surface, *own, together=event.together))
    names = [s.name for s in specs]
    if len(set(names)) < len(names):
        raise ValueError(f"two events have the same name; they are {checks.listing(names)}. Give each its own.")
    return tuple(specs)
