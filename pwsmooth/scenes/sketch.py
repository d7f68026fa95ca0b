"""Sketches: a mechanism as a few named shapes, whose places are formulas of its states, outputs and parameters.

A sketch says where things are and draws nothing: `Solution.animate` makes a film of it, and a page moves its parts.

Chain: **sketch** -> sketches.py (those of the scenes) -> Scene; pwsmooth/plotting/films.py draws it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
import sympy as sp

from ..definition.lambdified import numpy_function
from ..door import checks
from ..results.sampling import Sampled
from ..results.solution import Solution

__all__ = ["Arrow", "Ball", "Bar", "Belt", "Block", "Clearance", "Ground", "Joint", "Shape", "Sketch", "Spring"]


@checks.door()
@dataclass(frozen=True)
class Shape:
    """A part of a sketch; the base of all kinds.

    >>> isinstance(Ball("ball", x=0, y=1, radius=0.1), Shape)
    True
    """

    places: ClassVar[tuple[str, ...]] = ()  # fields that are formulas; the others are numbers and words

    name: str

    def __post_init__(self) -> None:
        kind = type(self).__name__
        for field in fields(self):
            value, what = getattr(self, field.name), f"`{field.name}` of {kind}"
            if field.name in self.places:
                value = checks.expression(value, what)
            elif isinstance(field.default, str) or field.name == "name":
                value = checks.name(value, what)
            elif isinstance(field.default, bool):
                value = checks.flag(value, what)
            else:
                value = checks.positive(value, what)
            object.__setattr__(self, field.name, value)

    def describe(self) -> dict[str, Any]:
        """The shape in words and numbers.

        Returns
        -------
        dict
            Its kind, its name, the names of its `places`, which are rows of `Sketch.pose`, and its sizes.
        """
        rest = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in self.places}
        return {"kind": type(self).__name__.lower(), "places": list(self.places), **rest}


@checks.door()
@dataclass(frozen=True)
class Block(Shape):
    """A rectangle.

    Parameters
    ----------
    width, height : float, in the unit of length
        Its size.

    >>> Block("block", x=sp.Symbol("y"), y=0.2, width=1, height=0.4, phase="lam").describe()["places"]
    ['x', 'y', 'angle']
    """

    places = ("x", "y", "angle")

    x: Any
    y: Any
    width: float
    height: float
    angle: Any = 0
    phase: str = ""


@checks.door()
@dataclass(frozen=True)
class Ball(Shape):
    """A disc with a mark that turns.

    >>> Ball("ball", x=0, y=sp.Symbol("h") + 1, radius=1).y
    h + 1
    """

    places = ("x", "y", "angle")

    x: Any
    y: Any
    radius: float
    angle: Any = 0
    phase: str = ""


@dataclass(frozen=True)
class _Line(Shape):
    places: ClassVar[tuple[str, ...]] = ("x_1", "y_1", "x_2", "y_2")

    x_1: Any
    y_1: Any
    x_2: Any
    y_2: Any


@checks.door()
@dataclass(frozen=True)
class Spring(_Line):
    """A zigzag between two points.

    >>> Spring("spring", -2, 0.2, sp.Symbol("y"), 0.2, width=0.2).describe()["kind"]
    'spring'
    """

    width: float


@checks.door()
@dataclass(frozen=True)
class Bar(_Line):
    """A link between two points.

    >>> phi = sp.Symbol("phi")
    >>> Bar("crank", 0, 0, sp.cos(phi), sp.sin(phi), width=0.1).x_2
    cos(phi)
    """

    width: float


@checks.door()
@dataclass(frozen=True)
class Ground(_Line):
    """A wall or floor, hatched to the right of the way from its first point to the second.

    >>> Ground("floor", -1, 0, 1, 0).describe()["places"]
    ['x_1', 'y_1', 'x_2', 'y_2']
    """


@checks.door()
@dataclass(frozen=True)
class Belt(_Line):
    """A belt from one point to another, on two rollers, with marks that travel.

    Parameters
    ----------
    x_1, y_1, x_2, y_2 : Expr, in the unit of length
        Ends of its upper side.
    travel : Expr, in the unit of length
        How far it has gone, from the first point to the second.
    mark : float, in the unit of length
        Distance of two marks.

    >>> Belt("belt", -2, 0, 2, 0, travel=sp.Symbol("t") / 2, mark=0.5).travel
    t/2
    """

    places = (*_Line.places, "travel")

    travel: Any
    mark: float


@checks.door()
@dataclass(frozen=True)
class Joint(Shape):
    """A small circle in which links turn.

    >>> Joint("pivot", 0, 0, radius=0.05).radius
    0.05
    """

    places = ("x", "y")

    x: Any
    y: Any
    radius: float


@checks.door()
@dataclass(frozen=True)
class Clearance(Joint):
    """An open circle within which another part may move.

    >>> Clearance("bearing", 0, 0, radius=0.2).describe()["kind"]
    'clearance'
    """


@checks.door()
@dataclass(frozen=True)
class Arrow(Shape):
    """An arrow, such as a force's.

    Parameters
    ----------
    x, y : Expr, in the unit of length
        Where it begins.
    dx, dy : Expr, in the unit of length
        From its beginning to its head.

    >>> Arrow("drive", 0, 0.5, sp.Symbol("drive") / 4, 0).dx
    drive/4
    """

    places = ("x", "y", "dx", "dy")

    x: Any
    y: Any
    dx: Any
    dy: Any


@checks.door()
@dataclass(frozen=True)
class Sketch:
    """A mechanism as named shapes.

    Parameters
    ----------
    shapes : sequence of Shape
        What lies behind comes first. Formulas name states, multipliers, outputs, parameters, and "t".
    bounds : (float, float, float, float), in the unit of length, optional
        Left, right, bottom and top of the picture; by default as the motion needs them.
    note : str
        What a looker has to know, such as what is drawn too large.

    Raises
    ------
    ValueError, TypeError
        Two shapes of one name, or none; bounds that enclose nothing.

    >>> x, v = sp.symbols("x v", real=True)
    >>> block = Block("block", x, 0.2, width=0.8, height=0.4)
    >>> sketch = Sketch([Spring("spring", -5, 0.2, x - 0.4, 0.2, width=0.2), block])
    >>> run = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0}, dense_output=True)
    >>> sketch.pose(run, [0.0, 10.0])["block"].round(9).tolist()
    [[3.5, -0.5], [0.2, 0.2], [0.0, 0.0]]
    """

    shapes: tuple[Shape, ...]
    bounds: tuple[float, float, float, float] | None = None
    note: str = ""

    def __post_init__(self) -> None:
        shapes = checks.all_of_kind("shapes", self.shapes, Shape)
        names = [shape.name for shape in shapes]
        if not shapes or len(set(names)) < len(names):
            raise ValueError(
                f"`shapes` are named {', '.join(names) or 'nothing'}; give each a name of its own."
            )
        bounds = self.bounds
        if bounds is not None:
            bounds = tuple(checks.number(b, "`bounds`") for b in checks.several(bounds, "`bounds`"))
            if len(bounds) != 4 or not (bounds[0] < bounds[1] and bounds[2] < bounds[3]):
                raise ValueError(f"`bounds` is {self.bounds}; give left < right and bottom < top.")
        for name, value in (
            ("shapes", tuple(shapes)),
            ("bounds", bounds),
            ("note", checks.name(self.note, "`note`")),
        ):
            object.__setattr__(self, name, value)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all that its formulas depend on."""
        symbols = set().union(
            *(getattr(shape, place).free_symbols for shape in self.shapes for place in shape.places)
        )
        return tuple(sorted(s.name for s in symbols))

    def describe(self) -> list[dict[str, Any]]:
        """All shapes in words and numbers, as JSON can hold them.

        Returns
        -------
        list of dict
            As `Shape.describe` says.
        """
        return [shape.describe() for shape in self.shapes]

    @checks.door(solution=checks.instance(Solution, "a Solution, as solve() gives it"))
    def pose(self, solution: Solution, times: Any) -> dict[str, np.ndarray]:
        """Where everything is.

        Parameters
        ----------
        solution : Solution
            With dense output.
        times : array_like, shape (nt,), or Sampled, in the unit of the model's time
            When; what `Solution.sample` gave is read where it has the names, which is quicker.

        Returns
        -------
        dict of str to ndarray, shape (places, nt)
            Name of a shape -> a row for each of its places, in the units of length and rad.

        Raises
        ------
        ValueError
            A name that the solution does not have; no dense output.
        """
        read = times if isinstance(times, Sampled) else None
        t = read.t if read is not None else np.atleast_1d(checks.array(times, "`times`"))
        time = str(solution.model.time)
        known: dict[str, Any] = {time: t, "t": t, **solution.parameters}
        for name in self.names:
            if name in known:
                continue
            if name not in (*solution.states, *solution.multipliers, *solution.outputs):
                raise ValueError(
                    f"the sketch uses {name!r}, which is no state, multiplier, output or parameter of this solution."
                )
            known[name] = read[name] if read is not None and name in read.names else solution(t, name)
        numbers = [known[name] for name in self.names]
        return {
            shape.name: np.array(
                [np.broadcast_to(row, t.shape) for row in _places(shape, self.names)(*numbers)], float
            )
            for shape in self.shapes
        }


@functools.lru_cache(maxsize=256)  # a page asks for the same shapes at every move
def _places(shape: Shape, names: tuple[str, ...]) -> Any:
    """A function of what the formulas depend on, by name, for the places of a shape."""
    formulas = sp.Tuple(*(getattr(shape, place) for place in shape.places))
    by_name: Mapping[str, sp.Symbol] = {name: sp.Symbol(name, real=True) for name in names}
    return numpy_function(
        list(by_name.values()), formulas.xreplace({s: by_name[s.name] for s in formulas.free_symbols})
    )
