"""Symbols, names and values of a family too large to hold an object for each of its elements.

They look like the tuples and dicts of smaller systems; a symbol is made when somebody asks for it.
Chain: template.py -> **this file** -> system.py, solve.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp

from ...door import checks

MANY = 10_000  # numbers, of more of which none is held by itself


class Names(Sequence):
    """Names of a member in all elements: x_1, ..., x_n."""

    def __init__(self, name: str, n: int):
        self.name, self.n = name, n

    def __len__(self) -> int:
        return self.n

    def __getitem__(self, i: Any) -> Any:
        numbers = range(1, self.n + 1)[i]
        return (
            f"{self.name}_{numbers}" if isinstance(numbers, int) else tuple(f"{self.name}_{k}" for k in numbers)
        )


class Symbols(Sequence):
    """The states or parameters of `families`, in the order of their arrays."""

    def __init__(self, families: Any, kind: str):
        self.families, self.kind = families, kind

    def __len__(self) -> int:
        return self.families.starts(self.kind)[-1]

    def __getitem__(self, i: Any) -> Any:
        numbers = range(len(self))[i]
        if not isinstance(numbers, int):
            return tuple(map(self._symbol, numbers))
        return self._symbol(numbers)

    def _symbol(self, i: int) -> sp.Basic:
        block, k = self.families.locate(self.kind, i)
        return self.families.symbol(getattr(self.families.template.model, self.kind)[block], k)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Symbols):
            return (self.kind, self.families) == (other.kind, other.families)
        return NotImplemented

    def __hash__(self) -> int:
        return hash((self.kind, self.families))

    @cached_property
    def blocks(self) -> dict[str, tuple[int, int | None]]:
        """Name of a block, without the number of an element -> (first number, how many; None for one of all)."""
        families, kind = self.families, self.kind
        symbols, of, first = (
            getattr(families.template.model, kind),
            families.template.families(kind),
            families.starts(kind),
        )
        return {
            s.name.replace(" []", "").replace("[]", ""): (at, None if f is None else families.sizes[f])
            for s, f, at in zip(symbols, of, first, strict=False)
        }

    def place(self, key: Any) -> int:
        """Number of a symbol or name; a KeyError where there is none."""
        name = getattr(key, "name", key)
        found = self.blocks.get(name)
        if found and found[1] is None:
            return found[0]
        base, _, digits = str(name).rpartition("_")
        first, n = self.blocks.get(base, (0, None))
        if n is None or not digits.isdecimal() or not 1 <= int(digits) <= n:
            raise KeyError(key)
        return first + int(digits) - 1

    def __contains__(self, key: object) -> bool:
        try:
            self.place(key)
        except KeyError:
            return False
        return True

    def index(self, key: Any, *_: Any) -> int:
        try:
            return self.place(key)
        except KeyError:
            raise ValueError(f"{key} is not among them") from None

    def numbers(
        self, given: Mapping[Any, Any], what: str, fit: Any, start: np.ndarray | None = None
    ) -> np.ndarray:
        """An array of values by name: of a member one number for all or one each; nan where nothing is given.

        Raises
        ------
        ValueError, TypeError
            A name that there is not, another number of values, a value that does not fit.
        """
        result = np.full(len(self), np.nan) if start is None else start.copy()
        for key, value in given.items():
            key = checks.named(key)
            name = getattr(key, "name", key)
            if name in self.blocks and self.blocks[name][1] is not None:
                first, n = self.blocks[name]
                single = checks.is_one(value)
                if not single and len(value) != n:
                    raise ValueError(
                        f"{what} gives {len(value)} values to {name}, which has {n} elements; give one for each, or "
                        "one number for all."
                    )
                values = (
                    np.full(n, fit(self[first], value))
                    if single
                    else checks.numbers(value, f"{what}, value of {name!r}")
                )
                for k in checks.unfit(self[first], values):  # not all: a million checks one by one take seconds
                    values[k] = fit(self[first + k], float(values[k]))
                result[first : first + n] = values
                continue
            try:
                at = self.place(name)
            except KeyError:
                raise ValueError(
                    f"{what} names {checks.shown(str(name))}, which is none of this system's; it has "
                    f"{', '.join(self.blocks)}."
                ) from None
            result[at] = fit(self[at], value)
        return result


class Numbers(Mapping):
    """Parameter -> value, of Symbols or their names; `array` holds the values in order."""

    def __init__(self, symbols: Symbols, array: np.ndarray):
        self.symbols, self.array = symbols, array
        array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.symbols)

    def __iter__(self) -> Iterator[sp.Basic]:
        return iter(self.symbols)

    def __getitem__(self, key: Any) -> float:
        return float(self.array[self.symbols.place(key)])

    @property
    def of_blocks(self) -> dict[str, Any]:
        """Name of a block -> its value, or its array."""
        blocks = self.symbols.blocks.items()
        return {name: self.array[at] if n is None else self.array[at : at + n] for name, (at, n) in blocks}

    def changed(self, values: Mapping[Any, Any]) -> Numbers:
        """With some replaced."""
        return Numbers(
            self.symbols, self.symbols.numbers(values, "`parameters`", checks.parameter_value, self.array)
        )


def carried(symbols: Any, old: Mapping[Any, float], more: Mapping[Any, float]) -> Mapping[Any, float]:
    """Values of the parameters `symbols` of a view: those of the original, and `more`."""
    if not isinstance(symbols, Symbols):
        values = {**old, **more}
        return {p: values[p] for p in symbols}
    given = old.of_blocks if isinstance(old, Numbers) else {p.name: value for p, value in old.items()}
    given = {name: value for name, value in given.items() if name in symbols.blocks or name in symbols}
    given |= {p.name: value for p, value in more.items()}
    return Numbers(symbols, symbols.numbers(given, "`parameters`", checks.parameter_value))
