"""Where a law acts: the motion there as expressions, and symbols that carry the joint's name.

Chain: primitives.py, family.py -> **joint** -> contract.py -> the laws.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from ..family import Family
from ..primitives import Memory, Switch

__all__ = ["Joint"]


class Joint:
    """Where a law acts: the motion there as expressions, and symbols that carry the joint's name.

    Attributes
    ----------
    x, v, a : Expr or None
        Position (or indentation), velocity, acceleration.
    load : Expr
        Normal load, 1 without.
    t : Symbol or None
    beyond : callable
        Level -> surface with the zero and the sense of x - level.
    """

    def __init__(self, v, x=None, a=None, load=None, t=None, name="", beyond=None):
        self.name = name
        inputs: list[Any] = [None if e is None else sp.sympify(e) for e in (v, x, a, t)]
        self.v, self.x, self.a, self.t = inputs
        self.beyond = beyond or (lambda level: self.x - level)
        self.load = sp.S.One if load is None else sp.sympify(load)
        self.starts: dict[Any, Any] = {}
        self.scales: dict[Any, float] = {}

    def label(self, name: str) -> str:
        """`name` with the joint's name behind it."""
        return f"{name}_{self.name}" if self.name else name

    def state(self, name: str, start: Any = 0.0, scale: float = 1.0, **assumptions: bool) -> sp.Symbol:
        """An internal state; `start` may be an expression of the motion, `scale` is its usual size.

        What is known of it (`positive=True` of a strength) decides the class of switches in which it stands.
        """
        symbol = sp.Symbol(self.label(name), **({"real": True} | assumptions))
        return self._known(symbol, start, scale)

    def _known(self, symbol, start, scale):
        self.starts[symbol], self.scales[symbol] = start, float(scale)
        return symbol

    def memory(self, name: str, initial: float = 0.0, **assumptions: bool) -> Memory:
        """A value that changes only in events."""
        return Memory(self.label(name), initial, **assumptions)

    def switch(self, name: str, surface: sp.Expr) -> Switch:
        """The multiplier of a surface, for terms that are nonlinear in it; a constant's is its sign."""
        surface = sp.sympify(surface)
        return sp.sign(surface) if surface.is_number else Switch(self.label(name), surface)

    def family(self, n: int) -> Family:
        """The elements of a multistate law."""
        return Family(n, name=self.label("element"))

    def member(self, family: Family, name: str, start: Any = 0.0, scale: float = 1.0) -> Any:
        """An internal state of every element."""
        (symbol,) = family.symbols(self.label(name))
        return self._known(symbol, start, scale)
