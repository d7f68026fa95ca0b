"""What a sweep runs over: a grid of axes, a list of points, or a list times a grid; names checked at the door.

A name is a parameter, a state (its initial value), the time symbol (the start time, so the phase of the drive),
or "seed" or "trajectory" of the noise. Points are numbered in C order, the last axis fastest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..door import calls, checks

POINT = "point"  # the dimension of a list


@dataclass(frozen=True)
class Axes:
    """Checked axes."""

    dims: tuple[str, ...]  # of the Dataset: "point" first if there is a list, then the axes of the grid
    shape: tuple[int, ...]
    values: dict[str, tuple[str, np.ndarray]]  # name -> (dimension, 1-D array)
    kinds: dict[str, str]  # name -> "parameter", "state", "time" or "noise"

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    def columns(self, start: int, stop: int) -> dict[str, np.ndarray]:
        """Name -> values at the points start, ..., stop - 1."""
        return self.at(np.arange(start, stop))

    def at(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """Name -> values at the points of these numbers."""
        at = dict(zip(self.dims, np.unravel_index(points, self.shape)))
        return {name: values[at[dim]] for name, (dim, values) in self.values.items()}

    def boxes(self, target: int) -> tuple[tuple[int, ...], list[tuple[int, int]]]:
        """Shape of a chunk of about `target` points, and (start, stop) of every chunk.

        A chunk is a box of the grid that is contiguous in the numbering, so that it is one region of the store.
        """
        shape = [1] * len(self.shape)
        for k in reversed(range(len(self.shape))):
            inner = math.prod(shape)
            shape[k] = max(1, min(self.shape[k], target // inner))
            if shape[k] < self.shape[k]:
                break
        step, inner = shape[k], math.prod(shape[k + 1 :])
        whole = self.shape[k] * inner
        starts = [
            (outer * whole + i * inner, outer * whole + min(i + step, self.shape[k]) * inner)
            for outer in range(self.size // whole)
            for i in range(0, self.shape[k], step)
        ]
        return tuple(shape), starts


def read_axes(system: Any, grid: Any, points: Any) -> Axes:
    """Axes of a sweep over `system`.

    ValueError or TypeError for a name that the system does not have; values that are no finite numbers, do not fit the
    symbol, or are empty; columns of a list of unequal lengths; one name twice.
    """
    for what, given in (("axes", grid), ("points", points)):
        checks.mapping({} if given is None else given, f"`{what}`", "names to sequences of numbers")
    if not grid and not points:
        raise ValueError(
            "the sweep has no axes; give `axes={'k': [1, 2, 3]}`, or `points=` for a list of points."
        )
    dims: list[str] = []
    shape: list[int] = []
    values: dict[str, tuple[str, np.ndarray]] = {}
    kinds: dict[str, str] = {}
    for what, given in (("points", points), ("axes", grid)):
        for key, numbers in (given or {}).items():
            name, kind, symbol = _identify(system, key, what)
            if name in values:
                raise ValueError(f"{name!r} stands twice in the axes; give it once.")
            array = _numbers(system, name, kind, symbol, numbers, what)
            if what == "axes" or not dims:
                dims.append(name if what == "axes" else POINT)
                shape.append(len(array))
            elif len(array) != shape[0]:
                raise ValueError(
                    f"`points` has {shape[0]} values of {next(iter(values))!r} but {len(array)} of {name!r}; a list of "
                    "points needs one of each for every point (`axes=` makes a grid)."
                )
            values[name], kinds[name] = (dims[-1], array), kind
    return Axes(tuple(dims), tuple(shape), values, kinds)


def _identify(system, key, what):
    if not isinstance(key, (str, sp.Symbol)):
        raise TypeError(f"`{what}` names {checks.shown(key)}; give a Symbol or its name.")
    name = str(key)
    for kind, symbols in (("parameter", system.parameters), ("state", system.states)):
        for symbol in symbols:
            if symbol.name == name:
                return symbol.name, kind, symbol
    if system.model.time is not None and name == str(system.model.time):
        return name, "time", system.model.time
    if name in ("seed", "trajectory"):
        return name, "noise", None
    raise ValueError(
        f"`{what}` names {name!r}, which is no parameter, state or time of this system; parameters are "
        f"{checks.listing(system.parameters)}; states are {checks.listing(system.states)}; noise has 'seed' and "
        "'trajectory'." + calls.hint(name, [*system.parameters, *system.states])
    )


def _numbers(system, name, kind, symbol, numbers, what):
    try:
        array = np.array(numbers, dtype=np.int64) if kind == "noise" else checks.as_floats(numbers)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(
            f"`{what}` of {name!r} is {checks.shown(numbers)}; give a sequence of numbers."
        ) from None
    if array.ndim != 1 or not array.size:
        raise ValueError(
            f"`{what}` of {name!r} has shape {array.shape}; give a one-dimensional sequence of at least one number."
        )
    if kind == "noise":
        if not np.array_equal(array, np.asarray(numbers)):
            raise TypeError(f"`{what}` of {name!r} is {checks.shown(numbers)}; it is made of whole numbers.")
        return array
    if not np.isfinite(array).all():
        raise ValueError(f"`{what}` of {name!r} contains {array[~np.isfinite(array)][0]}; give finite numbers.")
    # A value can violate a bound or divide by zero: checking both ends and the value nearest 0 is enough.
    telling = {float(array.min()), float(array.max()), float(array[np.argmin(np.abs(array))])}
    if kind == "parameter":
        for value in telling:
            system.with_parameters({symbol: value})
    elif kind == "state":
        for value in telling:
            checks.initial_value(symbol, value)
        near = np.abs(array) <= checks.UNRESOLVED
        array[near] = [checks.initial_value(symbol, value) for value in array[near]]
    if what == "axes" and len(np.unique(array)) < len(array):
        raise ValueError(f"`axes` of {name!r} has a value twice; an axis of a grid needs distinct values.")
    return array
