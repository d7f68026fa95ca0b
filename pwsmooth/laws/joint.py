"""Where a law acts: the motion there as expressions, and symbols that carry the joint's name.

Chain: primitives.py, family.py -> **joint** -> contract.py -> the laws.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from ..definition.families.family import Family, family_of
from ..definition.primitives import Disc, Memory, Switch
from ..door import checks

__all__ = ["Joint"]


@checks.door()
class Joint:
    """Where a law acts: the motion there as expressions, and symbols that carry the joint's name.

    Parameters
    ----------
    v : Expr or sequence of Expr, length 2 or 3
        Velocity; of a joint in the plane or in space its components.
    x : Expr or sequence of Expr, optional
        Position (or indentation), with as many components as the velocity.
    a : Expr, optional
        Acceleration.
    load : Expr, optional
        Normal load, 1 without.
    t : Symbol, optional
        Time.
    name : str
        Put behind the names of the joint's symbols.
    beyond : callable, optional
        Level -> surface with the zero and the sense of x - level.
    past : callable, optional
        Level -> x - level, written such that in rounding too its sign is that of `beyond`.

    Attributes
    ----------
    starts : dict of state to (float or Expr)
        Relaxed initial values, in the state's unit.
    scales : dict of state to float
        Usual sizes, in the state's unit.

    >>> v = sp.Symbol("v", real=True)
    >>> joint = Joint(v, name="left")
    >>> joint.state("z", scale=1e-5), joint.scales
    (z_left, {z_left: 1e-05})
    """

    @checks.door(
        v=checks.velocity, x=checks.optional(checks.velocity),
        **dict.fromkeys(("a", "load", "t"), checks.optional(checks.expression)),
        name=checks.name, **dict.fromkeys(("beyond", "past"), checks.optional(checks.function)),
    )  # fmt: skip
    def __init__(self, v, x=None, a=None, load=None, t=None, name="", beyond=None, past=None):
        self.name = name
        self.v, self.x, self.a, self.t = v, x, a, t
        self.beyond = beyond or (lambda level: self.x - level)
        self.past = past or (lambda level: self.x - level)
        self.load: Any = sp.S.One if load is None else load
        self.starts: dict[Any, Any] = {}
        self.scales: dict[Any, float] = {}

    def label(self, name: str) -> str:
        """`name` with the joint's name behind it.

        Parameters
        ----------
        name : str
            Of a state, parameter or event.

        Returns
        -------
        str
            "name_joint", or `name` where the joint has none.
        """
        return f"{name}_{self.name}" if self.name else name

    @checks.door(checks.ASSUMPTIONS, name=checks.text, start=checks.expression, scale=checks.positive)
    def state(self, name: str, start: Any = 0.0, scale: float = 1.0, **assumptions: bool) -> sp.Symbol:
        """An internal state of the law; where the velocity is that of every element of a family, one of each.

        What is known of it (`positive=True` of a strength) decides the class of switches in which it stands.

        Parameters
        ----------
        start : float or Expr
            Relaxed initial value in the state's unit; it may be an expression of the motion.
        scale : float
            Usual size in the state's unit, from which its absolute tolerance follows.

        Returns
        -------
        Symbol
            To stand in rates and force.
        """
        if family := family_of(*self.surfaces):
            return self.member(family, name, start, scale, **assumptions)
        symbol = sp.Symbol(self.label(name), **({"real": True} | assumptions))
        return self._known(symbol, start, scale)

    def _known(self, symbol, start, scale):
        self.starts[symbol], self.scales[symbol] = start, float(scale)
        return symbol

    @checks.door(checks.ASSUMPTIONS, name=checks.text)
    def memory(self, name: str, initial: float = 0.0, **assumptions: bool) -> Memory:
        """A value that changes only in events.

        Parameters
        ----------
        initial : float
            Value at the start, in the unit that the law gives it.
        **assumptions : bool
            Of the symbol.

        Returns
        -------
        Memory
            To stand in rates, surfaces and updates.
        """
        if family := family_of(*self.surfaces):
            return family.memory(self.label(name), initial)
        return Memory(self.label(name), initial, **assumptions)

    @checks.door(name=checks.text, surface=checks.expression)
    def switch(self, name: str, surface: sp.Expr) -> Switch:
        """The multiplier of a surface, for terms that are nonlinear in it.

        Parameters
        ----------
        surface : Expr
            Function h whose sign it is.

        Returns
        -------
        Expr
            A Switch; of a constant its sign.
        """
        return sp.sign(surface) if surface.is_number else Switch(self.label(name), surface)

    @property
    def surfaces(self) -> tuple[sp.Expr, ...]:
        """The components of the velocity, one or several."""
        return self.v if self.planar else (self.v,)

    @property
    def planar(self) -> bool:
        """Whether the velocity has components."""
        return isinstance(self.v, tuple)

    @checks.door(function=checks.function)
    def each(self, function: Any, *vectors: Any) -> Any:
        """What a function makes of numbers, of every component of vectors.

        Parameters
        ----------
        function : callable
            Of as many expressions as there are vectors.
        *vectors : Expr or sequence of Expr, length 2 or 3
            Velocity, multiplier, state: single ones at a joint with one velocity.

        Returns
        -------
        Expr or tuple of Expr
            One, or one for each component.
        """
        return (
            tuple(function(*row) for row in zip(*vectors, strict=True)) if self.planar else function(*vectors)
        )

    @checks.door(name=checks.text)
    def slip(self, name: str) -> Any:
        """The multiplier of the velocity: lambda = sign v, or v/|v| in the plane and in space.

        Returns
        -------
        Switch or Disc
            A Disc has a component for each of the velocity.
        """
        return Disc(self.label(name), self.v) if self.planar else self.switch(name, self.v)

    def square(self, lam: Any) -> sp.Expr:
        """Its square lambda . lambda, 1 in slip.

        Parameters
        ----------
        lam : Switch or Disc
            As `slip` makes it.

        Returns
        -------
        Expr
            Dimensionless.
        """
        return lam.square if self.planar else lam**2

    def speed(self) -> sp.Expr:
        """The size of the velocity, |v|.

        Returns
        -------
        Expr
            In the unit of the velocity; at a joint with components that of the disc named lam.
        """
        return self.slip("lam").size if self.planar else sp.Abs(self.v)

    @checks.door(
        name=checks.text, scale=checks.positive, family=checks.optional(checks.instance(Family, "a Family"))
    )
    def deflection(self, name: str, scale: float = 1.0, family: Family | None = None) -> Any:
        """An internal state for each component of the velocity.

        Parameters
        ----------
        name : str
            Without the joint's name; components get _x, _y, _z.
        family : Family, optional
            One for every element of it.

        Returns
        -------
        Symbol or tuple of Symbol
            One at a joint with one velocity.
        """
        names = [f"{name}_{axis}" for axis, _ in zip("xyz", self.v, strict=False)] if self.planar else [name]
        made = [
            self.state(n, scale=scale) if family is None else self.member(family, n, scale=scale) for n in names
        ]
        return tuple(made) if self.planar else made[0]

    @staticmethod
    def dot(first: Any, second: Any) -> sp.Expr:
        """The product of two numbers, or the scalar product of two vectors.

        Parameters
        ----------
        first, second : Expr or tuple of Expr
            Of one kind.

        Returns
        -------
        Expr
            In the unit of the product.
        """
        if isinstance(first, tuple):
            return sp.Add(*(a * b for a, b in zip(first, second, strict=True)))
        return first * second

    def bounds(self, value: Any, limit: sp.Expr) -> tuple[sp.Expr, ...]:
        """The surfaces on which a value is as large as `limit`.

        Parameters
        ----------
        value : Expr or tuple of Expr
            One for each component of the velocity.
        limit : Expr
            In the unit of the value.

        Returns
        -------
        tuple of Expr
            Those of `clip`: value - limit and value + limit, or the one |value|^2/limit^2 - 1.
        """
        if self.planar:
            return (self.dot(value, value) / limit**2 - 1,)
        return value - limit, value + limit

    def rates(self, state: Any, rate: Any) -> dict[Any, Any]:
        """Rates of what `deflection` has made.

        Parameters
        ----------
        state : Symbol or tuple of Symbol
            The state.
        rate : Expr or tuple of Expr
            Its rate.

        Returns
        -------
        dict of Symbol to Expr
            For the `rates` of Pieces.
        """
        return dict(zip(state, rate, strict=True)) if self.planar else {state: rate}

    def family(self, n: int) -> Family:
        """The elements of a multistate law.

        Parameters
        ----------
        n : int
            Their number.

        Returns
        -------
        Family
            Named after the joint.
        """
        return Family(n, name=self.label("element"))

    @checks.door(checks.ASSUMPTIONS)
    def member(
        self, family: Family, name: str, start: Any = 0.0, scale: float = 1.0, **assumptions: bool
    ) -> Any:
        """An internal state of every element.

        Parameters
        ----------
        family : Family
            The elements.
        start : float or Expr
            Relaxed initial value in the state's unit.

        Returns
        -------
        Symbol
            The member of the family.
        """
        (symbol,) = family.symbols(self.label(name), **assumptions)
        return self._known(symbol, start, scale)
