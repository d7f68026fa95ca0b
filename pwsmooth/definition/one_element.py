"""Reading a system for one element of each family: the template, whose symbolic work does not grow with n.

Symbols of elements become plain symbols with "[]" in their name and sums become symbols of their own, so that lifting
and lowering see an ordinary system of one element. What has no template (see `Family`) raises `NoTemplate`, and the
System writes the elements out, also of fewer than `TEMPLATE_FROM` elements: straight code is faster there.
Chain: expansion.py -> one_element (here), between.py, reading.py, lowering.py -> template.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import sympy as sp

from ..door import checks
from . import lifting, lowering
from . import reading as definition
from .families.between import Neighbours, NoTemplate
from .families.expansion import Expansion, spread
from .families.family import Family, MemberMemory, MemberSum, involved
from .families.many import Numbers, Symbols
from .families.template import LINKED, MARK, Families, Level, Place, Template, family_model, named
from .model import Held, Model, Multiplier, Select, Table
from .primitives import Memory
from .reading import Definition
from .regularity import second_derivative, total_derivative
from .singular import watched

TEMPLATE_FROM = 8


class OneElement(Expansion):
    """Writes one element out, for all; `places` maps the plain symbols of the elements to their `Place`."""

    def __init__(self):
        super().__init__()
        self.families: list[Family] = []
        self.columns: dict[int, dict[tuple, int]] = {}  # family -> (links, column of theirs) -> column
        self.places: dict[sp.Symbol, Place] = {}
        self.held: set[sp.Symbol] = set()  # memories and reactions that neighbours read

    def column(self, links, k):
        """Number of a column of neighbours among all that the family has."""
        columns = self.columns.setdefault(self.number(links.family), {})
        return columns.setdefault((links, k - 1), len(columns))

    def links(self):
        """A table of the neighbours of each family, None for a chain."""
        tables = []
        for f in range(len(self.families)):
            columns = [links.table[:, k] for links, k in self.columns.get(f, ())]
            tables.append(Table("links", np.stack(columns, axis=1).astype(float), 0.0) if columns else None)
        return tuple(tables)

    def number(self, family):
        if family not in self.families:
            self.families.append(family)
        return self.families.index(family)

    # ---- what Expansion does n times

    def elements(self, family):
        self.number(family)
        return [0]

    def lacks(self, member, k):
        return False  # told by the surface itself, where it matters (between.py)

    def beside(self, symbol):
        place = self.places.get(symbol)
        return (place.base, place.offset) if place and place.base is not None and place.offset else None

    def label(self, name, k, space="_"):
        return f"{name}{'' if space == '_' else space}{MARK}"

    def total(self, e, family):
        inner = self.element(e, 0)
        known = {pair: s for s, pair in self.sums.items()}
        if (family, inner) in known:
            return known[family, inner]
        self.number(family)
        symbol = sp.Symbol(f"sum{len(self.sums) + 1}{MARK[0]}{family.name}{MARK[1]}", real=True)
        self.sums[symbol] = family, inner
        return symbol

    def _of_neighbour(self, s, k):
        if k is None:
            return super()._of_neighbour(s, k)
        base, number = lifting.plain(self.element(s.of, 0)), self.number(s.family)
        self.held.add(base)
        outside = None if s.family.periodic else lifting.plain(self.element(s.outside, k))
        mark = "" if outside in (None, base, 0) else f"|{outside}"
        symbol = sp.Symbol(f"{base.name}[{s.offset:+d}{mark}]", real=True)
        self.places[symbol] = Place(number, base, s.offset, outside)
        return symbol

    def _member(self, m, k):
        if k is None:
            return super()._member(m, k)
        if isinstance(m, MemberMemory):
            self._group(m.name, m.family.n)
            symbol = Memory(f"{m.name}{MARK}", m.initial)
            self._place(symbol, m.family, sp.Symbol(symbol.name, **symbol._assumptions_orig))
            return symbol
        base = sp.Symbol(f"{m.name}{MARK}", **m._assumptions_orig)
        if m.name == "i" and m.is_integer:
            self.places.setdefault(base, Place(self.number(m.family), None))
            return base
        self._place(base, m.family, base)
        self._group(m.name, m.family.n)
        if not m.offset:
            return base
        if m.links is not None:
            column = self.column(m.links, m.offset)
            symbol = sp.Symbol(f"{m.name}[link {column + 1}]", **m._assumptions_orig)
            self.places[symbol] = Place(self.number(m.family), base, LINKED + column, base)
            return symbol
        outside = None if m.family.periodic else self.element(m.outside, k)
        mark = "" if outside in (None, base) else f"|{outside}"
        symbol = sp.Symbol(f"{m.name}[{m.offset:+d}{mark}]", **m._assumptions_orig)
        self.places[symbol] = Place(self.number(m.family), base, m.offset, outside)
        return symbol

    def _place(self, symbol, family, base):
        place = self.places.setdefault(symbol, Place(self.number(family), base))
        if place.family != self.number(family):
            raise NoTemplate(f"two families have members named {symbol}")

    # ---- what `definition.read` asks for

    def parameters(self, values):
        """One value of every block: what elements have in common is decided beside these."""
        result = {}
        for key, value in values.items():
            name = key if isinstance(key, str) else getattr(key, "name", None)
            if name in self.groups:
                result[f"{name}{MARK}"] = value if checks.is_one(value) else value[0]
            else:
                result[key] = value
        return result

    def further(self):
        neighbours = {s for s, place in self.places.items() if place.base != s}
        meanings = {s: "a symbol of the elements" for s in (*neighbours, *self.sums)}
        behind = [e for _, e in self.sums.values()]
        behind += [
            p.outside for p in self.places.values() if p.outside is not None and p.outside not in self.held
        ]
        return meanings, {*neighbours, *self.sums}, behind


@dataclass(frozen=True)
class Element:
    """What a System with families knows without writing their elements out."""

    definition: Definition  # of one element
    model: Model
    parameters: dict[sp.Symbol, float]
    groups: dict[str, tuple[str, ...]]

    def _of_element(self, k):
        """(Parameter of the one element, that of element k)."""
        families = self.model.families
        blocks = zip(families.template.model.parameters, families.template.families("parameters"), strict=True)
        return [(s, families.symbol(s, k)) for s, f in blocks if f is None or k < families.sizes[f]]

    def output(self, name, k):
        """The expression of an output of element k, or of the whole."""
        families = self.model.families
        outputs = dict(families.template.model.outputs)
        e = outputs.get(f"{name}{MARK}")
        return outputs[name] if e is None else families.expression(e, k)

    @cached_property
    def memories(self):
        """Those of all elements."""
        families = self.model.families
        blocks = zip(
            self.definition.memories,
            families.template.families("states")[len(self.definition.field.states) :],
            strict=True,
        )
        return tuple(
            Memory(named(m.name, k), m.initial)
            for m, f in blocks
            for k in ([None] if f is None else range(families.sizes[f]))
        )

    @cached_property
    def _element_of(self):
        """Parameter of an element -> its number."""
        most = max(self.model.families.sizes)
        return {own: k for k in range(most) for s, own in self._of_element(k) if own is not s}

    def check_values(self, parameters):
        """`Field.check_values` for the first element, and for every one that has a parameter 0 or returns too much."""
        if isinstance(parameters, Numbers):
            symbols = parameters.symbols
            zero = [
                symbols.families.locate("parameters", int(i))[1] or 0
                for i in np.flatnonzero(parameters.array == 0)
            ]
        else:
            zero = [self._element_of.get(p, 0) for p, number in parameters.items() if number == 0]
        for k in sorted({0, *zero, *self._restitutions(parameters)}):
            try:
                self.definition.field.check_values({s: parameters[own] for s, own in self._of_element(k)})
            except ValueError as error:
                raise ValueError(named(str(error), k)) from None

    def _restitutions(self, parameters):
        """The first element whose contact has none between 0 and 1."""
        template = self.model.families.template
        given = parameters.array if isinstance(parameters, Numbers) else np.array([*parameters.values()], float)
        for _, _, e in self.definition.field.contacts:
            if e.free_symbols <= set(template.model.parameters) and e.free_symbols:
                found = self.model.families.of_parameters(e, given)
                yield from np.flatnonzero(~((found >= 0) & (found <= 1)))[:1].tolist()


def read(rates, time, parameters, outputs, events, contacts, algebraic, sampled, *, view=None, more=()):
    """The `Element` of a system with families, or None where their elements have to be written out.

    `view` makes a field that of a view, with `more` parameters: it gives the field, its smoothing, what multipliers and
    states have become that are gone, and the sigmoid.
    """
    whole = [*rates, *outputs.items()]
    pieces = [e for pair in whole for e in pair if isinstance(e, sp.Basic)]
    if not any(isinstance(e, MemberSum) or involved(e) for e in pieces):
        return None
    one = OneElement()
    try:
        plain = definition.read(rates, time, parameters, outputs, events, contacts, algebraic, sampled, one)
        if plain.controls or len(plain.field.algebraic) > len(plain.algebraic):
            return None  # their parameters, and mobilities, are those of no element
        template = _template(*(view(plain.field) if view else (plain.field,)), one=one)
        families = Families(template, tuple(f.n for f in one.families), one.links())
        far = [families.sizes[p.family] <= abs(p.offset) < LINKED for p in one.places.values()]
        if min(families.sizes) < TEMPLATE_FROM or any(far):
            return None
        model = family_model(families)
        return Element(plain, model, _values(families, one, {**(parameters or {}), **dict(more)}), one.groups)
    except (ValueError, TypeError):
        # Definition errors too: the written-out system raises them again, in the user's names.
        return None


def _values(families, one, numbers):
    """Parameter -> value of the model with families, in the order given."""
    symbols = families.symbols("parameters")
    if isinstance(symbols, Symbols):
        found = symbols.numbers(numbers, "`parameters`", checks.parameter_value)
        if np.isnan(found).any():
            raise ValueError("a parameter has no value")  # told by what writes the elements out
        return Numbers(symbols, found)
    given = spread(numbers, one.groups, "`parameters`")
    values = {key if isinstance(key, str) else key.name: value for key, value in given.items()}
    return {s: checks.parameter_value(s, values[s.name]) for s in symbols}


def _template(field, smoothing=(), gone=(), sigmoid="algebraic", *, one):
    if field.discs:
        raise NoTemplate("a disc")
    places = dict(one.places)
    for s in list(places):
        if isinstance(s, Memory):
            places[lifting.plain(s)] = places.pop(s)
    for R, gap, e in field.contacts:
        if MARK not in R.name:
            raise NoTemplate("a contact of the whole")
        of = {places[s].family for s in gap.free_symbols | e.free_symbols if s in places}
        if len(of) != 1:
            raise NoTemplate("a contact of several families")
        places[R] = Place(of.pop(), R)
    beside = Neighbours(field, places, tuple(f.periodic for f in one.families))
    if told := {s: p for s, p in places.items() if p.base in gone and p.offset}:  # what neighbours had
        absent = {s: beside.absent(p.family, p.offset) for s, p in told.items()}
        values = {s: beside.at(gone[p.base], p.offset) for s, p in told.items()}
        if any(places[s].base in gone for e in values.values() for s in beside.of(e)):
            raise NoTemplate("elements that are slaved to each other")
        values = {
            s: e if absent[s] == 0 else (1 - absent[s]) * e + absent[s] * told[s].outside.xreplace(dict(gone))
            for s, e in values.items()
        }
        field = field.map(lambda e: e.xreplace(values))
        for s in told:
            del places[s]
        beside.take(field)
    beyond = [p.outside for p in places.values() if p.outside is not None]
    if any(e.free_symbols & {*gone} for e in beyond):
        raise NoTemplate("what is gone stands beyond an end")
    for s in gone:
        places.pop(s, None)
    neighbours = {s for s, p in places.items() if p.base != s and p.base is not None}

    def family(*expressions):
        families = {places[s].family for e in expressions for s in e.free_symbols if s in places}
        if len(families) > 1:
            raise NoTemplate("members of several families in one equation")
        return families.pop() if families else None

    renamed = {}
    for lam, h in field.switches:
        if (number := family(h)) is not None:
            # Switches found in ordinary notation are named after their surface or their number.
            renamed[lam] = lam if MARK in lam.name else sp.Symbol(lam.name + MARK, **lam._assumptions_orig)
            places[lam] = places[renamed[lam]] = Place(number, renamed[lam])
    field = field.map(lambda e: e.xreplace(renamed))
    field = replace(field, switches=tuple((renamed.get(lam, lam), h) for lam, h in field.switches))
    beside.take(field)
    field = beside.take_friction()
    neighbours |= beside.of(sp.Tuple(*field.rates))
    watch = tuple(e for e in watched(field, neighbours) if not (smoothing and e.singular == "branch"))
    mirrors = beside.mirrors([h for _, h in field.switches])
    field = replace(
        field,
        switches=tuple((lam, h + beside.none_at_an_end(h)) for lam, h in field.switches),
        events=tuple(
            e if e.surface is None else replace(e, surface=beside.where_there_is_one(e.surface))
            for e in field.events
        ),
    )
    shown = []  # what is gone can be looked at
    for s, e in dict(gone).items():
        mark = MARK if family(e) is not None and MARK not in s.name else ""
        shown.append((s.name + mark, e))
    field = replace(field, outputs=(*field.outputs, *shown))
    event_families = []
    for event in (*field.events, *watch):
        parts = [e for e in (event.surface, event.when, *(e for _, e in event.update)) if e is not None]
        targets = [(*field.states, *field.memories)[i] for i, _ in event.update]
        event_families.append(family(*parts, *targets))
        timed = [e for e in (event.every, *event.at) if e is not None]
        if family(*timed) not in (None, event_families[-1]):
            raise NoTemplate("an event of two families")
        if event in watch and event.surface.free_symbols & neighbours:
            raise NoTemplate("a singular argument between neighbours")
    sums = tuple((s, one.number(f), e) for (s, e), (f, _) in zip(field.sums, one.sums.values(), strict=True))
    for x, rate in (*zip(field.states, field.rates, strict=True), *field.algebraic):
        if family(rate) not in (None, family(x)):
            raise NoTemplate("members outside of their rates")
    if any(h.free_symbols & {s for s, *_ in sums} for h, _ in smoothing):
        raise NoTemplate("a layer around a surface that reads a sum")
    multipliers, more, field, levels = _multipliers(field, sums, places, beside)
    model = lowering.lower(
        replace(field, switches=(), algebraic=(), contacts=()),
        watch=watch,
        smoothing=smoothing,
        sigmoid=sigmoid,
    )
    beyond = [p.outside for p in places.values() if p.outside is not None]
    used = set().union(*(e.free_symbols for e in (*field.expressions(), *beyond)))
    model = replace(
        model,
        multipliers=multipliers,
        parameters=tuple(p for p in field.parameters if p in used),
    )
    return Template(
        model,
        tuple(f.periodic for f in one.families),
        tuple(places.items()),
        (*sums, *more),
        tuple(event_families),
        tuple(family(e) for _, e in field.outputs),
        levels,
        mirrors,
        tuple(family(h) for h, _ in smoothing),
    )


def _check_couplings(multipliers, sums, places, field, hold):
    """The residual of an element must not depend on the multipliers of others: they would all couple.

    But along a chain on the reactions of neighbours and on friction between them, and on what holds a neighbour that it
    touches. Their factors have to stand, in the rates too: products with what a patch reads of others are not made
    (codegen/families/memory.py).
    """
    constant = {
        *field.parameters,
        *(s for s, p in places.items() if p.base is None or p.base in field.parameters),
    }
    solved = {m.symbol for m in multipliers if m.may_be_solved}
    forces = {m.symbol for m in multipliers if m.kind == "contact"} | hold
    switches = {m.symbol for m in multipliers if m.kind == "switch"}
    own, coupled = solved & places.keys(), False
    for m in multipliers:
        if m.symbol not in own:
            continue
        free, allowed = m.residual.free_symbols, forces
        if m.surface is not None and any(places[s].offset for s in m.surface.free_symbols & places.keys()):
            allowed = forces | switches  # what holds the neighbour, too
        for s in free & places.keys():
            if places[s].base not in solved or places[s].base == s:
                continue
            coupled = True
            factors = [
                e.diff(s) for e in (*field.rates, *(m.residual for m in multipliers)) if s in e.free_symbols
            ]
            moving = set().union(*(e.free_symbols for e in factors)) - constant
            if places[s].base not in allowed or places[s].offset >= LINKED or moving:
                raise NoTemplate("elements that act on their neighbours' multipliers")
        waiting, inside = list(free & sums.keys()), set()
        while waiting:
            symbols = sums[waiting.pop()].free_symbols
            inside |= symbols
            waiting += symbols & sums.keys()
        if inside & own:
            raise NoTemplate("elements that act on each other's multipliers")
    if coupled and not solved <= own:
        raise NoTemplate("contacts between elements beside multipliers of the whole")


def _multipliers(field, sums, places, beside):
    """Switches and algebraic unknowns of the template, the sums' derivatives that their residuals need, and the field
    with hidden static friction as two levels."""
    inner = {s: e for s, _, e in sums}
    family = {s: f for s, f, _ in sums}
    more: dict[sp.Symbol, tuple[int, sp.Expr]] = {}
    unknowns = {a for a, _ in field.algebraic}

    def along(e):
        """de/dt along the field; the derivative of a sum is a sum."""
        result = total_derivative(e, field.time, field.states, field.rates)
        for s in sorted(e.free_symbols & inner.keys(), key=str):
            d = along(inner[s])
            if d != 0:
                ds = sp.Symbol(f"d{s.name}", real=True)
                more[ds] = family[s], d
                result += e.diff(s) * ds
        return result

    def sampled(e):
        """A sum as that of one element and of others, of which nothing is known."""
        while found := e.free_symbols & (inner.keys() | more.keys()):
            e = e.xreplace({
                s: (inner[s] if s in inner else more[s][1]) + sp.Symbol(f"rest of {s.name}", real=True) for s in found
            })  # fmt: skip
        return e

    def extended(h):
        """The field with the neighbours that a surface reads among the states."""
        others = sorted((s for s in beside.of(h) if places[s].base in beside.rate), key=str)
        more = tuple(sampled(beside.rate_of(s, known=False)) for s in others)
        return replace(lone, states=(*lone.states, *others), rates=(*lone.rates, *more)) if others else lone

    residuals = [h if unknowns & sampled(h).free_symbols else along(h) for _, h in field.switches]
    lone = replace(
        field,
        rates=tuple(map(sampled, field.rates)),
        switches=tuple((lam, sampled(h)) for lam, h in field.switches),
        algebraic=tuple((a, sampled(r)) for a, r in field.algebraic),
    )
    result: list[Multiplier] = []
    levels: list[Level] = []
    for index, ((lam, h), residual) in enumerate(zip(field.switches, residuals, strict=True)):
        if beside.of(h):
            ends = {s: sp.S.Zero for s, p in places.items() if p.base is None and p.offset}
            between = _between(extended(h), index, unknowns, ends)
            if between.regularity == "sliding" and lam not in beside.hold:
                raise NoTemplate("a switch that can hold neighbours together")
            result.append(replace(between, residual=beside.along(h) if between.may_be_solved else sp.S.Zero))
            continue
        regularity, hidden = lowering.classify(lone, index, sampled(residual))
        if hidden and regularity == "sliding":
            level = _level(field, index, residual)
            levels.append(level)
            stuck, moving = _two_levels(lam, h, level)
            residual, hidden = stuck(residual), False
            field = replace(field, rates=tuple(map(moving, field.rates)))
        if regularity == "crossing" and second_derivative(lone, index, sampled(residual)) is not None:
            raise NoTemplate("a switch that can slide to second order")
        result.append(
            Multiplier(lam, "switch", residual, h, regularity, hidden, at_zero=field.at_zero.get(lam))
        )
    order = (*field.states, *field.memories)
    for R, gap, e in field.contacts:
        if beside.of(gap):
            contact = beside.contact(R, gap, e, order)
            result.append(replace(contact, surface=beside.where_there_is_one(gap)))
            continue
        speed = total_derivative(gap, field.time, field.states, field.rates)
        if beside.of(speed) or speed.free_symbols & inner.keys():
            raise NoTemplate("a contact whose gap moves with other elements")
        residual, after = lowering.contact(field, R, gap, e)
        after = tuple((i, new) for i, (old, new) in enumerate(zip(order, after, strict=True)) if new != old)
        result.append(Multiplier(R, "contact", residual, gap, impact=after))
    result += [Multiplier(a, "algebraic", r) for a, r in field.algebraic]
    _check_couplings(result, inner | {s: e for s, (_, e) in more.items()}, places, field, beside.hold)
    return tuple(result), tuple((s, f, e) for s, (f, e) in more.items()), field, tuple(levels)


def _between(field, index, unknowns, ends):
    """The Multiplier of a switch whose surface reads neighbours, without its residual.

    It is what it is where there is a neighbour: at the `ends` there is nothing to switch.
    """
    lam, h = field.switches[index]
    field = field.map(lambda e: e.xreplace(ends))
    if h.free_symbols & unknowns or sum(s in h.free_symbols for s in field.states) < 2:
        raise NoTemplate("a surface between neighbours that is no matter of two motions")
    residual = total_derivative(field.switches[index][1], field.time, field.states, field.rates)
    regularity, hidden = lowering.classify(field, index, residual)
    if hidden or (regularity == "crossing" and second_derivative(field, index, residual) is not None):
        raise NoTemplate("a switch that can hold neighbours together")
    return Multiplier(lam, "switch", sp.S.Zero, h, regularity, at_zero=field.at_zero.get(lam))


def _cubic(e, lam):
    """(e_1, e_3) of e = e_0 + e_1 lambda + e_3 lambda^3, or NoTemplate."""
    try:
        powers = sp.Poly(e, lam).as_dict()
    except sp.PolynomialError:
        powers = {(2,): e}
    if not powers.keys() <= {(0,), (1,), (3,)} or (1,) not in powers:
        raise NoTemplate("a hidden term on a surface that slides")
    return powers[1,], powers.get((3,), sp.S.Zero)


def _masked(e, lam, h):
    """An expression without what lambda selects off its surface h = 0 alone, such as |v - V|, and what that was."""
    masks = {}
    for choice in e.atoms(Select):
        if choice.args[0] == lam:
            x = next((s for s in sorted(h.free_symbols, key=str) if sp.diff(h, s).is_number), None)
            _, above, below = choice.args
            on_surface = None if x is None else (above - below).subs(x, sp.solve(h, x)[0])
            if on_surface is None or sp.expand(on_surface) != 0:
                raise NoTemplate("a hidden term beside a force that jumps")
            masks[choice] = sp.Dummy(real=True)
    return e.xreplace(masks), {mask: choice for choice, mask in masks.items()}


def _level(field, index, residual):
    """The two levels of a switch whose force is c (lambda + q lambda^3) wherever it stands; else NoTemplate."""
    lam, surface = field.switches[index]
    elsewhere = [*(h for _, h in field.switches), *(r for _, r in field.algebraic)]
    elsewhere += [
        e for event in field.events for e in (event.surface, event.when, *(e for _, e in event.update)) if e
    ]
    masked = [_masked(e, lam, surface)[0] for e in (*field.rates, residual)]
    parts = [_cubic(e, lam) for e in masked if lam in e.free_symbols]
    shares = {sp.cancel(e3 / e1) for e1, e3 in parts}
    if any(lam in e.free_symbols for e in elsewhere) or len(shares) != 1:
        raise NoTemplate("a hidden term on a surface that slides")
    (q,) = shares
    if not q.free_symbols <= set(field.parameters):
        raise NoTemplate("a hidden term whose share moves")
    # The largest of lambda + q lambda^3: at the fold, where there is one inside of the bounds.
    fold = sp.Rational(2, 3) * sp.sqrt(sp.cancel(-1 / (3 * q)))
    return Level(index, q, sp.Piecewise((fold, 1 + 3 * q < 0), (1 + q, True)))


def _two_levels(lam, h, level):
    """How an expression changes: a residual, which knows the stick alone, and a rate."""

    def changed(e, factor):
        if lam not in e.free_symbols:
            return e
        e, masks = _masked(e, lam, h)
        if lam not in e.free_symbols:
            return e.xreplace(masks)
        return (e.subs(lam, 0) + _cubic(e, lam)[0] * lam * factor).xreplace(masks)

    both = Held(lam, level.slip, level.peak)
    return lambda e: changed(e, level.peak), lambda e: changed(e, both)
