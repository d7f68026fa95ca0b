"""What the declarations of a law say for its docstring: its parameters, what is raised, the source.

Chain: contract.py (`law`) -> **documenting** -> door/documenting.py, which puts it in.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from ..door.documenting import complete

RAISES = """ValueError
    A value of the wrong sign, not finite, or against another parameter.
TypeError
    A value that is no number."""

_SIGNS = {"positive": "> 0", "nonnegative": ">= 0", "real": "of either sign"}


def documented(cls: Any) -> Any:
    """The law with Parameters, Raises and Notes in its docstring; overwrites `__doc__`."""
    fields = {f.name: _entry(f) for f in dataclasses.fields(cls)}
    form = f"This form of the law is {cls.certainty}." if cls.certainty else ""
    source = f"Source: {cls.source}." if cls.source else ""
    return complete(cls, fields, {"Raises": RAISES if fields else "", "Notes": f"{form}\n\n{source}".strip()})


def _entry(field: Any) -> str:
    """One parameter: `F_c : float, N, default 1` and its meaning."""
    about = field.metadata
    meaning = about["meaning"][0].upper() + about["meaning"][1:]
    if about["choices"]:
        words = ", ".join(f'"{word}"' for word in about["choices"])
        return f"{field.name} : {{{words}}}, default {field.default!r}\n    {meaning}."
    kind = "float or sequence of float, shape (n,)" if about["each"] else "float"
    unit = "dimensionless" if about["unit"] == "1" else about["unit"]
    sign = f"; {_SIGNS[about['sign']]}"
    default = f"{field.default:g}" if isinstance(field.default, (int, float)) else field.default
    fixed = " It shapes the equations: no symbol that a sweep can change." if about["structural"] else ""
    return f"{field.name} : {kind}, {unit}, default {default}\n    {meaning}{sign}.{fixed}"
