"""Which statistics of the events of a large family are added up while a run goes on.

Chain: **this file** -> recording.py -> results/counting.py, which adds up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...door import checks

WAITING = "waiting"
OF_SLIPS = "length", "moment", "area", "slips", "duration"


def _edges(value: Any) -> tuple[float, ...]:
    edges = checks.array(value, "`edges`")
    if edges.ndim != 1 or len(edges) < 2 or not (np.diff(edges) > 0).all():
        raise ValueError(f"`edges` is {checks.shown(value)}; give two or more numbers, ascending.")
    return tuple(edges.tolist())


@checks.door()
@dataclass(frozen=True, eq=False)
class Histogram:
    """Counts of events, by the time since the last one of their element or by a state of it, and the largest of them.

    Parameters
    ----------
    of : str
        "waiting", or the name of a state of the element, such as "v", which is taken after the event.
    surface : str, optional
        The switch, contact or event that is looked at; by default all of them.
    kind : str, optional
        As the records of the events have it, such as "impact" or "stick"; by default all.

    Raises
    ------
    ValueError, TypeError
        Edges that do not ascend, or fewer than two.

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
        object.__setattr__(self, "edges", _edges(self.edges))


@checks.door()
@dataclass(frozen=True, eq=False)
class SlipHistogram:
    """Counts of slips or of avalanches, by their size, and the largest of them.

    An avalanche is a cluster of slips of one switch: two belong together if one begins while the other goes on and
    their elements are linked.

    Parameters
    ----------
    of : str
        "length" of each slip; or of avalanches "moment" (the sum of these), "area" (how many elements), "slips" (how
        many), "duration".
    state : str, optional
        The displacement whose change is the length of a slip; by default the first state.
    drift : float, in units of the state over time
        Speed of what the elements stick to.
    surface : str, optional
        The switch; by default the first one.

    Raises
    ------
    ValueError, TypeError
        Edges that do not ascend, or fewer than two; nothing of that name.

    Notes
    -----
    Not counted is what had begun before the run or does not end with it. What slips without end keeps its avalanche
    in memory.

    >>> train = block_train(StaticKinetic(F_s=1.3), n=100, t_span=(0, 40))
    >>> areas = SlipHistogram("area", [1, 2, 5, 101])
    >>> run = train.solve(record=Recorder(statistics={"areas": areas}, keep_events=False))
    >>> run.statistics["areas"].counts.tolist(), run.statistics["areas"].largest
    ([32, 7, 4], 100.0)
    """

    of: str
    edges: Sequence[float]
    state: str | None = None
    drift: float = 0.0
    surface: str | None = None

    def __post_init__(self) -> None:
        checks.fields(
            self, of=checks.name, state=checks.optional(checks.name), drift=checks.number,
            surface=checks.optional(checks.name),
        )  # fmt: skip
        if self.of not in OF_SLIPS:
            raise ValueError(f"`of` is {self.of!r}; give one of {', '.join(OF_SLIPS)}.")
        object.__setattr__(self, "edges", _edges(self.edges))


@checks.door()
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
