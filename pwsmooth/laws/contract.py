"""The contract of a law: internal states and their rates, a force, and parameters, from the motion of a joint.

    dz/dt = Q(z, x, v, N; p),     f = N F(z, x, v, dz/dt; p)

A law is a frozen dataclass; its fields are its parameters, each with unit, meaning and default. `attach` gives its
symbolic pieces at a joint, whose position, velocity and load are expressions of whatever system it is part of: a
prescribed-motion rig, an oscillator, a mechanism's joint. A scene assembles pieces into a System (scenes/).

Signs. Friction: f > 0 for v > 0, so that a body obeys m dv/dt = u - f. Contact: the position is the indentation,
and f >= 0 is the magnitude of the repulsive force.
Load. Without a normal load f and all parameters are in newtons; with one the law is per unit of load, f = N F,
and strengths, stiffnesses and dampings become coefficients. Where the load vanishes or begins,
internal states are reset.
Chain: primitives.py, family.py -> **law** -> laws/friction, laws/contact -> scenes -> System.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, ClassVar, dataclass_transform

import sympy as sp

from ..definition.lambdified import numpy_function
from ..definition.model import of_event
from ..definition.primitives import Algebraic, Event, Unilateral, symbols_of
from ..door import checks
from .documenting import documented
from .joint import Joint

__all__ = ["Joint", "Law", "Pieces", "law", "parameter"]

_SIGNS = {
    "positive": (lambda x: x > 0, "> 0"),
    "nonnegative": (lambda x: x >= 0, ">= 0"),
    "real": (lambda x: True, "finite"),
}


@checks.door()
@dataclass_transform(frozen_default=True, kw_only_default=True)
def law(declared: Any) -> Any:
    """Decorator of every law: a frozen dataclass whose fields are given by name.

    Its docstring gets the sections that the declarations already say: Parameters, Raises and the source.

    Parameters
    ----------
    declared : type
        A subclass of `Law` whose fields are made by `parameter`.

    Returns
    -------
    type
        The same class.

    >>> @law
    ... class Viscous(Law):
    ...     c: float = parameter(0.5, "N s/m", "damping")
    >>> Viscous(c=2.0)
    Viscous(c=2.0)
    """
    return checks.door()(documented(dataclasses.dataclass(frozen=True, kw_only=True)(declared)))


@checks.door(
    unit=checks.name, meaning=checks.name, sign=checks.one_of(*_SIGNS), each=checks.flag, structural=checks.flag
)
def parameter(
    default: Any,
    unit: str,
    meaning: str,
    sign: str = "positive",
    *,
    each: bool = False,
    structural: bool = False,
    choices: Sequence[str] = (),
) -> Any:
    """A field of a law.

    Parameters
    ----------
    default : float or tuple of float, unit `unit`
        Its value where none is given.
    unit : str
        Of the source; "1" for a pure number. Any consistent set of units will do.
    meaning : str
        What it is, in words that stand in error messages and docstrings.
    sign : {"positive", "nonnegative", "real"}
        What the value must be; also the assumption of its symbol.
    each : bool
        One value for each element of a multistate law; a single number serves all of them.
    structural : bool
        It shapes the equations (an exponent, a choice): a number in them, no symbol that a sweep can change.
    choices : sequence of str
        It is one of these words, and structural.

    Returns
    -------
    dataclasses.Field
        With all this as its metadata.

    >>> parameter(1.0, "N", "Coulomb force").metadata["unit"]
    'N'
    """
    choices = checks.several(choices, "`choices`")
    about = {"unit": unit, "meaning": meaning, "sign": sign, "each": each,
             "structural": structural or bool(choices), "choices": choices}  # fmt: skip
    return dataclasses.field(default=default, metadata=about)


@checks.door()
@dataclasses.dataclass(frozen=True)
class Pieces:
    """What a law brings to a system at one joint.

    Attributes
    ----------
    force : Expr or tuple of Expr
        In the unit of the strengths, per unit of load where there is one; one for each component of the velocity.
    rates : dict of state to Expr
        dz/dt of the internal states.
    start : dict of state to (float or Expr)
        Relaxed initial values in the state's unit, which may depend on the motion at the start.
    scales : dict of state to float
        Usual sizes in the state's unit: a bristle's deflection is 1e-5 m, so that an absolute tolerance of 1e-12 m is a
        poor one.
    parameters : dict of Symbol to (float or sequence of float)
        Values, in the units of the law; one for each element of a multistate law, length n.
    events, contacts, algebraic : tuple
        Of Event, of Unilateral and of Algebraic.
    outputs : dict of str to Expr
        Named quantities of the law besides its force.
    surfaces : tuple of Expr
        h(t, x, ...) of its switchings; one with members of a family stands for all of them.
    fastest_rate : Expr
        Of its internal states, 1/s, away from switchings: what makes it stiff.

    >>> v = sp.Symbol("v", real=True)
    >>> pieces = Dahl(sigma0=1e5, F_c=2.0).attach(velocity=v)
    >>> pieces.force, pieces.rates, pieces.fastest_rate
    (sigma0*z, {z: v - sigma0*z*Abs(v)/F_c}, sigma0*Abs(v)/F_c)
    """

    force: Any
    rates: Mapping[Any, sp.Expr] = dataclasses.field(default_factory=dict)
    start: Mapping[Any, Any] = dataclasses.field(default_factory=dict)
    scales: Mapping[Any, float] = dataclasses.field(default_factory=dict)
    parameters: Mapping[sp.Symbol, Any] = dataclasses.field(default_factory=dict)
    events: tuple[Event, ...] = ()
    contacts: tuple[Unilateral, ...] = ()
    algebraic: tuple[Algebraic, ...] = ()
    outputs: Mapping[str, sp.Expr] = dataclasses.field(default_factory=dict)
    surfaces: tuple[sp.Expr, ...] = ()
    fastest_rate: sp.Expr = sp.S.Zero

    @property
    def states(self) -> tuple[Any, ...]:
        """The internal states."""
        return tuple(self.rates)


@checks.door()
class Law:
    """Base of all laws; a law has `source`, its fields, and `pieces`.

    Raises
    ------
    ValueError, TypeError
        Of every law: a value of the wrong sign, not finite, or no number.

    >>> @law
    ... class Bristle(Law):
    ...     source = "Dahl 1968, exponent 1"
    ...     stiffness: float = parameter(1e5, "N/m", "stiffness at rest")
    ...     F_c: float = parameter(1.0, "N", "Coulomb force")
    ...
    ...     def pieces(self, at, p):
    ...         z = at.state("z")
    ...         rate = at.v - p.stiffness*sp.Abs(at.v)*z/p.F_c
    ...         return Pieces(force=p.stiffness*z, rates={z: rate}, surfaces=(at.v,))
    >>> v = sp.Symbol("v", real=True)
    >>> Bristle(F_c=2.0).attach(velocity=v).rates
    {z: v - stiffness*z*Abs(v)/F_c}
    >>> Bristle(F_c=-1.0)
    Traceback (most recent call last):
        ...
    ValueError: `F_c` of Bristle is -1.0; the Coulomb force must be > 0 (N).
    """

    source: ClassVar[str] = ""  # where the equations and the defaults come from
    certainty: ClassVar[str] = ""  # "reconstructed" where the original was not available
    in_plane: ClassVar[bool] = False  # whether it acts along velocities with components, too
    spins: ClassVar[bool] = (
        False  # whether its velocity is that of a contact that spins, too: (v_x, v_y, omega)
    )
    kind: ClassVar[str] = ""  # "friction" or "contact"; a law without it is taken by scenes of either
    needs: ClassVar[tuple[str, ...]] = ()  # of "position", "acceleration": inputs besides the velocity

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "steady" in vars(cls):  # sympy's functions, of which it is made, would evaluate text
            cls.steady = checks.door(v=checks.expression)(cls.steady)  # type: ignore[method-assign]

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            self._check(field)
        self.check()

    def check(self) -> None:
        """Relations between parameters; raises ValueError with the names and the remedy."""

    def pieces(self, at: Joint, p: Any) -> Pieces:
        """Force and rates at a joint, per unit of load: what a law of one's own defines.

        Parameters
        ----------
        at : Joint
            The motion there, and the maker of states, memories and switches.
        p : namespace
            The parameters' symbols as attributes.

        Returns
        -------
        Pieces
            With force and rates; start, scales and parameters are filled in by `attach`.
        """
        raise NotImplementedError

    def steady(self, v: Any, p: Any) -> sp.Expr:
        """Steady force at constant velocity, per unit of load, where the law has one; an odd function of v.

        Parameters
        ----------
        v : Expr
            Velocity.
        p : namespace
            The parameters, as symbols or values.

        Returns
        -------
        Expr
            In the unit of the strengths.
        """
        raise NotImplementedError(
            f"{type(self).__name__} has no steady curve: its force depends on the position."
        )

    # ---- for users and scenes

    @checks.door(
        velocity=checks.velocity, position=checks.optional(checks.velocity),
        **dict.fromkeys(("normal", "acceleration", "time"), checks.optional(checks.expression)),
        name=checks.name, **dict.fromkeys(("beyond", "past"), checks.optional(checks.function)),
    )  # fmt: skip
    def attach(self, *, velocity: Any, position: Any = None, normal: Any = None, acceleration: Any = None,
               time: Any = None, name: str = "", beyond: Any = None, past: Any = None) -> Pieces:  # fmt: skip
        """The law's pieces at a joint.

        Parameters
        ----------
        velocity : Expr or sequence of Expr, length 2 or 3
            At the joint. With components, in the plane or in space, the force has as many; `in_plane` says whether the
            law has such a form.
        position : Expr or sequence of Expr
            At the joint, with as many components as the velocity; `needs` says whether the law uses it.
        normal : Expr, optional
            Normal load; the law is per unit of load then. One that stays at zero is written Max(0, ...).
        acceleration : Expr, optional
            Where the law `needs` it.
        time : Symbol, optional
            Time of the system.
        name : str
            Put behind the names of states and parameters, to tell several laws of a system apart.
        beyond : callable, optional
            Level -> expression with the zero and the sense of `position` - level, where the position itself is
            singular: of a journal at e in a bearing, position |e| - c, it is (e.e - (c + level)**2)/(2 c).
        past : callable, optional
            Level -> `position` - level, written such that in rounding too its sign is that of `beyond`.

        Returns
        -------
        Pieces
            Force, rates, starts and parameters, ready for `assemble` or a System.

        Raises
        ------
        ValueError
            An input that the law needs is missing; components of a velocity, along which the law has no form.
        """
        if isinstance(velocity, tuple) and not self.in_plane:
            raise ValueError(
                f"`velocity` has {len(velocity)} components, and {type(self).__name__} is a law of one velocity; laws "
                "with `in_plane` have a form with components, such as Coulomb, StribeckFriction, LuGre and XKY."
            )
        if self.spins and not (isinstance(velocity, tuple) and len(velocity) == 3):
            raise ValueError(
                f"`velocity` of {type(self).__name__} is {checks.shown(velocity)}; its contact slides and spins: give "
                "(v_x, v_y, omega) at its centre."
            )
        sizes = [len(e) if isinstance(e, tuple) else 1 for e in (velocity, position)]
        if position is not None and sizes[0] != sizes[1]:
            raise ValueError(
                f"`position` has {sizes[1]} components and the velocity of the joint {sizes[0]}; give as many."
            )
        inputs = {"position": position, "acceleration": acceleration}
        for what in self.needs:
            if inputs[what] is None:
                raise ValueError(
                    f"{type(self).__name__} needs the {what} of its joint; give attach({what}=...)."
                )
        at = Joint(velocity, position, acceleration, normal, time, name, beyond, past)
        symbols, values = self._symbols(at)
        pieces = self.pieces(at, SimpleNamespace(**symbols))
        used = _names_in(pieces)
        return dataclasses.replace(
            pieces,
            force=at.each(lambda f: at.load * f, pieces.force),
            start={z: at.starts.get(z, 0.0) for z in pieces.rates},
            scales={z: at.scales.get(z, 1.0) for z in pieces.rates},
            parameters={s: value for s, value in values.items() if s.name in used},
            events=(*pieces.events, *self._resets(at, pieces)),
            outputs={at.label(key): e for key, e in pieces.outputs.items()},
        )

    @checks.door(velocity=checks.array)
    def steady_force(self, velocity: Any) -> Any:
        """Steady force at constant velocities.

        Parameters
        ----------
        velocity : float or array_like, any shape
            In the velocity unit of the law.

        Returns
        -------
        float or ndarray
            Of the shape of `velocity`, in the unit of the strengths, per unit of load.

        Raises
        ------
        NotImplementedError
            The force depends on the position: there is no such curve.
        """
        v = sp.Symbol("v", real=True)
        steady = self.steady(v, SimpleNamespace(**self.values))
        return numpy_function(v, sp.sympify(steady, strict=True))(velocity)

    @property
    def values(self) -> dict[str, Any]:
        """Parameter -> value."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}  # type: ignore[arg-type]

    @classmethod
    def units(cls) -> dict[str, str]:
        """Units of the parameters.

        Returns
        -------
        dict of str to str
            Parameter -> unit; "1" is a pure number.
        """
        return {f.name: f.metadata["unit"] for f in dataclasses.fields(cls)}  # type: ignore[arg-type]

    @classmethod
    def meanings(cls) -> dict[str, str]:
        """What the parameters are.

        Returns
        -------
        dict of str to str
            Parameter -> what it is.
        """
        return {f.name: f.metadata["meaning"] for f in dataclasses.fields(cls)}  # type: ignore[arg-type]

    # ---- inside

    @property
    def elements(self) -> int:
        """Number of elements of a multistate law: as many as its longest parameter; 1 of any other."""
        each = [v for f, v in self._each() if isinstance(v, tuple)]
        return max(map(len, each), default=1)

    def _each(self):
        return [(f, getattr(self, f.name)) for f in dataclasses.fields(self) if f.metadata["each"]]  # type: ignore[arg-type]

    def _check(self, field):
        about, value = field.metadata, getattr(self, field.name)
        owner = f"`{field.name}` of {type(self).__name__}"
        if about["choices"]:
            checks.one_of(*about["choices"])(value, owner)
            return
        if about["each"]:
            value = value.tolist() if hasattr(value, "tolist") else value
            if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
                value = tuple(value)
        test, words = _SIGNS[about["sign"]]
        if isinstance(value, tuple):
            if not about["each"]:
                raise TypeError(f"{owner} is {checks.shown(value)}; give one number.")
            if not value:
                raise ValueError(f"{owner} is empty; give one value for each element.")
            value = tuple(checks.number(v, owner) for v in value)
        else:
            value = checks.number(value, owner)
        for v in value if isinstance(value, tuple) else (value,):
            if not test(v):
                raise ValueError(f"{owner} is {v!r}; the {about['meaning']} must be {words} ({about['unit']}).")
        lengths = {len(v) for _, v in self._each() if isinstance(v, (tuple, list))}
        if len(lengths) > 1:
            names = ", ".join(f.name for f, v in self._each() if isinstance(v, (tuple, list)))
            raise ValueError(
                f"{names} of {type(self).__name__} have different lengths {sorted(lengths)}; give one value for "
                "each element, or one number for all."
            )
        object.__setattr__(self, field.name, value)

    def _symbols(self, at):
        symbols, values = {}, {}
        family = at.family(self.elements)
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            about, value = field.metadata, getattr(self, field.name)
            if about["structural"]:
                symbols[field.name] = sp.nsimplify(value) if isinstance(value, float) else value
                continue
            assumption = {about["sign"]: True}
            if about["each"]:
                (symbol,) = family.symbols(at.label(field.name), **assumption)
            else:
                symbol = sp.Symbol(at.label(field.name), **assumption)
            symbols[field.name] = symbol
            values[symbol] = list(value) if isinstance(value, tuple) else value
        return symbols, values

    @staticmethod
    def _resets(at, pieces):
        """A contact that opens or closes forgets the deflections: they belong to the junctions that it had."""
        if at.load.is_positive or not pieces.rates:
            return ()
        ends = _ends_of(at.load, sp.true) or {at.load: sp.true}
        names = ["load vanishes", *(f"load vanishes, {i}" for i in range(2, len(ends) + 1))]
        return tuple(
            Event(surface, update=dict.fromkeys(pieces.rates, 0), when=when, name=at.label(name))
            for name, (surface, when) in zip(names, ends.items())
        )


def _ends_of(load, when):
    """Surfaces on which a load that is never negative comes to zero or leaves it, each with its condition.

    Not the load itself, which stays at zero: of Max(0, g) it is g, of a force in contact alone the contact's surface.
    """
    if isinstance(load, sp.Mul):
        return {surface: holds for factor in load.args for surface, holds in _ends_of(factor, when).items()}
    if isinstance(load, sp.Max) and len(load.args) == 2 and 0 in load.args:
        return {sp.Add(*load.args): when}
    if isinstance(load, sp.Piecewise) and len(load.args) == 2 and load.args[1].expr == 0:
        (force, contact), _ = load.args
        if isinstance(contact, sp.core.relational.Relational):
            return {contact.lhs - contact.rhs: when} | _ends_of(force, when & contact)
    return {}


def _names_in(pieces):
    """Names of all symbols that stand in the pieces, those in surfaces of switches too."""
    force = pieces.force if isinstance(pieces.force, tuple) else (pieces.force,)
    expressions = [*force, *pieces.rates.values(), *pieces.outputs.values()]
    expressions += [e for event in pieces.events for e in of_event(event)]
    expressions += [e for contact in pieces.contacts for e in (contact.gap, contact.restitution)]
    expressions += [item.residual for item in pieces.algebraic]
    return {s.name for s in symbols_of(e for e in expressions if isinstance(e, sp.Basic))}
