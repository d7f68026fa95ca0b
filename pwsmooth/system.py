"""System: one definition and its views. Start reading here.

    dx/dt = f(t, x, lambda; p),   lambda_j = sign h_j(t, x) off the surface h_j = 0, in [-1, 1] on it

A user writes f in ordinary notation: with Switch symbols where a term lives on the surface alone (hidden
terms), with sign, Abs, Max, Piecewise, ... where not. The system finds the switches, and its views derive from
the one definition:

    system                                    exact: event-driven, hidden terms kept
    system.layered({z: r})                    z so fast that it moves inside the layer
    system.smoothed(eps=1e-3, sigmoid="erf")  the stiff smooth stand-in

Chain: primitives.py (what can be said) -> lifting.py (notation to switches) -> regularity.py (their classes)
-> lowering.py and views.py -> `system.model`, which codegen compiles.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import sympy as sp

from . import checks
from .describe import html, text
from .lifting import Lifting, plain
from .lowering import Field, lower
from .model import EventSpec
from .primitives import Algebraic, Event, Memory, Switch
from .regularity import Surface
from .sigmoids import sigmoid as sigmoid_of
from .views import filippov, hidden_part, layered, smoothed, time_constant, unlayered


class HiddenTerm(NamedTuple):
    """A term that acts on the surface of a switch alone: nonlinear in lambda, 0 at lambda = 1 and -1."""

    where: str  # the state whose rate contains it, or the algebraic unknown
    switch: sp.Symbol
    term: sp.Expr


class System:
    """A piecewise-smooth system of differential equations.

    Parameters
    ----------
    rates : mapping of state to expression
        dx/dt of every state, in the order of the states. Here and everywhere else a name may be given as a
        Symbol or a str.
    time : Symbol, optional
        Needed if time stands in an expression.
    parameters : mapping of Symbol to float
        A value for every symbol that is nothing else.
    outputs : mapping of str to expression, optional
        Named quantities of the solution.
    events : sequence of Event
    contacts : sequence of Unilateral, optional
        Those whose reaction stands in the rates are found without being listed.
    algebraic : sequence of Algebraic
    convention : {"hidden", "filippov"}
        "hidden" keeps terms that are nonlinear in a multiplier as they are written; "filippov" replaces
        them by the convex combination of the fields on both sides.

    Attributes
    ----------
    model : Model
        The lowered system, input of the compiler.
    parameters : dict
        Symbol -> float, of this view.
    states : tuple of Symbol
        States of this view, then memories.
    switches : tuple of Switch
        Given ones and those found in ordinary notation, the inner ones first.
    initial_memory : dict
        Memory -> its initial value.

    Raises
    ------
    ValueError, TypeError
        Names that are unknown, missing or ambiguous; values outside a symbol's assumptions; a switch that
        never switches; a contact whose reaction acts on nothing.

    Examples
    --------
    The friction oscillator with static friction as a hidden term:

    >>> t, y, v, z = sp.symbols("t y v z", real=True)
    >>> rho, beta, k, sigma = sp.symbols("rho beta k sigma", positive=True)
    >>> lam = Switch("lam", v)
    >>> oscillator = System(
    ...     {y: v, v: -sigma*sp.sin(t) - k*y - lam*(1 + rho*z), z: (1 - lam**2 - z)/beta},
    ...     time=t, parameters={rho: 3, beta: 0.1, k: 3.1, sigma: 2.4})
    >>> oscillator.hidden_terms
    (HiddenTerm(where='z', switch=lam, term=-lam**2/beta + 1/beta),)
    >>> oscillator.layered({z: sp.oo}).states
    (y, v)
    """

    def __init__(self, rates, *, time=None, parameters=None, outputs=None, events=(), contacts=(), algebraic=(),
                 convention="hidden"):
        if convention not in ("hidden", "filippov"):
            raise ValueError(f"`convention` is {convention!r}; choose 'hidden' (as written) or 'filippov'.")
        pairs = list(rates.items()) if isinstance(rates, Mapping) else [tuple(pair) for pair in rates]
        if not pairs:
            raise ValueError("`rates` is empty; give the rate of at least one state.")
        outputs = dict(outputs or {})
        events, algebraic = tuple(events), tuple(algebraic)
        self._check_types(events, algebraic)

        rate_of = [checks.expression(e, f"the rate of {x}") for x, e in pairs]
        output_of = [checks.expression(e, f"output {name!r}") for name, e in outputs.items()]
        found = checks.symbols_of([*rate_of, *(a.residual for a in algebraic)])
        reactions = checks.contacts(contacts, found)
        found = checks.symbols_of([*found, *output_of, *_event_expressions(events)])
        names = checks.Names(found)
        states = [names(x, "`rates`") for x, _ in pairs]
        self._check_states(states)
        time = self._time(time, names, states)
        self._memories = _memories(found, events, names)
        unknowns = [names(a.unknown, "`algebraic`") for a in algebraic]
        self.parameters = self._parameters(parameters or {}, names, found, states, time, unknowns, reactions)
        self._definition = {
            "rates": dict(zip(states, rate_of, strict=True)),
            "events": events,
            "contacts": reactions,
            "algebraic": algebraic,
            "outputs": outputs,
        }

        moving = {time, *states, *unknowns, *(plain(R) for R in reactions)}
        lift = Lifting(moving, [s for s in found if isinstance(s, Switch)])
        field = self._lift(lift, time, states, rate_of, outputs, output_of, events, unknowns, reactions)
        self._field = filippov(field) if convention == "filippov" else field
        self.switches = tuple(lift.notation[lam] for lam, _ in field.switches)
        self.model = lower(self._field)
        self._base, self._view, self._notes, self._cache = None, {}, (), {}

    # ---- reading the definition

    @staticmethod
    def _check_types(events, algebraic):
        for argument, items, kind in (("events", events, Event), ("algebraic", algebraic, Algebraic)):
            for item in items:
                if not isinstance(item, kind):
                    raise TypeError(f"`{argument}` contains {item!r}; give {kind.__name__} objects.")

    @staticmethod
    def _check_states(states):
        for i, x in enumerate(states):
            if x in states[:i]:
                raise ValueError(f"`rates` lists the state {x.name!r} twice; give it one rate.")
            if type(x) is not sp.Symbol:
                kind = type(x).__name__
                raise ValueError(f"`rates` gives a rate to {x.name!r}, a {kind}; a state is a Symbol.")

    @staticmethod
    def _time(time, names, states):
        if time is None:
            return sp.Symbol("t" if "t" not in names.by_name else "time", real=True)
        time = names(time, "`time`")
        if time in states:
            raise ValueError(f"`time` is {time}, which is a state; time needs no rate.")
        return time

    def _parameters(self, given, names, found, states, time, unknowns, reactions):
        values = {}
        taken = {time: "time", **dict.fromkeys(states, "a state"), **dict.fromkeys(unknowns, "an unknown")}
        for key, number in given.items():
            p = names(key, "`parameters`")
            if p in taken or type(p) is not sp.Symbol:
                meaning = taken.get(p, f"a {type(p).__name__}")
                raise ValueError(f"`parameters` gives a value to {p.name!r}, which is {meaning}.")
            if p not in found:
                raise ValueError(
                    f"`parameters` names {p.name!r}, which stands nowhere in this system; leave it out. "
                    f"Its symbols without another meaning: {checks.listing(_open(found, taken))}."
                )
            values[p] = checks.parameter_value(p, number)
        undefined = [s for s in _open(found, taken) if s not in values]
        if undefined:
            first = undefined[0].name
            hint = f" If {first} is time, say time={first}." if first in ("t", "time") else ""
            raise ValueError(
                f"the system uses {checks.listing(undefined)}, without a rate or a value; add to `rates` or "
                f"`parameters`.{hint}"
            )
        return values

    def _lift(self, lift, time, states, rates, outputs, output_of, events, unknowns, reactions):
        rates = tuple(lift(e) for e in rates)
        algebraic = tuple(
            (a, lift(item.residual)) for a, item in zip(unknowns, self._definition["algebraic"], strict=True)
        )
        gaps = [lift(R.gap) for R in reactions]
        surfaces = [None if e.surface is None else lift(e.surface) for e in events]
        # What follows is evaluated at instants: it makes no switches of its own.
        at_instants = {"new_switches": False}
        contacts = tuple(
            (plain(R), gap, lift(R.restitution, **at_instants)) for R, gap in zip(reactions, gaps, strict=True)
        )
        order = [*states, *self._memories]
        specs = []
        for k, (event, surface) in enumerate(zip(events, surfaces, strict=True)):
            what = f"`update` of event {event.name or k + 1}"
            update = tuple(
                (order.index(checks.lookup(key, order, what, "state or memory")), lift(e, **at_instants))
                for key, e in event.update
            )
            specs.append(EventSpec(
                event.name or f"event {k + 1}", surface, event.every, event.at, event.direction,
                lift(event.when, **at_instants), update, event.terminal,
            ))  # fmt: skip
        _check_instants(specs, [*order, *unknowns, time])
        if len({s.name for s in specs}) < len(specs):
            raise ValueError(f"two events have the same name: {checks.listing(sorted(s.name for s in specs))}.")
        return Field(
            time=time,
            states=tuple(states),
            rates=rates,
            parameters=tuple(self.parameters),
            memories=tuple(plain(m) for m in self._memories),
            switches=tuple(lift.switches.items()),
            contacts=contacts,
            algebraic=algebraic,
            events=tuple(specs),
            outputs=tuple(
                (str(name), lift(e, **at_instants)) for name, e in zip(outputs, output_of, strict=True)
            ),
            initial_memory=tuple(m.initial for m in self._memories),
            typical=tuple(self.parameters.values()),
        )

    # ---- what a system knows

    @property
    def states(self):
        return self.model.states

    @property
    def initial_memory(self):
        return {m: m.initial for m in self._memories}

    @property
    def parameter_values(self):
        """Values in the order of `model.parameters`."""
        return tuple(self.parameters[p] for p in self.model.parameters)

    @property
    def hidden_terms(self):
        """Terms of the rates that are nonlinear in a multiplier: they act on its surface only."""
        terms = []
        field = self._field
        equations = [*zip(field.states, field.rates, strict=True), *field.algebraic]
        for index, (lam, _) in enumerate(field.switches):
            surface = Surface(field, index)
            # On the surface: lambda*|v| is nonlinear in lambda, but vanishes with v.
            terms += [
                HiddenTerm(x.name, lam, hidden_part(e, lam))
                for x, e in equations
                if lam in e.free_symbols and surface.nonlinear(e)
            ]
        return tuple(terms)

    def initial_state(self, x0):
        """`x0` as a list of floats in the order of `states`; memories not named start at their initial value.

        Raises
        ------
        ValueError, TypeError
            Names that this view does not have, missing states, wrong length, nan or infinity.
        """
        states = self.states[: len(self.states) - len(self._memories)]
        gone = {z.name: note for z, note in self._view.get("gone", {}).items()}
        memory = {plain(m): m.initial for m in self._memories}
        return checks.initial_state(x0, states, tuple(memory), memory, gone)

    def with_parameters(self, values):
        """The same view with other values of some parameters; nothing is derived or compiled anew.

        Parameters
        ----------
        values : mapping of Symbol or str to float
        """
        other = copy.copy(self)
        other.parameters = dict(self.parameters)
        for key, number in values.items():
            p = checks.lookup(key, self.parameters, "`values`", "parameter")
            other.parameters[p] = checks.parameter_value(p, number)
        return other

    # ---- views

    def smoothed(self, eps, sigmoid="algebraic"):
        """The smooth stand-in: lambda_j -> Lambda(h_j/eps_j).

        Parameters
        ----------
        eps : float or mapping of switch to float
            Width of the layer, in the unit of h; > 0.
        sigmoid : {"algebraic", "tanh", "erf"}

        Returns
        -------
        System
            Without switches; eps is one of its parameters, so that changing it compiles nothing.

        Raises
        ------
        ValueError
            eps not positive or not given for every switch; a two-stage layer, which has no smooth stand-in.
        """
        if self._view.get("kind") == "smoothed":
            raise ValueError("`smoothed` of a smoothed view: take the view of the original system.")
        if not self._field.switches:
            raise ValueError("this system has no switches: there is nothing to smooth.")
        family = sigmoid_of(sigmoid)
        lams = [lam for lam, _ in self._field.switches]
        values = _by_switch(eps, lams, "eps")
        if isinstance(eps, Mapping):
            missing = [lam for lam in lams if lam not in values]
            if missing:
                lacking = checks.listing(missing)
                raise ValueError(f"`eps` has no width for {lacking}; give one for every switch.")
            symbols = {lam: self._fresh(f"eps_{lam.name}") for lam in lams}
        else:
            symbols = dict.fromkeys(lams, self._fresh("eps"))
        key = ("smoothed", family.name, tuple(symbols.values()))
        if key not in self._cache:
            field = replace(self._unlayered(symbols[lams[0]]), parameters=tuple(self.parameters))
            field, smoothing = smoothed(field, family, symbols)
            extra = tuple(dict.fromkeys(symbols.values()))
            self._cache[key] = field, lower(field, smoothing=smoothing, sigmoid=family.name, extra=extra)
        widths = {symbols[lam]: values[lam] for lam in lams}
        view = {"kind": "smoothed", "title": f"smoothed, {family.name} sigmoid"}
        if self._view.get("kind") == "layered":
            kept = self._cache[key][0].states
            view["gone"] = {z: note for z, note in self._view["gone"].items() if z not in kept}
        return self._with(self._cache[key], widths, view)

    def layered(self, ratios, *, sigmoid="algebraic", eps_ratio=None, time_constant=None):
        """The limit in which internal states are as fast as the layer: eps and beta -> 0, eps/beta = r.

        Parameters
        ----------
        ratios : mapping of state to number
            r: `sp.oo` slaves the state to its equilibrium, a positive number gives a layer with that ratio
            of speeds, 0 a two-stage one (lambda first, then the state along the root). May be empty, to
            choose only the sigmoid.
        sigmoid : {"algebraic", "tanh", "erf"}
            Speed of lambda inside the layer.
        eps_ratio : mapping of switch to float, optional
            Widths of the layers relative to each other; 1 by default.
        time_constant : mapping of state to Symbol or number, optional
            beta, where the rate does not show it uniquely.

        Returns
        -------
        System
            Without the layered states; in slow time they sit at their equilibrium.

        Raises
        ------
        ValueError
            A time constant or an equilibrium that is not unique; a state that is updated in events or stands
            in a surface.
        """
        if self._view:
            raise ValueError(f"`layered` of a {self._view['kind']} view: take the view of the original system.")
        if not self._field.switches:
            raise ValueError("this system has no switches, so it has no layers.")
        family = sigmoid_of(sigmoid)
        states = list(self._field.states)
        given = {}
        for key, r in ratios.items():
            z = checks.lookup(key, states, "`layered`", "state")
            r = math.inf if r == sp.oo else _number_at_least_zero(r, f"the ratio of {z.name!r}")
            given[z] = sp.oo if math.isinf(r) else r or 0
        relative = {
            lam: 1.0 if eps_ratio is None else _by_switch(eps_ratio, self._lams, "eps_ratio").get(lam, 1.0)
            for lam in self._lams
        }
        constants = self._constants(given, time_constant or {})
        symbols, values = {}, {}
        for z, r in given.items():
            symbols[z] = sp.sympify(r) if r in (0, sp.oo) else self._fresh(f"ratio_{z.name}")
            if isinstance(symbols[z], sp.Symbol):
                values[symbols[z]] = r
        settings = (symbols, relative, constants)
        key = ("layered", family.name, *(tuple(d.items()) for d in settings))
        if key not in self._cache:
            slow, free, layer = layered(self._field, symbols, constants)
            self._cache[key] = slow, lower(
                slow, layer=layer, layer_field=free if layer else None, eps_ratio=relative, sigmoid=family.name,
                extra=tuple(values),
            )  # fmt: skip
        layer = self._cache[key][1].layer_states
        view = {
            "kind": "layered",
            "title": f"layered, {family.name} sigmoid",
            "gone": {s.symbol: f"it is layered, {s.symbol} = {s.equilibrium} in slow time" for s in layer},
        }
        return self._with(self._cache[key], values, view)

    # ---- making views

    @property
    def _lams(self):
        return [lam for lam, _ in self._field.switches]

    def _constants(self, layered_states, given):
        """The time constant of every layered state: as given, else as its rate shows it."""
        rates = dict(zip(self._field.states, self._field.rates, strict=True))
        given = {
            checks.lookup(key, self._field.states, "`time_constant`", "state"): sp.sympify(beta)
            for key, beta in given.items()
        }
        return {z: given.get(z) or time_constant(z, rates[z], self.parameters) for z in layered_states}

    def _unlayered(self, eps):
        """The field to be smoothed: states of a finite ratio r come back with the time constant eps/r."""
        if self._view.get("kind") != "layered":
            return self._field
        return unlayered(self._base._field, self.model.layer_states, eps)

    def _fresh(self, name):
        """A parameter symbol of a name that the system does not use yet."""
        taken = {s.name for s in (*self.parameters, *self.states, self.model.time, *self._lams)}
        while name in taken:
            name += "_"
        return sp.Symbol(name, positive=True)

    def _with(self, lowered, values, view):
        other = copy.copy(self)
        other._field, other.model = lowered
        other._base, other._view, other._cache = self, view, {}
        known = self.parameters | values
        other.parameters = {p: known[p] for p in other.model.parameters}
        dropped = [p for p in self.parameters if p not in other.parameters]
        other._notes = tuple(f"{p} drops out of this view" for p in dropped)
        return other

    def __repr__(self):
        return text(self)

    def _repr_html_(self):
        return html(self)


def _event_expressions(events):
    for event in events:
        yield from (e for e in (event.surface, event.every, *event.at, event.when) if e is not None)
        yield from (e for _, e in event.update)


def _memories(found, events, names):
    """Memories in the order in which they appear, those that are only updated last."""
    updated = [names(key, "`update` of an event") for event in events for key, _ in event.update]
    return tuple(dict.fromkeys(s for s in (*found, *updated) if isinstance(s, Memory)))


def _open(found, taken):
    """Symbols that have no meaning yet: they must be parameters."""
    return [s for s in found if type(s) is sp.Symbol and s not in taken]


def _check_instants(specs, moving):
    for spec in specs:
        for e in (spec.every, *spec.at):
            inside = [s for s in moving if e is not None and s in e.free_symbols]
            if inside:
                raise ValueError(
                    f"the instants of event {spec.name!r} depend on {checks.listing(inside)}; `every` and `at` "
                    "take numbers and parameters. Use a surface for what the state decides."
                )


def _by_switch(values, lams, argument):
    """Multiplier -> positive number, from one number for all or a mapping."""
    if not isinstance(values, Mapping):
        return dict.fromkeys(lams, _positive(values, f"`{argument}`"))
    return {
        checks.lookup(key, lams, f"`{argument}`", "switch"): _positive(value, f"`{argument}` of {key}")
        for key, value in values.items()
    }


def _positive(value, what):
    value = checks.number(value, what)
    if value <= 0:
        raise ValueError(f"{what} is {value:g}; give a number > 0.")
    return value


def _number_at_least_zero(value, what):
    if isinstance(value, float) and math.isinf(value) and value > 0:
        return value
    value = checks.number(value, what)
    if value < 0:
        raise ValueError(f"{what} is {value:g}; give 0, a positive number or sympy.oo.")
    return value
