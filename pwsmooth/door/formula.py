"""Formulas from text: numbers, names, pi, oo, + - * / ** and parentheses. Text is data: it is read, never run.

text -> Python's syntax tree -> sympy; every node that is none of these is refused, and sizes are bounded.
Chain: a study's `period = "2*pi/omega"` -> **formula** -> checks.expression, the door of every expression.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Mapping
from typing import Any

import sympy as sp

_LONGEST = 1000  # characters; the depth of the tree is bounded by them too
_BITS = 1000  # of a number's numerator and denominator: 9**9**9 would fill the memory
_POWER = 100  # of what is no number: an expansion of it stays small
_CONSTANTS = {"pi": sp.pi, "oo": sp.oo, "inf": sp.oo}
_SIGNS = {ast.UAdd: operator.pos, ast.USub: operator.neg}
_OPERATIONS = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip


def read(text: str, names: Mapping[str, sp.Symbol], what: str) -> sp.Expr:
    """The expression that a text writes in these names.

    ValueError for anything but numbers, names, pi, oo, + - * / ** and parentheses, and for what is too large.

    >>> read("2*pi/omega", {"omega": sp.Symbol("omega")}, "`period`")
    2*pi/omega
    """
    shown = repr(text) if len(text) <= 60 else f"{text[:60]!r}..."

    def refused(why: str) -> ValueError:
        return ValueError(
            f"{what} is {shown}: {why}; write numbers, names, pi, oo, + - * / ** and parentheses. Names are "
            f"{', '.join(names) or 'none'}."
        )

    def visit(node: ast.AST) -> Any:
        match node:
            case ast.Expression(body=body):
                return visit(body)
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return bounded(sp.Integer(value) if isinstance(value, int) else sp.Float(value))
            case ast.Name(id=name) if name in names or name in _CONSTANTS:
                return names.get(name, _CONSTANTS.get(name))
            case ast.Name(id=name):
                raise refused(f"there is no {name!r}")
            case ast.UnaryOp(op=op, operand=inner) if type(op) in _SIGNS:
                return _SIGNS[type(op)](visit(inner))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS:
                a, b = visit(left), visit(right)
                if isinstance(op, ast.Pow):
                    largest = _BITS / max(_bits(a), 1) if a.is_number else _POWER
                    if not (b.is_number and b.is_real and abs(b) <= largest or b.is_infinite):
                        raise refused(f"the exponent {b} is too large, or no number")
                return bounded(_OPERATIONS[type(op)](a, b))
        raise refused(f"{type(node).__name__} is none of these")

    def bounded(e: Any) -> Any:
        if e.is_Rational and _bits(e) > _BITS:
            raise refused("a number is too large")
        return e

    if len(text) > _LONGEST:
        raise refused(f"it has {len(text)} characters, more than {_LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise refused("it is no formula") from None
    try:
        return visit(tree)
    except RecursionError:
        raise refused("it is nested too deeply") from None


def _bits(e: Any) -> int:
    """Size of a number: the bits of a Rational, those of the exponent of 2 for all others."""
    if e.is_Rational:
        return max(int(e.p).bit_length(), int(e.q).bit_length())
    return 0 if e in (sp.pi, sp.oo) else 64
