"""The sections of a law's docstring that its declarations already say: parameters, what is raised, the source.

Chain: contract.py (`law`) -> **documenting**.
"""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any

RAISES = """Raises
------
ValueError
    A value of the wrong sign, not finite, or against another parameter.
TypeError
    A value that is no number."""

_SIGNS = {"positive": "> 0", "nonnegative": ">= 0", "real": "of either sign"}


def documented(cls: Any) -> Any:
    """The law with Parameters, Raises and Notes in its docstring, in front of its Examples; overwrites `__doc__`."""
    text = inspect.cleandoc(cls.__doc__ or "")
    if not text or "Parameters\n---" in text:
        return cls  # without docstrings (-OO), or written out
    text, *examples = text.partition("Examples\n--------\n")
    start, _, notes = text.partition("Notes\n-----\n")
    source = f"Source: {cls.source}." if cls.source else ""
    sure = f"This form of the law is {cls.certainty}." if cls.certainty else ""
    about = "\n\n".join(part for part in (notes.strip(), sure, source) if part)
    fields = "\n".join(_entry(f) for f in dataclasses.fields(cls))
    sections = [start.strip(), f"Parameters\n----------\n{fields}" if fields else "", RAISES if fields else ""]
    sections += [f"Notes\n-----\n{about}" if about else "", "".join(examples).strip()]
    cls.__doc__ = "\n\n".join(section for section in sections if section) + "\n"
    return cls


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
