"""Primitives: what a model says beyond ordinary notation.

    Switch      lambda = sign h off the surface h = 0, lambda in [-1, 1] on it
    Disc        the vector lambda = h/|h| off h = 0 (two or three numbers), |lambda| <= 1 on it
    Memory      a value that changes only in events
    Event       at h = 0, or at given instants: resets, latches, flags, stops
    Unilateral  0 <= h  complementary to  R >= 0, with Newton's law at impacts
    Algebraic   an unknown that its residual determines inside the right-hand side

`Switch`, `Memory`, the components of a `Disc` and the reaction of a `Unilateral` are sympy Symbols: they stand in
expressions like any other name. What defines them is part of their identity, as sympy shares plain Symbols by name.
Elements of one kind (multistate laws, spring-block chains) are in family.py.
Chain: primitives (here) -> lifting.py -> system.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from ..door import checks

TOGETHER = "add", "set"  # what of an assignment and of what others add to the same state holds


@checks.door()
class Switch(sp.Symbol):
    """The multiplier lambda of a switching surface: sign(surface) off it, between -1 and 1 on it.

    Parameters
    ----------
    name : str
        Name of the multiplier.
    surface : Expr
        h(t, x), in the sense lambda = 1 where h > 0. Its unit is the unit of a smoothing width eps.

    Raises
    ------
    ValueError, TypeError
        The surface is a constant, or no expression; a name that is no string.

    Source: Filippov 1988 for the surface; Jeffrey, On the mathematical basis of solid friction, for lambda as a
    variable of its own on it.

    >>> v = sp.Symbol("v", real=True)
    >>> lam = Switch("lam", v)
    >>> lam.surface
    v
    >>> lam == Switch("lam", v + 1)
    False
    """

    __slots__ = ("surface",)

    def __new__(cls, name, surface):
        name = _name(name, "Switch")
        surface = checks.expression(surface, f"`surface` of Switch {name!r}")
        if not surface.free_symbols:
            raise ValueError(
                f"`surface` of Switch {name!r} is the constant {surface}: it never switches. "
                "Give an expression of time and states that changes sign."
            )
        self = sp.Symbol.__xnew__(cls, name, real=True)
        self.surface = surface
        return self

    def __getnewargs_ex__(self):
        return (self.name, self.surface), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.surface)

    def _sympyrepr(self, printer, *args):
        return f"Switch({self.name!r}, {printer._print(self.surface)})"


class Component(sp.Symbol):
    """One component of the multiplier of a `Disc`, made by it."""

    __slots__ = ("disc", "index")

    def __new__(cls, disc, index):
        self = sp.Symbol.__xnew__(cls, f"{disc.name}_{'xyz'[index]}", real=True)
        self.disc, self.index = disc, index
        return self

    def __getnewargs_ex__(self):
        return (self.disc, self.index), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.disc.surfaces)

    def _sympyrepr(self, printer, *args):
        return f"{self.disc!r}[{self.index}]"


@checks.door()
@dataclass(frozen=True, init=False)
class Disc:
    """The vector multiplier of a vector surface h: lambda = h/|h| where h is not 0, |lambda| <= 1 where it is.

    Coulomb's law in the plane and in space: with h the velocity of a body that slides, the friction force is -mu N
    lambda, along the slip, and any force in the disc of radius mu N where it sticks.

    Parameters
    ----------
    name : str
        Name of the multiplier; its components are name_x, name_y, name_z.
    surfaces : sequence of Expr, length 2 or 3
        h(t, x), all in one unit, that of a smoothing width eps.

    Attributes
    ----------
    name : str
    surfaces : tuple of Expr
    components : tuple of Symbol
        The components of lambda, for the right-hand side; the disc itself unpacks to them, and ``lam[0]`` is the first.

    Raises
    ------
    ValueError, TypeError
        One surface, for which there is `Switch`, none or more than three; constants, or twice the same; no expressions.

    Notes
    -----
    Hidden terms vanish at |lambda| = 1, such as 1 - lam.square. An ellipse of friction with the matrix M of half-axes
    needs no other disc: h = M v with the force -M lambda (the most dissipation), or h = v with it (along the slip).

    Source: Filippov 1988 for surfaces of codimension 2; Antali and Stepan, SIAM J. Appl. Dyn. Syst. 17 (2018) 823, for
    limit directions.

    A block is thrown on a plane. It stops at |v|/mu after |v|^2/(2 mu), and stays:

    >>> x, y, vx, vy = sp.symbols("x y vx vy", real=True)
    >>> lam = Disc("lam", (vx, vy))
    >>> block = System({x: vx, y: vy, vx: -lam[0] / 2, vy: -lam[1] / 2})
    >>> thrown = solve(block, (0, 4), {x: 0, y: 0, vx: 0.6, vy: 0.8})
    >>> thrown.itinerary
    ('slip (lam)', 'stick (lam sliding)')
    >>> print(f"{thrown.events[0].time:.9f} {thrown['x'][-1]:.9f} {thrown['y'][-1]:.9f}")
    2.000000000 0.600000000 0.800000000
    """

    name: str
    surfaces: tuple[sp.Expr, ...]

    def __init__(self, name, surfaces):
        name = _name(name, "Disc")
        given = checks.several(surfaces, f"`surfaces` of Disc {name!r}")
        surfaces = tuple(checks.expression(h, f"`surfaces` of Disc {name!r}") for h in given)
        if len(surfaces) not in (2, 3):
            hint = "; of one surface it is a Switch" if len(surfaces) == 1 else ""
            raise ValueError(f"`surfaces` of Disc {name!r} are {len(surfaces)}; give two or three{hint}.")
        for k, h in enumerate(surfaces):
            if not h.free_symbols:
                raise ValueError(
                    f"`surfaces` of Disc {name!r} contain the constant {h}: it never changes. "
                    "Give expressions of time and states."
                )
            if h in surfaces[:k] or -h in surfaces[:k]:
                raise ValueError(
                    f"`surfaces` of Disc {name!r} contain {h} twice; give components of a vector, such as (vx, vy)."
                )
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "surfaces", surfaces)

    @property
    def components(self):
        """The components of lambda."""
        return tuple(Component(self, i) for i in range(len(self.surfaces)))

    def __iter__(self):
        return iter(self.components)

    def __len__(self):
        return len(self.surfaces)

    def __getitem__(self, index):
        return self.components[index]

    @property
    def square(self):
        """Its square lambda . lambda: 1 in slip, less in stick."""
        return sp.Add(*(lam**2 for lam in self))

    @property
    def size(self):
        """The size of h, |h| = lambda . h, continuous: the slip speed where h is a velocity."""
        return sp.Add(*(lam * h for lam, h in zip(self, self.surfaces, strict=True)))


@checks.door()
class Memory(sp.Symbol):
    """A value that changes only in events: a latched impact speed, a stick/slip flag.

    Parameters
    ----------
    name : str
        Its name, as that of any symbol.
    initial : float, in the unit that the model gives it
        Its value at the start unless the initial state gives another.
    **assumptions
        As of `sympy.Symbol`; real by default.

    >>> stuck = Memory("stuck", 1)
    >>> stuck.initial
    1.0
    """

    __slots__ = ("initial",)

    @checks.door(checks.ASSUMPTIONS)
    def __new__(cls, name, initial=0.0, **assumptions):
        name = _name(name, "Memory")
        initial = checks.number(initial, f"`initial` of Memory {name!r}")
        self = sp.Symbol.__xnew__(cls, name, **({"real": True} | assumptions))
        self.initial = initial
        return self

    def __getnewargs_ex__(self):
        return (self.name, self.initial), self._assumptions_orig

    def _hashable_content(self):
        return (*super()._hashable_content(), self.initial)

    def _sympyrepr(self, printer, *args):
        return f"Memory({self.name!r}, {self.initial!r})"


class Reaction(sp.Symbol):
    """The contact force R of a `Unilateral`, made by it."""

    __slots__ = ("gap", "restitution")

    def __new__(cls, name, gap, restitution):
        self = sp.Symbol.__xnew__(cls, name, real=True)
        self.gap, self.restitution = gap, restitution
        return self

    def __getnewargs_ex__(self):
        return (self.name, self.gap, self.restitution), {}

    def _hashable_content(self):
        return (*super()._hashable_content(), self.gap, self.restitution)

    def _sympyrepr(self, printer, *args):
        return f"Reaction({self.name!r}, {printer._print(self.gap)}, {printer._print(self.restitution)})"


@checks.door()
@dataclass(frozen=True, init=False)
class Unilateral:
    """A unilateral constraint 0 <= h, complementary to its reaction R >= 0.

    The reaction stands in the rates of the velocities, in the direction in which it pushes. Impacts follow
    Newton's law; a closed contact carries the R that keeps d2h/dt2 = 0, until R would become negative. What R
    integrates to over an impact is the `impulse` of that event of the solution.

    Parameters
    ----------
    gap : Expr
        h(t, x), the distance that cannot become negative; a position, so that R stands in its second
        derivative.
    restitution : float or Expr, dimensionless
        e in  dh/dt after = -e dh/dt before, 0 <= e <= 1.
    name : str
        Name of the reaction.

    Raises
    ------
    ValueError, TypeError
        A gap that is a constant, a restitution outside [0, 1], no expressions.

    Source: Signorini's condition 0 <= h, R >= 0, h R = 0, and Newton's impact law.

    A ball of mass 1 on a floor; its bounces add up to (1 + e)/(1 - e) times the time of the first fall:

    >>> y, v = sp.symbols("y v", real=True)
    >>> floor = Unilateral(y, restitution=0.5, name="R")
    >>> ball = System({y: v, v: -9.81 + floor.reaction})
    >>> solution = solve(ball, (0, 2), {y: 1, v: 0})
    >>> print(f"at rest from {solution.events[-1].time:.6f}; {3 * math.sqrt(2 / 9.81):.6f}")
    at rest from 1.354571; 1.354571
    """

    gap: sp.Expr
    restitution: sp.Expr
    name: str

    def __init__(self, gap, restitution=0, name="R"):
        name = _name(name, "Unilateral")
        gap = checks.expression(gap, "`gap` of a Unilateral")
        restitution = checks.expression(restitution, "`restitution` of a Unilateral")
        if not gap.free_symbols:
            raise ValueError(f"`gap` of Unilateral {name!r} is the constant {gap}; give a distance h(t, x).")
        # An elastic impact returns all; more would make energy out of nothing at every bounce.
        if restitution.is_number and not 0 <= float(restitution) <= 1:
            raise ValueError(f"`restitution` of Unilateral {name!r} is {restitution}; give 0 <= e <= 1.")
        object.__setattr__(self, "gap", gap)
        object.__setattr__(self, "restitution", restitution)
        object.__setattr__(self, "name", name)

    @property
    def reaction(self):
        """The Symbol R, for the right-hand side."""
        return Reaction(self.name, self.gap, self.restitution)


@checks.door()
@dataclass(frozen=True, init=False)
class Algebraic:
    """An unknown of the right-hand side with residual(t, x, a) = 0: an acceleration in its own friction law.

    Parameters
    ----------
    unknown : Symbol or str
        The a that the residual determines; it stands in the rates.
    residual : Expr
        Monotone in the unknown, so that there is one root.

    Raises
    ------
    ValueError, TypeError
        A residual without the unknown; no Symbol, no expression.

    >>> a, v = sp.symbols("a v", real=True)
    >>> body = System({v: a}, algebraic=[Algebraic(a, a + a**3 + v)])
    >>> solution = solve(body, (0, 1), {v: 2})
    >>> round(float(solution["a"][0]), 9)  # a + a^3 = -2
    -1.0
    """

    unknown: sp.Symbol
    residual: sp.Expr

    def __init__(self, unknown, residual):
        residual, unknown = checks.expression(residual, "`residual` of an Algebraic"), checks.named(unknown)
        if isinstance(unknown, str):
            named = [s for s in residual.free_symbols if s.name == unknown]
            unknown = named[0] if len(named) == 1 else sp.Symbol(unknown, real=True)
        if not isinstance(unknown, sp.Symbol):
            raise TypeError(f"`unknown` of an Algebraic is {checks.shown(unknown)}; give a Symbol or its name.")
        if unknown not in residual.free_symbols:
            raise ValueError(
                f"`residual` of Algebraic {unknown.name!r} is {residual}, in which the unknown does not stand; "
                "give a residual that determines it."
            )
        object.__setattr__(self, "unknown", unknown)
        object.__setattr__(self, "residual", residual)


@checks.door()
@dataclass(frozen=True, init=False)
class Event:
    """Something that happens at an instant: `surface` reaches zero, or the clock strikes.

    Without `update` it is only recorded.
    At one instant all events whose `when` holds act on the values before; this is repeated until none newly
    acts. Switches are classified afterwards, with the field after.
    What they add to one state, an update x -> x + e where e does not read x, adds up; every other update assigns. An
    assignment beside another write of that state that differs is recorded as an ambiguity ("conflicting updates"), at
    which `strict=True` stops.
    An update that carries the state through the surface of an event fires that as well, but no event that acts with it.

    Parameters
    ----------
    surface : Expr, optional
        h(t, x): the event is a zero of it that the motion comes to; a start on it is none. Exactly one of `surface`,
        `every`, `at` is given.
        In `System.from_functions` surface(t, x, p), update(t, x, p) and when(t, x, p) are functions.
    every : float or Expr, in units of time, optional
        The event happens at every, 2*every, ..., up to the end of a run and not at its start.
    at : float, Expr or sequence of them, length n, in units of time, optional
        The instants at which it happens, the start of a run among them, unless that continues a Solution.
    direction : {0, 1, -1}
        Only zeros at which h rises (1) or falls (-1); 0: both.
    update : mapping of (state or memory) to Expr
        New values, from the values before; what is not named keeps its value.
    when : condition
        The event acts only if it holds at that instant.
    terminal : bool
        The run stops here.
    name : str, optional
        What the records of the solution call it.
    together : {None, "add", "set"}
        What a state becomes that this event assigns and others of the same instant add to: with "add" what is
        assigned and what they add, as of a site that topples beside others that do; with "set" what is assigned,
        whatever follows at this instant, as of an oscillator that fires with others and does not feel them.
        Event-driven runs only, without derivatives.

    Raises
    ------
    ValueError, TypeError
        None or several of `surface`, `every`, `at`; a direction of a clock; what is no expression or condition.

    A count of the turns of a pendulum, and a stop at the third:

    >>> x, w = sp.symbols("x w", real=True)
    >>> turns = Memory("turns", 0)
    >>> count = Event(w, update={turns: turns + 1}, name="turn")
    >>> stop = Event(w, when=sp.Eq(turns, 2), terminal=True, name="third")
    >>> swing = System({x: w, w: -sp.sin(x)}, events=[count, stop])
    >>> solution = solve(swing, (0, 100), {x: 1, w: 0})
    >>> solution.outcome.name, [event.switch for event in solution.events]
    ('TERMINATED', ['turn', 'turn', 'third'])
    """

    surface: sp.Expr | Callable | None
    every: sp.Expr | None
    at: tuple[sp.Expr, ...]
    direction: int
    update: Any  # pairs (state or memory, Expr); in a system of functions a function, as the other two
    when: sp.Basic | Callable
    terminal: bool
    name: str | None
    together: str | None

    def __init__(
        self,
        surface=None,
        *,
        every=None,
        at=None,
        direction=0,
        update=None,
        when=True,
        terminal=False,
        name=None,
        together=None,
    ):
        causes = [k for k, value in {"surface": surface, "every": every, "at": at}.items() if value is not None]
        if len(causes) != 1:
            raise ValueError(
                f"an Event needs exactly one of `surface`, `every`, `at`; given: {', '.join(causes) or 'none'}."
            )
        for part, value in {"surface": surface, "update": update, "when": when}.items():
            if checks.is_function(value):
                checks.takes(value, ("t", "x", "p"), f"`{part}` of an Event")
        direction = checks.one_of(1, -1, 0)(direction, "`direction` of an Event")
        if causes[0] != "surface" and direction:
            raise ValueError(f"`direction` has no meaning for an Event with `{causes[0]}`; leave it out.")
        if surface is not None and not checks.is_function(surface):
            surface = checks.expression(surface, "`surface` of an Event")
            if not surface.free_symbols:
                raise ValueError(f"`surface` of an Event is the constant {surface}; it never reaches zero.")
        if every is not None:
            every = checks.expression(every, "`every` of an Event")
            if every.is_number and not (every.is_finite and every > 0):
                raise ValueError(f"`every` of an Event is {every}; give a period > 0.")
        if at is not None:
            at = at if isinstance(at, Iterable) and not isinstance(at, (str, bytes)) else (at,)
            at = tuple(checks.expression(a, "`at` of an Event") for a in at)
            if not at or any(a.is_number and not a.is_finite for a in at):
                raise ValueError(f"`at` of an Event is {at}; give finite instants.")
        if not checks.is_function(update):
            if update is not None and not isinstance(update, Mapping):
                raise TypeError(
                    f"`update` of an Event is {checks.shown(update)}; give a dict of state or memory to value."
                )
            update = tuple(
                (checks.named(key), checks.expression(value, f"`update` of an Event, value of {key}"))
                for key, value in (update or {}).items()
            )
        if not checks.is_function(when):
            when = sp.true if when is True else sp.false if when is False else when
            if isinstance(when, sp.Symbol) or not isinstance(when, sp.logic.boolalg.Boolean):
                raise TypeError(
                    f"`when` of an Event is {checks.shown(when)}; give a condition, as sp.Eq(flag, 0) or v > 0."
                )
            when = checks.plain_states(when, "`when` of an Event")
        terminal = checks.flag(terminal, "`terminal` of an Event")
        name = None if name is None else _name(name, "Event")
        if together is not None:
            together = checks.one_of(*TOGETHER)(together, "`together` of an Event")
        values = (surface, every, at or (), direction, update, when, terminal, name, together)
        for key, value in zip(self.__dataclass_fields__, values, strict=True):
            object.__setattr__(self, key, value)


def _name(name, kind):
    if not isinstance(name, str) or not name:
        raise TypeError(f"`name` of a {kind} is {checks.shown(name)}; give a string that is not empty.")
    return name


def symbols_of(expressions):
    """All symbols of the expressions, those inside of surfaces and gaps too; the inner ones first."""
    symbols: dict[sp.Symbol, None] = {}

    def visit(e):
        for s in sorted(e.free_symbols, key=lambda s: s.name):
            if s in symbols:
                continue
            for part in ("surface", "gap", "restitution", "outside"):
                if (inner := getattr(s, part, None)) is not None:
                    visit(inner)
            if isinstance(s, Component):
                for h in s.disc.surfaces:
                    visit(h)
            symbols[s] = None

    for e in expressions:
        visit(e)
    return list(symbols)
