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
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import sympy as sp

from .definition import discs, one_element
from .definition.drives import drive
from .definition.families.expansion import spread
from .definition.families.many import MANY, Numbers, Symbols, carried
from .definition.functions import check_start, read_functions
from .definition.lifting import plain
from .definition.lowering import ModelsByValues, lower
from .definition.mechanics import arguments_of, mechanism
from .definition.notation import named_rows, rate_of, solved_for_rates, time_of, without_impulses
from .definition.primitives import Disc
from .definition.reading import read
from .definition.regularity import Surface
from .definition.reversal import backward
from .definition.sigmoids import sigmoid as sigmoid_of
from .definition.views import filippov, hidden_part, layered, smoothed, time_constant, unlayered
from .door import checks
from .door.describe import DescribedSystem
from .door.documenting import complete


@complete
class HiddenTerm(NamedTuple):
    """A term that acts on the surface of a switch alone: nonlinear in lambda, 0 at lambda = 1 and -1.

    Attributes
    ----------
    where : str
        The state whose rate contains it, or the algebraic unknown.
    switch : Switch
        The multiplier lambda, or that of a disc.
    term : Expr
        In the unit of that rate.

    Source: Jeffrey, On the mathematical basis of solid friction, sec. 1 (spec: gamma(lambda), 0 off the surface).

    >>> v = sp.Symbol("v", real=True)
    >>> lam = Switch("lam", v)
    >>> (hidden,) = System({v: -lam * (1 + 3 * (1 - lam**2))}).hidden_terms
    >>> hidden.where, hidden.term
    ('v', 3*lam**3 - 3*lam)
    """

    where: str
    switch: sp.Symbol
    term: sp.Expr


class View(NamedTuple):
    """How a system derives from another one."""

    kind: str  # "smoothed" | "layered"
    title: str
    gone: dict[sp.Symbol, str]  # states of the original that this view does not have, and why
    original: System
    arguments: dict  # of the method of that kind, which made it


@checks.door()
class System(DescribedSystem):
    """A piecewise-smooth system of differential equations, dx/dt = f(t, x, lambda; p).

    Parameters
    ----------
    rates : mapping of state to Expr
        dx/dt of every state, in the order of the states, in any consistent set of units. Here and everywhere else a
        name may be given as a Symbol, a str or, as `sympy.physics.mechanics` does, a function of time y(t). A term
        c*DiracDelta(t - t0) is a jump by c at t0.
    time : Symbol, optional
        Needed if time stands in an expression and the states are no functions of it.
    parameters : mapping of Symbol to float, in the units of the model
        A value for every symbol that is nothing else.
    outputs : mapping of str to Expr, optional
        Named quantities of the solution.
    events : sequence of Event
        Resets, latches, flags, stops.
    contacts : sequence of Unilateral, optional
        Those whose reaction stands in the rates are found without being listed.
    algebraic : sequence of Algebraic
        Unknowns that are solved inside the right-hand side.
    mass_matrix : Matrix, shape (k, k), optional
        M in M(t, x) dx/dt = F(t, x), for states that `rates` does not give; solved at every evaluation of the rates.
    forcing : mapping of state to Expr, or Matrix, shape (k, 1), optional
        F, with the states in the order of the rows and columns of M; with a Matrix `rates` is the list of these states.
    drives : mapping of symbol to Drive, or to (times, values), optional
        Sampled inputs, which stand in the expressions as symbols; pairs of arrays are a cubic spline.
    convention : {"hidden", "filippov"}
        "hidden" keeps terms that are nonlinear in a multiplier as they are written; "filippov" replaces
        them by the convex combination of the fields on both sides.

    Attributes
    ----------
    model : Model
        The lowered system, input of the compiler.

    Raises
    ------
    ValueError, TypeError
        Names that are unknown, missing or ambiguous; values outside a symbol's assumptions; a switch that
        never switches; a contact whose reaction acts on nothing.

    Notes
    -----
    lambda_j = sign h_j(t, x) off the surface h_j = 0; on it lambda_j in [-1, 1] keeps h_j at 0 (sliding) or the layer
    system decides.

    Source: Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, for what is linear in lambda;
    Jeffrey, On the mathematical basis of solid friction, for hidden terms.

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

    _constraints: tuple[sp.Expr, ...] = ()  # that the motion keeps at 0, of a mechanism

    def __init__(
        self,
        rates=(),
        *,
        time=None,
        parameters=None,
        outputs=None,
        events=(),
        contacts=(),
        algebraic=(),
        mass_matrix=None,
        forcing=None,
        drives=None,
        convention="hidden",
    ):
        convention = checks.one_of("hidden", "filippov")(convention, "`convention`")
        lists = {"events": events, "contacts": contacts, "algebraic": algebraic}
        lists = {name: checks.several(items, f"`{name}`") for name, items in lists.items()}
        for event in lists["events"]:
            if any(checks.is_function(getattr(event, part, None)) for part in ("surface", "update", "when")):
                raise TypeError(
                    "`events` has one with functions, which belongs to System.from_functions; give formulas."
                )
        outputs, parameters = (
            checks.mapping({} if value is None else value, f"`{name}`")
            for name, value in (("outputs", outputs), ("parameters", parameters))
        )
        rates, forcing = named_rows(rates, forcing)
        rates = checks.pairs(rates, "`rates`", least=0 if forcing else 1)
        time = time_of(time, rates, checks.pairs(forcing, "`forcing`") if forcing else (), outputs.items())
        rates = tuple((rate_of(x), e) for x, e in rates)
        rates, lists["algebraic"] = solved_for_rates(rates, lists["algebraic"], mass_matrix, forcing)
        rates, impulses = without_impulses(rates, time)
        lists["events"] += impulses
        drives = checks.mapping({} if drives is None else drives, "`drives`", "symbols to (times, values)")
        drives = {key: drive(record, f"`drives` of {key}") for key, record in drives.items()}
        self._arguments = rates, time, parameters, outputs, *lists.values(), drives
        self._convention = convention
        self._view: View | None = None
        # Families are lowered as one element where that can be (one_element.py): n would take time ~ n and more.
        self._by_element = convention == "hidden"
        self._element = one_element.read(*self._arguments) if self._by_element else None
        if self._element:
            self.parameters, self.model = self._element.parameters, self._element.model
        else:
            self.parameters, self.model = self.definition.parameters, lower(self._field)
        self._check_values()
        self._notes: tuple[str, ...] = ()
        self._cache: dict = {}  # of views: their fields and models; what their initial states are read by

    @classmethod
    @checks.door(("events", "algebraic", "drives"))
    def from_mechanics(cls, method, *, friction=None, contacts=(), parameters=None, outputs=None, **arguments):
        """The System of a mechanism that is written with `sympy.physics.mechanics`.

        Parameters
        ----------
        method : KanesMethod, LagrangesMethod or System of sympy.physics.mechanics
            With its equations formed; a System forms them itself. Coordinates and speeds keep their names; those of
            Lagrange's equations are named after the coordinates, `theta_dot` for theta.
        friction : mapping, optional
            Velocity -> law of `pwsmooth.laws`, or (law, normal load). A velocity is a joint's or a speed's name, or an
            expression of speeds, such as a slip velocity; two or three of them in a tuple are the components of a slip
            in the plane or in space. The law opposes it, in newtons or newton metres. Its states and parameters carry
            the velocity's name; of several expressions their number among the laws.
        contacts : sequence of Unilateral
            Gaps as expressions of the coordinates; their reactions act along the gaps.
        parameters : mapping of Symbol to float, in the units of the model
            Of the mechanism. Laws bring their own.
        outputs : mapping of str to Expr, optional
            Of coordinates, their derivatives and speeds, beside "friction ...", the force or moment of each law, and
            "constraint 1" and so on, which are 0 but for the drift.
        **arguments
            More of a System: `events`, `algebraic`, `drives`.

        Returns
        -------
        System
            With the mass matrix unsolved; the multipliers of Lagrange's constraints are unknowns of it.

        Raises
        ------
        ValueError, TypeError
            No equations yet, a velocity that is none, a singular mass matrix, no law.

        Notes
        -----
        A force along a velocity v adds force * dv/du to the generalized forces (partial velocities). Constraints are
        kept by their derivatives: start on them; they drift with the tolerance. Equilibria and orbits lie on them;
        multipliers of orbits across them are 0.

        Source: Kane and Levinson, Dynamics: Theory and Applications, 1985.

        A pendulum with dry friction in its joint:

        >>> from sympy.physics import mechanics as me
        >>> theta = me.dynamicsymbols("theta")
        >>> lagrange = me.LagrangesMethod(theta.diff()**2/2 + 9.81*sp.cos(theta), [theta])
        >>> _ = lagrange.form_lagranges_equations()
        >>> pendulum = System.from_mechanics(lagrange, friction={"theta": Coulomb(F_c=1.0)})
        >>> swing = solve(pendulum, (0, 20), {"theta": 1.5, "theta_dot": 0})
        >>> swing.itinerary[-1]
        'stick (lam_theta sliding)'
        """
        found = mechanism(method)
        system = cls(**arguments_of(found, friction, contacts, parameters, outputs, arguments))
        system._constraints = found.kept()
        return system

    @classmethod
    def from_functions(cls, f, states, *, surfaces=(), parameters=None, events=()):
        """A System of Python functions, which numba compiles, for those who have no formulas.

        Parameters
        ----------
        f : callable
            f(t, x, lam, p): dx/dt as a tuple of n numbers, or an array of shape (n,), in the units of the states per
            unit of time. `x`, `lam` and `p` are arrays, in the order of `states`, `surfaces` and `parameters`. Terms
            that are nonlinear in `lam` are hidden terms. It has to exist a little beyond lam = -1 and 1.
        states : sequence of str, length n
            Their names; "y v" will do.
        surfaces : mapping of str to callable, or sequence of callable
            Multiplier -> h(t, x, p), smooth: lam = sign h off the surface h = 0. In a sequence they are named lam, or
            lam1, lam2, ...
        parameters : mapping of str to float, in the units of the model
            Values, in the order in which `p` holds them.
        events : sequence of Event
            With functions: `surface(t, x, p)`, `update(t, x, p)`, which returns the whole state after it, and
            `when(t, x, p)`, which returns a bool. `every` and `at` are numbers.

        Returns
        -------
        System
            For `solve()` alone, on the explicit pair (`method="rk"`): slips, sliding, hidden terms with their folds,
            located events, accumulation and ambiguities as everywhere.

        Raises
        ------
        ValueError, TypeError
            What is no function of these arguments, does not compile, or returns something else; a surface whose slopes
            cannot be taken by a complex step. solve() refuses what is not finite at the start.

        Notes
        -----
        What it cannot do, for want of formulas: Taylor and implicit steps; kinks and switches found in notation (a
        kink of f needs a surface, or steps shorten there); surfaces in which a multiplier stands; `smoothed` and
        `layered` views; contacts, memories, unknowns, families, drives, outputs; noise, derivatives, runs backward in
        time; sweeps, orbits, equilibria, fits; saving. Two-folds are told as folds. Code is compiled in every process
        anew.

        Source: Squire and Trapp, SIAM Review 40, 1998, for slopes by complex steps.

        A block on a spring, pulled to and fro, with Coulomb friction:

        >>> def f(t, x, lam, p):
        ...     return x[1], np.sin(t) - x[0] - p[0] * lam[0]
        >>> block = System.from_functions(f, "y v", surfaces=[lambda t, x, p: x[1]], parameters={"F_c": 0.6})
        >>> solve(block, (0, 20), {"y": 1, "v": 0}).itinerary[:3]
        ('lam=-1', 'lam sliding', 'lam=-1')
        """
        return FunctionSystem(read_functions(f, states, surfaces, parameters, events))

    # ---- what a system knows

    @cached_property
    def definition(self):
        """What was written, with the elements of families written out."""
        return read(*self._arguments)

    @cached_property
    def _field(self):
        if self._view and self.model.families is not None:
            return self._written_out()._field
        return filippov(self.definition.field) if self._convention == "filippov" else self.definition.field

    @property
    def switches(self):
        """Given switches and those found in ordinary notation, the inner ones first."""
        return self.definition.switches

    @property
    def discs(self):
        """Given discs and those found in ordinary notation."""
        return self.definition.discs

    @property
    def groups(self):
        """Name of a member of a family -> its names in all elements."""
        return (self._element or self.definition).groups

    @property
    def states(self):
        """States of this view, then memories; a tuple of Symbols."""
        return self.model.states

    @property
    def initial_memory(self):
        """Memory -> its initial value, in the unit that the model gives it."""
        return {m: m.initial for m in (self._element or self.definition).memories}

    @property
    def _controls(self):
        return (self._element or self).definition.controls

    @property
    def parameter_values(self):
        """Values in the order of `model.parameters`, in the units of the model."""
        if isinstance(self.parameters, Numbers):
            return self.parameters.array
        return tuple(self.parameters[p] for p in self.model.parameters)

    @property
    def hidden_terms(self):
        """Terms of the rates that are nonlinear in a multiplier: they act on its surface only."""
        terms = []
        field = self._field
        equations = [*zip(field.states, field.rates, strict=True), *field.algebraic]
        for index, (lam, _) in enumerate(field.switches):
            inside = [(x, e) for x, e in equations if lam in e.free_symbols]
            surface = Surface(field, index, [e for _, e in inside])
            # On the surface: lambda*|v| is nonlinear in lambda, but vanishes with v.
            terms += [HiddenTerm(x.name, lam, hidden_part(e, lam)) for x, e in inside if surface.nonlinear(e)]
        for disc in field.discs:
            parts = ((x.name, discs.hidden_part(e, disc.components)) for x, e in equations)
            terms += [HiddenTerm(name, disc.symbol, part) for name, part in parts if part != 0]
        return tuple(terms)

    def initial_state(self, x0, t0=None):
        """The initial state as a list of floats; memories not named start at their initial value.

        Parameters
        ----------
        x0 : mapping of state to float, or sequence of float, length n
            In the units of the states.
        t0 : float, in the unit of the model's time, optional
            Start of the run: where drives are in their records; by default at their beginning.

        Returns
        -------
        list of float
            In the order and the units of `states`.

        Raises
        ------
        ValueError, TypeError
            Names that this view does not have, missing states, wrong length, nan or infinity.
        """
        if isinstance(self.model.states, Symbols):
            return self._many_initial(x0)
        if "start" not in self._cache:
            memory = {plain(m): m.initial for m in (self._element or self.definition).memories}
            cells = [
                (index, table) for e in self.model.events for table in e.tables[:1] for index, _ in e.update
            ]
            gone = {z.name: note for z, note in (self._view.gone if self._view else {}).items()}
            own = self.states[: len(self.states) - len(memory)]
            self._cache["start"] = own, memory, gone, cells, self._controls
        states, memory, gone, cells, controls = self._cache["start"]
        if not isinstance(x0, (tuple, list)) and isinstance(x0, Mapping):
            x0 = self._spread(x0, "`x0`")
        start = checks.initial_state(x0, states, memory, gone)
        for index, table in cells if t0 is not None else ():
            start[index] = table.cell(t0)
        for u in controls if t0 is not None else ():
            u._check_run(t0, self.parameters)
        return start

    @property
    def _looks_at_starts(self):
        """Whether finite numbers may be no initial state yet: states with assumptions, drives, controls."""
        model = self.model
        if isinstance(model.states, Symbols) or model.functions or self._controls:
            return True
        return any(e.tables for e in model.events) or not all(map(checks.is_free, model.states))

    def _many_initial(self, x0):
        """The initial state of a family of many, as an array."""
        states = self.model.states
        if isinstance(x0, Mapping):
            initial = np.full(len(states), np.nan)
            assert self._element is not None
            for m in self._element.definition.memories:
                first, n = states.blocks[m.name.replace("[]", "")]
                initial[first : first + (n or 1)] = m.initial
            start = states.numbers(x0, "`x0`", checks.initial_value, initial)
        else:
            start = checks.array(x0, "`x0`")
        if start.shape != (len(states),) or np.isnan(start).any():
            raise ValueError(
                f"`x0` does not give each of {len(states)} states a value; give all of {', '.join(states.blocks)}."
            )
        return start

    def with_parameters(self, parameters):
        """The same view with other values of some parameters; nothing is derived or compiled anew, but where they let
        another switch hold the motion.

        Parameters
        ----------
        parameters : mapping of (Symbol or str) to float, in the units of the model
            Those that change.

        Returns
        -------
        System
            It shares equations and compiled code with this one.

        Raises
        ------
        ValueError, TypeError
            No parameter of that name, a value outside the symbol's assumptions, or no number.
        """
        other = copy.copy(self)
        values = checks.mapping(parameters, "`parameters`", "parameters to values")
        if isinstance(self.parameters, Numbers):
            other.parameters = self.parameters.changed(values)
            other._check_values()
            return other
        other.parameters = dict(self.parameters)
        by_name = {p.name: p for p in self.parameters}
        for key, number in self._spread(values, "`parameters`").items():
            if key not in by_name and self._is_idle(key, by_name):
                continue
            p = by_name.get(key) or checks.lookup(key, self.parameters, "`parameters`", "parameter")
            other.parameters[p] = checks.parameter_value(p, number)
        other._check_values()
        if not self._view and not self._element:
            if "by values" not in self._cache:
                self._cache["by values"] = ModelsByValues.where_they_tell(self._field, self.model)
            if (models := self._cache["by values"]) and self.model in models:
                other.model = models.at(other.parameters)
        return other

    def _extended(self, rates, outputs):
        """This view with further states and outputs."""
        if self._view:
            original = self._view.original._extended(rates, outputs)
            view = getattr(original, self._view.kind)(**self._view.arguments)
            return view.with_parameters({p: value for p, value in self.parameters.items()})
        own, time, parameters, named, events, contacts, algebraic, drives = self._arguments
        # Among the states stand symbols of the memories' names.
        memories = {s: m for s in self.states for m in self.initial_memory if str(m) == str(s)}
        rates, outputs = ({k: e.xreplace(memories) for k, e in more.items()} for more in (rates, outputs))
        extended = System(
            (*own, *rates.items()), time=time, parameters=parameters, outputs={**named, **outputs}, events=events,
            contacts=contacts, algebraic=algebraic, drives=drives, convention=self._convention,
        )._written_out()  # fmt: skip
        extended._constraints = self._constraints
        return extended.with_parameters({p.name: value for p, value in self.parameters.items()})

    def _written_out(self):
        """This system without a template: what is derived of a family's elements one by one needs them all."""
        other = copy.copy(self)
        other._by_element = False
        if self.model.families is None:
            return other if self._by_element and self.groups else self
        values = {p.name: value for p, value in self.parameters.items()}
        if self._view:
            if "written out" not in self._cache:
                original = self._view.original._written_out()
                self._cache["written out"] = getattr(original, self._view.kind)(**self._view.arguments)
            return self._cache["written out"].with_parameters(values)
        if "written out" not in self._cache:
            self._cache["written out"] = lower(self._field)
        other._element, other._cache, other.model = None, {}, self._cache["written out"]
        other.parameters = {p: values[p.name] for p in self.definition.parameters}
        return other

    def _without_levels(self):
        """This system, written out where a template has two levels for hidden static friction: they have no lambda."""
        families = self.model.families
        return self._written_out() if families and families.template.levels else self

    def _check_values(self):
        own = not self._view or self.model.families is not None
        of = self._element if self._element and own else self._field
        if getattr(of, "bounds_values", True):  # walks along a parameter come here at every step
            of.check_values(self.parameters)

    # ---- views

    def smoothed(self, eps, sigmoid="algebraic"):
        """The smooth stand-in: lambda_j -> Lambda(h_j/eps_j).

        Parameters
        ----------
        eps : float or mapping of switch to float
            Width of the layer, in the unit of h; > 0.
        sigmoid : {"algebraic", "tanh", "erf"} or Expr
            The family Lambda; an expression is one in u = h/eps.

        Returns
        -------
        System
            Without switches; eps is one of its parameters, so that changing it compiles nothing.

        Raises
        ------
        ValueError
            eps not positive or not given for every switch; a two-stage layer, which has no smooth stand-in.
        """
        if self._view and self._view.kind == "smoothed":
            raise ValueError("`smoothed` of a smoothed view: take the view of the original system.")
        if self._view and self.model.families is not None:
            return self._written_out().smoothed(eps, sigmoid)
        family = sigmoid_of(sigmoid)
        title, arguments = f"smoothed, {family.name} sigmoid", dict(eps=eps, sigmoid=family.key)
        if not isinstance(eps, Mapping) and self._by_element and not self._view:
            width = {self._fresh("eps"): checks.positive(eps, "`eps`")}
            if element := self._smoothed_element(family, width):
                return self._of_element(element, width, View("smoothed", title, {}, self, arguments))
        if not self._lams:
            raise ValueError("this system has no switches: there is nothing to smooth.")
        lams, values = self._lams, self._by_switch(eps, "eps")
        if isinstance(eps, Mapping):
            if missing := [lam for lam in lams if lam not in values]:
                lacking = checks.listing(missing)
                raise ValueError(f"`eps` has no width for {lacking}; give one for every switch.")
            symbols = {lam: self._fresh(f"eps_{lam.name}") for lam in lams}
        else:
            symbols = dict.fromkeys(lams, self._fresh("eps"))
        key = ("smoothed", family.key, tuple(symbols.values()))
        if key not in self._cache:
            field = self._field
            if self._view:  # states of a finite ratio r come back with the time constant eps/r
                field = unlayered(self._view.original._field, self.model.layer_states, symbols[lams[0]])
            field = replace(field, parameters=tuple(self.parameters))
            field, smoothing, _ = smoothed(field, family, symbols)
            extra = tuple(dict.fromkeys(symbols.values()))
            self._cache[key] = field, lower(field, smoothing=smoothing, sigmoid=family.key, extra=extra)
        widths = {symbols[lam]: values[lam] for lam in lams}
        field, model = self._cache[key]
        kept = field.states
        gone = {z: note for z, note in (self._view.gone if self._view else {}).items() if z not in kept}
        return self._derived(field, model, widths, View("smoothed", title, gone, self, arguments))

    def _smoothed_element(self, family, width):
        """One element of the smoothed view, whose `width` has a symbol and a value; None where there is none."""
        key = "smoothed element", family.key, *width
        if key not in self._cache:

            def smooth(field):
                lams = [lam for lam, _ in field.switches] + [disc.symbol for disc in field.discs]
                field = replace(field, parameters=(*field.parameters, *width))
                return *smoothed(field, family, dict.fromkeys(lams, *width)), family.key

            found = one_element.read(*self._arguments, view=smooth, more=width)
            self._cache[key] = found if found and found.model.smoothing else None
        return self._cache[key]

    def layered(self, ratios, *, sigmoid="algebraic", eps_ratio=None, time_constant=None):
        """The limit in which internal states are as fast as the layer: eps and beta -> 0, eps/beta = r.

        Parameters
        ----------
        ratios : mapping of state to float, dimensionless
            r: `sp.oo` slaves the state to its equilibrium, a positive number gives a layer with that ratio
            of speeds, 0 a two-stage one (lambda first, then the state along the root). May be empty, to
            choose only the sigmoid.
        sigmoid : {"algebraic", "tanh", "erf"} or Expr
            Speed of lambda inside the layer; an expression is one in u = h/eps.
        eps_ratio : mapping of switch to float, dimensionless, optional
            Widths of the layers relative to each other, 1 by default; r refers to that of the first switch.
        time_constant : mapping of state to (Symbol or float), in units of time, optional
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
            kind = self._view.kind
            raise ValueError(f"`layered` of a {kind} view: take the view of the original system.")
        family = sigmoid_of(sigmoid)
        arguments = dict(ratios=ratios, sigmoid=family.key, eps_ratio=eps_ratio, time_constant=time_constant)
        view = View("layered", f"layered, {family.name} sigmoid", {}, self, arguments)
        if self.model.families is not None and eps_ratio is None and time_constant is None:
            names = [str(checks.named(key)) for key in checks.mapping(ratios, "`ratios`", "states to ratios")]
            slaved = all(isinstance(r, (float, sp.Basic)) and r == sp.oo for r in ratios.values())
            # Others have a layer of their own at every switch.
            if slaved and (element := self._slaved_element(family, names)):
                gone = {
                    sp.Symbol(own): f"it is layered, {own} = {element.output(name, k)} in slow time"
                    for name in names for k, own in enumerate(element.groups.get(name, (name,))[:MANY])
                }  # fmt: skip
                return self._of_element(element, {}, view._replace(gone=gone))
        if not self._lams:
            raise ValueError("this system has no switches, so it has no layers.")
        states = list(self._field.states)
        given = {}
        for key, r in self._spread(checks.mapping(ratios, "`ratios`", "states to ratios"), "`ratios`").items():
            z = checks.lookup(key, states, "`ratios`", "state")
            given[z] = checks.ratio(r, f"`ratios`, that of {z.name!r}")
        widths = checks.mapping(
            {} if eps_ratio is None else eps_ratio, "`eps_ratio`", "switches to relative widths"
        )
        relative = dict.fromkeys(self._lams, 1.0) | self._by_switch(widths, "eps_ratio")
        relative = {lam: width / relative[self._lams[0]] for lam, width in relative.items()}
        constants = self._constants(given, {} if time_constant is None else time_constant)
        finite = {z: self._fresh(f"ratio_{z.name}") for z, r in given.items() if r not in (0, sp.oo)}
        symbols = {z: finite.get(z, sp.S(r)) for z, r in given.items()}
        values = {symbol: given[z] for z, symbol in finite.items()}
        key = ("layered", family.key, *(tuple(d.items()) for d in (symbols, relative, constants)))
        if key not in self._cache:
            slow, free, layer = layered(self._field, symbols, constants)
            self._cache[key] = slow, lower(
                slow, layer=layer, layer_field=free if layer else None, eps_ratio=relative, sigmoid=family.key,
                extra=tuple(values),
            )  # fmt: skip
        field, model = self._cache[key]
        gone = {
            s.symbol: f"it is layered, {s.symbol} = {s.equilibrium} in slow time" for s in model.layer_states
        }
        return self._derived(field, model, values, view._replace(gone=gone))

    def _slaved_element(self, family, names):
        """One element of a layered view in which all states of these names are slaved; None where there is none."""
        names = [f"{name}[]" if name in self.groups else name for name in names]
        key = "slaved element", family.key, *names
        if key not in self._cache:
            constants: dict[sp.Symbol, sp.Expr] = {}

            def slave(field):
                rates = dict(zip(field.states, field.rates, strict=True))
                slaved = {z: sp.oo for z in field.states if z.name in names}
                if len(slaved) < len(names) or not field.switches:
                    raise ValueError("told by the elements written out")
                constants.update((z, time_constant(z, rates[z], field.parameters)) for z in slaved)
                slow, _, layer = layered(field, slaved, constants)
                return slow, (), {s.symbol: s.equilibrium for s in layer}, family.key

            self._cache[key] = one_element.read(*self._arguments, view=slave), constants
        element, constants = self._cache[key]
        values = np.asarray(self.parameter_values, float)
        positive = all((self.model.families.of_parameters(e, values) > 0).all() for e in constants.values())
        return element if positive else None  # told by the elements written out

    def _backward(self):
        """(this system in s = -t, names of the contacts and events at which a run has to end)."""
        if self._view:
            raise ValueError(f"`t_span` decreases, and this is a {self._view.kind} view; it runs forward only.")
        field, ends = backward(self._field, self.parameters)
        key = "backward", ends
        if key not in self._cache:
            self._cache[key] = lower(field)
        return self._derived(
            field, self._cache[key], {}, View("backward", "backward in time", {}, self, {})
        ), ends

    # ---- making views

    def _is_idle(self, name, used):
        """Whether this is a parameter of an element in which it has no place, as that of a link it lacks."""
        return any(name in names and any(other in used for other in names) for names in self.groups.values())

    def _spread(self, values, what):
        """`values` with the entries of families written out."""
        groups = self.groups
        return spread(values, groups, what) if groups else values

    def _by_switch(self, values, argument):
        """Multiplier -> positive number, from one number for all or a mapping."""
        if not isinstance(values, Mapping):
            return dict.fromkeys(self._lams, checks.positive(values, f"`{argument}`"))
        what = f"`{argument}`"
        return {
            checks.lookup(_name_of(key), self._lams, what, "switch"): checks.positive(value, f"{what} of {key}")
            for key, value in self._spread(values, what).items()
        }

    @property
    def _lams(self):
        return [lam for lam, _ in self._field.switches] + [disc.symbol for disc in self._field.discs]

    def _constants(self, layered_states, given):
        """The time constant of every layered state: as given, else as its rate shows it."""
        rates = dict(zip(self._field.states, self._field.rates, strict=True))
        what = "`time_constant`"
        given = self._spread(checks.mapping(given, what, "states to time constants"), what)
        given = {
            checks.lookup(key, self._field.states, what, "state"): (
                checks.lookup(beta, self.parameters, f"{what} of {key}", "parameter")
                if isinstance(beta, str)
                else checks.expression(beta, f"{what} of {key}")
            )
            for key, beta in given.items()
        }
        found = {z: given.get(z) or time_constant(z, rates[z], self.parameters) for z in layered_states}
        for z, beta in found.items():
            checks.positive(beta.subs(self.parameters), f"`time_constant` {beta} of {z.name!r}")
        return found

    def _fresh(self, name):
        """A parameter symbol of a name that the system does not use yet."""
        lams = () if self._element else self._lams  # those of elements bear the marks of elements
        taken = {str(self.model.time), *map(str, lams), *self.groups}
        for named in (self.model.parameters, self.model.states):
            taken.update(named.blocks if isinstance(named, Symbols) else (s.name for s in named))
        while name in taken:
            name += "_"
        return sp.Symbol(name, positive=True)

    def _of_element(self, element, values, view):
        """The view of which this is one element."""
        other = self._derived(None, element.model, values, view)
        other._element = element
        return other

    def _derived(self, field, model, values, view):
        other = copy.copy(self)
        other.__dict__.pop("_field", None)
        if field is not None:
            other._field = field
        other.model, other._view, other._cache = model, view, {}
        other.parameters = carried(model.parameters, self.parameters, values)
        many = isinstance(self.parameters, Numbers)
        dropped = [] if many else [p for p in self.parameters if p not in other.parameters]
        other._notes = tuple(f"{p} drops out of this view" for p in dropped)
        return other

    # ---- in files

    def _written(self):
        """What was written, views and values: a nest that definition/tree.py can write, and `_read` reads."""
        values = {p.name: value for p, value in self.parameters.items()}
        if self._view:
            kind, *_, original, arguments = self._view
            return {"view": kind, "of": original._written(), "arguments": arguments, "values": values}
        names = ("rates", "time", "parameters", "outputs", "events", "contacts", "algebraic", "drives")
        kept = {"constraints": self._constraints} if self._constraints else {}
        return dict(zip(names, self._arguments)) | {"convention": self._convention, "values": values, **kept}

    @classmethod
    def _read(cls, written):
        """The System of `_written`; KeyError, TypeError or ValueError for what is none."""
        if "view" in written:
            original = cls._read(written["of"])
            make = {"smoothed": original.smoothed, "layered": original.layered}[written["view"]]
            system = make(**written["arguments"])
        else:
            system = cls(
                **{name: part for name, part in written.items() if name not in ("values", "constraints")}
            )
            system._constraints = tuple(written.get("constraints", ()))
        # A run with kicks has one parameter more, their period.
        return system.with_parameters({p.name: written["values"][p.name] for p in system.parameters})


class FunctionSystem(System):
    """A System of functions: without formulas, and so without what needs them."""

    _by_element = False

    def __init__(self, definition):
        self._element = definition
        self.parameters, self.model = definition.parameters, definition.model
        self._arguments, self._convention, self._view, self._notes, self._cache = (), "hidden", None, (), {}

    def initial_state(self, x0, t0=None):
        start = super().initial_state(x0, t0)
        if t0 is not None:
            check_start(self.model, t0, start, self.parameter_values)
        return start

    def _refused(self, *_, **__):
        raise TypeError(
            "this system is made of functions (System.from_functions), which solve() alone runs: there are no formulas "
            "to take views, derivatives, switches or files from. Write the model in symbols for that."
        )

    definition = _field = switches = discs = hidden_terms = property(_refused)
    smoothed = layered = _backward = _extended = _written = _refused

    def _described(self):
        rows = {
            "switches": [f"{mu.symbol} = sign(h)" for mu in self.model.multipliers],
            "events": [event.name for event in self.model.events],
            "parameters": [f"{p} = {value:g}" for p, value in self.parameters.items()],
        }
        return f"System of functions with states {', '.join(map(str, self.states))}", rows.items()


def _name_of(switch):
    """What a switch or a disc is found by."""
    return switch.name if isinstance(switch, Disc) else switch
