"""Statistics of the events of a large family, added up while a run goes on: memory does not grow with its length.

Chain: **this file** -> recording.py -> paths/local.py, which gives the events up block by block.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import checks

WAITING = "waiting"


@dataclass(frozen=True, eq=False)
class Histogram:
    """Counts of events, by the time since the last one of their element or by a state of it, and the largest of them.

    Parameters
    ----------
    of : str
        "waiting", or the name of a state of the element, such as "v", which is taken after the event.
    edges : array_like, shape (nb + 1,), in the unit of what is counted
        Ascending: of the classes a <= value < b.
    surface : str, optional
        The switch, contact or event that is looked at; by default all of them.
    kind : str, optional
        As the records of the events have it, such as "impact" or "stick"; by default all.

    Raises
    ------
    ValueError, TypeError
        Edges that do not ascend, or fewer than two.

    Examples
    --------
    >>> from pwsmooth import Histogram, Recorder
    >>> from pwsmooth.scenes import granular_chain
    >>> waits = Histogram("waiting", [0, 1, 10, 100], kind="impact")
    >>> chain = granular_chain(n=60, restitution=0.9, gap=0.05, t_span=(0, 60))
    >>> run = chain.solve(record=Recorder(statistics={"waits": waits}, keep_events=False))
    >>> run.statistics["waits"].counts.tolist(), len(run.events)
    ([0, 551, 38], 0)
    """

    of: str
    edges: Sequence[float]
    surface: str | None = None
    kind: str | None = None

    def __post_init__(self) -> None:
        checks.fields(
            self, of=checks.name, surface=checks.optional(checks.name), kind=checks.optional(checks.name)
        )
        edges = checks.array(self.edges, "`edges`")
        if edges.ndim != 1 or len(edges) < 2 or not (np.diff(edges) > 0).all():
            raise ValueError(f"`edges` is {checks.shown(self.edges)}; give two or more numbers, ascending.")
        object.__setattr__(self, "edges", tuple(edges.tolist()))

    def _begin(self, elements: int, start: float, chosen: Any) -> Counting:
        """What counts in one run of so many elements; `chosen` tells which of a block's events are looked at."""
        return Counting(self, elements, chosen)


@dataclass(frozen=True, eq=False)
class Activity:
    """Numbers of events in equal spans of time: their mean, variance, largest and autocorrelation.

    Parameters
    ----------
    every : float, in units of time
        The span, > 0.
    lags : int
        Of the autocorrelation, in spans.
    surface, kind : str, optional
        As of `Histogram`.

    Raises
    ------
    ValueError, TypeError
        A span that is not positive.

    Examples
    --------
    >>> from pwsmooth import Activity, Recorder
    >>> from pwsmooth.scenes import granular_chain
    >>> chain = granular_chain(n=60, restitution=0.9, gap=0.05, t_span=(0, 60))
    >>> run = chain.solve(record=Recorder(statistics={"hits": Activity(6.0, lags=2)}, keep_events=False))
    >>> run.statistics["hits"].spans, run.statistics["hits"].mean
    (10, 64.8)
    """

    every: float
    lags: int = 20
    surface: str | None = None
    kind: str | None = None

    def __post_init__(self) -> None:
        checks.fields(
            self, every=checks.positive, lags=checks.integer(0, 10**6), surface=checks.optional(checks.name),
            kind=checks.optional(checks.name),
        )  # fmt: skip

    def _begin(self, elements: int, start: float, chosen: Any) -> Series:
        """What adds up in one run from a time on; `chosen` tells which of a block's events are looked at."""
        return Series(self, start, chosen)


class Counting:
    """A `Histogram` that is filled.

    Attributes
    ----------
    edges : ndarray, shape (nb + 1,)
    counts : ndarray of int, shape (nb,)
        Events of each class.
    below, above : int
        Events beyond the first and the last edge.
    mean : float
        Of all values, those beyond the edges too.
    largest, largest_t : float
        The largest value, and when it came; nan without events.
    largest_element : int
        And where, from 1 on; 0 without events.
    """

    def __init__(self, what: Histogram, elements: int, chosen: Any):
        self._of, self._chosen = what.of, chosen
        self.edges = np.array(what.edges)
        self.counts, self.below, self.above = np.zeros(len(self.edges) - 1, np.int64), 0, 0
        self.largest = self.largest_t = math.nan
        self.largest_element = 0
        self._last = np.full(elements + 1, math.nan) if what.of == WAITING else None
        self._sum, self._number = 0.0, 0

    @property
    def mean(self) -> float:
        return self._sum / self._number if self._number else math.nan

    def take(self, columns: Mapping[str, np.ndarray]) -> None:
        """Adds a block of events."""
        among = self._chosen(columns)
        t, element = columns["t"][among], columns["element"][among]
        if self._last is None:
            values = columns[f"state {self._of}"][among]
        else:
            # Events of one element one after the other, the first one after what the last block has left.
            order = np.lexsort((t, element))
            t, element = t[order], element[order]
            first = np.append(True, element[1:] != element[:-1])[: len(t)]
            before = np.where(first, self._last[element], np.roll(t, 1))
            ends = np.append(first[1:], True)[: len(t)]
            self._last[element[ends]] = t[ends]
            values = t - before
            known = ~np.isnan(values)
            t, element, values = t[known], element[known], values[known]
        if not len(values):
            return
        self._sum, self._number = self._sum + float(values.sum()), self._number + len(values)
        place = np.searchsorted(self.edges, values, side="right")
        found = np.bincount(place, minlength=len(self.edges) + 1)
        self.counts += found[1:-1]
        self.below, self.above = self.below + int(found[0]), self.above + int(found[-1])
        k = int(np.argmax(values))
        if not values[k] <= self.largest:
            self.largest, self.largest_t = float(values[k]), float(t[k])
            self.largest_element = int(element[k])

    def end(self, t: float) -> None:
        """Nothing is left over."""


class Series:
    """An `Activity` that is added up.

    Attributes
    ----------
    spans : int
        Whole spans of the run.
    mean, variance : float
        Of the numbers of events in them; nan without spans.
    largest : int
        The largest number.
    """

    def __init__(self, what: Activity, start: float, chosen: Any):
        self._every, self._start, self._chosen = what.every, start, chosen
        self.spans = self.largest = 0
        self._open = np.zeros(1, np.int64)  # counts of spans from number `spans` on
        self._tail = np.zeros(0, np.int64)  # the last ones before
        self._head = np.zeros(0, np.int64)  # the first ones of all
        self._sum, self._products = 0, np.zeros(what.lags + 1)

    @property
    def mean(self) -> float:
        return self._sum / self.spans if self.spans else math.nan

    @property
    def variance(self) -> float:
        return float(self._covariances()[0])

    @property
    def autocorrelation(self) -> np.ndarray:
        """Of lags 0, 1, ..., relative to the variance; nan where there are no two such spans."""
        found = self._covariances()
        with np.errstate(all="ignore"):
            return found / found[0]

    def _covariances(self) -> np.ndarray:
        lag = np.arange(len(self._products))
        pairs = self.spans - lag
        # sum (a - m)(b - m) over pairs, with what the sums of the pairs lack of the whole: the first and last spans.
        head = np.append(0, np.cumsum(self._head))[np.minimum(lag, len(self._head))]
        tail = np.append(0, np.cumsum(self._tail[::-1]))[np.minimum(lag, len(self._tail))]
        mean = self.mean
        with np.errstate(all="ignore"):
            found = (self._products - mean * (2 * self._sum - head - tail)) / pairs + mean**2
        return np.where(pairs > 0, found, math.nan)

    def take(self, columns: Mapping[str, np.ndarray]) -> None:
        """Adds a block of events."""
        t = columns["t"][self._chosen(columns)]
        if not len(t):
            return
        # Roundings may bring one too late for its span.
        number = np.maximum(np.floor((t - self._start) / self._every).astype(np.int64) - self.spans, 0)
        found = np.bincount(number, minlength=len(self._open))
        found[: len(self._open)] += self._open
        self._open = found
        self._close(len(found) - 1)

    def end(self, t: float) -> None:
        """Counts the spans up to the end of the run."""
        whole = int(math.floor((t - self._start) / self._every * (1 + 1e-12))) - self.spans
        self._open = np.append(self._open, np.zeros(max(whole - len(self._open), 0), np.int64))
        self._close(whole)

    def _close(self, count: int) -> None:
        """The first `count` open spans are over."""
        if count <= 0:
            return
        new, lags = self._open[:count], len(self._products) - 1
        rest = self._open[count:]
        self._open = rest if len(rest) else np.zeros(1, np.int64)
        known = np.append(self._tail, new).astype(float)
        for lag in range(lags + 1):
            later = known[max(len(known) - count, lag) :]
            self._products[lag] += later @ known[len(known) - len(later) - lag : len(known) - lag]
        self.spans, self._sum = self.spans + count, self._sum + int(new.sum())
        self.largest = max(self.largest, int(new.max()))
        self._head = np.append(self._head, new)[:lags]
        self._tail = np.append(self._tail, new)[-lags:] if lags else self._tail
