"""Lowering: the lifted system -> `Model`.

    switch     g = dh/dt, or d2h/dt2 where lambda first stands there
    disc       g_i = dh_i/dt of its components
    contact    g = d2h/dt2;   impact  x+ = x + (df/dR) J  with the J that makes  h'+ = -e h'-
    algebraic  g as given

Chain: lifting.py, regularity.py -> lowering (here) -> system.py; the result is the input of codegen.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import sympy as sp

from .discs import LiftedDisc, is_affine
from .model import EventSpec, Model, Multiplier, of_event
from .pointwise import draw, value
from .regularity import (
    POINTS,
    TOLERANCE,
    beside_kinks,
    classify,
    residual_of,
    second_derivative,
    total_derivative,
    without_unknowns,
)
from .singular import watched

_MOST_BY_VALUES = 64  # switches of a field that are classed anew at other values of parameters


@dataclass(frozen=True)
class Field:
    """A lifted system: plain symbols, multipliers and selections only."""

    time: sp.Symbol
    states: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    parameters: tuple[sp.Symbol, ...]
    memories: tuple[sp.Symbol, ...] = ()
    switches: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()
    discs: tuple[LiftedDisc, ...] = ()
    contacts: tuple[tuple[sp.Symbol, sp.Expr, sp.Expr], ...] = ()  # R, gap, restitution
    algebraic: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()
    events: tuple[EventSpec, ...] = ()
    outputs: tuple[tuple[str, sp.Expr], ...] = ()
    initial_memory: tuple[float, ...] = ()
    typical: tuple[float, ...] = ()  # of the parameters: the size and order that they have
    members: dict[sp.Symbol, tuple[str, int]] = field(default_factory=dict)  # members of families
    sums: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()  # over families that are not written out
    # Of switches, as that of a Multiplier.
    at_zero: dict[sp.Symbol, int | sp.Expr] = field(default_factory=dict)

    def expressions(self):
        """All expressions whose symbols must be known."""
        yield from self.rates
        yield from (h for _, h in self.switches)
        yield from (h for disc in self.discs for h in disc.surfaces)
        for _, gap, e in self.contacts:
            yield from (gap, e)
        yield from (r for _, r in self.algebraic)
        yield from (e for _, e in (*self.outputs, *self.sums))
        for event in self.events:
            yield from of_event(event)

    @cached_property
    def by_multiplier(self):
        """Multiplier -> rates and algebraic residuals in which it stands."""
        places: dict[sp.Symbol, list[sp.Expr]] = {lam: [] for lam, _ in self.switches}
        for e in dict.fromkeys((*self.rates, *(r for _, r in self.algebraic))):
            for s in e.free_symbols:
                if s in places:
                    places[s].append(e)
        return places

    @cached_property
    def _divisors(self):
        """(state, base, its symbols) of the powers of parameters alone that divide a rate."""
        own, found = set(self.parameters), []
        for x, rate in zip(self.states, self.rates):
            for base, exponent in (power.args for power in rate.atoms(sp.Pow)):
                if base.free_symbols and base.free_symbols <= own and exponent.is_negative:
                    found.append((x, base, base.free_symbols))
        return found

    @cached_property
    def _fast(self):
        """(state, base) -> what `_is_fast` found: asked where a divisor is refused, which a slider may do often."""
        return {}

    def _is_fast(self, x, base):
        """Whether a state sits inside the layer where `base`, which divides its whole rate, vanishes.

        Its rate has multipliers, it stands in none of their surfaces, and with them in a rate (a hidden term).
        """
        if (x, base) not in self._fast:
            self._fast[x, base] = self._looks_fast(x, base)
        return self._fast[x, base]

    def _looks_fast(self, x, base):
        rate = self.rates[self.states.index(x)]
        lams = {lam for lam, _ in self.switches} & rate.free_symbols
        if not base.is_Symbol or (rate * base).expand().diff(base) != 0:
            return False
        if not lams or any(x in h.free_symbols for _, h in self.switches):
            return False
        return any(sp.expand(other.diff(x, lam)) != 0 for other in self.rates for lam in lams)

    @cached_property
    def _restitutions(self):
        own = set(self.parameters)
        return [(R, e) for R, _, e in self.contacts if e.free_symbols <= own]

    @cached_property
    def bounds_values(self):
        """Whether `check_values` has anything to check."""
        periods = [event.every for event in self.events if event.every is not None]
        return bool(self._divisors or self._restitutions or periods)

    def check_values(self, parameters):
        """What values of parameters must satisfy beyond the assumptions of their symbols, or a ValueError."""
        # Sliders and fits come here at every move: expressions are walked through once.
        zero = {p for p, number in parameters.items() if number == 0}
        for x, base, symbols in self._divisors if zero else ():
            if symbols & zero and value(base, parameters) == 0:
                named = " and ".join(f"{p.name!r} is 0" for p in sorted(symbols & zero, key=str))
                view = f", or take the view in which it vanishes, system.layered({{{x}: sympy.oo}})"
                raise ValueError(
                    f"`parameters`: {named}, and the rate of {x.name!r} divides by {base}; give another value"
                    f"{view if self._is_fast(x, base) else ''}."
                )
        for event in self.events:
            if event.every is not None and not (every := value(event.every, parameters)) > 0:
                raise ValueError(
                    f"`every` of event {event.name!r} is {event.every} = {every}; give a period > 0."
                )
        for R, e in self._restitutions:
            if not 0 <= (at := value(e, parameters)) <= 1:
                raise ValueError(f"the restitution {e} of contact {R.name!r} is {at}; give 0 <= e <= 1.")

    def switches_of(self, expressions):
        """The switches that stand in expressions or in surfaces of these, the inner ones first."""
        needed = set().union(*(e.free_symbols for e in expressions))
        result = []
        for lam, h in reversed(self.switches):
            if lam in needed:
                needed |= h.free_symbols
                result.append((lam, h))
        return result[::-1]

    @cached_property
    def memory_values(self):
        """Memory -> values that it is seen to take."""
        values = {m: {0.0, 1.0, v} for m, v in zip(self.memories, self.initial_memory, strict=True)}
        n = len(self.states)
        for event in self.events:
            for i, e in event.update:
                if i >= n and e.is_number:
                    values[self.memories[i - n]].add(float(e))
        return {m: tuple(sorted(v)) for m, v in values.items()}

    def map(self, change, **fields):
        """This field with `change` applied to every expression, and other fields replaced."""
        events = tuple(
            replace(
                event,
                surface=None if event.surface is None else change(event.surface),
                when=change(event.when),
                update=tuple((i, change(e)) for i, e in event.update),
            )
            for event in self.events
        )
        mapped = {
            "rates": tuple(map(change, self.rates)),
            "switches": tuple((s, change(h)) for s, h in self.switches),
            "discs": tuple(disc.map(change) for disc in self.discs),
            "contacts": tuple((s, change(gap), change(e)) for s, gap, e in self.contacts),
            "algebraic": tuple((s, change(r)) for s, r in self.algebraic),
            "outputs": tuple((name, change(e)) for name, e in self.outputs),
            "sums": tuple((s, change(e)) for s, e in self.sums),
            "at_zero": {s: change(e) if isinstance(e, sp.Expr) else e for s, e in self.at_zero.items()},
            "events": events,
        }
        return replace(self, **(mapped | fields))


def multipliers(field):
    """Switches, contacts and algebraic unknowns of a field, with their residuals."""
    result = []
    classes: dict[sp.Expr, tuple] = {}
    patterns: dict[sp.Symbol, sp.Expr] = {}
    for index, (lam, h) in enumerate(field.switches):
        residual = residual_of(field, index)
        pattern = patterns[lam] = _pattern(h, field.members, patterns)
        if pattern not in classes:
            classes[pattern] = classify(field, index, residual)
        regularity, hidden = classes[pattern]
        if regularity == "crossing" and residual == h:  # of unknowns that lambda does not move, but their rates
            h, residual, regularity, hidden = _by_rates(field, index)
        second = second_derivative(field, index, residual) if regularity == "crossing" else None
        at_zero = field.at_zero.get(lam)
        result.append(
            Multiplier(lam, "switch", residual, h, regularity, hidden, second=second, at_zero=at_zero)
        )
    kinks = [(m.symbol, m.surface) for m in result if m.regularity == "kink"]
    for index, m in enumerate(result):
        if kinks and m.regularity == "sliding" and not m.hidden:
            result[index] = replace(m, beside=beside_kinks(field, index, m.residual, kinks))
    for disc in field.discs:
        result += _of_disc(field, disc)
    for R, gap, restitution in field.contacts:
        residual, impact = contact(field, R, gap, restitution)
        result.append(Multiplier(R, "contact", residual, gap, impact=impact))
    result += [Multiplier(a, "algebraic", residual) for a, residual in field.algebraic]
    return tuple(result)


class ModelsByValues:
    """The models of a field by values of its parameters: those switches can hold the motion that can at these values.

    Of  x < a and x < b  the smaller threshold holds, which the values tell. `model` is that of the field as it is.
    """

    def __init__(self, field, model):
        self._field, self._models, self._here = field, {None: model}, _holding(field)
        self._last: tuple[tuple[float, ...], Model] | None = None

    @classmethod
    def where_they_tell(cls, field, model):
        """Those of a field in which values can tell, else None."""
        if len(field.switches) > _MOST_BY_VALUES:
            return None
        found = cls(field, model)
        return None if _holding(replace(field, typical=())) <= found._here else found

    def __contains__(self, model):
        return any(model is other for other in self._models.values())

    def at(self, parameters):
        """The model in which switches can hold that can at these values, or that of the field if it lets them."""
        values = tuple(parameters[p] for p in self._field.parameters)
        last = self._last  # read once: another thread may ask at other values
        if last is None or last[0] != values:
            last = self._last = values, self._at(replace(self._field, typical=values))
        return last[1]

    def _at(self, there):
        if (holding := _holding(there)) <= self._here:
            return self._models[None]
        if holding not in self._models:
            self._models[holding] = lower(there)
        return self._models[holding]


def _holding(field):
    """The switches that can hold the motion."""
    return frozenset(m.symbol for m in multipliers(field) if m.kind == "switch" and m.may_be_solved)


def _by_rates(field, index):
    """(surface, residual, class, hidden) of a switch of unknowns: by states alone where it may hold them so."""
    lam, h = field.switches[index]
    surface = without_unknowns(field, h)
    if surface is not None and lam not in surface.free_symbols:
        switches = (*field.switches[:index], (lam, surface), *field.switches[index + 1 :])
        explicit = replace(field, switches=switches)
        residual = residual_of(explicit, index)
        regularity, hidden = classify(explicit, index, residual)
        if regularity == "sliding":
            return surface, residual, regularity, hidden
    return h, h, "crossing", False


def _of_disc(field, disc):
    """The multiplier of a disc, lambda . lambda, and those of its components."""
    square = sp.Add(*(lam**2 for lam in disc.components))
    rates = [total_derivative(h, field.time, field.states, field.rates) for h in disc.surfaces]
    inside = (*rates, *(r for _, r in field.algebraic))
    hidden = not all(is_affine(e, disc.components) for e in inside)
    regularity = _regularity(field, disc, rates)
    return [
        Multiplier(disc.symbol, "disc", disc.symbol - square, disc.square, regularity),
        *(
            Multiplier(lam, "component", g, h, hidden=hidden)
            for lam, g, h in zip(disc.components, rates, disc.surfaces, strict=True)
        ),
    ]


def _regularity(field, disc, rates):
    """Whether the multiplier can hold its surfaces ("sliding"), or stands in nothing but |h| ("kink"); else refused."""
    lams, unknowns = disc.components, [a for a, _ in field.algebraic]
    residuals = [r for _, r in field.algebraic]
    tables = [sp.Matrix(len(es), len(by), [e.diff(s) for e in es for s in by])
              for es, by in ((rates, lams), (rates, unknowns), (residuals, unknowns), (residuals, lams),
                             ((*field.rates, *residuals), lams))]  # fmt: skip
    symbols = set().union(*(e.free_symbols for e in (*disc.surfaces, *(e for table in tables for e in table))))
    can_hold, jump = False, math.inf
    for k in range(POINTS):
        point = _on_surfaces(disc.surfaces, field.states, {s: draw(s, k) for s in symbols})
        G, G_a, A, A_lam, jumps = (np.array([value(e, point) for e in t]).reshape(t.shape) for t in tables)
        if not all(np.isfinite(t).all() for t in (G, G_a, A, A_lam, jumps)):
            continue
        with contextlib.suppress(np.linalg.LinAlgError):
            J = G - G_a @ np.linalg.solve(A, A_lam) if unknowns else G
            can_hold = can_hold or np.linalg.matrix_rank(J) == len(rates)
            jump = max(0.0 if jump == math.inf else jump, np.abs(jumps).max())
    if can_hold:
        return "sliding"
    if jump < TOLERANCE:
        return "kink"
    shown = ", ".join(f"d({h})/dt = {g}" for h, g in zip(disc.surfaces, rates, strict=True))
    raise ValueError(
        f"disc {disc.symbol} cannot hold its surfaces at 0: {shown} do not depend on all of its components "
        f"{', '.join(map(str, disc.components))}. Give independent velocities on whose rates every component acts."
    )


def _on_surfaces(surfaces, states, point):
    """A point moved onto h = 0, as near as Newton's method comes in a few steps."""
    coordinates = [x for x in states if any(x in h.free_symbols for h in surfaces)]
    gradient = [h.diff(x) for h in surfaces for x in coordinates]
    for _ in range(8):
        h = np.array([value(e, point) for e in surfaces])
        Dh = np.array([value(e, point) for e in gradient]).reshape(len(surfaces), -1)
        if not (np.isfinite(h).all() and np.isfinite(Dh).all()) or not coordinates:
            break
        move = np.linalg.lstsq(Dh, h, rcond=None)[0]
        point = point | {x: point[x] - float(d) for x, d in zip(coordinates, move, strict=True)}
    return point


def _slips_shown(field, m):
    """A multiplier whose expressions show the slip of every disc but its own."""
    discs = [disc for disc in field.discs if m.symbol not in (disc.symbol, *disc.components)]
    if not discs:
        return m
    change = _showing(discs)
    impact = m.impact and tuple(map(change, m.impact))
    second, beside = (e if e is None else change(e) for e in (m.second, m.beside))
    return replace(m, residual=change(m.residual), impact=impact, second=second, beside=beside)


def _showing(discs):
    """The change of expressions that shows, off h = 0, the direction of slip of these discs."""

    def change(e):
        for disc in discs:
            e = disc.shown(e)
        return e

    return change


def _pattern(h, members, patterns):
    """A surface with the members of a family counted from the first one in it: the same in all elements."""
    inside = {s: members[s] for s in h.free_symbols if s in members}
    if not inside:
        return h
    first = min(k for _, k in inside.values())
    general = {s: sp.Symbol(f"{name}[{k - first}]") for s, (name, k) in inside.items()}
    inner = {s: sp.Symbol(f"sign({patterns[s]})") for s in h.free_symbols if s in patterns}
    return h.xreplace(general | inner)


def contact(field, R, gap, restitution):
    """(d2h/dt2, state after an impact) of a unilateral contact."""
    speed = total_derivative(gap, field.time, field.states, field.rates)
    if R in speed.free_symbols:
        raise ValueError(
            f"the reaction {R} of the contact with gap {gap} stands in the gap's first derivative {speed}. "
            "A reaction acts on velocities: give a gap between positions."
        )
    acceleration = total_derivative(speed, field.time, field.states, field.rates)
    push = [f.diff(R) for f in field.rates]
    if R not in acceleration.free_symbols:
        raise ValueError(
            f"the reaction {R} does not stand in the second derivative {acceleration} of its gap {gap}. "
            f"Add {R} to the rate of the velocity on which the contact acts."
        )
    if any(R in b.free_symbols for b in push):
        raise ValueError(
            f"the rates are not linear in the reaction {R}: an impact has no finite impulse then. Let {R} stand as a "
            "force does, with a factor that does not contain it."
        )
    # Newton's law. Friction in the push has the lambda that the impact gives it (kernels/instant/impacts.py).
    along = sp.Add(*(speed.diff(x) * b for x, b in zip(field.states, push, strict=True)))
    stop = [b * speed / along for b in push]  # what takes dh/dt away; e times it gives the rebound
    after = [
        _multiplied_out(x - s) - restitution * _multiplied_out(s) if s != 0 else x
        for x, s in zip(field.states, stop, strict=True)
    ]
    return acceleration, (*after, *field.memories)


def _multiplied_out(e):
    """`e` expanded, so that terms cancel exactly (v - v); not a mechanism's rates, of which 1e5 terms would come."""
    return sp.expand(e) if sp.count_ops(e) <= 60 else e


def lower(
    field,
    *,
    watch=None,
    layer=(),
    layer_field=None,
    eps_ratio=None,
    sigmoid="algebraic",
    smoothing=(),
    extra=(),
):
    """The `Model` of a field; `extra` are the parameters that its view brings, `watch` its singular arguments."""
    if watch is None:
        # A smoothed field comes to rest on a branch point, within the width of its layer: nothing to watch there.
        watch = tuple(e for e in watched(field) if not (smoothing and e.singular == "branch"))
    multiplier = tuple(_slips_shown(field, m) for m in multipliers(field))
    if field.discs:
        components = tuple((lam.name, lam) for disc in field.discs for lam in disc.components)
        field = replace(field, outputs=(*field.outputs, *components)).map(
            _showing(field.discs), discs=field.discs
        )
    layer_residuals = (
        tuple(_slips_shown(layer_field, m).condition for m in multipliers(layer_field)) if layer_field else ()
    )
    ratios = eps_ratio or {}
    model = Model(
        time=field.time,
        states=(*field.states, *field.memories),
        parameters=(),
        rhs=(*field.rates, *(sp.S.Zero for _ in field.memories)),
        multipliers=multiplier,
        events=(*field.events, *watch),
        outputs=field.outputs,
        n_memory=len(field.memories),
        layer_states=tuple(layer),
        layer_residuals=layer_residuals,
        eps_ratio=tuple(ratios.get(m.symbol, 1.0) for m in multiplier),
        sigmoid=sigmoid,
        smoothing=tuple(smoothing),
    )
    used = set().union(*(e.free_symbols for e in _all_expressions(field, model)))
    return replace(model, parameters=tuple(p for p in (*field.parameters, *extra) if p in used))


def _all_expressions(field, model):
    yield from field.expressions()
    yield from (s.rate for s in model.layer_states)
    yield from (sp.sympify(s.ratio, strict=True) for s in model.layer_states)
    for h, eps in model.smoothing:
        yield from (h, eps)
    yield from model.layer_residuals
