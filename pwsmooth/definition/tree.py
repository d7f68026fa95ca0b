"""Equations as plain data, for files: a list of nodes, each a name from a fixed list and the numbers of its parts.

    sin(x) + 2   ->   ["value", "x"], ["dict"], ["Symbol", 0, 1], ["sin", 2], ["Integer", 2], ["Add", 4, 3]

Nothing that is read is evaluated, neither text nor arithmetic: an expression comes back as it was built.
Chain: primitives.py, family.py -> tree (here) -> System -> results/saving.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import NoneType
from typing import Any

import numpy as np
import sympy as sp
from sympy.functions.elementary.piecewise import ExprCondPair

from ..door import checks
from .controls import Control
from .drives import Drive, rewritten, written
from .families.family import Family, Links, Member, MemberMemory, MemberSum, OfNeighbour
from .model import Select
from .primitives import Algebraic, Component, Disc, Event, Memory, Reaction, Switch, Unilateral

# What an expression is made of: sympy's own classes, whose parts are expressions or conditions.
_OPERATIONS = {
    kind.__name__: kind
    for kind in (
        sp.Add, sp.Mul, sp.Pow, sp.exp, sp.log, sp.Abs, sp.sign, sp.Heaviside, sp.Max, sp.Min, sp.Piecewise,
        sp.sin, sp.cos, sp.tan, sp.cot, sp.sec, sp.csc, sp.asin, sp.acos, sp.atan, sp.atan2,
        sp.sinh, sp.cosh, sp.tanh, sp.coth, sp.sech, sp.csch, sp.asinh, sp.acosh, sp.atanh, sp.sinc,
        sp.erf, sp.erfc, sp.floor, sp.ceiling, sp.frac, sp.Mod, ExprCondPair, Select, MemberSum,
        sp.Eq, sp.Ne, sp.Lt, sp.Le, sp.Gt, sp.Ge, sp.And, sp.Or, sp.Not, sp.Xor, sp.ITE,
    )
}  # fmt: skip
_CONSTANTS = {
    "pi": sp.pi, "E": sp.E, "oo": sp.oo, "GoldenRatio": sp.GoldenRatio, "EulerGamma": sp.EulerGamma,
    "Catalan": sp.Catalan, "true": sp.true, "false": sp.false,
}  # fmt: skip
_NUMBERS: dict[str, tuple[type, Callable]] = {
    "Integer": (sp.Integer, lambda e: (e.p,)),
    "Rational": (sp.Rational, lambda e: (e.p, e.q)),
    "Float": (sp.Float, lambda e: (*map(int, e._mpf_[:3]), e._prec)),
}


def _event(surface, every, at, direction, update, when, terminal, name, together):
    return Event(
        surface, every=every, at=at or None, direction=direction, update=dict(update), when=when, terminal=terminal,
        name=name, together=together,
    )  # fmt: skip


def _member(name, family, offset, beyond, given):
    if isinstance(beyond, Links):  # beyond an end stands the element itself
        return Member(name, family, offset, Member(name, family, **given), beyond, **given)
    return Member(name, family, offset, beyond, **given)


# What has parts of its own: its class, its parts, how it is made of them, and of which kinds they must be.
_text, _expression, _maybe, _several = (str,), (sp.Basic,), (sp.Basic, NoneType), (list,)
_RECORDS: dict[str, tuple[type, Callable, Callable, tuple]] = {
    kind.__name__: (kind, parts, make, kinds)
    for kind, parts, make, kinds in (
        (
            sp.Symbol,
            lambda s: (s.name, s._assumptions_orig),
            lambda name, given: sp.Symbol(name, **given),
            (_text, (dict,)),
        ),
        (Switch, lambda s: (s.name, s.surface), Switch, (_text, _expression)),
        (Disc, lambda d: (d.name, d.surfaces), Disc, (_text, _several)),
        (Component, lambda s: (s.disc, s.index), Component, ((Disc,), (int,))),
        (
            Memory,
            lambda s: (s.name, s.initial, s._assumptions_orig),
            lambda name, initial, given: Memory(name, initial, **given),
            (_text, (float,), (dict,)),
        ),
        (Reaction, lambda s: (s.name, s.gap, s.restitution), Reaction, (_text, _expression, _expression)),
        (
            Member,
            lambda s: (s.name, s.family, s.offset, s.links or s.outside, s._assumptions_orig),
            _member,
            (_text, (Family,), (int,), (sp.Basic, Links, NoneType), (dict,)),
        ),
        (
            Links,
            lambda a: (a.family, a.table.shape[1], " ".join(map(str, a.table.ravel() + 1))),
            lambda family, d, numbers: family.links(np.array(numbers.split(), int).reshape(-1, d)),
            ((Family,), (int,), _text),
        ),
        (MemberMemory, lambda s: (s.name, s.initial, s.family), MemberMemory, (_text, (float,), (Family,))),
        (
            OfNeighbour,
            lambda s: (s.of, s.family, s.offset, s.outside),
            OfNeighbour,
            ((Reaction, MemberMemory), (Family,), (int,), _expression),
        ),
        (Family, lambda f: (f.n, f.periodic, f.name), Family, ((int,), (bool,), _text)),
        (
            Control,
            lambda u: u._parts,
            Control,
            (_text, _several, _several, (int,), (bool,), (bool,), (float,)),
        ),
        (Drive, written, rewritten, (_several, _several, _text, (int,))),
        (Unilateral, lambda c: (c.gap, c.restitution, c.name), Unilateral, (_expression, _expression, _text)),
        (Algebraic, lambda a: (a.unknown, a.residual), Algebraic, (_expression, _expression)),
        (
            Event,
            lambda e: tuple(getattr(e, name) for name in Event.__dataclass_fields__),
            _event,
            (_maybe, _maybe, _several, (int,), _several, _expression, (bool,), (str, NoneType), (str, NoneType)),
        ),
    )
}  # fmt: skip
_NAMES = {kind: name for name, (kind, *_) in _RECORDS.items()} | {
    kind: name for name, kind in _OPERATIONS.items()
}
_CONSTANT_NAMES = {constant: name for name, constant in _CONSTANTS.items()}
_SCALARS = (str, bool, int, float, NoneType)


def write(value: Any) -> list[list]:
    """Nodes of a nest of equations, primitives, dicts, sequences and numbers; the last one is the whole.

    TypeError for what has no name in the list.
    """
    nodes: list[list] = []
    built: list[Any] = []
    known: dict[sp.Basic, int] = {}

    def number(item: Any) -> int:
        if isinstance(item, sp.Basic) and item in known:
            return known[item]
        nodes.append(_node(item, number))
        built.append(_built(nodes[-1], built))  # what could not be read is not written
        if isinstance(item, sp.Basic):
            known[item] = len(nodes) - 1
        return len(nodes) - 1

    number(value)
    return nodes


def _node(item: Any, number: Callable[[Any], int]) -> list:
    """Name and parts of a value; `number` gives that of a part."""
    if isinstance(item, (np.ndarray, np.generic)):
        item = item.tolist()
    if type(item) in _SCALARS:
        return ["value", item]
    if isinstance(item, (list, tuple)):
        return ["list", *map(number, item)]
    if isinstance(item, Mapping):
        return ["dict", *(number(part) for pair in item.items() for part in pair)]
    if isinstance(item, sp.Basic) and item in _CONSTANT_NAMES:
        return [_CONSTANT_NAMES[item]]
    if isinstance(item, (sp.Integer, sp.Rational, sp.Float)):
        name = next(name for name, (kind, _) in _NUMBERS.items() if isinstance(item, kind))
        return [name, *_NUMBERS[name][1](item)]
    if type(item) not in _NAMES:
        raise TypeError(
            f"{checks.shown(item)} is a {type(item).__name__}, which no file can hold; write it with elementary "
            "functions and the package's own primitives."
        )
    name = _NAMES[type(item)]
    parts = _RECORDS[name][1](item) if name in _RECORDS else item.args
    return [name, *map(number, parts)]


def read(nodes: Any) -> Any:
    """What `write` was given, with dicts and lists for its mappings and sequences; ValueError for anything else."""
    if not isinstance(nodes, list) or not nodes:
        raise ValueError("no list of nodes")
    built: list[Any] = []
    for node in nodes:
        built.append(_built(node, built))
    return built[-1]


def _built(node: Any, before: list[Any]) -> Any:
    """The value of a node whose parts are among those before it."""
    if not isinstance(node, list) or not node or not isinstance(node[0], str):
        raise ValueError(f"{checks.shown(node)} is no node")
    name, *parts = node
    if name in _CONSTANTS and not parts:
        return _CONSTANTS[name]
    if name == "value" and len(parts) == 1 and type(parts[0]) in _SCALARS:
        return parts[0]
    if any(type(part) is not int for part in parts):
        raise ValueError(f"{checks.shown(node)} has parts that are no numbers")
    if name in _NUMBERS:
        return _number(name, parts)
    if not all(0 <= part < len(before) for part in parts):
        raise ValueError(f"{checks.shown(node)} has parts that are not among the nodes before it")
    values = [before[part] for part in parts]
    if name == "list":
        return values
    try:
        if name == "dict" and len(values) % 2 == 0:
            return dict(zip(values[::2], values[1::2]))
        if name in _RECORDS:
            _, _, make, kinds = _RECORDS[name]
            if len(kinds) == len(values) and all(map(isinstance, values, kinds)):
                return make(*values)
        # Of a str sympy would make an expression.
        elif name in _OPERATIONS and all(isinstance(value, sp.Basic) for value in values):
            kind = _OPERATIONS[name]
            e = kind(*values) if kind is ExprCondPair else kind(*values, evaluate=False)
            if type(e) is kind and e.args == tuple(values):
                return e
    except (TypeError, AttributeError, ArithmeticError):
        pass
    known = name in _RECORDS or name in _OPERATIONS or name == "dict"
    raise ValueError(f"{name!r} {'has parts that it cannot have' if known else 'is no name of the list'}")


def _number(name: str, parts: list[int]) -> sp.Number:
    if name == "Integer" and len(parts) == 1:
        return sp.Integer(*parts)
    if name == "Rational" and len(parts) == 2 and parts[1] > 1:
        return sp.Rational(*parts)
    if name == "Float" and len(parts) == 4:
        negative, mantissa, exponent, precision = parts
        if negative in (0, 1) and mantissa >= 0 and 0 < precision < 2**20:
            return sp.Float((negative, mantissa, exponent, mantissa.bit_length()), precision=precision)
    raise ValueError(f"{name} {parts} is no number")
