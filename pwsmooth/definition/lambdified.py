"""Expressions as numpy functions that keep every bit of their numbers.

sympy prints a Float with 15 digits, of which 1/3 does not come back; here it is printed as Python prints a float.
Chain: expressions -> **lambdified** -> outputs of a Solution, drives, steady curves, axes of a sweep.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import sympy as sp


def numpy_function(arguments: sp.Symbol | Sequence[sp.Symbol], expression: Any, *, cse: bool = False) -> Any:
    """A function of numbers or arrays for an expression or a Tuple of them; `cse` shares common subexpressions.

    >>> import sympy as sp
    >>> x = sp.Symbol("x")
    >>> numpy_function(x, x * (1 / 3))(1.0) == 1 / 3
    True
    """
    return sp.lambdify(arguments, expression, modules=["scipy", "numpy"], printer=_printer()(), cse=cse)


@functools.cache
def _printer() -> Any:
    from sympy.printing.numpy import SciPyPrinter

    class Printer(SciPyPrinter):
        """lambdify's own printer for numpy and scipy, but for Floats."""

        def __init__(self) -> None:
            # The settings that lambdify gives to its own printers.
            super().__init__(
                {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True}
            )

        def _print_Float(self, e: sp.Float) -> str:
            return repr(float(e))

        def _print_Whole(self, e: sp.Expr) -> str:
            return self._print(sp.floor(e.args[0] + sp.S.Half))

    return Printer
