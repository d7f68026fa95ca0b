"""A measured drive: a table of times and values as a cubic spline that a System can follow.

    u''' = j,   j = 6 c_k on [t_k, t_{k+1}]

The model stays smooth between the knots, the solver steps from one to the next, and laws see velocity and acceleration.
Chain: **table** -> prescribed.py, sliding.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.primitives import Event, Memory
from ..laws import Pieces

__all__ = ["Table", "within"]


class Table:
    """A drive given by samples, as a cubic spline that a System can follow.

    Parameters
    ----------
    times : array_like, shape (n,), s
        Increasing, n >= 4; compile time grows with n, a few seconds for a thousand.
    values : array_like, shape (n,)
        In the unit of what is driven.

    Attributes
    ----------
    t_span : (float, float), s
        First and last time.

    Raises
    ------
    ValueError
        Times that do not increase, values that are not finite, or too few of them.

    Notes
    -----
    The spline is a state with its derivatives; its third derivative is a Memory that one Event sets at the knots.

    The spline is SciPy's CubicSpline, not-a-knot.

    Examples
    --------
    >>> import numpy as np
    >>> from pwsmooth.laws.friction import Dahl
    >>> from pwsmooth.scenes import Table, prescribed_motion
    >>> times = np.linspace(0, 2, 81)
    >>> rig = prescribed_motion(Dahl(), position=Table(times, 3e-5*np.sin(4*times)))
    >>> force = rig.solve(t_eval=times)["force"]
    >>> force.shape
    (81,)
    """

    def __init__(self, times: Any, values: Any):
        self.times, self.values = checks.numbers(times, "`times`"), checks.numbers(values, "`values`")
        if self.times.shape != self.values.shape or len(self.times) < 4:
            raise ValueError(
                f"a Table has `times` of shape {self.times.shape} and `values` of shape {self.values.shape}; give two "
                "sequences of one length, at least 4."
            )
        if not (np.diff(self.times) > 0).all():
            i = int(np.flatnonzero(np.diff(self.times) <= 0)[0])
            raise ValueError(
                f"`times` of a Table must increase; {self.times[i + 1]:g} follows {self.times[i]:g}."
            )
        self.t_span = (float(self.times[0]), float(self.times[-1]))

    @checks.door(name=checks.text)
    def pieces(self, name: str) -> Pieces:
        """The spline as states `name`, `name_1`, `name_2`; its `force` is the value.

        Parameters
        ----------
        name : str
            Of the state.

        Returns
        -------
        Pieces
            For `assemble`.
        """
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(self.times, self.values)
        value, slope, curvature = sp.symbols(f"{name} {name}_1 {name}_2", real=True)
        third = 6 * spline.c[0]
        knot, jerk = Memory(f"{name}_knot", 0), Memory(f"{name}_3", third[0])
        passed = Event(
            at=self.times[1:-1].tolist(),
            update={knot: knot + 1, jerk: _lookup(third[1:], knot)},
            name=f"{name} knot",
        )
        start = dict(zip((value, slope, curvature), (float(spline(self.times[0], k)) for k in range(3))))
        size = np.abs(spline.c[:, :-1]).max(axis=1)[::-1] if len(third) > 1 else np.ones(4)
        scales = {s: float(a) or 1.0 for s, a in zip((value, slope, curvature), size)}
        return Pieces(
            value,
            {value: slope, slope: curvature, curvature: jerk},
            start=start,
            scales=scales,
            events=(passed,),
        )

    @checks.door(name=checks.text)
    def derivatives(self, name: str) -> tuple[sp.Symbol, sp.Symbol]:
        """Symbols of its first and second derivative.

        Parameters
        ----------
        name : str
            As given to `pieces`.

        Returns
        -------
        (Symbol, Symbol)
            In the unit of the values over s and over s^2.
        """
        first, second = sp.symbols(f"{name}_1 {name}_2", real=True)
        return first, second


def within(t_span: Any, tables: Any) -> tuple[float, float]:
    """The span of a run whose drives are tables.

    Parameters
    ----------
    t_span : (float, float), s, or None
        Wanted span; by default that of the tables.
    tables : iterable of Table
        None of them: (0, 1) by default.

    Returns
    -------
    (float, float)
        Start and end, s.

    Raises
    ------
    ValueError
        It does not begin with the tables, or goes beyond them.

    Examples
    --------
    >>> from pwsmooth.scenes.table import Table, within
    >>> within(None, [Table([0, 1, 2, 3], [0, 1, 0, 1])])
    (0.0, 3.0)
    """
    t_span = None if t_span is None else checks.span(t_span)
    for table in checks.all_of_kind("tables", tables, Table):
        if t_span is None:
            t_span = table.t_span
        if t_span[0] != table.t_span[0] or t_span[1] > table.t_span[1]:
            raise ValueError(
                f"`t_span` is {tuple(t_span)}, but a table of the drive covers {table.t_span}; begin with it and "
                "end inside of it."
            )
    return (0.0, 1.0) if t_span is None else t_span


def _lookup(entries: np.ndarray, index: sp.Symbol, first: int = 0) -> sp.Expr:
    """entries[index], as a tree of conditions on a Memory."""
    if len(entries) == 1:
        return sp.Float(float(entries[0]))
    half = len(entries) // 2
    low, high = _lookup(entries[:half], index, first), _lookup(entries[half:], index, first + half)
    return sp.Piecewise((low, index < first + half), (high, True), evaluate=False)
