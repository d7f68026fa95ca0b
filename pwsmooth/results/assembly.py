"""What a run of a large family leaves: elements that were kept, the catalogue of events, and the slips in it.

Chain: paths/local.py -> **this file**.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..door import checks
from .records import EventLog

COLUMNS = {"t": "f8", "surface": "i4", "element": "i4", "kind": "i1", "came": "i1", "went": "i1"}
_CHUNK = 2**18


@dataclass(frozen=True)
class Recorded:
    """Elements of which times are kept.

    Attributes
    ----------
    t : ndarray, shape (nt,), in the unit of the model's time
    elements : tuple of int
        Their numbers 1, ..., n.
    x : dict of ndarray, shape (k, nt)
        Name of a state or multiplier -> its values, in its unit, a row an element.
    """

    t: np.ndarray
    elements: tuple[int, ...]
    x: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.x[str(name)]


@dataclass(frozen=True)
class Avalanches:
    """Clusters of slips: elements that are linked and slip at the same time, in the order of their beginning.

    Attributes
    ----------
    start, duration : ndarray, shape (k,), in the unit of the model's time
    area : ndarray of int, shape (k,)
        Elements that have slipped in it.
    slips : ndarray of int, shape (k,)
    moment : ndarray, shape (k,), in the unit of the state
        Sum of the lengths of the slips.
    epicentre : ndarray of int, shape (k,)
        The element that began.
    """

    start: np.ndarray
    duration: np.ndarray
    area: np.ndarray
    slips: np.ndarray
    moment: np.ndarray
    epicentre: np.ndarray

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True)
class Slips:
    """Slips of one switch, element by element: drawn over time they are what a fault is seen by.

    Attributes
    ----------
    start, end : ndarray, shape (k,), in the unit of the model's time
    element : ndarray of int, shape (k,)
        1, ..., n.
    length : ndarray, shape (k,), in the unit of the state
        How far the element has moved, on what it sticks to.
    """

    start: np.ndarray
    end: np.ndarray
    element: np.ndarray
    length: np.ndarray

    def __len__(self) -> int:
        return len(self.start)


def slips_between(
    element: np.ndarray, came: np.ndarray, went: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places of events of one switch: slips begin, these end, by element and then by time; and those that go on."""
    begins, ends = (came == 0) & (went != 0), (came != 0) & (went == 0)
    which = np.flatnonzero(begins | ends)
    which = which[np.lexsort((which, element[which]))]
    # Of an element beginnings and ends take turns; what has no partner began before or goes on.
    first, last = which[:-1], which[1:]
    same = element[first] == element[last]
    whole = begins[first] & ends[last] & same
    going = which[begins[which] & np.append(~same, True)[: len(which)]]
    return first[whole], last[whole], going


def cluster(found: Slips, links: np.ndarray) -> tuple[Avalanches, np.ndarray]:
    """The avalanches of slips, and of which one each slip is; row i of `links` has what element i is linked to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    begun, ended, who, length = found.start, found.end, found.element - 1, found.length
    count = len(found)
    if not count:
        empty, none = np.zeros(0), np.zeros(0, int)
        return Avalanches(empty, empty, none, none, empty, none), none
    # Rank of a beginning among all, so that one sorted key tells the last slip of an element before an instant.
    order = np.lexsort((begun, who))
    rank = np.argsort(np.argsort(begun, kind="stable"), kind="stable")
    keys = (who * count + rank)[order]
    edges = [np.zeros((2, 0), np.int64)]
    for column in links.T:
        beside = column[who]
        at = np.searchsorted(keys, beside * count + rank, side="right") - 1
        there = order[at]
        joined = (at >= 0) & (who[there] == beside) & (beside != who)
        joined &= ended[there] >= begun
        edges.append(np.stack([np.flatnonzero(joined), there[joined]]))
    a, b = np.concatenate(edges, axis=1)
    clusters, label = connected_components(
        coo_array((np.ones(len(a)), (a, b)), shape=(count, count)), directed=False
    )
    start = np.full(clusters, np.inf)
    np.minimum.at(start, label, begun)
    end = np.full(clusters, -np.inf)
    np.maximum.at(end, label, ended)
    slips, moment = np.bincount(label), np.bincount(label, length)
    area = np.bincount(np.unique(np.stack([label, who]), axis=1)[0], minlength=clusters)
    earliest = np.lexsort((begun, label))
    heads = earliest[np.concatenate([[True], label[earliest][1:] != label[earliest][:-1]])]
    order = np.argsort(start, kind="stable")
    place = np.empty(clusters, np.int64)
    place[order] = np.arange(clusters)
    found = Avalanches(
        start[order], (end - start)[order], area[order], slips[order], moment[order], who[heads][order] + 1
    )
    return found, place[label]


class Catalogue:
    """The events of a family, column by column, in memory or in a folder of Zarr's.

    Attributes
    ----------
    t : array, shape (ne,), in the unit of the model's time
    element : array of int, shape (ne,)
        1, ..., n.
    surface : array of int, shape (ne,)
        Which of the element's surfaces: its place in `surfaces`.
    surfaces : tuple of str
        Names of the switches and events of an element.
    kind, came, went : array of int, shape (ne,)
        As in `EventLog.codes`: what happened, and the multiplier's status before and after.
    states : dict of array, shape (ne,)
        Name of a state -> its value in the element just after, in its unit.
    """

    def __init__(
        self, columns: dict[str, Any], surfaces: Sequence[str], states: Sequence[str], links: np.ndarray
    ):
        self.surfaces, self._links = tuple(surfaces), links
        for name in COLUMNS:
            setattr(self, name, columns[name])
        self.states = {name: columns[f"state {name}"] for name in states}

    def __len__(self) -> int:
        return self.t.shape[0]  # type: ignore[attr-defined]

    def slips(self, state: str | None = None, drift: float = 0.0, surface: int = 0) -> Slips:
        """Slips of one switch.

        Parameters
        ----------
        state : str, optional
            The displacement whose change is the length of a slip; by default the first state.
        drift : float, in units of the state over time
            Speed of what the elements stick to.
        surface : int
            Place of the switch in `surfaces`.

        Returns
        -------
        Slips
            By element, then by time; without slips that had begun before the run, or had not ended with it.

        Raises
        ------
        ValueError
            No such state or surface.
        """
        state = next(iter(self.states)) if state is None else str(state)
        if state not in self.states:
            raise ValueError(f"`state` is {state!r}; the elements have {', '.join(self.states)}.")
        surface = checks.whole(surface, "`surface`", 0, len(self.surfaces) - 1)
        t, element, came, went = (np.asarray(getattr(self, c)[:]) for c in ("t", "element", "came", "went"))
        own = np.asarray(self.surface[:]) == surface  # type: ignore[attr-defined]
        t, element, came, went = t[own], element[own], came[own], went[own]
        x = np.asarray(self.states[state][:])[own]
        first, last, _ = slips_between(element, came, went)
        length = np.abs(x[last] - x[first] - drift * (t[last] - t[first]))
        return Slips(t[first], t[last], element[first].astype(np.int64), length)

    def avalanches(self, state: str | None = None, drift: float = 0.0, surface: int = 0) -> Avalanches:
        """Clusters of slips of one switch.

        Parameters
        ----------
        state : str, optional
            The displacement whose change is the length of a slip; by default the first state.
        drift : float, in units of the state over time
            Speed of what the elements stick to.
        surface : int
            Place of the switch in `surfaces`.

        Returns
        -------
        Avalanches
            Of all `slips`.

        Raises
        ------
        ValueError
            No such state or surface.

        Notes
        -----
        Two slips belong together if one begins while the other goes on and their elements are linked.
        """
        return cluster(self.slips(state, drift, surface), self._links)[0]


class StoredLog(EventLog):
    """The events of a family in words, from its catalogue."""

    def __init__(self, columns: dict[str, Any], first: np.ndarray, words: Any):
        self._columns, self._first, self._words = columns, first, words

    def __len__(self) -> int:
        return self._columns["t"].shape[0]

    @functools.cached_property
    def times(self) -> np.ndarray:  # type: ignore[override]
        return np.asarray(self._columns["t"][:])

    @functools.cached_property
    def codes(self) -> np.ndarray:  # type: ignore[override]
        surface, element, *others = (np.asarray(self._columns[name][:], np.int64) for name in list(COLUMNS)[1:])
        number = self._first[surface] + np.maximum(element - 1, 0)
        return np.stack([number, *others], axis=1)


class Writer:
    """Takes events while a run goes on, in memory or in a folder, behind the `rows` that the folder has.

    Raises
    ------
    ValueError
        The folder has fewer.
    """

    def __init__(self, path: Path | None, states: Sequence[str], rows: int = 0):
        self.path, self.states, self.rows = path, tuple(states), 0
        self._kept: list[dict[str, np.ndarray]] = []
        names = COLUMNS | {f"state {s}": "f8" for s in states}
        if path is None:
            self._names, self.rows = names, rows  # those before are not kept
            return
        import zarr

        if rows:
            found = zarr.open_group(path, mode="r+") if path.exists() else {}
            if any(name not in found or found[name].shape[0] < rows for name in names):
                raise ValueError(
                    f"`events` {str(path)!r} has lost events of the run that goes on from its checkpoint, which has "
                    f"{rows}; bring them back, or remove the checkpoint."
                )
            for half in path.rglob("*.partial"):  # a kill in the midst of writing leaves one
                half.unlink()
            self._group = found
            for name in names:
                found[name].resize((rows,))
            self.rows = rows
            return
        self._group = zarr.open_group(path, mode="w")
        for name, kind in names.items():
            self._group.create_array(name, shape=(0,), chunks=(_CHUNK,), dtype=kind)

    def append(self, columns: dict[str, np.ndarray], keep: bool = True) -> None:
        count = len(columns["t"])
        if not keep:
            pass
        elif self.path is None:
            self._kept.append({name: np.array(c) for name, c in columns.items()})
        else:
            for name, values in columns.items():
                array = self._group[name]
                array.resize((self.rows + count,))
                array[self.rows :] = values
        self.rows += count

    def columns(self) -> dict[str, Any]:
        """All that was taken."""
        if self.path is None:
            return {name: np.concatenate([np.zeros(0, kind), *(part[name] for part in self._kept)])
                    for name, kind in self._names.items()}  # fmt: skip
        return {name: self._group[name] for name in self._group.array_keys()}
