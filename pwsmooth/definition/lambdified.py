"""Expressions as numpy functions that keep every bit of their numbers.

sympy prints a Float with 15 digits, of which 1/3 does not come back; here it is printed as Python prints a float.
Chain: expressions -> **lambdified** -> outputs of a Solution, drives, steady curves, axes of a sweep.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import sympy as sp

from .model import Table


def numpy_function(arguments: sp.Symbol | Sequence[sp.Symbol], expression: Any, *, cse: bool = False) -> Any:
    """A function of numbers or arrays for an expression or a Tuple of them; `cse` shares common subexpressions.

    >>> import sympy as sp
    >>> x = sp.Symbol("x")
    >>> numpy_function(x, x * (1 / 3))(1.0) == 1 / 3
    True
    """
    tables = {_in_code(table): table.rows for table in sp.sympify(expression).atoms(Table)}
    return sp.lambdify(arguments, expression, modules=[tables, "scipy", "numpy"], printer=_printer()(), cse=cse)


def _in_code(table: Table) -> str:
    return "table_" + table.name.encode().hex()


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

        def _print_Entry(self, e: sp.Expr) -> str:
            table, row, column = e.args
            return f"{_in_code(table)}[numpy.asarray({self._print(row)}, int), {column}]"

        def _print_Whole(self, e: sp.Expr) -> str:
            return self._print(sp.floor(e.args[0] + sp.S.Half))

    return Printer
