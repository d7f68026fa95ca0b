"""Columns of numbers in a text file, with commas, semicolons, tabs or spaces between them, by number or by name.

Chain: **columns** -> definition/drives.py, fitting/records.py.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import checks


def read_columns(path: Any, wanted: Sequence[Any], gaps: bool = False) -> np.ndarray:
    """The columns `wanted` of a file, shape (columns, rows); a number counts from 0, a name stands in its header.

    Lines that begin with no number are left out; the last one before the first numbers is the header. With `gaps` an
    empty field, and one that says nan or NA, is nan. ValueError for other text in a column.
    """
    path = checks.path(path, "`path`")
    rows: list[list[float]] = []
    header: list[str] = []
    places: list[int] = []
    with open(path, encoding="utf-8-sig") as lines:
        for number, line in enumerate(lines, 1):
            fields = _fields(line)
            if not fields or line.lstrip().startswith("#") or not _is_number(fields[0]):
                header = header if rows or not any(fields) else fields
                continue
            if not rows:
                places = [_place(column, header, path) for column in wanted]
            try:
                rows.append([_number(fields[place], gaps) for place in places])
            except (IndexError, ValueError):
                raise ValueError(
                    f"line {number} of {path} is {checks.shown(line.strip())}, with no numbers in the columns "
                    f"{tuple(wanted)}; name others, or mend the line."
                ) from None
    return np.array(rows, float).reshape(-1, len(wanted)).T


def _fields(line: str) -> list[str]:
    line = line.strip("\r\n ").lstrip("# ")
    if ";" in line:  # where a comma may be that of decimals
        return [field.strip().replace(",", ".") for field in line.split(";")]
    if "," in line or "\t" in line:
        return [field.strip().strip('"') for field in re.split("[,\t]", line)]
    return line.split()


def _place(column: Any, header: list[str], path: Path) -> int:
    if isinstance(column, str):
        names = [name.strip('"') for name in header]
        if column not in names:
            known = checks.listing(names) if names else "no header"
            raise ValueError(f"`path` {str(path)!r} has no column {column!r}; it has {known}.")
        return names.index(column)
    return checks.integer(0)(column, "a column")


def _number(field: str, gaps: bool) -> float:
    if gaps and field.lower() in ("", "nan", "na"):
        return math.nan
    return float(field)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
