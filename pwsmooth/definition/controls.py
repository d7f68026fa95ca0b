"""Control: an input of a system as polynomials on a grid, whose coefficients and inner times are parameters.

    u(t) = sum_j c_kj B_j((t - t_k)/(t_(k+1) - t_k))   on [t_k, t_(k+1)],   B_j(s) = binomial(d, j) s^j (1 - s)^(d - j)

What the rates read is the present piece alone, so that their size does not grow with the grid: memories hold its
coefficients, its begin and its rate, and a clock event at every inner time writes those of the next. The first piece is
read from the parameters themselves: an initial value of a memory would be a number, without a derivative.
Chain: **controls** -> reading.py -> lifted field; costs/minimising.py keeps the times in their order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import sympy as sp

from ..door import checks
from .primitives import Event, Memory

_SHORTEST = 1e-3  # of the mean length of a piece


class Meaning(NamedTuple):
    """What stands for a control in a system."""

    value: sp.Expr
    events: tuple[Event, ...]
    parameters: dict[sp.Symbol, float]


@checks.door()
class Control(sp.Symbol):
    """An input that is a polynomial on each piece of a grid: a symbol in the rates, its numbers parameters.

    Coefficients are those of Bernstein's polynomials: of degree 0 the value of a piece, of degree 1 its values at both
    ends, and of any degree the input stays between the smallest and the largest of its piece. They are named u_0, u_1,
    ... where a piece has one of its own, and else u_0_0, u_0_1, ..., piece and number; the inner times u_t1, u_t2, ...

    Parameters
    ----------
    name : str
        Its name; of a solution it is an output.
    times : sequence of float, length n + 1, in the unit of the model's time
        The grid, increasing. A run begins before the second of them; the first and the last piece go on outside.
    values : float or sequence of float, length nc, in the unit that the model gives the input
        The coefficients in their order; one number for all.
    degree : int
        Of the polynomials.
    continuous : bool
        Whether each piece begins with the value with which the one before ends; of degree 1 or more.
    movable : bool
        Whether the inner times are parameters too.
    shortest : float, in the unit of the model's time, optional
        Least length of a piece for an optimiser; by default a thousandth of the mean.

    Raises
    ------
    ValueError, TypeError
        Times that do not increase, another number of values, a continuous input of degree 0.

    Notes
    -----
    Every inner time is an event named as it, so that `at_event(x, "u_t1")` is a quantity of the run.

    Source: Farin, Curves and Surfaces for CAGD, 2002, for Bernstein's polynomials.

    >>> x, v = sp.symbols("x v", real=True)
    >>> u = Control("u", [0, 1, 2], [1, -1], movable=True)
    >>> body = System({x: v, v: u})
    >>> body.parameters
    {u_0: 1.0, u_1: -1.0, u_t1: 1.0}
    >>> run = solve(body, (0, 2), {x: 0, v: 0}, by=["u_0", "u_t1"])
    >>> print(run["x"][-1].round(6), run.derivatives.end[0].round(6).tolist())
    1.0 [1.5, 2.0]
    """

    __slots__ = ("continuous", "degree", "shortest", "movable", "times", "values")

    def __new__(cls, name, times, values=0.0, degree=0, continuous=False, movable=False, shortest=None):
        name = checks.text(name, "`name` of a Control")
        times = checks.numbers(times, "`times` of a Control")
        if len(times) < 2 or not (np.diff(times) > 0).all():
            raise ValueError(
                f"`times` of Control {name!r} are {checks.shown(times.tolist())}; give two or more that increase."
            )
        degree = checks.whole(degree, "`degree` of a Control", 0, 20)
        continuous = checks.flag(continuous, "`continuous` of a Control")
        movable = checks.flag(movable, "`movable` of a Control")
        if continuous and not degree:
            raise ValueError(
                f"`continuous` of Control {name!r} is True, and its `degree` 0: give degree 1 or more, or False."
            )
        pieces = len(times) - 1
        count = pieces * degree + 1 if continuous else pieces * (degree + 1)
        values = checks.array(values, "`values` of a Control")
        if values.shape not in ((), (count,)):
            raise ValueError(
                f"`values` of Control {name!r} have the shape {values.shape}; give one number, or {count}: {pieces} "
                f"pieces of degree {degree}{', continuous' if continuous else ''}."
            )
        shortest = (times[-1] - times[0]) * _SHORTEST / pieces if shortest is None else shortest
        shortest = checks.positive(shortest, "`shortest` of a Control")
        if movable and shortest > np.diff(times).min():
            raise ValueError(
                f"`shortest` of Control {name!r} is {shortest:g}, and a piece has {np.diff(times).min():g}; give a "
                "smaller number."
            )
        self = sp.Symbol.__xnew__(cls, name, real=True)
        self.times, self.values = tuple(times.tolist()), tuple(np.broadcast_to(values, count).tolist())
        self.degree, self.continuous, self.movable, self.shortest = degree, continuous, movable, shortest
        return self

    @property
    def _parts(self):
        return self.name, self.times, self.values, self.degree, self.continuous, self.movable, self.shortest

    def __getnewargs_ex__(self):
        return self._parts, {}

    def _hashable_content(self):
        return (*super()._hashable_content(), *self._parts[1:])

    def _sympyrepr(self, printer, *args):
        return f"Control({', '.join(map(repr, self._parts))})"

    @property
    def _words(self):
        pieces, (*_, end) = len(self.times) - 1, self.times
        return (
            f"{self.name}: pieces {pieces}, degree {self.degree}{', continuous' * self.continuous}, over "
            f"({self.times[0]:g}, {end:g}){', whose times move' * self.movable}"
        )

    @property
    def _per_piece(self):
        """How many coefficients a piece has of its own."""
        return self.degree if self.continuous else self.degree + 1

    @property
    def coefficients(self):
        """Parameters of the system, by pieces; a tuple of Symbols."""
        own = self._per_piece
        return tuple(
            sp.Symbol(f"{self.name}_{i // own}" + (f"_{i % own}" if own > 1 else ""), real=True)
            for i in range(len(self.values))
        )

    @property
    def instants(self):
        """Parameters that are the inner times; a tuple of Symbols, empty for a grid that does not move."""
        inner = range(1, len(self.times) - 1) if self.movable else ()
        return tuple(sp.Symbol(f"{self.name}_t{k}", real=True) for k in inner)

    @property
    def _grid(self):
        """The times, as numbers or parameters."""
        times = tuple(map(sp.Float, self.times))
        return (times[0], *(self.instants or times[1:-1]), times[-1])

    @property
    def _memories(self):
        """Whether the piece is the first; else its coefficients, its begin and its rate."""
        if len(self.times) == 2:
            return ()
        names = [f"coefficient {j}" for j in range(self.degree + 1)] + ["begin", "rate"][
            : 2 * bool(self.degree)
        ]
        return tuple(
            Memory(f"{name} of {self.name}", name == "first piece") for name in ("first piece", *names)
        )

    def _meaning(self, time):
        """What a system reads in its place."""
        grid, c, d = self._grid, self.coefficients, self.degree
        rows = [c[k * self._per_piece :][: d + 1] for k in range(len(grid) - 1)]
        if d:
            rows = [(*row, a, 1 / (b - a)) for row, a, b in zip(rows, grid, grid[1:])]
        piece, events = rows[0], []
        if len(rows) > 1:
            first, *held = self._memories
            for k, row in enumerate(rows[1:], 1):
                update = {first: sp.S.Zero, **dict(zip(held, row))}
                events.append(Event(at=grid[k], update=update, name=f"{self.name}_t{k}"))
            on, *present = (sp.Symbol(m.name, real=True) for m in (first, *held))
            piece = [on * a + b for a, b in zip(piece, present)]
        s = (time - piece[-2]) * piece[-1] if d else sp.S.Zero
        value = sp.Add(*(sp.binomial(d, j) * piece[j] * s**j * (1 - s) ** (d - j) for j in range(d + 1)))
        return Meaning(value, tuple(events), dict(zip((*c, *self.instants), (*self.values, *self.times[1:-1]))))

    def _check_run(self, t0, parameters):
        """Whether a run that begins at t0 begins on the first piece, and the pieces follow each other."""
        inner = [parameters[s] for s in self.instants] or list(self.times[1:-1])
        if inner and not all(a < b for a, b in zip([t0, *inner], [*inner, self.times[-1]])):
            raise ValueError(
                f"`t_span` begins at {t0:g}, and Control {self.name!r} changes at {', '.join(f'{t:g}' for t in inner)}"
                f": give a start before these, and inner times that increase up to {self.times[-1]:g}."
            )
