"""Sampled drives: a record of times and values that stands in a system as one symbol.

    u(t) = c_d (t - t_k)^d + ... + c_0   on [t_k, t_{k+1}]

The number k of the cell is a memory that a clock event raises at every sample; the coefficients are read from a table,
so that neither the text of the model nor the time to compile it depends on the length of the record.
Chain: **drives** -> reading.py -> lifted field; codegen/machine/objects.py links the table.
"""

from __future__ import annotations

import copy

import numpy as np
import sympy as sp

from ..door import checks
from ..door.columns import read_columns
from .model import Entry, EventSpec, Table
from .primitives import Memory

KINDS = ("spline", "line", "hold")


@checks.door()
class Drive:
    """A sampled input, for `System(drives={name: Drive(times, values)})`.

    Parameters
    ----------
    times : array_like, shape (n,), in the unit of the model's time
        Increasing; n >= 2, of a spline n >= 4. Runs have to stay between the first and the last.
    values : array_like, shape (n,)
        In the unit that the model gives the drive.
    kind : {"spline", "line", "hold"}
        A cubic spline through the samples, straight lines between them, or each value until the next sample.

    Attributes
    ----------
    t_span : (float, float), in the unit of the model's time
        First and last time.

    Raises
    ------
    ValueError, TypeError
        Times that do not increase, values that are not finite, too few of them, an unknown kind.

    Notes
    -----
    The spline is SciPy's CubicSpline, not-a-knot. A step ends at every sample.

    >>> y, v, ag = sp.symbols("y v ag", real=True)
    >>> times = np.linspace(0, 20, 401)
    >>> ground = Drive(times, np.sin(times))
    >>> slider = System({y: v, v: -ag - sp.sign(v)/2}, drives={ag: ground})
    >>> solution = solve(slider, (0, 20), {y: 0, v: 0})
    >>> solution.outcome.name, f"{solution['ag'][-1]:.6f}", f"{np.sin(20):.6f}"
    ('FINISHED', '0.912945', '0.912945')
    """

    def __init__(self, times, values, kind="spline"):
        self.times, self.values = checks.numbers(times, "`times`"), checks.numbers(values, "`values`")
        self.kind = checks.one_of(*KINDS)(kind, "`kind` of a Drive")
        least = 4 if kind == "spline" else 2
        if self.times.shape != self.values.shape or len(self.times) < least:
            raise ValueError(
                f"a Drive has `times` of shape {self.times.shape} and `values` of shape {self.values.shape}; give two "
                f"sequences of one length, at least {least}."
            )
        if not (np.diff(self.times) > 0).all():
            i = int(np.flatnonzero(np.diff(self.times) <= 0)[0])
            raise ValueError(
                f"`times` of a Drive must increase; {self.times[i + 1]:g} follows {self.times[i]:g}."
            )
        self.t_span = float(self.times[0]), float(self.times[-1])
        self.samples, self.derivatives = self.values, 0
        self.rows = self._rows()

    @classmethod
    def from_csv(cls, path, *, columns=(0, 1), kind="spline"):
        """A drive from a text file with commas, semicolons, tabs or spaces between its columns.

        Parameters
        ----------
        path : str or Path
            Lines that begin with no number, as a header, are left out.
        columns : (int or str, int or str)
            Those of the times and of the values, counted from 0, or by their names in the header.
        kind : {"spline", "line", "hold"}
            As of `Drive`.

        Returns
        -------
        Drive
            Of the numbers in both columns.

        Raises
        ------
        ValueError
            A line with too few columns, or with a column that is no number; a name that no header has; what `Drive`
            raises.
        OSError
            The file cannot be read.
        """
        columns = checks.several(columns, "`columns`")
        if len(columns) != 2:
            raise ValueError(
                f"`columns` has {len(columns)} entries; give that of the times and that of the values."
            )
        return cls(*read_columns(path, columns), kind)

    def _rows(self):
        """Of each cell t_k, c_d, ..., c_0; shape (n - 1, d + 2)."""
        starts, values = self.times[:-1, None], self.values[:-1, None]
        if self.kind == "hold":
            return np.hstack([starts, values])
        if self.kind == "line":
            slopes = np.diff(self.values) / np.diff(self.times)
            return np.hstack([starts, slopes[:, None], values])
        from scipy.interpolate import CubicSpline

        return np.hstack([starts, CubicSpline(self.times, self.values).c.T])

    def at(self, t):
        """The value at a time, in the unit of the values; nan outside of the record.

        Parameters
        ----------
        t : float or array_like, shape (nt,), in the unit of the times
            Where.

        Returns
        -------
        float or ndarray, shape (nt,), in the unit of the values
            Of the last sample where the drive jumps.
        """
        t = np.asarray(t, float)
        row = self.rows[np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.rows) - 1)]
        value = np.zeros(t.shape)
        for c in np.moveaxis(row, -1, 0)[1:]:
            value = value * (t - row[..., 0]) + c
        return np.where((t >= self.times[0]) & (t <= self.times[-1]), value, np.nan)[()]

    def derivative(self):
        """The rate of this drive, as a drive: of a position its velocity, of a velocity its acceleration.

        Returns
        -------
        Drive
            Of one degree less between the same times; its unit is that of the values over that of the times.

        Raises
        ------
        ValueError
            A drive of kind "hold", which jumps.
        """
        degree = self.rows.shape[1] - 2
        if degree == 0:
            raise ValueError(f"{self!r} is constant between its samples and jumps there; it has no derivative.")
        other = copy.copy(self)
        other.derivatives += 1
        other.rows = np.hstack([self.rows[:, :1], self.rows[:, 1:-1] * np.arange(degree, 0, -1)])
        other.values = other.at(self.times)
        return other

    def __eq__(self, other):
        return isinstance(other, Drive) and self._content == other._content

    def __hash__(self):
        return hash(self._content)

    @property
    def _content(self):
        return self.rows.shape, self.rows.tobytes(), self.t_span

    def __repr__(self):
        first, last = self.t_span
        return f"Drive({len(self.times)} samples over ({first:g}, {last:g}), kind={self.kind!r})"


def written(drive):
    """(times, samples, kind, derivatives): what `rewritten` makes the drive of."""
    return drive.times, drive.samples, drive.kind, drive.derivatives


def rewritten(times, samples, kind, derivatives):
    """The drive of what `written` gave."""
    made = Drive(times, samples, kind)
    for _ in range(derivatives):
        made = made.derivative()
    return made


def drive(value, what):
    """A Drive, or (times, values) or (times, values, kind) for one."""
    if isinstance(value, Drive):
        return value
    if not isinstance(value, (tuple, list)) or len(value) not in (2, 3):
        raise TypeError(f"{what} is {checks.shown(value)}; give (times, values) or a Drive.")
    return Drive(*value)


def pieces(sampled, time):
    """{symbol: (value, cell, table)} of drives: polynomial, memory with the number of its cell, coefficients.

    Drives of the same times, as one and its derivative, share a cell.
    """
    found, cells = {}, {}
    for symbol, drive in sampled:
        table = Table(symbol.name, drive.rows, drive.t_span[1])
        cell = cells.setdefault(drive.times.tobytes(), Memory(f"cell of {symbol.name}", 0))
        row = sp.Symbol(cell.name, real=True)
        origin, *coefficients = (Entry(table, row, sp.Integer(k)) for k in range(table.rows.shape[1]))
        value = sp.S.Zero
        for c in coefficients:
            value = value * (time - origin) + c
        found[symbol] = value, cell, table
    return found


def sampling(found, order):
    """The events that go on to the next cell at every sample; `order` are the states and memories."""
    tables = {}
    for _, cell, table in found.values():
        tables.setdefault(cell, []).append(table)
    return tuple(
        EventSpec(
            f"sample of {of[0].name}",
            at=tuple(of),
            update=((order.index(cell), sp.Symbol(cell.name, real=True) + 1),),
            recorded=False,
        )
        for cell, of in tables.items()
    )
