"""Views: fields derived from a lifted one.

    smoothed   lambda_j -> Lambda(h_j/eps_j)
    layered    z leaves the states: at equilibrium in slow time, dz/dtau = ratio Q in the layer (tau = t/eps)
    filippov   the convex combination of both sides in place of what is nonlinear in lambda

Chain: lowering.py (Field) -> views (here) -> system.py.
"""

from __future__ import annotations

from dataclasses import replace
from math import isnan

import sympy as sp

from . import sigmoids
from .discs import convex
from .model import LayerState, Select
from .pointwise import draw, value
from .regularity import affine_in, classify, residual_of


def substitutes(system):
    """Name -> expression of what left the equations of a view: slaved states, and smoothed switches Lambda(h/eps)."""
    model = system.model
    named = {str(layer.symbol): layer.equilibrium for layer in model.layer_states}
    widths = dict(model.smoothing)
    sigmoid = sigmoids.sigmoid(model.sigmoid)
    for switch in system.switches if widths else ():
        if switch.surface in widths:
            named[str(switch)] = sp.sympify(sigmoid.smooth(switch.surface, widths[switch.surface]), strict=True)
    for disc in system.discs if widths else ():
        for lam, h in zip(disc, disc.surfaces, strict=True):
            if h in widths:
                named[str(lam)] = sigmoid.smooth_component(h, disc.surfaces, widths[h])
    return named


def smoothed(field, sigmoid, eps):
    """(field without switches, smoothing, values of the multipliers): lambda_j -> Lambda(h_j/eps_j), `eps` by lambda.

    Selections take their affine form, kinks too: that keeps the field analytic, as series and implicit
    steps want it, at a distance O(eps) from the original. Only a kink with a branch that does not exist on
    the other side (delta**1.5 for delta < 0) goes on selecting; its surface stays in `smoothing`, because it
    must not be stepped over either.
    """
    blend = _Blend(field)
    smoothing = []
    for index, (lam, surface) in enumerate(field.switches):
        h = blend(surface)
        one_sided = [s for s in blend.selections[lam] if _one_sided(field, s, surface)]
        if one_sided and classify(field, index, residual_of(field, index))[0] != "kink":
            raise ValueError(
                f"the field jumps across {surface} = 0, and one of its branches {one_sided[0].args[1]} and "
                f"{one_sided[0].args[2]} does not exist on the other side: there is nothing to blend. Continue "
                "that branch beyond the surface, with Max(0, ...) for example."
            )
        blend.add(lam, sigmoid.smooth(h, eps[lam]), dict.fromkeys(one_sided, h))
        smoothing.append((h, eps[lam]))
    for disc in field.discs:
        surfaces = tuple(map(blend, disc.surfaces))
        for lam, h in zip(disc.components, surfaces, strict=True):
            blend.add(lam, sigmoid.smooth_component(h, surfaces, eps[disc.symbol]), {})
            smoothing.append((h, eps[disc.symbol]))
    return field.map(blend, switches=(), discs=()), tuple(smoothing), blend.values


class _Blend:
    """Expressions with multipliers replaced by their smooth values, from the innermost selection outwards."""

    def __init__(self, field):
        self.selections: dict[sp.Symbol, list[Select]] = {lam: [] for lam, _ in field.switches}
        for s in sorted(set().union(*(e.atoms(Select) for e in field.expressions())), key=sp.default_sort_key):
            self.selections[s.args[0]].append(s)
        self.values, self._cases, self._memo = {}, {}, {}

    def add(self, lam, smooth, cases):
        """From now on `lam` is replaced; the selections `cases` go on selecting, by the sign of their h."""
        self.values[lam] = smooth
        self._cases.update(cases)
        self._memo.clear()

    def __call__(self, e):
        if e not in self._memo:
            self._memo[e] = self._replaced(e)
        return self._memo[e]

    def _replaced(self, e):
        if e in self.values:
            return self.values[e]
        if not e.args or e.free_symbols.isdisjoint(self.values):
            return e
        if not isinstance(e, Select):
            return e.func(*map(self, e.args))
        lam, above, below = e.args
        a, b = self(above), self(below)
        if e in self._cases:
            return sp.Piecewise((a, self._cases[e] > 0), (b, True), evaluate=False)
        return (a + b) / 2 + self.values[lam] * (a - b) / 2 if lam in self.values else Select(lam, a, b)


def _one_sided(field, select, h):
    """Does a branch exist where it acts, but not everywhere where the other one does?"""
    switches = field.switches_of([select, h])
    symbols = set().union(select.free_symbols, *(s.free_symbols for _, s in switches))
    lost, own = [False, False], [False, False]
    for k in range(24):
        point = {s: draw(s, k) for s in symbols}
        for lam, surface in switches:
            point[lam] = 1.0 if value(surface, point) > 0 else -1.0
        active = 0 if value(h, point) > 0 else 1
        for branch in (0, 1):
            # An argument that is out of range on both sides (sqrt(1 - x**2)) does not concern this surface.
            missing = isnan(value(select.args[1 + branch], point))
            (own if branch == active else lost)[branch] |= missing
    return any(gone and not at_home for gone, at_home in zip(lost, own, strict=True))


def layered(field, ratios, constants):
    """(slow field, layer field, layer states) of a view in which the states `ratios` are layered.

    `ratios` maps z to sp.oo, 0 or the parameter symbol of a finite ratio, `constants` to its time constant.
    """
    for z in ratios:
        places = [(f"the surface of {s}", h) for s, h in field.switches]
        places += [(f"the gap of {R}", gap) for R, gap, _ in field.contacts]
        for what, e in places:
            if z in e.free_symbols:
                raise ValueError(
                    f"`layered` names {z}, but {what} is {e}: it would move within its own layer. Keep it slow."
                )
        for event in field.events:
            if any(field.states[i : i + 1] == (z,) for i, _ in event.update):
                raise ValueError(
                    f"`layered` names {z}, which event {event.name!r} updates; a layered state is no state of "
                    "the view. Drop the update or keep the state slow."
                )
    rates = dict(zip(field.states, field.rates, strict=True))
    layer = {z: _cancelled(rates[z], constants[z]) for z in ratios}
    equilibrium = _equilibrium(layer) if layer else {}
    free = without(field, ratios)
    states = tuple(
        LayerState(z, sp.sympify(r, strict=True), layer[z], equilibrium[z]) for z, r in ratios.items()
    )
    return free.map(lambda e: e.xreplace(equilibrium)), free, states


def unlayered(field, layer, eps):
    """The field to be smoothed of a layered view: a finite ratio r is the time constant eps/r."""
    if any(s.ratio == 0 for s in layer):
        raise ValueError(
            "`smoothed` of a view with ratio 0: the two-stage limit has no smooth stand-in. Smooth the "
            "original system with eps well below its time constant."
        )
    finite = {s.symbol: s.ratio * s.rate / eps for s in layer if s.ratio != sp.oo}
    slaved = {s.symbol: s.rate for s in layer if s.ratio == sp.oo}
    equilibrium = _equilibrium(slaved) if slaved else {}
    rates = dict(zip(field.states, field.rates, strict=True)) | finite
    fast = replace(field, rates=tuple(rates[x] for x in field.states))
    return without(fast, slaved).map(lambda e: e.xreplace(equilibrium))


def without(field, gone):
    """The field without the states `gone`, which stay free symbols of the expressions."""
    remaining = [x for x in (*field.states, *field.memories) if x not in gone]
    before = (*field.states, *field.memories)
    return replace(
        field,
        states=tuple(x for x in field.states if x not in gone),
        rates=tuple(f for x, f in zip(field.states, field.rates, strict=True) if x not in gone),
        events=tuple(
            replace(event, update=tuple((remaining.index(before[i]), e) for i, e in event.update))
            for event in field.events
        ),
    )


def _cancelled(rate, beta):
    """beta*rate without beta where it divides the whole rate."""
    product = sp.expand(rate * beta)
    if beta.is_Symbol and beta in product.free_symbols:
        product = sp.cancel(rate * beta)
    return product


def time_constant(z, rate, parameters):
    """beta with beta*rate free of beta: a parameter, else the number -1/(d rate/dz); ValueError for none or several."""
    candidates = sorted((p for p in parameters if p in rate.free_symbols), key=lambda p: p.name)
    constants = [p for p in candidates if sp.expand((rate * p).expand().diff(p)) == 0]
    if len(constants) == 1:
        return constants[0]
    if constants:
        raise ValueError(
            f"the time constant of {z} is not unique: {', '.join(map(str, constants))} all divide its rate {rate}. "
            f"Choose with time_constant={{{z}: ...}}, or write their product as one parameter."
        )
    slope = sp.expand(rate.diff(z))
    if slope.is_number and slope.is_negative:
        return -1 / slope
    raise ValueError(
        f"{z} has no time constant: no parameter beta divides its whole rate {rate}. Write the rate as "
        f"(...)/beta with a parameter beta, or give time_constant={{{z}: ...}}."
    )


def _equilibrium(rates):
    """State -> value at which all of these rates vanish."""
    symbols = list(rates)
    if all(q.diff(z).free_symbols.isdisjoint(symbols) for q in rates.values() for z in symbols):
        matrix = sp.Matrix([[sp.expand(q.diff(z)) for z in symbols] for q in rates.values()])
        constant = sp.Matrix([q.xreplace(dict.fromkeys(symbols, sp.S.Zero)) for q in rates.values()])
        if matrix.det() != 0:
            solution = -matrix.inv() * constant
            return {z: sp.expand(e) for z, e in zip(symbols, solution, strict=True)}
    try:
        found = sp.solve(list(rates.values()), symbols, dict=True)
    except NotImplementedError:
        found = []
    if len(found) != 1 or set(found[0]) != set(symbols):
        names, equations = (", ".join(map(str, e)) for e in (symbols, rates.values()))
        raise ValueError(
            f"the equilibrium of {names} is not unique: {len(found) or 'no'} solutions of {equations} = 0 were "
            "found. Keep it a slow state with a small time constant."
        )
    return found[0]


def hidden_part(e, lam):
    """The part of `e` that is nonlinear in a multiplier: e minus its convex combination (Filippov's)."""
    e = affine_in(e, lam)
    above, below = e.xreplace({lam: sp.S.One}), e.xreplace({lam: sp.S.NegativeOne})
    return sp.expand(e - (above + below) / 2 - lam * (above - below) / 2)


def filippov(field):
    """The field with terms nonlinear in a multiplier replaced by their convex combination."""

    def change(e):
        for lam, _ in field.switches:
            if lam in e.free_symbols and hidden_part(e, lam) != 0:
                e = Select(lam, e.xreplace({lam: sp.S.One}), e.xreplace({lam: sp.S.NegativeOne}))
        for disc in field.discs:
            e = convex(e, disc)
        return e

    return replace(
        field,
        rates=tuple(map(change, field.rates)),
        algebraic=tuple((a, change(r)) for a, r in field.algebraic),
        outputs=tuple((name, change(e)) for name, e in field.outputs),
    )
