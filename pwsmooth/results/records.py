"""What a solution is made of: how a run ended, its events, ambiguities, segments and polynomials.

Kernels return integers and arrays; these records carry them in words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..door import checks
from ..door.describe import Described, Rows, some
from ..door.documenting import complete
from ..kernels.outcome import Outcome

__all__ = ["Ambiguity", "Dense", "EventLog", "EventRecord", "Outcome", "Segment"]


# An ambiguity of both paths, and how it may go on: the first is taken.
CONFLICTING_UPDATES = ("conflicting updates", ("in the order of the events", "in another order"))

# Of events, as EventRecord describes them.
KINDS = (
    "crossing", "stick", "slip", "slip by tangency", "slip by fold", "slip by reset", "sliding to sliding", "reset",
    "impact", "closed contact", "opening", "terminal", "accumulation", "ambiguity", "rest", "singular point",
)  # fmt: skip


@complete
@dataclass(frozen=True)
class EventRecord:
    """One event of a solution.

    Attributes
    ----------
    time : float, in the unit of the model's time
        When.
    switch : str
        Name of the switch, contact or event.
    kind : str
        A term of the field: "crossing", "stick", "slip by tangency", "slip by fold", "slip by reset",
        "sliding to sliding", "reset", "impact", "closed contact", "opening", "terminal", "accumulation", "ambiguity",
        "rest" (an argument of a root has come to 0 in finite time), "singular point".
    note : str
        What else is to be said.
    impulse : dict of str to float, or None
        Of an impact that an event-driven run has met: by name what each reaction, and each output that is linear in the
        reactions, integrates to over the instant, in its unit times that of time. None of other events, of impacts
        too many to count (accumulations) and of local runs.

    >>> x = sp.Symbol("x", real=True)
    >>> print(solve(System({x: -2 * sp.sign(x)}), (0, 5), {x: 1}).events[0])
    t = 0.5: stick [sgn(x)] (+1 to 0)

    A ball of 2 kg that slides along a table as it lands, with the friction of 0.3 times its weight:

    >>> y, v, u = sp.symbols("y v u", real=True)
    >>> table = Unilateral(y, restitution=0.5, name="R")
    >>> friction = -0.3 * table.reaction * sp.sign(u)
    >>> ball = System({y: v, v: -10 + table.reaction / 2, u: friction / 2}, contacts=[table], outputs={"T": friction})
    >>> sol = solve(ball, (0, 0.3), {y: 0.2, v: 0, u: 4})
    >>> {name: round(impulse, 3) for name, impulse in sol.events[0].impulse.items()}  # 2 kg (2 + 1) m/s; N s
    {'R': 6.0, 'T': -1.8}
    """

    time: float
    switch: str
    kind: str
    note: str = ""
    impulse: dict[str, float] | None = field(default=None, hash=False)

    def __str__(self) -> str:
        note = f" ({self.note})" if self.note else ""
        return f"t = {self.time:.9g}: {self.kind} [{self.switch}]{note}"


class _Told(Described):
    """Records that show themselves in a few lines."""

    def _described(self) -> tuple[str, Rows]:
        records: Any = self
        if not len(records):
            return "none", []
        plural = {EventRecord: "events", Ambiguity: "ambiguities", Segment: "segments"}
        return f"{len(records)} {plural[type(records[0])]}", [("", list(map(str, some(records))))]


class Listed(_Told, list):
    """A list of records."""

    def __getitem__(self, i: Any) -> Any:
        found = super().__getitem__(i)
        return Listed(found) if isinstance(i, slice) else found


@checks.door()
class EventLog(_Told, Sequence):
    """The events of a solution, put into words when they are asked for: a long run has many.

    It is a sequence of `EventRecord`.

    Parameters
    ----------
    times : ndarray, shape (ne,)
        In the unit of the model's time.
    codes : ndarray of int, shape (ne, k)
        What the kernels recorded of each, dimensionless.
    words : callable
        Codes of an event -> its switch, kind and note.
    impulses : callable, optional
        Index of an event -> its impulse, or None.

    >>> x = sp.Symbol("x", real=True)
    >>> events = solve(System({x: -2 * sp.sign(x)}), (0, 5), {x: 1}).events
    >>> len(events), events[-1].kind
    (1, 'stick')
    """

    _impulses: Callable[[int], dict[str, float] | None] | None = None

    def __init__(
        self, times: np.ndarray, codes: np.ndarray, words: Callable[..., Sequence[str]], impulses: Any = None
    ) -> None:
        self.times, self.codes, self._words, self._impulses = times, codes, words, impulses

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return Listed(self[k] for k in range(*i.indices(len(self))))
        impulse = self._impulses(range(len(self))[i]) if self._impulses else None
        return EventRecord(float(self.times[i]), *self._words(*self.codes[i].tolist()), impulse=impulse)

    def times_of(self, wanted: Callable[[EventRecord], bool]) -> np.ndarray:
        """Times of the events that `wanted` accepts; it is asked once for each switch and kind.

        Parameters
        ----------
        wanted : callable
            EventRecord -> bool.

        Returns
        -------
        ndarray, shape (k,)
            In the unit of the model's time.
        """
        if not len(self):
            return np.empty(0)
        # Combine surface and kind into one number: sorting rows is ten times slower.
        key = self.codes[:, 0] * (1 + self.codes[:, 1].max()) + self.codes[:, 1]
        _, first, which = np.unique(key, return_index=True, return_inverse=True)
        accepted = np.array([wanted(self[int(i)]) for i in first])
        return self.times[accepted[which.ravel()]].astype(float)

    def __reduce__(self) -> tuple[Any, ...]:
        # The functions that make the words exist in this process only: pickle the records themselves.
        return Listed, (list(self),)


class AmbiguityLog(_Told, Sequence):
    """The ambiguities of a run of very many, put into words when they are asked for."""

    def __init__(self, times: np.ndarray, codes: np.ndarray, words: Callable[..., list[Ambiguity]]) -> None:
        self.times, self.codes, self._words = times, codes, words

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, i: Any) -> Any:
        at = range(len(self))[i]
        if not isinstance(at, int):
            return Listed(self[k] for k in at)
        return self._words(self.times[at : at + 1], self.codes[at : at + 1])[0]

    def __reduce__(self) -> tuple[Any, ...]:
        return Listed, (list(self),)


def course(t: np.ndarray, status: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) and statuses (m, k) of a run's columns at its start, on both sides of every change, and at its end."""
    beside = np.zeros(len(t), bool)
    beside[1:] = (status[:, 1:] != status[:, :-1]).any(axis=0)
    beside[:-1] |= beside[1:]
    beside[[0, -1]] = True
    return t[beside], status[:, beside]


@complete
@dataclass(frozen=True)
class Ambiguity:
    """A point from which the solution is not unique: what it is, what was taken, what else was possible.

    Attributes
    ----------
    time : float, in the unit of the model's time
        When it was reached.
    switch : str
        Name of the switch, contact or event.
    kind : str
        "two-fold", "repelling sliding", "grazing", "corner", ...
    taken : str
        The continuation that the solution follows.
    continuations : tuple of str
        All that are possible.

    Source: Filippov 1988 for two-folds and repelling sliding.

    Examples
    --------
    A start on a surface that repels: both sides lead away, and staying is possible too.

    >>> x = sp.Symbol("x", real=True)
    >>> (ambiguity,) = solve(System({x: sp.sign(x)}), (0, 1), {x: 0}).ambiguities
    >>> ambiguity.kind, ambiguity.taken
    ('repelling sliding', 'leave to +1')
    """

    time: float
    switch: str
    kind: str
    taken: str
    continuations: tuple[str, ...] = ()

    def __str__(self) -> str:
        others = f"; possible: {', '.join(self.continuations)}" if self.continuations else ""
        return f"t = {self.time:.9g}: {self.kind} [{self.switch}], taken: {self.taken}{others}"


@complete
@dataclass(frozen=True)
class Segment:
    """A maximal interval of constant status.

    Attributes
    ----------
    start, end : float, in the unit of the model's time
        Its ends.
    name : str
        As it stands in the itinerary.
    status : tuple of int
        For every multiplier +1 or -1 on a side of its surface (+1 for an open contact) and 0 while it is solved.
    first, last : int
        The columns of the solution that bound the segment, both included; last is first - 1 where `t_eval` asked
        for none within it.

    >>> x = sp.Symbol("x", real=True)
    >>> solution = solve(System({x: -2 * sp.sign(x)}), (0, 5), {x: 1})
    >>> [(segment.name, segment.duration) for segment in solution.segments]
    [('sgn(x)=+1', 0.5), ('sgn(x) sliding', 4.5)]
    """

    start: float
    end: float
    name: str
    status: tuple[int, ...]
    first: int
    last: int

    def __str__(self) -> str:
        return f"t = {self.start:.9g} to {self.end:.9g}: {self.name}"

    @property
    def duration(self) -> float:
        """Length, in the unit of the model's time."""
        return self.end - self.start

    @property
    def columns(self) -> slice:
        """The solution's columns of this segment, to index `t`, `x` and `mult`."""
        return slice(self.first, self.last + 1)


@complete
@dataclass(frozen=True)
class Dense:
    """Piecewise polynomials, one piece a step, in the step's own variable s.

    A step in time has t = t0 + s, and all have without the optional coefficients. Beside a fold s is the arc of a
    multiplier, where t(s) is a polynomial and lambda(t) has only a square-root expansion. Calling it with times gives
    states, shape (n, nt), and multipliers, shape (m, nt); at an event those of the side after it.

    Attributes
    ----------
    t0, t1 : ndarray, shape (ns,)
        Start and end of each step, in the unit of the model's time.
    coefficients : ndarray, shape (ns, n, K+1)
        Of the states, in their units over powers of that of s.
    mult_coefficients : ndarray, shape (ns, m, K+1)
        Of the multipliers, in their units over powers of that of s.
    time_coefficients : ndarray, shape (ns, K+1), optional
        Of t(s), in units of time over powers of that of s.
    length : ndarray, shape (ns,), optional
        End of s, in its own unit.

    >>> x = sp.Symbol("x", real=True)
    >>> solution = solve(System({x: -x}), (0, 1), {x: 1}, dense_output=True)
    >>> states, multipliers = solution.dense(solution.t)
    >>> states.shape[0], multipliers.shape[0], len(solution.dense.t0) == len(solution.t) - 1
    (1, 0, True)
    """

    t0: np.ndarray
    t1: np.ndarray
    coefficients: np.ndarray
    mult_coefficients: np.ndarray
    time_coefficients: np.ndarray | None = None
    length: np.ndarray | None = None

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (n, nt) and multipliers (m, nt); at an event the side after it."""
        # The last piece that has begun: pieces of zero length and both sides of an event resolve to "after".
        piece = np.clip(np.searchsorted(self.t0, t, side="right") - 1, 0, len(self.t0) - 1)
        s = t - self.t0[piece]
        if self.time_coefficients is not None and self.length is not None:
            for i in np.flatnonzero(np.any(self.time_coefficients[piece, 2:] != 0, axis=1)):
                s[i] = _arc(self.time_coefficients[piece[i]], self.length[piece[i]], t[i])
        return _horner(self.coefficients, piece, s), _horner(self.mult_coefficients, piece, s)

    def _placed(self, points: int, end: float, wanted: Sequence[int]) -> _Placed:
        """Numbers of the steps, times and values at even places of each one's own variable, `points` in all or so.

        Shapes (steps,), (steps, places) and (rows, steps, places); `wanted` numbers the states, then the multipliers.
        """
        length = self.t1 - self.t0 if self.length is None else self.length
        steps = np.flatnonzero(length > 0)
        u, n, length = places(points, len(steps)), self.coefficients.shape[1], length[steps]
        t = self.t0[steps, None] + length[:, None] * u
        if self.time_coefficients is not None:
            arcs = np.flatnonzero((self.time_coefficients[steps, 2:] != 0).any(axis=1))
            if arcs.size:
                t[arcs] = _at_places(self.time_coefficients[steps[arcs]], length[arcs], u)
        rows = [self.coefficients[steps, k] if k < n else self.mult_coefficients[steps, k - n] for k in wanted]
        return steps, t, np.stack([_at_places(row, length, u) for row in rows])


@dataclass(frozen=True)
class StepPolynomials:
    """Dense output of implicit steps, one piece a step, in powers of (t - t0)/length.

    `coefficients` (ns, n, K+1) are those of the states; with `n`, the states end there and multipliers follow.
    """

    t0: np.ndarray
    length: np.ndarray
    coefficients: np.ndarray
    n: int | None = None

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (n, nt) and multipliers (m, nt); at an event the side after it."""
        piece = np.clip(np.searchsorted(self.t0, t, side="right") - 1, 0, len(self.t0) - 1)
        # In units of the step: powers of the step itself underflow inside a layer.
        x = _horner(self.coefficients, piece, (t - self.t0[piece]) / self.length[piece])
        n = len(x) if self.n is None else self.n
        return x[:n], x[n:]

    def _placed(self, points: int, end: float, wanted: Sequence[int]) -> _Placed:
        """As `Dense._placed`, up to the end of the run; an event cuts the step that it is found on."""
        length = np.append(self.t0[1:], end) - self.t0
        steps = np.flatnonzero(length > 0)
        u, length = places(points, len(steps)), length[steps]
        ends, t = length / self.length[steps], self.t0[steps, None] + length[:, None] * u
        return steps, t, np.stack([_at_places(self.coefficients[steps, k], ends, u) for k in wanted])


_Placed = tuple[np.ndarray, np.ndarray, np.ndarray]


def places(points: int, steps: int) -> np.ndarray:
    """Even places on [0, 1]: no more than 33, as nine showed corners where a step is a quarter of a period."""
    return np.linspace(0, 1, min(max(points // max(steps, 1), 2), 33))


def _at_places(coefficients: np.ndarray, ends: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Values (steps, places) at ends*u of polynomials with coefficients (steps, K+1)."""
    # A product a row: of all rows at once it is so large that the library wakes its threads, which takes longer.
    powers = np.arange(coefficients.shape[1])
    return (coefficients * ends[:, None] ** powers) @ u ** powers[:, None]


def _arc(coefficients: np.ndarray, end: float, t: float) -> float:
    """s in [0, end] with t(s) = t, where t(s) increases."""
    from scipy.optimize import brentq

    rest = coefficients[::-1].copy()
    rest[-1] -= t
    if rest[-1] >= 0:
        return 0.0
    return brentq(lambda s: np.polyval(rest, s), 0.0, end, xtol=1e-15) if np.polyval(rest, end) > 0 else end


def _horner(coefficients: np.ndarray, piece: np.ndarray, s: np.ndarray) -> np.ndarray:
    rows = np.zeros((len(s), coefficients.shape[1]))
    for k in range(coefficients.shape[2] - 1, -1, -1):
        rows = rows * s[:, None] + coefficients[piece, :, k]
    return rows.T
