"""Statistics of the events of a large family, added up while a run goes on: memory does not grow with its length.

Chain: event_statistics.py, assembly.py -> **this file** -> paths/local.py, which gives the events up block
by block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from ..definition.families.event_statistics import WAITING, Activity, Histogram, SlipHistogram
from .assembly import Slips, cluster, slips_between

_AT_ONCE = 1e-12  # of the time
_FIXED = 1127  # binary places of a sum that every float fits in


def _added(total: str, values: np.ndarray) -> str:
    """The exact sum of a hexadecimal number of _FIXED binary places and of floats: it knows no blocks and no order."""
    mantissas, exponents = np.frexp(values)
    whole, found = np.ldexp(mantissas, 53).astype(np.int64), int(total, 16)
    for exponent in np.unique(exponents):
        part = whole[exponents == exponent]
        high, low = part >> 27, part & (2**27 - 1)  # whose sums fit in 64 bits
        found += ((int(high.sum()) << 27) + int(low.sum())) << (int(exponent) - 53 + _FIXED)
    return hex(found)


def begin(
    what: Any, name: str, surfaces: Sequence[str], states: Sequence[str], kinds: Mapping[int, str], start: float,
    links: np.ndarray,
) -> Statistic:  # fmt: skip
    """The Statistic `name` of one run, from its first time on; row i of `links` has what element i is linked to.

    ValueError where it names what there is not.
    """
    of_slips = isinstance(what, SlipHistogram)
    said = [("surface", what.surface, surfaces)]
    if of_slips:
        said += [("state", what.state, states)]
    else:
        said += [
            ("kind", what.kind, [*kinds.values()]),
            ("of", getattr(what, "of", WAITING), [WAITING, *states]),
        ]
    for which, one, among in said:
        if one is not None and one not in among:
            raise ValueError(f"`{which}` of statistic {name!r} is {one!r}; give one of {', '.join(among)}.")
    number = surfaces.index(what.surface) if what.surface is not None else 0 if of_slips else -1
    code = -1 if of_slips else next((code for code, word in kinds.items() if word == what.kind), -1)

    def chosen(columns: Mapping[str, np.ndarray]) -> np.ndarray:
        among = np.ones(len(columns["t"]), bool)
        if number >= 0:
            among &= columns["surface"] == number
        return among & (columns["kind"] == code) if code >= 0 else among

    if isinstance(what, SlipHistogram):
        return Clustering(what, chosen, what.state or states[0], links)
    return Series(what, chosen, start) if isinstance(what, Activity) else Counting(what, chosen, len(links))


class Statistic:
    """What adds up in one run.

    `chosen` tells which of a block's events are looked at.
    """

    def __init__(self, chosen: Callable[[Mapping[str, np.ndarray]], np.ndarray]):
        self._chosen = chosen

    def take(self, columns: Mapping[str, np.ndarray]) -> None:
        """Adds a block of events."""
        raise NotImplementedError

    def end(self, t: float) -> None:
        """The run ends here."""

    def numbers(self) -> dict[str, np.ndarray]:
        """All that is carried from block to block."""
        return {name: np.asarray(value) for name, value in vars(self).items() if name not in self._given}

    def go_on(self, numbers: Mapping[str, np.ndarray]) -> None:
        """From what a run that was stopped had carried."""
        for name, value in numbers.items():
            setattr(self, name, value if value.ndim else value.item())

    _given = frozenset({"_chosen", "_of", "_drift", "_links", "_state", "_every", "_start", "edges"})


class Counting(Statistic):
    """A `Histogram` or `SlipHistogram` that is filled.

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

    def __init__(self, what: Histogram | SlipHistogram, chosen: Any, elements: int):
        super().__init__(chosen)
        self._of = what.of
        self.edges = np.array(what.edges)
        self.counts, self.below, self.above = np.zeros(len(self.edges) - 1, np.int64), 0, 0
        self.largest = self.largest_t = math.nan
        self.largest_element = 0
        self._last = np.full(elements + 1 if what.of == WAITING else 0, math.nan)
        self._sum, self._number = "0", 0

    @property
    def mean(self) -> float:
        return float(Fraction(int(self._sum, 16), 1 << _FIXED) / self._number) if self._number else math.nan

    def take(self, columns: Mapping[str, np.ndarray]) -> None:
        """Adds a block of events."""
        among = self._chosen(columns)
        t, element = columns["t"][among], columns["element"][among]
        if self._of != WAITING:
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
        self._count(values, t, element)

    def _count(self, values: np.ndarray, t: np.ndarray, element: np.ndarray) -> None:
        """Adds values, with when and where they came."""
        if not len(values):
            return
        self._sum, self._number = _added(self._sum, values), self._number + len(values)
        place = np.searchsorted(self.edges, values, side="right")
        found = np.bincount(place, minlength=len(self.edges) + 1)
        self.counts += found[1:-1]
        self.below, self.above = self.below + int(found[0]), self.above + int(found[-1])
        most = np.flatnonzero(values == values.max())
        k = most[np.lexsort((element[most], t[most]))[0]]
        new = float(values[k]), float(t[k]), int(element[k])
        first = new[0] == self.largest and new[1:] < (self.largest_t, self.largest_element)
        if first or not new[0] <= self.largest:
            self.largest, self.largest_t, self.largest_element = new


class Clustering(Counting):
    """A `SlipHistogram` that is filled: it carries the events of the avalanches that are not over."""

    def __init__(self, what: SlipHistogram, chosen: Any, state: str, links: np.ndarray):
        super().__init__(what, chosen, 0)
        self._drift, self._links, self._state = what.drift, links, f"state {state}"
        self._open = np.zeros((5, 0))

    def take(self, columns: Mapping[str, np.ndarray]) -> None:
        """Adds a block of events."""
        among = self._chosen(columns)
        new = [columns[name][among] for name in ("t", "element", "came", "went", self._state)]
        self._open = np.concatenate([self._open, np.array(new, float)], axis=1)
        if len(columns["t"]):
            # Events at one instant may stand in two blocks, not in order of their last digits.
            now = float(columns["t"].max())
            self._close(now - _AT_ONCE * (1 + abs(now)), True)

    def end(self, t: float) -> None:
        """Avalanches in which all that slipped has come to rest are over, too."""
        self._close(math.inf, False)

    def _close(self, until: float, goes_on: bool) -> None:
        """Counts the avalanches that are over before this time, and forgets their events."""
        t, element, came, went, x = self._open
        first, last, going = slips_between(element, came, went)
        if not goes_on:
            going = going[:0]
        beginnings = np.concatenate([first, going])
        begun, who = t[beginnings], element[beginnings].astype(np.int64)
        ended = np.concatenate([t[last], np.full(len(going), math.inf)])
        length = np.abs(x[last] - x[first] - self._drift * (t[last] - t[first]))
        slips = Slips(begun, ended, who, np.concatenate([length, np.zeros(len(going))]))
        found, label = cluster(slips, self._links)
        over = found.start + found.duration < until
        if self._of == "length":
            done = over[label]
            self._count(slips.length[done], begun[done], who[done])
        else:
            values = getattr(found, self._of)[over].astype(float)
            self._count(values, found.start[over], found.epicentre[over])
        stay = ~over[label]
        ends = np.concatenate([last, going])
        self._open = self._open[:, np.unique([beginnings[stay], ends[stay]])]


class Series(Statistic):
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

    def __init__(self, what: Activity, chosen: Any, start: float):
        super().__init__(chosen)
        self._every, self._start = what.every, start
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
